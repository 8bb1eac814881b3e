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
/// Proven by a quadratic function e' P e that falls in each step, found on a workstation for each
/// N. For `reach` it is one P for all x in (0, reach], for `ratio` one P for each ratio of the
/// bandwidth to the shortest step. The search for the worst sequence finds growing ones from 1.05
/// to 1.5 times `reach` on (N = 3 .. 7: x = 18.1, 5.75, 3.54, 2.53, 1.88), half gains with N = 4: 5
/// times.
///
/// A longer step is harmless, too, if enough corrections come before the next one: see GapRecovery.
#pragma once

#include <cstddef>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/scalar.hpp>

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
/// the polynomial that the error was s ago. It proves less the more states there are.
constexpr double reach_by_size(double factor, int size) noexcept { return factor / (size * size); }

/// What longer steps cost, in corrections. With V(e) = e' P^-1 e, P = sum_i (A k)(A k)' / q^i, each
/// ordinary correction takes V to q V at most, and so does one after up to `counted` samples. One
/// after M samples may multiply V by 1 / q^D: then D of the others have to follow before V is below
/// what it was. V q^due, with all that is due, falls over each longer step and never rises. Longer
/// ones than a BridgedSteps allows are taken only while no more than some number is due: at these
/// times V falls with it. If there are none any more, a sequence of bridged steps remains. So
/// errors decay in each sequence of such steps.
///
/// For a chain, V grows at most like M^(2 (N - 2)), so that D rises with the logarithm of M.
template <PlainScalar S>
struct GapRecovery {
  /// What is due where nothing is proven: such a gap restarts.
  static constexpr int never = 2000000000;

  int longest_step = 1;  ///< samples after which any correction may come, see BridgedSteps
  int counted = 0;       ///< samples; 0: nothing is proven of longer steps
  S per_octave{};        ///< corrections
  S free{};              ///< corrections

  /// log2(samples / counted), or up to 0.09 more, without a logarithm.
  [[nodiscard]] constexpr S octaves(unsigned samples) const noexcept {
    auto base = static_cast<unsigned>(counted);
    S all(0);
    for (; samples / 2 >= base; base *= 2) all += S(1);
    // Between powers of two the line is up to 0.0861 below.
    return all + static_cast<S>(samples - base) / static_cast<S>(base) + S(0.0861);
  }

  /// -1: counts as an ordinary correction; else D, or `never`.
  [[nodiscard]] constexpr int due_after(unsigned samples) const noexcept {
    if (counted < 1) return never;
    if (samples <= static_cast<unsigned>(counted)) return -1;
    const S due = per_octave * octaves(samples) - free;
    return due > S(0) ? (due < S(65000) ? static_cast<int>(due) + 1 : never) : 0;
  }
};

/// A GapRecovery by omega_o T alone, found on a workstation for each N for omega_o T up to 10. The
/// unit of `per_octave` and `free` is `counted` + 1.
struct RecoveryBound {
  double reach;  ///< omega_o times the longest step that counts; negative: all do; 0: not proven
  double per_octave = 0;
  double free = 0;
};

/// What is known of a placement by omega_o T alone.
/// @tparam steps, bounds BridgedSteps and RecoveryBound by the number of states
/// @param decay exp(-omega_o T)
template <int Size, auto steps, auto bounds, Scalar S>
constexpr auto recovery_of(const S& decay) noexcept {
  using Plain = TableScalar<S>;
  GapRecovery<Plain> recovery;
  recovery.longest_step = longest_step<Size, steps>(decay);
  constexpr RecoveryBound known = bounds(Size);
  if constexpr (known.reach < 0 || known.reach > 0) {
    constexpr auto counting = [](int) { return BridgedSteps{bounds(Size).reach}; };
    recovery.counted = longest_step<Size, counting>(decay);
    const Plain unit = static_cast<Plain>(recovery.counted + 1);
    recovery.per_octave = Plain(known.per_octave) * unit;
    recovery.free = Plain(known.free) * unit;
  }
  return recovery;
}

/// All poles at exp(-x).
constexpr BridgedSteps equal_steps(int size) noexcept {
  constexpr BridgedSteps table[] = {{-1}, {-1}, {-1}, {14, 4}, {5, 2}, {3}, {2}, {1.3}};
  return size < 8 ? table[size] : BridgedSteps{reach_by_size(14, size)};
}

constexpr RecoveryBound equal_recovery(int size) noexcept {
  constexpr RecoveryBound table[] = {{-1},
                                     {-1},
                                     {-1},
                                     {3.8, 0.3316, -0.2054},
                                     {1.1, 2.1004, 0.1968},
                                     {0.7, 5.4013, 0.44},
                                     {0.25, 24.6452, 3.568},
                                     {0.08, 123.78, 11.87}};
  return size < 8 ? table[size] : RecoveryBound{0};
}

/// Half gains.
constexpr BridgedSteps half_gain_steps(int size) noexcept {
  constexpr BridgedSteps table[] = {{-1}, {-1}, {-1}, {12, 4}, {0.9, 2}, {0.7}, {0.42}, {0.32}};
  return size < 8 ? table[size] : BridgedSteps{reach_by_size(6.4, size)};
}

constexpr RecoveryBound half_gain_recovery(int size) noexcept {
  constexpr RecoveryBound table[] = {{-1},
                                     {-1},
                                     {-1},
                                     {1, 1.5403, 0.1135},
                                     {0.5, 6.1613, 0.5199},
                                     {0.3, 15.4033, 1.3333},
                                     {0.2, 34.6574, 3.0388},
                                     {0.1, 115.5245, 10.9763}};
  return size < 8 ? table[size] : RecoveryBound{0};
}

/// One pole at zero, the others at exp(-x).
constexpr BridgedSteps reduced_steps(int size) noexcept {
  constexpr BridgedSteps table[] = {{-1}, {-1}, {-1}, {11, 4}, {4, 2}, {2.5}, {1.8}, {1.4}, {1.1}};
  return size < 9 ? table[size] : BridgedSteps{0};
}

constexpr RecoveryBound reduced_recovery(int size) noexcept {
  constexpr RecoveryBound table[] = {{-1},
                                     {-1},
                                     {-1},
                                     {3.8, 0.3316, -0.0322},
                                     {2, 1.2603, 0.0215},
                                     {1.3, 3.1991, 1.2638},
                                     {1, 9.242, 4.898},
                                     {0.8, 14.4406, 4.8644}};
  return size < 8 ? table[size] : RecoveryBound{0};
}

}  // namespace esokit::detail
