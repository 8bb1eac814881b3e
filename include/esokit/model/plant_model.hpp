/// @file
/// LinearPlantModel: any observable linear plant as the model of an observer, with a
/// disturbance that enters at any place.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/type_tag.hpp>
#include <esokit/math/dense.hpp>
#include <esokit/model/corrected_part.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/model/matrix_model.hpp>
#include <esokit/model/model_parts.hpp>
#include <esokit/model/plant_shape.hpp>
#include <limits>

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
/// DelayedInput; write an actuator into A. Poles: as for AugmentedModel, with all poles of the
/// plant (an actuator, too) at exp(-omega_o T).
/// @tparam States length of x @tparam Parts uses `order` (the relative degree from u to y),
/// `sensor`, `constants`, `resonators` and `first_order`; everything else is in the plant
template <int States, ModelParts Parts, Scalar S = double>
class LinearPlantModel : public MatrixModel<detail::PlantShape<States, Parts>, S> {
  using Shape = detail::PlantShape<States, Parts>;
  using Base = MatrixModel<Shape, S>;
  static constexpr int n = Parts.order;
  static constexpr int lf = Parts.sensor;
  static constexpr int inner = Base::size - lf;  ///< states without the sensor's
  static_assert(n >= 1 && n <= States, "esokit: the relative degree is 1 .. States");
  static_assert(Parts.constants >= 1, "esokit: at least one extended state is needed");
  static_assert(lf >= 0 && lf <= 2, "esokit: a lag has order 0, 1 or 2");
  static_assert(Parts.resonators >= 0 && Parts.first_order >= 0,
                "esokit: the number of parts must not be negative");
  static_assert(Parts.actuator == 0 && !Parts.plant_poles,
                "esokit: actuator and poles of a LinearPlantModel are in its plant");
  static_assert(!Parts.follows_speed, "esokit: only an AugmentedModel follows a speed");

 public:
  static constexpr ModelParts parts = Parts;  ///< what is known besides the plant
  using Base::order;
  using Base::size;
  using typename Base::Estimate;
  using typename Base::State;

  static constexpr ModelTraits traits{.tells_disturbance = true,
                                      .corrects_part = true};  ///< what it is
  template <class T>
  using with_scalar = LinearPlantModel<States, Parts, T>;  ///< the same with another scalar

  /// Settings of make; members of absent parts are empty.
  struct Settings {
    LinearPlant<States, S> plant{};                      ///< A, B, C and, for d, E
    Lag<lf, S> sensor{};                                 ///< from y to what is measured
    Array<Resonance<S>, Parts.resonators> resonators{};  ///< sines of d
    Array<S, Parts.first_order>
        first_order{};  ///< time constants of the first-order disturbances, s
  };

  /// Checks the plant and samples it with its disturbance.
  /// @param settings the plant @param input_gain b @param sample_time T, s; both checked
  /// @return the model, or an error that names the field. For an unobservable state or disturbance
  ///         its value is the share that y shows of it: 0 unobservable, 1 fully visible
  static Expected<LinearPlantModel, Error<S>> make(const Settings& settings, const S& input_gain,
                                                   const S& sample_time) {
    const auto& plant = settings.plant;
    if (const auto ok = plant.check(); !ok) return ok.error();
    Rules<S> rules;
    const int degree = plant.relative_degree();
    rules
        .require(degree == n, {"model.plant", static_cast<S>(degree),
                               "has another relative degree than", -1, S(n), true})
        .require(!(plant.dead_time > S(0)), "model.plant.dead_time", plant.dead_time,
                 "must be 0: a delay of u is DelayedInput's");
    detail::check_sensor(rules, settings.sensor, sample_time);
    detail::check_resonators(rules, settings.resonators, sample_time);
    detail::check_first_order(rules, settings.first_order, sample_time);
    if (!rules) return rules.error();
    const S seen = shown_share(plant, sample_time);
    constexpr S least = S(1024) * std::numeric_limits<S>::epsilon();
    rules.require(
        seen >= least,
        {"model.plant.c", seen, "makes a state unobservable: the share that y shows of it is below",
         -1, least, true});
    const Numerator from_d(plant, sample_time);
    const auto passes = [&](const char* field, int index, const char* rule, const S& real,
                            const S& imaginary) {
      const S passed = from_d.share(real * sample_time, imaginary * sample_time);
      rules.require(passed >= least, {field, passed, rule, index, least, true});
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
    LinearPlantModel model(settings, input_gain, sample_time);
    for (const S& x : model.step_) {
      rules.require(is_finite(x), "model.plant", x,
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
    S sum = natural(States);
    for (int j = 0; j < Parts.resonators; ++j) sum = sum + natural(sinusoids + 2 * j);
    for (int j = 0; j < Parts.first_order; ++j)
      sum = sum + natural(sinusoids + 2 * Parts.resonators + j);
    return sum;
  }
  /// The constant (or polynomial) part of d.
  [[nodiscard]] S constant(const Estimate& z) const noexcept { return natural_of(z)(States); }
  /// @}

  /// The part of a correction that belongs to the disturbance: the one that leaves x unchanged.
  [[nodiscard]] State disturbance_part(const State& x) const noexcept {
    State part{};
    for (int k = States; k < inner; ++k) {
      S element(0);
      for (int j = 0; j < inner; ++j) {
        element = element + rest_.natural(k, j) * x[static_cast<std::size_t>(lf + j)];
      }
      for (int i = 0; i < inner; ++i) {
        S& row = part[static_cast<std::size_t>(lf + i)];
        row = row + rest_.of_disturbance(i, k - States) * element;
      }
    }
    return part;
  }

  /// True if u has the same effect in both models.
  [[nodiscard]] bool same_drive(const LinearPlantModel& other) const noexcept {
    return Base::same_drive(other);
  }
  /// The state of this model with the same estimates y .. D and the same other plant states as
  /// state x of the model `before`.
  [[nodiscard]] State rescaled(const State& x, const LinearPlantModel& before) const noexcept {
    return this->scaled(before.physical(x));
  }

  /// Returns `design(part)`, called with the CorrectedPart.
  /// @param bandwidth omega_o, rad/s: a sensor that is faster keeps its own poles
  template <class Design>
  auto with_corrected_part(const S& bandwidth, const Design& design) const {
    if constexpr (lf > 0) {
      if (detail::sensor_rate(rest_.settings.sensor) > bandwidth) {
        CorrectedPart<inner, size, Parts.resonators, S> part;
        const auto natural = inner_rates(rest_.settings, this->sample_time_, S(0));
        const auto step = this->increment();
        Square rates;
        for (int i = 0; i < inner; ++i) {
          for (int j = 0; j < inner; ++j) {
            rates(i, j) = natural(i, j);
            part.step(i, j) = step(lf + i, lf + j);
          }
        }
        const auto shown = detail::shown_by_sensor(rest_.settings.sensor, this->sample_time_,
                                                   in_rows(rows_of(natural), rates));
        part.output.fill(S(0));
        part.whole = Matrix<S, size, inner>::Zero();
        for (int j = 0; j < inner; ++j) {
          part.degrees[static_cast<std::size_t>(j)] = Base::degree(lf + j);
          part.states[static_cast<std::size_t>(j)] = lf + j;
          part.output[static_cast<std::size_t>(j)] = shown(0, j);
          for (int i = 0; i < lf; ++i) part.whole(i, j) = shown(i, j);
          part.whole(lf + j, j) = S(1);
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

  /// C adj(s I - A) E, whose roots are the zeros from d to y, and for each coefficient the sum of
  /// the magnitudes of its terms.
  struct Numerator {
    Array<S, States> coefficients{};  ///< of s^0, s^1, .., in units of T
    Array<S, States> sizes{};

    Numerator(const LinearPlant<States, S>& plant, const S& time) noexcept {
      auto adjugate = Matrix<S, States, States>::Identity();  // Faddeev-LeVerrier algorithm
      auto bound = adjugate;
      for (int k = States - 1; k >= 0; --k) {
        S sum(0);
        S size(0);
        for (int i = 0; i < States; ++i) {
          for (int j = 0; j < States; ++j) {
            sum = sum + plant.c(i) * adjugate(i, j) * plant.e(j);
            size = size + detail::absolute(S(plant.c(i) * plant.e(j))) * bound(i, j);
          }
        }
        coefficients[static_cast<std::size_t>(k)] = sum;
        sizes[static_cast<std::size_t>(k)] = size;
        auto rates = plant.a * time;
        adjugate = rates * adjugate;
        for (S& x : rates) x = detail::absolute(x);
        bound = rates * bound;
        const S next = adjugate.trace() / static_cast<S>(States - k);
        const S more = bound.trace() / static_cast<S>(States - k);
        for (int i = 0; i < States; ++i) {
          adjugate(i, i) = adjugate(i, i) - next;
          bound(i, i) = bound(i, i) + more;
        }
      }
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

  /// T A of (x, states of d), and in the last column T B with B multiplied by `scale`.
  static Matrix<S, inner + 1, inner + 1> inner_rates(const Settings& settings, const S& time,
                                                     const S& scale) noexcept {
    const auto& plant = settings.plant;
    auto a = Matrix<S, inner + 1, inner + 1>::Zero();
    for (int i = 0; i < States; ++i) {
      for (int j = 0; j < States; ++j) a(i, j) = plant.a(i, j) * time;
      const S e = plant.e(i) * time;
      a(i, States) = e;
      for (int j = 0; j < Parts.resonators; ++j) a(i, sinusoids + 2 * j) = e;
      for (int j = 0; j < Parts.first_order; ++j) a(i, sinusoids + 2 * Parts.resonators + j) = e;
      a(i, inner) = plant.b(i) * scale * time;
    }
    for (int i = States; i + 1 < sinusoids; ++i) a(i, i + 1) = time;
    detail::set_sinusoid_rates(a, sinusoids, settings.resonators, settings.first_order, time);
    return a;
  }

  /// The rows of the model's states over (x, states of d): T^r / r! y^(r) up to D, then the
  /// elements of x that are least dependent on them, then the states of d.
  [[nodiscard]] Square rows_of(const Matrix<S, inner + 1, inner + 1>& natural) const noexcept {
    Square rows = Square::Zero();
    for (int j = 0; j < States; ++j) rows(0, j) = rest_.settings.plant.c(j);
    for (int r = 1; r <= n; ++r) {
      for (int j = 0; j < inner; ++j) {
        S sum(0);
        for (int k = 0; k < inner; ++k) sum = sum + rows(r - 1, k) * natural(k, j);
        rows(r, j) = sum / static_cast<S>(r);
      }
    }
    int row = n + 1;
    if constexpr (Shape::replaced == 0) {
      Array<bool, States> taken{};
      Square work = rows;
      for (int r = 0; r <= n; ++r) {
        int pivot = 0;
        for (int j = 0; j < States; ++j) {
          if (detail::absolute(work(r, j)) > detail::absolute(work(r, pivot))) pivot = j;
        }
        taken[static_cast<std::size_t>(pivot)] = true;
        for (int i = r + 1; i <= n; ++i) {
          const S factor = work(i, pivot) / work(r, pivot);
          for (int j = 0; j < States; ++j) work(i, j) = work(i, j) - factor * work(r, j);
        }
      }
      const S unit = this->scaled_disturbance(S(1));
      for (int j = 0; j < States; ++j) {
        // If the rows are dependent, there are fewer pivots than rows: the matrix has no inverse,
        // and make fails.
        if (!taken[static_cast<std::size_t>(j)] && row < States) rows(row++, j) = unit;
      }
    }
    for (row = States + Shape::replaced; row < inner; ++row) {
      rows(row, row) = S(1);
      for (int j = 1; j <= Base::degree(lf + row); ++j) {
        rows(row, row) = rows(row, row) * (this->sample_time_ / static_cast<S>(j));
      }
    }
    return rows;
  }

  /// A matrix m that acts on (x, states of d) as one that acts on the scaled states without the
  /// sensor's: X = rows m rows^-1, solved from rows' X' = (rows m)'.
  template <int Size>
  static Matrix<S, Size, Size> in_rows(Matrix<S, Size, Size> rows,
                                       const Matrix<S, Size, Size>& m) noexcept {
    Matrix<S, Size, Size> right = (rows * m).transpose();
    rows = rows.transpose();
    detail::solve_in_place(detail::DenseView<S>{rows.data(), Size},
                           detail::DenseView<S>{right.data(), Size, Size});
    return right.transpose();
  }

  LinearPlantModel(const Settings& settings, const S& input_gain, const S& sample_time) noexcept
      : Base(input_gain, sample_time), rest_{settings} {
    const auto& plant = settings.plant;
    const S scale = input_gain / plant.input_gain();
    const auto natural = inner_rates(settings, sample_time, scale);
    const Square rows = rows_of(natural);
    this->scaled_input_gain_ = this->scaled_disturbance(input_gain);

    // The step of (f, x, states of d, u), which is then converted to rows.
    auto all = Matrix<S, size + 1, size + 1>::Zero();
    for (int i = 0; i <= inner; ++i) {
      for (int j = 0; j <= inner; ++j) all(lf + i, lf + j) = natural(i, j);
    }
    if constexpr (lf > 0) {
      auto sensor = Matrix<S, lf + 1, lf + 1>::Zero();
      detail::set_sensor_rates(sensor, settings.sensor, sample_time);
      for (int i = 0; i < lf; ++i) {
        for (int j = 0; j < lf; ++j) all(i, j) = sensor(i, j);
        for (int j = 0; j < States; ++j) all(i, lf + j) = sensor(i, lf) * plant.c(j);
      }
    }
    all = detail::exp_minus_identity(all);
    auto every = Matrix<S, size, size>::Identity();
    for (int i = 0; i < inner; ++i) {
      for (int j = 0; j < inner; ++j) every(lf + i, lf + j) = rows(i, j);
    }
    Matrix<S, size, size> step;
    Matrix<S, size, 1> input;
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) step(i, j) = all(i, j);
      input(i) = all(i, size);
    }
    step = in_rows(every, step);
    input = every * input;
    for (int i = 0; i < size; ++i) {
      for (int j = 0; j < size; ++j) all(i, j) = step(i, j);
      all(i, size) = input(i) / this->scaled_input_gain_;
    }
    this->set_step(all);

    for (int i = 0; i < inner; ++i) {
      for (int k = States; k < inner; ++k) rest_.of_disturbance(i, k - States) = rows(i, k);
    }
    rest_.natural = Square::Identity();
    Square eliminated = rows;
    detail::solve_in_place(detail::DenseView<S>{eliminated.data(), inner},
                           detail::DenseView<S>{rest_.natural.data(), inner, inner});

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
      x.fill(S(0));
      for (int i = 0; i < inner; ++i) {
        S sum(0);
        for (int j = 0; j <= States; ++j) sum = sum + rows(i, j) * given(j, which);
        x[static_cast<std::size_t>(lf + i)] = sum;
      }
      if constexpr (lf > 0) x[0] = S(which == 0 ? 1 : 0);
      (which == 0 ? rest_.rest_of_y : rest_.rest_of_u) = this->physical(x);
    }
    // D is what u has to balance and all derivatives are zero. Set exactly, without the rounding
    // error of the equations.
    for (int r = 0; r <= n; ++r) {
      rest_.rest_of_y(r) = S(r == 0 ? 1 : 0);
      rest_.rest_of_u(r) = r == n ? S(-input_gain) : S(0);
    }
  }

  /// (x, states of d) of an estimate.
  [[nodiscard]] Vector<S, inner> natural_of(const Estimate& z) const noexcept {
    const State x = this->scaled(z);
    Vector<S, inner> state;
    for (int i = 0; i < inner; ++i) state(i) = x[static_cast<std::size_t>(lf + i)];
    return rest_.natural * state;
  }

  /// Smallest pivot of the rows C A^i, each normalised: 0 if a state is unobservable from y.
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

  struct {
    Settings settings;
    Square natural{};  ///< from the scaled states to (x, states of d)
    Matrix<S, inner, inner - States> of_disturbance{};  ///< from the states of d to the model's
    Estimate rest_of_y{};
    Estimate rest_of_u{};
  } rest_;
};

/// Distinguishes the type in snapshots.
template <int States, ModelParts Parts, Scalar S>
inline constexpr std::uint32_t type_tag<LinearPlantModel<States, Parts, S>> =
    make_type_tag<S>("LinearPlantModel", States, Parts.order, Parts.sensor, Parts.constants,
                     Parts.resonators, Parts.first_order);

}  // namespace esokit
