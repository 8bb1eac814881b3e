/// @file
/// What the pages by trade share.
#pragma once

#include <string>
#include <utility>

#include "common/report.hpp"

namespace trades {

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "By trade",
          .citation = "No paper: what one writes in a project of one's own, complete",
          .link = "",
          .title = std::move(title),
          .description = std::move(description)};
}

}  // namespace trades
