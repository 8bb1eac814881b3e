// The filters, and the laws that stand alone; a new one joins by a line.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/extended_state_filter.hpp>

#include "fuzz/driver.hpp"
#include "fuzz/kinds.hpp"

namespace fuzz {

using namespace esokit;

void add_filters(std::vector<Kind>& kinds) {
  KIND(ExtendedStateFilter<1, float>);
  KIND(ExtendedStateFilter<1, float, 1, NoNominalModel, 8>);
  KIND(Experiment<2, float>);
  KIND(TrackingDifferentiator<float>);
  KIND(NonlinearFeedback<2, float>);
  KIND(SmoothProfile<2, float>);
  KIND(ApproachProfile<2, 3, float>);
  KIND(FollowProfile<2, float>);
  KIND(TimeProportioned<float>);
#ifndef ESOKIT_ONE_TYPE
  KIND(ExtendedStateFilter<2, double>);
  KIND(WrappedOutput<ExtendedStateFilter<2, float>>);
  KIND(VariableTime<DelayedInput<ExtendedStateFilter<2, double>, 2>>);
  KIND(Experiment<1, double>);
  KIND(TrackingDifferentiator<double>);
  KIND(SmoothProfile<1, float>);
  KIND(ApproachProfile<1, 0, double>);
  KIND(FollowProfile<1, float>);
  KIND(FollowProfile<2, double>);
  KIND(SmoothProfile<4, float>);
  KIND(SmoothProfile<3, double>);
#endif
}

}  // namespace fuzz
