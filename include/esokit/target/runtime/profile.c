#ifdef __cplusplus
R"esokit("
#endif
/* From 0 to 1 while x does; of the second half by symmetry. */
static void smooth_step(real x, real all[COUNT])
{
  static const real polynomials[COUNT][TERMS] = { /* s, s', .. */
    DESIGN_POLYNOMIALS
  };
  const real inside = (x > 0.0) ? ((x < 1.0) ? x : 1.0) : 0.0;
  const bool second = inside > 0.5;
  real at = inside;
  unsigned i;
  if (second) {
    at = 1.0 - inside;
  }
  for (i = 0u; i < COUNT; ++i) {
    real sum = 0.0;
    unsigned k;
    for (k = TERMS; k > 0u; --k) {
      sum = (sum * at) + polynomials[i][k - 1u];
    }
    if (second && ((i % 2u) == 0u)) {
      sum = -sum;
    }
    all[i] = sum;
  }
  if (second) {
    all[0] = 1.0 + all[0];
  }
}

#if ESOKIT_LIMITED_1 || ESOKIT_LIMITED_2 || ESOKIT_LIMITED_3 || ESOKIT_LIMITED_4
static real longer(real time, real least)
{
  return (time >= least) ? time : least;
}

#endif
/* Of a move from where the last one ends. */
static real duration(const esokit_state *o, real target)
{
  const real way = fabs(target - o->target);
  real time = SHORTEST_TIME;
  if (!(way > 0.0)) {
    return 0.0;
  }
#if ESOKIT_LIMITED_1
  time = longer(time, (way / ROOT_OF_LIMIT_1) * ROOT_OF_PEAK_1);
#endif
#if ESOKIT_LIMITED_2
  time = longer(time, (sqrt(way) / ROOT_OF_LIMIT_2) * ROOT_OF_PEAK_2);
#endif
#if ESOKIT_LIMITED_3
  time = longer(time, (cbrt(way) / ROOT_OF_LIMIT_3) * ROOT_OF_PEAK_3);
#endif
#if ESOKIT_LIMITED_4
  time = longer(time, (sqrt(sqrt(way)) / ROOT_OF_LIMIT_4) * ROOT_OF_PEAK_4);
#endif
  return time;
}

static bool plan(esokit_state *o, real target)
{
  const real samples = (duration(o, target) / SAMPLE_TIME) * LONGER;
  const bool stays = !(samples > 0.0) && !(target < o->target) && !(target > o->target);
  if (!is_finite(samples) || !(samples < MOST_SAMPLES)) {
    return false;
  }
  o->start = o->target;
  o->target = target;
  o->sample = 0;
  o->samples = stays ? 0 : (int32_t)ceil(samples);
  if (!stays && (o->samples == 0)) {
    o->samples = 1;
  }
  return true;
}

bool esokit_reset(esokit_state *o, real value)
{
  const bool good = is_finite(value);
  if (good) {
    o->start = value;
    o->target = value;
    o->sample = 0;
    o->samples = 0;
  }
  return good;
}

bool esokit_moves(const esokit_state *o)
{
  return o->sample < o->samples;
}

bool esokit_update(esokit_state *o, real target)
{
  bool good = is_finite(target);
  if (good && !esokit_moves(o)) {
    good = plan(o, target);
  }
  if (o->sample < o->samples) {
    o->sample = o->sample + 1;
  }
  return good;
}

void esokit_motion(const esokit_state *o, real motion[COUNT])
{
  const real way = o->target - o->start;
  const real count = (real)o->samples;
  real step[COUNT];
  real scale = way;
  unsigned i;
  motion[0] = o->target;
  for (i = 1u; i < COUNT; ++i) {
    motion[i] = 0.0;
  }
  if (!esokit_moves(o)) {
    return;
  }
  const real x = (real)o->sample / count;
  smooth_step(1.0 - x, step);
  motion[0] = o->target - (way * step[0]); /* from the nearer end: exact there */
  if (!(x > 0.5)) {
    smooth_step(x, step);
    motion[0] = o->start + (way * step[0]);
  }
  smooth_step(x, step);
  for (i = 1u; i < COUNT; ++i) {
    scale = scale / (count * SAMPLE_TIME);
    motion[i] = scale * step[i];
  }
}

#ifdef ESOKIT_SELF_TEST
int esokit_self_test(real tolerance)
{
  static const real samples[SAMPLES][COLUMNS] = { /* target, 1: infinite, 2: reset, motion */
    DESIGN_VECTORS
  };
  esokit_state o;
  unsigned i;
  unsigned k;
  (void)esokit_reset(&o, 0.0);
  for (i = 0u; i < SAMPLES; ++i) {
    const unsigned call = (unsigned)samples[i][1];
    real target = samples[i][0];
    real motion[COUNT];
    if ((call % 2u) != 0u) {
      target = target * LARGEST;
    }
    if (call < 2u) {
      (void)esokit_update(&o, target);
    } else {
      (void)esokit_reset(&o, target);
    }
    esokit_motion(&o, motion);
    for (k = 0u; k < COUNT; ++k) {
      if (!(fabs(motion[k] - samples[i][k + 2u]) <= tolerance)) {
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
