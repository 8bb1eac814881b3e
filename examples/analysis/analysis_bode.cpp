// Why a cascade wins on noise, and where it loses: LESO and cascades p = 2, 3 with the same
// disturbance bandwidth, in the frequency domain. At equal bandwidth the noise in dhat falls to a
// quarter with the second level and by a fifth more with the third. The price is an estimate that
// peaks and lags in the decade below the bandwidth.
//
// The cascade is that of K. Lakomy, R. Madonski, "Cascade extended state observer for active
// disturbance rejection control applications under measurement noise", ISA Transactions 109 (2021)
// 1-10, doi:10.1016/j.isatra.2020.09.007; the comparison is ours.
//
// Way: sampled, sampled observers; exact frequency responses and variances, nothing is
// simulated.
//
// symbol     code            value                        unit
// n          order           2                            -
// T          sample_time     0.001                        s
// omega_o    reference       100, of the LESO             rad/s
// alpha      level_factor    2                            -
// omega_B                    -3 dB of d to dhat, equal    rad/s

#include <array>
#include <numbers>

#include <esokit/analysis/covariance.hpp>

#include "analysis/analysis.hpp"

using namespace esokit::examples;
using namespace analysis;

namespace {

constexpr int order = 2;
constexpr double sample_time = 1e-3;
constexpr double reference = 100.0;
constexpr int points = 400;

struct Row {
  std::string name;
  double bandwidth = 0.0;    // omega_o1, rad/s
  double noise = 0.0;        // standard deviation of dhat for noise of 1
  double noise_first = 0.0;  // of the rate estimate
  double lag = 0.0;          // of d to dhat at a third of omega_B, rad
  double slow_error = 0.0;   // abs(1 - G) at a tenth of omega_B
  double peak = 0.0;         // largest abs(1 - G)
  double overshoot = 0.0;    // largest abs(G)
  Bode<points> estimate, error, from_noise;
};

template <int Levels>
Row analyse(double wanted, const Array<double, points>& grid) {
  Row row;
  row.name = Levels == 1 ? "LESO" : "cascade p = " + std::to_string(Levels);
  row.bandwidth = bandwidth_for<order, Levels>(wanted, sample_time);
  const auto observer = observer_with<order, Levels>(row.bandwidth, sample_time);
  const auto system = estimation_system(observer);
  row.estimate = bode<1, order>(system, grid).value();
  row.from_noise = bode<0, order>(system, grid).value();
  const auto error = [&](double w) -> Expected<Complex, Error<double>> {
    return 1.0 - disturbance_response(observer, w);
  };
  row.error = bode(grid, error).value();
  const auto covariance = estimation_error_covariance(observer, {.measurement = 1.0}).value();
  row.noise = std::sqrt(covariance(2, 2));
  row.noise_first = std::sqrt(covariance(1, 1));
  row.lag = -std::arg(disturbance_response(observer, wanted / 3.0));
  row.slow_error = std::abs(error(wanted / 10.0).value());
  for (const double size : row.error.magnitude) row.peak = std::max(row.peak, size);
  for (const double size : row.estimate.magnitude) row.overshoot = std::max(row.overshoot, size);
  return row;
}

std::vector<double> degrees(const Array<double, points>& phase) {
  std::vector<double> result;
  for (const double value : phase) result.push_back(value * 180.0 / std::numbers::pi);
  return result;
}

}  // namespace

int main(int argc, char** argv) {
  Report report(
      argc, argv, folder, "bode",
      about("LESO and cascade compared at equal disturbance bandwidth",
            "How a disturbance and measurement noise affect the estimates of each observer, over "
            "frequency. Sampled observers; the results are exact, nothing is simulated."));
  const double wanted = disturbance_bandwidth(observer_with<order, 1>(reference, sample_time));
  const auto grid = log_grid<points>(1.0, 0.999 * std::numbers::pi / sample_time).value();
  const std::array rows = {analyse<1>(wanted, grid), analyse<2>(wanted, grid),
                           analyse<3>(wanted, grid)};

  Figure figure("bode", {.rows = 2, .columns = 2, .panel_height = 230});
  figure.caption(
      "Observers of equal disturbance bandwidth (−3 dB at the dotted line), n = 2, T = 1 ms. "
      "Advantage of the cascade: the noise in its disturbance estimate falls off earlier and "
      "faster, and its error for slow disturbances is of order p in ω. Drawback: between a tenth "
      "of the bandwidth and the bandwidth it amplifies the disturbance by up to a factor of two, "
      "and lags more, so that its error there is larger.");
  auto& magnitude = figure.panel(0, 0).title("disturbance to its estimate").name("estimate");
  auto& error = figure.panel(0, 1).title("error of the estimate, 1 − G").name("error");
  auto& phase = figure.panel(1, 0).title("phase of the estimate").name("phase");
  auto& noise = figure.panel(1, 1).title("noise to disturbance estimate").name("noise");
  magnitude.y_label("abs(dhat/d)").y_range(1e-3, 3.0).log_y().legend(Legend::bottom_left);
  error.y_label("abs(1 − dhat/d)").y_range(1e-3, 3.0).log_y().legend(Legend::bottom_right);
  phase.y_label("phase (°)").y_range(-400.0, 40.0).y_tick(90.0).legend(Legend::bottom_left);
  noise.y_label("abs(dhat/v) (s^{-2})").y_range(1.0, 1e5).log_y().legend(Legend::top_left);
  constexpr std::array colors = {Color::blue, Color::vermillion, Color::green};
  for (Panel* panel : {&magnitude, &error, &phase, &noise}) {
    panel->log_x().x_label("ω (rad/s)").x_range(1.0, 3e3);
    panel->vertical_line(wanted, {.color = Color::grey, .dash = Dash::dotted});
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Style style{.name = rows[i].name, .color = colors[i], .width = 1.8};
    magnitude.line(grid, rows[i].estimate.magnitude, style);
    error.line(grid, rows[i].error.magnitude, style);
    phase.line(grid, degrees(rows[i].estimate.phase), style);
    noise.line(grid, rows[i].from_noise.magnitude, style);
  }
  report.add(figure);

  std::vector<CsvRow> lines;
  for (const Row& row : rows) {
    lines.push_back({row.name, number_text(row.bandwidth, 4), number_text(row.noise, 4),
                     number_text(row.noise_first, 3), number_text(row.slow_error, 3),
                     number_text(row.lag * 180.0 / std::numbers::pi, 3), number_text(row.peak, 3),
                     number_text(row.overshoot, 3)});
  }
  report.table(
      "observers",
      "Equal disturbance bandwidth, omega_B = " + number_text(wanted, 4) +
          " rad/s. sd: standard deviation for measurement noise with a standard deviation of 1",
      {"observer", "omega_o1 (rad/s)", "sd of dhat", "sd of the rate", "error at omega_B/10",
       "lag at omega_B/3 (°)", "largest error", "largest gain"},
      lines);

  // Closed form of the LESO's bandwidth in continuous time, which T = 1 ms comes near to.
  report.check_reference("LESO", "omega_B (rad/s)", reference * std::sqrt(std::cbrt(2.0) - 1.0),
                         wanted, 0.06, "continuous closed form");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const double noise_share = rows[i].noise / rows[0].noise;
    report.check(rows[i].name, "sd of dhat, share of the LESO's", std::nullopt, noise_share);
    if (i == 0) continue;
    report.expect(rows[i].name, "noise in dhat against one level less (share)",
                  rows[i].noise / rows[i - 1].noise, rows[i].noise < rows[i - 1].noise,
                  "less noise with every level");
    report.expect(rows[i].name, "lag at omega_B/3 against the LESO (°)",
                  (rows[i].lag - rows[0].lag) * 180.0 / std::numbers::pi,
                  rows[i].lag > rows[i - 1].lag, "the price: more lag");
    report.expect(rows[i].name, "largest error abs(1 − G)", rows[i].peak,
                  rows[i].peak > rows[i - 1].peak, "the price: larger error near the bandwidth");
  }
  return report.finish();
}
