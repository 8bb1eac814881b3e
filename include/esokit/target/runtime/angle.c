#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_WRAPPED
#define DOUBTS_MOST 3u /* measurements that do not fit, after which the next is believed */
#define LONGER_MOST 8u /* gaps longer than that of the motion, after which it is not known */
#define MOTION_SHARE 0.125 /* of a step in the motion */
#if ESOKIT_GATED_ANGLE
#define STEADY_LEAST 8u /* measurements that fit, after which rejected ones count turns */
#define SEEN_MOST 255u
#endif

/* A measured angle. */
typedef struct {
  real y; /* within half a period of zero */
  real turns;
  real step; /* since the last one, by the nearest turn */
  uint32_t samples;
  bool usable;
  bool fits; /* it moved as before */
  bool counted;
#if ESOKIT_GATED_ANGLE
  uint32_t missed; /* samples since one was taken */
  bool seen; /* its turn is counted from rejected ones, too */
#endif
} angle_reading;

static real wrapped(real angle)
{
  return (fabs(angle) <= HALF_PERIOD) ? angle : (angle - (PERIOD * round(angle * PER_PERIOD)));
}

static bool can_be_told(real y)
{
  const real turns = y * PER_PERIOD;
  return is_finite(turns) && (fabs(turns) < MOST_TURNS);
}

static void forget_count(esokit_turns *o)
{
  o->angle = 0.0;
  o->turns = 0.0;
  o->motion = 0.0;
  o->motion_samples = COUNT_MOST;
  o->gaps = 0u;
  o->doubts = 0u;
  o->begun = 0u;
}

static void forget_turns(esokit_state *o)
{
  forget_count(&o->taken);
#if ESOKIT_GATED_ANGLE
  forget_count(&o->seen);
  o->seen_at = 0u;
  o->seen_steady = 0u;
  o->seen_rejected = 0u;
#endif
}

static bool restart(esokit_state *o, real y)
{
  bool good = can_be_told(y);
  if (good) {
    good = restart_plain(o, wrapped(y));
  }
  if (good) {
    forget_turns(o);
#if ESOKIT_GATED
    gate_set(o, true);
#endif
  }
  return good;
}

static unsigned restart_at_angle(esokit_state *o, real y)
{
  return restart(o, y) ? ESOKIT_RESTARTED : ESOKIT_MEASUREMENT_REJECTED;
}

static real expected_motion(const esokit_turns *o, uint32_t samples)
{
  real motion = o->motion;
  if ((o->motion_samples == COUNT_MOST) || (samples == 0u)) {
    motion = 0.0;
  } else if (samples != o->motion_samples) {
    motion = o->motion * ((real)samples / (real)o->motion_samples);
  } else {
    /* It is that of as many samples. */
  }
  return motion;
}

static angle_reading read_angle(const esokit_turns *o, real y, uint32_t samples)
{
  angle_reading reading;
  reading.y = 0.0;
  reading.turns = 0.0;
  reading.step = 0.0;
  reading.samples = 0u;
  reading.usable = false;
  reading.fits = true;
  reading.counted = false;
#if ESOKIT_GATED_ANGLE
  reading.missed = 0u;
  reading.seen = false;
#endif
  if (can_be_told(y)) {
    reading.usable = true;
    reading.y = wrapped(y);
    reading.samples = samples;
  }
  if (reading.usable && (o->begun != 0u)) {
    const real change = reading.y - o->angle;
    const real expected = expected_motion(o, samples);
    const real ahead = expected - change;
    const real crossed = (fabs(ahead) <= HALF_PERIOD) ? 0.0 : round(ahead * PER_PERIOD);
    const real motion = change + (crossed * PERIOD);
    reading.step = wrapped(change);
    if (o->motion_samples != COUNT_MOST) {
      reading.fits = (fabs(motion - expected) <= QUARTER_PERIOD) &&
        ((samples > o->motion_samples) || (fabs(motion) <= HALF_PERIOD));
    }
    reading.turns = o->turns + crossed;
    reading.counted =
      (reading.fits || (o->doubts >= DOUBTS_MOST)) && is_finite(reading.turns * PERIOD);
  }
  return reading;
}

/* Keeps the estimate within half a period of zero. */
static void recentre(esokit_state *o)
{
  const real z = estimate_0(o);
  if (!(fabs(z) <= HALF_PERIOD)) {
    const real turns = round(z * PER_PERIOD);
    if (shift(o, -(turns * PERIOD))) {
      o->taken.turns = o->taken.turns - turns;
#if ESOKIT_GATED_ANGLE
      o->seen.turns = o->seen.turns - turns;
#endif
    }
  }
}

static void learn_motion(esokit_turns *o, const angle_reading *reading)
{
  if ((o->begun != 0u) && (reading->samples != 0u)) {
    if (reading->samples > o->motion_samples) {
      o->gaps = (uint8_t)(o->gaps + 1u);
      if (o->gaps >= LONGER_MOST) {
        o->motion_samples = COUNT_MOST; /* after so many gaps it is not known */
      }
    } else {
      o->gaps = 0u;
      if ((reading->samples < o->motion_samples) || (o->doubts >= DOUBTS_MOST)) {
        o->motion = reading->step;
        o->motion_samples = (uint16_t)reading->samples;
      } else if (reading->fits) {
        o->motion = o->motion + ((reading->step - o->motion) * MOTION_SHARE);
      } else {
        /* It says nothing. */
      }
    }
  }
}

static void learn_turn(esokit_turns *o, const angle_reading *reading)
{
  learn_motion(o, reading);
  o->angle = reading->y;
  o->turns = reading->turns;
  if (reading->fits) {
    o->doubts = 0u;
  } else if (o->doubts < DOUBTS_MOST) {
    o->doubts = (uint8_t)(o->doubts + 1u);
  } else {
    /* There are enough. */
  }
  o->begun = 1u;
}

/* Where the gate rejects what moves steadily, the turn is that of all measurements. */
static angle_reading choose_angle(const esokit_state *o, real y, uint32_t missed)
{
  angle_reading reading = read_angle(&o->taken, y, missed);
#if ESOKIT_GATED_ANGLE
  reading.missed = missed;
  if ((o->seen_rejected > 0u) && (o->seen_steady >= STEADY_LEAST) &&
      (o->seen_steady >= o->seen_rejected)) {
    angle_reading seen = read_angle(&o->seen, y, missed - o->seen_at);
    if (seen.fits && seen.counted) {
      seen.missed = missed;
      seen.seen = true;
      reading = seen;
    }
  }
#endif
  return reading;
}

#if ESOKIT_GATED_ANGLE
static uint8_t one_more(uint8_t count)
{
  return (count < SEEN_MOST) ? (uint8_t)(count + 1u) : count;
}

static void hear_angle(esokit_state *o, const angle_reading *given)
{
  const angle_reading reading = read_angle(&o->seen, given->y, given->missed - o->seen_at);
  const bool steady = reading.fits && (o->seen.motion_samples != COUNT_MOST);
  o->seen_steady = steady ? one_more(o->seen_steady) : 0u;
  o->seen_rejected = one_more(o->seen_rejected);
  o->seen_at = (uint16_t)given->missed;
  learn_turn(&o->seen, &reading);
}

#endif
/* After the correction. */
static unsigned keep_angle(esokit_state *o, const angle_reading *reading, unsigned given)
{
  unsigned status = given;
  if ((status & ESOKIT_MEASUREMENT_REJECTED) != 0u) { /* the state is to blame */
    return restart_at_angle(o, reading->y) | (status & ESOKIT_INPUT_REJECTED);
  }
#if ESOKIT_GATED_ANGLE
  if ((status & ESOKIT_OUTLIER_REJECTED) != 0u) {
    hear_angle(o, reading);
    recentre(o);
    return status;
  }
#endif
  if (!reading->fits) {
    status = status | ESOKIT_TURN_ASSUMED;
  }
#if ESOKIT_GATED_ANGLE
  if (!reading->seen) {
    learn_turn(&o->taken, reading);
  }
  hear_angle(o, reading);
  if (reading->seen) {
    o->taken = o->seen;
  } else {
    o->seen.turns = o->taken.turns; /* counted from what was used */
  }
  o->seen_at = 0u;
  o->seen_rejected = 0u;
#else
  learn_turn(&o->taken, reading);
#endif
  recentre(o);
  return status;
}

#endif
#ifdef __cplusplus
")esokit"
#endif
