/// @file
/// The settings of MimoExtendedStateFilter, and their rules.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/gain/detail/noise_settings.hpp>
#include <esokit/gain/mimo_riccati.hpp>
#include <esokit/gain/riccati_settings.hpp>
#include <optional>

namespace esokit {

/// Config of MimoExtendedStateFilter.
template <class Orders, int Inputs, Scalar S, int Extension>
struct MimoExtendedStateFilterConfig {
  [[no_unique_address]] ByName<MimoExtendedStateFilterConfig>
      by_name{};                                                  ///< nothing to set, see ByName
  static constexpr int outputs = Orders::count;                   ///< p
  static constexpr int size = Orders::sum + outputs * Extension;  ///< N
  using Covariance = Matrix<S, size, size>;                       ///< N x N
  using OutputCovariance = Matrix<S, outputs, outputs>;           ///< p x p

  Matrix<S, outputs, Inputs> input_matrix = Matrix<S, outputs, Inputs>::Zero();  ///< B0, p x q
  S sample_time{};                                                               ///< T, s
  OutputCovariance measurement_covariance = OutputCovariance::Zero();  ///< R, p x p, semidefinite
  Array<S, size> disturbance_bounds{};                 ///< q_r per state, as in ExtendedStateFilter
  S bound_factor{static_cast<double>(size)};           ///< c
  std::optional<Covariance> process_covariance{};      ///< Q, N x N, replaces the bounds
  Covariance initial_covariance = Covariance::Zero();  ///< P0, N x N, positive semidefinite
  InflationRule inflation_rule = InflationRule::fixed;  ///< fixed or none
  S inflation{};                                        ///< theta > 0 of the fixed rule
  RiccatiMode mode = RiccatiMode::recursive;            ///< recursive or frozen
  bool allow_vanishing_gain = false;                    ///< see ExtendedStateFilter
  int max_gap = 100;  ///< missing samples of a channel in a row that a correction may bridge,
                      ///< 1 .. 65000; after more its chain restarts from the measurement
};

namespace detail {

/// The rules that need no design.
template <class Orders, int Inputs, Scalar S, int Extension>
Check<S> check_filter(const MimoExtendedStateFilterConfig<Orders, Inputs, S, Extension>& config) {
  using Rows = ChainRows<Orders, Extension>;
  constexpr int outputs = Orders::count;
  Rules<S> rules;
  rules.positive("sample_time", config.sample_time)
      .invertible("sample_time", config.sample_time)
      .demand(1 <= config.max_gap && config.max_gap <= 65000, "max_gap",
              static_cast<S>(config.max_gap), "must be 1 .. 65000");
  for (int i = 0; i < outputs; ++i) {
    for (int j = 0; j < Inputs; ++j) {
      rules.finite("input_matrix", config.input_matrix(i, j), i * Inputs + j);
    }
    S unit(1);
    for (int r = 1; r < Rows::order_of(i) + Extension; ++r) {
      unit = unit * config.sample_time / static_cast<S>(r);
      rules.representable("sample_time", config.sample_time, unit,
                          "to the power of a chain's highest state, over its factorial, leaves "
                          "the scalar's range");
      for (int j = 0; r == Rows::order_of(i) && j < Inputs; ++j) {
        const S& gain = config.input_matrix(i, j);
        if (!(absolute(gain) > S(0))) continue;
        rules.representable("input_matrix", gain, S(gain * unit),
                            "times T^n / n! gives a gain that the scalar cannot hold",
                            i * Inputs + j);
      }
    }
  }
  rules
      .demand(largest_magnitude(config.input_matrix) > S(0), "input_matrix", S(0),
              "must not be zero")
      .demand(config.inflation_rule != InflationRule::adaptive, "inflation_rule", S(0),
              "must be fixed or none for several chains");
  rules.all_of(check_inflation<S>(config))
      .demand(config.mode != RiccatiMode::start_table, "mode", S(0),
              "must be recursive or frozen for several chains");
  rules.all_of(check_covariance("measurement_covariance", config.measurement_covariance, false));
  if (config.process_covariance) {
    rules.all_of(check_covariance("process_covariance", *config.process_covariance, false));
  }
  return rules.all_of(check_covariance("initial_covariance", config.initial_covariance, false));
}

}  // namespace detail
}  // namespace esokit
