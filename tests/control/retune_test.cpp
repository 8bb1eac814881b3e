// Settings that change while running: how often is designed, and that a design made elsewhere does
// the same.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/friction.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
namespace control_retune_test {

using esokit::Adrc;
using esokit::Check;
using esokit::Error;
using esokit::Expected;
using esokit::LinearEso;

/// A LinearEso that counts its designs.
struct Counted : LinearEso<2> {
  static inline int designs = 0;
  static Expected<Counted, Error<double>> make(const Config& config) {
    ++designs;
    const auto made = LinearEso<2>::make(config);
    if (!made) return made.error();
    return Counted(*made);
  }
  Check<double> adopt(const Counted& fresh) { return LinearEso<2>::adopt(fresh); }
  Check<double> retune(const Config& config) { return esokit::detail::retune(*this, config); }

 private:
  explicit Counted(const LinearEso<2>& made) : LinearEso<2>(made) {}
};

LinearEso<2>::Config first() {
  return {.observer_bandwidth = 40, .input_gain = 5, .sample_time = 0.01};
}
LinearEso<2>::Config second() {
  return {.observer_bandwidth = 25, .input_gain = 7, .sample_time = 0.01};
}

/// Of a channel of MimoAdrc, whose b0 stands in the matrix.
LinearEso<2>::Config channel(LinearEso<2>::Config config) {
  config.input_gain = 0;
  return config;
}

template <class T>
void designs_once(const typename T::Config& one, const typename T::Config& other, int in_make) {
  Counted::designs = 0;
  auto object = T::make(one).value();
  EXPECT_EQ(Counted::designs, in_make);
  Counted::designs = 0;
  ASSERT_TRUE(object.retune(other).has_value());
  EXPECT_EQ(Counted::designs, in_make);
  const auto fresh = T::make(other).value();
  Counted::designs = 0;
  ASSERT_TRUE(object.adopt(fresh).has_value());
  EXPECT_EQ(Counted::designs, 0);
}

TEST(Retune, DesignsAsOftenAsMake) {
  using Delayed = esokit::DelayedInput<Counted, 4>;
  using Gated = esokit::OutlierGate<Counted>;
  using Wrapped = esokit::WrappedOutput<Counted>;
  using Nested = esokit::DelayedInput<esokit::WrappedOutput<Gated>, 4>;
  using Known = esokit::KnownModel<Counted, Friction<1, double>>;
  using Variable = esokit::VariableTime<Counted>;
  designs_once<Counted>(first(), second(), 1);
  designs_once<Delayed>({.observer = first()}, {.observer = second(), .delay = 2}, 1);
  designs_once<Gated>({.observer = first()}, {.observer = second(), .threshold = 1}, 1);
  designs_once<Wrapped>({.observer = first(), .period = 1}, {.observer = second(), .period = 2}, 1);
  designs_once<Nested>({.observer = {.observer = {.observer = first()}, .period = 1}},
                       {.observer = {.observer = {.observer = second()}, .period = 2}}, 1);
  designs_once<Known>({.observer = first()}, {.observer = second()}, 1);
  // The ends of the range of times are tried as well, and half the time.
  designs_once<Variable>({.observer = first(), .ratio = 2}, {.observer = second(), .ratio = 3}, 4);

  designs_once<Adrc<Counted>>({.observer = first(), .controller_bandwidth = 5},
                              {.observer = second(), .controller_bandwidth = 4}, 1);
  designs_once<Adrc<Counted, esokit::ErrorBased>>({.observer = first(), .controller_bandwidth = 5},
                                                  {.observer = second(), .controller_bandwidth = 4},
                                                  1);
  designs_once<Adrc<Nested>>(
      {.observer = {.observer = {.observer = {.observer = first()}, .period = 1}},
       .controller_bandwidth = 5},
      {.observer = {.observer = {.observer = {.observer = second()}, .period = 2}},
       .controller_bandwidth = 4},
      1);
  designs_once<esokit::DisturbanceCompensator<Counted>>({.observer = first()},
                                                        {.observer = second()}, 1);
  using Two = esokit::MimoAdrc<Counted, Counted>;
  Two::Config one{.observers = {channel(first()), channel(first())},
                  .controller_bandwidths = {5, 5}};
  one.input_matrix = {{1, 0}, {0, 1}};
  Two::Config other{.observers = {channel(second()), channel(second())},
                    .controller_bandwidths = {4, 4}};
  other.input_matrix = {{2, 0}, {1, 1}};
  designs_once<Two>(one, other, 2);
}

/// Two copies that ran alike: one is told the config, the other what another context made of it.
template <class T, class Step>
void adopts_as_it_retunes(const typename T::Config& one, const typename T::Config& other,
                          Step&& step) {
  Random random(3);
  auto told = T::make(one).value();
  for (int k = 0; k < 50; ++k) step(told, random.uniform(-1, 1));
  auto given = told;
  ASSERT_TRUE(told.retune(other).has_value());
  const auto fresh = T::make(other).value();
  ASSERT_TRUE(given.adopt(fresh).has_value());
  for (int k = 0; k < 50; ++k) {
    const double y = random.uniform(-1, 1);
    ASSERT_EQ(step(told, y), step(given, y)) << k;
  }
}

template <class Controller>
double controlled(Controller& controller, double y) {
  return controller.update(y, 0.5);
}

template <class Observer>
double observed(Observer& observer, double y) {
  observer.update(y, 0.3);
  return observer.total_disturbance();
}

TEST(Retune, AdoptsWhatAnotherContextMade) {
  adopts_as_it_retunes<Adrc<Counted>>({.observer = first(), .controller_bandwidth = 5},
                                      {.observer = second(), .controller_bandwidth = 4},
                                      controlled<Adrc<Counted>>);
  using Predictive = esokit::PredictiveAdrc<Counted>;
  adopts_as_it_retunes<Predictive>({.observer = first(), .controller_bandwidth = 5},
                                   {.observer = second(), .controller_bandwidth = 4},
                                   [](Predictive& controller, double y) {
                                     const double u = controller.control(y);
                                     controller.prepare(0.5);
                                     return u;
                                   });
  using Switched = esokit::AdjustableBandwidthEso<2>;
  adopts_as_it_retunes<Switched>(
      {.observer_bandwidth = 40, .bandwidth_ratio = 0.7, .input_gain = 5, .sample_time = 0.01},
      {.observer_bandwidth = 25, .bandwidth_ratio = 0.8, .input_gain = 7, .sample_time = 0.01},
      observed<Switched>);
  using Filter = esokit::ExtendedStateFilter<1>;
  adopts_as_it_retunes<Filter>({.input_gain = 5,
                                .sample_time = 0.01,
                                .measurement_variance = 1e-4,
                                .disturbance_bounds = {0, 1},
                                .inflation = 0.01},
                               {.input_gain = 7,
                                .sample_time = 0.01,
                                .measurement_variance = 1e-3,
                                .disturbance_bounds = {0, 2},
                                .inflation = 0.01},
                               observed<Filter>);
}

}  // namespace control_retune_test
}  // namespace esokit_test
