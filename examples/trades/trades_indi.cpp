// INDI or ADRC? One axis of a drone, four ways, all tuned by one rule. Two are incremental dynamic
// inversion, with the rotor's speed measured and with a model of it; two are ADRC, with the rotor's
// lag in the model and without it.
//
// Plant   y' = b v + d, tau v' = u - v; b = 600 rad/s^2, tau = 30 ms, T = 1 ms, abs(u) <= 1
//         gyro noise 0.02 rad/s a sample; v: what the rotors do, from their measured speed
// INDI    u = v_f + (nu - y'_f) / b, nu = omega_c (r - y), both filtered alike, at omega_f
//
// Let y'_f = H (y[k] - y[k-1]) / T and v_f = H (mean of v over the sample). Then this is an
// observer of order 1 that is given v as its input: dhat = H (y' - b v), and u = (nu - dhat) / b.
// The poles of H are those of the observer's error. The program checks that sample by sample.

#include <algorithm>
#include <cmath>
#include <complex>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <esokit/analysis/margins.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/gain/pole_set.hpp>
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

constexpr double T = 1e-3, lag = 0.03, gain = 600, gyro_noise = 0.02, damping = 0.7;
constexpr int late = 3;  // samples by which the gyro's filters delay y
constexpr double least_modulus = 0.5, most_noise = 0.03;

struct Design {
  double controller = 0;  ///< omega_c, rad/s
  double observer = 0;    ///< omega_o, or omega_f of INDI, rad/s
  double drive = 1;       ///< by how much faster than by themselves the rotors are driven
};

/// A filter of second order without zeros, gain 1.
class Filter {
 public:
  explicit Filter(double frequency) {
    const double decay = std::exp(-damping * frequency * T);
    a1_ = -2 * decay * std::cos(std::sqrt(1 - damping * damping) * frequency * T);
    a0_ = decay * decay;
  }
  double operator()(double x) {
    const double y = (1 + a1_ + a0_) * x - a1_ * last_ - a0_ * before_;
    before_ = last_;
    return last_ = y;
  }
  [[nodiscard]] std::complex<double> response(std::complex<double> z) const {
    return (1 + a1_ + a0_) / (1.0 + (a1_ + a0_ / z) / z);
  }

 private:
  double a1_, a0_, last_ = 0, before_ = 0;
};

/// INDI as it is written in its papers.
class Indi {
 public:
  explicit Indi(const Design& design)
      : law_(design.controller),
        drive_(design.drive),
        rate_(design.observer),
        rotors_(design.observer) {}
  /// @param y rate @param r the wanted one @param v mean of what the rotors did since the last call
  /// @param now what they do at this moment
  double update(double y, double r, double v, double now = 0) {
    const double acceleration = rate_((y - last_) / T);
    last_ = y;
    const double wanted = rotors_(v) + (law_ * (r - y) - acceleration) / gain;
    return std::clamp(drive_ == 1 ? wanted : now + drive_ * (wanted - now), -1.0, 1.0);
  }

 private:
  double law_, drive_, last_ = 0;
  Filter rate_, rotors_;
};

/// The same as an observer with a law.
using AsObserver = DisturbanceCompensator<LinearEso<1, double, 1, PoleSet>>;
AsObserver as_observer(const Design& design) {
  const std::complex<double> pole =
      design.observer * std::complex<double>(-damping, std::sqrt(1 - damping * damping));
  AsObserver::Config config{.limits = {.lower = -1, .upper = 1}};
  config.observer = {.poles = {pole, std::conj(pole)}, .input_gain = gain, .sample_time = T};
  return AsObserver::make(config).value();
}

using Knowing = Adrc<DelayedInput<ModelEso<ModelParts{.order = 1, .actuator = 1}>, late>>;
using Plain = Adrc<DelayedInput<LinearEso<1>, late>>;
Knowing knowing(const Design& design) {
  Knowing::Config config{.controller_bandwidth = design.controller,
                         .limits = {.lower = -1, .upper = 1}};
  config.observer = {.observer = {.observer_bandwidth = design.observer,
                                  .input_gain = gain,
                                  .sample_time = T,
                                  .model = {.actuator = {lag}}},
                     .delay = late};
  return Knowing::make(config).value();
}
Plain plain(const Design& design) {
  return Plain::make({.observer = {.observer = {.observer_bandwidth = design.observer,
                                                .input_gain = gain,
                                                .sample_time = T},
                                   .delay = late},
                      .controller_bandwidth = design.controller,
                      .limits = {.lower = -1, .upper = 1}})
      .value();
}

/// What an axis is in truth.
struct Axis {
  double lag = ::lag;
  double gain = ::gain;
  int telemetry = 0;  ///< samples by which the rotors' speed comes late
};

/// u of y, r and the v that telemetry tells: the mean over a sample as late as y, and the present
/// one.
using Law = std::function<double(double, double, double, double)>;

struct Flight {
  std::vector<double> t, rate, u;
  double deviation = 0;  ///< largest, under the gust, rad/s
  double area = 0;       ///< integral of abs(r - y) under the gust, rad
  double noise = 0;      ///< standard deviation of u before the gust
};

/// A gust of 60 rad/s^2 from 2.0 s on. @param noise of the gyro, rad/s
Flight fly(const Law& controller, const Axis& axis, double noise) {
  Flight flight;
  sim::Gaussian gaussian(7);
  const double a = std::exp(-T / axis.lag);
  double y = 0, v = 0, sum = 0, squares = 0;
  std::vector<double> means(static_cast<std::size_t>(late + axis.telemetry) + 1, 0.0);
  std::vector<double> rates(late + 1, 0.0);
  std::vector<double> speeds(static_cast<std::size_t>(axis.telemetry) + 1, 0.0);
  int counted = 0;
  for (int k = 0; k < 3000; ++k) {
    const double gust = k >= 2000 ? 60 : 0;
    const double u =
        controller(rates.front() + noise * gaussian.next(), 0.0, means.front(), speeds.front());
    if (k >= 500 && k < 2000) {
      sum += u;
      squares += u * u;
      ++counted;
    }
    if (k >= 1950 && k < 2350) {
      flight.t.push_back((k - 2000) * T);
      flight.rate.push_back(y);
      flight.u.push_back(u);
    }
    if (k >= 2000) {
      flight.deviation = std::max(flight.deviation, std::abs(y));
      flight.area += T * std::abs(y);
    }
    const double mean = u + (v - u) * axis.lag * (1 - a) / T;  // over the sample, exact
    y += T * (axis.gain * mean + gust);
    rates.push_back(y);
    rates.erase(rates.begin());
    const double next = u + (v - u) * a;
    means.push_back(0.5 * (v + next));  // what two readings of the speed tell
    means.erase(means.begin());
    v = next;
    speeds.push_back(v);
    speeds.erase(speeds.begin());
  }
  const double average = sum / counted;
  flight.noise = std::sqrt(squares / counted - average * average);
  return flight;
}

Law run_indi(const Design& design) {
  return [indi = Indi(design)](double y, double r, double v, double now) mutable {
    return indi.update(y, r, v, now);
  };
}
/// With a model of the rotors in place of their speed.
Law run_modelled(const Design& design) {
  return [indi = Indi(design), v = 0.0, last = 0.0, means = std::vector<double>(late + 1, 0.0)](
             double y, double r, double, double) mutable {
    const double next = last + (v - last) * std::exp(-T / lag);
    means.push_back(0.5 * (v + next));
    means.erase(means.begin());
    v = next;
    return last = indi.update(y, r, means.front());
  };
}
template <class C>
Law run(const C& made) {
  return [c = made](double y, double r, double, double) mutable { return c.update(y, r); };
}

/// Smallest abs(1 + L) of INDI, the loop opened at u, and the deviation of u by the gyro's noise.
/// Not a number if the loop is not stable. @param measured the rotors' speed is
struct Judged {
  double modulus = 0;
  double noise = 0;
};
Judged judge_indi(const Design& design, const Axis& axis, bool measured) {
  const Filter filter(design.observer);
  const double pi = std::acos(-1.0);
  const double a = std::exp(-T / axis.lag);
  const double given = std::exp(-T / (measured ? axis.lag : lag));
  constexpr int points = 600;
  Judged judged{1e9, 0};
  double turned = 0, before = 0;
  for (int i = 1; i <= points; ++i) {  // dense at low frequencies
    const double share = static_cast<double>(i) / points;
    const double angle = pi * share * share;
    const auto back = std::polar(1.0, -angle);  // 1 / z
    const auto gyro = std::polar(1.0, -angle * late);
    const auto telemetry = std::polar(1.0, -angle * (measured ? axis.telemetry : 0));
    const auto v = (1 - a) * back / (1.0 - a * back);
    const auto y = axis.gain * (T + (v - 1.0) * axis.lag * (1 - a)) * back / (1.0 - back) * gyro;
    const auto seen = (1 - given) * back / (1.0 - given * back) * telemetry;
    const auto h = filter.response(1.0 / back);
    const auto from_y = design.drive * (design.controller + h * (1.0 - back) / T) / gain;
    const auto one_plus_l = 1.0 - (1 - design.drive) * seen + from_y * y -
                            design.drive * h * 0.5 * (1.0 + back) * seen * gyro;
    judged.modulus = std::min(judged.modulus, std::abs(one_plus_l));
    judged.noise += std::norm(from_y / one_plus_l) * 2 * share / points;
    const double phase = std::arg(one_plus_l);
    if (i > 1) turned += std::remainder(phase - before, 2 * pi);
    before = phase;
  }
  judged.noise = gyro_noise * std::sqrt(judged.noise);
  // Stable if 1 + L turns from -90 degrees, by the integrator, to 0 and not around 0.
  if (std::abs(turned - pi / 2) > 1) judged.modulus = -1;
  return judged;
}

template <class C>
Judged judge(const C& controller, const Axis& axis) {
  const auto chain =
      LinearPlant<1>::chain({.input_gain = axis.gain, .dead_time = late * T}).value();
  const auto loop = closed_loop(with_lag(chain, axis.lag).value(), controller);
  const auto found = margins(*loop);
  if (!found) return {-1, 1e9};
  const auto sigma = noise(*loop, {.measurement = {gyro_noise}});
  return {found->modulus.value, sigma ? sigma->control[0] : 1e9};
}

struct Way {
  std::string name;
  std::function<Judged(const Design&, const Axis&)> judged;
  std::function<Law(const Design&)> make;
  std::vector<double> drives{1};
  int telemetry = 0;  ///< samples by which the rotors' speed comes late, and is designed for
  Design design{};
  Flight flight{};
};

double least_of(const Way& way, const Design& design, int telemetry) {
  double least = 1e9;
  for (const double b : {0.7, 1.0, 1.3}) {
    for (const double tau : {0.7, 1.0, 1.3}) {
      least = std::min(least, way.judged(design, {lag * tau, gain * b, telemetry}).modulus);
    }
  }
  return least;
}

/// The one rule: least area under the gust with a modulus margin of 0.5 at the ends of what b and
/// the lag may be, and no more noise in u.
void choose(Way& way) {
  double least = 1e9;
  for (const double drive : way.drives) {
    for (int i = 0; i <= 24; ++i) {
      for (int j = 0; j <= 24; ++j) {
        const Design design{8 * std::pow(10.0, i / 14.0), 8 * std::pow(10.0, j / 10.0), drive};
        const Axis axis{lag, gain, way.telemetry};
        if (!(way.judged(design, {lag, 1.3 * gain, way.telemetry}).modulus >= least_modulus)) {
          continue;
        }
        if (!(way.judged(design, axis).noise <= most_noise)) continue;
        const double area = fly(way.make(design), axis, 0).area;
        if (area < least && least_of(way, design, way.telemetry) >= least_modulus) {
          least = area;
          way.design = design;
        }
      }
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, "trades", "indi",
      trades::about("INDI or ADRC?",
                    "Incremental dynamic inversion is an observer of order 1 that is given "
                    "what the rotors do. Both at equal margins and noise, with the "
                    "rotors' speed measured and not."));
  {  // One and the same, while u is at its limits, too.
    const Design design{20, 100};
    auto other = as_observer(design);
    double apart = 0, largest = 0;
    const Law both = [&, indi = Indi(design)](double y, double r, double v, double) mutable {
      const double mine = indi.update(y, r, v);
      other.applied(v);
      const double its = other.update(y, design.controller * (r - y) / gain);
      apart = std::max(apart, std::abs(mine - its));
      largest = std::max(largest, std::abs(mine));
      return mine;
    };
    (void)fly(both, {}, 10 * gyro_noise);
    (void)fly(both, {1.3 * lag, 0.7 * gain, 5}, 400 * gyro_noise);
    report.expect("INDI by hand and as an observer", "largest difference of u", apart,
                  apart < 1e-11 && largest == 1.0, "below 1e-11, u at its limits among it");
  }

  const auto measured = [](const Design& d, const Axis& axis) { return judge_indi(d, axis, true); };
  const std::vector<double> drives{1, 1.5, 2, 3, 4, 6, 8};
  std::vector<Way> ways{
      {"INDI, speed measured", measured, run_indi},
      {"INDI, rotors driven", measured, run_indi, drives},
      {"INDI, rotors driven, speed 5 ms late", measured, run_indi, drives, 5},
      {"INDI, rotors modelled",
       [](const Design& d, const Axis& axis) { return judge_indi(d, axis, false); }, run_modelled},
      {"ADRC, knows the lag",
       [](const Design& d, const Axis& axis) { return judge(knowing(d), axis); },
       [](const Design& d) { return run(knowing(d)); }},
      {"ADRC, plain", [](const Design& d, const Axis& axis) { return judge(plain(d), axis); },
       [](const Design& d) { return run(plain(d)); }}};
  for (Way& way : ways) {
    choose(way);
    const Axis axis{lag, gain, way.telemetry};
    const auto area = [&](const Axis& real) { return fly(way.make(way.design), real, 0).area; };
    way.flight = fly(way.make(way.design), axis, 0);
    const auto row = [&](const char* metric, double value) {
      report.expect(way.name, metric, value, true, "reported");
    };
    row("omega_c (rad/s)", way.design.controller);
    row("omega_o or omega_f (rad/s)", way.design.observer);
    if (way.drives.size() > 1) row("rotors driven faster by", way.design.drive);
    const double sigma = way.judged(way.design, axis).noise;
    const double seen = fly(way.make(way.design), axis, gyro_noise).noise;
    report.expect(way.name, "noise in u (-)", sigma, sigma <= most_noise, "at most 0.03");
    // 1,500 samples of a slow loop tell little.
    report.expect(way.name, "the same, flown, over that", seen / sigma,
                  seen < 1.2 * sigma && seen > 0.6 * sigma, "0.6 to 1.2");
    const double least = least_of(way, way.design, way.telemetry);
    report.expect(way.name, "least modulus margin, b and lag 30 % off", least,
                  least >= least_modulus, "at least 0.5");
    row("largest deviation under the gust (rad/s)", way.flight.deviation);
    row("area under the gust (rad)", way.flight.area);
    row("the same, rotors 30 % slower", area({1.3 * lag, gain, way.telemetry}));
    row("the same, b 30 % smaller", area({lag, 0.7 * gain, way.telemetry}));
  }
  const auto over = [&](const char* name, int way, int other) {
    report.expect("area under the gust", name,
                  ways[static_cast<std::size_t>(way)].flight.area /
                      ways[static_cast<std::size_t>(other)].flight.area,
                  true, "reported");
  };
  over("ADRC that knows the lag over INDI, speed measured", 4, 0);
  over("ADRC that knows the lag over INDI, rotors modelled", 4, 3);
  over("ADRC that knows the lag over INDI, rotors driven", 4, 1);
  over("ADRC that knows the lag over the same, speed 5 ms late", 4, 2);
  const double unsafe = least_of(ways[1], ways[1].design, 5);
  report.expect("INDI, rotors driven", "least modulus margin, speed 5 ms late unknown to it",
                unsafe, unsafe < least_modulus, "below 0.5; below 0: not stable");

  Figure figure("indi", {.rows = 2, .columns = 1, .panel_height = 170});
  figure.caption("A gust from 0 s on, at equal margins and noise in u: the rate, and u.");
  const Color colors[] = {Color::orange, Color::blue, Color::sky, Color::vermillion, Color::green};
  auto& rate = figure.panel(0, 0).y_label("rate (rad/s)").hide_x_numbers().legend(Legend::above);
  auto& u = figure.panel(1, 0).x_label("t (s)").y_label("u (-)");
  for (std::size_t i = 0; i < 5; ++i) {
    const auto& flight = ways[i].flight;
    rate.line(Column(flight.t), flight.rate, {.name = ways[i].name, .color = colors[i]});
    u.line(Column(flight.t), flight.u, {.color = colors[i]});
  }
  report.add(figure);
  return report.finish();
}
