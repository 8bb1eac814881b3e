#pragma once

#include <algorithm>
#include <cstddef>
#include <esokit/core/expected.hpp>
#include <esokit/target/detail/record_access.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/detail/writable.hpp>
#include <esokit/target/detail/written_names.hpp>
#include <esokit/target/recorder.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION int note_call(RecordedDesign& design, std::string_view name,
                              std::string_view arguments, bool has_output) {
  std::vector<std::string> names;
  while (!arguments.empty()) {
    names.emplace_back(arguments.substr(0, arguments.find(' ')));
    arguments.remove_prefix((std::min)(arguments.size(), names.back().size() + 1));
  }
  const int count = static_cast<int>(names.size());
  design.names.push_back({std::string(name), std::move(names), has_output});
  return count;
}

ESOKIT_FUNCTION bool name_number(RecordedDesign& design, std::string name, int level, int row,
                                 bool first, int published, const char* setting) {
  if (level >= 0) {
    name = "z" + std::to_string(row + 1);
    if (level > 0) name += "_level" + std::to_string(level + 1);
    if (first) design.first_state = name;
  }
  if (published >= 0) name = "published_" + std::to_string(published);
  const bool live = name[0] == 'z' || name[0] == 'p' || name == "u_applied" || name == "u_given" ||
                    name == "u_last" ||
                    (design.options.watched && (name == "innovation" || name == "u_asked")) ||
                    (design.guard.on && name == "innovation");
  const std::string number = std::to_string(design.members.size());
  if (setting != nullptr && name.empty()) name = setting + number;
  design.members.push_back(name.empty() ? "x" + number : name);
  return live;
}

ESOKIT_FUNCTION bool take_angle(RecordedDesign& design) {
  for (std::size_t i = 0; i < design.names.size(); ++i) {
    if (design.names[i].name != "law") continue;
    auto& list = design.calls[i].list.instructions;
    const int of_call = static_cast<int>(design.members.size());
    int reference = -1;
    int difference = -1;
    for (std::size_t k = 0; k < list.size(); ++k) {
      const Instruction& one = list[k];
      const int at = static_cast<int>(k);
      if (one.operation == Operation::argument) {
        if (one.a == of_call) reference = at;
        continue;
      }
      if (reference < 0 || (one.a != reference && one.b != reference && one.c != reference)) {
        continue;
      }
      const bool subtracts = one.operation == Operation::subtract && one.a == reference &&
                             list[static_cast<std::size_t>(one.b)].operation == Operation::argument;
      if (!subtracts || difference >= 0) return false;
      difference = at;
    }
    if (difference < 0) return false;
    Instruction& one = list[static_cast<std::size_t>(difference)];
    design.wrap.angle =
        design.members[static_cast<std::size_t>(list[static_cast<std::size_t>(one.b)].a)];
    one = {.operation = Operation::argument, .a = of_call};
    design.names[i].arguments[0] = "error";
  }
  return true;
}

}  // namespace detail
}  // namespace esokit
