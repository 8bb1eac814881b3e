/// @file
/// The longest step that a correction of the chain may bridge.
///
/// With all poles of the step over h at rho(h), the error of a step depends on x = omega_o h only
/// (states scaled with omega_o): A(x) = (I - k(x) C) Phi(x). Each A(x) is stable, but their
/// products need not be: N = 4, x = 1.4 and 7.4 in turn diverge. Any sequence of steps decays
///
/// - if all of them are shorter than `reach` / omega_o, or
/// - if none is longer than `ratio` times the shortest one, for every omega_o.
///
/// Proven by a quadratic function e' P e that falls in each step, found on a workstation for
/// each N: for `reach` one P for all x in (0, reach], for `ratio` one P for each ratio of the
/// bandwidth to the shortest step. The search for the worst sequence finds growing ones from 1.05
/// to 1.5 times `reach` on (N = 3 .. 7: x = 18.1, 5.75, 3.54, 2.53, 1.88), half gains with N = 4: 5
/// times.
#pragma once

#include <cstddef>
#include <esokit/core/scalar.hpp>
#include <esokit/core/unroll.hpp>

namespace esokit::detail {

/// See the head of the file.
struct BridgedSteps {
  double reach;   ///< omega_o times the longest step; negative: there is no limit
  int ratio = 1;  ///< longest over shortest step
};

/// The largest `max_gap` of a config, and one step more.
inline constexpr int most_bridged = 65001;

/// e^-x for x >= 0, at compile time.
constexpr double constexpr_decay(double x) noexcept {
  constexpr int squarings = 10;
  const double part = x / (1 << squarings);
  double power = 1.0 / (1.0 + part * (1.0 + part / 2 * (1.0 + part / 3 * (1.0 + part / 4))));
  for (int i = 0; i < squarings; ++i) power *= power;
  return power;
}

/// The longest step that may be bridged, in samples, 1 .. most_bridged.
/// @tparam steps BridgedSteps by the number of states @param decay exp(-omega_o T)
template <int Size, auto steps, Scalar S>
constexpr int longest_step(const S& decay) noexcept {
  constexpr BridgedSteps known = steps(Size);
  constexpr double above_rounding = 1.0001;
  constexpr double least = constexpr_decay(known.reach * above_rounding);
  if (known.reach < 0) return most_bridged;
  Array<S, 16> powers{};  // of exponents 1, 2, 4, ..
  powers[0] = decay;
  for (std::size_t i = 1; i < powers.size(); ++i) powers[i] = powers[i - 1] * powers[i - 1];
  S left(1.0);
  int longest = 0;
  for (std::size_t i = powers.size(); i-- > 0;) {
    const S next = left * powers[i];
    if (next >= constant<S>(least)) {
      left = next;
      longest += 1 << i;
    }
  }
  return longest < known.ratio ? known.ratio : longest < most_bridged ? longest : most_bridged;
}

/// For many states one P is used that has a closed form, the integral of e^-s times the square of
/// the polynomial that the error was s ago: it proves less the more states there are.
constexpr double reach_by_size(double factor, int size) noexcept { return factor / (size * size); }

/// All poles at exp(-x).
constexpr BridgedSteps equal_steps(int size) noexcept {
  constexpr BridgedSteps table[] = {{-1}, {-1}, {-1}, {14, 4}, {5, 2}, {3}, {2}, {1.3}};
  return size < 8 ? table[size] : BridgedSteps{reach_by_size(14, size)};
}

/// Half gains.
constexpr BridgedSteps half_gain_steps(int size) noexcept {
  constexpr BridgedSteps table[] = {{-1}, {-1}, {-1}, {12, 4}, {0.9, 2}, {0.7}, {0.42}, {0.32}};
  return size < 8 ? table[size] : BridgedSteps{reach_by_size(6.4, size)};
}

/// One pole at zero, the others at exp(-x).
constexpr BridgedSteps reduced_steps(int size) noexcept {
  constexpr BridgedSteps table[] = {{-1}, {-1}, {-1}, {11, 4}, {4, 2}, {2.5}, {1.8}, {1.4}, {1.1}};
  return size < 9 ? table[size] : BridgedSteps{0};
}

}  // namespace esokit::detail
