/// @file
/// HeldPlant: a linear plant over a time in which its inputs are held, exactly.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/model/linear_plant.hpp>
#include <type_traits>

namespace esokit {

/// The exact effect of held inputs on a plant over a time t: x(t) = x + increment x + input u +
/// disturbance d.
///
/// exp(A t) - I is kept instead of exp(A t), in which, for a short t, adding I would lose digits of
/// the dynamics.
template <int States, Scalar S = double, int Inputs = 1>
struct HeldPlant {
  Matrix<S, States, States> increment{};    ///< exp(A t) - I
  Matrix<S, States, Inputs> input{};        ///< the integral of exp(A s) B over 0 .. t
  Matrix<S, States, Inputs> disturbance{};  ///< the integral of exp(A s) E over 0 .. t

  /// x at the end of the time. u is added last, because in a loop it is known last.
  [[nodiscard]] ESOKIT_INLINE constexpr Vector<S, States> advanced(
      const Vector<S, States>& x, const Vector<S, Inputs>& u,
      const Vector<S, Inputs>& d) const noexcept {
    Vector<S, States> next;
    detail::unroll<States>([&](auto i) ESOKIT_INLINE_LAMBDA {
      S sum = x(i);
      detail::unroll<States>([&](auto j)
                                 ESOKIT_INLINE_LAMBDA { sum = sum + increment(i, j) * x(j); });
      detail::unroll<Inputs>([&](auto j)
                                 ESOKIT_INLINE_LAMBDA { sum = sum + disturbance(i, j) * d(j); });
      detail::unroll<Inputs>([&](auto j) ESOKIT_INLINE_LAMBDA { sum = sum + input(i, j) * u(j); });
      detail::keep_scalar(sum);  // what is known last would wait for a pair of states
      next(i) = sum;
    });
    return next;
  }
};

/// The plant over `duration` with u and d held. u is the input as it arrives: the dead time is not
/// included.
/// @param duration s, zero or more
/// @return error for a plant that `validate` refuses and for a result that the scalar cannot hold
template <int States, Scalar S, int Inputs, int Outputs>
requires PlainScalar<LaneScalar<S>>
constexpr Expected<HeldPlant<States, S, Inputs>, Error<S>> held_plant(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const S& duration) {
  using Lane = LaneScalar<S>;
  Rules<S> rules;
  rules.all_of(plant.validate()).not_negative("duration", duration);
  if (!rules) return rules.error();
  constexpr int size = States + 2 * Inputs;
  HeldPlant<States, S, Inputs> held;
  for (int lane = 0; lane < lane_count<S>; ++lane) {
    Array<Lane, size * size> stacked{};  // ((A, B, E), (0, 0, 0)), by columns
    Array<Lane, 2 * size * size> work{};
    const auto entry = [&](int i, int j) -> Lane& {
      return stacked[static_cast<std::size_t>(j * size + i)];
    };
    const Lane time = detail::number_of_lane(duration, lane);
    for (int i = 0; i < States; ++i) {
      for (int j = 0; j < States; ++j)
        entry(i, j) = detail::number_of_lane(plant.a(i, j), lane) * time;
      for (int j = 0; j < Inputs; ++j) {
        entry(i, States + j) = detail::number_of_lane(plant.b(i, j), lane) * time;
        entry(i, States + Inputs + j) = detail::number_of_lane(plant.e(i, j), lane) * time;
      }
    }
    // Its loops unrolled: many runs sample as many plants.
    detail::exp_minus_identity(stacked.data(), work.data(), std::integral_constant<int, size>{});
    for (int i = 0; i < States; ++i) {
      for (int j = 0; j < States; ++j) detail::set_lane(held.increment(i, j), entry(i, j), lane);
      for (int j = 0; j < Inputs; ++j) {
        detail::set_lane(held.input(i, j), entry(i, States + j), lane);
        detail::set_lane(held.disturbance(i, j), entry(i, States + Inputs + j), lane);
      }
    }
  }
  const auto fits = [&](const auto& matrix) {
    for (const S& element : matrix) {
      if (!all(is_finite(element))) return false;
    }
    return true;
  };
  rules.demand(fits(held.increment) && fits(held.input) && fits(held.disturbance), "duration",
               duration, "is so long that the plant's states leave the range of the scalar");
  if (!rules) return rules.error();
  return held;
}

}  // namespace esokit
