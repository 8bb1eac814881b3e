/// @file
/// What from_log is asked, what it reads, what it finds.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <esokit/identify/identify.hpp>
#include <esokit/tune/plain_pid.hpp>
#include <esokit/tune/specification.hpp>

#include "common/csv.hpp"
#include "common/figure.hpp"
#include "common/log_file.hpp"

namespace from_log {

using esokit::examples::LogError;

/// Exit codes of the program.
enum Status {
  all_clear = 0,   ///< a page with a design
  failed = 1,      ///< the page could not be written
  unreadable = 2,  ///< file or command line; stderr says where and what
  refused = 3,     ///< a page that says what was seen, and what to record instead; no design
  alarmed = 4      ///< an alarm that has to be looked at first, or no design to recommend
};

/// The command line.
struct Settings {
  std::string file;
  std::optional<std::string_view> bytes{};  ///< of the file, where there is none on a disk
  std::string time, u, y;                   ///< columns; empty: found by their names
  std::vector<std::string> measured;        ///< columns of measured disturbances
  std::string time_unit;                    ///< day, h, min, s, ms, us, 100ns, ns; empty: found
  double sample_time = 0;                   ///< s from row to row, where there is no time, or its
                                            ///< column counts rows
  std::set<std::string> literal;  ///< what is not to be read into the log: changes, curve, late-u
  char separator = 0;             ///< 0: found out
  std::optional<double> wrap;     ///< y begins anew after so much; 0: it does not; none: found out
  std::vector<int> orders{};  ///< empty: 1 for a speed, a temperature or a level, else found out
  std::optional<double> expected_gain;  ///< b0 as the user believes it to be
  std::optional<std::pair<double, double>> limits;
  std::optional<double> friction;  ///< as in TuneModel; none: not known
  double noise_share =
      0;  ///< specification: deviation of u by noise, share of its range; 0: as tune has it
  double settling_time = 0;  ///< instead: s
  double controller = 0;     ///< instead: omega_c, rad/s
  /// The PID that the machine has: what changes by going to the design?
  std::optional<esokit::PlainPidConfig> pid{};
  /// What the loop has to keep; the page says of every design whether it recovers.
  esokit::TuneRules rules{.simulate = esokit::TuneSimulation::all};
  int rank = 1;            ///< which of the designs, the best is 1
  bool anyway = false;     ///< design for a refused log, too
  bool no_design = false;  ///< what was found, and no controller
  std::string observer;    ///< typed in: nothing is found, the log runs through it
  double bandwidth = 0;    ///< its omega_o, rad/s
  std::string out = ".";   ///< folder of the page
  std::string command;     ///< for the page
  /// Called with what is done and the finished share of it, 0 to 1; below 0: not known.
  std::function<void(const char*, double)> progress{};
};

/// The command line as settings; --help prints what there is, and ends the program.
[[nodiscard]] Settings read_arguments(int argc, const char* const* argv);

/// The file, or what it consists of.
[[nodiscard]] esokit::examples::LogSource source_of(const Settings& settings);

/// Something that has to be looked at before anything is pasted.
struct Alarm {
  std::string name;  ///< one word
  std::string text;
};

/// The columns of a file, and what had to be found out about them.
struct Input {
  std::string time, u, y;             ///< names of the columns
  std::vector<std::string> measured;  ///< those of the measured disturbances
  std::string time_unit = "s";
  bool unit_assumed = false;       ///< nothing says its unit but value and step
  bool counter = false;            ///< its numbers began anew
  std::vector<std::string> notes;  ///< what was read into the file, for the first lines
  esokit::Log log;                 ///< s from the first stamp on; u held from its row to the next
  std::vector<std::size_t> line;   ///< of the file, for each row
  bool merged = false;             ///< topics with stamps of their own were brought together
  bool cut = false;                ///< the last line was cut
  double turn = 0;                 ///< after which y began anew, before it was made continuous
  bool first_order = false;        ///< y is a speed, a temperature or a level by its name
  std::vector<Alarm> alarms;
};

/// Reads the columns, in seconds. Errors name the line and the column.
[[nodiscard]] Input read_log(const Settings& settings);

/// One-sided density over frequency.
struct Spectrum {
  std::vector<double> frequency;  ///< rad/s
  std::vector<double> density;    ///< unit^2 s/rad
};

/// What is seen in a log, whether a model can be trusted or not.
struct Findings {
  bool seen = false;  ///< a model was fitted
  esokit::Identified found;
  std::optional<esokit::Error<double>> refusal;
  esokit::FitData rows;  ///< at one sample time
  /// Of the actuator, where the log tells it: then u of the rows, and of all that follows from
  /// them, is the effect.
  esokit::SeenCurve curve;
  Spectrum u, y, residual;
  std::vector<double> residual_correlation;  ///< lags 1, 2, ..
  double correlation_band = 0;               ///< white ones stay within this, 95 %
  std::vector<std::string> shown;            ///< what u, y and the residual show, in sentences
  std::string gaps;                          ///< gaps that come every few rows; empty: none
  std::vector<Alarm> alarms;
};

/// Identifies, and sounds the alarms.
/// @param input u is taken earlier in it, if it was logged late
[[nodiscard]] Findings examine(const Settings& settings, Input& input);

/// The unit for a time of this size: units in a second, and its name.
inline std::pair<double, const char*> unit_of(double seconds) {
  if (seconds < 0.9995) return {1e3, "ms"};
  if (seconds < 600) return {1, "s"};
  if (seconds < 3 * 3600) return {1.0 / 60, "min"};
  return {1.0 / 3600, "h"};
}

/// A time in words, three digits of it.
inline std::string duration_text(double seconds) {
  const auto [per_second, unit] = unit_of(seconds);
  return esokit::examples::number_text(per_second * seconds, 3) + " " + unit;
}

}  // namespace from_log
