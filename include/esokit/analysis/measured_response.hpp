/// @file
/// From a disturbance that is measured to y, with what the controller knows of it.
#pragma once

#include <complex>
#include <esokit/adapter/measured.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/loop.hpp>
#include <type_traits>

namespace esokit {

namespace detail {

/// The Measured in an observer, through any adapters.
template <class O>
constexpr const auto& measured_in(const O& observer) noexcept {
  if constexpr (requires { O::inputs; }) {
    return observer;
  } else {
    return measured_in(observer.observer());
  }
}

/// The states of the observer's linear form that shift_load(1) adds, states x 1.
/// @param observer without adapters @param states of the form, which may begin with these
template <class Observer>
DynamicMatrix<double> load_column(const Observer& observer, int states) {
  using Model = std::remove_cvref_t<decltype(observer.model())>;
  DynamicMatrix<double> column(states, 1);
  if constexpr (model_traits<Model>.is_chain) {
    // Each level of the form has the sum of what it and those before it found.
    for (int level = 0; level < Observer::levels; ++level) {
      column(level * Observer::size + Observer::order, 0) = 1.0;
    }
  } else {
    const auto units = sampled_matrices(observer).units;
    const auto of_model = observer.model().constant_column();
    const double scaled =
        static_cast<double>(observer.model().scaled_constant(typename Observer::scalar_type(1)));
    for (int i = 0; i < Observer::size * Observer::levels; ++i) {
      const int row = i % Observer::size;
      column(i, 0) =
          static_cast<double>(of_model[static_cast<std::size_t>(row)]) * units(row) * scaled;
    }
  }
  return column;
}

/// From w to the mean of f over each sample. @param shift z
template <class Path>
std::complex<double> path_response(const Path& path, std::complex<double> shift) {
  using ComplexNumber = std::complex<double>;
  const auto from_lag = path.course(1, 0, 0);
  const auto from_older = path.course(0, 1, 0);
  const auto from_newer = path.course(0, 0, 1);
  const auto number = [](const auto& s) { return static_cast<double>(s); };
  const ComplexNumber back = 1.0 / shift;
  const ComplexNumber lagged =
      (number(from_older.end) * back + number(from_newer.end)) / (shift - number(from_lag.end));
  const ComplexNumber mean =
      number(from_lag.mean) * lagged + number(from_older.mean) * back + number(from_newer.mean);
  return number(path.input().gain) * mean * std::pow(back, path.whole());
}

}  // namespace detail

/// From w to y at a frequency: w acts on the plant as `truth` says, through E (for a chain in the
/// unit of y^(n)), and the controller cancels what its Measured says. Compare with gain 0 in the
/// controller, and with a truth that is 30 % off.
///
/// w is held from k to k + 1, and f counts by its mean over each sample, which is exact for n = 1.
/// @param controller Adrc with an observer that is or contains one Measured
/// @param frequency rad/s, above 0 up to pi / T @param input number of the w
/// @return the errors of `closed_loop` and `Loop::loop_gain`, and of a truth that Measured would
///         not take, with a dead time of at most 1000 samples
template <int States, Scalar S, class Observer, class Form>
Expected<std::complex<double>, Error<double>> measured_to_output(
    const LinearPlant<States, S>& plant, const Adrc<Observer, Form>& controller,
    const MeasuredInput<double>& truth, double frequency, int input = 0) {
  static_assert(observer_traits<Observer>.takes_measured, "esokit: nothing is measured here");
  using Path = detail::MeasuredPath<double, static_cast<int>(detail::most_whole_samples)>;
  const auto loop = closed_loop(plant, controller);
  if (!loop) return loop.error();
  const auto acts = loop->disturbance_to_output(frequency);
  if (!acts) return acts.error();
  const auto& measured = detail::measured_in(controller.observer());
  const double time = loop->sample_time();
  constexpr int inputs = std::remove_cvref_t<decltype(measured)>::inputs;
  if (auto ok = Rules<double>{}
                    .demand(0 <= input && input < inputs, "input", input,
                            "must be the number of a measured disturbance")
                    .all_of(Path::validate(truth, time, -1));
      !ok) {
    return ok.error();
  }
  // A controller whose reference is the change of f: it moves the states before the correction.
  const auto form = linear_observer(controller.observer());
  LinearController told = linear_controller(controller).value();
  const auto column =
      detail::load_column(detail::GuardAccess::innermost(measured.observer()), form.states());
  const double sign = std::is_same_v<Form, ErrorBased> ? -1.0 : 1.0;
  told.from_r = DynamicMatrix<double>(told.states(), 1);
  told.r_to_u = DynamicMatrix<double>(1, 1);
  told.r_to_estimate = DynamicMatrix<double>(told.estimates(), 1);
  detail::add(told.from_r, 0, 0, column, sign);
  detail::add(told.from_r, 0, 0, detail::product(form.a, column), sign);
  detail::add(told.r_to_u, 0, 0, detail::product(told.to_u, column), sign);
  const auto other = Loop::make(detail::dense_plant(plant), told);
  if (!other) return other.error();
  const auto value = detail::frequency_operator(frequency, time);
  const auto from_change = detail::evaluate(other->system(), value)(0, 0);
  const std::complex<double> shift = 1.0 + value;
  return *acts * detail::path_response(Path(truth, time), shift) +
         from_change * (value / shift) * detail::path_response(measured.path(input), shift);
}

}  // namespace esokit
