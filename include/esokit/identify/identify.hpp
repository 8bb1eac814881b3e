/// @file
/// From a log to a model with error bars, or to a refusal that says what to record instead.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/intervals.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/model_eso.hpp>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

namespace esokit {

/// What is asked of an identification.
struct IdentifyOptions {
  std::vector<int> orders{1, 2, 3};  ///< n that are tried
  bool friction = true;              ///< a column tanh(v / v_s) for orders 1 and 2
  bool pole = true;                  ///< whether a known pole is looked for
  int averaged = 0;                  ///< rows to average; 0: chosen from the innovations
  std::size_t rows_max = 60000;      ///< of a longer log so many rows are used, evenly spread

  /// Whether u is what the actuator held. A command beyond the limits is not.
  bool applied = true;
  double interval_max = 0.1;     ///< widest half interval of b0, share of b0
  double plateau_max = 0.1;      ///< most that b0 may differ between three neighbouring bandwidths
  double correlation_max = 0.1;  ///< of the innovations, lags 1 to 20; at 1 it is not asked for
  double friction_shift_max =
      3;  ///< most that b0 may differ between friction scales, standard errors
  std::function<void(double)> progress{};  ///< hears the share that is done, 0 to 1
};

/// The best fit of one order.
struct OrderFit {
  FitModel model{};             ///< n, m and whether it has a pole
  Fit fit{};                    ///< where the innovations are least
  double friction_scale = 0.0;  ///< v_s, 0 without friction
  double criterion = 0.0;       ///< rows log(mean square) + parameters log(rows): the least wins
  double correlation = 0.0;     ///< largest of the innovations' over lags 1 to 20
  Estimate noise{};             ///< as fast innovations have it, y's unit; 0: not known
};

/// A disturbance that swings at one frequency.
struct Sinusoid {
  Estimate frequency{};  ///< rad/s
  Estimate amplitude{};  ///< unit of y^(n), where the disturbance acts
};

/// A model with error bars, and what it rests on.
struct Identified {
  int order = 0;                    ///< n
  int extension = 1;                ///< m
  Estimate input_gain{};            ///< b0, unit of y^(n) over that of u
  Estimate latency{};               ///< lag and dead time together, s
  Estimate lag{};                   ///< tau, s
  Estimate dead_time{};             ///< L, s
  Estimate pole{};                  ///< a, 1/s
  Estimate friction{};              ///< Coulomb friction, unit of y^(n); 0 where none was asked for
  Estimate noise{};                 ///< standard deviation of the measurement noise, y's unit
  double disturbance = 0;           ///< intensity of d^(m): variance of its increments over time
  std::vector<Estimate> columns{};  ///< numbers of the log's own columns
  std::vector<Sinusoid> sinusoids{};  ///< in the disturbance, the largest first
  double friction_shift =
      0;  ///< by how much b0 differs between friction scales, standard errors of b0
  double correlation = 0;          ///< of the innovations, largest over lags 1 to 20
  int averaged = 1;                ///< rows of the log that were averaged
  bool at_bound = false;           ///< a parameter came to the end of its range at the plateau
  double excitation = 0;           ///< standard error of b0 over b0 where it is least
  double own_input = 1;            ///< share of u that y and the row before do not explain
  LogReport log{};                 ///< what the log shows by itself
  Plateau plateau{};               ///< b0 over the bandwidth
  std::vector<OrderFit> orders{};  ///< each order's best fit, by order

  /// The plant that was found, as simulation, analysis and observers take it: d enters at y^(n).
  /// @tparam Order n, which must be the one that was found
  template <int Order>
  [[nodiscard]] Expected<LinearPlant<Order + 1>, Error<double>> plant() const {
    if (order != Order) {
      return Error<double>{"order", static_cast<double>(order), "is not the one that is asked for:",
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

  /// What was found, as the settings of a model of these parts: the lag as its actuator, the pole
  /// as its plant_poles, the largest sinusoids as its resonators. A part that is not asked for is
  /// left to the disturbance.
  /// @tparam Parts of the order that was found, without a sensor, which a log does not tell from an
  /// actuator
  template <ModelParts Parts>
  [[nodiscard]] Expected<typename AugmentedModel<Parts>::Settings, Error<double>> model() const {
    static_assert(Parts.actuator <= 1, "esokit: identify finds a lag of first order");
    static_assert(Parts.sensor == 0 && Parts.leaky == 0 && !Parts.follows_speed,
                  "esokit: identify finds no sensor, nothing that fades and no speed");
    Rules<double> rules;
    rules.require(order == Parts.order,
                  {"order", static_cast<double>(order), "is not the one that is asked for:", -1,
                   static_cast<double>(Parts.order), true});
    const auto swings = static_cast<std::size_t>(Parts.resonators);
    rules.require(sinusoids.size() >= swings,
                  {"sinusoids", static_cast<double>(sinusoids.size()),
                   "were found, fewer than the resonators that are asked for:", -1,
                   static_cast<double>(Parts.resonators), true});
    if (!rules) return rules.error();
    typename AugmentedModel<Parts>::Settings settings;
    if constexpr (Parts.plant_poles) settings.plant[Parts.order - 1] = pole.value;
    if constexpr (Parts.actuator == 1) settings.actuator.time_constant = lag.value;
    if constexpr (Parts.resonators > 0) {
      for (std::size_t i = 0; i < swings; ++i) {
        settings.resonators[i].frequency = sinusoids[i].frequency.value;
      }
    }
    return settings;
  }

  /// The config of a ModelEso with what was found.
  /// @param observer_bandwidth rad/s @param sample_time s, of the loop it is for
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

  /// The dead time in samples, as DelayedInput takes it. @param sample_time s
  [[nodiscard]] int delay(double sample_time) const {
    return static_cast<int>(std::lround(dead_time.value / sample_time));
  }
};

namespace detail {

/// Largest correlation of the innovations with themselves, 1 to 20 rows later.
inline double innovations_correlation(const std::vector<double>& e) {
  double square = 0.0;
  for (const double value : e) square += value * value;
  double largest = 0.0;
  for (std::size_t lag = 1; lag <= 20 && lag < e.size(); ++lag) {
    double sum = 0.0;
    for (std::size_t k = lag; k < e.size(); ++k) sum += e[k] * e[k - lag];
    largest = std::max(largest, std::abs(sum / square));
  }
  return largest;
}

/// Share of u that a law of y_k, y_(k-1), u_(k-1) does not explain: 0 where u is a controller's and
/// its reference never moves.
inline double own_input(const FitData& data) {
  const std::size_t rows = data.u.size();
  std::vector<std::vector<double>> columns(4, std::vector<double>(rows, 0.0));
  std::vector<double> right(rows, 0.0);
  double mean_u = 0.0, mean_y = 0.0;
  for (std::size_t k = 0; k < rows; ++k) {
    mean_u += data.u[k] / static_cast<double>(rows);
    mean_y += data.y[k] / static_cast<double>(rows);
  }
  for (std::size_t k = 1; k < rows; ++k) {
    right[k] = data.u[k] - mean_u;
    columns[0][k] = 1.0;
    columns[1][k] = data.y[k] - mean_y;
    columns[2][k] = data.y[k - 1] - data.y[k];
    columns[3][k] = data.u[k - 1] - mean_u;
  }
  std::vector<double> normal, law;
  InnovationsFit::normal_equations(columns, right, normal, law);
  solve_normal(normal, law, 4);
  double left = 0.0, all = 0.0;
  for (std::size_t k = 1; k < rows; ++k) {
    double rest = right[k];
    for (std::size_t c = 0; c < 4; ++c) rest -= law[c] * columns[c][k];
    left += rest * rest;
    all += right[k] * right[k];
  }
  return std::sqrt(left / all);
}

/// Slope (derivative 1) or value (0) of a parabola through 2 half + 1 rows, at each row.
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

/// Scales of friction that are tried, as shares of the rms of the speed.
constexpr double friction_scales[] = {0.01, 0.02, 0.04, 0.08, 0.16, 0.32};

/// Speed that friction goes by: y' of order 2, y of order 1; smoothed until the noise in it is a
/// fiftieth, over no more than the latency.
inline std::vector<double> friction_speed(const FitData& data, int order, double noise,
                                          double latency) {
  const double T = data.sample_time;
  const int longest = std::clamp(static_cast<int>(latency / T), 2, 200);
  if (order == 1) {
    // Until the noise is a tenth of what the least scale turns around in.
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

/// The data with a column of friction that rises over `scale`.
inline FitData with_friction(const FitData& data, const std::vector<double>& speed, double scale) {
  FitData out = data;
  std::vector<double> column(speed.size());
  for (std::size_t k = 0; k < speed.size(); ++k) column[k] = -std::tanh(speed[k] / scale);
  out.columns.push_back(std::move(column));
  return out;
}

inline FitBounds fit_bounds(const FitData& data) {
  const double T = data.sample_time;
  const double duration = T * static_cast<double>(data.y.size());
  return {6.0 / duration, 1.5 / T, 0.05 * T, std::min(200.0 * T, duration / 30.0), 0.5};
}

/// The best of several starts, w free.
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
    const Fit found = fit.minimise(start.at, true);
    if (found.mean_square < best.mean_square) best = found;
  }
  return best;
}

inline double criterion(const Fit& fit, int parameters) {
  const double rows = static_cast<double>(fit.rows);
  return rows * std::log(fit.mean_square) + parameters * std::log(rows);
}

/// The best fit of one order, with friction where it helps.
inline OrderFit fit_order(const FitData& data, const IdentifyOptions& options, int order) {
  const FitBounds bounds = fit_bounds(data);
  OrderFit result;
  result.model = {order, 1, options.pole};
  const int columns = static_cast<int>(data.columns.size());
  InnovationsFit plain(data, result.model, bounds);
  result.fit = best_fit(plain);
  (void)plain.at(result.fit.at);  // its innovations, not those of the last start
  result.criterion = criterion(result.fit, 5 + columns);
  result.correlation = innovations_correlation(plain.residual());
  result.noise = plain.noise_floor(result.fit);
  if (!options.friction || order > 2) return result;
  const auto speed = friction_speed(data, order, result.fit.noise, result.fit.at.latency);
  const double size = rms(speed);
  if (!(size > 0.0)) return result;
  Fit best = result.fit;
  double best_scale = 0.0;
  // Friction moves the other parameters, and they the scale: twice.
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
  // Other starts: friction that was not there can have led the first fit astray.
  Fit found = best_fit(fit, 2);
  if (best.mean_square < found.mean_square) found = fit.minimise(best.at, true);
  const double with = criterion(found, 6 + columns);
  if (with < result.criterion) {
    result.fit = found;
    result.criterion = with;
    result.friction_scale = best_scale;
    // The residual is that of the last fit.
    (void)fit.at(found.at);
    result.correlation = innovations_correlation(fit.residual());
    result.noise = fit.noise_floor(result.fit);
  }
  return result;
}

}  // namespace detail

/// By how much intervals are wider than the jackknife makes them: it knows nothing of the choice of
/// the plateau, which picks where b0 seems best known. Found on 360 logs of random plants, and kept
/// on others (examples/identify).
inline constexpr double interval_widening = 1.6;

/// The model and all that is known of how good it is, whether it can be trusted or not: `judge`
/// says that. Refused is what cannot be computed.
[[nodiscard]] inline Expected<Identified, Error<double>> study(
    const Log& log, const IdentifyOptions& options = {}) {
  auto prepared = prepare(log);
  if (!prepared) return prepared.error();
  using E = Error<double>;
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
  result.own_input = detail::own_input(raw);
  std::vector<int> folds = {1, 4, 8, 16};
  if (options.averaged > 0) folds = {options.averaged};
  FitData data;
  std::vector<OrderFit> best_orders;
  const OrderFit* best = nullptr;
  double best_correlation = std::numeric_limits<double>::infinity();
  Estimate raw_noise;
  for (const int fold : folds) {
    FitData rows = averaged(raw, fold);
    if (rows.y.size() < 200) break;
    std::vector<OrderFit> orders;
    for (const int order : options.orders)
      orders.push_back(detail::fit_order(rows, options, order));
    const auto winner = std::min_element(
        orders.begin(), orders.end(),
        [](const OrderFit& a, const OrderFit& b) { return a.criterion < b.criterion; });
    const std::size_t index = static_cast<std::size_t>(winner - orders.begin());
    if (fold == 1 && winner->correlation < 0.3) raw_noise = winner->noise;
    // Averaging costs what is fast: only if it helps a lot.
    if (winner->correlation < options.correlation_max ||
        winner->correlation < 0.5 * best_correlation) {
      best_correlation = winner->correlation;
      best_orders = std::move(orders);
      best = &best_orders[index];
      data = std::move(rows);
      result.averaged = fold;
    }
    if (best_correlation < options.correlation_max) break;
    if (options.progress) options.progress(0.1 * fold / 16 + 0.3);
  }
  if (best == nullptr)
    return E{"averaged", static_cast<double>(options.averaged), "leaves fewer than 200 rows"};
  result.orders = best_orders;
  const OrderFit chosen = *best;
  result.order = chosen.model.order;
  result.extension = chosen.model.extension;
  result.correlation = chosen.correlation;
  result.disturbance = chosen.fit.disturbance;
  const FitBounds bounds = detail::fit_bounds(data);
  FitData used = data;
  std::vector<double> speed;
  if (chosen.friction_scale > 0.0) {
    speed =
        detail::friction_speed(data, chosen.model.order, chosen.fit.noise, chosen.fit.at.latency);
    used = detail::with_friction(data, speed, chosen.friction_scale);
  }
  InnovationsFit fit(used, chosen.model, bounds);
  Fit likely = fit.at(chosen.fit.at);
  const FitErrors likely_errors = jackknife(fit, likely, true);
  const double rows_averaged = std::sqrt(static_cast<double>(result.averaged));
  const double t = student_95(19);
  result.noise = {likely.noise * rows_averaged, t * likely_errors.noise * rows_averaged};
  // Rows that are nearly white tell the noise where nothing else is as fast.
  if (raw_noise.value > 0.0) {
    result.noise = {raw_noise.value,
                    std::max(raw_noise.half_width, result.noise.share() * raw_noise.value)};
  }
  // An encoder rounds, and at rest does not show it.
  const double rounding = result.log.quantisation / std::sqrt(12.0);
  if (result.noise.low() < rounding) {
    result.noise.half_width = std::max(result.noise.high() - rounding, result.noise.half_width);
    result.noise.value = rounding;
  }
  result.plateau = find_plateau(fit, likely);
  if (options.progress) options.progress(0.9);
  if (result.plateau.middle == 0) {
    result.input_gain = {likely.linear[0], std::numeric_limits<double>::infinity()};
    return result;
  }
  const Plateau& plateau = result.plateau;
  const PlateauPoint& here = plateau.points[plateau.middle];
  const PlateauPoint& below = plateau.points[plateau.middle - 1];
  const PlateauPoint& above = plateau.points[plateau.middle + 1];
  // Friction that rises faster or slower.
  double friction_spread = 0.0;
  if (chosen.friction_scale > 0.0) {
    double low = here.fit.linear[0], high = low;
    for (const double factor : {0.5, 2.0}) {
      const FitData other = detail::with_friction(data, speed, factor * chosen.friction_scale);
      InnovationsFit varied(other, chosen.model, bounds);
      const Fit found = varied.minimise(here.fit.at, false, 5);
      low = std::min(low, found.linear[0]);
      high = std::max(high, found.linear[0]);
    }
    friction_spread = high - low;
  }
  const auto estimate = [&](auto value, auto error, double more) {
    const double x = value(here);
    const double spread =
        std::max({value(below), x, value(above)}) - std::min({value(below), x, value(above)});
    return Estimate{x, interval_widening * (t * error(here) + 0.25 * spread + more)};
  };
  result.input_gain =
      estimate([](const PlateauPoint& p) { return p.fit.linear[0]; },
               [](const PlateauPoint& p) { return p.errors.linear[0]; }, 0.25 * friction_spread);
  // A standard error is half of a half width.
  result.friction_shift = 2.0 * friction_spread / result.input_gain.half_width;
  result.latency = estimate([](const PlateauPoint& p) { return p.fit.at.latency; },
                            [](const PlateauPoint& p) { return p.errors.latency; }, 0.0);
  result.lag = estimate([](const PlateauPoint& p) { return p.fit.at.lag(); },
                        [](const PlateauPoint& p) { return p.errors.lag; }, 0.0);
  result.dead_time = estimate([](const PlateauPoint& p) { return p.fit.at.dead_time(); },
                              [](const PlateauPoint& p) { return p.errors.dead_time; }, 0.0);
  result.pole = estimate([](const PlateauPoint& p) { return p.fit.at.pole; },
                         [](const PlateauPoint& p) { return p.errors.pole; }, 0.0);
  for (std::size_t c = 1; c < here.fit.linear.size(); ++c) {
    const Estimate number =
        estimate([c](const PlateauPoint& p) { return p.fit.linear[c]; },
                 [c](const PlateauPoint& p) { return p.errors.linear[c]; }, 0.0);
    if (chosen.friction_scale > 0.0 && c + 1 == here.fit.linear.size()) {
      result.friction = number;
    } else {
      result.columns.push_back(number);
    }
  }
  result.at_bound = here.at_bound;
  double excitation = std::numeric_limits<double>::infinity();
  for (const PlateauPoint& point : plateau.points) {
    excitation = std::min(excitation, point.errors.linear[0] / std::abs(point.fit.linear[0]));
  }
  result.excitation = excitation;
  if (options.progress) options.progress(1.0);
  return result;
}

/// Whether a study can be trusted: the first reason why not, and what to record instead.
[[nodiscard]] inline Check<double> judge(const Identified& found, const Log& log,
                                         const IdentifyOptions& options = {}) {
  Rules<double> rules;
  const double T = found.log.sample_time;
  const double jitter = log.time.empty() ? found.log.jitter / T : 0.0;
  rules.require(jitter <= 0.05, "jitter", jitter,
                "of T without stamps is above 0.05: record the time of each row");
  rules.require(options.applied || found.log.saturated < 0.5, "saturated", found.log.saturated,
                "of the rows have u at its limits: record what the actuator held");
  rules.require(found.own_input > 1e-5, "own_input", found.own_input,
                "of u is not a law of y alone: nothing from outside excites the loop; record a "
                "reference that moves");
  const bool excited = found.plateau.middle > 0 && found.excitation < 0.15;
  rules.require(
      excited, "excitation", found.plateau.middle > 0 ? found.excitation : 1.0,
      "is the least error of b0, and too large: u hardly shows in y; record steps or a sweep");
  if (!rules) return rules;
  rules.require(found.correlation <= options.correlation_max,
                {"correlation", found.correlation,
                 "of the innovations: the machine is more than the model; record without the load "
                 "that swings, or add what is known as a column; above",
                 -1, options.correlation_max, true});
  rules.require(!found.at_bound, "latency", found.latency.value,
                "or pole is at the end of its range: record faster changes of u");
  rules.require(found.plateau.spread <= options.plateau_max,
                {"plateau", found.plateau.spread,
                 "is how much b0 differs between neighbouring bandwidths, there is no plateau: "
                 "record more motion in the band that the controller will use; above",
                 -1, options.plateau_max, true});
  rules.require(found.friction_shift <= options.friction_shift_max,
                {"friction_shift", found.friction_shift,
                 "standard errors between one friction and another: record faster motion; above",
                 -1, options.friction_shift_max, true});
  rules.require(found.input_gain.share() <= options.interval_max,
                {"interval", found.input_gain.share(),
                 "is the half width of b0 over b0: record longer, or with larger steps; above", -1,
                 options.interval_max, true});
  return rules;
}

/// A model with error bars, or why this log cannot give one.
[[nodiscard]] inline Expected<Identified, Error<double>> identify(
    const Log& log, const IdentifyOptions& options = {}) {
  auto found = study(log, options);
  if (!found) return found.error();
  if (auto verdict = judge(*found, log, options); !verdict) return verdict.error();
  return found;
}

}  // namespace esokit
