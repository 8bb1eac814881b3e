/// @file
/// AugmentedModel of a whole plant: any observable LinearPlant as the model of an observer, with a
/// disturbance that enters at any place.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/detail/observable_part.hpp>
#include <esokit/model/detail/parts_layout.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/model/matrix_model.hpp>
#include <esokit/model/model_parts.hpp>
#include <limits>
#include <string_view>

namespace esokit {

/// x' = A x + B u + E d, y = C x: a plant with zeros, known poles, or a disturbance that does not
/// enter where u does (mismatched), sampled exactly. d is the sum of a constant (or polynomial),
/// sines and first-order disturbances; y may be measured through a sensor with a lag.
///
/// y^(n) = D + b u, where n is the relative degree from u to y. `estimate` is (y, .., y^(n-1), D,
/// ..), where D is everything that a law cancels, so that `Adrc` works with it; `plant_state` and
/// `disturbance` give x and d. If D is cancelled, the zeros of the plant become poles of the loop:
/// with a zero in the right half plane use the estimates only.
///
/// The config's `input_gain` is b. B is scaled to agree with it, E is not. For a dead time use
/// DelayedInput; write an actuator into A. Poles: as for any AugmentedModel, with all poles of the
/// plant (an actuator, too) at exp(-omega_o T).
/// @tparam Parts with `states`, the length of x; `order` is the relative degree from u to y
template <ModelParts Parts, Scalar S>
requires(Parts.states > 0)  //
    class AugmentedModel<Parts, S> : public MatrixModel<detail::PartsShape<Parts>, S> {
  using Shape = detail::PartsShape<Parts>;
  using Base = MatrixModel<Shape, S>;
  static constexpr int States = Parts.states;
  static constexpr int n = Parts.order;
  static constexpr int lf = Parts.sensor;
  static constexpr int inner = Base::size - lf;  ///< states without the sensor's
  static_assert(Parts.constants >= 1, "esokit: at least one extended state is needed");
  static_assert(lf >= 0 && lf <= 2, "esokit: a lag has order 0, 1 or 2");
  static_assert(Parts.resonators >= 0 && Parts.first_order >= 0,
                "esokit: the number of parts must not be negative");
  static_assert(n >= 1 && n <= States, "esokit: the relative degree is 1 .. States");
  static_assert(Parts.actuator == 0 && !Parts.plant_poles,
                "esokit: actuator and poles of a whole plant are in its matrices");
  static_assert(!Parts.follows_speed, "esokit: a model of a whole plant follows no speed");

 public:
  static constexpr ModelParts parts = Parts;  ///< what is known
  using Base::order;
  using Base::size;
  using typename Base::Estimate;
  using typename Base::State;

  static constexpr ModelTraits traits{.tells_disturbance = true,
                                      .corrects_part = true};  ///< what it is
  template <class T>
  using with_scalar = AugmentedModel<Parts, T>;  ///< the same with another scalar

  using Settings = PartsSettings<Parts, S>;  ///< settings of make

  /// Checks the plant and samples it with its disturbance.
  /// @param settings the plant @param input_gain b @param sample_time T, s; both checked
  /// @return the model, or an error that names the field. For an unobservable state or disturbance
  ///         its value is the share that y shows of it: 0 unobservable, 1 fully visible
  static Expected<AugmentedModel, Error<S>> make(const Settings& settings, const S& input_gain,
                                                 const S& sample_time) {
    const auto& plant = settings.plant;
    if (const auto ok = plant.validate(); !ok) {
      Error<S> error = ok.error();
      for (const char* field : {"model.plant.a", "model.plant.b", "model.plant.c", "model.plant.e",
                                "model.plant.dead_time"}) {
        if (std::string_view(field).substr(12) == error.field) error.field = field;
      }
      return error;
    }
    Rules<S> rules;
    const int degree = plant.relative_degree();
    rules
        .demand(degree == n, {"model.plant", static_cast<S>(degree),
                              "has another relative degree than", -1, S(n), true})
        .demand(!(plant.dead_time > S(0)), "model.plant.dead_time", plant.dead_time,
                "must be 0: a delay of u is DelayedInput's")
        .all_of(detail::check_parts(settings, sample_time));
    if (!rules) return rules.error();
    const S seen = shown_share(plant, sample_time);
    constexpr S least = S(1024) * std::numeric_limits<S>::epsilon();
    rules.demand(
        seen >= least,
        {"model.plant.c", seen, "makes a state unobservable: the share that y shows of it is below",
         -1, least, true});
    const Numerator from_d(plant, sample_time);
    const auto passes = [&](const char* field, int index, const char* rule, const S& real,
                            const S& imaginary) {
      const S passed = from_d.share(real * sample_time, imaginary * sample_time);
      rules.demand(passed >= least, {field, passed, rule, index, least, true});
    };
    passes("model.plant.e", -1,
           "hides a constant disturbance behind a zero: the share that y shows of it is below",
           S(0), S(0));
    for (std::size_t i = 0; i < settings.resonators.size(); ++i) {
      const auto& [w, damping, capture] = settings.resonators[i];
      passes("model.resonators.frequency", static_cast<int>(i),
             "hides a sine behind a zero: the share that y shows of it is below", -(damping * w),
             w * std::sqrt(S(1) - damping * damping));
    }
    for (std::size_t i = 0; i < settings.first_order.size(); ++i) {
      passes("model.first_order", static_cast<int>(i),
             "hides a decaying disturbance behind a zero: the share that y shows of it is below",
             S(-1) / settings.first_order[i], S(0));
    }
    if (!rules) return rules.error();
    AugmentedModel model(settings, input_gain, sample_time);
    for (const S& x : model.step_) {
      rules.demand(is_finite(x), "model.plant", x,
                   "gives a transition that the scalar cannot hold");
    }
    if (!rules) return rules.error();
    return model;
  }

  /// The settings, as they were given.
  [[nodiscard]] constexpr const Settings& settings() const noexcept { return rest_.settings; }

  /// The estimate for a plant at rest at y under a constant u.
  [[nodiscard]] Estimate equilibrium(const S& y, const S& u) const noexcept {
    return rest_.rest_of_y * y + rest_.rest_of_u * u;
  }

  /// @name The parts of an estimate
  /// @{
  /// x.
  [[nodiscard]] Vector<S, States> plant_state(const Estimate& z) const noexcept {
    const auto natural = natural_of(z);
    return natural.template head<States>();
  }
  /// d, the sum of all its parts.
  [[nodiscard]] S disturbance(const Estimate& z) const noexcept {
    const auto natural = natural_of(z);
    S sum(0);
    for (const int part : parts_of_d) sum = sum + natural(part);
    return sum;
  }
  /// The constant (or polynomial) part of d.
  [[nodiscard]] S constant(const Estimate& z) const noexcept { return natural_of(z)(States); }
  /// @}

  /// The part of a correction that belongs to the disturbance: the one that leaves x unchanged.
  [[nodiscard]] State disturbance_part(const State& x) const noexcept {
    const auto of_d = detail::block<inner - States, inner>(rest_.natural, States, 0);
    return with_sensor(rest_.of_disturbance * (of_d * without_sensor(x)));
  }

  /// Returns `design(part)`, called with the CorrectedPart.
  /// @param bandwidth omega_o, rad/s: a sensor that is faster keeps its own poles
  template <class Design>
  auto with_corrected_part(const S& bandwidth, const Design& design) const {
    if constexpr (lf > 0) {
      if (detail::sensor_rate(rest_.settings.sensor) > bandwidth) {
        CorrectedPart<inner, size, Parts.resonators, S> part;
        const Square rates = inner_rates(rest_.settings, this->sample_time_);
        part.step = detail::block<inner, inner>(this->increment(), lf, lf);
        part.whole = Matrix<S, size, inner>::Zero();
        detail::set_block(part.whole, lf, 0, Square::Identity());
        part.set_shown(detail::shown_by_sensor(rest_.settings.sensor, this->sample_time_,
                                               in_rows(rows_of(rates), rates)));
        for (int j = 0; j < inner; ++j) {
          part.degrees[static_cast<std::size_t>(j)] = Base::degree(lf + j);
          part.states[static_cast<std::size_t>(j)] = lf + j;
        }
        part.pairs = detail::own_pairs(rest_.settings.resonators);
        return design(part);
      }
    }
    auto part = corrected_whole<Parts.resonators>(*this);
    part.pairs = detail::own_pairs(rest_.settings.resonators);
    return design(part);
  }

 private:
  friend struct detail::LaneAccess;

  static constexpr int sinusoids = Shape::sinusoids;  ///< first row of the sines
  using Square = Matrix<S, inner, inner>;

  /// The states whose sum is d: the constant, the sines and the first-order disturbances.
  static constexpr auto parts_of_d = [] {
    Array<int, 1 + Parts.resonators + Parts.first_order> all{States};
    for (int i = 0; i < Parts.resonators + Parts.first_order; ++i) {
      all[static_cast<std::size_t>(i + 1)] =
          sinusoids + i + (i < Parts.resonators ? i : Parts.resonators);
    }
    return all;
  }();

  /// C adj(s I - A) E, whose roots are the zeros from d to y, and for each coefficient the sum of
  /// the magnitudes of its terms.
  struct Numerator {
    Array<S, States> coefficients{};  ///< of s^0, s^1, .., in units of T
    Array<S, States> sizes{};

    Numerator(const LinearPlant<States, S>& plant, const S& time) noexcept {
      const auto rates = plant.a * time;
      auto bound = Matrix<S, States, States>::Identity();
      detail::characteristic(rates, [&](int k, const auto& adjugate) {
        coefficients[static_cast<std::size_t>(k)] = plant.c * adjugate * plant.e;
        sizes[static_cast<std::size_t>(k)] =
            detail::magnitudes(plant.c) * bound * detail::magnitudes(plant.e);
        bound = detail::magnitudes(rates) * bound;
        const S more = bound.trace() / static_cast<S>(States - k);
        for (int i = 0; i < States; ++i) bound(i, i) = bound(i, i) + more;
      });
    }

    /// Its magnitude at s relative to those sizes: 0 if a zero at s hides a disturbance exp(s t).
    [[nodiscard]] S share(const S& real, const S& imaginary) const noexcept {
      const S magnitude = std::hypot(real, imaginary);
      S re(0);
      S im(0);
      S size(0);
      for (std::size_t k = States; k-- > 0;) {
        const S product = re * real - im * imaginary;
        im = re * imaginary + im * real;
        re = product + coefficients[k];
        size = size * magnitude + sizes[k];
      }
      return size > S(0) ? S(std::hypot(re, im) / size) : S(0);
    }
  };

  /// T A of (x, states of d).
  static Square inner_rates(const Settings& settings, const S& time) noexcept {
    auto a = Square::Zero();
    detail::set_block(a, 0, 0, settings.plant.a * time);
    for (const int part : parts_of_d) detail::set_block(a, 0, part, settings.plant.e * time);
    for (int i = States; i + 1 < sinusoids; ++i) a(i, i + 1) = time;
    detail::set_sinusoid_rates(a, sinusoids, settings.resonators, settings.first_order, time);
    return a;
  }

  /// Eliminates each row from those below it by its largest element, and returns their columns.
  template <int Rows>
  static Array<int, Rows> eliminate(Matrix<S, Rows, States>& rows) noexcept {
    Array<int, Rows> pivots{};
    for (int k = 0; k < Rows; ++k) {
      int& pivot = pivots[static_cast<std::size_t>(k)];
      for (int j = 1; j < States; ++j) {
        if (detail::absolute(rows(k, j)) > detail::absolute(rows(k, pivot))) pivot = j;
      }
      for (int i = k + 1; i < Rows; ++i) {
        const S factor = rows(i, pivot) / rows(k, pivot);
        for (int j = 0; j < States; ++j) rows(i, j) = rows(i, j) - factor * rows(k, j);
      }
    }
    return pivots;
  }

  /// The rows of the model's states over (x, states of d): T^r / r! y^(r) up to D, then the
  /// elements of x that are least dependent on them, then the states of d.
  [[nodiscard]] Square rows_of(const Square& rates) const noexcept {
    Square rows = Square::Zero();
    detail::set_block(rows, 0, 0, rest_.settings.plant.c);
    for (int r = 1; r <= n; ++r) {
      detail::set_block(rows, r, 0, rows.row(r - 1) * rates / static_cast<S>(r));
    }
    int row = n + 1;
    if constexpr (Shape::replaced == 0) {
      Array<bool, States> taken{};
      auto work = detail::block<n + 1, States>(rows, 0, 0);
      for (const int pivot : eliminate(work)) taken[static_cast<std::size_t>(pivot)] = true;
      const S unit = this->scaled_disturbance(S(1));
      for (int j = 0; j < States; ++j) {
        // If the rows are dependent, there are fewer pivots than rows: the matrix has no inverse,
        // and make fails.
        if (!taken[static_cast<std::size_t>(j)] && row < States) rows(row++, j) = unit;
      }
    }
    for (row = States + Shape::replaced; row < inner; ++row) {
      rows(row, row) = this->of_degree(Base::degree(lf + row), S(1));
    }
    return rows;
  }

  /// A matrix m that acts on (x, states of d) as one that acts on the scaled states without the
  /// sensor's: X = rows m rows^-1, solved from rows' X' = (rows m)'.
  template <int Size>
  static Matrix<S, Size, Size> in_rows(const Matrix<S, Size, Size>& rows,
                                       const Matrix<S, Size, Size>& m) noexcept {
    return detail::solved(rows.transpose(), (rows * m).transpose()).transpose();
  }

  AugmentedModel(const Settings& settings, const S& input_gain, const S& sample_time) noexcept
      : Base(input_gain, sample_time), rest_{settings} {
    const auto& plant = settings.plant;
    const auto b = plant.b * S(input_gain / plant.input_gain());
    const Square rates = inner_rates(settings, sample_time);
    const Square rows = rows_of(rates);
    this->scaled_input_gain_ = this->scaled_disturbance(input_gain);

    // The step of (f, x, states of d, u), which is then converted to rows.
    auto all = Matrix<S, size + 1, size + 1>::Zero();
    detail::set_sensor_rates(all, settings.sensor, sample_time);
    if constexpr (lf > 0) {
      detail::set_block(all, 0, lf, detail::block<lf, 1>(all, 0, lf) * plant.c);
    }
    detail::set_block(all, lf, lf, rates);
    detail::set_block(all, lf, size, b * sample_time);
    all = detail::exp_minus_identity(all);
    auto every = Matrix<S, size, size>::Identity();
    detail::set_block(every, lf, lf, rows);
    const auto input = every * detail::block<size, 1>(all, 0, size);
    detail::set_block(all, 0, 0, in_rows(every, detail::block<size, size>(all, 0, 0)));
    detail::set_block(all, 0, size, input / this->scaled_input_gain_);
    this->set_step(all);
    rest_.of_disturbance = detail::block<inner, inner - States>(rows, 0, States);
    rest_.natural = detail::solved(rows, Square::Identity());

    // At rest: A x + E d = -B u, C x = y.
    auto still = Matrix<S, States + 1, States + 1>::Zero();
    detail::set_block(still, 0, 0, plant.a);
    detail::set_block(still, 0, States, plant.e);
    detail::set_block(still, States, 0, plant.c);
    auto given = Matrix<S, States + 1, 2>::Zero();
    given(States, 0) = S(1);
    detail::set_block(given, 0, 1, -b);
    const auto at_rest =
        detail::block<inner, States + 1>(rows, 0, 0) * detail::solved(still, given);
    rest_.rest_of_y = this->physical(with_sensor(at_rest.col(0), S(1)));
    rest_.rest_of_u = this->physical(with_sensor(at_rest.col(1)));
    // D is what u has to balance and all derivatives are zero. Set exactly, without the rounding
    // error of the equations.
    for (int r = 0; r <= n; ++r) {
      rest_.rest_of_y(r) = S(r == 0 ? 1 : 0);
      rest_.rest_of_u(r) = r == n ? S(-input_gain) : S(0);
    }
  }

  /// The states without the sensor's, and with them. @param shown by the sensor
  /// @{
  static Vector<S, inner> without_sensor(const State& x) noexcept {
    return detail::column(x).template segment<inner>(lf);
  }
  static State with_sensor(const Vector<S, inner>& state, const S& shown = S(0)) noexcept {
    State x{};
    x[0] = shown;  // without a sensor it is replaced below
    for (int i = 0; i < inner; ++i) x[static_cast<std::size_t>(lf + i)] = state(i);
    return x;
  }
  /// @}

  /// (x, states of d) of an estimate.
  [[nodiscard]] Vector<S, inner> natural_of(const Estimate& z) const noexcept {
    return rest_.natural * without_sensor(this->scaled(z));
  }

  /// Smallest pivot of the rows C A^i, each normalised: 0 if a state is unobservable from y.
  static S shown_share(const LinearPlant<States, S>& plant, const S& time) noexcept {
    Matrix<S, States, States> seen;
    RowVector<S, States> row = plant.c;
    for (int i = 0; i < States; ++i) {
      const S size = detail::largest_magnitude(row);
      if (!(size > S(0))) return S(0);
      row /= size;
      detail::set_block(seen, i, 0, row);
      row = row * plant.a * time;
    }
    S least(1);
    int k = 0;
    for (const int pivot : eliminate(seen)) {
      const S size = detail::absolute(seen(k++, pivot));
      if (size < least) least = size;
    }
    return least;
  }

  struct {
    Settings settings;
    Square natural{};  ///< from the scaled states to (x, states of d)
    Matrix<S, inner, inner - States> of_disturbance{};  ///< from the states of d to the model's
    Estimate rest_of_y{};
    Estimate rest_of_u{};
  } rest_;
};

}  // namespace esokit
