/// @file
/// What the examples of this paper share: its name, parameter sets, and the loop of section 6.
///
/// A. T. Azar, F. A. Abdul-Majeed, H. S. Majdi, I. A. Hameed, N. A. Kamal, A. J. M. Jawad, A. H.
/// Abbas, W. R. Abdul-Adheem, I. K. Ibraheem. "Parameterization of a Novel Nonlinear Estimator for
/// Uncertain SISO Systems with Noise Scenario", Mathematics 10 (2022) 2261,
/// doi:10.3390/math10132261.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <esokit/sim/trapezoid.hpp>

#include "common/report.hpp"
#include "sign_differentiator.hpp"

namespace paper4 {

using esokit::EigenMatrix;
using esokit::PowerSumGain;
namespace sim = esokit::sim;

inline const std::string folder = "paper4_nhoeso";

inline esokit::examples::About about(std::string title, std::string description, int order) {
  return {.paper_title = "Nonlinear higher-order extended state observer",
          .citation =
              "A. T. Azar, F. A. Abdul-Majeed, H. S. Majdi, I. A. Hameed, N. A. Kamal, A. J. "
              "M. Jawad, A. H. Abbas, W. R. Abdul-Adheem, I. K. Ibraheem, Parameterization "
              "of a Novel Nonlinear Estimator for Uncertain SISO Systems with Noise "
              "Scenario, Mathematics 10 (2022) 2261",
          .link = "https://doi.org/10.3390/math10132261",
          .title = std::move(title),
          .description = std::move(description),
          .order = order};
}

/// Table 2: g, and the choice (29) for noise, g_new. g(e) = e k(|e|).
inline constexpr PowerSumGain<double> table2_g{
    .gain_alpha = 0.617, .alpha = 0.233, .gain_beta = 0.143, .beta = 0.334};
inline constexpr PowerSumGain<double> table2_g_new{
    .gain_alpha = 0.05, .alpha = 0.8, .gain_beta = 0.05, .beta = 2.0};

inline double g(const PowerSumGain<double>& shape, double e) {
  return e == 0.0 ? 0.0 : shape(std::abs(e)) * e;
}

// ---- section 6: the paper prints the noise alone; the rest is fitted to Table 3

inline constexpr double duration = 10.0;        // s
inline constexpr double hold = 0.01;            // s, of a noise value
inline constexpr double noise_variance = 1e-4;  // of y
inline constexpr double fitted_step = 0.002;    // s, of integration
inline constexpr double acceleration = 35.93;   // R of the tracking differentiator
inline constexpr double control_limit = 20.77;  // of |u|
inline const esokit::NonlinearFeedback<2>::Config fitted_law{
    .exponents = {0.1953, 0.0300}, .linear_widths = {0.00099, 0.0978}, .input_gain = 1.0};

/// x1' = x2,  x2' = 0.2 x1 + 0.1 sin x2 + w + (1 + 0.1 sin t) u,  w = e^-t cos t.
struct UncertainPlant {
  static double total_disturbance(double t, const EigenMatrix<double, 2>& x, double u) {
    return 0.2 * x(0) + 0.1 * std::sin(x(1)) + std::exp(-t) * std::cos(t) + 0.1 * std::sin(t) * u;
  }
  static EigenMatrix<double, 2> derivative(double t, const EigenMatrix<double, 2>& x, double u) {
    return {x(1), total_disturbance(t, x, u) + u};
  }
};

/// r = cos(0.5 t).
inline double reference(double t) { return std::cos(0.5 * t); }

/// (r1, r2) at the steps: the sign form of the tracking differentiator, integrated at 1 ms or less.
inline std::vector<EigenMatrix<double, 2>> tracked_reference(double step) {
  const SignDifferentiator td{acceleration};
  const auto rate = [&](double t, const EigenMatrix<double, 2>& r) -> EigenMatrix<double, 2> {
    return td.rate(r, reference(t));
  };
  const auto fine = static_cast<int>(std::ceil(step / 1e-3 - 1e-9));
  const auto steps = static_cast<int>(std::lround(duration / step));
  std::vector<EigenMatrix<double, 2>> samples{EigenMatrix<double, 2>::Zero()};
  for (int k = 0; k < steps; ++k) {
    samples.push_back(sim::integrate(rate, k * step, samples.back(), step / fine, fine));
  }
  return samples;
}

/// Table 3, and the amplitude of the estimation error in the second half of the run.
struct Criteria {
  double itae = 0.0;       ///< int t |r - x1| dt
  double isu = 0.0;        ///< int u^2 dt
  double amplitude = 0.0;  ///< largest |x1 - z1|
};

struct Series {
  std::vector<double> t, r, x, u, disturbance, estimate, error;
};

/// One run, plant and observer as one ODE; (r1, r2) are held over a step, u follows the estimate.
/// @param r tracked_reference(step)
template <class Observer>
Criteria run(const Observer& observer, double variance, std::uint64_t seed,
             const std::vector<EigenMatrix<double, 2>>& r, double step, Series* series = nullptr) {
  using State = typename Observer::State;
  constexpr int n = Observer::states;
  const auto law = esokit::NonlinearFeedback<2>::make(fitted_law).value();
  auto noise =
      sim::WhiteNoise<>::make({.standard_deviation = std::sqrt(variance), .seed = seed}).value();
  const auto steps_per_hold = static_cast<std::size_t>(std::lround(hold / step));
  EigenMatrix<double, 2 + n> s = EigenMatrix<double, 2 + n>::Zero();
  sim::Trapezoid<> itae;
  sim::Trapezoid<> isu;
  Criteria result;
  double v = 0.0;
  for (std::size_t k = 0; k < r.size(); ++k) {
    const double t = static_cast<double>(k) * step;
    if (k % steps_per_hold == 0) v = noise.next();
    const auto control = [&](const State& z) {
      return std::clamp(law.control(Observer::estimate(z), r[k]), -control_limit, control_limit);
    };
    const EigenMatrix<double, 2> x = s.template head<2>();
    const State z = s.template tail<n>();
    const double u = control(z);
    const double error = reference(t) - x(0);
    itae.add(t, t * std::abs(error));
    isu.add(t, u * u);
    if (t >= duration / 2) result.amplitude = std::max(result.amplitude, std::abs(x(0) - z(0)));
    if (series != nullptr) {
      series->t.push_back(t);
      series->r.push_back(reference(t));
      series->x.push_back(x(0));
      series->u.push_back(u);
      series->disturbance.push_back(UncertainPlant::total_disturbance(t, x, u));
      series->estimate.push_back(Observer::estimate(z)(2));
      series->error.push_back(error);
    }
    const auto rate = [&](double time, const EigenMatrix<double, 2 + n>& state) {
      const EigenMatrix<double, 2> plant = state.template head<2>();
      const State estimate = state.template tail<n>();
      const double input = control(estimate);
      EigenMatrix<double, 2 + n> d;
      d << UncertainPlant::derivative(time, plant, input),
          eigen(observer.derivative(time, estimate, plant(0) + v, input));
      return d;
    };
    s = sim::step(rate, t, s, step);
  }
  result.itae = itae.value();
  result.isu = isu.value();
  return result;
}

}  // namespace paper4
