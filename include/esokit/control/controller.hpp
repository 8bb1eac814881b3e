/// @file
/// The concept of a controller, by which simulation and other parts of the library call it.
#pragma once

#include <concepts>
#include <esokit/core/check.hpp>
#include <esokit/core/detail/declared_traits.hpp>
#include <esokit/core/matrix.hpp>
#include <esokit/core/scalar.hpp>
#include <type_traits>

namespace esokit {

/// What a controller can do beyond `u = controller(y, reference)`, declared, in a member `static
/// constexpr ControllerTraits traits{..}`. For a controller without it the defaults apply.
struct ControllerTraits {
  /// u is `control(y)`; `prepare(next_reference)` comes after it, and `set_reference(reference)`
  /// before the first sample. See PredictiveAdrc.
  bool two_phases = false;

  /// The reference may be a vector (r, r', .., r^(n)), n = `order`.
  bool takes_derivatives = false;

  bool knows_sample_time = false;  ///< `sample_time() const`, s
  bool varies_time = false;        ///< `elapsed(seconds)`, before each step
  bool takes_measured = false;     ///< `measured(w)` before each sample, see Measured
  bool observes = false;  ///< `observer() const`, with `total_disturbance()`; for one channel only
};

/// The traits that a controller declares, or the defaults.
template <class C>
inline constexpr ControllerTraits controller_traits = detail::declared_traits<C, ControllerTraits>;

namespace detail {

/// Calls the controller for one sample with measurement y and returns u.
template <class C, class Y, class Reference>
ESOKIT_INLINE constexpr decltype(auto) command(C& controller, const Y& y,
                                               [[maybe_unused]] const Reference& reference) {
  if constexpr (controller_traits<C>.two_phases) {
    return controller.control(y);
  } else if constexpr (std::invocable<C&, const Y&, const Reference&>) {
    return controller(y, reference);
  } else {
    return controller.update(y, reference);
  }
}

template <class C, class Y, class Reference, class U>
concept Commands = requires(C& controller, const Y& y, const Reference& reference) {
  { controller(y, reference) } -> std::convertible_to<U>;
}
|| requires(C& controller, const Y& y, const Reference& reference) {
  { controller.update(y, reference) } -> std::convertible_to<U>;
};

template <class C, class Y, class Reference, class U>
concept CommandsInTwoPhases = requires(C& controller, const Y& y, const Reference& reference) {
  { controller.control(y) } -> std::convertible_to<U>;
  controller.prepare(reference);
  controller.set_reference(reference);
};

template <class C, class Reference>
using WithDerivatives = Vector<Reference, C::order + 1>;

}  // namespace detail

/// A controller for plants with measurement Y and input U (numbers, or vectors for several
/// channels). Called once a sample, `controller(y, reference)` (for example a lambda) or
/// `controller.update(y, reference)` returns the u to be held until the next sample. y is NaN if
/// the measurement is missing.
///
/// It must be copyable, because a simulation runs a copy. What else it can do it declares in
/// ControllerTraits.
template <class C, class Y, class U = Y, class Reference = Y>
concept Controller =
    std::copy_constructible<C> && DeclaresTraits<C, ControllerTraits> &&
    (controller_traits<C>.two_phases
         ? detail::CommandsInTwoPhases<C, Y, Reference, U>
         : detail::Commands<
               C, Y, Reference,
               U>)&&(!controller_traits<C>.takes_derivatives ||
                     (controller_traits<C>.two_phases
                          ? detail::CommandsInTwoPhases<C, Y, detail::WithDerivatives<C, Reference>,
                                                        U>
                          : detail::Commands<C, Y, detail::WithDerivatives<C, Reference>, U>)) &&
    (!controller_traits<C>.knows_sample_time ||
     requires(const C& controller) {
       { controller.sample_time() } -> std::convertible_to<typename C::scalar_type>;
     }) &&
    (!controller_traits<C>.varies_time ||
     requires(C & controller, const typename C::scalar_type& seconds) {
       { controller.elapsed(seconds) } -> std::same_as<Check<typename C::scalar_type>>;
     }) &&
    (!controller_traits<C>.observes || requires(const C& controller) {
      { controller.observer().total_disturbance() } -> std::convertible_to<typename C::scalar_type>;
    });

}  // namespace esokit
