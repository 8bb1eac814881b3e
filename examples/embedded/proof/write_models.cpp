// Writes the C of more kinds that prove.sh proves: of models, gain laws, guards and other
// controllers.
#include <esokit/adapter/guarded.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>

#include "kinds.hpp"

namespace {

using namespace proof_kinds;

constexpr ModelParts lag{.order = 2, .actuator = 1};
constexpr ModelParts plant{.order = 2};
constexpr ModelParts sine{.order = 2, .resonators = 1};
using Plain = Adrc<LinearEso<2, float>>;

void write_models_and_laws() {
  write_controller<Adrc<CascadeEso<2, 2, float>>>("cascade", "`CascadeEso<2, 2, float>`");
  write_controller<Adrc<HalfGainEso<2, float>>>("half_gain", "`HalfGainEso<2, float>`");
  write_controller<Adrc<ReducedOrderEso<2, float>>>("reduced", "`ReducedOrderEso<2, float>`");
  write_controller<Adrc<AdjustableBandwidthEso<2, float>>>("adjustable",
                                                           "`AdjustableBandwidthEso`");
  write_controller<Adrc<NonlinearEso<2, float>>>("nonlinear", "`NonlinearEso<2, float>`");
  write_controller<Adrc<ModelEso<lag, float>>>("lag", "`ModelEso` with a lag of u");
  write_controller<Adrc<ModelEso<sine, float>>>("sine", "`ModelEso` with a sinusoid");
  write_controller<Adrc<PlantEso<2, plant, float>>>("plant", "`PlantEso`, order 2");
  write_controller<Adrc<AlgebraicEso<2, float>>>("algebraic", "`AlgebraicEso<2, float>`");
  write_controller<Adrc<ExtendedStateFilter<2, float>>>("filter",
                                                        "`ExtendedStateFilter<2, float>`");
  write_controller<Adrc<Guarded<LinearEso<2, float>>>>("guarded", "`Guarded`");
  write_controller<DisturbanceCompensator<LinearEso<2, float>>>("compensator",
                                                                "`DisturbanceCompensator`");
  write_controller<PredictiveAdrc<LinearEso<2, float>>>("predictive", "`PredictiveAdrc`");
}

void write_resting() {
  write_as("resting", "`Resting`", "-2\t7", {},
           Resting<Plain>::make(
               {.controller = config_of<Plain>(), .rest = {.error = 0.01f, .time = 0.005f}}));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  folder = argv[1];
  write_models_and_laws();
  write_resting();
  return all_written ? 0 : 1;
}
