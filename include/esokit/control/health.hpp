/// @file
/// Health of a running loop: counters, and a diagnosis of the likely fault.
#pragma once

#include <cmath>
#include <cstdint>
#include <esokit/control/control_loop.hpp>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/model/sampled_model.hpp>
#include <limits>
#include <type_traits>

namespace esokit {

/// Config of HealthMonitor.
template <PlainScalar S = double>
struct HealthConfig {
  [[no_unique_address]] ByName<HealthConfig> by_name{};  ///< nothing to set, see ByName
  S observer_bandwidth{};  ///< omega_o, rad/s: magnitude of the observer's poles, or their mean
  S sample_time{};         ///< T, s
  S input_range{};         ///< half the range between the limits of the actuator, unit of u; keep
                           ///< it if you narrow the limits of the loop
  S noise{};     ///< standard deviation of the noise of y, unit of y; 0: unknown, no check of the
                 ///< innovation
  S latency{};   ///< s: how much later than in the model of the observer u acts on y^(n), by dead
                 ///< time and lags that it does not have; see HealthMonitor
  S memory = 1;  ///< s: time constant with which old samples are forgotten
  int divider = 4;  ///< D: the regression uses every D-th sample, 1 .. 1000; D omega_o T <= 1
};

/// What a monitor has found. Shares refer to about the last `memory` seconds, those of rejected and
/// of unchanged measurements to at least the last hundred samples. Counts tell of all samples, end
/// at 2^32 - 1, and decide nothing.
template <PlainScalar S = double>
struct Health {
  std::uint32_t samples = 0;   ///< number of samples since the start or `clear`
  std::uint32_t rejected = 0;  ///< measurements that were not finite or outliers
  std::uint32_t bridged = 0;   ///< corrections after a gap, and restarts
  std::uint32_t gated = 0;     ///< samples under less than full trust, see Guarded
  std::uint32_t unsafe = 0;    ///< samples with u not determined by the law: start hold, safe mode
  S lost{};                    ///< share of measurements that were not finite or outliers
  S saturated{};               ///< share of samples at a limit, of magnitude or rate
  S side{};                    ///< share of samples at the upper limit, minus that at the lower
  S bounded{};                 ///< share of samples with dhat at its bound, see Guarded
  S underway{};                ///< share of samples at a limit while y moves where u there drives
                               ///< it, minus that while y moves back
  S innovation{};              ///< rms, unit of y
  S innovation_of_noise{};     ///< rms that the noise alone would cause; 0 if unknown
  S gain_ratio = 1;            ///< rho: estimate of b / b0, see HealthMonitor
  S sign_ratio{};              ///< the same, from large moves of u only; 0 before the first
  S response = 1;              ///< rms of y^(n) over that of phi, see HealthMonitor
  S evidence{};  ///< omega_o times the time in which u moved enough to estimate rho; where some
                 ///< moves outweigh the others, the time that those would need
  S opposed{};   ///< omega_o times the time for which u has been near a limit and y^(n) been
                 ///< against it
  S steady{};    ///< as opposed, with a y^(n) that has not fallen by more than 15 % since then
  S standing{};  ///< share of measurements that equal the one before, see look(controller, y)
  bool reversed = false;  ///< the sign of b0 was found to be wrong, and nothing has contradicted it
};

/// The likely fault of a loop: the first that `diagnose` finds, in this order but for the last,
/// which comes before `saturated`.
enum class LoopFault : unsigned char {
  none,            ///< no fault found
  wrong_sign,      ///< b0 has the wrong sign
  gain_too_small,  ///< b0 is several times too small: the loop gain is too large by that factor
  measurements_rejected,  ///< more than a tenth of the measurements are not finite or outliers
  saturated,             ///< u is at its limits more than half of the time, and y is not on its way
  bounded,               ///< dhat is at its bound more than half of the time
  innovation_too_large,  ///< rms above three times that caused by the noise
  gain_too_large_or_disturbed,  ///< the effect of u is cancelled: b0 is too large, or a load drives
                                ///< u
  sensor_still,                 ///< y does not change while u moves or is at a limit
};

/// Limits of `diagnose`. They were tested on simulated drives with each fault and healthy ones, see
/// examples/guards.
struct HealthLimits {
  double opposed = 4;            ///< omega_o times time; with the next, b0 has the wrong sign
  double sign_ratio = -0.25;     ///< rho of large moves below it: u moved y the wrong way
  double steady = 40;            ///< omega_o times time; with the next, the same of small moves
  double steady_ratio = -0.12;   ///< rho below it
  double wrong_sign = -0.5;      ///< rho below it for evidence_of_sign: the same in other motions
  double evidence_of_sign = 50;  ///< omega_o times time: a load can make rho negative for shorter
  double response = 2.5;         ///< of a u that moves between its limits: b0 is too small
  double too_small = 3;          ///< rho above it: the same in other motions
  double too_large = 0.25;       ///< rho below it; only a hint, because a load has the same effect
  double evidence = 5;           ///< omega_o times time, for the last three
};

namespace detail {

/// Whether the sign of b0 is wrong by what a monitor sees now.
template <PlainScalar S>
[[nodiscard]] constexpr bool sees_wrong_sign(const Health<S>& health,
                                             const HealthLimits& limits) noexcept {
  const auto rho = static_cast<double>(health.gain_ratio);
  const auto evidence = static_cast<double>(health.evidence);
  const auto large = static_cast<double>(health.sign_ratio);
  const bool reversed = large < limits.sign_ratio;
  // Behind a bound dhat does not tell how much: any negative rho has to do.
  const bool behind = static_cast<double>(health.bounded) > 0.02;
  const bool unseen = !(large < 0) && !(large > 0);
  // An old rho is no evidence. Nor is the time of small moves, if one large one makes the rho.
  const bool by_small_moves = unseen && rho < limits.wrong_sign;
  if (!behind && rho < limits.steady_ratio && evidence >= 1 &&
      static_cast<double>(health.steady) >= limits.steady) {
    return true;
  }
  return ((behind ? rho < 0 : reversed) && evidence >= 1 &&
          static_cast<double>(health.opposed) >= limits.opposed) ||
         ((by_small_moves || (reversed && rho < limits.wrong_sign)) &&
          evidence >= limits.evidence_of_sign);
}

}  // namespace detail

/// The likely fault. A wrong sign is remembered (Health::reversed), by the limits given here or by
/// the usual ones. @param health result of a monitor
template <PlainScalar S>
[[nodiscard]] constexpr LoopFault diagnose(const Health<S>& health,
                                           const HealthLimits& limits = {}) noexcept {
  if (health.reversed || detail::sees_wrong_sign(health, limits)) return LoopFault::wrong_sign;
  const auto rho = static_cast<double>(health.gain_ratio);
  const auto response = static_cast<double>(health.response);
  const auto evidence = static_cast<double>(health.evidence);
  const auto saturated = static_cast<double>(health.saturated);
  const auto side = static_cast<double>(health.side);
  const bool swings = saturated > 0.05 && detail::absolute(side) < 0.8 * saturated;
  // A lag delays y^(n): by up to 75 degrees here.
  const bool told = evidence >= limits.evidence;
  if (told &&
      (rho > limits.too_small || (swings && response > limits.response && rho > response / 4))) {
    return LoopFault::gain_too_small;
  }
  if (health.lost > S(1) / S(10)) return LoopFault::measurements_rejected;
  if (static_cast<double>(health.standing) > 0.99 && (saturated > 0.5 || told)) {
    return LoopFault::sensor_still;
  }
  // What y has moved towards is reached: a heater that cools down, an axis on a long way.
  const S stuck = health.underway > S(0) ? health.saturated - health.underway : health.saturated;
  if (stuck > S(1) / S(2)) return LoopFault::saturated;
  if (health.bounded > S(1) / S(2)) return LoopFault::bounded;
  if (health.innovation_of_noise > S(0) && health.innovation > S(3) * health.innovation_of_noise) {
    return LoopFault::innovation_too_large;
  }
  if (told && rho < limits.too_large) return LoopFault::gain_too_large_or_disturbed;
  return LoopFault::none;
}

namespace detail {

/// Order of the actuator's lag that a model simulates.
template <class Model>
inline constexpr int simulated_lag = 0;
template <class Model>
requires(model_traits<Model>.tells_constant) inline constexpr int simulated_lag<Model> =
    Model::parts.actuator;

}  // namespace detail

/// Watches a loop of one input: `look(controller)` after each sample.
///
/// For y^(n) = d + b u an observer with b0 finds dhat = d + (b - b0) u, filtered by its own poles.
/// So the part of dhat that is proportional to phi, which is b0 u filtered by the same poles, has
/// the factor (b - b0) / b0, and
///
///     rho = 1 + sum phi psi / sum phi^2,   psi = dhat, both high-passed at omega_o / 3
///
/// is b / b0 if u moves because of a reference. If u reacts to a load, dhat is -phi and rho tends
/// to 0: so a small rho alone proves nothing. Nor does a negative one: u reacts to a load late, and
/// lags, friction and noise add to that, so that a load step on a healthy loop makes rho negative
/// for a while. A sample counts if abs(phi) is above 2 % of b0 times the input range and above the
/// noise of dhat. Its measurement must be good, the law determine u, and no guard gate or bound
/// dhat. The sums forget with the time constant `memory`.
///
/// Two rules for the sign therefore ask for more. Where u comes from a loop, a wrong sign drives it
/// to a limit, where it stays. `opposed` is the time for which both phi and phi delayed by
/// 3 / omega_o are beyond 0.9 of the way to a limit, and y^(n) = phi + dhat has the other sign. A
/// load, or a machine that falls back to its own rest (dhat contains -a y), does the same to a
/// healthy loop. So u must also have been seen to move y the wrong way: `sign_ratio`, which is rho
/// from moves beyond 0.3 of the range of u (0.2 for order 2 and above), is below -0.25. Unless it
/// is below -0.5, also y^(n) is against u by 0.3 of what it says. Only a load that jumps by as much
/// as u at the same time fakes that. Where u moved less, y^(n) has to stay against it for long
/// without falling (`steady`), which a machine on its way to its rest does not do. A detached
/// actuator has a rho of zero; under loads of half its range one of ten is named. If u is not at a
/// limit, for example in manual operation, rho has to be below -0.5 for long. (Where dhat is at its
/// bound, the sign of the innovation stands for that of y^(n), and any negative rho counts.) A
/// machine that runs into a stop before both are true is not found. One that bounces between stops
/// may be named wrongly.
///
/// Once found, a wrong sign stays (`reversed`): after the runaway u stands at a limit and proves
/// nothing more. The way out is `clear`, or u that moves y the right way: sign_ratio above
/// 0.25, with the evidence that other faults need, and u mostly off its limits.
///
/// A lag reduces rho: if b0 is too small, the loop oscillates at about omega_o, where a lag of
/// 3 / omega_o attenuates y^(n) to a third and delays it by 70 degrees. `response`, the ratio of
/// the rms of y^(n) and phi, both high-passed, does not depend on that delay. A load raises it,
/// too: it tells of b0 only in a loop that moves u between both limits.
///
/// u at a limit is no fault while y moves where u drives it there: a heater that cools down by
/// itself at u = 0, an axis on a long way. `underway` is the share of that. Where y stands, or
/// moves the other way, `saturated` is named.
///
/// A dead time or lag that the observer does not have delays the effect of u: until then it seems
/// cancelled, and from about 3 / omega_o on a start was named `gain_too_large_or_disturbed`. With
/// `latency` the poles that filter phi have its delay, too: they are at omega_m = omega_o /
/// (1 + omega_o latency / N), which stands for omega_o in all times above. So faults need slower
/// moves to be named, and rho holds for moves that are slow against omega_m.
///
/// With a model (ModelEso) psi is d only, and with an actuator's lag phi is b0 v, from the
/// simulated output of the actuator.
/// @tparam Size number of poles that filter phi: N of the observer, minus the order of an
/// actuator's lag
template <int Size, class S = double>
requires(detail::is_a_plain_scalar<S>()) class HealthMonitor {
  static_assert(Size >= 2, "esokit: an observer has at least two states");

 public:
  using scalar_type = S;           ///< type of signals and settings
  using Config = HealthConfig<S>;  ///< settings of make

  /// Checks the settings. @return the monitor, or an error that names the field
  static Expected<HealthMonitor, Error<S>> make(const Config& config) {
    Rules<S> rules;
    rules.positive("observer_bandwidth", config.observer_bandwidth)
        .positive("sample_time", config.sample_time)
        .positive("input_range", config.input_range)
        .not_negative("noise", config.noise)
        .not_negative("latency", config.latency)
        .positive("memory", config.memory)
        .demand(1 <= config.divider && config.divider <= 1000, "divider",
                static_cast<S>(config.divider), "must be 1 .. 1000");
    if (!rules) return rules.error();
    const S step = config.sample_time * static_cast<S>(config.divider);
    rules
        .demand(detail::at_most(S(config.observer_bandwidth * step), S(1)),
                {"divider", static_cast<S>(config.divider),
                 "is too large: omega_o T D must be at most", -1, S(1), true})
        .demand(detail::at_most(S(S(8) / config.observer_bandwidth), config.memory),
                {"memory", config.memory, "must be at least 8 / omega_o, that is", -1,
                 S(8) / config.observer_bandwidth, true})
        .demand(detail::at_most(S(S(8) / config.observer_bandwidth +
                                  S(8) * config.latency / static_cast<S>(Size)),
                                config.memory),
                {"latency", config.latency,
                 "is too large: memory must be at least 8 / omega_o + 8 latency / N, that is", -1,
                 S(8) / config.observer_bandwidth + S(8) * config.latency / static_cast<S>(Size),
                 true});
    if (!rules) return rules.error();
    return HealthMonitor(config);
  }

  /// Call this after each sample of the controller, an Adrc or DisturbanceCompensator whose
  /// observer corrects `Size` states. Where something behind the law limits u, say what goes out by
  /// `applied` before: a limit there counts as one of the loop. What an actuator reports of the
  /// sample before is said before `update`, as always.
  template <class Controller>
  void look(const Controller& controller) noexcept {
    watch(controller);
    remember_sign();
  }

  /// The same, and watches the sensor: y is named `sensor_still` if for five times the memory each
  /// good measurement equals the one before, while u moves or is at a limit. A machine that is held
  /// by a stop or by friction, and a sensor too coarse for its motion, look the same.
  /// @param y the measurement that this sample's update was given
  template <class Controller>
  void look(const Controller& controller, const S& y) noexcept {
    const StepStatus status = controller.status();
    if (is_finite(y) && controller.observer().missed() == 0 &&
        !has(status, StepStatus::measurement_rejected) &&
        !has(status, StepStatus::outlier_rejected)) {
      health_.standing = nearer(health_.standing, y == last_ ? S(1) : S(0), rare_weight());
      last_ = y;
    }
    look(controller);
  }

  /// The counters and estimates.
  [[nodiscard]] const Health<S>& health() const noexcept { return health_; }

  /// Clears everything, for example after a change of the design.
  void clear() noexcept {
    const S of_noise = health_.innovation_of_noise;
    *this = HealthMonitor(*this, of_noise);
  }

 private:
  friend struct detail::RecordAccess;

  template <class Controller>
  void watch(const Controller& controller) noexcept {
    const auto& observer = controller.observer();
    using Observer = std::remove_cvref_t<decltype(observer)>;
    const auto& model = observer.model();
    using Model = std::remove_cvref_t<decltype(model)>;
    constexpr bool tells = model_traits<Model>.tells_constant;
    constexpr int lag = detail::simulated_lag<Model>;
    static_assert(Observer::size - lag == Size,
                  "esokit: Size of the monitor must be the number of states of the observer, minus "
                  "those of an actuator in its model");
    S b = observer.input_gain();
    if constexpr (lag > 0) b = model.plant_gain();
    bool gated = false;
    bool bounded = false;
    if constexpr (observer_traits<Observer>.schedules_input_gain) {
      b = observer.present_input_gain();
      gated = observer.gated();
      bounded = observer.bounded();
    }
    S innovation{};
    if constexpr (requires { observer.innovation(); }) innovation = observer.innovation();
    const bool runs = controller.mode() == LoopMode::running;
    const StepStatus status = controller.status();
    const bool rejected =
        has(status, StepStatus::measurement_rejected) || has(status, StepStatus::outlier_rejected);
    const S beyond = controller.requested() - controller.limiter().last();
    const S hair = static_cast<S>(1e-4) * range_;
    const int above = beyond > hair ? 1 : 0;
    const int below = beyond < -hair ? 1 : 0;
    const int limit = runs ? above - below : 0;
    count(status, rejected, runs, gated, bounded, limit);
    follow(observer.template estimate<0>(), b < S(0) ? -limit : limit);
    if (observer.missed() == 0 && !rejected) average(innovation);
    lost_ = lost_ || rejected;
    free_ = free_ && runs && !gated;
    phi_sum_ = phi_sum_ + b * detail::effect_of(observer, S(observer.applied_input()));
    if (++phase_ < divider_) return;
    phase_ = 0;
    S phi = phi_sum_ / static_cast<S>(divider_);
    S psi = observer.total_disturbance();
    if constexpr (tells) {
      const auto z = observer.estimate();
      psi = model.disturbance(z);
      if constexpr (lag > 0) phi = model.delivered(z);
    }
    phi_sum_ = S(0);
    // Between measurements dhat is as old as the last one.
    const bool lost = lost_ || observer.missed() >= divider_;
    const bool free = free_;
    lost_ = false;
    free_ = true;
    const S range = detail::absolute(b) * range_;
    if (!filter(phi, psi, range)) return;
    if (!free) health_.opposed = health_.steady = S(0);
    if (!free || lost) {
      forget();
      return;
    }
    oppose(b * detail::effect_of(observer, middle(controller.limiter())), psi, bounded, range,
           innovation);
    regress(range, !bounded);
  }

  explicit HealthMonitor(const Config& config) noexcept
      : range_(config.input_range), divider_(config.divider) {
    const S x = config.observer_bandwidth * config.sample_time;
    // Size poles whose delay is that of the observer and the latency.
    const S late = S(1) + config.observer_bandwidth * config.latency / static_cast<S>(Size);
    const S step = x * static_cast<S>(divider_) / late;
    pole_ = std::exp(-step);
    slow_ = -std::expm1(-step / S(3));
    const S samples = config.memory / config.sample_time;
    weight_ = S(1) / samples;
    forget_ = std::exp(-static_cast<S>(divider_) / samples);
    step_ = step;
    noise_of_noise(config, std::exp(-x));
  }
  HealthMonitor(const HealthMonitor& settings, const S& of_noise) noexcept
      : range_(settings.range_),
        divider_(settings.divider_),
        pole_(settings.pole_),
        slow_(settings.slow_),
        weight_(settings.weight_),
        forget_(settings.forget_),
        step_(settings.step_),
        least_(settings.least_) {
    health_.innovation_of_noise = of_noise;
  }

  /// Computes the rms of innovation and dhat for white noise in y from the impulse responses. The
  /// innovation passes ((z-1)/(z-r))^N; for dhat n of the N differences are divided by T, and there
  /// is one more pole.
  void noise_of_noise(const Config& config, S r) noexcept {
    if (!(config.noise > S(0))) return;
    Array<S, Size> innovation{};
    Array<S, Size> disturbance{};
    S sum_e{};
    S sum_d{};
    Array<S, Size> before_e{};
    Array<S, Size> before_d{};
    const S x = config.observer_bandwidth * config.sample_time;
    const int length = static_cast<int>((std::min)(S(40 * Size) / x, S(100000))) + 2;
    for (int k = 0; k < length; ++k) {
      S e = k == 0 ? S(1) : S(0);
      S d = e;
      for (std::size_t i = 0; i < Size; ++i) {
        innovation[i] = r * innovation[i] + e - before_e[i];
        before_e[i] = e;
        e = innovation[i];
        // For m = 1 all stages but one are differences.
        disturbance[i] = r * disturbance[i] +
                         (S(1) - r) * (i + 1 < Size ? (d - before_d[i]) / config.sample_time : d);
        before_d[i] = d;
        d = disturbance[i];
      }
      sum_e = sum_e + e * e;
      sum_d = sum_d + d * d;
    }
    health_.innovation_of_noise = config.noise * std::sqrt(sum_e);
    least_ = config.noise * std::sqrt(sum_d);
    if (!is_finite(least_)) least_ = S(0);
  }

  void count(StepStatus status, bool rejected, bool runs, bool gated, bool bounded,
             int limit) noexcept {
    const auto one_more = [](std::uint32_t& of, bool now) {
      if (now && of < (std::numeric_limits<std::uint32_t>::max)()) ++of;
    };
    one_more(health_.samples, true);
    one_more(health_.rejected, rejected);
    one_more(health_.bridged,
             has(status, StepStatus::gap_bridged) || has(status, StepStatus::restarted));
    one_more(health_.gated, gated);
    one_more(health_.unsafe, !runs);
    health_.lost = nearer(health_.lost, rejected ? S(1) : S(0), rare_weight());
    const auto share = [this](S& of, int now) { of = nearer(of, static_cast<S>(now), weight_); };
    share(health_.saturated, limit != 0 ? 1 : 0);
    share(health_.side, limit);
    share(health_.bounded, bounded ? 1 : 0);
  }

  /// Whether y moves where u at a limit drives it, by its mean over an eighth of `memory`: as its
  /// sign, so that noise has none. @param drives sign of b0 u there, or 0
  void follow(const S& y, int drives) noexcept {
    S moved = y - slow_y_;
    if (!is_finite(moved)) {
      slow_y_ = y;
      moved = S(0);
    }
    slow_y_ = nearer(slow_y_, y, quick_weight());
    const int way = moved > S(0) ? drives : moved < S(0) ? -drives : 0;
    health_.underway = nearer(health_.underway, static_cast<S>(way), weight_);
  }

  static constexpr S nearer(const S& share, const S& now, const S& weight) noexcept {
    return share + weight * (now - share);
  }

  /// The weight of a sample where a few must not decide.
  [[nodiscard]] constexpr S rare_weight() const noexcept {
    constexpr S most = S(1) / S(100);
    return weight_ < most ? weight_ : most;
  }

  [[nodiscard]] constexpr S quick_weight() const noexcept { return S(8) * weight_; }

  void remember_sign() noexcept {
    constexpr HealthLimits limits{};
    if (detail::sees_wrong_sign(health_, limits)) {
      health_.reversed = true;
    } else if (static_cast<double>(health_.sign_ratio) > -limits.sign_ratio &&
               static_cast<double>(health_.saturated) < 0.05 &&
               static_cast<double>(health_.evidence) >= limits.evidence) {
      health_.reversed = false;
    }
  }

  void average(const S& innovation) noexcept {
    const S square = innovation * innovation;
    // A single absurd sample must not make the mean infinite.
    if (!is_finite(square) || !(square < largest_square())) return;
    mean_square_ = mean_square_ + weight_ * (square - mean_square_);
    health_.innovation = std::sqrt(mean_square_);
  }

  /// A sole integrator is moved by u at once; behind two or more u moves less and sooner turns.
  static constexpr S large_move = static_cast<S>(Size > 2 ? 0.2 : 0.3);

  static constexpr S larger(const S& a, const S& b) noexcept { return a < b ? b : a; }

  static constexpr S largest_square() noexcept {
    return (std::numeric_limits<S>::max)() * static_cast<S>(1e-6);
  }

  /// The u in the middle between the limits; if they are further apart, the nearest to zero that
  /// keeps the range from them.
  [[nodiscard]] S middle(const Limiter<S>& limiter) const noexcept {
    const S lowest = limiter.lower() + range_;
    const S highest = limiter.upper() - range_;
    return lowest > S(0) ? lowest : highest < S(0) ? highest : S(0);
  }

  /// phi by the poles of the observer, and the slow means.
  /// @return false for what no real u or plant causes: the sums would remember it for long
  bool filter(const S& phi, const S& psi, const S& range) noexcept {
    const S most = S(1000) * range;
    if (health_.samples == static_cast<std::uint32_t>(divider_)) {
      // The first: whatever u and load are, they are no move. At rest they cancel.
      for (S& stage : stages_) stage = -psi;
      slow_phi_ = -psi;
      slow_psi_ = psi;
    }
    S filtered = phi;
    for (S& stage : stages_) {
      stage = filtered + pole_ * (stage - filtered);
      filtered = stage;
    }
    slow_phi_ = slow_phi_ + slow_ * (filtered - slow_phi_);
    slow_psi_ = slow_psi_ + slow_ * (psi - slow_psi_);
    phi_ = filtered;
    x_ = filtered - slow_phi_;
    y_ = psi - slow_psi_;
    if (detail::absolute(x_) < most && detail::absolute(y_) < most &&
        is_finite(x_ * x_ + y_ * y_ + sum_xx_ + sum_aa_)) {
      return true;
    }
    for (S& stage : stages_) stage = S(0);
    slow_y_ = std::numeric_limits<S>::quiet_NaN();
    slow_phi_ = slow_psi_ = sum_x_ = sum_xx_ = sum_xy_ = sum_aa_ = S(0);
    large_xx_ = large_xy_ = top_ = health_.opposed = health_.steady = S(0);
    return false;
  }

  /// Counts the time for which y^(n) is against u near its limit. @param middle b0 u between them
  void oppose(const S& middle, const S& psi, bool bounded, const S& range,
              const S& innovation) noexcept {
    const S end = static_cast<S>(0.9) * range;
    const S now = phi_ - middle;
    const S late = slow_phi_ - middle;
    const S side = now > end && late > end ? S(1) : now < -end && late < -end ? S(-1) : S(0);
    const S against = -side * (bounded ? innovation : phi_ + psi);
    S least = larger(static_cast<S>(0.02) * range, S(3) * least_);
    if (!(against > least)) top_ = S(0);
    top_ = larger(top_, against);
    health_.steady =
        against > least && against > static_cast<S>(0.85) * top_ ? health_.steady + step_ : S(0);
    // By a share of what sign_ratio says, unless that is clear: a load helps a machine back, too.
    if (health_.sign_ratio > S(-1) / S(2)) {
      least = larger(least, static_cast<S>(-0.3) * health_.sign_ratio * range);
    }
    if (bounded) least = S(0);
    health_.opposed = against > least ? health_.opposed + step_ : S(0);
  }

  void forget() noexcept {
    sum_x_ = forget_ * sum_x_;
    sum_xx_ = forget_ * sum_xx_;
    sum_xy_ = forget_ * sum_xy_;
    sum_aa_ = forget_ * sum_aa_;
    large_xx_ = forget_ * large_xx_;
    large_xy_ = forget_ * large_xy_;
    health_.evidence = forget_ * health_.evidence;
  }

  void regress(const S& range, bool counts) noexcept {
    forget();
    const S size = detail::absolute(x_);
    if (!counts || !(size > static_cast<S>(0.02) * range && size > least_)) return;
    sum_x_ = sum_x_ + size;
    sum_xx_ = sum_xx_ + x_ * x_;
    sum_xy_ = sum_xy_ + x_ * y_;
    const S a = x_ + y_;
    sum_aa_ = sum_aa_ + a * a;
    health_.evidence = step_ * (sum_x_ * (sum_x_ / sum_xx_));
    const S quotient = sum_xy_ / sum_xx_;
    const S square = sum_aa_ / sum_xx_;
    if (!is_finite(quotient) || !is_finite(square)) return;
    health_.gain_ratio = S(1) + quotient;
    health_.response = std::sqrt(square);
    if (!(size > large_move * range)) return;
    large_xx_ = large_xx_ + x_ * x_;
    large_xy_ = large_xy_ + x_ * y_;
    health_.sign_ratio = S(1) + large_xy_ / large_xx_;
  }

  S range_;
  int divider_;
  S pole_;     ///< pole of the filter of phi, at the divided rate
  S slow_;     ///< pole of the slow mean that is subtracted
  S weight_;   ///< weight of a sample in a share
  S forget_;   ///< forgetting factor of the sums, at the divided rate
  S step_;     ///< omega_o T D
  S least_{};  ///< smallest phi that counts
  int phase_ = 0;
  S phi_sum_{};
  Array<S, Size> stages_{};
  S slow_phi_{};
  S slow_psi_{};
  S sum_x_{};  ///< of magnitudes
  S sum_xx_{};
  S sum_xy_{};
  S sum_aa_{};
  S large_xx_{};  ///< of large moves
  S large_xy_{};
  S top_{};            ///< largest y^(n) against u since it is
  S phi_{};            ///< filtered
  S x_{};              ///< and high-passed
  S y_{};              ///< psi, high-passed
  bool lost_ = false;  ///< a measurement since the last sum
  bool free_ = true;   ///< the law determined u since then, and no guard dhat
  S mean_square_{};
  S last_ = std::numeric_limits<S>::quiet_NaN();    ///< measurement
  S slow_y_ = std::numeric_limits<S>::quiet_NaN();  ///< mean of its estimate
  Health<S> health_{};
};

/// Distinguishes the type in snapshots.
template <int Size, PlainScalar S>
inline constexpr std::uint32_t type_tag<HealthMonitor<Size, S>> = make_type_tag<S>("HealthMonitor",
                                                                                   Size);

}  // namespace esokit
