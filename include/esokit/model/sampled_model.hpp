/// @file
/// What an observer requires of a model of the plant to predict with it.
#pragma once

#include <concepts>
#include <esokit/core/detail/declared_traits.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>

namespace esokit {

/// What a model declares beyond SampledModel, in a member `static constexpr ModelTraits
/// traits{..}`.
struct ModelTraits {
  /// The model is exactly the chain of integrators. Then gains have closed formulas, any gap is
  /// bridged by the gain for the longer step, and stability certificates, error bounds and filter
  /// forms are available. For other models poles are placed numerically, and gaps are bridged by a
  /// gain that stays bounded, see ModelGain.
  bool is_chain = false;

  /// The origin of y may be moved: if a constant is added to y, the model still holds with the same
  /// D. This is also true with known poles if the disturbance has a constant that absorbs the
  /// shift.
  bool shifts_output = false;

  /// Its disturbance has separate rows, from `order` on, so that the estimates of two levels of a
  /// cascade add up. False if row `order` also contains known effects of plant or actuator.
  bool adds_levels = false;

  /// `disturbance_part(x)` is the part of a correction x that belongs to the disturbance and not to
  /// the plant, for a cascade of models without `adds_levels`.
  bool tells_disturbance = false;

  /// `with_corrected_part(..)` gives the part that a gain corrects, and the poles that the model
  /// places itself; see CorrectedPart. Without it, everything is corrected.
  bool corrects_part = false;

  /// The disturbance has one constant, which is separate from its other parts and from the effect
  /// of the actuator: `constant_row()`, `constant_column()`, `actuator_rows()`,
  /// `scaled_constant(d)`, `holding_input(z)`, see AugmentedModel. Guarded holds, gates, bounds
  /// and leaks this constant.
  bool tells_constant = false;

  /// `at_speed(factor)` is the same model with the frequencies of its sines multiplied by `factor`,
  /// see ScheduledGain.
  bool follows_speed = false;
};

/// The traits that a model declares, or the defaults.
template <class Model>
inline constexpr ModelTraits model_traits = detail::declared_traits<Model, ModelTraits>;

/// Settings of a model that has none.
struct NoModelSettings {};

/// A model of plant and disturbance, sampled exactly for an input that is held over the sample.
///
/// Its N states x are scaled so that each has the size of its effect on y within a sample: row r <
/// n is T^r / r! times y^(r), row n is T^n / n! times the total disturbance (the sum of everything
/// that the law has to cancel); the other rows are up to the model. `estimate` has the same rows in
/// physical units, so that laws read what they need without knowing the model.
/// - `drive(u)`, `predict(x, drive)`: Phi x + Gamma u; `add_input(x, u)`: x + Gamma u
/// - `physical(x)`, `physical<Row>(x)`, `scaled(estimate)`, `rescaled(x, before)`: conversions
///   (`before`: the model that was in use until now); `scaled_disturbance(d)`, `same_drive(before)`
/// - `finite_probe(x)`: finite only if all estimates are finite
/// - `equilibrium(y, u)`: the estimate for a plant at rest at y under a constant u
/// - `state_of_row(r)`: place of row r of the estimate among the states; state 0 is the measured
///   value (row 0, unless there is a sensor's lag)
/// - `increment()`: Phi - I, N x N, for the design; `degree(r)`: the power of T in the scaling of
///   state r. If all poles are within a of z = 1, the design scales state r by a^degree(r)
template <class Model, class S>
concept SampledModel = std::copyable<Model> && DeclaresTraits<Model, ModelTraits> &&
    requires(const Model& model, const S& s, const typename Model::State& x,
             const typename Model::Estimate& z) {
  requires std::same_as<typename Model::State, Array<S, Model::size>>;
  requires std::same_as<typename Model::Estimate, Vector<S, Model::size>>;
  requires Model::size == Model::order + Model::extension;
  { model.input_gain() } -> std::convertible_to<S>;
  { model.sample_time() } -> std::convertible_to<S>;
  { model.predict(x, model.drive(s)) } -> std::same_as<typename Model::State>;
  { model.add_input(x, s) } -> std::same_as<typename Model::State>;
  { model.physical(x) } -> std::same_as<typename Model::Estimate>;
  { model.template physical<0>(x) } -> std::convertible_to<S>;
  { model.scaled(z) } -> std::same_as<typename Model::State>;
  { model.rescaled(x, model) } -> std::same_as<typename Model::State>;
  { model.scaled_disturbance(s) } -> std::convertible_to<S>;
  { model.same_drive(model) } -> std::same_as<bool>;
  { model.finite_probe(x) } -> std::convertible_to<S>;
  { model.equilibrium(s, s) } -> std::same_as<typename Model::Estimate>;
  { model.increment() } -> std::same_as<Matrix<S, Model::size, Model::size>>;
  { Model::degree(0) } -> std::same_as<int>;
  { Model::state_of_row(0) } -> std::same_as<int>;
};

namespace detail {
template <class Model, class S>
consteval bool is_a_sampled_model() {
  static_assert(SampledModel<Model, S>,
                "esokit: a model predicts, is scaled and tells its rest as the concept "
                "SampledModel lists, and declares in its `traits` what else it has");
  return SampledModel<Model, S>;
}
}  // namespace detail

}  // namespace esokit
