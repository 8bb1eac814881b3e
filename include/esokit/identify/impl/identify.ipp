#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/detail/b0_evidence.hpp>
#include <esokit/identify/detail/intervals.hpp>
#include <esokit/identify/detail/order_selection.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/identify.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <functional>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

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
                    (std::max)(raw_noise.half_width, result.noise.share() * raw_noise.value)};
  }
  // The rounding of an encoder is not visible at rest.
  const double rounding = result.log.quantisation / std::sqrt(12.0);
  if (result.noise.low() < rounding) {
    result.noise.half_width = (std::max)(result.noise.high() - rounding, result.noise.half_width);
    result.noise.value = rounding;
  }
  progress(0.5);
  result.plateau = find_plateau(fit, likely);
  if (result.plateau.middle > 0) {
    // A column of y would show order 1 the y that it has to predict.
    const int lowest = position || known > 0 ? 2 : 1;
    result.other_order = other_order_of(rows, orders, model.order, model.extension,
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
      low = (std::min)(low, found.linear[0]);
      high = (std::max)(high, found.linear[0]);
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
    position_spread = (std::abs)(found.linear[0] - here.fit.linear[0]);
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
    const std::size_t first = of.middle - (std::min)(of.middle, down);
    const std::size_t last = (std::min)(of.middle + 3, of.points.size() - 1);
    const double spread =
        (std::max)({value(below), x, value(above)}) - (std::min)({value(below), x, value(above)});
    double squares = 0.0, weights = 0.0;
    for (std::size_t i = first; i <= last; ++i) {
      const PlateauPoint& point = of.points[i];
      // A point that is more accurate than this one, or has no error, does not count more.
      const double size = (std::max)({error(point), error(middle), resolved * (std::abs)(x)});
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
      (std::max)(result.input_gain.half_width, reach_above(plateau, bounds.bandwidth_min));
  // What else could change b0 is compared with the interval of this plateau: a wider one would hide
  // it.
  const double half_width = gain(3, 0.0).half_width;
  // Less than a per cent does no harm, however sharp the interval is.
  result.position_shift =
      position_spread / (std::max)(half_width, 0.01 * (std::abs)(result.input_gain.value));
  // A standard error is half of a half width.
  result.friction_shift = 2.0 * friction_spread / half_width;
  // The fit cannot distinguish times below a twentieth of a row.
  const auto time_of = [&](const Plateau& of, auto value, auto error) {
    Estimate found = estimate_of(of, value, error, 0.0);
    found.half_width = (std::max)(found.half_width, 0.05 * rows.sample_time);
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
    excitation = (std::min)(excitation, point.errors.linear[0] / (std::abs)(point.fit.linear[0]));
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
      // Where it holds, small u does little: that is known already, and no curve can be found.
      GainBySize& sizes = result.by_size;
      if ((std::abs)(sizes.below.value) < (std::abs)(sizes.above.value)) sizes = {};
    } else if (model.order == 2) {
      if (speed.empty()) speed = friction_speed(rows, 2, chosen.fit.noise, chosen.fit.at.latency);
      result.in_motion = gain_in_motion(used, model, bounds, here.fit, speed);
    }
    if (!(result.held > 0.0))
      result.curve = seen_curve(used, model, bounds, here.fit, result.by_size);
  }
  if (!(result.held > 0.0)) result.lead = lead_of(used, model, bounds, here.fit);
  if (const SecondOpinion& second = result.second_opinion;
      result.lead.time > 0.0 && second.informative()) {
    const auto by = static_cast<std::size_t>(std::ceil(result.lead.time / rows.sample_time));
    const SecondOpinion earlier =
        second_opinion(advanced(used, by), model, bounds, here.fit.at, second.bandwidth);
    result.lead.left = (1.0 - earlier.explained) / (1.0 - second.explained);
  }
  result.input_gain = widened(result, options);
  if (result.order == 1) {
    const auto span = [](const std::vector<double>& values) {
      const auto [low, high] = std::minmax_element(values.begin(), values.end());
      return *high - *low;
    };
    const double window = (std::max)(result.latency.value, 8.0 * rows.sample_time);
    const double most = (std::abs)(result.input_gain.value) * span(used.u) +
                        (std::max)(result.pole.value, 0.0) * span(used.y) +
                        2.0 * result.friction.value +
                        6.0 * (result.noise.value + result.log.quantisation) / window;
    result.rise = span_of_rates(used, window) / most;
    // y' = -a y + b0 u with u = s y: a loop that is any good returns faster than y runs away.
    const double feedback = -result.input_gain.value * slope_of_law(used);
    if (result.pole.value < 0.0 && feedback > 0.0)
      result.returns = (result.pole.value + feedback) / feedback;
  }
  // The margins of a design have to hold for it, too: for an earlier u, and for what is not seen.
  if (leads(result))
    result.latency.half_width = (std::max)(result.latency.half_width, result.lead.time);
  if (const double unseen = half_row(result) - result.latency.value;
      unseen > 0.0 && !white(result, options) && informed(result)) {
    result.latency.half_width = (std::max)(result.latency.half_width, unseen);
  }
  return result;
}

/// Whether b0 was seen, and the latency is not at the end of its range.
inline bool within_reach(const Identified& found) {
  return !found.at_bound && found.plateau.middle > 0 && found.excitation < excitation_max;
}

ESOKIT_FUNCTION bool better(const Identified& averaged, const Identified& plain,
                            const Identified& best, const IdentifyOptions& options) {
  const double apart = (std::abs)(averaged.input_gain.value - plain.input_gain.value);
  const double span = averaged.averaged * averaged.log.sample_time;
  // A latency that is longer than its range in rows is of another b0; and rows that are too short
  // may see no motion.
  if (!within_reach(best)) {
    return within_reach(averaged) && span * (std::abs)(averaged.pole.value) < 0.2 &&
           3.0 * span <= averaged.latency.value;
  }
  return (white(averaged, options) || averaged.correlation < 0.5 * best.correlation) &&
         apart <= averaged.input_gain.half_width + plain.input_gain.half_width &&
         span * (std::abs)(averaged.pole.value) < 0.2;
}

/// The study of averaged rows that is best, and that of rows as they are.
struct Folded {
  Identified first{};
  Identified best{};
};

/// Studies rows, and averages of them for as long as these help: until the model explains the log,
/// and the latency is within its range, which in rows is limited.
inline std::optional<Folded> study_folds(const FitData& all, bool scheduling,
                                         const IdentifyOptions& options, Identified result,
                                         const std::function<void(double)>& progress) {
  const FitData raw = excerpt(all, options.rows_max);
  result.log.used = raw.y.size();
  result.own_input = own_input(raw);
  result.at_once = at_once(raw);
  std::vector<int> folds = {1, 4, 8, 16, 32, 64, 100};
  if (options.averaged > 0) folds = {options.averaged};
  // Once an order is chosen and at a bound, it alone is tried within wider ones.
  IdentifyOptions how = options;
  bool wide = false;
  std::optional<Folded> found;
  Estimate raw_noise;
  double done = 0.0;
  for (const int fold : folds) {
    // A lag of many rows needs stretches that are longer.
    FitData rows = excerpt(averaged(all, fold), options.rows_max);
    if (rows.y.size() < 200) break;
    std::vector<double> along;
    if (scheduling) {
      along = std::move(rows.columns.back());
      rows.columns.pop_back();
    }
    const double share = 0.6 * (1.0 - done);
    result.averaged = fold;
    result.log.used = rows.y.size() * static_cast<std::size_t>(fold);
    const auto studied = [&] {
      return study_rows(rows, along, how, result, raw_noise, wide, [&](double part) {
        progress(done + share * (wide ? 0.5 + 0.5 * part : 0.5 * part));
      });
    };
    Identified here = studied();
    if (here.at_bound && !wide) {
      wide = true;
      how.orders = {here.order};
      const auto orders = here.orders;
      here = studied();
      for (const OrderFit& order : orders) {
        if (order.model.order != here.order) here.orders.push_back(order);
      }
      std::sort(here.orders.begin(), here.orders.end(),
                [](const auto& a, const auto& b) { return a.model.order < b.model.order; });
    }
    done += share;
    const bool out_of_reach = !within_reach(here);
    if (!found) {
      found = Folded{here, std::move(here)};
    } else if (better(here, found->first, found->best, options)) {
      found->best = std::move(here);
    }
    const bool decided = white(found->best, options) || informed(found->best);
    if ((decided && within_reach(found->best)) || !(result.own_input > own_input_min)) break;
    // At the end of the range of its latency nothing is said of the order.
    if (out_of_reach) how = options, wide = false;
    if (fold >= 16 && within_reach(found->best)) break;
  }
  return found;
}

/// The fit of the order that was chosen.
inline const OrderFit& chosen_fit(const Identified& found) {
  return *std::find_if(found.orders.begin(), found.orders.end(),
                       [&](const OrderFit& order) { return order.model.order == found.order; });
}

/// Whether rows with an earlier u are far more likely at all: by the same model from several
/// starts.
inline bool worth_earlier(const Folded& found, const FitData& raw, const FitData& earlier) {
  const OrderFit& chosen = chosen_fit(found.first);
  const auto least = [&](const FitData& data) {
    InnovationsFit fit(data, chosen.model, chosen.bounds);
    Fit best = fit.minimise(chosen.fit.at, true, 8);
    for (const double latency : {0.5, 3.0, 12.0, 40.0}) {
      FitPoint start = chosen.fit.at;
      start.latency = latency * raw.sample_time;
      const Fit other = fit.minimise(start, true, 8);
      if (other.mean_square < best.mean_square) best = other;
    }
    return static_cast<double>(best.rows) * std::log(best.mean_square);
  };
  return least(earlier) < least(raw) - 40.0;
}

/// Whether u was logged late. That must make the log far more likely, and output error must find
/// the same b0, of the same sign as before. For where u follows from y of its own row, an earlier u
/// predicts the noise of y.
inline bool far_more_likely(const Folded& earlier, const Folded& as_logged) {
  const Identified& found = earlier.best;
  const SecondOpinion& second = found.second_opinion;
  const SecondOpinion& before = as_logged.best.second_opinion;
  if (!(chosen_fit(earlier.first).criterion < chosen_fit(as_logged.first).criterion - 40.0))
    return false;
  if (found.at_once || leads(found) || !second.informative() ||
      !second.agrees(found.input_gain.value))
    return false;
  if (before.informative() && before.input_gain.value * second.input_gain.value < 0.0) return false;
  return second.explained > before.explained - 0.02;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<Identified, Error<double>> study(const Log& log,
                                                          const IdentifyOptions& options) {
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
      .demand(0 <= options.extension && options.extension <= 2, "extension",
              number(options.extension), "must be 0 (chosen), 1 or 2")
      .demand(2 <= options.schedule_bins && options.schedule_bins <= 20, "schedule_bins",
              number(options.schedule_bins), "must be 2 to 20")
      .demand(0 <= options.averaged, "averaged", number(options.averaged),
              "must be 0 (chosen), 1 or more")
      .demand(0 <= options.sinusoids, "sinusoids", number(options.sinusoids),
              "must not be negative")
      // Twenty stretches of at least 50 rows; of fewer rows they would overlap.
      .demand(1000 <= options.rows_max, "rows_max", number(options.rows_max),
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
  const auto [least, largest] = std::minmax_element(raw.u.begin(), raw.u.end());
  if (!(*largest > *least))
    return E{"u", *least, "never changes: record a log in which the input moves"};
  const auto [lowest, highest] = std::minmax_element(raw.y.begin(), raw.y.end());
  if (!(*highest > *lowest))
    return E{"y", *lowest, "never changes: record a log in which the output moves"};
  for (std::size_t c = 0; c < log.columns.size(); ++c) {
    if (auto told = detail::tells_itself(raw, c); !told) return told.error();
  }
  const auto studied = [&](const FitData& rows, double from, double share) {
    return detail::study_folds(rows, scheduling, options, result, [&](double part) {
      if (options.progress) options.progress(from + share * part);
    });
  };
  auto found = studied(prepared->data, 0.1, 0.5);
  if (!found)
    return E{"averaged", static_cast<double>(options.averaged), "leaves fewer than 200 rows"};
  // Of a u that follows from y of its row alone, an earlier one tells that law and no machine.
  if (options.late_input && detail::own_input(raw) > detail::own_input_min) {
    for (int rows = 1; rows <= 2; ++rows) {
      const FitData earlier = detail::advanced(prepared->data, static_cast<std::size_t>(rows));
      if (!detail::worth_earlier(*found, raw, excerpt(earlier, options.rows_max))) break;
      result.late_rows = rows;
      auto again = studied(earlier, 0.6, 0.3);
      if (!again || !detail::far_more_likely(*again, *found)) break;
      found = std::move(again);
    }
  }
  if (options.progress) options.progress(1.0);
  return found->best;
}

ESOKIT_FUNCTION Check<double> judge(const Identified& found, const Log& log,
                                    const IdentifyOptions& options) {
  Rules<double> rules;
  const double T = found.log.sample_time;
  const double jitter = log.time.empty() ? found.log.jitter / T : 0.0;
  rules.demand(jitter <= 0.05, "jitter", jitter,
               "is the jitter over T without time stamps, above 0.05: record the time of each row");
  rules.demand(options.applied || found.log.saturated < 0.5, "saturated", found.log.saturated,
               "is the share of rows with u at its limits: record the u that the actuator held");
  rules.demand(found.own_input > detail::own_input_min, "own_input", found.own_input,
               "is the share of u that does not follow from y, which is too small: record a "
               "moving reference");
  rules.demand(!found.at_once, "at_once", found.latency.value,
               "is the latency found, but y follows u at once: is y an acceleration or a force? "
               "Record its speed or position, or more rows per second");
  const bool excited = found.plateau.middle > 0 && found.excitation < detail::excitation_max;
  rules.demand(excited, "excitation", found.plateau.middle > 0 ? found.excitation : 1.0,
               "is the smallest relative error of b0 and too large: what of y follows from u is "
               "not distinct from the rest; record several steps that last until y settles, or a "
               "sweep");
  // Behind it: of a log that moves next to nothing this is no finding.
  rules.demand(
      found.returns >= 0.1, "returns", found.returns,
      "is how fast y returns by what u follows of y, which is next to nothing: the law of u "
      "was found and no machine; record a moving reference");
  rules.demand(
      !(found.other_order.left < 1.0 / std::numbers::e), "order", static_cast<double>(found.order),
      "is the order, but where b0 was found another one leaves less than 1 / e of the mean square: "
      "give that one, or a y of this one (a position under a motor has order 2, a speed 1)");
  if (!rules) return rules;
  const SecondOpinion& second = found.second_opinion;
  const bool informed = detail::informed(found);
  const double widest = informed ? options.interval_agreed : options.interval_max;
  // A lead does no harm if b0 is nearly the same without it. Feedback from y makes small ones up.
  const double off = (std::abs)(found.lead.input_gain - found.input_gain.value);
  rules.demand(!detail::lead_harms(found) ||
                   (off <= found.input_gain.half_width && found.input_gain.share() <= widest),
               "lead", found.lead.time, "is the time by which y moves before u: is u logged late?");
  rules.demand(detail::white(found, options) || informed,
               {"correlation", found.correlation,
                "is the correlation of the innovations, so the model lacks something, and output "
                "error does not tell b0 either: record longer, with steps of u that last until y "
                "settles, or add known effects as columns; must be at most",
                -1, detail::correlation_limit(found, options), true});
  rules.demand(found.rise < 2.0, "rise", found.rise,
               "is how fast y rises and falls over what b0 times the range of u allows: something "
               "else moves y, or u was logged late; record u when it acts");
  rules.demand(!informed || second.agrees(found.input_gain.value),
               {"second_opinion", found.input_gain.value / second.input_gain.value,
                "is b0 over that of output error: they must agree by 0.6 to 1.7"});
  rules.demand(!found.at_bound, "latency", found.latency.value,
               "(or the pole) is at the end of its range: record faster changes of u");
  rules.demand(found.plateau.spread <= options.plateau_max,
               {"plateau", found.plateau.spread,
                "is the relative change of b0 between neighbouring bandwidths, so there is no "
                "plateau: record more motion in the band of the controller; must be at most",
                -1, options.plateau_max, true});
  rules.demand(options.scheduled || found.schedule_shift <= 1.0, "schedule", found.schedule_shift,
               "is the change of b0 along the scheduling column over its interval: ask for b0 "
               "over the column (scheduled = true), or record at one setting");
  rules.demand(found.position_shift <= options.position_shift_max,
               {"position_shift", found.position_shift,
                "is the change of b0 in half widths if a force depends on y, so gravity or a "
                "spring is missing: add it as a column (sin y, y), or record motion with more "
                "frequencies; must be at most",
                -1, options.position_shift_max, true});
  rules.demand(found.friction_shift <= options.friction_shift_max,
               {"friction_shift", found.friction_shift,
                "is the change of b0 between two scales of friction in standard errors: record "
                "faster motion; must be at most",
                -1, options.friction_shift_max, true});
  rules.demand(
      found.input_gain.share() <= widest,
      {"interval", found.input_gain.share(),
       "is the half width of b0 over b0: record longer or with larger steps; must be at most", -1,
       widest, true});
  return rules;
}

ESOKIT_FUNCTION Expected<Identified, Error<double>> identify(const Log& log,
                                                             const IdentifyOptions& options) {
  auto found = study(log, options);
  if (!found) return found.error();
  if (auto verdict = judge(*found, log, options); !verdict) return verdict.error();
  return found;
}

}  // namespace esokit
