/// @file
/// A number that tells a type from others of the same size, made from a declared name: the
/// same with every compiler and on every target, without RTTI. Also the CRC-32 from which it is
/// made.
#pragma once

#include <cstdint>
#include <esokit/core/language.hpp>

namespace esokit {

namespace detail {

/// State of a CRC-32 before the first byte. The checksum is the complement of the state after the
/// last byte.
inline constexpr std::uint32_t crc32_start = 0xffffffffu;

/// CRC-32 of IEEE 802.3 (reflected polynomial 0xEDB88320) over the `bytes` low bytes of a word, the
/// lowest first. Computed bit by bit: in firmware it runs once, and a table would take more flash
/// than the loop.
constexpr std::uint32_t crc32(std::uint32_t state, std::uint32_t word, int bytes = 4) noexcept {
  state ^= word;
  for (int bit = 0; bit < 8 * bytes; ++bit) {
    state = (state >> 1u) ^ ((state & 1u) != 0 ? 0xedb88320u : 0u);
  }
  return state;
}

}  // namespace detail

/// Tells T from types of the same size in a snapshot. Zero for a type that declares none: then only
/// its size tells it from others. For a type of your own specialise it with `make_type_tag`.
template <class T>
inline constexpr std::uint32_t type_tag = 0;

/// Tag made from a declared name, the tags of template arguments that are types, and template
/// arguments that are numbers.
template <class... Arguments, class... Numbers>
[[nodiscard]] consteval std::uint32_t make_type_tag(const char* name, Numbers... numbers) {
  std::uint32_t state = detail::crc32_start;
  for (; *name != '\0'; ++name) state = detail::crc32(state, static_cast<unsigned char>(*name), 1);
  ((state = detail::crc32(state, type_tag<Arguments>)), ...);
  ((state = detail::crc32(state, static_cast<std::uint32_t>(numbers))), ...);
  return ~state;
}

/// Tags of the plain scalars. The format of long double differs between targets, but so does its
/// size.
/// @{
template <>
inline constexpr std::uint32_t type_tag<float> = make_type_tag<>("float");
template <>
inline constexpr std::uint32_t type_tag<double> = make_type_tag<>("double");
template <>
inline constexpr std::uint32_t type_tag<long double> = make_type_tag<>("long double");
/// @}

}  // namespace esokit
