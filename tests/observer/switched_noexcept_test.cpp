// The observers that change their gain, without exceptions and run-time type information.
#include <cmath>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>

template <class S>
int run() {
  const auto made = esokit::AdjustableBandwidthEso<2, S>::make({.observer_bandwidth = S(40),
                                                                .bandwidth_ratio = S(0.75),
                                                                .input_gain = S(1),
                                                                .sample_time = S(0.0078125)});
  const auto nonlinear = esokit::NonlinearEso<2, S>::make(
      {.observer_bandwidth = S(20),
       .shape = {.gain_alpha = S(0.5), .alpha = S(0.5), .gain_beta = S(0.5), .beta = S(1)},
       .input_gain = S(1),
       .sample_time = S(0.0078125)});
  auto td =
      esokit::TrackingDifferentiator<S>::make({.acceleration = S(20), .sample_time = S(0.0078125)});
  const auto law = esokit::NonlinearFeedback<2, S>::make(
      {.gains = {S(4), S(4)}, .exponents = {S(0.75), S(1)}, .input_gain = S(1)});
  if (!made || !nonlinear || !td || !law) return 1;
  static_assert(noexcept(made->estimate()));
  auto a = *made;
  auto b = *nonlinear;
  static_assert(noexcept(a.update(S(0), S(0)))&& noexcept(b.update(S(0), S(0))));
  S u(0);
  for (int k = 0; k < 2000; ++k) {
    td->update(S(1));
    (void)a.update(S(1), u);
    (void)b.update(S(1), u);
    u = law->control(a.estimate(), td->state());
    u = S(0);
  }
  return std::abs(a.estimate()(0) - S(1)) < S(1e-3) && std::abs(b.estimate()(0) - S(1)) < S(1e-3)
             ? 0
             : 1;
}

int main() { return run<double>() + run<float>(); }
