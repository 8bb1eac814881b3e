#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "from_log/parts/from_log.hpp"
#ifndef __wasi__
#include "common/system.hpp"
#endif

namespace from_log {
namespace {

using esokit::examples::LogFile;
using esokit::examples::LogSource;
using esokit::examples::number_text;

std::string lower(std::string text) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

/// Seconds of a unit of time, 0 of any other word.
double seconds_of(const std::string& unit) {
  static const std::map<std::string, double> all = {
      {"s", 1},         {"sec", 1},          {"secs", 1},         {"second", 1},
      {"seconds", 1},   {"ms", 1e-3},        {"msec", 1e-3},      {"millis", 1e-3},
      {"us", 1e-6},     {"\xc2\xb5s", 1e-6}, {"\xce\xbcs", 1e-6}, {"usec", 1e-6},
      {"micros", 1e-6}, {"ns", 1e-9},        {"nsec", 1e-9},      {"min", 60},
      {"h", 3600}};
  const auto at = all.find(unit);
  return at == all.end() ? 0.0 : at->second;
}

std::string unit_name(double seconds) {
  for (const char* unit : {"h", "min", "s", "ms", "us"}) {
    if (seconds > 0.5 * seconds_of(unit)) return unit;
  }
  return "ns";
}

std::vector<std::string> split_words(const std::string& text) {
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

/// The words of a name, and its unit where it is told: /joint1/effort_Nm -> effort, nm; t/ms and
/// t [ms] -> t, ms.
std::vector<std::string> words(const std::string& name) {
  std::string text = lower(name);
  // A stroke is before a unit or between the parts of a topic.
  const auto stroke = text.rfind('/');
  if (stroke != std::string::npos && stroke > 0 && text.find('/') == stroke) {
    constexpr std::string_view units[] = {"s",
                                          "ms",
                                          "us",
                                          "\xc2\xb5s",
                                          "ns",
                                          "min",
                                          "h",
                                          "v",
                                          "a",
                                          "nm",
                                          "n",
                                          "w",
                                          "%",
                                          "rad",
                                          "deg",
                                          "\xc2\xb0",
                                          "rpm",
                                          "m",
                                          "mm",
                                          "k",
                                          "\xc2\xb0"
                                          "c",
                                          "bar"};
    if (std::find(std::begin(units), std::end(units), text.substr(stroke + 1)) != std::end(units))
      text[stroke] = ' ';
  }
  const auto bracket = text.find_first_of("[(");
  const auto part = text.find_last_of("/.", bracket == std::string::npos ? text.size() : bracket);
  return split_words(part == std::string::npos ? text : text.substr(part + 1));
}

/// What a column is by the first word of its name, or by all of it.
struct Usual {
  const char* words;  ///< between blanks
  char column;        ///< t, u or y
  bool first_order = false;
};
constexpr Usual usual_names[] = {
    {" t time stamp timestamp datetime times secs seconds clock ticks millis micros ", 't'},
    {" x_value zeit uhrzeit zeitstempel temps heure horodatage tiempo hora tempo ", 't'},
    {" u input torque effort command cmd pwm voltage volts current force duty drive actuator "
     "control "
     "tau power heater q1 ",
     'u'},
    {" spannung strom drehmoment moment kraft leistung eingang stellgroesse stellgr\xc3\xb6\xc3\x9f"
     "e stellwert tension courant couple commande entr\xc3\xa9"
     "e voltaje tensi\xc3\xb3n corriente par "
     "entrada tensione corrente coppia ",
     'u'},
    {" y output position pos angle theta measurement meas height phi ", 'y'},
    {" winkel lage weg ausgang messwert sortie posicion posici\xc3\xb3n \xc3\xa1ngulo angulo "
     "salida "
     "posizione angolo uscita ",
     'y'},
    {" temperature temp speed velocity vel rate level rpm t1 gyro ", 'y', true},
    {" drehzahl geschwindigkeit temperatur f\xc3\xbcllstand fuellstand pegel vitesse temp\xc3\xa9"
     "rature niveau velocidad temperatura nivel velocit\xc3\xa0 livello ",
     'y', true}};

/// What is usual about a name, if anything. LabVIEW's X_Value is known as a whole: an x is none.
const Usual* usual(const std::string& name) {
  const std::string word = lower(name) == "x_value" ? "x_value" : words(name).front();
  const std::string blank = " " + word + " ";
  for (const Usual& line : usual_names) {
    if (!word.empty() && std::string_view(line.words).find(blank) != std::string_view::npos)
      return &line;
  }
  return nullptr;
}

/// The only column whose first word is usual for it.
std::string guess(const LogFile& file, const char* option, const std::string& given) {
  if (!given.empty()) return given;
  std::string there = file.there();
  for (const auto& names : file.headers()) {
    std::vector<std::size_t> fits, whole;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const Usual* line = usual(names[i]);
      if (line == nullptr || line->column != option[0]) continue;
      fits.push_back(i);
      if (lower(names[i]) == words(names[i]).front()) whole.push_back(i);
    }
    // y is y, where there is y_filtered, too.
    if (whole.size() == 1) fits = whole;
    if (fits.size() == 1) return names[fits[0]];
    if (fits.empty()) continue;
    there.clear();
    for (const std::size_t i : fits) there += (there.empty() ? "" : ", ") + names[i];
    break;
  }
  throw LogError("which column is " + std::string(option) + "? Name it with --" + option +
                 " COLUMN; there are " + there);
}

/// Finds the unit of the stamps: as told, by the column's name or the line of units, since 1970, or
/// by what a step of a controller can be. Only the last is a guess, and an alarm.
double find_unit(const Settings& settings, Input& input, const std::string& below, double first,
                 double step) {
  if (!settings.time_unit.empty()) {
    const double unit = seconds_of(settings.time_unit);
    if (unit > 0.0) return unit;
    throw LogError("--time-unit: '" + settings.time_unit + "' is none of h, min, s, ms, us, ns");
  }
  const auto parts = words(input.time);
  double named = seconds_of(parts.back());
  if (named == 0.0) named = seconds_of(split_words(lower(below)).front());
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

/// An angle that begins anew after a turn is no motion: made continuous, with an alarm unless the
/// turn was told.
void unwrap(const Settings& settings, Input& input) {
  std::vector<double>& y = input.log.y;
  if (settings.wrap && !(*settings.wrap > 0.0)) return;
  double low = std::numeric_limits<double>::infinity(), high = -low, last = std::nan("");
  std::vector<double> steps;
  for (const double value : y) {
    if (!std::isfinite(value)) continue;
    if (std::isfinite(last)) steps.push_back(value - last);
    low = std::min(low, value), high = std::max(high, value), last = value;
  }
  double turn = settings.wrap.value_or(0.0);
  if (turn > 0.0 && high - low > 1.0001 * turn) {
    throw LogError("--wrap: y (" + input.y + ") covers " + number_text(high - low, 4) +
                   ", more than a turn of " + number_text(turn, 6));
  }
  // A turn fits if y nearly covers it, and if what are jumps of nearly a turn are, less the turn,
  // steps as all others are.
  for (const double known : {2 * std::numbers::pi, 360.0, 1.0, 400.0, 3600.0, 36000.0, 256.0,
                             1024.0, 2048.0, 4096.0, 8192.0, 16384.0, 32768.0, 65536.0}) {
    if (settings.wrap || high - low > 1.0001 * known || high - low < 0.9 * known) continue;
    double usual = 0.0, behind = 0.0;
    std::size_t jumps = 0, moving = 0;
    for (const double step : steps) {
      if (std::abs(step) > 0.7 * known) {
        behind = std::max(behind, std::abs(std::abs(step) - known));
        ++jumps;
      } else {
        usual = std::max(usual, std::abs(step));
        moving += step != 0.0 ? 1 : 0;
      }
    }
    if (jumps > 0 && moving > 10 * jumps && behind <= 1.5 * usual && usual < 0.3 * known)
      turn = known;
  }
  if (!(turn > 0.0)) return;
  double turns = 0.0;
  std::size_t jumps = 0, first = 0;
  last = std::nan("");
  for (std::size_t k = 0; k < y.size(); ++k) {
    if (!std::isfinite(y[k])) continue;
    const double step = std::isfinite(last) ? y[k] - last : 0.0;
    last = y[k];
    if (std::abs(step) > 0.5 * turn) {
      turns += step > 0.0 ? -1.0 : 1.0;
      if (jumps++ == 0) first = k;
    }
    y[k] += turns * turn;
  }
  input.turn = turn;
  if (settings.wrap || jumps == 0) return;
  input.alarms.push_back(
      {"wrapped",
       "y (" + input.y + ") jumps by " + number_text(turn, 6) + " (first at line " +
           std::to_string(input.line[first]) + ", " + std::to_string(jumps) +
           (jumps == 1 ? " time" : " times") +
           " in all), as an angle that begins anew after a turn. It was made "
           "continuous; the controller needs it so, too (WrappedOutput). Confirm it with "
           "--wrap " +
           number_text(turn, 6) + ", or use --wrap 0 if y really jumps."});
}

}  // namespace

LogSource source_of(const Settings& settings) {
#ifdef __wasi__
  return {settings.file, settings.bytes.value_or("")};
#else
  if (settings.bytes) return {settings.file, *settings.bytes};
  return esokit::examples::path_of(settings.file);
#endif
}

Input read_log(const Settings& settings) {
  const LogSource source = source_of(settings);
  const LogFile header(source, settings.separator);
  Input input;
  const bool timed = !(settings.sample_time > 0.0) || !settings.time.empty();
  std::vector<std::string> wanted = {guess(header, "u", settings.u),
                                     guess(header, "y", settings.y)};
  if (timed) wanted.push_back(guess(header, "time", settings.time));
  wanted.insert(wanted.end(), settings.measured.begin(), settings.measured.end());
  const LogFile file(source, wanted, settings.separator,
                     timed ? std::optional<std::size_t>(2) : std::nullopt);
  input.u = file.name(0);
  input.y = file.name(1);
  const Usual* kind = usual(input.y);
  input.first_order = kind != nullptr && kind->first_order;
  input.cut = file.cut();
  input.log.u = file.column(0);
  input.log.y = file.column(1);
  for (std::size_t c = timed ? 3 : 2; c < wanted.size(); ++c) {
    input.measured.push_back(file.name(c));
    input.log.columns.push_back(file.column(c));
    if (share_missing(input.log.columns.back()) > 0.999)
      throw LogError(settings.file + ": there are no numbers in column " + input.measured.back());
  }
  for (std::size_t k = 0; k < file.rows(); ++k) input.line.push_back(file.line(k));
  const double no_u = share_missing(input.log.u), no_y = share_missing(input.log.y);
  if (no_u > 0.999) throw LogError(settings.file + ": there are no numbers in column " + input.u);
  if (no_y > 0.999) throw LogError(settings.file + ": there are no numbers in column " + input.y);
  if (!timed) {
    input.log.sample_time = settings.sample_time;
    unwrap(settings, input);
    return input;
  }
  input.time = file.name(2);
  std::vector<double> stamps = file.column(2);
  const bool merged = no_u > 0.2 || no_y > 0.2;
  const double origin = file.stamps().origin();
  const char* since = file.stamps().numbers() ? "" : " s after the first row";
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const std::string in = " in column " + input.time;
    if (!std::isfinite(stamps[i])) throw LogError(file.where(i) + "the time is missing" + in);
    if (i == 0 || stamps[i] > stamps[i - 1]) continue;
    if (stamps[i] < stamps[i - 1]) {
      throw LogError(file.where(i) + "time runs backwards" + in + ", from " +
                     number_text(origin + stamps[i - 1], 15) + " to " +
                     number_text(origin + stamps[i], 15) + since +
                     ": the clock was set, or the file contains two recordings");
    }
    if (!merged) {
      throw LogError(file.where(i) + "time stands still" + in + " at " +
                     number_text(origin + stamps[i], 15) + since);
    }
  }
  std::vector<double> steps;
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    if (stamps[i] > stamps[i - 1]) steps.push_back(stamps[i] - stamps[i - 1]);
  }
  // Dates and times of day are read in seconds.
  const double unit = file.stamps().numbers()
                          ? find_unit(settings, input, file.below(2), origin,
                                      steps.empty() ? 1.0 : esokit::detail::median(steps))
                          : 1.0;
  input.time_unit = unit_name(unit);
  for (double& stamp : stamps) stamp *= unit;
  input.log.time = std::move(stamps);
  if (merged) merge(input);
  unwrap(settings, input);
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
