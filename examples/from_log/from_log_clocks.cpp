// Files whose time has an unknown unit, as from_log reads them: right, asked for, or wrong?
// `--seed 2 --count 100` takes other starts and rows, and more.
//
// Unit    s, ms, us, ns, 100 ns, min, h, day; or the rows are counted
// Begin   within a date since 1970, 1904 or 1900; at zero; after 10 s to 60 days
// Rows    500, 0.1 ms to 1 h apart, by numbers that people choose (1, 1.2, 1.5, 2, 2.5, ..)
// Digits  four to eleven decimals, none of us, ns and 100 ns
// Name    of y: one that says nothing, or a speed (rows up to a second) or a temperature (from 0.1
// s)

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "common/report.hpp"
#include "from_log/parts/from_log.hpp"

using namespace esokit::examples;

namespace {

constexpr double day = 86400, year = 365.2425 * day;

struct Unit {
  const char* name;
  double seconds;
  int decimals;
};
constexpr Unit units[] = {{"s", 1, 4},     {"s", 1, 6},      {"ms", 1e-3, 1},    {"ms", 1e-3, 3},
                          {"us", 1e-6, 0}, {"ns", 1e-9, 0},  {"100ns", 1e-7, 0}, {"min", 60, 8},
                          {"h", 3600, 9},  {"day", day, 11}, {"rows", 0, 0}};
constexpr const char* epochs[] = {"1970", "1904", "1900", "0", "running"};

/// One file.
struct Cell {
  Unit unit{};
  std::string begins{};
  double begin = 0;  ///< s
  double apart = 0;  ///< s, from row to row
  std::string y = "y";
};

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}
  double share() { return 0x1p-53 * static_cast<double>(random_() >> 11U); }
  double between(double low, double high) { return low + (high - low) * share(); }

 private:
  std::mt19937_64 random_;
};

Cell random_cell(const Unit& unit, const std::string& begins, Dice& dice) {
  Cell cell{.unit = unit, .begins = begins};
  constexpr double chosen[] = {1, 1.2, 1.5, 2, 2.5, 3, 4, 5, 6, 7.5, 8};
  do {
    const double digits = chosen[static_cast<std::size_t>(11 * dice.share())];
    cell.apart = digits * std::pow(10.0, std::floor(dice.between(-4, 4)));
  } while (cell.apart > 3600);
  if (begins == "running") {
    cell.begin = std::exp(dice.between(std::log(10.0), std::log(60 * day)));
  } else if (begins != "0") {
    cell.begin = (dice.between(2001, 2035) - std::stod(begins)) * year;
  }
  const double named = dice.share();
  if (named < 0.25 && cell.apart <= 1) cell.y = "speed";
  if (named > 0.75 && cell.apart >= 0.1) cell.y = "temperature";
  return cell;
}

std::string with_decimals(double value, int decimals) {
  std::array<char, 64> text{};
  std::snprintf(text.data(), text.size(), "%.*f", decimals, value);
  return text.data();
}

std::string text_of(const Cell& cell) {
  std::string text = "t,u," + cell.y + "\n";
  for (int k = 0; k < 500; ++k) {
    const double first = cell.unit.seconds > 0 ? cell.begin / cell.unit.seconds : 0;
    const double rise = cell.unit.seconds > 0 ? k * cell.apart / cell.unit.seconds : k;
    // Whole, as 1e18 ns have more digits than a double.
    const std::string stamp = cell.unit.decimals > 0
                                  ? with_decimals(first + rise, cell.unit.decimals)
                                  : std::to_string(std::llround(first) + std::llround(rise));
    std::array<char, 96> line{};
    std::snprintf(line.data(), line.size(), "%s,%d,%.4f\n", stamp.c_str(), k / 40 % 2,
                  std::sin(0.05 * k) + 0.001 * (k * 7919 % 101));
    text += line.data();
  }
  return text;
}

enum class Outcome { right, right_with_alarm, asked, same_bytes, wrong_with_alarm, wrong };

/// Whether the file has every byte of one that is far more usual. That is: seconds from zero in
/// steps below 1/60 s; s, ms or us since 1970, which a counter shows by chance.
bool has_bytes_of_usual_log(const Cell& cell) {
  const double step = cell.apart / cell.unit.seconds, first = cell.begin / cell.unit.seconds;
  const double digits = step / std::pow(10.0, std::floor(std::log10(step) + 1e-9));
  const auto is = [](double value, std::initializer_list<double> all) {
    return std::any_of(all.begin(), all.end(),
                       [&](double one) { return std::abs(value - one) < 1e-6 * one; });
  };
  if (cell.begins == "0" && cell.unit.seconds > 1)
    return is(digits, {1, 2, 2.5, 4, 5, 8}) && step < 1.0 / 60;
  if (cell.begins != "running") return false;
  for (const double second : {1.0, 1e3, 1e6}) {
    const double since = first / second / year, rows = step / second;
    if (since > 28 && since < 70 &&
        (rows < 60.5 || is(rows, {90, 120, 180, 240, 300, 600, 900, 1200, 1800, 3600})))
      return true;
  }
  return false;
}

Outcome outcome_of(const Cell& cell, std::string& read_as) {
  const std::string text = text_of(cell);
  from_log::Settings settings;
  settings.file = "log.csv";
  settings.bytes = text;
  try {
    const from_log::Input input = from_log::read_log(settings);
    read_as = input.time_unit;
    // Digits that the file does not have are not asked for.
    const double T = input.log.time.back() / static_cast<double>(input.log.time.size() - 1);
    const double off = 2 * cell.unit.seconds * std::pow(10.0, -cell.unit.decimals) / 499;
    const bool right = cell.unit.seconds > 0 && std::abs(T - cell.apart) < off + 1e-6 * cell.apart;
    if (right) return input.alarms.empty() ? Outcome::right : Outcome::right_with_alarm;
    if (!input.alarms.empty()) return Outcome::wrong_with_alarm;
    return has_bytes_of_usual_log(cell) ? Outcome::same_bytes : Outcome::wrong;
  } catch (const LogError&) {
    return Outcome::asked;
  }
}

}  // namespace

int main(int argc, char** argv) {
  const auto seed = static_cast<std::uint64_t>(take_count(argc, argv, "--seed", 1));
  const auto count = take_count(argc, argv, "--count", 10);
  Report report(argc, argv, "from_log", "from_log_clocks",
                {.paper_title = "From a log to a controller",
                 .citation = "No paper. Files as loggers write them",
                 .link = "",
                 .title = "Which unit the time has",
                 .description = "Files whose time may be in any unit, since any date, with any "
                                "rows. Read right, asked for, or wrong?",
                 .order = 4});
  Dice dice(seed);
  std::map<std::string, std::array<int, 6>> found;
  std::array<int, 6> all{};
  for (const Unit& unit : units) {
    for (const char* epoch : epochs) {
      for (std::int64_t i = 0; i < count; ++i) {
        const Cell cell = random_cell(unit, epoch, dice);
        std::string read_as;
        const Outcome outcome = outcome_of(cell, read_as);
        ++found[unit.name][static_cast<std::size_t>(outcome)];
        ++all[static_cast<std::size_t>(outcome)];
        if (outcome < Outcome::wrong_with_alarm) continue;
        std::printf("%s: %s from %.9g s (%s), rows %.6g s, %s: read as %s\n",
                    outcome == Outcome::wrong ? "wrong" : "wrong with an alarm", unit.name,
                    cell.begin, epoch, cell.apart, cell.y.c_str(), read_as.c_str());
      }
    }
  }
  const auto number = [&](Outcome one) { return all[static_cast<std::size_t>(one)]; };
  std::vector<CsvRow> rows;
  for (const auto& [name, counts] : found) {
    rows.push_back({name});
    for (const int one : counts) rows.back().push_back(std::to_string(one));
  }
  report.expect("all", "wrong", number(Outcome::wrong), number(Outcome::wrong) == 0, "0");
  report.table("clocks", "How the time is read",
               {"unit", "right", "right, with an alarm", "asked for", "bytes of a usual log",
                "wrong, with an alarm", "wrong"},
               rows);
  return report.finish();
}
