#include "law_suite.hpp"

#include <algorithm>
#include <cmath>
#include <support/exact_plant.hpp>
#include <support/gain_comparison.hpp>
#include <support/no_allocation.hpp>

namespace esokit_test {

using esokit::has;

::testing::AssertionResult same_observer(const AnyObserver& a, const AnyObserver& b) {
  const auto same = [](Real x, Real y) {
    return std::isnan(x) ? std::isnan(y) : x == y && std::signbit(x) == std::signbit(y);
  };
  for (int level = 0; level < a->levels(); ++level) {
    for (int r = 0; r < a->size(); ++r) {
      const Real x = a->level_estimate(level, r);
      const Real y = b->level_estimate(level, r);
      if (!same(x, y)) {
        return ::testing::AssertionFailure()
               << "level " << level << ", estimate " << r << ": " << x << " and " << y;
      }
    }
  }
  if (!same(a->innovation(), b->innovation())) {
    return ::testing::AssertionFailure()
           << "innovation " << a->innovation() << " and " << b->innovation();
  }
  if (!same(a->applied_input(), b->applied_input())) {
    return ::testing::AssertionFailure()
           << "applied input " << a->applied_input() << " and " << b->applied_input();
  }
  if (a->missed() != b->missed()) {
    return ::testing::AssertionFailure() << "missed " << a->missed() << " and " << b->missed();
  }
  return ::testing::AssertionSuccess();
}

AnyObserver LawSuite::make(const Settings& settings) const {
  return kind.make(settings).observer.value();
}

AnyObserver LawSuite::make(double omega_t, double b0, int max_gap) const {
  return make({omega_t / period, period, b0, max_gap});
}

Real LawSuite::s(Real x) const {
  if (in_float) return static_cast<float>(x);
  return kind.epsilon < std::numeric_limits<double>::epsilon() ? x : static_cast<double>(x);
}

Real LawSuite::input(double x) const { return s(x / gain / nordsieck(n, period)); }

AnyObserver LawSuite::warm(double omega_t, double b0) const {
  AnyObserver observer = make(omega_t, b0);
  Random random(7);
  for (int k = 0; k < 50; ++k) {
    const Real y = random.uniform(-1, 1);
    EXPECT_EQ(observer->update(y, input(random.uniform(-1, 1))), StepStatus::ok);
  }
  return observer;
}

Real LawSuite::row_unit(int r, Real sample_time) const {
  return nordsieck(kind.degree[static_cast<std::size_t>(r)], sample_time);
}

std::vector<Real> LawSuite::unit_state(int of) const {
  return state([=](int r) { return r == of ? 1 : 0; });
}

Real LawSuite::rounding_gain(double omega_t, int from, int to) const {
  AnyObserver observer = make(omega_t);
  observer->reset(unit_state(from));
  Real sum = std::abs(observer->estimate(to));
  const int settling = settling_samples(omega_t);
  for (int i = 0; i < settling; ++i) {
    observer->update(0, 0);
    sum += std::abs(observer->estimate(to));
  }
  return p * sum;
}

int LawSuite::settling_samples(double omega_t) const {
  const double rate = std::min(1.0, omega_t * kind.slowest);
  return static_cast<int>((45 + 6 * N * p) / rate);
}

namespace {

const Real nan = hidden_nan<Real>();
const Real infinity = hidden_infinity<Real>();

struct Laws : LawSuite {
  [[nodiscard]] Settings settings(double omega_t, double b0 = gain, int max_gap = 100) const {
    return {omega_t / period, period, b0, max_gap};
  }
  [[nodiscard]] std::vector<double> omega_t_grid() const {
    std::vector<double> grid{1e-4, 1e-3, 1e-2, 0.1, 0.5, 1, 3, 6, 15, 50};
    if (in_float) grid.erase(grid.begin());
    return grid;
  }

  /// Finite, but too large to compute with: 3e38 in float.
  [[nodiscard]] Real huge() const { return hidden(s(kind.largest * 0.88L)); }

  /// x_r of the last level.
  [[nodiscard]] Real scaled(const AnyObserver& observer, int r) const {
    return observer->estimate(r) * row_unit(r, s(period));
  }

  static void expect_near(Real value, Real expected, Real tolerance) {
    EXPECT_LE(std::abs(value - expected), tolerance) << value << " and " << expected;
  }

  [[nodiscard]] bool finite(const AnyObserver& observer) const {
    for (int level = 0; level < p; ++level) {
      for (const Real z : level_values(observer, level)) {
        if (!std::isfinite(z)) return false;
      }
    }
    return std::isfinite(observer->innovation()) && std::isfinite(observer->applied_input());
  }

  [[nodiscard]] std::vector<Real> level_values(const AnyObserver& observer, int level) const {
    std::vector<Real> values;
    for (int r = 0; r < N; ++r) values.push_back(observer->level_estimate(level, r));
    return values;
  }

  static void expect_equal_estimates(const AnyObserver& a, const AnyObserver& b) {
    for (int r = 0; r < a->size(); ++r) EXPECT_EQ(a->estimate(r), b->estimate(r)) << r;
  }

  // ---- gains

  /// Each gain to a few units in the last place, for every omega_o T: a_i is good to 2 of them, its
  /// powers to 3 N, the physical gain r! / T^r k_r to 2 N more, and each level adds the rounding of
  /// its own. In double the bound is below 1e-12.
  void gains_equal_reference() const {
    if (!in_float) {
      ASSERT_LT(16 * N * p * epsilon, 1e-12L);
    }
    int compared = 0;
    for (const double omega_t : omega_t_grid()) {
      SCOPED_TRACE(omega_t);
      if (refused_for_underflow(settings(omega_t))) continue;
      AnyObserver observer = make(omega_t);
      observer->predict(0);
      ASSERT_EQ(observer->correct(1), StepStatus::ok);
      std::vector<std::vector<Real>> estimates;
      for (int level = 0; level < p; ++level) estimates.push_back(level_values(observer, level));
      compared += compare_gains(estimates, n, kind.level_poles(settings(omega_t)), s(period),
                                16 * N * p * epsilon, kind.smallest, kind.largest);
    }
    EXPECT_GT(compared, 2 * N);
  }

  /// Coefficients of the characteristic polynomial in z - 1 of level 1, from its gains: beta_j =
  /// Delta^(j-1) kappa(1), kappa(t) = sum_r k_r t^r. All terms are positive for real poles.
  void polynomial_equals_reference() const {
    for (const double omega_t : omega_t_grid()) {
      SCOPED_TRACE(omega_t);
      if (refused_for_underflow(settings(omega_t))) continue;
      AnyObserver observer = make(omega_t);
      observer->predict(0);
      observer->correct(1);
      compare_polynomial(level_values(observer, 0), kind.level_poles(settings(omega_t))[0],
                         s(period), 16 * N * epsilon);
    }
  }

  /// True if the config is refused because a gain is too small for the scalar, and rightly so.
  [[nodiscard]] bool refused_for_underflow(const Settings& of) const {
    const Made made = kind.make(of);
    EXPECT_EQ(!made, smallest_gain(kind.level_poles(of), s(of.sample_time)) < kind.smallest);
    if (made) return false;
    EXPECT_EQ(made.field, kind.field);
    return true;
  }

  // ---- truth

  /// The plant runs in whole numbers, so the measurement is exact but for its rounding to S. All
  /// scaled states are 1 or -1 in the end, so every estimate is of the same weight.
  void unbiased_on_own_model_class() const {
    // Nearly deadbeat: after p N samples only what the last ones said counts.
    const double omega_t = 10 / kind.slowest;
    const int samples = 2 * p * N + 4;  // what was rounded in the transient must go as well
    const auto size = static_cast<std::size_t>(N);
    std::vector<ExactPlant::Integer> end;
    for (int r = 0; r < N; ++r) end.push_back(r % 3 == 1 ? -1 : 1);
    ExactPlant plant(n, end);
    Random random(11);
    std::vector<int> drives;
    for (int k = 0; k < samples; ++k) drives.push_back(random.index(5) - 2);
    // Rounding j samples before the end: terms_r = sum_c C(c, r) |x_c|, all that a step adds up.
    std::vector<std::vector<double>> terms;
    for (int k = samples - 1; k >= 0; --k) {
      std::vector<double> sums(size);
      plant.step_back(drives[static_cast<std::size_t>(k)]);
      for (int r = 0; r < N; ++r) {
        double& sum = sums[static_cast<std::size_t>(r)];
        sum = 2 * choose(N, r);  // input
        for (int c = r; c < N; ++c) {
          sum += choose(c, r) * static_cast<double>(std::abs(plant.state(c)));
        }
      }
      terms.push_back(sums);
    }

    AnyObserver observer = make(omega_t);
    for (const int drive : drives) {
      plant.step(drive);
      const Real u = drive / (nordsieck(n, s(period)) * gain);
      ASSERT_EQ(observer->update(static_cast<Real>(plant.output()), u), StepStatus::ok);
    }
    for (int r = 0; r < N; ++r) ASSERT_EQ(plant.state(r), end[static_cast<std::size_t>(r)]);

    // What the observer makes of an error in x_r, j samples later.
    std::vector<double> tolerance(size);
    for (std::size_t r = 0; r < size; ++r) {
      AnyObserver response = make(omega_t);
      response->reset(unit_state(static_cast<int>(r)));
      for (const auto& of_step : terms) {
        for (int to = 0; to < N; ++to) {
          tolerance[static_cast<std::size_t>(to)] +=
              p * static_cast<double>(roundings() * std::abs(scaled(response, to))) * of_step[r];
        }
        response->update(0, 0);
      }
    }
    for (int r = 0; r < N; ++r) {
      const double allowed = tolerance[static_cast<std::size_t>(r)];
      EXPECT_NEAR(static_cast<double>(scaled(observer, r)), static_cast<double>(plant.state(r)),
                  allowed)
          << "estimate " << r;
      // Rounding at the start weighs more on the lower derivatives; the disturbances must show.
      if (r >= n) {
        EXPECT_LT(allowed, 0.5) << "the tolerance hides a bias of estimate " << r;
      }
    }
  }

  /// From rest in zero to a plant that stands at y = 1 under a constant disturbance, for every
  /// omega_o T the scalar can hold.
  void bounded_and_correct() const {
    for (const double omega_t : omega_t_grid()) {
      SCOPED_TRACE(omega_t);
      if (!kind.make(settings(omega_t))) continue;  // judged by gains_equal_reference
      AnyObserver observer = make(omega_t);
      const double rate = std::min(1.0, omega_t * kind.slowest);
      // Physical gain of the whole observer: its estimate after one innovation of 1.
      AnyObserver struck = observer;
      struck->predict(0);
      struck->correct(1);
      const Real scale = std::abs(struck->estimate(n)) / rate;
      const Real d = s(scale / 2);
      const Real u = -d / gain;
      const Real y = 1;
      Real peak = 0;
      const int settling = settling_samples(omega_t);
      if (too_long(settling)) continue;
      for (int i = 0; i < settling; ++i) {
        ASSERT_EQ(observer->update(y, u), StepStatus::ok);
        peak = std::max(peak, std::abs(observer->total_disturbance()));
      }
      // Unit jump: each level overshoots by no more than all its binomials together.
      EXPECT_LE(peak, std::ldexp(scale, N * p));
      const Real scaled_d = d * nordsieck(n, period);
      const auto tolerance = [&](int to) {
        return roundings() *
               (rounding_gain(omega_t, 0, to) + rounding_gain(omega_t, n, to) * scaled_d);
      };
      const Real y_tolerance = tolerance(0);
      const Real d_tolerance = tolerance(n);
      // It would not hide a wrong one.
      EXPECT_LT(d_tolerance, scale * (in_float ? 0.05L : 1e-9L));
      for (int i = 0; i < 20; ++i) {
        ASSERT_EQ(observer->update(y, u), StepStatus::ok);
        expect_near(observer->output_estimate(), y, y_tolerance);
        expect_near(observer->total_disturbance(), d, d_tolerance);
      }
    }
  }

  /// y = sin(nu t) without input: d = y^(n). The estimate lags by at most the sum of the time
  /// constants of all N p poles (and one sample). With a model less is unknown than d, but of
  /// another size: y'' + a_1 y' + a_0 y of a plant with poles.
  void follows_motion() const {
    for (const double omega_t : {0.01, 0.1, 1.0, 3.0, 6.0}) {
      SCOPED_TRACE(omega_t);
      if (!kind.make(settings(omega_t))) continue;
      AnyObserver observer = make(omega_t);
      const double memory = 1 + 1 / (omega_t * kind.slowest);
      const double nu_t = 0.02 / (N * p) / memory;
      const double lag = N * p * memory * nu_t;  // radians
      const double nu = nu_t / static_cast<double>(s(period));
      const double amplitude = std::pow(nu, n);
      const double unknown = kind.unknown_amplitude == nullptr
                                 ? amplitude
                                 : kind.unknown_amplitude(settings(omega_t), nu);
      const Real y_rounding = roundings() * rounding_gain(omega_t, 0, 0);
      const Real d_rounding = roundings() * rounding_gain(omega_t, 0, n);
      const int settling = settling_samples(omega_t);
      for (int i = 0; i < settling + 200; ++i) {
        const double phase = nu_t * i;
        ASSERT_EQ(observer->update(std::sin(phase), 0), StepStatus::ok);
        if (i < settling) continue;
        const double d = amplitude * std::sin(phase + n * std::acos(0.0));
        // Twice: for m > 1 the levels overtake what they predict.
        ASSERT_LE(std::abs(observer->total_disturbance() - d), 2 * lag * unknown + d_rounding);
        ASSERT_LE(std::abs(observer->output_estimate() - std::sin(phase)), lag + y_rounding);
      }
    }
  }

  /// Against the continuous observer (RK4, fine) under a smooth y and an input that both see held
  /// over the same coarse intervals. Poles are matched and the chain is exact under a held input; y
  /// enters the sampled observer at the end of its sample, where the innovation filter ((1 - w) /
  /// (1 - rho w))^N differs from (s / (s + omega))^N by N omega T / 2: order 1, no more.
  void order_of_accuracy() const {
    constexpr double omega = 3;
    constexpr double hold = 0.25;
    constexpr int holds = 12;
    const auto output = [](double t) { return 0.4 + std::sin(1.3 * t); };
    const auto held = [](int interval) { return std::cos(1.0 + interval); };

    const ContinuousForm continuous = kind.continuous({omega, 0, gain});
    using State = ContinuousForm::State;
    const auto plus = [](State a, double h, const State& b) {
      for (std::size_t i = 0; i < a.size(); ++i) a[i] += h * b[i];
      return a;
    };
    State start(static_cast<std::size_t>(N));
    start[0] = output(0);
    State z = continuous.state_at(start);
    constexpr int fine = 400;
    constexpr double h = hold / fine;
    for (int i = 0; i < holds * fine; ++i) {
      const double t = i * h;
      const double u = held(i / fine);
      const auto rate = [&](double after, const State& at) {
        return continuous.derivative(t + after, at, output(t + after), u);
      };
      const State k1 = rate(0, z);
      const State k2 = rate(h / 2, plus(z, h / 2, k1));
      const State k3 = rate(h / 2, plus(z, h / 2, k2));
      const State k4 = rate(h, plus(z, h, k3));
      z = plus(plus(plus(plus(z, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
    }
    const State truth = continuous.estimate(z);

    const auto deviation = [&](int per_hold) {
      const double sample_time = hold / per_hold;
      AnyObserver observer = make({omega, sample_time, gain});
      EXPECT_EQ(observer->reset(output(0)), StepStatus::ok);
      for (int i = 0; i < holds * per_hold; ++i) {
        observer->update(output((i + 1) * sample_time), held(i / per_hold));
      }
      double worst = 0;
      for (int r = 0; r < N; ++r) {
        const double unit = choose(N, r) * std::pow(omega * kind.fastest, r);
        worst = std::max(worst, std::abs(static_cast<double>(observer->estimate(r)) -
                                         truth[static_cast<std::size_t>(r)]) /
                                    unit);
      }
      return worst;
    };
    // Step halving; float stops where rounding begins.
    const int per_hold = (in_float ? 16 : 64) * p;
    const double coarse = deviation(per_hold);
    const double halved = deviation(2 * per_hold);
    EXPECT_LT(halved, 0.1);
    EXPECT_NEAR(std::log2(coarse / halved), 1.0, 0.15);
  }

  // ---- state

  void reset_starts_anew() const {
    AnyObserver observer = warm();
    observer->predict(1);
    EXPECT_EQ(observer->reset(3), StepStatus::ok);
    AnyObserver fresh = make(0.5);
    fresh->predict(1);  // the actuator still holds it
    fresh->reset(3);
    EXPECT_TRUE(same_observer(observer, fresh));
    EXPECT_EQ(observer->missed(), 0);
    EXPECT_EQ(observer->innovation(), 0);
    EXPECT_EQ(observer->estimate(0), 3);
    for (int r = 1; r < N; ++r) {
      EXPECT_EQ(observer->estimate(r), kind.is_output[static_cast<std::size_t>(r)] ? 3 : 0) << r;
    }
    Random random(3);
    for (int k = 0; k < 20; ++k) {
      const Real y = random.uniform(-1, 1);
      EXPECT_EQ(observer->update(y, input(0.5)), fresh->update(y, input(0.5)));
      EXPECT_TRUE(same_observer(observer, fresh));
    }

    const auto wanted = state([](int r) { return r + 1.5; });
    EXPECT_EQ(observer->reset(wanted), StepStatus::ok);
    for (int level = 0; level < p; ++level) {
      for (int r = 0; r < N; ++r) {
        const Real of_row = wanted[static_cast<std::size_t>(r)];
        expect_near(observer->level_estimate(level, r), of_row, 4 * N * epsilon * of_row);
      }
    }
  }

  void reset_refuses_bad_state() const {
    const AnyObserver before = warm();
    for (const Real bad : {nan, infinity, -infinity}) {
      AnyObserver observer = before;
      EXPECT_EQ(observer->reset(bad), StepStatus::state_rejected);
      EXPECT_TRUE(same_observer(observer, before));
      for (std::size_t r = 0; r < static_cast<std::size_t>(N); ++r) {
        std::vector<Real> state(static_cast<std::size_t>(N), 1);
        state[r] = bad;
        EXPECT_EQ(observer->reset(state), StepStatus::state_rejected) << r;
        EXPECT_TRUE(same_observer(observer, before));
      }
    }
  }

  void copies_are_independent() const {
    AnyObserver a = warm();
    AnyObserver b = a;
    AnyObserver untouched = a;
    const AnyObserver witness = a;
    Random random(5);
    for (int k = 0; k < 60; ++k) {
      const Real y = random.uniform(-1, 1);
      const Real u = input(random.uniform(-1, 1));
      if (k % 7 == 3) {
        a->predict(u);
        b->predict(u);
      } else {
        EXPECT_EQ(a->update(y, u), b->update(y, u));
      }
      EXPECT_TRUE(same_observer(a, b));
    }
    EXPECT_TRUE(same_observer(untouched, witness));
    EXPECT_FALSE(same_observer(a, witness));
    untouched = a;
    EXPECT_TRUE(same_observer(untouched, a));
  }

  /// The same data, already rounded to float.
  void float_agrees_with_double() const {
    constexpr double omega_t = 0.5;
    AnyObserver narrow = make(omega_t);
    AnyObserver wide = LawSuite{*kind.in_double}.make(omega_t);
    // Scaled states stay below their largest gain times 2 N, y and the input being below 1.
    std::vector<Real> tolerance;
    for (int to = 0; to < N; ++to) {
      tolerance.push_back(0);
      for (int from = 0; from < N; ++from) {
        tolerance.back() += 2 * N * roundings() * rounding_gain(omega_t, from, to);
      }
    }
    Random random(23);
    for (int i = 0; i < 400; ++i) {
      const Real y = s(random.uniform(-1, 1));
      const Real u = input(random.uniform(-1, 1));
      narrow->update(y, u);
      wide->update(y, u);
      for (int r = 0; r < N; ++r) {
        expect_near(narrow->estimate(r), wide->estimate(r), tolerance[static_cast<std::size_t>(r)]);
      }
    }
  }

  /// Constant disturbance, u = -d / b0, y stays put: a million samples after the transient the
  /// disturbance is still within the rounding scale.
  void float_does_not_drift() const {
    constexpr double omega_t = 0.5;
    AnyObserver observer = make(omega_t);
    const double omega = omega_t / period * kind.fastest;
    const Real y = s(1.3);
    const Real d = s(0.3 * std::pow(omega, n));
    const Real u = -d / gain;
    const int settling = settling_samples(omega_t);
    for (int i = 0; i < settling; ++i) observer->update(y, u);
    Real worst = 0;
    for (int i = 0; i < 1000000; ++i) {
      observer->update(y, u);
      worst = std::max(worst, std::abs(observer->total_disturbance() - d));
    }
    EXPECT_LE(worst, 1e-6L * (std::pow(omega, n) * y + d));
  }

  void no_allocation() const {
    AnyObserver observer = make(0.5);
    const std::vector<Real> state(static_cast<std::size_t>(N), 1);
    const Real much = input(0.5);
    const Real little = input(0.1);
    Real sink = 0;
    long count = -1;
    {
      const NoAllocation guard;
      for (int k = 0; k < 10; ++k) {
        observer->update(1, much);
        observer->update(nan, nan);
        observer->predict(little);
        observer->predict(little);
        observer->correct(1);
        sink += observer->estimate(n) + observer->total_disturbance() + observer->innovation();
        sink += observer->level_estimate(0, 0) + observer->output_estimate();
        observer->reset(1);
        observer->reset(state);
        for (int i = 0; i < 150; ++i) observer->predict(0);
        observer->correct(1);
      }
      count = guard.count();
    }
    EXPECT_EQ(count, 0);
    EXPECT_TRUE(std::isfinite(sink));
    // The counter does count.
    const long before = allocation_count;
    ::operator delete(::operator new(100));
    EXPECT_EQ(allocation_count - before, 1);
  }

  void update_is_predict_then_correct() const {
    for (const double omega_t : {0.01, 0.5, 3.0}) {
      if (!kind.make(settings(omega_t))) continue;
      AnyObserver whole = make(omega_t);
      AnyObserver halves = whole;
      Random random(31);
      for (int k = 0; k < 100; ++k) {
        Real y = random.uniform(-1, 1);
        Real u = input(random.uniform(-1, 1));
        if (k % 11 == 5) y = nan;
        if (k % 13 == 5) u = infinity;
        if (k % 29 == 5) y = huge();
        const StepStatus status = whole->update(y, u);
        const StepStatus predicted = halves->predict(u);
        EXPECT_EQ(status, predicted | halves->correct(y));
        ASSERT_TRUE(same_observer(whole, halves)) << "sample " << k;
        ASSERT_TRUE(finite(whole));
      }
    }
  }

  // ---- bad samples

  void bad_measurement_is_a_missing_one() const {
    const Real u = input(0.25);
    for (const Real bad : {nan, infinity, -infinity, -nan}) {
      AnyObserver hit = warm(bridging);
      AnyObserver missing = hit;
      EXPECT_EQ(hit->update(bad, u), StepStatus::measurement_rejected);
      EXPECT_EQ(missing->predict(u), StepStatus::ok);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_EQ(hit->missed(), 1);
      EXPECT_EQ(hit->update(0.5, u), StepStatus::gap_bridged);
      EXPECT_EQ(missing->update(0.5, u), StepStatus::gap_bridged);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_EQ(hit->missed(), 0);
      EXPECT_EQ(hit->update(0.5, u), StepStatus::ok);
      EXPECT_TRUE(finite(hit));
    }
  }

  void bad_input_is_the_last_good_one() const {
    const Real u = input(0.125);
    for (const Real bad : {nan, infinity, -infinity}) {
      AnyObserver hit = warm(bridging);
      AnyObserver held = hit;
      const Real last = hit->applied_input();
      EXPECT_NE(last, 0);
      EXPECT_EQ(hit->update(0.5, bad), StepStatus::input_rejected);
      EXPECT_EQ(held->update(0.5, last), StepStatus::ok);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit->predict(bad), StepStatus::input_rejected);
      held->predict(last);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit->update(nan, bad),
                StepStatus::input_rejected | StepStatus::measurement_rejected);
      held->predict(last);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit->update(0.5, u), StepStatus::gap_bridged);
      held->update(0.5, u);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit->applied_input(), u);
    }
  }

  /// Finite samples that would make the state infinite, 3e38 in float.
  void overflow_is_dropped() const {
    // b0 so large that b0 T u alone is too much.
    const double b0 = 16 / period;
    const Real u = input(0.25);
    const StepStatus late =
        make(0.5, b0)->longest_gap() > 0 ? StepStatus::gap_bridged : StepStatus::restarted;
    for (const Real bad : {huge(), -huge()}) {
      AnyObserver hit = warm(0.5, b0);
      AnyObserver missing = hit;
      EXPECT_EQ(hit->update(bad, u), StepStatus::measurement_rejected);
      missing->predict(u);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_EQ(hit->update(0.5, u), late);
      missing->update(0.5, u);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_TRUE(finite(hit));

      const Real last = hit->applied_input();
      EXPECT_EQ(hit->update(0.5, bad), StepStatus::input_rejected);
      missing->update(0.5, last);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_TRUE(finite(hit));
    }
    // No u can go on from here: the state stands still.
    AnyObserver observer = make(0.5);
    std::vector<Real> state(static_cast<std::size_t>(N));
    state[0] = huge();
    state[1] = huge() / 8;
    if (observer->reset(state) == StepStatus::ok) {
      for (int k = 0; k < 200; ++k) {
        const StepStatus status = observer->predict(0);
        if (status != StepStatus::ok) {
          EXPECT_EQ(status, StepStatus::prediction_dropped);
        }
        ASSERT_TRUE(finite(observer));
      }
      EXPECT_GE(observer->missed(), 200);
      // A good measurement restarts it.
      EXPECT_EQ(observer->correct(1), StepStatus::restarted);
      EXPECT_EQ(observer->estimate(0), 1);
    }
  }

  // ---- symmetries

  void negative_input_gain() const {
    AnyObserver positive = make(0.5, gain);
    AnyObserver negative = make(0.5, -gain);
    EXPECT_EQ(negative->input_gain(), -positive->input_gain());
    Random random(41);
    for (int k = 0; k < 50; ++k) {
      const Real y = random.uniform(-1, 1);
      const Real u = input(random.uniform(-1, 1));
      positive->update(y, u);
      negative->update(y, -u);
      for (int r = 0; r < N; ++r) {
        ASSERT_TRUE(same_bits(positive->estimate(r), negative->estimate(r)));
      }
    }
    // The sign does matter.
    positive->update(0.5, input(0.5));
    negative->update(0.5, input(0.5));
    EXPECT_NE(positive->total_disturbance(), negative->total_disturbance());
  }

  /// A linear observer: four times the data, four times the estimate, bit for bit.
  void homogeneous() const {
    AnyObserver one = make(0.5);
    AnyObserver four = one;
    Random random(43);
    for (int k = 0; k < 50; ++k) {
      const Real y = random.uniform(-1, 1);
      const Real u = input(random.uniform(-1, 1));
      one->update(y, u);
      four->update(4 * y, 4 * u);
      for (int r = 0; r < N; ++r) {
        ASSERT_TRUE(same_bits(4 * one->estimate(r), four->estimate(r)));
      }
    }
  }

  // ---- retuning

  void retune_keeps_estimate() const {
    AnyObserver observer = warm();
    observer->predict(input(0.75));  // in the middle of a step
    const AnyObserver before = observer;
    ASSERT_EQ(kind.retune(observer, settings(1.5)), "accepted");
    EXPECT_TRUE(same_observer(observer, before));
    // The new bandwidth is in force.
    AnyObserver fresh = make(1.5);
    observer->reset(0);
    observer->correct(1);
    fresh->reset(0);
    fresh->correct(1);
    expect_equal_estimates(observer, fresh);
    // Gaps follow it as well.
    for (AnyObserver* o : {&observer, &fresh}) {
      (*o)->reset(0);
      for (int i = 0; i < 3; ++i) (*o)->predict(0);
      (*o)->correct(1);
    }
    expect_equal_estimates(observer, fresh);
  }

  /// dhat += (b0_old - b0_new) u: ADRC asks for the same u as before.
  void retune_rebalances_input_gain() const {
    for (const double new_gain : {3.7, 0.4, -1.3}) {
      AnyObserver observer = warm();
      const AnyObserver before = observer;
      const Real u = observer->applied_input();
      ASSERT_EQ(kind.retune(observer, settings(0.5, new_gain)), "accepted");
      expect_near(observer->input_gain(), s(new_gain), 32 * N * epsilon);
      const Real moved = (gain - s(new_gain)) * u;
      for (int level = 0; level < p; ++level) {
        for (int r = 0; r < N; ++r) {
          const Real old = before->level_estimate(level, r);
          const Real now = observer->level_estimate(level, r);
          if (r == n) {
            expect_near(now, old + moved, 16 * N * epsilon * (std::abs(old) + std::abs(moved)));
          } else {
            EXPECT_TRUE(same_bits(now, old)) << r;
          }
        }
      }
      EXPECT_EQ(observer->applied_input(), u);
    }
  }

  void retune_rescales_sample_time() const {
    AnyObserver observer = warm();
    const AnyObserver before = observer;
    const Settings faster{0.5 / period, period / 3, gain};
    ASSERT_EQ(kind.retune(observer, faster), "accepted");
    expect_near(observer->sample_time(), s(period / 3), 2 * epsilon);
    for (int level = 0; level < p; ++level) {
      for (int r = 0; r < N; ++r) {
        const Real old = before->level_estimate(level, r);
        expect_near(observer->level_estimate(level, r), old, 16 * N * epsilon * std::abs(old));
      }
    }
    // Gains and input follow the new sample time.
    AnyObserver fresh = make(faster);
    for (AnyObserver* o : {&observer, &fresh}) {
      (*o)->reset(0);
      (*o)->update(1, 3);
    }
    expect_equal_estimates(observer, fresh);
  }

  void refused_retune_changes_nothing() const {
    AnyObserver observer = warm();
    observer->predict(input(0.5));
    const AnyObserver before = observer;
    const std::pair<Settings, const char*> refusals[] = {
        {{static_cast<double>(nan), period, gain}, kind.field},
        {{-50, period, gain}, kind.field},
        {{50, 0, gain}, "sample_time: must be finite and positive"},
        {{50, period, 0}, "input_gain: must be finite and not zero (negative is fine)"},
        {{50, period, gain, 0}, "max_gap: must be 1 .. 65000"}};
    for (const auto& [bad, refused] : refusals) {
      const std::string outcome = kind.retune(observer, bad);
      EXPECT_TRUE(outcome.starts_with(refused)) << outcome;
      EXPECT_TRUE(same_observer(observer, before));
    }
    // A good config that this estimate cannot follow.
    AnyObserver strained = make(0.5, 1e-3);
    ASSERT_EQ(strained->predict(huge() / 4), StepStatus::ok);
    const AnyObserver strained_before = strained;
    EXPECT_NE(kind.retune(strained, settings(0.5, 1e4)), "accepted");
    EXPECT_TRUE(same_observer(strained, strained_before));

    AnyObserver untouched = before;
    EXPECT_EQ(observer->correct(2), untouched->correct(2));
    EXPECT_TRUE(same_observer(observer, untouched));
    EXPECT_EQ(observer->update(2, 1), untouched->update(2, 1));
    EXPECT_TRUE(same_observer(observer, untouched));
  }

  // ---- gaps

  /// M predictions and a correction equal one step of an observer that is made for M T.
  void gap_gain_is_that_of_longer_sample() const {
    for (const double omega_t : {bridging, 0.1, 1.0, 3.0}) {
      if (!kind.make(settings(omega_t))) continue;
      for (const int samples : {2, 3, 7, 20}) {
        SCOPED_TRACE(::testing::Message() << omega_t << " x " << samples);
        if (samples > make(omega_t)->max_gap() + 1) break;
        const double long_period = samples * period;  // rounded to double
        const Real unit_roundoff = std::max<Real>(epsilon, std::numeric_limits<double>::epsilon());
        AnyObserver gapped = make(omega_t);
        AnyObserver slow = make({omega_t / period, long_period, gain});
        const auto start = state([](int r) { return r % 2 == 0 ? 0.7 : -0.4; }, long_period);
        gapped->reset(start);
        slow->reset(start);
        const Real u = s(0.5 / gain / nordsieck(n, long_period));
        for (int i = 0; i < samples; ++i) gapped->predict(u);
        slow->predict(u);
        Real scale = 0;
        for (int r = 0; r < N; ++r) {
          scale = std::max(scale, std::abs(slow->estimate(r)) * row_unit(r, long_period));
        }
        EXPECT_EQ(gapped->missed(), samples);
        EXPECT_EQ(gapped->correct(9), StepStatus::gap_bridged);
        EXPECT_EQ(slow->correct(9), StepStatus::ok);
        scale += 9;
        for (int r = 0; r < N; ++r) {
          EXPECT_LE(std::abs(gapped->estimate(r) - slow->estimate(r)) * row_unit(r, long_period),
                    16 * N * p * unit_roundoff * scale)
              << r;
        }
      }
    }
  }

  /// One correction in M, for ever: the error decays as with an observer for M T.
  void recurring_gaps_are_stable() const {
    for (const double omega_t : {0.1, 1.0, 3.0}) {
      if (!kind.make(settings(omega_t))) continue;
      for (int every = 1; every <= 20; every += stride) {
        SCOPED_TRACE(::testing::Message() << omega_t << ", one in " << every);
        AnyObserver observer = make(omega_t);
        if (every > observer->max_gap() + 1) break;
        const auto start = state([](int) { return 1; }, period * every);
        ASSERT_EQ(observer->reset(start), StepStatus::ok);
        const int corrections = settling_samples(omega_t * every);
        for (int k = 0; k < corrections; ++k) {
          for (int i = 0; i < every; ++i) observer->predict(0);
          ASSERT_EQ(observer->correct(0), every == 1 ? StepStatus::ok : StepStatus::gap_bridged);
        }
        for (int r = 0; r < N; ++r) {
          EXPECT_LE(std::abs(observer->estimate(r)) * row_unit(r, period * every), 1e-6) << r;
        }
      }
    }
  }

  /// The size of the estimate in units of the slowest pole.
  [[nodiscard]] Real error_size(const AnyObserver& observer, double omega_t) const {
    Real most = 0;
    for (int r = 0; r < N; ++r) {
      most = std::max(
          most, std::abs(observer->estimate(r)) * row_unit(r, period / std::min(1.0, omega_t)));
    }
    return most;
  }

  /// `missing` predictions and a correction.
  static void bridge(AnyObserver& observer, int missing) {
    for (int i = 0; i <= missing; ++i) observer->predict(0);
    ASSERT_EQ(observer->correct(0), missing == 0 ? StepStatus::ok : StepStatus::gap_bridged);
  }

  /// The errors decay in any sequence of gaps up to max_gap(): two of all lengths in turn, random
  /// ones, and the worst found step by step.
  void any_sequence_of_gaps_decays() const {
    constexpr int corrections = 200;
    Random random(42);
    for (const double omega_t : {bridging, 0.2, 0.46, 2.0}) {
      if (!kind.make(settings(omega_t))) continue;
      const AnyObserver start = make(omega_t);
      std::vector<int> gaps;  // 0, 1, 2, 4, .. and the longest
      for (int gap = 0; gap < start->max_gap(); gap = gap < 2 ? gap + 1 : gap * 7 / 4) {
        gaps.push_back(gap);
      }
      gaps.push_back(start->max_gap());
      const auto play = [&](const char* name, auto&& next) {
        AnyObserver observer = start;
        observer->reset(
            state([](int r) { return r % 2 == 0 ? 1 : -1; }, period / std::min(1.0, omega_t)));
        // Before the first correction a schedule or a filter may still be at its start.
        for (int k = 0; k < 2 * N; ++k) bridge(observer, 0);
        const Real before = error_size(observer, omega_t);
        double time = 0;
        for (int k = 0; k < corrections || time < 60 / kind.slowest; ++k) {
          const int gap = next(observer, k);
          bridge(observer, gap);
          time += omega_t * (gap + 1);
        }
        EXPECT_LE(error_size(observer, omega_t), 1e-3 * before + 1e-12)
            << name << ", " << omega_t << ", gaps to " << gaps.back();
      };
      for (const int a : gaps) {
        for (const int b : gaps) {
          if (a < b) play("two", [&](const AnyObserver&, int k) { return k % 2 == 0 ? a : b; });
        }
      }
      for (int run = 0; run < 3; ++run) {
        play("random", [&](const AnyObserver&, int) {
          return gaps[static_cast<std::size_t>(random.index(static_cast<int>(gaps.size())))];
        });
      }
      play("worst", [&](const AnyObserver& observer, int) {
        int worst = 0;
        Real most = -1;
        for (const int gap : gaps) {
          AnyObserver tried = observer;
          bridge(tried, gap);
          if (const Real size = error_size(tried, omega_t); size > most) {
            most = size;
            worst = gap;
          }
        }
        return worst;
      });
    }
  }

  /// Errors decay in any sequence of gaps, also of those beyond max_gap() that are as near together
  /// as they may be without a restart: two lengths in turn, random ones, and the worst found step
  /// by step, with bridged gaps in between.
  void long_gaps_are_forgotten() const {
    Random random(43);
    for (const double omega_t : {0.1, 0.46, 1.3}) {
      if (!kind.make(settings(omega_t))) continue;
      for (const int asked : {40, 400}) {
        const AnyObserver start = make(omega_t, gain, asked);
        const int bridged = start->max_gap(), longest = start->longest_gap();
        if (longest <= bridged) continue;
        std::vector<int> gaps;  // beyond max_gap
        for (int gap = bridged + 1; gap < longest; gap = gap * 7 / 4 + 1) gaps.push_back(gap);
        gaps.push_back(longest);
        const auto play = [&](const char* name, auto&& next) {
          AnyObserver observer = start;
          observer->reset(
              state([](int r) { return r % 2 == 0 ? 1 : -1; }, period / std::min(1.0, omega_t)));
          for (int k = 0; k < 2 * N; ++k) bridge(observer, 0);
          const Real before = error_size(observer, omega_t);
          double time = 0;
          for (int cycle = 0; cycle < 40 || time < 60 / kind.slowest; ++cycle) {
            const int gap = next(observer, cycle);
            bridge(observer, gap);
            time += omega_t * (gap + 1);
            while (observer->recovering() > 0) {
              const bool bridges = random.index(10) == 0 && bridged > 0;
              bridge(observer, bridges ? 1 + random.index(bridged) : 0);
              time += omega_t;
              if (time > 1e4) return;  // the bridged gaps made more due
            }
          }
          EXPECT_LE(error_size(observer, omega_t), 1e-3 * before + 1e-12)
              << name << ", " << omega_t << ", gaps to " << longest;
        };
        for (const int a : gaps) {
          play("two", [&](const AnyObserver&, int k) { return k % 2 == 0 ? a : gaps.back(); });
        }
        play("random", [&](const AnyObserver&, int) {
          return gaps[static_cast<std::size_t>(random.index(static_cast<int>(gaps.size())))];
        });
        play("worst", [&](const AnyObserver& observer, int) {
          int worst = gaps[0];
          Real most = -1;
          for (const int gap : gaps) {
            AnyObserver tried = observer;
            bridge(tried, gap);
            for (int due = tried->recovering(); due > 0; --due) bridge(tried, 0);
            if (const Real size = error_size(tried, omega_t); size > most) {
              most = size;
              worst = gap;
            }
          }
          return worst;
        });
        // A second one is bridged, a third restarts: more than two are not owed at a time.
        AnyObserver observer = start;
        bridge(observer, longest);
        const int after_one = observer->recovering();
        if (after_one == 0) continue;
        bridge(observer, longest);
        EXPECT_EQ(observer->recovering(), 2 * after_one);
        for (int i = 0; i <= longest; ++i) observer->predict(0);
        EXPECT_EQ(observer->correct(1), StepStatus::restarted);
        EXPECT_EQ(observer->recovering(), 0);
        // Each correction without a gap counts, and a retune begins anew.
        observer = start;
        bridge(observer, longest);
        const int due = observer->recovering();
        if (due < 2) continue;
        bridge(observer, 0);
        EXPECT_EQ(observer->recovering(), due - 1);
        observer->update(0, 0);
        EXPECT_EQ(observer->recovering(), due - 2);
        ASSERT_EQ(kind.retune(observer, settings(omega_t, gain, asked)), "accepted");
        EXPECT_EQ(observer->recovering(), due);
      }
    }
  }

  void long_gap_restarts() const {
    constexpr int max_gap = 2;
    const Real u = input(0.5);
    const auto after = [&](int missing) {
      AnyObserver observer = make(bridging, gain, max_gap);
      observer->update(1, u);
      for (int i = 0; i < missing; ++i) observer->predict(u);
      return observer;
    };
    AnyObserver bridged = after(max_gap);
    EXPECT_EQ(bridged->update(2, u), StepStatus::gap_bridged);

    AnyObserver restarted = after(max_gap + 1);
    EXPECT_EQ(restarted->update(nan, u), StepStatus::measurement_rejected);
    EXPECT_EQ(restarted->missed(), max_gap + 2);
    EXPECT_EQ(restarted->update(2, u), StepStatus::restarted);
    EXPECT_EQ(restarted->missed(), 0);
    AnyObserver fresh = make(bridging, gain, max_gap);
    fresh->predict(u);
    fresh->reset(2);
    EXPECT_TRUE(same_observer(restarted, fresh));
    EXPECT_EQ(restarted->update(2, u), StepStatus::ok);

    // The count of missing samples does not wrap around.
    AnyObserver forgotten = make(bridging, gain, 65000);
    forgotten->update(1, 0);
    for (int i = 0; i < 70000; ++i) forgotten->predict(0);
    EXPECT_EQ(forgotten->correct(1), StepStatus::restarted);
  }
};

}  // namespace

std::vector<NamedLaw> LawSuite::laws() const {
  std::vector<NamedLaw> laws;
  const auto add = [&](const char* name, Law law, void (Laws::*run)() const) {
    laws.push_back({name, [of = Laws{*this}, run] { (of.*run)(); }, kind.excuse(law)});
  };
#define ESOKIT_LAW(law) add(#law, Law::law, &Laws::law)
  ESOKIT_LAW(gains_equal_reference);
  ESOKIT_LAW(polynomial_equals_reference);
  ESOKIT_LAW(unbiased_on_own_model_class);
  ESOKIT_LAW(bounded_and_correct);
  ESOKIT_LAW(follows_motion);
  ESOKIT_LAW(order_of_accuracy);
  ESOKIT_LAW(reset_starts_anew);
  ESOKIT_LAW(reset_refuses_bad_state);
  ESOKIT_LAW(copies_are_independent);
  ESOKIT_LAW(float_agrees_with_double);
  ESOKIT_LAW(float_does_not_drift);
  ESOKIT_LAW(no_allocation);
  ESOKIT_LAW(update_is_predict_then_correct);
  ESOKIT_LAW(bad_measurement_is_a_missing_one);
  ESOKIT_LAW(bad_input_is_the_last_good_one);
  ESOKIT_LAW(overflow_is_dropped);
  ESOKIT_LAW(negative_input_gain);
  ESOKIT_LAW(homogeneous);
  ESOKIT_LAW(retune_keeps_estimate);
  ESOKIT_LAW(retune_rebalances_input_gain);
  ESOKIT_LAW(retune_rescales_sample_time);
  ESOKIT_LAW(refused_retune_changes_nothing);
  ESOKIT_LAW(gap_gain_is_that_of_longer_sample);
  ESOKIT_LAW(recurring_gaps_are_stable);
  ESOKIT_LAW(any_sequence_of_gaps_decays);
  ESOKIT_LAW(long_gaps_are_forgotten);
  ESOKIT_LAW(long_gap_restarts);
#undef ESOKIT_LAW
  return laws;
}

}  // namespace esokit_test
