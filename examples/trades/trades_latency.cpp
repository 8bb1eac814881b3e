// The speed of a robot's drive train with the numbers that its team has: kV, kA and a measurement
// that is 20 ms late. What the delay costs, and what telling it to the observer gives.
//
// Plant   kA y' = u - kV y + load; kV = 1.98 V s/m, kA = 0.2 V s^2/m; T = 20 ms, abs(u) <= 12 V
//         y: speed, seen 20 ms late, noise 0.02 m/s a sample
// P       u = kV r + kA r' + K (r - y), K by LQR (0.1 m/s against 12 V), and K as it is made
// smaller
//         for the delay, K (A - B K)^(delay / T)
// PI      the same with an integral; ADRC of order 1: b0 = 1 / kA, with the delay, and kV, in the
//         observer or not. Tuned by one rule.

#include <algorithm>
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <functional>
#include <string>
#include <vector>

#include "trades/trades.hpp"

using namespace esokit;
using namespace esokit::examples;

namespace {

constexpr double T = 0.02, kV = 1.98, kA = 0.2, most = 12, speed_noise = 0.02;
constexpr double least_modulus = 0.5, most_noise = 0.3;

/// The drive in truth: factors of kV and kA.
struct Drive {
  double v = 1;
  double a = 1;
};

/// u of y and the reference with its derivative.
using Law = std::function<double(double, double, double)>;

struct Drove {
  std::vector<double> t, wanted, speed, u;
  double tracking = 0;  ///< RMS of r - y on the profile, m/s
  double push = 0;      ///< largest abs(r - y) while it is pushed, m/s
  double left = 0;      ///< at its end
  double area = 0;      ///< its integral, m
};

/// To 3 m/s at 6 m/s^2, from 2 s on pushed by as much as 3 V.
Drove run(const Law& law, const Drive& drive = {}, double noise = 0) {
  Drove drove;
  sim::Gaussian gaussian(5);
  const double pole = drive.v * kV / (drive.a * kA), a = std::exp(-pole * T);
  double y = 0, seen = 0, squares = 0;
  for (int k = 0; k < 200; ++k) {
    const double t = k * T;
    const double r = std::clamp(6 * (t - 0.2), 0.0, 3.0);
    const double slope = t >= 0.2 && t < 0.7 ? 6 : 0;
    const double push = t >= 2 ? -3 : 0;
    const double u = std::clamp(law(seen + noise * gaussian.next(), r, slope), -most, most);
    if (t < 2) {
      squares += (r - y) * (r - y) / 100;
    } else {
      drove.push = std::max(drove.push, std::abs(r - y));
      drove.area += T * std::abs(r - y);
      drove.left = std::abs(r - y);
    }
    drove.t.push_back(t);
    drove.wanted.push_back(r);
    drove.speed.push_back(y);
    drove.u.push_back(u);
    seen = y;  // a sample late
    y = a * y + (1 - a) / (drive.v * kV) * (u + push);
  }
  drove.tracking = std::sqrt(squares);
  return drove;
}

struct Gains {
  double first = 0;   ///< K, V s/m, or omega_c, rad/s
  double second = 0;  ///< K_i, V/m, or omega_o, rad/s
};

/// P or PI. @param waits compares y with the reference of 20 ms ago, when y was that
Law pi(const Gains& gains, bool waits) {
  return [gains, waits, integral = 0.0, last = 0.0](double y, double r, double slope) mutable {
    const double error = (waits ? last : r) - y;
    last = r;
    const double step = gains.second * T * error;
    const double u = kV * r + kA * slope + gains.first * error + integral + step;
    if (std::abs(u) < most || u * step < 0) integral += step;
    return u;
  };
}
Law law_of_pi(const Gains& gains) { return pi(gains, false); }
Law law_of_waiting_pi(const Gains& gains) { return pi(gains, true); }
LinearController form_of_pi(const Gains& gains) {
  LinearController c(1, 1, 0, T);
  c.from_y(0, 0) = -gains.second * T;
  c.to_u(0, 0) = 1;
  c.y_to_u(0, 0) = -gains.first - gains.second * T;
  return c;
}
LinearController form_of_p(const Gains& gains) {
  LinearController c(0, 1, 0, T);
  c.y_to_u(0, 0) = -gains.first;
  return c;
}

using Plain = Adrc<LinearEso<1>>;
using Told = Adrc<DelayedInput<LinearEso<1>, 1>>;
using Knowing = Adrc<DelayedInput<ModelEso<ModelParts{.order = 1, .plant_poles = true}>, 1>>;
template <class C>
C adrc(const Gains& gains) {
  typename C::Config config{};
  config.controller_bandwidth = gains.first;
  config.limits = {.lower = -most, .upper = most};
  const auto set = [&](auto& observer) {
    observer.observer_bandwidth = gains.second;
    observer.input_gain = 1 / kA;
    observer.sample_time = T;
  };
  if constexpr (std::is_same_v<C, Plain>) {
    set(config.observer);
  } else {
    set(config.observer.observer);
    config.observer.delay = 1;
    if constexpr (std::is_same_v<C, Knowing>) config.observer.observer.model.plant = {kV / kA};
  }
  return C::make(config).value();
}
template <class C>
Law law_of(const Gains& gains) {
  return [c = adrc<C>(gains)](double y, double r, double slope) mutable {
    return c.update(y, {r, slope});
  };
}

struct Judged {
  double modulus = -1;
  double noise = 1e9;
};
template <class C>
Judged judge(const C& controller, const Drive& drive) {
  const auto plant = LinearPlant<1>::chain({.coefficients = {drive.v * kV / (drive.a * kA)},
                                            .input_gain = 1 / (drive.a * kA),
                                            .dead_time = T})
                         .value();
  const auto loop = closed_loop(plant, controller);
  if (!loop || !loop->stable()) return {};
  const auto found = margins(*loop);
  const auto sigma = noise(*loop, {.measurement = {speed_noise}});
  return found && sigma ? Judged{found->modulus.value, sigma->control[0]} : Judged{};
}

struct Way {
  std::string name;
  std::function<Law(const Gains&)> law;
  std::function<Judged(const Gains&, const Drive&)> judged;
  Gains gains{};
  Drove drove{};
};

double least_of(const Way& way, const Gains& gains) {
  double least = 1e9;
  for (const double v : {0.9, 1.0, 1.1}) {
    for (const double a : {0.7, 1.0, 1.3}) {
      least = std::min(least, way.judged(gains, {v, a}).modulus);
    }
  }
  return least;
}

/// Least area under the push with a modulus margin of 0.5 at the ends of what kV and kA may be, and
/// no more noise in u.
void choose(Way& way, double first, double second) {
  double least = 1e9;
  for (int i = 0; i <= 32; ++i) {
    for (int j = 0; j <= 32; ++j) {
      const Gains gains{first * std::pow(10.0, i / 16.0), second * std::pow(10.0, j / 16.0)};
      const Judged judged = way.judged(gains, {1, 0.7});
      if (!(judged.modulus >= least_modulus)) continue;
      if (!(way.judged(gains, {}).noise <= most_noise)) continue;
      const double area = run(way.law(gains)).area;
      if (area < least && least_of(way, gains) >= least_modulus) {
        least = area;
        way.gains = gains;
      }
    }
  }
}

/// LQR of the sampled drive: 0.1 m/s weigh as much as 12 V.
double lqr(double a, double b) {
  const double q = 1 / (0.1 * 0.1), r = 1 / (most * most);
  double p = q;
  for (int i = 0; i < 10000; ++i) p = q + a * a * p - (a * b * p) * (a * b * p) / (r + b * b * p);
  return a * b * p / (r + b * b * p);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "trades", "latency",
                trades::about("A drive whose speed is seen 20 ms late",
                              "kV, kA and 20 ms of delay: the P with feed-forward that teams use, "
                              "also with its gain made smaller for the delay, a PI and ADRC, tuned "
                              "by one rule."));
  const auto by = [](auto form) {
    return [form](const Gains& gains, const Drive& drive) { return judge(form(gains), drive); };
  };
  std::vector<Way> ways{{"P by LQR", law_of_pi, by(form_of_p)},
                        {"P by LQR, compensated", law_of_pi, by(form_of_p)},
                        {"PI", law_of_pi, by(form_of_pi)},
                        {"PI, reference late, too", law_of_waiting_pi, by(form_of_pi)},
                        {"ADRC, delay not known", law_of<Plain>, by(adrc<Plain>)},
                        {"ADRC, delay known", law_of<Told>, by(adrc<Told>)},
                        {"ADRC, delay and kV known", law_of<Knowing>, by(adrc<Knowing>)}};
  const double a = std::exp(-kV / kA * T), b = (1 - a) / kV, k = lqr(a, b);
  ways[0].gains = {k, 0};
  ways[1].gains = {k * (a - b * k), 0};
  choose(ways[2], 0.1, 0.5);
  ways[3].gains = ways[2].gains;
  for (std::size_t i = 4; i < 7; ++i) choose(ways[i], 2, 2);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    Way& way = ways[i];
    const bool adrc = i > 3, chosen = i > 1;
    way.drove = run(way.law(way.gains));
    const auto row = [&](const char* metric, double value) {
      report.expect(way.name, metric, value, true, "reported");
    };
    row(adrc ? "omega_c (rad/s)" : "K (V s/m)", way.gains.first);
    if (chosen) row(adrc ? "omega_o (rad/s)" : "K_i (V/m)", way.gains.second);
    const double least = least_of(way, way.gains);
    report.expect(way.name, "least modulus margin, kA 30 % and kV 10 % off", least,
                  !chosen || least >= least_modulus, chosen ? "at least 0.5" : "reported");
    const double sigma = way.judged(way.gains, {}).noise;
    report.expect(way.name, "noise in u (V)", sigma, !chosen || sigma <= most_noise,
                  chosen ? "at most 0.3" : "reported");
    row("error on the profile, RMS (m/s)", way.drove.tracking);
    row("the same, 30 % heavier (m/s)", run(way.law(way.gains), {1, 1.3}).tracking);
    row("largest error while pushed (m/s)", way.drove.push);
    row("left of it after 2 s (m/s)", way.drove.left);
    row("its area (m)", way.drove.area);
  }
  const auto over = [&](const char* name, double ratio) {
    report.expect("ADRC, delay and kV known", name, ratio, true, "reported");
  };
  over("area over the PI's", ways[6].drove.area / ways[2].drove.area);
  over("error on the profile over the PI's", ways[6].drove.tracking / ways[2].drove.tracking);
  over("the same, PI with the reference late", ways[6].drove.tracking / ways[3].drove.tracking);

  Figure figure("latency", {.rows = 2, .columns = 1, .panel_height = 170});
  figure.caption(
      "To 3 m/s, and from 2 s on pushed by as much as 3 V: the speed as it is, and u. It is seen "
      "20 "
      "ms late.");
  const Color colors[] = {Color::orange, Color::vermillion, Color::blue, Color::blue,
                          Color::green,  Color::green,      Color::green};
  auto& speed = figure.panel(0, 0).y_label("speed (m/s)").hide_x_numbers().legend(Legend::above);
  auto& u = figure.panel(1, 0).x_label("t (s)").y_label("u (V)");
  speed.line(Column(ways[0].drove.t), ways[0].drove.wanted,
             {.name = "wanted", .color = Color::grey, .width = 1});
  for (const std::size_t i : {0u, 1u, 2u, 6u}) {
    const auto& drove = ways[i].drove;
    speed.line(Column(drove.t), drove.speed, {.name = ways[i].name, .color = colors[i]});
    u.line(Column(drove.t), drove.u, {.color = colors[i]});
  }
  report.add(figure);
  return report.finish();
}
