/// @file
/// The words that the texts of to_c need of a design: names, numbers, and what is written or not.
#pragma once

#include <algorithm>
#include <array>
#include <cctype>
#include <cstddef>
#include <esokit/target/c_adapter_text.hpp>
#include <esokit/target/c_text.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_numbers.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// What any text needs.
inline Words c_common_words(const ListWriter& writer, const CodeOptions& options) {
  std::string upper = options.name;
  for (char& c : upper) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return {{"$ZERO", writer.number(0)},
          {"$ONE", writer.number(1)},
          {"$word", writer.single() ? "uint32_t" : "uint64_t"},
          {"$exponent", writer.single() ? "0x7f800000u" : "0x7ff0000000000000u"},
          {"$fabs", writer.single() ? "fabsf" : "fabs"},
          {"$real", writer.real()},
          {"$NAME", upper},
          {"$name", options.name},
          // The last, so that no word in it is taken for a key.
          {"$COMMENT", options.comment.empty() ? "" : " * " + options.comment + "\n"}};
}

/// What is known is computed by functions of the C library, whose last bits are its own.
inline std::string c_library_calls(const RecordedDesign& design) {
  std::string names;
  for (int at = 0; design.known.on && at < static_cast<int>(c_language.of.size()); ++at) {
    const auto is_it = [at](const Instruction& one) {
      return static_cast<int>(one.operation) == at;
    };
    const bool used = static_cast<int>(Operation::power) <= at &&
                      at <= static_cast<int>(Operation::hyperbolic_tangent) &&
                      std::any_of(design.calls.begin(), design.calls.end(), [&](const auto& call) {
                        const auto& list = call.list.instructions;
                        return std::any_of(list.begin(), list.end(), is_it);
                      });
    if (!used) continue;
    const std::string call = c_language.of[static_cast<std::size_t>(at)];
    names += (names.empty() ? ",\n * where the C library has the same " : ", ") +
             call.substr(0, call.find('$')) + (design.single ? "f" : "");
  }
  return names;
}

/// Names and numbers of one measured disturbance: where there are several, w is w1, w2, ..
inline Words c_words_of_w(const MeasuredNumbers& measured, std::size_t at,
                          const ListWriter& writer) {
  const MeasuredPathNumbers& path = measured.paths[at];
  const auto pair = [&](const std::array<double, 2>& two) {
    return writer.number(two[0]) + ", " + writer.number(two[1]);
  };
  Words words = {{"$W_GAIN", writer.number(path.gain)},
                 {"$W_SHARE", pair(path.share)},
                 {"$W_LATE", pair(path.late)},
                 {"$W_REACHED", pair(path.reached)},
                 {"$W_NEWESTu", std::to_string(path.memory.size() - 1) + "u"},
                 {"$FOUR", writer.number(4 * static_cast<double>(measured.paths.size()))}};
  if (measured.paths.size() > 1) {
    const std::string w = "w" + std::to_string(at + 1);
    for (const auto& [before, after] : {std::pair{"takes_", "("},
                                        {"after_", "("},
                                        {"course_of_", "("},
                                        {"advance_", "("},
                                        {"settle_", "("},
                                        {"newest_", ""},
                                        {"o->", "["},
                                        {"", "_given"},
                                        {"", "_last"},
                                        {"", "_lagged"},
                                        {"", "_lost"}}) {
      const std::string begins = before;
      words.emplace_back(begins + "w" + after, begins + w + after);
    }
  }
  words.emplace_back("$RING", measured.paths.size() > 1 ? "w" + std::to_string(at + 1) : "w");
  return words;
}

/// The texts around it. @param settles whether there is a start
inline std::string c_measured(const RecordedDesign& design, const ListWriter& writer,
                              bool settles) {
  const MeasuredNumbers& measured = design.measured;
  const bool one = measured.paths.size() == 1;
  const std::string sign = design.error_based ? "-" : "";
  std::string paths;
  std::string give;
  std::string add;
  std::string advance;
  std::string settle;
  std::string settle_each;
  Words words;
  for (std::size_t at = 0; at < measured.paths.size(); ++at) {
    words = c_words_of_w(measured, at, writer);
    const std::string number = std::to_string(at + 1);
    paths += filled(c_source_measured, words);
    if (!one) {
      paths += filled(filled(c_source_measured_advance, {{"$W_SAMPLE", c_source_measured_sample}}),
                      words);
      give += "  o->w" + number + "_given = " + sign + "w[" + std::to_string(at) + "];\n";
      add += filled("  all = all + ($W_GAIN * course_of_w(o, &passed));\n", words);
      advance += "  advance_w" + number + "(o);\n";
      settle += "  settle_w" + number + "(o);\n";
    }
    settle_each += filled(c_source_measured_settle, words);
  }
  std::string text =
      paths +
      (one ? filled(std::string(c_source_measured_effect) + c_source_measured_sample, words)
           : c_source_measured_effects) +
      c_source_measured_tell;
  if (settles) text += "$W_UPDATE" + settle_each + (one ? "" : c_source_measured_settle_all);
  if (!settles) text += "$W_UPDATE";
  return filled(text, {{"$W_FORGET", one ? "  o->w_is_new = 0u;\n" : ""},
                       {"$W_TOLD", one ? "  o->w_told = effect_of_w(o);\n" : ""},
                       {"$W_GIVE", one ? "  o->w_given = " + sign + "w;\n" : give},
                       {"$W_ADD_ALL", add},
                       {"$W_ADVANCE_ALL", advance},
                       {"$W_SETTLE_ALL", settle}});
}

/// What the texts need of any design.
inline Words c_words(const RecordedDesign& design, const ListWriter& writer) {
  const std::string real = writer.real();
  std::string members;
  std::string init;
  const bool opens = design.options.settings_in_struct;
  if (opens) {
    members = "  const $name_settings *settings;\n";
    init = "  o->settings = &$name_$SET;\n";
  }
  std::string settings;
  for (std::size_t i = 0; i < design.members.size(); ++i) {
    if (!design.live[i]) continue;
    if (opens && design.settings[i]) {
      settings += "  " + real + " " + design.members[i] + ";\n";
      continue;
    }
    members += "  " + real + " " + design.members[i] + ";\n";
    init += "  o->" + design.members[i] + " = " + writer.number(design.numbers[i]) + ";\n";
  }
  for (std::size_t i = 0; i < design.line.size(); ++i) {
    init += "  o->line[" + std::to_string(i) + "] = " + writer.number(design.line[i]) + ";\n";
  }
  const std::string length = std::to_string(design.line.size());
  if (!design.line.empty()) {
    members += "  " + real + " line[" + length + "]; /* u, not yet acting */\n  uint16_t newest;\n";
    init += "  o->newest = " + std::to_string(design.line.size() - 1) + "u;\n";
  }
  const GateNumbers& gate = design.gate;
  const bool gated = gate.threshold > 0;
  if (gated) {
    members += "  " + real + " gate_mean; /* of abs(y - " + design.first_state + ") */\n" +
               "  uint16_t gate_count;\n  uint8_t gate_open;\n";
    init += "  o->gate_mean = " + writer.number(gate.mean) +
            ";\n  o->gate_count = " + std::to_string(gate.count) +
            "u;\n  o->gate_open = " + (gate.open ? "1u" : "0u") + ";\n";
  }
  const WrapNumbers& wrap = design.wrap;
  const std::string of_turns =
      "  " + real + " angle; /* the last y, within half a period of zero */\n  " + real +
      " turns;\n  " + real + " motion; /* of y in motion_samples */\n" +
      "  uint16_t motion_samples;\n  uint8_t gaps;\n  uint8_t doubts;\n  uint8_t begun;\n";
  if (wrap.period > 0) {
    const auto set = [&](const std::string& place, const TurnNumbers& count) {
      init += place + "angle = " + writer.number(count.y) + ";\n" + place +
              "turns = " + writer.number(count.turns) + ";\n" + place +
              "motion = " + writer.number(count.motion) + ";\n" + place +
              "motion_samples = " + std::to_string(count.samples) + "u;\n" + place +
              "gaps = " + std::to_string(count.gaps) + "u;\n" + place +
              "doubts = " + std::to_string(count.doubts) + "u;\n" + place +
              "begun = " + (count.begun ? "1u" : "0u") + ";\n";
    };
    if (wrap.gated) {
      members +=
          "  $name_turns taken; /* by the gate */\n  $name_turns heard; /* rejected, too */\n" +
          std::string(
              "  uint16_t heard_at; /* samples since one was taken, at the last one */\n"
              "  uint8_t heard_steady;\n  uint8_t heard_rejected;\n");
      set("  o->taken.", wrap.count);
      set("  o->heard.", wrap.heard);
      init += "  o->heard_at = " + std::to_string(wrap.heard_at) +
              "u;\n  o->heard_steady = " + std::to_string(wrap.heard_steady) +
              "u;\n  o->heard_rejected = " + std::to_string(wrap.heard_rejected) + "u;\n";
    } else {
      members += of_turns;
      set("  o->", wrap.count);
    }
  }
  const MeasuredNumbers& measured = design.measured;
  if (measured.on) {
    const bool one = measured.paths.size() == 1;
    const std::string told =
        "  " + real + " w_told; /* " + (one ? "its" : "their") + " part of the disturbance */\n";
    const std::string set_told = "  o->w_told = " + writer.number(measured.told) + ";\n";
    for (std::size_t w = 0; w < measured.paths.size(); ++w) {
      const MeasuredPathNumbers& path = measured.paths[w];
      std::string more = "  " + real + " $RING[" + std::to_string(path.memory.size()) +
                         "]; /* measured, a ring */\n  " + real +
                         " w_given; /* by $name_measured */\n  " + real +
                         " w_last; /* the last good one */\n  " + real +
                         " w_lagged; /* behind dead time and lag */\n" + (one ? told : "") +
                         "  uint32_t w_lost;\n  uint16_t newest_w;\n";
      std::string set;
      for (std::size_t i = 0; i < path.memory.size(); ++i) {
        set += "  o->w[" + std::to_string(i) + "] = " + writer.number(path.memory[i]) + ";\n";
      }
      set += "  o->w_given = $ZERO;\n  o->w_last = " + writer.number(path.last) +
             ";\n  o->w_lagged = " + writer.number(path.lagged) + ";\n" + (one ? set_told : "") +
             "  o->w_lost = " + std::to_string(path.lost) +
             "u;\n  o->newest_w = " + std::to_string(path.memory.size() - 1) + "u;\n";
      const Words numbered = c_words_of_w(measured, w, writer);
      members += filled(more, numbered);
      init += filled(set, numbered);
    }
    if (!one) {
      members += told;
      init += set_told;
    }
    members += "  uint8_t w_is_new;\n";
    init += "  o->w_is_new = 0u;\n";
  }
  const GuardNumbers& guard = design.guard;
  std::string found;
  std::string trusts;
  std::string leaks;
  std::string bounds;
  std::string standing;
  std::string stood;
  std::string rows_of_first;
  std::string rows_of_x;
  for (int row = 0; row < design.size; ++row) {
    rows_of_first += (row > 0 ? ", o->z" : "o->z") + std::to_string(row + 1);
    rows_of_x += ", x[" + std::to_string(row) + "]";
  }
  if (guard.on) {
    members += "  " + real + " trust; /* see $name_set_trust */\n";
    init += "  o->trust = " + writer.number(guard.trust) + ";\n";
    const auto also = [&](const char* name, double value) {
      members += "  " + real + " " + name + ";\n";
      init += std::string("  o->") + name + " = " + writer.number(value) + ";\n";
    };
    also("weight_up", guard.weight_up);
    also("weight_down", guard.weight_down);
    also("gain_ratio", guard.gain_ratio);
    also("told_ratio", guard.told_ratio);
    also("input_factor", guard.input_factor);
    const auto counts = [&](const char* type, const char* name, unsigned value) {
      members += std::string("  ") + type + " " + name + ";\n";
      init += std::string("  o->") + name + " = " + std::to_string(value) + "u;\n";
    };
    counts("uint32_t", "settling_left", guard.settling_left);
    counts("uint16_t", "release_left", guard.release_left);
    counts("uint8_t", "pin", guard.pin);
    counts("uint8_t", "side", guard.side);
    counts("uint8_t", "held", guard.held ? 1 : 0);
    counts("uint8_t", "unsettled", guard.unsettled ? 1 : 0);
    counts("uint8_t", "frozen", guard.frozen ? 1 : 0);
    counts("uint8_t", "gated", guard.gated ? 1 : 0);
    if (guard.bound > 0) {
      bounds = (guard.by_input
                    ? "  const $real bound = " + writer.number(guard.bound_as_given) +
                          " * $fabs($GAIN_OF_GUARD * o->gain_ratio);\n  $real most = $LARGEST;\n"
                    : "  const $real most = " + writer.number(guard.bound) + ";\n") +
               "  $real below = $ZERO;\n  $real sum;\n" +
               (guard.by_input
                    ? "  if ((bound > $ZERO) && is_finite(bound)) {\n    (void)scaled_bound(o, "
                      "bound, &most);\n    if (!is_finite(most)) {\n      most = "
                      "$LARGEST;\n    }\n  }\n"
                    : "");
    } else {
      bounds = "  (void)o;\n";
    }
    for (int level = 0; level < guard.levels; ++level) {
      const std::string d = "o->z" + std::to_string(design.order + 1) +
                            (level > 0 ? "_level" + std::to_string(level + 1) : std::string());
      const std::string before = "before[" + std::to_string(level) + "]";
      found += (level > 0 ? ", " : "") + d;
      trusts += "    moved = " + d + " - " + before + ";\n    " + d + " = " + before +
                " + (((moved > $ZERO) ? o->weight_up : o->weight_down) * moved);\n";
      standing += ", " + d;
      stood += ", " + before;
      if (guard.leak > 0)
        leaks += "    " + d + " = " + d + " - (" + writer.number(guard.leak) + " * " + d + ");\n";
      if (guard.bound > 0) {
        bounds += "  sum = below + " + d + ";\n  if ($fabs(sum) > most) {\n    " + d +
                  " = ((sum > $ZERO) ? most : -most) - below;\n  }\n";
        if (level + 1 < guard.levels) bounds += "  below = below + " + d + ";\n";
      }
    }
  }
  const LawNumbers& law = design.law;
  if (law.kind == RunningLaw::schedule) {
    members += "  uint32_t age; /* samples of the schedule */\n  uint8_t pending;\n" +
               std::string("  uint8_t settled;\n");
    init += "  o->age = " + std::to_string(law.age) +
            "u;\n  o->pending = " + (law.pending ? "1u" : "0u") +
            ";\n  o->settled = " + (law.settled ? "1u" : "0u") + ";\n";
  } else if (law.kind == RunningLaw::filter) {
    members += "  uint8_t since; /* the last step of the gain */\n";
    init += "  o->since = " + std::to_string(law.since) + "u;\n";
  }
  const bool runs = law.kind != RunningLaw::none;
  std::string table;
  std::string call_gains;
  for (const auto& gains : design.gap_gains) {
    std::string row;
    for (const double k : gains) row += (row.empty() ? "    {" : ", ") + writer.number(k);
    table += row + "},\n";
  }
  const std::string rows_of_table = std::to_string(design.max_gap + 1);
  std::string table_of_file;
  if (!runs) {
    const std::size_t count = design.gap_gains[0].size();
    for (std::size_t i = 0; i < count; ++i) call_gains += ", k[" + std::to_string(i) + "]";
    table = opens ? ""
                  : "  static const " + real + " gains[" + rows_of_table + "][" +
                        std::to_string(count) + "] = { /* after 1, 2, .. samples */\n" + table +
                        "  };\n";
    const bool shared = (guard.on && !opens) || design.predictive;  // by two functions
    if (shared) table_of_file.swap(table);
  }
  const std::string by_table = "correct_by(o, y" + call_gains + ")";
  const std::string corrects =
      law.kind == RunningLaw::schedule ? "(elapsed > 1u) ? correct_over(o, y, elapsed) : "
                                         "correct_step(o, y)"
      : runs                           ? "correct_step(o, y)"
      : design.gain_is_kept            ? by_table
                                       : "(elapsed > 1u) ? " + by_table + " : correct_step(o, y)";
  std::string accept;
  if (law.kind == RunningLaw::schedule) accept = "    o->pending = 0u;\n";
  if (law.kind == RunningLaw::filter) accept = "    o->since = (uint8_t)(o->since | 1u);\n";
  std::string blanked;
  std::string rows_of_published;
  if (law.kind == RunningLaw::schedule) {
    for (int row = 0; row < design.size; ++row) {
      const std::string number = std::to_string(row);
      rows_of_published +=
          "    case " + number + "u:\n      u = o->published_" + number + ";\n      break;\n";
    }
    blanked = "  if (o->age <= " + std::to_string(law.least_age) +
              "u) { /* too early: those of the start */\n    switch (row) {\n" + rows_of_published +
              "    default:\n      break;\n    }\n    return u;\n  }\n";
  }
  std::string rows;
  for (int row = 0; row < design.size; ++row) {
    const std::string number = std::to_string(row);
    rows += "  case " + number + "u:\n    (void)estimate_" + number + "(o, &u);\n    break;\n";
  }
  std::string vectors;
  for (const auto& [y, r, result] : design.samples) {
    vectors += "    {" + writer.number(y) + ", " + writer.number(r) + ", " + writer.number(result) +
               "},\n";
  }
  Words words = {
      {"$BOOL", opens || guard.on ? "$include <stdbool.h>\n" : ""},
      {"$include", "#include"},  // not written in the texts: scripts look for such lines
      {"$MEMBERS", members},
      {"$LIBRARY", c_library_calls(design)},
      {"$TIME", writer.number(design.sample_time)},
      {"$CORRECT", corrects},
      {"$KEEP_BOUND", bounds},
      {"$OF_MEASURED",
       measured.on
           ? "/* w, measured, before the sample at which it begins to act; without it, or if "
             "it is not finite,\n * the last good one counts for $W_MOST samples, then zero. "
             "*/\nvoid $name_measured($name_state *o, $W_ARGUMENT);\n\n"
           : ""},
      {"$W_ARGUMENT", measured.paths.size() > 1
                          ? "const $real w[" + std::to_string(measured.paths.size()) + "]"
                          : "$real w"},
      {"$W_MOST", std::to_string(measured.most_lost)},
      {"$SETTLE_W", measured.on && design.is_controller ? "  settle_w(o);\n" : ""},
      {"$OF_GUARD",
       guard.on ? "/* From the next correction on, those of the disturbance count so much, 0 .. 1. "
                  "*/\nvoid $name_set_trust($name_state *o, $real trust);\n\n"
                  "/* At which limit an actuator of unknown output is. */\n"
                  "#define $NAME_PIN_FREE 0u\n#define $NAME_PIN_UPPER 1u\n"
                  "#define $NAME_PIN_LOWER 2u\n#define $NAME_PIN_EITHER 3u /* by the sign of u */\n"
                  "void $name_set_pin($name_state *o, uint8_t where);\n\n$OF_HOLD$OF_GAIN"
                : ""},
      {"$OF_HOLD",
       design.is_controller
           ? "/* Instead of update, for a plant that something else holds under u: y is followed, "
             "the\n * disturbance stays; returns u. On release begin with the reference at y. */\n"
             "$real $name_hold($name_state *o, $real y, $HOLD_R$real u);\n\n"
           : "/* Something else holds the plant, until `release`; returns the u to give to the "
             "observer. */\n$real $name_hold($name_state *o);\nvoid $name_release($name_state "
             "*o);\n\n"},
      {"$HOLD_R", design.error_based ? "$real r, " : ""},
      {"$OF_GAIN", design.softens ? ""
                                  : "/* Another b0 from the next sample on; false, and nothing "
                                    "changes, if it has another sign\n * or is too far away. "
                                    "*/\nbool $name_set_input_gain($name_state *o, $real b);\n\n"},
      {"$B_SIGN", design.error_based ? "-" : ""},
      {"$SCALES", guard.by_input ? " &&\n    scale_found(o, ratio * o->input_factor)" : ""},
      {"$GAIN_OF_GUARD", writer.number(guard.gain)},
      {"$INVERSE_GAIN", writer.number(guard.inverse_gain)},
      {"$UP_SIDE", guard.gain > 0 ? "1" : "2"},
      {"$DOWN_SIDE", guard.gain > 0 ? "2" : "1"},
      {"$SETTLING", std::to_string(guard.settling_samples)},
      {"$RELEASE", std::to_string(guard.release_samples)},
      {"$ROWS_OF_FIRST", rows_of_first},
      {"$ROWS_OF_X", rows_of_x},
      {"$STANDING", standing},
      {"$STOOD", stood},
      {"$GAINS_BY_GAP", opens ? "o->settings->gains" : "gains"},
      {"$ORDER", std::to_string(design.order)},
      {"$LARGEST",
       writer.number(writer.single() ? static_cast<double>((std::numeric_limits<float>::max)())
                                     : (std::numeric_limits<double>::max)())},
      {"$TABLE_OF_FILE", table_of_file},
      {"$TRUST", trusts},
      {"$LEAK", leaks},
      {"$REFUSED", gated ? "($NAME_MEASUREMENT_REJECTED | $NAME_OUTLIER_REJECTED)"
                         : "$NAME_MEASUREMENT_REJECTED"},
      {"$FOUND", found},
      {"$LEVELS", std::to_string(guard.levels)},
      {"$SETTINGS", settings},
      {"$SIZE", std::to_string(runs ? 0 : design.gap_gains[0].size())},
      {"$ADOPT", opens ? c_header_adopt : ""},
      {"$TRACK", design.is_controller ? "    (void)applied(o, o->u_last);\n" : ""},
      {"$HOLDu", std::to_string(design.hold) + "u"},
      {"$TABLE", runs ? "" : table},
      {"$OF_TABLE", runs    ? ""
                    : opens ? "    const $real *k = o->settings->gains[elapsed - 1u];\n"
                            : "    const $real *k = gains[elapsed - 1u];\n"},
      {"$ACCEPT", accept},
      {"$LAW_BEGIN", runs ? "    law_begin(o);\n" : ""},
      {"$BLANKED", blanked},
      {"$TO_LIMIT", law.returns ? "  if (filter_to_limit(o)) {\n    o->since = 8u;\n  }\n" : ""},
      {"$LAW_STANDS", law.returns ? "10" : "0"},
      {"$DECAY", writer.number(law.decay)},
      {"$SHIFT", writer.number(law.shift)},
      {"$CONTRACTION", writer.number(law.contraction)},
      {"$STATES", std::to_string(design.size)},
      {"$STARTu", std::to_string(law.start) + "u"},
      {"$LEASTu", std::to_string(law.least_age) + "u"},
      {"$TURNS", wrap.gated ? "/* The count of the turns of an angle. */\ntypedef struct {\n" +
                                  of_turns + "} $name_turns;\n\n"
                            : ""},
      {"$count_state", wrap.gated ? "$name_turns" : "$name_state"},
      {"$forget", wrap.gated ? "forget_count" : "forget_turns"},
      {"$choose_angle", wrap.gated ? "choose_angle" : "read_angle"},
      {"$READING_MORE",
       wrap.gated
           ? "  uint32_t missed; /* samples since one was taken */\n  bool heard; /* its turn is "
             "counted from rejected ones, too */\n"
           : ""},
      {"$NONE_MORE", wrap.gated ? ", 0u, false" : ""},
      {"$FORGET_BOTH",
       wrap.gated ? "static void forget_turns($name_state *o)\n{\n  forget_count(&o->taken);\n  "
                    "forget_count(&o->heard);\n  o->heard_at = 0u;\n  o->heard_steady = 0u;\n  "
                    "o->heard_rejected = 0u;\n}\n\n"
                  : ""},
      {"$OPEN_GATE", wrap.gated && gated ? "    gate_set(o, true);\n" : ""},
      {"$TURN_BACK", wrap.gated
                         ? "      o->taken.turns = o->taken.turns - turns;\n      o->heard.turns = "
                           "o->heard.turns - turns;\n"
                         : "      o->turns = o->turns - turns;\n"},
      {"$PERIOD", writer.number(wrap.period)},
      {"$INVERSE", writer.number(wrap.inverse_period)},
      {"$HALF", writer.number(wrap.period * 0.5)},
      {"$QUARTER", writer.number(wrap.period * 0.25)},
      {"$MOST_TURNS", writer.number(wrap.most_turns)},
      {"$EIGHTH", writer.number(0.125)},
      {"$round", writer.single() ? "roundf" : "round"},
      {"$GAIN", writer.number(design.input_gain)},
      {"$ROWS_OF_ESTIMATE", rows},
      {"$ROWS", rows_of_table},
      {"$LAST", std::to_string(design.size - 1)},
      {"$FIRST", design.first_state},
      {"$INIT", init},
      {"$SET", design.options.settings_name},
      {"$GATE_FLAG",
       std::string(gated || law.watches
                       ? "#define $NAME_OUTLIER_REJECTED 64u /* y was too far from what "
                         "was expected */\n"
                       : "") +
           (wrap.period > 0 ? "#define $NAME_TURN_ASSUMED 128u /* y moved otherwise than before: "
                              "its turn is uncertain */\n"
                            : "")},
      {"$GATE_OPEN", gated ? "    gate_set(o, true);\n" : ""},
      {"$GATE_FACTOR", writer.number(gate.running_factor)},
      {"$GATE_THRESHOLD", writer.number(gate.threshold)},
      {"$GATE_MOST", std::to_string(gate.most_in_a_row)},
      {"$SHARE", writer.number(1.0 / 64)},
      {"$LENGTH", length},
      {"$NEWEST", std::to_string(design.line.empty() ? 0 : design.line.size() - 1)},
      {"$VECTORS", vectors},
      {"$SAMPLES", std::to_string(design.samples.size())}};
  const Words common = c_common_words(writer, design.options);
  words.insert(words.end(), common.begin(), common.end());
  return words;
}

/// What the texts need of a controller.
inline Words c_loop_words(const RecordedDesign& design, const ListWriter& writer) {
  const LoopRules& loop = design.loop;
  const bool divides = loop.divider > 1;
  const std::string divider = std::to_string(loop.divider);
  const auto only = [](const std::string& condition, const std::string& then) {
    return "  if (" + condition + ") {\n    " + then + ";\n  }\n";
  };
  const std::string& angle = design.wrap.angle;
  const bool wraps = design.wrap.period > 0 && !design.error_based && !design.compensates;
  const std::string reference = !angle.empty() ? "wrapped(r - o->" + angle + ")"
                                : wraps
                                    ? "$name_estimate(o, 0u) + wrapped(r - $name_estimate(o, 0u))"
                                    : "r";
  std::string estimates;
  for (int row = 0; design.law.kind == RunningLaw::schedule && row < design.size; ++row) {
    estimates += ", $name_estimate(o, " + std::to_string(row) + "u)";
  }
  std::string call_law = "    (void)law(o, " + reference + estimates + ", &u);\n";
  const bool guards = design.guard.on;
  if (guards && design.compensates) {
    call_law = "    (void)law(o, -$ZERO, &u);\n    u = r + (u * o->input_factor);\n";
  } else if (guards && !design.softens) {
    call_law += "    u = u * o->input_factor;\n";
  }
  const std::string of_y = only("!is_finite(y)", "return $NAME_STATE_REJECTED");
  const std::string of_u = only("!is_finite(u)", "return $NAME_INPUT_REJECTED");
  return {
      {"$LIMITS", design.options.settings_in_struct ? std::string()
                                                    : ", u within " + writer.number(design.lower) +
                                                          " .. " + writer.number(design.upper)},
      {"$REFERENCE",
       design.compensates ? "the u0 of the controller that is helped" : "the reference"},
      // In a function of its own where two call it: MISRA 8.7.
      {"$OWN_MISS", divides ? std::string("static $real miss($name_state *o, $real r)\n{\n") +
                                  c_source_miss + "}\n\n"
                            : ""},
      {"$TO_MISS", divides ? "  return miss(o, r);\n" : c_source_miss},
      {"$PHASE_MEMBER", divides ? "  uint16_t phase; /* a measurement is due at 0 */\n" : ""},
      {"$PHASE_INIT", divides ? "  o->phase = 0u;\n" : ""},
      {"$PHASE_NEXT", divides ? "  o->phase = (uint16_t)(o->phase + 1u);\n" +
                                    only("o->phase >= $DIVIDERu", "o->phase = 0u")
                              : ""},
      {"$PHASE_BEFORE", divides
                            ? "  const bool planned = o->gap == $DUEu;\n" +
                                  only("o->phase != 0u", "return miss(o, r)") + "  o->phase = 1u;\n"
                            : ""},
      {"$PHASE_PLAN", divides ? "  const bool planned = o->gap == $DUEu;\n" : ""},
      {"$PHASE_SKIP",
       divides ? "  if (o->phase != 0u) {\n    o->phase = (uint16_t)(o->phase + 1u);\n    if "
                 "(o->phase >= $DIVIDERu) {\n      o->phase = 0u;\n    }\n    o->status = "
                 "(uint8_t)predict_$top(o, drive);\n    judge_missing(o);\n    release_guards(o);\n"
                 "    return o->u_last;\n  }\n  o->phase = 1u;\n"
               : ""},
      {"$PHASE_AFTER",
       divides ? only("planned && (status == $NAME_GAP_BRIDGED)", "status = 0u") : ""},
      {"$DUE", std::to_string(loop.divider - 1)},
      {"$REST", design.gate.threshold > 0
                    ? "if ($rest(o, $MEASURED, $U_APPLIED)) {\n      gate_set(o, true);\n    }"
                    : "(void)$rest(o, $MEASURED, $U_APPLIED);"},
      {"$U_APPLIED", guards            ? "applied_by_present(o)"
                     : design.known.on ? "o->u_given"
                                       : "o->u_applied"},
      {"$ASKED", design.options.watched ? "  o->u_asked = o->u_last;\n" : ""},
      {"$CALL_LAW", call_law},
      {"$MEASURED", design.error_based ? "r - y" : "y"},
      {"$AT_START", design.error_based ? "$ZERO" : "y"},
      {"$START_CHECKS", design.compensates ? of_u + of_y : of_y + of_u},
      {"$FILL", design.line.empty() ? ""
                : guards            ? "  fill_delayed(o, u * o->gain_ratio);\n"
                                    : "  fill_delayed(o, u);\n"},
      {"$GATE_START", design.gate.threshold > 0 ? "  gate_set(o, true);\n" : ""},
      {"$SAFE_INPUT", loop.has_safe_input ? writer.number(loop.safe_input) : "o->u_last"},
      {"$HOLD_INPUT", writer.number(loop.hold_input)},
      {"$HARDEN", design.softens ? "  (void)harden(o);\n" : ""},
      {"$MISSING_LIMIT", std::to_string(loop.missing_limit)},
      {"$LEAVE_SAFE", loop.stays_safe ? ""
                                      : only("(o->mode == $NAME_SAFE) && (o->gap < $DIVIDERu)",
                                             "o->mode = $NAME_RUNNING")},
      {"$HOLD_LEFT", std::to_string(loop.hold_left)},
      {"$MODE", loop.hold_left > 0 ? "$NAME_START_HOLD" : "$NAME_RUNNING"},
      {"$DIVIDER", divider},
      {"$COLUMNS", "y, r, u"},
      {"$RESULT", "const $real result = $name_update(&o, samples[i][0], samples[i][1]);"}};
}

/// What the texts need of a controller in two phases.
inline Words c_phase_words(const RecordedDesign& design) {
  const LawNumbers& law = design.law;
  std::string arms = "    good = arm_by(o";
  if (law.kind == RunningLaw::none) {
    arms = "    const $real *k = gains[(o->gap > 1u) ? (o->gap - 1u) : 0u];\n" + arms;
    for (std::size_t i = 0; i < design.gap_gains[0].size(); ++i) {
      arms += ", k[" + std::to_string(i) + "]";
    }
  }
  arms += ");\n";
  const bool scheduled = law.kind == RunningLaw::schedule;
  if (scheduled) {
    arms =
        "    if (o->gap > 1u) {\n      const $real poles = poles_over(o, o->gap);\n      good = "
        "arm_long(o, poles, ($real)o->gap);\n    } else {\n  " +
        arms + "    }\n";
  }
  return {
      {"$ARM_BY", arms},
      {"$ARM_BLANKED", scheduled ? "  if (o->age <= $LEASTu) { /* too early for estimates */\n "
                                   "   (void)arm_blanked(o);\n    return;\n  }\n"
                                 : ""},
      {"$CONTROL", law.watches ? "  if (accepted(o, y)) {\n    (void)control_by(o, y, &u);\n  } "
                                 "else {\n    (void)control_blind(o, &u);\n  }\n"
                               : "  (void)control_by(o, y, &u);\n"},
      {"$LIMITS", ""},
      {"$SETTLE", design.waits ? "settle" : "track"},
      {"$COLUMNS", "y, next r, u"},
      {"$RESULT", "const $real result = $name_update(&o, samples[i][0], samples[i][1]);"}};
}

/// What the texts need of an observer.
inline Words c_observer_words(const RecordedDesign& design) {
  return {{"$LIMITS", ""},
          {"$COLUMNS", "y, u, the disturbance"},
          {"$RESULT",
           "$real result;\n    (void)$name_update(&o, samples[i][0], samples[i][1]);\n    result = "
           "$name_estimate(&o, $ORDERu);"},
          {"$ORDER", std::to_string(design.order)}};
}

}  // namespace esokit::detail
