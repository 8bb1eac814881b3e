/// @file
/// The measured sets beside the repository, with what is independently known of them. Numbers to
/// compare with are those of the notes beside the data, from an independent program.
#pragma once

#include <filesystem>

#include "common/report.hpp"

namespace from_log {

/// All sets that are there; false if none is.
bool measured_sets(esokit::examples::Report& report, const std::filesystem::path& data);

}  // namespace from_log
