/// @file
/// AdjustableBandwidthEso: the observer with adjustable bandwidth (ABESO: S. Zhang, X. Qi, S. Yang,
/// J. Systems Engineering and Electronics (2023), doi:10.23919/JSEE.2023.000166), and the
/// bi-bandwidth rule (BESO: L. Yang, L. Liu, J. Zhang, Aerospace Science and Technology 114 (2021)
/// 106742).
#pragma once

#include <esokit/core/type_tag.hpp>
#include <esokit/gain/switched_gain.hpp>
#include <esokit/gain/switching_certificate.hpp>
#include <esokit/observer/continuous_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>

namespace esokit {

namespace detail {

/// The two bandwidths of a rule, or why there are none.
template <Scalar S>
struct BandwidthPair {
  S shrinking{};
  S otherwise{};
};

/// @param sample_time T, s; 0 for a continuous observer
template <int Size, Scalar S>
Expected<BandwidthPair<S>, Error<S>> bandwidth_pair(const S& bandwidth, const S& ratio,
                                                    SwitchingRule rule, const S& sample_time,
                                                    bool allow_uncertified) {
  Rules<S> rules;
  rules.positive("observer_bandwidth", bandwidth).positive("bandwidth_ratio", ratio);
  if (!rules) return rules.error();
  const BandwidthPair<S> pair{bandwidth * ratio,
                              rule == SwitchingRule::beso ? S(bandwidth / ratio) : bandwidth};
  for (const S& product : {pair.shrinking, pair.otherwise}) {
    rules.representable("bandwidth_ratio", ratio, product,
                        "with observer_bandwidth gives a bandwidth that the scalar cannot hold");
  }
  if (!rules) return rules.error();
  if (allow_uncertified ||
      bandwidth_switching_certified<Size, S>(rule, bandwidth, ratio, sample_time)) {
    return pair;
  }
  constexpr const char* below =
      "is not certified against every switching (allow_uncertified_switching asks for it); must be "
      "above";
  constexpr const char* above =
      "is not certified against every switching (allow_uncertified_switching asks for it); must be "
      "below";
  if constexpr (PlainScalar<S>) {
    const S limit = certified_ratio_limit<Size, S>(rule, bandwidth, ratio, sample_time);
    return Error<S>{"bandwidth_ratio", ratio, ratio < S(1) ? below : above, -1, limit, true};
  } else {
    return Error<S>{"bandwidth_ratio", ratio,
                    "is not certified against every switching (allow_uncertified_switching asks "
                    "for it)"};
  }
}

}  // namespace detail

/// Extended state observer of a plant y^(n) = d + b0 u whose bandwidth is rho omega_o while the
/// innovation shrinks and omega_o (or, by the BESO rule, omega_o / rho) otherwise.
///
/// `make` accepts the ratios for which the two gain sets share a quadratic Lyapunov function: the
/// error then decays under any switching, whatever the noise makes of the rule. The paper's Lemma 2
/// says so for every rho, which is wrong: for N = 3 it holds for 1/3 < rho < 3 (sampled: a little
/// wider), and at rho = 0.2 there are switchings under which the error grows. The certificate is
/// about samples without gaps.
///
/// rho = 1 is LinearEso, bit for bit.
/// @tparam Order n @tparam S scalar @tparam Extension m
/// @tparam Reading of "shrinks"; `printed` is for comparison with the paper only
template <int Order, Scalar S = double, int Extension = 1,
          SignReading Reading = SignReading::magnitude>
class AdjustableBandwidthEso
    : public PredictorCorrector<Order, S, Extension,
                                SwitchedGain<Order + Extension, S, EqualPoles, Reading>> {
  using Law = SwitchedGain<Order + Extension, S, EqualPoles, Reading>;
  using Base = PredictorCorrector<Order, S, Extension, Law>;

 public:
  /// Settings of make.
  struct Config {
    S observer_bandwidth{};                     ///< omega_o, rad/s
    S bandwidth_ratio = S(1.0);                 ///< rho > 0
    SwitchingRule rule = SwitchingRule::abeso;  ///< abeso or beso
    bool allow_uncertified_switching = false;   ///< accept a ratio without the certificate
    S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
    S sample_time{};    ///< T, s
    int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts

    /// @cond
    static constexpr auto fields(auto& c) noexcept {
      return std::tie(c.observer_bandwidth, c.bandwidth_ratio, c.rule,
                      c.allow_uncertified_switching, c.input_gain, c.sample_time, c.max_gap);
    }
    /// @endcond
  };
  template <class T>
  using with_scalar =
      AdjustableBandwidthEso<Order, T, Extension, Reading>;  ///< the same of another scalar

  /// Checks the settings and does all the design work.
  /// @return the observer at rest in zero, or an error that names the field; for a ratio without
  /// the certificate its limit is the end of the certified range
  static Expected<AdjustableBandwidthEso, Error<S>> make(const Config& config) {
    if constexpr (PackScalar<S>) {
      return detail::make_lanes<AdjustableBandwidthEso>(config);
    } else {
      return make_one(config);
    }
  }

  /// New settings while running: the estimate and the innovation to compare with are kept, a change
  /// of b0 is moved into the disturbance. A refused config changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same, with the settings of `fresh`, as `make` gave it: no design work.
  Check<S> adopt(AdjustableBandwidthEso fresh) {
    if constexpr (PackScalar<S>) return detail::adopt_lanes(*this, fresh);
    std::get<0>(fresh.laws()).continue_from(std::get<0>(this->laws()));
    return Base::adopt(fresh);
  }

 private:
  static Expected<AdjustableBandwidthEso, Error<S>> make_one(const Config& config) {
    const ChainConfig<S> chain{config.input_gain, config.sample_time, config.max_gap};
    if (auto ok = Base::check_chain(chain); !ok) return ok.error();
    const auto pair = detail::bandwidth_pair<Base::size, S>(
        config.observer_bandwidth, config.bandwidth_ratio, config.rule, config.sample_time,
        config.allow_uncertified_switching);
    if (!pair) return pair.error();
    // The plain bandwidth first, so that the error blames the ratio only where it is to blame.
    using Set = typename Law::Set;
    constexpr const char* rule =
        "with observer_bandwidth and sample_time gives a gain that the scalar cannot hold";
    if (auto plain = Set::make("observer_bandwidth", config.observer_bandwidth, config.sample_time);
        !plain) {
      return plain.error();
    }
    const auto shrinking = Set::make("", pair->shrinking, config.sample_time);
    const auto otherwise = Set::make("", pair->otherwise, config.sample_time);
    if (!shrinking || !otherwise) return Error<S>{"bandwidth_ratio", config.bandwidth_ratio, rule};
    return AdjustableBandwidthEso(chain, Law(*shrinking, *otherwise));
  }

  AdjustableBandwidthEso(const ChainConfig<S>& chain, const Law& law) noexcept
      : Base(chain, {law}) {}
};

/// Told apart in snapshots.
template <int Order, Scalar S, int Extension, SignReading Reading>
inline constexpr std::uint32_t type_tag<AdjustableBandwidthEso<Order, S, Extension, Reading>> =
    make_type_tag<S>("AdjustableBandwidthEso", Order, Extension, Reading);

/// AdjustableBandwidthEso as an ODE, for simulation; it switches at step boundaries.
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, Scalar S = double, int Extension = 1>
class ContinuousAdjustableBandwidthEso
    : public ContinuousObserver<Order, S, Extension, ContinuousSwitchedGain<Order + Extension, S>> {
  using Law = ContinuousSwitchedGain<Order + Extension, S>;
  using Base = ContinuousObserver<Order, S, Extension, Law>;

 public:
  /// Settings of make.
  struct Config {
    S observer_bandwidth{};                             ///< omega_o, rad/s
    S bandwidth_ratio = S(1.0);                         ///< rho > 0
    SwitchingRule rule = SwitchingRule::abeso;          ///< abeso or beso
    SignReading sign_reading = SignReading::magnitude;  ///< printed: as the paper's equation has it
    bool allow_uncertified_switching = false;           ///< accept a ratio without the certificate
    S input_gain{};  ///< b0, unit of y^(n) per unit of u; not zero
  };

  /// Checks the settings and does all the design work.
  /// @return the observer's equations, or an error that names the field
  static Expected<ContinuousAdjustableBandwidthEso, Error<S>> make(const Config& config) {
    Rules<S> rules;
    if (!rules.nonzero("input_gain", config.input_gain)) return rules.error();
    const auto pair = detail::bandwidth_pair<Base::size, S>(
        config.observer_bandwidth, config.bandwidth_ratio, config.rule, S(0.0),
        config.allow_uncertified_switching);
    if (!pair) return pair.error();
    const auto shrinking = continuous_gain<Base::size, S>(pair->shrinking);
    const auto otherwise = continuous_gain<Base::size, S>(pair->otherwise);
    for (const auto& gain : {shrinking, otherwise}) {
      rules.representable("observer_bandwidth", config.observer_bandwidth, S(gain(Base::size - 1)),
                          "gives a gain that the scalar cannot hold");
    }
    if (!rules) return rules.error();
    return ContinuousAdjustableBandwidthEso(config.input_gain,
                                            Law(shrinking, otherwise, config.sign_reading));
  }

 private:
  ContinuousAdjustableBandwidthEso(const S& input_gain, const Law& law) : Base(input_gain, {law}) {}
};

}  // namespace esokit
