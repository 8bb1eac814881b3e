// What the image does not use, all of it in float. Compiled only: run.sh looks at what the object
// asks the linker for.

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>

// All members, whether anything calls them or not.
namespace esokit {

using Observer = LinearEso<2, float>;
using Predicting = ExtendedStateFilter<2, float>;

/// Gravity on an arm, by two terms of its sine.
struct Pendulum {
  float gravity{};
  float operator()(const Vector<float, 3>& z) const noexcept {
    return -gravity * z(0) * (1.0f - z(0) * z(0) * 0.1666667f);
  }
};

template class LinearEso<3, float, 2>;
// Not LinearEso by a PoleSet, whose make computes the longest gap in double: once, where it is
// designed.
template class NonlinearEso<2, float, 1, FalGain<float>>;

template class Adrc<Observer, ErrorBased>;
template class Adrc<HalfGainEso<2, float>>;
template class Adrc<ReducedOrderEso<2, float>>;
template class Adrc<DelayedInput<Observer, 4>>;
template class Adrc<WrappedOutput<Observer>>;
template class Adrc<WrappedOutput<OutlierGate<Observer>>>;
template class Adrc<VariableTime<Observer>>;
template class Adrc<KnownModel<Observer, Pendulum>>;
template class Adrc<ModelEso<ModelParts{.order = 2, .plant_poles = true}, float>>;

template class DisturbanceCompensator<Observer>;
template class MimoAdrc<Observer, LinearEso<1, float>>;
template class PredictiveAdrc<Predicting>;
template class TrackingDifferentiator<float>;

}  // namespace esokit
