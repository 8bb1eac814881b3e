// Every class compiles with all its members: `template class` of a library's user, with observers
// that do not bear every member. Clang 14 instantiates those whose constraints are not met as well.
#include <gtest/gtest.h>

#include <esokit/esokit.hpp>
#include <support/friction.hpp>

namespace esokit {

template class Adrc<LinearEso<2>>;
template class Adrc<LinearEso<2, float>, ErrorBased>;
template class LinearEso<2>;
template class WrappedOutput<LinearEso<2>>;
template class VariableTime<LinearEso<2>>;
template class OutlierGate<LinearEso<2>>;
template class WrappedOutput<OutlierGate<LinearEso<2>>>;
template class DelayedInput<LinearEso<2>, 3>;
template class PredictiveAdrc<LinearEso<2>>;
template class DisturbanceCompensator<LinearEso<2>>;
template class MimoAdrc<LinearEso<2>, LinearEso<1>>;
template class Guarded<LinearEso<2>>;
template class Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}>>;
template class ExtendedStateFilter<2>;
template class MimoExtendedStateFilter<ChainOrders<1, 2>, 2>;
template class AlgebraicEso<2>;
template class CascadeEso<2, 2>;
template class AdjustableBandwidthEso<2>;
template class NonlinearEso<2>;
template class KnownModel<LinearEso<2>, esokit_test::Friction<1, double>>;
template class Incremental<Adrc<LinearEso<2>>>;
template class DualFeedbackAdrc<2>;
template class Adrc<WrappedOutput<LinearEso<2>>>;
template class Adrc<VariableTime<LinearEso<2>>>;
template class Adrc<AlgebraicEso<2>>;
template class Adrc<ExtendedStateFilter<2>>;
template class NonlinearFeedback<2>;
template class TrackingDifferentiator<double>;
template class Limiter<double>;
template class Fal<double>;
template class ControlLoop<LinearEso<2>>;
template class CovarianceFactor<3, double>;
template class RiccatiGain<3, double>;

}  // namespace esokit

namespace control_explicit_instantiation_static_test {

TEST(ExplicitInstantiation, Links) {
  EXPECT_FALSE(esokit::Adrc<esokit::LinearEso<2>>::make({}).has_value());
}

}  // namespace control_explicit_instantiation_static_test
