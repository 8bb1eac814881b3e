/// @file
/// A tuned controller as C++ source.
#pragma once

#include <esokit/core/detail/compiled.hpp>
#include <esokit/tune/families.hpp>
#include <esokit/tune/specification.hpp>
#include <esokit/tune/tuning.hpp>
#include <string>

namespace esokit {

namespace detail {

/// A number as C++ source.
std::string source(double value);

/// The number that stands in the source.
double printed(double value);

/// The settings that stand in the source, so that what is said of a design is said of its code.
TuneSettings as_printed(TuneSettings s);

/// The controller as C++ source, in its parts.
struct ControllerSource {
  std::string observer;  ///< its type
  std::string config;    ///< of the observer, without its braces
  std::string law;       ///< `.gains = ..` or `.controller_bandwidth = ..`
  std::string soften;    ///< `.soften = ..`

  /// Type and config, to paste.
  [[nodiscard]] std::string text(const TuneModel& model) const;
};

ControllerSource controller_source(const TunedDesign& d, const TuneModel& model);

/// All families for a model. A template, as `tune`, so that it costs compile time only where it is

}  // namespace detail
}  // namespace esokit

#if defined(ESOKIT_HEADER_ONLY)
#include <esokit/tune/impl/controller_source.ipp>
#endif
