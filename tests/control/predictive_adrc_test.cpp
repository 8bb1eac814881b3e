// PredictiveAdrc: equal to the observer's update followed by AdrcLaw, for every observer; bad
// samples, late reports, the start; and the paper's scaled-state form.

#include <support/no_allocation.hpp>
//
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <limits>
#include <numeric>
#include <support/dense_filter.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test::control_predictive_adrc_test {

using esokit::PredictiveAdrc;
using esokit::StepStatus;

constexpr double period = 1e-3;
constexpr double b0 = 230;
constexpr double omega_c = 100;

template <class Observer>
using Controller = PredictiveAdrc<Observer>;

template <class Observer>
using LawOf = esokit::AdrcLaw<Observer::order, typename Observer::scalar_type>;

template <class Observer>
LawOf<Observer> law_of(const Controller<Observer>& controller) {
  using S = typename Observer::scalar_type;
  return LawOf<Observer>::make({.gains = controller.gains(), .input_gain = static_cast<S>(b0)})
      .value();
}

using Numbers = std::vector<double>;

/// Reference signal with its derivatives, all in step with omega_c.
Numbers reference_at(int k, int count) {
  Numbers r;
  for (int i = 0; i < count; ++i) {
    r.push_back(0.5 * std::pow(20, i) * std::sin(20 * k * period + i * 1.5707963));
  }
  return r;
}

/// A measurement every sample but some: missing, NaN, infinite, too large. Limits bind at times.
enum class Sample { good, missing, bad };
Sample sample_at(int k, bool gaps) {
  if (!gaps) return Sample::good;
  if (k % 37 == 20) return Sample::missing;
  if (k % 53 >= 50) return Sample::bad;
  return Sample::good;
}

/// The two-phase controller beside the one-phase form on a copy of its observer, which is driven by
/// the same u. Of any type, so that what compares them is compiled once.
class Both {
 public:
  struct Outcome {
    double u, expected;
    double blind;           ///< u without the measurement
    Numbers before, after;  ///< the estimate around the correction
    double innovation;
    StepStatus status, told;  ///< of the observer, of the controller
    bool same;                ///< all their states, bit for bit
  };
  virtual ~Both() = default;
  virtual Outcome step(const Numbers& r, const Numbers& next, double y, Sample what) = 0;

  Numbers gains;
  bool single = false;  ///< computes in float
};

template <class Observer>
class BothOf final : public Both {
  using S = typename Observer::scalar_type;
  static constexpr int n = Observer::order;
  using Vector = esokit::EigenMatrix<S, n + 1>;

 public:
  BothOf(const typename Observer::Config& config, double limit)
      : controller_(Controller<Observer>::make(settings(config, limit)).value()),
        law_(law_of<Observer>(controller_)),
        limiter_(esokit::Limiter<S>::make(settings(config, limit).limits, static_cast<S>(period))
                     .value()),
        observer_(Observer::make(config).value()) {
    for (const S& gain : law_.gains()) gains.push_back(static_cast<double>(gain));
    single = std::is_same_v<S, float>;
    controller_.set_reference(vector(reference_at(0, n + 1)));
  }

  Outcome step(const Numbers& r, const Numbers& next, double y, Sample what) override {
    const bool missing = what == Sample::missing;
    Outcome now{};
    now.blind = wanted(r);
    now.before = numbers(observer_.estimate());
    if (!missing) now.status = observer_.correct(static_cast<S>(y));
    now.expected = static_cast<double>(limiter_.clamp(static_cast<S>(wanted(r))));
    const S u = missing ? controller_.control_without_measurement()
                        : controller_.control(static_cast<S>(y));
    now.u = static_cast<double>(u);
    now.after = numbers(observer_.estimate());
    now.innovation = static_cast<double>(observer_.innovation());
    now.status |= observer_.predict(u);
    limiter_.track(u);
    now.told = controller_.prepare(vector(next));
    now.same = controller_.status() == now.told;
    const auto a = controller_.observer().estimate();
    const auto b = observer_.estimate();
    for (int i = 0; i < Observer::size; ++i) now.same = now.same && same_bits(a(i), b(i));
    return now;
  }

 private:
  static typename Controller<Observer>::Config settings(const typename Observer::Config& config,
                                                        double limit) {
    typename Controller<Observer>::Config settings;
    settings.observer = config;
    settings.controller_bandwidth = static_cast<S>(omega_c);
    settings.limits.lower = static_cast<S>(-limit);
    settings.limits.upper = static_cast<S>(limit);
    settings.limits.rate = static_cast<S>(limit / 3 / period);
    return settings;
  }
  static Vector vector(const Numbers& r) {
    Vector result;
    for (int i = 0; i <= n; ++i) result(i) = static_cast<S>(r[static_cast<std::size_t>(i)]);
    return result;
  }
  static Numbers numbers(const typename Observer::Estimate& z) {
    Numbers result;
    for (int i = 0; i <= n; ++i) result.push_back(static_cast<double>(z(i)));
    return result;
  }
  double wanted(const Numbers& r) const {
    return static_cast<double>(law_.control(observer_.estimate(), vector(r)));
  }

  Controller<Observer> controller_;
  LawOf<Observer> law_;
  esokit::Limiter<S> limiter_;
  Observer observer_;
};

/// What the rounding of u is measured by: rounding of y alone moves u by slope eps |y|, of the
/// states by weight eps |x|.
double rounding_scale(const Both::Outcome& now, Numbers gains, const Numbers& r, double y) {
  const std::size_t n = gains.size();
  gains.push_back(1);
  double scale = std::abs(now.blind);
  for (std::size_t i = 0; i <= n; ++i) {
    scale += gains[i] * (std::abs(r[i]) * (i < n ? 1 : 0) + std::abs(now.before[i])) / b0;
    // How far the correction moves each estimate, were y all innovation.
    const double step = std::abs(now.after[i] - now.before[i]);
    scale += gains[i] * step / (std::abs(now.innovation) + 1e-30) * std::abs(y) / b0;
  }
  return scale;
}

/// What differs is the rounding of one u.
void equals_one_phase(Both&& both, double limit, bool gaps) {
  constexpr int samples = 400;
  const int n = static_cast<int>(both.gains.size());
  Random random(29);
  // Of the order of the weights: w_0 y and the like, each sum of n + 1 of them.
  const double eps = both.single ? static_cast<double>(std::numeric_limits<float>::epsilon())
                                 : std::numeric_limits<double>::epsilon();
  int clipped = 0;
  int moved = 0;
  double last = 0;
  for (int k = 0; k < samples; ++k) {
    SCOPED_TRACE(k);
    const Numbers r = reference_at(k, n + 1);
    const double y = 0.5 * std::sin(20 * k * period) + random.uniform(-0.01, 0.01);
    const Sample what = sample_at(k, gaps);
    double used = y;
    if (what == Sample::bad) {
      const double large = both.single ? static_cast<double>(huge<float>()) : huge<double>();
      used = k % 3 == 0 ? hidden_nan<double>() : k % 3 == 1 ? hidden_infinity<double>() : large;
    }
    const auto now = both.step(r, reference_at(k + 1, n + 1), used, what);
    ASSERT_NEAR(now.u, now.expected, 64 * eps * rounding_scale(now, both.gains, r, y));
    ASSERT_TRUE(std::isfinite(now.u) && (what != Sample::bad || now.status != StepStatus::ok));
    clipped += std::abs(now.u) >= limit * 0.999 ? 1 : 0;
    moved += now.u < last || now.u > last ? 1 : 0;
    last = now.u;
    ASSERT_TRUE(now.told == now.status && now.same);
  }
  EXPECT_TRUE(moved > samples / 4 && (limit < 1e3 || clipped == 0)) << moved << ", " << clipped;
}

template <class Observer>
void equals_one_phase(const typename Observer::Config& config) {
  equals_one_phase(BothOf<Observer>(config, 1e7), 1e7, false);
  equals_one_phase(BothOf<Observer>(config, 30), 30, false);  // limited in magnitude and rate
  equals_one_phase(BothOf<Observer>(config, 1e7), 1e7, true);
}

template <class Observer>
typename Observer::Config by_bandwidth(double omega = 400) {
  using S = typename Observer::scalar_type;
  typename Observer::Config config;
  config.observer_bandwidth = static_cast<S>(omega);
  config.input_gain = static_cast<S>(b0);
  config.sample_time = static_cast<S>(period);
  return config;
}

template <int Order, class S, int Extension>
void linear_equals_one_phase() {
  using Observer = esokit::LinearEso<Order, S, Extension>;
  equals_one_phase<Observer>(by_bandwidth<Observer>());
}

TEST(PredictiveAdrc, equals_one_phase_linear) {
  linear_equals_one_phase<1, double, 1>();
  linear_equals_one_phase<2, double, 1>();
  linear_equals_one_phase<3, float, 2>();
}

TEST(PredictiveAdrc, equals_one_phase_cascade) {
  using Two = esokit::CascadeEso<2, 2>;
  auto config = by_bandwidth<Two>(200);
  config.bandwidth_factor = 2;
  equals_one_phase<Two>(config);
  using Three = esokit::CascadeEso<2, 3, float, 2>;
  auto other = by_bandwidth<Three>(100);
  other.bandwidth_factor = 2;
  equals_one_phase<Three>(other);
}

TEST(PredictiveAdrc, equals_one_phase_algebraic) {
  using Observer = esokit::AlgebraicEso<2>;
  auto config = by_bandwidth<Observer>(300);
  config.frequency_shift = 100;
  config.blanking = 0.02;  // the published estimate stands still at first
  equals_one_phase<Observer>(config);
  config.blanking = 0.0;
  equals_one_phase<Observer>(config);
}

template <class Filter>
typename Filter::Config by_noise() {
  using S = typename Filter::scalar_type;
  typename Filter::Config config{.input_gain = static_cast<S>(b0),
                                 .sample_time = static_cast<S>(period),
                                 .measurement_variance = static_cast<S>(1e-6),
                                 .inflation = static_cast<S>(0.5)};
  double bound = 1e-6;
  for (int i = 0; i < Filter::size; ++i) {
    config.disturbance_bounds[static_cast<std::size_t>(i)] = static_cast<S>(bound);
    config.initial_covariance(i, i) = static_cast<S>(bound * bound * 1e9);
    bound *= i == 0 ? 1e3 : 3e5;
  }
  return config;
}

TEST(PredictiveAdrc, equals_one_phase_extended_state_filter) {
  using Filter = esokit::ExtendedStateFilter<2>;
  auto config = by_noise<Filter>();
  equals_one_phase<Filter>(config);
  config.mode = esokit::RiccatiMode::frozen;
  equals_one_phase<Filter>(config);
  config.outlier_threshold = 100;
  config.measurement_variance = 1e-4;
  equals_one_phase<Filter>(config);
}

/// The gain depends on the innovation: one select, or one k(e), between y and u.
TEST(PredictiveAdrc, equals_one_phase_switched) {
  using Observer = esokit::AdjustableBandwidthEso<2>;
  auto config = by_bandwidth<Observer>();
  config.bandwidth_ratio = 0.6;
  equals_one_phase<Observer>(config);
}

TEST(PredictiveAdrc, equals_one_phase_nonlinear) {
  using Observer = esokit::NonlinearEso<2>;
  auto config = by_bandwidth<Observer>();
  config.shape = {.gain_alpha = 0.5, .alpha = 0.9, .gain_beta = 0.5, .beta = 0.1};
  config.error_scale = 0.01;
  config.gain_min = 0.5;
  config.gain_max = 1.5;
  equals_one_phase<Observer>(config);
}

/// A user's own law, of which nothing is known: its whole gain vector after the measurement.
struct OwnLaw {
  esokit::ScaledGain<3, double> gain(double e) const noexcept {
    const double share = 0.3 + 0.2 / (1 + e * e);
    return {share, 0.5 * share * share, 0.05 * share};
  }
};

struct OwnObserver : esokit::PredictorCorrector<2, double, 1, OwnLaw> {
  using Base = esokit::PredictorCorrector<2, double, 1, OwnLaw>;
  using Config = esokit::ChainConfig<double>;
  static esokit::Expected<OwnObserver, esokit::Error<double>> make(const Config& config) {
    if (auto ok = check_chain(config); !ok) return ok.error();
    return OwnObserver(config);
  }
  esokit::Check<double> retune(const Config&) { return {}; }

 private:
  explicit OwnObserver(const Config& config) : Base(config, {OwnLaw{}}) {}
};

TEST(PredictiveAdrc, equals_one_phase_for_a_law_of_ones_own) {
  equals_one_phase<OwnObserver>({.input_gain = b0, .sample_time = period});
}

using Square = std::vector<Numbers>;

/// M^-1 x; pivots as they come.
Numbers eliminated(Square m, Numbers x) {
  const std::size_t size = x.size();
  for (std::size_t k = 0; k < size; ++k) {
    for (std::size_t i = 0; i < size; ++i) {
      const double factor = i == k ? 0 : m[i][k] / m[k][k];
      for (std::size_t j = k; j < size; ++j) m[i][j] -= factor * m[k][j];
      x[i] -= factor * x[k];
    }
  }
  for (std::size_t i = 0; i < size; ++i) x[i] /= m[i][i];
  return x;
}

double sum(const Numbers& x) { return std::accumulate(x.begin(), x.end(), 0.0); }

/// (26), (51) with their corrections, word for word: x~ = T^-1 x, T^-1 = diag(k, 1) / b; A, B of
/// the exactly sampled chain, A~ = T^-1 (I - L C) A T, B~ = T^-1 (I - L C) B, L~ = T^-1 L:
///   u_k = ubar_k - (sum l~) y_k, xt_k = xbar_k + L~ y_k, xbar_(k+1) = A~ xt_k + B~ u_k,
///   ubar_(k+1) = (k_1 / b) r_(k+1) - sum xbar_(k+1).
struct PapersForm {
  explicit PapersForm(std::size_t n)
      : a(n + 1, Numbers(n + 1)), b(n + 1), l(n + 1), weights(n + 1), x_bar(n + 1) {
    const auto choose_of_n = [n](std::size_t i) {
      return choose(static_cast<int>(n), static_cast<int>(i));
    };
    for (std::size_t i = 0; i <= n; ++i) {
      for (std::size_t j = i; j <= n; ++j) {
        const int power = static_cast<int>(j - i);
        a[i][j] = std::pow(period, power) / factorial_of(power);
      }
      b[i] = i < n ? b0 * a[i][n] : 0;
      weights[i] = choose_of_n(i) * std::pow(omega_c, n - i) / b0;
    }
    // The gain from its poles by Ackermann's formula: predictor l = phi(A) O^-1 (0, .., 0, 1)'.
    const double rho = std::exp(-400 * period);
    Square observability;
    Numbers row(n + 1);
    row[0] = 1;
    for (std::size_t i = 0; i <= n; ++i) {
      observability.push_back(row);
      Numbers next(n + 1);
      for (std::size_t j = 0; j <= n; ++j) {
        for (std::size_t k = 0; k <= n; ++k) next[j] += row[k] * a[k][j];
      }
      row = next;
    }
    l[n] = 1;
    l = eliminated(observability, l);
    for (std::size_t count = 0; count <= n; ++count) {
      Numbers next(n + 1);
      for (std::size_t i = 0; i <= n; ++i) {
        next[i] = -rho * l[i];
        for (std::size_t k = 0; k <= n; ++k) next[i] += a[i][k] * l[k];
      }
      l = next;
    }
    l = eliminated(a, l);
    for (std::size_t i = 0; i <= n; ++i) l_sum += weights[i] * l[i];
  }

  double control(double r, double y) {
    const double u = weights[0] * r - sum(x_bar) - l_sum * y;
    Numbers x = x_bar;
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += weights[i] * l[i] * y;
    for (std::size_t i = 0; i < x.size(); ++i) {
      x_bar[i] = weights[i] * (b[i] - l[i] * b[0]) * u;
      for (std::size_t j = 0; j < x.size(); ++j) {
        x_bar[i] += weights[i] * (a[i][j] - l[i] * a[0][j]) / weights[j] * x[j];
      }
    }
    return u;
  }

  Square a;
  Numbers b, l, weights, x_bar;
  double l_sum = 0;
};

template <int n>
void equals_the_papers_scaled_form() {
  using Observer = esokit::LinearEso<n>;
  PapersForm form(n);
  typename Controller<Observer>::Config settings;
  settings.observer = by_bandwidth<Observer>();
  settings.controller_bandwidth = omega_c;
  auto controller = Controller<Observer>::make(settings).value();
  const auto reference = [](int k) { return 4 * std::sin(0.02 * k); };
  controller.set_reference(reference(0));
  Random random(31);
  double largest = 0;
  for (int k = 0; k < 500; ++k) {
    const double y = reference(k - 2) + random.uniform(-1e-3, 1e-3);
    const double u = form.control(reference(k), y);
    largest = std::max({largest, std::abs(u), std::abs(form.weights[0] * y), form.l_sum * 4});
    EXPECT_NEAR(controller.control(y), u, 1e-10 * largest) << k;
    controller.prepare(reference(k + 1));
  }
}

TEST(PredictiveAdrc, equals_the_papers_scaled_form) {
  equals_the_papers_scaled_form<1>();
  equals_the_papers_scaled_form<2>();
}

/// (52), (53) with their corrections: the same with L_k = P_k C' / s_k, new at every sample.
TEST(PredictiveAdrc, epadrc_equals_the_papers_scaled_form) {
  using Filter = esokit::ExtendedStateFilter<2>;
  Controller<Filter>::Config settings;
  settings.observer = by_noise<Filter>();
  settings.controller_bandwidth = omega_c;
  auto controller = Controller<Filter>::make(settings).value();
  DenseFilter<2, double> dense(period, b0);
  for (int i = 0; i < 3; ++i) {
    const double bound = settings.observer.disturbance_bounds[static_cast<std::size_t>(i)];
    dense.q(i, i) = 3 * bound * bound;
  }
  dense.p = settings.observer.initial_covariance;
  dense.r = settings.observer.measurement_variance;
  dense.theta = settings.observer.inflation;
  const Numbers weights{omega_c * omega_c / b0, 2 * omega_c / b0, 1 / b0};
  const auto reference = [](int k) { return 4 * std::sin(0.02 * k); };
  controller.set_reference(reference(0));
  Numbers x_bar(3);
  Random random(37);
  double largest = 0;
  double first_gain = 0;
  for (int k = 0; k < 300; ++k) {
    const auto l = dense.current_gain();
    double l_sum = 0;
    for (int i = 0; i < 3; ++i) l_sum += weights[static_cast<std::size_t>(i)] * l(i);
    const double y = reference(k - 2) + random.uniform(-1e-3, 1e-3);
    // (I - L C) belongs to the sample of the measurement, so it is here and not in A~, B~.
    const double e = y - x_bar[0] / weights[0];
    const double u = weights[0] * reference(k) - sum(x_bar) - l_sum * e;
    largest = std::max({largest, std::abs(u), l_sum * 4});
    // The dense covariances have lost digits to their conditioning.
    EXPECT_NEAR(controller.control(y), u, 1e-8 * largest) << k;
    Numbers x = x_bar;
    for (std::size_t i = 0; i < 3; ++i) x[i] += weights[i] * l(static_cast<int>(i)) * e;
    for (std::size_t i = 0; i < 3; ++i) {
      x_bar[i] = weights[i] * dense.b(static_cast<int>(i)) * u;
      for (std::size_t j = 0; j < 3; ++j) {
        const double a = dense.a(static_cast<int>(i), static_cast<int>(j));
        x_bar[i] += weights[i] * a / weights[j] * x[j];
      }
    }
    controller.prepare(reference(k + 1));
    dense.step_covariance(-(dense.a * l));
    if (k == 0) first_gain = l_sum;
    if (k == 299) {
      EXPECT_GT(std::abs(l_sum / first_gain - 1), 0.1);  // it did change
    }
  }
}

using Linear = esokit::LinearEso<2>;

Controller<Linear>::Config typical() {
  Controller<Linear>::Config config;
  config.observer = by_bandwidth<Linear>();
  config.controller_bandwidth = omega_c;
  return config;
}

template <class Observer>
Controller<Observer> warm(const typename Controller<Observer>::Config& config) {
  auto controller = Controller<Observer>::make(config).value();
  Random random(3);
  for (int k = 0; k < 30; ++k) {
    controller.control(random.uniform(-1, 1));
    controller.prepare(random.uniform(-1, 1));
  }
  return controller;
}

/// A report after `prepare` gives what a report before it gives: Gamma (u_reported - u_assumed).
template <class Observer>
void late_report(const typename Controller<Observer>::Config& config) {
  auto early = warm<Observer>(config);
  auto late = early;
  auto never = early;
  EXPECT_EQ(early.control(0.3), late.control(0.3));
  never.control(0.3);
  early.applied(-2.5);
  for (auto* controller : {&early, &late, &never}) controller->prepare(0.7);
  EXPECT_EQ(late.applied(-2.5), StepStatus::ok);
  const auto a = early.observer().estimate();
  const auto b = late.observer().estimate();
  const auto c = never.observer().estimate();
  bool differs = false;
  for (int i = 0; i < Observer::size; ++i) {
    EXPECT_NEAR(a(i), b(i), 1e-12 * (std::abs(a(i)) + std::abs(c(i)))) << i;
    differs = differs || std::abs(b(i) - c(i)) > 1e-6 * std::abs(c(i));
  }
  EXPECT_TRUE(differs);
  EXPECT_EQ(late.observer().applied_input(), -2.5);
  const double u = early.control(0.31);
  EXPECT_NEAR(late.control(0.31), u, 1e-11 * std::abs(u));
  EXPECT_GT(std::abs(never.control(0.31) - u), 1e-6 * std::abs(u));
  // A bad report is not taken.
  late.prepare(0.7);
  const auto before = late.observer().estimate();
  EXPECT_EQ(late.applied(hidden_nan<double>()), StepStatus::input_rejected);
  EXPECT_EQ(late.observer().estimate(), before);
}

TEST(PredictiveAdrc, a_late_report_corrects_the_prediction) {
  late_report<Linear>(typical());
  using Cascade = esokit::CascadeEso<2, 2>;
  Controller<Cascade>::Config config;
  config.observer = by_bandwidth<Cascade>(200);
  config.observer.bandwidth_factor = 2;
  config.controller_bandwidth = omega_c;
  late_report<Cascade>(config);
}

TEST(PredictiveAdrc, the_rate_limit_goes_on_from_what_was_commanded) {
  auto config = typical();
  config.limits.rate = 1 / period;
  for (const bool late : {false, true}) {
    auto controller = Controller<Linear>::make(config).value();
    controller.set_reference(1e6);
    EXPECT_EQ(controller.control(0), 1);
    if (late) controller.prepare(1e6);
    controller.applied(-5);
    if (!late) controller.prepare(1e6);
    EXPECT_EQ(controller.observer().applied_input(), -5);
    EXPECT_EQ(controller.output(), 1);
    EXPECT_EQ(controller.control(0), 2);
    // Downwards as well.
    controller.prepare(-1e6);
    EXPECT_EQ(controller.control(0), 1);
    // An operator's u is the last command.
    controller.prepare(1e6);
    EXPECT_EQ(controller.start(0, -3), StepStatus::ok);
    controller.set_reference(1e6);
    if (late) {
      EXPECT_EQ(controller.applied(-5), StepStatus::ok);
    }
    EXPECT_EQ(controller.control(0), late ? -4 : -2);
  }
}

TEST(PredictiveAdrc, the_reference_may_change_until_the_sample) {
  auto a = warm<Linear>(typical());
  auto b = a;
  a.control(0.1);
  b.control(0.1);
  a.prepare(5.0);
  b.prepare(-1.0);
  b.set_reference(5.0);
  EXPECT_EQ(a.control(0.2), b.control(0.2));
  // A bad one keeps the last u, whatever is measured.
  a.prepare(hidden_nan<double>());
  const double last = a.output();
  EXPECT_EQ(a.control(0.25), last);
  b.prepare(esokit::EigenMatrix<double, 2>(0.1, hidden_infinity<double>()));
  EXPECT_EQ(b.control(0.25), last);
  a.prepare(1.0);
  EXPECT_NE(a.control(0.25), last);

  using Nonlinear = esokit::AdjustableBandwidthEso<2>;
  Controller<Nonlinear>::Config config;
  config.observer = by_bandwidth<Nonlinear>();
  config.observer.bandwidth_ratio = 0.6;
  config.controller_bandwidth = omega_c;
  auto c = warm<Nonlinear>(config);
  c.prepare(hidden_nan<double>());
  const double held = c.output();
  EXPECT_EQ(c.control(0.25), held);
}

TEST(PredictiveAdrc, takes_a_list_of_the_reference_and_its_derivatives) {
  using Two = esokit::EigenMatrix<double, 2>;
  auto listed = warm<Linear>(typical());
  auto given = listed;
  const double r = 0.5, r1 = 20, r2 = 300;
  for (int k = 0; k < 3; ++k) {
    EXPECT_EQ(listed.update(0.1, {r, r1, r2}),
              given.update(0.1, esokit::EigenMatrix<double, 3>(r, r1, r2)));
    const double by_list = listed.control(0.2);
    EXPECT_EQ(by_list, given.control(0.2));
    EXPECT_NE(by_list, 0);
    listed.prepare({r, r1});
    given.prepare(Two(r, r1));
    EXPECT_EQ(listed.control(0.15), given.control(0.15));
    listed.set_reference({r1, r});
    given.set_reference(Two(r1, r));
    EXPECT_EQ(listed.control(0.15), given.control(0.15));
  }
}

TEST(PredictiveAdrc, start_hold_keeps_u_at_zero) {
  auto config = typical();
  config.start_hold = 0.0105;  // eleven samples
  auto controller = Controller<Linear>::make(config).value();
  controller.set_reference(1);
  for (int round = 0; round < 2; ++round) {
    for (int k = 0; k < 30; ++k) {
      const double u = controller.control(0.2);
      EXPECT_EQ(u == 0, k < 11) << k;
      controller.prepare(1);
    }
    EXPECT_NEAR(controller.observer().estimate()(0), 0.2, 1);
    controller.reset(0.2);
  }
}

TEST(PredictiveAdrc, takes_over_without_a_bump) {
  // A plant that stands needs no hold.
  auto config = typical();
  config.start_hold = 0.0105;
  auto controller = Controller<Linear>::make(config).value();
  EXPECT_EQ(controller.start(3.0, 1.7), StepStatus::ok);
  for (int k = 0; k < 20; ++k) {
    EXPECT_NEAR(controller.control(3.0), 1.7, 1e-9) << k;
    controller.prepare(3.0);
  }
  const auto before = controller.observer().estimate();
  EXPECT_EQ(controller.start(hidden_nan<double>(), 0), StepStatus::state_rejected);
  EXPECT_EQ(controller.observer().estimate(), before);
}

/// A long gap: u from predictions, and the restart that the observer makes after it.
TEST(PredictiveAdrc, rides_through_a_long_gap) {
  auto config = typical();
  config.observer.max_gap = 4;
  auto controller = warm<Linear>(config);
  Linear observer = controller.observer();
  const auto law = law_of<Linear>(controller);
  for (int k = 0; k < 8; ++k) {
    const double u = controller.control_without_measurement();
    EXPECT_NEAR(u, law.control(observer.estimate(), k == 0 ? u : 1.0),
                k == 0 ? 1e9 : 1e-9 * std::abs(u));
    observer.predict(u);
    controller.prepare(1.0);
  }
  EXPECT_EQ(observer.correct(0.4), StepStatus::restarted);
  EXPECT_NEAR(controller.control(0.4), law.control(observer.estimate(), 1.0), 1e-12);
  EXPECT_TRUE(has(controller.prepare(1.0), StepStatus::restarted));
}

/// `start` says what stands at the actuator: a report of the same changes nothing, and a change of
/// b0 is rebalanced with it.
TEST(PredictiveAdrc, start_tells_the_observer_its_input) {
  using Observer = esokit::LinearEso<1>;
  Controller<Observer>::Config config{
      .observer = {.observer_bandwidth = 20, .input_gain = 1, .sample_time = 0.01},
      .controller_bandwidth = 5};
  auto controller = Controller<Observer>::make(config).value();
  ASSERT_EQ(controller.start(1, 5), StepStatus::ok);
  ASSERT_EQ(controller.applied(5), StepStatus::ok);
  EXPECT_EQ(controller.observer().estimate(), Eigen::Vector2d(1, -5));
  config.observer.input_gain = 2;
  ASSERT_TRUE(controller.retune(config).has_value());
  EXPECT_NEAR(controller.control(1), 5, 1e-12);
}

TEST(PredictiveAdrc, retune_keeps_u) {
  auto controller = warm<Linear>(typical());
  controller.start(2.0, 1.5);
  for (int k = 0; k < 5; ++k) {
    controller.control(2.0);
    controller.prepare(2.0);
  }
  auto config = typical();
  config.observer.observer_bandwidth = 800;
  config.observer.input_gain = 300;
  config.controller_bandwidth = 50;
  ASSERT_TRUE(controller.retune(config).has_value());
  EXPECT_EQ(controller.gains(), Controller<Linear>::make(config)->gains());
  EXPECT_NEAR(controller.control(2.0), 1.5, 1e-9);
  controller.prepare(2.0);
  const double next = controller.blind_output();
  config.controller_bandwidth = -1;
  EXPECT_EQ(refusal(controller.retune(config)),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(controller.blind_output(), next);
}

TEST(PredictiveAdrc, refuses_bad_configs_by_name) {
  const auto refused = [](auto&& change) {
    auto config = typical();
    change(config);
    return refusal(Controller<Linear>::make(config));
  };
  using Config = Controller<Linear>::Config;
  EXPECT_EQ(refused([](Config& c) { c.observer.observer_bandwidth = 0; }),
            "observer_bandwidth: must be finite and positive");
  EXPECT_EQ(refused([](Config& c) { c.observer.input_gain = 0; }),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refused([](Config& c) { c.controller_bandwidth = hidden_nan<double>(); }),
            "controller_bandwidth: must be finite and positive");
  EXPECT_EQ(refused([](Config& c) {
              c.gains = {1.0, 2.0};
            }),
            "controller_bandwidth: must be left out if gains is given");
  EXPECT_EQ(refused([](Config& c) { c.limits = {.lower = 1, .upper = -1}; }),
            "limits.lower: must be below limits.upper");
  EXPECT_EQ(refused([](Config& c) { c.limits.rate = -1; }),
            "limits.rate: must be finite and positive");
  EXPECT_EQ(refused([](Config& c) { c.start_hold = -1; }),
            "start_hold: must be finite and not negative");
  EXPECT_EQ(refused([](Config& c) { c.start_hold = 1e9; }),
            "start_hold: must be 1e6 samples or less");
}

TEST(PredictiveAdrc, allocates_nothing) {
  auto controller = Controller<Linear>::make(typical()).value();
  auto filter =
      Controller<esokit::ExtendedStateFilter<2>>::make(
          {.observer = by_noise<esokit::ExtendedStateFilter<2>>(), .controller_bandwidth = omega_c})
          .value();
  long count = -1;
  double sink = 0;
  {
    const NoAllocation guard;
    for (int k = 0; k < 20; ++k) {
      sink += controller.control(0.1) + filter.control(0.1);
      controller.prepare(1.0);
      filter.prepare(esokit::EigenMatrix<double, 3>(1, 2, 3));
      controller.applied(0.3);
      sink += controller.control_without_measurement();
      controller.prepare(1.0);
      sink += controller.update(hidden_nan<double>(), 1.0);
      controller.reset(0.1);
    }
    count = guard.count();
  }
  EXPECT_EQ(count, 0);
  EXPECT_TRUE(std::isfinite(sink));
}

}  // namespace esokit_test::control_predictive_adrc_test
