/// @file
/// The figures of a study, in all digits, so that two ways to it can be compared by `diff`.
#pragma once

#include <cstdio>
#include <iostream>

#include <esokit/sim/study_records.hpp>

#include "monte_carlo/drives.hpp"

namespace drives {

inline int refused(const esokit::Error<double>& error) {
  std::cerr << error << '\n';
  return 3;
}

/// @return 0, or 3 if blocks are missing, which it names
template <class Study>
int print(const Study& study, const esokit::sim::StudyRecords& records) {
  const auto missing = records.missing();
  for (std::size_t i = 0; i < missing.size(); ++i) {
    const std::size_t from = i;
    while (i + 1 < missing.size() && missing[i + 1] == missing[i] + 1) ++i;
    std::cerr << "missing: block " << missing[from];
    if (i > from) std::cerr << " to " << missing[i];
    std::cerr << '\n';
  }
  const auto outcome = study.outcome(records, overshoot, settling, dip, chatter);
  if (!outcome) return refused(outcome.error());
  std::printf("runs %lld, failed %lld\n", static_cast<long long>(outcome->runs),
              static_cast<long long>(outcome->failed));
  for (const long long run : outcome->failures) std::printf("failed: run %lld\n", run);
  for (const auto& number : outcome->numbers) {
    std::printf(
        "%s: kept %lld, mean %.17g, deviation %.17g, median %.17g, 99.9 %% below %.17g, "
        "largest %.17g in run %lld\n",
        number.name().c_str(), static_cast<long long>(number.kept()), number.mean(),
        number.deviation(), number.quantile(0.5), number.quantile(0.999), number.largest(),
        static_cast<long long>(number.run_of_largest()));
  }
  return 0;
}

}  // namespace drives
