/// @file
/// Plays a controller on the plant of a model, with limits and noise: does the loop come back from
/// an overload, or does it swing between the limits for ever?
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/control/softening.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/tune/problem.hpp>
#include <functional>
#include <utility>
#include <vector>

namespace esokit {

/// What happens to a loop that is played.
enum class PlayKind : unsigned char {
  load,  ///< a load for some time
  kick,  ///< all at once, what half the range of u does in this time to y^(n-1)
  step   ///< of the reference, as far as half the range of u moves the chain in this time
};

/// An event, in units of the model.
struct PlayEvent {
  PlayKind kind{};         ///< what it is
  double share = 1.0;      ///< of half the range of u
  double latencies = 0.0;  ///< multiples of TuneModel::latency
};

/// The events that a recommended design comes back from.
inline constexpr std::array<PlayEvent, 4> play_events{{{PlayKind::load, 1.5, 10.0},
                                                       {PlayKind::load, 1.5, 100.0},
                                                       {PlayKind::kick, 1.0, 30.0},
                                                       {PlayKind::step, 1.0, 30.0}}};

/// How a loop came through an event.
struct Played {
  bool counts = true;   ///< false: even the best controller would be lost
  bool back = false;    ///< y is near its reference again, and u off its limits
  double time = 0.0;    ///< s from the end of the event until then, or as long as was waited
  double peak = 0.0;    ///< largest abs(y - r)
  double beyond = 0.0;  ///< largest y - r beyond a step of the reference, share of the step
};

/// A law that softens at its limits, for a controller that is played: what Softening needs to know.
struct PlayedLaw {
  std::vector<double> gains{};          ///< k_0 ..; none: the linear law
  double input_gain = 1.0;              ///< of the law
  DynamicMatrix<double> to_estimate{};  ///< as in LinearObserverForm, with the controller's states
  DynamicMatrix<double> y_to_estimate{};  ///< as in LinearObserverForm
};

/// Friction that is played where it is not known, shares of what half the range of u makes of y''
/// in ten latencies.
inline constexpr std::array<double, 5> played_frictions{0.05, 0.1, 0.15, 0.2, 0.25};

/// The plants that a design is played on: the model, what its intervals allow, and for order 3 the
/// model with friction.
inline std::vector<detail::PlantVariant> played_variants(const TuneModel& model) {
  std::vector<detail::PlantVariant> all;
  const auto take = [&](detail::PlantVariant variant, double friction) {
    variant.model.friction = friction;
    all.push_back(std::move(variant));
  };
  take({model, 1.0}, 0.0);
  const auto ends = detail::plant_variants(model);
  for (const auto& variant : ends) take(variant, 0.0);
  if (!model.may_rub()) return all;
  std::vector<double> frictions;
  const double unit =
      5.0 * (model.u_max - model.u_min) * (std::abs)(model.input_gain.value) * model.latency();
  for (const double share : played_frictions) frictions.push_back(share * unit);
  if (model.friction) frictions = {*model.friction};
  for (const double friction : frictions) {
    take({model, 1.0}, friction);
    // Late, and with the least of b0.
    if (ends.size() > 1) take(ends[1], friction);
  }
  return all;
}

/// The events with friction: also what moves y so little that it sticks.
inline constexpr std::array<PlayEvent, 3> friction_events{
    {{PlayKind::load, 0.5, 10.0}, {PlayKind::load, 1.0, 10.0}, {PlayKind::step, 1.0, 30.0}}};

/// The events of one of these plants.
inline std::vector<PlayEvent> played_events(const TuneModel& variant) {
  if (variant.friction.value_or(0.0) > 0.0) return {friction_events.begin(), friction_events.end()};
  return {play_events.begin(), play_events.end()};
}

/// Order 3: whether friction, however small, makes the loop swing for ever. On a motion of y' of
/// amplitude A friction f acts as a damping 4 f / (pi A) (describing function), so the loop has to
/// be stable with any: searched for from 1 / 100 to 3000 per TuneModel::latency.
inline bool swings_with_friction(const TuneModel& model, const LinearController& controller) {
  // Largest first: behind an actuator that integrates that tells it.
  for (int i = 7; i >= -4; --i) {
    auto plant = detail::dense_plant(model);
    plant.a(1, 1) = -std::pow(10.0, 0.5 * i) / model.latency();
    const auto loop = Loop::make(plant, controller);
    if (!loop || !loop->stable()) return true;
  }
  return false;
}

namespace detail {

/// The told form of a controller that has its own u as the applied u: within limits, the applied u
/// is another one.
inline LinearController told_of_input(const LinearController& own) {
  LinearController c = own;
  double told = 0.0;
  for (int i = 0; i < c.states(); ++i) told += (std::abs)(c.from_u(i, 0));
  if (told > 0.0) return c;
  // A reference reaches the states by u alone.
  for (int i = 0; i < c.states(); ++i) {
    c.from_u(i, 0) = own.from_r(i, 0) / own.r_to_u(0, 0);
    c.from_r(i, 0) = 0.0;
    c.from_y(i, 0) -= c.from_u(i, 0) * c.y_to_u(0, 0);
    for (int j = 0; j < c.states(); ++j) c.a(i, j) -= c.from_u(i, 0) * c.to_u(0, j);
  }
  return c;
}

/// u of the softened law, from u of the linear one, y, r and the states; empty for a linear law.
using SoftenedInput =
    std::function<double(double u, double y, double r, const std::vector<double>& z)>;

template <int Order>
SoftenedInput softened_input(const PlayedLaw& played, double T, double half) {
  typename AdrcLaw<Order>::Config config{};
  config.gains.emplace();
  std::copy_n(played.gains.begin(), Order, config.gains->begin());
  config.input_gain = played.input_gain;
  const auto law = AdrcLaw<Order>::make(config);
  const Limits<double> limits{.lower = -half, .upper = half};
  const auto limiter = Limiter<double>::make(limits, T);
  if (!law || !limiter) return {};
  const auto made = Softening<Order>::make(*law, limits, true);
  if (!made) return {};
  return [played, T, law = *law, limiter = *limiter, soft = *made](
             double u, double y, double r, const std::vector<double>& z) mutable {
    if (soft.slowness() > 1.0) {
      Vector<double, Order + 1> lacks{};
      for (int i = 0; i <= Order; ++i) {
        lacks(i) = (i == 0 ? r : 0.0) - played.y_to_estimate(i, 0) * y;
        for (std::size_t j = 0; j < z.size(); ++j) {
          lacks(i) -= played.to_estimate(i, static_cast<int>(j)) * z[j];
        }
      }
      u = soft.control(law, lacks);
    }
    soft.judge(u, limiter, T);
    return u;
  };
}

inline SoftenedInput softened_input(const PlayedLaw& played, double T, double half) {
  switch (played.gains.size()) {
    case 1:
      return softened_input<1>(played, T, half);
    case 2:
      return softened_input<2>(played, T, half);
    case 3:
      return softened_input<3>(played, T, half);
    case 4:
      return softened_input<4>(played, T, half);
    default:
      return {};
  }
}

/// A controller and a plant within limits, sample by sample.
class PlayLoop {
 public:
  PlayLoop(const TuneModel& model, double gain, const LinearController& told, double half,
           const PlayedLaw& law = {})
      : plant_(sampled_plant(dense_plant(model, gain), model.sample_time)),
        c_(told),
        half_(half),
        x_(static_cast<std::size_t>(plant_.a.rows())),
        z_(static_cast<std::size_t>(told.states())),
        next_((std::max)(x_.size(), z_.size())),
        held_(static_cast<std::size_t>(plant_.whole[0]) + 2),
        soften_(softened_input(law, model.sample_time, half)) {
    if (model.order != 3 || !(model.friction.value_or(0.0) > 0.0)) return;
    // The states of the sampled plant have other units.
    const double T = model.sample_time;
    const DensePlant plant = dense_plant(model, gain);
    const auto d = held_for(plant.a, plant.e, T).input;
    const auto unit = [&](int i) { return d(i, 0) / plant_.e(i, 0); };
    rub_ = *model.friction * T / unit(1);
    slid_ = 0.5 * T * unit(1) / unit(0);
  }

  [[nodiscard]] double output() const {
    double y = 0.0;
    for (std::size_t i = 0; i < x_.size(); ++i) y += plant_.c(0, static_cast<int>(i)) * x_[i];
    return y;
  }

  /// One sample. @param y as measured @param d unit of y^(n) @param more added to u, for the
  /// derivatives of r (not softened) @return u
  double operator()(double y, double r, double d, double more = 0.0) {
    double u = c_.y_to_u(0, 0) * y + c_.r_to_u(0, 0) * r;
    const int states = c_.states();
    for (int i = 0; i < states; ++i) u += c_.to_u(0, i) * z_[static_cast<std::size_t>(i)];
    if (soften_) u = soften_(u, y, r, z_);
    u = std::clamp(u + more, -half_, half_);
    advance(z_, c_.a,
            [&](int i) { return c_.from_y(i, 0) * y + c_.from_r(i, 0) * r + c_.from_u(i, 0) * u; });
    held_[at_] = u;
    const double now = held_[(at_ + 2) % held_.size()];
    const double before = held_[(at_ + 1) % held_.size()];
    at_ = (at_ + 1) % held_.size();
    advance(x_, plant_.a, [&](int i) {
      return plant_.now(i, 0) * now + plant_.before(i, 0) * before + plant_.e(i, 0) * d;
    });
    if (rub_ > 0.0) rub();
    return u;
  }

 private:
  /// x += a x + input
  template <class Input>
  void advance(std::vector<double>& x, const DynamicMatrix<double>& a, const Input& input) {
    const int n = a.rows();
    for (int i = 0; i < n; ++i) next_[static_cast<std::size_t>(i)] = input(i);
    for (int j = 0; j < n; ++j) {
      const double value = x[static_cast<std::size_t>(j)];
      for (int i = 0; i < n; ++i) next_[static_cast<std::size_t>(i)] += a(i, j) * value;
    }
    for (std::size_t i = 0; i < x.size(); ++i) x[i] += next_[i];
  }

  /// Coulomb friction over the sample, which takes from y' what it can, and from y half a sample
  /// of it.
  void rub() {
    const double less = std::clamp(x_[1], -rub_, rub_);
    x_[1] -= less;
    x_[0] -= slid_ * less;
  }

  SampledPlant plant_;
  LinearController c_;
  double half_, rub_ = 0.0, slid_ = 0.0;
  std::vector<double> x_, z_, next_, held_;
  std::size_t at_ = 0;
  SoftenedInput soften_;
};

}  // namespace detail

/// How far an event goes: what its share of half the range of u moves the chain in its time; of
/// order 1 at most 60 % of what u holds against the pole. @param gain factor on b0 of the plant
inline double play_distance(const TuneModel& model, double gain, const PlayEvent& event) {
  const double force =
      0.5 * (model.u_max - model.u_min) * (std::abs)(gain * model.input_gain.value);
  double distance = event.share * force;
  for (int i = 1; i <= model.order; ++i) distance *= event.latencies * model.latency() / i;
  const double pull = (std::abs)(model.pole);
  return model.order == 1 && pull > 0.0 ? (std::min)(distance, 0.6 * force / pull) : distance;
}

/// Plays one event from rest, with u about the middle of its range and the noise of the model.
/// Back is: y within 2 % of its peak and four deviations of the noise, and u mostly off its limits,
/// for a settling time; this within 25 times the length of the event and 10 settling times. With
/// friction for two settling times, within 10.
/// @param gain factor on b0 of the plant, not of the controller
/// @param settling_time of the linear loop, s
/// @param on_sample called as on_sample(t, r, y, u) once a sample
/// @param law of a controller that softens at its limits
template <class Callback>
Played play(const TuneModel& model, double gain, const LinearController& controller,
            const PlayEvent& event, double settling_time, const Callback& on_sample,
            const PlayedLaw& law = {}) {
  const double T = model.sample_time;
  const double latency = model.latency();
  const double half = 0.5 * (model.u_max - model.u_min);
  const double force = (std::abs)(gain * model.input_gain.value) * half;
  const double length = event.latencies * latency;
  Played result;
  const double pull = (std::abs)(model.pole);
  // Below 60 % of what u brings back.
  if (model.pole < 0.0) {
    const double grown = event.kind == PlayKind::kick ? event.share * length * pull
                         : event.kind == PlayKind::load
                             ? std::expm1(pull * length) * (std::max)(event.share - 1.0, 0.0) +
                                   event.share * pull * latency
                             : 0.0;
    result.counts = grown < 0.6;
    if (!result.counts) return result;
  }
  detail::PlayLoop loop(model, gain, detail::told_of_input(controller), half, law);
  sim::Gaussian gaussian(1);
  const double r = event.kind == PlayKind::step ? play_distance(model, gain, event) : 0.0;
  const auto samples_of = [T](double time) {
    return static_cast<long>((std::min)(std::ceil(time / T), 1e6));
  };
  const long pushed = event.kind == PlayKind::load   ? samples_of(length)
                      : event.kind == PlayKind::kick ? 1
                                                     : 0;
  const double d = event.share * force * (event.kind == PlayKind::kick ? length / T : 1.0);
  // Friction holds for long, and then y moves again.
  const bool rubs = model.friction.value_or(0.0) > 0.0;
  const long last =
      pushed + (std::min)(samples_of((rubs ? 0.0 : 25.0 * length) + 10.0 * settling_time), 200000L);
  const long quiet =
      (std::min)(samples_of((rubs ? 2.0 : 1.0) * (std::max)(settling_time, 20.0 * latency)),
                 rubs ? 16000L : 4000L);
  long since = 0, at_limits = 0;
  for (long k = 0; k < last; ++k) {
    const double y = loop.output();
    const double u = loop(y + model.noise * gaussian.next(), r, k < pushed ? d : 0.0);
    on_sample(static_cast<double>(k) * T, r, y, u);
    if (!is_finite(y)) return result;
    result.peak = (std::max)(result.peak, (std::abs)(y - r));
    if (r > 0.0) result.beyond = (std::max)(result.beyond, (y - r) / r);
    if (k < pushed || (std::abs)(y - r) > 0.02 * result.peak + 4.0 * model.noise) {
      since = k + 1;
      at_limits = 0;
      continue;
    }
    at_limits += (std::abs)(u) >= half ? 1 : 0;
    if (k - since < quiet) continue;
    if (4 * at_limits <= quiet) {
      result.back = true;
      result.time = static_cast<double>(since - pushed) * T;
      return result;
    }
    since = k + 1;
    at_limits = 0;
  }
  result.time = static_cast<double>(last - pushed) * T;
  return result;
}

}  // namespace esokit
