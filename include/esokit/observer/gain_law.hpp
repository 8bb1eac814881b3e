/// @file
/// The seam between the observers: what a gain law is.
#pragma once

#include <concepts>
#include <esokit/core/scalar.hpp>
#include <esokit/design/sampled_gain.hpp>

namespace esokit {

/// A gain law of the sampled predictor-corrector: the only thing that differs between observers.
///
/// Required: `gain(e) const`, the scaled gain k (k_r = T^r / r! times the physical gain;
/// `scaled_gain` converts) for the innovation e = y - z_1, predicted z_1. Pure: the correction may
/// yet be dropped.
///
/// Optional, found by name:
/// - `advance()`: one sample time has passed (schedules, Riccati time update); called in every
///   predict, whether a measurement follows or not.
/// - `accept(e)`: the correction with innovation e was carried out (switching memory, Riccati
///   measurement update).
/// - `reset()`: forget all history.
/// - `gap_gain(e, samples) const`: the gain where `samples` > 1 sample times have passed since the
///   last correction. Without it `gain(e)` is used; a constant nominal gain makes recurring gaps
///   diverge, a law that follows time in `advance()` needs none.
/// - `bears_any_innovation`, a static constant true: `gain(e)` may be asked with an e that is not
///   finite (its answer is then not used); saves the observer a test.
/// - `gain_before_measurement() const`: the gain of the next correction where it does not depend on
///   e. It must equal gain(e).
/// - `shrinking_gain() const`, `otherwise_gain() const`, `shrinks(e) const`: the gain is one of two
///   that are known before the measurement.
/// - `linear_gain() const`, `factor(e) const`: the gain is factor(e) times one that is known before
///   the measurement. These let PredictiveAdrc work ahead.
template <class Law, int Size, class S>
concept GainLaw = std::copyable<Law> && requires(const Law& law, const S& innovation) {
  { law.gain(innovation) }
  noexcept->std::convertible_to<ScaledGain<Size, S>>;
};

/// A gain law whose gain is known before the measurement.
template <class Law, int Size, class S>
concept PresetGainLaw = GainLaw<Law, Size, S> && requires(const Law& law) {
  { law.gain_before_measurement() }
  noexcept->std::convertible_to<ScaledGain<Size, S>>;
};

/// A gain law of a continuous observer: `gain(t, e) const` in physical units, N x 1.
///
/// Optional: `begin_step(t, e)`, called at step boundaries of a simulation; the only place where a
/// switched law may change its mode.
template <class Law, int Size, class S>
concept ContinuousGainLaw = std::copyable<Law> && requires(const Law& law, const S& x) {
  { law.gain(x, x) } -> std::convertible_to<Vector<S, Size>>;
};

}  // namespace esokit
