/// @file
/// From a log to a model with error bars, or to an error that says what to record instead.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/intervals.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/model_eso.hpp>
#include <functional>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

namespace esokit {

/// Options of an identification.
struct IdentifyOptions {
  std::vector<int> orders{1, 2, 3};  ///< the orders n to try
  bool friction = true;              ///< a column tanh(v / v_s) for orders 1 and 2
  bool pole = true;                  ///< whether the plant may have a pole

  /// Columns y, y^2 and y^3 (gravity, springs) for orders 2 and 3, if they improve the fit.
  bool position = true;
  int extension = 0;      ///< m: 1 or 2 integrators of the disturbance; 0: chosen by the fit
  int sinusoids = 3;      ///< largest number of sines in the disturbance
  int schedule_bins = 4;  ///< number of ranges of the scheduling column, with equal numbers of rows
  int averaged = 0;       ///< rows to average into one; 0: chosen from the innovations
  std::size_t rows_max = 60000;  ///< rows used of a longer log, in evenly spread pieces

  /// Whether u is what the actuator held. A command beyond its limits is not.
  bool applied = true;

  /// Whether the effect of a column may be late: its lag and its dead time are found. A known
  /// effect (gravity, friction of another joint) acts at once.
  bool late_columns = true;
  double interval_max = 0.1;      ///< largest half width of the interval of b0, share of b0
  double interval_agreed = 0.35;  ///< the same if output error finds the same b0
  double plateau_max = 0.1;       ///< largest relative difference of b0 between three bandwidths
  double correlation_max = 0.1;   ///< largest correlation of innovations, lags 1 to 20; 1: no check
  bool scheduled = false;         ///< accept a b0 that depends on the scheduling column
  double friction_shift_max =
      3;  ///< largest difference of b0 between friction scales, standard errors
  double position_shift_max = 1.5;  ///< largest change of b0 by a force by position, half widths
  std::function<void(double)> progress{};  ///< called with the finished share, 0 to 1
};

/// The best fit of one order.
struct OrderFit {
  FitModel model{};             ///< n, m and whether it has a pole
  FitBounds bounds{};           ///< of its parameters
  Fit fit{};                    ///< the fit with the smallest innovations
  double friction_scale = 0.0;  ///< v_s, 0 without friction
  double criterion = 0.0;  ///< rows log(mean square) + parameters log(rows): the smallest is best

  /// log(mean square) at lower bandwidths: the mean over 1 / sqrt(10) and a tenth of the lowest
  /// bandwidth of all orders.
  double slower = 0.0;
  double correlation = 0.0;  ///< largest correlation of the innovations over lags 1 to 20
  Estimate noise{};          ///< from the fast part of the innovations, unit of y; 0: unknown
};

/// b0 for a range of the scheduling column.
struct GainInRange {
  double from = 0.0;      ///< smallest value of the column
  double to = 0.0;        ///< largest value of the column
  std::size_t rows = 0;   ///< number of rows in the range
  Estimate input_gain{};  ///< b0 in the range
};

/// A force that depends on the position, such as gravity or a spring: a cubic of y as the log
/// tells it, without its constant.
struct PositionForce {
  double middle = 0.0;                ///< mean y of the log
  double size = 0.0;                  ///< rms of y - middle
  double low = 0.0;                   ///< least y of the log, which knows no more
  double high = 0.0;                  ///< largest y of the log
  std::array<Estimate, 3> factors{};  ///< of x, x^2, x^3 with x = (y - middle) / size; unit of
                                      ///< y^(n)

  /// Unit of y^(n), as it acts; beyond the range of the log it stays as at its end.
  [[nodiscard]] double operator()(double y) const {
    const double x = (std::clamp(y, low, high) - middle) / size;
    return x * (factors[0].value + x * (factors[1].value + x * factors[2].value));
  }
  /// A bound on its error, 95 %, as if all factors were wrong together.
  [[nodiscard]] double half_width(double y) const {
    const double x = std::abs((std::clamp(y, low, high) - middle) / size);
    return x * (factors[0].half_width + x * (factors[1].half_width + x * factors[2].half_width));
  }
};

/// Another order at the bandwidth at which b0 was found.
struct Rival {
  int order = 0;      ///< of 1 to 3, the one that leaves the smallest mean square there; 0: none
  double left = 1.0;  ///< its mean square over that of the identified order
};

/// A model with error bars, and the evidence for it.
struct Identified {
  int order = 0;              ///< n
  int extension = 1;          ///< m
  Estimate input_gain{};      ///< b0, unit of y^(n) per unit of u
  Estimate latency{};         ///< lag plus dead time, s
  Estimate lag{};             ///< tau, s
  Estimate dead_time{};       ///< L, s
  Estimate pole{};            ///< a, 1/s
  Estimate friction{};        ///< Coulomb friction, unit of y^(n); 0 if not fitted
  double friction_scale = 0;  ///< v_s of friction tanh(v / v_s), unit of y / s (order 1: y)
  Estimate noise{};           ///< standard deviation of the measurement noise, unit of y
  double disturbance = 0;     ///< intensity of d^(m): variance of its increments per time

  /// What the log's own columns add to y^(n).
  std::vector<MeasuredEffect> columns{};

  /// `disturbance` if the columns were not measured, so that they are a part of d. Not of those
  /// that are functions of y. 0 without columns.
  double disturbance_unmeasured = 0;
  std::vector<Sinusoid> sinusoids{};    ///< sines in the disturbance, the largest first
  std::vector<GainInRange> schedule{};  ///< b0 over the log's scheduling column
  Estimate schedule_slope{};  ///< slope of b0 over the scheduling column, from a straight line
  double schedule_shift = 0;  ///< largest difference of b0 over the column, divided by its interval
  double friction_shift = 0;  ///< difference of b0 between friction scales, standard errors of b0

  /// Whether y, y^2 and y^3 were fitted as columns. In `plant` and `model` this force is part of
  /// the disturbance.
  bool position = false;
  PositionForce position_force{};  ///< what was fitted

  /// Change of b0 if they are added (if they are in the model: the next three powers), half widths
  /// of b0 (at least 1 % of b0), with its drift over one and a half octaves.
  double position_shift = 0;
  double correlation = 0;          ///< largest correlation of the innovations over lags 1 to 20
  SecondOpinion second_opinion{};  ///< b0 by output error
  GainBySize by_size{};            ///< b0 at small and at large u
  GainInMotion in_motion{};        ///< b0 in motion and at standstill, of order 2; not if `held`

  /// Share of the rows at standstill in which friction holds the machine against u (order 2), so
  /// that b0, pole and friction are fitted without u there; 0: it does not hold. Latency, lag and
  /// dead time are of all rows.
  double held = 0;
  Lead lead{};                     ///< how early y moves before u, if it does
  Rival rival{};                   ///< the other order that explains the log best there
  bool at_once = false;            ///< y follows u within the row, with nothing in between
  int averaged = 1;                ///< rows of the log that were averaged into one
  bool at_bound = false;           ///< a parameter is at a bound of its range at the plateau
  double excitation = 0;           ///< smallest relative standard error of b0
  double own_input = 1;            ///< share of u that does not follow from y and the row before
  LogReport log{};                 ///< the report on the log before any fit
  Plateau plateau{};               ///< b0 over the bandwidth
  std::vector<OrderFit> orders{};  ///< best fit of each order, by order

  /// The identified plant, for simulation, analysis and observers; d enters at y^(n).
  /// @tparam Order n, which must be the identified order
  template <int Order>
  [[nodiscard]] Expected<LinearPlant<Order + 1>, Error<double>> plant() const {
    if (order != Order) {
      return Error<double>{
          "order", static_cast<double>(order), "is not the requested order, which is",
          -1,      static_cast<double>(Order), true};
    }
    typename LinearPlant<Order>::Chain chain;
    chain.coefficients[Order - 1] = pole.value;
    chain.input_gain = input_gain.value;
    chain.dead_time = dead_time.value;
    const auto rigid = LinearPlant<Order>::chain(chain);
    if (!rigid) return rigid.error();
    return with_lag(*rigid, lag.value);
  }

  /// The identified model as settings of an AugmentedModel: the lag as its actuator, the pole as
  /// its plant_poles, the largest sinusoids as its resonators. Effects without a part in `Parts`
  /// are left to the disturbance.
  /// @tparam Parts with the identified order and without a sensor, which a log cannot distinguish
  /// from an actuator
  template <ModelParts Parts>
  [[nodiscard]] Expected<typename AugmentedModel<Parts>::Settings, Error<double>> model() const {
    static_assert(Parts.actuator <= 1, "esokit: identify finds a lag of first order");
    static_assert(Parts.sensor == 0 && Parts.first_order == 0 && !Parts.follows_speed,
                  "esokit: identify finds no sensor, no first-order disturbances and no speed");
    Rules<double> rules;
    rules.require(order == Parts.order,
                  {"order", static_cast<double>(order), "is not the requested order, which is", -1,
                   static_cast<double>(Parts.order), true});
    const auto count = static_cast<std::size_t>(Parts.resonators);
    rules.require(sinusoids.size() >= count, {"sinusoids", static_cast<double>(sinusoids.size()),
                                              "were found, fewer than the requested resonators:",
                                              -1, static_cast<double>(Parts.resonators), true});
    if (!rules) return rules.error();
    typename AugmentedModel<Parts>::Settings settings;
    if constexpr (Parts.plant_poles) settings.plant[Parts.order - 1] = pole.value;
    if constexpr (Parts.actuator == 1) settings.actuator.time_constant = lag.value;
    if constexpr (Parts.resonators > 0) {
      for (std::size_t i = 0; i < count; ++i) {
        settings.resonators[i].frequency = sinusoids[i].frequency.value;
      }
    }
    return settings;
  }

  /// The config of a ModelEso with the identified model.
  /// @param observer_bandwidth omega_o, rad/s @param sample_time of the controller, s
  template <ModelParts Parts>
  [[nodiscard]] Expected<typename ModelEso<Parts>::Config, Error<double>> observer(
      double observer_bandwidth, double sample_time) const {
    const auto settings = model<Parts>();
    if (!settings) return settings.error();
    typename ModelEso<Parts>::Config config;
    config.observer_bandwidth = observer_bandwidth;
    config.input_gain = input_gain.value;
    config.sample_time = sample_time;
    config.model = *settings;
    return config;
  }

  /// Where the disturbance comes above the noise: the bandwidth of a Kalman filter for both, rad/s.
  [[nodiscard]] double disturbance_bandwidth() const { return bandwidth_of(disturbance); }

  /// Intensity of the random walk that stands for the disturbance, (unit of y^(n))^2 / s: of equal
  /// power at disturbance_bandwidth(). For m = 1 it is `disturbance`.
  [[nodiscard]] double random_walk() const { return walk_of(disturbance); }
  /// The same without the columns, see `disturbance_unmeasured`.
  [[nodiscard]] double random_walk_unmeasured() const { return walk_of(disturbance_unmeasured); }

  /// The dead time in samples, for DelayedInput. @param sample_time s, above 0
  [[nodiscard]] int delay(double sample_time) const {
    return static_cast<int>(std::lround(dead_time.value / sample_time));
  }

 private:
  [[nodiscard]] double bandwidth_of(double intensity) const {
    return std::pow(intensity / (noise.value * noise.value * log.sample_time),
                    0.5 / (order + extension));
  }
  [[nodiscard]] double walk_of(double intensity) const {
    return intensity / std::pow(bandwidth_of(intensity), 2 * (extension - 1));
  }
};

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

/// Slope (derivative 1) or value (0) at each row of a parabola fitted to 2 half + 1 rows.
inline std::vector<double> smoothed(const FitData& data, int half, int derivative) {
  std::vector<double> out(data.y.size());
  const double T = data.sample_time;
  for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
    const auto from = static_cast<std::ptrdiff_t>(data.starts[piece]);
    const auto to = static_cast<std::ptrdiff_t>(
        piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.y.size());
    for (std::ptrdiff_t k = from; k < to; ++k) {
      const std::ptrdiff_t h = std::max<std::ptrdiff_t>(
          std::min({static_cast<std::ptrdiff_t>(half), k - from, to - 1 - k}), derivative);
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

inline double rms(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(std::max<std::size_t>(values.size(), 1)));
}

/// Largest correlation of the innovations over lags 1 to 20.
inline double innovations_correlation(const std::vector<double>& e) {
  const auto found = correlations(e);
  double largest = 0.0;
  for (const double value : found) largest = std::max(largest, std::abs(value));
  // A residual that is zero or not finite is no evidence of a good fit.
  return is_finite(found[0]) ? largest : std::numeric_limits<double>::infinity();
}

/// Friction scales v_s that are tried, as shares of the rms of the speed.
constexpr double friction_scales[] = {0.01, 0.02, 0.04, 0.08, 0.16, 0.32};

/// The speed on which friction depends: y' for order 2, y for order 1; smoothed until the noise in
/// it is a fiftieth, over at most the latency.
inline std::vector<double> friction_speed(const FitData& data, int order, double noise,
                                          double latency) {
  const double T = data.sample_time;
  const int longest = std::clamp(static_cast<int>(latency / T), 2, 200);
  if (order == 1) {
    // Until the noise is a tenth of the smallest scale.
    int half = 0;
    const double turn = 0.1 * friction_scales[0] * rms(data.y);
    while (half < std::min(longest, 3) && noise / std::sqrt(2.0 * half + 1.0) > turn) ++half;
    return smoothed(data, half, 0);
  }
  int half = 2;
  std::vector<double> speed = smoothed(data, half, 1);
  const double size = rms(speed);
  while (half < longest && noise * std::sqrt(12.0 / std::pow(2 * half + 1, 3)) / T > 0.01 * size)
    ++half;
  return half > 2 ? smoothed(data, half, 1) : speed;
}

/// Whether a speed comes near zero, where friction turns round. Of a y that stays away from zero (a
/// temperature) nothing may depend on where zero is.
inline bool stops(const std::vector<double>& speed) {
  const auto [low, high] = std::minmax_element(speed.begin(), speed.end());
  const double near = 0.02 * (*high - *low);
  return *low <= near && *high >= -near;
}

/// The data with an added column for friction, tanh(speed / scale).
inline FitData with_friction(const FitData& data, const std::vector<double>& speed, double scale) {
  FitData out = data;
  std::vector<double> column(speed.size());
  for (std::size_t k = 0; k < speed.size(); ++k) column[k] = -std::tanh(speed[k] / scale);
  out.columns.push_back(std::move(column));
  out.friction = static_cast<std::ptrdiff_t>(out.columns.size()) - 1;
  return out;
}

/// A force that depends on the position, such as gravity or a spring: y, y^2 and y^3 as columns.
/// Without it b0 is wrong below the frequencies of the motion, by the same amount at every
/// bandwidth there: a plateau at a wrong b0.
constexpr std::size_t position_columns = 3;
/// Mean of y, and rms of the rest.
inline std::pair<double, double> position_scale(const FitData& data) {
  std::vector<double> y = data.y;
  double mean = 0.0;
  for (const double value : y) mean += value / static_cast<double>(y.size());
  for (double& value : y) value -= mean;
  return {mean, rms(y)};
}
inline void add_position(FitData& data, std::size_t from = 1) {
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

/// Bounds of the fit. A slow sensor in a short log needs wide ones, in which an order that is too
/// low can pass for a higher one: so only when the order is chosen.
inline FitBounds fit_bounds(const FitData& data, bool wide) {
  const double T = data.sample_time;
  const double duration = T * static_cast<double>(data.y.size());
  return {6.0 / duration, 1.5 / T, 0.05 * T, std::min(200.0 * T, duration / (wide ? 12.0 : 30.0)),
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
    bool near = false;
    for (const double latency : tried) near = near || latency == start.at.latency;
    if (near) continue;
    if (static_cast<int>(tried.size()) == starts) break;
    tried.push_back(start.at.latency);
    const Fit found = fit.minimise(start.at, true, 8);
    if (found.mean_square < best.mean_square) best = found;
  }
  return best.converged ? best : fit.minimise(best.at, true);
}

/// rows log(mean square) + parameters log(rows).
inline double criterion(const Fit& fit, int parameters) {
  const double rows = static_cast<double>(fit.rows);
  return rows * std::log(fit.mean_square) + parameters * std::log(rows);
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
  Fit best = result.fit;
  double best_scale = 0.0;
  // Friction changes the other parameters, and they change its scale: repeated twice.
  for (int pass = 0; pass < 2; ++pass) {
    double least = std::numeric_limits<double>::infinity();
    const auto attempt = [&](double scale) {
      const FitData rubbed = with_friction(data, speed, scale);
      InnovationsFit fit(rubbed, result.model, bounds);
      const double square = fit.at(best.at).mean_square;
      if (square < least) least = square, best_scale = scale;
    };
    for (const double share : friction_scales) attempt(share * size);
    for (double factor = std::sqrt(2.0); factor > 1.05; factor = std::sqrt(factor)) {
      const double middle = best_scale;
      attempt(middle * factor);
      attempt(middle / factor);
    }
    const FitData rubbed = with_friction(data, speed, best_scale);
    InnovationsFit fit(rubbed, result.model, bounds);
    best = fit.minimise(best.at, true, 8);
  }
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

/// The data for the fit of an order, with its friction.
inline FitData with_friction(const FitData& data, const OrderFit& order) {
  if (!(order.friction_scale > 0.0)) return data;
  return with_friction(
      data, friction_speed(data, order.model.order, order.fit.noise, order.fit.at.latency),
      order.friction_scale);
}

/// Compares how well each order explains the log at bandwidths below that of the likelihood.
inline void compare_orders(const FitData& data, std::vector<OrderFit>& orders) {
  if (orders.size() < 2) return;
  double least = std::numeric_limits<double>::infinity();
  for (const OrderFit& order : orders) least = std::min(least, order.fit.at.bandwidth);
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

/// The best fit of each requested order. @param before those before sines were added, or none
inline std::vector<OrderFit> fit_orders(const FitData& data, const IdentifyOptions& options,
                                        const FitBounds& bounds,
                                        const std::vector<OrderFit>& before = {}) {
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
  const auto near = [](double a, double b) { return 0.75 * b < a && a < b / 0.75; };
  return near(higher.fit.linear[0] / pole / lower.fit.linear[0], 1.0) &&
         near(1.0 / pole + higher.fit.at.latency, lower.fit.at.latency);
}

/// The order with the best likelihood, unless another one leaves less than 1 / e of the mean square
/// at lower bandwidths: at its own bandwidth the likelihood depends on the fastest motion, which in
/// a flexible machine is the bending. One that is only a part of the likely one says nothing new.
inline auto best_order(const std::vector<OrderFit>& orders) {
  const auto likely = std::min_element(
      orders.begin(), orders.end(),
      [](const OrderFit& a, const OrderFit& b) { return a.criterion < b.criterion; });
  const auto slower =
      std::min_element(orders.begin(), orders.end(),
                       [](const OrderFit& a, const OrderFit& b) { return a.slower < b.slower; });
  return slower->slower < likely->slower - 1.0 && !is_part_of(*slower, *likely) ? slower : likely;
}

/// The other order that leaves least at the bandwidth of `here`, a fit of the order `chosen`. Lag
/// and pole stand for each other in orders next to each other, so it starts from there, too. Orders
/// from `lowest` on; one that was not studied, because the order was given, has no friction.
inline Rival rival_of(const FitData& data, const std::vector<OrderFit>& orders, int chosen,
                      int extension, const Fit& here, int lowest = 1) {
  const auto of = [&](int order) {
    return std::find_if(orders.begin(), orders.end(),
                        [order](const OrderFit& fit) { return fit.model.order == order; });
  };
  Rival rival;
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
      exchanged.pole = 1.0 / std::max(here.at.lag(), other.bounds.latency_min);
      exchanged.latency = std::max(here.at.dead_time(), other.bounds.latency_min);
    } else if (here.at.pole > 0.0) {
      exchanged.pole = 0.0;
      exchanged.latency += 1.0 / here.at.pole;
    }
    for (const FitPoint& start : {own, exchanged}) {
      const double left = fit.minimise(start, false, 8).mean_square / here.mean_square;
      if (rival.order == 0 || left < rival.left) rival = {other.model.order, left};
    }
  }
  return rival;
}

/// A log without u where friction holds the machine.
struct HeldLog {
  FitData rows{};      ///< u is zero at standstill
  double scale = 0.0;  ///< v_s of the friction in motion
  double share = 0.0;  ///< of the rows, at standstill
  Fit fit{};           ///< at the bandwidth of the plateau
};

/// Largest share of the rows at standstill: of more, too little motion is left, or a coarse encoder
/// hides it.
constexpr double held_max = 0.8;

/// Friction that holds takes all of u at standstill, which no column of friction can follow: b0 of
/// all rows is up to twice too small. So the fit at the plateau, `here`, is repeated without u
/// there. It must leave less than 0.95 of the mean square: where nothing holds, u moves the machine
/// also when its speed passes zero, and the fit gets worse.
inline std::optional<HeldLog> held_log(const FitData& rows, const FitModel& model,
                                       const FitBounds& bounds, const Fit& here,
                                       const std::vector<double>& speed) {
  const double size = rms(speed);
  std::optional<HeldLog> best;
  double least = 0.95 * here.mean_square;
  for (const double still : {0.02, 0.1}) {
    FitData cut = rows;
    std::size_t count = 0;
    for (std::size_t k = 0; k < speed.size(); ++k) {
      if (std::abs(speed[k]) < still * size) cut.u[k] = 0.0, ++count;
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

/// Whether a force that depends on position acts: it improves the likelihood by more than its
/// parameters cost, or it leaves less than 1 / e of the mean square at a tenth of the bandwidth.
/// (At the full bandwidth everything slow is attributed to the disturbance.)
/// Friction that holds looks like such a force, as it takes most of u: not if it leaves less there.
inline bool position_acts(const FitData& data, const OrderFit& order, bool friction) {
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

/// Computes b0 at the plateau for ranges of a scheduling column, and as a straight line over the
/// column.
/// @param used the data with friction and sines
inline void find_schedule(const FitData& used, const std::vector<double>& along,
                          const FitModel& model, const IdentifyOptions& options,
                          Identified& result) {
  const double t = student_95(19);
  std::vector<double> sorted = along;
  std::sort(sorted.begin(), sorted.end());
  std::vector<double> edges;  // upper ends except the last; ranges with a single value are merged
  for (int bin = 1; bin < options.schedule_bins; ++bin) {
    const double edge = sorted[sorted.size() * static_cast<std::size_t>(bin) /
                               static_cast<std::size_t>(options.schedule_bins)];
    if (edge > sorted.front() && (edges.empty() || edge > edges.back())) edges.push_back(edge);
  }
  FitData parts = used;
  parts.inputs.assign(edges.size(), std::vector<double>(along.size(), 0.0));
  result.schedule.assign(edges.size() + 1, {});
  for (GainInRange& range : result.schedule) {
    range.from = std::numeric_limits<double>::infinity();
    range.to = -range.from;
  }
  double mean = 0.0;
  for (std::size_t k = 0; k < along.size(); ++k) {
    const auto bin = static_cast<std::size_t>(
        std::upper_bound(edges.begin(), edges.end(), along[k]) - edges.begin());
    GainInRange& range = result.schedule[bin];
    range.from = std::min(range.from, along[k]);
    range.to = std::max(range.to, along[k]);
    ++range.rows;
    mean += along[k] / static_cast<double>(along.size());
    if (bin > 0) {
      parts.inputs[bin - 1][k] = used.u[k];
      parts.u[k] = 0.0;
    }
  }
  const FitBounds& bounds =
      std::find_if(result.orders.begin(), result.orders.end(), [&](const auto& order) {
        return order.model.order == result.order;
      })->bounds;
  const Plateau& plateau = result.plateau;
  // At the plateau and its neighbours, like b0 itself.
  const auto solved = [&](const FitData& data, std::vector<double>& value,
                          std::vector<double>& error) {
    InnovationsFit fit(data, model, bounds);
    std::vector<double> low, high;
    for (const std::size_t i : {plateau.middle - 1, plateau.middle + 1, plateau.middle}) {
      const Fit found = fit.at(plateau.points[i].fit.at);
      if (low.empty()) low = high = found.linear;
      for (std::size_t c = 0; c < low.size(); ++c) {
        low[c] = std::min(low[c], found.linear[c]);
        high[c] = std::max(high[c], found.linear[c]);
      }
      if (i == plateau.middle) {
        value = found.linear;
        error = jackknife(fit, found, false).linear;
      }
    }
    for (std::size_t c = 0; c < error.size(); ++c) error[c] += 0.25 * (high[c] - low[c]) / t;
  };
  std::vector<double> value, error;
  solved(parts, value, error);
  double weights = 0.0, middle = 0.0, square = 0.0, most = 0.0;
  for (std::size_t bin = 0; bin < result.schedule.size(); ++bin) {
    result.schedule[bin].input_gain = {value[bin], t * error[bin]};
    const double weight = 1.0 / (error[bin] * error[bin]);
    weights += weight;
    middle += weight * value[bin];
  }
  middle /= weights;
  // One of several ranges may differ by chance: all together must differ by more than chance, and
  // one by more than its interval.
  for (std::size_t bin = 0; bin < result.schedule.size(); ++bin) {
    const double off = std::abs(value[bin] - middle) / error[bin];
    square += off * off;
    most = std::max(most, off / t);
  }
  const double freedom = static_cast<double>(result.schedule.size()) - 1.0;
  const double cube = 1.0 - 2.0 / (9.0 * freedom) + 1.645 * std::sqrt(2.0 / (9.0 * freedom));
  result.schedule_shift =
      freedom > 0.0 ? std::min(most, std::sqrt(square / (freedom * cube * cube * cube))) : 0.0;
  FitData line = used;
  line.inputs.assign(1, std::vector<double>(along.size()));
  for (std::size_t k = 0; k < along.size(); ++k) line.inputs[0][k] = used.u[k] * (along[k] - mean);
  solved(line, value, error);
  result.schedule_slope = {value[1], t * error[1]};
}

/// Smallest share of u that does not follow from y.
constexpr double own_input_min = 1e-5;

/// Largest relative standard error of b0 at which u can be said to move y.
constexpr double excitation_max = 0.15;

/// Whether the innovations are as white as those of an exact model: of few rows the largest of
/// twenty correlations is larger.
inline double correlation_limit(const Identified& found, const IdentifyOptions& options) {
  const double rows = static_cast<double>(found.log.used) / found.averaged;
  return std::max(options.correlation_max, 3.0 / std::sqrt(rows));
}
inline bool white(const Identified& found, const IdentifyOptions& options) {
  return found.correlation <= correlation_limit(found, options);
}

/// Half a row, s: what takes less is not seen.
inline double half_row(const Identified& found) {
  return 0.5 * found.averaged * found.log.sample_time;
}

/// Whether output error tells b0. Where y follows u within half a row, no machine was seen between
/// them (y may have been logged before u, or b0 is lost in the noise): then it confirms nothing but
/// what nearly all of y says of a position, which u has to move for many rows.
inline bool informed(const Identified& found) {
  const SecondOpinion& second = found.second_opinion;
  if (!second.informative()) return false;
  return found.latency.value >= half_row(found) ||
         (found.order >= 2 && second.explained >= 0.95 && !(found.lead.time > 0.0) &&
          std::abs(second.input_gain.value / found.input_gain.value - 1.0) <= 0.1);
}

/// Half width that b0 of a plateau within two octaves of the lowest bandwidth needs. There every
/// fit is one of output error, so that neighbours agree tells nothing: b0 has to reach to the
/// interval of that of up to four octaves above, where the log is far more likely: by more than
/// e^10.
inline double reach_above(const Plateau& plateau, double bandwidth_min) {
  const Fit& here = plateau.points[plateau.middle].fit;
  double reach = 0.0;
  if (here.at.bandwidth > 4.0 * bandwidth_min) return reach;
  const std::size_t high = std::min(plateau.middle + 8, plateau.points.size() - 1);
  for (std::size_t i = plateau.middle + 1; i <= high; ++i) {
    const PlateauPoint& point = plateau.points[i];
    const double gained = 0.5 * static_cast<double>(point.fit.rows) *
                          std::log(here.mean_square / point.fit.mean_square);
    if (point.at_bound || !(gained > 10.0)) continue;
    const double apart = std::abs(point.fit.linear[0] - here.linear[0]);
    reach = std::max(reach, apart - student_95(19) * point.errors.linear[0]);
  }
  return reach;
}

/// b0 with the interval that the other evidence asks for. Coloured innovations mean that the model
/// is not exact, so b0 is not known better than to a per cent. Where output error may be right
/// instead, the interval spans both. Friction that holds the machine takes b0 down, and that of the
/// motion is nearer to the truth: the interval reaches to the end of its own.
inline Estimate widened(const Identified& found, const IdentifyOptions& options) {
  Estimate gain = found.input_gain;
  const auto reach = [&](double to) {
    gain.half_width = std::max(gain.half_width, std::abs(to - gain.value));
  };
  const bool coloured = !white(found, options);
  if (coloured) gain.half_width += 0.01 * std::abs(gain.value);
  // When exactly the machine stands is not known, and that moves b0 by some per cent.
  if (found.held > 0.0) gain.half_width += 0.1 * std::abs(gain.value);
  if (informed(found) && (coloured || gain.share() > options.interval_max))
    reach(found.second_opinion.input_gain.value);
  const Estimate& moving = found.in_motion.moving;
  if (found.in_motion.differ()) reach(moving.value > gain.value ? moving.high() : moving.low());
  return gain;
}

/// The study of rows that were averaged by `fold`.
/// @param rows without the scheduling column @param along the scheduling column, or empty
/// @param result what is known of the log before; returned with the rest
/// @param raw_noise noise from the fast part of the innovations of the plain rows
/// @param wide whether the bounds are those of a chosen order
inline Identified study_rows(FitData rows, const std::vector<double>& along,
                             const IdentifyOptions& options, Identified result, Estimate& raw_noise,
                             bool wide, const std::function<void(double)>& progress) {
  const std::size_t known = rows.columns.size();
  const FitBounds bounds = fit_bounds(rows, wide);
  auto orders = fit_orders(rows, options, bounds);
  progress(0.3);
  auto winner = best_order(orders);
  make_timed(rows, options.late_columns ? known : 0);
  // Times change what is best, and that the times.
  const auto find_late = [&](const OrderFit& with, bool search) {
    FitData used = with_friction(rows, with);
    find_times(used, with.model, bounds, with.fit.at, search);
    take_times(rows, used.timed);
  };
  const auto may_be_late = [&] {
    return std::any_of(rows.timed.begin(), rows.timed.end(),
                       [](const TimedColumn& column) { return column.free; });
  };
  if (may_be_late()) find_late(*winner, true);
  if (may_be_late()) {
    orders = fit_orders(rows, options, bounds, orders);
    winner = best_order(orders);
  }
  bool& position = result.position;
  IdentifyOptions tried = options;
  std::vector<OrderFit> of_speed;  // fits for order 1, which has no position
  if (options.position && winner->model.order > 1) {
    // Without the force a higher order can be best, so the simplest order decides about it.
    const OrderFit* simplest = nullptr;
    for (const OrderFit& order : orders) {
      const int n = order.model.order;
      if (n > 1 && (simplest == nullptr || n < simplest->model.order)) simplest = &order;
    }
    position = position_acts(rows, *simplest, options.friction);
    if (position) {
      std::copy_if(orders.begin(), orders.end(), std::back_inserter(of_speed),
                   [](const OrderFit& order) { return order.model.order == 1; });
      add_position(rows);
      std::erase(tried.orders, 1);
      orders = fit_orders(rows, tried, bounds);
      winner = best_order(orders);
    }
  }
  const auto sines = find_sines(with_friction(rows, *winner), winner->model, bounds, winner->fit.at,
                                options.sinusoids);
  for (const double frequency : sines) {
    add_sine(rows, winner->model.order, frequency);
  }
  if (!sines.empty()) {
    orders = fit_orders(rows, tried, bounds, orders);
    winner = best_order(orders);
  }
  if (may_be_late()) find_late(*winner, false);
  OrderFit chosen = *winner;
  if (result.averaged == 1 && chosen.correlation < 0.3) raw_noise = chosen.noise;
  result.orders = std::move(of_speed);
  result.orders.insert(result.orders.end(), orders.begin(), orders.end());
  result.order = chosen.model.order;
  result.correlation = chosen.correlation;
  FitData used = rows;
  std::vector<double> speed;
  if (chosen.friction_scale > 0.0) {
    speed = friction_speed(rows, chosen.model.order, chosen.fit.noise, chosen.fit.at.latency);
    used = with_friction(rows, speed, chosen.friction_scale);
  }
  // The other m has the same number of parameters, so the likelihood decides, if it improves by
  // more than one parameter costs.
  const auto extended = [&](int extension) {
    InnovationsFit other(used, {chosen.model.order, extension, chosen.model.pole}, bounds);
    Fit found = other.minimise(chosen.fit.at, true);
    FitPoint slower = chosen.fit.at;
    slower.bandwidth *= 0.3;
    const Fit second = other.minimise(slower, true);
    return second.mean_square < found.mean_square ? second : found;
  };
  FitModel model = chosen.model;
  Fit likely = chosen.fit;
  if (options.extension != 1) {
    const Fit other = extended(2);
    const double count = static_cast<double>(other.rows);
    if (options.extension == 2 ||
        count * std::log(chosen.fit.mean_square / other.mean_square) > std::log(count)) {
      model.extension = 2;
      likely = other;
    }
  }
  result.extension = model.extension;
  InnovationsFit fit(used, model, bounds);
  likely = fit.at(likely.at);
  if (model.extension == 2) {
    result.correlation = innovations_correlation(fit.residual());
  }
  result.disturbance = likely.disturbance;
  if (known > 0) {
    FitData unmeasured = used;
    for (std::size_t c = 0; c < known; ++c) {
      // A column of zeros has no number.
      if (share_left(unmeasured.columns[c], used.y) > follows)
        std::fill(unmeasured.columns[c].begin(), unmeasured.columns[c].end(), 0.0);
    }
    result.disturbance_unmeasured =
        InnovationsFit(unmeasured, model, bounds).minimise(likely.at, true, 8).disturbance;
  }
  const FitErrors likely_errors = jackknife(fit, likely, true);
  const double rows_averaged = std::sqrt(static_cast<double>(result.averaged));
  const double t = student_95(19);
  result.noise = {likely.noise * rows_averaged, t * likely_errors.noise * rows_averaged};
  // If the innovations of the rows are nearly white, their fast part gives the noise.
  if (raw_noise.value > 0.0) {
    result.noise = {raw_noise.value,
                    std::max(raw_noise.half_width, result.noise.share() * raw_noise.value)};
  }
  // The rounding of an encoder is not visible at rest.
  const double rounding = result.log.quantisation / std::sqrt(12.0);
  if (result.noise.low() < rounding) {
    result.noise.half_width = std::max(result.noise.high() - rounding, result.noise.half_width);
    result.noise.value = rounding;
  }
  progress(0.5);
  result.plateau = find_plateau(fit, likely);
  if (result.plateau.middle > 0) {
    // A column of y would show order 1 the y that it has to predict.
    const int lowest = position || known > 0 ? 2 : 1;
    result.rival = rival_of(rows, orders, model.order, model.extension,
                            result.plateau.points[result.plateau.middle].fit, lowest);
  }
  // When exactly the machine stands is known to some rows only: so times are those of all rows.
  const Plateau of_all = result.plateau;
  if (model.order == 2 && options.friction && of_all.middle > 0) {
    const PlateauPoint& plain = of_all.points[of_all.middle];
    if (speed.empty()) speed = friction_speed(rows, 2, chosen.fit.noise, chosen.fit.at.latency);
    if (auto held = held_log(rows, model, bounds, plain.fit, speed)) {
      result.lead = lead_of(used, model, bounds, plain.fit);
      result.held = held->share;
      rows = std::move(held->rows);
      chosen.friction_scale = held->scale;
      used = with_friction(rows, speed, held->scale);
      InnovationsFit in_motion(used, model, bounds);
      result.plateau = find_plateau(in_motion, held->fit);
    }
  }
  progress(0.8);
  if (result.plateau.middle == 0) {
    result.input_gain = {likely.linear[0], std::numeric_limits<double>::infinity()};
    return result;
  }
  const Plateau& plateau = result.plateau;
  const PlateauPoint& here = plateau.points[plateau.middle];
  // Friction with a smaller or larger scale, by more than the steps of the search.
  double friction_spread = 0.0;
  if (chosen.friction_scale > 0.0) {
    double low = here.fit.linear[0], high = low;
    for (const double factor : {std::sqrt(0.5), std::sqrt(2.0)}) {
      const FitData other = with_friction(rows, speed, factor * chosen.friction_scale);
      InnovationsFit varied(other, model, bounds);
      const Fit found = varied.minimise(here.fit.at, false, 5);
      low = std::min(low, found.linear[0]);
      high = std::max(high, found.linear[0]);
    }
    friction_spread = high - low;
  }
  // A force that depends on position if none was found, or else with higher powers.
  double position_spread = 0.0;
  if (model.order > 1) {
    FitData other = used;
    add_position(other, result.position ? position_columns + 1 : 1);
    InnovationsFit varied(other, model, bounds);
    const Fit found = varied.minimise(here.fit.at, false, 5);
    position_spread = std::abs(found.linear[0] - here.fit.linear[0]);
  }
  // The interval combines the jackknife with the dependence on the bandwidth: between neighbours,
  // and over one and a half octaves to each side as far as the number is accurate there. `down` is
  // the number of points below, `resolved` the share to which a point counts at most.
  const auto estimate_of = [&](const Plateau& of, auto value, auto error, double more,
                               std::size_t down = 3, double resolved = 0.0) {
    const PlateauPoint& middle = of.points[of.middle];
    const PlateauPoint& below = of.points[of.middle - 1];
    const PlateauPoint& above = of.points[of.middle + 1];
    const double x = value(middle);
    const std::size_t first = of.middle - std::min(of.middle, down);
    const std::size_t last = std::min(of.middle + 3, of.points.size() - 1);
    const double spread =
        std::max({value(below), x, value(above)}) - std::min({value(below), x, value(above)});
    double squares = 0.0, weights = 0.0;
    for (std::size_t i = first; i <= last; ++i) {
      const PlateauPoint& point = of.points[i];
      // A point that is more accurate than this one, or has no error, does not count more.
      const double size = std::max({error(point), error(middle), resolved * std::abs(x)});
      const double weight = size > 0.0 && !point.at_bound ? 1.0 / (size * size) : 0.0;
      squares += weight * (value(point) - x) * (value(point) - x);
      weights += weight;
    }
    const double drift = weights > 0.0 ? std::sqrt(squares / weights) : 0.0;
    return Estimate{x, t * error(middle) + 0.25 * spread + drift + more};
  };
  const auto estimate = [&](auto value, auto error) {
    return estimate_of(plateau, value, error, 0.0);
  };
  const auto gain = [&](std::size_t down, double resolved) {
    return estimate_of(
        plateau, [](const PlateauPoint& p) { return p.fit.linear[0]; },
        [](const PlateauPoint& p) { return p.errors.linear[0]; }, 0.25 * friction_spread, down,
        resolved);
  };
  // A flexible mode changes b0 over octaves, by more than the errors at each bandwidth: so b0 is
  // compared over three octaves below, where the machine is closer to the model, and to 2 %.
  result.input_gain = gain(6, 0.02);
  result.input_gain.half_width =
      std::max(result.input_gain.half_width, reach_above(plateau, bounds.bandwidth_min));
  // What else could change b0 is compared with the interval of this plateau: a wider one would hide
  // it.
  const double near = gain(3, 0.0).half_width;
  // Less than a per cent does no harm, however sharp the interval is.
  result.position_shift =
      position_spread / std::max(near, 0.01 * std::abs(result.input_gain.value));
  // A standard error is half of a half width.
  result.friction_shift = 2.0 * friction_spread / near;
  // The fit cannot distinguish times below a twentieth of a row.
  const auto time_of = [&](const Plateau& of, auto value, auto error) {
    Estimate found = estimate_of(of, value, error, 0.0);
    found.half_width = std::max(found.half_width, 0.05 * rows.sample_time);
    return found;
  };
  const auto time = [&](auto value, auto error) { return time_of(of_all, value, error); };
  result.latency = time([](const PlateauPoint& p) { return p.fit.at.latency; },
                        [](const PlateauPoint& p) { return p.errors.latency; });
  result.lag = time([](const PlateauPoint& p) { return p.fit.at.lag(); },
                    [](const PlateauPoint& p) { return p.errors.lag; });
  result.dead_time = time([](const PlateauPoint& p) { return p.fit.at.dead_time(); },
                          [](const PlateauPoint& p) { return p.errors.dead_time; });
  result.pole = estimate([](const PlateauPoint& p) { return p.fit.at.pole; },
                         [](const PlateauPoint& p) { return p.errors.pole; });
  // The linear numbers: b0, the log's columns, sines, friction.
  const auto linear = [&](std::size_t c) {
    return estimate([c](const PlateauPoint& p) { return p.fit.linear[c]; },
                    [c](const PlateauPoint& p) { return p.errors.linear[c]; });
  };
  // The times where the plateau is, and the gains with them.
  FitData there = used;
  Fit fitted_there = here.fit;
  if (may_be_late()) {
    find_times(there, model, bounds, here.fit.at, false);
    fitted_there = InnovationsFit(there, model, bounds).minimise(here.fit.at, false, 8);
  }
  for (std::size_t c = 0; c < known; ++c) {
    MeasuredEffect effect;
    effect.gain = linear(c + 1);
    effect.gain.value = fitted_there.linear[c + 1];
    effect.follows_output = share_left(rows.columns[c], rows.y) < follows;
    if (!rows.timed.empty() && rows.timed[c].free) {
      const TimedColumn& column = there.timed[c];
      const auto late = [&](double at, auto value, auto error) {
        Estimate found = time_of(
            plateau, [&](const PlateauPoint& p) { return value(p.errors.times[c]); },
            [&](const PlateauPoint& p) { return error(p.errors.times[c].covariance); });
        return Estimate{at, found.half_width};
      };
      const auto latency_error = [](const SplitCovariance& of) { return std::sqrt(of.latency); };
      const auto split = [&](const SplitCovariance& of) {
        const double share = column.latency > 0.0 ? column.lag() / column.latency : 0.0;
        return split_errors({0.0, column.latency, share, 0.0}, of, t,
                            column.latency + t * latency_error(of));
      };
      using Times = FitErrors::Times;
      effect.latency = late(
          column.latency, [](const Times& x) { return x.latency; }, latency_error);
      effect.lag = late(
          column.lag(), [](const Times& x) { return x.lag; },
          [&](const SplitCovariance& of) { return split(of).first; });
      effect.dead_time = late(
          column.dead_time(), [](const Times& x) { return x.latency - x.lag; },
          [&](const SplitCovariance& of) { return split(of).second; });
      effect.timed = effect.told() && effect.latency.half_width < bounds.latency_max;
      if (!effect.timed) effect.latency = effect.lag = effect.dead_time = {};
    }
    effect.lost = result.log.lost[c];
    result.columns.push_back(effect);
  }
  if (chosen.friction_scale > 0.0) {
    result.friction = linear(here.fit.linear.size() - 1);
    result.friction_scale = chosen.friction_scale;
  }
  if (result.position) {
    PositionForce& force = result.position_force;
    std::tie(force.middle, force.size) = position_scale(rows);
    const auto [low, high] = std::minmax_element(rows.y.begin(), rows.y.end());
    force.low = *low;
    force.high = *high;
    for (std::size_t i = 0; i < position_columns; ++i) force.factors[i] = linear(known + 1 + i);
  }
  for (std::size_t i = 0; i < sines.size(); ++i) {
    FitData rest = used;
    const auto pair =
        rest.columns.begin() +
        static_cast<std::ptrdiff_t>(known + (result.position ? position_columns : 0) + 2 * i);
    rest.columns.erase(pair, pair + 2);
    if (rest.friction >= 0) rest.friction -= 2;
    Sinusoid sine = fit_sine(rest, model, bounds, here.fit.at, sines[i]).sine;
    sine.frequency.half_width *= t;
    sine.amplitude.half_width *= t;
    if (sine.amplitude.low() > 0.0) result.sinusoids.push_back(sine);
  }
  std::sort(
      result.sinusoids.begin(), result.sinusoids.end(),
      [](const Sinusoid& a, const Sinusoid& b) { return a.amplitude.value > b.amplitude.value; });
  if (!along.empty()) {
    find_schedule(used, along, model, options, result);
  }
  double excitation = std::numeric_limits<double>::infinity();
  for (const PlateauPoint& point : plateau.points) {
    excitation = std::min(excitation, point.errors.linear[0] / std::abs(point.fit.linear[0]));
  }
  result.excitation = excitation;
  // The fit of output error is blind where the plant integrates or a force depends on y: nearer to
  // the plateau it sees again.
  const double middle = here.fit.at.bandwidth;
  for (const double w : {0.1 * bounds.bandwidth_min, 0.1 * middle, 0.3 * middle}) {
    if (!(excitation < excitation_max)) break;
    result.second_opinion = second_opinion(used, model, bounds, here.fit.at, w);
    if (result.second_opinion.informative()) break;
  }
  result.at_bound = here.at_bound || of_all.points[of_all.middle].at_bound;
  if (excitation < excitation_max) {
    result.by_size = gain_by_size(used, model, bounds, here.fit.at);
    if (result.held > 0.0) {
      // Where it holds, small u does little: that is known already.
      GainBySize& sizes = result.by_size;
      if (std::abs(sizes.small.value) < std::abs(sizes.large.value)) sizes = {};
    } else if (model.order == 2) {
      if (speed.empty()) speed = friction_speed(rows, 2, chosen.fit.noise, chosen.fit.at.latency);
      result.in_motion = gain_in_motion(used, model, bounds, here.fit, speed);
    }
  }
  if (!(result.held > 0.0)) result.lead = lead_of(used, model, bounds, here.fit);
  result.input_gain = widened(result, options);
  // The margins of a design have to hold for it, too.
  if (const double unseen = half_row(result) - result.latency.value;
      unseen > 0.0 && !white(result, options) && informed(result)) {
    result.latency.half_width = std::max(result.latency.half_width, unseen);
  }
  return result;
}

/// Whether averaged rows are better. Averaging loses fast effects, in the end the motion itself: so
/// it must help much, b0 must agree with that of the plain rows, and a row must be short.
inline bool better(const Identified& averaged, const Identified& plain, const Identified& best,
                   const IdentifyOptions& options) {
  const double apart = std::abs(averaged.input_gain.value - plain.input_gain.value);
  const double span = averaged.averaged * averaged.log.sample_time;
  return (white(averaged, options) || averaged.correlation < 0.5 * best.correlation) &&
         apart <= averaged.input_gain.half_width + plain.input_gain.half_width &&
         span * std::abs(averaged.pole.value) < 0.2;
}

}  // namespace detail

/// The model and everything known about its quality. Whether it can be trusted is decided by
/// `judge`. It fails only if something cannot be computed.
[[nodiscard]] inline Expected<Identified, Error<double>> study(
    const Log& log, const IdentifyOptions& options = {}) {
  using E = Error<double>;
  const bool scheduling = !log.schedule.empty();
  if (scheduling && log.schedule.size() != log.y.size()) {
    return E{"schedule",
             static_cast<double>(log.schedule.size()),
             "must have as many rows as y, or none:",
             -1,
             static_cast<double>(log.y.size()),
             true};
  }
  Rules<double> rules;
  const auto number = [](auto value) { return static_cast<double>(value); };
  rules
      .require(0 <= options.extension && options.extension <= 2, "extension",
               number(options.extension), "must be 0 (chosen), 1 or 2")
      .require(2 <= options.schedule_bins && options.schedule_bins <= 20, "schedule_bins",
               number(options.schedule_bins), "must be 2 to 20")
      .require(0 <= options.averaged, "averaged", number(options.averaged),
               "must be 0 (chosen), 1 or more")
      .require(0 <= options.sinusoids, "sinusoids", number(options.sinusoids),
               "must not be negative")
      // Twenty stretches of at least 50 rows; of fewer rows they would overlap.
      .require(1000 <= options.rows_max, "rows_max", number(options.rows_max),
               "must be at least 1000");
  if (!rules) return rules.error();
  // The scheduling column is processed like the columns, as the last of them.
  const auto with_schedule = [&] {
    Log all = log;
    all.columns.push_back(log.schedule);
    return prepare(all);
  };
  auto prepared = scheduling ? with_schedule() : prepare(log);
  if (!prepared) return prepared.error();
  if (options.progress) options.progress(0.1);
  if (options.orders.empty()) return E{"orders", 0.0, "must not be empty"};
  for (const int order : options.orders) {
    if (order < 1 || order > 3) return E{"orders", static_cast<double>(order), "must be 1, 2 or 3"};
  }
  Identified result;
  result.log = prepared->report;
  const FitData raw = excerpt(prepared->data, options.rows_max);
  result.log.used = raw.y.size();
  const auto [least, largest] = std::minmax_element(raw.u.begin(), raw.u.end());
  if (!(*largest > *least))
    return E{"u", *least, "never changes: record a log in which the input moves"};
  const auto [lowest, highest] = std::minmax_element(raw.y.begin(), raw.y.end());
  if (!(*highest > *lowest))
    return E{"y", *lowest, "never changes: record a log in which the output moves"};
  for (std::size_t c = 0; c < log.columns.size(); ++c) {
    if (auto told = detail::tells_itself(raw, c); !told) return told.error();
  }
  result.own_input = detail::own_input(raw);
  result.at_once = detail::at_once(raw);
  std::vector<int> folds = {1, 4, 8, 16};
  if (options.averaged > 0) folds = {options.averaged};
  // Once an order is chosen and at a bound, it alone is tried within wider ones.
  IdentifyOptions how = options;
  bool wide = false;
  std::optional<Identified> first, best;
  Estimate raw_noise;
  double done = 0.1;
  for (const int fold : folds) {
    FitData rows = averaged(raw, fold);
    if (rows.y.size() < 200) break;
    std::vector<double> along;
    if (scheduling) {
      along = std::move(rows.columns.back());
      rows.columns.pop_back();
    }
    const double share = 0.6 * (1.0 - done);
    result.averaged = fold;
    const auto studied = [&] {
      return detail::study_rows(rows, along, how, result, raw_noise, wide, [&](double part) {
        if (options.progress)
          options.progress(done + share * (wide ? 0.5 + 0.5 * part : 0.5 * part));
      });
    };
    Identified found = studied();
    if (found.at_bound && !wide) {
      wide = true;
      how.orders = {found.order};
      const auto orders = found.orders;
      found = studied();
      for (const OrderFit& order : orders) {
        if (order.model.order != found.order) found.orders.push_back(order);
      }
      std::sort(found.orders.begin(), found.orders.end(),
                [](const auto& a, const auto& b) { return a.model.order < b.model.order; });
    }
    done += share;
    if (!first) first = found;
    if (!best || detail::better(found, *first, *best, options)) best = std::move(found);
    const bool decided = detail::white(*best, options) || detail::informed(*best);
    if (decided || !(result.own_input > detail::own_input_min)) break;
  }
  if (!best)
    return E{"averaged", static_cast<double>(options.averaged), "leaves fewer than 200 rows"};
  if (options.progress) options.progress(1.0);
  return *best;
}

/// Decides whether a study can be trusted; if not, returns the first reason and what to record
/// instead.
[[nodiscard]] inline Check<double> judge(const Identified& found, const Log& log,
                                         const IdentifyOptions& options = {}) {
  Rules<double> rules;
  const double T = found.log.sample_time;
  const double jitter = log.time.empty() ? found.log.jitter / T : 0.0;
  rules.require(
      jitter <= 0.05, "jitter", jitter,
      "is the jitter over T without time stamps, above 0.05: record the time of each row");
  rules.require(options.applied || found.log.saturated < 0.5, "saturated", found.log.saturated,
                "is the share of rows with u at its limits: record the u that the actuator held");
  rules.require(found.own_input > detail::own_input_min, "own_input", found.own_input,
                "is the share of u that does not follow from y, which is too small: record a "
                "moving reference");
  rules.require(!found.at_once, "at_once", found.latency.value,
                "is the latency found, but y follows u at once: is y an acceleration or a force? "
                "Record its speed or position, or more rows per second");
  const bool excited = found.plateau.middle > 0 && found.excitation < detail::excitation_max;
  rules.require(excited, "excitation", found.plateau.middle > 0 ? found.excitation : 1.0,
                "is the smallest relative error of b0 and too large: what of y follows from u is "
                "not told from the rest; record several steps that last until y settles, or a "
                "sweep");
  rules.require(
      !(found.rival.left < 1.0 / std::numbers::e), "order", static_cast<double>(found.order),
      "is the order, but where b0 was found another one leaves less than 1 / e of the mean square: "
      "give that one, or a y of this one (a position under a motor has order 2, a speed 1)");
  if (!rules) return rules;
  const SecondOpinion& second = found.second_opinion;
  const bool informed = detail::informed(found);
  const double widest = informed ? options.interval_agreed : options.interval_max;
  // A lead does no harm if b0 is nearly the same without it. Feedback from y makes small ones up.
  const double off = std::abs(found.lead.input_gain - found.input_gain.value);
  const double harmless =
      std::max(found.input_gain.half_width, 0.1 * std::abs(found.input_gain.value));
  rules.require(!(found.lead.time > 0.0) || (off <= harmless && found.input_gain.share() <= widest),
                "lead", found.lead.time,
                "is the time by which y moves before u: is u logged late?");
  rules.require(detail::white(found, options) || informed,
                {"correlation", found.correlation,
                 "is the correlation of the innovations, so the model lacks something, and output "
                 "error does not tell b0 either: record longer, with steps of u that last until y "
                 "settles, or add known effects as columns; must be at most",
                 -1, detail::correlation_limit(found, options), true});
  rules.require(!informed || second.agrees(found.input_gain.value),
                {"second_opinion", found.input_gain.value / second.input_gain.value,
                 "is b0 over that of output error: they must agree by 0.6 to 1.7"});
  rules.require(!found.at_bound, "latency", found.latency.value,
                "(or the pole) is at the end of its range: record faster changes of u");
  rules.require(found.plateau.spread <= options.plateau_max,
                {"plateau", found.plateau.spread,
                 "is the relative change of b0 between neighbouring bandwidths, so there is no "
                 "plateau: record more motion in the band of the controller; must be at most",
                 -1, options.plateau_max, true});
  rules.require(options.scheduled || found.schedule_shift <= 1.0, "schedule", found.schedule_shift,
                "is the change of b0 along the scheduling column over its interval: ask for b0 "
                "over the column (scheduled = true), or record at one setting");
  rules.require(found.position_shift <= options.position_shift_max,
                {"position_shift", found.position_shift,
                 "is the change of b0 in half widths if a force depends on y, so gravity or a "
                 "spring is missing: add it as a column (sin y, y), or record motion with more "
                 "frequencies; must be at most",
                 -1, options.position_shift_max, true});
  rules.require(found.friction_shift <= options.friction_shift_max,
                {"friction_shift", found.friction_shift,
                 "is the change of b0 between two scales of friction in standard errors: record "
                 "faster motion; must be at most",
                 -1, options.friction_shift_max, true});
  rules.require(
      found.input_gain.share() <= widest,
      {"interval", found.input_gain.share(),
       "is the half width of b0 over b0: record longer or with larger steps; must be at most", -1,
       widest, true});
  return rules;
}

/// `study` and `judge`: a model with error bars, or the reason why this log cannot give one.
[[nodiscard]] inline Expected<Identified, Error<double>> identify(
    const Log& log, const IdentifyOptions& options = {}) {
  auto found = study(log, options);
  if (!found) return found.error();
  if (auto verdict = judge(*found, log, options); !verdict) return verdict.error();
  return found;
}

}  // namespace esokit
