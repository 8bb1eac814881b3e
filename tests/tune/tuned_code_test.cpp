// The C of the designs of tune: of each there is one, it keeps the limits and the gains of the
// design, and compiles; what with_controller cannot make is refused.
#include <gtest/gtest.h>

#include <esokit/tune/tuned_code.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace tune_tuned_code_test {

#if defined(ESOKIT_LOADS_C) && !defined(ESOKIT_ONE_TYPE)

using namespace esokit;

TEST(TunedCode, IsThereForEachDesign) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  TuneModel model;
  model.order = 1;
  model.input_gain = {-2.0, 0.1};
  model.sample_time = 0.005;
  model.lag = 0.01;
  model.noise = 1e-3;
  model.disturbance = 20.0;
  model.u_min = -5.0;
  model.u_max = 4.0;
  const auto tuning = tune(model).value();
  int lags = 0;
  int cascades = 0;
  for (const TunedDesign& design : tuning.designs) {
    SCOPED_TRACE(design.name);
    const auto code = tuned_code<1, float>(model, design, {.name = "loop"});
    ASSERT_TRUE(code) << code.error().rule;
    EXPECT_NE(code->structured_text.find("FUNCTION_BLOCK loop"), std::string::npos);
    const Folder folder;
    InC<float> in_c(folder, code->c, true);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(0.0f), 0);
    EXPECT_EQ(in_c.update(1e6f, 0.0f), 4.0f);
    EXPECT_EQ(in_c.update(-1e9f, 0.0f), -5.0f);
    // Around an actuator with a dead zone the limits are of u, those of the model of its effect.
    const auto curve = ActuatorCurve<double, 3>::dead_zone(1);
    const auto mapped = tuned_code<1, float>(model, design, curve, {.name = "loop"});
    ASSERT_TRUE(mapped) << mapped.error().rule;
    EXPECT_NE(mapped->structured_text.find("FUNCTION_BLOCK loop"), std::string::npos);
    InC<float> behind(folder, mapped->c, true);
    ASSERT_TRUE(behind.loaded());
    EXPECT_EQ(behind.self_test(0.0f), 0);
    EXPECT_FLOAT_EQ(behind.update(1e6f, 0.0f), 5.0f);
    EXPECT_FLOAT_EQ(behind.update(-1e9f, 0.0f), -6.0f);
    const auto straight =
        tuned_code<1, float>(model, design, ActuatorCurve<double, 3>{}, {.name = "loop"});
    EXPECT_EQ(straight.value().c.source, code->c.source);
    EXPECT_EQ(straight.value().structured_text, code->structured_text);
    lags += design.knows.lag;
    cascades += design.levels > 1;
  }
  EXPECT_GT(lags, 0);
  EXPECT_GT(cascades, 0);
  EXPECT_TRUE(tuned_code<1>(model, tuning.designs[0], {}));
  EXPECT_STREQ(tuned_code<1>(model, tuning.designs[0], {.name = "2"}).error().field, "name");
  const ActuatorCurve<double> falls{.slope_above = -1};
  EXPECT_STREQ(tuned_code<1>(model, tuning.designs[0], falls).error().field, "curve.slope_above");
  TunedDesign sensor = tuning.designs[0];
  sensor.knows.sensor = true;
  EXPECT_STREQ(tuned_code<1>(model, sensor).error().field, "knows");
}

#endif

}  // namespace tune_tuned_code_test
}  // namespace esokit_test
