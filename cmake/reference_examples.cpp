// The examples of the reference: cmake/reference.sh shows each on the page of the class that its
// marks name, and cmake/readme_snippets.sh compiles and runs them. A class that is made from
// settings needs one.
#include <cmath>
#include <cstdio>
#include <esokit/esokit.hpp>

using namespace esokit;

double read_y() { return 0.01; }
double read_r() { return 0.02; }
void apply(double u) { std::printf("%g\n", u); }
constexpr double w = 0.1;  // a disturbance that is measured
constexpr double dt = 1.5e-3;

constexpr double T = 1e-3, b0 = 50;
const LinearEso<2>::Config eso{.observer_bandwidth = 100, .input_gain = b0, .sample_time = T};
const Adrc<LinearEso<2>>::Config adrc{.observer = eso, .controller_bandwidth = 10};

// ---- observers

void linear_eso() {
  //! [LinearEso]
  auto observer =
      LinearEso<2>::make({.observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3})
          .value();
  const double u = 0.2;  // held since the last sample
  observer.update(read_y(), u);
  const double speed = observer.estimate()(1), load = observer.total_disturbance();
  //! [LinearEso]
  std::printf("%g %g", speed, load);
}

void cascade_eso() {
  //! [CascadeEso]
  auto observer =
      CascadeEso<2, 2>::make({.observer_bandwidth = 40,
                              .bandwidth_factor = 2,  // of each level over the one before
                              .input_gain = 50,
                              .sample_time = 1e-3})
          .value();
  observer.update(read_y(), 0.2);
  //! [CascadeEso]
}

void algebraic_eso() {
  //! [AlgebraicEso]
  auto observer =
      AlgebraicEso<2>::make({.observer_bandwidth = 50, .input_gain = 50, .sample_time = 1e-3})
          .value();
  observer.update(read_y(), 0.2);  // from the third sample on exact, whatever the initial state
  //! [AlgebraicEso]
}

void adjustable_bandwidth_eso() {
  //! [AdjustableBandwidthEso]
  auto observer = AdjustableBandwidthEso<2>::make({.observer_bandwidth = 100,
                                                   .bandwidth_ratio = 0.5,
                                                   .input_gain = 50,
                                                   .sample_time = 1e-3})
                      .value();
  observer.update(read_y(), 0.2);
  //! [AdjustableBandwidthEso]
}

void nonlinear_eso() {
  //! [NonlinearEso]
  auto observer =
      NonlinearEso<2>::make({.observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3})
          .value();
  observer.update(read_y(), 0.2);
  //! [NonlinearEso]
}

void extended_state_filter() {
  //! [ExtendedStateFilter]
  auto filter = ExtendedStateFilter<2>::make(
                    {.input_gain = 50,
                     .sample_time = 1e-3,
                     .measurement_variance = 1e-6,       // of the noise of y
                     .disturbance_bounds = {0, 0, 0.5},  // most that a state changes in a sample
                     .inflation_rule = InflationRule::none})
                    .value();
  filter.update(read_y(), 0.2);
  //! [ExtendedStateFilter]
}

void predictor_corrector() {
  //! [PredictorCorrector]
  struct Small {  // a gain law of your own
    ScaledGain<3, double> k;
    const ScaledGain<3, double>& gain(const double& /*innovation*/) const noexcept { return k; }
  };
  auto observer = PredictorCorrector<2, double, 1, Small>::make(
      {.input_gain = 50, .sample_time = 1e-3}, Small{});
  //! [PredictorCorrector]
  (void)observer;
}

// ---- adapters

void delayed_input() {
  //! [DelayedInput]
  auto observer = DelayedInput<LinearEso<2>, 8>::make({.observer = eso, .delay = 3}).value();
  observer.update(read_y(), 0.2);  // this u acts three samples later
  //! [DelayedInput]
}

void variable_time() {
  //! [VariableTime]
  auto observer = VariableTime<LinearEso<2>>::make({.observer = eso, .ratio = 2}).value();
  // From the last sample to this one, within T / 2 .. 2 T.
  if (observer.set_step_time(dt)) observer.update(read_y(), 0.2);
  //! [VariableTime]
}

void wrapped_output() {
  //! [WrappedOutput]
  auto observer = WrappedOutput<LinearEso<2>>::make({.observer = eso, .period = 360}).value();
  observer.update(read_y(), 0.2);  // 359 and 1 are 2 degrees apart
  //! [WrappedOutput]
}

void outlier_gate() {
  //! [OutlierGate]
  auto observer = OutlierGate<LinearEso<2>>::make({.observer = eso, .threshold = 0.1}).value();
  observer.update(read_y(), 0.2);  // a y that is off by more than 0.1 counts as missing
  //! [OutlierGate]
}

void known_model() {
  //! [KnownModel]
  auto gravity = [](const Vector<double, 3>& x) {
    return -20 * std::sin(x(0));
  };  // of the estimate
  auto observer =
      KnownModel<LinearEso<2>, decltype(gravity)>::make({.observer = eso, .model = gravity})
          .value();
  observer.update(read_y(), 0.2);
  //! [KnownModel]
}

void measured() {
  //! [Measured]
  auto observer =
      Measured<LinearEso<2>, 1>::make({.observer = eso, .inputs = {{{.gain = 3, .lag = 0.1}}}})
          .value();
  observer.measured(w);  // before each sample
  observer.update(read_y(), 0.2);
  //! [Measured]
}

void mapped_input() {
  //! [MappedInput]
  auto controller = Adrc<MappedInput<LinearEso<2>>>::make(
                        {.observer = {.observer = eso, .curve = ActuatorCurve<>::dead_zone(3)},
                         .controller_bandwidth = 10,
                         .limits = {.lower = -12, .upper = 12}})
                        .value();
  apply(controller.update(read_y(), read_r()));  // in volts, with the dead zone made up for
  //! [MappedInput]
}

void actuator_map() {
  //! [ActuatorMap]
  const auto fan = ActuatorMap<>::make(ActuatorCurve<>::square(100)).value();  // thrust as u^2
  apply(fan.input(25));                                                        // 50
  const double thrust = fan.effect(50);                                        // 25
  //! [ActuatorMap]
  (void)thrust;
}

void guarded() {
  //! [Guarded]
  auto controller =
      Adrc<Guarded<LinearEso<2>>>::make(
          {.observer = {.observer = eso, .disturbance_bound = 200}, .controller_bandwidth = 10})
          .value();
  controller.observer().set_trust(0);  // on the ground: dhat is held
  apply(controller.update(read_y(), read_r()));
  //! [Guarded]
}

// ---- controllers and their parts

void adrc_with_limits() {
  //! [Adrc]
  auto controller =
      Adrc<LinearEso<2>>::make(
          {.observer = {.observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3},
           .controller_bandwidth = 10,
           .limits = {.lower = -5, .upper = 5}})
          .value();
  apply(controller.update(read_y(), read_r()));  // once a sample
  //! [Adrc]
}

void predictive_adrc() {
  //! [PredictiveAdrc]
  auto controller =
      PredictiveAdrc<LinearEso<2>>::make({.observer = eso, .controller_bandwidth = 10}).value();
  apply(controller.control(read_y()));  // at the sample: to the actuator at once
  controller.prepare(read_r());         // then the rest, any time before the next sample
  //! [PredictiveAdrc]
}

void mimo_adrc() {
  //! [MimoAdrc]
  using Mimo = MimoAdrc<LinearEso<2>, LinearEso<1>>;  // y_1'' and y_2'
  Mimo::Config config{.observers = {{.observer_bandwidth = 80, .sample_time = 2e-3},
                                    {.observer_bandwidth = 60, .sample_time = 2e-3}},
                      .controller_bandwidths = {8, 10}};
  config.input_matrix = {{1.8, 1.2}, {1.0, 2.6}};
  auto controller = Mimo::make(config).value();
  const Vector<double, 2> u = controller.update({read_y(), read_y()}, {read_r(), read_r()});
  //! [MimoAdrc]
  (void)u;
}

void disturbance_compensator() {
  //! [DisturbanceCompensator]
  auto compensator = DisturbanceCompensator<LinearEso<2>>::make(
                         {.observer = eso, .limits = {.lower = -5, .upper = 5}})
                         .value();
  const double u0 = 2 * (read_r() - read_y());  // of your controller
  apply(compensator.update(read_y(), u0));      // u0 - dhat / b0, within the limits
  //! [DisturbanceCompensator]
}

void adrc_law() {
  //! [AdrcLaw]
  auto observer = LinearEso<2>::make(eso).value();
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 10, .input_gain = 50}).value();
  apply(law.control(observer.estimate(), read_r()));
  //! [AdrcLaw]
}

void nonlinear_feedback() {
  //! [NonlinearFeedback]
  const auto law = NonlinearFeedback<2>::make({.gains = {100, 20},
                                               .exponents = {0.75, 1.25},
                                               .linear_widths = {0.01, 0.01},
                                               .input_gain = 50})
                       .value();
  //! [NonlinearFeedback]
  (void)law;
}

void limiter() {
  //! [Limiter]
  auto limiter = Limiter<double>::make({.lower = -5, .upper = 5, .rate = 200}, 1e-3).value();
  apply(limiter(7.0));  // 0.2 above the last one, and 5 at most
  //! [Limiter]
}

void tracking_differentiator() {
  //! [TrackingDifferentiator]
  auto profile = TrackingDifferentiator<>::make({.acceleration = 50, .sample_time = 1e-3}).value();
  auto controller = Adrc<LinearEso<2>>::make(adrc).value();
  profile.reset(read_y());
  profile.update(read_r());  // once a sample
  apply(controller.update(read_y(), profile.motion()));
  //! [TrackingDifferentiator]
}

void smooth_profile() {
  //! [SmoothProfile]
  auto profile = SmoothProfile<2>::make({.limits = {2, 20}, .sample_time = 1e-3}).value();
  auto controller = Adrc<LinearEso<2>>::make(adrc).value();
  profile.update(1.0);  // once a sample: from rest to rest, speed up to 2, acceleration up to 20
  apply(controller.update(read_y(), profile.motion()));
  //! [SmoothProfile]
}

void approach_profile() {
  //! [ApproachProfile]
  auto profile = ApproachProfile<1>::make({.pole = 0.02,
                                           .input_gain = 0.5,
                                           .limits = {.lower = 0, .upper = 1},
                                           .bandwidth = 0.1,
                                           .sample_time = 1})
                     .value();
  profile.update(80.0);                  // once a sample: the target, which may change at any time
  const auto motion = profile.motion();  // (r, r') for the controller
  //! [ApproachProfile]
  (void)motion;
}

void follow_profile() {
  //! [FollowProfile]
  auto profile = FollowProfile<2>::make({.limits = {2, 20}, .sample_time = 1e-3}).value();
  auto controller = Adrc<LinearEso<2>>::make(adrc).value();
  profile.start(read_y());
  profile.update({read_r(), 0.5});  // once a sample: position and speed of what it follows
  apply(controller.update(read_y(), profile.motion()));
  //! [FollowProfile]
}

void resting() {
  //! [Resting]
  constexpr double count = 0.0015;  // of the encoder
  auto controller = Resting<Adrc<LinearEso<2>>>::make(
                        {.controller = adrc, .rest = {.error = 1.5 * count, .time = 0.5}})
                        .value();
  const double u = controller.update(read_y(), read_r());
  const bool held = controller.mode() == LoopMode::rest;
  //! [Resting]
  apply(u);
  (void)held;
}

void time_proportioned() {
  //! [TimeProportioned]
  auto relay = TimeProportioned<>::make(
                   {.off = 0, .on = 100, .window = 10, .least_on = 0.5, .sample_time = 0.1})
                   .value();
  const bool on = relay.update(35);  // on for 3.5 s of each 10 s
  //! [TimeProportioned]
  (void)on;
}

void health_monitor() {
  //! [HealthMonitor]
  auto controller = Adrc<LinearEso<2>>::make(adrc).value();
  auto monitor =
      HealthMonitor<3>::make({.observer_bandwidth = 100, .sample_time = 1e-3, .input_range = 5})
          .value();
  apply(controller.update(read_y(), read_r()));
  monitor.look(controller);  // after each sample
  if (diagnose(monitor.health()) == LoopFault::wrong_sign) apply(0);
  //! [HealthMonitor]
}

void gain_probe() {
  //! [GainProbe]
  auto controller = Adrc<LinearEso<2>>::make(adrc).value();
  auto probe = GainProbe<3>::make({.observer_bandwidth = 100,
                                   .sample_time = 1e-3,
                                   .amplitude = 0.1,
                                   .travel = 0.05,
                                   .limits = {.lower = -5, .upper = 5}})
                   .value();
  const double y = read_y();
  controller.update(y, read_r());
  apply(probe.update(controller, y));  // what the controller asks, and a small sine
  if (const auto found = probe.result()) std::printf("b0 is %g times b0", found->gain_ratio);
  //! [GainProbe]
}

void experiment() {
  //! [Experiment]
  auto relay = Experiment<2>::make({.sample_time = 1e-3,
                                    .amplitude = 1,
                                    .hysteresis = 0.02,
                                    .lead = 0.05,
                                    .travel = 0.5,
                                    .time_limit = 5,
                                    .limits = {.lower = -2, .upper = 2}})
                   .value();
  while (!relay.finished()) apply(relay.update(read_y()));  // once a sample
  if (const auto found = relay.result()) std::printf("b0 = %g", found->input_gain);
  //! [Experiment]
}

void packed() {
  //! [Packed]
  using Four = Packed<Adrc<LinearEso<2>>, 4>;
  auto four = Four::make([](int lane) {
                auto config = adrc;
                config.controller_bandwidth = 8 + lane;
                return config;
              }).value();
  using Numbers = Four::scalar_type;  // one for each lane
  const Numbers u = four.update(Numbers(std::array{0.1, 0.2, 0.3, 0.4}), Numbers(1.0));
  //! [Packed]
  (void)u;
}

// ---- at the desk

void loop() {
  //! [Loop]
  const auto plant = LinearPlant<2>::chain({.coefficients = {0, 3}, .input_gain = 50}).value();
  const auto controller = Adrc<LinearEso<2>>::make(adrc).value();
  const auto loop = closed_loop(plant, controller);
  if (loop && loop->stable())
    std::printf("|S| at 5 rad/s: %g\n", std::abs(loop->sensitivity(5).value()));
  //! [Loop]
}

void plain_pid() {
  //! [PlainPid]
  auto pid = PlainPid::make({.proportional = 2,
                             .integral = 5,
                             .derivative = 0.1,
                             .derivative_filter = 0.01,
                             .lower = -5,
                             .upper = 5,
                             .sample_time = 1e-3})
                 .value();
  apply(pid.update(read_y(), read_r()));
  //! [PlainPid]
}

int main() {
  linear_eso();
  cascade_eso();
  algebraic_eso();
  adjustable_bandwidth_eso();
  nonlinear_eso();
  extended_state_filter();
  predictor_corrector();
  delayed_input();
  variable_time();
  wrapped_output();
  outlier_gate();
  known_model();
  measured();
  mapped_input();
  actuator_map();
  guarded();
  adrc_with_limits();
  predictive_adrc();
  mimo_adrc();
  disturbance_compensator();
  adrc_law();
  nonlinear_feedback();
  limiter();
  tracking_differentiator();
  smooth_profile();
  approach_profile();
  follow_profile();
  resting();
  time_proportioned();
  health_monitor();
  gain_probe();
  experiment();
  packed();
  loop();
  plain_pid();
}
