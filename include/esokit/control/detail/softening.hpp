/// @file
/// Softening: lower gains while the law asks for more than the actuator can give, so that the loop
/// recovers from an overload. Scheduled low gain: A. Megretski, L2 BIBO output feedback
/// stabilization with saturated control, IFAC World Congress 1996; Z. Lin, Low Gain Feedback,
/// Springer 1998.
#pragma once

#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/math/combinatorics.hpp>
#include <limits>
#include <optional>

namespace esokit {

/// The gains of an AdrcLaw at the limits, with omega = k_0^(1/n) and s in 1/200 .. 1:
///
///     k_i(s) = (k_i + min(1, (1 - s) / 0.3) (c_i - k_i)) s^(n-i)
///     c_0 = k_0,  c_i = max(k_i, 0.9 C(n, i) omega^(n-i))
///
/// A law for the bandwidth s omega, and well damped: stable with any latency if s is small enough.
/// While abs(u - middle) > 1.1 half the range, 1 / s grows by omega T a sample, else it shrinks by
/// 0.1 omega T down to 1. That is ds/dt = -omega s^2, or 0.1 omega s^2. So the law slows down at
/// its own speed, and speeds up too slowly to oscillate again.
template <int Order, Scalar S = double>
class Softening {
 public:
  using scalar_type = S;  ///< type of signals and settings

  /// Checks the settings.
  /// @param wanted left out: on for n >= 3, if both limits of u are given and k_0 > 0
  /// @return error if it is wanted without both limits of u or without k_0 > 0, or for gains that
  ///         the scalar cannot hold
  ESOKIT_COLD static Expected<Softening, Error<S>> make(const AdrcLaw<Order, S>& law,
                                                        const Limits<S>& limits,
                                                        std::optional<bool> wanted) {
    Softening soft;
    const S first = law.gains()[0];
    const bool limited = limits.lower > Limits<S>{}.lower && limits.upper < Limits<S>{}.upper;
    if (!wanted.value_or(Order >= 3 && limited && first > S(0))) return soft;
    Rules<S> rules;
    rules.demand(limited, "soften", S(1), "needs limits.lower and limits.upper")
        .demand(first > S(0), "gains", first, "must be positive for soften", 0);
    if (!rules) return rules.error();
    soft.bandwidth_ = root(first);
    S power(1);
    for (int i = Order - 1; i > 0; --i) {
      const auto row = static_cast<std::size_t>(i);
      constexpr auto binomials = binomial_table<Order, S>[Order];
      power = power * soft.bandwidth_;
      const S damped = static_cast<S>(damping) * binomials[row] * power;
      const S k = law.gains()[row];
      soft.damped_[row - 1] = k < damped ? damped : k;
      rules.demand(is_finite(S(soft.damped_[row - 1] / law.input_gain())), "gains", first,
                   "gives a softened law that the scalar cannot hold", 0);
    }
    if (!rules) return rules.error();
    return soft;
  }

  /// True if the law is softened at the limits; of a pack a mask.
  [[nodiscard]] constexpr auto on() const noexcept { return S(0.0) < bandwidth_; }
  /// 1 / s.
  [[nodiscard]] constexpr const S& slowness() const noexcept { return slowness_; }

  /// u with the gains k_i(s).
  /// @param lacks r - yhat, r' - yhat', .., and at last r^(n) - dhat
  [[nodiscard]] ESOKIT_COLD S control(const AdrcLaw<Order, S>& law,
                                      const Vector<S, Order + 1>& lacks) const noexcept {
    const S s = S(1.0) / slowness_;
    const S raised = (S(1.0) - s) * detail::constant<S>(1 / 0.3);
    const S share = select(raised < S(1.0), raised, S(1.0));
    S v = lacks(Order);
    S power(1.0);
    for (int i = Order - 1; i >= 0; --i) {
      const auto row = static_cast<std::size_t>(i);
      power = power * s;
      S k = law.gains()[row];
      if (i > 0) k = k + share * (damped_[row - 1] - k);
      v = v + k * power * lacks(i);
    }
    return v / law.input_gain();
  }

  /// Changes s for the next sample. @param u asked for by the law @param time T, s
  ESOKIT_INLINE void judge(const S& u, const Limiter<S>& limiter, const S& time) noexcept {
    if constexpr (PlainScalar<S>) {
      // The usual case, as what follows would leave it.
      const bool idle = !(slowness_ > S(1)) && !(owed_ > S(0));
      if (idle && limiter.lower() <= u && u <= limiter.upper()) return;
    }
    advance(u, limiter, time);
  }

  /// Back to the law as designed.
  constexpr void reset() noexcept {
    slowness_ = S(1.0);
    owed_ = S(0.0);
  }

  /// Takes over the settings of `fresh`; s is kept.
  constexpr void adopt(const Softening& fresh) noexcept {
    const S now = slowness_;
    *this = fresh;
    slowness_ = select(on(), now, S(1.0));
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 4;

  /// x^(1/n); `pow` takes 2 KB of flash.
  static S root(const S& x) noexcept {
    return Order == 1 ? x : Order == 2 ? std::sqrt(x) : std::pow(x, S(1) / static_cast<S>(Order));
  }

  ESOKIT_COLD void advance(const S& u, const Limiter<S>& limiter, const S& time) noexcept {
    const S beyond = detail::constant<S>(overload) * (limiter.upper() - limiter.lower());
    const S step = bandwidth_ * time;
    // Also if u is not a number, because the controller then holds its output.
    const S less = detail::constant<S>(-recovery) * step;
    owed_ = owed_ + select(u < limiter.lower() - beyond, step,
                           select(limiter.upper() + beyond < u, step, less));
    // What is too little for the digits of the sum waits, else float would never recover at a
    // small omega T.
    const S least = S(8.0) * detail::rounding<S>() * slowness_;
    const S paid = select(detail::absolute(owed_) < least, S(0.0), owed_);
    owed_ = owed_ - paid;
    const S next = slowness_ + paid;
    const S most(detail::constant<S>(slowest));
    const S above = select(next < S(1.0), S(1.0), next);
    slowness_ = select(above < most, above, most);
    const S growth = select(owed_ < S(0.0), S(0.0), owed_);
    owed_ = select(S(1.0) < slowness_, owed_, growth);
  }

  // Found with simulated machines that have latency, noise and limits.
  static constexpr double overload = 0.05;  ///< share of the range: 1.1 times its half
  static constexpr double damping = 0.9;
  static constexpr double recovery = 0.1;
  static constexpr double slowest = 200.0;

  Array<S, Order - 1> damped_{};  ///< c_1 .. c_(n-1)
  S bandwidth_{};                 ///< omega; 0: off
  S slowness_ = S(1.0);           ///< 1 / s
  S owed_{};                      ///< change of it that waits
};

}  // namespace esokit
