// The integers that to_fixed_c writes stay within the bounds that it promises, with random and
// adversarial input; a broken rounding does not. Nothing overflows at the ends of the ranges.
#include <target/fixed_play.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <sstream>
#include <support/friction.hpp>
#include <support/refusal.hpp>

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

/// AlgebraicEso as it is once it has settled.
TEST(FixedPoint, OfASettledAlgebraicObserver) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  AlgebraicEso<2>::Config config{};
  config.observer_bandwidth = 100;
  config.frequency_shift = 50;
  config.sample_time = 1e-3;
  config.input_gain = 50;
  auto object = AlgebraicEso<2>::make(config).value();
  EXPECT_FALSE(to_fixed_c(object, servo()));
  for (int k = 0; k < 100000 && !object.settled(); ++k) (void)object.update(0.0, 0.0);
  ASSERT_TRUE(object.settled());
  EXPECT_GT((stays_within<std::int32_t>(object, servo(), 13)), 0.3);
  const auto linear = to_fixed_c(observer<LinearEso<2>>(100, 1e-3), servo()).value();
  const auto settled = to_fixed_c(object, servo()).value();
  for (std::size_t i = 0; i < linear.written.a.size(); ++i) {
    EXPECT_NEAR(settled.written.a[i], linear.written.a[i], 1e-4);
  }
}

/// A complex pair and a real pole; the written system has their product as its determinant.
TEST(FixedPoint, OfAPoleSet) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Placed = LinearEso<2, double, 1, PoleSet>;
  Placed::Config config{};
  config.poles = {{{-70, 40}, {-70, -40}, {-150, 0}}};
  config.sample_time = 1e-3;
  config.input_gain = 50;
  config.max_gap = 5;
  const auto object = Placed::make(config).value();
  EXPECT_GT((stays_within<std::int32_t>(object, servo(), 16)), 0.3);
  const WrittenSystem w = to_fixed_c(object, servo())->written;
  const auto a = [&](std::size_t i, std::size_t j) { return w.a[3 * i + j]; };
  const double determinant = a(0, 0) * (a(1, 1) * a(2, 2) - a(1, 2) * a(2, 1)) -
                             a(0, 1) * (a(1, 0) * a(2, 2) - a(1, 2) * a(2, 0)) +
                             a(0, 2) * (a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0));
  EXPECT_NEAR(determinant, std::exp(-(70 + 70 + 150) * 1e-3), 1e-4);  // gains of 12 bits and more
}

/// The frozen filter has a constant gain, too; one that goes on is refused.
TEST(FixedPoint, OfAFrozenFilter) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  ExtendedStateFilter<2>::Config config{};
  config.sample_time = 1e-3;
  config.input_gain = 50;
  config.measurement_variance = 2e-7;
  config.disturbance_bounds[2] = 30;
  config.inflation = 0.05;
  config.mode = RiccatiMode::frozen;
  const auto frozen = ExtendedStateFilter<2>::make(config).value();
  EXPECT_GT((stays_within<std::int32_t>(frozen, servo(), 14)), 0.3);
  // Its gains are those of the filter.
  auto played = frozen;
  const auto made = to_fixed_c(frozen, servo()).value();
  const WrittenSystem& w = made.written;
  std::array<double, 3> x{};
  Random random(15);
  for (int k = 0; k < 2000; ++k) {
    const int y = random.index(4097) - 2048;
    (void)played.update(y * servo().y.unit, 0.0);
    std::array<double, 3> to{};
    for (std::size_t i = 0; i < 3; ++i) {
      to[i] = w.by[i] * y;
      for (std::size_t j = 0; j < 3; ++j) to[i] += w.a[i * 3 + j] * x[j];
    }
    x = to;
    EXPECT_NEAR(w.estimates[2][2] * x[2], played.total_disturbance(), made.estimates[2].by_gains);
  }
  config.mode = RiccatiMode::recursive;
  EXPECT_FALSE(to_fixed_c(ExtendedStateFilter<2>::make(config).value(), servo()));
}

/// 10 rad/s at 20 kHz: what is left over is kept.
TEST(FixedPoint, OfASlowObserverAtAHighRate) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  if (sanitized) GTEST_SKIP() << "sums of 100,000 samples: too long";
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
        folder, code.code, "gcc -std=c99 -fsanitize=undefined -fsanitize-undefined-trap-on-error");
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
  if (!sanitized) at_edges(slow, counter(), std::uint16_t{}, 60000);
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
    for (std::size_t row = 0; row < 3; ++row) {
      most = std::max(most, play.by_adversary(row, 400, 256));
    }
    broken += most > 1;
    ++products;
  }
  EXPECT_EQ(products, 3);
  EXPECT_GT(broken, 0);
}

using Servo = Adrc<LinearEso<2>>;

Servo::Config servo_loop(double rate = 0) {
  Servo::Config config{};
  config.observer = {
      .observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3, .max_gap = 5};
  config.controller_bandwidth = 25;
  config.limits = {.lower = -12, .upper = 12};
  if (rate > 0) config.limits.rate = rate;
  return config;
}

/// What the law asks for, before and after its limits.
TEST(FixedPoint, TheInputOfAControllerStaysWithinItsBound) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const int bits : {16, 32}) {
    FixedPointOptions options = servo(bits);
    const auto made = to_fixed_c(Servo::make(servo_loop()).value(), options).value();
    const Folder folder;
    FixedInC<std::int32_t> c(folder, made.code, "gcc -std=c99", true);
    ASSERT_TRUE(c.loaded());
    EXPECT_EQ(c.self_test(), 0);
    const WrittenSystem& w = made.written;
    std::array<double, 3> x{};
    Random random(41);
    std::int32_t u = 0;
    std::int32_t y = 0;
    std::int32_t r = 0;
    double largest = 0;
    int inside = 0;
    for (int k = 0; k < 300000; ++k) {
      // A machine that follows, with noise and jumps: else u is at a limit all the time.
      y = std::clamp(static_cast<std::int32_t>(0.9 * y + 0.1 * r) + random.index(41) - 20, -2048,
                     2048);
      if (random.index(500) == 0) r = random.index(4097) - 2048;
      if (random.index(3000) == 0) y = random.index(4097) - 2048;
      std::array<double, 3> to{};
      for (std::size_t i = 0; i < 3; ++i) {
        to[i] = w.by[i] * y + w.bu[i] * u;
        for (std::size_t j = 0; j < 3; ++j) to[i] += w.a[i * 3 + j] * x[j];
      }
      x = to;
      const double wanted = w.law[0] * x[0] + w.law[1] * x[1] + w.law[2] * x[2] + w.law[3] * r;
      u = c.control(c.state.data(), y, r);
      largest = std::max(largest, std::fabs(u - std::clamp(wanted, -1000.0, 1000.0)));
      inside += std::fabs(wanted) < 900;
    }
    EXPECT_LE(largest, made.input.deviation) << bits;
    EXPECT_GT(largest, 0.3 * made.input.deviation) << bits;
    EXPECT_GT(inside, 10000);
  }
}

/// 0.1 counts a sample: u moves by a count at each tenth.
TEST(FixedPoint, ALimitOfRateBelowOneCountKeepsItsRemainder) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto made = to_fixed_c(Servo::make(servo_loop(1.2)).value(), servo()).value();
  const Folder folder;
  FixedInC<std::int32_t> c(folder, made.code, "gcc -std=c99", true);
  ASSERT_TRUE(c.loaded());
  std::int32_t u = 0;
  for (int k = 1; k <= 5000; ++k) {
    u = c.control(c.state.data(), 0, 2000);
    // The step is rounded down to 2^-12 counts; of what it adds up to nothing is lost.
    EXPECT_NEAR(u, k * 409.0 / 4096, 0.5 + 1e-9) << k;
  }
  // What the actuator reports moves no limit: it counts from what was put out.
  for (int k = 5001; k <= 9000; ++k) {
    const bool far = k % 3 == 0;
    EXPECT_EQ(c.applied(c.state.data(), far ? -3000 : u + 7), far ? 2u : 0u);
    u = c.control(c.state.data(), 0, 2000);
    EXPECT_NEAR(u, k * 409.0 / 4096, 0.5 + 1e-9) << k;
  }
  EXPECT_EQ(c.start(c.state.data(), 0, 7), 0u);  // an operator's u is the last one
  EXPECT_NEAR(c.control(c.state.data(), 0, 2000), 7, 1);
}

/// An r outside of its range is reported at each sample, and its end followed, in any mode.
TEST(FixedPoint, AReferenceOutOfItsRangeIsReported) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  auto config = servo_loop();
  config.missing.most = 5;
  const auto made = to_fixed_c(Servo::make(config).value(), servo()).value();
  const Folder folder;
  FixedInC<std::int32_t> c(folder, made.code, "gcc -std=c99", true);
  FixedInC<std::int32_t> other(folder, made.code, "gcc -std=c99", true);
  ASSERT_TRUE(c.loaded() && other.loaded());
  const std::int32_t most = servo().y.most;
  for (int k = 0; k < 200; ++k) {
    const bool lost = k >= 100 && k < 150;
    for (const std::int32_t sign : {1, -1}) {
      const std::int32_t given = sign * (k % 2 == 0 ? most + 1 : 2000000000);
      const auto u = lost ? c.miss(c.state.data(), given) : c.control(c.state.data(), 3, given);
      const auto end = lost ? other.miss(other.state.data(), sign * most)
                            : other.control(other.state.data(), 3, sign * most);
      EXPECT_EQ(u, end) << k;
      EXPECT_EQ(c.status(c.state.data()) & 32u, 32u) << k;
      EXPECT_EQ(other.status(other.state.data()) & 32u, 0u) << k;
    }
    // Without a stated u it is zero.
    if (k > 120 && lost) {
      EXPECT_EQ(c.miss(c.state.data(), 0), 0);
      other.miss(other.state.data(), 0);
    }
  }
}

/// A lost measurement ends in zero, in the stated u, or, by name, in the last one.
TEST(FixedPoint, ALostMeasurementEndsInADeclaredInput) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const int kind : {0, 1, 2}) {
    auto config = servo_loop();
    config.missing.most = 5;
    if (kind == 1) config.missing.input = -2.0;
    config.missing.hold = kind == 2;
    const auto options = servo();
    const auto made = to_fixed_c(Servo::make(config).value(), options).value();
    const Folder folder;
    FixedInC<std::int32_t> c(folder, made.code, "gcc -std=c99", true);
    ASSERT_TRUE(c.loaded());
    std::int32_t u = 0;
    for (int k = 0; k < 100; ++k) u = c.control(c.state.data(), 0, 20);
    EXPECT_GT(u, 0);
    for (int k = 0; k < 200; ++k) {
      (void)c.applied(c.state.data(), u + 5);
      const std::int32_t next = c.miss(c.state.data(), 20);
      if (k > 5 && kind == 2) {
        EXPECT_EQ(next, u) << k;
      }
      u = next;
    }
    const auto stated = static_cast<std::int32_t>(std::lround(-2.0 / options.u.unit));
    if (kind < 2) {
      EXPECT_EQ(u, kind == 1 ? stated : 0);
    } else {
      EXPECT_NE(u, 0);
    }
  }
}

/// Missing samples, against the C++ observer: what it does is done here, but for the rounding.
TEST(FixedPoint, BridgesGapsAndRestarts) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto options = servo();
  auto in_double = observer<LinearEso<2>>(100, 1e-3);
  const auto made = to_fixed_c(in_double, options).value();
  const Folder folder;
  FixedInC<std::int32_t> c(folder, made.code);
  ASSERT_TRUE(c.loaded());
  Random random(51);
  int bridged = 0;
  int restarted = 0;
  for (int k = 0; k < 20000; ++k) {
    const auto y = static_cast<std::int32_t>(1500 * std::sin(0.002 * k));
    const std::int32_t u = random.index(401) - 200;
    const int missing = random.index(20) == 0 ? random.index(9) : 0;
    for (int i = 0; i < missing; ++i) {
      (void)in_double.predict(u * options.u.unit);
      const unsigned status = c.predict(c.state.data(), u);
      EXPECT_EQ(status, 0u);
    }
    const auto mine = in_double.update(y * options.y.unit, u * options.u.unit);
    const unsigned its = c.update(c.state.data(), y, u);
    EXPECT_EQ(its, static_cast<unsigned>(mine)) << k;
    bridged += its == 8;
    restarted += its == 16;
    for (unsigned row = 0; row < 3; ++row) {
      const double unit =
          made.written.estimates[row][row] * std::ldexp(1.0, -made.written.scale[row]);
      const double wanted = row == 0   ? in_double.estimate<0>()
                            : row == 1 ? in_double.estimate<1>()
                                       : in_double.estimate<2>();
      const FixedBound& bound = made.estimates[row];
      EXPECT_NEAR(c.estimate(c.state.data(), row) * unit, wanted,
                  2 * (bound.deviation + bound.by_gains))
          << k << ", " << row;
    }
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GT(bridged, 100);
  EXPECT_GT(restarted, 50);
  EXPECT_EQ(c.update(c.state.data(), 2049, 0), 1u);
  EXPECT_EQ(c.update(c.state.data(), 0, 1001), 2u | 8u);
}

/// A counter that wraps shows in no estimate.
TEST(FixedPoint, ACounterWraps) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  FixedPointOptions options = counter();
  options.y.counter_bits = 12;
  const auto made = to_fixed_c(observer<LinearEso<2>>(100, 1e-3), options).value();
  const Folder folder;
  FixedInC<std::uint16_t> c(folder, made.code);
  ASSERT_TRUE(c.loaded());
  const double unit = made.written.estimates[1][1] * std::ldexp(1.0, -made.written.scale[1]);
  const double d_unit = made.written.estimates[2][2] * std::ldexp(1.0, -made.written.scale[2]);
  unsigned at = 4000;
  EXPECT_EQ(c.reset(c.state.data(), static_cast<std::uint16_t>(at)), 0u);
  for (int k = 0; k < 3000; ++k) {
    at = (at + 25) % 4096;
    if (k % 100 == 99) {  // samples are lost, also while it wraps
      for (int i = 0; i < 4; ++i) {
        EXPECT_EQ(c.predict(c.state.data(), 0), 0u);
        at = (at + 25) % 4096;
      }
    }
    const unsigned status = c.update(c.state.data(), static_cast<std::uint16_t>(at), 0);
    EXPECT_EQ(status, k % 100 == 99 ? 8u : 0u) << k;
    if (k < 300) continue;
    EXPECT_NEAR(c.estimate(c.state.data(), 1) * unit, 25 * options.y.unit * 1000, 1e-3) << k;
    EXPECT_NEAR(c.estimate(c.state.data(), 2) * d_unit, 0, 0.1) << k;
  }
  // Faster than declared is no measurement.
  EXPECT_EQ(c.update(c.state.data(), static_cast<std::uint16_t>((at + 40) % 4096), 0), 1u);
}

/// What a run of a loop is judged by.
struct Criteria {
  double error = 0;      ///< integral of abs(r - y) over the steps of reference and load
  double overshoot = 0;  ///< by the step
  double input = 0;      ///< integral of abs(u)
};

/// A step of the reference to `size` and one of the load, y in counts to both. @param step gives u
/// in physical units for y and r in counts
template <class Step>
Criteria judged(int order, double friction, double time, double gain, double unit,
                std::int32_t size, double load, Step&& step) {
  Criteria found;
  double y = 0;
  double v = 0;
  double u = 0;
  const int samples = 4000;
  for (int k = 0; k < samples; ++k) {
    const std::int32_t r = k < 50 ? 0 : size;
    u = step(static_cast<std::int32_t>(std::lround(y / unit)), r);
    for (int i = 0; i < 20; ++i) {
      const double a = gain * u - (k > samples / 2 ? load : 0);
      const double h = time / 20;
      if (order == 2) {
        y += h * v;
        v += h * (a - friction * v);
      } else {
        y += h * (a - friction * y);
      }
    }
    found.error += std::fabs(r * unit - y) * time;
    found.overshoot = std::max(found.overshoot, y / (size * unit) - 1);
    found.input += std::fabs(u) * time;
  }
  return found;
}

template <class C>
void judges_the_same(const typename C::Config& config, const FixedPointOptions& options,
                     double friction, double gain, std::int32_t size, double load) {
  const auto made = to_fixed_c(C::make(config).value(), options).value();
  const Folder folder;
  FixedInC<std::int32_t> c(folder, made.code, "gcc -std=c99", true);
  ASSERT_TRUE(c.loaded());
  C in_double = C::make(config).value();
  const double time = config.observer.sample_time;
  const double unit = options.y.unit;
  const Criteria wanted = judged(
      C::order, friction, time, gain, unit, size, load,
      [&](std::int32_t y, std::int32_t r) {  // The timer takes whole counts of this one, too.
        const double u = in_double.update(y * unit, r * unit);
        const double held = options.u.unit * std::round(u / options.u.unit);
        in_double.applied(held);
        return held;
      });
  const Criteria found =
      judged(C::order, friction, time, gain, unit, size, load, [&](std::int32_t y, std::int32_t r) {
        return c.control(c.state.data(), y, r) * options.u.unit;
      });
  EXPECT_NEAR(found.error, wanted.error, 0.01 * wanted.error);
  // Half a count of the innovation, as 16 bits have it, is heard in u at rest: 4 % here.
  const double share = options.innovation_bits == 16 ? 0.05 : 0.01;
  EXPECT_NEAR(found.input, wanted.input, share * wanted.input);
  EXPECT_NEAR(found.overshoot, wanted.overshoot, 0.01);
}

/// In the loop fixed point is as good as double, on a servo and on a rate loop.
TEST(FixedPoint, InTheLoopIsAsGoodAsDouble) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const int bits : {16, 32}) {
    judges_the_same<Servo>(servo_loop(), servo(bits), 3, 60, 500, 100);
    judges_the_same<Servo>(servo_loop(500), servo(bits), 3, 60, 500, 100);
    using Rate = Adrc<LinearEso<1>>;
    Rate::Config rate{};
    rate.observer = {.observer_bandwidth = 250, .input_gain = 200, .sample_time = 1e-3};
    rate.controller_bandwidth = 50;
    rate.limits = {.lower = -1, .upper = 1};
    FixedPointOptions counts;  // 2000 deg/s in 16 bits, a motor command in 2000 counts
    counts.y = {35.0 / 32768, 32767};
    counts.u = {1.0 / 2000, 2000};
    counts.innovation_bits = bits;
    counts.code.name = "eso";
    if (bits == 32) judges_the_same<Rate>(rate, counts, 5, 180, 3000, 20);
  }
}

/// Of this bandwidth, for code with settings in a struct; `base` is that code, or null.
Expected<FixedCode, Error<double>> with_settings(double bandwidth, FixedPointOptions options,
                                                 const FixedCode* base) {
  options.code.settings_in_struct = true;
  options.settings_for = base;
  if (base != nullptr) options.code.settings_name = "other";
  return to_fixed_c(observer<LinearEso<2>>(bandwidth, 1e-3), options);
}

/// The code of `base` with the settings of another design behind it.
CCode joined(const FixedCode& base, const FixedCode& other) {
  CCode code = base.code;
  code.source += other.code.settings;
  return code;
}

/// Settings that are adopted make the code that of the other design: within its bounds, from the
/// first sample on, and back.
TEST(FixedPoint, AdoptsSettings) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto adopts = [](const FixedPointOptions& options, auto y, std::uint64_t seed,
                         double slowest) {
    using Y = decltype(y);
    const auto base = with_settings(100, options, nullptr);
    ASSERT_TRUE(base);
    for (const double bandwidth : {100.0, 70.0, slowest}) {
      const auto other = with_settings(bandwidth, options, &*base);
      ASSERT_TRUE(other) << bandwidth << ": " << other.error().rule;
      EXPECT_EQ(other->written.scale, base->written.scale);
      const Folder folder;
      FixedInC<Y> c(folder, joined(*base, *other));
      ASSERT_TRUE(c.loaded());
      ASSERT_NE(c.other, nullptr);
      EXPECT_EQ(c.self_test(), 0);
      const auto init = c.init;
      EXPECT_EQ(c.adopt(c.state.data(), c.other), 0u);
      // The play begins with init: the state as it is then is that with the other settings.
      static unsigned (*adopt)(void*, const void*);
      static void (*begin)(void*);
      static const void* settings;
      adopt = c.adopt;
      begin = init;
      settings = c.other;
      c.init = [](void* o) {
        begin(o);
        (void)adopt(o, settings);
      };
      FixedPlay<Y> play(c, *other, options, seed);
      EXPECT_LE(play.by_chance(many / 4), 1) << bandwidth;
      double most = 0;
      for (std::size_t row = 0; row < 3; ++row) {
        most = std::max(most, play.by_adversary(row, 400, 64));
      }
      EXPECT_LE(most, 1) << bandwidth;
      EXPECT_GT(most, 0.3) << bandwidth;
      EXPECT_EQ(play.refused, 0);
      // Of the wrong settings it is out of its bound, if they are others.
      if (bandwidth < 100) {
        c.init = begin;
        FixedPlay<Y> wrong(c, *other, options, seed);
        EXPECT_GT(wrong.by_chance(2000), 1) << bandwidth;
      }
    }
  };
  adopts(servo(), std::int32_t{}, 61, 30);
  adopts(servo(16), std::int32_t{}, 62, 50);
  adopts(counter(), std::uint16_t{}, 63, 60);
}

/// Whatever the order of switches, gaps and signs, nothing overflows; a state outside the new range
/// is held there and reported.
TEST(FixedPoint, AnySequenceOfSettingsIsDefined) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const FixedPointOptions options = servo();
  const auto base = with_settings(100, options, nullptr).value();
  const auto other = with_settings(30, options, &base).value();
  const Folder folder;
  FixedInC<std::int32_t> c(folder, joined(base, other),
                           "gcc -std=c99 -fsanitize=undefined -fsanitize-undefined-trap-on-error");
  ASSERT_TRUE(c.loaded());
  Random random(71);
  int held = 0;
  int switches = 0;
  std::int32_t y = 2048;
  std::int32_t u = 1000;
  for (int k = 0; k < 300000; ++k) {
    if (random.index(20) == 0) y = -y;
    if (random.index(20) == 0) u = -u;
    const bool missing = random.index(100) == 0;
    if (missing) (void)c.predict(c.state.data(), u);
    if (random.index(30) == 0) {
      const bool slow = random.index(2) == 0;
      const unsigned status = c.adopt(c.state.data(), slow ? c.other : c.design);
      const WrittenSystem& w = slow ? other.written : base.written;
      for (std::size_t i = 0; i < 3 && !missing; ++i) {
        ASSERT_LE(std::fabs(std::ldexp(c.state[i], -w.scale[i])), w.most[i]) << k << ", " << i;
      }
      EXPECT_EQ(status & ~128u, 0u);
      held += status == 128;
      ++switches;
    }
    (void)c.update(c.state.data(), y, u);
  }
  EXPECT_GT(switches, 5000);
  EXPECT_GT(held, 50);
  // Of another text.
  FixedPointOptions coarse = options;
  coarse.y.most = 1000;
  const auto foreign = with_settings(30, coarse, nullptr).value();
  EXPECT_NE(foreign.layout.mark, base.layout.mark);
  std::uint32_t no_settings[64] = {foreign.layout.mark};
  const auto before = c.state;
  EXPECT_EQ(c.adopt(c.state.data(), no_settings), 64u);
  EXPECT_EQ(c.state, before);
}

/// A controller takes gains of its law and limits, too.
TEST(FixedPoint, AControllerAdoptsGainsAndLimits) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  FixedPointOptions options = servo();
  options.code.settings_in_struct = true;
  const auto base = to_fixed_c(Servo::make(servo_loop(500)).value(), options).value();
  auto config = servo_loop(100);
  config.observer.observer_bandwidth = 60;
  config.controller_bandwidth = 12;
  config.limits.lower = -3;
  config.limits.upper = 6;
  const auto slow = Servo::make(config).value();
  options.settings_for = &base;
  options.code.settings_name = "other";
  const auto other = to_fixed_c(slow, options).value();
  const Folder folder;
  FixedInC<std::int32_t> c(folder, joined(base, other), "gcc -std=c99", true);
  const Folder apart;
  FixedInC<std::int32_t> alone(apart, other.code, "gcc -std=c99", true);
  ASSERT_TRUE(c.loaded() && alone.loaded());
  EXPECT_EQ(c.adopt(c.state.data(), c.other), 0u);
  auto in_double = slow;
  Random random(81);
  int inside = 0;
  for (int k = 0; k < 20000; ++k) {
    const auto r = static_cast<std::int32_t>(20 * std::sin(0.001 * k));
    const std::int32_t y = r + random.index(5) - 2;
    const std::int32_t u = c.control(c.state.data(), y, r);
    // The same lists with the settings as they are written alone, in each bit.
    ASSERT_EQ(u, alone.control(alone.state.data(), y, r)) << k;
    ASSERT_LE(u, 500);
    ASSERT_GE(u, -250);
    const double wanted = in_double.update(y * options.y.unit, r * options.y.unit);
    in_double.applied(u * options.u.unit);
    ASSERT_NEAR(u, wanted / options.u.unit, other.input.deviation + other.input.by_gains + 1);
    inside += std::abs(u) < 240;
  }
  EXPECT_GT(inside, 10000);
}

/// Other compilers take it, and of MISRA C:2012 nothing is found but the deviations that the file
/// names.
TEST(FixedPoint, CompilesWithOtherCompilers) {
  auto opens = counter();
  opens.code.settings_in_struct = true;
  for (const FixedPointOptions& options : {servo(), counter(), opens}) {
    const auto made = to_fixed_c(Servo::make(servo_loop(500)).value(), options).value();
    const Folder folder;
    folder.write("eso.h", made.code.header);
    folder.write("eso.c", made.code.source);
    folder.write("eso.cpp", made.code.source);
    const auto compiles = [&](const std::string& compiler, const std::string& file,
                              const std::string& flags = strict) {
      return !there(compiler.substr(0, compiler.find(' '))) ||
             runs(compiler + " " + flags + " -DESO_SELF_TEST -c -o " + folder.file("eso.o") + " " +
                  folder.file(file));
    };
    EXPECT_TRUE(compiles("g++ -std=c++11", "eso.cpp"));
    EXPECT_TRUE(compiles("clang -std=c99", "eso.c"));
    EXPECT_TRUE(compiles("tcc", "eso.c", "-Wall -Werror"));
    EXPECT_TRUE(compiles("sdcc -mstm8 --std-c99", "eso.c", ">/dev/null 2>&1"));
    EXPECT_TRUE(compiles("avr-gcc -std=c99 -Os -mmcu=atmega328p", "eso.c"));
    if (!there("cppcheck")) continue;
    const auto finds_nothing = [&](const std::string& deviations) {
      return runs("cppcheck --addon=misra --std=c99 -q --error-exitcode=1 " + deviations +
                  folder.file("eso.c") + " >/dev/null 2>&1");
    };
    std::string deviations = "--suppress=missingIncludeSystem ";
    for (const char* rule : {"2.3", "2.5", "15.5"}) {
      deviations += std::string("--suppress=misra-c2012-") + rule + " ";
    }
    EXPECT_FALSE(finds_nothing(deviations)) << "it finds no deviation that is there";
    EXPECT_TRUE(finds_nothing(deviations + "--suppress=misra-c2012-10.1 "));
  }
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
  options = servo();
  options.u.most = 1 << 25;
  EXPECT_EQ(refusal(options), "u.most = 3.35544e+07: must be 1 .. 2^24");
  options = servo();
  options.u.counter_bits = 8;
  EXPECT_EQ(refusal(options), "u.counter_bits = 8: must be 0: u is no counter");
  options = counter();
  options.y.counter_bits = 17;
  EXPECT_EQ(refusal(options), "y.counter_bits = 17: must be 2 .. 16, or 0");
  options.y.counter_bits = 5;
  EXPECT_EQ(refusal(options).substr(0, 12), "y.most = 30:");
  options = servo(24);
  EXPECT_EQ(refusal(options), "innovation_bits = 24: must be 16 or 32");
  // A bound above what is allowed says what would do.
  options = servo(16);
  options.most_deviation = {0, 0, 0.5};
  const std::string text = refusal(options);
  EXPECT_EQ(text.substr(0, 18), "most_deviation[2] ");
  EXPECT_NE(text.find("32 bits of innovation_bits"), std::string::npos) << text;
  EXPECT_NE(text.find("allowed is 0.5"), std::string::npos) << text;
  options.innovation_bits = 32;
  EXPECT_EQ(refusal(options), "");
}

/// Rounding and what is left over come in where the bound needs them.
TEST(FixedPoint, TakesWhatTheBoundNeeds) {
  const auto made = [](double most) {
    FixedPointOptions options = servo();
    options.most_deviation = {0, 0, most};
    return to_fixed_c(observer<LinearEso<2>>(100, 1e-3), options);
  };
  const double floors = made(0)->estimates[2].deviation;
  const double rounds = made(0.99 * floors)->estimates[2].deviation;
  const double keeps = made(0.99 * rounds)->estimates[2].deviation;
  EXPECT_LT(rounds, floors);
  EXPECT_LT(keeps, rounds);
  EXPECT_FALSE(made(1e-9));
}

TEST(FixedPoint, RefusesWhatIsNotLinear) {
  AdjustableBandwidthEso<2>::Config config{};
  config.observer_bandwidth = 100;
  config.sample_time = 1e-3;
  config.input_gain = 50;
  config.max_gap = 2;
  config.bandwidth_ratio = 0.5;
  const auto code = to_fixed_c(AdjustableBandwidthEso<2>::make(config).value(), servo());
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "observer");
  // What is not written says so, and what to take instead.
  const auto refused = [](const auto& object) {
    const auto made = to_fixed_c(object, servo());
    return made ? std::string() : std::string(made.error().rule);
  };
  using Wrapped = WrappedOutput<LinearEso<2>>;
  Wrapped::Config wrapped{};
  wrapped.observer = {
      .observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3, .max_gap = 2};
  wrapped.period = 6;
  EXPECT_NE(refused(Wrapped::make(wrapped).value()).find("y.counter_bits"), std::string::npos);
  using Told = Measured<LinearEso<2>>;
  EXPECT_NE(refused(Told::make({.observer = wrapped.observer}).value()).find("is in Measured"),
            std::string::npos);
  using Known = KnownModel<LinearEso<2>, Friction<0, double>>;
  EXPECT_NE(refused(Known::make({.observer = wrapped.observer}).value()).find("is in KnownModel"),
            std::string::npos);
  using Predictive = PredictiveAdrc<CascadeEso<2, 2>>;
  Predictive::Config cascade{.controller_bandwidth = 20, .limits = {-10, 10}};
  cascade.observer = {.observer_bandwidth = 50,
                      .bandwidth_factor = 2,
                      .input_gain = 50,
                      .sample_time = 1e-3,
                      .max_gap = 2};
  EXPECT_NE(refused(Predictive::make(cascade).value()).find("is PredictiveAdrc"),
            std::string::npos);
  // Around an observer that can be written alone.
  using Settling = Adrc<AlgebraicEso<2>>;
  auto loop = Settling::make({.observer = {.observer_bandwidth = 100,
                                           .frequency_shift = 50,
                                           .input_gain = 50,
                                           .sample_time = 1e-3},
                              .controller_bandwidth = 20,
                              .limits = {-6, 6}})
                  .value();
  EXPECT_NE(refused(loop).find("has gains that go on"), std::string::npos);
  for (int k = 0; k < 100000 && !loop.observer().settled(); ++k) (void)loop.update(0.0, 0.0);
  EXPECT_NE(refused(loop).find("estimates that are published apart (AlgebraicEso)"),
            std::string::npos)
      << refused(loop);
}

/// Settings that do not fit into the scales, or whose bound is above what is allowed, or of another
/// structure, are refused.
TEST(FixedPoint, RefusesSettingsThatDoNotFit) {
  FixedPointOptions options = servo();
  options.code.settings_in_struct = true;
  const auto base = to_fixed_c(observer<LinearEso<2>>(100, 1e-3), options).value();
  options.settings_for = &base;
  const auto refusal_of = [&](const auto& object) {
    const auto made = to_fixed_c(object, options);
    return made ? std::string() : made.error().field + std::string(": ") + made.error().rule;
  };
  const auto at = [](double bandwidth) { return observer<LinearEso<2>>(bandwidth, 1e-3); };
  EXPECT_EQ(refusal_of(at(50)), "");
  EXPECT_NE(refusal_of(at(150)).find("settings_for: times what the scales"), std::string::npos);
  EXPECT_NE(refusal_of(observer<LinearEso<2>>(50, 2e-3)).find("the same name, structure"),
            std::string::npos);
  EXPECT_NE(refusal_of(observer<LinearEso<1>>(50, 1e-3)).find("the code of such an object"),
            std::string::npos);
  options.most_deviation = {0, 0, 1e-4};
  EXPECT_EQ(refusal_of(at(50)).substr(0, 15), "most_deviation:");
  options.code.settings_in_struct = false;
  EXPECT_EQ(refusal_of(at(50)).substr(0, 19), "settings_in_struct:");
}

/// The self-test plays the start hold, too, and the C begins as the controller does: with the u of
/// the hold, or the one nearest to zero within the limits.
TEST(FixedPoint, BeginsAsTheController) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const double hold : {0.0, 0.01, 0.5}) {
    for (const double input : {2.0, -1.0, 0.0}) {
      for (const double rate : {0.0, 100.0}) {
        for (const bool around_zero : {true, false}) {
          auto config = servo_loop(rate);
          if (!around_zero) {
            if (!(input > 0)) continue;
            config.limits.lower = 1.2;
            config.missing.input = 1.2;
          }
          config.start_hold = {.time = hold, .input = input};
          auto in_double = Servo::make(config).value();
          const FixedPointOptions options = servo();
          const auto made = to_fixed_c(in_double, options).value();
          const Folder folder;
          FixedInC<std::int32_t> c(folder, made.code, "gcc -std=c99", true);
          ASSERT_TRUE(c.loaded());
          EXPECT_EQ(c.self_test(), 0) << hold << ", " << input << ", " << rate;
          for (int k = 0; k < 20; ++k) {
            const double wanted = in_double.update(0.5, 0.5) / options.u.unit;
            const std::int32_t at = static_cast<std::int32_t>(0.5 / options.y.unit);
            EXPECT_NEAR(c.control(c.state.data(), at, at), wanted,
                        1 + made.input.deviation + made.input.by_gains)
                << "hold " << hold << ", " << input << ", " << rate << ", sample " << k;
          }
        }
      }
    }
  }
}

/// What a refusal of settings says helps wherever it is printed: of faster and slower designs, of
/// observers and controllers.
TEST(FixedPoint, RoomForOtherSettingsHelpsWhereverTheyAreRefused) {
  Random random(61);
  int refused = 0;
  const auto judge = [&](const auto& first, const auto& second, FixedPointOptions options) {
    const auto one = to_fixed_c(first, options);
    const auto two = to_fixed_c(second, options);
    if (!one || !two) return;
    auto behind = options;
    behind.settings_for = &*one;
    const auto simply = to_fixed_c(second, behind);
    if (simply) return;
    if (std::string(simply.error().field) != "settings_for") return;
    EXPECT_NE(std::string(simply.error().rule).find("with room_for, the code of this design alone"),
              std::string::npos);
    ++refused;
    options.room_for = {&*two};
    const auto running = to_fixed_c(first, options);
    ASSERT_TRUE(running) << esokit_test::refusal(running);
    behind.settings_for = &*running;
    const auto settings = to_fixed_c(second, behind);
    EXPECT_TRUE(settings) << esokit_test::refusal(settings);
  };
  for (int i = 0; i < 150; i += stride) {
    FixedPointOptions options;
    options.y = {.unit = random.log_uniform(1e-4, 1e-2), .most = 500 + random.index(7500)};
    options.u = {.unit = 0.01, .most = 1000};
    options.innovation_bits = i % 2 == 0 ? 16 : 32;
    options.code.name = "eso";
    options.code.settings_in_struct = true;
    options.most_deviation.assign(3, 1e30);
    options.most_input_deviation = 1e30;
    auto config = servo_loop();
    config.limits = {.lower = -10, .upper = 10};
    config.observer.input_gain = random.log_uniform(1, 1000);
    config.observer.max_gap = 1 + random.index(6);
    config.observer.observer_bandwidth = random.log_uniform(20, 300);
    config.controller_bandwidth = config.observer.observer_bandwidth / random.uniform(3, 10);
    auto other = config;
    other.observer.observer_bandwidth *= random.log_uniform(0.1, 10);
    other.controller_bandwidth *= random.log_uniform(0.1, 10);
    judge(Servo::make(config).value(), Servo::make(other).value(), options);
    judge(LinearEso<2>::make(config.observer).value(), LinearEso<2>::make(other.observer).value(),
          options);
  }
  EXPECT_GT(refused, sanitized ? 20 : 100);
}

/// Of several at once, and what is written is the code that it says: in each bit, as the settings
/// written alone.
TEST(FixedPoint, RoomForSeveral) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  FixedPointOptions options = servo();
  options.code.settings_in_struct = true;
  options.most_deviation.assign(3, 1e30);
  options.most_input_deviation = 1e30;
  std::vector<FixedCode> alone;
  const auto design = [](double bandwidth) {
    auto config = servo_loop();
    config.observer.observer_bandwidth = bandwidth;
    config.controller_bandwidth = bandwidth / 4;
    return Servo::make(config).value();
  };
  for (const double bandwidth : {15.0, 40.0, 250.0}) {
    alone.push_back(to_fixed_c(design(bandwidth), options).value());
  }
  for (const FixedCode& one : alone) options.room_for.push_back(&one);
  const auto running = to_fixed_c(design(100), options).value();
  options.settings_for = &running;
  options.code.settings_name = "other";
  for (const double bandwidth : {15.0, 40.0, 250.0}) {
    const auto other = to_fixed_c(design(bandwidth), options);
    ASSERT_TRUE(other) << bandwidth << ": " << esokit_test::refusal(other);
    const Folder folder;
    FixedInC<std::int32_t> c(folder, joined(running, *other), "gcc -std=c99", true);
    const Folder apart;
    FixedInC<std::int32_t> itself(apart, other->code, "gcc -std=c99", true);
    ASSERT_TRUE(c.loaded() && itself.loaded());
    EXPECT_EQ(c.self_test(), 0);
    EXPECT_EQ(c.adopt(c.state.data(), c.other), 0u);
    Random random(83);
    for (int k = 0; k < 5000; ++k) {
      const std::int32_t r = random.index(2001) - 1000;
      const std::int32_t y = random.index(4097) - 2048;
      ASSERT_EQ(c.control(c.state.data(), y, r), itself.control(itself.state.data(), y, r)) << k;
    }
  }
  const auto of_another_kind = to_fixed_c(observer<LinearEso<2>>(100, 1e-3), [&] {
    auto changed = options;
    changed.settings_for = nullptr;
    return changed;
  }());
  EXPECT_EQ(esokit_test::refusal(of_another_kind), "room_for: must be the codes of such objects");
}

}  // namespace target_fixed_point_test
}  // namespace esokit_test
