// The law suite on ModelEso, with known plant poles and with a disturbance that swings, and on
// PlantEso, with a zero and a disturbance that enters elsewhere; gaps, and snapshots.
#include "law_suite.hpp"
//
#include "model_traits.hpp"
//
#include <esokit/core/snapshot.hpp>

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

template <class S>
struct ObserverTraits<esokit::ModelEso<plant_parts, S>> : ModelTraitsOf<WithPoles, S> {};
template <class S>
struct ObserverTraits<esokit::ModelEso<swing_parts, S>> : ModelTraitsOf<WithSwing, S> {};
template <class S>
struct ObserverTraits<esokit::PlantEso<2, zero_parts, S>> : ModelTraitsOf<WithZero, S> {};

using ModelTypes = TypeList<WithSwing<double>, WithPoles<double>, WithZero<double>,
                            WithSwing<float>, WithPoles<float>, WithZero<float>>;
const bool model_eso_registered = register_laws<ObserverLaws>("ModelEso", ModelTypes{});

TEST(ModelEso, RecurringGapsDecayUpToTheLongestThatIsBridged) {
  recurring_gaps_decay(kind_of<esokit::ModelEso<swing_parts>>());
  recurring_gaps_decay(kind_of<esokit::ModelEso<plant_parts>>());
  recurring_gaps_decay(kind_of<esokit::ModelEso<swing_parts, float>>());
  recurring_gaps_decay(kind_of<esokit::ModelEso<plant_parts, float>>());
  recurring_gaps_decay(kind_of<WithZero<double>>());
}

/// `restored` is `running`, with all that is to come the same bit for bit.
void continues(const LawSuite& laws, AnyObserver running, AnyObserver restored) {
  EXPECT_TRUE(same_observer(restored, running));
  EXPECT_EQ(restored->missed(), 2);
  Random random(59);
  for (int k = 0; k < 100; ++k) {
    const Real y = random.uniform(-1, 1);
    const Real u = laws.input(random.uniform(-1, 1));
    const StepStatus status = k % 9 == 4 ? running->predict(u) : running->update(y, u);
    EXPECT_EQ(k % 9 == 4 ? restored->predict(u) : restored->update(y, u), status);
    ASSERT_TRUE(same_observer(restored, running)) << k;
  }
  // The model is restored as well: a retune starts from it.
  for (AnyObserver* o : {&running, &restored}) {
    ASSERT_EQ(laws.kind.retune(*o, {1.5 / laws.period, laws.period, 3.0}), "accepted");
    (*o)->update(1, laws.input(0.5));
  }
  EXPECT_TRUE(same_observer(restored, running));
}

/// As `snapshot` saved it, in the middle of a gap.
template <class Observer>
void round_trip() {
  const LawSuite laws{kind_of<Observer>()};
  AnyObserver running = laws.warm();
  running->predict(laws.input(0.5));
  running->predict(laws.input(0.25));
  auto words = esokit::snapshot(running.as<Observer>());
  const Made restored(esokit::from_snapshot<Observer>(words));
  ASSERT_TRUE(restored) << restored.refused;
  continues(laws, running, *restored.observer);
  // A bit of the model is enough to be refused.
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
  refuses_another<Sensor>(LawSuite{kind_of<Plant>()}.warm().as<Plant>());
}

}  // namespace esokit_test
