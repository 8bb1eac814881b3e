// The C of a controller whose reference moves: r, r', .. at each sample. It equals the C++ bit for
// bit, and what the C of a profile gives is what it takes.
#include <target/written.hpp>

#include <algorithm>
#include <cmath>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/adapter/guarded.hpp>
#include <esokit/adapter/mapped_input.hpp>
#include <esokit/adapter/wrapped_output.hpp>
#include <esokit/control/adrc.hpp>
#include <esokit/control/approach_profile.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/fixed_point.hpp>
#include <esokit/target/profile_code.hpp>

namespace esokit_test {
namespace target_c_reference_test {

using namespace esokit;

constexpr double sample_time = 0.0078125;

/// Whether it is no controller in two phases.
template <class C>
constexpr bool has_loop = requires {
  typename detail::ObserverOfController<C>::type;
};

template <class C>
C controller_of(double gain, void (*change)(typename C::Config&) = nullptr) {
  typename C::Config settings{};
  if constexpr (has_loop<C>) {
    settings = config<C>(gain);
  } else {
    settings.observer = observer_config<typename detail::PredictiveOf<C>::type>(gain);
    settings.controller_bandwidth = 4;
    settings.limits = {-3, 2.5, 60};
    settings.start_hold = typename C::scalar_type(0.1);
    settings.missing.most = 6;
  }
  if (change != nullptr) change(settings);
  return C::make(settings).value();
}

/// Why `to_c` does not write it, or "".
template <class Object>
std::string refusal(const Object& object) {
  const auto code = to_c(object, {.name = "loop", .moving_reference = true});
  return code ? std::string() : code.error().field + std::string(": ") + code.error().rule;
}

TEST(CReference, IsRefusedWhereNoLawTakesIt) {
  const std::string needs =
      "moving_reference: needs a law that takes r', ..: Adrc, not of the error-based form, or "
      "PredictiveAdrc";
  EXPECT_EQ(refusal(controller_of<Adrc<LinearEso<2>>>(8)), "");
  EXPECT_EQ(refusal(controller_of<PredictiveAdrc<LinearEso<2>>>(8)), "");
  EXPECT_EQ(refusal(controller_of<Adrc<LinearEso<2>, ErrorBased>>(8)), needs);
  EXPECT_EQ(refusal(controller_of<DisturbanceCompensator<LinearEso<2>>>(8)), needs);
  EXPECT_EQ(refusal(LinearEso<2>::make(observer_config<LinearEso<2>>(8)).value()), needs);
  EXPECT_EQ(refusal(controller_of<Adrc<WrappedOutput<LinearEso<3>>>>(8)),
            "soften: of an angle is not written for this observer");
  FixedPointOptions fixed;
  fixed.code.moving_reference = true;
  fixed.y = {.unit = 1e-3, .most = 4000};
  fixed.u = {.unit = 1e-3, .most = 4000};
  const auto code = to_fixed_c(controller_of<Adrc<LinearEso<2>>>(8), fixed);
  ASSERT_FALSE(code);
  EXPECT_STREQ(code.error().field, "moving_reference");
}

#ifdef ESOKIT_LOADS_C

/// The C, its reference as an array.
template <class V, int count>
class Follower {
 public:
  Follower(const Folder& folder, const CCode& code, bool one_phase = true)
      : library_(folder, code, wrapping(one_phase)) {
    if (!library_.loaded()) return;
    void (*init)(void*) = nullptr;
    unsigned (*bytes)() = nullptr;
    library_.find(init, "loop_init");
    library_.find(bytes, "loop_bytes");
    library_.find(follow_, "loop_follow");
    library_.find(lose_, "loop_lose");
    library_.find(probe_, "loop_probe");
    library_.find(start_, "loop_start");
    library_.find(applied_, "loop_applied");
    library_.find(self_test_, "loop_self_test");
    state_.resize(bytes() / sizeof(std::uint64_t) + 1);
    init(state_.data());
  }
  [[nodiscard]] bool loaded() const { return library_.loaded(); }
  V update(V y, const Vector<V, count>& r) { return follow_(state_.data(), y, &r(0)); }
  V miss(const Vector<V, count>& r) { return lose_(state_.data(), &r(0)); }
  unsigned start(V y, V u) { return start_(state_.data(), y, u); }
  unsigned applied(V u) { return applied_(state_.data(), u); }
  unsigned probe() { return probe_(state_.data()); }
  int self_test() { return self_test_(V(0)); }

 private:
  static std::string wrapping(bool one_phase) {
    const std::string real = sizeof(V) == sizeof(float) ? "float" : "double";
    std::string given;
    for (int i = 0; i < count; ++i) given += ", r[" + std::to_string(i) + "]";
    const auto function = [](const std::string& head, const std::string& body) {
      return head + ";\n" + head + "\n{\n  " + body + "\n}\n";
    };
    return function("unsigned loop_bytes(void)", "return sizeof(loop_state);") +
           function("unsigned loop_probe(const loop_state *o)",
                    "return o->status + 512u * o->mode + 65536u * o->gap;") +
           function(real + " loop_follow(loop_state *o, " + real + " y, const " + real + " *r)",
                    "return loop_update(o, y" + given + ");") +
           function(real + " loop_lose(loop_state *o, const " + real + " *r)",
                    one_phase ? "return loop_update_without_measurement(o" + given + ");"
                              : "const " + real +
                                    " u = loop_control_without_measurement(o);\n"
                                    "  (void)loop_prepare(o" +
                                    given + ");\n  return u;");
  }

  Library library_;
  std::vector<std::uint64_t> state_;
  V (*follow_)(void*, V, const V*) = nullptr;
  V (*lose_)(void*, const V*) = nullptr;
  unsigned (*probe_)(const void*) = nullptr;
  unsigned (*start_)(void*, V, V) = nullptr;
  unsigned (*applied_)(void*, V) = nullptr;
  int (*self_test_)(V) = nullptr;
};

template <class C, class Motion>
auto missed(C& controller, const Motion& motion) {
  if constexpr (requires { controller.update_without_measurement(motion); }) {
    return controller.update_without_measurement(motion);
  } else {
    const auto u = controller.control_without_measurement();
    controller.prepare(motion);
    return u;
  }
}

/// Both in the same loop, with bad numbers in each place of the reference.
template <class C>
void follows(std::uint64_t seed, void (*change)(typename C::Config&) = nullptr,
             bool in_struct = false) {
  SCOPED_TRACE(testing::internal::GetTypeName<C>());
  using V = typename C::scalar_type;
  constexpr int count = C::order + 1;
  const int samples = static_cast<int>(asked("ESOKIT_WRITTEN_SAMPLES", 20000));
  const Folder folder;
  for (const double gain : {8.0, -8.0}) {
    C controller = controller_of<C>(gain, change);
    const CCode code =
        to_c(controller,
             {.name = "loop", .moving_reference = true, .settings_in_struct = in_struct})
            .value();
    Follower<V, count> in_c(folder, code, has_loop<C>);
    ASSERT_TRUE(in_c.loaded());
    EXPECT_EQ(in_c.self_test(), 0);
    ChainPlant plant(C::order, sample_time, gain, 1.5);
    Random random(seed++ + asked("ESOKIT_WRITTEN_SEED", 0));
    int bad = 0;
    int moved = 0;
    int rests = 0;
    int lost = 0;
    double u = 0;
    for (int k = 0; k < samples && !testing::Test::HasFailure(); ++k) {
      plant.step(u);
      if (k % 5000 == 0) plant.set_state(std::vector<double>(C::order, 0.0));
      V y = static_cast<V>(plant.output() + 1e-3 * random.uniform(-1, 1));
      if constexpr (
          observer_traits<std::remove_cvref_t<decltype(controller.observer())>>.wraps_output) {
        y = std::remainder(y, V(2.5));
      }
      if (random.index(150) == 0) y = random.index(2) == 0 ? hidden_nan<V>() : anything<V>(random);
      Vector<V, count> r{};
      for (int i = 0; i < count; ++i) {
        r(i) = static_cast<V>(std::pow(0.5, i) * std::sin(0.004 * k + 1.6 * i));
      }
      if (k % 400 < 200) {
        for (int i = 0; i < count; ++i)
          r(i) = V(i == 0 ? 0.25 : random.index(30) == 0 ? -0.0 : 0.0);
      }
      if (random.index(100) == 0) r(random.index(count)) = anything<V>(random);
      if (random.index(200) == 0) {
        const V told = random.index(5) == 0 ? anything<V>(random) : static_cast<V>(0.9 * u);
        EXPECT_EQ(static_cast<unsigned>(controller.applied(told)), in_c.applied(told)) << k;
      }
      if (random.index(1000) == 0) {
        const V under = random.index(4) == 0 ? anything<V>(random) : static_cast<V>(u);
        EXPECT_EQ(static_cast<unsigned>(controller.start(y, under)), in_c.start(y, under)) << k;
      }
      if (random.index(150) == 0) lost = random.index(14);
      const V mine = lost > 0 ? missed(controller, r) : controller.update(y, r);
      const V its = lost > 0 ? in_c.miss(r) : in_c.update(y, r);
      if (lost > 0) --lost;
      EXPECT_TRUE(equal_bits(mine, its)) << "sample " << k << ": " << mine << ", C " << its;
      const auto status = static_cast<unsigned>(controller.status());
      EXPECT_EQ(in_c.probe() % 512, status) << "sample " << k;
      EXPECT_EQ(in_c.probe() / 512 % 128, static_cast<unsigned>(controller.mode())) << k;
      EXPECT_EQ(in_c.probe() / 65536, static_cast<unsigned>(controller.observer().missed())) << k;
      bad += status >= 256;
      moved += std::fabs(mine) < V(2.4);
      rests += controller.mode() == LoopMode::rest;
      u = static_cast<double>(mine);
    }
    EXPECT_GT(bad, samples / 4000);
    EXPECT_GT(moved, samples / 20);
    EXPECT_TRUE(!detail::IsResting<C>::value || rests > samples / 50) << rests;
  }
}

TEST(CReference, EqualsTheController) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  follows<Adrc<LinearEso<2, float>>>(1);
#ifndef ESOKIT_ONE_TYPE
  follows<Adrc<LinearEso<1, double>>>(11);
  follows<Adrc<LinearEso<3, double>>>(21);  // it softens
  follows<Adrc<CascadeEso<2, 3, double>>>(31);
  follows<Adrc<LinearEso<2, double>>>(41, nullptr, true);
  follows<Resting<Adrc<LinearEso<2, float>>>>(61);
  follows<Adrc<LinearEso<2, float>>>(51, [](auto& settings) {
    settings.measurement_divider = 3;
    settings.missing.stay = true;
  });
#endif
}

#ifndef ESOKIT_ONE_TYPE

TEST(CReference, InAdapters) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  follows<Adrc<WrappedOutput<DelayedInput<LinearEso<2, float>, 4>>>>(101);
  follows<Adrc<Guarded<LinearEso<2, double>>>>(111);
  follows<Adrc<MappedInput<LinearEso<2, double>>>>(121);
}

TEST(CReference, WithGainsThatGoOn) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  follows<Adrc<AlgebraicEso<2, double>>>(201);
  follows<Adrc<WrappedOutput<AlgebraicEso<1, float>>>>(211);
  follows<Adrc<ExtendedStateFilter<2, float>>>(221);
}

TEST(CReference, InTwoPhases) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  follows<PredictiveAdrc<LinearEso<2, double>>>(301);
  follows<PredictiveAdrc<AlgebraicEso<1, float>>>(311);
}

#endif

/// The C of a profile moves the C of a controller; neither lags.
TEST(CReference, IsWhatTheProfileGives) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, double>>;
  const auto wide = [](C::Config& settings) {
    settings.limits = {-30, 30};
    settings.start_hold = {};
  };
  C controller = controller_of<C>(8, wide);
  auto profile =
      SmoothProfile<2, double>::make({.limits = {2.0, 20.0}, .sample_time = sample_time}).value();
  const Folder folder;
  const CCode move = to_c(profile, {.name = "move"}).value();
  folder.write("move.h", move.header);
  folder.write("move.c", move.source);
  const CCode code = to_c(controller, {.name = "loop", .moving_reference = true}).value();
  const CCode alone = to_c(controller, {.name = "loop"}).value();
  const std::string both = R"(
#include "move.c"
double loop_play(double y, double target, double *r);
double loop_play(double y, double target, double *r)
{
  static loop_state loop;
  static move_state move;
  static int begun = 0;
  double motion[3];
  if (begun == 0) {
    loop_init(&loop);
    (void)move_reset(&move, 0.0);
    begun = 1;
  }
  (void)move_update(&move, target);
  move_motion(&move, motion);
  *r = motion[0];
  return loop_update(&loop, y, motion[0], motion[1], motion[2]);
}
)";
  const Library library(folder, code, both);
  ASSERT_TRUE(library.loaded());
  double (*play)(double, double, double*) = nullptr;
  library.find(play, "loop_play");
  InC<double> constant(folder, alone, true);
  ASSERT_TRUE(constant.loaded());
  ChainPlant plant(2, sample_time, 8, 0), other(2, sample_time, 8, 0);
  double u = 0, its = 0, worst = 0, lag = 0;
  for (int k = 0; k < 1000; ++k) {
    plant.step(u);
    other.step(its);
    double r = 0;
    (void)profile.update(5.0);
    const double mine = controller.update(plant.output(), profile.motion());
    u = play(plant.output(), 5.0, &r);
    EXPECT_TRUE(equal_bits(mine, u)) << "sample " << k;
    its = constant.update(other.output(), r);
    worst = (std::max)(worst, std::fabs(plant.output() - r));
    lag = (std::max)(lag, std::fabs(other.output() - r));
  }
  EXPECT_NEAR(plant.output(), 5.0, 1e-3);
  EXPECT_GT(lag, 0.5);           // 2 (2 / omega_c) of r alone, where it is as fast as it may
  EXPECT_LT(worst, 0.05 * lag);  // what is left is of the start and of sampling
}

/// A heater of 0 .. 100 %: the law, what the profile adds, and limits behind both; at rest it needs
/// most of what u leaves.
TEST(CReference, IsWhatAnApproachGives) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<1, float>>;
  const float T = 0.5f, gain = 0.02f, pole = 0.01f;
  auto controller =
      C::make({.observer = {.observer_bandwidth = 0.3f, .input_gain = gain, .sample_time = T},
               .controller_bandwidth = 0.05f,
               .limits = {.lower = -100, .upper = 200}})
          .value();
  auto profile = ApproachProfile<1, 4, float>::make({.pole = pole,
                                                     .input_gain = gain,
                                                     .limits = {.lower = 0, .upper = 100},
                                                     .dead_time = 4 * T,
                                                     .bandwidth = 0.05f,
                                                     .sample_time = T})
                     .value();
  ASSERT_TRUE(controller.start(20, 10) == StepStatus::ok && profile.start(20, 10));
  const Folder folder;
  const CCode heat = to_c(profile, {.name = "heat"}).value();
  folder.write("heat.h", heat.header);
  folder.write("heat.c", heat.source);
  const Library library(folder,
                        to_c(controller, {.name = "loop", .moving_reference = true}).value(),
                        R"(
#include "heat.c"
float loop_play(float y, float target);
float loop_play(float y, float target)
{
  static loop_state loop;
  static heat_state heat;
  static int begun = 0;
  float motion[2];
  float u;
  if (begun == 0) {
    loop_init(&loop);
    (void)loop_start(&loop, 20.0f, 10.0f);
    (void)heat_start(&heat, 20.0f, 10.0f);
    begun = 1;
  }
  (void)heat_update(&heat, target);
  heat_motion(&heat, motion);
  u = loop_update(&loop, y, motion[0], motion[1]) + heat_feed(&heat);
  u = (u < 0.0f) ? 0.0f : ((u > 100.0f) ? 100.0f : u);
  (void)loop_applied(&loop, u - heat_feed(&heat));
  return u;
}
)");
  ASSERT_TRUE(library.loaded());
  float (*play)(float, float) = nullptr;
  library.find(play, "loop_play");
  double y = 20, most = 0, least = 100;
  for (int k = 0; k < 6000; ++k) {
    const float target = k < 3000 ? 180.0f : 60.0f;
    (void)profile.update(target);
    const float of_law = controller.update(static_cast<float>(y), profile.motion());
    const float u = std::clamp(of_law + profile.feed(), 0.0f, 100.0f);
    (void)controller.applied(u - profile.feed());
    EXPECT_TRUE(equal_bits(u, play(static_cast<float>(y), target))) << "sample " << k;
    most = (std::max)(most, y);
    if (k > 3000) least = (std::min)(least, y);
    y += static_cast<double>(T) * (0.018 * static_cast<double>(u) - 0.009 * y);
    if (k == 2999) {
      EXPECT_NEAR(y, 180, 0.1);
    }
  }
  EXPECT_NEAR(y, 60, 0.1);
  EXPECT_LT(most, 181);
  EXPECT_GT(least, 59);
}

/// A ramp of 2 a second does not lag.
TEST(CReference, DoesNotLagOnARamp) {
  if (!there("gcc")) GTEST_SKIP() << "no gcc";
  using C = Adrc<LinearEso<2, float>>;
  const auto free = [](C::Config& settings) {
    settings.limits = {-30, 30};
    settings.start_hold = {};
  };
  const Folder folder;
  const C controller = controller_of<C>(8, free);
  Follower<float, 3> in_c(folder,
                          to_c(controller, {.name = "loop", .moving_reference = true}).value());
  ASSERT_TRUE(in_c.loaded());
  ChainPlant plant(2, sample_time, 8, 1.5);
  double u = 0, r = 0;
  for (int k = 0; k < 1500; ++k) {
    plant.step(u);
    r = 2 * sample_time * k;
    u = static_cast<double>(
        in_c.update(static_cast<float>(plant.output()), {static_cast<float>(r), 2, 0}));
  }
  EXPECT_NEAR(plant.output(), r, 1e-3);
}

/// What else has to take it.
TEST(CReference, CompilesWithOtherCompilers) {
  compiles_elsewhere(to_c(controller_of<Adrc<WrappedOutput<LinearEso<2, float>>>>(8),
                          {.name = "loop", .moving_reference = true})
                         .value(),
                     "loop");
}

#endif  // ESOKIT_LOADS_C

}  // namespace target_c_reference_test
}  // namespace esokit_test
