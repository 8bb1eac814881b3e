/// @file
/// Version of the library; CMake checks that it agrees with the project version.
#pragma once

/// Rises with changes that break user code (semantic versioning).
#define ESOKIT_VERSION_MAJOR 0
/// Rises with additions; before version 1.0 also with changes that break user code.
#define ESOKIT_VERSION_MINOR 1
/// Rises with corrections.
#define ESOKIT_VERSION_PATCH 0
