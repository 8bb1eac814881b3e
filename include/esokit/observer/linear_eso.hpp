/// @file
/// LinearEso: the standard linear extended state observer (LESO); Extension > 1 is the generalised
/// ESO (GESO).
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>

namespace esokit {

/// Settings of LinearEso by bandwidth.
/// @tparam Settings settings of a model other than the chain
template <int Size, Scalar S, class Placement, class Settings = NoModelSettings>
struct LinearEsoConfig {
  [[no_unique_address]] ByName<LinearEsoConfig> by_name{};  ///< nothing to set, see ByName
  S observer_bandwidth{};  ///< omega_o, rad/s: all poles at exp(-omega_o T), or as the placement
                           ///< says
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};         ///< T, s
  [[no_unique_address]] Settings model{};  ///< what is known of the plant
  int max_gap = 100;  ///< missing samples after which the prediction still counts, 1 .. 65000;
                      ///< after more a correction restarts; see `max_gap()`, `longest_gap()`
};

/// Settings of LinearEso by poles.
template <int Size, Scalar S, ListsPoles Placement, class Settings>
struct LinearEsoConfig<Size, S, Placement, Settings> {
  [[no_unique_address]] ByName<LinearEsoConfig> by_name{};  ///< nothing to set, see ByName

  /// p_i, 1/s, N poles in the left half plane, complex ones in conjugate pairs; for a pack common
  /// to all lanes
  typename Placement::template Spec<Size, LaneScalar<S>> poles{};
  S input_gain{};                          ///< b0, unit of y^(n) per unit of u; not zero
  S sample_time{};                         ///< T, s
  [[no_unique_address]] Settings model{};  ///< what is known of the plant
  int max_gap = 100;                       ///< as by bandwidth
};

/// Linear extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// Current-estimator form: the estimate after `update` uses y of the same sample. Stable for every
/// omega_o T > 0; unbiased for disturbances that are polynomials of degree < m in time. Error-based
/// use: pass e = y_d - y as the measurement and -b0 as input_gain.
///
/// @tparam Order n @tparam S scalar @tparam Extension m; n + m <= 16, tested up to n = 8 and m = 4
/// @tparam Placement EqualPoles (config by observer_bandwidth) or PoleSet (config by poles;
/// gain/pole_set.hpp)
/// @tparam Model what is known of the plant
template <int Order, Scalar S = double, int Extension = 1, class Placement = EqualPoles,
          class Model = ChainModel<Order, S, Extension>>
class LinearEso
    : public NamedObserver<
          LinearEso<Order, S, Extension, Placement, Model>,
          PredictorCorrector<Order, S, Extension,
                             ConstantGainOf<Model, Order + Extension, S, Placement>, 1, Model>> {
  using Shell = typename LinearEso::NamedObserver;
  friend Shell;
  using Shell::Shell;

 public:
  /// Settings of make.
  using Config = LinearEsoConfig<Order + Extension, S, Placement, typename Model::Settings>;
  /// The same with another scalar.
  template <class T>
  using with_scalar = LinearEso<Order, T, Extension, Placement, detail::WithScalar<Model, T>>;

  /// As NamedObserver says. Not a template, so that compilers name a setting that does not exist.
  static Expected<LinearEso, Error<S>> make(const Config& config) {
    return LinearEso::NamedObserver::template make<LinearEso>(config);
  }

 private:
  static auto design(const Config& config, const Model& model) {
    return detail::placed_law<typename Shell::Law>(config, model);
  }
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension, class Placement, class Model>
inline constexpr std::uint32_t type_tag<LinearEso<Order, S, Extension, Placement, Model>> =
    make_type_tag<S, Placement, Model>("LinearEso", Order, Extension);

}  // namespace esokit
