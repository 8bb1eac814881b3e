// Features meet: every adapter in every other, as far as they may be nested, in a controller on a
// plant, with lost samples, guards, retunes and snapshots. Each pair compiles with every consumer
// of an observer; the laws are compiled once.
#include <gtest/gtest.h>

#include <cmath>
#include <control/loop_traits.hpp>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/health.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <support/friction.hpp>
#include <support/settings_law.hpp>

namespace esokit_test {
namespace control_pairs_law_test {

using namespace esokit;

/// A loop with a controller of a type that is forgotten.
class AnyLoop {
 public:
  virtual ~AnyLoop() = default;
  [[nodiscard]] virtual std::unique_ptr<AnyLoop> copy() const = 0;
  virtual double update(double y, double r) = 0;
  virtual bool elapsed(double seconds) = 0;     ///< false: its steps are of one length
  virtual double step(double y, double r) = 0;  ///< update, and nothing else
  virtual void hold(double y, double r, double u) = 0;
  virtual void guard(int what) = 0;  ///< pins, trust, b0; of what has guards
  virtual bool retune(double factor_of_bandwidth) = 0;
  virtual bool restore() = 0;  ///< from a snapshot of itself
  /// Of the analysis; nothing if the type has no linear form.
  [[nodiscard]] virtual std::optional<bool> stable() const = 0;
  [[nodiscard]] virtual LoopMode mode() const = 0;
  [[nodiscard]] virtual bool looked() const = 0;
};

/// @tparam soft whether the law softens
template <class C, bool soft>
class Erased final : public AnyLoop {
  using Observer = std::remove_cvref_t<decltype(std::declval<const C&>().observer())>;
  using Config = typename C::Config;
  using Monitor = HealthMonitor<Observer::size, double>;

 public:
  static Config config(double factor) {
    Config config{};
    if constexpr (requires { config.rest; }) {
      fill(config.controller, factor);
      config.rest = {.error = 5e-4, .time = 0.25};
    } else {
      fill(config, factor);
    }
    if constexpr (soft) config.soften = true;
    return config;
  }
  Erased()
      : controller_(C::make(config(1)).value()),
        monitor_(Monitor::make({.observer_bandwidth = 30,
                                .sample_time = controller_.sample_time(),
                                .input_range = 5.5})
                     .value()) {}

  [[nodiscard]] std::unique_ptr<AnyLoop> copy() const override {
    return std::unique_ptr<AnyLoop>(new Erased(*this));  // make_unique is dear for each type
  }
  double update(double y, double r) override {
    // A compensator helps a controller of the user.
    double given = r;
    if constexpr (requires { controller_.compensation(); }) given = 2.5 * (r - filled(y));
    // A w that never settles, is lost now and then, and does nothing to the plant: once its gain
    // is zero again, d is what it was.
    if constexpr (requires { controller_.measured(1.0); }) {
      if (++measured_ % 7 != 0)
        controller_.measured(measured_ < 1200 ? std::sin(0.1 * measured_) : 0.0);
    }
    const double u = controller_.update(y, given);
    monitor_.look(controller_);
    return u;
  }
  bool elapsed([[maybe_unused]] double seconds) override {
    if constexpr (requires { controller_.elapsed(seconds); }) {
      EXPECT_TRUE(controller_.elapsed(seconds).has_value());
      return true;
    }
    return false;
  }
  double step(double y, double r) override { return controller_.update(y, r); }
  void hold(double y, double r, double u) override {
    if constexpr (requires { controller_.hold(y, r, u); }) {
      controller_.hold(y, r, u);
    } else if constexpr (requires { controller_.hold(y, u); }) {
      controller_.hold(y, u);
    }
  }
  void guard([[maybe_unused]] int what) override {
    if constexpr (requires { controller_.observer().set_pin(Pin::free); }) {
      auto& o = controller_.observer();
      if (what < 4) o.set_pin(static_cast<Pin>(what));
      if (what == 4) o.set_trust(0.5);
      EXPECT_TRUE(what != 5 || o.set_input_gain(1.25 * o.input_gain()).has_value());
      if (what > 5) {
        o.set_pin(Pin::free);
        o.set_trust(1);
        EXPECT_TRUE(o.set_input_gain(o.input_gain()).has_value());
      }
    }
  }
  bool retune(double factor) override { return controller_.retune(config(factor)).has_value(); }
  bool restore() override {
    const auto words = snapshot(controller_);
    const auto again = from_snapshot<C>(words);
    if (again) controller_ = *again;
    return again.has_value();
  }
  [[nodiscard]] std::optional<bool> stable() const override {
    const auto plant = LinearPlant<1>::chain({.input_gain = 2}).value();
    if constexpr (requires { linear_controller(controller_); }) {
      return closed_loop(plant, controller_)->stable();
    } else {
      return std::nullopt;
    }
  }
  [[nodiscard]] LoopMode mode() const override { return controller_.mode(); }
  [[nodiscard]] bool looked() const override { return monitor_.health().samples > 0; }

 private:
  template <class Settings>
  static void fill(Settings& config, double factor) {
    settings::fill(config);
    config.start_hold = {};
    config.missing = {};
    if constexpr (requires { config.observer.leak_time; }) config.observer.leak_time = 0;
    if constexpr (requires { config.observer.observer.leak_time; })
      config.observer.observer.leak_time = 0;
    if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth *= factor;
    chain_config<Observer>(config.observer).observer_bandwidth *= factor;
  }
  double filled(double y) {
    if (is_finite(y)) last_ = y;
    return last_;
  }

  C controller_;
  Monitor monitor_;
  double last_ = 0;
  int measured_ = 0;
};

/// y' = 2 u + d in the loop, for so many samples; `each` may do something before a sample. The
/// tail of what y was.
struct Course {
  double error = 0;    ///< largest at the end
  double largest = 0;  ///< abs(y)
  std::vector<double> u;
};
constexpr double sample_time = 0.0078125;
using Each = std::function<void(AnyLoop&, int k, double& y)>;
Course run(AnyLoop& loop, const Each& each, int samples = 2000) {
  ChainPlant plant(1, sample_time, 2, 1.5);
  Course course;
  for (int k = 0; k < samples; ++k) {
    const double out = plant.output();
    double y = out;
    each(loop, k, y);
    const double u = loop.update(y, 0.5);
    EXPECT_TRUE(u >= -3 && u <= 2.5) << k;
    course.u.push_back(u);
    plant.step(u);
    course.largest = std::max(course.largest, std::abs(out));
    if (k >= samples - 100) course.error = std::max(course.error, std::abs(out - 0.5));
  }
  return course;
}

void obeys_the_laws(const AnyLoop& fresh) {
  constexpr double rest = 1e-3;
  const auto nothing = [](AnyLoop&, int, double&) {};
  const auto after = [&](const Each& each, int samples = 2000) {
    const auto loop = fresh.copy();
    return run(*loop, each, samples);
  };
  // It settles; a retune to its own settings and a snapshot of itself change nothing.
  const Course plain = after(nothing);
  EXPECT_LT(plain.error, rest);
  EXPECT_LT(plain.largest, 1);
  const auto same = [&](const Each& each) { return after(each).u == plain.u; };
  EXPECT_TRUE(same([](AnyLoop& loop, int k, double&) { EXPECT_TRUE(k != 120 || loop.retune(1)); }))
      << "a retune to its own settings";
  EXPECT_TRUE(same([](AnyLoop& loop, int k, double&) { EXPECT_TRUE(k != 120 || loop.restore()); }))
      << "a snapshot";
  EXPECT_TRUE(same([](AnyLoop& loop, int k, double&) {
    if (k == 120 && loop.elapsed(0)) {
      const double u = loop.step(70, -7);
      EXPECT_EQ(loop.step(-80, 8), u);
      loop.elapsed(sample_time);
    }
  })) << "no time";

  // What is lost, false, guarded, held and retuned, alone and together, in any order; then it
  // settles.
  for (int kinds = 1; kinds < 16; ++kinds) {
    SCOPED_TRACE("kinds " + std::to_string(kinds));
    Random random(static_cast<std::uint64_t>(kinds));
    int lost = 0;
    const Course course = after(
        [&](AnyLoop& loop, int k, double& y) {
          if (k >= 1200) {
            if (k == 1200) {
              loop.guard(9);
              EXPECT_TRUE(loop.retune(1));
            }
            return;
          }
          if (lost > 0 || ((kinds & 1) != 0 && random.index(10) == 0)) {
            lost = lost > 0 ? lost - 1 : random.index(20);
            y = hidden_nan<double>();
          }
          if ((kinds & 2) != 0 && random.index(20) == 0) loop.guard(random.index(8));
          if ((kinds & 4) != 0 && random.index(30) == 0) {
            EXPECT_TRUE(loop.retune(random.uniform(0.8, 1.2)));
          }
          if ((kinds & 8) != 0 && random.index(20) == 0) loop.hold(y, 0.5, 0.25);
        },
        3600);
    EXPECT_LT(course.error, rest);
  }
  const auto loop = fresh.copy();
  run(*loop, nothing, 10);
  EXPECT_EQ(loop->mode(), LoopMode::running);
  EXPECT_TRUE(loop->looked());
}

template <class Observer, class Controller = Adrc<Observer>, bool soft = false>
void obeys() {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  const Erased<Controller, soft> loop;
  obeys_the_laws(loop);
  // All that is linear has a linear form; what knows a function of the user has none.
  const bool linear =
      testing::internal::GetTypeName<Observer>().find("Friction") == std::string::npos;
  if (!std::is_same_v<Controller, DisturbanceCompensator<Observer>>) {
    EXPECT_EQ(loop.stable(), linear ? std::optional(true) : std::nullopt);
  }
}

template <class O>
using Delayed = DelayedInput<O, 4>;
template <class O>
using Told = Measured<O, 1, 4>;
template <class O>
using Known = KnownModel<O, Friction<0, double>>;
template <class O>
using Mapped = MappedInput<O, 3>;
using Plain = LinearEso<1>;

/// What goes into every adapter.
template <template <class> class Outer>
void around_all() {
  obeys<Outer<Plain>>();
  obeys<Outer<OutlierGate<Plain>>>();
  obeys<Outer<VariableTime<Plain>>>();
}

// The pairs that are left out are refused: by a static_assert, see tests/first_errors, or here.
static_assert(!ShiftableOutput<WrappedOutput<Plain>>);

template <class Observer>
void obeys_around() {
  obeys<Observer, DisturbanceCompensator<Observer>>();
}

TEST(Pairs, OfACompensator) {
  obeys_around<Delayed<Plain>>();
  obeys_around<OutlierGate<Plain>>();
  obeys_around<VariableTime<Plain>>();
  obeys_around<Known<Plain>>();
  obeys_around<WrappedOutput<Plain>>();
  obeys_around<Guarded<Plain>>();
}

template <class Observer>
void obeys_at_rest() {
  obeys<Observer, Resting<Adrc<Observer>>>();
}

TEST(Pairs, OfRest) {
  obeys_at_rest<Delayed<Plain>>();
  obeys_at_rest<OutlierGate<Plain>>();
  obeys_at_rest<VariableTime<Plain>>();
  obeys_at_rest<WrappedOutput<Plain>>();
  obeys_at_rest<Guarded<Plain>>();
  obeys_at_rest<Told<Plain>>();
}

TEST(Pairs, OfDelayedInput) {
  around_all<Delayed>();
  obeys<Delayed<Delayed<Plain>>>();
  obeys<Delayed<Known<Plain>>>();
  obeys<Delayed<WrappedOutput<Plain>>>();
}
TEST(Pairs, OfOutlierGate) {
  around_all<OutlierGate>();
  obeys<OutlierGate<Delayed<Plain>>>();
  obeys<OutlierGate<Known<Plain>>>();
}
TEST(Pairs, OfVariableTime) {
  around_all<VariableTime>();
  obeys<VariableTime<Delayed<Plain>>>();
  obeys<VariableTime<Known<Plain>>>();
  obeys<VariableTime<WrappedOutput<Plain>>>();
}
TEST(Pairs, OfKnownModel) {
  around_all<Known>();
  obeys<Known<Known<Plain>>>();
  obeys<Known<WrappedOutput<Plain>>>();
}
TEST(Pairs, OfWrappedOutput) {
  around_all<WrappedOutput>();
  obeys<WrappedOutput<Delayed<Plain>>>();
  obeys<WrappedOutput<Known<Plain>>>();
}
TEST(Pairs, OfMeasured) {
  around_all<Told>();
  obeys<Told<Told<Plain>>>();
  obeys<Told<Delayed<Plain>>>();
  obeys<Told<Known<Plain>>>();
  obeys<Told<WrappedOutput<Plain>>>();
  obeys<Delayed<Told<Plain>>>();
  obeys<OutlierGate<Told<Plain>>>();
  obeys<Known<Told<Plain>>>();
  obeys<WrappedOutput<Told<Plain>>>();
  obeys<Guarded<Told<Plain>>>();
  obeys_around<Told<Plain>>();
}
TEST(Pairs, OfMappedInput) {
  around_all<Mapped>();
  obeys<Mapped<Delayed<Plain>>>();
  obeys<Mapped<Known<Plain>>>();
  obeys<Mapped<WrappedOutput<Plain>>>();
  obeys<Mapped<Told<Plain>>>();
  obeys<Mapped<Guarded<Plain>>>();
  obeys_around<Mapped<Plain>>();
  obeys_at_rest<Mapped<Plain>>();
}
template <class Observer>
void obeys_softly() {
  obeys<Observer, Adrc<Observer>, true>();
}
TEST(Pairs, OfALawThatSoftens) {
  obeys_softly<Delayed<Plain>>();
  obeys_softly<VariableTime<Plain>>();
  obeys_softly<WrappedOutput<Plain>>();
  obeys_softly<Mapped<Plain>>();
  obeys_softly<Mapped<Guarded<Plain>>>();
}
TEST(Pairs, OfGuarded) {
  around_all<Guarded>();
  obeys<Guarded<Delayed<Plain>>>();
  obeys<Guarded<WrappedOutput<Plain>>>();
}

}  // namespace control_pairs_law_test
}  // namespace esokit_test
