#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

/// Autocorrelation of a series at lags of 1 to 20 rows.
inline std::array<double, 20> correlations(const std::vector<double>& e) {
  const double square = dot(e.data(), e.data(), e.size());
  std::array<double, 20> found{};
  for (std::size_t lag = 1; lag <= found.size() && lag < e.size(); ++lag) {
    found[lag - 1] = dot(e.data(), e.data() + lag, e.size() - lag) / square;
  }
  return found;
}

ESOKIT_FUNCTION std::vector<double> smoothed(const FitData& data, int half, int derivative) {
  std::vector<double> out(data.y.size());
  const double T = data.sample_time;
  for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
    const auto from = static_cast<std::ptrdiff_t>(data.starts[piece]);
    const auto to = static_cast<std::ptrdiff_t>(
        piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.y.size());
    for (std::ptrdiff_t k = from; k < to; ++k) {
      const std::ptrdiff_t h = std::max<std::ptrdiff_t>(
          (std::min)({static_cast<std::ptrdiff_t>(half), k - from, to - 1 - k}), derivative);
      double sum = 0.0, weight = 0.0;
      for (std::ptrdiff_t i = -h; i <= h; ++i) {
        const double y = data.y[static_cast<std::size_t>(std::clamp(k + i, from, to - 1))];
        const double x = static_cast<double>(i);
        const double w = derivative == 1 ? x : 1.0;
        sum += w * y;
        weight += derivative == 1 ? x * x : 1.0;
      }
      out[static_cast<std::size_t>(k)] = derivative == 1 ? sum / (weight * T) : sum / weight;
    }
  }
  return out;
}

ESOKIT_FUNCTION double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(values.size(), 1)));
}

ESOKIT_FUNCTION double innovations_correlation(const std::vector<double>& e) {
  const auto found = correlations(e);
  double largest = 0.0;
  for (const double value : found) largest = (std::max)(largest, (std::abs)(value));
  // A residual that is zero or not finite is no evidence of a good fit.
  return is_finite(found[0]) ? largest : std::numeric_limits<double>::infinity();
}

/// Friction scales v_s that are tried, as shares of the rms of the speed.
constexpr double friction_scales[] = {0.01, 0.02, 0.04, 0.08, 0.16, 0.32};

ESOKIT_FUNCTION std::vector<double> friction_speed(const FitData& data, int order, double noise,
                                                   double latency) {
  const double T = data.sample_time;
  const int longest = std::clamp(static_cast<int>(latency / T), 2, 200);
  if (order == 1) {
    // Until the noise is a tenth of the smallest scale.
    int half = 0;
    const double turn = 0.1 * friction_scales[0] * rms(data.y);
    while (half < (std::min)(longest, 3) && noise / std::sqrt(2.0 * half + 1.0) > turn) ++half;
    return smoothed(data, half, 0);
  }
  int half = 2;
  std::vector<double> speed = smoothed(data, half, 1);
  const double size = rms(speed);
  while (half < longest && noise * std::sqrt(12.0 / std::pow(2 * half + 1, 3)) / T > 0.01 * size)
    ++half;
  return half > 2 ? smoothed(data, half, 1) : speed;
}

ESOKIT_FUNCTION bool stops(const std::vector<double>& speed) {
  const auto [low, high] = std::minmax_element(speed.begin(), speed.end());
  const double band = 0.02 * (*high - *low);
  return *low <= band && *high >= -band;
}

ESOKIT_FUNCTION FitData with_friction(const FitData& data, const std::vector<double>& speed,
                                      double scale) {
  FitData out = data;
  std::vector<double> column(speed.size());
  for (std::size_t k = 0; k < speed.size(); ++k) column[k] = -std::tanh(speed[k] / scale);
  out.columns.push_back(std::move(column));
  out.friction = static_cast<std::ptrdiff_t>(out.columns.size()) - 1;
  return out;
}

ESOKIT_FUNCTION std::pair<double, double> position_scale(const FitData& data) {
  std::vector<double> y = data.y;
  double mean = 0.0;
  for (const double value : y) mean += value / static_cast<double>(y.size());
  for (double& value : y) value -= mean;
  return {mean, rms(y)};
}

ESOKIT_FUNCTION void add_position(FitData& data, std::size_t from) {
  // As measured: if it were smoothed, the future noise of y would make it differ from a column of
  // the log.
  const auto [mean, size] = position_scale(data);
  std::vector<double> y = data.y;
  for (double& value : y) value -= mean;
  std::vector<double> column(y.size(), 1.0);
  for (std::size_t power = 1; power < from + position_columns; ++power) {
    for (std::size_t k = 0; k < y.size(); ++k) column[k] *= size > 0.0 ? y[k] / size : 0.0;
    if (power >= from) data.columns.push_back(column);
  }
}

ESOKIT_FUNCTION FitBounds fit_bounds(const FitData& data, bool wide) {
  const double T = data.sample_time;
  const double duration = T * static_cast<double>(data.y.size());
  return {6.0 / duration, 1.5 / T, 0.05 * T, (std::min)(200.0 * T, duration / (wide ? 12.0 : 30.0)),
          wide ? 0.9 : 0.5};
}

/// The best fit from several starts, with w free.
inline Fit best_fit(InnovationsFit& fit, int starts = 3) {
  const double T = fit.data().sample_time;
  std::vector<Fit> grid;
  for (const double row_share : {0.02, 0.08, 0.3, 0.8}) {
    for (const double rows : {1.5, 4.0, 10.0, 30.0, 80.0}) {
      if (rows * T > fit.bounds().latency_max) continue;
      grid.push_back(fit.at(fit.inside({row_share / T, rows * T, 0.7, 0.0})));
    }
  }
  std::sort(grid.begin(), grid.end(),
            [](const Fit& a, const Fit& b) { return a.mean_square < b.mean_square; });
  Fit best;
  best.mean_square = std::numeric_limits<double>::infinity();
  std::vector<double> tried;
  for (const Fit& start : grid) {
    bool known = false;
    for (const double latency : tried) known = known || latency == start.at.latency;
    if (known) continue;
    if (static_cast<int>(tried.size()) == starts) break;
    tried.push_back(start.at.latency);
    const Fit found = fit.minimise(start.at, true, 8);
    if (found.mean_square < best.mean_square) best = found;
  }
  return best.converged ? best : fit.minimise(best.at, true);
}

ESOKIT_FUNCTION double criterion(const Fit& fit, int parameters) {
  const double rows = static_cast<double>(fit.rows);
  return rows * std::log(fit.mean_square) + parameters * std::log(rows);
}

ESOKIT_FUNCTION RubbedFit rubbed_fit(const FitData& data, const std::vector<double>& speed,
                                     const FitModel& model, const FitBounds& bounds,
                                     const Fit& without, bool with_bandwidth) {
  const double size = rms(speed);
  RubbedFit best{0.0, without};
  // Friction changes the other parameters, and they change its scale: repeated twice.
  for (int pass = 0; pass < 2; ++pass) {
    double least = std::numeric_limits<double>::infinity();
    const auto attempt = [&](double scale) {
      const FitData rubbed = with_friction(data, speed, scale);
      InnovationsFit fit(rubbed, model, bounds);
      const double square = fit.at(best.fit.at).mean_square;
      if (square < least) least = square, best.scale = scale;
    };
    for (const double share : friction_scales) attempt(share * size);
    for (double factor = std::sqrt(2.0); factor > 1.05; factor = std::sqrt(factor)) {
      const double middle = best.scale;
      attempt(middle * factor);
      attempt(middle / factor);
    }
    const FitData rubbed = with_friction(data, speed, best.scale);
    InnovationsFit fit(rubbed, model, bounds);
    best.fit = fit.minimise(best.fit.at, with_bandwidth, 8);
  }
  return best;
}

/// The best fit of one order, with friction if that improves it.
/// @param before the fit of this order before sines were added, from which this one starts; or none
inline OrderFit fit_order(const FitData& data, const IdentifyOptions& options, int order,
                          const FitBounds& bounds, const OrderFit* before) {
  const auto best_of = [&](InnovationsFit& fit, int starts) {
    return before == nullptr ? best_fit(fit, starts) : fit.minimise(before->fit.at, true);
  };
  OrderFit result;
  result.model = {order, 1, options.pole};
  result.bounds = bounds;
  const int columns = static_cast<int>(data.columns.size());
  InnovationsFit plain(data, result.model, bounds);
  result.fit = best_of(plain, 3);
  (void)plain.at(result.fit.at);  // innovations of this fit, not of the last start
  result.criterion = criterion(result.fit, 5 + columns);
  result.correlation = innovations_correlation(plain.residual());
  result.noise = plain.noise_floor(result.fit);
  if (!options.friction || order > 2 || (order == 1 && !stops(data.y))) return result;
  const auto speed = friction_speed(data, order, result.fit.noise, result.fit.at.latency);
  const double size = rms(speed);
  if (!(size > 0.0)) return result;
  const auto [best_scale, best] = rubbed_fit(data, speed, result.model, bounds, result.fit, true);
  const FitData rubbed = with_friction(data, speed, best_scale);
  InnovationsFit fit(rubbed, result.model, bounds);
  // Further starts, because the missing friction may have misled the first fit.
  Fit found = best_of(fit, 2);
  if (best.mean_square < found.mean_square) found = fit.minimise(best.at, true);
  const double with = criterion(found, 6 + columns);
  if (with < result.criterion) {
    result.fit = found;
    result.criterion = with;
    result.friction_scale = best_scale;
    // Computes the residual of this fit again.
    (void)fit.at(found.at);
    result.correlation = innovations_correlation(fit.residual());
    result.noise = fit.noise_floor(result.fit);
  }
  return result;
}

ESOKIT_FUNCTION FitData with_friction(const FitData& data, const OrderFit& order) {
  if (!(order.friction_scale > 0.0)) return data;
  return with_friction(
      data, friction_speed(data, order.model.order, order.fit.noise, order.fit.at.latency),
      order.friction_scale);
}

ESOKIT_FUNCTION void compare_orders(const FitData& data, std::vector<OrderFit>& orders) {
  if (orders.size() < 2) return;
  double least = std::numeric_limits<double>::infinity();
  for (const OrderFit& order : orders) least = (std::min)(least, order.fit.at.bandwidth);
  for (OrderFit& order : orders) {
    const FitData used = with_friction(data, order);
    InnovationsFit fit(used, order.model, order.bounds);
    FitPoint point = order.fit.at;
    order.slower = 0.0;
    for (const double factor : {std::sqrt(0.1), 0.1}) {
      point.bandwidth = least * factor;
      const Fit found = fit.minimise(point, false, 8);
      order.slower += 0.5 * std::log(found.mean_square);
      if (!fit.at_bound(found.at)) point = found.at;
    }
  }
}

ESOKIT_FUNCTION std::vector<OrderFit> fit_orders(const FitData& data,
                                                 const IdentifyOptions& options,
                                                 const FitBounds& bounds,
                                                 const std::vector<OrderFit>& before) {
  std::vector<OrderFit> orders;
  for (const int order : options.orders) {
    const auto known = std::find_if(before.begin(), before.end(),
                                    [&](const OrderFit& fit) { return fit.model.order == order; });
    orders.push_back(
        fit_order(data, options, order, bounds, known == before.end() ? nullptr : &*known));
  }
  compare_orders(data, orders);
  return orders;
}

/// Whether `lower` is `higher` without its friction at standstill: b0 / a as b0, and 1 / a in the
/// latency. A machine that bends has such a `higher` one, too, but without friction.
inline bool is_part_of(const OrderFit& lower, const OrderFit& higher) {
  const double pole = higher.fit.at.pole;
  if (lower.model.order + 1 != higher.model.order || !(higher.friction_scale > 0.0)) return false;
  const auto alike = [](double a, double b) { return 0.75 * b < a && a < b / 0.75; };
  return alike(higher.fit.linear[0] / pole / lower.fit.linear[0], 1.0) &&
         alike(1.0 / pole + higher.fit.at.latency, lower.fit.at.latency);
}

ESOKIT_FUNCTION std::vector<OrderFit>::const_iterator best_order(
    const std::vector<OrderFit>& orders) {
  const auto likely = std::min_element(
      orders.begin(), orders.end(),
      [](const OrderFit& a, const OrderFit& b) { return a.criterion < b.criterion; });
  const auto slower =
      std::min_element(orders.begin(), orders.end(),
                       [](const OrderFit& a, const OrderFit& b) { return a.slower < b.slower; });
  return slower->slower < likely->slower - 1.0 && !is_part_of(*slower, *likely) ? slower : likely;
}

ESOKIT_FUNCTION OtherOrder other_order_of(const FitData& data, const std::vector<OrderFit>& orders,
                                          int chosen, int extension, const Fit& here, int lowest) {
  const auto of = [&](int order) {
    return std::find_if(orders.begin(), orders.end(),
                        [order](const OrderFit& fit) { return fit.model.order == order; });
  };
  OtherOrder found;
  for (int order = lowest; order <= 3; ++order) {
    if (order == chosen) continue;
    const bool studied = of(order) != orders.end();
    OrderFit other = *of(studied ? order : chosen);
    if (!studied) {
      other.model.order = order;
      other.friction_scale = 0.0;
      other.fit.at.pole = 0.0;
    }
    const FitData used = with_friction(data, other);
    InnovationsFit fit(used, {other.model.order, extension, other.model.pole}, other.bounds);
    FitPoint own = other.fit.at, exchanged = here.at;
    own.bandwidth = here.at.bandwidth;
    if (other.model.order > chosen) {
      exchanged.pole = 1.0 / (std::max)(here.at.lag(), other.bounds.latency_min);
      exchanged.latency = (std::max)(here.at.dead_time(), other.bounds.latency_min);
    } else if (here.at.pole > 0.0) {
      exchanged.pole = 0.0;
      exchanged.latency += 1.0 / here.at.pole;
    }
    for (const FitPoint& start : {own, exchanged}) {
      const double left = fit.minimise(start, false, 8).mean_square / here.mean_square;
      if (found.order == 0 || left < found.left) found = {other.model.order, left};
    }
  }
  return found;
}

/// Largest share of the rows at standstill: of more, too little motion is left, or a coarse encoder
/// hides it.
constexpr double held_max = 0.8;

ESOKIT_FUNCTION std::optional<HeldLog> held_log(const FitData& rows, const FitModel& model,
                                                const FitBounds& bounds, const Fit& here,
                                                const std::vector<double>& speed) {
  const double size = rms(speed);
  std::optional<HeldLog> best;
  double least = 0.95 * here.mean_square;
  for (const double still : {0.02, 0.1}) {
    FitData cut = rows;
    std::size_t count = 0;
    for (std::size_t k = 0; k < speed.size(); ++k) {
      if ((std::abs)(speed[k]) < still * size) cut.u[k] = 0.0, ++count;
    }
    const double share = static_cast<double>(count) / static_cast<double>(speed.size());
    if (count == 0 || share > held_max) continue;
    for (const double scale : {0.01 * size, 0.1 * size}) {
      const FitData rubbed = with_friction(cut, speed, scale);
      InnovationsFit fit(rubbed, model, bounds);
      const Fit found = fit.minimise(here.at, false, 8);
      if (!(found.mean_square < least)) continue;
      least = found.mean_square;
      best = HeldLog{cut, scale, share, found};
    }
  }
  return best;
}

ESOKIT_FUNCTION bool position_acts(const FitData& data, const OrderFit& order, bool friction) {
  FitData more = data;
  add_position(more);
  const FitData used = with_friction(more, order);
  InnovationsFit fit(used, order.model, order.bounds);
  const Fit found = fit.minimise(order.fit.at, true, 8);
  const FitData before = with_friction(data, order);
  InnovationsFit without(before, order.model, order.bounds);
  FitPoint slower = order.fit.at;
  slower.bandwidth *= 0.1;
  const Fit left = without.minimise(slower, false, 8);
  const double with = fit.minimise(slower, false, 8).mean_square;
  const bool likely =
      criterion(found, static_cast<int>(position_columns)) < criterion(order.fit, 0);
  if (!likely && !(with < left.mean_square / std::numbers::e)) return false;
  if (order.model.order != 2 || !friction) return true;
  const auto speed = friction_speed(data, 2, order.fit.noise, order.fit.at.latency);
  const auto held = held_log(data, order.model, order.bounds, left, speed);
  return !held || !(held->fit.mean_square < with);
}

}  // namespace detail
}  // namespace esokit
