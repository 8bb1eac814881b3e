#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "from_log/parts/from_log.hpp"

namespace from_log {
namespace {

using esokit::examples::LogFile;
using esokit::examples::number_text;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// Words of the last part of a name: /joint1/effort_Nm -> effort, nm.
std::vector<std::string> words(const std::string& name) {
  const auto slash = name.find_last_of("/.");
  std::string text = lower(slash == std::string::npos ? name : name.substr(slash + 1));
  std::vector<std::string> all(1);
  for (const char c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || static_cast<unsigned char>(c) > 127) {
      all.back() += c;
    } else if (!all.back().empty()) {
      all.emplace_back();
    }
  }
  if (all.back().empty() && all.size() > 1) all.pop_back();
  return all;
}

/// The only column whose first word is in the list.
std::string guess(const LogFile& file, const char* option, const std::string& given,
                  const std::vector<std::string>& known) {
  if (!given.empty()) return given;
  std::vector<std::string> fits;
  for (const std::string& name : file.header()) {
    if (std::find(known.begin(), known.end(), words(name).front()) != known.end())
      fits.push_back(name);
  }
  if (fits.size() == 1) return fits[0];
  std::string there;
  for (const std::string& name : fits.empty() ? file.header() : fits) {
    there += (there.empty() ? "" : ", ") + name;
  }
  if (there.empty()) there = "numbers 1 to " + std::to_string(file.columns());
  throw LogError("which column is " + std::string(option) + "? Name it with --" + option +
                 " COLUMN; there are " + there);
}

/// Seconds of a unit of time.
double seconds_of(const std::string& unit) {
  static const std::map<std::string, double> all = {
      {"s", 1},       {"sec", 1},     {"secs", 1},   {"seconds", 1},
      {"ms", 1e-3},   {"msec", 1e-3}, {"us", 1e-6},  {"\xc2\xb5s", 1e-6},
      {"usec", 1e-6}, {"ns", 1e-9},   {"nsec", 1e-9}};
  const auto at = all.find(unit);
  return at == all.end() ? 0.0 : at->second;
}

std::string unit_name(double seconds) {
  return seconds > 0.5 ? "s" : seconds > 0.5e-3 ? "ms" : seconds > 0.5e-6 ? "us" : "ns";
}

/// Finds the unit of the stamps: as told, by the column's name, since 1970, or by what a step of a
/// controller can be. Only the last is a guess, and an alarm.
double find_unit(const Settings& settings, Input& input, double first, double step) {
  if (!settings.time_unit.empty()) {
    const double unit = seconds_of(settings.time_unit);
    if (unit > 0.0) return unit;
    throw LogError("--time-unit: '" + settings.time_unit + "' is none of s, ms, us, ns");
  }
  double named = 0.0;
  const auto parts = words(input.time);
  if (parts.size() > 1) named = seconds_of(parts.back());
  if (parts.back() == "millis") named = 1e-3;
  if (parts.back() == "micros") named = 1e-6;
  // t/ms: the unit follows the stroke.
  if (named == 0.0 && input.time.find('/') != std::string::npos) named = seconds_of(parts.back());
  // Between 1998 and 2049; and a step that a controller can have.
  if (named == 0.0) {
    for (const double unit : {1.0, 1e-3, 1e-6, 1e-9}) {
      if (first * unit > 0.9e9 && first * unit < 2.5e9 && step * unit < 50.0) return unit;
    }
  }
  input.unit_assumed = !(named > 0.0);
  const double read = named > 0.0 ? named : 1.0;
  const double T = step * read;
  const bool minutes = std::abs(T / 60 - std::round(T / 60)) < 1e-6;
  if (T < 50.0 || minutes) {
    if (T < 2e-6) {
      input.alarms.push_back(
          {"time-unit", "The time between two rows (column " + input.time + ") would be " +
                            number_text(T, 3) +
                            " s, so the unit of time must be another one. Set --time-unit."});
    }
    return read;
  }
  const double guessed = read * (step >= 1e5 ? 1e-9 : step >= 100.0 ? 1e-6 : 1e-3);
  input.alarms.push_back(
      {"time-unit", "In seconds, the time between two rows (column " + input.time + ") would be " +
                        number_text(T, 4) + " s. It was read as " + unit_name(guessed) +
                        ", so that T = " + number_text(step * guessed, 4) +
                        " s. All times on this page depend on it. Confirm it with --time-unit " +
                        unit_name(guessed) + ", or use --time-unit s if seconds are right."});
  return guessed;
}

double share_missing(const std::vector<double>& values) {
  const auto missing =
      std::count_if(values.begin(), values.end(), [](double v) { return !std::isfinite(v); });
  return static_cast<double>(missing) / static_cast<double>(values.size());
}

/// Rows of y alone; u of a row is what was held until the next of them, on average.
void merge(Input& input) {
  const esokit::Log& all = input.log;
  esokit::Log out;
  out.columns.resize(all.columns.size());
  std::vector<std::size_t> lines;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  double held = nan, area = 0.0, since = 0.0;
  std::vector<double> known(all.columns.size(), nan);
  const auto close = [&](double t) {  // up to here the last row of y holds
    if (out.y.empty()) return;
    area += held * (t - since);
    since = t;
  };
  for (std::size_t k = 0; k < all.y.size(); ++k) {
    const double t = all.time[k];
    close(t);
    if (std::isfinite(all.u[k])) held = all.u[k];
    for (std::size_t c = 0; c < known.size(); ++c) {
      if (std::isfinite(all.columns[c][k])) known[c] = all.columns[c][k];
    }
    if (!std::isfinite(all.y[k])) continue;
    if (!out.time.empty() && t > out.time.back()) {
      out.u.back() = area / (t - out.time.back());
    } else if (!out.time.empty()) {
      continue;  // a second y at the same time
    }
    out.time.push_back(t);
    out.y.push_back(all.y[k]);
    out.u.push_back(held);
    for (std::size_t c = 0; c < known.size(); ++c) out.columns[c].push_back(known[c]);
    lines.push_back(input.line[k]);
    area = 0.0;
    since = t;
  }
  input.log = std::move(out);
  input.line = std::move(lines);
  input.merged = true;
}

}  // namespace

Input read_log(const Settings& settings) {
  const LogFile header(settings.file, settings.separator);
  Input input;
  const bool timed = !(settings.sample_time > 0.0) || !settings.time.empty();
  std::vector<std::string> wanted = {
      guess(header, "u", settings.u,
            {"u",        "input",    "torque",  "effort",  "command",     "cmd",
             "pwm",      "voltage",  "current", "force",   "duty",        "drive",
             "actuator", "control",  "tau",     "power",   "heater",      "volts",
             "q1",       "spannung", "voltaje", "tension", "stellgroesse"}),
      guess(header, "y", settings.y,
            {"y",           "output",   "position",    "pos",        "angle",     "theta",
             "measurement", "meas",     "temperature", "temp",       "speed",     "velocity",
             "rate",        "level",    "height",      "phi",        "vel",       "t1",
             "rpm",         "winkel",   "drehzahl",    "temperatur", "velocidad", "temperatura",
             "vitesse",     "posicion", "niveau"})};
  if (timed) {
    wanted.push_back(guess(header, "time", settings.time,
                           {"t", "time", "stamp", "timestamp", "times", "secs", "seconds", "clock",
                            "ticks", "millis", "micros", "zeit", "tiempo", "temps"}));
  }
  wanted.insert(wanted.end(), settings.known.begin(), settings.known.end());
  const LogFile file(settings.file, wanted, settings.separator);
  input.u = file.name(0);
  input.y = file.name(1);
  constexpr std::string_view first_order[] = {"temperature", "temp",       "speed",    "velocity",
                                              "vel",         "rate",       "level",    "rpm",
                                              "t1",          "gyro",       "drehzahl", "velocidad",
                                              "temperatura", "temperatur", "vitesse",  "niveau"};
  input.first_order =
      std::ranges::find(first_order, words(input.y).front()) != std::end(first_order);
  input.cut = file.cut();
  input.log.u = file.column(0);
  input.log.y = file.column(1);
  for (std::size_t c = timed ? 3 : 2; c < wanted.size(); ++c)
    input.log.columns.push_back(file.column(c));
  for (std::size_t k = 0; k < file.rows(); ++k) input.line.push_back(file.line(k));
  const double no_u = share_missing(input.log.u), no_y = share_missing(input.log.y);
  if (no_u > 0.999) throw LogError(settings.file + ": there are no numbers in column " + input.u);
  if (no_y > 0.999) throw LogError(settings.file + ": there are no numbers in column " + input.y);
  if (!timed) {
    input.log.sample_time = settings.sample_time;
    return input;
  }
  input.time = file.name(2);
  std::vector<double> stamps = file.column(2);
  const bool merged = no_u > 0.2 || no_y > 0.2;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const std::string in = " in column " + input.time;
    if (!std::isfinite(stamps[i])) throw LogError(file.where(i) + "the time is missing" + in);
    if (i == 0 || stamps[i] > stamps[i - 1]) continue;
    if (stamps[i] < stamps[i - 1]) {
      throw LogError(file.where(i) + "time runs backwards" + in + ", from " +
                     number_text(stamps[i - 1], 15) + " to " + number_text(stamps[i], 15) +
                     ": the clock was set, or the file contains two recordings");
    }
    if (!merged) {
      throw LogError(file.where(i) + "time stands still" + in + " at " +
                     number_text(stamps[i], 15));
    }
  }
  std::vector<double> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    if (stamps[i] > stamps[i - 1]) steps.push_back(stamps[i] - stamps[i - 1]);
  }
  const double unit =
      find_unit(settings, input, stamps[0], steps.empty() ? 1.0 : esokit::detail::median(steps));
  input.time_unit = unit_name(unit);
  const double first = stamps[0];
  for (double& stamp : stamps) stamp = (stamp - first) * unit;
  input.log.time = std::move(stamps);
  if (merged) merge(input);
  if (input.log.time.size() < 2) throw LogError(settings.file + ": the log has only one sample");
  // A gap is bridged or cut out; one so long is a clock that was set, or two recordings.
  const double T = esokit::examples::median_step(input.log.time);
  for (std::size_t k = 1; k < input.log.time.size(); ++k) {
    const double jump = input.log.time[k] - input.log.time[k - 1];
    if (jump <= 50.0 * T) continue;
    input.alarms.push_back({"time-jump", "Time jumps by " + number_text(jump, 4) + " s at line " +
                                             std::to_string(input.line[k]) +
                                             " (usually, two rows are " + number_text(T, 3) +
                                             " s apart): the clock was set, or the file contains "
                                             "two recordings. The parts before and after are "
                                             "treated separately."});
    break;
  }
  return input;
}

}  // namespace from_log
