/// @file
/// The build of a program that uses the widest registers of the machine that it runs on.
#pragma once

#include <cstdio>
#include <filesystem>
#include <system_error>

#if defined(__linux__)
#include <unistd.h>
#endif

namespace esokit::examples {

/// Programs that gain by it are built twice, plain and in the folder x86-64-v3 beside with AVX2 and
/// FMA; called first thing in main, this goes on as the second where the processor can. Two
/// programs and not two functions: what the headers define inline there is only once in a program,
/// and the linker would be free to take the one that an older machine cannot run.
inline void take_widest([[maybe_unused]] char** argv) {
#if defined(__linux__) && defined(__x86_64__) && !defined(__AVX2__)
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma") ||
      !__builtin_cpu_supports("bmi2")) {
    return;
  }
  std::error_code none;
  const auto own = std::filesystem::read_symlink("/proc/self/exe", none);
  const auto other = own.parent_path() / "x86-64-v3" / own.filename();
  if (none || !std::filesystem::exists(other, none)) return;
  execv(other.c_str(), argv);
  std::perror(other.c_str());  // and goes on as it is
#endif
}

}  // namespace esokit::examples
