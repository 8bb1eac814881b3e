// ADRC on a servo within its limits: a step, then a load unknown to the controller.
#include <cmath>
#include <cstdio>
#include <esokit/sim/run.hpp>
#include <fstream>

#include "servo.hpp"

int main(int argc, char** argv) {
  const auto run = esokit::sim::run(servo(), controller(),
                                    {.duration = 2.0,
                                     .reference = 1.0,
                                     .disturbance = [](double t) { return t < 1.0 ? 0.0 : -60.0; },
                                     .noise = 1e-4});
  if (!run) {  // which setting, which value, which rule
    std::fprintf(stderr, "%s: %s\n", run.error().field, run.error().rule);
    return 1;
  }
  for (std::size_t k = 0; k < run->t.size(); k += 200) {
    std::printf("%4.1f s  angle %7.4f  u %7.3f V  load found %7.2f\n", run->t[k], run->output[k],
                run->input[k], run->total_disturbance[k]);
  }
  if (argc > 1) std::ofstream(argv[1]) << run->csv();  // to draw it
  return std::abs(run->output.back() - 1.0) < 5e-3 ? 0 : 1;
}
