#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished profile; do not edit.
DESIGN_ABOUT
 * A reference for a machine of order 1 with ORDER of its derivatives, T = SAMPLE_TIME s.
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
  real target;
  esokit_sum place; /* of the reference without the lag */
#if ESOKIT_LAGS
  real behind; /* by how much the reference is behind it */
#endif
  real begin; /* at rest there, */
  real held;  /* under this u */
  real feed;
  real motion[COUNT];
#if ESOKIT_DELAYED
  real past[PLACES]; /* motions that are still to come */
  uint32_t oldest;
#endif
} esokit_state;

/* At rest at y under u: before the first update, and where an operator hands over; false, and
 * nothing changes, if one is not finite, or so large that what follows is not. Before the first one
 * that is true the state has to be all zeros, as a static one is: at rest at zero under u = 0. */
bool esokit_start(esokit_state *o, real y, real u);
/* One sample on the way to a target, which may change at any time. False if it is not finite or so
 * large that what follows is not: the last one counts. */
bool esokit_update(esokit_state *o, real target);
/* What the law gets: the reference and its derivatives, now. */
void esokit_motion(const esokit_state *o, real motion[COUNT]);
/* The u to add to that of the law, in the same sample. */
real esokit_feed(const esokit_state *o);

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
