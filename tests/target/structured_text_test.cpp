// The Structured Text that to_structured_text writes equals the C++ bit for bit in an interpreter
// of its subset (structured_text.py): outputs, estimates, status and mode, with bad and missing
// samples, gaps, reported u and starts.
#include <cstdio>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/target/structured_text.hpp>
#include <support/friction.hpp>
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

constexpr int samples_each = 1500;

template <class V>
V odd(Random& random, V usual) {
  if (random.index(40) == 0) return hidden_nan<V>();
  return random.index(40) == 0 ? anything<V>(random) : usual;
}

template <class C>
void controls(std::uint64_t seed, int divider = 1) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  auto settings = config<C>(8);
  settings.measurement_divider = divider;
  C controller = C::make(settings).value();
  const auto block = to_structured_text(controller, {.name = "loop"}).value();
  constexpr int size = detail::ObserverOfController<C>::type::size;
  Samples samples("y no_y r u_held starts reports : u status mode" + estimate_names(size));
  ChainPlant plant(C::order, 0.0078125, 8, 1.5);
  Random random(seed);
  V r(1);
  int lost = 0;
  int odd_ones = 0;
  for (int k = 0; k < samples_each; ++k) {
    plant.step(static_cast<double>(controller.output()));
    if (random.index(60) == 0) r = static_cast<V>(random.uniform(-2, 2));
    if (lost > 0) --lost;
    if (random.index(100) == 0) lost = 1 + random.index(14);
    const V y = odd(random, static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1)));
    V given = r;
    if constexpr (!requires { controller.gains(); }) given = (r - y) / V(8);
    given = odd(random, given);
    const V held = odd(random, static_cast<V>(random.uniform(-1, 1)));
    const bool starts = random.index(80) == 0;
    const bool reports = random.index(30) == 0;
    if (starts) (void)controller.start(y, held);
    if (reports) controller.applied(held);
    if (lost > 0) {
      controller.update_without_measurement(given);
    } else {
      controller.update(y, given);
    }
    samples.number(y).count(lost > 0).number(given).number(held).count(starts).count(reports);
    samples.number(controller.output())
        .count(static_cast<unsigned>(controller.status()))
        .count(static_cast<unsigned>(controller.mode()))
        .estimates(controller.observer());
    odd_ones += controller.status() != StepStatus::ok;
  }
  EXPECT_GT(odd_ones, samples_each / (20 * divider));
  interprets(block, samples);
}

template <class Observer>
void observes_in_text(std::uint64_t seed) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using V = typename Observer::scalar_type;
  auto observer = Observer::make(observer_config<Observer>(8)).value();
  const auto block = to_structured_text(observer, {.name = "eso"}).value();
  Samples samples("y no_y u resets : status" + estimate_names(Observer::size));
  Random random(seed);
  for (int k = 0; k < samples_each; ++k) {
    const V y = odd(random, static_cast<V>(random.uniform(-1, 1)));
    const V u = odd(random, static_cast<V>(random.uniform(-1, 1)));
    const bool lost = random.index(6) == 0;
    const bool resets = random.index(50) == 0;
    const StepStatus status = resets ? observer.reset(y)
                              : lost ? observer.predict(u)
                                     : observer.update(y, u);
    samples.number(y).count(lost).number(u).count(resets);
    samples.count(static_cast<unsigned>(status)).estimates(observer);
  }
  interprets(block, samples);
}

TEST(StructuredText, OfControllers) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  controls<Adrc<LinearEso<2, double>>>(1);
  controls<Adrc<LinearEso<2, float>>>(2);
#ifndef ESOKIT_ONE_TYPE
  controls<Adrc<LinearEso<3, double>>>(3);  // it softens
  controls<Adrc<LinearEso<1, float>, ErrorBased>>(4, 3);
  controls<Adrc<DelayedInput<ModelEso<lag, float>, 4>>>(5);
  controls<Adrc<OutlierGate<LinearEso<2, float>>>>(10);
  controls<DisturbanceCompensator<AdjustableBandwidthEso<1, double>>>(6);
#endif
}

TEST(StructuredText, OfObservers) {
  if (!there("python3")) GTEST_SKIP() << "no python3";
  observes_in_text<CascadeEso<1, 2, double>>(7);
#ifndef ESOKIT_ONE_TYPE
  observes_in_text<DelayedInput<LinearEso<1, float>, 4>>(8);
  observes_in_text<AdjustableBandwidthEso<1, float>>(9);
  observes_in_text<OutlierGate<LinearEso<1, double>>>(11);
#endif
}

#endif  // ESOKIT_LOADS_C

TEST(StructuredText, RefusesByName) {
  const auto refusal = [](const auto& object) {
    const auto text = to_structured_text(object);
    return text ? std::string() : text.error().field + std::string(": ") + text.error().rule;
  };
  using Algebraic = AlgebraicEso<1, double>;
  using Angle = WrappedOutput<LinearEso<1, double>>;
  EXPECT_EQ(refusal(Algebraic::make(observer_config<Algebraic>(8)).value()),
            "observer: has a gain that goes on at each sample: not written in Structured Text");
  EXPECT_EQ(refusal(Angle::make(observer_config<Angle>(8)).value()),
            "period: of WrappedOutput is not written in Structured Text");
  using Held = Guarded<LinearEso<1, double>>;
  EXPECT_EQ(refusal(Held::make(observer_config<Held>(8)).value()),
            "guarded: is not written in Structured Text");
  using Told = Measured<LinearEso<1, double>, 1, 4>;
  EXPECT_EQ(refusal(Told::make(observer_config<Told>(8)).value()),
            "measured: is not written in Structured Text");
  using Known = KnownModel<LinearEso<1, double>, Friction<0, double>>;
  EXPECT_EQ(refusal(Known::make(observer_config<Known>(8)).value()),
            "model: of KnownModel is not written in Structured Text");
  using Ahead = PredictiveAdrc<LinearEso<1, double>>;
  Ahead::Config ahead{.observer = observer_config<LinearEso<1, double>>(8)};
  ahead.controller_bandwidth = 3;
  EXPECT_EQ(refusal(Ahead::make(ahead).value()),
            "PredictiveAdrc: is not written in Structured Text");
}

}  // namespace target_structured_text_test
}  // namespace esokit_test
