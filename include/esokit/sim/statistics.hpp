/// @file
/// Statistics of a result over many runs, in memory that does not grow with the number of runs.
/// Those of consecutive blocks of runs can be joined.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/language.hpp>
#include <limits>
#include <map>
#include <string>
#include <utility>

namespace esokit::sim {

/// Sums of a result over consecutive runs.
struct RunSums {
  std::int64_t count = 0;            ///< number of results
  std::int64_t kept = 0;             ///< number of results that are not above the limit
  double mean = 0.0;                 ///< their mean
  double squares = 0.0;              ///< sum of squared differences to the mean
  double smallest = 0.0;             ///< the smallest result
  double largest = 0.0;              ///< the largest result
  std::int64_t run_of_smallest = 0;  ///< the first run that had the smallest
  std::int64_t run_of_largest = 0;   ///< the first run that had the largest

  /// Adds a result. @param value finite
  void add(std::int64_t run, double value, double limit) noexcept;

  /// Adds the sums of later runs (T. Chan, G. Golub, R. LeVeque, 1979). The last digits depend on
  /// where the runs were cut.
  void join(const RunSums& later) noexcept;

  /// Whether all are equal.
  friend bool operator==(const RunSums&, const RunSums&) = default;
};

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
  void add(std::int64_t run, double value);

  /// Adds the results of later runs.
  void join(const RunStatistics& later);

  /// Name of the result.
  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Number of results.
  [[nodiscard]] std::int64_t count() const noexcept { return sums_.count; }
  /// Mean; zero without results.
  [[nodiscard]] double mean() const noexcept { return sums_.mean; }
  /// Standard deviation, with count - 1 as divisor; zero for one result.
  [[nodiscard]] double deviation() const noexcept {
    return sums_.count > 1 ? std::sqrt(sums_.squares / static_cast<double>(sums_.count - 1)) : 0.0;
  }
  /// The extremes, and the first run that had them; zero without results.
  /// @{
  [[nodiscard]] double smallest() const noexcept { return sums_.smallest; }
  [[nodiscard]] double largest() const noexcept { return sums_.largest; }
  [[nodiscard]] std::int64_t run_of_smallest() const noexcept { return sums_.run_of_smallest; }
  [[nodiscard]] std::int64_t run_of_largest() const noexcept { return sums_.run_of_largest; }
  /// @}
  /// The limit; infinite if there is none.
  [[nodiscard]] double limit() const noexcept { return limit_; }
  /// Number of results that are not above the limit.
  [[nodiscard]] std::int64_t kept() const noexcept { return sums_.kept; }
  /// All sums.
  [[nodiscard]] const RunSums& sums() const noexcept { return sums_; }

  /// Calls f(bin, count) for each bin that is not empty, from the least results to the largest.
  /// @param f (std::uint64_t, std::uint64_t)
  template <class F>
  void each_bin(F&& f) const {
    for (const auto& [page, counts] : pages_) {
      for (std::size_t i = 0; i < counts.size(); ++i) {
        if (counts[i] != 0) f((page << 12u) | i, counts[i]);
      }
    }
  }
  /// Puts back what `sums` and `each_bin` gave, into statistics without results.
  /// @{
  void set_sums(const RunSums& sums) noexcept { sums_ = sums; }
  void set_bin(std::uint64_t number, std::uint64_t results) { bin(number) = results; }
  /// @}

  /// Whether name, limit, sums and bins are equal.
  friend bool operator==(const RunStatistics&, const RunStatistics&) = default;

  /// The quantile: the value below which a share of all results lies, interpolated within a bin;
  /// zero without results.
  /// @param share 0 .. 1
  [[nodiscard]] double quantile(double share) const;

 private:
  std::uint64_t& bin(std::uint64_t number) {
    return pages_[number >> 12u][static_cast<std::size_t>(number & 4095u)];
  }
  /// Converts a number to bits that have the same order as whole numbers, and back.
  /// @{
  static std::uint64_t in_order(double value) noexcept;
  static double number_of(std::uint64_t ordered) noexcept {
    return std::bit_cast<double>((ordered & sign) != 0 ? ordered & ~sign : ~ordered);
  }
  static constexpr std::uint64_t sign = std::uint64_t{1} << 63u;
  /// @}

  std::string name_;
  double limit_;
  RunSums sums_;
  std::map<std::uint64_t, std::array<std::uint64_t, 4096>> pages_;  ///< bins by sign and exponent
};

}  // namespace esokit::sim

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/sim/impl/statistics.ipp>
#endif
