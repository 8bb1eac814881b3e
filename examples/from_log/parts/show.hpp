/// @file
/// The page of a log.
#pragma once

#include "from_log/parts/design.hpp"
#include "from_log/parts/from_log.hpp"
#include "from_log/parts/page.hpp"

namespace from_log {

/// Name of the page without its ending.
[[nodiscard]] std::string stem_of(const Settings& settings);

/// Of a refused log: the reason, what u, y and the residual show, and what to record instead.
[[nodiscard]] std::vector<std::string> why_refused(const Findings& findings);

/// A few sentences: what was found, and what to take.
[[nodiscard]] std::vector<std::string> in_short(const Findings& findings, const Design& design);

/// What was read, found and designed, as a page.
[[nodiscard]] Page show(const Settings& settings, const Input& input, const Findings& findings,
                        const Design& design);

/// The log through an observer that is typed in: a page, and the estimates as CSV beside it.
/// @return the page's path; empty if it could not be written
[[nodiscard]] std::string show_observer(const Settings& settings, const Input& input);

/// Reads, finds, designs.
struct Outcome {
  Input input;
  Findings findings;
  Design design;
  Status status = all_clear;

  /// The same for a log that did not come from a file.
  [[nodiscard]] Page page(const Settings& settings) const {
    return show(settings, input, findings, design);
  }
};
[[nodiscard]] Outcome work_out(const Settings& settings);
[[nodiscard]] Outcome work_out(const Settings& settings, const Input& input);

}  // namespace from_log
