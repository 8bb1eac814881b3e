// A user's program that calls what is compiled once: a log of a plant, and its b0 in the interval
// that identify finds.
#include <cmath>
#include <cstdio>
#include <esokit/identify/identify.hpp>

#if !defined(ESOKIT_COMPILED) || defined(ESOKIT_HEADER_ONLY)
#error "the definitions come with the headers"
#endif

int main() {
  esokit::Log log;
  log.sample_time = 0.01;
  double y = 0.0, speed = 0.0;
  unsigned random = 1;
  const auto uniform = [&random] {
    random = 1664525U * random + 1013904223U;
    return 2.0 * (random >> 8) / 16777216.0 - 1.0;
  };
  double u = 0.0;
  for (int k = 0; k < 4000; ++k) {
    if (k % 25 == 0) u = uniform();
    log.u.push_back(u);
    log.y.push_back(y + 1e-4 * uniform());
    y += log.sample_time * speed + 0.5 * log.sample_time * log.sample_time * 5.0 * u;
    speed += log.sample_time * 5.0 * u;
  }
  const auto found = esokit::identify(log);
  if (!found) {
    std::fprintf(stderr, "%s: %s\n", found.error().field, found.error().rule);
    return 1;
  }
  return std::abs(found->input_gain.value - 5.0) <= found->input_gain.half_width ? 0 : 1;
}
