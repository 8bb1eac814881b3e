#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/input_checks.hpp>
#include <limits>
#include <utility>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION bool GainBySize::differs(const Estimate& a, const Estimate& b) {
  const double apart = (std::abs)(a.value - b.value);
  return apart > a.half_width + b.half_width &&
         apart > 0.25 * (std::max)((std::abs)(a.value), (std::abs)(b.value));
}

ESOKIT_FUNCTION bool GainInMotion::differ() const {
  return still > 0.0 && GainBySize::differs(moving, at_rest) &&
         (std::abs)(at_rest.value) < (std::abs)(moving.value) &&
         (std::abs)(moving.value - all) > 0.1 * (std::abs)(all);
}

namespace detail {

ESOKIT_FUNCTION std::pair<Estimate, Estimate> two_gains(const FitData& data, const FitModel& model,
                                                        const FitBounds& bounds,
                                                        const FitPoint& at) {
  InnovationsFit fit(data, model, bounds);
  const Fit best = fit.minimise(at, false, 8);
  const FitErrors errors = jackknife(fit, best, false);
  const double t = student_95(19);
  const std::size_t last = data.inputs.size();
  return {{best.linear[0], t * errors.linear[0]}, {best.linear[last], t * errors.linear[last]}};
}

ESOKIT_FUNCTION GainInMotion gain_in_motion(const FitData& data, const FitModel& model,
                                            const FitBounds& bounds, const Fit& here,
                                            const std::vector<double>& speed) {
  double square = 0.0;
  for (const double v : speed) square += v * v;
  const double slow = 0.1 * std::sqrt(square / static_cast<double>(speed.size()));
  FitData split = data;
  std::vector<double> held(data.u.size(), 0.0);
  std::size_t rows = 0;
  for (std::size_t k = 0; k < held.size(); ++k) {
    if ((std::abs)(speed[k]) < slow) std::swap(held[k], split.u[k]), ++rows;
  }
  if (rows == 0 || rows == held.size()) return {};
  split.inputs.push_back(std::move(held));
  const auto [moving, at_rest] = two_gains(split, model, bounds, here.at);
  return {static_cast<double>(rows) / static_cast<double>(speed.size()), moving, at_rest,
          here.linear[0]};
}

ESOKIT_FUNCTION GainBySize gain_by_size(const FitData& data, const FitModel& model,
                                        const FitBounds& bounds, const FitPoint& at) {
  std::vector<double> sizes;
  for (const double u : data.u) sizes.push_back((std::abs)(u));
  std::sort(sizes.begin(), sizes.end());
  // Without a fiftieth at each end, which may be peaks.
  const std::size_t few = sizes.size() / 50;
  const double knot = 0.5 * (sizes[few] + sizes[sizes.size() - 1 - few]);
  FitData split = data;
  std::vector<double> beyond(data.u.size());
  for (std::size_t k = 0; k < beyond.size(); ++k) {
    split.u[k] = std::clamp(data.u[k], -knot, knot);
    beyond[k] = data.u[k] - split.u[k];
  }
  // Of two levels the two parts are multiples of each other, but for a constant.
  const auto product = [](const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0.0, of_a = 0.0, of_b = 0.0;
    for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k], of_a += a[k], of_b += b[k];
    return sum - of_a * of_b / static_cast<double>(a.size());
  };
  const double both = product(split.u, beyond);
  const double alone = product(split.u, split.u) * product(beyond, beyond);
  if (!(both * both < 0.999 * alone)) return {};
  split.inputs.push_back(std::move(beyond));
  const auto [below, above] = two_gains(split, model, bounds, at);
  return {knot, below, above};
}

ESOKIT_FUNCTION FitData advanced(FitData data, std::size_t rows) {
  for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
    const std::size_t to = piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.u.size();
    for (std::size_t k = data.starts[piece]; k < to; ++k)
      data.u[k] = data.u[(std::min)(k + rows, to - 1)];
  }
  return data;
}

ESOKIT_FUNCTION Lead lead_of(const FitData& data, const FitModel& model, const FitBounds& bounds,
                             const Fit& here) {
  constexpr std::size_t rows = 10;
  const double T = data.sample_time;
  const FitData earlier = advanced(data, rows);
  InnovationsFit fit(earlier, model, bounds);
  Fit best;
  best.mean_square = std::numeric_limits<double>::infinity();
  for (const double part : {2.0, 5.0, 8.0}) {
    FitPoint start = here.at;
    start.latency = part * T;
    const Fit found = fit.minimise(start, false, 8);
    if (found.mean_square < best.mean_square) best = found;
  }
  const double lead = static_cast<double>(rows) * T - best.at.latency;
  // A model error may look like a lead, but then the lead helps little.
  if (!(best.mean_square < 0.75 * here.mean_square && lead > 0.3 * T)) return {};
  return {lead, best.input_gain(), 1.0};
}

ESOKIT_FUNCTION double span_of_rates(const FitData& data, double window) {
  const double T = data.sample_time;
  const auto by = static_cast<std::size_t>((std::max)(4.0, std::ceil(window / T)));
  double fastest = 0.0, slowest = 0.0;
  for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
    const std::size_t to = piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.y.size();
    for (std::size_t k = data.starts[piece]; k + by < to; ++k) {
      const double rate = (data.y[k + by] - data.y[k]) / (static_cast<double>(by) * T);
      fastest = (std::max)(fastest, rate);
      slowest = (std::min)(slowest, rate);
    }
  }
  return fastest - slowest;
}

/// A linear law, found by least squares.
struct LinearLaw {
  std::vector<double> factors{};  ///< of the columns
  double left = 0.0;              ///< share of the squares that the law does not explain
};

inline LinearLaw linear_law(const std::vector<std::vector<double>>& columns,
                            const std::vector<double>& right) {
  LinearLaw law;
  std::vector<double> normal;
  InnovationsFit::normal_equations(columns, right, normal, law.factors);
  solve_normal(normal, law.factors, static_cast<int>(columns.size()));
  std::vector<double> rest = right;
  for (std::size_t c = 0; c < columns.size(); ++c) {
    for (std::size_t k = 0; k < rest.size(); ++k) rest[k] -= law.factors[c] * columns[c][k];
  }
  law.left =
      dot(rest.data(), rest.data(), rest.size()) / dot(right.data(), right.data(), right.size());
  return law;
}

ESOKIT_FUNCTION std::vector<double> delayed(const std::vector<double>& values, std::size_t by) {
  double mean = 0.0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  std::vector<double> out(values.size(), 0.0);
  for (std::size_t k = 2; k < out.size(); ++k) out[k] = values[k - by] - mean;
  return out;
}

ESOKIT_FUNCTION std::vector<double> ones(std::size_t rows) {
  std::vector<double> out(rows, 1.0);
  std::fill_n(out.begin(), std::min<std::size_t>(rows, 2), 0.0);
  return out;
}

ESOKIT_FUNCTION double own_input(const FitData& data) {
  const std::vector<double> y = delayed(data.y, 0);
  // The change, as y and y of the row before are nearly the same column.
  std::vector<double> change = delayed(data.y, 1);
  for (std::size_t k = 0; k < y.size(); ++k) change[k] -= y[k];
  return std::sqrt(
      linear_law({ones(y.size()), y, change, delayed(data.u, 1)}, delayed(data.u, 0)).left);
}

ESOKIT_FUNCTION double slope_of_law(const FitData& data) {
  return linear_law({delayed(data.y, 0)}, delayed(data.u, 0)).factors[0];
}

ESOKIT_FUNCTION bool at_once(const FitData& data) {
  int changes = 0;
  for (std::size_t k = 1; k < data.u.size(); ++k) changes += data.u[k] != data.u[k - 1] ? 1 : 0;
  const LinearLaw law = linear_law({ones(data.y.size()), delayed(data.y, 1), delayed(data.u, 0),
                                    delayed(data.u, 1), delayed(data.u, 2)},
                                   delayed(data.y, 0));
  return changes >= 4 && law.left < 0.1 && (std::abs)(law.factors[1]) < 0.3;
}

}  // namespace detail
}  // namespace esokit
