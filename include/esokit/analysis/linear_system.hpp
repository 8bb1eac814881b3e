/// @file
/// The form in which designs are analysed: a small state-space system of fixed size.
#pragma once

#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/eigen.hpp>
#include <esokit/math/detail/dense.hpp>

namespace esokit {

namespace detail {

/// Sum of the magnitudes of `count` numbers; not finite if one of them is not.
template <class T>
constexpr T sum_of_magnitudes(const T* values, int count) noexcept {
  T sum(0.0);
  for (int i = 0; i < count; ++i) sum = sum + absolute(values[i]);
  return sum;
}

}  // namespace detail

/// D x = a x + b w, out = c x + d w. D is d/dt for a continuous system; for a sampled one it is the
/// difference, D x = x[k+1] - x[k].
///
/// So a sampled system is stored as A - I: for small omega T this keeps all digits of the dynamics,
/// of which A would lose log10(1 / (omega T)). Inputs and outputs are in physical units, always in
/// double; the states may be scaled.
/// @tparam States, Inputs, Outputs sizes
template <int States, int Inputs, int Outputs>
struct LinearSystem {
  static_assert(States >= 1 && Inputs >= 1 && Outputs >= 1);
  static constexpr int states = States;    ///< length of x
  static constexpr int inputs = Inputs;    ///< length of w
  static constexpr int outputs = Outputs;  ///< length of out

  /// A, for a sampled system A - I.
  EigenMatrix<double, States, States> a = EigenMatrix<double, States, States>::Zero();
  /// From w to D x.
  EigenMatrix<double, States, Inputs> b = EigenMatrix<double, States, Inputs>::Zero();
  /// From x to out.
  EigenMatrix<double, Outputs, States> c = EigenMatrix<double, Outputs, States>::Zero();
  /// From w to out directly.
  EigenMatrix<double, Outputs, Inputs> d = EigenMatrix<double, Outputs, Inputs>::Zero();
  double sample_time = 0.0;                    ///< T, s; 0 for a continuous system
  Array<const char*, Inputs> input_names{};    ///< static storage
  Array<const char*, Outputs> output_names{};  ///< static storage

  /// True if it has a sample time.
  [[nodiscard]] bool sampled() const noexcept { return sample_time > 0.0; }

  /// A of x' = A x or of x[k+1] = A x[k], States x States.
  [[nodiscard]] EigenMatrix<double, States, States> state_matrix() const {
    if (!sampled()) return a;
    return a + EigenMatrix<double, States, States>::Identity();
  }

  /// The system from one input to one output.
  template <int Input, int Output>
  [[nodiscard]] LinearSystem<States, 1, 1> channel() const {
    static_assert(Input >= 0 && Input < Inputs && Output >= 0 && Output < Outputs,
                  "esokit: no such channel");
    LinearSystem<States, 1, 1> one;
    one.a = a;
    one.b = b.col(Input);
    one.c = c.row(Output);
    one.d(0, 0) = d(Output, Input);
    one.sample_time = sample_time;
    one.input_names[0] = input_names[static_cast<std::size_t>(Input)];
    one.output_names[0] = output_names[static_cast<std::size_t>(Output)];
    return one;
  }
};

/// D x = a x + b w, out = c x + d w: a LinearSystem whose sizes are known at run time.
struct DynamicSystem {
  DynamicMatrix<double> a;   ///< A, for a sampled system A - I
  DynamicMatrix<double> b;   ///< from w to D x
  DynamicMatrix<double> c;   ///< from x to out
  DynamicMatrix<double> d;   ///< from w to out directly
  double sample_time = 0.0;  ///< T, s; 0 for a continuous system
};

namespace detail {

/// Names of the rows of an estimate: yhat, yhat', .. and dhat, dhat', ..
template <int Order, int Extension>
constexpr Array<const char*, Order + Extension> estimate_names() noexcept {
  constexpr const char* plant[] = {"yhat",     "yhat'",    "yhat''",   "yhat^(3)",
                                   "yhat^(4)", "yhat^(5)", "yhat^(6)", "yhat^(7)"};
  constexpr const char* disturbance[] = {"dhat",     "dhat'",    "dhat''",   "dhat^(3)",
                                         "dhat^(4)", "dhat^(5)", "dhat^(6)", "dhat^(7)"};
  Array<const char*, Order + Extension> names{};
  for (int i = 0; i < Order + Extension; ++i) {
    const int k = i < Order ? i : i - Order;
    names[static_cast<std::size_t>(i)] = k > 7       ? "higher derivative"
                                         : i < Order ? plant[k]
                                                     : disturbance[k];
  }
  return names;
}

/// `balance` without the sizes in the type, for code that is compiled once only.
void balance(DenseView<double> a, DenseView<double> b, DenseView<double> c) noexcept;

}  // namespace detail

/// Scales the states by powers of two until rows and columns of `a` are of similar size. Nothing is
/// rounded, and inputs and outputs do not change. The states of a chain differ by up to omega^n.
template <int States, int Inputs, int Outputs>
void balance(LinearSystem<States, Inputs, Outputs>& system) noexcept {
  // Eigen stores a matrix of one row by rows, which is the same.
  detail::balance({system.a.data(), States}, {system.b.data(), States, Inputs},
                  {system.c.data(), Outputs, States});
}

namespace detail {

/// A system without its sizes in the type, for code that is compiled once only.
struct SystemView {
  DenseView<const double> a, b, c, d;
  double sample_time;

  [[nodiscard]] bool sampled() const noexcept { return sample_time > 0.0; }
  [[nodiscard]] int states() const noexcept { return a.rows; }
  [[nodiscard]] int inputs() const noexcept { return b.columns; }
  [[nodiscard]] int outputs() const noexcept { return c.rows; }
};

template <int States, int Inputs, int Outputs>
SystemView view_of(const LinearSystem<States, Inputs, Outputs>& system) noexcept {
  // Eigen stores a matrix of one row by rows, which is the same.
  return {{system.a.data(), States},
          {system.b.data(), States, Inputs},
          {system.c.data(), Outputs, States},
          {system.d.data(), Outputs, Inputs},
          system.sample_time};
}

SystemView view_of(const DynamicSystem& system) noexcept;

double sum_of_magnitudes(const DynamicMatrix<double>& matrix) noexcept;

Check<double> check_system(const SystemView& system);

template <int States, int Inputs, int Outputs>
Check<double> check_system(const LinearSystem<States, Inputs, Outputs>& system) {
  return check_system(view_of(system));
}

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/linear_system.ipp>
#endif
