#!/usr/bin/env bash
# Proves C that to_c writes, by Frama-C's Eva, for all executions at once. See usage below.
set -euo pipefail
folder=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
root=$(cd -- "$folder/../.." && pwd)

usage() {
  cat <<'END'
usage: examples/embedded/prove.sh [--no-install] [--few | --write] [KIND ...]

  --no-install   do not install missing Debian packages, only name them (status 3)
  --few          a handful of the kinds of proof/write_kinds.cpp, for the CI
  --write        write the table of README.md instead of comparing it
  KIND           only these, of proof/write_*.cpp, and what is broken in them
  --help         this text

Each kind is called for ever, in any order, with any numbers. C of it that was broken in one place has to be refused.
The last line is "N passed, N failed"; the status is 0 only if nothing failed.
END
}

no_install=()
given=()
for option in "$@"; do
  case $option in
    --no-install) no_install=(--no-install) ;;
    -h | --help)
      usage
      exit 0
      ;;
    --few | --write | [a-z]*) given+=("$option") ;;
    *)
      echo "prove.sh: unknown option $option" >&2
      usage >&2
      exit 2
      ;;
  esac
done

# shellcheck source=cmake/debian_packages.sh
source "$root/cmake/debian_packages.sh"
require_packages ${no_install[@]+"${no_install[@]}"} g++ "${ESOKIT_PROOF_PACKAGES[@]}"

out=$root/build/proof
mkdir -p "$out"
writers=(write_kinds write_models)
[[ " ${given[*]} " == *" --few "* ]] && writers=(write_kinds)
for writer in "${writers[@]}"; do
  ${CMAKE_CXX_COMPILER_LAUNCHER:-} g++ -std=c++20 -O0 -I "$root/include" -c "$folder/proof/$writer.cpp" \
    -o "$out/$writer.o"
  g++ "$out/$writer.o" -o "$out/$writer"
  "$out/$writer" "$out"
done >"$out/kinds.tsv"
"$folder/proof/prove.py" "$out" ${given[@]+"${given[@]}"}
