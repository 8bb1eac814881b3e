// A loop around every adapter is back at its reference, at rest, whatever garbage the sensor, the
// report of the actuator and the operator gave it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <control/loop_traits.hpp>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <limits>
#include <support/friction.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
namespace control_reconvergence_test {

using namespace esokit;

constexpr double sample_time = 0.01;
constexpr double turn = 6.25;

template <class S, class Config>
void set(Config& config, double omega_T) {
  if constexpr (requires { config.period; }) config.period = S(turn);
  if constexpr (requires { config.threshold; }) config.threshold = S(0.5);
  if constexpr (requires { config.observer; }) {
    set<S>(config.observer, omega_T);
  } else {
    fill_settings<S>(config, omega_T / sample_time, sample_time, 1);
  }
}

template <class Controller>
class LoopReconvergence : public testing::Test {};

using Controllers = testing::Types<
    Adrc<LinearEso<2>>, Adrc<LinearEso<2, float>, ErrorBased>, Adrc<WrappedOutput<LinearEso<2>>>,
    Adrc<WrappedOutput<LinearEso<2>>, ErrorBased>, Adrc<WrappedOutput<LinearEso<2, float>>>,
    Adrc<WrappedOutput<CascadeEso<2, 2>>>, Adrc<DelayedInput<WrappedOutput<LinearEso<2>>, 2>>,
    Adrc<WrappedOutput<OutlierGate<LinearEso<2>>>, ErrorBased>,
    Adrc<VariableTime<WrappedOutput<LinearEso<2>>>>,
    Adrc<KnownModel<WrappedOutput<LinearEso<2>>, Friction<1, double>>>, Adrc<Guarded<LinearEso<2>>>,
    Adrc<WrappedOutput<ModelEso<ModelParts{.order = 2, .plant_poles = true}>>>>;
TYPED_TEST_SUITE(LoopReconvergence, Controllers);

TYPED_TEST(LoopReconvergence, BackAtTheReference) {
  using S = typename TypeParam::scalar_type;
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(long_run(100)); ++seed) {
    Random random(seed);
    typename TypeParam::Config config{.controller_bandwidth = S(4),
                                      .limits = {.lower = S(-2), .upper = S(2)}};
    set<S>(config.observer, random.uniform(0.7, 3));
    auto controller = TypeParam::make(config).value();
    constexpr bool wraps = requires { controller.observer().wrap(S(0)); };
    ChainPlant<2> plant(sample_time, 1, random.uniform(-1, 1));
    const double reference = random.uniform(-3, 3);
    const S r = static_cast<S>(reference);
    const auto angle = [&] {
      const double y = plant.output();
      return static_cast<S>(wraps ? y - turn * std::floor(y / turn) : y);
    };
    for (int k = random.index(200); k > 0; --k) {
      plant.step(static_cast<double>(controller.update(angle(), r)));
    }
    for (int k = random.index(30); k > 0; --k) {
      S u = controller.output();
      if constexpr (requires { controller.observer().set_trust(S(0)); }) {
        controller.observer().set_trust(anything<S>(random));
        controller.observer().set_pin(static_cast<Pin>(random.index(4)));
        (void)controller.set_input_gain(anything<S>(random));
        if (random.index(4) == 0) {
          (void)controller.hold(anything<S>(random), anything<S>(random), anything<S>(random));
        }
      }
      switch (random.index(6)) {
        case 0:
          (void)controller.start(anything<S>(random), anything<S>(random));
          u = controller.output();
          break;
        case 1:
          u = controller.track(anything<S>(random), anything<S>(random), anything<S>(random));
          break;
        case 2:
          u = controller.update(angle(), r, anything<S>(random));
          break;
        default:
          u = controller.update(anything<S>(random), anything<S>(random));
      }
      ASSERT_TRUE(is_finite(u)) << seed;
      // What the actuator cannot hold it does not.
      plant.step(std::clamp(static_cast<double>(u), -2.0, 2.0));
    }
    if constexpr (requires { controller.observer().set_trust(S(0)); }) {
      controller.observer().set_trust(S(1));
      controller.observer().set_pin(Pin::free);
      ASSERT_TRUE(controller.set_input_gain(S(1)).has_value());
    }
    // While the observer finds back a saturated u carries the plant away, and that far it has to
    // come back; an angle only has to stop.
    for (int k = 0; k < (wraps ? 12000 : 60000); ++k) {
      const S u = controller.update(angle(), r);
      ASSERT_TRUE(u >= S(-2) && u <= S(2)) << seed;
      plant.step(static_cast<double>(u));
    }
    const double off = plant.output() - reference;
    const double tolerance = 1e4 * static_cast<double>(std::numeric_limits<S>::epsilon());
    ASSERT_NEAR(wraps ? off - turn * std::round(off / turn) : off, 0, tolerance) << seed;
    ASSERT_NEAR(plant.state()(1), 0, 10 * tolerance) << seed;
    ASSERT_EQ(controller.mode(), LoopMode::running);
    ASSERT_EQ(controller.status(), StepStatus::ok);
  }
}

}  // namespace control_reconvergence_test
}  // namespace esokit_test
