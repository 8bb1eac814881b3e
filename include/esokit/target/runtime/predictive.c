#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_PREDICTIVE
/* What was done since the last prepare. */
#define PHASE_PREPARED 0u
#define PHASE_MEASURED 1u
#define PHASE_MISSING 2u
#define PHASE_MEASURED_AND_APPLIED 3u
#define PHASE_MISSING_AND_APPLIED 4u
#define PHASE_STARTED 5u

/* Of the reference is it known by what would be computed with it. */
static void report_reference(esokit_state *o, real used)
{
  if (!is_finite(used)) {
    o->status = (uint16_t)(o->status | ESOKIT_REFERENCE_REJECTED);
  }
}

static void arm_specially(esokit_state *o)
{
#if ESOKIT_HOLDS_SAFE
  const real safe = o->u_last;
#else
  const real safe = SAFE_INPUT;
#endif
  report_reference(o, arm_at(o, (o->mode == ESOKIT_START_HOLD) ? 0.0 : safe));
}

/* What of the next u does not need its measurement. */
static void arm(esokit_state *o)
{
  bool good;
  if (o->mode != ESOKIT_RUNNING) {
    arm_specially(o);
    return;
  }
#if ESOKIT_SCHEDULE
  if (o->age <= LEAST_AGE) { /* too early for estimates */
    report_reference(o, arm_blanked(o));
    return;
  }
#endif
  if (is_overdue(o)) {
    good = arm_restart(o);
  } else {
    good = arm_after(o, o->gap);
  }
  if (!good) {
    report_reference(o, arm_blind(o));
  }
}

/* Which u is next: after the prediction, when a measurement that is missing counts as two. */
static void judge_next(esokit_state *o)
{
  if (o->mode == ESOKIT_START_HOLD) {
    o->hold_left = o->hold_left - 1u;
    if (o->hold_left == 0u) {
      o->mode = ESOKIT_RUNNING;
    }
  }
  if (o->gap > MISSING_LIMIT) {
    o->mode = ESOKIT_SAFE;
#if !ESOKIT_STAYS_SAFE
  } else if ((o->mode == ESOKIT_SAFE) && (o->gap <= 1u)) {
    o->mode = ESOKIT_RUNNING;
#endif
  } else {
    /* The mode stays. */
  }
}

void esokit_init(esokit_state *o)
{
  DESIGN_INIT
  o->measurement = 0.0;
  o->u_held = 0.0;
  o->hold_left = FIRST_HOLD;
  up_to_date(o);
  o->mode = FIRST_MODE;
  o->phase = FIRST_PHASE;
  o->status = 0u;
}

unsigned esokit_start(esokit_state *o, real y, real u)
{
  const esokit_state before = *o;
  (void)predict_outside(o, u); /* keeps it as applied */
  if (!rest_outside(o, y, u)) {
    *o = before;
    return ESOKIT_STATE_REJECTED;
  }
  up_to_date(o);
  o->hold_left = 0u;
  o->mode = ESOKIT_RUNNING;
  take_output(o, u);
  track(o);
  o->phase = PHASE_STARTED;
  refer(o, DESIGN_R_AT_REST);
  arm(o);
  return 0u;
}

unsigned esokit_reset(esokit_state *o, real y)
{
  unsigned status = ESOKIT_STATE_REJECTED;
  if (restart_plain(o, y)) {
    o->hold_left = HOLD_SAMPLES;
#if ESOKIT_HOLDS_AT_START
    o->mode = ESOKIT_START_HOLD;
#else
    o->mode = ESOKIT_RUNNING;
#endif
    o->phase = PHASE_PREPARED;
    arm(o);
    status = 0u;
  }
  return status;
}

static real control_now(esokit_state *o, real y)
{
#if ESOKIT_WATCHED
  real u;
  if (gate_lets_in(o, y)) {
    u = control_by(o, y);
  } else {
    u = control_blind(o);
  }
#else
  const real u = control_by(o, y);
#endif
  o->measurement = y;
  o->phase = PHASE_MEASURED;
  return u;
}

real esokit_control_without_measurement(esokit_state *o)
{
  const real u = control_blind(o);
  o->phase = PHASE_MISSING;
  return u;
}

static unsigned prepare_next(esokit_state *o, DESIGN_NEXT_R)
{
  unsigned status = 0u;
  real given = o->u_last;
  if (o->phase == PHASE_MEASURED) {
    status = correct_outside(o, o->measurement);
  } else {
    if (o->phase == PHASE_MEASURED_AND_APPLIED) {
      status = correct_outside(o, o->measurement);
    }
    if ((o->phase == PHASE_MEASURED_AND_APPLIED) || (o->phase == PHASE_MISSING_AND_APPLIED)) {
      given = o->u_held;
    }
  }
#if ESOKIT_WAITS
  settle(o);
#else
  track(o);
#endif
  status = status | predict_outside(o, given);
  if ((o->phase != PHASE_MEASURED) || (status != 0u) || (o->mode != ESOKIT_RUNNING)) {
    judge_next(o);
  }
  o->phase = PHASE_PREPARED;
  o->status = (uint16_t)status;
  refer(o, DESIGN_NEXT_R_GIVEN);
  arm(o);
  return o->status;
}

real esokit_control(esokit_state *o, real y)
{
  return control_now(o, y);
}

unsigned esokit_prepare(esokit_state *o, DESIGN_NEXT_R)
{
  return prepare_next(o, DESIGN_NEXT_R_GIVEN);
}

real esokit_update(esokit_state *o, real y, DESIGN_NEXT_R)
{
  const real u = control_now(o, y);
  (void)prepare_next(o, DESIGN_NEXT_R_GIVEN);
  return u;
}

unsigned esokit_applied(esokit_state *o, real u)
{
  unsigned status = 0u;
  if (!is_finite(u)) {
    return ESOKIT_INPUT_REJECTED;
  }
  if (o->phase == PHASE_STARTED) {
    take_output(o, u);
    track(o);
  }
  if ((o->phase == PHASE_PREPARED) || (o->phase == PHASE_STARTED)) {
    if (!revise(o, u)) {
      status = ESOKIT_INPUT_REJECTED;
    }
    arm(o);
  } else {
    o->u_held = u;
    o->phase = ((o->phase == PHASE_MEASURED) || (o->phase == PHASE_MEASURED_AND_APPLIED))
      ? PHASE_MEASURED_AND_APPLIED
      : PHASE_MISSING_AND_APPLIED;
  }
  return status;
}

#endif
#ifdef __cplusplus
")esokit"
#endif
