#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_GUARDED
/* Keeps the disturbance within its bound. */
static void keep_bound(esokit_state *o)
{
#if ESOKIT_BOUNDED
  real most = DISTURBANCE_BOUND;
  real below = 0.0;
  real d[LEVELS];
  unsigned i;
#if ESOKIT_BOUND_OF_U
  const real bound = BOUND_OF_U * fabs(INPUT_GAIN * o->gain_ratio);
  if ((bound > 0.0) && is_finite(bound)) {
    most = scaled_bound(o, bound);
    if (!is_finite(most)) {
      most = LARGEST;
    }
  }
#endif
  get_disturbance(o, d);
  for (i = 0u; i < LEVELS; ++i) {
    const real sum = below + d[i];
    if (fabs(sum) > most) {
      d[i] = ((sum > 0.0) ? most : -most) - below;
    }
    below = below + d[i];
  }
  set_disturbance(o, d);
#else
  (void)o;
#endif
}

/* How much a correction of the disturbance counts. */
static void set_weights(esokit_state *o)
{
  const bool none = (o->held != 0u) || (o->frozen != 0u);
  const bool one_sided = (o->pin != ESOKIT_PIN_FREE) || (o->release_left > 0u);
  o->weight_up = (none || (one_sided && (o->side != UP_SIDE))) ? 0.0 : o->trust;
  o->weight_down = (none || (one_sided && (o->side != DOWN_SIDE))) ? 0.0 : o->trust;
  o->gated = (none || one_sided || (o->trust < 1.0)) ? 1u : 0u;
}

static void settle_guards(esokit_state *o, uint32_t left)
{
  o->settling_left = left;
  o->frozen = 0u;
  o->unsettled = 0u;
  set_weights(o);
}

static bool refused(unsigned status)
{
#if ESOKIT_GATED
  return (status & (ESOKIT_MEASUREMENT_REJECTED | ESOKIT_OUTLIER_REJECTED)) != 0u;
#else
  return (status & ESOKIT_MEASUREMENT_REJECTED) != 0u;
#endif
}

/* After a correction; before: what each level had found until then. */
static void keep_guards(esokit_state *o, const real before[LEVELS], unsigned status)
{
  bool changes = false;
  real d[LEVELS];
  unsigned i;
  if ((o->settling_left > 0u) && (o->gated != 0u) && (o->held == 0u) && (o->frozen == 0u)) {
    o->frozen = 1u;
    o->settling_left = SETTLING;
    set_weights(o);
  }
  get_disturbance(o, d);
  if ((o->gated != 0u) && ((status & ESOKIT_RESTARTED) == 0u)) {
    for (i = 0u; i < LEVELS; ++i) {
      const real moved = d[i] - before[i];
      d[i] = before[i] + (((moved > 0.0) ? o->weight_up : o->weight_down) * moved);
    }
  }
  if (!refused(status)) {
#if ESOKIT_LEAKS
    for (i = 0u; i < LEVELS; ++i) {
      d[i] = d[i] - (LEAK * d[i]);
    }
#endif
    if (o->release_left > 0u) {
      o->release_left = (uint16_t)(o->release_left - 1u);
      changes = o->release_left == 0u;
    }
    if (o->settling_left > 0u) {
      o->settling_left = o->settling_left - 1u;
      if (o->settling_left == 0u) {
        o->frozen = 0u;
        changes = true;
      }
    }
    if (changes) {
      set_weights(o);
    }
  }
  set_disturbance(o, d);
  keep_bound(o);
}

/* The plant is held: the prediction stands still. */
static unsigned predict_standing(esokit_state *o, real u)
{
  real x[STATES];
  real d[LEVELS];
  get_state(o, x);
  const unsigned status = predict_outside(o, u * o->given_ratio);
  if ((status & ESOKIT_PREDICTION_DROPPED) == 0u) {
    const real expected = predicted_from(o, x, o->u_applied);
    unsigned i;
    for (i = 1u; i < ORDER; ++i) {
      const real state = x[i];
      if ((state < 0.0) || (state > 0.0)) {
        o->unsettled = 1u;
      }
    }
    get_disturbance(o, d);
    stand(o, x[0] + (o->DESIGN_Y - expected), d);
  }
  o->given_ratio = o->gain_ratio;
  return status;
}

static unsigned correct_standing(esokit_state *o, real y)
{
  real before[LEVELS];
  const bool overdue = is_overdue(o);
  const unsigned elapsed = (o->gap > 1u) ? o->gap : 1u;
  real left = 1.0;
  if (!overdue) {
    left = 1.0 - gains_of[elapsed - 1u][0];
  }
  get_disturbance(o, before);
  const unsigned status = correct_outside(o, y);
  if (!refused(status)) {
    settle_guards(o, SETTLING);
    stand(o, o->DESIGN_Y + (left * o->innovation), before);
  }
  get_disturbance(o, before);
  keep_guards(o, before, status);
  return status;
}

static unsigned predict_guarded(esokit_state *o, real u)
{
  if (o->held != 0u) {
    return predict_standing(o, u);
  }
  const unsigned status = predict_outside(o, u * o->given_ratio);
  o->given_ratio = o->gain_ratio;
  return status;
}

static unsigned correct_guarded(esokit_state *o, real y)
{
  real before[LEVELS];
  if ((o->held != 0u) || (o->unsettled != 0u)) {
    return correct_standing(o, y);
  }
  get_disturbance(o, before);
  const unsigned status = correct_outside(o, y);
  keep_guards(o, before, status);
  return status;
}

static unsigned update_guarded(esokit_state *o, real y, real u)
{
  real before[LEVELS];
  if ((o->held != 0u) || (o->unsettled != 0u)) {
    const unsigned predicted = predict_guarded(o, u);
    return predicted | correct_guarded(o, y);
  }
  get_disturbance(o, before);
  const unsigned status = update_outside(o, y, u * o->given_ratio);
  o->given_ratio = o->gain_ratio;
  keep_guards(o, before, status);
  return status;
}

static real applied_by_present(const esokit_state *o)
{
  const real u = o->u_applied * o->input_factor;
  return is_finite(u) ? u : ((u < 0.0) ? -LARGEST : LARGEST);
}

unsigned esokit_set_trust(esokit_state *o, real trust)
{
  if (!is_finite(trust)) {
    return ESOKIT_INPUT_REJECTED;
  }
  o->trust = (trust < 0.0) ? 0.0 : ((trust < 1.0) ? trust : 1.0);
  set_weights(o);
  return 0u;
}

unsigned esokit_set_pin(esokit_state *o, uint8_t where)
{
  if (where > ESOKIT_PIN_EITHER) {
    return ESOKIT_INPUT_REJECTED;
  }
  if (where == ESOKIT_PIN_EITHER) {
    const real u = applied_by_present(o);
    o->side = (u > 0.0) ? ESOKIT_PIN_UPPER : ((u < 0.0) ? ESOKIT_PIN_LOWER : ESOKIT_PIN_FREE);
  } else if (where != ESOKIT_PIN_FREE) {
    o->side = where;
  } else {
    /* The side stays until dhat is free. */
  }
  if (where != ESOKIT_PIN_FREE) {
    o->release_left = 0u;
  } else if (o->pin != ESOKIT_PIN_FREE) {
    o->release_left = RELEASE;
  } else {
    /* It was free. */
  }
  o->pin = where;
  set_weights(o);
  return 0u;
}

/* Tells that the plant is held; the u under which it would stand still. */
static real hold_guards(esokit_state *o)
{
  o->held = 1u;
  set_weights(o);
  const real u = (-estimate_at(o, ORDER)) * (PER_INPUT_GAIN * o->input_factor);
  return is_finite(u) ? u : applied_by_present(o);
}

static void release_guards(esokit_state *o)
{
  o->held = 0u;
  set_weights(o);
}

#if !ESOKIT_SOFTENS
bool esokit_set_input_gain(esokit_state *o, real b)
{
#if ESOKIT_ERROR_BASED
  const real ratio = (-b) * PER_INPUT_GAIN;
#else
  const real ratio = b * PER_INPUT_GAIN;
#endif
  const real factor = 1.0 / ratio;
  bool good = is_finite(b) && is_finite(ratio) && is_finite(factor) && (ratio > 0.0);
#if ESOKIT_BOUND_OF_U
  if (good) {
    good = scale_found(o, ratio * o->input_factor);
  }
#endif
  if (good) {
    o->gain_ratio = ratio;
    o->input_factor = factor;
    keep_bound(o);
  }
  return good;
}

#endif
static bool settled(esokit_state *o, bool good)
{
  if (good) {
    settle_guards(o, 0u);
    keep_bound(o);
  }
  return good;
}

#if ESOKIT_CONTROLLER
static bool rest_guarded(esokit_state *o, real y, real u)
{
  const bool good = rest_outside(o, y, u * o->gain_ratio);
  return settled(o, good);
}

#else
real esokit_hold(esokit_state *o)
{
#if ESOKIT_MAPPED
  return esokit_input_for(hold_guards(o));
#else
  return hold_guards(o);
#endif
}

void esokit_release(esokit_state *o)
{
  release_guards(o);
}

static bool restart_guarded(esokit_state *o, real y)
{
#if ESOKIT_WRAPPED
  const bool good = restart(o, y);
#else
  const bool good = restart_plain(o, y);
#endif
  return settled(o, good);
}

#endif
#endif
#ifdef __cplusplus
")esokit"
#endif
