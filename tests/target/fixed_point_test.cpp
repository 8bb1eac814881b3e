// The integers that to_fixed_c writes stay within the bounds that it promises, with random and
// adversarial input; a broken rounding does not. Nothing overflows at the ends of the ranges.
#include <target/fixed_play.hpp>

#include <esokit/control/adrc.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <sstream>

namespace esokit_test {
namespace target_fixed_point_test {

using namespace esokit;

template <class Observer>
Observer observer(double bandwidth, double sample_time) {
  using V = typename Observer::scalar_type;
  typename Observer::Config config{};
  config.observer_bandwidth = static_cast<V>(bandwidth);
  config.sample_time = static_cast<V>(sample_time);
  config.input_gain = 50;
  config.max_gap = 5;
  if constexpr (requires { config.bandwidth_factor; }) config.bandwidth_factor = 1.5;
  return Observer::make(config).value();
}

/// An encoder of 4096 counts a turn, within half a turn; 12 V in 1000 counts.
FixedPointOptions servo(int bits = 32) {
  FixedPointOptions options;
  options.y = {2 * M_PI / 4096, 2048};
  options.u = {12.0 / 1000, 1000};
  options.innovation_bits = bits;
  options.code.name = "eso";
  return options;
}
/// The same as a counter of 16 bits, at most 30 counts a sample.
FixedPointOptions counter(int bits = 32) {
  FixedPointOptions options = servo(bits);
  options.y.most = 30;
  options.y.counter_bits = 16;
  return options;
}

std::string refusal(const FixedPointOptions& options, double bandwidth = 100, double time = 1e-3) {
  const auto code = to_fixed_c(observer<LinearEso<2>>(bandwidth, time), options);
  if (code) return "";
  std::ostringstream text;
  text << code.error();
  return text.str();
}

#ifdef ESOKIT_LOADS_C

constexpr long many =
#if defined(ESOKIT_ONE_TYPE)
    20000;
#else
    1000000;  // in each of ten designs
#endif

/// @return the largest share of the bound that an adversary reached
template <class Y, class Observer>
double stays_within(const Observer& object, const FixedPointOptions& options, std::uint64_t seed,
                    long steps = many, int horizon = 400) {
  const auto made = to_fixed_c(object, options);
  EXPECT_TRUE(made) << (made ? "" : made.error().rule);
  if (!made) return 0;
  const Folder folder;
  FixedInC<Y> in_c(folder, made->code);
  EXPECT_TRUE(in_c.loaded());
  if (!in_c.loaded()) return 0;
  EXPECT_EQ(in_c.self_test(), 0);
  FixedPlay<Y> play(in_c, *made, options, seed);
  EXPECT_LE(play.by_chance(steps), 1);
  double most = 0;
  for (std::size_t row = 0; row < made->estimates.size(); ++row) {
    most = std::max(most, play.by_adversary(row, horizon, 64));
  }
  EXPECT_LE(most, 1);
  EXPECT_EQ(play.refused, 0);
  return most;
}

TEST(FixedPoint, StaysWithinItsBounds) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Second = LinearEso<2>;
  EXPECT_GT((stays_within<std::int32_t>(observer<Second>(100, 1e-3), servo(), 1)), 0.3);
  EXPECT_GT((stays_within<std::int32_t>(observer<Second>(100, 1e-3), servo(16), 2)), 0.3);
  EXPECT_GT((stays_within<std::uint16_t>(observer<Second>(100, 1e-3), counter(), 3)), 0.3);
  EXPECT_GT((stays_within<std::uint16_t>(observer<Second>(100, 1e-3), counter(16), 4)), 0.3);
  EXPECT_GT((stays_within<std::int32_t>(observer<LinearEso<1>>(200, 1e-3), servo(), 5)), 0.3);
  EXPECT_GT((stays_within<std::int32_t>(observer<HalfGainEso<2>>(100, 1e-3), servo(), 6)), 0.3);
  EXPECT_GT((stays_within<std::int32_t>(observer<CascadeEso<2, 2>>(100, 1e-3), servo(), 7)), 0.3);


  EXPECT_GT((stays_within<std::int32_t>(observer<LinearEso<3>>(60, 1e-3), servo(), 8)), 0.3);
  using Ramp = LinearEso<1, double, 2>;
  EXPECT_GT((stays_within<std::int32_t>(observer<Ramp>(60, 1e-3), servo(), 9)), 0.3);
}

/// 10 rad/s at 20 kHz: what is left over is kept.
TEST(FixedPoint, OfASlowObserverAtAHighRate) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto slow = observer<LinearEso<2>>(10, 5e-5);
  EXPECT_GT((stays_within<std::int32_t>(slow, servo(), 11, many, 20000)), 0.3);
  EXPECT_GT((stays_within<std::uint16_t>(slow, counter(), 12, many, 20000)), 0.3);
  const auto made = to_fixed_c(slow, counter());
  EXPECT_GT(made->written.left_over[2], 0);
}

/// Signed overflow, shifts and conversions trap, at the ends of all ranges and through gaps.
TEST(FixedPoint, NothingIsUndefinedAtTheEdges) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto at_edges = [](auto object, const FixedPointOptions& options, auto y, int horizon) {
    const auto code = to_fixed_c(object, options).value();
    const Folder folder;
    FixedInC<decltype(y)> in_c(
        folder, code.code,
        "gcc -std=c99 -fsanitize=undefined -fsanitize-undefined-trap-on-error");
    ASSERT_TRUE(in_c.loaded());
    FixedPlay<decltype(y)> play(in_c, code, options, 21);
    for (const double share : play.to_the_edges(horizon)) {
      EXPECT_LE(share, 1);
      EXPECT_GT(share, 0.98);
    }
    EXPECT_GT(play.refused, 10);
  };
  const auto fast = observer<LinearEso<2>>(100, 1e-3);
  const auto slow = observer<LinearEso<2>>(10, 5e-5);
  at_edges(fast, servo(), std::int32_t{}, 1000);
  at_edges(fast, servo(16), std::int32_t{}, 1000);
  at_edges(fast, counter(), std::uint16_t{}, 1000);
  at_edges(slow, counter(), std::uint16_t{}, 60000);
  at_edges(observer<LinearEso<3>>(60, 1e-3), servo(), std::int32_t{}, 2000);
}

/// One product floored that was to be rounded: the bound is broken, so it is none for that code.
TEST(FixedPoint, AMutantBreaksTheBound) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  FixedPointOptions options = servo();
  options.most_deviation = {0, 0, 2.5e-3};  // below what floors do: all are rounded
  auto code = to_fixed_c(observer<LinearEso<2>>(100, 1e-3), options).value();
  const std::string rounded = " + 32768u";
  int broken = 0;
  int products = 0;
  for (std::size_t at = 0; (at = code.code.source.find(rounded, at)) != std::string::npos; ++at) {
    CCode mutant = code.code;
    mutant.source.replace(at, rounded.size(), "");
    const Folder folder;
    FixedInC<std::int32_t> in_c(folder, mutant);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_NE(in_c.self_test(), 0);
    FixedPlay<std::int32_t> play(in_c, code, options, 31);
    double most = play.by_chance(100000);
    std::printf("chance %g\n", most);
    for (std::size_t row = 0; row < 3; ++row) {
      most = std::max(most, play.by_adversary(row, 400, 256));
    }
    std::printf("mutant %g\n", most);
    broken += most > 1;
    ++products;
  }
  EXPECT_EQ(products, 3);
  EXPECT_GT(broken, 0);
}

#endif  // ESOKIT_LOADS_C

TEST(FixedPoint, RefusesByName) {
  EXPECT_EQ(refusal(servo()), "");
  FixedPointOptions options = servo();
  options.y.unit = 0;
  EXPECT_EQ(refusal(options), "y.unit = 0: must be finite and positive");
  options = servo();
  options.y.most = 0;
  EXPECT_EQ(refusal(options), "y.most = 0: must be 1 .. 2^24");
}

}  // namespace target_fixed_point_test
}  // namespace esokit_test
