// Plants: against closed-form responses.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/eigen.hpp>
#include <esokit/sim/disturbed_plant.hpp>
#include <esokit/sim/plant.hpp>
#include <esokit/sim/runge_kutta.hpp>

namespace sim_plant_test {

using namespace esokit;
using namespace esokit::sim;

struct UserPlant {
  static constexpr int states = 1;
  using State = EigenMatrix<double, 1>;
  State derivative(double, const State& x, double u) const { return State(u - x[0]); }
  double output(double, const State& x) const { return x[0]; }
};
struct NoOutput {
  static constexpr int states = 1;
  using State = EigenMatrix<double, 1>;
  State derivative(double, const State& x, double u) const { return State(u - x[0]); }
};
struct WrongSize : UserPlant {
  static constexpr int states = 2;
};

static_assert(Plant<UserPlant> && !Plant<NoOutput> && !Plant<WrongSize>);
static_assert(Plant<DisturbedPlant<2, float>> && Plant<DisturbedPlant<2, double, Sine<>>>);

template <class P>
typename P::State run(const P& plant, typename P::State x, double u, double end) {
  const auto rhs = [&](double t, const typename P::State& state) {
    return plant.derivative(t, state, u);
  };
  return integrate(rhs, 0.0, x, end / 1000, 1000);
}

/// y^(n) + a_(n-1) y^(n-1) + .. + a_0 y = b0 u + d(t)
template <int Order, class Disturbance = Constant<>>
auto disturbed(const typename LinearPlant<Order>::Chain& chain, Disturbance d = {}) {
  return DisturbedPlant<Order, double, Disturbance>::make(
             {.plant = LinearPlant<Order>::chain(chain).value(), .disturbance = d})
      .value();
}

TEST(Plant, IntegratorChainUnderHeldInput) {
  const auto plant = disturbed<3>({.input_gain = -2.0});
  const auto x = run(plant, {1.0, 2.0, 3.0}, 5.0, 2.0);
  // Third derivative -10 throughout.
  EXPECT_NEAR(x[0], 1 + 4 + 6 - 10 * 8.0 / 6, 1e-11);
  EXPECT_NEAR(x[1], 2 + 6 - 20, 1e-11);
  EXPECT_NEAR(x[2], 3 - 20, 1e-11);
  EXPECT_EQ(plant.output(0.0, x), x[0]);
}

TEST(Plant, DisturbanceIsOfTheHighestDerivative) {
  const auto sine = Sine<>::make({.amplitude = 4.0, .angular_frequency = 2.0}).value();
  const auto x = run(disturbed<2>({.input_gain = 5.0}, sine), {0.0, 0.0}, 0.0, 1.5);
  EXPECT_NEAR(x[1], 2.0 * (1.0 - std::cos(3.0)), 1e-10);
  EXPECT_NEAR(x[0], 2.0 * 1.5 - std::sin(3.0), 1e-10);
}

TEST(Plant, StepResponse) {
  // y'' + 2 y' + 5 y = 10 u: poles -1 +- 2i, final value 2.
  const auto plant = disturbed<2>({.coefficients = {5.0, 2.0}, .input_gain = 10.0});
  const auto x = run(plant, {0.0, 0.0}, 1.0, 1.0);
  EXPECT_NEAR(x[0], 2.0 * (1.0 - std::exp(-1.0) * (std::cos(2.0) + 0.5 * std::sin(2.0))), 1e-10);
  EXPECT_NEAR(x[1], 5.0 * std::exp(-1.0) * std::sin(2.0), 1e-10);
}

TEST(Plant, DisturbanceMayBeALambda) {
  const auto plant = disturbed<1>({}, [](double t) { return t; });
  using State = EigenMatrix<double, 1>;
  EXPECT_NEAR(run(plant, State(1.0), 0.0, 2.0)[0], 3.0, 1e-12);
  EXPECT_NEAR(run(plant, State(1.0), 1.0, 2.0)[0], 5.0, 1e-12);
}

}  // namespace sim_plant_test
