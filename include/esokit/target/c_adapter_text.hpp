/// @file
/// What to_c writes of adapters around the recorded lists, as text of C.
#pragma once

#include <esokit/core/language.hpp>

// Each layer calls the one below. Words with a dollar are filled in.
namespace esokit::detail {

/// Measured around it.
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

static $real effect_of_w(const $name_state *o)
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
  (void)course_of_w(o, &passed);
  o->w_lagged = passed;
  if ((o->w_is_new != 0u) && takes_w(o->w_given)) {
    o->w_last = o->w_given;
    o->w_lost = 0u;
  } else if (o->w_lost <= 65535u) {
    o->w_lost = o->w_lost + 1u;
  } else {
    /* It has been lost for long. */
  }
  o->w_is_new = 0u;
  o->newest_w = after_w(o->newest_w);
  o->w[o->newest_w] = (o->w_lost > $W_MOSTu) ? $ZERO : o->w_last;
  now = effect_of_w(o);
  more = now - o->w_told;
  if (((more < $ZERO) || (more > $ZERO)) && load(o, more)) {
    o->w_told = now;
  }
  return status;
}

void $name_measured($name_state *o, $real w)
{
  o->w_given = $W_SIGNw;
  o->w_is_new = 1u;
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
  o->w_told = effect_of_w(o);
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
} angle_reading;

static $real wrapped($real angle)
{
  return ($fabs(angle) <= $HALF) ? angle : (angle - ($PERIOD * $round(angle * $INVERSE)));
}

static bool can_be_told($real y)
{
  const $real turns = y * $INVERSE;
  return is_finite(turns) && ($fabs(turns) < $MOST_TURNS);
}

static void forget_turns($name_state *o)
{
  o->angle = $ZERO;
  o->turns = $ZERO;
  o->motion = $ZERO;
  o->motion_samples = 65535u;
  o->gaps = 0u;
  o->doubts = 0u;
  o->begun = 0u;
}

static bool restart_wrapped($name_state *o, $real y)
{
  const bool good = can_be_told(y) && restart(o, wrapped(y));
  if (good) {
    forget_turns(o);
  }
  return good;
}

static $real expected_motion(const $name_state *o, uint32_t samples)
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

static angle_reading read_angle(const $name_state *o, $real y, uint32_t samples)
{
  angle_reading reading = {$ZERO, $ZERO, $ZERO, 0u, false, true, false};
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
      o->turns = o->turns - turns;
    }
  }
}

static void learn_motion($name_state *o, const angle_reading *reading)
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

/* After the correction. */
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

static unsigned predict_wrapped($name_state *o, $real u)
{
  const unsigned status = predict_$below(o, u);
  recentre(o);
  return status;
}

static unsigned correct_wrapped($name_state *o, $real y)
{
  angle_reading reading = read_angle(o, y, o->gap);
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
  const angle_reading reading = read_angle(o, y, (uint32_t)o->gap + 1u);
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

/* After a correction; before: what each level had found until then. */
static void keep_guards($name_state *o, const $real before[$LEVELS], unsigned status)
{
  const bool gated = o->trust < $ONE;
  if (gated && ((status & $NAME_RESTARTED) == 0u)) {
$TRUST  }
  if (($LEAKS) && ((status & $REFUSED) == 0u)) {
$LEAK  }
  keep_bound(o);
}

static unsigned update_guarded($name_state *o, $real y, $real u)
{
  const $real before[$LEVELS] = {$FOUND};
  const unsigned status = update_$below(o, y, u);
  keep_guards(o, before, status);
  return status;
}

void $name_set_trust($name_state *o, $real trust)
{
  if (is_finite(trust)) {
    o->trust = (trust < $ZERO) ? $ZERO : ((trust < $ONE) ? trust : $ONE);
  }
}

)";
/// Of an observer alone, too.
inline constexpr const char* c_source_guarded_correct =
    R"(static unsigned correct_guarded($name_state *o, $real y)
{
  const $real before[$LEVELS] = {$FOUND};
  const unsigned status = correct_$below(o, y);
  keep_guards(o, before, status);
  return status;
}

)";
/// Its starts.
inline constexpr const char* c_source_guarded_rest =
    R"(static bool rest_guarded($name_state *o, $real y, $real u)
{
  const bool good = $below_rest(o, y, u);
  if (good) {
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
    keep_bound(o);
  }
  return good;
}

)";

}  // namespace esokit::detail
