/// @file
/// Controllers beside the update of the observer in them: what the loop, the law and the limits
/// cost; Herbst's filter forms beside state space; what decorators cost.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <optional>
#include <string>

#include "../support/run.hpp"
#include "../support/update_patterns.hpp"

namespace esokit::benchmarks {
namespace {

template <class S>
constexpr S sample_time = static_cast<S>(1e-3);
template <class S>
constexpr S bandwidth = S(1000);  // so that float has the digits for the filter forms in z

template <class S, int Order>
typename LinearEso<Order, S>::Config observer_config() {
  return {.observer_bandwidth = bandwidth<S>, .input_gain = S(2), .sample_time = sample_time<S>};
}

template <class S>
esokit::Limits<S> magnitudes() {
  return {.lower = S(-5), .upper = S(5)};
}

template <class S, class Observer>
Adrc<Observer> adrc(const typename Observer::Config& observer) {
  return Adrc<Observer>::make(
             {.observer = observer, .controller_bandwidth = S(40), .limits = magnitudes<S>()})
      .value();
}

/// What ADRC would replace: PID with a filtered derivative, limits and clamping, no other check.
template <class S>
struct Pid {
  S proportional, integral, derivative, decay, lower, upper;
  S sum{}, filtered{}, last{};

  S update(S y, S r) noexcept {
    const S e = r - y;
    const S slope = derivative * (e - last);
    filtered = decay * filtered + slope;
    last = e;
    const S wanted = proportional * e + sum + filtered;
    const S u = wanted < lower ? lower : wanted > upper ? upper : wanted;
    const S step = integral * e;
    if (wanted == u || (wanted > u) != (step > S(0))) sum += step;
    return u;
  }
};

/// Steps of two lengths in turn: every one is another than the last.
template <class S>
struct Jittering {
  VariableTime<LinearEso<2, S>> observer;
  bool odd = false;

  StepStatus update(S y, S u) noexcept {
    odd = !odd;
    const S factor = static_cast<S>(odd ? 1.1 : 0.9);
    (void)observer.set_step_time(sample_time<S> * factor);
    return observer.update(y, u);
  }
};

std::string against(const std::string& pattern, const std::string& name,
                    const std::string& limit = "") {
  return "vs " + pattern + "/" + name + limit;
}

Limits beside(const std::string& name, const std::string& limit = "") {
  return {against("bank", name, limit), against("call", name, limit),
          against("latency", name, limit)};
}

template <class S>
void add_all(const std::string& scalar) {
  const auto linear = observer_config<S, 2>();
  add<S>("linear_eso/2/" + scalar, LinearEso<2, S>::make(linear).value());
  add<S>("pid/" + scalar, Pid<S>{.proportional = S(40),
                                 .integral = static_cast<S>(0.05),
                                 .derivative = S(500),
                                 .decay = static_cast<S>(0.9),
                                 .lower = S(-5),
                                 .upper = S(5)});
  Limits beside_both = beside("linear_eso/2/" + scalar, " <= 2.0");
  beside_both.bank += "; " + against("bank", "pid/" + scalar);
  beside_both.out_of_line += "; " + against("call", "pid/" + scalar);
  beside_both.latency += "; " + against("latency", "pid/" + scalar);
  add<S>("adrc/2/" + scalar, adrc<S, LinearEso<2, S>>(linear), beside_both);
  add<S>("adrc/3/" + scalar, adrc<S, LinearEso<3, S>>(observer_config<S, 3>()));

  const std::string baseline = "adrc/2/" + scalar;
  add<S>("adrc_with_rate_limit/2/" + scalar,
         Adrc<LinearEso<2, S>>::make({.observer = linear,
                                      .controller_bandwidth = S(40),
                                      .limits = {.lower = S(-5), .upper = S(5), .rate = S(1000)}})
             .value(),
         beside(baseline));
  add<S>(
      "compensator/2/" + scalar,
      DisturbanceCompensator<LinearEso<2, S>>::make({.observer = linear, .limits = magnitudes<S>()})
          .value(),
      beside(baseline));
  using Delayed = DelayedInput<LinearEso<2, S>, 4>;
  add<S>("adrc_delayed_input/2/" + scalar, adrc<S, Delayed>({.observer = linear, .delay = 3}),
         beside(baseline));
  using Wrapped = WrappedOutput<LinearEso<2, S>>;
  add<S>("adrc_wrapped_output/2/" + scalar, adrc<S, Wrapped>({.observer = linear, .period = S(7)}),
         beside(baseline));

  using Gate = OutlierGate<LinearEso<2, S>>;
  add<S>("outlier_gate_off/2/" + scalar, Gate::make({.observer = linear}).value(),
         beside("linear_eso/2/" + scalar));
  add<S>("outlier_gate/2/" + scalar, Gate::make({.observer = linear, .threshold = S(100)}).value(),
         beside("linear_eso/2/" + scalar));

  const auto variable = VariableTime<LinearEso<2, S>>::make({.observer = linear}).value();
  add<S>("variable_time_same_step/2/" + scalar, variable, beside("linear_eso/2/" + scalar));
  add<S>("variable_time_new_step/2/" + scalar, Jittering<S>{variable},
         beside("linear_eso/2/" + scalar));
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
