/// @file
/// ExtendedStateFilter (ESF): the extended state observer whose gain comes from noise levels
/// instead of a bandwidth (S. Shi, Z. Zeng, C. Zhao, L. Guo, P. Chen, Energies 15 (2022) 5799).
#pragma once

#include <cmath>
#include <concepts>
#include <cstdint>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/constant_gain.hpp>
#include <esokit/gain/detail/filter_design.hpp>
#include <esokit/gain/riccati_gain.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>
#include <optional>

namespace esokit {

/// For an ESF without a model of the disturbance: d may change in any way within the bounds.
struct NoNominalModel {};

/// Distinguishes the type in snapshots.
template <>
inline constexpr std::uint32_t type_tag<NoNominalModel> = make_type_tag<>("NoNominalModel");

/// A model fbar(x, u, t) of the total disturbance, in the unit of y^(n). x are the plant states, u
/// the held input and t the time in seconds since the start or the last reset.
///
/// fbar depends on the estimated state and changes the estimated d: this is a loop inside the
/// filter, which the gains have to stabilise. If the gains are slower than the dynamics of fbar,
/// the estimate oscillates, limited only by the bound on the change. Example: T = 0.8 s, fbar =
/// -0.5 y, q_n T^2 / sqrt(R) = 0.03.
template <class Model, int Order, class S>
concept NominalModel = std::copyable<Model> &&
    (std::same_as<Model, NoNominalModel> ||
     requires(const Model& model, const Vector<S, Order>& x, const S& s) {
       { model(x, s, s) } -> std::convertible_to<S>;
     });

/// Extended state filter of a plant y^(n) = d + b0 u, sampled exactly, with y measured in white
/// noise.
///
/// The gain follows from R, the variance of the noise, and from Q, which bounds by how much the
/// state may deviate from its model within a sample. For m = 1 this is mainly the change of the
/// disturbance. P0 speeds up the start. `covariance` is an upper bound on the covariance matrix of
/// the error if Q and R are bounds. In a closed loop the noise acts on u, and u changes the
/// disturbance: the bounds have to cover this, too.
///
/// In general the estimate is neither of minimum variance nor unbiased; only the bound is
/// guaranteed. With the inflation rule `none` it is the Kalman filter of a chain driven by white
/// noise.
///
/// As for all observers, the initial state belongs to the sample before the first measurement,
/// because `update` predicts first. If the initial estimate is for the first sample itself, as in
/// the paper, start with `correct(y)`.
///
/// This is the current (corrected) form z = z- + k (y - C z-). The predictor form of the paper, (4)
/// with K = -Phi k, is the same filter read between `predict` and `correct`: there `estimate` and
/// `covariance` belong to the prediction, and `predictor_gain` is -K.
///
/// @tparam Order n @tparam S scalar @tparam Extension m
/// @tparam Model model of the disturbance, see NominalModel (m = 1 only)
/// @tparam TableSize number of samples in the table of RiccatiMode::start_table
/// @tparam PlantModel what is known of the plant, see SampledModel
template <int Order, Scalar S = double, int Extension = 1, class Model = NoNominalModel,
          int TableSize = 0, class PlantModel = ChainModel<Order, S, Extension>>
requires NominalModel<Model, Order, LaneScalar<S>>
class ExtendedStateFilter
    : public NamedObserver<ExtendedStateFilter<Order, S, Extension, Model, TableSize, PlantModel>,
                           PredictorCorrector<Order, S, Extension,
                                              RiccatiGain<Order + Extension, S, TableSize,
                                                          detail::TransitionOf<PlantModel, S>>,
                                              1, PlantModel>> {
  using Base = typename ExtendedStateFilter::NamedObserver;
  friend Base;
  using Law = typename Base::Law;
  static constexpr int N = Base::size;
  static constexpr bool has_model = !std::same_as<Model, NoNominalModel>;
  static_assert(!has_model || (Extension == 1 && model_traits<PlantModel>.is_chain),
                "esokit: a nominal model needs the chain and one extended state");

 public:
  using Chain = typename Base::Chain;        ///< the sampled chain, in its scaling
  using Estimate = typename Base::Estimate;  ///< (y, .., y^(n-1), d, .., d^(m-1)), N x 1
  using Covariance = Matrix<S, N, N>;        ///< N x N, in the units of the estimates

  /// What the observer can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.acts_by_gain = !has_model;
    traits.gates_outliers = true;
    traits.rejects_outliers = true;
    return traits;
  }();

  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S input_gain{};            ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
    S sample_time{};           ///< T, s
    S measurement_variance{};  ///< R >= 0, unit of y squared; 0: y is exact; encoder: step^2 / 12

    /// q_r >= 0: by how much state r may deviate from its model within a sample, in the unit of the
    /// state. For r < n this is the error of sampling (zero for an exactly sampled chain), for r =
    /// n the change of d, for r > n that of its derivatives. Q = bound_factor diag(q_r^2).
    ///
    /// If n + m is odd and only the highest state has a bound, an error that changes sign at every
    /// sample is not visible in y. Without noise the limit has a pole at -1, and this error decays
    /// only as 1/k. Such a config is refused, unless the inflation is 0.01 or more, or R is large
    /// enough. R (plus the contribution of Q at half the sampling rate) must be at least a
    /// millionth of the trace of Q, with each state scaled by T^r/r!. With just a millionth the
    /// error falls to 1e-6 in 2000 samples for n + m = 3, 4400 for 5, 20000 for 7.
    Array<S, N> disturbance_bounds{};
    /// c: c = N covers N bounded errors with any correlation. The paper has 1 in (12) and 2 in
    /// (34).
    S bound_factor{static_cast<double>(N)};
    /// Q itself, N x N, positive semidefinite, per sample; replaces the bounds.
    std::optional<Covariance> process_covariance{};
    /// P0, N x N, positive semidefinite: at least the covariance of the initial error, as a matrix.
    Covariance initial_covariance = Covariance::Zero();

    InflationRule inflation_rule = InflationRule::fixed;  ///< how theta is chosen
    S inflation{};                                        ///< theta > 0 of the fixed rule

    /// Accept that nothing disturbs the highest state. The gain then tends to zero: the longer the
    /// filter has run, the longer an error of the estimate lasts.
    bool allow_vanishing_gain = false;

    /// Adaptive rule: weights of the states' variances in the trace, each state converted to the
    /// unit of y by T^r/r!. With all weights one, an error counts by its effect on y within a
    /// sample.
    Array<S, N> trace_weights = equal_weights();

    RiccatiMode mode = RiccatiMode::recursive;  ///< how the gain is obtained

    /// Normalised innovation squared above which y is rejected as an outlier and counts as missing;
    /// 0: no gate. A Gaussian innovation exceeds 6.63 in 1 %, 10.8 in 0.1 %, 15.1 in 0.01 % of all
    /// samples. The gate widens with every missing sample and accepts everything after max_gap.
    S outlier_threshold{};
    /// fbar. Its change over a sample is computed with the u of `predict`; `revise_input` does not
    /// recompute it.
    [[no_unique_address]] Model model{};
    /// What is known of the plant.
    [[no_unique_address]] typename PlantModel::Settings plant_model{};
    int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts

    /// All weights one.
    static constexpr Array<S, N> equal_weights() noexcept {
      Array<S, N> weights{};
      for (S& w : weights) w = S(1.0);
      return weights;
    }
  };

  /// As NamedObserver says. Not a template, so that compilers name a setting that does not exist.
  static Expected<ExtendedStateFilter, Error<S>> make(const Config& config) {
    return ExtendedStateFilter::NamedObserver::template make<ExtendedStateFilter>(config);
  }

  using StatusType = StatusOf<S>;  ///< StepStatus, for a pack one per lane
  template <class T>
  using with_scalar =
      ExtendedStateFilter<Order, T, Extension, typename detail::ForScalar<Model, T>::type,
                          TableSize, detail::WithScalar<PlantModel, T>>;  ///< with another scalar

  /// Takes over the settings of `fresh`, as returned by `make`, without design work. As with
  /// `retune`, estimate and covariance are kept, and a change of b0 is moved into the disturbance.
  Check<S> adopt(const ExtendedStateFilter& fresh) {
    if (auto ok = Base::adopt(fresh); !ok) return ok;
    rest_.set = fresh.rest_.set;
    return {};
  }

  /// One sample: `predict(u_applied)`, then `correct(y)`.
  StatusType update(S y, S u_applied) noexcept {
    if constexpr (records<S>) {
      if (!usual()) (void)y[0];  // branches on numbers
      return Base::update(y, u_applied);
    } else {
      if (!has_model && law().rests_unwatched()) [[likely]]
        return Base::update(y, u_applied);
      return update_out_of_line(y, u_applied);
    }
  }

  /// The same with the noise variance R of this measurement, unit of y squared. If it is negative
  /// or not finite, the measurement counts as missing.
  StatusType update_weighted(S y, S u_applied, S measurement_variance) noexcept {
    const StatusType predicted = predict(u_applied);
    if (!all(is_finite(measurement_variance)) || !all(measurement_variance >= S(0.0))) {
      return predicted | StepStatus::measurement_rejected;
    }
    law().set_measurement_variance(measurement_variance);
    return predicted | correct(y);
  }

  /// Time update only: one sample without a measurement, or the first half of `update`.
  StatusType predict(S u_applied) noexcept {
    if constexpr (!has_model) {
      return Base::predict(u_applied);
    } else {
      const Estimate before = this->estimate();
      const StepStatus status = Base::predict(u_applied);
      shift_by_model(before);
      return status;
    }
  }

  /// Measurement update only.
  StatusType correct(S y) noexcept {
    if constexpr (records<S>) {
      if (law().any_watched()) (void)y[0];
    } else if (!accepts(y)) {
      return StepStatus::outlier_rejected;
    }
    return Base::correct(y);
  }

  /// False if the gate would reject y as an outlier. True for a y that is not finite, which
  /// `correct` rejects anyway.
  [[nodiscard]] Lanes<bool, S> accepts(const S& y) const noexcept {
    if (!gated() || this->restarts()) return true;
    const S e = y - this->predicted_measurement();
    // A square that overflows is above the threshold.
    if (!all(is_finite(e))) return true;
    return all(e * e <= rest_.set.outlier_threshold * innovation_variance());
  }

  /// Restarts at (y, 0, .., 0) with P0.
  StatusType reset(S y) noexcept { return restart_clock(Base::reset(y)); }

  /// Restarts at a given estimate, N x 1, with P0.
  StatusType reset(const Estimate& state) noexcept { return restart_clock(Base::reset(state)); }

  /// Bound on the covariance of the error of the present estimate, N x N, in the units of the
  /// estimates: after `predict` that of the prediction, after `correct` that of the corrected
  /// estimate. An element that overflows is given as the largest number of the scalar.
  [[nodiscard]] Covariance covariance() const noexcept {
    const Covariance of_states = law().covariance();
    // Multiplied in two steps, from both sides: the product of the units may overflow when P does
    // not.
    const Estimate units = physical_units(this->model());
    Covariance p;
    for (int i = 0; i < N; ++i) {
      for (int j = 0; j <= i; ++j) {
        const S& scaled = of_states(PlantModel::state_of_row(i), PlantModel::state_of_row(j));
        p(i, j) = detail::clipped(S(scaled * units(i) * units(j)));
        p(j, i) = p(i, j);
      }
    }
    return p;
  }

  /// Variance of the innovation, C P- C' + R of the last prediction, unit of y squared; on overflow
  /// the largest number of the scalar.
  [[nodiscard]] S innovation_variance() const noexcept {
    return detail::clipped(law().innovation_variance());
  }

  /// Normalised innovation squared (NIS) of the last correction: e^2 divided by its variance. About
  /// 1 on average if R, Q and P0 are exact, less if they are bounds; on overflow the largest number
  /// of the scalar.
  [[nodiscard]] S normalised_innovation() const noexcept {
    const S& e = this->innovation();
    return select(detail::absolute(e) > S(0.0), detail::clipped(S(e * (e / innovation_variance()))),
                  S(0.0));
  }

  /// theta at present.
  [[nodiscard]] S inflation() const noexcept { return law().inflation(); }

  /// Gain of the next correction in physical units, N x 1.
  [[nodiscard]] Estimate gain() const noexcept {
    return this->model().physical(law().gain_before_measurement());
  }

  /// Phi times this gain, -K of the predictor form (24), N x 1, physical units.
  [[nodiscard]] Estimate predictor_gain() const noexcept {
    const PlantModel& plant = this->model();
    return plant.physical(plant.predict(law().gain_before_measurement(), plant.drive(S(0.0))));
  }

  /// True while a filter in a frozen mode does not run the recursion.
  [[nodiscard]] Lanes<bool, S> frozen() const noexcept { return law().stands(); }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;

  /// True if no lane has anything to do besides the predictor-corrector's step.
  [[nodiscard]] bool usual() const noexcept { return !has_model && !law().any_watched(); }

  /// For packs, see PredictorCorrector.
  /// @{
  ESOKIT_INLINE bool advance() noexcept { return usual() && Base::advance(); }
  ESOKIT_INLINE bool advance_predict() noexcept { return !has_model && Base::advance_predict(); }
  ESOKIT_INLINE bool correct_all(const S& y) noexcept {
    return !law().any_watched() && Base::correct_all(y);
  }
  /// @}

  ExtendedStateFilter(const Config& config, const PlantModel& plant, const Law& law,
                      int max_gap) noexcept
      : Base(config, plant, law, max_gap),
        rest_{{config.model, config.outlier_threshold, config.disturbance_bounds[Order]}} {
    std::get<0>(this->laws()).watch(all(config.outlier_threshold > S(0.0)));
  }

  static Expected<Law, Error<S>> design(const Config& config, const PlantModel& plant) {
    return detail::FilterDesign<Law, PlantModel, has_model, Config>::make(config, plant);
  }

  [[nodiscard]] bool gated() const noexcept { return law().is_watched(); }
  [[nodiscard]] const Law& law() const noexcept { return std::get<0>(this->laws()); }
  [[nodiscard]] Law& law() noexcept { return std::get<0>(this->laws()); }

  /// Factors from the states in the scaling of the model to physical units.
  static Estimate physical_units(const PlantModel& plant) noexcept {
    typename PlantModel::State ones;
    ones.fill(S(1.0));
    return plant.physical(ones);
  }

  // A function of its own, so that the step of a frozen filter contains only a tail call.
  [[gnu::__noinline__]] StepStatus update_out_of_line(S y, S u_applied) noexcept {
    if (!has_model && !gated()) [[likely]]
      return Base::update(y, u_applied);
    const StepStatus predicted = predict(u_applied);
    return predicted | correct(y);
  }

  StatusType restart_clock(StatusType status) noexcept {
    for (int i = 0; i < lane_count<S>; ++i) {
      if (has_model && detail::of_lane(status, i) == StepStatus::ok)
        detail::of_lane(rest_.sample, i) = 0;
    }
    return status;
  }

  /// Adds sat(fbar(x+, u, t + T) - fbar(x, u, t)) to d: (6), with the input that the printed
  /// prediction of x+ lacks.
  void shift_by_model(const Estimate& before) noexcept {
    if constexpr (has_model) {
      const S time = this->sample_time();
      const S t = detail::integer<S>(rest_.sample) * time;
      const S u = this->applied_input();
      Vector<S, Order> x = before.template head<Order>();
      const S now = rest_.set.nominal_model(x, u, t);
      // x+: predicted along the chain, with fbar in place of the estimated disturbance.
      Estimate start = before;
      start(Order) = now;
      const S drive = Chain::scaled_input_gain(this->input_gain(), time) * u;
      const auto ahead = Chain::template predict<1>(Chain::scaled(start, time), Array<S, 1>{drive});
      x = Chain::physical(ahead, S(S(1.0) / time)).template head<Order>();
      const S change = rest_.set.nominal_model(x, u, S(t + time)) - now;
      const S low = select(change < -rest_.set.change_bound, S(-rest_.set.change_bound), change);
      const S limited = select(rest_.set.change_bound < low, rest_.set.change_bound, low);
      const S sum = this->total_disturbance() + limited;
      this->shift_disturbance(select(is_finite(sum), limited, S(0.0)));
      ++rest_.sample;
    }
  }

  struct Set {
    [[no_unique_address]] Model nominal_model;
    S outlier_threshold;
    S change_bound;
  };
  struct {
    Set set;  ///< replaced by a retune
    Lanes<std::uint64_t, S> sample{};
  } rest_;
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension, class Model, int TableSize, class PlantModel>
inline constexpr std::uint32_t
    type_tag<ExtendedStateFilter<Order, S, Extension, Model, TableSize, PlantModel>> =
        make_type_tag<S, Model, PlantModel>("ExtendedStateFilter", Order, Extension, TableSize);

}  // namespace esokit
