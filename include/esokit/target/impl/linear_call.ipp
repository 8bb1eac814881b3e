#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/linear_call.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/fixed_options.hpp>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION LinearCall::LinearCall(const RecordedDesign& design, const RecordedCall& call,
                                       const std::vector<double>& given)
    : constant_(design.states().size() + given.size()) {
  const auto states = design.states();
  const auto of_argument = [&](std::size_t from, LinearForm& form) {
    const auto state = std::find(states.begin(), states.end(), from);
    if (from >= design.numbers.size()) {
      const std::size_t argument = from - design.numbers.size();
      const bool is_column = std::isnan(given[argument]);
      form[is_column ? states.size() + argument : constant_] = is_column ? 1 : given[argument];
    } else if (state != states.end()) {
      form[static_cast<std::size_t>(state - states.begin())] = 1;
    } else {
      form[constant_] = design.numbers[from];
    }
  };
  for (const Instruction& one : call.list.instructions) {
    LinearForm form(constant_ + 1, 0.0);
    bool is_linear = true, changes = false;
    if (one.operation == Operation::constant) {
      form[constant_] = one.value;
    } else if (one.operation == Operation::argument) {
      const auto from = static_cast<std::size_t>(one.a);
      of_argument(from, form);
      changes = from < design.settings.size() && design.settings[from];
    } else {
      is_linear = combine(one, form);
      for (const int i : {one.a, one.b, one.c}) {
        changes = changes || (i >= 0 && varies[static_cast<std::size_t>(i)]);
      }
    }
    of.push_back(form);
    linear.push_back(is_linear);
    varies.push_back(changes);
  }
}

ESOKIT_FUNCTION bool LinearCall::combine(const Instruction& one, LinearForm& form) const {
  bool all = true;  // are constants
  for (const int i : {one.a, one.b, one.c}) {
    if (i >= 0 && !linear[static_cast<std::size_t>(i)]) return false;
    all = all && (i < 0 || is_constant(i));
  }
  const auto part = [&](int i) -> const LinearForm& { return of[static_cast<std::size_t>(i)]; };
  const auto each = [&](const auto& of_place) {
    for (std::size_t i = 0; i <= constant_; ++i) form[i] = of_place(i);
    return true;
  };
  const auto is = [&](bool holds) {
    form[constant_] = holds;
    return all;
  };
  switch (one.operation) {
    case Operation::add:
      return each([&](std::size_t i) { return part(one.a)[i] + part(one.b)[i]; });
    case Operation::subtract:
      return each([&](std::size_t i) { return part(one.a)[i] - part(one.b)[i]; });
    case Operation::negate:
      return each([&](std::size_t i) { return -part(one.a)[i]; });
    case Operation::multiply: {
      const bool by_first = is_constant(one.a);
      const int by = by_first ? one.a : one.b, what = by_first ? one.b : one.a;
      return is_constant(by) && each([&](std::size_t i) { return number(by) * part(what)[i]; });
    }
    case Operation::divide:
      return is_constant(one.b) &&
             each([&](std::size_t i) { return part(one.a)[i] / number(one.b); });
    case Operation::less:
      return is(number(one.a) < number(one.b));
    case Operation::greater:
      return is(number(one.a) > number(one.b));
    case Operation::at_most:
      return is(number(one.a) <= number(one.b));
    case Operation::at_least:
      return is(number(one.a) >= number(one.b));
    case Operation::finite:
      return is(true);
    case Operation::choose:
      if (!is_constant(one.a)) return false;
      form = part(number(one.a) > 0.5 ? one.b : one.c);
      return true;
    default:
      return false;
  }
}

ESOKIT_FUNCTION bool LinearCall::is_constant(int i) const {
  const LinearForm& form = of[static_cast<std::size_t>(i)];
  for (std::size_t k = 0; k < constant_; ++k) {
    if (std::fabs(form[k]) > 0) return false;
  }
  return linear[static_cast<std::size_t>(i)];
}

}  // namespace esokit::detail
