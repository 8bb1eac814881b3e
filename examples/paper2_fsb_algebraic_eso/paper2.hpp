/// @file
/// What the examples of this paper share: its name, and its observer as it starts an experiment.
///
/// J. Kasac, A. Pender, M. Pranjic, D. Kotarski, "Frequency-shifting-based algebraic approach to
/// extended state observer design", Asian Journal of Control 23 (2021) 2171-2184,
/// doi:10.1002/asjc.2516.
#pragma once

#include <array>
#include <esokit/eigen.hpp>
#include <esokit/observer/linear_eso.hpp>
#include <esokit/sim/continuous_observer.hpp>
#include <string>
#include <utility>

#include "algebraic_filter.hpp"
#include "common/report.hpp"

namespace paper2 {

using esokit::EigenMatrix;

inline const std::string folder = "paper2_fsb_algebraic_eso";

inline esokit::examples::About about(std::string title, std::string description, int order,
                                     bool addition = false) {
  return {.paper_title = "Frequency-shifting-based algebraic extended state observer",
          .citation =
              "J. Kasac, A. Pender, M. Pranjic, D. Kotarski, Frequency-shifting-based algebraic "
              "approach to extended state observer design, Asian Journal of Control 23 (2021) "
              "2171-2184",
          .link = "https://doi.org/10.1002/asjc.2516",
          .title = std::move(title),
          .description = std::move(description),
          .order = order,
          .addition = addition};
}

/// The paper's observer in a ContinuousLoop: its filter, a clock, and estimates that are zero until
/// the time epsilon.
template <int Order, int Extension = 1>
class BlankedFilter {
 public:
  using Filter = esokit::examples::AlgebraicFilter<Order, double, Extension>;
  static constexpr int size = Filter::size;
  static constexpr int states = size + 1;  ///< filter and clock
  using scalar_type = double;
  using Estimate = typename Filter::Estimate;
  using State = EigenMatrix<double, states>;

  /// @param lambda, q rad/s @param blanking epsilon, s
  BlankedFilter(double lambda, double q, double input_gain, double blanking)
      : filter_(Filter::make(
                    {.observer_bandwidth = lambda, .frequency_shift = q, .input_gain = input_gain})
                    .value()),
        blanking_(blanking) {}

  State derivative(double t, const State& z, double y, double u) const {
    State rate;
    rate << eigen(filter_.derivative(t, z.template head<size>(), y, u)), 1.0;
    return rate;
  }

  Estimate estimate(const State& z) const {
    // The clock is a sum of steps.
    constexpr double rounding = 1e-9;
    const double t = z(size);
    if (t < blanking_ - rounding) return Estimate::Zero();
    return filter_.estimate(t, z.template head<size>());
  }

  void begin_step(double, const State&, double) const {}

 private:
  Filter filter_;
  double blanking_;
};

/// The linear observer that the paper compares with.
template <int Order, int Extension = 1>
esokit::ContinuousLinearEso<Order, double, Extension> linear_observer(double bandwidth,
                                                                      double input_gain) {
  return esokit::ContinuousLinearEso<Order, double, Extension>::make(
             {.observer_bandwidth = bandwidth, .input_gain = input_gain})
      .value();
}

}  // namespace paper2
