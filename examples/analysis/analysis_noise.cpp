// How much measurement noise reaches the actuator, against the number of levels p of the cascade
// and the order n of the plant, at equal disturbance bandwidth.
//
// The cascade is that of K. Lakomy, R. Madonski, ISA Transactions 109 (2021) 1-10,
// doi:10.1016/j.isatra.2020.09.007; the numbers are ours.
//
// Way: sampled. Variances are exact (Lyapunov equation of the closed loop); runs of 1e7
// samples of the real observer and law stand beside them.
//
// symbol     code             value                    unit
// n          order            1, 2, 3                  -
// omega_c    control          5                        rad/s
// omega_B    wanted           50: -3 dB of d to dhat   rad/s
// alpha      level_factor     2                        -
// T          sample_time      0.001                    s
//            sample_times     0.0001 .. 0.01           s, second panel
// plant      y^(n) = u + d, noise v of standard deviation 1 on y

#include <array>
#include <cstdint>
#include <numbers>

#include <esokit/analysis/loop_noise.hpp>

#include "analysis/analysis.hpp"
#include "common/parallel.hpp"

using namespace esokit::examples;
using namespace analysis;

namespace {

constexpr double wanted = 50.0;
constexpr double control = 5.0;
constexpr double sample_time = 1e-3;
constexpr long samples = 10'000'000;

template <int Order, int Levels>
auto controller_at(double T) {
  return controller_with<Order, Levels>(bandwidth_for<Order, Levels>(wanted, T), T, control);
}

template <int Order>
LinearPlant<Order> chain() {
  return LinearPlant<Order>::chain({}).value();
}

template <int Order, int Levels>
double deviation_of_control(double T) {
  const auto all = noise(chain<Order>(), controller_at<Order, Levels>(T), {.measurement = {1.0}});
  return all->control[0];
}

/// White, variance 1 (uniform: a variance asks for no more), and fast: splitmix64.
class White {
 public:
  explicit White(std::uint64_t seed) : state_(seed) {}
  double next() {
    state_ += 0x9e3779b97f4a7c15u;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30u)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27u)) * 0x94d049bb133111ebu;
    z ^= z >> 31u;
    return (static_cast<double>(z >> 11u) * 0x1p-52 - 1.0) * std::sqrt(3.0);
  }

 private:
  std::uint64_t state_;
};

/// Variance of u of a run, and its standard error from 100 blocks.
struct Measurement {
  double variance = 0.0, error = 0.0;
};

template <int Order, int Levels>
Measurement run(std::uint64_t seed) {
  auto controller = controller_at<Order, Levels>(sample_time);
  White white(seed);
  // The chain of integrators, sampled: Taylor terms of the held input.
  constexpr std::size_t n = Order;
  std::array<double, n> x{};
  double u = 0.0;
  std::vector<double> blocks;
  double sum = 0.0;
  for (long k = -10'000; k < samples; ++k) {
    u = controller.update(x[0] + white.next(), 0.0);
    std::array<double, n> next{};
    for (std::size_t r = 0; r < n; ++r) {
      double term = 1.0;
      for (std::size_t c = r; c < n; ++c) {
        next[r] += term * x[c];
        term *= sample_time / static_cast<double>(c + 1 - r);
      }
      next[r] += term * u;
    }
    x = next;
    if (k < 0) continue;
    sum += u * u;
    if ((k + 1) % (samples / 100) == 0) {
      blocks.push_back(sum / static_cast<double>(samples / 100));
      sum = 0.0;
    }
  }
  const Statistics statistic = statistics(blocks);
  return {statistic.mean, statistic.standard_error};
}

constexpr std::array orders = {1, 2, 3};
constexpr std::array levels = {1.0, 2.0, 3.0, 4.0};

template <int Order>
std::array<double, 4> by_levels(double T) {
  return {deviation_of_control<Order, 1>(T), deviation_of_control<Order, 2>(T),
          deviation_of_control<Order, 3>(T), deviation_of_control<Order, 4>(T)};
}

template <int Levels>
std::vector<double> over_frequency(const Array<double, 300>& grid) {
  const auto loop = closed_loop(chain<2>(), controller_at<2, Levels>(sample_time)).value();
  const auto curve = bode(grid, [&](double w) { return loop.noise_to_control(w); }).value();
  return {curve.magnitude.begin(), curve.magnitude.end()};
}

}  // namespace

int main(int argc, char** argv) {
  Report report(argc, argv, folder, "noise",
                about("Noise in u over the number of levels",
                      "Standard deviation of u for white measurement noise with a standard "
                      "deviation of 1, observers of equal disturbance bandwidth: exact values, "
                      "compared with simulations of 1e7 samples of the observer and control law."));
  const std::array exact = {by_levels<1>(sample_time), by_levels<2>(sample_time),
                            by_levels<3>(sample_time)};

  const auto measured = run_parallel("runs of 1e7 samples", 4, [](std::size_t job) -> Measurement {
    switch (job) {
      case 0:
        return run<2, 1>(1);
      case 1:
        return run<2, 2>(2);
      case 2:
        return run<2, 3>(3);
      default:
        return run<2, 4>(4);
    }
  });
  for (std::size_t i = 0; i < 4; ++i) {
    const double variance = exact[1][i] * exact[1][i];
    report.check_reference("n = 2, p = " + std::to_string(i + 1), "variance of u, 1e7 samples",
                           variance, measured[i].variance,
                           Tolerance::absolute(3.0 * measured[i].error), "exact variance");
  }

  std::vector<CsvRow> lines;
  for (std::size_t n = 0; n < 3; ++n) {
    CsvRow line{"n = " + std::to_string(orders[n])};
    for (const double deviation : exact[n]) line.push_back(number_text(deviation, 4));
    lines.push_back(line);
    for (std::size_t i = 1; i < 4; ++i) {
      report.expect("n = " + std::to_string(orders[n]) + ", p = " + std::to_string(i + 1),
                    "noise in u against one level less (share)", exact[n][i] / exact[n][i - 1],
                    i > 1 || exact[n][i] < exact[n][i - 1], "the second level gains most");
    }
  }
  report.table("control", "Standard deviation of u for noise of 1 on y, omega_B = 50 rad/s",
               {"order of the plant", "p = 1 (LESO)", "p = 2", "p = 3", "p = 4"}, lines);

  const auto grid = log_grid<300>(1.0, 0.999 * std::numbers::pi / sample_time).value();
  Figure figure("noise", {.rows = 1, .columns = 3, .panel_height = 230});
  figure.caption(
      "Noise in u at equal disturbance bandwidth (50 rad/s), omega_c = 5 rad/s. Left: over the "
      "number of levels, for T = 1 ms; crosses: simulations of 1e7 samples. "
      "Middle: over frequency, n = 2. Right: over the sample time, n = 2, for the same noise "
      "per sample: it falls with the square root of T, because a smaller part of the noise is "
      "within the band of the observer. The second level reduces the noise most, and more so for "
      "plants of higher order.");
  auto& left = figure.panel(0, 0)
                   .title("against the levels")
                   .name("levels")
                   .x_label("levels p")
                   .y_label("sd of u / sd of y (-)");
  left.log_y().x_range(0.7, 4.3).x_tick(1.0).y_range(1.0, 1e8).legend(Legend::top_right);
  // The colours are those of the levels in the other panels.
  constexpr std::array dashes = {Dash::dotted, Dash::solid, Dash::dashed};
  for (std::size_t n = 0; n < 3; ++n) {
    const std::string name = "n = " + std::to_string(orders[n]);
    left.line(levels, exact[n], {.name = name, .color = Color::grey, .dash = dashes[n]});
    left.points(levels, exact[n],
                {.color = Color::grey, .marker = Marker::circle, .column = name + " points"});
  }
  std::vector<double> crosses;
  for (const Measurement& m : measured) crosses.push_back(std::sqrt(m.variance));
  left.points(levels, crosses,
              {.name = "run", .color = Color::black, .marker = Marker::cross, .size = 1.4});

  auto& middle = figure.panel(0, 1)
                     .title("over frequency, n = 2")
                     .name("frequency")
                     .x_label("ω (rad/s)")
                     .y_label("gain from noise to u (-)");
  middle.log_x().log_y().x_range(1.0, 3e3).y_range(10.0, 2e5).legend(Legend::top_left);
  middle.line(grid, over_frequency<1>(grid), {.name = "p = 1"});
  middle.line(grid, over_frequency<2>(grid), {.name = "p = 2"});
  middle.line(grid, over_frequency<3>(grid), {.name = "p = 3"});
  middle.line(grid, over_frequency<4>(grid), {.name = "p = 4"});

  const auto sample_times = log_grid<17>(1e-4, 1e-2).value();
  std::array<std::vector<double>, 4> over_time;
  for (const double T : sample_times) {
    const auto row = by_levels<2>(T);
    for (std::size_t i = 0; i < 4; ++i) over_time[i].push_back(row[i]);
  }
  auto& right = figure.panel(0, 2)
                    .title("against T, n = 2")
                    .name("sample_time")
                    .x_label("T (s)")
                    .y_label("sd of u / sd of y (-)");
  right.log_x().log_y().legend(Legend::bottom_right);
  for (std::size_t i = 0; i < 4; ++i) {
    right.line(sample_times, over_time[i], {.name = "p = " + std::to_string(i + 1)});
  }
  report.add(figure);
  return report.finish();
}
