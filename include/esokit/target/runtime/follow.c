#ifdef __cplusplus
R"esokit("
#endif
static real within(real x, real limit)
{
  real inside = x;
  if (x > limit) {
    inside = limit;
  }
  if (x < -limit) {
    inside = -limit;
  }
  return inside;
}

/* Whether all that follows from a place and a speed is finite. */
static bool fits(real place, real speed)
{
  real way = fabs(place) + (fabs(speed) * WIDTH);
#if ESOKIT_SECOND
  way = way + ((speed / HIGHEST) * speed);
#endif
  return is_finite(64.0 * way);
}

/* Takes a target, its motion within the limits; false, and nothing changes, if it cannot. */
static bool aim(esokit_state *o, const real target[COUNT])
{
  const real place = target[0];
  const real last = target[ORDER];
  real speed = target[1];
  const bool good = is_finite(speed) && is_finite(last);
#if ESOKIT_LIMITED
  speed = within(speed, FASTEST);
#endif
  if (!(good && fits(place, speed))) {
    return false;
  }
  o->target.whole = place;
  o->target.rest = 0.0;
  o->target_speed = speed;
#if ESOKIT_SECOND
  o->thrust = within(last, HIGHEST);
#endif
  return true;
}

/* The last target, a sample later, as long as it is not too far. */
static void aim_on(esokit_state *o)
{
  esokit_sum next = o->target;
  add(&next, SAMPLE_TIME * o->target_speed);
  if (fits(next.whole + next.rest, o->target_speed)) {
    o->target = next;
  }
#if ESOKIT_SECOND
  o->thrust = 0.0;
#endif
}

/* By how much the reference is beyond the target. */
static real beyond_target(const esokit_state *o)
{
  return (o->place.whole - o->target.whole) + (o->place.rest - o->target.rest);
}

/* To the next sample, with the highest derivative held. */
static void go(esokit_state *o, real highest)
{
#if ESOKIT_SECOND
  const real speed = o->speed.whole + o->speed.rest;
  o->motion[1] = speed;
#endif
  o->motion[0] = o->place.whole + o->place.rest;
  o->motion[ORDER] = highest;
#if ESOKIT_SECOND
  add(&o->place, SAMPLE_TIME * (speed + (HALF_A_SAMPLE * highest)));
  add(&o->speed, SAMPLE_TIME * highest);
#if ESOKIT_LIMITED
  const real beyond = fabs(o->speed.whole + o->speed.rest) - FASTEST;
  if ((beyond > 0.0) && (beyond < ROUNDING)) { /* what rounding adds to the limit */
    o->speed.whole = within(o->speed.whole + o->speed.rest, FASTEST);
    o->speed.rest = 0.0;
  }
#endif
#else
  add(&o->place, SAMPLE_TIME * highest);
#endif
}

#if ESOKIT_SECOND
#if ESOKIT_LIMITED
/* An acceleration after which the speed is within its limit, or nearer. */
static real not_too_fast(real chosen, real speed)
{
  const real up = within((FASTEST - speed) / SAMPLE_TIME, HIGHEST);
  const real down = within((-FASTEST - speed) / SAMPLE_TIME, HIGHEST);
  real inside = chosen;
  if (chosen > up) {
    inside = up;
  }
  if (chosen < down) {
    inside = down;
  }
  return inside;
}

#endif
/* The second derivative for the next sample. */
static real acceleration(const esokit_state *o)
{
  const real speed = o->speed.whole + o->speed.rest;
  const real faster = speed - o->target_speed;
  const real place = (beyond_target(o) - (HALF_A_SAMPLE * faster)) + (WIDTH * faster);
  const real of_target = o->thrust / HIGHEST;
  real share = 1.0 + of_target; /* what a target that accelerates leaves to brake with */
  if (place > 0.0) {
    share = 1.0 - of_target;
  }
  if (!(share > 0.0625)) {
    share = 0.0625;
  }
  const real unit = share * UNIT;
  real way = fabs(place) / unit;
  if (!(way < LONGEST)) {
    way = LONGEST;
  }
  const real root = (1.0 + sqrt(1.0 + (8.0 * way))) / 2.0;
  real samples = ceil(root);
  if (samples > root) { /* down */
    samples = samples - 1.0;
  }
  real curve = (way / samples) + ((samples - 1.0) / 2.0);
  if (place < 0.0) {
    curve = -curve;
  }
  const real chosen = o->thrust - (HIGHEST * (share * (((WIDTH * faster) / unit) + curve)));
#if ESOKIT_LIMITED
  return not_too_fast(within(chosen, HIGHEST), speed);
#else
  return within(chosen, HIGHEST);
#endif
}

#endif
bool esokit_start(esokit_state *o, real y, real speed)
{
  if (!fits(y, speed)) {
    return false;
  }
  o->motion[0] = y;
  o->motion[ORDER] = 0.0;
  o->place.whole = y;
  o->place.rest = 0.0;
#if ESOKIT_SECOND
  o->motion[1] = speed;
  o->speed.whole = speed;
  o->speed.rest = 0.0;
  o->thrust = 0.0;
#endif
  o->target = o->place;
  o->target_speed = 0.0;
  return true;
}

bool esokit_update(esokit_state *o, const real target[COUNT])
{
  const bool good = aim(o, target);
  if (!good) {
    aim_on(o);
  }
#if ESOKIT_SECOND
  go(o, acceleration(o));
#else
  go(o, within(o->target_speed - (beyond_target(o) / WIDTH), FASTEST));
#endif
  return good;
}

void esokit_wait(esokit_state *o)
{
#if ESOKIT_SECOND
  go(o, within(-(o->speed.whole + o->speed.rest) / SAMPLE_TIME, HIGHEST));
#else
  go(o, 0.0);
#endif
}

void esokit_motion(const esokit_state *o, real motion[COUNT])
{
  unsigned i;
  for (i = 0u; i < COUNT; ++i) {
    motion[i] = o->motion[i];
  }
}

#ifdef ESOKIT_SELF_TEST
int esokit_self_test(real tolerance)
{
  static const real samples[SAMPLES][COLUMNS] = {
    /* 0: target, 2: start, 1, 3: infinite ones, 4: waits; its numbers, motion */
    DESIGN_VECTORS
  };
  esokit_state o;
  unsigned i;
  unsigned k;
  (void)esokit_start(&o, 0.0, 0.0);
  for (i = 0u; i < SAMPLES; ++i) {
    const unsigned call = (unsigned)samples[i][0];
    real target[COUNT];
    real motion[COUNT];
    for (k = 0u; k < COUNT; ++k) {
      target[k] = samples[i][k + 1u];
      if ((call % 2u) != 0u) {
        target[k] = target[k] * LARGEST;
      }
    }
    if (call < 2u) {
      (void)esokit_update(&o, target);
    } else if (call < 4u) {
      (void)esokit_start(&o, target[0], target[1]);
    } else {
      esokit_wait(&o);
    }
    esokit_motion(&o, motion);
    for (k = 0u; k < COUNT; ++k) {
      if (!(fabs(motion[k] - samples[i][k + COUNT + 1u]) <= tolerance)) {
        return (int)i + 1;
      }
    }
  }
  return 0;
}
#endif
#ifdef __cplusplus
")esokit"
#endif
