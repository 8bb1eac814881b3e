// Where switching between two bandwidths is safe: the certificate, and switchings that make the
// error grow below it.
//
// S. Zhang, X. Qi, S. Yang, "An extended state observer with adjustable bandwidth for measurement
// noise", Journal of Systems Engineering and Electronics (2023), doi:10.23919/JSEE.2023.000166,
// Lemmas 1 and 2.
//
// Way: continuous observers, exact matrix exponentials; the limits also for sampled gain sets.
//
// Lemma 2 claims a common quadratic Lyapunov function for every rho. By its own (9) it exists only
// for 1/3 < rho < 3 (N = 3); for N poles in one place the limit is tan^2(pi (N-1) / (4N)).
//
// symbol      code                 value                unit
// N           order + extension    2..8                 -
// rho         ratio                0..1                 -
// w           bandwidth            1                    rad/s
// t_1, t_2    dwell                0.05..60             s, time in each mode

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/eigen.hpp>
#include <esokit/gain/certificate/continuous_certificate.hpp>
#include <esokit/gain/certificate/switching_certificate.hpp>
#include <esokit/gain/continuous_gain.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>

#include "common/parallel.hpp"
#include "common/report.hpp"
#include "paper3_abeso/paper3.hpp"

using namespace esokit::examples;
using namespace paper3;
using esokit::EigenMatrix;
using esokit::EqualSampledPoles;
using esokit::SwitchingRule;

namespace {

/// A - l C with all poles at -bandwidth.
template <int N>
EigenMatrix<double, N, N> error_matrix(double bandwidth) {
  EigenMatrix<double, N, N> a = esokit::IntegratorChain<N - 1>::state_matrix();
  a.col(0) -= eigen(esokit::continuous_gain<N, double>(bandwidth));
  return a;
}

/// exp(A t) where A + w I is nilpotent: a finite sum.
template <int N>
EigenMatrix<double, N, N> transition(double bandwidth, double t) {
  using Square = EigenMatrix<double, N, N>;
  const Square nilpotent = (error_matrix<N>(bandwidth) + bandwidth * Square::Identity()) * t;
  Square term = Square::Identity();
  Square sum = term;
  for (int i = 1; i < N; ++i) {
    term = term * nilpotent / i;
    sum += term;
  }
  return std::exp(-bandwidth * t) * sum;
}

struct Switching {
  double growth = -1e9;  // of the error, 1/s, for w = 1
  double fast = 0.0;     // time at w, s
  double slow = 0.0;     // time at rho w, s
};

/// The periodic switching with one dwell time for each mode under which the error grows most.
template <int N>
Switching worst_switching(double ratio) {
  constexpr std::size_t nodes = 60;
  std::array<double, nodes> dwell{};
  std::vector<EigenMatrix<double, N, N>> fast, slow;
  for (std::size_t i = 0; i < nodes; ++i) {
    dwell[i] = 0.05 * std::pow(60.0 / 0.05, static_cast<double>(i) / (nodes - 1));
    fast.push_back(transition<N>(1.0, dwell[i]));
    slow.push_back(transition<N>(ratio, dwell[i]));
  }
  Switching worst;
  for (std::size_t i = 0; i < nodes; ++i) {
    for (std::size_t j = 0; j < nodes; ++j) {
      esokit::LinearSystem<N, 1, 1> period;
      period.a = slow[j] * fast[i];
      const double radius = esokit::poles(period).cwiseAbs().maxCoeff();
      const double growth = std::log(radius) / (dwell[i] + dwell[j]);
      if (growth > worst.growth) worst = {growth, dwell[i], dwell[j]};
    }
  }
  return worst;
}

/// Least rho > 0 for which `holds` is true from there up to 1.
template <class Holds>
double least_ratio(Holds holds, int steps) {
  double low = 1e-3;
  double high = 1.0;
  for (int i = 0; i < steps; ++i) {
    const double middle = 0.5 * (low + high);
    (holds(middle) ? high : low) = middle;
  }
  return high;
}

struct Limits {
  double closed = 0.0;              // tan^2
  double test = 0.0;                // by the general test, continuous
  double beso = 0.0;                // for the BESO
  double unstable = 0.0;            // largest rho at which a periodic switching was found to grow
  std::array<double, 3> sampled{};  // by the general test, omega T = 0.1, 1, 3
  std::array<double, 3> sampled_closed{};  // tanh form
};
constexpr std::array<double, 3> omega_times = {0.1, 1.0, 3.0};

template <int N>
Limits limits() {
  Limits result;
  result.closed = std::pow(std::tan(std::numbers::pi * (N - 1) / (4.0 * N)), 2);
  result.test = least_ratio(
      [](double rho) {
        return esokit::switching_certified<N, double>(esokit::continuous_gain<N, double>(1.0),
                                                      esokit::continuous_gain<N, double>(rho));
      },
      60);
  result.beso = esokit::certified_ratio_limit<N>(SwitchingRule::beso, 1.0, 0.1, 0.0);
  result.unstable =
      least_ratio([](double rho) { return worst_switching<N>(rho).growth < 0.0; }, 12);
  for (std::size_t i = 0; i < omega_times.size(); ++i) {
    const double x = omega_times[i];
    const auto gain = [x](double rho) {
      return esokit::current_gain<N, double>(
          EqualSampledPoles<N, double>::from_bandwidth(x * rho, 1.0).weights());
    };
    result.sampled[i] = least_ratio(
        [&](double rho) { return esokit::switching_certified<N, double>(gain(1.0), gain(rho)); },
        60);
    result.sampled_closed[i] = 2.0 * std::atanh(result.closed * std::tanh(x / 2.0)) / x;
  }
  return result;
}

Limits limits_for(std::size_t n) {
  switch (n) {
    case 2:
      return limits<2>();
    case 3:
      return limits<3>();
    case 4:
      return limits<4>();
    case 5:
      return limits<5>();
    case 6:
      return limits<6>();
    case 7:
      return limits<7>();
    default:
      return limits<8>();
  }
}

/// The norm of the error over time under a periodic switching, N = 3.
Curve trajectory(double ratio, const Switching& switching, double duration) {
  constexpr double step = 0.02;
  const auto fast = transition<3>(1.0, step);
  const auto slow = transition<3>(ratio, step);
  EigenMatrix<double, 3> e(1.0, 0.0, 0.0);
  Curve curve;
  for (double t = 0.0; t < duration; t += step) {
    curve.add(t, e.norm());
    const double phase = std::fmod(t, switching.fast + switching.slow);
    e = (phase < switching.fast ? fast : slow) * e;
  }
  return curve;
}

/// The observer's own switching, without noise: y = 0, z(0) = (1, 0, 0).
Curve own_switching(double ratio, double duration) {
  constexpr double step = 0.02;
  auto observer = esokit::AdjustableBandwidthEso<2>::make({.observer_bandwidth = 1.0,
                                                           .bandwidth_ratio = ratio,
                                                           .allow_uncertified_switching = true,
                                                           .input_gain = 1.0,
                                                           .sample_time = step})
                      .value();
  (void)observer.reset(EigenMatrix<double, 3>(1.0, 0.0, 0.0));
  Curve curve;
  for (double t = 0.0; t < duration; t += step) {
    curve.add(t, eigen(observer.estimate()).norm());
    (void)observer.update(0.0, 0.0);
  }
  return curve;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "stability",
                about("Is the switching stable? (Lemmas 1 and 2)",
                      "For which ratios of the two bandwidths the error decays under any "
                      "switching, and a switching under which it grows. Continuous observers, "
                      "nothing is simulated; the limits also for sampled observers.",
                      2));

  constexpr std::size_t sizes = 7;
  const auto found =
      run_parallel("limits", sizes, [](std::size_t i) { return limits_for(sizes + 1 - i); });
  std::vector<double> n, certified, unstable;
  std::vector<CsvRow> lines;
  for (std::size_t i = 0; i < sizes; ++i) {
    const Limits& l = found[sizes - 1 - i];
    const std::string name = "N = " + std::to_string(i + 2);
    n.push_back(static_cast<double>(i + 2));
    certified.push_back(l.closed);
    unstable.push_back(l.unstable);
    report.check_reference(name, "least certified rho, continuous", l.closed, l.test,
                           Tolerance::absolute(1e-9), "tan^2(pi (N-1) / (4N))");
    CsvRow line{std::to_string(i + 2), number_text(l.closed, 4), number_text(l.test, 4),
                number_text(l.beso, 4), number_text(l.unstable, 3)};
    for (std::size_t k = 0; k < omega_times.size(); ++k) {
      report.check_reference(name, "least certified rho, w T = " + number_text(omega_times[k], 2),
                             l.sampled_closed[k], l.sampled[k], Tolerance::absolute(1e-9),
                             "tanh(rho w T/2) / tanh(w T/2) at the limit");
      line.push_back(number_text(l.sampled[k], 4));
    }
    report.expect(name, "largest rho with a growing periodic switching", l.unstable,
                  l.unstable < l.closed, "below the certificate's limit");
    lines.push_back(line);
  }
  report.table(
      "limits",
      "Smallest rho with a common quadratic Lyapunov function, by the closed form and by the "
      "general test on the gain sets, and the same for the BESO (its two bandwidths differ by "
      "rho^2). The largest rho for which a periodic switching was found that makes the error grow. "
      "The limits for sampled observers",
      {"N", "closed form", "test", "BESO", "grows from", "w T = 0.1", "w T = 1", "w T = 3"}, lines);

  const Switching bad = worst_switching<3>(0.2);
  const Switching fair = worst_switching<3>(0.7);
  report.check_reference("N = 3, rho = 0.2", "growth (units of w)", 0.048, bad.growth,
                         Tolerance::absolute(0.002));
  report.expect("N = 3, rho = 0.7", "growth (units of w)", fair.growth, fair.growth < 0.0,
                "no switching found that grows");
  report.remark(
      "Below the first limit no common quadratic Lyapunov function exists. Below the second there "
      "are periodic switchings that make the error grow. Between the two neither is proven.");
  report.remark(
      "With the switching rule of the observer the error decayed in every noise-free trial, but "
      "noise may make the rule switch in any way. AdjustableBandwidthEso refuses a ratio below the "
      "first limit unless allow_uncertified_switching is set.");
  report.claim({.text = "The switched system is quadratically stable for every rho > 0.",
                .where = "Lemma 2",
                .holds = bad.growth > 0.0 ? Claim::Holds::no : Claim::Holds::not_tested,
                .here = "At rho = 0.2, N = 3, the error grows at " + shown_text(bad.growth, 0.048) +
                        " w under a periodic switching. It holds for 1/3 < rho < 3, which includes "
                        "the 0.7 of the paper.",
                .figure = "stability"});
  report.claim(
      {.text = "The error converges to a bound in finite time.",
       .where = "Theorem 1",
       .holds = bad.growth > 0.0 && fair.growth < 0.0 ? Claim::Holds::partly : Claim::Holds::no,
       .here = "Where the two modes share a matrix P, that is, for 1/3 < rho < 3: the "
               "proof takes P from Lemma 2.",
       .figure = "stability"});
  // delta-bar of (13).
  const auto delta_bar = [](double delta) {
    const double square = delta * delta;
    return 9.0 * square + 9.0 * square * square + square * square * square;
  };
  report.claim(
      {.text = "For rho < 1 the bound (21) shows the ABESO to be more accurate than the LESO.",
       .where = "abstract; Remark 2",
       .holds = delta_bar(0.7) < 1.0 ? Claim::Holds::not_tested : Claim::Holds::no,
       .here = "It rests on delta-bar < 1, but delta-bar is " + number_text(delta_bar(0.7), 2) +
               " at 0.7 and " + number_text(delta_bar(1.0), 2) +
               " at 1, which the ABESO uses, too; so its bound is not smaller.",
       .figure = "limits"});
  report.correction({.where = "Remark 2",
                     .printed = "delta-bar < 1 for rho < 1",
                     .correct = "delta-bar = 9 delta^2 + 9 delta^4 + delta^6, " +
                                number_text(delta_bar(1.0), 2) + " at delta = 1",
                     .why = "from its definition under (13), which also lacks a square root"});
  report.correction(
      {.where = "(9), Lemma 2",
       .printed = "factors of F from which a common Lyapunov function follows for every rho",
       .correct = "(x - w^2 rho)(x^2 + w^2 (3 rho^2 - 8 rho + 3) x + w^4 rho^2)",
       .why = "(9) itself has these factors; two of its roots are negative for rho < 1/3, so that "
              "no common Lyapunov function exists there"});
  report.correction({.where = "(7), (11)",
                     .printed = "third entry with -d(t, x)",
                     .correct = "-d'",
                     .why = "the third state is d, so its error is driven by the derivative of d"});
  Figure figure("stability", {.rows = 2, .columns = 2, .panel_height = 220});
  figure.caption(
      "Top left: smallest rho that is proven stable, and the largest rho for which a periodic "
      "switching was found that makes the error grow, over N. Top right: growth under the worst "
      "periodic switching over rho, N = 3. Bottom left: the error under the worst periodic "
      "switchings at rho = 0.2 and 0.7 and under the switching rule of the observer. Bottom right: "
      "the limit for the sampled observer.");
  std::vector<double> floor(sizes, 0.0);
  std::vector<double> one(sizes, 1.0);
  figure.panel(0, 0)
      .x_label("N")
      .y_label("ρ (-)")
      .name("limits")
      .x_tick(1.0)
      .y_range(0.0, 1.0)
      .legend(Legend::above)
      .band(n, certified, one, {.color = Color::green, .opacity = 0.15})
      .band(n, floor, unstable, {.color = Color::vermillion, .opacity = 0.15})
      .line(n, certified, {.name = "certified above", .color = Color::green})
      .points(n, certified, {.color = Color::green, .marker = Marker::circle})
      .line(n, unstable, {.name = "grows below", .color = Color::vermillion})
      .points(n, unstable, {.color = Color::vermillion, .marker = Marker::circle});
  constexpr std::size_t ratios = 46;
  std::vector<double> ratio_axis;
  for (std::size_t i = 0; i < ratios; ++i) {
    ratio_axis.push_back(0.1 + 0.9 * static_cast<double>(i) / (ratios - 1));
  }
  const auto growth = run_parallel(
      "growth", ratios, [&](std::size_t i) { return worst_switching<3>(ratio_axis[i]).growth; });
  figure.panel(0, 1)
      .x_label("ρ (-)")
      .y_label("growth / w (-)")
      .name("growth")
      .legend(Legend::none)
      .horizontal_line(0.0)
      .vertical_line(1.0 / 3.0, {.color = Color::green, .dash = Dash::dashed})
      .line(ratio_axis, growth, {.name = "worst periodic switching", .color = Color::blue})
      .note(0.35, -0.85, "certified from 1/3 on");
  figure.panel(1, 0)
      .x_label("w t (-)")
      .y_label("norm of the error (-)")
      .name("trajectories")
      .log_y()
      .y_range(1e-8, 1e4)
      .legend(Legend::above)
      .line(trajectory(0.2, bad, 120.0),
            {.name = "ρ = 0.2, worst", .color = Color::vermillion, .width = 1.2})
      .line(own_switching(0.2, 120.0), {.name = "ρ = 0.2, own rule", .color = Color::orange})
      .line(trajectory(0.7, fair, 120.0), {.name = "ρ = 0.7, worst", .color = Color::blue});
  auto& sampled = figure.panel(1, 1)
                      .x_label("w T (-)")
                      .y_label("least certified ρ (-)")
                      .name("sampled")
                      .log_x()
                      .y_range(0.0, 0.8)
                      .legend(Legend::above);
  const auto limit_curve = [&](auto size, Color color) {
    constexpr int N = decltype(size)::value;
    Curve curve;
    for (double x = 0.01; x < 30.0; x *= 1.05) {
      curve.add(x, esokit::certified_ratio_limit<N>(SwitchingRule::abeso, x, 0.5, 1.0));
    }
    sampled.line(curve, {.name = "N = " + std::to_string(N), .color = color});
  };
  limit_curve(std::integral_constant<int, 2>{}, Color::blue);
  limit_curve(std::integral_constant<int, 3>{}, Color::vermillion);
  limit_curve(std::integral_constant<int, 4>{}, Color::green);
  limit_curve(std::integral_constant<int, 6>{}, Color::purple);
  report.add(figure);
  return report.finish();
}
