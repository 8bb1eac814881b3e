/// @file
/// The constant of the disturbance among the states of a model, as guards of it see it.
#pragma once

#include <esokit/core/detail/kernels.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/model/sampled_model.hpp>
#include <limits>
#include <utility>

namespace esokit {

/// The unit in which dhat stays constant when b0 changes, and in which its bound is given.
enum class DisturbanceUnit : unsigned char {
  output,  ///< unit of y^(n): a force, which does not depend on b0
  input,   ///< unit of u: a bias of the actuator, which is multiplied by b0
};

namespace detail {

/// Access to the constant of the disturbance in the states: for a chain this is dhat itself.
template <class Model, class S>
struct DisturbanceConstant {
  static_assert(model_traits<Model>.is_chain);
  using State = typename Model::State;
  explicit constexpr DisturbanceConstant(const Model&) noexcept {}

  [[nodiscard]] ESOKIT_INLINE static constexpr S of(const State& x) noexcept {
    return std::get<Model::order>(x);
  }
  /// Replaces the value `now` of the constant by `value`.
  ESOKIT_INLINE static constexpr void put(const Model&, State& x, const S&,
                                          const S& value) noexcept {
    std::get<Model::order>(x) = value;
  }
  /// Whether a sum of constants, of which that of x is the last, is beyond a bound.
  [[nodiscard]] static bool beyond(const State&, const S& sum, const S& bound) noexcept {
    return absolute(sum) > bound;
  }
  /// The same, or at the bound within rounding.
  [[nodiscard]] static bool reaches(const State&, const S& sum, const S& bound) noexcept {
    constexpr S rounding = S(1) - S(8) * std::numeric_limits<S>::epsilon();
    return !(absolute(sum) < bound * rounding);
  }
  /// The state of a plant that stands still at y (scaled), with the disturbance of `x`.
  [[nodiscard]] static State standing(const Model&, const State& x, const S& y) noexcept {
    State still{};
    std::get<0>(still) = y;
    std::get<Model::order>(still) = std::get<Model::order>(x);
    return still;
  }
  /// The state with the disturbance multiplied by `factor`, if `all`.
  [[nodiscard]] static State rescaled(const Model&, State x, const S& factor, bool all) noexcept {
    for (std::size_t r = Model::order; all && r < x.size(); ++r) x[r] = x[r] * factor;
    return x;
  }
  [[nodiscard]] static S scaled(const Model& model, const S& d) noexcept {
    return model.scaled_disturbance(d);
  }
  /// b0 times the u under which the plant of an observer would stand still.
  template <class Observer>
  [[nodiscard]] static S holding(const Observer& observer) noexcept {
    return -observer.total_disturbance();
  }
};

/// For a model with ModelTraits::tells_constant.
template <class Model, class S>
requires(model_traits<Model>.tells_constant) struct DisturbanceConstant<Model, S> {
  using State = typename Model::State;
  using ActuatorRows = decltype(std::declval<const Model&>().actuator_rows());
  static constexpr int lag = ActuatorRows::rows() - 1;                      ///< of the actuator
  static constexpr int driven = Model::measured_rows + Model::order - lag;  ///< state of y^(n)

  explicit DisturbanceConstant(const Model& model) noexcept
      : row(model.constant_row()),
        column(model.constant_column()),
        actuator(model.actuator_rows()) {}

  [[nodiscard]] ESOKIT_INLINE S of(const State& x) const noexcept {
    S sum = std::get<0>(row) * std::get<0>(x);
    unroll<Model::size - 1>([&](auto i) ESOKIT_INLINE_LAMBDA {
      sum = sum + std::get<i + 1>(row) * std::get<i + 1>(x);
    });
    return sum;
  }
  /// Where the states are so large that the sum would not be finite, they stay.
  ESOKIT_INLINE void put(const Model& model, State& x, const S& now,
                         const S& value) const noexcept {
    State next = x;
    replace(next, now, value);
    if (is_finite(model.finite_probe(next))) x = next;
  }
  /// Not by rounding alone: what has been put to the bound stays as it is.
  [[nodiscard]] bool beyond(const State& x, const S& sum, const S& bound) const noexcept {
    return absolute(sum) - bound > rounding_of(x);
  }
  [[nodiscard]] bool reaches(const State& x, const S& sum, const S& bound) const noexcept {
    return bound < (std::numeric_limits<S>::max)() && absolute(sum) >= bound - rounding_of(x);
  }
  /// The state of a plant that stands still at y, with the constant and the actuator of `x` and
  /// without sines.
  [[nodiscard]] State standing(const Model& model, const State& x, const S& y) const noexcept {
    State still{};
    still[0] = y;
    still[Model::measured_rows] = y;
    const State other = model.disturbance_part(still);
    for (std::size_t i = driven; i < x.size(); ++i) still[i] = still[i] - other[i];
    replace(still, S(0), of(x));
    if (lag > 0) add_output(still, x, S(1));
    return still;
  }
  /// The state with b0 v multiplied by `factor`; with `all` also the disturbance.
  [[nodiscard]] State rescaled(const Model& model, State x, const S& factor,
                               bool all) const noexcept {
    const S more = factor - S(1);
    if (all) {
      const State part = model.disturbance_part(x);
      for (std::size_t i = driven; i < x.size(); ++i) x[i] = x[i] + more * part[i];
    } else if (lag > 0) {
      add_output(x, State(x), more);
    }
    return x;
  }
  [[nodiscard]] static S scaled(const Model& model, const S& d) noexcept {
    return model.scaled_constant(d);
  }
  template <class Observer>
  [[nodiscard]] static S holding(const Observer& observer) noexcept {
    return observer.model().holding_input(observer.estimate());
  }

  State row;              ///< see AugmentedModel
  State column;           ///< the same
  ActuatorRows actuator;  ///< the same

 private:
  ESOKIT_INLINE void replace(State& x, const S& now, const S& value) const noexcept {
    const S more = value - now;
    unroll<Model::size>([&](auto i) ESOKIT_INLINE_LAMBDA {
      std::get<i>(x) = std::get<i>(x) + std::get<i>(column) * more;
    });
  }
  /// A bound on the rounding error of `of`.
  [[nodiscard]] S rounding_of(const State& x) const noexcept {
    S sum(0);
    for (std::size_t i = 0; i < x.size(); ++i) sum = sum + absolute(S(row[i] * x[i]));
    return S(8) * std::numeric_limits<S>::epsilon() * sum;
  }
  /// Adds `share` of what the actuator's output contributes to the state `from`.
  void add_output(State& x, const State& from, const S& share) const noexcept {
    const auto output = actuator * detail::column(from);
    for (int i = 0; i <= lag; ++i) {
      S& state = x[static_cast<std::size_t>(driven + i)];
      state = state + share * output(i);
    }
  }
};

}  // namespace detail
}  // namespace esokit
