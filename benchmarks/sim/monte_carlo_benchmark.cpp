/// @file
/// Many runs of a loop with a varied plant, with and without noise, beside what one writes by hand
/// for this one loop in raw SIMD, with the same random numbers and, to rounding, the same results.
/// Packs are for AVX: run it with --flags "-O2 -march=x86-64-v3 -ffp-contract=off" too.
#include <bit>
#include <cmath>
#include <cstdint>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/monte_carlo.hpp>
#include <string>

#include "../support/raw_simd.hpp"
#include "../support/run.hpp"

namespace esokit::benchmarks {
namespace {

constexpr double T = 1e-3;
constexpr std::int64_t runs = 2048;
constexpr int samples = 1000;
constexpr int lanes = default_lanes<double>;
using Lanes = Pack<double, lanes>;

/// Observer, law and limits without a check or a status, plant sampled exactly; it keeps the
/// largest error of a run.
template <bool Noise>
double by_hand() {
  using R = RawRegister<double>;
  const double p = std::exp(-80.0 * T), decay = std::exp(-3.0 * T);
  const double l1 = 1.0 - p * p * p, l2 = 1.5 * (1.0 - p) * (1.0 - p) * (1.0 + p) / T,
               l3 = std::pow((1.0 - p) / T, 3) * T;
  const double a12 = (1.0 - decay) / 3.0, a22 = decay;
  sim::RunStatistics overshoot("overshoot", 0.2);
  for (std::int64_t run = 0; run < runs; run += lanes) {
    R b{};
    for (int i = 0; i < lanes; ++i) {
      sim::Draw draw(1, run + i);
      b[i] = 50.0 * draw.uniform_ratio(0.5, 2.0);
    }
    const R b1 = b * ((T - (1.0 - decay) / 3.0) / 3.0);
    const R b2 = b * ((1.0 - decay) / 3.0);
    R x1{}, x2{}, z1{}, z2{}, z3{}, u{}, largest = R{} - 1e300;
    sim::CountedGaussian<Lanes> noise(1, sim::RandomStream::noise, static_cast<std::uint64_t>(run));
    for (int k = 0; k < samples; ++k) {
      R y = x1;
      if constexpr (Noise) y = x1 + 1e-3 * std::bit_cast<R>(noise.next());
      const R driven = z3 + 50.0 * u;
      const R p1 = z1 + T * z2 + 0.5 * T * T * driven;
      const R e = y - p1;
      z2 = z2 + T * driven + l2 * e;
      z1 = p1 + l1 * e;
      z3 = z3 + l3 * e;
      u = (144.0 * (1.0 - z1) - 24.0 * z2 - z3) * (1.0 / 50.0);
      u = raw_minimum(raw_maximum(u, R{} - 6.0), R{} + 6.0);
      largest = raw_maximum(largest, R(x1 - 1.0));
      const R next = x1 + a12 * x2 + b1 * u;
      x2 = a22 * x2 + b2 * u;
      x1 = next;
    }
    for (int i = 0; i < lanes; ++i) overshoot.add(run + i, largest[i]);
  }
  return overshoot.mean();
}

template <bool Noise>
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
       .loop = {.duration = samples * T, .reference = 1.0, .noise = Noise ? 1e-3 : 0.0},
       .threads = 1},
      [](auto& trial, sim::Draw& draw) { trial.plant.b(1) *= draw.uniform_ratio(0.5, 2.0); });
  return study
      .run(sim::largest("overshoot", [](const auto& s) { return s.output - s.reference; },
                        {.limit = 0.2}))
      ->numbers[0]
      .mean();
}

void time_of(benchmark::State& state, double (*all)(), double (*by_hand)(), const char* label) {
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
  const auto add = [](const std::string& name, double (*all)(), double (*hand)(),
                      const char* label) {
    benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
      time_of(state, all, hand, label);
    })->Unit(benchmark::kMillisecond);
  };
  add("noise/raw", by_hand<true>, by_hand<true>, "");
  add("noise/monte_carlo", by_monte_carlo<true>, by_hand<true>, "vs noise/raw <= 1.20");
  add("no_noise/raw", by_hand<false>, by_hand<false>, "");
  add("no_noise/monte_carlo", by_monte_carlo<false>, by_hand<false>, "vs no_noise/raw <= 1.30");
  return run(argc, argv);
}
