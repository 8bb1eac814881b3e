#include "from_log/parts/paste.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <limits>

#include <esokit/adapter/guarded.hpp>
#include <esokit/control/health.hpp>
#include <esokit/core/version.hpp>
#include <esokit/gain/certificate/gating_certificate.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/tune/tuned_controller.hpp>

namespace from_log {
namespace {

using esokit::TunedDesign;
using esokit::TuneFamily;
using esokit::TuneModel;
using esokit::Tuning;
using esokit::detail::printed;
using esokit::detail::source;
using esokit::examples::number_text;

constexpr int checked = 100;  ///< samples of the self-check
constexpr int still = 5;      ///< of them before the step

std::string derivative_of(const std::string& of, int order) {
  return of + std::string(static_cast<std::size_t>(order), '\'');
}

/// Of a machine of order 3 with a lag: (y, y', y'', v).
constexpr int most_states = 4;
using MachineState = esokit::Vector<double, most_states>;

/// The machine that was found around rest at (start_y, start_u): (y, .., y^(n-1), v).
/// For any order n, so that it is compiled once: without derivatives from y^(n) on.
/// @param measured what else acts; may be null
auto machine(const Pasting& p, const TuneModel& model, const Acting* measured) {
  using State = MachineState;
  const int order = model.order;
  const double T = model.sample_time;
  // A slope that the integrator can follow.
  const double scale = std::max(p.friction_scale, 0.1 * p.friction * T);
  const bool lagged = model.lag > 0.2 * T;
  return esokit::sim::nonlinear_plant<most_states>(
      [&p, &model, order, scale, lagged, measured](double t, const State& x, double u) {
        const auto speed = [&](double y, double rate) { return order == 1 ? y : rate; };
        const double rate = order == 2 ? x(1) : 0.0;
        State change = State::Zero();
        for (int i = 0; i + 1 < order; ++i) change(i) = x(i + 1);
        const double v = lagged ? x(most_states - 1) : u;
        double top = p.input_gain * (v - p.start_u) -
                     model.pole * (x(order - 1) - (order == 1 ? p.start_y : 0.0));
        if (p.friction > 0.0) {
          top -= p.friction *
                 (std::tanh(speed(x(0), rate) / scale) - std::tanh(speed(p.start_y, 0.0) / scale));
        }
        if (measured != nullptr) {
          const auto& force = measured->force;
          const double at =
              std::clamp(t / model.sample_time, 0.0, static_cast<double>(force.size()) - 1.001);
          const auto k = static_cast<std::size_t>(at);
          top += force[k] + (at - std::floor(at)) * (force[k + 1] - force[k]);
        }
        if (p.by_position) top += p.force(x(0)) - p.force(p.start_y);
        change(order - 1) = top;
        change(most_states - 1) = lagged ? (u - x(most_states - 1)) / model.lag : 0.0;
        return change;
      });
}

/// A measured disturbance in the self-check: it moves, is lost, moves while it is lost, and is
/// back.
constexpr int w_moves = 30, w_lost = 60, w_back = 65;
double checked_w(const Feed& feed, int k) {
  if (k >= w_lost && k < w_back) return std::nan("");
  return k < w_moves || k >= w_back ? feed.rest : printed(feed.rest + feed.swing);
}

/// Whether `Guarded` proves an observer with these gains with the bound. What it computes for a
/// chain is asked of each level, as its type for each kind of observer takes long to compile. With
/// a slope of d there is nothing to prove.
template <int Order>
bool certified(const TuneModel& model, const TunedDesign& design, double bound) {
  if (!(bound < std::numeric_limits<double>::infinity())) return false;
  if (design.extension > 1) return true;
  constexpr int size = Order + 1;
  auto poles = esokit::detail::placed_poles<Order>(model, design);
  if (design.knows.lag) {
    using Guard =
        esokit::Guarded<esokit::ModelEso<esokit::ModelParts{.order = Order, .actuator = 1}, double,
                                         esokit::PoleSet>>;
    typename Guard::Config config;
    config.observer.input_gain = model.input_gain.value;
    config.observer.sample_time = model.sample_time;
    config.observer.model.actuator.time_constant = model.lag;
    config.disturbance_bound = bound;
    poles.insert(poles.begin(), -1.0 / model.lag);
    std::copy_n(poles.begin(), config.observer.poles.size(), config.observer.poles.begin());
    return Guard::make(config).has_value();
  }
  for (int level = 0; level < design.levels; ++level) {
    esokit::Array<std::complex<double>, size> placed{};
    std::copy_n(poles.begin(), placed.size(), placed.begin());
    const auto sampled =
        esokit::SampledPoleSet<size, double>::from_continuous(placed, model.sample_time);
    const auto gain = esokit::current_gain<size, double>(sampled.weights());
    if (!esokit::gating_certified<size, double>(gain) ||
        !esokit::holding(esokit::detail::ConstantLevel<size, double>(gain), false).stable)
      return false;
    for (auto& pole : poles) pole *= design.settings.bandwidth_factor;
  }
  return true;
}

}  // namespace

Watch watch_of(const Tuning& tuning, const TunedDesign& design, const esokit::FitData& rows) {
  const TuneModel& model = tuning.model;
  const double b0 = model.input_gain.value;
  const double T = model.sample_time;
  const auto form = esokit::detail::given_input_form(design.controller);
  const auto settling = std::min<std::size_t>(
      static_cast<std::size_t>(design.settling_time / T) + 20, rows.y.size() / 4);
  // Gate and monitor look at the innovation of level 1: of a LinearEso with its bandwidth.
  const auto first =
      design.levels > 1
          ? esokit::detail::tuned_controller(
                esokit::detail::chain_kind(model, TuneFamily::linear, design.extension, 1), T,
                design.settings)
          : std::nullopt;
  const auto innovations_of = [&](const esokit::FitData& data, const Replay& replay) {
    return first ? through(*first, b0, model.order, data).innovation : replay.innovation;
  };
  const Replay log = through(form, b0, model.order, rows);
  const auto innovations = settled(innovations_of(rows, log), rows, settling);
  const auto loads = settled(log.load, rows, settling);
  Watch watch;
  // Single outliers of the log shall not count.
  double innovation = std::max(quantile(innovations, 0.99), 4.0 * model.noise);
  double load = quantile(loads, 0.99);
  const double middle = std::abs(0.5 * (model.u_min + model.u_max));
  for (const auto& event : esokit::overloads) {
    esokit::FitData simulated;
    simulated.sample_time = T;
    (void)esokit::simulate_overload(model, 1.0, design.controller, event, design.settling_time,
                                    [&](double, double, double y, double u) {
                                      simulated.y.push_back(y);
                                      simulated.u.push_back(u);
                                    });
    const Replay seen = through(form, b0, model.order, simulated);
    for (const double e : innovations_of(simulated, seen)) {
      innovation = std::max(innovation, std::abs(e) + 4.0 * model.noise);
    }
    for (const double l : seen.load) load = std::max(load, std::abs(l) + middle);
  }
  watch.threshold = printed(2.0 * innovation);
  watch.bound = printed(2.0 * std::abs(b0) * load);
  watch.guarded = design.family != TuneFamily::filter &&
                  esokit::detail::with_number<1, 3>(model.order, [&](auto n) {
                    return certified<n()>(model, design, watch.bound);
                  });
  const auto& gains = design.settings.gains;
  // Of a cascade the mean of its levels, with which b / b0 is found best.
  watch.bandwidth =
      design.levels > 1
          ? design.settings.observer_bandwidth *
                std::pow(design.settings.bandwidth_factor, 0.5 * (design.levels - 1))
          : esokit::detail::law_mean(gains, model.order) / std::max(design.bandwidth_ratio, 1e-9);
  watch.bandwidth = printed(std::min(watch.bandwidth, 0.99 / T));
  watch.divider = std::clamp(static_cast<int>(0.5 / (watch.bandwidth * T)), 1, 1000);
  watch.latency = printed(model.dead_time + (design.knows.lag ? 0.0 : model.lag) +
                          (design.knows.sensor ? 0.0 : model.sensor));
  // At least what the monitor asks for behind its latency.
  watch.memory = printed(
      std::max(200.0 / watch.bandwidth,
               10.0 * (1.0 / watch.bandwidth + watch.latency / (model.order + design.extension))));
  const double rms = std::max(quantile(innovations, 0.95) / 1.96, model.noise);
  const double by_noise =
      esokit::detail::with_number<2, 5>(model.order + design.extension, [&](auto size) {
        const auto monitor =
            esokit::HealthMonitor<size()>::make({.observer_bandwidth = watch.bandwidth,
                                                 .sample_time = T,
                                                 .input_range = 0.5 * (model.u_max - model.u_min),
                                                 .noise = 1.0,
                                                 .memory = watch.memory,
                                                 .divider = watch.divider});
        return monitor ? monitor->health().innovation_of_noise : 1.0;
      });
  watch.noise = printed(rms / std::max(by_noise, 1e-9));
  return watch;
}

namespace {

/// What the code of a design includes.
std::string includes_of(const std::string& code) {
  struct Header {
    const char *word, *file;
  };
  constexpr Header headers[] = {{"Guarded<", "adapter/guarded.hpp"},
                                {"OutlierGate<", "adapter/outlier_gate.hpp"},
                                {"ActuatorMap<", "adapter/actuator_map.hpp"},
                                {"Adrc<", "control/adrc.hpp"},
                                {"ApproachProfile<", "control/approach_profile.hpp"},
                                {"HealthMonitor<", "control/health.hpp"},
                                {"SmoothProfile<", "control/smooth_profile.hpp"},
                                {"HalfGainPoles", "gain/half_gain.hpp"},
                                {"PoleSet", "gain/pole_set.hpp"},
                                {"CascadeEso<", "observer/cascade_eso.hpp"},
                                {"ExtendedStateFilter<", "observer/extended_state_filter.hpp"},
                                {"HalfGainEso<", "observer/half_gain_eso.hpp"},
                                {"LinearEso<", "observer/linear_eso.hpp"},
                                {"ModelEso<", "observer/model_eso.hpp"}};
  std::string text;
  for (const Header& header : headers) {
    if (code.find(header.word) != std::string::npos)
      text += std::string("#include <esokit/") + header.file + ">\n";
  }
  return text;
}

/// Breaks lines of more than 99 columns after `at`.
std::string wrapped(const std::string& text, const std::string& indent, const char* more = "",
                    const char* at = ", ") {
  std::string out, line = indent, word;
  bool first = true;
  const auto put = [&] {
    if (!first && line.size() + word.size() > 99) {
      while (line.ends_with(' ')) line.pop_back();
      out += line + "\n";
      line = indent + more;
    }
    line += word;
    word.clear();
    first = false;
  };
  for (const char c : text) {
    word += c;
    if (word.ends_with(at)) put();
  }
  put();
  while (line.ends_with(' ')) line.pop_back();
  return out + line + "\n";
}

std::string comment(const std::string& text, const std::string& indent = "") {
  return wrapped("// " + text, indent, "// ", " ");
}

std::string exact(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

std::string list(const std::vector<double>& numbers) {
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ", ") + source(number);
  return text;
}

}  // namespace

Replay through(const esokit::LinearController& form, double input_gain, int order,
               const esokit::FitData& rows) {
  Replay replay;
  const int n = form.states();
  std::vector<double> z(static_cast<std::size_t>(n)), change(z.size());
  std::size_t piece = 0;
  double offset = 0.0;
  const double direct = form.y_to_estimate(0, 0);
  const auto estimate = [&](int row, double y) {
    double sum = form.y_to_estimate(row, 0) * y;
    for (int i = 0; i < n; ++i) sum += form.to_estimate(row, i) * z[static_cast<std::size_t>(i)];
    return sum;
  };
  for (std::size_t k = 0; k < rows.y.size(); ++k) {
    if (piece < rows.starts.size() && rows.starts[piece] == k) {
      ++piece;
      offset = rows.y[k];
      std::fill(z.begin(), z.end(), 0.0);
    }
    const double y = rows.y[k] - offset;
    const double corrected = estimate(0, y);
    replay.t.push_back(static_cast<double>(k) * rows.sample_time);
    replay.estimate.push_back(corrected + offset);
    replay.load.push_back(estimate(order, y) / input_gain);
    replay.before.push_back(estimate(order - 1, y) + (order == 1 ? offset : 0.0));
    // The measurement that the observer had expected would not have moved it.
    replay.innovation.push_back((y - corrected) / (1 - direct));
    for (int i = 0; i < n; ++i) {
      double sum = form.from_y(i, 0) * y + form.from_u(i, 0) * rows.u[k];
      for (int j = 0; j < n; ++j) sum += form.a(i, j) * z[static_cast<std::size_t>(j)];
      change[static_cast<std::size_t>(i)] = sum;
    }
    for (std::size_t i = 0; i < z.size(); ++i) z[i] += change[i];
  }
  return replay;
}

std::vector<double> settled(const std::vector<double>& values, const esokit::FitData& rows,
                            std::size_t settling) {
  std::vector<double> sizes;
  std::size_t piece = 0, from = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (piece < rows.starts.size() && rows.starts[piece] == k) {
      from = k + settling;
      ++piece;
    }
    if (k >= from) sizes.push_back(std::abs(values[k]));
  }
  return sizes;
}

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const auto at =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

TuneModel as_printed(TuneModel model) {
  for (double* number : {&model.input_gain.value, &model.lag, &model.noise, &model.sample_time,
                         &model.u_min, &model.u_max}) {
    *number = printed(*number);
  }
  return model;
}

std::string Pasting::used() const {
  std::string text;
  if (friction > 0.0 || by_position) {
    text = std::string("; ") + (friction > 0.0 ? "friction" : "") +
           (friction > 0.0 && by_position ? " and " : "") +
           (by_position ? "the force that depends on y" : "") +
           (friction > 0.0 && by_position ? " are" : " is") +
           " added to u along the reference, so that the observer has less to find";
  }
  for (const Feed& feed : feeds) text += (&feed == &feeds[0] ? "; " : ", ") + feed.name;
  if (!feeds.empty()) {
    text += std::string(feeds.size() > 1 ? " are" : " is") +
            " measured, and what it asks of u is added at once (call measured before update)";
  }
  if (!not_known.empty()) text += ". " + not_known.substr(0, not_known.size() - 1);
  return text;
}

std::vector<Feed> Feed::make(const Input& input, const esokit::Identified& found,
                             const TuneModel& model, const esokit::FitData& rows) {
  std::vector<Feed> feeds;
  const double T = model.sample_time;
  for (std::size_t c = 0; c < found.columns.size(); ++c) {
    const esokit::MeasuredEffect& effect = found.columns[c];
    if (!effect.seen() || effect.follows_output) continue;
    const auto& w = rows.columns[c];
    double mean = 0.0;
    for (const double value : w) mean += value / static_cast<double>(w.size());
    Feed feed;
    feed.name = input.measured[c];
    feed.column = c;
    feed.rest = std::strtod(number_text(mean, 3).c_str(), nullptr);
    feed.factor = printed(-effect.gain.value / model.input_gain.value);
    // u is held for a sample, that is, half a sample late.
    const double later = std::max(effect.lag.value - model.lag, 0.0);
    if (later > 0.2 * T) {
      feed.at_once = printed(model.lag / effect.lag.value);
      feed.decay = printed(std::exp(-T / effect.lag.value));
    }
    feed.delay = printed(
        std::max(effect.latency.value - model.lag - model.dead_time - 0.5 * T - later, 0.0) / T);
    for (const double value : w)
      feed.reach = std::max(feed.reach, std::abs(feed.factor * (value - feed.rest)));
    feed.reach = printed(feed.reach);
    feed.swing = printed(feed.reach / std::abs(feed.factor));
    feeds.push_back(feed);
  }
  return feeds;
}

void FeedPath::start(double w) {
  held_ = w;
  before_ = v_ = w - feed_->rest;
  std::fill(past_.begin(), past_.end(), before_);
}

double FeedPath::update(double w) {
  if (std::isfinite(w)) held_ = w;
  std::copy_backward(past_.begin(), past_.end() - 1, past_.end());
  past_[0] = held_ - feed_->rest;
  const std::size_t n = past_.size();
  const double part = feed_->delay - std::floor(feed_->delay);
  const double x = (1.0 - part) * past_[n - 2] + part * past_[n - 1];
  v_ = feed_->decay * v_ + (1.0 - feed_->decay) * 0.5 * (before_ + x);
  before_ = x;
  return feed_->factor * (feed_->at_once * x + (1.0 - feed_->at_once) * v_);
}

esokit::FitData told_rows(const std::vector<Feed>& feeds, const esokit::FitData& rows) {
  esokit::FitData out = rows;
  for (const Feed& feed : feeds) {
    const auto& w = rows.columns[feed.column];
    FeedPath path(feed);
    std::size_t piece = 0;
    for (std::size_t k = 0; k < w.size(); ++k) {
      if (piece < rows.starts.size() && rows.starts[piece] == k) {
        ++piece;
        path.start(w[k]);
      }
      out.u[k] -= path.update(w[k]);
    }
  }
  return out;
}

double Pasting::reach() const {
  double sum = 0.0;
  for (const Feed& feed : feeds) sum += feed.reach;
  return printed(sum + pole_reach);
}

double Pasting::known(double r, double rate) const {
  double sum = order == 2 ? pole * rate : 0.0;
  if (friction > 0.0) sum += friction * std::tanh((order == 1 ? r : rate) / friction_scale);
  if (by_position) sum -= force(r);
  return sum / input_gain;
}

std::vector<double> Pasting::limits(const TuneModel& model, std::size_t gains) const {
  std::vector<double> all(gains, 0.0);
  const auto n = static_cast<std::size_t>(order);
  const bool settles = n >= 2 && std::abs(model.pole) > 0.0;
  // A pole asks for a r^(n-1) beside r^(n), the lag for tau r^(n+1). They peak one after another:
  // of a smooth step each adds six tenths at most to the peak of both.
  const double share = 0.9 / (1.0 + 0.6 * (settles ? 1 : 0) + 0.6 * (gains > n ? 1 : 0));
  all[n - 1] = printed(share * room);
  if (settles) all[n - 2] = printed(share * room / std::abs(model.pole));
  if (gains > n) all[n] = printed(share * room / model.lag);
  return all;
}

double Pasting::approach(const TuneModel& model, int gains) const {
  return printed(0.7 / (model.latency() - (gains == 2 ? model.lag : 0.0)));
}

std::string ActuatorCode::made() const {
  return std::string("esokit::ActuatorMap<>::make(esokit::ActuatorCurve<>::") +
         (seen.kind == esokit::CurveKind::square ? "square" : "dead_zone") + "(" +
         source(seen.size.value) + "))";
}

double ActuatorCode::steepest() const {
  const double little = 1e-3 * seen.size.value;
  return curved() ? input(little) / little : 1.0;
}

Pasting Pasting::make(const Settings& settings, const Input& input, const Findings& findings,
                      const TuneModel& model, const Replay& replay, std::vector<Feed> feeds) {
  const esokit::Identified& found = findings.found;
  Pasting p;
  p.actuator.seen = findings.curve;
  p.actuator.seen.size.value = printed(findings.curve.size.value);
  p.feeds = std::move(feeds);
  const std::string name = source_of(settings).file_name();
  p.order = model.order;
  p.input_gain = model.input_gain.value;
  const double half = 0.5 * (model.u_max - model.u_min);
  const double force = std::abs(p.input_gain) * half;
  // Only what the log tells, and what u can still balance.
  if (found.friction.low() > 0.0 && found.friction.value < 0.5 * force && p.order <= 2) {
    p.friction = printed(found.friction.value);
    p.friction_scale = printed(found.friction_scale);
  }
  if (found.position) {
    p.force = found.position_force;
    double squares = 0.0, errors = 0.0;
    constexpr int points = 100;
    for (int i = 0; i <= points; ++i) {
      const double y = p.force.low + (p.force.high - p.force.low) * i / points;
      squares += std::pow(p.force(y), 2);
      errors += std::pow(p.force.half_width(y), 2);
    }
    p.by_position = squares > 4.0 * errors && std::sqrt(squares / points) < 0.5 * force;
    for (double* number : {&p.force.middle, &p.force.size, &p.force.low, &p.force.high}) {
      *number = printed(*number);
    }
    for (auto& factor : p.force.factors) factor.value = printed(factor.value);
  }
  // A pole that the log tells is no part of the disturbance: along the reference u has what it
  // asks.
  if (p.order <= 2 && found.pole.low() > 0.0) p.pole = printed(found.pole.value);
  // The range of u that the forces of the log leave beside it, in both directions.
  std::vector<double> needed;
  for (std::size_t k = 0; k < replay.load.size(); ++k)
    needed.push_back(-replay.load[k] - p.pole * replay.before[k] / p.input_gain);
  const double low = quantile(needed, 0.05), high = quantile(needed, 0.95);
  const double room = std::clamp(std::min(model.u_max - high, low - model.u_min), 0.2 * half, half);
  p.room = room * std::abs(p.input_gain);
  p.shortest = printed(4.0 * model.latency());
  p.dead_time = printed(model.dead_time);
  const auto& y = input.log.y;
  double mean = 0.0, least = std::numeric_limits<double>::infinity(), most = -least;
  std::size_t count = 0;
  for (const double value : y) {
    if (!std::isfinite(value)) continue;
    mean += value;
    ++count;
    least = std::min(least, value);
    most = std::max(most, value);
  }
  mean /= static_cast<double>(std::max<std::size_t>(count, 1));
  // Of order 2 at the speed that half the range of u holds, of order 1 anywhere in the log.
  if (p.pole > 0.0 && count > 0) {
    p.pole_reach = printed(p.order == 1 ? p.pole * (most - least) / std::abs(p.input_gain) : half);
  }
  if (least > 0.0 || most < 0.0) p.start_y = std::strtod(number_text(mean, 3).c_str(), nullptr);
  if (model.u_min > -0.1 * half || model.u_max < 0.1 * half) {
    p.start_u = printed(0.5 * (model.u_min + model.u_max));
  }
  const std::string highest = derivative_of("y", p.order);
  p.head =
      comment("From " + name + " by from_log of esokit " + std::to_string(ESOKIT_VERSION_MAJOR) +
              "." + std::to_string(ESOKIT_VERSION_MINOR) + "." +
              std::to_string(ESOKIT_VERSION_PATCH) + ": order " + std::to_string(p.order) +
              ", b0 = " + number_text(found.input_gain.value, 4) + " +- " +
              number_text(found.input_gain.half_width, 2) + ".") +
      comment("y is '" + input.y + "' and u is '" + input.u +
              "' in the units of the log, times are in s; b0 is " + highest +
              " per unit of u, d and forces are in the unit of " + highest + ".") +
      (p.actuator.curved()
           ? comment("u below is its effect, in the unit of u: the actuator " +
                     std::string(findings.curve.kind == esokit::CurveKind::square
                                     ? "acts as the square of u"
                                     : "has a dead zone") +
                     ", and update gives the u with the effect for which the law asks.")
           : std::string()) +
      comment(
          "This file checks itself: g++ -std=c++20 -O2 -I esokit/include FILE.cpp && ./a.out. "
          "Then take main away, and call start once and update every " +
          number_text(1e3 * model.sample_time, 6) + " ms.");
  std::string columns;
  for (std::size_t c = 0; c < found.columns.size(); ++c) {
    if (std::none_of(p.feeds.begin(), p.feeds.end(),
                     [c](const Feed& feed) { return feed.column == c; }))
      columns += (columns.empty() ? "" : ", ") + input.measured[c];
  }
  if (!columns.empty()) {
    p.not_known = "What follows from y, or may do nothing (" + columns +
                  "), is part of d: the code does not measure it.";
  }
  return p;
}

template <class S>
Runner::ProfileOf<S> Runner::profile_of(const Pasting& p, const TuneModel& model, int gains) {
  const auto as = [](double x) { return static_cast<S>(x); };
  const S T = as(model.sample_time);
  if (p.order == 1) {
    return esokit::detail::with_number<1, 2>(gains, [&](auto order) -> ProfileOf<S> {
      return esokit::ApproachProfile<order(), most_delay, S>::make(
                 {.pole = as(p.pole),
                  .lag = as(order() == 2 ? model.lag : 0.0),
                  .input_gain = as(p.input_gain),
                  .limits = {.lower = as(model.u_min), .upper = as(model.u_max)},
                  .dead_time = as(p.dead_time),
                  .bandwidth = as(p.approach(model, gains)),
                  .sample_time = T})
          .value();
    });
  }
  return esokit::detail::with_number<2, 4>(gains, [&](auto order) -> ProfileOf<S> {
    esokit::SmoothProfileConfig<order(), S> config{.shortest_time = as(p.shortest),
                                                   .sample_time = T};
    const auto limits = p.limits(model, static_cast<std::size_t>(gains));
    std::transform(limits.begin(), limits.end(), config.limits.begin(), as);
    return esokit::SmoothProfile<order(), S>::make(config).value();
  });
}
template Runner::ProfileOf<double> Runner::profile_of<double>(const Pasting&, const TuneModel&,
                                                              int);
template Runner::ProfileOf<float> Runner::profile_of<float>(const Pasting&, const TuneModel&, int);

Runner::Runner(const Pasting& pasting, const Tuning& tuning, const TunedDesign& design)
    : pasting_(&pasting),
      form_(esokit::detail::given_input_form(design.controller)),
      profile_(profile_of(pasting, tuning.model, static_cast<int>(design.settings.gains.size()))),
      feeds_(pasting.feeds.begin(), pasting.feeds.end()),
      lower_(tuning.model.u_min),
      upper_(tuning.model.u_max),
      state_(static_cast<std::size_t>(form_.states())) {
  const auto& gains = design.settings.gains;
  // v = k0 (r - y) + k1 (r' - y') + ..: 1 is the factor of the highest derivative.
  for (std::size_t i = 0; i <= gains.size(); ++i) {
    weights_[i] = form_.r_to_u(0, 0) * (i < gains.size() ? gains[i] : 1.0) / gains[0];
  }
}

void Runner::start(double y, double u) {
  std::fill(state_.begin(), state_.end(), 0.0);
  std::visit(
      [&](auto& profile) {
        if constexpr (requires { profile.feed(); }) {
          profile.start(y, u);
        } else {
          profile.reset(y);
        }
      },
      profile_);
  y_ = y;
  u_ = u - pasting_->known(y, 0.0);
  for (std::size_t i = 0; i < feeds_.size(); ++i) feeds_[i].start(pasting_->feeds[i].rest);
}

double Runner::update(double y, double target, const std::vector<double>& w) {
  motion_ = {};
  fed_ = 0.0;
  double known = 0.0;
  std::visit(
      [&](auto& profile) {
        profile.update(target);
        const auto motion = profile.motion();
        if constexpr (requires { profile.feed(); }) known = profile.feed();
        for (int i = 0; i < motion.rows(); ++i) motion_[static_cast<std::size_t>(i)] = motion(i);
      },
      profile_);
  const double from_rest = y - y_;
  double u = u_ + form_.y_to_u(0, 0) * from_rest - weights_[0] * y_;
  for (std::size_t i = 0; i < weights_.size(); ++i) u += weights_[i] * motion_[i];
  const int n = form_.states();
  for (int i = 0; i < n; ++i) u += form_.to_u(0, i) * state_[static_cast<std::size_t>(i)];
  for (std::size_t i = 0; i < feeds_.size(); ++i)
    fed_ += feeds_[i].update(i < w.size() ? w[i] : std::nan(""));
  known += pasting_->known(motion_[0], motion_[1]) + fed_;
  const double more = pasting_->reach();
  u = std::clamp(std::clamp(u, lower_ - more, upper_ + more) + known, lower_, upper_);
  std::vector<double> next = state_;
  for (int i = 0; i < n; ++i) {
    double& sum = next[static_cast<std::size_t>(i)];
    // The observer is given u without what is known.
    sum += form_.from_y(i, 0) * from_rest + form_.from_u(i, 0) * (u - known - u_);
    for (int j = 0; j < n; ++j) sum += form_.a(i, j) * state_[static_cast<std::size_t>(j)];
  }
  state_ = next;
  return u;
}

namespace {

/// A step on the machine that was found. @param control u of (y, target), and what of it the
/// machine does not feel, as what is measured acts the other way
template <class Control>
StepOfCode simulated_step(const Pasting& pasting, const TuneModel& model, double height,
                          double duration, double noise, int digits, const Acting* measured,
                          Control&& control) {
  const double T = model.sample_time;
  StepOfCode step;
  step.height = height;
  esokit::sim::Gaussian gaussian(7);
  const auto controller = [&](double y, double) {
    const bool on = static_cast<int>(step.y.size()) >= (digits > 0 ? still : 0);
    step.y.push_back(y);
    const auto [u, fed] = control(y, pasting.start_y + (on ? height : 0.0));
    step.u.push_back(u);
    return u - fed;
  };
  const auto plant = machine(pasting, model, measured);
  auto rest = MachineState::Zero();
  rest(0) = pasting.start_y;
  rest(most_states - 1) = pasting.start_u;
  const auto result =
      esokit::sim::run(plant, controller,
                       {.duration = std::max(1.0, std::floor(duration / T)) * T,
                        .sample_time = T,
                        .sensor =
                            [&](double, double y) {
                              const double seen = y + noise * gaussian.next();
                              if (digits == 0) return seen;
                              char text[40];
                              std::snprintf(text, sizeof text, "%.*g", digits, seen);
                              return std::strtod(text, nullptr);
                            },
                        .dead_time = model.dead_time,
                        .substeps = 8,
                        .initial_input = pasting.start_u,
                        .state = rest});
  if (!result) return step;
  for (std::size_t k = 0; k < step.y.size(); ++k) {
    const double at = (step.y[k] - pasting.start_y) / height;
    if (std::abs(at - 1) > 0.02) step.settling = static_cast<double>(k + 1) * T;
    step.overshoot = std::max(step.overshoot, at - 1);
  }
  return step;
}

}  // namespace

StepOfCode step_of_code(const Pasting& pasting, const Tuning& tuning, const TunedDesign& design,
                        double height, double duration, double noise, int digits,
                        const Acting* measured) {
  Runner runner(pasting, tuning, design);
  runner.start(pasting.start_y, pasting.start_u);
  std::size_t k = 0;
  return simulated_step(pasting, tuning.model, height, duration, noise, digits, measured,
                        [&](double y, double target) {
                          std::vector<double> w;
                          for (std::size_t i = 0; i < pasting.feeds.size(); ++i) {
                            if (measured != nullptr) {
                              const auto& all = measured->w[i];
                              w.push_back(all[std::min(k, all.size() - 1)]);
                            }
                            if (digits > 0)
                              w.push_back(checked_w(pasting.feeds[i], static_cast<int>(k)));
                          }
                          ++k;
                          const double u = runner.update(y, target, w);
                          // What is measured acts as u without it does.
                          return std::pair(u, measured == nullptr ? runner.fed() : 0.0);
                        });
}

StepOfCode step_of_pid(const Pasting& pasting, const esokit::TuneModel& model,
                       const esokit::PlainPidConfig& config, double height, double duration) {
  auto pid = esokit::PlainPid::make(config).value();
  pid.start(pasting.start_y, pasting.start_y, pasting.start_u);
  return simulated_step(
      pasting, model, height, duration, 0.0, 0, nullptr,
      [&](double y, double target) { return std::pair(pid.update(y, target), 0.0); });
}

std::string pasted_code(const Pasting& p, const Tuning& tuning, const TunedDesign& design,
                        const esokit::FitData& rows) {
  const TuneModel& model = tuning.model;
  const double T = model.sample_time;
  const auto parts = esokit::detail::controller_source(design, model);
  const Watch watch = watch_of(tuning, design, rows);
  const std::string highest = derivative_of("y", p.order);
  const auto gains = static_cast<int>(design.settings.gains.size());
  const std::string limits_of_u = ".limits = {.lower = " + source(model.u_min - p.reach()) +
                                  ", .upper = " + source(model.u_max + p.reach()) +
                                  "}, .missing = {.input = " + source(model.safe_input()) + "}, " +
                                  parts.soften;
  const bool known = p.feeds_forward();

  std::string body;
  body += comment("The observer finds d of " + highest +
                  " = b0 u + d: loads, friction, gravity, errors of b0. " + p.not_known);
  std::string type = "esokit::OutlierGate<" + parts.observer + ">";
  if (watch.guarded) type = "esokit::Guarded<" + type + ">";
  body += wrapped("using Observer = " + type + ";", "", "    ");
  if (!p.feeds.empty()) {
    body +=
        "\n" + comment(
                   "What a measured disturbance asks of u: gain, lag and dead time beside those "
                   "of u. One that is lost (NaN, or not given) is held.");
    body +=
        "template <int Samples>\n"
        "struct Feed {\n"
        "  double rest, factor, at_once, decay, part;\n"
        "  double given = std::numeric_limits<double>::quiet_NaN();\n"
        "  double held = rest, before = 0.0, v = 0.0;\n"
        "  int lost = 0;  // samples in succession\n"
        "  std::array<double, Samples> past{};\n\n"
        "  void start() {\n"
        "    if (esokit::is_finite(given)) held = given;\n"
        "    before = v = held - rest;\n"
        "    past.fill(before);\n"
        "  }\n"
        "  double update() {\n"
        "    const bool good = esokit::is_finite(given);\n"
        "    if (good) held = given;\n"
        "    lost = good ? 0 : std::min(lost + 1, 65535);\n"
        "    given = std::numeric_limits<double>::quiet_NaN();\n"
        "    std::copy_backward(past.begin(), past.end() - 1, past.end());\n"
        "    past[0] = held - rest;\n"
        "    const double x = (1.0 - part) * past[Samples - 2] + part * past[Samples - 1];\n"
        "    v = decay * v + (1.0 - decay) * 0.5 * (before + x);\n"
        "    before = x;\n"
        "    return factor * (at_once * x + (1.0 - at_once) * v);\n"
        "  }\n"
        "};\n";
  }
  const bool curved = p.actuator.curved();
  body += "\nstruct Loop {\n";
  if (curved) body += "  esokit::ActuatorMap<> actuator;  // from the effect to u\n";
  body += "  esokit::Adrc<Observer> controller;\n";
  const bool approaches = p.order == 1;
  const std::string profile =
      approaches ? "esokit::ApproachProfile<" + std::to_string(gains) + ", " +
                       std::to_string(static_cast<int>(p.dead_time / T + 0.5)) + ">"
                 : "esokit::SmoothProfile<" + std::to_string(gains) + ">";
  body += "  " + profile + " profile;\n";
  body +=
      "  esokit::HealthMonitor<" + std::to_string(model.order + design.extension) + "> monitor;\n";
  if (known) body += "  double fed = 0.0;  // the part of the last u that is known\n";
  std::string fed, starts, gives, arguments, names;
  for (std::size_t i = 0; i < p.feeds.size(); ++i) {
    const Feed& feed = p.feeds[i];
    const std::string number = std::to_string(i + 1), name = "feed" + number;
    body +=
        wrapped("Feed<" + std::to_string(feed.samples()) + "> " + name +
                    "{.rest = " + source(feed.rest) + ", .factor = " + source(feed.factor) +
                    ", .at_once = " + source(feed.at_once) + ", .decay = " + source(feed.decay) +
                    ", .part = " + source(feed.delay - std::floor(feed.delay)) + "};  // of '" +
                    feed.name + "'",
                "  ", "    ");
    fed += (fed.empty() ? "" : " + ") + name + ".update()";
    starts += "    " + name + ".start();\n";
    gives += "    " + name + ".given = w" + number + ";\n";
    arguments += (arguments.empty() ? "double w" : ", double w") + number;
    names += (names.empty() ? "'" : ", '") + feed.name + "'";
  }
  body += "\n  // Once, at start-up. Nothing if a setting breaks a rule, which is printed.\n";
  body += "  static std::optional<Loop> make() {\n";
  body += "    const auto controller = esokit::Adrc<Observer>::make(\n";
  const std::string gate = "{.observer = {" + parts.config + "},";
  const std::string threshold = ".threshold = " + source(watch.threshold);
  if (watch.guarded) {
    body += "        {.observer =\n";
    body += wrapped("{.observer = " + gate, "             ", " ");
    body += comment(
        "y: an innovation beyond it is an outlier; twice the largest of the log and "
        "of the overloads that were simulated",
        "              ");
    body += "              " + threshold + "},\n";
    body += comment(highest + ": dhat is not believed beyond it; twice the largest, as above",
                    "             ");
    body += "             .disturbance_bound = " + source(watch.bound) + "},\n";
  } else {
    body += "        {.observer =\n";
    body += wrapped(gate, "             ", " ");
    body += comment(
        "y: an innovation beyond it is an outlier; twice the largest of the log and "
        "of the overloads that were simulated. dhat has no bound: this observer is not "
        "proven with one",
        "              ");
    body += "              " + threshold + "},\n";
  }
  body += wrapped(parts.law + ",", "         ", " ");
  body += comment(
      "u: its limits, and where it goes if y stays away for long. Choose it: a lifting axis needs "
      "the u at which it rests, or zero and a brake.",
      "         ");
  body += wrapped(limits_of_u + "});", "         ", " ");
  if (approaches) {
    body += comment(
        "To any target, which may change at any time: at nine tenths of the speed that the limits "
        "of u leave, and with this bandwidth at the end. It adds to u what the machine needs" +
            std::string(p.pole > 0.0 ? ", also at rest." : "."),
        "    ");
    body += "    const auto profile = " + profile + "::make(\n";
    body += wrapped("{.pole = " + source(p.pole) +
                        (gains == 2 ? ", .lag = " + source(model.lag) : std::string()) +
                        ", .input_gain = " + source(p.input_gain) + ", .limits = {.lower = " +
                        source(model.u_min) + ", .upper = " + source(model.u_max) +
                        "}, .dead_time = " + source(p.dead_time) + ", .bandwidth = " +
                        source(p.approach(model, gains)) + ", .sample_time = " + source(T) + "});",
                    "        ", " ");
  } else {
    body += comment("From rest to rest, with all derivatives: largest abs(r'), .., abs(r" +
                        std::string(static_cast<std::size_t>(gains), '\'') + "), 0 is none. " +
                        highest + " needs what the forces of the log leave of u, less a tenth.",
                    "    ");
    body += "    const auto profile = " + profile + "::make(\n";
    body += "        {.limits = {{" + list(p.limits(model, design.settings.gains.size())) +
            "}}, .shortest_time = " + source(p.shortest) + ", .sample_time = " + source(T) +
            "});\n";
  }
  body += comment("The noise is that which makes the innovations of the log.", "    ");
  body += "    const auto monitor = esokit::HealthMonitor<" +
          std::to_string(model.order + design.extension) + ">::make(\n";
  body += wrapped(
      "{.observer_bandwidth = " + source(watch.bandwidth) + ", .sample_time = " + source(T) +
          ", .input_range = " + source(printed(0.5 * (model.u_max - model.u_min))) +
          ", .noise = " + source(watch.noise) + ", .latency = " + source(watch.latency) +
          ", .memory = " + source(watch.memory) + ", .divider = " + std::to_string(watch.divider) +
          "});",
      "        ", " ");
  body +=
      "    const auto fails = [](const auto& made) {\n"
      "      if (!made) std::printf(\"%s: %s\\n\", made.error().field, made.error().rule);\n"
      "      return !made;\n"
      "    };\n"
      "    if (fails(controller) || fails(profile) || fails(monitor)) return {};\n";
  if (curved) {
    body += comment("The curve that the log tells, and the u with an effect.", "    ") +
            "    const auto actuator = " + p.actuator.made() +
            ";\n    if (fails(actuator)) return {};\n";
  }
  body += std::string("    return Loop{") + (curved ? "*actuator, " : "") +
          "*controller, *profile, *monitor};\n"
          "  }\n";
  const bool damps = p.order == 2 && p.pole > 0.0;
  const bool along = p.friction > 0.0 || p.by_position || damps;
  if (along) {
    std::string what = p.friction > 0.0 ? "friction" : "";
    if (damps) what += std::string(what.empty() ? "" : " and ") + "damping";
    if (p.by_position) what += std::string(what.empty() ? "" : " and ") + "the force by y";
    body += "\n" + comment("What " + what +
                               (what.find(" and ") != std::string::npos ? " need" : " needs") +
                               " of u along the reference. By the reference, not by y: so it "
                               "changes no margin.",
                           "  ");
    body += "  static double known([[maybe_unused]] double r, [[maybe_unused]] double rate) {\n";
    body += "    double force = 0.0;  // " + highest + "\n";
    if (p.friction > 0.0) {
      body += "    force += " + source(p.friction) + " * std::tanh(" +
              (p.order == 1 ? "r" : "rate") + " / " + source(p.friction_scale) + ");\n";
    }
    if (damps) body += "    force += " + source(p.pole) + " * rate;\n";
    if (p.by_position) {
      // As printed, and as it is computed here.
      body += "    const double x = (std::clamp(r, " + source(p.force.low) + ", " +
              source(p.force.high) + ") - " +
              (p.force.middle < 0 ? "(" + source(p.force.middle) + ")" : source(p.force.middle)) +
              ") / " + source(p.force.size) + ";\n";
      body += "    force -= x * (" + source(p.force.factors[0].value) + " + x * (" +
              source(p.force.factors[1].value) + " + x * " + source(p.force.factors[2].value) +
              "));\n";
    }
    body += "    return force / " + source(p.input_gain) + ";\n  }\n";
  }
  if (!p.feeds.empty()) {
    body += "\n" + comment("Before start and before each update: " + names +
                               ". One that is NaN, or of a sample without this call, is lost: the "
                               "last one is held, and lost counts.",
                           "  ");
    body += "  void measured(" + arguments + ") {\n" + gives + "  }\n";
  }
  body += "\n  // Once, while the machine rests at y under u_now: takes over without a bump.\n";
  std::string fed_at_start = along ? "known(y, 0.0)" : "";
  for (std::size_t i = 0; i < p.feeds.size(); ++i) {
    const std::string name = "feed" + std::to_string(i + 1);
    fed_at_start += (fed_at_start.empty() ? "" : " + ") + name + ".factor * " + name + ".before";
  }
  body += std::string("  void start(double y, double u_now) {\n") +
          (curved ? "    u_now = actuator.effect(u_now);\n" : "") +
          (approaches ? "    profile.start(y, u_now);\n" : "    profile.reset(y);\n") + starts +
          (known ? "    fed = " + (fed_at_start.empty() ? "0.0" : fed_at_start) +
                       ";\n    controller.start(y, u_now - fed);\n"
                 : "    controller.start(y, u_now);\n") +
          "    monitor.clear();\n  }\n";
  body +=
      "\n" +
      comment(
          "Once a sample. y is measured, NaN where it is missing; target is where y shall go" +
              std::string(approaches ? "" : ": a new one begins a move, at the end of the last") +
              ". Returns u, to be held until the next call.",
          "  ");
  body += "  double update(double y, double target) {\n    profile.update(target);\n";
  std::string more = approaches ? "profile.feed()" : "";
  if (along) more += (more.empty() ? "" : " + ") + std::string("known(r(0), r(1))");
  if (!fed.empty()) more += (more.empty() ? "" : " + ") + fed;
  if (known) {
    body +=
        "    const auto r = profile.motion();  // (r, r', ..)\n"
        "    const double more = " +
        more +
        ";\n"
        "    const double of_law = controller.update(y, r);\n"
        "    // Without y nothing is added.\n"
        "    fed = controller.mode() == esokit::LoopMode::safe ? 0.0 : more;\n"
        "    const double u = std::clamp(of_law + fed, " +
        source(model.u_min) + ", " + source(model.u_max) +
        ");\n"
        "    // The law's part of what goes out: the observer and the monitor see these limits, "
        "too.\n"
        "    // If the actuator reports what it held, say " +
        (curved ? "its effect" : "that") +
        " less fed before the next update.\n"
        "    controller.applied(u - fed);\n";
  } else {
    body += "    // If the actuator reports what it really held, say controller.applied(" +
            std::string(curved ? "actuator.effect(..)" : "..") +
            ") before.\n"
            "    const double u = controller.update(y, profile.motion());\n";
  }
  body +=
      "    monitor.look(controller);\n"
      "    // Now and then: esokit::diagnose(monitor.health()) is LoopFault::none, or names the\n"
      "    // fault (advice of analysis/health_text.hpp says what to do). wrong_sign,\n"
      "    // gain_too_small: set u to its safe value. measurements_rejected: look at the sensor.\n"
      "    // controller.mode() is LoopMode::safe where measurements are missing for long.\n"
      "    return " +
      p.actuator.from("u") + ";\n  }\n};\n\n";

  // The self-check: a step that takes about 60 samples, if u can hold its end.
  double height =
      p.limits(model, design.settings.gains.size())[static_cast<std::size_t>(p.order - 1)];
  const std::array<double, 3> peaks{esokit::smooth_step_peaks<1>[0],
                                    esokit::smooth_step_peaks<2>[1],
                                    esokit::smooth_step_peaks<3>[2]};
  height /= peaks[static_cast<std::size_t>(p.order - 1)];
  for (int i = 0; i < p.order; ++i) height *= 60 * T;
  const double half = 0.5 * (model.u_max - model.u_min);
  if (p.order == 1 && std::abs(model.pole) > 0.0) {
    height = std::min(height, 0.2 * half * std::abs(p.input_gain / model.pole));
  }
  height = std::strtod(number_text(height, 3).c_str(), nullptr);
  const double target = printed(p.start_y + height);
  const auto simulated =
      step_of_code(p, tuning, design, target - p.start_y, checked * T, model.noise, 9);
  std::string samples;
  for (std::size_t k = 0; k < checked && k < simulated.y.size(); ++k) {
    char text[80];
    std::snprintf(text, sizeof text, "{%.9g,%.10g}", simulated.y[k],
                  p.actuator.input(simulated.u[k]));
    samples += (k > 0 ? ", " : "") + std::string(text);
  }
  body +=
      comment("The first " + std::to_string(checked) +
              " samples of a step on the machine that was found, as from_log simulated it: y with "
              "its noise, and u.");
  body += "constexpr double samples[" + std::to_string(checked) + "][2] = {\n" +
          wrapped(samples + "};", "    ");
  body += "\n" + comment(
                     "0 if this program computes the same u, else 1. Compilers may order and fuse "
                     "operations otherwise (-ffast-math): that changes u by less than 1e-9 of its "
                     "range. A wrong setting changes it more.");
  std::string given;
  for (const Feed& feed : p.feeds) {
    given += (given.empty() ? "" : ", ") + std::string("k < ") + std::to_string(w_moves) +
             " || k >= " + std::to_string(w_back) + " ? " + source(feed.rest) + " : " +
             source(checked_w(feed, w_moves));
  }
  if (!given.empty()) {
    given = "    if (k < " + std::to_string(w_lost) + " || k >= " + std::to_string(w_back) +
            ")  // else it is lost\n" + wrapped("loop->measured(" + given + ");", "      ", "  ");
  }
  body +=
      "int self_check() {\n"
      "  auto loop = Loop::make();\n"
      "  if (!loop) return 1;\n"
      "  loop->start(" +
      source(p.start_y) + ", " + (curved ? exact(p.actuator.input(p.start_u)) : source(p.start_u)) +
      ");\n"
      "  for (int k = 0; k < " +
      std::to_string(checked) + "; ++k) {\n" + given +
      "    const double u = loop->update(samples[k][0], k < " + std::to_string(still) + " ? " +
      source(p.start_y) + " : " + source(target) +
      ");\n"
      "    if (std::abs(u - samples[k][1]) < " +
      source(1e-8 * half * p.actuator.steepest()) +
      ") continue;\n"
      "    std::printf(\"self-check: sample %d: u is %.9g, not %.9g\\n\", k, u, "
      "samples[k][1]);\n"
      "    return 1;\n"
      "  }\n"
      "  std::puts(\"self-check: ok\");\n"
      "  return 0;\n"
      "}\n\n"
      "int main() {\n"
      "  return self_check();\n"
      "}\n";
  return p.head + "#include <algorithm>\n" + (p.feeds.empty() ? "" : "#include <array>\n") +
         "#include <cmath>\n#include <cstdio>\n" + includes_of(body) +
         (p.feeds.empty() ? "" : "#include <limits>\n") + "#include <optional>\n\n" + body;
}

}  // namespace from_log
