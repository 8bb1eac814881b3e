/// @file
/// CascadeEso: a chain of p linear extended state observers (K. Lakomy, R. Madonski, ISA
/// Transactions 109 (2021) 1-10).
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>
#include <optional>
#include <type_traits>

namespace esokit {

/// Settings of CascadeEso by bandwidths.
/// @tparam Settings settings of a model other than the chain
template <int Size, int Levels, Scalar S, class Placement, class Settings = NoModelSettings>
struct CascadeEsoConfig {
  [[no_unique_address]] ByName<CascadeEsoConfig> by_name{};  ///< nothing to set, see ByName
  S observer_bandwidth{};                                    ///< omega_o1 of level 1, rad/s
  S bandwidth_factor{};  ///< alpha > 1: omega_oi = alpha omega_o(i-1); leave out for one level
  std::optional<Array<S, Levels>> level_bandwidths{};  ///< omega_oi, rad/s; replaces the two above
  S input_gain{};   ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
  S sample_time{};  ///< T, s
  [[no_unique_address]] Settings model{};  ///< what is known of the plant
  int max_gap = 100;  ///< missing samples after which the prediction still counts, 1 .. 65000;
                      ///< after more a correction restarts; see `max_gap()`, `longest_gap()`
};

/// Settings of CascadeEso by poles.
template <int Size, int Levels, Scalar S, ListsPoles Placement, class Settings>
struct CascadeEsoConfig<Size, Levels, S, Placement, Settings> {
  [[no_unique_address]] ByName<CascadeEsoConfig> by_name{};  ///< nothing to set, see ByName

  /// p_i of each level, 1/s; for a pack common to all lanes
  Array<typename Placement::template Spec<Size, LaneScalar<S>>, Levels> level_poles{};
  S input_gain{};                          ///< b0, unit of y^(n) per unit of u; not zero
  S sample_time{};                         ///< T, s
  [[no_unique_address]] Settings model{};  ///< what is known of the plant
  int max_gap = 100;                       ///< as by bandwidths
};

namespace detail {

/// The pole specs of the levels, and the config member that an error names.
template <class Spec, int Levels>
struct LevelSpecs {
  Array<Spec, Levels> specs{};
  const char* field = "";
  bool indexed = true;
};

template <class Placement, int Size, int Levels, Scalar S, class Config>
Expected<LevelSpecs<typename Placement::template Spec<Size, S>, Levels>, Error<S>> level_specs(
    const Config& config) {
  using Specs = LevelSpecs<typename Placement::template Spec<Size, S>, Levels>;
  if constexpr (ListsPoles<Placement>) {
    return Specs{config.level_poles, "level_poles"};
  } else {
    Rules<S> rules;
    if (config.level_bandwidths) {
      constexpr const char* rule = "must be left out if level_bandwidths is given";
      rules.left_out("observer_bandwidth", config.observer_bandwidth, rule)
          .left_out("bandwidth_factor", config.bandwidth_factor, rule);
      if (!rules) return rules.error();
      return Specs{*config.level_bandwidths, "level_bandwidths"};
    }
    Specs levels{{}, "observer_bandwidth", false};
    rules.positive("observer_bandwidth", config.observer_bandwidth);
    if (Levels > 1 || !Rules<S>{}.left_out("", config.bandwidth_factor, "")) {
      rules.above("bandwidth_factor", config.bandwidth_factor, S(1.0));
    }
    if (!rules) return rules.error();
    S bandwidth = config.observer_bandwidth;
    for (S& spec : levels.specs) {
      rules.demand(all(is_finite(bandwidth)), "bandwidth_factor", config.bandwidth_factor,
                   "with observer_bandwidth gives a bandwidth that the scalar cannot hold");
      spec = bandwidth;
      bandwidth = bandwidth * config.bandwidth_factor;
    }
    if (!rules) return rules.error();
    return levels;
  }
}

/// One law for each level, made by `make_law(field, spec, index)`.
template <class Law, class Placement, int Size, int Levels, Scalar S, class Config, class MakeLaw>
Expected<Array<Law, Levels>, Error<S>> level_laws(const Config& config, MakeLaw&& make_law) {
  const auto levels = level_specs<Placement, Size, Levels, S>(config);
  if (!levels) return levels.error();
  // Laws have no empty state, so the array is filled with the first law and then overwritten.
  std::optional<Array<Law, Levels>> laws;
  for (int i = 0; i < Levels; ++i) {
    const auto law = make_law(levels->field, levels->specs[static_cast<std::size_t>(i)],
                              levels->indexed ? i : -1);
    if (!law) return law.error();
    if (!laws) {
      laws = [&]<int... Index>(std::integer_sequence<int, Index...>) {
        return Array<Law, Levels>{((void)Index, *law)...};
      }
      (std::make_integer_sequence<int, Levels>{});
    }
    (*laws)[static_cast<std::size_t>(i)] = *law;
  }
  return *laws;
}

}  // namespace detail

/// Cascade extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// Level 1 is corrected by the measurement; level i is corrected by the output of level i - 1 and
/// driven by u plus the disturbance found so far; equations (23), (24). Measurement noise enters
/// level 1 only, the slowest. The states are those of the last level, the disturbance is the sum
/// over all levels. Stable for every omega_oi T > 0; with one level it is LinearEso. Error-based
/// use: pass e = y_d - y as the measurement and -b0 as input_gain.
///
/// With a model every level contains plant, actuator and sensor: each is corrected by a measurement
/// through the sensor, and the actuator runs open loop in all of them. The noise is that of a
/// cascade of chains: less than with one level of the last bandwidth. Each level also contains the
/// resonators, with the same capture bandwidth. If the frequency of a sine is off by 2 %, the error
/// is a third to a tenth of that with one level of the last bandwidth, at 1.1 to 1.4 times its
/// noise.
///
/// @tparam Order n, with a model the order of the law @tparam Levels p @tparam S scalar
/// @tparam Extension m, with a model `Model::extension`
/// @tparam Placement EqualPoles (config by bandwidths) or PoleSet (config by level_poles;
/// gain/pole_set.hpp)
/// @tparam Model what is known of the plant
template <int Order, int Levels, Scalar S = double, int Extension = 1, class Placement = EqualPoles,
          class Model = ChainModel<Order, S, Extension>>
class CascadeEso : public NamedObserver<
                       CascadeEso<Order, Levels, S, Extension, Placement, Model>,
                       PredictorCorrector<Order, S, Extension,
                                          ConstantGainOf<Model, Order + Extension, S, Placement>,
                                          Levels, Model>> {
  using Shell = typename CascadeEso::NamedObserver;
  friend Shell;
  using Shell::Shell;

 public:
  /// Settings of make.
  using Config =
      CascadeEsoConfig<Order + Extension, Levels, S, Placement, typename Model::Settings>;
  /// The same with another scalar.
  template <class T>
  using with_scalar =
      CascadeEso<Order, Levels, T, Extension, Placement, detail::WithScalar<Model, T>>;

  /// As NamedObserver says. Not a template, so that compilers name a setting that does not exist.
  static Expected<CascadeEso, Error<S>> make(const Config& config) {
    return CascadeEso::NamedObserver::template make<CascadeEso>(config);
  }

 private:
  static auto design(const Config& config, const Model& model) {
    return detail::level_laws<typename Shell::Law, Placement, Order + Extension, Levels, S>(
        config, [&](const char* field, const auto& spec, int index) {
          return Shell::Law::make(field, spec, model, index);
        });
  }
};

/// Distinguishes the type in snapshots.
template <int Order, int Levels, Scalar S, int Extension, class Placement, class Model>
inline constexpr std::uint32_t type_tag<CascadeEso<Order, Levels, S, Extension, Placement, Model>> =
    make_type_tag<S, Placement, Model>("CascadeEso", Order, Levels, Extension);

}  // namespace esokit
