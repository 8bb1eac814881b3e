#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "from_log/parts/from_log.hpp"

namespace from_log {
namespace {

constexpr const char* usage = R"(usage: from_log FILE.csv [options]
       from_log --out DIR
Writes FILE.html (or FILE-2.html, .. if it exists) and prints its path.

columns, by their name, by its end (position of /joint1/position) or beginning, or by number:
  --time COLUMN       time stamps from any origin; jitter and missing rows are allowed
  --u COLUMN          input that the actuator held from its row to the next
  --y COLUMN          measured output
                      (default of these three: columns with usual names: t, time, stamp; u, torque,
                      effort, pwm; y, position, angle, ..)
  --measured COLUMNS  disturbances that the controller will measure, too (fan,flow): their gain, lag
                      and dead time are found; or a known effect (the sine of the angle for
                      gravity); may be repeated
  --time-unit UNIT    day, h, min, s, ms, us, 100ns, ns (default: by name, or value and step)
  --sample-time S     seconds between rows, if there is no time column; with --time: of a column
                      that counts rows
  --literal NAMES     not to be read into the log: changes (an empty field or a missing row says
                      that nothing changed), late-u (u was logged a row late), curve (the actuator
                      has a dead zone, or another curve that the log tells)
  --wrap TURN         y is an angle that begins anew after a turn (360, 6.283185, 4096); 0: it does
                      not (default: detected, with an alarm)
  --separator C       one character, or the word tab (default: detected)
the machine:
  --order N           integrations from u to y, 1 to 3 (default: 1 for a speed, a temperature or a
                      level by its name, else identified)
  --limits LOW,HIGH   of u, in the unit of the log (default: the range of u in the log)
  --b0 B              the input gain that you expect: an alarm if the log shows another one
  --friction F        order 3: Coulomb friction on y'', unit of y''; 0: none (default: not known, and
                      only a design that recovers with friction is recommended)
the requirement, one of:
  --noise PERCENT     standard deviation of u that noise may cause, % of its range (default 5)
  --settling S        settling time of a step of the reference, s
  --omega-c W         controller bandwidth, rad/s
the controller that the machine has now:
  --pid KP,KI,KD,TF[,TT]  u = KP e + KI int e + KD e', TF of the filter on e', s (0: none), TT of
                      back-calculation, s (0 or left out: the integral stops at the limits): what
                      you gain and lose by changing, and what the best PIDs do
more margin than usual; every design is simulated within the limits, whatever its margins are:
  --modulus M         modulus margin, smallest abs(1 + L), below 1 (default 0.5)
  --delay N           delay margin in samples (default 2)
  --phase DEGREES     phase margin (default: none beside the others)
instead of a design, the log through an observer of your choice (page, and estimates as CSV):
  --observer NAME     linear, half-gain, reduced, cascade, algebraic, adjustable, nonlinear
  --bandwidth W       its bandwidth omega_o, rad/s; --order and --b0 are needed, too
other:
  --rank K            take the design of this rank instead of the best
  --anyway            make a design even from a refused log
  --no-design         find only the model
  --out DIR           folder for the page (default: here)
With --out but without a file: example pages from the logs of real machines in examples/data.

exit codes: 0 page with a design; 1 page not written; 2 file or options not understood; 3 log
refused: the page says what was found and what to record instead; 4 page with an alarm, or no
design keeps the margins and recovers from an overload
)";

double number(const std::string& option, const std::string& text) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (text.empty() || *end != '\0' || !std::isfinite(value))
    throw LogError("--" + option + ": '" + text + "' is not a number");
  return value;
}

double positive(const std::string& option, const std::string& text) {
  const double value = number(option, text);
  if (!(value > 0)) throw LogError("--" + option + ": must be positive, not " + text);
  return value;
}

std::pair<double, double> limits(const std::string& text) {
  const auto comma = text.find_first_of(",:", 1);
  if (comma == std::string::npos) {
    const double most = positive("limits", text);
    return {-most, most};
  }
  const std::pair both{number("limits", text.substr(0, comma)),
                       number("limits", text.substr(comma + 1))};
  if (!(both.first < both.second))
    throw LogError("--limits: " + text + " is no range, the first number must be the smaller one");
  return both;
}

esokit::PlainPidConfig given_pid(const std::string& text) {
  std::vector<double> all;
  for (std::size_t at = 0; at <= text.size();) {
    const auto comma = std::min(text.find(',', at), text.size());
    all.push_back(number("pid", text.substr(at, comma - at)));
    at = comma + 1;
  }
  if (all.size() < 4 || all.size() > 5)
    throw LogError("--pid: " + text + " is not KP,KI,KD,TF or KP,KI,KD,TF,TT");
  return {.proportional = all[0],
          .integral = all[1],
          .derivative = all[2],
          .derivative_filter = all[3],
          .tracking_time = all.size() > 4 ? all[4] : 0.0};
}

/// A shell would need quotes around some of it.
std::string in_quotes(const std::string& text) {
  if (text.find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-+=.,"
                             ":/@%") == std::string::npos &&
      !text.empty())
    return text;
  return "'" + text + "'";
}

}  // namespace

Settings read_arguments(int argc, const char* const* argv) {
  Settings s;
  s.command = "from_log";
  int wishes = 0;
  const std::map<std::string, std::function<void(const std::string&)>> options = {
      {"time", [&](const auto& text) { s.time = text; }},
      {"u", [&](const auto& text) { s.u = text; }},
      {"y", [&](const auto& text) { s.y = text; }},
      {"measured",
       [&](const std::string& text) {
         for (std::size_t at = 0; at <= text.size();) {
           const auto comma = std::min(text.find(',', at), text.size());
           s.measured.push_back(text.substr(at, comma - at));
           if (s.measured.back().empty())
             throw LogError("--measured: '" + text + "' has an empty name");
           at = comma + 1;
         }
       }},
      {"known",
       [](const auto& text) {
         throw LogError("--known is now --measured: write --measured " + in_quotes(text));
       }},
      {"time-unit", [&](const auto& text) { s.time_unit = text; }},
      {"sample-time", [&](const auto& text) { s.sample_time = positive("sample-time", text); }},
      {"literal",
       [&](const std::string& text) {
         for (std::size_t at = 0; at <= text.size();) {
           const auto comma = std::min(text.find(',', at), text.size());
           const std::string name = text.substr(at, comma - at);
           if (name != "changes" && name != "curve" && name != "late-u")
             throw LogError("--literal: '" + name + "' is none of changes, curve, late-u");
           s.literal.insert(name);
           at = comma + 1;
         }
       }},
      {"wrap",
       [&](const auto& text) {
         s.wrap = number("wrap", text);
         if (*s.wrap < 0) throw LogError("--wrap: must not be negative");
       }},
      {"separator",
       [&](const auto& text) {
         const std::string one = text == "tab" || text == "\\t" ? "\t" : text;
         if (one.size() != 1) throw LogError("--separator: '" + text + "' is not one character");
         s.separator = one[0];
       }},
      {"order",
       [&](const auto& text) {
         const double order = number("order", text);
         if (!(order >= 1 && order <= 3) || std::floor(order) < order)
           throw LogError("--order: must be 1, 2 or 3");
         s.orders = {static_cast<int>(order)};
       }},
      {"limits", [&](const auto& text) { s.limits = limits(text); }},
      {"b0",
       [&](const auto& text) {
         s.expected_gain = number("b0", text);
         if (*s.expected_gain == 0) throw LogError("--b0: must not be zero");
       }},
      {"friction",
       [&](const auto& text) {
         s.friction = number("friction", text);
         if (*s.friction < 0) throw LogError("--friction: must not be negative");
       }},
      {"noise",
       [&](const auto& text) { s.noise_share = 0.01 * positive("noise", text), ++wishes; }},
      {"settling",
       [&](const auto& text) { s.settling_time = positive("settling", text), ++wishes; }},
      {"pid", [&](const auto& text) { s.pid = given_pid(text); }},
      {"omega-c", [&](const auto& text) { s.controller = positive("omega-c", text), ++wishes; }},
      {"modulus", [&](const auto& text) { s.rules.modulus_margin = positive("modulus", text); }},
      {"delay", [&](const auto& text) { s.rules.delay_samples = positive("delay", text); }},
      {"phase",
       [&](const auto& text) {
         s.rules.phase_margin = positive("phase", text) * std::numbers::pi / 180;
       }},
      {"observer", [&](const auto& text) { s.observer = text; }},
      {"bandwidth", [&](const auto& text) { s.bandwidth = positive("bandwidth", text); }},
      {"rank",
       [&](const auto& text) {
         const double rank = number("rank", text);
         if (!(rank >= 1 && rank <= 99) || std::floor(rank) < rank)
           throw LogError("--rank: must be 1, 2, ..");
         s.rank = static_cast<int>(rank);
       }},
      {"out", [&](const auto& text) { s.out = text; }}};
  for (int i = 1; i < argc; ++i) {
    std::string name = argv[i];
    s.command += " " + in_quotes(name);
    if (name == "--help" || name == "-h") {
      std::printf("%s", usage);
      std::exit(all_clear);
    }
    if (!name.starts_with("--")) {
      if (!s.file.empty()) throw LogError("more than one file: " + s.file + ", " + name);
      s.file = name;
      continue;
    }
    name.erase(0, 2);
    if (name == "anyway" || name == "no-design") {
      (name == "anyway" ? s.anyway : s.no_design) = true;
      continue;
    }
    std::string value;
    const auto sign = name.find('=');
    if (sign != std::string::npos) {
      value = name.substr(sign + 1);
      name.erase(sign);
    }
    const auto option = options.find(name);
    if (option == options.end()) throw LogError("unknown option --" + name);
    if (sign == std::string::npos) {
      if (i + 1 >= argc) throw LogError("--" + name + " needs a value");
      value = argv[++i];
      s.command += " " + in_quotes(value);
    }
    option->second(value);
  }
  if (wishes > 1) throw LogError("--noise, --settling, --omega-c: one of them only");
  return s;
}

}  // namespace from_log
