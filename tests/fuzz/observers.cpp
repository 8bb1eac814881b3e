// Every observer and every adapter in its nestings; a new one joins by a line.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>

#include <support/friction.hpp>

#include "fuzz/driver.hpp"
#include "fuzz/kinds.hpp"

namespace fuzz {

using namespace esokit;
using esokit_test::Friction;

constexpr ModelParts poles_and_lags{.order = 2, .plant_poles = true, .actuator = 1, .sensor = 1};

void add_observers(std::vector<Kind>& kinds) {
  KIND(LinearEso<2, double>);
  KIND(LinearEso<3, float, 2>);
  KIND(LinearEso<2, float, 1, PoleSet>);
  KIND(CascadeEso<1, 2, double, 2, PoleSet>);
  KIND(AlgebraicEso<2, float>);
  KIND(AdjustableBandwidthEso<2, float>);
  KIND(NonlinearEso<1, float>);
  KIND(WrappedOutput<LinearEso<1, float>>);
  KIND(WrappedOutput<VariableTime<DelayedInput<LinearEso<2, float>, 3>>>);
  KIND(DelayedInput<KnownModel<WrappedOutput<CascadeEso<2, 2, double>>, Friction<1, double>>, 3>);
  KIND(WrappedOutput<ModelCascadeEso<poles_and_lags, 2, double>>);
  KIND(OutlierGate<LinearEso<2, float>>);
  KIND(Measured<LinearEso<2, float>, 1, 3>);
  KIND(Guarded<LinearEso<2, float>>);
  KIND(MappedInput<WrappedOutput<LinearEso<2, double>>, 4>);
  KIND(Guarded<
       ModelEso<ModelParts{.order = 1, .actuator = 1, .sensor = 1, .resonators = 1}, float>>);
#ifndef ESOKIT_ONE_TYPE
  KIND(WrappedOutput<OutlierGate<VariableTime<CascadeEso<2, 2, double>>>>);
  KIND(PlantEso<3, ModelParts{.order = 2, .sensor = 1, .resonators = 1}, double>);
  KIND(LinearEso<2, long double>);
  KIND(CascadeEso<2, 3, float>);
  KIND(HalfGainEso<2, float>);
  KIND(ReducedOrderEso<2, double>);
  KIND(AlgebraicEso<1, double, 2>);
  KIND(NonlinearEso<2, double, 1, FalGain<double>>);
  KIND(WrappedOutput<AlgebraicEso<2, float>>);
  KIND(DelayedInput<WrappedOutput<NonlinearEso<2, float, 1>>, 4>);
  KIND(VariableTime<AdjustableBandwidthEso<1, double>>);
  KIND(Guarded<WrappedOutput<CascadeEso<1, 2, double>>>);
  KIND(KnownModel<LinearEso<2, float>, Friction<1, float>>);
  KIND(VariableTime<ModelEso<ModelParts{.order = 1, .plant_poles = true}, float>>);
  KIND(DelayedInput<OutlierGate<ModelEso<ModelParts{.order = 2, .plant_poles = true}, float>>, 3>);
  KIND(ModelCascadeEso<ModelParts{.order = 1, .resonators = 1, .first_order = 1}, 2, float>);
  KIND(PlantCascadeEso<2, ModelParts{.order = 1}, 2, double>);
#endif
}

}  // namespace fuzz
