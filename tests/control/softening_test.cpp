// The law that softens at the limits: its formula, loops that come back because of it, and loops
// that do not notice it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <support/refusal.hpp>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_softening_test {

using esokit::EigenMatrix;
using esokit::Limits;
using esokit::LinearEso;
using esokit::TimeDomain;

constexpr double period = 1e-3;

template <class Controller>
typename Controller::Config settings(double observer, double law, double b0) {
  using S = typename Controller::scalar_type;
  typename Controller::Config config{};
  fill_settings<S>(config.observer, observer, period, b0);
  config.controller_bandwidth = static_cast<S>(law);
  config.limits.lower = S(-1);
  config.limits.upper = S(2);
  return config;
}

// ---- the law

/// Literally: the observer with the applied u, the formula for the gains, and what changes s.
template <int n>
struct Literal {
  LinearEso<n> observer;
  esokit::Array<double, n> k;
  double b0;
  double omega = std::pow(k[0], 1.0 / n);
  double slow = 1;
  double applied = 0;

  double asked(double y, const esokit::Array<double, n + 1>& r) {
    observer.update(y, applied);
    const auto z = observer.estimate();
    const double s = 1 / slow;
    constexpr double choose[4][4] = {{}, {1}, {1, 2}, {1, 3, 3}};
    double v = r[n] - z(n);
    for (int i = 0; i < n; ++i) {
      const double damped = 0.9 * choose[n][i] * std::pow(omega, n - i);
      const double c = i == 0 ? k[0] : std::max(k[static_cast<std::size_t>(i)], damped);
      const double at_one = k[static_cast<std::size_t>(i)];
      const double gain =
          (at_one + std::min(1.0, (1 - s) / 0.3) * (c - at_one)) * std::pow(s, n - i);
      v += gain * (r[static_cast<std::size_t>(i)] - z(i));
    }
    const double u = v / b0;
    // Limits -1 and 2.
    const bool beyond = std::abs(u - 0.5) > 1.1 * 1.5;
    slow = std::clamp(slow + (beyond ? 1 : -0.1) * omega * period, 1.0, 200.0);
    applied = std::clamp(u, -1.0, 2.0);
    return u;
  }
};

template <int n>
void follows_the_formula(double b0, const esokit::Array<double, n>& gains) {
  using Controller = Adrc<LinearEso<n>>;
  auto config = settings<Controller>(80, 0, b0);
  config.gains = gains;
  config.soften = true;
  auto controller = Controller::make(config).value();
  Literal<n> literal{LinearEso<n>::make(config.observer).value(), gains, b0};
  Random random(static_cast<unsigned>(n));
  double least = 1;
  int back = 0;
  for (int k = 0; k < 24000; ++k) {
    // Overload, then rest.
    const bool rests = k % 12000 > 30;
    const double y = rests ? 0 : random.uniform(-1, 1);
    const double r = rests ? 0 : random.uniform(-1, 1);
    double u = 0;
    esokit::Array<double, n + 1> reference{r};
    if (k % 2 == 0) {
      u = controller.update(y, r);
    } else {
      reference[n] = r / 2;
      esokit::Vector<double, n + 1> given = esokit::Vector<double, n + 1>::Zero();
      given(0) = r;
      given(n) = r / 2;
      u = controller.update(y, given);
    }
    const double asked = literal.asked(y, reference);
    ASSERT_NEAR(controller.requested(), asked, 1e-7 * (1 + std::abs(asked))) << k;
    ASSERT_NEAR(u, literal.applied, 1e-7);
    ASSERT_NEAR(controller.softness() * literal.slow, 1, 1e-9) << k;
    least = std::min(least, controller.softness());
    if (controller.softness() == 1) ++back;
  }
  EXPECT_LT(least, 0.65);
  EXPECT_GT(back, 100);
}

TEST(Softening, IsTheFormula) {
  follows_the_formula<1>(2, {40});
  follows_the_formula<2>(-2, {900, 20});
  follows_the_formula<2>(2, {900, 90});
  follows_the_formula<3>(2, {27e3, 900, 200});
  follows_the_formula<3>(-2, {27e3, 4000, 60});
}

/// An overload is more than 1.1 of half the range on either side; s goes down to 1/200 and no
/// further.
TEST(Softening, BothSidesOfAnOverloadAndOfTheSlowest) {
  const auto law = esokit::AdrcLaw<1>::make({.gains = {{40.0}}, .input_gain = 2}).value();
  const Limits<double> limits{.lower = -1, .upper = 2};
  const auto limiter = esokit::Limiter<double>::make(limits, period).value();
  const double beyond = 0.05 * (2.0 - -1.0);
  for (const double side : {1.0, -1.0}) {
    const double edge = side > 0 ? 2 + beyond : -1 - beyond;
    auto soft = esokit::Softening<1>::make(law, limits, true).value();
    soft.judge(edge, limiter, period);
    EXPECT_EQ(soft.slowness(), 1);
    soft.judge(std::nextafter(edge, 9 * side), limiter, period);
    EXPECT_NEAR(soft.slowness(), 1.04, 1e-15);
    for (int k = 0; k < 4974; ++k) soft.judge(9 * side, limiter, period);
    EXPECT_NEAR(soft.slowness(), 200, 1e-9);
    for (int k = 0; k < 9; ++k) soft.judge(9 * side, limiter, period);
    EXPECT_EQ(soft.slowness(), 200);
  }
}

TEST(Softening, ErrorBasedEqualsOutputBasedForAConstantReference) {
  using Output = Adrc<LinearEso<3>>;
  auto output = Output::make(settings<Output>(80, 20, -2)).value();
  using Error = Adrc<LinearEso<3>, ErrorBased>;
  auto error = Error::make(settings<Error>(80, 20, -2)).value();
  ChainPlant plant(3, period, -2, 0.5);
  output.start(0, 0.25);
  error.start(0, 0.25, 3);
  double least = 1;
  for (int k = 0; k < 3000; ++k) {
    const double u = output.update(plant.output(), 3);
    ASSERT_NEAR(error.update(plant.output(), 3), u, 1e-6) << k;
    ASSERT_NEAR(error.softness(), output.softness(), 1e-9);
    least = std::min(least, output.softness());
    plant.step(u);
  }
  EXPECT_LT(least, 0.5);
}

// ---- on and off

TEST(Softening, IsOnForThirdOrderWithinLimitsAndElseIfWanted) {
  const auto softens = [](auto controller) {
    for (int k = 0; k < 10; ++k) controller.update(0, 1e6);
    return controller.softness() < 1;
  };
  using Third = Adrc<LinearEso<3>>;
  using Second = Adrc<LinearEso<2>>;
  auto third = settings<Third>(80, 20, 2);
  EXPECT_TRUE(softens(Third::make(third).value()));
  third.soften = false;
  EXPECT_FALSE(softens(Third::make(third).value()));
  third.soften.reset();
  third.limits.upper = Limits<double>{}.upper;
  EXPECT_FALSE(softens(Third::make(third).value()));
  third.limits = {};
  EXPECT_FALSE(softens(Third::make(third).value()));
  auto second = settings<Second>(80, 20, 2);
  EXPECT_FALSE(softens(Second::make(second).value()));
  second.soften = true;
  EXPECT_TRUE(softens(Second::make(second).value()));
}

TEST(Softening, NeedsARangeAndAPositiveGain) {
  using Second = Adrc<LinearEso<2>>;
  auto config = settings<Second>(80, 20, 2);
  config.soften = true;
  config.limits.upper = Limits<double>{}.upper;
  EXPECT_EQ(refusal(Second::make(config)), "soften: needs limits.lower and limits.upper");
  config.limits = {.upper = 1};
  EXPECT_EQ(refusal(Second::make(config)), "soften: needs limits.lower and limits.upper");
  config = settings<Second>(80, 0, 2);
  config.soften = true;
  config.gains = {0.0, 5.0};
  EXPECT_EQ(refusal(Second::make(config)), "gains[0]: must be positive for soften");
  config.gains = {-1.0, 5.0};
  EXPECT_EQ(refusal(Second::make(config)), "gains[0]: must be positive for soften");
  config.gains = {1e-9, 5.0};
  EXPECT_EQ(refusal(Second::make(config)), "accepted");
  // Left out it does not stand in the way of what was allowed before.
  using Third = Adrc<LinearEso<3>>;
  auto third = settings<Third>(80, 0, 2);
  third.gains = {0.0, 5.0, 5.0};
  EXPECT_EQ(refusal(Third::make(third)), "accepted");
  using Float = Adrc<LinearEso<3, float>>;
  auto large = settings<Float>(80, 0, 1);
  large.gains = {1e38f, 0.0f, 0.0f};
  EXPECT_EQ(refusal(Float::make(large)), "accepted");
}

/// Bit for bit as long as the law asks for what u can give.
TEST(Softening, DoesNothingWithinTheLimits) {
  using Third = Adrc<LinearEso<3>>;
  auto config = settings<Third>(80, 20, 2);
  config.limits.lower = -1e7;
  config.limits.upper = 1e7;
  auto with = Third::make(config).value();
  config.soften = false;
  auto without = Third::make(config).value();
  Random random(5);
  for (int k = 0; k < 2000; ++k) {
    const double y = random.uniform(-1, 1);
    const double r = random.uniform(-1, 1);
    if (k % 100 == 50) {
      ASSERT_EQ(with.update_without_measurement(r), without.update_without_measurement(r));
    } else if (k % 100 == 60) {
      ASSERT_EQ(with.update(y, {r, y, 0.5}), without.update(y, {r, y, 0.5}));
    } else {
      ASSERT_EQ(with.update(y, r), without.update(y, r));
    }
    ASSERT_EQ(with.status(), without.status());
  }
  EXPECT_EQ(with.softness(), 1);
}

// ---- loops

/// A chain behind a lag and a dead time, with a load.
class Machine {
 public:
  Machine(int order, double b0, double lag, int dead)
      : x_(static_cast<std::size_t>(order)),
        b0_(b0),
        keep_(std::exp(-period / lag)),
        line_(static_cast<std::size_t>(dead), 0.0) {}

  void step(double u, double load) {
    line_.push_back(u);
    const double mean = lagged_ + 0.5 * (1 - keep_) * (line_.front() - lagged_);
    lagged_ = keep_ * lagged_ + (1 - keep_) * line_.front();
    line_.pop_front();
    double highest = b0_ * mean + load;
    for (std::size_t i = x_.size(); i-- > 0;) {
      const double before = x_[i];
      x_[i] += period * highest;
      highest = 0.5 * (before + x_[i]);
    }
  }
  [[nodiscard]] double output() const { return x_[0]; }

 private:
  std::vector<double> x_;
  double b0_;
  double keep_;
  double lagged_ = 0;
  std::deque<double> line_;
};

struct Loop {
  double b0, lag;
  int dead;
  double observer;
  esokit::Array<double, 3> gains;
  double omega;
  [[nodiscard]] double latency() const { return lag + (dead + 1.0) * period; }
};

Loop drawn(Random& random, int order) {
  Loop loop{};
  loop.b0 = random.index(2) == 0 ? 3 : -3;
  loop.lag = random.log_uniform(2, 12) * period;
  loop.dead = static_cast<int>(random.index(5));
  loop.omega = random.uniform(0.1, 0.35) / loop.latency();
  loop.observer = loop.omega * random.log_uniform(0.8, 8);
  if (order == 3) {
    const double damped = random.uniform(0.6, 1.2);
    loop.gains = {std::pow(loop.omega, 3), damped * 3 * std::pow(loop.omega, 2),
                  damped * 3 * loop.omega};
  } else {
    loop.gains = {std::pow(loop.omega, 2), random.log_uniform(0.1, 2) * loop.omega, 0};
  }
  return loop;
}

struct Played {
  double peak = 0;
  double late = 0;  ///< largest error in the last tenth
  double least = 1;
};

/// A load of `share` of half the range for `latencies`, then time to come back.
template <int order, class S>
Played play(const Loop& loop, bool soften, double share, double latencies, double horizon) {
  using Controller = Adrc<LinearEso<order, S>>;
  typename Controller::Config config{};
  fill_settings<S>(config.observer, loop.observer, period, loop.b0);
  config.gains.emplace();
  for (int i = 0; i < order; ++i) {
    (*config.gains)[static_cast<std::size_t>(i)] =
        static_cast<S>(loop.gains[static_cast<std::size_t>(i)]);
  }
  config.limits = {.lower = S(-1), .upper = S(1)};
  config.soften = soften;
  auto controller = Controller::make(config).value();
  Machine machine(order, loop.b0, loop.lag, loop.dead);
  const int pulse = static_cast<int>(latencies * loop.latency() / period);
  const int samples = pulse + static_cast<int>(horizon / loop.omega / period);
  Played played;
  for (int k = 0; k < samples; ++k) {
    const auto y = static_cast<S>(machine.output());
    const double u = static_cast<double>(controller.update(y, S(0)));
    machine.step(u, k < pulse ? share * std::abs(loop.b0) : 0);
    const double error = std::abs(machine.output());
    if (!(error < 1e30)) return {1e30, 1e30, played.least};
    played.peak = std::max(played.peak, error);
    if (10 * k > 9 * samples) played.late = std::max(played.late, error);
    played.least = std::min(played.least, static_cast<double>(controller.softness()));
  }
  return played;
}

bool back(const Played& played) { return played.late < 0.02 * played.peak; }

/// Loops that come back from a light load: after an overload each comes back, also those that lock
/// up with the law as designed.
template <int order, class S>
void comes_back(unsigned seed, int draws, double share, double latencies, int least_locked,
                int least_sound) {
  Random random(seed);
  int locked = 0;
  int sound = 0;
  for (int i = 0; i < draws; ++i) {
    const Loop loop = drawn(random, order);
    if (!back(play<order, S>(loop, false, 0.01, 3, 200))) continue;
    ++(back(play<order, S>(loop, false, share, latencies, 400)) ? sound : locked);
    const Played with = play<order, S>(loop, true, share, latencies, 400);
    EXPECT_TRUE(back(with)) << i << " peak " << with.peak << " late " << with.late << " least "
                            << with.least;
  }
  EXPECT_GE(locked, least_locked);
  EXPECT_GE(sound, least_sound);
}

TEST(Softening, BringsBackLoopsThatLockUpAndSpoilsNone) {
  comes_back<3, double>(1, 40 / stride, 0.95, 60, 10 / stride, 0);
  comes_back<3, float>(2, 20 / stride, 0.95, 60, 5 / stride, 0);
  comes_back<3, double>(4, 40 / stride, 0.9, 10, 0, 10 / stride);
  comes_back<2, double>(3, 60 / stride, 0.95, 60, 2 / stride, 20 / stride);
}

/// Whatever came before, garbage included: once the loop is well, the law returns to the one
/// designed. Played with the plant wherever the garbage has driven it, within reason.
template <class Controller>
void finds_out(unsigned seed, double omega_T, int cases) {
  using S = typename Controller::scalar_type;
  constexpr int n = Controller::order;
  const double omega = omega_T / period;
  for (int i = 0; i < cases; ++i) {
    Random random(seed + static_cast<unsigned>(i));
    auto config = settings<Controller>(4 * omega, omega, i % 2 == 0 ? 2 : -2);
    config.soften = true;
    auto controller = Controller::make(config).value();
    const int samples = static_cast<int>(random.log_uniform(10, 400 / omega_T));
    const double kind = random.uniform(0, 1);
    S held = anything<S>(random);
    for (int k = 0; k < samples; ++k) {
      const S y = random.uniform(0, 1) < kind ? anything<S>(random) : S(0);
      if (random.index(10) == 0) held = anything<S>(random);
      switch (random.index(12)) {
        case 0:
          controller.update_without_measurement(held);
          break;
        case 1:
          controller.applied(anything<S>(random));
          controller.update(y, held);
          break;
        default:
          controller.update(y, held);
      }
      ASSERT_GE(controller.softness(), S(0.00499));
      ASSERT_LE(controller.softness(), S(1));
    }
    ChainPlant plant(n, period, i % 2 == 0 ? 2 : -2, random.uniform(-0.5, 0.5));
    // The wrong estimate drives the plant away, which softens the law further.
    double slowest = 1;
    double recovery = 0;
    for (int k = 0; k < recovery + 2000; ++k) {
      plant.step(static_cast<double>(controller.update(static_cast<S>(plant.output()), S(0))));
      slowest = std::max(slowest, 1 / static_cast<double>(controller.softness()));
      recovery = 2 * (slowest - 1) / (0.1 * omega_T);
    }
    EXPECT_EQ(controller.softness(), S(1)) << i << ", up to " << slowest;
    EXPECT_LT(std::abs(plant.output()), 1e-3) << i;
  }
}

TEST(Softening, NoGarbageLeavesItSoft) {
  finds_out<Adrc<LinearEso<3>>>(1, 0.05, 12 / stride);
  finds_out<Adrc<LinearEso<3, float>>>(100, 0.05, 12 / stride);
  finds_out<Adrc<LinearEso<2>>>(200, 0.05, 12 / stride);
  finds_out<Adrc<LinearEso<1, float>, ErrorBased>>(300, 0.05, 12 / stride);
}

/// 0.1 omega T is less than a digit of 1 / s.
TEST(Softening, RecoversInFloatAtASmallOmegaT) {
  using Controller = Adrc<LinearEso<3, float>>;
  auto controller = Controller::make(settings<Controller>(0.1, 0.02, 2)).value();
  for (int k = 0; k < 20000; ++k) controller.update(0, 1e30f);
  const float soft = controller.softness();
  ASSERT_LT(soft, 0.75f);
  for (int k = 0; k < 20000; ++k) controller.update(0, 0);
  // 1 / s shrinks by 0.1 times 0.4, in steps of at least 8 digits, each rounded by half of one.
  EXPECT_NEAR(1 / controller.softness(), 1 / soft - 0.04f, 0.04f / 16);
}

// ---- the rest of a controller's life

TEST(Softening, StartAndTrackReturnToTheLawAsDesigned) {
  using Controller = Adrc<LinearEso<3>>;
  auto soft = Controller::make(settings<Controller>(80, 20, 2)).value();
  for (int k = 0; k < 50; ++k) soft.update(0, 1e6);
  ASSERT_LT(soft.softness(), 0.6);
  auto tracked = soft;
  tracked.track(0, 0, 0.5);
  EXPECT_EQ(tracked.softness(), 1);
  auto refused = soft;
  refused.start(hidden_nan<double>(), 0);
  EXPECT_EQ(refused.softness(), soft.softness());
  auto started = soft;
  started.start(0.2, 0.5);
  EXPECT_EQ(started.softness(), 1);
  EXPECT_NEAR(started.update(0.2, 0.2), 0.5, 1e-9);
}

TEST(Softening, IsRetunedAsTheRest) {
  using Controller = Adrc<LinearEso<3>>;
  const auto config = settings<Controller>(80, 20, 2);
  auto soft = Controller::make(config).value();
  for (int k = 0; k < 50; ++k) soft.update(0, 1e6);
  const double before = soft.softness();
  ASSERT_LT(before, 0.6);
  auto off = config;
  off.soften = false;
  auto other = config;
  other.controller_bandwidth = 30;
  auto changed = soft;
  ASSERT_TRUE(changed.retune(other));
  EXPECT_EQ(changed.softness(), before);
  // From now on in the steps of the new omega.
  changed.update(0, 1e6);
  EXPECT_NEAR(1 / changed.softness(), 1 / before + 30 * period, 1e-12);
  auto adopted = soft;
  ASSERT_TRUE(adopted.adopt(Controller::make(other).value()));
  adopted.update(0, 1e6);
  EXPECT_EQ(adopted.requested(), changed.requested());
  ASSERT_TRUE(changed.retune(off));
  EXPECT_EQ(changed.softness(), 1);
  for (int k = 0; k < 50; ++k) changed.update(0, 1e6);
  EXPECT_EQ(changed.softness(), 1);
  ASSERT_TRUE(changed.retune(config));
  for (int k = 0; k < 50; ++k) changed.update(0, 1e6);
  EXPECT_LT(changed.softness(), 0.6);
  auto turned_on = Controller::make(off).value();
  ASSERT_TRUE(turned_on.retune(config));
  for (int k = 0; k < 50; ++k) turned_on.update(0, 1e6);
  EXPECT_LT(turned_on.softness(), 0.6);
  other.soften = true;
  other.limits = {};
  EXPECT_EQ(refusal(changed.retune(other)), "soften: needs limits.lower and limits.upper");
}

TEST(Softening, SurvivesASnapshot) {
  using Controller = Adrc<LinearEso<3, float>>;
  auto soft = Controller::make(settings<Controller>(80, 20, -2)).value();
  for (int k = 0; k < 50; ++k) soft.update(0, 1e6f);
  auto again = esokit::from_snapshot<Controller>(esokit::snapshot(soft)).value();
  for (int k = 0; k < 50; ++k) ASSERT_EQ(again.update(0, 0.1f), soft.update(0, 0.1f));
  EXPECT_LT(soft.softness(), 1.0f);
  EXPECT_EQ(again.softness(), soft.softness());
}

/// omega T with the present T, and the gains of the present step where they follow it.
TEST(Softening, FollowsTheStepTime) {
  using Controller = Adrc<esokit::VariableTime<LinearEso<3>>>;
  for (const auto domain : {TimeDomain::continuous, TimeDomain::sampled}) {
    auto config = settings<Controller>(80, 20, 2);
    config.observer.ratio = 4;
    config.domain = domain;
    auto controller = Controller::make(config).value();
    Random random(7);
    for (int k = 0; k < 40; ++k) {
      const double before = 1 / controller.softness();
      const double seconds = period * random.uniform(0.5, 3);
      ASSERT_TRUE(controller.set_step_time(seconds));
      controller.update(0, 1e9);
      const double omega = std::cbrt(controller.gains()[0]);
      ASSERT_NEAR(1 / controller.softness(), before + omega * seconds, 1e-12);
    }
    const auto z = controller.observer().estimate();
    const double s = controller.softness();
    ASSERT_LT(s, 0.7);
    ASSERT_TRUE(controller.set_step_time(period));
    controller.update_without_measurement(0);
    const auto k = controller.gains();
    const auto now = controller.observer().estimate();
    const double omega = std::cbrt(k[0]);
    const double v = -k[0] * s * s * s * now(0) -
                     std::max(k[1], 0.9 * 3 * omega * omega) * s * s * now(1) -
                     std::max(k[2], 0.9 * 3 * omega) * s * now(2) - now(3);
    EXPECT_NEAR(controller.requested(), v / 2, 1e-9 * (1 + std::abs(v)));
    EXPECT_NE(z(3), now(3) + 1);
  }
}

/// What counts is the u that goes out, with the b0 of the sample.
TEST(Softening, TakesTheInputGainOfTheSample) {
  using Controller = Adrc<esokit::Guarded<LinearEso<3>>>;
  auto config = settings<Controller>(80, 20, -2);
  config.observer.disturbance_bound = 1e6;
  auto weak = Controller::make(config).value();
  auto strong = weak;
  ASSERT_TRUE(weak.set_input_gain(-0.02));
  // v is 0.8, u at b0 -2 is -0.4, at -0.02 it is -40.
  strong.update(0, 1e-4);
  weak.update(0, 1e-4);
  EXPECT_NEAR(strong.requested(), -0.4, 1e-9);
  EXPECT_NEAR(weak.requested(), -40, 1e-7);
  EXPECT_EQ(strong.softness(), 1);
  EXPECT_LT(weak.softness(), 1);
  const double s = weak.softness();
  weak.update_without_measurement(1e-4);
  const auto z = weak.observer().estimate();
  EXPECT_GT(std::abs(weak.requested()), 20);
  EXPECT_LT(weak.softness(), s);
  EXPECT_TRUE(esokit::is_finite(z(0)));
}

TEST(Softening, TheAnalysisIsOfTheLawAsDesigned) {
  using Controller = Adrc<LinearEso<3>>;
  auto config = settings<Controller>(80, 20, 2);
  auto soft = Controller::make(config).value();
  for (int k = 0; k < 50; ++k) soft.update(0, 1e6);
  ASSERT_LT(soft.softness(), 0.6);
  config.soften = false;
  const auto form = esokit::linear_controller(soft).value();
  const auto designed = esokit::linear_controller(Controller::make(config).value()).value();
  for (int i = 0; i < form.states(); ++i) EXPECT_EQ(form.to_u(0, i), designed.to_u(0, i));
  EXPECT_EQ(form.r_to_u(0, 0), designed.r_to_u(0, 0));
}

}  // namespace control_softening_test
}  // namespace esokit_test
