/// @file
/// Random plants that a design is simulated on: what no model has in it (friction, gravity, a
/// second lag, an encoder), behind the limits of an actuator.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include <esokit/control/smooth_profile.hpp>
#include <esokit/tune/specification.hpp>

namespace overload_example {

/// A number of [0, 1) and a normal one from a seed, the same with every standard library.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : generator_(seed) {}
  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(generator_() >> 11) * 0x1p-53);
  }
  double decades(double low, double high) { return std::pow(10.0, between(low, high)); }
  bool with(double probability) { return between(0.0, 1.0) < probability; }
  double sign() { return with(0.5) ? 1.0 : -1.0; }
  double normal() {
    return std::sqrt(-2.0 * std::log(1.0 - between(0.0, 1.0))) *
           std::cos(2.0 * std::numbers::pi * between(0.0, 1.0));
  }

 private:
  std::mt19937_64 generator_;
};

/// y^(n) = -a y^(n-1) + b v + d, and on y'' of a machine of order 2 or 3 (on y' of order 1)
/// Coulomb friction; gravity on y'' of orders 2 and 3. v follows u through a dead time and two
/// lags, y is measured through a lag, with noise, in steps of an encoder.
struct Machine {
  int order = 1;
  double b = 1.0, pole = 0.0, friction = 0.0;
  double gravity = 0.0, gravity_length = 1.0, gravity_angle = 0.0;  ///< above 0: inverted
  double lag = 0.0, second_lag = 0.0, sensor_lag = 0.0, dead_time = 0.0;
  double noise = 0.0, resolution = 0.0;
  double half_range = 1.0, middle = 0.0, T = 1.0;
  double latency = 1.0;  ///< all that u and y need

  /// Force of gravity, unit of y'' (of y' for order 1: none).
  [[nodiscard]] double pull(double y) const {
    return gravity * std::sin(y / gravity_length + gravity_angle);
  }
  /// The u that holds the machine at y, without friction.
  [[nodiscard]] double held_at(double y) const {
    return order == 1 ? pole * y / b : -(order == 3 ? pole : 1.0) * pull(y) / b;
  }
  [[nodiscard]] double upper() const { return middle + half_range; }
  [[nodiscard]] double lower() const { return middle - half_range; }
  /// How far half of the range moves the chain in 30 latencies.
  [[nodiscard]] double reach() const {
    double way = std::abs(b) * half_range;
    for (int i = 1; i <= order; ++i) way *= 30.0 * latency / i;
    return way;
  }
  /// Rate at which gravity lets it fall at y, 1/s; 0: it does not.
  [[nodiscard]] double falls(double y) const {
    const double slope = gravity / gravity_length * std::cos(y / gravity_length + gravity_angle);
    return order >= 2 && slope > 0.0 ? std::sqrt(slope) : 0.0;
  }
};

/// Machine `number` of a seed, and what a log would have shown of it.
struct Drawn {
  Machine machine;
  esokit::TuneModel model;
};

inline Drawn drawn(std::uint64_t seed, std::uint64_t number) {
  Dice dice(seed * 1'000'003U + number);
  Drawn all;
  Machine& m = all.machine;
  m.order = 1 + static_cast<int>(number % 3);
  m.latency = dice.decades(-2.5, 0.5);
  m.T = m.latency / dice.decades(0.5, 1.5);
  // Shares of the latency: dead time, lag, second lag, sensor; half a sample is that of the hold.
  std::array<double, 4> share{dice.between(0.0, 1.0), dice.between(0.2, 1.0),
                              dice.with(0.6) ? dice.between(0.0, 0.4) : 0.0,
                              dice.with(0.4) ? dice.between(0.0, 0.3) : 0.0};
  const double sum = share[0] + share[1] + share[2] + share[3];
  for (double& s : share) s *= m.latency / sum;
  m.dead_time = share[0];
  m.lag = share[1];
  m.second_lag = share[2];
  m.sensor_lag = share[3];
  m.b = dice.sign() * dice.decades(-2.0, 3.0);
  m.half_range = dice.decades(-1.0, 2.0);
  m.middle = dice.with(0.2) ? dice.between(-0.5, 0.5) * m.half_range : 0.0;
  m.pole = dice.with(0.5) ? dice.decades(-2.0, -0.5) / m.latency : 0.0;
  const double most = std::abs(m.b) * m.half_range * (m.order == 3 ? 10.0 * m.latency : 1.0);
  m.friction = dice.with(0.5) ? dice.between(0.0, 0.25) * most : 0.0;
  if (m.order >= 2 && dice.with(0.5)) {
    m.gravity = dice.sign() * dice.between(0.1, 0.4) * most;
    m.gravity_length = std::abs(m.gravity) * std::pow(m.latency / dice.decades(-2.0, -0.9), 2.0);
    m.gravity_angle = dice.between(-1.2, 1.2);
  }
  constexpr std::array<double, 3> quietest{-4.0, -5.0, -6.5}, loudest{-2.3, -3.0, -4.0};
  const auto n = static_cast<std::size_t>(m.order - 1);
  m.noise = m.reach() * dice.decades(quietest[n], loudest[n]);
  m.resolution = dice.with(0.5) ? m.noise * dice.between(0.5, 5.0) : 0.0;
  const double deviation = std::hypot(m.noise, m.resolution / std::sqrt(12.0));
  const double filter = dice.decades(-3.0, -0.4) / m.latency;
  const double walk = deviation * deviation * m.T * std::pow(filter, 2 * m.order + 2);

  esokit::TuneModel& model = all.model;
  model.order = m.order;
  const double b_share = dice.decades(-2.5, -0.8);
  model.input_gain.value = m.b * (1.0 + 0.7 * b_share * dice.between(-1.0, 1.0));
  model.input_gain.half_width = b_share * std::abs(model.input_gain.value);
  model.pole = m.pole * dice.between(0.8, 1.2);
  model.latency_half_width = m.latency * dice.decades(-2.0, -0.8);
  model.lag_half_width = model.latency_half_width;
  const double seen = m.latency + 0.7 * model.latency_half_width * dice.between(-1.0, 1.0);
  model.lag = std::max(m.lag + 0.7 * model.lag_half_width * dice.between(-1.0, 1.0), 0.05 * seen);
  model.lag = std::min(model.lag, 0.95 * seen);
  model.dead_time = seen - model.lag;
  model.noise = deviation * dice.between(0.9, 1.1);
  model.disturbance = walk * dice.decades(-0.3, 0.3);
  model.sample_time = m.T;
  model.u_min = m.lower();
  model.u_max = m.upper();
  return all;
}

/// A machine that runs, from rest at y.
class Running {
 public:
  Running(const Machine& machine, double y, std::uint64_t seed)
      : m_(machine), dice_(seed), u_(machine.held_at(y)) {
    steps_ = std::max(1, static_cast<int>(std::ceil(m_.T / (m_.latency / 80.0))));
    h_ = m_.T / steps_;
    line_.assign(1 + static_cast<std::size_t>(std::lround(m_.dead_time / h_)), u_);
    x_[0] = y;
    if (m_.order == 3) x_[2] = -m_.pull(y);
    v1_ = v2_ = u_;
    seen_ = y;
  }

  /// The measurement now.
  double measured() {
    const double y = seen_ + m_.noise * dice_.normal();
    return m_.resolution > 0.0 ? m_.resolution * std::round(y / m_.resolution) : y;
  }
  [[nodiscard]] double y() const { return x_[0]; }
  /// How far the part of the state that falls at `rate` is from rest at y, in units of y: the left
  /// eigenvector of the machine, linear about y, times its state.
  [[nodiscard]] double falling(double y, double rate) const {
    const double z = x_[0] - y + x_[1] / rate;
    return m_.order == 3 ? z + (x_[2] + m_.pull(y)) / (rate * (rate + m_.pole)) : z;
  }
  /// Moves y^(n-1) at once.
  void kick(double more) { x_[static_cast<std::size_t>(m_.order - 1)] += more; }

  /// A sample under u. @param load unit of y^(n) @param free_of_lags u acts at once
  void sample(double u, double load, bool free_of_lags = false) {
    for (int i = 0; i < steps_; ++i) {
      line_[place_] = u;
      place_ = (place_ + 1) % line_.size();
      const double late = line_[place_];
      v1_ = follows(v1_, late, m_.lag);
      v2_ = follows(v2_, v1_, m_.second_lag);
      move(free_of_lags ? u : v2_, load);
      seen_ = follows(seen_, x_[0], m_.sensor_lag);
    }
  }

 private:
  [[nodiscard]] double follows(double x, double target, double lag) const {
    return lag > 0.05 * h_ ? target + (x - target) * std::exp(-h_ / lag) : target;
  }
  /// Speed after a step under a force, with friction that can hold it.
  [[nodiscard]] double with_friction(double speed, double force) const {
    if (!(m_.friction > 0.0)) return speed + h_ * force;
    const double without = speed + h_ * force;
    const double most = h_ * m_.friction;
    return std::abs(without) <= most ? 0.0 : without - std::copysign(most, without);
  }
  void move(double v, double load) {
    const double drive = m_.b * v + load;
    if (m_.order == 1) {
      // y is a speed: friction acts on it.
      x_[0] = with_friction(x_[0], drive - m_.pole * x_[0]);
    } else if (m_.order == 2) {
      x_[1] = with_friction(x_[1], drive - m_.pole * x_[1] + m_.pull(x_[0]));
      x_[0] += h_ * x_[1];
    } else {
      x_[2] += h_ * (drive - m_.pole * x_[2]);
      x_[1] = with_friction(x_[1], x_[2] + m_.pull(x_[0]));
      x_[0] += h_ * x_[1];
    }
  }

  Machine m_;
  Dice dice_;
  int steps_ = 1;
  double h_ = 0.0;
  std::array<double, 3> x_{};
  double u_, v1_ = 0.0, v2_ = 0.0, seen_ = 0.0;
  std::vector<double> line_;
  std::size_t place_ = 0;
};

/// What happens to a machine that its controller holds at `from`.
struct Event {
  std::string name;
  double load = 0.0, load_time = 0.0;  ///< unit of y^(n), s
  double kick = 0.0;                   ///< of y^(n-1)
  double target = 0.0;                 ///< reference from the event on
  bool profile = false;                ///< the reference moves there within the limits
  double off_time = 0.0;               ///< u does not reach the actuator, s
  double away = 0.0;                   ///< the machine starts there, the controller believes in 0
};

/// The events of the page: sizes are shares of what u can balance in that direction.
inline std::vector<Event> events(const Machine& m, Dice& dice) {
  const double hold = m.held_at(0.0);
  const double side = dice.sign();
  // A load of this sign is balanced by u towards the other limit.
  const bool to_upper = side * m.b < 0.0;
  const double room = std::abs(m.b) * (to_upper ? m.upper() - hold : hold - m.lower());
  std::vector<Event> all;
  for (const double share : {0.5, 0.9, 1.0, 1.5}) {
    for (const double latencies : {10.0, 100.0}) {
      all.push_back({.name = "load pulse of " + std::to_string(static_cast<int>(100 * share)) +
                             " % for " + std::to_string(static_cast<int>(latencies)) + " latencies",
                     .load = side * share * room,
                     .load_time = latencies * m.latency});
    }
  }
  all.push_back({.name = "kick", .kick = side * room * 30.0 * m.latency});
  const double far = side * 0.5 * m.reach();
  all.push_back({.name = "step", .target = far});
  all.push_back({.name = "profile", .target = far, .profile = true});
  all.push_back({.name = "actuator off", .off_time = 30.0 * m.latency});
  all.push_back({.name = "start from far away", .away = far});
  return all;
}

/// (r, r', .., r^(n)) of a move from 0 to `far` whose y^(n) stays below 0.4 of half the range.
class Profile {
 public:
  Profile(const Machine& m, double far) : far_(far), order_(m.order) {
    const double most = 0.4 * std::abs(m.b) * m.half_range;
    const double peak = m.order == 1   ? esokit::smooth_step_peaks<1>[0]
                        : m.order == 2 ? esokit::smooth_step_peaks<2>[1]
                                       : esokit::smooth_step_peaks<3>[2];
    time_ = std::max(std::pow(peak * std::abs(far) / most, 1.0 / m.order), 4.0 * m.latency);
    // Pole, friction and gravity ask for u as well.
    for (int i = 0; i < 30 && !possible(m); ++i) time_ *= 1.3;
  }
  /// Whether 90 % of the range of u suffice.
  [[nodiscard]] bool possible(const Machine& m) const {
    for (int i = 0; i <= 50; ++i) {
      const auto r = at(0.999 * time_ * i / 50);
      const auto n = static_cast<std::size_t>(m.order);
      double need = r[n] + m.pole * r[n - 1];
      if (m.order <= 2) need += std::copysign(m.friction, r[1]);
      if (m.order == 2) need -= m.pull(r[0]);
      if (std::abs(need / m.b - m.middle) > 0.9 * m.half_range) return false;
    }
    return true;
  }
  [[nodiscard]] double duration() const { return time_; }
  [[nodiscard]] std::array<double, 4> at(double t) const {
    return order_ == 1 ? scaled<1>(t) : order_ == 2 ? scaled<2>(t) : scaled<3>(t);
  }

 private:
  template <int Order>
  [[nodiscard]] std::array<double, 4> scaled(double t) const {
    const auto step = esokit::smooth_step<Order>(t / time_);
    std::array<double, 4> r{};
    double scale = far_;
    for (int i = 0; i <= Order; ++i) {
      r[static_cast<std::size_t>(i)] = scale * step(i);
      scale /= time_;
    }
    return r;
  }

  double far_, time_ = 1.0;
  int order_;
};

/// A PID with conditional clamping as anti-windup; for order 3 with one more zero.
class Pid {
 public:
  /// By the rules of Skogestad (SIMC, J. Process Control 2003) from a model: closed-loop time
  /// constant equal to the latency, or as much longer as the noise in u demands.
  static Pid simc(const esokit::TuneModel& model, double most_noise) {
    Pid pid(model.order, model.sample_time, model.u_min, model.u_max);
    // Half of the lag counts as dead time.
    const double late = 0.5 * model.lag + model.dead_time + model.sensor + 0.5 * pid.T_;
    for (double slow = late; slow < 1e6 * late; slow *= 1.1) {
      pid.filter_ = 0.1 * slow;
      pid.tune(slow + late + pid.filter_, model.pole, model.input_gain.value);
      if (pid.noise_in_u() * model.noise <= most_noise) break;
    }
    return pid;
  }

  /// Tuned by somebody who knows b, as the loops of identify/random_plant.hpp and
  /// identify/ordinary_log.hpp are in which logs are recorded. Bandwidth w of 0.1 to 0.28 over what
  /// u and y need, integral of the pole for order 1; order 2 has 0.7 w^2 and 1.6 w, and here an
  /// integral, too.
  static Pid of_log(const Machine& m, Dice& dice) {
    Pid pid(m.order, m.T, m.lower(), m.upper());
    const double w = dice.between(0.1, 0.28) / (m.latency + m.T);
    pid.filter_ = 1.0 / (6.0 * w);
    pid.tune(1.0 / w, m.pole, m.b);
    if (m.order == 2) {
      pid.gain_ = 0.7 * w * w / m.b;
      pid.lead_ = 1.6 / (0.7 * w);
      pid.integral_ = 8.0 / w;
    }
    return pid;
  }

  void start(double y, double u) {
    state_.fill(y);
    sum_ = u;
  }

  double update(double y, double r) {
    // The leads see the measurement only, so that a step of r does not kick.
    const double asked = gain_ * (r - filtered_lead(y)) + sum_;
    const double u = std::clamp(asked, lower_, upper_);
    const double more = gain_ * (r - y) * T_ / integral_;
    if (asked == u || (asked > u) != (more > 0.0)) sum_ += more;
    return u;
  }

 private:
  Pid(int order, double T, double lower, double upper)
      : n_(order), T_(T), lower_(lower), upper_(upper) {}

  /// abs(L) = 1 at 1 / sum, the zeros two octaves below, for order 3 three.
  void tune(double sum, double pole, double b) {
    lead_ = n_ == 1 ? 0.0 : n_ == 2 ? 4.0 * sum : 8.0 * sum;
    integral_ = n_ > 1 ? lead_ : pole > 0.0 ? std::min(1.0 / pole, 4.0 * sum) : 4.0 * sum;
    gain_ = 1.0 / (b * sum);
    for (int i = 1; i < n_; ++i) gain_ /= lead_;
  }
  /// (lead s + 1)^(n-1) / (filter s + 1)^n of y.
  double filtered_lead(double y) {
    const double keep = std::exp(-T_ / filter_);
    for (int i = 0; i < n_; ++i) {
      auto& x = state_[static_cast<std::size_t>(i)];
      const double before = x;
      x = y + (x - y) * keep;
      y = i + 1 < n_ ? x + lead_ * (x - before) / T_ : x;
    }
    return y;
  }
  /// Deviation of u for noise of deviation 1, without the integral.
  [[nodiscard]] double noise_in_u() const {
    Pid tried = *this;
    tried.state_.fill(0.0);
    double sum = 0.0;
    const int samples = static_cast<int>(std::min(20.0 * filter_ / T_, 1e5)) + 20;
    for (int k = 0; k < samples; ++k) {
      const double h = gain_ * tried.filtered_lead(k == 0 ? 1.0 : 0.0);
      sum += h * h;
    }
    return std::sqrt(sum);
  }

  int n_;
  double T_, lower_, upper_;
  double gain_ = 0.0, lead_ = 0.0, integral_ = 1.0, filter_ = 1.0, sum_ = 0.0;
  std::array<double, 3> state_{};
};

}  // namespace overload_example
