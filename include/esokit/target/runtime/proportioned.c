#ifdef __cplusplus
R"esokit("
#endif
/* The time on that a window may have, samples. */
static int32_t nearest(const esokit_state *o, real wanted)
{
  int32_t least = SHORTEST;
  int32_t samples = 0;
  if (o->on_samples == WINDOW) {
    least = 1;
  }
  if (!(wanted > 0.5)) {
    return samples;
  }
  if (!(wanted < (real)WINDOW)) {
    samples = WINDOW;
    return samples;
  }
  samples = (int32_t)ceil(wanted - 0.5);
  if (samples < least) {
    samples = least;
    if ((2.0 * wanted) < (real)least) {
      samples = 0;
    }
    return samples;
  }
  if (samples > LONGEST) {
    samples = WINDOW;
    if ((2.0 * wanted) < (real)BEYOND_LONGEST) {
      samples = LONGEST;
    }
  }
  return samples;
}

static void plan(esokit_state *o, real u)
{
  real inside = u;
  if (!is_finite(u)) {
    o->on_samples = 0;
    o->carried = 0.0;
    return;
  }
  if (inside < LOW) {
    inside = LOW;
  }
  if (inside > HIGH) {
    inside = HIGH;
  }
  const real wanted = ((real)WINDOW * ((inside - OFF_VALUE) / RANGE)) + o->carried;
  o->on_samples = nearest(o, wanted);
  o->carried = wanted - (real)o->on_samples;
}

void esokit_reset(esokit_state *o)
{
  o->carried = 0.0;
  o->sample = 0;
  o->on_samples = 0;
}

bool esokit_begins(const esokit_state *o)
{
  return o->sample == 0;
}

bool esokit_update(esokit_state *o, real u)
{
  if (o->sample == 0) {
    plan(o, u);
  }
  const bool is_on = o->sample < o->on_samples;
  if (o->sample < LAST_SAMPLE) {
    o->sample = o->sample + 1;
  } else {
    o->sample = 0;
  }
  return is_on;
}

real esokit_applied(const esokit_state *o)
{
  real mean = OFF_VALUE + (RANGE * ((real)o->on_samples / (real)WINDOW));
  if (o->on_samples == WINDOW) {
    mean = ON_VALUE;
  }
  return mean;
}

#ifdef ESOKIT_SELF_TEST
int esokit_self_test(real tolerance)
{
  static const real samples[SAMPLES][4] = { /* u, how often, how often on (-: then a window begins), applied */
    DESIGN_VECTORS
  };
  esokit_state o;
  int wrong = 0;
  int i;
  esokit_reset(&o);
  for (i = 0; (i < SAMPLES) && (wrong == 0); ++i) {
    const real u = (i == INFINITE) ? (samples[i][0] * LARGEST) : samples[i][0];
    real on = 0.0;
    uint32_t left = (uint32_t)samples[i][1];
    while (left > 0u) {
      if (esokit_update(&o, u)) {
        on = on + 1.0;
      }
      left = left - 1u;
    }
    if (esokit_begins(&o)) {
      on = -on;
    }
    const bool same = (fabs(on - samples[i][2]) <= 0.5) &&
      (fabs(esokit_applied(&o) - samples[i][3]) <= tolerance);
    wrong = same ? 0 : (i + 1);
  }
  return wrong;
}
#endif
#ifdef __cplusplus
")esokit"
#endif
