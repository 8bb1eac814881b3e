#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <esokit/target/c_code.hpp>
#include <esokit/target/detail/c_design.hpp>
#include <esokit/target/detail/design_text.hpp>
#include <esokit/target/detail/list_writer.hpp>
#include <esokit/target/detail/recorded_design.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <initializer_list>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace esokit::detail {

/// A recorded call as a function of C: `static real name(state *o, arguments)` if it gives a
/// number, `static bool` if its shell asks whether a check holds, else `static void`. If a check
/// does not hold, nothing has changed.
inline std::string c_function(const ListWriter& writer, const std::string& prefix,
                              const NamedCall& names, const RecordedCall& call, bool is_asked) {
  const WrittenCall lines = writer.written(names, call);
  const std::string type = names.has_output ? writer.real() : is_asked ? "bool" : "void";
  std::string text = "static " + type + " " + names.name + "(" +
                     (lines.results.empty() ? "const " : "") + prefix + "_state *o";
  for (const auto& argument : names.arguments) text += ", " + writer.real() + " " + argument;
  text += ")\n{\n";
  for (const auto* part : {&lines.reads, &lines.lines}) {
    for (const auto& line : *part) {
      text += std::string("  const ") + (line.is_condition ? "bool" : writer.real()) + " " +
              line.name + " = " + line.expression + ";\n";
    }
  }
  for (const auto& argument : lines.unused) text += "  (void)" + argument + ";\n";
  for (const auto& check : lines.checks) {
    text += "  if (!" + check + ") {\n    return" + (type == "bool" ? " false" : "") + ";\n  }\n";
  }
  for (const auto& [member, value] : lines.results) {
    text += "  o->" + member + " = " + value + ";\n";
  }
  if (lines.results.empty() && lines.reads.empty()) text += "  (void)o;\n";
  if (names.has_output) text += "  return " + lines.output + ";\n";
  if (type == "bool") text += "  return true;\n";
  return text + "}\n\n";
}

/// What is known is computed by functions of the C library, whose last bits are its own.
inline std::string c_library_calls(const RecordedDesign& design) {
  std::string names;
  for (int at = static_cast<int>(Operation::power);
       at <= static_cast<int>(Operation::hyperbolic_tangent); ++at) {
    const auto is_it = [at](const Instruction& one) {
      return static_cast<int>(one.operation) == at;
    };
    const bool used = std::any_of(design.calls.begin(), design.calls.end(), [&](const auto& call) {
      const auto& list = call.list.instructions;
      return std::any_of(list.begin(), list.end(), is_it);
    });
    if (!used) continue;
    const std::string call = c_language.of[static_cast<std::size_t>(at)];
    names +=
        (names.empty() ? "" : ", ") + call.substr(0, call.find('$')) + (design.single ? "f" : "");
  }
  return names;
}

/// What the C of a design has beside the files of target/runtime/: its features, numbers and lists.
class CDesign {
 public:
  /// @param mark of its text, if settings can be changed @param hash see design_hash
  CDesign(const RecordedDesign& design, const std::string& mark, const std::string& hash)
      : design_(design),
        hash_(hash),
        writer_(c_language, design.single),
        text_(design.options.name, design.single) {
    writer_.members = design.members;
    writer_.live = design.live;
    writer_.settings = design.settings;
    set_features();
    set_constants();
    if (design.guard.on) set_guard();
    if (design.rest.on) set_rest();
    if (design.measured.on) set_measured();
    set_map();
    set_rows();
    set_state();
    set_words();
    set_reference();
    if (design.options.settings_in_struct) {
      text_.constant("DESIGN_MARK", mark);
      settings_ = settings(mark);
      text_.lines("DESIGN_SET_OF_SETTINGS", settings_);
    }
  }

  /// `name.h`.
  [[nodiscard]] std::string header() { return text_.header(runtime::header); }

  /// `name.c`.
  [[nodiscard]] std::string source() {
    text_.lines("DESIGN_LISTS", "");
    const std::string shell = text_.parts(runtime::source);
    std::string lists;
    for (std::size_t i = 0; i < design_.names.size(); ++i) {
      const NamedCall& names = design_.names[i];
      if (!RuntimeText::uses(shell, names.name + "(o")) continue;
      const bool stands_alone = shell.find("  " + names.name + "(o") != std::string::npos;
      lists += c_function(writer_, design_.options.name, names, design_.calls[i], !stands_alone);
    }
    text_.lines("DESIGN_LISTS", lists);
    return text_.source(runtime::source);
  }

  /// The settings for a file of their own.
  [[nodiscard]] std::string settings_file() const {
    if (settings_.empty()) return "";
    return "#include \"" + design_.options.name + ".h\"\n\n" + settings_;
  }

 private:
  void set_features() {
    const RecordedDesign& d = design_;
    const bool gains_stand = d.law.kind == RunningLaw::none;
    text_.features({{"ESOKIT_CONTROLLER", d.is_controller},
                    {"ESOKIT_PREDICTIVE", d.predictive},
                    {"ESOKIT_WAITS", d.predictive && d.waits},
                    {"ESOKIT_ERROR_BASED", d.error_based},
                    {"ESOKIT_MOVES", d.options.moving_reference},
                    {"ESOKIT_SAVED", d.options.saves_state},
                    {"ESOKIT_COMPENSATOR", d.compensates},
                    {"ESOKIT_SOFTENS", d.softens},
                    {"ESOKIT_DIVIDED", d.loop.divider > 1},
                    {"ESOKIT_RESTS", d.rest.on},
                    {"ESOKIT_STAYS_SAFE", d.loop.stays_safe},
                    {"ESOKIT_HOLDS_SAFE", d.loop.holds_safe},
                    {"ESOKIT_MONITORED", d.options.watched},
                    {"ESOKIT_SETTINGS", d.options.settings_in_struct},
                    {"ESOKIT_TABLE", gains_stand},
                    {"ESOKIT_RECOVERS", d.recovers},
                    {"ESOKIT_GAIN_IS_KEPT", gains_stand && d.gain_is_kept},
                    {"ESOKIT_SCHEDULE", d.law.kind == RunningLaw::schedule},
                    {"ESOKIT_FILTER", d.law.kind == RunningLaw::filter},
                    {"ESOKIT_RETURNS", d.law.returns},
                    {"ESOKIT_WATCHED", d.law.watches}});
    text_.features({{"ESOKIT_DELAYED", !d.line.empty()},
                    {"ESOKIT_GATED", d.gate.threshold > 0},
                    {"ESOKIT_WRAPPED", d.wrap.period > 0},
                    {"ESOKIT_GATED_ANGLE", d.wrap.gated},
                    {"ESOKIT_LAW_OF_ANGLE", d.is_controller && !d.wrap.angle.empty()},
                    {"ESOKIT_KNOWN", d.known.on},
                    {"ESOKIT_MAPPED", !d.map.lines.empty()},
                    {"ESOKIT_MEASURED", d.measured.on},
                    {"ESOKIT_ONE_W", d.measured.paths.size() == 1},
                    {"ESOKIT_GUARDED", d.guard.on},
                    {"ESOKIT_BOUNDED", d.guard.bound > 0},
                    {"ESOKIT_BOUND_OF_U", d.guard.by_input},
                    {"ESOKIT_LEAKS", d.guard.leak > 0}});
  }

  void set_constants() {
    const RecordedDesign& d = design_;
    const double largest = d.single ? static_cast<double>((std::numeric_limits<float>::max)())
                                    : (std::numeric_limits<double>::max)();
    const auto bridged = static_cast<std::size_t>(d.max_gap) + 1;
    const std::size_t rows = d.recovery.empty() ? bridged : d.recovery.size();
    const unsigned hold = (std::max)(d.loop.hold, d.loop.hold_left);
    text_.feature("ESOKIT_HOLDS_AT_START", hold > 0);
    text_.numbers({{"SAMPLE_TIME", d.sample_time}, {"LARGEST", largest}});
    text_.counts({{"ROWS", rows},
                  {"LAST_ROW", rows - 1},
                  {"MAX_BRIDGED", bridged},
                  {"STATES", static_cast<std::size_t>(d.size)},
                  {"ORDER", static_cast<std::size_t>(d.order)}});
    text_.constant("SAMPLES", std::to_string(d.samples.size()));
    text_.constant("CALLS", std::to_string(d.test_calls.size()));
    text_.counts({{"CALL_LATER", of_row * static_cast<std::size_t>(d.order)},
                  {"DIVIDER", static_cast<std::size_t>(d.loop.divider)},
                  {"MISSING_LIMIT", d.loop.missing_limit}});
    text_.constant("DESIGN_NUMBER", hash_.empty() ? "0u" : "0x" + hash_ + "u");
    text_.counts({{"HOLD_SAMPLES", hold},
                  {"FIRST_HOLD", d.loop.hold_left},
                  {"FIRST_MODE", d.mode()},
                  {"FIRST_PHASE", d.loop.elsewhere ? 5 : 0},
                  {"FIRST_ELSEWHERE", d.loop.elsewhere ? 1 : 0}});
    text_.numbers({{"FIRST_KEPT", d.loop.kept},
                   {"HOLD_INPUT", d.loop.hold_input},
                   {"SAFE_INPUT", d.loop.safe_input}});
    text_.counts({{"LAW_START", d.law.start}, {"LEAST_AGE", d.law.least_age}});
    text_.numbers(
        {{"DECAY", d.law.decay}, {"SHIFT", d.law.shift}, {"CONTRACTION", d.law.contraction}});
    text_.counts({{"DELAY", d.line.empty() ? 0 : d.line.size() - 1}, {"LENGTH", d.line.size()}});
    text_.numbers({{"GATE_FACTOR", d.gate.running_factor}, {"GATE_THRESHOLD", d.gate.threshold}});
    text_.count("GATE_MOST", d.gate.most_in_a_row);
    text_.numbers({{"PERIOD", d.wrap.period},
                   {"PER_PERIOD", d.wrap.inverse_period},
                   {"HALF_PERIOD", d.wrap.period * 0.5},
                   {"QUARTER_PERIOD", d.wrap.period * 0.25},
                   {"MOST_TURNS", d.wrap.most_turns}});
  }

  void set_rest() {
    const RestNumbers& rest = design_.rest;
    if (design_.options.settings_in_struct) {
      text_.replace("REST_ERROR", "o->settings->rest_error");
      text_.replace("REST_SAMPLES", "o->settings->rest_samples");
    } else {
      text_.number("REST_ERROR", rest.error);
      text_.count("REST_SAMPLES", rest.samples);
    }
  }

  void set_guard() {
    const GuardNumbers& guard = design_.guard;
    text_.numbers({{"DISTURBANCE_BOUND", guard.bound},
                   {"BOUND_OF_U", guard.bound_as_given},
                   {"INPUT_GAIN", guard.gain},
                   {"PER_INPUT_GAIN", guard.inverse_gain},
                   {"LEAK", guard.leak}});
    text_.counts({{"LEVELS", static_cast<std::size_t>(guard.levels)},
                  {"SETTLING", guard.settling_samples},
                  {"RELEASE", guard.release_samples},
                  {"UP_SIDE", guard.gain > 0 ? 1 : 2},
                  {"DOWN_SIDE", guard.gain > 0 ? 2 : 1}});
    const auto found = [&](int level) {
      return "o->z" + std::to_string(design_.order + 1) +
             (level > 0 ? "_level" + std::to_string(level + 1) : std::string());
    };
    const auto state = [](int row) { return "o->z" + std::to_string(row + 1); };
    text_.lines("DESIGN_GET_D", each(guard.levels, [&](int i) {
                  return "  " + at("d", i) + " = " + found(i) + ";\n";
                }));
    text_.lines("DESIGN_SET_D", each(guard.levels, [&](int i) {
                  return "  " + found(i) + " = " + at("d", i) + ";\n";
                }));
    text_.lines("DESIGN_GET_X", each(design_.size, [&](int i) {
                  return "  " + at("x", i) + " = " + state(i) + ";\n";
                }));
    text_.replace("DESIGN_X", counted(design_.size, [](int i) { return at("x", i); }));
    text_.replace("DESIGN_D", counted(guard.levels, [](int i) { return at("d", i); }));
  }

  void set_measured() {
    const MeasuredNumbers& measured = design_.measured;
    std::size_t most = 0;
    for (const auto& path : measured.paths) most = (std::max)(most, path.memory.size());
    const auto of_paths = [&](const char* name, const auto& of) {
      text_.replace(name, listed(measured.paths, of));
    };
    of_paths("DESIGN_W_GAINS", [&](const auto& path) { return writer_.number(path.gain); });
    of_paths("DESIGN_W_SHARES", [&](const auto& path) { return writer_.numbers(path.share); });
    of_paths("DESIGN_W_LATES", [&](const auto& path) { return writer_.numbers(path.late); });
    of_paths("DESIGN_W_REACHED", [&](const auto& path) { return writer_.numbers(path.reached); });
    of_paths("DESIGN_W_LAST",
             [](const auto& path) { return std::to_string(path.memory.size() - 1) + "u"; });
    text_.counts({{"W_COUNT", measured.paths.size()},
                  {"W_LENGTH", most},
                  {"W_MOST_LOST", measured.most_lost}});
    text_.number("FOUR_PER_W", 4.0 * static_cast<double>(measured.paths.size()));
  }

  void set_map() {
    const MapNumbers& map = design_.map;
    text_.lines("DESIGN_MAP_ENDS", writer_.rows(std::array{map.inputs, map.effects}));
    text_.lines("DESIGN_MAP_LINES", writer_.rows(map.lines));
    text_.count("MAP_POINTS", map.inputs.size());
    text_.count("MAP_LINES", map.lines.size());
  }

  void set_rows() {
    const auto by_row = [&](const std::string& indent, const auto& line) {
      return each(design_.size, [&](int i) {
        const std::string row = std::to_string(i);
        return indent + "if (row == " + row + "u) {\n" + indent + "  " + line(row) + "\n" + indent +
               "}\n";
      });
    };
    text_.lines("DESIGN_ESTIMATES", by_row("  ", [](const std::string& row) {
                  return "x = estimate_" + row + "(o);";
                }));
    text_.lines("DESIGN_PUBLISHED", by_row("    ", [](const std::string& row) {
                  return "x = o->published_" + row + ";";
                }));
    text_.replace("DESIGN_ALL_ESTIMATES", counted(design_.size, [](int i) {
                    return "estimate_at(o, " + std::to_string(i) + "u)";
                  }));
    if (design_.gap_gains.empty()) return;
    const auto gains = static_cast<int>(design_.gap_gains[0].size());
    text_.constant("GAINS", std::to_string(gains));
    const std::string row =
        design_.options.settings_in_struct ? "o->settings->gains[row][" : "gains[row][";
    text_.replace("DESIGN_K", counted(gains, [&](int i) { return row + std::to_string(i) + "]"; }));
    text_.lines("DESIGN_GAINS", writer_.rows(design_.gap_gains));
    text_.lines("DESIGN_RECOVERY", "    " + recovery() + "\n");
  }

  void set_state() {
    const RecordedDesign& d = design_;
    std::string members;
    std::string settings;
    if (d.options.settings_in_struct) {
      set("settings", "&" + d.options.name + "_" + d.options.settings_name);
    }
    for (std::size_t i = 0; i < d.members.size(); ++i) {
      if (!d.live[i]) continue;
      const bool is_setting = !d.settings.empty() && d.settings[i];
      const std::string scale = scale_text(d, i);
      (is_setting ? settings : members) += "  " + writer_.real() + " " + d.members[i] + ";" +
                                           (scale.empty() ? "" : " /* " + scale + " */") + "\n";
      if (!is_setting) set(d.members[i], writer_.number(d.numbers[i]));
    }
    set_adapters();
    text_.lines("DESIGN_MEMBERS", members);
    text_.lines("DESIGN_SETTINGS", settings);
    text_.lines("DESIGN_INIT", init_);
  }

  void set(const std::string& name, const std::string& value) {
    init_ += "  o->" + name + " = " + value + ";\n";
  }
  using Reals = std::initializer_list<std::pair<const char*, double>>;
  using Counts = std::initializer_list<std::pair<const char*, std::size_t>>;
  /// @param of what the names are of
  void set(const std::string& of, Reals reals, Counts counts) {
    for (const auto& [name, value] : reals) set(of + name, writer_.number(value));
    for (const auto& [name, value] : counts) set(of + name, std::to_string(value) + "u");
  }
  void ring(const std::string& name, const std::vector<double>& numbers) {
    for (std::size_t i = 0; i < numbers.size(); ++i) {
      set(name + "[" + std::to_string(i) + "]", writer_.number(numbers[i]));
    }
  }

  /// What adapters and laws remember of the object.
  void set_adapters() {
    const RecordedDesign& d = design_;
    if (!d.line.empty()) {
      ring("line", d.line);
      set("", {}, {{"newest", d.line.size() - 1}});
    }
    if (d.gate.threshold > 0) {
      set("", {{"gate_mean", d.gate.mean}},
          {{"gate_count", d.gate.count}, {"gate_open", d.gate.open}});
    }
    for (std::size_t w = 0; w < d.measured.paths.size(); ++w) {
      const MeasuredPathNumbers& path = d.measured.paths[w];
      const std::string of = "w[" + std::to_string(w) + "].";
      ring(of + "memory", path.memory);
      set(of, {{"given", 0}, {"last", path.last}, {"lagged", path.lagged}},
          {{"lost", path.lost}, {"newest", path.memory.size() - 1}});
    }
    if (d.measured.on) set("", {{"w_given", d.measured.told}}, {{"w_is_new", 0}});
    if (d.law.kind == RunningLaw::schedule) {
      set("", {}, {{"age", d.law.age}, {"pending", d.law.pending}, {"settled", d.law.settled}});
    }
    if (d.law.kind == RunningLaw::filter) set("", {}, {{"since", d.law.since}});
    if (d.wrap.period > 0) set_turns("taken.", d.wrap.count);
    if (d.wrap.period > 0 && d.wrap.gated) {
      set_turns("seen.", d.wrap.seen);
      set("seen_", {},
          {{"at", d.wrap.seen_at},
           {"steady", d.wrap.seen_steady},
           {"rejected", d.wrap.seen_rejected}});
    }
    if (d.guard.on) set_found(d.guard);
    if (d.rest.on) set("", {{"r_before", d.rest.reference}}, {{"inside", d.rest.inside}});
  }
  void set_turns(const std::string& of, const TurnNumbers& turns) {
    set(of, {{"angle", turns.y}, {"turns", turns.turns}, {"motion", turns.motion}},
        {{"gaps", turns.gaps}, {"doubts", turns.doubts}, {"begun", turns.begun}});
    set(of + "motion_samples",
        turns.samples == 65535 ? "COUNT_MOST" : std::to_string(turns.samples) + "u");
  }
  void set_found(const GuardNumbers& guard) {
    set("",
        {{"trust", guard.trust},
         {"weight_up", guard.weight_up},
         {"weight_down", guard.weight_down},
         {"gain_ratio", guard.gain_ratio},
         {"given_ratio", guard.given_ratio},
         {"input_factor", guard.input_factor}},
        {{"settling_left", guard.settling_left},
         {"release_left", guard.release_left},
         {"pin", guard.pin},
         {"side", guard.side},
         {"held", guard.held},
         {"unsettled", guard.unsettled},
         {"frozen", guard.frozen},
         {"gated", guard.gated}});
  }

  void set_words() {
    const RecordedDesign& d = design_;
    const CodeOptions& options = d.options;
    std::string about = options.comment.empty() ? "" : " * " + options.comment + "\n";
    about += " * T = " + writer_.number(d.sample_time) + " s, b0 = " + writer_.number(d.input_gain);
    if (d.is_controller && !options.settings_in_struct) {
      about += ", u within " + writer_.number(d.lower) + " .. " + writer_.number(d.upper);
    }
    const std::string structure = structure_text(d);
    const std::string dynamics = options.settings_in_struct ? "" : dynamics_text(d);
    text_.lines("DESIGN_ABOUT", about + ".\n * " + structure +
                                    (dynamics.empty() ? "" : "\n * " + dynamics) + ".\n * Design " +
                                    hash_ + ".\n");
    text_.replace("DESIGN_TEXT", "\"" + structure + (dynamics.empty() ? "" : ", " + dynamics) +
                                     ", design " + hash_ + "\"");
    const std::string calls = c_library_calls(d);
    text_.replace("DESIGN_EXACTLY",
                  d.known.on && !calls.empty()
                      ? "bit for bit,\n * where the C library has the same " + calls
                      : "bit for bit");
    text_.replace("DESIGN_Y", d.first_state);
    text_.replace("DESIGN_ANGLE", d.wrap.angle);
    text_.replace("esokit_DESIGN_SET", options.name + "_" + options.settings_name);
    text_.replace("DESIGN_LAST", std::to_string(d.size - 1));
    text_.lines("DESIGN_VECTORS", writer_.rows(d.samples));
    text_.replace("DESIGN_CALLS", listed(d.test_calls, [](const auto& call) {
                    return "{" + std::to_string(call[0]) + "u, " + std::to_string(call[1]) + "u}";
                  }));
  }

  /// What the reference is: r, or with its motion.
  void set_reference() {
    const RecordedDesign& d = design_;
    const auto names = d.references("r");
    const auto declared = [&](const char* r) {
      return listed(d.references(r), [&](const auto& one) { return writer_.real() + " " + one; });
    };
    const auto itself = [](const std::string& name) { return name; };
    text_.replace("DESIGN_R", declared("r"));
    text_.replace("DESIGN_R_GIVEN", listed(names, itself));
    text_.replace("DESIGN_NEXT_R", declared("next_r"));
    text_.replace("DESIGN_NEXT_R_GIVEN", listed(d.references("next_r"), itself));
    text_.replace("DESIGN_MOTION",
                  listed(std::vector<std::string>(names.begin() + 1, names.end()), itself));
    text_.replace("DESIGN_R_AT_REST", listed(names, [&](const std::string& name) {
                    return name == "r" ? "y" : writer_.number(0);
                  }));
    const auto all = [&](const std::string& of, std::size_t first) {
      std::string text;
      for (std::size_t i = first; i < names.size(); ++i) {
        text += (text.empty() ? "" : " && ") + of + "(" + names[i] + ")";
      }
      return text;
    };
    text_.replace("DESIGN_R_IS_FINITE", all("is_finite", 0));
    text_.replace("DESIGN_R_STANDS", all("stands", 1));
    text_.replace("DESIGN_REFERENCE", d.compensates ? "the u0 of the controller that is helped"
                                      : names.size() > 1
                                          ? "the reference, with its derivatives r1, .."
                                          : "the reference");
    text_.constant("COLUMNS", std::to_string(names.size() + 2) + "u");
    text_.replace("DESIGN_SAMPLE_R", counted(d.references(), [](int i) {
                    return i == 0 ? "r" : "given[" + std::to_string(i + 1) + "]";
                  }));
    text_.replace(
        "DESIGN_COLUMNS",
        !d.predictive && !d.is_controller
            ? "y, u, the disturbance"
            : "y, " + listed(d.references(d.predictive ? "next r" : "r"), itself) + ", u");
  }
  std::string recovery() const {
    return listed(design_.recovery, [](unsigned due) { return std::to_string(due) + "u"; });
  }
  std::string settings(const std::string& mark) const {
    const CodeOptions& options = design_.options;
    std::string set = "/* " + dynamics_text(design_) + " */\nconst " + options.name + "_settings " +
                      options.name + "_" + options.settings_name + " = {\n  " + mark;
    for (std::size_t i = 0; i < design_.members.size(); ++i) {
      if (design_.live[i] && design_.settings[i]) {
        set += ",\n  " + writer_.number(design_.numbers[i]);
      }
    }
    set += ",\n  {\n" + writer_.rows(design_.gap_gains) + "  }";
    if (design_.recovers) {
      set += ",\n  {" + recovery() + "},\n  " + std::to_string(design_.max_gap + 1) + "u";
    }
    if (design_.rest.on) {
      set += ",\n  " + writer_.number(design_.rest.error) + ",\n  " +
             std::to_string(design_.rest.samples) + "u";
    }
    return set + "\n};\n\n";
  }

  static std::string at(const char* name, int i) {
    return std::string(name) + "[" + std::to_string(i) + "]";
  }
  const RecordedDesign& design_;
  std::string hash_;
  ListWriter writer_;
  RuntimeText text_;
  std::string init_{};
  std::string settings_{};
};

/// The texts of a design. @param mark of its text, if settings can be changed @param hash of it
inline CCode c_texts(const RecordedDesign& design, const std::string& mark,
                     const std::string& hash) {
  CDesign text(design, mark, hash);
  return {text.header(), text.source(), text.settings_file()};
}

/// Of all but its name, comment and self-test.
inline std::uint32_t hash_of_texts(RecordedDesign design) {
  design.samples.clear();
  design.test_calls.clear();
  design.options.comment = {};
  const CCode code = c_texts(design, "", "");
  return hash_of(code.header + code.source);
}

/// Without what a struct of settings holds.
inline RecordedDesign without_settings(RecordedDesign design) {
  if (!design.options.settings_in_struct) return design;
  for (double& number : design.numbers) number = 0;
  for (auto& row : design.gap_gains) std::fill(row.begin(), row.end(), 0.0);
  if (design.recovers) {  // what is due, and from which gap on, are settings, too
    std::fill(design.recovery.begin(), design.recovery.end(), std::uint16_t{0});
    design.max_gap = 0;
  }
  design.rest.error = 0;
  design.rest.samples = 0;
  design.law_gains.clear();
  design.options.settings_name = {};
  return design;
}

ESOKIT_FUNCTION std::string design_hash(const RecordedDesign& design) {
  RecordedDesign unnamed = without_settings(design);
  unnamed.options.name = CodeOptions{}.name;
  char digits[9];
  std::snprintf(digits, sizeof digits, "%08x", static_cast<unsigned>(hash_of_texts(unnamed)));
  return digits;
}

ESOKIT_FUNCTION CCode c_code(const RecordedDesign& design) {
  const std::string hash = design_hash(design);
  if (!design.options.settings_in_struct) return c_texts(design, "", hash);
  return c_texts(design, std::to_string(hash_of_texts(without_settings(design))) + "u", hash);
}

}  // namespace esokit::detail
