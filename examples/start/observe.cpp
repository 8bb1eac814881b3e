// An observer on a signal: speed and acceleration of a noisy encoder, nothing else known.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <esokit/observer/linear_eso.hpp>

int main() {
  // Two integrations from what moves it to the angle. No input is known: all is disturbance, which
  // is the acceleration then.
  auto observer = esokit::LinearEso<2>::make({.observer_bandwidth = 60.0,  // rad/s: noise or delay
                                              .input_gain = 1.0,
                                              .sample_time = 1e-3});
  if (!observer) return 1;

  double worst = 0.0;
  for (int k = 0; k < 3000; ++k) {
    const double t = 1e-3 * k;
    const double angle = std::sin(2.0 * t);
    const double measured = 1e-4 * std::round(1e4 * angle);  // the encoder's steps
    observer->update(measured, 0.0);                         // y, and the input that was applied

    const double speed = observer->estimate<1>();
    const double acceleration = observer->total_disturbance();
    if (k % 500 == 0) std::printf("%5.2f s  %8.4f rad/s  %8.3f rad/s^2\n", t, speed, acceleration);
    if (t > 0.5) worst = std::max(worst, std::abs(speed - 2.0 * std::cos(2.0 * t)));
  }
  std::printf("speed within %.3f rad/s\n", worst);
  return worst < 0.05 ? 0 : 1;
}
