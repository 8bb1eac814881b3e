/// @file
/// to_c: a finished controller as C99, written from its recorded calls.
#pragma once

#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <esokit/control/adrc.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/target/recorder.hpp>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace esokit {

/// How the C is to be written.
struct CCodeOptions {
  std::string name = "controller";  ///< begins every name and the files: an identifier of C
  std::string comment{};            ///< at the head of the header: which machine, which design
  int self_test_samples = 100;      ///< samples of the self-test, 1 .. 10000
};

/// The two files, `name.h` and `name.c`.
struct CCode {
  std::string header{};  ///< text of `name.h`
  std::string source{};  ///< text of `name.c`
};

namespace detail {

/// What is private in a controller and is recorded apart.
struct RecordAccess {
  template <class C>
  static auto& loop(C& c) noexcept {
    return c.loop_;
  }
  /// u of the law for the present estimate, before the limits; as if no start hold were left.
  template <class C, class S>
  static S law(C& c, const S& reference) noexcept {
    c.loop_.mode_ = LoopMode::running;
    return c.judged(reference);
  }
  /// The output of the loop for a u that is wanted.
  template <class Loop, class S>
  static S limited(Loop& loop, const S& wanted) noexcept {
    return loop.limited(wanted);
  }
  template <class C>
  static bool softens(const C& c) noexcept {
    return c.soft_.on();
  }
  /// The law as designed again.
  template <class C>
  static void harden(C& c) noexcept {
    c.soft_.reset();
  }
  template <class Loop, class S>
  static void report(Loop& loop, const S& u_applied) noexcept {
    loop.report_applied(u_applied);
  }

  /// The rules of the loop: plain numbers.
  struct Rules {
    unsigned hold_left;
    unsigned missing_limit;
    int divider;
    bool has_safe_input;
    bool stays_safe;
    double hold_input;
    double safe_input;
  };
  template <class Loop>
  static Rules rules(const Loop& loop) noexcept {
    return {loop.hold_left_,
            loop.missing_limit_,
            loop.divider_,
            loop.has_safe_input_,
            loop.stay_safe_,
            static_cast<double>(loop.hold_input_),
            static_cast<double>(loop.safe_input_)};
  }
};

/// A function of the C file: a recorded call with names.
struct CFunction {
  std::string name;
  std::vector<std::string> arguments;
  bool has_output = false;  ///< it writes *u
};

/// Writes recorded calls as functions of C.
class CWriter {
 public:
  CWriter(bool single, std::string prefix) : single_(single), prefix_(std::move(prefix)) {}

  std::vector<std::string> members{};  ///< a name for each number of the object
  std::vector<bool> live{};            ///< the numbers that the state needs

  [[nodiscard]] std::string real() const { return single_ ? "float" : "double"; }
  /// The number, read back bit for bit.
  [[nodiscard]] std::string number(double value) const {
    char digits[40];
    std::snprintf(digits, sizeof digits, single_ ? "%.9g" : "%.17g", value);
    std::string text = digits;
    if (text.find_first_of(".e") == std::string::npos) text += ".0";
    return single_ ? text + "f" : text;
  }

  /// Which instructions are needed for checks, outputs and live numbers.
  [[nodiscard]] std::vector<bool> needed(const RecordedCall& call) const {
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

  /// Adds the numbers that the calls read to the live ones.
  void find_live(const RecordedObject& all) {
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

  /// `static int name(state *o, arguments, *u)`: 1, or 0 if a check does not hold; then nothing has
  /// changed.
  [[nodiscard]] std::string function(const CFunction& names, const RecordedCall& call) const {
    const auto& list = call.list.instructions;
    const auto need = needed(call);
    std::string text = "static int " + names.name + "(" + prefix_ + "_state *o";
    for (const auto& argument : names.arguments) text += ", " + real() + " " + argument;
    if (names.has_output) text += ", " + real() + " *u_out";
    text += ")\n{\n";

    std::vector<int> uses(list.size(), 0);
    const auto use = [&](int index, int times) {
      if (index >= 0) uses[static_cast<std::size_t>(index)] += times;
    };
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (!need[i] || list[i].operation == Operation::argument) continue;
      use(list[i].a, 1);
      use(list[i].b, 1);
      use(list[i].c, 1);
    }
    for (const int output : call.outputs) use(output, 2);
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (live[i]) use(call.next[i], 2);
    }

    std::vector<std::string> of(list.size());
    std::vector<int> depth(list.size(), 0);
    std::vector<bool> given(names.arguments.size(), false);
    int temporaries = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Instruction& one = list[i];
      if (!need[i]) continue;
      if (one.operation == Operation::constant) {
        of[i] = number(one.value);
        if (one.value < 0) of[i] = "(" + of[i] + ")";
        continue;
      }
      if (one.operation == Operation::argument) {
        const auto from = static_cast<std::size_t>(one.a);
        if (from < members.size()) {
          of[i] = members[from];
          text += "  const " + real() + " " + of[i] + " = o->" + of[i] + ";\n";
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
          this->expression(one.operation, part(one.a), part(one.b), part(one.c));
      const bool in_place = uses[i] == 1 && deep < 4 && one.operation != Operation::choose;
      if (in_place) {
        of[i] = "(" + expression + ")";
        depth[i] = deep;
        continue;
      }
      for (std::size_t m = 0; m < live.size() && of[i].empty(); ++m) {
        if (live[m] && call.next[m] == static_cast<int>(i)) of[i] = members[m] + "_next";
      }
      if (of[i].empty()) of[i] = "t" + std::to_string(++temporaries);
      text += std::string("  const ") + (is_condition(one.operation) ? "int" : real()) + " " +
              of[i] + " = " + expression + ";\n";
    }
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (!given[i]) text += "  (void)" + names.arguments[i] + ";\n";
    }
    const auto at = [&](int index) { return of[static_cast<std::size_t>(index)]; };
    std::vector<bool> checked(list.size(), false);
    for (const int check : call.list.checks) {
      const auto index = static_cast<std::size_t>(check);
      if (!checked[index]) text += "  if (!" + of[index] + ") return 0;\n";
      checked[index] = true;
    }
    bool writes = false;
    for (std::size_t i = 0; i < live.size(); ++i) {
      if (!live[i] || call.next[i] < 0) continue;
      text += "  o->" + members[i] + " = " + at(call.next[i]) + ";\n";
      writes = true;
    }
    if (!writes) text += "  (void)o;\n";
    for (const int output : call.outputs) text += "  *u_out = " + at(output) + ";\n";
    return text + "  return 1;\n}\n\n";
  }

 private:
  [[nodiscard]] std::string expression(Operation operation, const std::string& a,
                                       const std::string& b, const std::string& c) const {
    const auto called = [&](const char* name, const std::string& given) {
      return name + std::string(single_ ? "f(" : "(") + given + ")";
    };
    switch (operation) {
      case Operation::add:
        return a + " + " + b;
      case Operation::subtract:
        return a + " - " + b;
      case Operation::multiply:
        return a + " * " + b;
      case Operation::divide:
        return a + " / " + b;
      case Operation::negate:
        return "-" + a;
      case Operation::magnitude:
        return called("fabs", a);
      case Operation::square_root:
        return called("sqrt", a);
      case Operation::power:
        return called("pow", a + ", " + b);
      case Operation::exponential:
        return called("exp", a);
      case Operation::exponential_less_one:
        return called("expm1", a);
      case Operation::choose:
        return a + " ? " + b + " : " + c;
      case Operation::less:
        return a + " < " + b;
      case Operation::greater:
        return a + " > " + b;
      case Operation::at_most:
        return a + " <= " + b;
      case Operation::at_least:
        return a + " >= " + b;
      case Operation::finite:
        return "is_finite(" + a + ")";
      case Operation::both:
        return a + " && " + b;
      case Operation::either:
        return a + " || " + b;
      case Operation::opposite:
        return "!" + a;
      case Operation::constant:
      case Operation::argument:
        break;
    }
    return a;
  }

  bool single_;
  std::string prefix_;
};

/// `text` with each `$key` replaced.
inline std::string filled(std::string text,
                          const std::vector<std::pair<std::string, std::string>>& words) {
  for (const auto& [key, word] : words) {
    for (std::size_t at = 0; (at = text.find(key, at)) != std::string::npos; at += word.size()) {
      text.replace(at, key.size(), word);
    }
  }
  return text;
}

// What is integers is text of C, written once: the counterpart of PredictorCorrector::predict,
// correct and of ControlLoop.
inline constexpr const char* c_header = R"(#ifndef $NAME_H
#define $NAME_H
/* Written by esokit from a finished design; do not edit.
$COMMENT * T = $TIME s, b0 = $GAIN, u within $LOWER .. $UPPER.
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ bit for bit. */

$include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Flags of `status`; 0: all is well. */
#define $NAME_MEASUREMENT_REJECTED 1u /* y was NaN, infinite or too large */
#define $NAME_INPUT_REJECTED 2u /* u was too large: the last good one was used */
#define $NAME_PREDICTION_DROPPED 4u /* the next good y restarts */
#define $NAME_GAP_BRIDGED 8u /* samples were missing before this one */
#define $NAME_RESTARTED 16u /* too many samples were missing */
#define $NAME_STATE_REJECTED 32u /* start: y is not finite or too large */

/* `mode`: what determines u. */
#define $NAME_RUNNING 0u
#define $NAME_START_HOLD 1u
#define $NAME_SAFE 2u /* too many measurements are missing */

typedef struct {
$MEMBERS  uint32_t hold_left; /* samples of the start hold */
  uint16_t gap; /* samples since the last measurement that was taken */
  uint8_t mode;
  uint8_t status;
} $name_state;

/* At rest at y = 0, u = 0. Call it before all else. */
void $name_init($name_state *o);
/* Takes over a plant at rest at y under u, with the reference at y. Returns a status. */
unsigned $name_start($name_state *o, $real y, $real u);
/* One sample: y (NaN if it is missing) and the reference; returns the u to be held until the next. */
$real $name_update($name_state *o, $real y, $real r);
/* The same without a measurement. */
$real $name_update_without_measurement($name_state *o, $real r);
/* What the actuator really held, before the next update; only if it differs from what update gave. */
void $name_applied($name_state *o, $real u);

#ifdef $NAME_SELF_TEST
/* 0, or the number of the first sample whose u differs from that of the design by more than
 * `tolerance`; 0 asks for equal numbers. */
int $name_self_test($real tolerance);
#endif

#ifdef __cplusplus
}
#endif
#endif
)";

inline constexpr const char* c_head =
    R"(/* Written by esokit from a finished design; do not edit. */
$include "$name.h"

$include <math.h>
$include <string.h>

/* By its bits, so that it holds under -ffast-math, too. */
static int is_finite($real x)
{
  $word bits;
  memcpy(&bits, &x, sizeof bits);
  return (bits & $exponent) != $exponent;
}

/* ---- Recorded from the design: 0 if a result would not be finite; then nothing has changed. */

)";

inline constexpr const char* c_shell = R"(/* ---- What counts and chooses. */

/* Of the correction after 1, 2, .. samples. */
static const $real gains[$ROWS][$SIZE] = {
$GAP_GAINS};

static int restart($name_state *o, $real y)
{
  if (!is_finite(y) || !restart_at(o, y)) return 0;
  o->gap = 0;
  return 1;
}

static unsigned predict($name_state *o)
{
  const $real given = o->u_last;
  const int good = predict_step(o, given);
  if (o->gap < 65535u) ++o->gap;
  if (good) return 0u;
  if (!($fabs(given) > $fabs(o->u_applied))) { /* u is not the cause */
    o->u_applied = given;
    o->gap = 65535u;
    return $NAME_PREDICTION_DROPPED;
  }
  if (predict_step(o, o->u_applied)) return $NAME_INPUT_REJECTED;
  o->gap = 65535u;
  return $NAME_INPUT_REJECTED | $NAME_PREDICTION_DROPPED;
}

static unsigned correct($name_state *o, $real y)
{
  const unsigned elapsed = o->gap > 1u ? o->gap : 1u;
  const $real *k;
  if (elapsed > $ROWSu) return restart(o, y) ? $NAME_RESTARTED : $NAME_MEASUREMENT_REJECTED;
  k = gains[elapsed - 1u];
  if (!correct_step(o, y$GAINS)) { /* perhaps the state is to blame */
    return $fabs(y) < $fabs(o->z1) && restart(o, y) ? $NAME_RESTARTED : $NAME_MEASUREMENT_REJECTED;
  }
  o->gap = 0;
  return elapsed > 1u ? $NAME_GAP_BRIDGED : 0u;
}

static void judge_missing($name_state *o)
{
  if (o->gap >= $MISSING_LIMITu) {
    o->mode = $NAME_SAFE;
  }$LEAVE_SAFE
}

static $real put_out($name_state *o, $real r)
{
  $real u;
  if (o->mode == $NAME_RUNNING) {
    (void)law(o, r, &u);
  } else if (o->mode == $NAME_SAFE) {
    u = $SAFE_INPUT;
  } else {
    --o->hold_left;
    if (o->hold_left == 0u) o->mode = $NAME_RUNNING;
    u = $HOLD_INPUT;
  }
  (void)limit(o, u, &u);
  return u;
}

void $name_init($name_state *o)
{
$INIT  o->hold_left = $HOLD_LEFTu;
  o->gap = 0;
  o->mode = $MODE;
  o->status = 0;
}

unsigned $name_start($name_state *o, $real y, $real u)
{
  const $real before = o->u_applied;
  if (!is_finite(y)) return $NAME_STATE_REJECTED;
  if (!is_finite(u)) return $NAME_INPUT_REJECTED;
  o->u_applied = u;
  if (!rest_at(o, y)) {
    o->u_applied = before;
    return $NAME_STATE_REJECTED;
  }
  (void)applied(o, u);
$HARDEN  o->gap = 0;
  o->mode = $NAME_RUNNING;
  return 0u;
}

$real $name_update($name_state *o, $real y, $real r)
{
  unsigned status = 0u;
  if (o->gap != 0u || !observe(o, y)) {
    status = predict(o);
    status |= correct(o, y);
    if ((status & $NAME_RESTARTED) != 0u) (void)rest_at(o, y);
  }
  o->status = (uint8_t)status;
  judge_missing(o);
  return put_out(o, r);
}

$real $name_update_without_measurement($name_state *o, $real r)
{
  o->status = (uint8_t)predict(o);
  judge_missing(o);
  return put_out(o, r);
}

void $name_applied($name_state *o, $real u)
{
  (void)applied(o, u);
}

#ifdef $NAME_SELF_TEST
int $name_self_test($real tolerance)
{
  static const $real samples[$SAMPLES][3] = { /* y, r, u */
$VECTORS  };
  $name_state o;
  int i;
  $name_init(&o);
  for (i = 0; i < $SAMPLES; ++i) {
    const $real u = $name_update(&o, samples[i][0], samples[i][1]);
    if (!($fabs(u - samples[i][2]) <= tolerance)) return i + 1;
  }
  return 0;
}
#endif
)";

}  // namespace detail

/// The controller as C99, two files without a library: state struct, init, start, update, and a
/// self-test that compares with the C++ (compiled if `NAME_SELF_TEST` is defined). What the
/// controller does at a good sample is recorded from its own `update`, so there is no second
/// implementation; settings are constants. Bad and missing samples, gaps, restarts, the start hold
/// and safe mode are those of the controller, too.
///
/// Compiled without contraction (-std=c99 in GCC) it equals the C++ bit for bit; where the law is
/// softened for n >= 3, only with the same `pow`. A gap of each length has its gains in a table of
/// max_gap times N numbers: choose `max_gap` as short as the machine allows.
/// @param controller as `make` returned it: its state is that of `init`
/// @return error for a name that is no identifier, a number of samples of the self-test out of
///         range, or a measurement_divider, which cannot be written yet
template <LoopObserver Observer>
requires can_be_recorded<Adrc<Observer>> Expected<CCode, Error<typename Observer::scalar_type>>
to_c(const Adrc<Observer>& controller, const CCodeOptions& options = {}) {
  static_assert(
      requires { controller.observer().gain_law().gain_before_measurement(); },
      "esokit: to_c writes observers of one level with a constant gain");
  using V = typename Observer::scalar_type;
  using C = Adrc<Observer>;
  using Access = detail::RecordAccess;
  using Number = typename Recorder<C>::Number;
  using Numbers = std::vector<Number>;
  constexpr bool single = sizeof(V) == sizeof(float);
  constexpr int size = Observer::size;

  const auto rules = Access::rules(Access::loop(controller));
  bool is_name =
      !options.name.empty() && std::isdigit(static_cast<unsigned char>(options.name[0])) == 0;
  for (const char letter : options.name) {
    is_name = is_name && (std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_');
  }
  Rules<V> checked;
  checked.require(is_name, "name", V(0), "must be an identifier of C")
      .require(1 <= options.self_test_samples && options.self_test_samples <= 10000,
               "self_test_samples", static_cast<V>(options.self_test_samples), "must be 1 .. 10000")
      .require(rules.divider == 1, "measurement_divider", static_cast<V>(rules.divider),
               "must be 1: regular gaps cannot be written yet");
  if (!checked) return checked.error();

  // The lists. The start hold is the shell's, so they are of a controller that runs.
  Recorder<C> recorder(controller);
  std::vector<detail::CFunction> functions;
  const auto add = [&](const char* name, std::vector<std::string> arguments, bool has_output,
                       typename Recorder<C>::Call call) {
    recorder.add(static_cast<int>(arguments.size()), std::move(call));
    functions.push_back({name, std::move(arguments), has_output});
  };
  std::vector<std::string> gains{"y"};
  for (int r = 1; r <= size; ++r) gains.push_back("k" + std::to_string(r));
  add("observe", {"y"}, false, [](auto& c, const Numbers& in) {
    (void)c.observer().update(in[0], Number(c.output()));
    return Numbers{};
  });
  add("predict_step", {"u"}, false, [](auto& c, const Numbers& in) {
    (void)c.observer().predict(in[0]);
    return Numbers{};
  });
  add("correct_step", gains, false, [](auto& c, const Numbers& in) {
    // With gains that are arguments; the object is not constant, only its getter is.
    using Gain = std::remove_cvref_t<decltype(c.observer().gain_law().gain_before_measurement())>;
    auto& gain = const_cast<Gain&>(c.observer().gain_law().gain_before_measurement());
    const Gain nominal = gain;
    for (std::size_t r = 0; r < size; ++r) gain[r] = in[r + 1];
    (void)c.observer().correct(in[0]);
    gain = nominal;
    return Numbers{};
  });
  add("restart_at", {"y"}, false, [](auto& c, const Numbers& in) {
    (void)c.observer().reset(in[0]);
    return Numbers{};
  });
  add("rest_at", {"y"}, false, [](auto& c, const Numbers& in) {
    auto& o = c.observer();
    (void)o.reset(o.equilibrium(in[0], Number(o.applied_input())));
    return Numbers{};
  });
  add("law", {"r"}, true,
      [](auto& c, const Numbers& in) { return Numbers{Access::law(c, in[0])}; });
  add("limit", {"u"}, true,
      [](auto& c, const Numbers& in) { return Numbers{Access::limited(Access::loop(c), in[0])}; });
  add("applied", {"u"}, false, [](auto& c, const Numbers& in) {
    Access::report(Access::loop(c), in[0]);
    return Numbers{};
  });
  const bool softens = Access::softens(controller);
  if (softens) {
    add("harden", {}, false, [](auto& c, const Numbers&) {
      Access::harden(c);
      return Numbers{};
    });
  }
  const auto recorded = recorder.record();
  if (!recorded) return recorded.error();

  // Names of what the shell and a reader look for; the others are numbered.
  detail::CWriter writer(single, options.name);
  auto object = Recorder<C>::as_recorded(controller);
  const auto numbers = detail::numbers_of<Number>(object);
  writer.live.assign(numbers.size(), false);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const Number* at = numbers[i];
    // The limiter keeps the bounds of the next output behind the last.
    const auto from_last = at - &object.output();
    const auto from_z1 = at - &object.observer().predicted_measurement();
    std::string name = "x" + std::to_string(i);
    if (0 <= from_z1 && from_z1 < size) name = "z" + std::to_string(from_z1 + 1);
    if (from_last == 0) name = "u_last";
    if (from_last == 1) name = "u_low";
    if (from_last == 2) name = "u_high";
    if (at == &object.requested()) name = "u_asked";
    if (at == &object.observer().applied_input()) name = "u_applied";
    if (at == &object.observer().innovation()) name = "innovation";
    writer.members.push_back(name);
    writer.live[i] = name[0] == 'z' || name == "u_last" || name == "u_applied";
  }
  writer.find_live(*recorded);

  std::string members;
  std::string init;
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!writer.live[i]) continue;
    members += "  " + writer.real() + " " + writer.members[i] + ";\n";
    init += "  o->" + writer.members[i] + " = " + writer.number(recorded->numbers[i]) + ";\n";
  }
  std::string lists;
  for (std::size_t i = 0; i < functions.size(); ++i) {
    lists += writer.function(functions[i], recorded->calls[i][0]);
  }
  const int max_gap = controller.observer().max_gap();
  std::string table;
  for (int elapsed = 1; elapsed <= max_gap + 1; ++elapsed) {
    const auto& law = controller.observer().gain_law();
    const auto gain = elapsed == 1 ? law.gain_before_measurement()
                                   : law.gap_gain(V(0), static_cast<unsigned>(elapsed));
    for (std::size_t r = 0; r < size; ++r) {
      table += (r == 0 ? "  {" : ", ") + writer.number(static_cast<double>(gain[r]));
    }
    table += "},\n";
  }
  std::string vectors;
  C played = controller;
  for (int k = 0; k < options.self_test_samples; ++k) {
    // A reference that jumps, and a y that follows the last u roughly: what it is does not matter.
    const V r = static_cast<V>((k / 10) % 2 == 0 ? 1.0 : -0.5);
    const V y = static_cast<V>(0.25 * ((k * 37) % 16) - 1.5);
    vectors += "    {" + writer.number(static_cast<double>(y)) + ", " +
               writer.number(static_cast<double>(r)) + ", " +
               writer.number(static_cast<double>(played.update(y, r))) + "},\n";
  }
  std::string call_gains;
  for (int r = 0; r < size; ++r) call_gains += ", k[" + std::to_string(r) + "]";
  std::string upper = options.name;
  for (char& letter : upper) {
    letter = static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
  }
  const auto& limiter = controller.limiter();
  const std::vector<std::pair<std::string, std::string>> words = {
      {"$include", "#include"},  // not written above: scripts look for such lines
      {"$MEMBERS", members},
      {"$COMMENT", options.comment.empty() ? "" : " * " + options.comment + "\n"},
      {"$TIME", writer.number(static_cast<double>(controller.sample_time()))},
      {"$GAINS", call_gains},
      {"$GAIN", writer.number(static_cast<double>(controller.observer().input_gain()))},
      {"$LOWER", writer.number(static_cast<double>(limiter.lower()))},
      {"$UPPER", writer.number(static_cast<double>(limiter.upper()))},
      {"$ROWS", std::to_string(max_gap + 1)},
      {"$SAFE_INPUT", rules.has_safe_input ? writer.number(rules.safe_input) : "o->u_last"},
      {"$HOLD_INPUT", writer.number(rules.hold_input)},
      {"$HARDEN", softens ? "  (void)harden(o);\n" : ""},
      {"$GAP_GAINS", table},
      {"$SIZE", std::to_string(size)},
      {"$MISSING_LIMIT", std::to_string(rules.missing_limit)},
      {"$LEAVE_SAFE", rules.stays_safe ? std::string()
                                       : " else if (o->mode == $NAME_SAFE && o->gap == 0u) {\n"
                                         "    o->mode = $NAME_RUNNING;\n  }"},
      {"$INIT", init},
      {"$HOLD_LEFT", std::to_string(rules.hold_left)},
      {"$MODE", rules.hold_left > 0 ? "$NAME_START_HOLD" : "$NAME_RUNNING"},
      {"$SAMPLES", std::to_string(options.self_test_samples)},
      {"$VECTORS", vectors},
      {"$word", single ? "uint32_t" : "uint64_t"},
      {"$exponent", single ? "0x7f800000u" : "0x7ff0000000000000u"},
      {"$fabs", single ? "fabsf" : "fabs"},
      {"$real", writer.real()},
      {"$NAME", upper},
      {"$name", options.name}};
  return CCode{
      detail::filled(detail::c_header, words),
      detail::filled(detail::c_head, words) + lists + detail::filled(detail::c_shell, words)};
}

}  // namespace esokit
