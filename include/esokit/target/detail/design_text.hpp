/// @file
/// What a written text says of its design: which machine it is for, and which of its versions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <esokit/core/detail/compiled.hpp>
#include <esokit/target/detail/recorded_numbers.hpp>
#include <string>
#include <vector>

namespace esokit::detail {

/// The version of esokit and the structure: "esokit 0.1.0: order 2, 3 states, float".
[[nodiscard]] std::string structure_text(const RecordedDesign& design);

/// Bandwidths, or poles and gains where there is no such number: "omega_o = 100 rad/s, omega_c = 15
/// rad/s". They are computed from what was recorded, not from what was asked for.
[[nodiscard]] std::string dynamics_text(const RecordedDesign& design);

/// What a number of the state is, from its estimate: "y' T", or "" if none is it alone.
/// @param state its place in RecordedDesign::members
[[nodiscard]] std::string scale_text(const RecordedDesign& design, std::size_t state);

/// A hash of the design as C, whatever its name, comment and self-test, of 8 digits: one bit more
/// in a gain or a rule changes it. Settings in a struct are not in it.
[[nodiscard]] std::string design_hash(const RecordedDesign& design);

/// FNV-1a.
[[nodiscard]] std::uint32_t hash_of(const std::string& text);

}  // namespace esokit::detail

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/target/impl/design_text.ipp>
#endif
