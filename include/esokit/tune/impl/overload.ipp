#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/control/detail/softening.hpp>
#include <esokit/tune/overload.hpp>
#include <esokit/tune/specification.hpp>
#include <utility>
#include <vector>

namespace esokit {

ESOKIT_FUNCTION std::vector<detail::PlantVariant> simulated_variants(const TuneModel& model) {
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
  for (const double share : friction_shares) frictions.push_back(share * unit);
  if (model.friction) frictions = {*model.friction};
  for (const double friction : frictions) {
    take({model, 1.0}, friction);
    // Late, and with the least of b0.
    if (ends.size() > 1) take(ends[1], friction);
  }
  return all;
}

ESOKIT_FUNCTION std::vector<Overload> overloads_of(const TuneModel& variant) {
  if (variant.friction.value_or(0.0) > 0.0)
    return {friction_overloads.begin(), friction_overloads.end()};
  return {overloads.begin(), overloads.end()};
}

ESOKIT_FUNCTION bool oscillates_with_friction(const TuneModel& model,
                                              const LinearController& controller) {
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

ESOKIT_FUNCTION LinearController given_input_form(const LinearController& own) {
  LinearController c = own;
  double applied = 0.0;
  for (int i = 0; i < c.states(); ++i) applied += (std::abs)(c.from_u(i, 0));
  if (applied > 0.0) return c;
  // A reference reaches the states by u alone.
  for (int i = 0; i < c.states(); ++i) {
    c.from_u(i, 0) = own.from_r(i, 0) / own.r_to_u(0, 0);
    c.from_r(i, 0) = 0.0;
    c.from_y(i, 0) -= c.from_u(i, 0) * c.y_to_u(0, 0);
    for (int j = 0; j < c.states(); ++j) c.a(i, j) -= c.from_u(i, 0) * c.to_u(0, j);
  }
  return c;
}

template <int Order>
SoftenedInput softened_input(const SofteningLaw& softened, double T, double half) {
  typename AdrcLaw<Order>::Config config{};
  config.gains.emplace();
  std::copy_n(softened.gains.begin(), Order, config.gains->begin());
  config.input_gain = softened.input_gain;
  const auto law = AdrcLaw<Order>::make(config);
  const Limits<double> limits{.lower = -half, .upper = half};
  const auto limiter = Limiter<double>::make(limits, T);
  if (!law || !limiter) return {};
  const auto made = Softening<Order>::make(*law, limits, true);
  if (!made) return {};
  return [softened, T, law = *law, limiter = *limiter, soft = *made](
             double u, double y, double r, const std::vector<double>& z) mutable {
    if (soft.slowness() > 1.0) {
      Vector<double, Order + 1> lacks{};
      for (int i = 0; i <= Order; ++i) {
        lacks(i) = (i == 0 ? r : 0.0) - softened.y_to_estimate(i, 0) * y;
        for (std::size_t j = 0; j < z.size(); ++j) {
          lacks(i) -= softened.to_estimate(i, static_cast<int>(j)) * z[j];
        }
      }
      u = soft.control(law, lacks);
    }
    soft.judge(u, limiter, T);
    return u;
  };
}

inline SoftenedInput softened_input(const SofteningLaw& law, double T, double half) {
  switch (law.gains.size()) {
    case 1:
      return softened_input<1>(law, T, half);
    case 2:
      return softened_input<2>(law, T, half);
    case 3:
      return softened_input<3>(law, T, half);
    case 4:
      return softened_input<4>(law, T, half);
    default:
      return {};
  }
}

ESOKIT_FUNCTION LimitedLoop::LimitedLoop(const TuneModel& model, double gain,
                                         const LinearController& given, double half,
                                         const SofteningLaw& law)
    : plant_(sampled_plant(dense_plant(model, gain), model.sample_time)),
      c_(given),
      half_(half),
      x_(static_cast<std::size_t>(plant_.a.rows())),
      z_(static_cast<std::size_t>(given.states())),
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

ESOKIT_FUNCTION double LimitedLoop::output() const {
  double y = 0.0;
  for (std::size_t i = 0; i < x_.size(); ++i) y += plant_.c(0, static_cast<int>(i)) * x_[i];
  return y;
}

ESOKIT_FUNCTION double LimitedLoop::operator()(double y, double r, double d, double more) {
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

template <class Input>
void LimitedLoop::advance(std::vector<double>& x, const DynamicMatrix<double>& a,
                          const Input& input) {
  const int n = a.rows();
  for (int i = 0; i < n; ++i) next_[static_cast<std::size_t>(i)] = input(i);
  for (int j = 0; j < n; ++j) {
    const double value = x[static_cast<std::size_t>(j)];
    for (int i = 0; i < n; ++i) next_[static_cast<std::size_t>(i)] += a(i, j) * value;
  }
  for (std::size_t i = 0; i < x.size(); ++i) x[i] += next_[i];
}

ESOKIT_FUNCTION void LimitedLoop::rub() {
  const double less = std::clamp(x_[1], -rub_, rub_);
  x_[1] -= less;
  x_[0] -= slid_ * less;
}

}  // namespace detail

ESOKIT_FUNCTION double overload_distance(const TuneModel& model, double gain,
                                         const Overload& event) {
  const double force =
      0.5 * (model.u_max - model.u_min) * (std::abs)(gain * model.input_gain.value);
  double distance = event.share * force;
  for (int i = 1; i <= model.order; ++i) distance *= event.latencies * model.latency() / i;
  const double pull = (std::abs)(model.pole);
  return model.order == 1 && pull > 0.0 ? (std::min)(distance, 0.6 * force / pull) : distance;
}

}  // namespace esokit
