/// @file
/// The continuous-time observers as ODEs, to simulate as the papers do: one shell for all gain
/// laws, and the continuous form of each named observer.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/interval.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/gain/certificate/continuous_certificate.hpp>
#include <esokit/gain/half_gain.hpp>
#include <esokit/gain/nonlinear_gain_design.hpp>
#include <esokit/model/scaled_chain.hpp>
#include <esokit/observer/adjustable_bandwidth_eso.hpp>
#include <esokit/observer/cascade_eso.hpp>
#include <esokit/sim/continuous_gain_law.hpp>
#include <limits>
#include <optional>

namespace esokit {

/// z' = A z + B u + l(t, e) e on `Levels` chains in series. This type only defines the equations:
/// the caller holds the state, usually stacked with that of a plant.
///
/// As in PredictorCorrector, level i is driven by u and the disturbances of the levels below it;
/// its innovation is e_1 = y - x_1, e_i = x_{i-1} - x_i (first elements).
/// @tparam Order n @tparam Extension m @tparam Law ContinuousGainLaw @tparam Levels p
template <int Order, Scalar S, int Extension, class Law, int Levels = 1>
requires ContinuousGainLaw<Law, Order + Extension, S>
class ContinuousObserver {
 public:
  static constexpr int order = Order;                             ///< n, order of the plant
  static constexpr int extension = Extension;                     ///< m, extended states
  static constexpr int size = ChainSize<Order, Extension>::size;  ///< N = n + m
  static constexpr int levels = Levels;                           ///< p
  static constexpr int states = Levels * size;                    ///< N p
  using scalar_type = S;                                          ///< type of states and settings
  using Estimate = Vector<S, size>;  ///< (y, .., y^(n-1), d, .., d^(m-1)), N x 1
  using State = Vector<S, states>;   ///< states of all levels, stacked, N p x 1
  using Laws = Array<Law, Levels>;   ///< one for each level

  /// From finished gain laws; use this for a law of your own.
  /// @param input_gain b0, unit of y^(n) per unit of u @param laws one for each level
  /// @return error if b0 is zero or not finite
  static Expected<ContinuousObserver, Error<S>> make(const S& input_gain, const Laws& laws) {
    if (Rules<S> rules; !rules.nonzero("input_gain", input_gain)) return rules.error();
    return ContinuousObserver(input_gain, laws);
  }

  /// dz/dt, N p x 1. @param t s @param z N p x 1 @param y measurement @param u input
  [[nodiscard]] State derivative(const S& t, const State& z, const S& y, const S& u) const {
    State rate;
    S measured = y;
    S drive = input_gain_ * u;
    for (int level = 0; level < Levels; ++level) {
      const int first = level * size;
      const S innovation = measured - z(first);
      const Estimate gain = laws_[static_cast<std::size_t>(level)].gain(t, innovation);
      for (int i = 0; i < size; ++i) {
        rate(first + i) = gain(i) * innovation;
        if (i + 1 < size) rate(first + i) = rate(first + i) + z(first + i + 1);
      }
      rate(first + Order - 1) = rate(first + Order - 1) + drive;
      drive = drive + z(first + Order);
      measured = z(first);
    }
    return rate;
  }

  /// Call this at the start of each integration step: a switched law may change its mode only
  /// there.
  void begin_step([[maybe_unused]] const S& t, [[maybe_unused]] const State& z,
                  [[maybe_unused]] const S& y) {
    if constexpr (detail::declared_traits<Law, ContinuousGainLawTraits>.begins_steps) {
      S measured = y;
      for (int level = 0; level < Levels; ++level) {
        laws_[static_cast<std::size_t>(level)].begin_step(t, measured - z(level * size));
        measured = z(level * size);
      }
    }
  }

  /// (y, .., y^(n-1), d, .., d^(m-1)): plant states of the last level, disturbance summed over all
  /// levels, equation (24) of the cascade paper (K. Lakomy, R. Madonski, ISA Transactions 109
  /// (2021) 1-10).
  [[nodiscard]] static Estimate estimate(const State& z) {
    Estimate estimate = z.template segment<size>(states - size);
    for (int level = 0; level + 1 < Levels; ++level) {
      for (int i = Order; i < size; ++i) estimate(i) = estimate(i) + z(level * size + i);
    }
    return estimate;
  }

  /// dhat, unit of y^(n).
  [[nodiscard]] static S total_disturbance(const State& z) {
    S sum = z(Order);
    for (int level = 1; level < Levels; ++level) sum = sum + z(level * size + Order);
    return sum;
  }

  /// State in which every level has the given estimate; the first level holds the disturbance.
  [[nodiscard]] static State state_at(const Estimate& estimate) {
    State state;
    for (int level = 0; level < Levels; ++level) {
      const int given = level == 0 ? size : Order;
      for (int i = 0; i < given; ++i) state(level * size + i) = estimate(i);
    }
    return state;
  }

  /// b0.
  [[nodiscard]] const S& input_gain() const noexcept { return input_gain_; }

 protected:
  /// `input_gain` is already checked. @param laws one for each level, or one law for one level
  template <class Given>
  ContinuousObserver(const S& input_gain, const Given& laws)
      : laws_{laws}, input_gain_(input_gain) {}

 private:
  Laws laws_;
  S input_gain_;
};

/// The common base of the named continuous observers: `make` from a config.
/// @tparam Self the observer itself; its `design(config)` returns its law, or one for each level,
/// or an error @tparam Base ContinuousObserver
template <class Self, class Base>
class NamedContinuousObserver : public Base {
 public:
  using scalar_type = typename Base::scalar_type;  ///< type of states and settings

  /// Checks the settings and does all the design work.
  /// @return the observer, or an error that names the field
  template <class O = Self>
  static Expected<Self, Error<scalar_type>> make(const typename O::Config& config) {
    if (Rules<scalar_type> rules; !rules.nonzero("input_gain", config.input_gain))
      return rules.error();
    const auto laws = O::design(config);
    if (!laws) return laws.error();
    return Self(config.input_gain, *laws);
  }

 protected:
  using Law = typename Base::Laws::value_type;  ///< result of `design`
  using Base::Base;
};

/// Settings of ContinuousLinearEso by bandwidth.
template <int Size, Scalar S, class Placement>
struct ContinuousLinearEsoConfig {
  [[no_unique_address]] ByName<ContinuousLinearEsoConfig>
      by_name{};           ///< nothing to set, see ByName
  S observer_bandwidth{};  ///< omega_o, rad/s: all poles at -omega_o, or as the placement says
  S input_gain{};          ///< b0, unit of y^(n) per unit of u; not zero
};

/// Settings of ContinuousLinearEso by poles.
template <int Size, Scalar S, ListsPoles Placement>
struct ContinuousLinearEsoConfig<Size, S, Placement> {
  [[no_unique_address]] ByName<ContinuousLinearEsoConfig>
      by_name{};  ///< nothing to set, see ByName

  /// p_i, 1/s, N poles in the left half plane, complex ones in conjugate pairs
  typename Placement::template Spec<Size, S> poles{};
  S input_gain{};  ///< b0, unit of y^(n) per unit of u; not zero
};

/// LinearEso as an ODE, z' = A z + B u + l (y - z_1), for simulation.
/// @tparam Order n @tparam S scalar @tparam Extension m @tparam Placement as for LinearEso
template <int Order, Scalar S = double, int Extension = 1, class Placement = EqualPoles>
class ContinuousLinearEso
    : public NamedContinuousObserver<
          ContinuousLinearEso<Order, S, Extension, Placement>,
          ContinuousObserver<Order, S, Extension,
                             ContinuousConstantGain<Order + Extension, S, Placement>>> {
  using Shell = typename ContinuousLinearEso::NamedContinuousObserver;
  friend Shell;
  using Shell::Shell;

 public:
  using Config = ContinuousLinearEsoConfig<Order + Extension, S, Placement>;  ///< settings of make

 private:
  static auto design(const Config& config) {
    return detail::placed_law<typename Shell::Law>(config);
  }
};

/// HalfGainEso as an ODE, with exactly half the gains.
template <int Order, PlainScalar S = double, int Extension = 1>
using ContinuousHalfGainEso = ContinuousLinearEso<Order, S, Extension, HalfGainPoles>;

/// Settings of ContinuousCascadeEso by bandwidths.
template <int Size, int Levels, Scalar S, class Placement>
struct ContinuousCascadeEsoConfig {
  [[no_unique_address]] ByName<ContinuousCascadeEsoConfig>
      by_name{};           ///< nothing to set, see ByName
  S observer_bandwidth{};  ///< omega_o1 of level 1, rad/s
  S bandwidth_factor{};    ///< alpha > 1: omega_oi = alpha omega_o(i-1); leave out for one level
  std::optional<Array<S, Levels>> level_bandwidths{};  ///< omega_oi, rad/s; replaces the two above
  S input_gain{};  ///< b0, unit of y^(n) per unit of u; not zero
};

/// Settings of ContinuousCascadeEso by poles.
template <int Size, int Levels, Scalar S, ListsPoles Placement>
struct ContinuousCascadeEsoConfig<Size, Levels, S, Placement> {
  [[no_unique_address]] ByName<ContinuousCascadeEsoConfig>
      by_name{};  ///< nothing to set, see ByName
  Array<typename Placement::template Spec<Size, S>, Levels>
      level_poles{};  ///< p_i of each level, 1/s
  S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero
};

/// CascadeEso as an ODE, equations (23), (24), for simulation.
/// @tparam Order n @tparam Levels p @tparam S scalar @tparam Extension m
/// @tparam Placement EqualPoles (config by bandwidths) or PoleSet (config by level_poles;
/// gain/pole_set.hpp)
template <int Order, int Levels, Scalar S = double, int Extension = 1, class Placement = EqualPoles>
class ContinuousCascadeEso
    : public NamedContinuousObserver<
          ContinuousCascadeEso<Order, Levels, S, Extension, Placement>,
          ContinuousObserver<Order, S, Extension,
                             ContinuousConstantGain<Order + Extension, S, Placement>, Levels>> {
  using Shell = typename ContinuousCascadeEso::NamedContinuousObserver;
  friend Shell;
  using Shell::Shell;

 public:
  /// Settings of make.
  using Config = ContinuousCascadeEsoConfig<Order + Extension, Levels, S, Placement>;

 private:
  static auto design(const Config& config) {
    return detail::level_laws<typename Shell::Law, Placement, Order + Extension, Levels, S>(
        config, [](const char* field, const auto& spec, int index) {
          return Shell::Law::make(field, spec, index);
        });
  }
};

/// AdjustableBandwidthEso as an ODE, for simulation; it switches at step boundaries.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
class ContinuousAdjustableBandwidthEso
    : public NamedContinuousObserver<
          ContinuousAdjustableBandwidthEso<Order, S, Extension>,
          ContinuousObserver<Order, S, Extension, ContinuousSwitchedGain<Order + Extension, S>>> {
  using Shell = typename ContinuousAdjustableBandwidthEso::NamedContinuousObserver;
  friend Shell;
  using Shell::Shell;
  using Law = typename Shell::Law;

 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};     ///< nothing to set, see ByName
    S observer_bandwidth{};                             ///< omega_o, rad/s
    S bandwidth_ratio = S(1.0);                         ///< rho > 0
    SwitchingRule rule = SwitchingRule::abeso;          ///< abeso or beso
    SignReading sign_reading = SignReading::magnitude;  ///< printed: as in the paper's equation
    bool allow_uncertified_switching = false;           ///< accept a ratio without a certificate
    S input_gain{};  ///< b0, unit of y^(n) per unit of u; not zero
  };

 private:
  static Expected<Law, Error<S>> design(const Config& config) {
    constexpr int size = Order + Extension;
    const auto pair =
        detail::bandwidth_pair<size, S>(config.observer_bandwidth, config.bandwidth_ratio,
                                        config.rule, S(0.0), config.allow_uncertified_switching);
    if (!pair) return pair.error();
    const auto shrinking = continuous_gain<size, S>(pair->shrinking);
    const auto otherwise = continuous_gain<size, S>(pair->otherwise);
    Rules<S> rules;
    for (const auto& gain : {shrinking, otherwise}) {
      rules.representable("observer_bandwidth", config.observer_bandwidth, S(gain(size - 1)),
                          "gives a gain that the scalar cannot hold");
    }
    if (!rules) return rules.error();
    return Law(shrinking, otherwise, config.sign_reading);
  }
};

/// AlgebraicEso as an ODE, z' = A z + B u + L(t) (y - z_1), for t > 0; for the form that is
/// regular at t = 0 see examples/paper2_fsb_algebraic_eso/algebraic_filter.hpp.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
class ContinuousAlgebraicEso
    : public NamedContinuousObserver<
          ContinuousAlgebraicEso<Order, S, Extension>,
          ContinuousObserver<Order, S, Extension, ContinuousAlgebraicGain<Order + Extension, S>>> {
  using Shell = typename ContinuousAlgebraicEso::NamedContinuousObserver;
  friend Shell;
  using Shell::Shell;

 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S observer_bandwidth{};                          ///< lambda >= 0, rad/s
    S frequency_shift{};                             ///< q >= 0, rad/s
    S input_gain{};                                  ///< b0, unit of y^(n) per unit of u; not zero
  };

 private:
  static Expected<typename Shell::Law, Error<S>> design(const Config& config) {
    Rules<S> rules;
    rules.not_negative("observer_bandwidth", config.observer_bandwidth)
        .not_negative("frequency_shift", config.frequency_shift);
    if (!rules) return rules.error();
    return typename Shell::Law(config.observer_bandwidth, config.frequency_shift);
  }
};

/// NonlinearEso as an ODE, for simulation. By default k is kept above gain_min = 1/2, which is
/// certified without an upper limit in continuous time (from (N-1) / (2N) on).
/// @tparam Order n @tparam S scalar @tparam Extension m @tparam Shape an EvenGain
template <int Order, Scalar S = double, int Extension = 2, class Shape = PowerSumGain<S>>
requires EvenGain<Shape, S>
class ContinuousNonlinearEso
    : public NamedContinuousObserver<
          ContinuousNonlinearEso<Order, S, Extension, Shape>,
          ContinuousObserver<Order, S, Extension,
                             ContinuousNonlinearGain<Order + Extension, S, Shape>>> {
  using Shell = typename ContinuousNonlinearEso::NamedContinuousObserver;
  friend Shell;
  using Shell::Shell;
  using Law = typename Shell::Law;

 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S observer_bandwidth{};               ///< omega_o, rad/s: the poles are at -omega_o for k = 1
    Shape shape{};                        ///< k(|e| / error_scale)
    S error_scale = S(1.0);               ///< unit of y: what counts as an error of one
    std::optional<S> gain_min{};          ///< k is not less
    std::optional<S> gain_max{};          ///< k is not more
    bool allow_uncertified_gain = false;  ///< accept limits without the certificate
    bool unlimited = false;               ///< no limits, no certificate
    S input_gain{};                       ///< b0, unit of y^(n) per unit of u; not zero
  };

 private:
  static Expected<Law, Error<S>> design(const Config& config) {
    constexpr int size = Order + Extension;
    const auto linear =
        ContinuousConstantGain<size, S>::make("observer_bandwidth", config.observer_bandwidth);
    if (!linear) return linear.error();
    Rules<S> rules;
    rules.positive("error_scale", config.error_scale).all_of(detail::check_shape<S>(config.shape));
    if (!rules) return rules.error();
    const Vector<S, size> gain = linear->gain(S(0.0), S(0.0));
    detail::GainLimits<S> asked{config.gain_min, config.gain_max, config.allow_uncertified_gain,
                                config.unlimited};
    constexpr double free_from = unbounded_certified_gain<size>();
    Interval<S> limits{};
    if (!asked.unlimited && !asked.upper &&
        (!asked.lower || (is_finite(*asked.lower) && *asked.lower >= S(free_from)))) {
      limits = {asked.lower ? *asked.lower : S(0.5),
                S((std::numeric_limits<detail::TableScalar<S>>::max)())};
    } else {
      constexpr double least = least_certified_gain<size>();
      const auto found = detail::find_limits<size, S>(asked, gain, S(least), S(1e6));
      if (!found) return found.error();
      limits = *found;
    }
    return Law(gain, config.shape, config.error_scale, limits.lower, limits.upper);
  }
};

}  // namespace esokit
