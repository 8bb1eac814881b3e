#!/usr/bin/env bash
# Builds the page: examples/playground/build.sh [--no-install] [OUT.html]
# One file with everything in it. Where the compiler for WebAssembly cannot be had, it says so and ends
# with 0: the page is skipped. examples/run.sh calls it.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
root=$(cd -- "$here/../.." && pwd)
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
# Two modules: what is played with, at once; what reads a log or writes C, when it is asked for. The parts of from_log are
# compiled in two units, as native: one by one they take half as long again.
examples=$root/examples
unit() {  # NAME SOURCE..: only written where it changes
  local name=$1 text
  shift
  text=$(printf '#include "%s"\n' "$@")
  [[ -e $build/$name.cpp && $(<"$build/$name.cpp") == "$text" ]] || printf '%s\n' "$text" >"$build/$name.cpp"
}
unit play playground/module/{play,wasm}.cpp
unit log_reading common/{csv,figure}.cpp common/compiled/study.cpp \
  from_log/parts/{arguments,read_log,examine,page,show}.cpp playground/module/{log,log_wasm}.cpp
unit log_designing from_log/parts/{design,paste}.cpp playground/module/c_code.cpp

# No unit catches: what is thrown ends the module (log_wasm.cpp). -O1: three quarters of the time to compile.
compile() {
  ${CMAKE_CXX_COMPILER_LAUNCHER:-} clang++-14 --target=wasm32-wasi -std=c++20 -O1 "$2" -fno-rtti \
    -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror -I "$root/include" -I "$examples" -I "$examples/common" \
    -isystem /usr/include/eigen3 -c "$build/$1.cpp" -o "$build/$1.o"
}
link() {  # NAME OBJECT..: a reactor is a library, it has no main; a megabyte of stack, which does not grow into what is below it
  local name=$1
  shift
  clang++-14 --target=wasm32-wasi -fuse-ld=/usr/bin/wasm-ld-14 -mexec-model=reactor -Wl,--strip-all,--gc-sections \
    -Wl,-z,stack-size=1048576,--stack-first "${@/%/.o}" -lc-printscan-long-double -o "$name.wasm"
}
# What a log needs runs once for it: -Os makes the page 160 kB smaller.
compile log_designing -Os -fignore-exceptions &
designing=$!
compile log_reading -Os -fignore-exceptions
compile play -fno-exceptions
wait "$designing"
cd "$build"
link play play
link log log_reading log_designing
python3 "$here/assemble.py" play.wasm log.wasm "$page"
size=$(stat -c %s "$page")
echo "playground.html: $size bytes; its modules are $(stat -c %s play.wasm) and $(stat -c %s log.wasm)"
((size < 2200000))
