/// @file
/// LinearPlant: the one type of linear plants, for simulation, analysis and observers.
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/math/detail/dense.hpp>
#include <limits>

namespace esokit {

/// x' = A x + B u(t - dead_time) + E d,  y = C x.
///
/// An aggregate, so that it can be written down directly. These static functions also check it, and
/// return the plant or an error:
///
///     chain({.coefficients = {5, 2}, .input_gain = 10})           // y'' + 2 y' + 5 y = 10 u + d
///     transfer_function({.numerator = {3, 1}, .denominator = {5, 2}})  // (s + 3)/(s^2 + 2 s + 5)
///     state_space({.a = {{0, 1}, {-5, -2}}, .b = {0, 10}, .c = {1, 0}})
///
/// `with_lag`, `with_sensor` and `with_dead_time` add an actuator, a sensor or a delay to an
/// existing plant.
/// @tparam States length of x @tparam Inputs, Outputs lengths of u and y; d is as long as u
template <int States, class ScalarType = double, int Inputs = 1, int Outputs = 1>
requires(detail::is_a_scalar<ScalarType>()) struct LinearPlant {
  static_assert(States >= 1 && Inputs >= 1 && Outputs >= 1);

  static constexpr int states = States;    ///< length of x
  static constexpr int inputs = Inputs;    ///< length of u, and of d
  static constexpr int outputs = Outputs;  ///< length of y

  /// True with one input and one output, as for ADRC with one observer.
  static constexpr bool single = Inputs == 1 && Outputs == 1;

  using scalar_type = ScalarType;              ///< type of all its numbers
  using State = Vector<ScalarType, States>;    ///< x
  using Input = Vector<ScalarType, Inputs>;    ///< u, or d
  using Output = Vector<ScalarType, Outputs>;  ///< y
  template <class T>
  using with_scalar = LinearPlant<States, T, Inputs, Outputs>;  ///< the same with another scalar

  Matrix<ScalarType, States, States> a{};   ///< A, 1/s
  Matrix<ScalarType, States, Inputs> b{};   ///< B
  Matrix<ScalarType, Outputs, States> c{};  ///< C

  /// E: where the disturbance enters. By default E = B: d adds to u and has its unit.
  Matrix<ScalarType, States, Inputs> e = b;
  ScalarType dead_time{};  ///< s, from u to the plant; d is not delayed

  /// Settings of `chain`.
  struct Chain {
    Array<ScalarType, States> coefficients{};  ///< a_0 .. a_(n-1), unit of a_i: s^-(n-i)
    ScalarType input_gain{1.0};  ///< b0, unit of y^(n) per unit of u; not zero, either sign
    ScalarType dead_time{};      ///< s
  };

  /// Settings of `transfer_function`.
  struct TransferFunction {
    Array<ScalarType, States> numerator{};    ///< b_0 .. b_(n-1), not all zero
    Array<ScalarType, States> denominator{};  ///< a_0 .. a_(n-1); s^n has the coefficient 1
    ScalarType dead_time{};                   ///< s
  };

  /// The form in which ADRC sees a plant: n integrations from u to y, with feedback of the states.
  ///
  ///     y^(n) + a_(n-1) y^(n-1) + .. + a_0 y = b0 u(t - dead_time) + d
  ///
  /// x = (y, y', .., y^(n-1)), and d is in the unit of y^(n).
  static constexpr Expected<LinearPlant, Error<ScalarType>> chain(
      const Chain& config) requires single {
    Rules<ScalarType> rules;
    rules.nonzero("input_gain", config.input_gain)
        .finite("coefficients", config.coefficients)
        .not_negative("dead_time", config.dead_time);
    if (!rules) return rules.error();
    LinearPlant plant = companion(config.coefficients, config.dead_time);
    plant.b(States - 1) = config.input_gain;
    plant.e(States - 1) = ScalarType(1.0);
    return plant;
  }

  /// The plant with the transfer function from u to y
  ///
  ///     (b_(n-1) s^(n-1) + .. + b_0) / (s^n + a_(n-1) s^(n-1) + .. + a_0) e^(-s dead_time)
  ///
  /// with d added to u. The first state is y; without zeros x = (y, y', .., y^(n-1)).
  static constexpr Expected<LinearPlant, Error<ScalarType>> transfer_function(
      const TransferFunction& config) requires single {
    Rules<ScalarType> rules;
    rules.finite("numerator", config.numerator)
        .finite("denominator", config.denominator)
        .not_negative("dead_time", config.dead_time);
    if (!rules) return rules.error();
    LinearPlant plant = companion(config.denominator, config.dead_time);
    // Row k of B is the jump of y^(k) after an impulse of u: b_(n-1-k) minus the feedback of the
    // rows before.
    bool any = false;
    for (int k = 0; k < States; ++k) {
      ScalarType row = config.numerator[static_cast<std::size_t>(States - 1 - k)];
      any = any || !all(!(detail::absolute(row) > ScalarType(0.0)));
      for (int j = 0; j < k; ++j) {
        row = row - config.denominator[static_cast<std::size_t>(States - k + j)] * plant.b(j);
      }
      rules.demand(all(is_finite(row)), "numerator", row,
                   "gives, with this denominator, a state that the scalar cannot hold",
                   States - 1 - k);
      plant.b(k) = row;
    }
    rules.demand(any, "numerator", config.numerator[0], "must not be zero throughout", 0);
    if (!rules) return rules.error();
    plant.e = plant.b;
    return plant;
  }

  /// The plant with the given matrices, after `validate`.
  static constexpr Expected<LinearPlant, Error<ScalarType>> state_space(const LinearPlant& plant) {
    if (const auto ok = plant.validate(); !ok) return ok.error();
    return plant;
  }

  /// An error for a number that is not finite, a negative dead time, an output that no input
  /// reaches, or an input gain that the scalar cannot hold. Its index is the element, counted by
  /// columns, or the number of the output.
  [[nodiscard]] constexpr Check<ScalarType> validate() const {
    Rules<ScalarType> rules;
    rules.finite("a", a).finite("b", b).finite("c", c).finite("e", e).not_negative("dead_time",
                                                                                   dead_time);
    for (int i = 0; i < Outputs && rules; ++i) {
      const Reached reached = first_gain(i);
      rules.demand(reached.degree > 0, "c", c(i, 0), "is of an output that no input reaches", i);
      for (const ScalarType& gain : reached.gain) {
        rules.demand(all(is_finite(gain)), "b", gain,
                     "gives an input gain (the value here) that the scalar cannot hold");
      }
    }
    return rules;
  }

  /// x', 1/s times the unit of x. @param u as it arrives at the plant, dead_time after it was sent
  [[nodiscard]] constexpr State derivative(const State& x, const Input& u,
                                           const Input& d = Input()) const noexcept {
    State rate;
    detail::unroll<States>([&](auto i) ESOKIT_INLINE_LAMBDA {
      ScalarType sum = a(i, 0) * x(0);
      detail::unroll<States - 1>([&](auto j)
                                     ESOKIT_INLINE_LAMBDA { sum = sum + a(i, j + 1) * x(j + 1); });
      detail::unroll<Inputs>(
          [&](auto j) ESOKIT_INLINE_LAMBDA { sum = sum + (b(i, j) * u(j) + e(i, j) * d(j)); });
      rate(i) = sum;
    });
    return rate;
  }

  /// y.
  [[nodiscard]] constexpr Output output(const State& x) const noexcept {
    Output y;
    detail::unroll<Outputs>([&](auto i) ESOKIT_INLINE_LAMBDA {
      ScalarType sum = c(i, 0) * x(0);
      detail::unroll<States - 1>([&](auto j)
                                     ESOKIT_INLINE_LAMBDA { sum = sum + c(i, j + 1) * x(j + 1); });
      y(i) = sum;
    });
    return y;
  }

  /// The order n for ADRC: that of the lowest derivative of the output on which an input acts
  /// directly; 0 if there is none. A value that could be rounding error counts as zero.
  [[nodiscard]] constexpr int relative_degree(int output = 0) const noexcept {
    return first_gain(output).degree;
  }

  /// b0 for ADRC: what a unit of u adds to the derivative of order relative_degree(). For several
  /// channels a matrix, Outputs x Inputs: the input_matrix of MimoAdrc.
  [[nodiscard]] constexpr auto input_gain() const noexcept {
    if constexpr (single) {
      return first_gain(0).gain(0);
    } else {
      Matrix<ScalarType, Outputs, Inputs> gains;
      for (int i = 0; i < Outputs; ++i) detail::set_block(gains, i, 0, first_gain(i).gain);
      return gains;
    }
  }

  /// a_0 .. a_(n-1) of det(s I - A) = s^n + a_(n-1) s^(n-1) + .. + a_0: the plant's poles, as
  /// `chain` and `.plant` of an AugmentedModel take them.
  [[nodiscard]] constexpr Array<ScalarType, States> coefficients() const noexcept {
    return detail::characteristic(a, [](int, const auto&) {});
  }

 private:
  struct Reached {
    int degree;
    RowVector<ScalarType, Inputs> gain;
  };

  /// A and C for the states (y, y', .., y^(n-1)).
  static constexpr LinearPlant companion(const Array<ScalarType, States>& coefficients,
                                         const ScalarType& dead_time) noexcept {
    LinearPlant plant;
    for (int i = 0; i < States; ++i) {
      if (i + 1 < States) plant.a(i, i + 1) = ScalarType(1.0);
      plant.a(States - 1, i) = -coefficients[static_cast<std::size_t>(i)];
    }
    plant.c(0, 0) = ScalarType(1.0);
    plant.dead_time = dead_time;
    return plant;
  }

  /// The first of C B, C A B, C A^2 B, .. that exceeds the rounding error of its sums.
  [[nodiscard]] constexpr Reached first_gain(int output) const noexcept {
    using Table = detail::TableScalar<ScalarType>;
    RowVector<ScalarType, States> row = c.row(output);
    RowVector<ScalarType, States> magnitude = detail::magnitudes(row);
    for (int degree = 1; degree <= States; ++degree) {
      const auto gain = row * b;
      const auto size = magnitude * detail::magnitudes(b);
      const ScalarType rounding(std::numeric_limits<Table>::epsilon() *
                                static_cast<Table>(2 * States * degree));
      for (int j = 0; j < Inputs; ++j) {
        const bool lost = !all(is_finite(gain(j)));
        if (lost || !all(detail::absolute(gain(j)) <= rounding * size(j))) return {degree, gain};
      }
      row = row * a;
      magnitude = magnitude * detail::magnitudes(a);
    }
    return {0, {}};
  }
};

namespace detail {

/// The plant with `More` first-order lags appended to its states; `connect(bigger, rate)` connects
/// them.
template <int More, int States, Scalar S, int Inputs, int Outputs, class Connect>
constexpr Expected<LinearPlant<States + More, S, Inputs, Outputs>, Error<S>> with_first_order(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const S& time_constant,
    const Connect& connect) {
  Rules<S> rules;
  rules.all_of(plant.validate())
      .positive("time_constant", time_constant)
      .invertible("time_constant", time_constant);
  if (!rules) return rules.error();
  LinearPlant<States + More, S, Inputs, Outputs> bigger;
  bigger.dead_time = plant.dead_time;
  set_block(bigger.a, 0, 0, plant.a);
  set_block(bigger.b, 0, 0, plant.b);
  set_block(bigger.e, 0, 0, plant.e);
  set_block(bigger.c, 0, 0, plant.c);
  const S rate = S(1.0) / time_constant;
  for (int j = States; j < States + More; ++j) bigger.a(j, j) = -rate;
  connect(bigger, rate);
  rules.demand(bigger.validate().has_value(), "time_constant", time_constant,
               "gives a plant that the scalar cannot hold");
  if (!rules) return rules.error();
  return bigger;
}

}  // namespace detail

/// The plant behind an actuator of first order, time_constant u_a' + u_a = u, one for each input. d
/// enters behind the actuator, as a load does. The new states u_a come last.
/// @param time_constant s
template <int States, Scalar S, int Inputs, int Outputs>
constexpr Expected<LinearPlant<States + Inputs, S, Inputs, Outputs>, Error<S>> with_lag(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const S& time_constant) {
  return detail::with_first_order<Inputs>(plant, time_constant, [&](auto& p, const S& rate) {
    detail::set_block(p.a, 0, States, plant.b);
    p.b = Matrix<S, States + Inputs, Inputs>::Zero();
    detail::set_block(p.b, States, 0, Matrix<S, Inputs, Inputs>::Identity() * rate);
  });
}

/// The plant seen by a sensor of first order, time_constant y_s' + y_s = y, one for each output.
/// The new states y_s come last; they are the outputs of the new plant.
/// @param time_constant s
template <int States, Scalar S, int Inputs, int Outputs>
constexpr Expected<LinearPlant<States + Outputs, S, Inputs, Outputs>, Error<S>> with_sensor(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const S& time_constant) {
  return detail::with_first_order<Outputs>(plant, time_constant, [&](auto& p, const S& rate) {
    detail::set_block(p.a, States, 0, plant.c * rate);
    p.c = Matrix<S, Outputs, States + Outputs>::Zero();
    detail::set_block(p.c, 0, States, Matrix<S, Outputs, Outputs>::Identity());
  });
}

/// The plant with additional dead time. @param dead_time s, zero or more
template <int States, Scalar S, int Inputs, int Outputs>
constexpr Expected<LinearPlant<States, S, Inputs, Outputs>, Error<S>> with_dead_time(
    const LinearPlant<States, S, Inputs, Outputs>& plant, const S& dead_time) {
  Rules<S> rules;
  rules.all_of(plant.validate()).not_negative("dead_time", dead_time);
  if (!rules) return rules.error();
  auto late = plant;
  late.dead_time = late.dead_time + dead_time;
  if (const auto ok = late.validate(); !ok) return ok.error();
  return late;
}

}  // namespace esokit
