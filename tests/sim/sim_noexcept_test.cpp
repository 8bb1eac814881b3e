// The simulation part without exceptions and RTTI; a plain main, 0 is good.
#include <cmath>
#include <esokit/sim/disturbed_plant.hpp>
#include <esokit/sim/metrics.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <esokit/sim/signals.hpp>

namespace {

using namespace esokit::sim;

template <class T>
bool plant_follows_its_filter() {
  // (0.5 s + 1)^2 as a plant, and as a closed form.
  using Linear = esokit::LinearPlant<2, T>;
  using P = DisturbedPlant<2, T>;
  const auto plant =
      P::make({.plant = Linear::chain({.coefficients = {T(4), T(4)}, .input_gain = T(4)}).value()})
          .value();
  const auto exact = FilteredStep<2, T>::make({.time_constant = T(0.5)}).value();
  auto noise = HeldNoise<T>::make({.power = T(0), .hold = T(0.01), .step = T(0.005)}).value();
  auto response = StepResponse<T>::make({}).value();
  using State = typename P::State;
  State x = State::Zero();
  const T h = T(0.005);
  const auto rhs = [&](T t, const State& state) { return plant.derivative(t, state, T(1)); };
  Trapezoid<T> gap;
  for (int k = 0; k < 1000; ++k) {
    const T t = static_cast<T>(k) * h;
    const T y = plant.output(t, x) + noise.at(k);
    gap.add(t, std::abs(y - exact(t)));
    if (!response.add(t, y)) return false;
    x = step(rhs, t, x, h);
  }
  return gap.value() < T(1e-5) && response.settling_time().has_value();
}

}  // namespace

int main() {
  return plant_follows_its_filter<float>() && plant_follows_its_filter<double>() &&
                 plant_follows_its_filter<long double>()
             ? 0
             : 1;
}
