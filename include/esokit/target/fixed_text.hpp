/// @file
/// What to_fixed_c writes around the integer lists: what counts and chooses, as text of C, once.
#pragma once

#include <esokit/core/language.hpp>

// Words with a dollar are filled in.
namespace esokit::detail {

/// Both headers.
inline constexpr const char* fixed_header_head = R"(#ifndef $NAME_H
#define $NAME_H
/* Written by esokit from a finished design; do not edit.
$COMMENT * T = $TIME s; fixed point: a count of y is $UNIT_Y, a count of u $UNIT_U.
 *
 * With a good y at each sample the estimates and u differ from those of the same design in exact
 * numbers, with the written gains, by at most:
$BOUNDS */

$include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Flags of `status`; 0: all is well. */
#define $NAME_MEASUREMENT_REJECTED 1u /* y was outside its range: no measurement */
#define $NAME_INPUT_REJECTED 2u /* u was outside its range: the end of the range was used */
#define $NAME_GAP_BRIDGED 8u /* samples were missing before this one */
#define $NAME_RESTARTED 16u /* too many samples were missing */
#define $NAME_REFERENCE_REJECTED 32u /* r was outside its range: the end of the range was used */
#define $NAME_SATURATED 128u /* in a gap a state left its range and was held there */

/* The value of a count of an estimate. */
$UNITS
)";

/// Settings that can be changed while it runs.
inline constexpr const char* fixed_header_settings =
    R"(#define $NAME_SETTINGS_REJECTED 64u /* adopt: they are of another text */

/* What may be changed while it runs, by $name_adopt. (MISRA C:2012 8.7, advisory: those of other
 * designs are in other files.) */
typedef struct {
  uint32_t design; /* of which text: others are refused */
  int32_t gain[$GAINS];
  int32_t reach[$N]; /* where the states can be, and where a measurement leaves them */
  int32_t box[$N];
$LIMITS  int32_t correct[$ROWS][$N][$N1]; /* after 1, 2, .. samples */
  uint8_t powers[$ROWS][$N][$N1];
} $name_settings;

extern const $name_settings $name_$SET;

)";
inline constexpr const char* fixed_header_adopt =
    R"(/* Other settings, written for this text, from now on; estimates and output are kept, but a state
 * outside the range of the new settings is held there. Returns a status. */
unsigned $name_adopt($name_state *o, const $name_settings *settings);
)";
inline constexpr const char* fixed_settings = R"(const $name_settings $name_$SET = {
  $MARKu,
  {$GAIN},
  {$REACH},
  {$BOX},
$LIMIT_VALUES  {
$CORRECT_M  },
  {
$CORRECT_P  }
};

)";
inline constexpr const char* fixed_source_adopt =
    R"(unsigned $name_adopt($name_state *o, const $name_settings *settings)
{
  unsigned status = $NAME_SETTINGS_REJECTED;
  unsigned i;
  if (settings->design == $MARKu) {
    const int32_t *most = (o->gap > 0u) ? settings->reach : settings->box;
    status = 0u;
    o->settings = settings;
    for (i = 0u; i < $Nu; ++i) {
      o->x[i] = within(o->x[i], most[i], &status);
    }
  }
  return status;
}

)";

/// The header of a controller.
inline constexpr const char* fixed_header_controller = R"(/* `mode`: what determines u. */
#define $NAME_RUNNING 0u
#define $NAME_START_HOLD 1u
#define $NAME_SAFE 2u /* too many measurements are missing */

typedef struct {
$MEMBERS  int32_t u_last; /* after the limits, in 2^-$LAW_SCALE counts */
  int32_t u_held; /* what the actuator holds, in counts */
  uint32_t hold_left; /* samples of the start hold */
  uint16_t gap; /* samples since the last measurement that was taken */
  uint8_t mode;
  uint8_t status;
} $name_state;

/* At rest at $AT_REST, u = 0. Call it before all else, and then start. */
void $name_init($name_state *o);
/* Takes over a plant at rest at y under u; begin with the reference at y. Returns a status. */
unsigned $name_start($name_state *o, $Y_TYPE y, int32_t u);
/* One sample: y and r, the reference, in counts of y; returns the u to be held until the next. */
int32_t $name_update($name_state *o, $Y_TYPE y, $Y_TYPE r);
/* The same without a measurement. */
int32_t $name_update_without_measurement($name_state *o, $Y_TYPE r);
/* What the actuator really held, before the next update; only if it differs from what update gave.
 * A limit of rate counts from what update gave. Returns a status. */
unsigned $name_applied($name_state *o, int32_t u);
)";

/// The header of an observer.
inline constexpr const char* fixed_header_observer = R"(typedef struct {
$MEMBERS  uint16_t gap; /* samples since the last measurement that was taken */
} $name_state;

/* At rest at $AT_REST. Call it before all else, and then reset. */
void $name_init($name_state *o);
/* Begins anew at y. Returns a status. */
unsigned $name_reset($name_state *o, $Y_TYPE y);
/* One sample: y, and the u that the actuator held before it. Returns a status. */
unsigned $name_update($name_state *o, $Y_TYPE y, int32_t u);
/* A sample without a measurement. Returns a status. */
unsigned $name_predict($name_state *o, int32_t u);
)";

/// The end of both headers.
inline constexpr const char* fixed_header_tail =
    R"(/* Estimate number 0 .. $LAST: y$RELATIVE, y', .., and then the disturbance. */
int32_t $name_estimate(const $name_state *o, unsigned row);

#ifdef $NAME_SELF_TEST
/* 0, or the number of the first sample whose result differs from that of the design. */
int $name_self_test(void);
#endif

#ifdef __cplusplus
}
#endif
#endif
)";

/// The head of the source.
inline constexpr const char* fixed_source_head =
    R"(/* Written by esokit from a finished design; do not edit. */
$include "$name.h"

/* Deviations from MISRA C:2012: negative numbers are shifted right (10.1), which the next line makes
 * sure goes towards minus infinity; its type is not used (2.3, advisory); functions leave early where
 * a sample is refused (15.5, advisory); a header has macros that its source may not need (2.5,
 * advisory). */
typedef char $name_shifts_negative_numbers[(((-1) >> 1) == -1) ? 1 : -1];

/* The path of bad samples is a function of its own, so that the other needs fewer registers. */
#if defined(__GNUC__)
#define $NAME_APART __attribute__((__noinline__))
#else
#define $NAME_APART
#endif

)";

/// What is done where samples are missing: in 64 bits, held within the ranges of the states.
inline constexpr const char* fixed_source_gap =
    R"(/* ---- What counts and chooses. */

static int32_t within(int64_t x, int32_t most, unsigned *status)
{
  int32_t held = (int32_t)most;
  if (x > most) {
    *status |= $NAME_SATURATED;
  } else if (x < -(int64_t)most) {
    *status |= $NAME_SATURATED;
    held = -most;
  } else {
    held = (int32_t)x;
  }
  return held;
}

/* x = M x + m by; each number of M has its own power of two. */
static unsigned moved($name_state *o, const int32_t m[$N][$N1], const uint8_t powers[$N][$N1],
                      int32_t by, const int32_t most[$N])
{
  int64_t to[$N];
  unsigned status = 0u;
  unsigned i;
  unsigned j;
  for (i = 0u; i < $Nu; ++i) {
    to[i] = ((int64_t)m[i][$N] * by) >> powers[i][$N];
    for (j = 0u; j < $Nu; ++j) {
      to[i] += ((int64_t)m[i][j] * o->x[j]) >> powers[i][j];
    }
  }
  for (i = 0u; i < $Nu; ++i) {
    o->x[i] = within(to[i], most[i], &status);
  }
$FORGET  return status;
}

/* Begins anew, at rest at y under u. */
static unsigned rest_at($name_state *o, int32_t y, int32_t u)
{
  unsigned status = 0u;
$REST_AT$FORGET  o->gap = 0u;
  (void)u;
  (void)y;
  return status;
}

static unsigned predict_slowly($name_state *o, int32_t given)
{
  static const int32_t m[$N][$N1] = {
$PREDICT_M  };
  static const uint8_t powers[$N][$N1] = {
$PREDICT_P  };
$REACH_TABLE  unsigned status = 0u;
  int32_t u = given;
  if (u > $U_MOST) {
    u = $U_MOST;
    status = $NAME_INPUT_REJECTED;
  } else if (u < -$U_MOST) {
    u = -$U_MOST;
    status = $NAME_INPUT_REJECTED;
  } else {
    /* u is good. */
  }
  if (o->gap < 65535u) {
    o->gap = (uint16_t)(o->gap + 1u);
  }
  return status | moved(o, m, powers, u, $REACH_OF);
}

static unsigned correct_slowly($name_state *o, $Y_TYPE given, int32_t u)
{
$CORRECT_TABLES  unsigned status = $NAME_MEASUREMENT_REJECTED;
  unsigned elapsed = o->gap;
$OF_Y_SLOWLY  if (elapsed < 1u) {
    elapsed = 1u;
  }
  if (elapsed > $ROWSu) {
    $IF_Y{
      status = rest_at(o, $Y_ABSOLUTE, u) | $NAME_RESTARTED;
$NEW_Y    }
  } else if ($Y_IN_GAP_RANGE) {
    status = moved(o, $GAINS_OF, y, $BOX_OF);
$NEW_Y    if (elapsed > 1u) {
      status |= $NAME_GAP_BRIDGED;
    }
    o->gap = 0u;
  } else {
    /* y is refused. */
  }
  return status;
}

$NAME_APART static unsigned guarded($name_state *o, $Y_TYPE y, int32_t u)
{
  const unsigned status = predict_slowly(o, u);
  return status | correct_slowly(o, y, u);
}

int32_t $name_estimate(const $name_state *o, unsigned row)
{
  int32_t value = 0;
  switch (row) {
$ESTIMATES  default:
    break;
  }
  return value;
}

)";

/// The functions of an observer.
inline constexpr const char* fixed_source_observer = R"(void $name_init($name_state *o)
{
$INIT  (void)rest_at(o, 0, 0);
}

unsigned $name_reset($name_state *o, $Y_TYPE given)
{
  unsigned status = $NAME_MEASUREMENT_REJECTED;
$OF_Y_RESET  $IF_Y{
    status = rest_at(o, $Y_ABSOLUTE, 0);
$NEW_Y  }
  return status;
}

unsigned $name_predict($name_state *o, int32_t u)
{
  return predict_slowly(o, u);
}

unsigned $name_update($name_state *o, $Y_TYPE given, int32_t u)
{
$OF_Y  if ((o->gap != 0u) || $Y_OUT || (((uint32_t)u + $U_MOSTu) > $U_TWICEu)) {
    return guarded(o, given, u);
  }
  observe(o, y, u);
$NEW_Y  return 0u;
}

)";

/// The functions of a controller.
inline constexpr const char* fixed_source_controller =
    R"(/* The output for the u that is wanted, both in 2^-$LAW_SCALE counts, to whole counts. What is left
 * over stays in u_last: a limit of rate may be below one count a sample. */
static int32_t limited($name_state *o, int32_t wanted)
{
  int32_t u = wanted;
$RATE_LIMIT  if (u < $LOWER_OF) {
    u = $LOWER_OF;
  }
  if (u > $UPPER_OF) {
    u = $UPPER_OF;
  }
  o->u_last = u;
  u = (u + $HALF) >> $LAW_SCALE;
  o->u_held = u;
  return u;
}

static void judge_missing($name_state *o)
{
  if (o->gap >= $MISSING_LIMITu) {
    o->mode = $NAME_SAFE;
  }
$LEAVE_SAFE}

/* The output while the law does not run. */
$NAME_APART static int32_t put_out_held($name_state *o)
{
  int32_t u = $SAFE_INPUT;
  if (o->mode == $NAME_START_HOLD) {
    o->hold_left = o->hold_left - 1u;
    if (o->hold_left == 0u) {
      o->mode = $NAME_RUNNING;
    }
    u = $HOLD_INPUT;
  }
  return limited(o, u);
}

static int32_t put_out($name_state *o, $Y_TYPE reference)
{
$OF_R$CLAMP_R  if (o->mode != $NAME_RUNNING) {
    return put_out_held(o);
  }
  return limited(o, law(o, r));
}

/* The whole step where a sample is missing or bad. */
$NAME_APART static int32_t update_guarded($name_state *o, $Y_TYPE y, $Y_TYPE r)
{
  o->status = (uint8_t)guarded(o, y, o->u_held);
  judge_missing(o);
  return put_out(o, r);
}

void $name_init($name_state *o)
{
$INIT  (void)rest_at(o, 0, 0);
  o->u_last = $START_FINE;
  o->u_held = $START_HELD;
  o->hold_left = $HOLD_LEFTu;
  o->mode = $MODE;
  o->status = 0u;
}

unsigned $name_start($name_state *o, $Y_TYPE given, int32_t u)
{
  unsigned status;
$OF_Y_RESET$REFUSE_Y  if (((uint32_t)u + $U_MOSTu) > $U_TWICEu) {
    return $NAME_INPUT_REJECTED;
  }
  status = rest_at(o, $Y_ABSOLUTE, u);
$NEW_Y  o->u_held = u;
  o->u_last = u * $ONE;
  o->mode = $NAME_RUNNING;
  return status;
}

int32_t $name_update($name_state *o, $Y_TYPE given, $Y_TYPE r)
{
$OF_Y  if ((o->gap != 0u) || $Y_OUT) {
    return update_guarded(o, given, r);
  }
  observe(o, y, o->u_held);
$NEW_Y  o->status = 0u;
$LEAVE_SAFE  return put_out(o, r);
}

unsigned $name_applied($name_state *o, int32_t u)
{
  unsigned status = 0u;
  o->u_held = u;
  if (u > $U_MOST) {
    o->u_held = $U_MOST;
    status = $NAME_INPUT_REJECTED;
  }
  if (u < -$U_MOST) {
    o->u_held = -$U_MOST;
    status = $NAME_INPUT_REJECTED;
  }
  return status;
}

int32_t $name_update_without_measurement($name_state *o, $Y_TYPE r)
{
  o->status = (uint8_t)predict_slowly(o, o->u_held);
  judge_missing(o);
  return put_out(o, r);
}

)";

/// Compares with samples of the design.
inline constexpr const char* fixed_source_self_test = R"(#ifdef $NAME_SELF_TEST
int $name_self_test(void)
{
  static const int32_t samples[$SAMPLES][3] = { /* $COLUMNS */
$VECTORS  };
  $name_state o;
  int i;
  $name_init(&o);
  for (i = 0; i < $SAMPLES; ++i) {
    $RESULT
    if (result != samples[i][2]) {
      return i + 1;
    }
  }
  return 0;
}
#endif
)";

}  // namespace esokit::detail
