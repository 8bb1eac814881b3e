#ifdef __cplusplus
R"esokit("
#endif
/* Loses no small change. */
static void add(esokit_sum *total, real change)
{
  real next;
  real taken;
  total->rest = total->rest + change;
  if (fabs(total->rest) <= (DIGITS * fabs(total->whole))) {
    return;
  }
  next = total->whole + total->rest;
  taken = next - total->whole;
  total->rest = (total->whole - (next - taken)) + (total->rest - taken);
  total->whole = next;
}

#ifdef __cplusplus
")esokit"
#endif
