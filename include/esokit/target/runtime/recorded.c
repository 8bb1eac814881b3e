#ifdef __cplusplus
R"esokit("
#endif
/* ---- Recorded from the design: false if a result would not be finite; then nothing has changed. */

#if ESOKIT_SETTINGS
DESIGN_SET_OF_SETTINGS
#endif
DESIGN_LISTS
#if ESOKIT_TABLE && !ESOKIT_SETTINGS && ESOKIT_GUARDED || ESOKIT_TABLE && ESOKIT_PREDICTIVE
static const real gains[ROWS][GAINS] = { /* after 1, 2, .. samples */
  DESIGN_GAINS
};

#endif
#ifdef __cplusplus
")esokit"
#endif
