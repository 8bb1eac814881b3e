#ifdef __cplusplus
R"esokit("
#endif
/* ---- What counts and chooses. */

#define COUNT_MOST 65535u /* of what is counted in 16 bits: more is as much */
#if ESOKIT_GATED
#define GATE_SHARE 0.015625 /* of an innovation in their mean */
#endif

#if ESOKIT_DELAYED || ESOKIT_MEASURED
/* Of a ring. */
static uint16_t next_place(uint16_t place, uint16_t last)
{
  return (place < last) ? (uint16_t)(place + 1u) : 0u;
}

#endif
static void up_to_date(esokit_state *o)
{
  o->gap = 0u;
#if ESOKIT_RECOVERS
  o->due = 0u;
#endif
}

#if ESOKIT_RECOVERS
#if !ESOKIT_SETTINGS
static const uint16_t recovery[ROWS] = { /* 0: counts; else 1 more than are due after it */
  DESIGN_RECOVERY
};
#endif

/* What is due after the longest gap that is bridged. */
static uint32_t most_due(const esokit_state *o)
{
  uint32_t most = recovery_of[LAST_ROW];
  (void)o;
  if (most > 0u) {
    most = most - 1u;
  }
  return most;
}

#endif
/* The next y restarts. */
static bool is_overdue(const esokit_state *o)
{
  if (o->gap > ROWS) {
    return true;
  }
#if ESOKIT_RECOVERS
  if ((o->due != 0u) && (o->gap > BRIDGED)) { /* no more than after two of the longest */
    const uint32_t more = recovery_of[o->gap - 1u];
    return ((uint32_t)o->due + more) > (most_due(o) + most_due(o) + 1u);
  }
#endif
  return false;
}

#if ESOKIT_RECOVERS
/* What a correction means for the next gap of more than BRIDGED samples. */
static void recover(esokit_state *o, unsigned elapsed)
{
  const uint32_t more = recovery_of[elapsed - 1u];
  const uint32_t due = (uint32_t)o->due + more;
  if ((o->due < COUNT_MOST) && (due > 0u)) { /* else it is more than counted: until a restart */
    o->due = COUNT_MOST;
    if (due <= COUNT_MOST) {
      o->due = (uint16_t)(due - 1u);
    }
  }
}

#endif
#if ESOKIT_SETTINGS
/* With other gains: what was due was counted with the old ones. */
static void recover_anew(esokit_state *o)
{
#if ESOKIT_RECOVERS
  if (o->due != 0u) {
    o->due = (uint16_t)most_due(o);
  }
#else
  (void)o;
#endif
}

#endif
static bool restart_plain(esokit_state *o, real y)
{
  bool good = is_finite(y);
  if (good) {
    good = restart_at(o, y);
  }
  if (good) {
    up_to_date(o);
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
    law_begin(o);
#endif
  }
  return good;
}

static unsigned predict_plain(esokit_state *o, real given)
{
  const bool good = predict_step(o, given);
  unsigned status = 0u;
  if (o->gap < COUNT_MOST) {
    o->gap = (uint16_t)(o->gap + 1u);
  }
  if (good) {
    return status;
  }
  if (is_finite(given) && !(fabs(given) > fabs(o->u_applied))) { /* u is not the cause */
    o->u_applied = given;
    o->gap = COUNT_MOST;
    status = ESOKIT_PREDICTION_DROPPED;
  } else if (predict_step(o, o->u_applied)) {
    status = ESOKIT_INPUT_REJECTED;
  } else {
    o->gap = COUNT_MOST;
    status = ESOKIT_INPUT_REJECTED | ESOKIT_PREDICTION_DROPPED;
  }
  return status;
}

static unsigned correct_plain(esokit_state *o, real y)
{
  unsigned status = ESOKIT_MEASUREMENT_REJECTED;
  const bool overdue = is_overdue(o);
  const unsigned elapsed = (o->gap > 1u) ? o->gap : 1u;
  if (overdue) {
    if (restart_plain(o, y)) {
      status = ESOKIT_RESTARTED;
    }
  } else if (correct_after(o, y, elapsed)) {
    o->gap = 0u;
#if ESOKIT_RECOVERS
    recover(o, elapsed);
#endif
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
    law_accept(o);
#endif
    status = 0u;
    if (elapsed > 1u) {
      status = ESOKIT_GAP_BRIDGED;
    }
  } else if (fabs(y) < fabs(o->DESIGN_Y)) { /* the state was to blame */
    if (restart_plain(o, y)) {
      status = ESOKIT_RESTARTED;
    }
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
  if (!is_finite(innovation)) {
    return true;
  }
  if (is_overdue(o)) {
    gate_set(o, true);
    return true;
  }
  if (o->gap > 1u) {
    most = usual * (real)o->gap;
  }
  const bool is_near = distance <= most;
  if (!is_near && (o->gate_open == 0u) && (o->gate_count < GATE_MOST)) {
    o->gate_count = (uint16_t)(o->gate_count + 1u);
    return false;
  }
  o->gate_mean =
    o->gate_mean + ((((distance < usual) ? distance : usual) - o->gate_mean) * GATE_SHARE);
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
  return is_overdue(o) || !is_finite(innovation) || is_inlier(o, y);
}

#endif
#ifdef __cplusplus
")esokit"
#endif
