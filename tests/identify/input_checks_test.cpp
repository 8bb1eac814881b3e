// What a log tells about its u: each is told where it is, and not where it is not.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <esokit/identify/identify.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/sim/gaussian.hpp>
#include <functional>
#include <limits>
#include <vector>

namespace identify_input_checks_test {

using esokit::GainBySize;
using esokit::Identified;
using esokit::Log;

constexpr double T = 0.01, b0 = 20, pole = 3;

// y' = b0 effect(u(t - 1.5 T)) - a y, steps of u between -size and size.
Log machine(const std::function<double(double)>& effect, double size = 1) {
  esokit::sim::Gaussian gaussian(11);
  Log log;
  log.sample_time = T;
  double y = 0, u = 0, before = 0, earlier = 0;
  for (int k = 0; k < 1500; ++k) {
    if (k % 40 == 0) u = size * std::erf(gaussian.next());
    log.u.push_back(u);
    log.y.push_back(y + 0.02 * gaussian.next());
    for (int i = 0; i < 20; ++i) y += T / 20 * (b0 * effect(i < 10 ? earlier : before) - pole * y);
    earlier = before;
    before = u;
  }
  return log;
}

double straight(double u) { return u; }

Identified studied(const Log& log) {
  esokit::IdentifyOptions options;
  options.orders = {1};
  options.averaged = 1;
  return esokit::study(log, options).value();
}

TEST(GainBySize, TellsAnActuatorThatIsNotLinear) {
  const auto linear = studied(machine(straight));
  EXPECT_FALSE(linear.by_size.differ());
  EXPECT_NEAR(linear.by_size.knot, 0.5, 0.1);
  for (const auto& part : {linear.by_size.below, linear.by_size.above}) {
    EXPECT_LT(std::abs(part.value - b0), part.half_width);
    EXPECT_LT(part.share(), 0.1);
  }
  EXPECT_LT(std::abs(linear.input_gain.value - b0), linear.input_gain.half_width);

  const auto saturated = studied(machine([](double u) { return std::clamp(u, -0.5, 0.5); }));
  EXPECT_TRUE(saturated.by_size.differ());
  EXPECT_NEAR(saturated.by_size.below.value, b0, 0.1 * b0);
  EXPECT_NEAR(saturated.by_size.above.value, 0, 0.15 * b0);

  const auto square = studied(machine([](double u) { return u * std::abs(u); }));
  EXPECT_TRUE(square.by_size.differ());
  EXPECT_NEAR(square.by_size.below.value / b0, 0.5, 0.2);
  EXPECT_NEAR(square.by_size.above.value / b0, 1.5, 0.3);

  // Of two levels there is nothing to tell.
  for (const double low : {-1.0, 0.0}) {
    Log log = machine([&](double u) { return u > 0 ? 1 : low; });
    for (double& u : log.u) u = u > 0 ? 1 : low;
    EXPECT_EQ(studied(log).by_size.knot, 0) << low;
  }
}

TEST(GainBySize, DiffersByAQuarterAndByMoreThanTheIntervals) {
  GainBySize found{1, {4, 0.5}, {2.9, 0.59}};
  EXPECT_TRUE(found.differ());
  found.above.half_width = 0.61;
  EXPECT_FALSE(found.differ());
  found.below.half_width = found.above.half_width = 0.01;
  found.above.value = 3.01;
  EXPECT_FALSE(found.differ());
  found.above.value = 2.99;
  EXPECT_TRUE(found.differ());
  found = {1, {-2.99, 0.01}, {-4, 0.01}};
  EXPECT_TRUE(found.differ());
  found.knot = 0;
  EXPECT_FALSE(found.differ());
  found = {1, {4, std::numeric_limits<double>::quiet_NaN()}, {1, 0}};
  EXPECT_FALSE(found.differ());
}

// y'' = b0 u - friction, which holds at standstill; steps of u, half of them below friction.
TEST(GainInMotion, TellsFrictionThatHolds) {
  const auto sticks = [](double friction, bool known = true) {
    esokit::sim::Gaussian gaussian(7);
    Log log;
    log.sample_time = T;
    double y = 0, v = 0, u = 0;
    constexpr double h = T / 20;
    for (int k = 0; k < 3000; ++k) {
      if (k % 50 == 0) u = 1.5 * gaussian.next() - 0.05 * y;
      log.u.push_back(u);
      log.y.push_back(y + 1e-4 * gaussian.next());
      for (int i = 0; i < 20; ++i) {
        const double force = b0 * u - pole * v;
        if (v == 0 && std::abs(force) <= friction) continue;
        const double next = v + h * (force - std::copysign(friction, v != 0 ? v : force));
        v = friction > 0 && v * next < 0 ? 0 : next;
        y += h * v;
      }
    }
    esokit::IdentifyOptions options;
    options.orders = {2};
    options.averaged = 1;
    options.friction = known;
    return esokit::study(log, options).value();
  };
  const auto smooth = sticks(0);
  EXPECT_EQ(smooth.held, 0);
  EXPECT_GT(smooth.in_motion.still, 0.005);
  EXPECT_FALSE(smooth.in_motion.differ());
  EXPECT_NEAR(smooth.in_motion.moving.value, b0, 0.03 * b0);
  // Without u at standstill b0 is that of the motion, and nothing is left to differ.
  const auto without = sticks(25);
  EXPECT_GT(without.held, 0.3);
  EXPECT_EQ(without.in_motion.still, 0);
  EXPECT_NEAR(without.input_gain.value, b0, 0.1 * b0);
  EXPECT_GT(without.input_gain.half_width, 0.1 * b0);
  EXPECT_NEAR(without.friction.value, 25, 5);
  // As it was without friction in the model.
  const auto held = sticks(25, false);
  EXPECT_EQ(held.held, 0);
  EXPECT_NEAR(without.latency.value, held.latency.value, 0.05 * T);  // of all rows
  EXPECT_GT(held.in_motion.still, 0.3);
  EXPECT_TRUE(held.in_motion.differ());
  EXPECT_LT(std::abs(held.in_motion.at_rest.value), 0.7 * b0);
  EXPECT_NEAR(held.in_motion.moving.value, b0, 0.2 * b0);
  // The interval reaches to the end of that of the motion.
  const auto& moving = held.in_motion.moving;
  EXPECT_GE(held.input_gain.half_width,
            std::max(moving.high() - held.input_gain.value, 0.0) * (1 - 1e-12));
}

// A servo on a few steps, seen by an encoder: where it stands depends on y, and so does the
// friction that holds it there. It is no spring.
TEST(GainInMotion, FrictionThatHoldsIsNoForceByPosition) {
  esokit::sim::Gaussian gaussian(7);
  Log log;
  log.sample_time = 0.01;
  double y = 0, v = 0, r = 0;
  for (int k = 0; k < 1500; ++k) {
    if (k % 150 == 0) r = 4 * gaussian.next();
    log.y.push_back(0.05 * std::round(y / 0.05));
    log.u.push_back(0.3 * (r - log.y.back()) - 0.03 * v);
    for (int i = 0; i < 20; ++i) {
      const double force = 50 * log.u.back() - 2 * v;
      if (v == 0 && std::abs(force) <= 12) continue;
      const double next = v + 5e-4 * (force - std::copysign(12, v != 0 ? v : force));
      v = v * next < 0 ? 0 : next;
      y += 5e-4 * v;
    }
  }
  esokit::IdentifyOptions options;
  options.orders = {2};
  options.averaged = 1;
  const auto found = esokit::study(log, options).value();
  EXPECT_FALSE(found.position);
  EXPECT_TRUE(esokit::judge(found, log, options));
  EXPECT_NEAR(found.input_gain.value, 50, found.input_gain.half_width);
}

TEST(GainInMotion, DiffersIfStandstillIsSmaller) {
  esokit::GainInMotion found{0.1, {-4, 0.5}, {-2.9, 0.59}, -3.6};
  EXPECT_TRUE(found.differ());
  found.all = -3.65;  // a tenth matters
  EXPECT_FALSE(found.differ());
  found.all = -4.5;
  EXPECT_TRUE(found.differ());
  found.still = 0;
  EXPECT_FALSE(found.differ());
  found = {0.1, {-2.9, 0.59}, {-4, 0.5}, -3.6};
  EXPECT_FALSE(found.differ());
  found = {0.1, {-4, 0.5}, {-2.9, 0.61}, -3.6};
  EXPECT_FALSE(found.differ());
}

TEST(Lead, TellsThatUIsLate) {
  const Log causal = machine(straight);
  EXPECT_EQ(studied(causal).lead.time, 0);
  for (const std::size_t rows : {3u, 7u}) {
    Log late = causal;
    late.y.erase(late.y.begin(), late.y.begin() + static_cast<std::ptrdiff_t>(rows));
    late.u.resize(late.y.size());
    const auto found = studied(late);
    EXPECT_NEAR(found.lead.time, (static_cast<double>(rows) - 1.5) * T, 0.3 * T);
    EXPECT_NEAR(found.lead.input_gain, b0, 0.03 * b0);
  }
}

// A fit that is bad for another reason is no lead, nor is a lead that explains little.
TEST(Lead, MustBeOneAndHelp) {
  esokit::FitData data;
  const auto lead_from = [&](const Log& log, double latency) {
    data.sample_time = T;
    data.u = log.u;
    data.y = log.y;
    const esokit::FitModel model{1, 1, true};
    const auto bounds = esokit::detail::fit_bounds(data, false);
    esokit::InnovationsFit fit(data, model, bounds);
    const esokit::Fit here = fit.at(fit.inside({20, latency, 0.3, pole}));
    return esokit::detail::lead_of(data, model, bounds, here).time;
  };
  const Log causal = machine(straight);
  EXPECT_EQ(lead_from(causal, 20 * T), 0);
  Log late = causal;
  late.y.erase(late.y.begin(), late.y.begin() + 3);
  late.u.resize(late.y.size());
  EXPECT_NEAR(lead_from(late, 0), 1.5 * T, 0.3 * T);
  esokit::sim::Gaussian gaussian(5);
  for (double& y : late.y) y += 0.1 * gaussian.next();
  EXPECT_EQ(lead_from(late, 0), 0);
}

TEST(AtOnce, TellsAnAcceleration) {
  Log log = machine(straight);
  EXPECT_FALSE(studied(log).at_once);
  esokit::sim::Gaussian gaussian(3);
  for (std::size_t k = log.y.size(); k-- > 0;)
    log.y[k] = 5 + 2 * log.u[k > 0 ? k - 1 : 0] + 0.02 * gaussian.next();
  const auto found = studied(log);
  EXPECT_TRUE(found.at_once);
  const auto refused = esokit::judge(found, log);
  ASSERT_FALSE(refused);
  EXPECT_STREQ(refused.error().field, "at_once");

  // Of three steps nothing is said.
  esokit::FitData data;
  data.sample_time = T;
  const auto steps = [&](int changes) {
    data.u.clear(), data.y.clear();
    for (int k = 0; k < 600; ++k) {
      data.u.push_back(std::min(k / 100, changes) % 2);
      data.y.push_back(k > 0 ? data.u[static_cast<std::size_t>(k) - 1] : 0);
    }
    return esokit::detail::at_once(data);
  };
  EXPECT_FALSE(steps(3));
  EXPECT_TRUE(steps(4));
  // Nor of y that is its own, or that u explains by half.
  steps(5);
  for (double& y : data.y) y += gaussian.next();
  EXPECT_FALSE(esokit::detail::at_once(data));
}

}  // namespace identify_input_checks_test
