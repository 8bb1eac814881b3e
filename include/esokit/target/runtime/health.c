#ifdef __cplusplus
R"esokit("
#endif
void esokit_clear(esokit_state *o)
{
  (void)memset(o, 0, sizeof *o);
  o->gain_ratio = 1.0;
  o->response = 1.0;
  o->is_free = true;
}

static real nearer(real share, real now)
{
  return share + (WEIGHT * (now - share));
}

static void count(esokit_state *o, const esokit_sample *sample, bool rejected)
{
  const real beyond = sample->asked - sample->held;
  real limit = 0.0;
  if (sample->runs && (beyond > HAIR)) {
    limit = 1.0;
  }
  if (sample->runs && (beyond < -HAIR)) {
    limit = -1.0;
  }
  o->samples = o->samples + 1u;
  if (rejected) {
    o->rejected = o->rejected + 1u;
  }
  if ((sample->status & (8u | 16u)) != 0u) {
    o->bridged = o->bridged + 1u;
  }
  if (!sample->runs) {
    o->unsafe = o->unsafe + 1u;
  }
  o->saturated = nearer(o->saturated, fabs(limit));
  o->side = nearer(o->side, limit);
}

static void average(esokit_state *o, real innovation)
{
  const real square = innovation * innovation;
  if (is_finite(square) && (square < LARGEST_SQUARE)) {
    o->mean_square = nearer(o->mean_square, square);
    o->innovation = sqrt(o->mean_square);
  }
}

/* phi by the poles of the observer, and the slow means; false for what no real u or plant causes. */
static bool filter(esokit_state *o, real phi, real psi)
{
  const real most = LARGEST;
  real filtered = phi;
  unsigned i;
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
  o->slow_phi = 0.0;
  o->slow_psi = 0.0;
  o->sum_xx = 0.0;
  o->sum_xy = 0.0;
  o->sum_aa = 0.0;
  o->opposed = 0.0;
  return false;
}

/* The time for which the motion is against u near its limit. */
static void oppose(esokit_state *o, real psi)
{
  const real now = o->phi - MIDDLE;
  const real late = o->slow_phi - MIDDLE;
  real side = 0.0;
  real against;
  if ((now > END_OF_RANGE) && (late > END_OF_RANGE)) {
    side = 1.0;
  } else if ((now < -END_OF_RANGE) && (late < -END_OF_RANGE)) {
    side = -1.0;
  } else {
    /* Not near. */
  }
  against = (-side) * (o->phi + psi);
  if (against > LEAST_AGAINST) {
    o->opposed = o->opposed + STEP;
  } else {
    o->opposed = 0.0;
  }
}

static void forget(esokit_state *o)
{
  o->sum_xx = FORGET * o->sum_xx;
  o->sum_xy = FORGET * o->sum_xy;
  o->sum_aa = FORGET * o->sum_aa;
  o->evidence = FORGET * o->evidence;
}

static void regress(esokit_state *o)
{
  const real size = fabs(o->x);
  forget(o);
  if ((size > LEAST_SHARE) && (size > LEAST_PHI)) {
    const real a = o->x + o->y;
    real quotient;
    real square;
    o->sum_xx = o->sum_xx + (o->x * o->x);
    o->sum_xy = o->sum_xy + (o->x * o->y);
    o->sum_aa = o->sum_aa + (a * a);
    o->evidence = o->evidence + STEP;
    quotient = o->sum_xy / o->sum_xx;
    square = o->sum_aa / o->sum_xx;
    if (is_finite(quotient) && is_finite(square)) {
      o->gain_ratio = 1.0 + quotient;
      o->response = sqrt(square);
    }
  }
}

void esokit_look(esokit_state *o, const esokit_sample *sample)
{
  const bool rejected = (sample->status & (1u | 64u)) != 0u;
  real phi;
  bool lost;
  bool is_free;
  count(o, sample, rejected);
  if ((sample->missed == 0u) && !rejected) {
    average(o, sample->innovation);
  }
  o->lost = o->lost || rejected;
  o->is_free = o->is_free && sample->runs;
  o->phi_sum = o->phi_sum + (INPUT_GAIN * sample->applied);
  o->phase = (uint16_t)(o->phase + 1u);
  if (o->phase < DIVIDER) {
    return;
  }
  o->phase = 0u;
  phi = o->phi_sum / (real)DIVIDER;
  o->phi_sum = 0.0;
  lost = o->lost || (sample->missed >= DIVIDER);
  is_free = o->is_free;
  o->lost = false;
  o->is_free = true;
  if (!filter(o, phi, sample->disturbance)) {
    return;
  }
  if (!is_free) {
    o->opposed = 0.0;
  }
  if ((!is_free) || lost) {
    forget(o);
    return;
  }
  oppose(o, sample->disturbance);
  regress(o);
}

unsigned esokit_diagnose(const esokit_state *o)
{
  const double rho = (double)o->gain_ratio;
  const double response = (double)o->response;
  const double evidence = (double)o->evidence;
  const double saturated = (double)o->saturated;
  const double side = (double)o->side;
  const double limit = ONE_SIDE * saturated;
  const bool swings = (saturated > SWINGS) && (side < limit) && (side > -limit);
  const bool told = evidence >= FOR_EVIDENCE;
  unsigned fault = ESOKIT_NONE;
  if (((rho < NEGATIVE) && (evidence >= ONCE) && ((double)o->opposed >= FOR_OPPOSED)) ||
      ((rho < FOR_WRONG_SIGN) && (evidence >= FOR_EVIDENCE_OF_SIGN))) {
    fault = ESOKIT_WRONG_SIGN;
  } else if (told && ((rho > FOR_TOO_SMALL) ||
                      (swings && (response > FOR_RESPONSE) && (rho > (response / A_QUARTER))))) {
    fault = ESOKIT_GAIN_TOO_SMALL;
  } else if ((o->rejected > 10u) && (o->rejected > (o->samples / 10u))) {
    fault = ESOKIT_MEASUREMENTS_REJECTED;
  } else if (o->saturated > 0.5) {
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
#ifdef __cplusplus
")esokit"
#endif
