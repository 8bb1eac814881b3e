#pragma once

#include <algorithm>
#include <cmath>
#include <esokit/core/check.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/identify/fit.hpp>
#include <esokit/identify/identified.hpp>
#include <esokit/identify/input_checks.hpp>
#include <esokit/identify/log.hpp>
#include <esokit/identify/measured_columns.hpp>
#include <esokit/identify/plateau.hpp>
#include <esokit/identify/second_opinion.hpp>
#include <esokit/identify/sinusoids.hpp>
#include <esokit/model/augmented_model.hpp>
#include <esokit/model/linear_plant.hpp>
#include <esokit/observer/model_eso.hpp>

namespace esokit {

ESOKIT_FUNCTION double PositionForce::operator()(double y) const {
  const double x = (std::clamp(y, low, high) - middle) / size;
  return x * (factors[0].value + x * (factors[1].value + x * factors[2].value));
}

ESOKIT_FUNCTION double PositionForce::half_width(double y) const {
  const double x = (std::abs)((std::clamp(y, low, high) - middle) / size);
  return x * (factors[0].half_width + x * (factors[1].half_width + x * factors[2].half_width));
}

ESOKIT_FUNCTION double Identified::bandwidth_of(double intensity) const {
  return std::pow(intensity / (noise.value * noise.value * log.sample_time),
                  0.5 / (order + extension));
}

}  // namespace esokit
