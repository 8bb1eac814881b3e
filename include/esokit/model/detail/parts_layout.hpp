/// @file
/// The settings and the states of an AugmentedModel, and which elements of its Phi and Gamma can
/// differ from zero.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/math/combinatorics.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/model/matrix_model.hpp>
#include <esokit/model/model_parts.hpp>
#include <type_traits>

namespace esokit {

/// Range of the factor by which all frequencies may change.
template <bool Follows, Scalar S>
struct SpeedRange {};
/// The range of a model that follows a speed.
template <Scalar S>
struct SpeedRange<true, S> {
  S lowest{};   ///< above 0, 1 at most
  S highest{};  ///< 1 or more
};

/// Settings of the parts of an AugmentedModel, in this order; members of absent parts are empty.
template <ModelParts Parts, Scalar S>
struct PartsSettings {
  static constexpr int data_members = 6;  ///< for snapshots

  /// a_0 .. a_(n-1), unit of a_i: s^-(n-i); with ModelParts::states the LinearPlant: A, B, C and,
  /// for d, E.
  std::conditional_t<(Parts.states > 0), LinearPlant<(Parts.states > 0 ? Parts.states : 1), S>,
                     Array<S, Parts.plant_poles ? Parts.order : 0>>
      plant{};
  Lag<Parts.actuator, S> actuator{};                   ///< from u to v
  Lag<Parts.sensor, S> sensor{};                       ///< from y to what is measured
  Array<Resonance<S>, Parts.resonators> resonators{};  ///< the sines
  Array<S, Parts.first_order> first_order{};  ///< time constants of the first-order disturbances, s
  SpeedRange<Parts.follows_speed, S> speed{};  ///< of the resonators
};

namespace detail {

/// The Shape that MatrixModel takes. The states are those of a sensor, y .. up to D, the remaining
/// states of a plant that is given as a whole, and the states of the disturbance. If there are no
/// such remaining states, D takes the place of the first state of the disturbance.
template <ModelParts Parts>
struct PartsShape {
  static constexpr ModelParts parts = Parts;
  /// The order that a control law sees: that of the plant plus that of the actuator's lag.
  static constexpr int order = Parts.order + Parts.actuator;
  static constexpr int measured_rows = Parts.sensor;
  static constexpr int of_plant = Parts.states > 0 ? Parts.states : order;
  static constexpr int first = Parts.sensor + of_plant;  ///< first disturbance state
  static constexpr int sinusoids = of_plant + Parts.constants;
  static constexpr int replaced =
      of_plant == order ? 1 : 0;  ///< of its states, how many D replaces
  static constexpr int size = first + Parts.constants + 2 * Parts.resonators + Parts.first_order;

  /// A state is its value in physical units times T^degree / degree!.
  static constexpr int degree(int state) noexcept {
    if (state < Parts.sensor) return 0;
    if (state <= Parts.sensor + order) return state - Parts.sensor;
    const int element = state - first;
    return Parts.order + (element > 0 && element < Parts.constants ? element : 0);
  }
  static constexpr ModelPattern<size> pattern = [] {
    constexpr auto end = static_cast<std::size_t>(size);
    constexpr auto lf = static_cast<std::size_t>(Parts.sensor);
    constexpr auto n = static_cast<std::size_t>(Parts.order);
    constexpr auto la = static_cast<std::size_t>(Parts.actuator);
    constexpr auto m = static_cast<std::size_t>(Parts.constants);
    constexpr auto d = static_cast<std::size_t>(first);
    constexpr std::size_t first_decay = d + m + 2 * static_cast<std::size_t>(Parts.resonators);
    ModelPattern<size> all{};
    auto& p = all.couples;
    // Nonzero elements of A and B.
    for (std::size_t i = 0; i < lf; ++i) {
      for (std::size_t j = 0; j <= lf; ++j) p[i][j] = true;
    }
    if (Parts.states > 0) {
      for (std::size_t i = lf; i < d + replaced; ++i) {
        for (std::size_t j = lf; j <= end; ++j) p[i][j] = true;
      }
    } else {
      for (std::size_t r = lf; r < d; ++r) p[r][r + 1] = true;
      p[d - 1][end] = true;
      for (std::size_t i = Parts.plant_poles ? lf : lf + n; i < d; ++i) p[d][i + 1] = true;
      if (Parts.plant_poles || la > 0) p[d][end] = true;
      for (std::size_t j = d + 1; j < end; ++j) p[d][j] = j >= d + m || j <= d + la + 1;
    }
    for (std::size_t i = replaced; i + 1 < m; ++i) p[d + i][d + i + 1] = true;
    for (std::size_t q = d + m; q < first_decay; q += 2) {
      p[q][q] = p[q][q + 1] = p[q + 1][q] = p[q + 1][q + 1] = true;
    }
    for (std::size_t j = first_decay; j < end; ++j) p[j][j] = true;
    // Elements that become nonzero in their powers.
    for (std::size_t k = 0; k < end; ++k) {
      for (std::size_t i = 0; i < end; ++i) {
        for (std::size_t j = 0; j <= end; ++j) p[i][j] = p[i][j] || (p[i][k] && p[k][j]);
      }
    }
    // y^(order) = D + b u, and without a whole plant they occur also in D' only as this sum: u has
    // the same effect as D.
    if (Parts.states == 0) all.driven = first;
    for (std::size_t i = 0; i < end; ++i) {
      for (std::size_t j = 0; j <= end; ++j) {
        all.place[i][j] = all.kept;
        // The elements of a pure chain: a plant without poles and its integrated disturbance; with
        // an actuator the chain ends at y^(n).
        const std::size_t last = la == 0 ? d + m - 1 : lf + n;
        if (p[i][j] && !Parts.plant_poles && Parts.states == 0 && i >= lf && j <= last) {
          all.chain[i][j] =
              static_cast<int>(binomial(static_cast<int>(j - lf), static_cast<int>(i - lf)));
        }
        if (p[i][j] && all.chain[i][j] == 0 && (j < end || all.driven < 0)) ++all.kept;
      }
    }
    return all;
  }();
};

/// a! / b!.
template <PlainScalar S>
constexpr S factorial_ratio(int a, int b) noexcept {
  S ratio(1);
  for (int j = b + 1; j <= a; ++j) ratio = ratio * static_cast<S>(j);
  for (int j = a + 1; j <= b; ++j) ratio = ratio / static_cast<S>(j);
  return ratio;
}

/// The rules of the settings. @param time T, s
template <ModelParts Parts, Scalar S>
Check<S> check_parts(const PartsSettings<Parts, S>& settings, const S& time) {
  Rules<S> rules;
  if constexpr (Parts.states == 0) rules.finite("model.plant", settings.plant);
  check_lag(rules,
            Parts.actuator == 1 ? "model.actuator.time_constant" : "model.actuator.frequency",
            "model.actuator.damping", settings.actuator, time);
  check_sensor(rules, settings.sensor, time);
  check_resonators(rules, settings.resonators, time);
  if constexpr (Parts.follows_speed) {
    const auto& [lowest, highest] = settings.speed;
    rules.positive("model.speed.lowest", lowest)
        .positive("model.speed.highest", highest)
        .demand(lowest <= S(1), "model.speed.lowest", lowest, "must be 1 at most")
        .demand(highest >= S(1), "model.speed.highest", highest, "must be 1 or more");
    for (const auto& resonance : settings.resonators) {
      rules.demand(below(S(highest * resonance.frequency * time), S(3.1)), "model.speed.highest",
                   highest, "takes a resonator to half the sample rate");
    }
  }
  check_first_order(rules, settings.first_order, time);
  return rules;
}

}  // namespace detail
}  // namespace esokit
