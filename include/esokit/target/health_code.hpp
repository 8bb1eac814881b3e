/// @file
/// to_c of a HealthMonitor: what it finds of a loop that runs as C99.
#pragma once

#include <concepts>
#include <esokit/control/health.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/c_text.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_design.hpp>
#include <esokit/target/structured_text.hpp>
#include <string>
#include <type_traits>

namespace esokit {

namespace detail {

inline constexpr const char* c_health_header = R"(#ifndef $NAME_H
#define $NAME_H
/* Written by esokit from a finished monitor; do not edit.
$COMMENT * Watches a controller of T = $TIME s: $name_look after each of its updates. */

$include <stdbool.h>
$include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What the controller did at a sample, of its state o: written with `watched`. */
typedef struct {
  $real innovation;  /* o.innovation */
  $real asked;       /* o.u_asked */
  $real held;        /* o.u_last */
  $real applied;     /* o.u_applied */
  $real disturbance; /* its estimate number $ROW */
  uint32_t missed;   /* o.gap */
  uint8_t status;    /* o.status */
  bool runs;         /* o.mode is 0 */
} $name_sample;

typedef struct {
  uint32_t samples;
  uint32_t rejected; /* measurements that were not finite or outliers */
  uint32_t bridged;  /* corrections after a gap, and restarts */
  uint32_t unsafe;   /* samples with u not determined by the law */
  $real saturated;   /* share of samples at a limit; about those of the last $MEMORY samples */
  $real side;        /* those at the upper one, minus those at the lower */
  $real innovation;  /* rms, unit of y */
  $real gain_ratio;  /* estimate of the true b0 over that of the design */
  $real response;    /* rms of what follows u over what should */
  $real evidence;
  $real opposed;
  $real phi_sum; /* from here on its own */
  $real stages[$SIZE];
  $real slow_phi;
  $real slow_psi;
  $real sum_xx;
  $real sum_xy;
  $real sum_aa;
  $real phi;
  $real x;
  $real y;
  $real mean_square;
  uint16_t phase;
  bool lost;
  bool is_free;
} $name_state;

/* The likely fault, the worst first. */
#define $NAME_NONE 0u
#define $NAME_WRONG_SIGN 1u /* of b0 */
#define $NAME_GAIN_TOO_SMALL 2u /* b0 is several times too small */
#define $NAME_MEASUREMENTS_REJECTED 3u /* more than a tenth */
#define $NAME_SATURATED 4u /* more than half of the time */
#define $NAME_INNOVATION_TOO_LARGE 6u /* three times that of the noise */
#define $NAME_GAIN_TOO_LARGE_OR_DISTURBED 7u /* b0 is too large, or a load drives u */

void $name_clear($name_state *o);
void $name_look($name_state *o, const $name_sample *sample);
unsigned $name_diagnose(const $name_state *o);

#ifdef __cplusplus
}
#endif
#endif
)";

/// The counterpart of HealthMonitor::look and diagnose.
inline constexpr const char* c_health_source =
    R"(void $name_clear($name_state *o)
{
  (void)memset(o, 0, sizeof *o);
  o->gain_ratio = $ONE;
  o->response = $ONE;
  o->is_free = true;
}

static $real nearer($real share, $real now)
{
  return share + ($WEIGHT * (now - share));
}

static void count($name_state *o, const $name_sample *sample, bool rejected)
{
  const $real beyond = sample->asked - sample->held;
  $real limit = $ZERO;
  if (sample->runs && (beyond > $HAIR)) {
    limit = $ONE;
  }
  if (sample->runs && (beyond < -$HAIR)) {
    limit = -$ONE;
  }
  o->samples = o->samples + 1u;
  if (rejected) {
    o->rejected = o->rejected + 1u;
  }
  if ((sample->status & (8u | 16u)) != 0u) {
    o->bridged = o->bridged + 1u;
  }
  if (!sample->runs) {
    o->unsafe = o->unsafe + 1u;
  }
  o->saturated = nearer(o->saturated, $fabs(limit));
  o->side = nearer(o->side, limit);
}

static void average($name_state *o, $real innovation)
{
  const $real square = innovation * innovation;
  if (is_finite(square) && (square < $LARGEST_SQUARE)) {
    o->mean_square = nearer(o->mean_square, square);
    o->innovation = $sqrt(o->mean_square);
  }
}

/* phi by the poles of the observer, and the slow means; false for what no real u or plant causes. */
static bool filter($name_state *o, $real phi, $real psi)
{
  const $real most = $LARGEST;
  $real filtered = phi;
  unsigned i;
  for (i = 0u; i < $SIZEu; ++i) {
    o->stages[i] = filtered + ($POLE * (o->stages[i] - filtered));
    filtered = o->stages[i];
  }
  o->slow_phi = o->slow_phi + ($SLOW * (filtered - o->slow_phi));
  o->slow_psi = o->slow_psi + ($SLOW * (psi - o->slow_psi));
  o->phi = filtered;
  o->x = filtered - o->slow_phi;
  o->y = psi - o->slow_psi;
  if (($fabs(o->x) < most) && ($fabs(o->y) < most) &&
      is_finite((((o->x * o->x) + (o->y * o->y)) + o->sum_xx) + o->sum_aa)) {
    return true;
  }
  for (i = 0u; i < $SIZEu; ++i) {
    o->stages[i] = $ZERO;
  }
  o->slow_phi = $ZERO;
  o->slow_psi = $ZERO;
  o->sum_xx = $ZERO;
  o->sum_xy = $ZERO;
  o->sum_aa = $ZERO;
  o->opposed = $ZERO;
  return false;
}

/* The time for which the motion is against u near its limit. */
static void oppose($name_state *o, $real psi)
{
  const $real now = o->phi - $MIDDLE;
  const $real late = o->slow_phi - $MIDDLE;
  $real side = $ZERO;
  $real against;
  if ((now > $END) && (late > $END)) {
    side = $ONE;
  } else if ((now < -$END) && (late < -$END)) {
    side = -$ONE;
  } else {
    /* Not near. */
  }
  against = (-side) * (o->phi + psi);
  if (against > $LEAST_AGAINST) {
    o->opposed = o->opposed + $STEP;
  } else {
    o->opposed = $ZERO;
  }
}

static void forget($name_state *o)
{
  o->sum_xx = $FORGET * o->sum_xx;
  o->sum_xy = $FORGET * o->sum_xy;
  o->sum_aa = $FORGET * o->sum_aa;
  o->evidence = $FORGET * o->evidence;
}

static void regress($name_state *o)
{
  const $real size = $fabs(o->x);
  forget(o);
  if ((size > $LEAST_SHARE) && (size > $LEAST_PHI)) {
    const $real a = o->x + o->y;
    $real quotient;
    $real square;
    o->sum_xx = o->sum_xx + (o->x * o->x);
    o->sum_xy = o->sum_xy + (o->x * o->y);
    o->sum_aa = o->sum_aa + (a * a);
    o->evidence = o->evidence + $STEP;
    quotient = o->sum_xy / o->sum_xx;
    square = o->sum_aa / o->sum_xx;
    if (is_finite(quotient) && is_finite(square)) {
      o->gain_ratio = $ONE + quotient;
      o->response = $sqrt(square);
    }
  }
}

void $name_look($name_state *o, const $name_sample *sample)
{
  const bool rejected = (sample->status & (1u | 64u)) != 0u;
  $real phi;
  bool lost;
  bool is_free;
  count(o, sample, rejected);
  if ((sample->missed == 0u) && !rejected) {
    average(o, sample->innovation);
  }
  o->lost = o->lost || rejected;
  o->is_free = o->is_free && sample->runs;
  o->phi_sum = o->phi_sum + ($GAIN * sample->applied);
  o->phase = (uint16_t)(o->phase + 1u);
  if (o->phase < $DIVIDERu) {
    return;
  }
  o->phase = 0u;
  phi = o->phi_sum / $DIVIDER_NUMBER;
  o->phi_sum = $ZERO;
  lost = o->lost || (sample->missed >= $DIVIDERu);
  is_free = o->is_free;
  o->lost = false;
  o->is_free = true;
  if (!filter(o, phi, sample->disturbance)) {
    return;
  }
  if (!is_free) {
    o->opposed = $ZERO;
  }
  if ((!is_free) || lost) {
    forget(o);
    return;
  }
  oppose(o, sample->disturbance);
  regress(o);
}

unsigned $name_diagnose(const $name_state *o)
{
  const double rho = (double)o->gain_ratio;
  const double response = (double)o->response;
  const double evidence = (double)o->evidence;
  const double saturated = (double)o->saturated;
  const bool swings = (saturated > 0.05) && (fabs((double)o->side) < (0.8 * saturated));
  const bool told = evidence >= $OF_EVIDENCE;
  unsigned fault = $NAME_NONE;
  if (((rho < 0.0) && (evidence >= 1.0) && ((double)o->opposed >= $OF_OPPOSED)) ||
      ((rho < $OF_SIGN) && (evidence >= $OF_EVIDENCE_OF_SIGN))) {
    fault = $NAME_WRONG_SIGN;
  } else if (told && ((rho > $OF_SMALL) ||
                      (swings && (response > $OF_RESPONSE) && (rho > (response / 4.0))))) {
    fault = $NAME_GAIN_TOO_SMALL;
  } else if ((o->rejected > 10u) && (o->rejected > (o->samples / 10u))) {
    fault = $NAME_MEASUREMENTS_REJECTED;
  } else if (o->saturated > $HALF) {
    fault = $NAME_SATURATED;
  } else if (($OF_NOISE > $ZERO) && (o->innovation > $THRICE_OF_NOISE)) {
    fault = $NAME_INNOVATION_TOO_LARGE;
  } else if (told && (rho < $OF_LARGE)) {
    fault = $NAME_GAIN_TOO_LARGE_OR_DISTURBED;
  } else {
    /* None is found. */
  }
  return fault;
}
)";

/// A controller that can be watched in C: its observer is on the chain, without Guarded.
template <class C>
concept WatchedController = WritableController<C> && requires(const C& c) {
  requires model_traits<std::remove_cvref_t<decltype(c.observer().model())>>
  .is_chain;
  requires !observer_traits<std::remove_cvref_t<decltype(c.observer())>>.schedules_input_gain;
};

}  // namespace detail

/// A monitor of a controller as C99: `name_look` after each update of the controller, whose own C
/// is written with CodeOptions::watched, and `name_diagnose`, the LoopFault of the default limits
/// as a number. As it branches everywhere, its text is written, not recorded, and tested to equal
/// the C++ bit for bit.
/// @param monitor cleared, as `make` returned it @param controller what it watches: on the chain of
///        integrators, without Guarded
/// @return error for the options, as for a controller
template <int Size, PlainScalar S, detail::WatchedController Controller>
requires std::same_as<S, typename Controller::scalar_type> Expected<CCode, Error<S>> to_c(
    const HealthMonitor<Size, S>& monitor, const Controller& controller,
    const CodeOptions& options = {.name = "health"}) {
  static_assert(std::remove_cvref_t<decltype(controller.observer())>::size == Size,
                "esokit: Size of the monitor must be the number of states of the observer");
  if (const auto rules = detail::checked_options<S>(options); !rules) return rules.error();
  const detail::ListWriter writer(detail::c_language, sizeof(S) == sizeof(float));
  const auto number = [&](S x) { return writer.number(static_cast<double>(x)); };
  const auto threshold = [](double x) {
    return detail::ListWriter(detail::c_language, false).number(x);
  };
  const auto settings = detail::RecordAccess::health(monitor, controller);
  const HealthLimits limits;
  detail::Words words{
      {"$include", "#include"},
      {"$TIME", number(controller.observer().sample_time())},
      {"$MEMORY", std::to_string(static_cast<long long>(S(1) / settings.weight + S(0.5)))},
      {"$ROW", std::to_string(Controller::order)},
      {"$SIZE", std::to_string(Size)},
      {"$WEIGHT", number(settings.weight)},
      {"$HAIR", number(settings.hair)},
      {"$LARGEST_SQUARE", number(settings.largest_square)},
      {"$LARGEST", number(S(1000) * settings.range)},
      {"$POLE", number(settings.pole)},
      {"$SLOW", number(settings.slow)},
      {"$MIDDLE", number(settings.middle)},
      {"$END", number(static_cast<S>(0.9) * settings.range)},
      {"$LEAST_AGAINST", number(settings.least_against)},
      {"$LEAST_SHARE", number(static_cast<S>(0.02) * settings.range)},
      {"$LEAST_PHI", number(settings.least)},
      {"$STEP", number(settings.step)},
      {"$FORGET", number(settings.forget)},
      {"$GAIN", number(settings.input_gain)},
      {"$DIVIDER_NUMBER", number(static_cast<S>(settings.divider))},
      {"$DIVIDERu", std::to_string(settings.divider) + "u"},
      {"$OF_EVIDENCE_OF_SIGN", threshold(limits.evidence_of_sign)},
      {"$OF_EVIDENCE", threshold(limits.evidence)},
      {"$OF_OPPOSED", threshold(limits.opposed)},
      {"$OF_SIGN", threshold(limits.wrong_sign)},
      {"$OF_SMALL", threshold(limits.too_small)},
      {"$OF_RESPONSE", threshold(limits.response)},
      {"$OF_LARGE", threshold(limits.too_large)},
      {"$OF_NOISE", number(settings.of_noise)},
      {"$THRICE_OF_NOISE", number(S(3) * settings.of_noise)},
      {"$HALF", number(S(1) / S(2))},
      {"$sqrt", writer.single() ? "sqrtf" : "sqrt"}};
  const detail::Words common = detail::c_common_words(writer, options);
  words.insert(words.end(), common.begin(), common.end());
  return CCode{detail::filled(detail::c_health_header, words),
               detail::filled(std::string(detail::c_source_head) + detail::c_health_source, words)};
}

/// The same as a function block in Structured Text, to be called after that of the controller,
/// whose outputs it takes: its C, translated. @return the text, or an error as for to_c
template <int Size, PlainScalar S, detail::WatchedController Controller>
requires std::same_as<S, typename Controller::scalar_type> Expected<std::string, Error<S>>
to_structured_text(const HealthMonitor<Size, S>& monitor, const Controller& controller,
                   const CodeOptions& options = {.name = "health"}) {
  const auto code = to_c(monitor, controller, options);
  if (!code) return code.error();
  detail::StBlock block(*code, options, sizeof(S) == sizeof(float), "_clear");
  block.own("sample : $name_sample");
  block.own("fresh : $name_state");
  block.own("flags : UDINT");
  block.body = "IF clears THEN\n  o := fresh;\nEND_IF;\n";
  const auto of_sample = [&](const char* name, const char* comment) {
    block.input(std::string(name) + " : $real", comment);
    block.body += std::string("sample.") + name + " := " + name + ";\n";
  };
  of_sample("innovation", "output of the controller's block, written with `watched`");
  of_sample("asked", "such an output");
  of_sample("held", "its u");
  of_sample("applied", "such an output");
  of_sample("disturbance", ("its e" + std::to_string(Controller::order)).c_str());
  block.input("missed : UINT", "such an output");
  block.input("its_status : UINT", "its status");
  block.input("mode : UINT", "its mode");
  block.input("clears : BOOL", "TRUE: forgets all before");
  block.body +=
      "sample.missed := UINT_TO_UDINT(missed);\nsample.status := UINT_TO_UDINT(its_status);\n"
      "sample.runs := mode = 0;\ndone := $name_look(o := o, sample := sample);\n"
      "flags := $name_diagnose(o := o);\nfault := UDINT_TO_UINT(flags);\n";
  block.output(
      "fault : UINT",
      "0: none, 1: the sign of b0 is wrong, 2: b0 is several times too small, 3: more than "
      "a tenth of y are rejected, 4: u is at a limit more than half of the time, 6: the "
      "innovation is three times that of the noise, 7: b0 is too large, or a load drives "
      "u");
  for (const char* name : {"gain_ratio", "response", "saturated"}) {
    block.output(std::string(name) + " : $real", "see HealthMonitor");
    block.body += std::string(name) + " := o." + name + ";\n";
  }
  const detail::StructuredText all = block.text(
      "(* Written by esokit from a finished monitor; do not edit.\n$COMMENT   FUNCTION_BLOCK $name "
      "is at the end: call it after each call of the controller. *)\n\n");
  return all.template expected<S>(all.text);
}

}  // namespace esokit
