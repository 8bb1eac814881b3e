/// @file
/// The command line of from_log.
#pragma once

#include <functional>
#include <string>

#include "from_log/parts/design.hpp"

namespace from_log {

/// What else is done with a design, given the path of its page.
using Beside = std::function<void(const Design& design, const std::string& page)>;

/// What `from_log` does with its arguments. @param beside with it a log has to be given
/// @return its exit code
int command(int argc, char** argv, const Beside& beside = {});

}  // namespace from_log
