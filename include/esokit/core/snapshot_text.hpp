/// @file
/// Prints a snapshot as C++, for the host.
#pragma once

#include <cstddef>
#include <cstdint>
#include <esokit/core/snapshot.hpp>
#include <string>

namespace esokit {

/// Declaration of a constant with the words of a snapshot, to paste into firmware: `inline
/// constexpr std::array<std::uint32_t, 13> NAME = {0x3f800000, ..};`
template <std::size_t Count>
[[nodiscard]] std::string snapshot_text(const std::string& name,
                                        const std::array<std::uint32_t, Count>& words) {
  constexpr const char* digits = "0123456789abcdef";
  constexpr std::size_t in_a_row = 8;
  std::string text =
      "inline constexpr std::array<std::uint32_t, " + std::to_string(Count) + "> " + name + " = {";
  for (std::size_t i = 0; i < Count; ++i) {
    if (i != 0) text += ",";
    text += i % in_a_row == 0 ? "\n    0x" : " 0x";
    for (int shift = 28; shift >= 0; shift -= 4) text += digits[(words[i] >> shift) & 15u];
  }
  return text + "};\n";
}

}  // namespace esokit
