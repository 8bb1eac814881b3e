// One measurement that is no number, under -ffast-math: an observer written by hand that asks
// std::isnan, which that flag takes out, and ours, which looks at the bits.
//
// Way: sampled; this file alone is compiled with -ffast-math.
//
// Plant       y'' = d + b u, b = 200, d = 20, T = 1 ms
// Controller  omega_o = 150, omega_c = 30 rad/s

#include <bit>
#include <cstdint>

#include "guards/guards.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace guards;

namespace {

constexpr double T = 1e-3;

/// A NaN that the compiler does not see.
double no_number() {
  const volatile std::uint64_t bits = 0x7ff8000000000000u;
  return std::bit_cast<double>(std::uint64_t{bits});
}

struct Run {
  Trace trace;
  double bad_samples = 0;  ///< whose u is no number
};

template <class Step>
Run run(Step&& step) {
  Run run;
  double y = 0;
  double speed = 0;
  for (int k = 0; k < 1000; ++k) {
    double u = step(k == 300 ? no_number() : y);
    const bool good = is_finite(u);
    // What a motor does with no number is another story: here it is off.
    if (!good) u = 0;
    run.bad_samples += good ? 0 : 1;
    run.trace.add(k * T, y, u, 0);
    const double push = 200 * u + 20;
    y += T * speed + T * T / 2 * push;
    speed += T * push;
  }
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "guards", "fast_math",
                about("A measurement that is NaN",
                      "A hand-written observer and esokit, both compiled with -ffast-math."));
  double z0 = 0, z1 = 0, z2 = 0, held = 0;
  const Run bare = run([&](double y) {
    constexpr double w = 150;
    double e = y - z0;
    if (std::isnan(y)) e = 0;
    z0 += T * (z1 + 3 * w * e);
    z1 += T * (z2 + 200 * held + 3 * w * w * e);
    z2 += T * w * w * w * e;
    held = std::clamp((900 * (0.1 - z0) - 60 * z1 - z2) / 200, -1.0, 1.0);
    return held;
  });
  auto loop = Adrc<LinearEso<2>>::make(
                  {.observer = {.observer_bandwidth = 150, .input_gain = 200, .sample_time = T},
                   .controller_bandwidth = 30,
                   .limits = {.lower = -1, .upper = 1}})
                  .value();
  const Run ours = run([&](double y) { return loop.update(y, 0.1); });
  const std::string name = "NaN under -ffast-math";
  const double away = std::abs(bare.trace.y.back() - 0.1);
  report.expect(name, "error at the end, by hand with std::isnan", away, away > 0.1, "lost");
  report.expect(name, "samples whose u is no number, esokit", ours.bad_samples,
                ours.bad_samples < 0.5, "none");
  const double off = std::abs(ours.trace.y.back() - 0.1);
  report.expect(name, "error at the end, esokit", off, off < 1e-6, "none");
  Figure figure("fast_math", {.rows = 1, .columns = 1, .panel_height = 220});
  figure.caption(
      "One measurement of 1000 is NaN, at 0.3 s. The compiler removes std::isnan, and the "
      "hand-written observer never recovers; for esokit it is a missing sample.");
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("y (-)")
      .y_range(-0.05, 0.5)
      .legend(Legend::above)
      .line(bare.trace.t, bare.trace.y, {.name = "by hand", .color = Color::vermillion})
      .line(ours.trace.t, ours.trace.y, {.name = "esokit", .color = Color::blue});
  report.add(figure);
  return report.finish();
}
