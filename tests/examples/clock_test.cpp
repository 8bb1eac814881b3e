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
  return from_log::read_clock(stamps, 0, false, from_log::Pace::unknown);
}

// {s, ms, us, ns, 100 ns, min, h, day, index} x {1970, 1904, 1900, 0, clocks that have run for a
// while} x rows of 0.1 ms to 1 h. Read is the right unit, or none, or an alarm sounds.
// `from_log_clocks` reads such files with any seed. Only minutes from zero with rows of 0.3 s, 0.6
// s, .. have every byte of a log in seconds from zero in steps of 5 ms, 10 ms, .., as nearly all
// are.
struct Found {
  int right = 0, asked = 0, loud = 0, same_bytes = 0;
};
struct Unit {
  const char* name;
  double seconds;
  int decimals;
};
Found of_rows(const std::vector<double>& apart, const Unit& unit, double begin,
              const std::string& what) {
  Found found;
  for (const double T : apart) {
    auto stamps = written(begin, unit.seconds, T, 500, unit.decimals);
    const bool spread = from_log::spread_stamps(stamps).spread;  // sounds an alarm, too
    if (!(from_log::usual_step(stamps) > 0)) continue;
    const auto verdict = from_log::judge_clock(read(stamps));
    if (!verdict.decided())
      ++found.asked;
    else if (std::abs(verdict.unit / unit.seconds - 1) < 1e-9)
      ++found.right;
    else if (verdict.doubtful || spread)
      ++found.loud;
    else if (begin == 0 && unit.seconds == 60 && T < 1 && from_log::detail::fast(T / 60))
      ++found.same_bytes;
    else
      ADD_FAILURE() << what << ", rows " << T << " s, is read as " << verdict.unit << " s";
  }
  return found;
}

constexpr double year = 365.2425 * 86400, day = 86400;
const Unit units[] = {{"s", 1, 4},     {"s", 1, 6},       {"ms", 1e-3, 1},    {"ms", 1e-3, 3},
                      {"us", 1e-6, 0}, {"ns", 1e-9, 0},   {"100ns", 1e-7, 0}, {"min", 60, 8},
                      {"h", 3600, 9},  {"day", 86400, 11}};

TEST(Clock, AUnitIsRightOrAskedFor) {
  const std::vector<double> usual = {1e-4, 2e-4, 1e-3, 2e-3, 5e-3, 0.01, 0.02, 0.05, 0.1,
                                     0.2,  0.5,  1,    2,    5,    10,   30,   60,   90,
                                     100,  300,  600,  900,  1000, 1800, 3600};
  const std::vector<double> odd = {1.25e-4, 3e-4,  4e-4, 8e-4, 1.5e-3, 2.5e-3, 4e-3, 8e-3, 0.0125,
                                   0.016,   0.025, 0.03, 0.04, 0.08,   0.125,  0.15, 0.25, 0.3,
                                   0.4,     0.75,  1.2,  1.5,  2.5,    3,      4,    6,    7.5,
                                   12,      15,    20,   25,   40,     45,     50,   120,  150,
                                   180,     240,   450,  720,  1200,   2400,   2700};
  const std::pair<const char*, double> begins[] = {{"1970, 2001", 31.2 * year},
                                                   {"1970, 2024", 54.9 * year},
                                                   {"1904", 120.9 * year},
                                                   {"1900", 124.9 * year},
                                                   {"0", 0},
                                                   {"17.3 s", 17.3},
                                                   {"1 h", 3600.513047},
                                                   {"3 days", 3 * day + 77},
                                                   {"40 days", 40 * day + 1.25}};
  Found all;
  for (const Unit& unit : units) {
    for (const auto& [begin, at] : begins) {
      const std::string what = std::string(unit.name) + " from " + begin;
      Found found;
      for (const auto* apart : {&usual, &odd}) {
        const Found part = of_rows(*apart, unit, at, what);
        found.right += part.right, found.asked += part.asked;
        found.loud += part.loud, found.same_bytes += part.same_bytes;
      }
      all.right += found.right, all.asked += found.asked;
      all.loud += found.loud, all.same_bytes += found.same_bytes;
      const bool in_use =
          from_log::detail::date_of(at / unit.seconds, unit.seconds) > from_log::detail::Date::rare;
      if (at > year && in_use && unit.seconds < 86399) {
        EXPECT_GE(found.right, 60) << what;
      }
      if (at > year) {
        EXPECT_LE(found.loud, 9) << what;
      }
    }
  }
  for (const auto* apart : {&usual, &odd}) of_rows(*apart, units[7], 2740087.47, "a month in min");
  std::printf("right %d, asked for %d, wrong with an alarm %d, bytes of seconds %d\n", all.right,
              all.asked, all.loud, all.same_bytes);
  EXPECT_LE(all.same_bytes, 4);
  EXPECT_LE(all.loud, 200);
  EXPECT_GE(all.right, 2200);
  for (const double first : {0.0, 1.0}) {
    const auto verdict = from_log::judge_clock(read(written(first, 1, 1, 1000, 0)));
    EXPECT_FALSE(verdict.decided()) << "rows that are counted are no time";
  }
}

// What nearly everybody has: seconds from zero are read, with an alarm where another unit is as
// even, and without one where rows jitter or the name of y rules the other out.
TEST(Clock, SecondsFromZeroAreNeverRefused) {
  using from_log::Pace;
  for (const double T : {0.001, 0.002, 0.0025, 0.004, 0.005, 0.008, 0.01, 0.0125, 0.02, 0.025, 0.04,
                         0.05,  0.1,   0.2,    0.25,  0.4,   0.5,   1.5,  2.5,    7.5,  22.5}) {
    for (const double begin : {0.0, 12.0}) {
      ClockRead clock = read(written(begin, 1, T, 2000, 4));
      const auto verdict = from_log::judge_clock(clock);
      EXPECT_EQ(verdict.unit, 1) << T;
      const bool odd = std::abs(T - 0.0125) < 1e-9;  // or 0.75 s in min
      EXPECT_EQ(verdict.doubtful, T > 1.0 / 60 || odd) << T;
      clock.pace = Pace::quick;
      if (T > 0.04 && T < 1) continue;  // 10 kHz in ms
      EXPECT_EQ(from_log::judge_clock(clock).unit, T < 1 ? 1 : 1e-3) << T;
      EXPECT_EQ(from_log::judge_clock(clock).doubtful, T > 1 || odd) << T;
    }
  }
  std::vector<double> jitter = written(0, 1, 0.1, 2000, 4);
  for (std::size_t k = 0; k < jitter.size(); ++k) jitter[k] += 0.001 * static_cast<double>(k % 3);
  EXPECT_FALSE(read(jitter).steady);
  EXPECT_EQ(from_log::judge_clock(read(jitter)).unit, 1);
  EXPECT_FALSE(from_log::judge_clock(read(jitter)).doubtful);
  // A temperature has no kHz, and a speed no minutes.
  ClockRead clock = read(written(0, 1, 0.7, 2000, 4));
  EXPECT_FALSE(from_log::judge_clock(clock).doubtful);
  clock = read(written(0, 1, 0.8, 2000, 4));
  EXPECT_TRUE(from_log::judge_clock(clock).doubtful);
  clock.pace = Pace::slow;  // 48 s in minutes is nothing that people set
  EXPECT_FALSE(from_log::judge_clock(clock).doubtful);
  // 5 ms of a temperature are as likely 0.3 s in minutes, 12.5 ms 45 s in hours.
  for (const double T : {0.005, 0.0125}) {
    clock = read(written(0, 1, T, 2000, 4));
    EXPECT_EQ(from_log::judge_clock(clock).doubtful, T > 0.01) << T;
    clock.pace = Pace::slow;
    EXPECT_EQ(from_log::judge_clock(clock).unit, 1) << T;
    EXPECT_TRUE(from_log::judge_clock(clock).doubtful) << T;
  }
  clock = read(written(0, 1, 0.02, 2000, 4));
  EXPECT_TRUE(from_log::judge_clock(clock).doubtful);  // 1.2 s in minutes
  clock.pace = Pace::quick;
  EXPECT_FALSE(from_log::judge_clock(clock).doubtful);
}

// Whole numbers from zero: asked for, unless the name of y leaves one unit, and then with an alarm.
TEST(Clock, WholeNumbersFromZeroByTheNameOfY) {
  using from_log::Pace;
  const auto unit = [](double step, Pace pace) {
    ClockRead clock = read(written(0, 1, step, 2000, 0));
    clock.pace = pace;
    const auto verdict = from_log::judge_clock(clock);
    EXPECT_EQ(verdict.doubtful, verdict.decided());
    return verdict.unit;
  };
  for (const double step : {1, 2, 10, 20, 60, 100, 1000}) EXPECT_EQ(unit(step, Pace::unknown), 0);
  for (const double step : {2, 10, 50}) EXPECT_EQ(unit(step, Pace::quick), 1e-3) << step;
  for (const double step : {1, 100, 1000}) EXPECT_EQ(unit(step, Pace::quick), 0) << step;
  for (const double step : {5, 10, 60}) EXPECT_EQ(unit(step, Pace::slow), 1) << step;
  for (const double step : {1, 120, 300}) EXPECT_EQ(unit(step, Pace::slow), 0) << step;
  for (const double step : {250, 1000, 5000}) EXPECT_EQ(unit(step, Pace::slow), 1e-3) << step;
}

// In minutes, hours or days these have few digits, and in seconds many.
TEST(Clock, FractionsThatAreRoundInAnotherUnit) {
  const auto clock = [](double begin, double unit, double T, int decimals) {
    return from_log::judge_clock(read(written(begin, unit, T, 2000, decimals)));
  };
  EXPECT_FALSE(clock(0, 60, 1, 8).decided());
  EXPECT_FALSE(clock(0, 60, 1, 4).decided());
  EXPECT_FALSE(clock(0, 60, 1, 2).decided());        // too few digits for that, but the mean step
  EXPECT_FALSE(clock(17.3, 60, 0.75, 8).decided());  // 0.288333 and steps of 0.0125
  EXPECT_FALSE(clock(0, 86400, 45, 9).decided());
  EXPECT_FALSE(clock(0, 3600, 2700.5, 9).decided());
  EXPECT_EQ(clock(17.3, 1, 0.0125, 4).unit, 1);
  // A sketch that divides millis() by 60000: rows jitter by ms.
  std::vector<double> jitter;
  for (int k = 0; k < 2000; ++k)
    jitter.push_back(std::round((k + 0.003 * (k % 5)) / 60 * 1e7) / 1e7);
  EXPECT_EQ(from_log::rounder_unit(jitter), 60);
  EXPECT_FALSE(from_log::judge_clock(read(jitter)).decided());
}

// 8 s are 0.0000926 days but for a ten-thousandth, and days from anywhere have no fewer digits.
TEST(Clock, DaysFromAnywhereAreNoSeconds) {
  for (const double apart : {4.0, 7.5, 8.0, 40.0}) {
    for (const double begin : {26.741662, 4884.910604, 323828.015166}) {
      const auto verdict = from_log::judge_clock(read(written(begin, 86400, apart, 500, 11)));
      EXPECT_TRUE(!verdict.decided() || verdict.doubtful || verdict.unit > 86399)
          << apart << " s from " << begin << " s is read as " << verdict.unit << " s";
    }
  }
}

// A date that few have is no date where a clock that has run for days is as likely.
TEST(Clock, CountersOfWeeksAreNoDatesOfOldEpochs) {
  const double at = 40 * day + 1.25;
  EXPECT_FALSE(from_log::judge_clock(read(written(at, 1e-6, 0.025, 2000, 0))).decided());
  EXPECT_FALSE(from_log::judge_clock(read(written(at, 1e-9, 0.025, 2000, 0))).decided());
  EXPECT_FALSE(from_log::judge_clock(read(written(at, 60, 0.125, 2000, 8))).decided());
  // Thirty days in minutes are 2018 in days of a spreadsheet, with rows of 24 minutes.
  EXPECT_FALSE(from_log::judge_clock(read(written(30 * day, 60, 1, 2000, 8))).decided());
  // Seconds since 1904 of LabVIEW: so, and with an alarm where they may be ms.
  const auto lab = [](double T, int decimals) {
    return from_log::judge_clock(read(written(120.9 * year, 1, T, 2000, decimals)));
  };
  EXPECT_EQ(lab(0.02, 3).unit, 1);
  EXPECT_FALSE(lab(0.02, 3).doubtful);
  EXPECT_TRUE(lab(0.5, 3).doubtful);
  EXPECT_EQ(lab(0.5, 3).unit, 1);
  // Three days in seconds may be hours since 1970.
  const auto days = from_log::judge_clock(read(written(3 * day + 77, 1, 0.02, 2000, 4)));
  EXPECT_EQ(days.unit, 1);
  EXPECT_TRUE(days.doubtful);
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

// 102059, 102100 and 0.59, 1.00: between them is a second.
TEST(Clock, SixtiesInOneNumberAreNoTime) {
  for (const double T : {0.01, 0.5, 1.0, 7.0}) {
    std::vector<double> clock, minutes, seconds, bursts;
    for (int k = 0; k * T < 300; ++k) {
      const double t = 30 + k * T, minute = std::floor(t / 60);
      clock.push_back(102000 + 100 * minute + (t - 60 * minute));
      minutes.push_back((100 * minute + (t - 60 * minute)) / 100);
      seconds.push_back(t);
      if (std::fmod(t, 100) < 50) bursts.push_back(t);
    }
    EXPECT_EQ(from_log::row_of_sixty(clock), static_cast<std::size_t>(std::ceil(30 / T))) << T;
    EXPECT_EQ(from_log::row_of_sixty(minutes), static_cast<std::size_t>(std::ceil(30 / T))) << T;
    EXPECT_EQ(from_log::row_of_sixty(seconds), 0U) << T;
    EXPECT_EQ(from_log::row_of_sixty(bursts), 0U) << T;
  }
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
