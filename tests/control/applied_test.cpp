// What is commanded and what the actuator reports are two numbers, in every controller; a lost
// sensor and a lost reference end in something declared. The single-channel controllers are in the
// law suite, too; here they stand beside the others, in packs, and with a plant.
#include <gtest/gtest.h>

#include <cmath>
#include <concepts>
#include <esokit/control/adrc.hpp>
#include <esokit/control/disturbance_compensator.hpp>
#include <esokit/control/experiment.hpp>
#include <esokit/control/gain_probe.hpp>
#include <esokit/control/mimo_adrc.hpp>
#include <esokit/control/predictive_adrc.hpp>
#include <esokit/core/packed.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <limits>
#include <optional>
#include <string>
#include <support/numbers.hpp>
#include <support/refusal.hpp>
#include <vector>

namespace esokit_test {
namespace control_applied_test {

using esokit::Adrc;
using esokit::DisturbanceCompensator;
using esokit::ErrorBased;
using esokit::Limits;
using esokit::LinearEso;
using esokit::LoopMode;
using esokit::MimoAdrc;
using esokit::MissingRule;
using esokit::PredictiveAdrc;
using esokit::StepStatus;

constexpr double T = 1e-4;

template <class S>
struct Setting {
  Limits<S> limits{.lower = S(-5), .upper = S(5)};
  MissingRule<S> missing{};
  double gain = 50;
};

template <class Config, class S>
void fill(Config& config, const Setting<S>& setting) {
  if constexpr (requires { config.observers; }) {
    std::get<0>(config.observers) = {.observer_bandwidth = S(200),
                                     .sample_time = static_cast<S>(T)};
    std::get<1>(config.observers) = std::get<0>(config.observers);
    config.controller_bandwidths = {S(40), S(40)};
    const auto b = static_cast<S>(setting.gain);
    config.input_matrix = {{b, S(0)}, {S(0), b}};
    config.limits = {setting.limits, setting.limits};
    config.missing = {setting.missing, setting.missing};
  } else {
    config.observer = {.observer_bandwidth = S(200),
                       .input_gain = static_cast<S>(setting.gain),
                       .sample_time = static_cast<S>(T)};
    if constexpr (requires { config.controller_bandwidth; }) config.controller_bandwidth = S(40);
    config.limits = setting.limits;
    config.missing = setting.missing;
  }
}

/// Any of them, for one measurement and one u; of several channels all are alike.
template <class C>
class Any {
 public:
  using S = typename C::scalar_type;
  static constexpr bool several = requires { C::channels; };
  static constexpr bool predictive = requires(C & c, S s) { c.prepare(s); };
  static constexpr bool compensates = requires(C & c) { c.compensation_gain(); };

  static auto made(const Setting<S>& setting) {
    typename C::Config config{};
    fill(config, setting);
    return C::make(config);
  }
  explicit Any(const Setting<S>& setting) : c_(made(setting).value()) {
    k_ = static_cast<S>(40 / setting.gain);
  }

  S update(S y, S r) {
    if constexpr (several) {
      return c_.update({y, y}, {r, r})(0);
    } else if constexpr (predictive) {
      c_.set_reference(r);
      const S u = c_.control(y);
      late_ = !late_;
      if (late_) c_.prepare(r);  // a report comes before it, or after
      return u;
    } else if constexpr (compensates) {
      return c_.update(y, esokit::is_finite(y) ? S(k_ * (r - y)) : r);
    } else {
      return c_.update(y, r);
    }
  }
  StepStatus applied(S u) {
    if constexpr (several) {
      return c_.applied({u, u});
    } else {
      return c_.applied(u);
    }
  }
  /// After the report of a sample.
  void end_of_sample(S r) {
    if constexpr (predictive) {
      if (!late_) c_.prepare(r);
    }
  }
  void start(S y, S u) {
    if constexpr (several) {
      c_.start({y, y}, {u, u});
    } else {
      c_.start(y, u);
    }
  }
  void retune(const Setting<S>& setting) {
    typename C::Config config{};
    fill(config, setting);
    EXPECT_TRUE(c_.retune(config));
  }
  [[nodiscard]] S output() const {
    if constexpr (several) {
      return c_.output()(0);
    } else {
      return c_.output();
    }
  }
  [[nodiscard]] StepStatus status() const {
    if constexpr (several) {
      return c_.status(0);
    } else {
      return c_.status();
    }
  }
  [[nodiscard]] LoopMode mode() const { return c_.mode(); }
  [[nodiscard]] bool lost_a_sample() const { return predictive; }

 private:
  C c_;
  S k_{};
  bool late_ = false;
};

template <class C>
class Applied : public ::testing::Test {};
using All =
    ::testing::Types<Adrc<LinearEso<1>>, Adrc<LinearEso<1, float>>, Adrc<LinearEso<1>, ErrorBased>,
                     DisturbanceCompensator<LinearEso<1>>,
                     DisturbanceCompensator<LinearEso<1, float>>, PredictiveAdrc<LinearEso<1>>,
                     PredictiveAdrc<LinearEso<1, float>>, MimoAdrc<LinearEso<1>, LinearEso<1>>,
                     MimoAdrc<LinearEso<1, float>, LinearEso<1, float>>>;
TYPED_TEST_SUITE(Applied, All);

/// v' = b u - 3 v - 20; the report is wrong by an offset or lags.
template <class C>
struct Run {
  double v = 0, u = 0, largest = 0, at_90 = -1;
};
template <class C, class Report>
Run<C> run(const Setting<typename C::scalar_type>& setting, double goal, int samples,
           const Report& report) {
  using S = typename C::scalar_type;
  Any<C> c(setting);
  Run<C> out;
  double last = 0;
  const double step = static_cast<double>(setting.limits.rate) * T;
  for (int k = 0; k < samples; ++k) {
    const S u = c.update(static_cast<S>(out.v), static_cast<S>(goal));
    out.u = static_cast<double>(u);
    EXPECT_LE(std::abs(out.u - last), step * (1 + 1e-4) + 1e-5) << k;
    EXPECT_LE(std::abs(out.u), 5);
    EXPECT_EQ(c.output(), u) << k;
    const auto told = report(out.u, k);
    if (told) c.applied(static_cast<S>(*told));
    EXPECT_EQ(c.output(), u) << k;
    c.end_of_sample(static_cast<S>(goal));
    last = out.u;
    for (int i = 0; i < 10; ++i) out.v += T / 10 * (setting.gain * out.u - 3 * out.v - 20);
    if (out.at_90 < 0 && out.v > 0.9 * goal) out.at_90 = k * T;
    out.largest = std::fmax(out.largest, std::abs(out.v));
  }
  return out;
}

/// `applied(u + 0.02)` with a rate of 100 drove u to 5 and the speed to 76.7 instead of 10.
TYPED_TEST(Applied, AnOffsetOfTheReportDoesNotRunAway) {
  using S = typename TypeParam::scalar_type;
  for (const double sign : {1.0, -1.0}) {
    for (const double offset : {0.02, -0.02, 0.1}) {
      Setting<S> setting;
      setting.gain *= sign;
      setting.limits.rate = S(100);
      const auto out = run<TypeParam>(
          setting, 10, 10000, [&](double u, int) { return std::optional<double>(u + offset); });
      // u is right as soon as v is; the observer has b0 times the offset more of disturbance.
      const double error = 1.5 * 50 * std::abs(offset) / 40;
      EXPECT_NEAR(out.v, 10, error + 1e-2) << sign << " " << offset;
      EXPECT_LT(out.largest, 10 + error + 0.1);
    }
  }
}

/// An actuator that lags and says where it is may cost what the lag does, not more.
TYPED_TEST(Applied, AReportThatLagsCostsNothing) {
  using S = typename TypeParam::scalar_type;
  for (const double rate : {100.0, 20.0}) {
    Setting<S> setting;
    setting.limits.rate = static_cast<S>(rate);
    const auto silent =
        run<TypeParam>(setting, 50, 10000, [](double, int) { return std::optional<double>(); });
    double position = 0;
    const auto told = run<TypeParam>(setting, 50, 10000, [&](double u, int) {
      position += T / 2e-3 * (u - position);
      return std::optional<double>(position);
    });
    ASSERT_GT(silent.at_90, 0);
    ASSERT_GT(told.at_90, 0);
    EXPECT_LT(told.at_90, 1.1 * silent.at_90) << rate;
  }
}

/// In any sequence of reports.
TYPED_TEST(Applied, ReportsMoveNoLimit) {
  using S = typename TypeParam::scalar_type;
  Random random(5);
  for (const double rate : {100.0, 1e30}) {
    Setting<S> setting;
    setting.limits = {.lower = S(-1), .upper = S(5), .rate = static_cast<S>(rate)};
    (void)run<TypeParam>(setting, 10, 4000, [&](double u, int k) {
      const double reports[] = {u + 1,
                                -u,
                                1e30,
                                random.uniform(-90, 90),
                                hidden_nan<double>(),
                                10 * u,
                                hidden_infinity<double>()};
      return std::optional<double>(reports[k / 100 % 7]);
    });
  }
}

TYPED_TEST(Applied, ABadReportIsReported) {
  using S = typename TypeParam::scalar_type;
  Any<TypeParam> c(Setting<S>{});
  c.update(S(0.5), S(1));
  EXPECT_EQ(c.applied(S(0.5)), StepStatus::ok);
  for (const S bad : {hidden_nan<S>(), hidden_infinity<S>()}) {
    EXPECT_EQ(c.applied(bad), StepStatus::input_rejected);
  }
}

/// Nor after a start under a u that the limits of then did not hold: a NaN made it the output.
TYPED_TEST(Applied, ARefusedReportChangesNothing) {
  using S = typename TypeParam::scalar_type;
  for (const S rate : {S(100), Limits<S>{}.rate}) {
    for (const S u : {S(-1.6), S(3)}) {
      for (const bool starts : {false, true}) {
        Setting<S> setting;
        setting.limits = {.lower = S(0), .upper = S(5), .rate = rate};
        Any<TypeParam> c(setting);
        if (starts) c.start(S(0.1), u);
        setting.limits = {.lower = S(-4), .upper = S(1), .rate = rate};
        c.retune(setting);
        Any<TypeParam> other = c;
        EXPECT_EQ(c.applied(hidden_nan<S>()), StepStatus::input_rejected);
        EXPECT_TRUE(same_bits(c.output(), other.output())) << u << ' ' << rate << ' ' << starts;
        for (int k = 0; k < 4; ++k) {
          EXPECT_TRUE(same_bits(c.update(S(0.1), S(0.2)), other.update(S(0.1), S(0.2))))
              << u << ' ' << rate << ' ' << starts << ' ' << k;
          c.end_of_sample(S(0.2));
          other.end_of_sample(S(0.2));
        }
      }
    }
  }
}

/// The operator's u is the last command.
TYPED_TEST(Applied, StartGoesOnFromTheOperatorsInput) {
  using S = typename TypeParam::scalar_type;
  for (const bool moved : {false, true}) {
    Setting<S> setting;
    setting.limits.rate = S(100);
    Any<TypeParam> c(setting);
    c.update(S(0), S(0));
    c.start(S(1), S(2));
    if (moved) {  // by the operator, since
      EXPECT_EQ(c.applied(S(-3)), StepStatus::ok);
      EXPECT_EQ(c.applied(S(3)), StepStatus::ok);
    }
    EXPECT_EQ(c.output(), moved ? S(3) : S(2));
    const S u = c.update(S(1), S(1e6));
    EXPECT_NEAR(static_cast<double>(u), (moved ? 3 : 2) + 0.01, 1e-6);
    // From then on it is a report.
    c.applied(S(0));
    EXPECT_EQ(c.output(), u);
  }
}

/// The last command is what was put out, whatever the law asked for: wider limits do not move it.
TYPED_TEST(Applied, ARetuneKeepsTheLastCommand) {
  using S = typename TypeParam::scalar_type;
  for (const S rate : {S(1e5), Limits<S>{}.rate}) {
    Setting<S> setting;
    setting.limits = {S(-2), S(2), rate};
    Any<TypeParam> c(setting);
    for (int k = 0; k < 10; ++k) {
      c.update(S(0), S(1e4));
      c.end_of_sample(S(1e4));
    }
    ASSERT_EQ(c.output(), S(2));
    c.applied(S(1));
    setting.limits = {S(-9), S(9), rate};
    c.retune(setting);
    EXPECT_EQ(c.output(), S(2));
    setting.limits = {S(-9), S(1.5), rate};
    c.retune(setting);
    EXPECT_EQ(c.update(S(0), S(1e4)), S(1.5));
  }
}

/// Without a word u goes to zero, at its rate; with one it goes there, or stays.
TYPED_TEST(Applied, ALostSensorEndsInADeclaredInput) {
  using S = typename TypeParam::scalar_type;
  constexpr S nan = std::numeric_limits<S>::quiet_NaN();
  for (const S rate : {S(100), Limits<S>{}.rate}) {
    for (int kind = 0; kind < 3; ++kind) {
      Setting<S> setting;
      setting.limits.rate = rate;
      setting.missing.most = 10;
      if (kind == 1) setting.missing.input = S(-2);
      setting.missing.hold = kind == 2;
      Any<TypeParam> c(setting);
      c.start(S(0), S(4));
      for (int k = 0; k < 100; ++k) {
        c.update(S(0.1), S(60));
        c.end_of_sample(S(60));
      }
      S last = c.output();
      ASSERT_GT(last, S(4));
      S kept = last;
      for (int k = 0; k < 1000; ++k) {
        const S u = c.update(nan, S(60));
        c.applied(S(u + 1));
        c.end_of_sample(S(60));
        EXPECT_LE(std::abs(static_cast<double>(u - last)),
                  static_cast<double>(rate) * T * 1.0001 + 1e-5);
        // In two phases the u of a sample is known before it.
        const bool was = c.mode() == LoopMode::safe;
        EXPECT_EQ(was, k >= 10) << k;
        if (k <= 10) kept = u;
        last = u;
      }
      EXPECT_EQ(last, kind == 0 ? S(0) : kind == 1 ? S(-2) : kept) << kind;
      c.update(S(0.1), S(60));
      c.end_of_sample(S(60));
      EXPECT_EQ(c.mode(), LoopMode::running);
      setting.missing.stay = true;
      Any<TypeParam> stays(setting);
      stays.update(S(0), S(0));
      stays.end_of_sample(S(0));
      for (int k = 0; k < 100; ++k) {
        stays.update(k < 50 ? nan : S(0.1), S(60));
        stays.end_of_sample(S(60));
      }
      EXPECT_EQ(stays.mode(), LoopMode::safe);
      stays.start(S(0), S(0));
      EXPECT_EQ(stays.mode(), LoopMode::running);
    }
  }
}

TYPED_TEST(Applied, ASafeInputIsStatedIfZeroIsOutOfReach) {
  using S = typename TypeParam::scalar_type;
  const auto said = [](const Limits<S>& limits, const MissingRule<S>& missing) {
    std::string all = refusal(Any<TypeParam>::made({limits, missing}));
    if (const auto at = all.find("[0]"); at != std::string::npos) all.erase(at, 3);  // the channel
    return all;
  };
  const Limits<S> above{.lower = S(0.5), .upper = S(1)};
  const Limits<S> below{.lower = S(-1), .upper = S(-0.5)};
  EXPECT_EQ(said({.lower = S(0), .upper = S(1)}, {}), "accepted");
  EXPECT_EQ(said({.lower = S(-1), .upper = S(0)}, {}), "accepted");
  EXPECT_EQ(said(above, {}), "missing.input: must be given, as zero is below limits.lower");
  EXPECT_EQ(said(below, {}), "missing.input: must be given, as zero is above limits.upper");
  EXPECT_EQ(said(above, {.input = S(0)}), "missing.input: must not be below limits.lower");
  EXPECT_EQ(said(below, {.input = S(0)}), "missing.input: must not be above limits.upper");
  EXPECT_EQ(said(above, {.input = S(0.5)}), "accepted");
  EXPECT_EQ(said(above, {.input = hidden_nan<S>()}), "missing.input: must be finite");
  EXPECT_EQ(said(above, {.hold = true}), "accepted");
  EXPECT_EQ(said(above, {.input = S(1), .hold = true}),
            "missing.hold: must be left out if missing.input is given");
  EXPECT_EQ(said({}, {.most = -1}), "missing.most: must be 0 up to 65534 samples, that is");
  EXPECT_EQ(said({}, {.most = 65534}), "missing.most: must be 0 up to 65534 samples, that is");
  EXPECT_EQ(said({}, {.most = 65533}), "accepted");
}

/// At every sample; u is the last command then, whatever is reported, or, where a bad r is a bad
/// measurement, that of a lost sensor.
TYPED_TEST(Applied, ABadReferenceIsReportedForAsLongAsItLasts) {
  using S = typename TypeParam::scalar_type;
  const bool by_error = std::same_as<TypeParam, Adrc<LinearEso<1>, ErrorBased>>;
  for (const S bad : {hidden_nan<S>(), hidden_infinity<S>()}) {
    for (const S rate : {S(100), Limits<S>{}.rate}) {
      Setting<S> setting;
      setting.limits.rate = rate;
      Any<TypeParam> c(setting);
      for (int k = 0; k < 100; ++k) {
        c.update(S(0.1), S(0.2));
        c.end_of_sample(S(0.2));
      }
      const S before = c.output();
      for (int k = 0; k < 200; ++k) {
        const S u = c.update(S(0.1), bad);
        c.applied(S(u + 1));
        c.end_of_sample(bad);
        EXPECT_TRUE(has(c.status(), StepStatus::reference_rejected)) << k;
        if (!by_error) {
          ASSERT_EQ(u, before) << k;
        }
      }
      EXPECT_EQ(c.mode(), by_error ? LoopMode::safe : LoopMode::running);
      c.update(S(0.1), S(0.2));
      c.end_of_sample(S(0.2));
      c.update(S(0.1), S(0.2));
      c.end_of_sample(S(0.2));
      EXPECT_FALSE(has(c.status(), StepStatus::reference_rejected));
    }
  }
}

/// Lanes of a pack, with and without a rate limit, are the plain ones, to the bit.
TEST(AppliedPacks, LanesAreThePlainOnes) {
  using Plain = Adrc<LinearEso<2, float>>;
  std::vector<Plain> lanes;
  for (int i = 0; i < 4; ++i) {
    Plain::Config config{.observer = {.observer_bandwidth = 60,
                                      .input_gain = i % 2 == 0 ? 5.0f : -5.0f,
                                      .sample_time = 1e-2f},
                         .controller_bandwidth = 10,
                         .limits = {.lower = -3, .upper = 2},
                         .missing = {.most = 3, .hold = i == 3}};
    if (i < 2) config.limits.rate = 30;
    lanes.push_back(Plain::make(config).value());
  }
  esokit::Packed<Plain, 4> pack([&](int i) { return lanes[static_cast<std::size_t>(i)]; });
  using P = typename decltype(pack)::scalar_type;
  Random random(3);
  const auto number = [&](int often) {
    const auto x = static_cast<float>(random.uniform(-4, 4));
    return random.index(often) == 0 ? hidden_nan<float>() : x;
  };
  for (int k = 0; k < 5000; ++k) {
    P y{}, r{}, u{};
    for (int i = 0; i < 4; ++i) {
      y[i] = number(k / 500 % 2 == 0 ? 1000 : 5);
      r[i] = number(40);
      u[i] = number(10);
    }
    const int what = random.index(6);
    if (what == 0) {
      (void)pack.each([&](Plain& lane, int i) { return lane.track(y[i], r[i], u[i]); });
    }
    if (what <= 2) (void)pack.applied(u);
    const P out = pack.update(y, r);
    for (int i = 0; i < 4; ++i) {
      auto& lane = lanes[static_cast<std::size_t>(i)];
      if (what == 0) lane.track(y[i], r[i], u[i]);
      if (what <= 2) (void)lane.applied(u[i]);
      ASSERT_TRUE(same_bits(lane.update(y[i], r[i]), out[i])) << k << " lane " << i;
      ASSERT_EQ(lane.status(), pack.status()[i]) << k << " lane " << i;
      ASSERT_EQ(lane.mode(), pack.mode()[i]);
      ASSERT_TRUE(same_bits(lane.output(), pack.output()[i]));
    }
  }
}

/// The relay commands; a report moves no limit of it.
TEST(Applied, AnExperimentCountsFromItsOwnInput) {
  auto experiment = esokit::Experiment<1>::make({.sample_time = 1e-3,
                                                 .amplitude = 1,
                                                 .hysteresis = 0.01,
                                                 .travel = 5,
                                                 .lowest_output = -9,
                                                 .highest_output = 9,
                                                 .time_limit = 50,
                                                 .limits = {.lower = -2, .upper = 2, .rate = 10}});
  ASSERT_TRUE(experiment.has_value()) << refusal(experiment);
  double last = experiment->output();
  double y = 0;
  for (int k = 0; k < 5000; ++k) {
    const double u = experiment->update(y, last + 0.5);
    ASSERT_LE(std::abs(u - last), 10e-3 + 1e-9) << k;
    y += 1e-3 * u;
    last = u;
  }
}

TEST(Applied, AProbeCountsFromItsOwnInput) {
  auto loop = Adrc<LinearEso<1>>::make(
                  {.observer = {.observer_bandwidth = 50, .input_gain = 5, .sample_time = 1e-3},
                   .controller_bandwidth = 10,
                   .limits = {.lower = -2, .upper = 2, .rate = 10}})
                  .value();
  auto probe = esokit::GainProbe<2>::make({.observer_bandwidth = 50,
                                           .sample_time = 1e-3,
                                           .amplitude = 0.2,
                                           .travel = 100,
                                           .limits = {.lower = -2, .upper = 2, .rate = 10}})
                   .value();
  double last = 0;
  for (int k = 0; k < 2000; ++k) {
    (void)loop.update(0, 0.1);
    const double u = probe.update(loop, 0);
    ASSERT_LE(std::abs(u - last), 10e-3 + 1e-9) << k;
    ASSERT_LE(std::abs(u), 2);
    loop.applied(u + 0.5);  // the sensor of u is off
    last = u;
  }
  EXPECT_TRUE(probe.finished());
}

}  // namespace control_applied_test
}  // namespace esokit_test
