#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished profile; do not edit.
DESIGN_ABOUT
 * A reference from rest to rest with all derivatives up to the one of order ORDER, T = SAMPLE_TIME s.
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ bit for bit, with the same
 * DESIGN_ROOTS. */

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ESOKIT_ORDER ORDER

typedef struct {
  real start;
  real target;
  int32_t sample;
  int32_t samples; /* of the move */
} esokit_state;

/* At rest at `value`; false, and nothing changes, if it is not finite. Before the first one that is
 * true the state has to be all zeros, as a static one is: at rest at zero. */
bool esokit_reset(esokit_state *o, real value);
/* One sample on the way to a target; one that changes during a move is taken up at its end. False if
 * it is not finite or too far: a move that runs goes on, another one does not begin. */
bool esokit_update(esokit_state *o, real target);
/* Whether a move runs. */
bool esokit_moves(const esokit_state *o);
/* The reference and its derivatives, now. */
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
