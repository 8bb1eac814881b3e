/// @file
/// MimoExtendedStateFilter: the extended state filter of several chains that share inputs and
/// measurement noise.
#pragma once

#include <cmath>
#include <esokit/gain/covariance_factor.hpp>
#include <esokit/gain/noise_settings.hpp>
#include <esokit/gain/riccati.hpp>
#include <esokit/gain/riccati_gain.hpp>
#include <esokit/gain/step_status.hpp>
#include <optional>

namespace esokit {

/// The orders n_1 .. n_p of the chains.
template <int... Orders>
struct ChainOrders {
  static_assert(sizeof...(Orders) >= 1, "esokit: at least one chain is needed");
  static_assert(((Orders >= 1) && ...), "esokit: the order of a chain must be at least 1");
  static constexpr int count = static_cast<int>(sizeof...(Orders));  ///< p
  static constexpr int sum = (Orders + ...);                         ///< n_1 + .. + n_p
  static constexpr Array<int, count> values{Orders...};              ///< n_1 .. n_p
};

/// Config of MimoExtendedStateFilter.
template <class Orders, int Inputs, Scalar S, int Extension>
struct MimoExtendedStateFilterConfig {
  static constexpr int outputs = Orders::count;                   ///< p
  static constexpr int size = Orders::sum + outputs * Extension;  ///< N
  using Covariance = Matrix<S, size, size>;                       ///< N x N
  using OutputCovariance = Matrix<S, outputs, outputs>;           ///< p x p

  Matrix<S, outputs, Inputs> input_matrix = Matrix<S, outputs, Inputs>::Zero();  ///< B0, p x q
  S sample_time{};                                                               ///< T, s
  OutputCovariance measurement_covariance = OutputCovariance::Zero();  ///< R, p x p, semidefinite
  Array<S, size> disturbance_bounds{};                 ///< q_r per state, as in ExtendedStateFilter
  S bound_factor{static_cast<double>(size)};           ///< c
  std::optional<Covariance> process_covariance{};      ///< Q, N x N, replaces the bounds
  Covariance initial_covariance = Covariance::Zero();  ///< P0, N x N, positive semidefinite
  InflationRule inflation_rule = InflationRule::fixed;  ///< fixed or none
  S inflation{};                                        ///< theta > 0 of the fixed rule
  RiccatiMode mode = RiccatiMode::recursive;            ///< recursive or frozen
  bool allow_vanishing_gain = false;                    ///< see ExtendedStateFilter
  int max_gap = 100;  ///< missing samples of a channel in a row that a correction may bridge,
                      ///< 1 .. 65000; after more its chain restarts from the measurement
};

/// Extended state filter of p plants y_i^(n_i) = d_i + sum_j B0_ij u_j, sampled exactly. Couplings
/// between the plants other than B0 are part of d_i. The noises of the measurements may be
/// correlated (full R), and Q and P0 may couple the chains; if all three are block diagonal, this
/// is p independent filters.
///
/// If a measurement is missing (NaN or infinite) or would make an
/// estimate infinite, its channel is left out of the sample; the others are used. After more than
/// `max_gap` missing measurements in a row, or if it could not be predicted, a chain restarts from
/// its next y.
///
/// State order: chain by chain, (y_i, .., y_i^(n_i - 1), d_i, .., d_i^(m-1)).
///
/// @tparam Orders ChainOrders<n_1, .., n_p> @tparam Inputs q, number of inputs
/// @tparam S scalar @tparam Extension m, the same for all chains
template <class Orders, int Inputs, Scalar S = double, int Extension = 1>
class MimoExtendedStateFilter {
 public:
  static constexpr int outputs = Orders::count;                   ///< p
  static constexpr int inputs = Inputs;                           ///< q
  static constexpr int size = Orders::sum + outputs * Extension;  ///< N
  static_assert(Inputs >= 1 && Extension >= 1 && size <= 32,
                "esokit: inputs, extension or size out of range");

  using scalar_type = S;                                 ///< type of states and settings
  using Estimate = Vector<S, size>;                      ///< all states, chain by chain, N x 1
  using Output = Vector<S, outputs>;                     ///< y, p x 1
  using Input = Vector<S, Inputs>;                       ///< u, q x 1
  using Covariance = Matrix<S, size, size>;              ///< N x N, in the units of the estimates
  using OutputCovariance = Matrix<S, outputs, outputs>;  ///< p x p, in the units of y
  using Gain = Matrix<S, size, outputs>;                 ///< N x p, physical units

  using Config = MimoExtendedStateFilterConfig<Orders, Inputs, S, Extension>;  ///< settings of make

  /// Checks the settings and does all the design work.
  /// @return the filter at rest in zero, or an error that names the field
  static Expected<MimoExtendedStateFilter, Error<S>> make(const Config& config) {
    Rules<S> rules;
    Covariance noise = config.process_covariance.value_or(Covariance::Zero());
    rules.all_of(check(config)).all_of(detail::add_bounds(config, noise));
    if (!rules) return rules.error();
    if (config.inflation_rule == InflationRule::fixed) {
      noise = noise * ((S(1) + config.inflation) / config.inflation);
    }
    MimoExtendedStateFilter filter(config, noise);
    const auto factored = [&](const char* field, const Covariance& p, Factor& factor) -> Check<S> {
      const auto made = detail::factored<size, S>(field, p, filter.root_units_.data(), not_held,
                                                  not_semidefinite, -1);
      if (!made) return made.error();
      factor = *made;
      return {};
    };
    rules.all_of(factored("initial_covariance", config.initial_covariance, filter.start_))
        .all_of(factored(detail::noise_field(config), noise, filter.noise_));
    const OutputCovariance measured = config.measurement_covariance / filter.unit_;
    for (int i = 0; i < outputs; ++i) {
      rules.require(!(measured(i, i) > S(0)) || detail::is_held(measured(i, i)),
                    "measurement_covariance", config.measurement_covariance(i, i), not_held,
                    i * outputs + i);
    }
    if (!rules) return rules.error();
    const auto measurement = CovarianceFactor<outputs, S>::from_matrix(measured);
    if (!measurement) {
      return Error<S>{"measurement_covariance", config.measurement_covariance(0, 0),
                      not_semidefinite};
    }
    filter.measurement_ = *measurement;
    if (auto ok = filter.check_way_back(config, noise); !ok) return ok.error();
    if (config.mode == RiccatiMode::frozen) {
      if (!filter.freeze(noise)) {
        return Error<S>{detail::noise_field(config), noise(size - 1, size - 1),
                        "gives no limit gain: without inflation the highest state of every chain "
                        "must be disturbed"};
      }
    }
    filter.restart();
    if (!filter.fits()) {
      return Error<S>{"inflation", config.inflation,
                      "lets the covariance grow beyond what the scalar can hold"};
    }
    return filter;
  }

  /// One sample: `predict(u_applied)`, then `correct(y)`.
  /// @param y p x 1, NaN for a missing element
  /// @param u_applied q x 1, what the actuators held since the last sample
  StepStatus update(const Output& y, const Input& u_applied) noexcept {
    const StepStatus predicted = predict(u_applied);
    return predicted | correct(y);
  }

  /// Time update only. A u with a bad element is replaced by the last good u. A chain that cannot
  /// be predicted keeps its state until its next good y restarts it.
  StepStatus predict(const Input& u_applied) noexcept {
    StepStatus status = StepStatus::ok;
    for (int& missed : missed_) missed = missed < restart_due ? missed + 1 : restart_due;
    Estimate next = ahead(u_applied);
    if (finite(next) || no_larger(u_applied)) {
      // u is no larger than the last one, so it is not the cause.
      input_ = u_applied;
    } else {
      status = StepStatus::input_rejected;
      next = ahead(input_);
    }
    for (int chain = 0; chain < outputs; ++chain) {
      if (finite(next, chain)) continue;
      status |= StepStatus::prediction_dropped;
      missed_[index(chain)] = restart_due;
      for (int r = first(chain); r < end(chain); ++r) next(r) = state_(r);
    }
    state_ = next;
    advance_covariance();
    return status;
  }

  /// Measurement update with all channels whose y is finite; `measurement_rejected` if any is not.
  StepStatus correct(const Output& y) noexcept {
    StepStatus status = StepStatus::ok;
    Array<bool, outputs> used{};
    used.fill(true);
    Output e = Output::Zero();
    for (int i = 0; i < outputs; ++i) {
      e(i) = y(i) - state_(first(i));
      const bool due = missed_[index(i)] > max_gap_ + 1;
      if (is_finite(e(i)) && !due) continue;
      used[index(i)] = false;
      e(i) = S(0);
      status |= due ? restart_chain(i, y(i)) : StepStatus::measurement_rejected;
    }
    // If the estimate would not be finite, channels are left out, the one furthest from its
    // prediction first, until it is.
    bool changed = has(status, StepStatus::restarted);
    for (int left = outputs; left > 0; --left) {
      bool any_used = false;
      bool all_used = true;
      for (const bool channel : used) {
        any_used = any_used || channel;
        all_used = all_used && channel;
      }
      if (!any_used) break;
      if (!all_used) {
        standing_ = false;
        prepare(used);
        changed = true;
      }
      const Estimate next = state_ + gain_ * e;
      if (finite(next)) {
        state_ = next;
        innovation_ = e;
        corrected_ = true;
        for (int i = 0; i < outputs; ++i) {
          if (used[index(i)]) missed_[index(i)] = 0;
        }
        return status;
      }
      int worst = 0;
      for (int i = 1; i < outputs; ++i) {
        if (detail::absolute(e(i)) > detail::absolute(e(worst))) worst = i;
      }
      used[index(worst)] = false;
      e(worst) = S(0);
      // A finite but absurdly large u can lead to a prediction from which no good y recovers.
      const bool state_is_to_blame =
          detail::absolute(y(worst)) < detail::absolute(state_(first(worst)));
      status |=
          state_is_to_blame ? restart_chain(worst, y(worst)) : StepStatus::measurement_rejected;
      changed = true;
    }
    if (changed) prepare_all();
    return status;
  }

  /// Restarts at (y_i, 0, .., 0) with P0. A y that is not finite changes nothing.
  StepStatus reset(const Output& y) noexcept {
    Estimate state = Estimate::Zero();
    for (int i = 0; i < outputs; ++i) state(first(i)) = y(i);
    return reset(state);
  }

  /// Restarts at a given estimate, N x 1, physical units, with P0.
  StepStatus reset(const Estimate& state) noexcept {
    Estimate next;
    for (int r = 0; r < size; ++r) next(r) = state(r) * units_(r);
    if (!finite(next)) return StepStatus::state_rejected;
    state_ = next;
    innovation_ = Output::Zero();
    missed_.fill(0);
    restart();
    return StepStatus::ok;
  }

  /// Number of predictions since the last correction by a channel, 0 .. p - 1; 0 if it is up to
  /// date, 65535 if its chain could not be predicted.
  [[nodiscard]] int missed(int channel) const noexcept { return missed_[index(channel)]; }

  /// All estimates, N x 1, physical units.
  [[nodiscard]] Estimate estimate() const noexcept {
    Estimate z;
    for (int r = 0; r < size; ++r) z(r) = state_(r) / units_(r);
    return z;
  }

  /// Estimates of chain i, (n_i + m) x 1.
  template <int I>
  [[nodiscard]] auto chain_estimate() const noexcept {
    constexpr int length = Orders::values[I] + Extension;
    return estimate().template segment<length>(first(I));
  }

  /// d_1 .. d_p, unit of y_i^(n_i).
  [[nodiscard]] Output total_disturbance() const noexcept {
    const Estimate all = estimate();
    Output d;
    for (int i = 0; i < outputs; ++i) d(i) = all(first(i) + order_of(i));
    return d;
  }

  /// y - C z of the last correction; zero in channels that were not used.
  [[nodiscard]] const Output& innovation() const noexcept { return innovation_; }

  /// Covariance of the innovation, C P- C' + R of the last prediction, p x p. An element that
  /// overflows is given as the largest number of the scalar.
  [[nodiscard]] OutputCovariance innovation_covariance() const noexcept {
    OutputCovariance s = seen_covariance() * unit_;
    for (int i = 0; i < s.size(); ++i) s.data()[i] = detail::clipped(s.data()[i]);
    return s;
  }

  /// Normalised innovation squared, e' (C P- C' + R)^-1 e of the last correction: about p on
  /// average if R, Q and P0 are exact; on overflow the largest number of the scalar.
  [[nodiscard]] S normalised_innovation() const noexcept {
    const S largest = detail::largest_magnitude(innovation_);
    if (!(largest > S(0))) return S(0);
    const Output e = innovation_ / largest;
    const auto weighted = detail::solve_positive<outputs, 1, S>(seen_covariance(), e);
    return weighted ? detail::clipped(S(largest * (largest / unit_) * e.dot(*weighted))) : S(0);
  }

  /// Bound on the covariance of the error of the present estimate, N x N, physical units. An
  /// element that overflows is given as the largest number of the scalar.
  [[nodiscard]] Covariance covariance() const noexcept {
    Covariance p = factor_.matrix();
    if (corrected_) {
      // (I - K C) P- (I - K C)' + K R K' with R, not R / (1 + theta).
      Covariance rest = Covariance::Identity();
      for (int i = 0; i < outputs; ++i) {
        for (int r = 0; r < size; ++r) rest(r, first(i)) -= gain_(r, i);
      }
      // The gain is zero for channels that were left out.
      const auto spread = gain_ * used_measurement_.matrix();
      const auto noise = detail::plus_product_transposed<size, outputs, size, S>(
          Covariance::Zero(), spread, gain_, S(1));
      p = detail::plus_product_transposed<size, size, size, S>(noise, rest * p, rest, S(1));
    }
    p = detail::in_units(p, inverse(root_units_).data());
    for (int i = 0; i < p.size(); ++i) p.data()[i] = detail::clipped(p.data()[i]);
    return p;
  }

  /// Gain of the next correction (all channels present), N x p, physical units.
  [[nodiscard]] Gain gain() const noexcept {
    const Estimate rate = inverse(units_);
    Gain gain = gain_;
    for (int r = 0; r < size; ++r) {
      for (int i = 0; i < outputs; ++i) gain(r, i) = rate(r) * gain(r, i);
    }
    return gain;
  }

  /// True while the filter is in frozen mode and does not run the recursion.
  [[nodiscard]] bool frozen() const noexcept { return standing_; }

  /// T, s.
  [[nodiscard]] const S& sample_time() const noexcept { return sample_time_; }

 private:
  using Factor = CovarianceFactor<size, S>;
  using Transition = MatrixTransition<size, S>;

  static constexpr std::size_t index(int i) noexcept { return static_cast<std::size_t>(i); }
  static constexpr int order_of(int chain) noexcept { return Orders::values[index(chain)]; }

  /// Index of the first state of a chain.
  static constexpr int first(int chain) noexcept {
    int begin = 0;
    for (int i = 0; i < chain; ++i) begin += order_of(i) + Extension;
    return begin;
  }

  /// Index after its last state.
  static constexpr int end(int chain) noexcept {
    return first(chain) + order_of(chain) + Extension;
  }

  /// A gap longer than any max_gap.
  static constexpr int restart_due = 65535;

  /// @param noise Q, inflated
  MimoExtendedStateFilter(const Config& config, const Covariance& noise) noexcept
      : sample_time_(config.sample_time), max_gap_(config.max_gap) {
    for (int chain = 0; chain < outputs; ++chain) {
      S unit(1);
      for (int r = 0; r < order_of(chain) + Extension; ++r) {
        if (r > 0) unit = unit * sample_time_ / static_cast<S>(r);
        units_(first(chain) + r) = unit;
        // Scaled effect of the inputs, in the row of the disturbance.
        if (r != order_of(chain)) continue;
        for (int j = 0; j < Inputs; ++j) drive_(chain, j) = config.input_matrix(chain, j) * unit;
      }
    }
    if (config.inflation_rule == InflationRule::fixed) growth_ = S(1) + config.inflation;
    // The unit of all variances: the largest of R, or without noise the largest variance of the
    // config.
    S unit = config.measurement_covariance(0, 0);
    for (int i = 1; i < outputs; ++i) {
      unit = detail::larger(unit, config.measurement_covariance(i, i));
    }
    for (int i = 0; i < size && !(config.measurement_covariance.trace() > S(0)); ++i) {
      for (const S& variance : {noise(i, i), config.initial_covariance(i, i)}) {
        unit = detail::larger(unit, S((variance * units_(i)) * units_(i)));
      }
    }
    if (unit > S(0)) unit_ = unit;
    root_units_ = units_ / std::sqrt(unit_);
  }

  static constexpr const char* not_held =
      "in the scaling T^2r / r!^2 and divided by the largest R is a variance that the scalar "
      "cannot "
      "hold";
  static constexpr const char* not_semidefinite = "must be finite and positive semidefinite";

  /// For each chain as in ExtendedStateFilter, see FilterDesign.
  Check<S> check_way_back(const Config& config, const Covariance& noise) const {
    OutputCovariance exact = measurement_.matrix();
    for (int chain = 0; chain < outputs; ++chain) {
      bool driven = false;
      for (int r = first(chain); r < end(chain); ++r) driven = driven || noise(r, r) > S(0);
      if (!driven) continue;
      for (int j = 0; j < outputs; ++j) exact(chain, j) = exact(j, chain) = S(0);
      exact(chain, chain) = S(1);
    }
    if (!positive(exact)) {
      return Error<S>{"measurement_covariance", config.measurement_covariance(0, 0),
                      "must be positive definite if nothing disturbs the plants"};
    }
    const bool none = config.inflation_rule == InflationRule::none;
    for (int chain = 0; chain < outputs && !config.allow_vanishing_gain; ++chain) {
      const int last = end(chain) - 1;
      if (noise(last, last) > S(0)) continue;
      if (none) {
        return Error<S>{detail::noise_field(config), noise(last, last),
                        "must disturb the highest state of every chain: without inflation its gain "
                        "tends to zero (or set allow_vanishing_gain)",
                        config.process_covariance ? last * size + last : last};
      }
      const S& start = config.initial_covariance(last, last);
      if (config.mode != RiccatiMode::frozen && !(start > S(0))) {
        return Error<S>{"initial_covariance", start,
                        "must leave the highest state of a chain uncertain if nothing disturbs it: "
                        "it would never be corrected (or set allow_vanishing_gain)",
                        last * size + last};
      }
    }
    if (!none && config.inflation >= S(0.01)) return {};
    const Covariance q = noise_.matrix();
    Check<S> ok{};
    detail::unroll<outputs>([&](auto chain) {
      constexpr int length = Orders::values[chain] + Extension;
      Matrix<S, length, length> own;
      for (int i = 0; i < length; ++i) {
        for (int j = 0; j < length; ++j) own(i, j) = q(first(chain) + i, first(chain) + j);
      }
      const S least =
          least_measurement_variance<length, S>(CovarianceFactor<length, S>::nearest(own));
      const S& r = config.measurement_covariance(int{chain}, int{chain});
      if (!ok || r / unit_ >= least) return;
      ok = detail::alternating("measurement_covariance", r, int{chain} * outputs + int{chain},
                               S(least * unit_));
    });
    return ok;
  }

  /// C P- C' + R, divided by the unit.
  [[nodiscard]] OutputCovariance seen_covariance() const noexcept {
    const Covariance p = factor_.matrix();
    OutputCovariance s = measurement_.matrix();
    for (int i = 0; i < outputs; ++i) {
      for (int j = 0; j < outputs; ++j) s(i, j) += p(first(i), first(j));
    }
    return s;
  }

  static Estimate inverse(const Estimate& units) noexcept {
    Estimate result;
    for (int r = 0; r < size; ++r) result(r) = S(1) / units(r);
    return result;
  }

  /// True if the scaled states and the estimates in physical units are finite.
  [[nodiscard]] bool finite(const Estimate& x, int chain) const noexcept {
    S sum(0);
    for (int r = first(chain); r < end(chain); ++r) {
      const S size_of = detail::absolute(x(r));
      sum = sum + (size_of + size_of / units_(r));
    }
    return is_finite(sum);
  }

  [[nodiscard]] bool finite(const Estimate& x) const noexcept {
    for (int chain = 0; chain < outputs; ++chain) {
      if (!finite(x, chain)) return false;
    }
    return true;
  }

  [[nodiscard]] bool no_larger(const Input& u) const noexcept {
    for (int j = 0; j < Inputs; ++j) {
      if (!is_finite(u(j)) || detail::absolute(u(j)) > detail::absolute(input_(j))) return false;
    }
    return true;
  }

  /// True if the recursion stays within the range of the scalar.
  [[nodiscard]] bool fits() const {
    MimoExtendedStateFilter run = *this;
    for (int k = 0; k < 8 * size; ++k) {
      if (!detail::all_finite(run.gain_) || !detail::all_finite(run.factor_.matrix())) return false;
      run.corrected_ = true;
      run.advance_covariance();
    }
    return true;
  }

  /// Restarts chain i at (y_i, 0, .., 0) with its part of P0, or of the limit.
  StepStatus restart_chain(int chain, const S& y) noexcept {
    Estimate next = state_;
    for (int r = first(chain); r < end(chain); ++r) next(r) = S(0);
    next(first(chain)) = y;
    if (!finite(next, chain)) return StepStatus::measurement_rejected;
    state_ = next;
    missed_[index(chain)] = 0;
    Covariance p = factor_.matrix();
    const Covariance fresh = (has_limit_ ? limit_ : start_).matrix();
    for (int r = first(chain); r < end(chain); ++r) {
      for (int i = 0; i < size; ++i) {
        const bool own = i >= first(chain) && i < end(chain);
        p(r, i) = own ? fresh(r, i) : S(0);
        p(i, r) = p(r, i);
      }
    }
    factor_ = Factor::nearest(p);
    standing_ = false;
    if constexpr (outputs == 1) restart();
    return StepStatus::restarted;
  }

  static bool positive(const OutputCovariance& r) noexcept {
    return detail::solve_positive<outputs, 1, S>(r, Output::Zero()).has_value();
  }

  static Check<S> check(const Config& config) {
    Rules<S> rules;
    rules.positive("sample_time", config.sample_time)
        .invertible("sample_time", config.sample_time)
        .require(1 <= config.max_gap && config.max_gap <= 65000, "max_gap",
                 static_cast<S>(config.max_gap), "must be 1 .. 65000");
    for (int i = 0; i < outputs; ++i) {
      for (int j = 0; j < Inputs; ++j) {
        rules.finite("input_matrix", config.input_matrix(i, j), i * Inputs + j);
      }
      S unit(1);
      for (int r = 1; r < order_of(i) + Extension; ++r) {
        unit = unit * config.sample_time / static_cast<S>(r);
        rules.representable("sample_time", config.sample_time, unit,
                            "to the power of a chain's highest state, over its factorial, leaves "
                            "the scalar's range");
        for (int j = 0; r == order_of(i) && j < Inputs; ++j) {
          const S& gain = config.input_matrix(i, j);
          if (!(detail::absolute(gain) > S(0))) continue;
          rules.representable("input_matrix", gain, S(gain * unit),
                              "times T^n / n! gives a gain that the scalar cannot hold",
                              i * Inputs + j);
        }
      }
    }
    rules
        .require(detail::largest_magnitude(config.input_matrix) > S(0), "input_matrix", S(0),
                 "must not be zero")
        .require(config.inflation_rule != InflationRule::adaptive, "inflation_rule", S(0),
                 "must be fixed or none for several chains");
    rules.all_of(detail::check_inflation<S>(config))
        .require(config.mode != RiccatiMode::start_table, "mode", S(0),
                 "must be recursive or frozen for several chains");
    rules.all_of(
        detail::check_covariance("measurement_covariance", config.measurement_covariance, false));
    if (config.process_covariance) {
      rules.all_of(
          detail::check_covariance("process_covariance", *config.process_covariance, false));
    }
    return rules.all_of(
        detail::check_covariance("initial_covariance", config.initial_covariance, false));
  }

  /// Phi x + Gamma u: Pascal's triangle applied to each chain, as sums of neighbours.
  [[nodiscard]] Estimate ahead(const Input& u) const noexcept {
    Estimate x = state_;
    for (int chain = 0; chain < outputs; ++chain) {
      x(first(chain) + order_of(chain)) += S(drive_.row(chain) * u);
    }
    for (int chain = 0; chain < outputs; ++chain) {
      const int begin = first(chain);
      const int length = order_of(chain) + Extension;
      for (int pass = 0; pass + 1 < length; ++pass) {
        for (int r = length - 2; r >= pass; --r) x(begin + r) += x(begin + r + 1);
      }
      // u does not change the disturbance itself.
      x(begin + order_of(chain)) -= S(drive_.row(chain) * u);
    }
    return x;
  }

  [[nodiscard]] static Covariance transition() noexcept {
    Covariance phi = Covariance::Zero();
    for (int chain = 0; chain < outputs; ++chain) {
      for (int i = 0; i < order_of(chain) + Extension; ++i) {
        for (int j = i; j < order_of(chain) + Extension; ++j) {
          phi(first(chain) + i, first(chain) + j) =
              binomial_table<size, S>[static_cast<std::size_t>(j)][static_cast<std::size_t>(i)];
        }
      }
    }
    return phi;
  }

  void advance_covariance() noexcept {
    if (standing_) {
      if (corrected_ || fresh_) {
        corrected_ = false;
        fresh_ = false;
        return;
      }
      standing_ = false;
    }
    if (corrected_) factor_ = posterior_;
    corrected_ = false;
    fresh_ = false;
    // As in RiccatiGain: in a gap P- of a chain stops growing once an estimate depends on the next
    // measurement only.
    Transition step{transition(), {}};
    Covariance& phi = step.phi;
    Covariance held;  // Q of the chains that still grow
    bool any_held = false;
    for (int chain = 0; chain < outputs; ++chain) {
      if (missed_[index(chain)] < 3 || !tells_nothing(chain)) continue;
      if (!any_held) held = noise_.matrix();
      any_held = true;
      const S still = S(1) / std::sqrt(growth_);
      for (int r = first(chain); r < end(chain); ++r) {
        for (int j = first(chain); j < end(chain); ++j) phi(r, j) *= still;
        for (int j = 0; j < size; ++j) held(r, j) = held(j, r) = S(0);
      }
      // After max_gap the chain will restart, so its covariance no longer matters.
      if (missed_[index(chain)] > max_gap_ + 1) {
        for (int r = first(chain); r < end(chain); ++r) {
          for (int j = first(chain); j < end(chain); ++j) phi(r, j) = r == j ? phi(r, r) : S(0);
        }
      }
    }
    factor_.advance(growth_, any_held ? Factor::nearest(held) : noise_, step);
    prepare_all();
    if (has_limit_ && factor_.near(limit_, S(1e-3))) stand();
  }

  /// True if P- of the chain is so large in comparison with R that the estimate depends on the next
  /// measurement only.
  [[nodiscard]] bool tells_nothing(int chain) const noexcept {
    const Covariance p = factor_.matrix();
    const OutputCovariance r = measurement_.matrix();
    S variance(0);
    S noise(0);
    for (int i = first(chain); i < end(chain); ++i) variance = detail::larger(variance, p(i, i));
    for (int i = 0; i < outputs; ++i) noise = detail::larger(noise, r(i, i));
    return variance > noise / detail::rounding<S>();
  }

  void prepare_all() noexcept {
    Array<bool, outputs> used{};
    used.fill(true);
    prepare(used);
  }

  /// Computes gain and corrected covariance for a measurement with these channels, one after the
  /// other: with R = L D L' the rows of L^-1 y are measurements with independent noise of variances
  /// D.
  void prepare(const Array<bool, outputs>& used) noexcept {
    used_measurement_ = measurement_;
    bool all_used = true;
    for (const bool channel : used) all_used = all_used && channel;
    if (!all_used) {
      OutputCovariance r = measurement_.matrix();
      for (int i = 0; i < outputs; ++i) {
        if (used[index(i)]) continue;
        for (int j = 0; j < outputs; ++j) r(i, j) = r(j, i) = S(0);
      }
      used_measurement_ = CovarianceFactor<outputs, S>::nearest(r);
    }
    // L^-1, row by row.
    OutputCovariance apart = OutputCovariance::Identity();
    for (int i = 0; i < outputs; ++i) {
      for (int k = 0; k < i; ++k) {
        for (int j = 0; j <= k; ++j) apart(i, j) -= used_measurement_.lower(i, k) * apart(k, j);
      }
    }
    posterior_ = factor_;
    Gain gain = Gain::Zero();  // of L^-1 y
    for (int i = 0; i < outputs; ++i) {
      if (!used[index(i)]) continue;
      Array<S, size> output{};
      for (int j = 0; j <= i; ++j) output[index(first(j))] = apart(i, j);
      const auto k = posterior_.correct(output, S(used_measurement_.variance(i) / growth_));
      // Subtracts what the channels before have already explained.
      for (int j = 0; j < i; ++j) {
        S explained(0);
        for (int l = 0; l <= i; ++l) explained += apart(i, l) * gain(first(l), j);
        for (int r = 0; r < size; ++r) gain(r, j) -= k[index(r)] * explained;
      }
      for (int r = 0; r < size; ++r) gain(r, i) = k[index(r)];
    }
    gain_ = gain * apart;
  }

  bool freeze(const Covariance& noise) {
    RiccatiModel<size, outputs, S> model;
    model.transition = transition();
    model.noise = detail::in_units(noise, root_units_.data());
    model.measurement = measurement_.matrix() / growth_;
    model.inflation = growth_;
    Gain start = Gain::Zero();
    for (int chain = 0; chain < outputs; ++chain) {
      model.output(chain, first(chain)) = S(1);
      const int last = first(chain) + order_of(chain) + Extension - 1;
      if (!(growth_ > S(1)) && !(model.noise(last, last) > S(0))) return false;
    }
    // All poles at zero.
    detail::unroll<outputs>([&](auto chain) {
      constexpr int length = Orders::values[chain] + Extension;
      const auto k = current_gain<length, S>(EqualSampledPoles<length, S>{S(1)}.weights());
      for (int r = 0; r < length; ++r) start(first(chain) + r, int{chain}) = k[index(r)];
    });
    const auto covariance = riccati_covariance<size, outputs, S>(model, start);
    if (!covariance) return false;
    factor_ = Factor::nearest(*covariance);
    // The recursion is run at the end, as for a single chain, because it is more accurate.
    constexpr int most_steps = 2000;
    Gain last = Gain::Zero();
    for (int step = 0; step < most_steps; ++step) {
      prepare_all();
      if (!detail::all_finite(gain_)) return false;
      const S change = detail::largest_magnitude(gain_ - last);
      const bool done = !(change > S(2) * detail::rounding<S>() * detail::largest_magnitude(gain_));
      last = gain_;
      if (done && step > 3) break;
      factor_ = posterior_;
      factor_.advance_seldom(growth_, noise_, Transition{transition(), {}});
    }
    limit_ = factor_;
    has_limit_ = true;
    return true;
  }

  void stand() noexcept {
    factor_ = limit_;
    prepare_all();
    standing_ = true;
  }

  void restart() noexcept {
    corrected_ = false;
    fresh_ = has_limit_;
    if (has_limit_) {
      stand();
    } else {
      factor_ = start_;
      prepare_all();
    }
  }

  Estimate state_ = Estimate::Zero();  ///< scaled, x_r = T^r z_r / r! chain by chain
  Gain gain_ = Gain::Zero();           ///< of the next correction, scaled
  Factor factor_{};                    ///< of P-
  Factor posterior_{};                 ///< of P after the next correction
  Factor start_{};
  Factor noise_{};
  Factor limit_{};
  CovarianceFactor<outputs, S> measurement_{};
  CovarianceFactor<outputs, S> used_measurement_{};
  Matrix<S, outputs, Inputs> drive_;
  Estimate units_;       ///< T^r / r!
  Estimate root_units_;  ///< the same divided by the root of the unit of variances
  S unit_{1};            ///< unit of all variances, in unit of y squared
  Input input_ = Input::Zero();
  Output innovation_ = Output::Zero();
  S sample_time_;
  S growth_{1};  ///< 1 + theta
  int max_gap_;
  Array<int, outputs> missed_{};  ///< predictions since the last correction
  bool corrected_ = false;
  bool fresh_ = false;  ///< no step since a reset to the limit
  bool standing_ = false;
  bool has_limit_ = false;
};

}  // namespace esokit
