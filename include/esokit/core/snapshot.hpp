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
#include <esokit/core/type_tag.hpp>
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

/// CRC-32 over version of the library, size and type, then the words before the last. Any three
/// wrong bits and any 32 in a row are found, whatever the type (up to 11 KB).
template <class T>
constexpr std::uint32_t checksum(const Snapshot<T>& words) noexcept {
  constexpr std::uint32_t version = (std::uint32_t{ESOKIT_VERSION_MAJOR} << 16u) ^
                                    (std::uint32_t{ESOKIT_VERSION_MINOR} << 8u) ^
                                    std::uint32_t{ESOKIT_VERSION_PATCH};
  constexpr std::uint32_t start =
      crc32(crc32(crc32(crc32_start, version), std::uint32_t{sizeof(T)}), type_tag<T>);
  std::uint32_t state = start;
  for (std::size_t i = 0; i + 1 < words.size(); ++i) state = crc32(state, words[i]);
  return ~state;
}

}  // namespace detail

/// All that `object` is. `snapshot_text` of core/snapshot_text.hpp prints it.
template <class T>
[[nodiscard]] Snapshot<T> snapshot(const T& object) noexcept {
  Snapshot<T> words{};
  std::memcpy(words.data(), &object, sizeof(T));  // no bit_cast: T may have padding
  words.back() = detail::checksum<T>(words);
  return words;
}

/// The object that `words` were made of, with no design work: no exp, no iteration.
/// @return error where the words are not as `snapshot` made them: a digit lost, another version of
///         the library, another type. Types are told by `type_tag`; those that declare none (a
///         model or a gain law of your own) by the size of the whole
template <class T>
[[nodiscard]] Expected<T, Error<typename T::scalar_type>> from_snapshot(
    const Snapshot<T>& words) noexcept {
  constexpr std::size_t count = sizeof(T) / sizeof(std::uint32_t);
  if (words[count] != detail::checksum<T>(words)) {
    return Error<typename T::scalar_type>{
        "snapshot", {}, "has a wrong checksum: damaged, or of another type or version"};
  }
  std::array<std::uint32_t, count> memory{};
  for (std::size_t i = 0; i < count; ++i) memory[i] = words[i];
  return std::bit_cast<T>(memory);
}

}  // namespace esokit
