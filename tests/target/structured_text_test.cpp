// The Structured Text that to_structured_text writes equals the C++ bit for bit in an interpreter
// of its subset (structured_text.py): outputs, estimates, status and mode, with bad and missing
// samples, gaps, reported u and starts.
#include <cmath>
#include <cstdio>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/known_model.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/follow_profile.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/target/health_code.hpp>
#include <esokit/target/profile_code.hpp>
#include <esokit/target/structured_text.hpp>
#include <esokit/target/time_proportioned_code.hpp>
#include <limits>
#include <target/written.hpp>

namespace esokit_test {
namespace target_structured_text_test {

#ifdef ESOKIT_LOADS_C

using namespace esokit;

/// Lines of samples for the interpreter.
class Samples {
 public:
  explicit Samples(const std::string& names) : text_(names + "\n") {}

  template <class V>
  Samples& number(V x) {
    char digits[60];
    std::snprintf(digits, sizeof digits, "%a ", static_cast<double>(x));
    text_ += digits;
    return *this;
  }
  Samples& count(unsigned x) {
    text_ += std::to_string(x) + " ";
    return *this;
  }
  Samples& word(const std::string& name) {
    text_ += name + " ";
    return *this;
  }
  template <class Observer>
  void estimates(const Observer& observer) {
    detail::unroll<Observer::size>([&](auto row) { number(observer.template estimate<row>()); });
    text_ += "\n";
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string estimate_names(int size) {
  std::string names;
  for (int i = 0; i < size; ++i) names += " e" + std::to_string(i);
  return names;
}

/// Runs both in the interpreter.
void interprets(const std::string& block, const Samples& samples) {
  const Folder folder;
  folder.write("block.st", block);
  folder.write("samples", samples.text());
  const std::string script = ESOKIT_STRUCTURED_TEXT_INTERPRETER;
  EXPECT_TRUE(runs("python3 '" + script + "' " + folder.file("block.st") + " " +
                   folder.file("samples") + " >/dev/null"));
}

const int samples_each = static_cast<int>(asked("ESOKIT_WRITTEN_SAMPLES", 1500));

template <class V>
V odd(Random& random, V usual) {
  if (random.index(40) == 0) return hidden_nan<V>();
  return random.index(40) == 0 ? anything<V>(random) : usual;
}

/// What a block has beside y and u: told to both, sample by sample.
template <class Object, class Observer>
class Told {
 public:
  using V = typename Observer::scalar_type;
  static constexpr bool guarded = requires(Observer & o) { o.set_trust(V()); };
  static constexpr bool measured = measured_inputs<Object>() > 0;
  static constexpr bool several = measured_inputs<Object>() > 1;

  Told(double gain, bool takes_gain) : gain_(gain), b0_(V(gain)), takes_gain_(takes_gain) {}
  [[nodiscard]] std::string names() const {
    return std::string(guarded ? "trust pin " : "") + (guarded && takes_gain_ ? "b0 " : "") +
           (several    ? "w1 w2 no_w "
            : measured ? "w no_w "
                       : "");
  }
  template <class Seen>
  void tell(Object& object, Seen& observer, Samples& samples, Random& random) {
    if constexpr (guarded) {
      if (random.index(30) == 0) trust_ = static_cast<V>(random.uniform(0.1, 1.5));
      if (random.index(40) == 0) pin_ = random.index(2) == 0 ? 0 : random.index(4);
      const V trust = odd(random, trust_);
      observer.set_trust(trust);
      observer.set_pin(static_cast<Pin>(pin_));
      samples.number(trust).count(static_cast<unsigned>(pin_));
      if (takes_gain_) {
        V b0 = b0_;
        if (random.index(50) == 0) {
          b0 = odd(random, static_cast<V>(gain_ * random.uniform(-0.2, 1.5)));
          if (object.set_input_gain(b0)) b0_ = b0;
        }
        samples.number(b0);
      }
    }
    if constexpr (measured) {
      lost_ = lost_ > 0 ? lost_ - 1 : random.index(50) == 0 ? random.index(14) : 0;
      const auto w = [&] { return odd(random, static_cast<V>(random.uniform(-1, 1))); };
      if constexpr (several) {
        const Vector<V, 2> both{{w(), w()}};
        if (lost_ == 0) object.measured(both);
        samples.number(both(0)).number(both(1)).count(lost_ > 0);
      } else {
        const V one = w();
        if (lost_ == 0) object.measured(one);
        samples.number(one).count(lost_ > 0);
      }
    }
  }

 private:
  double gain_;
  V b0_, trust_ = V(1);
  bool takes_gain_;
  int pin_ = 0, lost_ = 0;
};

template <class C>
using ObserverOf = typename detail::ObserverOfController<C>::type;

template <class C, class Change>
void controls_changed(std::uint64_t seed, const Change& change) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  using Observer = ObserverOf<C>;
  for (const double gain : {8.0, -8.0}) {
    auto settings = config<C>(gain);
    change(settings);
    C controller = C::make(settings).value();
    const auto block = to_structured_text(controller, {.name = "loop"}).value();
    Told<C, Observer> told(gain, block.find("loop_set_input_gain") != std::string::npos);
    constexpr bool guarded = Told<C, Observer>::guarded;
    Samples samples(told.names() + "y no_y r u_held starts reports " + (guarded ? "holds " : "") +
                    ": u status mode start_status report_status" + estimate_names(Observer::size));
    ChainPlant plant(C::order, 0.0078125, gain, 1.5);
    Random random(seed++ + asked("ESOKIT_WRITTEN_SEED", 0));
    V r(1);
    int lost = 0;
    int odd_ones = 0;
    unsigned start_status = 0;
    for (int k = 0; k < samples_each; ++k) {
      plant.step(static_cast<double>(controller.output()));
      if (random.index(60) == 0) r = static_cast<V>(random.uniform(-2, 2));
      if (lost > 0) --lost;
      if (random.index(100) == 0) lost = 1 + random.index(14);
      V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
      if constexpr (observer_traits<Observer>.wraps_output) y = std::remainder(y, V(2.5));
      y = odd(random, y);
      V given = r;
      if constexpr (is_compensator<C>) given = (r - y) / static_cast<V>(gain);
      given = odd(random, given);
      const V held = odd(random, static_cast<V>(random.uniform(-1, 1)));
      const bool starts = random.index(80) == 0;
      const bool reports = random.index(30) == 0;
      const bool holds = random.index(20) == 0;
      auto& observer = controller.observer();
      // Before all else, as the block does; w after a start.
      if constexpr (guarded) told.tell(controller, observer, samples, random);
      if (starts) start_status = static_cast<unsigned>(controller.start(y, held));
      const auto report_status = reports ? static_cast<unsigned>(controller.applied(held)) : 0u;
      if constexpr (!guarded) told.tell(controller, observer, samples, random);
      bool done = false;
      V u{};
      if constexpr (guarded) {
        done = holds;
        if (holds) u = controller.hold(y, given, held);
      }
      if (done) {
      } else if (lost > 0) {
        u = controller.update_without_measurement(given);
      } else {
        u = controller.update(y, given);
      }
      samples.number(y).count(lost > 0).number(given).number(held).count(starts).count(reports);
      if (guarded) samples.count(holds);
      samples.number(u)
          .count(static_cast<unsigned>(controller.status()))
          .count(static_cast<unsigned>(controller.mode()))
          .count(start_status)
          .count(report_status)
          .estimates(controller.observer());
      odd_ones += controller.status() != StepStatus::ok;
    }
    EXPECT_GT(odd_ones, samples_each / (30 * of_controller(settings).measurement_divider));
    interprets(block, samples);
  }
}

template <class C>
void controls(std::uint64_t seed, int divider = 1) {
  controls_changed<C>(
      seed, [divider](auto& settings) { of_controller(settings).measurement_divider = divider; });
}

template <class Observer>
void observes_in_text(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using V = typename Observer::scalar_type;
  for (const double gain : {8.0, -8.0}) {
    auto observer = Observer::make(observer_config<Observer>(gain)).value();
    const auto block = to_structured_text(observer, {.name = "eso"}).value();
    Told<Observer, Observer> told(gain, true);
    constexpr bool guarded = Told<Observer, Observer>::guarded;
    Samples samples(told.names() + "y no_y u resets " + (guarded ? "holds " : "") + ": status" +
                    (guarded ? " u_to_give" : "") + estimate_names(Observer::size));
    Random random(seed++ + asked("ESOKIT_WRITTEN_SEED", 0));
    V to_give(0);
    for (int k = 0; k < samples_each; ++k) {
      const V y = odd(random, static_cast<V>(random.uniform(-1, 1)));
      const V u = odd(random, static_cast<V>(random.uniform(-1, 1)));
      const bool lost = random.index(6) == 0;
      const bool resets = random.index(50) == 0;
      const bool holds = random.index(10) == 0;
      told.tell(observer, observer, samples, random);
      if constexpr (guarded) {
        if (holds) {
          to_give = observer.hold(u);
        } else {
          observer.release();
        }
      }
      const StepStatus status = resets ? observer.reset(y)
                                : lost ? observer.predict(u)
                                       : observer.update(y, u);
      samples.number(y).count(lost).number(u).count(resets);
      if (guarded) samples.count(holds);
      samples.count(static_cast<unsigned>(status));
      if (guarded) samples.number(to_give);
      samples.estimates(observer);
    }
    interprets(block, samples);
  }
}

TEST(StructuredText, OfControllers) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  controls<Adrc<LinearEso<2, double>>>(1);
  controls<Adrc<LinearEso<2, float>>>(11);
#ifndef ESOKIT_ONE_TYPE
  controls<Adrc<LinearEso<3, double>>>(21);  // it softens
  controls<Adrc<LinearEso<1, float>, ErrorBased>>(31, 3);
  controls<Adrc<DelayedInput<ModelEso<lag, float>, 4>>>(41);
  controls<Adrc<OutlierGate<LinearEso<2, float>>>>(51);
  controls<Resting<Adrc<LinearEso<2, float>>>>(55);
  controls<DisturbanceCompensator<AdjustableBandwidthEso<1, double>>>(61);
#endif
}

/// A reference that moves: r, r1, r2.
template <class C>
void moves(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  C controller = C::make(config<C>(8)).value();
  const auto block =
      to_structured_text(controller, {.name = "loop", .moving_reference = true}).value();
  Samples samples("y no_y r r1 r2 u_held starts reports : u status" +
                  estimate_names(ObserverOf<C>::size));
  ChainPlant plant(C::order, 0.0078125, 8, 1.5);
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  for (int k = 0; k < samples_each; ++k) {
    plant.step(static_cast<double>(controller.output()));
    V y = static_cast<V>(plant.output());
    if constexpr (observer_traits<ObserverOf<C>>.wraps_output) y = std::remainder(y, V(2.5));
    y = odd(random, y);
    Vector<V, 3> r{};
    for (int i = 0; i < 3; ++i) {
      r(i) = odd(random, static_cast<V>(std::pow(0.5, i) * std::sin(0.004 * k + 1.6 * i)));
      if (k % 200 < 100) r(i) = odd(random, V(0));
    }
    const bool lost = random.index(12) == 0;
    const V u = lost ? controller.update_without_measurement(r) : controller.update(y, r);
    samples.number(y).count(lost).number(r(0)).number(r(1)).number(r(2)).number(V(0));
    samples.count(0).count(0).number(u).count(static_cast<unsigned>(controller.status()));
    samples.estimates(controller.observer());
  }
  interprets(block, samples);
}

TEST(StructuredText, OfAReferenceThatMoves) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  moves<Adrc<LinearEso<2, double>>>(701);
#ifndef ESOKIT_ONE_TYPE
  moves<Adrc<WrappedOutput<LinearEso<2, float>>>>(711);
  moves<Resting<Adrc<WrappedOutput<LinearEso<2, double>>>>>(721);
#endif
  const auto block = to_structured_text(
      PredictiveAdrc<LinearEso<2>>::make(
          {.observer = observer_config<LinearEso<2>>(8), .controller_bandwidth = 4})
          .value(),
      {.name = "loop", .moving_reference = true});
  ASSERT_TRUE(block);
  EXPECT_NE(block->find("loop_prepare(o := o, next_r := next_r, next_r1 := next_r1, next_r2 := "
                        "next_r2)"),
            std::string::npos);
}

TEST(StructuredText, OfObservers) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  observes_in_text<CascadeEso<1, 2, double>>(71);
#ifndef ESOKIT_ONE_TYPE
  observes_in_text<DelayedInput<LinearEso<1, float>, 4>>(81);
  observes_in_text<AdjustableBandwidthEso<1, float>>(91);
  observes_in_text<OutlierGate<LinearEso<1, double>>>(101);
#endif
}

#ifndef ESOKIT_ONE_TYPE

TEST(StructuredText, OfGainsThatGoOn) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  controls<Adrc<ExtendedStateFilter<2, float>>>(201);
  observes_in_text<ExtendedStateFilter<1, double>>(211);
  controls_changed<Adrc<ExtendedStateFilter<1, float>>>(221, [](auto& settings) {
    innermost(settings).mode = RiccatiMode::frozen;
    innermost(settings).outlier_threshold = 9;
  });
  controls<Adrc<AlgebraicEso<2, double>>>(231);
  observes_in_text<AlgebraicEso<1, float>>(241);
  controls_changed<Adrc<AlgebraicEso<1, float>, ErrorBased>>(251, [](auto& settings) {
    innermost(settings).frequency_shift = {};  // it never settles, and publishes late
    innermost(settings).blanking = 0.25F;
    innermost(settings).start_index = 2;
  });
}

template <class V>
struct Pendulum {
  template <class E>
  auto operator()(const E& x) const noexcept {
    using std::sin;
    return V(-3) * sin(x(0)) - V(0.2) * x(1);
  }
};
template <class V>
struct Slope {
  template <class E>
  auto operator()(const E& x) const noexcept {
    return select(x(0) > 0, V(0.3) * x(0), V(-0.2) * x(0));
  }
};

TEST(StructuredText, OfAdapters) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  controls<Adrc<WrappedOutput<LinearEso<2, double>>>>(301);
  controls<Adrc<DelayedInput<WrappedOutput<LinearEso<1, float>>, 3>, ErrorBased>>(311);
  observes_in_text<WrappedOutput<CascadeEso<1, 2, float>>>(321);
  controls<Adrc<Measured<OutlierGate<LinearEso<1, double>>, 1, 4>>>(331);
  controls<Adrc<WrappedOutput<Measured<LinearEso<2, float>, 1, 4>>>>(341);
  observes_in_text<Measured<CascadeEso<1, 2, float>, 1, 4>>(351);
  controls<Adrc<Measured<LinearEso<2, double>, 2, 4>>>(361);
  controls<Adrc<KnownModel<LinearEso<2, double>, Pendulum<double>>>>(371);
  controls<Adrc<KnownModel<WrappedOutput<LinearEso<1, float>>, Slope<float>>>>(381);
}

TEST(StructuredText, OfTheCurveOfAnActuator) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  controls<Adrc<MappedInput<LinearEso<2, float>>>>(391);
  controls<Adrc<MappedInput<LinearEso<3, double>>>>(395);  // it softens
  controls<DisturbanceCompensator<MappedInput<DelayedInput<LinearEso<1, double>, 3>>>>(392);
  controls<Adrc<MappedInput<Guarded<LinearEso<1, double>>>, ErrorBased>>(393);
  observes_in_text<MappedInput<Guarded<LinearEso<2, float>>>>(394);
}

TEST(StructuredText, OfGuards) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  controls<Adrc<Guarded<LinearEso<2, double>>>>(401);
  controls<Adrc<Guarded<DelayedInput<WrappedOutput<LinearEso<2, float>>, 3>>>>(411);
  controls<Adrc<Guarded<LinearEso<3, double>>>>(421);  // it softens: no changing b0
  observes_in_text<Guarded<OutlierGate<LinearEso<1, double>>>>(431);
  controls_changed<Adrc<Guarded<LinearEso<2, float>>, ErrorBased>>(441, [](auto& settings) {
    settings.observer.unit = DisturbanceUnit::input;
    settings.observer.disturbance_bound = 1;
    settings.observer.release_samples = 20;
    settings.observer.leak_time = 0;
    settings.measurement_divider = 2;
  });
}

template <class C>
void predicts_in_text(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  using Observer = std::remove_cvref_t<decltype(std::declval<C>().observer())>;
  for (const double gain : {8.0, -8.0}) {
    typename C::Config settings{.observer = observer_config<Observer>(gain)};
    settings.controller_bandwidth = V(4);
    settings.limits = {V(-3), V(2.5), V(60)};
    settings.start_hold = V(0.1);
    if constexpr (requires { settings.observer.outlier_threshold; }) {
      settings.observer.outlier_threshold = V(9);
    }
    C controller = C::make(settings).value();
    const auto block = to_structured_text(controller, {.name = "loop"}).value();
    Samples samples(
        "y no_y next_r u_held starts reports : u status mode start_status report_status" +
        estimate_names(Observer::size));
    ChainPlant plant(C::order, 0.0078125, gain, 1.5);
    Random random(seed++ + asked("ESOKIT_WRITTEN_SEED", 0));
    V r(1);
    int lost = 0;
    unsigned start_status = 0;
    for (int k = 0; k < samples_each; ++k) {
      plant.step(static_cast<double>(controller.output()));
      if (random.index(60) == 0) r = static_cast<V>(random.uniform(-2, 2));
      lost = lost > 0 ? lost - 1 : random.index(100) == 0 ? random.index(14) : 0;
      const V y = odd(random, static_cast<V>(plant.output()));
      const V given = odd(random, r);
      const V held = odd(random, static_cast<V>(random.uniform(-1, 1)));
      const bool starts = random.index(80) == 0;
      const bool reports = random.index(30) == 0;
      if (starts) start_status = static_cast<unsigned>(controller.start(y, held));
      const auto report_status = reports ? static_cast<unsigned>(controller.applied(held)) : 0u;
      const V u = lost > 0 ? controller.control_without_measurement() : controller.control(y);
      const auto status = static_cast<unsigned>(controller.prepare(given));
      samples.number(y).count(lost > 0).number(given).number(held).count(starts).count(reports);
      samples.number(u).count(status).count(static_cast<unsigned>(controller.mode()));
      samples.count(start_status).count(report_status).estimates(controller.observer());
    }
    interprets(block, samples);
  }
}

TEST(StructuredText, OfPredictiveAdrc) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  predicts_in_text<PredictiveAdrc<LinearEso<2, double>>>(501);
  predicts_in_text<PredictiveAdrc<HalfGainEso<2, float>>>(511);
  predicts_in_text<PredictiveAdrc<ExtendedStateFilter<1, double>>>(521);
  predicts_in_text<PredictiveAdrc<AlgebraicEso<1, float>>>(531);
  predicts_in_text<PredictiveAdrc<CascadeEso<1, 2, float>>>(541);
}

template <int Order, class V>
void moves_in_text(std::uint64_t seed) {
  SCOPED_TRACE(Order);
  using Profile = SmoothProfile<Order, V>;
  typename Profile::Config settings{};
  settings.sample_time = V(0.01);
  for (int i = 0; i < Order; ++i) settings.limits[static_cast<std::size_t>(i)] = V(2 + 3 * i);
  Profile profile = Profile::make(settings).value();
  const auto block = to_structured_text(profile, {.name = "profile"}).value();
  std::string names;
  for (int i = 1; i <= Order; ++i) names += " r" + std::to_string(i);
  Samples samples("target resets : good moves r" + names);
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  V target(1);
  int moving = 0;
  for (int k = 0; k < 4 * samples_each; ++k) {
    if (random.index(60) == 0) target = static_cast<V>(random.uniform(-1, 1));
    const V given = odd(random, target);
    const bool resets = random.index(200) == 0;
    const bool good =
        resets ? static_cast<bool>(profile.reset(given)) : static_cast<bool>(profile.update(given));
    const auto motion = profile.motion();
    samples.number(given).count(resets).count(good).count(profile.moving());
    for (int i = 0; i <= Order; ++i) samples.number(motion(i));
    samples.word("\n");
    moving += profile.moving();
  }
  EXPECT_GT(moving, samples_each);
  interprets(block, samples);
}

TEST(StructuredText, OfProfiles) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  moves_in_text<1, float>(701);
  moves_in_text<2, double>(711);
  moves_in_text<3, double>(721);
}

template <int Order, int Capacity, class V>
void approaches_in_text(double gain, std::uint64_t seed) {
  SCOPED_TRACE(Order);
  auto profile =
      ApproachProfile<Order, Capacity, V>::make({.pole = V(0.1),
                                                 .lag = Order == 2 ? V(0.2) : V(0),
                                                 .input_gain = static_cast<V>(gain),
                                                 .limits = {.lower = V(-10), .upper = V(20)},
                                                 .dead_time = V(0.03125) * V(Capacity),
                                                 .bandwidth = V(1.5),
                                                 .sample_time = V(0.03125)})
          .value();
  const auto block = to_structured_text(profile, {.name = "profile"}).value();
  Samples samples(std::string("target y u_held starts : started good feed r r1") +
                  (Order == 2 ? " r2" : ""));
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  V target(1);
  int begun = 0, refused = 0;
  for (int k = 0; k < 4 * samples_each; ++k) {
    if (random.index(60) == 0) target = static_cast<V>(random.uniform(-20, 20));
    const V given = odd(random, target);
    const bool starts = random.index(100) == 0;
    const V y = odd(random, static_cast<V>(random.uniform(-20, 20)));
    const V u = odd(random, static_cast<V>(random.uniform(-10, 20)));
    const bool started = starts && profile.start(y, u);
    const bool good = profile.update(given);
    const auto motion = profile.motion();
    samples.number(given).number(y).number(u).count(starts).count(started).count(good);
    samples.number(profile.feed());
    for (int i = 0; i <= Order; ++i) samples.number(motion(i));
    samples.word("\n");
    begun += started;
    refused += !good;
  }
  EXPECT_GT(begun, 0);
  EXPECT_GT(refused, 0);
  interprets(block, samples);
}

TEST(StructuredText, OfApproaches) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  approaches_in_text<1, 0, float>(2, 741);
  approaches_in_text<1, 3, double>(-0.5, 751);
  approaches_in_text<2, 4, float>(0.3, 761);
}

template <int Order, class V>
void follows_in_text(double fastest, double filter_time, std::uint64_t seed) {
  SCOPED_TRACE(Order);
  FollowProfileConfig<Order, V> config{.filter_time = static_cast<V>(filter_time),
                                       .sample_time = V(0.03125)};
  config.limits[Order - 1] = V(4);
  if (Order == 2 || fastest > 0) config.limits[0] = static_cast<V>(fastest);
  auto profile = FollowProfile<Order, V>::make(config).value();
  const auto block = to_structured_text(profile, {.name = "profile"}).value();
  const bool second = Order == 2;
  Samples samples(std::string("target target1 ") + (second ? "target2 y speed" : "y") +
                  " starts waits : started good r r1" + (second ? " r2" : ""));
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  const auto number = [&](double most) { return static_cast<V>(random.uniform(-most, most)); };
  typename FollowProfile<Order, V>::Motion target{};
  int begun = 0, refused = 0, held = 0;
  for (int k = 0; k < 4 * samples_each; ++k) {
    if (random.index(40) == 0) {
      for (int i = 0; i <= Order; ++i) target(i) = random.index(2) == 0 ? number(5) : V(0);
    }
    target(0) = random.index(200) == 0 ? number(20) : target(0) + V(0.03125) * target(1);
    if (random.index(80) == 0) held = random.index(20);
    const bool waits = held-- > 0, starts = random.index(100) == 0;
    auto given = target;
    for (int i = 0; i <= Order; ++i) given(i) = odd(random, target(i));
    const V y = odd(random, number(20)), speed = second ? odd(random, number(5)) : V(0);
    const bool started = starts && profile.start(y, speed);
    bool good = true;
    if (waits) {
      profile.wait();
    } else {
      good = profile.update(given);
    }
    for (int i = 0; i <= Order; ++i) samples.number(given(i));
    samples.number(y);
    if (second) samples.number(speed);
    samples.count(starts).count(waits).count(started).count(good);
    for (int i = 0; i <= Order; ++i) samples.number(profile.motion()(i));
    samples.word("\n");
    begun += started;
    refused += !good;
  }
  EXPECT_GT(begun, 0);
  EXPECT_GT(refused, 0);
  interprets(block, samples);
}

TEST(StructuredText, OfFollowers) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  follows_in_text<1, float>(3, 0, 771);
  follows_in_text<1, double>(3, 0.1, 781);
  follows_in_text<2, double>(2, 0, 791);
  follows_in_text<2, float>(0, 0.1, 801);
}

template <class V>
void switches_in_text(double on, std::uint64_t seed) {
  auto output = TimeProportioned<V>::make({.off = V(1),
                                           .on = static_cast<V>(on),
                                           .window = V(0.5),
                                           .least_on = V(0.06),
                                           .least_off = V(0.1),
                                           .sample_time = V(0.02)})
                    .value();
  const auto block = to_structured_text(output, {.name = "relay"}).value();
  Samples samples("u : is_on applied begins");
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  int ons = 0;
  for (int k = 0; k < 4 * samples_each; ++k) {
    const V u = odd(random, static_cast<V>(1 + (on - 1) * random.uniform(-0.2, 1.2)));
    const bool is_on = output.update(u);
    samples.number(u).count(is_on).number(output.applied()).count(output.begins()).word("\n");
    ons += is_on;
  }
  EXPECT_GT(ons, samples_each);
  EXPECT_LT(ons, 3 * samples_each);
  interprets(block, samples);
}

TEST(StructuredText, OfTimeProportioned) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  switches_in_text<float>(100, 721);
  switches_in_text<double>(-3, 731);
}

/// A monitor fed by the outputs of its controller's block, which equal what it looks at.
template <class C>
void monitors_in_text(double plant_gain, double bad, LoopFault fault, std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  constexpr int size = ObserverOf<C>::size;
  auto settings = config<C>(8);
  settings.limits.rate = std::numeric_limits<V>::max();
  C controller = C::make(settings).value();
  auto watch = HealthMonitor<size, V>::make({.observer_bandwidth = V(30),
                                             .sample_time = V(0.0078125),
                                             .input_range = V(2.5),
                                             .noise = V(1e-3)})
                   .value();
  const auto loop = to_structured_text(controller, {.name = "loop", .watched = true}).value();
  const auto health = to_structured_text(watch, controller).value();
  Samples of_loop("y no_y r : u innovation asked applied missed");
  Samples of_health(
      "innovation asked held applied measured estimate disturbance missed its_status mode : fault "
      "gain_ratio "
      "response "
      "saturated");
  ChainPlant plant(C::order, 0.0078125, 8 * plant_gain, 1.5);
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  V r(1);
  int found = 0;
  for (int k = 0; k < 6 * samples_each; ++k) {
    plant.set_disturbance(std::sin(0.01 * k));
    plant.step(static_cast<double>(controller.output()));
    if (k % 3000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-1, 1));
    V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
    if (random.uniform(0, 1) < bad) y = odd(random, hidden_nan<V>());
    if (fault == LoopFault::sensor_still) y = V(0.25);
    (void)controller.update(y, r);
    watch.look(controller, y);
    const auto& observer = controller.observer();
    const V values[] = {observer.innovation(), controller.requested(), controller.output(),
                        observer.applied_input()};
    const auto missed = static_cast<unsigned>(observer.missed());
    of_loop.number(y).count(0).number(r).number(values[2]).number(values[0]).number(values[1]);
    of_loop.number(values[3]).count(missed).word("\n");
    for (const V value : values) of_health.number(value);
    of_health.number(y).number(observer.template estimate<0>());
    of_health.number(observer.template estimate<C::order>()).count(missed);
    of_health.count(static_cast<unsigned>(controller.status()));
    of_health.count(static_cast<unsigned>(controller.mode()));
    const auto& seen = watch.health();
    of_health.count(static_cast<unsigned>(diagnose(seen))).number(seen.gain_ratio);
    of_health.number(seen.response).number(seen.saturated).word("\n");
    found += diagnose(seen) == fault;
  }
  EXPECT_GT(found, 150);
  interprets(loop, of_loop);
  interprets(health, of_health);
}

TEST(StructuredText, OfMonitors) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  monitors_in_text<Adrc<LinearEso<2, double>>>(1, 0.02, LoopFault::none, 801);
  monitors_in_text<Adrc<LinearEso<2, double>>>(-1, 0, LoopFault::wrong_sign, 811);
  monitors_in_text<Adrc<LinearEso<1, float>>>(6, 0, LoopFault::innovation_too_large, 821);
  monitors_in_text<Adrc<LinearEso<1, double>>>(1, 0, LoopFault::sensor_still, 841);
  monitors_in_text<Adrc<CascadeEso<1, 2, float>>>(1, 0.3, LoopFault::measurements_rejected, 831);
}

/// Settings that change while it runs, as by `adopt`.
template <class C>
void adopts_in_text(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  auto all = config<C>(8);
  auto& settings = of_controller(all);
  C controller = C::make(all).value();
  const C first = controller;
  innermost(settings).observer_bandwidth = V(20);
  settings.controller_bandwidth = V(3);
  settings.limits = {V(-1), V(1.5), V(60)};
  if constexpr (detail::IsResting<C>::value) all.rest.error = V(0.25);
  const C second = C::make(all).value();
  settings.missing.most = 3;  // not one of the settings
  const C third = C::make(all).value();
  CodeOptions options{.name = "loop", .settings_in_struct = true};
  const auto block = to_structured_text(first, options).value();
  std::string sets = to_structured_settings(first, options).value();
  options.settings_name = "slow";
  sets += to_structured_settings(second, options).value();
  options.settings_name = "other";
  sets += to_structured_settings(third, options).value();
  Samples samples("y no_y r settings adopts : u adopted" + estimate_names(ObserverOf<C>::size));
  ChainPlant plant(C::order, 0.0078125, 8, 1.5);
  Random random(seed + asked("ESOKIT_WRITTEN_SEED", 0));
  bool adopted = false;
  for (int k = 0; k < samples_each; ++k) {
    plant.step(static_cast<double>(controller.output()));
    const V y = odd(random, static_cast<V>(plant.output()));
    const bool adopts = random.index(20) == 0;
    const int set = random.index(3);
    if (adopts) {
      adopted = set < 2;
      if (adopted) {
        EXPECT_TRUE(controller.adopt(set == 0 ? first : second));
      }
    }
    const V r = V((k / 200) % 2);
    const V u = controller.update(y, r);
    constexpr const char* names[] = {"loop_set_design", "loop_set_slow", "loop_set_other"};
    samples.number(y).count(0).number(r).word(names[set]).count(adopts);
    samples.number(u).count(adopted).estimates(controller.observer());
  }
  interprets(block + sets, samples);
}

TEST(StructuredText, AdoptsSettings) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  adopts_in_text<Adrc<LinearEso<2, double>>>(601);
  adopts_in_text<Adrc<OutlierGate<CascadeEso<1, 2, float>>>>(611);
  adopts_in_text<Resting<Adrc<LinearEso<2, float>>>>(621);
}

#endif

#endif  // ESOKIT_LOADS_C

TEST(StructuredText, RefusesNamesOfTheLanguage) {
  const auto observer =
      LinearEso<1, double>::make(observer_config<LinearEso<1, double>>(8)).value();
  for (const char* name : {"Limit", "MOVE", "a__b", "axis_"}) {
    const auto text = to_structured_text(observer, {.name = name});
    ASSERT_FALSE(text) << name;
    EXPECT_STREQ(text.error().field, "name");
  }
  EXPECT_TRUE(to_structured_text(observer, {.name = "axis_1"}));
}

/// What is not of the subset of C that is written is not translated.
TEST(StructuredText, RefusesOtherC) {
  const auto refusal = [](const std::string& body) {
    detail::StTranslator translator(
        "typedef struct {\n  double z;\n  uint8_t n;\n} a_state;\nstatic bool f(a_state *o) {\n  "
        "o->z "
        "= 1.0;\n  return true;\n}\nstatic double g(a_state *o, double y)\n{\n" +
            body + "}\n",
        "a");
    return translator.error;
  };
  EXPECT_EQ(refusal("  return o->z + y;\n"), "");
  EXPECT_NE(refusal("  goto end;\n  return y;\n"), "");
  EXPECT_NE(refusal("  return o->w;\n"), "");
  EXPECT_NE(refusal("  return y + o->n;\n"), "");
  EXPECT_NE(refusal("  return y + 1u;\n"), "");
  EXPECT_NE(refusal("  return f(o);\n"), "");
  EXPECT_NE(refusal("  return lgamma(y);\n"), "");
  EXPECT_NE(refusal("  o->n += 2u;\n  return y;\n"), "");
  EXPECT_NE(refusal("  while (f(o) && f(o)) {\n    o->z = y;\n  }\n  return y;\n"), "");
  EXPECT_NE(refusal("  const double *k = &y;\n  return k[0];\n"), "");
  EXPECT_NE(refusal("  for (o->n = 0u; o->n < 3u; o->n = 7u) {\n  }\n  return y;\n"), "");
}

}  // namespace target_structured_text_test
}  // namespace esokit_test
