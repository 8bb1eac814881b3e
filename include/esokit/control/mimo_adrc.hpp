/// @file
/// MimoAdrc: ADRC with q channels, decoupled by the inverse of the input matrix.
#pragma once

#include <esokit/control/adrc_law.hpp>
#include <esokit/control/control_loop.hpp>
#include <esokit/control/controller.hpp>
#include <esokit/control/limiter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/unroll.hpp>
#include <esokit/gain/feedback_gain.hpp>
#include <esokit/math/detail/dense.hpp>
#include <esokit/observer/concepts.hpp>
#include <esokit/observer/detail/steady_state.hpp>
#include <limits>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>

namespace esokit {

/// Config of MimoAdrc.
template <class... Observers>
requires(...&& detail::shifts_disturbance<Observers>()) struct MimoAdrcConfig {
  [[no_unique_address]] ByName<MimoAdrcConfig> by_name{};  ///< nothing to set, see ByName
  static constexpr int channels = sizeof...(Observers);    ///< q
  using S =
      typename std::tuple_element_t<0, std::tuple<Observers...>>::scalar_type;  ///< type of signals
  using InputMatrix = Matrix<S, channels, channels>;                            ///< B0, q x q

  /// One config for each channel. Leave out `input_gain`, which B0 gives; T must be the same in
  /// all.
  std::tuple<typename Observers::Config...> observers{};
  Array<S, channels> controller_bandwidths{};      ///< omega_c of each channel, rad/s
  TimeDomain domain = TimeDomain::continuous;      ///< where the controllers' poles are placed
  bool half_gain = false;                          ///< half-gain tuning of the controllers
  InputMatrix input_matrix = InputMatrix::Zero();  ///< B0, unit of y_i^(n_i) per unit of u_j

  /// Largest accepted condition number of B0, in the 1-norm, after rows and columns are scaled to a
  /// largest element of 1 so that units do not matter.
  S condition_limit = S(1000);
  Array<Limits<S>, channels> limits{};  ///< of each actuator

  /// What to do when measurements are missing: `most` of each measurement, `input` or `hold` of
  /// each actuator. If one measurement is missing for too long, all actuators go there: B0 couples
  /// them. `stay` is said by any of them.
  Array<MissingRule<S>, channels> missing{};
};

/// Control of y_i^(n_i) = d_i + (B0 u)_i, i = 1..q, B0 square and invertible: each channel has an
/// observer of its own order, and u = B0^-1 (v - dhat). Errors of B0 and all other couplings are
/// part of the disturbance.
///
/// Observer i gets the applied (B0 u)_i, so the limits of the q actuators cause no wind-up; while
/// an actuator is at its limit, the channels are coupled through B0. A channel whose measurement is
/// NaN only predicts, the others continue, up to `missing.most` samples: then `mode()` is `safe`. A
/// channel whose reference is NaN reports `reference_rejected` and keeps its part of B0 u.
///
/// An actuator in the model of a channel is a lag of (B0 u)_i. This is correct if all actuators
/// have the same lag, or if B0 does not couple them.
/// @tparam Observers one observer type for each channel, all with the same scalar
template <class... Observers>
requires(...&& detail::shifts_disturbance<Observers>()) class MimoAdrc {
  using Channels = std::tuple<Observers...>;
  using First = std::tuple_element_t<0, Channels>;
  template <int Channel>
  using ObserverOf = std::tuple_element_t<static_cast<std::size_t>(Channel), Channels>;

 public:
  static constexpr int channels = sizeof...(Observers);  ///< q
  using scalar_type = typename First::scalar_type;       ///< type of signals and settings
  using S = scalar_type;                                 ///< the same type
  using Output = Vector<S, channels>;                    ///< y, or r, or u, q x 1
  using InputMatrix = Matrix<S, channels, channels>;     ///< B0, q x q
  static_assert((std::is_same_v<typename Observers::scalar_type, S> && ...),
                "esokit: all channels need the same scalar");
  static_assert(
      !(observer_traits<Observers>.maps_input || ...),
      "esokit: MimoAdrc takes no MappedInput: its channels are not its actuators. Put the "
      "u of ActuatorMap::input out, and tell `applied` the effect");

  /// What the controller can do beyond `update(y, reference)`.
  static constexpr ControllerTraits traits{.knows_sample_time = true};

  using Config = MimoAdrcConfig<Observers...>;  ///< settings of make

  /// Checks the settings and does all the design work.
  /// @return the controller at rest at zero, or an error that names the field; for B0 the value is
  /// its condition number
  static Expected<MimoAdrc, Error<S>> make(const Config& config) {
    auto inverse = inverted(config.input_matrix, config.condition_limit);
    if (!inverse) return inverse.error();
    const S& sample_time = chain_config<First>(std::get<0>(config.observers)).sample_time;
    return make_channels(config, *inverse, sample_time,
                         std::make_index_sequence<sizeof...(Observers)>{});
  }

  /// One sample. @param y q x 1, NaN for a missing element @param reference r, q x 1
  /// @return u, q x 1, to be held until the next sample, within the limits
  Output update(const Output& y, const Output& reference) noexcept {
    const Output drive = told_matrix_ * held();
    told_matrix_ = input_matrix_;
    Output wanted;
    detail::unroll<channels>([&](auto i) {
      constexpr auto channel = static_cast<std::size_t>(i);
      constexpr int row = i;
      auto& observer = std::get<channel>(observers_);
      observe<row>(y(row), drive(row));
      const auto estimate = observer.estimate();
      S r = reference(row);
      if constexpr (observer_traits<ObserverOf<row>>.wraps_output)
        r = estimate(0) + observer.wrap(r - estimate(0));
      wanted(row) =
          detail::by_present_gain(observer, S(std::get<channel>(laws_).control(estimate, r)));
    });
    Output u = inverse_ * wanted;
    if (special_ != 0 || !is_finite(u.sum())) [[unlikely]]
      u = specially(wanted);
    for (int i = 0; i < channels; ++i) u(i) = limiters_[static_cast<std::size_t>(i)](u(i));
    return u;
  }

  /// What the actuators held since the last sample, if it was not the last output: say it before
  /// `update`. The observers get it; a rate limit counts from the last output (right after `start`
  /// or `hold` from this u). @return ok, or input_rejected if one is not finite, which keeps its
  /// last output @{
  StepStatus applied(const Output& u) noexcept {
    StepStatus status = StepStatus::ok;
    const bool theirs = (special_ & elsewhere) != 0;
    for (int i = 0; i < channels; ++i) {
      auto& limiter = limiters_[static_cast<std::size_t>(i)];
      const bool good = is_finite(u(i));
      if (!good) status = StepStatus::input_rejected;
      if (!theirs) {
        limiter.applied(good ? u(i) : limiter.last(), is_told());
      } else if (good) {
        limiter.track(u(i));
      }
    }
    if (!theirs) special_ |= told;
    return status;
  }
  Output update(const Output& y, const Output& reference,
                const Output& u) = delete;  // call applied(u) before update
  /// @}

  /// For a plant that is held by something else: the observers follow y, every dhat is kept, u is
  /// the caller's; see Guarded. On release begin with the reference at y.
  /// @param u_applied what the actuators held since the last sample @return the same
  template <int = 0>
  requires(observer_traits<Observers>.gates_disturbance&&...)  //
      Output hold(const Output& y, const Output& u_applied)
  noexcept {
    const Output before = output();
    Output u;
    for (int i = 0; i < channels; ++i) u(i) = is_finite(u_applied(i)) ? u_applied(i) : before(i);
    track(u);
    special_ = static_cast<unsigned char>(special_ | elsewhere);
    const Output drive = told_matrix_ * u;
    told_matrix_ = input_matrix_;
    detail::unroll<channels>([&](auto i) {
      constexpr auto channel = static_cast<std::size_t>(i);
      constexpr int row = i;
      auto& observer = std::get<channel>(observers_);
      observe<row>(y(row), observer.hold(S(drive(row))));
      observer.release();
      if (!is_finite(u_applied(row))) statuses_[channel] |= StepStatus::input_rejected;
    });
    return u;
  }

  /// Sets B0 from the next sample on: it applies to the next output of the law, and therefore to
  /// the u that is passed to the observers one sample later. Every dhat is kept (unit of y^(n)).
  /// Costs an inversion of a q x q matrix. With an actuator in a channel's model this B0 acts
  /// before the lag; for a factor on the output of the lag use `set_input_gain` of a Guarded
  /// channel, whose gain is 1 in make.
  /// @return the error of `make` for a B0 that it would refuse: nothing changes then
  Check<S> set_input_matrix(const InputMatrix& input_matrix) noexcept {
    const auto inverse = inverted(input_matrix, condition_limit_);
    if (!inverse) return inverse.error();
    if (!is_finite(S((input_matrix * held()).sum()))) return too_large(S(held()(0)));
    input_matrix_ = input_matrix;
    inverse_ = *inverse;
    return {};
  }

  /// Takes over a plant at rest at y under u: dhat = -B0 u.
  /// @return ok, or state_rejected if something is not finite: nothing changes then
  StepStatus start(const Output& y, const Output& u) noexcept {
    const Output drive = input_matrix_ * u;
    if (!is_finite(y.sum() + drive.sum() + u.sum())) return StepStatus::state_rejected;
    Channels observers = observers_;
    StepStatus status = StepStatus::ok;
    detail::unroll<channels>([&](auto i) {
      constexpr int row = i;
      auto& observer = std::get<static_cast<std::size_t>(i)>(observers);
      status |= detail::start_at_rest(observer, S(y(row)), S(drive(row)));
    });
    if (status != StepStatus::ok) return status;
    observers_ = observers;
    track(u);
    special_ = elsewhere;
    return status;
  }

  /// New settings while running: estimates are kept, a change of B0 is moved into the disturbances,
  /// dhat += (B0_old - B0_new) u. A refused config changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`: without design work, so it may
  /// run in an interrupt.
  Check<S> adopt(const MimoAdrc& fresh) {
    const Output u = held();
    const Output drive = fresh.input_matrix_ * u;
    const Output moved = input_matrix_ * u - drive;
    Channels observers = observers_;
    Check<S> outcome;
    detail::unroll<channels>([&](auto i) {
      constexpr auto channel = static_cast<std::size_t>(i);
      constexpr int row = i;
      auto& observer = std::get<channel>(observers);
      if (outcome) outcome = observer.adopt(std::get<channel>(fresh.observers_));
      // After an absurdly large reported u this change of the disturbance may overflow.
      const S shift = moved(row) * observer.input_gain();
      if (outcome && observer.shift_disturbance(shift) != StepStatus::ok) {
        outcome = too_large(u(row));
      }
      // Inputs that are still delayed act on the plant through the new B0.
      if constexpr (observer_traits<ObserverOf<row>>.delays_input) {
        if (moved(row) < S(0) || moved(row) > S(0)) observer.fill_input(drive(row));
      }
    });
    if (!outcome) return outcome;
    const Output commanded = output();
    auto limiters = limiters_;
    for (std::size_t i = 0; i < channels; ++i) {
      limiters[i].adopt(fresh.limiters_[i], commanded(static_cast<int>(i)));
    }
    const unsigned char special = special_;
    *this = fresh;
    observers_ = observers;
    limiters_ = limiters;
    special_ = static_cast<unsigned char>(special | told);
    return {};
  }

  /// T of all channels, s.
  [[nodiscard]] S sample_time() const noexcept { return observer<0>().sample_time(); }
  /// The present u, q x 1, whatever is reported as applied.
  [[nodiscard]] Output output() const noexcept {
    Output u;
    for (int i = 0; i < channels; ++i) {
      u(i) = limiters_[static_cast<std::size_t>(i)].commanded(is_told());
    }
    return u;
  }
  /// Whether u is determined by the law or by the rule for missing measurements.
  [[nodiscard]] LoopMode mode() const noexcept {
    return (special_ & safe) != 0 ? LoopMode::safe : LoopMode::running;
  }

  /// Observer of a channel, 0 .. q - 1, for its estimates.
  template <int Channel>
  [[nodiscard]] const ObserverOf<Channel>& observer() const noexcept {
    return std::get<static_cast<std::size_t>(Channel)>(observers_);
  }

  /// The same, for its own members (trust and pin of Guarded; `measured(w)` of Measured, before
  /// each `update`).
  template <int Channel>
  [[nodiscard]] ObserverOf<Channel>& observer() noexcept {
    return std::get<static_cast<std::size_t>(Channel)>(observers_);
  }

  /// k_0 .. k_(n-1) of a channel, 0 .. q - 1.
  template <int Channel>
  [[nodiscard]] const Array<S, ObserverOf<Channel>::order>& gains() const noexcept {
    return std::get<static_cast<std::size_t>(Channel)>(laws_).gains();
  }

  /// B0 and its inverse. @{
  [[nodiscard]] const InputMatrix& input_matrix() const noexcept { return input_matrix_; }
  [[nodiscard]] const InputMatrix& decoupling() const noexcept { return inverse_; }
  /// @}

  /// Status of the observer of a channel at the last sample.
  [[nodiscard]] StepStatus status(int channel) const noexcept {
    return statuses_[static_cast<std::size_t>(channel)];
  }

 private:
  using Laws = std::tuple<AdrcLaw<Observers::order, S>...>;
  struct Missing;

  MimoAdrc(const Channels& observers, const Laws& laws, const Array<Limiter<S>, channels>& limiters,
           const Config& config, const InputMatrix& inverse) noexcept
      : observers_(observers),
        laws_(laws),
        limiters_(limiters),
        input_matrix_(config.input_matrix),
        told_matrix_(config.input_matrix),
        inverse_(inverse),
        condition_limit_(config.condition_limit) {
    for (int i = 0; i < channels; ++i) {
      const auto& missing = config.missing[static_cast<std::size_t>(i)];
      safe_input_(i) = missing.input.value_or(S(0));
      auto& rule = missing_[static_cast<std::size_t>(i)];
      rule = {static_cast<std::uint16_t>(missing.most), missing.hold, missing.stay};
    }
  }

  template <int Channel>
  void observe(const S& y, const S& drive) noexcept {
    constexpr auto channel = static_cast<std::size_t>(Channel);
    auto& observer = std::get<channel>(observers_);
    const StepStatus status = observer.update(y, drive);
    std::get<channel>(statuses_) = status;
    if (status != StepStatus::ok) [[unlikely]]
      after_trouble(observer, y, status, missing_[channel]);
  }

  template <class Observer>
  ESOKIT_COLD void after_trouble(Observer& observer, const S& y, StepStatus status,
                                 const Missing& rule) noexcept {
    // After a gap too long to bridge the observer starts in the steady state under the present u,
    // so that u does not jump.
    if (has(status, StepStatus::restarted)) {
      const S input = observer.applied_input();
      (void)observer.reset(observer.equilibrium(y, input));
    }
    if (observer.missed() > rule.most) special_ |= safe;
  }

  /// u where a law or u is not finite, where it is not the last output that the actuators held, or
  /// where measurements are missing. @param wanted of the laws
  ESOKIT_COLD Output specially(Output wanted) noexcept {
    bool stays = false;
    for (const Missing& rule : missing_) stays = stays || rule.stay;
    detail::unroll<channels>([&](auto i) {
      stays = stays || std::get<static_cast<std::size_t>(i)>(observers_).missed() > 0;
    });
    if (!stays) special_ &= static_cast<unsigned char>(~safe);
    const Output before = output();
    for (int i = 0; i < channels; ++i) {
      if (is_finite(wanted(i))) continue;
      statuses_[static_cast<std::size_t>(i)] |= StepStatus::reference_rejected;
      wanted(i) = (input_matrix_ * before)(i);
    }
    Output u = inverse_ * wanted;
    for (int i = 0; i < channels; ++i) {
      if ((special_ & safe) != 0) {
        u(i) = missing_[static_cast<std::size_t>(i)].hold ? before(i) : safe_input_(i);
      } else if (!is_finite(u(i))) {
        u(i) = before(i);
      }
    }
    special_ &= safe;
    return u;
  }

  [[nodiscard]] bool is_told() const noexcept { return (special_ & told) != 0; }
  /// What the actuators hold.
  [[nodiscard]] Output held() const noexcept {
    Output u;
    for (int i = 0; i < channels; ++i) u(i) = limiters_[static_cast<std::size_t>(i)].last();
    return u;
  }
  void track(const Output& u) noexcept {
    for (int i = 0; i < channels; ++i) limiters_[static_cast<std::size_t>(i)].track(u(i));
    special_ &= static_cast<unsigned char>(~told);
  }

  static Error<S> too_large(const S& u) {
    return {"input_matrix", u,
            "turns the present u (the value here) into a disturbance that the scalar cannot hold"};
  }

  static Expected<InputMatrix, Error<S>> inverted(const InputMatrix& input_matrix,
                                                  const S& condition_limit) {
    Rules<S> rules;
    rules.above("condition_limit", condition_limit, S(1));
    for (int i = 0; i < channels; ++i) {
      for (int j = 0; j < channels; ++j) {
        rules.finite("input_matrix", S(input_matrix(i, j)), i * channels + j);
      }
    }
    if (!rules) return rules.error();
    InputMatrix scaled = input_matrix;
    Output rows;
    Output columns;
    const auto scale_of = [](const S& largest) { return largest > S(0) ? S(1) / largest : S(1); };
    for (int i = 0; i < channels; ++i) {
      rows(i) = scale_of(detail::largest_magnitude(scaled.row(i)));
      for (int j = 0; j < channels; ++j) scaled(i, j) *= rows(i);
    }
    for (int i = 0; i < channels; ++i) {
      columns(i) = scale_of(detail::largest_magnitude(scaled.col(i)));
      for (int j = 0; j < channels; ++j) scaled(j, i) *= columns(i);
    }
    // A zero pivot makes the inverse infinite or NaN, and so its condition number.
    InputMatrix inverse = InputMatrix::Identity();
    InputMatrix eliminated = scaled;
    detail::solve_in_place(detail::DenseView<S>{eliminated.data(), channels},
                           detail::DenseView<S>{inverse.data(), channels});
    S condition = column_norm(scaled) * column_norm(inverse);
    if (!is_finite(inverse.sum()) || !is_finite(condition)) {
      condition = detail::unbounded<S>();
    }
    if (!detail::at_most(condition, condition_limit)) {
      return Error<S>{"input_matrix",
                      condition,
                      "has a condition number (the value here) that must be at most",
                      -1,
                      condition_limit,
                      true};
    }
    for (int i = 0; i < channels; ++i) {
      for (int j = 0; j < channels; ++j) inverse(i, j) = columns(i) * inverse(i, j) * rows(j);
    }
    return inverse;
  }

  /// The largest column sum of magnitudes (1-norm).
  static S column_norm(const InputMatrix& matrix) noexcept {
    S norm(0);
    for (int j = 0; j < channels; ++j) {
      S sum(0);
      for (int i = 0; i < channels; ++i) sum += detail::absolute(matrix(i, j));
      norm = detail::larger(norm, sum);
    }
    return norm;
  }

  template <std::size_t... Index>
  static Expected<MimoAdrc, Error<S>> make_channels(const Config& config,
                                                    const InputMatrix& inverse,
                                                    const S& sample_time,
                                                    std::index_sequence<Index...>) {
    std::tuple<Expected<Observers, Error<S>>...> observers{make_observer<Observers>(
        std::get<Index>(config.observers), sample_time, static_cast<int>(Index))...};
    std::tuple<Expected<AdrcLaw<Observers::order, S>, Error<S>>...> laws{make_law(
        config, config.controller_bandwidths[Index], sample_time, std::get<Index>(observers))...};
    std::tuple limiters{
        (static_cast<void>(Index), Limiter<S>::make(config.limits[Index], sample_time))...};
    std::tuple missing{detail::check_missing(config.missing[Index], config.limits[Index])...};
    const Error<S>* error = nullptr;
    int channel = -1;
    const auto look = [&](const auto& outcome, std::size_t i) {
      if (outcome || error != nullptr) return;
      error = &outcome.error();
      channel = static_cast<int>(i);
    };
    (look(std::get<Index>(observers), Index), ...);
    (look(std::get<Index>(laws), Index), ...);
    (look(std::get<Index>(limiters), Index), ...);
    (look(std::get<Index>(missing), Index), ...);
    if (error != nullptr) {
      Error<S> named = *error;
      named.index = channel;
      return named;
    }
    return MimoAdrc({*std::get<Index>(observers)...}, {*std::get<Index>(laws)...},
                    {*std::get<Index>(limiters)...}, config, inverse);
  }

  template <class Observer>
  static Expected<Observer, Error<S>> make_observer(typename Observer::Config config,
                                                    const S& sample_time, int) {
    auto& chain = chain_config<Observer>(config);
    if (chain.input_gain < S(0) || chain.input_gain > S(0) || !is_finite(chain.input_gain)) {
      return Error<S>{"input_gain", chain.input_gain, "is given by input_matrix: leave it out"};
    }
    if (!detail::same(chain.sample_time, sample_time)) {
      return Error<S>{
          "sample_time", chain.sample_time, "must be the same in all channels, as", -1, sample_time,
          true};
    }
    chain.input_gain = S(1);
    return Observer::make(config);
  }

  template <class Observer, int Order = Observer::order>
  static Expected<AdrcLaw<Order, S>, Error<S>> make_law(
      const Config& config, const S& bandwidth, const S& sample_time,
      const Expected<Observer, Error<S>>& observer) {
    const auto gains =
        feedback_gain<Order, S>({bandwidth, config.domain, config.half_gain}, sample_time);
    if (!gains) {
      Error<S> named = gains.error();
      if (std::string_view(named.field) == "controller_bandwidth") {
        named.field = "controller_bandwidths";
      }
      return named;
    }
    // 1; with an actuator in the model its b, for example 1 / tau.
    const S input_gain = observer ? S(observer->input_gain()) : S(1);
    return AdrcLaw<Order, S>::make({.gains = *gains, .input_gain = input_gain});
  }

  /// Of a channel, see MissingRule.
  struct Missing {
    std::uint16_t most;
    bool hold;
    bool stay;
  };
  // Bits of special_.
  static constexpr unsigned char safe = 1;
  static constexpr unsigned char told = 2;       ///< `applied` was said since the last output
  static constexpr unsigned char elsewhere = 4;  ///< and that was the caller's

  Channels observers_;
  Laws laws_;
  Array<Limiter<S>, channels> limiters_;
  InputMatrix input_matrix_;
  InputMatrix told_matrix_;  ///< B0 when the law computed the u that comes next
  InputMatrix inverse_;
  S condition_limit_;
  Array<StepStatus, channels> statuses_{};
  Output safe_input_{};
  Array<Missing, channels> missing_{};
  unsigned char special_ = 0;
};

}  // namespace esokit
