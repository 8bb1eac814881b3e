#ifdef __cplusplus
R"esokit("
#endif
#define COUNT_MOST 4294967295u /* of what is counted: more is as much */
/* Flags of the status of the controller. */
#define REJECTED 65u /* y: MEASUREMENT_REJECTED, OUTLIER_REJECTED */
#define BRIDGED 24u /* GAP_BRIDGED, RESTARTED */

void esokit_clear(esokit_state *o)
{
  (void)memset(o, 0, sizeof *o);
  o->gain_ratio = 1.0;
  o->response = 1.0;
  o->is_free = true;
}

static real nearer(real share, real now, real weight)
{
  return share + (weight * (now - share));
}

static uint32_t counted(uint32_t many, bool now)
{
  uint32_t next = many;
  if (now && (many < COUNT_MOST)) {
    next = many + 1u;
  }
  return next;
}

/* Whether y moves where u at a limit drives it. */
static void follow(esokit_state *o, real y, real drives)
{
  real moved = y - o->slow_y;
  real way = 0.0;
  if (!(o->has_mean && is_finite(moved))) {
    o->slow_y = y;
    o->has_mean = true;
    moved = 0.0;
  }
  o->slow_y = nearer(o->slow_y, y, QUICK_WEIGHT);
  if (moved > 0.0) {
    way = drives;
  }
  if (moved < 0.0) {
    way = -drives;
  }
  o->underway = nearer(o->underway, way, WEIGHT);
}

static void count(esokit_state *o, const esokit_sample *sample, bool rejected)
{
  const real beyond = sample->asked - sample->held;
  real limit = 0.0;
  real gone = 0.0;
  if (sample->runs && (beyond > HAIR)) {
    limit = 1.0;
  }
  if (sample->runs && (beyond < -HAIR)) {
    limit = -1.0;
  }
  if (rejected) {
    gone = 1.0;
  }
  o->samples = counted(o->samples, true);
  o->rejected = counted(o->rejected, rejected);
  o->bridged = counted(o->bridged, (sample->status & BRIDGED) != 0u);
  o->unsafe = counted(o->unsafe, !sample->runs);
  o->lost = nearer(o->lost, gone, RARE_WEIGHT);
  o->saturated = nearer(o->saturated, fabs(limit), WEIGHT);
  o->side = nearer(o->side, limit, WEIGHT);
  follow(o, sample->estimate, SIGN_OF_GAIN * limit);
}

/* Whether y stands still. */
static void watch_sensor(esokit_state *o, real measured)
{
  real same = 0.0;
  if (o->has_last && (measured >= o->last) && (measured <= o->last)) {
    same = 1.0;
  }
  o->standing = nearer(o->standing, same, RARE_WEIGHT);
  o->last = measured;
  o->has_last = true;
}

static void average(esokit_state *o, real innovation)
{
  const real square = innovation * innovation;
  if (is_finite(square) && (square < LARGEST_SQUARE)) {
    o->mean_square = nearer(o->mean_square, square, WEIGHT);
    o->innovation = sqrt(o->mean_square);
  }
}

/* phi by the poles of the observer, and the slow means; false for what no real u or plant causes. */
static bool filter(esokit_state *o, real phi, real psi)
{
  const real most = LARGEST;
  real filtered = phi;
  unsigned i;
  if (o->samples == DIVIDER) {
    /* The first: whatever u and load are, they are no move. At rest they cancel. */
    for (i = 0u; i < SIZE; ++i) {
      o->stages[i] = -psi;
    }
    o->slow_phi = -psi;
    o->slow_psi = psi;
  }
  for (i = 0u; i < SIZE; ++i) {
    o->stages[i] = filtered + (POLE * (o->stages[i] - filtered));
    filtered = o->stages[i];
  }
  o->slow_phi = o->slow_phi + (SLOW * (filtered - o->slow_phi));
  o->slow_psi = o->slow_psi + (SLOW * (psi - o->slow_psi));
  o->phi = filtered;
  o->x = filtered - o->slow_phi;
  o->y = psi - o->slow_psi;
  if ((fabs(o->x) < most) && (fabs(o->y) < most) &&
      is_finite((((o->x * o->x) + (o->y * o->y)) + o->sum_xx) + o->sum_aa)) {
    return true;
  }
  for (i = 0u; i < SIZE; ++i) {
    o->stages[i] = 0.0;
  }
  o->has_mean = false;
  o->slow_phi = 0.0;
  o->slow_psi = 0.0;
  o->sum_x = 0.0;
  o->sum_xx = 0.0;
  o->sum_xy = 0.0;
  o->sum_aa = 0.0;
  o->large_xx = 0.0;
  o->large_xy = 0.0;
  o->top = 0.0;
  o->opposed = 0.0;
  o->steady = 0.0;
  return false;
}

/* The time for which the motion is against u near its limit. */
static void oppose(esokit_state *o, real psi)
{
  const real now = o->phi - MIDDLE;
  const real late = o->slow_phi - MIDDLE;
  real side = 0.0;
  real least = LEAST_AGAINST;
  if ((now > END_OF_RANGE) && (late > END_OF_RANGE)) {
    side = 1.0;
  } else if ((now < -END_OF_RANGE) && (late < -END_OF_RANGE)) {
    side = -1.0;
  } else {
    /* Not near. */
  }
  const real against = (-side) * (o->phi + psi);
  if (!(against > least)) {
    o->top = 0.0;
  }
  if (o->top < against) {
    o->top = against;
  }
  if ((against > least) && (against > (FALLEN * o->top))) {
    o->steady = o->steady + STEP;
  } else {
    o->steady = 0.0;
  }
  /* By a share of what sign_ratio says, unless that is clear: a load helps a machine back, too. */
  if (o->sign_ratio > -0.5) {
    const real said = (SAID * o->sign_ratio) * RANGE;
    if (least < said) {
      least = said;
    }
  }
  if (against > least) {
    o->opposed = o->opposed + STEP;
  } else {
    o->opposed = 0.0;
  }
}

static void forget(esokit_state *o)
{
  o->sum_x = FORGET * o->sum_x;
  o->sum_xx = FORGET * o->sum_xx;
  o->sum_xy = FORGET * o->sum_xy;
  o->sum_aa = FORGET * o->sum_aa;
  o->large_xx = FORGET * o->large_xx;
  o->large_xy = FORGET * o->large_xy;
  o->evidence = FORGET * o->evidence;
}

static void regress(esokit_state *o)
{
  const real size = fabs(o->x);
  forget(o);
  if ((size > LEAST_SHARE) && (size > LEAST_PHI)) {
    const real a = o->x + o->y;
    o->sum_x = o->sum_x + size;
    o->sum_xx = o->sum_xx + (o->x * o->x);
    o->sum_xy = o->sum_xy + (o->x * o->y);
    o->sum_aa = o->sum_aa + (a * a);
    o->evidence = STEP * (o->sum_x * (o->sum_x / o->sum_xx));
    const real quotient = o->sum_xy / o->sum_xx;
    const real square = o->sum_aa / o->sum_xx;
    if (is_finite(quotient) && is_finite(square)) {
      o->gain_ratio = 1.0 + quotient;
      o->response = sqrt(square);
      if (size > LARGE_MOVE) {
        o->large_xx = o->large_xx + (o->x * o->x);
        o->large_xy = o->large_xy + (o->x * o->y);
        o->sign_ratio = 1.0 + (o->large_xy / o->large_xx);
      }
    }
  }
}

/* Whether the sign of b0 is wrong by what is seen now. */
static bool sees_wrong_sign(const esokit_state *o)
{
  const double rho = (double)o->gain_ratio;
  const double evidence = (double)o->evidence;
  const double large = (double)o->sign_ratio;
  const bool reversed = large < FOR_SIGN_RATIO;
  const bool unseen = (large >= NEGATIVE) && (large <= NEGATIVE);
  const bool surely = (rho < FOR_WRONG_SIGN) && (evidence >= FOR_EVIDENCE_OF_SIGN);
  const bool against = (evidence >= ONCE) && ((double)o->opposed >= FOR_OPPOSED);
  const bool lasts = (rho < FOR_STEADY_RATIO) && (evidence >= ONCE) &&
                     ((double)o->steady >= FOR_STEADY);
  return lasts || (reversed && (against || surely)) || (unseen && surely);
}

/* Until u has moved y the right way. */
static void remember_sign(esokit_state *o)
{
  const bool right = ((double)o->sign_ratio > RIGHT_SIGN) && ((double)o->saturated < OFTEN_LIMITED);
  if (sees_wrong_sign(o)) {
    o->reversed = true;
  } else if (right && ((double)o->evidence >= FOR_EVIDENCE)) {
    o->reversed = false;
  } else {
    /* Nothing new. */
  }
}

static void take_sample(esokit_state *o, const esokit_sample *sample)
{
  const bool rejected = (sample->status & REJECTED) != 0u;
  count(o, sample, rejected);
  if ((sample->missed == 0u) && !rejected) {
    average(o, sample->innovation);
  }
  o->is_lost = o->is_lost || rejected;
  o->is_free = o->is_free && sample->runs;
  o->phi_sum = o->phi_sum + (INPUT_GAIN * sample->applied);
  o->phase = (uint16_t)(o->phase + 1u);
  if (o->phase < DIVIDER) {
    return;
  }
  o->phase = 0u;
  const real phi = o->phi_sum / (real)DIVIDER;
  o->phi_sum = 0.0;
  const bool lost = o->is_lost || (sample->missed >= DIVIDER);
  const bool is_free = o->is_free;
  o->is_lost = false;
  o->is_free = true;
  if (!filter(o, phi, sample->disturbance)) {
    return;
  }
  if (!is_free) {
    o->opposed = 0.0;
    o->steady = 0.0;
  }
  if ((!is_free) || lost) {
    forget(o);
    return;
  }
  oppose(o, sample->disturbance);
  regress(o);
}

void esokit_look(esokit_state *o, const esokit_sample *sample)
{
  if ((sample->missed == 0u) && ((sample->status & REJECTED) == 0u) &&
      is_finite(sample->measured)) {
    watch_sensor(o, sample->measured);
  }
  take_sample(o, sample);
  remember_sign(o);
}

unsigned esokit_diagnose(const esokit_state *o)
{
  const double rho = (double)o->gain_ratio;
  const double response = (double)o->response;
  const double evidence = (double)o->evidence;
  const double saturated = (double)o->saturated;
  const double side = (double)o->side;
  const double limit = ONE_SIDE * saturated;
  const bool swings = (saturated > OFTEN_LIMITED) && (side < limit) && (side > -limit);
  const bool told = evidence >= FOR_EVIDENCE;
  real stuck = o->saturated;
  unsigned fault = ESOKIT_NONE;
  if (o->underway > 0.0) {
    stuck = o->saturated - o->underway;
  }
  if (o->reversed || sees_wrong_sign(o)) {
    fault = ESOKIT_WRONG_SIGN;
  } else if (told && ((rho > FOR_TOO_SMALL) ||
                      (swings && (response > FOR_RESPONSE) && (rho > (response / A_QUARTER))))) {
    fault = ESOKIT_GAIN_TOO_SMALL;
  } else if (o->lost > TENTH) {
    fault = ESOKIT_MEASUREMENTS_REJECTED;
  } else if (((double)o->standing > FOR_STANDING) && ((o->saturated > 0.5) || told)) {
    fault = ESOKIT_SENSOR_STILL;
  } else if (stuck > 0.5) {
    fault = ESOKIT_SATURATED;
  } else if ((NOISE > 0.0) && (o->innovation > THRICE_NOISE)) {
    fault = ESOKIT_INNOVATION_TOO_LARGE;
  } else if (told && (rho < FOR_TOO_LARGE)) {
    fault = ESOKIT_GAIN_TOO_LARGE_OR_DISTURBED;
  } else {
    /* None is found. */
  }
  return fault;
}

#ifdef ESOKIT_SELF_TEST
#define ROW_HALF 10u
#define ROW_TIMES 11u
#define ROW_FAULT 12u /* what is found begins here */

static real way_of(uint32_t i, uint32_t half)
{
  return (((i / half) % 2u) == 0u) ? 1.0 : -1.0;
}

/* The sample of a row with this number. */
static void sample_of(esokit_sample *sample, const real row[COLUMNS], uint32_t i)
{
  const uint32_t half = (uint32_t)row[ROW_HALF];
  const real way = way_of(i, half);
  sample->applied = row[0] + (row[1] * way);
  sample->disturbance = row[2] * way_of((i + (2u * half)) - LATE, half);
  sample->held = FIRST_HELD;
  sample->asked = FIRST_HELD + (row[3] + (row[4] * way));
  sample->estimate = row[5] * (real)i;
  sample->measured = sample->estimate;
  sample->innovation = row[6];
  sample->status = (uint16_t)row[7];
  sample->missed = (uint32_t)row[8];
  sample->runs = !(row[9] > 0.0);
}

int esokit_self_test(real tolerance)
{
  static const real rows[ROWS][COLUMNS] = { /* DESIGN_COLUMNS */
    DESIGN_VECTORS
  };
  esokit_state o;
  int wrong = 0;
  int at;
  esokit_clear(&o);
  for (at = 0; (at < ROWS) && (wrong == 0); ++at) {
    esokit_sample sample;
    const real *const row = rows[at];
    const real *const found = &row[ROW_FAULT];
    uint32_t i;
    for (i = 0u; i < (uint32_t)row[ROW_TIMES]; ++i) {
      sample_of(&sample, row, i);
      esokit_look(&o, &sample);
    }
    const real numbers[FOUND] = {
      (real)esokit_diagnose(&o), o.gain_ratio, o.sign_ratio, o.response, o.evidence, o.opposed,
      o.steady, o.standing, o.saturated, o.side, o.underway, o.lost, o.innovation};
    for (i = 0u; i < FOUND; ++i) {
      if (!(fabs(numbers[i] - found[i]) <= tolerance)) {
        wrong = at + 1;
      }
    }
  }
  return wrong;
}
#endif
#ifdef __cplusplus
")esokit"
#endif
