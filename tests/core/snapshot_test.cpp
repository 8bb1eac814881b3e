// Snapshots: every observer and the controllers come back bit for bit and go on alike; any changed
// word, any two flipped bits and another type of the same size are refused; the text has the words;
// what lies between members is zero.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/core/snapshot.hpp>
#include <esokit/core/snapshot_text.hpp>
#include <esokit/eigen.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>
#include <new>
#include <string>
#include <support/friction.hpp>
#include <tuple>
#include <type_traits>
#include <vector>

namespace core_snapshot_test {

using namespace esokit;

/// Models in a filter, the last two of as many states and as large.
using SwingModel = AugmentedModel<ModelParts{.order = 2, .resonators = 1}, float>;
using SwingFilter = ExtendedStateFilter<2, float, 3, NoNominalModel, 0, SwingModel>;
using SensorModel = AugmentedModel<ModelParts{.order = 2, .sensor = 2}, float>;
using SensorFilter = ExtendedStateFilter<2, float, 3, NoNominalModel, 0, SensorModel>;
using FadingModel = AugmentedModel<ModelParts{.order = 2, .sensor = 1, .first_order = 1}, float>;
using FadingFilter = ExtendedStateFilter<2, float, 3, NoNominalModel, 0, FadingModel>;

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
      EXPECT_STREQ(refused.error().rule,
                   "has a wrong checksum: damaged, or of another type or version");
    }
  }
  // Two signs at once: a multiplication by an odd number never mixes the highest bit.
  for (std::size_t i = 0; i < words.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      Snapshot<Observer> wrong = words;
      wrong[i] ^= 0x80000000u;
      wrong[j] ^= 0x80000000u;
      ASSERT_FALSE(from_snapshot<Observer>(wrong)) << i << ' ' << j;
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

// With an array of no elements between its numbers.
TEST(Snapshot, Models) {
  expect_same_life(ModelEso<ModelParts{.order = 1, .actuator = 1}>::make(
                       {.observer_bandwidth = 50.0,
                        .input_gain = 3.0,
                        .sample_time = 1e-3,
                        .model = {.actuator = {.time_constant = 0.02}}})
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
  eigen(config.initial_covariance).diagonal() << 1.0f, 1e2f, 1e4f;
  expect_same_life(Filter::make(config).value());
  config.mode = RiccatiMode::frozen;
  expect_same_life(Filter::make(config).value());

  SwingFilter::Config swing;
  swing.input_gain = 3.0f;
  swing.sample_time = 1e-2f;
  swing.measurement_variance = 1e-4f;
  swing.disturbance_bounds = {0.0f, 0.0f, 10.0f, 1.0f, 1.0f};
  swing.inflation = 0.5f;
  swing.plant_model.resonators[0].frequency = 20.0f;
  eigen(swing.initial_covariance).diagonal() << 1.0f, 1e2f, 1e4f, 1e4f, 1e4f;
  expect_same_life(SwingFilter::make(swing).value());
  swing.mode = RiccatiMode::frozen;
  const auto frozen = SwingFilter::make(swing).value();
  expect_same_life(frozen);
  // Words of another model, as large.
  static_assert(sizeof(SensorFilter) == sizeof(FadingFilter));
  SensorFilter::Config sensor;
  sensor.input_gain = 3.0f;
  sensor.sample_time = 1e-2f;
  sensor.measurement_variance = 1e-4f;
  sensor.disturbance_bounds = {0.0f, 0.0f, 10.0f, 1.0f, 1.0f};
  sensor.plant_model.sensor.frequency = 20.0f;
  sensor.inflation = 0.5f;
  const auto words = snapshot(SensorFilter::make(sensor).value());
  EXPECT_TRUE(from_snapshot<SensorFilter>(words));
  EXPECT_FALSE(from_snapshot<FadingFilter>(words));
}

TEST(Snapshot, Controllers) {
  expect_same_life(
      Adrc<LinearEso<2, float>>::make(
          {.observer = {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f},
           .controller_bandwidth = 10.0f,
           .limits = {.lower = -1.0f, .upper = 2.0f}})
          .value());
}

TEST(Snapshot, ChecksumIsTheStandardCrc32) {
  // The check value of CRC-32/ISO-HDLC: of the bytes "123456789".
  const std::uint32_t four = detail::crc32(detail::crc32_start, 0x34333231u);
  EXPECT_EQ(~detail::crc32(detail::crc32(four, 0x38373635u), 0x39u, 1), 0xcbf43926u);
}

TEST(Snapshot, TwoFlippedBitsAnywhereAreRefused) {
  using Observer = LinearEso<2, float>;
  const auto words = snapshot(
      Observer::make({.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f})
          .value());
  constexpr std::size_t bits = 32 * std::tuple_size_v<Snapshot<Observer>>;
  int passed = 0;
  for (std::size_t i = 0; i < bits; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      auto wrong = words;
      wrong[i / 32] ^= 1u << (i % 32);
      wrong[j / 32] ^= 1u << (j % 32);
      passed += from_snapshot<Observer>(wrong) ? 1 : 0;
    }
  }
  EXPECT_EQ(passed, 0);
}

TEST(Snapshot, AnotherTypeOfTheSameSizeIsRefused) {
  using Output = Adrc<LinearEso<2, float>, OutputBased>;
  using Error = Adrc<LinearEso<2, float>, ErrorBased>;
  static_assert(sizeof(Output) == sizeof(Error));
  const auto made = Output::make(
      {.observer = {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f},
       .controller_bandwidth = 10.0f});
  EXPECT_TRUE(from_snapshot<Output>(snapshot(*made)));
  EXPECT_FALSE(from_snapshot<Error>(snapshot(*made)));

  using Plain = LinearEso<2, float>;
  using Reduced = ReducedOrderEso<2, float>;
  static_assert(sizeof(Plain) == sizeof(Reduced));
  const auto plain =
      Plain::make({.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f});
  EXPECT_FALSE(from_snapshot<Reduced>(snapshot(*plain)));
  using Higher = LinearEso<1, float, 2>;
  static_assert(sizeof(Plain) == sizeof(Higher));
  EXPECT_FALSE(from_snapshot<Higher>(snapshot(*plain)));
}

/// Writes `byte` over the memory in which the next function keeps what it has not set.
[[gnu::noinline]] void fill_stack(int byte) {
  std::array<unsigned char, 40000> memory;
  std::memset(memory.data(), byte, memory.size());
  volatile unsigned char last = memory.back();
  (void)last;
}

template <class T>
[[gnu::noinline]] void make_at(void* memory, const typename T::Config& config) {
  ::new (memory) T(T::make(config).value());
}

/// An object made in memory that was 0xaa and one in memory that was 0x55 have the same words.
template <class T>
void expect_words_without_rubbish(const typename T::Config& config) {
  SCOPED_TRACE(testing::internal::GetTypeName<T>());
  std::array<Snapshot<T>, 2> words{};
  for (std::size_t i = 0; i < 2; ++i) {
    alignas(T) std::array<unsigned char, sizeof(T)> memory;
    const int byte = i == 0 ? 0xaa : 0x55;
    std::memset(memory.data(), byte, memory.size());
    fill_stack(byte);
    make_at<T>(memory.data(), config);
    words[i] = snapshot(*std::launder(reinterpret_cast<T*>(memory.data())));
  }
  EXPECT_EQ(words[0], words[1]);
}

template <class S>
void expect_no_rubbish() {
  const auto common = [](auto config) {
    config.input_gain = S(3);
    config.sample_time = S(1e-3);
    if constexpr (requires { config.observer_bandwidth; }) config.observer_bandwidth = S(50);
    if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = S(2);
    if constexpr (requires { config.frequency_shift; }) config.frequency_shift = S(5);
    if constexpr (requires { config.bandwidth_ratio; }) config.bandwidth_ratio = S(0.7);
    return config;
  };
  const auto plain = [&]<class T>(std::type_identity<T>) {
    expect_words_without_rubbish<T>(common(typename T::Config{}));
  };
  using Eso = LinearEso<2, S>;
  plain(std::type_identity<Eso>{});
  plain(std::type_identity<CascadeEso<2, 3, S>>{});
  plain(std::type_identity<HalfGainEso<2, S>>{});
  plain(std::type_identity<ReducedOrderEso<2, S>>{});
  plain(std::type_identity<AlgebraicEso<2, S>>{});
  plain(std::type_identity<AdjustableBandwidthEso<2, S>>{});
  plain(std::type_identity<NonlinearEso<2, S>>{});
  plain(std::type_identity<NonlinearEso<2, S, 1, FalGain<S>>>{});
  plain(std::type_identity<ModelEso<ModelParts{.order = 1, .plant_poles = true}, S>>{});

  using Filter = ExtendedStateFilter<2, S>;
  auto filter = common(typename Filter::Config{});
  filter.measurement_variance = S(1e-4);
  filter.disturbance_bounds = {S(0), S(0), S(10)};
  filter.inflation = S(0.5);
  for (const RiccatiMode mode : {RiccatiMode::recursive, RiccatiMode::frozen}) {
    filter.mode = mode;
    expect_words_without_rubbish<Filter>(filter);
  }

  const auto eso = common(typename Eso::Config{});
  expect_words_without_rubbish<DelayedInput<Eso, 3>>({.observer = eso, .delay = 2});
  const typename Adrc<Eso>::Config adrc{.observer = eso, .controller_bandwidth = S(10)};
  expect_words_without_rubbish<Adrc<Eso>>(adrc);
  expect_words_without_rubbish<Adrc<Filter>>({.observer = filter, .controller_bandwidth = S(10)});
  expect_words_without_rubbish<DisturbanceCompensator<Eso>>({.observer = eso});
  expect_words_without_rubbish<PredictiveAdrc<Eso>>(
      {.observer = eso, .controller_bandwidth = S(10)});
  expect_words_without_rubbish<Resting<Adrc<Eso>>>({.controller = adrc});
  expect_words_without_rubbish<TimeProportioned<S>>(
      {.on = S(1), .window = S(1), .sample_time = S(0.1)});
}

// As the words of a frozen filter, pasted into firmware, that differed from run to run.
TEST(Snapshot, BytesThatNobodyWritesAreZero) {
  expect_no_rubbish<float>();
  expect_no_rubbish<double>();
}

template <class... Types>
std::vector<std::uint32_t> tags() {
  return {type_tag<Types>...};
}

TEST(Snapshot, EveryTypeHasATagOfItsOwn) {
  using Eso = LinearEso<2, float>;
  using Gain = ConstantGain<3, float>;
  auto all = tags<
      float, double, long double, EqualPoles, PoleSet, ReducedPoles, HalfGainPoles, Eso,
      LinearEso<2, double>, LinearEso<3, float>, LinearEso<2, float, 2>, LinearEso<1, float, 2>,
      LinearEso<2, float, 1, PoleSet>, ReducedOrderEso<2, float>, HalfGainEso<2, float>,
      CascadeEso<2, 3, float>, CascadeEso<3, 2, float>, AlgebraicEso<2, float>,
      AdjustableBandwidthEso<2, float>, AdjustableBandwidthEso<2, float, 1, SignReading::printed>,
      NonlinearEso<2, float>, NonlinearEso<2, float, 2, FalGain<float>>,
      ExtendedStateFilter<2, float>, ExtendedStateFilter<2, float, 1, NoNominalModel, 8>,
      SwingModel, SensorModel, SwingFilter, SensorFilter, DelayedInput<Eso, 3>,
      DelayedInput<Eso, 4>, Measured<Eso>, Measured<Eso, 2>, Measured<Eso, 1, 2>,
      WrappedOutput<Eso>, VariableTime<Eso>, KnownModel<Eso, esokit_test::Friction<1, float>>,
      WrappedOutput<DelayedInput<Eso, 3>>, DelayedInput<WrappedOutput<Eso>, 3>,
      PredictorCorrector<2, float, 1, Gain>, PredictorCorrector<2, float, 1, Gain, 2>,
      PredictorCorrector<2, float, 1, AlgebraicGain<3, float>>,
      PredictorCorrector<2, float, 1, RiccatiGain<3, float>>,
      PredictorCorrector<2, float, 1, SwitchedGain<3, float>>,
      PredictorCorrector<2, float, 1, NonlinearGain<3, float>>, Adrc<Eso>, Adrc<Eso, ErrorBased>,
      Adrc<WrappedOutput<Eso>>, PredictiveAdrc<Eso>, DisturbanceCompensator<Eso>>();
  EXPECT_EQ(std::ranges::count(all, 0u), 0);
  std::ranges::sort(all);
  EXPECT_EQ(std::ranges::adjacent_find(all), all.end());
}

TEST(Snapshot, TextHasTheWords) {
  const auto observer = LinearEso<2, float>::make(
      {.observer_bandwidth = 50.0f, .input_gain = 3.0f, .sample_time = 1e-3f});
  const auto words = snapshot(*observer);
  const std::string text = snapshot_text("servo", words);
  EXPECT_TRUE(text.starts_with("inline constexpr std::array<std::uint32_t, 16> servo = {\n"));
  EXPECT_TRUE(text.ends_with("};\n"));
  std::size_t at = text.find("0x");
  for (const std::uint32_t word : words) {
    ASSERT_NE(at, std::string::npos);
    EXPECT_EQ(std::strtoul(text.c_str() + at, nullptr, 16), word);
    at = text.find("0x", at + 2);
  }
  EXPECT_EQ(at, std::string::npos);
}

}  // namespace core_snapshot_test
