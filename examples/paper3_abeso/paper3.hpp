/// @file
/// What the examples of this paper share: its name, the loop of section 4, and the criteria of its
/// tables.
///
/// S. Zhang, X. Qi, S. Yang, "An extended state observer with adjustable bandwidth for measurement
/// noise", Journal of Systems Engineering and Electronics (2023), doi:10.23919/JSEE.2023.000166.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <esokit/sim/continuous_observer.hpp>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/sim/dormand_prince.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/trapezoid.hpp>
#include <esokit/sim/window.hpp>

#include "common/report.hpp"

namespace paper3 {

using esokit::EigenMatrix;
namespace sim = esokit::sim;

inline const std::string folder = "paper3_abeso";

inline esokit::examples::About about(std::string title, std::string description, int order) {
  return {.paper_title = "Adjustable-bandwidth extended state observer",
          .citation =
              "S. Zhang, X. Qi, S. Yang, An extended state observer with adjustable "
              "bandwidth for measurement noise, Journal of Systems Engineering and "
              "Electronics (2023)",
          .link = "https://doi.org/10.23919/JSEE.2023.000166",
          .title = std::move(title),
          .description = std::move(description),
          .order = order};
}

inline constexpr double duration = 20.0;         // s
inline constexpr double hold = 0.01;             // s, of one noise value
inline constexpr double noise_variance = 0.001;  // of y
inline constexpr double ratio = 0.7;             // rho
inline constexpr double band = 0.01;             // of t_r
inline constexpr double settled = 5.0;           // s, where the transient ends
inline constexpr double filter_time = 0.02;      // s, of the derivative filter; fitted, not printed

/// x'' = (sin x + sin x') / (4 pi) + d* + u,  d* = t / (4 pi) + sin(0.4 t + 1).
struct ShakenPlant {
  using State = EigenMatrix<double, 2>;

  static double total_disturbance(double t, const State& x) {
    constexpr double four_pi = 4.0 * std::numbers::pi;
    return (std::sin(x(0)) + std::sin(x(1))) / four_pi + t / four_pi + std::sin(0.4 * t + 1.0);
  }
  static State derivative(double t, const State& x, double u) {
    return {x(1), total_disturbance(t, x) + u};
  }
};

/// Fig. 1 of the paper draws a curve, there is no formula; 1 + sin t is a guess. The tables come
/// out with the constant.
enum class Reference { constant, sine };

inline double reference_value(Reference kind, double t) {
  return kind == Reference::constant ? 1.0 : 1.0 + std::sin(t);
}

/// What an observer takes for its error shrinking, with en = z_1 - y.
enum class Watch {
  nothing,            ///< it does not switch
  magnitude,          ///< |en| is smaller than at the noise value before
  innovation,         ///< en is
  filtered,           ///< p / (tau p + 1) en is negative: asked in every stage of the solver
  filtered_at_steps,  ///< the same, asked at the start of each step
};

/// An observer of the comparison: gains (3 W, 3 W^2, W^3), W = ratio w while the error shrinks,
/// `otherwise` w if not.
struct Kind {
  const char* name;
  Watch watch = Watch::nothing;
  double otherwise = 1.0;
  bool first_gain_switches = true;  ///< false: 3 w in both modes
};

inline constexpr Kind leso{.name = "LESO"};
inline constexpr Kind beso{.name = "BESO", .watch = Watch::filtered, .otherwise = 1.0 / ratio};
inline constexpr Kind abeso{.name = "ABESO", .watch = Watch::magnitude};

/// z' of an observer whose gain is what it is.
struct FixedGain {
  EigenMatrix<double, 3> l;
  const EigenMatrix<double, 3>& gain(double /*t*/, double /*e*/) const { return l; }
};
using Observer = esokit::ContinuousObserver<2, double, 1, FixedGain>;

/// The first entry of the band of 0.01 after the first overshoot, or an excursion later.
class RiseTime {
 public:
  explicit RiseTime(int excursions) : left_(excursions) {}

  void add(double t, double e) {
    if (time_) return;
    if (side_ == 0) side_ = e > 0.0 ? 1 : -1;
    // Out of the band on the other side, then back into it.
    if (!outside_ && e * side_ < -band) outside_ = true;
    // It may cross the band within a step.
    if (outside_ && e * side_ >= -band) {
      outside_ = false;
      side_ = -side_;
      if (--left_ == 0) time_ = t;
    }
  }
  bool done() const { return time_.has_value(); }
  double value() const { return time_.value_or(std::nan("")); }

 private:
  int left_;
  int side_ = 0;
  bool outside_ = false;
  std::optional<double> time_;
};

using Three = std::array<double, 3>;  // for the errors of x, x' and d

/// What the tables hold.
struct Criteria {
  Three index{};                ///< 100 mean(|e|) over the steps of the solver: the paper's
  Three integral{};             ///< 100 (1/20) int |e| dt
  Three steady{};               ///< the part of it from t > 5 s
  Three rise{};                 ///< t_r, s
  Three peak{};                 ///< largest |e| after t_r (x, x'), after 5 s (d)
  double mean_bandwidth = 0.0;  ///< over the steps, rad/s
  double steps = 0.0;           ///< accepted
};

/// What the figures draw.
struct Series {
  std::vector<double> t, reference, disturbance, estimate;
  std::array<std::vector<double>, 3> error;
};

/// One run: plant, observer and derivative filter as one ODE, Dormand-Prince 4(5) with a relative
/// tolerance of 1e-3, cut at the noise hits.
inline Criteria run(const Kind& kind, double bandwidth, std::uint64_t seed,
                    Series* series = nullptr, Reference reference = Reference::constant) {
  const auto observer_at = [&](double factor) {
    EigenMatrix<double, 3> l = esokit::continuous_gain<3, double>(factor * bandwidth);
    if (!kind.first_gain_switches) l(0) = 3.0 * bandwidth;
    return Observer::make(1.0, {FixedGain{l}}).value();
  };
  const Observer slow = observer_at(kind.watch == Watch::nothing ? 1.0 : ratio);
  const Observer fast = observer_at(kind.otherwise);
  // u = 25 (r - x1hat) - 10 x2hat - x3hat
  const auto law = esokit::AdrcLaw<2>::make({.gains = {{25.0, 10.0}}, .input_gain = 1.0}).value();
  auto noise =
      sim::WhiteNoise<>::make({.standard_deviation = std::sqrt(noise_variance), .seed = seed})
          .value();

  using State = EigenMatrix<double, 6>;  // x, z, filter
  const bool filters = kind.watch == Watch::filtered || kind.watch == Watch::filtered_at_steps;
  double v = 0.0;
  bool shrinking = false;
  const auto innovation = [&](const State& s) { return s(2) - (s(0) + v); };
  const auto derivative_falls = [&](const State& s) { return innovation(s) < s(5); };
  const auto rate = [&](double t, const State& s) -> State {
    const EigenMatrix<double, 2> x = s.head<2>();
    const EigenMatrix<double, 3> z = s.segment<3>(2);
    const double u = law.control(z, reference_value(reference, t));
    const bool is_slow = kind.watch == Watch::filtered ? derivative_falls(s) : shrinking;
    State rates;
    rates << ShakenPlant::derivative(t, x, u),
        eigen((is_slow ? slow : fast).derivative(t, z, x(0) + v, u)),
        filters ? (innovation(s) - s(5)) / filter_time : 0.0;
    return rates;
  };

  const auto late = sim::Window<>::make({.start = settled, .end = duration}).value();
  std::array<sim::Trapezoid<>, 3> whole;
  std::array<sim::Trapezoid<>, 3> rest{sim::Trapezoid<>(late), sim::Trapezoid<>(late),
                                       sim::Trapezoid<>(late)};
  std::array<RiseTime, 3> rise{RiseTime(1), RiseTime(1), RiseTime(2)};
  Criteria result;
  State s = State::Zero();
  s.head<2>().setOnes();
  double t = 0.0;
  const auto record = [&] {
    const double d = ShakenPlant::total_disturbance(t, s.head<2>());
    const Three error = {s(0) - s(2), s(1) - s(3), d - s(4)};
    for (std::size_t i = 0; i < 3; ++i) {
      result.index[i] += std::abs(error[i]);
      whole[i].add(t, std::abs(error[i]));
      rest[i].add(t, std::abs(error[i]));
      rise[i].add(t, error[i]);
      const bool counts = i < 2 ? rise[i].done() : t > settled;
      if (counts) result.peak[i] = std::max(result.peak[i], std::abs(error[i]));
      if (series != nullptr) series->error[i].push_back(error[i]);
    }
    const bool is_slow = kind.watch == Watch::filtered ? derivative_falls(s) : shrinking;
    result.mean_bandwidth += bandwidth * (is_slow ? ratio : kind.otherwise);
    result.steps += 1.0;
    if (series == nullptr) return;
    series->t.push_back(t);
    series->reference.push_back(reference_value(reference, t));
    series->disturbance.push_back(d);
    series->estimate.push_back(s(4));
  };

  auto stepper = sim::VariableStep<State>::make({.relative_tolerance = 1e-3}).value();
  const auto hits = static_cast<int>(std::lround(duration / hold));
  std::optional<double> watched;
  v = noise.next();
  const auto hit = [&] {
    if (kind.watch == Watch::magnitude || kind.watch == Watch::innovation) {
      const double now = kind.watch == Watch::magnitude ? std::abs(innovation(s)) : innovation(s);
      shrinking = watched && now < *watched;
      watched = now;
    }
  };
  hit();
  for (int k = 0; k < hits; ++k) {
    while (t < (k + 1) * hold) {
      if (kind.watch == Watch::filtered_at_steps) shrinking = derivative_falls(s);
      record();
      t = stepper.advance(rate, t, s, (k + 1) * hold).value();
    }
    v = noise.next();
    hit();
  }
  record();
  for (std::size_t i = 0; i < 3; ++i) {
    result.index[i] *= 100.0 / result.steps;
    result.integral[i] = 100.0 * whole[i].value() / duration;
    result.steady[i] = 100.0 * rest[i].value() / duration;
    result.rise[i] = rise[i].value();
  }
  result.mean_bandwidth /= result.steps;
  return result;
}

}  // namespace paper3
