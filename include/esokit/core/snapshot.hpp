/// @file
/// A finished observer or controller as words: designed on the host, pasted into firmware; or kept
/// over a restart.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/unroll.hpp>
#include <esokit/core/version.hpp>
#include <type_traits>

namespace esokit {

/// Settings and state of a T: the memory of a T, then a checksum. Good for the same version of the
/// library, and for targets that lay a T out alike: the same size is checked at compile time, the
/// sizes of its members are not. x86-64, ARM and RISC-V agree on float types of the library.
template <class T>
requires(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(std::uint32_t) == 0)  //
    using Snapshot = std::array<std::uint32_t, sizeof(T) / sizeof(std::uint32_t) + 1>;

namespace detail {

/// FNV-1a over whole words, begun with the version of the library.
template <std::size_t Count>
constexpr std::uint32_t checksum(const std::array<std::uint32_t, Count>& words,
                                 std::size_t used) noexcept {
  constexpr std::uint32_t version = (std::uint32_t{ESOKIT_VERSION_MAJOR} << 16u) ^
                                    (std::uint32_t{ESOKIT_VERSION_MINOR} << 8u) ^
                                    std::uint32_t{ESOKIT_VERSION_PATCH};
  std::uint32_t hash = 2166136261u ^ version;
  for (std::size_t i = 0; i < used; ++i) hash = (hash ^ words[i]) * 16777619u;
  return hash;
}

}  // namespace detail

/// All that `object` is. `snapshot_text` of core/snapshot_text.hpp prints it.
template <class T>
[[nodiscard]] Snapshot<T> snapshot(const T& object) noexcept {
  constexpr std::size_t count = sizeof(T) / sizeof(std::uint32_t);
  Snapshot<T> words{};
  std::memcpy(words.data(), &object, sizeof(T));  // no bit_cast: T may have padding
  words[count] = detail::checksum(words, count);
  return words;
}

/// The object that `words` were made of, with no design work: no exp, no iteration.
/// @return error where the words are not as `snapshot` made them: a digit lost, another version of
///         the library, another type of the same size that was changed by hand
template <class T>
[[nodiscard]] Expected<T, Error<typename T::scalar_type>> from_snapshot(
    const Snapshot<T>& words) noexcept {
  constexpr std::size_t count = sizeof(T) / sizeof(std::uint32_t);
  if (words[count] != detail::checksum(words, count)) {
    return Error<typename T::scalar_type>{"snapshot", {}, "has a wrong checksum"};
  }
  std::array<std::uint32_t, count> memory{};
  for (std::size_t i = 0; i < count; ++i) memory[i] = words[i];
  return std::bit_cast<T>(memory);
}

}  // namespace esokit
