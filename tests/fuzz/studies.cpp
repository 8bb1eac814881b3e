// What is asked of a finished design, and what simulations are made of: random arguments of the
// analysis, of signals, noise and plants, of continuous observers, the PID conversion and the
// limiter. An answer is a number or an error with field and rule, whatever the arguments.
#include <bit>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/disturbance_alarm.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/health_text.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/loop_response.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/analysis/peak_gain.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/control/health.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <esokit/sim/disturbed_plant.hpp>
#include <esokit/sim/held_plant.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/plant.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/sim/signals.hpp>
#include <esokit/tune/pid_conversion.hpp>
#include <optional>

#include "fuzz/config.hpp"
#include "fuzz/kinds.hpp"

namespace fuzz {

using namespace esokit;

namespace {

template <class T>
bool is_nan(T x) {
  if constexpr (std::is_same_v<T, float>) {
    return (std::bit_cast<std::uint32_t>(x) & 0x7fffffffu) > 0x7f800000u;
  } else {
    const auto bits = std::bit_cast<std::uint64_t>(static_cast<double>(x));
    return (bits & 0x7fffffffffffffffu) > 0x7ff0000000000000u;
  }
}

/// One case: draws its arguments, and keeps what does not hold.
class Study {
 public:
  explicit Study(Episode& episode) : episode_(episode) {
    if (episode.random != nullptr)
      episode.config.record(*episode.random, episode.mix);
    else
      episode.config.play();
  }

  template <class S>
  S number(const char* name, const Range& range) {
    return episode_.config.number<S>(range, name);
  }
  template <class T, class S = typename T::value_type>
  void fill(const char* name, T& values, const Range& range) {
    for (S& x : values) x = number<S>(name, range);
  }
  int choice(const char* name, int count) { return episode_.config.choice(count, name); }
  /// No argument was extreme or corrupt.
  [[nodiscard]] bool plain() const { return episode_.config.plain(); }

  /// The value of an answer; nothing if it is an error, which has to say what is wrong.
  template <class E>
  auto answer(const char* what, const E& outcome) {
    using Value = std::remove_cvref_t<decltype(*outcome)>;
    ++episode_.played;
    const bool given = static_cast<bool>(outcome);
    if (given) {
      episode_.made = true;
    } else if (*outcome.error().field == '\0' || *outcome.error().rule == '\0') {
      fail(what, "refused without field or rule");
    }
    return given ? std::optional<Value>(*outcome) : std::nullopt;
  }

  template <class T>
  void finite(const char* what, const T& value) {
    if constexpr (std::is_floating_point_v<T>) {
      if (!is_finite(value)) fail(what, "is not finite");
    } else if constexpr (requires {
                           value.real();
                           value.imag();
                           std::real(value);
                         }) {
      if (!is_finite(value.real()) || !is_finite(value.imag())) fail(what, "is not finite");
    } else if constexpr (requires {
                           value.data();
                           value.size();
                         }) {
      for (decltype(value.size()) i = 0; i < value.size(); ++i) finite(what, value.data()[i]);
    } else {
      for (const auto& each : value) finite(what, each);
    }
  }
  /// A limit, which may be infinite where there is none.
  void limit(const char* what, double value) {
    if (is_nan(value)) fail(what, "is NaN");
  }
  void fail(const char* what, const char* text) {
    if (!failure_) failure_ = std::string(what) + " " + text;
  }

  Failure done() {
    if (episode_.random == nullptr) episode_.text.push_back(episode_.config.text());
    return failure_;
  }

 private:
  Episode& episode_;
  Failure failure_{};
};

// ---- analysis

constexpr Range rate{0.5, 50, true};

template <class MatrixType>
int size_of(const MatrixType& matrix) {
  return static_cast<int>(matrix.rows() * matrix.cols());
}

template <class System>
void ask_system(Study& study, const System& system) {
  // A slow one takes up to 1e8 steps.
  const double abscissa = stability_abscissa(system);
  double fastest = 1.0;
  if (!(system.sample_time > 0.0)) {
    for (const auto& p : poles(system)) fastest = std::max(fastest, std::abs(p));
  }
  if (!is_finite(abscissa) || !(abscissa < 0.0) || abscissa < -1e-3 * fastest) {
    if (const auto peaks = study.answer("peak_gain", peak_gain(system))) {
      study.finite("peak_gain", detail::sum_of_magnitudes(peaks->data(), size_of(*peaks)));
    }
  }
  const double w = study.number<double>("frequency", {0.1, 100, true});
  if (const auto h = study.answer("frequency_response", frequency_response(system, w))) {
    for (int i = 0; i < size_of(*h); ++i) study.finite("frequency_response", h->data()[i]);
  }
}

void ask_loop(Study& study, const Loop& loop) {
  study.finite("stability_abscissa", loop.stability_abscissa());
  if (const auto m = study.answer("margins", margins(loop))) {
    for (const Margin& each : {m->gain_increase, m->gain_decrease, m->phase, m->modulus}) {
      study.limit("margins", each.value);
      if (each.limited() && !(each.frequency >= 0.0)) study.fail("margins", "at no frequency");
    }
  }
  if (const auto range = study.answer("input_gain_range", input_gain_range(loop))) {
    study.limit("input_gain_range", range->lower);
    study.limit("input_gain_range", range->upper);
  }
  const double w = study.number<double>("frequency", {0.1, 100, true});
  for (const auto& response :
       {loop.loop_gain(w), loop.sensitivity(w), loop.complementary_sensitivity(w),
        loop.noise_to_control(w), loop.disturbance_to_output(w)}) {
    if (const auto value = study.answer("response", response)) study.finite("response", *value);
  }
  if (const auto peak = study.answer("sensitivity_peak", sensitivity_peak(loop))) {
    study.limit("sensitivity_peak", peak->value);
  }
  if (const auto m = study.answer("delay_margin", delay_margin(loop))) {
    study.limit("delay_margin", m->value);
  }
  const LoopNoise of{{study.number<double>("noise", {1e-6, 1, true})},
                     {study.number<double>("noise", {1e-6, 1, true})}};
  if (const auto found = study.answer("noise", noise(loop, of))) {
    study.finite("noise", found->output);
    study.finite("noise", found->control);
    study.finite("noise", found->estimates);
  }
  const DisturbanceAlarmConfig of_alarm{
      .false_alarms_per_hour = study.number<double>("false_alarms_per_hour", {1e-3, 1e3, true}),
      .load = study.number<double>("load", {1e-2, 1e2, true, true}),
      .noise = of};
  const int last = loop.system().c.rows() - 2 * loop.channels() - 1;
  // Slower loops are asked for longer responses than a case has time for.
  if (loop.stability_abscissa() < -1e-4) {
    if (const auto alarm =
            study.answer("disturbance_alarm", disturbance_alarm(loop, last, of_alarm))) {
      study.finite("disturbance_alarm", alarm->threshold);
      for (const double limit : {alarm->least_load, alarm->delay, alarm->latest}) {
        study.limit("disturbance_alarm", limit);
      }
      if (alarm->latest < alarm->delay) study.fail("disturbance_alarm", "surely before at all");
    }
  }
  const LoopStep step{.duration = study.number<double>("duration", {1e-2, 1, true}),
                      .sample_time = loop.sample_time() > 0.0 ? 0.0 : 1e-2};
  if (step.duration < 10.0) {
    for (const auto& made : {reference_response(loop, step), load_response(loop, step)}) {
      if (const auto response = study.answer("response", made)) {
        study.finite("response", response->output[0]);
        study.finite("response", response->control[0]);
      }
    }
  }
  ask_system(study, loop.system());
}

template <class Observer, class S = typename Observer::scalar_type>
Failure loop_study(Episode& episode) {
  Study study(episode);
  constexpr bool sampled = requires(typename Observer::Config c) { c.sample_time; };
  constexpr int n = Observer::order;
  typename Observer::Config config{};
  config.input_gain = study.number<S>("input_gain", {0.1, 10, true, true});
  config.observer_bandwidth = study.number<S>("observer_bandwidth", {5, 200, true});
  if constexpr (sampled) config.sample_time = study.number<S>("sample_time", {1e-3, 1e-1, true});
  if constexpr (requires { config.bandwidth_factor; }) {
    config.bandwidth_factor = study.number<S>("bandwidth_factor", {1.2, 3});
  }
  const auto made = Observer::make(config);
  const auto observer = study.answer("observer", made);
  const auto law_made =
      AdrcLaw<n, S>::make({.controller_bandwidth = study.number<S>("controller_bandwidth", rate),
                           .input_gain = config.input_gain});
  const auto law = study.answer("law", law_made);
  typename LinearPlant<n>::Chain chain;
  study.fill("coefficients", chain.coefficients, {-10, 10});
  chain.input_gain =
      study.number<double>("b", {0.5, 2, true}) * static_cast<double>(config.input_gain);
  if constexpr (sampled) {
    chain.dead_time =
        study.number<double>("dead_time", {0, 2.5}) * static_cast<double>(config.sample_time);
  }
  const auto plant = study.answer("plant", LinearPlant<n>::chain(chain));
  if (observer) {
    const EstimationNoise noise{study.number<double>("measurement", {1e-6, 1, true}),
                                study.number<double>("disturbance", {1e-3, 10, true})};
    if (const auto p = study.answer("estimation_error_covariance",
                                    estimation_error_covariance(*observer, noise))) {
      study.finite("estimation_error_covariance", *p);
    }
    ask_system(study, observer_system(*observer));
    ask_system(study, error_system(*observer));
  }
  if (!observer || !law || !plant) return study.done();
  const auto loop = closed_loop(*plant, ObserverWithLaw{*observer, *law});
  if (const auto closed = study.answer("closed_loop", loop)) ask_loop(study, *closed);
  return study.done();
}

// ---- continuous observers

template <class Observer, class S = typename Observer::scalar_type>
Failure continuous_study(Episode& episode) {
  Study study(episode);
  typename Observer::Config config{};
  Filler<S> filler(episode.config, Observer::order);
  filler.fill(config);
  const auto made = Observer::make(config);
  const auto observer = study.answer("observer", made);
  if (!observer) return study.done();
  auto running = *observer;
  typename Observer::State z;
  for (int i = 0; i < z.size(); ++i) z(i) = study.number<S>("z", signal);
  const S t = study.number<S>("t", {0, 10});
  const S y = study.number<S>("y", signal);
  const S u = study.number<S>("u", signal);
  running.begin_step(t, z, y);
  const auto slope = running.derivative(t, z, y, u);
  if (study.plain()) study.finite("derivative", slope);
  return study.done();
}

// ---- signals, noise, plants

template <class Signal>
void ask_signal(Study& study, const char* what, const Expected<Signal, Error<double>>& made,
                double t) {
  const auto signal_of_time = study.answer(what, made);
  if (!signal_of_time) return;
  const auto values = signal_of_time->template derivatives<4>(t);
  const double value = (*signal_of_time)(t);
  if (!study.plain()) return;
  study.finite(what, value);
  study.finite(what, values);
}

/// What a plant makes of an actuator, a sensor and a while of held input.
template <int States>
void ask_plant(Study& study, const LinearPlant<States>& plant, double time) {
  for (const auto& wrapped : {with_lag(plant, time), with_sensor(plant, time)}) {
    if (!study.answer("with", wrapped)) continue;
    study.finite("input_gain", std::array{wrapped->input_gain()});
    if (const auto held = study.answer("held_plant", held_plant(*wrapped, time))) {
      study.finite("increment", held->increment);
      study.finite("input", held->input);
      study.finite("disturbance", held->disturbance);
    }
  }
}

Failure signal_study(Episode& episode) {
  Study study(episode);
  const double t = study.number<double>("t", {0, 10});
  const double time = study.number<double>("time", {0, 5});
  const double size = study.number<double>("size", signal);
  const double tau = study.number<double>("tau", {0.1, 2});
  const double w = study.number<double>("angular_frequency", rate);
  ask_signal(study, "Constant", sim::Constant<>::make({size}), t);
  ask_signal(study, "Step", sim::Step<>::make({.time = time, .size = size}), t);
  ask_signal(
      study, "Sine",
      sim::Sine<>::make({.amplitude = size, .angular_frequency = w, .phase = tau, .offset = time}),
      t);
  ask_signal(study, "FilteredStep",
             sim::FilteredStep<5>::make({.time = time, .size = size, .time_constant = tau}), t);

  const double power = study.number<double>("power", {1e-6, 1, true});
  const double hold = study.number<double>("hold", {0.1, 1});
  const int multiple = 1 + study.choice("multiple", 20);
  if (const auto made = study.answer(
          "noise", sim::WhiteNoise<>::make({.standard_deviation = power, .seed = 3}))) {
    auto noise = *made;
    const double value = noise.next();
    if (study.plain()) study.finite("WhiteNoise", value);
  }
  if (const auto made = study.answer(
          "noise", sim::BandLimitedWhiteNoise<>::make({.power = power, .hold = hold, .seed = 3}))) {
    study.finite("standard_deviation", made->standard_deviation());
  }
  if (const auto made = study.answer(
          "noise", sim::HeldNoise<>::make(
                       {.power = power, .hold = hold, .step = hold / multiple, .seed = 3}))) {
    auto noise = *made;
    for (const int k : {0, 3, 100, 7, -1}) {
      const double value = noise.at(k);
      if (study.plain()) study.finite("HeldNoise", value);
    }
  }
  if (const auto plant = study.answer("chain", LinearPlant<2>::chain({{size, tau}, w, 0.0}))) {
    ask_plant(study, *plant, tau);
    if (const auto disturbed =
            study.answer("disturbed", sim::DisturbedPlant<2>::make({.plant = *plant}))) {
      const auto slope = disturbed->derivative(t, {time, size}, tau);
      if (study.plain()) study.finite("derivative", slope);
    }
  }
  if (const auto plant = study.answer(
          "transfer_function", LinearPlant<2>::transfer_function({{w, size}, {time, t}, tau}))) {
    ask_plant(study, *plant, tau);
  }
  return study.done();
}

// ---- PID conversion, limiter

template <int Order, class S>
Failure pid_study(Episode& episode) {
  Study study(episode);
  const AdrcTuning<S> tuning{study.number<S>("input_gain", {0.1, 10, true, true}),
                             study.number<S>("controller_bandwidth", rate),
                             study.number<S>("observer_bandwidth", {1, 500, true})};
  const auto finite = [&](const PidGains<S>& pid) {
    study.finite("pid_from_adrc", std::array{pid.proportional, pid.integral, pid.derivative,
                                             pid.filter_time, pid.filter_time_squared});
  };
  const auto numbers = [](const AdrcTuning<S>& t) {
    return std::array{t.input_gain, t.controller_bandwidth, t.observer_bandwidth};
  };
  const S ratio = study.number<S>("bandwidth_ratio", {1.5, 20});
  const auto pid = pid_from_adrc<Order, S>(tuning);
  if (const auto gains = study.answer("pid_from_adrc", pid)) {
    finite(*gains);
    if (const auto back = study.answer("adrc_from_pid", adrc_from_pid<Order, S>(*gains, ratio))) {
      study.finite("adrc_from_pid", numbers(*back));
    }
  }
  const PidGains<S> drawn{.proportional = study.number<S>("proportional", {1, 10}),
                          .integral = study.number<S>("integral", {0.1, 10}),
                          .derivative = study.number<S>("derivative", {0.1, 10})};
  const auto tuned = adrc_from_pid<Order, S>(drawn, ratio);
  if (const auto made = study.answer("adrc_from_pid", tuned)) {
    study.finite("adrc_from_pid", numbers(*made));
    if (const auto gains = study.answer("pid_from_adrc", pid_from_adrc<Order, S>(*made))) {
      finite(*gains);
    }
  }
  return study.done();
}

template <class S>
Failure limiter_study(Episode& episode) {
  Study study(episode);
  const S T = study.number<S>("sample_time", {1e-3, 1, true});
  Limits<S> limits{study.number<S>("lower", {-5, 1}), study.number<S>("upper", {2, 5})};
  if (study.choice("rate limit", 2) == 1) {
    limits.rate = study.number<S>("rate", {1, 100, true});
  }
  const auto made = Limiter<S>::make(limits, T);
  const auto first = study.answer("limiter", made);
  if (!first) return study.done();
  Limiter<S> limiter = *first;
  const int calls = study.choice("calls", 20);
  for (int i = 0; i < calls; ++i) {
    const S command = study.number<S>("command", {-10, 10});
    if (!is_finite(command)) continue;  // as it says
    const S before = limiter.last();
    if (study.choice("track", 4) == 1) {
      limiter.track(command);
      continue;
    }
    const S would_be = limiter.clamp(command);
    const S u = limiter(command);
    study.finite("output", u);
    if (u < limits.lower || u > limits.upper) study.fail("output", "is outside of the limits");
    if (would_be < u || would_be > u) study.fail("clamp", "is not what comes out");
    const bool inside = !(before < limits.lower) && !(before > limits.upper);
    const S step = limits.rate * T;
    const S rounding =
        S(8) * std::numeric_limits<S>::epsilon() * (std::abs(before) + std::abs(u) + step) +
        std::numeric_limits<S>::min();
    const bool limited = limits.rate < std::numeric_limits<S>::max();
    if (limited && inside && is_finite(step) && is_finite(u - before) && is_finite(rounding) &&
        std::abs(u - before) > step + rounding) {
      study.fail("output", "changes faster than its rate limit");
    }
  }
  return study.done();
}

}  // namespace

// ---- the sampled loop

Failure run_study(Episode& episode) {
  Study study(episode);
  using Controller = Adrc<VariableTime<LinearEso<2>>>;
  const double T = study.number<double>("sample_time", {1e-3, 1e-1, true});
  const double w = study.number<double>("observer_bandwidth", {5, 200, true});
  const double b = study.number<double>("input_gain", {0.1, 10, true, true});
  const auto made = Controller::make(
      {.observer = {.observer = {.observer_bandwidth = w, .input_gain = b, .sample_time = T},
                    .ratio = study.number<double>("ratio", {1, 3})},
       .controller_bandwidth = w / 5,
       .limits = {.lower = -10, .upper = 10}});
  const auto controller = study.answer("controller", made);
  const auto chain = LinearPlant<2>::chain(
      {{study.number<double>("a0", {-1, 10}), study.number<double>("a1", {-1, 10})},
       b,
       study.number<double>("plant.dead_time", {0, 0.2})});
  const auto plant = study.answer("plant", chain);
  if (!controller || !plant) return study.done();
  const int samples = 1 + study.choice("samples", 200);
  const sim::RunConfig<LinearPlant<2>, Controller> config{
      .duration =
          study.choice("whole", 8) == 0 ? study.number<double>("duration", {0, 1}) : samples * T,
      .reference = study.number<double>("reference", signal),
      .disturbance = study.number<double>("disturbance", signal),
      .noise = study.number<double>("noise", {0, 1}),
      .missing = study.number<double>("missing", {0, 1}),
      .jitter = study.choice("even", 2) == 0 ? 0.0 : study.number<double>("jitter", {0, 0.5}),
      .dead_time = study.number<double>("dead_time", {0, 0.1}),
      .substeps = study.choice("substeps", 4),
      .state = {study.number<double>("y", signal), study.number<double>("y'", signal)}};
  if (!(config.duration / T < 1e4)) return study.done();
  const auto run = sim::run(*plant, *controller, config);
  if (const auto recording = study.answer("run", run)) {
    study.finite("output", recording->output);
    study.finite("total_disturbance", recording->total_disturbance);
    study.finite("state", recording->state);
    for (const double u : recording->input) {
      if (!(u >= -10 && u <= 10)) study.fail("run", "put out an input beyond the limits");
    }
  }
  return study.done();
}

// ---- what a monitor says of a loop, whatever happens to it

template <class S>
Failure health_study(Episode& episode) {
  Study study(episode);
  using Controller = Adrc<Guarded<LinearEso<2, S>>>;
  using Monitor = HealthMonitor<3, S>;
  const S T = study.number<S>("sample_time", {1e-3, 1e-1, true});
  const S w = study.number<S>("observer_bandwidth", {5, 200, true});
  typename Controller::Config config{};
  config.observer.observer = {.observer_bandwidth = w,
                              .input_gain = study.number<S>("input_gain", {0.1, 10, true, true}),
                              .sample_time = T};
  config.observer.disturbance_bound = study.number<S>("disturbance_bound", {0, 10});
  config.controller_bandwidth = w / S(5);
  config.limits = {.lower = S(-10), .upper = S(10)};
  const auto made = study.answer("controller", Controller::make(config));
  const auto monitored = study.answer(
      "monitor", Monitor::make({.observer_bandwidth = w,
                                .sample_time = T,
                                .input_range = study.number<S>("input_range", {0.1, 10, true}),
                                .noise = study.number<S>("noise", {0, 1}),
                                .latency = study.number<S>("latency", {0, 0.5}),
                                .memory = study.number<S>("memory", {0.1, 10, true}),
                                .divider = study.choice("divider", 12)}));
  const auto probing = study.answer(
      "probe", GainProbe<3, S>::make({.observer_bandwidth = w,
                                      .sample_time = T,
                                      .amplitude = study.number<S>("amplitude", {0.01, 10, true}),
                                      .travel = study.number<S>("travel", {0.1, 100, true}),
                                      .periods = 6 + study.choice("periods", 4),
                                      .limits = {.lower = S(-10), .upper = S(10)}}));
  if (!made || !monitored || !probing) return study.done();
  auto controller = *made;
  auto probe = *probing;
  auto monitor = *monitored;
  std::uint32_t looked = 0;
  for (int k = 4 + study.choice("samples", 40); k > 0; --k) {
    const S y = study.number<S>("y", signal);
    const S r = study.number<S>("reference", signal);
    switch (study.choice("call", 8)) {
      case 0:
        (void)controller.track(y, r, study.number<S>("u_applied", signal));
        break;
      case 1:
        (void)controller.hold(y, r, study.number<S>("u_applied", signal));
        break;
      case 2:
        (void)controller.set_input_gain(study.number<S>("b", {0.1, 10, true, true}));
        break;
      case 3:
        monitor.clear();
        looked = 0;
        break;
      default:
        (void)controller.update(y, r);
    }
    monitor.look(controller);
    const S held = probe.update(controller, y);
    if (!(held >= S(-10) && held <= S(10))) study.fail("probe", "is outside of the limits");
    if (const auto found = probe.result()) {
      study.finite("probe", found->gain_ratio);
      study.finite("probe", found->half_width);
    }
    const Health<S>& health = monitor.health();
    if (health.samples != ++looked) study.fail("samples", "are not those that were looked at");
    for (const S& share : {health.saturated, health.bounded}) {
      if (!(share >= S(0) && share <= S(1))) study.fail("share", "is not within 0 .. 1");
    }
    for (const std::uint32_t count :
         {health.rejected, health.bridged, health.gated, health.unsafe}) {
      if (count > looked) study.fail("count", "is above that of the samples");
    }
    for (const S& x :
         {health.innovation, health.gain_ratio, health.evidence, health.response, health.opposed}) {
      study.finite("health", x);
    }
    if (!(health.side >= S(-1) && health.side <= S(1))) {
      study.fail("side", "is not within -1 .. 1");
    }
    if (!(health.innovation >= S(0) && health.evidence >= S(0) && health.response >= S(0) &&
          health.opposed >= S(0)))
      study.fail("health", "is negative");
    if (*advice(diagnose(health)).wrong == '\0' && diagnose(health) != LoopFault::none) {
      study.fail("diagnosis", "has no words");
    }
  }
  return study.done();
}

void add_studies(std::vector<Kind>& kinds) {
  kinds.push_back({"loop of LinearEso<2>", &loop_study<LinearEso<2>>, 5});
  kinds.push_back({"loop of CascadeEso<1, 2, float>", &loop_study<CascadeEso<1, 2, float>>, 5});
  kinds.push_back({"loop of ContinuousLinearEso<2>", &loop_study<ContinuousLinearEso<2>>, 5});
  kinds.push_back(
      {"ContinuousCascadeEso<2, 2>", &continuous_study<ContinuousCascadeEso<2, 2, double>>});
  kinds.push_back(
      {"ContinuousNonlinearEso<2, float>", &continuous_study<ContinuousNonlinearEso<2, float>>});
  kinds.push_back({"ContinuousAdjustableBandwidthEso<2>",
                   &continuous_study<ContinuousAdjustableBandwidthEso<2, double>>});
  kinds.push_back(
      {"ContinuousAlgebraicEso<2>", &continuous_study<ContinuousAlgebraicEso<2, double>>});
  kinds.push_back({"signals, noise, plants", &signal_study});
  kinds.push_back({"run", &run_study});
  kinds.push_back({"HealthMonitor<3, float>", &health_study<float>});
  kinds.push_back({"HealthMonitor<3>", &health_study<double>});
  kinds.push_back({"PI conversion, float", &pid_study<1, float>});
  kinds.push_back({"PID conversion", &pid_study<2, double>});
  kinds.push_back({"Limiter<float>", &limiter_study<float>});
  kinds.push_back({"Limiter<double>", &limiter_study<double>});
}

}  // namespace fuzz
