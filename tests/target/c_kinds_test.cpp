// The C of models, of gains that depend on the innovation, of delays and of other controllers
// equals them bit for bit, as in c_code_test.cpp.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_kinds_test {

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

using namespace esokit;

TEST(CKinds, OfModels) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<ModelEso<lag, float>>(30000, 141);
  equals<ModelEso<lag, double, PoleSet>>(30000, 151);
  equals<ModelEso<everything, double>>(30000, 161);
  equals<ModelCascadeEso<lag, 2, double>>(30000, 171);
  equals<PlantEso<2, sine, float>>(30000, 181);
  observes<PlantCascadeEso<2, sine, 2, double>>(30000, 191);
  observes<ModelEso<everything, float>>(30000, 201);
}

TEST(CKinds, OfGainsThatDependOnTheInnovation) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<AdjustableBandwidthEso<2, float>>(30000, 211);
  equals<NonlinearEso<1, double>>(30000, 221);
  observes<NonlinearEso<1, float, 1, FalGain<float>>>(30000, 231);
}

TEST(CKinds, OfDelaysAndOtherForms) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Delayed = DelayedInput<LinearEso<2, float>, 6>;
  equals<Delayed>(30000, 241);
  observes<DelayedInput<CascadeEso<1, 2, double>, 3>>(30000, 251);
  equals<OutlierGate<LinearEso<2, float>>>(30000, 311);
  observes<OutlierGate<DelayedInput<ModelEso<everything, double>, 3>>>(30000, 321);
  equals_controller<Adrc<DelayedInput<OutlierGate<LinearEso<1, double>>, 3>, ErrorBased>>(30000,
                                                                                          331);
  equals_controller<Adrc<LinearEso<2, double>, ErrorBased>>(30000, 261);
  equals_controller<Adrc<Delayed, ErrorBased>>(30000, 271);
  equals_controller<DisturbanceCompensator<LinearEso<1, float>>>(30000, 281);
  equals_controller<Adrc<LinearEso<2, float>>>(30000, 291, "gcc -std=c99", 3);
  equals_controller<Adrc<DelayedInput<ModelEso<lag, double>, 3>>>(30000, 301, "gcc -std=c99", 2);
}

/// A rate of which u cannot hold every step: what waits is a state of the C, too.
TEST(CKinds, OfARateBelowTheDigits) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const double digits : {0.05, 3.0}) {
    const auto slow = [digits](auto& settings) {
      using V = decltype(settings.limits.rate);
      settings.limits.rate = static_cast<V>(digits) * std::numeric_limits<V>::epsilon() * V(128);
    };
    equals_changed<Adrc<LinearEso<1, float>>>(30000, 341, "gcc -std=c99", slow);
    equals_changed<Adrc<DelayedInput<LinearEso<2, double>, 3>, ErrorBased>>(30000, 351,
                                                                            "gcc -std=c99", slow);
    equals_changed<DisturbanceCompensator<LinearEso<1, float>>>(30000, 361, "gcc -std=c99", slow);
  }
}

#endif

}  // namespace target_c_kinds_test
}  // namespace esokit_test
