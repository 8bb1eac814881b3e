#ifdef __cplusplus
R"esokit("
#endif
/* Whether all that follows from a place is finite. */
static bool fits(real place)
{
  const real most = 8.0 * place;
  const real speed = most / SAMPLE_TIME;
#if ESOKIT_LAGS
  if (!is_finite(speed / LAG)) {
    return false;
  }
#endif
  return is_finite(speed / INPUT_GAIN) && is_finite((POLE * most) / INPUT_GAIN);
}

/* A change within what the limits of u leave at this place, in a sample. */
static real within(const esokit_state *o, real change, real place)
{
  const real held = o->held + ((POLE * (place - o->begin)) / INPUT_GAIN);
#if ESOKIT_NEGATIVE
  real up = (INPUT_GAIN * (LOWER - held)) * MOST;
  real down = (INPUT_GAIN * (UPPER - held)) * MOST;
#else
  real up = (INPUT_GAIN * (UPPER - held)) * MOST;
  real down = (INPUT_GAIN * (LOWER - held)) * MOST;
#endif
  real inside = change;
  if (!(up > LEAST)) {
    up = LEAST;
  }
  if (!(down < -LEAST)) {
    down = -LEAST;
  }
  up = up * SAMPLE_TIME;
  down = down * SAMPLE_TIME;
  if (change > up) {
    inside = up;
  }
  if (change < down) {
    inside = down;
  }
  return inside;
}

/* The motion of the dead time ago. */
static void delay(esokit_state *o, const real now[COUNT])
{
  unsigned i;
#if ESOKIT_DELAYED
  for (i = 0u; i < COUNT; ++i) {
    o->motion[i] = o->past[o->oldest + i];
    o->past[o->oldest + i] = now[i];
  }
  o->oldest = o->oldest + COUNT;
  if (o->oldest >= PLACES) {
    o->oldest = 0u;
  }
#else
  for (i = 0u; i < COUNT; ++i) {
    o->motion[i] = now[i];
  }
#endif
}

bool esokit_start(esokit_state *o, real y, real u)
{
  unsigned i;
  if (!(fits(y) && is_finite(INPUT_GAIN * (4.0 * u)))) {
    return false;
  }
  o->target = y;
  o->place.whole = y;
  o->place.rest = 0.0;
#if ESOKIT_LAGS
  o->behind = 0.0;
#endif
  o->begin = y;
  o->held = u;
  o->feed = 0.0;
  for (i = 0u; i < COUNT; ++i) {
    o->motion[i] = 0.0;
  }
  o->motion[0] = y;
#if ESOKIT_DELAYED
  for (i = 0u; i < PLACES; ++i) {
    o->past[i] = 0.0;
  }
  for (i = 0u; i < DELAY; ++i) {
    o->past[i * COUNT] = y;
  }
  o->oldest = 0u;
#endif
  return true;
}

bool esokit_update(esokit_state *o, real target)
{
  const bool good = fits(target);
  const real place = o->place.whole + o->place.rest;
  real now[COUNT];
  if (good) {
    o->target = target;
  }
  const real change = within(o, BY_BANDWIDTH * ((o->place.whole - o->target) + o->place.rest), place);
  const real speed = change / SAMPLE_TIME;
#if ESOKIT_LAGS
  now[0] = place - o->behind;
  now[1] = o->behind / LAG;
  now[2] = (speed - now[1]) / LAG;
  o->behind = (speed * LAG) + (DECAY * (o->behind - (speed * LAG)));
#else
  now[0] = place;
  now[1] = speed;
#endif
  add(&o->place, change);
  delay(o, now);
  /* u is held for a sample: it needs what the middle of it does. */
  const real carried = POLE * ((place - o->begin) + (change / 2.0));
#if ESOKIT_LAGS
  const real needed =
    (carried + (now[1] - o->motion[1])) + (LAG * (now[2] - o->motion[2]));
#else
  const real needed = carried + (now[1] - o->motion[1]);
#endif
  o->feed = needed / INPUT_GAIN;
  return good;
}

void esokit_motion(const esokit_state *o, real motion[COUNT])
{
  unsigned i;
  for (i = 0u; i < COUNT; ++i) {
    motion[i] = o->motion[i];
  }
}

real esokit_feed(const esokit_state *o)
{
  return o->feed;
}

#ifdef ESOKIT_SELF_TEST
#define CALL_UPDATES 0u
#define CALL_UPDATES_TO_INFINITY 1u
#define CALL_STARTS_AT_INFINITY 3u
#define CALL_STARTS_BY_INFINITY 4u
#define CALL_STARTS_HIGH 5u
#define CALL_STARTS_LOW 6u

static void called(esokit_state *o, unsigned call, real target)
{
  real infinite = LARGEST;
  real u = 0.0;
  infinite = 4.0 * infinite;
  if (call == CALL_STARTS_HIGH) {
    u = MOST_HELD;
  }
  if (call == CALL_STARTS_LOW) {
    u = LEAST_HELD;
  }
  if (call == CALL_STARTS_BY_INFINITY) {
    u = infinite;
  }
  if (call == CALL_UPDATES) {
    (void)esokit_update(o, target);
  } else if (call == CALL_UPDATES_TO_INFINITY) {
    (void)esokit_update(o, infinite);
  } else {
    (void)esokit_start(o, (call == CALL_STARTS_AT_INFINITY) ? infinite : target, u);
  }
}

int esokit_self_test(real tolerance)
{
  static const real samples[SAMPLES][COLUMNS] = { /* target, what is called, feed, motion */
    DESIGN_VECTORS
  };
  esokit_state o;
  int wrong = 0;
  int i;
  (void)esokit_start(&o, 0.0, 0.0);
  for (i = 0; (i < SAMPLES) && (wrong == 0); ++i) {
    real motion[COUNT];
    unsigned k;
    called(&o, (unsigned)samples[i][1], samples[i][0]);
    esokit_motion(&o, motion);
    bool same = fabs(esokit_feed(&o) - samples[i][2]) <= tolerance;
    for (k = 0u; k < COUNT; ++k) {
      same = same && (fabs(motion[k] - samples[i][k + 3u]) <= tolerance);
    }
    wrong = same ? 0 : (i + 1);
  }
  return wrong;
}
#endif
#ifdef __cplusplus
")esokit"
#endif
