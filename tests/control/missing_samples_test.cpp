// Lost, bad and late samples: what they cost, and what happens without care.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <utility>
#include <vector>

#include "loop_traits.hpp"

namespace esokit_test {
namespace control_missing_samples_test {

using esokit::LinearEso;
using esokit::VariableTime;

using Matrix = std::vector<std::vector<double>>;

Matrix product(const Matrix& a, const Matrix& b) {
  Matrix c(a.size(), std::vector<double>(a.size()));
  for (std::size_t i = 0; i < a.size(); ++i) {
    for (std::size_t k = 0; k < a.size(); ++k) {
      for (std::size_t j = 0; j < a.size(); ++j) c[i][j] += a[i][k] * b[k][j];
    }
  }
  return c;
}

/// lim norm(A^m)^(1/m), of m = 2^40.
double spectral_radius(Matrix a) {
  double log_of_scale = 0;
  for (int squarings = 0; squarings < 40; ++squarings) {
    double norm = 0;
    for (const auto& row : a) {
      for (const double x : row) norm = std::max(norm, std::abs(x));
    }
    for (auto& row : a) {
      for (double& x : row) x /= norm;
    }
    log_of_scale += std::ldexp(std::log(norm), -squarings);
    a = product(a, a);
  }
  return std::exp(log_of_scale);
}

/// Of the error over `every` predictions and one correction, from the chain's matrices and the gain
/// that is read off the observer.
template <int Order>
double spectral_radius(double omega_t, int every, bool follow) {
  auto observer =
      LinearEso<Order>::make({.observer_bandwidth = omega_t, .input_gain = 1, .sample_time = 1})
          .value();
  for (int i = 0; i < (follow ? every : 1); ++i) observer.predict(0);
  observer.correct(1);
  constexpr std::size_t size = Order + 1;
  Matrix error(size, std::vector<double>(size));
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = i; j < size; ++j) {
      const int power = static_cast<int>(j - i);
      error[i][j] = std::pow(every, power) / factorial_of(power);
    }
  }
  const auto first = error[0];
  for (std::size_t i = 0; i < size; ++i) {
    const double gain = observer.estimate()(static_cast<int>(i));
    for (std::size_t j = 0; j < size; ++j) error[i][j] -= gain * first[j];
  }
  return spectral_radius(error);
}

template <int Order>
int longest_step(double omega_t) {
  return 1 +
         LinearEso<Order>::make({.observer_bandwidth = omega_t, .input_gain = 1, .sample_time = 1})
             .value()
             .max_gap();
}

template <int Order>
void periodic_patterns(int& diverging) {
  for (const double omega_t : {0.1, 1.0, 3.0}) {
    for (int every = 1; every <= 20; ++every) {
      if (spectral_radius<Order>(omega_t, every, false) > 1) ++diverging;
      if (every > longest_step<Order>(omega_t)) continue;
      SCOPED_TRACE(::testing::Message()
                   << "N = " << Order + 1 << ", omega T = " << omega_t << ", one in " << every);
      // All poles at rho^M; as an N-fold one it is known to an N-th root of the rounding, which
      // counts in units of the gains, (M T)^r.
      const double rho = std::exp(-omega_t * every);
      const double radius = spectral_radius<Order>(omega_t, every, true);
      EXPECT_LT(radius, 1);
      EXPECT_NEAR(radius, rho, 0.25);
    }
  }
}

TEST(MissingSamples, EveryPeriodicPatternIsStable) {
  int diverging = 0;
  periodic_patterns<1>(diverging);
  periodic_patterns<2>(diverging);
  periodic_patterns<3>(diverging);
  periodic_patterns<4>(diverging);
  std::printf("with the gain of one sample time %d of the 240 patterns diverge\n", diverging);
  EXPECT_GT(diverging, 50);
  // The number of DESIGN.md.
  EXPECT_NEAR(spectral_radius<2>(1, 3, false), 1.66, 0.01);
}

/// dhat after 200 corrections from (1, 0, ..) at y = 0, with `a` and `b` samples to each in turn.
template <class Observer>
double two_gaps_in_turn(Observer observer, int a, int b) {
  EXPECT_EQ(observer.reset(1.0), StepStatus::ok);
  int restarts = 0;
  for (int k = 0; k < 200; ++k) {
    for (int i = 0; i < (k % 2 == 0 ? a : b); ++i) observer.predict(0);
    const bool owes = observer.restarts();
    EXPECT_FALSE(owes && observer.recovering() == 0);
    EXPECT_EQ(observer.correct(0), owes ? StepStatus::restarted : StepStatus::gap_bridged);
    restarts += owes;
  }
  EXPECT_EQ(restarts > 0, b > observer.max_gap() + 1);
  return observer.total_disturbance();
}

/// With the gains for the gaps 3 and 16 ms in turn dhat was 1.5e32, 9 and 101 ms 2e11, and the
/// steps of VariableTime 1.5e32.
TEST(MissingSamples, TwoGapsInTurnDoNotDiverge) {
  const auto third =
      LinearEso<3>::make({.observer_bandwidth = 460, .input_gain = 1, .sample_time = 1e-3}).value();
  EXPECT_EQ(third.max_gap(), 9);
  EXPECT_EQ(two_gaps_in_turn(third, 3, 16), 0);
  EXPECT_NEAR(two_gaps_in_turn(third, 3, 10), 0, 1e-6);
  const auto second =
      LinearEso<2>::make({.observer_bandwidth = 200, .input_gain = 1, .sample_time = 1e-3}).value();
  EXPECT_EQ(second.max_gap(), 69);
  EXPECT_EQ(two_gaps_in_turn(second, 9, 101), 0);
  EXPECT_NEAR(two_gaps_in_turn(second, 9, 70), 0, 1e-6);

  // Without a lost sample: 5 / omega_o = 10.87 ms, below that all steps of the shortest, 0.998 ms.
  auto timed = VariableTime<LinearEso<3>>::make(
                   {.observer = {.observer_bandwidth = 460, .input_gain = 1, .sample_time = 4e-3},
                    .ratio = 4.01})
                   .value();
  for (const double longest : {9.97e-3, 9.98e-3, 16e-3}) {
    timed.reset(1.0);
    for (int k = 0; k < 400; ++k) {
      ASSERT_TRUE(timed.set_step_time(k % 2 == 0 ? 3e-3 : longest).has_value());
      const StepStatus status = timed.update(0, 0);
      EXPECT_EQ(status, k % 2 == 1 && longest > 9.975e-3 ? StepStatus::restarted : StepStatus::ok);
    }
    EXPECT_NEAR(timed.total_disturbance(), 0, 1e-6) << longest;
  }
  // If not even the nominal step is within the range, the ratio is refused.
  const auto refused = VariableTime<LinearEso<4>>::make(
      {.observer = {.observer_bandwidth = 1000, .input_gain = 1, .sample_time = 4e-3}, .ratio = 2});
  ASSERT_FALSE(refused.has_value());
  EXPECT_STREQ(refused.error().field, "ratio");
  EXPECT_EQ(refused.error().value, 2);
  EXPECT_NEAR(refused.error().limit, 2e-3, 1e-15);
  // A gap counts as the time that it takes.
  ASSERT_TRUE(timed.set_step_time(4e-3).has_value());
  for (const int steps : {2, 3}) {
    for (int i = 0; i < steps; ++i) timed.predict(0);
    EXPECT_EQ(timed.restarts(), steps == 3);
    EXPECT_EQ(timed.correct(0), steps == 3 ? StepStatus::restarted : StepStatus::gap_bridged);
  }
}

/// The whole controller in a loop, one measurement in M.
TEST(MissingSamples, LoopWithOneMeasurementInM) {
  for (const int every : {1, 2, 5, 10, 20}) {
    auto controller =
        Adrc<LinearEso<2>>::make(
            {.observer = {.observer_bandwidth = 100, .input_gain = 2, .sample_time = 1e-3},
             .controller_bandwidth = 8})
            .value();
    ChainPlant plant(2, 1e-3, 2, -3);
    for (int k = 0; k < 6000; ++k) {
      const double u = k % every == every - 1 ? controller.update(plant.output(), 1.0)
                                              : controller.update_without_measurement(1.0);
      plant.step(u);
    }
    EXPECT_NEAR(plant.output(), 1, 1e-9) << every;
    EXPECT_EQ(controller.mode(), LoopMode::running);
  }
}

struct Faults {
  double missing = 0;
  double bad = 0;
  double jitter = 0;
};

/// RMS of r - y while following a sine under a sine disturbance, noise on y.
double tracking_error(const Faults& faults, bool follow_time = true) {
  constexpr double nominal = 2e-3;
  auto controller =
      Adrc<VariableTime<LinearEso<2>>>::make({.observer = {.observer = {.observer_bandwidth = 120,
                                                                        .input_gain = 2,
                                                                        .sample_time = nominal},
                                                           .ratio = 1.5},
                                              .controller_bandwidth = 20,
                                              .limits = {.lower = -60, .upper = 60}})
          .value();
  Random random(11);
  double t = 0, y = 0, v = 0, sum = 0, time = 0;
  double u = 0, dt = nominal;
  for (int k = 0; k < 20000; ++k) {
    if (follow_time) {
      EXPECT_TRUE(controller.set_step_time(dt).has_value());
    }
    const double r = std::sin(2 * t);
    const esokit::EigenMatrix<double, 3> reference(r, 2 * std::cos(2 * t), -4 * std::sin(2 * t));
    double measured = y + 2e-4 * random.uniform(-1, 1);
    if (random.uniform(0, 1) < faults.bad) measured = hidden_nan<double>();
    u = random.uniform(0, 1) < faults.missing ? controller.update_without_measurement(reference)
                                              : controller.update(measured, reference);
    if (t > 2) {
      sum += (r - y) * (r - y) * dt;
      time += dt;
    }
    // Euler in fine steps over a sample of its own length.
    dt = nominal * (1 + faults.jitter * random.uniform(-1, 1));
    for (int i = 0; i < 10; ++i) {
      const double a = 5 * std::sin(7 * t) - 1.5 * v + 2 * u;
      y += dt / 10 * v;
      v += dt / 10 * a;
      t += dt / 10;
    }
  }
  return std::sqrt(sum / time);
}

TEST(MissingSamples, CostOfFaults) {
  const double clean = tracking_error({});
  const double missing = tracking_error({.missing = 0.1, .bad = 0, .jitter = 0});
  const double bad = tracking_error({.missing = 0, .bad = 0.01, .jitter = 0});
  const double jitter = tracking_error({.missing = 0, .bad = 0, .jitter = 0.2});
  const double all = tracking_error({.missing = 0.1, .bad = 0.01, .jitter = 0.2});
  std::printf(
      "rms tracking error: clean %.3g, 10 %% missing %.3g, 1 %% NaN %.3g, 20 %% jitter %.3g, all "
      "%.3g\n",
      clean, missing, bad, jitter, all);
  EXPECT_LT(missing, 1.5 * clean);
  EXPECT_LT(bad, 1.1 * clean);
  EXPECT_LT(jitter, 1.5 * clean);
  EXPECT_LT(all, 2 * clean);
}

}  // namespace control_missing_samples_test
}  // namespace esokit_test
