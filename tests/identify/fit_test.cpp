// The innovations fit against a dense Kalman filter of numpy and scipy (expm, lstsq), and against
// plants that are known.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <esokit/sim/gaussian.hpp>
#include <vector>

namespace identify_fit_test {

using esokit::Fit;
using esokit::FitBounds;
using esokit::FitData;
using esokit::FitModel;
using esokit::FitPoint;
using esokit::InnovationsFit;

constexpr double T = 0.004;

// Numbers without a plant behind them: what is compared is arithmetic.
FitData formula(std::size_t rows, bool with_column) {
  FitData data;
  data.sample_time = T;
  std::vector<double> column;
  for (std::size_t i = 0; i < rows; ++i) {
    const auto k = static_cast<double>(i);
    data.u.push_back(std::sin(0.05 * k) + (std::sin(0.013 * k + 0.3) > 0 ? 0.5 : -0.5));
    data.y.push_back(0.8 * std::sin(0.031 * k + 0.2) + 0.1 * std::cos(0.17 * k) +
                     0.001 * std::sin(k * k));
    column.push_back(std::cos(0.023 * k));
  }
  if (with_column) data.columns.push_back(column);
  return data;
}

struct Reference {
  FitModel model;
  FitPoint point;
  std::vector<std::size_t> starts;
  bool column;
  int averaged;
  std::vector<double> linear;
  double mean_square, noise;
  std::size_t rows;
  int gap = 0;  // rows between two pieces, in which the load goes on; -1: unknown anew
};

// The filter starts at the row of the longest latency, 15 rows here.
TEST(InnovationsFit, IsTheKalmanFilterOfNumpy) {
  const std::vector<Reference> references = {{{1, 1, true},
                                              {25, 0.013, 0.6, 0},
                                              {0},
                                              false,
                                              1,
                                              {0.6604762641307567},
                                              0.008443089674325856,
                                              0.08561082112525026,
                                              1183},
                                             {{2, 1, true},
                                              {40, 0.011, 0.3, 3},
                                              {0, 500},
                                              true,
                                              1,
                                              {-5.2536353760185985, -21.380148111837397},
                                              0.0038379548629954565,
                                              0.053101103431319005,
                                              1164,
                                              -1},
                                             {{2, 1, true},
                                              {40, 0.011, 0.3, 3},
                                              {0, 500},
                                              true,
                                              1,
                                              {3.174850691867304, -2.8988187448697134},
                                              0.00386406978484014,
                                              0.053281457323447384,
                                              1165},
                                             {{2, 1, true},
                                              {40, 0.011, 0.3, 3},
                                              {0, 500},
                                              true,
                                              1,
                                              {-4.520534315671625, -19.772661017033297},
                                              0.003837218471586463,
                                              0.053096008911782074,
                                              1165,
                                              300},
                                             {{2, 2, true},
                                              {30, 0.006, 1, 0},
                                              {0},
                                              false,
                                              1,
                                              {2.6359608288525216},
                                              0.0063039204354839486,
                                              0.06787555429243632,
                                              1181},
                                             {{3, 1, true},
                                              {50, 0.02, 0.5, 1},
                                              {0},
                                              false,
                                              1,
                                              {-1848.82690325331},
                                              0.0017407359577604174,
                                              0.03219161175395408,
                                              1181},
                                             {{2, 1, true},
                                              {40, 0.011, 0.3, 3},
                                              {0},
                                              true,
                                              4,
                                              {-0.9103390041657009, -9.526047991700446},
                                              0.003955964773622312,
                                              0.05391130220779034,
                                              1182}};
  for (const Reference& reference : references) {
    FitData data = formula(1200, reference.column);
    data.starts = reference.starts;
    data.one_load = reference.gap >= 0;
    for (std::size_t piece = 0; reference.gap > 0 && piece < data.starts.size(); ++piece) {
      data.start_times.push_back(
          T * static_cast<double>(data.starts[piece] +
                                  piece * static_cast<std::size_t>(reference.gap)));
    }
    data.averaged = reference.averaged;
    InnovationsFit fit(data, reference.model, {1, 200, 1e-4, 15 * T - 1e-9, 0.5});
    const Fit found = fit.at(reference.point);
    SCOPED_TRACE(reference.linear[0]);
    ASSERT_EQ(found.linear.size(), reference.linear.size());
    // The diffuse start, of variance 1e8, makes rounding 1e8 times as large; gains are taken for
    // steady once they change by 1e-9
    // of w T a row.
    for (std::size_t i = 0; i < found.linear.size(); ++i) {
      EXPECT_NEAR(found.linear[i] / reference.linear[i], 1, 1e-6);
    }
    EXPECT_NEAR(found.mean_square / reference.mean_square, 1, 1e-6);
    EXPECT_NEAR(found.noise / reference.noise, 1, 1e-6);
    EXPECT_EQ(found.rows, reference.rows);
  }
}

// y'' + a y' = b0 v(t - L), 40 steps a row, a square wave of u.
FitData second_order(double b0, double tau, double dead, double a, double noise) {
  FitData data;
  data.sample_time = T;
  constexpr int steps = 40;
  constexpr double h = T / steps;
  const auto line = static_cast<std::size_t>(std::lround(dead / h));
  std::vector<double> sent;
  double v = 0, x0 = 0, x1 = 0;
  for (int k = 0; k < 3000; ++k) {
    const double t = k * T;
    const double u =
        std::sin(3 * t) + 0.6 * (std::sin(7.3 * t) > 0 ? 1 : -1) + 0.4 * std::sin(23 * t);
    data.u.push_back(u);
    data.y.push_back(x0 + noise * std::sin(static_cast<double>(k) * k));
    for (int i = 0; i < steps; ++i) {
      sent.push_back(u);
      const double delayed = sent.size() > line ? sent[sent.size() - 1 - line] : 0.0;
      const double next = delayed + (v - delayed) * std::exp(-h / tau);
      const double middle = 0.5 * (v + next);
      const double speed = x1;
      x1 += h * (b0 * middle - a * x1);
      x0 += 0.5 * h * (speed + x1);
      v = next;
    }
  }
  return data;
}

TEST(InnovationsFit, FindsThePlantThatMadeTheLog) {
  const FitData data = second_order(80, 0.015, 0.0062, 2, 1e-4);
  InnovationsFit fit(data, {2, 1, true}, {0.5, 300, 1e-4, 0.3, 0.5});
  // From three times too slow and from too fast.
  for (const double latency : {0.06, 0.004}) {
    const Fit found = fit.minimise({20, latency, 0.4, 0}, true, 60);
    EXPECT_TRUE(found.converged);
    // The simulation's own steps leave 1e-4 (h = 0.1 ms), the noise of 1e-4 less.
    EXPECT_NEAR(found.linear[0], 80, 0.4);
    EXPECT_NEAR(found.at.lag(), 0.015, 2e-4);
    EXPECT_NEAR(found.at.dead_time(), 0.0062, 2e-4);
    EXPECT_NEAR(found.at.pole, 2, 0.02);
    EXPECT_NEAR(found.noise, 1e-4 / std::sqrt(2.0), 1e-5);
  }
}

// Half of the gradient of the sum of squares is the innovations times their sensitivities, also
// where the lag holds something that is fitted when the log begins.
TEST(InnovationsFit, HasTheSensitivitiesOfItsSumOfSquares) {
  FitData data;
  data.sample_time = T;
  esokit::sim::Gaussian noise(7);
  double y = 0, v = 3;  // left of a u that nobody logged
  for (int k = 0; k < 1500; ++k) {
    const bool second = k >= 700;
    if (k == 700) v = -2;
    data.u.push_back((k / 150) % 2 == 0 ? 1.0 : -0.5);
    data.y.push_back(y + 1e-3 * noise.next());
    for (int i = 0; i < 100; ++i) {
      v += 1e-2 * T / 0.06 * (data.u.back() - v);
      y += 1e-2 * T * (20 * v - 3 * y + (second ? 1 : 0));
    }
  }
  data.starts = {0, 700};
  for (const bool unknown : {true, false}) {
    data.unknown_before = unknown;
    InnovationsFit fit(data, {1, 1, true}, {0.5, 300, 1e-4, 0.2, 0.5});
    const FitPoint at{15, 0.055, 0.8, 2.5};
    const auto half_square = [&](double w, double latency, double share, double turn) {
      const FitPoint point{at.bandwidth * std::exp(w), at.latency * std::exp(latency),
                           std::sqrt(at.lag_share * at.lag_share + share),
                           at.pole * std::exp(-latency) + turn / (at.latency * std::exp(latency))};
      const Fit here = fit.at(point);
      return 0.5 * here.mean_square * static_cast<double>(here.rows);
    };
    constexpr double h = 1e-4;
    const std::vector<double> wanted{
        (half_square(h, 0, 0, 0) - half_square(-h, 0, 0, 0)) / (2 * h),
        (half_square(0, h, 0, 0) - half_square(0, -h, 0, 0)) / (2 * h),
        (half_square(0, 0, h, 0) - half_square(0, 0, -h, 0)) / (2 * h),
        (half_square(0, 0, 0, h) - half_square(0, 0, 0, -h)) / (2 * h)};
    const Fit here = fit.at(at);
    const auto found = fit.sensitivities(here, true);
    ASSERT_EQ(found.free, (std::vector<int>{0, 1, 2, 3}));
    for (std::size_t i = 0; i < 4; ++i) {
      double product = 0;
      for (std::size_t k = 0; k < data.y.size(); ++k)
        product += fit.residual()[k] * found.columns[i][k];
      // Differences to one side have an error of the first order in their step.
      EXPECT_NEAR(product / wanted[i], 1, 2e-4) << unknown << ' ' << i;
    }
  }
}

// What was measured beside its row, or not at all, is as good as what was measured at it.
TEST(InnovationsFit, TakesYWhenAndWhereItWasMeasured) {
  constexpr int inner = 80;
  constexpr double h = T / inner, lag = 0.03, pole = 3, gain = 80, sd = 2e-4;
  for (int order = 1; order <= 3; ++order) {
    FitData at_rows, beside;
    at_rows.sample_time = beside.sample_time = T;
    esokit::sim::Gaussian gaussian(5);
    double v = 0;
    std::vector<double> x(4, 0.0), path, sent;
    for (int k = 0; k < 4000 * inner; ++k) {
      path.push_back(x[0]);
      const double u = std::sin(1e-5 * k * k / inner) > 0 ? 1 : -0.8;
      if (k % inner == 0) sent.push_back(u);
      const double v_before = v;
      v += (1 - std::exp(-h / lag)) * (sent.back() - v);
      const double force = 0.5 * gain * (v_before + v);
      const double before = x[static_cast<std::size_t>(order - 1)];
      const double until = before + (1 - std::exp(-pole * h)) / pole * (force - pole * before);
      x[static_cast<std::size_t>(order - 1)] = until;
      for (std::size_t i = 0; i + 1 < static_cast<std::size_t>(order); ++i)
        x[i] += h * (i + 2 == static_cast<std::size_t>(order) ? 0.5 * (before + until) : x[i + 1]);
    }
    at_rows.u = beside.u = sent;
    std::size_t missing = 0;
    for (int k = 0; k < 4000; ++k) {
      const double noise = sd * gaussian.next();
      const auto row = static_cast<std::size_t>(k * inner);
      const int late = k == 0 || k == 3999 ? 0 : static_cast<int>(36 * std::sin(k * k));
      const bool lost = k % 13 == 7 || k % 130 == 8;
      missing += lost && k >= 75;  // those before, of the longest latency, are not used
      at_rows.y.push_back(path[row] + noise);
      beside.offsets.push_back(late * h);
      beside.measured.push_back(lost ? std::nan("")
                                     : path[static_cast<std::size_t>(k * inner + late)] + noise);
      beside.y.push_back(at_rows.y.back());
    }
    const FitModel model{order, 1, true};
    const FitBounds bounds{0.5, 300, 1e-4, 0.3, 0.5};
    const FitPoint truth{5, lag, 1, pole};
    InnovationsFit fit(at_rows, model, bounds), irregular(beside, model, bounds);
    const Fit regular = fit.minimise(truth, false), found = irregular.minimise(truth, false);
    EXPECT_NEAR(regular.linear[0], gain, 0.01 * gain) << order;
    EXPECT_NEAR(regular.noise, sd, 0.045 * sd) << order;
    EXPECT_NEAR(found.linear[0], gain, 0.01 * gain) << order;
    // Of 4,000 numbers the mean square is known to 2.2 %, twice that as some rows are others.
    EXPECT_NEAR(found.noise, sd, 0.045 * sd) << order;
    EXPECT_NEAR(irregular.noise_floor(found).value, sd, 0.06 * sd) << order;
    EXPECT_EQ(found.rows + missing, regular.rows) << order;
    // Not so if it is taken for what was measured at its row.
    std::fill(beside.offsets.begin(), beside.offsets.end(), 0.0);
    EXPECT_GT(irregular.at(truth).noise, 3 * sd) << order;
  }
}

// Averaging must not move the dead time: the mean input is taken at the right instant.
TEST(InnovationsFit, AveragedRowsGiveTheSameDeadTime) {
  const FitData raw = second_order(80, 0.015, 0.0062, 0, 1e-4);
  for (const int fold : {2, 4}) {
    FitData data;
    data.sample_time = fold * T;
    data.averaged = fold;
    for (std::size_t k = 0; k + static_cast<std::size_t>(fold) <= raw.y.size();
         k += static_cast<std::size_t>(fold)) {
      double u = 0, y = 0;
      for (std::size_t i = 0; i < static_cast<std::size_t>(fold); ++i) {
        u += raw.u[k + i] / fold;
        y += raw.y[k + i] / fold;
      }
      data.u.push_back(u);
      data.y.push_back(y);
    }
    InnovationsFit fit(data, {2, 1, false}, {0.5, 60, 1e-4, 0.3, 0.5});
    const Fit found = fit.minimise({20, 0.03, 0.5, 0}, true, 60);
    EXPECT_NEAR(found.linear[0], 80, 0.8) << fold;
    // A straight line between mean inputs loses what is of second order in a row.
    const double lost = fold * T * fold * T / (12 * 0.015);
    EXPECT_NEAR(found.at.latency, 0.0212, lost) << fold;
  }
}

TEST(InnovationsFit, AColumnOfZerosChangesNothing) {
  FitData data = formula(1200, false);
  InnovationsFit plain(data, {1, 1, true}, {1, 200, 1e-4, 0.06, 0.5});
  const Fit without = plain.at({25, 0.013, 0.6, 0});
  FitData more = data;
  more.columns.emplace_back(1200, 0.0);
  InnovationsFit fit(more, {1, 1, true}, {1, 200, 1e-4, 0.06, 0.5});
  const Fit with = fit.at({25, 0.013, 0.6, 0});
  ASSERT_EQ(with.linear.size(), 2u);
  EXPECT_EQ(with.linear[1], 0.0);
  EXPECT_NEAR(with.linear[0], without.linear[0], 1e-9);
}

TEST(InnovationsFit, KeepsItsParametersWithinBounds) {
  FitData data = formula(1200, false);
  const FitBounds bounds{5, 50, 0.002, 0.05, 0.5};
  InnovationsFit fit(data, {2, 1, true}, bounds);
  const FitPoint wild = fit.inside({1e9, 1e9, 7, 1e9});
  EXPECT_EQ(wild.bandwidth, 50);
  EXPECT_EQ(wild.latency, 0.05);
  EXPECT_EQ(wild.lag_share, 1);
  EXPECT_NEAR(wild.pole * wild.latency, 0.5, 1e-12);
  EXPECT_TRUE(fit.at_bound(wild));
  const FitPoint small = fit.inside({0, 0, -1, -1e9});
  EXPECT_EQ(small.bandwidth, 5);
  EXPECT_EQ(small.latency, 0.002);
  EXPECT_GT(small.lag_share, 0);
  EXPECT_NEAR(small.pole * small.latency, -0.05, 1e-12);
  EXPECT_FALSE(fit.at_bound({20, 0.01, 0.5, 0.499 / 0.01}));
  EXPECT_TRUE(fit.at_bound({20, 0.01, 0.5, 0.4999 / 0.01}));
  EXPECT_FALSE(fit.at_bound({20, 0.04994, 0.5, 0}));
  EXPECT_TRUE(fit.at_bound({20, 0.04996, 0.5, 0}));
  const Fit found = fit.minimise(wild, true);
  EXPECT_GE(found.at.bandwidth, 5);
  EXPECT_LE(found.at.bandwidth, 50);
  EXPECT_LE(found.at.latency, 0.05);
}

// At a bound the other parameters go on as if it were known. When they counted on a step that the
// bound does not let one take, the fit stayed at three times the mean square for a dozen steps.
TEST(InnovationsFit, DoesNotStickAtABound) {
  const FitData data = second_order(80, 0.015, 0.0062, 2, 1e-4);
  InnovationsFit fit(data, {1, 1, true}, {0.5, 300, 1e-4, 0.012, 0.5});
  const Fit few = fit.minimise({20, 0.012, 0.4, 0}, true, 8);
  const Fit many = fit.minimise({20, 0.012, 0.4, 0}, true, 60);
  EXPECT_EQ(many.at.latency, 0.012);
  EXPECT_EQ(many.at.bandwidth, 300);
  EXPECT_TRUE(many.converged);
  EXPECT_LT(few.mean_square, 1.01 * many.mean_square);
}

// A line where u has one, too, may be an error of the model: it counts from a fifth of u's own on.
TEST(FindSines, LeavesALineThatUMayHaveMade) {
  constexpr double gain = 2, swing = 0.5, w = 11;
  for (const double share : {0.17, 0.23}) {
    esokit::sim::Gaussian gaussian(5);
    FitData data;
    data.sample_time = T;
    double y = 0;
    for (int k = 0; k < 2000; ++k) {
      const double t = k * T;
      const double u = swing * std::sin(w * t) + (k / 60 % 2 == 0 ? 1 : -1) + 3;
      data.u.push_back(u);
      data.y.push_back(y + 1e-3 * gaussian.next());
      // What the sine adds until the next row, and u, which is held.
      const double sine = (std::cos(w * t + 1) - std::cos(w * (t + T) + 1)) / w;
      y += T * gain * u + share * gain * swing * sine;
    }
    const auto found = esokit::detail::find_sines(data, {1, 1, false}, {1, 300, 1e-4, 0.03, 0.5},
                                                  {5, 2e-4, 1, 0}, 2);
    ASSERT_EQ(found.size(), share > 0.2 ? 1u : 0u) << share;
    for (const double frequency : found) EXPECT_NEAR(frequency, w, 0.05);
  }
}

}  // namespace identify_fit_test
