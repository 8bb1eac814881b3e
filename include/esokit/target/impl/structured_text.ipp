#pragma once

#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/design_text.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/st_translator.hpp>
#include <esokit/target/structured_text.hpp>
#include <string>

namespace esokit {

namespace detail {

// The block itself: what a PLC calls, around the functions that are translated.
inline constexpr const char* st_head = R"((* Written by esokit from a finished design; do not edit.
$COMMENT   FUNCTION_BLOCK $name is at the end: call it once in each T = $TIME s; b0 = $GAIN.
   $DESIGN.

   status, the sum of: 1 y was NaN, infinite or too large, 2 u was too large, 4 the next good y
   restarts, 8 samples were missing before this one, 16 restarted because too many were missing,
   32 start or reset refused: y is not finite or too large$FLAGS$OF_R. *)

)";

/// What is given before a sample.
inline constexpr const char* st_tell_measured = R"(IF NOT no_w THEN
  done := $name_measured(o := o, w := w);
END_IF;
)";

inline constexpr const char* st_tell_guard = R"(flags := $name_set_trust(o := o, trust := trust);
guard_status := UDINT_TO_UINT(flags);
flags := $name_set_pin(o := o, where := UINT_TO_UDINT(pin));
IF flags <> 0 THEN
  guard_status := UDINT_TO_UINT(flags);
END_IF;
)";

inline constexpr const char* st_tell_gain = R"(IF b0 <> b0_taken THEN
  IF $name_set_input_gain(o := o, b := b0) THEN
    b0_taken := b0;
  END_IF;
END_IF;
)";

inline constexpr const char* st_adopt = R"(IF adopts THEN
  adopted := $name_adopt(o := o, settings := settings);
END_IF;
)";

inline constexpr const char* st_starts = R"(IF starts THEN
  flags := $name_start(o := o, y := y, u := u_held);
  start_status := UDINT_TO_UINT(flags);
END_IF;
report_status := 0;
IF reports THEN
  flags := $name_applied(o := o, u := u_held);
  report_status := UDINT_TO_UINT(flags);
END_IF;
)";

inline constexpr const char* st_controller = R"($HOLD no_y THEN
  u := $name_update_without_measurement(o := o, $R);
ELSE
  u := $name_update(o := o, y := y, $R);
END_IF;
mode := UDINT_TO_UINT(o.mode);
status := UDINT_TO_UINT(o.status);
)";

inline constexpr const char* st_predictive = R"(IF no_y THEN
  u := $name_control_without_measurement(o := o);
ELSE
  u := $name_control(o := o, y := y);
END_IF;
flags := $name_prepare(o := o, $R);
status := UDINT_TO_UINT(flags);
mode := UDINT_TO_UINT(o.mode);
)";

inline constexpr const char* st_observer = R"($HOLDIF resets THEN
  flags := $name_reset(o := o, y := y);
ELSIF no_y THEN
  flags := $name_predict(o := o, u := u);
ELSE
  flags := $name_update(o := o, y := y, u := u);
END_IF;
status := UDINT_TO_UINT(flags);
)";

inline constexpr const char* st_hold_observer = R"(IF holds THEN
  u_to_give := $name_hold(o := o);
ELSE
  done := $name_release(o := o);
END_IF;
)";

ESOKIT_FUNCTION StBlock::StBlock(const CCode& code, const CodeOptions& options, bool single,
                                 const std::string& begins)
    : translator(code.header + code.source, options.name), words_{{"$name", options.name}} {
  if (translator.has(options.name + begins)) {
    own("begun : BOOL");
    first_ =
        "IF NOT begun THEN\n  done := $name" + begins + "(o := o);\n  begun := TRUE;\nEND_IF;\n";
  }
  const std::string& comment = options.comment;
  words_.emplace_back("$real", single ? "REAL" : "LREAL");
  words_.emplace_back("$COMMENT", comment.empty() ? "" : "   " + comment + "\n");
}

ESOKIT_FUNCTION StructuredText StBlock::text(const std::string& head) {
  const std::string block =
      filled("FUNCTION_BLOCK $name\nVAR_INPUT\n" + inputs_ + "END_VAR\nVAR_OUTPUT\n" + outputs_ +
                 "END_VAR\nVAR\n  o : $name_state;\n" + own_ + "  done : BOOL;\nEND_VAR\n\n" +
                 first_ + body + "END_FUNCTION_BLOCK\n",
             words_);
  translator.write_for(block);
  return {filled(head, words_) + translator.text() + block, {}, translator.error};
}

ESOKIT_FUNCTION StructuredText structured_text(const RecordedDesign& design) {
  const ListWriter writer(c_language, design.single);
  const std::string& name = design.options.name;
  StBlock block(c_code(design), design.options, design.single, "_init");
  const auto number = [&](double x) { return StTranslator::number(writer.number(x)); };
  const bool controls = design.is_controller;
  const auto references = design.references(design.predictive ? "next_r" : "r");
  block.input("y : $real", "the measurement");
  block.input("no_y : BOOL", "TRUE: there is none at this sample");
  if (controls || design.predictive) {
    for (const std::string& r : references) {
      block.input(r + " : $real", r != references[0]   ? "its derivative"
                                  : design.predictive  ? "the reference at the next sample"
                                  : design.compensates ? "u0 of the controller that is helped"
                                                       : "the reference");
    }
    block.input("u_held : $real", "what the actuator held, if starts or reports");
    block.input("starts : BOOL",
                "TRUE: takes over a plant at rest at y under u_held, before the sample");
    block.input("reports : BOOL",
                "TRUE: the actuator held u_held instead of u, before the sample; a limit of rate "
                "counts from u");
    block.output("u : $real", "to be held until the next sample");
    block.output("start_status : UINT");
    block.output("report_status : UINT");
  } else {
    block.input("u : $real", "what the actuator held since the last sample");
    block.input("resets : BOOL", "TRUE: restarts at (y, 0, .., 0) instead");
  }
  if (controls || design.predictive) {
    const unsigned holds = controls ? design.loop.hold_left : design.hold;
    block.output(std::string("mode : UINT := ") + (holds > 0 ? "1" : "0"),
                 "0: the law, 1: the start hold, 2: too many measurements are missing");
  }
  block.output("status : UINT");
  if (design.options.settings_in_struct) {
    block.input("settings : $name_settings", "others, of a design of the same structure");
    block.input("adopts : BOOL", "TRUE: they count from this sample on");
    block.output("adopted : BOOL", "FALSE: they are not of this structure, nothing changed");
    block.body += st_adopt;
  }
  const bool guards = design.guard.on;
  if (guards) {
    block.input("trust : $real := 1.0", "0 .. 1: how much a correction of the disturbance counts");
    block.input("pin : UINT",
                "the actuator is at its limit: 1 upper, 2 lower, 3 by the sign of u; 0 at none");
    block.input("holds : BOOL",
                controls ? "TRUE: something else holds the plant under u_held at this sample"
                         : "TRUE: something else holds the plant");
    block.output("guard_status : UINT", "2: trust or pin is none, the last one counts");
    block.body += st_tell_guard;
    if (block.translator.has(name + "_set_input_gain")) {
      const std::string gain = number(design.input_gain);
      block.input("b0 : $real := " + gain);
      block.own("b0_taken : $real := " + gain);
      block.body += st_tell_gain;
    }
    if (!controls) {
      block.output("u_to_give : $real", "while it is held");
    }
  }
  if (controls || design.predictive) block.body += st_starts;
  if (design.measured.on) {
    const std::size_t count = design.measured.paths.size();
    if (count > 1) block.own("w : $name_numbers_" + std::to_string(count));
    for (std::size_t i = 0; i < count; ++i) {
      const std::string w = count > 1 ? "w" + std::to_string(i + 1) : "w";
      block.input(w + " : $real", "a measured disturbance");
      if (count > 1) block.body += "w[" + std::to_string(i) + "] := " + w + ";\n";
    }
    block.input("no_w : BOOL", "TRUE: there is none at this sample");
    block.body += st_tell_measured;
  }
  block.body += controls ? st_controller : design.predictive ? st_predictive : st_observer;
  const std::string hold = std::string("IF holds THEN\n  u := $name_hold(o := o, y := y, ") +
                           (design.error_based ? "r := r, " : "") + "u := u_held);\nELSIF";
  block.own("flags : UDINT");
  for (int row = 0; row < design.size; ++row) {
    const std::string e = "e" + std::to_string(row);
    block.output(e + " : $real", row == design.order ? std::string("the disturbance")
                                 : row < design.order
                                     ? "y" + std::string(static_cast<std::size_t>(row), '\'')
                                     : std::string("an estimate"));
    block.body += e + " := $name_estimate(o := o, row := " + std::to_string(row) + ");\n";
  }
  if (design.options.watched && controls) {
    block.output("innovation : $real", "what a HealthMonitor takes, and the next three");
    block.output("asked : $real");
    block.output("applied : $real");
    block.output("missed : UINT");
    block.body +=
        "innovation := o.innovation;\nasked := o.u_asked;\napplied := o.u_applied;\n"
        "missed := UDINT_TO_UINT(o.gap);\n";
  }
  const bool gates = design.gate.threshold > 0 || design.law.watches;
  block.body =
      filled(block.body,
             {{"$HOLD", !guards    ? (controls ? "IF" : "")
                        : controls ? hold
                                   : st_hold_observer},
              {"$R", listed(references, [](const std::string& r) { return r + " := " + r; })}});
  StructuredText all = block.text(filled(
      st_head,
      {{"$FLAGS", design.wrap.period > 0 ? ",\n   64 y was refused as an outlier, 128 y moved "
                                           "otherwise than before: its turn is uncertain"
                  : gates                ? ",\n   64 y was refused as an outlier"
                                         : ""},
       {"$OF_R", controls || design.predictive
                     ? ",\n   256 r was NaN, infinite or too large: u is as it was"
                     : ""},
       {"$DESIGN", structure_text(design) + ", design " + design_hash(design)},
       {"$TIME", number(design.sample_time)},
       {"$GAIN", number(design.input_gain)}}));
  if (design.options.settings_in_struct) {
    all.settings = block.translator.settings(design.options.settings_name);
  }
  return all;
}

}  // namespace detail
}  // namespace esokit
