// T and b0 come back as they were given, bit for bit.
#include <gtest/gtest.h>

#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc_law.hpp>
#include <esokit/control/nonlinear_feedback.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <support/friction.hpp>
#include <support/numbers.hpp>

namespace observer_given_values_test {

using esokit::chain_config;
using esokit_test::Random;

template <class Config, class S>
void set_dynamics(Config& config, const S& bandwidth) {
  if constexpr (requires { config.observer; }) {
    set_dynamics(config.observer, bandwidth);
    if constexpr (requires { config.period; }) config.period = S(360);
  } else if constexpr (requires { config.level_bandwidths; }) {
    config.level_bandwidths = {bandwidth, 2 * bandwidth};
  } else if constexpr (requires { config.measurement_variance; }) {
    config.measurement_variance = S(1);
    config.inflation = S(1);
    config.disturbance_bounds = {S(0.1), S(0.1), S(0.1)};
  } else if constexpr (requires { config.observer_bandwidth; }) {
    config.observer_bandwidth = bandwidth;
  }
}

template <class Observer>
class GivenValues : public ::testing::Test {};
// Each observer in one scalar, in float where that differs most.
using Observers = ::testing::Types<
    esokit::LinearEso<2, float>, esokit::CascadeEso<2, 2>, esokit::HalfGainEso<2>,
    esokit::ReducedOrderEso<2>, esokit::AdjustableBandwidthEso<2, float>,
    esokit::ExtendedStateFilter<2, float>, esokit::AlgebraicEso<2, float>, esokit::NonlinearEso<2>,
    esokit::DelayedInput<esokit::LinearEso<2>, 3>,
    esokit::WrappedOutput<esokit::LinearEso<2, float>>, esokit::VariableTime<esokit::LinearEso<2>>,
    esokit::KnownModel<esokit::NonlinearEso<2, float>, esokit_test::Friction<1, float>>,
    esokit::OutlierGate<esokit::AlgebraicEso<2>>>;
TYPED_TEST_SUITE(GivenValues, Observers);

TYPED_TEST(GivenValues, OfTheConfigAndOfARetune) {
  using Config = typename TypeParam::Config;
  using S = typename TypeParam::scalar_type;
  Random random(15);
  const auto next = [&] {
    Config config{};
    auto& chain = chain_config<TypeParam>(config);
    chain.sample_time = static_cast<S>(random.log_uniform(1e-5, 1e-1));
    chain.input_gain =
        static_cast<S>(random.log_uniform(1e-3, 1e3) * (random.index(2) == 0 ? 1 : -1));
    set_dynamics(config, S(S(0.1) / chain.sample_time));
    return config;
  };
  const auto gives_back = [](const TypeParam& observer, const Config& config) {
    return observer.sample_time() == chain_config<TypeParam>(config).sample_time &&
           observer.input_gain() == chain_config<TypeParam>(config).input_gain;
  };
  for (int i = 0; i < 300; ++i) {
    const Config config = next();
    auto observer = TypeParam::make(config);
    ASSERT_TRUE(observer && gives_back(*observer, config)) << i;
    const Config other = next();
    ASSERT_TRUE(observer->retune(other) && gives_back(*observer, other)) << i;
  }
}

/// The same for every observer, so that one can be put in another's place.
template <class... Each>
void gaps_are_bridged_up_to_a_hundred_samples(::testing::Types<Each...>) {
  const auto max_gap = []<class Observer>(Observer*) {
    typename Observer::Config config{};
    return chain_config<Observer>(config).max_gap;
  };
  for (const int most : {max_gap(static_cast<Each*>(nullptr))...}) EXPECT_EQ(most, 100);
}
TEST(Defaults, GapsAreBridgedUpToAHundredSamplesUnlessAskedOtherwise) {
  gaps_are_bridged_up_to_a_hundred_samples(Observers{});
}

template <class S>
void laws_give_back() {
  Random random(16);
  for (int i = 0; i < 1000; ++i) {
    const auto b0 = static_cast<S>(random.log_uniform(1e-3, 1e3) * (random.index(2) == 0 ? 1 : -1));
    const auto law = esokit::AdrcLaw<2, S>::make({.controller_bandwidth = S(10), .input_gain = b0});
    ASSERT_EQ(law.value().input_gain(), b0);
    const auto nonlinear = esokit::NonlinearFeedback<2, S>::make(
        {.gains = {S(1), S(1)}, .linear_widths = {S(0.1), S(0.1)}, .input_gain = b0});
    ASSERT_TRUE(nonlinear.has_value()) << nonlinear;
    ASSERT_EQ(nonlinear->input_gain(), b0);
  }
}

TEST(OtherGivenValues, OfTheLaws) {
  laws_give_back<double>();
  laws_give_back<float>();
}

}  // namespace observer_given_values_test
