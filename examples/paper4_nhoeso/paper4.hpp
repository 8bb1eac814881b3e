/// @file
/// What the examples of this paper share: its name, parameter sets, and the loop of section 6.
///
/// A. T. Azar, F. A. Abdul-Majeed, H. S. Majdi, I. A. Hameed, N. A. Kamal, A. J. M. Jawad, A. H.
/// Abbas, W. R. Abdul-Adheem, I. K. Ibraheem, "Parameterization of a Novel Nonlinear Estimator for
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
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <esokit/sim/trapezoid.hpp>

#include "common/report.hpp"

namespace paper4 {

using esokit::PowerSumGain;
using esokit::Vector;
namespace sim = esokit::sim;

inline const std::string folder = "paper4_nhoeso";

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "Nonlinear higher-order extended state observer",
          .citation =
              "A. T. Azar, F. A. Abdul-Majeed, H. S. Majdi, I. A. Hameed, N. A. Kamal, A. J. "
              "M. Jawad, A. H. Abbas, W. R. Abdul-Adheem, I. K. Ibraheem, Parameterization "
              "of a Novel Nonlinear Estimator for Uncertain SISO Systems with Noise "
              "Scenario, Mathematics 10 (2022) 2261",
          .link = "https://doi.org/10.3390/math10132261",
          .title = std::move(title),
          .description = std::move(description)};
}

/// Table 2: g, and the choice (29) for noise, g_new. g(e) = e k(|e|).
inline constexpr PowerSumGain<double> table2_g{
    .gain_alpha = 0.617, .alpha = 0.233, .gain_beta = 0.143, .beta = 0.334};
inline constexpr PowerSumGain<double> table2_g_new{
    .gain_alpha = 0.05, .alpha = 0.8, .gain_beta = 0.05, .beta = 2.0};

inline double g(const PowerSumGain<double>& shape, double e) {
  return e == 0.0 ? 0.0 : shape(std::abs(e)) * e;
}

// ---- section 6

inline constexpr double duration = 10.0;        // s
inline constexpr double step = 0.01;            // s, of integration, noise and control
inline constexpr double noise_variance = 1e-4;  // of y
inline constexpr double acceleration = 12.4;    // R of the tracking differentiator

/// x1' = x2,  x2' = 0.2 x1 + 0.1 sin x2 + w + (1 + 0.1 sin t) u,  w = e^-t cos t.
struct UncertainPlant {
  static double total_disturbance(double t, const Vector<double, 2>& x, double u) {
    return 0.2 * x(0) + 0.1 * std::sin(x(1)) + std::exp(-t) * std::cos(t) + 0.1 * std::sin(t) * u;
  }
  static Vector<double, 2> derivative(double t, const Vector<double, 2>& x, double u) {
    return {x(1), total_disturbance(t, x, u) + u};
  }
};

/// (r1, r2) at the steps: the sign form of the tracking differentiator on cos(0.5 t), integrated a
/// hundred times finer than the loop, so that its chatter does not show.
inline const std::vector<Vector<double, 2>>& reference() {
  static const std::vector<Vector<double, 2>> samples = [] {
    constexpr int fine = 100;
    const auto td =
        esokit::SignTrackingDifferentiator<>::make({.acceleration = acceleration}).value();
    const auto rate = [&](double t, const Vector<double, 2>& r) -> Vector<double, 2> {
      return td.rate(r, std::cos(0.5 * t));
    };
    std::vector<Vector<double, 2>> result;
    Vector<double, 2> r = Vector<double, 2>::Zero();
    const auto steps = static_cast<int>(std::llround(duration / step));
    for (int k = 0; k <= steps; ++k) {
      result.push_back(r);
      for (int i = 0; i < fine; ++i) {
        r = sim::step(rate, k * step + i * step / fine, r, step / fine);
      }
    }
    return result;
  }();
  return samples;
}

/// Table 3, and the amplitude of the estimation error in the second half of the run.
struct Criteria {
  double itae = 0.0;       ///< int t |r1 - x1| dt
  double isu = 0.0;        ///< int u^2 dt
  double amplitude = 0.0;  ///< largest |x1 - z1|
};

struct Series {
  std::vector<double> t, r, x, u, disturbance, estimate, error;
};

/// One run with a continuous observer; u is held over a step.
template <class Observer>
Criteria run(const Observer& observer, double variance, std::uint64_t seed,
             Series* series = nullptr) {
  using State = typename Observer::State;
  constexpr int n = Observer::states;
  const auto law =
      esokit::NonlinearFeedback<2>::make(
          {.exponents = {1.0, 0.1}, .linear_widths = {0.021, 0.001}, .input_gain = 1.0})
          .value();
  auto noise =
      sim::WhiteNoise<>::make({.standard_deviation = std::sqrt(variance), .seed = seed}).value();
  const auto& r = reference();
  Vector<double, 2 + n> s = Vector<double, 2 + n>::Zero();
  sim::Trapezoid<> itae;
  sim::Trapezoid<> isu;
  Criteria result;
  for (std::size_t k = 0; k < r.size(); ++k) {
    const double t = static_cast<double>(k) * step;
    const double v = noise.next();
    const Vector<double, 2> x = s.template head<2>();
    const auto z = Observer::estimate(s.template tail<n>());
    const double u = law.control(z, r[k]);
    itae.add(t, t * std::abs(r[k](0) - x(0)));
    isu.add(t, u * u);
    if (t >= duration / 2) result.amplitude = std::max(result.amplitude, std::abs(x(0) - z(0)));
    if (series != nullptr) {
      series->t.push_back(t);
      series->r.push_back(r[k](0));
      series->x.push_back(x(0));
      series->u.push_back(u);
      series->disturbance.push_back(UncertainPlant::total_disturbance(t, x, u));
      series->estimate.push_back(z(2));
      series->error.push_back(r[k](0) - x(0));
    }
    const auto rate = [&](double time, const Vector<double, 2 + n>& state) {
      const Vector<double, 2> plant = state.template head<2>();
      const State estimate = state.template tail<n>();
      Vector<double, 2 + n> d;
      d << UncertainPlant::derivative(time, plant, u),
          observer.derivative(time, estimate, plant(0) + v, u);
      return d;
    };
    s = sim::step(rate, t, s, step);
  }
  result.itae = itae.value();
  result.isu = isu.value();
  return result;
}

}  // namespace paper4
