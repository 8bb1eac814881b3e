#pragma once

#include <cmath>
#include <cstddef>
#include <esokit/target/detail/fixed_bounds.hpp>
#include <esokit/target/detail/integer_list.hpp>
#include <esokit/target/detail/linear_call.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/fixed_options.hpp>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION LinearCall::LinearCall(const RecordedCall& call, const std::vector<int>& state_of,
                                       const std::vector<double>& values, std::size_t states,
                                       const std::vector<double>& given,
                                       const std::vector<bool>& settings)
    : constant_(states + given.size()) {
  for (const Instruction& one : call.list.instructions) {
    LinearForm form(constant_ + 1, 0.0);
    bool fine = true;
    const auto part = [&](int i) -> const LinearForm& { return of[static_cast<std::size_t>(i)]; };
    const auto number = [&](int i) { return part(i)[constant_]; };
    const auto constant = [&](int i) { return i < 0 || is_constant(i); };
    const auto good = [&](int i) { return i < 0 || linear[static_cast<std::size_t>(i)]; };
    const bool linear_parts =
        one.operation == Operation::argument || (good(one.a) && good(one.b) && good(one.c));
    const auto mix = [&](double by_a, double by_b) {
      for (std::size_t i = 0; i <= constant_; ++i) {
        form[i] = by_a * part(one.a)[i] + by_b * part(one.b)[i];
      }
    };
    if (one.operation == Operation::constant) {
      form[constant_] = one.value;
    } else if (one.operation == Operation::argument) {
      const auto from = static_cast<std::size_t>(one.a);
      if (from >= values.size()) {
        const std::size_t argument = from - values.size();
        if (std::isnan(given[argument]))
          form[states + argument] = 1;
        else
          form[constant_] = given[argument];
      } else if (state_of[from] >= 0) {
        form[static_cast<std::size_t>(state_of[from])] = 1;
      } else {
        form[constant_] = values[from];
      }
    } else if (!linear_parts) {
      fine = false;
    } else {
      const bool all = constant(one.a) && constant(one.b) && constant(one.c);
      switch (one.operation) {
        case Operation::add:
          mix(1, 1);
          break;
        case Operation::subtract:
          mix(1, -1);
          break;
        case Operation::negate:
          for (std::size_t i = 0; i <= constant_; ++i) form[i] = -part(one.a)[i];
          break;
        case Operation::multiply:
          fine = constant(one.a) || constant(one.b);
          if (!fine) break;
          {
            const int by = constant(one.a) ? one.a : one.b;
            const int what = constant(one.a) ? one.b : one.a;
            for (std::size_t i = 0; i <= constant_; ++i) form[i] = number(by) * part(what)[i];
          }
          break;
        case Operation::divide:
          fine = constant(one.b);
          for (std::size_t i = 0; fine && i <= constant_; ++i) {
            form[i] = part(one.a)[i] / number(one.b);
          }
          break;
        case Operation::less:
          form[constant_] = number(one.a) < number(one.b);
          fine = all;
          break;
        case Operation::greater:
          form[constant_] = number(one.a) > number(one.b);
          fine = all;
          break;
        case Operation::at_most:
          form[constant_] = number(one.a) <= number(one.b);
          fine = all;
          break;
        case Operation::at_least:
          form[constant_] = number(one.a) >= number(one.b);
          fine = all;
          break;
        case Operation::finite:
          form[constant_] = 1;
          fine = all;
          break;
        case Operation::choose:
          fine = constant(one.a);
          if (fine) form = part(number(one.a) > 0.5 ? one.b : one.c);
          break;
        default:
          fine = false;
      }
    }
    bool changes = false;
    if (one.operation == Operation::argument) {
      changes = static_cast<std::size_t>(one.a) < settings.size() &&
                settings[static_cast<std::size_t>(one.a)];
    } else if (one.operation != Operation::constant) {
      for (const int i : {one.a, one.b, one.c}) {
        changes = changes || (i >= 0 && varies[static_cast<std::size_t>(i)]);
      }
    }
    of.push_back(form);
    linear.push_back(fine);
    varies.push_back(changes);
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
