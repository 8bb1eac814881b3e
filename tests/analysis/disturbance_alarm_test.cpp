// The alarm on dhat: its rate against the integral of the joint density and against runs of the
// real controller, the noise of dhat against its response to single samples of noise, the delay
// against runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/analysis/disturbance_alarm.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <esokit/sim/gaussian.hpp>
#include <limits>
#include <numbers>
#include <support/refusal.hpp>
#include <vector>

namespace analysis_disturbance_alarm_test {

using esokit_test::refusal;

using namespace esokit;

constexpr double T = 0.01;

template <int Order>
LinearPlant<Order> plant(double gain) {
  return LinearPlant<Order>::chain({.input_gain = gain}).value();
}

template <int Order, class Form = OutputBased>
Adrc<LinearEso<Order>, Form> controller(double gain) {
  return Adrc<LinearEso<Order>, Form>::make(
             {.observer = {.observer_bandwidth = 12.0, .input_gain = gain, .sample_time = T},
              .controller_bandwidth = 4.0})
      .value();
}

/// y^(n) = b u + d under the real controller.
template <int Order, class Form = OutputBased>
struct LoopRun {
  explicit LoopRun(double gain) : b(gain), adrc(controller<Order, Form>(gain)) {}

  /// dhat of a sample with this noise on y, d being held from then on.
  double step(double noise, double d) {
    const double rate = b * adrc.update(x[0] + noise, 0.0) + d;
    const auto before = x;
    for (std::size_t i = 0; i < Order; ++i) {
      double term = 1.0;  // T^j / j!
      double next = 0.0;
      for (std::size_t j = i; j < Order; ++j) {
        next += term * before[j];
        term *= T / static_cast<double>(j - i + 1);
      }
      x[i] = next + term * rate;
    }
    const double dhat = adrc.observer().estimate()(Order);
    return std::is_same_v<Form, ErrorBased> ? -dhat : dhat;
  }

  double b;
  Adrc<LinearEso<Order>, Form> adrc;
  std::array<double, static_cast<std::size_t>(Order)> x{};
};

template <class Function>
void for_all_loops(const Function& function) {
  for (const double gain : {2.0, -2.0}) {
    SCOPED_TRACE(gain);
    function(LoopRun<1>(gain));
    function(LoopRun<2>(gain));
    function(LoopRun<3>(gain));
    function(LoopRun<2, ErrorBased>(gain));
  }
}

TEST(DisturbanceAlarm, RateIsThatOfTheJointDensity) {
  const auto loop = closed_loop(plant<1>(2.0), controller<1>(2.0)).value();
  for (const double rho : {-1.0, -0.8, 0.0, 0.5, 0.99, 1.0 - 1e-6, 1.0 - 1e-10}) {
    for (const double per_sample : {1e-1, 1e-2, 1e-6, 1e-12}) {
      const double change = std::sqrt(2.0 * (1.0 - rho));
      const auto alarm =
          disturbance_alarm(loop, 1,
                            {.false_alarms_per_hour = per_sample * 3600.0 / T,
                             .measured = {{.deviation = 3.0, .change = 3.0 * change}}});
      if (!alarm) {
        // As many as asked for are not to be had: a threshold of zero is passed at every change of
        // sign.
        EXPECT_GE(per_sample, std::acos(rho) / std::numbers::pi * (1.0 - 1e-9));
        continue;
      }
      const double a = alarm->threshold / 3.0;
      // Twice the integral of phi(x) P(the sample before was below a) over x >= a; x = a + s t, as
      // the integrand is as narrow as s.
      const double s = std::sqrt((1.0 - rho) * (1.0 + rho));
      const double width = rho > 0.0 ? std::min(12.0, 9.0 * s / rho + 9.0 * (1.0 - rho) * a) : 12.0;
      constexpr int steps = 200'000;
      double sum = 0.0;
      for (int i = 0; i < steps; ++i) {
        const double more = width * (i + 0.5) / steps;
        const double x = a + more;
        const double below =
            s > 0.0 ? 0.5 * std::erfc((rho * more - (1.0 - rho) * a) / s / std::numbers::sqrt2)
                    : (-x < a ? 1.0 : 0.0);
        sum += std::exp(-0.5 * x * x) * below;
      }
      const double rate = 2.0 * sum * width / steps / std::sqrt(2.0 * std::numbers::pi);
      EXPECT_NEAR(rate, per_sample, 1e-6 * per_sample) << rho;
    }
  }
}

TEST(DisturbanceAlarm, NoiseIsThatOfTheRunningLoop) {
  for_all_loops([](const auto& start) {
    constexpr int order = std::remove_cvref_t<decltype(start.adrc)>::order;
    const auto alarm = disturbance_alarm(plant<order>(start.b), start.adrc,
                                         {.noise = {.measurement = {0.1}, .disturbance = {2.0}}})
                           .value();
    double square = 0.0;
    double change = 0.0;
    for (const bool of_y : {true, false}) {
      auto run = start;
      double last = 0.0;
      for (int k = 0; k < 2000; ++k) {
        const bool first = k == 0;
        const double dhat = run.step(of_y && first ? 0.1 : 0.0, !of_y && first ? 2.0 : 0.0);
        square += dhat * dhat;
        change += (dhat - last) * (dhat - last);
        last = dhat;
      }
    }
    EXPECT_NEAR(alarm.noise.deviation, std::sqrt(square), 1e-8 * std::sqrt(square));
    EXPECT_NEAR(alarm.noise.change, std::sqrt(change), 1e-8 * std::sqrt(change));
  });
}

TEST(DisturbanceAlarm, IsAsOftenFalseAsAskedFor) {
  for_all_loops([](auto run) {
    constexpr int order = std::remove_cvref_t<decltype(run.adrc)>::order;
    constexpr int samples = 400'000;
    constexpr double wanted = 1500.0;  // in the run
    const auto alarm = disturbance_alarm(plant<order>(run.b), run.adrc,
                                         {.false_alarms_per_hour = wanted / (samples * T) * 3600.0,
                                          .noise = {.measurement = {1e-3}}})
                           .value();
    sim::Gaussian noise(static_cast<unsigned>(order));
    std::vector<double> counts(100);
    int side = 0;
    for (int k = -2000; k < samples; ++k) {
      const double dhat = run.step(1e-3 * noise.next(), 0.0);
      const int now = dhat >= alarm.threshold ? 1 : dhat <= -alarm.threshold ? -1 : 0;
      if (k >= 0 && now != 0 && now != side)
        counts[static_cast<std::size_t>(k / (samples / 100))]++;
      side = now;
    }
    double mean = 0.0;
    double variance = 0.0;
    for (const double count : counts) mean += count / 100.0;
    for (const double count : counts) variance += (count - mean) * (count - mean) / 99.0;
    EXPECT_NEAR(100.0 * mean, wanted, 4.0 * std::sqrt(100.0 * variance));
    EXPECT_LT(variance, 4.0 * mean) << "the bound above would say nothing";
  });
}

TEST(DisturbanceAlarm, ComesAfterTheDelay) {
  for_all_loops([](const auto& start) {
    constexpr int order = std::remove_cvref_t<decltype(start.adrc)>::order;
    // So much that each order takes some samples.
    const double noise = order == 1 ? 0.02 : order == 2 ? 5e-4 : 2e-5;
    for (const double load : {3.0, -3.0}) {
      const auto alarm = disturbance_alarm(plant<order>(start.b), start.adrc,
                                           {.load = load, .noise = {.measurement = {noise}}})
                             .value();
      const double surely = alarm.threshold + 2.3263478740408408 * alarm.noise.deviation;
      auto run = start;
      double delay = -1.0;
      double latest = -1.0;
      double peak = 0.0;
      for (int k = 0; k < 2000; ++k) {
        const double dhat = run.step(0.0, load);
        EXPECT_TRUE(std::abs(dhat) < 1e-9 || (dhat > 0.0) == (load > 0.0));
        if (std::abs(dhat) >= alarm.threshold && delay < 0.0) delay = k * T;
        if (std::abs(dhat) >= surely && latest < 0.0) latest = k * T;
        peak = std::max(peak, std::abs(dhat));
      }
      EXPECT_GT(delay, T);
      EXPECT_GT(latest, delay);
      EXPECT_NEAR(alarm.delay, delay, 1e-9);
      EXPECT_NEAR(alarm.latest, latest, 1e-9);
      EXPECT_NEAR(alarm.least_load, surely * std::abs(load) / peak, 1e-6 * surely);
    }
  });
}

TEST(DisturbanceAlarm, SaysWhatIsNotFound) {
  const auto ask = [](double load) {
    return disturbance_alarm(plant<2>(2.0), controller<2>(2.0),
                             {.load = load, .noise = {.measurement = {1e-3}}})
        .value();
  };
  const auto least = ask(0.0).least_load;
  EXPECT_TRUE(std::isinf(ask(0.0).delay));
  EXPECT_TRUE(std::isinf(ask(0.999 * least).latest));
  EXPECT_TRUE(std::isfinite(ask(1.001 * least).latest));
  const double seen = least * ask(0.0).threshold /
                      (ask(0.0).threshold + 2.3263478740408408 * ask(0.0).noise.deviation);
  EXPECT_TRUE(std::isinf(ask(-0.999 * seen).delay));
  EXPECT_TRUE(std::isfinite(ask(-1.001 * seen).delay));
}

/// 1000 loads: what `latest` and `delay` say of cases with noise.
TEST(DisturbanceAlarm, IsNotLaterThanItSays) {
  const LoopRun<2> start(-2.0);
  const auto alarm =
      disturbance_alarm(
          plant<2>(start.b), start.adrc,
          {.false_alarms_per_hour = 10.0, .load = 4.0, .noise = {.measurement = {1e-3}}})
          .value();
  sim::Gaussian noise(11);
  int later = 0;
  int sooner = 0;
  for (int i = 0; i < 1000; ++i) {
    auto run = start;
    for (int k = 0; k < 200; ++k) run.step(1e-3 * noise.next(), 0.0);
    int k = 0;
    while (k < 1000 && std::abs(run.step(1e-3 * noise.next(), 4.0)) < alarm.threshold) ++k;
    if (k * T > alarm.latest + 1e-9) ++later;
    if (k * T < alarm.delay + 1e-9) ++sooner;
  }
  EXPECT_LE(later, 10);    // 1 %, at most: each sample before `latest` may find it as well
  EXPECT_GE(sooner, 500);  // at `delay` one half is beyond, and some were before
  EXPECT_LT(sooner, 990);
}

TEST(DisturbanceAlarm, TakesMeasuredNoise) {
  const auto loop = closed_loop(plant<2>(2.0), controller<2>(2.0)).value();
  const auto computed = disturbance_alarm(loop, 2, {.load = 5.0, .noise = {.measurement = {1e-3}}});
  const auto measured = disturbance_alarm(loop, 2, {.load = 5.0, .measured = computed->noise});
  EXPECT_EQ(measured->threshold, computed->threshold);
  EXPECT_EQ(measured->latest, computed->latest);
  // x[k+1] = 0.9 x[k] + w about 7: deviation 1 / sqrt(1 - 0.81), change sqrt(2 (1 - 0.9)) of it.
  sim::Gaussian random(5);
  std::vector<double> record;
  double x = 0.0;
  for (int k = 0; k < 200'000; ++k) record.push_back(7.0 + (x = 0.9 * x + random.next()));
  const auto noise = dhat_noise(record).value();
  const double deviation = 1.0 / std::sqrt(1.0 - 0.81);
  EXPECT_NEAR(noise.deviation, deviation, 0.02 * deviation);
  EXPECT_NEAR(noise.change, deviation * std::sqrt(0.2), 0.01 * deviation);
  const auto exact = dhat_noise(std::vector<double>([] {
                       std::vector<double> v;
                       for (int k = 0; k < 100; ++k) v.push_back(k % 2 == 0 ? 1.0 : -1.0);
                       return v;
                     }()))
                         .value();
  EXPECT_NEAR(exact.deviation, std::sqrt(100.0 / 99.0), 1e-12);
  EXPECT_NEAR(exact.change, 2.0, 1e-12);
}

TEST(DisturbanceAlarm, OfTwoChannelsIsThatOfEach) {
  using Two = MimoAdrc<LinearEso<1>, LinearEso<2>>;
  Two::Config config;
  std::get<0>(config.observers) = {.observer_bandwidth = 12.0, .sample_time = T};
  std::get<1>(config.observers) = {.observer_bandwidth = 12.0, .sample_time = T};
  config.controller_bandwidths = {4.0, 4.0};
  config.input_matrix = {{1.0, 0.0}, {0.0, 1.0}};
  const auto two = Two::make(config).value();
  LinearPlant<3, double, 2, 2> both;
  both.a = {{0.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, {0.0, 0.0, 0.0}};
  both.b = both.e = {{1.0, 0.0}, {0.0, 0.0}, {0.0, 1.0}};
  both.c = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};
  const auto loop = closed_loop(both, two).value();
  const auto alone = [](const auto& plant, const auto& adrc) {
    return disturbance_alarm(plant, adrc, {.load = 3.0, .noise = {.measurement = {1e-3}}}).value();
  };
  const auto expect_same = [&](int row, int channel, const DisturbanceAlarm& one) {
    const auto found = disturbance_alarm(
        loop, row, {.load = 3.0, .channel = channel, .noise = {.measurement = {1e-3, 1e-3}}});
    EXPECT_NEAR(found->threshold, one.threshold, 1e-9 * one.threshold);
    EXPECT_EQ(found->delay, one.delay);
    EXPECT_NEAR(found->least_load, one.least_load, 1e-9 * one.least_load);
  };
  expect_same(1, 0, alone(plant<1>(1.0), controller<1>(1.0)));
  expect_same(4, 1, alone(plant<2>(1.0), controller<2>(1.0)));
  // A load on the other channel is none to this one.
  EXPECT_TRUE(
      std::isinf(disturbance_alarm(loop, 4, {.load = 1e3, .noise = {{1e-3, 1e-3}}})->delay));
  EXPECT_EQ(refusal(disturbance_alarm(loop, 4, {.channel = 2, .noise = {{1e-3, 1e-3}}})),
            "channel: must be one that the loop has");
}

TEST(DisturbanceAlarm, RefusesByRule) {
  const auto loop = closed_loop(plant<2>(2.0), controller<2>(2.0)).value();
  const DisturbanceAlarmConfig good{.noise = {.measurement = {1e-3}}};
  const auto with = [&](const auto& change) {
    auto config = good;
    change(config);
    return refusal(disturbance_alarm(loop, 2, config));
  };
  EXPECT_TRUE(disturbance_alarm(loop, 2, good));
  for (const int row : {-1, 3}) {
    EXPECT_EQ(refusal(disturbance_alarm(loop, row, good)),
              "row: must be one of the estimates that the loop has");
  }
  for (const double rate : {0.0, -1.0, std::numeric_limits<double>::infinity()}) {
    EXPECT_EQ(with([&](auto& c) { c.false_alarms_per_hour = rate; }),
              "false_alarms_per_hour: must be finite and positive");
  }
  // At a threshold of zero an alarm is a change of sign: arccos(rho) / pi of the samples.
  const auto noise = disturbance_alarm(loop, 2, good)->noise;
  const double most =
      2.0 * std::asin(noise.change / noise.deviation / 2.0) / std::numbers::pi / T * 3600.0;
  EXPECT_EQ(with([&](auto& c) { c.false_alarms_per_hour = 1.001 * most; }),
            "false_alarms_per_hour: must be below those of a threshold of zero, which are");
  EXPECT_EQ(with([&](auto& c) { c.false_alarms_per_hour = 0.999 * most; }), "accepted");
  EXPECT_EQ(with([](auto& c) { c.load = std::nan(""); }), "load: must be finite");
  EXPECT_EQ(with([](auto& c) { c.noise = {}; }), "deviation: must be finite and positive");
  EXPECT_EQ(with([](auto& c) { c.noise.measurement = {-1.0}; }),
            "measurement[0]: must be finite and not negative");
  EXPECT_EQ(with([](auto& c) { c.measured = {{.deviation = 1.0, .change = 2.001}}; }),
            "change: must not be above twice the deviation: no signal of that deviation changes so "
            "much");
  EXPECT_EQ(with([](auto& c) { c.measured = {{.deviation = 1.0, .change = 0.0}}; }),
            "change: must be finite and positive");
  const auto unstable = closed_loop(plant<2>(-2.0), controller<2>(2.0)).value();
  EXPECT_EQ(refusal(disturbance_alarm(unstable, 2, good)),
            "stability_abscissa: must be negative: a loop that is not stable has no steady state");
  const auto continuous = ObserverWithLaw{
      ContinuousLinearEso<1>::make({.observer_bandwidth = 10.0, .input_gain = 1.0}).value(),
      AdrcLaw<1>::make({.controller_bandwidth = 3.0, .input_gain = 1.0}).value()};
  EXPECT_EQ(refusal(disturbance_alarm(closed_loop(plant<1>(1.0), continuous).value(), 1, good)),
            "sample_time: must be that of a sampled loop: an alarm looks at samples");
  EXPECT_EQ(refusal(dhat_noise(std::vector<double>(99))), "dhat: must be at least 100 values");
  EXPECT_EQ(refusal(dhat_noise(std::vector<double>(100, 3.0))),
            "dhat: must change: a constant one has no noise");
  std::vector<double> bad(100);
  bad[7] = std::nan("");
  EXPECT_EQ(refusal(dhat_noise(bad)), "dhat[7]: must be finite");
}

}  // namespace analysis_disturbance_alarm_test
