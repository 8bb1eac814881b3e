// The self-test of written C reaches nearly all of it, and fails where the C was changed.
#include <target/written.hpp>

#include <esokit/control/adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/control/smooth_profile.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/profile_code.hpp>
#include <string>
#include <vector>

namespace esokit_test {
namespace target_c_self_test_test {

#ifdef ESOKIT_LOADS_C

using namespace esokit;

using Observer = LinearEso<2, float>;

Observer::Config settings_of_observer() {
  return {.observer_bandwidth = 100, .input_gain = 50, .sample_time = 1e-3F, .max_gap = 10};
}

template <class C>
C controller() {
  typename C::Config settings{};
  settings.observer = {.observer_bandwidth = 100,
                       .input_gain = 50,
                       .sample_time = typename C::scalar_type(1e-3),
                       .max_gap = 10};
  settings.controller_bandwidth = 15;
  settings.limits.lower = -5;
  settings.limits.upper = 5;
  return C::make(settings).value();
}

TEST(CSelfTest, ReachesNearlyAll) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  const CodeOptions loop{.name = "loop"};
  reaches(to_c(Observer::make(settings_of_observer()).value(), loop).value());
  reaches(to_c(controller<Adrc<Observer>>(), loop).value());
  reaches(to_c(controller<PredictiveAdrc<Observer>>(), loop).value());
}

TEST(CSelfTest, ReachesNearlyAllOfAProfile) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  SmoothProfileConfig<2, float> settings{.sample_time = 0.004F};
  settings.limits = {3.0F, 20.0F};
  reaches(to_c(SmoothProfile<2, float>::make(settings).value(), {.name = "loop"}).value());
  reaches(to_c(FollowProfile<2>::make({.limits = {0.3, 20}, .sample_time = 0.004}).value(),
               {.name = "loop"})
              .value());
}

template <class C>
CCode in_integers() {
  FixedPointOptions options;
  options.y = {.unit = 6.2831853 / 4096, .most = 2048};
  options.u = {.unit = 0.01, .most = 1000};
  options.code.name = "loop";
  return to_fixed_c(controller<C>(), options).value().code;
}

TEST(CSelfTest, ReachesNearlyAllInIntegers) {
  if (!there("gcc") || !there("gcov")) GTEST_SKIP() << "no gcov";
  reaches(in_integers<Adrc<LinearEso<2>>>(), "");
}

/// Where r and the y of its plant are beyond the scalar.
TEST(CSelfTest, HasNumbers) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  for (const float time : {0.01F, 10.0F}) {
    const auto controller = Adrc<Observer>::make({.observer = {.observer_bandwidth = 0.1F / time,
                                                               .input_gain = 1e34F,
                                                               .sample_time = time},
                                                  .controller_bandwidth = 0.01F / time,
                                                  .limits = {.lower = -1e5F, .upper = 1e5F}})
                                .value();
    const Folder folder;
    InC<float> in_c(folder, to_c(controller, {.name = "loop"}).value(), true);
    ASSERT_TRUE(in_c.loaded()) << time;
    EXPECT_EQ(in_c.self_test(0), 0) << time;
  }
}

TEST(CSelfTest, FailsWhereTheCodeWasChanged) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  notices(to_c(controller<Adrc<Observer>>(), {.name = "loop"}).value(),
          {{"row = elapsed - 1u", "row = 0u * elapsed"},
           {"o->gap > ROWS", "o->gap > 60000u"},
           {"o->gap >= MISSING_LIMIT", "o->gap >= 60000u"},
           {"(status & LOOP_RESTARTED) != 0u", "status > 999u"},
           {"u = commanded(o)", "u = 0.5f * commanded(o)"},
           {"o->elsewhere != 0u", "o->elsewhere > 9u"},
           {"*o = before;", "o->z1 = before.z1;"},
           {"fabsf(y) < fabsf(o->z1)", "fabsf(y) > fabsf(o->z1)"},
           {"held = o->u_applied", "held = 0.0f * o->u_applied"}},
          0.0F);
}

/// Also where only what is reported is another.
TEST(CSelfTest, FailsWhereAStatusWasChanged) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const CodeOptions loop{.name = "loop"};
  const std::vector<Change> of_observers{
      {"status = LOOP_MEASUREMENT_REJECTED", "status = 0u"},
      {"status = LOOP_INPUT_REJECTED;", "status = 0u;"},
      {"status = LOOP_GAP_BRIDGED", "status = 0u"},
      {"status = LOOP_RESTARTED", "status = LOOP_GAP_BRIDGED"},
      {"(elapsed > 1u)", "(elapsed > 2u)"},
      {"return status | correct_plain(o, y)", "return (status & 0u) | correct_plain(o, y)"}};
  // No call of a loop's self-test leads where its kept u cannot be predicted with, either.
  std::vector<Change> alone = of_observers;
  alone.insert(alone.end(),
               {{"LOOP_INPUT_REJECTED | LOOP_PREDICTION_DROPPED", "LOOP_PREDICTION_DROPPED"},
                {"LOOP_INPUT_REJECTED | LOOP_PREDICTION_DROPPED", "LOOP_INPUT_REJECTED"}});
  notices(to_c(Observer::make(settings_of_observer()).value(), loop).value(), alone, 0.0F);
  std::vector<Change> of_loops = of_observers;
  of_loops.insert(of_loops.end(),
                  {{"return LOOP_STATE_REJECTED", "return 0u"},
                   {"return LOOP_INPUT_REJECTED", "return 0u"},
                   {"(o->status | LOOP_REFERENCE_REJECTED)", "LOOP_REFERENCE_REJECTED"},
                   {"(o->status | LOOP_REFERENCE_REJECTED)", "(o->status)"},
                   {"o->status = (uint16_t)status", "o->status |= (uint16_t)status"},
                   {"o->mode = LOOP_SAFE", "o->mode = LOOP_RUNNING"},
                   {"  o->mode = LOOP_RUNNING;\n  o->elsewhere = 1u", "  o->elsewhere = 1u"}});
  notices(to_c(controller<Adrc<Observer>>(), loop).value(), of_loops, 0.0F);
  notices(to_c(controller<PredictiveAdrc<Observer>>(), loop).value(),
          {{"status = LOOP_MEASUREMENT_REJECTED", "status = 0u"},
           {"status = LOOP_GAP_BRIDGED", "status = 0u"},
           {"status = LOOP_RESTARTED", "status = LOOP_GAP_BRIDGED"},
           {"return LOOP_STATE_REJECTED", "return 0u"},
           {"status = LOOP_STATE_REJECTED", "status = 0u"},
           {"return LOOP_INPUT_REJECTED", "return 0u"},
           {"(o->status | LOOP_REFERENCE_REJECTED)", "(o->status)"},
           {"o->status = (uint16_t)status", "o->status |= (uint16_t)status"},
           {"o->mode = LOOP_SAFE", "o->mode = LOOP_RUNNING"}},
          0.0F);
}

TEST(CSelfTest, FailsWhereIntegersWereChanged) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  notices(in_integers<Adrc<LinearEso<2>>>(),
          {{"o->gap != GAP_MOST", "o->gap != 1u"},
           {"o->gap >= MISSING_LIMIT", "o->gap > MISSING_LIMIT + 9u"},
           {"held = -most", "held = most"},
           {"o->u_held = -U_MOST;\n    status = LOOP_INPUT_REJECTED",
            "o->u_held = -U_MOST;\n    status = 0u"},
           {"return LOOP_MEASUREMENT_REJECTED", "return 0u"},
           {"o->gap = 0u;\n  } else", "o->gap = 1u;\n  } else"}});
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_self_test_test
}  // namespace esokit_test
