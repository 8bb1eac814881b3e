/// @file
/// Augmented models in 100 digits, from the differential equations of their parts: states (f, y,
/// .., v, c, .., q, r, .., l), and what the library publishes of them. Compiled once: the many
/// digits cost seconds a translation unit.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <esokit/model/augmented_model.hpp>
#include <vector>

namespace esokit_test {

using Poles = std::vector<std::complex<long double>>;
using Table = std::vector<std::vector<long double>>;

/// The numbers of an AugmentedModel of any parts; of a lag its time constant, or its frequency and
/// damping.
struct AugmentedNumbers {
  std::vector<double> plant, actuator, sensor;
  std::vector<std::array<double, 2>> resonators;  // frequency, damping
  std::vector<double> first_order;
};

class AugmentedReference {
 public:
  AugmentedReference(const esokit::ModelParts& parts, AugmentedNumbers numbers, double input_gain);

  std::size_t y, v, c, q, fade;  ///< the first of its states
  std::size_t size;

  /// exp(A T) - I of these states and, as last one, the input.
  [[nodiscard]] Table natural_step(double time) const;
  /// Phi - I, and Gamma as last column, of the published states in physical units.
  [[nodiscard]] Table step(double time) const;
  /// The library's states of these, in physical units.
  [[nodiscard]] Table published() const;
  /// These states of the library's.
  [[nodiscard]] std::vector<long double> natural(const std::vector<long double>& published) const;
  /// The largest relative error of a coefficient of the characteristic polynomial in z - 1 that
  /// `gain`, as scaled by `degrees`, makes, against that of the poles.
  [[nodiscard]] double worst_coefficient(const std::vector<double>& gain,
                                         const std::vector<int>& degrees, const Poles& poles,
                                         double time) const;

 private:
  esokit::ModelParts parts_;
  AugmentedNumbers numbers_;
  double input_gain_;
};

/// @{
inline std::vector<double> numbers_of(const esokit::Lag<0, double>&) { return {}; }
inline std::vector<double> numbers_of(const esokit::Lag<1, double>& lag) {
  return {lag.time_constant};
}
inline std::vector<double> numbers_of(const esokit::Lag<2, double>& lag) {
  return {lag.frequency, lag.damping};
}
/// @}

/// The reference of an AugmentedModel of the same parts and numbers.
template <esokit::ModelParts Parts>
AugmentedReference reference_of(const esokit::PartsSettings<Parts, double>& settings,
                                double input_gain) {
  AugmentedNumbers numbers{{}, numbers_of(settings.actuator), numbers_of(settings.sensor), {}, {}};
  if constexpr (Parts.plant_poles) {
    numbers.plant.assign(settings.plant.begin(), settings.plant.end());
  }
  for (const auto& swing : settings.resonators) {
    numbers.resonators.push_back({swing.frequency, swing.damping});
  }
  numbers.first_order.assign(settings.first_order.begin(), settings.first_order.end());
  return AugmentedReference(Parts, numbers, input_gain);
}

/// Of the poles that the first level of an observer places.
template <class Observer>
double worst_coefficient(const Observer& observer, const AugmentedReference& reference,
                         const Poles& poles) {
  std::vector<double> gain;
  std::vector<int> degrees;
  for (const double k : observer.level_gain(0)) {
    degrees.push_back(Observer::PlantModel::degree(static_cast<int>(gain.size())));
    gain.push_back(k);
  }
  return reference.worst_coefficient(gain, degrees, poles, observer.sample_time());
}

/// Poles of a lag, 1/s.
/// @{
inline Poles poles_of(const esokit::Lag<0, double>&) { return {}; }
inline Poles poles_of(const esokit::Lag<1, double>& lag) {
  return {std::complex<long double>(-1.0L / static_cast<long double>(lag.time_constant), 0)};
}
inline Poles poles_of(const esokit::Lag<2, double>& lag) {
  const std::complex<long double> root = std::sqrt(std::complex<long double>(
      static_cast<long double>(lag.damping) * static_cast<long double>(lag.damping) - 1.0L, 0));
  const auto w = static_cast<long double>(lag.frequency);
  const std::complex<long double> middle(-static_cast<long double>(lag.damping), 0);
  return {w * (middle + root), w * (middle - root)};
}
/// @}

}  // namespace esokit_test
