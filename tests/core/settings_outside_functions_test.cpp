// Settings as constants and variables outside a function, where a program often keeps them. Clang
// 14 crashed at those with a string or a vector (the constant of a struct whose first member has no
// room): that this file compiles is the test.
#include <esokit/control/adrc.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <esokit/target/fixed_options.hpp>

#include <gtest/gtest.h>

namespace esokit_test {
namespace core_settings_outside_functions_test {

using namespace esokit;

const CodeOptions code{.self_test_samples = 1};
CodeOptions named_code{.name = "motor"};
const FixedPointOptions fixed{};
FixedPointOptions other_fixed{.most_deviation = {1, 2}};
const IdentifyOptions identify_options{};
IdentifyOptions other_identify_options{.orders = {2}};

using Loop = Adrc<LinearEso<2>>;
const Loop::Config constant{
    .observer = {.observer_bandwidth = 20, .input_gain = 2, .sample_time = 1e-2},
    .controller_bandwidth = 5};
constexpr Loop::Config at_compile_time{
    .observer = {.observer_bandwidth = 20, .input_gain = 2, .sample_time = 1e-2},
    .controller_bandwidth = 5};
Loop::Config variable{.observer = {.observer_bandwidth = 20, .input_gain = 2, .sample_time = 1e-2},
                      .controller_bandwidth = 5};
const CascadeEso<2, 3>::Config cascade{
    .observer_bandwidth = 20, .input_gain = 2, .sample_time = 1e-2};

TEST(SettingsOutsideFunctions, HaveTheirValues) {
  EXPECT_EQ(code.name, "controller");
  EXPECT_EQ(code.self_test_samples, 1);
  EXPECT_EQ(named_code.name, "motor");
  EXPECT_TRUE(fixed.most_deviation.empty());
  EXPECT_EQ(other_fixed.most_deviation.size(), 2u);
  EXPECT_EQ(identify_options.orders.size(), 3u);
  EXPECT_EQ(other_identify_options.orders.size(), 1u);
  EXPECT_EQ(constant.controller_bandwidth, 5);
  EXPECT_EQ(at_compile_time.controller_bandwidth, 5);
  EXPECT_EQ(variable.controller_bandwidth, 5);
  EXPECT_EQ(cascade.observer_bandwidth, 20);
}

}  // namespace core_settings_outside_functions_test
}  // namespace esokit_test
