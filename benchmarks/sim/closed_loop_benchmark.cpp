/// @file
/// Step rates of the simulation core: the integrator and the two closed loops, beside the same
/// straight-line code by hand. The time is that of one step; steps a second are counted beside it.
#include <benchmark/benchmark.h>

#include <array>
#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/closed_loop.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <esokit/sim/plant.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <string>

#include "../support/run.hpp"

namespace esokit::benchmarks {
namespace {

using namespace esokit::sim;

constexpr int steps = 1000;
constexpr double h = 1e-3;
constexpr double bandwidth = 50.0;
constexpr double control_bandwidth = 5.0;
constexpr double damping = 0.5;
constexpr double stiffness = 2.0;

// y'' = -2 y - 0.5 y' + u
auto plant() {
  return DisturbedPlant<2>::make(
             {.plant = LinearPlant<2>::chain({.coefficients = {stiffness, damping}}).value()})
      .value();
}

auto law() {
  return AdrcLaw<2>::make({.controller_bandwidth = control_bandwidth, .input_gain = 1.0}).value();
}

/// Reports one step as the time, and steps a second.
class StepCount {
 public:
  explicit StepCount(benchmark::State& state) : state_(state) {}
  ~StepCount() { state_.SetItemsProcessed(state_.iterations()); }
  bool running() { return state_.KeepRunningBatch(steps); }

 private:
  benchmark::State& state_;
};

void integrator(benchmark::State& state) {
  StepCount count(state);
  const auto rate = [](double, const EigenMatrix<double, 2>& s) {
    return EigenMatrix<double, 2>(s(1), -stiffness * s(0) - damping * s(1));
  };
  while (count.running()) {
    EigenMatrix<double, 2> x(1.0, 0.0);
    benchmark::DoNotOptimize(x);
    x = integrate(rate, 0.0, x, h, steps);
    benchmark::DoNotOptimize(x);
  }
  state.SetLabel("vs integrator/hand_written");
}

void integrator_by_hand(benchmark::State& state) {
  StepCount count(state);
  const auto acceleration = [](double a, double b) { return -stiffness * a - damping * b; };
  while (count.running()) {
    double x0 = 1.0;
    double x1 = 0.0;
    benchmark::DoNotOptimize(x0);
    for (int i = 0; i < steps; ++i) {
      const double k1 = acceleration(x0, x1);
      const double v2 = x1 + h / 2 * k1;
      const double k2 = acceleration(x0 + h / 2 * x1, v2);
      const double v3 = x1 + h / 2 * k2;
      const double k3 = acceleration(x0 + h / 2 * v2, v3);
      const double v4 = x1 + h * k3;
      const double k4 = acceleration(x0 + h * v3, v4);
      x0 += h / 6 * x1 + h / 3 * v2 + h / 3 * v3 + h / 6 * v4;
      x1 += h / 6 * k1 + h / 3 * k2 + h / 3 * k3 + h / 6 * k4;
    }
    benchmark::DoNotOptimize(x0);
    benchmark::DoNotOptimize(x1);
  }
}

/// The papers' way: plant and observer as one ODE.
template <class Observer>
void continuous_loop(benchmark::State& state, const Observer& observer, const std::string& label) {
  StepCount count(state);
  const auto control = [law = law()](double, const typename Observer::Estimate& z) {
    return law.control(z, 1.0);
  };
  const ContinuousLoop loop{plant(), observer, control};
  double sum = 0.0;
  while (count.running()) {
    auto end = loop.run({.duration = steps * h, .step = h},
                        [&](const auto& sample) { sum += sample.output; });
    benchmark::DoNotOptimize(end);
  }
  benchmark::DoNotOptimize(sum);
  state.SetLabel(label);
}

/// The same loop with LinearEso<2>, straight-line.
void continuous_loop_by_hand(benchmark::State& state) {
  StepCount count(state);
  constexpr double w = bandwidth;
  constexpr double c = control_bandwidth;
  using Rates = std::array<double, 5>;
  const auto rate = [](const Rates& s) {
    const double u = c * c * (1.0 - s[2]) - 2 * c * s[3] - s[4];
    const double e = s[0] - s[2];
    return Rates{s[1], -stiffness * s[0] - damping * s[1] + u, s[3] + 3 * w * e,
                 s[4] + u + 3 * w * w * e, w * w * w * e};
  };
  const auto moved = [](const Rates& s, double by, const Rates& k) {
    return Rates{s[0] + by * k[0], s[1] + by * k[1], s[2] + by * k[2], s[3] + by * k[3],
                 s[4] + by * k[4]};
  };
  double sum = 0.0;
  while (count.running()) {
    Rates s{};
    benchmark::DoNotOptimize(s);
    for (int i = 0; i < steps; ++i) {
      sum += s[0];
      const Rates k1 = rate(s);
      const Rates k2 = rate(moved(s, h / 2, k1));
      const Rates k3 = rate(moved(s, h / 2, k2));
      const Rates k4 = rate(moved(s, h, k3));
      s = moved(moved(moved(moved(s, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4);
    }
    benchmark::DoNotOptimize(s);
  }
  benchmark::DoNotOptimize(sum);
}

/// The deployment way: one update a sample, the plant integrated under a held input.
template <class Observer>
void sampled_loop(benchmark::State& state, const Observer& observer) {
  StepCount count(state);
  const auto control = [law = law()](double, const typename Observer::Estimate& z) {
    return law.control(z, 1.0);
  };
  const SampledLoop loop{plant(), observer, control};
  double sum = 0.0;
  while (count.running()) {
    auto end = loop.run({.duration = steps * h, .sample_time = h},
                        [&](const auto& sample) { sum += sample.output; });
    benchmark::DoNotOptimize(end);
  }
  benchmark::DoNotOptimize(sum);
}

template <int Levels>
auto continuous_cascade() {
  return ContinuousCascadeEso<2, Levels>::make(
             {.observer_bandwidth = bandwidth, .bandwidth_factor = 2.0, .input_gain = 1.0})
      .value();
}

template <int Levels>
auto sampled_cascade() {
  return CascadeEso<2, Levels>::make({.observer_bandwidth = bandwidth,
                                      .bandwidth_factor = 2.0,
                                      .input_gain = 1.0,
                                      .sample_time = h})
      .value();
}

void add_all() {
  benchmark::RegisterBenchmark("integrator/hand_written", integrator_by_hand);
  benchmark::RegisterBenchmark("integrator/runge_kutta_4", integrator);

  benchmark::RegisterBenchmark("continuous_loop/hand_written", continuous_loop_by_hand);
  benchmark::RegisterBenchmark("continuous_loop/linear_eso", [](benchmark::State& state) {
    const auto observer =
        ContinuousLinearEso<2>::make({.observer_bandwidth = bandwidth, .input_gain = 1.0}).value();
    continuous_loop(state, observer, "vs continuous_loop/hand_written");
  });
  benchmark::RegisterBenchmark("continuous_loop/cascade_eso_3", [](benchmark::State& state) {
    continuous_loop(state, continuous_cascade<3>(), "vs continuous_loop/linear_eso");
  });

  benchmark::RegisterBenchmark("sampled_loop/linear_eso", [](benchmark::State& state) {
    sampled_loop(state, LinearEso<2>::make(
                            {.observer_bandwidth = bandwidth, .input_gain = 1.0, .sample_time = h})
                            .value());
  });
  benchmark::RegisterBenchmark("sampled_loop/cascade_eso_3", [](benchmark::State& state) {
    sampled_loop(state, sampled_cascade<3>());
  });
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all();
  return esokit::benchmarks::run(argc, argv);
}
