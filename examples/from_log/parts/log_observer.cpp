#include "from_log/parts/log_observer.hpp"

#include <cmath>
#include <limits>
#include <string>
#include <type_traits>
#include <vector>

#include <esokit/adapter/variable_time.hpp>
#include <esokit/core/error_text.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/algebraic_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/observer/half_gain_eso.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/observer/nonlinear_eso.hpp>
#include <esokit/observer/reduced_order_eso.hpp>

namespace from_log {
namespace {

inline constexpr double widest_step = 1000;  ///< times the nominal one, and its inverse

template <class Observer>
LogEstimates run(const typename Observer::Config& config, const LogSettings& settings,
                 const std::vector<double>& time, const std::vector<double>& y,
                 const std::vector<double>& u) {
  using Timed = esokit::VariableTime<Observer>;
  auto made = Timed::make({.observer = config, .ratio = widest_step});
  if (!made)
    throw esokit::examples::LogError("the observer refuses: " + esokit::to_text(made.error()));
  Timed observer = *made;
  LogEstimates result;
  result.columns.resize(static_cast<std::size_t>(Observer::size));
  bool started = false;
  for (std::size_t k = 0; k < y.size(); ++k) {
    if (!started) {
      started = observer.reset(y[k]) == esokit::StepStatus::ok;
      if (!started) ++result.rejected;
    } else {
      const double step = time.empty() ? settings.sample_time : time[k] - time[k - 1];
      const bool nominal =
          std::abs(step - settings.sample_time) <= settings.tolerance * settings.sample_time;
      const auto accepted = observer.set_step_time(nominal ? settings.sample_time : step);
      if (!accepted) {
        throw esokit::examples::LogError(
            "the time from t = " + esokit::examples::number_text(time[k - 1], 15) +
            " s to the next row is too short or too long for the nominal sample time: " +
            esokit::to_text(accepted.error()));
      }
      // The input of the row before was held until now.
      const auto status = observer.update(y[k], u[k - 1]);
      if (esokit::has(status, esokit::StepStatus::measurement_rejected)) ++result.rejected;
      if (esokit::has(status, esokit::StepStatus::input_rejected)) ++result.inputs;
      if (esokit::has(status, esokit::StepStatus::restarted)) ++result.restarts;
    }
    const auto estimate = observer.estimate();
    for (int r = 0; r < Observer::size; ++r) {
      result.columns[static_cast<std::size_t>(r)].push_back(
          started ? estimate(r) : std::numeric_limits<double>::quiet_NaN());
    }
  }
  return result;
}

template <int Order>
LogEstimates run_order(const LogSettings& s, const std::vector<double>& time,
                       const std::vector<double>& y, const std::vector<double>& u) {
  const auto linear = [&](auto observer) {
    using Observer = typename decltype(observer)::type;
    return run<Observer>({.observer_bandwidth = s.bandwidth,
                          .input_gain = s.input_gain,
                          .sample_time = s.sample_time},
                         s, time, y, u);
  };
  if (s.observer == "linear") return linear(std::type_identity<esokit::LinearEso<Order>>{});
  if (s.observer == "half-gain") return linear(std::type_identity<esokit::HalfGainEso<Order>>{});
  if (s.observer == "reduced") return linear(std::type_identity<esokit::ReducedOrderEso<Order>>{});
  if (s.observer == "cascade") {
    // Level 1 a third of omega_o, which is that of the last level.
    return run<esokit::CascadeEso<Order, 2>>({.observer_bandwidth = s.bandwidth / 3,
                                              .bandwidth_factor = 3,
                                              .input_gain = s.input_gain,
                                              .sample_time = s.sample_time},
                                             s, time, y, u);
  }
  if (s.observer == "algebraic") {
    return run<esokit::AlgebraicEso<Order>>({.observer_bandwidth = s.bandwidth,
                                             .frequency_shift = s.bandwidth / 2,
                                             .input_gain = s.input_gain,
                                             .sample_time = s.sample_time},
                                            s, time, y, u);
  }
  if (s.observer == "adjustable") {
    return run<esokit::AdjustableBandwidthEso<Order>>({.observer_bandwidth = s.bandwidth,
                                                       .bandwidth_ratio = 0.75,
                                                       .allow_uncertified_switching = true,
                                                       .input_gain = s.input_gain,
                                                       .sample_time = s.sample_time},
                                                      s, time, y, u);
  }
  if (s.observer == "nonlinear") {
    return run<esokit::NonlinearEso<Order, double, 1>>(
        {.observer_bandwidth = s.bandwidth,
         .shape = {.gain_alpha = 0.8, .alpha = 1, .gain_beta = 0.2, .beta = 1},
         .allow_uncertified_gain = true,
         .input_gain = s.input_gain,
         .sample_time = s.sample_time},
        s, time, y, u);
  }
  throw esokit::examples::LogError(
      "no observer '" + s.observer +
      "'; there are linear, half-gain, reduced, cascade, algebraic, adjustable, nonlinear");
}

}  // namespace

LogEstimates run_observer(const LogSettings& settings, const std::vector<double>& time,
                          const std::vector<double>& y, const std::vector<double>& u) {
  switch (settings.order) {
    case 1:
      return run_order<1>(settings, time, y, u);
    case 2:
      return run_order<2>(settings, time, y, u);
    case 3:
      return run_order<3>(settings, time, y, u);
    default:
      throw esokit::examples::LogError("the order must be 1, 2 or 3");
  }
}

}  // namespace from_log
