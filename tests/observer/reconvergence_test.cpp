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
#include <memory>
#include <string>
#include <support/friction.hpp>
#include <support/law_registration.hpp>
#include <support/numbers.hpp>
#include <utility>
#include <vector>

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

/// What the test calls of an observer; a double holds the numbers of every scalar.
class Calls {
 public:
  virtual ~Calls() = default;
  virtual void update(double y, double u) = 0;
  virtual void predict(double u) = 0;
  virtual void correct(double y) = 0;
  virtual void reset(double y) = 0;
  virtual void reset(const std::vector<double>& state) = 0;
  /// False where the time of a step cannot be set.
  virtual bool set_step_time(double time) = 0;
  [[nodiscard]] virtual std::vector<double> estimate() const = 0;
  [[nodiscard]] virtual double total_disturbance() const = 0;
};

template <class Observer>
class Of final : public Calls {
  using S = typename Observer::scalar_type;

 public:
  explicit Of(double x) : observer_(Observer::make(Settings<Observer>::config(x)).value()) {}
  void update(double y, double u) override {
    (void)observer_.update(static_cast<S>(y), static_cast<S>(u));
  }
  void predict(double u) override { (void)observer_.predict(static_cast<S>(u)); }
  void correct(double y) override { (void)observer_.correct(static_cast<S>(y)); }
  void reset(double y) override { (void)observer_.reset(static_cast<S>(y)); }
  void reset(const std::vector<double>& state) override {
    typename Observer::Estimate estimate;
    for (std::size_t r = 0; r < Observer::size; ++r) {
      estimate(static_cast<int>(r)) = static_cast<S>(state[r]);
    }
    (void)observer_.reset(estimate);
  }
  bool set_step_time([[maybe_unused]] double time) override {
    if constexpr (requires { observer_.set_step_time(S(1)); }) {
      return observer_.set_step_time(static_cast<S>(time)).has_value();
    } else {
      return false;
    }
  }
  [[nodiscard]] std::vector<double> estimate() const override {
    const auto estimate = observer_.estimate();
    return {estimate.begin(), estimate.end()};
  }
  [[nodiscard]] double total_disturbance() const override {
    return static_cast<double>(observer_.total_disturbance());
  }

 private:
  Observer observer_;
};

struct Kind {
  std::unique_ptr<Calls> (*make)(double x);
  int order, size;
  double largest, epsilon;  // of the scalar
  bool wraps, sets_time;
};

template <class Observer>
Kind kind_of() {
  using Limits = std::numeric_limits<typename Observer::scalar_type>;
  return {[](double x) -> std::unique_ptr<Calls> {
            return std::unique_ptr<Calls>(new Of<Observer>(x));
          },
          Observer::order, Observer::size, static_cast<double>((Limits::max)()),
          static_cast<double>(Limits::epsilon()),
          requires(const Observer& o){o.wrap(typename Observer::scalar_type(1));
}
, requires(Observer& o) { o.set_step_time(typename Observer::scalar_type(1)); }
};  // namespace observer_reconvergence_test
}  // namespace esokit_test

double anything(const Kind& kind, Random& random) {
  switch (random.index(12)) {
    case 0:
      return hidden_nan<double>();
    case 1:
      return random.index(2) == 0 ? hidden_infinity<double>() : -hidden_infinity<double>();
    case 2:
      return random.index(2) == 0 ? kind.largest : -kind.largest;
    case 3:
      return 0;
    case 4:
    case 5:
    case 6:
      return random.uniform(-10, 10);
    default: {
      const double top = std::log(kind.largest);
      const double size = std::exp(random.uniform(-top, top) * 0.999);
      return random.index(2) == 0 ? size : -size;
    }
  }
}

void feed_garbage(const Kind& kind, Calls& observer, Random& random) {
  const auto any = [&] { return anything(kind, random); };
  const int calls = random.index(30);
  for (int i = 0; i < calls; ++i) {
    switch (random.index(8)) {
      case 0:
        observer.predict(any());
        break;
      case 1:
        observer.correct(any());
        break;
      case 2:
        observer.reset(any());
        break;
      case 3: {
        std::vector<double> state(static_cast<std::size_t>(kind.size));
        for (double& x : state) x = any();
        observer.reset(state);
        break;
      }
      case 4:
        if (kind.sets_time) (void)observer.set_step_time(sample_time * random.uniform(0.5, 2));
        break;
      default: {
        const double y = any();
        observer.update(y, any());
      }
    }
  }
  if (kind.sets_time) {
    ASSERT_TRUE(observer.set_step_time(sample_time));
  }
}

/// An axis at constant speed under a constant u, d = -b0 u: what every observer and model can hold.
void finds_back(const Kind& kind, std::uint64_t seed) {
  Random random(seed);
  const double x = random.uniform(0.25, 2.5);
  const auto observer = kind.make(x);
  const int warm_up = random.index(3) == 0 ? 0 : random.index(40);
  const double u = random.uniform(-3, 3);
  // Of one that does not wrap so slow that it stays near, where float has its digits.
  const double most = kind.wraps ? 0.45 * period : 0.01;
  const double speed = random.uniform(-most, most) / sample_time;
  double y = random.uniform(-period, period);
  // Some with every tenth measurement missing.
  bool lossy = random.index(3) == 0;
  const auto run = [&](int samples) {
    for (int k = 0; k < samples; ++k) {
      y += speed * sample_time;
      if (lossy && random.index(10) == 0) {
        observer->predict(u);
      } else {
        observer->update(kind.wraps ? y - period * std::floor(y / period) : y, u);
      }
    }
  };
  if (warm_up > 0) run(warm_up);
  feed_garbage(kind, *observer, random);
  // What is left of the largest number after e^(-omega_o T) a sample, and of the powers before it.
  const double slowest = std::min(x, 0.25);
  const double decades = std::log(kind.largest) - std::log(kind.epsilon);
  run(60 + static_cast<int>(2 * decades / slowest));
  // A gap longer than max_gap restarts it; what it then has to find are speeds, no large numbers.
  if (std::exchange(lossy, false)) run(60 + static_cast<int>(60 / slowest));
  const auto estimate = observer->estimate();
  for (const double z : estimate) ASSERT_TRUE(is_finite(z)) << seed;
  const double tolerance = 1e4 * kind.epsilon * std::max(period, kind.wraps ? 0 : std::abs(y));
  double error = estimate[0] - y;
  if (kind.wraps) error -= period * std::round(error / period);
  ASSERT_NEAR(error, 0, tolerance) << seed << " omega_o T " << x << " speed " << speed;
  ASSERT_NEAR((estimate[1] - speed) * sample_time, 0, tolerance)
      << seed << " omega_o T " << x << " speed " << speed;
  ASSERT_NEAR((observer->total_disturbance() + 2 * u) * std::pow(sample_time, kind.order), 0,
              tolerance)
      << seed << " omega_o T " << x;
}

constexpr ModelParts with_poles{.order = 2, .plant_poles = true};
template <class S>
using Damped = Friction<1, S>;

// Each observer alone in one scalar and wrapped in the other, each adapter in a nest of each.
#ifdef __FAST_MATH__
// What the flag can break is each type's look at bad numbers.
using Observers = TypeList<
    LinearEso<2, float>, OutlierGate<AlgebraicEso<2, float>>,
    OutlierGate<NonlinearEso<2, double, 1>>, WrappedOutput<OutlierGate<CascadeEso<2, 2>>>,
    DelayedInput<VariableTime<WrappedOutput<OutlierGate<LinearEso<2>>>>, 2>,
    WrappedOutput<AdjustableBandwidthEso<2>>, WrappedOutput<ExtendedStateFilter<2, float>>,
    WrappedOutput<KnownModel<LinearEso<2, float>, Damped<float>>>, ModelEso<with_poles, float>,
    DelayedInput<VariableTime<KnownModel<WrappedOutput<LinearEso<2>>, Damped<double>>>, 2>>;
#else
using Observers = TypeList<
    OutlierGate<LinearEso<2>>, OutlierGate<AlgebraicEso<2, float>>,
    OutlierGate<NonlinearEso<2, double, 1>>, OutlierGate<AdjustableBandwidthEso<2, float>>,
    WrappedOutput<OutlierGate<CascadeEso<2, 2>>>, WrappedOutput<OutlierGate<LinearEso<2, float>>>,
    DelayedInput<VariableTime<WrappedOutput<OutlierGate<LinearEso<2>>>>, 2>, LinearEso<2>,
    LinearEso<2, float>, CascadeEso<2, 3, float>, AlgebraicEso<2, float>, AdjustableBandwidthEso<2>,
    NonlinearEso<2, double, 1>, ExtendedStateFilter<2>, KnownModel<LinearEso<2>, Damped<double>>,
    WrappedOutput<LinearEso<2, float>>, WrappedOutput<LinearEso<3>>,
    WrappedOutput<CascadeEso<2, 3>>, WrappedOutput<AlgebraicEso<2>>,
    WrappedOutput<AdjustableBandwidthEso<2>>, WrappedOutput<NonlinearEso<2, float, 1>>,
    WrappedOutput<ExtendedStateFilter<2, float>>, DelayedInput<WrappedOutput<LinearEso<2>>, 3>,
    WrappedOutput<DelayedInput<LinearEso<2, float>, 3>>,
    VariableTime<WrappedOutput<LinearEso<2, float>>>, WrappedOutput<VariableTime<LinearEso<2>>>,
    KnownModel<WrappedOutput<LinearEso<2>>, Damped<double>>,
    WrappedOutput<KnownModel<LinearEso<2, float>, Damped<float>>>, ModelEso<with_poles, float>,
    WrappedOutput<ModelEso<with_poles>>, WrappedOutput<OutlierGate<ModelCascadeEso<with_poles, 2>>>,
    DelayedInput<VariableTime<KnownModel<WrappedOutput<LinearEso<2>>, Damped<double>>>, 2>>;
#endif

template <class... Each>
bool register_all(TypeList<Each...>) {
  auto add = [index = 0](const std::string& type, const Kind& kind) mutable {
    register_law("Reconvergence/" + std::to_string(index++), type,
                 {"AfterAnyGarbage", [kind] {
                    for (int seed = 1; seed <= long_run(200); ++seed) {
                      finds_back(kind, static_cast<std::uint64_t>(seed));
                      if (testing::Test::HasFatalFailure()) return;
                    }
                  }});
  };
  (add(testing::internal::GetTypeName<Each>(), kind_of<Each>()), ...);
  return true;
}
const bool registered = register_all(Observers{});

}  // namespace observer_reconvergence_test
}  // namespace esokit_test
