#!/usr/bin/env bash
# The umbrella header without a warning in C++20 and the newest language, and bad numbers refused at
# -O3 -ffast-math, with every compiler of a list that is installed: tests/compilers/run.sh [COMPILER...]
# A compiler may bring options ("clang++-19 -stdlib=libc++"). The last line is "N passed, N failed".
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.." || exit 1
compilers=("$@")
((${#compilers[@]} > 0)) || compilers=(g++-11 g++-12 g++-13 g++-14 clang++-14 clang++-15 clang++-16
  clang++-17 clang++-18 clang++-19 "clang++-19 -stdlib=libc++")
warnings=(-Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror)
includes=(-Iinclude -Itests -isystem "${EIGEN:-/usr/include/eigen3}")
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
printf '#include <esokit/esokit.hpp>\n' >"$work/umbrella.cpp"
printf '#include <cstdio>\n' >"$work/empty.cpp"
printf 'int main() { return 0; }\n' >"$work/program.cpp"

check() {  # check COMPILER LANGUAGE: 0 if it does
  read -ra command <<<"$1"
  "${command[@]}" "-std=$2" "${warnings[@]}" "${includes[@]}" -fsyntax-only "$work/umbrella.cpp" &&
    { [[ $2 != c++20 ]] || {
      "${command[@]}" "-std=$2" -O3 -ffast-math "${warnings[@]}" "${includes[@]}" \
        tests/compilers/refuses.cpp -o "$work/refuses" && "$work/refuses"
    }; }
}

passed=0 failed=0
for compiler in "${compilers[@]}"; do
  read -ra command <<<"$compiler"
  if ! "${command[@]}" -std=c++20 "$work/program.cpp" -include "$work/empty.cpp" -o "$work/program" 2>"$work/why"; then
    echo "skipped: $compiler ($(head -n 1 "$work/why"))"
    continue
  fi
  newest=c++2b
  ! "${command[@]}" -std=c++2c -fsyntax-only "$work/program.cpp" 2>/dev/null || newest=c++2c
  for language in c++20 $newest; do
    if check "$compiler" "$language" >"$work/log" 2>&1; then
      passed=$((passed + 1))
      echo "ok: $compiler $language"
    else
      failed=$((failed + 1))
      echo "FAILED: $compiler $language"
      head -n 20 "$work/log"
    fi
  done
done
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
