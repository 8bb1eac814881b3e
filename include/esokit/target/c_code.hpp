/// @file
/// to_c: a finished controller or observer as C99, written from its recorded calls.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_adapter_text.hpp>
#include <esokit/target/c_angle_text.hpp>
#include <esokit/target/c_guard_text.hpp>
#include <esokit/target/c_law_text.hpp>
#include <esokit/target/c_text.hpp>
#include <esokit/target/c_words.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_design.hpp>
#include <esokit/target/writable.hpp>
#include <string>

namespace esokit {

/// The two files, `name.h` and `name.c`.
struct CCode {
  std::string header{};  ///< text of `name.h`
  std::string source{};  ///< text of `name.c`

  /// With CodeOptions::settings_in_struct: text of the struct for a file of its own, where it is
  /// not that of `name.c` but of another design, for `name_adopt`.
  std::string settings{};
};

namespace detail {

/// `static bool name(state *o, arguments, *u)`: true, or false if a check does not hold; then
/// nothing has changed.
inline std::string c_function(const ListWriter& writer, const std::string& prefix,
                              const NamedCall& names, const RecordedCall& call) {
  const WrittenCall lines = writer.written(names, call);
  std::string text = "static bool " + names.name + "(" + (lines.results.empty() ? "const " : "") +
                     prefix + "_state *o";
  for (const auto& argument : names.arguments) text += ", " + writer.real() + " " + argument;
  if (names.has_output) text += ", " + writer.real() + " *u_out";
  text += ")\n{\n";
  for (const auto* part : {&lines.reads, &lines.lines}) {
    for (const auto& line : *part) {
      text += std::string("  const ") + (line.is_condition ? "bool" : writer.real()) + " " +
              line.name + " = " + line.expression + ";\n";
    }
  }
  for (const auto& argument : lines.unused) text += "  (void)" + argument + ";\n";
  for (const auto& check : lines.checks)
    text += "  if (!" + check + ") {\n    return false;\n  }\n";
  for (const auto& [member, value] : lines.results) {
    text += "  o->" + member + " = " + value + ";\n";
  }
  if (lines.results.empty() && lines.reads.empty()) text += "  (void)o;\n";
  if (names.has_output) text += "  *u_out = " + lines.output + ";\n";
  return text + "  return true;\n}\n\n";
}

/// The two files of a design.
inline CCode c_texts(const RecordedDesign& design, const std::string& mark) {
  ListWriter writer(c_language, design.single);
  writer.members = design.members;
  writer.live = design.live;
  writer.settings = design.settings;
  std::string lists;
  for (std::size_t i = 0; i < design.names.size(); ++i) {
    const std::string& name = design.names[i].name;
    if ((design.gate.threshold > 0 || design.law.watches || design.predictive ||
         design.measured.on) &&
        name == "observe") {
      continue;
    }
    if (name == "filter_to_limit" && !design.law.returns) continue;
    lists += c_function(writer, design.options.name, design.names[i], design.calls[i]);
  }
  const bool controls = design.is_controller;
  Words words = controls            ? c_loop_words(design, writer)
                : design.predictive ? c_phase_words(design)
                                    : c_observer_words(design);
  // Layer by layer: each calls the one below.
  std::string layers;
  std::string predict = "base";
  std::string correct = "base";
  std::string update = "base";
  std::string rest = "rest_at";
  std::string restart = "restart";
  const auto add = [&](const char* text) {
    layers += filled(text, {{"predict_$below", "predict_" + predict},
                            {"correct_$below", "correct_" + correct},
                            {"update_$below", "update_" + update}});
  };
  const bool gated = design.gate.threshold > 0;
  const bool runs = design.law.kind != RunningLaw::none;
  const bool wraps = design.wrap.period > 0;
  if (runs) {
    add(c_source_running);
    predict = "running";
  }
  const bool measures = design.measured.on;
  if (measures) {
    const bool updates = !gated && !design.law.watches;
    add(filled(c_measured(design, writer, controls),
               {{"$W_UPDATE", updates ? c_source_measured_update : ""}})
            .c_str());
    predict = "measured";
  }
  if (design.law.watches) {
    add(c_source_watched);
    if (!design.predictive) add(c_source_watched_update);
    correct = update = "watched";
  }
  if (gated) {
    add(c_source_gate);
    correct = update = "gated";
  } else if (measures && !design.law.watches) {
    update = "measured";
  } else if (!design.law.watches && !design.predictive) {
    add(c_source_base_update);
    if (runs) {
      add(c_source_running_update);
      update = "running";
    }
  }
  if (wraps) {
    add(c_source_wrapped);
    layers += design.wrap.gated ? c_source_wrapped_gated : c_source_wrapped_keep;
    add(c_source_wrapped_layer);
    predict = correct = update = "wrapped";
    restart = "restart_wrapped";
  }
  if ((controls || design.predictive) && (wraps || runs)) {
    layers += wraps ? c_source_wrapped_rest : c_source_running_rest;
    rest = wraps ? "rest_wrapped" : "rest_running";
  }
  if (design.known.on) {
    add(c_source_known);
    predict = update = "known";
  }
  if (!design.line.empty()) {
    add(c_source_delay);
    if (controls) layers += c_source_delay_fill;
    predict = update = "delayed";
  }
  if (design.guard.on) {  // the outermost
    add(c_source_guarded);
    if (!design.softens) add(c_source_guarded_gain);
    if (!controls) add(c_source_guarded_hold);
    predict = correct = update = "guarded";
    layers += filled(controls ? c_source_guarded_rest : c_source_guarded_restart,
                     {{"$below_restart", restart}, {"$below_rest", rest}});
    rest = "rest_guarded";
    restart = "restart_guarded";
  }
  words.insert(words.end(), {{"predict_$top", "predict_" + predict},
                             {"correct_$top", "correct_" + correct},
                             {"update_$top", "update_" + update},
                             {"$restart", restart},
                             {"$rest", rest}});
  const Words common = c_words(design, writer);
  words.insert(words.end(), common.begin(), common.end());
  const auto text = [&](const std::string& from) { return filled(from, words); };
  const char* law_text = design.law.kind == RunningLaw::schedule ? c_source_schedule
                         : runs                                  ? c_source_filter
                                                                 : "";
  const bool opens = design.options.settings_in_struct;
  std::string set;
  if (opens) {
    set = "const $name_settings $name_$SET = {\n  $DESIGN";
    for (std::size_t i = 0; i < design.members.size(); ++i) {
      if (design.live[i] && design.settings[i]) set += ",\n  " + writer.number(design.numbers[i]);
    }
    set += ",\n  {\n";
    for (const auto& row : design.gap_gains) {
      std::string line;
      for (const double k : row) line += (line.empty() ? "    {" : ", ") + writer.number(k);
      set += line + "},\n";
    }
    set += "  }\n};\n\n";
    words.insert(words.begin(), {"$DESIGN", mark});
  }
  set = text(set);
  return {text(c_header_head) + (opens ? text(c_header_settings) : "") +
              text(controls            ? c_header_controller
                   : design.predictive ? c_header_predictive
                                       : c_header_observer) +
              text(c_header_tail),
          text(c_source_head) + c_source_recorded + set + lists + text(law_text) +
              text("$TABLE_OF_FILE") + text(c_source_observer_part) + text(layers) +
              text(controls            ? c_source_controller
                   : design.predictive ? c_source_predictive
                                       : c_source_observer) +
              (controls && design.guard.on ? text(c_source_guarded_hold_sample) : "") +
              (opens ? text(c_source_adopt) : "") + text(c_source_self_test),
          opens ? "#include \"" + design.options.name + ".h\"\n\n" + set : ""};
}

/// The texts; settings bear a mark of what else is in them.
inline CCode c_code(const RecordedDesign& design) {
  if (!design.options.settings_in_struct) return c_texts(design, "");
  RecordedDesign rest = design;
  for (double& number : rest.numbers) number = 0;
  for (auto& row : rest.gap_gains) std::fill(row.begin(), row.end(), 0.0);
  rest.samples.clear();
  rest.options.comment = {};
  rest.options.settings_name = {};
  const CCode same = c_texts(rest, "");
  std::uint32_t mark = 2166136261u;  // FNV-1a
  for (const char c : same.header + same.source) {
    mark = (mark ^ static_cast<unsigned char>(c)) * 16777619u;
  }
  return c_texts(design, std::to_string(mark) + "u");
}

}  // namespace detail

/// The controller or observer as C99, two files without a library: state struct, init, update,
/// estimates in physical units, and a self-test that compares with the C++ (compiled if
/// `NAME_SELF_TEST` is defined); of a controller also start, of an observer reset, predict and
/// correct. What is done at a sample is recorded from its own calls, so there is no second
/// implementation; settings are constants, or, with `settings_in_struct`, gains and limits in a
/// struct that `name_adopt` changes while it runs, as `adopt` does. Bad and missing samples, gaps,
/// restarts, the start hold and safe mode are those of the object, too.
///
/// Compiled without contraction (-std=c99 in GCC) it equals the C++ bit for bit, as far as tested:
/// after any bad sample, gap, report or start. Where the design computes a power or an exponential
/// at each sample (NonlinearEso), nothing is promised through those of another library. A gap of
/// each length has its gains in a table of max_gap + 1 rows: choose `max_gap` as short as the
/// machine allows.
///
/// Written are LinearEso, also with a set of poles, HalfGainEso, ReducedOrderEso, CascadeEso,
/// AdjustableBandwidthEso, NonlinearEso, ModelEso, PlantEso and their cascades (not with
/// `follows_speed`), AlgebraicEso, ExtendedStateFilter (in its modes recursive and frozen, without
/// a nominal model), these in DelayedInput, OutlierGate and WrappedOutput, in KnownModel if its
/// function is generic (not AlgebraicEso), in Measured (not around WrappedOutput or another
/// Measured, and not in Guarded), LinearEso and CascadeEso in Guarded, too (a changing b0 unless
/// the law softens), Adrc of both forms and DisturbanceCompensator around them, and PredictiveAdrc
/// around one without an adapter whose gain is known before the measurement (not
/// AdjustableBandwidthEso or NonlinearEso), so EPADRC around ExtendedStateFilter, too. Others do
/// not compile.
///
/// The function of a KnownModel is recorded like all else, with its own numbers as constants: it is
/// `template <class E> auto operator()(const E& x) const noexcept`, or a template of the scalar
/// with `with_scalar`. It adds, multiplies and compares numbers of the observer's scalar (and
/// integers), and calls abs, sqrt, pow, exp, expm1, sin, cos, tan, atan and tanh as by `using
/// std::sin;`. A branch on a value does not compile: `select(condition, a, b)` chooses.
///
/// SmoothProfile and HealthMonitor: target/profile_code.hpp and target/health_code.hpp.
/// @param object as `make` returned it: its state is that of `init`
/// @return error for a name that is no identifier, a comment that would end the one it stands in, a
///         number of samples of the self-test out of range, or a gain law of your own whose gain
///         after a gap depends on the innovation
template <detail::Writable Object>
Expected<CCode, Error<typename Object::scalar_type>> to_c(const Object& object,
                                                          const CodeOptions& options = {}) {
  const auto design = detail::recorded_design(object, options);
  if (!design) return design.error();
  return detail::c_code(*design);
}

/// What cannot be written yet, by name.
template <class Other>
void to_c(const Other&, const CodeOptions& = {}) {
  static_assert(detail::knows_in_general<Other>,
                "esokit: to_c records the function of a KnownModel: it has to be generic, template "
                "<class E> auto operator()(const E& x) const noexcept, in numbers of the "
                "observer's scalar");
  static_assert(
      !detail::knows_in_general<Other> || detail::Writable<Other>,
      "esokit: to_c writes LinearEso, HalfGainEso, ReducedOrderEso, CascadeEso, "
      "AdjustableBandwidthEso, NonlinearEso, ModelEso, PlantEso, AlgebraicEso and "
      "ExtendedStateFilter, these in DelayedInput, OutlierGate, WrappedOutput and Measured, in "
      "KnownModel (not AlgebraicEso), on the chain with one extended state in Guarded, and "
      "Adrc and DisturbanceCompensator around them, and PredictiveAdrc around one without an "
      "adapter whose gain does not depend on the innovation; no other gains, adapters or "
      "controllers yet");
}

}  // namespace esokit
