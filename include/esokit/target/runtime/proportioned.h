#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished output; do not edit.
DESIGN_ABOUT
 * Time-proportioned output: OFF_VALUE or ON_VALUE, in windows of WINDOW samples, T = SAMPLE_TIME s.
 *
 * Compile with -std=c99 or -ffp-contract=off: then it equals the C++ bit for bit. */

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
  real carried; /* that the windows so far owe, samples */
  int32_t sample;
  int32_t on_samples; /* of the window */
} esokit_state;

/* Off, as if for long, at the start of a window. */
void esokit_reset(esokit_state *o);
/* Whether the next sample begins a window: u counts then. */
bool esokit_begins(const esokit_state *o);
/* One sample. @return whether it is on. A u that is not finite is off, and what is carried is
 * forgotten. */
bool esokit_update(esokit_state *o, real u);
/* The mean of the window that esokit_update began last. */
real esokit_applied(const esokit_state *o);

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
