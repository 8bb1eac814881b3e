// A drive whose cogging torque oscillates with its speed, and a plant with ripple of a known
// frequency: the resonators in the model, their price, and what is left where the frequency is
// wrong.
//
// Way: sampled. The observer sees a double integrator on which the load acts; what dhat is off by
// is what a law leaves of the load. The speed is known (that of the shaft) and is given each
// sample.
//
// Load   d = a_1 sin(phi) + a_2 sin(2 phi + 1),  phi' = w(t)   (cogging)
//
// symbol   code         value      unit
// T        sample_time  0.001      s
// omega_o  observer     60         rad/s
// w        speed        40 .. 160  rad/s, up in 4 s and down again
// a_1,a_2  -            2, 1       rad/s^2

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/gaussian.hpp>

#include "common/report.hpp"
#include "models/models.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace models;

namespace {

constexpr double observer = 60.0;
constexpr double design_speed = 80.0;

using Chain = LinearEso<2>;
using Fixed = ModelEso<ModelParts{.order = 2, .resonators = 2}>;
using Following = ModelEso<ModelParts{.order = 2, .resonators = 2, .follows_speed = true}>;
using Ripple = ModelEso<ModelParts{.order = 2, .resonators = 1}>;

double load(double angle) { return 2 * std::sin(angle) + std::sin(2 * angle + 1); }

/// w, from 40 up to 160 rad/s and down again.
double speed(double t) { return 100 - 60 * std::cos(2 * std::numbers::pi * t / 8); }

/// Margins of a loop on a double integrator, omega_c a quarter of omega_o.
template <class Observer>
Price loop_of(const typename Observer::Config& config) {
  const auto plant = LinearPlant<2>::chain({.input_gain = 1.0}).value();
  return price_of(
      plant,
      Adrc<Observer>::make({.observer = config, .controller_bandwidth = observer / 4}).value());
}

struct Tracked {
  std::vector<double> t, off;
  double rms = 0;
};

/// A double integrator under the load, `tell(observer, w)` before each sample.
template <class Observer, class Tell>
Tracked tracked(Observer eso, double noise, const Tell& tell) {
  Tracked result;
  sim::Gaussian gaussian(3);
  double y = 0, rate = 0, angle = 0, sum = 0;
  int count = 0;
  for (int k = 0; k < 8000; ++k) {
    const double t = k * sample_time;
    tell(eso, speed(t));
    constexpr int fine = 10;
    constexpr double h = sample_time / fine;
    for (int i = 0; i < fine; ++i) {
      const double turn = h * speed(t + i * h);
      const double a = load(angle), b = load(angle + turn / 2), c = load(angle + turn);
      y += rate * h + h * h / 6 * (a + 2 * b);
      rate += h / 6 * (a + 4 * b + c);
      angle += turn;
    }
    // The drive's own integrals of the load grow: taken off, as a loop would do, from both.
    (void)eso.update(y + noise * gaussian.next(), 0.0);
    const double off = eso.total_disturbance() - load(angle);
    if (k >= 1000) {
      sum += off * off;
      ++count;
    }
    if (k % 4 == 0) {
      result.t.push_back(t);
      result.off.push_back(off);
    }
  }
  result.rms = std::sqrt(sum / count);
  return result;
}

Chain::Config chain_config(double bandwidth) {
  return {.observer_bandwidth = bandwidth, .input_gain = 1.0, .sample_time = sample_time};
}
Chain chain_eso(double bandwidth) { return Chain::make(chain_config(bandwidth)).value(); }

template <class Eso>
typename Eso::Config config_of() {
  return {.observer_bandwidth = observer,
          .input_gain = 1.0,
          .sample_time = sample_time,
          .model = {.resonators = {{{design_speed}, {2 * design_speed}}}}};
}

void cogging(Report& report) {
  auto config = config_of<Following>();
  config.model.speed = {0.4, 2.7};
  const auto following = Following::make(config).value();
  const auto nothing = [](auto&, double) {};
  const auto given = [](double wrong) {
    return [wrong](Following& eso, double w) { (void)eso.set_speed(wrong * w / design_speed); };
  };
  const auto chain = chain_eso(observer);
  const auto fixed = Fixed::make(config_of<Fixed>()).value();
  std::vector<CsvRow> lines;
  const auto show = [&](const char* name, const auto& eso, const auto& tell, const Price& price) {
    const Tracked exact = tracked(eso, 0.0, tell);
    const Tracked noisy = tracked(eso, 1e-5, tell);
    lines.push_back(
        {name, number_text(exact.rms, 2),
         number_text(std::sqrt(std::max(0.0, noisy.rms * noisy.rms - exact.rms * exact.rms)), 2),
         or_unstable(price.modulus, 2), or_unstable(1000 * price.delay, 2)});
    return exact;
  };
  const auto loop_at = [](double factor) {
    auto shifted = config_of<Fixed>();
    for (auto& resonance : shifted.model.resonators) resonance.frequency *= factor;
    return loop_of<Fixed>(shifted);
  };
  const Price resonating = loop_at(1.0);
  const Tracked none =
      show("no model of it", chain, nothing, loop_of<Chain>(chain_config(observer)));
  const Tracked middle = show("resonators at the middle speed", fixed, nothing, resonating);
  const Tracked right = show("resonators that follow the speed", following, given(1.0), resonating);
  const Tracked wrong = show("the speed given 5 % too high", following, given(1.05), loop_at(1.05));
  const Tracked far = show("the speed given 30 % too high", following, given(1.3), loop_at(1.3));
  const double size = std::sqrt(2.5);
  report.expect("cogging", "share of the load left, no model", none.rms / size,
                none.rms > 0.3 * size, "above 0.3");
  report.expect("cogging", "share of the load left, following", right.rms / size,
                right.rms < 0.1 * size, "below 0.1");
  report.expect("cogging", "5 % wrong, of that without a model", wrong.rms / none.rms,
                wrong.rms < none.rms, "still better");
  report.expect("cogging", "30 % wrong, of that without a model", far.rms / none.rms,
                far.rms > 0.3 * none.rms, "most of the gain is gone");
  Figure figure("cogging", {.rows = 2, .columns = 1, .panel_height = 220});
  figure.caption(
      "Error of dhat while the speed, and with it the frequency of a cogging torque and of its "
      "second harmonic, goes from 40 to 160 rad/s and back in 8 s. omega_o = 60 rad/s. Bottom: "
      "with a wrong speed.");
  figure.panel(1, 0)
      .x_label("t (s)")
      .y_label("dhat − d (rad/s^2)")
      .legend(Legend::above)
      .name("wrong")
      .line(far.t, far.off,
            {.name = "speed 30 % too high", .color = Color::vermillion, .width = 0.8})
      .line(wrong.t, wrong.off, {.name = "5 % too high", .color = Color::sky, .width = 0.8})
      .line(right.t, right.off, {.name = "right", .color = Color::blue, .width = 1.2});
  figure.panel(0, 0)
      .x_label("t (s)")
      .y_label("dhat − d (rad/s^2)")
      .legend(Legend::above)
      .name("off")
      .line(none.t, none.off, {.name = "no model", .color = Color::grey, .width = 0.8})
      .line(middle.t, middle.off, {.name = "middle speed", .color = Color::orange, .width = 0.8})
      .line(right.t, right.off, {.name = "following", .color = Color::blue, .width = 1.2});
  report.add(figure);
  report.table(
      "cogging",
      "RMS of dhat - d after 1 s without noise, and what noise of 10 urad on the angle adds; "
      "margins of a loop with omega_c = 15 rad/s at a cogging frequency of 80 rad/s",
      {"observer", "motion (rad/s2)", "noise (rad/s2)", "modulus margin", "delay margin (ms)"},
      lines);
}

/// sd of dhat for noise of 1 on y.
template <class Observer>
double noise_of(const Observer& eso) {
  const auto system = observer_system(eso).template channel<0, 2>();
  const EigenMatrix<double, 1, 1> one = EigenMatrix<double, 1, 1>::Identity();
  const auto covariance = output_covariance(system, one);
  return std::sqrt((*covariance)(0, 0));
}

/// |1 - dhat / d| for a sine of w. The analysis holds d over a sample, which is half a sample late.
template <class Observer>
double left_over(const Observer& eso, double w) {
  const auto system = estimation_system(eso).template channel<1, 2>();
  const auto early = std::polar(1.0, w * sample_time / 2);
  return std::abs(1.0 - early * frequency_response(system, w).value()(0, 0));
}

Ripple::Config ripple_config(double w, double capture) {
  return {.observer_bandwidth = observer,
          .input_gain = 1.0,
          .sample_time = sample_time,
          .model = {.resonators = {{{w, 0.0, capture}}}}};
}
Ripple ripple_eso(double w, double capture) {
  return Ripple::make(ripple_config(w, capture)).value();
}

/// A chain that lets so much noise into dhat.
Chain chain_of_noise(double noise) {
  double low = observer, high = 20 * observer;
  for (int i = 0; i < 50; ++i) {
    const double middle = std::sqrt(low * high);
    (noise_of(chain_eso(middle)) < noise ? low : high) = middle;
  }
  return chain_eso(low);
}

/// A resonator with all poles at omega_o: what more noise buys.
auto all_poles_at(double omega_o, double w) {
  using Poles = ModelEso<ModelParts{.order = 2, .resonators = 1}, double, PoleSet>;
  Poles::Config config{
      .input_gain = 1.0, .sample_time = sample_time, .model = {.resonators = {{{w}}}}};
  for (auto& pole : config.poles) pole = -omega_o;
  return Poles::make(config).value();
}

void ripple(Report& report) {
  const Chain chain = chain_eso(observer);
  const double quiet = noise_of(chain);
  for (const auto& [share, decibel] :
       {std::array{10.0, 50.0}, std::array{5.0, 39.0}, std::array{3.0, 31.0}}) {
    const double w = observer / share;
    const auto eso = all_poles_at(observer, w);
    const std::string name = "all poles at omega_o, ripple at omega_o / " + number_text(share, 2);
    report.check_reference(name, "2 % beside, below a chain of equal noise (dB)", decibel,
                           20 * std::log10(left_over(chain_of_noise(noise_of(eso)), 1.02 * w) /
                                           left_over(eso, 1.02 * w)),
                           Tolerance::absolute(1));
    report.expect(name, "noise of dhat, of the chain's", noise_of(eso) / quiet,
                  noise_of(eso) > 7 * quiet && noise_of(eso) < 9 * quiet, "about eight: the price");
  }
  std::vector<CsvRow> lines;
  for (const double share : {1 / 10.0, 1 / 5.0, 1 / 3.0, 1.0, 3.0}) {
    const double w = share * observer;
    const auto eso = ripple_eso(w, 0);
    const double beside = left_over(eso, 1.02 * w);
    const Price price = loop_of<Ripple>(ripple_config(w, 0));
    lines.push_back({number_text(w, 3), number_text(noise_of(eso) / quiet, 2),
                     number_text(left_over(eso, w), 1), number_text(100 * beside, 2),
                     number_text(100 * left_over(eso, 1.3 * w), 2),
                     number_text(100 * left_over(chain, w), 2),
                     number_text(100 * left_over(chain_of_noise(noise_of(eso)), w), 2),
                     or_unstable(price.modulus, 2), or_unstable(1000 * price.delay, 2)});
    const std::string name = "ripple at omega_o times " + number_text(share, 2);
    // The held sine is smaller by (w T)^2 / 24.
    const double hold = w * sample_time * w * sample_time / 24;
    report.expect(name, "left over at its frequency", left_over(eso, w),
                  left_over(eso, w) < 1.1 * hold, "no more than the hold's (w T)^2 / 24");
    if (share > 0.34) continue;
    report.expect(name, "left over 2 % beside it", beside, beside < 0.032, "about 3 % at most");
    report.expect(name, "noise of dhat, of the chain's", noise_of(eso) / quiet,
                  noise_of(eso) < 3.3 * quiet, "3.2 at most");
  }
  report.table("ripple",
               "A resonator with s = w0 compared with the chain, omega_o = 60 rad/s: noise of "
               "dhat, and what remains of a sine at the frequency w0 of the resonator, 2 % and 30 "
               "% away from it; margins of the loop with the resonator, omega_c = 15 rad/s",
               {"w0 (rad/s)", "noise, chain = 1", "left at w0", "2 % beside (%)", "30 % beside (%)",
                "chain (%)", "chain of equal noise (%)", "modulus margin", "delay margin (ms)"},
               lines);

  Figure figure("ripple", {.rows = 1, .columns = 1, .panel_height = 260});
  figure.caption(
      "What remains of a disturbance, over its frequency: a resonator at 30 rad/s with capture "
      "bandwidths of a third, one and three times w0, compared with the chain. A wider one "
      "tolerates a larger error of the frequency and lets more noise through.");
  auto& panel = figure.panel(0, 0);
  panel.log_x().log_y().x_label("w (rad/s)").y_label("abs(1 − dhat/d)").name("left");
  panel.legend(Legend::bottom_right).y_range(1e-3, 3.0);
  const auto grid = log_grid<161>(3.0, 300.0).value();
  const auto curve = [&](const auto& eso) {
    std::vector<double> left;
    for (const double w : grid) left.push_back(left_over(eso, w));
    return left;
  };
  const std::vector<double> at(grid.begin(), grid.end());
  constexpr std::array colors = {Color::sky, Color::blue, Color::green};
  std::size_t i = 0;
  for (const double factor : {1.0 / 3, 1.0, 3.0}) {
    const auto eso = ripple_eso(30, 30 * factor);
    panel.line(at, curve(eso),
               {.name = "s = " + number_text(factor, 2) + " w0, noise " +
                        number_text(noise_of(eso) / quiet, 2),
                .color = colors[i++]});
  }
  panel.line(at, curve(chain), {.name = "chain, noise 1", .color = Color::vermillion});
  report.add(figure);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "models", "oscillation",
      about("Cogging and ripple",
            "Disturbances that oscillate with the speed of a shaft, and at a known frequency."));
  cogging(report);
  ripple(report);
  return report.finish();
}
