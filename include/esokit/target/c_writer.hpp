/// @file
/// Recorded calls written as functions of C: the names and expressions of to_c.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <esokit/target/recorder.hpp>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// A function of the C file: a recorded call with names.
struct CFunction {
  std::string name;
  std::vector<std::string> arguments;
  bool has_output = false;  ///< it writes *u
};

/// Writes recorded calls as functions of C.
class CWriter {
 public:
  CWriter(bool single, std::string prefix) : single_(single), prefix_(std::move(prefix)) {}

  std::vector<std::string> members{};  ///< a name for each number of the object
  std::vector<bool> live{};            ///< the numbers that the state needs

  [[nodiscard]] std::string real() const { return single_ ? "float" : "double"; }
  /// The number, read back bit for bit.
  [[nodiscard]] std::string number(double value) const {
    char digits[40];
    std::snprintf(digits, sizeof digits, single_ ? "%.9g" : "%.17g", value);
    std::string text = digits;
    if (text.find_first_of(".e") == std::string::npos) text += ".0";
    return single_ ? text + "f" : text;
  }

  /// Which instructions are needed for checks, outputs and live numbers.
  [[nodiscard]] std::vector<bool> needed(const RecordedCall& call) const {
    std::vector<bool> need(call.list.instructions.size(), false);
    const auto want = [&](int index) {
      if (index >= 0) need[static_cast<std::size_t>(index)] = true;
    };
    for (const int check : call.list.checks) want(check);
    for (const int output : call.outputs) want(output);
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (live[i]) want(call.next[i]);
    }
    for (std::size_t i = need.size(); i-- > 0;) {  // operands come before
      const Instruction& one = call.list.instructions[i];
      if (!need[i] || one.operation == Operation::argument) continue;
      want(one.a);
      want(one.b);
      want(one.c);
    }
    return need;
  }

  /// Adds the numbers that the calls read to the live ones.
  void find_live(const RecordedObject& all) {
    for (bool grew = true; grew;) {
      grew = false;
      for (const auto& lists : all.calls) {
        const auto need = needed(lists[0]);
        for (std::size_t i = 0; i < need.size(); ++i) {
          const Instruction& one = lists[0].list.instructions[i];
          const auto from = static_cast<std::size_t>(one.a);
          if (!need[i] || one.operation != Operation::argument || from >= live.size()) continue;
          if (!live[from]) live[from] = grew = true;
        }
      }
    }
  }

  /// `static int name(state *o, arguments, *u)`: 1, or 0 if a check does not hold; then nothing has
  /// changed.
  [[nodiscard]] std::string function(const CFunction& names, const RecordedCall& call) const {
    const auto& list = call.list.instructions;
    const auto need = needed(call);
    std::string text = "static int " + names.name + "(" + prefix_ + "_state *o";
    for (const auto& argument : names.arguments) text += ", " + real() + " " + argument;
    if (names.has_output) text += ", " + real() + " *u_out";
    text += ")\n{\n";

    std::vector<int> uses(list.size(), 0);
    const auto use = [&](int index, int times) {
      if (index >= 0) uses[static_cast<std::size_t>(index)] += times;
    };
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (!need[i] || list[i].operation == Operation::argument) continue;
      use(list[i].a, 1);
      use(list[i].b, 1);
      use(list[i].c, 1);
    }
    for (const int output : call.outputs) use(output, 2);
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (live[i]) use(call.next[i], 2);
    }

    std::vector<std::string> of(list.size());
    std::vector<int> depth(list.size(), 0);
    std::vector<bool> given(names.arguments.size(), false);
    int temporaries = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Instruction& one = list[i];
      if (!need[i]) continue;
      if (one.operation == Operation::constant) {
        of[i] = number(one.value);
        if (std::signbit(one.value)) of[i] = "(" + of[i] + ")";
        continue;
      }
      if (one.operation == Operation::argument) {
        const auto from = static_cast<std::size_t>(one.a);
        if (from < members.size()) {
          of[i] = members[from];
          text += "  const " + real() + " " + of[i] + " = o->" + of[i] + ";\n";
        } else {
          of[i] = names.arguments[from - members.size()];
          given[from - members.size()] = true;
        }
        continue;
      }
      const auto part = [&](int index) {
        return index < 0 ? std::string() : of[static_cast<std::size_t>(index)];
      };
      int deep = 1;
      for (const int index : {one.a, one.b, one.c}) {
        if (index >= 0 && depth[static_cast<std::size_t>(index)] >= deep) {
          deep = depth[static_cast<std::size_t>(index)] + 1;
        }
      }
      const std::string expression =
          this->expression(one.operation, part(one.a), part(one.b), part(one.c));
      const bool in_place = uses[i] == 1 && deep < 4 && one.operation != Operation::choose;
      if (in_place) {
        of[i] = "(" + expression + ")";
        depth[i] = deep;
        continue;
      }
      for (std::size_t m = 0; m < live.size() && of[i].empty(); ++m) {
        if (live[m] && call.next[m] == static_cast<int>(i)) of[i] = members[m] + "_next";
      }
      if (of[i].empty()) of[i] = "t" + std::to_string(++temporaries);
      text += std::string("  const ") + (is_condition(one.operation) ? "int" : real()) + " " +
              of[i] + " = " + expression + ";\n";
    }
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (!given[i]) text += "  (void)" + names.arguments[i] + ";\n";
    }
    const auto at = [&](int index) { return of[static_cast<std::size_t>(index)]; };
    std::vector<bool> checked(list.size(), false);
    for (const int check : call.list.checks) {
      const auto index = static_cast<std::size_t>(check);
      if (!checked[index]) text += "  if (!" + of[index] + ") return 0;\n";
      checked[index] = true;
    }
    bool writes = false;
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (!live[i] || call.next[i] < 0) continue;
      text += "  o->" + members[i] + " = " + at(call.next[i]) + ";\n";
      writes = true;
    }
    if (!writes) text += "  (void)o;\n";
    for (const int output : call.outputs) text += "  *u_out = " + at(output) + ";\n";
    return text + "  return 1;\n}\n\n";
  }

 private:
  [[nodiscard]] std::string expression(Operation operation, const std::string& a,
                                       const std::string& b, const std::string& c) const {
    const auto called = [&](const char* name, const std::string& given) {
      return name + std::string(single_ ? "f(" : "(") + given + ")";
    };
    switch (operation) {
      case Operation::add:
        return a + " + " + b;
      case Operation::subtract:
        return a + " - " + b;
      case Operation::multiply:
        return a + " * " + b;
      case Operation::divide:
        return a + " / " + b;
      case Operation::negate:
        return "-" + a;
      case Operation::magnitude:
        return called("fabs", a);
      case Operation::square_root:
        return called("sqrt", a);
      case Operation::power:
        return called("pow", a + ", " + b);
      case Operation::exponential:
        return called("exp", a);
      case Operation::exponential_less_one:
        return called("expm1", a);
      case Operation::choose:
        return a + " ? " + b + " : " + c;
      case Operation::less:
        return a + " < " + b;
      case Operation::greater:
        return a + " > " + b;
      case Operation::at_most:
        return a + " <= " + b;
      case Operation::at_least:
        return a + " >= " + b;
      case Operation::finite:
        return "is_finite(" + a + ")";
      case Operation::both:
        return a + " && " + b;
      case Operation::either:
        return a + " || " + b;
      case Operation::opposite:
        return "!" + a;
      case Operation::constant:
      case Operation::argument:
        break;
    }
    return a;
  }

  bool single_;
  std::string prefix_;
};

/// Keys and what stands for them.
using Words = std::vector<std::pair<std::string, std::string>>;

/// `text` with each key replaced, in the order of the words.
inline std::string filled(std::string text, const Words& words) {
  for (const auto& [key, word] : words) {
    for (std::size_t at = 0; (at = text.find(key, at)) != std::string::npos; at += word.size()) {
      text.replace(at, key.size(), word);
    }
  }
  return text;
}

}  // namespace esokit::detail
