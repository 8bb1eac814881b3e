#ifdef __cplusplus
R"esokit("
#endif
static unsigned predict_outside(esokit_state *o, real u)
{
#if ESOKIT_DELAYED || ESOKIT_KNOWN
  real acting = u;
  const unsigned taken = take_input(o, &acting);
  const unsigned status = taken | predict_core(o, acting);
#else
  const unsigned status = predict_core(o, u);
#endif
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
#if ESOKIT_DELAYED || ESOKIT_KNOWN
  real acting = u;
  const unsigned taken = take_input(o, &acting);
#elif ESOKIT_WRAPPED
  const real acting = u;
  const unsigned taken = 0u;
#endif
#if ESOKIT_WRAPPED
  const angle_reading reading = choose_angle(o, y, (uint32_t)o->gap + 1u);
  if (reading.counted) {
    return taken |
      keep_angle(o, &reading, update_core(o, reading.y + (reading.turns * PERIOD), acting));
  }
  const unsigned predicted = predict_core(o, acting);
  recentre(o);
  return taken | predicted | correct_outside(o, y);
#elif ESOKIT_DELAYED || ESOKIT_KNOWN
  return taken | update_core(o, y, acting);
#else
  return update_core(o, y, u);
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
