/// @file
/// The falling-bandwidth gain law of the frequency-shifting-based (FSB) algebraic observer, sampled
/// exactly and for any order and any number of extended states. J. Kasac, A. Pender, M. Pranjic, D.
/// Kotarski, Asian Journal of Control 23 (2021) 2171-2184.
///
/// In continuous time the error obeys (D + mu(t))^N e_1 = d^(m), D = d/dt, mu(t) = lambda + N q /
/// (e^{qt} - 1): its poles start at minus infinity and settle at -lambda. Sampled, with rho =
/// e^{-lambda T}, p = e^{-qT} and [i] = (1 - p^i) / (1 - p), the weights of the gain (see
/// gain/sampled_gain.hpp) at sample k >= N - 1 are
///
///     b_j = C(N,j) rho^{N-j} h_{k+1} .. h_{k+N-j} P_j,
///     P_j = sum_r c_{j,r} u_{k+N-j+1} .. u_{k+N-j+r},
///     u_i = p^{i-N} / [i],  h_i = [i-N] / [i],
///     c_{j,r} = sum_i C(j,i) (1-rho)^{j-i} rho^i t_{i,r},
///     t_{0,0} = 1,  t_{i+1,r} = (1 - p^r) t_{i,r} + [N+r-1] t_{i,r-1}.
///
/// Every term is positive, and the limits lambda -> 0 and q -> 0 are regular. Up to k = N - 1 the
/// observer is deadbeat.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/gain/certificate/detail/bridged_steps.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <limits>

namespace esokit {

/// Gain law of AlgebraicEso. The gain follows a fixed schedule over time, which advances by
/// recursion: one division and no exponential per sample. Once the schedule has settled to within
/// rounding, the gain is constant.
///
/// Every `anchor_interval` samples p^i and [i] are recomputed from an integer count of samples,
/// because the recursion alone accumulates rounding errors. In float, with q = 0 it would stop at i
/// = 2^24, with qT = 1e-8 it would be 1 % off after 1e6 samples. Such an update takes up to 30
/// additional short multiplication steps.
template <int Size, Scalar S>
class AlgebraicGain {
  template <int OtherSize, Scalar OtherS>
  friend class AlgebraicGain;

 public:
  /// What the law can do besides `gain`.
  static constexpr GainLawTraits traits{.kind = GainKind::preset,
                                        .advances = true,
                                        .accepts = true,
                                        .resets = true,
                                        .continues = true,
                                        .bridges_gaps = true};

  using scalar_type = S;  ///< type of gains
  template <class T>
  using with_scalar = AlgebraicGain<Size, T>;  ///< the same with another scalar
  using Count = Lanes<std::uint32_t, S>;       ///< number of samples; for a pack one in each lane

  /// Largest start_index; the sample counter stops there, too.
  static constexpr std::uint32_t max_index = 0x3fffffffu;

  /// Samples between two computations from the integer count, a power of two.
  static constexpr std::uint32_t anchor_interval = 256;

  /// @param bandwidth lambda >= 0, rad/s: the final bandwidth
  /// @param shift q >= 0, rad/s: how fast the bandwidth falls to it
  /// @param start_index k0 >= 0, sample of the schedule at which it starts (soft start)
  /// @param least_age number of samples before the schedule may settle
  AlgebraicGain(const S& bandwidth, const S& shift, const S& sample_time, std::uint32_t start_index,
                const Count& least_age = 0) noexcept
      : final_poles_(EqualSampledPoles<Size, S>::from_bandwidth(bandwidth, sample_time)),
        shift_(EqualSampledPoles<Size, S>::from_bandwidth(shift, sample_time)),
        decay_(decay(shift, sample_time)),
        start_index_(start_index),
        least_age_(least_age) {
    set_coefficients();
    restart();
  }

  /// k, scaled; the same for every innovation.
  /// @{
  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain(const S&) const noexcept { return gain_; }

  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain_before_measurement() const noexcept {
    return gain_;
  }
  /// @}

  /// Goes to the next sample of the schedule. If one of the first N samples is not corrected, the
  /// deadbeat property is lost, and the schedule restarts.
  ESOKIT_INLINE constexpr void advance() noexcept {
    if (settled_ == true) [[likely]]
      return;
    if (together()) [[likely]] {
      advance_schedule();
    } else {
      advance_apart();
    }
  }

  /// Notes that this sample was corrected.
  constexpr void accept(const S&) noexcept { pending_ = false; }

  /// Same as `restart`.
  constexpr void reset() noexcept { restart(); }

  /// Restarts the schedule. (The state of the observer is not part of the law.)
  constexpr void restart() noexcept { resume(0); }

  /// Goes to the place in the schedule that is reached after `age` samples.
  constexpr void resume(std::uint32_t age) noexcept {
    age_ = age;
    pending_ = false;
    settled_ = false;
    // Between samples the registers hold i = k + 1 .. k + N for the last sample k.
    const std::uint32_t next = common_start() + age;
    const std::uint32_t first = next > Size ? next - Size : 0u;
    anchor(first);
    for (int i = 0; i < Size; ++i) push();
    set_gain();
  }

  /// Goes to the place of another law in its schedule. A settled one no longer knows its age, and
  /// stays settled.
  Check<S> continue_from(const AlgebraicGain& other, const S&) {
    resume(other.settled_ ? max_index : other.age_);
    return {};
  }

  /// The gain for the whole gap at the bandwidth of this place in the schedule.
  [[nodiscard]] ScaledGain<Size, S> gap_gain(const S&, unsigned samples) const noexcept {
    if (settled_) return esokit::gap_gain<Size, S>(final_poles_, samples);
    // Deadbeat for the longer step. Its first gain is also 1, so that N consecutive samples still
    // make the estimate exact, and recurring gaps do not diverge.
    if (deadbeat()) return esokit::gap_gain<Size, S>(EqualSampledPoles<Size, S>{S(1.0)}, samples);
    return esokit::gap_gain<Size, S>(present_poles(), samples);
  }

  /// The largest number of missing samples, at most `asked`, up to which errors decay in any
  /// sequence of gaps once the schedule has settled.
  [[nodiscard]] constexpr int longest_gap(int asked) const noexcept {
    const int longest =
        detail::longest_step<Size, detail::equal_steps>(S(S(1.0) - final_poles_.contraction));
    return asked < longest ? asked : longest - 1;
  }

  /// Samples since the schedule began; the count stops when it settles.
  [[nodiscard]] constexpr Count age() const noexcept { return age_; }

  /// Number of samples before the schedule may settle.
  [[nodiscard]] constexpr const Count& least_age() const noexcept { return least_age_; }

  /// True once the gain is that of LinearEso with bandwidth lambda, to within rounding.
  [[nodiscard]] constexpr Lanes<bool, S> settled() const noexcept { return settled_; }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  using Plain = detail::PlainTwin<AlgebraicGain, S>;  ///< type of a lane

  static constexpr int data_members = 16;

  /// True if all lanes of a pack are at the same place of the schedule: then one recursion serves
  /// all. Always true of a plain one that has not settled.
  [[nodiscard]] constexpr bool together() const noexcept {
    return age_ == common_age() && pending_ == detail::of_lane(pending_, 0) && settled_ == false &&
           start_index_ == common_start();
  }
  ESOKIT_COLD constexpr void advance_apart() noexcept {
    detail::for_each_lane<Plain>(*this, [](Plain& lane) { lane.advance(); });
  }
  /// Age of the lanes, if they are together.
  [[nodiscard]] constexpr std::uint32_t common_age() const noexcept {
    return detail::of_lane(age_, 0);
  }

  /// The same for the start of the schedule.
  [[nodiscard]] constexpr std::uint32_t common_start() const noexcept {
    return detail::of_lane(start_index_, 0);
  }

  static S decay(const S& shift, const S& sample_time) noexcept {
    using std::exp;
    return exp(-(shift * sample_time));
  }

  constexpr void advance_schedule() noexcept {
    if (detail::of_lane(pending_, 0) && deadbeat()) [[unlikely]] {
      restart();
    }
    pending_ = true;
    if (common_age() < max_index) age_ = common_age() + 1;
    if (deadbeat()) return;
    if (common_age() % anchor_interval == 0) [[unlikely]] {
      anchor(common_start() + common_age() - 1);
    }
    push();
    set_gain();
    if (!all(std::get<0>(ratios_u_) > settled_below_)) [[unlikely]]
      detail::for_each_lane<Plain>(*this, [](Plain& lane) { lane.settle_if_due(); });
  }

  /// The poles at this place of the schedule, once it is no longer deadbeat.
  [[nodiscard]] constexpr EqualSampledPoles<Size, S> present_poles() const noexcept {
    const S a = final_poles_.contraction;
    return {a + (S(1.0) - a) * (size_bracket_ * std::get<0>(ratios_u_))};
  }

  /// True up to sample N - 1 of the schedule.
  [[nodiscard]] constexpr bool deadbeat() const noexcept {
    return common_start() + common_age() <= Size;
  }

  static constexpr int coefficient_count = Size * (Size + 3) / 2;

  /// Index of c_{j,0}, j = 1 .. N, in the packed triangle of the coefficients.
  static constexpr int row_start(int j) noexcept { return (j - 1) * (j + 2) / 2; }

  /// [count] = 1 + p + .. + p^(count-1).
  [[nodiscard]] constexpr S bracket(std::uint32_t count) const noexcept {
    return bracket(detail::integer<S>(count), shift_.power(count).contraction);
  }

  /// The same, computed from 1 - p^count.
  [[nodiscard]] constexpr S bracket(const S& count, const S& contraction) const noexcept {
    const auto shifting = shift_.contraction > S(0.0);
    const S ratio = contraction / select(shifting, shift_.contraction, S(1.0));
    return select(shifting, ratio, count);
  }

  /// Sets the registers for a next push with i - N = count, accurate to a few units in the last
  /// place.
  ESOKIT_COLD constexpr void anchor(std::uint32_t count) noexcept {
    // Computes p^c and 1 - p^c together: each is obtained from the other where nothing cancels.
    S power(1.0);
    S contraction(0.0);
    S base_power = decay_;
    S base_contraction = shift_.contraction;
    for (std::uint32_t rest = count; rest != 0; rest >>= 1u) {
      if ((rest & 1u) != 0) anchor_take(power, contraction, base_power, base_contraction);
      base_contraction = base_contraction + base_power * base_contraction;
      base_power = squared(base_power, base_contraction);
    }
    power_ = power;
    bracket_ = bracket(detail::integer<S>(count), contraction);
  }
  /// One bit of it.
  ESOKIT_INLINE static constexpr void anchor_take(S& power, S& contraction, const S& base_power,
                                                  const S& base_contraction) noexcept {
    contraction = contraction + power * base_contraction;
    power = power * base_power;
  }
  /// The square of a power of p. @param contraction 1 minus this square
  static constexpr S squared(const S& power, const S& contraction) noexcept {
    return select(contraction < S(0.5), S(S(1.0) - contraction), S(power * power));
  }

  constexpr void set_coefficients() noexcept {
    constexpr auto rows = static_cast<std::size_t>(Size + 1);
    std::array<std::array<S, rows>, rows> t{};
    for (auto& row : t) {
      for (S& x : row) x = S(0.0);
    }
    t[0][0] = S(1.0);
    for (std::size_t i = 0; i + 1 < rows; ++i) {
      for (std::size_t r = 0; r <= i + 1; ++r) {
        const auto count = static_cast<std::uint32_t>(r);
        t[i + 1][r] = shift_.power(count).contraction * t[i][r];
        if (r > 0) t[i + 1][r] = t[i + 1][r] + bracket(Size + count - 1) * t[i][r - 1];
      }
    }
    const S a = final_poles_.contraction;
    const S rho = S(1.0) - a;
    for (int j = 1; j <= Size; ++j) {
      // C(j,i) a^(j-i) rho^i for all i.
      Array<S, Size + 1> mix{};
      for (S& x : mix) x = S(0.0);
      mix[0] = S(1.0);
      for (std::size_t step = 0; step < static_cast<std::size_t>(j); ++step) {
        for (std::size_t i = step + 1; i > 0; --i) mix[i] = mix[i] * a + mix[i - 1] * rho;
        mix[0] = mix[0] * a;
      }
      S front(binomial_table<Size, detail::TableScalar<S>>[Size][static_cast<std::size_t>(j)]);
      for (int i = j; i < Size; ++i) front = front * rho;
      for (int r = 0; r <= j; ++r) {
        S sum(0.0);
        for (int i = r; i <= j; ++i) {
          const auto row = static_cast<std::size_t>(i);
          sum = sum + mix[row] * t[row][static_cast<std::size_t>(r)];
        }
        coefficients_[static_cast<std::size_t>(row_start(j) + r)] = front * sum;
      }
    }
    size_bracket_ = bracket(Size);
    // Below this u the terms with r >= 1, and 1 - h = [N] u, are smaller than the rounding error of
    // the first term.
    constexpr detail::TableScalar<S> unit = detail::rounding<detail::TableScalar<S>>() / 4;
    settled_below_ = S(unit / Size) / size_bracket_;
    for (int j = 1; j <= Size; ++j) {
      const S ratio = S(unit) * coefficients_[static_cast<std::size_t>(row_start(j))] /
                      coefficients_[static_cast<std::size_t>(row_start(j) + 1)];
      settled_below_ = select(ratio < settled_below_, ratio, settled_below_);
    }
  }

  /// Increments i in the registers: adds the next u_i and h_i.
  ESOKIT_INLINE constexpr void push() noexcept {
    const S inverse = S(1.0) / (bracket_ + size_bracket_ * power_);
    detail::unroll<Size - 1>([&](auto i) ESOKIT_INLINE_LAMBDA {
      std::get<i>(ratios_u_) = std::get<i + 1>(ratios_u_);
      std::get<i>(ratios_h_) = std::get<i + 1>(ratios_h_);
    });
    std::get<Size - 1>(ratios_u_) = power_ * inverse;
    std::get<Size - 1>(ratios_h_) = bracket_ * inverse;
    bracket_ = bracket_ + power_;
    power_ = power_ * decay_;
  }

  ESOKIT_INLINE constexpr void set_gain() noexcept {
    PoleWeights<Size, S> weights{};
    S remaining(1.0);
    detail::unroll<Size>([&](auto below) ESOKIT_INLINE_LAMBDA {
      constexpr int j = Size - below;
      // Horner's rule over the u_i, the newest innermost.
      S nested = std::get<row_start(j) + j>(coefficients_);
      detail::unroll<j>([&](auto s) ESOKIT_INLINE_LAMBDA {
        constexpr int r = j - 1 - s;
        nested =
            std::get<row_start(j) + r>(coefficients_) + std::get<Size - j + r>(ratios_u_) * nested;
      });
      std::get<j>(weights) = remaining * nested;
      remaining = remaining * std::get<below>(ratios_h_);
    });
    gain_ = current_gain<Size, S>(weights);
  }

  // Not cold: GCC would compile `settle` for size, and the update that settles is the longest one.
  ESOKIT_INLINE void settle_if_due() noexcept {
    if (all(settled_below_ >= std::get<0>(ratios_u_)) && !(age_ <= least_age_)) settle();
  }
  void settle() noexcept {
    settled_ = true;
    stand();
  }
  constexpr void stand() noexcept { gain_ = current_gain<Size, S>(final_poles_.weights()); }

  ScaledGain<Size, S> gain_{};
  Array<S, coefficient_count> coefficients_{};
  Array<S, Size> ratios_u_{};  ///< u_i for i = k + 1 .. k + N
  Array<S, Size> ratios_h_{};  ///< h_i for the same i
  EqualSampledPoles<Size, S> final_poles_;
  EqualSampledPoles<Size, S> shift_;  ///< 1 - p
  S decay_;                           ///< p
  S size_bracket_{};                  ///< [N]
  S settled_below_{};                 ///< largest u at which the schedule counts as settled
  S power_{};                         ///< p^(i-N) of the next i
  S bracket_{};                       ///< [i-N] of the next i
  Count start_index_;
  Count least_age_;
  Count age_{0};
  Lanes<bool, S> pending_{false};
  Lanes<bool, S> settled_{false};
};

/// Distinguishes the type in snapshots.
template <int Size, Scalar S>
inline constexpr std::uint32_t type_tag<AlgebraicGain<Size, S>> = make_type_tag<S>("AlgebraicGain",
                                                                                   Size);

}  // namespace esokit
