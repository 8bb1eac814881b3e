#include "from_log/parts/design.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/loop_response.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/sim/run.hpp>

namespace from_log {
namespace {

using namespace esokit::examples;
using esokit::Identified;
using esokit::LinearController;
using esokit::Loop;

/// f(the plant that was found).
template <class F>
auto with_plant(const Identified& found, F&& f) {
  switch (found.order) {
    case 1:
      return f(found.plant<1>());
    case 2:
      return f(found.plant<2>());
    default:
      return f(found.plant<3>());
  }
}

template <int Order>
std::optional<LinearController> leso(double omega_o, double omega_c, const Identified& found) {
  const auto made = esokit::Adrc<esokit::LinearEso<Order>>::make(
      {.observer = {.observer_bandwidth = omega_o,
                    .input_gain = found.input_gain.value,
                    .sample_time = found.log.sample_time},
       .controller_bandwidth = omega_c});
  if (!made) return std::nullopt;
  const auto form = linear_controller(*made);
  if (!form) return std::nullopt;
  return *form;
}

std::optional<Loop> loop_of(const Identified& found, const LinearController& form) {
  return with_plant(found, [&](const auto& plant) -> std::optional<Loop> {
    if (!plant) return std::nullopt;
    auto loop = esokit::closed_loop(*plant, form);
    if (!loop) return std::nullopt;
    return *loop;
  });
}

/// Time until y stays within 2 % of a step of the reference.
double settling_of(const Loop& loop, double longest) {
  const auto step = esokit::reference_response(loop, {.duration = longest});
  if (!step) return longest;
  std::size_t last = 0;
  for (std::size_t k = 0; k < step->time.size(); ++k) {
    if (std::abs(step->output[0][k] - 1) > 0.02) last = k;
  }
  return step->time[last];
}

/// Rows through the observer of a controller, each piece from rest.
Replay through(const LinearController& form, double input_gain, int order,
               const esokit::FitData& rows) {
  Replay replay;
  const int n = form.states();
  std::vector<double> z(static_cast<std::size_t>(n)), change(z.size());
  std::size_t piece = 0;
  double offset = 0.0;
  const double direct = form.y_to_estimate(0, 0);
  const auto estimate = [&](int row, double y) {
    double sum = form.y_to_estimate(row, 0) * y;
    for (int i = 0; i < n; ++i) sum += form.to_estimate(row, i) * z[static_cast<std::size_t>(i)];
    return sum;
  };
  for (std::size_t k = 0; k < rows.y.size(); ++k) {
    if (piece < rows.starts.size() && rows.starts[piece] == k) {
      ++piece;
      offset = rows.y[k];
      std::fill(z.begin(), z.end(), 0.0);
    }
    const double y = rows.y[k] - offset;
    const double corrected = estimate(0, y);
    replay.t.push_back(static_cast<double>(k) * rows.sample_time);
    replay.estimate.push_back(corrected + offset);
    replay.load.push_back(estimate(order, y) / input_gain);
    // The measurement that the observer had expected would not have moved it.
    replay.innovation.push_back((y - corrected) / (1 - direct));
    for (int i = 0; i < n; ++i) {
      double sum = form.from_y(i, 0) * y + form.from_u(i, 0) * rows.u[k];
      for (int j = 0; j < n; ++j) sum += form.a(i, j) * z[static_cast<std::size_t>(j)];
      change[static_cast<std::size_t>(i)] = sum;
    }
    for (std::size_t i = 0; i < z.size(); ++i) z[i] += change[i];
  }
  return replay;
}

/// y of the machine that was found under the u of the log, with its noise and its disturbance.
esokit::FitData simulated(const Identified& found, const esokit::FitData& rows) {
  esokit::FitData out = rows;
  const double T = rows.sample_time;
  const std::size_t count = rows.y.size();
  std::vector<double> walk(count + 1, 0.0);
  esokit::sim::Gaussian gaussian(1);
  for (std::size_t k = 1; k <= count; ++k)
    walk[k] = walk[k - 1] + std::sqrt(found.disturbance * T) * gaussian.next();
  with_plant(found, [&](const auto& plant) {
    if (!plant) return 0;
    std::size_t row = 0;
    const auto recorded = [&rows, &row](double, double) {
      return rows.u[std::min(row++, rows.u.size() - 1)];
    };
    const auto run = esokit::sim::run(
        *plant, recorded,
        {.duration = static_cast<double>(count - 1) * T,
         .sample_time = T,
         .disturbance =
             [&](double t) {
               return walk[std::min(static_cast<std::size_t>(t / T + 1e-6), count)];
             },
         .noise = found.noise.value});
    if (run) {
      for (std::size_t k = 0; k < std::min(count, run->measurement.size()); ++k)
        out.y[k] = run->measurement[k];
    }
    return 0;
  });
  out.starts = {0};
  return out;
}

/// Those that count: not while the observer finds the state.
std::vector<double> settled(const Replay& replay, const esokit::FitData& rows,
                            std::size_t settling) {
  std::vector<double> sizes;
  std::size_t piece = 0, from = 0;
  for (std::size_t k = 0; k < replay.innovation.size(); ++k) {
    if (piece < rows.starts.size() && rows.starts[piece] == k) {
      from = k + settling;
      ++piece;
    }
    if (k >= from) sizes.push_back(std::abs(replay.innovation[k]));
  }
  return sizes;
}

std::string cpp(double value) {
  std::string text = number_text(value, 6);
  if (text.find_first_of(".en") == std::string::npos) text += ".0";
  return text;
}

std::string program(const Settings& settings, const Identified& found, const Candidate& chosen,
                    std::pair<double, double> limits) {
  const std::string name = std::filesystem::path(settings.file).filename().string();
  std::string text = "// From " + name + " by from_log: order " + std::to_string(found.order) +
                     ", b0 = " + number_text(found.input_gain.value, 4) + " +- " +
                     number_text(found.input_gain.half_width, 2) +
                     ".\n// y and u in the units of the log, one update every " +
                     number_text(1e3 * found.log.sample_time, 4) + " ms.\n#include <cstdio>\n";
  for (const auto& header : chosen.headers) text += "#include <esokit/" + header + ">\n";
  text += "\nusing Controller = esokit::Adrc<" + chosen.type +
          ">;\n\nController::Config config() {\n  Controller::Config config;\n" + chosen.settings +
          "  config.limits = {.lower = " + cpp(limits.first) + ", .upper = " + cpp(limits.second) +
          "};\n  return config;\n}\n\n"
          "int main() {\n"
          "  auto controller = Controller::make(config());\n"
          "  if (!controller) {\n"
          "    std::printf(\"%s: %s\\n\", controller.error().field, controller.error().rule);\n"
          "    return 1;\n"
          "  }\n"
          "  const double y = 0.0, u_now = 0.0, reference = 0.0;\n"
          "  controller->start(y, u_now);  // once, where the machine stands\n"
          "  const double u = controller->update(y, reference);  // each sample\n"
          "  std::printf(\"u = %g\\n\", u);\n"
          "}\n";
  return text;
}

}  // namespace

Design Design::make(const Settings& settings, const Input&, const Findings& findings) {
  Design design;
  const Identified& found = findings.found;
  const auto [least, largest] = std::minmax_element(findings.rows.u.begin(), findings.rows.u.end());
  design.limits_ = settings.limits.value_or(std::pair(*least, *largest));
  const double range = design.limits_.second - design.limits_.first;
  const double T = found.log.sample_time;
  const double wish = settings.noise_share * range;
  for (int i = 0; i < 40; ++i) {
    const double omega_o = 1.5 / T * std::pow(10.0, -i / 13.0);
    const double omega_c = settings.controller > 0 ? settings.controller
                           : settings.settling_time > 0
                               ? (found.order == 1 ? 4 : 6) / settings.settling_time
                               : omega_o / 5;
    const auto form = found.order == 1   ? leso<1>(omega_o, omega_c, found)
                      : found.order == 2 ? leso<2>(omega_o, omega_c, found)
                                         : leso<3>(omega_o, omega_c, found);
    if (!form) continue;
    const auto loop = loop_of(found, *form);
    if (!loop || !loop->stable()) continue;
    Candidate one;
    one.form = *form;
    one.name = "LinearEso, " + number_text(omega_o, 3) + " rad/s";
    one.type = "esokit::LinearEso<" + std::to_string(found.order) + ">";
    one.headers = {"control/adrc.hpp", "observer/linear_eso.hpp"};
    one.settings = "  config.observer = {.observer_bandwidth = " + cpp(omega_o) +
                   ", .input_gain = " + cpp(found.input_gain.value) + ", .sample_time = " + cpp(T) +
                   "};\n  config.controller_bandwidth = " + cpp(omega_c) + ";\n";
    const auto margins = esokit::margins(*loop);
    const auto delay = esokit::delay_margin(*loop);
    const auto noise = esokit::noise(*loop, {.measurement = {found.noise.value}});
    const auto load = esokit::load_response(
        *loop,
        {.duration = 400 * T + 10 / omega_c, .height = 0.1 * range * found.input_gain.value});
    if (!margins || !delay || !noise || !load) continue;
    one.modulus = margins->modulus.value;
    one.delay = delay->value;
    one.control_noise = noise->control[0];
    for (const double y : load->output[0]) one.load_error = std::max(one.load_error, std::abs(y));
    one.settling = settling_of(*loop, 30 / omega_c);
    if (!design.chosen_ && one.modulus >= 0.5 && one.delay >= 2 * T && one.control_noise <= wish) {
      design.chosen_ = design.all_.size();
      design.loop_ = loop;
    }
    design.all_.push_back(one);
  }
  if (!design.chosen_) {
    design.why_not_ = "No bandwidth keeps the margins and the noise that is wished for.";
    return design;
  }
  const Candidate& chosen = design.all_[*design.chosen_];
  design.code_ = program(settings, found, chosen, design.limits_);
  design.summary_ = {"y of order " + std::to_string(found.order) +
                         ", b0 = " + number_text(found.input_gain.value, 4) + " ± " +
                         number_text(found.input_gain.half_width, 2) + ", lag and dead time " +
                         number_text(1e3 * found.latency.value, 3) + " ms.",
                     "Take " + chosen.name + ". It settles in " + number_text(chosen.settling, 3) +
                         " s; a load of a tenth of the range of u moves y by " +
                         number_text(chosen.load_error, 3) + "; noise moves u by " +
                         number_text(100 * chosen.control_noise / range, 2) + " % of its range.",
                     "Modulus margin " + number_text(chosen.modulus, 2) + ", " +
                         number_text(1e3 * chosen.delay, 3) + " ms of delay may be added."};
  design.replay_ = through(chosen.form, found.input_gain.value, found.order, findings.rows);
  const esokit::FitData model = simulated(found, findings.rows);
  const Replay expected = through(chosen.form, found.input_gain.value, found.order, model);
  const auto settling = std::min<std::size_t>(static_cast<std::size_t>(chosen.settling / T) + 20,
                                              findings.rows.y.size() / 4);
  auto sizes = settled(expected, model, settling);
  const auto at = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() * 95 / 100);
  std::nth_element(sizes.begin(), at, sizes.end());
  design.replay_.band = *at;
  const auto ours = settled(design.replay_, findings.rows, settling);
  const auto inside =
      std::count_if(ours.begin(), ours.end(), [&](double e) { return e <= design.replay_.band; });
  design.replay_.inside = static_cast<double>(inside) / static_cast<double>(ours.size());
  return design;
}

void Design::show_on(Page& page, const Settings&, const Findings& findings) const {
  if (!made()) {
    if (!why_not_.empty()) page.box("No controller", {why_not_}, true);
    return;
  }
  const Identified& found = findings.found;
  const Candidate& chosen = all_[*chosen_];
  const double range = limits_.second - limits_.first;

  page.heading("Which observer");
  Figure tradeoff("tradeoff", {.rows = 1, .columns = 1, .panel_height = 240});
  tradeoff.caption("Noise against load.");
  std::vector<double> noise, error;
  for (const Candidate& one : all_) {
    noise.push_back(100 * one.control_noise / range);
    error.push_back(one.load_error);
  }
  tradeoff.panel(0, 0)
      .x_label("u by noise (% of its range)")
      .y_label("largest error after a load")
      .log_x()
      .log_y()
      .line(noise, error, {.name = "LinearEso"})
      .points({100 * chosen.control_noise / range}, {chosen.load_error},
              {.name = "taken", .color = Color::vermillion, .marker = Marker::square, .size = 2});
  page.figure(tradeoff);

  page.heading("The loop");
  Figure loop("loop", {.rows = 2, .columns = 2, .panel_height = 170});
  std::vector<double> w, gain, phase;
  const double nyquist = std::numbers::pi / found.log.sample_time;
  double before = -180;
  for (int i = 0; i <= 300; ++i) {
    const double at = nyquist * std::pow(10.0, -4.0 * (300 - i) / 300.0) * (1 - 1e-9);
    const auto l = loop_->loop_gain(at);
    if (!l) continue;
    double degrees = std::arg(*l) * 180 / std::numbers::pi;
    degrees += 360 * std::round((before - degrees) / 360);
    before = degrees;
    w.push_back(at);
    gain.push_back(std::abs(*l));
    phase.push_back(degrees);
  }
  const auto margins = esokit::margins(*loop_).value();
  loop.caption(
      "Left: loop gain with the machine that was found; phase margin " +
      number_text(margins.phase.value * 180 / std::numbers::pi, 3) + "°, gain margin " +
      number_text(margins.gain_increase.value, 3) + ", modulus margin " +
      number_text(margins.modulus.value, 2) +
      " (dashed: where L is one, where it is at -180°). "
      "Right: a step of the reference that takes half of the range of u, and a load of a tenth of "
      "it.");
  const auto bode = [&](Panel& panel) {
    if (margins.phase.limited()) panel.vertical_line(margins.phase.frequency);
    if (margins.gain_increase.limited()) panel.vertical_line(margins.gain_increase.frequency);
  };
  auto& upper = loop.panel(0, 0).x_label("w (rad/s)").y_label("abs L").log_x().log_y().name("gain");
  upper.line(w, gain, {.color = Color::blue, .column = "gain"}).horizontal_line(1.0);
  bode(upper);
  auto& lower =
      loop.panel(1, 0).x_label("w (rad/s)").y_label("phase of L (°)").log_x().name("phase");
  lower.line(w, phase, {.color = Color::blue, .column = "phase"}).horizontal_line(-180.0);
  bode(lower);
  const double duration = std::max(4 * chosen.settling, 40 * found.log.sample_time);
  const auto unit = esokit::reference_response(*loop_, {.duration = duration}).value();
  double peak = 0;
  for (const double u : unit.control[0]) peak = std::max(peak, std::abs(u));
  const double height = 0.5 * range / peak;
  const auto step =
      esokit::reference_response(*loop_, {.duration = duration, .height = height}).value();
  const auto load = esokit::load_response(*loop_, {.duration = duration,
                                                   .height = 0.1 * range * found.input_gain.value})
                        .value();
  loop.panel(0, 1)
      .x_label("t (s)")
      .y_label("y")
      .legend(Legend::above)
      .name("output")
      .line(step.time, step.output[0], {.name = "after a step of r", .color = Color::blue})
      .line(load.time, load.output[0], {.name = "after a load", .color = Color::vermillion})
      .horizontal_line(height);
  loop.panel(1, 1)
      .x_label("t (s)")
      .y_label("u")
      .legend(Legend::above)
      .name("control")
      .line(step.time, step.control[0], {.name = "after a step of r", .color = Color::blue})
      .line(load.time, load.control[0], {.name = "after a load", .color = Color::vermillion});
  page.figure(loop);

  page.heading("The log through this observer");
  Figure replay("replay", {.rows = 3, .columns = 1, .panel_height = 150});
  replay.caption(
      "Above: y and its estimate. Middle: u, and the disturbance in units of u. Below: what the "
      "observer had not expected; " +
      number_text(100 * replay_.inside, 3) +
      " % lie within the dashed lines, 95 % would if the machine were the model.");
  const auto& t = replay_.t;
  replay.panel(0, 0)
      .y_label("y")
      .legend(Legend::above)
      .name("y")
      .line(t, findings.rows.y, {.name = "y", .color = Color::grey, .width = 1.0})
      .line(t, replay_.estimate, {.name = "estimate", .color = Color::blue, .width = 1.1});
  replay.panel(1, 0)
      .y_label("u, d / b0")
      .legend(Legend::above)
      .name("u")
      .line(t, findings.rows.u, {.name = "u", .color = Color::grey, .width = 1.0})
      .line(t, replay_.load, {.name = "dhat / b0", .color = Color::vermillion, .width = 1.1});
  replay.panel(2, 0)
      .x_label("t (s)")
      .y_label("innovation")
      .name("innovation")
      .line(t, replay_.innovation, {.color = Color::blue, .width = 0.8, .column = "innovation"})
      .horizontal_line(replay_.band)
      .horizontal_line(-replay_.band);
  page.figure(replay);

  page.heading("Paste this");
  page.text("It compiles as it is, with esokit on the include path: g++ -std=c++20 -O2.");
  page.code(code_);
}

}  // namespace from_log
