/// @file
/// LinearEso: the standard linear extended state observer (LESO); Extension > 1 is the generalised
/// ESO (GESO).
#pragma once

#include <esokit/core/type_tag.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <esokit/observer/continuous_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>

namespace esokit {

/// Config of LinearEso by bandwidth or by poles.
/// @tparam Settings of a model other than the chain
template <int Size, Scalar S, class Placement, class Settings = NoModelSettings>
struct LinearEsoConfig;

/// Settings of LinearEso by bandwidth.
template <int Size, Scalar S>
struct LinearEsoConfig<Size, S, EqualPoles> {
  S observer_bandwidth{};  ///< omega_o, rad/s: all poles at exp(-omega_o T)
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};         ///< T, s
  int max_gap = 100;       ///< missing samples that a correction may bridge before it restarts

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "observer_bandwidth";
  /// What the poles are placed by.
  [[nodiscard]] const S& placement() const noexcept { return observer_bandwidth; }
  /// @cond
  static constexpr auto fields(auto& c) noexcept {
    return std::tie(c.observer_bandwidth, c.input_gain, c.sample_time, c.max_gap);
  }
  /// @endcond
};

/// Settings of LinearEso by bandwidth, with a model of the plant.
template <int Size, Scalar S, class Settings>
requires(!std::same_as<Settings, NoModelSettings>)  //
    struct LinearEsoConfig<Size, S, EqualPoles, Settings> {
  S observer_bandwidth{};  ///< omega_o, rad/s: all poles at exp(-omega_o T)
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};         ///< T, s
  Settings model{};        ///< what is known of the plant
  int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts; fewer
                      ///< where the model says so, see `max_gap()`

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "observer_bandwidth";
  /// What the poles are placed by.
  [[nodiscard]] const S& placement() const noexcept { return observer_bandwidth; }
};

/// Settings of LinearEso by poles.
template <int Size, Scalar S, ListsPoles Placement>
struct LinearEsoConfig<Size, S, Placement> {
  using Poles = typename Placement::template Spec<Size, LaneScalar<S>>;  ///< one a row of the gain

  Poles poles{};      ///< p_i, 1/s, left half plane, in conjugate pairs; of a pack of all lanes
  S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero
  S sample_time{};    ///< T, s
  int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "poles";
  /// What the poles are placed by.
  [[nodiscard]] const Poles& placement() const noexcept { return poles; }
  /// @cond
  static constexpr auto fields(auto& c) noexcept {
    return std::tie(c.poles, c.input_gain, c.sample_time, c.max_gap);
  }
  /// @endcond
};

/// Linear extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// Current-estimator form: the estimate after `update` uses y of the same sample. Stable for every
/// omega_o T > 0; unbiased for disturbances that are polynomials of degree < m in time.
/// Error-based use: feed e = y_d - y as the measurement and give -b0 as input_gain.
///
/// @tparam Order n @tparam S scalar @tparam Extension m; n + m <= 16, tested for n to 8 and m to 4
/// @tparam Placement EqualPoles (config by observer_bandwidth) or PoleSet (config by poles;
/// gain/pole_set.hpp)
/// @tparam Model what is known of the plant
template <int Order, Scalar S = double, int Extension = 1, class Placement = EqualPoles,
          class Model = ChainModel<Order, S, Extension>>
class LinearEso
    : public PredictorCorrector<Order, S, Extension,
                                ConstantGainOf<Model, Order + Extension, S, Placement>, 1, Model> {
  using Law = ConstantGainOf<Model, Order + Extension, S, Placement>;
  using Base = PredictorCorrector<Order, S, Extension, Law, 1, Model>;

 public:
  /// Settings of make.
  using Config = LinearEsoConfig<Base::size, S, Placement, typename Model::Settings>;
  /// The same of another scalar.
  template <class T>
  using with_scalar = LinearEso<Order, T, Extension, Placement, detail::WithScalar<Model, T>>;

  /// Checks the settings and does all the design work.
  /// @return the observer at rest in zero, or an error that names the field
  static Expected<LinearEso, Error<S>> make(const Config& config) {
    if constexpr (PackScalar<S>) {
      return detail::make_lanes<LinearEso>(config);
    } else {
      const ChainConfig<S> chain{config.input_gain, config.sample_time, config.max_gap};
      // The chain is checked first: the law divides by what it checks.
      if (auto ok = Base::check_chain(chain); !ok) return ok.error();
      const auto model = detail::make_model<Model>(
          config, [](const auto& c) -> const auto& { return c.model; });
      if (!model) return model.error();
      const auto law = Law::make(Config::placement_field, config.placement(), *model);
      if (!law) return law.error();
      return LinearEso(*model, *law, law->longest_gap(config.max_gap));
    }
  }

  /// New settings while running: the estimate is kept, a change of b0 is moved into the
  /// disturbance. A refused config changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

 private:
  LinearEso(const Model& model, const Law& law, int max_gap) noexcept
      : Base(model, {law}, max_gap) {}
};

/// Told apart in snapshots.
template <int Order, Scalar S, int Extension, class Placement, class Model>
inline constexpr std::uint32_t type_tag<LinearEso<Order, S, Extension, Placement, Model>> =
    make_type_tag<S, Placement, Model>("LinearEso", Order, Extension);

/// Config of ContinuousLinearEso by bandwidth or by poles.
template <int Size, Scalar S, class Placement>
struct ContinuousLinearEsoConfig;

/// Settings of ContinuousLinearEso by bandwidth.
template <int Size, Scalar S>
struct ContinuousLinearEsoConfig<Size, S, EqualPoles> {
  S observer_bandwidth{};  ///< omega_o, rad/s: all poles at -omega_o
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "observer_bandwidth";
  /// What the poles are placed by.
  [[nodiscard]] const S& placement() const noexcept { return observer_bandwidth; }
};

/// Settings of ContinuousLinearEso by poles.
template <int Size, Scalar S, ListsPoles Placement>
struct ContinuousLinearEsoConfig<Size, S, Placement> {
  using Poles = typename Placement::template Spec<Size, S>;  ///< one a row of the gain

  Poles poles{};   ///< p_i, 1/s, left half plane, in conjugate pairs
  S input_gain{};  ///< b0, unit of y^(n) per unit of u; not zero

  /// Name of what the poles are placed by, for errors.
  static constexpr const char* placement_field = "poles";
  /// What the poles are placed by.
  [[nodiscard]] const Poles& placement() const noexcept { return poles; }
};

/// LinearEso as an ODE, z' = A z + B u + l (y - z_1), for simulation.
/// @tparam Order n @tparam S scalar @tparam Extension m
/// @tparam Placement EqualPoles (config by observer_bandwidth) or PoleSet (config by poles;
/// gain/pole_set.hpp)
template <int Order, Scalar S = double, int Extension = 1, class Placement = EqualPoles>
class ContinuousLinearEso
    : public ContinuousObserver<Order, S, Extension,
                                ContinuousConstantGain<Order + Extension, S, Placement>> {
  using Law = ContinuousConstantGain<Order + Extension, S, Placement>;
  using Base = ContinuousObserver<Order, S, Extension, Law>;

 public:
  using Config = ContinuousLinearEsoConfig<Base::size, S, Placement>;  ///< settings of make

  /// Checks the settings and does all the design work.
  /// @return the observer's equations, or an error that names the field
  static Expected<ContinuousLinearEso, Error<S>> make(const Config& config) {
    if (Rules<S> rules; !rules.nonzero("input_gain", config.input_gain)) return rules.error();
    auto law = Law::make(Config::placement_field, config.placement());
    if (!law) return law.error();
    return ContinuousLinearEso(config.input_gain, *law);
  }

 private:
  ContinuousLinearEso(const S& input_gain, const Law& law) : Base(input_gain, {law}) {}
};

}  // namespace esokit
