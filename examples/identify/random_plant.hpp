/// @file
/// Logs of random plants in a closed loop, with their truth.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>

namespace identify_example {

/// What is random about a log.
struct Truth {
  int order = 2;
  double input_gain = 1;   ///< b0
  double lag = 0;          ///< s
  double dead_time = 0;    ///< s
  double pole = 0;         ///< 1/s
  double friction = 0;     ///< unit of y^(n)
  double noise = 0;        ///< rms of what the measurement differs by
  double sample_time = 0;  ///< s
  bool encoder = false;    ///< quantised, no noise beside it
  bool flexible = false;   ///< with a mode beside the rigid body
};

/// u, y and what made them.
struct RandomLog {
  Truth truth;
  std::vector<double> u, y;
  std::vector<double> time = {};       ///< s; empty: a row each sample time
  std::vector<double> reference = {};  ///< of the loop, row by row
};

/// Of a log: as it is, with a flexible mode, with a reference that never moves, or of a joint under
/// gravity, which the model does not have. Or from an encoder with rows that last 0.9 to 1.1 T and
/// 3 % of them missing.
enum class Kind { plain, flexible, unexcited, joint, jittery };

/// Same numbers with every standard library.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double from, double to) {
    return from + (to - from) * static_cast<double>(engine_() >> 11u) / 9007199254740992.0;
  }
  double log_uniform(double from, double to) {
    return std::exp(uniform(std::log(from), std::log(to)));
  }
  bool coin() { return uniform(0, 1) < 0.5; }

 private:
  std::mt19937_64 engine_;
};

/// Closed loop for 15 s: P or PD on steps or sines of the reference, u held over a row.
inline RandomLog random_log(std::uint64_t seed, Kind kind = Kind::plain, double duration = 15) {
  Random random(seed);
  esokit::sim::Gaussian gaussian(seed ^ 0x9e3779b97f4a7c15u);
  constexpr double h = 1e-4;
  RandomLog log;
  Truth& p = log.truth;
  p.order = random.coin() ? 2 : 1;
  p.input_gain = random.log_uniform(0.1, 1000);
  p.lag = random.log_uniform(0.002, 0.040);
  // Steps by which u is late. The integrators below use the value at the end of a step, half a step
  // early each: the dead time of the plant is shorter by that.
  const auto lines =
      static_cast<std::size_t>(std::max(std::round(random.uniform(0, 0.010) / h), 1.0));
  p.dead_time = (static_cast<double>(lines) - 0.5 * p.order) * h;
  p.sample_time = 1e-3 * std::round(random.uniform(0.5, 4.499));
  const double latency = p.lag + static_cast<double>(lines) * h;
  p.pole = random.coin() ? 0.0 : random.uniform(0, std::min(0.4 / latency, 20.0));
  p.encoder = random.coin();
  p.flexible = kind == Kind::flexible;
  const bool jittery = kind == Kind::jittery;
  p.encoder = p.encoder || jittery;
  const double friction_share = random.uniform(0, 0.5);
  const double drift_share = random.uniform(0, 0.5);
  const double wc = random.uniform(0.1, 0.28) / (latency + p.sample_time);
  const bool steps = random.coin();
  const double resolution = random.log_uniform(300, 3000);
  const double hold = random.uniform(3, 8) / wc;
  const double mode = random.uniform(4, 10) * wc;  // rad/s, flexible
  const double mode_share = random.uniform(0.05, 0.2);
  std::vector<double> frequency, phase;
  for (int i = 0; i < 6; ++i) {
    frequency.push_back(random.log_uniform(0.1, 1.5) * wc);
    phase.push_back(random.uniform(0, 6.283185307179586));
  }
  const auto rows = static_cast<std::size_t>(duration / p.sample_time);
  const auto inner = static_cast<int>(std::lround(p.sample_time / h));
  std::vector<double> reference(rows);
  double level = 0, until = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) * p.sample_time;
    if (steps) {
      if (t >= until) {
        level = random.uniform(-1.5, 1.5);
        until = t + hold * random.uniform(0.5, 1.5);
      }
      reference[k] = level;
    } else {
      double sum = 0;
      for (std::size_t i = 0; i < frequency.size(); ++i)
        sum += std::sin(frequency[i] * t + phase[i]);
      reference[k] = 0.6 * sum;
    }
    if (kind == Kind::unexcited) reference[k] = 0.3;
  }
  std::vector<double> walk(rows);
  double sum = 0;
  for (double& value : walk) {
    sum += gaussian.next();
    value = sum;
  }
  std::vector<double> white(rows);
  for (double& value : white) value = gaussian.next();
  double square = 0;
  for (const double value : walk) square += value * value;
  const double walk_scale = 1.0 / std::sqrt(square / static_cast<double>(rows));
  // Steps of the integrators in each row.
  std::vector<int> steps_of(rows, inner);
  if (jittery) {
    for (int& count : steps_of)
      count += static_cast<int>(std::lround(random.uniform(-0.1, 0.1) * inner));
  }
  const double step = 1.0 / resolution;
  const double sd = p.encoder ? 0.0 : step * 0.5;
  double friction = 0, drift = 0;
  double speed_scale = 1;
  // Twice: without friction and drift for the size of b0 u, then with them.
  for (int pass = 0; pass < 2; ++pass) {
    log.u.assign(rows, 0);
    log.y.assign(rows, 0);
    std::vector<double> line(lines + 1, 0.0);
    std::size_t at = 0;
    double v = 0, x0 = kind == Kind::unexcited ? 0.3 : 0.0, x1 = 0, m0 = 0, m1 = 0, filtered = x0,
           slope = 0, u = 0;
    const double decay = 1 - std::exp(-h / p.lag);
    double input_square = 0, speed_square = 0, error = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      const double clean = x0 + (p.flexible ? m0 : 0.0);
      const double y = p.encoder ? std::round(clean / step) * step : clean + sd * white[k];
      error += (y - clean) * (y - clean);
      const double a = 1 - std::exp(-6 * wc * p.sample_time);
      const double before = filtered;
      filtered += a * (y - filtered);
      slope = (filtered - before) / p.sample_time;
      const double e = reference[k] - y;
      u = p.order == 1 ? wc * e / p.input_gain
                       : (wc * wc * e * 0.7 - 1.6 * wc * slope) / p.input_gain;
      log.u[k] = u;
      log.y[k] = y;
      for (int i = 0; i < steps_of[k]; ++i) {
        line[at] = u;
        at = (at + 1) % line.size();
        const double delayed = line[at];
        v += decay * (delayed - v);
        const double speed = p.order == 1 ? x0 : x1;
        const double force = p.input_gain * v + drift * walk[k] * walk_scale -
                             friction * std::tanh(speed / (0.02 * speed_scale));
        if (p.order == 1) {
          x0 += h * (force - p.pole * x0);
        } else {
          x1 += h * (force - p.pole * x1);
          x0 += h * x1;
        }
        // A mode beside the rigid body.
        m1 += h * (mode_share * p.input_gain * v * (p.order == 1 ? mode : 1.0) - mode * mode * m0 -
                   0.06 * mode * m1);
        m0 += h * m1;
        input_square += p.input_gain * u * p.input_gain * u;
        speed_square += speed * speed;
      }
    }
    const double count = static_cast<double>(rows) * inner;
    p.noise = std::sqrt(error / static_cast<double>(rows));
    if (pass == 0) {
      const double size = std::sqrt(input_square / count);
      friction = friction_share * size;
      drift = drift_share * size;
      speed_scale = std::sqrt(speed_square / count);
      p.friction = friction;
    }
  }
  if (jittery) {
    RandomLog kept{p, {}, {}};
    double t = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      if (random.uniform(0, 1) > 0.03) {
        kept.time.push_back(t);
        kept.u.push_back(log.u[k]);
        kept.y.push_back(log.y[k]);
      }
      t += h * steps_of[k];
    }
    return kept;
  }
  log.reference = reference;
  return log;
}

/// A joint under gravity and ADRC for 12 s: one to three sines or steps of the reference.
///
///     y'' = b0 v - a y' - g sin(y + turned) - friction tanh(y' / v_s),   lag v' + v = u
inline RandomLog random_joint(std::uint64_t seed, double duration = 12) {
  Random random(seed);
  esokit::sim::Gaussian gaussian(seed ^ 0x9e3779b97f4a7c15u);
  constexpr double h = 1e-4, pi = 3.14159265358979323846;
  RandomLog log;
  Truth& p = log.truth;
  p.input_gain = 1 / random.log_uniform(0.002, 2);  // over the moment of inertia, kg m2
  p.lag = random.log_uniform(0.0003, 0.008);
  p.pole = random.uniform(0, 3);
  p.sample_time = 1e-3 * std::round(random.uniform(0.5, 4.499));
  p.encoder = random.coin();
  const double step = 2 * pi / std::round(std::exp2(random.uniform(12, 17)));
  const double gravity = std::pow(random.uniform(1.5, 9), 2);  // a pendulum of 4.4 to 0.12 m
  const double turned = random.coin() ? 0.0 : random.uniform(-pi, pi);
  const double friction_share = random.uniform(0, 0.4);
  const double wc = std::min(random.log_uniform(10, 40), 0.12 / (p.lag + p.sample_time));
  const double wo = wc * random.uniform(3, 6);
  const int sines = static_cast<int>(random.uniform(0, 4));  // 0: steps
  const double hold = random.uniform(0.4, 2);
  double frequency[3], phase[3], amplitude[3];
  for (int i = 0; i < 3; ++i) {
    frequency[i] = random.log_uniform(1, 0.7 * wc);
    phase[i] = random.uniform(0, 2 * pi);
    amplitude[i] = random.uniform(0.3, 1) * std::min(0.6, 2 / frequency[i]);
  }
  const auto rows = static_cast<std::size_t>(duration / p.sample_time);
  const auto inner = static_cast<int>(std::lround(p.sample_time / h));
  std::vector<double> reference(rows);
  double level = 0, until = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double t = static_cast<double>(k) * p.sample_time;
    if (sines == 0) {
      if (t >= until) {
        level = random.uniform(-0.8, 0.8);
        until = t + hold * random.uniform(0.5, 1.5);
      }
      reference[k] = level;
    }
    for (int i = 0; i < sines; ++i)
      reference[k] += amplitude[i] * std::sin(frequency[i] * t + phase[i]);
  }
  std::vector<double> white(rows);
  for (double& value : white) value = gaussian.next();
  const double decay = 1 - std::exp(-h / p.lag);
  double speed_scale = 1;
  // Twice: without friction for the size of b0 u, then with it.
  for (int pass = 0; pass < 2; ++pass) {
    auto loop =
        esokit::Adrc<esokit::LinearEso<2>>::make({.observer = {.observer_bandwidth = wo,
                                                               .input_gain = p.input_gain,
                                                               .sample_time = p.sample_time},
                                                  .controller_bandwidth = wc})
            .value();
    log.u.assign(rows, 0);
    log.y.assign(rows, 0);
    double v = 0, x0 = 0, x1 = 0, held = 0, input_square = 0, speed_square = 0, error = 0;
    for (std::size_t k = 0; k < rows; ++k) {
      const double y = p.encoder ? std::round(x0 / step) * step : x0 + 0.3 * step * white[k];
      error += (y - x0) * (y - x0);
      const double u = loop.update(y, reference[k]);
      log.u[k] = u;
      log.y[k] = y;
      for (int i = 0; i < inner; ++i) {
        // One step late, because two integrators are half a step early each.
        v += decay * (held - v);
        held = u;
        x1 += h * (p.input_gain * v - p.pole * x1 - gravity * std::sin(x0 + turned) -
                   p.friction * std::tanh(x1 / (0.02 * speed_scale)));
        x0 += h * x1;
        input_square += p.input_gain * u * p.input_gain * u;
        speed_square += x1 * x1;
      }
    }
    const double count = static_cast<double>(rows) * inner;
    p.noise = std::sqrt(error / static_cast<double>(rows));
    if (pass == 0) {
      p.friction = friction_share * std::sqrt(input_square / count);
      speed_scale = std::sqrt(speed_square / count);
    }
  }
  return log;
}

}  // namespace identify_example
