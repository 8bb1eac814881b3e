/// @file
/// What to_c writes of adapters around the recorded lists, as text of C.
#pragma once

#include <esokit/core/language.hpp>

// Each layer calls the one below. Words with a dollar are filled in.
namespace esokit::detail {

/// Measured around it: what each w passes. Of several all its names have a number.
inline constexpr const char* c_source_measured = R"(/* A measured disturbance w. */
static bool takes_w($real w)
{
  const $real most = $FOUR * w;
  return is_finite(most) && is_finite($W_GAIN * most);
}

static uint16_t after_w(uint16_t place)
{
  uint16_t next = 0u;
  if (place < $W_NEWESTu) {
    next = (uint16_t)(place + 1u);
  }
  return next;
}

/* Its mean over the coming sample behind dead time and lag; passed: where the lag is then. */
static $real course_of_w(const $name_state *o, $real *passed)
{
  const uint16_t oldest = after_w(o->newest_w);
  const $real w[2] = {o->w[oldest], o->w[after_w(oldest)]};
  const $real share[2] = {$W_SHARE};
  const $real late[2] = {$W_LATE};
  const $real reached[2] = {$W_REACHED};
  $real mean = $ZERO;
  $real now = o->w_lagged;
  unsigned i;
  for (i = 0u; i < 2u; ++i) {
    mean = mean + (share[i] * w[i]) + ((now - w[i]) * late[i]);
    now = now + (reached[i] * (w[i] - now));
  }
  *passed = now;
  return mean;
}

)";
/// What all of them do.
inline constexpr const char* c_source_measured_effect =
    R"(static $real effect_of_w(const $name_state *o)
{
  $real passed = $ZERO;
  const $real mean = course_of_w(o, &passed);
  return $ZERO + ($W_GAIN * mean);
}

static unsigned predict_measured($name_state *o, $real u)
{
  const unsigned status = predict_$below(o, u);
  $real passed = $ZERO;
  $real now;
  $real more;
)";
inline constexpr const char* c_source_measured_effects =
    R"(static $real effect_of_w(const $name_state *o)
{
  $real passed = $ZERO;
  $real all = $ZERO;
$W_ADD_ALL  return all;
}

static unsigned predict_measured($name_state *o, $real u)
{
  const unsigned status = predict_$below(o, u);
  $real now;
  $real more;
$W_ADVANCE_ALL  o->w_is_new = 0u;
)";
/// A sample of a w.
inline constexpr const char* c_source_measured_sample = R"(  (void)course_of_w(o, &passed);
  o->w_lagged = passed;
  if ((o->w_is_new != 0u) && takes_w(o->w_given)) {
    o->w_last = o->w_given;
    o->w_lost = 0u;
  } else if (o->w_lost <= 65535u) {
    o->w_lost = o->w_lost + 1u;
  } else {
    /* It has been lost for long. */
  }
$W_FORGET  o->newest_w = after_w(o->newest_w);
  o->w[o->newest_w] = (o->w_lost > $W_MOSTu) ? $ZERO : o->w_last;
)";
inline constexpr const char* c_source_measured_advance =
    R"(static void advance_w($name_state *o)
{
  $real passed = $ZERO;
$W_SAMPLE}

)";
inline constexpr const char* c_source_measured_tell = R"(  now = effect_of_w(o);
  more = now - o->w_told;
  if (((more < $ZERO) || (more > $ZERO)) && load(o, more)) {
    o->w_told = now;
  }
  return status;
}

void $name_measured($name_state *o, $W_ARGUMENT)
{
$W_GIVE  o->w_is_new = 1u;
}

)";
/// Without a gate.
inline constexpr const char* c_source_measured_update =
    R"(static unsigned update_measured($name_state *o, $real y, $real u)
{
  const unsigned status = predict_measured(o, u);
  return status | correct_$below(o, y);
}

)";
/// In a start.
inline constexpr const char* c_source_measured_settle = R"(/* As if w had been there for long. */
static void settle_w($name_state *o)
{
  const $real w = o->w[o->newest_w];
  unsigned i;
  for (i = 0u; i <= $W_NEWESTu; ++i) {
    o->w[i] = w;
  }
  o->w_lagged = w;
$W_TOLD}

)";
/// Of all of them.
inline constexpr const char* c_source_measured_settle_all = R"(static void settle_w($name_state *o)
{
$W_SETTLE_ALL  o->w_told = effect_of_w(o);
}

)";

/// OutlierGate around it.
inline constexpr const char* c_source_gate = R"(static void gate_set($name_state *o, bool open)
{
  o->gate_open = open ? 1u : 0u;
  o->gate_count = 0u;
}

/* A y that is not finite, or after too long a gap, is left to the observer. */
static bool gate_lets_in($name_state *o, $real y)
{
  const $real running = $GATE_FACTOR * o->gate_mean;
  const $real limit = (running > $GATE_THRESHOLD) ? running : $GATE_THRESHOLD;
  const $real innovation = y - o->$FIRST;
  const $real distance = $fabs(innovation);
  $real most = limit;
  bool fits;
  if (!is_finite(innovation)) {
    return true;
  }
  if (o->gap > $ROWSu) {
    gate_set(o, true);
    return true;
  }
  if (o->gap > 1u) {
    most = limit * ($real)o->gap;
  }
  fits = distance <= most;
  if (!fits && (o->gate_open == 0u) && (o->gate_count < $GATE_MOSTu)) {
    o->gate_count = (uint16_t)(o->gate_count + 1u);
    return false;
  }
  o->gate_mean =
    o->gate_mean + ((((distance < limit) ? distance : limit) - o->gate_mean) * $SHARE);
  if ((o->gate_open != 0u) && fits) {
    o->gate_count = (uint16_t)(o->gate_count + 1u);
    if (o->gate_count >= $GATE_MOSTu) {
      gate_set(o, false);
    }
  } else {
    gate_set(o, !fits);
  }
  return true;
}

static unsigned correct_gated($name_state *o, $real y)
{
  unsigned status = $NAME_OUTLIER_REJECTED;
  if (gate_lets_in(o, y)) {
    status = correct_base(o, y);
  }
  return status;
}

static unsigned update_gated($name_state *o, $real y, $real u)
{
  const unsigned status = predict_$below(o, u);
  return status | correct_gated(o, y);
}

)";

/// KnownModel around it.
inline constexpr const char* c_source_known =
    R"(/* The known part of the motion acts like a u of its own. */
static $real push_known($name_state *o, $real u)
{
  $real driven = $ZERO;
  (void)drive(o, u, &driven);
  return driven;
}

static unsigned predict_known($name_state *o, $real u)
{
  const unsigned status = predict_$below(o, push_known(o, u));
  return is_finite(u) ? status : (status | $NAME_INPUT_REJECTED);
}

static unsigned update_known($name_state *o, $real y, $real u)
{
  const unsigned status = update_$below(o, y, push_known(o, u));
  return is_finite(u) ? status : (status | $NAME_INPUT_REJECTED);
}

)";

/// DelayedInput around it.
inline constexpr const char* c_source_delay = R"(static uint16_t after_delayed(uint16_t place)
{
  uint16_t next = 0u;
  if (place < $NEWESTu) {
    next = (uint16_t)(place + 1u);
  }
  return next;
}

/* The u that acts now, for one that acts later. */
static unsigned push_delayed($name_state *o, $real *u)
{
  const $real last = o->line[o->newest];
  const bool good = is_finite(*u);
  o->newest = after_delayed(o->newest);
  o->line[o->newest] = good ? *u : last;
  *u = o->line[after_delayed(o->newest)];
  return good ? 0u : $NAME_INPUT_REJECTED;
}

static unsigned predict_delayed($name_state *o, $real u)
{
  $real acting = u;
  const unsigned status = push_delayed(o, &acting);
  return status | predict_$below(o, acting);
}

static unsigned update_delayed($name_state *o, $real y, $real u)
{
  $real acting = u;
  const unsigned status = push_delayed(o, &acting);
  return status | update_$below(o, y, acting);
}

)";

/// Its start.
inline constexpr const char* c_source_delay_fill =
    R"(static void fill_delayed($name_state *o, $real u)
{
  unsigned i;
  for (i = 0u; i < $LENGTHu; ++i) {
    o->line[i] = u;
  }
}

)";

/// WrappedOutput around it.
inline constexpr const char* c_source_wrapped = R"(/* A measured angle. */
typedef struct {
  $real y; /* within half a period of zero */
  $real turns;
  $real step; /* since the last one, by the nearest turn */
  uint32_t samples;
  bool usable;
  bool fits; /* it moved as before */
  bool counted;
$READING_MORE} angle_reading;

static $real wrapped($real angle)
{
  return ($fabs(angle) <= $HALF) ? angle : (angle - ($PERIOD * $round(angle * $INVERSE)));
}

static bool can_be_told($real y)
{
  const $real turns = y * $INVERSE;
  return is_finite(turns) && ($fabs(turns) < $MOST_TURNS);
}

static void $forget($count_state *o)
{
  o->angle = $ZERO;
  o->turns = $ZERO;
  o->motion = $ZERO;
  o->motion_samples = 65535u;
  o->gaps = 0u;
  o->doubts = 0u;
  o->begun = 0u;
}

$FORGET_BOTHstatic bool restart_wrapped($name_state *o, $real y)
{
  const bool good = can_be_told(y) && restart(o, wrapped(y));
  if (good) {
    forget_turns(o);
$OPEN_GATE  }
  return good;
}

static $real expected_motion(const $count_state *o, uint32_t samples)
{
  $real motion = o->motion;
  if ((o->motion_samples == 65535u) || (samples == 0u)) {
    motion = $ZERO;
  } else if (samples != o->motion_samples) {
    motion = o->motion * (($real)samples / ($real)o->motion_samples);
  } else {
    /* It is that of as many samples. */
  }
  return motion;
}

static angle_reading read_angle(const $count_state *o, $real y, uint32_t samples)
{
  angle_reading reading = {$ZERO, $ZERO, $ZERO, 0u, false, true, false$NONE_MORE};
  if (can_be_told(y)) {
    reading.usable = true;
    reading.y = wrapped(y);
    reading.samples = samples;
  }
  if (reading.usable && (o->begun != 0u)) {
    const $real change = reading.y - o->angle;
    const $real expected = expected_motion(o, samples);
    const $real ahead = expected - change;
    const $real crossed = ($fabs(ahead) <= $HALF) ? $ZERO : $round(ahead * $INVERSE);
    const $real motion = change + (crossed * $PERIOD);
    reading.step = wrapped(change);
    if (o->motion_samples != 65535u) {
      reading.fits = ($fabs(motion - expected) <= $QUARTER) &&
        ((samples > o->motion_samples) || ($fabs(motion) <= $HALF));
    }
    reading.turns = o->turns + crossed;
    reading.counted =
      (reading.fits || (o->doubts >= 3u)) && is_finite(reading.turns * $PERIOD);
  }
  return reading;
}

/* Keeps the estimate within half a period of zero. */
static void recentre($name_state *o)
{
  $real z = $ZERO;
  (void)estimate_0(o, &z);
  if (!($fabs(z) <= $HALF)) {
    const $real turns = $round(z * $INVERSE);
    if (shift(o, -(turns * $PERIOD))) {
$TURN_BACK    }
  }
}

static void learn_motion($count_state *o, const angle_reading *reading)
{
  if ((o->begun != 0u) && (reading->samples != 0u)) {
    if (reading->samples > o->motion_samples) {
      o->gaps = (uint8_t)(o->gaps + 1u);
      if (o->gaps >= 8u) {
        o->motion_samples = 65535u; /* after so many gaps it is not known */
      }
    } else {
      o->gaps = 0u;
      if ((reading->samples < o->motion_samples) || (o->doubts >= 3u)) {
        o->motion = reading->step;
        o->motion_samples = (uint16_t)reading->samples;
      } else if (reading->fits) {
        o->motion = o->motion + ((reading->step - o->motion) * $EIGHTH);
      } else {
        /* It says nothing. */
      }
    }
  }
}

static unsigned restart_at_angle($name_state *o, $real y)
{
  return restart_wrapped(o, y) ? $NAME_RESTARTED : $NAME_MEASUREMENT_REJECTED;
}

)";
/// What it keeps after a correction.
inline constexpr const char* c_source_wrapped_keep = R"(/* After the correction. */
static unsigned keep_angle($name_state *o, const angle_reading *reading, unsigned given)
{
  unsigned status = given;
  if ((status & $NAME_MEASUREMENT_REJECTED) != 0u) { /* the state is to blame */
    return restart_at_angle(o, reading->y) | (status & $NAME_INPUT_REJECTED);
  }
  learn_motion(o, reading);
  o->angle = reading->y;
  o->turns = reading->turns;
  if (reading->fits) {
    o->doubts = 0u;
  } else {
    status |= $NAME_TURN_ASSUMED;
    if (o->doubts < 3u) {
      o->doubts = (uint8_t)(o->doubts + 1u);
    }
  }
  o->begun = 1u;
  recentre(o);
  return status;
}

)";
/// The same around a gate: turns are counted over all measurements, too, as those that the gate
/// accepts are chosen by the estimate.
inline constexpr const char* c_source_wrapped_gated =
    R"(static void learn_turn($name_turns *o, const angle_reading *reading)
{
  learn_motion(o, reading);
  o->angle = reading->y;
  o->turns = reading->turns;
  if (reading->fits) {
    o->doubts = 0u;
  } else if (o->doubts < 3u) {
    o->doubts = (uint8_t)(o->doubts + 1u);
  } else {
    /* There are enough. */
  }
  o->begun = 1u;
}

static uint8_t one_more(uint8_t count)
{
  return (count < 255u) ? (uint8_t)(count + 1u) : count;
}

/* Where the gate rejects what moves steadily, the turn is that of all measurements. */
static angle_reading choose_angle(const $name_state *o, $real y, uint32_t missed)
{
  angle_reading reading = read_angle(&o->taken, y, missed);
  reading.missed = missed;
  if ((o->heard_rejected > 0u) && (o->heard_steady >= 8u) &&
      (o->heard_steady >= o->heard_rejected)) {
    angle_reading heard = read_angle(&o->heard, y, missed - o->heard_at);
    if (heard.fits && heard.counted) {
      heard.missed = missed;
      heard.heard = true;
      reading = heard;
    }
  }
  return reading;
}

static void hear_angle($name_state *o, const angle_reading *given)
{
  const angle_reading reading = read_angle(&o->heard, given->y, given->missed - o->heard_at);
  const bool steady = reading.fits && (o->heard.motion_samples != 65535u);
  o->heard_steady = steady ? one_more(o->heard_steady) : 0u;
  o->heard_rejected = one_more(o->heard_rejected);
  o->heard_at = (uint16_t)given->missed;
  learn_turn(&o->heard, &reading);
}

/* After the correction. */
static unsigned keep_angle($name_state *o, const angle_reading *reading, unsigned given)
{
  unsigned status = given;
  if ((status & $NAME_MEASUREMENT_REJECTED) != 0u) { /* the state is to blame */
    return restart_at_angle(o, reading->y) | (status & $NAME_INPUT_REJECTED);
  }
  if ((status & $NAME_OUTLIER_REJECTED) != 0u) {
    hear_angle(o, reading);
    recentre(o);
    return status;
  }
  if (!reading->fits) {
    status |= $NAME_TURN_ASSUMED;
  }
  if (!reading->heard) {
    learn_turn(&o->taken, reading);
  }
  hear_angle(o, reading);
  if (reading->heard) {
    o->taken = o->heard;
  } else {
    o->heard.turns = o->taken.turns; /* counted from what was used */
  }
  o->heard_at = 0u;
  o->heard_rejected = 0u;
  recentre(o);
  return status;
}

)";
/// Its layer.
inline constexpr const char* c_source_wrapped_layer =
    R"(static unsigned predict_wrapped($name_state *o, $real u)
{
  const unsigned status = predict_$below(o, u);
  recentre(o);
  return status;
}

static unsigned correct_wrapped($name_state *o, $real y)
{
  angle_reading reading = $choose_angle(o, y, o->gap);
  if (!reading.usable) {
    return $NAME_MEASUREMENT_REJECTED;
  }
  if (reading.fits && !is_finite(reading.turns * $PERIOD)) {
    return restart_at_angle(o, reading.y);
  }
  if (!reading.counted) {
    reading.turns = $round((o->$FIRST - reading.y) * $INVERSE);
  }
  return keep_angle(o, &reading, correct_$below(o, reading.y + (reading.turns * $PERIOD)));
}

static unsigned update_wrapped($name_state *o, $real y, $real u)
{
  const angle_reading reading = $choose_angle(o, y, (uint32_t)o->gap + 1u);
  unsigned status;
  if (reading.counted) {
    status = update_$below(o, reading.y + (reading.turns * $PERIOD), u);
    return keep_angle(o, &reading, status);
  }
  status = predict_wrapped(o, u);
  return status | correct_wrapped(o, y);
}

)";
/// Its start at rest.
inline constexpr const char* c_source_wrapped_rest =
    R"(static bool rest_wrapped($name_state *o, $real y, $real u)
{
  const bool good = can_be_told(y) && rest_at(o, y, u, wrapped(y));
  if (good) {
    forget_turns(o);
$LAW_BEGIN  }
  return good;
}

)";
/// A start at rest where the gain goes on.
inline constexpr const char* c_source_running_rest =
    R"(static bool rest_running($name_state *o, $real y, $real u)
{
  const bool good = rest_at(o, y, u);
  if (good) {
$LAW_BEGIN  }
  return good;
}

)";

/// Guarded around it.
inline constexpr const char* c_source_guarded = R"(/* Keeps the disturbance within its bound. */
static void keep_bound($name_state *o)
{
$KEEP_BOUND}

/* How much a correction of the disturbance counts. */
static void set_weights($name_state *o)
{
  const bool none = (o->held != 0u) || (o->frozen != 0u);
  const bool one_sided = (o->pin != $NAME_PIN_FREE) || (o->release_left > 0u);
  o->weight_up = (none || (one_sided && (o->side != $UP_SIDEu))) ? $ZERO : o->trust;
  o->weight_down = (none || (one_sided && (o->side != $DOWN_SIDEu))) ? $ZERO : o->trust;
  o->gated = (none || one_sided || (o->trust < $ONE)) ? 1u : 0u;
}

static void settle_guards($name_state *o, uint32_t left)
{
  o->settling_left = left;
  o->frozen = 0u;
  o->unsettled = 0u;
  set_weights(o);
}

/* After a correction; before: what each level had found until then. */
static void keep_guards($name_state *o, const $real before[$LEVELS], unsigned status)
{
  bool changes = false;
  if ((o->settling_left > 0u) && (o->gated != 0u) && (o->held == 0u) && (o->frozen == 0u)) {
    o->frozen = 1u;
    o->settling_left = $SETTLINGu;
    set_weights(o);
  }
  if ((o->gated != 0u) && ((status & $NAME_RESTARTED) == 0u)) {
    $real moved;
$TRUST  }
  if ((status & $REFUSED) == 0u) {
$LEAK    if (o->release_left > 0u) {
      o->release_left = (uint16_t)(o->release_left - 1u);
      changes = o->release_left == 0u;
    }
    if (o->settling_left > 0u) {
      o->settling_left = o->settling_left - 1u;
      if (o->settling_left == 0u) {
        o->frozen = 0u;
        changes = true;
      }
    }
    if (changes) {
      set_weights(o);
    }
  }
  keep_bound(o);
}

/* The plant is held: the prediction stands still. */
static unsigned predict_standing($name_state *o, $real u)
{
  const $real x[$STATES] = {$ROWS_OF_FIRST};
  const $real y = x[0];
  $real expected = $ZERO;
  const unsigned status = predict_$below(o, u * o->told_ratio);
  if ((status & $NAME_PREDICTION_DROPPED) == 0u) {
    unsigned i;
    (void)predicted_y(o$ROWS_OF_X, o->u_applied, &expected);
    for (i = 1u; i < $ORDERu; ++i) {
      if ((x[i] < $ZERO) || (x[i] > $ZERO)) {
        o->unsettled = 1u;
      }
    }
    (void)stand_at(o, y + (o->$FIRST - expected)$STANDING);
  }
  o->told_ratio = o->gain_ratio;
  return status;
}

static unsigned correct_standing($name_state *o, $real y)
{
  const $real before[$LEVELS] = {$FOUND};
  const unsigned elapsed = (o->gap > 1u) ? o->gap : 1u;
  const $real left = (elapsed > $ROWSu) ? $ONE : ($ONE - $GAINS_BY_GAP[elapsed - 1u][0]);
  const unsigned status = correct_$below(o, y);
  if ((status & $REFUSED) == 0u) {
    settle_guards(o, $SETTLINGu);
    (void)stand_at(o, o->$FIRST + (left * o->innovation)$STOOD);
  }
  {
    const $real now[$LEVELS] = {$FOUND};
    keep_guards(o, now, status);
  }
  return status;
}

static unsigned predict_guarded($name_state *o, $real u)
{
  unsigned status;
  if (o->held != 0u) {
    return predict_standing(o, u);
  }
  status = predict_$below(o, u * o->told_ratio);
  o->told_ratio = o->gain_ratio;
  return status;
}

static unsigned correct_guarded($name_state *o, $real y)
{
  const $real before[$LEVELS] = {$FOUND};
  unsigned status;
  if ((o->held != 0u) || (o->unsettled != 0u)) {
    return correct_standing(o, y);
  }
  status = correct_$below(o, y);
  keep_guards(o, before, status);
  return status;
}

static unsigned update_guarded($name_state *o, $real y, $real u)
{
  const $real before[$LEVELS] = {$FOUND};
  unsigned status;
  if ((o->held != 0u) || (o->unsettled != 0u)) {
    status = predict_guarded(o, u);
    return status | correct_guarded(o, y);
  }
  status = update_$below(o, y, u * o->told_ratio);
  o->told_ratio = o->gain_ratio;
  keep_guards(o, before, status);
  return status;
}

static $real applied_by_present($name_state *o)
{
  const $real u = o->u_applied * o->input_factor;
  return is_finite(u) ? u : ((u < $ZERO) ? -$LARGEST : $LARGEST);
}

void $name_set_trust($name_state *o, $real trust)
{
  if (is_finite(trust)) {
    o->trust = (trust < $ZERO) ? $ZERO : ((trust < $ONE) ? trust : $ONE);
    set_weights(o);
  }
}

void $name_set_pin($name_state *o, uint8_t where)
{
  if (where > $NAME_PIN_EITHER) {
    return;
  }
  if (where == $NAME_PIN_EITHER) {
    const $real u = applied_by_present(o);
    o->side = (u > $ZERO) ? 1u : ((u < $ZERO) ? 2u : 0u);
  } else if (where != $NAME_PIN_FREE) {
    o->side = where;
  } else {
    /* The side stays until dhat is free. */
  }
  if (where != $NAME_PIN_FREE) {
    o->release_left = 0u;
  } else if (o->pin != $NAME_PIN_FREE) {
    o->release_left = $RELEASEu;
  } else {
    /* It was free. */
  }
  o->pin = where;
  set_weights(o);
}

/* Tells that the plant is held; the u under which it would stand still. */
static $real hold_guards($name_state *o)
{
  $real d = $ZERO;
  $real u;
  o->held = 1u;
  set_weights(o);
  (void)estimate_$ORDER(o, &d);
  u = (-d) * ($INVERSE_GAIN * o->input_factor);
  return is_finite(u) ? u : applied_by_present(o);
}

static void release_guards($name_state *o)
{
  o->held = 0u;
  set_weights(o);
}

)";
/// A changing b0.
inline constexpr const char* c_source_guarded_gain =
    R"(bool $name_set_input_gain($name_state *o, $real b)
{
  const $real ratio = ($B_SIGNb) * $INVERSE_GAIN;
  const $real factor = $ONE / ratio;
  const bool good = is_finite(b) && is_finite(ratio) && is_finite(factor) && (ratio > $ZERO)$SCALES;
  if (good) {
    o->gain_ratio = ratio;
    o->input_factor = factor;
    keep_bound(o);
  }
  return good;
}

)";
/// Of an observer alone.
inline constexpr const char* c_source_guarded_hold =
    R"($real $name_hold($name_state *o)
{
  return hold_guards(o);
}

void $name_release($name_state *o)
{
  release_guards(o);
}

)";
/// One sample of a controller whose plant is held.
inline constexpr const char* c_source_guarded_hold_sample =
    R"($real $name_hold($name_state *o, $real y, $HOLD_R$real u)
{
  unsigned status;
  $real drive;
$PHASE_PLAN$HARDEN  (void)applied(o, u);
  if (o->mode == $NAME_START_HOLD) {
    o->mode = $NAME_RUNNING;
  }
  drive = hold_guards(o);
$PHASE_SKIP  status = update_$top(o, $MEASURED, drive);
  if ((status & $NAME_RESTARTED) != 0u) {
    $REST
  }
$PHASE_AFTER  o->status = (uint8_t)status;
  judge_missing(o);
  release_guards(o);
$ASKED  return o->u_last;
}

)";
/// Its starts.
inline constexpr const char* c_source_guarded_rest =
    R"(static bool rest_guarded($name_state *o, $real y, $real u)
{
  const bool good = $below_rest(o, y, u * o->gain_ratio);
  if (good) {
    settle_guards(o, 0u);
    keep_bound(o);
  }
  return good;
}

)";
inline constexpr const char* c_source_guarded_restart =
    R"(static bool restart_guarded($name_state *o, $real y)
{
  const bool good = $below_restart(o, y);
  if (good) {
    settle_guards(o, 0u);
    keep_bound(o);
  }
  return good;
}

)";

}  // namespace esokit::detail
