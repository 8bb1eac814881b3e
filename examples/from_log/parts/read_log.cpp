#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "from_log/parts/clock.hpp"
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

/// The words of a name, and its unit where it is given: /joint1/effort_Nm -> effort, nm; t/ms and t
/// [ms] -> t, ms.
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
  Pace pace = Pace::unknown;
  bool first_order = false;
};
constexpr Usual usual_names[] = {
    {" t time stamp timestamp datetime times secs sec second seconds clock ticks millis micros "
     "uptime "
     "elapsed ",
     't'},
    {" x_value zeit uhrzeit zeitstempel temps heure horodatage tiempo hora tempo ", 't'},
    {" u input torque effort command commanded cmd pwm voltage volts current force duty drive "
     "actuator control tau power heater q1 action throttle mv op co valve pump thrust ",
     'u'},
    {" spannung strom drehmoment moment kraft leistung eingang stellgroesse stellgr\xc3\xb6\xc3\x9f"
     "e stellwert heizung heizer heizleistung ventil pumpe drossel gas tension courant couple "
     "commande entr\xc3\xa9"
     "e chauffage voltaje tensi\xc3\xb3n corriente par entrada tensione corrente coppia ",
     'u'},
    {" y measurement meas measured height distance pv process actual feedback ausgang messwert "
     "istwert sortie salida uscita ",
     'y'},
    {" position pos angle theta phi odometer winkel lage weg posicion posici\xc3\xb3n "
     "\xc3\xa1ngulo "
     "angulo posizione angolo ",
     'y', Pace::quick},
    {" speed velocity vel rate rpm gyro drehzahl geschwindigkeit vitesse velocidad "
     "velocit\xc3\xa0 ",
     'y', Pace::quick, true},
    {" temperature temp level t1 temperatur f\xc3\xbcllstand fuellstand pegel temp\xc3\xa9"
     "rature niveau temperatura nivel livello ",
     'y', Pace::slow, true}};

/// Also with a number behind it: velocity0.
const Usual* usual_word(std::string word) {
  const std::string blank = " " + word + " ";
  for (const Usual& line : usual_names) {
    if (!word.empty() && std::string_view(line.words).find(blank) != std::string_view::npos)
      return &line;
  }
  const std::size_t length = word.find_last_not_of("0123456789") + 1;
  if (length < 3 || length == word.size()) return nullptr;
  word.resize(length);
  return usual_word(word);
}

/// What is wanted is neither u nor y: target_speed, T_set, SP, Sollwert.
bool is_target(const std::string& name) {
  constexpr std::string_view targets =
      " set setpoint sp ref reference target desired goal soll sollwert consigne ";
  const auto parts = words(name);
  return std::any_of(parts.begin(), parts.end(), [&](const std::string& part) {
    return targets.find(" " + part + " ") != std::string_view::npos;
  });
}

/// What is usual about a name, if anything: its first word, of two that differ the last, which says
/// what it is (heater_temperature); else any word. LabVIEW's X_Value is known as a whole: an x is
/// none.
const Usual* usual(const std::string& name) {
  if (lower(name) == "x_value") return usual_word("x_value");
  auto parts = words(name);
  while (parts.size() > 1 && (seconds_of(parts.back()) > 0.0 || parts.back().size() < 2))
    parts.pop_back();
  const Usual* first = usual_word(parts.front());
  const Usual* last = usual_word(parts.back());
  if (first != nullptr && last != nullptr && first->column != 't' && last->column != 't')
    return last->column == first->column ? first : last;
  if (first != nullptr) return first;
  for (auto part = parts.rbegin(); part != parts.rend(); ++part) {
    const Usual* found = usual_word(*part);
    if (found != nullptr && found->column != 't') return found;
  }
  return parts.back() == "time" ? last : nullptr;  // UTC time
}

/// Whether a column of this name says whose value a row has: of InfluxDB, Home Assistant, WinCC.
bool long_table(const std::string& name) {
  const std::string_view names = " _field entity_id varname tagname tag topic signal metric ";
  return names.find(" " + lower(name) + " ") != names.npos;
}

/// The only column whose name is usual for it, of those that are not `taken` by a name; of several
/// the one that is called so and nothing else. `output` is y, unless another column is: then it is
/// u. A date is the time where nothing else is.
std::string guess(const LogFile& file, const char* option, const std::string& given,
                  const std::vector<std::string>& taken, std::vector<std::string>& notes) {
  if (!given.empty()) return given;
  std::string there = "there are " + file.there();
  for (const auto& names : file.headers()) {
    std::vector<std::size_t> fits, whole, outputs, dates;
    bool other_y = false;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const bool free = std::find(taken.begin(), taken.end(), names[i]) == taken.end();
      const std::string first = words(names[i]).front();
      if (free && (first == "output" || first == "out")) outputs.push_back(i);
      if (free && (first == "date" || first == "datum" || first == "fecha")) dates.push_back(i);
      const Usual* line = is_target(names[i]) ? nullptr : usual(names[i]);
      if (line == nullptr) continue;
      other_y = other_y || line->column == 'y';
      if (line->column != option[0] || !free) continue;
      fits.push_back(i);
      if (lower(names[i]) == first) whole.push_back(i);
    }
    // y is y, where there is y_filtered, too.
    if (whole.size() == 1) fits = whole;
    if (fits.empty() && outputs.size() == 1 && option[0] == (other_y ? 'u' : 'y')) {
      fits = outputs;
      if (other_y) {
        notes.push_back("'" + names[fits[0]] +
                        "' was taken for u, the output of the controller, as another column is y.");
      }
    }
    if (fits.empty() && option[0] == 't') fits = dates;
    if (fits.size() == 1) return names[fits[0]];
    if (fits.empty()) continue;
    there = "it may be ";
    for (const std::size_t i : fits) there += (i == fits[0] ? "" : ", ") + names[i];
    break;
  }
  for (const auto& names : file.headers()) {
    for (const std::string& name : names) {
      if (!long_table(name)) continue;
      throw LogError("this is a long table: a row has one value, and '" + name +
                     "' says of what. Write a row for each time, and a column for each value (in "
                     "pandas: pivot)");
    }
  }
  std::string known;
  for (const std::string& name : taken) {
    if (!name.empty()) known += (known.empty() ? "" : ", ") + name;
  }
  throw LogError("which column is " + std::string(option) + "? Name it with --" + option +
                 " COLUMN; " + there + (known.empty() ? "" : " (taken: " + known + ")") +
                 (option[0] == 't'
                      ? "; or, if there is no time, give the time from row to row with "
                        "--sample-time SECONDS"
                      : ""));
}

/// "us (rows 2 ms apart), ms (rows 2 s apart)"
std::string units_text(const std::vector<double>& units, double step) {
  std::string text;
  for (const double unit : units) {
    text += (text.empty() ? "--time-unit " : ", --time-unit ") + std::string(unit_name(unit)) +
            " (rows " + time_text(step * unit) + " apart)";
  }
  return text;
}

/// A step that the file itself names: a column "Increment" with a number below it, as scopes write.
std::string increment_of(const LogFile& file) {
  const auto& headers = file.headers();
  for (std::size_t c = 0; headers.size() > 1 && c < headers[0].size(); ++c) {
    const std::string name = lower(headers[0][c]);
    if (name != "increment" && name != "sample interval" && name != "tinc") continue;
    if (c < headers[1].size() && std::strtod(headers[1][c].c_str(), nullptr) > 0.0)
      return "; the file says " + headers[0][c] + " " + headers[1][c] + ": --sample-time " +
             headers[1][c];
  }
  return "";
}

/// Hours, minutes and seconds in one number have a hole of 40 in each minute.
void refuse_sixties(const Settings& settings, const LogFile& file, std::vector<double> stamps,
                    const std::string& column) {
  for (double& stamp : stamps) stamp += file.stamps().origin();
  const std::size_t row = row_of_sixty(stamps);
  if (row == 0) return;
  throw LogError(settings.file + ": after " + number_text(stamps[row - 1], 15) + ", " + column +
                 " goes on with " + number_text(stamps[row], 15) +
                 ": are these minutes and seconds in one number? Write 10:20:59, or set the time "
                 "from row to row: --sample-time SECONDS. If time really jumps, set --time-unit");
}

/// Finds the unit of the stamps: as given, by the column's name, the line of units or what stands
/// behind the numbers, else by value and step. What stays open is asked for.
double find_unit(const Settings& settings, const LogFile& file, const ClockRead& clock,
                 const std::vector<double>& stamps, Input& input) {
  if (settings.sample_time > 0.0) return settings.sample_time / clock.step;
  if (!settings.time_unit.empty()) {
    const double unit = seconds_of(lower(settings.time_unit));
    if (unit > 0.0) return unit;
    throw LogError("--time-unit: '" + settings.time_unit +
                   "' is none of day, h, min, s, ms, us, 100ns, ns");
  }
  const std::string column = "column " + input.time;
  refuse_sixties(settings, file, stamps, column);
  double named = seconds_of(words(input.time).back());
  if (named == 0.0) named = seconds_of(split_words(lower(file.below(2))).front());
  if (named == 0.0) named = seconds_of(lower(file.cell_unit(2)));
  if (named > 0.0) {
    const double T = clock.step * named;
    const bool date = detail::is_date(clock.first, named);
    if (T < 2e-6 || T > 7300 || !(detail::slow(T) || date) ||
        !(date || std::abs(clock.last * named) < 400 * 86400.0)) {
      input.alarms.push_back(
          {"time-unit", "By the name of " + column + " it is in " + unit_name(named) +
                            ", and then rows are " + time_text(T) +
                            " apart. All times on this page depend on it. Confirm it with "
                            "--time-unit " +
                            unit_name(named) + ", or set the right one."});
    }
    return named;
  }
  const ClockVerdict verdict = judge_clock(clock);
  if (!verdict.decided()) {
    const bool counted =
        clock.whole && clock.first < 1.5 && clock.first > -0.5 && std::abs(clock.step - 1.0) < 1e-9;
    throw LogError(settings.file + ": in which unit is the time? " +
                   (counted ? "C" + column.substr(1) + " counts the rows, and may be seconds, too"
                            : "Nothing says it of " + column + ", which begins at " +
                                  number_text(clock.first, 10) + " and rises by " +
                                  number_text(clock.step, 4) + " from row to row") +
                   (verdict.open.empty() ? ". If it is a date, write it as 2024-03-01T12:00:00. "
                                           "Else set --time-unit"
                                         : ". Set one of " + units_text(verdict.open, clock.step)) +
                   ", or the time from row to row: --sample-time SECONDS" + increment_of(file));
  }
  const std::string unit = unit_name(verdict.unit);
  input.unit_assumed = true;
  const std::string rows = "rows are " + time_text(clock.step * verdict.unit) + " apart";
  if (verdict.doubtful) {
    input.alarms.push_back(
        {"time-unit",
         "Nothing says in which unit " + column + " is: it was read as " + unit + ", so that " +
             rows + ". All times on this page depend on it. Confirm it with --time-unit " + unit +
             ", or set the right one (" + units_text(verdict.open, clock.step) + ")."});
  } else {
    input.notes.push_back("Time: by value and step, " + column + " is in " + unit +
                          (verdict.date ? " and has a date" : "") +
                          (input.merged ? "" : "; " + rows) + ". If not, set --time-unit.");
  }
  return verdict.unit;
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
}

/// An angle that begins anew after a turn is no motion: made continuous, with an alarm unless the
/// turn was given.
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

namespace {

/// Leaves out the rows of which `keep` is false.
void keep_rows(Input& input, std::vector<double>& stamps, const std::vector<bool>& keep) {
  const auto filter = [&](auto& values) {
    std::size_t to = 0;
    for (std::size_t k = 0; k < values.size(); ++k) {
      if (keep[k]) values[to++] = values[k];
    }
    values.resize(to);
  };
  filter(input.log.u);
  filter(input.log.y);
  for (auto& column : input.log.columns) filter(column);
  filter(input.line);
  filter(stamps);
}

/// Makes stamps rise: counters that began anew, and stamps that are repeated or rounded.
void mend_stamps(const Settings& settings, const LogFile& file, Input& input,
                 std::vector<double>& stamps) {
  const double origin = file.stamps().origin();
  const char* since = file.stamps().numbers() ? "" : " s after the first row";
  const std::string in = " in column " + input.time;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    if (!std::isfinite(stamps[i])) {
      throw LogError(file.where(i) + "the time is missing" + in +
                     "; if rows come at equal steps, leave it out: --sample-time SECONDS");
    }
  }
  const ClockRepair turned = file.stamps().numbers() ? unwrap_counter(stamps) : ClockRepair{};
  input.counter = turned.turns > 0;
  if (turned.turns > 0) {
    input.notes.push_back("Time" + in + " begins anew after " + number_text(turned.turn, 10) +
                          ", as a counter of the processor does (" + std::to_string(turned.turns) +
                          (turned.turns == 1 ? " time" : " times") + "): made continuous.");
  }
  for (std::size_t i = 1; i < stamps.size(); ++i) {
    if (!(stamps[i] < stamps[i - 1])) continue;
    if (i == 1 && std::is_sorted(stamps.begin(), stamps.end(), std::greater<>{})) {
      throw LogError(file.where(i) + "time runs backwards" + in +
                     " in all rows: the newest row is the first. Sort the rows by time");
    }
    std::string other;
    for (const auto& names : file.headers()) {
      for (const std::string& name : names) {
        const Usual* line = usual(name);
        if (other.empty() && name != input.time && line != nullptr && line->column == 't')
          other = "; or is the time in --time '" + name + "'?";
      }
    }
    throw LogError(file.where(i) + "time runs backwards" + in + ", from " +
                   number_text(origin + stamps[i - 1], 15) + " to " +
                   number_text(origin + stamps[i], 15) + since +
                   ": the clock was set, or the file contains two recordings. Cut the file there, "
                   "or, if rows come at equal steps, leave the time out: --sample-time SECONDS" +
                   other);
  }
  if (input.merged) return;
  const ClockRepair mended = spread_stamps(stamps);
  if (mended.repeated == 0 && !mended.spread) return;
  std::size_t first = 1;
  const std::string how_many = std::to_string(mended.repeated) +
                               (mended.repeated == 1 ? " row has" : " rows have") +
                               " the time stamp of the row before" + in;
  if (!mended.spread) {
    std::vector<bool> keep(stamps.size(), true);
    for (std::size_t k = 1; k < stamps.size(); ++k) {
      if (stamps[k] > stamps[k - 1]) continue;
      keep[k - 1] = false;
      if (first == 1) first = k;
    }
    const std::string at = std::to_string(file.line(first));
    if (stamps.size() < 10 || !mended.left_out) {
      throw LogError(file.where(first) + "time stands still" + in + " at " +
                     number_text(origin + stamps[first], 15) + since +
                     "; if rows come at equal steps, leave it out: --sample-time SECONDS");
    }
    keep_rows(input, stamps, keep);
    input.alarms.push_back(
        {"repeated", how_many + " (first at line " + at +
                         "), and the earlier one was left out. If rows come at equal steps, set "
                         "--sample-time instead."});
    return;
  }
  input.alarms.push_back(
      {"repeated",
       (mended.repeated > 0 ? how_many : "Time stamps" + in + " are rounded") +
           ", as a clock with too few digits writes: rows were put at equal steps "
           "between them. Better tell the time from row to row: --sample-time " +
           (settings.sample_time > 0 ? number_text(settings.sample_time) : std::string("SECONDS")) +
           "."});
}

/// Whether values were written only where they changed, by the steps between them: none is zero,
/// though many are one of the resolution, so that there must often have been none at all.
bool only_changes(const std::vector<double>& steps) {
  double least = std::numeric_limits<double>::infinity();
  std::size_t still = 0, single = 0;
  for (const double step : steps) {
    if (step > 0)
      least = std::min(least, step);
    else
      ++still;
  }
  for (const double step : steps) single += step > 0 && step < 1.5 * least ? 1U : 0U;
  return 200 * still < steps.size() && single >= 20 && 8 * single > steps.size();
}
/// The steps between the values that are there.
std::vector<double> steps_of(const std::vector<double>& values) {
  std::vector<double> steps;
  double last = std::nan("");
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    if (std::isfinite(last)) steps.push_back(std::abs(value - last));
    last = value;
  }
  return steps;
}

/// A field that is empty, or a row that is missing, because nothing changed: what was there holds.
void hold_changes(const Settings& settings, Input& input) {
  if (settings.literal.contains("changes")) return;
  esokit::Log& log = input.log;
  const std::string off = " If not (values were lost), use --literal changes.";
  for (auto* column : {&log.y, &log.u}) {
    const double missing = share_missing(*column);
    const std::string name = column == &log.y ? input.y : input.u;
    const auto first = std::find_if(column->begin(), column->end(),
                                    [](double value) { return std::isfinite(value); });
    const bool switched = column == &log.u && missing > 0.02 && share_missing(log.y) < 0.02;
    if (!(missing > 0.02) || !(switched || only_changes(steps_of(*column)))) continue;
    double held = *first;
    for (double& value : *column) {
      if (std::isfinite(value)) held = value;
      value = held;
    }
    if (!switched || only_changes(steps_of(*column)))
      input.notes.insert(input.notes.begin(),
                         "Column " + name + " has a value only where it changed (" +
                             number_text(100 * missing, 2) +
                             " % of its fields are empty): the last one was held." + off);
  }
  // Whole rows: of two with the same u, y always differs, and the steps of time are multiples.
  // Across a change of u, y may stay.
  std::vector<double> moves, steps;
  for (std::size_t k = 0; k < log.y.size(); ++k) {
    if (!std::isfinite(log.y[k]) || !std::isfinite(log.u[k])) return;
    if (k == 0) continue;
    steps.push_back(log.time[k] - log.time[k - 1]);
    if (!(log.u[k] < log.u[k - 1]) && !(log.u[k] > log.u[k - 1]))
      moves.push_back(std::abs(log.y[k] - log.y[k - 1]));
  }
  if (steps.size() < 50) return;
  std::vector<double> sorted = steps;
  std::sort(sorted.begin(), sorted.end());
  const double T = sorted[sorted.size() / 20];
  std::size_t longer = 0, off_grid = 0, rows = log.y.size();
  for (const double step : steps) {
    const double times = step / T;
    longer += times > 1.5 ? 1U : 0U;
    off_grid += std::abs(times - std::round(times)) > 0.2 ? 1U : 0U;
    rows += times > 1.5 ? static_cast<std::size_t>(std::min(std::round(times) - 1, 1e9)) : 0;
  }
  if (20 * longer < steps.size() || 4 * moves.size() < steps.size() || !only_changes(moves)) return;
  if (20 * off_grid > steps.size() || rows > 50 * log.y.size()) {
    throw LogError(settings.file +
                   ": rows were written only where something changed, and not at a fixed rate: "
                   "when y stood still is not known. Log every row, or, if rows were lost for "
                   "another reason, use --literal changes");
  }
  esokit::Log full;
  full.columns.resize(log.columns.size());
  std::vector<std::size_t> lines;
  for (std::size_t k = 0; k < log.y.size(); ++k) {
    const double times = k + 1 < log.y.size() ? std::round(steps[k] / T) : 1.0;
    for (double i = 0; i < times; ++i) {
      full.time.push_back(log.time[k] + (times > 1 ? i * steps[k] / times : 0.0));
      full.u.push_back(log.u[k]);
      full.y.push_back(log.y[k]);
      for (std::size_t c = 0; c < log.columns.size(); ++c)
        full.columns[c].push_back(log.columns[c][k]);
      lines.push_back(input.line[k]);
    }
  }
  input.notes.insert(input.notes.begin(), "Rows were written only where something changed: " +
                                              std::to_string(full.y.size() - log.y.size()) +
                                              " rows in which nothing did were put back." + off);
  log = std::move(full);
  input.line = std::move(lines);
}

/// The column with what a clock has beyond whole seconds, and how much one is: nanosec beside sec.
std::optional<std::pair<std::string, double>> fraction_of(const LogFile& file,
                                                          const std::string& time) {
  const auto place = [](const std::string& name) { return name.find_last_of("./_ ") + 1; };
  constexpr std::string_view whole = " sec secs seconds s ";
  const std::string lowered = lower(time);
  if (lowered.empty() || whole.find(" " + lowered.substr(place(lowered)) + " ") == whole.npos)
    return std::nullopt;
  for (const auto& names : file.headers()) {
    for (const std::string& name : names) {
      const std::string other = lower(name), last = other.substr(place(other));
      if (other.substr(0, place(other)) != lowered.substr(0, place(lowered))) continue;
      for (const auto& [words, unit] :
           {std::pair{" nanosec nanosecs nanoseconds nsec nsecs ns ", 1e-9},
            std::pair{" usec usecs microsec microseconds us ", 1e-6}}) {
        if (std::string_view(words).find(" " + last + " ") != std::string_view::npos)
          return std::pair{name, unit};
      }
    }
  }
  return std::nullopt;
}

/// The same column twice is no log.
void refuse_same(const Settings& settings, const LogFile& file,
                 const std::vector<std::string>& wanted, bool timed) {
  const auto role = [&](std::size_t i) {
    return i == 0 ? "u" : i == 1 ? "y" : timed && i == 2 ? "time" : "measured";
  };
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (file.place(i) != file.place(j)) continue;
      throw LogError(settings.file + ": " + role(j) + " (" + wanted[j] + ") and " + role(i) + " (" +
                     wanted[i] + ") are the same column, number " + std::to_string(file.place(i)) +
                     ", '" + file.name(i) + "'; @3 is the third column, whatever the names are");
    }
  }
  if (file.column(0) != file.column(1)) return;
  throw LogError(settings.file + ": u (" + file.name(0) + ") and y (" + file.name(1) +
                 ") have the same numbers in all rows: one of them was logged twice");
}

void note_cells(const LogFile& file, const std::vector<std::string>& wanted, Input& input) {
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    if (file.switched(i) > 0)
      input.notes.push_back("In column " + file.name(i) + " ON or true is 1, OFF or false is 0.");
    if (file.failed(i) > 0) {
      input.notes.push_back("In column " + file.name(i) + " " + std::to_string(file.failed(i)) +
                            (file.failed(i) == 1 ? " field is" : " fields are") +
                            " an error instead of a number: rows that are missing.");
    }
  }
  if (file.other_lines() > 0) {
    input.notes.push_back(std::to_string(file.other_lines()) +
                          (file.other_lines() == 1 ? " line" : " lines") +
                          " without the labels of the others were left out.");
  }
}

}  // namespace

Input read_log(const Settings& settings) {
  const LogSource source = source_of(settings);
  const LogFile header(source, settings.separator);
  Input input;
  const bool timed = !(settings.sample_time > 0.0) || !settings.time.empty();
  std::vector<std::string> taken = settings.measured;
  taken.insert(taken.end(), {settings.u, settings.y, settings.time});
  std::vector<std::string> wanted = {guess(header, "u", settings.u, taken, input.notes),
                                     guess(header, "y", settings.y, taken, input.notes)};
  if (timed) wanted.push_back(guess(header, "time", settings.time, taken, input.notes));
  wanted.insert(wanted.end(), settings.measured.begin(), settings.measured.end());
  const auto fraction = timed ? fraction_of(header, wanted[2]) : std::nullopt;
  if (fraction) wanted.push_back(fraction->first);
  const LogFile file(source, wanted, settings.separator,
                     timed ? std::optional<std::size_t>(2) : std::nullopt);
  refuse_same(settings, file, wanted, timed);
  note_cells(file, wanted, input);
  input.u = file.name(0);
  input.y = file.name(1);
  const Usual* kind = usual(input.y);
  input.first_order = kind != nullptr && kind->first_order;
  input.cut = file.cut();
  input.log.u = file.column(0);
  input.log.y = file.column(1);
  const std::size_t measured = wanted.size() - (fraction ? 1 : 0);
  for (std::size_t c = timed ? 3 : 2; c < measured; ++c) {
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
  if (fraction) {
    const std::vector<double>& parts = file.column(measured);
    for (std::size_t k = 0; k < stamps.size(); ++k) stamps[k] += fraction->second * parts[k];
    input.notes.push_back("Time is " + input.time + " and " + fraction->first + " together.");
  }
  const auto topics = [&] {
    return share_missing(input.log.u) > 0.2 || share_missing(input.log.y) > 0.2;
  };
  input.merged = topics();
  mend_stamps(settings, file, input, stamps);
  const double origin = file.stamps().origin();
  const ClockRead clock =
      read_clock(stamps, origin, input.counter, kind == nullptr ? Pace::unknown : kind->pace);
  if (!(clock.step > 0.0) && stamps.size() < 2)
    throw LogError(settings.file + ": the log has one row only: record at least 200");
  if (!(clock.step > 0.0)) {
    throw LogError(settings.file + ": time stands still: column " + input.time + " is " +
                   number_text(origin, 10) +
                   " in all rows. If that is the time from row to row, set it instead: "
                   "--sample-time SECONDS");
  }
  // Dates and times of day are read in seconds.
  const double unit =
      file.stamps().numbers() ? find_unit(settings, file, clock, stamps, input) : 1.0;
  input.time_unit = settings.sample_time > 0.0 ? "rows" : unit_name(unit);
  for (double& stamp : stamps) stamp *= unit;
  input.log.time = std::move(stamps);
  hold_changes(settings, input);
  input.merged = topics();
  if (input.merged) merge(input);
  unwrap(settings, input);
  if (input.log.time.size() < 2)
    throw LogError(settings.file + ": the log has one row only: record at least 200");
  // A gap is bridged or cut out; one so long is a clock that was set, or two recordings.
  const double T = esokit::examples::median_step(input.log.time);
  for (std::size_t k = 1; k < input.log.time.size(); ++k) {
    const double jump = input.log.time[k] - input.log.time[k - 1];
    if (jump <= 50.0 * T) continue;
    input.alarms.push_back({"time-jump", "Time jumps by " + time_text(jump) + " at line " +
                                             std::to_string(input.line[k]) +
                                             " (usually, two rows are " + time_text(T) +
                                             " apart): the clock was set, or the file contains "
                                             "two recordings. The parts before and after are "
                                             "treated separately."});
    break;
  }
  return input;
}

}  // namespace from_log
