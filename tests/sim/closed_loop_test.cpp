// Closed loops: the paper way against the exact solution, the deployment way against a hand-written
// loop and against the paper way as T -> 0, refused configs.
#include <gtest/gtest.h>
#include <esokit/sim/continuous_observer.hpp>

#include <algorithm>
#include <cmath>
#include <esokit/control/adrc_law.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/closed_loop.hpp>
#include <esokit/sim/noise.hpp>
#include <limits>
#include <string>
#include <support/exponential.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace sim_closed_loop_test {

using namespace esokit;
using namespace esokit::sim;
using esokit_test::refusal;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr auto ignore = [](const auto&) {};

// ---- the paper way against the exact solution of a linear loop ----

// Plant y'' = 0.7 - 2 y - 0.5 y' + 1.5 u, b0 = 1.2 in observer and law, reference r = sin(3 t),
// gains 4, 4, error-based form: the observer is fed r - y - v. With the reference and the constant
// as states all of it is s' = A s + B v,  s = (x1, x2, zhat.., sin 3t, cos 3t, 1).
constexpr double plant_gain = 1.5;
constexpr double b0 = 1.2;
constexpr double frequency = 3.0;
constexpr double offset = 0.7;

/// y^(n) + a_(n-1) y^(n-1) + .. + a_0 y = b0 u + d
template <int Order, class S = double>
DisturbedPlant<Order, S> disturbed(const typename LinearPlant<Order, S>::Chain& chain, S d = 0) {
  return DisturbedPlant<Order, S>::make({.plant = LinearPlant<Order, S>::chain(chain).value(),
                                         .disturbance = Constant<S>::make({.value = d}).value()})
      .value();
}
DisturbedPlant<2> linear_plant() {
  return disturbed<2>({.coefficients = {2.0, 0.5}, .input_gain = plant_gain}, offset);
}
constexpr auto sine_reference = [](double t) { return std::sin(frequency * t); };
constexpr auto error_law = [](double, const EigenMatrix<double, 3>& e) {
  return (e(2) + 4.0 * e(0) + 4.0 * e(1)) / b0;
};

// Level i of the cascade in the paper's own coordinates, equation (23); one level is the LESO.
struct ExactLoop {
  int size;
  Eigen::MatrixXd a;
  Eigen::VectorXd b;

  explicit ExactLoop(const std::vector<double>& bandwidths)
      : size(2 + 3 * static_cast<int>(bandwidths.size()) + 3),
        a(Eigen::MatrixXd::Zero(size, size)),
        b(Eigen::VectorXd::Zero(size)) {
    const auto levels = static_cast<int>(bandwidths.size());
    const int sine = 2 + 3 * levels;
    const int one = sine + 2;
    // u = (sum of the levels' disturbances + 4 e + 4 e' of the last level) / b0
    Eigen::RowVectorXd u = Eigen::RowVectorXd::Zero(size);
    for (int i = 0; i < levels; ++i) u(2 + 3 * i + 2) = 1.0 / b0;
    u(2 + 3 * (levels - 1)) = 4.0 / b0;
    u(2 + 3 * (levels - 1) + 1) = 4.0 / b0;

    a(0, 1) = 1.0;
    a(1, 0) = -2.0;
    a(1, 1) = -0.5;
    a(1, one) = offset;
    a.row(1) += plant_gain * u;
    for (int i = 0; i < levels; ++i) {
      const int at = 2 + 3 * i;
      const double w = bandwidths[static_cast<std::size_t>(i)];
      const EigenMatrix<double, 3> l(3.0 * w, 3.0 * w * w, w * w * w);
      a(at, at + 1) += 1.0;
      a(at + 1, at + 2) += 1.0;
      a.row(at + 1) += -b0 * u;
      for (int j = 0; j < i; ++j) a(at + 1, 2 + 3 * j + 2) += 1.0;
      for (int r = 0; r < 3; ++r) {
        a(at + r, at) -= l(r);
        if (i == 0) {
          a(at + r, sine) += l(r);  // the reference
          a(at + r, 0) -= l(r);     // minus the output
          b(at + r) -= l(r);        // minus the noise
        } else {
          a(at + r, at - 3) += l(r);
        }
      }
    }
    a(sine, sine + 1) = frequency;
    a(sine + 1, sine) = -frequency;
  }

  /// Plant state after the noise values were held for `hold` each.
  EigenMatrix<double, 2> end(const std::vector<double>& noise, double hold) const {
    Eigen::MatrixXd held = Eigen::MatrixXd::Zero(size + 1, size + 1);
    held.topLeftCorner(size, size) = a * hold;
    held.topRightCorner(size, 1) = b * hold;
    const Eigen::MatrixXd phi = esokit_test::exponential(held);
    Eigen::VectorXd s = Eigen::VectorXd::Zero(size + 1);
    s(0) = 0.5;
    s(1) = -0.2;
    s(size - 2) = 1.0;  // cos 0
    s(size - 1) = 1.0;
    for (const double v : noise) {
      s(size) = v;
      s = Eigen::VectorXd(phi.lazyProduct(s));
    }
    return {s(0), s(1)};
  }
};

const EigenMatrix<double, 2> start(0.5, -0.2);

template <class Observer>
double distance_to_exact(const Observer& observer, double step, const EigenMatrix<double, 2>& exact,
                         double hold, double noise_power) {
  const auto noise =
      HeldNoise<>::make({.power = noise_power, .hold = hold, .step = step, .seed = 7}).value();
  const ContinuousLoop loop{linear_plant(), observer, error_law, MeasuredError{sine_reference},
                            noise};
  const auto end = loop.run({.duration = 1.0, .step = step, .plant_state = start}, ignore);
  EXPECT_TRUE(end) << (end ? "" : end.error().field);
  EXPECT_TRUE(end->completed);
  EXPECT_NEAR(end->t, 1.0, 1e-12);
  EXPECT_EQ(end->steps, std::lround(1.0 / step));
  return (end->plant_state - exact).norm();
}

std::vector<double> noise_values(double hold, double noise_power) {
  auto noise = HeldNoise<>::make({.power = noise_power, .hold = hold, .step = hold, .seed = 7});
  std::vector<double> values;
  for (int k = 0; k < std::lround(1.0 / hold); ++k) values.push_back(noise->at(k));
  return values;
}

template <class Observer>
void converges_with_order_4(const Observer& observer, const ExactLoop& exact) {
  const double hold = 0.02;
  const double power = 2e-4;  // standard deviation 0.1: the noise drives the loop
  const EigenMatrix<double, 2> end = exact.end(noise_values(hold, power), hold);
  const EigenMatrix<double, 2> quiet = exact.end(noise_values(hold, 0.0), hold);
  EXPECT_GT((end - quiet).norm(), 1e-3);

  const double coarse = distance_to_exact(observer, 0.002, end, hold, power);
  const double fine = distance_to_exact(observer, 0.001, end, hold, power);
  EXPECT_NEAR(std::log2(coarse / fine), 4.0, 0.1);
  EXPECT_LT(distance_to_exact(observer, 0.00025, end, hold, power), 1e-8);
  EXPECT_LT(distance_to_exact(observer, 0.00025, quiet, hold, 0.0), 1e-8);
}

TEST(ContinuousLoop, LinearEsoConvergesToTheExactSolution) {
  const auto eso = ContinuousLinearEso<2>::make({.observer_bandwidth = 20.0, .input_gain = -b0});
  converges_with_order_4(eso.value(), ExactLoop({20.0}));
}

TEST(ContinuousLoop, CascadeConvergesToTheExactSolution) {
  const auto eso = ContinuousCascadeEso<2, 2>::make(
      {.observer_bandwidth = 8.0, .bandwidth_factor = 2.0, .input_gain = -b0});
  converges_with_order_4(eso.value(), ExactLoop({8.0, 16.0}));
}

TEST(ContinuousLoop, OutputBasedFormStartedAtTheTruthIsTheDesignedChain) {
  const double d = -0.4;
  const auto plant = disturbed<2>({.input_gain = -2.0}, d);
  const auto eso = ContinuousLinearEso<2>::make({.observer_bandwidth = 30.0, .input_gain = -2.0});
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 3.0, .input_gain = -2.0}).value();
  const ContinuousLoop loop{
      plant, *eso, [&law](double, const EigenMatrix<double, 3>& z) { return law.control(z, 0.0); }};
  double worst = 0.0;
  const auto end = loop.run({.duration = 2.0,
                             .step = 1e-3,
                             .start_time = 5.0,
                             .plant_state = {1.0, 0.5},
                             .observer_state = {1.0, 0.5, d}},
                            [&](const auto& sample) {
                              const double t = sample.t - 5.0;
                              const double exact = std::exp(-3.0 * t) * (1.0 + 3.5 * t);
                              worst = std::max(worst, std::abs(sample.output - exact));
                              EXPECT_EQ(sample.measurement, sample.output);
                              EXPECT_NEAR(sample.estimate(2), d, 1e-9);
                            });
  EXPECT_LT(worst, 1e-9);
  EXPECT_EQ(end->steps, 2000);
}

// ---- step boundaries ----

/// Notes when it is told that a step begins, and which noise a step shows it.
struct ProbingObserver {
  static constexpr int states = 1;
  using scalar_type = double;
  using State = EigenMatrix<double, 1>;
  using Estimate = EigenMatrix<double, 1>;
  struct Log {
    std::vector<double> begun;
    std::vector<std::vector<double>> fed;  // measurements of the stages of each step
  };
  Log* log;

  State derivative(double, const State&, double y, double) const {
    if (log->fed.empty()) log->fed.emplace_back();  // so that a missing begin_step fails the test
    log->fed.back().push_back(y);
    return State(0.0);
  }
  Estimate estimate(const State& z) const { return z; }
  void begin_step(double t, const State&, double) {
    log->begun.push_back(t);
    log->fed.emplace_back();
  }
};

TEST(ContinuousLoop, StepsBeginBeforeTheirStagesAndHoldTheNoise) {
  ProbingObserver::Log log;
  const auto plant = disturbed<1>({});
  const auto noise = HeldNoise<>::make({.power = 1.0, .hold = 0.2, .step = 0.1, .seed = 3}).value();
  std::vector<double> law_times;
  const auto law = [&law_times](double t, const EigenMatrix<double, 1>&) {
    law_times.push_back(t);
    return 0.0;
  };
  const ContinuousLoop loop{plant, ProbingObserver{&log}, law, MeasuredOutput{}, noise};
  std::vector<double> seen;
  const auto end = loop.run({.duration = 1.0, .step = 0.1},
                            [&](const auto& sample) { seen.push_back(sample.measurement); });
  ASSERT_TRUE(end);
  ASSERT_EQ(seen.size(), 11u);  // both ends
  ASSERT_EQ(log.begun.size(), 10u);
  auto source = noise;
  for (std::size_t k = 0; k < 10; ++k) {
    EXPECT_DOUBLE_EQ(log.begun[k], 0.1 * static_cast<double>(k));
    ASSERT_EQ(log.fed[k].size(), 4u);
    for (const double fed : log.fed[k]) EXPECT_EQ(fed, source.at(static_cast<std::int64_t>(k)));
    EXPECT_EQ(seen[k], source.at(static_cast<std::int64_t>(k)));
  }
  EXPECT_EQ(seen[0], seen[1]);
  EXPECT_NE(seen[1], seen[2]);
  // The law is told the time of each stage: begin, middle or end of a step.
  ASSERT_GE(law_times.size(), 40u);
  for (const double t : law_times) EXPECT_NEAR(t * 20.0, std::round(t * 20.0), 1e-9);
  EXPECT_NEAR(*std::max_element(law_times.begin(), law_times.end()), 1.0, 1e-9);
}

TEST(ContinuousLoop, CallbackMayStopTheRunAndRunsRepeat) {
  const auto eso =
      ContinuousLinearEso<2>::make({.observer_bandwidth = 20.0, .input_gain = -b0}).value();
  const auto noise = HeldNoise<>::make({.power = 1e-4, .hold = 0.1, .step = 0.1, .seed = 3});
  const ContinuousLoop loop{linear_plant(), eso, error_law, MeasuredError{sine_reference},
                            noise.value()};
  const auto stopped = loop.run({.duration = 1.0, .step = 0.01},
                                [](const auto& sample) { return sample.index < 30; });
  EXPECT_FALSE(stopped->completed);
  EXPECT_EQ(stopped->steps, 30);
  EXPECT_NEAR(stopped->t, 0.3, 1e-12);
  EXPECT_EQ(stopped->steps, 30);
  const auto first = loop.run({.duration = 1.0, .step = 0.01}, ignore);
  const auto second = loop.run({.duration = 1.0, .step = 0.01}, ignore);
  EXPECT_EQ(first->plant_state, second->plant_state);
  EXPECT_EQ(first->observer, second->observer);
}

// ---- the deployment way ----

TEST(SampledLoop, EqualsTheHandWrittenLoop) {
  // y'' = d + b0 u under a held input is a polynomial that RK4 integrates exactly.
  const double T = 0.05;
  const double d = 0.6;
  const double held_before = 0.3;
  const auto plant = disturbed<2>({.input_gain = b0}, d);
  const auto eso =
      LinearEso<2>::make({.observer_bandwidth = 15.0, .input_gain = b0, .sample_time = T});
  const auto law = AdrcLaw<2>::make({.controller_bandwidth = 2.0, .input_gain = b0}).value();
  const auto noise = HeldNoise<>::make({.power = 1e-6, .hold = 0.1, .step = T, .seed = 5});
  const auto control = [&law](double t, const EigenMatrix<double, 3>& z) {
    return std::clamp(law.control(z, t < 0.5 ? 0.0 : 1.0), -1.0, 1.0);
  };
  const SampledLoop loop{plant, *eso, control, MeasuredOutput{}, *noise};

  auto observer = *eso;
  auto source = *noise;
  EigenMatrix<double, 2> x(0.1, 0.0);
  double u = held_before;
  std::int64_t k = 0;
  const auto end = loop.run({.duration = 2.0,
                             .sample_time = T,
                             .substeps = 3,
                             .initial_input = held_before,
                             .plant_state = x},
                            [&](const auto& sample) {
                              const double y = x(0) + source.at(k);
                              observer.update(y, u);
                              u = control(static_cast<double>(k) * T, observer.estimate());
                              EXPECT_EQ(sample.index, k);
                              EXPECT_EQ(sample.status, StepStatus::ok);
                              EXPECT_NEAR(sample.output, x(0), 1e-12);
                              EXPECT_NEAR(sample.measurement, y, 1e-12);
                              EXPECT_NEAR(sample.input, u, 1e-9);
                              EXPECT_NEAR(sample.estimate(2), observer.estimate()(2), 1e-9);
                              x(0) += T * x(1) + 0.5 * T * T * (d + b0 * u);
                              x(1) += T * (d + b0 * u);
                              ++k;
                            });
  ASSERT_TRUE(end);
  EXPECT_EQ(k, 41);
  EXPECT_NEAR(end->observer.estimate()(0), observer.estimate()(0), 1e-9);
  EXPECT_EQ(loop.observer.estimate()(0), 0.0);
}

TEST(SampledLoop, SubstepsRefineThePlant) {
  const auto eso =
      LinearEso<2>::make({.observer_bandwidth = 5.0, .input_gain = -b0, .sample_time = 0.5});
  const SampledLoop loop{linear_plant(), *eso, error_law, MeasuredError{sine_reference}};
  const auto end = [&](int substeps) {
    return loop.run({.duration = 2.0, .sample_time = 0.5, .substeps = substeps}, ignore)
        ->plant_state;
  };
  const auto exact = end(512);
  const double order = std::log2((end(4) - exact).norm() / (end(8) - exact).norm());
  EXPECT_NEAR(order, 4.0, 0.3);
}

/// Largest distance of the plant's output from that of the paper way, at the samples of T.
template <class Continuous, class MakeSampled>
double distance_of_ways(const Continuous& continuous, const MakeSampled& make_sampled, double T) {
  const int per_sample = static_cast<int>(std::lround(T / 2.5e-4));
  std::vector<double> reference;
  const ContinuousLoop paper{linear_plant(), continuous, error_law, MeasuredError{sine_reference}};
  EXPECT_TRUE(
      paper.run({.duration = 2.0, .step = 2.5e-4, .plant_state = start}, [&](const auto& sample) {
        if (sample.index % per_sample == 0) reference.push_back(sample.output);
      }));
  const SampledLoop deployed{linear_plant(), make_sampled(T), error_law,
                             MeasuredError{sine_reference}};
  double worst = 0.0;
  EXPECT_TRUE(deployed.run({.duration = 2.0, .sample_time = T, .substeps = 2, .plant_state = start},
                           [&](const auto& sample) {
                             const auto k = static_cast<std::size_t>(sample.index);
                             worst = std::max(worst, std::abs(sample.output - reference[k]));
                           }));
  return worst;
}

template <class Continuous, class MakeSampled>
void tends_with_order_1(const Continuous& continuous, const MakeSampled& make_sampled) {
  const double coarse = distance_of_ways(continuous, make_sampled, 2e-3);
  const double middle = distance_of_ways(continuous, make_sampled, 1e-3);
  const double fine = distance_of_ways(continuous, make_sampled, 5e-4);
  // A limit other than the paper way would bend the second order away from 1.
  EXPECT_NEAR(std::log2(coarse / middle), 1.0, 0.1);
  EXPECT_NEAR(std::log2(middle / fine), 1.0, 0.05);
}

TEST(SampledLoop, LinearEsoTendsToThePaperWay) {
  const auto continuous =
      ContinuousLinearEso<2>::make({.observer_bandwidth = 20.0, .input_gain = -b0});
  tends_with_order_1(continuous.value(), [](double T) {
    return LinearEso<2>::make({.observer_bandwidth = 20.0, .input_gain = -b0, .sample_time = T})
        .value();
  });
}

TEST(SampledLoop, CascadeTendsToThePaperWay) {
  const auto continuous = ContinuousCascadeEso<2, 2>::make(
      {.observer_bandwidth = 8.0, .bandwidth_factor = 2.0, .input_gain = -b0});
  tends_with_order_1(continuous.value(), [](double T) {
    return CascadeEso<2, 2>::make({.observer_bandwidth = 8.0,
                                   .bandwidth_factor = 2.0,
                                   .input_gain = -b0,
                                   .sample_time = T})
        .value();
  });
}

TEST(SampledLoop, ABadSampleIsReported) {
  const auto eso =
      LinearEso<1>::make({.observer_bandwidth = 5.0, .input_gain = 1.0, .sample_time = 0.1});
  const auto broken = [](double t, double y, double) {
    return t > 0.35 && t < 0.45 ? not_a_number : y;
  };
  const SampledLoop loop{disturbed<1>({}), *eso,
                         [](double, const EigenMatrix<double, 2>& z) { return -z(0); }, broken};
  int rejected = 0;
  const auto end =
      loop.run({.duration = 1.0, .sample_time = 0.1, .plant_state = EigenMatrix<double, 1>(1.0)},
               [&](const auto& sample) {
                 if (has(sample.status, StepStatus::measurement_rejected)) ++rejected;
                 EXPECT_TRUE(is_finite(sample.input));
               });
  EXPECT_TRUE(end->completed);
  EXPECT_EQ(rejected, 1);
}

TEST(ClosedLoop, RunsInFloat) {
  const auto eso = LinearEso<1, float>::make(
      {.observer_bandwidth = 20.0f, .input_gain = 1.0f, .sample_time = 0.01f});
  const auto continuous =
      ContinuousLinearEso<1, float>::make({.observer_bandwidth = 20.0f, .input_gain = 1.0f});
  const auto plant = disturbed<1, float>({});
  const auto law = [](float, const EigenMatrix<float, 2>& z) { return 1.0f - z(0) - z(1); };
  const SampledLoop sampled{plant, *eso, law};
  const ContinuousLoop paper{plant, *continuous, law};
  EXPECT_NEAR(sampled.run({.duration = 20.0f, .sample_time = 0.01f}, ignore)->plant_state(0), 1.0f,
              1e-4f);
  EXPECT_NEAR(paper.run({.duration = 20.0f, .step = 0.01f}, ignore)->plant_state(0), 1.0f, 1e-4f);
}

// ---- refused configs ----

TEST(ClosedLoop, RefusesBadConfigs) {
  const auto continuous =
      ContinuousLinearEso<2>::make({.observer_bandwidth = 20.0, .input_gain = -b0}).value();
  const ContinuousLoop paper{linear_plant(), continuous, error_law};
  int called = 0;
  const auto count = [&](const auto&) { ++called; };
  for (const double bad : {not_a_number, infinity, -infinity, 0.0, -1.0}) {
    EXPECT_EQ(refusal(paper.run({.duration = bad, .step = 0.1}, count)),
              "duration: must be finite and positive");
    EXPECT_EQ(refusal(paper.run({.duration = 1.0, .step = bad}, count)),
              "step: must be finite and positive");
  }
  EXPECT_EQ(refusal(paper.run({.duration = 1.0, .step = 0.3}, count)),
            "duration: must be a whole multiple of step, which is");
  EXPECT_EQ(refusal(paper.run({.duration = 0.05, .step = 0.1}, count)),
            "duration: must be a whole multiple of step, which is");
  EXPECT_EQ(refusal(paper.run({.duration = 1e300, .step = 1e-300}, count)),
            "duration: must be a whole multiple of step, which is");
  EXPECT_EQ(refusal(paper.run({.duration = 1e13, .step = 1.0}, count)),
            "duration: must be a whole multiple of step, which is");
  EXPECT_EQ(refusal(paper.run({.duration = 1.0, .step = 0.1, .start_time = infinity}, count)),
            "start_time: must be finite");
  EXPECT_EQ(
      refusal(paper.run({.duration = 1.0, .step = 0.1, .plant_state = {0.0, not_a_number}}, count)),
      "plant_state[1]: must be finite");
  EXPECT_EQ(refusal(paper.run(
                {.duration = 1.0, .step = 0.1, .observer_state = {0.0, 0.0, infinity}}, count)),
            "observer_state[2]: must be finite");

  const auto eso =
      LinearEso<2>::make({.observer_bandwidth = 20.0, .input_gain = -b0, .sample_time = 0.1});
  const SampledLoop deployed{linear_plant(), *eso, error_law};
  for (const double bad : {not_a_number, infinity, -infinity, 0.0, -1.0}) {
    EXPECT_EQ(refusal(deployed.run({.duration = bad, .sample_time = 0.1}, count)),
              "duration: must be finite and positive");
    EXPECT_EQ(refusal(deployed.run({.duration = 1.0, .sample_time = bad}, count)),
              "sample_time: must be finite and positive");
  }
  const auto other = deployed.run({.duration = 1.0, .sample_time = 0.05}, count);
  ASSERT_EQ(refusal(other), "sample_time: must be that of the observer, which is");
  EXPECT_NEAR(other.error().limit, 0.1, 1e-12);
  EXPECT_EQ(refusal(deployed.run({.duration = 0.25, .sample_time = 0.1}, count)),
            "duration: must be a whole multiple of sample_time, which is");
  for (const int bad : {0, -1}) {
    EXPECT_EQ(refusal(deployed.run({.duration = 1.0, .sample_time = 0.1, .substeps = bad}, count)),
              "substeps: must be 1 or more");
  }
  EXPECT_EQ(refusal(deployed.run({.duration = 1.0, .sample_time = 0.1, .start_time = not_a_number},
                                 count)),
            "start_time: must be finite");
  EXPECT_EQ(refusal(deployed.run({.duration = 1.0, .sample_time = 0.1, .initial_input = infinity},
                                 count)),
            "initial_input: must be finite");
  EXPECT_EQ(refusal(deployed.run(
                {.duration = 1.0, .sample_time = 0.1, .plant_state = {infinity, 0.0}}, count)),
            "plant_state[0]: must be finite");
  EXPECT_EQ(called, 0);
  EXPECT_EQ(refusal(deployed.run({.duration = 1.0, .sample_time = 0.1}, count)), "accepted");
  EXPECT_EQ(refusal(paper.run({.duration = 0.3, .step = 0.1}, count)), "accepted");
  EXPECT_EQ(called, 11 + 4);
}

// ---- near misses of the concepts ----

using Paper = ContinuousLinearEso<2>;
using Deployed = LinearEso<2>;
static_assert(ContinuousObserverModel<Paper> && !ContinuousObserverModel<Deployed>);
static_assert(SampledObserverModel<Deployed> && !SampledObserverModel<Paper>);
static_assert(ContinuousObserverModel<ContinuousCascadeEso<4, 3>>);
static_assert(SampledObserverModel<CascadeEso<4, 3, float>>);
static_assert(NoiseSource<NoNoise, double> && NoiseSource<HeldNoise<>, double>);
static_assert(!NoiseSource<WhiteNoise<>, double>);
static_assert(MeasurementMap<MeasuredOutput, double> && !MeasurementMap<Constant<>, double>);
static_assert(ControlFunction<decltype(error_law), double, EigenMatrix<double, 3>>);
static_assert(!ControlFunction<decltype(sine_reference), double, EigenMatrix<double, 3>>);

}  // namespace sim_closed_loop_test
