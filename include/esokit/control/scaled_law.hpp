/// @file
/// ScaledLaw: AdrcLaw for a reference without derivatives, whose gains include the scaling of the
/// observer's chain and 1/b0. It needs a third of the multiplications of the law on physical
/// estimates.
#pragma once

#include <esokit/control/adrc_law.hpp>
#include <esokit/core/kernels.hpp>

namespace esokit {

/// u = w_0 (r - y) - sum_(i>=1) w_i x_i on the scaled state x, with
/// w_i = k_i i! / (T^i b0), w_n = n! / (T^n b0).
template <int Order, Scalar S>
class ScaledLaw {
 public:
  using scalar_type = S;  ///< type of signals and settings
  template <class T>
  using with_scalar = ScaledLaw<Order, T>;  ///< the same with another scalar

  /// Multiplies scaling and 1/b0 into the gains.
  /// @param law the law whose gains are used
  /// @param observer gives the sample time; its b0 is that of the law, or its negative
  /// (error-based)
  /// @return error for gains that the scalar cannot hold
  template <class Observer>
  static Expected<ScaledLaw, Error<S>> make(const AdrcLaw<Order, S>& law,
                                            const Observer& observer) {
    const S rate = S(1) / observer.sample_time();
    ScaledLaw scaled;
    S unit = S(1) / law.input_gain();
    for (int i = 0; i <= Order; ++i) {
      if (i > 0) unit = unit * (static_cast<S>(i) * rate);
      const auto row = static_cast<std::size_t>(i);
      scaled.weights_[row] = i < Order ? law.gains()[row] * unit : unit;
      if (!is_finite(scaled.weights_[row])) {
        return Error<S>{"sample_time", observer.sample_time(),
                        "with these gains gives a law that the scalar cannot hold"};
      }
    }
    return scaled;
  }

  /// Output-based form. @param error r - y
  template <class Observer>
  [[nodiscard]] ESOKIT_INLINE S control(const Observer& observer, S error) const noexcept {
    return weights_[0] * error - tail(observer);
  }

  /// Error-based form: the same gains, on the estimate of e.
  template <class Observer>
  [[nodiscard]] ESOKIT_INLINE S control_error_based(const Observer& observer) const noexcept {
    return weights_[0] * observer.template scaled_estimate<0>() + tail(observer);
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 1;

  ScaledLaw() = default;

  /// sum_(i>=1) w_i x_i, separate from the first term, so that both are computed in parallel.
  template <class Observer>
  [[nodiscard]] ESOKIT_INLINE S tail(const Observer& observer) const noexcept {
    return detail::weighed_estimates<1, Order>(weights_, observer);
  }

  Array<S, Order + 1> weights_{};
};

/// Used if the observer does not publish its chain.
struct NoScaledLaw {
  /// Makes nothing, without an error.
  template <class Law, class Observer>
  static Expected<NoScaledLaw, Error<typename Observer::scalar_type>> make(const Law&,
                                                                           const Observer&) {
    return NoScaledLaw{};
  }
};

}  // namespace esokit
