// Every class compiles with all its members: `template class` of a library's user, with observers
// that do not bear every member. Clang 14 instantiates those whose constraints are not met as well.
// Of the lowest order: what a member calls does not depend on it.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <support/friction.hpp>

namespace esokit {

template class Adrc<LinearEso<1>>;
template class Adrc<LinearEso<1>, ErrorBased>;
template class LinearEso<1>;
template class WrappedOutput<LinearEso<1>>;
template class VariableTime<LinearEso<1>>;
template class OutlierGate<LinearEso<1>>;
template class WrappedOutput<OutlierGate<LinearEso<1>>>;
template class DelayedInput<LinearEso<1>, 3>;
template class Measured<LinearEso<1>, 1, 3>;
template class PredictiveAdrc<Measured<LinearEso<1>, 1, 3>>;
template class ActuatorMap<double>;
// Older Clang instantiates members whose constraint does not hold, too.
#if !defined(__clang__) || __clang_major__ >= 16
template class MappedInput<LinearEso<1>>;
template class MappedInput<Guarded<LinearEso<1>>>;
#endif
template class Adrc<MappedInput<LinearEso<1>>>;
template class PredictiveAdrc<MappedInput<LinearEso<1>>>;
template class DisturbanceCompensator<MappedInput<LinearEso<1>>>;
template class PredictiveAdrc<LinearEso<1>>;
template class DisturbanceCompensator<LinearEso<1>>;
template class MimoAdrc<LinearEso<1>, LinearEso<1>>;
template class Guarded<LinearEso<1>>;
template class Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}>>;
template class ExtendedStateFilter<1>;
template class AlgebraicEso<1>;
template class CascadeEso<1, 2>;
template class AdjustableBandwidthEso<1>;
template class NonlinearEso<1>;
template class KnownModel<LinearEso<1>, esokit_test::Friction<0, double>>;
template class Adrc<WrappedOutput<LinearEso<1>>>;
template class Adrc<VariableTime<LinearEso<1>>>;
template class DisturbanceCompensator<WrappedOutput<LinearEso<1>>>;
template class Adrc<AlgebraicEso<1>>;
template class Adrc<ExtendedStateFilter<1>>;
template class NonlinearFeedback<1>;
template class TrackingDifferentiator<double>;
template class ApproachProfile<2, 3>;
template class FollowProfile<1>;
template class FollowProfile<2>;
template class SmoothProfile<1>;
template class TimeProportioned<double>;
template class Limiter<double>;
template class Fal<double>;
template class ControlLoop<LinearEso<1>>;
template class CovarianceFactor<2, double>;
template class RiccatiGain<2, double>;

}  // namespace esokit

namespace control_explicit_instantiation_static_test {

TEST(ExplicitInstantiation, Links) {
  EXPECT_FALSE(esokit::Adrc<esokit::LinearEso<1>>::make({}).has_value());
}

}  // namespace control_explicit_instantiation_static_test
