#include "from_log/parts/measured_sets.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include <esokit/eigen.hpp>

#include "common/log_file.hpp"
#include "common/measured_data.hpp"
#include "common/report.hpp"
#include "from_log/parts/log_observer.hpp"

namespace from_log {
namespace {

using esokit::examples::check_time;
using esokit::examples::LogFile;
using esokit::examples::measured_data;

using esokit::examples::Color;
using esokit::examples::CsvRow;
using esokit::examples::Dash;
using esokit::examples::Figure;
using esokit::examples::Legend;
using esokit::examples::number_text;
using esokit::examples::Report;
using esokit::examples::Tolerance;

/// Agreement of an estimate with a reference over samples [from, to).
struct Agreement {
  double correlation = 0;
  double rms_share = 0;  ///< RMS of the difference over RMS of the reference
};

Agreement compare(const std::vector<double>& estimate, const std::vector<double>& reference,
                  std::size_t from, std::size_t to) {
  double n = 0, a = 0, b = 0;
  for (std::size_t i = from; i < to; ++i) {
    a += estimate[i];
    b += reference[i];
    ++n;
  }
  a /= n;
  b /= n;
  double aa = 0, bb = 0, ab = 0, difference = 0, size = 0;
  for (std::size_t i = from; i < to; ++i) {
    aa += (estimate[i] - a) * (estimate[i] - a);
    bb += (reference[i] - b) * (reference[i] - b);
    ab += (estimate[i] - a) * (reference[i] - b);
    difference += (estimate[i] - reference[i]) * (estimate[i] - reference[i]);
    size += reference[i] * reference[i];
  }
  return {ab / std::sqrt(aa * bb), std::sqrt(difference / size)};
}

/// What the observer makes of a disturbance that is known: a plant of integrators without noise is
/// driven by it, and observed. So the observer's own lag is in both.
std::vector<double> through_observer(LogSettings settings, const std::vector<double>& disturbance) {
  const double T = settings.sample_time;
  std::vector<double> y;
  double x = 0, v = 0;
  for (const double d : disturbance) {
    y.push_back(x);
    if (settings.order == 2) {
      x += T * v + T * T / 2 * d;
      v += T * d;
    } else {
      x += T * d;
    }
  }
  settings.input_gain = 1;
  return run_observer(settings, {}, y, std::vector<double>(y.size(), 0.0)).columns.back();
}

std::vector<double> scaled(std::vector<double> values, double factor) {
  for (double& value : values) value *= factor;
  return values;
}

// ---- torque-controlled pendulum: the disturbance is gravity

void pendulum(Report& report) {
  constexpr double inertia = 0.1495;  // kg m2
  constexpr double gravity = 2.9970;  // m g l, Nm
  constexpr double omega = 40;        // rad/s
  struct Run {
    const char* name;
    const char* title;
    double sample_time, correlation, least_correlation, rms;
  };
  constexpr std::array runs = {
      Run{"ddp", "run ddp", 0.002, 0.992, 0.98, 0.19},
      Run{"direct_collocation", "run direct collocation", 0.003, 0.986, 0.97, 0.17}};
  Figure figure("pendulum", {.rows = 2, .columns = 1, .panel_height = 220});
  figure.caption(
      "Pendulum on a test bench: the disturbance torque that LinearEso<2> finds at omega_o = 40 "
      "rad/s from angle and motor torque, compared with the gravity torque -m g l sin(y) of the "
      "weighed parts, passed through the same observer. The difference is gear friction and a "
      "motor torque that is reported late.");
  std::size_t row = 0;
  std::vector<CsvRow> others;
  for (const Run& run : runs) {
    const auto file = measured_data() / "dfki_simple_pendulum" / (std::string(run.name) + ".csv");
    const LogFile log(file, {"t_s", "u_Nm", "y_rad"});
    check_time(log, log.column(0));
    LogSettings settings{
        .order = 2, .input_gain = 1 / inertia, .bandwidth = omega, .sample_time = run.sample_time};
    const auto estimates = run_observer(settings, log.column(0), log.column(2), log.column(1));
    std::vector<double> torque;
    for (const double angle : log.column(2)) torque.push_back(-gravity * std::sin(angle));
    const auto filtered = scaled(through_observer(settings, scaled(torque, 1 / inertia)), inertia);
    const auto found = scaled(estimates.columns.back(), inertia);
    const auto from = static_cast<std::size_t>(0.3 / run.sample_time);
    const Agreement ours = compare(found, filtered, from, found.size() - 5);
    const std::string name = "pendulum, " + std::string(run.name);
    report.check_reference(name, "correlation with gravity", run.correlation, ours.correlation,
                           Tolerance::absolute(0.002));
    report.expect(name, "correlation must be", ours.correlation,
                  ours.correlation >= run.least_correlation,
                  "at least " + number_text(run.least_correlation, 3));
    report.check_reference(name, "RMS of the rest (share)", run.rms, ours.rms_share,
                           Tolerance::absolute(0.01));
    report.expect(name, "RMS must be", ours.rms_share, ours.rms_share < 0.25, "below 25 %");
    for (const char* other :
         {"half-gain", "reduced", "cascade", "algebraic", "adjustable", "nonlinear"}) {
      settings.observer = other;
      const auto result = run_observer(settings, log.column(0), log.column(2), log.column(1));
      const auto same = scaled(through_observer(settings, scaled(torque, 1 / inertia)), inertia);
      const Agreement agreement =
          compare(scaled(result.columns.back(), inertia), same, from, found.size() - 5);
      others.push_back({run.name, other, number_text(agreement.correlation, 4),
                        number_text(100 * agreement.rms_share, 3)});
    }
    figure.panel(row++, 0)
        .title(run.title)
        .x_label("t (s)")
        .y_label("torque (Nm)")
        .legend(Legend::above)
        .name(run.name)
        .line(log.column(0), torque, {.name = "gravity", .color = Color::grey, .width = 1.0})
        .line(log.column(0), filtered,
              {.name = "gravity through the observer", .color = Color::blue, .dash = Dash::dashed})
        .line(log.column(0), found, {.name = "J d from the log", .color = Color::vermillion});
  }
  report.add(figure);
  report.table("pendulum_observers",
               "The other observers on the same logs with the same omega_o; each is compared with "
               "gravity passed through the same observer",
               {"run", "observer", "correlation", "RMS of the difference (%)"}, others);
}

// ---- double pendulum: known torque pulses are injected

void acrobot(Report& report) {
  constexpr double I1 = 0.031887199591513114, I2 = 0.05086984812807257, Ir = 6.287203962819607e-05;
  constexpr double m1 = 0.5234602302310271, m2 = 0.6255677234174437, l1 = 0.2, r1 = 0.2;
  constexpr double r2 = 0.25569305436052964, b = 0.001, g = 9.81, ratio = 6;
  constexpr std::array<double, 2> friction = {0.16, 0.12};
  constexpr double omega = 40, nominal = 0.002;
  LogSettings settings{
      .order = 2, .input_gain = 1, .bandwidth = omega, .sample_time = nominal, .tolerance = 0};
  std::array<std::vector<double>, 2> gains;
  Figure figure("acrobot", {.rows = 2, .columns = 1, .panel_height = 200});
  figure.caption(
      "Double pendulum, run 01: the torque that one observer per joint finds (the torque of the "
      "controller and an identified model are known to it, the injected pulses are not), and the "
      "pulses passed through the same observer. Unmodelled friction is about as large as the "
      "pulses, so only the mean over all pulses is meaningful.");
  for (const char* number : {"01", "04", "05"}) {
    const auto file =
        measured_data() / "dfki_acrobot_perturbed" / ("run" + std::string(number) + ".csv");
    const LogFile log(file, {"t_s", "u1_Nm", "u2_Nm", "y1_rad", "y2_rad", "v1_rad_s", "v2_rad_s",
                             "pert1_Nm", "pert2_Nm"});
    const auto& time = log.column(0);
    check_time(log, time);
    const std::size_t count = log.rows();
    std::array<std::vector<double>, 2> known;
    std::vector<std::array<double, 3>> mass;
    const double h = m2 * l1 * r2;
    for (std::size_t k = 0; k < count; ++k) {
      const double q1 = log.column(3)[k], q2 = log.column(4)[k];
      const double v1 = log.column(5)[k], v2 = log.column(6)[k];
      const double c2 = std::cos(q2), s2 = std::sin(q2);
      const double M11 = I1 + I2 + m2 * l1 * l1 + 2 * h * c2 + (ratio * ratio + 1) * Ir;
      const double M12 = I2 + h * c2 - ratio * Ir;
      const double M22 = I2 + ratio * ratio * Ir;
      const double determinant = M11 * M22 - M12 * M12;
      const double g2 = -m2 * g * r2 * std::sin(q1 + q2);
      const double g1 = -(m1 * r1 + m2 * l1) * g * std::sin(q1) + g2;
      const double torque1 = log.column(1)[k] + g1 + 2 * h * s2 * v1 * v2 + h * s2 * v2 * v2 -
                             b * v1 - friction[0] * std::atan(100 * v1);
      const double torque2 =
          log.column(2)[k] + g2 - h * s2 * v1 * v1 - b * v2 - friction[1] * std::atan(100 * v2);
      known[0].push_back((M22 * torque1 - M12 * torque2) / determinant);
      known[1].push_back((M11 * torque2 - M12 * torque1) / determinant);
      mass.push_back({M11, M12, M22});
    }
    const auto d1 = run_observer(settings, time, log.column(3), known[0]).columns[2];
    const auto d2 = run_observer(settings, time, log.column(4), known[1]).columns[2];
    for (std::size_t joint = 0; joint < 2; ++joint) {
      std::vector<double> torque;
      for (std::size_t k = 0; k < count; ++k) {
        torque.push_back(mass[k][joint] * d1[k] + mass[k][joint + 1] * d2[k]);
      }
      const auto& pulses = log.column(7 + joint);
      const auto filtered = through_observer(settings, pulses);
      if (std::string(number) == "01") {
        figure.panel(joint, 0)
            .title("joint " + std::to_string(joint + 1))
            .x_label("t (s)")
            .y_label("torque (Nm)")
            .legend(Legend::above)
            .name("joint" + std::to_string(joint + 1))
            .line(time, torque, {.name = "found", .color = Color::vermillion, .width = 1.1})
            .line(time, filtered,
                  {.name = "injected pulses through the observer", .color = Color::blue});
      }
      // The two largest pulses, each with its neighbourhood, by least squares on (pulse, 1, k).
      std::vector<bool> used(count, false);
      for (int pulse = 0; pulse < 2; ++pulse) {
        std::size_t at = 0;
        double largest = 0;
        for (std::size_t k = 0; k < count; ++k) {
          if (!used[k] && std::abs(pulses[k]) > largest) {
            largest = std::abs(pulses[k]);
            at = k;
          }
        }
        const std::size_t from = at > 150 ? at - 150 : 0;
        const std::size_t to = std::min(at + 150, count);
        for (std::size_t k = from; k < to; ++k) used[k] = true;
        if (largest < 0.2 || at < 100 || at + 150 > count) continue;
        esokit::EigenMatrix<double, 3, 3> normal = esokit::EigenMatrix<double, 3, 3>::Zero();
        esokit::EigenMatrix<double, 3> right = esokit::EigenMatrix<double, 3>::Zero();
        for (std::size_t k = from; k < to; ++k) {
          const esokit::EigenMatrix<double, 3> line(filtered[k], 1,
                                                    static_cast<double>(k - from) / 300);
          normal += line * line.transpose();
          right += line * torque[k];
        }
        gains[joint].push_back(normal.inverse().eval().row(0).dot(right));
      }
    }
  }
  constexpr std::array<double, 2> independent = {0.783, 0.876};
  for (std::size_t joint = 0; joint < 2; ++joint) {
    const auto pulses = esokit::examples::statistics(gains[joint]);
    const std::string name = "double pendulum, joint " + std::to_string(joint + 1);
    report.check_reference(name, "mean gain of the pulses", independent[joint], pulses,
                           Tolerance::absolute(0.01));
    const double seen = pulses.mean / pulses.standard_error;
    report.expect(name, "mean gain, in its standard errors", seen, seen > 3,
                  "above 3: the pulses are seen");
    const double off = (pulses.mean - 1) / pulses.standard_error;
    report.expect(name, "mean gain minus 1, in its standard errors", off, std::abs(off) < 2,
                  "within 2: the gain is right");
  }
  report.add(figure);
}

// ---- temperature control lab: a heater is withheld from the observer

void tclab(Report& report) {
  const auto file = measured_data() / "tclab_energy_balance" / "tclab.csv";
  const LogFile log(file, {"t_s", "Q1_pct", "Q2_pct", "T1_degC", "T2_degC"});
  check_time(log, log.column(0));
  constexpr double area = 10e-4, facing = 2e-4, emissivity = 0.9, sigma = 5.67e-8, zero = 273.15;
  constexpr double capacity = 2;  // m c_p, J/K
  const LogSettings settings{
      .order = 1, .input_gain = 1, .bandwidth = 0.05, .sample_time = 1, .tolerance = 1};
  struct Parameters {
    const char* name;
    double U, alpha1, alpha2, ambient, lag;
    std::array<double, 4> correlation, rms;  // heater withheld T1, T2; loss T1, T2
  };
  constexpr std::array sets = {Parameters{"source's initial guess",
                                          10,
                                          0.01,
                                          0.0075,
                                          23,
                                          0,
                                          {0.978, 0.859, 0.154, 0.860},
                                          {0.46, 0.68, 0.51, 1.00}},
                               Parameters{"fitted on this record",
                                          5.0005,
                                          6.403e-3,
                                          3.254e-3,
                                          23.468,
                                          16.38,
                                          {0.997, 0.932, 0.984, 0.969},
                                          {0.072, 0.27, 0.067, 0.20}}};
  Figure figure("tclab", {.rows = 2, .columns = 1, .panel_height = 200});
  figure.caption(
      "Temperature control lab, LinearEso<1> at 0.05 rad/s, parameters fitted to this same record "
      "(so this shows consistency; it is not a prediction). Top: the heater is unknown to the "
      "observer, which finds heating and loss together. Bottom: the heater is known, and the "
      "observer finds the loss.");
  for (const Parameters& p : sets) {
    for (std::size_t i = 0; i < 2; ++i) {
      const auto& own = log.column(3 + i);
      const auto& other = log.column(4 - i);
      std::vector<double> loss, heat;
      double lagged = 0;
      for (std::size_t k = 0; k < own.size(); ++k) {
        const double a = own[k] + zero, o = other[k] + zero, c = p.ambient + zero;
        loss.push_back((p.U * area * (c - a) +
                        emissivity * sigma * area * (std::pow(c, 4) - std::pow(a, 4)) +
                        p.U * facing * (o - a) +
                        emissivity * sigma * facing * (std::pow(o, 4) - std::pow(a, 4))) /
                       capacity);
        const double now = (i == 0 ? p.alpha1 : p.alpha2) * log.column(1 + i)[k] / capacity;
        // The sensor lags the heater; one sample late, as in the independent run.
        heat.push_back(p.lag > 0 ? lagged : now);
        if (p.lag > 0) lagged += (1 - std::exp(-1 / p.lag)) * (now - lagged);
      }
      std::vector<double> both;
      for (std::size_t k = 0; k < own.size(); ++k) both.push_back(heat[k] + loss[k]);
      const std::vector<double> nothing(own.size(), 0.0);
      for (const bool told : {false, true}) {
        const auto found = run_observer(settings, {}, own, told ? heat : nothing).columns.back();
        const auto expected = through_observer(settings, told ? loss : both);
        const Agreement ours = compare(found, expected, 60, own.size() - 2);
        const std::size_t column = i + (told ? 2 : 0);
        const std::string name = "TCLab T" + std::to_string(i + 1) + ", " + p.name +
                                 (told ? ", heater known" : ", heater withheld");
        report.check_reference(name, "correlation", p.correlation[column], ours.correlation,
                               Tolerance::absolute(0.002));
        report.check_reference(name, "RMS of the rest (share)", p.rms[column], ours.rms_share,
                               Tolerance::absolute(p.rms[column] > 0.1 ? 0.006 : 0.0006));
        if (p.lag > 0 && i == 0) {
          figure.panel(told ? 1 : 0, 0)
              .x_label("t (s)")
              .y_label(told ? "loss T1 (°C/s)" : "heat and loss T1 (°C/s)")
              .legend(Legend::above)
              .name(told ? "loss" : "heat")
              .line(log.column(0), found, {.name = "found", .color = Color::vermillion})
              .line(log.column(0), expected,
                    {.name = "energy balance through the observer",
                     .color = Color::blue,
                     .dash = Dash::dashed});
        }
      }
    }
  }
  report.add(figure);
}

}  // namespace

void measured_sets(Report& report) {
  pendulum(report);
  acrobot(report);
  tclab(report);
}

}  // namespace from_log
