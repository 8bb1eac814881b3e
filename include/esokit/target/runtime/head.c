#ifdef __cplusplus
R"esokit("
#endif
/* Written by esokit from a finished design; do not edit. */
#include DESIGN_HEADER

#include <math.h>
#include <stdbool.h>
#include <string.h>

/* Deviations from MISRA C:2012: is_finite looks at the bits of a number by memcpy (21.15), as no
 * test of its value holds under -ffast-math. Functions leave early where a sample is refused (15.5,
 * advisory). A header has macros that its source may not need (2.5, advisory). */

DESIGN_CONSTANTS
/* By its bits, so that it holds under -ffast-math, too. */
static bool is_finite(real x)
{
#ifdef __FRAMAC__ /* a prover cannot follow bits; it knows the same by the name of the standard */
  return isfinite(x) != 0;
#else
#if ESOKIT_SINGLE
  const uint32_t exponent = 0x7f800000u;
  uint32_t bits;
#else
  const uint64_t exponent = 0x7ff0000000000000u;
  uint64_t bits;
#endif
  (void)memcpy(&bits, &x, sizeof bits);
  return (bits & exponent) != exponent;
#endif
}

#ifdef __cplusplus
")esokit"
#endif
