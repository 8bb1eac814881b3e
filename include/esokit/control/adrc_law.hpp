/// @file
/// The control law of active disturbance rejection control (ADRC), computed from an observer's
/// estimate.
#pragma once

#include <esokit/control/reference.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/math/combinatorics.hpp>
#include <optional>
#include <type_traits>

namespace esokit {

/// The observer gets y; the law takes r and, if known, its derivatives.
struct OutputBased {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<OutputBased> = make_type_tag<>("OutputBased");

/// The observer gets e = r - y; the motion of r is part of the disturbance, so no derivative of r
/// is needed. For a constant reference it equals the output-based form.
struct ErrorBased {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<ErrorBased> = make_type_tag<>("ErrorBased");

/// OutputBased or ErrorBased: the template argument `Form` of controllers and analysis.
template <class Form>
concept AdrcForm = std::is_same_v<Form, OutputBased> || std::is_same_v<Form, ErrorBased>;

/// u = (v - dhat) / b0 with a state feedback v. The total disturbance is cancelled; what remains is
/// a chain of n integrators, with closed-loop poles at -omega_c.
///
/// A function of the estimate, without state, for sampled and continuous observers.
/// @tparam Order n
template <int Order, class S = double>
requires(detail::is_a_scalar<S>()) class AdrcLaw {
 public:
  /// Give `controller_bandwidth` or `gains`, not both.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S controller_bandwidth{};  ///< omega_c, rad/s: k_i = C(n, i) omega_c^(n-i)
    std::optional<Array<S, Order>>
        gains{};     ///< k_0 .. k_(n-1) for r - y, r' - y', ..; k_i in 1/s^(n-i)
    S input_gain{};  ///< b0 of the plant, not zero, negative is fine
  };
  using scalar_type = S;  ///< type of signals and settings

  /// Checks the settings and does all the design work.
  /// @return the law, or an error that names the field
  static Expected<AdrcLaw, Error<S>> make(const Config& config) {
    static_assert(detail::refuses_packs<S>());
    Rules<S> rules;
    if (!rules.invertible("input_gain", config.input_gain)) return rules.error();
    AdrcLaw law;
    law.inverse_input_gain_ = S(1.0) / config.input_gain;
    law.input_gain_ = config.input_gain;
    if (config.gains) {
      rules
          .left_out("controller_bandwidth", config.controller_bandwidth,
                    "must be left out if gains is given")
          .finite("gains", *config.gains);
      law.gains_ = *config.gains;
    } else {
      rules.positive("controller_bandwidth", config.controller_bandwidth);
      S power(1.0);
      for (int i = Order - 1; i >= 0; --i) {
        power = power * config.controller_bandwidth;
        law.gains_[static_cast<std::size_t>(i)] =
            S(binomial_table<Order, detail::TableScalar<S>>[Order][static_cast<std::size_t>(i)]) *
            power;
      }
      rules.representable("controller_bandwidth", config.controller_bandwidth, law.gains_[0],
                          "gives a gain that the scalar cannot hold");
    }
    for (const S& gain : law.gains_) {
      rules.demand(all(is_finite(S(gain * law.inverse_input_gain_))), "input_gain",
                   config.input_gain, "with these gains gives a law that the scalar cannot hold");
    }
    if (!rules) return rules.error();
    return law;
  }

  /// v = r^(n) + sum_i k_i (r^(i) - yhat^(i)), unit of y^(n).
  /// @param given (y, .., y^(n-1), ..), at least n x 1
  /// @param reference r, `{r, r1}` or a vector, see Reference
  template <detail::VectorOf<S> Estimate>
  [[nodiscard]] S feedback(const Estimate& given,
                           const Reference<Order, S>& reference) const noexcept {
    constexpr int Size = detail::vector_size<Estimate>;
    const Vector<S, Size>& estimate = given;
    static_assert(Size >= Order, "esokit: the estimate must hold the plant states");
    S v = reference(Order);
    for (int i = 0; i < Order; ++i) {
      v = v + gains_[static_cast<std::size_t>(i)] * (reference(i) - estimate(i));
    }
    return v;
  }

  /// Output-based form: u = (v - dhat) / b0.
  /// @param given (y, .., y^(n-1), d, ..) of an observer with input gain b0
  /// @param reference r, `{r, r1}` or a vector, see Reference
  template <detail::VectorOf<S> Estimate>
  [[nodiscard]] S control(const Estimate& given,
                          const Reference<Order, S>& reference) const noexcept {
    constexpr int Size = detail::vector_size<Estimate>;
    const Vector<S, Size>& estimate = given;
    static_assert(Size > Order, "esokit: the estimate must hold the disturbance");
    return (feedback(estimate, reference) - estimate(Order)) * inverse_input_gain_;
  }

  /// Error-based form: u = (dhat + sum_i k_i ehat^(i)) / b0; no reference derivative is needed.
  /// @param given (e, .., e^(n-1), d, ..) of an observer with e = r - y as the measurement and -b0
  ///        as input gain
  template <detail::VectorOf<S> Estimate>
  [[nodiscard]] S control_error_based(const Estimate& given) const noexcept {
    constexpr int Size = detail::vector_size<Estimate>;
    const Vector<S, Size>& estimate = given;
    static_assert(Size > Order, "esokit: the estimate must hold the disturbance");
    S v = estimate(Order);
    for (int i = 0; i < Order; ++i) v = v + gains_[static_cast<std::size_t>(i)] * estimate(i);
    return v * inverse_input_gain_;
  }

  /// k_0 .. k_(n-1).
  [[nodiscard]] const Array<S, Order>& gains() const noexcept { return gains_; }

  /// b0, as it was given.
  [[nodiscard]] const S& input_gain() const noexcept { return input_gain_; }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 3;

  AdrcLaw() = default;

  Array<S, Order> gains_{};
  S inverse_input_gain_ = S(1.0);
  S input_gain_ = S(1.0);
};

}  // namespace esokit
