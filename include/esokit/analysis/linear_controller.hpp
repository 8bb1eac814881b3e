/// @file
/// Controllers and observers as linear systems, the form that the analysis uses.
#pragma once

#include <concepts>
#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/expected.hpp>
#include <vector>

namespace esokit {

/// A controller within its limits, q channels. Sampled (sample_time T > 0), u being held from k to
/// k + 1 and given to the controller at the next sample:
///
///     z[k+1] - z[k] = a z + from_y y + from_r r + from_u u
///     u[k] = to_u z + y_to_u y + r_to_u r
///     estimates[k] = to_estimate z + y_to_estimate y + r_to_estimate r
///
/// Continuous (sample_time 0): z' instead of the difference. A - I is stored instead of A, because
/// it keeps the digits of slow dynamics.
///
/// Your own controller can be analysed if a function `linear_controller(const Yours&)` in its
/// namespace returns this, or Expected<LinearController, Error<double>>.
struct LinearController {
  LinearController() = default;
  /// All matrices zero. @param states length of z, may be 0 @param channels q
  /// @param estimates number of estimates that it gives, may be 0 @param time T, s; 0: continuous
  LinearController(int states, int channels, int estimates, double time)
      : a(states, states),
        from_y(states, channels),
        from_r(states, channels),
        from_u(states, channels),
        to_u(channels, states),
        y_to_u(channels, channels),
        r_to_u(channels, channels),
        to_estimate(estimates, states),
        y_to_estimate(estimates, channels),
        r_to_estimate(estimates, channels),
        sample_time(time) {}

  /// Sizes.
  /// @{
  [[nodiscard]] int states() const noexcept { return a.rows(); }
  [[nodiscard]] int channels() const noexcept { return to_u.rows(); }
  [[nodiscard]] int estimates() const noexcept { return to_estimate.rows(); }
  /// @}

  DynamicMatrix<double> a;              ///< A - I; continuous: A
  DynamicMatrix<double> from_y;         ///< from y to z
  DynamicMatrix<double> from_r;         ///< from r to z
  DynamicMatrix<double> from_u;         ///< from the applied u to z
  DynamicMatrix<double> to_u;           ///< from z to u
  DynamicMatrix<double> y_to_u;         ///< from y to u directly
  DynamicMatrix<double> r_to_u;         ///< from r to u directly
  DynamicMatrix<double> to_estimate;    ///< from z to the estimates
  DynamicMatrix<double> y_to_estimate;  ///< from y to the estimates directly
  DynamicMatrix<double> r_to_estimate;  ///< from r to the estimates directly
  double sample_time = 0.0;             ///< T, s; 0 for a continuous one
  double input_gain = 0.0;              ///< b0, or 0 if it has none
};

/// An observer with its predicted state z, and with the u that is held from k to k + 1:
///
///     z[k+1] - z[k] = a z + from_y y + from_u u
///     zhat[k] = to_estimate z + y_to_estimate y
struct LinearObserverForm {
  /// Length of z.
  [[nodiscard]] int states() const noexcept { return a.rows(); }

  DynamicMatrix<double> a;              ///< A - I; continuous: A
  DynamicMatrix<double> from_y;         ///< states x 1
  DynamicMatrix<double> from_u;         ///< states x 1
  DynamicMatrix<double> to_estimate;    ///< rows (y, .., y^(n-1), d, ..)
  DynamicMatrix<double> y_to_estimate;  ///< one column
  double sample_time = 0.0;             ///< T, s; 0 for a continuous one
  double input_gain = 0.0;              ///< b0
};

namespace detail {

/// The observer with u delayed by d samples.
LinearObserverForm delayed(const LinearObserverForm& observer, int delay);

/// u = weights_0 r - weights (yhat, .., dhat); error-based u = weights (ehat, .., dhat) with an
/// observer that measures r - y.
LinearController feedback_of(const LinearObserverForm& observer, const std::vector<double>& weights,
                             bool error_based);

/// The controller with its own u as the applied u, as it is within its limits.
LinearController closed_upon_itself(const LinearController& c);

/// u = u0 + K dhat: r of the compensator is the output u0 of the base; the base gets u0 as the
/// applied u.
Expected<LinearController, Error<double>> compensated(const LinearController& compensator,
                                                      const LinearController& given);

/// Single channels in parallel, with the inverse of B0 at their outputs; each gets its part of B0
/// u.
LinearController decoupled(const std::vector<LinearController>& parts,
                           const DynamicMatrix<double>& input_matrix,
                           const DynamicMatrix<double>& inverse);

// Declares the names, so that a function in the namespace of a user's type is found.
void linear_controller();

void linear_observer();

template <class T>
concept SaysController = requires(const T& controller) {
  {
    linear_controller(controller)
    } -> std::convertible_to<Expected<LinearController, Error<double>>>;
};

template <class T>
concept SaysObserver = requires(const T& observer) {
  { linear_observer(observer) } -> std::same_as<LinearObserverForm>;
};

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/linear_controller.ipp>
#endif
