#include "play.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <esokit/adapter/actuator_map.hpp>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/tune/pid_baselines.hpp>
#include <limits>
#include <memory>
#include <numbers>

namespace playground {
namespace {

using esokit::Error;
using esokit::Expected;
using esokit::LinearController;
using esokit::LinearPlant;
using Outcome = esokit::Check<double>;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

constexpr Field hidden_field(const char* name, double standard) {
  return {name, "", "", "", Kind::hidden, 0, 0, standard, "", ""};
}

// By the order of Index.
constexpr std::array<Field, field_count> all_fields{{
    {"order", "integrations from u to y", "", "Machine", Kind::choice, 1, 3, 2,
     "1: torque to speed, heat to temperature;2: torque to angle;3: with a slow drive before it",
     "torque to angle: 2, torque to speed: 1, heat to temperature: 1"},
    {"gain", "gain b\u2080", "y\u207d\u207f\u207e per u", "Machine", Kind::number, 1e-2, 1e4, 50,
     "", "what a unit of u adds to the highest derivative"},
    {"damping", "damping", "1/s", "Machine", Kind::number_or_none, 1e-2, 1e3, 3, "",
     "friction that grows with speed: a pole of the machine"},
    {"lag", "lag of the actuator", "s", "Machine", Kind::number_or_none, 1e-4, 10, 0, "",
     "first order, between u and the machine"},
    {"dead_time", "dead time", "s", "Machine", Kind::number_or_none, 1e-4, 10, 1e-3, "",
     "from u to the machine: bus, computing, transport"},
    {"resonance", "resonance", "rad/s", "Machine", Kind::number_or_none, 1, 1e4, 0, "",
     "a shaft or belt between actuator and machine"},
    {"resonance_damping", "its damping", "", "Machine", Kind::number, 1e-3, 1, 0.05, "",
     "1: it does not oscillate"},
    {"friction", "dry friction", "y\u207d\u207f\u207e", "Machine", Kind::number_or_none, 1e-3, 1e4,
     0, "", "as large at any speed, against it"},
    {"dead_zone", "dead zone of the actuator", "u", "Machine", Kind::number_or_none, 1e-3, 1e4, 0,
     "", "less u does nothing, and more acts so much less"},
    {"down_gain", "its gain downwards / upwards", "", "Machine", Kind::number, 0.05, 20, 1, "",
     "a cooler and a heater, a lift"},
    {"load", "load", "y\u207d\u207f\u207e", "Machine", Kind::number_or_none, 1e-3, 1e5, 20, "",
     "pulls y down from the middle of the run on"},
    {"noise", "noise of the sensor", "y", "Machine", Kind::number_or_none, 1e-6, 10, 1e-4, "",
     "standard deviation, white"},
    {"quantum", "step of the sensor", "y", "Machine", Kind::number_or_none, 1e-6, 10, 0, "",
     "least difference that it shows"},
    {"observer", "observer", "", "Controller", Kind::choice, 0, 5, 0,
     "LinearEso;LinearEso, extension 2;CascadeEso, 2 levels;ModelEso, knows the lag;"
     "LinearEso, poles of a log;ModelEso, knows the lag, poles of a log",
     "what estimates the state and the disturbance"},
    {"controller_bandwidth", "controller bandwidth \u03c9c", "rad/s", "Controller", Kind::number,
     0.05, 1e4, 10, "", "how fast y follows"},
    {"observer_bandwidth", "observer bandwidth \u03c9o", "rad/s", "Controller", Kind::number, 0.2,
     1e5, 100, "", "how fast the disturbance is found"},
    {"gain_factor", "known b\u2080 / true b\u2080", "", "Controller", Kind::number, 0.1, 10, 1, "",
     "1: it knows b\u2080"},
    {"knows_dead_time", "knows the dead time", "", "Controller", Kind::on_off, 0, 1, 0, "",
     "DelayedInput, whole samples"},
    {"knows_curve", "knows dead zone and gains", "", "Controller", Kind::on_off, 0, 1, 0, "",
     "MappedInput, the curve of the actuator"},
    {"limit", "limit of u", "u", "Controller", Kind::number, 1e-3, 1e5, 5, "",
     "what the actuator can give, and the controller knows"},
    {"down", "the same downwards, times that", "", "Controller", Kind::number_or_none, 1e-2, 10, 1,
     "", "0: it cannot pull, as a heater"},
    {"rate", "limit of its rate", "u/s", "Controller", Kind::number_or_none, 1e-2, 1e6, 0, "",
     "how fast the actuator can change"},
    {"reference", "reference step", "y", "Run", Kind::number, 1e-3, 1e3, 1, "",
     "at the start, from 0"},
    {"sample_time", "sample time T", "s", "Run", Kind::number, 1e-5, 10, 1e-3, "",
     "from sample to sample"},
    {"samples", "samples", "", "Run", Kind::number, 100, 20000, 2000, "", "length of the run"},
    {"lose", "Lose every tenth sample", "", "What happens", Kind::on_off, 0, 1, 0, "", ""},
    {"nan", "Put in a NaN", "", "What happens", Kind::on_off, 0, 1, 0, "", ""},
    {"saturate", "Saturate", "", "What happens", Kind::on_off, 0, 1, 0, "", ""},
    {"noisy", "Double the noise", "", "What happens", Kind::on_off, 0, 1, 0, "", ""},
    {"wrong", "b\u2080 off by two", "", "What happens", Kind::on_off, 0, 1, 0, "", ""},
    {"pid", "PID beside it", "", "What happens", Kind::on_off, 0, 1, 0, "", ""},
    hidden_field("pole1", -1),
    hidden_field("oscillation1", 0),
    hidden_field("pole2", -1),
    hidden_field("oscillation2", 0),
    hidden_field("pole3", -1),
    hidden_field("oscillation3", 0),
    hidden_field("pole4", -1),
    hidden_field("oscillation4", 0),
    hidden_field("law0", 0),
    hidden_field("law1", 0),
    hidden_field("law2", 0),
    hidden_field("law3", 0),
    hidden_field("soften", 0),
}};

// The shortest text that reads back as this number.
std::string text_of(double value) {
  char text[40];
  for (int digits = 6; digits <= 17; ++digits) {
    std::snprintf(text, sizeof text, "%.*g", digits, value);
    if (std::strtod(text, nullptr) == value) break;
  }
  return text;
}

std::string said(const Error<double>& error) {
  std::string text = error.field;
  if (error.index >= 0) text += "[" + std::to_string(error.index) + "]";
  text += " = " + text_of(error.value) + " " + error.rule;
  return error.has_limit ? text + " " + text_of(error.limit) : text;
}

// ---- the machine ----

template <int States>
using Plant = LinearPlant<States>;

// Behind a shaft that oscillates: q'' + 2 zeta w q' + w^2 q = w^2 u, and q drives the plant.
template <int States>
Plant<States + 2> with_resonance(const Plant<States>& plant, double w, double zeta) {
  Plant<States + 2> bigger;
  bigger.dead_time = plant.dead_time;
  for (int i = 0; i < States; ++i) {
    for (int j = 0; j < States; ++j) bigger.a(i, j) = plant.a(i, j);
    bigger.a(i, States) = plant.b(i);
    bigger.e(i) = plant.e(i);
    bigger.c(0, i) = plant.c(0, i);
  }
  bigger.a(States, States + 1) = 1.0;
  bigger.a(States + 1, States) = -w * w;
  bigger.a(States + 1, States + 1) = -2.0 * zeta * w;
  bigger.b(States + 1) = w * w;
  return bigger;
}

// A machine as the analysis takes it, and with room for all parts, so that one type is run.
struct Machine {
  esokit::detail::DensePlant dense;
  Plant<6> roomy;
};

template <int States>
Machine machine_of(const Plant<States>& plant) {
  Machine machine{esokit::detail::dense_plant(plant), {}};
  machine.roomy.dead_time = plant.dead_time;
  for (int i = 0; i < States; ++i) {
    for (int j = 0; j < States; ++j) machine.roomy.a(i, j) = plant.a(i, j);
    machine.roomy.b(i) = plant.b(i);
    machine.roomy.e(i) = plant.e(i);
    machine.roomy.c(0, i) = plant.c(0, i);
  }
  return machine;
}

template <int Order>
Expected<Machine, Error<double>> machine_for(const Settings& s) {
  typename LinearPlant<Order>::Chain chain;
  chain.coefficients[Order - 1] = s[damping];
  chain.input_gain = s[gain];
  chain.dead_time = s[dead_time];
  const auto plain = LinearPlant<Order>::chain(chain);
  if (!plain) return plain.error();
  const auto behind_lag = [&](const auto& plant) -> Expected<Machine, Error<double>> {
    if (!(s[lag] > 0.0)) return machine_of(plant);
    const auto lagging = with_lag(plant, s[lag]);
    if (!lagging) return lagging.error();
    return machine_of(*lagging);
  };
  if (!(s[resonance] > 0.0)) return behind_lag(*plain);
  return behind_lag(with_resonance(*plain, s[resonance], s[resonance_damping]));
}

// What the actuator makes of u.
double effect_of(const Settings& s, double u) {
  const double left = std::copysign(std::max(std::abs(u) - s[dead_zone], 0.0), u);
  return u < 0.0 ? s[down_gain] * left : left;
}

bool maps(const Settings& s) {
  return s[knows_curve] > 0.0 && (s[dead_zone] > 0.0 || s[down_gain] != 1.0);
}

// As the controller knows it. Two gains in one with a dead zone are its table.
using ActuatorCurve = esokit::ActuatorCurve<double, 3>;
ActuatorCurve curve_of(const Settings& s) {
  if (!maps(s)) return {};
  if (!(s[dead_zone] > 0.0)) return ActuatorCurve::two_gains(1.0, s[down_gain]);
  auto curve = ActuatorCurve::dead_zone(s[dead_zone]);
  curve.effect[0] *= s[down_gain];
  curve.slope_below = s[down_gain];
  return curve;
}

// Of the law, which asks for an effect where the curve is known: the map is behind it, as in
// MappedInput, but once for all types.
double limit_of(const Settings& s, double sign) {
  const double u = sign < 0.0 ? -s[down] * s[limit] : s[limit];
  return maps(s) ? effect_of(s, u) : u;
}

// ---- the controller ----

// Any controller, so that each machine is run with one type.
struct AnyController {
  AnyController() = default;
  AnyController(const AnyController&) = delete;
  AnyController& operator=(const AnyController&) = delete;
  virtual ~AnyController() = default;
  virtual double update(double y, double r) = 0;
  virtual double estimate() const { return nan; }
  virtual Expected<LinearController, Error<double>> linear() const = 0;
};

template <class C>
struct Controlled final : AnyController {
  explicit Controlled(const C& made) : controller(made) {}
  double update(double y, double r) override { return controller.update(y, r); }
  double estimate() const override { return controller.observer().total_disturbance(); }
  Expected<LinearController, Error<double>> linear() const override {
    const Expected<LinearController, Error<double>> form = linear_controller(controller);
    return form;
  }
  C controller;
};

struct PidBeside final : AnyController {
  explicit PidBeside(const esokit::PlainPid& made) : pid(made) { pid.start(0.0, 0.0, 0.0); }
  // As machines do it: without a measurement u is kept.
  double update(double y, double r) override {
    if (std::isfinite(y)) last = pid.update(y, r);
    return last;
  }
  Expected<LinearController, Error<double>> linear() const override { return LinearController(); }
  esokit::PlainPid pid;
  double last = 0.0;
};

using AnyMade = Expected<std::unique_ptr<AnyController>, Error<double>>;

constexpr int longest_delay = 256;

double known_gain(const Settings& s) {
  return s[gain] * s[gain_factor] * (s[half_gain] > 0.0 ? 2.0 : 1.0);
}

// By poles and gains as a log gave them; the sliders of the bandwidths move all together.
bool poles_of_log(const Settings& s) { return s[observer] >= 4.0; }
bool law_of_log(const Settings& s) { return poles_of_log(s) && s[law] > 0.0; }
bool knows_lag(const Settings& s) { return s[observer] == 3.0 || s[observer] == 5.0; }
double law_gain(const Settings& s, std::size_t i, std::size_t count) {
  return s[law + i] * std::pow(s[controller_bandwidth], static_cast<double>(count - i));
}
std::complex<double> pole(const Settings& s, std::size_t i) {
  return s[observer_bandwidth] * std::complex<double>(s[poles + 2 * i], s[poles + 2 * i + 1]);
}

template <class Observer>
AnyMade made(const Settings& s, const typename Observer::Config& observer) {
  typename esokit::Adrc<Observer>::Config config;
  config.observer = observer;
  if (law_of_log(s)) {
    config.gains.emplace();
    for (std::size_t i = 0; i < config.gains->size(); ++i)
      (*config.gains)[i] = law_gain(s, i, config.gains->size());
  } else {
    config.controller_bandwidth = s[controller_bandwidth];
  }
  if (s[soften] > 0.0) config.soften = s[soften] > 1.0;
  config.limits.lower = limit_of(s, -1.0);
  config.limits.upper = limit_of(s, 1.0);
  if (s[rate] > 0.0) config.limits.rate = s[rate];
  const auto controller = esokit::Adrc<Observer>::make(config);
  if (!controller) return controller.error();
  return AnyMade(std::make_unique<Controlled<esokit::Adrc<Observer>>>(*controller));
}

template <class Observer>
AnyMade perhaps_delayed(const Settings& s, typename Observer::Config config) {
  if constexpr (requires { config.poles; }) {
    // The pole of a lag that it knows is kept.
    const std::size_t kept = knows_lag(s) ? 1 : 0;
    if (kept > 0) config.poles[0] = -1.0 / s[lag];
    for (std::size_t i = kept; i < config.poles.size(); ++i) config.poles[i] = pole(s, i - kept);
  } else {
    config.observer_bandwidth = s[observer_bandwidth];
  }
  config.input_gain = known_gain(s);
  config.sample_time = s[sample_time];
  const double delay_samples =
      s[knows_dead_time] > 0.0 ? std::round(s[dead_time] / s[sample_time]) : 0.0;
  if (!(delay_samples <= longest_delay))
    return Error<double>{"delay", delay_samples, "must not be above 256 samples"};
  // Without a delay it is the observer itself: one type for both.
  return made<esokit::DelayedInput<Observer, longest_delay>>(
      s, {.observer = config, .delay = static_cast<int>(delay_samples)});
}

template <int Order>
AnyMade controller_for(const Settings& s) {
  constexpr esokit::ModelParts with_actuator{.order = Order, .actuator = 1};
  const auto lagging = [&](auto config) {
    config.model.actuator.time_constant = s[lag];
    return config;
  };
  switch (static_cast<int>(s[observer])) {
    case 0:
      return perhaps_delayed<esokit::LinearEso<Order>>(s, {});
    case 1:
      return perhaps_delayed<esokit::LinearEso<Order, double, 2>>(s, {});
    case 2:
      return perhaps_delayed<esokit::CascadeEso<Order, 2>>(s, {.bandwidth_factor = 2.0});
    case 3: {
      using Observer = esokit::ModelEso<with_actuator>;
      return perhaps_delayed<Observer>(s, lagging(typename Observer::Config{}));
    }
    case 4:
      return perhaps_delayed<esokit::LinearEso<Order, double, 1, esokit::PoleSet>>(s, {});
    default: {
      using Observer = esokit::ModelEso<with_actuator, double, esokit::PoleSet>;
      return perhaps_delayed<Observer>(s, lagging(typename Observer::Config{}));
    }
  }
}

// ---- the run ----

double stepped(const Settings& s, int law_order) {
  if (!(s[saturate] > 0.0)) return s[reference];
  // So that the law asks at once for three times the limit: k_0 r / b0, times the lag that it
  // knows.
  return 3.0 * s[limit] * std::abs(known_gain(s)) / std::pow(s[controller_bandwidth], law_order) /
         (law_of_log(s) ? s[law] : 1.0) / (knows_lag(s) ? s[lag] : 1.0);
}

struct Trace {
  std::vector<double>*y, *u;
  std::vector<double>*t = nullptr, *r = nullptr, *measured = nullptr, *d = nullptr,
  *found = nullptr;
};

Outcome run_one(const Settings& s, const Plant<6>& plant, double step, AnyController& controller,
                const Trace& trace, std::array<double, number_count>& numbers) {
  const double T = s[sample_time];
  const auto count = static_cast<long>(s[samples]);
  const long loaded = count / 2;
  double speed = 0.0;
  const int top = static_cast<int>(s[order]) - 1;  // the state before d
  long k = 0, seen = 0;
  const auto disturbance_of = [&](bool with_load) {
    // Dry friction stops the machine at most; it does not push it back.
    const double holding = std::clamp(speed / T, -s[friction], s[friction]);
    return (with_load ? -s[load] : 0.0) - holding;
  };
  esokit::sim::RunConfig<Plant<6>, std::function<double(double, double)>> config;
  config.duration = static_cast<double>(count) * T;
  config.sample_time = T;
  config.reference = step;
  config.noise = s[noise] * (s[twice_the_noise] > 0.0 ? 2.0 : 1.0);
  config.seed = 1;
  config.disturbance = [&](double) { return disturbance_of(k > loaded); };
  config.sensor = [&](double, double y) {
    const long now = seen++;
    if (s[not_a_number] > 0.0 && now == count / 4) return nan;
    if (s[lose] > 0.0 && now % 10 == 9) return nan;
    return s[quantum] > 0.0 ? s[quantum] * std::round(y / s[quantum]) : y;
  };
  const auto late = static_cast<std::size_t>(std::ceil(s[dead_time] / T - 1e-9));
  std::vector<double> sent(late + 1, 0.0);
  const double told = known_gain(s);
  double settled = 0.0;
  const auto map = esokit::ActuatorMap<double, 3>::make(curve_of(s));
  if (!map) return map.error();
  double asked = 0.0;  // u, where the plant has its effect
  const std::function<double(double, double)> update = [&](double y, double r) {
    asked = map->input(controller.update(y, r));
    return effect_of(s, asked);
  };
  const auto end = esokit::sim::run(plant, update, config, [&](const auto& sample) {
    k = static_cast<long>(sample.index) + 1;
    speed = sample.state(top);
    const double y = sample.output, u = asked, t = sample.t;
    trace.y->push_back(y);
    trace.u->push_back(u);
    if (!std::isfinite(sample.measurement)) numbers[refused] += 1.0;
    const double error = std::abs(y - step);
    if (k <= loaded) {
      numbers[overshoot] = std::max(numbers[overshoot], (y - step) / step);
      if (error > 0.02 * std::abs(step)) settled = t + T;
    } else {
      numbers[load_peak] = std::max(numbers[load_peak], error);
      numbers[load_area] += error * T;
    }
    numbers[largest_input] = std::max(numbers[largest_input], std::abs(u));
    // Behind a map to rounding.
    constexpr double almost = 1.0 - 1e-12;
    if (u >= almost * s[limit] || u <= -almost * s[down] * s[limit])
      numbers[at_limit] += 1.0 / static_cast<double>(count);
    if (trace.t == nullptr) return;
    sent[static_cast<std::size_t>(sample.index) % (late + 1)] = sample.input;
    const double arrives = sent[static_cast<std::size_t>(sample.index + 1) % (late + 1)];
    esokit::Vector<double, 1> in, of;
    in(0) = late == 0 ? sample.input : arrives;
    of(0) = disturbance_of(k > loaded);
    trace.t->push_back(t);
    trace.r->push_back(step);
    trace.measured->push_back(sample.measurement);
    trace.d->push_back(plant.derivative(sample.state, in, of)(top) -
                       told * (maps(s) ? sample.input : u));
    trace.found->push_back(controller.estimate());
  });
  if (!end) return end.error();
  numbers[settling] = settled < static_cast<double>(loaded) * T ? settled : nan;
  return {};
}

// ---- the loop ----

Outcome judge(const esokit::Loop& loop, const Settings& s, bool whole,
              std::array<double, number_count>& numbers) {
  numbers[stable] = loop.stable() ? 1.0 : 0.0;
  for (const int i :
       {gain_increase, gain_decrease, phase, modulus, delay, crossover, noise_in_input})
    numbers[static_cast<std::size_t>(i)] = nan;
  if (!loop.stable()) return {};
  const auto edges = margins(loop);
  if (!edges) return edges.error();
  numbers[gain_increase] = edges->gain_increase.value;
  numbers[gain_decrease] = edges->gain_decrease.value;
  numbers[phase] = edges->phase.value;
  numbers[crossover] = edges->phase.frequency;
  numbers[modulus] = edges->modulus.value;
  if (whole) {  // it takes longer than all the rest
    const auto later = delay_margin(loop);
    if (!later) return later.error();
    numbers[delay] = later->value;
  }
  const double sigma = s[noise] * (s[twice_the_noise] > 0.0 ? 2.0 : 1.0);
  const auto swing = esokit::noise(loop, esokit::LoopNoise{.measurement = {sigma}});
  if (!swing) return swing.error();
  numbers[noise_in_input] = swing->control[0];
  return {};
}

void draw(const esokit::Loop& loop, Result& result, int first) {
  const double T = loop.sample_time();
  const double to = std::numbers::pi / T, from = to * 1e-4;
  double last = 0.0;
  for (int i = 0; i < bode_points; ++i) {
    const double w = i + 1 == bode_points ? to : from * std::pow(1e4, i / (bode_points - 1.0));
    if (first == loop_gain) result.curves[frequency].push_back(w);
    const auto l = loop.loop_gain(w);
    const auto n = loop.noise_to_control(w);
    const auto at = [&](int offset) -> std::vector<double>& {
      return result.curves[static_cast<std::size_t>(first + offset)];
    };
    at(0).push_back(l ? std::abs(*l) : nan);
    double angle = l ? std::arg(*l) : nan;
    if (i > 0 && std::isfinite(angle) && std::isfinite(last))
      angle -= 2.0 * std::numbers::pi * std::round((angle - last) / (2.0 * std::numbers::pi));
    else if (angle > 0.0)
      angle -= 2.0 * std::numbers::pi;
    last = angle;
    at(1).push_back(angle);
    at(2).push_back(l ? 1.0 / std::abs(1.0 + *l) : nan);
    at(3).push_back(n ? std::abs(*n) : nan);
  }
}

// The PID that the continuous ADRC of these bandwidths, times a factor, is equal to.
template <int Order>
Expected<esokit::PlainPidConfig, Error<double>> pid_of(const Settings& s, double factor) {
  const auto gains = esokit::pid_from_adrc<Order>(
      esokit::AdrcTuning<double>{.input_gain = known_gain(s),
                                 .controller_bandwidth = factor * s[controller_bandwidth],
                                 .observer_bandwidth = factor * s[observer_bandwidth]});
  if (!gains) return gains.error();
  esokit::PlainPidConfig pid;
  pid.proportional = gains->proportional;
  pid.integral = gains->integral;
  pid.derivative = gains->derivative;
  if constexpr (Order == 1) {
    pid.filter_frequency = 2.0 / gains->filter_time;
    pid.filter_damping = 1.0;
  } else {
    pid.filter_frequency = 1.0 / std::sqrt(gains->filter_time_squared);
    pid.filter_damping = 0.5 * gains->filter_time * pid.filter_frequency;
  }
  // As large a kick of u by a step as that of the ADRC.
  pid.reference_weight =
      std::pow(s[controller_bandwidth], Order) / (known_gain(s) * pid.proportional);
  pid.lower = limit_of(s, -1.0);
  pid.upper = limit_of(s, 1.0);
  pid.sample_time = s[sample_time];
  return pid;
}

template <int Order>
Outcome pid_beside(const Settings& s, const Machine& machine, double step, double wanted_modulus,
                   bool whole, Result& result) {
  if constexpr (Order == 3) {
    result.pid_note = "A PID has no second derivative: there is none for three integrations.";
    return {};
  } else {
    const auto loop_of = [&](const esokit::PlainPidConfig& pid) {
      return esokit::Loop::make(machine.dense, esokit::detail::pid_form(pid));
    };
    const auto modulus_of = [&](double factor) {
      const auto pid = pid_of<Order>(s, factor);
      if (!pid) return 0.0;
      const auto loop = loop_of(*pid);
      if (!loop || !loop->stable()) return 0.0;
      const auto edges = margins(*loop);
      return edges ? edges->modulus.value : 0.0;
    };
    // Between the last factor that keeps more and the first that keeps less: by secants, the end
    // that stays counted half (Illinois), and by halves while one end is not stable.
    double low = 0.0, high = 0.0, above = 0.0, below = 0.0, factor = 1.0;
    for (int i = 0; i < 24 && (low == 0.0 || high == 0.0); ++i) {
      const double more = modulus_of(factor) - wanted_modulus;
      if (more >= 0.0) {
        low = factor;
        above = more;
        factor *= 1.25;
      } else {
        high = factor;
        below = more;
        factor /= 1.25;
      }
    }
    if (!(wanted_modulus > 0.0) || low == 0.0 || high == 0.0) {
      result.pid_note = "No PID of this form has the margins of this ADRC.";
      return {};
    }
    bool halves = below <= -wanted_modulus;
    double lack = above;  // of the secant; that of `low` is `above`
    int side = 0;
    for (int i = 0; i < 20 && above > 1e-6 * wanted_modulus; ++i) {
      const double share = halves ? 0.5 : lack / (lack - below);
      const double middle = low + share * (high - low);
      const double more = modulus_of(middle) - wanted_modulus;
      if (more >= 0.0) {
        low = middle;
        above = lack = more;
        if (side > 0) below *= 0.5;
        side = 1;
      } else {
        high = middle;
        below = more;
        if (side < 0) lack *= 0.5;
        side = -1;
        halves = more <= -wanted_modulus;
      }
    }
    // To six digits, so that the last bit of a library of mathematics does not make another PID.
    low = std::round(low * 1e6) / 1e6;
    const auto config = pid_of<Order>(s, low);
    if (!config) return config.error();
    const auto pid = esokit::PlainPid::make(*config);
    if (!pid) return pid.error();
    const auto loop = loop_of(*config);
    if (!loop) return loop.error();
    if (auto ok = judge(*loop, s, whole, result.numbers[1]); !ok) return ok;
    draw(*loop, result, pid_loop_gain);
    PidBeside beside(*pid);
    const auto ok =
        run_one(s, machine.roomy, step, beside,
                {&result.signals[pid_output], &result.signals[pid_input]}, result.numbers[1]);
    if (!ok) return ok;
    char text[200];
    std::snprintf(text, sizeof text,
                  "Kp %.4g, Ki %.4g /s, Kd %.4g s, filter %.4g rad/s of damping %.3g",
                  config->proportional, config->integral, config->derivative,
                  config->filter_frequency, config->filter_damping);
    result.pid_note = text;
    return {};
  }
}

template <int Order>
Outcome play_order(const Settings& s, bool whole, Result& result) {
  auto controller = controller_for<Order>(s);
  if (!controller) return controller.error();
  const double step = stepped(s, Order + (knows_lag(s) ? 1 : 0));
  const auto machine = machine_for<Order>(s);
  if (!machine) return machine.error();
  const auto form = (*controller)->linear();
  if (!form) return form.error();
  const auto loop = esokit::Loop::make(machine->dense, *form);
  if (!loop) return loop.error();
  if (auto ok = judge(*loop, s, whole, result.numbers[0]); !ok) return ok;
  draw(*loop, result, loop_gain);
  auto& signals = result.signals;
  const Trace trace{&signals[output],  &signals[input],       &signals[time],
                    &signals[wanted],  &signals[measurement], &signals[disturbance],
                    &signals[estimate]};
  if (auto ok = run_one(s, machine->roomy, step, **controller, trace, result.numbers[0]); !ok)
    return ok;
  if (!(s[pid] > 0.0)) return {};
  return pid_beside<Order>(s, *machine, step, result.numbers[0][modulus], whole, result);
}

// ---- C++ to take home ----

std::string code_of(const Settings& s, double step) {
  const auto n = std::to_string(static_cast<int>(s[order]));
  const auto kind = static_cast<int>(s[observer]);
  const char* header = kind == 2 ? "cascade_eso" : knows_lag(s) ? "model_eso" : "linear_eso";
  const std::string parts = "esokit::ModelParts{.order = " + n + ", .actuator = 1}";
  std::string type = kind == 0   ? "esokit::LinearEso<" + n + ">"
                     : kind == 1 ? "esokit::LinearEso<" + n + ", double, 2>"
                     : kind == 2 ? "esokit::CascadeEso<" + n + ", 2>"
                     : kind == 3 ? "esokit::ModelEso<" + parts + ">"
                     : kind == 4 ? "esokit::LinearEso<" + n + ", double, 1, esokit::PoleSet>"
                                 : "esokit::ModelEso<" + parts + ", double, esokit::PoleSet>";
  std::string config = "{.observer_bandwidth = " + text_of(s[observer_bandwidth]);
  std::string gains = ".controller_bandwidth = " + text_of(s[controller_bandwidth]);
  if (poles_of_log(s)) {
    config = "{.poles = {{";
    if (kind == 5) config += "{" + text_of(-1.0 / s[lag]) + ", 0}, ";
    for (std::size_t i = 0; i <= static_cast<std::size_t>(s[order]); ++i)
      config += (i > 0 ? ", {" : "{") + text_of(pole(s, i).real()) + ", " +
                text_of(pole(s, i).imag()) + "}";
    config += "}}";
  }
  if (law_of_log(s)) {
    const std::size_t count = static_cast<std::size_t>(s[order]) + (kind == 5 ? 1 : 0);
    gains = ".gains = {{";
    for (std::size_t i = 0; i < count; ++i)
      gains += (i > 0 ? ", " : "") + text_of(law_gain(s, i, count));
    gains += "}}";
  }
  if (s[soften] > 0.0) gains += std::string(", .soften = ") + (s[soften] > 1.0 ? "true" : "false");
  if (kind == 2) config += ", .bandwidth_factor = 2";
  config +=
      ", .input_gain = " + text_of(known_gain(s)) + ", .sample_time = " + text_of(s[sample_time]);
  if (knows_lag(s)) config += ", .model = {.actuator = {.time_constant = " + text_of(s[lag]) + "}}";
  config += "}";
  const bool delayed = s[knows_dead_time] > 0.0;
  if (delayed) {
    type = "esokit::DelayedInput<" + type + ", " + std::to_string(longest_delay) + ">";
    config = "{.observer = " + config +
             ", .delay = " + text_of(std::round(s[dead_time] / s[sample_time])) + "}";
  }
  if (maps(s)) {
    const ActuatorCurve curve = curve_of(s);
    std::string points;
    if (curve.points == 3) {
      points = ".input = {{" + text_of(curve.input[0]) + ", 0, " + text_of(curve.input[2]) +
               "}}, .effect = {{" + text_of(curve.effect[0]) + ", 0, " + text_of(curve.effect[2]) +
               "}}, .points = 3, ";
    } else {
      points = ".points = 1, ";
    }
    type = "esokit::MappedInput<" + type + ", 3>";
    config = "{.observer = " + config + ", .curve = {" + points +
             ".slope_below = " + text_of(curve.slope_below) + "}}";
  }
  std::string text = "#include <cstdio>\n";
  if (delayed) text += "#include <esokit/adapter/delayed_input.hpp>\n";
  if (maps(s)) text += "#include <esokit/adapter/mapped_input.hpp>\n";
  if (poles_of_log(s)) text += "#include <esokit/gain/pole_set.hpp>\n";
  text += "#include <esokit/control/adrc.hpp>\n#include <esokit/observer/" + std::string(header) +
          ".hpp>\n\nint main() {\n  using Observer = " + type +
          ";\n  auto controller = esokit::Adrc<Observer>::make(\n      {.observer = " + config +
          ",\n       " + gains +
          ",\n       .limits = {.lower = " + text_of(s[down] > 0.0 ? -s[down] * s[limit] : 0.0) +
          ", .upper = " + text_of(s[limit]) +
          (s[rate] > 0.0 ? ", .rate = " + text_of(s[rate]) : "") +
          "}});\n  if (!controller) return 1;  // controller.error() names the field, the value "
          "and the rule\n\n"
          "  // Once a sample: y measured, NaN where it is missing; u is to be held until the next "
          "one.\n"
          "  const double y = 0, reference = " +
          text_of(step) +
          ";\n  const double u = controller->update(y, reference);\n"
          "  std::printf(\"u %.17g, disturbance %.17g\\n\", u, "
          "controller->observer().total_disturbance());\n}\n";
  return text;
}

Outcome within_reason(const Settings& s) {
  for (std::size_t i = 0; i < s.size(); ++i) {
    const Field& field = all_fields[i];
    const bool none = field.kind == Kind::number_or_none && s[i] == 0.0;
    if (!std::isfinite(s[i])) return Error<double>{field.name, s[i], "must be a number"};
    if (field.kind == Kind::number_or_none && s[i] < 0.0)
      return Error<double>{field.name, s[i], "must not be negative"};
    if (field.kind == Kind::number && !(s[i] > 0.0))
      return Error<double>{field.name, s[i], "must be above zero"};
    if (!none && (field.kind == Kind::choice || field.kind == Kind::on_off) &&
        !(s[i] >= field.low && s[i] <= field.high && s[i] == std::floor(s[i])))
      return Error<double>{field.name, s[i], "is not one of the choices"};
  }
  if (!(s[samples] >= 100.0 && s[samples] <= 20000.0 && s[samples] == std::floor(s[samples])))
    return Error<double>{"samples", s[samples], "must be a whole number, 100 .. 20000"};
  if (maps(s) && s[rate] > 0.0)
    return Error<double>{"rate", s[rate], "is simulated without a known curve only: must be",
                         -1,     0.0,     true};
  if (!(s[dead_time] <= 900.0 * s[sample_time]))
    return Error<double>{"dead_time", s[dead_time], "must not be above 900 sample times"};
  return {};
}

}  // namespace

const std::array<Field, field_count>& fields() { return all_fields; }

std::string fields_json() {
  std::string text = "[";
  for (const Field& field : all_fields) {
    const auto add = [&](const char* name, const std::string& value) {
      text += std::string("\"") + name + "\":" + value + ",";
    };
    const auto quoted = [](const char* words) { return "\"" + std::string(words) + "\""; };
    text += text.size() > 1 ? ",{" : "{";
    add("name", quoted(field.name));
    add("label", quoted(field.label));
    add("unit", quoted(field.unit));
    add("group", quoted(field.group));
    add("kind", std::to_string(static_cast<int>(field.kind)));
    add("low", text_of(field.low));
    add("high", text_of(field.high));
    add("standard", text_of(field.standard));
    add("choices", quoted(field.choices));
    text += "\"hint\":" + quoted(field.hint) + "}";
  }
  return text + "]";
}

Settings standard_settings() {
  Settings s{};
  for (std::size_t i = 0; i < s.size(); ++i) s[i] = all_fields[i].standard;
  return s;
}

Result play(const Settings& s, bool whole) {
  Result result;
  Outcome ok = within_reason(s);
  if (ok) {
    for (auto& signal : result.signals) signal.reserve(static_cast<std::size_t>(s[samples]));
    ok = s[order] == 1.0   ? play_order<1>(s, whole, result)
         : s[order] == 2.0 ? play_order<2>(s, whole, result)
                           : play_order<3>(s, whole, result);
  }
  if (!ok) {
    result = {};
    result.refusal = said(ok.error());
  } else {
    result.code = code_of(s, result.signals[wanted].front());
  }
  return result;
}

bool read_settings(const std::string& address, Settings& settings) {
  settings = standard_settings();
  for (std::size_t at = 0; at < address.size();) {
    const std::size_t end = std::min(address.find('&', at), address.size());
    const std::string part = address.substr(at, end - at);
    const std::size_t equals = part.find('=');
    at = end + 1;
    if (equals == std::string::npos) return false;
    bool known = false;
    for (std::size_t i = 0; i < settings.size(); ++i) {
      if (part.substr(0, equals) != all_fields[i].name) continue;
      char* rest = nullptr;
      settings[i] = std::strtod(part.c_str() + equals + 1, &rest);
      known = *rest == '\0';
    }
    if (!known) return false;
  }
  return true;
}

}  // namespace playground
