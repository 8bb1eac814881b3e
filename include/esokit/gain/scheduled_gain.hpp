/// @file
/// The gain law for a model whose frequencies follow a speed: a table of constant gains for several
/// speeds, with interpolation.
#pragma once

#include <cmath>
#include <esokit/gain/model_gain.hpp>

namespace esokit {

/// One ModelGain for each of `Count` speeds, spaced evenly in their logarithm and designed in
/// `make`; `set_speed` interpolates. Decay of the error is proven for each constant speed of the
/// table and, by a check in `make`, half way between two of them. While the speed changes, it holds
/// only if the change is slow in comparison with the decay of the error.
///
/// One constant gain for all speeds is not enough. Designed for a frequency equal to the observer's
/// bandwidth, it tolerates 0.7 to 1.8 times this frequency, for three times the bandwidth only 0.9
/// to 1.2 times.
/// @tparam Count number of speeds in the table, each of MostBridged x N numbers
template <int Size, Scalar S, class Placement, int Count, int MostBridged>
class ScheduledGain {
  static_assert(Count >= 2, "esokit: a schedule needs at least two speeds");
  using One = ModelGain<Size, S, Placement, MostBridged>;

 public:
  /// What the law can do besides `gain`.
  static constexpr GainLawTraits traits{.kind = GainKind::preset, .bridges_gaps = true};
  using Spec = typename Placement::template Spec<Size, S>;  ///< bandwidth or poles

  /// The gains for a set of poles, at all speeds.
  /// @param field name of the config member that holds `spec`, for the error
  /// @param spec poles of the error, checked by the placement @param model a model that follows a
  /// speed
  /// @param index element of `field` that the error names, -1: none
  /// @return error as for ModelGain, or if two speeds of the table are too far apart
  template <SampledModel<S> Model>
  requires(model_traits<Model>.follows_speed) static Expected<ScheduledGain, Error<S>> make(
      const char* field, const Spec& spec, const Model& model, int index = -1) {
    const auto& range = model.settings().speed;
    ScheduledGain law;
    law.lowest_ = range.lowest;
    law.highest_ = range.highest;
    law.longest_gap_ = MostBridged;
    law.per_log_ = range.highest > range.lowest
                       ? static_cast<S>(Count - 1) / std::log(range.highest / range.lowest)
                       : S(0);
    for (int i = 0; i < Count; ++i) {
      const auto one =
          One::make(field, spec, model.at_speed(law.speed_at(static_cast<S>(i))), index);
      if (!one) return one.error();
      for (std::size_t gap = 0; gap < MostBridged; ++gap) {
        law.table_[static_cast<std::size_t>(i)][gap] =
            one->gap_gain(S(0), static_cast<unsigned>(gap + 1));
      }
      law.longest_gap_ = (std::min)(law.longest_gap_, one->longest_gap(MostBridged));
    }
    for (int i = 0; i < Count; ++i) {
      for (const S between : {S(0), S(0.5)}) {
        const S at = (std::min)(S(i) + between, static_cast<S>(Count - 1));
        law.interpolate(at);
        const S speed = law.speed_at(at);
        if (!One::decays(model.at_speed(speed), law.gains_[0])) {
          return Error<S>{"model.speed.highest",
                          range.highest,
                          "is too far from lowest: the error does not decay between two speeds of "
                          "the table, at",
                          -1,
                          speed,
                          true};
        }
      }
    }
    if (auto ok = law.set_speed(S(1)); !ok) return ok.error();
    return law;
  }

  /// Changes to another speed, given as a factor. @return error if it is outside the model's range
  Check<S> set_speed(const S& factor) noexcept {
    Rules<S> rules;
    rules
        .demand(is_finite(factor) && factor >= lowest_,
                {"speed", factor, "must be finite and at least", -1, lowest_, true})
        .demand(factor <= highest_, {"speed", factor, "must be at most", -1, highest_, true});
    if (!rules) return rules.error();
    interpolate(std::log(factor / lowest_) * per_log_);
    return {};
  }

  /// k, scaled; the same for every innovation.
  /// @{
  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain(const S&) const noexcept {
    return gains_[0];
  }
  [[nodiscard]] constexpr const ScaledGain<Size, S>& gain_before_measurement() const noexcept {
    return gains_[0];
  }
  /// @}

  /// k_M, the gain after a gap of M samples.
  [[nodiscard]] constexpr ScaledGain<Size, S> gap_gain(const S&, unsigned samples) const noexcept {
    return gains_[samples < MostBridged ? samples - 1 : MostBridged - 1];
  }

  /// The largest number of missing samples that is bridged at every speed, at most `asked`.
  [[nodiscard]] constexpr int longest_gap(int asked) const noexcept {
    return (std::min)(asked, longest_gap_);
  }

 private:
  using Gains = Array<ScaledGain<Size, S>, MostBridged>;
  ScheduledGain() = default;

  [[nodiscard]] S speed_at(const S& place) const {
    return per_log_ > S(0) ? (std::min)(highest_, S(lowest_ * std::exp(place / per_log_)))
                           : lowest_;
  }

  void interpolate(const S& place) noexcept {
    int first = static_cast<int>(place);
    first = first < 0 ? 0 : first > Count - 2 ? Count - 2 : first;
    const S share = place - static_cast<S>(first);
    const Gains& below = table_[static_cast<std::size_t>(first)];
    const Gains& above = table_[static_cast<std::size_t>(first + 1)];
    for (std::size_t gap = 0; gap < MostBridged; ++gap) {
      for (std::size_t i = 0; i < Size; ++i) {
        gains_[gap][i] = below[gap][i] + share * (above[gap][i] - below[gap][i]);
      }
    }
  }

  Gains gains_{};
  Array<Gains, Count> table_{};
  S lowest_{};
  S highest_{};
  S per_log_{};  ///< table entries per unit of the speed's logarithm
  int longest_gap_ = 0;
};

/// Distinguishes the type in snapshots.
template <int Size, Scalar S, class Placement, int Count, int MostBridged>
inline constexpr std::uint32_t type_tag<ScheduledGain<Size, S, Placement, Count, MostBridged>> =
    make_type_tag<S, Placement>("ScheduledGain", Size, Count, MostBridged);

}  // namespace esokit
