/// @file
/// The linear observer and the cascade with a model put together from parts.
#pragma once

#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/scheduled_gain.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/plant_model.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>

namespace esokit {

/// LinearEso that knows actuator, sensor, plant poles or what the disturbance swings at:
///
///     using Eso = ModelEso<ModelParts{.order = 1, .actuator = 1}>;
///     auto eso = Eso::make({.observer_bandwidth = 100, .input_gain = 1, .sample_time = 1e-3,
///                           .model = {.actuator = {.time_constant = 0.02}}});
///
/// Adrc<Eso> has the order of plant and actuator together. See AugmentedModel.
template <ModelParts Parts, PlainScalar S = double, class Placement = EqualPoles>
using ModelEso = LinearEso<AugmentedModel<Parts, S>::order, S, AugmentedModel<Parts, S>::extension,
                           Placement, AugmentedModel<Parts, S>>;

/// CascadeEso that knows the same.
template <ModelParts Parts, int Levels, PlainScalar S = double, class Placement = EqualPoles>
using ModelCascadeEso =
    CascadeEso<AugmentedModel<Parts, S>::order, Levels, S, AugmentedModel<Parts, S>::extension,
               Placement, AugmentedModel<Parts, S>>;

/// LinearEso of a whole plant, with a sensor and a disturbance that may swing or fade and enter
/// elsewhere than u:
///
///     using Eso = PlantEso<3, ModelParts{.order = 2, .resonators = 1}>;
///     auto eso = Eso::make({.observer_bandwidth = 100, .input_gain = plant.input_gain(),
///                           .sample_time = 1e-3,
///                           .model = {.plant = plant, .resonators = {{{.frequency = 314}}}}});
///
/// See LinearPlantModel.
template <int States, ModelParts Parts, PlainScalar S = double, class Placement = EqualPoles>
using PlantEso = LinearEso<Parts.order, S, LinearPlantModel<States, Parts, S>::extension, Placement,
                           LinearPlantModel<States, Parts, S>>;

}  // namespace esokit
