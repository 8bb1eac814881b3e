#ifdef __cplusplus
R"esokit("
#endif
/* Loses no small change. */
static void add(esokit_sum *total, real change)
{
  total->rest = total->rest + change;
  if (fabs(total->rest) <= (DIGITS * fabs(total->whole))) {
    return;
  }
  const real next = total->whole + total->rest;
  const real taken = next - total->whole;
  total->rest = (total->whole - (next - taken)) + (total->rest - taken);
  total->whole = next;
}

#ifdef __cplusplus
")esokit"
#endif
