/// @file
/// Version of the library; CMake checks that it agrees with the project version.
#pragma once

#define ESOKIT_VERSION_MAJOR 0
#define ESOKIT_VERSION_MINOR 1
#define ESOKIT_VERSION_PATCH 0
