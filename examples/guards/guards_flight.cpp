// A rate loop of a multirotor on bad days: on the ground, with a b0 that follows the throttle, with
// a disturbance beyond what the airframe may be given, with a mixer at its end. Then the whole
// flight controller axis of flight_controller.hpp on one flight.
//
// Way: sampled, the plant in steps of a tenth of a sample.
//
// Plant       y' = b v + d,  tau v' = u - v,  abs(u) <= 1;  unstable airframe: y'' = a y + b v + d
// Controller  Adrc<Guarded<LinearEso<..>>>, with the guard and without
//
// symbol    code          value      unit
// T         sample_time   0.001      s
// omega_o   observer      100        rad/s
// omega_c   controller    25         rad/s
// tau       lag           0.01       s
// b0        hover         600        rad/s^2

#include <esokit/sim/gaussian.hpp>
#include <type_traits>

#include "guards/flight_controller.hpp"
#include "guards/guards.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace guards;

namespace {

constexpr double sample_time = 1e-3;
constexpr double hover = 600;

using Loop = Adrc<Guarded<LinearEso<1>>>;

Loop rate_loop(double bound = 0) {
  Loop::Config config{.controller_bandwidth = 25, .limits = {.lower = -1, .upper = 1}};
  config.observer.observer = {
      .observer_bandwidth = 100, .input_gain = hover, .sample_time = sample_time};
  config.observer.disturbance_bound = bound;
  config.observer.unit = DisturbanceUnit::input;
  return Loop::make(config).value();
}

/// y' = b v + d with a motor that lags.
struct Axis {
  double rate = 0;
  double motor = 0;
  void step(double u, double b, double d, double lag = 0.01) {
    constexpr double h = sample_time / 10;
    for (int i = 0; i < 10; ++i) {
      motor += h / lag * (u - motor);
      rate += h * (b * motor + d);
    }
  }
};

void draw(Report& report, const std::string& name, const std::string& caption, const Trace& bare,
          const Trace& guarded, const std::string& rate, const std::string& other,
          bool disturbance = false) {
  Figure figure(name, {.rows = 1, .columns = 2, .panel_height = 220});
  figure.caption(caption);
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label(rate)
      .legend(Legend::above)
      .line(bare.t, bare.y, {.name = "without", .color = Color::vermillion})
      .line(guarded.t, guarded.y, {.name = "with the guard", .color = Color::blue});
  figure.panel(0, 1)
      .x_label("t (s)")
      .y_label(other)
      .line(bare.t, disturbance ? bare.d : bare.u, {.color = Color::vermillion})
      .line(guarded.t, disturbance ? guarded.d : guarded.u, {.color = Color::blue});
  report.add(figure);
}

/// Two seconds on the ground with a stick that is not quite centred, then take-off.
void ground(Report& report) {
  const auto fly = [](bool guarded) {
    auto loop = rate_loop();
    Axis axis;
    Trace trace;
    for (int k = 0; k < 3000; ++k) {
      const double t = k * sample_time;
      const bool on_ground = t < 2;
      double u = 0;
      if (guarded && on_ground) {
        u = loop.hold(axis.rate, axis.rate, 0);
      } else {
        u = loop.update(axis.rate, 0.3);
      }
      trace.add(t, axis.rate, u, loop.observer().total_disturbance());
      axis.step(u, hover, 0);
      if (on_ground) axis.rate = 0;
    }
    return trace;
  };
  const Trace bare = fly(false);
  const Trace guarded = fly(true);
  const std::string name = "ground wind-up and take-off";
  // Of the range of 2; the law asks for omega_c (r - y) / b0 by itself.
  const double first_bare = std::abs(bare.u[2000] - 25 * 0.3 / hover) / 2;
  const double first = std::abs(guarded.u[2000] - 25 * 0.3 / hover) / 2;
  report.expect(name, "kick of u at the first free sample, share of the range, without", first_bare,
                first_bare > 0.4, "above 0.4");
  report.expect(name, "the same with hold", first, first <= 0.01, "at most 0.01");
  const double rate_bare = peak(bare, bare.y, 2, 3);
  const double rate = peak(guarded, guarded.y, 2, 3);
  report.expect(name, "largest rate without (rad/s)", rate_bare, rate_bare > 2, "above 2");
  report.expect(name, "largest rate with hold (rad/s)", rate, rate < 0.35, "below 0.35");
  draw(report, "ground",
       "Two seconds on the ground, with the stick 0.3 rad/s off its centre. Without a guard the "
       "observer takes the ground for a load, u goes to its limit, and the craft jumps when it "
       "takes off. With hold, dhat does not change, and the loop starts from rest.",
       bare, guarded, "rate (rad/s)", "u (-)");
}

/// b0 goes with the throttle; the law is given nothing, the truth, or the inverse.
void throttle(Report& report) {
  const auto fly = [](int law) {
    auto loop = rate_loop();
    Axis axis;
    Trace trace;
    for (int k = 0; k < 3000; ++k) {
      const double t = k * sample_time;
      const double share = std::fmod(t, 1.0) < 0.5 ? 0.35 : 2.2;
      const double b = hover * share;
      if (law != 0) (void)loop.set_input_gain(law > 0 ? b : hover / share);
      const double r = std::fmod(t, 0.5) < 0.25 ? 2 : -2;
      const double u = loop.update(axis.rate, r);
      // What a right loop would do: y' = omega_c (r - y).
      trace.add(t, axis.rate, u, loop.observer().total_disturbance());
      axis.step(u, b, 20, 0.003);
    }
    return trace;
  };
  const Trace none = fly(0);
  const Trace right = fly(1);
  const Trace wrong = fly(-1);
  const auto overshoot = [](const Trace& trace) {
    return 100 * (peak(trace, trace.y, 0.5, 3) / 2 - 1);
  };
  const std::string name = "b0 over throttle, by a factor of 6";
  const double of_none = overshoot(none);
  const double of_right = overshoot(right);
  const double of_wrong = overshoot(wrong);
  report.expect(name, "overshoot with the right law (%)", of_right, 2 * of_right < of_none,
                "less than half of that with none");
  report.expect(name, "overshoot with no law (%)", of_none, of_none > of_right, "more");
  report.expect(name, "overshoot with the inverse law (%)", of_wrong, of_wrong > 2 * of_none,
                "more than twice that of no law");
  Figure figure("throttle", {.rows = 1, .columns = 1, .panel_height = 240});
  figure.caption(
      "Rate steps while the throttle, and with it b, jumps every half second between 0.35 and 2.2 "
      "times its value at hover. If b0 is set to b at each sample, the loop is the same at every "
      "throttle. If the dependence on the throttle is inverted, the loop is worse than with a "
      "constant b0.");
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("rate (rad/s)")
      .x_range(0.5, 2)
      .y_range(-6, 6)
      .legend(Legend::above)
      .line(wrong.t, wrong.y, {.name = "b0 inverted", .color = Color::orange, .width = 1})
      .line(none.t, none.y, {.name = "constant b0", .color = Color::vermillion})
      .line(right.t, right.y, {.name = "b0 follows the throttle", .color = Color::blue});
  report.add(figure);
}

/// A gust of three times what the actuator can do: dhat asks the airframe for all it has.
void bound(Report& report) {
  const auto fly = [](bool guarded) {
    auto loop = rate_loop(guarded ? 0.5 : 0);
    Axis axis;
    Trace trace;
    for (int k = 0; k < 2000; ++k) {
      const double t = k * sample_time;
      const double u = loop.update(axis.rate, 0.0);
      trace.add(t, axis.rate, u, loop.observer().total_disturbance() / hover);
      axis.step(u, hover, t > 0.5 && t < 0.9 ? 0.8 * hover : 0);
    }
    return trace;
  };
  const Trace bare = fly(false);
  const Trace guarded = fly(true);
  const std::string name = "disturbance beyond what the loop may compensate";
  const double most_bare = peak(bare, bare.d, 0, 2);
  const double most = peak(guarded, guarded.d, 0, 2);
  report.expect(name, "largest dhat / b0 without", most_bare, most_bare > 0.75, "above 0.75");
  report.expect(name, "largest dhat / b0 with a bound of 0.5", most, most <= 0.5 + 1e-9,
                "at most 0.5");
  const double steady = guarded.y[890];
  // What is left of the load is carried by the corrections of y in law and observer.
  report.check_reference(name, "steady error of the rate under it (rad/s)",
                         hover * 0.3 * (1.0 / 25 + 1.0 / 200), steady, Tolerance(0.03),
                         "(d - bound) (1 / omega_c + 1 / (2 omega_o))");
  draw(report, "bound",
       "A load of 0.8 b0 for 0.4 s. The bound is asked for: dhat may take at most 0.5 b0 of the "
       "actuator, whatever the observer sees. What the load has beyond it stays as a steady error, "
       "which bounded() reports; without the bound 0.96 of the actuator goes to the load.",
       bare, guarded, "rate (rad/s)", "dhat / b0", true);
}

/// An unstable airframe whose mixer is at its end for 0.4 s and gives a moment of its own.
struct Pinned {
  double a, b, observer, controller, moment, load, reference;
};
Trace pinned_flight(const Pinned& p, bool guarded, double share_of_u = 0) {
  using Attitude = Adrc<Guarded<LinearEso<2>>>;
  Attitude::Config config{.controller_bandwidth = p.controller,
                          .limits = {.lower = -1, .upper = 1}};
  config.observer.observer = {
      .observer_bandwidth = p.observer, .input_gain = p.b, .sample_time = 0.002};
  config.observer.release_samples = 10;
  auto loop = Attitude::make(config).value();
  Trace trace;
  double angle = 0;
  double rate = 0;
  double motor = 0;
  double u = 0;
  for (int k = 0; k < 2000 && std::abs(angle) < 3; ++k) {
    const double t = k * 0.002;
    const bool at_end = t >= 1 && t < 1.4;
    for (int i = 0; i < 4; ++i) {
      const double given = at_end ? p.moment + share_of_u * u : u;
      motor += 0.0005 / 0.01 * (given - motor);
      rate += 0.0005 * (p.a * angle + p.b * motor + p.load);
      angle += 0.0005 * rate;
    }
    if (guarded) loop.observer().set_pin(at_end ? Pin::either : Pin::free);
    u = loop.update(angle, t > 0.95 ? p.reference : 0.0);
    trace.add(t, angle, u, loop.observer().total_disturbance());
  }
  return trace;
}

void pinned(Report& report) {
  const Pinned one{35.2, 20.8, 63.9, 14.7, 0.38, -0.8, -0.39};
  const Trace bare = pinned_flight(one, false);
  const Trace guarded = pinned_flight(one, true);
  const std::string name = "mixer pinned for 0.4 s";
  const double worst_bare = peak(bare, bare.y, 1, 4);
  const double worst = peak(guarded, guarded.y, 1, 4);
  report.expect(name, "largest angle without (rad)", worst_bare, worst_bare > 2.9, "departs");
  report.expect(name, "largest angle with the pin given (rad)", worst, worst < 0.6, "below 0.6");
  const double now = guarded.d[680] + 0.8 - 35.2 * guarded.y[680];
  report.expect(name, "dhat off at the end of the pin, of b0, with it", std::abs(now) / one.b,
                std::abs(now) < 0.5 * one.b, "below 0.5");
  // Not this one alone: 2000 loops at random, and what becomes of those that one of two loses.
  for (const bool follows : {false, true}) {
    int saved = 0;
    int lost = 0;
    std::uint64_t state = 1;
    const auto uniform = [&](double low, double high) {
      state = state * 6364136223846793005u + 1442695040888963407u;
      return low + (high - low) * static_cast<double>(state >> 11u) * 0x1p-53;
    };
    for (int i = 0; i < 2000; ++i) {
      const double b = uniform(10, 40);
      const double observer = uniform(20, 80);
      const Pinned any{uniform(5, 40),     b,
                       observer,           observer / uniform(2, 6),
                       uniform(-0.2, 0.7), uniform(-0.5, 0.5) * b,
                       uniform(-0.4, 0.4)};
      Pinned given = any;
      if (follows) given.moment = 0;
      const double share = follows ? any.moment : 0;
      const Trace x = pinned_flight(given, false, share);
      const Trace z = pinned_flight(given, true, share);
      const bool departs = peak(x, x.y, 0, 4) > 2.9;
      const bool departs_guarded = peak(z, z.y, 0, 4) > 2.9;
      saved += departs && !departs_guarded ? 1 : 0;
      lost += !departs && departs_guarded ? 1 : 0;
    }
    const std::string which = follows ? "2000 loops, a share of u gets through"
                                      : "2000 loops, a moment that has nothing to do with u";
    report.expect(which, "saved by the pin", saved, follows || saved > lost,
                  follows ? "reported" : "more than lost");
    report.expect(which, "lost by it", lost, !follows || lost > saved,
                  follows ? "more than saved: no guard for this" : "reported");
  }
  draw(report, "pinned",
       "The attitude loop of an unstable airframe. From 1 to 1.4 s the mixer delivers a moment "
       "that does not depend on u. Without set_pin, dhat compensates this moment, and control is "
       "lost when the mixer is free again.",
       bare, guarded, "angle (rad)", "dhat (rad/s^2)", true);
}

/// A rate loop whose motor lags by 20 ms and whose gyro is filtered, with all its guards.
struct LagResult {
  Trace trace;
  double overshoot = 0;   ///< of a step
  double deviation = 0;   ///< after a load of 60 rad/s^2
  double noise = 0;       ///< sd of u, gyro noise of 0.05 rad/s
  double off_pinned = 0;  ///< abs(dhat - d) / b0 while the mixer gives what it likes
  double off_after = 0;   ///< the same in the half second after it
};
template <class Observer>
LagResult lagging_flight(double omega_c, double motor_lag = 0.02) {
  using Loop2 = Adrc<Guarded<DelayedInput<Observer, 4>>>;
  typename Loop2::Config config{.controller_bandwidth = omega_c,
                                .limits = {.lower = -1, .upper = 1}};
  constexpr bool in_model = !std::is_same_v<Observer, LinearEso<2>>;
  auto& eso = config.observer.observer.observer;
  eso.observer_bandwidth = 150;
  eso.sample_time = sample_time;
  if constexpr (in_model) {
    eso.input_gain = hover;
    eso.model = {.actuator = {0.02}};
  } else {
    eso.input_gain = hover / 0.02;
  }
  config.observer.observer.delay = 2;
  config.observer.disturbance_bound = 0.6;
  config.observer.unit = DisturbanceUnit::input;
  config.observer.release_samples = 60;
  const auto designed = Loop2::make(config).value();
  // d by itself: of a chain of order 2 without what the motor makes of it.
  const auto found = [](const Loop2& loop) {
    if constexpr (in_model) {
      return disturbance_parts(loop).constant;
    } else {
      return 0.02 * loop.observer().total_disturbance() + loop.observer().template estimate<1>();
    }
  };
  LagResult result;
  auto loop = designed;
  Axis axis;
  double gyro = 0;
  for (int k = 0; k < 3200; ++k) {
    const double t = k * sample_time;
    const bool on_ground = t < 0.5;
    const bool pinned = t >= 2.5 && t < 2.7;
    const double load = t >= 1.5 && t < 2 ? 60 : 0;
    const double wanted = t >= 0.5 && t < 1 ? 3 : t >= 2.45 ? 2 : 0;
    gyro += sample_time / 0.004 * (axis.rate - gyro);
    loop.observer().set_pin(pinned ? Pin::either : Pin::free);
    const double held = loop.output();
    if (on_ground) {
      (void)loop.hold(gyro, gyro, 0);
    } else {
      (void)loop.update(gyro, wanted);
    }
    const double off = std::abs(found(loop) - load) / hover;
    if (t >= 0.5 && t < 1) result.overshoot = std::max(result.overshoot, axis.rate / 3 - 1);
    if (load > 0) result.deviation = std::max(result.deviation, axis.rate);
    if (pinned) result.off_pinned = std::max(result.off_pinned, off);
    if (t >= 2.7) result.off_after = std::max(result.off_after, off);
    result.trace.add(t, axis.rate, loop.output(), found(loop) / hover);
    axis.step(pinned ? -0.1 : held, hover, load, motor_lag);
    if (on_ground) axis.rate = 0;
  }
  loop = designed;
  axis = {};
  gyro = 0;
  Trace noisy;
  sim::Gaussian noise(1);
  for (int k = 0; k < 4000; ++k) {
    gyro += sample_time / 0.004 * (axis.rate + 0.05 * noise.next() - gyro);
    const double held = loop.output();
    noisy.add(k * sample_time, gyro, loop.update(gyro, 0.0), 0);
    axis.step(held, hover, 0, motor_lag);
  }
  result.noise = rms(noisy, noisy.u, 0.5, 4);
  return result;
}

/// What the guards act on where the motor lags: dhat of a chain of order 2, or d of the model.
void lag(Report& report) {
  using Chain = LinearEso<2>;
  using InModel = ModelEso<ModelParts{.order = 1, .actuator = 1}>;
  const LagResult chain = lagging_flight<Chain>(37.5);
  const LagResult model = lagging_flight<InModel>(75);
  const LagResult slower = lagging_flight<InModel>(75, 0.026);
  const std::string name = "motor lag and guards";
  const auto row = [&](const std::string& metric, double LagResult::*of, double factor) {
    report.expect(name, metric + ", chain of order 2", factor * (chain.*of), true, "reported");
    report.expect(
        name, metric + ", lag in the model", factor * (model.*of),
        of == &LagResult::deviation ? model.*of < 1.1 * (chain.*of) : model.*of < 0.8 * (chain.*of),
        of == &LagResult::deviation ? "at most a tenth more" : "a fifth less at least");
    report.expect(name, metric + ", motor 30 % slower than the model", factor * (slower.*of), true,
                  "reported");
  };
  row("overshoot of a step (%)", &LagResult::overshoot, 100);
  row("rate after a load step (rad/s)", &LagResult::deviation, 1);
  row("sd of u from noise", &LagResult::noise, 1);
  row("dhat off while pinned, of b0", &LagResult::off_pinned, 1);
  row("dhat off afterwards, of b0", &LagResult::off_after, 1);
  Figure figure("lag", {.rows = 1, .columns = 2, .panel_height = 220});
  figure.caption(
      "A rate loop whose motor lags by 20 ms, on the ground until 0.5 s, then a step, a load from "
      "1.5 to 2 s, and a mixer at its end from 2.5 to 2.7 s. Both loops have the same guards; the "
      "disturbance of a chain of order 2 contains the motor, which a guard then holds, too.");
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("rate (rad/s)")
      .legend(Legend::above)
      .line(chain.trace.t, chain.trace.y, {.name = "chain of order 2", .color = Color::vermillion})
      .line(model.trace.t, model.trace.y, {.name = "lag in the model", .color = Color::blue});
  figure.panel(0, 1)
      .x_label("t (s)")
      .y_label("d found, of b0")
      .line(chain.trace.t, chain.trace.d, {.color = Color::vermillion})
      .line(model.trace.t, model.trace.d, {.color = Color::blue});
  report.add(figure);
}

/// flight_controller.hpp from arming to landing.
void flight(Report& report) {
  auto axis = RateAxis::make({}).value();
  Axis plant;
  Trace trace;
  std::vector<double> wanted_rate, gain;
  double gyro = 0;
  double lift = 0.1;
  double held = 0;
  for (int k = 0; k < 6000; ++k) {
    const double t = k * sample_time;
    // Thrust follows the throttle in a tenth of a second.
    const double throttle = t < 1 ? 0.1 : t < 3 ? 0.4 : t < 4 ? 0.9 : 0.3;
    lift += sample_time / 0.1 * (throttle - lift);
    const bool flying = t >= 1 && t < 5.5;
    const double wanted = !flying ? 0.3 : std::fmod(t, 0.8) < 0.4 ? 3 : -3;
    // The gyro's filter: 2 ms.
    gyro += sample_time / 0.002 * 0.5 * (plant.rate - gyro);
    const double u =
        static_cast<double>(axis.rate(static_cast<float>(gyro), static_cast<float>(wanted),
                                      static_cast<float>(lift), flying, false));
    trace.add(t, plant.rate, u, static_cast<double>(axis.disturbance()));
    wanted_rate.push_back(wanted);
    plant.step(held, hover * lift / 0.4, t > 2 ? 60 : 0, 0.02);
    held = u;
    if (!flying) plant.rate = 0;
  }
  const std::string name = "ADRC on a flight controller";
  const double most = peak(trace, trace.y, 1, 5.5);
  report.expect(name, "overshoot over all of the flight (%)", 100 * (most / 3 - 1), most < 3.75,
                "below 25");
  report.expect(name, "dhat on the ground (rad/s^2)", peak(trace, trace.d, 0, 1),
                peak(trace, trace.d, 0, 1) < 1e-3, "none");
  const LoopFault fault = axis.fault();
  report.expect(name, "diagnosis, by number", static_cast<double>(static_cast<int>(fault)),
                fault == LoopFault::none || fault == LoopFault::gain_too_large_or_disturbed,
                "nothing, or that a load drives u: there is one");
  Figure figure("flight", {.rows = 2, .columns = 1, .panel_height = 180});
  figure.caption(
      "One flight: on the ground until 1 s, hover, a load from 2 s on, full throttle from 3 to 4 "
      "s, descent, landed at 5.5 s. The thrust, and with it b, changes by a factor of 3.");
  figure.panel(0, 0)
      .y_label("rate (rad/s)")
      .legend(Legend::above)
      .line(trace.t, wanted_rate, {.name = "wanted", .color = Color::grey, .width = 1})
      .line(trace.t, trace.y, {.name = "rate", .color = Color::blue});
  figure.panel(1, 0).x_label("t (s)").y_label("u (-)").line(trace.t, trace.u,
                                                            {.color = Color::blue});
  report.add(figure);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "guards", "flight",
      about("Failures of a rate loop",
            "Ground, throttle, gust, mixer, and a complete axis of a flight controller."));
  ground(report);
  throttle(report);
  bound(report);
  pinned(report);
  lag(report);
  flight(report);
  return report.finish();
}
