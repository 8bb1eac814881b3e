/// @file
/// The common base of all adapters of observers. An adapter contains an observer and does not
/// derive from it.
#pragma once

#include <esokit/observer/concepts.hpp>

namespace esokit {

namespace detail {

/// p, if the observer has it.
template <class Observer>
struct LevelsOf {};
template <class Observer>
requires requires {
  { Observer::levels } -> std::convertible_to<int>;
}
struct LevelsOf<Observer> {
  static constexpr int levels = Observer::levels;  ///< p
};

/// m, if the observer has it.
template <class Observer>
struct ExtensionOf {};
template <class Observer>
requires requires {
  { Observer::extension } -> std::convertible_to<int>;
}
struct ExtensionOf<Observer> {
  static constexpr int extension = Observer::extension;  ///< m, extended states
};

/// Of the config of an adapter: whether it goes around Guarded, too, and has its members.
template <class Settings>
inline constexpr bool goes_around_guards = false;

}  // namespace detail

/// Base of the adapters: forwards the members of the observer whose result no adapter changes. An
/// adapter adds make, retune, update, predict, correct and reset, redefines members whose result
/// differs, and deletes those that it cannot offer.
template <class Observer>
requires(detail::goes_into_a_loop<Observer>()) class Adapter
    : public detail::LevelsOf<Observer>,
      public detail::ExtensionOf<Observer> {
  friend struct detail::GuardAccess;
  friend struct detail::LaneAccess;

 public:
  using Adapted = Observer;                            ///< what is adapted
  using scalar_type = typename Observer::scalar_type;  ///< type of states and settings
  using Estimate = typename Observer::Estimate;        ///< (y, .., y^(n-1), d, ..), N x 1
  static constexpr int order = Observer::order;        ///< n, order of the plant
  static constexpr int size = Observer::size;          ///< N

  /// The traits of the adapted observer that also hold for an adapter.
  static constexpr ObserverTraits traits = [] {
    ObserverTraits traits = observer_traits<Observer>;
    traits.adapts = true;
    traits.is_predictable = false;
    traits.gates_outliers = false;
    traits.blanks_estimate = false;
    return traits;
  }();

  /// The adapted observer, for its other members.
  [[nodiscard]] constexpr const Observer& observer() const noexcept { return observer_; }

  /// Members of the adapted observer, see PredictorCorrector.
  /// @{
  [[nodiscard]] constexpr Estimate estimate() const noexcept { return observer_.estimate(); }
  template <int Row>
  [[nodiscard]] constexpr scalar_type estimate() const noexcept {
    return observer_.template estimate<Row>();
  }
  [[nodiscard]] constexpr scalar_type total_disturbance() const noexcept {
    return observer_.total_disturbance();
  }
  [[nodiscard]] constexpr scalar_type applied_input() const noexcept {
    return observer_.applied_input();
  }
  [[nodiscard]] constexpr scalar_type input_gain() const noexcept { return observer_.input_gain(); }
  [[nodiscard]] constexpr scalar_type sample_time() const noexcept {
    return observer_.sample_time();
  }
  [[nodiscard]] constexpr Lanes<int, scalar_type> missed() const noexcept {
    return observer_.missed();
  }
  [[nodiscard]] constexpr int max_gap() const noexcept { return observer_.max_gap(); }
  [[nodiscard]] constexpr Estimate equilibrium(const scalar_type& y,
                                               const scalar_type& u) const noexcept {
    return observer_.equilibrium(y, u);
  }

  [[nodiscard]] constexpr int longest_gap() const noexcept requires requires(const Observer& o) {
    o.longest_gap();
  }
  { return observer_.longest_gap(); }
  [[nodiscard]] constexpr auto recovering() const noexcept requires requires(const Observer& o) {
    o.recovering();
  }
  { return observer_.recovering(); }
  [[nodiscard]] constexpr bool restarts() const noexcept requires RestartingObserver<Observer> {
    return observer_.restarts();
  }
  [[nodiscard]] constexpr Estimate level_estimate(int level) const noexcept requires
      LevelledObserver<Observer> {
    return observer_.level_estimate(level);
  }
  [[nodiscard]] constexpr const auto& predicted_measurement() const noexcept
      requires(!observer_traits<Observer>.measures_first_row) {
    return observer_.predicted_measurement();
  }
  constexpr StepStatus shift_output(const scalar_type& offset) noexcept requires
      ShiftableOutput<Observer> {
    return observer_.shift_output(offset);
  }
  constexpr StepStatus shift_disturbance(const scalar_type& offset) noexcept requires
      ShiftableDisturbance<Observer> {
    return observer_.shift_disturbance(offset);
  }
  constexpr StepStatus shift_load(const scalar_type& offset) noexcept requires
      ShiftableLoad<Observer> {
    return observer_.shift_load(offset);
  }
  [[nodiscard]] constexpr scalar_type innovation() const noexcept requires
      requires(const Observer& o) {
    o.innovation();
  }
  { return observer_.innovation(); }
  template <int Row>
  [[nodiscard]] ESOKIT_INLINE constexpr scalar_type scaled_estimate() const noexcept requires
      requires(const Observer& o) {
    o.template scaled_estimate<Row>();
  }
  { return observer_.template scaled_estimate<Row>(); }
  [[nodiscard]] constexpr const auto& model() const noexcept requires requires(const Observer& o) {
    o.model();
  }
  { return observer_.model(); }
  [[nodiscard]] constexpr auto level_gain(int level) const noexcept requires
      requires(const Observer& o) {
    o.level_gain(0);
  }
  { return observer_.level_gain(level); }
  StepStatus revise_input(const scalar_type& u_applied) noexcept requires
      requires(Observer& o, const scalar_type& s) {
    o.revise_input(s);
  }
  { return observer_.revise_input(u_applied); }
  void rearm() noexcept requires requires(Observer& o) { o.rearm(); }
  { observer_.rearm(); }
  Check<scalar_type> set_speed(const scalar_type& factor) noexcept requires
      requires(Observer& o, const scalar_type& s) {
    o.set_speed(s);
  }
  { return observer_.set_speed(factor); }
  /// @}

  /// Members of an adapter inside.
  /// @{
  [[nodiscard]] scalar_type wrap(const scalar_type& angle) const noexcept
      requires(observer_traits<Observer>.wraps_output) {
    return observer_.wrap(angle);
  }
  void fill_input(const scalar_type& u) noexcept requires(observer_traits<Observer>.delays_input) {
    observer_.fill_input(u);
  }
  template <class W>
  void measured(const W& w) noexcept requires(observer_traits<Observer>.takes_measured) {
    observer_.measured(w);
  }
  void revise_measured() noexcept requires(observer_traits<Observer>.takes_measured) {
    observer_.revise_measured();
  }
  void settle_measured() noexcept requires(observer_traits<Observer>.takes_measured) {
    observer_.settle_measured();
  }
  Check<scalar_type> set_step_time(const scalar_type& seconds) noexcept
      requires(observer_traits<Observer>.varies_time) {
    return observer_.set_step_time(seconds);
  }
  Expected<int, Error<scalar_type>> elapsed(const scalar_type& seconds) noexcept
      requires(observer_traits<Observer>.varies_time) {
    return observer_.elapsed(seconds);
  }
  [[nodiscard]] const scalar_type& step_time() const noexcept
      requires(observer_traits<Observer>.varies_time) {
    return observer_.step_time();
  }
  [[nodiscard]] bool bridges(int steps) const noexcept
      requires(observer_traits<Observer>.varies_time) {
    return observer_.bridges(steps);
  }
  /// @}

 protected:
  static constexpr int data_members = 1;  ///< of this base
  using HoldsMembers = Adapter;           ///< the class that has them

  /// Stores a copy.
  explicit constexpr Adapter(const Observer& observer) noexcept : observer_(observer) {}

  [[no_unique_address]] Observer observer_;  ///< its padding may hold other members

  // Last, because after a failed assertion the members below it would be missing in derived
  // classes.
  static_assert(!observer_traits<Observer>.maps_input,
                "esokit: MappedInput must be the outermost adapter, also of Guarded");
};

/// Base of the adapters with a config: `make`, `retune`, `adopt`, and members that most adapters
/// forward. An adapter has `check(config)`, which returns a Check, a constructor from `(observer,
/// config)`, and `take(fresh)`, which takes over its own settings once the observer has taken over
/// its own. If they may be refused, it is `take(fresh, before)`, which returns a Check and is
/// called of a copy. `before` is the adapter with all its old settings.
/// @tparam Self the adapter @tparam Settings its Config
template <class Self, LoopObserver Observer, class Settings>
class NamedAdapter : public Adapter<Observer> {
  using Base = Adapter<Observer>;

 public:
  using Config = Settings;                         ///< settings of make
  using scalar_type = typename Base::scalar_type;  ///< type of states and settings
  using Estimate = typename Base::Estimate;        ///< (y, .., y^(n-1), d, ..), N x 1

  /// Checks the settings and does all the design work.
  /// @return the adapter, with its observer at rest at zero, or an error that names the field
  static Expected<Self, Error<scalar_type>> make(const Config& config) {
    static_assert(detail::refuses_packs<scalar_type>());
    if (Check<scalar_type> ok = Self::validate(config); !ok) return ok.error();
    const auto observer = Observer::make(config.observer);
    if (!observer) return observer.error();
    return Self(*observer, config);
  }

  /// New settings while running: the estimate is kept. A refused config changes nothing.
  Check<scalar_type> retune(const Config& config) {
    return detail::retune(static_cast<Self&>(*this), config);
  }

  /// The same with the settings of `fresh`, as returned by `make`: without design work.
  Check<scalar_type> adopt(const Self& fresh) {
    Self& self = static_cast<Self&>(*this);
    if constexpr (requires { self.take(fresh, self); }) {
      Self next = self;
      if (auto ok = next.observer_.adopt(fresh.observer_); !ok) return ok;
      if (auto ok = next.take(fresh, self); !ok) return ok;
      self = next;
    } else {
      if (auto ok = self.observer_.adopt(fresh.observer_); !ok) return ok;
      self.take(fresh);
    }
    return {};
  }

  /// Time update only, see PredictorCorrector::predict.
  StatusOf<scalar_type> predict(scalar_type u_applied) noexcept {
    return this->observer_.predict(u_applied);
  }

  /// Measurement update only, see PredictorCorrector::correct.
  StatusOf<scalar_type> correct(scalar_type y) noexcept { return this->observer_.correct(y); }

  /// Restarts at (y, 0, .., 0).
  StatusOf<scalar_type> reset(scalar_type y) noexcept { return this->observer_.reset(y); }

  /// Restarts at a given estimate, N x 1.
  StatusOf<scalar_type> reset(const Estimate& state) noexcept {
    return this->observer_.reset(state);
  }

 protected:
  using Base::Base;

  static_assert(detail::goes_around_guards<Settings> ||
                    !observer_traits<Observer>.schedules_input_gain,
                "esokit: Guarded must be the outermost adapter");
};

}  // namespace esokit
