// Margins against brute force: a loop assembled anew from the equations, whose poles must reach the
// edge with the computed gain, phase or delay, and must not before.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>
#include <esokit/sim/held_plant.hpp>

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdio>
#include <esokit/adapter/guarded.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/analysis/worst_case.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <functional>
#include <limits>
#include <numbers>
#include <support/refusal.hpp>
#include <vector>

#include "support/exponential.hpp"
#include "support/numbers.hpp"
#include "support/reference_observer.hpp"

namespace analysis_margins_test {

using namespace esokit;
using Complex = std::complex<double>;
using esokit_test::exponential;
using esokit_test::Random;
using esokit_test::ReferenceObserver;
using esokit_test::refusal;

/// Effect of u = 1 held for t.
Eigen::VectorXd held(const Eigen::MatrixXd& a, const Eigen::VectorXd& b, double t) {
  const auto n = a.rows();
  Eigen::MatrixXd stacked = Eigen::MatrixXd::Zero(n + 1, n + 1);
  stacked.topLeftCorner(n, n) = a * t;
  stacked.topRightCorner(n, 1) = b * t;
  return exponential(stacked).topRightCorner(n, 1);
}

/// A sampled loop with a factor (gain and phase) and a delay at the plant's input.
struct BruteLoop {
  Eigen::MatrixXd a;  // plant
  Eigen::VectorXd b;
  Eigen::RowVectorXd c;
  Eigen::MatrixXd f;  // observer: xi[k] = f xi[k-1] + g_y y[k] + g_u u[k-1]
  Eigen::VectorXd g_y, g_u;
  Eigen::RowVectorXd law;  // u = law xi
  double sample_time;

  BruteLoop(const ReferenceObserver& observer, const std::vector<double>& gains, double b0)
      : sample_time(observer.sample_time) {
    const auto m = observer.matrices();
    const auto n = static_cast<Eigen::Index>(observer.states());
    f.resize(n, n);
    g_y.resize(n);
    g_u.resize(n);
    law.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto row = static_cast<std::size_t>(i);
      for (Eigen::Index j = 0; j < n; ++j) {
        f(i, j) = m.f[row][static_cast<std::size_t>(j)];
      }
      g_y(i) = m.y[row];
      g_u(i) = m.u[row];
      double v = m.estimate[gains.size()][row];
      for (std::size_t r = 0; r < gains.size(); ++r) v += gains[r] * m.estimate[r][row];
      law(i) = -v / b0;
    }
  }

  /// Largest abs(z), and all others if asked for.
  [[nodiscard]] double radius(Complex factor, double delay) const {
    const auto whole = static_cast<Eigen::Index>(std::floor(delay / sample_time));
    const double rest = delay - static_cast<double>(whole) * sample_time;
    const Eigen::MatrixXd phi = exponential(a * sample_time);
    const Eigen::VectorXd now = held(a, b, sample_time - rest);
    const Eigen::VectorXd old = exponential(a * (sample_time - rest)).lazyProduct(held(a, b, rest));
    // State: plant, observer, u[k-1] .. u[k-whole-1].
    const auto p = a.rows();
    const auto o = f.rows();
    const auto n = p + o + whole + 1;
    Eigen::MatrixXcd step = Eigen::MatrixXcd::Zero(n, n);
    for (Eigen::Index j = 0; j < n; ++j) {
      const Eigen::VectorXd unit = Eigen::VectorXd::Unit(n, j);
      const Eigen::VectorXd x = unit.head(p);
      const Eigen::VectorXd past = unit.tail(whole + 1);
      const Eigen::VectorXd xi = f.lazyProduct(unit.segment(p, o)) + g_y * c.dot(x) + g_u * past(0);
      const double u = law.dot(xi);
      const double u_now = whole == 0 ? u : past(whole - 1);
      const Complex drive = factor;
      step.col(j).head(p) = phi.lazyProduct(x).cast<Complex>() +
                            drive * (now * u_now + old * past(whole)).cast<Complex>();
      step.col(j).segment(p, o) = xi.cast<Complex>();
      step(p + o, j) = u;
      for (Eigen::Index i = 1; i <= whole; ++i) step(p + o + i, j) = past(i - 1);
    }
    // The library's kernel (dense_test.cpp has it against exact roots): Eigen's solver takes 5 s to
    // compile.
    Eigen::VectorXcd poles(n);
    EXPECT_TRUE(esokit::detail::eigenvalues({step.data(), static_cast<int>(n)}, poles.data()));
    return poles.cwiseAbs().maxCoeff();
  }
};

struct Counts {
  int loops = 0, increases = 0, decreases = 0, phases = 0, delays = 0;
};

/// A plant of `Order` with parallel resonances: y = rigid + sum of modes.
template <int PlantStates, int Order>
LinearPlant<PlantStates> random_plant(Random& random, double speed, double gain) {
  typename LinearPlant<Order>::Chain rigid;
  rigid.input_gain = gain;
  for (std::size_t i = 0; i < Order; ++i) {
    rigid.coefficients[i] =
        random.uniform(-0.2, 2.0) * std::pow(speed, static_cast<double>(Order) - double(i));
  }
  const auto core = LinearPlant<Order>::chain(rigid).value();
  LinearPlant<PlantStates> plant;
  for (int i = 0; i < Order; ++i) {
    for (int j = 0; j < Order; ++j) plant.a(i, j) = core.a(i, j);
    plant.b(i) = core.b(i);
    plant.c(0, i) = core.c(0, i);
  }
  for (int i = Order; i < PlantStates; i += 2) {
    const double w = speed * random.log_uniform(2.0, 60.0);
    plant.a(i, i + 1) = 1.0;
    plant.a(i + 1, i) = -w * w;
    plant.a(i + 1, i + 1) = -2.0 * random.log_uniform(2e-3, 0.3) * w;
    plant.b(i + 1) = gain * random.uniform(-0.5, 1.0) * std::pow(speed, 2 - Order);
    plant.c(0, i) = 1.0;
  }
  return plant;
}

template <int States>
void take(BruteLoop& brute, const LinearPlant<States>& plant) {
  brute.a = eigen(plant.a);
  brute.b = eigen(plant.b);
  brute.c = eigen(plant.c);
}

template <int Order, int Levels, int PlantStates>
void check_random_loops(int wanted, std::uint64_t seed, Counts& counts) {
  Random random(seed);
  int found = 0;
  for (int trial = 0; trial < 400 && found < wanted; ++trial) {
    const double wc = random.log_uniform(0.5, 20.0);
    const double wo = wc * random.log_uniform(1.5, 15.0);
    const double T = random.log_uniform(0.01, 0.8) / wo;
    const double b0 = random.index(2) == 0 ? 2.0 : -2.0;
    const double b = b0 * random.log_uniform(0.5, 2.0);
    typename CascadeEso<Order, Levels>::Config config;
    config.observer_bandwidth = wo;
    config.bandwidth_factor = Levels > 1 ? 2.0 : 0.0;
    config.input_gain = b0;
    config.sample_time = T;
    const auto controller =
        Adrc<CascadeEso<Order, Levels>>::make({.observer = config, .controller_bandwidth = wc})
            .value();
    const auto plant = random_plant<PlantStates, Order>(random, wc, b);
    const auto loop = closed_loop(plant, controller).value();

    ReferenceObserver reference{Order, 1, {wo}, b0, T};
    for (int i = 1; i < Levels; ++i) reference.bandwidths.push_back(wo * std::pow(2.0, i));
    BruteLoop brute(reference, {controller.gains().begin(), controller.gains().end()}, b0);
    take(brute, plant);
    const double radius = brute.radius(1.0, 0.0);
    // N poles in one place come out spread by eps^(1/N) of their distance from 1.
    EXPECT_NEAR(radius - 1.0, loop.stability_abscissa(), 1e-3 * wo * T);
    const auto all = margins(loop);
    EXPECT_EQ(all.has_value(), loop.stable());
    if (!all) continue;
    ++found;
    ++counts.loops;
    SCOPED_TRACE(testing::Message() << "n " << Order << ", p " << Levels << ", trial " << trial);

    if (all->gain_increase.limited()) {
      ++counts.increases;
      const double g = all->gain_increase.value;
      EXPECT_NEAR(brute.radius(g, 0.0), 1.0, 1e-6);
      for (int i = 0; i < 12; ++i) {
        EXPECT_LT(brute.radius(1.0 + 0.99 * (g - 1.0) * i / 11, 0.0), 1.0);
      }
    }
    if (all->gain_decrease.limited()) {
      ++counts.decreases;
      const double g = all->gain_decrease.value;
      EXPECT_NEAR(brute.radius(g, 0.0), 1.0, 1e-6);
      for (int i = 0; i < 12; ++i) {
        EXPECT_LT(brute.radius(1.0 - 0.99 * (1.0 - g) * i / 11, 0.0), 1.0);
      }
    } else {
      EXPECT_EQ(all->gain_decrease.value, 0.0);
      for (const double g : {0.9, 0.5, 0.1, 1e-2, 1e-3})
        EXPECT_LE(brute.radius(g, 0.0), 1.0 + 1e-9);
    }
    if (all->phase.limited()) {
      ++counts.phases;
      const double shift = all->phase.value;
      EXPECT_NEAR(brute.radius(std::polar(1.0, shift), 0.0), 1.0, 1e-6);
      for (int i = 0; i < 12; ++i) {
        EXPECT_LT(brute.radius(std::polar(1.0, -0.99 * shift * i / 11), 0.0), 1.0);
      }
    }
    ASSERT_TRUE(all->modulus.limited());
    double least = 1e9;
    for (int i = 0; i < 4000; ++i) {
      const double w = std::numbers::pi / T * std::pow(10.0, -5.0 * i / 3999);
      least = std::min(least, std::abs(1.0 + loop.loop_gain(w).value()));
    }
    EXPECT_LE(all->modulus.value, least * (1.0 + 1e-9));
    EXPECT_NEAR(std::abs(loop.sensitivity(all->modulus.frequency).value()) * all->modulus.value,
                1.0, 1e-9);

    const auto delay = delay_margin(loop);
    ASSERT_TRUE(delay.has_value());
    if (delay->value < 60.0 * T) {
      ++counts.delays;
      EXPECT_NEAR(brute.radius(1.0, delay->value), 1.0, 1e-6);
      for (int i = 1; i <= 16; ++i) {
        EXPECT_LT(brute.radius(1.0, 0.99 * delay->value * i / 16), 1.0) << i << " of 16";
      }
    }
  }
  EXPECT_EQ(found, wanted);
}

TEST(Margins, OfRandomLoopsEqualBruteForce) {
  Counts counts;
  check_random_loops<1, 1, 1>(15, 1, counts);
  check_random_loops<2, 2, 2>(15, 3, counts);
  check_random_loops<3, 1, 3>(10, 4, counts);
  check_random_loops<2, 1, 6>(20, 5, counts);  // two resonances: many crossings
  std::printf("%d loops: %d gains up, %d down, %d phases, %d delays\n", counts.loops,
              counts.increases, counts.decreases, counts.phases, counts.delays);
  EXPECT_GT(counts.increases, 45);
  EXPECT_GT(counts.decreases, 10);
  EXPECT_GT(counts.phases, 45);
  EXPECT_GT(counts.delays, 30);
}

auto continuous(double observer_bandwidth, double controller_bandwidth, double b0 = 1.0) {
  return ObserverWithLaw{
      ContinuousLinearEso<1>::make({.observer_bandwidth = observer_bandwidth, .input_gain = b0})
          .value(),
      AdrcLaw<1>::make({.controller_bandwidth = controller_bandwidth, .input_gain = b0}).value()};
}
template <int Order>
auto adrc(double observer_bandwidth, double controller_bandwidth, double b0, double sample_time) {
  return Adrc<LinearEso<Order>>::make({.observer = {.observer_bandwidth = observer_bandwidth,
                                                    .input_gain = b0,
                                                    .sample_time = sample_time},
                                       .controller_bandwidth = controller_bandwidth})
      .value();
}

// Closed loops whose edges are known: s^2 + g (2 s + 1) with a lag has its phase by hand.
TEST(Margins, OfAContinuousLoopByHand) {
  // n = 1, plant y' = u: with k = omega_c the loop is L = (l_1 k + l_2) s + k l_2 over
  // s (s + l_1 + k) s for l = (2 w, w^2).
  const double k = 3.0;
  const double w = 10.0;
  const auto loop = closed_loop(LinearPlant<1>::chain({}).value(), continuous(w, k)).value();
  const auto by_hand = [&](double x) {
    const Complex s(0.0, x);
    const double l1 = 2.0 * w;
    const double l2 = w * w;
    return ((l1 * k + l2) * s + k * l2) / (s * s * (s + l1 + k));
  };
  for (const double x : {0.1, 1.0, 5.0, 30.0, 500.0}) {
    EXPECT_LT(std::abs(loop.loop_gain(x).value() - by_hand(x)), 1e-12 * std::abs(by_hand(x)));
  }
  const auto all = margins(loop).value();
  // Relative degree two: neither gain has an edge.
  EXPECT_FALSE(all.gain_increase.limited());
  EXPECT_FALSE(all.gain_decrease.limited());
  EXPECT_EQ(all.gain_increase.value, std::numeric_limits<double>::infinity());
  EXPECT_EQ(all.gain_decrease.value, 0.0);
  const double crossing = all.phase.frequency;
  EXPECT_NEAR(std::abs(by_hand(crossing)), 1.0, 1e-12);
  EXPECT_NEAR(all.phase.value, std::numbers::pi + std::arg(by_hand(crossing)), 1e-12);
  const auto delay = delay_margin(loop).value();
  EXPECT_NEAR(delay.value * delay.frequency, all.phase.value, 1e-12);
  double least = 1e9;
  for (double x = 0.1; x < 1e3; x *= 1.0001) least = std::min(least, std::abs(1.0 + by_hand(x)));
  EXPECT_NEAR(all.modulus.value, least, 1e-6);
  EXPECT_LE(all.modulus.value, least);
}

// Nothing knows what a second is: a loop that is slower by some factor has the same margins.
TEST(Margins, OfASlowLoopAreThoseOfAFastOne) {
  const auto all = [](double rate) {
    // With a lag, so that the gain has an edge; and one pole far below all others.
    const auto plant =
        LinearPlant<1>::chain({.coefficients = {1e-3 * rate}, .input_gain = 1.3 * rate}).value();
    return margins(plant, continuous(10.0 * rate, 3.0 * rate, rate)).value();
  };
  const Margins of_one = all(1.0);
  for (const double rate : {1e-8, 1e-4, 1e4, 1e8}) {
    const Margins other = all(rate);
    EXPECT_NEAR(other.phase.value, of_one.phase.value, 1e-9) << rate;
    EXPECT_NEAR(other.phase.frequency / rate, of_one.phase.frequency, 1e-9) << rate;
    EXPECT_NEAR(other.modulus.value, of_one.modulus.value, 1e-9) << rate;
    EXPECT_NEAR(other.modulus.frequency / rate, of_one.modulus.frequency, 1e-6) << rate;
  }
}

// Circle criterion of the continuous loop, worked out with numpy: 1.870, 2.094, 2.489 either way
// for n = 2 and omega_o = 2, 4, 8 omega_c; 3.162, 3.654, 4.356 for n = 1.
TEST(Margins, GainThatVariesArbitrarilyFast) {
  const double T = 1e-4;
  const auto factor_of = [&](auto order, double ratio) {
    constexpr int n = decltype(order)::value;
    const auto plant = LinearPlant<n>::chain({.input_gain = 2.0}).value();
    return gain_variation(plant, adrc<n>(ratio, 1.0, 2.0, T)).value().value;
  };
  using One = std::integral_constant<int, 1>;
  using Two = std::integral_constant<int, 2>;
  EXPECT_NEAR(factor_of(One{}, 2.0), 3.162, 2e-3);
  EXPECT_NEAR(factor_of(One{}, 8.0), 4.356, 3e-3);
  EXPECT_NEAR(factor_of(Two{}, 2.0), 1.870, 2e-3);
  EXPECT_NEAR(factor_of(Two{}, 4.0), 2.094, 2e-3);
  EXPECT_NEAR(factor_of(Two{}, 8.0), 2.489, 3e-3);

  // Within it no sequence of gains does harm; with ten times as much one is soon found. The fewer
  // the samples of a loop, the less is left; a lag takes from it, too.
  const auto plant = LinearPlant<2>::chain({.input_gain = 2.0}).value();
  const auto controller = adrc<2>(4.0, 1.0, 2.0, 0.05);
  const double factor = gain_variation(plant, controller).value().value;
  EXPECT_LT(factor, 2.094);
  EXPECT_LT(gain_variation(with_lag(plant, 0.2).value(), controller).value().value, factor);
  // numpy, a lag of 20 ms in the model, guarded, T = 1 ms: the certificate of a b0 that is wrong by
  // a factor that changes as it likes.
  using Lagging = Adrc<Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}>>>;
  const auto motor = with_lag(LinearPlant<1>::chain({.input_gain = 600}).value(), 0.02).value();
  for (const auto& [ratio, wanted] : {std::pair{2.0, 2.391735}, {4.0, 2.749543}, {8.0, 3.425557}}) {
    Lagging::Config config{.controller_bandwidth = 150 / ratio};
    config.observer.observer = {.observer_bandwidth = 150,
                                .input_gain = 600,
                                .sample_time = 1e-3,
                                .model = {.actuator = {0.02}}};
    EXPECT_NEAR(gain_variation(motor, Lagging::make(config).value()).value().value, wanted, 2e-5);
  }
  const auto size_after = [&](double most) {
    double worst = 0.0;
    for (int trial = 0; trial < 200; ++trial) {
      Random random(static_cast<std::uint64_t>(trial));
      auto loop = controller;
      double y = 1.0;
      double speed = 0.0;
      const int length = 1 + random.index(60);
      double gain = 2.0;
      for (int k = 0; k < 4000; ++k) {
        if (k % length == 0) gain = 2.0 * (random.index(2) == 0 ? most : 1.0 / most);
        const double push = gain * loop.update(y, 0.0);
        y += 0.05 * speed + 0.5 * 0.05 * 0.05 * push;
        speed += 0.05 * push;
      }
      worst = std::max(worst, std::abs(y));
    }
    return worst;
  };
  EXPECT_LT(size_after(0.99 * factor), 1e-3);
  EXPECT_GT(size_after(10.0 * factor), 1.0);
  // A loop that is not stable has none.
  const auto wrong = adrc<2>(4.0, 1.0, -2.0, 0.05);
  EXPECT_EQ(refusal(gain_variation(plant, wrong)),
            "stability_abscissa: must be negative: the nominal loop is not stable, it has no "
            "margins");
}

// A gain that may neither rise nor fall: an unstable plant; and any b0 between is stable.
TEST(Margins, RangeOfTheInputGain) {
  const double T = 0.01;
  for (const double sign : {1.0, -1.0}) {
    const auto plant =
        LinearPlant<2>::chain({.coefficients = {-30.0, 0.5}, .input_gain = sign * 4.0}).value();
    const auto range = input_gain_range(plant, adrc<2>(40.0, 8.0, sign * 5.0, T)).value();
    const double weakest = sign > 0.0 ? range.upper : range.lower;
    const double strongest = sign > 0.0 ? range.lower : range.upper;
    EXPECT_LT(range.lower, range.upper);
    EXPECT_GT(sign * strongest, 0.4);
    EXPECT_LT(sign * strongest, 5.0);
    EXPECT_GT(sign * weakest, 5.0);
    EXPECT_LT(sign * weakest, 200.0);
    const auto stable = [&](double b0) {
      return closed_loop(plant, adrc<2>(40.0, 8.0, b0, T)).value().stable();
    };
    EXPECT_FALSE(stable(strongest * 0.999));
    EXPECT_TRUE(stable(strongest * 1.001));
    EXPECT_TRUE(stable(weakest * 0.999));
    EXPECT_FALSE(stable(weakest * 1.001));
  }
  // Of a controller that has none, or whose u does not go with it.
  const auto compensator = DisturbanceCompensator<LinearEso<1>>::make(
      {.observer = {.observer_bandwidth = 20.0, .input_gain = 1.0, .sample_time = T}});
  EXPECT_EQ(refusal(input_gain_range(LinearPlant<1>::chain({.coefficients = {1.0}}).value(),
                                     compensator.value())),
            "input_gain: does not scale all of u in this controller: use gain_increase and "
            "gain_decrease of its margins");
}

// The dead time that a plant has counts, and the margin is what is left.
TEST(Margins, DelayMarginCountsThePresentDelay) {
  const double T = 0.01;
  const auto plant = LinearPlant<2>::chain({.coefficients = {1.0, 2.0}}).value();
  const auto controller = adrc<2>(30.0, 5.0, 1.0, T);
  const auto whole = delay_margin(plant, controller).value();
  EXPECT_GT(whole.value, 2.0 * T);
  for (const double delay : {0.0, 0.3 * T, T, 1.7 * T}) {
    const auto left = delay_margin(with_dead_time(plant, delay).value(), controller).value();
    EXPECT_NEAR(left.value + delay, whole.value, 1e-12);
    EXPECT_NEAR(left.frequency, whole.frequency, 1e-9);
  }
  const auto at = [&](double delay) {
    return closed_loop(with_dead_time(plant, delay).value(), controller)->stable();
  };
  EXPECT_TRUE(at(0.9999 * whole.value));
  EXPECT_FALSE(at(1.0001 * whole.value));
}

// At a sample time that is long for the observer the loop may fail at half the sampling rate.
TEST(Margins, AtHalfTheSamplingRate) {
  const double T = 0.2;
  const auto plant = LinearPlant<1>::chain({}).value();
  const auto loop = closed_loop(plant, adrc<1>(60.0, 5.0, 1.0, T)).value();
  ASSERT_TRUE(loop.stable());
  const auto all = margins(loop).value();
  EXPECT_NEAR(all.gain_increase.frequency, std::numbers::pi / T, 1e-9);
  BruteLoop brute(ReferenceObserver{1, 1, {60.0}, 1.0, T}, {5.0}, 1.0);
  take(brute, plant);
  EXPECT_NEAR(brute.radius(all.gain_increase.value, 0.0), 1.0, 1e-6);
  const auto delay = delay_margin(loop).value();
  EXPECT_NEAR(brute.radius(1.0, delay.value), 1.0, 1e-6);
  for (int i = 1; i <= 30; ++i) EXPECT_LT(brute.radius(1.0, 0.99 * delay.value * i / 30), 1.0);
}

// ---- the object itself, on a plant whose gain or delay is just short of the edge and just beyond

/// How much larger the loop is in its second half than in its first, for a factor on one input.
template <int States, int Channels>
double growth(const LinearPlant<States, double, Channels, Channels>& plant, double sample_time,
              const std::function<std::vector<double>(const std::vector<double>&)>& control,
              int channel, double factor) {
  const auto held = held_plant(plant, sample_time).value();
  Vector<double, States> x;
  x(0) = 1.0;
  double first = 0.0;
  double second = 0.0;
  const int samples = 6000;
  for (int k = 0; k < samples; ++k) {
    const auto y = plant.output(x);
    const auto u = control({y.begin(), y.end()});
    Vector<double, Channels> input;
    for (int i = 0; i < Channels; ++i) input(i) = u[static_cast<std::size_t>(i)];
    input(channel) *= factor;
    x = x + held.increment * x + held.input * input;
    (k < samples / 2 ? first : second) += y(0) * y(0);
  }
  return second / first;
}

TEST(Margins, AtTheEdgeTheRealControllerOscillates) {
  const double T = 0.01;
  const auto plant =
      with_lag(LinearPlant<2>::chain({.coefficients = {3.0, 0.4}, .input_gain = 2.5}).value(), 0.02)
          .value();
  const auto expect_edge = [&](const Loop& loop, auto&& fresh) {
    const auto all = margins(loop).value();
    ASSERT_TRUE(all.gain_increase.limited());
    const double edge = all.gain_increase.value;
    const auto grows = [&](double factor) {
      // The controller is told what it put out: the factor is the plant's.
      auto controller = fresh();
      return growth<3, 1>(
          plant, T, [&](const std::vector<double>& y) { return std::vector{controller(y[0])}; }, 0,
          factor);
    };
    EXPECT_LT(grows(0.98 * edge), 1.0);
    EXPECT_GT(grows(1.02 * edge), 1.0);
  };
  const LinearEso<2>::Config config{
      .observer_bandwidth = 20.0, .input_gain = 2.5, .sample_time = T};
  const auto of = [&](const auto& made) {
    expect_edge(closed_loop(plant, made).value(), [&] {
      return [controller = made](double y) mutable { return controller.update(y, 0.0); };
    });
  };
  of(adrc<2>(20.0, 4.0, 2.5, T));
  of(Adrc<LinearEso<2>, ErrorBased>::make({.observer = config, .controller_bandwidth = 4.0})
         .value());
  of(Adrc<DelayedInput<LinearEso<2>, 2>>::make(
         {.observer = {.observer = config, .delay = 2}, .controller_bandwidth = 4.0})
         .value());
  of(Adrc<ModelEso<ModelParts{.order = 2, .plant_poles = true}>>::make(
         {.observer = {.observer_bandwidth = 20.0,
                       .input_gain = 2.5,
                       .sample_time = T,
                       .model = {{3.0, 0.4}}},
          .controller_bandwidth = 4.0})
         .value());
  of(PredictiveAdrc<LinearEso<2>>::make({.observer = config, .controller_bandwidth = 4.0}).value());
}

// One actuator of two, the other one as it is.
TEST(Margins, OfOneChannelOfTwo) {
  const double T = 0.01;
  LinearPlant<4, double, 2, 2> plant;
  plant.a = {
      {0.0, 1.0, 0.0, 0.0}, {-3.0, -0.4, 1.5, 0.0}, {0.0, 0.0, 0.0, 1.0}, {1.5, 0.0, -5.0, -0.6}};
  plant.b = {{0.0, 0.0}, {2.5, 0.3}, {0.0, 0.0}, {-0.6, 1.8}};
  plant.e = plant.b;
  plant.c = {{1.0, 0.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}};
  using Two = MimoAdrc<LinearEso<2>, LinearEso<2>>;
  Two::Config config;
  std::get<0>(config.observers) = {.observer_bandwidth = 40.0, .sample_time = T};
  std::get<1>(config.observers) = {.observer_bandwidth = 50.0, .sample_time = T};
  config.controller_bandwidths = {6.0, 7.0};
  config.input_matrix = {{2.5, 0.3}, {-0.6, 1.8}};
  const auto controller = Two::make(config).value();
  const auto loop = closed_loop(plant, controller).value();
  ASSERT_TRUE(loop.stable());
  double modulus = 1.0;
  for (const int channel : {0, 1}) {
    const auto all = margins(plant, controller, channel).value();
    ASSERT_TRUE(all.gain_increase.limited());
    const double edge = all.gain_increase.value;
    const auto grows = [&](double factor) {
      auto real = controller;
      return growth<4, 2>(
          plant, T,
          [&](const std::vector<double>& y) {
            const Vector<double, 2> measured(y[0], y[1]);
            const auto u = real.update(measured, Vector<double, 2>());
            return std::vector{u(0), u(1)};
          },
          channel, factor);
    };
    EXPECT_LT(grows(0.98 * edge), 1.0);
    EXPECT_GT(grows(1.02 * edge), 1.0);
    const auto delay = delay_margin(plant, controller, channel).value();
    EXPECT_NEAR(std::abs(loop.loop_gain(delay.frequency, channel).value()), 1.0, 0.1);
    modulus = std::min(modulus, all.modulus.value);
  }
  // The worst case is that of the worse channel.
  const auto as_it_is = [&](const Array<double, 1>&) { return plant; };
  const auto worst =
      worst_case(as_it_is, std::array<Interval<>, 1>{}, controller, {.points = 2, .halvings = 0})
          .value();
  EXPECT_EQ(worst.modulus.value, modulus);
  // Both at once: less than that of the worse one, and the same delay edge as a common dead time.
  const auto peak = sensitivity_peak(loop).value();
  double dense = 0.0;
  for (int i = 0; i < 20000; ++i) {
    const double w = std::numbers::pi / T * std::pow(10.0, -4.0 * i / 19999);
    dense = std::max(dense, loop.largest_sensitivity(w).value());
  }
  EXPECT_GE(peak.value, dense * (1.0 - 1e-9));
  EXPECT_NEAR(peak.value, dense, 1e-4 * dense);
  EXPECT_GT(peak.value, 1.0 / modulus * 0.9);
  for (const int channel : {-1, 2}) {
    EXPECT_EQ(refusal(margins(loop, channel)),
              "channel: must be 0 .. channels - 1, that is at most");
    EXPECT_EQ(refusal(delay_margin(loop, channel)),
              "channel: must be 0 .. channels - 1, that is at most");
  }
}

// Of one channel the peak is the inverse of the modulus margin.
TEST(Margins, PeakOfTheSensitivity) {
  const auto loop = closed_loop(LinearPlant<2>::chain({.coefficients = {1.0, 2.0}}).value(),
                                adrc<2>(30.0, 5.0, 1.0, 0.01))
                        .value();
  const auto all = margins(loop).value();
  const auto peak = sensitivity_peak(loop).value();
  EXPECT_NEAR(peak.value * all.modulus.value, 1.0, 1e-12);
  EXPECT_NEAR(peak.frequency, all.modulus.frequency, 1e-5 * peak.frequency);
}

// ---- worst case

TEST(WorstCase, IsTheWorstOfADenseGrid) {
  const auto controller = adrc<2>(60.0, 8.0, 50.0, 1e-3);
  const auto plant_of = [](const Array<double, 2>& p) {
    return LinearPlant<2>::chain(
        {.coefficients = {0.0, p[1]}, .input_gain = p[0], .dead_time = 1e-3});
  };
  const std::array<Interval<>, 2> box{{{25.0, 100.0}, {0.0, 5.0}}};
  const auto worst = worst_case(plant_of, box, controller, {.points = 3, .halvings = 6}).value();
  EXPECT_TRUE(worst.stable());
  const double infinite = std::numeric_limits<double>::infinity();
  double abscissa = -infinite;
  double modulus = infinite;
  double increase = infinite;
  double decrease = 0.0;
  double phase = infinite;
  double delay = infinite;
  for (int i = 0; i <= 12; ++i) {
    for (int j = 0; j <= 12; ++j) {
      const auto loop =
          closed_loop(plant_of({25.0 + 75.0 * i / 12, 5.0 * j / 12}).value(), controller).value();
      const auto m = margins(loop).value();
      abscissa = std::max(abscissa, loop.stability_abscissa());
      modulus = std::min(modulus, m.modulus.value);
      increase = std::min(increase, m.gain_increase.value);
      decrease = std::max(decrease, m.gain_decrease.value);
      phase = std::min(phase, m.phase.value);
      delay = std::min(delay, delay_margin(loop).value().value);
    }
  }
  // The search may find what the dense grid misses, never the other way round but for its last
  // step.
  EXPECT_GT(worst.stability_abscissa.value, abscissa - 1e-4 * std::abs(abscissa));
  EXPECT_LT(worst.modulus.value, modulus * (1.0 + 1e-4));
  EXPECT_LT(worst.gain_increase.value, increase * (1.0 + 1e-4));
  EXPECT_GE(worst.gain_decrease.value, decrease * (1.0 - 1e-4));
  EXPECT_LT(worst.phase.value, phase * (1.0 + 1e-4));
  EXPECT_LT(worst.delay.value, delay * (1.0 + 1e-4));
  // Each is that of the plant that is named.
  const auto at = [&](const auto& found) {
    return closed_loop(*plant_of(found.parameters), controller).value();
  };
  EXPECT_EQ(margins(at(worst.modulus))->modulus.value, worst.modulus.value);
  EXPECT_EQ(margins(at(worst.phase))->phase.value, worst.phase.value);
  EXPECT_EQ(delay_margin(at(worst.delay))->value, worst.delay.value);
  EXPECT_EQ(at(worst.stability_abscissa).stability_abscissa(), worst.stability_abscissa.value);
}

TEST(WorstCase, FindsAnUnstablePlantAndRefusesByRule) {
  const auto controller = adrc<1>(60.0, 8.0, 1.0, 1e-2);
  // Stable at both ends of the first range, not between: found by the grid's third point.
  const auto hidden = [](const Array<double, 1>& p) {
    return LinearPlant<1>::chain({.input_gain = std::abs(p[0] - 0.5) < 0.2 ? -1.0 : 1.0});
  };
  const auto worst =
      worst_case(hidden, std::array<Interval<>, 1>{{{0.0, 1.0}}}, controller).value();
  EXPECT_FALSE(worst.stable());
  EXPECT_NEAR(worst.stability_abscissa.parameters[0], 0.5, 0.2);
  EXPECT_EQ(worst.modulus.value, 0.0);
  EXPECT_EQ(worst.gain_increase.value, 1.0);
  EXPECT_EQ(worst.gain_decrease.value, 1.0);
  EXPECT_EQ(worst.phase.value, 0.0);
  EXPECT_EQ(worst.delay.value, 0.0);

  const auto of = [&](Interval<> range, WorstCaseSearch search = {}) {
    const auto plant_of = [](const Array<double, 1>& p) {
      return LinearPlant<1>::chain({.input_gain = p[0]});
    };
    return refusal(worst_case(plant_of, std::array{range}, controller, search));
  };
  EXPECT_EQ(of({0.5, 2.0}), "accepted");
  EXPECT_EQ(of({0.5, 0.5}), "accepted");
  EXPECT_EQ(of({2.0, 0.5}), "ranges[0]: must not be above upper");
  EXPECT_EQ(of({std::nan(""), 0.5}), "ranges[0]: must be finite");
  EXPECT_EQ(of({0.5, std::numeric_limits<double>::infinity()}), "ranges[0]: must be finite");
  EXPECT_EQ(of({0.0, 2.0}), "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(of({0.5, 2.0}, {.points = 1}), "points: must be 2 .. 1000");
  EXPECT_EQ(of({0.5, 2.0}, {.points = 1001}), "points: must be 2 .. 1000");
  EXPECT_EQ(of({0.5, 2.0}, {.halvings = -1}), "halvings: must be 0 .. 100");
  EXPECT_EQ(of({0.5, 2.0}, {.halvings = 101}), "halvings: must be 0 .. 100");
}

/// u = k (r - y): a controller of the user, which does not integrate.
struct Proportional {
  double gain, sample_time;
};
LinearController linear_controller(const Proportional& p) {
  LinearController form(0, 1, 0, p.sample_time);
  form.y_to_u(0, 0) = -p.gain;
  form.r_to_u(0, 0) = p.gain;
  return form;
}

/// y' = -a y + b u with u = -k y: it leaves by z = 1, or s = 0, where b k = -a.
auto first_order(double a, double b, double gain, double sample_time) {
  return closed_loop(LinearPlant<1>::chain({.coefficients = {a}, .input_gain = b}).value(),
                     Proportional{gain, sample_time})
      .value();
}

TEST(Margins, HaveALimitAtFrequencyZeroWhereNothingIntegrates) {
  for (const double T : {0.0, 1e-3, 1e-2}) {
    SCOPED_TRACE(T);
    const auto held = margins(first_order(-10, 1, 22, T)).value();
    EXPECT_NEAR(held.gain_decrease.value, 10.0 / 22, 1e-13);
    EXPECT_EQ(held.gain_decrease.frequency, 0);
    EXPECT_NE(held.gain_increase.frequency, 0);
    // Positive feedback of a stable plant: more of it, and the least distance is there, too.
    const auto pushed = margins(first_order(2, -1, 0.5, T)).value();
    EXPECT_NEAR(pushed.gain_increase.value, 4, 1e-13);
    EXPECT_EQ(pushed.gain_increase.frequency, 0);
    EXPECT_EQ(pushed.gain_decrease.value, 0);
    EXPECT_NEAR(pushed.modulus.value, 0.75, 1e-13);
    EXPECT_NEAR(pushed.modulus.frequency, 0, 1e-6);
    const auto loop = first_order(2, -1, 0.5, T);
    EXPECT_NEAR(sensitivity_peak(loop)->value, 1 / 0.75, 1e-13);
    // 1 + L^2 over L at L = 1/4 is 17/4, of f = 4.
    EXPECT_NEAR(gain_variation(loop)->value, 4, 1e-12);
    // No limit there, by either sign of L(0).
    EXPECT_FALSE(margins(first_order(2, 1, 0.5, T))->gain_decrease.limited());
  }
  EXPECT_FALSE(margins(first_order(0, 1, 0.5, 0))->gain_decrease.limited());
  const auto worst = worst_case(
      [](const Array<double, 1>& p) { return LinearPlant<1>::chain({.coefficients = {p[0]}}); },
      std::array<Interval<>, 1>{{{-11, -9}}}, Proportional{22, 0});
  EXPECT_NEAR(worst->gain_decrease.value, 0.5, 1e-13);
  EXPECT_NEAR(worst->gain_decrease.parameters[0], -11, 1e-13);
}

// Searched: no change of the gain between the limits leaves the loop unstable, any at them does.
TEST(Margins, OfRandomProportionalLoopsAreWhereTheyTurnUnstable) {
  Random random(21);
  int at_zero = 0, loops = 0;
  for (int trial = 0; trial < 3000 && loops < 150; ++trial) {
    const auto sign = [&] { return random.index(2) == 0 ? 1.0 : -1.0; };
    const auto plant =
        LinearPlant<3>::chain({.coefficients = {random.uniform(-20, 100), random.uniform(-5, 60),
                                                random.uniform(0, 10)},
                               .input_gain = sign()})
            .value();
    const double T = trial % 2 == 0 ? 0.0 : random.log_uniform(1e-3, 0.1);
    const double gain = sign() * random.log_uniform(1, 100);
    const auto stable = [&](double factor) {
      return closed_loop(plant, Proportional{factor * gain, T})->stable();
    };
    const auto all = margins(closed_loop(plant, Proportional{gain, T}).value());
    if (!all) continue;
    ++loops;
    SCOPED_TRACE(trial);
    const double least = all->gain_decrease.value, most = all->gain_increase.value;
    EXPECT_FALSE(all->gain_decrease.limited() && stable(least * (1 - 1e-6)));
    EXPECT_FALSE(all->gain_increase.limited() && stable(most * (1 + 1e-6)));
    for (int i = 0; i <= 20; ++i) {
      const double low = std::max(least * (1 + 1e-6), 1e-3), high = std::min(most, 1e3);
      EXPECT_TRUE(stable(low * std::pow(high * (1 - 1e-6) / low, i / 20.0))) << i;
    }
    at_zero += all->gain_decrease.frequency == 0 || all->gain_increase.frequency == 0;
  }
  EXPECT_EQ(loops, 150);
  EXPECT_GT(at_zero, 30);
}

/// What integrates has no limit at zero, however its rounding falls.
TEST(Margins, HaveNoLimitAtZeroWhereTheLoopIntegrates) {
  Random random(12);
  int loops = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const double a = random.uniform(-5, 5);
    const auto plant = LinearPlant<2>::chain(
        {.coefficients = {a, random.uniform(0, 5)}, .input_gain = random.log_uniform(25, 100)});
    const auto loop = closed_loop(*plant, adrc<2>(random.log_uniform(30, 80), 8, 50, 1e-3)).value();
    const auto all = margins(loop);
    if (!all) continue;
    ++loops;
    EXPECT_NE(all->gain_decrease.frequency, 0) << trial;
    EXPECT_NE(all->gain_increase.frequency, 0) << trial;
    EXPECT_GT(all->modulus.frequency, 1) << trial;
  }
  EXPECT_GT(loops, 150);
}

/// abs(L) < 1 everywhere, which no loop with a disturbance estimate has: by hand.
TEST(Margins, WithoutAnEdgeAreInfinite) {
  const auto weak = [](double w) { return std::complex<double>(0.1, 0.05) / (1.0 + w); };
  esokit::detail::MarginFinder finder(weak);
  for (double w = 0.1; w < 10.0; w *= 2.0) finder(w, weak(w), 2.0 * w, weak(2.0 * w));
  const auto all = finder.margins();
  constexpr double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(all.phase.value, infinite);
  EXPECT_EQ(all.gain_increase.value, infinite);
  EXPECT_EQ(all.gain_decrease.value, 0.0);
  for (const auto& margin : {all.phase, all.gain_increase, all.gain_decrease}) {
    EXPECT_FALSE(margin.limited());
    EXPECT_TRUE(std::isnan(margin.frequency));
  }
  EXPECT_TRUE(all.modulus.limited());
  EXPECT_GE(all.modulus.value, 1.0);
}

TEST(Margins, OfAnUnstableLoopAreAnError) {
  const auto plant = LinearPlant<2>::chain({.coefficients = {1.0, 2.0}, .input_gain = -1.0})
                         .value();  // wrong sign
  const auto controller = adrc<2>(30.0, 5.0, 1.0, 0.01);
  const auto loop = closed_loop(plant, controller).value();
  EXPECT_FALSE(loop.stable());
  constexpr const char* rule =
      "stability_abscissa: must be negative: the nominal loop is not stable, it has no margins";
  EXPECT_EQ(refusal(margins(plant, controller)), rule);
  EXPECT_EQ(refusal(delay_margin(plant, controller)), rule);
  EXPECT_EQ(refusal(input_gain_range(plant, controller)), rule);
  EXPECT_EQ(refusal(sensitivity_peak(loop)), rule);
}

}  // namespace analysis_margins_test
