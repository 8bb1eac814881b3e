// Rows that come in bursts, with a gap every few rows.
#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <esokit/identify/identify.hpp>
#include <esokit/sim/gaussian.hpp>
#include <functional>
#include <string>
#include <vector>

namespace esokit_test {
namespace identify_gaps_test {
namespace {

using namespace esokit;

constexpr double T = 0.1;

/// y' = b0 u(t - 0.3 s) - 0.2 y through 1 s of lag, of which a logger keeps some rows.
struct Machine {
  double b0 = 0.0;
  std::uint64_t seed = 1;

  [[nodiscard]] Log log(const std::function<bool(int, double)>& keeps) const {
    constexpr int rows = 6000, delay = 3;
    sim::Gaussian random(seed);
    Log log;
    std::vector<double> u(rows);
    double held = 0.0, y = 0.0, v = 0.0;
    for (int k = 0, left = 0; k < rows; ++k) {
      if (left-- <= 0) {
        held = std::round(4.0 * random.next());
        left = 20 + static_cast<int>(60.0 * std::abs(random.next()));
      }
      u[static_cast<std::size_t>(k)] = held;
      // Share of a normal variable above it, roughly: a number from 0 to 1.
      const double uniform = 1.0 / (1.0 + std::exp(-1.702 * random.next()));
      const double noise = 0.1 * b0 * random.next();
      if (keeps(k, uniform)) {
        log.time.push_back(T * k);
        log.u.push_back(held);
        log.y.push_back(y + noise);
      }
      const double acts = k < delay ? 0.0 : u[static_cast<std::size_t>(k - delay)];
      constexpr int parts = 50;
      for (int i = 0; i < parts; ++i) {
        v += T / parts * (acts - v);
        y += T / parts * (b0 * v - 0.2 * y);
      }
    }
    return log;
  }
};

struct Kind {
  const char* name;
  std::function<bool(int, double)> keeps;
  bool bursts;
};

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {"ten rows, ten missing", [](int k, double) { return k % 20 < 10; }, true},
      {"three of ten", [](int k, double) { return k % 10 < 3; }, true},
      {"thirty rows, eight missing", [](int k, double) { return k % 38 < 30; }, true},
      {"forty rows, eighteen missing", [](int k, double) { return k % 58 < 40; }, true},
      {"four of five at random", [](int, double uniform) { return uniform < 0.8; }, false},
      {"two rows a second and one between", [](int k, double) { return k % 5 == 0 || k % 10 == 2; },
       false}};
  return all;
}

TEST(Gaps, AreBridged) {
  for (const Kind& kind : kinds()) {
    for (const double b0 : {0.05, -3.0}) {
      SCOPED_TRACE(std::string(kind.name) + ", b0 " + std::to_string(b0));
      const Log log = Machine{b0, 11}.log(kind.keeps);
      const auto prepared = prepare(log);
      ASSERT_TRUE(prepared) << prepared.error().field;
      const LogReport& report = prepared->report;
      EXPECT_EQ(report.burst > 0.0, kind.bursts);
      if (kind.bursts) {
        EXPECT_NEAR(report.burst, T, 1e-9);
        EXPECT_EQ(report.pieces, 1u);
        EXPECT_GT(report.sample_time, report.burst);
        EXPECT_LE(report.sample_time, 5.0 * report.burst);
      }
      const auto found = identify(log, {.orders = {1}});
      ASSERT_TRUE(found) << found.error().field;
      // 95 % of such intervals hold it; twice of one is as good as certain.
      EXPECT_NEAR(found->input_gain.value, b0, 2.0 * found->input_gain.half_width);
      EXPECT_LT(found->input_gain.share(), 0.1);
    }
  }
}

TEST(Gaps, ThatAreLongAreNotBridged) {
  // Across gaps of 60 rows nothing is seen of what 20 rows show, nor where it would take 5.5 T.
  for (const int apart : {80, 41}) {
    const Log log = Machine{1.0, 12}.log([=](int k, double) { return k % apart < 20; });
    const auto prepared = prepare(log);
    ASSERT_FALSE(prepared) << apart;
    EXPECT_STREQ(prepared.error().field, "rows");
  }
}

TEST(Gaps, InWhichUMovesAreNotBridged) {
  Log log = Machine{1.0, 15}.log([](int k, double) { return k % 20 < 10; });
  for (std::size_t k = 0; k < log.u.size(); ++k) log.u[k] -= 0.1 * log.y[k];
  const auto prepared = prepare(log);
  ASSERT_FALSE(prepared);
  EXPECT_STREQ(prepared.error().field, "rows");
}

TEST(Gaps, AFewLeaveTheLogAsItIs) {
  const Log log = Machine{1.0, 13}.log([](int k, double) { return k % 600 < 580; });
  const auto prepared = prepare(log);
  ASSERT_TRUE(prepared);
  EXPECT_EQ(prepared->report.burst, 0.0);
  EXPECT_NEAR(prepared->report.sample_time, T, 1e-9);
  EXPECT_EQ(prepared->report.pieces, 10u);
}

TEST(Gaps, OfRowsWithoutTimeAreNumbersThatAreMissing) {
  const Log all = Machine{1.0, 14}.log([](int, double) { return true; });
  Log log{.u = all.u, .y = all.y, .sample_time = T};
  for (std::size_t k = 0; k < log.y.size(); ++k) {
    if (k % 20 >= 10) log.y[k] = std::nan("");
  }
  const auto found = identify(log, {.orders = {1}});
  ASSERT_TRUE(found) << found.error().field;
  EXPECT_NEAR(found->log.burst, T, 1e-9);
  EXPECT_NEAR(found->input_gain.value, 1.0, 2.0 * found->input_gain.half_width);
}

}  // namespace
}  // namespace identify_gaps_test
}  // namespace esokit_test
