/// @file
/// The command line of from_log.
#pragma once

namespace from_log {

/// What `from_log` does with its arguments. @return its exit code
int command(int argc, char** argv);

}  // namespace from_log
