// Bounds of the papers: the matrices behind them, and simulated errors that must stay below. The
// input of a run is the worst there is for a linear observer: the sign of the impulse response,
// backwards. Printed: how loose a bound is.
#include <gtest/gtest.h>

#include <algorithm>
#include <analysis/error_bound.hpp>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/analysis/peak_gain.hpp>
#include <esokit/eigen.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <limits>
#include <numbers>
#include <support/refusal.hpp>
#include <utility>
#include <vector>

#include "support/numbers.hpp"

namespace examples_error_bound_test {

using namespace analysis;
using esokit_test::Random;
using esokit_test::refusal;

/// Plant y^(n) = d, d^(m) = w, stacked with a continuous observer; the paper way.
template <class Observer>
struct Simulation {
  static constexpr int N = Observer::size;
  static constexpr int states = N + Observer::states;
  using State = EigenMatrix<double, states>;

  Observer observer;
  State state = State::Zero();
  double step_size = 1e-3;
  double t = 0.0;

  void step(double w, double v) {
    observer.begin_step(t, state.template tail<Observer::states>(), state(0) + v);
    const auto rate = [&](double time, const State& x) -> State {
      State derivative;
      for (int i = 0; i + 1 < N; ++i) derivative(i) = x(i + 1);
      derivative(N - 1) = w;
      derivative.template tail<Observer::states>() =
          eigen(observer.derivative(time, x.template tail<Observer::states>(), x(0) + v, 0.0));
      return derivative;
    };
    state = sim::step(rate, t, state, step_size);
    t += step_size;
  }
  [[nodiscard]] EigenMatrix<double, N> error() const {
    const EigenMatrix<double, N> z = state.template head<N>();
    return z - Observer::estimate(state.template tail<Observer::states>());
  }
};

struct Looseness {
  double peak = 0.0, simulated = 0.0, bound = 0.0;
};

/// Error of row `row` under the worst d^(m) (or the worst noise) of size one.
template <class Observer>
Looseness worst_run(const Observer& observer, bool noise, int row, double fastest, double slowest,
                    const EigenMatrix<double, Observer::size>& bound) {
  Simulation<Observer> impulse{observer};
  const double h = 0.04 / fastest;
  const int steps = static_cast<int>(25.0 / slowest / h);
  impulse.step_size = h;
  std::vector<double> response;
  impulse.step(noise ? 0.0 : 1.0, noise ? 1.0 : 0.0);
  for (int k = 0; k < steps; ++k) {
    response.push_back(impulse.error()(row));
    impulse.step(0.0, 0.0);
  }
  Simulation<Observer> worst{observer};
  worst.step_size = h;
  for (int k = steps; k-- > 0;) {
    const double input = response[static_cast<std::size_t>(k)] < 0.0 ? -1.0 : 1.0;
    worst.step(noise ? 0.0 : input, noise ? input : 0.0);
  }
  Looseness result;
  result.peak = peak_gain(error_system(observer)).value()(row, noise ? 0 : 1);
  result.simulated = std::abs(worst.error()(row));
  result.bound = bound(row);
  return result;
}

template <class Observer>
void expect_below(const char* name, const Observer& observer, double fastest, double slowest,
                  const EigenMatrix<double, Observer::size>& disturbance_bound,
                  const EigenMatrix<double, Observer::size>& noise_bound) {
  for (const bool noise : {false, true}) {
    const auto& bound = noise ? noise_bound : disturbance_bound;
    for (int row = 0; row < Observer::size; ++row) {
      const Looseness l = worst_run(observer, noise, row, fastest, slowest, bound);
      EXPECT_LT(l.simulated, l.bound);
      EXPECT_LE(l.peak, l.bound);
      // The peak gain is sharp; the run misses it by its steps.
      EXPECT_LE(l.simulated, 1.01 * l.peak);
      EXPECT_GT(l.simulated, 0.95 * l.peak);
      std::printf("%s, %s, row %d: bound %.4g, worst case %.4g, simulated %.4g: bound %.1f times\n",
                  name, noise ? "noise" : "disturbance", row, l.bound, l.peak, l.simulated,
                  l.bound / l.simulated);
    }
  }
}

template <int Order, int Extension>
void linear_case(const char* name, double w) {
  using Eso = ContinuousLinearEso<Order, double, Extension>;
  const typename Eso::Config config{.observer_bandwidth = w, .input_gain = 1.0};
  const auto d = linear_error_bound(config, {.disturbance_rate = 1.0}).value();
  const auto v = linear_error_bound(config, {.measurement_noise = 1.0}).value();
  expect_below(name, Eso::make(config).value(), w, w, d.ultimate(), v.ultimate());
}

TEST(ErrorBound, OfTheLinearObserverHolds) {
  linear_case<2, 1>("LESO n = 2", 20.0);
  linear_case<2, 2>("LESO n = 2, m = 2", 3.0);
}

template <int Order, int Levels, int Extension>
void cascade_case(const char* name, double w, double alpha) {
  using Eso = ContinuousCascadeEso<Order, Levels, double, Extension>;
  const typename Eso::Config config{
      .observer_bandwidth = w, .bandwidth_factor = alpha, .input_gain = 1.0};
  const auto d = cascade_error_bounds<Order>(config, {.disturbance_rate = 1.0}).value();
  const auto v = cascade_error_bounds<Order>(config, {.measurement_noise = 1.0}).value();
  expect_below(name, Eso::make(config).value(), w * std::pow(alpha, Levels - 1), w,
               d.back().ultimate(), v.back().ultimate());
}

TEST(ErrorBound, OfTheCascadeHolds) {
  cascade_case<1, 2, 1>("cascade n = 1, p = 2", 20.0, 2.0);
  cascade_case<2, 3, 1>("cascade n = 2, p = 3", 33.98, 2.0);
  cascade_case<2, 3, 1>("cascade n = 2, p = 3, alpha 1.1", 10.0, 1.1);
  cascade_case<1, 2, 2>("cascade n = 1, m = 2, p = 2", 5.0, 1.5);
}

TEST(ErrorBound, OfOneLevelIsThatOfTheLinearObserver) {
  const ErrorSources sources{.disturbance_rate = 3.0, .measurement_noise = 0.2};
  const auto one =
      cascade_error_bounds<2>(
          ContinuousCascadeEso<2, 1>::Config{.observer_bandwidth = 30.0, .input_gain = 1.0},
          sources)
          .value();
  const auto linear =
      linear_error_bound(
          ContinuousLinearEso<2>::Config{.observer_bandwidth = 30.0, .input_gain = 1.0}, sources)
          .value();
  for (int r = 0; r < 3; ++r) EXPECT_NEAR(one[0].ultimate()(r) / linear.ultimate()(r), 1.0, 1e-14);
}

// By hand for n = 1: H* = (-2, 1; -1, 0), P = (1/2, -1/2; -1/2, 3/2), (8); norm(kappa) = sqrt(5);
// the same level 2 of a cascade, omega_2 = alpha omega_1.
TEST(ErrorBound, NumbersByHand) {
  const double w = 10.0;
  const double largest = 1.0 + std::sqrt(0.5);
  const double gamma = std::sqrt(largest / (1.0 - std::sqrt(0.5)));
  const ErrorSources sources{.disturbance_rate = 3.0, .measurement_noise = 0.02};
  const auto bounds = cascade_error_bounds<1>(
                          ContinuousCascadeEso<1, 2>::Config{
                              .observer_bandwidth = w, .bandwidth_factor = 3.0, .input_gain = 1.0},
                          sources)
                          .value();
  EXPECT_NEAR(bounds[0].gamma, gamma, 1e-12);
  const double first = 2.0 * largest / w * (3.0 + w * w * std::sqrt(5.0) * 0.02);
  EXPECT_NEAR(bounds[0].level, first, 1e-12 * first);
  EXPECT_NEAR(bounds[0].rate, w / (2.0 * largest), 1e-12);
  EXPECT_NEAR(bounds[0].ultimate()(0), gamma * first / w, 1e-12 * first);
  EXPECT_NEAR(bounds[0].ultimate()(1), gamma * first, 1e-12 * gamma * first);
  // l_2 - b b' l_1 = (2 w_2, w_2^2 - w_1^2), scaled by (w_2, 1); noise through b b' l_1 = w_1^2.
  const double w2 = 30.0;
  const double coupling = std::hypot(2.0 * w2 * w2, w2 * w2 - w * w) * gamma * first / w;
  const double second = 2.0 * largest / w2 * (3.0 + w * w * 0.02 + coupling);
  EXPECT_NEAR(bounds[1].level, second, 1e-12 * second);
}

/// (26): b b' (l_{j+1} - l_j) c' z~_j for j < i - 1 has the norm omega_j (alpha^(n+1) - 1) where
/// z~_j1 is omega_j^-n zeta_j.
TEST(ErrorBound, ThirdLevelCarriesTheCorrectedTerm) {
  const double w = 5.0;
  const double alpha = 2.0;
  const ErrorSources sources{.disturbance_rate = 1.0};
  const auto b = cascade_error_bounds<2>(
                     ContinuousCascadeEso<2, 3>::Config{
                         .observer_bandwidth = w, .bandwidth_factor = alpha, .input_gain = 1.0},
                     sources)
                     .value();
  const double w2 = alpha * w;
  const double w3 = alpha * w2;
  const double cubed = w3 * w3 * w3;
  const double coupling =
      std::hypot(3.0 * cubed, 3.0 * cubed, cubed - w2 * w2 * w2) * b[1].ultimate()(0);
  const double far = w * (alpha * alpha * alpha - 1.0) * b[0].gamma * b[0].level;
  const double largest = w3 / (2.0 * b[2].rate);
  EXPECT_NEAR(b[2].level, 2.0 * largest / w3 * (1.0 + coupling + far), 1e-12 * b[2].level);
}

/// A law that switches between two gains while it runs, by the rule of the ABESO or at random.
template <int Size>
struct Switching {
  static constexpr esokit::ContinuousGainLawTraits traits{.begins_steps = true};
  EigenMatrix<double, Size> shrinking, otherwise;
  Random random{1};
  bool by_rule = true;
  double before = 0.0;
  bool shrinks = false;

  [[nodiscard]] const EigenMatrix<double, Size>& gain(double, double) const {
    return shrinks ? shrinking : otherwise;
  }
  void begin_step(double, double e) {
    shrinks = by_rule ? std::abs(e) < before : random.index(2) == 0;
    before = std::abs(e);
  }
};

template <int Size>
EigenMatrix<double, Size> gain_of(double w) {
  EigenMatrix<double, Size> gain;
  for (int i = 0; i < Size; ++i) gain(i) = esokit_test::choose(Size, i + 1) * std::pow(w, i + 1);
  return gain;
}

template <int Order>
void switched_case(double rho, bool by_rule) {
  constexpr int N = Order + 1;
  const double w = 6.0;
  const ErrorSources sources{.disturbance_rate = 0.5, .measurement_noise = 0.01};
  const auto bound =
      switched_error_bound<N>({.observer_bandwidth = w, .factor_while_shrinking = rho}, sources)
          .value();
  using Observer = ContinuousObserver<Order, double, 1, Switching<N>>;
  Switching<N> law{gain_of<N>(rho * w), gain_of<N>(w)};
  law.by_rule = by_rule;
  double tightest = 0.0;
  for (int seed = 0; seed < 20; ++seed) {
    law.random = Random(static_cast<std::uint64_t>(seed));
    Simulation<Observer> run{Observer::make(1.0, {law}).value()};
    Random random(100 + static_cast<std::uint64_t>(seed));
    EigenMatrix<double, N> initial;
    for (int i = 0; i < N; ++i) initial(i) = random.uniform(-1.0, 1.0) * std::pow(w, i);
    run.state.template head<N>() = initial;
    run.step_size = 2e-3;
    double input = 1.0;
    double noise = 1.0;
    for (int k = 0; k < 6000; ++k) {
      if (random.index(400) == 0) input = -input;
      if (random.index(40) == 0) noise = -noise;
      run.step(0.5 * input, 0.01 * noise);
      const auto error = run.error();
      const auto limit = bound.at(run.t, initial);
      const auto ultimate = bound.ultimate();
      for (int i = 0; i < N; ++i) {
        ASSERT_LE(std::abs(error(i)), limit(i));
        if (run.t > bound.convergence_time(initial, 0.1).value()) {
          ASSERT_LE(std::abs(error(i)), 1.1 * ultimate(i));
          tightest = std::max(tightest, std::abs(error(i)) / ultimate(i));
        }
      }
    }
  }
  std::printf("ABESO n = %d, rho = %.2g, switched %s: bound %.1f times the largest error\n", Order,
              rho, by_rule ? "by its rule" : "at random", 1.0 / tightest);
  EXPECT_GT(tightest, 0.0);
}

TEST(ErrorBound, OfTheSwitchedObserverHolds) {
  switched_case<2>(0.7, true);
  switched_case<2>(0.7, false);
  switched_case<2>(0.45, false);
  switched_case<3>(0.6, true);
}

TEST(ErrorBound, SwitchedBoundOfEqualFactorsIsALinearOne) {
  const ErrorSources sources{.disturbance_rate = 1.0, .measurement_noise = 0.1};
  const auto switched =
      switched_error_bound<3>({.observer_bandwidth = 20.0, .factor_while_shrinking = 1.0}, sources)
          .value();
  const auto linear =
      linear_error_bound(
          ContinuousLinearEso<2>::Config{.observer_bandwidth = 20.0, .input_gain = 1.0}, sources)
          .value();
  // delta-bar(1) = sqrt(19) stands at the noise in both. The inequalities leave more room for P
  // than the equation (8).
  const double ratio = switched.gamma * switched.level / (linear.gamma * linear.level);
  EXPECT_LT(ratio, 1.001);
  EXPECT_GT(ratio, 0.5);
  const auto noise = linear_error_bound(
      ContinuousLinearEso<2>::Config{.observer_bandwidth = 20.0, .input_gain = 1.0},
      {.measurement_noise = 1.0});
  EXPECT_NEAR(noise->level * noise->rate, 8000.0 * std::sqrt(19.0), 1e-6);
}

/// k(e) l of the nonlinear observer, kept in [least, greatest].
template <int Size>
struct Saturated {
  EigenMatrix<double, Size> unit;
  double least, greatest;
  [[nodiscard]] EigenMatrix<double, Size> gain(double, double e) const {
    const double k = 0.05 * std::pow(std::abs(e) + 1e-12, -0.4) + 20.0 * std::abs(e);
    return std::clamp(k, least, greatest) * unit;
  }
};

TEST(ErrorBound, OfTheNonlinearObserverHolds) {
  constexpr int N = 4;
  const double w = 5.0;
  const ErrorSources sources{.disturbance_rate = 2.0, .measurement_noise = 0.02};
  const auto bound =
      nonlinear_error_bound<N>({.observer_bandwidth = w, .gain_min = 0.5, .gain_max = 3.0}, sources)
          .value();
  using Observer = ContinuousObserver<2, double, 2, Saturated<N>>;
  double tightest = 0.0;
  for (int seed = 0; seed < 20; ++seed) {
    Simulation<Observer> run{Observer::make(1.0, {Saturated<N>{gain_of<N>(w), 0.5, 3.0}}).value()};
    Random random(static_cast<std::uint64_t>(seed));
    EigenMatrix<double, N> initial;
    for (int i = 0; i < N; ++i) initial(i) = random.uniform(-1.0, 1.0) * std::pow(w, i);
    run.state.template head<N>() = initial;
    run.step_size = 1e-3;
    double input = 2.0;
    for (int k = 0; k < 12000; ++k) {
      if (random.index(700) == 0) input = -input;
      run.step(input, random.uniform(-0.02, 0.02));
      const auto error = run.error();
      const auto limit = bound.at(run.t, initial);
      for (int i = 0; i < N; ++i) ASSERT_LE(std::abs(error(i)), limit(i));
      if (run.t > 6.0) {
        for (int i = 0; i < N; ++i) {
          tightest = std::max(tightest, std::abs(error(i)) / bound.ultimate()(i));
        }
      }
    }
  }
  std::printf("NHOESO n = 2, k in 0.5 .. 3: bound %.1f times the largest error\n", 1.0 / tightest);
}

// Sheet 3: a common P exists for N equal poles iff rho > tan^2(pi (N-1) / (4 N)).
template <int N>
void limit_of_switching() {
  const double limit = std::pow(std::tan(std::numbers::pi * (N - 1) / (4.0 * N)), 2.0);
  const ErrorSources sources{.disturbance_rate = 1.0};
  const auto bound = [&](double rho) {
    return switched_error_bound<N>({.observer_bandwidth = 1.0, .factor_while_shrinking = rho},
                                   sources);
  };
  EXPECT_TRUE(bound(1.05 * limit).has_value()) << N;
  const auto refused = bound(0.95 * limit);
  ASSERT_FALSE(refused.has_value()) << N;
  EXPECT_STREQ(refused.error().rule, "has no Lyapunov matrix common to all modes");
}

TEST(LyapunovMatrix, ExistsUpToTheKnownLimits) {
  limit_of_switching<3>();
  limit_of_switching<4>();
  // Sheet 4: k_min >= (N-1)/(2N) for any k_max.
  const ErrorSources sources{.disturbance_rate = 1.0};
  EXPECT_TRUE(nonlinear_error_bound<3>({1.0, 0.35, 1e3}, sources).has_value());
  EXPECT_EQ(refusal(nonlinear_error_bound<3>({1.0, 0.32, 1e3}, sources)),
            "system: has no Lyapunov matrix common to all modes");
  EXPECT_TRUE(nonlinear_error_bound<4>({1.0, 0.39, 1e3}, sources).has_value());
  EXPECT_EQ(refusal(nonlinear_error_bound<4>({1.0, 0.36, 1e3}, sources)),
            "system: has no Lyapunov matrix common to all modes");
}

template <int N>
void expect_inequality(const EigenMatrix<double, N, N>& a, const LyapunovMatrix<N>& p) {
  const EigenMatrix<double, N, N> sum = a.transpose() * p.p + p.p * a;
  Random random(3);
  for (int i = 0; i < 300; ++i) {
    EigenMatrix<double, N> x;
    for (int j = 0; j < N; ++j) x(j) = random.uniform(-1.0, 1.0);
    EXPECT_LE(x.dot(sum * x), -x.squaredNorm() * (1.0 - 1e-9));
    EXPECT_GE(x.dot(p.p * x), p.smallest * x.squaredNorm() * (1.0 - 1e-12));
    EXPECT_LE(x.dot(p.p * x), p.largest * x.squaredNorm() * (1.0 + 1e-12));
  }
}

TEST(LyapunovMatrix, SatisfiesItsInequalities) {
  const auto slow = scaled_error_matrix<3>(binomial_gain<3>(0.5));
  const auto fast = scaled_error_matrix<3>(binomial_gain<3>());
  const auto both = common_lyapunov_matrix<3>(std::array{slow, fast}).value();
  expect_inequality<3>(slow, both);
  expect_inequality<3>(fast, both);
  expect_inequality<3>(0.3 * slow + 0.7 * fast, both);
  const auto one = lyapunov_matrix<3>(fast).value();
  const EigenMatrix<double, 3, 3> left =
      fast.transpose() * one.p + one.p * fast + EigenMatrix<double, 3, 3>::Identity();
  EXPECT_LT(left.cwiseAbs().maxCoeff(), 1e-13);
  // The solution of the equation is one of those that the inequality allows.
  const auto best = common_lyapunov_matrix<3>(std::array{fast}).value();
  EXPECT_LT(best.gamma() * best.largest, 1.001 * one.gamma() * one.largest);
  EXPECT_EQ(refusal(lyapunov_matrix<3>(-fast)),
            "system: is not stable: the stationary covariance does not exist");
}

TEST(ErrorBound, RefusesBadSettings) {
  const ErrorSources fine{.disturbance_rate = 1.0};
  using Linear = ContinuousLinearEso<2>::Config;
  EXPECT_EQ(refusal(linear_error_bound(Linear{.observer_bandwidth = 0.0}, fine)),
            "observer_bandwidth: must be finite and positive");
  EXPECT_EQ(
      refusal(linear_error_bound(Linear{.observer_bandwidth = 1.0}, {.disturbance_rate = -1.0})),
      "disturbance_rate: must be finite and not negative");
  EXPECT_EQ(refusal(switched_error_bound<3>({1.0, 0.0, 1.0}, fine)),
            "factor_while_shrinking: must be finite and positive");
  EXPECT_EQ(refusal(switched_error_bound<3>({1.0, 0.7, std::nan("")}, fine)),
            "factor_otherwise: must be finite and positive");
  for (const double bad : {-1.0, std::nan(""), std::numeric_limits<double>::infinity()}) {
    const std::pair<ErrorSources, const char*> sources[] = {
        {{.disturbance_rate = bad}, "disturbance_rate: must be finite and not negative"},
        {{.measurement_noise = bad}, "measurement_noise: must be finite and not negative"}};
    for (const auto& [source, expected] : sources) {
      EXPECT_EQ(refusal(linear_error_bound(Linear{.observer_bandwidth = 1.0}, source)), expected);
      EXPECT_EQ(refusal(switched_error_bound<3>({1.0, 0.9, 1.0}, source)), expected);
      EXPECT_EQ(refusal(nonlinear_error_bound<3>({1.0, 0.8, 1.0}, source)), expected);
    }
    EXPECT_EQ(refusal(switched_error_bound<3>({bad, 0.9, 1.0}, fine)),
              "observer_bandwidth: must be finite and positive");
    EXPECT_EQ(refusal(nonlinear_error_bound<3>({bad, 0.8, 1.0}, fine)),
              "observer_bandwidth: must be finite and positive");
  }
  EXPECT_EQ(refusal(nonlinear_error_bound<3>({1.0, 0.5, 0.4}, fine)),
            "gain_max: must be finite and not below gain_min");
  using Cascade = ContinuousCascadeEso<2, 2>::Config;
  const auto refused = cascade_error_bounds<2>(
      Cascade{.observer_bandwidth = 1.0, .bandwidth_factor = 0.5, .input_gain = 1.0}, fine);
  ASSERT_EQ(refusal(refused), "bandwidth_factor: must be finite and above");
  const auto bound = linear_error_bound(Linear{.observer_bandwidth = 1.0}, {}).value();
  EXPECT_EQ(refusal(bound.convergence_time(EigenMatrix<double, 3>::Ones())),
            "level: must be positive: a bound of zero is never reached");
  const auto some = linear_error_bound(Linear{.observer_bandwidth = 1.0}, fine).value();
  EXPECT_EQ(refusal(some.convergence_time(EigenMatrix<double, 3>::Ones(), 0.0)),
            "excess: must be finite and positive");
  EXPECT_EQ(some.convergence_time(EigenMatrix<double, 3>::Zero()).value(), 0.0);
}

TEST(ErrorBound, IsANumberOrRefused) {
  const auto bound =
      linear_error_bound<3>({.observer_bandwidth = 2, .input_gain = 1}, {5, 1e-3}).value();
  EXPECT_TRUE(bound.convergence_time({1, 2, 3}));
  EXPECT_EQ(refusal(bound.convergence_time({1, 2, HUGE_VAL})), "initial[2]: must be finite");
  EXPECT_EQ(refusal(bound.convergence_time({1, std::numeric_limits<double>::max(), 3})),
            "initial: leaves the range of the scalar in the scaling of the bound");
  const std::string rule =
      "observer_bandwidth: gives with these sources a bound that the scalar cannot hold";
  EXPECT_EQ(
      refusal(linear_error_bound<3>({.observer_bandwidth = 2e-209, .input_gain = 1}, {0, 1e-3})),
      rule);
  EXPECT_EQ(refusal(linear_error_bound<3>({.observer_bandwidth = 2, .input_gain = 1},
                                          {5, std::numeric_limits<double>::max()})),
            rule);
  EXPECT_EQ(refusal(switched_error_bound<3>({1e306, 0.7, 1}, {5, 1e-3})), rule);
  EXPECT_EQ(refusal(cascade_error_bounds<2, 3, 2>(
                {.observer_bandwidth = 1e120, .bandwidth_factor = 2, .input_gain = 1}, {5, 1e-3})),
            rule);
}

}  // namespace examples_error_bound_test
