/// @file
/// The end of every benchmark's main().
#pragma once

#include <benchmark/benchmark.h>

namespace esokit::benchmarks {

/// Runs what is registered, by the options of the command line; the exit code.
inline int run(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}

}  // namespace esokit::benchmarks
