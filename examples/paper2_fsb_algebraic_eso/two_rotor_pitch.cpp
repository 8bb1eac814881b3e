// Figures 14 to 17: pitch of a two-rotor rig, observers only. A stand-in: the measured data of the
// paper are not published, so Eq. (61) is simulated.
//
// J. Kasac, A. Pender, M. Pranjic, D. Kotarski, "Frequency-shifting-based algebraic approach to
// extended state observer design", Asian Journal of Control 23 (2021) 2171-2184,
// doi:10.1002/asjc.2516, section 6.
//
// Way: continuous simulation. Plant and both observers are ODEs, RK4 at 1 ms.
//
// Plant      J th'' = -m1 d1 g cos th + u,  y = th                                       (61)
// Input      u = m1 d1 g cos th - J (kp th + kd th'), the same for both observers and known to
//            them: the true states bring the rig to th = 0, so that the observers see one motion
// Observers  of y'' = d + b0 u, b0 = 1 / J, d = -m1 d1 g cos th / J:
//            LESO, all poles at -omega_o;  FSB, Eqs. (35)-(51), estimates zero for t < epsilon
//
// symbol      code         value          unit
// m1          mass         0.12           kg
// d1          arm          0.16           m
// J           inertia      0.02           kg m^2, our assumption
// th(0)       start        -0.58          rad
// omega_o     bandwidth    8              rad/s, of the LESO
// lambda      bandwidth    8              rad/s, of the FSB observer
// q           q            0.2            rad/s
// epsilon     epsilon      0.1            s
// kp, kd      omega_c      1, 2           1/s^2, 1/s, our assumption
//
// References are those of an independent simulation of the same stand-in, of whose input only the
// results are known.

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/runge_kutta.hpp>
#include <string>
#include <vector>

#include "common/report.hpp"
#include "paper2_fsb_algebraic_eso/paper2.hpp"

using namespace esokit::examples;
using namespace paper2;
namespace sim = esokit::sim;

namespace {

constexpr double mass = 0.12;      // kg
constexpr double arm = 0.16;       // m
constexpr double gravity = 9.81;   // m/s^2
constexpr double inertia = 0.02;   // kg m^2
constexpr double start = -0.58;    // rad
constexpr double bandwidth = 8.0;  // rad/s
constexpr double q = 0.2;          // rad/s
constexpr double epsilon = 0.1;    // s
constexpr double omega_c = 1.0;    // rad/s
constexpr double step = 1e-3;      // s
constexpr double duration = 10.0;  // s

double weight_torque(double angle) { return mass * arm * gravity * std::cos(angle); }

double input(const EigenMatrix<double, 2>& x) {
  return weight_torque(x(0)) - inertia * (omega_c * omega_c * x(0) + 2.0 * omega_c * x(1));
}

double disturbance(const EigenMatrix<double, 2>& x) { return -weight_torque(x(0)) / inertia; }

struct Run {
  double velocity_error = 0.0;     ///< largest, rad/s; of the FSB observer from epsilon on
  double disturbance_error = 0.0;  ///< largest, rad/s^2
  std::vector<double> t, angle, velocity, d, u, angle_estimate, velocity_estimate, d_estimate,
      velocity_difference, d_difference;
};

template <class Observer>
Run run(const Observer& observer, double from) {
  using State = EigenMatrix<double, 2 + Observer::states>;
  Run result;
  State s = State::Zero();
  s(0) = start;
  const auto rate = [&](double t, const State& state) -> State {
    const EigenMatrix<double, 2> x = state.template head<2>();
    const typename Observer::State z = state.template tail<Observer::states>();
    const double u = input(x);
    State change;
    const esokit::EigenMatrix<double, Observer::states> estimate_rate =
        observer.derivative(t, z, x(0), u);
    change << x(1), disturbance(x) + u / inertia, estimate_rate;
    return change;
  };
  const auto steps = static_cast<int>(std::lround(duration / step));
  for (int k = 0; k <= steps; ++k) {
    const double t = k * step;
    const EigenMatrix<double, 2> x = s.template head<2>();
    const typename Observer::State inner = s.template tail<Observer::states>();
    const auto z = observer.estimate(inner);
    if (t >= from - 1e-9) {
      result.velocity_error = std::max(result.velocity_error, std::abs(x(1) - z(1)));
      result.disturbance_error =
          std::max(result.disturbance_error, std::abs(disturbance(x) - z(2)));
    }
    result.t.push_back(t);
    result.angle.push_back(x(0));
    result.velocity.push_back(x(1));
    result.d.push_back(disturbance(x));
    result.u.push_back(input(x));
    result.angle_estimate.push_back(z(0));
    result.velocity_estimate.push_back(z(1));
    result.d_estimate.push_back(z(2));
    result.velocity_difference.push_back(x(1) - z(1));
    result.d_difference.push_back(disturbance(x) - z(2));
    s = sim::step(rate, t, s, step);
  }
  return result;
}

/// Whole time at the left, the first second at the right.
struct Drawing {
  static constexpr double shown_start = 1.0;  // s
  Figure figure;
  Drawing(const std::string& name, const std::string& caption, const std::string& label)
      : figure(name, {.rows = 1, .columns = 2, .panel_height = 260}) {
    figure.caption(caption + " Simulated, in place of the measurement of the paper.");
    figure.panel(0, 0).x_label("t (s)").y_label(label).x_range(0.0, duration).name("whole");
    figure.panel(0, 1).x_label("t (s)").x_range(0.0, shown_start).name("start");
    for (std::size_t c = 0; c < 2; ++c) figure.panel(0, c).legend(Legend::above);
  }
  Drawing& line(const std::vector<double>& t, const std::vector<double>& y, const Style& style) {
    const auto few = std::upper_bound(t.begin(), t.end(), shown_start) - t.begin();
    figure.panel(0, 0).line(t, y, style);
    figure.panel(0, 1).line(std::vector<double>(t.begin(), t.begin() + few),
                            std::vector<double>(y.begin(), y.begin() + few), style);
    return *this;
  }
};

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "two_rotor_pitch",
                about("Two-rotor pitch rig (Figs 14-17), simulated",
                      "Both observers on a simulated motion of Eq. (61), because the measurement "
                      "of the paper is not published. Continuous simulation, RK4 at 1 ms.",
                      3));
  report.not_reproduced(
      "Figs 14 to 17 show a measurement that is not published. Here Eq. (61) is simulated with an "
      "inertia (0.02 kg m^2) and an input of our choice. The behaviour of the observers can be "
      "compared with the paper, the curves cannot.",
      Miss::not_published);
  const Run linear = run(linear_observer<2>(bandwidth, 1.0 / inertia), 0.0);
  const Run shifted = run(BlankedFilter<2>(bandwidth, q, 1.0 / inertia, epsilon), epsilon);
  const std::string source = "independent run";
  report.check_reference("LESO", "max velocity error (rad/s)", 3.15, linear.velocity_error, 0.005,
                         source);
  report.check_reference("LESO", "max disturbance error (rad/s^2)", 7.88, linear.disturbance_error,
                         0.005, source);
  report.check_reference("FSB, from epsilon on", "max velocity error (rad/s)", 0.021,
                         shifted.velocity_error, 0.1, source + " with an input that is not known");
  report.check_reference("FSB, from epsilon on", "max disturbance error (rad/s^2)", 0.24,
                         shifted.disturbance_error, 0.1,
                         source + " with an input that is not known");
  double apart = 0.0;
  for (std::size_t k = 0; k < linear.t.size(); ++k) {
    if (linear.t[k] < 5.0) continue;
    apart = std::max({apart, std::abs(linear.angle_estimate[k] - shifted.angle_estimate[k]),
                      std::abs(linear.velocity_estimate[k] - shifted.velocity_estimate[k]),
                      std::abs(linear.d_estimate[k] - shifted.d_estimate[k])});
  }
  report.expect("LESO and FSB", "largest difference of an estimate after 5 s", apart, apart < 1e-3,
                "below 1e-3, a thousandth of the first second's; independent run with another "
                "input: 6e-05");

  const Style truth{.name = "true", .color = Color::black, .dash = Dash::dashed};
  const Style leso{.name = "LESO", .color = Color::vermillion};
  const Style fsb{.name = "FSB", .color = Color::blue};
  const auto& t = linear.t;
  Figure measured("fig14", {.rows = 1, .columns = 2, .panel_height = 260});
  measured.caption(
      "Fig 14: what the observers get, pitch angle and control torque. Simulated, in place of the "
      "measurement of the paper.");
  measured.panel(0, 0)
      .x_label("t (s)")
      .y_label("angle (rad)")
      .x_range(0.0, duration)
      .name("angle")
      .line(t, linear.angle, {.color = Color::black, .column = "angle"});
  measured.panel(0, 1)
      .x_label("t (s)")
      .y_label("u (N m)")
      .x_range(0.0, duration)
      .name("torque")
      .line(t, linear.u, {.color = Color::black, .column = "torque"});
  report.add(measured);
  report.add(Drawing("fig15", "Fig 15: estimates of the pitch angle.", "angle (rad)")
                 .line(t, linear.angle_estimate, leso)
                 .line(t, shifted.angle_estimate, fsb)
                 .line(t, linear.angle, truth)
                 .figure);
  report.add(Drawing("fig16",
                     "Fig 16: estimates of the angular velocity. The FSB estimate is zero until "
                     "epsilon = 0.1 s; the linear one peaks.",
                     "velocity (rad/s)")
                 .line(t, linear.velocity_estimate, leso)
                 .line(t, shifted.velocity_estimate, fsb)
                 .line(t, linear.velocity, truth)
                 .figure);
  report.add(
      Drawing("fig17", "Fig 17: estimates of the total disturbance.", "disturbance (rad/s^2)")
          .line(t, linear.d_estimate, leso)
          .line(t, shifted.d_estimate, fsb)
          .line(t, linear.d, truth)
          .figure);
  report.claim(
      {.text = "The linear observer starts with a large error of velocity and disturbance, "
               "the algebraic one does not peak.",
       .where = "6, Figs 16, 17",
       .holds = shifted.velocity_error < 0.1 * linear.velocity_error &&
                        shifted.disturbance_error < 0.1 * linear.disturbance_error
                    ? Claim::Holds::yes
                    : Claim::Holds::no,
       .here = "In our simulation the largest errors are " + number_text(linear.velocity_error, 3) +
               " rad/s and " + number_text(linear.disturbance_error, 3) +
               " rad/s^2 with the linear, " + number_text(shifted.velocity_error, 2) + " and " +
               number_text(shifted.disturbance_error, 2) +
               " with the algebraic observer from epsilon on.",
       .figure = "fig17"});
  report.claim(
      {.text = "Later both observers give the same, as for lambda = omega_o they become "
               "equal.",
       .where = "6; 4.1",
       .holds = apart < 1e-3 ? Claim::Holds::yes : Claim::Holds::no,
       .here = "After 5 s their estimates differ by " + number_text(apart, 1) + " at most.",
       .figure = "errors"});
  report.additions();
  Figure errors("errors", {.rows = 1, .columns = 2, .panel_height = 260});
  errors.caption(
      "Errors of the velocity and of the disturbance estimate on logarithmic axes, simulated.");
  const auto magnitude = [](const std::vector<double>& values) {
    std::vector<double> result;
    for (const double value : values) result.push_back(std::max(std::abs(value), 1e-9));
    return result;
  };
  errors.panel(0, 0)
      .x_label("t (s)")
      .y_label("|velocity error| (rad/s)")
      .x_range(0.0, duration)
      .log_y()
      .y_range(1e-6, 10.0)
      .name("velocity")
      .line(t, magnitude(linear.velocity_difference), leso)
      .line(t, magnitude(shifted.velocity_difference), fsb);
  errors.panel(0, 1)
      .x_label("t (s)")
      .y_label("|disturbance error| (rad/s^2)")
      .x_range(0.0, duration)
      .log_y()
      .y_range(1e-5, 10.0)
      .name("disturbance")
      .line(t, magnitude(linear.d_difference), leso)
      .line(t, magnitude(shifted.d_difference), fsb);
  report.add(errors);
  return report.finish();
}
