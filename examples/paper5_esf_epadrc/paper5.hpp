/// @file
/// What the examples of this paper share: its name, plant, settings, and one run of each
/// controller.
///
/// S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen, "Improved Active Disturbance Rejection Control (ADRC)
/// with Extended State Filters", Energies 15 (2022) 5799, doi:10.3390/en15165799.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/runge_kutta.hpp>

#include "common/report.hpp"

namespace paper5 {

using esokit::EigenMatrix;
namespace sim = esokit::sim;

inline const std::string folder = "paper5_esf_epadrc";

inline esokit::examples::About about(std::string title, std::string description, int order,
                                     bool addition = false) {
  return {.paper_title = "Extended state filter, PADRC and EPADRC",
          .citation =
              "S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen, Improved Active Disturbance "
              "Rejection Control (ADRC) with Extended State Filters, Energies 15 (2022) "
              "5799",
          .link = "https://doi.org/10.3390/en15165799",
          .title = std::move(title),
          .description = std::move(description),
          .order = order,
          .addition = addition};
}

// ---- section 4 ----

inline constexpr double sample_time = 1e-3;            // tau, s
inline constexpr double input_gain = 230.0;            // b
inline constexpr double controller_bandwidth = 100.0;  // omega_c, rad/s: k1 = 1e4, k2 = 200
inline constexpr double observer_bandwidth = 800.0;    // omega_o of ADRC and PADRC, rad/s
inline constexpr double theta = 0.5;                   // inflation of the filter
inline constexpr double bound_factor = 2.0;            // c of (34)
inline constexpr double disturbance_change = 300.0;    // q2, per sample
inline constexpr std::array<double, 2> neglected = {1e-6, 1e-3};            // q1
inline constexpr std::array<double, 3> initial_covariance = {1, 1e4, 1e6};  // diag of P0

/// x1' = x2, x2' = f + 230 u with f = 20 x1 + 78 x2 + 10; a pole at +78.
struct Plant {
  static double total_disturbance(const EigenMatrix<double, 2>& x) {
    return 20.0 * x(0) + 78.0 * x(1) + 10.0;
  }
  static EigenMatrix<double, 2> derivative(const EigenMatrix<double, 2>& x, double u) {
    return {x(1), total_disturbance(x) + input_gain * u};
  }
  /// One sample under a held input.
  static EigenMatrix<double, 2> step(const EigenMatrix<double, 2>& x, double u,
                                     double time = sample_time) {
    const auto rate = [u](double, const EigenMatrix<double, 2>& state) -> EigenMatrix<double, 2> {
      return derivative(state, u);
    };
    constexpr int substeps = 4;
    return sim::integrate(rate, 0.0, x, time / substeps, substeps);
  }
};

enum class Reference { sine, step };

inline double reference_at(Reference reference, int k) {
  if (reference == Reference::step) return 20.0;
  return 4.0 * std::sin(2.0 * 3.14159265358979323846 * k * sample_time);
}

inline double duration_of(Reference reference) { return reference == Reference::sine ? 2.0 : 1.0; }

// ---- the controllers ----

enum class Kind { adrc, padrc, epadrc, printed };
inline constexpr std::array kinds = {Kind::adrc, Kind::padrc, Kind::epadrc};
inline std::string name_of(Kind kind) {
  switch (kind) {
    case Kind::adrc:
      return "ADRC";
    case Kind::padrc:
      return "PADRC";
    case Kind::epadrc:
      return "EPADRC";
    case Kind::printed:
      break;
  }
  return "EPADRC as printed";
}

using Linear = esokit::LinearEso<2>;
using Filter = esokit::ExtendedStateFilter<2>;

inline Linear::Config linear_config(double bandwidth = observer_bandwidth) {
  return {.observer_bandwidth = bandwidth, .input_gain = input_gain, .sample_time = sample_time};
}

/// @param deviation of the noise, for which the filter is made
inline Filter::Config filter_config(double deviation, double change = disturbance_change) {
  Filter::Config config{.input_gain = input_gain,
                        .sample_time = sample_time,
                        .measurement_variance = std::max(deviation * deviation, 1e-10),
                        .disturbance_bounds = {neglected[0], neglected[1], change},
                        .bound_factor = bound_factor,
                        .inflation = theta};
  for (int i = 0; i < 3; ++i) {
    config.initial_covariance(i, i) = initial_covariance[static_cast<std::size_t>(i)];
  }
  return config;
}

inline esokit::AdrcLaw<2> law() {
  return esokit::AdrcLaw<2>::make(
             {.controller_bandwidth = controller_bandwidth, .input_gain = input_gain})
      .value();
}

/// Every controller here: the first reference at its making, then one `step` a sample.
/// `estimate` is what the u of the last step was computed from.

/// ADRC in predictor form: the estimate of sample k is made of the measurements before it.
class PlainAdrc {
 public:
  explicit PlainAdrc(double first_reference) : reference_(first_reference) {}

  double step(double y, double next_reference) {
    estimate_ = observer_.estimate();
    const double u = law_.control(estimate_, reference_);
    observer_.correct(y);
    observer_.predict(u);
    reference_ = next_reference;
    return u;
  }
  const EigenMatrix<double, 3>& estimate() const { return estimate_; }

 private:
  Linear observer_ = Linear::make(linear_config()).value();
  esokit::AdrcLaw<2> law_ = law();
  EigenMatrix<double, 3> estimate_ = EigenMatrix<double, 3>::Zero();
  double reference_;
};

/// PADRC and EPADRC: the two-phase controller.
template <class Observer>
class Predictive {
 public:
  Predictive(const typename Observer::Config& config, double first_reference)
      : controller_(esokit::PredictiveAdrc<Observer>::make(
                        {.observer = config, .controller_bandwidth = controller_bandwidth})
                        .value()) {
    controller_.set_reference(first_reference);
  }

  double step(double y, double next_reference) {
    const double u = controller_.control(y);
    Observer observer = controller_.observer();
    observer.correct(y);
    estimate_ = observer.estimate();
    covariance_known_ = observer;
    controller_.prepare(next_reference);
    return u;
  }
  const EigenMatrix<double, 3>& estimate() const { return estimate_; }
  /// The observer after the correction of the last step.
  const Observer& observer() const { return covariance_known_; }

 private:
  esokit::PredictiveAdrc<Observer> controller_;
  Observer covariance_known_ = controller_.observer();
  EigenMatrix<double, 3> estimate_ = EigenMatrix<double, 3>::Zero();
};

/// EPADRC as the paper prints it in (37)-(39), (52), (53): the predictor gain -K = A P C' / s
/// stands where the gain L = P C' / s of the current form belongs. WRONG, and here only to show
/// what it does: the estimate leads by one sample. (s itself, printed with a transpose in place of
/// the inverse, is the corrected one here; with the printed one nothing can be computed.)
class PrintedEpadrc {
 public:
  PrintedEpadrc(const Filter::Config& config, double first_reference)
      : reference_(first_reference),
        r_(config.measurement_variance),
        p_(config.initial_covariance) {
    using Chain = esokit::IntegratorChain<2>;
    a_ = Chain::transition_matrix(sample_time);
    b_ = Chain::sampled_input_matrix(sample_time, input_gain);
    q_.setZero();
    for (int i = 0; i < 3; ++i) {
      const double bound = config.disturbance_bounds[static_cast<std::size_t>(i)];
      q_(i, i) = config.bound_factor * bound * bound;
    }
  }

  double step(double y, double next_reference) {
    const EigenMatrix<double, 3> k = -(a_ * p_.col(0)) / (p_(0, 0) + r_ / (1.0 + theta));
    estimate_ = predicted_ - k * (y - predicted_(0));  // the slip: A L in place of L
    const double u = law_.control(estimate_, reference_);
    predicted_ = a_ * estimate_ + b_ * u;
    EigenMatrix<double, 3, 3> closed = a_;
    closed.col(0) += k;
    p_ = ((1.0 + theta) * closed * p_ * closed.transpose() + k * r_ * k.transpose() +
          (1.0 + theta) / theta * q_)
             .eval();
    reference_ = next_reference;
    return u;
  }
  const EigenMatrix<double, 3>& estimate() const { return estimate_; }

 private:
  esokit::AdrcLaw<2> law_ = law();
  double reference_;
  double r_;
  EigenMatrix<double, 3, 3> a_, q_, p_;
  EigenMatrix<double, 3> b_;
  EigenMatrix<double, 3> predicted_ = EigenMatrix<double, 3>::Zero();
  EigenMatrix<double, 3> estimate_ = EigenMatrix<double, 3>::Zero();
};

// ---- a run ----

/// RMS of r - y, its IAE, int u^2 dt (all rectangles of a sample, as u is held), and the RMS of the
/// estimation errors without the first 0.25 s.
struct Metrics {
  double error = 0.0, absolute = 0.0, control = 0.0, e1 = 0.0, e2 = 0.0, e3 = 0.0;
};
struct MetricName {
  const char* name;
  double Metrics::*number;
};
inline constexpr std::array<MetricName, 6> metric_names = {{{"RMS r − y", &Metrics::error},
                                                            {"IAE", &Metrics::absolute},
                                                            {"int u^2 dt", &Metrics::control},
                                                            {"RMS e1", &Metrics::e1},
                                                            {"RMS e2", &Metrics::e2},
                                                            {"RMS e3", &Metrics::e3}}};

/// The signals of the figures.
struct Series {
  std::vector<double> t, reference, output, error, control, e1, e2, e3, disturbance, estimate;
};

template <class Controller>
Metrics run(Controller controller, Reference reference, double deviation, std::uint64_t seed,
            Series* series = nullptr) {
  auto noise =
      sim::WhiteNoise<>::make({.standard_deviation = deviation, .seed = 1000 + seed}).value();
  const int samples = static_cast<int>(std::lround(duration_of(reference) / sample_time));
  constexpr int settled = 250;
  EigenMatrix<double, 2> x = EigenMatrix<double, 2>::Zero();
  Metrics sum;
  for (int k = 0; k < samples; ++k) {
    const double r = reference_at(reference, k);
    const double u = controller.step(x(0) + noise.next(), reference_at(reference, k + 1));
    const EigenMatrix<double, 3> truth(x(0), x(1), Plant::total_disturbance(x));
    const EigenMatrix<double, 3> e = truth - controller.estimate();
    sum.error += (r - x(0)) * (r - x(0));
    sum.absolute += std::abs(r - x(0)) * sample_time;
    sum.control += u * u * sample_time;
    if (k >= settled) {
      sum.e1 += e(0) * e(0);
      sum.e2 += e(1) * e(1);
      sum.e3 += e(2) * e(2);
    }
    if (series != nullptr) {
      series->t.push_back(k * sample_time);
      series->reference.push_back(r);
      series->output.push_back(x(0));
      series->error.push_back(r - x(0));
      series->control.push_back(u);
      series->e1.push_back(e(0));
      series->e2.push_back(e(1));
      series->e3.push_back(e(2));
      series->disturbance.push_back(truth(2));
      series->estimate.push_back(controller.estimate()(2));
    }
    x = Plant::step(x, u);
    if (!(std::abs(x(0)) < 1e6)) break;  // diverged
  }
  sum.error = std::sqrt(sum.error / samples);
  for (double* e : {&sum.e1, &sum.e2, &sum.e3}) *e = std::sqrt(*e / (samples - settled));
  return sum;
}

inline Metrics run(Kind kind, Reference reference, double deviation, std::uint64_t seed,
                   Series* series = nullptr) {
  const double first = reference_at(reference, 0);
  switch (kind) {
    case Kind::adrc:
      return run(PlainAdrc(first), reference, deviation, seed, series);
    case Kind::padrc:
      return run(Predictive<Linear>(linear_config(), first), reference, deviation, seed, series);
    case Kind::epadrc:
      return run(Predictive<Filter>(filter_config(deviation), first), reference, deviation, seed,
                 series);
    case Kind::printed:
      break;
  }
  return run(PrintedEpadrc(filter_config(deviation), first), reference, deviation, seed, series);
}

}  // namespace paper5
