/// @file
/// Controllers beside hand code with the same tests, and beside the update of the observer in them:
/// what the loop, the law and the limits cost; what decorators cost.
#include <bit>
#include <cstdint>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <optional>
#include <string>
#include <type_traits>

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

/// ADRC of order 2 with limits of u, as one writes it by hand for speed. It tests what Adrc tests:
/// the new state (one sum of squares), u, whether a sample is missing, and a mode; it keeps what
/// can be asked of Adrc (estimate, innovation, the u that the observer was given, the wanted and
/// the limited u, a status). What is to be done then is left out.
template <class S>
struct HandWrittenAdrc {
  S x0{}, x1{}, x2{}, innovation{}, applied{}, last{}, requested{};
  S k0, k1, k2, scaled_input_gain, w0, w1, w2, lower, upper;
  unsigned short missed = 0;
  unsigned char status = 0;
  bool special = false;

  ESOKIT_INLINE static bool finite(S x) noexcept {
    using Bits = std::conditional_t<sizeof(S) == 8, std::uint64_t, std::uint32_t>;
    constexpr Bits exponent = std::bit_cast<Bits>(std::numeric_limits<S>::infinity());
    return (std::bit_cast<Bits>(x) & exponent) != exponent;
  }

  ESOKIT_COLD S bad() noexcept {
    status = 1;
    ++missed;
    return last;
  }

  ESOKIT_INLINE S update(S y, S r) noexcept {
    if (special || missed != 0) [[unlikely]]
      return bad();
    const S u_applied = last;
    const S driven = x2 + scaled_input_gain * u_applied;
    const S half_way = x1 + driven;
    const S p0 = x0 + half_way;
    const S p1 = half_way + driven;
    const S e = y - p0;
    const S n0 = p0 + k0 * e;
    const S n1 = p1 + k1 * e;
    const S n2 = x2 + k2 * e;
    if (!finite(n0 * n0 + n1 * n1 + n2 * n2)) [[unlikely]]
      return bad();
    x0 = n0;
    x1 = n1;
    x2 = n2;
    innovation = e;
    applied = u_applied;
    status = 0;
    S u = w0 * (r - n0) - (w1 * n1 + w2 * n2);
    if (!finite(u)) [[unlikely]]
      u = last;
    requested = u;
    u = u < lower ? lower : u;
    u = upper < u ? upper : u;
    last = u;
    return u;
  }
};

template <class S>
HandWrittenAdrc<S> hand_written_adrc() {
  return {.k0 = static_cast<S>(0.9),
          .k1 = static_cast<S>(0.5),
          .k2 = static_cast<S>(0.1),
          .scaled_input_gain = static_cast<S>(1e-6),
          .w0 = static_cast<S>(12.5),
          .w1 = S(5e3),
          .w2 = S(1e6),
          .lower = S(-5),
          .upper = S(5)};
}

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
  add<S>("hand_written_adrc/2/" + scalar, hand_written_adrc<S>());
  const std::string by_hand = "hand_written_adrc/2/" + scalar;
  beside_both.bank += "; " + against("bank", by_hand, " <= 1.15");
  beside_both.out_of_line += "; " + against("call", by_hand, " <= 1.05");
  beside_both.latency += "; " + against("latency", by_hand, " <= 1.05");
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
