#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <utility>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION ActuatorCurve<> SeenCurve::curve() const {
  switch (kind) {
    case CurveKind::dead_zone:
      return ActuatorCurve<>::dead_zone(size.value);
    case CurveKind::square:
      return ActuatorCurve<>::square(size.value);
    default:
      return {};
  }
}

ESOKIT_FUNCTION double SeenCurve::effect(double u) const {
  const double to = size.value, sign = std::copysign(1.0, u);
  switch (kind) {
    case CurveKind::dead_zone:
      return sign * (std::max)((std::abs)(u)-to, 0.0);
    case CurveKind::saturation:
      return std::clamp(u, -to, to);
    case CurveKind::square:
      return u * (std::abs)(u) / to;
    default:
      return u;
  }
}

ESOKIT_FUNCTION Log SeenCurve::acted(Log log) const {
  for (double& u : log.u) u = effect(u);
  return log;
}

namespace detail {

/// The log with the effect of a curve in place of u.
inline FitData acted_data(FitData data, const SeenCurve& curve) {
  for (double& u : data.u) u = curve.effect(u);
  return data;
}

/// A curve, and the fit with it.
struct CurveFit {
  SeenCurve curve{};
  Fit fit{};
};

inline CurveFit curve_fit(const FitData& data, const FitModel& model, const FitBounds& bounds,
                          const Fit& from, const SeenCurve& curve) {
  const FitData acted = acted_data(data, curve);
  return {curve, InnovationsFit(acted, model, bounds).minimise(from.at, false, 8)};
}

/// The interval of a size: what one more of it would change is a further input, whose number is b0
/// times what the size lacks. And one percent, as no model is exact.
inline double size_error(const FitData& data, const FitModel& model, const FitBounds& bounds,
                         const CurveFit& found) {
  FitData acted = acted_data(data, found.curve);
  const double sign = found.curve.kind == CurveKind::dead_zone ? -1.0 : 1.0;
  std::vector<double> more(acted.u.size());
  for (std::size_t k = 0; k < more.size(); ++k)
    more[k] = (std::abs)(data.u[k]) > found.curve.size.value ? std::copysign(sign, data.u[k]) : 0.0;
  acted.inputs.push_back(std::move(more));
  const auto [gain, lacks] = two_gains(acted, model, bounds, found.fit.at);
  return ((std::abs)(lacks.value) + lacks.half_width) / (std::abs)(gain.value) +
         0.01 * found.curve.size.value;
}

/// The size that leaves least: the best of a grid, then by thirds of what is beside it.
inline CurveFit fitted_size(const FitData& data, const FitModel& model, const FitBounds& bounds,
                            const Fit& here, CurveKind kind, double largest) {
  const auto with = [&](double size) {
    return curve_fit(data, model, bounds, here, {kind, {size, 0.0}});
  };
  const auto better = [](const CurveFit& a, const CurveFit& b) {
    return a.fit.mean_square < b.fit.mean_square;
  };
  constexpr int parts = 12;
  double step = largest / parts;
  CurveFit best = with(step);
  for (int i = 2; i < parts; ++i) best = (std::min)(best, with(i * step), better);
  for (; step > 0.002 * largest; step *= 0.6) {
    const double at = best.curve.size.value;
    for (const double size : {at - 0.6 * step, at + 0.6 * step}) {
      if (0.0 < size && size < largest) best = (std::min)(best, with(size), better);
    }
  }
  best.curve.size.half_width = size_error(data, model, bounds, best);
  return best;
}

ESOKIT_FUNCTION SeenCurve seen_curve(const FitData& data, const FitModel& model,
                                     const FitBounds& bounds, const Fit& here,
                                     const GainBySize& sizes) {
  if (!sizes.differ()) return {};
  double largest = 0.0;
  for (const double u : data.u) largest = (std::max)(largest, (std::abs)(u));
  // Small u do less: a dead zone or a square. Large ones: a saturation.
  CurveFit best, other;
  other.fit = here;
  if ((std::abs)(sizes.below.value) < (std::abs)(sizes.above.value)) {
    best = fitted_size(data, model, bounds, here, CurveKind::dead_zone, largest);
    other = curve_fit(data, model, bounds, here, {CurveKind::square, {largest, 0.0}});
    if (other.fit.mean_square < best.fit.mean_square) std::swap(best, other);
  } else {
    best = fitted_size(data, model, bounds, here, CurveKind::saturation, largest);
  }
  best.curve.left = best.fit.mean_square / here.mean_square;
  const double least = (std::min)(here.mean_square, other.fit.mean_square);
  const double gained = static_cast<double>(here.rows) * std::log(least / best.fit.mean_square);
  if (!(gained > 40.0 && best.curve.size.share() < 0.5)) return {};
  const auto [knot, below, above] =
      gain_by_size(acted_data(data, best.curve), model, bounds, best.fit.at);
  const double apart = (std::abs)(below.value - above.value);
  const bool one =
      apart <= (std::max)(below.half_width + above.half_width,
                          0.1 * (std::max)((std::abs)(below.value), (std::abs)(above.value)));
  // Of two levels b0 is one.
  return knot <= 0.0 || (one && below.share() < 0.2 && above.share() < 0.2) ? best.curve
                                                                            : SeenCurve{};
}

}  // namespace detail
}  // namespace esokit
