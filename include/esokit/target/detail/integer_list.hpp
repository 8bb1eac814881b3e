/// @file
/// IntegerList: operations on 32-bit integers, with what each means in exact numbers and how far it
/// can be from it. The text of the target and the bounds come from the same list.
#pragma once

#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/language.hpp>
#include <string>
#include <vector>

namespace esokit::detail {

/// What an IntegerLine computes from earlier lines a and b.
enum class IntegerOperation : unsigned char {
  state,               ///< word number a of the object
  remainder,           ///< what was left over of that word, at its finer scale
  argument,            ///< argument number a
  add,                 ///< a + b
  subtract,            ///< a - b
  times,               ///< a times the constant
  times_high,          ///< a times the constant by 2^16, towards minus infinity
  times_high_rounded,  ///< the same, rounded
  shift_down,          ///< a by 2^constant, towards minus infinity
  round_down,          ///< a by 2^constant, rounded
  low_bits             ///< what shift_down left over
};

/// A linear form: a number for each state, then for each input, then for each rounding.
using LinearForm = std::vector<double>;

/// One line: an integer that stands for `form` in 2^-scale.
struct IntegerLine {
  IntegerOperation operation;
  int a = -1;
  int b = -1;
  std::int32_t constant = 0;
  int scale = 0;
  LinearForm form{};
  int owner = -1;    ///< whose scale has to be coarser if it does not fit
  int setting = -1;  ///< the constant may be changed while it runs: which of those it is
};

/// A line seen with another scale: an integer times a power of two costs nothing.
struct IntegerValue {
  int line = -1;
  int scale = 0;
  LinearForm form{};
};

/// A rounding: it adds a number within low .. high.
struct Rounding {
  double low = 0;
  double high = 0;
};

/// Lines, built one after the other.
class IntegerList {
 public:
  explicit IntegerList(std::size_t columns) : columns_(columns) {}

  std::vector<IntegerLine> lines{};
  std::vector<Rounding> roundings{};
  int owner = -1;    ///< of the lines that follow
  int setting = -1;  ///< of the lines that follow

  [[nodiscard]] std::size_t columns() const { return columns_; }

  /// A column for a rounding error.
  [[nodiscard]] std::size_t rounding(double low, double high);

  IntegerValue note(IntegerOperation operation, int a, int b, std::int32_t constant, int scale,
                    const LinearForm& form);

  /// A word of the object; `left_over` bits of it are kept apart.
  IntegerValue state(int number, int scale, int left_over, IntegerValue* remainder);

  IntegerValue argument(int number, std::size_t column);

  /// a + b or a - b; the same scale.
  IntegerValue sum(const IntegerValue& a, const IntegerValue& b, bool subtracts);

  /// a times an integer, exactly: the same scale.
  IntegerValue times(const IntegerValue& a, std::int32_t factor, int scale);

  /// a times factor by 2^16.
  IntegerValue times_high(const IntegerValue& a, std::int32_t factor, int scale, bool rounds);

  /// To a coarser or finer scale. @param rounds else towards minus infinity
  IntegerValue to_scale(const IntegerValue& a, int scale, bool rounds);

  /// What to_scale without rounding leaves over.
  IntegerValue low_bits(const IntegerValue& a, int bits) {
    return note(IntegerOperation::low_bits, a.line, -1, bits, a.scale, LinearForm(columns_, 0.0));
  }

  /// The results for given words, remainders and arguments; each in 64 bits, which no list reaches.
  void run(const std::vector<std::int64_t>& words, const std::vector<std::int64_t>& remainders,
           const std::vector<std::int64_t>& arguments, std::vector<std::int64_t>& results) const;

  /// A line as an expression of C. @param setting what holds its constant, if it is one
  [[nodiscard]] static std::string in_c(const IntegerLine& one,
                                        const std::vector<std::string>& names,
                                        const std::string& setting = "");

 private:
  static LinearForm scaled(const LinearForm& form, double by);

  IntegerValue rounded(IntegerOperation operation, int a, std::int32_t constant, int scale,
                       LinearForm form, double low, double high);

  std::size_t columns_;
};

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/integer_list.ipp>
#endif
