#ifdef __cplusplus
R"esokit("
#endif
#ifndef ESOKIT_H
#define ESOKIT_H
/* Written by esokit from a finished monitor; do not edit.
DESIGN_ABOUT
 * Watches a controller of T = SAMPLE_TIME s: esokit_look after each of its updates. */

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* What the controller did at a sample, of its state o: written with `watched`. */
typedef struct {
  real innovation;  /* o.innovation */
  real asked;       /* o.u_asked */
  real held;        /* o.u_last */
  real applied;     /* o.u_applied */
  real estimate;    /* its estimate number 0 */
  real disturbance; /* its estimate number DESIGN_ROW */
  real measured;    /* y, as given to its update; not a number: the sensor is not watched */
  uint32_t missed;   /* o.gap */
  uint16_t status;   /* o.status */
  bool runs;         /* o.mode is 0 */
} esokit_sample;

typedef struct {
  uint32_t samples; /* the counts end at 4294967295 and decide nothing */
  uint32_t rejected; /* measurements that were not finite or outliers */
  uint32_t bridged;  /* corrections after a gap, and restarts */
  uint32_t unsafe;   /* samples with u not determined by the law */
  real lost;        /* share of measurements that were rejected */
  real saturated;   /* share of samples at a limit; about those of the last DESIGN_MEMORY samples */
  real side;        /* those at the upper one, minus those at the lower */
  real underway;    /* share at a limit while y moves where u there drives it, minus while back */
  real innovation;  /* rms, unit of y */
  real gain_ratio;  /* estimate of the true b0 over that of the design */
  real sign_ratio;  /* the same, from large moves of u only */
  real response;    /* rms of what follows u over what should */
  real evidence;
  real opposed;
  real steady;
  real standing;    /* share of measurements that equal the one before */
  bool reversed;    /* the sign of b0 was found to be wrong */
  real phi_sum; /* from here on its own */
  real stages[SIZE];
  real slow_phi;
  real slow_psi;
  real sum_x;
  real sum_xx;
  real sum_xy;
  real sum_aa;
  real large_xx;
  real large_xy;
  real top;
  real phi;
  real x;
  real y;
  real mean_square;
  real last;
  real slow_y;
  uint16_t phase;
  bool has_last;
  bool has_mean;
  bool is_lost;
  bool is_free;
} esokit_state;

/* The likely fault: the first that is found, in this order but for the last. */
#define ESOKIT_NONE 0u
#define ESOKIT_WRONG_SIGN 1u /* of b0 */
#define ESOKIT_GAIN_TOO_SMALL 2u /* b0 is several times too small */
#define ESOKIT_MEASUREMENTS_REJECTED 3u /* more than a tenth */
#define ESOKIT_SATURATED 4u /* more than half of the time, and y is not on its way */
#define ESOKIT_INNOVATION_TOO_LARGE 6u /* three times that of the noise */
#define ESOKIT_GAIN_TOO_LARGE_OR_DISTURBED 7u /* b0 is too large, or a load drives u */
#define ESOKIT_SENSOR_STILL 8u /* y does not change; comes before saturated */

void esokit_clear(esokit_state *o);
void esokit_look(esokit_state *o, const esokit_sample *sample);
unsigned esokit_diagnose(const esokit_state *o);

#ifdef ESOKIT_SELF_TEST
/* 0, or the number of the first row of samples after which the monitor of the design finds
 * something else; each number within `tolerance`, 0 asks for equal ones. */
int esokit_self_test(real tolerance);
#endif

#ifdef __cplusplus
}
#endif
#endif
#ifdef __cplusplus
")esokit"
#endif
