#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_PREDICTIVE
/* Of the reference is it known by what would be computed with it. */
static void report_reference(esokit_state *o, real used)
{
  if (!is_finite(used)) {
    o->status = (uint16_t)(o->status | ESOKIT_REFERENCE_REJECTED);
  }
}

static void arm_specially(esokit_state *o)
{
  real feed = 0.0;
  if (o->mode == ESOKIT_START_HOLD) {
    (void)arm_at(o, 0.0, &feed);
  } else {
#if ESOKIT_HOLDS_SAFE
    (void)arm_at(o, o->u_last, &feed);
#else
    (void)arm_at(o, SAFE_INPUT, &feed);
#endif
  }
  report_reference(o, feed);
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
    real u = 0.0;
    (void)arm_blanked(o, &u);
    report_reference(o, u);
    return;
  }
#endif
  if (is_overdue(o)) {
    good = arm_restart(o);
  } else {
    good = arm_after(o, o->gap);
  }
  if (!good) {
    real u = 0.0;
    (void)arm_blind(o, &u);
    report_reference(o, u);
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
  o->hold_left = HOLD_SAMPLES;
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
  (void)take_output(o, u);
  (void)track(o);
  o->phase = 5u;
  (void)refer(o, DESIGN_R_AT_REST);
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
    o->phase = 0u;
    arm(o);
    status = 0u;
  }
  return status;
}

static real control_now(esokit_state *o, real y)
{
  real u = 0.0;
#if ESOKIT_WATCHED
  if (gate_lets_in(o, y)) {
    (void)control_by(o, y, &u);
  } else {
    (void)control_blind(o, &u);
  }
#else
  (void)control_by(o, y, &u);
#endif
  o->measurement = y;
  o->phase = 1u;
  return u;
}

real esokit_control_without_measurement(esokit_state *o)
{
  real u = 0.0;
  (void)control_blind(o, &u);
  o->phase = 2u;
  return u;
}

static unsigned prepare_next(esokit_state *o, DESIGN_NEXT_R)
{
  unsigned status = 0u;
  real given = o->u_last;
  if (o->phase == 1u) {
    status = correct_outside(o, o->measurement);
  } else {
    if (o->phase == 3u) {
      status = correct_outside(o, o->measurement);
    }
    if ((o->phase == 3u) || (o->phase == 4u)) {
      given = o->u_held;
    }
  }
#if ESOKIT_WAITS
  (void)settle(o);
#else
  (void)track(o);
#endif
  status = status | predict_outside(o, given);
  if ((o->phase != 1u) || (status != 0u) || (o->mode != ESOKIT_RUNNING)) {
    judge_next(o);
  }
  o->phase = 0u;
  o->status = (uint16_t)status;
  (void)refer(o, DESIGN_NEXT_R_GIVEN);
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
  if (o->phase == 5u) {
    (void)take_output(o, u);
    (void)track(o);
  }
  if ((o->phase == 0u) || (o->phase == 5u)) {
    if (!revise(o, u)) {
      status = ESOKIT_INPUT_REJECTED;
    }
    arm(o);
  } else {
    o->u_held = u;
    o->phase = ((o->phase == 1u) || (o->phase == 3u)) ? 3u : 4u;
  }
  return status;
}

#endif
#ifdef __cplusplus
")esokit"
#endif
