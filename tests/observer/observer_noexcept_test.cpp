// Observers and control law without exceptions and RTTI; a plain main, 0 is good.
#include <cmath>
#include <complex>
#include <cstdio>
#include <esokit/control/adrc_law.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>

namespace {

int failures = 0;

void check(bool holds, const char* what) {
  if (holds) return;
  std::printf("failed: %s\n", what);
  ++failures;
}

/// A double integrator under a constant disturbance, brought to 1.
template <class S, class Observer>
void closed_loop(Observer observer, const char* name) {
  const auto law =
      esokit::AdrcLaw<2, S>::make({.controller_bandwidth = S(5), .input_gain = S(2)}).value();
  const S t = S(0.01);
  S y = 0;
  S v = 0;
  S u = 0;
  for (int k = 0; k < 1000; ++k) {
    const S a = S(3) + S(2) * u;
    y += t * v + t * t / 2 * a;
    v += t * a;
    const S measured = k % 50 == 49 ? std::numeric_limits<S>::quiet_NaN() : y;
    const auto status = observer.update(measured, u);
    check(esokit::has(status, esokit::StepStatus::measurement_rejected) == (k % 50 == 49), name);
    u = law.control(observer.estimate(), S(1));
  }
  check(std::abs(y - S(1)) < S(1e-3), name);
  check(std::abs(observer.total_disturbance() - S(3)) < S(1e-2), name);
}

}  // namespace

int main() {
  using esokit::CascadeEso;
  using esokit::LinearEso;
  using esokit::PoleSet;
  closed_loop<double>(
      LinearEso<2>::make({.observer_bandwidth = 50, .input_gain = 2, .sample_time = 0.01}).value(),
      "LinearEso double");
  closed_loop<float>(
      LinearEso<2, float>::make({.observer_bandwidth = 50, .input_gain = 2, .sample_time = 0.01f})
          .value(),
      "LinearEso float");
  closed_loop<float>(
      CascadeEso<2, 2, float>::make(
          {.observer_bandwidth = 30, .bandwidth_factor = 2, .input_gain = 2, .sample_time = 0.01f})
          .value(),
      "CascadeEso float");
  const std::complex<double> pole(-40, 10);
  closed_loop<double>(
      LinearEso<2, double, 1, PoleSet>::make(
          {.poles = {pole, std::conj(pole), -50.0}, .input_gain = 2, .sample_time = 0.01})
          .value(),
      "LinearEso by poles");

  const auto refused =
      LinearEso<2>::make({.observer_bandwidth = -1, .input_gain = 2, .sample_time = 1});
  check(!refused && refused.error().value == -1, "refused config");
  return failures == 0 ? 0 : 1;
}
