/// @file
/// MimoExtendedStateFilter: the extended state filter of several chains that share inputs and
/// measurement noise.
#pragma once

#include <cmath>
#include <esokit/core/step_status.hpp>
#include <esokit/gain/detail/covariance_factor.hpp>
#include <esokit/gain/detail/noise_settings.hpp>
#include <esokit/gain/mimo_filter_config.hpp>
#include <esokit/gain/mimo_riccati.hpp>

namespace esokit {

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
    rules.all_of(detail::check_filter(config)).all_of(detail::add_bounds(config, noise));
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
    rules.all_of(factored("initial_covariance", config.initial_covariance, filter.recursion_.start))
        .all_of(factored(detail::noise_field(config), noise, filter.recursion_.noise));
    const OutputCovariance measured = config.measurement_covariance / filter.unit_;
    for (int i = 0; i < outputs; ++i) {
      rules.demand(!(measured(i, i) > S(0)) || detail::is_held(measured(i, i)),
                   "measurement_covariance", config.measurement_covariance(i, i), not_held,
                   i * outputs + i);
    }
    if (!rules) return rules.error();
    const auto measurement = CovarianceFactor<outputs, S>::from_matrix(measured);
    if (!measurement) {
      return Error<S>{"measurement_covariance", config.measurement_covariance(0, 0),
                      not_semidefinite};
    }
    filter.recursion_.measurement = *measurement;
    if (auto ok = filter.check_way_back(config, noise); !ok) return ok.error();
    if (config.mode == RiccatiMode::frozen) {
      if (!filter.recursion_.freeze(noise, filter.root_units_)) {
        return Error<S>{detail::noise_field(config), noise(size - 1, size - 1),
                        "gives no limit gain: without inflation the highest state of every chain "
                        "must be disturbed"};
      }
    }
    filter.recursion_.restart();
    if (!filter.recursion_.fits()) {
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
    recursion_.advance(missed_, max_gap_);
    return status;
  }

  /// Measurement update with all channels whose y is finite; `measurement_rejected` if any is not.
  StepStatus correct(const Output& y) noexcept {
    StepStatus status = StepStatus::ok;
    Array<bool, outputs> used{};
    used.fill(true);
    Output e = Output::Zero();
    int left = outputs;
    for (int i = 0; i < outputs; ++i) {
      e(i) = y(i) - state_(first(i));
      const bool due = missed_[index(i)] > max_gap_ + 1;
      if (is_finite(e(i)) && !due) continue;
      used[index(i)] = false;
      --left;
      e(i) = S(0);
      status |= due ? restart_chain(i, y(i)) : StepStatus::measurement_rejected;
    }
    // If the estimate would not be finite, channels are left out, the one furthest from its
    // prediction first, until it is.
    bool changed = has(status, StepStatus::restarted);
    for (; left > 0; --left) {
      if (left < outputs) {
        recursion_.standing = false;
        recursion_.prepare(used);
        changed = true;
      }
      const Estimate next = state_ + recursion_.gain * e;
      if (finite(next)) {
        state_ = next;
        innovation_ = e;
        recursion_.corrected = true;
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
    if (changed) recursion_.prepare_all();
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
    recursion_.restart();
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
  template <int Index>
  [[nodiscard]] auto chain_estimate() const noexcept {
    constexpr int length = Orders::values[Index] + Extension;
    return estimate().template segment<length>(first(Index));
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
    OutputCovariance s = recursion_.seen_covariance() * unit_;
    for (int i = 0; i < s.size(); ++i) s.data()[i] = detail::clipped(s.data()[i]);
    return s;
  }

  /// Normalised innovation squared, e' (C P- C' + R)^-1 e of the last correction: about p on
  /// average if R, Q and P0 are exact; on overflow the largest number of the scalar.
  [[nodiscard]] S normalised_innovation() const noexcept {
    const S largest = detail::largest_magnitude(innovation_);
    if (!(largest > S(0))) return S(0);
    const Output e = innovation_ / largest;
    const auto weighted = detail::solve_positive<outputs, 1, S>(recursion_.seen_covariance(), e);
    return weighted ? detail::clipped(S(largest * (largest / unit_) * e.dot(*weighted))) : S(0);
  }

  /// Bound on the covariance of the error of the present estimate, N x N, physical units. An
  /// element that overflows is given as the largest number of the scalar.
  [[nodiscard]] Covariance covariance() const noexcept {
    Covariance p = detail::in_units(recursion_.covariance(), inverse(root_units_).data());
    for (int i = 0; i < p.size(); ++i) p.data()[i] = detail::clipped(p.data()[i]);
    return p;
  }

  /// Gain of the next correction (all channels present), N x p, physical units.
  [[nodiscard]] Gain gain() const noexcept {
    const Estimate rate = inverse(units_);
    Gain gain = recursion_.gain;
    for (int r = 0; r < size; ++r) {
      for (int i = 0; i < outputs; ++i) gain(r, i) = rate(r) * gain(r, i);
    }
    return gain;
  }

  /// True while the filter is in frozen mode and does not run the recursion.
  [[nodiscard]] bool frozen() const noexcept { return recursion_.standing; }

  /// T, s.
  [[nodiscard]] const S& sample_time() const noexcept { return sample_time_; }

 private:
  using Rows = detail::ChainRows<Orders, Extension>;
  static constexpr std::size_t index(int i) noexcept { return Rows::index(i); }
  static constexpr int order_of(int chain) noexcept { return Rows::order_of(chain); }
  static constexpr int first(int chain) noexcept { return Rows::first(chain); }
  static constexpr int end(int chain) noexcept { return Rows::end(chain); }
  using Factor = CovarianceFactor<size, S>;

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
    if (config.inflation_rule == InflationRule::fixed) recursion_.growth = S(1) + config.inflation;
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
    OutputCovariance exact = recursion_.measurement.matrix();
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
    const Covariance q = recursion_.noise.matrix();
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

  /// Restarts chain i at (y_i, 0, .., 0) with its part of P0, or of the limit.
  StepStatus restart_chain(int chain, const S& y) noexcept {
    Estimate next = state_;
    for (int r = first(chain); r < end(chain); ++r) next(r) = S(0);
    next(first(chain)) = y;
    if (!finite(next, chain)) return StepStatus::measurement_rejected;
    state_ = next;
    missed_[index(chain)] = 0;
    recursion_.restart_chain(chain);
    return StepStatus::restarted;
  }

  static bool positive(const OutputCovariance& r) noexcept {
    return detail::solve_positive<outputs, 1, S>(r, Output::Zero()).has_value();
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

  Estimate state_ = Estimate::Zero();  ///< scaled, x_r = T^r z_r / r! chain by chain
  detail::MimoRiccati<Orders, S, Extension> recursion_{};
  Matrix<S, outputs, Inputs> drive_;
  Estimate units_;       ///< T^r / r!
  Estimate root_units_;  ///< the same divided by the root of the unit of variances
  S unit_{1};            ///< unit of all variances, in unit of y squared
  Input input_ = Input::Zero();
  Output innovation_ = Output::Zero();
  S sample_time_;
  int max_gap_;
  Array<int, outputs> missed_{};  ///< predictions since the last correction
};

}  // namespace esokit
