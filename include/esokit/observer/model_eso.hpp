/// @file
/// LinearEso and CascadeEso with a model composed of parts.
#pragma once

#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/scheduled_gain.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/plant_model.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <type_traits>
#include <utility>

namespace esokit {

namespace detail {
template <int States, ModelParts Parts>
consteval bool has_states() {
  static_assert(States >= 1 && (Parts.states == 0 || Parts.states == States),
                "esokit: PlantEso needs the number of states of its plant, 1 or more, first: "
                "PlantEso<3, ModelParts{.order = 2}>");
  return States >= 1 && (Parts.states == 0 || Parts.states == States);
}
}  // namespace detail

/// LinearEso with a model of actuator, sensor, plant poles or the frequencies of the disturbance:
///
/// ```cpp
/// using Eso = ModelEso<ModelParts{.order = 1, .actuator = 1}>;
/// auto eso = Eso::make({.observer_bandwidth = 100, .input_gain = 1, .sample_time = 1e-3,
///                       .model = {.actuator = {.time_constant = 0.02}}});
/// ```
///
/// Adrc<Eso> has the order of plant and actuator together. See AugmentedModel.
template <ModelParts Parts, Scalar S = double, class Placement = EqualPoles>
using ModelEso = LinearEso<AugmentedModel<Parts, S>::order, S, AugmentedModel<Parts, S>::extension,
                           Placement, AugmentedModel<Parts, S>>;

/// CascadeEso with the same model.
template <ModelParts Parts, int Levels, Scalar S = double, class Placement = EqualPoles>
using ModelCascadeEso =
    CascadeEso<AugmentedModel<Parts, S>::order, Levels, S, AugmentedModel<Parts, S>::extension,
               Placement, AugmentedModel<Parts, S>>;

namespace detail {

constexpr ModelParts of_plant(ModelParts parts, int states) noexcept {
  parts.states = states;
  return parts;
}

}  // namespace detail

/// LinearEso of any linear plant, with a sensor: a ModelEso with ModelParts::states. The
/// disturbance may be sinusoidal or decay, and need not enter where u does:
///
/// ```cpp
/// using Eso = PlantEso<3, ModelParts{.order = 2, .resonators = 1}>;
/// auto eso = Eso::make({.observer_bandwidth = 100, .input_gain = plant.input_gain(),
///                       .sample_time = 1e-3,
///                       .model = {.plant = plant, .resonators = {{{.frequency = 314}}}}});
/// ```
template <int States, ModelParts Parts, Scalar S = double, class Placement = EqualPoles>
requires(detail::has_states<States, Parts>())  //
    using PlantEso = ModelEso<detail::of_plant(Parts, States), S, Placement>;

/// CascadeEso with the same model.
template <int States, ModelParts Parts, int Levels, Scalar S = double, class Placement = EqualPoles>
requires(detail::has_states<States, Parts>())  //
    using PlantCascadeEso = ModelCascadeEso<detail::of_plant(Parts, States), Levels, S, Placement>;

/// The parts of a disturbance at the present time, each in the unit of d: that of y^(n), or with
/// ModelParts::states the one defined by E.
template <class Model>
struct DisturbanceParts {
  using S = std::remove_cvref_t<decltype(std::declval<const Model&>().sample_time())>;  ///< scalar

  S constant{};  ///< the constant or polynomial part
  Array<Phasor<S>, Model::parts.resonators>
      sinusoids;                                   ///< each sine: constant() + a sin(phase) + ..
  Array<S, Model::parts.first_order> first_order;  ///< the first-order disturbances
};

/// The parts of the disturbance, as estimated by an observer with a model of parts. The observer
/// may be in adapters or in a controller.
///
/// They are parts of d only; `total_disturbance` also contains the effects of the plant's poles and
/// of the actuator. An error-based controller observes r - y, whose disturbance has the opposite
/// sign.
template <class Observer>
[[nodiscard]] auto disturbance_parts(const Observer& observer) {
  if constexpr (requires {
                  observer.model().constant(observer.estimate());
                  observer.model().parts;
                }) {
    const auto& model = observer.model();
    using Model = std::remove_cvref_t<decltype(model)>;
    const auto z = observer.estimate();
    DisturbanceParts<Model> parts;
    parts.constant = model.constant(z);
    if constexpr (Model::parts.resonators > 0) {
      for (int i = 0; i < Model::parts.resonators; ++i) {
        parts.sinusoids[static_cast<std::size_t>(i)] = model.sinusoidal_disturbance(z, i);
      }
    }
    if constexpr (Model::parts.first_order > 0) {
      for (int i = 0; i < Model::parts.first_order; ++i) {
        parts.first_order[static_cast<std::size_t>(i)] = model.first_order_disturbance(z, i);
      }
    }
    return parts;
  } else {
    static_assert(
        requires { observer.observer(); },
        "esokit: the parts of a disturbance are those of an AugmentedModel");
    return disturbance_parts(observer.observer());
  }
}

}  // namespace esokit
