// VariableTime, KnownModel, WrappedOutput: what the controller laws do not say.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace adapter_decorators_test {

using esokit::LinearEso;
using esokit::StepStatus;
using esokit::VariableTime;

constexpr double nominal = 0.01;

LinearEso<2>::Config settings(double T = nominal) {
  return {.observer_bandwidth = 30, .input_gain = 2, .sample_time = T};
}

VariableTime<LinearEso<2>> variable(double ratio = 5) {
  return VariableTime<LinearEso<2>>::make({.observer = settings(), .ratio = ratio}).value();
}

/// Steps of any length on a plant with constant disturbance: each step acts as an observer that is
/// made for its length, from the same state.
TEST(VariableTime, EachStepIsThatOfAnObserverOfItsLength) {
  auto observer = variable();
  Random random(1);
  for (int k = 0; k < 300; ++k) {
    const double dt = nominal * std::exp(random.uniform(-1.5, 1.5));
    auto fresh = LinearEso<2>::make(settings(dt)).value();
    fresh.reset(observer.estimate());
    const double y = random.uniform(-1, 1);
    const double u = random.uniform(-1, 1);
    ASSERT_TRUE(observer.set_step_time(dt).has_value());
    ASSERT_EQ(observer.update(y, u), StepStatus::ok);
    fresh.update(y, u);
    EXPECT_EQ(observer.step_time(), dt);
    for (int r = 0; r < 3; ++r) {
      ASSERT_NEAR(observer.estimate()(r), fresh.estimate()(r),
                  1e-11 * (1 + std::abs(fresh.estimate()(r))))
          << k << ' ' << r;
    }
  }
}

/// Over a gap of unequal steps the gain is that of their sum.
TEST(VariableTime, GapOfUnequalSteps) {
  for (const int missing : {1, 4}) {
    auto observer = variable();
    Random random(2);
    esokit::EigenMatrix<double, 3> start(0.3, -2, 7);
    observer.reset(start);
    double total = 0;
    const double u = 0.5;
    for (int k = 0; k <= missing; ++k) {
      const double dt = nominal * (k % 2 == 0 ? 0.4 : 3);
      total += dt;
      ASSERT_TRUE(observer.set_step_time(dt).has_value());
      if (k < missing) {
        observer.predict(u);
      } else {
        EXPECT_EQ(observer.update(1.0, u), StepStatus::gap_bridged);
      }
    }
    auto slow = LinearEso<2>::make(settings(total)).value();
    slow.reset(start);
    slow.update(1.0, u);
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(observer.estimate()(r), slow.estimate()(r),
                  1e-11 * (1 + std::abs(slow.estimate()(r))));
    }
    // And the next step is an ordinary one again.
    ASSERT_TRUE(observer.set_step_time(nominal).has_value());
    auto next = LinearEso<2>::make(settings()).value();
    next.reset(observer.estimate());
    EXPECT_EQ(observer.update(0.9, u), StepStatus::ok);
    next.update(0.9, u);
    EXPECT_NEAR(observer.estimate()(2), next.estimate()(2), 1e-9);
  }
}

/// After a retune steps are nominal until another length is said, and then of that length.
TEST(VariableTime, StepsFollowAfterARetune) {
  auto observer = variable();
  auto same = variable();
  ASSERT_TRUE(observer.set_step_time(0.02).has_value());
  ASSERT_TRUE(same.set_step_time(0.02).has_value());
  observer.update(1, 0.5);
  same.update(1, 0.5);
  ASSERT_TRUE(observer.retune({.observer = settings(), .ratio = 5}).has_value());
  EXPECT_EQ(observer.step_time(), nominal);
  for (const double step : {0.02, 0.02, 0.03}) {
    ASSERT_TRUE(observer.set_step_time(step).has_value());
    ASSERT_TRUE(same.set_step_time(step).has_value());
    observer.update(2, 0.5);
    same.update(2, 0.5);
    EXPECT_EQ(observer.sample_time(), step);
    EXPECT_NEAR(observer.total_disturbance(), same.total_disturbance(),
                1e-12 * std::abs(same.total_disturbance()));
  }
}

/// The observer must be a good one at both ends of the range, from either side of either limit.
TEST(VariableTime, BothEndsOfTheRangeAreChecked) {
  using Observer = LinearEso<2>;
  const auto good = [](double T) { return Observer::make(settings(T)).has_value(); };
  /// Where `good` changes between two sample times.
  const auto edge = [&](double inside, double outside) {
    for (int i = 0; i < 200; ++i) {
      const double middle = std::sqrt(inside) * std::sqrt(outside);
      (good(middle) ? inside : outside) = middle;
    }
    return inside;
  };
  const double least = edge(nominal, 1e-300);
  const double most = edge(nominal, 1e300);
  ASSERT_FALSE(good(least / 1.01));
  ASSERT_FALSE(good(most * 1.01));
  const auto made = [](double T) {
    return VariableTime<Observer>::make({.observer = settings(T), .ratio = 4}).has_value();
  };
  EXPECT_FALSE(made(3.9 * least));
  EXPECT_TRUE(made(4.1 * least));
  EXPECT_TRUE(made(most / 4.1));
  EXPECT_FALSE(made(most / 3.9));
}

TEST(VariableTime, OutsideItsRatioIsRefused) {
  auto observer = variable(2);
  for (const double bad :
       {0.0, -1.0, 0.0049, 0.0201, hidden_nan<double>(), hidden_infinity<double>()}) {
    const auto refused = observer.set_step_time(bad);
    ASSERT_EQ(refusal(refused), bad == 0.0201 ? "step_time: must be at most"
                                              : "step_time: must be finite and at least")
        << bad;
    EXPECT_EQ(observer.step_time(), nominal);
  }
  EXPECT_TRUE(observer.set_step_time(0.005).has_value());
  EXPECT_TRUE(observer.set_step_time(0.02).has_value());
  EXPECT_EQ(refusal(VariableTime<LinearEso<2>>::make({.observer = settings(), .ratio = 1})),
            "ratio: must be finite and above");
  // The same steps as the observer alone, bit for bit.
  auto same = variable();
  auto plain = LinearEso<2>::make(settings()).value();
  for (int k = 0; k < 30; ++k) {
    same.update(0.1 * k, 0.5);
    plain.update(0.1 * k, 0.5);
    EXPECT_TRUE(same_bits(same.total_disturbance(), plain.total_disturbance()));
  }
}

/// Every other observer: unbiased on a double integrator with constant disturbance, whatever the
/// steps.
template <class Observer>
void unbiased_with_jitter(const typename Observer::Config& config, double tolerance) {
  auto observer = VariableTime<Observer>::make({.observer = config, .ratio = 2}).value();
  Random random(3);
  double y = 0.2, v = -1;
  for (int k = 0; k < 1200; ++k) {
    const double dt = nominal * (1 + 0.3 * random.uniform(-1, 1));
    const double a = -3 + 2 * 0.5;
    y += dt * v + dt * dt / 2 * a;
    v += dt * a;
    ASSERT_TRUE(observer.set_step_time(dt).has_value());
    if (k % 10 == 9) {
      observer.predict(0.5);
    } else {
      observer.update(y, 0.5);
    }
  }
  EXPECT_NEAR(observer.total_disturbance(), -3, tolerance);
  EXPECT_NEAR(observer.template estimate<1>(), v, tolerance);
}

TEST(VariableTime, EveryObserver) {
  unbiased_with_jitter<LinearEso<2>>(settings(), 1e-7);
  unbiased_with_jitter<esokit::CascadeEso<2, 2>>(
      {.observer_bandwidth = 30, .bandwidth_factor = 2, .input_gain = 2, .sample_time = nominal},
      1e-7);
  unbiased_with_jitter<esokit::AlgebraicEso<2>>(
      {.observer_bandwidth = 30, .frequency_shift = 5, .input_gain = 2, .sample_time = nominal},
      1e-7);
  unbiased_with_jitter<esokit::NonlinearEso<2, double, 1>>(
      {.observer_bandwidth = 30,
       .shape = {.gain_alpha = 0.8, .alpha = 1, .gain_beta = 0.2, .beta = 1},
       .input_gain = 2,
       .sample_time = nominal},
      1e-7);
}

// ---- known model

/// A pendulum: fbar = -a sin y - b y'.
struct Pendulum {
  static constexpr esokit::PlantModelTraits traits{.validates = true};
  double gravity{};
  double damping{};
  [[nodiscard]] esokit::Check<double> validate() const {
    return esokit::Rules<double>{}
        .finite("model.gravity", gravity)
        .finite("model.damping", damping);
  }
  double operator()(const esokit::Vector<double, 3>& z) const noexcept {
    return -(gravity * std::sin(z(0))) - damping * z(1);
  }
};

/// y'' = -4 sin y - 3 y' + 5 + 2 u: what is left over is the 5, the better the shorter T.
TEST(KnownModel, EstimatesOnlyTheRest) {
  using Known = esokit::KnownModel<LinearEso<2>, Pendulum>;
  const auto worst_rest = [](double T, bool known) {
    auto config = settings(T);
    config.observer_bandwidth = 10;
    auto model = Known::make({.observer = config, .model = {4, 3}}).value();
    auto plain = LinearEso<2>::make(config).value();
    double y = 0, v = 0, worst = 0;
    const int count = static_cast<int>(8 / T);
    double u = 0;
    for (int k = 0; k < count; ++k) {
      model.update(y, u);
      plain.update(y, u);
      const double t = k * T;
      const double rest = known ? model.residual_disturbance()
                                : plain.total_disturbance() + 4 * std::sin(y) + 3 * v;
      if (t > 3) worst = std::max(worst, std::abs(rest - 5));
      EXPECT_NEAR(model.total_disturbance(), model.known_part() + model.residual_disturbance(),
                  1e-12);
      u = 3 * std::sin(4 * t);
      for (int i = 0; i < 20; ++i) {
        const double h = T / 20;
        const double a = -4 * std::sin(y) - 3 * v + 5 + 2 * u;
        y += h * v + h * h / 2 * a;
        v += h * (a - h / 2 * (4 * std::cos(y) * v + 3 * a));
      }
    }
    return worst;
  };
  const double coarse = worst_rest(0.004, true);
  const double fine = worst_rest(0.002, true);
  EXPECT_LT(fine, 0.1);
  EXPECT_GT(worst_rest(0.002, false), 10 * fine);
  EXPECT_NEAR(std::log2(coarse / fine), 1, 0.3);
}

TEST(KnownModel, RetuneAndResetKeepTheSum) {
  using Known = esokit::KnownModel<LinearEso<2>, Pendulum>;
  auto observer = Known::make({.observer = settings(), .model = {4, 3}}).value();
  Random random(4);
  for (int k = 0; k < 50; ++k) observer.update(random.uniform(-1, 1), random.uniform(-1, 1));
  const auto before = observer.estimate();
  const double u = observer.applied_input();
  auto changed = settings();
  ASSERT_TRUE(observer.retune({.observer = changed, .model = {1, -2}}).has_value());
  EXPECT_NEAR(observer.total_disturbance(), before(2), 1e-9 * std::abs(before(2)) + 1e-9);
  EXPECT_NEAR(observer.residual_disturbance(), before(2) + std::sin(before(0)) - 2 * before(1),
              1e-6);
  // b0: only u's share moves.
  changed.input_gain = 5;
  ASSERT_TRUE(observer.retune({.observer = changed, .model = {1, -2}}).has_value());
  EXPECT_NEAR(observer.total_disturbance(), before(2) + (2 - 5) * u,
              1e-9 * std::abs(before(2)) + 1e-9);
  const esokit::EigenMatrix<double, 3> state(1, 2, 30);
  EXPECT_EQ(observer.reset(state), StepStatus::ok);
  EXPECT_NEAR(eigen(observer.estimate() - state).norm(), 0, 1e-9);
  EXPECT_NEAR(observer.residual_disturbance(), 30 + std::sin(1.0) - 4, 1e-9);
  EXPECT_NEAR(observer.estimate<2>(), 30, 1e-9);
  EXPECT_EQ(observer.update(1, hidden_nan<double>()), StepStatus::input_rejected);
  EXPECT_EQ(observer.applied_input(), u);
  EXPECT_EQ(refusal(Known::make({.observer = settings(), .model = {1, hidden_nan<double>()}})),
            "model.damping: must be finite");
}

// ---- angle

TEST(WrappedOutput, MeasurementsInAnyBranch) {
  using Angle = esokit::WrappedOutput<esokit::CascadeEso<2, 2>>;
  const esokit::CascadeEso<2, 2>::Config inner{
      .observer_bandwidth = 30, .bandwidth_factor = 2, .input_gain = 2, .sample_time = nominal};
  auto angle = Angle::make({.observer = inner, .period = 360}).value();
  auto plain = esokit::CascadeEso<2, 2>::make(inner).value();
  Random random(6);
  for (int k = 0; k < 3000; ++k) {
    const double y = 700 * std::sin(0.003 * k) + k;
    if (k % 50 == 20) {
      angle.predict(0.1);
      plain.predict(0.1);
    } else {
      angle.update(y + 360 * (random.index(9) - 4), 0.1);
      plain.update(y, 0.1);
    }
    ASSERT_NEAR(angle.total_disturbance(), plain.total_disturbance(), 1e-6) << k;
    ASSERT_NEAR(angle.innovation(), plain.innovation(), 1e-8);
    ASSERT_LE(std::abs(angle.estimate<0>()), 180 + 1e-9);
    ASSERT_NEAR(angle.wrap(angle.estimate<0>() - plain.estimate<0>()), 0, 1e-8);
  }
  EXPECT_EQ(angle.update(hidden_nan<double>(), 0.1), StepStatus::measurement_rejected);
  EXPECT_EQ(angle.reset(1000.0), StepStatus::ok);
  EXPECT_NEAR(angle.estimate<0>(), -80, 1e-9);
}

using Axis = esokit::WrappedOutput<LinearEso<2>>;

Axis axis(double omega_T, double turn = 360) {
  return Axis::make({.observer = {.observer_bandwidth = omega_T / nominal,
                                  .input_gain = 2,
                                  .sample_time = nominal},
                     .period = turn})
      .value();
}

double branch(double angle) { return angle - 360 * std::floor(angle / 360); }

/// One bad angle, one bad u: with the innovation taken modulo the period each speed + k period / T
/// is an equilibrium, and these find them.
TEST(WrappedOutput, NothingButTheTruthIsAnEquilibrium) {
  for (const double omega_T : {0.1, 0.7, 1.0, 2.0, 4.0}) {
    for (const double speed : {0.0, 80.0, -170.0}) {  // degrees a sample
      for (const int kind : {0, 1, 2}) {
        auto angle = axis(omega_T);
        double y = 120;
        int assumed = 0;
        for (int k = 0; k < 8500; ++k) {
          const double bad_y = kind == 0 && k == 500 ? -149 : 0;
          const double bad_u = kind == 1 && k == 500 ? 4e8 : kind == 2 && k == 500 ? -1e300 : 0;
          const StepStatus status = angle.update(branch(y + bad_y), bad_u);
          if (status != StepStatus::ok) {
            EXPECT_EQ(status, StepStatus::turn_assumed) << k;
            EXPECT_EQ(kind, 0);
            ++assumed;
          }
          if (k < 8499) y += speed;
        }
        EXPECT_EQ(assumed, kind == 0 ? 2 : 0);
        EXPECT_NEAR(angle.estimate<1>() * nominal, speed, 1e-6) << omega_T << ' ' << kind;
        EXPECT_NEAR(angle.wrap(angle.estimate<0>() - y), 0, 1e-6) << omega_T << ' ' << kind;
        EXPECT_NEAR(angle.total_disturbance() * nominal * nominal, 0, 1e-6);
      }
    }
  }
}

/// An outlier off by less than half a turn shifts no turn: after it the estimate is that of an
/// observer of the angle without jumps. One that fits the motion is not reported, one beside it by
/// more than a quarter of a turn is.
TEST(WrappedOutput, OutlierShiftsNoTurn) {
  for (const double off : {-179.0, -91.0, -79.0, 30.0, 79.0, 91.0, 149.0, 179.0}) {
    auto angle = axis(0.2);
    auto plain =
        LinearEso<2>::make({.observer_bandwidth = 20, .input_gain = 2, .sample_time = nominal})
            .value();
    plain.reset(5.0);
    angle.reset(5.0);
    for (int k = 0; k < 200; ++k) {
      const double y = 5 + 3.0 * k + (k == 100 ? off : 0);
      const StepStatus status = angle.update(branch(y), 0.1);
      plain.update(y, 0.1);
      EXPECT_EQ(has(status, StepStatus::turn_assumed), std::abs(off) > 90 && (k == 100 || k == 101))
          << off << ' ' << k;
    }
    EXPECT_NEAR(angle.estimate<1>(), plain.estimate<1>(), 1e-6) << off;
    EXPECT_NEAR(angle.total_disturbance(), plain.total_disturbance(), 1e-5) << off;
  }
}

/// Over a gap of many turns: the motion goes on as it was.
TEST(WrappedOutput, GapsAtSpeed) {
  for (const int gap : {2, 7, 40}) {
    for (const double speed : {100.0, -170.0}) {
      auto angle = axis(0.3);
      double y = 0;
      for (int k = 0; k < 400; ++k) {
        y += speed;
        if (k > 200 && k % (gap + 5) < gap - 1) {
          angle.predict(0);
        } else {
          const StepStatus status = angle.update(branch(y), 0);
          EXPECT_FALSE(has(status, StepStatus::turn_assumed)) << k;
        }
        if (k > 200) {
          ASSERT_NEAR(angle.estimate<1>() * nominal, speed, 1e-6) << k << ' ' << gap;
        }
      }
    }
  }
}

/// A measurement at every fourth sample and no other: what holds for neighbours holds for these; a
/// wrong u leaves no other equilibrium either.
TEST(WrappedOutput, EveryFourthSample) {
  for (const double speed : {-40.0, 0.0, 30.0}) {
    auto angle = axis(0.3);
    double y = 0;
    for (int k = 0; k < 1600; ++k) {
      y += speed;
      const double u = k == 400 ? 1e6 : 0;
      if (k % 4 != 3) {
        angle.predict(u);
      } else {
        angle.update(branch(y), u);
      }
    }
    EXPECT_NEAR(angle.estimate<1>() * nominal, speed, 1e-6);
    EXPECT_NEAR(angle.wrap(angle.estimate<0>() - y), 0, 1e-6);
  }
}

/// Neighbours that stay away: the motion that they had is not taken for theirs for ever.
TEST(WrappedOutput, MotionOfNeighboursIsForgotten) {
  auto angle = axis(0.3);
  double y = 0;
  for (int k = 0; k < 100; ++k) angle.update(branch(y += 170), 0);
  for (int k = 0; k < 1200; ++k) {
    y += 10;
    if (k % 4 != 3) {
      angle.predict(0);
    } else {
      angle.update(branch(y), 0);
    }
  }
  EXPECT_NEAR(angle.estimate<1>() * nominal, 10, 1e-6);
}

TEST(WrappedOutput, RefusedResetAndAbsurdAnglesChangeNothing) {
  auto angle = axis(0.3);
  for (int k = 0; k < 50; ++k) angle.update(branch(7.0 * k), 0.1);
  const double limit = 360 / (8 * std::numeric_limits<double>::epsilon());
  for (const double bad : {hidden_nan<double>(), hidden_infinity<double>(), 1.01 * limit, -1e300}) {
    auto reference = angle;
    EXPECT_EQ(reference.reset(bad), StepStatus::state_rejected);
    EXPECT_EQ(reference.estimate(), angle.estimate());
    EXPECT_EQ(reference.correct(bad), StepStatus::measurement_rejected);
    EXPECT_EQ(reference.estimate(), angle.estimate());
    for (int r = 0; r < 3; ++r) {
      esokit::EigenMatrix<double, 3> state(1, 2, 3);
      state(r) = bad;
      if (r == 0 || !std::isfinite(bad)) {
        EXPECT_EQ(reference.reset(state), StepStatus::state_rejected) << r;
      }
    }
    for (int k = 50; k < 60; ++k) {
      EXPECT_EQ(reference.update(branch(7.0 * k), 0.1), StepStatus::ok);
    }
    auto same = angle;
    for (int k = 50; k < 60; ++k) same.update(branch(7.0 * k), 0.1);
    EXPECT_EQ(reference.estimate(), same.estimate());
  }
  EXPECT_EQ(angle.reset(0.99 * limit), StepStatus::ok);
  EXPECT_LE(std::abs(angle.estimate<0>()), 180);
  // A prediction from a bad u is reported through the adapter.
  EXPECT_EQ(angle.predict(hidden_nan<double>()), StepStatus::input_rejected);
  EXPECT_EQ(angle.predict(0.1), StepStatus::ok);
  EXPECT_EQ(angle.update(1.0, hidden_nan<double>()),
            StepStatus::input_rejected | StepStatus::gap_bridged);
}

/// A retune to another period counts anew; to the same one it does not.
TEST(WrappedOutput, RetuneOfThePeriod) {
  auto angle = axis(0.3);
  for (int k = 0; k < 300; ++k) angle.update(branch(40.0 * k), 0);
  Axis::Config config{.observer = settings(), .period = 360};
  const auto before = angle.estimate();
  ASSERT_TRUE(angle.retune(config).has_value());
  EXPECT_EQ(angle.estimate(), before);
  EXPECT_EQ(angle.update(branch(40.0 * 300), 0), StepStatus::ok);
  config.period = 100;
  ASSERT_TRUE(angle.retune(config).has_value());
  EXPECT_LE(std::abs(angle.estimate<0>()), 50);
  EXPECT_NEAR(angle.estimate<1>() * nominal, 40, 1e-8);
  EXPECT_EQ(angle.update(40.0 * 301, 0), StepStatus::ok);
  config.period = -1;
  EXPECT_EQ(refusal(angle.retune(config)), "period: must be finite and positive");
  EXPECT_EQ(angle.period(), 100);
}

/// A state that turns by more than the scalar holds leaves the count, and the angle that the
/// observer is fed, without a number; the turn of such a prediction leaves no innovation.
TEST(WrappedOutput, ComesBackFromASpeedBeyondTheScalar) {
  using Angle = esokit::WrappedOutput<LinearEso<2>>;
  using Cascade = esokit::WrappedOutput<esokit::CascadeEso<2, 2>>;
  auto angle = Angle::make({.observer = {.observer_bandwidth = 4.3,
                                         .input_gain = -1,
                                         .sample_time = 0.65,
                                         .max_gap = 57},
                            .period = 6.6})
                   .value();
  angle.update(0, 0);
  angle.update(0, 0);
  ASSERT_EQ(angle.reset({0, -9.6e307, 0}), StepStatus::ok);
  bool told = false;
  for (int k = 0; k < 100; ++k) {
    angle.predict(0);
    angle.predict(0);
    told = told || has(angle.update(0, 0), StepStatus::restarted);
  }
  EXPECT_TRUE(told);
  EXPECT_NEAR(angle.estimate()(1), 0, 1e-9);

  auto cascade = Cascade::make({.observer = {.observer_bandwidth = 2,
                                             .bandwidth_factor = 2,
                                             .input_gain = 1,
                                             .sample_time = 0.2,
                                             .max_gap = 200},
                                .period = 6.5})
                     .value();
  cascade.update(0, 0);
  cascade.update(0, 9.28e306);
  for (int k = 0; k < 111; ++k) cascade.predict(0);
  for (int k = 0; k < 1000; ++k) cascade.update(0, 0);
  EXPECT_NEAR(cascade.estimate()(1), 0, 1e-9);
}

}  // namespace adapter_decorators_test
}  // namespace esokit_test
