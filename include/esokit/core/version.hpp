/// @file
/// Version of the library; CMake checks that it agrees with the project version.
#pragma once

/// Rises with changes that break code (semantic versioning).
#define ESOKIT_VERSION_MAJOR 0
/// Rises with additions; below 1.0 with changes that break code, too.
#define ESOKIT_VERSION_MINOR 1
/// Rises with corrections.
#define ESOKIT_VERSION_PATCH 0
