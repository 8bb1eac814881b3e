// The smoothed log against dense least squares over the whole log at once, which shares no
// recursion with it; its deviations against the truth of simulated logs; the noise that it finds.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstddef>
#include <esokit/identify/smooth.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/sim/gaussian.hpp>
#include <limits>
#include <support/refusal.hpp>
#include <utility>
#include <vector>

namespace identify_smooth_test {

using esokit_test::refusal;

using namespace esokit;

constexpr double T = 0.02;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

template <int Order, int Extension = 1>
LinearEso<Order, double, Extension> observer(double gain) {
  return LinearEso<Order, double, Extension>::make(
             {.observer_bandwidth = 10.0, .input_gain = gain, .sample_time = T})
      .value();
}

/// x[k+1] = phi x + gamma u + walk w, y = row x, in physical units.
struct Chain {
  Eigen::MatrixXd phi;
  Eigen::VectorXd gamma, walk;
  Eigen::RowVectorXd row;
};

Chain chain(int order, int extension, double gain) {
  const int n = order + extension;
  Chain c{Eigen::MatrixXd::Zero(n, n), Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n),
          Eigen::RowVectorXd::Zero(n)};
  for (int i = 0; i < n; ++i) {
    double term = 1.0;
    for (int j = i; j < n; ++j) {
      c.phi(i, j) = term;
      term *= T / (j - i + 1);
    }
    if (i < order) c.gamma(i) = gain * std::pow(T, order - i) / std::tgamma(order - i + 1.0);
  }
  c.walk(n - 1) = 1.0;
  c.row(0) = 1.0;
  return c;
}

/// Rows with gaps of both kinds, on the grid of samples: y NaN where there is none.
struct Made {
  Log log;
  std::vector<double> y, u;       ///< of each sample
  std::vector<std::size_t> rows;  ///< sample of each row
};

Made made(const Chain& c, std::size_t samples, double noise, double walk, std::uint64_t seed,
          bool gaps, std::vector<Eigen::VectorXd>* truth = nullptr) {
  sim::Gaussian random(seed);
  Made m;
  Eigen::VectorXd x = Eigen::VectorXd::Constant(c.phi.rows(), 0.7);
  for (std::size_t k = 0; k < samples; ++k) {
    if (truth) truth->push_back(x);
    const double u = std::sin(0.13 * static_cast<double>(k));
    const double y = c.row * x + noise * random.next();
    const bool missing = gaps && (k == 9 || k == 10 || (k > 20 && k < 26));
    const bool lost = gaps && (k == 0 || k == 15 || k == 16);
    if (!missing) {
      m.log.time.push_back(1.7e9 + T * static_cast<double>(k) + (k % 3 == 0 ? 0.2 * T : 0.0));
      m.log.u.push_back(u);
      m.log.y.push_back(lost ? nan : y);
      m.rows.push_back(k);
    }
    m.y.push_back(lost || missing ? nan : y);
    m.u.push_back(missing ? m.u.back() : u);
    x = c.phi * x + c.gamma * m.u.back() + c.walk * (walk * random.next());
  }
  return m;
}

/// All states and their covariances by one least-squares problem: unknown are the first state and
/// each w.
struct Dense {
  std::vector<Eigen::VectorXd> x;
  std::vector<Eigen::MatrixXd> p;
};
Dense dense(const Chain& c, const Made& m, double noise, double walk, std::size_t delay = 0) {
  const auto n = c.phi.rows();
  const auto samples = static_cast<Eigen::Index>(m.y.size());
  const Eigen::Index unknown = n + samples - 1;
  // x_k = map z + from_u
  std::vector<Eigen::MatrixXd> map;
  std::vector<Eigen::VectorXd> from_u;
  map.push_back(Eigen::MatrixXd::Zero(n, unknown));
  map[0].leftCols(n).setIdentity();
  from_u.push_back(Eigen::VectorXd::Zero(n));
  for (Eigen::Index k = 0; k + 1 < samples; ++k) {
    const auto at = static_cast<std::size_t>(k);
    Eigen::MatrixXd next = c.phi * map[at];
    next.col(n + k) += c.walk * walk;
    map.push_back(next);
    from_u.push_back(c.phi * from_u[at] + c.gamma * m.u[at < delay ? 0 : at - delay]);
  }
  Eigen::MatrixXd a = Eigen::MatrixXd::Zero(2 * samples, unknown);
  Eigen::VectorXd b = Eigen::VectorXd::Zero(2 * samples);
  for (Eigen::Index k = 0; k < samples; ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (std::isfinite(m.y[at])) {
      a.row(k) = c.row * map[at] / noise;
      b(k) = (m.y[at] - c.row * from_u[at]) / noise;
    }
    if (k > 0) a(samples + k, n + k - 1) = 1.0;
  }
  // Columns of one size, or the first state is lost beside w.
  const Eigen::VectorXd size = a.colwise().norm();
  const Eigen::MatrixXd scaled = a * size.cwiseInverse().asDiagonal();
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(scaled);
  const Eigen::VectorXd z = size.cwiseInverse().asDiagonal() * qr.solve(b);
  const Eigen::MatrixXd r = qr.matrixQR().topRows(unknown).triangularView<Eigen::Upper>();
  const Eigen::MatrixXd root =
      size.cwiseInverse().asDiagonal() *
      r.triangularView<Eigen::Upper>().solve(Eigen::MatrixXd::Identity(unknown, unknown)).eval();
  Dense d;
  for (std::size_t k = 0; k < map.size(); ++k) {
    d.x.push_back(map[k] * z + from_u[k]);
    const Eigen::MatrixXd half = map[k] * root;
    d.p.push_back(half * half.transpose());
  }
  return d;
}

template <class Observer>
void expect_dense(const Chain& c, const Observer& observer, double noise, double walk,
                  const std::vector<Eigen::Index>& state_of_row, std::size_t delay = 0) {
  const Made m = made(c, 60, noise, walk, 3, true);
  const auto found =
      smooth(m.log, observer, {.measurement = noise, .disturbance = walk * walk / T}).value();
  const Dense exact = dense(c, m, noise, walk, delay);
  ASSERT_EQ(found.estimates.size(), state_of_row.size());
  EXPECT_EQ(found.disturbance, found.estimates[Observer::order]);
  EXPECT_EQ(found.deviation.size(), m.rows.size());
  for (std::size_t k = 0; k < m.rows.size(); ++k) {
    const double deviation = found.deviations[Observer::order][k];
    EXPECT_NEAR(found.deviation[k], deviation, 1e-12 * deviation);
  }
  EXPECT_EQ(found.bridged, 10u);
  for (std::size_t r = 0; r < state_of_row.size(); ++r) {
    const auto i = state_of_row[r];
    ASSERT_EQ(found.estimates[r].size(), m.rows.size());
    double size = 0.0;
    for (const auto& x : exact.x) size = std::max(size, std::abs(x(i)));
    for (std::size_t k = 0; k < m.rows.size(); ++k) {
      const std::size_t at = m.rows[k];
      EXPECT_NEAR(found.estimates[r][k], exact.x[at](i), 1e-9 * size) << r << ", " << k;
      const double deviation = std::sqrt(exact.p[at](i, i));
      EXPECT_NEAR(found.deviations[r][k], deviation, 1e-9 * deviation) << r << ", " << k;
    }
  }
}

TEST(Smooth, IsLeastSquaresOverTheWholeLog) {
  for (const double gain : {3.0, -3.0}) {
    for (const double walk : {0.5, 0.0}) {
      expect_dense(chain(1, 1, gain), observer<1>(gain), 0.01, walk, {0, 1});
      expect_dense(chain(2, 1, gain), observer<2>(gain), 0.01, walk, {0, 1, 2});
      expect_dense(chain(3, 1, gain), observer<3>(gain), 0.01, walk, {0, 1, 2, 3});
      expect_dense(chain(2, 2, gain), observer<2, 2>(gain), 0.01, walk, {0, 1, 2, 3});
    }
  }
}

TEST(Smooth, KnowsADelayOfU) {
  const auto late =
      DelayedInput<LinearEso<2>, 4>::make(
          {.observer = {.observer_bandwidth = 10.0, .input_gain = 3.0, .sample_time = T},
           .delay = 3})
          .value();
  expect_dense(chain(2, 1, 3.0), late, 0.01, 0.5, {0, 1, 2}, 3);
}

TEST(Smooth, KnowsTheModelOfItsObserver) {
  // y' = v, v' + 4 v = 3 u + d: exactly sampled, e = exp(-4 T).
  const double pole = 4.0;
  const double e = std::exp(-pole * T);
  const auto with_pole =
      ModelEso<ModelParts{.order = 2, .plant_poles = true}>::make({.observer_bandwidth = 10.0,
                                                                   .input_gain = 3.0,
                                                                   .sample_time = T,
                                                                   .model = {.plant = {0.0, pole}}})
          .value();
  const double speed = (1.0 - e) / pole;               // of v, by a force of one
  const double place = (T - (1.0 - e) / pole) / pole;  // of y
  Chain c{Eigen::MatrixXd(3, 3), Eigen::VectorXd(3), Eigen::VectorXd(3), Eigen::RowVectorXd(3)};
  c.phi << 1.0, speed, place, 0.0, e, speed, 0.0, 0.0, 1.0;
  c.gamma << 3.0 * place, 3.0 * speed, 0.0;
  c.walk << 0.0, 0.0, 1.0;
  c.row << 1.0, 0.0, 0.0;
  // The observer's row n is all that acts besides b0 u, the known pole included.
  const Made m = made(c, 60, 0.01, 0.5, 3, true);
  const auto found =
      smooth(m.log, with_pole, {.measurement = 0.01, .disturbance = 0.25 / T}).value();
  const Dense exact = dense(c, m, 0.01, 0.5);
  for (std::size_t k = 0; k < m.rows.size(); ++k) {
    const auto& x = exact.x[m.rows[k]];
    EXPECT_NEAR(found.estimates[0][k], x(0), 1e-9);
    EXPECT_NEAR(found.estimates[1][k], x(1), 1e-9);
    EXPECT_NEAR(found.estimates[2][k], x(2) - pole * x(1), 1e-8);
    const Eigen::RowVector3d total(0.0, -pole, 1.0);
    const auto& p = exact.p[m.rows[k]];
    EXPECT_NEAR(found.deviations[2][k], std::sqrt(total * p * total.transpose()), 1e-8);
    EXPECT_NEAR(found.disturbance[k], x(2), 1e-8);
    EXPECT_NEAR(found.deviation[k], std::sqrt(p(2, 2)), 1e-8);
  }
}

/// 40 logs: the errors have the deviations that they are said to have, also in gaps and at the
/// ends.
TEST(Smooth, DeviationsAreThoseOfTheErrors) {
  double squares = 0.0;
  double of_observer = 0.0;
  int count = 0;
  const Chain c = chain(2, 1, -3.0);
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    std::vector<Eigen::VectorXd> truth;
    const Made m = made(c, 300, 0.003, 0.4, seed, true, &truth);
    const auto found =
        smooth(m.log, observer<2>(-3.0), {.measurement = 0.003, .disturbance = 0.16 / T}).value();
    for (std::size_t k = 0; k < m.rows.size(); k += 7) {
      const double error = found.estimates[2][k] - truth[m.rows[k]](2);
      squares += error * error / (found.deviations[2][k] * found.deviations[2][k]);
      ++count;
    }
    auto eso = observer<2>(-3.0);
    eso.reset(m.y[1]);
    for (std::size_t k = 2; k < 300; ++k) {
      eso.update(m.y[k], m.u[k - 1]);
      if (k >= 100) of_observer += std::pow(eso.total_disturbance() - truth[k](2), 2) / 8000.0;
    }
  }
  EXPECT_NEAR(squares / count, 1.0, 0.15);
  EXPECT_GT(of_observer, 0.0);
}

TEST(Smooth, FindsTheNoise) {
  const Chain c = chain(2, 1, 3.0);
  const Made m = made(c, 4000, 0.003, 0.4, 5, true);
  const auto both = smooth(m.log, observer<2>(3.0)).value();
  EXPECT_NEAR(*both.noise.measurement, 0.003, 0.1 * 0.003);
  EXPECT_NEAR(*both.noise.disturbance, 0.16 / T, 0.2 * 0.16 / T);
  const auto given = smooth(m.log, observer<2>(3.0), {.measurement = 0.003}).value();
  EXPECT_EQ(*given.noise.measurement, 0.003);
  EXPECT_NEAR(*given.noise.disturbance, 0.16 / T, 0.2 * 0.16 / T);
  const auto walk = smooth(m.log, observer<2>(3.0), {.disturbance = 0.16 / T}).value();
  EXPECT_NEAR(*walk.noise.measurement, 0.003, 0.1 * 0.003);
  EXPECT_NEAR(*walk.noise.disturbance, 0.16 / T, 1e-9);
  const Made still = made(c, 2000, 0.003, 0.0, 6, true);
  const auto constant = smooth(still.log, observer<2>(3.0), {.disturbance = 0.0}).value();
  EXPECT_NEAR(*constant.noise.measurement, 0.003, 0.1 * 0.003);
  EXPECT_EQ(*constant.noise.disturbance, 0.0);
  EXPECT_NEAR(constant.estimates[2][1000], 0.7, 4.0 * constant.deviations[2][1000]);
}

TEST(Smooth, TakesALogWithoutTime) {
  Made m = made(chain(2, 1, 3.0), 80, 0.01, 0.5, 4, false);
  const SmoothNoise noise{.measurement = 0.01, .disturbance = 12.5};
  const auto timed = smooth(m.log, observer<2>(3.0), noise).value();
  m.log.time.clear();
  EXPECT_EQ(smooth(m.log, observer<2>(3.0), noise)->estimates, timed.estimates);
  m.log.sample_time = T;
  EXPECT_EQ(smooth(m.log, observer<2>(3.0), noise)->estimates, timed.estimates);
  // A u that is not finite is that of the row before.
  auto held = m.log;
  held.u[30] = held.u[29];
  m.log.u[30] = nan;
  EXPECT_EQ(smooth(m.log, observer<2>(3.0), noise)->estimates,
            smooth(held, observer<2>(3.0), noise)->estimates);
}

TEST(Smooth, RefusesByRule) {
  const Log good = made(chain(2, 1, 3.0), 30, 0.01, 0.5, 4, false).log;
  const auto with = [&](const auto& change, const SmoothNoise& noise = {.measurement = 0.01}) {
    Log log = good;
    change(log);
    return refusal(smooth(log, observer<2>(3.0), noise));
  };
  const auto nothing = [](Log&) {};
  EXPECT_EQ(with(nothing), "accepted");
  EXPECT_EQ(with([](Log& log) { log = {}; }), "y: must have rows");
  EXPECT_EQ(with([](Log& log) { log.u.pop_back(); }), "u: must be as long as y, that is");
  EXPECT_EQ(with([](Log& log) { log.time.pop_back(); }),
            "time: must be empty or as long as y, that is");
  EXPECT_EQ(with([](Log& log) { log.columns.push_back(log.y); }),
            "columns: must be left out: add what is known to u, in its unit");
  EXPECT_EQ(with([](Log& log) {
              log.time.clear();
              log.sample_time = 1.02 * T;
            }),
            "sample_time: must be that of the observer, which is");
  EXPECT_EQ(with([](Log& log) { log.u[0] = nan; }), "u[0]: must be finite");
  EXPECT_EQ(with([](Log& log) { log.time[4] = nan; }), "time[4]: must be finite");
  EXPECT_EQ(with([](Log& log) { log.time[4] = log.time[3]; }), "time[4]: must rise");
  EXPECT_EQ(with([](Log& log) { log.time[4] = log.time[3] + 0.4 * T; }),
            "time[4]: has a step of less than half a sample, which is");
  EXPECT_EQ(with([](Log& log) { log.time.back() += 1e7 * T; }),
            "time[29]: must not have more than 1e7 samples from first to last row");
  EXPECT_EQ(with([](Log& log) {
              for (std::size_t k = 3; k < log.y.size(); ++k) log.y[k] = nan;
            }),
            "y: must be measured in more rows than");
  EXPECT_EQ(with(
                [](Log& log) {
                  for (std::size_t k = 4; k < log.y.size(); ++k) log.y[k] = nan;
                },
                {.measurement = 0.01, .disturbance = 1.0}),
            "accepted");
  EXPECT_EQ(with(nothing, {.measurement = 0.0}), "measurement: must be finite and positive");
  EXPECT_EQ(with(nothing, {.disturbance = -1.0}), "disturbance: must be finite and not negative");
  EXPECT_EQ(with(
                [](Log& log) {
                  for (double& y : log.y) y = 0.0;
                  for (double& u : log.u) u = 0.0;
                },
                {}),
            "y: must have noise: give its standard deviation");
  EXPECT_EQ(with([](Log& log) { log.y[7] = 1e308; }, {.measurement = 0.01, .disturbance = 1.0}),
            "y: gives estimates that the scalar cannot hold");
}

/// Two recordings in one log: what lies between them tells nothing of the noise.
TEST(Smooth, FindsTheNoiseBesideAPause) {
  Made m = made(chain(2, 1, 3.0), 2000, 0.003, 0.4, 5, false);
  for (std::size_t k = 1000; k < 2000; ++k) m.log.time[k] += 1000.0;
  const auto found = smooth(m.log, observer<2>(3.0)).value();
  EXPECT_NEAR(*found.noise.measurement, 0.003, 0.1 * 0.003);
  EXPECT_EQ(found.bridged, 50'000u);
}

/// That of a long log is looked for in its middle.
TEST(Smooth, FindsTheNoiseOfTheMiddle) {
  Made m = made(chain(1, 1, 3.0), 30'000, 0.003, 0.1, 5, false);
  for (std::size_t k = 0; k < 30'000; ++k) {
    if (k < 4000 || k >= 26'000) m.log.y[k] += k % 2 == 0 ? 0.1 : -0.1;
  }
  EXPECT_NEAR(*smooth(m.log, observer<1>(3.0))->noise.measurement, 0.003, 0.1 * 0.003);
}

/// Backwards a state that fades grows: what no disturbance holds is lost in roundings.
TEST(Smooth, RefusesWhatFadesForTooLong) {
  const auto errors = [](const auto& fading, std::size_t rows, double disturbance) {
    Log log;
    double y = 0.0;
    for (std::size_t k = 0; k < rows; ++k) {
      log.u.push_back(std::sin(0.13 * static_cast<double>(k)));
      log.y.push_back(y += T * std::cos(0.02 * static_cast<double>(k)));
    }
    return refusal(smooth(log, fading, {.measurement = 0.01, .disturbance = disturbance}));
  };
  const auto too_long =
      "y: has too many samples for a model with an actuator, or with poles and disturbance 0: "
      "leave it out, or filter u by it";
  const auto lag =
      ModelEso<ModelParts{.order = 2, .actuator = 1}>::make({.observer_bandwidth = 10.0,
                                                             .input_gain = 3.0,
                                                             .sample_time = T,
                                                             .model = {.actuator = {0.1}}})
          .value();
  EXPECT_EQ(errors(lag, 50, 1.0), "accepted");
  for (const std::size_t rows : {500u, 2000u, 20'000u}) EXPECT_EQ(errors(lag, rows, 1.0), too_long);
  const auto pole =
      ModelEso<ModelParts{.order = 2, .plant_poles = true}>::make({.observer_bandwidth = 10.0,
                                                                   .input_gain = 3.0,
                                                                   .sample_time = T,
                                                                   .model = {.plant = {0.0, 4.0}}})
          .value();
  EXPECT_EQ(errors(pole, 2000, 1.0), "accepted");
  EXPECT_EQ(errors(pole, 2000, 0.0), too_long);
  const auto part =
      ModelEso<ModelParts{.order = 2, .first_order = 1}>::make({.observer_bandwidth = 10.0,
                                                                .input_gain = 3.0,
                                                                .sample_time = T,
                                                                .model = {.first_order = {0.3}}})
          .value();
  EXPECT_EQ(errors(part, 2000, 1.0), "accepted");
  EXPECT_EQ(errors(observer<2>(3.0), 20'000, 0.0), "accepted");
}

TEST(Smooth, RefusesAnotherClock) {
  const Log good = made(chain(2, 1, 3.0), 200, 0.01, 0.5, 4, false).log;
  const auto with = [&](const auto& change, double noise = 0.01) {
    Log log = good;
    change(log);
    return refusal(smooth(log, observer<2>(3.0), {.measurement = noise}));
  };
  for (const double factor : {0.7, 0.97, 1.03, 1.3, 2.4}) {
    EXPECT_EQ(
        with([&](Log& log) {
          for (double& time : log.time) time = factor * (time - 1.7e9);
        }),
        "time: has a mean step, in whole samples, other than the sample time of the observer");
  }
  EXPECT_EQ(with([](Log& log) {
              for (double& time : log.time) time = 2.0 * (time - 1.7e9);
            }),
            "accepted");
  EXPECT_EQ(with([](Log& log) { log.time[0] = nan; }), "time[0]: must be finite");
  for (const double bad : {-T, nan}) {
    EXPECT_EQ(with([&](Log& log) { log.sample_time = bad; }),
              "sample_time: must be finite and not negative");
  }
  for (const double noise : {1e-160, 1e160}) {
    EXPECT_EQ(with([](Log&) {}, noise), "measurement: must have a square that the scalar can hold");
  }
  EXPECT_EQ(refusal(smooth(good, observer<2>(1e300))),
            "y: gives estimates that the scalar cannot hold");
}

}  // namespace identify_smooth_test
