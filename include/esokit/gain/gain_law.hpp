/// @file
/// The concept of a gain law, the only part besides the model in which the observers differ.
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/declared_traits.hpp>
#include <esokit/core/scalar.hpp>
#include <esokit/gain/certificate/detail/bridged_steps.hpp>
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

  /// `continue_from(before, time_ratio)`: goes on with the memory of the law `before` that a retune
  /// replaces (time_ratio = T_new / T_old); an error refuses the retune. Without it the law begins
  /// anew.
  bool continues = false;

  /// `gap_gain(e, samples) const`: the gain if `samples` (unsigned) > 1 sample times have passed
  /// since the last correction. `longest_gap(asked) const`: how many missing samples the law
  /// bridges, at most `asked`, so that errors decay in any sequence of gaps. After more the
  /// observer restarts, or see `recovers`. Without them `gain(e)` is used: a constant gain then
  /// diverges in recurring gaps. A law that follows time in `advance()` does not need these hooks.
  bool bridges_gaps = false;

  /// `recovery(samples, lane) const`: what a correction with `gap_gain` after `samples` means for
  /// the next gap beyond `longest_gap`. -1: nothing, and it counts; else the ordinary corrections
  /// that have to make up for it, or 2000000000 if such a gap restarts the observer, as all do
  /// without it. `lane` is that of a pack, else 0.
  bool recovers = false;

  /// `gain(e)` may be called with an e that is not finite (the result is then not used); this saves
  /// the observer a test.
  bool bears_any_innovation = false;
};

/// The traits that a gain law declares, or the defaults.
template <class Law>
inline constexpr GainLawTraits gain_law_traits = detail::declared_traits<Law, GainLawTraits>;

namespace detail {

template <class Gain, int Size, class S>
concept GainOf = std::convertible_to<Gain, ScaledGain<Size, S>>;

/// @cond
// clang-format off
// The hooks. HOOK: its concept, what declares it, its name, its signature. MISTAKEN: a member
// function that would never be called, as its name is almost that of the hook above.
#define ESOKIT_GAIN_LAW_HOOKS(HOOK, MISTAKEN)                                                     \
  HOOK(Advances, advances, advance, { law.advance() } noexcept;)                                  \
  MISTAKEN(advances)                                                                              \
  HOOK(Accepts, accepts, accept, { law.accept(e) } noexcept;)                                     \
  MISTAKEN(accepts) MISTAKEN(accepted)                                                            \
  HOOK(Resets, resets, reset, { law.reset() } noexcept;)                                          \
  MISTAKEN(resets)                                                                                \
  HOOK(Continues, continues, continue_from,                                                       \
       { law.continue_from(fixed, e) } -> std::same_as<Check<S>>;)                                \
  HOOK(BridgesGaps, bridges_gaps, gap_gain,                                                       \
       { fixed.gap_gain(e, 1u) } noexcept -> GainOf<Size, S>;                                     \
       { fixed.longest_gap(1) } noexcept -> std::same_as<int>;)                                   \
  MISTAKEN(bridge_gap) MISTAKEN(gain_for_gap)                                                     \
  HOOK(Recovers, recovers, recovery, { fixed.recovery(1u, 0) } noexcept -> std::same_as<int>;)    \
  HOOK(Preset, kind == GainKind::preset, gain_before_measurement,                                 \
       { fixed.gain_before_measurement() } noexcept -> GainOf<Size, S>;)                          \
  MISTAKEN(preset_gain)                                                                           \
  HOOK(Shrinks, kind == GainKind::switched, shrinks, requires noexcept(fixed.shrinks(e));         \
       { select(fixed.shrinks(e), e, e) } -> std::convertible_to<S>;)                             \
  MISTAKEN(shrink)                                                                                \
  HOOK(GainsIfShrinking, kind == GainKind::switched, shrinking_gain,                              \
       { fixed.shrinking_gain() } noexcept -> GainOf<Size, S>;)                                   \
  HOOK(GainsOtherwise, kind == GainKind::switched, otherwise_gain,                                \
       { fixed.otherwise_gain() } noexcept -> GainOf<Size, S>;)                                   \
  HOOK(Factors, kind == GainKind::factored, factor,                                               \
       { fixed.factor(e) } noexcept -> std::convertible_to<S>;)                                   \
  MISTAKEN(factors)                                                                               \
  HOOK(GainsLinearly, kind == GainKind::factored, linear_gain,                                    \
       { fixed.linear_gain() } noexcept -> GainOf<Size, S>;)
// clang-format on

#define ESOKIT_GAIN_LAW_HOOK(Hook, declared, name, ...)              \
  ESOKIT_MEMBER_NAME(name)                                           \
  template <class Law, int Size, class S>                            \
  concept Hook = requires(Law & law, const Law& fixed, const S& e) { \
    __VA_ARGS__                                                      \
  };                                                                 \
  template <class Law, int Size, class S>                            \
  concept Hook##AsDeclared =                                         \
      as_declared(gain_law_traits<Law>.declared, names_##name<Law>, Hook<Law, Size, S>);
ESOKIT_GAIN_LAW_HOOKS(ESOKIT_GAIN_LAW_HOOK, ESOKIT_MEMBER_FUNCTION)
ESOKIT_MEMBER_NAME(bears_any_innovation)

#define ESOKIT_AND_GAIN_LAW_HOOK(Hook, ...) &&Hook##AsDeclared<Law, Size, S>
#define ESOKIT_AND_NOT_MISTAKEN_LAW(name) &&!calls_##name<Law>
#define ESOKIT_NOTHING(...)
template <class Law>
concept HasNoMisspelledHook =
    // Formerly a constant of the law, now declared in `traits`.
    !names_bears_any_innovation<Law> ESOKIT_GAIN_LAW_HOOKS(ESOKIT_NOTHING,
                                                           ESOKIT_AND_NOT_MISTAKEN_LAW);
template <class Law, int Size, class S>
concept GainLawAsDeclared = DeclaresTraits<Law, GainLawTraits> ESOKIT_GAIN_LAW_HOOKS(
    ESOKIT_AND_GAIN_LAW_HOOK, ESOKIT_NOTHING);

/// @endcond

template <class Law, int Size, class S>
concept Switched =
    Shrinks<Law, Size, S> && GainsIfShrinking<Law, Size, S> && GainsOtherwise<Law, Size, S>;
template <class Law, int Size, class S>
concept Factored = Factors<Law, Size, S> && GainsLinearly<Law, Size, S>;

/// Missing samples that all laws bridge, at most `asked`.
template <class Laws>
constexpr int bridged_gap(const Laws& laws, int asked) noexcept {
  if constexpr (gain_law_traits<typename Laws::value_type>.bridges_gaps) {
    for (const auto& law : laws) asked = law.longest_gap(asked);
  }
  return asked;
}

/// What a correction after `samples` means for the next long gap, see GainLawTraits::recovers.
template <class Laws>
constexpr int recovery_after(const Laws& laws, unsigned samples, int lane = 0) noexcept {
  int most = GapRecovery<double>::never;
  if constexpr (gain_law_traits<typename Laws::value_type>.recovers) {
    most = -1;
    for (const auto& law : laws) {
      const int due = law.recovery(samples, lane);
      most = due > most ? due : most;
    }
  }
  return most;
}

/// Missing samples after which a correction is possible at all, at most `asked`.
template <class Laws>
constexpr int predicted_gap(const Laws& laws, int asked) noexcept {
  int gap = bridged_gap(laws, asked);
  for (int more = 1 << 16; more > 0; more /= 2) {
    const int longer = gap + more;
    if (longer <= asked &&
        recovery_after(laws, static_cast<unsigned>(longer) + 1u) < GapRecovery<double>::never) {
      gap = longer;
    }
  }
  return gap;
}

}  // namespace detail

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
} && detail::GainLawAsDeclared<Law, Size, S> && detail::HasNoMisspelledHook<Law>;

namespace detail {
template <class Law, int Size, class S>
consteval bool is_a_gain_law() {
  static_assert(GainLaw<Law, Size, S>,
                "esokit: a gain law has `gain(e) const noexcept` with a gain for each state, and "
                "each hook that it has is declared in its `traits`, with the right signature");
  return GainLaw<Law, Size, S>;
}
}  // namespace detail

/// A gain law whose gain is known before the measurement.
template <class Law, int Size, class S>
concept PresetGainLaw = GainLaw<Law, Size, S> && gain_law_traits<Law>
.kind == GainKind::preset;

}  // namespace esokit
