#include "from_log/parts/log_observer.hpp"

#include <cmath>
#include <limits>
#include <memory>
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

/// An observer without its type, so that what goes over the rows is compiled once.
struct AnyObserver {
  virtual ~AnyObserver() = default;
  virtual esokit::StepStatus reset(double y) = 0;
  virtual esokit::Check<double> set_step_time(double seconds) = 0;
  virtual esokit::StepStatus update(double y, double u) = 0;
  virtual double estimate(int row) const = 0;
};

template <class Observer>
class Typed final : public AnyObserver {
 public:
  using Timed = esokit::VariableTime<Observer>;
  explicit Typed(const Timed& observer) : observer_(observer) {}
  esokit::StepStatus reset(double y) override { return observer_.reset(y); }
  esokit::Check<double> set_step_time(double s) override { return observer_.set_step_time(s); }
  esokit::StepStatus update(double y, double u) override { return observer_.update(y, u); }
  double estimate(int row) const override { return observer_.estimate()(row); }

 private:
  Timed observer_;
};

[[noreturn]] void observer_refuses(const esokit::Error<double>& error) {
  throw esokit::examples::LogError("the observer refuses: " + esokit::to_text(error));
}

template <class Observer>
std::unique_ptr<AnyObserver> timed(const typename Observer::Config& config) {
  const auto made = Typed<Observer>::Timed::make({.observer = config, .ratio = widest_step});
  if (!made) observer_refuses(made.error());
  return std::make_unique<Typed<Observer>>(*made);
}

LogEstimates run(AnyObserver& observer, const LogSettings& settings,
                 const std::vector<double>& time, const std::vector<double>& y,
                 const std::vector<double>& u) {
  LogEstimates result;
  result.columns.resize(static_cast<std::size_t>(settings.order + 1));
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
    for (int r = 0; r <= settings.order; ++r) {
      result.columns[static_cast<std::size_t>(r)].push_back(
          started ? observer.estimate(r) : std::numeric_limits<double>::quiet_NaN());
    }
  }
  return result;
}

template <int Order>
std::unique_ptr<AnyObserver> observer_of(const LogSettings& s) {
  const auto linear = [&](auto observer) {
    using Observer = typename decltype(observer)::type;
    return timed<Observer>({.observer_bandwidth = s.bandwidth,
                            .input_gain = s.input_gain,
                            .sample_time = s.sample_time});
  };
  if (s.observer == "linear") return linear(std::type_identity<esokit::LinearEso<Order>>{});
  if (s.observer == "half-gain") return linear(std::type_identity<esokit::HalfGainEso<Order>>{});
  if (s.observer == "reduced") return linear(std::type_identity<esokit::ReducedOrderEso<Order>>{});
  if (s.observer == "cascade") {
    // Level 1 a third of omega_o, which is that of the last level.
    return timed<esokit::CascadeEso<Order, 2>>({.observer_bandwidth = s.bandwidth / 3,
                                                .bandwidth_factor = 3,
                                                .input_gain = s.input_gain,
                                                .sample_time = s.sample_time});
  }
  if (s.observer == "algebraic") {
    return timed<esokit::AlgebraicEso<Order>>({.observer_bandwidth = s.bandwidth,
                                               .frequency_shift = s.bandwidth / 2,
                                               .input_gain = s.input_gain,
                                               .sample_time = s.sample_time});
  }
  if (s.observer == "adjustable") {
    return timed<esokit::AdjustableBandwidthEso<Order>>({.observer_bandwidth = s.bandwidth,
                                                         .bandwidth_ratio = 0.75,
                                                         .allow_uncertified_switching = true,
                                                         .input_gain = s.input_gain,
                                                         .sample_time = s.sample_time});
  }
  if (s.observer == "nonlinear") {
    return timed<esokit::NonlinearEso<Order, double, 1>>(
        {.observer_bandwidth = s.bandwidth,
         .shape = {.gain_alpha = 0.8, .alpha = 1, .gain_beta = 0.2, .beta = 1},
         .allow_uncertified_gain = true,
         .input_gain = s.input_gain,
         .sample_time = s.sample_time});
  }
  throw esokit::examples::LogError(
      "no observer '" + s.observer +
      "'; there are linear, half-gain, reduced, cascade, algebraic, adjustable, nonlinear");
}

}  // namespace

LogEstimates run_observer(const LogSettings& settings, const std::vector<double>& time,
                          const std::vector<double>& y, const std::vector<double>& u) {
  if (settings.order < 1 || settings.order > 3)
    throw esokit::examples::LogError("the order must be 1, 2 or 3");
  const auto observer = settings.order == 1   ? observer_of<1>(settings)
                        : settings.order == 2 ? observer_of<2>(settings)
                                              : observer_of<3>(settings);
  return run(*observer, settings, time, y, u);
}

}  // namespace from_log
