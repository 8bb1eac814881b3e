// A loop around every adapter is back at its reference, at rest, whatever garbage the sensor, the
// report of the actuator and the operator gave it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <control/loop_traits.hpp>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <limits>
#include <memory>
#include <support/friction.hpp>
#include <support/numbers.hpp>

namespace esokit_test {
namespace control_reconvergence_test {

using namespace esokit;

constexpr double sample_time = 0.01;
constexpr double turn = 6.25;

template <class S, class Config>
void set(Config& config, double omega_T) {
  if constexpr (requires { config.period; }) config.period = S(turn);
  if constexpr (requires { config.threshold; }) config.threshold = S(0.5);
  if constexpr (requires { config.observer; }) {
    set<S>(config.observer, omega_T);
  } else {
    fill_settings<S>(config, omega_T / sample_time, sample_time, 1);
  }
}

/// A loop of any type, so that what plays it is compiled once. Numbers are double.
class Loop {
 public:
  virtual ~Loop() = default;
  virtual double update(double y, double r) = 0;
  virtual void applied(double u) = 0;
  virtual double track(double y, double r, double u_applied) = 0;
  virtual void start(double y, double u) = 0;
  /// Guards of any kind, where there are some, and none of them.
  virtual void guard(Random& random) = 0;
  virtual void unguard() = 0;
  [[nodiscard]] virtual double output() const = 0;
  [[nodiscard]] virtual bool undisturbed() const = 0;

  bool single = false;  ///< computes in float
  bool wraps = false;   ///< an angle
  [[nodiscard]] double any(Random& random) const {
    return single ? static_cast<double>(anything<float>(random)) : anything<double>(random);
  }
};

template <class Controller>
class LoopOf final : public Loop {
  using S = typename Controller::scalar_type;
  static constexpr bool guarded = requires(Controller & c) { c.observer().set_trust(S(0)); };

 public:
  explicit LoopOf(double omega_T) : c_(Controller::make(config(omega_T)).value()) {
    single = std::is_same_v<S, float>;
    wraps = requires { c_.observer().wrap(S(0)); };
  }
  double update(double y, double r) override { return static_cast<double>(c_.update(s(y), s(r))); }
  void applied(double u) override { c_.applied(s(u)); }
  double track(double y, double r, double u) override {
    return static_cast<double>(c_.track(s(y), s(r), s(u)));
  }
  void start(double y, double u) override { (void)c_.start(s(y), s(u)); }
  void guard([[maybe_unused]] Random& random) override {
    if constexpr (guarded) {
      c_.observer().set_trust(anything<S>(random));
      c_.observer().set_pin(static_cast<Pin>(random.index(4)));
      (void)c_.set_input_gain(anything<S>(random));
      if (random.index(4) == 0) {
        (void)c_.hold(anything<S>(random), anything<S>(random), anything<S>(random));
      }
    }
  }
  void unguard() override {
    if constexpr (guarded) {
      c_.observer().set_trust(S(1));
      c_.observer().set_pin(Pin::free);
      EXPECT_TRUE(c_.set_input_gain(S(1)).has_value());
    }
  }
  [[nodiscard]] double output() const override { return static_cast<double>(c_.output()); }
  [[nodiscard]] bool undisturbed() const override {
    return c_.mode() == LoopMode::running && c_.status() == StepStatus::ok;
  }

 private:
  static S s(double x) { return static_cast<S>(x); }
  static typename Controller::Config config(double omega_T) {
    typename Controller::Config config{.controller_bandwidth = S(4),
                                       .limits = {.lower = S(-2), .upper = S(2)}};
    set<S>(config.observer, omega_T);
    return config;
  }

  Controller c_;
};

using Make = std::unique_ptr<Loop> (*)(double omega_T);

void back_at_the_reference(Make make) {
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(long_run(100)); ++seed) {
    Random random(seed);
    const auto loop = make(random.uniform(0.7, 3));
    ChainPlant plant(2, sample_time, 1, random.uniform(-1, 1));
    const double r = random.uniform(-3, 3);
    const auto angle = [&] {
      const double y = plant.output();
      return loop->wraps ? y - turn * std::floor(y / turn) : y;
    };
    const auto any = [&] { return loop->any(random); };
    for (int k = random.index(200); k > 0; --k) plant.step(loop->update(angle(), r));
    for (int k = random.index(30); k > 0; --k) {
      double u = 0;
      loop->guard(random);
      switch (random.index(6)) {
        case 0:
          loop->start(any(), any());
          u = loop->output();
          break;
        case 1:
          u = loop->track(any(), any(), any());
          break;
        case 2:
          loop->applied(any());
          u = loop->update(angle(), r);
          break;
        default:
          u = loop->update(any(), any());
      }
      ASSERT_TRUE(std::isfinite(u)) << seed;
      // What the actuator cannot hold it does not.
      plant.step(std::clamp(u, -2.0, 2.0));
    }
    loop->unguard();
    // While the observer finds back a saturated u carries the plant away, and that far it has to
    // come back; an angle only has to stop.
    for (int k = 0; k < (loop->wraps ? 12000 : 60000); ++k) {
      const double u = loop->update(angle(), r);
      ASSERT_LE(std::abs(u), 2) << seed;
      plant.step(u);
    }
    const double off = plant.output() - r;
    const double tolerance =
        1e4 * (loop->single ? static_cast<double>(std::numeric_limits<float>::epsilon())
                            : std::numeric_limits<double>::epsilon());
    ASSERT_NEAR(loop->wraps ? off - turn * std::round(off / turn) : off, 0, tolerance) << seed;
    ASSERT_NEAR(plant.state()[1], 0, 10 * tolerance) << seed;
    ASSERT_TRUE(loop->undisturbed()) << seed;
  }
}

template <class... Controllers>
void each_is_back_at_the_reference() {
  const auto one = []<class C>(LoopOf<C>*) {
    SCOPED_TRACE(testing::internal::GetTypeName<C>());
    back_at_the_reference([](double omega_T) -> std::unique_ptr<Loop> {
      return std::unique_ptr<Loop>(new LoopOf<C>(omega_T));
    });
  };
  (one(static_cast<LoopOf<Controllers>*>(nullptr)), ...);
}

TEST(LoopReconvergence, BackAtTheReference) {
  each_is_back_at_the_reference<
      Adrc<LinearEso<2, float>, ErrorBased>, Adrc<WrappedOutput<LinearEso<2, float>>>,
      Adrc<WrappedOutput<CascadeEso<2, 2>>>, Adrc<DelayedInput<WrappedOutput<LinearEso<2>>, 2>>,
      Adrc<WrappedOutput<OutlierGate<LinearEso<2>>>, ErrorBased>,
      Adrc<VariableTime<WrappedOutput<LinearEso<2>>>>,
      Adrc<KnownModel<WrappedOutput<LinearEso<2>>, Friction<1, double>>>,
      Adrc<Guarded<LinearEso<2>>>,
      Adrc<WrappedOutput<ModelEso<ModelParts{.order = 2, .plant_poles = true}>>>>();
}

}  // namespace control_reconvergence_test
}  // namespace esokit_test
