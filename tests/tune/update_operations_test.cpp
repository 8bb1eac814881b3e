// The table of `tune` says how many operations the recorded list of an update has.
#include <gtest/gtest.h>

#include <algorithm>
#include <esokit/gain/pole_set.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/model_eso.hpp>
#include <esokit/target/recorder.hpp>
#include <esokit/tune/tuning.hpp>

namespace esokit_test {
namespace tune_update_operations_test {

using namespace esokit;

/// Operations of an update of O.
template <class O, class Set>
int recorded(const Set& set) {
  typename O::Config config{.input_gain = 2.0, .sample_time = 1e-3};
  set(config);
  Recorder<O> recorder(O::make(config).value());
  // Not as a step: a filter counts its samples.
  recorder.add(2, [](auto& object, const auto& in) {
    (void)object.update(in[0], in[1]);
    return typename Recorder<O>::Arguments{};
  });
  const RecordedObject found = recorder.record().value();
  const auto& list = found.calls[0][0].list.instructions;
  return static_cast<int>(std::count_if(list.begin(), list.end(), [](const Instruction& one) {
    return one.operation != Operation::constant && one.operation != Operation::argument;
  }));
}

constexpr auto bandwidth = [](auto& config) { config.observer_bandwidth = 50.0; };

template <int n>
void chains() {
  EXPECT_EQ((recorded<LinearEso<n>>(bandwidth)), update_operations(n, 1, 1, {}));
  EXPECT_EQ((recorded<LinearEso<n, double, 2>>(bandwidth)), update_operations(n, 2, 1, {}));
  EXPECT_EQ((recorded<HalfGainEso<n>>(bandwidth)), update_operations(n, 1, 1, {}));
  EXPECT_EQ((recorded<ExtendedStateFilter<n>>([](auto& config) {
              config.measurement_variance = 1e-6;
              config.disturbance_bounds[n] = 1.0;
              config.inflation = 0.01;
              config.mode = RiccatiMode::frozen;
            })),
            update_operations(n, 1, 1, {}));
  const auto cascade = [](auto& config) {
    bandwidth(config);
    config.bandwidth_factor = 2.0;
  };
  EXPECT_EQ((recorded<CascadeEso<n, 2>>(cascade)), update_operations(n, 1, 2, {}));
  EXPECT_EQ((recorded<CascadeEso<n, 3>>(cascade)), update_operations(n, 1, 3, {}));
}

template <ModelParts parts>
void model() {
  const int operations = recorded<ModelEso<parts>>([](auto& config) {
    bandwidth(config);
    if constexpr (parts.actuator > 0) config.model.actuator.time_constant = 0.02;
    if constexpr (parts.sensor > 0) config.model.sensor.time_constant = 0.01;
    if constexpr (parts.resonators > 0) {
      config.model.resonators[0] = {.frequency = 20.0, .capture_bandwidth = 2.0};
    }
  });
  const TuneKnowledge knows{
      .lag = parts.actuator > 0, .sensor = parts.sensor > 0, .sinusoid = parts.resonators > 0};
  EXPECT_EQ(operations, update_operations(parts.order, 1, 1, knows));
}

template <int n>
void models() {
  model<ModelParts{.order = n, .actuator = 1}>();
  model<ModelParts{.order = n, .sensor = 1}>();
  model<ModelParts{.order = n, .resonators = 1}>();
  model<ModelParts{.order = n, .actuator = 1, .sensor = 1}>();
  model<ModelParts{.order = n, .actuator = 1, .resonators = 1}>();
}

TEST(UpdateOperations, AreThoseOfTheRecordedList) {
  chains<1>();
  chains<2>();
  chains<3>();
  models<1>();
  models<2>();
  models<3>();
}

}  // namespace tune_update_operations_test
}  // namespace esokit_test
