// Every bad config of the simulation part is refused, and the error names the field.
#include <gtest/gtest.h>

#include <esokit/sim/metrics.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/plant.hpp>
#include <esokit/sim/recorder.hpp>
#include <esokit/sim/signals.hpp>
#include <limits>
#include <string>
#include <vector>

namespace {

using namespace esokit;
using namespace esokit::sim;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

/// `field` or `field[index]`, empty if the config was accepted.
template <class Made>
std::string refused(const Made& made) {
  if (made) return "";
  const auto& error = made.error();
  EXPECT_STRNE(error.rule, "");
  std::string name = error.field;
  if (error.index >= 0) name += "[" + std::to_string(error.index) + "]";
  return name;
}

TEST(RefusedConfig, Signals) {
  for (const double bad : {not_a_number, infinity, -infinity}) {
    EXPECT_EQ(refused(Constant<>::make({.value = bad})), "value");
    EXPECT_EQ(refused(Step<>::make({.time = bad})), "time");
    EXPECT_EQ(refused(Step<>::make({.size = bad})), "size");
    EXPECT_EQ(refused(Ramp<>::make({.time = bad})), "time");
    EXPECT_EQ(refused(Ramp<>::make({.slope = bad})), "slope");
    EXPECT_EQ(refused(Polynomial<2>::make({.coefficients = {1, 2, bad}})), "coefficients[2]");
    EXPECT_EQ(refused(Polynomial<2>::make({.origin = bad})), "origin");
    EXPECT_EQ(refused(Sine<>::make({.amplitude = bad})), "amplitude");
    EXPECT_EQ(refused(Sine<>::make({.angular_frequency = bad})), "angular_frequency");
    EXPECT_EQ(refused(Sine<>::make({.phase = bad})), "phase");
    EXPECT_EQ(refused(Sine<>::make({.offset = bad})), "offset");
    EXPECT_EQ(refused(FilteredStep<2>::make({.time = bad})), "time");
    EXPECT_EQ(refused(FilteredStep<2>::make({.size = bad})), "size");
    EXPECT_EQ(refused(FilteredStep<2>::make({.time_constant = bad})), "time_constant");
    EXPECT_EQ(refused(SwitchedOn<Constant<>>::make({.time = bad})), "time");
  }
  EXPECT_EQ(refused(FilteredStep<2>::make({.time_constant = 0.0})), "time_constant");
  EXPECT_EQ(refused(FilteredStep<2>::make({.time_constant = -1.0})), "time_constant");
  EXPECT_EQ(refused(FilteredStep<2>::make({})), "");
  EXPECT_EQ(refused(Sine<>::make({.angular_frequency = -3.0})), "");
}

TEST(RefusedConfig, Noise) {
  for (const double bad : {not_a_number, infinity, -infinity, -1.0}) {
    EXPECT_EQ(refused(WhiteNoise<>::make({.standard_deviation = bad})), "standard_deviation");
    EXPECT_EQ(refused(BandLimitedWhiteNoise<>::make({.power = bad})), "power");
    EXPECT_EQ(refused(BandLimitedWhiteNoise<>::make({.hold = bad})), "hold");
    EXPECT_EQ(refused(HeldNoise<>::make({.power = bad})), "power");
    EXPECT_EQ(refused(HeldNoise<>::make({.hold = bad})), "hold");
    EXPECT_EQ(refused(HeldNoise<>::make({.step = bad})), "step");
  }
  EXPECT_EQ(refused(BandLimitedWhiteNoise<>::make({.hold = 0.0})), "hold");
  EXPECT_EQ(refused(BandLimitedWhiteNoise<>::make({.power = 1e300, .hold = 1e-300})), "power");
  EXPECT_EQ(refused(BandLimitedWhiteNoise<>::make({.power = 1e-300, .hold = 1e300})), "power");
  EXPECT_EQ(refused(HeldNoise<>::make({.step = 0.0})), "step");
  EXPECT_EQ(refused(HeldNoise<>::make({.hold = 0.0105, .step = 0.001})), "hold");
  EXPECT_EQ(refused(HeldNoise<>::make({.hold = 0.0005, .step = 0.001})), "hold");
  EXPECT_EQ(refused(HeldNoise<>::make({.hold = 0.00999, .step = 0.001})), "hold");
  EXPECT_EQ(refused(HeldNoise<>::make({.hold = 1e6, .step = 1e-6})), "hold");
  const auto error = HeldNoise<>::make({.hold = 0.0105, .step = 0.001}).error();
  EXPECT_EQ(error.value, 0.0105);
  EXPECT_EQ(error.limit, 0.001);
}

TEST(RefusedConfig, Plants) {
  for (const double bad : {not_a_number, infinity, -infinity, 0.0}) {
    EXPECT_EQ(refused(IntegratorChainPlant<2>::make({.input_gain = bad})), "input_gain");
    EXPECT_EQ(refused(LinearPlant<2>::make({.input_gain = bad})), "input_gain");
  }
  EXPECT_EQ(refused(LinearPlant<2>::make({.coefficients = {1.0, not_a_number}})),
            "coefficients[1]");
  EXPECT_EQ(refused(LinearPlant<2>::make({.coefficients = {infinity, 1.0}})), "coefficients[0]");
  EXPECT_EQ(refused(IntegratorChainPlant<2>::make({.input_gain = -1.0})), "");
}

TEST(RefusedConfig, Recorder) {
  EXPECT_EQ(refused(Recorder<2>::make({.names = {"a", "b"}})), "capacity");
  EXPECT_EQ(refused(Recorder<2>::make({.names = {"a", "b"}, .capacity = SIZE_MAX})), "capacity");
  EXPECT_EQ(refused(Recorder<2>::make({.names = {"a"}, .capacity = 1})), "names[1]");
  EXPECT_EQ(refused(Recorder<2>::make({.names = {"a", "a"}, .capacity = 1})), "names[1]");
  for (const char* bad : {"a,b", "a\"", "a\nb", "a\r"}) {
    EXPECT_EQ(refused(Recorder<2>::make({.names = {bad, "b"}, .capacity = 1})), "names[0]");
  }
}

TEST(RefusedConfig, SeriesAndWindow) {
  const std::vector<double> two{0.0, 1.0};
  const std::vector<double> three{0.0, 1.0, 2.0};
  const std::vector<double> descending{0.0, 2.0, 1.0};
  EXPECT_EQ(refused(Series<>::make({.times = two, .values = three})), "times");
  EXPECT_EQ(refused(Series<>::make({.times = descending, .values = three})), "times[2]");
  for (const double bad : {not_a_number, infinity, -infinity}) {
    const std::vector<double> spoilt{0.0, bad, 1.0};
    EXPECT_EQ(refused(Series<>::make({.times = spoilt, .values = three})), "times[1]");
    EXPECT_EQ(refused(Series<>::make({.times = three, .values = spoilt})), "values[1]");
    EXPECT_EQ(refused(Series<>::make_uniform({.values = spoilt})), "values[1]");
    const std::vector<double> first{bad, 0.0, 1.0};
    const std::vector<double> last{0.0, 1.0, bad};
    EXPECT_EQ(refused(Series<>::make_uniform({.values = first})), "values[0]");
    EXPECT_EQ(refused(Series<>::make_uniform({.values = last})), "values[2]");
    EXPECT_EQ(refused(Series<>::make({.times = first, .values = three})), "times[0]");
    EXPECT_EQ(refused(Series<>::make({.times = three, .values = first})), "values[0]");
    EXPECT_EQ(refused(Series<>::make_uniform({.start = bad, .values = two})), "start");
    EXPECT_EQ(refused(Series<>::make_uniform({.sample_time = bad, .values = two})), "sample_time");
    EXPECT_EQ(refused(Window<>::make({.start = bad})), "start");
    EXPECT_EQ(refused(Window<>::make({.end = bad})), "end");
  }
  EXPECT_EQ(refused(Series<>::make_uniform({.sample_time = 0.0, .values = two})), "sample_time");
  EXPECT_EQ(refused(Window<>::make({.start = 1.0, .end = 1.0})), "end");
  EXPECT_EQ(refused(Window<>::make({})), "");
}

TEST(RefusedConfig, StepResponse) {
  for (const double bad : {not_a_number, infinity, -infinity}) {
    EXPECT_EQ(refused(StepResponse<>::make({.initial_value = bad})), "initial_value");
    EXPECT_EQ(refused(StepResponse<>::make({.final_value = bad})), "final_value");
    EXPECT_EQ(refused(StepResponse<>::make({.step_time = bad})), "step_time");
    EXPECT_EQ(refused(StepResponse<>::make({.band = bad})), "band");
    EXPECT_EQ(refused(StepResponse<>::make({.rise_from = bad})), "rise_from");
    EXPECT_EQ(refused(StepResponse<>::make({.rise_to = bad})), "rise_to");
  }
  EXPECT_EQ(refused(StepResponse<>::make({.initial_value = 1.0})), "final_value");
  EXPECT_EQ(refused(StepResponse<>::make({.initial_value = -1e308, .final_value = 1e308})),
            "final_value");
  EXPECT_EQ(refused(StepResponse<>::make({.band = 0.0})), "band");
  EXPECT_EQ(refused(StepResponse<>::make({.rise_from = 0.9})), "rise_to");
  const std::vector<double> values{0.0, 1.0};
  const auto series = Series<>::make_uniform({.values = values}).value();
  EXPECT_EQ(refused(step_response(series, {.band = -1.0})), "band");
}

}  // namespace
