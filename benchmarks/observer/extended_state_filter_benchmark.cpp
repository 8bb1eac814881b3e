/// @file
/// ExtendedStateFilter beside LinearEso of the same size and a Kalman filter on dense matrices:
/// with the recursion at every sample, and with the frozen gain.
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/eigen.hpp>
#include <esokit/observer/extended_state_filter.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <string>

#include "../support/run.hpp"
#include "../support/update_patterns.hpp"

namespace esokit::benchmarks {
namespace {

/// What one writes with Eigen: x and P dense, the textbook's equations.
template <class S, int Size>
struct DenseKalman {
  using Square = EigenMatrix<S, Size, Size>;
  EigenMatrix<S, Size> state = EigenMatrix<S, Size>::Zero();
  Square covariance;
  Square transition;
  Square noise;
  EigenMatrix<S, Size> input;
  S measurement;

  void update(S y, S u) noexcept {
    const EigenMatrix<S, Size> predicted = transition * state + input * u;
    const Square spread = transition * covariance * transition.transpose() + noise;
    const EigenMatrix<S, Size> gain = spread.col(0) / (spread(0, 0) + measurement);
    state = predicted + gain * (y - predicted(0));
    covariance = spread - gain * spread.row(0);
  }
};

template <class S>
constexpr S input_gain = S(2);
template <class S>
constexpr S sample_time = static_cast<S>(1e-3);

template <class S, int Order>
LinearEso<Order, S> linear() {
  return LinearEso<Order, S>::make({.observer_bandwidth = S(60),
                                    .input_gain = input_gain<S>,
                                    .sample_time = sample_time<S>})
      .value();
}

template <class S, int Order>
ExtendedStateFilter<Order, S> filter(RiccatiMode mode, InflationRule rule, bool full_noise) {
  using Filter = ExtendedStateFilter<Order, S>;
  typename Filter::Config config{.input_gain = input_gain<S>,
                                 .sample_time = sample_time<S>,
                                 .measurement_variance = static_cast<S>(1e-6),
                                 .inflation_rule = rule,
                                 .mode = mode};
  if (rule == InflationRule::fixed) config.inflation = static_cast<S>(0.1);
  S bound = static_cast<S>(1e-6);
  typename Filter::Covariance noise = Filter::Covariance::Zero();
  for (int i = 0; i <= Order; ++i) {
    config.disturbance_bounds[static_cast<std::size_t>(i)] = bound;
    config.initial_covariance(i, i) = bound * bound * S(1e6);
    for (int j = 0; j <= Order; ++j) noise(i, j) = i == j ? bound * bound : S(0);
    bound *= S(1000);
  }
  if (full_noise) {
    noise(1, 0) = noise(0, 1) = static_cast<S>(1e-10);
    config.process_covariance = noise;
    config.disturbance_bounds = {};
  }
  return Filter::make(config).value();
}

template <class S, int Order>
DenseKalman<S, Order + 1> kalman() {
  using Chain = IntegratorChain<Order, S>;
  DenseKalman<S, Order + 1> filter;
  filter.transition = Chain::transition_matrix(sample_time<S>);
  filter.input = Chain::sampled_input_matrix(sample_time<S>, input_gain<S>);
  filter.measurement = static_cast<S>(1e-6);
  filter.noise.setZero();
  S bound = static_cast<S>(1e-6);
  for (int i = 0; i <= Order; ++i) {
    filter.noise(i, i) = bound * bound;
    bound *= S(1000);
  }
  filter.covariance = filter.noise * S(1e6);
  return filter;
}

template <class S, int Order>
void add_order(const std::string& scalar, const Limits& recursive, const Limits& frozen) {
  const std::string size = "/" + std::to_string(Order) + "/" + scalar;
  const auto against_linear = [&](const Limits& limits) {
    return esokit::benchmarks::Limits{"vs bank/linear_eso" + size + limits.bank,
                                      "vs call/linear_eso" + size + limits.out_of_line,
                                      "vs latency/linear_eso" + size + limits.latency};
  };
  add<S>("linear_eso" + size, linear<S, Order>());
  add<S>("kalman_dense_eigen" + size, kalman<S, Order>());
  const auto and_kalman = [&](Limits limits) {
    limits.bank += "; vs bank/kalman_dense_eigen" + size;
    limits.out_of_line += "; vs call/kalman_dense_eigen" + size;
    limits.latency += "; vs latency/kalman_dense_eigen" + size;
    return limits;
  };
  add<S>("esf_recursive" + size,
         filter<S, Order>(RiccatiMode::recursive, InflationRule::fixed, false),
         and_kalman(against_linear(recursive)));
  add<S>("esf_recursive_full_noise" + size,
         filter<S, Order>(RiccatiMode::recursive, InflationRule::fixed, true), against_linear({}));
  add<S>("esf_adaptive" + size,
         filter<S, Order>(RiccatiMode::recursive, InflationRule::adaptive, false),
         against_linear({}));
  add<S>("esf_frozen" + size, filter<S, Order>(RiccatiMode::frozen, InflationRule::fixed, false),
         against_linear(frozen));
}

template <class S>
void add_all(const std::string& scalar) {
  add_order<S, 1>(scalar, {}, {});
  // The recursion: 213 instructions beside 33 on a Cortex-M4F, with divisions.
  add_order<S, 2>(scalar, {" <= 9", " <= 9", " <= 9"}, {" <= 1.1", " <= 1.1", " <= 1.1"});
  add_order<S, 3>(scalar, {}, {});
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
