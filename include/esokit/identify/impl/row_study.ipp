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
#include <esokit/identify/detail/row_study.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <iterator>
#include <limits>
#include <tuple>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION RowStudy::RowStudy(FitData rows, const std::vector<double>& along,
                                   const RowSettings& settings, Identified result)
    : rows_(std::move(rows)),
      along_(along),
      options_(settings.options),
      progress_(settings.progress),
      result_(std::move(result)),
      known_(rows_.columns.size()),
      bounds_(fit_bounds(rows_, settings.wide)),
      tried_(options_) {}

ESOKIT_FUNCTION Identified RowStudy::run(Estimate& raw_noise) {
  choose_order(raw_noise);
  choose_extension();
  find_noise(raw_noise);
  progress_(0.5);
  find_plateau_of_b0();
  progress_(0.8);
  if (result_.plateau.middle == 0) {
    result_.input_gain = {likely_.linear[0], std::numeric_limits<double>::infinity()};
    return std::move(result_);
  }
  find_gain_and_times();
  find_other_effects();
  compare_with_the_log();
  return std::move(result_);
}

ESOKIT_FUNCTION bool RowStudy::may_be_late() const {
  return std::any_of(rows_.timed.begin(), rows_.timed.end(),
                     [](const TimedColumn& column) { return column.free; });
}

ESOKIT_FUNCTION void RowStudy::find_late_columns(const OrderFit& with, bool search) {
  FitData used = with_friction(rows_, with);
  find_times(used, with.model, bounds_, with.fit.at, search);
  take_times(rows_, used.timed);
}

ESOKIT_FUNCTION void RowStudy::find_position_force(std::vector<OrderFit>& of_speed) {
  // Without the force a higher order can be best, so the simplest order decides about it.
  const OrderFit* simplest = nullptr;
  for (const OrderFit& order : orders_) {
    const int n = order.model.order;
    if (n > 1 && (simplest == nullptr || n < simplest->model.order)) simplest = &order;
  }
  result_.position = position_acts(rows_, *simplest, options_.friction);
  if (!result_.position) return;
  std::copy_if(orders_.begin(), orders_.end(), std::back_inserter(of_speed),
               [](const OrderFit& order) { return order.model.order == 1; });
  add_position(rows_);
  std::erase(tried_.orders, 1);
  orders_ = fit_orders(rows_, tried_, bounds_);
}

ESOKIT_FUNCTION void RowStudy::choose_order(Estimate& raw_noise) {
  orders_ = fit_orders(rows_, options_, bounds_);
  progress_(0.3);
  auto winner = best_order(orders_);
  make_timed(rows_, options_.late_columns ? known_ : 0);
  // Times change what is best, and that the times.
  if (may_be_late()) find_late_columns(*winner, true);
  if (may_be_late()) {
    orders_ = fit_orders(rows_, options_, bounds_, orders_);
    winner = best_order(orders_);
  }
  std::vector<OrderFit> of_speed;  // fits for order 1, which has no position
  if (options_.position && winner->model.order > 1) {
    find_position_force(of_speed);
    winner = best_order(orders_);
  }
  sines_ = find_sines(with_friction(rows_, *winner), winner->model, bounds_, winner->fit.at,
                      options_.sinusoids);
  for (const double frequency : sines_) {
    add_sine(rows_, winner->model.order, frequency);
  }
  if (!sines_.empty()) {
    orders_ = fit_orders(rows_, tried_, bounds_, orders_);
    winner = best_order(orders_);
  }
  if (may_be_late()) find_late_columns(*winner, false);
  chosen_ = *winner;
  if (result_.averaged == 1 && chosen_.correlation < 0.3) raw_noise = chosen_.noise;
  result_.orders = std::move(of_speed);
  result_.orders.insert(result_.orders.end(), orders_.begin(), orders_.end());
  result_.order = chosen_.model.order;
  result_.correlation = chosen_.correlation;
  used_ = rows_;
  if (chosen_.friction_scale > 0.0) {
    speed_ = friction_speed(rows_, chosen_.model.order, chosen_.fit.noise, chosen_.fit.at.latency);
    used_ = with_friction(rows_, speed_, chosen_.friction_scale);
  }
}

ESOKIT_FUNCTION void RowStudy::choose_extension() {
  // The other m has the same number of parameters, so the likelihood decides, if it improves by
  // more than one parameter costs.
  const auto extended = [&](int extension) {
    InnovationsFit other(used_, {chosen_.model.order, extension, chosen_.model.pole}, bounds_);
    Fit found = other.minimise(chosen_.fit.at, true);
    FitPoint slower = chosen_.fit.at;
    slower.bandwidth *= 0.3;
    const Fit second = other.minimise(slower, true);
    return second.mean_square < found.mean_square ? second : found;
  };
  model_ = chosen_.model;
  likely_ = chosen_.fit;
  if (options_.extension != 1) {
    const Fit other = extended(2);
    const double count = static_cast<double>(other.rows);
    if (options_.extension == 2 ||
        count * std::log(chosen_.fit.mean_square / other.mean_square) > std::log(count)) {
      model_.extension = 2;
      likely_ = other;
    }
  }
  result_.extension = model_.extension;
  fit_.emplace(used_, model_, bounds_);
  likely_ = fit_->at(likely_.at);
  if (model_.extension == 2) {
    result_.correlation = innovations_correlation(fit_->residual());
  }
  find_disturbance();
}

ESOKIT_FUNCTION void RowStudy::find_disturbance() {
  result_.disturbance = likely_.disturbance;
  if (known_ == 0) return;
  FitData unmeasured = used_;
  for (std::size_t c = 0; c < known_; ++c) {
    // A column of zeros has no number.
    if (share_left(unmeasured.columns[c], used_.y) > follows)
      std::fill(unmeasured.columns[c].begin(), unmeasured.columns[c].end(), 0.0);
  }
  result_.disturbance_unmeasured =
      InnovationsFit(unmeasured, model_, bounds_).minimise(likely_.at, true, 8).disturbance;
}

ESOKIT_FUNCTION void RowStudy::find_noise(const Estimate& raw_noise) {
  const FitErrors likely_errors = jackknife(*fit_, likely_, true);
  const double rows_averaged = std::sqrt(static_cast<double>(result_.averaged));
  const double t = student_95(19);
  result_.noise = {likely_.noise * rows_averaged, t * likely_errors.noise * rows_averaged};
  // If the innovations of the rows are nearly white, their fast part gives the noise.
  if (raw_noise.value > 0.0) {
    result_.noise = {raw_noise.value,
                     (std::max)(raw_noise.half_width, result_.noise.share() * raw_noise.value)};
  }
  // The rounding of an encoder is not visible at rest.
  const double rounding = result_.log.quantisation / std::sqrt(12.0);
  if (result_.noise.low() < rounding) {
    result_.noise.half_width =
        (std::max)(result_.noise.high() - rounding, result_.noise.half_width);
    result_.noise.value = rounding;
  }
}

ESOKIT_FUNCTION void RowStudy::find_plateau_of_b0() {
  result_.plateau = find_plateau(*fit_, likely_);
  if (result_.plateau.middle > 0) {
    // A column of y would show order 1 the y that it has to predict.
    const int lowest = result_.position || known_ > 0 ? 2 : 1;
    result_.other_order =
        other_order_of(rows_, orders_, model_.order, model_.extension,
                       result_.plateau.points[result_.plateau.middle].fit, lowest);
  }
  of_all_ = result_.plateau;
  find_plateau_with_friction();
  find_plateau_in_motion();
}

/// Largest share of the mean square that friction of order 1 leaves at the plateau.
constexpr double friction_left = 0.9;

ESOKIT_FUNCTION void RowStudy::find_plateau_with_friction() {
  if (model_.order != 1 || !options_.friction || of_all_.middle == 0) return;
  if (chosen_.friction_scale > 0.0 || !stops(rows_.y)) return;
  const Fit& plain = of_all_.points[of_all_.middle].fit;
  const RubbedFit found = rubbed_fit(rows_, speed(), model_, bounds_, plain, false);
  if (!(found.fit.mean_square < friction_left * plain.mean_square)) return;
  FitData rubbed = with_friction(rows_, speed(), found.scale);
  InnovationsFit fit(rubbed, model_, bounds_);
  Plateau plateau = find_plateau(fit, found.fit);
  if (plateau.middle == 0) return;
  const PlateauPoint& point = plateau.points[plateau.middle];
  if (!(point.fit.linear.back() > student_95(19) * point.errors.linear.back())) return;
  chosen_.friction_scale = found.scale;
  used_ = std::move(rubbed);
  result_.plateau = of_all_ = std::move(plateau);
}

ESOKIT_FUNCTION void RowStudy::find_plateau_in_motion() {
  // When exactly the machine stands is known to some rows only: so times are those of all rows.
  if (model_.order != 2 || !options_.friction || of_all_.middle == 0) return;
  const PlateauPoint& plain = of_all_.points[of_all_.middle];
  auto held = held_log(rows_, model_, bounds_, plain.fit, speed());
  if (!held) return;
  result_.lead = lead_of(used_, model_, bounds_, plain.fit);
  result_.held = held->share;
  rows_ = std::move(held->rows);
  chosen_.friction_scale = held->scale;
  used_ = with_friction(rows_, speed_, held->scale);
  InnovationsFit in_motion(used_, model_, bounds_);
  result_.plateau = find_plateau(in_motion, held->fit);
}

ESOKIT_FUNCTION const PlateauPoint& RowStudy::here() const {
  return result_.plateau.points[result_.plateau.middle];
}

ESOKIT_FUNCTION const std::vector<double>& RowStudy::speed() {
  if (speed_.empty())
    speed_ = friction_speed(rows_, model_.order, chosen_.fit.noise, chosen_.fit.at.latency);
  return speed_;
}

/// Combines the jackknife with the dependence on the bandwidth: between neighbours, and over one
/// and a half octaves to each side as far as the number is accurate there.
/// @param down number of points below @param resolved share to which a point counts at most
template <class Value, class Deviation>
Estimate estimate_on(const Plateau& of, const Value& value, const Deviation& error,
                     double more = 0.0, std::size_t down = 3, double resolved = 0.0) {
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
  return Estimate{x, student_95(19) * error(middle) + 0.25 * spread + drift + more};
}

/// An estimate of a time: the fit cannot distinguish times below a twentieth of a row.
template <class Value, class Deviation>
Estimate time_on(const Plateau& of, const Value& value, const Deviation& error,
                 double sample_time) {
  Estimate found = estimate_on(of, value, error);
  found.half_width = (std::max)(found.half_width, 0.05 * sample_time);
  return found;
}

ESOKIT_FUNCTION double RowStudy::friction_spread() const {
  if (!(chosen_.friction_scale > 0.0)) return 0.0;
  // A smaller or larger scale, by more than the steps of the search.
  double low = here().fit.linear[0], high = low;
  for (const double factor : {std::sqrt(0.5), std::sqrt(2.0)}) {
    const FitData other = with_friction(rows_, speed_, factor * chosen_.friction_scale);
    InnovationsFit varied(other, model_, bounds_);
    const Fit found = varied.minimise(here().fit.at, false, 5);
    low = (std::min)(low, found.linear[0]);
    high = (std::max)(high, found.linear[0]);
  }
  return high - low;
}

ESOKIT_FUNCTION double RowStudy::position_spread() const {
  if (model_.order == 1) return 0.0;
  // A force that depends on position if none was found, or else with higher powers.
  FitData other = used_;
  add_position(other, result_.position ? position_columns + 1 : 1);
  InnovationsFit varied(other, model_, bounds_);
  const Fit found = varied.minimise(here().fit.at, false, 5);
  return (std::abs)(found.linear[0] - here().fit.linear[0]);
}

ESOKIT_FUNCTION Estimate RowStudy::gain_over(std::size_t down, double resolved) const {
  return estimate_on(
      result_.plateau, [](const PlateauPoint& p) { return p.fit.linear[0]; },
      [](const PlateauPoint& p) { return p.errors.linear[0]; }, 0.25 * friction_spread_, down,
      resolved);
}

ESOKIT_FUNCTION void RowStudy::find_gain_and_times() {
  friction_spread_ = friction_spread();
  // A flexible mode changes b0 over octaves, by more than the errors at each bandwidth: so b0 is
  // compared over three octaves below, where the machine is closer to the model, and to 2 %.
  result_.input_gain = gain_over(6, 0.02);
  result_.input_gain.half_width = (std::max)(result_.input_gain.half_width,
                                             reach_above(result_.plateau, bounds_.bandwidth_min));
  // What else could change b0 is compared with the interval of this plateau: a wider one would hide
  // it.
  const double half_width = gain_over(3, 0.0).half_width;
  // Less than a per cent does no harm, however sharp the interval is.
  result_.position_shift =
      position_spread() / (std::max)(half_width, 0.01 * (std::abs)(result_.input_gain.value));
  // A standard error is half of a half width.
  result_.friction_shift = 2.0 * friction_spread_ / half_width;
  const auto time = [&](auto value, auto error) {
    return time_on(of_all_, value, error, rows_.sample_time);
  };
  result_.latency = time([](const PlateauPoint& p) { return p.fit.at.latency; },
                         [](const PlateauPoint& p) { return p.errors.latency; });
  result_.lag = time([](const PlateauPoint& p) { return p.fit.at.lag(); },
                     [](const PlateauPoint& p) { return p.errors.lag; });
  result_.dead_time = time([](const PlateauPoint& p) { return p.fit.at.dead_time(); },
                           [](const PlateauPoint& p) { return p.errors.dead_time; });
  result_.pole = estimate_on(
      result_.plateau, [](const PlateauPoint& p) { return p.fit.at.pole; },
      [](const PlateauPoint& p) { return p.errors.pole; });
}

ESOKIT_FUNCTION Estimate RowStudy::linear(std::size_t column) const {
  return estimate_on(
      result_.plateau, [column](const PlateauPoint& p) { return p.fit.linear[column]; },
      [column](const PlateauPoint& p) { return p.errors.linear[column]; });
}

ESOKIT_FUNCTION void RowStudy::find_other_effects() {
  find_columns();
  // The linear numbers: b0, the log's columns, forces of position, sines, friction.
  if (chosen_.friction_scale > 0.0) {
    result_.friction = linear(here().fit.linear.size() - 1);
    result_.friction_scale = chosen_.friction_scale;
  }
  if (result_.position) find_position_factors();
  find_sinusoids();
  if (!along_.empty()) find_schedule(used_, along_, model_, options_, result_);
}

ESOKIT_FUNCTION void RowStudy::find_columns() {
  // The times where the plateau is, and the gains with them.
  FitData there = used_;
  Fit fitted_there = here().fit;
  if (may_be_late()) {
    find_times(there, model_, bounds_, here().fit.at, false);
    fitted_there = InnovationsFit(there, model_, bounds_).minimise(here().fit.at, false, 8);
  }
  for (std::size_t c = 0; c < known_; ++c) {
    MeasuredEffect effect;
    effect.gain = linear(c + 1);
    effect.gain.value = fitted_there.linear[c + 1];
    effect.follows_output = share_left(rows_.columns[c], rows_.y) < follows;
    if (!rows_.timed.empty() && rows_.timed[c].free) {
      effect = late_effect(effect, c, there.timed[c]);
    }
    effect.lost = result_.log.lost[c];
    result_.columns.push_back(effect);
  }
}

ESOKIT_FUNCTION MeasuredEffect RowStudy::late_effect(MeasuredEffect effect, std::size_t c,
                                                     const TimedColumn& column) const {
  const double t = student_95(19);
  const auto late = [&](double at, auto value, auto error) {
    Estimate found = time_on(
        result_.plateau, [&](const PlateauPoint& p) { return value(p.errors.times[c]); },
        [&](const PlateauPoint& p) { return error(p.errors.times[c].covariance); },
        rows_.sample_time);
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
  effect.timed = effect.seen() && effect.latency.half_width < bounds_.latency_max;
  if (!effect.timed) effect.latency = effect.lag = effect.dead_time = {};
  return effect;
}

ESOKIT_FUNCTION void RowStudy::find_position_factors() {
  PositionForce& force = result_.position_force;
  std::tie(force.middle, force.size) = position_scale(rows_);
  const auto [low, high] = std::minmax_element(rows_.y.begin(), rows_.y.end());
  force.low = *low;
  force.high = *high;
  for (std::size_t i = 0; i < position_columns; ++i) force.factors[i] = linear(known_ + 1 + i);
}

ESOKIT_FUNCTION void RowStudy::find_sinusoids() {
  const double t = student_95(19);
  for (std::size_t i = 0; i < sines_.size(); ++i) {
    FitData rest = used_;
    const auto pair =
        rest.columns.begin() +
        static_cast<std::ptrdiff_t>(known_ + (result_.position ? position_columns : 0) + 2 * i);
    rest.columns.erase(pair, pair + 2);
    if (rest.friction >= 0) rest.friction -= 2;
    Sinusoid sine = fit_sine(rest, model_, bounds_, here().fit.at, sines_[i]).sine;
    sine.frequency.half_width *= t;
    sine.amplitude.half_width *= t;
    if (sine.amplitude.low() > 0.0) result_.sinusoids.push_back(sine);
  }
  std::sort(
      result_.sinusoids.begin(), result_.sinusoids.end(),
      [](const Sinusoid& a, const Sinusoid& b) { return a.amplitude.value > b.amplitude.value; });
}

ESOKIT_FUNCTION void RowStudy::find_second_opinion() {
  // The fit of output error is blind where the plant integrates or a force depends on y: nearer to
  // the plateau it sees again.
  const double middle = here().fit.at.bandwidth;
  for (const double w : {0.1 * bounds_.bandwidth_min, 0.1 * middle, 0.3 * middle}) {
    if (!(result_.excitation < excitation_max)) break;
    result_.second_opinion = second_opinion(used_, model_, bounds_, here().fit.at, w);
    if (result_.second_opinion.informative()) break;
  }
}

ESOKIT_FUNCTION void RowStudy::find_curves() {
  result_.by_size = gain_by_size(used_, model_, bounds_, here().fit.at);
  if (result_.held > 0.0) {
    // Where it holds, small u does little: that is known already, and no curve can be found.
    GainBySize& sizes = result_.by_size;
    if ((std::abs)(sizes.below.value) < (std::abs)(sizes.above.value)) sizes = {};
    return;
  }
  if (model_.order == 2)
    result_.in_motion = gain_in_motion(used_, model_, bounds_, here().fit, speed());
  result_.curve = seen_curve(used_, model_, bounds_, here().fit, result_.by_size);
}

ESOKIT_FUNCTION void RowStudy::compare_with_the_log() {
  double excitation = std::numeric_limits<double>::infinity();
  for (const PlateauPoint& point : result_.plateau.points) {
    excitation = (std::min)(excitation, point.errors.linear[0] / (std::abs)(point.fit.linear[0]));
  }
  result_.excitation = excitation;
  find_second_opinion();
  result_.at_bound = here().at_bound || of_all_.points[of_all_.middle].at_bound;
  if (excitation < excitation_max) find_curves();
  if (!(result_.held > 0.0)) result_.lead = lead_of(used_, model_, bounds_, here().fit);
  if (const SecondOpinion& second = result_.second_opinion;
      result_.lead.time > 0.0 && second.informative()) {
    const auto by = static_cast<std::size_t>(std::ceil(result_.lead.time / rows_.sample_time));
    const SecondOpinion earlier =
        second_opinion(advanced(used_, by), model_, bounds_, here().fit.at, second.bandwidth);
    result_.lead.left = (1.0 - earlier.explained) / (1.0 - second.explained);
  }
  result_.input_gain = widened(result_, options_);
  if (result_.order == 1) find_rise();
  widen_latency();
}

ESOKIT_FUNCTION void RowStudy::find_rise() {
  const auto span = [](const std::vector<double>& values) {
    const auto [low, high] = std::minmax_element(values.begin(), values.end());
    return *high - *low;
  };
  const double window = (std::max)(result_.latency.value, 8.0 * rows_.sample_time);
  const double most = (std::abs)(result_.input_gain.value) * span(used_.u) +
                      (std::max)(result_.pole.value, 0.0) * span(used_.y) +
                      2.0 * result_.friction.value +
                      6.0 * (result_.noise.value + result_.log.quantisation) / window;
  result_.rise = span_of_rates(used_, window) / most;
  // y' = -a y + b0 u with u = s y: a loop that is any good returns faster than y runs away.
  const double feedback = -result_.input_gain.value * slope_of_law(used_);
  if (result_.pole.value < 0.0 && feedback > 0.0)
    result_.returns = (result_.pole.value + feedback) / feedback;
}

ESOKIT_FUNCTION void RowStudy::widen_latency() {
  // The margins of a design have to hold for it, too: for an earlier u, and for what is not seen.
  if (leads(result_))
    result_.latency.half_width = (std::max)(result_.latency.half_width, result_.lead.time);
  if (const double unseen = half_row(result_) - result_.latency.value;
      unseen > 0.0 && !white(result_, options_) && informed(result_)) {
    result_.latency.half_width = (std::max)(result_.latency.half_width, unseen);
  }
}

}  // namespace detail
}  // namespace esokit
