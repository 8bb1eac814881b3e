/// @file
/// Where the definitions are of what only a workstation runs.
///
/// Headers declare it. By default they include the definitions, too, from the folder impl/ beside
/// them (ESOKIT_HEADER_ONLY). With ESOKIT_COMPILED these are compiled once, as
/// esokit/impl/esokit.cpp: the CMake target esokit::compiled.
#pragma once

#include <esokit/core/language.hpp>

#if !defined(ESOKIT_COMPILED) && !defined(ESOKIT_HEADER_ONLY)
/// Headers include their definitions. On, unless ESOKIT_COMPILED is defined.
#define ESOKIT_HEADER_ONLY 1
#endif

#if !defined(ESOKIT_COMPILED)
/// Before each definition of what a header declares.
#define ESOKIT_FUNCTION inline
#elif !defined(ESOKIT_HEADER_ONLY)
#define ESOKIT_FUNCTION
#else
#error "esokit: either ESOKIT_HEADER_ONLY or ESOKIT_COMPILED"
#endif
