#!/usr/bin/env bash
# What a header costs to include: cmake/inclusion_cost.sh [HEADER...]
# Least of three compiles of a file that only includes it (-fsyntax-only), and its preprocessed
# lines, beside Eigen/Dense; without arguments the headers that users include. CXX chooses the
# compiler, EIGEN the folder of Eigen, CXXFLAGS more options (-DESOKIT_COMPILED: what is
# declared alone, for those who link esokit::compiled).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
compiler=${CXX:-c++}
eigen=${EIGEN:-/usr/include/eigen3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

headers=("$@")
if ((${#headers[@]} == 0)); then
  headers=(esokit/esokit.hpp)
  while IFS= read -r header; do headers+=("${header#include/}"); done < <(
    find include/esokit/observer include/esokit/control include/esokit/analysis include/esokit/sim \
      -name '*.hpp' | LC_ALL=C sort
  )
fi

measure() {  # milliseconds and preprocessed lines of including $1
  echo "#include <$1>" >"$work/main.cpp"
  local -a command=("$compiler" -std=c++20 ${CXXFLAGS:-} -Iinclude -isystem "$eigen" "$work/main.cpp")
  local best= started spent lines
  for _ in 1 2 3; do
    started=${EPOCHREALTIME/[.,]/}
    "${command[@]}" -fsyntax-only
    spent=$((${EPOCHREALTIME/[.,]/} - started))
    if [[ -z $best ]] || ((spent < best)); then best=$spent; fi
  done
  lines=$("${command[@]}" -E -P | wc -l)
  echo "$((best / 1000)) $lines"
}

read -r dense_time dense_lines < <(measure Eigen/Dense)
echo "| header | ms | preprocessed lines | time of Eigen/Dense |"
echo "|---|---|---|---|"
echo "| Eigen/Dense | $dense_time | $dense_lines | 1 |"
for header in "${headers[@]}"; do
  read -r time lines < <(measure "$header")
  printf '| %s | %d | %d | %d.%02d |\n' "$header" "$time" "$lines" \
    $((time / dense_time)) $((time * 100 / dense_time % 100))
done
