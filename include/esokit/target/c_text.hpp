/// @file
/// What to_c writes around the recorded lists: what counts and chooses, as text of C, once.
#pragma once

#include <esokit/core/language.hpp>

// The counterpart of PredictorCorrector::predict and correct, and of ControlLoop. Words with a
// dollar are filled in.
namespace esokit::detail {

/// Both headers.
inline constexpr const char* c_header_head = R"(#ifndef $NAME_H
#define $NAME_H
/* Written by esokit from a finished design; do not edit.
$COMMENT * T = $TIME s, b0 = $GAIN$LIMITS.
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ bit for bit$LIBRARY. */

$BOOL$include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define $NAME_SAMPLE_TIME $TIME /* s */

/* Flags of `status`; 0: all is well. */
#define $NAME_MEASUREMENT_REJECTED 1u /* y was NaN, infinite or too large */
#define $NAME_INPUT_REJECTED 2u /* u was too large: the last good one was used */
#define $NAME_PREDICTION_DROPPED 4u /* the next good y restarts */
#define $NAME_GAP_BRIDGED 8u /* samples were missing before this one */
#define $NAME_RESTARTED 16u /* too many samples were missing */
#define $NAME_STATE_REJECTED 32u /* start: y is not finite or too large */
$GATE_FLAG
)";

/// Settings that can be changed while it runs.
inline constexpr const char* c_header_settings =
    R"(/* What may be changed while it runs, by $name_adopt. (MISRA C:2012 8.7, advisory: those of other
 * designs are in other files.) */
typedef struct {
  uint32_t design; /* of which text: others are refused */
$SETTINGS  $real gains[$ROWS][$SIZE]; /* of the observer, after 1, 2, .. samples */
} $name_settings;

extern const $name_settings $name_$SET;

)";
inline constexpr const char* c_header_adopt =
    R"(/* Other settings, of a design with the same sample time, b0 and structure, from now on; estimates
 * and output are kept. False, and nothing changes, if they are of another text. */
bool $name_adopt($name_state *o, const $name_settings *settings);

)";
inline constexpr const char* c_source_adopt =
    R"(bool $name_adopt($name_state *o, const $name_settings *settings)
{
  const bool fits = settings->design == $DESIGN;
  if (fits) {
    o->settings = settings;
$TRACK  }
  return fits;
}

)";

/// The header of a controller.
inline constexpr const char* c_header_controller = R"(/* `mode`: what determines u. */
#define $NAME_RUNNING 0u
#define $NAME_START_HOLD 1u
#define $NAME_SAFE 2u /* too many measurements are missing */

$TURNStypedef struct {
$MEMBERS$PHASE_MEMBER  uint32_t hold_left; /* samples of the start hold */
  uint16_t gap; /* samples since the last measurement that was taken */
  uint8_t mode;
  uint8_t status;
} $name_state;

/* At rest at y = 0, u = 0. Call it before all else. */
void $name_init($name_state *o);
/* Takes over a plant at rest at y under u; begin with the reference at y. Returns a status. */
unsigned $name_start($name_state *o, $real y, $real u);
/* One sample: y (NaN if it is missing) and r, $REFERENCE; returns the u to be held
 * until the next. */
$real $name_update($name_state *o, $real y, $real r);
/* The same without a measurement. */
$real $name_update_without_measurement($name_state *o, $real r);
/* What the actuator really held, before the next update; only if it differs from what update gave. */
void $name_applied($name_state *o, $real u);
/* Estimate number 0 .. $LAST: y, y', .., and then the disturbance, in physical units. */
$real $name_estimate(const $name_state *o, unsigned row);

)";

/// The header of a controller in two phases.
inline constexpr const char* c_header_predictive = R"(typedef struct {
$MEMBERS  $real measurement;
  uint32_t hold_left; /* samples of the start hold */
  uint16_t gap; /* samples since the last measurement that was taken */
  uint8_t phase; /* 1: y was told, 2: it is missing */
  uint8_t status;
} $name_state;

/* At rest at y = 0, u = 0, the reference 0. Call it before all else. */
void $name_init($name_state *o);
/* Takes over a plant at rest at y under u; the reference is y. Returns a status. */
unsigned $name_start($name_state *o, $real y, $real u);
/* Restarts at (y, 0, .., 0), and the start hold. Returns a status. */
unsigned $name_reset($name_state *o, $real y);
/* At the sample: y (NaN if it is missing); returns the u to be held until the next. */
$real $name_control($name_state *o, $real y);
/* The same without a measurement. */
$real $name_control_without_measurement($name_state *o);
/* The rest, any time before the next sample, whose reference is given. Returns a status. */
unsigned $name_prepare($name_state *o, $real next_r);
/* Both at once. */
$real $name_update($name_state *o, $real y, $real next_r);
/* What the actuator really holds; only if it is not what control gave. Returns a status. */
unsigned $name_applied($name_state *o, $real u);
/* Estimate number 0 .. $LAST: y, y', .., and then the disturbance, in physical units. */
$real $name_estimate(const $name_state *o, unsigned row);

)";
/// Its functions.
inline constexpr const char* c_source_predictive =
    R"(/* What of the next u does not need its measurement. */
static void arm($name_state *o)
{
  bool good;
  if (o->hold_left > 0u) {
    (void)arm_hold(o);
    return;
  }
$ARM_BLANKED  if (o->gap > $ROWSu) {
    good = arm_restart(o);
  } else {
$ARM_BY  }
  if (!good) {
    (void)arm_blind(o);
  }
}

void $name_init($name_state *o)
{
$INIT  o->measurement = $ZERO;
  o->hold_left = $HOLDu;
  o->gap = 0u;
  o->phase = 0u;
  o->status = 0u;
}

unsigned $name_start($name_state *o, $real y, $real u)
{
  const $name_state before = *o;
  (void)predict_$top(o, u); /* keeps it as applied */
  if (!$rest(o, y, u)) {
    *o = before;
    return $NAME_STATE_REJECTED;
  }
  o->gap = 0u;
  o->hold_left = 0u;
  (void)take_output(o, u);
  (void)track(o);
  o->phase = 0u;
  (void)refer(o, y);
  arm(o);
  return 0u;
}

unsigned $name_reset($name_state *o, $real y)
{
  unsigned status = $NAME_STATE_REJECTED;
  if (restart(o, y)) {
    o->hold_left = $HOLDu;
    o->phase = 0u;
    arm(o);
    status = 0u;
  }
  return status;
}

static $real control($name_state *o, $real y)
{
  $real u = $ZERO;
$CONTROL  o->measurement = y;
  o->phase = 1u;
  return u;
}

$real $name_control_without_measurement($name_state *o)
{
  $real u = $ZERO;
  (void)control_blind(o, &u);
  o->phase = 2u;
  return u;
}

static unsigned prepare($name_state *o, $real next_r)
{
  unsigned status = 0u;
  if (o->phase == 1u) {
    status = correct_$top(o, o->measurement);
  }
  (void)$SETTLE(o);
  status |= predict_$top(o, o->u_last);
  o->phase = 0u;
  if (o->hold_left > 0u) {
    o->hold_left = o->hold_left - 1u;
  }
  (void)refer(o, next_r);
  arm(o);
  o->status = (uint8_t)status;
  return status;
}

$real $name_control($name_state *o, $real y)
{
  return control(o, y);
}

unsigned $name_prepare($name_state *o, $real next_r)
{
  return prepare(o, next_r);
}

$real $name_update($name_state *o, $real y, $real next_r)
{
  const $real u = control(o, y);
  (void)prepare(o, next_r);
  return u;
}

unsigned $name_applied($name_state *o, $real u)
{
  unsigned status = 0u;
  $real held = u;
  if (!is_finite(u)) {
    status = $NAME_INPUT_REJECTED;
    held = o->u_last;
  }
  (void)take_output(o, held);
  if (o->phase == 0u) {
    (void)track(o);
    if (!revise(o, held)) {
      status = $NAME_INPUT_REJECTED;
    }
    arm(o);
  }
  return status;
}

)";

/// The header of an observer.
inline constexpr const char* c_header_observer = R"($TURNStypedef struct {
$MEMBERS  uint16_t gap; /* samples since the last measurement that was taken */
} $name_state;

/* At rest at zero. Call it before all else. */
void $name_init($name_state *o);
/* Restarts at (y, 0, .., 0). Returns a status. */
unsigned $name_reset($name_state *o, $real y);
/* One sample: y, and the u that the actuator held since the last one. Returns a status. */
unsigned $name_update($name_state *o, $real y, $real u);
/* Its halves; `predict` alone is a sample without a measurement. */
unsigned $name_predict($name_state *o, $real u);
unsigned $name_correct($name_state *o, $real y);
/* Estimate number 0 .. $LAST: y, y', .., and then the disturbance, in physical units. */
$real $name_estimate(const $name_state *o, unsigned row);

)";

/// Both headers.
inline constexpr const char* c_header_tail = R"($OF_MEASURED$OF_GUARD$ADOPT#ifdef $NAME_SELF_TEST
/* 0, or the number of the first sample whose result differs from that of the design by more than
 * `tolerance`; 0 asks for equal numbers. */
int $name_self_test($real tolerance);
#endif

#ifdef __cplusplus
}
#endif
#endif
)";

/// The head of any source.
inline constexpr const char* c_source_head =
    R"(/* Written by esokit from a finished design; do not edit. */
$include "$name.h"

$include <math.h>
$include <stdbool.h>
$include <string.h>

/* Deviations from MISRA C:2012: is_finite looks at the bits of a number by memcpy (21.15), as no
 * test of its value holds under -ffast-math; functions leave early where a sample is refused (15.5,
 * advisory); a header has macros that its source may not need (2.5, advisory). */

/* By its bits, so that it holds under -ffast-math, too. */
static bool is_finite($real x)
{
  $word bits;
  (void)memcpy(&bits, &x, sizeof bits);
  return (bits & $exponent) != $exponent;
}

)";

/// Before what is recorded.
inline constexpr const char* c_source_recorded =
    R"(/* ---- Recorded from the design: false if a result would not be finite; then nothing has changed. */

)";

/// What an observer and the one in a controller do with bad and missing samples.
inline constexpr const char* c_source_observer_part = R"(/* ---- What counts and chooses. */

static bool restart($name_state *o, $real y)
{
  const bool good = is_finite(y) && restart_at(o, y);
  if (good) {
    o->gap = 0u;
$LAW_BEGIN  }
  return good;
}

static unsigned predict_base($name_state *o, $real given)
{
  unsigned status = 0u;
  const bool good = predict_step(o, given);
  if (o->gap < 65535u) {
    o->gap = (uint16_t)(o->gap + 1u);
  }
  if (good) {
    return status;
  }
  if (is_finite(given) && !($fabs(given) > $fabs(o->u_applied))) { /* u is not the cause */
    o->u_applied = given;
    o->gap = 65535u;
    status = $NAME_PREDICTION_DROPPED;
  } else if (predict_step(o, o->u_applied)) {
    status = $NAME_INPUT_REJECTED;
  } else {
    o->gap = 65535u;
    status = $NAME_INPUT_REJECTED | $NAME_PREDICTION_DROPPED;
  }
  return status;
}

static unsigned correct_base($name_state *o, $real y)
{
$TABLE  unsigned status = $NAME_MEASUREMENT_REJECTED;
  unsigned elapsed = o->gap;
  if (elapsed < 1u) {
    elapsed = 1u;
  }
  if (elapsed > $ROWSu) {
    if (restart(o, y)) {
      status = $NAME_RESTARTED;
    }
  } else {
$OF_TABLE    if ($CORRECT) {
      o->gap = 0u;
$ACCEPT      status = 0u;
      if (elapsed > 1u) {
        status = $NAME_GAP_BRIDGED;
      }
    } else if (($fabs(y) < $fabs(o->$FIRST)) && restart(o, y)) { /* the state was to blame */
      status = $NAME_RESTARTED;
    } else {
      /* y is refused. */
    }
  }
  return status;
}

$real $name_estimate(const $name_state *o, unsigned row)
{
  $real u = $ZERO;
$BLANKED  switch (row) {
$ROWS_OF_ESTIMATE  default:
    break;
  }
  return u;
}

)";

/// A sample without a gate.
inline constexpr const char* c_source_base_update =
    R"(static unsigned update_base($name_state *o, $real y, $real u)
{
  unsigned status;
  if ((o->gap == 0u) && observe(o, y, u)) {
$ACCEPT    return 0u;
  }
  status = predict_base(o, u);
  return status | correct_base(o, y);
}

)";

/// The functions of an observer.
inline constexpr const char* c_source_observer = R"(void $name_init($name_state *o)
{
$INIT  o->gap = 0u;
}

unsigned $name_reset($name_state *o, $real y)
{
  unsigned status = $NAME_STATE_REJECTED;
  if ($restart(o, y)) {
$GATE_OPEN    status = 0u;
  }
  return status;
}

unsigned $name_predict($name_state *o, $real u)
{
  return predict_$top(o, u);
}

unsigned $name_correct($name_state *o, $real y)
{
  return correct_$top(o, y);
}

unsigned $name_update($name_state *o, $real y, $real u)
{
  return update_$top(o, y, u);
}

)";

/// The functions of a controller.
inline constexpr const char* c_source_controller =
    R"(static void judge_missing($name_state *o)
{
  if (o->gap >= $MISSING_LIMITu) {
    o->mode = $NAME_SAFE;
  }
$LEAVE_SAFE}

static $real put_out($name_state *o, $real r)
{
  $real u;
  if (o->mode == $NAME_RUNNING) {
$CALL_LAW  } else if (o->mode == $NAME_SAFE) {
    u = $SAFE_INPUT;
  } else {
    o->hold_left = o->hold_left - 1u;
    if (o->hold_left == 0u) {
      o->mode = $NAME_RUNNING;
    }
    u = $HOLD_INPUT;
  }
  (void)limit(o, u, &u);
  return u;
}

void $name_init($name_state *o)
{
$INIT$PHASE_INIT  o->hold_left = $HOLD_LEFTu;
  o->gap = 0u;
  o->mode = $MODE;
  o->status = 0u;
}

unsigned $name_start($name_state *o, $real y, $real u)
{
  $name_state before;
$START_CHECKS  before = *o;
$FILL  (void)predict_$top(o, u); /* keeps it as applied */
$SETTLE_W  if (!$rest(o, $AT_START, u)) {
    *o = before;
    return $NAME_STATE_REJECTED;
  }
  (void)applied(o, u);
$HARDEN$GATE_START  o->gap = 0u;
  o->mode = $NAME_RUNNING;
  return 0u;
}

$OWN_MISS$real $name_update($name_state *o, $real y, $real r)
{
  unsigned status;
$PHASE_BEFORE  status = update_$top(o, $MEASURED, o->u_last);
  if ((status & $NAME_RESTARTED) != 0u) {
    $REST
  }
$PHASE_AFTER  o->status = (uint8_t)status;
  judge_missing(o);
  return put_out(o, r);
}

$real $name_update_without_measurement($name_state *o, $real r)
{
$TO_MISS}

void $name_applied($name_state *o, $real u)
{
  (void)applied(o, u);
}

)";

/// A sample without a measurement.
inline constexpr const char* c_source_miss =
    R"($PHASE_NEXT  o->status = (uint8_t)predict_$top(o, o->u_last);
  judge_missing(o);
  return put_out(o, r);
)";

/// Compares with samples of the design.
inline constexpr const char* c_source_self_test = R"(#ifdef $NAME_SELF_TEST
int $name_self_test($real tolerance)
{
  static const $real samples[$SAMPLES][3] = { /* $COLUMNS */
$VECTORS  };
  $name_state o;
  int i;
  $name_init(&o);
  for (i = 0; i < $SAMPLES; ++i) {
    $RESULT
    if (!($fabs(result - samples[i][2]) <= tolerance)) {
      return i + 1;
    }
  }
  return 0;
}
#endif
)";

}  // namespace esokit::detail
