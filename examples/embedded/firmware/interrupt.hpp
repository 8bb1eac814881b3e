/// @file
/// How a controller runs in real firmware: one step in the timer interrupt, everything else in the
/// main loop.
#pragma once

namespace firmware {

/// 0.4 s of ADRC out of the timer interrupt. @return true if the servo got where it should
bool run_from_interrupt();

}  // namespace firmware
