/// @file
/// Identified: a model with error bars and the evidence for it; the options of an identification.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/seen_curve.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/model_eso.hpp>
#include <functional>
#include <vector>

namespace esokit {

/// Options of an identification.
struct IdentifyOptions {
  ByName<IdentifyOptions> by_name{};  ///< nothing to set, see ByName
  std::vector<int> orders{1, 2, 3};   ///< the orders n to try
  bool friction = true;               ///< a column tanh(v / v_s) for orders 1 and 2
  bool pole = true;                   ///< whether the plant may have a pole

  /// Columns y, y^2 and y^3 (gravity, springs) for orders 2 and 3, if they improve the fit.
  bool position = true;
  int extension = 0;      ///< m: 1 or 2 integrators of the disturbance; 0: chosen by the fit
  int sinusoids = 3;      ///< largest number of sines in the disturbance
  int schedule_bins = 4;  ///< number of ranges of the scheduling column, with equal numbers of rows
  int averaged = 0;       ///< rows to average into one; 0: chosen from the innovations
  std::size_t rows_max = 20000;  ///< rows used of a longer log, in evenly spread pieces

  /// Whether u is what the actuator held. A command beyond its limits is not.
  bool applied = true;

  /// Whether the effect of a column may be late: its lag and its dead time are found. A known
  /// effect (gravity, friction of another joint) acts at once.
  bool late_columns = true;

  /// Whether u may have been logged a row or two late, after it had acted: taken where that makes
  /// the log far more likely (`Identified::late_rows`).
  bool late_input = true;
  double interval_max = 0.1;      ///< largest half width of the interval of b0, share of b0
  double interval_agreed = 0.35;  ///< the same if output error finds the same b0
  double plateau_max = 0.1;       ///< largest relative difference of b0 between three bandwidths
  double correlation_max = 0.1;   ///< largest correlation of innovations, lags 1 to 20; 1: no check
  bool scheduled = false;         ///< accept a b0 that depends on the scheduling column
  double friction_shift_max =
      3;  ///< largest difference of b0 between friction scales, standard errors
  double position_shift_max = 1.5;  ///< largest change of b0 by a force by position, half widths
  std::function<void(double)> progress{};  ///< called with the finished share, 0 to 1
};

/// The best fit of one order.
struct OrderFit {
  FitModel model{};             ///< n, m and whether it has a pole
  FitBounds bounds{};           ///< of its parameters
  Fit fit{};                    ///< the fit with the smallest innovations
  double friction_scale = 0.0;  ///< v_s, 0 without friction
  double criterion = 0.0;  ///< rows log(mean square) + parameters log(rows): the smallest is best

  /// log(mean square) at lower bandwidths: the mean over 1 / sqrt(10) and a tenth of the lowest
  /// bandwidth of all orders.
  double slower = 0.0;
  double correlation = 0.0;  ///< largest correlation of the innovations over lags 1 to 20
  Estimate noise{};          ///< from the fast part of the innovations, unit of y; 0: unknown
};

/// b0 for a range of the scheduling column.
struct GainInRange {
  double from = 0.0;      ///< smallest value of the column
  double to = 0.0;        ///< largest value of the column
  std::size_t rows = 0;   ///< number of rows in the range
  Estimate input_gain{};  ///< b0 in the range
};

/// A force that depends on the position, such as gravity or a spring: a cubic of y as the log
/// tells it, without its constant.
struct PositionForce {
  double middle = 0.0;                ///< mean y of the log
  double size = 0.0;                  ///< rms of y - middle
  double low = 0.0;                   ///< least y of the log, which knows no more
  double high = 0.0;                  ///< largest y of the log
  std::array<Estimate, 3> factors{};  ///< of x, x^2, x^3 with x = (y - middle) / size; unit of
                                      ///< y^(n)

  /// Unit of y^(n), as it acts; beyond the range of the log it stays as at its end.
  [[nodiscard]] double operator()(double y) const;
  /// A bound on its error, 95 %, as if all factors were wrong together.
  [[nodiscard]] double half_width(double y) const;
};

/// Another order at the bandwidth at which b0 was found.
struct OtherOrder {
  int order = 0;      ///< of 1 to 3, the one that leaves the smallest mean square there; 0: none
  double left = 1.0;  ///< its mean square over that of the identified order
};

/// A model with error bars, and the evidence for it.
struct Identified {
  int order = 0;              ///< n
  int extension = 1;          ///< m
  Estimate input_gain{};      ///< b0, unit of y^(n) per unit of u
  Estimate latency{};         ///< lag plus dead time, s
  Estimate lag{};             ///< tau, s
  Estimate dead_time{};       ///< L, s
  Estimate pole{};            ///< a, 1/s
  Estimate friction{};        ///< Coulomb friction, unit of y^(n); 0 if not fitted
  double friction_scale = 0;  ///< v_s of friction tanh(v / v_s), unit of y / s (order 1: y)
  Estimate noise{};           ///< standard deviation of the measurement noise, unit of y
  double disturbance = 0;     ///< intensity of d^(m): variance of its increments per time

  /// What the log's own columns add to y^(n).
  std::vector<MeasuredEffect> columns{};

  /// `disturbance` if the columns were not measured, so that they are a part of d. Not of those
  /// that are functions of y. 0 without columns.
  double disturbance_unmeasured = 0;
  std::vector<Sinusoid> sinusoids{};    ///< sines in the disturbance, the largest first
  std::vector<GainInRange> schedule{};  ///< b0 over the log's scheduling column
  Estimate schedule_slope{};  ///< slope of b0 over the scheduling column, from a straight line
  double schedule_shift = 0;  ///< largest difference of b0 over the column, divided by its interval
  double friction_shift = 0;  ///< difference of b0 between friction scales, standard errors of b0

  /// Whether y, y^2 and y^3 were fitted as columns. In `plant` and `model` this force is part of
  /// the disturbance.
  bool position = false;
  PositionForce position_force{};  ///< what was fitted

  /// Change of b0 if these columns are added, in half widths of b0 (of at least 1 % of b0), with
  /// the drift of b0 over one and a half octaves. If they are in the model, the next three powers
  /// are added.
  double position_shift = 0;
  double correlation = 0;          ///< largest correlation of the innovations over lags 1 to 20
  SecondOpinion second_opinion{};  ///< b0 by output error
  GainBySize by_size{};            ///< b0 at small and at large u
  SeenCurve curve{};               ///< of the actuator, where b0 depends on the size of u
  GainInMotion in_motion{};        ///< b0 in motion and at standstill, of order 2; not if `held`

  /// Share of the rows at standstill in which friction holds the machine against u (order 2), so
  /// that b0, pole and friction are fitted without u there; 0: it does not hold. Latency, lag and
  /// dead time are of all rows.
  double held = 0;
  double rise = 0;           ///< how fast y changes, over what b0 and pole allow (order 1)
  int late_rows = 0;         ///< rows by which u was taken earlier than it was logged
  Lead lead{};               ///< how early y moves before u, if it does
  OtherOrder other_order{};  ///< the other order that explains the log best there
  bool at_once = false;      ///< y follows u within the row, with nothing in between
  int averaged = 1;          ///< rows of the log that were averaged into one
  bool at_bound = false;     ///< a parameter is at a bound of its range at the plateau
  double excitation = 0;     ///< smallest relative standard error of b0
  double own_input = 1;      ///< share of u that does not follow from y and the row before

  /// How fast u as a function of y alone lets y return, over what it would be without the pole
  /// (order 1). Of an unstable pole and next to nothing: the law was found, not the machine.
  double returns = 1;
  LogReport log{};                 ///< the report on the log before any fit
  Plateau plateau{};               ///< b0 over the bandwidth
  std::vector<OrderFit> orders{};  ///< best fit of each order, by order

  /// The identified plant, for simulation, analysis and observers; d enters at y^(n).
  /// @tparam Order n, which must be the identified order
  template <int Order>
  [[nodiscard]] Expected<LinearPlant<Order + 1>, Error<double>> plant() const {
    if (order != Order) {
      return Error<double>{
          "order", static_cast<double>(order), "is not the requested order, which is",
          -1,      static_cast<double>(Order), true};
    }
    typename LinearPlant<Order>::Chain chain;
    chain.coefficients[Order - 1] = pole.value;
    chain.input_gain = input_gain.value;
    chain.dead_time = dead_time.value;
    const auto rigid = LinearPlant<Order>::chain(chain);
    if (!rigid) return rigid.error();
    return with_lag(*rigid, lag.value);
  }

  /// The identified model as settings of an AugmentedModel: the lag as its actuator, the pole as
  /// its plant_poles, the largest sinusoids as its resonators. Effects without a part in `Parts`
  /// are left to the disturbance.
  /// @tparam Parts with the identified order and without a sensor, which a log cannot distinguish
  /// from an actuator
  template <ModelParts Parts>
  [[nodiscard]] Expected<typename AugmentedModel<Parts>::Settings, Error<double>> model() const {
    static_assert(Parts.actuator <= 1, "esokit: identify finds a lag of first order");
    static_assert(Parts.sensor == 0 && Parts.first_order == 0 && !Parts.follows_speed,
                  "esokit: identify finds no sensor, no first-order disturbances and no speed");
    Rules<double> rules;
    rules.demand(order == Parts.order,
                 {"order", static_cast<double>(order), "is not the requested order, which is", -1,
                  static_cast<double>(Parts.order), true});
    const auto count = static_cast<std::size_t>(Parts.resonators);
    rules.demand(sinusoids.size() >= count, {"sinusoids", static_cast<double>(sinusoids.size()),
                                             "were found, fewer than the requested resonators:", -1,
                                             static_cast<double>(Parts.resonators), true});
    if (!rules) return rules.error();
    typename AugmentedModel<Parts>::Settings settings;
    if constexpr (Parts.plant_poles) settings.plant[Parts.order - 1] = pole.value;
    if constexpr (Parts.actuator == 1) settings.actuator.time_constant = lag.value;
    if constexpr (Parts.resonators > 0) {
      for (std::size_t i = 0; i < count; ++i) {
        settings.resonators[i].frequency = sinusoids[i].frequency.value;
      }
    }
    return settings;
  }

  /// The config of a ModelEso with the identified model.
  /// @param observer_bandwidth omega_o, rad/s @param sample_time of the controller, s
  template <ModelParts Parts>
  [[nodiscard]] Expected<typename ModelEso<Parts>::Config, Error<double>> observer(
      double observer_bandwidth, double sample_time) const {
    const auto settings = model<Parts>();
    if (!settings) return settings.error();
    typename ModelEso<Parts>::Config config;
    config.observer_bandwidth = observer_bandwidth;
    config.input_gain = input_gain.value;
    config.sample_time = sample_time;
    config.model = *settings;
    return config;
  }

  /// Where the disturbance comes above the noise: the bandwidth of a Kalman filter for both, rad/s.
  [[nodiscard]] double disturbance_bandwidth() const { return bandwidth_of(disturbance); }

  /// Intensity of the random walk that stands for the disturbance, (unit of y^(n))^2 / s: of equal
  /// power at disturbance_bandwidth(). For m = 1 it is `disturbance`.
  [[nodiscard]] double random_walk() const { return walk_of(disturbance); }
  /// The same without the columns, see `disturbance_unmeasured`.
  [[nodiscard]] double random_walk_unmeasured() const { return walk_of(disturbance_unmeasured); }

  /// The dead time in samples, for DelayedInput. @param sample_time s, above 0
  [[nodiscard]] int delay(double sample_time) const {
    return static_cast<int>(std::lround(dead_time.value / sample_time));
  }

 private:
  [[nodiscard]] double bandwidth_of(double intensity) const;
  [[nodiscard]] double walk_of(double intensity) const {
    return intensity / std::pow(bandwidth_of(intensity), 2 * (extension - 1));
  }
};

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/identified.ipp>
#endif
