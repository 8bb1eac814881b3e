/// @file
/// What the runs of a MonteCarlo leave behind: one record for each block of runs, to be written to
/// a file, sent, joined and continued. The parts of a study may come from many processes and
/// machines; joined they give every figure as one process would, bit for bit.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/sim/statistics.hpp>
#include <istream>
#include <map>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace esokit::sim {

/// Part `index` of `count` equal parts of a study.
struct Part {
  std::int64_t index = 0;  ///< 0 .. count - 1
  std::int64_t count = 1;  ///< 1 or more

  /// From a text: `3/8` is part 3 of the parts 0 .. 7.
  /// @return the part, or an error of the field `part`
  static Expected<Part, Error<double>> parse(std::string_view text);

  /// Whether there is such a part.
  [[nodiscard]] Check<double> validate() const;
};

/// Number of runs in a block of a study with so many runs: 4096, or so many more (by powers of two)
/// that there are at most 4096 blocks. A study is cut at the ends of blocks only.
[[nodiscard]] constexpr std::int64_t runs_in_block(std::int64_t runs) noexcept {
  std::int64_t size = 4096;
  while ((runs - 1) / 4096 >= size) size *= 2;
  return size;
}

/// Number of blocks; none without runs.
[[nodiscard]] constexpr std::int64_t block_count(std::int64_t runs) noexcept {
  return runs > 0 ? (runs - 1) / runs_in_block(runs) + 1 : 0;
}

/// Number of runs of block 0, 1, ..: the last one may be short.
[[nodiscard]] constexpr std::int64_t runs_of_block(std::int64_t block, std::int64_t runs) noexcept {
  const std::int64_t size = runs_in_block(runs);
  return (std::min)(size, runs - block * size);
}

namespace detail {

/// FNV-1a of words of 64 bits.
class Hash {
 public:
  void add(std::uint64_t word) noexcept;
  void add(double number) noexcept { add(std::bit_cast<std::uint64_t>(number)); }
  void add(std::string_view text) noexcept;
  [[nodiscard]] std::uint64_t value() const noexcept { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325u;
};

}  // namespace detail

/// Tells machines apart that compute other bits: a hash of results of this C library's exp, sin, ..
/// and of a product and sum that a compiler or processor may fuse.
[[nodiscard]] inline std::uint64_t machine_probe() {
  detail::Hash hash;
  for (int i = 1; i <= 64; ++i) {
    volatile double hidden = 0.37 * i - 9.0;  // so that the compiler does not compute them
    const double x = hidden;
    for (const double y :
         {std::exp(x), std::sin(10.0 * x), std::cos(x), std::tanh(x), std::log((std::abs)(x) + 0.1),
          std::pow((std::abs)(x) + 0.1, 0.3 * x), std::atan2(x, 1.7)}) {
      hash.add(y);
    }
    volatile double product = -x * x;
    hash.add(x * x + product);
  }
  return hash.value();
}

/// What records must have in common to be joined.
struct StudyIdentity {
  std::uint64_t study = 0;           ///< hash of settings, measures and results of the first runs
  std::uint64_t machine = 0;         ///< `machine_probe()`
  std::int64_t runs = 0;             ///< number of runs of the whole study
  std::uint64_t seed = 0;            ///< of its random numbers
  std::vector<std::string> names{};  ///< of the measures
  std::vector<double> limits{};      ///< of the measures

  /// Whether records of `other` may be joined to those of this study, else an error that says what
  /// differs, with the number of both: of `study` and `machine` the last six digits.
  [[nodiscard]] Check<double> validate(const StudyIdentity& other) const;

 private:
  static double last_digits(std::uint64_t hash) { return static_cast<double>(hash % 1'000'000); }
};

/// The results of a block of runs.
struct BlockRecord {
  std::int64_t block = 0;                ///< number of the block, 0, 1, ..
  std::vector<std::int64_t> failed{};    ///< numbers of the runs that failed, in order
  std::vector<RunStatistics> numbers{};  ///< of each measure

  /// Whether all results are equal.
  friend bool operator==(const BlockRecord&, const BlockRecord&) = default;
};

/// Records of a study, of some of its blocks or of all.
///
/// As text: for each block lines that begin with `esokit-runs` and what the study is, and end with
/// `end` and a hash. So texts of parts may be joined by `cat`, in any order. Numbers are written
/// bit by bit. What was cut off or changed in a file is left out (`damaged`), so its blocks are
/// missing and can be computed again.
class StudyRecords {
 public:
  /// No records yet. @param identity that of the study
  explicit StudyRecords(StudyIdentity identity = {}) : identity_(std::move(identity)) {}

  /// What the study is.
  [[nodiscard]] const StudyIdentity& identity() const noexcept { return identity_; }
  /// The records by block.
  [[nodiscard]] const std::map<std::int64_t, BlockRecord>& blocks() const noexcept {
    return blocks_;
  }
  /// Number of records in a text that were cut off or changed, and were left out.
  [[nodiscard]] int damaged() const noexcept { return damaged_; }

  /// Adds a record. One that is there already is kept once.
  /// @return an error if it is there with other results, if its block does not exist, or if it does
  ///         not have a result of each Measure for each run of the block that did not fail
  Check<double> add(BlockRecord record);

  /// Adds the records of another part of the same study; an error changes nothing.
  Check<double> add(const StudyRecords& other);

  /// The blocks of a part for which there is no record, or the error of the part.
  [[nodiscard]] Expected<std::vector<std::int64_t>, Error<double>> missing(const Part& part) const;
  /// The same of the whole study.
  [[nodiscard]] std::vector<std::int64_t> missing() const { return missing(Part{}).value(); }

  /// The lines of a record.
  void write(std::ostream& out, const BlockRecord& record) const;
  /// All of it.
  void write(std::ostream& out) const {
    for (const auto& [block, record] : blocks_) write(out, record);
  }

  /// Reads what `write` wrote, also several of it in sequence, perhaps cut off.
  /// @return the records (none, and no identity, if not one is whole), or an error if the text
  /// begins otherwise, if its records are of two studies, or if a block is there twice
  static Expected<StudyRecords, Error<double>> read(std::istream& in);

 private:
  static constexpr const char* first_words = "esokit-runs ";
  static constexpr double format = 2;  ///< 1: the study was named once, at the head of a file

  /// Adds a record of a text.
  Check<double> take(const StudyIdentity& of, BlockRecord&& record);

  /// Whether a record may be added.
  [[nodiscard]] Check<double> validate(const BlockRecord& record) const;

  static std::string hex(std::uint64_t word);
  static std::string hex(double number) { return hex(std::bit_cast<std::uint64_t>(number)); }
  static std::string in_a_line(std::string name);

  /// Takes the next word of a line.
  /// @{
  static std::string_view next_word(std::string_view& line);
  template <class Whole>
  static bool take(std::string_view& line, Whole& number, int base = 10);
  static bool take(std::string_view& line, double& number);
  /// @}

  static bool read_study(std::string_view line, StudyIdentity& of, double& version);
  static bool read_block(std::string_view line, BlockRecord& record, std::size_t& measures);
  static bool read_measure(std::string_view line, StudyIdentity& of, BlockRecord& record);
  static bool read_sums(std::string_view line, RunStatistics& number);
  static bool read_bins(std::string_view line, RunStatistics& number);

  StudyIdentity identity_;
  std::map<std::int64_t, BlockRecord> blocks_;
  int damaged_ = 0;
};

}  // namespace esokit::sim

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/sim/impl/study_records.ipp>
#endif
