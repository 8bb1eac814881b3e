/// @file
/// The nominal plant of a loop analysis, and its exact sampling with an input delay.
#pragma once

#include <cstddef>
#include <esokit/analysis/dense.hpp>
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
    Rules<double> rules;
    rules.nonzero("input_gain", input_gain).finite("coefficients", coefficients);
    if (!rules) return rules.error();
    NominalPlant<Order> plant;
    for (int i = 0; i < Order; ++i) {
      plant.a(Order - 1, i) = -coefficients[static_cast<std::size_t>(i)];
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

/// exp(A t) - I and the integral of exp(A s) B over 0..t.
template <int N, int Inputs>
struct Held {
  EigenMatrix<double, N, N> transition;
  EigenMatrix<double, N, Inputs> input;
};

template <int N, int Inputs>
Held<N, Inputs> hold(const EigenMatrix<double, N, N>& a, const EigenMatrix<double, N, Inputs>& b,
                     double t) {
  constexpr int size = N + Inputs;
  Array<double, size * size> stacked{};  // ((a, b), (0, 0)), by columns
  Array<double, 2 * size * size> work;
  const auto entry = [&](int i, int j) -> double& {
    return stacked[static_cast<std::size_t>(j * size + i)];
  };
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) entry(i, j) = a(i, j) * t;
    for (int j = 0; j < Inputs; ++j) entry(i, N + j) = b(i, j) * t;
  }
  exp_minus_identity(stacked.data(), work.data(), size);
  Held<N, Inputs> held;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) held.transition(i, j) = entry(i, j);
    for (int j = 0; j < Inputs; ++j) held.input(i, j) = entry(i, N + j);
  }
  return held;
}

template <int States>
Check<double> check_plant(const NominalPlant<States>& plant) {
  const double direct = plant.d(0, 0) != 0.0 ? plant.d(0, 0) : plant.d(0, 1);
  return Rules<double>{}
      .all_of(check_system(plant))
      .require(!plant.sampled(), "plant.sample_time", plant.sample_time, "must be zero: continuous")
      .require(direct == 0.0, "plant.d", direct, "must be zero: y may not follow an input at once");
}

}  // namespace detail

/// The plant at the sample times, u and d held from k to k + 1. Exact.
/// @param sample_time T, s @return error for a plant that is sampled already, that has a direct
///        path, or whose exp(A T) the scalar cannot hold
template <int States>
Expected<NominalPlant<States>, Error<double>> sampled_plant(const NominalPlant<States>& plant,
                                                            double sample_time) {
  Rules<double> rules;
  rules.all_of(detail::check_plant(plant)).positive("sample_time", sample_time);
  if (!rules) return rules.error();
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
  Rules<double> rules;
  rules.all_of(detail::check_plant(plant))
      .positive("sample_time", sample_time)
      .not_negative("delay", delay)
      .require(!(delay > sample_time),
               {"delay", delay, "must not be above sample_time", -1, sample_time, true});
  if (!rules) return rules.error();
  const auto whole = detail::hold<States, 2>(plant.a, plant.b, sample_time);
  const auto early = detail::hold<States, 2>(plant.a, plant.b, delay);
  const auto late = detail::hold<States, 2>(plant.a, plant.b, sample_time - delay);
  NominalPlant<States + 1> sampled;
  for (int i = 0; i < States; ++i) {
    double old_input = early.input(i, 0);  // on to the end of the sample by exp(A (T - delay))
    for (int j = 0; j < States; ++j) {
      old_input += late.transition(i, j) * early.input(j, 0);
      sampled.a(i, j) = whole.transition(i, j);
    }
    sampled.a(i, States) = old_input;
    sampled.b(i, 0) = late.input(i, 0);
    sampled.b(i, 1) = whole.input(i, 1);
    sampled.c(0, i) = plant.c(0, i);
  }
  sampled.a(States, States) = -1.0;  // the old u is forgotten
  sampled.b(States, 0) = 1.0;
  sampled.sample_time = sample_time;
  sampled.input_names = plant.input_names;
  sampled.output_names = plant.output_names;
  if (auto ok = detail::check_system(sampled); !ok) return ok.error();
  return sampled;
}

}  // namespace esokit
