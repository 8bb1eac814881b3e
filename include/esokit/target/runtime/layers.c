#ifdef __cplusplus
R"esokit("
#endif
static unsigned predict_outside(esokit_state *o, real u)
{
  real acting = u;
  unsigned status = 0u;
#if ESOKIT_DELAYED || ESOKIT_KNOWN
  status = take_input(o, &acting);
#endif
  status = status | predict_core(o, acting);
#if ESOKIT_WRAPPED
  recentre(o);
#endif
  return status;
}

#if !ESOKIT_CONTROLLER || ESOKIT_GUARDED || ESOKIT_WRAPPED
static unsigned correct_outside(esokit_state *o, real y)
{
#if ESOKIT_WRAPPED
  angle_reading reading = choose_angle(o, y, o->gap);
  if (!reading.usable) {
    return ESOKIT_MEASUREMENT_REJECTED;
  }
  if (reading.fits && !is_finite(reading.turns * PERIOD)) {
    return restart_at_angle(o, reading.y);
  }
  if (!reading.counted) {
    reading.turns = round((o->DESIGN_Y - reading.y) * PER_PERIOD);
  }
  return keep_angle(o, &reading, correct_core(o, reading.y + (reading.turns * PERIOD)));
#else
  return correct_core(o, y);
#endif
}

#endif
#if !ESOKIT_PREDICTIVE
static unsigned update_outside(esokit_state *o, real y, real u)
{
  real acting = u;
  unsigned status = 0u;
#if ESOKIT_WRAPPED
  angle_reading reading;
#endif
#if ESOKIT_DELAYED || ESOKIT_KNOWN
  status = take_input(o, &acting);
#endif
#if ESOKIT_WRAPPED
  reading = choose_angle(o, y, (uint32_t)o->gap + 1u);
  if (reading.counted) {
    return status |
      keep_angle(o, &reading, update_core(o, reading.y + (reading.turns * PERIOD), acting));
  }
  status = status | predict_core(o, acting);
  recentre(o);
  return status | correct_outside(o, y);
#else
  return status | update_core(o, y, acting);
#endif
}

#endif
#if ESOKIT_CONTROLLER || ESOKIT_PREDICTIVE
static bool rest_outside(esokit_state *o, real y, real u)
{
#if ESOKIT_WRAPPED
  bool good = can_be_told(y);
  if (good) {
    good = rest_at(o, y, u, wrapped(y));
  }
#else
  const bool good = rest_at(o, y, u);
#endif
#if ESOKIT_WRAPPED
  if (good) {
    forget_turns(o);
  }
#endif
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
  if (good) {
    law_begin(o);
  }
#endif
  return good;
}

#endif
#ifdef __cplusplus
")esokit"
#endif
