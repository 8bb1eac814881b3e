#include "log.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <tuple>

#include "from_log/parts/show.hpp"

namespace playground {
namespace {

// Three digits more than a slider has.
std::string text_of(double value) { return esokit::examples::number_text(value, 6); }

// The machine that was found, and the best design that the playground has sliders for.
void take_over(const from_log::Outcome& outcome, LogResult& result) {
  const esokit::Tuning& tuning = outcome.design.tuning();
  const esokit::TunedDesign& chosen = outcome.design.taken();
  const esokit::TuneModel& model = tuning.model;
  const auto n = static_cast<std::size_t>(model.order);
  const auto choice_of = [n](const esokit::TunedDesign& design) {
    const auto& [settings, knows] = std::tie(design.settings, design.knows);
    if (!design.feasible || knows.sensor || knows.sinusoid) return -1;
    if (design.family == esokit::TuneFamily::linear && settings.controller_bandwidth > 0.0)
      return knows.lag ? 3 : design.extension == 1 ? 0 : 1;
    const bool free = design.family == esokit::TuneFamily::free_poles;
    return free && settings.observer_poles.size() == n + 1 ? (knows.lag ? 5 : 4) : -1;
  };
  const esokit::TunedDesign* taken = choice_of(chosen) >= 0 ? &chosen : nullptr;
  for (const auto& design : tuning.designs) {
    if (taken == nullptr && choice_of(design) >= 0 && design.recovers) taken = &design;
  }
  if (taken == nullptr) return;
  // Of poles and gains the geometric means; what is over them goes with the sliders.
  const auto& poles = taken->settings.observer_poles;
  const auto& gains = taken->settings.gains;
  const int choice = choice_of(*taken);
  double slow = taken->settings.controller_bandwidth, fast = taken->settings.observer_bandwidth;
  if (choice >= 4) {
    slow = std::pow(gains[0], 1.0 / static_cast<double>(gains.size()));
    fast = 1.0;
    for (const auto& pole : poles)
      fast *= std::pow(std::abs(pole), 1.0 / static_cast<double>(poles.size()));
  }
  const double gain = std::abs(model.input_gain.value);
  // As the actuator has them, where it may rest at zero; u has the other sign with a negative b0.
  const bool turned = model.input_gain.value < 0.0;
  const double up = turned ? -model.u_min : model.u_max;
  const double least = turned ? -model.u_max : model.u_min;
  const bool rests = up > 0.0 && least <= 0.0;
  const double half = 0.5 * (model.u_max - model.u_min);
  const double limit = rests ? up : half;
  const auto set = [&](const char* name, double value) {
    result.address +=
        (result.address.empty() ? "" : "&") + std::string(name) + "=" + text_of(value);
  };
  const from_log::Pasting& pasting = outcome.design.pasting();
  set("order", model.order);
  set("gain", gain);
  set("damping", std::max(model.pole, 0.0));
  set("lag", model.lag);
  set("dead_time", model.dead_time);
  set("friction", pasting.friction);
  set("load", 0.2 * gain * half);  // a tenth of the range, as the page has it
  set("noise", model.noise);
  set("quantum", outcome.findings.found.log.quantisation);
  set("observer", choice);
  set("controller_bandwidth", slow);
  set("observer_bandwidth", fast);
  const auto exactly = [&](const char* name, std::size_t i, double value) {
    result.address +=
        "&" + (name + std::to_string(i)) + "=" + esokit::examples::number_text(value, 12);
  };
  if (choice >= 4) {
    for (std::size_t i = 0; i < poles.size(); ++i) {
      exactly("pole", i + 1, poles[i].real() / fast);
      exactly("oscillation", i + 1, poles[i].imag() / fast);
    }
    const auto count = static_cast<double>(gains.size());
    for (std::size_t i = 0; i < gains.size(); ++i)
      exactly("law", i, gains[i] / std::pow(slow, count - static_cast<double>(i)));
  }
  set("soften", taken->settings.soften ? 2 : 1);
  const esokit::SeenCurve& curve = outcome.findings.curve;
  const bool dead = curve.kind == esokit::CurveKind::dead_zone;
  // The limits of the model are those of the effect: before its dead zone u goes further.
  const double zone = dead ? curve.size.value : 0.0;
  if (dead) {
    set("dead_zone", zone);
    set("knows_curve", 1);
  }
  set("limit", limit + zone);
  set("down", !rests ? 1.0 : least < 0.0 ? (zone - least) / (limit + zone) : 0.0);
  set("sample_time", model.sample_time);
  // So that u may be at its limit for a moment, and in whole settling times.
  const double power = std::pow(slow, model.order + (taken->knows.lag ? 1 : 0));
  set("reference", 0.9 * limit * gain / power / (taken->knows.lag ? model.lag : 1.0));
  const double settling = std::max(taken->settling_time, 10 * model.latency());
  set("samples", std::clamp(std::round(8 * settling / model.sample_time), 200.0, 20000.0));
  result.design = taken->name;
  result.taken = "The playground has the machine of " + outcome.input.y + " and " +
                 outcome.input.u + " with " + taken->name;
  if (taken == &chosen) {
    result.taken += ", the design that was chosen.";
  } else {
    result.taken += ". Its sliders cannot hold the one that was chosen, " + chosen.name +
                    ", whose deviations are " +
                    esokit::examples::number_text(100 * (1.0 - chosen.excess / taken->excess), 2) +
                    " % smaller.";
  }
  if (curve.kind == esokit::CurveKind::square)
    result.taken += " The actuator acts as a square: there, u is its effect.";
  if (model.input_gain.value < 0.0) result.taken += " b0 is negative: there, u has the other sign.";
  if (!rests) {
    result.taken += " Its limits lie symmetrically, u counts from their middle.";
  } else if (!(least < 0.0)) {
    result.taken += " u does not go below zero: downwards y moves by itself alone.";
  }
}

}  // namespace

LogResult study_log(std::string_view arguments, std::string_view bytes,
                    const std::function<void(const char*, double)>& progress) {
  std::vector<std::string> words{"from_log"};
  for (std::size_t at = 0; at < arguments.size();) {
    const std::size_t end = std::min(arguments.find('\0', at), arguments.size());
    words.emplace_back(arguments.substr(at, end - at));
    at = end + 1;
  }
  std::vector<const char*> argv;
  for (const auto& word : words) argv.push_back(word.c_str());
  auto settings = from_log::read_arguments(static_cast<int>(argv.size()), argv.data());
  settings.bytes = bytes;
  settings.progress = progress;
  progress("reading", -1.0);
  const from_log::Outcome outcome = from_log::work_out(settings);
  LogResult result;
  result.status = outcome.status;
  const from_log::Page page = outcome.page(settings);
  result.header = page.header();
  result.main = page.main([&](const esokit::examples::Figure& figure) -> std::string {
    auto text = figure.text("", "svg");
    if (!text) return "";
    result.figures.push_back(*std::move(text));
    return "<div class=\"drawn\"></div>\n";
  });
  if (outcome.design.made()) {
    result.code = outcome.design.code();
    take_over(outcome, result);
  }
  return result;
}

}  // namespace playground
