/// @file
/// The nominal plant of a loop analysis, and its exact sampling with an input delay.
#pragma once

#include <cmath>
#include <esokit/analysis/linear_system.hpp>

namespace esokit {

/// A plant with the inputs u and d (disturbance) and the output y.
template <int States>
using NominalPlant = LinearSystem<States, 2, 1>;

/// y^(Order) + a_{Order-1} y^(Order-1) + .. + a_0 y = b u + d, continuous.
/// @tparam Order order of the plant; that of the observer may differ
template <int Order>
struct CompanionPlant {
  Array<double, Order> coefficients{};  ///< a_0 .. a_{Order-1}, s^-(Order-i)
  double input_gain{};                  ///< b, unit of y^(Order) per unit of u; not zero

  /// The same as a system, states (y, .., y^(Order-1)).
  [[nodiscard]] Expected<NominalPlant<Order>, Error<double>> system() const {
    if (auto ok = check_nonzero("input_gain", input_gain); !ok) return ok.error();
    NominalPlant<Order> plant;
    for (int i = 0; i < Order; ++i) {
      const double coefficient = coefficients[static_cast<std::size_t>(i)];
      if (auto ok = check_finite("coefficients", coefficient, i); !ok) return ok.error();
      plant.a(Order - 1, i) = -coefficient;
      if (i + 1 < Order) plant.a(i, i + 1) = 1.0;
    }
    plant.b(Order - 1, 0) = input_gain;
    plant.b(Order - 1, 1) = 1.0;
    plant.c(0, 0) = 1.0;
    plant.input_names = {"u", "d"};
    plant.output_names = {"y"};
    return plant;
  }
};

namespace detail {

/// exp(A) - I: Taylor series of A / 2^k, then squared k times as 2 E + E^2.
template <int N>
Matrix<double, N, N> exp_minus_identity(const Matrix<double, N, N>& a) {
  const double size = a.cwiseAbs().rowwise().sum().maxCoeff();
  int squarings = 0;
  if (is_finite(size) && size > 0.25) squarings = static_cast<int>(std::ceil(std::log2(size))) + 2;
  const Matrix<double, N, N> small = a * std::exp2(-squarings);
  // With norm 1/4 the terms fall below 1e-17 by the 12th. Horner, from the smallest.
  Matrix<double, N, N> sum = Matrix<double, N, N>::Identity();
  for (int k = 14; k >= 2; --k) {
    sum = (small * sum / k).eval();
    sum.diagonal().array() += 1.0;
  }
  Matrix<double, N, N> e = small * sum;
  for (int i = 0; i < squarings; ++i) e = (2.0 * e + e * e).eval();
  return e;
}

/// exp(A t) - I and the integral of exp(A s) B over 0..t.
template <int N, int Inputs>
struct Held {
  Matrix<double, N, N> transition;
  Matrix<double, N, Inputs> input;
};

template <int N, int Inputs>
Held<N, Inputs> hold(const Matrix<double, N, N>& a, const Matrix<double, N, Inputs>& b, double t) {
  Matrix<double, N + Inputs, N + Inputs> stacked = Matrix<double, N + Inputs, N + Inputs>::Zero();
  stacked.template topLeftCorner<N, N>() = a * t;
  stacked.template topRightCorner<N, Inputs>() = b * t;
  const Matrix<double, N + Inputs, N + Inputs> e = exp_minus_identity<N + Inputs>(stacked);
  return {e.template topLeftCorner<N, N>(), e.template topRightCorner<N, Inputs>()};
}

template <int States>
Check<double> check_plant(const NominalPlant<States>& plant) {
  if (auto ok = check_system(plant); !ok) return ok;
  if (plant.sampled()) {
    return Error<double>{"plant.sample_time", plant.sample_time, "must be zero: continuous"};
  }
  if (plant.d(0, 0) != 0.0 || plant.d(0, 1) != 0.0) {
    return Error<double>{"plant.d", plant.d(0, 0) != 0.0 ? plant.d(0, 0) : plant.d(0, 1),
                         "must be zero: y may not follow an input at once"};
  }
  return {};
}

}  // namespace detail

/// The plant at the sample times, u and d held from k to k + 1. Exact.
/// @param sample_time T, s @return error for a plant that is sampled already, that has a direct
///        path, or whose exp(A T) the scalar cannot hold
template <int States>
Expected<NominalPlant<States>, Error<double>> sampled_plant(const NominalPlant<States>& plant,
                                                            double sample_time) {
  if (auto ok = detail::check_plant(plant); !ok) return ok.error();
  if (auto ok = check_positive("sample_time", sample_time); !ok) return ok.error();
  const auto held = detail::hold<States, 2>(plant.a, plant.b, sample_time);
  NominalPlant<States> sampled = plant;
  sampled.a = held.transition;
  sampled.b = held.input;
  sampled.sample_time = sample_time;
  if (auto ok = detail::check_system(sampled); !ok) return ok.error();
  return sampled;
}

/// The same where u[k] reaches the plant late: it is held from k T + delay to (k + 1) T + delay.
/// One more state remembers u[k-1]. d is not delayed.
/// @param delay s, 0 .. T: computing time, a whole sample of it at most
template <int States>
Expected<NominalPlant<States + 1>, Error<double>> sampled_plant(const NominalPlant<States>& plant,
                                                                double sample_time, double delay) {
  if (auto ok = detail::check_plant(plant); !ok) return ok.error();
  if (auto ok = check_positive("sample_time", sample_time); !ok) return ok.error();
  if (auto ok = check_not_negative("delay", delay); !ok) return ok.error();
  if (delay > sample_time) {
    return Error<double>{"delay", delay, "must not be above sample_time", -1, sample_time, true};
  }
  const auto whole = detail::hold<States, 2>(plant.a, plant.b, sample_time);
  const auto early = detail::hold<States, 2>(plant.a, plant.b, delay);
  const auto late = detail::hold<States, 2>(plant.a, plant.b, sample_time - delay);
  NominalPlant<States + 1> sampled;
  sampled.a.template topLeftCorner<States, States>() = whole.transition;
  sampled.a.template topRightCorner<States, 1>() =
      early.input.col(0) + late.transition * early.input.col(0);
  sampled.a(States, States) = -1.0;  // the old u is forgotten
  sampled.b.template topLeftCorner<States, 1>() = late.input.col(0);
  sampled.b.template topRightCorner<States, 1>() = whole.input.col(1);
  sampled.b(States, 0) = 1.0;
  sampled.c.template leftCols<States>() = plant.c;
  sampled.sample_time = sample_time;
  sampled.input_names = plant.input_names;
  sampled.output_names = plant.output_names;
  if (auto ok = detail::check_system(sampled); !ok) return ok.error();
  return sampled;
}

}  // namespace esokit
