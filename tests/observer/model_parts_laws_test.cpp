// The law suite on models of lags: actuator, sensor and what fades in a LinearEso, and a cascade
// with plant poles, actuator and sensor.
#include "law_suite.hpp"
//
#include "model_traits.hpp"

namespace esokit_test {

inline constexpr esokit::ModelParts lag_parts{
    .order = 1, .actuator = 1, .sensor = 1, .first_order = 1};
inline constexpr esokit::ModelParts cascade_parts{
    .order = 1, .plant_poles = true, .actuator = 1, .sensor = 1};

template <class S>
using WithLags = esokit::ModelEso<lag_parts, S>;
template <class S>
using InCascade = esokit::ModelCascadeEso<cascade_parts, 2, S>;

template <class S>
struct ObserverTraits<esokit::ModelEso<lag_parts, S>> : ModelTraitsOf<WithLags, S> {};
template <class S>
struct ObserverTraits<esokit::ModelCascadeEso<cascade_parts, 2, S>> : ModelTraitsOf<InCascade, S> {
};

using PartTypes = TypeList<WithLags<double>, InCascade<double>, WithLags<float>, InCascade<float>>;
const bool model_parts_registered = register_laws<ObserverLaws>("ModelParts", PartTypes{});

TEST(ModelParts, RecurringGapsDecayUpToTheLongestThatIsBridged) {
  recurring_gaps_decay(kind_of<WithLags<double>>());
  recurring_gaps_decay(kind_of<InCascade<double>>());
  recurring_gaps_decay(kind_of<InCascade<float>>());
}

}  // namespace esokit_test
