/// @file
/// What to_c writes of a WrappedOutput around the recorded lists, as text of C.
#pragma once

#include <esokit/core/language.hpp>

// Each layer calls the one below. Words with a dollar are filled in.
namespace esokit::detail {

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

}  // namespace esokit::detail
