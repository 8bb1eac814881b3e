/// @file
/// What a refusal says, as tests compare it: a field alone would also pass for another rule of it.
#pragma once

#include <string>
#include <support/refusal.hpp>

namespace esokit_test {

/// `field: rule` or `field[index]: rule` of a refusal, "accepted" where there is none. The value
/// and the limit are numbers and compared as such.
template <class Made>
std::string refusal(const Made& made) {
  if (made) return "accepted";
  const auto& error = made.error();
  const std::string place = error.index == -1 ? "" : "[" + std::to_string(error.index) + "]";
  return error.field + place + ": " + error.rule;
}

}  // namespace esokit_test
