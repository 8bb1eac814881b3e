// The C to take home, where to_c can write it.
#include <algorithm>
#include <esokit/control/adrc.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/target/c_code.hpp>

#include "play.hpp"

namespace playground {
namespace {

template <class Observer>
std::array<std::string, 2> c_with(const Settings& s, typename Observer::Config observer) {
  observer.observer_bandwidth = s[observer_bandwidth];
  observer.input_gain = s[gain] * s[gain_factor] * (s[half_gain] > 0.0 ? 2.0 : 1.0);
  observer.sample_time = s[sample_time];
  typename esokit::Adrc<Observer>::Config config{.observer = observer,
                                                 .controller_bandwidth = s[controller_bandwidth]};
  config.limits.lower = -s[down] * s[limit];
  config.limits.upper = s[limit];
  if (s[rate] > 0.0) config.limits.rate = s[rate];
  if (s[soften] > 0.0) config.soften = s[soften] > 1.0;
  const auto controller = esokit::Adrc<Observer>::make(config);
  if (!controller) return {};
  const auto code = to_c(*controller);
  if (!code) return {};
  return {code->header, code->source};
}

template <int Order>
std::array<std::string, 2> c_of_order(const Settings& s) {
  if (s[observer] == 0.0) return c_with<esokit::LinearEso<Order>>(s, {});
  return c_with<esokit::CascadeEso<Order, 2>>(s, {.bandwidth_factor = 2.0});
}

}  // namespace

std::array<std::string, 2> c_of(const Settings& s) {
  const bool delayed = s[knows_dead_time] > 0.0 && s[dead_time] > 0.5 * s[sample_time];
  const bool mapped = s[knows_curve] > 0.0 && (s[dead_zone] > 0.0 || s[down_gain] != 1.0);
  if (delayed || mapped || (s[observer] != 0.0 && s[observer] != 2.0)) return {};
  return s[order] == 1.0 ? c_of_order<1>(s) : s[order] == 2.0 ? c_of_order<2>(s) : c_of_order<3>(s);
}

}  // namespace playground
