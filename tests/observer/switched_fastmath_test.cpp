// Bad settings and bad samples of the observers that change their gain, under -ffast-math.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/control/tracking_differentiator.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <support/numbers.hpp>
#include <support/refusal.hpp>

namespace esokit_test {
namespace {

using esokit::StepStatus;

template <class S>
struct BrokenGain {
  S operator()(const S& x) const { return x > S(3) ? hidden_nan<S>() : S(1); }
};

template <class S>
void refuses() {
  using Switched = esokit::AdjustableBandwidthEso<2, S>;
  using Nonlinear = esokit::NonlinearEso<2, S>;
  const S T = static_cast<S>(0.01);
  for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), S(-1), S(0)}) {
    EXPECT_EQ(refusal(Switched::make({.observer_bandwidth = S(50),
                                      .bandwidth_ratio = bad,
                                      .allow_uncertified_switching = true,
                                      .input_gain = S(1),
                                      .sample_time = T})),
              "bandwidth_ratio: must be finite and positive");
    EXPECT_EQ(refusal(Nonlinear::make({.observer_bandwidth = S(50),
                                       .shape = {.alpha = bad},
                                       .input_gain = S(1),
                                       .sample_time = T})),
              "shape.alpha: must be finite and positive");
    EXPECT_EQ(refusal(Nonlinear::make({.observer_bandwidth = S(50),
                                       .gain_max = bad,
                                       .allow_uncertified_gain = true,
                                       .input_gain = S(1),
                                       .sample_time = T})),
              "gain_max: must be finite and positive");
    EXPECT_EQ(refusal(Nonlinear::make({.observer_bandwidth = S(50),
                                       .error_scale = bad,
                                       .input_gain = S(1),
                                       .sample_time = T})),
              "error_scale: must be finite and positive");
  }
  EXPECT_FALSE((esokit::NonlinearEso<2, S, 2, BrokenGain<S>>::make(
                    {.observer_bandwidth = S(50), .input_gain = S(1), .sample_time = T})
                    .has_value()));
  EXPECT_EQ(refusal(Switched::make({.observer_bandwidth = S(50),
                                    .bandwidth_ratio = static_cast<S>(0.3),
                                    .input_gain = S(1),
                                    .sample_time = T})),
            "bandwidth_ratio: must be certified against every switching (or set "
            "allow_uncertified_switching): above");
}

template <class Observer>
void drops_bad_samples(Observer observer) {
  using S = typename Observer::scalar_type;
  for (int k = 0; k < 20; ++k) observer.update(S(1), S(0));
  for (const S bad : {hidden_nan<S>(), hidden_infinity<S>(), huge<S>()}) {
    auto hit = observer;
    auto missing = observer;
    EXPECT_EQ(hit.update(bad, S(1)), StepStatus::measurement_rejected);
    missing.predict(S(1));
    for (int r = 0; r < Observer::size; ++r) {
      EXPECT_TRUE(same_bits(hit.estimate()(r), missing.estimate()(r)));
    }
    EXPECT_EQ(hit.update(S(1), S(1)), StepStatus::gap_bridged);
  }
}

TEST(SwitchedObserversFastMath, RefuseBadSettings) {
  refuses<double>();
  refuses<float>();
}

TEST(SwitchedObserversFastMath, DropBadSamples) {
  drops_bad_samples(esokit::AdjustableBandwidthEso<2, float>::make({.observer_bandwidth = 50,
                                                                    .bandwidth_ratio = 0.75f,
                                                                    .input_gain = 1,
                                                                    .sample_time = 0.01f})
                        .value());
  drops_bad_samples(
      esokit::NonlinearEso<2>::make(
          {.observer_bandwidth = 50,
           .shape = {.gain_alpha = 0.617, .alpha = 0.233, .gain_beta = 0.143, .beta = 0.334},
           .input_gain = 1,
           .sample_time = 0.01})
          .value());
}

TEST(TrackingDifferentiatorFastMath, BadReferenceChangesNothing) {
  auto td = esokit::TrackingDifferentiator<float>::make({.acceleration = 5, .sample_time = 1e-2f})
                .value();
  td.update(1);
  const auto before = td.state();
  EXPECT_FALSE(td.update(hidden_nan<float>()));
  EXPECT_FALSE(td.update(hidden_infinity<float>()));
  EXPECT_EQ(td.state(), before);
}

}  // namespace
}  // namespace esokit_test
