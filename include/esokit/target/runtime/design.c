#ifdef __cplusplus
R"esokit("
#endif
/* ---- The recorded calls, by what they are given. */

#if ESOKIT_SETTINGS
#define gains_of o->settings->gains
#define recovery_of o->settings->recovery
#define BRIDGED o->settings->bridged
#else
#define gains_of gains
#define recovery_of recovery
#define BRIDGED MAX_BRIDGED
#endif
static bool correct_after(esokit_state *o, real y, unsigned elapsed)
{
#if ESOKIT_TABLE
#if !ESOKIT_SETTINGS && !ESOKIT_GUARDED && !ESOKIT_PREDICTIVE
  static const real gains[ROWS][GAINS] = { /* after 1, 2, .. samples */
    DESIGN_GAINS
  };
#endif
  const unsigned row = elapsed - 1u;
#if ESOKIT_GAIN_IS_KEPT
  return correct_by(o, y, DESIGN_K);
#else
  if (elapsed > 1u) {
    return correct_by(o, y, DESIGN_K);
  }
  return correct_step(o, y);
#endif
#elif ESOKIT_SCHEDULE
  if (elapsed > 1u) {
    return correct_long(o, y, poles_over(o, elapsed), (real)elapsed);
  }
  return correct_step(o, y);
#else
  (void)elapsed;
  return correct_step(o, y);
#endif
}

#if ESOKIT_PREDICTIVE
static bool arm_after(esokit_state *o, unsigned gap)
{
#if ESOKIT_TABLE
  const unsigned elapsed = (gap > 1u) ? gap : 1u;
  const unsigned row = elapsed - 1u;
  return arm_by(o, DESIGN_K);
#elif ESOKIT_SCHEDULE
  if (gap > 1u) {
    return arm_long(o, poles_over(o, gap), (real)gap);
  }
  return arm_by(o);
#else
  (void)gap;
  return arm_by(o);
#endif
}

#endif
static real estimate_at(const esokit_state *o, unsigned row)
{
  real x = 0.0;
#if ESOKIT_SCHEDULE
  if (o->age <= LEAST_AGE) { /* too early: those of the start */
    DESIGN_PUBLISHED
    return x;
  }
#endif
  DESIGN_ESTIMATES
  return x;
}

#if ESOKIT_CONTROLLER && ESOKIT_SCHEDULE
static real law(const esokit_state *o, DESIGN_R)
{
  return law_for(o, DESIGN_R_GIVEN, DESIGN_ALL_ESTIMATES);
}

#endif
#if ESOKIT_GUARDED
/* The disturbance of each level, and the states. */
static void get_disturbance(const esokit_state *o, real d[LEVELS])
{
  DESIGN_GET_D
}

static void set_disturbance(esokit_state *o, const real d[LEVELS])
{
  DESIGN_SET_D
}

static void get_state(const esokit_state *o, real x[STATES])
{
  DESIGN_GET_X
}

static real predicted_from(const esokit_state *o, const real x[STATES], real u)
{
  return predicted_y(o, DESIGN_X, u);
}

static void stand(esokit_state *o, real y, const real d[LEVELS])
{
  stand_at(o, y, DESIGN_D);
}

#endif
#ifdef __cplusplus
")esokit"
#endif
