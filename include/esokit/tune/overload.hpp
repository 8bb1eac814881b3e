/// @file
/// Simulates a controller on the plant of a model, with limits and noise: does the loop recover
/// from an overload, or does it oscillate between the limits for ever?
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/control/detail/softening.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/sim/gaussian.hpp>
#include <esokit/tune/specification.hpp>
#include <functional>
#include <vector>

namespace esokit {

/// What happens to a loop that is simulated.
enum class OverloadKind : unsigned char {
  load,  ///< a load for some time
  kick,  ///< all at once, what half the range of u does in this time to y^(n-1)
  step   ///< of the reference, as far as half the range of u moves the chain in this time
};

/// An event, in units of the model.
struct Overload {
  OverloadKind kind{};     ///< what it is
  double share = 1.0;      ///< of half the range of u
  double latencies = 0.0;  ///< multiples of TuneModel::latency
};

/// The events that a recommended design recovers from.
inline constexpr std::array<Overload, 4> overloads{{{OverloadKind::load, 1.5, 10.0},
                                                    {OverloadKind::load, 1.5, 100.0},
                                                    {OverloadKind::kick, 1.0, 30.0},
                                                    {OverloadKind::step, 1.0, 30.0}}};

/// How a loop came through an event.
struct OverloadOutcome {
  bool counts = true;   ///< false: even the best controller would be lost
  bool back = false;    ///< y is near its reference again, and u off its limits
  double time = 0.0;    ///< s from the end of the event until then, or as long as was waited
  double peak = 0.0;    ///< largest abs(y - r)
  double beyond = 0.0;  ///< largest y - r beyond a step of the reference, share of the step
};

/// A law that softens at its limits, for a controller that is simulated: what Softening needs to
/// know.
struct SofteningLaw {
  std::vector<double> gains{};          ///< k_0 ..; none: the linear law
  double input_gain = 1.0;              ///< of the law
  DynamicMatrix<double> to_estimate{};  ///< as in LinearObserverForm, with the controller's states
  DynamicMatrix<double> y_to_estimate{};  ///< as in LinearObserverForm
};

/// Friction that is simulated where it is not known, shares of what half the range of u makes of
/// y'' in ten latencies.
inline constexpr std::array<double, 5> friction_shares{0.05, 0.1, 0.15, 0.2, 0.25};

/// The plants that a design is simulated on: the model, what its intervals allow, and for order 3
/// the model with friction.
std::vector<detail::PlantVariant> simulated_variants(const TuneModel& model);

/// The events with friction: also what moves y so little that it sticks.
inline constexpr std::array<Overload, 3> friction_overloads{{{OverloadKind::load, 0.5, 10.0},
                                                             {OverloadKind::load, 1.0, 10.0},
                                                             {OverloadKind::step, 1.0, 30.0}}};

/// The events of one of these plants.
std::vector<Overload> overloads_of(const TuneModel& variant);

/// Order 3: whether friction, however small, makes the loop oscillate for ever. On a motion of y'
/// of amplitude A friction f acts as a damping 4 f / (pi A) (describing function), so the loop has
/// to be stable with any. Searched from 1 / 100 to 3000 per TuneModel::latency.
bool oscillates_with_friction(const TuneModel& model, const LinearController& controller);

namespace detail {

/// The form that is given the applied u, of a controller that takes its own u for it: within limits
/// the two differ.
LinearController given_input_form(const LinearController& own);

/// u of the softened law, from u of the linear one, y, r and the states; empty for a linear law.
using SoftenedInput =
    std::function<double(double u, double y, double r, const std::vector<double>& z)>;

/// A controller and a plant within limits, sample by sample.
class LimitedLoop {
 public:
  LimitedLoop(const TuneModel& model, double gain, const LinearController& given, double half,
              const SofteningLaw& law = {});

  [[nodiscard]] double output() const;

  /// One sample. @param y as measured @param d unit of y^(n) @param more added to u, for the
  /// derivatives of r (not softened) @return u
  double operator()(double y, double r, double d, double more = 0.0);

 private:
  /// x += a x + input
  template <class Input>
  void advance(std::vector<double>& x, const DynamicMatrix<double>& a, const Input& input);

  /// Coulomb friction over the sample, which takes from y' what it can, and from y half a sample
  /// of it.
  void rub();

  SampledPlant plant_;
  LinearController c_;
  double half_, rub_ = 0.0, slid_ = 0.0;
  std::vector<double> x_, z_, next_, held_;
  std::size_t at_ = 0;
  SoftenedInput soften_;
};

}  // namespace detail

/// How far an event goes: what its share of half the range of u moves the chain in its time; of
/// order 1 at most 60 % of what u holds against the pole. @param gain factor on b0 of the plant
double overload_distance(const TuneModel& model, double gain, const Overload& event);

/// Simulates one event from rest, with u about the middle of its range and the noise of the model.
/// Back is: y within 2 % of its peak and four deviations of the noise, and u mostly off its limits,
/// for a settling time. It has to be so within 25 times the length of the event and 10 settling
/// times. With friction for two settling times, within 10.
/// @param gain factor on b0 of the plant, not of the controller
/// @param settling_time of the linear loop, s
/// @param on_sample called as on_sample(t, r, y, u) once a sample
/// @param law of a controller that softens at its limits
template <class Callback>
OverloadOutcome simulate_overload(const TuneModel& model, double gain,
                                  const LinearController& controller, const Overload& event,
                                  double settling_time, const Callback& on_sample,
                                  const SofteningLaw& law = {}) {
  const double T = model.sample_time;
  const double latency = model.latency();
  const double half = 0.5 * (model.u_max - model.u_min);
  const double force = (std::abs)(gain * model.input_gain.value) * half;
  const double length = event.latencies * latency;
  OverloadOutcome result;
  const double pull = (std::abs)(model.pole);
  // Below 60 % of what u brings back.
  if (model.pole < 0.0) {
    const double grown = event.kind == OverloadKind::kick ? event.share * length * pull
                         : event.kind == OverloadKind::load
                             ? std::expm1(pull * length) * (std::max)(event.share - 1.0, 0.0) +
                                   event.share * pull * latency
                             : 0.0;
    result.counts = grown < 0.6;
    if (!result.counts) return result;
  }
  detail::LimitedLoop loop(model, gain, detail::given_input_form(controller), half, law);
  sim::Gaussian gaussian(1);
  const double r = event.kind == OverloadKind::step ? overload_distance(model, gain, event) : 0.0;
  const auto samples_of = [T](double time) {
    return static_cast<long>((std::min)(std::ceil(time / T), 1e6));
  };
  const long pushed = event.kind == OverloadKind::load   ? samples_of(length)
                      : event.kind == OverloadKind::kick ? 1
                                                         : 0;
  const double d = event.share * force * (event.kind == OverloadKind::kick ? length / T : 1.0);
  // Friction holds for long, and then y moves again.
  const bool rubs = model.friction.value_or(0.0) > 0.0;
  const long last =
      pushed + (std::min)(samples_of((rubs ? 0.0 : 25.0 * length) + 10.0 * settling_time), 200000L);
  const long quiet =
      (std::min)(samples_of((rubs ? 2.0 : 1.0) * (std::max)(settling_time, 20.0 * latency)),
                 rubs ? 16000L : 4000L);
  long since = 0, at_limits = 0;
  for (long k = 0; k < last; ++k) {
    const double y = loop.output();
    const double u = loop(y + model.noise * gaussian.next(), r, k < pushed ? d : 0.0);
    on_sample(static_cast<double>(k) * T, r, y, u);
    if (!is_finite(y)) return result;
    result.peak = (std::max)(result.peak, (std::abs)(y - r));
    if (r > 0.0) result.beyond = (std::max)(result.beyond, (y - r) / r);
    if (k < pushed || (std::abs)(y - r) > 0.02 * result.peak + 4.0 * model.noise) {
      since = k + 1;
      at_limits = 0;
      continue;
    }
    at_limits += (std::abs)(u) >= half ? 1 : 0;
    if (k - since < quiet) continue;
    if (4 * at_limits <= quiet) {
      result.back = true;
      result.time = static_cast<double>(since - pushed) * T;
      return result;
    }
    since = k + 1;
    at_limits = 0;
  }
  result.time = static_cast<double>(last - pushed) * T;
  return result;
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/overload.ipp>
#endif
