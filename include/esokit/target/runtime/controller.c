#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_GUARDED
#define inner_update update_guarded
#define inner_predict predict_guarded
#define inner_rest rest_guarded
#define observe_correct correct_guarded
#define observe_restart restart_guarded
#else
#define inner_update update_outside
#define inner_predict predict_outside
#define inner_rest rest_outside
#define observe_correct correct_outside
#if ESOKIT_WRAPPED
#define observe_restart restart
#else
#define observe_restart restart_plain
#endif
#endif
#if ESOKIT_MAPPED
/* ---- What is inside is given the effect of u. */

static unsigned update_mapped(esokit_state *o, real y, real u)
{
  return inner_update(o, y, esokit_effect_of(u));
}

static unsigned predict_mapped(esokit_state *o, real u)
{
  return inner_predict(o, esokit_effect_of(u));
}

#if ESOKIT_CONTROLLER
static bool rest_mapped(esokit_state *o, real y, real u)
{
  return inner_rest(o, y, esokit_effect_of(u));
}

/* The u with an effect that may have none. */
static real finite_input_for(real effect)
{
  const real u = esokit_input_for(effect);
  return is_finite(u) ? u : ((u < 0.0) ? -LARGEST : LARGEST);
}

#endif
#define observe_update update_mapped
#define observe_predict predict_mapped
#define observe_rest rest_mapped
#elif ESOKIT_GUARDED
#define observe_update update_guarded
#define observe_predict predict_guarded
#define observe_rest rest_guarded
#else
#define observe_update update_outside
#define observe_predict predict_outside
#define observe_rest rest_outside
#endif
#if ESOKIT_CONTROLLER
/* The last u of update, or what was commanded elsewhere since. */
static real commanded(const esokit_state *o)
{
#if ESOKIT_GUARDED || ESOKIT_MONITORED || ESOKIT_SETTINGS
  return within(o, o->u_kept); /* else put_out sees to it */
#else
  return o->u_kept;
#endif
}

/* u is commanded elsewhere. */
static void take_command(esokit_state *o, real u)
{
  take_over(o, u);
  o->u_kept = u;
}

static void judge_missing(esokit_state *o)
{
  if (o->gap >= MISSING_LIMIT) {
    o->mode = ESOKIT_SAFE;
  }
#if !ESOKIT_STAYS_SAFE
  if ((o->mode == ESOKIT_SAFE) && (o->gap < DIVIDER)) {
    o->mode = ESOKIT_RUNNING;
  }
#endif
}

/* u of the law. */
static real wanted(esokit_state *o, DESIGN_R)
{
  real u = 0.0;
#if ESOKIT_LAW_OF_ANGLE
  u = law(o, wrapped(r - o->DESIGN_ANGLE));
#elif ESOKIT_WRAPPED && !ESOKIT_ERROR_BASED && !ESOKIT_COMPENSATOR
  const real angle = estimate_at(o, 0u);
#if ESOKIT_MOVES
  u = law(o, angle + wrapped(r - angle), DESIGN_MOTION);
#else
  u = law(o, angle + wrapped(r - angle));
#endif
#elif ESOKIT_GUARDED && ESOKIT_COMPENSATOR
  u = law(o, -0.0);
  u = r + (u * o->input_factor);
#else
  u = law(o, DESIGN_R_GIVEN);
#endif
#if ESOKIT_GUARDED && !ESOKIT_SOFTENS && !ESOKIT_COMPENSATOR
  u = u * o->input_factor;
#endif
#if ESOKIT_MAPPED
  u = esokit_input_for(u);
#endif
#if ESOKIT_SOFTENS
  soften(o, u);
#endif
  return u;
}

/* u where it is not that of the law. */
static real other_output(esokit_state *o)
{
#if ESOKIT_HOLDS_AT_START
  if (o->mode == ESOKIT_START_HOLD) {
    o->hold_left = o->hold_left - 1u;
    if (o->hold_left == 0u) {
      o->mode = ESOKIT_RUNNING;
    }
    return HOLD_INPUT;
  }
#endif
#if ESOKIT_RESTS
  if (o->mode == ESOKIT_REST) {
    return commanded(o);
  }
#endif
#if ESOKIT_HOLDS_SAFE
  return commanded(o);
#else
  (void)o;
  return SAFE_INPUT;
#endif
}

/* After the observer's part of a sample. */
static real put_out(esokit_state *o, DESIGN_R)
{
  real u = r; /* which has to be finite where it is not used, too */
  judge_missing(o);
  const bool runs = o->mode == ESOKIT_RUNNING;
#if ESOKIT_ERROR_BASED || ESOKIT_MOVES
  if (!(DESIGN_R_IS_FINITE)) {
    o->status = (uint16_t)(o->status | ESOKIT_REFERENCE_REJECTED);
  }
#endif
  if (runs) {
    u = wanted(o, DESIGN_R_GIVEN);
  }
  if (!is_finite(u)) {
    o->status = (uint16_t)(o->status | ESOKIT_REFERENCE_REJECTED);
    u = commanded(o);
  }
  if (!runs) {
    u = other_output(o);
  }
  u = limit(o, u);
  o->u_kept = u;
  o->elsewhere = 0u;
  return u;
}

void esokit_init(esokit_state *o)
{
#if ESOKIT_SAVED
  (void)memset(o, 0, sizeof *o); /* what lies between its members is saved, too */
#endif
  DESIGN_INIT
#if ESOKIT_DIVIDED
  o->phase = 0u;
#endif
  o->u_kept = FIRST_KEPT;
#if ESOKIT_HOLDS_AT_START
  o->hold_left = HOLD_SAMPLES;
#endif
  up_to_date(o);
  o->mode = FIRST_MODE;
  o->elsewhere = FIRST_ELSEWHERE;
  o->status = 0u;
}

unsigned esokit_start(esokit_state *o, real y, real u)
{
  esokit_state before;
#if ESOKIT_ERROR_BASED
  const real at = 0.0;
#else
  const real at = y;
#endif
#if ESOKIT_COMPENSATOR
  if (!is_finite(u)) {
    return ESOKIT_INPUT_REJECTED;
  }
#endif
  if (!is_finite(y)) {
    return ESOKIT_STATE_REJECTED;
  }
#if !ESOKIT_COMPENSATOR
  if (!is_finite(u)) {
    return ESOKIT_INPUT_REJECTED;
  }
#endif
  before = *o;
#if ESOKIT_DELAYED && ESOKIT_MAPPED && ESOKIT_GUARDED
  fill_delayed(o, esokit_effect_of(u) * o->gain_ratio);
#elif ESOKIT_DELAYED && ESOKIT_MAPPED
  fill_delayed(o, esokit_effect_of(u));
#elif ESOKIT_DELAYED && ESOKIT_GUARDED
  fill_delayed(o, u * o->gain_ratio);
#elif ESOKIT_DELAYED
  fill_delayed(o, u);
#endif
  (void)observe_predict(o, u); /* keeps it as applied */
#if ESOKIT_MEASURED
  settle_measured(o);
#endif
  if (!observe_rest(o, at, u)) {
    *o = before;
    return ESOKIT_STATE_REJECTED;
  }
  take_command(o, u);
#if ESOKIT_SOFTENS
  harden(o);
#endif
#if ESOKIT_GATED
  gate_set(o, true);
#endif
  up_to_date(o);
  o->mode = ESOKIT_RUNNING;
#if ESOKIT_RESTS
  leave_rest(o);
#endif
  o->elsewhere = 1u;
  return 0u;
}

/* After a gap too long to bridge. */
static void rest_again(esokit_state *o, real measured)
{
#if ESOKIT_GUARDED
  const real held = applied_by_present(o);
#elif ESOKIT_KNOWN
  const real held = o->u_given;
#else
  const real held = o->u_applied;
#endif
#if ESOKIT_MAPPED
  const bool rests = observe_rest(o, measured, finite_input_for(held));
#else
  const bool rests = observe_rest(o, measured, held);
#endif
#if ESOKIT_GATED
  if (rests) {
    gate_set(o, true);
  }
#else
  (void)rests;
#endif
}

/* The observer's part of a sample. */
static void take_sample(esokit_state *o, real measured, real given)
{
#if ESOKIT_DIVIDED
  const bool planned = (o->gap + 1u) == DIVIDER;
  unsigned status = observe_update(o, measured, given);
#else
  const unsigned status = observe_update(o, measured, given);
#endif
  if ((status & ESOKIT_RESTARTED) != 0u) {
    rest_again(o, measured);
  }
#if ESOKIT_DIVIDED
  if (planned && (status == ESOKIT_GAP_BRIDGED)) {
    status = 0u;
  }
#endif
  o->status = (uint16_t)status;
}

static void skip_sample(esokit_state *o, real given)
{
#if ESOKIT_DIVIDED
  o->phase = (uint16_t)(o->phase + 1u);
  if (o->phase >= DIVIDER) {
    o->phase = 0u;
  }
#endif
  o->status = (uint16_t)observe_predict(o, given);
}

real esokit_update(esokit_state *o, real y, DESIGN_R)
{
#if ESOKIT_ERROR_BASED
  const real measured = r - y;
#else
  const real measured = y;
#endif
#if ESOKIT_DIVIDED
  if (o->phase != 0u) {
    skip_sample(o, o->u_last);
    return put_out(o, DESIGN_R_GIVEN);
  }
  o->phase = 1u;
#endif
  take_sample(o, measured, o->u_last);
#if ESOKIT_RESTS
  judge_rest(o, was_taken(o, y), y, DESIGN_R_GIVEN);
#endif
  return put_out(o, DESIGN_R_GIVEN);
}

real esokit_update_without_measurement(esokit_state *o, DESIGN_R)
{
  skip_sample(o, o->u_last);
#if ESOKIT_RESTS
  judge_rest(o, false, 0.0, DESIGN_R_GIVEN);
#endif
  return put_out(o, DESIGN_R_GIVEN);
}

unsigned esokit_applied(esokit_state *o, real u)
{
  if (!is_finite(u)) {
    return ESOKIT_INPUT_REJECTED;
  }
  if (o->elsewhere != 0u) {
    take_command(o, u);
  } else {
    o->u_last = u;
  }
  return 0u;
}

#if ESOKIT_GUARDED
static real hold_sample(esokit_state *o, real measured, real u)
{
  const bool good = is_finite(u);
  real given = u;
#if ESOKIT_SOFTENS
  harden(o);
#endif
  if (!good) {
    given = commanded(o);
  }
  take_command(o, given);
#if ESOKIT_RESTS
  leave_rest(o);
#endif
#if ESOKIT_HOLDS_AT_START
  if (o->mode == ESOKIT_START_HOLD) {
    o->mode = ESOKIT_RUNNING;
  }
#endif
  o->elsewhere = 1u;
#if ESOKIT_MAPPED
  given = esokit_input_for(hold_guards(o));
#else
  given = hold_guards(o);
#endif
#if ESOKIT_DIVIDED
  if (o->phase != 0u) {
    skip_sample(o, given);
  } else {
    o->phase = 1u;
    take_sample(o, measured, given);
  }
#else
  take_sample(o, measured, given);
#endif
  judge_missing(o);
  release_guards(o);
  if (!good) {
    o->status = (uint16_t)(o->status | ESOKIT_INPUT_REJECTED);
  }
#if ESOKIT_MONITORED
  o->u_asked = o->u_last;
#endif
  return o->u_last;
}

#if ESOKIT_ERROR_BASED
real esokit_hold(esokit_state *o, real y, real r, real u)
{
  return hold_sample(o, r - y, u);
}
#else
real esokit_hold(esokit_state *o, real y, real u)
{
  return hold_sample(o, y, u);
}
#endif

#endif
#if ESOKIT_SETTINGS
bool esokit_adopt(esokit_state *o, const esokit_settings *settings)
{
  const bool is_ours = settings->design == DESIGN_MARK;
  if (is_ours) {
    const real held = o->u_last;
    const real u = commanded(o);
    o->settings = settings;
    recover_anew(o);
    take_command(o, u);
    o->u_last = held;
  }
  return is_ours;
}

#endif
#elif !ESOKIT_PREDICTIVE
void esokit_init(esokit_state *o)
{
#if ESOKIT_SAVED
  (void)memset(o, 0, sizeof *o); /* what lies between its members is saved, too */
#endif
  DESIGN_INIT
  up_to_date(o);
}

unsigned esokit_reset(esokit_state *o, real y)
{
  unsigned status = ESOKIT_STATE_REJECTED;
  if (observe_restart(o, y)) {
#if ESOKIT_GATED
    gate_set(o, true);
#endif
    status = 0u;
  }
  return status;
}

unsigned esokit_predict(esokit_state *o, real u)
{
  return observe_predict(o, u);
}

unsigned esokit_correct(esokit_state *o, real y)
{
  return observe_correct(o, y);
}

unsigned esokit_update(esokit_state *o, real y, real u)
{
  return observe_update(o, y, u);
}

#if ESOKIT_SETTINGS
bool esokit_adopt(esokit_state *o, const esokit_settings *settings)
{
  const bool is_ours = settings->design == DESIGN_MARK;
  if (is_ours) {
    o->settings = settings;
    recover_anew(o);
  }
  return is_ours;
}

#endif
#endif
real esokit_estimate(const esokit_state *o, unsigned row)
{
  return estimate_at(o, row);
}

#if ESOKIT_SAVED
/* ---- A state that is kept over a restart. */

/* CRC-32 of IEEE 802.3, from the lowest bit on. */
#define CRC_POLYNOMIAL 0xedb88320u
#define CRC_BEGIN 0xffffffffu
#define CRC_BITS 8u /* of a byte */

static uint32_t crc_of(const esokit_state *o)
{
  const uint8_t *const bytes = (const uint8_t *)o;
  uint32_t crc = CRC_BEGIN;
  uint32_t i;
  for (i = 0u; i < (uint32_t)sizeof *o; ++i) {
    unsigned bit;
    crc = crc ^ bytes[i];
    for (bit = 0u; bit < CRC_BITS; ++bit) {
      crc = (crc >> 1) ^ (((crc & 1u) != 0u) ? CRC_POLYNOMIAL : 0u);
    }
  }
  return ~crc;
}

void esokit_save(const esokit_state *o, esokit_saved *to)
{
  to->design = DESIGN_NUMBER;
  to->size = (uint32_t)sizeof to->state;
  (void)memcpy(&to->state, o, sizeof to->state); /* with what lies between its members */
  to->crc = crc_of(&to->state);
}

/* Nothing of a sample is known but u. */
static void pass_sample(esokit_state *o, real u)
{
#if ESOKIT_CONTROLLER
  skip_sample(o, u);
  judge_missing(o);
#else
  (void)observe_predict(o, u);
#endif
}

bool esokit_load(esokit_state *o, const esokit_saved *from, uint32_t samples, real u)
{
  const uint32_t count = (samples < COUNT_MOST) ? samples : COUNT_MOST; /* no more are counted */
  uint32_t i;
#if ESOKIT_SETTINGS
  const esokit_settings *const settings = o->settings;
#endif
  if ((from->design != DESIGN_NUMBER) || (from->size != (uint32_t)sizeof from->state)) {
    return false;
  }
  if ((from->crc != crc_of(&from->state)) || !is_finite(u)) {
    return false;
  }
  *o = from->state;
#if ESOKIT_SETTINGS
  o->settings = settings; /* they may lie elsewhere by now, or be others */
  recover_anew(o);
#endif
  for (i = 0u; i < count; ++i) {
    pass_sample(o, u);
  }
#if ESOKIT_CONTROLLER
  take_command(o, u);
  o->elsewhere = 1u;
#endif
#if ESOKIT_RESTS
  leave_rest(o);
#endif
  return true;
}

#endif
#ifdef ESOKIT_SELF_TEST
/* What is called at a sample that is no update, whether a number is infinite, and which estimate is
 * compared. */
#define CALL_MISSES 1u
#define CALL_STARTS 2u
#define CALL_REPORTS 3u
#define CALL_RESETS 4u
#define CALL_CORRECTS 5u
#define CALL_SPLITS 6u
#define CALL_LOSES 7u
#define CALL_MEASURES 8u
#define CALL_RESTS 9u
#if ESOKIT_GUARDED
#define CALL_TRUSTS 10u
#define CALL_PINS 11u
#define CALL_HOLDS 12u
#define CALL_GAINS 13u
#endif
#if ESOKIT_SETTINGS
#define CALL_ADOPTS 14u
#endif
#if ESOKIT_SAVED
#define CALL_KEEPS 15u
#endif
#define CALL_KINDS 16u
#define CALL_BAD_Y 16u
#define CALL_BAD_BESIDE 32u
#define CALL_ROW 64u
#define CALL_MODE 512u /* times the mode, in a status */

#if ESOKIT_MEASURED
static void measure_all(esokit_state *o, real w)
{
#if ESOKIT_ONE_W
  esokit_measured(o, w);
#else
  real all[W_COUNT];
  unsigned i;
  for (i = 0u; i < W_COUNT; ++i) {
    all[i] = w;
  }
  esokit_measured(o, all);
#endif
}

#endif
#if ESOKIT_SAVED
/* Saves and loads, or what has a wrong bit, or is of another design. */
static bool kept(esokit_state *o, unsigned call, real samples, real u)
{
  esokit_saved saved;
  esokit_save(o, &saved);
  if ((call & CALL_BAD_Y) != 0u) {
    saved.crc = ~saved.crc;
  }
  if (samples < 1.0) {
    saved.design = ~saved.design;
  }
  return esokit_load(o, &saved, (uint32_t)fabs(samples), u);
}

#endif
#if ESOKIT_GUARDED || ESOKIT_SETTINGS || ESOKIT_SAVED
/* What is beside the samples; false if the call is none of it. A bool in the status: 1 if false. */
static bool called_beside(esokit_state *o, unsigned call, const real given[COLUMNS], unsigned *status)
{
  const unsigned kind = call % CALL_KINDS;
  bool is_one = true;
#if ESOKIT_GUARDED
  const real y = ((call & CALL_BAD_Y) != 0u) ? (given[0] * LARGEST) : given[0];
#endif
#if ESOKIT_SAVED
  const real u = ((call & CALL_BAD_BESIDE) != 0u) ? (given[1] * LARGEST) : given[1];
#endif
#if ESOKIT_SETTINGS
  esokit_settings other = esokit_DESIGN_SET;
  other.design = ~other.design;
#endif
  switch (kind) {
#if ESOKIT_GUARDED
    case CALL_TRUSTS:
      *status = esokit_set_trust(o, y);
      break;
    case CALL_PINS:
      *status = esokit_set_pin(o, (uint8_t)y);
      break;
#if !ESOKIT_SOFTENS
    case CALL_GAINS:
      *status = esokit_set_input_gain(o, y) ? 0u : 1u;
      break;
#endif
#endif
#if ESOKIT_SETTINGS
    case CALL_ADOPTS:
      *status = esokit_adopt(o, (given[0] > 0.0) ? &other : &esokit_DESIGN_SET) ? 0u : 1u;
      break;
#endif
#if ESOKIT_SAVED
    case CALL_KEEPS:
      *status = kept(o, call, given[0], u) ? 0u : 1u;
      break;
#endif
    default:
      is_one = false;
      break;
  }
  return is_one;
}

#endif
/* u, or an estimate where the call gives none; and the status, with the mode. */
static real called(esokit_state *o, unsigned call, const real given[COLUMNS], unsigned *status)
{
  const unsigned kind = call % CALL_KINDS;
  const unsigned row = call / CALL_ROW;
  real y = given[0];
  real r = given[1]; /* or u */
  real result = 0.0;
  unsigned left = 1u;
  *status = 0u;
  if ((call & CALL_BAD_Y) != 0u) {
    y = y * LARGEST;
  }
  if ((call & CALL_BAD_BESIDE) != 0u) {
    r = r * LARGEST;
  }
#if ESOKIT_RESTS || ESOKIT_GUARDED || ESOKIT_WRAPPED
  if ((kind == CALL_MISSES) || (kind == CALL_RESTS)) {
#else
  if (kind == CALL_MISSES) {
#endif
    left = (unsigned)given[0];
  }
#if ESOKIT_GUARDED || ESOKIT_SETTINGS || ESOKIT_SAVED
  if (called_beside(o, call, given, status)) {
    result = esokit_estimate(o, row);
  } else
#endif
#if ESOKIT_CONTROLLER || ESOKIT_PREDICTIVE
  if (kind == CALL_STARTS) {
    *status = esokit_start(o, y, r);
    result = esokit_estimate(o, row);
  } else if (kind == CALL_REPORTS) {
    *status = esokit_applied(o, r);
    result = esokit_estimate(o, row);
#if ESOKIT_PREDICTIVE
  } else if (kind == CALL_RESETS) {
    *status = esokit_reset(o, y);
    result = esokit_estimate(o, row);
  } else if ((kind == CALL_MISSES) || (kind == CALL_LOSES)) {
    while (left > 0u) {
      result = esokit_control_without_measurement(o);
      *status = 0u;
      if (kind == CALL_LOSES) {
        *status = esokit_applied(o, r);
      }
      *status = *status | esokit_prepare(o, DESIGN_SAMPLE_R);
      left = left - 1u;
    }
  } else if (kind == CALL_SPLITS) {
    result = esokit_control(o, y);
    *status = esokit_applied(o, r);
    *status = *status | esokit_prepare(o, DESIGN_SAMPLE_R);
#else
  } else if (kind == CALL_MISSES) {
    while (left > 0u) {
      result = esokit_update_without_measurement(o, DESIGN_SAMPLE_R);
      *status = o->status;
      left = left - 1u;
    }
#endif
#if ESOKIT_GUARDED
  } else if (kind == CALL_HOLDS) {
#if ESOKIT_ERROR_BASED
    result = esokit_hold(o, y, 0.0, r);
#else
    result = esokit_hold(o, y, r);
#endif
    *status = o->status;
#endif
#if ESOKIT_RESTS || ESOKIT_GUARDED || ESOKIT_WRAPPED
  } else if (kind == CALL_RESTS) {
    while (left > 0u) {
      result = esokit_update(o, r, DESIGN_SAMPLE_R);
      *status = o->status;
      left = left - 1u;
    }
#endif
#if ESOKIT_MEASURED
  } else if (kind == CALL_MEASURES) {
    measure_all(o, y);
    result = esokit_estimate(o, row);
#endif
  } else {
    result = esokit_update(o, y, DESIGN_SAMPLE_R);
    *status = o->status;
  }
  *status = *status + ((unsigned)o->mode * CALL_MODE);
#else
  if (kind == CALL_MISSES) {
    while (left > 0u) {
      *status = esokit_predict(o, r);
      left = left - 1u;
    }
  } else if ((kind == CALL_STARTS) || (kind == CALL_RESETS)) {
    *status = esokit_reset(o, y);
  } else if (kind == CALL_CORRECTS) {
    *status = esokit_correct(o, y);
#if ESOKIT_GUARDED
  } else if (kind == CALL_HOLDS) {
    const real u = esokit_hold(o);
    *status = esokit_update(o, y, u);
    esokit_release(o);
#endif
#if ESOKIT_GUARDED || ESOKIT_WRAPPED
  } else if (kind == CALL_RESTS) {
    while (left > 0u) {
      *status = esokit_update(o, r, r);
      left = left - 1u;
    }
#endif
#if ESOKIT_MEASURED
  } else if (kind == CALL_MEASURES) {
    measure_all(o, y);
#endif
  } else {
    *status = esokit_update(o, y, r);
  }
  result = esokit_estimate(o, row);
#endif
  return result;
}

int esokit_self_test(real tolerance)
{
  static const real samples[SAMPLES][COLUMNS] = { /* DESIGN_COLUMNS */
    DESIGN_VECTORS
  };
  static const uint16_t calls[CALLS][2] = {DESIGN_CALLS}; /* and the status after each */
  esokit_state o;
  int wrong = 0;
  int i;
  esokit_init(&o);
  for (i = 0; (i < SAMPLES) && (wrong == 0); ++i) {
    unsigned status;
    const real result = called(&o, (i < CALLS) ? calls[i][0] : CALL_LATER, samples[i], &status);
    const bool same = fabs(result - samples[i][COLUMNS - 1u]) <= tolerance;
    wrong = (same && ((i >= CALLS) || (status == calls[i][1]))) ? 0 : (i + 1);
  }
  return wrong;
}
#endif
#ifdef __cplusplus
")esokit"
#endif
