#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_PREDICTIVE
/* What of the next u does not need its measurement. */
static void arm(esokit_state *o)
{
  bool good;
  if (o->hold_left > 0u) {
    (void)arm_hold(o);
    return;
  }
#if ESOKIT_SCHEDULE
  if (o->age <= LEAST_AGE) { /* too early for estimates */
    (void)arm_blanked(o);
    return;
  }
#endif
  if (o->gap > ROWS) {
    good = arm_restart(o);
  } else {
    good = arm_after(o, o->gap);
  }
  if (!good) {
    (void)arm_blind(o);
  }
}

void esokit_init(esokit_state *o)
{
  DESIGN_INIT
  o->measurement = 0.0;
  o->hold_left = HOLD_SAMPLES;
  o->gap = 0u;
  o->phase = 0u;
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
  o->gap = 0u;
  o->hold_left = 0u;
  (void)take_output(o, u);
  (void)track(o);
  o->phase = 0u;
  (void)refer(o, y);
  arm(o);
  return 0u;
}

unsigned esokit_reset(esokit_state *o, real y)
{
  unsigned status = ESOKIT_STATE_REJECTED;
  if (restart_plain(o, y)) {
    o->hold_left = HOLD_SAMPLES;
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

static unsigned prepare_next(esokit_state *o, real next_r)
{
  unsigned status = 0u;
  if (o->phase == 1u) {
    status = correct_outside(o, o->measurement);
  }
#if ESOKIT_WAITS
  (void)settle(o);
#else
  (void)track(o);
#endif
  status = status | predict_outside(o, o->u_last);
  o->phase = 0u;
  if (o->hold_left > 0u) {
    o->hold_left = o->hold_left - 1u;
  }
  (void)refer(o, next_r);
  arm(o);
  o->status = (uint8_t)status;
  return status;
}

real esokit_control(esokit_state *o, real y)
{
  return control_now(o, y);
}

unsigned esokit_prepare(esokit_state *o, real next_r)
{
  return prepare_next(o, next_r);
}

real esokit_update(esokit_state *o, real y, real next_r)
{
  const real u = control_now(o, y);
  (void)prepare_next(o, next_r);
  return u;
}

unsigned esokit_applied(esokit_state *o, real u)
{
  unsigned status = 0u;
  real held = u;
  if (!is_finite(u)) {
    status = ESOKIT_INPUT_REJECTED;
    held = o->u_last;
  }
  (void)take_output(o, held);
  if (o->phase == 0u) {
    (void)track(o);
    if (!revise(o, held)) {
      status = ESOKIT_INPUT_REJECTED;
    }
    arm(o);
  }
  return status;
}

#endif
#ifdef __cplusplus
")esokit"
#endif
