/// @file
/// Many runs of a loop with noise and a varied plant, beside what one writes by hand in packs for
/// this one loop, with the same random numbers and, to rounding, the same results. Packs are for
/// AVX: run it with --flags "-O2 -march=x86-64-v3 -ffp-contract=off" too.
#include <cmath>
#include <cstdint>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/monte_carlo.hpp>

#include "../support/run.hpp"

namespace esokit::benchmarks {
namespace {

constexpr double T = 1e-3;
constexpr std::int64_t runs = 2048;
constexpr int samples = 1000;
constexpr int lanes = default_lanes<double>;
using Lanes = Pack<double, lanes>;

/// Observer, law and limits without a check, plant sampled exactly.
double by_hand() {
  const double p = std::exp(-80.0 * T), decay = std::exp(-3.0 * T);
  const Lanes l1(1.0 - p * p * p), l2(1.5 * (1.0 - p) * (1.0 - p) * (1.0 + p) / T),
      l3(std::pow((1.0 - p) / T, 3) * T);
  const Lanes a12((1.0 - decay) / 3.0), a22(decay);
  sim::RunStatistics overshoot("overshoot", 0.2);
  for (std::int64_t run = 0; run < runs; run += lanes) {
    Lanes b;
    for (int i = 0; i < lanes; ++i) {
      sim::Draw draw(1, run + i);
      b[i] = 50.0 * draw.uniform_ratio(0.5, 2.0);
    }
    const Lanes b1 = b * Lanes((T - (1.0 - decay) / 3.0) / 3.0);
    const Lanes b2 = b * Lanes((1.0 - decay) / 3.0);
    Lanes x1(0.0), x2(0.0), z1(0.0), z2(0.0), z3(0.0), u(0.0), largest(-1e300);
    sim::CountedGaussian<Lanes> noise(1, sim::RandomStream::noise, static_cast<std::uint64_t>(run));
    for (int k = 0; k < samples; ++k) {
      const Lanes y = x1 + Lanes(1e-3) * noise.next();
      const Lanes driven = z3 + Lanes(50.0) * u;
      const Lanes p1 = z1 + Lanes(T) * z2 + Lanes(0.5 * T * T) * driven;
      const Lanes e = y - p1;
      z2 = z2 + Lanes(T) * driven + l2 * e;
      z1 = p1 + l1 * e;
      z3 = z3 + l3 * e;
      u = (Lanes(144.0) * (Lanes(1.0) - z1) - Lanes(24.0) * z2 - z3) * Lanes(1.0 / 50.0);
      u = select(u < Lanes(-6.0), Lanes(-6.0), select(Lanes(6.0) < u, Lanes(6.0), u));
      const Lanes over = x1 - Lanes(1.0);
      largest = select(largest < over, over, largest);
      const Lanes next = x1 + a12 * x2 + b1 * u;
      x2 = a22 * x2 + b2 * u;
      x1 = next;
    }
    for (int i = 0; i < lanes; ++i) overshoot.add(run + i, largest[i]);
  }
  return overshoot.mean();
}

double by_monte_carlo() {
  const auto plant =
      LinearPlant<2>::chain({.coefficients = {0.0, 3.0}, .input_gain = 50.0}).value();
  const auto adrc =
      Adrc<LinearEso<2>>::make(
          {.observer = {.observer_bandwidth = 80.0, .input_gain = 50.0, .sample_time = T},
           .controller_bandwidth = 12.0,
           .limits = {.lower = -6.0, .upper = 6.0}})
          .value();
  const auto study = sim::monte_carlo(
      plant, adrc,
      {.runs = runs,
       .loop = {.duration = samples * T, .reference = 1.0, .noise = 1e-3},
       .threads = 1},
      [](auto& trial, sim::Draw& draw) { trial.plant.b(1) *= draw.uniform_ratio(0.5, 2.0); });
  return study
      .run(sim::largest("overshoot", [](const auto& s) { return s.output - s.reference; },
                        {.limit = 0.2}))
      ->numbers[0]
      .mean();
}

void time_of(benchmark::State& state, double (*all)(), const char* label) {
  const double expected = by_hand();
  for (auto _ : state) {
    const double mean = all();
    if (!(std::abs(mean - expected) < 1e-9)) state.SkipWithError("another result than by hand");
    benchmark::DoNotOptimize(mean);
  }
  state.SetItemsProcessed(state.iterations() * runs * samples);
  state.SetLabel(label);
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  using namespace esokit::benchmarks;
  benchmark::RegisterBenchmark("monte_carlo/hand_written", [](benchmark::State& state) {
    time_of(state, by_hand, "");
  })->Unit(benchmark::kMillisecond);
  benchmark::RegisterBenchmark("monte_carlo/run", [](benchmark::State& state) {
    time_of(state, by_monte_carlo, "vs monte_carlo/hand_written <= 1.5");
  })->Unit(benchmark::kMillisecond);
  return run(argc, argv);
}
