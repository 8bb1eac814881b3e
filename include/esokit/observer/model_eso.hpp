/// @file
/// The linear observer and the cascade with a model put together from parts.
#pragma once

#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/scheduled_gain.hpp>
#include <esokit/model/augmented_model.hpp>
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

}  // namespace esokit
