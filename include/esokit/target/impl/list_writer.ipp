#pragma once

#include <cmath>
#include <cstddef>
#include <cstdio>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/recorder.hpp>
#include <string>
#include <vector>

namespace esokit::detail {

ESOKIT_FUNCTION std::string filled(std::string text, const Words& words) {
  for (const auto& [key, word] : words) {
    for (std::size_t at = 0; (at = text.find(key, at)) != std::string::npos; at += word.size()) {
      text.replace(at, key.size(), word);
    }
  }
  return text;
}

ESOKIT_FUNCTION std::string ListWriter::number(double value) const {
  char digits[40];
  std::snprintf(digits, sizeof digits, single_ ? "%.9g" : "%.17g", value);
  std::string text = digits;
  const std::size_t power = text.find('e');
  if (power != std::string::npos) {
    if (text.find('.') == std::string::npos) text.insert(power, ".0");
  } else if (text.find('.') == std::string::npos) {
    text += ".0";
  }
  return text + language_->number_suffix[single_ ? 1 : 0];
}

ESOKIT_FUNCTION std::vector<bool> ListWriter::needed(const RecordedCall& call) const {
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

ESOKIT_FUNCTION void ListWriter::find_live(const RecordedObject& all) {
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

ESOKIT_FUNCTION WrittenCall ListWriter::written(const NamedCall& names,
                                                const RecordedCall& call) const {
  const auto& list = call.list.instructions;
  const auto need = needed(call);
  const std::vector<int> uses = counted(call, need);
  WrittenCall text;
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
        const bool setting = !settings.empty() && settings[from];
        text.reads.push_back(
            {of[i], language_->from_state + std::string(setting ? "settings->" : "") + of[i],
             false});
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
        filled(language_->of[static_cast<std::size_t>(one.operation)], {{"$f", single_ ? "f" : ""},
                                                                        {"$a", part(one.a)},
                                                                        {"$b", part(one.b)},
                                                                        {"$c", part(one.c)}});
    if (uses[i] == 1 && deep < 4 && one.operation != Operation::choose) {
      of[i] = "(" + expression + ")";
      depth[i] = deep;
      continue;
    }
    for (std::size_t m = 0; m < live.size() && of[i].empty(); ++m) {
      if (live[m] && call.next[m] == static_cast<int>(i)) of[i] = members[m] + "_next";
    }
    if (of[i].empty()) of[i] = "t" + std::to_string(++temporaries);
    text.lines.push_back({of[i], expression, is_condition(one.operation)});
  }
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (!given[i]) text.unused.push_back(names.arguments[i]);
  }
  const auto at = [&](int index) { return of[static_cast<std::size_t>(index)]; };
  std::vector<bool> checked(list.size(), false);
  for (const int check : call.list.checks) {
    const auto index = static_cast<std::size_t>(check);
    if (!checked[index]) text.checks.push_back(of[index]);
    checked[index] = true;
  }
  for (std::size_t i = 0; i < live.size(); ++i) {
    if (live[i] && call.next[i] >= 0) text.results.emplace_back(members[i], at(call.next[i]));
  }
  for (const int output : call.outputs) text.output = at(output);
  return text;
}

ESOKIT_FUNCTION std::vector<int> ListWriter::counted(const RecordedCall& call,
                                                     const std::vector<bool>& need) const {
  const auto& list = call.list.instructions;
  std::vector<int> uses(list.size(), 0);
  const auto use = [&](int index, int times) {
    if (index >= 0) uses[static_cast<std::size_t>(index)] += times;
  };
  for (std::size_t i = 0; i < list.size(); ++i) {
    if (!need[i] || list[i].operation == Operation::argument) continue;
    // What is chosen from has names: MISRA 12.1.
    const int times = list[i].operation == Operation::choose ? 2 : 1;
    use(list[i].a, 1);
    use(list[i].b, times);
    use(list[i].c, times);
  }
  for (const int output : call.outputs) use(output, 2);
  for (std::size_t i = 0; i < live.size(); ++i) {
    if (live[i]) use(call.next[i], 2);
  }
  return uses;
}

}  // namespace esokit::detail
