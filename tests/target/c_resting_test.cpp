// The C of a controller that rests equals it bit for bit; what is refused.
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/measured.hpp>
#include <esokit/adapter/outlier_gate.hpp>
#include <esokit/adapter/variable_time.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/resting.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/fixed_point.hpp>
#include <support/refusal.hpp>
#include <target/written.hpp>

namespace esokit_test {
namespace target_c_resting_test {

using namespace esokit;

template <class Observer, class Form = OutputBased>
using Rests = Resting<Adrc<Observer, Form>>;
using Axis = Rests<LinearEso<2, double>>;

TEST(CResting, SaysWhatItDoesNotWrite) {
  FixedPointOptions counts{};
  counts.y = counts.u = {.unit = 1e-3, .most = 4000};
  const Axis axis = Axis::make(config<Axis>(8)).value();
  EXPECT_EQ(refusal(to_fixed_c(axis, counts)),
            "controller: is in Resting, which is not written in fixed point: keep u yourself while "
            "y is near the reference");
}

#ifdef ESOKIT_LOADS_C

TEST(CResting, EqualsTheLaw) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_controller<Axis>(30000, 1501);
#ifndef ESOKIT_ONE_TYPE
  equals_controller<Rests<LinearEso<1, float>>>(30000, 1511);
  equals_controller<Rests<LinearEso<2, float>, ErrorBased>>(30000, 1521);
  equals_controller<Rests<LinearEso<3, double>>>(30000, 1531);  // it softens
  // A time that is no whole number of samples, none at all, and no band.
  equals_changed<Axis>(30000, 1541, "gcc -std=c99", [](auto& s) { s.rest.time = 0.0118; });
  equals_changed<Axis>(30000, 1551, "gcc -std=c99", [](auto& s) { s.rest.time = 0; });
#endif
}

#ifndef ESOKIT_ONE_TYPE

TEST(CResting, AroundAdapters) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_controller<Rests<WrappedOutput<OutlierGate<LinearEso<2, double>>>>>(30000, 1601);
  equals_controller<Rests<WrappedOutput<LinearEso<1, float>>, ErrorBased>>(30000, 1611);
  equals_controller<Rests<Guarded<LinearEso<2, double>>>>(30000, 1621);
  equals_controller<Rests<Guarded<LinearEso<1, float>>, ErrorBased>>(30000, 1631);
  equals_controller<Rests<MappedInput<DelayedInput<LinearEso<2, float>, 3>>>>(30000, 1641);
  equals_controller<Rests<Measured<CascadeEso<1, 2, double>, 1, 4>>>(30000, 1651);
}

TEST(CResting, WithGainsThatGoOn) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  equals_controller<Rests<AlgebraicEso<2, double>>>(30000, 1701);
  equals_changed<Rests<ExtendedStateFilter<2, float>>>(
      30000, 1711, "gcc -std=c99", [](auto& settings) {
        set_filter(settings.controller.observer, RiccatiMode::recursive, InflationRule::fixed, 9);
      });
}

/// Settings in a struct: another band, and none.
TEST(CResting, Adopts) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  adopts<Rests<LinearEso<2, float>>>(1801, false);
  adopts<Axis>(1811, true);
}

#endif

/// A design of a band that is 0 is that of its controller, to the letter.
TEST(CResting, IsTheControllerWithoutABand) {
  auto settings = config<Axis>(8);
  settings.rest = {};
  const CCode code = to_c(Axis::make(settings).value(), {.name = "loop"}).value();
  const CCode plain =
      to_c(Adrc<LinearEso<2>>::make(settings.controller).value(), {.name = "loop"}).value();
  EXPECT_EQ(code.header, plain.header);
  EXPECT_EQ(code.source, plain.source);
}

/// The C of an object that rests, or is about to, begins there.
TEST(CResting, BeginsWhereTheObjectIs) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  auto settings = config<Axis>(8);
  settings.controller.start_hold = {};
  settings.rest.time = 0.1;
  bool rested[2] = {};
  for (const int before : {3, 7, 12, 30}) {
    Axis axis = Axis::make(settings).value();
    for (int k = 0; k < before; ++k) (void)axis.update(0.125 + 1e-3 * (k % 3), 0.25);
    const bool rests = axis.mode() == LoopMode::rest;
    rested[rests] = true;
    const Folder folder;
    InC<double> in_c(folder, to_c(axis, {.name = "loop"}).value(), true);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(0), 0);
    EXPECT_EQ(in_c.probe() / 512 % 128, rests ? 3u : 0u);
    for (int k = 0; k < 20; ++k) {
      const double y = 0.125 + 1e-3 * (k % 3);
      EXPECT_TRUE(equal_bits(axis.update(y, 0.25), in_c.update(y, 0.25))) << before << ", " << k;
      EXPECT_EQ(in_c.probe() / 512 % 128, static_cast<unsigned>(axis.mode())) << before << k;
    }
  }
  EXPECT_TRUE(rested[0] && rested[1]);
}

/// VariableTime is not written. What the header of to_c says to do in its place after a pause is
/// what `elapsed` does: to the bit, where T is a power of two.
TEST(CResting, APauseIsPredictedByHand) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using Any = Rests<VariableTime<LinearEso<2, double>>>;
  for (const double b0 : {8.0, -8.0}) {
    Axis::Config settings = config<Axis>(b0);
    settings.controller.observer.sample_time = 0.0078125;
    settings.controller.start_hold = {};
    settings.controller.limits.rate = Limits<>{}.rate;
    settings.controller.soften = false;
    settings.controller.missing = {.most = 100};
    settings.rest = {};  // each call is a command, which a rest that begins then would hold
    Any::Config any{};
    any.controller.observer = {.observer = settings.controller.observer, .ratio = 1.5};
    any.controller.controller_bandwidth = settings.controller.controller_bandwidth;
    any.controller.limits = settings.controller.limits;
    any.controller.missing = settings.controller.missing;
    any.rest = settings.rest;
    ASSERT_EQ(refusal(Any::make(any)), "accepted");
    auto mine = Any::make(any).value();
    const Folder folder;
    InC<double> in_c(folder, to_c(Axis::make(settings).value(), {.name = "loop"}).value(), true);
    ASSERT_TRUE(in_c.loaded());
    Random random(1905);
    double y = 0, v = 0, u = 0, r = 0;
    int pauses = 0, restarts = 0;
    for (int k = 0; k < 3000; ++k) {
      const int samples = random.index(9) == 0 ? 2 + random.index(40) : 1;
      if (random.index(200) == 0) r = random.uniform(-1, 1);
      for (int i = 0; i < samples; ++i) {
        v += 0.0078125 * (b0 * u + 0.5 - v);
        y += 0.0078125 * v;
      }
      ASSERT_TRUE(mine.elapsed(samples * 0.0078125));
      for (int i = 1; i < samples; ++i) {
        in_c.applied(u);
        (void)in_c.miss(r);
      }
      in_c.applied(u);
      const double next = in_c.update(y, r);
      u = mine.update(y, r);
      compare_estimates(mine.observer(), in_c, k);
      // Its law is computed in other units.
      ASSERT_NEAR(u, next, 1e-14) << k << ", " << samples;
      ASSERT_EQ(in_c.probe() / 512 % 128, static_cast<unsigned>(mine.mode())) << k;
      pauses += samples > 1 ? 1 : 0;
      restarts += has(mine.status(), StepStatus::restarted) ? 1 : 0;
    }
    EXPECT_GT(pauses, 100);
    EXPECT_GT(restarts, 10);
  }
}

/// The self-test comes to rest, and sees a wrong count.
TEST(CResting, IsTested) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  const Axis axis = Axis::make(config<Axis>(8)).value();
  CCode code = to_c(axis, {.name = "loop"}).value();
  for (const auto& [from, to] : {std::pair<std::string, std::string>{"o->inside <= REST_SAMPLES",
                                                                     "o->inside < REST_SAMPLES"},
                                 {"#define REST_SAMPLES 4u", "#define REST_SAMPLES 5u"},
                                 {"  if (o->mode == LOOP_REST) {\n    return",
                                  "  if (o->mode == LOOP_SAFE) {\n    return"}}) {
    CCode wrong = code;
    const std::size_t at = wrong.source.find(from);
    ASSERT_NE(at, std::string::npos) << from;
    wrong.source.replace(at, from.size(), to);
    const Folder folder;
    InC<double> in_c(folder, wrong, true);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_NE(in_c.self_test(0), 0) << to;
  }
}

TEST(CResting, CompilesWithOtherCompilers) {
  compiles<Rests<WrappedOutput<OutlierGate<LinearEso<2, double>>>>>();
}

TEST(CResting, RefusesUnderFastMath) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  refuses_under_fast_math<Rests<LinearEso<2, float>>>();
}

#endif

}  // namespace target_c_resting_test
}  // namespace esokit_test
