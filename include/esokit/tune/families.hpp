/// @file
/// The families of controllers that are compared, each as a linear system that depends on its
/// parameters.
#pragma once

#include <complex>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/gain/half_gain.hpp>
#include <esokit/gain/model_gain.hpp>
#include <esokit/gain/pole_set.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/tune/lqg.hpp>
#include <esokit/tune/specification.hpp>
#include <functional>
#include <optional>
#include <type_traits>
#include <vector>

namespace esokit {

/// How the gains of observer and law are chosen.
enum class TuneFamily : unsigned char {
  linear,     ///< LinearEso and law, each by a bandwidth
  half_gain,  ///< HalfGainEso and law, each by a bandwidth
  cascade,    ///< CascadeEso by bandwidth and factor, law by a bandwidth
  filter,     ///< frozen ExtendedStateFilter by its noise ratio, LQR gains
  free_poles  ///< LinearEso and law with arbitrary poles
};

/// What the observer of a family knows besides the chain.
struct TuneKnowledge {
  bool lag = false;       ///< lag of the actuator
  bool sensor = false;    ///< lag of the sensor
  bool sinusoid = false;  ///< the frequency of a sine in the disturbance

  /// True if it knows anything.
  [[nodiscard]] constexpr bool any() const noexcept { return lag || sensor || sinusoid; }
  /// True if all members are equal.
  friend constexpr bool operator==(const TuneKnowledge&, const TuneKnowledge&) = default;
};

/// The parameters of a design within its family.
struct TuneSettings {
  double observer_bandwidth = 0.0;    ///< omega_o, for a cascade that of level 1, rad/s
  double bandwidth_factor = 0.0;      ///< alpha of a cascade
  double controller_bandwidth = 0.0;  ///< omega_c if the law is given by it, rad/s
  double capture_bandwidth = 0.0;     ///< of a known sine, see Resonance

  /// The observer poles, 1/s; none for a cascade.
  std::vector<std::complex<double>> observer_poles{};
  double disturbance_bound = 0.0;  ///< q_n of the filter, see ExtendedStateFilter
  std::vector<double> gains{};     ///< k_0 .. of the law
  bool soften = false;             ///< as in AdrcConfig
};

namespace detail {

/// An observer without its type: its matrices, and its gains as a function of the parameters.
struct ObserverKind {
  int order = 1;  ///< of the law
  int size = 2;
  int placed = 2;  ///< number of poles that are placed in each level
  int levels = 1;
  double input_gain = 1.0;  ///< of the law
  DynamicMatrix<double> step{}, gamma{};
  DynamicMatrix<double> disturbance{};  ///< for several levels, see ObserverParts
  std::vector<int> state_of_row{};
  /// Writes the physical gains, level by level; false if there are none.
  std::function<bool(const TuneSettings&, std::vector<double>&)> gains{};
};

/// The poles of s^2 + 2 zeta w s + w^2.
std::array<std::complex<double>, 2> pole_pair(double w, double zeta);

/// Coefficients of prod (s - p_i) except the highest, by rising powers.
std::vector<double> polynomial(const std::vector<std::complex<double>>& poles);

/// Calls `function(std::integral_constant<int, value>)` for a value of First .. Last.
template <int First, int Last, class Function>
auto with_number(int value, const Function& function) {
  if constexpr (First < Last) {
    if (value != First) return with_number<First + 1, Last>(value, function);
  }
  return function(std::integral_constant<int, First>{});
}

/// The observer of the chain of integrators: matrices and placement.
ObserverKind chain_kind(const TuneModel& model, TuneFamily family, int extension, int levels);

/// Geometric mean of the magnitudes of the observer's poles, of level 1 in a cascade, rad/s.
double observer_mean(TuneFamily family, const ObserverKind& kind, const TuneModel& model,
                     const TuneSettings& s);

/// Geometric mean of the magnitudes of the law's `order` slowest poles, rad/s.
double law_mean(const std::vector<double>& gains, int order);

/// The observer with its gains.
std::optional<LinearObserverForm> tuned_observer(const ObserverKind& kind, double T,
                                                 const TuneSettings& settings);

/// Observer and law as a controller, with its own u as the applied u.
std::optional<LinearController> tuned_controller(const ObserverKind& kind, double T,
                                                 const TuneSettings& settings);

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/families.ipp>
#endif
