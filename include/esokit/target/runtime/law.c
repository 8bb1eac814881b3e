#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_SCHEDULE
/* ---- The schedule of the gain. */

#define AGE_MOST 1073741823u
#define ANCHOR_EVERY 256u /* samples */

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
  anchor_begin(o);
  while (rest != 0u) {
    if ((rest & 1u) != 0u) {
      anchor_take(o, power, contraction);
    }
    contraction = anchor_contraction(o, power, contraction);
    power = anchor_power(o, power, contraction);
    rest = rest / 2u;
  }
  anchor_end(o, (real)count);
}

static void law_advance(esokit_state *o)
{
  if (o->settled != 0u) {
    return;
  }
  if ((o->pending != 0u) && ((LAW_START + o->age) <= STATES)) {
    schedule_restart(o);
    law_begin(o);
  }
  o->pending = 1u;
  if (o->age < AGE_MOST) {
    o->age = o->age + 1u;
  }
  if ((LAW_START + o->age) <= STATES) {
    return; /* the estimate is exact in so few samples: it stays so */
  }
  if ((o->age % ANCHOR_EVERY) == 0u) {
    schedule_anchor(o, (LAW_START + o->age) - 1u);
  }
  schedule_next(o);
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
    base = present_poles(o);
  } else {
    /* All at zero. */
  }
  while (rest != 0u) {
    if ((rest & 1u) != 0u) {
      all = joined_poles(o, all, base);
    }
    base = joined_poles(o, base, base);
    rest = rest / 2u;
  }
  return all;
}

#endif
#if ESOKIT_FILTER
/* ---- The recursion of the gain: what was since the last step. */

#define SINCE_CORRECTED 1u
#if ESOKIT_RETURNS
#define SINCE_BEGUN 10u /* the gain stands, and nothing was */
#endif
#define SINCE_MISSED 4u /* twice in a row, or more */
#define SINCE_STANDS 8u /* the gain, until a sample is missing */

static void law_begin(esokit_state *o)
{
#if ESOKIT_RETURNS
  o->since = SINCE_BEGUN;
#else
  o->since = 0u;
#endif
}

static void law_accept(esokit_state *o)
{
  o->since = (uint8_t)(o->since | SINCE_CORRECTED);
}

static void law_advance(esokit_state *o)
{
  const uint8_t before = o->since;
  if (before > SINCE_STANDS) {
    o->since = SINCE_STANDS;
    return;
  }
  if ((before & SINCE_CORRECTED) != 0u) {
    o->since = 0u;
    filter_corrected(o);
  } else {
    bool stands = before == SINCE_MISSED;
    o->since = SINCE_MISSED;
    if (stands) {
      stands = filter_at_ceiling(o);
    }
    if (!stands) {
      filter_missed(o);
    }
  }
#if ESOKIT_RETURNS
  if (filter_to_limit(o)) {
    o->since = SINCE_STANDS;
  }
#endif
}

#endif
#ifdef __cplusplus
")esokit"
#endif
