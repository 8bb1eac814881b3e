// The cogging of a motor over its angle: a table from the log of one slow turn, smoothed
// afterwards, and what a controller gains that knows it. Beside it the table that dhat of the same
// log gives.
//
// Way: sampled; the motor is integrated in steps of 0.1 ms.
//
// Motor       y'' = 40 u + d, d = -2 y' - cogging(y); y from 16384 counts a turn
// Controller  order 2, omega_o = 100, omega_c = 25 rad/s, T = 1 ms
// Turns       at 1 rad/s for the table, then at 8 rad/s, where cogging is as fast as the observer

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include <esokit/adapter/known_model.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/identify/smooth.hpp>
#include <esokit/observer/linear_eso.hpp>

#include "common/report.hpp"
#include "models/models.hpp"

using namespace esokit;
using namespace esokit::examples;
using namespace models;

namespace {

constexpr double turn = 2 * std::numbers::pi, count = turn / 16384, b0 = 40, friction = 2;

double cogging(double angle) { return 20 * std::sin(12 * angle) + 8 * std::sin(24 * angle + 1); }

/// d over the angle, a straight line between places.
struct Table {
  static constexpr int places = 180;
  std::array<double, places> d{};

  double operator()(const auto& estimate) const noexcept {
    const double place = (estimate(0) / turn - std::floor(estimate(0) / turn)) * places;
    const int low = static_cast<int>(place);
    const auto at = [&](int i) { return d[static_cast<std::size_t>(i % places)]; };
    return at(low) + (place - low) * (at(low + 1) - at(low));
  }

  /// Means around the places, weighed by their distance; without the mean, which is friction.
  static Table of(const std::vector<double>& angle, const std::vector<double>& d) {
    Table table;
    std::array<double, places> weights{};
    for (std::size_t k = 0; k < d.size(); ++k) {
      const double place = (angle[k] / turn - std::floor(angle[k] / turn)) * places;
      for (int i : {static_cast<int>(place), static_cast<int>(place) + 1}) {
        const double weight = 1 - std::abs(place - i);
        table.d[static_cast<std::size_t>(i % places)] += weight * d[k];
        weights[static_cast<std::size_t>(i % places)] += weight;
      }
    }
    double mean = 0;
    for (std::size_t i = 0; i < places; ++i) mean += (table.d[i] /= weights[i]) / places;
    for (double& each : table.d) each -= mean;
    return table;
  }
};

using Plain = LinearEso<2>;
using Knowing = KnownModel<Plain, Table>;

constexpr Plain::Config observer() {
  return {.observer_bandwidth = 100, .input_gain = b0, .sample_time = sample_time};
}

struct Turned {
  Log log;
  std::vector<double> d, dhat, error;  ///< as it is, as the observer finds it; r - y, mrad
  double rms = 0;                      ///< of the error, mrad
};

/// From rest to a speed in 0.5 s, then `seconds` of log at it.
template <class Observer>
Turned turned(Adrc<Observer> controller, double speed, double seconds) {
  Turned result;
  double y = 0, rate = 0, wanted = 0;
  const auto rows = static_cast<int>(seconds / sample_time);
  for (int k = -1000; k < rows; ++k) {
    const double r1 = speed * std::min(1.0, (k + 1000) / 500.0);
    const double seen = count * std::round(y / count);
    const double u = controller.update(seen, {wanted, r1});
    if (k >= 0) {
      result.log.u.push_back(u);
      result.log.y.push_back(seen);
      result.d.push_back(-friction * rate - cogging(y));
      result.dhat.push_back(controller.observer().total_disturbance());
      result.error.push_back(1e3 * (wanted - y));
      result.rms += std::pow(result.error.back(), 2) / rows;
    }
    wanted += r1 * sample_time;
    for (int i = 0; i < 10; ++i) {
      rate += 0.1 * sample_time * (b0 * u - friction * rate - cogging(y));
      y += 0.1 * sample_time * rate;
    }
  }
  result.rms = std::sqrt(result.rms);
  return result;
}

Adrc<Knowing> knowing(const Table& table) {
  return Adrc<Knowing>::make(
             {.observer = {.observer = observer(), .model = table}, .controller_bandwidth = 25})
      .value();
}

double off(const Table& table) {
  double squares = 0;
  for (int i = 0; i < Table::places; ++i) {
    const double error = table.d[static_cast<std::size_t>(i)] + cogging(turn * i / Table::places);
    squares += error * error / Table::places;
  }
  return std::sqrt(squares);
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, "models", "cogging",
                about("A table of cogging from one slow turn",
                      "The disturbance over the angle, smoothed over a log of one turn, and put "
                      "into KnownModel; beside it the table that dhat gives."));
  const auto plain =
      Adrc<Plain>::make({.observer = observer(), .controller_bandwidth = 25}).value();
  const Turned slow = turned(plain, 1, turn + 0.2);
  const auto smoothed = smooth(slow.log, plain.observer()).value();
  const auto& angle = smoothed.estimates[0];
  double observed = 0, without_lag = 0, said = 0;
  const auto rows = static_cast<double>(slow.d.size());
  for (std::size_t k = 0; k < slow.d.size(); ++k) {
    observed += std::pow(slow.dhat[k] - slow.d[k], 2) / rows;
    without_lag += std::pow(smoothed.disturbance[k] - slow.d[k], 2) / rows;
    said += std::pow(smoothed.deviation[k], 2) / rows;
  }
  report.expect("slow turn", "error of dhat, RMS (rad/s^2)", std::sqrt(observed), true, "reported");
  report.expect("slow turn", "error of smooth, RMS (rad/s^2)", std::sqrt(without_lag),
                without_lag < 0.1 * observed, "less than a third");
  report.expect("slow turn", "deviation that smooth says (rad/s^2)", std::sqrt(said), true,
                "reported");

  const Table by_observer = Table::of(angle, slow.dhat);
  const Table by_smooth = Table::of(angle, smoothed.disturbance);
  std::vector<double> place, truth;
  for (int i = 0; i < Table::places; ++i) {
    place.push_back(turn * i / Table::places);
    truth.push_back(-cogging(place.back()));
  }
  report.expect("table by dhat", "error (rad/s^2)", off(by_observer), true, "reported");
  report.expect("table by smooth", "error (rad/s^2)", off(by_smooth),
                off(by_smooth) < off(by_observer), "less");
  const Turned without = turned(plain, 8, 2);
  const Turned lagging = turned(knowing(by_observer), 8, 2);
  const Turned known = turned(knowing(by_smooth), 8, 2);
  report.expect("no table", "error at 8 rad/s, RMS (mrad)", without.rms, true, "reported");
  report.expect("table by dhat", "error at 8 rad/s, RMS (mrad)", lagging.rms, true, "reported");
  report.expect("table by smooth", "error at 8 rad/s, RMS (mrad)", known.rms,
                known.rms < 0.5 * lagging.rms, "less than half of that by dhat");

  Figure figure("cogging_table", {.rows = 1, .columns = 2, .panel_height = 220});
  figure.caption(
      "Left: the cogging of a sixth of a turn, and the tables from one slow turn. Right: the error "
      "at 8 rad/s without a table and with each.");
  figure.panel(0, 0)
      .x_label("angle (rad)")
      .y_label("d (rad/s^2)")
      .x_range(0, turn / 6)
      .legend(Legend::above)
      .line(place, truth, {.name = "true", .color = Color::black, .dash = Dash::dashed})
      .line(place, by_observer.d, {.name = "by dhat", .color = Color::vermillion})
      .line(place, by_smooth.d, {.name = "by smooth", .color = Color::blue});
  std::vector<double> t;
  for (std::size_t k = 0; k < known.error.size(); ++k)
    t.push_back(static_cast<double>(k) * sample_time);
  figure.panel(0, 1)
      .x_label("t (s)")
      .y_label("error (mrad)")
      .x_range(0, 0.5)
      .legend(Legend::above)
      .line(t, without.error, {.name = "no table", .color = Color::grey})
      .line(t, lagging.error, {.name = "by dhat", .color = Color::vermillion})
      .line(t, known.error, {.name = "by smooth", .color = Color::blue});
  report.add(figure);
  return report.finish();
}
