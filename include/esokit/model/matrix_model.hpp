/// @file
/// MatrixModel: the common base of the models that are given by Phi and Gamma.
#pragma once

#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/model/model_parts.hpp>
#include <esokit/model/sampled_model.hpp>

namespace esokit {

namespace detail {

/// Which elements of Phi - I and (last column) of Gamma can differ from zero, which of these are
/// known at compile time, and where the others are stored, row by row.
template <int Size>
struct ModelPattern {
  Array<Array<bool, Size + 1>, Size> couples{};
  Array<Array<int, Size + 1>, Size> chain{};  ///< elements of a chain (binomials), else 0
  Array<Array<int, Size + 1>, Size> place{};
  int kept = 0;
  int driven = -1;  ///< the state to which u adds: Gamma is its column of Phi and is not stored;
                    ///< -1: none
};

}  // namespace detail

/// The members of a SampledModel, computed from Phi - I and Gamma without the elements that are
/// always zero. The states are the scaled rows of the estimate, but in another order: those of a
/// sensor come first.
/// @tparam Shape `parts`, `order`, `size`, `measured_rows` (states before y), `sinusoids` (first
/// row of the estimate that belongs to a sine), `degree(state)`, and `pattern`, which elements are
/// not zero
template <class Shape, Scalar S>
class MatrixModel {
 public:
  static constexpr int order = Shape::order;                  ///< of the law
  static constexpr int size = Shape::size;                    ///< N
  static constexpr int extension = size - order;              ///< all rows besides the plant's
  static constexpr int measured_rows = Shape::measured_rows;  ///< states of a sensor

  /// Row of the estimate that is measured: y, or as the sensor shows it.
  static constexpr int measured_row = measured_rows > 0 ? size - measured_rows : 0;

  using State = Array<S, size>;      ///< x, scaled, N elements
  using Estimate = Vector<S, size>;  ///< z, physical units, N x 1

  /// b in y^(order) = D + b u. Without an actuator this is b0, as it was given.
  [[nodiscard]] constexpr const S& input_gain() const noexcept { return input_gain_; }
  /// T, s, as it was given.
  [[nodiscard]] constexpr const S& sample_time() const noexcept { return sample_time_; }
  /// The input of `predict`: u itself.
  [[nodiscard]] ESOKIT_INLINE constexpr S drive(const S& u) const noexcept { return u; }

  /// x one sample ahead: Phi x + Gamma u, without the elements of Phi - I that are always zero.
  [[nodiscard]] ESOKIT_INLINE constexpr State predict(const State& x, const S& u) const noexcept {
    State next = x;
    State acting = x;
    if constexpr (driven >= 0) {
      std::get<driven>(acting) = std::get<driven>(x) + scaled_input_gain_ * u;
    }
    detail::unroll<size>([&](auto i) ESOKIT_INLINE_LAMBDA {
      S sum = std::get<i>(x);
      detail::unroll<size>(
          [&](auto j) ESOKIT_INLINE_LAMBDA { sum = plus_element<i, j>(sum, std::get<j>(acting)); });
      if constexpr (driven < 0) sum = plus_element<i, size>(sum, u);
      std::get<i>(next) = sum;
    });
    return next;
  }

  /// x + Gamma u.
  [[nodiscard]] ESOKIT_INLINE constexpr State add_input(const State& x, const S& u) const noexcept {
    State sum = x;
    constexpr int column = driven >= 0 ? driven : size;
    const S amount = driven >= 0 ? scaled_input_gain_ * u : u;
    detail::unroll<size>([&](auto i) ESOKIT_INLINE_LAMBDA {
      std::get<i>(sum) = plus_element<i, column>(std::get<i>(sum), amount);
    });
    return sum;
  }

  /// The measured value in an estimate: y as the sensor shows it.
  [[nodiscard]] static constexpr S measured(const Estimate& z) noexcept { return z(measured_row); }
  /// The sine of resonator 0 .. k - 1 in d.
  [[nodiscard]] static Phasor<S> sinusoidal_disturbance(const Estimate& z, int resonator) noexcept
      requires(Shape::parts.resonators > 0) {
    const int q = Shape::sinusoids + 2 * resonator;
    return detail::phasor_of(z(q), z(q + 1));
  }
  /// The first-order disturbance 0 .. l - 1 of d.
  [[nodiscard]] static constexpr S first_order_disturbance(const Estimate& z, int part) noexcept
      requires(Shape::parts.first_order > 0) {
    return z(Shape::sinusoids + 2 * Shape::parts.resonators + part);
  }

  /// Place of a row of the estimate among the states: those of the sensor come first.
  [[nodiscard]] static constexpr int state_of_row(int row) noexcept {
    return row + measured_rows < size ? row + measured_rows : row + measured_rows - size;
  }

  /// The estimates in physical units.
  [[nodiscard]] constexpr Estimate physical(const State& x) const noexcept {
    Estimate z;
    detail::unroll<size>([&](auto row) { z(int{row}) = physical<row>(x); });
    return z;
  }
  /// One of the estimates.
  template <int Row>
  [[nodiscard]] ESOKIT_INLINE constexpr S physical(const State& x) const noexcept {
    constexpr int state = state_of_row(Row);
    S value = std::get<state>(x);
    // Multiplied in steps: T^-degree alone may overflow when the estimate does not.
    detail::unroll<degree(state)>([&](auto j) ESOKIT_INLINE_LAMBDA {
      constexpr double weight = degree(state) - j;
      value = value * (detail::constant<S>(weight) * rate_);
    });
    return value;
  }
  /// The state from estimates in physical units.
  [[nodiscard]] constexpr State scaled(const Estimate& z) const noexcept {
    State x{};
    for (int row = 0; row < size; ++row) {
      const int state = state_of_row(row);
      x[static_cast<std::size_t>(state)] = of_degree(degree(state), z(row));
    }
    return x;
  }
  /// D in the scaling of the state. @param disturbance unit of y^(order)
  [[nodiscard]] constexpr S scaled_disturbance(const S& disturbance) const noexcept {
    return of_degree(order, disturbance);
  }

  /// A number that is finite only if all estimates are finite.
  [[nodiscard]] ESOKIT_INLINE constexpr S finite_probe(const State& x) const noexcept {
    constexpr int first = [] {
      int state = 0;
      for (int i = 0; i < size; ++i) {
        if (Shape::degree(i) > Shape::degree(state)) state = i;
      }
      return state;
    }();
    constexpr int highest = degree(first);
    S probe = detail::absolute(std::get<first>(x));
    detail::unroll<highest + 1>([&](auto k) ESOKIT_INLINE_LAMBDA {
      constexpr int now = highest - k;
      if constexpr (now < highest) {
        constexpr double weight = now + 1;
        probe = probe * (detail::constant<S>(weight) * rate_);
      }
      detail::unroll<size>([&](auto i) ESOKIT_INLINE_LAMBDA {
        if constexpr (degree(i) == now && i != first) {
          probe = probe + detail::absolute(std::get<i>(x));
        }
      });
    });
    return probe;
  }

  /// The state of this model with the same estimate as state x of the model `before`.
  [[nodiscard]] constexpr State rescaled(const State& x, const MatrixModel& before) const noexcept {
    if (!(sample_time_ < before.sample_time_) && !(sample_time_ > before.sample_time_)) return x;
    return scaled(before.physical(x));
  }

  /// Phi - I.
  [[nodiscard]] constexpr Matrix<S, size, size> increment() const noexcept {
    Matrix<S, size, size> step = Matrix<S, size, size>::Zero();
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) {
        if (of_chain(i, j) > 0) {
          step(i, j) = static_cast<S>(of_chain(i, j));
        } else if (couples(i, j)) {
          step(i, j) = step_[static_cast<std::size_t>(place(i, j))];
        }
      }
    }
    return step;
  }
  /// A state is its value in physical units times T^degree / degree!.
  [[nodiscard]] static constexpr int degree(int state) noexcept { return Shape::degree(state); }

  /// True if u has the same effect in both models.
  [[nodiscard]] constexpr bool same_drive(const MatrixModel& other) const noexcept {
    const S change = detail::absolute(S(scaled_input_gain_ - other.scaled_input_gain_)) +
                     detail::absolute(S(rate_ - other.rate_));
    return !(change > S(0));
  }

 private:
  friend struct detail::LaneAccess;
  static constexpr int data_members = 5;

 protected:
  /// @param input_gain b @param sample_time T, s
  MatrixModel(const S& input_gain, const S& sample_time) noexcept
      : rate_(S(1) / sample_time), input_gain_(input_gain), sample_time_(sample_time) {}

  /// value T^degree / degree!.
  [[nodiscard]] constexpr S of_degree(int degree, S value) const noexcept {
    for (int j = 1; j <= degree; ++j) value = value * (sample_time_ / static_cast<S>(j));
    return value;
  }

  /// @param all Phi - I, and as last column Gamma for a u in units in which b T^order / order! is
  /// one (not read if u only adds to a state)
  void set_step(const Matrix<S, size + 1, size + 1>& all) noexcept {
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size + (driven < 0 ? 1 : 0); ++j) {
        if (!couples(i, j) || of_chain(i, j) > 0) continue;
        step_[static_cast<std::size_t>(place(i, j))] =
            j < size ? all(i, j) : all(i, j) * scaled_input_gain_;
      }
    }
  }

  static constexpr const auto& pattern = Shape::pattern;  ///< which elements are stored
  static constexpr int driven = pattern.driven;           ///< the state to which u adds, or -1

  /// Whether an element of Phi - I or (column N) Gamma is not zero.
  static constexpr bool couples(int i, int j) noexcept {
    return pattern.couples[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  /// The part of an element that belongs to the chain and is known at compile time.
  static constexpr int of_chain(int i, int j) noexcept {
    return pattern.chain[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  /// Index of an element among the stored ones.
  static constexpr int place(int i, int j) noexcept {
    return pattern.place[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }

  /// sum + an element of Phi - I, or (column N) of Gamma, times `value`.
  template <int Row, int Column>
  [[nodiscard]] ESOKIT_INLINE constexpr S plus_element(const S& sum,
                                                       const S& value) const noexcept {
    if constexpr (of_chain(Row, Column) == 1) {
      return sum + value;
    } else if constexpr (of_chain(Row, Column) > 1) {
      constexpr double binomial = of_chain(Row, Column);
      return sum + detail::constant<S>(binomial) * value;
    } else if constexpr (couples(Row, Column)) {
      return sum + std::get<place(Row, Column)>(step_) * value;
    } else {
      return sum;
    }
  }

  Array<S, pattern.kept> step_{};  ///< the stored elements of Phi - I and Gamma
  S rate_;                         ///< 1/T
  S input_gain_;                   ///< b
  S sample_time_;                  ///< T, s
  S scaled_input_gain_{};          ///< b T^order / order!
};

}  // namespace esokit
