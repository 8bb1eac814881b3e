/// @file
/// FixedRecord: a recorded design in counts, before it is in integers.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/error.hpp>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/linear_call.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

namespace esokit::detail {

/// What FixedDesign knows of a recorded design, and what it finds.
class FixedRecord {
 public:
  using Value = IntegerValue;

  /// @param given scales and order that settings of this design are to fit into, or null
  FixedRecord(const RecordedDesign& design, const FixedPointOptions& options,
              const FixedLayout* given = nullptr);
  /// @param others layouts of designs whose settings are to fit, too; none: as they are
  void make_room(const std::vector<FixedLayout>& others);
  FixedLayout layout{};

  Error<double> refusal{};

  IntegerList update{0};
  std::vector<int> next{};       ///< the line of the next word of each state
  std::vector<int> next_rest{};  ///< and of what is left over, or -1
  IntegerList law{0};
  int law_line = -1;
  int law_scale = 0;
  std::vector<FixedBound> estimates{};
  FixedBound input{};
  WrittenSystem written{};
  std::vector<double> box{};           ///< where a state is left after a gap, in counts of y
  std::vector<double> reach{};         ///< where it can be at all
  std::vector<std::size_t> numbers{};  ///< the number of the object of each state
  std::vector<std::size_t> first_of_level{};
  double lower = 0;  ///< of u, in counts
  double upper = 0;
  double rate = 0;  ///< counts a sample; 0: any

  [[nodiscard]] bool wraps() const { return wraps_; }
  [[nodiscard]] std::size_t states() const { return numbers.size(); }
  [[nodiscard]] const RecordedDesign& design() const { return *design_; }
  [[nodiscard]] const FixedPointOptions& options() const { return options_; }
  /// A count of u in counts of y.
  [[nodiscard]] double of_u() const { return options_.u.unit / options_.y.unit; }
  /// u of the start hold, in counts.
  [[nodiscard]] std::int64_t hold_counts() const {
    return static_cast<std::int64_t>(std::nearbyint(design_->loop.hold_input / options_.u.unit));
  }
  /// u before the first sample, in counts: as of the controller, that of the hold, or the nearest
  /// to zero within the limits.
  [[nodiscard]] std::int64_t start_held() const;
  [[nodiscard]] double reference_most() const {
    return wraps_ ? std::ldexp(1.0, options_.y.counter_bits - 1) : options_.y.most;
  }
  /// So many samples after the last measurement the next can still be used: one, if the design has
  /// no table of gains, because they would go on.
  [[nodiscard]] int table_rows() const;
  /// The correction so many samples after the last, in counts: states, y.
  [[nodiscard]] std::vector<LinearForm> correction_rows(int elapsed) const;
  /// A call as it moves the states, in counts: a row for each state, its columns states, arguments.
  [[nodiscard]] std::vector<LinearForm> rows_of(const char* name,
                                                const std::vector<double>& given) const;
  static constexpr double column = std::numeric_limits<double>::quiet_NaN();

 protected:
  static constexpr double fits = 2147400000.0;
  static constexpr std::int32_t most_gain = 32767;  ///< with 16 bits of anything in 32 bits
  static constexpr std::int32_t least_gain = 4096;
  static constexpr int fine_parts = 1000000;  ///< added to the owner of a sum

  [[nodiscard]] bool refuse(const char* field, double value, const char* rule, int index = -1);

  /// One that each design has.
  [[nodiscard]] const RecordedCall& called(const std::string& name) const {
    return *design_->called(name);
  }
  [[nodiscard]] LinearCall linear(const RecordedCall& call,
                                  const std::vector<double>& given) const {
    return {*design_, call, given};
  }

  bool checks();

  /// The linear part.
  bool takes_design();

  /// Sizes of the states by which the norm is taken: what y does to them in 20,000 samples.
  [[nodiscard]] std::vector<double> weights() const;

  static LinearForm unit(std::size_t i, std::size_t n);

  bool takes_limits();

  const RecordedDesign* design_;
  const FixedLayout* given_ = nullptr;
  FixedLayout room_{};         ///< what other settings need
  double gain_too_large_ = 0;  ///< times what its scale holds
  FixedPointOptions options_;
  bool wraps_;
  std::vector<double> exact_a_;
  std::vector<double> exact_by_;
  std::vector<double> exact_bu_;
  std::vector<double> plain_by_;  ///< for y itself, also of a counter that wraps
  std::vector<LinearForm> exact_estimates_;
  LinearForm exact_law_;
  std::vector<double> forced_;
  WorstCase worst_;
  std::map<int, int> coarser_;
  std::map<int, int> root_of_;
  std::map<int, int> narrow_scale_;
  std::map<int, int> left_over_scale_;
  std::vector<std::tuple<const IntegerList*, int, int>> narrow_lines_;
  std::vector<LinearForm> next_form_;
  std::vector<LinearForm> by_rounding_;
  std::vector<double> share_;
  std::vector<double> weights_;
  WorstCase plain_;  ///< of the design itself
  bool again_ = false;
  bool rounds_ = false;  ///< shifts round: a number more to add
  static constexpr int owner_of_narrow_ = 900000;
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/fixed_record.ipp>
#endif
