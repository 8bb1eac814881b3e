// expect: esokit: with the poles of a plant a whole turn is a step of the constant
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/observer/model_eso.hpp>

using Pendulum = esokit::ModelEso<esokit::ModelParts{.order = 2, .plant_poles = true}>;
auto observer = esokit::Guarded<esokit::WrappedOutput<Pendulum>>::make({});
