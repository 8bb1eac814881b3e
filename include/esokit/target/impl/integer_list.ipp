#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/core/language.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <string>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION std::size_t IntegerList::rounding(double low, double high) {
  roundings.push_back({low, high});
  return columns_ + roundings.size() - 1;
}

ESOKIT_FUNCTION IntegerValue IntegerList::note(IntegerOperation operation, int a, int b,
                                               std::int32_t constant, int scale,
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

ESOKIT_FUNCTION IntegerValue IntegerList::state(int number, int scale, int left_over,
                                                IntegerValue* remainder) {
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

ESOKIT_FUNCTION IntegerValue IntegerList::argument(int number, std::size_t column) {
  LinearForm form(columns_, 0.0);
  form[column] = 1;
  return note(IntegerOperation::argument, number, -1, 0, 0, form);
}

ESOKIT_FUNCTION IntegerValue IntegerList::sum(const IntegerValue& a, const IntegerValue& b,
                                              bool subtracts) {
  LinearForm form = a.form;
  if (form.size() < b.form.size()) form.resize(b.form.size(), 0.0);
  for (std::size_t i = 0; i < b.form.size(); ++i) form[i] += subtracts ? -b.form[i] : b.form[i];
  return note(subtracts ? IntegerOperation::subtract : IntegerOperation::add, a.line, b.line, 0,
              a.scale, form);
}

ESOKIT_FUNCTION IntegerValue IntegerList::times(const IntegerValue& a, std::int32_t factor,
                                                int scale) {
  const double by = std::ldexp(static_cast<double>(factor), a.scale - scale);
  return note(IntegerOperation::times, a.line, -1, factor, scale, scaled(a.form, by));
}

ESOKIT_FUNCTION IntegerValue IntegerList::times_high(const IntegerValue& a, std::int32_t factor,
                                                     int scale, bool rounds) {
  const LinearForm form =
      scaled(a.form, std::ldexp(static_cast<double>(factor), a.scale - 16 - scale));
  return rounds
             ? rounded(IntegerOperation::times_high_rounded, a.line, factor, scale, form, -0.5, 0.5)
             : rounded(IntegerOperation::times_high, a.line, factor, scale, form, -1, 0);
}

ESOKIT_FUNCTION IntegerValue IntegerList::to_scale(const IntegerValue& a, int scale, bool rounds) {
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

ESOKIT_FUNCTION void IntegerList::run(const std::vector<std::int64_t>& words,
                                      const std::vector<std::int64_t>& remainders,
                                      const std::vector<std::int64_t>& arguments,
                                      std::vector<std::int64_t>& results) const {
  results.assign(lines.size(), 0);
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
  }
}

ESOKIT_FUNCTION std::string IntegerList::in_c(const IntegerLine& one,
                                              const std::vector<std::string>& names,
                                              const std::string& setting) {
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
      return "(" + a + " + " + std::to_string(std::int64_t(1) << (one.constant - 1)) + ") >> " + c;
    case IntegerOperation::low_bits:
      return "(int32_t)((uint32_t)" + a + " & " +
             std::to_string((std::int64_t(1) << one.constant) - 1) + "u)";
    default:
      return "";
  }
}

ESOKIT_FUNCTION LinearForm IntegerList::scaled(const LinearForm& form, double by) {
  LinearForm result = form;
  for (double& x : result) x *= by;
  return result;
}

ESOKIT_FUNCTION IntegerValue IntegerList::rounded(IntegerOperation operation, int a,
                                                  std::int32_t constant, int scale, LinearForm form,
                                                  double low, double high) {
  const std::size_t before = lines.size();
  const double unit = std::ldexp(1.0, -scale);
  form.resize(columns_ + roundings.size() + 1, 0.0);
  form.back() = 1;
  IntegerValue value = note(operation, a, -1, constant, scale, form);
  if (lines.size() != before) (void)rounding(low * unit, high * unit);
  return value;
}

}  // namespace esokit::detail
