// Every setting of every type that can be retuned: retune and adopt take over all of them.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <support/friction.hpp>
#include <support/settings_law.hpp>

namespace esokit_test {
namespace control_settings_law_test {

using namespace esokit;
using settings::every_setting_is_adopted;
using settings::fill;
using settings::subject;

template <class T>
settings::Subject of(void (*change)(typename T::Config&) = nullptr, bool starts_anew = true) {
  typename T::Config config{};
  fill(config);
  if (change != nullptr) change(config);
  return subject<T>(config, starts_anew);
}

/// A setting that says what `make` accepts, and nothing else.
constexpr int only_accepts(int setting) { return setting; }

#define NAMED(...) \
#__VA_ARGS__, { of<__VA_ARGS__>() }

TEST(Settings, OfObserversAreAdopted) {
  every_setting_is_adopted(NAMED(LinearEso<2, float>));
  using Placed = LinearEso<1, double, 1, PoleSet>;
  every_setting_is_adopted("PoleSet", {of<Placed>([](auto& c) { c.poles = {-20.0, -30.0}; })});
  using Cascade = CascadeEso<1, 2>;
  every_setting_is_adopted("CascadeEso", {of<Cascade>(), of<Cascade>([](auto& c) {
                                            c.observer_bandwidth = c.bandwidth_factor = 0;
                                            c.level_bandwidths = {20, 30};
                                          })});
  every_setting_is_adopted(NAMED(HalfGainEso<1>));
  using Switched = AdjustableBandwidthEso<1>;
  every_setting_is_adopted("AdjustableBandwidthEso",
                           {of<Switched>([](auto& c) { c.bandwidth_ratio = 0.8; })},
                           {only_accepts(3)});
  using Nonlinear = NonlinearEso<1, double, 1>;
  every_setting_is_adopted("NonlinearEso",
                           {of<Nonlinear>([](auto& c) {
                              c.shape = {0.7, 0.8, 0.3, 0.5};
                              c.gain_min = 0.7;
                              c.gain_max = 1.2;
                            }),
                            of<Nonlinear>([](auto& c) {
                              c.shape = {0.7, 0.8, 0.3, 0.5};
                            })},
                           {only_accepts(10)});
  using Fal = NonlinearEso<1, double, 1, FalGain<double>>;
  every_setting_is_adopted("FalGain",
                           {of<Fal>([](auto& c) {
                              c.gain_min = 0.7;
                              c.gain_max = 1.2;
                            }),
                            of<Fal>()},
                           {only_accepts(9)});
  using Algebraic = AlgebraicEso<1>;
  every_setting_is_adopted(
      "AlgebraicEso",
      {of<Algebraic>([](auto& c) { c.frequency_shift = 20; }), of<Algebraic>([](auto& c) {
         c.frequency_shift = 20;
         c.blanking = 0.1;
       }),
       of<Algebraic>([](auto& c) {
         c.frequency_shift = 20;
         c.measurement_noise = 0.03;
         c.disturbance_noise = 1;
       })},
      {only_accepts(9)});
  using Filter = ExtendedStateFilter<1>;
  const auto noisy = [](auto& c) {
    c.measurement_variance = 1e-2;
    c.disturbance_bounds = {0.02, 0.3};
    c.inflation = 0.05;
    c.initial_covariance = {{1, 0.25}, {0.25, 1}};
    c.outlier_threshold = 9;
  };
  every_setting_is_adopted("ExtendedStateFilter",
                           {of<Filter>(noisy), of<Filter>([](auto& c) {
                              c.measurement_variance = 1e-2;
                              c.process_covariance = {{1e-3, 1e-4}, {1e-4, 0.1}};
                              c.inflation_rule = InflationRule::adaptive;
                            })},
                           {only_accepts(16)});
  every_setting_is_adopted("ModelEso", {of<ModelEso<ModelParts{.order = 1,
                                                               .plant_poles = true,
                                                               .actuator = 1,
                                                               .sensor = 2,
                                                               .resonators = 1,
                                                               .first_order = 1}>>([](auto& c) {
                             c.max_gap = 3;
                             c.model.plant = {3};
                             c.model.actuator.time_constant = 0.05;
                             c.model.sensor = {.frequency = 40, .damping = 0.7};
                             c.model.resonators[0] = {.frequency = 15, .capture_bandwidth = 10};
                             c.model.first_order[0] = 0.5;
                           })});
}

TEST(Settings, OfAdaptersAreAdopted) {
  every_setting_is_adopted(NAMED(DelayedInput<LinearEso<1>, 4>));
  using Gated = WrappedOutput<OutlierGate<LinearEso<1>>>;
  // A gate's running mean of the noise outlives a reset.
  const auto by_mean = [](auto& c) {
    c.observer.threshold = 0.3;
    c.observer.running_factor = 20;
  };
  every_setting_is_adopted("WrappedOutput<OutlierGate>", {of<Gated>(), of<Gated>(by_mean, false)});
  every_setting_is_adopted(NAMED(Measured<LinearEso<1>, 1, 4>));
  every_setting_is_adopted(NAMED(VariableTime<KnownModel<LinearEso<1>, Friction<0, double>>>));
  every_setting_is_adopted(NAMED(Guarded<LinearEso<1>>));
  every_setting_is_adopted(NAMED(MappedInput<LinearEso<1>, 3>));
  every_setting_is_adopted(NAMED(MappedInput<Guarded<LinearEso<1>>, 3>));
  every_setting_is_adopted(
      "Guarded<ModelEso>",
      {of<Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}>>>([](auto& c) {
        c.observer.max_gap = 3;
        c.observer.model.actuator.time_constant = 0.05;
      })});
}

/// With gains in the place of a bandwidth.
template <class Config>
void by_gains(Config& c) {
  c.controller_bandwidth = 0;
  c.gains.emplace().fill(7);
}

/// Without a safe input, which excludes that the last u is held.
template <class Config>
void unsaid(Config& c) {
  if constexpr (requires { c.observers; }) {
    for (auto& missing : c.missing) missing.input.reset();
  } else {
    c.missing.input.reset();
  }
}

template <class Config>
void softly(Config& c) {
  c.soften = true;
}

TEST(Settings, OfControllersAreAdopted) {
  // The settings of a start hold are not seen after a start, see OfAStartHoldAreAdopted.
  using Varying = Adrc<VariableTime<LinearEso<2>>>;
  every_setting_is_adopted("Adrc<VariableTime>",
                           {of<Varying>([](auto& c) { c.missing.stay = true; }),
                            of<Varying>([](auto& c) { c.domain = TimeDomain::sampled; }),
                            of<Varying>(by_gains), of<Varying>(softly), of<Varying>(unsaid)},
                           {13, 14});
  using Guards = Adrc<Guarded<LinearEso<1>>, ErrorBased>;
  every_setting_is_adopted(
      "Adrc<Guarded>", {of<Guards>(), of<Guards>(by_gains), of<Guards>(softly), of<Guards>(unsaid)},
      {15, 16});
  using Mapped = Adrc<MappedInput<LinearEso<1>, 3>>;
  every_setting_is_adopted(
      "Adrc<MappedInput>",
      {of<Mapped>(), of<Mapped>(by_gains), of<Mapped>(softly), of<Mapped>(unsaid)}, {20, 21});
  using Plain = Adrc<LinearEso<1>>;
  every_setting_is_adopted(
      "Adrc", {of<Plain>(), of<Plain>(by_gains), of<Plain>(softly), of<Plain>(unsaid)}, {11, 12});
  using Rests = Resting<Plain>;
  every_setting_is_adopted("Resting",
                           {of<Rests>(), of<Rests>([](auto& c) { by_gains(c.controller); }),
                            of<Rests>([](auto& c) { softly(c.controller); }),
                            of<Rests>([](auto& c) { unsaid(c.controller); }),
                            of<Rests>([](auto& c) { c.rest = {}; })},  // takes a divider
                           {11, 12});
  using Predictive = PredictiveAdrc<LinearEso<2>>;
  every_setting_is_adopted("PredictiveAdrc",
                           {of<Predictive>(), of<Predictive>(by_gains), of<Predictive>(unsaid)});
  using Around = DisturbanceCompensator<LinearEso<1>>;
  every_setting_is_adopted(
      "DisturbanceCompensator",
      {of<Around>(), of<Around>([](auto& c) { c.compensation_gain = -0.25; }), of<Around>(unsaid)},
      {9, 10});
  // b0 is that of the matrix, and all channels have one sample time.
  using Two = MimoAdrc<LinearEso<1>, LinearEso<2>>;
  every_setting_is_adopted("MimoAdrc", {of<Two>(), of<Two>(unsaid)}, {1, 2, 5, 6});
}

/// What is held at the start is of what was just made: with u it hands over a state, so there is no
/// start without it to compare from.
template <class T>
void adopts_what_is_held() {
  typename T::Config config{};
  fill(config);
  config.limits.rate = 1e9;
  auto held = T::make(config).value();
  config.start_hold.input = 0.75;
  ASSERT_TRUE(held.adopt(T::make(config).value()).has_value());
  EXPECT_EQ(held.update(0, 0), 0.75);
}

TEST(Settings, OfAStartHoldAreAdopted) {
  adopts_what_is_held<Adrc<LinearEso<1>>>();
  adopts_what_is_held<DisturbanceCompensator<LinearEso<1>>>();
}

#undef NAMED

}  // namespace control_settings_law_test
}  // namespace esokit_test
