#ifdef __cplusplus
R"esokit("
#endif
#if ESOKIT_MAPPED
/* ---- The curve of the actuator: straight lines, within the points where they meet. */

static real on_curve(real x, bool back)
{
  static const real ends[2][MAP_POINTS] = { /* u, and its effect */
    DESIGN_MAP_ENDS
  };
  static const real lines[MAP_LINES][3] = { /* offset, slope and its inverse */
    DESIGN_MAP_LINES
  };
  unsigned from = 0u;
  unsigned to = 1u;
  unsigned line = 0u;
  unsigned i;
  real y;
  if (back) {
    from = 1u;
    to = 0u;
  }
  for (i = 0u; i < MAP_POINTS; ++i) {
    if (ends[from][i] <= x) {
      line = i + 1u;
    }
  }
  if (back) {
    y = (x - lines[line][0]) * lines[line][2];
  } else {
    y = lines[line][0] + (x * lines[line][1]);
  }
  if (line > 0u) {
    if (y < ends[to][line - 1u]) {
      y = ends[to][line - 1u];
    }
  }
  if (line < MAP_POINTS) {
    if (ends[to][line] < y) {
      y = ends[to][line];
    }
  }
  return y;
}

real esokit_effect_of(real u)
{
  return on_curve(u, false);
}

real esokit_input_for(real effect)
{
  return on_curve(effect, true);
}

#endif
#ifdef __cplusplus
")esokit"
#endif
