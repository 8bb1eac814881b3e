// Writes the C of more kinds that prove.sh proves: of models, gain laws and other controllers.
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>

#include "kinds.hpp"

namespace {

using namespace proof_kinds;

constexpr ModelParts lag{.order = 2, .actuator = 1};

void write_models_and_laws() {
  write_controller<Adrc<CascadeEso<2, 2, float>>>("cascade", "`CascadeEso<2, 2, float>`");
  write_controller<Adrc<HalfGainEso<2, float>>>("half_gain", "`HalfGainEso<2, float>`");
  write_controller<Adrc<ReducedOrderEso<2, float>>>("reduced", "`ReducedOrderEso<2, float>`");
  write_controller<Adrc<AdjustableBandwidthEso<2, float>>>("adjustable",
                                                           "`AdjustableBandwidthEso`");
  write_controller<Adrc<NonlinearEso<2, float>>>("nonlinear", "`NonlinearEso<2, float>`");
  write_controller<Adrc<ModelEso<lag, float>>>("lag", "`ModelEso` with a lag of u");
  write_controller<DisturbanceCompensator<LinearEso<2, float>>>("compensator",
                                                                "`DisturbanceCompensator`");
  write_controller<PredictiveAdrc<LinearEso<2, float>>>("predictive", "`PredictiveAdrc`");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  folder = argv[1];
  write_models_and_laws();
  return all_written ? 0 : 1;
}
