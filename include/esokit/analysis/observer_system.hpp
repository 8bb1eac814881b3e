/// @file
/// Observers as linear systems: from y and u, or from noise and disturbance, to the estimates.
///
/// For a sampled observer the system is computed from its gains (`level_gain`) and not by calling
/// `update` with unit vectors, so that A - I has no cancellation. For a continuous one it is
/// computed by calling `derivative` with unit vectors, each entry being a single product.
#pragma once

#include <concepts>
#include <cstddef>
#include <esokit/analysis/integrator_chain.hpp>
#include <esokit/analysis/linear_system.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/gain/sampled_gain.hpp>
#include <esokit/model/chain_model.hpp>
#include <esokit/model/sampled_model.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/sim/continuous_observer.hpp>

namespace esokit {

/// A continuous observer that is linear in its state: ContinuousLinearEso, ContinuousCascadeEso.
template <class T>
concept ContinuousLinearObserver = requires(const T& observer, typename T::State z,
                                            typename T::scalar_type s) {
  { T::order + T::extension + T::levels + T::states } -> std::convertible_to<int>;
  { observer.derivative(s, z, s, s) } -> std::convertible_to<typename T::State>;
  static_cast<double>(observer.input_gain());
};

/// An observer that can be analysed as a linear system.
template <class T>
concept LinearObserver = SampledLinearObserver<T> || ContinuousLinearObserver<T>;

/// A sampled observer fixed in one mode: with the gains of a switched or nonlinear law at one
/// innovation.
template <int Order, int Levels = 1, int Extension = 1>
struct FrozenObserver {
  using scalar_type = double;                                     ///< type of the gains
  static constexpr int order = Order;                             ///< n, order of the plant
  static constexpr int extension = Extension;                     ///< m, extended states
  static constexpr int size = ChainSize<Order, Extension>::size;  ///< N = n + m
  static constexpr int levels = Levels;                           ///< p
  static constexpr ObserverTraits traits{.acts_by_gain = true};   ///< what it can do

  Array<ScaledGain<size, double>, Levels> gains{};  ///< current-estimator gains, scaled
  double gain_of_input{};                           ///< b0, unit of y^(n) per unit of u
  double time_step{};                               ///< T, s

  /// The members under the names that they have in an observer.
  /// @{
  [[nodiscard]] const ScaledGain<size, double>& level_gain(int level) const noexcept {
    return gains[static_cast<std::size_t>(level)];
  }
  [[nodiscard]] double input_gain() const noexcept { return gain_of_input; }
  [[nodiscard]] double sample_time() const noexcept { return time_step; }
  [[nodiscard]] ChainModel<Order, double, Extension> model() const noexcept {
    return {gain_of_input, time_step};
  }
  /// @}
};

/// A continuous gain law fixed in one mode, for ContinuousObserver. @tparam Size N
template <int Size>
struct FrozenGain {
  EigenMatrix<double, Size> value;  ///< l, row i in 1/s^(i+1)

  /// l, for any time and innovation.
  [[nodiscard]] const EigenMatrix<double, Size>& gain(double, double) const noexcept {
    return value;
  }
};

namespace detail {

/// An observer with its predicted state z-, in physical units: D z- = a z- + by y + bu u,   zhat =
///   c z- + dy y. Level i holds its plant states and the sum of the disturbances found by levels
///   1..i, so that the true state is the same for all levels.
template <int Order, int Extension, int Levels>
struct ObserverMatrices {
  static constexpr int order = Order;
  static constexpr int size = Order + Extension;
  static constexpr int states = size * Levels;
  EigenMatrix<double, states, states> a = EigenMatrix<double, states, states>::Zero();
  EigenMatrix<double, states> by = EigenMatrix<double, states>::Zero();
  EigenMatrix<double, states> bu = EigenMatrix<double, states>::Zero();
  EigenMatrix<double, size, states> c = EigenMatrix<double, size, states>::Zero();
  EigenMatrix<double, size> dy = EigenMatrix<double, size>::Zero();
  double input_gain = 0.0;
  double sample_time = 0.0;
};

/// Phi - I, Gamma, and the units of the scaled states, in physical units.
template <int Size>
struct SampledMatrices {
  Matrix<double, Size, Size> step;
  Vector<double, Size> gamma;
  Vector<double, Size> units;  ///< unit of each state
  /// The part of a correction that belongs to the disturbance, as a matrix on the states.
  Matrix<double, Size, Size> disturbance = Matrix<double, Size, Size>::Zero();
};

/// Place of a row of the estimate among the states.
template <class Observer>
constexpr int state_of_row(int row) noexcept {
  if constexpr (SampledLinearObserver<Observer>) {
    using Model = std::remove_cvref_t<decltype(std::declval<const Observer&>().model())>;
    return Model::state_of_row(row);
  } else {
    return row;
  }
}

/// For a model that is not a chain, in double for any scalar; without the part of the disturbance.
template <class Model>
SampledMatrices<Model::size> model_matrices(const Model& model) {
  constexpr int size = Model::size;
  using S = std::remove_cvref_t<decltype(model.sample_time())>;
  SampledMatrices<size> m;
  typename Model::State ones;
  ones.fill(S(1));
  const auto units = model.physical(ones);
  const auto gamma = model.physical(model.add_input(typename Model::State{}, S(1)));
  const auto step = model.increment();
  for (int row = 0; row < size; ++row) {
    m.units(Model::state_of_row(row)) = static_cast<double>(units(row));
    m.gamma(Model::state_of_row(row)) = static_cast<double>(gamma(row));
  }
  for (int i = 0; i < size; ++i) {
    for (int j = 0; j < size; ++j) {
      m.step(i, j) = static_cast<double>(step(i, j)) * m.units(i) / m.units(j);
    }
  }
  return m;
}

/// In double for any scalar of the observer.
template <SampledLinearObserver Observer>
SampledMatrices<Observer::size> sampled_matrices(const Observer& observer) {
  constexpr int size = Observer::size;
  const auto& model = observer.model();
  using Model = std::remove_cvref_t<decltype(model)>;
  using S = typename Observer::scalar_type;
  const double time = static_cast<double>(observer.sample_time());
  SampledMatrices<size> m;
  if constexpr (model_traits<Model>.is_chain) {
    using Chain = IntegratorChain<Observer::order, double, Observer::extension>;
    m.step = Chain::transition_matrix(time);
    for (int i = 0; i < size; ++i) m.step(i, i) = 0.0;
    m.gamma = Chain::sampled_input_matrix(time, static_cast<double>(observer.input_gain()));
    m.units(0) = 1.0;
    for (int r = 1; r < size; ++r) m.units(r) = m.units(r - 1) * r / time;
  } else {
    m = model_matrices(model);
  }
  if constexpr (Observer::levels > 1) {
    for (int j = 0; j < size; ++j) {
      if constexpr (model_traits<Model>.tells_disturbance) {
        typename Model::State unit{};
        unit[static_cast<std::size_t>(j)] = S(1);
        const auto part = model.disturbance_part(unit);
        for (int i = 0; i < size; ++i) {
          m.disturbance(i, j) =
              static_cast<double>(part[static_cast<std::size_t>(i)]) * m.units(i) / m.units(j);
        }
      } else if (j >= Observer::order) {
        m.disturbance(j, j) = 1.0;
      }
    }
  }
  return m;
}

/// Sizes of an observer.
struct ObserverSizes {
  int size, levels;
};

/// The parts of a sampled observer, in physical units: Phi - I, Gamma, the gains k level by level,
/// and the place of each row of the estimate among the states. For several levels also the part of
/// a correction that belongs to the disturbance.
struct ObserverParts {
  DenseView<const double> step, gamma, disturbance;
  const double* gains;
  const int* state_of_row;
};

/// Computes ObserverMatrices of any size; the results must be zero at first. `work` has two more
/// columns than states.
void put_together(const ObserverSizes& sizes, const ObserverParts& parts, DenseView<double> work,
                  DenseView<double> a, DenseView<double> by, DenseView<double> bu,
                  DenseView<double> c, DenseView<double> dy);

template <class Observer>
using MatricesOf = ObserverMatrices<Observer::order, Observer::extension, Observer::levels>;

template <SampledLinearObserver Observer>
MatricesOf<Observer> observer_matrices(const Observer& observer, double = 0.0) {
  using Matrices = MatricesOf<Observer>;
  constexpr int size = Matrices::size;
  constexpr int states = Matrices::states;

  Matrices m;
  const auto sampled = sampled_matrices(observer);
  m.input_gain = static_cast<double>(observer.input_gain());
  m.sample_time = static_cast<double>(observer.sample_time());

  Array<double, states> gains{};
  Array<int, size> state_of{};
  for (int r = 0; r < size; ++r) {
    state_of[static_cast<std::size_t>(r)] = state_of_row<Observer>(r);
    for (int level = 0; level < Observer::levels; ++level) {
      gains[static_cast<std::size_t>(level * size + r)] =
          sampled.units(r) *
          static_cast<double>(observer.level_gain(level)[static_cast<std::size_t>(r)]);
    }
  }
  EigenMatrix<double, states, states + 2> work = EigenMatrix<double, states, states + 2>::Zero();
  // Eigen stores a matrix of one column by columns.
  put_together({size, Observer::levels},
               {{sampled.step.data(), size},
                {sampled.gamma.data(), size, 1},
                {sampled.disturbance.data(), size},
                gains.data(),
                state_of.data()},
               {work.data(), states, states + 2}, {m.a.data(), states}, {m.by.data(), states, 1},
               {m.bu.data(), states, 1}, {m.c.data(), size, states}, {m.dy.data(), size, 1});
  return m;
}

template <ContinuousLinearObserver Observer>
requires(!SampledLinearObserver<Observer>)  //
    MatricesOf<Observer> observer_matrices(const Observer& observer, double t = 0.0) {
  using S = typename Observer::scalar_type;
  using State = typename Observer::State;
  MatricesOf<Observer> m;
  m.input_gain = static_cast<double>(observer.input_gain());
  const S time = static_cast<S>(t);
  constexpr int order = Observer::order;
  constexpr int size = MatricesOf<Observer>::size;
  // The states of the observer contain the disturbance found by each level; these contain the sums.
  const auto sums = [](const State& z, int row) {
    double sum = static_cast<double>(z(row));
    if (row % size < order) return sum;
    for (int before = row - size; before >= 0; before -= size)
      sum += static_cast<double>(z(before));
    return sum;
  };
  const auto column = [&](const State& z, const S& y, const S& u, auto&& to) {
    const State rate = observer.derivative(time, z, y, u);
    for (int i = 0; i < Observer::states; ++i) to(i) = sums(rate, i);
  };
  for (int j = 0; j < Observer::states; ++j) {
    State unit = State::Zero();
    unit(j) = S(1);
    if (j % size >= order && j + size < Observer::states) unit(j + size) = S(-1);
    column(unit, S(0), S(0), m.a.col(j));
    const typename Observer::Estimate estimate = Observer::estimate(unit);
    for (int r = 0; r < size; ++r) m.c(r, j) = static_cast<double>(estimate(r));
  }
  const State zero = State::Zero();
  column(zero, S(1), S(0), m.by);
  column(zero, S(0), S(1), m.bu);
  return m;
}

template <class Matrices, int Inputs>
LinearSystem<Matrices::states, Inputs, Matrices::size> system_of(const Matrices& m) {
  LinearSystem<Matrices::states, Inputs, Matrices::size> system;
  system.a = m.a;
  system.c = m.c;
  system.sample_time = m.sample_time;
  return system;
}

/// Sets the first input, y (or noise on it) times `sign`, and the second, a column given row by
/// row.
template <class System, class Matrices, class Column>
void set_inputs(System& system, const Matrices& m, Column&& column, double sign = 1.0) {
  for (int i = 0; i < Matrices::states; ++i) {
    system.b(i, 0) = sign * m.by(i);
    system.b(i, 1) = column(i);
  }
  for (int r = 0; r < Matrices::size; ++r) system.d(r, 0) = sign * m.dy(r);
}

}  // namespace detail

/// From (y, u) to all estimates (y, .., y^(n-1), d, .., d^(m-1)); N p states.
///
/// Sampled: from y[k] and the input u[k] that is held from k to k + 1 (the u_applied of the next
/// `update`) to the estimate right after the correction at k.
/// @param t s, for a continuous observer whose gain changes with time: the gain at this time is
/// used
template <LinearObserver Observer>
auto observer_system(const Observer& observer, double t = 0.0) {
  const auto m = detail::observer_matrices(observer, t);
  auto system = detail::system_of<detail::MatricesOf<Observer>, 2>(m);
  detail::set_inputs(system, m, [&](int i) { return m.bu(i); });
  system.input_names = {"y", "u"};
  system.output_names = detail::estimate_names<Observer::order, Observer::extension>();
  balance(system);
  return system;
}

/// From measurement noise v and the true total disturbance d to the errors yhat^(i) - y^(i) in rows
/// i < n, and to dhat, dhat', .. themselves.
///
/// The plant is y^(n) = d + b0 u, measured as y + v; u has no effect. From d to dhat the static
/// gain is one. Sampled: d[k] is held from k to k + 1, and v[k] adds to y[k].
/// @param t s, as in observer_system
template <LinearObserver Observer>
auto estimation_system(const Observer& observer, double t = 0.0) {
  if constexpr (SampledLinearObserver<Observer>) {
    static_assert(model_traits<std::remove_cvref_t<decltype(observer.model())>>.adds_levels,
                  "esokit: with a lag or known poles d does not act as u does; use "
                  "observer_system");
  }
  const auto m = detail::observer_matrices(observer, t);
  auto system = detail::system_of<detail::MatricesOf<Observer>, 2>(m);
  // In zhat - (y, .., y^(n-1), 0) the disturbance enters like -b0 u.
  detail::set_inputs(system, m, [&](int i) { return -m.bu(i) / m.input_gain; });
  system.input_names = {"v", "d"};
  system.output_names = detail::estimate_names<Observer::order, Observer::extension>();
  for (std::size_t i = 0; i < Observer::order; ++i) system.output_names[i] = "error of a state";
  balance(system);
  return system;
}

/// From measurement noise v and w = d^(m) to the estimation errors z - zhat, all rows. The errors
/// tend to zero unless the measurement is noisy or d^(m) is not zero. Sampled: w is held from k to
/// k + 1.
/// @param t s, as in observer_system
template <LinearObserver Observer>
auto error_system(const Observer& observer, double t = 0.0) {
  if constexpr (SampledLinearObserver<Observer>) {
    static_assert(
        model_traits<std::remove_cvref_t<decltype(observer.model())>>.is_chain,
        "esokit: the error's system is driven by d^(m), which only a chain of integrators "
        "has; use estimation_system");
  }
  constexpr int size = Observer::order + Observer::extension;
  const auto m = detail::observer_matrices(observer, t);
  auto system = detail::system_of<detail::MatricesOf<Observer>, 2>(m);
  Array<double, size> drive{};
  drive.back() = 1.0;
  if (m.sample_time > 0.0) {
    double term = 1.0;
    for (int i = size - 1; i >= 0; --i) {
      term = term * m.sample_time / (size - i);
      drive[static_cast<std::size_t>(i)] = term;
    }
  }
  // The error is the true state minus the estimate, so v enters like -y.
  detail::set_inputs(
      system, m, [&](int i) { return drive[static_cast<std::size_t>(i % size)]; }, -1.0);
  system.input_names = {"v", "w"};
  system.output_names = detail::estimate_names<Observer::order, Observer::extension>();
  balance(system);
  return system;
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/observer_system.ipp>
#endif
