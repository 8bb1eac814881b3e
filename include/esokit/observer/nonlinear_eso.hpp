/// @file
/// NonlinearEso: the extended state observer with a nonlinear gain (NHOESO: A. T. Azar, F. A.
/// Abdul-Majeed, H. S. Majdi et al., Mathematics 10 (2022) 2261, doi:10.3390/math10132261; with fal
/// it is the observer of J. Han).
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/nonlinear_gain_design.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>

namespace esokit {

/// Extended state observer of a plant y^(n) = d + b0 u whose bandwidth gains are multiplied by an
/// even function k of the innovation.
///
/// A varying gain k(e) can make the error grow although every constant k in its range is stable.
/// For N = 3 it does with k = 0.15 for 3.5 / omega_o, then k = 5 for 0.2 / omega_o, and so on. So k
/// is limited to gain_min .. gain_max, a range within which the error decays however k varies
/// (certified by a common quadratic Lyapunov function, see
/// gain/certificate/switching_certificate.hpp). By default
/// - gain_min is 1/2: for T -> 0 and any N every gain_max is certified with it. If omega_o T is
///   large, it is three quarters of the way from 1 down to the smallest certified value;
/// - gain_max is halfway from 1 to the largest certified value; at that value the error could ring
///   undamped. Limits without a certificate, or no limits at all, must be requested in the config.
///
/// k = 1 is LinearEso, bit for bit. The certificate applies to samples without gaps. After a gap
/// the gain is the linear one; bridged are gaps of half the length that LinearEso bridges, up to
/// which a search for the worst sequence found no growth.
/// @tparam Order n @tparam S scalar @tparam Extension m
/// @tparam Shape an EvenGain: PowerSumGain (the paper's g), FalGain, or your own function object
template <int Order, class S = double, int Extension = 2, class Shape = PowerSumGain<S>>
requires(detail::is_a_scalar<S>() && detail::is_an_even_gain<Shape, S>()) class NonlinearEso
    : public NamedObserver<
          NonlinearEso<Order, S, Extension, Shape>,
          PredictorCorrector<Order, S, Extension, NonlinearGain<Order + Extension, S, Shape>>> {
  using Shell = typename NonlinearEso::NamedObserver;
  friend Shell;
  using Shell::Shell;
  using Law = typename Shell::Law;
  static constexpr int N = Order + Extension;

 public:
  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S observer_bandwidth{};       ///< omega_o, rad/s: the poles are at exp(-omega_o T) for k = 1
    Shape shape{};                ///< k(|e| / error_scale)
    S error_scale = S(1.0);       ///< unit of y: what counts as an error of one
    std::optional<S> gain_min{};  ///< k is not less
    std::optional<S> gain_max{};  ///< k is not more
    bool allow_uncertified_gain = false;  ///< accept limits without the certificate
    bool unlimited = false;               ///< no limits, no certificate
    S input_gain{};     ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
    S sample_time{};    ///< T, s
    int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts, see
                        ///< `max_gap()`
  };

  /// As NamedObserver says. Not a template, so that compilers name a setting that does not exist.
  static Expected<NonlinearEso, Error<S>> make(const Config& config) {
    return NonlinearEso::NamedObserver::template make<NonlinearEso>(config);
  }
  /// With another scalar.
  template <class T>
  requires EvenGain<typename detail::ForScalar<Shape, T>::type, T>
  using with_scalar = NonlinearEso<Order, T, Extension, typename detail::ForScalar<Shape, T>::type>;

  using Report = NonlinearGainReport<detail::TableScalar<S>>;  ///< see `report`

  /// Report on the k of a config: the stable intervals for constant k, the limits, and the errors e
  /// at which the given k is outside of them. It returns the same errors as `make`, and is not
  /// needed at run time.
  static Expected<Report, Error<S>> report(const Config& config) requires PlainScalar<S> {
    const auto made = NonlinearEso::make(config);
    if (!made) return made.error();
    const auto poles =
        EqualSampledPoles<N, S>::from_bandwidth(config.observer_bandwidth, config.sample_time);
    const auto gain = current_gain<N, S>(poles.weights());
    constexpr auto continuous = constant_gain_interval<N>();
    Report report;
    report.continuous = {static_cast<S>(continuous.lower), static_cast<S>(continuous.upper)};
    report.sampled = constant_gain_interval(poles);
    report.limits = {made->gain_min(), made->gain_max()};
    const auto& [low, high] = report.limits;
    if (!config.unlimited && gain_range_certified<N, S>(gain, low, low)) {
      report.certified = gain_range_certified<N, S>(gain, low, high);
      report.certified_max = largest_certified_gain<N, S>(gain, low, low, report.sampled.upper);
    }
    const auto k = detail::prepared(config.shape);
    const auto within = [&k](const Interval<S>& interval) {
      return [&k, interval](S x) {
        const S value = k(x);
        return value >= interval.lower && value <= interval.upper;
      };
    };
    report.outside = detail::ranges_outside<S>(within(report.sampled), config.error_scale);
    report.limited = detail::ranges_outside<S>(within(report.limits), config.error_scale);
    return report;
  }

  /// k for an innovation e (unit of y), within its limits.
  [[nodiscard]] S gain_factor(const S& e) const noexcept { return law().factor(e); }

  /// The limits of k.
  /// @{
  [[nodiscard]] const S& gain_min() const noexcept { return law().gain_min(); }
  [[nodiscard]] const S& gain_max() const noexcept { return law().gain_max(); }
  /// @}

 private:
  [[nodiscard]] const Law& law() const noexcept { return std::get<0>(this->laws()); }

  static Expected<Law, Error<S>> design(const Config& config, const typename Shell::PlantModel&) {
    const auto linear =
        Law::Linear::make("observer_bandwidth", config.observer_bandwidth, config.sample_time);
    if (!linear) return linear.error();
    Rules<S> rules;
    rules.positive("error_scale", config.error_scale)
        .invertible("error_scale", config.error_scale)
        .all_of(detail::check_shape<S>(config.shape));
    if (!rules) return rules.error();
    const auto poles =
        EqualSampledPoles<N, S>::from_bandwidth(config.observer_bandwidth, config.sample_time);
    const auto limits = detail::find_limits<N, S>(
        {config.gain_min, config.gain_max, config.allow_uncertified_gain, config.unlimited},
        linear->gain_before_measurement(), least_certified_gain(poles),
        constant_gain_interval(poles).upper);
    if (!limits) return limits.error();
    return Law(*linear, config.shape, config.error_scale, limits->lower, limits->upper);
  }
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension, class Shape>
inline constexpr std::uint32_t type_tag<NonlinearEso<Order, S, Extension, Shape>> =
    make_type_tag<S, Shape>("NonlinearEso", Order, Extension);

}  // namespace esokit
