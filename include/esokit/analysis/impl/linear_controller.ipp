#pragma once

#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION LinearObserverForm delayed(const LinearObserverForm& observer, int delay) {
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

ESOKIT_FUNCTION LinearController feedback_of(const LinearObserverForm& observer,
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

ESOKIT_FUNCTION LinearController closed_upon_itself(const LinearController& c) {
  LinearController own = c;
  add(own.a, 0, 0, product(c.from_u, c.to_u));
  add(own.from_y, 0, 0, product(c.from_u, c.y_to_u));
  add(own.from_r, 0, 0, product(c.from_u, c.r_to_u));
  own.from_u = DynamicMatrix<double>(c.states(), c.channels());
  return own;
}

ESOKIT_FUNCTION Expected<LinearController, Error<double>> compensated(
    const LinearController& compensator, const LinearController& given) {
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

ESOKIT_FUNCTION LinearController decoupled(const std::vector<LinearController>& parts,
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

}  // namespace detail
}  // namespace esokit
