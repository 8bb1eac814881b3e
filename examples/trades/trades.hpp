/// @file
/// What the pages by trade share.
#pragma once

#include <cstdio>
#include <esokit/identify/identify.hpp>
#include <sstream>
#include <string>
#include <utility>

#include "common/report.hpp"

namespace trades {

inline esokit::examples::About about(std::string title, std::string description) {
  return {.paper_title = "By trade",
          .citation = "No paper. Complete code to copy into your own project",
          .link = "",
          .title = std::move(title),
          .description = std::move(description)};
}

/// time, u, y of the log, its first columns; from_log reads the file itself.
inline esokit::Log rows_of(const std::string& text) {
  esokit::Log log;
  std::istringstream in(text);
  std::string line;
  for (std::getline(in, line); std::getline(in, line);) {
    double t = 0, u = 0, y = 0;
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf", &t, &u, &y) != 3) continue;
    log.time.push_back(t);
    log.u.push_back(u);
    log.y.push_back(y);
  }
  return log;
}

}  // namespace trades
