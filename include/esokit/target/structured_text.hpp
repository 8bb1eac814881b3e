/// @file
/// to_structured_text: a finished controller or observer as a function block of a PLC, from the
/// same lists as its C.
#pragma once

#include <cstddef>
#include <esokit/core/expected.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_design.hpp>
#include <string>
#include <utility>
#include <vector>

namespace esokit {

namespace detail {

// What counts and chooses, as in c_text.hpp. `$[name a b -> c]` is a list with its arguments; it
// sets `ok`.

/// A prediction with `acting`.
inline constexpr const char* st_predict = R"(tries := 0;
REPEAT
  $[predict_step acting]
  tries := tries + 1;
  IF tries = 1 THEN
    IF gap < 65535 THEN gap := gap + 1; END_IF;
    IF NOT ok THEN
      IF (ABS(acting) <= $MOST) AND NOT (ABS(acting) > ABS(u_applied)) THEN
        u_applied := acting; (* it is not the cause *)
        gap := 65535;
        status := status + 4;
        tries := 2;
      ELSE
        bad_u := TRUE;
        acting := u_applied;
      END_IF;
    END_IF;
  ELSIF NOT ok THEN
    gap := 65535;
    status := status + 4;
  END_IF;
UNTIL ok OR (tries >= 2) END_REPEAT;
)";

/// DelayedInput around it: `acting` becomes the u that acts now.
inline constexpr const char* st_delay =
    R"(IF NOT (ABS(acting) <= $MOST) THEN
  acting := line[newest];
  bad_u := TRUE;
END_IF;
newest := newest + 1;
IF newest >= $LENGTH THEN newest := 0; END_IF;
line[newest] := acting;
IF newest + 1 >= $LENGTH THEN acting := line[0]; ELSE acting := line[newest + 1]; END_IF;
)";

/// A step in one list; not with a gate, which looks at the prediction.
inline constexpr const char* st_quick = R"(IF NOT skips AND (gap = 0) THEN
  $[observe measured acting]
  done := ok;
END_IF;
)";

/// OutlierGate around it: `rejects`.
inline constexpr const char* st_gate = R"(gate_distance := ABS(measured - $FIRST);
IF NOT skips AND (gate_distance <= $MOST) THEN
  IF gap > $ROWS THEN
    gate_open := TRUE;
    gate_count := 0;
  ELSE
    gate_limit := $GATE_FACTOR * gate_mean;
    IF NOT (gate_limit > $GATE_THRESHOLD) THEN gate_limit := $GATE_THRESHOLD; END_IF;
    gate_most := gate_limit;
    IF gap > 1 THEN gate_most := gate_limit * UINT_TO_$REAL(gap); END_IF;
    gate_fits := gate_distance <= gate_most;
    IF NOT gate_fits AND NOT gate_open AND (gate_count < $GATE_IN_A_ROW) THEN
      gate_count := gate_count + 1;
      rejects := TRUE;
      status := status + 64;
    ELSE
      IF NOT (gate_distance < gate_limit) THEN gate_distance := gate_limit; END_IF;
      gate_mean := gate_mean + ((gate_distance - gate_mean) * $SHARE);
      IF gate_open AND gate_fits THEN
        gate_count := gate_count + 1;
        IF gate_count >= $GATE_IN_A_ROW THEN
          gate_open := FALSE;
          gate_count := 0;
        END_IF;
      ELSE
        gate_open := NOT gate_fits;
        gate_count := 0;
      END_IF;
    END_IF;
  END_IF;
END_IF;
)";

/// A sample of the observer: `measured`, and `acting`, the u since the last one.
inline constexpr const char* st_observe = R"(bad_u := FALSE;
$DELAY
done := FALSE;
$QUICK
IF NOT done THEN
  $PREDICT
  rejects := FALSE;
  $OUTLIERS
  IF NOT skips AND NOT rejects THEN
    elapsed := gap;
    IF elapsed < 1 THEN elapsed := 1; END_IF;
    again := elapsed > $ROWS;
    IF NOT again THEN
      $CORRECT
      IF ok THEN
        gap := 0;
        IF elapsed > 1 THEN status := status + 8; END_IF;
      ELSIF ABS(measured) < ABS($FIRST) THEN
        again := TRUE; (* perhaps the state is to blame *)
      ELSE
        status := status + 1;
      END_IF;
    END_IF;
    IF again THEN
      ok := ABS(measured) <= $MOST;
      IF ok THEN
        $[restart_at measured]
      END_IF;
      IF ok THEN
        gap := 0;
        status := status + 16;
        restarted := TRUE;
      ELSE
        status := status + 1;
      END_IF;
    END_IF;
  END_IF;
END_IF;
IF bad_u THEN status := status + 2; END_IF;
)";

inline constexpr const char* st_head = R"((* Written by esokit from a finished design; do not edit.
$COMMENT   T = $TIME s, b0 = $GAIN: call it once in each T.

   status, the sum of: 1 y was NaN, infinite or too large, 2 u was too large, 4 the next good y
   restarts, 8 samples were missing before this one, 16 restarted because too many were missing,
   32 start refused: y is not finite or too large. *)
FUNCTION_BLOCK $name
VAR_INPUT
  y : $REAL; (* the measurement *)
  no_y : BOOL; (* TRUE: there is none at this sample *)
)";

inline constexpr const char* st_controller_variables = R"(  r : $REAL; (* $REFERENCE *)
  u_held : $REAL; (* what the actuator held, if starts or reports *)
  starts : BOOL; (* TRUE: takes over a plant at rest at y under u_held, before the sample *)
  reports : BOOL; (* TRUE: the actuator held u_held instead of u, before the sample *)
END_VAR
VAR_OUTPUT
  u : $REAL; (* to be held until the next sample *)
  mode : UINT := $MODE; (* 0: the law, 1: the start hold, 2: too many measurements are missing *)
  status : UINT;
  start_status : UINT;
$ESTIMATESEND_VAR
VAR
  hold_left : UDINT := $HOLD_LEFT;
  phase : UINT := 0;
  planned : BOOL;
)";

inline constexpr const char* st_observer_variables =
    R"(  u : $REAL; (* what the actuator held since the last sample *)
  resets : BOOL; (* TRUE: restarts at (y, 0, .., 0) instead *)
END_VAR
VAR_OUTPUT
  status : UINT;
$ESTIMATESEND_VAR
VAR
)";

inline constexpr const char* st_controller = R"(IF starts THEN
  start_status := 0;
  status := 0;
  IF $START_CHECKS
  ELSE
    $SAVE
    old_gap := gap;
    $FILL
    acting := u_held;
    $DELAY
    $PREDICT
    $[rest_at $AT_START u_held]
    IF ok THEN
      $[applied u_held]
      $HARDEN
      $GATE_OPEN
      gap := 0;
      mode := 0;
    ELSE
      $RESTORE
      gap := old_gap;
      start_status := 32;
    END_IF;
  END_IF;
END_IF;
IF reports THEN
  $[applied u_held]
END_IF;

status := 0;
restarted := FALSE;
skips := no_y OR (phase <> 0);
planned := gap = ($DIVIDER - 1);
phase := phase + 1;
IF phase >= $DIVIDER THEN phase := 0; END_IF;
measured := $MEASURED;
acting := u_last;
$OBSERVE
IF restarted THEN
  $[rest_at measured u_applied]
  $GATE_OPEN
END_IF;
IF ($DIVIDER > 1) AND planned AND (status = 8) THEN status := 0; END_IF;

IF gap >= $MISSING_LIMIT THEN
  mode := 2;
ELSIF (mode = 2) AND (gap < $LEAVE_BELOW) THEN
  mode := 0;
END_IF;
IF mode = 0 THEN
  $[law r -> wanted]
ELSIF mode = 2 THEN
  wanted := $SAFE_INPUT;
ELSE
  hold_left := hold_left - 1;
  IF hold_left = 0 THEN mode := 0; END_IF;
  wanted := $HOLD_INPUT;
END_IF;
$[limit wanted -> u]
$ROWS_OF_ESTIMATEEND_FUNCTION_BLOCK
)";

inline constexpr const char* st_observer = R"(status := 0;
IF resets THEN
  ok := ABS(y) <= $MOST;
  IF ok THEN
    $[restart_at y]
  END_IF;
  IF ok THEN gap := 0; ELSE status := 32; END_IF;
  $GATE_OPEN
ELSE
  skips := no_y;
  measured := y;
  acting := u;
  $OBSERVE
END_IF;
$ROWS_OF_ESTIMATEEND_FUNCTION_BLOCK
)";

/// Writes the body of a function block, with its lists.
class StBody {
 public:
  StBody(const RecordedDesign& design, const ListWriter& writer)
      : design_(design), writer_(writer) {}

  std::string declarations{};  ///< of the temporaries

  /// `text` with its lists, in the indentation of their marks.
  [[nodiscard]] std::string with_lists(std::string text) {
    for (std::size_t at = 0; (at = text.find("$[")) != std::string::npos;) {
      const std::size_t end = text.find(']', depth_end(text, at));
      const std::string indent = indent_before(text, at);
      std::vector<std::string> words{""};
      for (std::size_t i = at + 2, deep = 0; i < end; ++i) {
        deep = deep + (text[i] == '[') - (text[i] == ']');
        if (text[i] == ' ' && deep == 0) {
          words.emplace_back();
        } else {
          words.back() += text[i];
        }
      }
      text.replace(at, end + 1 - at, list(words, indent));
    }
    return text;
  }

  /// `part` in place of the key, each line with the indentation of the key.
  static void place(std::string& text, const std::string& key, const std::string& part) {
    for (std::size_t at = 0; (at = text.find(key)) != std::string::npos;) {
      const std::string indent = indent_before(text, at);
      std::string lines = part;
      if (!lines.empty() && lines.back() == '\n') lines.pop_back();
      for (std::size_t i = 0; (i = lines.find('\n', i)) != std::string::npos;
           i += 1 + indent.size())
        lines.insert(i + 1, indent);
      text.replace(at, key.size(), lines);
    }
  }

 private:
  static std::size_t depth_end(const std::string& text, std::size_t at) {
    int deep = 0;
    for (std::size_t i = at; i < text.size(); ++i) {
      deep += text[i] == '[' ? 1 : text[i] == ']' ? -1 : 0;
      if (text[i] == ']' && deep == 0) return i;
    }
    return text.size();
  }
  static std::string indent_before(const std::string& text, std::size_t at) {
    const std::size_t line = text.rfind('\n', at);
    return std::string(line == std::string::npos ? at : at - line - 1, ' ');
  }

  [[nodiscard]] std::string list(const std::vector<std::string>& words, const std::string& indent) {
    std::size_t which = 0;
    while (design_.names[which].name != words[0]) ++which;
    NamedCall call = design_.names[which];
    std::string target;
    for (std::size_t i = 1; i < words.size(); ++i) {
      if (words[i] == "->") {
        target = words[i + 1];
        break;
      }
      call.arguments[i - 1] = words[i];
    }
    const std::string prefix = "s" + std::to_string(++lists_) + "_";
    const WrittenCall lines = writer_.written(call, design_.calls[which], prefix);
    std::string text = "(* " + words[0] + " *)\n";
    const auto declare = [&](const std::string& name, bool is_condition) {
      declarations += "  " + name + " : " + (is_condition ? "BOOL" : writer_.real()) + ";\n";
    };
    for (const auto& line : lines.lines) {
      declare(line.name, line.is_condition);
      text += indent + line.name + " := " + line.expression + ";\n";
    }
    std::string checks;
    for (const auto& check : lines.checks) checks += (checks.empty() ? "" : " AND ") + check;
    text += indent + "ok := " + (checks.empty() ? "TRUE" : checks) + ";\n";
    if (!target.empty()) text += indent + target + " := " + lines.output + ";\n";
    if (!lines.results.empty()) {
      text += indent + "IF ok THEN\n";
      std::string assigned;
      for (const auto& [member, value] : lines.results) {
        std::string from = value;
        for (const auto& read : lines.reads) {
          if (read.name != value) continue;
          from = prefix + value;  // it may be overwritten before it is read
          declare(from, false);
          text += indent + "  " + from + " := " + value + ";\n";
        }
        assigned += indent + "  " + member + " := " + from + ";\n";
      }
      text += assigned + indent + "END_IF;\n";
    }
    text.pop_back();
    return text;
  }

  const RecordedDesign& design_;
  const ListWriter& writer_;
  int lists_ = 0;
};

/// The function block of a design.
inline std::string structured_text(const RecordedDesign& design) {
  ListWriter writer(st_language, design.single);
  writer.members = design.members;
  writer.live = design.live;
  StBody body(design, writer);
  const std::string real = writer.real();
  const LoopRules& loop = design.loop;
  const bool delayed = !design.line.empty();
  const std::string finite = " <= " + writer.most();

  std::string states;
  std::string save;
  std::string restore;
  const auto keep = [&](const std::string& name, const std::string& declared) {
    states += "  " + name + " : " + declared + ";\n";
  };
  for (std::size_t i = 0; i < design.members.size(); ++i) {
    if (!design.live[i]) continue;
    const std::string& name = design.members[i];
    keep(name, real + " := " + writer.number(design.numbers[i]));
    if (!design.is_controller) continue;
    keep("old_" + name, real);
    save += "old_" + name + " := " + name + ";\n";
    restore += name + " := old_" + name + ";\n";
  }
  keep("gap", "UINT := 0");
  for (const char* name : {"old_gap", "tries", "elapsed"}) keep(name, "UINT");
  for (const char* name : {"ok", "done", "again", "skips", "restarted", "bad_u", "rejects"})
    keep(name, "BOOL");
  for (const char* name : {"measured", "acting", "wanted"}) keep(name, real);
  const std::string gains = std::to_string(design.gap_gains[0].size());
  std::string table;
  for (const auto& row : design.gap_gains) {
    for (const double k : row) table += (table.empty() ? "" : ", ") + writer.number(k);
  }
  keep("gains", "ARRAY[1.." + std::to_string(design.gap_gains.size()) + ", 1.." + gains + "] OF " +
                    real + " := [" + table + "]");
  std::string fill;
  if (delayed) {
    std::string line;
    for (const double u : design.line) line += (line.empty() ? "" : ", ") + writer.number(u);
    const std::string last = std::to_string(design.line.size() - 1);
    keep("line", "ARRAY[0.." + last + "] OF " + real + " := [" + line + "]");
    keep("newest", "UINT := " + last);
    for (std::size_t i = 0; i < design.line.size(); ++i) {
      const std::string at = "[" + std::to_string(i) + "]";
      fill += "line" + at + " := u_held;\n";
      keep("old_line" + std::to_string(i), real);
      save += "old_line" + std::to_string(i) + " := line" + at + ";\n";
      restore += "line" + at + " := old_line" + std::to_string(i) + ";\n";
    }
    keep("old_newest", "UINT");
    save += "old_newest := newest;\n";
    restore += "newest := old_newest;\n";
  }

  const bool gated = design.gate.threshold > 0;
  if (gated) {
    keep("gate_mean", real + " := " + writer.number(design.gate.mean));
    keep("gate_count", "UINT := " + std::to_string(design.gate.count));
    keep("gate_open", std::string("BOOL := ") + (design.gate.open ? "TRUE" : "FALSE"));
    keep("gate_fits", "BOOL");
    for (const char* name : {"gate_distance", "gate_limit", "gate_most"}) keep(name, real);
  }

  std::string by = "$[correct_by measured";
  for (std::size_t i = 1; i <= design.gap_gains[0].size(); ++i) {
    by += " gains[elapsed," + std::to_string(i) + "]";
  }
  by += "]";
  const std::string corrects =
      design.gain_is_kept
          ? by
          : "IF elapsed > 1 THEN\n  " + by + "\nELSE\n  $[correct_step measured]\nEND_IF;\n";
  std::string estimates;
  std::string rows;
  for (int row = 0; row < design.size; ++row) {
    const std::string name = "e" + std::to_string(row);
    estimates += "  " + name + " : " + real + "; (* " +
                 (row == design.order  ? std::string("the disturbance")
                  : row < design.order ? "y" + std::string(static_cast<std::size_t>(row), '\'')
                                       : std::string("an estimate")) +
                 " *)\n";
    rows += "$[estimate_" + std::to_string(row) + " -> " + name + "]\n";
  }
  const std::string of_y = "NOT (ABS(y)" + finite + ") THEN\n    start_status := 32;\n";
  const std::string of_u = "NOT (ABS(u_held)" + finite + ") THEN\n    start_status := 2;\n";
  std::string checks =
      (design.compensates ? of_u : of_y) + "  ELSIF " + (design.compensates ? of_y : of_u);
  checks.pop_back();

  std::string text = design.is_controller ? st_controller : st_observer;
  StBody::place(text, "$OBSERVE", st_observe);
  StBody::place(text, "$QUICK", gated ? "" : st_quick);
  StBody::place(text, "$GATE_OPEN",
                gated ? "IF ok THEN\n  gate_open := TRUE;\n  gate_count := 0;\nEND_IF;\n" : "");
  StBody::place(text, "$OUTLIERS", gated ? st_gate : "");
  StBody::place(text, "$PREDICT", st_predict);
  StBody::place(text, "$DELAY", delayed ? st_delay : "");
  StBody::place(text, "$CORRECT", corrects);
  StBody::place(text, "$SAVE", save);
  StBody::place(text, "$RESTORE", restore);
  StBody::place(text, "$FILL", fill);
  StBody::place(text, "$HARDEN", design.softens ? "$[harden]" : "");
  StBody::place(text, "$ROWS_OF_ESTIMATE", rows + "\n");
  const auto& comment = design.options.comment;
  const Words words = {
      {"$START_CHECKS", checks},
      {"$AT_START", design.error_based ? "0.0" : "y"},
      {"$MEASURED", design.error_based ? "r - y" : "y"},
      {"$REFERENCE", design.compensates ? "u0 of the controller that is helped" : "the reference"},
      {"$GATE_FACTOR", writer.number(design.gate.running_factor)},
      {"$GATE_THRESHOLD", writer.number(design.gate.threshold)},
      {"$GATE_IN_A_ROW", std::to_string(design.gate.most_in_a_row)},
      {"$SHARE", writer.number(1.0 / 64)},
      {"$ESTIMATES", estimates},
      {"$ROWS", std::to_string(design.max_gap + 1)},
      {"$FIRST", design.first_state},
      {"$MOST", writer.most()},
      {"$LENGTH", std::to_string(design.line.size())},
      {"$MISSING_LIMIT", std::to_string(loop.missing_limit)},
      {"$LEAVE_BELOW", loop.stays_safe ? "0" : std::to_string(loop.divider)},
      {"$DIVIDER", std::to_string(loop.divider)},
      {"$SAFE_INPUT", loop.has_safe_input ? writer.number(loop.safe_input) : "u_last"},
      {"$HOLD_INPUT", writer.number(loop.hold_input)},
      {"$HOLD_LEFT", std::to_string(loop.hold_left)},
      {"$MODE", loop.hold_left > 0 ? "1" : "0"},
      {"$TIME", writer.number(design.sample_time)},
      {"$GAIN", writer.number(design.input_gain)},
      {"$REAL", real},
      {"$name", design.options.name},
      {"$COMMENT", comment.empty() ? "" : "   " + comment + "\n"}};
  text = body.with_lists(filled(text, words));
  // Lines in which nothing was put.
  for (std::size_t at = 0; (at = text.find('\n', at)) != std::string::npos;) {
    const std::size_t next = text.find_first_not_of(' ', at + 1);
    if (next != std::string::npos && next > at + 1 && text[next] == '\n') {
      text.erase(at, next - at);
    } else {
      ++at;
    }
  }
  const std::string head = std::string(st_head) +
                           (design.is_controller ? st_controller_variables : st_observer_variables);
  return filled(head, words) + states + body.declarations + "END_VAR\n\n" + text;
}

}  // namespace detail

/// The controller or observer as a function block in Structured Text (IEC 61131-3, second edition:
/// no methods), REAL for float and LREAL for double, from the same lists as to_c and with the same
/// meaning of bad and missing samples, gaps, restarts and safe mode. A call of the block is a
/// sample. NaN and infinity are refused by ABS(x) <= the largest number, which every PLC has.
///
/// Not written are gains that go on at each sample (AlgebraicEso, ExtendedStateFilter) and angles
/// (WrappedOutput), nor Guarded, Measured and KnownModel: their text is that of C alone.
/// @param object as for to_c @return the text of the block, or an error as for to_c, or for one of
///        these
template <detail::Writable Object>
Expected<std::string, Error<typename Object::scalar_type>> to_structured_text(
    const Object& object, const CodeOptions& options = {}) {
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  using V = typename Object::scalar_type;
  Rules<V> rules;
  rules
      .require(design->law.kind == detail::RunningLaw::none, "observer", V(0),
               "has a gain that goes on at each sample: not written in Structured Text")
      .require(!(design->wrap.period > 0), "period", static_cast<V>(design->wrap.period),
               "of WrappedOutput is not written in Structured Text")
      .require(!options.settings_in_struct, "settings_in_struct", V(1),
               "is not written in Structured Text")
      .require(!design->predictive, "PredictiveAdrc", V(0), "is not written in Structured Text")
      .require(!design->guard.on, "guarded", V(0), "is not written in Structured Text")
      .require(!design->measured.on, "measured", V(0), "is not written in Structured Text")
      .require(!design->known.on, "model", V(0), "of KnownModel is not written in Structured Text");
  if (!rules) return rules.error();
  return detail::structured_text(*design);
}

}  // namespace esokit
