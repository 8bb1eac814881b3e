/// @file
/// Step rates of sim::run: a finished Adrc on a linear and on a nonlinear plant, beside the same
/// loop by hand, which keeps what the run keeps. The time is that of one sample.
#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdint>
#include <esokit/control/adrc.hpp>
#include <esokit/core/pack.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/counted_gaussian.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/held_plant.hpp>
#include <esokit/sim/run.hpp>
#include <optional>
#include <vector>

#include "../support/run.hpp"

namespace esokit::benchmarks {
namespace {

constexpr int samples = 10000;
constexpr double T = 1e-3;
constexpr double load = -20.0;

auto controller() {
  return Adrc<LinearEso<2>>::make(
             {.observer = {.observer_bandwidth = 100, .input_gain = 50, .sample_time = T},
              .controller_bandwidth = 10,
              .limits = {.lower = -5, .upper = 5}})
      .value();
}
double reference(double t) { return t < 1.0 ? 0.0 : 1.0; }

/// y'' + 3 y' + 2 y = 50 u + d
auto linear() { return LinearPlant<2>::chain({.coefficients = {2, 3}, .input_gain = 50}).value(); }
auto nonlinear() {
  return sim::nonlinear_plant<2>([](double, const Vector<double, 2>& x, double u) {
    return Vector<double, 2>{x(1), 50 * u - 3 * x(1) - 2 * x(0) * x(0)};
  });
}

/// What a recording has.
struct Columns {
  std::vector<double> t, output, measurement, reference, input, total_disturbance;
  void add(double time, double y, double r, double u, double d) {
    t.push_back(time);
    output.push_back(y);
    measurement.push_back(y);
    reference.push_back(r);
    input.push_back(u);
    total_disturbance.push_back(d);
  }
};

/// A loop by hand. @param advance (x0, x1, u): one sample of the plant
template <bool Recorded, class Advance>
void by_hand(benchmark::State& state, const Advance& advance) {
  const auto made = controller();
  double sum = 0.0;
  while (state.KeepRunningBatch(samples)) {
    auto driven = made;
    Columns columns;
    double x0 = 0.0, x1 = 0.0;
    benchmark::DoNotOptimize(x0);
    for (int k = 0; k < samples; ++k) {
      const double t = k * T;
      const double r = reference(t);
      const double u = driven.update(x0, r);
      if constexpr (Recorded) {
        columns.add(t, x0, r, u, driven.observer().total_disturbance());
      } else {
        sum += x0;
      }
      advance(x0, x1, u);
      if (!std::isfinite(x0) || !std::isfinite(x1)) break;
    }
    benchmark::DoNotOptimize(x0);
    benchmark::DoNotOptimize(columns);
  }
  benchmark::DoNotOptimize(sum);
}

template <bool Recorded>
void linear_by_hand(benchmark::State& state) {
  const auto held = held_plant(linear(), T).value();
  const double a = 1 + held.increment(0, 0), b = held.increment(0, 1), c = held.increment(1, 0),
               d = 1 + held.increment(1, 1), u0 = held.input(0), u1 = held.input(1),
               d0 = held.disturbance(0), d1 = held.disturbance(1);
  by_hand<Recorded>(state, [=](double& x0, double& x1, double u) {
    const double next = a * x0 + b * x1 + d0 * load + u0 * u;
    x1 = c * x0 + d * x1 + d1 * load + u1 * u;
    x0 = next;
  });
}

void nonlinear_by_hand(benchmark::State& state) {
  by_hand<false>(state, [](double& x0, double& x1, double u) {
    const auto f = [&](double y, double v) { return 50 * (u + load / 50) - 3 * v - 2 * y * y; };
    const double k1 = f(x0, x1), v2 = x1 + T / 2 * k1;
    const double k2 = f(x0 + T / 2 * x1, v2), v3 = x1 + T / 2 * k2;
    const double k3 = f(x0 + T / 2 * v2, v3), v4 = x1 + T * k3;
    const double k4 = f(x0 + T * v3, v4);
    x0 += T / 6 * x1 + T / 3 * v2 + T / 3 * v3 + T / 6 * v4;
    x1 += T / 6 * k1 + T / 3 * k2 + T / 3 * k3 + T / 6 * k4;
  });
}

template <class P, class R>
void by_run(benchmark::State& state, const P& plant, const R& r, double disturbance,
            const char* label) {
  const auto made = controller();
  double sum = 0.0;
  while (state.KeepRunningBatch(samples)) {
    auto end =
        sim::run(plant, made, {.duration = samples * T, .reference = r, .disturbance = disturbance},
                 [&](const auto& sample) { sum += sample.output; });
    benchmark::DoNotOptimize(end);
  }
  benchmark::DoNotOptimize(sum);
  state.SetLabel(label);
}

void recorded(benchmark::State& state) {
  const auto made = controller();
  const auto plant = linear();
  while (state.KeepRunningBatch(samples)) {
    auto recording = sim::run(
        plant, made, {.duration = samples * T, .reference = reference, .disturbance = load});
    benchmark::DoNotOptimize(recording);
  }
  state.SetLabel("vs recorded/hand_written <= 1.2");
}

/// The random numbers of a run; the time is that of one.
template <class Random>
void normal(benchmark::State& state, Random random, int lanes, const char* label) {
  const auto turns = samples / lanes;
  while (state.KeepRunningBatch(turns * lanes)) {
    for (int i = 0; i < turns; ++i) {
      auto number = random.next();
      benchmark::DoNotOptimize(number);
    }
  }
  state.SetLabel(label);
}

/// What a Monte Carlo does, a pack of runs with noise at a time; the time is that of a sample of a
/// lane. With AVX: --flags "-O2 -march=x86-64-v3".
template <class P, class C>
void noisy(benchmark::State& state, const P& plant, const C& made,
           std::optional<std::uint64_t> number, const char* label) {
  using S = typename P::scalar_type;
  constexpr int steps = samples / 10;
  while (state.KeepRunningBatch(steps * lane_count<S>)) {
    S most(0.0);
    auto end = sim::run(
        plant, made,
        {.duration = steps * T, .reference = S(1.0), .noise = S(1e-3), .number = number},
        [&](const auto& sample) { most = select(most < sample.output, sample.output, most); });
    benchmark::DoNotOptimize(end);
    benchmark::DoNotOptimize(most);
  }
  state.SetLabel(label);
}

void noisy_one(benchmark::State& state, std::optional<std::uint64_t> number, const char* label) {
  noisy(state, linear(), controller(), number, label);
}

void noisy_pack(benchmark::State& state, const char* label) {
  constexpr int lanes = default_lanes<double>;
  const Packed<LinearPlant<2>, lanes> plants(linear());
  noisy(state, plants.together(), Packed<decltype(controller()), lanes>(controller()), 1, label);
}

void add_normal() {
  using sim::CountedGaussian;
  using sim::RandomStream;
  benchmark::RegisterBenchmark(
      "normal/gaussian", [](benchmark::State& state) { normal(state, sim::Gaussian(1), 1, ""); });
  benchmark::RegisterBenchmark("normal/counted", [](benchmark::State& state) {
    normal(state, CountedGaussian<>(1, RandomStream::noise, 0), 1, "vs normal/gaussian");
  });
  benchmark::RegisterBenchmark("normal/counted_pack", [](benchmark::State& state) {
    normal(state, CountedGaussian<Pack<double>>(1, RandomStream::noise, 0), default_lanes<double>,
           "vs normal/gaussian; vs normal/counted");
  });
  benchmark::RegisterBenchmark("noisy/gaussian",
                               [](benchmark::State& state) { noisy_one(state, std::nullopt, ""); });
  benchmark::RegisterBenchmark(
      "noisy/counted", [](benchmark::State& state) { noisy_one(state, 1, "vs noisy/gaussian"); });
  benchmark::RegisterBenchmark("noisy/counted_pack", [](benchmark::State& state) {
    noisy_pack(state, "vs noisy/gaussian; vs noisy/counted");
  });
}

void add_all() {
  // A run asks any function for the reference, over which the state of the plant and u are in
  // memory: that is what `linear` takes more than `constant`.
  benchmark::RegisterBenchmark("linear/hand_written", linear_by_hand<false>);
  benchmark::RegisterBenchmark("linear/run", [](benchmark::State& state) {
    by_run(state, linear(), reference, load, "vs linear/hand_written <= 1.15");
  });
  benchmark::RegisterBenchmark("linear/run_constant", [](benchmark::State& state) {
    by_run(state, linear(), 1.0, load, "vs linear/hand_written <= 1.10");
  });
  benchmark::RegisterBenchmark("nonlinear/hand_written", nonlinear_by_hand);
  benchmark::RegisterBenchmark("nonlinear/run", [](benchmark::State& state) {
    by_run(state, nonlinear(), reference, load / 50, "vs nonlinear/hand_written <= 1.35");
  });
  benchmark::RegisterBenchmark("recorded/hand_written", linear_by_hand<true>);
  benchmark::RegisterBenchmark("recorded/run", recorded);
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all();
  esokit::benchmarks::add_normal();
  return esokit::benchmarks::run(argc, argv);
}
