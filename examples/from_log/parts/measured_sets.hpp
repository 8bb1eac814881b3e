/// @file
/// Observers over logs of examples/data, beside what is independently known of the machines.
/// Numbers to compare with are those of an independent program (numpy) over the same files.
#pragma once

#include "common/report.hpp"

namespace from_log {

/// Adds all sets to a page.
void measured_sets(esokit::examples::Report& report);

}  // namespace from_log
