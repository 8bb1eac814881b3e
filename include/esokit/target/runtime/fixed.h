#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished design; do not edit.
DESIGN_ABOUT
 *
 * With a good y at each sample the estimates and u differ from those of the same design in exact
 * numbers, with the written gains, by at most:
DESIGN_BOUNDS
 */

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The design as a string, for a log or an image: it takes no memory unless it is used. */
#define ESOKIT_DESIGN DESIGN_TEXT

/* Flags of `status`; 0: all is well. */
#define ESOKIT_MEASUREMENT_REJECTED 1u /* y was outside its range: no measurement */
#define ESOKIT_INPUT_REJECTED 2u /* u was outside its range: the end of the range was used */
#define ESOKIT_GAP_BRIDGED 8u /* samples were missing before this one */
#define ESOKIT_RESTARTED 16u /* too many samples were missing */
#define ESOKIT_REFERENCE_REJECTED 32u /* r was outside its range: the end of the range was used */
#define ESOKIT_SATURATED 128u /* in a gap a state left its range and was held there */

/* The value of a count of an estimate. */
DESIGN_UNITS
#if ESOKIT_SETTINGS
#define ESOKIT_SETTINGS_REJECTED 64u /* adopt: they are of another text */

/* What may be changed while it runs, by esokit_adopt. (MISRA C:2012 8.7, advisory: those of other
 * designs are in other files.) */
typedef struct {
  uint32_t design; /* of which text: others are refused */
  int32_t gain[GAINS];
  int32_t reach[STATES]; /* where the states can be, and where a measurement leaves them */
  int32_t box[STATES];
#if ESOKIT_CONTROLLER
  int32_t lower; /* of u, in 2^-LAW_SCALE counts */
  int32_t upper;
#endif
#if ESOKIT_RATED
  int32_t rate; /* a sample */
#endif
  int32_t correct[ROWS][STATES][COLUMNS]; /* after 1, 2, .. samples */
  uint8_t powers[ROWS][STATES][COLUMNS];
} esokit_settings;

extern const esokit_settings esokit_DESIGN_SET;

#endif
#if ESOKIT_CONTROLLER
/* `mode`: what determines u. */
#define ESOKIT_RUNNING 0u
#define ESOKIT_START_HOLD 1u
#define ESOKIT_SAFE 2u /* too many measurements are missing */

typedef struct {
  DESIGN_MEMBERS
  int32_t u_last; /* after the limits, in 2^-LAW_SCALE counts */
  int32_t u_held; /* what the actuator holds, in counts */
  uint32_t hold_left; /* samples of the start hold */
  uint16_t gap; /* samples since the last measurement that was taken, as far as they count */
  uint8_t mode;
  uint8_t status;
} esokit_state;

/* At rest at DESIGN_ORIGIN, u = 0. Call it before all else, and then start. */
void esokit_init(esokit_state *o);
/* Takes over a plant at rest at y under u; begin with the reference at y. Returns a status. */
unsigned esokit_start(esokit_state *o, y_count y, int32_t u);
/* One sample: y and r, the reference, in counts of y; returns the u to be held until the next. */
int32_t esokit_update(esokit_state *o, y_count y, y_count r);
/* The same without a measurement. */
int32_t esokit_update_without_measurement(esokit_state *o, y_count r);
/* What the actuator really held, before the next update; only if it differs from what update gave.
 * A limit of rate counts from what update gave. Returns a status. */
unsigned esokit_applied(esokit_state *o, int32_t u);
#else
typedef struct {
  DESIGN_MEMBERS
  uint16_t gap; /* samples since the last measurement that was taken, as far as they count */
} esokit_state;

/* At rest at DESIGN_ORIGIN. Call it before all else, and then reset. */
void esokit_init(esokit_state *o);
/* Begins anew at y. Returns a status. */
unsigned esokit_reset(esokit_state *o, y_count y);
/* One sample: y, and the u that the actuator held before it. Returns a status. */
unsigned esokit_update(esokit_state *o, y_count y, int32_t u);
/* A sample without a measurement. Returns a status. */
unsigned esokit_predict(esokit_state *o, int32_t u);
#endif
#if ESOKIT_SETTINGS
/* Other settings, written for this text, from now on; estimates and output are kept, but a state
 * outside the range of the new settings is held there. Returns a status. */
unsigned esokit_adopt(esokit_state *o, const esokit_settings *settings);
#endif
/* Estimate number 0 .. DESIGN_LAST: DESIGN_Y, y', .., and then the disturbance. */
int32_t esokit_estimate(const esokit_state *o, unsigned row);

#ifdef ESOKIT_SELF_TEST
/* 0, or the number of the first sample whose result differs from that of the design. One more than
 * there are if a count outside its range, a gap or what leads out of it is not taken as such. */
int esokit_self_test(void);
#endif

#ifdef __cplusplus
}
#endif
#endif
#ifdef __cplusplus
")esokit"
#endif
