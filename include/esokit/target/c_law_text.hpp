/// @file
/// What to_c writes of gains that go on at each sample around the recorded lists, as text of C.
#pragma once

#include <esokit/core/language.hpp>

// Each layer calls the one below. Words with a dollar are filled in.
namespace esokit::detail {

/// The schedule of AlgebraicEso.
inline constexpr const char* c_source_schedule = R"(/* ---- The schedule of the gain. */

static void law_begin($name_state *o)
{
  o->age = 0u;
  o->pending = 0u;
  o->settled = 0u;
}

/* Of that sample, from its number: no error of rounding adds up. */
static void schedule_anchor($name_state *o, uint32_t count)
{
  $real power = $DECAY;
  $real contraction = $SHIFT;
  uint32_t rest = count;
  (void)anchor_begin(o);
  while (rest != 0u) {
    if ((rest & 1u) != 0u) {
      (void)anchor_take(o, power, contraction);
    }
    (void)anchor_contraction(o, power, contraction, &contraction);
    (void)anchor_power(o, power, contraction, &power);
    rest >>= 1u;
  }
  (void)anchor_end(o, ($real)count);
}

static void law_advance($name_state *o)
{
  if (o->settled != 0u) {
    return;
  }
  if ((o->pending != 0u) && (($STARTu + o->age) <= $STATESu)) {
    (void)schedule_restart(o);
    law_begin(o);
  }
  o->pending = 1u;
  if (o->age < 0x3fffffffu) {
    o->age = o->age + 1u;
  }
  if (($STARTu + o->age) <= $STATESu) {
    return; /* the estimate is exact in so few samples: it stays so */
  }
  if ((o->age % 256u) == 0u) {
    schedule_anchor(o, ($STARTu + o->age) - 1u);
  }
  (void)schedule_next(o);
  if ((o->age > $LEASTu) && schedule_settle(o)) {
    o->settled = 1u;
  }
}

/* The poles of now over so many samples. */
static $real poles_over(const $name_state *o, uint32_t samples)
{
  $real base = $ONE;
  $real all = $ZERO;
  uint32_t rest = samples;
  if (o->settled != 0u) {
    base = $CONTRACTION;
  } else if (($STARTu + o->age) > $STATESu) {
    (void)present_poles(o, &base);
  } else {
    /* All at zero. */
  }
  while (rest != 0u) {
    if ((rest & 1u) != 0u) {
      (void)joined_poles(o, all, base, &all);
    }
    (void)joined_poles(o, base, base, &base);
    rest >>= 1u;
  }
  return all;
}

/* The gain of so many samples at once. */
static bool correct_over($name_state *o, $real y, uint32_t samples)
{
  const $real poles = poles_over(o, samples);
  return correct_long(o, y, poles, ($real)samples);
}

)";

/// The recursion of ExtendedStateFilter.
inline constexpr const char* c_source_filter = R"(/* ---- The recursion of the gain. */

static void law_begin($name_state *o)
{
  o->since = $LAW_STANDSu;
}

/* since: 1 corrected, 2 nothing yet, 4 missed twice, 8 the gain stands. */
static void law_advance($name_state *o)
{
  const uint8_t before = o->since;
  if (before > 8u) {
    o->since = 8u;
    return;
  }
  if ((before & 1u) != 0u) {
    o->since = 0u;
    (void)filter_corrected(o);
  } else {
    o->since = 4u;
    if (!((before == 4u) && filter_at_ceiling(o))) {
      (void)filter_missed(o);
    }
  }
$TO_LIMIT}

)";

/// A gain that goes on before each sample.
inline constexpr const char* c_source_running =
    R"(static unsigned predict_running($name_state *o, $real u)
{
  law_advance(o);
  return predict_base(o, u);
}

)";
inline constexpr const char* c_source_running_update =
    R"(static unsigned update_running($name_state *o, $real y, $real u)
{
  law_advance(o);
  return update_base(o, y, u);
}

)";

/// The gate of ExtendedStateFilter.
inline constexpr const char* c_source_watched =
    R"(static bool accepted(const $name_state *o, $real y)
{
  const $real innovation = y - o->$FIRST;
  return (o->gap > $ROWSu) || !is_finite(innovation) || fits(o, y);
}

static unsigned correct_watched($name_state *o, $real y)
{
  unsigned status = $NAME_OUTLIER_REJECTED;
  if (accepted(o, y)) {
    status = correct_base(o, y);
  }
  return status;
}

)";
inline constexpr const char* c_source_watched_update =
    R"(static unsigned update_watched($name_state *o, $real y, $real u)
{
  const unsigned status = predict_$below(o, u);
  return status | correct_watched(o, y);
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

}  // namespace esokit::detail
