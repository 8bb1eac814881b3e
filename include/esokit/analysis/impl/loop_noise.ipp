#pragma once

#include <cmath>
#include <esokit/analysis/covariance.hpp>
#include <esokit/analysis/loop.hpp>
#include <esokit/analysis/loop_noise.hpp>
#include <vector>

namespace esokit {

namespace detail {

ESOKIT_FUNCTION Expected<DynamicMatrix<double>, Error<double>> input_covariance(
    const Loop& loop, const LoopNoise& of) {
  const int q = loop.channels();
  const int inputs = loop.system().b.cols();
  DynamicMatrix<double> input(inputs, inputs);
  Rules<double> rules;
  const auto take = [&](const char* field, const std::vector<double>& deviations, int first,
                        int most) {
    const int count = static_cast<int>(deviations.size());
    rules.demand(count <= most, {field, static_cast<double>(count), "must have at most", -1,
                                 static_cast<double>(most), true});
    for (int i = 0; i < count && i < most; ++i) {
      const double deviation = deviations[static_cast<std::size_t>(i)];
      rules.not_negative(field, deviation, i);
      input(first + i, first + i) = deviation * deviation;
    }
  };
  take("measurement", of.measurement, q, q);
  take("disturbance", of.disturbance, 2 * q, inputs - 2 * q);
  rules.demand(loop.stable(), "stability_abscissa", loop.stability_abscissa(),
               "must be negative: a loop that is not stable has no steady state");
  if (!rules) return rules.error();
  return input;
}

}  // namespace detail

ESOKIT_FUNCTION Expected<LoopDeviations, Error<double>> noise(const Loop& loop,
                                                              const LoopNoise& of) {
  const int q = loop.channels();
  const int outputs = loop.system().c.rows();
  const auto input = detail::input_covariance(loop, of);
  if (!input) return input.error();
  const auto covariance = output_covariance(loop.system(), *input);
  if (!covariance) return covariance.error();
  LoopDeviations deviations;
  for (int i = 0; i < outputs; ++i) {
    auto& list = i < q ? deviations.output : i < 2 * q ? deviations.control : deviations.estimates;
    list.push_back(std::sqrt((std::max)((*covariance)(i, i), 0.0)));
  }
  return deviations;
}

}  // namespace esokit
