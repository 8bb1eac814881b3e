#pragma once

#include <algorithm>
#include <cstdint>
#include <esokit/core/expected.hpp>
#include <esokit/target/c_code.hpp>
#include <esokit/target/c_design.hpp>
#include <esokit/target/list_writer.hpp>
#include <esokit/target/recorded_design.hpp>
#include <esokit/target/writable.hpp>
#include <string>

namespace esokit {

namespace detail {

/// The texts of a design. @param mark of its text, if settings can be changed
inline CCode c_texts(const RecordedDesign& design, const std::string& mark) {
  CDesign text(design, mark);
  return {text.header(), text.source(), text.settings_file()};
}

ESOKIT_FUNCTION CCode c_code(const RecordedDesign& design) {
  if (!design.options.settings_in_struct) return c_texts(design, "");
  RecordedDesign rest = design;
  for (double& number : rest.numbers) number = 0;
  for (auto& row : rest.gap_gains) std::fill(row.begin(), row.end(), 0.0);
  if (rest.recovers) {  // what is due, and from which gap on, are settings, too
    std::fill(rest.recovery.begin(), rest.recovery.end(), std::uint16_t{0});
    rest.max_gap = 0;
  }
  rest.samples.clear();
  rest.options.comment = {};
  rest.options.settings_name = {};
  const CCode same = c_texts(rest, "");
  std::uint32_t mark = 2166136261u;  // FNV-1a
  for (const char c : same.header + same.source) {
    mark = (mark ^ static_cast<unsigned char>(c)) * 16777619u;
  }
  return c_texts(design, std::to_string(mark) + "u");
}

}  // namespace detail
}  // namespace esokit
