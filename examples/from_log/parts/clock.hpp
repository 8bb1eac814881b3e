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

/// The numbers of a clock.
struct ClockRead {
  double first = 0;      ///< as in the file
  double last = 0;       ///< as in the file
  double step = 0;       ///< the usual one from row to row, above 0
  bool whole = false;    ///< all are whole numbers
  bool counter = false;  ///< it began anew: no date
};

/// What unit they have.
struct ClockVerdict {
  double unit = 0;             ///< s; 0: it has to be asked for
  bool date = false;           ///< since 1970, 1904, 1900, ..
  bool doubtful = false;       ///< another unit is possible: an alarm
  std::vector<double> open{};  ///< units that are possible, s: those to ask for
  [[nodiscard]] bool told() const { return unit > 0; }
};

namespace detail {

/// Whether it has at most three digits, or is a usual time.
inline bool three_digits(double value) {
  const double scale = std::pow(10.0, 2 - std::floor(std::log10(value)));
  return std::abs(value * scale - std::round(value * scale)) < 1e-4 * value * scale;
}
inline bool one_of(double value, std::initializer_list<double> all, double near_by) {
  return std::any_of(all.begin(), all.end(),
                     [&](double one) { return std::abs(value - one) < near_by * one; });
}
/// A mantissa that people choose.
inline bool chosen(double seconds) {
  const double mantissa = seconds / std::pow(10.0, std::floor(std::log10(seconds) + 1e-9));
  return one_of(mantissa, {1, 1.2, 1.5, 1.8, 2, 2.5, 3, 3.6, 5, 6, 9, 10}, 4e-4);
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

/// Whether a clock of this unit shows a year between 1998 and 2040. Since 1970 in seconds also what
/// counts since 1980 or 2000; days also those of MATLAB, of Julius and modified.
inline bool is_date(double value, double unit) {
  const double year = 365.2425 * 86400 / unit;
  const auto since = [&](double epoch) {
    return value > (1998 - epoch) * year && value < (2040 - epoch) * year;
  };
  if (unit > 86399 && (since(-1) || since(-4713 + 1.0 / 8) || since(1858.88))) return true;
  if (unit < 1.5 && unit > 0.5 && value > 6e8 && value < 9e8) return true;
  return since(1970) || since(1904) || since(1900) || since(1601) || since(1);
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
  const auto any_fast = [&] {
    return std::any_of(clocks.begin(), clocks.end(), [&](double c) { return fast(read.step * c); });
  };
  if (dates.size() > 1) return found;
  if (dates.size() == 1) {
    const double unit = dates[0], T = read.step * unit;
    // Minutes and days since a date are numbers that a clock in s or ms has within hours.
    const bool small_number = unit > 1.5;
    const bool another = small_number
                             ? read.whole || (read.step >= shortest && three_digits(read.step))
                             : !clocks.empty() && T > 60.5;
    if (!another) return take(unit, true, false);
    if (small_number || slow(T) == any_fast()) return found;
    if (slow(T)) return take(unit, true, false);
  }
  // A clock that was started. Most logs count seconds from zero, with a point; whole numbers may be
  // rows, or have any unit.
  if (!read.whole) {
    const bool seconds = std::find(clocks.begin(), clocks.end(), 1.0) != clocks.end();
    const auto of = [&](double unit) {
      return read.step * unit <= longest && chosen(read.step * unit);
    };
    if (!seconds || read.step > 60) return found;
    if (!three_digits(read.step) && !chosen(read.step) && (of(60) || of(3600) || of(86400)))
      return found;
    // Milliseconds with decimals are as likely above a twentieth where they are a whole number of
    // kHz, and from one on.
    const double kilohertz = 1.0 / read.step;
    const bool whole_kilohertz =
        read.step > 0.049 && std::abs(kilohertz - std::round(kilohertz)) < 1e-4 * kilohertz;
    if (whole_kilohertz || read.step >= 1.0) return found;
    return take(1.0, false, false);
  }
  // Of a large number one unit may be some minutes, and the others weeks. (A clock of 100 ns is one
  // with a date.)
  std::vector<double> hours;
  bool weeks = true;
  for (const double unit : clocks) {
    if (unit > 0.9e-7 && unit < 1.1e-7) continue;
    if (read.last * unit < 2 * 86400)
      hours.push_back(unit);
    else
      weeks = weeks && read.first * unit > 7 * 86400;
  }
  if (hours.size() == 1 && weeks && fast(read.step * hours[0]) && read.step * hours[0] > 0.45e-3)
    return take(hours[0], false, true);
  return found;
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
