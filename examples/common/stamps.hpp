/// @file
/// Stamps of time as people's loggers write them: numbers, dates with a time, times of day.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>

namespace esokit::examples {

/// A stamp that is no plain number: 2024-03-01T12:00:00.010Z, 01.03.2024 12:00:00,01,
/// 01-Mar-2024 12:00:00.01, 12:00:00.5, 1:02:03 PM, 0 days 00:00:01.5.
struct Stamp {
  long double seconds = 0;     ///< of its day, or since its start
  std::optional<long> day;     ///< days since 1970, or of a duration; none: a time of day
  bool zone = false;           ///< the offset from UTC is given, and taken off
  std::string_view date;       ///< as written
  bool either = false;         ///< it may be day/month or month/day
  bool clock_unclear = false;  ///< it may be hours:minutes or minutes:seconds
};

namespace detail {

/// What is left of a text, read from its beginning.
struct Rest {
  std::string_view text;

  bool take(char c) {
    if (text.empty() || text.front() != c) return false;
    text.remove_prefix(1);
    return true;
  }
  bool take(std::string_view word) {
    if (!text.starts_with(word)) return false;
    text.remove_prefix(word.size());
    return true;
  }
  /// Up to `most` digits.
  std::optional<long> digits(std::size_t most, std::size_t* count = nullptr) {
    std::size_t n = 0;
    long value = 0;
    while (n < text.size() && n < most && text[n] >= '0' && text[n] <= '9')
      value = 10 * value + (text[n++] - '0');
    text.remove_prefix(n);
    if (count != nullptr) *count = n;
    if (n == 0) return std::nullopt;
    return value;
  }
  /// Three letters of an English month, as MATLAB writes it.
  std::optional<long> month() {
    constexpr std::string_view all = "JanFebMarAprMayJunJulAugSepOctNovDec";
    const auto at = text.size() < 3 ? all.npos : all.find(text.substr(0, 3));
    if (at == all.npos || at % 3 != 0) return std::nullopt;
    text.remove_prefix(3);
    return static_cast<long>(at / 3 + 1);
  }
};

/// Days since 1970 of a date, by the proleptic Gregorian calendar.
inline std::optional<long> day_number(long year, long month, long day) {
  constexpr std::array<long, 12> lengths = {31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  const auto leaps = [](long y) { return y / 4 - y / 100 + y / 400; };
  const bool leap = leaps(year) > leaps(year - 1);
  if (year < 1 || month < 1 || month > 12 || day < 1) return std::nullopt;
  if (day > lengths[static_cast<std::size_t>(month - 1)] + (leap && month == 2 ? 1 : 0))
    return std::nullopt;
  long days = 365 * (year - 1970) + leaps(year - 1) - leaps(1969) + day - 1;
  for (long m = 1; m < month; ++m) days += lengths[static_cast<std::size_t>(m - 1)];
  return days + (leap && month > 2 ? 1 : 0);
}

/// 2024-03-01, 2024/03/01, 01.03.2024, 01-Mar-2024; 03/04/2024 may be either.
inline bool take_date(Rest& rest, Stamp& stamp) {
  const std::string_view from = rest.text;
  std::size_t count = 0;
  const auto first = rest.digits(4, &count);
  if (!first || rest.text.empty()) return false;
  const char between = rest.text.front();
  if (between != '-' && between != '/' && between != '.') return false;
  rest.take(between);
  auto second = rest.digits(2);
  const bool named = !second;
  if (named) second = rest.month();
  if (!second || !rest.take(between)) return false;
  if (count == 4) {
    const auto third = rest.digits(2);
    if (!third) return false;
    stamp.day = day_number(*first, *second, *third);
  } else {
    const auto year = rest.digits(4, &count);
    if (!year || count != 4) return false;
    const auto day_first = day_number(*year, *second, *first);
    const auto month_first = named ? std::nullopt : day_number(*year, *first, *second);
    stamp.either = between != '.' && day_first && month_first && *first != *second;
    stamp.day = day_first || between == '.' ? day_first : month_first;
  }
  stamp.date = from.substr(0, from.size() - rest.text.size());
  return stamp.day.has_value();
}

/// 12:00:00.010, 12:00:00,010, 12:00, with AM or PM behind it.
inline bool take_time(Rest& rest, Stamp& stamp) {
  const bool dated = stamp.day.has_value();
  auto hours = rest.digits(dated ? 2 : 4);
  if (!hours || !rest.take(':')) return false;
  std::size_t count = 0;
  const auto minutes = rest.digits(2, &count);
  if (!minutes || *minutes > 59 || count != 2) return false;
  long double seconds = 0;
  if (rest.take(':')) {
    const auto whole = rest.digits(2, &count);
    if (!whole || *whole > 59 || count != 2) return false;
    seconds = static_cast<long double>(*whole);
    if (rest.take('.') || rest.take(',')) {
      long double place = 1;
      for (; !rest.text.empty() && rest.text.front() >= '0' && rest.text.front() <= '9';
           rest.text.remove_prefix(1)) {
        place /= 10;
        seconds += place * static_cast<long double>(rest.text.front() - '0');
      }
      if (place == 1) return false;
    }
  } else if (!dated || (!rest.text.empty() && (rest.text[0] == '.' || rest.text[0] == ','))) {
    stamp.clock_unclear = true;
    rest.text = {};
  }
  while (rest.take(' ')) {
  }
  const bool am = rest.take("AM") || rest.take("am"), pm = rest.take("PM") || rest.take("pm");
  if (am || pm) {
    if (*hours < 1 || *hours > 12) return false;
    hours = *hours % 12 + (pm ? 12 : 0);
  }
  if (dated && *hours > 23) return false;
  stamp.seconds = static_cast<long double>(*hours * 3600 + *minutes * 60) + seconds;
  return true;
}

/// Z, UTC, +01:00, -0500, or nothing.
inline bool take_zone(Rest& rest, Stamp& stamp) {
  while (rest.take(' ')) {
  }
  if (rest.text.empty()) return true;
  if (rest.take('Z') || rest.take('z') || rest.take("UTC") || rest.take("GMT")) {
    stamp.zone = true;
    rest.take("[UTC]");
    return rest.text.empty();
  }
  const bool ahead = rest.take('+');
  if (!ahead && !rest.take('-')) return false;
  std::size_t count = 0;
  const auto hours = rest.digits(2, &count);
  if (!hours || *hours > 18 || count != 2) return false;
  long minutes = 0;
  if (rest.take(':') || !rest.text.empty()) {
    const auto more = rest.digits(2, &count);
    if (!more || *more > 59 || count != 2) return false;
    minutes = *more;
  }
  const auto offset = static_cast<long double>(*hours * 3600 + minutes * 60);
  stamp.seconds += ahead ? -offset : offset;
  stamp.zone = true;
  return rest.text.empty();
}

}  // namespace detail

/// Nothing if the text is no stamp.
[[nodiscard]] inline std::optional<Stamp> parse_stamp(std::string_view text) {
  Stamp stamp;
  detail::Rest rest{text};
  const auto word = text.find("day");
  if (word != std::string_view::npos) {  // a duration
    stamp.day = rest.digits(6);
    if (!stamp.day || !rest.take(' ') || !(rest.take("days") || rest.take("day"))) return {};
  } else if (text.find(':') == text.find_first_not_of("0123456789")) {
    // a time of day
  } else if (!detail::take_date(rest, stamp)) {
    return {};
  }
  if (stamp.day && !rest.take('T')) {
    if (rest.text.empty() || (rest.text.front() != ' ' && rest.text.front() != ',')) return {};
    rest.take(',');
    while (rest.take(' ')) {
    }
  }
  if (!detail::take_time(rest, stamp)) return {};
  if (!detail::take_zone(rest, stamp)) return {};
  return stamp;
}

/// Turns a column of stamps into numbers that begin at zero, so that stamps since 1970 lose no
/// digits: seconds, or the unit of plain numbers.
class StampReader {
 public:
  /// @param unusable set to what is wrong with it
  double stamp(const Stamp& at, const char*& unusable) {
    if (at.clock_unclear) unusable = "may be hours:minutes or minutes:seconds: write all three";
    // As long as the date does not change it does not matter which it is.
    if (any_ && (at.either || either_) && at.date != date_)
      unusable = "may be day/month or month/day: write the year first";
    if (any_ && (number_ || at.day.has_value() != dated_ || at.zone != zone_))
      unusable = "is not written as the stamps before";
    if (!any_) {
      any_ = true;
      dated_ = at.day.has_value();
      zone_ = at.zone;
      date_ = at.date;
      either_ = at.either;
      day_ = at.day.value_or(0);
      first_ = at.seconds;
    }
    const long double day = 86400;
    long double seconds = static_cast<long double>(at.day.value_or(0) - day_) * day + at.seconds;
    if (!dated_) {
      // A clock that falls by more than half a day has passed midnight.
      if (seconds + midnights_ * day < last_ - day / 2) midnights_ += 1;
      seconds += midnights_ * day;
      last_ = seconds;
    }
    return static_cast<double>(seconds - first_);
  }

  double number(long double value, const char*& unusable) {
    if (any_ && !number_) unusable = "is not written as the stamps before";
    if (!any_) {
      any_ = number_ = true;
      first_ = value;
    }
    return static_cast<double>(value - first_);
  }

  /// Whether they are numbers, whose unit has to be given.
  [[nodiscard]] bool numbers() const { return number_; }
  /// The first number.
  [[nodiscard]] double origin() const { return number_ ? static_cast<double>(first_) : 0.0; }

 private:
  bool any_ = false, number_ = false, dated_ = false, zone_ = false, either_ = false;
  std::string date_;
  long day_ = 0;
  long double first_ = 0, midnights_ = 0;
  long double last_ = -std::numeric_limits<long double>::infinity();
};

}  // namespace esokit::examples
