#ifdef __cplusplus
R"esokit("
#endif
/* ---- What counts and chooses. */

#if ESOKIT_DELAYED || ESOKIT_MEASURED
/* Of a ring. */
static uint16_t next_place(uint16_t place, uint16_t last)
{
  return (place < last) ? (uint16_t)(place + 1u) : 0u;
}

#endif
static bool restart_plain(esokit_state *o, real y)
{
  const bool good = is_finite(y) && restart_at(o, y);
  if (good) {
    o->gap = 0u;
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
    law_begin(o);
#endif
  }
  return good;
}

static unsigned predict_plain(esokit_state *o, real given)
{
  unsigned status = 0u;
  const bool good = predict_step(o, given);
  if (o->gap < 65535u) {
    o->gap = (uint16_t)(o->gap + 1u);
  }
  if (good) {
    return status;
  }
  if (is_finite(given) && !(fabs(given) > fabs(o->u_applied))) { /* u is not the cause */
    o->u_applied = given;
    o->gap = 65535u;
    status = ESOKIT_PREDICTION_DROPPED;
  } else if (predict_step(o, o->u_applied)) {
    status = ESOKIT_INPUT_REJECTED;
  } else {
    o->gap = 65535u;
    status = ESOKIT_INPUT_REJECTED | ESOKIT_PREDICTION_DROPPED;
  }
  return status;
}

static unsigned correct_plain(esokit_state *o, real y)
{
  unsigned status = ESOKIT_MEASUREMENT_REJECTED;
  const unsigned elapsed = (o->gap > 1u) ? o->gap : 1u;
  if (elapsed > ROWS) {
    if (restart_plain(o, y)) {
      status = ESOKIT_RESTARTED;
    }
  } else if (correct_after(o, y, elapsed)) {
    o->gap = 0u;
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
    law_accept(o);
#endif
    status = 0u;
    if (elapsed > 1u) {
      status = ESOKIT_GAP_BRIDGED;
    }
  } else if ((fabs(y) < fabs(o->DESIGN_Y)) && restart_plain(o, y)) { /* the state was to blame */
    status = ESOKIT_RESTARTED;
  } else {
    /* y is refused. */
  }
  return status;
}

#if ESOKIT_GATED
static void gate_set(esokit_state *o, bool open)
{
  o->gate_open = open ? 1u : 0u;
  o->gate_count = 0u;
}

/* A y that is not finite, or after too long a gap, is left to the observer. */
static bool gate_lets_in(esokit_state *o, real y)
{
  const real running = GATE_FACTOR * o->gate_mean;
  const real usual = (running > GATE_THRESHOLD) ? running : GATE_THRESHOLD;
  const real innovation = y - o->DESIGN_Y;
  const real distance = fabs(innovation);
  real most = usual;
  bool is_near;
  if (!is_finite(innovation)) {
    return true;
  }
  if (o->gap > ROWS) {
    gate_set(o, true);
    return true;
  }
  if (o->gap > 1u) {
    most = usual * (real)o->gap;
  }
  is_near = distance <= most;
  if (!is_near && (o->gate_open == 0u) && (o->gate_count < GATE_MOST)) {
    o->gate_count = (uint16_t)(o->gate_count + 1u);
    return false;
  }
  o->gate_mean =
    o->gate_mean + ((((distance < usual) ? distance : usual) - o->gate_mean) * 0.015625);
  if ((o->gate_open != 0u) && is_near) {
    o->gate_count = (uint16_t)(o->gate_count + 1u);
    if (o->gate_count >= GATE_MOST) {
      gate_set(o, false);
    }
  } else {
    gate_set(o, !is_near);
  }
  return true;
}

#endif
#if ESOKIT_WATCHED
static bool gate_lets_in(const esokit_state *o, real y)
{
  const real innovation = y - o->DESIGN_Y;
  return (o->gap > ROWS) || !is_finite(innovation) || is_inlier(o, y);
}

#endif
#ifdef __cplusplus
")esokit"
#endif
