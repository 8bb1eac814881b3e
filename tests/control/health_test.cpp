// Health of a loop: rho is b / b0 where u moves by itself, counts and shares are what happened, and
// a diagnosis says the worst of it. Telemetry: all that was, in a table that identify reads.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <control/loop_traits.hpp>
#include <deque>
#include <esokit/adapter/guarded.hpp>
#include <esokit/analysis/health_text.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/control/health.hpp>
#include <esokit/control/telemetry.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <numbers>
#include <sstream>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace control_health_test {

using namespace esokit;

constexpr double sample_time = 1e-3;
constexpr double omega_o = 100;

template <class S>
using Loop = Adrc<Guarded<LinearEso<2, S>>>;

template <class S = double>
Loop<S> loop_of(double b0, double limit = 1, double omega_c = 20) {
  typename Loop<S>::Config config{};
  config.observer.observer = {.observer_bandwidth = static_cast<S>(omega_o),
                              .input_gain = static_cast<S>(b0),
                              .sample_time = static_cast<S>(sample_time)};
  config.controller_bandwidth = static_cast<S>(omega_c);
  config.limits = {.lower = static_cast<S>(-limit), .upper = static_cast<S>(limit)};
  return Loop<S>::make(config).value();
}

template <class S = double>
HealthMonitor<3, S> monitor_of(double noise = 0) {
  return HealthMonitor<3, S>::make({.observer_bandwidth = static_cast<S>(omega_o),
                                    .sample_time = static_cast<S>(sample_time),
                                    .input_range = S(1),
                                    .noise = static_cast<S>(noise)})
      .value();
}

template <class S>
void ratio_is_that_of_the_gains() {
  for (const double ratio : {1.0, -1.0, 10.0, 0.1}) {
    auto loop = loop_of<S>(20);
    auto monitor = monitor_of<S>();
    ChainPlant plant(2, sample_time, 20 * ratio, 3);
    Random random(5);
    S u{};
    for (int k = 0; k < 3000; ++k) {
      // Someone else's u, which no observer answers.
      if (k % 40 == 0) u = static_cast<S>(random.uniform(-0.5, 0.5));
      loop.track(static_cast<S>(plant.output()), S(0), u);
      monitor.look(loop);
      plant.step(static_cast<double>(u));
    }
    EXPECT_NEAR(static_cast<double>(monitor.health().gain_ratio), ratio,
                0.03 * std::abs(ratio) + 0.02);
    EXPECT_GT(monitor.health().evidence, S(6));
    EXPECT_EQ(monitor.health().samples, 3000u);
    EXPECT_EQ(diagnose(monitor.health()), ratio < 0     ? LoopFault::wrong_sign
                                          : ratio > 5   ? LoopFault::gain_too_small
                                          : ratio < 0.5 ? LoopFault::gain_too_large_or_disturbed
                                                        : LoopFault::none)
        << ratio;
    monitor.clear();
    EXPECT_EQ(monitor.health().samples, 0u);
    EXPECT_EQ(monitor.health().gain_ratio, S(1));
  }
}

TEST(Health, RatioIsThatOfTheGains) {
  ratio_is_that_of_the_gains<double>();
  ratio_is_that_of_the_gains<float>();
}

/// Behind a lag that is in the model it is b0 v that is compared, and d alone; also where b0 is
/// given with each sample.
TEST(Health, RatioWithALagInTheModel) {
  using Lagging = Adrc<Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}>>>;
  constexpr double tau = 0.03;
  for (const double ratio : {1.0, -1.0, 10.0, 0.1}) {
    Lagging::Config config{.controller_bandwidth = 20, .limits = {.lower = -1, .upper = 1}};
    config.observer.observer = {.observer_bandwidth = omega_o,
                                .input_gain = 20,
                                .sample_time = sample_time,
                                .model = {.actuator = {tau}}};
    auto loop = Lagging::make(config).value();
    EXPECT_NEAR(loop.observer().observer().model().plant_gain(), 20, 1e-12);
    auto monitor =
        HealthMonitor<2>::make(
            {.observer_bandwidth = omega_o, .sample_time = sample_time, .input_range = 1})
            .value();
    Random random(5);
    double y = 0;
    double v = 0;
    double u = 0;
    for (int k = 0; k < 3000; ++k) {
      if (k % 40 == 0) u = random.uniform(-0.5, 0.5);
      const double share = 1 + 0.3 * std::sin(0.01 * k);
      ASSERT_TRUE(loop.set_input_gain(20 * share).has_value());
      loop.track(y, 0, u);
      monitor.look(loop);
      const double left = std::exp(-sample_time / tau);
      y += sample_time * (3 + 20 * ratio * share * u) +
           20 * ratio * share * (v - u) * tau * (1 - left);
      v = u + (v - u) * left;
    }
    EXPECT_NEAR(monitor.health().gain_ratio, ratio, 0.03 * std::abs(ratio) + 0.02);
    EXPECT_GT(monitor.health().evidence, 6);
  }
}

/// A dead time of 4 / omega_o that the observer does not have: at the beginning u seems to do
/// nothing. With its `latency` the monitor accuses nobody, and finds what its filters say of b /
/// b0.
TEST(Health, ADeadTimeIsNoGainThatIsTooLarge) {
  constexpr int late = 40;
  constexpr double w = 4 * std::numbers::pi;
  for (const double ratio : {1.0, 0.6, 2.0, -1.0}) {
    for (const double latency : {0.0, late * sample_time}) {
      auto loop = loop_of(20);
      auto monitor = HealthMonitor<3>::make({.observer_bandwidth = omega_o,
                                             .sample_time = sample_time,
                                             .input_range = 1,
                                             .latency = latency,
                                             .memory = 2})
                         .value();
      ChainPlant plant(2, sample_time, 20 * ratio, 0);
      std::deque<double> line(late, 0.0);
      bool accused = false;
      for (int k = 0; k < 3000; ++k) {
        const double u = 0.8 * std::sin(w * k * sample_time);
        loop.track(plant.output(), 0, u);
        monitor.look(loop);
        accused = accused || diagnose(monitor.health()) == LoopFault::gain_too_large_or_disturbed;
        line.push_back(u);
        plant.step(line.front());
        line.pop_front();
      }
      const std::complex<double> s(0, w);
      const auto poles = [&](double at) { return std::pow(1.0 / (1.0 + s / at), 3); };
      const auto phi = poles(omega_o / (1 + omega_o * latency / 3));
      const auto psi = poles(omega_o) * (ratio * std::exp(-s * (late * sample_time)) - 1.0);
      // Without the delays of the hold and the divider, 3 samples: 3 T w = 0.04.
      EXPECT_NEAR(monitor.health().gain_ratio, 1 + (std::conj(phi) * psi).real() / std::norm(phi),
                  0.04 * std::abs(ratio));
      if (ratio > 0) {
        EXPECT_EQ(accused, latency == 0.0 && ratio < 2) << ratio << ' ' << latency;
      }
      EXPECT_EQ(diagnose(monitor.health()), ratio < 0 ? LoopFault::wrong_sign : LoopFault::none);
    }
  }
}

/// A load that u answers makes rho small, and no more than that; a gated sample tells nothing.
TEST(Health, ALoadIsNoFault) {
  for (const bool gated : {false, true}) {
    auto loop = loop_of(20);
    auto monitor = monitor_of();
    ChainPlant plant(2, sample_time, 20, 0);
    for (int k = 0; k < 5000; ++k) {
      if (gated) loop.observer().set_trust(0.9);
      plant.set_disturbance(8 * std::sin(0.01 * k));
      plant.step(loop.update(plant.output(), 0.0));
      monitor.look(loop);
    }
    if (gated) {
      EXPECT_EQ(monitor.health().gain_ratio, 1);
      EXPECT_EQ(monitor.health().gated, 5000u);
      EXPECT_EQ(diagnose(monitor.health()), LoopFault::none);
    } else {
      EXPECT_GT(monitor.health().gain_ratio, -0.2);
      EXPECT_LT(monitor.health().gain_ratio, 0.25);
      EXPECT_EQ(diagnose(monitor.health()), LoopFault::gain_too_large_or_disturbed);
    }
  }
}

/// y'' = b u + load - friction, with friction that holds it, a lag of 2 ms and an encoder.
struct FrictionDrive {
  double b = 100, load = 0, y = 0, speed = 0, motor = 0;
  double step(double u) {
    for (int i = 0; i < 4; ++i) {
      constexpr double h = sample_time / 4;
      motor += -std::expm1(-h / 2e-3) * (u - motor);
      const double push = b * motor + load;
      const double before = speed;
      if (speed != 0 || std::abs(push) > 10) {
        speed += h * (push - std::copysign(10, speed != 0 ? speed : push) - 3 * speed);
        if (before * speed < 0) speed = 0;
      }
      y += h * (before + speed) / 2;
    }
    return measured();
  }
  [[nodiscard]] double measured() const {
    constexpr double count = 2 * 3.14159265358979 / 20000;
    return count * std::round(y / count);
  }
};

/// A load that changes its direction, more or less of it, and the other sign of b0.
TEST(Health, FrictionAndALoadAreNoWrongSign) {
  for (const double sign : {1.0, -1.0}) {
    for (const double load : {10.0, 25.0, 40.0}) {
      for (const double period : {0.4, 1.6}) {
        for (const bool wrong : {false, true}) {
          auto loop = loop_of(wrong ? -sign * 100 : sign * 100, 1, 100 / 6.0);
          auto monitor = monitor_of();
          FrictionDrive drive{.b = sign * 100};
          int named = 0;
          for (int k = 0; k < 5000 && named == 0; ++k) {
            drive.load = std::fmod(k * sample_time, period) < period / 2 ? load : -load;
            (void)drive.step(loop.update(drive.measured(), 0));
            monitor.look(loop);
            if (diagnose(monitor.health()) == LoopFault::wrong_sign) named = k;
          }
          if (wrong && load > 10) {
            EXPECT_GT(named, 0);
            EXPECT_LT(named, 1000);  // 100 / omega_o
          }
          if (!wrong) {
            EXPECT_EQ(named, 0) << sign << ' ' << load << ' ' << period;
          }
        }
      }
    }
  }
}

/// Where 0 is a limit of u, its end is that limit: a load that u has to hold near 0.9 is none.
TEST(Health, TheEndsOfUAreThoseOfTheActuator) {
  for (const bool wrong : {false, true}) {
    for (const double lower : {0.0, -1.8}) {
      auto config = Loop<double>::Config{.controller_bandwidth = 20,
                                         .limits = {.lower = lower, .upper = lower + 1.8}};
      config.observer.observer = {
          .observer_bandwidth = omega_o, .input_gain = wrong ? -20.0 : 20.0, .sample_time = 1e-3};
      auto loop = Loop<double>::make(config).value();
      auto monitor =
          HealthMonitor<3>::make(
              {.observer_bandwidth = omega_o, .sample_time = sample_time, .input_range = 0.9})
              .value();
      // Around u = +-0.9, with a reference that wants y'' against u for half of the time.
      ChainPlant plant(2, sample_time, 20, lower < 0 ? 18 : -18);
      (void)loop.start(0, lower < 0 ? -0.9 : 0.9);
      bool named = false;
      double most = 0;
      for (int k = 0; k < 4000; ++k) {
        const double r = std::sin(0.004 * k);
        plant.step(loop.update(plant.output(), r));
        monitor.look(loop);
        most = std::max(most, monitor.health().opposed);
        named = named || diagnose(monitor.health()) == LoopFault::wrong_sign;
      }
      EXPECT_EQ(named, wrong) << lower;
      if (!wrong) {
        EXPECT_EQ(most, 0) << lower;
      }
    }
  }
}

/// A bound on dhat hides what it leaves out; the innovation does not.
TEST(Health, WrongSignBehindABound) {
  for (const bool wrong : {false, true}) {
    auto config =
        Loop<double>::Config{.controller_bandwidth = 20, .limits = {.lower = -1, .upper = 1}};
    config.observer = {.observer = {.observer_bandwidth = omega_o,
                                    .input_gain = wrong ? -20.0 : 20.0,
                                    .sample_time = sample_time},
                       .disturbance_bound = 0.5,
                       .unit = DisturbanceUnit::input};
    auto loop = Loop<double>::make(config).value();
    auto monitor = monitor_of();
    ChainPlant plant(2, sample_time, 20, 2);
    bool named = false;
    for (int k = 0; k < 3000; ++k) {
      plant.step(loop.update(plant.output(), k < 50 ? 0.0 : 0.02));
      monitor.look(loop);
      named = named || diagnose(monitor.health()) == LoopFault::wrong_sign;
    }
    EXPECT_EQ(named, wrong);
  }
}

/// Lost and rejected measurements are no evidence, of rho, of the innovation or of the sign.
TEST(Health, LostMeasurementsAreNoEvidence) {
  for (const bool divided : {false, true}) {
    auto config = Loop<double>::Config{.controller_bandwidth = 20,
                                       .limits = {.lower = -1, .upper = 1},
                                       .measurement_divider = divided ? 3 : 1};
    config.observer.observer = {
        .observer_bandwidth = omega_o, .input_gain = 20, .sample_time = sample_time};
    auto loop = Loop<double>::make(config).value();
    auto monitor = monitor_of();
    ChainPlant plant(2, sample_time, -20, 0);
    const auto run = [&](int samples, auto lost) {
      for (int k = 0; k < samples; ++k) {
        const double u = k % 40 < 20 ? 0.9 : -0.9;
        loop.track(lost(k) ? hidden_nan<double>() : plant.output(), 0, u);
        monitor.look(loop);
        plant.step(u);
      }
    };
    run(400, [](int) { return false; });
    const auto before = monitor.health();
    EXPECT_GT(before.evidence, 5) << divided;
    EXPECT_LT(before.gain_ratio, -0.5);
    run(40, [](int) { return true; });
    const auto after = monitor.health();
    EXPECT_LT(after.evidence, before.evidence);
    EXPECT_EQ(after.gain_ratio, before.gain_ratio);
    EXPECT_EQ(after.response, before.response);
    EXPECT_EQ(after.innovation, before.innovation);
    EXPECT_LE(after.opposed, before.opposed);
    if (divided) continue;
    // Each fourth lost: no sum is complete.
    monitor.clear();
    run(400, [](int k) { return k % 4 == 1; });
    EXPECT_EQ(monitor.health().evidence, 0);
    EXPECT_EQ(monitor.health().opposed, 0);
    EXPECT_EQ(monitor.health().gain_ratio, 1);
  }
}

/// A lag of 3 / omega_o hides a b0 that is too small from rho, not from the response.
TEST(Health, TooSmallBehindALag) {
  for (const double ratio : {1.0, 10.0}) {
    auto loop = loop_of(20);
    auto monitor = monitor_of();
    ChainPlant plant(2, sample_time, 20 * ratio, 3);
    double motor = 0;
    bool named = false;
    for (int k = 0; k < 2000; ++k) {
      motor += -std::expm1(-sample_time * omega_o / 3) *
               (loop.update(plant.output(), k % 500 < 250 ? 0.01 : 0) - motor);
      monitor.look(loop);
      plant.step(motor);
      named = diagnose(monitor.health()) == LoopFault::gain_too_small;
      if (ratio < 2) {
        ASSERT_FALSE(named);
      }
    }
    EXPECT_LT(monitor.health().gain_ratio, 2);
    EXPECT_EQ(named, ratio > 1);
  }
}

TEST(Health, InnovationOfNoise) {
  constexpr double noise = 1e-3;
  auto loop = loop_of(20, 100);
  auto monitor = monitor_of(noise);
  Random random(7);
  const auto normal = [&] {
    double sum = -6;
    for (int i = 0; i < 12; ++i) sum += random.uniform(0, 1);
    return sum;
  };
  for (int k = 0; k < 8000; ++k) {
    loop.track(noise * normal(), 0, 0);
    monitor.look(loop);
  }
  const auto health = monitor.health();
  // rms of a second's samples: 1 / sqrt(2000) = 2 %, and four of them.
  EXPECT_NEAR(health.innovation / health.innovation_of_noise, 1, 0.1);
  EXPECT_EQ(health.evidence, 0);
  EXPECT_EQ(diagnose(health), LoopFault::none);
  // Four times as much is not the noise any more.
  for (int k = 0; k < 8000; ++k) {
    loop.track(4 * noise * normal(), 0, 0);
    monitor.look(loop);
  }
  EXPECT_EQ(diagnose(monitor.health()), LoopFault::innovation_too_large);
  monitor.clear();
  EXPECT_EQ(monitor.health().innovation_of_noise, health.innovation_of_noise);
}

TEST(Health, CountsWhatHappened) {
  auto loop = loop_of(20, 0.1);
  auto monitor = monitor_of();
  for (int k = 0; k < 4000; ++k) {
    const bool lost = k % 4 == 1;
    if (k == 2000) {
      EXPECT_GT(monitor.health().saturated, 0.8);
      EXPECT_EQ(diagnose(monitor.health()), LoopFault::measurements_rejected);
    }
    loop.update(lost ? hidden_nan<double>() : 0.0, 50.0);
    monitor.look(loop);
  }
  EXPECT_EQ(monitor.health().rejected, 1000u);
  EXPECT_EQ(monitor.health().bridged, 1000u);
  for (int k = 0; k < 8000; ++k) {
    loop.hold(0, 0, 0.05);
    monitor.look(loop);
  }
  EXPECT_EQ(diagnose(monitor.health()), LoopFault::none);
  for (int k = 0; k < 2000; ++k) {
    loop.update(0, -50);
    monitor.look(loop);
  }
  EXPECT_GT(monitor.health().saturated, 0.8);
}

/// Limits behind the law are seen by the u that is said before the monitor looks: of an axis that
/// does not come loose. What is said later is of the sample before.
TEST(Health, ALimitBehindTheLawIsOne) {
  for (const double side : {1.0, -1.0}) {
    for (const bool in_time : {true, false}) {
      auto loop = loop_of(20, 10);
      (void)loop.start(0.1, 0);
      auto monitor = monitor_of();
      for (int k = 0; k < 5000; ++k) {
        const double u = std::clamp(loop.update(0.1, 0.1 + 0.1 * side), -1.0, 1.0);
        if (in_time) (void)loop.applied(u);
        monitor.look(loop);
        (void)loop.applied(u);
      }
      EXPECT_LT(std::abs(loop.requested()), 5);  // not its own limits
      EXPECT_NEAR(monitor.health().side, in_time ? side : 0, 0.1);
      EXPECT_EQ(diagnose(monitor.health()) == LoopFault::saturated, in_time) << side;
    }
  }
}

/// A loop whose law asks for `beyond` more than goes out, of a machine at y(k).
template <class Y>
Health<double> asked_beyond(double beyond, int samples, const Y& y) {
  Loop<double>::Config config{};
  config.observer.observer = {
      .observer_bandwidth = omega_o, .input_gain = 20, .sample_time = sample_time};
  config.controller_bandwidth = 20;
  config.limits = {.lower = -1e6, .upper = 1e6};
  config.missing.most = 2;
  auto loop = Loop<double>::make(config).value();
  auto monitor = monitor_of();
  for (int k = 0; k < samples; ++k) {
    const double now = y(k);
    (void)loop.applied(loop.update(std::abs(now), 0.0) - (now < 0 ? 0.0 : beyond));
    monitor.look(loop);
  }
  return monitor.health();
}

/// What counts as a limit: more than rounding, and not without the law.
TEST(Health, ALimitIsMoreThanRounding) {
  const auto still = [](int) { return 0.0; };
  EXPECT_NEAR(asked_beyond(1e-3, 5000, still).side, 1, 0.01);
  EXPECT_NEAR(asked_beyond(-1e-3, 5000, still).side, -1, 0.01);
  EXPECT_EQ(asked_beyond(1e-5, 5000, still).saturated, 0);
  EXPECT_LT(asked_beyond(0.5, 5000, [](int) { return hidden_nan<double>(); }).saturated, 0.01);
}

/// The share of it counts by the memory (1000 samples), the way of y by an eighth of that.
TEST(Health, TheWayOfYHasAMemory) {
  const auto turns = [](int k) { return 1 + 1e-3 * (k < 1000 ? k : 2000 - k); };
  EXPECT_NEAR(asked_beyond(0.5, 100, turns).underway, 0.09, 0.02);
  const double before = asked_beyond(0.5, 1000, turns).underway;
  EXPECT_NEAR(before, 0.63, 0.02);
  EXPECT_GT(asked_beyond(0.5, 1060, turns).underway, before);
  EXPECT_LT(asked_beyond(0.5, 1200, turns).underway, before);
  // Before there was a limit (y is marked by its sign), y moves, too.
  const auto later = [](int k) { return k < 1000 ? -1 - 1e-3 * k : 3 - 1e-3 * k; };
  EXPECT_LT(asked_beyond(0.5, 2000, later).underway, -0.4);
}

/// y' = b u - a y + load, or the same of y'' (order 2), driven by a u that stands at a limit.
template <int Order, class S>
LoopFault at_a_limit(double b, double r, double load, double seconds) {
  constexpr double T = 0.05;
  const bool up = (r > 0) == (b > 0);
  auto loop = Adrc<LinearEso<Order, S>>::make(
                  {.observer = {.observer_bandwidth = S(2),
                                .input_gain = static_cast<S>(b),
                                .sample_time = static_cast<S>(T)},
                   .controller_bandwidth = S(0.5),
                   .limits = {.lower = S(up ? -1 : -0.1), .upper = S(up ? 0.1 : 1)}})
                  .value();
  auto monitor = HealthMonitor<Order + 1, S>::make({.observer_bandwidth = S(2),
                                                    .sample_time = static_cast<S>(T),
                                                    .input_range = S(0.55),
                                                    .noise = S(0.01),
                                                    .memory = S(40)})
                     .value();
  ChainPlant plant(Order, T, b, 0.005);
  Random random(7);
  for (int k = 0; k * T < seconds; ++k) {
    const auto y = static_cast<S>(plant.output() + 0.01 * random.uniform(-1.7, 1.7));
    plant.set_disturbance(load * b);
    plant.step(static_cast<double>(loop.update(y, static_cast<S>(r))));
    monitor.look(loop);
  }
  EXPECT_GT(monitor.health().saturated, S(0.6)) << b << ' ' << r;
  return diagnose(monitor.health());
}

template <int Order, class S>
void on_its_way_is_no_fault() {
  const double far = Order == 1 ? 20 : 500;
  for (const double b : {1.0, -1.0}) {
    for (const double r : {far, -far}) {
      const double drives = r > 0 ? 1 : -1;
      const double against = b > 0 ? -drives : drives;
      EXPECT_EQ((at_a_limit<Order, S>(b, r, 0, 80)), LoopFault::none) << b << ' ' << r;
      // The same, held where it is by a load as large, and driven back by a larger.
      EXPECT_EQ((at_a_limit<Order, S>(b, r, 0.1 * against, 400)), LoopFault::saturated) << b << r;
      EXPECT_EQ((at_a_limit<Order, S>(b, r, 0.15 * against, 400)), LoopFault::saturated) << b << r;
    }
  }
}

TEST(Health, OnItsWayIsNoFault) {
  on_its_way_is_no_fault<1, double>();
  on_its_way_is_no_fault<2, double>();
  on_its_way_is_no_fault<1, float>();
  on_its_way_is_no_fault<2, float>();
}

/// The same for where y is going: after it a load at the limit is named as soon as without it.
TEST(Health, AnAbsurdSampleIsNoWay) {
  for (const double garbage : {1e6, 1e100, 1e250}) {
    for (const double side : {1.0, -1.0}) {
      auto loop = loop_of<double>(20);
      auto monitor = monitor_of<double>();
      Random random(3);
      for (int k = 0; k < 12'000; ++k) {
        const double y = k < 4 ? -side * garbage : 1e-3 * random.uniform(-1, 1);
        (void)loop.update(y, side * 1e3);
        monitor.look(loop);
      }
      EXPECT_GT(monitor.health().saturated, 0.6);
      EXPECT_LT(std::abs(monitor.health().underway), 0.3) << garbage << ' ' << side;
    }
  }
}

/// An absurd sample is forgotten, not averaged: what comes after it tells the truth at once.
TEST(Health, AnAbsurdSampleIsNotRemembered) {
  auto loop = loop_of<float>(20);
  auto monitor = monitor_of<float>();
  Random random(3);
  const auto run = [&](float b, int samples) {
    ChainPlant plant(2, sample_time, static_cast<double>(b), 0);
    loop.observer().reset(0.f);
    for (int k = 0; k < samples; ++k) {
      const float u = k % 40 < 20 ? 0.3f : -0.3f;
      loop.track(static_cast<float>(plant.output()), 0.f, u);
      monitor.look(loop);
      plant.step(static_cast<double>(u));
    }
  };
  run(20, 3000);
  EXPECT_NEAR(monitor.health().gain_ratio, 1, 0.1);
  for (int k = 0; k < 4; ++k) {
    loop.track(1e17f, 0.f, 0.f);
    monitor.look(loop);
  }
  EXPECT_LT(monitor.health().innovation, 1e15f);
  loop = loop_of<float>(20);
  // 0.3 of the memory: sums of the time before would still weigh e^-0.3 = 0.74, which gives 0.5.
  run(-20, 300);
  EXPECT_LT(monitor.health().gain_ratio, -0.5);
}

/// Each limit from both sides, the worst first.
TEST(Health, Diagnosis) {
  Health<double> health{.samples = 1000, .innovation = 1};
  EXPECT_EQ(diagnose(health), LoopFault::none);
  health.gain_ratio = 0.24;
  health.evidence = 4.9;
  EXPECT_EQ(diagnose(health), LoopFault::none);
  health.evidence = 5;
  EXPECT_EQ(diagnose(health), LoopFault::gain_too_large_or_disturbed);
  health.innovation_of_noise = 0.3;
  EXPECT_EQ(diagnose(health), LoopFault::innovation_too_large);
  health.bounded = 0.51;
  EXPECT_EQ(diagnose(health), LoopFault::bounded);
  health.saturated = 0.4;  // y moves back: that does not make more of it
  health.underway = -0.4;
  EXPECT_EQ(diagnose(health), LoopFault::bounded);
  health.underway = 0;
  health.saturated = 0.51;
  EXPECT_EQ(diagnose(health), LoopFault::saturated);
  health.standing = 0.991;
  EXPECT_EQ(diagnose(health), LoopFault::sensor_still);
  health.lost = 0.101;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.gain_ratio = 3.01;
  EXPECT_EQ(diagnose(health), LoopFault::gain_too_small);
  health.evidence = 4.9;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  // u between both limits: a response that a lag may delay.
  health.evidence = 5;
  health.response = 2.51;
  for (const double side : {0.4, -0.4}) {
    health.side = side;
    health.gain_ratio = 0.63;
    EXPECT_EQ(diagnose(health), LoopFault::gain_too_small);
    health.gain_ratio = 0.62;
    EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  }
  health.gain_ratio = 0.63;
  health.side = 0.41;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.side = 0;
  health.saturated = 0.05;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.saturated = 0.51;
  health.response = 2.5;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  // The sign: at a limit at once, elsewhere after long.
  health.gain_ratio = -0.01;
  health.evidence = 1;
  health.opposed = 4;
  health.bounded = 0;
  health.sign_ratio = -0.25;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.sign_ratio = -0.26;
  EXPECT_EQ(diagnose(health), LoopFault::wrong_sign);
  // Where u moved little, for long.
  health.opposed = 0;
  health.sign_ratio = 0;
  health.gain_ratio = -0.13;
  health.steady = 40;
  EXPECT_EQ(diagnose(health), LoopFault::wrong_sign);
  health.steady = 39;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.steady = 40;
  health.gain_ratio = -0.11;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.steady = 0;
  health.opposed = 4;
  health.gain_ratio = -0.01;
  // Behind a bound any negative rho.
  health.sign_ratio = 0;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.bounded = 0.021;
  EXPECT_EQ(diagnose(health), LoopFault::wrong_sign);
  health.gain_ratio = 0;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.bounded = 0;
  health.sign_ratio = -0.26;
  health.opposed = 3.9;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.opposed = 4;
  health.evidence = 0.9;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.evidence = 49;
  health.opposed = 0;
  health.gain_ratio = -0.51;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.evidence = 50;
  EXPECT_EQ(diagnose(health), LoopFault::wrong_sign);
  // Not if large moves say otherwise; if there were none, yes.
  for (const double seen : {-0.24, 0.9}) {
    health.sign_ratio = seen;
    EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  }
  health.sign_ratio = 0;
  EXPECT_EQ(diagnose(health), LoopFault::wrong_sign);
  health.gain_ratio = -0.49;
  EXPECT_EQ(diagnose(health), LoopFault::measurements_rejected);
  health.reversed = true;
  EXPECT_EQ(diagnose(health), LoopFault::wrong_sign);
  health.reversed = false;
  health.lost = 0.1;
  EXPECT_EQ(diagnose(health), LoopFault::sensor_still);
  health.saturated = health.bounded = 0.49;
  EXPECT_EQ(diagnose(health), LoopFault::sensor_still);
  health.evidence = 4.9;
  health.innovation = 0.1;
  EXPECT_EQ(diagnose(health), LoopFault::none);
  health.saturated = 0.51;
  EXPECT_EQ(diagnose(health), LoopFault::sensor_still);
  health.standing = 0.99;
  EXPECT_EQ(diagnose(health), LoopFault::saturated);
  health.saturated = 0.49;
  health.evidence = 50;
  health.innovation = 0.89;
  for (const double rho : {0.26, 2.99}) {
    health.gain_ratio = rho;
    EXPECT_EQ(diagnose(health), LoopFault::none);
  }
  // At a limit it is not beyond it.
  const HealthLimits limits;
  for (const double rho : {limits.wrong_sign, limits.too_small}) {
    const Health<double> at{.samples = 20,
                            .rejected = 20,
                            .lost = 0.1,
                            .saturated = 0.5,
                            .bounded = 0.5,
                            .gain_ratio = rho,
                            .evidence = 99};
    EXPECT_EQ(diagnose(at), rho < 0 ? LoopFault::gain_too_large_or_disturbed : LoopFault::none);
  }
  // Each fault in words of its own.
  std::string all;
  for (int i = 0; i < 9; ++i) {
    std::ostringstream words;
    words << static_cast<LoopFault>(i);
    EXPECT_EQ(all.find(words.str()), std::string::npos);
    EXPECT_GT(words.str().size(), 20u);
    all += words.str();
  }
}

/// A machine that falls back to its own rest (dhat contains -a y) while u is at its limit, under
/// loads that jump; springs and friction; a heater. None has the wrong sign. With the other sign
/// nearly all have, and stay so; without an actuator few are taken for it.
template <int Order>
void sign_is_told(double& healthy, double& wrong, double& detached) {
  constexpr double T = 1e-3;
  constexpr double wo = Order == 1 ? 58 : 100;
  constexpr double wc = Order == 1 ? wo / 8 : wo / 6;
  Random random(20 + Order);
  for (int i = 0; i < (sanitized ? 20 : 100); ++i) {
    const bool heater = Order == 1 && random.uniform(0, 1) < 0.3;
    const double b = random.uniform(0, 1) < 0.5 ? -50 : 50;
    const double ratio = std::exp2(random.uniform(-1, 1));
    const double pole = heater || random.uniform(0, 1) < 0.7 ? random.uniform(0.3, 10) : 0;
    const double spring = Order == 2 && random.uniform(0, 1) < 0.5 ? random.uniform(10, 200) : 0;
    const double friction = random.uniform(0, 1) < 0.4 ? random.uniform(0, 15) : 0;
    const double load = random.uniform(0, heater ? 8 : 27);
    const double period = random.uniform(0.6, 6);
    const double amplitude = std::exp(random.uniform(-1.6, 1.4)) * 50 / (Order == 1 ? wc : wc * wc);
    const double swing = random.uniform(0.5, 3);
    for (const double effect : {1.0, -1.0, 0.0}) {
      typename Adrc<LinearEso<Order>>::Config config{};
      config.observer = {.observer_bandwidth = wo, .input_gain = ratio * b, .sample_time = T};
      config.controller_bandwidth = wc;
      config.limits = {.lower = heater ? 0.0 : -1.0, .upper = 1};
      auto loop = Adrc<LinearEso<Order>>::make(config).value();
      auto monitor =
          HealthMonitor<Order + 1>::make(
              {.observer_bandwidth = wo, .sample_time = T, .input_range = heater ? 0.5 : 1})
              .value();
      double y = 0, v = 0;
      bool named = false;
      int forgotten = 0;
      for (int k = 0; k < 8000 && std::abs(y) < 1e4; ++k) {
        const double t = k * T;
        const double r = amplitude * std::sin(swing * t);
        const double u = loop.update(y, heater ? std::abs(r) : r);
        monitor.look(loop, y);
        const bool is = diagnose(monitor.health()) == LoopFault::wrong_sign;
        forgotten += effect < 0 && named && !is ? 1 : 0;
        named = named || is;
        const double push = (effect == 0 && t >= 1 ? 0
                             : effect < 0          ? -b
                                                   : b) *
                                u +
                            (std::fmod(t, period) < period / 2 ? load : -load) -
                            pole * (Order == 1 ? y : v) - spring * y;
        const double rub = std::copysign(std::min(std::abs(push), friction), push);
        if (Order == 1) {
          y += T * (push - rub);
        } else {
          const double before = v;
          v += T * (v != 0 ? push - std::copysign(friction, v) : push - rub);
          if (before * v < 0) v = 0;
          y += T * (before + v) / 2;
        }
      }
      EXPECT_EQ(forgotten, 0) << Order << ' ' << i;
      (effect > 0 ? healthy : effect < 0 ? wrong : detached) += named ? 1 : 0;
    }
  }
}

TEST(Health, TellsAWrongSignFromALoad) {
  double healthy = 0, wrong = 0, detached = 0;
  sign_is_told<1>(healthy, wrong, detached);
  sign_is_told<2>(healthy, wrong, detached);
  const double count = sanitized ? 40 : 200;
  EXPECT_EQ(healthy, 0);
  EXPECT_GT(wrong, 0.7 * count) << "of those that cannot be told many are at rest at a limit";
  EXPECT_LT(detached, 0.2 * count);
}

/// It stays until u has moved y the right way, or `clear`.
TEST(Health, RemembersAWrongSign) {
  auto loop = loop_of<float>(20);
  auto monitor = monitor_of<float>();
  const auto run = [&](double b, int samples, double size) {
    ChainPlant plant(2, sample_time, b, 0);
    loop.observer().reset(0.f);
    for (int k = 0; k < samples; ++k) {
      const auto u = static_cast<float>(k % 40 < 20 ? size : -size);
      loop.track(static_cast<float>(plant.output()), 0.f, u);
      monitor.look(loop);
      plant.step(static_cast<double>(u));
    }
  };
  run(-20, 1000, 0.6);
  EXPECT_EQ(diagnose(monitor.health()), LoopFault::wrong_sign);
  // u rests at a limit: no news, for long.
  for (int k = 0; k < 20000; ++k) {
    loop.track(0.f, 0.f, 1.f);
    monitor.look(loop);
  }
  EXPECT_LT(monitor.health().evidence, 1);
  EXPECT_EQ(diagnose(monitor.health()), LoopFault::wrong_sign);
  auto cleared = monitor;
  cleared.clear();
  EXPECT_NE(diagnose(cleared.health()), LoopFault::wrong_sign);
  run(20, 2000, 0.6);
  EXPECT_GT(monitor.health().sign_ratio, 0.25);
  EXPECT_NE(diagnose(monitor.health()), LoopFault::wrong_sign);
}

/// What a sensor begins to lose is found as soon after ten hours as at the start; and the counts
/// that only tell do not wrap.
template <class S>
void finds_losses_at_any_time(int healthy, double share) {
  using Plain = Adrc<LinearEso<1, S>>;
  typename Plain::Config config{};
  config.observer = {.observer_bandwidth = S(10), .input_gain = S(1), .sample_time = S(0.01)};
  config.controller_bandwidth = S(2);
  config.limits = {.lower = S(-1), .upper = S(1)};
  auto loop = Plain::make(config).value();
  auto monitor = HealthMonitor<2, S>::make({.observer_bandwidth = S(10),
                                            .sample_time = static_cast<S>(0.01),
                                            .input_range = S(1),
                                            .memory = S(5)})
                     .value();
  Random random(3);
  int found = 0;
  for (int k = 0; k < healthy + 10000 && found == 0; ++k) {
    const bool bad = k >= healthy && random.uniform(0, 1) < share;
    loop.update(bad ? hidden_nan<S>() : static_cast<S>(random.uniform(-1e-3, 1e-3)), S(0));
    monitor.look(loop);
    if (diagnose(monitor.health()) == LoopFault::measurements_rejected) found = k + 1;
  }
  ASSERT_GT(found, healthy) << share;
  // A share p of losses reaches a tenth after -ln(1 - 0.1 / p) memories; of 500 samples.
  const double expected = -500 * std::log(1 - 0.1 / share);
  EXPECT_NEAR(found - healthy, expected, 0.6 * expected + 5) << healthy << ' ' << share;
}

TEST(Health, FindsLossesAtAnyTime) {
  for (const int healthy : {0, 1000, 200000}) {
    for (const double share : {0.15, 0.5, 1.0}) {
      finds_losses_at_any_time<double>(healthy, share);
      finds_losses_at_any_time<float>(healthy, share);
    }
  }
  // One loss never is a tenth, however short the memory.
  auto loop = loop_of(20);
  auto monitor = HealthMonitor<3>::make({.observer_bandwidth = omega_o,
                                         .sample_time = sample_time,
                                         .input_range = 1,
                                         .memory = 0.08})
                     .value();
  for (int k = 0; k < 11; ++k) {
    EXPECT_EQ(diagnose(monitor.health()), LoopFault::none) << k;
    loop.update(hidden_nan<double>(), 0);
    monitor.look(loop);
  }
  EXPECT_EQ(diagnose(monitor.health()), LoopFault::measurements_rejected);
}

/// A count at the end of its numbers stays there, and says nothing of the present.
TEST(Health, CountsEndAndDoNotWrap) {
  constexpr std::uint32_t most = 4294967295u;
  for (const std::uint32_t rejected : {2000u, most}) {
    Health<float> health{.samples = 299999999u, .rejected = rejected};
    EXPECT_EQ(diagnose(health), LoopFault::none);
  }
  auto monitor = monitor_of();
  auto& health = const_cast<Health<double>&>(monitor.health());
  health.samples = health.rejected = health.bridged = health.gated = health.unsafe = most - 1;
  auto loop = loop_of(20);
  loop.observer().set_trust(0.5);
  for (int k = 0; k < 8; ++k) {
    loop.hold(k % 2 == 0 ? 0.0 : hidden_nan<double>(), 0, 0.05);
    monitor.look(loop);
  }
  for (const std::uint32_t count : {health.samples, health.rejected}) EXPECT_EQ(count, most);
  for (const std::uint32_t count : {health.bridged, health.gated, health.unsafe}) {
    EXPECT_GE(count, most - 1);
  }
}

/// A sensor that stands still is named while u moves or rests at a limit, and only then.
TEST(Health, NamesASensorThatStandsStill) {
  for (const double sign : {1.0, -1.0}) {
    for (const double stuck : {0.0, 0.3}) {
      auto loop = loop_of(sign * 20);
      auto monitor = monitor_of();
      ChainPlant plant(2, sample_time, sign * 20, 3);
      LoopFault fault{};
      const auto run = [&](int from, int to, bool stands, double r) {
        for (int k = from; k < to; ++k) {
          const double y = stands ? stuck : plant.output();
          const double u = loop.update(y, r * std::sin(0.005 * k));
          monitor.look(loop, y);
          plant.step(u);
          fault = diagnose(monitor.health());
          if (!stands) {
            ASSERT_NE(fault, LoopFault::sensor_still) << k;
          }
        }
      };
      run(0, 8000, false, 0.3);
      run(8000, 14000, true, 0.3);
      EXPECT_EQ(fault, LoopFault::sensor_still) << sign << ' ' << stuck;
      // At rest with a quantised y nothing is known, and nothing said.
      loop = loop_of(sign * 20);
      monitor.clear();
      for (int k = 0; k < 8000; ++k) {
        (void)loop.update(0.0, 0.0);
        monitor.look(loop, 0.0);
      }
      EXPECT_GT(monitor.health().standing, 0.99);
      EXPECT_EQ(diagnose(monitor.health()), LoopFault::none);
      // Lost measurements are not equal ones.
      for (int k = 0; k < 8000; ++k) {
        (void)loop.update(hidden_nan<double>(), 0.0);
        monitor.look(loop, hidden_nan<double>());
      }
      EXPECT_EQ(diagnose(monitor.health()), LoopFault::measurements_rejected);
    }
  }
}

TEST(Health, RefusesBadSettings) {
  const HealthConfig<double> good{
      .observer_bandwidth = 100, .sample_time = 1e-3, .input_range = 1, .memory = 0.08};
  const auto refused = [&](auto change) {
    HealthConfig<double> config = good;
    change(config);
    return refusal(HealthMonitor<3>::make(config));
  };
  EXPECT_EQ(refused([](auto&) {}), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.observer_bandwidth = 0; }),
            "observer_bandwidth: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.sample_time = -1; }),
            "sample_time: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.input_range = hidden_nan<double>(); }),
            "input_range: must be finite and positive");
  EXPECT_EQ(refused([](auto& c) { c.noise = -1; }), "noise: must be finite and not negative");
  EXPECT_EQ(refused([](auto& c) { c.memory = 0.0799; }),
            "memory: must be at least 8 / omega_o, that is");
  for (const double latency : {-1e-9, hidden_nan<double>()}) {
    EXPECT_EQ(refused([&](auto& c) { c.latency = latency; }),
              "latency: must be finite and not negative");
  }
  // By N = 3 of memory / 8 - 1 / omega_o.
  EXPECT_EQ(refused([](auto& c) {
              c.memory = 0.16;
              c.latency = 0.03;
            }),
            "accepted");
  for (const double latency : {0.0301, 1e308}) {
    EXPECT_EQ(
        refused([&](auto& c) {
          c.memory = 0.16;
          c.latency = latency;
        }),
        "latency: is too large: memory must be at least 8 / omega_o + 8 latency / N, that is");
  }
  EXPECT_EQ(refused([](auto& c) { c.divider = 0; }), "divider: must be 1 .. 1000");
  EXPECT_EQ(refused([](auto& c) { c.divider = 10; }), "accepted");
  EXPECT_EQ(refused([](auto& c) { c.divider = 11; }),
            "divider: is too large: omega_o T D must be at most");

  // Both tell the limit that they end with.
  const auto said = [&](auto change) {
    HealthConfig<double> config = good;
    change(config);
    std::ostringstream words;
    words << HealthMonitor<3>::make(config).error();
    return words.str();
  };
  EXPECT_EQ(said([](auto& c) { c.memory = 0.07; }),
            "memory = 0.07: must be at least 8 / omega_o, that is 0.08");
  EXPECT_EQ(said([](auto& c) { c.divider = 11; }),
            "divider = 11: is too large: omega_o T D must be at most 1");

  // Unless told otherwise it remembers for a second and looks at every fourth sample.
  const HealthConfig<double> standard{
      .observer_bandwidth = 8, .sample_time = 0.03125, .input_range = 1};
  EXPECT_TRUE(HealthMonitor<3>::make(standard));
  EXPECT_EQ(standard.memory, 1.0);
  EXPECT_EQ(standard.divider, 4);
}

/// After numbers of any kind it tells numbers, and the truth once the loop is well.
TEST(Health, AnyNumbers) {
  Random random(9);
  for (int trial = 0; trial < 50; ++trial) {
    auto loop = loop_of<float>(20);
    auto monitor = monitor_of<float>(1e-6);
    for (int k = 0; k < 200; ++k) {
      loop.track(anything<float>(random), 0, anything<float>(random));
      monitor.look(loop);
      const auto& h = monitor.health();
      ASSERT_TRUE(is_finite(h.gain_ratio) && is_finite(h.innovation) && is_finite(h.evidence));
      ASSERT_TRUE(is_finite(h.saturated) && h.saturated >= 0 && h.saturated <= 1);
    }
    ChainPlant plant(2, sample_time, -20, 0);
    float push = 0;
    for (int k = 0; k < 30000; ++k) {
      if (k % 40 == 0) push = static_cast<float>(random.uniform(-0.5, 0.5));
      const auto y = static_cast<float>(plant.output());
      const float u = push + 0.5f * y + 0.3f * static_cast<float>(plant.state()[1]);
      loop.track(y, 0, u);
      monitor.look(loop);
      plant.step(static_cast<double>(u));
    }
    ASSERT_EQ(diagnose(monitor.health()), LoopFault::wrong_sign) << trial;
    if (trial == 0 && sanitized) break;
  }
}

TEST(Telemetry, IsATableThatIdentifyReads) {
  auto loop = loop_of(20, 0.5);
  const double u = loop.update(0.25, 2.0);
  const auto row = telemetry(loop, 0.125, 0.25, 2.0);
  EXPECT_EQ(row.u, u);
  EXPECT_EQ(row.u, 0.5);
  EXPECT_EQ(row.requested, loop.requested());
  EXPECT_EQ(row.estimate[2], row.disturbance);
  EXPECT_EQ(row.trust, 1);
  static_assert(std::is_trivially_copyable_v<decltype(row)>);
  std::ostringstream out;
  write_header<3>(out);
  EXPECT_EQ(out.str(),
            "time,u,y,r,requested,dhat,innovation,status,mode,trust,bounded,estimate_0,estimate_1,"
            "estimate_2\n");
  out.str("");
  write_row(out, row);
  const std::string text = out.str();
  EXPECT_EQ(text.substr(0, 17), "0.125,0.5,0.25,2,");
  EXPECT_EQ(std::count(text.begin(), text.end(), ','), 13);
}

// ---- GainProbe: b / b0 under a load that u reacts to, in any sign and unit, and an end in the
// steps' limits

template <class S>
typename GainProbe<3, S>::Config settings() {
  return {.observer_bandwidth = static_cast<S>(omega_o),
          .sample_time = static_cast<S>(sample_time),
          .amplitude = static_cast<S>(0.1),
          .travel = S(5),
          .limits = {.lower = S(-1), .upper = S(1)}};
}

/// A regulator under a load that swings, which drives u by more than the steps do.
template <class S>
void probed_ratio_is_that_of_the_gains() {
  for (const double sign : {1.0, -1.0}) {
    for (const double ratio : {0.1, 0.5, 1.0, 1.6}) {
      const double b0 = sign * 20;
      auto loop = loop_of<S>(b0);
      auto probe = GainProbe<3, S>::make(settings<S>()).value();
      ChainPlant plant(2, sample_time, b0 * ratio, 0);
      S applied{};
      double most = 0;
      int samples = 0;
      while (!probe.finished() && ++samples < 2000) {
        plant.set_disturbance(2 * ratio * std::sin(0.005 * samples));
        const auto y = static_cast<S>(plant.output());
        loop.applied(applied);
        const S u = loop.update(y, S(0));
        applied = probe.update(loop, y);
        most = std::max(most, std::abs(static_cast<double>(applied - u)));
        plant.step(static_cast<double>(applied));
      }
      ASSERT_FALSE(probe.aborted());
      // Nine periods of 10 / omega_o.
      EXPECT_EQ(samples, 900);
      EXPECT_NEAR(most, 0.1, 1e-6);
      const auto found = probe.result().value();
      EXPECT_NEAR(static_cast<double>(found.gain_ratio), ratio, 0.05) << sign;
      EXPECT_GT(found.half_width, S(0));
      EXPECT_LT(found.half_width, S(0.15));
      // After it u is the loop's.
      loop.applied(applied);
      const S u = loop.update(S(0), S(0));
      EXPECT_EQ(probe.update(loop, S(0)), u);
    }
  }
}

TEST(GainProbe, RatioIsThatOfTheGainsUnderALoad) {
  probed_ratio_is_that_of_the_gains<double>();
  probed_ratio_is_that_of_the_gains<float>();
}

TEST(GainProbe, EndsWhereItMustNotGoOn) {
  for (const bool far : {true, false}) {
    auto loop = loop_of<double>(20);
    auto probe = GainProbe<3>::make(settings<double>()).value();
    (void)loop.update(0, 0);
    EXPECT_NE(probe.update(loop, 0), loop.output());
    EXPECT_EQ(refusal(probe.result()), "periods: are too few: not finished, or aborted");
    const double y = far ? 5.01 : hidden_nan<double>();
    EXPECT_EQ(probe.update(loop, y), loop.output()) << far;
    EXPECT_TRUE(probe.aborted());
    EXPECT_EQ(probe.update(loop, 0), loop.output());
    EXPECT_EQ(refusal(probe.result()), "periods: are too few: not finished, or aborted");
  }
  auto loop = loop_of<double>(20);
  auto probe = GainProbe<3>::make(settings<double>()).value();
  (void)loop.update(0, 0);
  (void)probe.update(loop, 0);
  (void)probe.update(loop, 4.99);
  EXPECT_FALSE(probe.aborted());
}

/// What a probe asks of a controller, under the test's control.
struct Fake {
  struct Observer {
    static constexpr int size = 2;
    double u = 0, d = 0;
    double input_gain() const { return 1; }
    double applied_input() const { return u; }
    double total_disturbance() const { return d; }
  };
  Observer seen;
  double wanted = 0;
  const Observer& observer() const { return seen; }
  LoopMode mode() const { return LoopMode::running; }
  double output() const { return wanted; }
};

/// The interval of 6 periods of noise alone covers b = b0 as often as 95 % do.
TEST(GainProbe, IntervalCoversTheNoise) {
  Random random(17);
  int covered = 0;
  constexpr int trials = 4000;
  for (int trial = 0; trial < trials; ++trial) {
    auto probe = GainProbe<2>::make({.observer_bandwidth = 1,
                                     .sample_time = 1,
                                     .amplitude = 1,
                                     .travel = 1,
                                     .periods = 6,
                                     .limits = {.lower = -9, .upper = 9}})
                     .value();
    Fake loop;
    while (!probe.finished()) {
      loop.seen.u = probe.update(loop, 0);
      loop.seen.d = random.uniform(-1, 1) + random.uniform(-1, 1) + random.uniform(-1, 1);
    }
    const auto found = probe.result().value();
    covered += std::abs(found.gain_ratio - 1) <= found.half_width ? 1 : 0;
  }
  // Three standard errors of the share.
  EXPECT_NEAR(static_cast<double>(covered) / trials, 0.95, 3 * std::sqrt(0.95 * 0.05 / trials));
}

TEST(GainProbe, RateCountsFromWhatWasHeldAndTravelFromTheStart) {
  auto config = settings<double>();
  config.limits.rate = 10;  // 0.01 a sample
  auto probe = GainProbe<2>::make({.observer_bandwidth = omega_o,
                                   .sample_time = sample_time,
                                   .amplitude = 0.1,
                                   .travel = 5,
                                   .limits = config.limits})
                   .value();
  Fake loop;
  loop.seen.u = 0.5;
  EXPECT_NEAR(probe.update(loop, 2), 0.49, 1e-12);
  (void)probe.update(loop, 7);
  EXPECT_FALSE(probe.aborted());
  (void)probe.update(loop, -3.000001);
  EXPECT_TRUE(probe.aborted());
}

TEST(GainProbe, StaysWithinTheLimits) {
  auto loop = loop_of<double>(20);
  auto config = settings<double>();
  config.limits = {.lower = -0.05, .upper = 0.08};
  auto probe = GainProbe<3>::make(config).value();
  double applied = 0, high = 0, low = 0;
  while (!probe.finished()) {
    loop.applied(applied);
    (void)loop.update(0, 0);
    applied = probe.update(loop, 0);
    high = std::max(high, applied);
    low = std::min(low, applied);
  }
  EXPECT_EQ(high, 0.08);
  EXPECT_EQ(low, -0.05);
}

TEST(GainProbe, Refusals) {
  const auto refused = [](auto change) {
    auto config = settings<double>();
    change(config);
    return refusal(GainProbe<3>::make(config));
  };
  using Config = GainProbe<3>::Config;
  for (const double bad : {0.0, -1.0, hidden_nan<double>(), hidden_infinity<double>()}) {
    const char* const rule = ": must be finite and positive";
    EXPECT_EQ(refused([&](Config& c) { c.observer_bandwidth = bad; }),
              std::string("observer_bandwidth") + rule);
    EXPECT_EQ(refused([&](Config& c) { c.sample_time = bad; }), std::string("sample_time") + rule);
    EXPECT_EQ(refused([&](Config& c) { c.amplitude = bad; }), std::string("amplitude") + rule);
    EXPECT_EQ(refused([&](Config& c) { c.travel = bad; }), std::string("travel") + rule);
  }
  for (const int periods : {5, 201}) {
    EXPECT_EQ(refused([&](Config& c) { c.periods = periods; }), "periods: must be 6 .. 200");
  }
  EXPECT_EQ(refused([](Config& c) { c.sample_time = 0.0101; }),
            "observer_bandwidth: times sample_time must be at most");
  EXPECT_EQ(refused([](Config& c) { c.sample_time = 1e-10; }),
            "observer_bandwidth: makes half a period longer than 2^24 samples");
  EXPECT_NE(refused([](Config& c) { c.limits.lower = 2; }), "");
  for (const int periods : {6, 200}) {
    auto config = settings<double>();
    config.sample_time = 0.01;
    config.periods = periods;
    EXPECT_TRUE(GainProbe<3>::make(config).has_value());
  }
}

}  // namespace control_health_test
}  // namespace esokit_test
