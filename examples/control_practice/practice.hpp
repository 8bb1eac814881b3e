/// @file
/// What the examples of this folder share: they show no paper, but controllers at work.
#pragma once

#include <string>
#include <utility>

#include "common/report.hpp"

namespace practice {

inline const std::string folder = "control_practice";

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "Control in practice",
          .citation =
              "No paper. Limits, start-up, lost samples, retuning, an existing PID, two channels",
          .link = "",
          .title = std::move(title),
          .description = std::move(description)};
}

}  // namespace practice
