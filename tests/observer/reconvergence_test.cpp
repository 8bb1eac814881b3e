// Every observer and every adapter, in their nests, finds back to the truth within a stated number
// of good samples, whatever finite or infinite garbage came before.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <limits>
#include <support/friction.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
namespace observer_reconvergence_test {

using namespace esokit;

constexpr double sample_time = 0.01;
constexpr double period = 6.25;

/// A config with omega_o T = x.
template <class Observer>
struct Settings;

template <int Order, class S, int Extension>
struct Settings<LinearEso<Order, S, Extension>> {
  static typename LinearEso<Order, S, Extension>::Config config(double x) {
    return {.observer_bandwidth = static_cast<S>(x / sample_time),
            .input_gain = S(2),
            .sample_time = static_cast<S>(sample_time)};
  }
};

template <int Order, int Levels, class S>
struct Settings<CascadeEso<Order, Levels, S>> {
  static typename CascadeEso<Order, Levels, S>::Config config(double x) {
    return {.observer_bandwidth = static_cast<S>(x / sample_time),
            .bandwidth_factor = S(1.5),
            .input_gain = S(2),
            .sample_time = static_cast<S>(sample_time)};
  }
};

template <int Order, class S>
struct Settings<AlgebraicEso<Order, S>> {
  static typename AlgebraicEso<Order, S>::Config config(double x) {
    return {.observer_bandwidth = static_cast<S>(x / sample_time),
            .frequency_shift = S(20),
            .input_gain = S(2),
            .sample_time = static_cast<S>(sample_time)};
  }
};

template <int Order, class S>
struct Settings<AdjustableBandwidthEso<Order, S>> {
  static typename AdjustableBandwidthEso<Order, S>::Config config(double x) {
    return {.observer_bandwidth = static_cast<S>(x / sample_time),
            .bandwidth_ratio = S(0.75),
            .input_gain = S(2),
            .sample_time = static_cast<S>(sample_time)};
  }
};

template <int Order, class S>
struct Settings<NonlinearEso<Order, S, 1>> {
  static typename NonlinearEso<Order, S, 1>::Config config(double x) {
    return {.observer_bandwidth = static_cast<S>(x / sample_time),
            .shape = {.gain_alpha = S(0.75), .alpha = S(1), .gain_beta = S(0.25), .beta = S(1)},
            .input_gain = S(2),
            .sample_time = static_cast<S>(sample_time)};
  }
};

template <int Order, class S>
struct Settings<ExtendedStateFilter<Order, S>> {
  static typename ExtendedStateFilter<Order, S>::Config config(double) {
    typename ExtendedStateFilter<Order, S>::Config config;
    config.input_gain = S(2);
    config.sample_time = static_cast<S>(sample_time);
    config.measurement_variance = static_cast<S>(1e-2);
    config.disturbance_bounds[Order] = S(200);
    config.inflation_rule = InflationRule::none;
    return config;
  }
};

template <ModelParts Parts, class S>
struct Settings<ModelEso<Parts, S>> {
  static typename ModelEso<Parts, S>::Config config(double x) {
    return {.observer_bandwidth = static_cast<S>(x / sample_time),
            .input_gain = S(2),
            .sample_time = static_cast<S>(sample_time),
            .model = {.plant = {S(0), static_cast<S>(x)}}};
  }
};

template <ModelParts Parts, int Levels>
struct Settings<ModelCascadeEso<Parts, Levels>> {
  static typename ModelCascadeEso<Parts, Levels>::Config config(double x) {
    return {.observer_bandwidth = x / sample_time,
            .bandwidth_factor = 1.5,
            .input_gain = 2,
            .sample_time = sample_time,
            .model = {.plant = {0, x}}};
  }
};

template <class O>
struct Settings<WrappedOutput<O>> {
  static typename WrappedOutput<O>::Config config(double x) {
    return {.observer = Settings<O>::config(x),
            .period = static_cast<typename O::scalar_type>(period)};
  }
};

template <class O, int Capacity>
struct Settings<DelayedInput<O, Capacity>> {
  static typename DelayedInput<O, Capacity>::Config config(double x) {
    return {.observer = Settings<O>::config(x), .delay = Capacity};
  }
};

template <class O>
struct Settings<OutlierGate<O>> {
  static typename OutlierGate<O>::Config config(double x) {
    using S = typename O::scalar_type;
    return {.observer = Settings<O>::config(x), .threshold = S(0.5), .running_factor = S(5)};
  }
};

template <class O>
struct Settings<VariableTime<O>> {
  static typename VariableTime<O>::Config config(double x) {
    return {.observer = Settings<O>::config(x), .ratio = 2};
  }
};

// Of the angle itself a model cannot be: it jumps.
template <class O>
struct Settings<KnownModel<O, Friction<1, typename O::scalar_type>>> {
  static typename KnownModel<O, Friction<1, typename O::scalar_type>>::Config config(double x) {
    return {.observer = Settings<O>::config(x), .model = {static_cast<typename O::scalar_type>(x)}};
  }
};

template <class S>
S anything(Random& random) {
  constexpr S largest = std::numeric_limits<S>::max();
  switch (random.index(12)) {
    case 0:
      return hidden_nan<S>();
    case 1:
      return random.index(2) == 0 ? hidden_infinity<S>() : -hidden_infinity<S>();
    case 2:
      return random.index(2) == 0 ? largest : -largest;
    case 3:
      return S(0);
    case 4:
    case 5:
    case 6:
      return static_cast<S>(random.uniform(-10, 10));
    default: {
      const double top = std::log(static_cast<double>(largest));
      const double size = std::exp(random.uniform(-top, top) * 0.999);
      return static_cast<S>(random.index(2) == 0 ? size : -size);
    }
  }
}

template <class Observer>
void feed_garbage(Observer& observer, Random& random) {
  using S = typename Observer::scalar_type;
  const int calls = random.index(30);
  for (int i = 0; i < calls; ++i) {
    switch (random.index(8)) {
      case 0:
        (void)observer.predict(anything<S>(random));
        break;
      case 1:
        (void)observer.correct(anything<S>(random));
        break;
      case 2:
        (void)observer.reset(anything<S>(random));
        break;
      case 3: {
        typename Observer::Estimate state;
        for (int r = 0; r < Observer::size; ++r) state(r) = anything<S>(random);
        (void)observer.reset(state);
        break;
      }
      case 4:
        if constexpr (requires { observer.set_step_time(S(1)); }) {
          (void)observer.set_step_time(static_cast<S>(sample_time * random.uniform(0.5, 2)));
        }
        break;
      default:
        (void)observer.update(anything<S>(random), anything<S>(random));
    }
  }
  if constexpr (requires { observer.set_step_time(S(1)); }) {
    ASSERT_TRUE(observer.set_step_time(static_cast<S>(sample_time)).has_value());
  }
}

template <class O>
constexpr bool wraps = requires(const O& o, const typename O::scalar_type& s) {
  o.wrap(s);
};

/// An axis at constant speed under a constant u, d = -b0 u: what every observer and model can hold.
template <class Observer>
void finds_back(std::uint64_t seed) {
  using S = typename Observer::scalar_type;
  Random random(seed);
  const double x = random.uniform(0.25, 2.5);
  auto observer = Observer::make(Settings<Observer>::config(x)).value();
  const int warm_up = random.index(3) == 0 ? 0 : random.index(40);
  const double u = random.uniform(-3, 3);
  // Of one that does not wrap so slow that it stays near, where float has its digits.
  const double most = wraps<Observer> ? 0.45 * period : 0.01;
  const double speed = random.uniform(-most, most) / sample_time;
  double y = random.uniform(-period, period);
  const auto measured = [&] {
    return static_cast<S>(wraps<Observer> ? y - period * std::floor(y / period) : y);
  };
  // Some with every tenth measurement missing.
  const bool lossy = random.index(3) == 0;
  const auto run = [&](int samples) {
    for (int k = 0; k < samples; ++k) {
      y += speed * sample_time;
      if (lossy && random.index(10) == 0) {
        (void)observer.predict(static_cast<S>(u));
      } else {
        (void)observer.update(measured(), static_cast<S>(u));
      }
    }
  };
  if (warm_up > 0) run(warm_up);
  feed_garbage(observer, random);
  // What is left of the largest number after e^(-omega_o T) a sample, and of the powers before it.
  const double slowest = std::min(x, 0.25);
  const double decades = std::log(static_cast<double>(std::numeric_limits<S>::max())) -
                         std::log(static_cast<double>(std::numeric_limits<S>::epsilon()));
  run(60 + static_cast<int>(2 * decades / slowest));
  const auto estimate = observer.estimate();
  for (int r = 0; r < Observer::size; ++r) ASSERT_TRUE(is_finite(estimate(r))) << seed;
  const double tolerance = 1e4 * static_cast<double>(std::numeric_limits<S>::epsilon()) *
                           std::max(period, wraps<Observer> ? 0 : std::abs(y));
  double error = static_cast<double>(estimate(0)) - y;
  if (wraps<Observer>) error -= period * std::round(error / period);
  ASSERT_NEAR(error, 0, tolerance) << seed << " omega_o T " << x << " speed " << speed;
  ASSERT_NEAR((static_cast<double>(estimate(1)) - speed) * sample_time, 0, tolerance)
      << seed << " omega_o T " << x << " speed " << speed;
  const double disturbance = static_cast<double>(observer.total_disturbance());
  ASSERT_NEAR((disturbance + 2 * u) * std::pow(sample_time, Observer::order), 0, tolerance)
      << seed << " omega_o T " << x;
}

template <class Observer>
class Reconvergence : public testing::Test {};

constexpr ModelParts with_poles{.order = 2, .plant_poles = true};
template <class S>
using Damped = Friction<1, S>;

using Observers = testing::Types<
    OutlierGate<LinearEso<2>>, OutlierGate<AlgebraicEso<2, float>>,
    OutlierGate<NonlinearEso<2, double, 1>>, OutlierGate<AdjustableBandwidthEso<2, float>>,
    WrappedOutput<OutlierGate<CascadeEso<2, 2>>>, WrappedOutput<OutlierGate<LinearEso<2, float>>>,
    DelayedInput<VariableTime<WrappedOutput<OutlierGate<LinearEso<2>>>>, 2>, LinearEso<2>,
    LinearEso<2, float>, CascadeEso<2, 3, float>, AlgebraicEso<2, float>, AdjustableBandwidthEso<2>,
    NonlinearEso<2, double, 1>, ExtendedStateFilter<2>, DelayedInput<LinearEso<2>, 3>,
    VariableTime<LinearEso<2>>, KnownModel<LinearEso<2>, Damped<double>>,
    KnownModel<LinearEso<2, float>, Damped<float>>, WrappedOutput<LinearEso<2>>,
    WrappedOutput<LinearEso<2, float>>, WrappedOutput<LinearEso<3>>,
    WrappedOutput<CascadeEso<2, 3>>, WrappedOutput<CascadeEso<2, 2, float>>,
    WrappedOutput<AlgebraicEso<2>>, WrappedOutput<AlgebraicEso<2, float>>,
    WrappedOutput<AdjustableBandwidthEso<2>>, WrappedOutput<AdjustableBandwidthEso<2, float>>,
    WrappedOutput<NonlinearEso<2, double, 1>>, WrappedOutput<NonlinearEso<2, float, 1>>,
    WrappedOutput<ExtendedStateFilter<2>>, WrappedOutput<ExtendedStateFilter<2, float>>,
    DelayedInput<WrappedOutput<LinearEso<2>>, 3>,
    WrappedOutput<DelayedInput<LinearEso<2, float>, 3>>,
    VariableTime<WrappedOutput<LinearEso<2, float>>>, WrappedOutput<VariableTime<LinearEso<2>>>,
    KnownModel<WrappedOutput<LinearEso<2>>, Damped<double>>,
    WrappedOutput<KnownModel<LinearEso<2, float>, Damped<float>>>, ModelEso<with_poles, float>,
    WrappedOutput<ModelEso<with_poles>>, WrappedOutput<OutlierGate<ModelCascadeEso<with_poles, 2>>>,
    DelayedInput<VariableTime<KnownModel<WrappedOutput<LinearEso<2>>, Damped<double>>>, 2>>;
TYPED_TEST_SUITE(Reconvergence, Observers);

TYPED_TEST(Reconvergence, AfterAnyGarbage) {
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(long_run(200)); ++seed) {
    finds_back<TypeParam>(seed);
    if (this->HasFatalFailure()) return;
  }
}

}  // namespace observer_reconvergence_test
}  // namespace esokit_test
