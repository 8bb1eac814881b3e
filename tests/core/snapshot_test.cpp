// Snapshots: every observer and the controllers come back bit for bit and go on alike; any changed
// word is refused; the text has the words.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <esokit/control/adrc.hpp>
#include <esokit/control/dual_feedback.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/core/snapshot_text.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/delayed_input.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <string>

namespace {

using namespace esokit;

template <class Observer>
void expect_same_life(Observer made) {
  for (int k = 0; k < 7; ++k) {
    (void)made.update(std::sin(0.3f * static_cast<float>(k)), 0.2f * static_cast<float>(k % 3));
  }
  const Snapshot<Observer> words = snapshot(made);
  auto restored = from_snapshot<Observer>(words);
  ASSERT_TRUE(restored);
  for (int k = 7; k < 60; ++k) {
    const float y = std::sin(0.3f * static_cast<float>(k));
    (void)made.update(y, 0.1f);
    (void)restored->update(y, 0.1f);
    if constexpr (requires { made.estimate(); }) {
      for (int r = 0; r < Observer::size; ++r)
        ASSERT_EQ(made.estimate()(r), restored->estimate()(r));
    } else {
      ASSERT_EQ(made.update(y, 0.0f), restored->update(y, 0.0f));
    }
  }

  for (std::size_t i = 0; i < words.size(); ++i) {
    for (const std::uint32_t bit : {1u, 0x80000000u}) {
      Snapshot<Observer> wrong = words;
      wrong[i] ^= bit;
      const auto refused = from_snapshot<Observer>(wrong);
      ASSERT_FALSE(refused) << i;
      EXPECT_STREQ(refused.error().field, "snapshot");
    }
  }
}

TEST(Snapshot, LinearAndCascade) {
  expect_same_life(LinearEso<2, float>::make(
                       {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f})
                       .value());
  expect_same_life(CascadeEso<2, 3, float>::make({.observer_bandwidth = 50.0f,
                                                  .bandwidth_factor = 2.0f,
                                                  .input_gain = 3.0f,
                                                  .sample_time = 1e-3f})
                       .value());
  expect_same_life(
      DelayedInput<LinearEso<2, float>, 3>::make(
          {.observer = {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f},
           .delay = 2})
          .value());
}

TEST(Snapshot, VaryingGains) {
  expect_same_life(AlgebraicEso<2, float>::make({.observer_bandwidth = 50.0f,
                                                 .frequency_shift = 5.0f,
                                                 .input_gain = 3.0f,
                                                 .sample_time = 1e-3f})
                       .value());
  expect_same_life(AdjustableBandwidthEso<2, float>::make({.observer_bandwidth = 50.0f,
                                                           .bandwidth_ratio = 0.7f,
                                                           .input_gain = 3.0f,
                                                           .sample_time = 1e-3f})
                       .value());
  expect_same_life(NonlinearEso<2, float>::make(
                       {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f})
                       .value());
}

TEST(Snapshot, FilterRecursiveAndFrozen) {
  using Filter = ExtendedStateFilter<2, float>;
  Filter::Config config;
  config.input_gain = 3.0f;
  config.sample_time = 1e-3f;
  config.measurement_variance = 1e-4f;
  config.disturbance_bounds = {0.0f, 0.0f, 10.0f};
  config.inflation = 0.5f;
  config.initial_covariance.diagonal() << 1.0f, 1e2f, 1e4f;
  expect_same_life(Filter::make(config).value());
  config.mode = RiccatiMode::frozen;
  expect_same_life(Filter::make(config).value());
}

TEST(Snapshot, Controllers) {
  expect_same_life(
      Adrc<LinearEso<2, float>>::make(
          {.observer = {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f},
           .controller_bandwidth = 10.0f,
           .limits = {.lower = -1.0f, .upper = 2.0f}})
          .value());
}

TEST(Snapshot, TextHasTheWords) {
  const auto observer = LinearEso<2, float>::make(
      {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f});
  const auto words = snapshot(*observer);
  const std::string text = snapshot_text("servo", words);
  EXPECT_TRUE(text.starts_with("inline constexpr std::array<std::uint32_t, 13> servo = {\n"));
  EXPECT_TRUE(text.ends_with("};\n"));
  std::size_t at = text.find("0x");
  for (const std::uint32_t word : words) {
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(std::strtoul(text.c_str() + at, nullptr, 16), word);
    at = text.find("0x", at + 2);
  }
  EXPECT_EQ(at, std::string::npos);
}

}  // namespace
