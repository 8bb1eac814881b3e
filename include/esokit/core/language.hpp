/// @file
/// Included first by every header: checks that the compiler runs in C++20 mode.
#pragma once

// A missing include instead of #error: after #error the compiler would go on and report hundreds of
// errors, after this it stops. (GCC 10 in C++20 mode has __cplusplus 201709.)
#if __cplusplus < 201709L && (!defined(_MSVC_LANG) || _MSVC_LANG < 202002L)
#include <esokit needs C++20: compile with -std=c++20 or later>
#endif
