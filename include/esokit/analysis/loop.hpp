/// @file
/// The loop of a plant and a controller, the start of every analysis of a finished design.
#pragma once

#include <complex>
#include <esokit/analysis/dynamic_matrix.hpp>
#include <esokit/analysis/frequency_response.hpp>
#include <esokit/analysis/library_systems.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/model/linear_plant.hpp>
#include <vector>

namespace esokit {

namespace detail {

/// Longest dead time that a loop accepts, samples.
inline constexpr double most_whole_samples = 1000.0;

/// A LinearPlant in double without its sizes in the type.
struct DensePlant {
  DynamicMatrix<double> a, b, c, e;
  std::vector<double> dead_time;  ///< of each input, s
};

template <int States, Scalar S, int Inputs, int Outputs>
DensePlant dense_plant(const LinearPlant<States, S, Inputs, Outputs>& plant) {
  return {dynamic_copy(plant.a, States, States), dynamic_copy(plant.b, States, Inputs),
          dynamic_copy(plant.c, Outputs, States), dynamic_copy(plant.e, States, Inputs),
          std::vector<double>(Inputs, static_cast<double>(plant.dead_time))};
}

/// exp(A t) - I, and the integral of exp(A s) B over 0..t.
struct HeldFor {
  DynamicMatrix<double> increment, input;
};

HeldFor held_for(const DynamicMatrix<double>& a, const DynamicMatrix<double>& b, double t);

/// A plant at the sample times: D x = a x + now u[k - whole] + before u[k - whole - 1] + e d, with
/// its own `whole` for each input. A continuous plant has only `now`.
struct SampledPlant {
  DynamicMatrix<double> a, now, before, e, c;
  std::vector<int> whole;
  double sample_time = 0.0;

  /// Number of past inputs that it needs.
  [[nodiscard]] int remembered(int input) const;
};

SampledPlant sampled_plant(const DensePlant& plant, double sample_time);

/// Response from u to y at a value of D (i omega, or z - 1). @param disturbance from d to y instead
ComplexMatrix response(const SampledPlant& plant, std::complex<double> value,
                       bool disturbance = false);

/// Response from y to u. @param controller with its own u as the applied u
ComplexMatrix response(const LinearController& controller, std::complex<double> value);

void balance(LinearController& c);

/// The loop from (r, v, d) to (y, u, zhat). @param open channel whose u does not reach the plant;
/// -1: none @param controller with its own u as the applied u
DynamicSystem closed_system(const SampledPlant& sampled, const LinearController& controller,
                            int open = -1);

/// Loop gain L = -C P of one channel at the plant's input, with the other channels closed.
std::complex<double> loop_gain_of_channel(const ComplexMatrix& plant,
                                          const ComplexMatrix& controller, int channel);

}  // namespace detail

/// Loop of a plant y = P (u, d) and a controller u = C (y + v, r), of q channels.
///
/// Sampled: y[k] is measured and u[k] is set at the same instant; give computing time as dead time
/// of the plant. The loop gain L = -P C is that of the loop opened at the plant's input, while the
/// controller still gets its own u; with several channels the others stay closed. r is a reference
/// without derivatives; d is held from k to k + 1.
class Loop {
 public:
  using ComplexNumber = std::complex<double>;  ///< a response at a frequency

  /// Closes the loop. Use `closed_loop` instead.
  /// @return error if plant and controller have different numbers of channels, if a number
  ///         overflows, and for a dead time that is too long (or, with a continuous controller, not
  ///         zero)
  static Expected<Loop, Error<double>> make(detail::DensePlant plant, LinearController controller);

  /// q.
  [[nodiscard]] int channels() const noexcept { return controller_.channels(); }
  /// T, s; 0 for a continuous loop.
  [[nodiscard]] double sample_time() const noexcept { return system_.sample_time; }
  /// The closed loop from (r, v, d) to (y, u, zhat): q columns for r and v, q rows for y and u, and
  /// as many as there are for d and zhat.
  [[nodiscard]] const DynamicSystem& system() const noexcept { return system_; }
  /// b0 of the controller, 0 if it has none.
  [[nodiscard]] double input_gain() const noexcept { return input_gain_; }

  /// True if all poles of the closed loop are stable.
  [[nodiscard]] bool stable() const noexcept { return abscissa_ < 0.0; }
  /// esokit::stability_abscissa of the closed loop: negative is stable.
  [[nodiscard]] double stability_abscissa() const noexcept { return abscissa_; }
  /// Poles of the closed loop, 1/s; sampled: z - 1.
  [[nodiscard]] const std::vector<ComplexNumber>& poles() const noexcept { return poles_; }

  /// L at one actuator, with the other channels closed. @param frequency rad/s, above 0; sampled:
  /// up to pi / T @return error for a frequency outside this range or at a pole, or if there is no
  /// such channel
  [[nodiscard]] Expected<ComplexNumber, Error<double>> loop_gain(double frequency,
                                                                 int channel = 0) const;
  /// S = 1 / (1 + L): from a disturbance at an actuator to the input of the plant; with one channel
  /// also from a disturbance at the output to y. Errors as for loop_gain.
  [[nodiscard]] Expected<ComplexNumber, Error<double>> sensitivity(double frequency,
                                                                   int channel = 0) const;
  /// T = L / (1 + L): with one channel from noise v to -y. Errors as for loop_gain.
  [[nodiscard]] Expected<ComplexNumber, Error<double>> complementary_sensitivity(
      double frequency, int channel = 0) const;
  /// From noise on one measurement to one u. Errors as for loop_gain.
  [[nodiscard]] Expected<ComplexNumber, Error<double>> noise_to_control(double frequency,
                                                                        int control = 0,
                                                                        int measurement = 0) const;
  /// From a disturbance of the plant to one y. Errors as for loop_gain.
  [[nodiscard]] Expected<ComplexNumber, Error<double>> disturbance_to_output(
      double frequency, int output = 0, int disturbance = 0) const;
  /// Largest singular value of the sensitivity (I - P C)^-1: the largest amplification of a
  /// disturbance at the outputs, in any direction. It depends on the units of y: scale the outputs
  /// to similar size. Errors as for loop_gain.
  [[nodiscard]] Expected<double, Error<double>> largest_sensitivity(double frequency) const;

  /// @cond
  [[nodiscard]] const detail::DensePlant& continuous_plant() const noexcept { return continuous_; }
  [[nodiscard]] const detail::SampledPlant& plant() const noexcept { return plant_; }
  [[nodiscard]] const LinearController& controller() const noexcept { return controller_; }
  [[nodiscard]] double sensitivity_at(ComplexNumber value) const;
  [[nodiscard]] Check<double> check_channel(const char* field, int channel) const;
  /// @endcond

 private:
  Loop() = default;

  /// I - P C
  [[nodiscard]] detail::ComplexMatrix output_return(ComplexNumber value) const;

  template <class Function>
  Expected<ComplexNumber, Error<double>> at(double frequency, int row, int column,
                                            Function&& function) const;

  template <class Function>
  Expected<ComplexNumber, Error<double>> of_gain(double frequency, int channel,
                                                 Function&& function) const;

  detail::DensePlant continuous_;
  detail::SampledPlant plant_;
  LinearController controller_;  ///< with its own u as the applied u
  DynamicSystem system_;
  std::vector<ComplexNumber> poles_;
  double abscissa_ = 0.0;
  double input_gain_ = 0.0;
};

/// A loop, or the error that prevented it.
using LoopResult = Expected<Loop, Error<double>>;

/// The loop of a plant and a controller, the same object that runs on the machine. The plant is
/// continuous and is sampled exactly, with any dead time.
/// @return the errors of Loop::make, and an error for a controller that is not the same at every
/// sample
template <int States, Scalar S, int Inputs, int Outputs, class Controller>
LoopResult closed_loop(const LinearPlant<States, S, Inputs, Outputs>& plant,
                       const Controller& controller) {
  static_assert(AnalysedController<Controller>,
                "esokit: the analysis needs a linear controller: for a nonlinear or switched gain "
                "use FrozenObserver and ObserverWithLaw; for your own type write a function "
                "linear_controller beside it");
  if constexpr (AnalysedController<Controller>) {
    if (const auto ok = plant.validate(); !ok) {
      const auto& error = ok.error();
      return Error<double>{error.field, static_cast<double>(error.value), error.rule, error.index};
    }
    const Expected<LinearController, Error<double>> linear = linear_controller(controller);
    if (!linear) return linear.error();
    return Loop::make(detail::dense_plant(plant), *linear);
  } else {
    return Error<double>{};
  }
}

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/analysis/impl/loop.ipp>
#endif
