/// @file
/// Where the logs of real machines are.
#pragma once

#include <filesystem>

namespace esokit::examples {

/// The folder examples/data of the repository that the program was built from.
[[nodiscard]] std::filesystem::path measured_data();

}  // namespace esokit::examples
