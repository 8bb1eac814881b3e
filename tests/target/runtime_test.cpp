// The files of target/runtime/ by themselves: as C, and as Structured Text.
#include <gtest/gtest.h>

#include <cstdlib>
#include <esokit/target/detail/c_design.hpp>
#include <esokit/target/detail/runtime_text.hpp>
#include <esokit/target/structured_text.hpp>
#include <set>
#include <sstream>
#include <string>
#include <support/numbers.hpp>
#include <vector>

namespace esokit_test {
namespace target_runtime_test {

using namespace esokit;
using detail::RunningLaw;

bool runs(const std::string& command) { return std::system(command.c_str()) == 0; }

/// GCC, Clang and MISRA C:2012 take them in a sample of the sets of features that a design can
/// have; check.py --all: in all.
TEST(Runtime, IsC) {
  for (const std::string program : {"python3", "gcc", "clang", "cppcheck"}) {
    if (!runs("command -v " + program + " >/dev/null 2>&1")) GTEST_SKIP() << "no " << program;
  }
  EXPECT_TRUE(runs("python3 '" ESOKIT_RUNTIME_CHECK "' --count 30 --misra 4"));
}

/// The recorded calls with their arguments; `=` behind those that return a number, `-` behind those
/// that change nothing.
constexpr const char* calls[] = {"restart_at y",
                                 "predict_step u",
                                 "observe y u",
                                 "correct_by y k1 k2 k3",
                                 "correct_step y",
                                 "correct_long y contraction samples",
                                 "estimate_0 = -",
                                 "estimate_1 = -",
                                 "estimate_2 = -",
                                 "shift offset",
                                 "load offset",
                                 "is_inlier y -",
                                 "drive u = -",
                                 "limit u =",
                                 "take_over u",
                                 "within u = -",
                                 "harden",
                                 "soften u",
                                 "scaled_bound bound = -",
                                 "scale_found change",
                                 "predicted_y x1 x2 x3 u = -",
                                 "stand_at y d1 d2",
                                 "schedule_restart",
                                 "schedule_next",
                                 "schedule_settle",
                                 "anchor_begin",
                                 "anchor_take power contraction",
                                 "anchor_contraction power contraction = -",
                                 "anchor_power power contraction = -",
                                 "anchor_end count",
                                 "present_poles = -",
                                 "joined_poles a b = -",
                                 "filter_corrected",
                                 "filter_missed",
                                 "filter_at_ceiling",
                                 "filter_to_limit",
                                 "control_by y =",
                                 "control_blind =",
                                 "take_output u",
                                 "track",
                                 "settle",
                                 "revise u",
                                 "arm_restart",
                                 "arm_at u =",
                                 "arm_blind =",
                                 "arm_blanked =",
                                 "arm_long contraction samples"};

void add_call(detail::RecordedDesign& design, const std::string& call) {
  std::istringstream words(call);
  detail::NamedCall names;
  RecordedCall list;
  list.list.instructions.push_back({.value = 0.5});
  list.next.assign(design.members.size(), -1);
  list.next[0] = 0;
  words >> names.name;
  for (std::string word; words >> word;) {
    if (word == "=") {
      names.has_output = true;
      list.outputs = {0};
    } else if (word == "-") {
      list.next[0] = -1;
    } else {
      names.arguments.push_back(word);
    }
  }
  design.names.push_back(names);
  design.calls.push_back(list);
}

/// A design of random features, as far as they go together.
detail::RecordedDesign design_of(Random& random) {
  const auto is = [&] { return random.index(2) == 0; };
  detail::RecordedDesign d;
  d.options.name = "loop";
  d.options.watched = is();
  d.single = is();
  d.members = {"z1",      "z2",         "z3",          "u_applied",   "u_given",     "u_last",
               "u_asked", "innovation", "published_0", "published_1", "published_2", "z3_level2"};
  d.live.assign(d.members.size(), true);
  d.numbers.assign(d.members.size(), 0.0);
  d.size = 3;
  d.order = 2;
  d.first_state = "z1";
  d.sample_time = 0.01;
  d.input_gain = 8;
  d.max_gap = 1;
  d.samples = {{0, 0, 0}};
  const int kind = random.index(5);
  d.is_controller = kind < 3;
  d.error_based = kind == 1;
  d.compensates = kind == 2;
  d.predictive = kind == 3;
  d.waits = is();
  d.options.moving_reference = (kind == 0 || d.predictive) && is();
  const int law = random.index(3);
  d.law.kind = law == 0 ? RunningLaw::none : law == 1 ? RunningLaw::schedule : RunningLaw::filter;
  d.law.returns = law == 2 && is();
  d.law.watches = law == 2 && is();
  d.gain_is_kept = d.predictive || is();
  const bool stands = law == 0;
  if (stands) {
    d.gap_gains = {{0.5, 0.25, 0.125}, {0.75, 0.5, 0.25}};
    d.recovery = {0, 5};
    d.recovers = is();
  }
  if (!d.predictive) {
    if (is()) d.line = {0, 0, 0};
    if (!d.law.watches && is()) d.gate = {.threshold = 1, .running_factor = 6, .most_in_a_row = 5};
    if (is()) d.wrap = {.period = 2.5, .inverse_period = 0.4, .most_turns = 1e6};
    d.wrap.gated = d.wrap.period > 0 && (d.gate.threshold > 0 || d.law.watches);
    d.known.on = law != 1 && is();
    if (d.wrap.period > 0 && d.is_controller && !d.error_based && !d.compensates && law != 1 &&
        !d.known.on && !d.options.moving_reference) {
      d.wrap.angle = "z1";
    }
    d.guard.on = stands && d.gain_is_kept && is();
    d.guard.levels = 2;
    d.guard.bound = is() ? 1.5 : 0;
    d.guard.by_input = is();
    d.guard.leak = is() ? 0.01 : 0;
    if (!d.guard.on && is()) {
      d.measured = {true, 7, 0, {{.memory = {0, 0, 0}}}};
      if (is()) d.measured.paths.push_back({.memory = {0, 0}});
    }
  }
  d.loop.holds_safe = is();
  d.loop.stays_safe = is();
  d.loop.hold_left = is() ? 13 : 0;
  if (d.is_controller) {
    d.loop.divider = is() ? 3 : 1;
    d.softens = !d.compensates && is();
    d.rest.on = !d.compensates && d.loop.divider == 1 && is();
  }
  if (!d.predictive && is()) {
    d.map = {{-3, 3}, {-0.5, 0.5}, {{2.5, 1, 1}, {0, 0.125, 8}, {-2.5, 1, 1}}};
  }
  d.options.settings_in_struct = !d.predictive && stands && d.gain_is_kept && !d.softens && is();
  if (d.options.settings_in_struct) d.settings.assign(d.members.size(), false);
  for (const char* call : calls) add_call(d, call);
  add_call(d, d.wrap.period > 0 ? "rest_at y u angle" : "rest_at y u");
  const std::string r = d.options.moving_reference ? "r r1 r2" : "r";
  add_call(d, "refer " + r);
  add_call(d, law == 1 ? "law_for " + r + " e0 e1 e2 = -" : "law " + r + " = -");
  add_call(d, stands ? "arm_by k1 k2 k3" : "arm_by");
  return d;
}

/// The functions that a text of C has.
std::set<std::string> functions_of(const std::string& text, const std::string& prefix) {
  std::set<std::string> names;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t end = line.find('(');
    const bool begins = !line.empty() && std::isalpha(static_cast<unsigned char>(line[0])) != 0;
    if (!begins || end == std::string::npos || line.back() != ')') continue;
    std::string name = line.substr(0, end);
    name = name.substr(name.rfind(' ') + 1);
    if (name.compare(0, prefix.size(), prefix) == 0) name = name.substr(prefix.size());
    names.insert(name);
  }
  return names;
}

/// Each function in any set of features is of the subset that is translated.
TEST(Runtime, IsStructuredText) {
  std::set<std::string> missing;
  for (const char* file : detail::runtime::source) missing.merge(functions_of(file, "esokit_"));
  EXPECT_GT(missing.size(), 90U);
  for (const char* in_c_alone : {"save", "load", "crc_of", "pass_sample", "kept"}) {
    missing.erase(in_c_alone);
  }
  Random random(64);
  for (int k = 0; k < 400; ++k) {
    const detail::RecordedDesign design = design_of(random);
    const CCode code = detail::c_code(design);
    EXPECT_EQ(detail::structured_text(design).error, "") << code.source;
    for (const std::string& name : functions_of(code.source, "loop_")) missing.erase(name);
    if (HasFailure()) return;
  }
  missing.erase("is_finite");
  std::string names;
  for (const std::string& name : missing) names += name + " ";
  EXPECT_EQ(names, "") << "are in no design";
}

}  // namespace target_runtime_test
}  // namespace esokit_test
