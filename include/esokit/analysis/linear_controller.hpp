/// @file
/// Controllers and observers as linear systems, the form that the analysis uses.
#pragma once

#include <concepts>
#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/core/check.hpp>
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
inline LinearObserverForm delayed(const LinearObserverForm& observer, int delay) {
  if (delay == 0) return observer;
  const int states = observer.states();
  LinearObserverForm late = observer;
  late.a = DynamicMatrix<double>(states + delay, states + delay);
  add(late.a, 0, 0, observer.a);
  late.from_y = DynamicMatrix<double>(states + delay, 1);
  add(late.from_y, 0, 0, observer.from_y);
  late.from_u = DynamicMatrix<double>(states + delay, 1);
  late.to_estimate = DynamicMatrix<double>(observer.to_estimate.rows(), states + delay);
  add(late.to_estimate, 0, 0, observer.to_estimate);
  // u[k-1], .., u[k-d]
  late.from_u(states, 0) = 1.0;
  for (int i = 0; i < delay; ++i) {
    late.a(states + i, states + i) = -1.0;
    if (i > 0) late.a(states + i, states + i - 1) = 1.0;
  }
  add(late.a, 0, states + delay - 1, observer.from_u);
  return late;
}

/// u = weights_0 r - weights (yhat, .., dhat); error-based u = weights (ehat, .., dhat) with an
/// observer that measures r - y.
inline LinearController feedback_of(const LinearObserverForm& observer,
                                    const std::vector<double>& weights, bool error_based) {
  const double sign = error_based ? -1.0 : 1.0;
  LinearController form(observer.states(), 1, observer.to_estimate.rows(), observer.sample_time);
  DynamicMatrix<double> row(1, observer.to_estimate.rows());
  for (std::size_t i = 0; i < weights.size(); ++i) row(0, static_cast<int>(i)) = -sign * weights[i];
  form.a = observer.a;
  form.from_u = observer.from_u;
  add(form.from_y, 0, 0, observer.from_y, sign);
  form.to_u = product(row, observer.to_estimate);
  add(form.y_to_u, 0, 0, product(row, observer.y_to_estimate), sign);
  form.to_estimate = observer.to_estimate;
  add(form.y_to_estimate, 0, 0, observer.y_to_estimate, sign);
  if (error_based) {
    form.from_r = observer.from_y;
    form.r_to_u = product(row, observer.y_to_estimate);
    form.r_to_estimate = observer.y_to_estimate;
  } else {
    form.r_to_u(0, 0) = weights.front();
  }
  form.input_gain = sign * observer.input_gain;
  return form;
}

/// The controller with its own u as the applied u, as it is within its limits.
inline LinearController closed_upon_itself(const LinearController& c) {
  LinearController own = c;
  add(own.a, 0, 0, product(c.from_u, c.to_u));
  add(own.from_y, 0, 0, product(c.from_u, c.y_to_u));
  add(own.from_r, 0, 0, product(c.from_u, c.r_to_u));
  own.from_u = DynamicMatrix<double>(c.states(), c.channels());
  return own;
}

/// u = u0 + K dhat: r of the compensator is the output u0 of the base; the base gets u0 as the
/// applied u.
inline Expected<LinearController, Error<double>> compensated(const LinearController& compensator,
                                                             const LinearController& given) {
  Rules<double> rules;
  rules
      .demand(given.channels() == 1, "base.channels", given.channels(),
              "must be one, as the compensator has")
      .demand(esokit::detail::same(static_cast<float>(given.sample_time),
                                   static_cast<float>(compensator.sample_time)),
              {"base.sample_time", given.sample_time, "must be that of the compensator, which is",
               -1, compensator.sample_time, true});
  if (!rules) return rules.error();
  const LinearController base = closed_upon_itself(given);
  const int first = compensator.states();
  LinearController both(first + base.states(), 1, compensator.estimates(), compensator.sample_time);
  add(both.a, 0, 0, compensator.a);
  add(both.a, first, first, base.a);
  add(both.from_y, 0, 0, compensator.from_y);
  add(both.from_y, first, 0, base.from_y);
  add(both.from_r, first, 0, base.from_r);
  add(both.from_u, 0, 0, compensator.from_u);
  add(both.to_u, 0, 0, compensator.to_u);
  add(both.to_u, 0, first, base.to_u);
  add(both.y_to_u, 0, 0, compensator.y_to_u);
  add(both.y_to_u, 0, 0, base.y_to_u);
  both.r_to_u = base.r_to_u;
  add(both.to_estimate, 0, 0, compensator.to_estimate);
  both.y_to_estimate = compensator.y_to_estimate;
  return both;
}

/// Single channels in parallel, with the inverse of B0 at their outputs; each gets its part of B0
/// u.
inline LinearController decoupled(const std::vector<LinearController>& parts,
                                  const DynamicMatrix<double>& input_matrix,
                                  const DynamicMatrix<double>& inverse) {
  int states = 0;
  int estimates = 0;
  for (const LinearController& part : parts) {
    states += part.states();
    estimates += part.estimates();
  }
  const int q = static_cast<int>(parts.size());
  LinearController all(states, q, estimates, parts.front().sample_time);
  DynamicMatrix<double> own(states, q);  // from (B0 u)_i
  DynamicMatrix<double> from_state(q, states);
  DynamicMatrix<double> from_y(q, q);
  DynamicMatrix<double> from_r(q, q);
  int row = 0;
  int estimate = 0;
  for (int i = 0; i < q; ++i) {
    const LinearController& part = parts[static_cast<std::size_t>(i)];
    add(all.a, row, row, part.a);
    add(all.from_y, row, i, part.from_y);
    add(all.from_r, row, i, part.from_r);
    add(own, row, i, part.from_u);
    add(from_state, i, row, part.to_u);
    add(from_y, i, i, part.y_to_u);
    add(from_r, i, i, part.r_to_u);
    add(all.to_estimate, estimate, row, part.to_estimate);
    add(all.y_to_estimate, estimate, i, part.y_to_estimate);
    row += part.states();
    estimate += part.estimates();
  }
  all.from_u = product(own, input_matrix);
  all.to_u = product(inverse, from_state);
  all.y_to_u = product(inverse, from_y);
  all.r_to_u = product(inverse, from_r);
  return all;
}

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
