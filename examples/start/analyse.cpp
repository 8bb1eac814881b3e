// What control.cpp runs, before it runs: margins, delay, noise.
#include <cstdio>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>

#include "servo.hpp"

int main() {
  const auto margins = esokit::margins(servo(), controller());
  const auto delay = esokit::delay_margin(servo(), controller());
  const auto noise = esokit::noise(servo(), controller(), {.measurement = {1e-4}});
  if (!margins || !delay || !noise)
    return 1;  // a loop that is not stable has none: error() says so

  std::printf("gain may rise %.2f times or fall to %.3f times\n", margins->gain_increase.value,
              margins->gain_decrease.value);
  std::printf("phase margin %.0f degrees, peak of sensitivity %.2f\n",
              margins->phase.value * 180.0 / 3.14159265358979, 1.0 / margins->modulus.value);
  std::printf("%.1f ms of delay may be added\n", 1e3 * delay->value);
  std::printf("noise of 1e-4 rad moves u by %.3f V, the angle by %.1e rad\n", noise->control[0],
              noise->output[0]);
  return margins->gain_increase.value > 2.0 ? 0 : 1;
}
