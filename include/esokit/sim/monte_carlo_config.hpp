/// @file
/// Settings and result of `monte_carlo`, and what may vary from run to run.
#pragma once

#include <cmath>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/sim/counted_gaussian.hpp>
#include <esokit/sim/run.hpp>
#include <esokit/sim/statistics.hpp>
#include <functional>
#include <span>
#include <vector>

namespace esokit::sim {

/// The vector instructions for which the program was compiled; they determine the width of packs.
inline constexpr const char* instruction_set =
#if defined(__AVX512F__)
    "AVX-512";
#elif defined(__AVX2__)
    "AVX2";
#elif defined(__AVX__)
    "AVX";
#elif defined(__SSE2__)
    "SSE2";
#elif defined(__ARM_NEON)
    "NEON";
#else
    "none";
#endif

/// Random numbers to vary a run: a function of seed and run only.
class Draw {
 public:
  /// @param seed common to all runs
  Draw(std::uint64_t seed, std::int64_t run) noexcept
      : random_(seed, RandomStream::variation, static_cast<std::uint64_t>(run)), run_(run) {}

  /// A normal number with mean 0 and variance 1.
  double normal() noexcept { return random_.next(); }
  /// A number uniform between two limits.
  double uniform(double low, double high) noexcept {
    return low + (high - low) * random_.uniform();
  }
  /// A number between two positive limits, uniform in its logarithm: a factor of 2 is as likely as
  /// one of 1/2.
  double uniform_ratio(double low, double high) noexcept {
    return low * std::exp(std::log(high / low) * random_.uniform());
  }
  /// Number of the run, 0, 1, ..
  [[nodiscard]] std::int64_t run() const noexcept { return run_; }

 private:
  CountedGaussian<double> random_;
  std::int64_t run_;
};

/// What may differ from run to run besides the random numbers of the loop.
template <class P, class C>
struct Trial {
  P plant;                                ///< for speed use the same dead time in all runs
  C controller;                           ///< newly designed, retuned or unchanged
  typename RunTypes<P, C>::State state;   ///< x at the start
  typename RunTypes<P, C>::Output noise;  ///< standard deviation of measurement noise
};

/// Varies nothing: the runs differ only by the random numbers of the loop.
struct NoVariation {
  /// Changes nothing.
  template <class T>
  void operator()(T&, Draw&) const noexcept {}
};

namespace detail {

/// Whether all lanes of `Lanes` runs are computed at once.
template <class P, class C, int Lanes>
inline constexpr bool runs_in_packs = [] {
  using One = typename RunTypes<P, C>::S;
  if constexpr (Lanes == 1) {
    return false;
  } else if constexpr (esokit::detail::ComputesPacks<P, Pack<One, Lanes>> &&
                       esokit::detail::ComputesPacks<C, Pack<One, Lanes>>) {
    if constexpr (std::same_as<One, typename C::scalar_type>) {
      using Plants = typename Packed<P, Lanes>::Together;
      return SampledPlant<Plants> && ControllerOf<Packed<C, Lanes>, Plants>;
    }
  }
  return false;
}();

}  // namespace detail

/// A run that failed and gave no results.
template <class Time>
struct FailedRun {
  std::int64_t run = 0;  ///< number of the run
  Error<Time>
      error{};  ///< error error of `vary` or of the loop, for example a state that is not finite
};

/// Settings of `monte_carlo`.
template <class P, class C>
struct MonteCarloConfig {
  using Time = typename RunTypes<P, C>::Time;  ///< type of times

  [[no_unique_address]] ByName<MonteCarloConfig> by_name{};  ///< nothing to set, see ByName
  std::int64_t runs{};                                       ///< number of runs, 1 or more
  RunConfig<P, C> loop{};  ///< settings of every run, with the common seed; leave out its `number`
  int threads = 0;         ///< 0: one per core

  /// Called from time to time with the number of finished runs, 0 .. runs - 1; false stops.
  std::function<bool(std::int64_t done)> progress{};

  /// Called with the results of each run, in the order of the runs, from one thread at a time; NaN
  /// for a run that failed.
  std::function<void(std::int64_t run, std::span<const double> numbers)> on_run{};
};

/// The result.
template <class Time>
struct MonteCarloOutcome {
  std::int64_t runs = 0;               ///< number of finished runs; if stopped, the first so many
  std::int64_t failed = 0;             ///< number of failed runs, which are not in the statistics
  FailedRun<Time> first_failure{};     ///< the first failed run
  std::vector<std::int64_t> failures;  ///< numbers of the first failed runs, at most 1000
  std::vector<RunStatistics> numbers;  ///< statistics of each Measure
  bool completed = true;               ///< false if it was stopped
  int threads = 1;                     ///< number of threads used
  int lanes = 1;                       ///< runs at once on each thread thread

  /// The share of all runs that kept the limit of a Measure; failed runs count as not kept. @param
  /// number index of the Measure
  [[nodiscard]] double share_kept(std::size_t number) const {
    return static_cast<double>(numbers[number].kept()) / static_cast<double>(runs);
  }
};

}  // namespace esokit::sim
