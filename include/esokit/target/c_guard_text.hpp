/// @file
/// What to_c writes of a Guarded around the recorded lists, as text of C.
#pragma once

#include <esokit/core/language.hpp>

// Each layer calls the one below. Words with a dollar are filled in.
namespace esokit::detail {

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
