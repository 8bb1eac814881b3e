// From w to y: the analysis is what the loop does, sample by sample.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <esokit/analysis/measured_response.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <numbers>
#include <vector>

namespace esokit_test {
namespace analysis_measured_response_test {

using namespace esokit;
using Complex = std::complex<double>;
constexpr double T = 0.01;

/// The sine at this frequency in y, in the end, of y' = f(w) + b0 u, computed in small parts.
template <class Controller>
Complex played(Controller loop, double b0, const MeasuredInput<double>& truth, double frequency,
               int period) {
  double y = 0, f = 0;
  std::vector<double> w;
  Complex sum = 0;
  const int settled = period * (static_cast<int>(20 / (period * T)) + 2);
  for (int k = 0; k < settled + 2 * period; ++k) {
    w.push_back(std::sin(frequency * k * T));
    loop.measured(w.back());
    const double u = loop.update(y, 0.0);
    if (k >= settled) sum += y * std::polar(1.0, -frequency * k * T) / (2.0 * period);
    constexpr int parts = 40;
    const double h = T / parts;
    for (int i = 0; i < parts; ++i) {
      const auto at =
          static_cast<int>(std::floor((k * T + (i + 0.5) * h - truth.dead_time) / T + 1e-9));
      const double arrives = at < 0 ? 0 : w[static_cast<std::size_t>(at)];
      const double reach = truth.lag > 0 ? -std::expm1(-h / truth.lag) : 1;
      const double mean = truth.lag > 0 ? arrives + (f - arrives) * truth.lag / h * reach : arrives;
      f += reach * (arrives - f);
      y += h * (truth.gain * mean + b0 * u);
    }
  }
  return sum * Complex(0, 2);
}

template <class Form, class O>
void expect_as_played(const typename Adrc<O, Form>::Config& config) {
  const double b0 = chain_config<O>(config.observer).input_gain;
  const auto plant = LinearPlant<1>::chain({.input_gain = b0}).value();
  const auto loop = Adrc<O, Form>::make(config).value();
  ASSERT_TRUE(closed_loop(plant, loop)->stable());
  for (const int period : {1256, 209, 31, 5}) {
    const double frequency = 2 * std::numbers::pi / (period * T);
    for (const MeasuredInput<double>& truth :
         {MeasuredInput<double>{3, 0.1, 0.0225}, MeasuredInput<double>{-1, 0, 0.03}}) {
      const auto found = measured_to_output(plant, loop, truth, frequency);
      ASSERT_TRUE(found.has_value()) << found.error().field;
      const Complex seen = played(loop, b0, truth, frequency, period);
      EXPECT_LT(std::abs(*found - seen), 1e-8 * (1e-3 + std::abs(seen)))
          << period << *found << seen;
    }
  }
}

template <class O>
typename Measured<O, 1, 5>::Config told(double b0 = 2) {
  typename Measured<O, 1, 5>::Config config{};
  auto& chain = chain_config<O>(config.observer);
  chain.observer_bandwidth = 20;
  chain.input_gain = b0;
  chain.sample_time = T;
  config.inputs[0] = {2.1, 0.07, 0.0175};
  return config;
}

TEST(MeasuredToOutput, IsWhatTheLoopDoes) {
  using Plain = Measured<LinearEso<1>, 1, 5>;
  for (const double b0 : {2.0, -2.0}) {
    expect_as_played<OutputBased, Plain>(
        {.observer = told<LinearEso<1>>(b0), .controller_bandwidth = 4});
    expect_as_played<ErrorBased, Plain>(
        {.observer = told<LinearEso<1>>(b0), .controller_bandwidth = 4});
  }
  auto cascade = told<CascadeEso<1, 2>>();
  cascade.observer.bandwidth_factor = 1.5;
  expect_as_played<OutputBased, Measured<CascadeEso<1, 2>, 1, 5>>(
      {.observer = cascade, .controller_bandwidth = 4});
  expect_as_played<OutputBased, Guarded<Plain>>(
      {.observer = {.observer = told<LinearEso<1>>()}, .controller_bandwidth = 4});
  expect_as_played<OutputBased, DelayedInput<Plain, 2>>(
      {.observer = {.observer = told<LinearEso<1>>(), .delay = 2}, .controller_bandwidth = 4});
  using Model = ModelEso<ModelParts{.order = 1, .plant_poles = true}>;
  auto poles = told<Model>();
  poles.observer.model.plant = {0.5};
  expect_as_played<OutputBased, Measured<Model, 1, 5>>(
      {.observer = poles, .controller_bandwidth = 4});
  using Lagging = ModelEso<ModelParts{.order = 1, .actuator = 1}>;
  auto lagging = told<Lagging>();
  lagging.observer.model.actuator.time_constant = 0.02;
  expect_as_played<OutputBased, Measured<Lagging, 1, 5>>(
      {.observer = lagging, .controller_bandwidth = 4});
}

TEST(MeasuredToOutput, OfAGainWrongBy30PercentIs30Percent) {
  const auto plant = LinearPlant<1>::chain({.input_gain = 2}).value();
  const MeasuredInput<double> truth{3, 0.1, 0.02};
  const auto of = [&](double factor, double frequency) {
    auto config = told<LinearEso<1>>();
    config.inputs[0] = {3 * factor, 0.1, 0.02};
    const auto loop =
        Adrc<Measured<LinearEso<1>, 1, 5>>::make({.observer = config, .controller_bandwidth = 4})
            .value();
    return measured_to_output(plant, loop, truth, frequency).value();
  };
  for (const double frequency : {0.01, 0.3, 4.0, 60.0}) {
    const double nothing = std::abs(of(0, frequency));
    EXPECT_NEAR(std::abs(of(0.7, frequency)) / nothing, 0.3, 1e-9);
    EXPECT_NEAR(std::abs(of(1.3, frequency)) / nothing, 0.3, 1e-9);
    EXPECT_LT(std::abs(of(1, frequency)) / nothing, 1e-10);
  }
}

TEST(MeasuredToOutput, RefusesWhatIsNotThere) {
  const auto plant = LinearPlant<1>::chain({.input_gain = 2}).value();
  const auto loop = Adrc<Measured<LinearEso<1>, 1, 5>>::make(
                        {.observer = told<LinearEso<1>>(), .controller_bandwidth = 4})
                        .value();
  const auto field = [&](const MeasuredInput<double>& truth, double frequency, int input = 0) {
    const auto found = measured_to_output(plant, loop, truth, frequency, input);
    return found ? "" : found.error().field;
  };
  EXPECT_STREQ(field({1, 0, 9.9}, 1), "");
  EXPECT_STREQ(field({1, 0, 10.1}, 1), "inputs.dead_time");
  EXPECT_STREQ(field({1, -1, 0}, 1), "inputs.lag");
  EXPECT_STREQ(field({1, 0, 0}, 0), "frequency");
  EXPECT_STREQ(field({1, 0, 0}, 1, 1), "input");
}

}  // namespace analysis_measured_response_test
}  // namespace esokit_test
