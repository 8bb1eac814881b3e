/// @file
/// Smooth reference profiles: from rest to rest, with all derivatives that a law asks for.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/math/combinatorics.hpp>
#include <limits>

namespace esokit {

/// The polynomial of least degree that goes from 0 to 1 with n derivatives zero at both ends, and
/// these derivatives (for n = 2 the quintic). L. Biagiotti, C. Melchiorri, Trajectory Planning for
/// Automatic Machines and Robots, Springer 2008, section 2.1:
///
///     s(x) = sum_k (-1)^k C(n + k, k) C(2n + 1, n - k) x^(n + 1 + k),  k = 0 .. n
///
/// @param x 0 .. 1; beyond it counts as the end @return (s, s', .., s^(n)), n + 1 x 1
template <int Order, PlainScalar S>
[[nodiscard]] constexpr Vector<S, Order + 1> smooth_step(const S& x) noexcept {
  constexpr int degree = 2 * Order + 1;
  constexpr auto coefficients = [] {
    std::array<S, static_cast<std::size_t>(degree) + 1> c{};
    for (int k = 0; k <= Order; ++k) {
      c[static_cast<std::size_t>(Order + 1 + k)] = static_cast<S>(
          (k % 2 == 0 ? 1 : -1) * binomial(Order + k, k) * binomial(degree, Order - k));
    }
    return c;
  }();
  const S inside = x > S(0) ? (x < S(1) ? x : S(1)) : S(0);
  // Of the second half by symmetry: near 1 the terms would cancel each other.
  const bool second = inside > S(1) / S(2);
  const S at = second ? S(1) - inside : inside;
  auto c = coefficients;
  Vector<S, Order + 1> all;
  for (int i = 0; i <= Order; ++i) {
    S sum(0);
    for (int k = degree; k >= 0; --k) sum = sum * at + c[static_cast<std::size_t>(k)];
    all(i) = !second || i % 2 == 1 ? sum : i == 0 ? S(1) - sum : -sum;
    for (int k = 0; k < degree; ++k) {
      c[static_cast<std::size_t>(k)] = static_cast<S>(k + 1) * c[static_cast<std::size_t>(k + 1)];
    }
    c[static_cast<std::size_t>(degree)] = S(0);
  }
  return all;
}

/// Largest magnitudes of s', .., s^(n) of smooth_step, for n up to 4.
template <int Order>
inline constexpr std::array<double, 4> smooth_step_peaks = [] {
  static_assert(Order >= 1 && Order <= 4, "esokit: profiles are of order 1 to 4");
  constexpr std::array<std::array<double, 4>, 4> table{
      {{1.5},
       {1.875, 5.773502691896258},
       {2.1875, 7.513188404399293, 52.5},
       {2.4609375, 9.371976218494172, 78.75, 622.5327355054054}}};
  return table[Order - 1];
}();

/// Config of SmoothProfile.
template <int Order, class S = double>
requires(detail::is_a_plain_scalar<S>()) struct SmoothProfileConfig {
  [[no_unique_address]] ByName<SmoothProfileConfig> by_name{};  ///< nothing to set, see ByName
  Array<S, Order> limits{};  ///< largest abs(r'), .., abs(r^(n)), unit of the reference / s^i;
                             ///< 0: none. The last one is needed
  S shortest_time{};         ///< no move takes less, s; 0: none
  S sample_time{};           ///< T, s
};

/// Moves a reference from rest to rest within limits: `update(target)` once a sample, then
/// `motion()` is (r, r', .., r^(n)), all that a law of order n asks for.
///
/// Each move is the smooth_step in the least time, a whole number of samples, in which no
/// derivative exceeds its limit. So r^(n) is continuous and zero at both ends, no r is beyond start
/// and target, and r is the target at the end, exactly. A move takes sqrt(5.77 / 4) = 1.2 (n = 2)
/// or (52.5 / 32)^(1/3) = 1.18 (n = 3) times as long as the fastest one with jumps of r^(n).
///
/// A target that changes during a move is taken up at the end of the move: the profile does not
/// stop or turn in between. FollowProfile takes any target at any time, and so does ApproachProfile
/// for a machine of order 1.
template <int Order, class S = double>
requires(detail::is_a_plain_scalar<S>()) class SmoothProfile {
 public:
  static constexpr int order = Order;            ///< n
  static constexpr bool runs_on = true;          ///< a refused target does not stop a move
  using scalar_type = S;                         ///< type of signals and settings
  using Config = SmoothProfileConfig<Order, S>;  ///< settings of make
  using Motion = Vector<S, Order + 1>;           ///< (r, r', .., r^(n))

  /// Checks the settings. @return the profile at rest at zero, or an error that names the field
  [[nodiscard]] static Expected<SmoothProfile, Error<S>> make(const Config& config) {
    Rules<S> rules;
    for (int i = 0; i + 1 < Order; ++i) {
      rules.not_negative("limits", config.limits[static_cast<std::size_t>(i)], i);
    }
    rules.positive("limits", config.limits[Order - 1], Order - 1)
        .not_negative("shortest_time", config.shortest_time)
        .positive("sample_time", config.sample_time);
    if (!rules) return rules.error();
    return SmoothProfile(config);
  }

  /// One sample. @param target where to go, unit of the reference
  /// @return false if the target is not finite, or so far that the move would take 2^30 samples: a
  ///         move that runs goes on, another one does not begin
  bool update(S target) noexcept {
    const bool good = is_finite(target);
    if (!moving()) {
      if (!good || !plan(target)) return false;
    }
    if (moving()) ++sample_;
    return good;
  }

  /// (r, r', .., r^(n)) now, n + 1 x 1.
  [[nodiscard]] Motion motion() const noexcept {
    Motion motion = Motion::Zero();
    motion(0) = target_;
    if (!moving()) return motion;
    const S way = target_ - start_;
    const S count = static_cast<S>(samples_);
    const S x = static_cast<S>(sample_) / count;
    const Motion step = smooth_step<Order>(x);
    // From the nearer end: exact there.
    motion(0) =
        x > S(1) / S(2) ? target_ - way * smooth_step<Order>(S(1) - x)(0) : start_ + way * step(0);
    S scale = way;
    for (int i = 1; i <= Order; ++i) {
      scale = scale / (count * config_.sample_time);
      motion(i) = scale * step(i);
    }
    return motion;
  }

  /// True until the target of the last move is reached.
  [[nodiscard]] bool moving() const noexcept { return sample_ < samples_; }

  /// Duration of the move to a target from rest where the last one ends, s; 0 if it is there.
  [[nodiscard]] S duration(S target) const noexcept {
    const S way = detail::absolute(S(target - target_));
    if (!(way > S(0))) return S(0);
    S time = config_.shortest_time;
    for (int i = 1; i <= Order; ++i) {
      const S limit = config_.limits[static_cast<std::size_t>(i - 1)];
      if (!(limit > S(0))) continue;
      // Roots first: the quotient may leave the scalar's range.
      const S least = root(way, i) / root(limit, i) * root(peak(i), i);
      if (!(time >= least)) time = least;
    }
    return time;
  }

  /// Restarts at rest at `value`; false, and nothing changes, if it is not finite.
  bool reset(S value = S(0)) noexcept {
    if (!is_finite(value)) return false;
    start_ = target_ = value;
    sample_ = samples_ = 0;
    return true;
  }

 private:
  friend struct detail::RecordAccess;
  explicit SmoothProfile(const Config& config) noexcept : config_(config) {}

  /// Longer by more than what rounding adds to the derivatives.
  static constexpr S longer = S(1) + S(64) * std::numeric_limits<S>::epsilon();

  static constexpr S peak(int derivative) noexcept {
    return static_cast<S>(smooth_step_peaks<Order>[static_cast<std::size_t>(derivative - 1)]);
  }

  static S root(const S& x, int degree) noexcept {
    return degree == 1   ? x
           : degree == 2 ? std::sqrt(x)
           : degree == 3 ? std::cbrt(x)
                         : std::sqrt(std::sqrt(x));
  }

  /// Begins a move; false, and nothing changes, if it would take too long.
  bool plan(const S& target) noexcept {
    const S samples = duration(target) / config_.sample_time * longer;
    if (!is_finite(samples) || !(samples < S(1 << 30))) return false;
    const bool stays = !(samples > S(0)) && !(target < target_) && !(target > target_);
    start_ = target_;
    target_ = target;
    sample_ = 0;
    samples_ = stays ? 0 : static_cast<std::int32_t>(std::ceil(samples));
    if (!stays && samples_ == 0) samples_ = 1;
    return true;
  }

  Config config_;
  S start_{};
  S target_{};
  std::int32_t sample_ = 0;
  std::int32_t samples_ = 0;
};

/// Distinguishes the type in snapshots.
template <int Order, PlainScalar S>
inline constexpr std::uint32_t type_tag<SmoothProfile<Order, S>> = make_type_tag<S>("SmoothProfile",
                                                                                    Order);

}  // namespace esokit
