/// @file
/// What the cycles of an Experiment tell: b0 and latency with an interval.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>

namespace esokit {

/// The result of an experiment, for y^(n) = b0 v(t - L) + d, tau v' + v = u.
template <PlainScalar S>
struct ExperimentResult {
  S input_gain{};             ///< b0, unit of y^(n) per unit of u
  S input_gain_half_width{};  ///< of the 95 % interval of b0
  S least{};                  ///< abs(b0) if all of the latency were dead time
  S largest{};                ///< abs(b0) if all of it were lag
  S latency{};                ///< lag plus dead time, s
  S pole{};                   ///< order 1: a of y' + a y, 1/s; 0 if not visible
  S friction{};               ///< order 2: Coulomb friction, unit of y^(n); 0 if not visible
  S frequency{};              ///< frequency of the cycle, rad/s
  int windows{};              ///< number of windows of two cycles, on which the interval is based
};

namespace detail {

/// Sums over windows of two cycles, and what follows from them; the method is that of Experiment.
template <int Order, PlainScalar S>
class CycleAnalysis {
 public:
  /// @param sample_time T, s @param amplitude A, unit of u
  CycleAnalysis(S sample_time, S amplitude) noexcept : T_(sample_time), amplitude_(amplitude) {}

  /// Adds a sample to the open window. @param difference n-th difference of y
  /// @param input mean of u over the time of the difference, from its middle
  /// @return true if the window is full
  bool add(S difference, S input) noexcept {
    const S weight = S(1) - turn_.re;
    const S c2 = turn_.re * turn_.re - turn_.im * turn_.im, s2 = S(2) * turn_.re * turn_.im;
    const S c4 = c2 * c2 - s2 * s2, s4 = S(2) * c2 * s2;
    sums_[0].add(weight, c2, s2, difference, input);
    level_ += weight * input;
    sums_[1].add(weight, c2 * c4 - s2 * s4, s2 * c4 + c2 * s4, difference, input);
    const ComplexNumber next{turn_.re * step_.re - turn_.im * step_.im,
                             turn_.re * step_.im + turn_.im * step_.re};
    // Corrects the rounding error of its length.
    const S length = S(1.5) - (next.re * next.re + next.im * next.im) / S(2);
    turn_ = {next.re * length, next.im * length};
    if (--left_ > 0) return false;
    close();
    return true;
  }

  /// Begins a window of so many samples: two cycles.
  void open(std::int32_t samples) noexcept {
    window_ = left_ = samples;
    const S angle = S(6.283185307179586L) / S(samples);
    step_ = {std::cos(angle), std::sin(angle)};
    turn_ = {S(1), S(0)};
    sums_[0] = sums_[1] = {};
    level_ = S(0);
    if (least_window_ == 0 || samples < least_window_) least_window_ = samples;
  }

  /// True if a window is open.
  [[nodiscard]] bool is_open() const noexcept { return window_ > 0; }
  /// Number of full windows.
  [[nodiscard]] int windows() const noexcept { return windows_; }

  /// b0 and latency of three windows or more, or an error that names the quantity that is out of
  /// range.
  [[nodiscard]] Expected<ExperimentResult<S>, Error<S>> result() const noexcept {
    using E = Error<S>;
    if (least_window_ < 48)
      return E{"cycle",
               S(least_window_) / S(2),
               "(the shortest, in samples) must be at least",
               -1,
               S(24),
               true};
    const S sign = amplitude_ < S(0) ? S(-1) : S(1);
    const ComplexNumber one{sign * first_.mean.re, sign * first_.mean.im};
    const ComplexNumber three{sign * third_.mean.re, sign * third_.mean.im};
    const S size = magnitude(one);
    const E unusable{"input_gain", size, "is not usable"};
    if (!is_finite(size) || !is_finite(third_.square) || !(size > S(0))) return unusable;
    const S scatter = student() * third_.error() / magnitude(three);
    const Fit whole = fit(one, three, scatter, S(0));
    const Split& at = whole.at;
    const S loss = whole.loss;
    // Relative to b0 A, or to the frequency.
    const S share = Order == 1 ? loss : S(loss / at.gain());
    if (const auto ok = fits(at, share, scatter); !ok) return ok.error();
    S unsure = std::sqrt(at.misfit * at.misfit + scatter * scatter);
    // If u has no third harmonic, or noise hides it, lag and dead time are not separated.
    if (!is_finite(unsure) || unsure > S(1)) unsure = S(1);
    const S middle = at.gain();
    const S down = middle - at.gain(at.ratio * (S(1) + unsure));
    const S up = at.gain(at.ratio * (S(1) - unsure)) - middle;
    const S lag_or_dead = down > up ? down : up;
    const S repeat = student() * first_.error() * middle / size;
    // The uncertainty from this correction: a part of the change, and the effect of an error of the
    // estimated loss. Friction lowers b0 by about twice the square of its share, and was assumed to
    // act equally long in both directions.
    const S changed = detail::absolute(middle - split(one, three).gain());
    S rubbed;
    if constexpr (Order == 2) {
      const S off = unsure / S(4);
      rubbed = changed / S(2) + middle * (S(2) * off * (S(2) * share + off) +
                                          S(1.5) * share * detail::absolute(uneven_));
    } else {
      const S off = S(0.375f) * unsure;
      rubbed = changed / S(4) + middle * off * (share + off / S(2));
    }
    // What a second lag of a quarter of the first would change.
    const S second = middle - fit(one, three, scatter, at.x / S(4)).at.gain();
    ExperimentResult<S> found;
    found.input_gain = sign * middle;
    // The error of treating the lag between samples.
    const S turn = frequency_ * T_;
    const S sampled = middle * turn * turn / S(8);
    found.input_gain_half_width = std::sqrt(lag_or_dead * lag_or_dead + repeat * repeat +
                                            rubbed * rubbed + second * second + sampled * sampled);
    // Sums that only the interval has may have overflowed.
    if (!is_finite(found.input_gain_half_width)) return unusable;
    if (!(found.input_gain_half_width < middle)) {
      return E{"input_gain_half_width",
               found.input_gain_half_width,
               "is too large: noise or a load hides the motion by u; must be below",
               -1,
               middle,
               true};
    }
    found.least = at.size;
    found.largest = at.size * std::sqrt(S(1) + at.longest);
    found.latency = (at.dead + at.x) / frequency_;
    (Order == 1 ? found.pole : found.friction) =
        loss * (Order == 1 ? frequency_ : detail::absolute(amplitude_));
    found.frequency = frequency_;
    found.windows = windows_;
    return found;
  }

 private:
  struct ComplexNumber {
    S re{}, im{};
  };

  /// Running mean and scatter.
  struct Spread {
    ComplexNumber mean{};
    S square{};
    int count = 0;
    void add(ComplexNumber value) noexcept {
      ++count;
      const ComplexNumber before{value.re - mean.re, value.im - mean.im};
      mean.re += before.re / S(count);
      mean.im += before.im / S(count);
      square += before.re * (value.re - mean.re) + before.im * (value.im - mean.im);
    }
    /// Standard error of the mean.
    [[nodiscard]] S error() const noexcept {
      return std::sqrt((square > S(0) ? square : S(0)) / S(count * (count - 1)));
    }
  };

  /// Separates lag and dead time by H_1 and H_3: the squared ratio of their magnitudes is (1 + x^2)
  /// / (1 + 9 x^2), x = w tau.
  struct Split {
    S size{}, angle{}, longest{}, ratio{}, x{}, dead{}, misfit{};
    [[nodiscard]] S square_of_lag(S r) const noexcept {
      const S below = S(9) * r * r - S(1);
      const S square = below > S(0) ? (S(1) - r * r) / below : longest;
      return square < S(0) ? S(0) : square > longest ? longest : square;
    }
    [[nodiscard]] S gain(S r) const noexcept { return size * std::sqrt(S(1) + square_of_lag(r)); }
    [[nodiscard]] S gain() const noexcept { return gain(ratio); }
  };

  static Split split(const ComplexNumber& one, const ComplexNumber& three) noexcept {
    Split at;
    at.size = magnitude(one);
    at.angle = std::atan2(-one.im, one.re);
    const S tangent = at.angle > S(0) && at.angle < S(1.5) ? std::tan(at.angle) : S(0);
    at.longest = tangent * tangent;
    at.ratio = magnitude(three) / at.size;
    at.x = std::sqrt(at.square_of_lag(at.ratio));
    at.dead = at.angle - std::atan(at.x);
    const S expected = S(3) * at.dead + std::atan(S(3) * at.x);
    const S c = std::cos(expected), s = std::sin(expected);
    at.misfit = std::atan2(three.re * s + three.im * c, three.re * c - three.im * s);
    return at;
  }

  /// The rules of a result. @param share of the loss, relative to b0 A or to the frequency
  /// @param scatter of the angle of H_3
  [[nodiscard]] Check<S> fits(const Split& at, S share, S scatter) const noexcept {
    if (!(at.angle > S(0)) || at.angle > S(1.5)) {
      return Error<S>{
          "latency", at.angle / frequency_,
          "does not fit: friction or damping is too large for this amplitude, the cycle is too "
          "short (hysteresis, half_period), or the order or the sign of amplitude is wrong"};
    }
    if (Order == 2 && share > S(0.25))
      return Error<S>{"friction",
                      share,
                      "as a share of b0 A is too large: use a larger amplitude; must be at most",
                      -1,
                      S(0.25),
                      true};
    if (Order == 1 && share > S(1))
      return Error<S>{
          "pole",
          share,
          "as a share of the frequency is too large: use a smaller hysteresis or half_period; "
          "must be at most",
          -1,
          S(1),
          true};
    if (detail::absolute(at.misfit) > S(0.5) && detail::absolute(at.misfit) > S(2) * scatter) {
      return Error<S>{
          "misfit",
          at.misfit,
          "of the third harmonic, rad, is too large: the machine has another order or more "
          "than lag and dead time, or damping or friction is too large; must be at most",
          -1,
          S(0.5),
          true};
    }
    return {};
  }

  static ComplexNumber plus(const ComplexNumber& a, const ComplexNumber& b, S factor) noexcept {
    return {a.re + factor * b.re, a.im + factor * b.im};
  }

  /// Lag and dead time without what turns H_1 in one direction, and H_3 less or in the other:
  /// damping (order 1), relative to the frequency, or friction (order 2).
  struct Fit {
    Split at;
    S loss{};
  };

  /// @param scatter of the angle of H_3 @param second w tau of a second lag that is known
  [[nodiscard]] Fit fit(const ComplexNumber& one, const ComplexNumber& three, S scatter,
                        S second) const noexcept {
    const ComplexNumber lost = Order == 1 ? ComplexNumber{one.im, -one.re} : rubbed_.mean;
    const ComplexNumber lost_third =
        Order == 1 ? ComplexNumber{three.im / S(3), -three.re / S(3)} : rubbed_third_.mean;
    const auto without = [&](S share) {
      const ComplexNumber a = plus(one, lost, share), b = plus(three, lost_third, share);
      return split({a.re - second * a.im, a.im + second * a.re},
                   {b.re - S(3) * second * b.im, b.im + S(3) * second * b.re});
    };
    Fit found{without(S(0)), S(0)};
    // Only if the misfit is larger than noise alone may cause.
    if (!(found.at.misfit < S(0)) || found.at.misfit > -scatter) return found;
    const S most = Order == 1 ? S(1.2f) : S(0.9f) * magnitude(one);
    constexpr int steps = 16;
    S below(0), above(0);
    for (int i = 1; i <= steps && !(above > S(0)); ++i) {
      const S force = most * S(i) / S(steps);
      (without(force).misfit < S(0) ? below : above) = force;
    }
    if (!(above > S(0))) return found;
    for (int i = 0; i < 30; ++i) {
      const S middle = (below + above) / S(2);
      (without(middle).misfit < S(0) ? below : above) = middle;
    }
    found = {without(above), above};
    found.at.misfit = S(0);
    return found;
  }

  /// Sums over two cycles.
  struct Sums {
    ComplexNumber y{}, u{};
    /// The sum of z divided by the sum of u.
    [[nodiscard]] ComplexNumber over_input(const ComplexNumber& z) const noexcept {
      const S square = u.re * u.re + u.im * u.im;
      return {(z.re * u.re + z.im * u.im) / square, (z.im * u.re - z.re * u.im) / square};
    }
    void add(S weight, S c, S s, S difference, S input) noexcept {
      y.re += weight * c * difference;
      y.im -= weight * s * difference;
      u.re += weight * c * input;
      u.im -= weight * s * input;
    }
    [[nodiscard]] ComplexNumber ratio(S power) const noexcept {
      const ComplexNumber h = over_input(y);
      return {h.re / power, h.im / power};
    }
  };

  static S magnitude(const ComplexNumber& z) noexcept { return std::hypot(z.re, z.im); }

  /// Student's factor for the 95 % interval of a mean of `windows_` numbers.
  [[nodiscard]] S student() const noexcept {
    constexpr float table[] = {4.303f, 3.182f, 2.776f, 2.571f, 2.447f, 2.365f, 2.306f, 2.262f};
    return windows_ <= 10 ? static_cast<S>(table[windows_ - 3]) : static_cast<S>(2.228f);
  }

  void close() noexcept {
    const S power = Order == 1 ? T_ : S(T_ * T_);
    first_.add(sums_[0].ratio(power));
    third_.add(sums_[1].ratio(power));
    if constexpr (Order == 2) add_friction();
    ++windows_;
    const S uneven = level_ / (S(window_) * amplitude_);
    uneven_ += (uneven - uneven_) / static_cast<S>(windows_);
    frequency_ +=
        (S(12.566370614359172L) / (S(window_) * T_) - frequency_) / static_cast<S>(windows_);
    window_ = 0;
  }

  /// Adds the contribution to H of a friction force A with the sign of the speed. The speed is
  /// approximated by its first and third harmonic, those of the acceleration divided by j and 3 j,
  /// which give its zeros.
  void add_friction() noexcept {
    const ComplexNumber one{sums_[0].y.im, -sums_[0].y.re};
    const ComplexNumber three{sums_[1].y.im / S(3), -sums_[1].y.re / S(3)};
    S t = S(-1.5707963267948966L) - std::atan2(one.im, one.re);
    S c{}, s{}, c3{}, s3{};
    const auto turn = [&] {
      c = std::cos(t), s = std::sin(t);
      c3 = std::cos(S(3) * t), s3 = std::sin(S(3) * t);
    };
    for (int i = 0; i < 4; ++i) {
      turn();
      const S value = one.re * c - one.im * s + three.re * c3 - three.im * s3;
      const S slope = -(one.re * s + one.im * c) - S(3) * (three.re * s3 + three.im * c3);
      if (slope > S(0)) t -= value / slope;
    }
    turn();
    // Harmonic m of sgn sin(angle - t) is 4 / (pi m) sin; its sum over the window is half of that.
    const S size = S(0.6366197723675814L) * S(window_) * amplitude_;
    rubbed_.add(sums_[0].over_input({-size * s, -size * c}));
    rubbed_third_.add(sums_[1].over_input({-size / S(3) * s3, -size / S(3) * c3}));
  }

  S T_, amplitude_;
  ComplexNumber turn_{}, step_{};
  Sums sums_[2]{};
  Spread first_{}, third_{}, rubbed_{}, rubbed_third_{};
  S level_{}, uneven_{};
  S frequency_{};
  std::int32_t window_ = 0, left_ = 0, least_window_ = 0;
  int windows_ = 0;
};

}  // namespace detail
}  // namespace esokit
