// Margins against brute force: a loop assembled anew from the equations, whose poles must reach the
// edge with the computed gain, phase or delay, and must not before.
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdio>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <numbers>
#include <support/refusal.hpp>
#include <vector>

#include "support/numbers.hpp"
#include "support/reference_observer.hpp"

namespace {

using namespace esokit;
using Complex = std::complex<double>;
using esokit_test::Random;
using esokit_test::ReferenceObserver;
using esokit_test::refusal;

/// exp(a) by its series with many halvings, in long double.
Eigen::MatrixXd exponential(const Eigen::MatrixXd& a) {
  using Long = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;
  const Long small = a.cast<long double>() / 1048576.0L;
  Long sum = Long::Identity(a.rows(), a.cols());
  Long term = sum;
  for (int k = 1; k < 12; ++k) {
    term = Long(term.lazyProduct(small)) / static_cast<long double>(k);
    sum += term;
  }
  for (int i = 0; i < 20; ++i) sum = Long(sum.lazyProduct(sum));
  return sum.cast<double>();
}

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
NominalPlant<PlantStates> random_plant(Random& random, double speed, double gain) {
  CompanionPlant<Order> rigid;
  rigid.input_gain = gain;
  for (std::size_t i = 0; i < Order; ++i) {
    rigid.coefficients[i] =
        random.uniform(-0.2, 2.0) * std::pow(speed, static_cast<double>(Order) - double(i));
  }
  const auto core = rigid.system().value();
  NominalPlant<PlantStates> plant;
  plant.a.template topLeftCorner<Order, Order>() = core.a;
  plant.b.template topRows<Order>() = core.b;
  plant.c.template leftCols<Order>() = core.c;
  for (int i = Order; i < PlantStates; i += 2) {
    const double w = speed * random.log_uniform(2.0, 60.0);
    plant.a(i, i + 1) = 1.0;
    plant.a(i + 1, i) = -w * w;
    plant.a(i + 1, i + 1) = -2.0 * random.log_uniform(2e-3, 0.3) * w;
    plant.b(i + 1, 0) = gain * random.uniform(-0.5, 1.0) * std::pow(speed, 2 - Order);
    plant.c(0, i) = 1.0;
  }
  return plant;
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
    const auto observer = CascadeEso<Order, Levels>::make(config).value();
    const auto law = AdrcLaw<Order>::make({.controller_bandwidth = wc, .input_gain = b0}).value();
    const auto plant = random_plant<PlantStates, Order>(random, wc, b);
    const auto loop = adrc_loop(sampled_plant(plant, T).value(), observer, law).value();

    ReferenceObserver reference{Order, 1, {wo}, b0, T};
    for (int i = 1; i < Levels; ++i) reference.bandwidths.push_back(wo * std::pow(2.0, i));
    BruteLoop brute(reference, {law.gains().begin(), law.gains().end()}, b0);
    brute.a = plant.a;
    brute.b = plant.b.col(0);
    brute.c = plant.c;
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

    const auto delay = delay_margin(loop, plant);
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
  check_random_loops<1, 1, 1>(25, 1, counts);
  check_random_loops<2, 1, 2>(25, 2, counts);
  check_random_loops<2, 2, 2>(25, 3, counts);
  check_random_loops<3, 1, 3>(15, 4, counts);
  check_random_loops<2, 1, 6>(40, 5, counts);  // two resonances: many crossings
  std::printf("%d loops: %d gains up, %d down, %d phases, %d delays\n", counts.loops,
              counts.increases, counts.decreases, counts.phases, counts.delays);
  EXPECT_GT(counts.increases, 100);
  EXPECT_GT(counts.decreases, 20);
  EXPECT_GT(counts.phases, 100);
  EXPECT_GT(counts.delays, 60);
}

// Closed loops whose edges are known: s^2 + g (2 s + 1) with a lag has its phase by hand.
TEST(Margins, OfAContinuousLoopByHand) {
  // n = 1, plant y' = u: with k = omega_c the loop is L = (l_1 k + l_2) s + k l_2 over
  // s (s + l_1 + k) s for l = (2 w, w^2).
  const double k = 3.0;
  const double w = 10.0;
  const auto observer =
      ContinuousLinearEso<1>::make({.observer_bandwidth = w, .input_gain = 1.0}).value();
  const auto law = AdrcLaw<1>::make({.controller_bandwidth = k, .input_gain = 1.0}).value();
  const auto plant = CompanionPlant<1>{{0.0}, 1.0}.system().value();
  const auto loop = adrc_loop(plant, observer, law).value();
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
    const auto observer =
        ContinuousLinearEso<1>::make({.observer_bandwidth = 10.0 * rate, .input_gain = rate})
            .value();
    const auto law =
        AdrcLaw<1>::make({.controller_bandwidth = 3.0 * rate, .input_gain = rate}).value();
    // With a lag, so that the gain has an edge; and one pole far below all others.
    const auto plant = CompanionPlant<1>{{1e-3 * rate}, 1.3 * rate}.system().value();
    return margins(adrc_loop(plant, observer, law).value()).value();
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

// A gain that may neither rise nor fall: an unstable plant; and any b0 / b between is stable.
TEST(Margins, RangeOfTheInputGain) {
  const double T = 0.01;
  const auto plant = CompanionPlant<2>{{-30.0, 0.5}, 4.0}.system().value();
  const auto sampled = sampled_plant(plant, T).value();
  const auto observer_of = [&](double b0) {
    return LinearEso<2>::make({.observer_bandwidth = 40.0, .input_gain = b0, .sample_time = T})
        .value();
  };
  const auto law_of = [](double b0) {
    return AdrcLaw<2>::make({.controller_bandwidth = 8.0, .input_gain = b0}).value();
  };
  const auto loop = adrc_loop(sampled, observer_of(5.0), law_of(5.0)).value();
  const auto range = input_gain_range(loop, law_of(5.0), 4.0).value();
  EXPECT_GT(range.lower, 0.1);
  EXPECT_LT(range.lower, 1.25);
  EXPECT_GT(range.upper, 1.25);
  EXPECT_LT(range.upper, 50.0);
  const auto stable = [&](double ratio) {
    return adrc_loop(sampled, observer_of(4.0 * ratio), law_of(4.0 * ratio)).value().stable();
  };
  EXPECT_FALSE(stable(range.lower * 0.999));
  EXPECT_TRUE(stable(range.lower * 1.001));
  EXPECT_TRUE(stable(range.upper * 0.999));
  EXPECT_FALSE(stable(range.upper * 1.001));
  EXPECT_EQ(refusal(input_gain_range(loop, law_of(5.0), 0.0)),
            "plant_gain: must be finite, not zero, of the sign of b0");
  EXPECT_EQ(refusal(input_gain_range(loop, law_of(5.0), -4.0)),
            "plant_gain: must be finite, not zero, of the sign of b0");
}

// The delay that a plant was sampled with counts, and the margin is what is left.
TEST(Margins, DelayMarginCountsThePresentDelay) {
  const double T = 0.01;
  const auto plant = CompanionPlant<2>{{1.0, 2.0}, 1.0}.system().value();
  const auto observer =
      LinearEso<2>::make({.observer_bandwidth = 30.0, .input_gain = 1.0, .sample_time = T}).value();
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 5.0, .input_gain = 1.0}).value();
  const auto without = adrc_loop(sampled_plant(plant, T).value(), observer, law).value();
  const auto whole = delay_margin(without, plant).value();
  EXPECT_GT(whole.value, 2.0 * T);
  for (const double delay : {0.0, 0.3 * T, T}) {
    const auto loop = adrc_loop(sampled_plant(plant, T, delay).value(), observer, law).value();
    const auto left = delay_margin(loop, plant, delay).value();
    EXPECT_NEAR(left.value + delay, whole.value, 1e-12);
    EXPECT_NEAR(left.frequency, whole.frequency, 1e-9);
  }
}

// At a sample time that is long for the observer the loop may fail at half the sampling rate.
TEST(Margins, AtHalfTheSamplingRate) {
  const double T = 0.2;
  const auto plant = CompanionPlant<1>{{0.0}, 1.0}.system().value();
  const auto observer =
      LinearEso<1>::make({.observer_bandwidth = 60.0, .input_gain = 1.0, .sample_time = T}).value();
  const auto law = AdrcLaw<1>::make({.controller_bandwidth = 5.0, .input_gain = 1.0}).value();
  const auto loop = adrc_loop(sampled_plant(plant, T).value(), observer, law).value();
  ASSERT_TRUE(loop.stable());
  const auto all = margins(loop).value();
  EXPECT_NEAR(all.gain_increase.frequency, std::numbers::pi / T, 1e-9);
  BruteLoop brute(ReferenceObserver{1, 1, {60.0}, 1.0, T}, {5.0}, 1.0);
  brute.a = plant.a;
  brute.b = plant.b.col(0);
  brute.c = plant.c;
  EXPECT_NEAR(brute.radius(all.gain_increase.value, 0.0), 1.0, 1e-6);
  const auto delay = delay_margin(loop, plant).value();
  EXPECT_NEAR(brute.radius(1.0, delay.value), 1.0, 1e-6);
  for (int i = 1; i <= 30; ++i) EXPECT_LT(brute.radius(1.0, 0.99 * delay.value * i / 30), 1.0);
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
  const double T = 0.01;
  const auto plant = CompanionPlant<2>{{1.0, 2.0}, -1.0}.system().value();  // wrong sign
  const auto observer =
      LinearEso<2>::make({.observer_bandwidth = 30.0, .input_gain = 1.0, .sample_time = T}).value();
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 5.0, .input_gain = 1.0}).value();
  const auto loop = adrc_loop(sampled_plant(plant, T).value(), observer, law).value();
  EXPECT_FALSE(loop.stable());
  const auto all = margins(loop);
  ASSERT_FALSE(all.has_value());
  EXPECT_EQ(
      refusal(all),
      "stability_abscissa: must be negative: the nominal loop is not stable, it has no margins");
  const auto continuous = adrc_loop(
      plant, ContinuousLinearEso<1>::make({.observer_bandwidth = 10.0, .input_gain = 1.0}).value(),
      AdrcLaw<1>::make({.controller_bandwidth = 3.0, .input_gain = 1.0}).value());
  ASSERT_EQ(refusal(continuous), "accepted");
  EXPECT_EQ(refusal(delay_margin(*continuous, plant)),
            "plant.sample_time: must be positive: this is for a sampled loop");
  EXPECT_EQ(
      refusal(delay_margin(loop, plant)),
      "stability_abscissa: must be negative: the nominal loop is not stable, it has no margins");
  // The continuous overload refuses a sampled loop.
  EXPECT_EQ(refusal(delay_margin(loop)),
            "plant.sample_time: must be zero here: a sampled loop needs its continuous plant");
}

}  // namespace
