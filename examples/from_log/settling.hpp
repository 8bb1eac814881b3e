/// @file
/// Random plants that settle by themselves, with a model of each that is wrong, and what from_log
/// pastes for it.
#pragma once

#include <cmath>
#include <cstddef>
#include <deque>

#include <esokit/tune/tune.hpp>

#include "choosing/overload.hpp"
#include "from_log/parts/paste.hpp"

namespace from_log {

/// A plant, and how wrong its model is.
struct Settling {
  esokit::TuneModel model{};
  double pole = 0, gain = 0, lag = 0;  ///< of the plant
  std::size_t late = 0;                ///< samples of its dead time
  double y = 0, u = 0;                 ///< where it rests
  double step = 0;                     ///< of r
  double count = 0;                    ///< of its encoder, whose noise the model has; 0: none
};

inline Settling random_plant(int order, overload_example::Dice& random) {
  Settling all;
  auto& m = all.model;
  const auto logarithmic = [&](double low, double high) {
    return std::exp(random.between(std::log(low), std::log(high)));
  };
  const bool one_sided = order == 1 && random.with(0.5);
  m.order = order;
  m.sample_time = 1;
  m.pole = 1 / logarithmic(30, 1500);
  m.lag = random.with(0.3) ? 0 : logarithmic(0.5, 0.15 / m.pole);
  m.dead_time = std::floor(random.between(0, 8));
  // The range of u moves y by 100, or y' by 1.
  m.input_gain = {order == 1 ? m.pole : 0.01 * m.pole, 0};
  m.input_gain.half_width = 0.08 * m.input_gain.value;
  m.latency_half_width = 0.1 * (m.lag + m.dead_time);
  m.noise = logarithmic(0.005, 0.3) * (order == 1 ? 1 : 0.1);
  m.disturbance = m.disturbance_of(logarithmic(0.002, 0.1) / (1 + 0.2 * (m.dead_time + m.lag)));
  m.u_min = one_sided ? 0 : -50;
  m.u_max = one_sided ? 100 : 50;
  all.y = one_sided ? 20 : 0;
  all.step = logarithmic(3, order == 1 ? 45 : 30);
  const double late = random.between(-0.15, 0.15);
  all.pole = m.pole * random.between(0.8, 1.2);
  all.gain = m.input_gain.value * random.between(0.92, 1.08);
  all.lag = m.lag * (1 + late);
  all.late = static_cast<std::size_t>(std::lround(m.dead_time * (1 + late)));
  all.u = order == 1 ? all.pole * all.y / all.gain : 0;
  return all;
}

/// What from_log pastes beside the design.
inline Pasting pasting_of(const Settling& plant) {
  const double half = 0.5 * (plant.model.u_max - plant.model.u_min);
  Pasting pasting;
  pasting.order = plant.model.order;
  pasting.input_gain = plant.model.input_gain.value;
  pasting.pole = plant.model.pole;
  pasting.dead_time = plant.model.dead_time;
  pasting.room = half * pasting.input_gain;
  pasting.shortest = 4 * plant.model.latency();
  pasting.pole_reach = 2 * half;
  return pasting;
}

/// A plant at work: u held for a sample, from rest.
class Machine {
 public:
  /// @param load of y^(n), from the beginning on
  explicit Machine(const Settling& plant, double load = 0)
      : plant_(plant), line_(plant.late, plant.u), y_(plant.y), v_(plant.u), load_(load) {}

  [[nodiscard]] double y() const { return y_; }
  /// By its encoder, if it has one.
  [[nodiscard]] double measured() const {
    return plant_.count > 0 ? plant_.count * std::round(y_ / plant_.count) : y_;
  }
  void set_load(double load) { load_ = load; }

  void update(double given) {
    line_.push_back(given);
    const double u = line_.front();
    line_.pop_front();
    constexpr int parts = 20;
    constexpr double h = 1.0 / parts;
    for (int i = 0; i < parts; ++i) {
      v_ = plant_.lag > 0 ? v_ - std::expm1(-h / plant_.lag) * (u - v_) : u;
      if (plant_.model.order == 1) {
        y_ += h * (plant_.gain * v_ - plant_.pole * y_ + load_);
      } else {
        const double change = plant_.gain * v_ - plant_.pole * rate_ + load_;
        y_ += h * (rate_ + 0.5 * h * change);
        rate_ += h * change;
      }
    }
  }

 private:
  Settling plant_;
  std::deque<double> line_;
  double y_, rate_ = 0, v_, load_;
};

}  // namespace from_log
