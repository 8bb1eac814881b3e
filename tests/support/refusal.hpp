/// @file
/// What a refusal says, as tests compare it: a field alone would also pass for another rule of it.
#pragma once

#include <string>

namespace esokit_test {

inline std::string refusal_text(const char* field, int index, const char* rule) {
  const std::string place = index == -1 ? "" : "[" + std::to_string(index) + "]";
  return field + place + ": " + rule;
}

/// `field: rule` or `field[index]: rule` of a refusal, "accepted" where there is none. The value
/// and the limit are numbers and compared as such.
template <class Made>
std::string refusal(const Made& made) {
  if (made) return "accepted";
  return refusal_text(made.error().field, made.error().index, made.error().rule);
}

}  // namespace esokit_test
