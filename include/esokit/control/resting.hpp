/// @file
/// Resting: a controller that leaves u as it is while y is near enough to the reference.
#pragma once

#include <cstdint>
#include <esokit/control/adrc.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <limits>
#include <type_traits>
#include <utility>

namespace esokit {

/// Around a reference that does not move: where a loop rests.
template <Scalar S = double>
struct Rest {
  S error{};  ///< abs(r - y) up to which it rests, unit of y; 0: never
  S time{};   ///< for which y has to be within it first, s, up to 65535 samples
};

namespace detail {

template <class C>
consteval bool can_rest() {
  constexpr bool holds = requires(C & controller) {
    controller.rest(true);
    controller.update(typename C::S{}, typename C::Reference(typename C::S{}));
  };
  static_assert(holds,
                "esokit: Resting goes around Adrc; PredictiveAdrc, MimoAdrc and "
                "DisturbanceCompensator have no mode in which they rest");
  return holds;
}

}  // namespace detail

/// Config of Resting.
template <class Controller>
requires(detail::can_rest<Controller>()) struct RestingConfig {
  using S = typename Controller::scalar_type;  ///< type of signals and settings

  [[no_unique_address]] ByName<RestingConfig> by_name{};  ///< nothing to set, see ByName
  typename Controller::Config controller{};               ///< config of the controller
  Rest<S> rest{};                                         ///< left out: it never rests
};

/// An Adrc that holds u while y is near the reference: for stiction, encoders of few counts, valves
/// that wear out. Without it such a loop hunts: dhat grows until the axis breaks away, and it
/// stops on the other side.
///
///     auto axis = Resting<Adrc<LinearEso<2>>>::make(
///         {.controller = config, .rest = {.error = 1.5 * count, .time = 0.25}});
///     u = axis->update(y, r);
///
/// It rests (`mode()` is LoopMode::rest) once abs(r - y) was at most `rest.error` for `rest.time`,
/// under a reference that did not change. The observer goes on with the u that is held, so dhat
/// follows the load. It ends with the first sample beyond `rest.error`, with another reference,
/// with `start` and `track`. So it cannot drift away: a load that moves the axis is answered once
/// y has left the band, from an estimate that knows it. A lost sample changes nothing; after
/// `missing.most` u goes to `missing.input` as ever.
///
/// Choose `error` above noise, one and a half counts of an encoder or more, and above the largest
/// error of the hunting: where it sticks outside of the band it hunts on. Half a count and
///
///     1.5 (stiction - Coulomb friction) / (omega_o omega_c)
///
/// are enough, friction in the unit of y''. `time` is about 5 / omega_c, so that what is held is
/// what the load needs. In the band the error is not controlled: without friction the axis drifts
/// to its edge, is answered there, and overshoots it by as much again.
///
/// Around MappedInput give a dead zone a softness of a fourth of its width: of a u that jumps from
/// one side of it to the other, either would be held (examples/actuator).
///
/// `to_c` writes it, too; not in fixed point.
template <class Controller>
requires(detail::can_rest<Controller>()) class Resting {
  using Observer = std::remove_cvref_t<decltype(std::declval<const Controller&>().observer())>;

 public:
  using scalar_type = typename Controller::scalar_type;  ///< type of signals and settings
  using S = scalar_type;                                 ///< the same type
  using Reference = typename Controller::Reference;      ///< r, `{r, r1}` or a vector
  using Config = RestingConfig<Controller>;              ///< settings of make
  static constexpr int order = Controller::order;        ///< n, order of the plant
  static constexpr ControllerTraits traits =
      controller_traits<Controller>;  ///< those of the controller

  /// Checks the settings and does all the design work. @return an error that names the field
  static Expected<Resting, Error<S>> make(const Config& config) {
    static_assert(detail::refuses_packs<S>());
    const auto controller = Controller::make(config.controller);
    if (!controller) return controller.error();
    const Rest<S>& rest = config.rest;
    const S samples = rest.time / controller->sample_time();
    Rules<S> rules;
    rules.not_negative("rest.error", rest.error)
        .not_negative("rest.time", rest.time)
        .demand(rest.error > S(0) || !(rest.time > S(0)), "rest.error", rest.error,
                "must be above 0, or rest.time be left out")
        .demand(samples < S(65535), "rest.time", rest.time, "must be below 65535 samples")
        .demand(!(rest.error > S(0)) || controller->measurement_divider() == 1,
                "measurement_divider", static_cast<S>(controller->measurement_divider()),
                "must be 1 with rest.error");
    if (!rules) return rules.error();
    return Resting(*controller, rest.error, samples);
  }

  /// One sample, as of the controller.
  S update(S y, const Reference& reference) noexcept {
    const Resting before = *this;
    judge(y, reference);
    const S u = controller_.update(y, reference);
    constexpr auto lost = StepStatus::measurement_rejected | StepStatus::outlier_rejected;
    if (!is_finite(y) || !has(controller_.status(), lost)) return u;
    // What the observer does not take, as a spike before an OutlierGate, is no measurement here.
    *this = before;
    judge(std::numeric_limits<S>::quiet_NaN(), reference);
    return controller_.update(y, reference);
  }

  /// One sample whose measurement is missing.
  S update_without_measurement(const Reference& reference) noexcept {
    judge(std::numeric_limits<S>::quiet_NaN(), reference);
    return controller_.update_without_measurement(reference);
  }

  /// Manual operation, see Adrc::track.
  S track(S y, S reference, S u_applied) noexcept {
    leave();
    return controller_.track(y, reference, u_applied);
  }

  /// Something else holds the plant, see Adrc::hold.
  S hold(S y, S reference, S u_applied) noexcept
      requires(observer_traits<Observer>.gates_disturbance) {
    leave();
    return controller_.hold(y, reference, u_applied);
  }

  /// Another b0, see Adrc::set_input_gain.
  Check<S> set_input_gain(const S& b) noexcept
      requires(observer_traits<Observer>.schedules_input_gain) {
    return controller_.set_input_gain(b);
  }

  /// Takes over a plant at rest at y under u, see Adrc::start. @{
  StatusOf<S> start(S y, S u) noexcept { return start(y, u, y); }
  StatusOf<S> start(S y, S u, S reference) noexcept {
    const auto status = controller_.start(y, u, reference);
    if (status == StepStatus::ok) leave();
    return status;
  }
  /// @}

  /// What the actuator held, see Adrc::applied.
  StatusOf<S> applied(S u) noexcept { return controller_.applied(u); }

  /// w[k], see Adrc::measured.
  template <class W>
  void measured(const W& w) noexcept requires(traits.takes_measured) {
    controller_.measured(w);
  }

  /// How much time has passed, see Adrc::elapsed; `rest.time` counts samples.
  Check<S> elapsed(const S& seconds) noexcept requires(traits.varies_time) {
    return controller_.elapsed(seconds);
  }

  /// New settings while running: it goes on to rest, with u within its limits. A refused config
  /// changes nothing.
  Check<S> retune(const Config& config) { return detail::retune(*this, config); }

  /// The same with the settings of `fresh`, as returned by `make`: without design work.
  Check<S> adopt(const Resting& fresh) {
    if (auto ok = controller_.adopt(fresh.controller_); !ok) return ok;
    error_ = fresh.error_;
    samples_ = fresh.samples_;
    return {};
  }

  /// The controller, for its other members.
  [[nodiscard]] const Controller& controller() const noexcept { return controller_; }
  /// Members of the controller.
  /// @{
  [[nodiscard]] const Observer& observer() const noexcept { return controller_.observer(); }
  [[nodiscard]] Observer& observer() noexcept { return controller_.observer(); }
  [[nodiscard]] S sample_time() const noexcept { return controller_.sample_time(); }
  [[nodiscard]] S output() const noexcept { return controller_.output(); }
  [[nodiscard]] const S& requested() const noexcept { return controller_.requested(); }
  [[nodiscard]] const Limiter<S>& limiter() const noexcept { return controller_.limiter(); }
  [[nodiscard]] StatusOf<S> status() const noexcept { return controller_.status(); }
  [[nodiscard]] LoopMode mode() const noexcept { return controller_.mode(); }
  [[nodiscard]] bool too_soon() const noexcept { return controller_.too_soon(); }
  /// @}

 private:
  friend struct detail::LaneAccess;
  friend struct detail::RecordAccess;
  static constexpr int data_members = 5;

  Resting(const Controller& controller, const S& error, const S& samples) noexcept
      : controller_(controller), error_(error), samples_(whole(samples)) {}

  /// Rounded up, but for what the quotient is rounded by.
  static std::uint16_t whole(const S& samples) noexcept {
    const auto below = static_cast<std::uint16_t>(samples);
    const bool more = samples - static_cast<S>(below) > S(1) / S(1024);
    return static_cast<std::uint16_t>(below + (more ? 1 : 0));
  }

  void leave() noexcept {
    controller_.rest(false);
    inside_ = 0;
  }

  void judge(const S& y, const Reference& reference) noexcept {
    if constexpr (traits.varies_time) {
      if (controller_.too_soon()) return;  // no sample: nothing changes
    }
    const bool same = stays(reference);
    if (is_finite(reference(0))) r_ = reference(0);
    const LoopMode mode = controller_.mode();
    const bool acts = mode == LoopMode::running || mode == LoopMode::rest;
    if (!(error_ > S(0)) || !same || !acts) return leave();
    if (is_finite(y)) {
      const S error = detail::wrapped(controller_.observer(), S(r_ - y));
      if (!(detail::absolute(error) <= error_)) return leave();
      if (inside_ <= samples_) ++inside_;
    }
    if (inside_ > samples_) controller_.rest(true);
  }

  /// Whether it is the reference of the last sample and does not move.
  [[nodiscard]] bool stays(const Reference& reference) const noexcept {
    for (int i = 0; i <= order; ++i) {
      const S& now = reference(i);
      const S before = i == 0 ? r_ : S(0);
      if (!is_finite(now) || now < before || now > before) return false;
    }
    return true;
  }

  Controller controller_;
  S error_;
  S r_{};
  std::uint16_t samples_;
  std::uint32_t inside_ = 0;  ///< samples in a row within the band, at most one more than it takes
};

/// Distinguishes the type in snapshots.
template <class Controller>
inline constexpr std::uint32_t type_tag<Resting<Controller>> = make_type_tag<Controller>("Resting");

}  // namespace esokit
