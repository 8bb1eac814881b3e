/// @file
/// The disturbance over a recorded log, without lag: what an observer would have found, had it
/// known the rest of the log as well.
#pragma once

#include <cstddef>
#include <esokit/adapter/delayed_input.hpp>
#include <esokit/analysis/observer_system.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/identify/log.hpp>
#include <optional>
#include <type_traits>
#include <vector>

namespace esokit {

/// Noise that `smooth` reckons with. What is left out comes from the log: the values under which
/// the log is most likely.
struct SmoothNoise {
  std::optional<double> measurement{};  ///< standard deviation of the noise on y, in each row

  /// How fast the disturbance walks, as Fit::disturbance and EstimationNoise::disturbance: the
  /// variance that d^(m-1) gains per second. Of a model with parts that is its constant part; sines
  /// keep their amplitudes over the whole log. 0: d^(m-1) is one constant.
  std::optional<double> disturbance{};
};

/// What `smooth` found, a number for each row of the log.
struct SmoothedLog {
  std::vector<double> disturbance;  ///< d: what the model does not know, unit of y^(n)
  std::vector<double> deviation;    ///< standard deviation of d, if the model is right

  /// All by the rows of the observer's estimate: y, .., y^(n-1), .. Row n is what acts besides b0
  /// u, so also what the model knows of the plant.
  std::vector<std::vector<double>> estimates;
  std::vector<std::vector<double>> deviations;  ///< of the estimates

  SmoothNoise noise{};      ///< as given or found
  std::size_t bridged = 0;  ///< samples without a measurement: rows without y, and missing rows
};

namespace detail {

/// What smooth takes of an observer: x[k+1] = phi x[k] + gamma u[k - delay] + walk w[k], y = x_0.
struct SmoothModel {
  DynamicMatrix<double> phi;    ///< of scaled states
  DynamicMatrix<double> gamma;  ///< one column, scaled
  DynamicMatrix<double> walk;   ///< one column, scaled: w is the change of what walks
  DynamicMatrix<double> load;   ///< one row: d of the scaled states
  std::vector<double> units;    ///< of each state
  std::vector<int> state_of_row;
  int delay = 0;         ///< samples
  int integrations = 0;  ///< from what walks to y
  double sample_time = 0.0;
};

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

template <SampledLinearObserver Observer>
SmoothModel smooth_model(const Observer& observer) {
  constexpr int size = Observer::size;
  using Model = std::remove_cvref_t<decltype(observer.model())>;
  const auto sampled = sampled_matrices(observer);
  SmoothModel model;
  model.phi = DynamicMatrix<double>(size, size);
  model.gamma = DynamicMatrix<double>(size, 1);
  model.walk = DynamicMatrix<double>(size, 1);
  model.load = DynamicMatrix<double>(1, size);
  if constexpr (model_traits<Model>.is_chain) {
    model.walk(size - 1, 0) = 1.0;
    model.load(0, Observer::order) = sampled.units(Observer::order);
    model.integrations = size;
  } else {
    const auto column = load_column(observer, size);
    const auto row = observer.model().constant_row();
    const double scaled =
        static_cast<double>(observer.model().scaled_constant(typename Observer::scalar_type(1)));
    for (int i = 0; i < size; ++i) {
      model.walk(i, 0) = column(i, 0);
      model.load(0, i) = static_cast<double>(row[static_cast<std::size_t>(i)]) / scaled;
    }
    model.integrations = Observer::order + 1;
  }
  for (int i = 0; i < size; ++i) {
    model.units.push_back(sampled.units(i));
    model.state_of_row.push_back(state_of_row<Observer>(i));
    model.gamma(i, 0) = sampled.gamma(i) / sampled.units(i);
    model.walk(i, 0) /= sampled.units(i);
    for (int j = 0; j < size; ++j) {
      model.phi(i, j) =
          (i == j ? 1.0 : 0.0) + sampled.step(i, j) * sampled.units(j) / sampled.units(i);
    }
  }
  model.sample_time = static_cast<double>(observer.sample_time());
  return model;
}

template <class Observer, int Capacity>
SmoothModel smooth_model(const DelayedInput<Observer, Capacity>& observer) {
  SmoothModel model = smooth_model(observer.observer());
  model.delay = observer.delay();
  return model;
}

Expected<SmoothedLog, Error<double>> smooth(const Log& log, const SmoothModel& model,
                                            const SmoothNoise& noise);

}  // namespace detail

/// The states and the disturbance of a log, each from all rows before and after it, with their
/// standard deviations. It is the smoother of Rauch, Tung and Striebel in the square-root form of
/// Bierman, and takes nothing as known of the start. For what is wanted of yesterday's log (the
/// friction over the speed, cogging over the angle, the force of a contact): an observer lags, this
/// does not.
///
/// Rows without a finite y, and rows that the time stamps say are missing, are predicted, however
/// long. A u that is not finite is that of the row before.
///
/// An actuator in the model makes the way back unstable, as do poles of the plant if `disturbance`
/// is 0: such a log may have only some of their time constants. Filter u by the actuator instead,
/// and take an observer without it.
/// @param log time, u, y; steps of whole samples of the observer, within half a sample. For others
///        `prepare` first
/// @param observer a LinearEso, CascadeEso, ModelEso, .., also in a DelayedInput. Its model counts,
///        not its gains
/// @return error for columns of different lengths, fewer measurements than states, time stamps that
///         do not rise or have another sample time, `columns` (add what is known to u instead, in
///         its unit), a negative noise, or numbers that are not finite
template <class Observer>
requires requires(const Observer& observer) { detail::smooth_model(observer); }
Expected<SmoothedLog, Error<double>> smooth(const Log& log, const Observer& observer,
                                            const SmoothNoise& noise = {}) {
  return detail::smooth(log, detail::smooth_model(observer), noise);
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/identify/impl/smooth.ipp>
#endif
