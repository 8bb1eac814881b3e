#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished design; do not edit.
DESIGN_ABOUT
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ DESIGN_EXACTLY. */

#if ESOKIT_SETTINGS || ESOKIT_GUARDED || ESOKIT_SAVED
#include <stdbool.h>
#endif
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ESOKIT_SAMPLE_TIME SAMPLE_TIME /* s */
/* The design as a string, for a log or an image: it takes no memory unless it is used. */
#define ESOKIT_DESIGN DESIGN_TEXT

/* Flags of `status`; 0: all is well. */
#define ESOKIT_MEASUREMENT_REJECTED 1u /* y was NaN, infinite or too large */
#define ESOKIT_INPUT_REJECTED 2u /* u was too large: the last good one was used */
#define ESOKIT_PREDICTION_DROPPED 4u /* the next good y restarts */
#define ESOKIT_GAP_BRIDGED 8u /* samples were missing before this one */
#define ESOKIT_RESTARTED 16u /* too many samples were missing */
#define ESOKIT_STATE_REJECTED 32u /* start: y is not finite or too large */
#if ESOKIT_CONTROLLER || ESOKIT_PREDICTIVE
#define ESOKIT_REFERENCE_REJECTED 256u /* r was NaN, infinite or too large: u is as it was */
#endif
#if ESOKIT_GATED || ESOKIT_WATCHED
#define ESOKIT_OUTLIER_REJECTED 64u /* y was too far from what was expected */
#endif
#if ESOKIT_WRAPPED
#define ESOKIT_TURN_ASSUMED 128u /* y moved otherwise than before: its turn is uncertain */
#endif

#if ESOKIT_SETTINGS
/* What may be changed while it runs, by esokit_adopt. (MISRA C:2012 8.7, advisory: those of other
 * designs are in other files.) */
typedef struct {
  uint32_t design; /* of which text: others are refused */
  DESIGN_SETTINGS
  real gains[ROWS][GAINS]; /* of the observer, after 1, 2, .. samples */
#if ESOKIT_RECOVERS
  uint16_t recovery[ROWS]; /* 0: counts; else 1 more than are due after it */
  uint16_t bridged; /* samples after which each correction is possible */
#endif
#if ESOKIT_RESTS
  real rest_error;
  uint16_t rest_samples;
#endif
} esokit_settings;

extern const esokit_settings esokit_DESIGN_SET;

#endif
#if ESOKIT_CONTROLLER || ESOKIT_PREDICTIVE
/* `mode`: what determines u. */
#define ESOKIT_RUNNING 0u
#define ESOKIT_START_HOLD 1u
#define ESOKIT_SAFE 2u /* too many measurements are missing */
#if ESOKIT_RESTS
#define ESOKIT_REST 3u /* y is near the reference: u is held */
#endif

#endif
#if ESOKIT_WRAPPED
/* The count of the turns of an angle. */
typedef struct {
  real angle; /* the last y, within half a period of zero */
  real turns;
  real motion; /* of y in motion_samples */
  uint16_t motion_samples;
  uint8_t gaps;
  uint8_t doubts;
  uint8_t begun;
} esokit_turns;

#endif
#if ESOKIT_MEASURED
/* A measured disturbance w. */
typedef struct {
  real memory[W_LENGTH]; /* a ring */
  real given; /* by esokit_measured */
  real last; /* the last good one */
  real lagged; /* behind dead time and lag */
  uint32_t lost;
  uint16_t newest;
} esokit_w;

#endif
typedef struct {
#if ESOKIT_SETTINGS
  const esokit_settings *settings;
#endif
  DESIGN_MEMBERS
#if ESOKIT_DELAYED
  real line[LENGTH]; /* u, not yet acting */
  uint16_t newest;
#endif
#if ESOKIT_GATED
  real gate_mean; /* of the innovation without its sign */
  uint16_t gate_count;
  uint8_t gate_open;
#endif
#if ESOKIT_WRAPPED
  esokit_turns taken;
#endif
#if ESOKIT_GATED_ANGLE
  esokit_turns seen; /* those that are rejected, too */
  uint16_t seen_at; /* samples since one was taken, at the last one */
  uint8_t seen_steady;
  uint8_t seen_rejected;
#endif
#if ESOKIT_MEASURED
  esokit_w w[W_COUNT];
  real w_given; /* their part of the disturbance */
  uint8_t w_is_new;
#endif
#if ESOKIT_GUARDED
  real trust; /* see esokit_set_trust */
  real weight_up;
  real weight_down;
  real gain_ratio;
  real given_ratio;
  real input_factor;
  uint32_t settling_left;
  uint16_t release_left;
  uint8_t pin;
  uint8_t side;
  uint8_t held;
  uint8_t unsettled;
  uint8_t frozen;
  uint8_t gated;
#endif
#if ESOKIT_SCHEDULE
  uint32_t age; /* samples of the schedule */
  uint8_t pending;
  uint8_t settled;
#endif
#if ESOKIT_FILTER
  uint8_t since; /* the last step of the gain */
#endif
#if ESOKIT_DIVIDED
  uint16_t phase; /* a measurement is due at 0 */
#endif
#if ESOKIT_PREDICTIVE
  real measurement;
  real u_held; /* what was reported before prepare */
#endif
#if ESOKIT_CONTROLLER
  real u_kept; /* the last u of update; u_last is what was reported since */
#endif
#if ESOKIT_HOLDS_AT_START || ESOKIT_PREDICTIVE
  uint32_t hold_left; /* samples of the start hold */
#endif
#if ESOKIT_RESTS
  real r_before; /* the last finite one */
  uint32_t inside; /* samples in the band in a row */
#endif
#if ESOKIT_RECOVERS
  uint16_t due; /* corrections before the next long gap */
#endif
  uint16_t gap; /* samples since the last measurement that was taken */
#if ESOKIT_CONTROLLER || ESOKIT_PREDICTIVE
  uint16_t status;
  uint8_t mode;
#endif
#if ESOKIT_PREDICTIVE
  uint8_t phase; /* see PHASE_ in the source */
#endif
#if ESOKIT_CONTROLLER
  uint8_t elsewhere; /* u was commanded by something else since the last sample */
#endif
} esokit_state;

/* At rest at y = 0, u = 0. Call it before all else. */
void esokit_init(esokit_state *o);
#if ESOKIT_CONTROLLER
/* Takes over a plant at rest at y under u; begin with the reference at y. Returns a status. */
unsigned esokit_start(esokit_state *o, real y, real u);
/* One sample: y (NaN if it is missing) and r, DESIGN_REFERENCE; returns the u to be held
 * until the next. */
real esokit_update(esokit_state *o, real y, DESIGN_R);
/* The same without a measurement. */
real esokit_update_without_measurement(esokit_state *o, DESIGN_R);
/* What the actuator really held, before the next update; only if it differs from what update gave.
 * The observer gets it; a limit of rate counts from what update gave (after start: from this u).
 * Returns a status. */
unsigned esokit_applied(esokit_state *o, real u);
#elif ESOKIT_PREDICTIVE
/* Takes over a plant at rest at y under u; the reference is y. Returns a status. */
unsigned esokit_start(esokit_state *o, real y, real u);
/* Restarts at (y, 0, .., 0), and the start hold. Returns a status. */
unsigned esokit_reset(esokit_state *o, real y);
/* At the sample: y (NaN if it is missing); returns the u to be held until the next. */
real esokit_control(esokit_state *o, real y);
/* The same without a measurement. */
real esokit_control_without_measurement(esokit_state *o);
/* The rest, any time before the next sample, whose DESIGN_REFERENCE is given. Returns a status. */
unsigned esokit_prepare(esokit_state *o, DESIGN_NEXT_R);
/* Both at once. */
real esokit_update(esokit_state *o, real y, DESIGN_NEXT_R);
/* What the actuator really holds; only if it is not what control gave. A limit of rate counts from
 * what control gave (after start: from this u). Returns a status. */
unsigned esokit_applied(esokit_state *o, real u);
#else
/* Restarts at (y, 0, .., 0). Returns a status. */
unsigned esokit_reset(esokit_state *o, real y);
/* One sample: y, and the u that the actuator held since the last one. Returns a status. */
unsigned esokit_update(esokit_state *o, real y, real u);
/* Its halves; `predict` alone is a sample without a measurement. */
unsigned esokit_predict(esokit_state *o, real u);
unsigned esokit_correct(esokit_state *o, real y);
#endif
/* Estimate number 0 .. DESIGN_LAST: y, y', .., and then the disturbance, in physical units. */
real esokit_estimate(const esokit_state *o, unsigned row);
#if ESOKIT_MAPPED
/* The curve of the actuator: the effect of u, and the u that has it. */
real esokit_effect_of(real u);
real esokit_input_for(real effect);
#endif

#if ESOKIT_MEASURED
/* w, measured, before the sample at which it begins to act; without it, or if it is not finite,
 * the last good one counts for W_MOST_LOST samples, then zero. */
#if ESOKIT_ONE_W
void esokit_measured(esokit_state *o, real w);
#else
void esokit_measured(esokit_state *o, const real w[W_COUNT]);
#endif

#endif
#if ESOKIT_GUARDED
/* From the next correction on, those of the disturbance count so much, 0 .. 1. Returns a status. */
unsigned esokit_set_trust(esokit_state *o, real trust);

/* At which limit an actuator of unknown output is. */
#define ESOKIT_PIN_FREE 0u
#define ESOKIT_PIN_UPPER 1u
#define ESOKIT_PIN_LOWER 2u
#define ESOKIT_PIN_EITHER 3u /* by the sign of u */
unsigned esokit_set_pin(esokit_state *o, uint8_t where); /* returns a status */

#if ESOKIT_CONTROLLER
/* Instead of update, for a plant that something else holds under u: y is followed, the
 * disturbance stays; returns u. On release begin with the reference at y. */
#if ESOKIT_ERROR_BASED
real esokit_hold(esokit_state *o, real y, real r, real u);
#else
real esokit_hold(esokit_state *o, real y, real u);
#endif
#else
/* Something else holds the plant, until `release`; returns the u to give to the observer. */
real esokit_hold(esokit_state *o);
void esokit_release(esokit_state *o);
#endif

#if !ESOKIT_SOFTENS
/* Another b0 from the next sample on; false, and nothing changes, if it has another sign
 * or is too far away. */
bool esokit_set_input_gain(esokit_state *o, real b);

#endif
#endif
#if ESOKIT_SETTINGS
/* Other settings, of a design with the same sample time, b0 and structure, from now on; estimates
 * and output are kept. False, and nothing changes, if they are of another text. */
bool esokit_adopt(esokit_state *o, const esokit_settings *settings);

#endif
#if ESOKIT_SAVED
/* A state to be kept over a restart, where its bytes stay as they are. */
typedef struct {
  uint32_t design; /* that of ESOKIT_DESIGN */
  uint32_t size;
  uint32_t crc; /* CRC-32 of the state */
  esokit_state state;
} esokit_saved;

void esokit_save(const esokit_state *o, esokit_saved *to);
/* Goes on in a saved state, after init: `samples` of them are missing between the saved one and the
 * next, which are bridged or not as any gap. In these u acted, and it still does (0 for an actuator
 * that was off). It takes a prediction for each, at most 65535. False, and nothing changes, for a
 * state of another design or with a wrong bit. */
bool esokit_load(esokit_state *o, const esokit_saved *from, uint32_t samples, real u);

#endif
#ifdef ESOKIT_SELF_TEST
/* 0, or the number of the first sample whose result differs from that of the design by more than
 * `tolerance`, or whose status does; 0 asks for equal numbers. */
int esokit_self_test(real tolerance);
#endif

#ifdef __cplusplus
}
#endif
#endif
#ifdef __cplusplus
")esokit"
#endif
