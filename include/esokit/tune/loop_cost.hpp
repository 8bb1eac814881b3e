/// @file
/// Cost and margins of a loop, computed fast enough for ten thousand evaluations.
///
/// The criterion, in the steady state and at the samples,
///
///     J = var(y) + rho var(b0 u~),   u~ = u + d / b0,
///
/// is computed as an integral over the frequency, which gives the same as a Lyapunov equation. This
/// way the plant with its dead time is evaluated only once for all controllers, and the same loop
/// gains give the margins. d is a random walk, so the variance of u is infinite, but that of u~ is
/// not. The grid is even in the logarithm of W = 2 / T tan(omega T / 2), on which the trapezoid
/// rule converges exponentially. With poles of damping 0.25 the error is 1e-6 at 20 points per
/// decade. Its steps grow towards half the sample rate, where W is infinite, so that it sees poles
/// near z = -1. Poles of little damping hide between its points: `exact_deviations` solves the
/// Lyapunov equations. A loop is stable if the phase of its characteristic polynomial turns by half
/// a turn for each state between z = 1 and z = -1.
///
/// A latency that is wrong by part of a sample is more than a phase. Near half the sample rate a
/// sampled plant of one dead time can have next to no gain, and that of half a sample more a lot.
/// So margins over latencies follow the sampled plant from one end of the interval to the other,
/// and where that is a sample or more, take what any dead time can make of it.
#pragma once

#include <complex>
#include <cstddef>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/delay_margin.hpp>
#include <esokit/analysis/linear_controller.hpp>
#include <esokit/analysis/poles.hpp>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/tune/specification.hpp>
#include <limits>
#include <vector>

namespace esokit {

/// The results of LoopCost.
struct LoopNumbers {
  bool stable = false;         ///< stable with the nominal b0
  bool tolerant = false;       ///< also stable with b0 wrong by the factor that the rules require
  double output = 0.0;         ///< standard deviation of y
  double control = 0.0;        ///< standard deviation of u~
  double control_noise = 0.0;  ///< standard deviation of u from noise only
  double tolerance = 0.0;      ///< factor by which b0 may be wrong in either direction
  double modulus = 0.0;        ///< modulus margin, the smallest over the intervals
  double delay = 0.0;          ///< delay margin, s, the smallest over the intervals
  double phase = 0.0;          ///< phase margin, rad, the smallest over the intervals

  /// J.
  [[nodiscard]] double cost(double rho, double input_gain) const {
    return output * output + rho * input_gain * input_gain * control * control;
  }
};

namespace detail {

/// C (value - A)^-1 B + D for one channel by a Hessenberg form: O(N^2) operations per frequency.
class FastResponse {
 public:
  /// @param c with its own u as the applied u
  explicit FastResponse(const LinearController& c);

  struct Answer {
    std::complex<double> gain;
    std::complex<double> turn;  ///< det(value - A) divided by its magnitude
  };
  [[nodiscard]] Answer at(std::complex<double> value);

 private:
  // A product without the handling of infinities that std::complex has.
  static std::complex<double> times(std::complex<double> a, std::complex<double> b) noexcept {
    return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
  }
  static std::complex<double> divided(std::complex<double> a, std::complex<double> b) noexcept {
    return times(a, std::conj(b)) / std::norm(b);
  }

  int n_;
  DynamicMatrix<double> h_, b_, c_;
  double d_;
  std::vector<std::complex<double>> work_;
};

/// The response of a sampled plant is a sum over the frequencies that the samples do not tell from
/// each other. A dead time turns each of them at its own rate.
struct Aliases {
  static constexpr int most_cells = 16;
  std::complex<double> base;  ///< response at the frequency itself
  double size = 0.0;          ///< its magnitude
  double rest = 0.0;          ///< sum of the magnitudes at the others
  int cells = 0;  ///< 0: the range of dead times is so large that the others turn freely
  std::complex<double> sums[most_cells + 1];  ///< for the dead times at the ends of the cells
};

/// @param gain factor on b0 @param range by how much the dead time may differ either way, s
Aliases aliases(const TuneModel& model, double gain, double w, double range);

}  // namespace detail

/// The plant and its disturbances, prepared for evaluating any controller.
class LoopCost {
  using ComplexNumber = std::complex<double>;

 public:
  /// @param model checked model @param rules required margins @param slowest rad/s, well below all
  /// dynamics @param points per decade
  LoopCost(const TuneModel& model, const TuneRules& rules, double slowest, double points = 20.0);

  /// @param controller with its own u as the applied u
  [[nodiscard]] LoopNumbers operator()(const LinearController& controller) const;

 private:
  static constexpr std::size_t most_variants = 4;

  /// Factors on a gain to both ends of its interval.
  struct Spread {
    double low = 1.0, high = 1.0;
  };

  struct Point {
    double frequency;
    ComplexNumber value, plant, load, turn;
    ComplexNumber ratio[most_variants];          ///< ratio of the other plants to this one
    ComplexNumber turned;                        ///< by the range of latencies, half a turn at most
    detail::Aliases aliases[most_variants + 1];  ///< of all plants at the middle latency
    double noise_power, load_power;
  };

  /// The last values for each plant, and the least so far.
  struct Trail {
    double least = std::numeric_limits<double>::infinity();  ///< abs(1 + L)^2
    double square[2] = {};
    ComplexNumber loop{}, largest{};
  };

  /// Square of the distance of -1 from the straight line between 1 + L of two loops.
  static double nearest(ComplexNumber from, ComplexNumber to);

  /// @param spread factors on the gain to the ends of its interval @param gain of the controller
  /// @param size its magnitude
  void margins(LoopNumbers& numbers, Trail& trail, ComplexNumber loop,
               const detail::Aliases& aliases, const Spread& spread, ComplexNumber gain,
               double size, std::size_t i) const;

  double T_;
  double b0_;
  double factor_;
  double range_ = 0.0;  ///< of latencies, either way from the middle one, s
  std::size_t variants_ = 0;
  Spread spread_[most_variants + 1];  ///< of the model, then of its variants
  int plant_states_ = 0;
  std::size_t walked_ = 0;
  std::vector<Point> points_;
};

/// The standard deviations of a stable loop of the model and a controller with integral action in
/// closed form, by Lyapunov equations; left as they are if these cannot be solved to 1e-11.
void exact_deviations(const TuneModel& model, const Loop& loop, LoopNumbers& numbers);

/// The smallest damping of the poles of a sampled loop, -Re(s) / abs(s) for z = e^(s T).
/// @param known rad/s: the two poles nearest to this frequency do not count; 0: all count
double pole_damping(const Loop& loop, double known = 0.0);

}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/loop_cost.ipp>
#endif
