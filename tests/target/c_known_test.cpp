// The C of known nonlinear terms equals them bit for bit, as in c_code_test.cpp: functions that are
// generic in the scalar are recorded.
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/friction.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_known_test {

using namespace esokit;
using detail::Writable;

/// What a user writes: constants of its own, functions of <cmath>, and a select instead of a
/// branch.
template <class V>
struct Pendulum {
  V gravity = 3;
  V coulomb = V(0.2);
  template <class E>
  auto operator()(const E& x) const noexcept {
    using esokit::select;
    using std::sin;
    auto sum = -gravity * sin(x(0));
    sum -= select(x(1) > 0, coulomb, -coulomb);
    return sum;
  }
};
/// Finite for few of the numbers that a test gives.
template <class V>
struct Odd {
  template <class E>
  auto operator()(const E& x) const noexcept {
    using esokit::select;
    using std::abs, std::atan, std::cos, std::exp, std::pow, std::sqrt, std::tan, std::tanh;
    const V half = V(0.5);
    const auto small = select(abs(x(0)) < half, x(0), half);
    return tanh(x(1) / V(0.05)) + cos(x(0)) - half * tan(small) + atan(x(0)) * sqrt(x(0)) -
           pow(abs(x(0)), half) + exp(8 * x(0)) / 1000;
  }
};
template <class Observer, template <class> class Model = Pendulum>
using Known = KnownModel<Observer, Model<typename Observer::scalar_type>>;
/// Typed on the estimate of one scalar.
struct OfDouble {
  double operator()(const Vector<double, 3>& x) const noexcept { return x(1) > 0 ? -1.0 : 1.0; }
};

static_assert(Writable<Known<LinearEso<2>>> &&
              Writable<Adrc<DelayedInput<Known<LinearEso<2>>, 3>>> &&
              Writable<KnownModel<LinearEso<1>, Friction<0, double>>> &&
              !Writable<KnownModel<LinearEso<2>, OfDouble>> &&
              !Writable<Adrc<KnownModel<LinearEso<2>, OfDouble>>> &&
              !Writable<Known<Known<LinearEso<2>>>> && !Writable<Known<AlgebraicEso<2>>>);

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

TEST(CKnown, OfKnownTerms) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<Known<LinearEso<2, double>>>(30000, 1001);
  equals<Known<LinearEso<2, float>>>(30000, 1011);
  equals<Known<LinearEso<2, double>, Odd>>(30000, 1021);
  equals<Known<LinearEso<2, float>, Odd>>(30000, 1031);
  equals<Known<LinearEso<3, double>>>(30000, 1041);  // it softens
  equals<Known<CascadeEso<2, 3, float>>>(30000, 1051);
  observes<Known<CascadeEso<2, 2, double>, Odd>>(30000, 1061);
  equals<Known<ModelEso<sine, double>>>(30000, 1071);
  equals<Known<ExtendedStateFilter<2, double>>>(30000, 1081);
  equals_changed<Adrc<KnownModel<LinearEso<1, float>, Friction<0, float>>>>(
      30000, 1091, "gcc -std=c99",
      [](auto& settings) { settings.observer.model = {.coefficient = 4}; });
}

TEST(CKnown, OfKnownTermsInAndAroundOthers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals<DelayedInput<OutlierGate<Known<LinearEso<2, double>>>, 3>>(30000, 1101);
  observes<DelayedInput<Known<OutlierGate<LinearEso<2, float>>, Odd>, 3>>(30000, 1111);
  equals<WrappedOutput<Known<LinearEso<2, double>>>>(30000, 1121);
  equals<Known<WrappedOutput<LinearEso<2, float>>>>(30000, 1131);
  observes<Known<WrappedOutput<LinearEso<2, double>>>>(30000, 1141);
  equals<Measured<Known<LinearEso<2, double>>, 1, 4>>(30000, 1151);
  equals<Known<Measured<LinearEso<2, float>, 1, 4>>>(30000, 1161);
  equals_controller<Adrc<Known<LinearEso<2, double>>, ErrorBased>>(30000, 1171);
  equals_controller<DisturbanceCompensator<Known<LinearEso<2, double>>>>(30000, 1181);
  equals_controller<Adrc<DelayedInput<Known<LinearEso<2, float>>, 3>>>(30000, 1191, "gcc -std=c99",
                                                                       2);
}

TEST(CKnown, CompilesWithOtherCompilers) {
  compiles<Adrc<Known<LinearEso<2, float>, Odd>>>();
  compiles<DisturbanceCompensator<DelayedInput<OutlierGate<Known<CascadeEso<1, 2, double>>>, 3>>>();
  compiles_changed<Adrc<WrappedOutput<Known<LinearEso<2, double>>>>>(
      [](auto& settings) { settings.measurement_divider = 2; });
}

TEST(CKnown, RefusesBadNumbersUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  refuses_under_fast_math<Adrc<Known<LinearEso<2, float>>>>();
  refuses_under_fast_math<Adrc<DelayedInput<Known<CascadeEso<1, 2, double>>, 3>>>();
}

TEST(CKnown, NamesWhatTheLibraryComputes) {
  const auto header = [](const auto& observer) { return to_c(observer)->header; };
  const std::string told = "bit for bit,\n * where the C library has the same ";
  using Sine = Known<LinearEso<2, float>>;
  using None = KnownModel<LinearEso<1, double>, Friction<0, double>>;
  const std::string sine = header(Sine::make(observer_config<Sine>(8)).value());
  const std::string none = header(None::make(observer_config<None>(8)).value());
  EXPECT_NE(sine.find(told + "sinf. */"), std::string::npos) << sine;
  EXPECT_NE(none.find("bit for bit. */"), std::string::npos) << none;
}

TEST(CKnown, RefusesASoftenedLawOfAnAngle) {
  using Softened = Adrc<WrappedOutput<Known<LinearEso<3, double>>>>;
  const auto code = to_c(Softened::make(config<Softened>(8)).value());
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "soften");
}

TEST(CKnown, AdoptsSettings) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  adopts<Adrc<Known<LinearEso<2, double>>>>(1201, true);
  adopts<DisturbanceCompensator<Known<LinearEso<2, float>, Odd>>>(1211, false);
}

#endif

}  // namespace target_c_known_test
}  // namespace esokit_test
