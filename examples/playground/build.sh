#!/usr/bin/env bash
# Builds the page: examples/playground/build.sh [--no-install] [OUT.html]
# One file with everything in it. Where the compiler for WebAssembly cannot be had, it says so and ends
# with 0: the page is skipped. examples/run.sh calls it.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
root=$here/../..
build=$root/build/playground
# shellcheck source=cmake/debian_packages.sh
source "$root/cmake/debian_packages.sh"

install_option=()
if [[ ${1:-} == --no-install ]]; then
  install_option=(--no-install)
  shift
fi
page=${1:-$root/out/playground.html}

if ! require_packages ${install_option[@]+"${install_option[@]}"} "${ESOKIT_WASM_PACKAGES[@]}"; then
  echo "skipped: the playground, as the packages for WebAssembly cannot be installed"
  exit 0
fi

mkdir -p "$build" "$(dirname -- "$page")"
# Nothing throws, and a reactor is a library: it has no main. -O1: three quarters of the time to compile.
options=(--target=wasm32-wasi -std=c++20 -O1 -fno-exceptions -fno-rtti -Wall -Wextra -Wpedantic
  -Wconversion -Wshadow -Werror -I "$root/include" -isystem /usr/include/eigen3)
for name in play wasm; do
  ${CMAKE_CXX_COMPILER_LAUNCHER:-} clang++-14 "${options[@]}" -c "$here/module/$name.cpp" -o "$build/$name.o"
done
clang++-14 --target=wasm32-wasi -fuse-ld=/usr/bin/wasm-ld-14 -mexec-model=reactor -Wl,--strip-all,--gc-sections \
  "$build/play.o" "$build/wasm.o" -o "$build/play.wasm"
python3 "$here/assemble.py" "$build/play.wasm" "$page"
size=$(stat -c %s "$page")
echo "playground.html: $size bytes, of them $(stat -c %s "$build/play.wasm") of the module before base64"
((size < 2000000))
