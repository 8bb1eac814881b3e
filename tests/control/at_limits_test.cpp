// Settings that are exactly at a limit in decimals are accepted, whatever a product, a quotient or
// a sum is rounded to; a millionth beyond it they are refused. Over many random decimals.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/control/health.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/model/detail/parts_layout.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_at_limits_test {

using esokit::Experiment;
using esokit::LinearEso;
using esokit::Rules;
using esokit::VariableTime;

constexpr int tries = 2000;

/// i / 10^k, as it is read from a text.
template <class S>
S decimal(std::int64_t i, int k) {
  static constexpr long powers[] = {1, 10, 100, 1000, 10000, 100000, 1000000, 10000000, 100000000};
  return static_cast<S>(static_cast<long double>(i) / static_cast<long double>(powers[k]));
}

/// Divisors of powers of ten: a, b with a b = 10^k have decimals without end nowhere.
constexpr int factors[] = {1, 2, 4, 5, 8, 16, 20, 25, 32, 40, 50, 64, 80, 125};

/// @param at makes the object with the setting at its limit times `share`; `beyond` is the share of
/// what has to be refused
template <class At>
void accepts_the_limit(const char* what, const At& at, double beyond, const std::string& rule) {
  EXPECT_EQ(at(1.0), "accepted") << what;
  EXPECT_EQ(at(beyond), rule) << what;
}

constexpr double above = 1 + 1e-6;
constexpr double less = 1 - 1e-6;

template <class S>
void levels_of_an_experiment() {
  Random random(17);
  for (int i = 0; i < tries; i += stride) {
    const int places = 1 + random.index(3);
    const long u0 = random.index(1999) - 999;
    const long A = 1 + random.index(999);
    const bool up = random.index(2) == 0;
    const long end = up ? u0 + A : u0 - A;
    const double size = static_cast<double>(std::max({std::labs(u0), A, std::labs(end)}));
    const auto at = [&](double share) {
      esokit::ExperimentConfig<S> config{.sample_time = S(0.01),
                                         .input = decimal<S>(u0, places),
                                         .amplitude = decimal<S>(A, places),
                                         .hysteresis = S(1),
                                         .travel = S(10),
                                         .time_limit = S(60)};
      const S off = static_cast<S>((share - 1) * size) / decimal<S>(1, 0) * decimal<S>(1, places);
      config.limits = {.lower = S(-1e5), .upper = S(1e5)};
      (up ? config.limits.upper : config.limits.lower) =
          decimal<S>(end, places) - (up ? off : -off);
      const auto made = Experiment<1, S>::make(config);
      if (made) {
        // And u stays within the limit.
        auto one = *made;
        for (int k = 0; k < 50; ++k) {
          const S u = one.update(up ? S(k % 10) : S(-(k % 10)));
          EXPECT_LE(u, config.limits.upper);
          EXPECT_GE(u, config.limits.lower);
        }
      }
      return refusal(made);
    };
    accepts_the_limit("levels", at, above,
                      up ? "amplitude: with input goes above limits.upper, which is"
                         : "amplitude: with input goes below limits.lower, which is");
  }
}

TEST(AtLimits, LevelsOfAnExperiment) {
  levels_of_an_experiment<double>();
  levels_of_an_experiment<float>();
}

template <class S>
void times_of_an_experiment() {
  Random random(19);
  using Config = esokit::ExperimentConfig<S>;
  for (int i = 0; i < tries; i += stride) {
    const long T = 1 + random.index(999);
    const int places = 3 + random.index(3);
    Config config{.sample_time = decimal<S>(T, places),
                  .excitation = esokit::Excitation::steps,
                  .amplitude = S(1),
                  .half_period = decimal<S>(20 * T, places),
                  .travel = S(10),
                  .time_limit = decimal<S>(1000 * T, places)};
    const auto with = [](Config changed) { return refusal(Experiment<1, S>::make(changed)); };
    accepts_the_limit(
        "half_period",
        [&](double share) {
          Config changed = config;
          changed.half_period = decimal<S>(8 * T, places) * static_cast<S>(share);
          return with(changed);
        },
        less, "half_period: must be at least 8 samples");
    accepts_the_limit(
        "response_time",
        [&](double share) {
          Config changed = config;
          changed.response = S(1);
          changed.response_time = config.sample_time * static_cast<S>(share);
          return with(changed);
        },
        less, "response_time: must be at least one sample");
    const long fastest = 1 + random.index(999);
    accepts_the_limit(
        "fastest",
        [&](double share) {
          Config changed = config;
          changed.response = decimal<S>(fastest * T, places);
          changed.response_time = decimal<S>(20 * T, places);
          changed.fastest = decimal<S>(fastest, 0) * static_cast<S>(share);
          return with(changed);
        },
        above, "fastest: must be at most response in a sample:");
  }
}

TEST(AtLimits, TimesOfAnExperiment) {
  times_of_an_experiment<double>();
  times_of_an_experiment<float>();
}

/// Also while it runs: a step at the end of the range is no gap that is too long.
template <class S>
void steps_of_varying_time() {
  Random random(23);
  using Varied = VariableTime<LinearEso<1, S>>;
  for (int i = 0; i < tries / 4; i += stride) {
    const long T = 1 + random.index(99);
    const long ratio = 11 + random.index(89);
    const auto made = [&](long nominal, int places) {
      return Varied::make({.observer = {.observer_bandwidth = S(1),
                                        .input_gain = S(1),
                                        .sample_time = decimal<S>(nominal, places)},
                           .ratio = decimal<S>(ratio, 1)})
          .value();
    };
    Varied longest = made(T, 5);
    accepts_the_limit(
        "step_time",
        [&](double share) {
          return refusal(longest.set_step_time(decimal<S>(T * ratio, 6) * static_cast<S>(share)));
        },
        above, "step_time: must be at most");
    ASSERT_TRUE(longest.set_step_time(decimal<S>(T * ratio, 6)));
    for (int k = 0; k < 20; ++k) {
      EXPECT_EQ(longest.update(S(1), S(0)), esokit::StepStatus::ok) << T << ", " << ratio;
    }
    Varied shortest = made(T * ratio, 6);
    accepts_the_limit(
        "step_time",
        [&](double share) {
          return refusal(shortest.set_step_time(decimal<S>(T, 5) * static_cast<S>(share)));
        },
        less, "step_time: must be finite and at least");
  }
}

TEST(AtLimits, StepsOfVaryingTime) {
  steps_of_varying_time<double>();
  steps_of_varying_time<float>();
}

/// omega_o T D = 1, memory = 8 / omega_o.
template <class S>
void monitors() {
  Random random(29);
  for (int i = 0; i < tries; i += stride) {
    const int a = factors[random.index(14)];
    const int b = factors[random.index(14)];
    const int places = 3 + random.index(3);
    // omega = 10^6 / (a b), T = a 10^-places.
    const long omega = 1'000'000'000L / (a * b);
    if (omega * a * b != 1'000'000'000L) continue;
    const S frequency = decimal<S>(omega, 9 - places);
    const auto at = [&](double share) {
      return refusal(esokit::HealthMonitor<2, S>::make(
          {.observer_bandwidth = frequency,
           .sample_time = decimal<S>(a, places) * static_cast<S>(share),
           .input_range = S(1),
           .memory = S(1e9),
           .divider = b}));
    };
    accepts_the_limit("omega_o T D", at, above,
                      "divider: is too large: omega_o T D must be at most");
    const auto memory = [&](double share) {
      return refusal(esokit::HealthMonitor<2, S>::make(
          {.observer_bandwidth = frequency,
           .sample_time = decimal<S>(a, places),
           .input_range = S(1),
           .memory = decimal<S>(8L * a * b, places) * static_cast<S>(share),
           .divider = b}));
    };
    accepts_the_limit("memory", memory, less, "memory: must be at least 8 / omega_o, that is");
    const auto probe = [&](double share) {
      return refusal(esokit::GainProbe<2, S>::make(
          {.observer_bandwidth = frequency,
           .sample_time = decimal<S>(a * b, places) * static_cast<S>(share),
           .amplitude = S(0.1),
           .travel = S(1)}));
    };
    accepts_the_limit("omega_o T", probe, above,
                      "observer_bandwidth: times sample_time must be at most");
  }
}

TEST(AtLimits, Monitors) {
  monitors<double>();
  monitors<float>();
}

/// Of known parts, and of w.
template <class S>
void parts() {
  using esokit::Lag;
  using esokit::detail::MeasuredPath;
  Random random(31);
  for (int i = 0; i < tries; i += stride) {
    const long T = 1 + random.index(9999);
    const int places = 2 + random.index(4);
    const S time = decimal<S>(T, places);
    const auto one = [&](double share) {
      Rules<S> rules;
      esokit::detail::check_lag(rules, "tau", "", Lag<1, S>{decimal<S>(T, places + 2) * S(share)},
                                time);
      return refusal(esokit::Check<S>(rules));
    };
    accepts_the_limit("tau", one, less, "tau: must be at least a hundredth of sample_time");
    const int a = factors[random.index(14)];
    const long w = 100'000'000L / a;
    if (w * a == 100'000'000L) {
      const auto two = [&](double share) {
        Rules<S> rules;
        esokit::detail::check_lag(rules, "w", "zeta", Lag<2, S>{decimal<S>(w, 4) * S(share)},
                                  decimal<S>(a, 2));
        return refusal(esokit::Check<S>(rules));
      };
      accepts_the_limit("w", two, above, "w: must be at most a hundred times the sample rate");
    }
    const auto path = [&](const char* what, double share) {
      esokit::MeasuredInput<S> input{.gain = S(1)};
      if (*what == 'l')
        input.lag =
            decimal<S>(T * (sizeof(S) == 4 ? std::int64_t{131'072} : 1'000'000), 0) * S(share);
      if (*what == 'd') input.dead_time = decimal<S>(7 * T, places) * S(share);
      return refusal(
          MeasuredPath<S, 7>::validate(input, *what == 'l' ? decimal<S>(T, 0) : time, -1));
    };
    accepts_the_limit(
        "lag", [&](double share) { return path("l", share); }, above,
        "inputs.lag: must be at most a million samples (in float 131072), s:");
    accepts_the_limit(
        "dead_time", [&](double share) { return path("d", share); }, above,
        "inputs.dead_time: must be at most Capacity samples, s:");
  }
}

TEST(AtLimits, KnownParts) {
  parts<double>();
  parts<float>();
}

/// With the longest lag w still arrives: what arrives in a sample is not below the digits of it.
template <class S>
void arrives(long lag) {
  auto path = esokit::detail::MeasuredPath<S, 1>(
      {.gain = S(1), .lag = static_cast<S>(lag) * S(0.01)}, S(0.01));
  path.push(S(1));
  path.push(S(1));
  for (long k = 0; k < 12 * lag; ++k) path.advance();
  EXPECT_NEAR(static_cast<double>(path.mean()), 1.0, 1.0 / 128);
}

TEST(AtLimits, TheLongestLagArrives) {
  arrives<float>(131'072);
  arrives<double>(long_run(1'000'000));
}

/// 1 T and a thousandth more is "closer than a thousandth": refused. What is strictly below a limit
/// is refused at it, too.
template <class S>
void strict_ones() {
  Random random(37);
  for (int i = 0; i < tries; i += stride) {
    const long base = 1 + random.index(9999);
    const auto apart = [&](double share) {
      Rules<S> rules;
      const S other = decimal<S>(1000 * base, 4);
      // value - other = value / 1000
      const S value = decimal<S>(1000 * base, 4) + decimal<S>(1000 * base, 4) / S(999) * S(share);
      esokit::detail::check_apart(rules, "tau", value, 1, other);
      return refusal(esokit::Check<S>(rules));
    };
    EXPECT_EQ(apart(1.01), "accepted");
    EXPECT_NE(apart(0.99), "accepted");
    const int a = factors[random.index(14)];
    const long f = 31'000'000L / a;
    if (f * a != 31'000'000L) continue;
    const auto sine = [&](double share) {
      Rules<S> rules;
      const std::array<esokit::Resonance<S>, 1> one{{{.frequency = decimal<S>(f, 5) * S(share)}}};
      esokit::detail::check_resonators(rules, one, decimal<S>(a, 2));
      return refusal(esokit::Check<S>(rules));
    };
    EXPECT_EQ(sine(less), "accepted") << f << " " << a;
    EXPECT_EQ(sine(1), "model.resonators.frequency[0]: must be below half the sample rate");
  }
}

TEST(AtLimits, WhatMustBeBelowIsRefusedAtIt) {
  strict_ones<double>();
  strict_ones<float>();
}

/// A u that was computed where it was set; it is clamped, so it does not leave the limits.
TEST(AtLimits, InputsThatAreHeld) {
  Random random(41);
  for (int i = 0; i < tries / 4; i += stride) {
    const long a = 1 + random.index(999);
    const long b = 1 + random.index(999);
    const auto at = [&](double share) {
      esokit::AdrcConfig<LinearEso<1>> config{};
      config.observer = {.observer_bandwidth = 50, .input_gain = 1, .sample_time = 1e-3};
      config.controller_bandwidth = 5;
      config.limits = {.lower = -decimal<double>(a + b, 2), .upper = decimal<double>(a + b, 2)};
      const double sum = (decimal<double>(a, 2) + decimal<double>(b, 2)) * share;
      config.start_hold = {.time = 0.1, .input = sum};
      config.missing.input = -sum;
      auto made = esokit::Adrc<LinearEso<1>>::make(config);
      if (made) {
        EXPECT_LE(made->output(), config.limits.upper);
        EXPECT_LE(made->update(0, 0), config.limits.upper);
        for (int k = 0; k < 200; ++k) {
          EXPECT_GE(made->update_without_measurement(0), config.limits.lower);
        }
      }
      return refusal(made);
    };
    accepts_the_limit("hold", at, above, "start_hold.input: must not be above limits.upper");
  }
}

}  // namespace control_at_limits_test
}  // namespace esokit_test
