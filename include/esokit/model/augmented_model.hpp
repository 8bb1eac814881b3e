/// @file
/// AugmentedModel: a model put together from known parts of plant, actuator, sensor and
/// disturbances.
#pragma once

#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/model/detail/observable_part.hpp>
#include <esokit/model/detail/parts_layout.hpp>
#include <esokit/model/matrix_model.hpp>
#include <esokit/model/model_parts.hpp>
#include <esokit/model/sampled_model.hpp>
#include <limits>

namespace esokit {

/// Plant, actuator, sensor and disturbance as one model, sampled exactly:
///
///     plant      y^(n) = -a_(n-1) y^(n-1) - .. - a_0 y + d + b0 v
///     actuator   v follows u with a lag
///     sensor     the measured value follows y by a lag
///     d          a constant (or polynomial), sines, and parts that decay exponentially
///
/// With an actuator, model and law have the order of plant and actuator together. A lag of first
/// order gives y^(n+1) = D + b u with b = b0 / tau, one of second order y^(n+2) = D + b u with b =
/// b0 w^2. `estimate` is (y, .., y^(order-1), D, ..), where D is everything that a law cancels, so
/// that any law works with it and omega_c keeps its meaning. After D come d', .. if there is more
/// than one integrator, each sine q followed by q' / w, the first-order disturbances, and with a
/// sensor the measured value (for order 2 also its derivative / w).
///
/// Poles: the actuator is simulated from u alone and never corrected, so it keeps its own. A sensor
/// that is faster than omega_o also keeps its own, those of a sine go to -s +- j w0, all others to
/// exp(-omega_o T).
template <ModelParts Parts, Scalar S = double>
class AugmentedModel : public MatrixModel<detail::PartsShape<Parts>, S> {
  using Base = MatrixModel<detail::PartsShape<Parts>, S>;
  using Base::couples;
  using Base::input_gain_;
  using Base::rate_;
  using Base::sample_time_;
  using Base::scaled_input_gain_;
  static constexpr int n = Parts.order;
  static constexpr int la = Parts.actuator;
  static constexpr int lf = Parts.sensor;
  static constexpr int m = Parts.constants;
  static_assert(n >= 1, "esokit: the plant order must be at least 1");
  static_assert(m >= 1, "esokit: at least one extended state is needed");
  static_assert(la >= 0 && la <= 2 && lf >= 0 && lf <= 2, "esokit: a lag has order 0, 1 or 2");
  static_assert(Parts.resonators >= 0 && Parts.first_order >= 0,
                "esokit: the number of parts must not be negative");
  static_assert(Parts.states == 0, "esokit: a whole plant needs model/plant_model.hpp");

 public:
  static constexpr ModelParts parts = Parts;  ///< what is known
  using Base::degree;
  using Base::extension;
  using Base::order;
  using Base::size;
  using typename Base::Estimate;
  using typename Base::State;

  /// What the model declares.
  static constexpr ModelTraits traits{
      .shifts_output = true,
      .adds_levels = !Parts.plant_poles && lf == 0 && la == 0,
      .tells_disturbance = true,
      .corrects_part = true,
      .tells_constant = m == 1 && Parts.first_order == 0 && !Parts.follows_speed,
      .follows_speed = Parts.follows_speed,
  };

  /// The same with another scalar. A model that follows a speed branches on it: it is not recorded,
  /// and its packs go lane by lane.
  template <Scalar T>
  requires(!Parts.follows_speed || PlainScalar<T>) using with_scalar = AugmentedModel<Parts, T>;

  using Settings = PartsSettings<Parts, S>;  ///< settings of make

  /// Checks the settings and samples the model.
  /// @param settings numbers of the parts @param input_gain b0, unit of y^(n) per unit of v
  /// @param sample_time T, s; both already checked
  /// @return the model, or an error that names the field
  static Expected<AugmentedModel, Error<S>> make(const Settings& settings, const S& input_gain,
                                                 const S& sample_time) {
    Rules<S> rules;
    rules.all_of(detail::check_parts(settings, sample_time));
    if (!rules) return rules.error();
    const AugmentedModel model(settings, input_gain, sample_time);
    for (const S& gain : {model.scaled_input_gain_, model.input_gain_}) {
      rules.representable("input_gain", input_gain, gain,
                          "with this model gives a gain that the scalar cannot hold");
    }
    for (const S& x : model.step_) {
      rules.demand(is_finite(x), "model", x, "gives a transition that the scalar cannot hold");
    }
    if (!rules) return rules.error();
    return model;
  }

  /// b0 of the plant, without the lag: unit of y^(n) per unit of v.
  [[nodiscard]] constexpr S plant_gain() const noexcept {
    S gain = input_gain_ / detail::scaled_lag(rest_.settings.actuator, sample_time_)[0];
    for (int i = 0; i < la; ++i) gain = gain * sample_time_;
    return gain;
  }

  /// The settings, as they were given.
  [[nodiscard]] constexpr const Settings& settings() const noexcept { return rest_.settings; }

  /// The estimate for a plant at rest at y under a constant u.
  [[nodiscard]] constexpr Estimate equilibrium(const S& y, const S& u) const noexcept {
    Estimate z = Estimate::Zero();
    z(0) = y;
    z(order) = -(input_gain_ * u);
    z(Base::measured_row) = y;
    return z;
  }

  /// The part of a correction that belongs to the disturbance (and to the actuator, if that is
  /// corrected): without y .. y^(n-1), and without what these contribute to the rows behind them
  /// through the plant's poles.
  [[nodiscard]] ESOKIT_INLINE constexpr State disturbance_part(const State& x) const noexcept {
    State part = x;
    detail::unroll<lf + n>([&](auto r) ESOKIT_INLINE_LAMBDA { std::get<r>(part) = S(0); });
    if constexpr (Parts.plant_poles) {
      Array<S, n> poles{};  // T^(n-i) a_i
      S power = sample_time_;
      detail::unroll<n>([&](auto i) ESOKIT_INLINE_LAMBDA {
        std::get<n - 1 - i>(poles) = std::get<n - 1 - i>(rest_.settings.plant) * power;
        power = power * sample_time_;
      });
      // y^(n) = -sum a_i y^(i) and its derivatives, as rows over y .. y^(n-1).
      Array<S, n> row{};
      std::get<n - 1>(row) = S(1);
      detail::unroll<la + 1>([&](auto k) ESOKIT_INLINE_LAMBDA {
        const S last = std::get<n - 1>(row);
        S& of_plant = std::get<lf + n + k>(part);
        Array<S, n> next{};
        detail::unroll<n>([&](auto i) ESOKIT_INLINE_LAMBDA {
          S& weight = std::get<i>(next);
          weight = -(last * std::get<i>(poles));
          if constexpr (i > 0) weight = weight + std::get<i - 1>(row);
          const S ratio(detail::factorial_ratio<LaneScalar<S>>(i, n + k));
          of_plant = of_plant - weight * ratio * std::get<lf + i>(x);
        });
        row = next;
      });
    }
    return part;
  }

  /// The present factor of the frequencies.
  [[nodiscard]] constexpr const S& speed() const noexcept requires(Parts.follows_speed) {
    return rest_.speed;
  }

  /// The same with all frequencies of the resonators multiplied by `factor`. Exact; it costs a
  /// matrix exponential, about 16 products of N x N.
  [[nodiscard]] AugmentedModel at_speed(const S& factor) const noexcept {
    AugmentedModel other = *this;
    other.rest_.speed = factor;
    other.sample();
    return other;
  }

  /// @name The parts of an estimate
  /// @{
  using Phasor = esokit::Phasor<S>;  ///< a sine by amplitude and phase
  /// d, the sum of all its parts, unit of y^(n).
  [[nodiscard]] S disturbance(const Estimate& z) const noexcept {
    S sum = constant(z);
    for (int i = 0; i < Parts.resonators; ++i) sum = sum + z(order + m + 2 * i);
    for (int i = 0; i < Parts.first_order; ++i) sum = sum + z(order + m + 2 * Parts.resonators + i);
    return sum;
  }
  /// b0 v with the output v of the actuator, simulated from u; unit of y^(n).
  [[nodiscard]] S delivered(const Estimate& z) const noexcept requires(Parts.actuator > 0) {
    S sum = z(n) - disturbance(z);
    int row = 0;
    for (const S& a : rest_.settings.plant) sum = sum + a * z(row++);
    return sum;
  }
  /// The constant part of d, unit of y^(n): D without the plant, the actuator and the other parts.
  [[nodiscard]] S constant(const Estimate& z) const noexcept {
    S sum = detail::column(constant_row()).dot(detail::column(this->scaled(z)));
    for (int j = n; j > 0; --j) sum = sum * (static_cast<S>(j) * rate_);
    return sum;
  }
  /// @}

  /// @name The constant of the disturbance among the states
  /// The natural states are y .. y^(n-1), the parts of d, and the actuator's output b0 v.
  /// @{
  /// The row by which the states x give the constant part of d times T^n / n!. Predictions do not
  /// change it (m = 1).
  [[nodiscard]] State constant_row() const noexcept {
    const auto lag = detail::scaled_lag(rest_.settings.actuator, sample_time_);
    const auto alpha = denominator(rest_.settings, sample_time_);
    // act(s) d = D + sum_i alpha_i y^(i), in units of T^n / n!.
    State row = others_filtered(present(), sample_time_, 0);
    for (S& weight : row) weight = -weight;
    for (int i = 0; i <= order; ++i) {
      row[static_cast<std::size_t>(lf + i)] =
          alpha[static_cast<std::size_t>(i)] * detail::factorial_ratio<S>(i, n);
    }
    for (S& weight : row) weight = weight / lag[0];
    return row;
  }
  /// The change of the states x per unit of this constant, with all other natural states kept.
  [[nodiscard]] State constant_column() const noexcept {
    return detail::elements(corrected_part<without(true, false)>().whole.col(lf + n));
  }
  /// The rows by which the states x give the contribution of the actuator's output to the states
  /// y^(n) .. D.
  [[nodiscard]] Matrix<S, la + 1, size> actuator_rows() const noexcept {
    const auto part = corrected_part<without(true, false)>();
    constexpr int part_size = size - la;
    constexpr int acted_on =
        lf + n;  // of the part: the state of what acts on y^(n) besides the actuator
    // The states of the part are those of the model, except this one, which follows from the
    // constant.
    auto natural = Matrix<S, part_size, size>::Zero();
    const auto row = detail::column(constant_row());
    detail::set_block(natural, acted_on, 0, row.transpose());
    for (int k = 0; k < part_size; ++k) {
      if (k == acted_on) continue;
      const int state = part.states[static_cast<std::size_t>(k)];
      natural(k, state) = S(1);
      natural(acted_on, state) = natural(acted_on, state) - row.dot(part.whole.col(k));
    }
    Matrix<S, la + 1, size> rows;
    for (int i = 0; i <= la; ++i) {
      for (int j = 0; j < size; ++j) {
        S sum(j == acted_on + i ? 1 : 0);
        for (int k = 0; k < part_size; ++k) sum = sum - part.whole(acted_on + i, k) * natural(k, j);
        rows(i, j) = sum;
      }
    }
    return rows;
  }
  /// T^n / n! d. @param d unit of y^(n)
  [[nodiscard]] constexpr S scaled_constant(const S& d) const noexcept {
    return this->of_degree(n, d);
  }
  /// b0 v under which the plant would stand still at its present y with the present d; unit of
  /// y^(n).
  [[nodiscard]] S holding_input(const Estimate& z) const noexcept {
    S sum = -disturbance(z);
    if constexpr (Parts.plant_poles) sum = sum + rest_.settings.plant[0] * z(0);
    return sum;
  }
  /// @}

  /// Returns `design(part)`, called with the CorrectedPart.
  /// @param bandwidth omega_o, rad/s: a sensor that is faster keeps its own poles
  template <class Design>
  auto with_corrected_part(const S& bandwidth, const Design& design) const {
    if constexpr (lf > 0) {
      if (detail::sensor_rate(rest_.settings.sensor) > bandwidth) {
        return design(corrected_part<without(true, true)>());
      }
    }
    return design(corrected_part<without(true, false)>());
  }

 private:
  template <ModelParts Other, Scalar T>
  friend class AugmentedModel;
  friend struct detail::LaneAccess;

  static constexpr ModelParts without(bool actuator, bool sensor) noexcept {
    ModelParts less = Parts;
    if (actuator) less.actuator = 0;
    if (sensor) less.sensor = 0;
    return less;
  }

  // ---- The rates, in units of T and of the scaled states.

  static constexpr S number(int i) noexcept { return static_cast<S>(i); }

  /// T^(order-i) alpha_i of plant times actuator, s^order + sum_i alpha_i s^i.
  static Array<S, order + 1> denominator(const Settings& settings, const S& time) noexcept {
    Array<S, order + 1> alpha{};
    const auto lag = detail::scaled_lag(settings.actuator, time);
    for (std::size_t j = 0; j < lag.size(); ++j) alpha[n + j] = lag[j];
    S power = time;
    for (std::size_t i = settings.plant.size(); i-- > 0;) {
      const S a = settings.plant[i] * power;
      for (std::size_t j = 0; j < lag.size(); ++j) alpha[i + j] = alpha[i + j] + a * lag[j];
      power = power * time;
    }
    return alpha;
  }

  /// act(s) s^derivative applied to d without its constant, as a row over the states, in units of
  /// T^n / n!; act is the actuator's denominator.
  static State others_filtered(const Settings& settings, const S& time, int derivative) noexcept {
    constexpr int parts_of_d = extension - lf;
    auto rates = Matrix<S, parts_of_d, parts_of_d>::Zero();
    for (int i = 0; i + 1 < m; ++i) rates(i, i + 1) = number(n + i + 1);
    detail::set_sinusoid_rates(rates, m, settings.resonators, settings.first_order, time);
    auto row = RowVector<S, parts_of_d>::Zero();  // d and its derivatives
    row(0) = S(1);
    for (int c = 0; c < Parts.resonators; ++c) row(m + 2 * c) = S(1);
    for (int c = m + 2 * Parts.resonators; c < parts_of_d; ++c) row(c) = S(1);
    const auto lag = detail::scaled_lag(settings.actuator, time);
    auto sum = RowVector<S, parts_of_d>::Zero();
    for (int i = 0; i <= la + derivative; ++i) {
      if (i >= derivative) sum += row * lag[static_cast<std::size_t>(i - derivative)];
      row = row * rates;
    }
    State all{};
    for (int j = 1; j < parts_of_d; ++j) all[static_cast<std::size_t>(lf + order + j)] = sum(j);
    return all;
  }

  /// T A, and in the last column T B for a u in units in which b T^order / order! is one.
  static Matrix<S, size + 1, size + 1> rates(const Settings& settings, const S& time) noexcept {
    auto a = Matrix<S, size + 1, size + 1>::Zero();
    detail::set_sensor_rates(a, settings.sensor, time);
    const int d = lf + order;
    for (int r = 0; r < order; ++r) a(lf + r, lf + r + 1) = number(r + 1);
    a(d - 1, size) = number(order);
    const auto alpha = denominator(settings, time);
    for (int i = 0; i < order; ++i) {
      a(d, lf + i + 1) =
          -alpha[static_cast<std::size_t>(i)] * detail::factorial_ratio<S>(i + 1, order);
    }
    a(d, size) = -alpha[order - 1];
    const State others = others_filtered(settings, time, 1);
    for (int j = d + 1; j < size; ++j)
      a(d, j) = others[static_cast<std::size_t>(j)] * detail::factorial_ratio<S>(n, order);
    for (int i = 1; i + 1 < m; ++i) a(d + i, d + i + 1) = number(n + i + 1);
    detail::set_sinusoid_rates(a, d + m, settings.resonators, settings.first_order, time);
    return a;
  }

  // ---- What is corrected.

  template <ModelParts Less>
  auto corrected_part() const {
    using Part = AugmentedModel<Less, S>;
    constexpr int part_size = Part::size;
    constexpr int part_lf = Part::lf;
    constexpr int part_d = part_lf + n;
    typename Part::Settings less{};
    less.plant = rest_.settings.plant;
    if constexpr (part_lf > 0) less.sensor = rest_.settings.sensor;
    less.resonators = present().resonators;
    less.first_order = rest_.settings.first_order;
    const auto rates = detail::block<part_size, part_size>(Part::rates(less, sample_time_), 0, 0);

    CorrectedPart<part_size, size, Parts.resonators, S> part;
    part.step = detail::exp_minus_identity(rates);
    for (int i = 0; i < part_size; ++i) {
      part.degrees[static_cast<std::size_t>(i)] = Part::degree(i);
      part.states[static_cast<std::size_t>(i)] = i < part_lf   ? i
                                                 : i <= part_d ? lf + i - part_lf
                                                               : lf + order + i - part_d;
    }
    part.output.fill(S(0));
    part.whole = Matrix<S, size, part_size>::Zero();
    // The actuator's error is zero and stays zero, so u and v drop out of y^(n), y^(n+1), ..
    RowVector<S, part_size> derivative = RowVector<S, part_size>::Zero();
    derivative(part_d) = S(1);
    for (int r = 0; r < n; ++r) part.whole(lf + r, part_lf + r) = S(1);
    for (int r = n; r <= order; ++r) {
      detail::set_block(part.whole, lf + r, 0, derivative);
      derivative = derivative * rates / number(r + 1);
    }
    for (int i = 1; i < extension - lf; ++i) part.whole(lf + order + i, part_d + i) = S(1);
    if constexpr (part_lf == lf) {
      part.output[0] = S(1);
      for (int i = 0; i < lf; ++i) part.whole(i, i) = S(1);
    } else {
      // The sensor's error follows from the errors of the other states.
      part.set_shown(detail::shown_by_sensor(rest_.settings.sensor, sample_time_, rates));
    }
    part.pairs = detail::own_pairs(less.resonators);
    return part;
  }

  AugmentedModel(const Settings& settings, const S& input_gain, const S& sample_time) noexcept
      : Base(input_gain, sample_time), rest_{settings} {
    const auto lag = detail::scaled_lag(settings.actuator, sample_time);
    input_gain_ = input_gain_ * lag[0];
    for (int i = 0; i < la; ++i) input_gain_ = input_gain_ * rate_;
    scaled_input_gain_ = input_gain * lag[0];
    for (int j = 1; j <= order; ++j) {
      scaled_input_gain_ = scaled_input_gain_ * (j <= n ? sample_time : S(1)) / number(j);
    }
    sample();
  }

  /// The settings with the present frequencies.
  [[nodiscard]] Settings present() const noexcept {
    Settings now = rest_.settings;
    for (auto& resonance : now.resonators) resonance.frequency = resonance.frequency * rest_.speed;
    return now;
  }

  void sample() noexcept {
    const auto all = detail::exp_minus_identity(rates(present(), sample_time_));
    this->set_step(all);
  }

  struct Rest {
    static constexpr int data_members = 2;
    Settings settings;
    S speed{1};  ///< factor of the frequencies
  } rest_;
};

/// Distinguishes the type in snapshots.
template <ModelParts Parts, Scalar S>
inline constexpr std::uint32_t type_tag<AugmentedModel<Parts, S>> = make_type_tag<S>(
    "AugmentedModel", Parts.order, Parts.plant_poles, Parts.actuator, Parts.sensor, Parts.constants,
    Parts.resonators, Parts.first_order, Parts.follows_speed, Parts.states);

}  // namespace esokit
