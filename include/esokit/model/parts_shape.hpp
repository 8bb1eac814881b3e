/// @file
/// The settings and the states of an AugmentedModel, and which elements of its Phi and Gamma can
/// differ from zero.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/math/combinatorics.hpp>
#include <esokit/model/matrix_model.hpp>
#include <esokit/model/model_parts.hpp>

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
  Array<S, Parts.plant_poles ? Parts.order : 0> plant{};  ///< a_0 .. a_(n-1), unit of a_i: s^-(n-i)
  Lag<Parts.actuator, S> actuator{};                      ///< from u to v
  Lag<Parts.sensor, S> sensor{};                          ///< from y to what is measured
  Array<Resonance<S>, Parts.resonators> resonators{};     ///< the sines
  Array<S, Parts.first_order> first_order{};  ///< time constants of the first-order disturbances, s
  SpeedRange<Parts.follows_speed, S> speed{};  ///< of the resonators
};

namespace detail {

/// The order that a control law sees: that of the plant plus that of the actuator's lag.
constexpr int law_order(const ModelParts& parts) noexcept { return parts.order + parts.actuator; }
constexpr int model_size(const ModelParts& parts) noexcept {
  return parts.sensor + law_order(parts) + parts.constants + 2 * parts.resonators +
         parts.first_order;
}

/// A state is its value in physical units times T^degree / degree!.
constexpr int model_degree(const ModelParts& parts, int state) noexcept {
  if (state < parts.sensor) return 0;
  const int row = state - parts.sensor;
  const int order = law_order(parts);
  if (row <= order) return row;
  return row < order + parts.constants ? parts.order + row - order : parts.order;
}
template <ModelParts Parts>
constexpr auto make_model_pattern() noexcept {
  constexpr auto size = static_cast<std::size_t>(model_size(Parts));
  constexpr auto lf = static_cast<std::size_t>(Parts.sensor);
  constexpr auto n = static_cast<std::size_t>(Parts.order);
  constexpr auto la = static_cast<std::size_t>(Parts.actuator);
  constexpr auto m = static_cast<std::size_t>(Parts.constants);
  constexpr std::size_t order = n + la;
  constexpr std::size_t d = lf + order;
  constexpr std::size_t first_decay = d + m + 2 * static_cast<std::size_t>(Parts.resonators);
  ModelPattern<static_cast<int>(size)> all{};
  auto& p = all.couples;
  // Nonzero elements of A and B.
  for (std::size_t i = 0; i < lf; ++i) {
    for (std::size_t j = 0; j <= lf; ++j) p[i][j] = true;
  }
  for (std::size_t r = 0; r < order; ++r) p[lf + r][lf + r + 1] = true;
  p[d - 1][size] = true;
  for (std::size_t i = Parts.plant_poles ? 0 : n; i < order; ++i) p[d][lf + i + 1] = true;
  if (Parts.plant_poles || la > 0) p[d][size] = true;
  for (std::size_t j = d + 1; j < size; ++j) p[d][j] = j >= d + m || j <= d + la + 1;
  for (std::size_t i = 1; i + 1 < m; ++i) p[d + i][d + i + 1] = true;
  for (std::size_t q = d + m; q < first_decay; q += 2) {
    p[q][q] = p[q][q + 1] = p[q + 1][q] = p[q + 1][q + 1] = true;
  }
  for (std::size_t j = first_decay; j < size; ++j) p[j][j] = true;
  // Elements that become nonzero in their powers.
  for (std::size_t k = 0; k < size; ++k) {
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j <= size; ++j) p[i][j] = p[i][j] || (p[i][k] && p[k][j]);
    }
  }
  // y^(order) = D + b u, and also in D' they occur only as this sum: u has the same effect as D.
  all.driven = static_cast<int>(d);
  for (std::size_t i = 0; i < size; ++i) {
    for (std::size_t j = 0; j < size; ++j) {
      all.place[i][j] = all.kept;
      // The elements of a pure chain: a plant without poles and its integrated disturbance; with an
      // actuator the chain ends at y^(n).
      const std::size_t last = la == 0 ? d + m - 1 : lf + n;
      if (p[i][j] && !Parts.plant_poles && i >= lf && j <= last) {
        all.chain[i][j] =
            static_cast<int>(binomial(static_cast<int>(j - lf), static_cast<int>(i - lf)));
      }
      if (p[i][j] && all.chain[i][j] == 0) ++all.kept;
    }
  }
  return all;
}
template <ModelParts Parts>
inline constexpr auto model_pattern = make_model_pattern<Parts>();

/// The Shape that MatrixModel takes.
template <ModelParts Parts>
struct PartsShape {
  static constexpr ModelParts parts = Parts;
  static constexpr int order = law_order(Parts);
  static constexpr int sinusoids = order + Parts.constants;
  static constexpr int size = model_size(Parts);
  static constexpr int measured_rows = Parts.sensor;
  static constexpr int degree(int state) noexcept { return model_degree(Parts, state); }
  static constexpr const auto& pattern = model_pattern<Parts>;
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
  rules.finite("model.plant", settings.plant);
  check_lag(rules,
            Parts.actuator == 1 ? "model.actuator.time_constant" : "model.actuator.frequency",
            "model.actuator.damping", settings.actuator, time);
  check_sensor(rules, settings.sensor, time);
  check_resonators(rules, settings.resonators, time);
  if constexpr (Parts.follows_speed) {
    const auto& [lowest, highest] = settings.speed;
    rules.positive("model.speed.lowest", lowest)
        .positive("model.speed.highest", highest)
        .require(lowest <= S(1), "model.speed.lowest", lowest, "must be 1 at most")
        .require(highest >= S(1), "model.speed.highest", highest, "must be 1 or more");
    for (const auto& resonance : settings.resonators) {
      rules.require(highest * resonance.frequency * time < S(3.1), "model.speed.highest", highest,
                    "takes a resonator to half the sample rate");
    }
  }
  check_first_order(rules, settings.first_order, time);
  return rules;
}

}  // namespace detail
}  // namespace esokit
