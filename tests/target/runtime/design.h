/* What to_c writes of a design, as declarations: with it the files of target/runtime/ are C that a
 * compiler and a checker read by themselves. See check.py. */
#ifndef DESIGN_H
#define DESIGN_H

#include <math.h>

#if ESOKIT_SINGLE
typedef float real;
#define number(x) x##f
#define fabs fabsf
#define round roundf
#else
typedef double real;
#define number(x) x
#endif

#define DESIGN_ABOUT
#define DESIGN_TEXT "a design"
#define DESIGN_CONSTANTS
#define DESIGN_MEMBERS \
  real z1; \
  real z2; \
  real z3; \
  real u_applied; \
  real u_given; \
  real u_last; \
  real u_asked; \
  real innovation; \
  real published_0;
#define DESIGN_SETTINGS real limit_1;
#define DESIGN_INIT o->z1 = number(0.0);
#define DESIGN_GAINS {number(0.5), number(0.25), number(0.125)}
#if ESOKIT_RECOVERS
#define DESIGN_RECOVERED , {DESIGN_RECOVERY}, 1u
#else
#define DESIGN_RECOVERED
#endif
#if ESOKIT_RESTS
#define DESIGN_RESTS , number(0.4), 6u
#else
#define DESIGN_RESTS
#endif
#if ESOKIT_SETTINGS
#define REST_ERROR o->settings->rest_error
#define REST_SAMPLES o->settings->rest_samples
#else
#define REST_ERROR number(0.4)
#define REST_SAMPLES 6u
#endif
#define DESIGN_SET_OF_SETTINGS                                              \
  const esokit_settings esokit_design = {DESIGN_MARK, number(1.0), {DESIGN_GAINS} DESIGN_RECOVERED \
                                             DESIGN_RESTS};
#define DESIGN_RECOVERY 0u
#define MAX_BRIDGED 1u
#define LAST_ROW 0u
#define esokit_DESIGN_SET esokit_design
#define DESIGN_MARK 1u
#define DESIGN_Y z1
#define DESIGN_ANGLE z1
#define DESIGN_K gains_of[row][0], gains_of[row][1], gains_of[row][2]
#define DESIGN_ESTIMATES \
  if (row == 0u) { \
    x = estimate_0(o); \
  }
#define DESIGN_PUBLISHED \
  if (row == 0u) { \
    x = o->published_0; \
  }
#define DESIGN_ALL_ESTIMATES estimate_at(o, 0u), estimate_at(o, 1u), estimate_at(o, 2u)
#define DESIGN_GET_D \
  d[0] = o->z3; \
  d[1] = o->z3;
#define DESIGN_SET_D o->z3 = d[0] + d[1];
#define DESIGN_GET_X \
  x[0] = o->z1; \
  x[1] = o->z2; \
  x[2] = o->z3;
#define DESIGN_X x[0], x[1], x[2]
#define DESIGN_D d[0], d[1]
#if ESOKIT_ONE_W
#define W_COUNT 1u
#define DESIGN_W_GAINS number(1.0)
#define DESIGN_W_SHARES {number(1.0), number(0.0)}
#define DESIGN_W_LATES {number(1.0), number(0.0)}
#define DESIGN_W_REACHED {number(1.0), number(0.0)}
#define DESIGN_W_LAST 3u
#else
#define W_COUNT 2u
#define DESIGN_W_GAINS number(1.0), number(2.0)
#define DESIGN_W_SHARES {number(1.0), number(0.0)}, {number(0.5), number(0.5)}
#define DESIGN_W_LATES {number(1.0), number(0.0)}, {number(0.5), number(0.5)}
#define DESIGN_W_REACHED {number(1.0), number(0.0)}, {number(0.5), number(0.5)}
#define DESIGN_W_LAST 3u, 1u
#endif
#define W_LENGTH 4u
#define W_MOST_LOST 7u
#define FOUR_PER_W number(8.0)
#define MAP_POINTS 2u
#define MAP_LINES 3u
#define DESIGN_MAP_ENDS {number(-3.0), number(3.0)}, {number(-0.5), number(0.5)}
#define DESIGN_MAP_LINES \
  {number(2.5), number(1.0), number(1.0)}, {number(0.0), number(0.125), number(8.0)}, \
    {number(-2.5), number(1.0), number(1.0)}
#define SAMPLE_TIME number(0.01)
#define LARGEST number(1e30)
#define GAINS 3
#define SAMPLES 1
#define CALLS 1
#define CALL_LATER 0u
#define DESIGN_CALLS {0u, 0u}
#if ESOKIT_MOVES
#define DESIGN_R real r, real r1, real r2
#define DESIGN_R_GIVEN r, r1, r2
#define DESIGN_NEXT_R real next_r, real next_r1, real next_r2
#define DESIGN_NEXT_R_GIVEN next_r, next_r1, next_r2
#define DESIGN_MOTION r1, r2
#define DESIGN_R_AT_REST y, number(0.0), number(0.0)
#define DESIGN_R_IS_FINITE is_finite(r) && is_finite(r1) && is_finite(r2)
#define DESIGN_R_STANDS stands(r1) && stands(r2)
#define DESIGN_SAMPLE_R r, given[2], given[3]
#define DESIGN_VECTORS {number(0.0), number(0.0), number(0.0), number(0.0), number(0.0)}
#define COLUMNS 5u
#else
#define DESIGN_R real r
#define DESIGN_R_GIVEN r
#define DESIGN_NEXT_R real next_r
#define DESIGN_NEXT_R_GIVEN next_r
#define DESIGN_R_AT_REST y
#define DESIGN_R_IS_FINITE is_finite(r)
#define DESIGN_SAMPLE_R r
#define DESIGN_VECTORS {number(0.0), number(0.0), number(0.0)}
#define COLUMNS 3u
#endif
#define ROWS 1u
#define STATES 3u
#define ORDER 2u
#define LEVELS 2u
#define DELAY 3u
#define LENGTH 4u
#define DIVIDER 2u
#define DESIGN_NUMBER 0x1234abcdu
#define MISSING_LIMIT 10u
#define HOLD_SAMPLES 13u
#define FIRST_HOLD 5u
#define FIRST_MODE 1u
#define FIRST_PHASE 0u
#define FIRST_ELSEWHERE 1u
#define FIRST_KEPT number(0.25)
#define HOLD_INPUT number(0.5)
#define SAFE_INPUT number(0.5)
#define GATE_FACTOR number(6.0)
#define GATE_THRESHOLD number(0.05)
#define GATE_MOST 5u
#define PERIOD number(2.5)
#define PER_PERIOD number(0.4)
#define HALF_PERIOD number(1.25)
#define QUARTER_PERIOD number(0.625)
#define MOST_TURNS number(1e6)
#define DISTURBANCE_BOUND number(1.5)
#define BOUND_OF_U number(1.0)
#define INPUT_GAIN number(8.0)
#define PER_INPUT_GAIN number(0.125)
#define LEAK number(0.01)
#define SETTLING 20u
#define RELEASE 20u
#define UP_SIDE 1u
#define DOWN_SIDE 2u
#define LAW_START 1u
#define LEAST_AGE 2u
#define DECAY number(0.5)
#define SHIFT number(0.5)
#define CONTRACTION number(0.5)

#include <stdbool.h>

#include <esokit/target/runtime/controller.h>

/* The recorded calls, not all of which a set of features has. */
#define DESIGN_LISTS \
  bool restart_at(esokit_state *o, real y); \
  bool predict_step(esokit_state *o, real u); \
  bool observe(esokit_state *o, real y, real u); \
  bool correct_by(esokit_state *o, real y, real k1, real k2, real k3); \
  bool correct_step(esokit_state *o, real y); \
  bool correct_long(esokit_state *o, real y, real contraction, real samples); \
  real estimate_0(const esokit_state *o); \
  bool shift(esokit_state *o, real offset); \
  bool load(esokit_state *o, real offset); \
  bool is_inlier(const esokit_state *o, real y); \
  real drive(const esokit_state *o, real u); \
  real limit(esokit_state *o, real u); \
  void take_over(esokit_state *o, real u); \
  real within(const esokit_state *o, real u); \
  void harden(esokit_state *o); \
  void soften(esokit_state *o, real u); \
  real law_for(const esokit_state *o, DESIGN_R, real e0, real e1, real e2); \
  DESIGN_LAW real scaled_bound(const esokit_state *o, real bound); \
  bool scale_found(esokit_state *o, real change); \
  real predicted_y(const esokit_state *o, real x1, real x2, real x3, real u); \
  void stand_at(esokit_state *o, real y, real d1, real d2); \
  void schedule_restart(esokit_state *o); \
  void schedule_next(esokit_state *o); \
  bool schedule_settle(esokit_state *o); \
  void anchor_begin(esokit_state *o); \
  void anchor_take(esokit_state *o, real power, real contraction); \
  real anchor_contraction(const esokit_state *o, real power, real contraction); \
  real anchor_power(const esokit_state *o, real power, real contraction); \
  void anchor_end(esokit_state *o, real count); \
  real present_poles(const esokit_state *o); \
  real joined_poles(const esokit_state *o, real a, real b); \
  void filter_corrected(esokit_state *o); \
  void filter_missed(esokit_state *o); \
  bool filter_at_ceiling(esokit_state *o); \
  bool filter_to_limit(esokit_state *o); \
  real control_by(esokit_state *o, real y); \
  real control_blind(esokit_state *o); \
  void refer(esokit_state *o, DESIGN_R); \
  void take_output(esokit_state *o, real u); \
  void track(esokit_state *o); \
  void settle(esokit_state *o); \
  bool revise(esokit_state *o, real u); \
  bool arm_restart(esokit_state *o); \
  real arm_at(esokit_state *o, real u); \
  real arm_blind(esokit_state *o); \
  DESIGN_REST DESIGN_PHASES
#if ESOKIT_WRAPPED
#define DESIGN_REST bool rest_at(esokit_state *o, real y, real u, real angle);
#else
#define DESIGN_REST bool rest_at(esokit_state *o, real y, real u);
#endif
#if ESOKIT_SCHEDULE
#define DESIGN_LAW
#define DESIGN_PHASES \
  real arm_blanked(esokit_state *o); \
  bool arm_by(esokit_state *o); \
  bool arm_long(esokit_state *o, real contraction, real samples);
#elif ESOKIT_FILTER
#define DESIGN_LAW real law(const esokit_state *o, DESIGN_R);
#define DESIGN_PHASES bool arm_by(esokit_state *o);
#else
#define DESIGN_LAW real law(const esokit_state *o, DESIGN_R);
#define DESIGN_PHASES bool arm_by(esokit_state *o, real k1, real k2, real k3);
#endif

#endif
