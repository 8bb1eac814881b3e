/// @file
/// Which clock a column of numbers is: its unit by value and step together, counters that begin
/// anew, stamps that are repeated or rounded.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/csv.hpp"

namespace from_log {

/// A unit of time, as --time-unit has it.
struct ClockUnit {
  const char* name;
  double seconds;
};
inline constexpr ClockUnit clock_units[] = {{"ns", 1e-9}, {"100ns", 1e-7}, {"us", 1e-6},
                                            {"ms", 1e-3}, {"s", 1},        {"min", 60},
                                            {"h", 3600},  {"day", 86400}};

/// Seconds of a unit of time by any of its names, 0 of another word.
inline double seconds_of(std::string_view word) {
  struct Names {
    std::string_view words;
    double seconds;
  };
  constexpr Names all[] = {{" s sec secs second seconds sekunde sekunden ", 1},
                           {" ms msec millis millisecond milliseconds ", 1e-3},
                           {" us \xc2\xb5s \xce\xbcs usec micros microsecond microseconds ", 1e-6},
                           {" ns nsec nanos nanosecond nanoseconds ", 1e-9},
                           {" 100ns ", 1e-7},
                           {" min mins minute minutes minuten ", 60},
                           {" h hr hrs hour hours stunden ", 3600},
                           {" day days d tage ", 86400}};
  if (word.empty()) return 0.0;
  const std::string blank = " " + std::string(word) + " ";
  for (const Names& names : all) {
    if (names.words.find(blank) != std::string_view::npos) return names.seconds;
  }
  return 0.0;
}

inline const char* unit_name(double seconds) {
  const ClockUnit* best = clock_units;
  for (const ClockUnit& unit : clock_units) {
    if (seconds > 0.5 * unit.seconds) best = &unit;
  }
  return best->name;
}

/// A time as people say it, three digits of it.
inline std::string time_text(double seconds) {
  const double size = std::abs(seconds);
  // 59.97 s is a minute but for the rounding.
  const double unit = size >= 2 * 86400 * 0.9995 ? 86400
                      : size >= 3600 * 0.9995    ? 3600
                      : size >= 120 * 0.9995     ? 60
                      : size >= 0.9995           ? 1
                      : size >= 0.9995e-3        ? 1e-3
                      : size >= 0.9995e-6        ? 1e-6
                      : size > 0                 ? 1e-9
                                                 : 1;
  return esokit::examples::number_text(seconds / unit, 3) + " " + unit_name(unit);
}

/// How fast a machine is, by the name of y: a speed or an angle, a temperature or a level.
enum class Pace { unknown, quick, slow };

/// The numbers of a clock.
struct ClockRead {
  double first = 0;      ///< as in the file
  double last = 0;       ///< as in the file
  double step = 0;       ///< the usual one from row to row, above 0
  bool whole = false;    ///< all are whole numbers
  bool counter = false;  ///< it began anew: no date
  bool steady = true;    ///< no jitter: a grid, from which rows may be missing
  int more_digits = 0;   ///< that the first has, and the steps between rows have not
  bool rounded = false;  ///< steps differ by the last digit only
  bool grid = true;      ///< steady, or jitter of the last digit
  double rounder = 0;    ///< s, of min, h or day: in this unit the numbers have fewer digits

  Pace pace = Pace::unknown;
};

/// What unit they have.
struct ClockVerdict {
  double unit = 0;             ///< s; 0: it has to be asked for
  bool date = false;           ///< since 1970, 1904, 1900, ..
  bool doubtful = false;       ///< another unit is possible: an alarm
  std::vector<double> open{};  ///< units that are possible, s: those to ask for
  [[nodiscard]] bool decided() const { return unit > 0; }
};

namespace detail {

/// Whether it has at most three digits, or is a usual time.
inline bool three_digits(double value) {
  const double scale = std::pow(10.0, 2 - std::floor(std::log10(value)));
  return std::abs(value * scale - std::round(value * scale)) < 2e-5 * value * scale;
}
inline bool one_of(double value, std::initializer_list<double> all, double near_by) {
  return std::any_of(all.begin(), all.end(),
                     [&](double one) { return std::abs(value - one) < near_by * one; });
}
/// A mantissa that people choose.
inline bool chosen(double seconds) {
  const double mantissa = seconds / std::pow(10.0, std::floor(std::log10(seconds) + 1e-9));
  return one_of(mantissa,
                {1, 1.2, 1.5, 1.8, 2, 2.4, 2.5, 2.7, 3, 3.6, 4, 4.5, 5, 6, 7.2, 7.5, 8, 9, 10},
                4e-4);
}
/// Between two rows of a counter.
inline bool fast(double seconds) {
  const double mantissa = seconds / std::pow(10.0, std::floor(std::log10(seconds) + 1e-9));
  return seconds < 0.5 && one_of(mantissa, {1, 2, 2.5, 4, 5, 8, 10}, 0.004);
}
/// Between two rows of what has a date.
inline bool slow(double seconds) {
  return seconds < 60.5 ||
         one_of(seconds, {90,  120, 150, 180,  240,  300,  360,  420,  450,  480, 540,
                          600, 720, 900, 1200, 1500, 1800, 2400, 2700, 3600, 7200},
                0.004);
}

/// What a clock of this unit shows, if that is a year between 1998 and 2040.
enum class Date {
  none,
  rare,    ///< since a year from which nobody counts in this unit
  seldom,  ///< in use, but a clock that runs may show the same
  usual
};
inline Date date_of(double value, double unit) {
  const double year = 365.2425 * 86400 / unit;
  const auto since = [&](double epoch) {
    return value > (1998 - epoch) * year && value < (2040 - epoch) * year;
  };
  const auto is = [&](double other) { return std::abs(unit / other - 1) < 1e-6; };
  if (is(86400)) {  // spreadsheets, MATLAB; R, spreadsheets of a Mac, of the year 1
    if (since(1900) || since(-1)) return Date::usual;
    if (since(1970) || since(1904) || since(1)) return Date::seldom;
    if (since(-4713 + 1.0 / 8) || since(1858.88)) return Date::rare;  // Julius, and modified
  } else if (is(1e-7)) {
    if (since(1601) || since(1)) return Date::usual;
  } else if (is(1)) {  // LabVIEW, NTP; since 1980 or 2000
    if (since(1970)) return Date::usual;
    if (since(1904) || since(1900) || (value > 6e8 && value < 9e8)) return Date::seldom;
  } else if (unit < 1 && since(1970)) {
    return Date::usual;
  }
  return since(1970) || since(1904) || since(1900) || since(1601) || since(1) ? Date::rare
                                                                              : Date::none;
}
inline bool is_date(double value, double unit) { return date_of(value, unit) != Date::none; }

/// The largest power of ten of which all values are multiples, to within `off`; 0 below 1e-12.
inline double grain_of(const std::vector<double>& values, double unit, double off) {
  for (int place = 3; place > -13; --place) {
    const double grain = std::pow(10.0, place);
    if (10 * off > grain) break;
    if (std::all_of(values.begin(), values.end(), [&](double value) {
          const double times = value * unit / grain;
          return std::abs(times - std::round(times)) * grain <=
                 off + 1e-15 * std::abs(value * unit);
        }))
      return grain;
  }
  return 0.0;
}

/// Whether what people log of a machine of this pace is so far apart.
inline bool usual_rows(double T, Pace pace) {
  if (pace == Pace::quick) return T > 0.99e-4 && T < 1.01;
  return T > 0.09 && (T < 60.5 || (slow(T) && T < 3601));
}

/// A mantissa of rows of a clock in minutes or hours, of less than one of them.
inline bool chosen_part(double seconds) {
  const double mantissa = seconds / std::pow(10.0, std::floor(std::log10(seconds) + 1e-9));
  return one_of(mantissa, {1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7.5, 8, 10}, 4e-4);
}

/// Whether a clock of fractions from zero may have this unit, and not seconds.
inline bool rival(const ClockRead& read, double unit) {
  const double T = read.step * unit;
  if (!read.steady || !chosen(T)) return false;
  if (unit < 0.5) return read.pace != Pace::slow && unit > 0.5e-3 && T > 0.49e-4 && T < 1;
  // Of a temperature, rows of ms in seconds are less likely than usual ones in minutes or hours.
  if (read.pace == Pace::slow && !usual_rows(read.step, read.pace)) return usual_rows(T, read.pace);
  // What is no step of a log in seconds.
  if (unit > 1.5 && !fast(read.step) && read.step < 1.0 / 60) return chosen_part(T);
  // Minutes count what is a second apart, hours and days a minute.
  const double least = unit > 3599 ? 60 : 1;
  return read.pace != Pace::quick && unit > 1.5 && T > 0.99 * least;
}

}  // namespace detail

/// The unit in which the numbers have far fewer digits than as they stand: 0.016667, 0.033333 are
/// 1 and 2 s in minutes, 0.28833 and 0.30083 are 17.3 and 18.05 s. 0: none.
inline double rounder_unit(const std::vector<double>& values) {
  const double as_written = detail::grain_of(values, 1.0, 0.0);
  const double digit = as_written > 0 ? as_written : 1e-12;
  for (const double unit : {60.0, 3600.0, 86400.0}) {
    if (detail::grain_of(values, unit, 0.51 * digit * unit) > 99 * digit) return unit;
  }
  return 0.0;
}

/// The step from stamp to stamp: the mean of those that are not gaps.
inline double usual_step(const std::vector<double>& stamps) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < stamps.size(); ++k) {
    if (stamps[k] > stamps[k - 1]) steps.push_back(stamps[k] - stamps[k - 1]);
  }
  if (steps.empty()) return 0.0;
  const auto at = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), at, steps.end());
  const double middle = *at;
  double sum = 0, count = 0;
  for (const double step : steps) {
    if (step > 0.4 * middle && step < 1.6 * middle) sum += step, ++count;
  }
  return sum / count;
}

/// Whether stamps lie on a grid, from which some may be missing.
/// @param digit the last of the file, by which they are rounded
inline bool is_steady(const std::vector<double>& stamps, double step, double digit = 0) {
  std::size_t off = 0;
  for (std::size_t k = 1; k < stamps.size(); ++k) {
    const double steps = (stamps[k] - stamps[k - 1]) / step;
    off += std::abs(steps - std::round(steps)) > std::max(0.004, 1.1 * digit / step) ? 1U : 0U;
  }
  return 20 * off < stamps.size();
}

/// The numbers of a column.
/// @param origin added to each
/// @param counter it began anew
inline ClockRead read_clock(const std::vector<double>& stamps, double origin, bool counter,
                            Pace pace) {
  std::vector<double> numbers = stamps;
  for (double& number : numbers) number += origin;
  ClockRead read{.first = numbers.front(),
                 .last = numbers.back(),
                 .step = usual_step(stamps),
                 .whole = detail::grain_of(numbers, 1.0, 0.0) >= 1.0,
                 .counter = counter,
                 .pace = pace};
  if (!(read.step > 0)) return read;
  read.steady = read.grid = is_steady(stamps, read.step);
  if (read.whole) return read;
  read.rounder = rounder_unit(numbers);
  const double grain = detail::grain_of(numbers, 1.0, 0.0);
  // Where double ends, digits are none of the file's.
  const double digit = std::max(grain, 4e-16 * std::abs(read.last));
  read.grid = is_steady(stamps, read.step, digit);
  const double of_step = detail::grain_of({read.step}, 1.0, 0.05 * digit);
  const double off_grid = std::abs(std::remainder(read.first, of_step));
  while (off_grid > 0.5 * digit && read.more_digits < 9 &&
         of_step > 9 * digit * std::pow(10.0, read.more_digits))
    ++read.more_digits;
  double low = 0, high = 0;
  const double step = (stamps.back() - stamps.front()) / static_cast<double>(stamps.size() - 1);
  for (std::size_t k = 0; k < stamps.size(); ++k) {
    const double off = stamps[k] - stamps[0] - step * static_cast<double>(k);
    low = std::min(low, off), high = std::max(high, off);
  }
  read.rounded = high - low > 0.4 * grain && high - low < 2.1 * grain && step < 20 * grain;
  return read;
}

namespace detail {

/// Fractions from zero. Most logs count seconds so; an alarm where another unit is as even.
inline ClockVerdict judge_fractions(const ClockRead& read, const std::vector<double>& clocks,
                                    ClockVerdict found) {
  const auto any = [&](auto&& is) { return std::any_of(clocks.begin(), clocks.end(), is); };
  const bool seconds = any([](double unit) { return unit > 0.5 && unit < 1.5; });
  if (!seconds || read.step > 60.5 || read.step < 0.45e-4 || read.rounder > 0) return found;
  // A clock of seconds whose rows are so even begins with as few digits.
  if (read.steady && read.more_digits > 1 &&
      any([&](double unit) { return unit > 1.5 && chosen_part(read.step * unit); }))
    return found;
  // Nor do rows of a second or more begin a tenth of a second later.
  if (read.steady && read.more_digits > 0 && read.step > 0.9995 && read.pace != Pace::slow)
    return found;
  const bool even = three_digits(read.step) || chosen(read.step);
  if (!even && any([&](double unit) { return unit > 1.5 && chosen(read.step * unit); }))
    return found;
  found.unit = 1;
  found.doubtful = any([&](double unit) { return rival(read, unit); });
  // 0.000266667 is 1/3750 s, or 0.016 s in minutes.
  found.doubtful = found.doubtful || (read.steady && !even && any([&](double unit) {
                                        return unit > 1.5 && three_digits(read.step * unit);
                                      }));
  // From 1 on these are as often ms of a clock of us: 1.003, 2.006 of a sketch.
  found.doubtful = found.doubtful || read.step > 0.9995 || (read.rounded && read.step > 0.0495);
  if (read.step < 0.9995 || read.pace == Pace::slow) return found;
  if (read.pace == Pace::unknown && read.steady && even) return found;
  found.unit = read.pace == Pace::quick && usual_rows(read.step * 1e-3, read.pace) ? 1e-3 : 0;
  found.doubtful = found.decided();
  return found;
}

/// Whole numbers: they may be rows, or have any unit; with an alarm where one is usual.
inline ClockVerdict judge_counter(const ClockRead& read, const std::vector<double>& clocks,
                                  ClockVerdict found) {
  // Of a large number one unit may be some minutes, and the others weeks. (A clock of 100 ns is one
  // with a date.)
  std::vector<double> hours, usual;
  bool weeks = true;
  for (const double unit : clocks) {
    if (unit > 0.9e-7 && unit < 1.1e-7) continue;
    if (read.last * unit < 2 * 86400)
      hours.push_back(unit);
    else
      weeks = weeks && read.first * unit > 7 * 86400;
    if (unit < 1.5 && usual_rows(read.step * unit, read.pace)) usual.push_back(unit);
  }
  const auto take = [&](double unit) {
    found.unit = unit;
    found.doubtful = true;
    return found;
  };
  if (hours.size() == 1 && weeks && fast(read.step * hours[0]) && read.step * hours[0] > 0.45e-3)
    return take(hours[0]);
  const bool rows = std::abs(read.step - 1) < 0.01 || read.first < -0.5;
  if (read.pace == Pace::unknown || rows || usual.size() != 1) return found;
  return read.last * usual[0] < 2 * 86400 ? take(usual[0]) : found;
}

/// Rows of what has a date.
enum class Rows {
  usual,
  rare,       ///< a counter that has run for days may have them
  of_counter  ///< and one of hours, too
};
/// Rows of 25 min since 1970 are as rare as those of 1.5 ms that a counter of us has in this hour.
inline Rows rows_of_date(const ClockRead& read, double unit, const std::vector<double>& clocks) {
  const double T = read.step * unit;
  if (unit > 86399) {  // some weeks in minutes are a date of a spreadsheet
    const auto counts = [&](double c) {
      return c > 1.5 && (chosen_part(read.step * c) || three_digits(read.step * c));
    };
    if (!read.grid || chosen_part(T) || std::none_of(clocks.begin(), clocks.end(), counts))
      return Rows::usual;
    return one_of(T, {90, 180, 900, 1800, 3600}, 0.004) ? Rows::rare : Rows::of_counter;
  }
  const bool by_the_clock = read.whole || !read.steady;
  if (T < 60.5 ||
      (by_the_clock && one_of(T, {90, 120, 180, 240, 300, 600, 900, 1200, 1800, 3600}, 0.004)))
    return Rows::usual;
  Rows found = Rows::usual;
  for (const double other : clocks) {
    if (!read.whole && other < 0.9e-3) continue;  // us have no fractions
    if (read.step * other < 0.45e-3 || !chosen(read.step * other)) continue;
    if (read.last * other < 2 * 86400) return Rows::of_counter;
    found = Rows::rare;
  }
  return found;
}

}  // namespace detail

/// Value and step together: 1.5e12 with steps of 6e4 is ms since 1970, with steps of 1e6 ns of a
/// running clock. What stays open is not guessed.
inline ClockVerdict judge_clock(const ClockRead& read) {
  using namespace detail;
  constexpr double shortest = 19e-6, longest = 7300, running = 400 * 86400.0;
  std::vector<double> dates, clocks;
  for (const ClockUnit& unit : clock_units) {
    const double T = read.step * unit.seconds;
    if (T < shortest || T > longest) continue;
    if (!read.whole && unit.seconds < 0.9e-6) continue;  // these are whole
    if (!read.counter && is_date(read.first, unit.seconds)) {
      dates.push_back(unit.seconds);
    } else if (read.first > -running / unit.seconds && read.last * unit.seconds < running) {
      clocks.push_back(unit.seconds);
    }
  }
  ClockVerdict found;
  found.open = clocks;
  found.open.insert(found.open.end(), dates.begin(), dates.end());
  std::sort(found.open.begin(), found.open.end());
  const auto take = [&](double unit, bool date, bool doubtful) {
    found.unit = unit;
    found.date = date;
    found.doubtful = doubtful;
    return found;
  };
  const auto any = [&](auto&& is) { return std::any_of(clocks.begin(), clocks.end(), is); };
  const auto any_fast = [&] { return any([&](double c) { return fast(read.step * c); }); };
  if (dates.size() > 1) return found;
  if (dates.size() == 1) {
    const double unit = dates[0], T = read.step * unit;
    const Date date = date_of(read.first, unit);
    const bool runs = any([&](double c) { return read.step * c > 0.99e-4; });
    // Seconds of three days may be hours since 1970, which nobody counts.
    const bool started = date == Date::rare && runs;
    if (started && (read.whole || !(read.last < 30 * 86400))) return found;
    // Minutes and days since a date are numbers that a clock in s or ms has within hours.
    const bool small_number = unit > 1.5;
    const bool another =
        small_number ? read.whole || !slow(T) || (read.step >= shortest && three_digits(read.step))
                     : !clocks.empty() && T > 60.5;
    const bool in_minutes = small_number && unit < 86399;
    const Rows rows = in_minutes || !slow(T) ? Rows::usual : rows_of_date(read, unit, clocks);
    if (rows == Rows::of_counter) return found;
    const bool doubtful = date == Date::seldom || rows == Rows::rare;
    if (!another && !started) return take(unit, true, doubtful && runs);
    if (!started && (small_number || slow(T) == any_fast())) return found;
    if (!started && slow(T)) return take(unit, true, doubtful);
  }
  const bool dated = !dates.empty();
  if (dated && !read.whole) {
    const bool even = three_digits(read.step) || chosen(read.step);
    if (read.steady && read.more_digits > 1) return found;
    if (!even && chosen(read.step * dates[0])) return found;
  }
  found = read.whole ? judge_counter(read, clocks, std::move(found))
                     : judge_fractions(read, clocks, std::move(found));
  found.doubtful = found.doubtful || dated;
  return found;
}

/// A time of day, or minutes and seconds, in one number: 102059 is followed by 102100, 0.59
/// by 1.00.
/// @return the row in which a minute begins; 0: none
inline std::size_t row_of_sixty(const std::vector<double>& numbers) {
  for (const double scale : {1.0, 100.0}) {
    std::size_t found = 0;
    double last = 0, seconds = 0;
    bool all = true;
    for (std::size_t k = 0; k < numbers.size() && all; ++k) {
      const double value = numbers[k] * scale + 1e-6, now = std::fmod(value, 100.0);
      const double step = value - last;
      all = now < 60 && now > -1e-9;
      if (k > 0 && now < seconds) {
        // As far apart as the rows before, if a minute had 60 s.
        const double before = k > 1 ? (numbers[k - 1] - numbers[k - 2]) * scale : 0;
        all = all && std::abs(step - 40 - before) < 0.6 * before + 1e-6 && before < 30;
        found = found > 0 ? found : k;
      }
      last = value, seconds = now;
    }
    if (all && found > 0) return found;
  }
  return 0;
}

/// What had to be done to stamps so that they rise.
struct ClockRepair {
  double turn = 0;           ///< after which the counter began anew; 0: it did not
  std::size_t turns = 0;     ///< how often
  std::size_t repeated = 0;  ///< rows with the stamp of the row before
  bool spread = false;       ///< rows were put at equal steps between stamps
  bool left_out = false;     ///< rows were left out, as few stamps are repeated
};

/// Where a counter falls by its range but for one step: 2^16 or 2^32, or 2^32 us in ms or s.
inline ClockRepair unwrap_counter(std::vector<double>& stamps) {
  ClockRepair found;
  std::vector<double> steps;
  double fall = 0;
  for (std::size_t k = 1; k < stamps.size(); ++k) {
    const double step = stamps[k] - stamps[k - 1];
    if (step > 0) steps.push_back(step);
    fall = std::min(fall, step);
  }
  if (!(fall < 0) || steps.size() < 10) return found;
  const auto middle = steps.begin() + static_cast<std::ptrdiff_t>(steps.size() / 2);
  std::nth_element(steps.begin(), middle, steps.end());
  for (const double turn : {65536.0, 4294967296.0, 4294967.296, 4294.967296}) {
    const auto fits = [&](double step) { return step + turn > 0 && step + turn < 20 * *middle; };
    if (!fits(fall) || 20 * *middle > 0.5 * turn) continue;
    std::vector<double> rising = stamps;
    double add = 0;
    bool all = true;
    for (std::size_t k = 1; k < stamps.size(); ++k) {
      const double step = stamps[k] - stamps[k - 1];
      if (step < 0) {
        all = all && fits(step);
        add += turn;
        ++found.turns;
      }
      rising[k] += add;
    }
    if (!all) return {};
    found.turn = turn;
    stamps = std::move(rising);
    return found;
  }
  return found;
}

/// Stamps that are repeated or rounded: put at equal steps, if none of them is then off by more
/// than they are rounded; else the rows of one stamp are spread up to the next. A few repeated ones
/// are for the caller to leave out.
inline ClockRepair spread_stamps(std::vector<double>& stamps) {
  ClockRepair found;
  const std::size_t count = stamps.size();
  if (count < 10) return found;
  double resolution = std::numeric_limits<double>::infinity();
  std::size_t odd = 0;
  for (std::size_t k = 1; k < count; ++k) {
    const double step = stamps[k] - stamps[k - 1];
    if (step < 0) return found;
    if (step > 0)
      resolution = std::min(resolution, step);
    else
      ++found.repeated;
  }
  if (found.repeated == 0) {
    // Rounded: a step is a few times the smallest one, and never between two of these.
    const double usual = usual_step(stamps);
    for (std::size_t k = 1; k < count; ++k) {
      const double steps = (stamps[k] - stamps[k - 1]) / resolution;
      if (std::abs(steps - std::round(steps)) > 0.01) return found;
      odd += std::abs(steps * resolution - usual) > 0.02 * usual ? 1U : 0U;
    }
    // The digits end with a power of ten; else single rows are missing.
    const double place = std::log10(resolution);
    if (std::abs(place - std::round(place)) > 1e-3 || usual > 4.5 * resolution || 4 * odd < count)
      return found;
  } else if (100 * found.repeated < count) {
    found.left_out = true;
    return found;
  }
  // The line of equal steps that the stamps, rounded down, stay on.
  const double step = (stamps.back() - stamps.front()) / static_cast<double>(count - 1);
  double low = 0, high = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const double off = stamps[k] - stamps[0] - step * static_cast<double>(k);
    low = std::min(low, off), high = std::max(high, off);
  }
  if (high - low < 2.1 * resolution) {
    for (std::size_t k = 0; k < count; ++k)
      stamps[k] = stamps[0] + (k == 0 ? 0.0 : step * static_cast<double>(k));
    found.spread = true;
    return found;
  }
  if (found.repeated == 0) return found;
  for (std::size_t from = 0; from < count;) {
    std::size_t to = from + 1;
    while (to < count && !(stamps[to] > stamps[from])) ++to;
    const double rows = static_cast<double>(to - from);
    double length = to < count ? stamps[to] - stamps[from] : 0.0;
    // Up to a gap, and at the end, as before.
    if (to == count || length > 1.6 * resolution)
      length = from > 0 ? std::min(to < count ? length : resolution, resolution) : resolution;
    const double begin = stamps[from];
    for (std::size_t k = from; k < to; ++k)
      stamps[k] = begin + length * static_cast<double>(k - from) / rows;
    from = to;
  }
  found.spread = true;
  return found;
}

}  // namespace from_log
