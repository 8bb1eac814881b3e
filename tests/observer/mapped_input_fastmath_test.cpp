// A bad u under -ffast-math, where the lines of a curve may make a number of it: each report of an
// actuator, alone and in each lane of a pack, is rejected.
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <support/numbers.hpp>

namespace {

using namespace esokit;
using esokit_test::hidden_infinity;
using esokit_test::hidden_nan;

/// The one and other numbers of points: compilers clamp differently then.
template <class S, int Points>
auto curves() {
  std::array<ActuatorCurve<S, Points>, static_cast<std::size_t>(Points) + 1> all{};
  for (std::size_t points = 0; points < all.size(); ++points) {
    all[points].points = static_cast<int>(points);
    all[points].slope_below = S(1.07);
    all[points].slope_above = S(0.78);
    for (std::size_t i = 0; i < points; ++i) {
      all[points].input[i] = S(-2) + S(0.5) * static_cast<S>(i);
      all[points].effect[i] = S(-1.9) + S(0.45) * static_cast<S>(i);
    }
  }
  return all;
}

template <class S>
typename LinearEso<2, S>::Config settings() {
  return {.observer_bandwidth = S(50), .input_gain = S(2), .sample_time = S(0.01)};
}

template <class Observer, int Points>
void rejects() {
  using S = typename Observer::scalar_type;
  using Eso = MappedInput<Observer, Points>;
  for (const auto& curve : curves<S, Points>()) {
    typename Eso::Config config{.curve = curve};
    if constexpr (requires { config.observer.period; }) {
      config.observer.period = S(6);
      config.observer.observer = settings<S>();
    } else {
      config.observer = settings<S>();
    }
    for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), -hidden_infinity<S>()}) {
      auto eso = Eso::make(config).value();
      EXPECT_TRUE(has(eso.update(S(1), bad), StepStatus::input_rejected));
      EXPECT_TRUE(has(eso.predict(bad), StepStatus::input_rejected));
      EXPECT_TRUE(is_finite(eso.estimate()(2)) && is_finite(eso.applied_input()));
      constexpr int lanes = 4;
      for (int lane = 0; lane < lanes; ++lane) {
        auto pack = Packed<Eso, lanes>::make([&](int) { return config; }).value();
        typename Packed<Eso, lanes>::scalar_type y{}, u{};
        for (int i = 0; i < lanes; ++i) y[i] = S(1), u[i] = i == lane ? bad : S(0.25);
        const auto status = pack.update(y, u);
        const auto later = pack.predict(u);
        for (int i = 0; i < lanes; ++i) {
          EXPECT_EQ(has(status[i], StepStatus::input_rejected), i == lane) << i;
          EXPECT_EQ(has(later[i], StepStatus::input_rejected), i == lane) << i;
        }
      }
    }
  }
}

TEST(MappedInputFastMath, RejectsABadReport) {
  rejects<LinearEso<2>, 9>();
  rejects<LinearEso<2>, 4>();
  rejects<LinearEso<2, float>, 4>();
  rejects<WrappedOutput<LinearEso<2>>, 4>();
  rejects<WrappedOutput<LinearEso<2, float>>, 9>();
}

}  // namespace
