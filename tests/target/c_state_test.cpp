// An object is written with its state: the C goes on where the C++ is.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_state_test {

#if ESOKIT_LOADS_C

/// An oscillating y, at times an outlier.
template <class V>
V measurement(Random& random, int k) {
  const double outlier = random.index(30) == 0 ? random.uniform(-1, 1) : 0;
  return static_cast<V>(std::sin(0.05 * k) + outlier + 1e-3 * random.uniform(-1, 1));
}

/// @param is_same whether the whole state is that of a C that runs beside it. A delay is not: the
///        ring begins anew; nor a measured w: what was used is not written
template <class Observer>
void goes_on(std::uint64_t seed, bool is_same = true) {
  SCOPED_TRACE(testing::internal::GetTypeName<Observer>());
  using V = typename Observer::scalar_type;
  const Folder folder;
  const Observer first = Observer::make(observer_config<Observer>(8)).value();
  InC<V> beside(folder, to_c(first, {.name = "loop"}).value(), false);
  ASSERT_TRUE(beside.loaded());
  const auto fresh = beside.state();
  for (const int before : {1, 7, 300, 2000}) {
    auto observer = first;
    beside.state() = fresh;
    Random random(seed++);
    const auto u = [&](int k) { return static_cast<V>(std::cos(0.05 * k)); };
    const auto tell = [&](int k, auto... in_c) {
      const V w = static_cast<V>(std::sin(0.03 * k));
      if constexpr (requires { observer.measured(w); }) {
        observer.measured(w);
        (in_c->measured(w), ...);
      }
    };
    const auto update = [&](V y, V given) {
      (void)observer.update(y, given);
      (void)beside.observe(y, given);
    };
    for (int k = 0; k < before; ++k) {
      tell(k, &beside);
      if constexpr (requires { observer.set_pin(Pin::upper); }) {
        for (const auto& [at, pin] : {std::pair(before / 2, Pin::upper), {before - 3, Pin::free}}) {
          if (k != at) continue;
          observer.set_pin(pin);
          beside.set_pin(pin);
        }
      }
      // At the end each second one, for so long that the motion of an angle is learnt anew.
      const int left = before - k;
      if ((left < 22 && left % 2 == 1) || (left > 20 && random.index(20) == 0)) {
        (void)observer.predict(u(k));
        (void)beside.predict(u(k));
      } else {
        update(measurement<V>(random, k), u(k));
      }
    }
    while (observer.missed() > 0) update(measurement<V>(random, before), V(0));
    InC<V> in_c(folder, to_c(observer, {.name = "loop"}).value(), false);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(0)), 0);
    compare_estimates(observer, in_c, before);
    if (is_same) {
      EXPECT_EQ(beside.state(), in_c.state()) << before;
    }
    for (int k = before; k < before + 500 && !testing::Test::HasFailure(); ++k) {
      tell(k, &in_c);
      const V y = measurement<V>(random, k);
      EXPECT_EQ(static_cast<unsigned>(observer.update(y, u(k))), in_c.observe(y, u(k))) << k;
      compare_estimates(observer, in_c, k);
    }
  }
}

TEST(CState, OfObservers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  goes_on<WrappedOutput<OutlierGate<LinearEso<2, double>>>>(1);
  goes_on<DelayedInput<CascadeEso<1, 2, float>, 4>>(11, false);
  goes_on<Guarded<LinearEso<2, double>>>(21);
  goes_on<Measured<LinearEso<1, float>, 1, 4>>(31, false);
  goes_on<AlgebraicEso<1, float>>(41);
  goes_on<ExtendedStateFilter<1, double>>(51);
}

TEST(CState, OfControllers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<WrappedOutput<LinearEso<2, float>>>;
  auto settings = config<C>(8);
  settings.start_hold = {.time = 0.25F};  // 32 samples
  for (const int before : {0, 1, 20, 31, 32, 300}) {
    C controller = C::make(settings).value();
    Random random(61);
    const auto r = [](int k) { return static_cast<float>(0.5 * std::cos(0.01 * k)); };
    for (int k = 0; k < before; ++k) (void)controller.update(measurement<float>(random, k), r(k));
    const Folder folder;
    InC<float> in_c(folder, to_c(controller, {.name = "loop"}).value(), true);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(0), 0);
    for (int k = before; k < before + 500 && !testing::Test::HasFailure(); ++k) {
      const float y = measurement<float>(random, k);
      EXPECT_TRUE(equal_bits(controller.update(y, r(k)), in_c.update(y, r(k))))
          << before << ", sample " << k;
      compare_estimates(controller.observer(), in_c, k);
    }
  }
}

/// What was said since the last sample, too: u is the operator's, or the actuator holds another.
template <class V>
void goes_on_after_a_word(V rate) {
  using C = Adrc<LinearEso<2, V>>;
  auto settings = config<C>(8);
  settings.limits.rate = rate;
  for (const bool starts : {true, false}) {
    C controller = C::make(settings).value();
    Random random(71);
    for (int k = 0; k < 50; ++k) (void)controller.update(measurement<V>(random, k), V(1));
    if (starts) {
      EXPECT_EQ(controller.start(V(0.25), V(0.5)), StepStatus::ok);
    } else {
      EXPECT_EQ(controller.applied(V(0.75)), StepStatus::ok);
    }
    const Folder folder;
    InC<V> in_c(folder, to_c(controller, {.name = "loop"}).value(), true);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(V(0)), 0);
    if (starts) {  // it goes on being the operator's
      EXPECT_EQ(controller.applied(V(-0.5)), StepStatus::ok);
      EXPECT_EQ(in_c.applied(V(-0.5)), 0u);
    }
    for (int k = 0; k < 500; ++k) {
      const V y = measurement<V>(random, k);
      const V r = k < 3 ? hidden_nan<V>() : V(-1);  // u is the last command
      EXPECT_TRUE(equal_bits(controller.update(y, r), in_c.update(y, r))) << starts << " " << k;
      compare_estimates(controller.observer(), in_c, k);
    }
  }
}

TEST(CState, AfterAStartOrAReport) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  goes_on_after_a_word<double>(60);
  goes_on_after_a_word<float>(esokit::Limits<float>{}.rate);
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_state_test
}  // namespace esokit_test
