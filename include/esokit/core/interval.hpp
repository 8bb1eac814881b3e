/// @file
/// An interval of real numbers.
#pragma once

#include <esokit/core/language.hpp>

namespace esokit {

/// From `lower` to `upper`.
template <class S = double>
struct Interval {
  S lower{};  ///< lower end
  S upper{};  ///< upper end, may be infinite
};

}  // namespace esokit
