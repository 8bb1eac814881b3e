#ifdef __cplusplus
R"esokit("
#endif
/* The observer without what is around y and u. */
static unsigned predict_core(esokit_state *o, real u)
{
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
  law_advance(o);
#endif
#if ESOKIT_MEASURED
  const unsigned status = predict_plain(o, u);
  advance_measured(o);
  return status;
#else
  return predict_plain(o, u);
#endif
}

#if ESOKIT_GATED || ESOKIT_WATCHED || ESOKIT_MEASURED || !ESOKIT_CONTROLLER || ESOKIT_GUARDED || ESOKIT_WRAPPED
static unsigned correct_core(esokit_state *o, real y)
{
#if ESOKIT_GATED || ESOKIT_WATCHED
  if (!gate_lets_in(o, y)) {
    return ESOKIT_OUTLIER_REJECTED;
  }
#endif
  return correct_plain(o, y);
}

#endif
#if !ESOKIT_PREDICTIVE
static unsigned update_core(esokit_state *o, real y, real u)
{
#if ESOKIT_GATED || ESOKIT_WATCHED || ESOKIT_MEASURED
  const unsigned status = predict_core(o, u);
  return status | correct_core(o, y);
#else
  bool done = false;
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
  law_advance(o);
#endif
#if ESOKIT_RECOVERS
  if ((o->gap == 0u) && (o->due == 0u)) {
#else
  if (o->gap == 0u) {
#endif
    done = observe(o, y, u);
  }
  if (done) {
#if ESOKIT_SCHEDULE || ESOKIT_FILTER
    law_accept(o);
#endif
    return 0u;
  }
  const unsigned status = predict_plain(o, u);
  return status | correct_plain(o, y);
#endif
}

#endif

#if ESOKIT_DELAYED
/* The u that acts now, for one that acts later. */
static unsigned push_delayed(esokit_state *o, real *u)
{
  const real last = o->line[o->newest];
  const bool good = is_finite(*u);
  o->newest = next_place(o->newest, DELAY);
  o->line[o->newest] = good ? *u : last;
  *u = o->line[next_place(o->newest, DELAY)];
  return good ? 0u : ESOKIT_INPUT_REJECTED;
}

#if ESOKIT_CONTROLLER
static void fill_delayed(esokit_state *o, real u)
{
  unsigned i;
  for (i = 0u; i <= DELAY; ++i) {
    o->line[i] = u;
  }
}

#endif
#endif
#if ESOKIT_DELAYED || ESOKIT_KNOWN
/* The u that the observer is given. */
static unsigned take_input(esokit_state *o, real *u)
{
  unsigned status = 0u;
#if ESOKIT_DELAYED
  status = push_delayed(o, u);
#endif
#if ESOKIT_KNOWN
  if (!is_finite(*u)) {
    status = status | ESOKIT_INPUT_REJECTED;
  }
  *u = drive(o, *u); /* the known part of the motion acts like a u of its own */
#endif
  return status;
}

#endif
#ifdef __cplusplus
")esokit"
#endif
