/// @file
/// AlgebraicEso: the frequency-shifting-based (FSB) algebraic observer, a linear ESO whose
/// bandwidth falls from infinity to lambda (J. Kasac, A. Pender, M. Pranjic, D. Kotarski, Asian
/// Journal of Control 23 (2021) 2171-2184).
#pragma once

#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/gain/detail/algebraic_gain_design.hpp>
#include <esokit/observer/named_observer.hpp>
#include <esokit/observer/predictor_corrector.hpp>
#include <optional>

namespace esokit {

/// Algebraic extended state observer of a plant y^(n) = d + b0 u, sampled exactly.
///
/// Deadbeat at first: without noise the estimate is exact from the N-th sample on, whatever the
/// initial state, so there is no peaking. Then the bandwidth falls as mu(t) = lambda + N q /
/// (e^{qt} - 1); once it has settled the observer is LinearEso with omega_o = lambda.
///
/// Right after a start the estimate follows the noise: the variance of the highest state is about
/// sigma^2 T (2N-1)! (2N-2)! / ((N-1)!)^2 / t^(2N-1). So the estimates are blanked for a while:
/// during this time `estimate` returns the value from the start.
///
/// If one of the first N samples is missing, the schedule restarts (the state is kept). A later gap
/// is bridged with the gain for the whole gap at the present bandwidth.
///
/// @tparam Order n @tparam S scalar @tparam Extension m
template <int Order, class S = double, int Extension = 1>
requires(detail::is_a_scalar<S>()) class AlgebraicEso
    : public NamedObserver<
          AlgebraicEso<Order, S, Extension>,
          PredictorCorrector<Order, S, Extension, AlgebraicGain<Order + Extension, S>>> {
  using Base = typename AlgebraicEso::NamedObserver;
  friend Base;
  using Base::Base;
  using Law = typename Base::Law;
  static constexpr int N = Order + Extension;

 public:
  using Estimate = typename Base::Estimate;      ///< (y, .., y^(n-1), d, .., d^(m-1)), N x 1
  using StatusType = typename Base::StatusType;  ///< StepStatus, for a pack one per lane
  template <class T>
  using with_scalar = AlgebraicEso<Order, T, Extension>;  ///< the same with another scalar

  /// What the observer can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = Base::traits;
    traits.bears_regular_gaps = false;
    traits.publishes_chain = false;
    traits.blanks_estimate = true;
    return traits;
  }();

  /// Settings of make.
  struct Config {
    [[no_unique_address]] ByName<Config> by_name{};  ///< nothing to set, see ByName
    S observer_bandwidth{};                          ///< lambda, rad/s: the final bandwidth
    S frequency_shift{};  ///< q >= 0, rad/s: how fast the bandwidth falls to it; 0: as lambda + N/t
    S input_gain{};       ///< b0, unit of y^(n) per unit of u; not zero, negative is fine
    S sample_time{};      ///< T, s

    /// epsilon >= 0, s: estimates are blanked this long after a start. If left out, it follows from
    /// the two noise levels below, t = (sigma^2 T (2N-1)! (2N-2)! / ((N-1)!)^2 /
    /// tolerated^2)^(1/(2N-1)). Without these levels it is N - 1 samples: estimates are published
    /// from the first sample that can be exact.
    std::optional<S> blanking{};
    S measurement_noise{};  ///< standard deviation of the noise on y, unit of y
    S disturbance_noise{};  ///< standard deviation that is tolerated in the highest estimate,
                            ///< d^(m-1)
    int start_index = 0;    ///< soft start: first sample of the schedule; > 0 is not deadbeat
    bool allow_vanishing_gain = false;  ///< accept lambda = 0 with q > 0: in the end y is ignored
    int max_gap = 100;  ///< missing samples that a correction may bridge before it restarts, see
                        ///< `max_gap()`
  };

  /// As NamedObserver says. Not a template, so that compilers name a setting that does not exist.
  static Expected<AlgebraicEso, Error<S>> make(const Config& config) {
    return AlgebraicEso::NamedObserver::template make<AlgebraicEso>(config);
  }

  /// One sample, see PredictorCorrector::update.
  [[gnu::__flatten__]] StatusType update(S y, S u_applied) noexcept {
    if (settled() == true && this->may_be_quick()) [[likely]] {
      const StatusType status = Base::update(y, u_applied);
      if (status != StepStatus::ok) [[unlikely]]
        return after_trouble(status);
      return status;
    }
    return update_running(y, u_applied);
  }

  /// Measurement update only, see PredictorCorrector::correct.
  StatusType correct(S y) noexcept { return blank_anew(Base::correct(y)); }

  /// Takes over the settings of `fresh`, as returned by `make`, without design work. As with
  /// `retune`, the estimate and the place in the schedule (counted in samples) are kept, and a
  /// change of b0 is moved into the disturbance, also in blanked estimates. If the new blanking
  /// time has not passed yet, the present estimates are published until it has.
  Check<S> adopt(const AlgebraicEso& fresh) {
    Estimate published = estimate();
    published(Order) =
        published(Order) + (this->input_gain() - fresh.input_gain()) * this->applied_input();
    if (!all(is_finite(published(Order)))) {
      return Error<S>{"input_gain", fresh.input_gain(), "would make the estimate not finite"};
    }
    if (auto ok = Base::adopt(fresh); !ok) return ok;
    publish(published);
    return {};
  }

  /// Call this after a known jump of the disturbance or of the state: restarts the schedule and
  /// keeps the state. The present estimates are published until the blanking is over.
  void rearm() noexcept {
    publish(estimate());
    law().restart();
  }

  /// Restarts at (y, 0, .., 0).
  StatusType reset(S y) noexcept { return blank_after(Base::reset(y)); }

  /// Restarts at a given estimate, N x 1.
  StatusType reset(const Estimate& state) noexcept { return blank_after(Base::reset(state)); }

  /// All published estimates in physical units, N x 1; while blanked, those from the start.
  [[nodiscard]] Estimate estimate() const noexcept {
    const auto blanked_now = blanked();
    if (blanked_now == true) return published();
    Estimate estimate = Base::estimate();
    if (blanked_now == false) return estimate;
    for (int r = 0; r < N; ++r) estimate(r) = published_row(r, estimate(r), blanked_now);
    return estimate;
  }

  /// Published estimate of y^(Row), or of d^(Row - n) for Row >= n.
  template <int Row>
  [[nodiscard]] S estimate() const noexcept {
    return published_row(Row, Base::template estimate<Row>(), blanked());
  }

  /// Published dhat, unit of y^(n).
  [[nodiscard]] S total_disturbance() const noexcept { return estimate<Order>(); }

  /// The computed estimate, also while blanked, N x 1.
  [[nodiscard]] Estimate raw_estimate() const noexcept { return Base::estimate(); }

  /// True while the published estimates are those from the start.
  [[nodiscard]] Lanes<bool, S> blanked() const noexcept {
    const auto age = this->age();
    Lanes<bool, S> blanked{};
    for (int i = 0; i < lane_count<S>; ++i) {
      detail::of_lane(blanked, i) =
          detail::of_lane(age, i) <= detail::of_lane(law().least_age(), i);
    }
    return blanked;
  }

  /// True once the observer has become LinearEso with bandwidth lambda.
  [[nodiscard]] Lanes<bool, S> settled() const noexcept { return law().settled(); }

  /// epsilon, s.
  [[nodiscard]] S blanking() const noexcept {
    return detail::integer<S>(law().least_age()) * this->sample_time();
  }

  /// Samples since the schedule began; the count stops when it settles.
  [[nodiscard]] typename Law::Count age() const noexcept { return law().age(); }

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;

  [[nodiscard]] const Law& law() const noexcept { return std::get<0>(this->laws()); }
  [[nodiscard]] Law& law() noexcept { return std::get<0>(this->laws()); }

  static Expected<Law, Error<S>> design(const Config& config, const typename Base::PlantModel&) {
    return detail::design_algebraic_gain<N, S>(config);
  }

  void publish(const Estimate& estimate) noexcept {
    for (int r = 0; r < N; ++r) rest_.published[static_cast<std::size_t>(r)] = estimate(r);
  }
  [[nodiscard]] Estimate published() const noexcept {
    Estimate estimate;
    for (int r = 0; r < N; ++r) estimate(r) = rest_.published[static_cast<std::size_t>(r)];
    return estimate;
  }

  // Out of line, so that the settled observer costs the same as LinearEso; in one function it would
  // take 1.3 times as long.
  [[gnu::__noinline__, gnu::__flatten__]] StatusType update_running(S y, S u_applied) noexcept {
    return blank_anew(Base::update(y, u_applied));
  }

  /// The same after the law has advanced.
  StepStatus update_advanced(const S& y, const S& u_applied) noexcept {
    return blank_anew(Base::update_advanced(y, u_applied));
  }

  ESOKIT_COLD StatusType after_trouble(const StatusType& status) noexcept {
    return blank_anew(status);
  }

  StatusType blank_after(const StatusType& status) noexcept {
    if (status == StepStatus::ok) publish(Base::estimate());
    return status;
  }

  [[nodiscard]] S published_row(int row, S computed,
                                const Lanes<bool, S>& blanked_now) const noexcept {
    const S& published = rest_.published[static_cast<std::size_t>(row)];
    for (int i = 0; i < lane_count<S>; ++i) {
      if (!detail::of_lane(blanked_now, i)) continue;
      detail::set_lane(computed, detail::number_of_lane(published, i), i);
    }
    return computed;
  }

  /// After a restart because of a long gap, the estimates published before are too old.
  ESOKIT_INLINE StatusType blank_anew(const StatusType& status) noexcept {
    if (has(status, StepStatus::restarted)) [[unlikely]]
      publish(Base::estimate());
    return status;
  }

  struct {
    Array<S, N> published = [] {
      Array<S, N> zero;
      zero.fill(S(0.0));
      return zero;
    }();
  } rest_;
};

/// Distinguishes the type in snapshots.
template <int Order, Scalar S, int Extension>
inline constexpr std::uint32_t type_tag<AlgebraicEso<Order, S, Extension>> =
    make_type_tag<S>("AlgebraicEso", Order, Extension);

}  // namespace esokit
