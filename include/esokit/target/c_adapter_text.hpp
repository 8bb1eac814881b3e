/// @file
/// What to_c writes of a delay, a gate and of what is measured or known around the recorded lists,
/// as text of C.
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

}  // namespace esokit::detail
