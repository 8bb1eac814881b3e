#!/usr/bin/env bash
# Writes include/esokit/esokit.hpp, every public header, and include/esokit/impl/esokit.cpp, every
# definition that is compiled once; in alphabetical order.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../include"
includes() { find esokit -name "$1" ! -path esokit/esokit.hpp | LC_ALL=C sort | sed 's/.*/#include <&>/'; }
{
  cat <<'END'
/// @file
/// Everything of esokit. Firmware may prefer the headers that it uses, one file an observer.
#pragma once

END
  includes '*.hpp'
} >esokit/esokit.hpp.new
mv esokit/esokit.hpp.new esokit/esokit.hpp
{
  cat <<'END'
// The definitions of what only a workstation runs, compiled once: by the CMake target
// esokit::compiled, or by a line of your own, with ESOKIT_COMPILED in all that uses them.
#if !defined(ESOKIT_COMPILED)
#define ESOKIT_COMPILED
#endif

END
  includes '*.ipp'
} >esokit/impl/esokit.cpp.new
mv esokit/impl/esokit.cpp.new esokit/impl/esokit.cpp
