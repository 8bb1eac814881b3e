/// @file
/// Measured: tells an observer what measured disturbances do, so that it has to find only the rest.
#pragma once

#include <esokit/adapter/adapter.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/model/measured_input.hpp>
#include <esokit/model/sampled_model.hpp>
#include <limits>
#include <type_traits>

namespace esokit {

/// Config of Measured.
template <class Observer, int Count>
requires(detail::goes_into_a_loop<Observer>()) struct MeasuredConfig {
  using S = typename Observer::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<MeasuredConfig> by_name{};  ///< nothing to set, see ByName
  typename Observer::Config observer{};                    ///< config of the observer
  Array<MeasuredInput<S>, Count> inputs{};                 ///< what each w does
  int most_lost = 50;  ///< samples in a row without a good w for which the last one is held, 0 ..
                       ///< 65535; after them it counts as zero, until there is a good one
};

/// Observer of y^(n) = f(w) + d + b0 u with measured disturbances w whose effect f is known, see
/// MeasuredInput: a fan, a flow, the supply voltage, the torque of the next joint. The estimate is
/// that of f + d, so a law cancels both, f without waiting for y.
///
/// Timing: `measured(w)` at sample k comes before `update(y, u)`; w[k] is taken to be held from k
/// to k + 1, like the u that a controller returns at k. So dhat has f of the coming sample, and
/// each prediction the f of the sample that it predicts. f is its exact mean over the sample. On
/// the chain with n = 1, and for an f that does not change within a sample (no lag, whole samples
/// of dead time), this is exact. Otherwise an error in y of order T^(n+1) f' / 12 remains a sample.
///
/// Before the first `measured`, and after `make`, w has been zero. A controller's `start(y, u)`
/// takes the w given last to have been there for long; `reset` restarts f + d and leaves w's
/// memory. Retuning keeps f + d and the memory of w, so u does not jump: d becomes what the new f
/// does not explain.
///
/// A w that is not given before a step, is not finite, or is too large is lost: the last good one
/// is held for `most_lost` samples, then dropped. It then counts as zero, which passes lag and dead
/// time like any w. The first good w ends this. `lost(i)` and `dropped(i)` tell. Where the real w
/// does not go to zero then, d steps by what it does, and an OutlierGate may reject y for a while.
///
/// A gain that is wrong by 30 % leaves 30 % of f to the observer, which finds it like any d.
/// With an actuator in the model f acts on the plant behind the actuator, as it does in reality.
/// Guarded bounds and leaks f + d, and holds or scales what is found, not what is given.
/// Measured goes around VariableTime, not inside: the dead time is then counted in present steps.
/// @tparam Count number of disturbances that are measured @tparam Delay longest dead time, samples;
///         the memory is Delay + 2 scalars each
template <class Observer, int Count = 1, int Delay = 0>
requires(detail::shifts_load<Observer>()) class Measured
    : public NamedAdapter<Measured<Observer, Count, Delay>, Observer,
                          MeasuredConfig<Observer, Count>> {
  using Base = NamedAdapter<Measured, Observer, MeasuredConfig<Observer, Count>>;
  friend Base;
  friend struct detail::RecordAccess;
  using Base::observer_;
  using S = typename Observer::scalar_type;
  static_assert(Count >= 1, "esokit: something has to be measured");
  static_assert(Delay >= 0, "esokit: Delay is the longest dead time, in samples");

 public:
  static constexpr int inputs = Count;  ///< number of disturbances that are measured

  /// What the adapter can do beyond LoopObserver.
  static constexpr ObserverTraits traits = [] {
    constexpr ObserverTraits inside = observer_traits<Observer>;
    ObserverTraits traits = Base::traits;
    traits.takes_measured = true;
    traits.is_predictable =
        inside.is_predictable && !inside.blanks_estimate && !inside.gates_outliers;
    return traits;
  }();

  /// w[k], before the step that ends at k. NaN: lost.
  void measured(const S& w) noexcept requires(Count == 1) { given_[0] = w; }
  /// The same for all of them, Count x 1; a lost one is NaN.
  template <detail::VectorOf<S> Given>
  void measured(const Given& w) noexcept {
    static_assert(detail::vector_size<Given> == Count, "esokit: w has Count elements");
    const Vector<S, Count>& all = w;
    for (int i = 0; i < Count; ++i) given_[static_cast<std::size_t>(i)] = all(i);
  }

  /// Takes a w that was given after the prediction for its sample, before the correction; for
  /// controllers that predict early.
  void revise_measured() noexcept {
    for (int i = 0; i < Count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      if (paths_[at].takes(given_[at], Count)) paths_[at].replace(accepted(at));
    }
    forget();
    tell();
  }

  /// As if the w of the last step had been there for long; f + d stays. For a start at rest.
  void settle_measured() noexcept {
    for (auto& path : paths_) path.settle();
    told_ = sum();
  }

  /// One sample, see PredictorCorrector::update.
  StepStatus update(S y, S u_applied) noexcept {
    const StepStatus status = predict(u_applied);
    return status | observer_.correct(y);
  }

  /// Time update only, see PredictorCorrector::predict.
  StepStatus predict(S u_applied) noexcept {
    // The length of the step may be another one than was thought.
    if constexpr (observer_traits<Observer>.varies_time) tell();
    const StepStatus status = observer_.predict(u_applied);
    const bool later = is_of_a_pause();
    for (int i = 0; i < Count; ++i) {
      const auto at = static_cast<std::size_t>(i);
      paths_[at].advance();
      paths_[at].push(later ? held(at) : accepted(at));
    }
    if (!later) forget();
    tell();
    return status;
  }

  /// Sets the length of the next step, s, if the observer is VariableTime.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Check<S> set_step_time(const S& seconds)
  noexcept {
    if (auto ok = observer_.set_step_time(seconds); !ok) return ok;
    for (auto& path : paths_) path.set_time(seconds);
    pause_ = {};
    return {};
  }

  /// Says how much time has passed, see VariableTime::elapsed.
  template <class O = Observer>
  requires(observer_traits<O>.varies_time) Expected<int, Error<S>> elapsed(const S& seconds)
  noexcept {
    const auto steps = observer_.elapsed(seconds);
    if (!steps || *steps == 0) return steps;
    for (auto& path : paths_) path.set_time(observer_.step_time());
    pause_.steps = *steps - 1;
    return steps;
  }

  /// f, what all w add to y^(n) in the mean of the coming sample, unit of y^(n) (n of the plant).
  [[nodiscard]] const S& known_part() const noexcept { return told_; }
  /// dhat without f, unit of y^(n); limited to the range of the scalar.
  [[nodiscard]] S residual_disturbance() const noexcept requires(
      model_traits<std::remove_cvref_t<decltype(std::declval<const Observer&>().model())>>.is_chain) {
    return detail::clipped(S(observer_.total_disturbance() - told_));
  }
  /// @cond
  [[nodiscard]] const auto& path(int i) const noexcept {
    return paths_[static_cast<std::size_t>(i)];
  }
  /// @endcond
  /// Samples in a row without a good w number `i`.
  [[nodiscard]] int lost(int i = 0) const noexcept { return lost_[static_cast<std::size_t>(i)]; }
  /// True if w number `i` has been lost for so long that it counts as zero.
  [[nodiscard]] bool dropped(int i = 0) const noexcept { return lost(i) > most_lost_; }

  /// What PredictiveAdrc asks of the observer, see PredictableObserver.
  /// @{
  [[nodiscard]] auto correction_gain(const S& e) const noexcept requires
      requires(const Observer& o) {
    o.correction_gain(e);
  }
  { return observer_.correction_gain(e); }
  [[nodiscard]] auto preview() const noexcept requires requires(const Observer& o) { o.preview(); }
  { return observer_.preview(); }
  template <class State>
  [[nodiscard]] S finite_probe(const State& x) const noexcept {
    return observer_.finite_probe(x);
  }
  [[nodiscard]] const auto& gain_law() const noexcept requires requires(const Observer& o) {
    o.gain_law();
  }
  { return observer_.gain_law(); }
  /// @}

 private:
  using Settings = MeasuredConfig<Observer, Count>;
  static constexpr bool varies_time = observer_traits<Observer>.varies_time;
  struct Pause {
    int steps = 0;  ///< that come before the one with the present w
  };
  struct NoPause {};

  Measured(const Observer& observer, const Settings& config) noexcept
      : Base(observer), most_lost_(config.most_lost) {
    const S time = chain_config<Observer>(config.observer).sample_time;
    for (std::size_t i = 0; i < Count; ++i) paths_[i] = {config.inputs[i], time};
    forget();
  }

  /// f + d and the memory of w are kept; d becomes what the new f does not explain.
  /// @return error if the new gain times a w of the memory is more than the scalar can hold
  Check<S> take(const Measured& fresh, const Measured&) noexcept {
    most_lost_ = fresh.most_lost_;
    for (std::size_t i = 0; i < Count; ++i) {
      paths_[i].adopt(fresh.paths_[i]);
      if (!paths_[i].takes_memory(Count) || !paths_[i].takes(last_[i], Count)) {
        return Error<S>{"inputs.gain", fresh.paths_[i].input().gain,
                        "would make the effect of the present w not finite", static_cast<int>(i)};
      }
    }
    told_ = sum();
    return {};
  }

  static Check<S> validate(const Settings& config) {
    const S time = chain_config<Observer>(config.observer).sample_time;
    Rules<S> rules;
    for (int i = 0; i < Count; ++i) {
      rules.all_of(Path::validate(config.inputs[static_cast<std::size_t>(i)], time, i));
    }
    return rules.demand(0 <= config.most_lost && config.most_lost <= 65535, "most_lost",
                        static_cast<S>(config.most_lost), "must be 0 .. 65535");
  }

  /// The w number `i` to be used, by the rule for lost ones.
  S accepted(std::size_t i) noexcept {
    if (paths_[i].takes(given_[i], Count)) {
      last_[i] = given_[i];
      lost_[i] = 0;
    } else if (lost_[i] <= 65535) {
      ++lost_[i];
    }
    return held(i);
  }
  /// What is taken for w as long as none is given.
  [[nodiscard]] S held(std::size_t i) const noexcept {
    return lost_[i] > most_lost_ ? S(0) : last_[i];
  }
  /// In a pause the w that is given now has not acted yet.
  bool is_of_a_pause() noexcept {
    if constexpr (varies_time) {
      return pause_.steps > 0 && pause_.steps-- > 0;
    } else {
      return false;
    }
  }

  /// A w counts for one step.
  void forget() noexcept { given_.fill(std::numeric_limits<S>::quiet_NaN()); }

  [[nodiscard]] S sum() const noexcept {
    S all(0);
    for (const auto& path : paths_) all = all + path.mean();
    return all;
  }

  /// Gives the observer the present f. If the estimate would not be finite, it is given later.
  void tell() noexcept {
    const S now = sum();
    const S more = now - told_;
    if (!(more < S(0)) && !(more > S(0))) return;
    if (observer_.shift_load(more) == StepStatus::ok) told_ = now;
  }

  using Path = detail::MeasuredPath<S, Delay>;
  Array<Path, Count> paths_{};
  Array<S, Count> given_{};
  Array<S, Count> last_{};  ///< the last good ones
  Array<int, Count> lost_{};
  int most_lost_;
  [[no_unique_address]] std::conditional_t<varies_time, Pause, NoPause> pause_{};
  S told_{};  ///< the f that is in the estimate
};

/// Distinguishes the type in snapshots.
template <class Observer, int Count, int Delay>
inline constexpr std::uint32_t type_tag<Measured<Observer, Count, Delay>> =
    make_type_tag<Observer>("Measured", Count, Delay);

}  // namespace esokit
