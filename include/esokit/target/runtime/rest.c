#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_RESTS
/* ---- u is held where y is near a reference that does not move. */

static void leave_rest(esokit_state *o)
{
  if (o->mode == ESOKIT_REST) {
    o->mode = ESOKIT_RUNNING;
  }
  o->inside = 0u;
}

#if ESOKIT_MOVES
static bool stands(real rate)
{
  return !(rate < 0.0) && !(rate > 0.0);
}

#endif
/* Whether it is the reference of the last sample and does not move. */
static bool reference_stays(const esokit_state *o, DESIGN_R)
{
  bool stays = (DESIGN_R_IS_FINITE) && !(r < o->r_before) && !(r > o->r_before);
#if ESOKIT_MOVES
  stays = stays && (DESIGN_R_STANDS);
#endif
  return stays;
}

static bool is_in_band(const esokit_state *o, real error)
{
#if ESOKIT_WRAPPED
  const real left = wrapped(error);
#else
  const real left = error;
#endif
#if !ESOKIT_SETTINGS
  (void)o;
#endif
  return fabs(left) <= REST_ERROR;
}

/* Whether y was a measurement for the observer. */
static bool was_taken(const esokit_state *o, real y)
{
#if ESOKIT_GATED || ESOKIT_WATCHED
  const unsigned lost = ESOKIT_MEASUREMENT_REJECTED | ESOKIT_OUTLIER_REJECTED;
#else
  const unsigned lost = ESOKIT_MEASUREMENT_REJECTED;
#endif
  return is_finite(y) && ((o->status & lost) == 0u);
}

/* Between the observer's part of a sample and u. */
static void judge_rest(esokit_state *o, bool is_measured, real y, DESIGN_R)
{
  bool stays = reference_stays(o, DESIGN_R_GIVEN);
  if (is_finite(r)) {
    o->r_before = r;
  }
  stays = stays && ((o->mode == ESOKIT_RUNNING) || (o->mode == ESOKIT_REST));
#if ESOKIT_SETTINGS
  stays = stays && (REST_ERROR > 0.0);
#endif
  if (is_measured && !is_in_band(o, r - y)) {
    stays = false;
  }
  if (!stays) {
    leave_rest(o);
  } else {
    if (is_measured && (o->inside <= REST_SAMPLES)) {
      o->inside = o->inside + 1u;
    }
    if (o->inside > REST_SAMPLES) {
      o->mode = ESOKIT_REST;
    }
  }
}

#endif
#ifdef __cplusplus
")esokit"
#endif
