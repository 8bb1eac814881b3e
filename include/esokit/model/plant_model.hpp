/// @file
/// LinearPlantModel: any observable linear plant, and where in it the disturbance enters, as the
/// model of an observer.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/math/dense.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/model/matrix_model.hpp>
#include <limits>

namespace esokit {

namespace detail {

/// What MatrixModel asks for: nothing is known to be zero.
template <int Order, int Size>
struct DenseShape {
  static constexpr int order = Order;
  static constexpr int size = Size;
  static constexpr int measured_rows = 0;
  static constexpr int degree(int state) noexcept { return state <= Order ? state : Order; }
  static constexpr ModelPattern<Size> pattern = [] {
    ModelPattern<Size> all{};
    for (auto& row : all.couples) row.fill(true);
    for (auto& row : all.place) {
      for (int& place : row) place = all.kept++;
    }
    return all;
  }();
};

}  // namespace detail

/// x' = A x + B u + E d, y = C x with d^(m) = 0: a plant with zeros, known poles, or a disturbance
/// that enters elsewhere than u does (mismatched), sampled exactly.
///
/// y^(n) = D + b u, with n the relative degree of u; `estimate` has (y, .., y^(n-1), D, ..), D all
/// that a law cancels, so that `Adrc` works with it; `plant_state` and `disturbance` give x and d.
/// Cancelling D makes the plant's zeros poles of the loop: with one in the right half plane take
/// the estimates alone.
///
/// The config's `input_gain` says b; B is scaled to it, E is not. A dead time is DelayedInput's.
/// @tparam States of x @tparam Order n, relative degree from u to y @tparam Constants m
template <int States, int Order, PlainScalar S = double, int Constants = 1>
class LinearPlantModel : public MatrixModel<detail::DenseShape<Order, States + Constants>, S> {
  using Base = MatrixModel<detail::DenseShape<Order, States + Constants>, S>;
  static_assert(Order >= 1 && Order <= States, "esokit: the relative degree is 1 .. States");
  static_assert(Constants >= 1, "esokit: at least one extended state is needed");

 public:
  using Base::order;
  using Base::size;
  using typename Base::Estimate;
  using typename Base::State;

  static constexpr ModelTraits traits{};  ///< nothing beyond SampledModel
  template <class T>
  using with_scalar =
      LinearPlantModel<States, Order, T, Constants>;  ///< the same of another scalar

  /// Settings of make.
  struct Settings {
    LinearPlant<States, S> plant{};  ///< A, B, C and, for d, E
  };

  /// Checks the plant and samples it with its disturbance.
  /// @param settings the plant @param input_gain b @param sample_time T, s; both checked
  /// @return the model, or an error that names the field: of what y does not show, with the share
  ///         that it does
  static Expected<LinearPlantModel, Error<S>> make(const Settings& settings, const S& input_gain,
                                                   const S& sample_time) {
    const auto& plant = settings.plant;
    if (const auto ok = plant.check(); !ok) return ok.error();
    Rules<S> rules;
    const int degree = plant.relative_degree();
    rules
        .require(degree == Order, {"model.plant", static_cast<S>(degree),
                                   "has another relative degree than", -1, S(Order), true})
        .require(!(plant.dead_time > S(0)), "model.plant.dead_time", plant.dead_time,
                 "must be 0: a delay of u is DelayedInput's");
    if (!rules) return rules.error();
    const S seen = shown_share(plant, sample_time);
    const S passed = passed_share(plant);
    constexpr S least = S(1024) * std::numeric_limits<S>::epsilon();
    rules
        .require(seen >= least,
                 {"model.plant.c", seen, "leaves a state unobservable: of it y shows a share below",
                  -1, least, true})
        .require(passed >= least, {"model.plant.e", passed,
                                   "lets a constant disturbance hide behind a zero: of it y shows "
                                   "a share below",
                                   -1, least, true});
    if (!rules) return rules.error();
    LinearPlantModel model(plant, input_gain, sample_time);
    for (const S& x : model.step_) {
      rules.require(is_finite(x), "model.plant", x,
                    "gives a transition that the scalar cannot hold");
    }
    if (!rules) return rules.error();
    return model;
  }

  /// The estimate of a plant that stands at y under u.
  [[nodiscard]] Estimate rest(const S& y, const S& u) const noexcept {
    return rest_of_y_ * y + rest_of_u_ * u;
  }

  /// x. @param z the estimate
  [[nodiscard]] Vector<S, States> plant_state(const Estimate& z) const noexcept {
    const auto natural = natural_of(z);
    return natural.template head<States>();
  }
  /// d. @param z the estimate
  [[nodiscard]] S disturbance(const Estimate& z) const noexcept { return natural_of(z)(States); }

  /// True if u does the same in both.
  [[nodiscard]] bool same_drive(const LinearPlantModel& other) const noexcept {
    return Base::same_drive(other);
  }
  /// A state of the model `before` as the same estimate of this one: of y .. D, and x beside it.
  [[nodiscard]] State rescaled(const State& x, const LinearPlantModel& before) const noexcept {
    return this->scaled(before.physical(x));
  }

 private:
  static constexpr int N = States + Constants;
  using Square = Matrix<S, N, N>;

  LinearPlantModel(const LinearPlant<States, S>& plant, const S& input_gain,
                   const S& sample_time) noexcept
      : Base(input_gain, sample_time) {
    const S scale = input_gain / plant.input_gain();
    // (x, d, d', ..), in units of T.
    Matrix<S, N + 1, N + 1> natural = Matrix<S, N + 1, N + 1>::Zero();
    for (int i = 0; i < States; ++i) {
      for (int j = 0; j < States; ++j) natural(i, j) = plant.a(i, j) * sample_time;
      natural(i, States) = plant.e(i) * sample_time;
      natural(i, N) = plant.b(i) * scale * sample_time;
    }
    for (int i = States; i + 1 < N; ++i) natural(i, i + 1) = sample_time;

    // Rows T^r / r! y^(r), and of (x, d, ..) those that are furthest from them.
    Square rows = Square::Zero();
    for (int j = 0; j < States; ++j) rows(0, j) = plant.c(j);
    for (int r = 1; r <= Order; ++r) {
      for (int j = 0; j < N; ++j) {
        S sum(0);
        for (int k = 0; k < N; ++k) sum = sum + rows(r - 1, k) * natural(k, j);
        rows(r, j) = sum / static_cast<S>(r);
      }
    }
    Array<bool, N> taken{};
    Square work = rows;
    for (int r = 0; r <= Order; ++r) {
      int pivot = 0;
      for (int j = 0; j < N; ++j) {
        if (detail::absolute(work(r, j)) > detail::absolute(work(r, pivot))) pivot = j;
      }
      taken[static_cast<std::size_t>(pivot)] = true;
      for (int i = r + 1; i <= Order; ++i) {
        const S factor = work(i, pivot) / work(r, pivot);
        for (int j = 0; j < N; ++j) work(i, j) = work(i, j) - factor * work(r, j);
      }
    }
    const S unit = this->scaled_disturbance(S(1));
    int row = Order + 1;
    for (int j = 0; j < N; ++j) {
      // Fewer pivots than rows, where they depend on each other: no inverse then, and no make.
      if (!taken[static_cast<std::size_t>(j)] && row < N) rows(row++, j) = unit;
    }

    // rows (e^A - I) rows^-1 from behind: rows' X' = (rows E)'.
    const auto step = detail::exp_minus_identity(natural);
    Matrix<S, N, N> right;
    Matrix<S, N + 1, N + 1> all = Matrix<S, N + 1, N + 1>::Zero();
    this->scaled_input_gain_ = this->scaled_disturbance(input_gain);
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j <= N; ++j) {
        S sum(0);
        for (int k = 0; k < N; ++k) sum = sum + rows(i, k) * step(k, j);
        if (j < N) {
          right(j, i) = sum;
        } else {
          all(i, N) = sum / this->scaled_input_gain_;
        }
      }
    }
    Square transposed = rows.transpose();
    detail::solve_in_place(detail::DenseView<S>{transposed.data(), N},
                           detail::DenseView<S>{right.data(), N, N});
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j < N; ++j) all(i, j) = right(j, i);
    }
    this->set_step(all);

    natural_ = Square::Identity();
    Square eliminated = rows;
    detail::solve_in_place(detail::DenseView<S>{eliminated.data(), N},
                           detail::DenseView<S>{natural_.data(), N, N});

    // At rest: A x + E d = -B u, C x = y.
    Matrix<S, States + 1, States + 1> still;
    Matrix<S, States + 1, 2> given = Matrix<S, States + 1, 2>::Zero();
    for (int i = 0; i < States; ++i) {
      for (int j = 0; j < States; ++j) still(i, j) = plant.a(i, j);
      still(i, States) = plant.e(i);
      still(States, i) = plant.c(i);
      given(i, 1) = -plant.b(i) * scale;
    }
    still(States, States) = S(0);
    given(States, 0) = S(1);
    detail::solve_in_place(detail::DenseView<S>{still.data(), States + 1},
                           detail::DenseView<S>{given.data(), States + 1, 2});
    for (int which = 0; which < 2; ++which) {
      State x{};
      for (int i = 0; i < N; ++i) {
        S sum(0);
        for (int j = 0; j <= States; ++j) sum = sum + rows(i, j) * given(j, which);
        x[static_cast<std::size_t>(i)] = sum;
      }
      (which == 0 ? rest_of_y_ : rest_of_u_) = this->physical(x);
    }
    // D is what u has to hold, and nothing moves: without the rounding of the equations.
    for (int r = 0; r <= Order; ++r) {
      rest_of_y_(r) = S(r == 0 ? 1 : 0);
      rest_of_u_(r) = r == Order ? S(-input_gain) : S(0);
    }
  }

  [[nodiscard]] Vector<S, N> natural_of(const Estimate& z) const noexcept {
    const State x = this->scaled(z);
    Vector<S, N> state;
    for (int i = 0; i < N; ++i) state(i) = x[static_cast<std::size_t>(i)];
    return natural_ * state;
  }

  /// Least pivot of the rows C A^i, each in the measure of its own size: 0 where a state is not
  /// seen in y.
  static S shown_share(const LinearPlant<States, S>& plant, const S& time) noexcept {
    Matrix<S, States, States> seen;
    RowVector<S, States> row = plant.c;
    for (int i = 0; i < States; ++i) {
      S size(0);
      for (int j = 0; j < States; ++j) size = detail::larger(size, detail::absolute(row(j)));
      if (!(size > S(0))) return S(0);
      for (int j = 0; j < States; ++j) row(j) = row(j) / size;
      for (int j = 0; j < States; ++j) seen(i, j) = row(j);
      row = row * plant.a * time;
    }
    S least(1);
    for (int k = 0; k < States; ++k) {
      int pivot = 0;
      for (int j = 0; j < States; ++j) {
        if (detail::absolute(seen(k, j)) > detail::absolute(seen(k, pivot))) pivot = j;
      }
      const S size = detail::absolute(seen(k, pivot));
      if (size < least) least = size;
      if (!(size > S(0))) return S(0);
      for (int i = k + 1; i < States; ++i) {
        const S factor = seen(i, pivot) / seen(k, pivot);
        for (int j = 0; j < States; ++j) seen(i, j) = seen(i, j) - factor * seen(k, j);
      }
    }
    return least;
  }

  /// C adj(-A) E, the numerator from d to y at s = 0, against the size of its terms: 0 where a zero
  /// hides a constant d.
  static S passed_share(const LinearPlant<States, S>& plant) noexcept {
    auto adjugate = Matrix<S, States, States>::Identity();  // Faddeev and LeVerrier
    for (int k = 1; k < States; ++k) {
      adjugate = plant.a * adjugate;
      const S next = -adjugate.trace() / static_cast<S>(k);
      for (int i = 0; i < States; ++i) adjugate(i, i) = adjugate(i, i) + next;
    }
    S sum(0);
    S size(0);
    for (int i = 0; i < States; ++i) {
      for (int j = 0; j < States; ++j) {
        const S term = plant.c(i) * adjugate(i, j) * plant.e(j);
        sum = sum + term;
        size = size +
               detail::absolute(S(plant.c(i) * plant.e(j))) * detail::largest_magnitude(adjugate);
      }
    }
    return size > S(0) ? detail::absolute(sum) / size : S(0);
  }

  Square natural_;  ///< from the scaled states to (x, d, ..)
  Estimate rest_of_y_;
  Estimate rest_of_u_;
};

/// Told apart in snapshots.
template <int States, int Order, PlainScalar S, int Constants>
inline constexpr std::uint32_t type_tag<LinearPlantModel<States, Order, S, Constants>> =
    make_type_tag<S>("LinearPlantModel", States, Order, Constants);

}  // namespace esokit
