/// @file
/// The laws that every observer must obey, written once. A translation unit instantiates them for
/// its types: `register_laws<ObserverLaws>("Name", TypeList<..>{})`.
/// `ObserverTraits` says which laws do not apply to a type; those are skipped with the reason.
///
/// Scaled quantities are in Nordsieck scaling, x_r = T^r z_r / r!, as in the library, but computed
/// here from the physical estimates.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <limits>
#include <support/exact_plant.hpp>
#include <support/gain_comparison.hpp>
#include <support/law_registration.hpp>
#include <support/no_allocation.hpp>
#include <support/numbers.hpp>
#include <support/observer_traits.hpp>
#include <support/refusal.hpp>
#include <vector>

// The laws compute references in long double on purpose; the library is still checked.
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wdouble-promotion"

namespace esokit_test {

using esokit::Array;
using esokit::has;
using esokit::StepStatus;

/// Every observable of two observers is the same, bit for bit.
template <class Observer>
::testing::AssertionResult same_observer(const Observer& a, const Observer& b) {
  for (int level = 0; level < Observer::levels; ++level) {
    const auto za = a.level_estimate(level);
    const auto zb = b.level_estimate(level);
    for (int r = 0; r < Observer::size; ++r) {
      if (!same_bits(za(r), zb(r))) {
        return ::testing::AssertionFailure()
               << "level " << level << ", estimate " << r << ": " << za(r) << " and " << zb(r);
      }
    }
  }
  if (!same_bits(a.innovation(), b.innovation())) {
    return ::testing::AssertionFailure()
           << "innovation " << a.innovation() << " and " << b.innovation();
  }
  if (!same_bits(a.applied_input(), b.applied_input())) {
    return ::testing::AssertionFailure()
           << "applied input " << a.applied_input() << " and " << b.applied_input();
  }
  if (a.missed() != b.missed()) {
    return ::testing::AssertionFailure() << "missed " << a.missed() << " and " << b.missed();
  }
  return ::testing::AssertionSuccess();
}

template <class Observer>
struct LawsOf {
  using S = typename Observer::scalar_type;
  using Traits = ObserverTraits<Observer>;
  using Config = typename Observer::Config;
  using Estimate = typename Observer::Estimate;
  static constexpr int n = Observer::order;
  static constexpr int N = Observer::size;
  static constexpr int p = Observer::levels;
  static constexpr double period = 0.01;  ///< T, s
  static constexpr double gain = 2;       ///< b0, a power of two: u = -d / b0 is exact
  static constexpr long double epsilon = std::numeric_limits<S>::epsilon();

  static Config config(double omega_t, double b0 = gain, int max_gap = 100) {
    return Traits::config(omega_t / period, period, b0, max_gap);
  }
  static Observer make(double omega_t, double b0 = gain, int max_gap = 100) {
    return Observer::make(config(omega_t, b0, max_gap)).value();
  }
  static double lowest_omega_t() { return std::is_same_v<S, float> ? 1e-3 : 1e-4; }
  static std::vector<double> omega_t_grid() {
    std::vector<double> grid{1e-4, 1e-3, 1e-2, 0.1, 0.5, 1, 3, 6, 15, 50};
    std::erase_if(grid, [](double x) { return x < lowest_omega_t(); });
    return grid;
  }

  /// An input whose effect over a sample is `x` in scaled units, so that u weighs as much as y.
  static S input(double x) {
    return static_cast<S>(x / gain / nordsieck(n, static_cast<long double>(period)));
  }

  /// A run of measurements and inputs, and the observer in its middle.
  static Observer warm(double omega_t = 0.5, double b0 = gain) {
    Observer observer = make(omega_t, b0);
    Random random(7);
    for (int k = 0; k < 50; ++k) {
      const S y = static_cast<S>(random.uniform(-1, 1));
      EXPECT_EQ(observer.update(y, input(random.uniform(-1, 1))), StepStatus::ok);
    }
    return observer;
  }

  /// By what estimate r is scaled; a model may have rows that are no derivatives of y.
  static long double row_unit(int r, long double sample_time) {
    if constexpr (requires { Traits::degree(r); }) {
      return nordsieck(Traits::degree(r), sample_time);
    } else {
      return nordsieck(r, sample_time);
    }
  }

  /// x_r of the last level.
  static long double scaled(const Observer& observer, int r) {
    const long double sample_time = static_cast<S>(period);
    return observer.estimate()(r) * row_unit(r, sample_time);
  }

  /// EXPECT_NEAR for every scalar.
  static void expect_near(S value, S expected, S tolerance) {
    EXPECT_LE(std::abs(value - expected), tolerance) << value << " and " << expected;
  }

  static bool finite(const Observer& observer) {
    for (int level = 0; level < p; ++level) {
      for (const S z : observer.level_estimate(level)) {
        if (!std::isfinite(z)) return false;
      }
    }
    return std::isfinite(observer.innovation()) && std::isfinite(observer.applied_input());
  }

  /// Physical gain of the whole observer: the estimate of the last level after one innovation of 1.
  static Estimate whole_gain(double omega_t) {
    Observer observer = make(omega_t);
    observer.predict(S(0));
    observer.correct(S(1));
    return observer.estimate();
  }

  /// What a rounding error in x_`from` at every step can do to estimate `to` in physical units: the
  /// sum of its response to that one error, as the observer itself computes it. A level of a
  /// cascade makes errors of its own.
  static S rounding_gain(double omega_t, int from, int to) {
    Observer observer = make(omega_t);
    Estimate state = Estimate::Zero();
    state(from) = static_cast<S>(1 / row_unit(from, static_cast<long double>(period)));
    observer.reset(state);
    S sum = std::abs(observer.estimate()(to));
    const int settling = settling_samples(omega_t);
    for (int i = 0; i < settling; ++i) {
      observer.update(S(0), S(0));
      sum += std::abs(observer.estimate()(to));
    }
    return p * sum;
  }

  /// Roundings of a step: N terms of the prediction, the innovation, its product with the gain, the
  /// sum with the state, and the measurement before it came.
  static constexpr S roundings = static_cast<S>((N + 4) * epsilon);

  /// Samples after which an initial error is below rounding. The error falls like
  /// C(k, Np) rho^k; its logarithm is at most 6 Np above -k omega T before it is lost.
  static int settling_samples(double omega_t) {
    const double rate = std::min(1.0, omega_t * Traits::slowest);
    return static_cast<int>((45 + 6 * N * p) / rate);
  }

  // ---- gains

  /// Each gain to a few units in the last place, for every omega_o T: a_i is good to 2 of them, its
  /// powers to 3 N, the physical gain r! / T^r k_r to 2 N more, and each level adds the rounding of
  /// its own. In double the bound is below 1e-12.
  static void gains_equal_reference() {
    if constexpr (std::is_same_v<S, double>) {
      ASSERT_LT(16 * N * p * epsilon, 1e-12L);
    }
    int compared = 0;
    for (const double omega_t : omega_t_grid()) {
      SCOPED_TRACE(omega_t);
      const Config settings = config(omega_t);
      const auto poles = Traits::level_poles(settings);
      if (refused_for_underflow(settings)) continue;
      Observer observer = Observer::make(settings).value();
      observer.predict(S(0));
      ASSERT_EQ(observer.correct(S(1)), StepStatus::ok);
      std::vector<std::vector<long double>> estimates;
      for (int level = 0; level < p; ++level) estimates.push_back(level_values(observer, level));
      compared += compare_gains(estimates, n, poles, settings.sample_time, 16 * N * p * epsilon,
                                std::numeric_limits<S>::min(), std::numeric_limits<S>::max());
    }
    EXPECT_GT(compared, 2 * N);
  }

  /// Coefficients of the characteristic polynomial in z - 1 of level 1, from its gains: beta_j =
  /// Delta^(j-1) kappa(1), kappa(t) = sum_r k_r t^r. All terms are positive for real poles.
  static void polynomial_equals_reference() {
    for (const double omega_t : omega_t_grid()) {
      SCOPED_TRACE(omega_t);
      const Config settings = config(omega_t);
      if (refused_for_underflow(settings)) continue;
      Observer observer = Observer::make(settings).value();
      observer.predict(S(0));
      observer.correct(S(1));
      compare_polynomial(level_values(observer, 0), Traits::level_poles(settings)[0],
                         settings.sample_time, 16 * N * epsilon);
    }
  }

  static std::vector<long double> level_values(const Observer& observer, int level) {
    const Estimate z = observer.level_estimate(level);
    return std::vector<long double>(z.data(), z.data() + N);
  }

  /// True if the config is refused because a gain is too small for the scalar, and rightly so.
  static bool refused_for_underflow(const Config& config) {
    const auto made = Observer::make(config);
    EXPECT_EQ(!made, smallest_gain(Traits::level_poles(config), config.sample_time) <
                         std::numeric_limits<S>::min());
    if (made) return false;
    EXPECT_STREQ(made.error().field, Traits::field);
    return true;
  }

  // ---- truth

  /// The plant runs in whole numbers, so the measurement is exact but for its rounding to S. All
  /// scaled states are 1 or -1 in the end, so every estimate is of the same weight.
  static void unbiased_on_own_model_class() {
    // Nearly deadbeat: after p N samples only what the last ones said counts.
    const double omega_t = 10 / Traits::slowest;
    constexpr int samples = 2 * p * N + 4;  // what was rounded in the transient must go as well
    std::vector<ExactPlant::Integer> end;
    for (int r = 0; r < N; ++r) end.push_back(r % 3 == 1 ? -1 : 1);
    ExactPlant plant(n, end);
    Random random(11);
    std::vector<int> drives;
    for (int k = 0; k < samples; ++k) drives.push_back(random.index(5) - 2);
    // Rounding j samples before the end: terms_r = sum_c C(c, r) |x_c|, all that a step adds up.
    std::vector<Array<double, N>> terms;
    for (int k = samples - 1; k >= 0; --k) {
      Array<double, N> sums{};
      plant.step_back(drives[static_cast<std::size_t>(k)]);
      for (int r = 0; r < N; ++r) {
        double& sum = sums[static_cast<std::size_t>(r)];
        sum = 2 * choose(N, r);  // input
        for (int c = r; c < N; ++c)
          sum += choose(c, r) * static_cast<double>(std::abs(plant.state(c)));
      }
      terms.push_back(sums);
    }

    const long double sample_time = static_cast<S>(period);
    Observer observer = make(omega_t);
    for (int k = 0; k < samples; ++k) {
      const int drive = drives[static_cast<std::size_t>(k)];
      plant.step(drive);
      const auto u = static_cast<S>(drive / (nordsieck(n, sample_time) * gain));
      ASSERT_EQ(observer.update(static_cast<S>(plant.output()), u), StepStatus::ok);
    }
    for (int r = 0; r < N; ++r) ASSERT_EQ(plant.state(r), end[static_cast<std::size_t>(r)]);

    // What the observer makes of an error in x_r, j samples later.
    Array<double, N> tolerance{};
    for (int r = 0; r < N; ++r) {
      Observer response = make(omega_t);
      Estimate state = Estimate::Zero();
      state(r) = static_cast<S>(1 / row_unit(r, sample_time));
      response.reset(state);
      for (std::size_t j = 0; j < terms.size(); ++j) {
        for (int to = 0; to < N; ++to) {
          tolerance[static_cast<std::size_t>(to)] +=
              p * static_cast<double>(roundings * std::abs(scaled(response, to))) *
              terms[j][static_cast<std::size_t>(r)];
        }
        response.update(S(0), S(0));
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
  static void bounded_and_correct() {
    for (const double omega_t : omega_t_grid()) {
      SCOPED_TRACE(omega_t);
      if (!Observer::make(config(omega_t))) continue;  // judged by gains_equal_reference
      Observer observer = make(omega_t);
      const double rate = std::min(1.0, omega_t * Traits::slowest);
      const S scale = std::abs(whole_gain(omega_t)(n)) / static_cast<S>(rate);
      const S d = static_cast<S>(0.5) * scale;
      const S u = -d / static_cast<S>(gain);
      const S y = 1;
      S peak = 0;
      const int settling = settling_samples(omega_t);
      for (int i = 0; i < settling; ++i) {
        ASSERT_EQ(observer.update(y, u), StepStatus::ok);
        peak = std::max(peak, std::abs(observer.total_disturbance()));
      }
      // Unit jump: each level overshoots by no more than all its binomials together.
      EXPECT_LE(peak, std::ldexp(scale, N * p));
      const S scaled_d = d * static_cast<S>(nordsieck(n, static_cast<long double>(period)));
      const auto tolerance = [&](int to) {
        return roundings *
               (rounding_gain(omega_t, 0, to) + rounding_gain(omega_t, n, to) * scaled_d);
      };
      const S y_tolerance = tolerance(0);
      const S d_tolerance = tolerance(n);
      // It would not hide a wrong one.
      EXPECT_LT(d_tolerance, scale * static_cast<S>(std::is_same_v<S, float> ? 0.05 : 1e-9));
      for (int i = 0; i < 20; ++i) {
        ASSERT_EQ(observer.update(y, u), StepStatus::ok);
        expect_near(observer.template estimate<0>(), y, y_tolerance);
        expect_near(observer.total_disturbance(), d, d_tolerance);
      }
    }
  }

  /// y = sin(nu t) without input: d = y^(n). The estimate lags by at most the sum of the time
  /// constants of all N p poles (and one sample). With a model less is unknown than d, but of
  /// another size: y'' + a_1 y' + a_0 y of a plant with poles.
  static void follows_motion() {
    for (const double omega_t : {0.01, 0.1, 1.0, 3.0, 6.0}) {
      SCOPED_TRACE(omega_t);
      const Config settings = config(omega_t);
      if (!Observer::make(settings)) continue;
      Observer observer = make(omega_t);
      const double memory = 1 + 1 / (omega_t * Traits::slowest);
      const double nu_t = 0.02 / (N * p) / memory;
      const double lag = N * p * memory * nu_t;  // radians
      const double nu = nu_t / static_cast<double>(settings.sample_time);
      const double amplitude = std::pow(nu, n);
      double unknown = amplitude;
      if constexpr (requires { Traits::unknown_amplitude(settings, nu); }) {
        unknown = Traits::unknown_amplitude(settings, nu);
      }
      const double y_rounding = static_cast<double>(roundings * rounding_gain(omega_t, 0, 0));
      const double d_rounding = static_cast<double>(roundings * rounding_gain(omega_t, 0, n));
      const int settling = settling_samples(omega_t);
      for (int i = 0; i < settling + 200; ++i) {
        const double phase = nu_t * i;
        ASSERT_EQ(observer.update(static_cast<S>(std::sin(phase)), S(0)), StepStatus::ok);
        if (i < settling) continue;
        const double d = amplitude * std::sin(phase + n * std::acos(0.0));
        // Twice: for m > 1 the levels overtake what they predict.
        ASSERT_NEAR(static_cast<double>(observer.total_disturbance()), d,
                    2 * lag * unknown + d_rounding);
        ASSERT_NEAR(static_cast<double>(observer.template estimate<0>()), std::sin(phase),
                    lag + y_rounding);
      }
    }
  }

  /// Against the continuous observer (RK4, fine) under a smooth y and an input that both see held
  /// over the same coarse intervals. Poles are matched and the chain is exact under a held input; y
  /// enters the sampled observer at the end of its sample, where the innovation filter ((1 - w) /
  /// (1 - rho w))^N differs from (s / (s + omega))^N by N omega T / 2: order 1, no more.
  static void order_of_accuracy() {
    constexpr double omega = 3;
    constexpr double hold = 0.25;
    constexpr int holds = 12;
    const auto output = [](double t) { return 0.4 + std::sin(1.3 * t); };
    const auto input = [](int interval) { return std::cos(1.0 + interval); };

    using Continuous = typename Traits::Continuous;
    const auto continuous = Continuous::make(Traits::continuous_config(omega, gain)).value();
    using State = typename Continuous::State;
    typename Continuous::Estimate start = Continuous::Estimate::Zero();
    start(0) = output(0);
    State z = Continuous::state_at(start);
    constexpr int fine = 400;
    constexpr double h = hold / fine;
    for (int i = 0; i < holds * fine; ++i) {
      const double t = i * h;
      const double u = input(i / fine);
      const State k1 = continuous.derivative(t, z, output(t), u);
      const State k2 = continuous.derivative(t + h / 2, z + h / 2 * k1, output(t + h / 2), u);
      const State k3 = continuous.derivative(t + h / 2, z + h / 2 * k2, output(t + h / 2), u);
      const State k4 = continuous.derivative(t + h, z + h * k3, output(t + h), u);
      z = z + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4);
    }
    const auto truth = Continuous::estimate(z);

    const auto deviation = [&](int per_hold) {
      const double sample_time = hold / per_hold;
      Observer observer = Observer::make(Traits::config(omega, sample_time, gain)).value();
      EXPECT_EQ(observer.reset(static_cast<S>(output(0))), StepStatus::ok);
      for (int i = 0; i < holds * per_hold; ++i) {
        observer.update(static_cast<S>(output((i + 1) * sample_time)),
                        static_cast<S>(input(i / per_hold)));
      }
      double worst = 0;
      for (int r = 0; r < N; ++r) {
        const double unit = choose(N, r) * std::pow(omega * Traits::fastest, r);
        worst = std::max(worst,
                         std::abs(static_cast<double>(observer.estimate()(r)) - truth(r)) / unit);
      }
      return worst;
    };
    // Step halving; float stops where rounding begins.
    int per_hold = std::is_same_v<S, float> ? 16 : 64;
    per_hold *= p;
    const double coarse = deviation(per_hold);
    const double halved = deviation(2 * per_hold);
    EXPECT_LT(halved, 0.1);
    EXPECT_NEAR(std::log2(coarse / halved), 1.0, 0.15);
  }

  // ---- state

  static void reset_starts_anew() {
    Observer observer = warm();
    observer.predict(S(1));
    EXPECT_EQ(observer.reset(S(3)), StepStatus::ok);
    Observer fresh = make(0.5);
    fresh.predict(S(1));  // the actuator still holds it
    fresh.reset(S(3));
    EXPECT_TRUE(same_observer(observer, fresh));
    EXPECT_EQ(observer.missed(), 0);
    EXPECT_EQ(observer.innovation(), S(0));
    EXPECT_EQ(observer.estimate()(0), S(3));
    for (int r = 1; r < N; ++r) {
      bool is_output = false;
      if constexpr (requires { Traits::is_output(r); }) is_output = Traits::is_output(r);
      EXPECT_EQ(observer.estimate()(r), S(is_output ? 3 : 0)) << r;
    }
    Random random(3);
    for (int k = 0; k < 20; ++k) {
      const S y = static_cast<S>(random.uniform(-1, 1));
      EXPECT_EQ(observer.update(y, input(0.5)), fresh.update(y, input(0.5)));
      EXPECT_TRUE(same_observer(observer, fresh));
    }

    Estimate state;
    for (int r = 0; r < N; ++r) {
      state(r) = static_cast<S>((r + 1.5) / row_unit(r, static_cast<long double>(period)));
    }
    EXPECT_EQ(observer.reset(state), StepStatus::ok);
    for (int level = 0; level < p; ++level) {
      for (int r = 0; r < N; ++r) {
        expect_near(observer.level_estimate(level)(r), state(r),
                    static_cast<S>(4 * N * epsilon) * state(r));
      }
    }
  }

  static void reset_refuses_bad_state() {
    const Observer before = warm();
    for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()}) {
      Observer observer = before;
      EXPECT_EQ(observer.reset(bad), StepStatus::state_rejected);
      EXPECT_TRUE(same_observer(observer, before));
      for (int r = 0; r < N; ++r) {
        Estimate state = Estimate::Constant(1);
        state(r) = bad;
        EXPECT_EQ(observer.reset(state), StepStatus::state_rejected) << r;
        EXPECT_TRUE(same_observer(observer, before));
      }
    }
  }

  static void copies_are_independent() {
    Observer a = warm();
    Observer b = a;
    Observer untouched = a;
    const Observer witness = a;
    Random random(5);
    for (int k = 0; k < 60; ++k) {
      const S y = static_cast<S>(random.uniform(-1, 1));
      const S u = input(random.uniform(-1, 1));
      if (k % 7 == 3) {
        a.predict(u);
        b.predict(u);
      } else {
        EXPECT_EQ(a.update(y, u), b.update(y, u));
      }
      EXPECT_TRUE(same_observer(a, b));
    }
    EXPECT_TRUE(same_observer(untouched, witness));
    EXPECT_FALSE(same_observer(a, witness));
    untouched = a;
    EXPECT_TRUE(same_observer(untouched, a));
  }

  /// The same data, already rounded to float.
  static void float_agrees_with_double() {
    using Wide = typename Traits::template Rebind<double>;
    constexpr double omega_t = 0.5;
    Observer narrow = make(omega_t);
    Wide wide = LawsOf<Wide>::make(omega_t);
    // Scaled states stay below their largest gain times 2 N, y and the input being below 1.
    Array<S, N> tolerance{};
    for (int to = 0; to < N; ++to) {
      for (int from = 0; from < N; ++from) {
        tolerance[static_cast<std::size_t>(to)] +=
            2 * N * roundings * rounding_gain(omega_t, from, to);
      }
    }
    Random random(23);
    for (int i = 0; i < 400; ++i) {
      const auto y = static_cast<S>(random.uniform(-1, 1));
      const auto u = input(random.uniform(-1, 1));
      narrow.update(y, u);
      wide.update(static_cast<double>(y), static_cast<double>(u));
      for (int r = 0; r < N; ++r) {
        const S allowed = tolerance[static_cast<std::size_t>(r)];
        expect_near(narrow.estimate()(r), static_cast<S>(wide.estimate()(r)), allowed);
      }
    }
  }

  /// Constant disturbance, u = -d / b0, y stays put: a million samples after the transient the
  /// disturbance is still within the rounding scale.
  static void float_does_not_drift() {
    constexpr double omega_t = 0.5;
    const Config settings = config(omega_t);
    Observer observer = make(omega_t);
    const double omega = omega_t / period * Traits::fastest;
    const S y = static_cast<S>(1.3);
    const S d = static_cast<S>(0.3 * std::pow(omega, n));
    const S u = -d / static_cast<S>(gain);
    const int settling = settling_samples(omega_t);
    for (int i = 0; i < settling; ++i) observer.update(y, u);
    S worst = 0;
    for (int i = 0; i < 1000000; ++i) {
      observer.update(y, u);
      worst = std::max(worst, std::abs(observer.total_disturbance() - d));
    }
    EXPECT_LE(static_cast<double>(worst),
              1e-6 * (std::pow(omega, n) * static_cast<double>(y) + static_cast<double>(d)))
        << settings.sample_time;
  }

  static void no_allocation() {
    Observer observer = make(0.5);
    Estimate state = Estimate::Constant(1);
    const S nan = hidden_nan<S>();
    S sink = 0;
    long count = -1;
    {
      const NoAllocation guard;
      for (int k = 0; k < 10; ++k) {
        observer.update(S(1), input(0.5));
        observer.update(nan, nan);
        observer.predict(input(0.1));
        observer.predict(input(0.1));
        observer.correct(S(1));
        sink += observer.estimate().sum() + observer.total_disturbance() + observer.innovation();
        sink += observer.level_estimate(0)(0);
        observer.reset(S(1));
        observer.reset(state);
        for (int i = 0; i < 150; ++i) observer.predict(S(0));
        observer.correct(S(1));
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

  static void update_is_predict_then_correct() {
    for (const double omega_t : {0.01, 0.5, 3.0}) {
      if (!Observer::make(config(omega_t))) continue;
      Observer whole = make(omega_t);
      Observer halves = whole;
      Random random(31);
      for (int k = 0; k < 100; ++k) {
        S y = static_cast<S>(random.uniform(-1, 1));
        S u = input(random.uniform(-1, 1));
        if (k % 11 == 5) y = hidden_nan<S>();
        if (k % 13 == 5) u = hidden_infinity<S>();
        if (k % 29 == 5) y = huge<S>();
        const StepStatus status = whole.update(y, u);
        const StepStatus predicted = halves.predict(u);
        EXPECT_EQ(status, predicted | halves.correct(y));
        ASSERT_TRUE(same_observer(whole, halves)) << "sample " << k;
        ASSERT_TRUE(finite(whole));
      }
    }
  }

  // ---- bad samples

  static void bad_measurement_is_a_missing_one() {
    for (const S bad :
         {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>(), -hidden_nan<S>()}) {
      Observer hit = warm();
      Observer missing = hit;
      EXPECT_EQ(hit.update(bad, input(0.25)), StepStatus::measurement_rejected);
      EXPECT_EQ(missing.predict(input(0.25)), StepStatus::ok);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_EQ(hit.missed(), 1);
      EXPECT_EQ(hit.update(S(0.5), input(0.125)), StepStatus::gap_bridged);
      EXPECT_EQ(missing.update(S(0.5), input(0.125)), StepStatus::gap_bridged);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_EQ(hit.missed(), 0);
      EXPECT_EQ(hit.update(S(0.5), input(0.125)), StepStatus::ok);
      EXPECT_TRUE(finite(hit));
    }
  }

  static void bad_input_is_the_last_good_one() {
    for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()}) {
      Observer hit = warm();
      Observer held = hit;
      const S last = hit.applied_input();
      EXPECT_NE(last, S(0));
      EXPECT_EQ(hit.update(S(0.5), bad), StepStatus::input_rejected);
      EXPECT_EQ(held.update(S(0.5), last), StepStatus::ok);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit.predict(bad), StepStatus::input_rejected);
      held.predict(last);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit.update(hidden_nan<S>(), bad),
                StepStatus::input_rejected | StepStatus::measurement_rejected);
      held.predict(last);
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit.update(S(0.5), input(0.125)), StepStatus::gap_bridged);
      held.update(S(0.5), input(0.125));
      EXPECT_TRUE(same_observer(hit, held));
      EXPECT_EQ(hit.applied_input(), input(0.125));
    }
  }

  /// Finite samples that would make the state infinite, 3e38 in float.
  static void overflow_is_dropped() {
    // b0 so large that b0 T u alone is too much.
    const double b0 = 16 / period;
    for (const S bad : {huge<S>(), -huge<S>()}) {
      Observer hit = warm(0.5, b0);
      Observer missing = hit;
      EXPECT_EQ(hit.update(bad, input(0.25)), StepStatus::measurement_rejected);
      missing.predict(input(0.25));
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_EQ(hit.update(S(0.5), input(0.125)), StepStatus::gap_bridged);
      missing.update(S(0.5), input(0.125));
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_TRUE(finite(hit));

      const S last = hit.applied_input();
      EXPECT_EQ(hit.update(S(0.5), bad), StepStatus::input_rejected);
      missing.update(S(0.5), last);
      EXPECT_TRUE(same_observer(hit, missing));
      EXPECT_TRUE(finite(hit));
    }
    // No u can go on from here: the state stands still.
    Observer observer = make(0.5);
    Estimate state = Estimate::Zero();
    state(0) = huge<S>();
    state(1) = huge<S>() / static_cast<S>(8);
    if (observer.reset(state) == StepStatus::ok) {
      for (int k = 0; k < 200; ++k) {
        const StepStatus status = observer.predict(S(0));
        if (status != StepStatus::ok) {
          EXPECT_EQ(status, StepStatus::prediction_dropped);
        }
        ASSERT_TRUE(finite(observer));
      }
      EXPECT_GE(observer.missed(), 200);
      // A good measurement restarts it.
      EXPECT_EQ(observer.correct(S(1)), StepStatus::restarted);
      EXPECT_EQ(observer.estimate()(0), S(1));
    }
  }

  // ---- symmetries

  static void negative_input_gain() {
    Observer positive = make(0.5, gain);
    Observer negative = make(0.5, -gain);
    EXPECT_EQ(negative.input_gain(), -positive.input_gain());
    Random random(41);
    for (int k = 0; k < 50; ++k) {
      const S y = static_cast<S>(random.uniform(-1, 1));
      const S u = input(random.uniform(-1, 1));
      positive.update(y, u);
      negative.update(y, -u);
      for (int r = 0; r < N; ++r) {
        ASSERT_TRUE(same_bits(positive.estimate()(r), negative.estimate()(r)));
      }
    }
    // The sign does matter.
    positive.update(S(0.5), input(0.5));
    negative.update(S(0.5), input(0.5));
    EXPECT_NE(positive.total_disturbance(), negative.total_disturbance());
  }

  /// A linear observer: four times the data, four times the estimate, bit for bit.
  static void homogeneous() {
    Observer one = make(0.5);
    Observer four = one;
    Random random(43);
    for (int k = 0; k < 50; ++k) {
      const S y = static_cast<S>(random.uniform(-1, 1));
      const S u = input(random.uniform(-1, 1));
      one.update(y, u);
      four.update(4 * y, 4 * u);
      for (int r = 0; r < N; ++r) {
        ASSERT_TRUE(same_bits(S(4 * one.estimate()(r)), four.estimate()(r)));
      }
    }
  }

  // ---- retuning

  static void retune_keeps_estimate() {
    Observer observer = warm();
    observer.predict(input(0.75));  // in the middle of a step
    const Observer before = observer;
    ASSERT_TRUE(observer.retune(config(1.5)).has_value());
    EXPECT_TRUE(same_observer(observer, before));
    // The new bandwidth is in force.
    Observer fresh = make(1.5);
    observer.reset(S(0));
    observer.correct(S(1));
    fresh.reset(S(0));
    fresh.correct(S(1));
    for (int r = 0; r < N; ++r) EXPECT_EQ(observer.estimate()(r), fresh.estimate()(r));
    // Gaps follow it as well.
    for (Observer* o : {&observer, &fresh}) {
      o->reset(S(0));
      for (int i = 0; i < 3; ++i) o->predict(S(0));
      o->correct(S(1));
    }
    for (int r = 0; r < N; ++r) EXPECT_EQ(observer.estimate()(r), fresh.estimate()(r));
  }

  /// dhat += (b0_old - b0_new) u: ADRC asks for the same u as before.
  static void retune_rebalances_input_gain() {
    for (const double new_gain : {3.7, 0.4, -1.3}) {
      Observer observer = warm();
      const Observer before = observer;
      const S u = observer.applied_input();
      ASSERT_TRUE(observer.retune(config(0.5, new_gain)).has_value());
      expect_near(observer.input_gain(), static_cast<S>(new_gain),
                  static_cast<S>(32 * N * epsilon));
      const S moved = (static_cast<S>(gain) - static_cast<S>(new_gain)) * u;
      for (int level = 0; level < p; ++level) {
        const Estimate old = before.level_estimate(level);
        const Estimate now = observer.level_estimate(level);
        for (int r = 0; r < N; ++r) {
          if (r == n) {
            expect_near(now(r), old(r) + moved,
                        static_cast<S>(16 * N * epsilon) * (std::abs(old(r)) + std::abs(moved)));
          } else {
            EXPECT_TRUE(same_bits(now(r), old(r))) << r;
          }
        }
      }
      EXPECT_EQ(observer.applied_input(), u);

      // A reference for which the old law asks for the input that is applied.
      const auto law = [](double b0) {
        return esokit::AdrcLaw<n, S>::make(
                   {.controller_bandwidth = S(2), .input_gain = static_cast<S>(b0)})
            .value();
      };
      esokit::EigenMatrix<S, n + 1> reference = esokit::EigenMatrix<S, n + 1>::Zero();
      for (int i = 0; i < n; ++i) reference(i) = before.estimate()(i);
      reference(n) = static_cast<S>(gain) * u + before.total_disturbance();
      const S was = law(gain).control(before.estimate(), reference);
      const S is = law(new_gain).control(observer.estimate(), reference);
      const auto unit = static_cast<S>(32 * N * epsilon);
      // What cancels is dhat.
      const S terms = std::abs(u) + std::abs(before.total_disturbance() / static_cast<S>(new_gain));
      expect_near(was, u, unit * terms);
      expect_near(is, was, unit * terms);
    }
  }

  static void retune_rescales_sample_time() {
    Observer observer = warm();
    const Observer before = observer;
    constexpr double omega_t = 0.5;
    const Config faster = Traits::config(omega_t / period, period / 3, gain);
    ASSERT_TRUE(observer.retune(faster).has_value());
    expect_near(observer.sample_time(), static_cast<S>(period / 3), 2 * static_cast<S>(epsilon));
    for (int level = 0; level < p; ++level) {
      const Estimate old = before.level_estimate(level);
      for (int r = 0; r < N; ++r) {
        expect_near(observer.level_estimate(level)(r), old(r),
                    static_cast<S>(16 * N * epsilon) * std::abs(old(r)));
      }
    }
    // Gains and input follow the new sample time.
    Observer fresh = Observer::make(faster).value();
    for (Observer* o : {&observer, &fresh}) {
      o->reset(S(0));
      o->update(S(1), S(3));
    }
    for (int r = 0; r < N; ++r) EXPECT_EQ(observer.estimate()(r), fresh.estimate()(r));
  }

  static void refused_retune_changes_nothing() {
    Observer observer = warm();
    observer.predict(input(0.5));
    const Observer before = observer;
    const double nan = hidden_nan<double>();
    const Config bad[] = {
        Traits::config(nan, period, gain),   Traits::config(-50, period, gain),
        Traits::config(50, 0, gain),         Traits::config(50, period, 0),
        Traits::config(50, period, gain, 0),
    };
    const char* refusals[] = {Traits::field, Traits::field,
                              "sample_time: must be finite and positive",
                              "input_gain: must be finite and not zero (negative is fine)",
                              "max_gap: must be 1 .. 65000"};
    for (std::size_t i = 0; i < std::size(bad); ++i) {
      const auto outcome = observer.retune(bad[i]);
      EXPECT_TRUE(refusal(outcome).starts_with(refusals[i])) << refusal(outcome);
      EXPECT_TRUE(same_observer(observer, before));
    }
    // A good config that this estimate cannot follow.
    Observer strained = make(0.5, 1e-3);
    ASSERT_EQ(strained.predict(huge<S>() / 4), StepStatus::ok);
    const Observer strained_before = strained;
    EXPECT_FALSE(strained.retune(config(0.5, 1e4)).has_value());
    EXPECT_TRUE(same_observer(strained, strained_before));

    Observer untouched = before;
    EXPECT_EQ(observer.correct(S(2)), untouched.correct(S(2)));
    EXPECT_TRUE(same_observer(observer, untouched));
    EXPECT_EQ(observer.update(S(2), S(1)), untouched.update(S(2), S(1)));
    EXPECT_TRUE(same_observer(observer, untouched));
  }

  // ---- gaps

  /// M predictions and a correction equal one step of an observer that is made for M T.
  static void gap_gain_is_that_of_longer_sample() {
    for (const double omega_t : {0.1, 1.0, 3.0}) {
      if (!Observer::make(config(omega_t))) continue;
      for (const int samples : {2, 3, 7, 20}) {
        SCOPED_TRACE(::testing::Message() << omega_t << " x " << samples);
        const double long_period = samples * period;  // rounded to double
        const long double unit_roundoff =
            std::max<long double>(epsilon, std::numeric_limits<double>::epsilon());
        Observer bridging = make(omega_t);
        Observer slow = Observer::make(Traits::config(omega_t / period, long_period, gain)).value();
        Estimate start;
        long double scale = 0;
        for (int r = 0; r < N; ++r) {
          start(r) = static_cast<S>((r % 2 == 0 ? 0.7 : -0.4) /
                                    row_unit(r, static_cast<long double>(long_period)));
        }
        bridging.reset(start);
        slow.reset(start);
        const auto u =
            static_cast<S>(0.5 / gain / nordsieck(n, static_cast<long double>(long_period)));
        for (int i = 0; i < samples; ++i) bridging.predict(u);
        slow.predict(u);
        for (int r = 0; r < N; ++r) {
          scale = std::max(scale, std::abs(slow.estimate()(r)) *
                                      row_unit(r, static_cast<long double>(long_period)));
        }
        EXPECT_EQ(bridging.missed(), samples);
        EXPECT_EQ(bridging.correct(S(9)), StepStatus::gap_bridged);
        EXPECT_EQ(slow.correct(S(9)), StepStatus::ok);
        scale += 9;
        for (int r = 0; r < N; ++r) {
          const long double unit = row_unit(r, static_cast<long double>(long_period));
          EXPECT_LE(std::abs(bridging.estimate()(r) - slow.estimate()(r)) * unit,
                    16 * N * p * unit_roundoff * scale)
              << r;
        }
      }
    }
  }

  /// One correction in M, for ever: the error decays as with an observer for M T.
  static void recurring_gaps_are_stable() {
    for (const double omega_t : {0.1, 1.0, 3.0}) {
      if (!Observer::make(config(omega_t))) continue;
      for (int every = 1; every <= 20; ++every) {
        SCOPED_TRACE(::testing::Message() << omega_t << ", one in " << every);
        Observer observer = make(omega_t);
        Estimate state;
        for (int r = 0; r < N; ++r) {
          state(r) = static_cast<S>(1 / row_unit(r, static_cast<long double>(period * every)));
        }
        ASSERT_EQ(observer.reset(state), StepStatus::ok);
        const int corrections = settling_samples(omega_t * every);
        for (int k = 0; k < corrections; ++k) {
          for (int i = 0; i < every; ++i) observer.predict(S(0));
          ASSERT_EQ(observer.correct(S(0)), every == 1 ? StepStatus::ok : StepStatus::gap_bridged);
        }
        for (int r = 0; r < N; ++r) {
          EXPECT_LE(std::abs(observer.estimate()(r)) *
                        row_unit(r, static_cast<long double>(period * every)),
                    1e-6)
              << r;
        }
      }
    }
  }

  static void long_gap_restarts() {
    constexpr int max_gap = 5;
    const auto after = [](int missing) {
      Observer observer = make(0.5, gain, max_gap);
      observer.update(S(1), input(0.5));
      for (int i = 0; i < missing; ++i) observer.predict(input(0.5));
      return observer;
    };
    Observer bridged = after(max_gap);
    EXPECT_EQ(bridged.update(S(2), input(0.5)), StepStatus::gap_bridged);

    Observer restarted = after(max_gap + 1);
    EXPECT_EQ(restarted.update(hidden_nan<S>(), input(0.5)), StepStatus::measurement_rejected);
    EXPECT_EQ(restarted.missed(), max_gap + 2);
    EXPECT_EQ(restarted.update(S(2), input(0.5)), StepStatus::restarted);
    EXPECT_EQ(restarted.missed(), 0);
    Observer fresh = make(0.5, gain, max_gap);
    fresh.predict(input(0.5));
    fresh.reset(S(2));
    EXPECT_TRUE(same_observer(restarted, fresh));
    EXPECT_EQ(restarted.update(S(2), input(0.5)), StepStatus::ok);

    // The count of missing samples does not wrap around.
    Observer forgotten = make(0.5, gain, 65000);
    forgotten.update(S(1), S(0));
    for (int i = 0; i < 70000; ++i) forgotten.predict(S(0));
    EXPECT_EQ(forgotten.correct(S(1)), StepStatus::restarted);
  }
};

/// The suite for `register_laws`.
template <class Observer>
struct ObserverLaws {
  static std::vector<NamedLaw> laws() {
#define ESOKIT_LAW(law)                                                        \
  [] {                                                                         \
    constexpr const char* excuse = ObserverTraits<Observer>::excuse(Law::law); \
    if constexpr (excuse == nullptr) {                                         \
      return NamedLaw{#law, &LawsOf<Observer>::law};                           \
    } else {                                                                   \
      return NamedLaw{#law, nullptr, excuse};                                  \
    }                                                                          \
  }()
    return {
        ESOKIT_LAW(gains_equal_reference),
        ESOKIT_LAW(polynomial_equals_reference),
        ESOKIT_LAW(unbiased_on_own_model_class),
        ESOKIT_LAW(bounded_and_correct),
        ESOKIT_LAW(follows_motion),
        ESOKIT_LAW(order_of_accuracy),
        ESOKIT_LAW(reset_starts_anew),
        ESOKIT_LAW(reset_refuses_bad_state),
        ESOKIT_LAW(copies_are_independent),
        ESOKIT_LAW(float_agrees_with_double),
        ESOKIT_LAW(float_does_not_drift),
        ESOKIT_LAW(no_allocation),
        ESOKIT_LAW(update_is_predict_then_correct),
        ESOKIT_LAW(bad_measurement_is_a_missing_one),
        ESOKIT_LAW(bad_input_is_the_last_good_one),
        ESOKIT_LAW(overflow_is_dropped),
        ESOKIT_LAW(negative_input_gain),
        ESOKIT_LAW(homogeneous),
        ESOKIT_LAW(retune_keeps_estimate),
        ESOKIT_LAW(retune_rebalances_input_gain),
        ESOKIT_LAW(retune_rescales_sample_time),
        ESOKIT_LAW(refused_retune_changes_nothing),
        ESOKIT_LAW(gap_gain_is_that_of_longer_sample),
        ESOKIT_LAW(recurring_gaps_are_stable),
        ESOKIT_LAW(long_gap_restarts),
    };
#undef ESOKIT_LAW
  }
};

}  // namespace esokit_test

#pragma GCC diagnostic pop
