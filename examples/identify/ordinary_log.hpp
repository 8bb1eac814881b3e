/// @file
/// Logs of ordinary machines as people record them, with their truth: heaters, tanks and motors
/// under steps, ramps or a PI controller, servos. They have speed from counts, filtered or late, y
/// with an offset, one direction with standstill, ambient that drifts, spikes.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include <esokit/sim/gaussian.hpp>

#include "identify/random_plant.hpp"

namespace identify_example {

/// What kind of log: of order 1 in open loop or under a PI controller, of order 2 (a servo), and
/// what must not be taken for a machine with one b0.
enum class Habit {
  open,
  pi,
  servo,
  saturating,   // commands beyond the limits of the actuator are logged
  square,       // the effect of a valve is the square of u
  dead_zone,    // small u do nothing
  dead_servo,   // the same of a servo
  early,        // y comes before u
  unrelated,    // y has nothing to do with u
  regulator,    // a controller whose reference never moves
  acceleration  // y follows u at once
};

/// u, y and what made them. For a nonlinear actuator b0 lies between `least` and `most`.
struct OrdinaryLog : RandomLog {
  double least = 0, most = 0;
  double curve_size =
      0;                 ///< width of the dead zone, limit of the saturation, u where a square is u
  std::string features;  ///< in words, to find out what is difficult
};

/// u of an experiment in open loop: steps of any level, few steps, PRBS, sines, slow ramps and
/// steps.
inline std::vector<double> excitation(Random& random, std::size_t rows, double low, double high,
                                      double rows_of_pole, std::string& features) {
  std::vector<double> u(rows);
  const double middle = 0.5 * (low + high), half = 0.5 * (high - low);
  const int kind = static_cast<int>(random.uniform(0, 5));
  const char* const names[] = {"steps", "few steps", "prbs", "sines", "ramps"};
  features += names[kind];
  if (kind == 3) {
    double frequency[5], phase[5];
    for (int i = 0; i < 5; ++i) {
      frequency[i] = random.log_uniform(0.1, 2.5) / rows_of_pole;
      phase[i] = random.uniform(0, 6.283185307179586);
    }
    for (std::size_t k = 0; k < rows; ++k) {
      double sum = 0;
      for (int i = 0; i < 5; ++i) sum += std::sin(frequency[i] * static_cast<double>(k) + phase[i]);
      u[k] = middle + half * std::clamp(sum / 3, -1.0, 1.0);
    }
    return u;
  }
  const double all = static_cast<double>(rows);
  const double hold = kind == 1   ? all / random.uniform(3, 6)
                      : kind == 2 ? std::max(rows_of_pole * random.uniform(0.3, 1.5), 3.0)
                                  : std::max(rows_of_pole * random.uniform(0.6, 3), 5.0);
  const double ramp = kind == 4 ? random.uniform(0.25, 0.6) * all : 0;  // up, and down again
  double level = kind == 1 ? std::clamp(0.0, low, high) : middle, until = ramp;
  if (kind == 1) until += random.uniform(0.05, 0.3) * hold;
  bool up = false;
  for (std::size_t k = 0; k < rows; ++k) {
    const double at = static_cast<double>(k);
    if (at < ramp) {
      const double share = 1 - std::abs(2 * at / ramp - 1);
      u[k] = std::clamp(0.0, low, high) + share * (high - std::clamp(0.0, low, high));
      continue;
    }
    if (at >= until) {
      up = !up;
      level = kind == 2 ? (up ? high : low) : random.uniform(low, high);
      if (kind == 1 && !up) level = std::clamp(0.0, low, high);
      if (kind == 1 && up) level = high * random.uniform(0.5, 1);
      until = at + hold * (kind == 2 ? std::floor(random.uniform(1, 4)) : random.uniform(0.5, 1.5));
    }
    u[k] = level;
  }
  return u;
}

/// A log of 300 to 10,000 rows.
inline OrdinaryLog ordinary_log(std::uint64_t seed, Habit habit) {
  Random random(seed);
  esokit::sim::Gaussian gaussian(seed ^ 0x9e3779b97f4a7c15u);
  OrdinaryLog log;
  Truth& p = log.truth;
  const bool servo = habit == Habit::servo || habit == Habit::dead_servo;
  const bool loop = habit == Habit::pi || habit == Habit::regulator;
  p.order = servo ? 2 : 1;
  const auto rows = static_cast<std::size_t>(random.log_uniform(300, 10000));
  const double all = static_cast<double>(rows);
  p.pole = random.log_uniform(0.003, 30);
  const double row_of_pole = random.log_uniform(std::max(0.004, 12 / all), 0.12);  // a T
  p.sample_time = row_of_pole / p.pole;
  const double T = p.sample_time;
  p.input_gain = random.log_uniform(0.001, 1000);
  const double U = random.log_uniform(1, 255);
  const double size = p.input_gain * U / p.pole;  // of y, or of y' of a servo
  const bool one_way = random.coin() && !servo;
  const double low = one_way ? 0 : -U, high = U;
  p.lag = random.log_uniform(0.02, 0.25) / p.pole;
  const double second = random.uniform(0, 1) < 0.4 ? random.uniform(0.02, 0.08) / p.pole : 0;
  const bool motor = servo || random.uniform(0, 1) < 0.6;
  const bool counts = motor && !servo && random.coin();
  const bool filtered = !counts && random.uniform(0, 1) < 0.3;
  const double filter = filtered ? random.uniform(1, 4) * T : 0;
  const auto late = static_cast<std::size_t>(random.uniform(0, 3));
  p.dead_time = random.uniform(0, 0.08) / p.pole;
  p.friction = motor && random.coin() ? random.uniform(0.02, 0.3) * p.input_gain * U : 0;
  const double constant = motor ? 0 : random.uniform(-0.2, 0.2) * p.input_gain * U;
  const double drift = random.coin() ? 0 : random.log_uniform(0.002, 0.1) * p.input_gain * U;
  const bool slow_sine = random.coin();
  const double offset = motor || servo ? 0 : random.uniform(-1, 3) * size;
  const double noise = random.log_uniform(0.0005, 0.02) * size;
  const double step = size / random.log_uniform(15, 200);  // one count a row
  const bool spikes = random.uniform(0, 1) < 0.15;
  const double encoder = servo ? size / p.pole / random.log_uniform(30, 1000) : 0;
  p.encoder = servo && random.coin();
  const double limit = habit == Habit::saturating ? random.uniform(0.4, 0.7) * U : 1e300;
  const bool dead = habit == Habit::dead_zone || habit == Habit::dead_servo;
  const double width = dead ? random.uniform(0.1, 0.5) * U : 0;
  log.curve_size = dead ? width : habit == Habit::square ? U : limit;
  log.least = log.most = p.input_gain;
  if (habit == Habit::saturating || dead) log.least = 0.2 * p.input_gain;
  std::string& f = log.features;
  f = std::to_string(rows) + " rows, " + (motor ? "motor" : "heater") +
      (one_way ? ", one way" : "") + (counts ? ", counts" : "") + (filtered ? ", filtered" : "") +
      (p.friction > 0 ? ", friction" : "") + (second > 0 ? ", second lag" : "") +
      (drift > 0 ? ", drift" : "") + (spikes ? ", spikes" : "") + (p.encoder ? ", encoder" : "") +
      ", ";
  const auto asked = excitation(random, rows, low, high, 1 / row_of_pole, f);
  // A controller: PI for order 1, PD for a servo, on steps of the reference.
  const double latency = p.lag + second + filter + p.dead_time + static_cast<double>(late + 1) * T;
  const double wc = servo ? std::min(random.uniform(0.8, 4) * p.pole, 0.25 / latency)
                          : std::min(random.uniform(0.7, 3) * p.pole, 0.3 / latency);
  const bool driven = servo && random.uniform(0, 1) < 0.3;  // in open loop
  if (servo && driven) f += " (open loop)";
  const double hold = random.uniform(3, 10) / (wc * T);
  const double reference_size = servo ? size / wc * random.uniform(0.2, 0.6) : size;
  // What a loop uses of u for a small motion is much less than its limit.
  if (servo && !driven) p.friction *= std::min(wc * wc * reference_size / (p.input_gain * U), 1.0);
  constexpr int inner = 16;
  const double h = T / inner;
  const auto line_length = static_cast<std::size_t>(std::lround(p.dead_time / h)) + 1;
  std::vector<double> line(line_length, 0.0);
  std::size_t at = 0;
  double x = 0, way = 0, v = 0, v2 = 0, sensed = 0, walk = 0, level = 0, until = 0, sum = 0;
  double before = 0, slope = 0;
  const double keep = std::exp(-p.pole * h), add = (1 - keep) / p.pole;
  const double slow = random.uniform(1, 3) * 6.283 / all;
  std::vector<double> measured;
  double last_count = 0, error = 0;
  for (std::size_t k = 0; k < rows; ++k) {
    const double white = gaussian.next();
    walk += gaussian.next() / std::sqrt(all);
    double y = (servo ? way : x) + noise * white;
    if (servo && !p.encoder) y = way + 0.3 * encoder * white;
    if (p.encoder) y = std::round(way / encoder) * encoder;
    if (counts) {
      const double count = std::floor(way / (step * T));
      y = (count - last_count) * step;
      last_count = count;
    }
    error += std::pow(y - (servo ? way : x), 2);
    if (filtered && !servo) {
      sensed += (1 - std::exp(-T / filter)) * (y - sensed);
      y = sensed;
    }
    measured.push_back(y);
    y = measured[measured.size() - 1 - std::min(late, measured.size() - 1)];
    double u = asked[k];
    if (loop || (servo && !driven)) {
      if (static_cast<double>(k) >= until && habit != Habit::regulator) {
        level = one_way ? random.uniform(0.1, 0.8) : random.uniform(-0.7, 0.7);
        until = static_cast<double>(k) + hold * random.uniform(0.5, 1.5);
      }
      if (habit == Habit::regulator) level = 0.4;
      const double e = reference_size * level - y;
      slope += 0.3 * ((y - before) / T - slope);
      before = y;
      if (servo) {
        u = (wc * wc * e - std::max(1.4 * wc - p.pole, 0.0) * slope) / p.input_gain;
      } else {
        u = (wc * e + sum) / p.input_gain;
        if (u > low && u < high) sum += wc * p.pole * e * T;
      }
      u = std::clamp(u, low, high);
    }
    log.u.push_back(u);
    log.y.push_back(y + offset);
    const double load =
        constant + drift * (slow_sine ? std::sin(slow * static_cast<double>(k)) : walk);
    for (int i = 0; i < inner; ++i) {
      line[at] = u;
      at = (at + 1) % line.size();
      double effect = std::clamp(line[at], -limit, limit);
      if (dead) effect = std::copysign(std::max(std::abs(effect) - width, 0.0), effect);
      if (habit == Habit::square) effect = effect * std::abs(effect) / U;
      v += (1 - std::exp(-h / p.lag)) * (effect - v);
      v2 = second > 0 ? v2 + (1 - std::exp(-h / second)) * (v - v2) : v;
      const double force = p.input_gain * v2 + load;
      // Coulomb friction that holds at standstill.
      if (x == 0 && std::abs(force) <= p.friction) continue;
      const double way_of = x != 0 ? x : force;
      const double next = keep * x + add * (force - std::copysign(p.friction, way_of));
      x = p.friction > 0 && x != 0 && next * x < 0 ? 0 : next;
      way += h * x;
    }
  }
  p.noise = std::sqrt(error / all);
  p.lag += second + filter;
  p.dead_time += static_cast<double>(late) * T + (counts ? 0.5 * T : 0);
  if (spikes) {
    for (std::size_t k = 0; k < rows; ++k) {
      if (random.uniform(0, 1) > 0.003) continue;
      const double jump =
          (random.coin() ? 1 : -1) * random.uniform(0.3, 1) * (servo ? reference_size : size);
      log.y[k] += jump;
      if (random.uniform(0, 1) < 0.3 && k + 1 < rows) log.y[k + 1] += jump;
    }
  }
  if (habit == Habit::square) {
    // Slope of the curve within the log: 0 to twice the mean.
    log.least = 0.05 * p.input_gain, log.most = 2.2 * p.input_gain;
  }
  if (habit == Habit::early) {
    const auto shift = static_cast<std::size_t>(random.uniform(1, 6)) + late +
                       static_cast<std::size_t>(std::ceil(latency / T));
    log.y.erase(log.y.begin(), log.y.begin() + static_cast<std::ptrdiff_t>(shift));
    log.u.resize(log.y.size());
  }
  if (habit == Habit::acceleration) {
    for (std::size_t k = rows; k-- > 1;)
      log.y[k] = p.input_gain * log.u[k - 1] + 0.02 * p.input_gain * U * gaussian.next();
    log.y[0] = 0;
  }
  if (habit == Habit::unrelated) {
    double a = 0;
    for (double& y : log.y) {
      a += row_of_pole * 0.3 * (gaussian.next() * 5 - a);
      y = offset + a * size + noise * gaussian.next();
    }
  }
  return log;
}

}  // namespace identify_example
