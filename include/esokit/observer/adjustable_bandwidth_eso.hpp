/// @file
/// AdjustableBandwidthEso: the observer with adjustable bandwidth (ABESO: S. Zhang, X. Qi, S. Yang,
/// J. Systems Engineering and Electronics (2023), doi:10.23919/JSEE.2023.000166), and the
/// bi-bandwidth rule (BESO: L. Yang, L. Liu, J. Zhang, Aerospace Science and Technology 114 (2021)
/// 106742).
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/certificate/switching_certificate.hpp>
#include <esokit/gain/switched_gain.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>

namespace esokit {

/// Extended state observer of a plant y^(n) = d + b0 u whose bandwidth is rho omega_o while the
/// innovation shrinks and omega_o (or, by the BESO rule, omega_o / rho) otherwise.
///
/// `make` accepts the ratios for which the two gain sets share a quadratic Lyapunov function: the
/// error then decays under any switching, also switching caused by noise. The paper's Lemma 2
/// claims this for every rho. This is wrong: for N = 3 it holds for 1/3 < rho < 3 (sampled: a
/// little wider), and at rho = 0.2 some switching patterns make the error grow. The certificate
/// applies to samples without gaps.
///
/// rho = 1 is LinearEso, bit for bit.
/// @tparam Order n @tparam S scalar @tparam Extension m
/// @tparam Reading meaning of "shrinks"; `printed` is for comparison with the paper only
template <int Order, class S = double, int Extension = 1,
          SignReading Reading = SignReading::magnitude>
requires(detail::is_a_scalar<S>()) class AdjustableBandwidthEso
    : public NamedObserver<
          AdjustableBandwidthEso<Order, S, Extension, Reading>,
          PredictorCorrector<Order, S, Extension,
                             SwitchedGain<Order + Extension, S, EqualPoles, Reading>>> {
  using Shell = typename AdjustableBandwidthEso::NamedObserver;
  friend Shell;
  using Shell::Shell;
  using Law = typename Shell::Law;

 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S observer_bandwidth{};                          ///< omega_o, rad/s
    S bandwidth_ratio = S(1.0);                      ///< rho > 0
    SwitchingRule rule = SwitchingRule::abeso;       ///< abeso or beso
    bool allow_uncertified_switching = false;        ///< accept a ratio without a certificate
    S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
    S sample_time{};    ///< T, s
    int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts, see
                        ///< `max_gap()`
  };

  /// As NamedObserver says. Not a template, so that compilers name a setting that does not exist.
  static Expected<AdjustableBandwidthEso, Error<S>> make(const Config& config) {
    return AdjustableBandwidthEso::NamedObserver::template make<AdjustableBandwidthEso>(config);
  }
  template <class T>
  using with_scalar =
      AdjustableBandwidthEso<Order, T, Extension, Reading>;  ///< the same with another scalar

 private:
  // For a ratio without the certificate, `limit` in the error is the end of the certified range.
  static Expected<Law, Error<S>> design(const Config& config, const typename Shell::PlantModel&) {
    const auto pair = detail::bandwidth_pair<Order + Extension, S>(
        config.observer_bandwidth, config.bandwidth_ratio, config.rule, config.sample_time,
        config.allow_uncertified_switching);
    if (!pair) return pair.error();
    // The bandwidth is checked alone first, so that the error names the ratio only if it is the
    // cause.
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
    return Law(*shrinking, *otherwise);
  }
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension, SignReading Reading>
inline constexpr std::uint32_t type_tag<AdjustableBandwidthEso<Order, S, Extension, Reading>> =
    make_type_tag<S>("AdjustableBandwidthEso", Order, Extension, Reading);

}  // namespace esokit
