#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_MEASURED
/* ---- Measured disturbances w. */

static const real w_gain[W_COUNT] = {DESIGN_W_GAINS};
static const uint16_t w_last[W_COUNT] = {DESIGN_W_LAST}; /* place of each ring */

/* The mean of one over the coming sample behind dead time and lag; passed: where the lag is then. */
static real course_of_w(const esokit_state *o, unsigned i, real *passed)
{
  static const real share[W_COUNT][2] = {DESIGN_W_SHARES};
  static const real late[W_COUNT][2] = {DESIGN_W_LATES};
  static const real reached[W_COUNT][2] = {DESIGN_W_REACHED};
  const uint16_t oldest = next_place(o->w[i].newest, w_last[i]);
  real arrived[2];
  real mean = 0.0;
  real now = o->w[i].lagged;
  unsigned k;
  arrived[0] = o->w[i].memory[oldest];
  arrived[1] = o->w[i].memory[next_place(oldest, w_last[i])];
  for (k = 0u; k < 2u; ++k) {
    mean = mean + (share[i][k] * arrived[k]) + ((now - arrived[k]) * late[i][k]);
    now = now + (reached[i][k] * (arrived[k] - now));
  }
  *passed = now;
  return mean;
}

static real effect_of_w(const esokit_state *o)
{
  real passed = 0.0;
  real all = 0.0;
  unsigned i;
  for (i = 0u; i < W_COUNT; ++i) {
    all = all + (w_gain[i] * course_of_w(o, i, &passed));
  }
  return all;
}

static void advance_w(esokit_state *o, unsigned i)
{
  const real most = FOUR_PER_W * o->w[i].given;
  const real effect = w_gain[i] * most;
  real passed = 0.0;
  (void)course_of_w(o, i, &passed);
  o->w[i].lagged = passed;
  if ((o->w_is_new != 0u) && is_finite(most) && is_finite(effect)) {
    o->w[i].last = o->w[i].given;
    o->w[i].lost = 0u;
  } else if (o->w[i].lost <= COUNT_MOST) {
    o->w[i].lost = o->w[i].lost + 1u;
  } else {
    /* It has been lost for long. */
  }
  o->w[i].newest = next_place(o->w[i].newest, w_last[i]);
  o->w[i].memory[o->w[i].newest] = 0.0;
  if (o->w[i].lost <= W_MOST_LOST) {
    o->w[i].memory[o->w[i].newest] = o->w[i].last;
  }
}

/* After a prediction. */
static void advance_measured(esokit_state *o)
{
  unsigned i;
  for (i = 0u; i < W_COUNT; ++i) {
    advance_w(o, i);
  }
  o->w_is_new = 0u;
  const real now = effect_of_w(o);
  const real more = now - o->w_given;
  if ((more < 0.0) || (more > 0.0)) {
    if (load(o, more)) {
      o->w_given = now;
    }
  }
}

#if ESOKIT_CONTROLLER
/* As if each had been there for long. */
static void settle_measured(esokit_state *o)
{
  unsigned i;
  for (i = 0u; i < W_COUNT; ++i) {
    const real w = o->w[i].memory[o->w[i].newest];
    unsigned k;
    for (k = 0u; k <= w_last[i]; ++k) {
      o->w[i].memory[k] = w;
    }
    o->w[i].lagged = w;
  }
  o->w_given = effect_of_w(o);
}

#endif
#if ESOKIT_ONE_W
void esokit_measured(esokit_state *o, real w)
{
#if ESOKIT_ERROR_BASED
  o->w[0].given = -w;
#else
  o->w[0].given = w;
#endif
  o->w_is_new = 1u;
}
#else
void esokit_measured(esokit_state *o, const real w[W_COUNT])
{
  unsigned i;
  for (i = 0u; i < W_COUNT; ++i) {
#if ESOKIT_ERROR_BASED
    o->w[i].given = -w[i];
#else
    o->w[i].given = w[i];
#endif
  }
  o->w_is_new = 1u;
}
#endif

#endif
#ifdef __cplusplus
")esokit"
#endif
