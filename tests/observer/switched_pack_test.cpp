// AdjustableBandwidthEso and NonlinearEso on a SIMD pack: every lane does what a scalar does. And
// `make` allocates nothing.
#include <support/no_allocation.hpp>
//
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <support/numbers.hpp>
#include <support/pack.hpp>

namespace esokit_test {

template <class T, int Width>
Pack<T, Width> pow(const Pack<T, Width>& x, const Pack<T, Width>& p) {
  Pack<T, Width> result;
  for (std::size_t i = 0; i < Width; ++i) result[i] = std::pow(x[i], p[i]);
  return result;
}

template <class T, int Width>
Pack<T, Width> sqrt(const Pack<T, Width>& x) {
  Pack<T, Width> result;
  for (std::size_t i = 0; i < Width; ++i) result[i] = std::sqrt(x[i]);
  return result;
}

namespace {

using P = Pack<double, 4>;

P lanes(double a, double b, double c, double d) { return P(std::array<double, 4>{a, b, c, d}); }

template <class PackObserver, class Observer>
void lanes_agree(PackObserver pack, std::array<Observer, 4> scalars) {
  Random random(5);
  for (int k = 0; k < 300; ++k) {
    P y;
    P u;
    for (std::size_t i = 0; i < 4; ++i) {
      y[i] = random.uniform(-1, 1);
      u[i] = random.uniform(-1, 1);
    }
    if (k % 40 == 17) {
      pack.predict(u);
      for (std::size_t i = 0; i < 4; ++i) scalars[i].predict(u[i]);
    } else {
      pack.update(y, u);
      for (std::size_t i = 0; i < 4; ++i) scalars[i].update(y[i], u[i]);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      for (int r = 0; r < Observer::size; ++r) {
        const double expected = scalars[i].estimate()(r);
        ASSERT_NEAR(pack.estimate()(r)[i], expected, 1e-12 * std::abs(expected) + 1e-12)
            << "sample " << k << ", lane " << i;
      }
    }
  }
}

TEST(AdjustableBandwidthEso, PackLanesAgreeWithScalars) {
  const P bandwidth = lanes(10, 20, 40, 60);
  const P ratio = lanes(0.5, 0.7, 1.0, 1.4);
  for (const auto rule : {esokit::SwitchingRule::abeso, esokit::SwitchingRule::beso}) {
    const P used = rule == esokit::SwitchingRule::beso ? lanes(0.7, 0.8, 1.0, 1.3) : ratio;
    const auto pack = esokit::AdjustableBandwidthEso<2, P>::make({.observer_bandwidth = bandwidth,
                                                                  .bandwidth_ratio = used,
                                                                  .rule = rule,
                                                                  .input_gain = P(2.0),
                                                                  .sample_time = P(0.01)})
                          .value();
    const auto scalar = [&](std::size_t i) {
      return esokit::AdjustableBandwidthEso<2>::make({.observer_bandwidth = bandwidth[i],
                                                      .bandwidth_ratio = used[i],
                                                      .rule = rule,
                                                      .input_gain = 2,
                                                      .sample_time = 0.01})
          .value();
    };
    lanes_agree(pack, std::array{scalar(0), scalar(1), scalar(2), scalar(3)});
  }
  // One lane without the certificate refuses the pack.
  EXPECT_FALSE(
      (esokit::AdjustableBandwidthEso<2, P>::make({.observer_bandwidth = bandwidth,
                                                   .bandwidth_ratio = lanes(0.5, 0.7, 0.2, 1.0),
                                                   .input_gain = P(2.0),
                                                   .sample_time = P(0.01)})
           .has_value()));
}

TEST(NonlinearEso, PackLanesAgreeWithScalars) {
  const P bandwidth = lanes(10, 20, 30, 40);
  const esokit::PowerSumGain<P> shape{.gain_alpha = P(0.6),
                                      .alpha = lanes(0.25, 0.5, 1.0, 1.5),
                                      .gain_beta = lanes(0.1, 0.2, 0.3, 0.4),
                                      .beta = P(0.5)};
  const auto pack = esokit::NonlinearEso<2, P>::make({.observer_bandwidth = bandwidth,
                                                      .shape = shape,
                                                      .error_scale = P(0.5),
                                                      .gain_min = P(0.55),
                                                      .gain_max = P(1.7),
                                                      .input_gain = P(2.0),
                                                      .sample_time = P(0.01)})
                        .value();
  const auto scalar = [&](std::size_t i) {
    return esokit::NonlinearEso<2>::make({.observer_bandwidth = bandwidth[i],
                                          .shape = {.gain_alpha = 0.6,
                                                    .alpha = shape.alpha[i],
                                                    .gain_beta = shape.gain_beta[i],
                                                    .beta = 0.5},
                                          .error_scale = 0.5,
                                          .gain_min = 0.55,
                                          .gain_max = 1.7,
                                          .input_gain = 2,
                                          .sample_time = 0.01})
        .value();
  };
  lanes_agree(pack, std::array{scalar(0), scalar(1), scalar(2), scalar(3)});
  // Default limits are certified in every lane.
  const auto by_default = esokit::NonlinearEso<2, P>::make({.observer_bandwidth = bandwidth,
                                                            .shape = shape,
                                                            .input_gain = P(2.0),
                                                            .sample_time = P(0.01)})
                              .value();
  for (std::size_t i = 0; i < 4; ++i) {
    const auto gain = esokit::current_gain<4, double>(
        esokit::EqualSampledPoles<4, double>::from_bandwidth(bandwidth[i], 0.01).weights());
    EXPECT_LT(by_default.gain_min()[i], 1);
    EXPECT_GT(by_default.gain_max()[i], 1);
    EXPECT_TRUE((esokit::gain_range_certified<4, double>(gain, by_default.gain_min()[i],
                                                         by_default.gain_max()[i])));
  }
}

TEST(SwitchedObservers, MakeAllocatesNothing) {
  bool made = true;
  long count = -1;
  {
    const NoAllocation guard;
    made = esokit::AdjustableBandwidthEso<2>::make({.observer_bandwidth = 50,
                                                    .bandwidth_ratio = 0.7,
                                                    .rule = esokit::SwitchingRule::beso,
                                                    .input_gain = 1,
                                                    .sample_time = 0.01})
               .has_value();
    made = made && esokit::NonlinearEso<6, float>::make(
                       {.observer_bandwidth = 50, .input_gain = 1, .sample_time = 0.01f})
                       .has_value();
    made = made && esokit::NonlinearEso<2>::report(
                       {.observer_bandwidth = 50, .input_gain = 1, .sample_time = 0.01})
                       .has_value();
    count = guard.count();
  }
  EXPECT_TRUE(made);
  EXPECT_EQ(count, 0);
}

}  // namespace
}  // namespace esokit_test
