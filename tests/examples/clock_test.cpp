// The clock of a log: unit by value and step, counters that begin anew, stamps that are repeated.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <from_log/parts/clock.hpp>
#include <string>
#include <vector>

namespace esokit_test {
namespace examples_clock_test {

using from_log::ClockRead;

/// As a log has it, with so many decimals.
std::vector<double> written(double begin, double unit, double rows_apart, int rows, int decimals) {
  std::vector<double> all;
  for (int k = 0; k < rows; ++k) {
    char text[64];
    std::snprintf(text, sizeof text, "%.*f", decimals, (begin + k * rows_apart) / unit);
    all.push_back(std::strtod(text, nullptr));
  }
  return all;
}

ClockRead read(const std::vector<double>& stamps) {
  ClockRead of;
  of.first = stamps.front();
  of.last = stamps.back();
  of.step = from_log::usual_step(stamps);
  of.whole = true;
  for (const double stamp : stamps)
    of.whole = of.whole && !(stamp < std::floor(stamp)) && !(stamp > std::floor(stamp));
  return of;
}

// {s, ms, us, ns, 100 ns, min, day, index} x {1970, 1904, 1900, 0} x rows of 0.1 ms to 1 h: the
// right unit, or none. A wrong unit with an alarm is counted, too: 1e6 in ms is 1 ms of a counter
// of ns, which is far more usual than a row in 17 minutes.
TEST(Clock, AUnitIsRightOrAskedFor) {
  const double apart[] = {1e-4, 2e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1, 0.2,  0.5,  1,   2,
                          5,    10,   30,   60,   90,   100,  300,  600,  900, 1000, 1800, 3600};
  struct Unit {
    const char* name;
    double seconds;
    int decimals;
  };
  const Unit units[] = {{"s", 1, 4},        {"ms", 1e-3, 1}, {"us", 1e-6, 0},   {"ns", 1e-9, 0},
                        {"100ns", 1e-7, 0}, {"min", 60, 8},  {"day", 86400, 11}};
  const double year = 365.2425 * 86400;
  const std::pair<const char*, double> epochs[] = {
      {"1970", 54.9 * year}, {"1904", 120.9 * year}, {"1900", 124.9 * year}, {"0", 0}};
  for (const Unit& unit : units) {
    for (const auto& [epoch, begin] : epochs) {
      int right = 0, asked = 0, wrong = 0, loud = 0;
      for (const double T : apart) {
        auto stamps = written(begin, unit.seconds, T, 2000, unit.decimals);
        from_log::spread_stamps(stamps);
        if (!(from_log::usual_step(stamps) > 0)) continue;
        const auto verdict = from_log::judge_clock(read(stamps));
        if (!verdict.told())
          ++asked;
        else if (std::abs(verdict.unit / unit.seconds - 1) < 1e-9)
          ++right;
        else if (verdict.doubtful)
          loud += T < 1000 ? 1 : 0;
        else {
          ++wrong;
          ADD_FAILURE() << unit.name << " since " << epoch << ", rows " << T << " s, is read as "
                        << verdict.unit << " s";
        }
      }
      std::printf("%5s since %4s: right %2d, asked for %2d, wrong with an alarm %d, wrong %d\n",
                  unit.name, epoch, right, asked, loud, wrong);
      const bool started = std::string(epoch) == "0";
      if (!started) {
        EXPECT_GE(right, 15) << unit.name << " since " << epoch;
      }
      EXPECT_EQ(loud, 0) << unit.name << " since " << epoch;
    }
  }
  for (const double first : {0.0, 1.0}) {
    const auto verdict = from_log::judge_clock(read(written(first, 1, 1, 1000, 0)));
    EXPECT_FALSE(verdict.told()) << "rows that are counted are no time";
  }
}

TEST(Clock, ExamplesByValueAndStep) {
  const auto unit = [](double first, double step, bool whole = true) {
    return from_log::judge_clock(
               {.first = first, .last = first + 3000 * step, .step = step, .whole = whole})
        .unit;
  };
  EXPECT_EQ(unit(1.5e12, 6e4), 1e-3);
  EXPECT_EQ(unit(1.5e12, 1e6), 1e-9);
  EXPECT_EQ(unit(1.5e9, 60), 1);
  EXPECT_EQ(unit(1.5e9, 1000), 1e-6);
  EXPECT_EQ(unit(45352.5, 1.157e-5, false), 86400);
  EXPECT_EQ(unit(738000.25, 1.0 / 1440, false), 86400);  // datenum of MATLAB
  EXPECT_EQ(unit(0, 0.8, false), 1);
  EXPECT_EQ(unit(0, 0.00123, false), 1);
  EXPECT_EQ(unit(0, 1), 0);
  EXPECT_EQ(unit(0, 20), 0);
  EXPECT_EQ(unit(1.5e9, 100), 0);  // 0.1 ms of a counter, or 100 s since 1970
}

TEST(Clock, CountersThatBeginAnewRiseAgain) {
  for (const double turn : {65536.0, 4294967296.0}) {
    std::vector<double> stamps, rising;
    for (int k = 0; k < 20000; ++k) {
      rising.push_back(turn - 5000 + 10.0 * k);
      stamps.push_back(std::fmod(rising.back(), turn));
    }
    const auto found = from_log::unwrap_counter(stamps);
    EXPECT_EQ(found.turn, turn);
    EXPECT_EQ(stamps, rising);
  }
  // A clock that was set back, or two recordings.
  std::vector<double> set;
  for (int k = 0; k < 2000; ++k) set.push_back(k < 1000 ? 60000 + 10 * k : 10.0 * k);
  const auto before = set;
  EXPECT_EQ(from_log::unwrap_counter(set).turns, 0U);
  EXPECT_EQ(set, before);
}

// Rows at T with stamps of so many digits: at equal steps again, to within the digits.
TEST(Clock, RoundedStampsAreSpread) {
  for (const double T : {0.0015, 0.0004, 0.0001, 0.00013}) {
    std::vector<double> stamps;
    for (int k = 0; k < 5000; ++k) stamps.push_back(std::floor(k * T * 1000 + 1e-9) / 1000);
    const auto found = from_log::spread_stamps(stamps);
    EXPECT_TRUE(found.spread) << T;
    for (std::size_t k = 0; k < stamps.size(); ++k)
      ASSERT_NEAR(stamps[k], T * static_cast<double>(k), 0.0011) << T;
    EXPECT_NEAR(stamps[100] - stamps[99], T, 3e-3 * T);
  }
  // Nothing is done to missing rows, to jitter, and to what is right.
  std::vector<double> missing, jitter, right;
  for (int k = 0; k < 5000; ++k) {
    if (k % 5 != 2) missing.push_back(0.002 * k);
    jitter.push_back(0.002 * k + 1e-7 * ((k * 7919) % 3001));
    right.push_back(0.001 * k);
  }
  for (auto* stamps : {&missing, &jitter, &right}) {
    const auto before = *stamps;
    EXPECT_FALSE(from_log::spread_stamps(*stamps).spread);
    EXPECT_EQ(*stamps, before);
  }
  // Rows of one stamp with a gap in between: spread, and the gap stays.
  std::vector<double> gap;
  for (int k = 0; k < 2000; ++k) gap.push_back(std::floor((k < 1000 ? 0 : 100) + k * 0.1));
  EXPECT_TRUE(from_log::spread_stamps(gap).spread);
  for (std::size_t k = 1; k < gap.size(); ++k)
    ASSERT_NEAR(gap[k] - gap[k - 1], k == 1000 ? 100.1 : 0.1, 1e-6) << k;
}

}  // namespace examples_clock_test
}  // namespace esokit_test
