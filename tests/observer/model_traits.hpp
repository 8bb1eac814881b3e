/// @file
/// What the law suite must know of an observer with a model, and what it promises of gaps.
#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/observer/model_eso.hpp>

#include "law_suite.hpp"

namespace esokit_test {

/// The frequency of the model is half the observer's bandwidth, and 10 rad/s at most, so that a
/// retune from 50 to 150 rad/s keeps the model. All poles decay with the bandwidth.
template <template <class> class Of, class S>
struct ModelTraitsOf {
  using Observer = Of<S>;
  using Model = typename Observer::PlantModel;
  static constexpr esokit::ModelParts parts = Model::parts;
  /// It is a LinearPlant.
  static constexpr bool whole_plant = requires(typename Observer::Config c) { c.model.plant.a; };
  using Config = typename Observer::Config;
  template <class T>
  using Rebind = Of<T>;
  static constexpr const char* field = "observer_bandwidth";
  static constexpr double slowest = 1;
  static constexpr double fastest = 1;
  /// Of actuator and sensor, s: a power of two, so that b is exact; short, as both keep their
  /// poles.
  static constexpr double lag = 1.0 / 128;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config{.observer_bandwidth = static_cast<S>(omega),
                  .input_gain = static_cast<S>(input_gain),
                  .sample_time = static_cast<S>(sample_time),
                  .max_gap = max_gap};
    // A config that is to be refused for its bandwidth has a good model.
    const double w = omega > 0 ? std::min(omega / 2, 10.0) : 10.0;
    if constexpr (whole_plant) {
      const auto rate = static_cast<S>(w);
      auto& plant = config.model.plant;
      plant.a = {{-rate / S(2), S(1)}, {S(0), -rate}};
      plant.b = {S(1), rate / S(4)};
      plant.c = {S(1), S(0)};
      plant.e = {S(1) / S(8), rate};
    }
    if constexpr (parts.plant_poles) {
      config.model.plant.back() = static_cast<S>(w);
      if constexpr (parts.order == 2) config.model.plant[0] = static_cast<S>(w * w);
    }
    if constexpr (parts.resonators > 0) {
      config.model.resonators = {{{.frequency = static_cast<S>(w),
                                   .capture_bandwidth = static_cast<S>(omega > 0 ? omega : w)}}};
    }
    if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = S(1.5);
    if constexpr (!whole_plant && parts.actuator == 1) {
      // b = input_gain / lag is what the law sees.
      config.model.actuator.time_constant = static_cast<S>(lag);
      config.input_gain = config.input_gain * static_cast<S>(lag);
    }
    if constexpr (parts.sensor == 1) config.model.sensor.time_constant = static_cast<S>(lag);
    if constexpr (parts.first_order == 1) config.model.first_order = {S(1) / static_cast<S>(w)};
    return config;
  }
  /// What is measured, and stands where y does.
  static constexpr bool is_output(int row) { return parts.sensor > 0 && row == Observer::size - 1; }
  static constexpr int degree(int row) { return Model::degree(Model::state_of_row(row)); }
  static double unknown_amplitude(const Config& config, double nu) {
    double sum = nu * nu;
    // y' = -w / 2 y + x_2 + d / 8, all three of them found.
    if constexpr (whole_plant) {
      return 3 * (nu + std::abs(static_cast<double>(config.model.plant.a(1, 1))));
    }
    if constexpr (!whole_plant && parts.actuator == 1) {
      // (y' + a_0 y) and its share of the lag.
      double pole = 0;
      if constexpr (parts.plant_poles) pole = std::abs(static_cast<double>(config.model.plant[0]));
      return (nu + pole) * (nu + 1 / lag);
    } else if constexpr (parts.plant_poles) {
      sum += std::abs(static_cast<double>(config.model.plant[0])) +
             std::abs(static_cast<double>(config.model.plant[1])) * nu;
    }
    return sum;
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::gains_equal_reference || law == Law::polynomial_equals_reference) {
      return "the reference is a chain's; see PutsThePolesWhereAsked in augmented_model_test.cpp";
    }
    if (law == Law::unbiased_on_own_model_class) {
      return "its plant is a chain; see WhatFollowsTheModelIsEstimatedToRounding in "
             "augmented_model_test.cpp";
    }
    if (law == Law::order_of_accuracy) return "an observer with a model has no continuous form";
    if (law == Law::gap_gain_is_that_of_longer_sample) {
      return "a gap is bridged by a gain that stays bounded where that of the longer sample does "
             "not; see gain/model_gain.hpp";
    }
    if (law == Law::recurring_gaps_are_stable) {
      return "it asks for the decay of the longer sample; see "
             "RecurringGapsDecayUpToTheLongestThatIsBridged";
    }
    return common_excuse<S, Observer::size>(law);
  }
};

/// What ModelGain promises of a gap: one correction in M, for ever, lets every error decay by at
/// least a hundredth of what a sample without a gap does, to max_gap(); one longer gap is bridged
/// up to longest_gap(), after one more the observer restarts.
inline void recurring_gaps_decay(const ObserverKind& kind) {
  const LawSuite laws{kind};
  for (const double omega_t : {0.1, 1.0, 3.0}) {
    SCOPED_TRACE(omega_t);
    AnyObserver observer = laws.make(omega_t);
    const int max_gap = observer->max_gap();
    ASSERT_GE(max_gap, omega_t < 1 ? 1 : 0);
    const auto largest = [&](Real apart) {
      Real most = 0;
      for (int r = 0; r < kind.size; ++r) {
        most = std::max(most, std::abs(observer->estimate(r)) * laws.row_unit(r, apart));
      }
      return most;
    };
    const int corrections = 100 * laws.settling_samples(omega_t);
    for (const int every : lengths(2, max_gap + 1)) {
      SCOPED_TRACE(every);
      const Real apart = laws.period * every;
      ASSERT_EQ(observer->reset(laws.state([](int) { return 1; }, apart)), StepStatus::ok);
      for (int k = 0; k < corrections && largest(apart) > 1e-9L; ++k) {
        for (int i = 0; i < every; ++i) observer->predict(0);
        ASSERT_EQ(observer->correct(0), StepStatus::gap_bridged);
      }
      EXPECT_LE(largest(apart), 1e-9L);
    }
    // At random, too.
    Random random(61);
    ASSERT_EQ(observer->reset(laws.state([](int) { return 1; })), StepStatus::ok);
    for (int k = 0; k < corrections; ++k) {
      const int every = 1 + random.index(max_gap + 1);
      for (int i = 0; i < every; ++i) observer->predict(0);
      ASSERT_EQ(observer->correct(0), every > 1 ? StepStatus::gap_bridged : StepStatus::ok);
    }
    EXPECT_LE(largest(laws.period), 1e-9L);
    while (observer->recovering() > 0) observer->update(0, 0);
    for (const int gap : {max_gap + 1, observer->longest_gap() + 1}) {
      for (int i = 0; i <= gap; ++i) observer->predict(0);
      EXPECT_EQ(observer->correct(0),
                gap > observer->longest_gap() ? StepStatus::restarted : StepStatus::gap_bridged);
    }
  }
}

}  // namespace esokit_test
