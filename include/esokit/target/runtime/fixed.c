#ifdef __cplusplus
R"esokit("
#endif
/* Written by esokit from a finished design; do not edit. */
#include DESIGN_HEADER

/* Deviations from MISRA C:2012: negative numbers are shifted right (10.1), which the next line makes
 * sure goes towards minus infinity. Its type is not used (2.3, advisory). Functions leave early where
 * a sample is refused (15.5, advisory). A header has macros that its source may not need (2.5,
 * advisory). */
typedef char esokit_shifts_negative_numbers[(((-1) >> 1) == -1) ? 1 : -1];

/* The path of bad samples is a function of its own, so that the other needs fewer registers. */
#ifdef __GNUC__
#define ESOKIT_APART __attribute__((__noinline__))
#else
#define ESOKIT_APART
#endif

DESIGN_CONSTANTS
#if ESOKIT_SETTINGS
DESIGN_SET_OF_SETTINGS
#endif
DESIGN_LISTS
#if ESOKIT_SETTINGS
#define reach_of o->settings->reach
#define box_of o->settings->box
#define m_of o->settings->correct
#define powers_of o->settings->powers
#define lower_of o->settings->lower
#define upper_of o->settings->upper
#define rate_of o->settings->rate
#else
#define reach_of most
#define box_of most
#define m_of m
#define powers_of powers
#define lower_of LOWER
#define upper_of UPPER
#define rate_of RATE
#endif
/* ---- What counts and chooses. */

static int32_t within(int64_t x, int32_t most, unsigned *status)
{
  int32_t held = most;
  if (x > most) {
    *status |= ESOKIT_SATURATED;
  } else if (x < -(int64_t)most) {
    *status |= ESOKIT_SATURATED;
    held = -most;
  } else {
    held = (int32_t)x;
  }
  return held;
}

/* y or r for the observer: of a counter, from the last y on. */
static int32_t counts(const esokit_state *o, y_count given)
{
#if ESOKIT_COUNTER
  const uint32_t bits = (((uint32_t)given - o->y_last) & COUNTER_MASK) ^ COUNTER_HALF_U;
  return (int32_t)bits - COUNTER_HALF;
#else
  (void)o;
  return given;
#endif
}

/* x = M x + m by; each number of M has its own power of two. */
static unsigned moved(esokit_state *o, const int32_t m[STATES][COLUMNS], const uint8_t powers[STATES][COLUMNS],
                      int32_t by, const int32_t most[STATES])
{
  int64_t to[STATES];
  unsigned status = 0u;
  unsigned i;
  unsigned j;
  for (i = 0u; i < STATES; ++i) {
    to[i] = ((int64_t)m[i][STATES] * by) >> powers[i][STATES];
    for (j = 0u; j < STATES; ++j) {
      to[i] += ((int64_t)m[i][j] * o->x[j]) >> powers[i][j];
    }
  }
  for (i = 0u; i < STATES; ++i) {
    o->x[i] = within(to[i], most[i], &status);
  }
  DESIGN_FORGET
  return status;
}

/* Begins anew, at rest at y under u. */
static unsigned rest_at(esokit_state *o, int32_t y, int32_t u)
{
  unsigned status = 0u;
  DESIGN_REST_AT
  DESIGN_FORGET
  o->gap = 0u;
  (void)u;
  (void)y;
  return status;
}

static unsigned predict_slowly(esokit_state *o, int32_t given)
{
  static const int32_t m[STATES][COLUMNS] = {
    DESIGN_PREDICT_M
  };
  static const uint8_t powers[STATES][COLUMNS] = {
    DESIGN_PREDICT_P
  };
#if !ESOKIT_SETTINGS
  static const int32_t most[STATES] = {DESIGN_REACH};
#endif
  unsigned status = 0u;
  int32_t u = given;
  if (u > U_MOST) {
    u = U_MOST;
    status = ESOKIT_INPUT_REJECTED;
  } else if (u < -U_MOST) {
    u = -U_MOST;
    status = ESOKIT_INPUT_REJECTED;
  } else {
    /* u is good. */
  }
  if (o->gap != GAP_MOST) { /* beyond which nothing depends on it */
    o->gap = (uint16_t)(o->gap + 1u);
  }
  return status | moved(o, m, powers, u, reach_of);
}

static unsigned correct_slowly(esokit_state *o, y_count given, int32_t u)
{
#if !ESOKIT_SETTINGS
  static const int32_t m[ROWS][STATES][COLUMNS] = { /* after 1, 2, .. samples */
    DESIGN_CORRECT_M
  };
  static const uint8_t powers[ROWS][STATES][COLUMNS] = {
    DESIGN_CORRECT_P
  };
  static const int32_t most[STATES] = {DESIGN_BOX};
#endif
  unsigned status = ESOKIT_MEASUREMENT_REJECTED;
  unsigned elapsed = o->gap;
  const int32_t y = counts(o, given);
  if (elapsed == 0u) {
    elapsed = 1u;
  }
  if (elapsed > ROWS) {
#if ESOKIT_COUNTER
    status = rest_at(o, 0, u) | ESOKIT_RESTARTED;
    o->y_last = given;
  } else if (((uint32_t)y + ((uint32_t)elapsed * Y_MOST_U)) <= ((uint32_t)elapsed * Y_TWICE)) {
#else
    if (((uint32_t)y + Y_MOST_U) <= Y_TWICE) {
      status = rest_at(o, y, u) | ESOKIT_RESTARTED;
    }
  } else if (((uint32_t)y + Y_MOST_U) <= Y_TWICE) {
#endif
    status = moved(o, m_of[elapsed - 1u], powers_of[elapsed - 1u], y, box_of);
#if ESOKIT_COUNTER
    o->y_last = given;
#endif
    if (elapsed > 1u) {
      status |= ESOKIT_GAP_BRIDGED;
    }
    o->gap = 0u;
  } else {
    /* y is refused. */
  }
  return status;
}

ESOKIT_APART static unsigned guarded(esokit_state *o, y_count y, int32_t u)
{
  const unsigned status = predict_slowly(o, u);
  return status | correct_slowly(o, y, u);
}

int32_t esokit_estimate(const esokit_state *o, unsigned row)
{
  int32_t value = 0;
  switch (row) {
  DESIGN_ESTIMATES
  default:
    break;
  }
  return value;
}

void esokit_init(esokit_state *o)
{
#if ESOKIT_SETTINGS
  o->settings = &esokit_DESIGN_SET;
#endif
#if ESOKIT_COUNTER
  o->y_last = 0u;
#endif
  (void)rest_at(o, 0, 0);
#if ESOKIT_CONTROLLER
  o->u_last = START_FINE;
  o->u_held = START_HELD;
  o->hold_left = HOLD_SAMPLES;
  o->mode = FIRST_MODE;
  o->status = 0u;
#endif
}

#if ESOKIT_CONTROLLER
/* The output for the u that is wanted, both in 2^-LAW_SCALE counts, to whole counts. What is left
 * over stays in u_last: a limit of rate may be below one count a sample. */
static int32_t limited(esokit_state *o, int32_t wanted)
{
  int32_t u = wanted;
#if ESOKIT_RATED
  if (u > (o->u_last + rate_of)) {
    u = o->u_last + rate_of;
  }
  if (u < (o->u_last - rate_of)) {
    u = o->u_last - rate_of;
  }
#endif
  if (u < lower_of) {
    u = lower_of;
  }
  if (u > upper_of) {
    u = upper_of;
  }
  o->u_last = u;
  u = (u + HALF) >> LAW_SCALE;
  o->u_held = u;
  return u;
}

static void judge_missing(esokit_state *o)
{
  if (o->gap >= MISSING_LIMIT) {
    o->mode = ESOKIT_SAFE;
  }
#if !ESOKIT_STAYS_SAFE
  if ((o->mode == ESOKIT_SAFE) && (o->gap == 0u)) {
    o->mode = ESOKIT_RUNNING;
  }
#endif
}

/* The output while the law does not run. */
ESOKIT_APART static int32_t put_out_held(esokit_state *o)
{
#if ESOKIT_SAFE_INPUT
  int32_t u = SAFE_INPUT;
#else
  int32_t u = o->u_last;
#endif
  if (o->mode == ESOKIT_START_HOLD) {
    o->hold_left = o->hold_left - 1u;
    if (o->hold_left == 0u) {
      o->mode = ESOKIT_RUNNING;
    }
    u = HOLD_INPUT;
  }
  return limited(o, u);
}

static int32_t put_out(esokit_state *o, y_count reference)
{
#if ESOKIT_COUNTER
  const int32_t r = counts(o, reference);
#else
  int32_t r = counts(o, reference);
  if (r > Y_MOST) {
    r = Y_MOST;
    o->status = (uint8_t)(o->status | ESOKIT_REFERENCE_REJECTED);
  }
  if (r < -Y_MOST) {
    r = -Y_MOST;
    o->status = (uint8_t)(o->status | ESOKIT_REFERENCE_REJECTED);
  }
#endif
  if (o->mode != ESOKIT_RUNNING) {
    return put_out_held(o);
  }
  return limited(o, law(o, r));
}

/* The whole step where a sample is missing or bad. */
ESOKIT_APART static int32_t update_guarded(esokit_state *o, y_count y, y_count r)
{
  o->status = (uint8_t)guarded(o, y, o->u_held);
  judge_missing(o);
  return put_out(o, r);
}

unsigned esokit_start(esokit_state *o, y_count given, int32_t u)
{
#if !ESOKIT_COUNTER
  if (((uint32_t)given + Y_MOST_U) > Y_TWICE) {
    return ESOKIT_MEASUREMENT_REJECTED;
  }
#endif
  if (((uint32_t)u + U_MOST_U) > U_TWICE) {
    return ESOKIT_INPUT_REJECTED;
  }
#if ESOKIT_COUNTER
  const unsigned status = rest_at(o, 0, u);
#else
  const unsigned status = rest_at(o, given, u);
#endif
#if ESOKIT_COUNTER
  o->y_last = given;
#endif
  o->u_held = u;
  o->u_last = u * ONE;
  o->mode = ESOKIT_RUNNING;
  return status;
}

int32_t esokit_update(esokit_state *o, y_count given, y_count r)
{
  const int32_t y = counts(o, given);
  if ((o->gap != 0u) || (((uint32_t)y + Y_MOST_U) > Y_TWICE)) {
    return update_guarded(o, given, r);
  }
  observe(o, y, o->u_held);
#if ESOKIT_COUNTER
  o->y_last = given;
#endif
  o->status = 0u;
#if !ESOKIT_STAYS_SAFE
  if ((o->mode == ESOKIT_SAFE) && (o->gap == 0u)) {
    o->mode = ESOKIT_RUNNING;
  }
#endif
  return put_out(o, r);
}

unsigned esokit_applied(esokit_state *o, int32_t u)
{
  unsigned status = 0u;
  o->u_held = u;
  if (u > U_MOST) {
    o->u_held = U_MOST;
    status = ESOKIT_INPUT_REJECTED;
  }
  if (u < -U_MOST) {
    o->u_held = -U_MOST;
    status = ESOKIT_INPUT_REJECTED;
  }
  return status;
}

int32_t esokit_update_without_measurement(esokit_state *o, y_count r)
{
  o->status = (uint8_t)predict_slowly(o, o->u_held);
  judge_missing(o);
  return put_out(o, r);
}

#else
unsigned esokit_reset(esokit_state *o, y_count given)
{
#if ESOKIT_COUNTER
  o->y_last = given;
  return rest_at(o, 0, 0);
#else
  unsigned status = ESOKIT_MEASUREMENT_REJECTED;
  if (((uint32_t)given + Y_MOST_U) <= Y_TWICE) {
    status = rest_at(o, given, 0);
  }
  return status;
#endif
}

unsigned esokit_predict(esokit_state *o, int32_t u)
{
  return predict_slowly(o, u);
}

unsigned esokit_update(esokit_state *o, y_count given, int32_t u)
{
  const int32_t y = counts(o, given);
  if ((o->gap != 0u) || (((uint32_t)y + Y_MOST_U) > Y_TWICE) || (((uint32_t)u + U_MOST_U) > U_TWICE)) {
    return guarded(o, given, u);
  }
  observe(o, y, u);
#if ESOKIT_COUNTER
  o->y_last = given;
#endif
  return 0u;
}

#endif
#if ESOKIT_SETTINGS
unsigned esokit_adopt(esokit_state *o, const esokit_settings *settings)
{
  unsigned status = ESOKIT_SETTINGS_REJECTED;
  unsigned i;
  if (settings->design == DESIGN_MARK) {
    const int32_t *const most = (o->gap > 0u) ? settings->reach : settings->box;
    status = 0u;
    o->settings = settings;
    for (i = 0u; i < STATES; ++i) {
      o->x[i] = within(o->x[i], most[i], &status);
    }
  }
  return status;
}

#endif
#ifdef ESOKIT_SELF_TEST
#define FAR_Y ((y_count)Y_BEYOND)

/* What differs in two statuses, but whether a state was held. */
static unsigned differs(unsigned status, unsigned expected)
{
  return (status ^ expected) & (ESOKIT_MEASUREMENT_REJECTED | ESOKIT_INPUT_REJECTED |
    ESOKIT_GAP_BRIDGED | ESOKIT_RESTARTED | ESOKIT_REFERENCE_REJECTED);
}

/* Zero, if counts outside their ranges, gaps and what leads out of them are taken as such. */
static unsigned wrong_at_edges(esokit_state *o)
{
  const unsigned bridged = (ROWS > 1u) ? ESOKIT_GAP_BRIDGED : ESOKIT_RESTARTED;
  const unsigned longest = (ROWS > 1u) ? ESOKIT_GAP_BRIDGED : 0u;
  unsigned high = 0u;
  unsigned low = 0u;
  const int32_t most = within((int64_t)U_MOST + 1, U_MOST, &high);
  const int32_t sum = most + within(-(int64_t)U_MOST - 1, U_MOST, &low);
  unsigned wrong = ((unsigned)most ^ U_MOST_U) | (unsigned)sum;
  unsigned i;
  wrong |= (high ^ ESOKIT_SATURATED) | (low ^ ESOKIT_SATURATED);
#if ESOKIT_SETTINGS
  wrong |= esokit_adopt(o, o->settings);
#endif
#if ESOKIT_CONTROLLER
#if !ESOKIT_COUNTER
  wrong |= differs(esokit_start(o, FAR_Y, 0), ESOKIT_MEASUREMENT_REJECTED);
#endif
  wrong |= differs(esokit_start(o, 0, U_MOST + 1), ESOKIT_INPUT_REJECTED);
  wrong |= differs(esokit_start(o, 0, -U_MOST - 1), ESOKIT_INPUT_REJECTED);
  wrong |= esokit_start(o, 0, 0);
#else
#if !ESOKIT_COUNTER
  wrong |= differs(esokit_reset(o, FAR_Y), ESOKIT_MEASUREMENT_REJECTED);
#endif
  wrong |= esokit_reset(o, 0);
#endif
  for (i = 0u; i <= STATES; ++i) {
    wrong |= (unsigned)esokit_estimate(o, i);
  }
#if ESOKIT_CONTROLLER
  wrong |= differs(esokit_applied(o, U_MOST + 1), ESOKIT_INPUT_REJECTED);
  wrong |= differs(esokit_applied(o, -U_MOST - 1), ESOKIT_INPUT_REJECTED);
  wrong |= esokit_applied(o, 0);
  (void)esokit_update(o, FAR_Y, 0);
  wrong |= differs(o->status, ESOKIT_MEASUREMENT_REJECTED);
  (void)esokit_update(o, 0, 0);
  wrong |= differs(o->status, bridged);
#if !ESOKIT_COUNTER
  (void)esokit_update(o, 0, -FAR_Y);
  wrong |= differs(o->status, ESOKIT_REFERENCE_REJECTED);
  (void)esokit_update(o, 0, FAR_Y);
  wrong |= differs(o->status, ESOKIT_REFERENCE_REJECTED);
#endif
  for (i = 1u; i < ROWS; ++i) {
    (void)esokit_update_without_measurement(o, 0);
  }
  (void)esokit_update(o, 0, 0);
  wrong |= differs(o->status, longest);
  for (i = 0u; i < ROWS; ++i) {
    (void)esokit_update_without_measurement(o, 0);
  }
  (void)esokit_update(o, 0, 0);
  wrong |= differs(o->status, ESOKIT_RESTARTED);
  for (i = 0u; i <= GAP_MOST; ++i) {
    (void)esokit_update_without_measurement(o, 0);
  }
  wrong |= (unsigned)o->mode ^ ((GAP_MOST >= MISSING_LIMIT) ? ESOKIT_SAFE : ESOKIT_RUNNING);
#if !ESOKIT_COUNTER
  (void)esokit_update(o, FAR_Y, 0);
  wrong |= differs(o->status, ESOKIT_MEASUREMENT_REJECTED);
#endif
  (void)esokit_update(o, 0, 0);
  wrong |= differs(o->status, ESOKIT_RESTARTED);
#if !ESOKIT_STAYS_SAFE
  wrong |= (unsigned)o->mode ^ ESOKIT_RUNNING;
#endif
#else
  wrong |= differs(esokit_update(o, FAR_Y, 0), ESOKIT_MEASUREMENT_REJECTED);
  wrong |= differs(esokit_update(o, 0, 0), bridged);
  wrong |= differs(esokit_update(o, 0, U_MOST + 1), ESOKIT_INPUT_REJECTED);
  wrong |= differs(esokit_predict(o, -U_MOST - 1), ESOKIT_INPUT_REJECTED);
  wrong |= differs(esokit_update(o, 0, 0), bridged);
  for (i = 1u; i < ROWS; ++i) {
    (void)esokit_predict(o, 0);
  }
  wrong |= differs(esokit_update(o, 0, 0), longest);
  for (i = 0u; i <= GAP_MOST; ++i) {
    (void)esokit_predict(o, 0);
  }
#if !ESOKIT_COUNTER
  wrong |= differs(esokit_update(o, FAR_Y, 0), ESOKIT_MEASUREMENT_REJECTED);
#endif
  wrong |= differs(esokit_update(o, 0, 0), ESOKIT_RESTARTED);
#endif
  return wrong;
}

int esokit_self_test(void)
{
  static const int32_t samples[SAMPLES][3] = { /* DESIGN_COLUMNS */
    DESIGN_VECTORS
  };
  esokit_state o;
  int i;
  esokit_init(&o);
  for (i = 0; i < SAMPLES; ++i) {
#if ESOKIT_CONTROLLER
    const int32_t result = esokit_update(&o, (y_count)samples[i][0], (y_count)samples[i][1]);
#else
    int32_t result = samples[i][2] - 1;
    if (esokit_update(&o, (y_count)samples[i][0], samples[i][1]) == 0u) {
      result = o.x[STATES - 1u];
    }
#endif
    if (result != samples[i][2]) {
      return i + 1;
    }
  }
  return (wrong_at_edges(&o) == 0u) ? 0 : (SAMPLES + 1);
}
#endif
#ifdef __cplusplus
")esokit"
#endif
