#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/scalar.hpp>
#include <esokit/identify/detail/timed_column.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/impl/innovations_filter.ipp>
#include <esokit/identify/spectrum.hpp>
#include <esokit/math/detail/dense.hpp>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION InnovationsFit::InnovationsFit(const FitData& data, const FitModel& model,
                                               const FitBounds& bounds)
    : data_(data), model_(model), bounds_(bounds) {
  const auto [least, largest] = std::minmax_element(data.u.begin(), data.u.end());
  for (std::size_t piece = 0; piece < data.starts.size(); ++piece) {
    const std::size_t to = piece + 1 < data.starts.size() ? data.starts[piece + 1] : data.y.size();
    const std::size_t from = data.starts[piece];
    lead_.push_back(lead(from, to));
    std::size_t seen = 0;
    for (std::size_t k = from + lead_.back(); k < to; ++k) seen += data.has(k);
    // As the filter has it: the load of the first piece goes on.
    const bool known = data.one_load && rows_ > 0 && model.extension == 1;
    const bool unknown = data.unknown_before && lead_.back() == longest_lead(from, to);
    if (unknown) {
      unknown_.resize(data.y.size());
      unknown_[from] = *largest - *least;
    }
    const auto blind =
        static_cast<std::size_t>(model.order + (known ? 0 : model.extension) + (unknown ? 1 : 0));
    if (seen > blind) rows_ += seen - blind;
  }
}

ESOKIT_FUNCTION void InnovationsFit::ignore_input() {
  input_ = 0.0;
  unknown_.clear();
}

ESOKIT_FUNCTION Fit InnovationsFit::at(const FitPoint& point) {
  Fit fit;
  fit.at = point;
  with_filter(point, [&](const auto& filter) { solve_linear(filter, fit); });
  return fit;
}

ESOKIT_FUNCTION Fit InnovationsFit::minimise(const FitPoint& start, bool with_bandwidth,
                                             int steps) {
  Fit best = at(inside(start));
  double damping = 1e-3;
  const auto keep = [&] {
    std::swap(residual_, kept_residual_);
    std::swap(columns_, kept_columns_);
    std::swap(started_, kept_started_);
    std::swap(before_, kept_before_);
  };
  for (int step = 0; step < steps; ++step) {
    const auto [jacobian, free] = sensitivities(best, with_bandwidth);
    if (free.empty()) return best;
    std::vector<double> normal, right;
    normal_equations(jacobian, residual_, normal, right);
    bool better = false;
    while (damping < 1e4) {
      std::array<double, 4> move{};
      // None at a bound, or one that is not finite: more damping would not help.
      if (!step_within(best.at, normal, right, free, damping, move)) break;
      const FitPoint trial_point = moved(best.at, move);
      keep();
      const Fit trial = at(trial_point);
      if (trial.mean_square < best.mean_square) {
        const double gain = 1.0 - trial.mean_square / best.mean_square;
        best = trial;
        damping = (std::max)(damping * 0.2, 1e-9);
        better = true;
        // A hundredth of the change that changes the likelihood by one.
        if (gain * static_cast<double>(best.rows) < 0.02) best.converged = true;
        break;
      }
      keep();
      damping *= 8.0;
    }
    if (!better) best.converged = true;
    if (best.converged) break;
  }
  return best;
}

ESOKIT_FUNCTION InnovationsFit::Sensitivities InnovationsFit::sensitivities(const Fit& fit,
                                                                            bool with_bandwidth,
                                                                            bool with_times) {
  Sensitivities result;
  std::array<bool, 4> wanted = {with_bandwidth, true, true, model_.pole};
  const std::vector<double> base = residual_;
  for (int i = 0; i < 4; ++i) {
    if (!wanted[static_cast<std::size_t>(i)]) continue;
    std::array<double, 4> move{};
    double step = small_step[static_cast<std::size_t>(i)];
    move[static_cast<std::size_t>(i)] = step;
    FitPoint beside = moved(fit.at, move);
    if (numbers(beside) == numbers(fit.at)) {
      step = -step;
      move[static_cast<std::size_t>(i)] = step;
      beside = moved(fit.at, move);
      if (numbers(beside) == numbers(fit.at)) continue;
    }
    std::vector<double> residual(data_.y.size());
    with_filter(beside,
                [&](const auto& filter) { run_whole(filter, fit.linear, residual.data()); });
    for (std::size_t k = 0; k < residual.size(); ++k) residual[k] = (residual[k] - base[k]) / step;
    without_start(residual);
    result.columns.push_back(std::move(residual));
    result.free.push_back(i);
  }
  for (std::size_t c = 1; c < columns_.size(); ++c) result.columns.push_back(columns_[c]);
  if (!with_times) return result;
  for (std::size_t c = 0; c < data_.timed.size(); ++c) {
    if (!data_.timed[c].free) continue;
    auto moves = time_sensitivities(fit.at, c, fit.linear[1 + data_.inputs.size() + c]);
    for (auto& column : moves) result.columns.push_back(std::move(column));
  }
  return result;
}

ESOKIT_FUNCTION std::array<std::vector<double>, 2> InnovationsFit::time_sensitivities(
    const FitPoint& at, std::size_t c, double gain) {
  const TimedColumn& column = data_.timed[c];
  const double T = data_.sample_time;
  // A delay of less than half a row would see the corners of the straight lines.
  const double step = 0.5 * T, square = (std::max)(0.1 * column.lag_square, 0.25 * T * T);
  const auto slope = [&](const std::vector<double>& up, const std::vector<double>& down,
                         double by) {
    std::vector<double> change(up.size());
    for (std::size_t k = 0; k < change.size(); ++k) change[k] = gain * (up[k] - down[k]) / by;
    return column_innovations(at, change);
  };
  const auto late = [&](double longer, double more) {
    return detail::late(column, data_.starts, T, longer, more);
  };
  const double less = (std::min)(square, column.lag_square);
  return {slope(late(step, 0.0), late(-step, 0.0), 2.0 * step),
          slope(late(0.0, square), late(0.0, -less), square + less)};
}

ESOKIT_FUNCTION std::vector<double> InnovationsFit::column_innovations(
    const FitPoint& at, const std::vector<double>& column) const {
  std::vector<double> out(column.size());
  with_filter(at, [&](const auto& filter) {
    filter.template run<1>(
        data_, lead_, data_.u, [](std::size_t) { return 0.0; }, [](std::size_t) { return 0.0; },
        [&](std::size_t, std::ptrdiff_t k) { return column[static_cast<std::size_t>(k)]; },
        {out.data()});
  });
  without_start(out);
  return out;
}

ESOKIT_FUNCTION std::vector<double> InnovationsFit::without_start(
    std::vector<double>& innovations) const {
  std::vector<double> parts(data_.starts.size(), 0.0);
  if (unknown_.empty()) return parts;
  for (std::size_t piece = 0; piece < parts.size(); ++piece) {
    const std::size_t from = data_.starts[piece];
    const std::size_t to = piece + 1 < parts.size() ? data_.starts[piece + 1] : data_.y.size();
    const double* const start = started_.data() + from;
    double* const of = innovations.data() + from;
    const double square = detail::dot(start, start, to - from);
    if (unknown_[from] == 0.0 || !(square > 0.0)) continue;
    parts[piece] = detail::dot(start, of, to - from) / square;
    for (std::size_t k = 0; k < to - from; ++k) of[k] -= parts[piece] * start[k];
  }
  return parts;
}

ESOKIT_FUNCTION bool InnovationsFit::at_bound(const FitPoint& p) const {
  return p.latency >= bounds_.latency_max * 0.999 ||
         (model_.pole && (std::abs)(p.pole) * p.latency >= bounds_.pole_latency * 0.999);
}

ESOKIT_FUNCTION FitPoint InnovationsFit::inside(FitPoint p) const {
  p.bandwidth = std::clamp(p.bandwidth, bounds_.bandwidth_min, bounds_.bandwidth_max);
  p.latency = std::clamp(p.latency, bounds_.latency_min, bounds_.latency_max);
  p.lag_share = std::clamp(p.lag_share, (std::min)(0.1 * data_.sample_time / p.latency, 1.0), 1.0);
  const double most = bounds_.pole_latency / p.latency;
  p.pole = model_.pole ? std::clamp(p.pole, -0.1 * most, most) : 0.0;
  return p;
}

ESOKIT_FUNCTION Estimate InnovationsFit::noise_floor(const Fit& fit) const {
  constexpr std::size_t length = 128;
  std::vector<std::size_t> quiet;
  double variance = 1.0;
  with_filter(fit.at, [&](const auto& filter) {
    const double wT = fit.at.bandwidth * data_.sample_time;
    for (std::size_t j = length / 4; j < length / 2; ++j) {
      const double part = static_cast<double>(j) / (length / 2);
      if (filter.disturbance_over_noise(wT * wT, part) < 0.1) quiet.push_back(j);
    }
    variance = filter.table->steady_variance;
  });
  std::vector<double> powers;
  const std::size_t lead = *std::max_element(lead_.begin(), lead_.end()) +
                           static_cast<std::size_t>(model_.order + model_.extension);
  each_spectrum(residual_, data_.starts, lead, length, [&](const std::vector<double>& power) {
    double sum = 0.0;
    for (const std::size_t j : quiet) sum += power[j];
    powers.push_back(sum / static_cast<double>(quiet.size()));
  });
  if (quiet.size() < 8 || powers.size() < 15) return {};
  std::sort(powers.begin(), powers.end());
  const double middle = powers[powers.size() / 2];
  // The median of a chi-square distribution is below its mean; neighbouring frequencies share a
  // third.
  const double freedom = 2.0 * static_cast<double>(quiet.size()) * 2.0 / 3.0;
  // Rows without a measurement are zeros.
  std::size_t seen = 0;
  for (std::size_t k = 0; k < residual_.size(); ++k) seen += data_.has(k);
  variance *= static_cast<double>(seen) / static_cast<double>(residual_.size());
  const double floor = std::sqrt(middle / (variance * (1.0 - 2.0 / (3.0 * freedom))));
  // The standard error of a median is 1.253 times that of the mean; the relative error of a root
  // is half as large.
  const double between = powers[powers.size() * 3 / 4] - powers[powers.size() / 4];
  const double error =
      1.253 * between / 1.349 / std::sqrt(static_cast<double>(powers.size())) / middle;
  return {floor, 2.0 * 0.5 * error * floor};
}

ESOKIT_FUNCTION void InnovationsFit::normal_equations(std::span<const std::vector<double>> jacobian,
                                                      const std::vector<double>& residual,
                                                      std::vector<double>& normal,
                                                      std::vector<double>& right, std::size_t from,
                                                      std::size_t to) {
  const std::size_t n = jacobian.size();
  to = (std::min)(to, residual.size());
  normal.assign(n * n, 0.0);
  right.assign(n, 0.0);
  const std::size_t count = to - from;
  for (std::size_t i = 0; i < n; ++i) {
    const double* const a = jacobian[i].data() + from;
    for (std::size_t j = i; j < n; ++j) {
      normal[j * n + i] = normal[i * n + j] = detail::dot(a, jacobian[j].data() + from, count);
    }
    right[i] = detail::dot(a, residual.data() + from, count);
  }
}

ESOKIT_FUNCTION std::size_t InnovationsFit::longest_lead(std::size_t from, std::size_t to) const {
  // Of a short piece more than a third would say too little.
  return (std::min)(static_cast<std::size_t>(std::ceil(bounds_.latency_max / data_.sample_time)),
                    (to - from) / 3);
}

ESOKIT_FUNCTION std::size_t InnovationsFit::lead(std::size_t from, std::size_t to) const {
  const std::size_t most = longest_lead(from, to);
  const std::vector<double>& u = data_.u;
  double first = 0.0, all = 0.0;
  std::size_t rest = 0;
  for (std::size_t k = from + 1; k < to; ++k) {
    const double move = (std::abs)(u[k] - u[k - 1]);
    if (all <= 0.0) rest = k - 1 - from;
    all += move;
    if (k <= from + most) first += move;
  }
  const double share = static_cast<double>(most) / static_cast<double>(to - from);
  return first > std::clamp(3.0 * share, 0.1, 0.6) * all ? rest : most;
}

ESOKIT_FUNCTION FitPoint InnovationsFit::moved(FitPoint p,
                                               const std::array<double, 4>& move) const {
  const double product = p.pole * p.latency;
  const FitPoint before = p;
  p.bandwidth *= std::exp(move[0]);
  p.latency *= std::exp(move[1]);
  // The effect of lag in exchange for dead time is quadratic, so the step is in its square:
  // otherwise the derivative at zero lag would vanish.
  if (move[2] != 0.0) p.lag_share = std::sqrt((std::max)(p.lag_share * p.lag_share + move[2], 0.0));
  if (move[1] != 0.0 || move[3] != 0.0) p.pole = (product + move[3]) / p.latency;
  p = inside(p);
  if (move[1] == 0.0 && move[3] == 0.0) p.pole = before.pole;
  return p;
}

ESOKIT_FUNCTION bool InnovationsFit::step_within(const FitPoint& p,
                                                 const std::vector<double>& normal,
                                                 std::vector<double> right,
                                                 const std::vector<int>& free, double damping,
                                                 std::array<double, 4>& move) const {
  const std::size_t all = right.size();
  std::vector<double> damped = normal;
  for (std::size_t i = 0; i < free.size(); ++i) damped[i * all + i] *= 1.0 + damping;
  for (bool held = true; held;) {
    std::vector<double> change = right;
    detail::solve_normal(damped, change, static_cast<int>(all));
    held = false;
    move = {};
    for (std::size_t i = 0; i < free.size(); ++i) {
      if (!is_finite(change[i])) return false;
      const auto which = static_cast<std::size_t>(free[i]);
      move[which] = std::clamp(-change[i], -longest_step[which], longest_step[which]);
      std::array<double, 4> alone{};
      alone[which] = move[which];
      if (move[which] == 0.0 || numbers(moved(p, alone))[which] != numbers(p)[which]) continue;
      // A row and a column of zeros: its change is zero.
      for (std::size_t j = 0; j < all; ++j) damped[i * all + j] = damped[j * all + i] = 0.0;
      right[i] = 0.0;
      held = true;
    }
  }
  return move != std::array<double, 4>{};
}

template <class F>
void InnovationsFit::with_filter(const FitPoint& point, const F& use) const {
  switch (model_.order + model_.extension) {
    case 2:
      return use(detail::InnovationsFilter<2>::make(data_, model_, point, cached_));
    case 3:
      return use(detail::InnovationsFilter<3>::make(data_, model_, point, cached_));
    case 4:
      return use(detail::InnovationsFilter<4>::make(data_, model_, point, cached_));
    default:
      return use(detail::InnovationsFilter<5>::make(data_, model_, point, cached_));
  }
}

ESOKIT_FUNCTION void InnovationsFit::combine(std::vector<double>& sum,
                                             const std::vector<std::vector<double>>& parts,
                                             const std::vector<double>& linear, std::size_t first) {
  for (std::size_t c = 0; c < parts.size(); ++c) {
    for (std::size_t k = 0; k < sum.size(); ++k) sum[k] += linear[first + c] * parts[c][k];
  }
}

template <class Filter>
void InnovationsFit::run_whole(const Filter& filter, const std::vector<double>& linear,
                               double* out) const {
  force_.assign(data_.y.size(), 0.0);
  for (std::size_t k = 0; k < force_.size(); ++k) force_[k] = linear[0] * data_.u[k];
  for (std::size_t piece = 0; piece < before_.size(); ++piece)
    force_[data_.starts[piece]] += before_[piece] * unknown_[data_.starts[piece]];
  combine(force_, data_.inputs, linear, 1);
  combined_.assign(data_.y.size(), 0.0);
  combine(combined_, data_.columns, linear, 1 + data_.inputs.size());
  filter.template run<1>(
      data_, lead_, force_, [](std::size_t) { return 1.0; }, [](std::size_t) { return 1.0; },
      [&](std::size_t, std::ptrdiff_t k) { return combined_[static_cast<std::size_t>(k)]; }, {out});
}

template <class Filter>
void InnovationsFit::solve_linear(const Filter& filter, Fit& fit) {
  const std::size_t rows = data_.y.size();
  const std::size_t count = 2 + data_.inputs.size() + data_.columns.size();
  columns_.resize(count);
  for (auto& column : columns_) column.resize(rows);
  const auto nothing = [](std::size_t, std::ptrdiff_t) { return 0.0; };
  const auto none = [](std::size_t) { return 0.0; };
  // y and u in parallel, because a processor can compute both at once.
  filter.template run<2>(
      data_, lead_, data_.u, [](std::size_t run) { return run == 0 ? 1.0 : 0.0; },
      [this](std::size_t run) { return run == 1 ? input_ : 0.0; }, nothing,
      {columns_[0].data(), columns_[1].data()});
  std::size_t next = 2;
  for (const auto& input : data_.inputs) {
    filter.template run<1>(data_, lead_, input, none, [](std::size_t) { return 1.0; }, nothing,
                           {columns_[next++].data()});
  }
  // Several columns in parallel, too.
  const std::size_t first = next;
  const auto run_columns = [&]<int Runs>(std::integral_constant<int, Runs>) {
    std::array<double*, static_cast<std::size_t>(Runs)> out{};
    for (std::size_t run = 0; run < out.size(); ++run) out[run] = columns_[next + run].data();
    filter.template run<Runs>(
        data_, lead_, data_.u, none, none,
        [&](std::size_t run, std::ptrdiff_t k) {
          return data_.columns[next - first + run][static_cast<std::size_t>(k)];
        },
        out);
    next += out.size();
  };
  while (next + 4 <= count) run_columns(std::integral_constant<int, 4>{});
  while (next + 2 <= count) run_columns(std::integral_constant<int, 2>{});
  if (next < count) run_columns(std::integral_constant<int, 1>{});
  std::vector<std::vector<double>> parts;
  if (!unknown_.empty()) {
    started_.resize(rows);
    filter.template run<1>(data_, lead_, unknown_, none, [](std::size_t) { return 1.0; }, nothing,
                           {started_.data()});
    // Of a lag that is forgotten by then rounding errors are left, which must not explain anything.
    const double moved_by_u = detail::dot(columns_[1].data(), columns_[1].data(), rows);
    for (std::size_t piece = 0; piece < data_.starts.size(); ++piece) {
      const std::size_t from = data_.starts[piece];
      const std::size_t to = piece + 1 < data_.starts.size() ? data_.starts[piece + 1] : rows;
      double* const start = started_.data() + from;
      if (detail::dot(start, start, to - from) < 1e-6 * moved_by_u)
        std::fill(start, start + (to - from), 0.0);
    }
    for (auto& column : columns_) parts.push_back(without_start(column));
  }
  const auto solve = [&] {
    std::vector<double> normal;
    normal_equations(std::span(columns_).subspan(1), columns_[0], normal, fit.linear);
    for (double& value : fit.linear) value = -value;
    detail::solve_normal(normal, fit.linear, static_cast<int>(count) - 1);
  };
  solve();
  if (data_.friction >= 0) {
    const std::size_t c = 1 + data_.inputs.size() + static_cast<std::size_t>(data_.friction);
    if (fit.linear[c] < 0.0) {
      columns_[c + 1].assign(rows, 0.0);
      solve();
    }
  }
  residual_ = columns_[0];
  for (std::size_t c = 1; c < count; ++c) {
    for (std::size_t k = 0; k < rows; ++k) residual_[k] += fit.linear[c - 1] * columns_[c][k];
  }
  before_.assign(parts.empty() ? 0 : data_.starts.size(), 0.0);
  for (std::size_t c = 0; c < parts.size(); ++c) {
    const double factor = c == 0 ? 1.0 : fit.linear[c - 1];
    for (std::size_t piece = 0; piece < before_.size(); ++piece)
      before_[piece] -= factor * parts[c][piece];
  }
  const double sum = detail::dot(residual_.data(), residual_.data(), rows);
  fit.rows = std::max<std::size_t>(rows_, 1);
  fit.mean_square = sum / static_cast<double>(fit.rows);
  const double variance = fit.mean_square / filter.table->steady_variance;
  fit.noise = std::sqrt(variance);
  fit.disturbance = variance * data_.sample_time * std::pow(fit.at.bandwidth, 2 * Filter::N);
}

}  // namespace esokit
