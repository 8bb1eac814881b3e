/// @file
/// A finished observer or controller as 32-bit words: designed on the host and pasted into
/// firmware, or kept over a restart.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <esokit/core/detail/type_tag.hpp>
#include <esokit/core/error.hpp>
#include <esokit/core/expected.hpp>
#include <esokit/core/lanes.hpp>
#include <esokit/core/version.hpp>
#include <tuple>
#include <type_traits>

namespace esokit {

/// Settings and state of a T: the memory of a T, then a checksum. Valid only for the same version
/// of the library and for targets with the same layout of T in memory. That the size is the same is
/// checked at compile time, that the members have the same sizes is not. x86-64, ARM and RISC-V
/// have the same layout for the float types of the library.
template <class T>
requires(std::is_trivially_copyable_v<T> && sizeof(T) % sizeof(std::uint32_t) == 0)  //
    using Snapshot = std::array<std::uint32_t, sizeof(T) / sizeof(std::uint32_t) + 1>;

namespace detail {

/// CRC-32 over the library's version, size and type tag of T, then all words but the last. Finds
/// any three wrong bits and any burst of up to 32 bits in a T of up to 11 KB.
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

/// Copies the members of `part`, but not what lies between them, to where they lie in `memory`; of
/// a class whose members are unknown (see LaneAccess) all bytes.
/// @param whole the object that `part` is in
template <class Part>
void copy_members(unsigned char* memory, const void* whole, const Part& part) noexcept {
  if constexpr (std::is_empty_v<Part>) {
    // Nothing to copy, and its byte may belong to another member.
  } else if constexpr (HoldsElements<const Part> && !LaneAccess::counts<Part>) {
    for (decltype(part.size()) i = 0; i < part.size(); ++i) {
      copy_members(memory, whole, part.data()[i]);
    }
  } else if constexpr (IsTuple<Part>::value) {
    std::apply([&](const auto&... all) { (copy_members(memory, whole, all), ...); }, part);
  } else if constexpr (LaneAccess::names_members<Part>) {
    LaneAccess::with_members(part,
                             [&](const auto&... all) { (copy_members(memory, whole, all), ...); });
  } else {
    const auto* bytes = reinterpret_cast<const unsigned char*>(&part);
    std::memcpy(memory + (bytes - static_cast<const unsigned char*>(whole)), bytes, sizeof(Part));
  }
}

}  // namespace detail

/// Settings and state of `object`. `snapshot_text` of core/snapshot_text.hpp prints it.
/// Bytes between members are zero, so equal objects give equal words. Not within an adapter with
/// memory of its own (OutlierGate, VariableTime, Measured, WrappedOutput, Guarded), a class of your
/// own, and whatever contains them: there these bytes may hold anything.
template <class T>
[[nodiscard]] Snapshot<T> snapshot(const T& object) noexcept {
  Snapshot<T> words{};
  // No bit_cast, as T may have padding. And no __builtin_clear_padding: that of GCC 12 also clears
  // half of a number beside an empty member (a ModelEso was restored with another gain).
  detail::copy_members(reinterpret_cast<unsigned char*>(words.data()), &object, object);
  words.back() = detail::checksum<T>(words);
  return words;
}

/// The object from which `words` were made, without design work (no exp, no iteration).
/// @return error if the words are not as `snapshot` made them: a lost digit, another version of the
///         library, another type. Types are distinguished by `type_tag`, and by their size only if
///         they declare none (a model or gain law of your own)
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
