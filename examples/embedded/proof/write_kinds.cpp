// Writes the C of the kinds that prove.sh proves: of controllers, adapters, profiles and integers.
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/profile_code.hpp>
#include <esokit/target/time_proportioned_code.hpp>
#include <string>

#include "kinds.hpp"

namespace {

using namespace proof_kinds;

struct Pendulum {
  template <class E>
  auto operator()(const E& x) const noexcept {
    using std::sin;
    return -3.0f * sin(x(0));
  }
};

void holds_and_ramps(auto& config) {
  config.limits.rate = 500;
  config.start_hold = {.time = decltype(config.start_hold.time)(0.1)};
}

void write_controllers() {
  using Plain = Adrc<LinearEso<2, float>>;
  using Double = Adrc<LinearEso<2, double>>;
  write_controller<Plain>("plain", "`Adrc<LinearEso<2, float>>`");
  write_controller<Double>("in_double", "`Adrc<LinearEso<2>>`");
  write_controller<Plain>("ramp", "the first, limit of rate and start hold", {},
                          [](auto& config) { holds_and_ramps(config); });
  write_controller<Double>("ramp_in_double", "the second, limit of rate and start hold", {},
                           [](auto& config) { holds_and_ramps(config); });
  write_controller<Plain>("divided", "the first, y at every third sample", {},
                          [](auto& config) { config.measurement_divider = 3; });
  write_controller<Adrc<LinearEso<2, float>, ErrorBased>>("error_based", "its error-based form");
  write_controller<Plain>("moving", "the first, with r' and r''", {.moving_reference = true});
  write_controller<Plain>("saved", "the first, state kept over a restart", {.saves_state = true});
  write_controller<Plain>("settings", "the first, settings in a struct",
                          {.settings_in_struct = true});
  write_controller<Plain>("watched", "the first, with what a monitor reads", {.watched = true});
}

void write_adapters() {
  write_controller<Adrc<DelayedInput<LinearEso<2, float>, 4>>>("delayed", "`DelayedInput` in it");
  write_controller<Adrc<OutlierGate<LinearEso<2, float>>>>("gated", "`OutlierGate`");
  write_controller<Adrc<DelayedInput<OutlierGate<LinearEso<2>>, 4>>>(
      "all_in_double", "both, in double, limit of rate and start hold", {},
      [](auto& config) { holds_and_ramps(config); });
  write_controller<Adrc<WrappedOutput<LinearEso<2, float>>>>("angle", "`WrappedOutput`");
  write_controller<Adrc<Measured<LinearEso<2, float>, 1, 8>>>("measured", "`Measured`");
  write_controller<Adrc<MappedInput<LinearEso<2, float>, 3>>>("mapped", "`MappedInput`");
  write_controller<Adrc<KnownModel<LinearEso<2, float>, Pendulum>>>("known", "`KnownModel`");
  write_observer<LinearEso<2, float>>("observer", "`LinearEso<2, float>` alone");
}

void write_others() {
  const auto approach = ApproachProfile<2, 5, float>::make({.pole = 0.1f,
                                                            .lag = 0.3f,
                                                            .input_gain = 2.0f,
                                                            .limits = {.lower = -10, .upper = 70},
                                                            .dead_time = 0.08f,
                                                            .bandwidth = 1.5f,
                                                            .sample_time = 0.02f});
  write_as("approach", "`ApproachProfile<2, 5, float>`", no_limits, {}, approach);
  SmoothProfileConfig<2, float> profile{.sample_time = 0.004f};
  profile.limits = {3.0f, 20.0f};
  write_as("profile", "`SmoothProfile<2, float>`", no_limits, {},
           SmoothProfile<2, float>::make(profile));
  FollowProfileConfig<2, float> follow{.sample_time = 0.004f};
  follow.limits = profile.limits;
  write_as("follow", "`FollowProfile<2, float>`", no_limits, {},
           FollowProfile<2, float>::make(follow));
  write_as("proportioned", "`TimeProportioned<float>`", "0\t1", {},
           TimeProportioned<float>::make({.off = 0.0f,
                                          .on = 1.0f,
                                          .window = 10.0f,
                                          .least_on = 1.0f,
                                          .least_off = 1.0f,
                                          .sample_time = 0.1f}));
}

template <class Object>
void write_integers(const std::string& name, const std::string& title, const std::string& limits,
                    const typename Object::Config& config, const FixedPointOptions& given = {}) {
  FixedPointOptions options = given;
  if (!(options.y.unit > 0)) options.y = {.unit = 6.2831853 / 4096, .most = 2048};
  options.u = {.unit = 0.01, .most = 1000};
  options.code.name = name;
  const auto made = Object::make(config);
  if (!made) return refused(name, made.error());
  const auto fixed = to_fixed_c(*made, options);
  if (!fixed) return refused(name, fixed.error());
  write_files(name, title, limits, fixed->code);
}

void write_in_integers() {
  using Loop = Adrc<LinearEso<2>>;
  const auto loop = config_of<Loop>();
  auto ramp = loop;
  holds_and_ramps(ramp);
  write_integers<Loop>("integers", "in integers: the second", "-200\t700", loop);
  write_integers<Loop>("integers_ramp", "in integers: it, limit of rate and start hold",
                       "-200\t700", ramp);
  write_integers<Loop>("integers_counter", "in integers: it, y a counter of 16 bits", "-200\t700",
                       loop, {.y = {.unit = 6.2831853 / 4096, .most = 40, .counter_bits = 16}});
  write_integers<LinearEso<2>>("integers_alone", "in integers: `LinearEso<2>` alone", no_limits,
                               loop.observer);
  write_integers<LinearEso<2>>("integers_narrow", "in integers: it, 16 bits of innovation",
                               no_limits, loop.observer, {.innovation_bits = 16});
  write_integers<Adrc<LinearEso<1>>>("integers_first", "in integers: `LinearEso<1>`", "-200\t700",
                                     config_of<Adrc<LinearEso<1>>>());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  folder = argv[1];
  write_controllers();
  write_adapters();
  write_others();
  write_in_integers();
  return all_written ? 0 : 1;
}
