// Every controller, with observers of every sort of gain law and adapters; a new one joins by a
// line.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>

#include <support/friction.hpp>

#include "fuzz/driver.hpp"
#include "fuzz/kinds.hpp"

namespace fuzz {

using namespace esokit;

void add_controllers(std::vector<Kind>& kinds) {
  KIND(Adrc<LinearEso<1, double>, ErrorBased>);
  KIND(Adrc<WrappedOutput<LinearEso<2, float>>, ErrorBased>);
  KIND(Adrc<VariableTime<LinearEso<2, float>>>);
  KIND(Resting<Adrc<WrappedOutput<LinearEso<2, float>>>>);
  KIND(DisturbanceCompensator<LinearEso<2, float>>);
  KIND(PredictiveAdrc<CascadeEso<1, 2, double>>);
  KIND(PredictiveAdrc<AdjustableBandwidthEso<2, float>>);
  KIND(PredictiveAdrc<NonlinearEso<2, float, 1>>);
  KIND(MimoAdrc<LinearEso<1, float>, LinearEso<2, float>>);
#ifndef ESOKIT_ONE_TYPE
  KIND(Adrc<OutlierGate<LinearEso<2, float>>>);
  KIND(Adrc<Measured<VariableTime<LinearEso<1, double>>, 1, 3>>);
  KIND(PredictiveAdrc<Measured<LinearEso<2, double>, 1, 3>>);
  KIND(Adrc<Guarded<LinearEso<2, float>>>);
  KIND(Resting<Adrc<Guarded<LinearEso<1, double>>, ErrorBased>>);
  KIND(Resting<Adrc<OutlierGate<LinearEso<2, double>>>>);
  KIND(Resting<Adrc<VariableTime<LinearEso<1, double>>>>);
  KIND(Adrc<MappedInput<LinearEso<2, float>, 4>>);
  KIND(Adrc<MappedInput<Guarded<DelayedInput<LinearEso<1, double>, 3>>, 4>, ErrorBased>);
  KIND(DisturbanceCompensator<MappedInput<LinearEso<1, double>, 4>>);
  KIND(PredictiveAdrc<MappedInput<Measured<LinearEso<2, double>, 1, 3>, 4>>);
  KIND(Adrc<LinearEso<3, float>>);
  KIND(Adrc<ModelEso<ModelParts{.order = 1, .plant_poles = true, .actuator = 1}, double>>);
  // Without plant poles: under them y = 1 needs a load, and of a load a leak leaves an error.
  KIND(Adrc<Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}, double>>>);
  KIND(Adrc<CascadeEso<2, 2, float>>);
  KIND(Adrc<AlgebraicEso<2, float>>);
  KIND(Adrc<DelayedInput<KnownModel<LinearEso<2, double>, esokit_test::Friction<1, double>>, 3>>);
  KIND(Adrc<ExtendedStateFilter<1, float>>);
  KIND(DisturbanceCompensator<VariableTime<CascadeEso<1, 2, double>>>);
  KIND(PredictiveAdrc<LinearEso<2, float>>);
  KIND(PredictiveAdrc<ExtendedStateFilter<1, double>>);
  KIND(PredictiveAdrc<AlgebraicEso<1, float>>);
  KIND(MimoAdrc<WrappedOutput<LinearEso<1, double>>, DelayedInput<LinearEso<2, double>, 3>>);
  KIND(MimoAdrc<Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}, float>>,
                Guarded<LinearEso<1, float>>>);
#endif
}

}  // namespace fuzz
