// The C in fixed point at the ends of its ranges and counts: what is in them is taken, a count more
// is not.
#include <cstdint>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/fixed_point.hpp>
#include <target/fixed_play.hpp>

namespace esokit_test {
namespace target_fixed_edges_test {

#ifdef ESOKIT_LOADS_C

using namespace esokit;
using Eso = LinearEso<2>;
using Servo = Adrc<Eso>;

constexpr int max_gap = 5;
constexpr std::int32_t y_most = 2048, u_most = 1000, step = 30;
// Of a status.
constexpr unsigned y_refused = 1, u_refused = 2, bridged = 8, restarted = 16, r_refused = 32,
                   saturated = 128;

FixedPointOptions encoder(bool counts = false) {
  FixedPointOptions options;
  options.y = {.unit = 2 * M_PI / 4096, .most = counts ? step : y_most};
  if (counts) options.y.counter_bits = 16;
  options.u = {.unit = 12.0 / 1000, .most = u_most};
  options.code.name = "eso";
  return options;
}
Eso::Config observer_config() {
  return {.observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3, .max_gap = max_gap};
}
Servo::Config loop_config() {
  Servo::Config config{};
  config.observer = observer_config();
  config.controller_bandwidth = 25;
  config.limits = {.lower = -9, .upper = 12};
  return config;
}

/// An observer or a controller of its own.
template <class Y, class Object>
struct Running {
  explicit Running(const Object& object, const FixedPointOptions& options)
      : made(to_fixed_c(object, options).value()),
        c(folder, made.code, "gcc -std=c99", std::is_same_v<Object, Servo>) {}

  unsigned update(std::int32_t y, std::int32_t u) { return c.update(at(), static_cast<Y>(y), u); }
  unsigned predict(std::int32_t u) { return c.predict(at(), u); }
  unsigned reset(std::int32_t y) { return c.reset(at(), static_cast<Y>(y)); }
  std::int32_t control(std::int32_t y, std::int32_t r) {
    return c.control(at(), static_cast<Y>(y), static_cast<Y>(r));
  }
  unsigned status() { return c.status(at()); }
  unsigned start(std::int32_t y, std::int32_t u) { return c.start(at(), static_cast<Y>(y), u); }
  void misses(int samples) {
    for (int i = 0; i < samples; ++i) (void)predict(0);
  }
  std::int32_t estimate(unsigned row) { return c.estimate(at(), row); }
  void* at() { return c.state.data(); }

  Folder folder{};
  FixedCode made;
  FixedInC<Y> c;
};
using Observer = Running<std::int32_t, Eso>;
using Counter = Running<std::uint16_t, Eso>;
using Loop = Running<std::int32_t, Servo>;

TEST(FixedEdges, OfAMeasurementAndAnInput) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  Observer o(Eso::make(observer_config()).value(), encoder());
  ASSERT_TRUE(o.c.loaded());
  for (const std::int32_t sign : {1, -1}) {
    const std::int32_t y = sign * y_most, u = sign * u_most;
    EXPECT_EQ(o.reset(y), 0u);
    EXPECT_EQ(o.update(y, u), 0u);
    EXPECT_EQ(o.predict(u), 0u);
    EXPECT_EQ(o.update(y, u), bridged);
    EXPECT_EQ(o.reset(y + sign), y_refused);
    EXPECT_EQ(o.update(y + sign, u), y_refused);
    EXPECT_EQ(o.predict(u + sign), u_refused);
    EXPECT_EQ(o.update(y, u + sign), u_refused | bridged);
    // The end of the range is used.
    Observer same(Eso::make(observer_config()).value(), encoder());
    ASSERT_TRUE(same.c.loaded());
    EXPECT_EQ(o.reset(0), same.reset(0));
    (void)o.predict(u + 1000 * sign);
    (void)same.predict(u);
    for (unsigned row = 0; row < 3; ++row) EXPECT_EQ(o.estimate(row), same.estimate(row)) << row;
  }
}

TEST(FixedEdges, OfAGap) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  Observer o(Eso::make(observer_config()).value(), encoder());
  ASSERT_TRUE(o.c.loaded());
  for (int missing = 0; missing < max_gap + 4; ++missing) {
    for (const std::int32_t y : {0, y_most, -y_most}) {
      EXPECT_EQ(o.reset(0), 0u);
      o.misses(missing);
      EXPECT_EQ(o.update(y, 0), missing == 0 ? 0u : missing <= max_gap ? bridged : restarted);
      EXPECT_EQ(o.update(y, 0), 0u) << "it counts from here on";
      o.misses(missing);
      EXPECT_EQ(o.update(y < 0 ? y - 1 : y_most + 1, 0), y_refused);
    }
  }
  // However long it lasts.
  for (const int missing : {255, 256, 65534, 65535, 65536, 65537, 131072}) {
    EXPECT_EQ(o.reset(0), 0u);
    o.misses(missing);
    EXPECT_EQ(o.update(7, 0), restarted) << missing;
    EXPECT_EQ(o.estimate(1), 0) << "it is at rest";
  }
}

/// A state that a gap drives out of its range is held at its end, which is in the range.
TEST(FixedEdges, OfAState) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  Observer o(Eso::make(observer_config()).value(), encoder());
  ASSERT_TRUE(o.c.loaded());
  std::int32_t ends[2] = {};
  for (const std::int32_t sign : {1, -1}) {
    EXPECT_EQ(o.reset(0), 0u);
    o.c.state[2] = sign * 2000000000;  // the disturbance, which a prediction keeps
    EXPECT_EQ(o.predict(0), saturated);
    const std::int32_t end = o.c.state[2];
    EXPECT_LT(sign * static_cast<double>(end), 2e9);
    ends[sign > 0 ? 0 : 1] = end;
    for (const std::int32_t inside : {end, end - sign, end + sign}) {
      EXPECT_EQ(o.reset(0), 0u);
      o.c.state[2] = inside;
      EXPECT_EQ(o.predict(0), inside == end + sign ? saturated : 0u) << inside - end;
      EXPECT_EQ(o.c.state[2], inside == end + sign ? end : inside);
    }
  }
  EXPECT_EQ(ends[0], -ends[1]);
}

/// Settings that are taken up in a gap leave a state where a gap can lead it; after a measurement
/// it is held where one can leave it.
TEST(FixedEdges, OfSettings) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto object = Eso::make(observer_config()).value();
  auto options = encoder();
  options.code.settings_in_struct = true;
  const auto base = to_fixed_c(object, options).value();
  options.settings_for = &base;
  options.code.settings_name = "other";
  CCode code = base.code;
  code.source += to_fixed_c(object, options).value().code.settings;
  const Folder folder;
  FixedInC<std::int32_t> c(folder, code);
  ASSERT_TRUE(c.loaded());
  void* const o = c.state.data();
  for (const std::int32_t sign : {1, -1}) {
    for (const int missing : {1, 2, 0}) {
      EXPECT_EQ(c.reset(o, 0), 0u);
      std::int32_t& disturbance = c.state[2];
      disturbance = sign * 2000000000;
      EXPECT_EQ(c.predict(o, 0), saturated);
      const std::int32_t end = disturbance;
      if (missing == 2) {
        EXPECT_EQ(c.predict(o, 0), 0u);
      }
      if (missing == 0) {
        EXPECT_EQ(c.reset(o, 0), 0u);
        disturbance = end;
      }
      EXPECT_EQ(c.adopt(o, c.other), missing > 0 ? 0u : saturated) << missing;
      EXPECT_EQ(disturbance == end, missing > 0) << missing;
    }
  }
}

/// A counter moves by so many counts a sample, in a gap too, whatever it stands at.
TEST(FixedEdges, OfACounter) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  Counter o(Eso::make(observer_config()).value(), encoder(true));
  ASSERT_TRUE(o.c.loaded());
  for (const std::int32_t from : {0, 20, 32767, 32768, 65535}) {
    for (const std::int32_t sign : {1, -1}) {
      for (int missing = 0; missing <= max_gap; ++missing) {
        const std::int32_t most = sign * step * (missing + 1);
        EXPECT_EQ(o.reset(from), 0u);
        o.misses(missing);
        EXPECT_EQ(o.update(from + most, 0), missing > 0 ? bridged : 0u) << missing;
        EXPECT_EQ(o.reset(from), 0u);
        o.misses(missing);
        EXPECT_EQ(o.update(from + most + sign, 0), y_refused) << missing;
      }
      EXPECT_EQ(o.reset(from), 0u);
      o.misses(max_gap + 1);
      EXPECT_EQ(o.update(from + 9999 * sign, 0), restarted);
      EXPECT_EQ(o.update(from + 9999 * sign + step, 0), 0u) << "it counts from there";
    }
  }
}

TEST(FixedEdges, OfALoop) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  auto config = loop_config();
  config.missing = {.most = 3, .input = -2.4};
  Loop o(Servo::make(config).value(), encoder());
  ASSERT_TRUE(o.c.loaded());
  for (const std::int32_t sign : {1, -1}) {
    const std::int32_t y = sign * y_most, u = sign * u_most;
    EXPECT_EQ(o.start(y, u), 0u);
    EXPECT_EQ(o.start(y + sign, 0), y_refused);
    EXPECT_EQ(o.start(0, u + sign), u_refused);
    EXPECT_EQ(o.c.applied(o.at(), u), 0u);
    EXPECT_EQ(o.c.applied(o.at(), u + sign), u_refused);
    EXPECT_EQ(o.start(0, 0), 0u);
    (void)o.control(y, y);
    EXPECT_EQ(o.status(), 0u);
    (void)o.control(y, y + sign);
    EXPECT_EQ(o.status(), r_refused);
    (void)o.control(y + sign, 0);
    EXPECT_EQ(o.status(), y_refused);
    EXPECT_EQ(o.start(0, 0), 0u);
    EXPECT_EQ(o.control(0, y), sign > 0 ? 1000 : -750) << "the limit of u";
  }
  // From the fourth sample in a row on it is safe, from the next measurement on it runs.
  for (int missing = 0; missing < 8; ++missing) {
    EXPECT_EQ(o.start(0, 0), 0u);
    EXPECT_EQ(o.control(0, y_most), 1000);
    for (int i = 1; i <= missing; ++i) {
      EXPECT_EQ(o.c.miss(o.at(), y_most), i > 3 ? -200 : 1000) << i;
    }
    EXPECT_EQ(o.control(0, y_most), 1000) << missing;
  }
}

/// A reported u beyond its range is refused, and the end of the range on its side is what acts.
TEST(FixedEdges, OfAReportedInput) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const auto object = Servo::make(loop_config()).value();
  Loop o(object, encoder()), same(object, encoder());
  ASSERT_TRUE(o.c.loaded() && same.c.loaded());
  for (const std::int32_t sign : {1, -1}) {
    EXPECT_EQ(o.start(0, 0), 0u);
    EXPECT_EQ(same.start(0, 0), 0u);
    EXPECT_EQ(o.c.applied(o.at(), sign * (u_most + 1)), u_refused);
    EXPECT_EQ(same.c.applied(same.at(), sign * u_most), 0u);
    for (int k = 0; k < 3; ++k) EXPECT_EQ(o.control(0, 5), same.control(0, 5)) << sign;
    for (unsigned row = 0; row < 3; ++row) EXPECT_EQ(o.estimate(row), same.estimate(row)) << row;
    EXPECT_EQ(sign * o.estimate(2) < 0, true) << "dhat stands against this u";
  }
}

/// The start hold lasts so many samples.
TEST(FixedEdges, OfAStartHold) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  auto config = loop_config();
  config.start_hold = {.time = 0.004, .input = 1.2};
  auto in_double = Servo::make(config).value();
  Loop o(in_double, encoder());
  ASSERT_TRUE(o.c.loaded());
  for (int k = 0; k < 10; ++k) {
    const double wanted = in_double.update(0, 2048 * encoder().y.unit) / encoder().u.unit;
    EXPECT_EQ(o.control(0, y_most), static_cast<std::int32_t>(std::lround(wanted))) << k;
  }
}

/// A limit of rate counts to the last part of a count, in both directions and from the limits of u;
/// a half is rounded up.
TEST(FixedEdges, OfALimitOfRate) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  auto config = loop_config();
  config.limits.rate = 1.2;  // a tenth of a count a sample
  Loop o(Servo::make(config).value(), encoder());
  ASSERT_TRUE(o.c.loaded());
  const int scale = o.made.layout.law_scale;
  const std::int32_t one = 1 << scale, rate = one / 10;
  for (const std::int32_t from : {3, 1000, -750}) {
    for (const std::int32_t sign : {1, -1}) {
      if (std::abs(from) > 3 && (sign > 0) == (from > 0)) continue;
      EXPECT_EQ(o.start(0, from), 0u);
      if (std::abs(from) > 3) {
        EXPECT_EQ(o.control(0, -sign * y_most), from) << "it stays at the limit";
      }
      for (int k = 1; k <= 2 * one / 3; ++k) {
        EXPECT_EQ(o.control(0, sign * y_most), (from * one + sign * k * rate + one / 2) >> scale)
            << k;
      }
    }
  }
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_fixed_edges_test
}  // namespace esokit_test
