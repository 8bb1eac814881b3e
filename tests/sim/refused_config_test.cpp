// Every bad config of the simulation part is refused, and the error names the field.
#include <gtest/gtest.h>

#include <esokit/sim/disturbed_plant.hpp>
#include <esokit/sim/metrics.hpp>
#include <esokit/sim/noise.hpp>
#include <esokit/sim/signals.hpp>
#include <limits>
#include <string>
#include <support/refusal.hpp>
#include <vector>

namespace sim_refused_config_test {

using namespace esokit;
using namespace esokit::sim;
using esokit_test::refusal;

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();
constexpr double infinity = std::numeric_limits<double>::infinity();

TEST(RefusedConfig, Signals) {
  for (const double bad : {not_a_number, infinity, -infinity}) {
    EXPECT_EQ(refusal(Constant<>::make({.value = bad})), "value: must be finite");
    EXPECT_EQ(refusal(Step<>::make({.time = bad})), "time: must be finite");
    EXPECT_EQ(refusal(Step<>::make({.size = bad})), "size: must be finite");
    EXPECT_EQ(refusal(Sine<>::make({.amplitude = bad})), "amplitude: must be finite");
    EXPECT_EQ(refusal(Sine<>::make({.angular_frequency = bad})),
              "angular_frequency: must be finite");
    EXPECT_EQ(refusal(Sine<>::make({.phase = bad})), "phase: must be finite");
    EXPECT_EQ(refusal(Sine<>::make({.offset = bad})), "offset: must be finite");
    EXPECT_EQ(refusal(FilteredStep<2>::make({.time = bad})), "time: must be finite");
    EXPECT_EQ(refusal(FilteredStep<2>::make({.size = bad})), "size: must be finite");
    EXPECT_EQ(refusal(FilteredStep<2>::make({.time_constant = bad})),
              "time_constant: must be finite and positive");
  }
  EXPECT_EQ(refusal(FilteredStep<2>::make({.time_constant = 0.0})),
            "time_constant: must be finite and positive");
  EXPECT_EQ(refusal(FilteredStep<2>::make({.time_constant = -1.0})),
            "time_constant: must be finite and positive");
  EXPECT_EQ(refusal(FilteredStep<2>::make({})), "accepted");
  EXPECT_EQ(refusal(Sine<>::make({.angular_frequency = -3.0})), "accepted");
}

TEST(RefusedConfig, Noise) {
  for (const double bad : {not_a_number, infinity, -infinity, -1.0}) {
    EXPECT_EQ(refusal(WhiteNoise<>::make({.standard_deviation = bad})),
              "standard_deviation: must be finite and not negative");
    EXPECT_EQ(refusal(BandLimitedWhiteNoise<>::make({.power = bad})),
              "power: must be finite and not negative");
    EXPECT_EQ(refusal(BandLimitedWhiteNoise<>::make({.hold = bad})),
              "hold: must be finite and positive");
    EXPECT_EQ(refusal(HeldNoise<>::make({.power = bad})), "power: must be finite and not negative");
    EXPECT_EQ(refusal(HeldNoise<>::make({.hold = bad})), "hold: must be finite and positive");
    EXPECT_EQ(refusal(HeldNoise<>::make({.step = bad})), "step: must be finite and positive");
  }
  EXPECT_EQ(refusal(BandLimitedWhiteNoise<>::make({.hold = 0.0})),
            "hold: must be finite and positive");
  EXPECT_EQ(refusal(BandLimitedWhiteNoise<>::make({.power = 1e300, .hold = 1e-300})),
            "power: power/hold must not leave the range of the scalar");
  EXPECT_EQ(refusal(BandLimitedWhiteNoise<>::make({.power = 1e-300, .hold = 1e300})),
            "power: power/hold must not leave the range of the scalar");
  EXPECT_EQ(refusal(HeldNoise<>::make({.step = 0.0})), "step: must be finite and positive");
  EXPECT_EQ(refusal(HeldNoise<>::make({.hold = 0.0105, .step = 0.001})),
            "hold: must be a whole multiple (1 to 2^31) of the step");
  EXPECT_EQ(refusal(HeldNoise<>::make({.hold = 0.0005, .step = 0.001})),
            "hold: must be a whole multiple (1 to 2^31) of the step");
  EXPECT_EQ(refusal(HeldNoise<>::make({.hold = 0.00999, .step = 0.001})),
            "hold: must be a whole multiple (1 to 2^31) of the step");
  EXPECT_EQ(refusal(HeldNoise<>::make({.hold = 1e6, .step = 1e-6})),
            "hold: must be a whole multiple (1 to 2^31) of the step");
  const auto error = HeldNoise<>::make({.hold = 0.0105, .step = 0.001}).error();
  EXPECT_EQ(error.value, 0.0105);
  EXPECT_EQ(error.limit, 0.001);
}

TEST(RefusedConfig, Plants) {
  EXPECT_EQ(refusal(DisturbedPlant<2>::make({})), "c[0]: is of an output that no input reaches");
  auto plant = LinearPlant<2>::chain({}).value();
  EXPECT_EQ(refusal(DisturbedPlant<2>::make({.plant = plant})), "accepted");
  plant.dead_time = 0.1;
  EXPECT_EQ(refusal(DisturbedPlant<2>::make({.plant = plant})),
            "plant.dead_time: must be zero in a continuous simulation");
}

TEST(RefusedConfig, SeriesAndWindow) {
  const std::vector<double> two{0.0, 1.0};
  const std::vector<double> three{0.0, 1.0, 2.0};
  const std::vector<double> descending{0.0, 2.0, 1.0};
  EXPECT_EQ(refusal(Series<>::make({.times = two, .values = three})),
            "times: must have as many elements as values, which has");
  EXPECT_EQ(refusal(Series<>::make({.times = descending, .values = three})),
            "times[2]: must not descend");
  for (const double bad : {not_a_number, infinity, -infinity}) {
    const std::vector<double> spoilt{0.0, bad, 1.0};
    EXPECT_EQ(refusal(Series<>::make({.times = spoilt, .values = three})),
              "times[1]: must be finite");
    EXPECT_EQ(refusal(Series<>::make({.times = three, .values = spoilt})),
              "values[1]: must be finite");
    EXPECT_EQ(refusal(Series<>::make_uniform({.values = spoilt})), "values[1]: must be finite");
    const std::vector<double> first{bad, 0.0, 1.0};
    const std::vector<double> last{0.0, 1.0, bad};
    EXPECT_EQ(refusal(Series<>::make_uniform({.values = first})), "values[0]: must be finite");
    EXPECT_EQ(refusal(Series<>::make_uniform({.values = last})), "values[2]: must be finite");
    EXPECT_EQ(refusal(Series<>::make({.times = first, .values = three})),
              "times[0]: must be finite");
    EXPECT_EQ(refusal(Series<>::make({.times = three, .values = first})),
              "values[0]: must be finite");
    EXPECT_EQ(refusal(Series<>::make_uniform({.start = bad, .values = two})),
              "start: must be finite");
    EXPECT_EQ(refusal(Series<>::make_uniform({.sample_time = bad, .values = two})),
              "sample_time: must be finite and positive");
    EXPECT_EQ(refusal(Window<>::make({.start = bad})), "start: must be finite");
    EXPECT_EQ(refusal(Window<>::make({.end = bad})), "end: must be finite");
  }
  EXPECT_EQ(refusal(Series<>::make_uniform({.sample_time = 0.0, .values = two})),
            "sample_time: must be finite and positive");
  EXPECT_EQ(refusal(Window<>::make({.start = 1.0, .end = 1.0})),
            "end: must be greater than start, which is");
  EXPECT_EQ(refusal(Window<>::make({})), "accepted");
}

TEST(RefusedConfig, StepResponse) {
  for (const double bad : {not_a_number, infinity, -infinity}) {
    EXPECT_EQ(refusal(StepResponse<>::make({.initial_value = bad})),
              "initial_value: must be finite");
    EXPECT_EQ(refusal(StepResponse<>::make({.final_value = bad})), "final_value: must be finite");
    EXPECT_EQ(refusal(StepResponse<>::make({.step_time = bad})), "step_time: must be finite");
    EXPECT_EQ(refusal(StepResponse<>::make({.band = bad})), "band: must be finite and positive");
    EXPECT_EQ(refusal(StepResponse<>::make({.rise_from = bad})), "rise_from: must be finite");
    EXPECT_EQ(refusal(StepResponse<>::make({.rise_to = bad})), "rise_to: must be finite");
  }
  EXPECT_EQ(refusal(StepResponse<>::make({.initial_value = 1.0})),
            "final_value: must differ, by a finite step, from initial_value");
  EXPECT_EQ(refusal(StepResponse<>::make({.initial_value = -1e308, .final_value = 1e308})),
            "final_value: must differ, by a finite step, from initial_value");
  EXPECT_EQ(refusal(StepResponse<>::make({.band = 0.0})), "band: must be finite and positive");
  EXPECT_EQ(refusal(StepResponse<>::make({.rise_from = 0.9})),
            "rise_to: must be greater than rise_from, which is");
  const std::vector<double> values{0.0, 1.0};
  const auto series = Series<>::make_uniform({.values = values}).value();
  EXPECT_EQ(refusal(step_response(series, {.band = -1.0})), "band: must be finite and positive");
}

}  // namespace sim_refused_config_test
