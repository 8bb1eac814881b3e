/// @file
/// What every header includes first: the language that the library is written in.
#pragma once

// Not #error: after it a compiler goes on, through hundreds of errors. This one is the only one.
// (GCC 10 calls its C++20 201709.)
#if __cplusplus < 201709L && (!defined(_MSVC_LANG) || _MSVC_LANG < 202002L)
#include <esokit needs C++20: compile with -std=c++20 or later>
#endif
