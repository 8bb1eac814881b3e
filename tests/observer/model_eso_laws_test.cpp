// The law suite on ModelEso, with known plant poles and with a disturbance that swings, and on
// PlantEso, with a zero and a disturbance that enters elsewhere; gaps, and snapshots.
#include "law_suite.hpp"
//
#include <algorithm>
#include <cmath>
#include <esokit/core/snapshot.hpp>
#include <esokit/observer/model_eso.hpp>

namespace esokit_test {

inline constexpr esokit::ModelParts plant_parts{.order = 2, .plant_poles = true};
inline constexpr esokit::ModelParts swing_parts{.order = 2, .resonators = 1};
inline constexpr esokit::ModelParts zero_parts{.order = 1};

template <class S>
using WithPoles = esokit::ModelEso<plant_parts, S>;
template <class S>
using WithSwing = esokit::ModelEso<swing_parts, S>;
template <class S>
using WithZero = esokit::PlantEso<2, zero_parts, S>;

/// The frequency of the model is half the observer's bandwidth, and 10 rad/s at most, so that a
/// retune from 50 to 150 rad/s keeps the model. All poles decay with the bandwidth.
template <template <class> class Of, class S>
struct ModelTraitsOf {
  using Observer = Of<S>;
  using Model = typename Observer::PlantModel;
  static constexpr esokit::ModelParts parts = Model::parts;
  /// It is a LinearPlant.
  static constexpr bool whole_plant = std::is_same_v<Observer, WithZero<S>>;
  using Config = typename Observer::Config;
  template <class T>
  using Rebind = Of<T>;
  static constexpr const char* field = "observer_bandwidth";
  static constexpr double slowest = 1;
  static constexpr double fastest = 1;

  static Config config(double omega, double sample_time, double input_gain, int max_gap = 100) {
    Config config{.observer_bandwidth = static_cast<S>(omega),
                  .input_gain = static_cast<S>(input_gain),
                  .sample_time = static_cast<S>(sample_time),
                  .max_gap = max_gap};
    // A config that is to be refused for its bandwidth has a good model.
    const double w = omega > 0 ? std::min(omega / 2, 10.0) : 10.0;
    if constexpr (whole_plant) {
      const auto rate = static_cast<S>(w);
      auto& plant = config.model.plant;
      plant.a = {{-rate / S(2), S(1)}, {S(0), -rate}};
      plant.b = {S(1), rate / S(4)};
      plant.c = {S(1), S(0)};
      plant.e = {S(1) / S(8), rate};
    }
    if constexpr (parts.plant_poles) {
      config.model.plant = {static_cast<S>(w * w), static_cast<S>(w)};
    }
    if constexpr (parts.resonators > 0) {
      config.model.resonators = {{{.frequency = static_cast<S>(w),
                                   .capture_bandwidth = static_cast<S>(omega > 0 ? omega : w)}}};
    }
    return config;
  }
  static constexpr int degree(int row) { return Model::degree(Model::state_of_row(row)); }
  static double unknown_amplitude(const Config& config, double nu) {
    double sum = nu * nu;
    // y' = -w / 2 y + x_2 + d / 8, all three of them found.
    if constexpr (whole_plant) {
      return 3 * (nu + std::abs(static_cast<double>(config.model.plant.a(1, 1))));
    }
    if constexpr (parts.plant_poles) {
      sum += std::abs(static_cast<double>(config.model.plant[0])) +
             std::abs(static_cast<double>(config.model.plant[1])) * nu;
    }
    return sum;
  }
  static constexpr const char* excuse(Law law) {
    if (law == Law::gains_equal_reference || law == Law::polynomial_equals_reference) {
      return "the reference is a chain's; see PutsThePolesWhereAsked in augmented_model_test.cpp";
    }
    if (law == Law::unbiased_on_own_model_class) {
      return "its plant is a chain; see WhatFollowsTheModelIsEstimatedToRounding in "
             "augmented_model_test.cpp";
    }
    if (law == Law::order_of_accuracy) return "an observer with a model has no continuous form";
    if (law == Law::gap_gain_is_that_of_longer_sample) {
      return "a gap is bridged by a Kalman filter's gain, which stays bounded where that of the "
             "longer sample does not; see gain/model_gain.hpp";
    }
    if (law == Law::recurring_gaps_are_stable) {
      return "it asks for the decay of the longer sample; see "
             "RecurringGapsDecayUpToTheLongestThatIsBridged";
    }
    return common_excuse<S, Observer::size>(law);
  }
};

template <class S>
struct ObserverTraits<esokit::ModelEso<plant_parts, S>> : ModelTraitsOf<WithPoles, S> {};
template <class S>
struct ObserverTraits<esokit::ModelEso<swing_parts, S>> : ModelTraitsOf<WithSwing, S> {};
template <class S>
struct ObserverTraits<esokit::PlantEso<2, zero_parts, S>> : ModelTraitsOf<WithZero, S> {};

using ModelTypes = TypeList<WithSwing<double>, WithPoles<double>, WithZero<double>,
                            WithSwing<float>, WithPoles<float>, WithZero<float>>;
const bool registered = register_laws<ObserverLaws>("ModelEso", ModelTypes{});

/// What ModelGain promises of a gap: one correction in M, for ever, lets every error decay by at
/// least a hundredth of what a sample without a gap does, to the longest gap that is bridged; after
/// one more the observer restarts.
template <class Observer>
void recurring_gaps_decay() {
  using Laws = LawsOf<Observer>;
  using S = typename Laws::S;
  for (const double omega_t : {0.1, 1.0, 3.0}) {
    SCOPED_TRACE(omega_t);
    Observer observer = Laws::make(omega_t);
    ASSERT_GE(observer.max_gap(), 1);
    for (int every = 2; every <= observer.max_gap() + 1; ++every) {
      SCOPED_TRACE(every);
      const long double apart = Laws::period * every;
      typename Observer::Estimate state;
      for (int r = 0; r < Observer::size; ++r) {
        state(r) = static_cast<S>(1 / Laws::row_unit(r, apart));
      }
      ASSERT_EQ(observer.reset(state), StepStatus::ok);
      const auto largest = [&] {
        long double most = 0;
        for (int r = 0; r < Observer::size; ++r) {
          most = std::max(most, std::abs(observer.estimate()(r)) * Laws::row_unit(r, apart));
        }
        return most;
      };
      const int corrections = 100 * Laws::settling_samples(omega_t);
      for (int k = 0; k < corrections && largest() > 1e-9L; ++k) {
        for (int i = 0; i < every; ++i) observer.predict(S(0));
        ASSERT_EQ(observer.correct(S(0)), StepStatus::gap_bridged);
      }
      EXPECT_LE(largest(), 1e-9L);
    }
    for (int i = 0; i < observer.max_gap() + 2; ++i) observer.predict(S(0));
    EXPECT_EQ(observer.correct(S(0)), StepStatus::restarted);
  }
}

TEST(ModelEso, RecurringGapsDecayUpToTheLongestThatIsBridged) {
  recurring_gaps_decay<esokit::ModelEso<swing_parts>>();
  recurring_gaps_decay<esokit::ModelEso<plant_parts>>();
  recurring_gaps_decay<esokit::ModelEso<swing_parts, float>>();
  recurring_gaps_decay<esokit::ModelEso<plant_parts, float>>();
  recurring_gaps_decay<WithZero<double>>();
}

/// As `snapshot` saved it, with all that is to come the same bit for bit, in the middle of a gap
/// too.
template <class Observer>
void round_trip() {
  using Laws = LawsOf<Observer>;
  Observer running = Laws::warm();
  running.predict(Laws::input(0.5));
  running.predict(Laws::input(0.25));
  const auto read = esokit::from_snapshot<Observer>(esokit::snapshot(running));
  ASSERT_TRUE(read) << read.error();
  Observer restored = *read;
  EXPECT_TRUE(same_observer(restored, running));
  EXPECT_EQ(restored.missed(), 2);
  Random random(59);
  for (int k = 0; k < 100; ++k) {
    const auto y = static_cast<typename Laws::S>(random.uniform(-1, 1));
    const auto u = Laws::input(random.uniform(-1, 1));
    const StepStatus status = k % 9 == 4 ? running.predict(u) : running.update(y, u);
    EXPECT_EQ(k % 9 == 4 ? restored.predict(u) : restored.update(y, u), status);
    ASSERT_TRUE(same_observer(restored, running)) << k;
  }
  // The model is restored as well: a retune starts from it.
  for (Observer* o : {&running, &restored}) {
    ASSERT_TRUE(o->retune(Laws::config(1.5, 3.0)));
    o->update(typename Laws::S(1), Laws::input(0.5));
  }
  EXPECT_TRUE(same_observer(restored, running));
  // A bit of the model is enough to be refused.
  auto words = esokit::snapshot(running);
  words[words.size() / 2] ^= 1u << 7;
  EXPECT_TRUE(refusal(esokit::from_snapshot<Observer>(words))
                  .starts_with("snapshot: has a wrong checksum"));
}

/// Words of a `From` are none of an `Observer`, which is as large.
template <class Observer, class From>
void refuses_another(const From& from) {
  static_assert(sizeof(From) == sizeof(Observer), "the size alone must not tell them apart");
  const auto words = esokit::snapshot(from);
  ASSERT_TRUE(esokit::from_snapshot<From>(words));
  EXPECT_EQ(refusal(esokit::from_snapshot<Observer>(words)),
            "snapshot: has a wrong checksum: damaged, or of another type or version");
}

TEST(ModelEsoSnapshot, ContinuesBitForBit) {
  round_trip<esokit::ModelEso<swing_parts>>();
  round_trip<esokit::ModelEso<plant_parts>>();
  round_trip<esokit::ModelEso<swing_parts, float>>();
  round_trip<esokit::ModelEso<plant_parts, float>>();
  round_trip<WithZero<double>>();
}

TEST(ModelEsoSnapshot, OfOtherPartsIsRefused) {
  using Plant = esokit::ModelEso<plant_parts>;
  // A pole of the plant less, a sensor more: as many states, as much memory.
  constexpr esokit::ModelParts sensor_parts{.order = 1, .plant_poles = true, .sensor = 1};
  using Sensor = esokit::ModelEso<sensor_parts>;
  refuses_another<Plant>(Sensor::make({.observer_bandwidth = 20,
                                       .input_gain = 2,
                                       .sample_time = 0.01,
                                       .model = {.plant = {3.0}, .sensor = {0.02}}})
                             .value());
  refuses_another<Sensor>(LawsOf<Plant>::warm());
}

}  // namespace esokit_test
