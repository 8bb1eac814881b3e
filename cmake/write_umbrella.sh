#!/usr/bin/env bash
# Writes include/esokit/esokit.hpp: every public header, in alphabetical order.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../include"
{
  cat <<'END'
/// @file
/// Everything of esokit. Firmware may prefer the headers that it uses, one file an observer.
#pragma once

END
  find esokit -name '*.hpp' ! -path esokit/esokit.hpp | LC_ALL=C sort | sed 's/.*/#include <&>/'
} >esokit/esokit.hpp.new
mv esokit/esokit.hpp.new esokit/esokit.hpp
