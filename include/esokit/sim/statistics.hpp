/// @file
/// Statistics of a result over many runs, in memory that does not grow with the number of runs.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/language.hpp>
#include <limits>
#include <map>
#include <string>
#include <utility>

namespace esokit::sim {

/// Statistics of one result per run: mean, standard deviation, extremes with their run, quantiles,
/// and how often a limit was kept.
///
/// For the quantiles, results are counted in bins with a width of 2^-12 of their size, so that
/// quantiles are accurate to 0.025 % in any unit. This takes 32 kB for each power of two in which
/// results lie.
class RunStatistics {
 public:
  /// @param name name of the result @param limit largest result that counts as `kept`
  explicit RunStatistics(std::string name = {},
                         double limit = std::numeric_limits<double>::infinity())
      : name_(std::move(name)), limit_(limit) {}

  /// Adds a result. @param run number of the run @param value finite
  void add(std::int64_t run, double value) {
    ++count_;
    const double step = value - mean_;
    mean_ += step / static_cast<double>(count_);
    squares_ += step * (value - mean_);
    if (count_ == 1 || value < smallest_) {
      smallest_ = value;
      run_of_smallest_ = run;
    }
    if (count_ == 1 || value > largest_) {
      largest_ = value;
      run_of_largest_ = run;
    }
    if (value <= limit_) ++kept_;
    const std::uint64_t ordered = in_order(value);
    ++pages_[ordered >> 52u][static_cast<std::size_t>((ordered >> 40u) & 4095u)];
  }

  /// Name of the result.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Number of results.
  [[nodiscard]] std::int64_t count() const noexcept { return count_; }
  /// Mean; zero without results.
  [[nodiscard]] double mean() const noexcept { return mean_; }
  /// Standard deviation, with count - 1 as divisor; zero for one result.
  [[nodiscard]] double deviation() const noexcept {
    return count_ > 1 ? std::sqrt(squares_ / static_cast<double>(count_ - 1)) : 0.0;
  }
  /// The extremes, and the first run that had them; zero without results.
  /// @{
  [[nodiscard]] double smallest() const noexcept { return smallest_; }
  [[nodiscard]] double largest() const noexcept { return largest_; }
  [[nodiscard]] std::int64_t run_of_smallest() const noexcept { return run_of_smallest_; }
  [[nodiscard]] std::int64_t run_of_largest() const noexcept { return run_of_largest_; }
  /// @}
  /// The limit; infinite if there is none.
  [[nodiscard]] double limit() const noexcept { return limit_; }
  /// Number of results that are not above the limit.
  [[nodiscard]] std::int64_t kept() const noexcept { return kept_; }

  /// The quantile: the value below which a share of all results lies, interpolated within a bin;
  /// zero without results.
  /// @param share 0 .. 1
  [[nodiscard]] double quantile(double share) const {
    double below = share * static_cast<double>(count_);
    for (const auto& [page, counts] : pages_) {
      for (std::size_t i = 0; i < counts.size(); ++i) {
        const auto here = static_cast<double>(counts[i]);
        if (here > 0.0 && below <= here) {
          const std::uint64_t first = (page << 52u) | (static_cast<std::uint64_t>(i) << 40u);
          const double low = number_of(first);
          const double high = number_of(first + ((std::uint64_t{1} << 40u) - 1u));
          const double inside = below > 0.0 ? below / here : 0.0;
          return std::fmin(std::fmax(low + (high - low) * inside, smallest_), largest_);
        }
        below -= here;
      }
    }
    return largest_;
  }

 private:
  /// Converts a number to bits that have the same order as whole numbers, and back.
  /// @{
  static std::uint64_t in_order(double value) noexcept {
    const auto bits = std::bit_cast<std::uint64_t>(value);
    return (bits & sign) != 0 ? ~bits : bits | sign;
  }
  static double number_of(std::uint64_t ordered) noexcept {
    return std::bit_cast<double>((ordered & sign) != 0 ? ordered & ~sign : ~ordered);
  }
  static constexpr std::uint64_t sign = std::uint64_t{1} << 63u;
  /// @}

  std::string name_;
  double limit_;
  std::int64_t count_ = 0;
  std::int64_t kept_ = 0;
  double mean_ = 0.0;
  double squares_ = 0.0;  ///< sum of squared differences to the mean
  double smallest_ = 0.0, largest_ = 0.0;
  std::int64_t run_of_smallest_ = 0, run_of_largest_ = 0;
  std::map<std::uint64_t, std::array<std::uint64_t, 4096>> pages_;  ///< bins by sign and exponent
};

}  // namespace esokit::sim
