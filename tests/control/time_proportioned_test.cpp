// An output that is on or off: its mean is u, no time is shorter than the least, and nothing is
// lost or gathered without bound.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <esokit/control/time_proportioned.hpp>
#include <esokit/core/snapshot.hpp>
#include <limits>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_time_proportioned_test {

using esokit::TimeProportioned;
using esokit::TimeProportionedConfig;

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// The nearest of all times on that a window may have.
std::vector<int> nearest(double wanted, int window, int least_on, int least_off, bool was_full) {
  std::vector<int> best;
  double distance = std::numeric_limits<double>::infinity();
  for (int n = 0; n <= window; ++n) {
    const bool fits =
        n == 0 || n == window || ((was_full || n >= least_on) && window - n >= least_off);
    const double away = std::abs(wanted - n);
    // What lies half way may go either way.
    if (!fits || away > distance + 1e-2) continue;
    if (away < distance - 1e-2) best.clear();
    distance = std::min(distance, away);
    best.push_back(n);
  }
  return best;
}

template <class S>
void keeps_its_times(std::uint64_t seed) {
  Random random(seed);
  for (int i = 0; i < 300 && !testing::Test::HasFailure(); ++i) {
    const int window = 1 + random.index(i % 3 == 0 ? 4 : 60);
    const int least_on = random.index(window + 1);
    const int least_off = random.index(window - least_on + 1);
    const double off = random.uniform(-10, 10);
    const double on = off + (random.index(2) == 0 ? 1 : -1) * random.log_uniform(1e-3, 1e3);
    const double T = random.log_uniform(1e-3, 10);
    auto relay = TimeProportioned<S>::make({.off = static_cast<S>(off),
                                            .on = static_cast<S>(on),
                                            .window = static_cast<S>(window * T),
                                            .least_on = static_cast<S>(least_on * T),
                                            .least_off = static_cast<S>(least_off * T),
                                            .sample_time = static_cast<S>(T)})
                     .value();
    SCOPED_TRACE(testing::Message()
                 << i << ": " << window << " samples, on " << least_on << ", off " << least_off);
    EXPECT_EQ(relay.applied(), static_cast<S>(off));
    const double bound = 0.5 * std::max({1, least_on, least_off}) + 1e-2;
    double asked = 0;
    std::int64_t delivered = 0;
    bool full = false, is_on = false;
    int since = 1000;  // samples without a change
    for (int w = 0; w < 200; ++w) {
      const double share = random.index(4) == 0 ? random.index(2) : random.uniform(-0.3, 1.3);
      // As its scalar has it.
      const S u = static_cast<S>(off + share * (on - off));
      const auto from = static_cast<double>(static_cast<S>(off));
      asked += window * std::clamp((static_cast<double>(u) - from) /
                                       (static_cast<double>(static_cast<S>(on)) - from),
                                   0.0, 1.0);
      const auto allowed =
          nearest(asked - static_cast<double>(delivered), window, least_on, least_off, full);
      int n = 0;
      for (int k = 0; k < window; ++k) {
        EXPECT_EQ(relay.begins(), k == 0);
        // u counts at the start of a window alone.
        const bool next = relay.update(k == 0 ? u : static_cast<S>(random.uniform(off, on + 1e-9)));
        EXPECT_FALSE(k > 0 && next && !is_on) << "on comes first";
        if (next != is_on) {
          EXPECT_GE(since, is_on ? least_on : least_off) << "window " << w;
          since = 0;
        }
        is_on = next;
        ++since;
        n += is_on;
      }
      EXPECT_TRUE(std::count(allowed.begin(), allowed.end(), n) == 1) << n << ", window " << w;
      delivered += n;
      EXPECT_LE(std::abs(asked - static_cast<double>(delivered)), bound);
      EXPECT_NEAR(static_cast<double>(relay.applied()), off + (on - off) * n / window,
                  4 * static_cast<double>(std::numeric_limits<S>::epsilon()) *
                      (std::abs(on) + std::abs(off)));
      if (n == window) {
        EXPECT_EQ(relay.applied(), static_cast<S>(on));
      }
      full = n == window;
    }
  }
}

TEST(TimeProportioned, KeepsItsTimesAndItsMean) {
  keeps_its_times<double>(1);
  keeps_its_times<float>(2);
}

TimeProportionedConfig<> usual() {
  return {.on = 100.0, .window = 10.0, .least_on = 2.0, .least_off = 3.0, .sample_time = 1.0};
}

/// The time on of a window.
template <class Relay, class S>
int window_of(Relay& relay, S u) {
  int n = 0;
  do n += relay.update(u);
  while (!relay.begins());
  return n;
}

/// Of a fresh one, both sides of each boundary.
TEST(TimeProportioned, RoundsToTheNearest) {
  const auto first = [](double u) {
    auto relay = TimeProportioned<>::make(usual()).value();
    return window_of(relay, u);
  };
  EXPECT_EQ(first(9.99), 0);
  EXPECT_EQ(first(10.01), 2);
  EXPECT_EQ(first(24.99), 2);
  EXPECT_EQ(first(25.01), 3);
  EXPECT_EQ(first(69.99), 7);
  EXPECT_EQ(first(84.99), 7);
  EXPECT_EQ(first(85.01), 10);
  for (const double u : {100.0, 100.1, 1e308}) EXPECT_EQ(first(u), 10) << u;
  for (const double u : {0.0, -0.1, -1e308}) EXPECT_EQ(first(u), 0) << u;
  // What is on since the window before may be short; 5 % are owed then.
  auto relay = TimeProportioned<>::make(usual()).value();
  EXPECT_EQ(window_of(relay, 95.0), 10);
  EXPECT_EQ(window_of(relay, 10.01), 1);
  EXPECT_EQ(window_of(relay, 0.0), 0);
}

/// One in ten at 1 %: what is less than a sample comes all the same.
TEST(TimeProportioned, CarriesTheRemainder) {
  auto relay = TimeProportioned<>::make({.on = 1.0, .window = 10.0, .sample_time = 1.0}).value();
  int all = 0;
  for (int w = 0; w < 1000; ++w) all += window_of(relay, 0.01);
  EXPECT_EQ(all, 100);
  // What could not be delivered at full power is not caught up.
  for (int w = 0; w < 1000; ++w) EXPECT_EQ(window_of(relay, 2.0), 10);
  EXPECT_LE(window_of(relay, 0.0), 1);
  for (int w = 0; w < 10; ++w) EXPECT_EQ(window_of(relay, 0.0), 0);
}

TEST(TimeProportioned, IsOffForABadNumber) {
  for (const double bad : {nan, 1 / 0.0, -1 / 0.0}) {
    auto relay = TimeProportioned<>::make(usual()).value();
    EXPECT_EQ(window_of(relay, 8.0), 0);  // 0.8 samples are owed
    EXPECT_EQ(window_of(relay, bad), 0);
    EXPECT_EQ(relay.applied(), 0.0);
    EXPECT_EQ(window_of(relay, 9.99), 0);  // and are forgotten
    EXPECT_EQ(window_of(relay, 10.0), 2);
    // Within a window it is not looked at.
    EXPECT_TRUE(relay.update(100.0));
    for (int k = 1; k < 10; ++k) EXPECT_TRUE(relay.update(bad));
    EXPECT_EQ(relay.applied(), 100.0);
  }
}

template <class S>
void ends_of_the_range() {
  const S most = std::numeric_limits<S>::max();
  auto relay = TimeProportioned<S>::make(
                   {.off = most / 4, .on = -most / 4, .window = S(4), .sample_time = S(1)})
                   .value();
  EXPECT_EQ(window_of(relay, most), 0);
  EXPECT_EQ(window_of(relay, -most), 4);
  EXPECT_EQ(window_of(relay, S(0)), 2);
  EXPECT_EQ(relay.applied(), S(0));
  // As many samples as there may be: none is lost in float.
  auto longest =
      TimeProportioned<S>::make({.on = S(1), .window = S(65536), .sample_time = S(1)}).value();
  EXPECT_EQ(window_of(longest, S(65535) / S(65536)), 65535);
  EXPECT_EQ(longest.applied(), S(65535) / S(65536));
}

TEST(TimeProportioned, HoldsAtTheEndsOfTheRange) {
  ends_of_the_range<double>();
  ends_of_the_range<float>();
}

TEST(TimeProportioned, GoesOnFromASnapshot) {
  auto relay = TimeProportioned<float>::make(
                   {.on = 1.0f, .window = 7.0f, .least_on = 2.0f, .sample_time = 1.0f})
                   .value();
  Random random(3);
  for (int k = 0; k < 45; ++k) relay.update(static_cast<float>(random.uniform(0, 1)));
  auto other = esokit::from_snapshot<TimeProportioned<float>>(esokit::snapshot(relay)).value();
  for (int k = 0; k < 200; ++k) {
    const auto u = static_cast<float>(random.uniform(0, 1));
    ASSERT_EQ(relay.update(u), other.update(u));
    ASSERT_EQ(relay.applied(), other.applied());
  }
}

TEST(TimeProportioned, RefusesByRule) {
  const auto rule = [](const auto& change) {
    auto config = usual();
    change(config);
    return refusal(TimeProportioned<>::make(config));
  };
  EXPECT_EQ(rule([](auto&) {}), "accepted");
  EXPECT_EQ(rule([](auto& c) { c.off = nan; }), "off: must be finite");
  EXPECT_EQ(rule([](auto& c) { c.on = 1 / 0.0; }), "on: must be finite");
  EXPECT_EQ(rule([](auto& c) { c.off = -(c.on = 1e308); }), "on: minus off must be finite");
  EXPECT_EQ(rule([](auto& c) { c.off = c.on; }), "on: must differ from off");
  EXPECT_EQ(rule([](auto& c) { c.on = -1; }), "accepted");
  EXPECT_EQ(rule([](auto& c) { c.sample_time = 0; }), "sample_time: must be finite and positive");
  EXPECT_EQ(rule([](auto& c) { c.window = nan; }), "window: must be finite and positive");
  EXPECT_EQ(rule([](auto& c) { c.least_on = -1e-300; }),
            "least_on: must be finite and not negative");
  EXPECT_EQ(rule([](auto& c) { c.least_off = 1 / 0.0; }),
            "least_off: must be finite and not negative");
  EXPECT_EQ(rule([](auto& c) { c.window = 0.9; }), "window: must be 1 to 65536 samples");
  EXPECT_EQ(rule([](auto& c) { c.window = 65537; }), "window: must be 1 to 65536 samples");
  EXPECT_EQ(rule([](auto& c) { c.window = 1e300; }), "window: must be 1 to 65536 samples");
  EXPECT_EQ(rule([](auto& c) { c.sample_time = 1e-320; }), "window: must be 1 to 65536 samples");
  EXPECT_EQ(rule([](auto& c) { c.window = 65536; }), "accepted");
  const char* whole = "window: must be a whole number of samples";
  EXPECT_EQ(rule([](auto& c) { c.window = 10.011; }), whole);
  EXPECT_EQ(rule([](auto& c) { c.window = 9.989; }), whole);
  EXPECT_EQ(rule([](auto& c) { c.window = 10.009; }), "accepted");
  EXPECT_EQ(rule([](auto& c) { c.window = 9.991; }), "accepted");
  const char* fit = "least_on: and least_off, rounded up to samples, must fit into the window";
  EXPECT_EQ(rule([](auto& c) { c.least_on = 7.009; }), "accepted");
  EXPECT_EQ(rule([](auto& c) { c.least_on = 7.011; }), fit);
  EXPECT_EQ(rule([](auto& c) { c.least_off = 8.1; }), fit);
  EXPECT_EQ(rule([](auto& c) { c.least_off = 1e308; }), fit);
  // Rounded up: 2.1 samples are three.
  auto config = usual();
  config.least_on = 2.1;
  auto relay = TimeProportioned<>::make(config).value();
  EXPECT_EQ(window_of(relay, 16.0), 3);
  EXPECT_EQ(window_of(relay, 25.0), 0);
}

}  // namespace control_time_proportioned_test
}  // namespace esokit_test
