// The shell of the named observers, by an observer that is written here: what its `design` is
// asked, when, and what becomes of the answer.
#include <gtest/gtest.h>

#include <cmath>
#include <esokit/gain/switched_gain.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <limits>
#include <support/refusal.hpp>

namespace observer_named_observer_test {

using esokit::ContinuousObserver;
using esokit::Error;
using esokit::Expected;
using esokit::LinearEso;
using esokit::NamedContinuousObserver;
using esokit::NamedObserver;
using esokit::PredictorCorrector;
using esokit_test::refusal;

/// LinearEso with its bandwidth in Hz.
template <class S = double>
class HertzEso
    : public NamedObserver<HertzEso<S>, PredictorCorrector<2, S, 1, esokit::ConstantGain<3, S>>> {
  using Shell = typename HertzEso::NamedObserver;
  friend Shell;
  using Shell::Shell;

 public:
  struct Config {
    S hertz{};
    S input_gain{};
    S sample_time{};
    int max_gap = 100;
  };

 private:
  static auto design(const Config& config, const typename Shell::PlantModel& model) {
    constexpr S turn = S(6.283185307179586);
    return Shell::Law::make("hertz", S(turn * config.hertz), model);
  }
};

/// Of a law that remembers the last innovation.
class TwoSpeeds
    : public NamedObserver<TwoSpeeds,
                           PredictorCorrector<1, double, 1, esokit::SwitchedGain<2, double>>> {
  using Shell = NamedObserver;
  friend Shell;
  using Shell::Shell;

 public:
  struct Config {
    double slow{};
    double fast{};
    double input_gain{};
    double sample_time{};
    int max_gap = 100;
  };

 private:
  static Expected<Law, Error<double>> design(const Config& config, const PlantModel& model) {
    const auto slow = Law::Set::make("slow", config.slow, model);
    const auto fast = Law::Set::make("fast", config.fast, model);
    if (!slow || !fast) return slow ? fast.error() : slow.error();
    return Law(*slow, *fast);
  }
};

/// Two levels of one bandwidth, as an ODE.
class TwinEso
    : public NamedContinuousObserver<
          TwinEso, ContinuousObserver<2, double, 1, esokit::ContinuousConstantGain<3, double>, 2>> {
  using Shell = NamedContinuousObserver;
  friend Shell;
  using Shell::Shell;

 public:
  struct Config {
    double observer_bandwidth{};
    double input_gain{};
  };

 private:
  static Expected<Laws, Error<double>> design(const Config& config) {
    const auto law = Law::make("observer_bandwidth", config.observer_bandwidth);
    if (!law) return law.error();
    return Laws{*law, *law};
  }
};

static_assert(esokit::PredictableObserver<HertzEso<float>>);
static_assert(!std::is_default_constructible_v<HertzEso<>>, "only make() makes one");

TEST(NamedObserver, IsItsLaw) {
  auto observer = HertzEso<>::make({.hertz = 2, .input_gain = 3, .sample_time = 0.01}).value();
  auto linear =
      LinearEso<2>::make(
          {.observer_bandwidth = 6.283185307179586 * 2, .input_gain = 3, .sample_time = 0.01})
          .value();
  for (int k = 0; k < 50; ++k) {
    EXPECT_EQ(observer.update(0.1 * k, 1), linear.update(0.1 * k, 1));
  }
  EXPECT_EQ(observer.estimate()(2), linear.estimate()(2));
  ASSERT_TRUE(observer.retune({.hertz = 5, .input_gain = 3, .sample_time = 0.01, .max_gap = 7}));
  EXPECT_EQ(observer.estimate()(2), linear.estimate()(2));
  EXPECT_EQ(observer.max_gap(), 7);
}

/// What all configs say comes first, then what the design says.
TEST(NamedObserver, RefusesWhatItsDesignRefuses) {
  EXPECT_EQ(refusal(HertzEso<>::make({.hertz = -1, .input_gain = 0, .sample_time = 0.01})),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refusal(HertzEso<>::make({.hertz = -1, .input_gain = 1, .sample_time = 0})),
            "sample_time: must be finite and positive");
  EXPECT_EQ(
      refusal(HertzEso<>::make({.hertz = -1, .input_gain = 1, .sample_time = 0.01, .max_gap = 0})),
      "max_gap: must be 1 .. 65000");
  EXPECT_EQ(refusal(HertzEso<>::make({.hertz = -1, .input_gain = 1, .sample_time = 0.01})),
            "hertz: must be finite and positive");
  EXPECT_EQ(refusal(TwinEso::make({.observer_bandwidth = -1, .input_gain = 0})),
            "input_gain: must be finite and not zero (negative is fine)");
  EXPECT_EQ(refusal(TwinEso::make({.observer_bandwidth = -1, .input_gain = 1})),
            "observer_bandwidth: must be finite and positive");
  auto observer = HertzEso<>::make({.hertz = 2, .input_gain = 3, .sample_time = 0.01}).value();
  observer.update(1, 1);
  const auto before = observer.estimate();
  EXPECT_FALSE(observer.retune({.hertz = 5, .input_gain = 0, .sample_time = 0.01}));
  EXPECT_EQ(observer.estimate()(1), before(1));
  EXPECT_EQ(observer.input_gain(), 3);
}

/// Of a cascade `design` gives all levels.
/// The observer says nothing of it: the law declares that it continues.
TEST(NamedObserver, KeepsTheMemoryOfItsLawInARetune) {
  const TwoSpeeds::Config config{.slow = 5, .fast = 40, .input_gain = 1, .sample_time = 0.01};
  auto kept = TwoSpeeds::make(config).value();
  auto changed = kept;
  for (int k = 0; k < 200; ++k) {
    // At every sample: if the memory were lost, the next one would count as shrinking.
    ASSERT_TRUE(changed.retune(config));
    const double y = std::sin(0.1 * k);
    kept.update(y, 0.5);
    changed.update(y, 0.5);
    ASSERT_EQ(kept.estimate()(0), changed.estimate()(0)) << k;
    ASSERT_EQ(kept.estimate()(1), changed.estimate()(1)) << k;
  }
}

TEST(NamedObserver, TakesTheLawsOfAllLevels) {
  const auto twin = TwinEso::make({.observer_bandwidth = 10, .input_gain = 2}).value();
  TwinEso::State z = TwinEso::State::Zero();
  z(3) = 1;
  const auto rate = twin.derivative(0, z, 0, 0);
  EXPECT_DOUBLE_EQ(rate(3), -30);
  EXPECT_DOUBLE_EQ(rate(5), -1000);
}

}  // namespace observer_named_observer_test
