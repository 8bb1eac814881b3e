#include "from_log/parts/command.hpp"

#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>

#include "common/measured_data.hpp"
#include "common/report.hpp"
#include "common/system.hpp"
#include "from_log/parts/measured_sets.hpp"
#include "from_log/parts/show.hpp"

using namespace from_log;

namespace {

/// A report below `out`, as of an example of this name.
esokit::examples::Report report_of(const std::string& out, const std::string& name,
                                   std::string title, std::string description, int order) {
  std::string program = "from_log", folder = out;
  char* arguments[] = {program.data(), folder.data(), nullptr};
  return {2,
          arguments,
          "from_log",
          name,
          {.paper_title = "From a log to a controller",
           .citation = "No paper. One command from a CSV file to a controller, on simulated and "
                       "real machines",
           .link = "",
           .title = std::move(title),
           .description = std::move(description),
           .order = order}};
}

/// What the results page shows: two real machines as from_log shows them, and observers over
/// measured sets against what is independently known.
int gallery(const std::string& out) {
  int status = 0;
  struct Machine {
    const char *name, *title, *file, *text;
    double limit;
  };
  constexpr Machine machines[] = {
      {"relay_servo", "A geared servo under a relay", "servo_relay_pid/relay.csv",
       "A DC servo controlled by an Arduino; its angle is measured in steps of 3.5 degrees.", 100},
      {"pendulum", "A pendulum during a swing-up", "dfki_simple_pendulum/direct_collocation.csv",
       "A geared motor with a pendulum. The controller does not know gravity: its observer finds "
       "it as a disturbance.",
       10}};
  for (const Machine& machine : machines) {
    Settings settings;
    settings.file = (esokit::examples::measured_data() / machine.file).string();
    settings.anyway = true;
    settings.limits = {-machine.limit, machine.limit};
    settings.command = std::string("from_log ") + machine.file + " --limits " +
                       esokit::examples::number_text(machine.limit) + " --anyway";
    auto report = report_of(out, machine.name, machine.title, machine.text, 2);
    const Outcome outcome = work_out(settings);
    const Page page = outcome.page(settings);
    page.add_to(report);
    const std::string file = page.write(report.folder(), machine.name);
    if (file.empty()) return failed;
    report.link(esokit::examples::path_of(file).filename().string(),
                "The page as from_log writes it");
    report.check("log", "rows", std::nullopt, static_cast<double>(outcome.findings.found.log.rows));
    status |= report.finish();
  }
  auto report =
      report_of(out, "measured_sets", "Observers on logs of real machines",
                "Recorded measurements are run through observers, and the estimated disturbance is "
                "compared with what is known independently. Sampled observers whose gains follow "
                "the irregular time stamps (VariableTime).",
                3);
  measured_sets(report);
  return status | report.finish();
}

}  // namespace

int from_log::command(int argc, char** argv, const Beside& beside) {
  esokit::examples::print_utf8();
  try {
    const Settings settings = read_arguments(argc, argv);
    if (argc == 1) throw LogError("no file is given; from_log --help shows the options");
    if (settings.file.empty()) return beside ? int{all_clear} : gallery(settings.out);
    if (!settings.observer.empty()) {
      const std::string page = show_observer(settings, read_log(settings));
      if (page.empty()) return failed;
      std::printf("%s\n", page.c_str());
      return all_clear;
    }
    const Outcome outcome = work_out(settings);
    for (const auto& note : outcome.input.notes) std::printf("%s\n", note.c_str());
    for (const Alarm& alarm : outcome.findings.alarms)
      std::fprintf(stderr, "ALARM %s: %s\n", alarm.name.c_str(), alarm.text.c_str());
    const char* mark = "refused: ";
    for (const auto& line : why_refused(outcome.findings)) {
      std::fprintf(stderr, "%s%s\n", mark, line.c_str());
      mark = "  ";
    }
    for (const auto& line : in_short(outcome.findings, outcome.design))
      std::printf("%s\n", line.c_str());
    const std::string page = outcome.page(settings).write(settings.out, stem_of(settings));
    if (page.empty()) return failed;
    std::printf("%s\n", page.c_str());
    if (beside && outcome.design.made()) beside(outcome.design, page);
    return outcome.status;
  } catch (const LogError& error) {
    std::fprintf(stderr, "from_log: %s\n", error.what());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "from_log: %s\n", error.what());
  }
  return unreadable;
}
