/// @file
/// AdjustableBandwidthEso and NonlinearEso beside LinearEso: what the choice of a gain costs.
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <string>

#include "../support/run.hpp"
#include "../support/update_patterns.hpp"

namespace esokit::benchmarks {
namespace {

template <class S>
constexpr S bandwidth = S(60);
template <class S>
constexpr S sample_time = static_cast<S>(1e-3);

template <int Order, int Extension, class S>
LinearEso<Order, S, Extension> linear() {
  return LinearEso<Order, S, Extension>::make({.observer_bandwidth = bandwidth<S>,
                                               .input_gain = S(2),
                                               .sample_time = sample_time<S>})
      .value();
}

template <int Order, class S>
AdjustableBandwidthEso<Order, S> switched(SwitchingRule rule) {
  return AdjustableBandwidthEso<Order, S>::make({.observer_bandwidth = bandwidth<S>,
                                                 .bandwidth_ratio = static_cast<S>(0.75),
                                                 .rule = rule,
                                                 .input_gain = S(2),
                                                 .sample_time = sample_time<S>})
      .value();
}

template <class S>
NonlinearEso<2, S> nonlinear(const PowerSumGain<S>& shape) {
  return NonlinearEso<2, S>::make({.observer_bandwidth = bandwidth<S>,
                                   .shape = shape,
                                   .input_gain = S(2),
                                   .sample_time = sample_time<S>})
      .value();
}

Limits against(const std::string& name, const std::string& limit, const std::string& in_latency) {
  return {"vs bank/" + name + limit, "vs call/" + name + limit, "vs latency/" + name + in_latency};
}

template <class S>
void add_all(const std::string& scalar) {
  add<S>("linear_eso/2/" + scalar, linear<2, 1, S>());
  add<S>("linear_eso/3/" + scalar, linear<3, 1, S>());
  add<S>("linear_eso/2m2/" + scalar, linear<2, 2, S>());
  // Back to back, each update on the last one's state, the choice lies on the critical path: the
  // comparison and the load of the gain, some 12 cycles: hence 1.65. To correct by both sets and
  // choose then brings the ratio in latency from 1.6 to 1.1, and in throughput from 1.3 to 1.5.
  add<S>("abeso/2/" + scalar, switched<2, S>(SwitchingRule::abeso),
         against("linear_eso/2/" + scalar, " <= 1.40", " <= 1.65"));
  add<S>("abeso/3/" + scalar, switched<3, S>(SwitchingRule::abeso),
         against("linear_eso/3/" + scalar, " <= 1.40", " <= 1.65"));
  const auto beside = against("linear_eso/2m2/" + scalar, "", "");
  add<S>("nonlinear/constant/" + scalar, nonlinear<S>({}), beside);
  // sqrt and a product: no pow.
  add<S>("nonlinear/plain_powers/" + scalar,
         nonlinear<S>({.gain_alpha = S(0.5), .alpha = S(0.5), .gain_beta = S(0.5), .beta = S(1)}),
         beside);
  add<S>("nonlinear/pow/" + scalar,
         nonlinear<S>({.gain_alpha = static_cast<S>(0.617),
                       .alpha = static_cast<S>(0.233),
                       .gain_beta = static_cast<S>(0.143),
                       .beta = static_cast<S>(0.334)}),
         beside);
}

}  // namespace
}  // namespace esokit::benchmarks

int main(int argc, char** argv) {
  esokit::benchmarks::add_all<double>("double");
  esokit::benchmarks::add_all<float>("float");
  return esokit::benchmarks::run(argc, argv);
}
