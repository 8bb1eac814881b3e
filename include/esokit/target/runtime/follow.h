#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished profile; do not edit.
DESIGN_ABOUT
 * A reference with ORDER of its derivatives that follows a moving target, T = SAMPLE_TIME s.
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ bit for bit. */

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ESOKIT_ORDER ORDER

/* A sum, and what its digits do not hold. */
typedef struct {
  real whole;
  real rest;
} esokit_sum;

typedef struct {
  esokit_sum place; /* at the next update */
#if ESOKIT_SECOND
  esokit_sum speed;
  real thrust; /* the acceleration of the target, within the limit */
#endif
  esokit_sum target;
  real target_speed; /* within the limit */
  real motion[COUNT];
} esokit_state;

/* At y with this speed (order 1: any) at the next update: before the first one, and where an operator
 * hands over. False, and nothing changes, if one is not finite or too large. Before the first one
 * that is true the state has to be all zeros, as a static one is: at rest at zero. */
bool esokit_start(esokit_state *o, real y, real speed);
/* One sample. The target: where to be now, and its derivatives, or zeros. False if it is not finite
 * or too large: then the last one goes on at its speed. */
bool esokit_update(esokit_state *o, const real target[COUNT]);
/* One sample in which the axis cannot go on: the reference comes to rest within the limits. */
void esokit_wait(esokit_state *o);
/* What the law gets: the reference and its derivatives, now. */
void esokit_motion(const esokit_state *o, real motion[COUNT]);

#ifdef ESOKIT_SELF_TEST
/* 0, or the number of the first sample that differs from that of the design by more than
 * `tolerance`. */
int esokit_self_test(real tolerance);
#endif

#ifdef __cplusplus
}
#endif
#endif
#ifdef __cplusplus
")esokit"
#endif
