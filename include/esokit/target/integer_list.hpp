/// @file
/// IntegerList: operations on 32-bit integers, with what each means in exact numbers and how far it
/// can be from it. The text of the target and the bounds come from the same list.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
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
  [[nodiscard]] std::size_t rounding(double low, double high) {
    roundings.push_back({low, high});
    return columns_ + roundings.size() - 1;
  }

  IntegerValue note(IntegerOperation operation, int a, int b, std::int32_t constant, int scale,
                    const LinearForm& form) {
    for (std::size_t i = 0; i < lines.size(); ++i) {  // once is enough
      const IntegerLine& one = lines[i];
      if (one.operation == operation && one.a == a && one.b == b && one.constant == constant &&
          one.scale == scale && one.setting == setting) {
        return {static_cast<int>(i), scale, one.form};
      }
    }
    lines.push_back({operation, a, b, constant, scale, form, owner, setting});
    return {static_cast<int>(lines.size()) - 1, scale, form};
  }

  /// A word of the object; `left_over` bits of it are kept apart.
  IntegerValue state(int number, int scale, int left_over, IntegerValue* remainder) {
    LinearForm form(columns_, 0.0);
    form[static_cast<std::size_t>(number)] = 1;
    if (left_over == 0) return note(IntegerOperation::state, number, -1, 0, scale, form);
    const std::size_t at = rounding(-std::ldexp(1.0, -scale), 0);
    LinearForm rest(at + 1, 0.0);
    rest[at] = -1;
    form.resize(at + 1, 0.0);
    form[at] = 1;
    *remainder = note(IntegerOperation::remainder, number, -1, 0, scale + left_over, rest);
    return note(IntegerOperation::state, number, -1, 0, scale, form);
  }

  IntegerValue argument(int number, std::size_t column) {
    LinearForm form(columns_, 0.0);
    form[column] = 1;
    return note(IntegerOperation::argument, number, -1, 0, 0, form);
  }

  /// a + b or a - b; the same scale.
  IntegerValue sum(const IntegerValue& a, const IntegerValue& b, bool subtracts) {
    LinearForm form = a.form;
    if (form.size() < b.form.size()) form.resize(b.form.size(), 0.0);
    for (std::size_t i = 0; i < b.form.size(); ++i) form[i] += subtracts ? -b.form[i] : b.form[i];
    return note(subtracts ? IntegerOperation::subtract : IntegerOperation::add, a.line, b.line, 0,
                a.scale, form);
  }

  /// a times an integer, exactly: the same scale.
  IntegerValue times(const IntegerValue& a, std::int32_t factor, int scale) {
    const double by = std::ldexp(static_cast<double>(factor), a.scale - scale);
    return note(IntegerOperation::times, a.line, -1, factor, scale, scaled(a.form, by));
  }

  /// a times factor by 2^16.
  IntegerValue times_high(const IntegerValue& a, std::int32_t factor, int scale, bool rounds) {
    const LinearForm form =
        scaled(a.form, std::ldexp(static_cast<double>(factor), a.scale - 16 - scale));
    return rounds ? rounded(IntegerOperation::times_high_rounded, a.line, factor, scale, form, -0.5,
                            0.5)
                  : rounded(IntegerOperation::times_high, a.line, factor, scale, form, -1, 0);
  }

  /// To a coarser or finer scale. @param rounds else towards minus infinity
  IntegerValue to_scale(const IntegerValue& a, int scale, bool rounds) {
    if (scale == a.scale) return a;
    if (scale > a.scale) {
      const int up = scale - a.scale;
      return up > 30 ? to_scale(times(a, 1 << 30, a.scale + 30), scale, rounds)
                     : times(a, std::int32_t(1) << up, scale);
    }
    const int down = a.scale - scale;
    if (down > 30) return to_scale(to_scale(a, a.scale - 30, false), scale, rounds);
    return rounds ? rounded(IntegerOperation::round_down, a.line, down, scale, a.form, -0.5, 0.5)
                  : rounded(IntegerOperation::shift_down, a.line, down, scale, a.form, -1, 0);
  }

  /// What to_scale without rounding leaves over.
  IntegerValue low_bits(const IntegerValue& a, int bits) {
    return note(IntegerOperation::low_bits, a.line, -1, bits, a.scale, LinearForm(columns_, 0.0));
  }

  /// The results for given words, remainders and arguments; each in 64 bits, which no list reaches.
  /// @return whether all fit into 32 bits
  bool run(const std::vector<std::int64_t>& words, const std::vector<std::int64_t>& remainders,
           const std::vector<std::int64_t>& arguments, std::vector<std::int64_t>& results) const {
    results.assign(lines.size(), 0);
    bool fits = true;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const IntegerLine& one = lines[i];
      const auto number = static_cast<std::size_t>(one.a);
      const std::int64_t c = one.constant;
      const auto b = [&] { return results[static_cast<std::size_t>(one.b)]; };
      const auto a = [&] { return results[number]; };
      const auto floored = [](std::int64_t x, std::int64_t bits) {
        const std::int64_t by = std::int64_t(1) << bits;
        return x >= 0 ? x / by : -((-x + by - 1) / by);
      };
      std::int64_t& to = results[i];
      switch (one.operation) {
        case IntegerOperation::state:
          to = words[number];
          break;
        case IntegerOperation::remainder:
          to = remainders[number];
          break;
        case IntegerOperation::argument:
          to = arguments[number];
          break;
        case IntegerOperation::add:
          to = a() + b();
          break;
        case IntegerOperation::subtract:
          to = a() - b();
          break;
        case IntegerOperation::times:
          to = a() * c;
          break;
        case IntegerOperation::times_high:
          to = floored(a() * c, 16);
          break;
        case IntegerOperation::times_high_rounded:
          to = floored(a() * c + 32768, 16);
          break;
        case IntegerOperation::shift_down:
          to = floored(a(), c);
          break;
        case IntegerOperation::round_down:
          to = floored(a() + (std::int64_t(1) << (c - 1)), c);
          break;
        case IntegerOperation::low_bits:
          to = a() - floored(a(), c) * (std::int64_t(1) << c);
          break;
      }
      fits = fits && -2147483647 <= to && to <= 2147483647;
    }
    return fits;
  }

  /// A line as an expression of C. @param setting what holds its constant, if it is one
  [[nodiscard]] static std::string in_c(const IntegerLine& one,
                                        const std::vector<std::string>& names,
                                        const std::string& setting = "") {
    const std::string a = one.a >= 0 && static_cast<std::size_t>(one.a) < names.size()
                              ? names[static_cast<std::size_t>(one.a)]
                              : "";
    const std::string c = setting.empty() ? std::to_string(one.constant) : setting;
    switch (one.operation) {
      case IntegerOperation::add:
        return a + " + " + names[static_cast<std::size_t>(one.b)];
      case IntegerOperation::subtract:
        return a + " - " + names[static_cast<std::size_t>(one.b)];
      case IntegerOperation::times:
        return a + " * " + c;
      case IntegerOperation::times_high:
      case IntegerOperation::times_high_rounded: {
        const std::string low = "((uint32_t)(uint16_t)" + a + " * " +
                                (setting.empty() ? c + "u" : "(uint32_t)" + c) + ")";
        return "((int32_t)(int16_t)(" + a + " >> 16) * " + c + ") +\n      (int32_t)(" +
               (one.operation == IntegerOperation::times_high ? low : "(" + low + " + 32768u)") +
               " >> 16)";
      }
      case IntegerOperation::shift_down:
        return a + " >> " + c;
      case IntegerOperation::round_down:
        return "(" + a + " + " + std::to_string(std::int64_t(1) << (one.constant - 1)) + ") >> " +
               c;
      case IntegerOperation::low_bits:
        return "(int32_t)((uint32_t)" + a + " & " +
               std::to_string((std::int64_t(1) << one.constant) - 1) + "u)";
      default:
        return "";
    }
  }

 private:
  static LinearForm scaled(const LinearForm& form, double by) {
    LinearForm result = form;
    for (double& x : result) x *= by;
    return result;
  }

  IntegerValue rounded(IntegerOperation operation, int a, std::int32_t constant, int scale,
                       LinearForm form, double low, double high) {
    const std::size_t before = lines.size();
    const double unit = std::ldexp(1.0, -scale);
    form.resize(columns_ + roundings.size() + 1, 0.0);
    form.back() = 1;
    IntegerValue value = note(operation, a, -1, constant, scale, form);
    if (lines.size() != before) (void)rounding(low * unit, high * unit);
    return value;
  }

  std::size_t columns_;
};

}  // namespace esokit::detail
