#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <esokit/core/language.hpp>
#include <esokit/sim/statistics.hpp>

namespace esokit::sim {

ESOKIT_FUNCTION void RunSums::add(std::int64_t run, double value, double limit) noexcept {
  const double step = value - mean;
  mean += step / static_cast<double>(++count);
  squares += step * (value - mean);
  if (count == 1 || value < smallest) {
    smallest = value;
    run_of_smallest = run;
  }
  if (count == 1 || value > largest) {
    largest = value;
    run_of_largest = run;
  }
  if (value <= limit) ++kept;
}

ESOKIT_FUNCTION void RunSums::join(const RunSums& later) noexcept {
  if (later.count == 0) return;
  if (count == 0) {
    *this = later;
    return;
  }
  const auto before = static_cast<double>(count), more = static_cast<double>(later.count);
  const double step = later.mean - mean;
  count += later.count;
  kept += later.kept;
  mean += step * (more / static_cast<double>(count));
  squares += later.squares + step * step * (before * more / static_cast<double>(count));
  if (later.smallest < smallest) {
    smallest = later.smallest;
    run_of_smallest = later.run_of_smallest;
  }
  if (later.largest > largest) {
    largest = later.largest;
    run_of_largest = later.run_of_largest;
  }
}

ESOKIT_FUNCTION void RunStatistics::add(std::int64_t run, double value) {
  sums_.add(run, value, limit_);
  ++bin(in_order(value) >> 40u);
}

ESOKIT_FUNCTION void RunStatistics::join(const RunStatistics& later) {
  sums_.join(later.sums_);
  for (const auto& [page, counts] : later.pages_) {
    auto& here = pages_[page];
    for (std::size_t i = 0; i < counts.size(); ++i) here[i] += counts[i];
  }
}

ESOKIT_FUNCTION double RunStatistics::quantile(double share) const {
  double below = share * static_cast<double>(sums_.count);
  for (const auto& [page, counts] : pages_) {
    for (std::size_t i = 0; i < counts.size(); ++i) {
      const auto here = static_cast<double>(counts[i]);
      if (here > 0.0 && below <= here) {
        const std::uint64_t first = (page << 52u) | (static_cast<std::uint64_t>(i) << 40u);
        const double low = number_of(first);
        const double high = number_of(first + ((std::uint64_t{1} << 40u) - 1u));
        const double inside = below > 0.0 ? below / here : 0.0;
        return std::fmin(std::fmax(low + (high - low) * inside, sums_.smallest), sums_.largest);
      }
      below -= here;
    }
  }
  return sums_.largest;
}

ESOKIT_FUNCTION std::uint64_t RunStatistics::in_order(double value) noexcept {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  return (bits & sign) != 0 ? ~bits : bits | sign;
}

}  // namespace esokit::sim
