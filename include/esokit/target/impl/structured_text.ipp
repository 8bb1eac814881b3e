#pragma once

#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/design_text.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/st_translator.hpp>
#include <esokit/target/structured_text.hpp>
#include <string>
#include <vector>

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
  return {filled(head, words_) + translator.text_for(block), {}, translator.error};
}

/// The block of a controller or an observer.
class DesignBlock {
 public:
  explicit DesignBlock(const RecordedDesign& design)
      : design_(design),
        name_(design.options.name),
        block_(c_code(design), design.options, design.single, "_init"),
        acts_(design.is_controller || design.predictive),
        references_(design.references(design.predictive ? "next_r" : "r")) {
    add_sample();
    if (design.options.settings_in_struct) add_settings();
    if (design.guard.on) add_guard();
    if (acts_) block_.body += st_starts;
    if (design.measured.on) add_measured();
    block_.body += design.is_controller ? st_controller
                   : design.predictive  ? st_predictive
                                        : st_observer;
    block_.own("flags : UDINT");
    add_estimates();
    if (design.options.watched && design.is_controller) add_watched();
    block_.body =
        filled(block_.body,
               {{"$HOLD", hold()},
                {"$R", listed(references_, [](const std::string& r) { return r + " := " + r; })}});
  }

  [[nodiscard]] StructuredText text() {
    StructuredText all = block_.text(head());
    if (design_.options.settings_in_struct) {
      all.settings = block_.translator.settings(design_.options.settings_name);
    }
    return all;
  }

 private:
  [[nodiscard]] std::string number(double x) const {
    return StTranslator::number(ListWriter(c_language, design_.single).number(x));
  }

  /// What is given with a sample, and what comes of it.
  void add_sample() {
    block_.input("y : $real", "the measurement");
    block_.input("no_y : BOOL", "TRUE: there is none at this sample");
    if (acts_) {
      for (const std::string& r : references_) {
        block_.input(r + " : $real", r != references_[0]   ? "its derivative"
                                     : design_.predictive  ? "the reference at the next sample"
                                     : design_.compensates ? "u0 of the controller that is helped"
                                                           : "the reference");
      }
      block_.input("u_held : $real", "what the actuator held, if starts or reports");
      block_.input("starts : BOOL",
                   "TRUE: takes over a plant at rest at y under u_held, before the sample");
      block_.input("reports : BOOL",
                   "TRUE: the actuator held u_held instead of u, before the sample; a limit of "
                   "rate counts from u");
      block_.output("u : $real", "to be held until the next sample");
      block_.output("start_status : UINT");
      block_.output("report_status : UINT");
      block_.output("mode : UINT := " + std::to_string(design_.mode()),
                    std::string("0: the law, 1: the start hold, 2: too many measurements are "
                                "missing") +
                        (design_.rest.on ? ", 3: it rests, u is held" : ""));
    } else {
      block_.input("u : $real", "what the actuator held since the last sample");
      block_.input("resets : BOOL", "TRUE: restarts at (y, 0, .., 0) instead");
    }
    block_.output("status : UINT");
  }

  void add_settings() {
    block_.input("settings : $name_settings", "others, of a design of the same structure");
    block_.input("adopts : BOOL", "TRUE: they count from this sample on");
    block_.output("adopted : BOOL", "FALSE: they are not of this structure, nothing changed");
    block_.body += st_adopt;
  }

  void add_guard() {
    const bool controls = design_.is_controller;
    block_.input("trust : $real := 1.0", "0 .. 1: how much a correction of the disturbance counts");
    block_.input("pin : UINT",
                 "the actuator is at its limit: 1 upper, 2 lower, 3 by the sign of u; 0 at none");
    block_.input("holds : BOOL",
                 controls ? "TRUE: something else holds the plant under u_held at this sample"
                          : "TRUE: something else holds the plant");
    block_.output("guard_status : UINT", "2: trust or pin is none, the last one counts");
    block_.body += st_tell_guard;
    if (block_.translator.has(name_ + "_set_input_gain")) {
      const std::string gain = number(design_.input_gain);
      block_.input("b0 : $real := " + gain);
      block_.own("b0_taken : $real := " + gain);
      block_.body += st_tell_gain;
    }
    if (!controls) block_.output("u_to_give : $real", "while it is held");
  }

  void add_measured() {
    const std::size_t count = design_.measured.paths.size();
    if (count > 1) block_.own("w : $name_numbers_" + std::to_string(count));
    for (std::size_t i = 0; i < count; ++i) {
      const std::string w = count > 1 ? "w" + std::to_string(i + 1) : "w";
      block_.input(w + " : $real", "a measured disturbance");
      if (count > 1) block_.body += "w[" + std::to_string(i) + "] := " + w + ";\n";
    }
    block_.input("no_w : BOOL", "TRUE: there is none at this sample");
    block_.body += st_tell_measured;
  }

  void add_estimates() {
    for (int row = 0; row < design_.size; ++row) {
      const std::string e = "e" + std::to_string(row);
      block_.output(e + " : $real", row == design_.order ? std::string("the disturbance")
                                    : row < design_.order
                                        ? "y" + std::string(static_cast<std::size_t>(row), '\'')
                                        : std::string("an estimate"));
      block_.body += e + " := $name_estimate(o := o, row := " + std::to_string(row) + ");\n";
    }
  }

  void add_watched() {
    block_.output("innovation : $real", "what a HealthMonitor takes, and the next three");
    block_.output("asked : $real");
    block_.output("applied : $real");
    block_.output("missed : UINT");
    block_.body +=
        "innovation := o.innovation;\nasked := o.u_asked;\napplied := o.u_applied;\n"
        "missed := UDINT_TO_UINT(o.gap);\n";
  }

  /// What comes before a sample where something else may hold the plant.
  [[nodiscard]] std::string hold() const {
    if (!design_.guard.on) return design_.is_controller ? "IF" : "";
    if (!design_.is_controller) return st_hold_observer;
    return std::string("IF holds THEN\n  u := $name_hold(o := o, y := y, ") +
           (design_.error_based ? "r := r, " : "") + "u := u_held);\nELSIF";
  }

  [[nodiscard]] std::string head() const {
    const bool gates = design_.gate.threshold > 0 || design_.law.watches;
    return filled(
        st_head,
        {{"$FLAGS", design_.wrap.period > 0 ? ",\n   64 y was refused as an outlier, 128 y moved "
                                              "otherwise than before: its turn is uncertain"
                    : gates                 ? ",\n   64 y was refused as an outlier"
                                            : ""},
         {"$OF_R", acts_ ? ",\n   256 r was NaN, infinite or too large: u is as it was" : ""},
         {"$DESIGN", structure_text(design_) + ", design " + design_hash(design_)},
         {"$TIME", number(design_.sample_time)},
         {"$GAIN", number(design_.input_gain)}});
  }

  const RecordedDesign& design_;
  const std::string& name_;
  StBlock block_;
  bool acts_;  ///< it is not an observer alone
  std::vector<std::string> references_;
};

ESOKIT_FUNCTION StructuredText structured_text(const RecordedDesign& design) {
  return DesignBlock(design).text();
}

}  // namespace detail
}  // namespace esokit
