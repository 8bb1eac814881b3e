// An observer over a log of your own: any CSV file through any observer, estimates as CSV and as a
// figure. Without a file it runs the measured sets beside the repository (../shared/data), if they
// are there, against what is independently known of them.
//
// Way: sampled, VariableTime<Observer>: chain and gains follow the time stamps. Missing
// measurements (empty fields, NaN) are predicted over, and the next correction uses the gain for
// the whole gap. AlgebraicEso counts samples while its bandwidth falls; a switched observer
// compares innovations whatever time lies between them.
//
//   measured_log LOG.csv --y angle --u torque --time t_s --order 2 --b0 6.7 --bandwidth 40

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "common/log_file.hpp"
#include "common/report.hpp"
#include "control_practice/log_observer.hpp"
#include "control_practice/measured_sets.hpp"
#include "control_practice/practice.hpp"

using namespace esokit::examples;
using namespace practice;

namespace {

constexpr const char* usage = R"(usage: measured_log [--out DIR] [--data DIR]
       measured_log FILE.csv --y COLUMN --u COLUMN [--time COLUMN] [--sample-time S]
                    --order N --b0 B --bandwidth W [--observer NAME] [--tolerance P]
                    [--separator C] [--out DIR]

The first form runs the measured sets below --data (default: ../shared/data beside the repository).
The second form runs a log of your own.

  --y, --u, --time  columns, by the header's name or by number from 1; u is held from its row to
                    the next; time in s may be irregular; without it samples are S apart
  --sample-time     nominal sample time, s (default: the middle of the time steps)
  --order           plant order n, 1 to 3: y^(n) = d + b0 u
  --b0              input gain, unit of y^(n) per unit of u
  --bandwidth       observer bandwidth omega_o, rad/s
  --observer        linear (default), half-gain, reduced, cascade, algebraic, adjustable, nonlinear
  --tolerance       time steps within this share of the nominal one count as nominal (default 0.01)
  --separator       one character, or the word tab (default: found out)
  --out             results go to DIR/control_practice/FILE (default: out)
)";

/// The command line: options by name, and at most one file.
class Arguments {
 public:
  Arguments(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
      std::string name = argv[i];
      if (name == "--help" || name == "-h") {
        std::printf("%s", usage);
        std::exit(0);
      }
      if (!name.starts_with("--")) {
        if (!file_.empty()) throw LogError("more than one file: " + file_ + ", " + name);
        file_ = name;
        continue;
      }
      name.erase(0, 2);
      std::string value;
      if (const auto sign = name.find('='); sign != std::string::npos) {
        value = name.substr(sign + 1);
        name.erase(sign);
      } else if (i + 1 < argc) {
        value = argv[++i];
      } else {
        throw LogError("--" + name + " needs a value");
      }
      static const std::vector<std::string> known = {
          "out", "data",  "y",         "u",        "time",      "sample-time",
          "b0",  "order", "bandwidth", "observer", "tolerance", "separator"};
      if (std::find(known.begin(), known.end(), name) == known.end()) {
        throw LogError("unknown option --" + name);
      }
      options_[name] = value;
    }
  }

  [[nodiscard]] const std::string& file() const { return file_; }
  [[nodiscard]] bool has(const std::string& name) const { return options_.contains(name); }
  [[nodiscard]] std::string text(const std::string& name, const std::string& fallback) const {
    return has(name) ? options_.at(name) : fallback;
  }
  [[nodiscard]] std::string text(const std::string& name) const {
    if (!has(name)) throw LogError("--" + name + " is missing");
    return options_.at(name);
  }
  [[nodiscard]] double number(const std::string& name) const {
    const std::string value = text(name);
    char* end = nullptr;
    const double number = std::strtod(value.c_str(), &end);
    if (value.empty() || *end != '\0') {
      throw LogError("--" + name + ": '" + value + "' is not a number");
    }
    return number;
  }

 private:
  std::string file_;
  std::map<std::string, std::string> options_;
};

/// Name of the folder for a log. A name of nothing but dots would be the folder itself or the one
/// above it.
std::string folder_name(const std::filesystem::path& file) {
  const std::string stem = file.stem().string();
  return stem.find_first_not_of('.') == std::string::npos ? "log" + stem : stem;
}

/// A report below `out`, for an example of this name.
Report make_report(const std::string& out, const std::string& name, const About& about) {
  std::string program = "measured_log";
  std::string folder_argument = out;
  char* arguments[] = {program.data(), folder_argument.data(), nullptr};
  return {2, arguments, folder, name, about};
}

int run_own_log(const Arguments& arguments) {
  const std::filesystem::path file = arguments.file();
  const bool timed = arguments.has("time");
  if (!timed && !arguments.has("sample-time")) throw LogError("--time or --sample-time is missing");
  LogSettings settings;
  settings.observer = arguments.text("observer", settings.observer);
  const double order = arguments.number("order");
  if (!(order >= 1 && order <= 3) || std::floor(order) < order) {
    throw LogError("--order: must be 1, 2 or 3");
  }
  settings.order = static_cast<int>(order);
  settings.input_gain = arguments.number("b0");
  settings.bandwidth = arguments.number("bandwidth");
  if (arguments.has("tolerance")) settings.tolerance = arguments.number("tolerance");
  std::vector<std::string> wanted = {arguments.text("y"), arguments.text("u")};
  if (timed) wanted.push_back(arguments.text("time"));
  std::string separator = arguments.text("separator", "");
  if (separator == "tab" || separator == "\\t") separator = "\t";
  if (separator.size() > 1) {
    throw LogError("--separator: '" + separator + "' is not one character");
  }
  const LogFile log(file, wanted, separator.empty() ? '\0' : separator[0]);
  std::vector<double> time;
  if (timed) {
    time = log.column(2);
    check_time(log, time);
  }
  settings.sample_time =
      arguments.has("sample-time") ? arguments.number("sample-time") : median_step(time);
  const auto estimates = run_observer(settings, time, log.column(0), log.column(1));

  if (!timed) {
    for (std::size_t k = 0; k < log.rows(); ++k) {
      time.push_back(static_cast<double>(k) * settings.sample_time);
    }
  }
  Report report = make_report(
      arguments.text("out", "out"), folder_name(file),
      about("Log " + file.filename().string(),
            "Observer " + settings.observer + ", order " + std::to_string(settings.order) +
                ", b0 = " + number_text(settings.input_gain, 6) +
                ", omega_o = " + number_text(settings.bandwidth, 6) +
                " rad/s, T = " + number_text(settings.sample_time, 6) + " s."));
  std::string text = "t_s";
  for (int r = 0; r < settings.order; ++r)
    text += ",y" + std::string(static_cast<std::size_t>(r), '\'');
  text += ",d\n";
  for (std::size_t k = 0; k < log.rows(); ++k) {
    // Times since 1970 need their digits.
    text += number_text(time[k], 15);
    for (const auto& column : estimates.columns) text += ',' + number_text(column[k], 12);
    text += '\n';
  }
  const std::string written = report.folder() + "/estimates.csv";
  if (!write_text(written, text)) throw LogError("cannot write " + written);

  Figure figure("estimates", {.rows = 2 + (settings.order > 1 ? 1U : 0U), .panel_height = 170});
  figure.caption("Measurement, estimates and total disturbance.");
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("y")
      .legend(Legend::above)
      .name("output")
      .line(time, log.column(0), {.name = "measured", .color = Color::grey, .width = 3.0})
      .line(time, estimates.columns[0], {.name = "estimate", .color = Color::blue, .width = 1.2});
  std::size_t row = 1;
  if (settings.order > 1) {
    figure.panel(row++, 0)
        .x_label("t (s)")
        .y_label("y'")
        .name("derivative")
        .line(time, estimates.columns[1], {.color = Color::blue});
  }
  figure.panel(row, 0)
      .x_label("t (s)")
      .y_label("d (unit of y^{(" + std::to_string(settings.order) + ")})")
      .name("disturbance")
      .line(time, estimates.columns.back(), {.color = Color::vermillion});
  report.add(figure);
  report.check("log", "samples", std::nullopt, static_cast<double>(log.rows()));
  report.check("log", "missing or bad measurements", std::nullopt,
               static_cast<double>(estimates.rejected));
  report.check("log", "missing or bad inputs, the one before taken", std::nullopt,
               static_cast<double>(estimates.inputs));
  report.check("log", "gaps too long to bridge, restarts", std::nullopt,
               static_cast<double>(estimates.restarts));
  std::printf("%s\n", written.c_str());
  return report.finish();
}

int run_measured_sets(const Arguments& arguments) {
  // The sources are in examples/control_practice of the repository.
  const auto root = std::filesystem::path(__FILE__).parent_path().parent_path().parent_path();
  const std::filesystem::path data =
      arguments.text("data", (root / ".." / "shared" / "data").lexically_normal().string());
  Report report = make_report(
      arguments.text("out", "out"), "measured_log",
      about("Logs of real machines",
            "Observers over recorded measurements with irregular time stamps, against what is "
            "independently known. Sampled: VariableTime, gains follow the time stamps."));
  if (!measured_sets(report, data)) {
    std::printf(
        "none of the measured sets is here: put them in %s or name their folder with --data\n",
        data.c_str());
  }
  return report.finish();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Arguments arguments(argc, argv);
    return arguments.file().empty() ? run_measured_sets(arguments) : run_own_log(arguments);
  } catch (const LogError& error) {
    std::fprintf(stderr, "measured_log: %s\n", error.what());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "measured_log: %s\n", error.what());
  }
  return 2;
}
