// Every type gives the bits of the commit in CMakeLists.txt, whatever comes: NaN, infinity, 1e308,
// gaps, resets, retunes, guards switched. ESOKIT_ORACLE_SEED and ESOKIT_ORACLE_SAMPLES choose other
// numbers than those of the test.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/mimo_extended_state_filter.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <esokit_before/adapter/delayed_input.hpp>
#include <esokit_before/adapter/guarded.hpp>
#include <esokit_before/adapter/measured.hpp>
#include <esokit_before/adapter/outlier_gate.hpp>
#include <esokit_before/adapter/variable_time.hpp>
#include <esokit_before/adapter/wrapped_output.hpp>
#include <esokit_before/control/adrc.hpp>
#include <esokit_before/control/disturbance_compensator.hpp>
#include <esokit_before/control/predictive_adrc.hpp>
#include <esokit_before/observer/adjustable_bandwidth_eso.hpp>
#include <esokit_before/observer/algebraic_eso.hpp>
#include <esokit_before/observer/cascade_eso.hpp>
#include <esokit_before/observer/extended_state_filter.hpp>
#include <esokit_before/observer/half_gain_eso.hpp>
#include <esokit_before/observer/linear_eso.hpp>
#include <esokit_before/observer/mimo_extended_state_filter.hpp>
#include <esokit_before/observer/model_eso.hpp>
#include <esokit_before/observer/nonlinear_eso.hpp>
#include <esokit_before/observer/reduced_order_eso.hpp>
#include <limits>
#include <support/numbers.hpp>
#include <vector>

namespace esokit_test {
namespace oracle_bits {

long asked(const char* name, long usual) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::strtol(text, nullptr, 10) : usual;
}
const long samples = asked("ESOKIT_ORACLE_SAMPLES", 4000);
const auto seed = static_cast<unsigned>(asked("ESOKIT_ORACLE_SEED", 45));

/// All that a call and the object say, as bits.
class Bits {
 public:
  template <class... T>
  void add(const T&... all) {
    (one(all), ...);
  }
  [[nodiscard]] bool operator==(const Bits&) const = default;

 private:
  template <class T>
  void one(const T& x) {
    if constexpr (requires { x.size(); }) {
      for (decltype(x.size()) i = 0; i < x.size(); ++i) one(x.data()[i]);
    } else {
      const auto number = static_cast<double>(x);
      // A NaN is a NaN: its sign depends on the order in which a compiler adds.
      bits_.push_back(number != number ? 1 : std::bit_cast<std::uint64_t>(number));
    }
  }
  std::vector<std::uint64_t> bits_;
};

/// One number of ten is none, or too large.
template <class S>
S drawn(Random& random, double faults) {
  const double x = random.uniform(-1, 1);
  const double kind = random.uniform(0, 1) / faults;
  using Limits = std::numeric_limits<S>;
  if (kind > 1) return static_cast<S>(x);
  if (kind < 0.4) return hidden_nan<S>();
  if (kind < 0.5) return std::copysign(hidden_infinity<S>(), static_cast<S>(x));
  if (kind < 0.7) return static_cast<S>(x) * (Limits::max)();
  return static_cast<S>(x) * std::sqrt((Limits::max)());
}

/// A number of a call.
struct Draw {
  int call;
  double kind;
  std::vector<double> numbers;
};

template <class O>
void tell(Bits& bits, const O& o) {
  if constexpr (requires { o.sample_time(); }) bits.add(o.sample_time());
  if constexpr (requires { o.estimate(); }) {
    bits.add(o.estimate(), o.total_disturbance(), o.missed(), o.max_gap(), o.applied_input(),
             o.input_gain(), o.template estimate<0>());
    if constexpr (requires { o.innovation(); }) bits.add(o.innovation());
    if constexpr (requires { o.restarts(); }) bits.add(o.restarts());
    if constexpr (requires { o.level_estimate(0); }) bits.add(o.level_estimate(0));
    if constexpr (requires { o.level_gain(0); }) bits.add(o.level_gain(0));
    if constexpr (requires { o.covariance(); }) bits.add(o.covariance(), o.innovation_variance());
    if constexpr (requires { o.age(); }) bits.add(o.age(), o.blanked(), o.settled());
    if constexpr (requires { o.preview(); }) bits.add(o.preview().offset, o.preview().slope);
    if constexpr (requires { o.trust(); }) bits.add(o.trust(), o.gated());
    if constexpr (requires { o.leak_error(); }) bits.add(o.holding_input(), o.leak_error());
    if constexpr (requires { o.bounded(); }) bits.add(o.bounded(), o.present_input_gain());
  } else {
    bits.add(o.output(), o.status());
    if constexpr (requires { o.requested(); }) bits.add(o.requested());
    if constexpr (requires { o.mode(); }) bits.add(o.mode());
    if constexpr (requires { o.softness(); }) bits.add(o.softness());
    if constexpr (requires { o.observer(); }) tell(bits, o.observer());
  }
}

/// One call, the same of both.
template <class O, class Fill>
void call(Bits& bits, O& o, const Draw& draw, const Fill& fill) {
  using S = typename O::scalar_type;
  const S x = static_cast<S>(draw.numbers[0]);
  const S u = static_cast<S>(draw.numbers[1]);
  const S v = static_cast<S>(draw.numbers[2]);
  const S t = static_cast<S>(draw.kind);
  const int c = draw.call;
  if (c < 2) {
    typename O::Config config{};
    fill(config, c == 0 ? 1.0 : 1.25);
    bits.add(o.retune(config).has_value());
    return;
  }
  if constexpr (requires { o.control(x); }) {  // PredictiveAdrc
    if (c < 4) bits.add(o.start(x, u));
    bits.add(c < 12 ? o.control_without_measurement() : o.control(x));
    if (c < 20) bits.add(o.applied(v));
    bits.add(o.prepare(u));
  } else if constexpr (requires { o.predict(u); }) {  // an observer
    if constexpr (requires { o.measured(v); }) o.measured(v);
    if constexpr (requires { o.set_step_time(v); }) {
      if (c < 50) bits.add(o.set_step_time(S(0.01) * (S(0.75) + t / S(2))).has_value());
    }
    if constexpr (requires { o.hold(u); }) {
      if (c == 96) bits.add(o.hold(u));
      if (c == 97) o.release();
      if (c == 98) o.set_trust(t);
      if (c == 95) o.set_pin(static_cast<decltype(o.pin())>(int(4 * t)));
    }
    if constexpr (requires { o.set_input_gain(v); }) {
      if (c == 99) bits.add(o.set_input_gain(S(1) + t).has_value());
    }
    if (c == 2) {
      bits.add(o.reset(x));
    } else if (c == 3) {
      auto state = o.estimate();
      state(1) = v;
      bits.add(o.reset(state));
    } else if (c < 14) {
      bits.add(o.predict(u));
    } else if (c < 20) {
      bits.add(o.correct(x));
    } else if (c < 22) {
      if constexpr (requires { o.revise_input(u); }) bits.add(o.revise_input(u));
    } else if (c < 24) {
      if constexpr (requires { o.shift_disturbance(u); }) bits.add(o.shift_disturbance(v));
      if constexpr (requires { o.shift_load(u); }) bits.add(o.shift_load(u));
    } else if (c < 26) {
      if constexpr (requires { o.shift_output(u); }) bits.add(o.shift_output(x));
    } else if (c < 27) {
      if constexpr (requires { o.update_weighted(x, u, t); }) bits.add(o.update_weighted(x, u, t));
    } else {
      bits.add(o.update(x, u));
    }
  } else {
    if (c < 4) bits.add(o.start(x, u));
    if (c < 20) o.applied(v);
    if constexpr (requires { o.update_without_measurement(u); }) {
      if (c > 90) bits.add(o.update_without_measurement(u));
    }
    if constexpr (requires { o.update(x, {u, v}); }) {
      if (c > 80) bits.add(o.update(x, {u, v}));
    }
    bits.add(o.update(x, u));
  }
}

template <class Now, class Before, class Fill>
void compare(const Fill& fill) {
  using S = typename Now::scalar_type;
  typename Now::Config now_config{};
  typename Before::Config before_config{};
  fill(now_config, 1.0);
  fill(before_config, 1.0);
  auto now = Now::make(now_config).value();
  auto before = Before::make(before_config).value();
  Random random(seed);
  long gap = 0;
  for (long k = 0; k < samples; ++k) {
    // Half of the time all is well, as in normal operation; now and then a long gap.
    const double faults = k % 400 < 200 ? 1e-9 : 0.1;
    Draw draw{static_cast<int>(random.uniform(0, 100)), random.uniform(0, 1), {}};
    if (faults < 0.01 && draw.call < 50) draw.call = 50;
    for (int i = 0; i < 3; ++i)
      draw.numbers.push_back(static_cast<double>(drawn<S>(random, faults)));
    if (k % 400 == 300) gap = static_cast<long>(random.uniform(0, 150));
    if (gap-- > 0) draw.numbers[0] = std::numeric_limits<double>::quiet_NaN();
    Bits of_now, of_before;
    call(of_now, now, draw, fill);
    call(of_before, before, draw, fill);
    tell(of_now, now);
    tell(of_before, before);
    ASSERT_EQ(of_now, of_before) << "sample " << k << ", call " << draw.call;
  }
}

/// The same of a filter of several outputs.
template <class Now, class Before, class Fill>
void compare_mimo(const Fill& fill) {
  typename Now::Config now_config{};
  typename Before::Config before_config{};
  fill(now_config);
  fill(before_config);
  auto now = Now::make(now_config).value();
  auto before = Before::make(before_config).value();
  Random random(seed);
  long gap = 0;
  for (long k = 0; k < samples; ++k) {
    const double faults = k % 400 < 200 ? 1e-9 : 0.1;
    const auto kind = static_cast<int>(random.uniform(0, faults < 0.01 ? 1 : 100));
    const int missing = random.uniform(0, 2) < 1 ? 0 : 1;
    if (k % 200 == 150) gap = static_cast<long>(random.uniform(0, 30));
    double numbers[4];
    for (double& x : numbers) x = drawn<double>(random, faults);
    if (gap-- > 0) numbers[missing] = std::numeric_limits<double>::quiet_NaN();
    const auto play = [&](auto& filter) {
      using Filter = std::remove_cvref_t<decltype(filter)>;
      typename Filter::Output y;
      typename Filter::Input u;
      for (int i = 0; i < 2; ++i) y(i) = numbers[i];
      for (int i = 0; i < 2; ++i) u(i) = numbers[i + 2];
      Bits bits;
      if (kind == 1) bits.add(filter.reset(y));
      if (kind == 2) bits.add(filter.correct(y));
      if (kind == 3) bits.add(filter.predict(u));
      bits.add(filter.update(y, u), filter.estimate(), filter.innovation(), filter.covariance(),
               filter.gain(), filter.missed(0), filter.missed(1), filter.frozen(),
               filter.innovation_covariance(), filter.normalised_innovation());
      return bits;
    };
    ASSERT_EQ(play(now), play(before)) << "sample " << k;
  }
}

const auto chain = [](auto& c, double factor) {
  using S = std::remove_cvref_t<decltype(c.sample_time)>;
  c.input_gain = static_cast<S>(2 * factor);
  c.sample_time = static_cast<S>(0.01);
  c.max_gap = 100;
};
const auto linear = [](auto& c, double factor) {
  using S = std::remove_cvref_t<decltype(c.sample_time)>;
  chain(c, factor);
  c.observer_bandwidth = static_cast<S>(20 * factor);
};
const auto controller = [](auto& c, double factor) {
  using S = std::remove_cvref_t<decltype(c.controller_bandwidth)>;
  c.controller_bandwidth = static_cast<S>(4 * factor);
  c.limits.lower = static_cast<S>(-3);
  c.limits.upper = static_cast<S>(3 * factor);
  c.limits.rate = static_cast<S>(100);
};
const auto adrc = [](auto& c, double factor) {
  linear(c.observer, factor);
  controller(c, factor);
  c.missing.most = 5;
  c.start_hold.time = std::remove_cvref_t<decltype(c.start_hold.time)>(0.05);
};

#define ESOKIT_COMPARE(name, fill, ...) \
  namespace now_##name {                \
    using namespace esokit;             \
    using Type = __VA_ARGS__;           \
  }                                     \
  namespace before_##name {             \
    using namespace esokit_before;      \
    using Type = __VA_ARGS__;           \
  }                                     \
  TEST(Bits, name) { compare<now_##name::Type, before_##name::Type>(fill); }

ESOKIT_COMPARE(linear_eso, linear, LinearEso<2>)
ESOKIT_COMPARE(linear_eso_float, linear, LinearEso<1, float, 2>)
ESOKIT_COMPARE(half_gain_eso, linear, HalfGainEso<2>)
ESOKIT_COMPARE(reduced_order_eso, linear, ReducedOrderEso<2>)
const auto cascade = [](auto& c, double factor) {
  linear(c, factor);
  c.bandwidth_factor = std::remove_cvref_t<decltype(c.bandwidth_factor)>(1.5);
};
ESOKIT_COMPARE(cascade_eso, cascade, CascadeEso<2, 3>)
ESOKIT_COMPARE(cascade_eso_float, cascade, CascadeEso<1, 2, float>)
const auto switching = [](auto& c, double factor) {
  linear(c, factor);
  c.bandwidth_ratio = 0.75;
};
ESOKIT_COMPARE(adjustable_bandwidth_eso, switching, AdjustableBandwidthEso<2>)
const auto shaped = [](auto& c, double factor) {
  linear(c, factor);
  c.shape.exponent = 0.5;
  c.shape.linear_width = 0.1;
};
ESOKIT_COMPARE(nonlinear_eso, shaped, NonlinearEso<1, double, 1, FalGain<double>>)
const auto algebraic = [](auto& c, double factor) {
  linear(c, factor);
  c.frequency_shift = 5;
};
ESOKIT_COMPARE(algebraic_eso, algebraic, AlgebraicEso<2>)
const auto riccati = [](auto& c, double factor) {
  chain(c, factor);
  c.measurement_variance = 1e-4;
  c.disturbance_bounds = {0, 0, factor};
  c.inflation = 0.01;
};
ESOKIT_COMPARE(filter, riccati, ExtendedStateFilter<2>)
const auto frozen = [](auto& c, double factor) {
  riccati(c, factor);
  c.mode = decltype(c.mode)::frozen;
  c.outlier_threshold = 20;
};
ESOKIT_COMPARE(frozen_filter, frozen, ExtendedStateFilter<2>)
const auto model = [](auto& c, double factor) {
  linear(c, factor);
  c.model.actuator.time_constant = 0.05;
  c.model.resonators[0].frequency = 20;
};
ESOKIT_COMPARE(model_eso, model, ModelEso<ModelParts{.order = 1, .actuator = 1, .resonators = 1}>)
ESOKIT_COMPARE(model_cascade, cascade, ModelCascadeEso<ModelParts{.order = 2}, 2>)

const auto delayed = [](auto& c, double factor) {
  linear(c.observer, factor);
  c.delay = 3;
};
ESOKIT_COMPARE(delayed_input, delayed, DelayedInput<LinearEso<2>, 4>)
const auto angle = [](auto& c, double factor) {
  linear(c.observer.observer, factor);
  c.observer.threshold = 0.75;
  c.period = 1.5;
};
ESOKIT_COMPARE(wrapped_gate, angle, WrappedOutput<OutlierGate<LinearEso<2>>>)
const auto guarded = [](auto& c, double factor) {
  linear(c.observer, factor);
  c.disturbance_bound = 20;
  c.leak_time = decltype(c.leak_time)(4 * factor);
  c.release_samples = 3;
};
ESOKIT_COMPARE(guarded_linear, guarded, Guarded<LinearEso<2>>)
const auto guarded_cascade_settings = [](auto& c, double factor) {
  guarded(c, factor);
  c.observer.bandwidth_factor = 1.5;
};
ESOKIT_COMPARE(guarded_cascade, guarded_cascade_settings, Guarded<CascadeEso<2, 2>>)
// Without a bound, and with one in the unit of u that is often reached.
const auto leaking = [](auto& c, double factor) {
  guarded(c, factor);
  c.disturbance_bound = 0;
};
ESOKIT_COMPARE(guarded_leaking, leaking, Guarded<LinearEso<1, float>>)
const auto bounded_by_input = [](auto& c, double factor) {
  using S = std::remove_cvref_t<decltype(c.disturbance_bound)>;
  linear(c.observer, factor);
  c.disturbance_bound = static_cast<S>(0.5);
  c.unit = decltype(c.unit)::input;
};
ESOKIT_COMPARE(guarded_by_input, bounded_by_input, Guarded<LinearEso<3>>)
ESOKIT_COMPARE(guarded_slopes, bounded_by_input, Guarded<LinearEso<1, float, 2>>)
const auto guarded_time = [](auto& c, double factor) {
  linear(c.observer.observer, factor);
  c.disturbance_bound = 0.5;
};
ESOKIT_COMPARE(guarded_varying, guarded_time, Guarded<VariableTime<LinearEso<2>>>)
const auto guarded_model = [](auto& c, double factor) {
  bounded_by_input(c, factor);
  c.leak_time = 4;
  c.release_samples = 3;
  c.observer.model.actuator.time_constant = 0.05;
};
ESOKIT_COMPARE(guarded_actuator, guarded_model,
               Guarded<ModelEso<ModelParts{.order = 1, .actuator = 1}>>)
const auto guarded_parts = [](auto& c, double factor) {
  guarded_model(c, factor);
  c.unit = decltype(c.unit)::output;
  c.observer.model.plant = {1.0, 0.5};
  c.observer.model.sensor.time_constant = 0.08;
  c.observer.model.resonators[0].frequency = 40;
  c.observer.model.resonators[0].capture_bandwidth = 8;
};
ESOKIT_COMPARE(guarded_sensor, guarded_parts,
               Guarded<ModelEso<ModelParts{
                   .order = 2, .plant_poles = true, .actuator = 1, .sensor = 1, .resonators = 1}>>)
const auto guarded_sine = [](auto& c, double factor) {
  linear(c.observer, 0.75 * factor);  // so slow that corrections are frozen after a hold
  c.observer.model.resonators[0].frequency = 3;
  c.observer.model.resonators[0].capture_bandwidth = 1.8;
};
ESOKIT_COMPARE(guarded_resonator, guarded_sine,
               Guarded<ModelEso<ModelParts{.order = 2, .resonators = 1}>>)
const auto guarded_angle = [](auto& c, double factor) {
  linear(c.observer.observer.observer, factor);
  c.observer.delay = 2;
  c.observer.observer.period = 1.5;
  c.disturbance_bound = 5;
};
ESOKIT_COMPARE(guarded_delayed_angle, guarded_angle,
               Guarded<DelayedInput<WrappedOutput<LinearEso<2>>, 4>>)
const auto around = [](auto& c, double factor) { linear(c.observer, factor); };
ESOKIT_COMPARE(variable_time, around, VariableTime<LinearEso<2>>)
const auto told = [](auto& c, double factor) {
  linear(c.observer, factor);
  c.inputs[0].gain = -2;
  c.inputs[0].lag = 0.05;
};
ESOKIT_COMPARE(measured, told, Measured<LinearEso<2>, 1, 4>)

ESOKIT_COMPARE(adrc_linear, adrc, Adrc<LinearEso<2>>)
ESOKIT_COMPARE(adrc_softened, adrc, Adrc<LinearEso<3>>)
ESOKIT_COMPARE(adrc_float, adrc, Adrc<LinearEso<1, float>, ErrorBased>)
const auto divided = [](auto& c, double factor) {
  adrc(c, factor);
  c.measurement_divider = 3;
};
ESOKIT_COMPARE(adrc_divided, divided, Adrc<LinearEso<2>>)
const auto in_adrc = [](const auto& observer) {
  return [observer](auto& c, double factor) {
    observer(c.observer, factor);
    controller(c, factor);
    c.missing.most = 5;
  };
};
ESOKIT_COMPARE(adrc_algebraic, in_adrc(algebraic), Adrc<AlgebraicEso<2>>)
ESOKIT_COMPARE(adrc_of_cascade, in_adrc(cascade), Adrc<CascadeEso<2, 2>>)
ESOKIT_COMPARE(adrc_delayed, in_adrc(delayed), Adrc<DelayedInput<LinearEso<2>, 4>>)
ESOKIT_COMPARE(adrc_guarded, in_adrc(guarded), Adrc<Guarded<LinearEso<2>>>)
const auto compensator = [](auto& c, double factor) {
  linear(c.observer, factor);
  c.limits.lower = -3;
  c.limits.upper = 3;
};
ESOKIT_COMPARE(compensating, compensator, DisturbanceCompensator<LinearEso<2>>)
const auto predictive = [](auto& c, double factor) {
  linear(c.observer, factor);
  controller(c, factor);
};
ESOKIT_COMPARE(predictive_adrc, predictive, PredictiveAdrc<LinearEso<2>>)

const auto several = [](auto& c) {
  c.input_matrix(0, 0) = 2;
  c.input_matrix(0, 1) = c.input_matrix(1, 1) = 1;
  c.sample_time = 0.01;
  c.measurement_covariance(0, 0) = 1e-4;
  c.measurement_covariance(1, 1) = 2e-4;
  c.measurement_covariance(0, 1) = c.measurement_covariance(1, 0) = 0.5e-4;
  c.disturbance_bounds = {0, 0, 1, 0, 1};
  c.inflation = 0.01;
  c.max_gap = 20;
};
const auto several_frozen = [](auto& c) {
  several(c);
  c.mode = decltype(c.mode)::frozen;
};
TEST(Bits, several_outputs) {
  compare_mimo<esokit::MimoExtendedStateFilter<esokit::ChainOrders<2, 1>, 2>,
               esokit_before::MimoExtendedStateFilter<esokit_before::ChainOrders<2, 1>, 2>>(
      several);
}
TEST(Bits, several_outputs_frozen) {
  compare_mimo<esokit::MimoExtendedStateFilter<esokit::ChainOrders<2, 1>, 2>,
               esokit_before::MimoExtendedStateFilter<esokit_before::ChainOrders<2, 1>, 2>>(
      several_frozen);
}

}  // namespace oracle_bits
}  // namespace esokit_test
