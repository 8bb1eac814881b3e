/// @file
/// One function an observer that is nothing but its `update`, for the table of sizes and counts.
#pragma once

namespace firmware {

using Update = unsigned(void* observer, float y, float u_applied);

extern "C" {
Update update_nothing;  ///< what the call itself costs
Update update_known;    ///< the same and 1025 instructions more; of the board
Update update_LinearEso;
Update update_CascadeEso;
Update update_AlgebraicEso;
Update update_AdjustableBandwidthEso;
Update update_NonlinearEso;
Update update_ExtendedStateFilter;
}

}  // namespace firmware
