// What a delay does: how fast the observer must be, and how much delay the loop bears, for PADRC
// (current form) beside ADRC in predictor form, whose u is made of measurements one sample old.
//
// S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen, "Improved Active Disturbance Rejection Control (ADRC)
// with Extended State Filters", Energies 15 (2022) 5799, doi:10.3390/en15165799.
//
// Way: sampled; the sampled loop is linear, so it is stable if and only if the spectral
// radius of its step is below one. The plant is exact under an input that changes once in a sample.
//
// Plant      x1' = x2,  x2' = 20 x1 + 78 x2 + 230 u(t - delay)
// Step       state (x, prediction, inputs under way); y = x1;
//            PADRC, EPADRC  z = z- + L (y - z-_1), u = law(z),  z-next = A z + B u
//            ADRC           u = law(z-),  z = z- + L (y - z-_1), z-next = A z + B u
// Neither knows of the delay.
//
// symbol    code                   value          unit
// tau       sample_time            1e-3           s
// k1, k2    controller_bandwidth   omega_c = 100  rad/s
// omega_o   (swept)                100 .. 2000    rad/s
// EPADRC    filter_config          limit gain for sigma = 0.001, 0.01

#include <Eigen/Dense>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/eigen.hpp>
#include <string>
#include <vector>

#include "common/compiled/spectral_radius.hpp"
#include "common/parallel.hpp"
#include "common/report.hpp"
#include "paper5_esf_epadrc/paper5.hpp"

using namespace esokit::examples;
using namespace paper5;

namespace {

constexpr int most_samples = 12;  // of delay, whole samples

/// The linear part of the loop: plant (2), prediction (3), inputs under way, the newest first.
using Loop = EigenMatrix<double, 5 + most_samples + 1, 1>;

/// x after `time` under a held input without the constant 10 of f: linear, exact to 1e-12.
EigenMatrix<double, 2> linear_plant(const EigenMatrix<double, 2>& x, double u, double time) {
  if (time <= 0.0) return x;
  const EigenMatrix<double, 2> at_rest = Plant::step(EigenMatrix<double, 2>::Zero(), 0.0, time);
  return Plant::step(x, u, time) - at_rest;
}

/// One sample of the loop. @param delay of the actuator, s @param current PADRC; else ADRC
Loop step(const Loop& state, const EigenMatrix<double, 3>& gain, double delay, bool current) {
  static const EigenMatrix<double, 3, 3> a =
      esokit::IntegratorChain<2>::transition_matrix(sample_time);
  static const EigenMatrix<double, 3> b =
      esokit::IntegratorChain<2>::sampled_input_matrix(sample_time, input_gain);
  static const esokit::AdrcLaw<2> feedback = law();
  EigenMatrix<double, 2> x = state.head<2>();
  const EigenMatrix<double, 3> predicted = state.segment<3>(2);
  const EigenMatrix<double, 3> corrected = predicted + gain * (x(0) - predicted(0));
  const double u = feedback.control(current ? corrected : predicted, 0.0);
  const auto input = [&](int age) { return age == 0 ? u : state(5 + age - 1); };
  const int whole = static_cast<int>(std::floor(delay / sample_time + 1e-9));
  const double rest = delay - whole * sample_time;
  x = linear_plant(x, input(whole + 1), rest);
  x = linear_plant(x, input(whole), sample_time - rest);
  Loop next = Loop::Zero();
  next.head<2>() = x;
  next.segment<3>(2) = a * corrected + b * u;
  next(5) = u;
  for (int age = 1; age <= most_samples; ++age) next(5 + age) = state(5 + age - 1);
  return next;
}

double spectral_radius(const EigenMatrix<double, 3>& gain, double delay, bool current) {
  constexpr int size = Loop::RowsAtCompileTime;
  EigenMatrix<double, size, size> map;
  for (int i = 0; i < size; ++i) map.col(i) = step(Loop::Unit(i), gain, delay, current);
  return compiled::spectral_radius(map);
}

EigenMatrix<double, 3> linear_gain(double bandwidth) {
  const auto observer = Linear::make(linear_config(bandwidth)).value();
  return esokit::physical_gain<3, double>(observer.level_gain(0), sample_time);
}

EigenMatrix<double, 3> filter_gain(double deviation) {
  auto config = filter_config(deviation);
  config.mode = esokit::RiccatiMode::frozen;
  return Filter::make(config).value().gain();
}

/// The least omega_o that stabilises, rad/s.
double least_bandwidth(double delay, bool current) {
  double low = 20.0;
  double high = 2000.0;
  for (int i = 0; i < 40; ++i) {
    const double middle = std::sqrt(low * high);
    (spectral_radius(linear_gain(middle), delay, current) < 1.0 ? high : low) = middle;
  }
  return high;
}

/// The largest delay under which the loop is stable, s; 0 if it is not even without.
double delay_margin(const EigenMatrix<double, 3>& gain, bool current) {
  if (spectral_radius(gain, 0.0, current) >= 1.0) return 0.0;
  double stable = 0.0;
  const double most = (most_samples - 1) * sample_time;
  double unstable = most;
  for (double delay = 0.0; delay <= most; delay += 0.1 * sample_time) {
    if (spectral_radius(gain, delay, current) >= 1.0) {
      unstable = delay;
      break;
    }
    stable = delay;
  }
  for (int i = 0; i < 20; ++i) {
    const double middle = 0.5 * (stable + unstable);
    (spectral_radius(gain, middle, current) < 1.0 ? stable : unstable) = middle;
  }
  return stable;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "delay",
                about("Delay study: PADRC compared with the predictor form",
                      "Spectral radius of the linear sampled loop over observer bandwidth and "
                      "actuator delay. Sampled controllers.",
                      2, true));

  // How fast the observer must be.
  const double none = least_bandwidth(0.0, true);
  const double one = least_bandwidth(sample_time, true);
  const double predictor = least_bandwidth(0.0, false);
  // The independent run names an omega_o that is enough, in whole rad/s, not the border itself.
  const auto enough = [&](const std::string& name, double border, double reference, double delay) {
    report.check(name, "least omega_o (rad/s)", std::nullopt, border, std::nullopt,
                 "independent run: " + number_text(reference, 3) + " is enough");
    report.expect(name + ", omega_o = " + number_text(reference, 3), "spectral radius",
                  spectral_radius(linear_gain(reference), delay, true),
                  spectral_radius(linear_gain(reference), delay, true) < 1.0, "stable");
  };
  enough("PADRC", none, 175.0, 0.0);
  enough("PADRC, one sample of delay more", one, 259.0, sample_time);
  report.check_reference("PADRC, one sample of delay more", "least omega_o, over that without",
                         259.0 / 175.0, one / none,
                         Tolerance::absolute(259.0 / 175.0 * (0.5 / 259.0 + 0.5 / 175.0)));
  report.check("ADRC, predictor form", "least omega_o (rad/s)", std::nullopt, predictor);

  // How much delay the loop bears.
  std::vector<double> bandwidth;
  for (double w = 150.0; w < 2080.0; w *= 1.04) bandwidth.push_back(w);
  const auto margins = run_parallel("delay margins", 2 * bandwidth.size(), [&](std::size_t job) {
    return 1e3 * delay_margin(linear_gain(bandwidth[job / 2]), job % 2 == 0);
  });
  std::vector<double> current;
  std::vector<double> late;
  for (std::size_t i = 0; i < bandwidth.size(); ++i) {
    current.push_back(margins[2 * i]);
    late.push_back(margins[2 * i + 1]);
  }
  const double padrc = 1e3 * delay_margin(linear_gain(observer_bandwidth), true);
  const double adrc = 1e3 * delay_margin(linear_gain(observer_bandwidth), false);
  report.check("PADRC, omega_o = 800", "delay margin (ms)", std::nullopt, padrc);
  report.check("ADRC, predictor form, omega_o = 800", "delay margin (ms)", std::nullopt, adrc);
  report.expect("PADRC beside the predictor form, omega_o = 800", "delay margin gained (samples)",
                (padrc - adrc) * 1e-3 / sample_time, padrc > adrc,
                "the two-phase form tolerates more delay");
  for (const double deviation : {0.001, 0.01}) {
    const double margin = 1e3 * delay_margin(filter_gain(deviation), true);
    report.check("EPADRC, limit gain for sigma " + number_text(deviation, 3), "delay margin (ms)",
                 std::nullopt, margin);
  }

  // The real controllers at both sides of the margin.
  const auto remains_bounded = [&](double delay) {
    Predictive<Linear> controller(linear_config(), 0.0);
    EigenMatrix<double, 2> x(0.01, 0.0);
    std::vector<double> inputs(most_samples + 1, 0.0);
    const int whole = static_cast<int>(std::floor(delay / sample_time + 1e-9));
    const double rest = delay - whole * sample_time;
    double peak = 0.0;
    for (int k = 0; k < 3000; ++k) {
      const double u = controller.step(x(0), 0.0);
      inputs.insert(inputs.begin(), u);
      inputs.pop_back();
      x = Plant::step(x, inputs[static_cast<std::size_t>(whole) + 1], rest);
      x = Plant::step(x, inputs[static_cast<std::size_t>(whole)], sample_time - rest);
      if (k > 2500) peak = std::max(peak, std::abs(x(0)));
      if (!(std::abs(x(0)) < 1e6)) return 1e9;
    }
    return peak;
  };
  const double below = remains_bounded(0.97e-3 * padrc);
  const double above = remains_bounded(1.03e-3 * padrc);
  report.expect("PADRC simulated at 97 % of the margin", "peak |y| after 2.5 s", below,
                below < 1e-3, "settles");
  report.expect("PADRC simulated at 103 % of the margin", "peak |y| after 2.5 s", above,
                above > 1.0, "diverges");

  Figure figure("delay", {.rows = 1, .columns = 2, .panel_height = 260});
  figure.caption(
      "Left: delay that the loop tolerates, over omega_o. The predictor form uses measurements "
      "that are one sample old, but loses less than one sample time. Dashed and dotted: EPADRC "
      "with its "
      "steady-state gains. Right: spectral radius over omega_o; below one the loop is stable.");
  auto& margin_panel = figure.panel(0, 0)
                           .x_label("ω_o (rad/s)")
                           .y_label("delay margin (ms)")
                           .x_range(0.0, 2000.0)
                           .legend(Legend::bottom_right)
                           .name("margin");
  margin_panel.line(bandwidth, current, {.name = "PADRC", .color = Color::blue})
      .line(bandwidth, late, {.name = "ADRC, predictor form", .color = Color::sky});
  for (const double deviation : {0.001, 0.01}) {
    margin_panel.line({0.0, 2000.0},
                      std::vector<double>(2, 1e3 * delay_margin(filter_gain(deviation), true)),
                      {.name = "EPADRC, σ = " + number_text(deviation, 3),
                       .color = Color::vermillion,
                       .dash = deviation < 0.005 ? Dash::dashed : Dash::dotted});
  }
  auto& radius = figure.panel(0, 1)
                     .x_label("ω_o (rad/s)")
                     .y_label("spectral radius (-)")
                     .x_range(0.0, 2000.0)
                     .y_range(0.92, 1.04)
                     .legend(Legend::top_right)
                     .name("radius");
  std::vector<double> fine;
  for (double w = 60.0; w < 2040.0; w *= 1.02) fine.push_back(w);
  const auto radii = [&](double delay, bool is_current) {
    std::vector<double> result;
    for (const double w : fine)
      result.push_back(spectral_radius(linear_gain(w), delay, is_current));
    return result;
  };
  radius.line(fine, radii(0.0, true), {.name = "PADRC", .color = Color::blue})
      .line(fine, radii(0.0, false), {.name = "ADRC, predictor form", .color = Color::sky})
      .line(fine, radii(sample_time, true),
            {.name = "PADRC, delay 1 ms", .color = Color::blue, .dash = Dash::dashed})
      .horizontal_line(1.0);
  report.add(figure);
  report.remark("With omega_c = 100 the plant with its pole at +78 needs an omega_o of at least " +
                number_text(none, 3) + " rad/s; a sample of delay raises that to " +
                number_text(one, 3) +
                ". The predictor form, whose measurements are one sample old, needs " +
                number_text(predictor, 3) + ".");
  report.claim({.text = "PADRC has less delay between measurement and u, and so more stability.",
                .where = "abstract; 3.1; 5",
                .holds = padrc > adrc && none < predictor ? Claim::Holds::yes : Claim::Holds::no,
                .here = "The paper shows no number. At omega_o = 800 the loop bears a delay of " +
                        number_text(padrc, 3) + " ms instead of " + number_text(adrc, 3) +
                        " ms with measurements one sample old.",
                .figure = "delay"});
  return report.finish();
}
