#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_SCHEDULE
/* ---- The schedule of the gain. */

static void law_begin(esokit_state *o)
{
  o->age = 0u;
  o->pending = 0u;
  o->settled = 0u;
}

static void law_accept(esokit_state *o)
{
  o->pending = 0u;
}

/* Of that sample, from its number: no error of rounding adds up. */
static void schedule_anchor(esokit_state *o, uint32_t count)
{
  real power = DECAY;
  real contraction = SHIFT;
  uint32_t rest = count;
  (void)anchor_begin(o);
  while (rest != 0u) {
    if ((rest & 1u) != 0u) {
      (void)anchor_take(o, power, contraction);
    }
    (void)anchor_contraction(o, power, contraction, &contraction);
    (void)anchor_power(o, power, contraction, &power);
    rest = rest / 2u;
  }
  (void)anchor_end(o, (real)count);
}

static void law_advance(esokit_state *o)
{
  if (o->settled != 0u) {
    return;
  }
  if ((o->pending != 0u) && ((LAW_START + o->age) <= STATES)) {
    (void)schedule_restart(o);
    law_begin(o);
  }
  o->pending = 1u;
  if (o->age < 1073741823u) {
    o->age = o->age + 1u;
  }
  if ((LAW_START + o->age) <= STATES) {
    return; /* the estimate is exact in so few samples: it stays so */
  }
  if ((o->age % 256u) == 0u) {
    schedule_anchor(o, (LAW_START + o->age) - 1u);
  }
  (void)schedule_next(o);
  if (o->age > LEAST_AGE) {
    if (schedule_settle(o)) {
      o->settled = 1u;
    }
  }
}

/* The poles of now over so many samples. */
static real poles_over(const esokit_state *o, uint32_t samples)
{
  real base = 1.0;
  real all = 0.0;
  uint32_t rest = samples;
  if (o->settled != 0u) {
    base = CONTRACTION;
  } else if ((LAW_START + o->age) > STATES) {
    (void)present_poles(o, &base);
  } else {
    /* All at zero. */
  }
  while (rest != 0u) {
    if ((rest & 1u) != 0u) {
      (void)joined_poles(o, all, base, &all);
    }
    (void)joined_poles(o, base, base, &base);
    rest = rest / 2u;
  }
  return all;
}

#endif
#if ESOKIT_FILTER
/* ---- The recursion of the gain. */

static void law_begin(esokit_state *o)
{
#if ESOKIT_RETURNS
  o->since = 10u;
#else
  o->since = 0u;
#endif
}

static void law_accept(esokit_state *o)
{
  o->since = (uint8_t)(o->since | 1u);
}

/* since: 1 corrected, 2 nothing yet, 4 missed twice, 8 the gain stands. */
static void law_advance(esokit_state *o)
{
  const uint8_t before = o->since;
  if (before > 8u) {
    o->since = 8u;
    return;
  }
  if ((before & 1u) != 0u) {
    o->since = 0u;
    (void)filter_corrected(o);
  } else {
    bool stands = before == 4u;
    o->since = 4u;
    if (stands) {
      stands = filter_at_ceiling(o);
    }
    if (!stands) {
      (void)filter_missed(o);
    }
  }
#if ESOKIT_RETURNS
  if (filter_to_limit(o)) {
    o->since = 8u;
  }
#endif
}

#endif
#ifdef __cplusplus
")esokit"
#endif
