/// @file
/// to_structured_text: a finished controller or observer as a function block of a PLC, translated
/// from its C.
#pragma once

#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_design.hpp>
#include <esokit/target/st_translator.hpp>
#include <string>

namespace esokit {

namespace detail {

// The block itself: what a PLC calls, around the functions that are translated.

inline constexpr const char* st_head = R"((* Written by esokit from a finished design; do not edit.
$COMMENT   FUNCTION_BLOCK $name is at the end: call it once in each T = $TIME s; b0 = $GAIN.

   status, the sum of: 1 y was NaN, infinite or too large, 2 u was too large, 4 the next good y
   restarts, 8 samples were missing before this one, 16 restarted because too many were missing,
   32 start or reset refused: y is not finite or too large$FLAGS. *)

)";

/// What is told before a sample.
inline constexpr const char* st_tell_measured = R"(IF NOT no_w THEN
  done := $name_measured(o := o, w := w);
END_IF;
)";
inline constexpr const char* st_tell_guard = R"(done := $name_set_trust(o := o, trust := trust);
done := $name_set_pin(o := o, where := UINT_TO_UDINT(pin));
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
IF reports THEN
  $REPORT
END_IF;
)";

inline constexpr const char* st_controller = R"($HOLD no_y THEN
  u := $name_update_without_measurement(o := o, r := r);
ELSE
  u := $name_update(o := o, y := y, r := r);
END_IF;
mode := UDINT_TO_UINT(o.mode);
status := UDINT_TO_UINT(o.status);
)";
inline constexpr const char* st_predictive = R"(IF no_y THEN
  u := $name_control_without_measurement(o := o);
ELSE
  u := $CONTROL(o := o, y := y);
END_IF;
flags := $PREPARE(o := o, next_r := next_r);
status := UDINT_TO_UINT(flags);
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

/// The function block of a design, and an error of the translation.
struct StructuredText {
  std::string text{};
  std::string settings{};  ///< a function, with settings_in_struct
  std::string error{};
};

inline StructuredText structured_text(const RecordedDesign& design) {
  const ListWriter writer(c_language, design.single);
  const CCode code = c_code(design);
  const std::string& name = design.options.name;
  StTranslator translator(code.header + code.source, name);
  translator.initial_from(name + "_init");
  const std::string real = design.single ? "REAL" : "LREAL";
  const auto number = [&](double x) { return StTranslator::number(writer.number(x)); };
  const bool controls = design.is_controller;
  std::string inputs;
  std::string outputs;
  std::string own = "  o : $name_state;\n";
  std::string body;
  const auto variable = [&](std::string& where, const std::string& declared,
                            const std::string& comment) {
    where += "  " + filled(declared, {{"$real", real}}) + ";" +
             (comment.empty() ? "" : " (* " + comment + " *)") + "\n";
  };
  const auto also = [&](const std::string& function) { return translator.root(function); };
  variable(inputs, "y : $real", "the measurement");
  variable(inputs, "no_y : BOOL", "TRUE: there is none at this sample");
  if (controls || design.predictive) {
    variable(inputs, design.predictive ? "next_r : $real" : "r : $real",
             design.predictive    ? "the reference at the next sample"
             : design.compensates ? "u0 of the controller that is helped"
                                  : "the reference");
    variable(inputs, "u_held : $real", "what the actuator held, if starts or reports");
    variable(inputs, "starts : BOOL",
             "TRUE: takes over a plant at rest at y under u_held, before the sample");
    variable(inputs, "reports : BOOL",
             "TRUE: the actuator held u_held instead of u, before the sample");
    variable(outputs, "u : $real", "to be held until the next sample");
    variable(outputs, "start_status : UINT", "");
  } else {
    variable(inputs, "u : $real", "what the actuator held since the last sample");
    variable(inputs, "resets : BOOL", "TRUE: restarts at (y, 0, .., 0) instead");
  }
  if (controls) {
    variable(outputs, std::string("mode : UINT := ") + (design.loop.hold_left > 0 ? "1" : "0"),
             "0: the law, 1: the start hold, 2: too many measurements are missing");
  }
  variable(outputs, "status : UINT", "");
  if (design.options.settings_in_struct) {
    variable(inputs, "settings : $name_settings", "others, of a design of the same structure");
    variable(inputs, "adopts : BOOL", "TRUE: they count from this sample on");
    variable(outputs, "adopted : BOOL", "FALSE: they are not of this structure, nothing changed");
    body += st_adopt;
    also(name + "_adopt");
  }
  const bool guards = design.guard.on;
  if (guards) {
    variable(inputs, "trust : $real := 1.0",
             "0 .. 1: how much a correction of the disturbance counts");
    variable(inputs, "pin : UINT",
             "the actuator is at its limit: 1 upper, 2 lower, 3 by the sign of u; 0 at none");
    variable(inputs, "holds : BOOL",
             controls ? "TRUE: something else holds the plant under u_held at this sample"
                      : "TRUE: something else holds the plant");
    body += st_tell_guard;
    also(name + "_set_trust");
    also(name + "_set_pin");
    if (!also(name + "_set_input_gain").empty()) {
      const std::string gain = number(design.input_gain);
      variable(inputs, "b0 : $real := " + gain, "");
      variable(own, "b0_taken : $real := " + gain, "");
      body += st_tell_gain;
    }
    also(name + "_hold");
    if (!controls) {
      also(name + "_release");
      variable(outputs, "u_to_give : $real", "while it is held");
    }
  }
  if (controls || design.predictive) body += st_starts;
  if (design.measured.on) {
    variable(inputs, "w : $real", "the measured disturbance");
    variable(inputs, "no_w : BOOL", "TRUE: there is none at this sample");
    body += st_tell_measured;
    also(name + "_measured");
  }
  body += controls ? st_controller : design.predictive ? st_predictive : st_observer;
  Words words;
  if (controls || design.predictive) {
    also(name + "_start");
    const std::string applied = also(translator.has("applied") ? "applied" : name + "_applied");
    words.emplace_back("$REPORT", std::string(design.predictive ? "flags" : "done") +
                                      " := " + applied + "(o := o, u := u_held);");
  }
  if (design.predictive) {
    also(name + "_control_without_measurement");
    words.emplace_back("$CONTROL", also("control"));
    words.emplace_back("$PREPARE", also("prepare"));
  } else {
    also(name + "_update");
    if (controls) also(name + "_update_without_measurement");
    if (!controls) also(name + "_predict");
    if (!controls) also(name + "_reset");
    words.emplace_back(
        "$HOLD", !guards     ? (controls ? "IF" : "")
                 : !controls ? st_hold_observer
                             : std::string("IF holds THEN\n  u := $name_hold(o := o, y := y, ") +
                                   (design.error_based ? "r := r, " : "") + "u := u_held);\nELSIF");
  }
  variable(own, "done : BOOL", "");
  variable(own, "flags : UDINT", "");
  also(name + "_estimate");
  for (int row = 0; row < design.size; ++row) {
    const std::string e = "e" + std::to_string(row);
    variable(outputs, e + " : $real",
             row == design.order  ? std::string("the disturbance")
             : row < design.order ? "y" + std::string(static_cast<std::size_t>(row), '\'')
                                  : std::string("an estimate"));
    body += e + " := $name_estimate(o := o, row := " + std::to_string(row) + ");\n";
  }
  const auto& comment = design.options.comment;
  words.insert(words.end(),
               {{"$FLAGS", design.wrap.period > 0 ? ",\n   64 y was refused as an outlier, 128 y "
                                                    "moved otherwise than before: its turn is "
                                                    "uncertain"
                           : design.gate.threshold > 0 || design.law.watches
                               ? ",\n   64 y was refused as an outlier"
                               : ""},
                {"$TIME", number(design.sample_time)},
                {"$GAIN", number(design.input_gain)},
                {"$name", name},
                {"$COMMENT", comment.empty() ? "" : "   " + comment + "\n"}});
  const std::string block = "FUNCTION_BLOCK $name\nVAR_INPUT\n" + inputs + "END_VAR\nVAR_OUTPUT\n" +
                            outputs + "END_VAR\nVAR\n" + own + "END_VAR\n\n" + body +
                            "END_FUNCTION_BLOCK\n";
  return {filled(st_head, words) + translator.text() + filled(block, words),
          design.options.settings_in_struct ? translator.settings(design.options.settings_name)
                                            : std::string(),
          translator.error};
}

/// A text, or that what to_c wrote is not of the subset that is translated: a defect of esokit.
template <class V>
Expected<std::string, Error<V>> as_expected(const StructuredText& all,
                                            std::string StructuredText::*which) {
  Rules<V> rules;
  rules.require(all.error.empty(), "structured_text", V(0),
                "cannot be written: its C has what is not translated (a defect of esokit)");
  if (!rules) return rules.error();
  return all.*which;
}

}  // namespace detail

/// The controller or observer as a function block in Structured Text (IEC 61131-3, second edition:
/// functions with VAR_IN_OUT, no methods), REAL for float and LREAL for double. It is the C of
/// `to_c`, translated function by function, so it takes the same objects, and means the same by
/// bad and missing samples, gaps, restarts and safe mode. A call of the block is a sample; what the
/// C has functions for (a measured w, guards, settings) is inputs. NaN and infinity are refused by
/// ABS(x) <= the largest number, which every PLC has. Counts are UDINT, a status UINT.
/// @param object as for to_c @return types, functions and the block, or an error as for to_c
template <detail::Writable Object>
Expected<std::string, Error<typename Object::scalar_type>> to_structured_text(
    const Object& object, const CodeOptions& options = {}) {
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  return detail::as_expected<typename Object::scalar_type>(detail::structured_text(*design),
                                                           &detail::StructuredText::text);
}

/// With CodeOptions::settings_in_struct: the settings of another design of the same structure, as a
/// function `name_set_settings_name` that gives them to a variable of type `name_settings`, for the
/// input `settings` of the block. @return its text, or an error as for to_structured_text
template <detail::Writable Object>
Expected<std::string, Error<typename Object::scalar_type>> to_structured_settings(
    const Object& object, const CodeOptions& options) {
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  return detail::as_expected<typename Object::scalar_type>(detail::structured_text(*design),
                                                           &detail::StructuredText::settings);
}

}  // namespace esokit
