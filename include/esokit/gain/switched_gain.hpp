/// @file
/// The switched gain law: two constant gain sets, chosen at each sample by whether the innovation
/// shrinks.
#pragma once

#include <cmath>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <limits>

namespace esokit {

/// What "the error shrinks" means. The equation in the ABESO paper uses the sign of the derivative
/// of the error; its text uses the derivative of the magnitude, and only this improves on the
/// linear observer.
enum class SignReading : unsigned char {
  magnitude,  ///< |e| is smaller than one sample before; use this one
  printed,    ///< xhat_1 - y, with its sign, is smaller than one sample before
};

namespace detail {

/// The number that has to fall for the error to count as shrinking.
template <Scalar S>
[[nodiscard]] ESOKIT_INLINE constexpr S watched(SignReading reading, const S& e) noexcept {
  if (reading == SignReading::printed) return -e;
  return absolute(e);
}

/// The start value, below which no innovation falls: the first one counts as not shrinking.
template <Scalar S>
[[nodiscard]] constexpr S nothing_watched(SignReading reading) noexcept {
  using Limits = std::numeric_limits<TableScalar<S>>;
  return reading == SignReading::printed ? S(Limits::lowest()) : S(0.0);
}

}  // namespace detail

/// Gain law of AdjustableBandwidthEso: gain set `shrinking` while the innovation shrinks, else
/// `otherwise`. The first innovation counts as not shrinking.
///
/// After a gap the comparison with the last innovation is meaningless, so the gap gain of
/// `otherwise` is used. Bridged are gaps of half the length that either set alone bridges: a search
/// for the worst sequence of gaps and of sets between them found no growth up to there.
template <int Size, Scalar S, class Placement = EqualPoles,
          SignReading Reading = SignReading::magnitude>
class SwitchedGain {
 public:
  using Set = ConstantGain<Size, S, Placement>;  ///< one of the two gain sets
  template <class T>
  using with_scalar = SwitchedGain<Size, T, Placement, Reading>;  ///< the same with another scalar

  /// What the law can do besides `gain`. A NaN counts as not shrinking, so that `gain` accepts any
  /// innovation.
  static constexpr GainLawTraits traits{.kind = GainKind::switched,
                                        .accepts = true,
                                        .resets = true,
                                        .continues = true,
                                        .bridges_gaps = true,
                                        .bears_any_innovation = true};

  /// @param shrinking gains while the innovation shrinks @param otherwise gains at all other times
  constexpr SwitchedGain(const Set& shrinking, const Set& otherwise) noexcept
      : sets_{otherwise, shrinking} {}

  /// k for an innovation, scaled.
  //
  // Whether an innovation shrinks is practically random, so that a mispredicted branch would cost
  // more than the rest of the update. A plain scalar selects the set by address, a pack each
  // element.
  [[nodiscard]] ESOKIT_INLINE constexpr decltype(auto) gain(const S& e) const noexcept {
    const auto is_shrinking = shrinks(e);
    if constexpr (PlainScalar<S>) {
      return sets_[static_cast<std::size_t>(is_shrinking)].gain(e);
    } else {
      ScaledGain<Size, S> chosen;
      detail::unroll<Size>([&](auto r) ESOKIT_INLINE_LAMBDA {
        std::get<r>(chosen) =
            select(is_shrinking, std::get<r>(shrinking_gain()), std::get<r>(otherwise_gain()));
      });
      return chosen;
    }
  }

  /// The gain of `otherwise` for the whole gap.
  [[nodiscard]] ScaledGain<Size, S> gap_gain(const S& e, unsigned samples) const noexcept {
    return sets_[0].gap_gain(e, samples);
  }

  /// The largest number of missing samples that is bridged, at most `asked`.
  [[nodiscard]] constexpr int longest_gap(int asked) const noexcept {
    return detail::half_gap(sets_[1], detail::half_gap(sets_[0], asked));
  }

  /// The correction was carried out: stores e for the comparison with the next innovation.
  ESOKIT_INLINE constexpr void accept(const S& e) noexcept {
    previous_ = detail::watched(Reading, e);
  }

  /// The next innovation counts as not shrinking.
  constexpr void reset() noexcept { previous_ = detail::nothing_watched<S>(Reading); }

  /// Takes over the last innovation from another law.
  Check<S> continue_from(const SwitchedGain& other, const S&) {
    previous_ = other.previous_;
    return {};
  }

  /// True (per lane) if gain(e) is `shrinking_gain`, else it is `otherwise_gain`.
  [[nodiscard]] ESOKIT_INLINE constexpr auto shrinks(const S& e) const noexcept {
    return detail::watched(Reading, e) < previous_;
  }

  /// The two gain sets, scaled.
  /// @{
  [[nodiscard]] constexpr const ScaledGain<Size, S>& shrinking_gain() const noexcept {
    return sets_[1].gain_before_measurement();
  }
  [[nodiscard]] constexpr const ScaledGain<Size, S>& otherwise_gain() const noexcept {
    return sets_[0].gain_before_measurement();
  }
  /// @}

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 2;

  Array<Set, 2> sets_;  ///< {otherwise, shrinking}
  S previous_ = detail::nothing_watched<S>(Reading);
};

/// Distinguishes the type in snapshots.
template <int Size, Scalar S, class Placement, SignReading Reading>
inline constexpr std::uint32_t type_tag<SwitchedGain<Size, S, Placement, Reading>> =
    make_type_tag<S, Placement>("SwitchedGain", Size, Reading);

}  // namespace esokit
