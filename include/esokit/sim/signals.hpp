/// @file
/// Includes all signals.
#pragma once

#include <esokit/sim/combined_signals.hpp>    // IWYU pragma: export
#include <esokit/sim/elementary_signals.hpp>  // IWYU pragma: export
#include <esokit/sim/filtered_step.hpp>       // IWYU pragma: export
#include <esokit/sim/signal.hpp>              // IWYU pragma: export
