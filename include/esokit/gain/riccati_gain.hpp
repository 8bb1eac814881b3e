/// @file
/// The Riccati gain law of the extended state filter (S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen,
/// Energies 15 (2022) 5799; W. Bai, W. Xue, Y. Huang, H. Fang, Sci. China Inf. Sci. 61 (2018)
/// 042201).
///
/// P- is a bound on the covariance of the error of the predicted state, R the variance of the
/// measurement noise. The inflation theta > 0 accounts for the correlation of the disturbance with
/// the error:
///
///     s = C P- C' + R/(1+theta),  k = P- C' / s                                (24), corrected
///     P- <- (1+theta) Phi (I - k C) P- (I - k C)' Phi' + (Phi k) R (Phi k)'
///           + (1+theta)/theta Q                                               (11)
///
/// In (24) Shi et al. print the transpose of s instead of its inverse, and the predictor gain
/// Phi k instead of k. theta = 0 has no meaning in (11): the plain Kalman filter, without inflation
/// and with noise Q, is a separate rule.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/detail/covariance_factor.hpp>
#include <esokit/gain/gain_law.hpp>
#include <esokit/gain/riccati_settings.hpp>
#include <esokit/model/sampled_model.hpp>
#include <limits>
#include <optional>

namespace esokit {

namespace detail {

/// Phi as the law keeps it.
template <class Model, class S>
using TransitionOf = std::conditional_t<model_traits<Model>.is_chain, PascalTransition,
                                        MatrixTransition<Model::size, S>>;
template <class S, class Model>
TransitionOf<Model, S> transition_of(const Model& model) {
  if constexpr (model_traits<Model>.is_chain) {
    return {};
  } else {
    return MatrixTransition<Model::size, S>::of(model);
  }
}

/// Largest variance, in the unit of the law, for which the recursion does not overflow.
template <Scalar S>
constexpr S largest_variance() noexcept {
  return S(1e-6) * (rounding<S>() / smallest_normal<S>());
}

}  // namespace detail

/// Gain law of ExtendedStateFilter. The gain is known before the measurement. For a missing sample
/// only `advance` is called, which lets the covariance grow, so that no gain for gaps is needed.
///
/// @tparam TableSize gains in the start table
/// @tparam Transition Phi of the model
template <int Size, Scalar S, int TableSize = 0, class Transition = PascalTransition>
class RiccatiGain {
 public:
  /// What the law can do besides `gain`.
  static constexpr GainLawTraits traits{.kind = GainKind::preset,
                                        .advances = true,
                                        .accepts = true,
                                        .resets = true,
                                        .continues = true};

  using Factor = CovarianceFactor<Size, S>;     ///< P-, scaled
  using Settings = RiccatiSettings<Size, S>;    ///< settings of the constructor
  using Gain = ScaledGain<Size, S>;             ///< k, scaled
  using scalar_type = S;                        ///< type of gains and covariances
  static constexpr int table_size = TableSize;  ///< gains in the start table
  template <class T>
  using with_scalar =
      RiccatiGain<Size, T, TableSize,
                  std::conditional_t<std::is_empty_v<Transition>, Transition,
                                     MatrixTransition<Size, T>>>;  ///< with another scalar

  /// The law in its recursive mode; `freeze` changes the mode.
  explicit RiccatiGain(const Settings& settings, const Transition& transition = {}) noexcept
      : transition_(transition),
        measurement_(settings.measurement),
        start_(settings.start),
        noise_(settings.noise),
        unit_(settings.unit),
        trace_weights_(settings.trace_weights),
        rule_(settings.rule),
        diagonal_noise_(settings.noise.diagonal()) {
    if (rule_ == InflationRule::fixed) {
      start_inflation_ = settings.inflation;
      noise_.scale(S((S(1.0) + settings.inflation) / settings.inflation));
    }
    noise_trace_ = S(0.0);
    for (int i = 0; i < Size; ++i) {
      for (int k = 0; k <= i; ++k) {
        const S l = noise_.lower(i, k);
        noise_trace_ = noise_trace_ + trace_weights_[index(i)] * l * l * noise_.variance(k);
      }
    }
    if (!all(measurement_ > S(0.0))) leave_exact_start();
    reset();
  }

  /// Computes the limit and the table, and changes to `mode`. False if there is no limit. This and
  /// `fits` are defined in gain/riccati_gain_design.hpp.
  bool freeze(RiccatiMode mode);

  /// True if the recursion stays within the range of the scalar. With a large inflation it reaches
  /// its largest values in the first samples; with one above 1e6, or so small that Q / theta is
  /// large, it also grows in gaps.
  [[nodiscard]] bool fits() const noexcept;

  /// k of the next correction, scaled; the same for every innovation.
  /// @{
  [[nodiscard]] constexpr const Gain& gain(const S&) const noexcept { return now_.gain; }
  [[nodiscard]] constexpr const Gain& gain_before_measurement() const noexcept { return now_.gain; }
  /// @}

  /// One sample ahead: from the corrected covariance, or from the predicted one if there was no
  /// correction.
  ESOKIT_INLINE constexpr void advance() noexcept {
    // If all lanes are in the same, usual state, they are processed at once.
    const int bits = detail::of_lane(since_, 0) & ~watched;
    const bool alike = since_ == detail::of_lane(since_, 0);
    if (alike && bits > standing && (TableSize == 0 || place_ == done)) [[likely]] {
      note(standing);
    } else if (lane_count<S> > 1 && alike && bits == corrected && recurs_alike()) {
      note(0);
      recur_from_correction();
    } else {
      detail::for_each_lane<Plain>(*this, [](Plain& lane) { lane.advance_alone(); });
    }
  }

  /// The correction was carried out; the next `advance` goes on from the corrected covariance.
  ESOKIT_INLINE constexpr void accept(const S&) noexcept {
    detail::set_bits(since_, -1, corrected);
  }

  /// True if the next `advance` has nothing to compute: the gain is constant, and no sample is
  /// missing.
  [[nodiscard]] ESOKIT_INLINE constexpr bool rests() const noexcept {
    return (since_ & ~watched) > standing;
  }

  /// True if in addition the law is not watched; one test for both.
  [[nodiscard]] ESOKIT_INLINE constexpr bool rests_unwatched() const noexcept {
    return since_ > standing;
  }

  /// True if any lane is watched, see `watch`.
  [[nodiscard]] constexpr bool any_watched() const noexcept {
    auto all = since_;
    detail::set_bits(all, watched, 0);
    return !(all == std::int8_t{0});
  }

  /// Sets whether the observer examines every measurement before it is used (an outlier gate).
  constexpr void watch(bool on) noexcept {
    since_ = static_cast<std::int8_t>((since_ & ~watched) | (on ? watched : 0));
  }
  /// The last argument of `watch`.
  [[nodiscard]] constexpr bool is_watched() const noexcept { return since_ < 0; }

  /// Starts again: from P0, or in the frozen mode with the limit.
  constexpr void reset() noexcept {
    note(mode_ != RiccatiMode::recursive ? standing | nothing_yet : 0);
    place_ = mode_ == RiccatiMode::start_table ? std::uint16_t{0} : done;
    current_measurement_ = measurement_;
    if (mode_ == RiccatiMode::frozen) {
      now_ = limit_;
    } else {
      now_.factor = start_;
      set_inflation(start_inflation_);
      set_gain();
    }
  }

  /// Sets another noise variance, for the next correction only. @param variance R, unit of y
  /// squared, not negative
  constexpr void set_measurement_variance(const S& variance) noexcept {
    note(since_ & (corrected | gapped));
    // Limited so that no sum with it overflows, also not in the unit of y squared. A measurement
    // with a variance so large has no effect anyway.
    const S most = S(1.0) / (S(16.0) * detail::smallest_normal<S>());
    const S held = select(variance < most, variance, most) / unit_;
    current_measurement_ = select(held < most, held, most);
    set_gain();
  }

  /// R, unit of y squared, to within rounding.
  [[nodiscard]] constexpr S measurement_variance() const noexcept { return measurement_ * unit_; }

  /// Continues with the covariance of a law with other settings. @param time_ratio T_new / T_old
  /// @return an error if the scalar cannot hold that covariance in this law's unit
  Check<S> continue_from(const RiccatiGain& other, const S& time_ratio) {
    // Both laws are at their limit: nothing to take over.
    if (mode_ == RiccatiMode::frozen && other.stands()) return {};
    now_.factor = other.now_.factor;
    now_.factor.rescale(time_ratio, S(other.unit_ / unit_), transition_);
    if (rule_ == InflationRule::adaptive) set_inflation(other.now_.inflation);
    set_gain();
    note(other.since_ & corrected);
    if ((since_ & corrected) != 0) {
      now_.share = other.now_.share;
      now_.rest = other.now_.rest;
    }
    for (int i = 0; i < Size; ++i) {
      if (!all(is_finite(now_.gain[index(i)])) ||
          !all(now_.factor.variance(i) < detail::largest_variance<S>()) ||
          !all(is_finite(now_.factor.variance(i)))) {
        return Error<S>{"measurement_variance", measurement_variance(),
                        "is too small, or sample_time changed too much, to carry over the present "
                        "covariance: measure first"};
      }
    }
    return {};
  }

  /// Bound on the covariance of the error of the present estimate, N x N, scaled: after `advance`
  /// that of the prediction, after `accept` that of the corrected estimate.
  [[nodiscard]] Matrix<S, Size, Size> covariance() const noexcept {
    Factor factor = now_.factor;
    if ((since_ & corrected) != 0) {
      // (I - k C) P- (I - k C)' + k R k'. The recursion uses R/(1+theta) in place of R, because the
      // inflation does not apply to the noise.
      factor.set_variance(0, S(factor.variance(0) * now_.rest * now_.rest +
                               now_.share * now_.share * current_measurement_));
    }
    return factor.matrix() * unit_;
  }

  /// Variance of the innovation after the last prediction, C P- C' + R, unit of y squared.
  [[nodiscard]] constexpr S innovation_variance() const noexcept {
    return (now_.factor.variance(0) + current_measurement_) * unit_;
  }

  /// P- of the last prediction, scaled and divided by the unit.
  [[nodiscard]] constexpr const Factor& covariance_factor() const noexcept { return now_.factor; }

  /// theta of the present gain.
  [[nodiscard]] constexpr const S& inflation() const noexcept { return now_.inflation; }

  /// True while the recursion does not run: the gain is the limit or from the table.
  [[nodiscard]] constexpr Lanes<bool, S> stands() const noexcept {
    Lanes<bool, S> all{};
    for (int i = 0; i < lane_count<S>; ++i) {
      detail::of_lane(all, i) = (detail::of_lane(since_, i) & standing) != 0;
    }
    return all;
  }

  /// The limit gain (modes frozen and start_table), and the last gain of the table.
  /// @{
  [[nodiscard]] constexpr const Gain& limit_gain() const noexcept { return limit_.gain; }
  [[nodiscard]] constexpr const Gain& last_table_gain() const noexcept requires(TableSize > 0) {
    return table_.back().gain;
  }
  /// @}

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 17;
  friend struct detail::RecordAccess;
  using Plain = detail::PlainTwin<RiccatiGain, S>;  ///< type of a lane
  template <int OtherSize, Scalar Other, int OtherTable, class OtherTransition>
  friend class RiccatiGain;

  // Bits of `since_`: what happened since the last `advance`, and whether the gain is constant. In
  // one number, so that a frozen filter needs only one test.
  static constexpr int corrected = 1;
  static constexpr int nothing_yet = 2;  ///< after a reset to a constant gain
  static constexpr int gapped = 4;       ///< no correction before the last `advance` either
  static constexpr std::uint16_t done = TableSize + 1;  ///< value of `place_` after the table
  static constexpr int standing = 8;    ///< gain is constant; above the others, see `rests`
  static constexpr int watched = -128;  ///< the sign bit, see `rests_unwatched`

  ESOKIT_INLINE constexpr void note(int bits) noexcept { detail::set_bits(since_, watched, bits); }

  /// A gain and the covariance from which it follows.
  struct Point {
    Gain gain{};
    Factor factor{};  ///< P-
    S share{};        ///< k_1 = C P- C' / s
    S rest{1.0};      ///< 1 - k_1
    S inflation{};    ///< theta
    S growth{1.0};    ///< 1 + theta
    S shrink{1.0};    ///< 1 / (1 + theta)
  };

  static constexpr std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }

  /// True if gain and covariance times `room` are finite.
  [[nodiscard]] bool fits(const S& room) const noexcept;

  /// The P- / R above which an estimate of y depends on the measurement only. In a gap P- then
  /// grows along the chain only, without Q: more growth would cost the digits in which the states
  /// differ.
  static constexpr S ceiling() noexcept { return S(1.0) / detail::rounding<S>(); }

  /// With exact measurements and an exactly known state the recursion starts at a fixed point at
  /// which the estimate inverts the chain and diverges (n = 3: by a factor of 3.7 a sample). The
  /// fixed point is unstable, but without a rounding error the recursion would not leave it.
  void leave_exact_start() noexcept {
    const S least = detail::rounding<S>();  // without R the unit is the largest variance
    for (int i = 0; i < Size; ++i) {
      if (!all(start_.variance(i) > least)) start_.set_variance(i, least);
    }
  }

  ESOKIT_INLINE constexpr void advance_alone() noexcept {
    if (rests()) [[likely]] {
      note(standing);
      if (TableSize > 0 && place_ <= TableSize) next_of_table();
    } else {
      recur();
    }
  }

  /// True if the recursion of all lanes has the same terms.
  [[nodiscard]] constexpr bool recurs_alike() const noexcept {
    const InflationRule rule = detail::of_lane(rule_, 0);
    return mode_ == RiccatiMode::recursive && rule_ == rule && rule != InflationRule::adaptive &&
           diagonal_noise_ == detail::of_lane(diagonal_noise_, 0);
  }

  [[gnu::__noinline__]] constexpr void recur() noexcept {
    const bool had_correction = (since_ & corrected) != 0;
    const bool in_gap = since_ == gapped || since_ == (gapped | watched);
    note(had_correction ? 0 : gapped);
    if (in_gap && !all(now_.factor.variance(0) < ceiling())) [[unlikely]] {
      recur_at_ceiling();
    } else {
      recur_usually(had_correction);
    }
    if (mode_ != RiccatiMode::recursive) [[unlikely]]
      stand_if_close();
  }

  constexpr void recur_at_ceiling() noexcept {
    now_.factor.advance_seldom(S(1.0), Factor{}, transition_);
    // It still grows as samples^(2N-2) and would overflow. By now the gain is that for exact
    // measurements, which a common factor on all variances does not change.
    const S most = S(1024.0) * ceiling();
    const S variance = now_.factor.variance(0);
    if (const auto fits = variance < most; records<S> || !all(fits)) {
      now_.factor.scale(select(fits, S(1.0), S(most / variance)));
    }
    take_factor();
  }

  ESOKIT_INLINE constexpr void recur_usually(bool had_correction) noexcept {
    Factor scaled;
    const Factor* noise = &noise_;
    if (rule_ == InflationRule::adaptive) [[unlikely]] {
      scaled = adapt(had_correction);
      noise = &scaled;
    } else if (had_correction) [[likely]] {
      now_.factor.set_variance(0, S(now_.factor.variance(0) * now_.rest));
    }
    advance_factor(*noise);
    take_factor();
  }

  ESOKIT_INLINE constexpr void take_factor() noexcept {
    current_measurement_ = measurement_;
    set_gain();
  }

  /// `recur` for the usual case, after a correction.
  [[gnu::__noinline__]] constexpr void recur_from_correction() noexcept {
    now_.factor.set_variance(0, S(now_.factor.variance(0) * now_.rest));
    advance_factor(noise_);
    take_factor();
  }

  /// Sets theta^2 = tr W Q / tr W (A + K C) P- (A + K C)' and the covariance to be advanced, and
  /// returns the noise for this theta. The gain of this sample was computed with the previous
  /// theta: theta and gain depend on each other, and the bound holds for any gain.
  ESOKIT_COLD constexpr Factor adapt(bool had_correction) noexcept {
    using std::sqrt;
    const S before = now_.factor.variance(0);
    if (had_correction) now_.factor.set_variance(0, S(before * now_.rest * now_.rest));
    const S trace = now_.factor.transported_trace(trace_weights_, transition_);
    // Limited, because theta would be infinite for P- = 0, and zero for a P- that grows without
    // bound.
    const S most = S(1e3);
    const S least = S(1e-6);
    const auto some = trace > S(0.0);
    S theta = sqrt(S(noise_trace_ / select(some, trace, S(1.0))));
    theta = select(some, theta, most);
    theta = select(theta < most, theta, most);
    theta = select(theta > least, theta, least);
    set_inflation(theta);
    if (had_correction) {
      const S spread = now_.share * now_.share * (current_measurement_ * now_.shrink);
      now_.factor.set_variance(0, S(now_.factor.variance(0) + spread));
    }
    Factor noise = noise_;
    noise.scale(S(now_.growth / theta));
    return noise;
  }

  ESOKIT_INLINE constexpr void advance_factor(const Factor& noise) noexcept {
    if (detail::of_lane(diagonal_noise_, 0)) [[likely]] {
      now_.factor.template advance<true>(now_.growth, noise, transition_);
    } else {
      now_.factor.template advance<false>(now_.growth, noise, transition_);
    }
  }

  constexpr void set_inflation(const S& theta) noexcept {
    now_.inflation = theta;
    now_.growth = S(1.0) + theta;
    now_.shrink = S(1.0) / now_.growth;
  }

  ESOKIT_INLINE constexpr void set_gain() noexcept {
    const S noise = current_measurement_ * now_.shrink;
    const S variance = now_.factor.variance(0);
    const S sum = variance + noise;
    // If P- and R are zero, the prediction is exact and nothing is corrected. The inverse of a
    // subnormal sum would overflow.
    const auto some = sum >= detail::smallest_normal<S>();
    const S inverse = S(1.0) / select(some, sum, S(1.0));
    now_.share = variance * inverse;
    now_.rest = select(some, S(noise * inverse), S(1.0));
    now_.gain = now_.factor.gain(now_.share);
  }

  /// Returns to the limit when the covariance differs from it by less than a thousandth. To compare
  /// the gain is not enough: a nearly deadbeat gain tells little about the covariance, which
  /// decides whether recurring gaps are stable.
  ESOKIT_COLD constexpr void stand_if_close() noexcept {
    if (!now_.factor.close_to(limit_.factor, S(1e-3))) return;
    note(standing);
    place_ = done;
    now_ = limit_;
  }

  constexpr void next_of_table() noexcept {
    now_ = place_ < TableSize ? table_[place_] : limit_;
    ++place_;
  }

  [[nodiscard]] std::optional<Point> find_limit() const;

  // Members that every step uses come first.
  Point now_{};
  Lanes<std::int8_t, S> since_{};
  Lanes<RiccatiMode, S> mode_ = RiccatiMode::recursive;
  Lanes<std::uint16_t, S> place_{};  ///< next place in the table; `done`: past the limit
  S current_measurement_{};          ///< R of the next correction

  [[no_unique_address]] Transition transition_;
  S measurement_;
  Factor start_;
  Factor noise_;  ///< Q, for the fixed rule times (1+theta)/theta
  S start_inflation_{};
  S unit_;
  S noise_trace_{};
  Array<S, Size> trace_weights_;
  Lanes<InflationRule, S> rule_;
  Lanes<bool, S> diagonal_noise_;
  Point limit_{};
  Array<Point, TableSize> table_{};
};

/// Distinguishes the type in snapshots.
template <int Size, Scalar S, int TableSize, class Transition>
inline constexpr std::uint32_t type_tag<RiccatiGain<Size, S, TableSize, Transition>> =
    make_type_tag<S>("RiccatiGain", Size, TableSize);

}  // namespace esokit
