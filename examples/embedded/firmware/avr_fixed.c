/* Cycles of an update in integers on an ATmega328P, by its timer, and the self-tests; out by the serial
 * port. run.sh runs it in simavr.
 *
 *   count NAME cycles
 *   done
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <eso_fixed.h>
#include <eso_fixed16.h>
#include <loop_fixed.h>
#include <stdint.h>

static void put(char c)
{
  UDR0 = (uint8_t)c;
  while ((UCSR0A & (1u << UDRE0)) == 0u) {
  }
}

static void text(const char *s)
{
  while (*s != '\0') {
    put(*s++);
  }
}

static void count(const char *name, uint16_t cycles)
{
  char digits[6];
  uint8_t i = 0u;
  text("count ");
  text(name);
  put(' ');
  do {
    digits[i++] = (char)('0' + (cycles % 10u));
    cycles /= 10u;
  } while (cycles != 0u);
  while (i > 0u) {
    put(digits[--i]);
  }
  put('\n');
}

__attribute__((noinline)) static unsigned nothing(void *o, int32_t y, int32_t u)
{
  __asm__ volatile("" ::"r"(o), "r"(y), "r"(u));
  return 0u;
}

#define CYCLES(call) (TCNT1 = 0u, (void)(call), TCNT1)

int main(void)
{
  static eso_fixed_state eso;
  static eso_fixed16_state eso16;
  static loop_fixed_state loop;
  volatile int32_t y = 9;
  volatile int32_t u = 5;
  uint16_t empty;
  uint16_t all = 0u;
  uint8_t i;
  UCSR0B = 1u << TXEN0;
  TCCR1B = 1u;
  eso_fixed_init(&eso);
  eso_fixed16_init(&eso16);
  loop_fixed_init(&loop);
  empty = CYCLES(nothing(&eso, y, u));
  for (i = 0u; i < 10u; ++i) {
    all = CYCLES(eso_fixed_update(&eso, y, u));
  }
  count("eso_fixed", all - empty);
  for (i = 0u; i < 10u; ++i) {
    all = CYCLES(eso_fixed16_update(&eso16, y, u));
  }
  count("eso_fixed16", all - empty);
  for (i = 0u; i < 10u; ++i) {
    all = CYCLES(loop_fixed_update(&loop, y, u));
  }
  count("loop_fixed", all - empty);
  if ((eso_fixed_self_test() == 0) && (eso_fixed16_self_test() == 0) &&
      (loop_fixed_self_test() == 0)) {
    text("done\n");
  }
  cli();
  sleep_enable();
  sleep_cpu();
  return 0;
}
