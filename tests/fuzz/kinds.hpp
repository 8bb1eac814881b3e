/// @file
/// The lists of types, one translation unit each.
#pragma once

#include <vector>

#include "fuzz/run.hpp"

namespace fuzz {

void add_observers(std::vector<Kind>& kinds);
void add_filters(std::vector<Kind>& kinds);
void add_controllers(std::vector<Kind>& kinds);
void add_studies(std::vector<Kind>& kinds);

}  // namespace fuzz
