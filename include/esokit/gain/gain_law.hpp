/// @file
/// The concept of a gain law, the only part besides the model in which the observers differ.
#pragma once

#include <concepts>
#include <esokit/core/declared.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <utility>

namespace esokit {

/// How the gain depends on the innovation e, and thus what is known about it before the
/// measurement.
enum class GainKind : unsigned char {
  /// In any way. The observer calls `gain` with finite e only, see `bears_any_innovation`.
  general,
  /// Not at all: `gain_before_measurement() const` is the gain of the next correction.
  preset,
  /// It is one of two: `shrinking_gain() const` if `shrinks(e) const` is true, else
  /// `otherwise_gain() const`. `shrinks` must accept any e, also NaN.
  switched,
  /// It is `factor(e) const` times `linear_gain() const`. `factor` must accept any e, also NaN.
  factored,
};

/// What a gain law can do besides `gain(e)`, declared in a member `static constexpr GainLawTraits
/// traits{..}`. A law with `gain(e)` alone needs no traits. All hooks are noexcept.
struct GainLawTraits {
  GainKind kind = GainKind::general;  ///< the members that it requires must agree with gain(e)

  /// `advance()`: one sample time has passed (schedules, Riccati time update). Called in every
  /// predict, also if no measurement follows.
  bool advances = false;

  /// `accept(e)`: the correction with innovation e was carried out (switching memory, Riccati
  /// measurement update).
  bool accepts = false;

  /// `reset()`: forget all history.
  bool resets = false;

  /// `gap_gain(e, samples) const`: the gain if `samples` (unsigned) > 1 sample times have passed
  /// since the last correction, and `longest_gap(asked) const`: how many missing samples the law
  /// bridges, at most `asked`, so that errors decay in any sequence of gaps; after more the
  /// observer restarts. Without them `gain(e)` is used: a constant gain then diverges in recurring
  /// gaps. A law that follows time in `advance()` does not need these hooks.
  bool bridges_gaps = false;

  /// `gain(e)` may be called with an e that is not finite (the result is then not used); this saves
  /// the observer a test.
  bool bears_any_innovation = false;
};

/// The traits that a gain law declares, or the defaults.
template <class Law>
inline constexpr GainLawTraits gain_law_traits = detail::declared_traits<Law, GainLawTraits>;

namespace detail {

ESOKIT_MEMBER_NAME(advance)
ESOKIT_MEMBER_NAME(accept)
ESOKIT_MEMBER_NAME(reset)
ESOKIT_MEMBER_NAME(gap_gain)
ESOKIT_MEMBER_NAME(bears_any_innovation)
ESOKIT_MEMBER_NAME(gain_before_measurement)
ESOKIT_MEMBER_NAME(shrinking_gain)
ESOKIT_MEMBER_NAME(otherwise_gain)
ESOKIT_MEMBER_NAME(shrinks)
ESOKIT_MEMBER_NAME(linear_gain)
ESOKIT_MEMBER_NAME(factor)
ESOKIT_MEMBER_FUNCTION(advances)
ESOKIT_MEMBER_FUNCTION(accepts)
ESOKIT_MEMBER_FUNCTION(accepted)
ESOKIT_MEMBER_FUNCTION(resets)
ESOKIT_MEMBER_FUNCTION(bridge_gap)
ESOKIT_MEMBER_FUNCTION(gain_for_gap)
ESOKIT_MEMBER_FUNCTION(preset_gain)
ESOKIT_MEMBER_FUNCTION(shrink)
ESOKIT_MEMBER_FUNCTION(factors)

template <class Gain, int Size, class S>
concept GainOf = std::convertible_to<Gain, ScaledGain<Size, S>>;

// The required signatures of the hooks.
template <class Law>
concept Advances = noexcept(std::declval<Law&>().advance());
template <class Law, class S>
concept Accepts = noexcept(std::declval<Law&>().accept(std::declval<const S&>()));
template <class Law>
concept Resets = noexcept(std::declval<Law&>().reset());
template <class Law>
concept LimitsGaps = requires(const Law& law) {
  { law.longest_gap(1) } -> std::same_as<int>;
  requires noexcept(law.longest_gap(1));
};
template <class Law, int Size, class S>
concept BridgesGaps = requires(const Law& law, const S& e, unsigned samples) {
  { law.gap_gain(e, samples) } -> GainOf<Size, S>;
  requires noexcept(law.gap_gain(e, samples));
  requires LimitsGaps<Law>;
};
template <class Law, int Size, class S>
concept Preset = requires(const Law& law) {
  { law.gain_before_measurement() } -> GainOf<Size, S>;
  requires noexcept(law.gain_before_measurement());
};
template <class Law, int Size, class S>
concept Switched = requires(const Law& law, const S& e) {
  { law.shrinking_gain() } -> GainOf<Size, S>;
  { law.otherwise_gain() } -> GainOf<Size, S>;
  { select(law.shrinks(e), e, e) } -> std::convertible_to<S>;
  requires noexcept(law.shrinking_gain())&& noexcept(law.otherwise_gain());
  requires noexcept(law.shrinks(e));
};
template <class Law, int Size, class S>
concept Factored = requires(const Law& law, const S& e) {
  { law.linear_gain() } -> GainOf<Size, S>;
  { law.factor(e) } -> std::convertible_to<S>;
  requires noexcept(law.linear_gain())&& noexcept(law.factor(e));
};

/// Missing samples that all laws bridge, at most `asked`.
template <class Laws>
constexpr int bridged_gap(const Laws& laws, int asked) noexcept {
  if constexpr (gain_law_traits<typename Laws::value_type>.bridges_gaps) {
    for (const auto& law : laws) asked = law.longest_gap(asked);
  }
  return asked;
}

}  // namespace detail

/// `advance()` exists, noexcept, if and only if `traits.advances` declares it.
template <class Law>
concept AdvancesAsDeclared = detail::as_declared(gain_law_traits<Law>.advances,
                                                 detail::names_advance<Law>, detail::Advances<Law>);

/// `accept(e)` exists, noexcept, if and only if `traits.accepts` declares it.
template <class Law, class S>
concept AcceptsAsDeclared = detail::as_declared(gain_law_traits<Law>.accepts,
                                                detail::names_accept<Law>, detail::Accepts<Law, S>);

/// `reset()` exists, noexcept, if and only if `traits.resets` declares it.
template <class Law>
concept ResetsAsDeclared = detail::as_declared(gain_law_traits<Law>.resets,
                                               detail::names_reset<Law>, detail::Resets<Law>);

/// `gap_gain(e, samples) const` and `longest_gap(asked) const` exist, noexcept, if and only if
/// `traits.bridges_gaps` declares them.
template <class Law, int Size, class S>
concept BridgesGapsAsDeclared = detail::as_declared(gain_law_traits<Law>.bridges_gaps,
                                                    detail::names_gap_gain<Law>,
                                                    detail::BridgesGaps<Law, Size, S>);

/// `gain_before_measurement() const` exists, noexcept, if and only if `traits.kind` declares it.
template <class Law, int Size, class S>
concept PresetAsDeclared = detail::as_declared(gain_law_traits<Law>.kind == GainKind::preset,
                                               detail::names_gain_before_measurement<Law>,
                                               detail::Preset<Law, Size, S>);

/// `shrinks(e) const`, `shrinking_gain() const` and `otherwise_gain() const` exist, noexcept, if
/// and only if `traits.kind` declares them.
template <class Law, int Size, class S>
concept SwitchedAsDeclared = detail::as_declared(gain_law_traits<Law>.kind == GainKind::switched,
                                                 detail::names_shrinks<Law> ||
                                                     detail::names_shrinking_gain<Law> ||
                                                     detail::names_otherwise_gain<Law>,
                                                 detail::Switched<Law, Size, S>);

/// `factor(e) const` and `linear_gain() const` exist, noexcept, if and only if `traits.kind`
/// declares them.
template <class Law, int Size, class S>
concept FactoredAsDeclared = detail::as_declared(gain_law_traits<Law>.kind == GainKind::factored,
                                                 detail::names_factor<Law> ||
                                                     detail::names_linear_gain<Law>,
                                                 detail::Factored<Law, Size, S>);

/// No member function has a name that is almost that of a hook, because it would never be called.
template <class Law>
concept HasNoMisspelledHook =
    !detail::calls_advances<Law> && !detail::calls_accepts<Law> && !detail::calls_accepted<Law> &&
    !detail::calls_resets<Law> && !detail::calls_bridge_gap<Law> &&
    !detail::calls_gain_for_gap<Law> && !detail::calls_preset_gain<Law> &&
    !detail::calls_shrink<Law> && !detail::calls_factors<Law> &&
    // Formerly a constant of the law, now declared in `traits`.
    !detail::names_bears_any_innovation<Law>;

/// A gain law of the sampled predictor-corrector.
///
/// Required: `gain(e) const noexcept`, the scaled gain k (k_r = T^r / r! times the physical gain;
/// `scaled_gain` converts) for the innovation e = y - z_1, where z_1 is predicted. It must have no
/// side effect, because the correction may still be rejected. Everything else is declared, see
/// GainLawTraits. A type with a hook that is not declared, is declared but missing, or has another
/// signature is not a gain law.
template <class Law, int Size, class S>
concept GainLaw = std::copyable<Law> && requires(const Law& law, const S& innovation) {
  { law.gain(innovation) }
  noexcept->std::convertible_to<ScaledGain<Size, S>>;
} && DeclaresTraits<Law, GainLawTraits> && AdvancesAsDeclared<Law> && AcceptsAsDeclared<Law, S> &&
    ResetsAsDeclared<Law> && BridgesGapsAsDeclared<Law, Size, S> &&
    PresetAsDeclared<Law, Size, S> && SwitchedAsDeclared<Law, Size, S> &&
    FactoredAsDeclared<Law, Size, S> && HasNoMisspelledHook<Law>;

/// A gain law whose gain is known before the measurement.
template <class Law, int Size, class S>
concept PresetGainLaw = GainLaw<Law, Size, S> && gain_law_traits<Law>
.kind == GainKind::preset;

}  // namespace esokit
