#!/usr/bin/env bash
# Compiles every ```cpp block of the Markdown files and of the comments of the headers, and the examples
# of the reference:
# cmake/readme_snippets.sh [FILE...]
# A block with main() stands alone; the other blocks of a file follow one another in one function,
# after what the file declares for them in a comment: <!-- snippets: double y = 0; -->
# A block of a header has a scope of its own, after what is declared below for all headers.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.." || exit 1
compiler=${CXX:-c++}
eigen=${EIGEN:-/usr/include/eigen3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
passed=0
failed=0

files=("$@")
if ((${#files[@]} == 0)); then
  mapfile -t files < <(find . \( -name .git -o -name build -o -name out \) -prune -o -name '*.md' -print | LC_ALL=C sort)
fi

headers() {
  cat <<'END'
#include <cstdio>
#include <esokit/esokit.hpp>
namespace esokit {
void snippets() {
  double y = 0, next_reference = 0;
  auto plant = LinearPlant<3>::transfer_function({.numerator = {6}, .denominator = {6, 11, 6}}).value();
  auto controller = PredictiveAdrc<LinearEso<2>>::make({}).value();
  auto identified = identify(Log{});
  const auto chain = LinearPlant<2>::chain({.input_gain = 1.0}).value();
  const auto motor = sim::DisturbedPlant<2>::make({.plant = chain}).value();
  const auto observer = ContinuousLinearEso<2>::make({}).value();
  const auto law = AdrcLaw<2>::make({}).value();
END
  grep -rhE '^ *///' include |
    awk '/\/\/\/ ```cpp$/ { inside = 1; print "{"; next } /\/\/\/ ```$/ && inside { inside = 0; print "}" }
         inside { sub(/^ *\/\/\/ ?/, ""); print }'
  echo "}  // snippets"
  echo "}  // namespace esokit"
}

try() {  # try SOURCE NAME; the definitions of what is declared are compiled elsewhere
  if "$compiler" -std=c++20 -fsyntax-only -DESOKIT_COMPILED -Iinclude -Iexamples "-I$(dirname -- "$2")" -isystem "$eigen" "$1" 2>"$work/errors"; then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    echo "$2:"
    head -n 15 "$work/errors"
  fi
}

# read_results FILE: what its programs write is read as it says, in the languages that are here.
read_results() {
  local language reader block wrote=no status
  grep -qE '^```(python|octave)$' "$1" || return 0
  mkdir -p "$work/results"
  for language in python octave; do
    awk -v language="$language" '$0 == "```" language { inside = 1; next } /^```/ { inside = 0 } inside' "$1" \
      >"$work/results/read.$language"
    [[ -s $work/results/read.$language ]] || continue
    reader=(octave-cli --quiet --norc)
    [[ $language == octave ]] || reader=(/usr/bin/python3)
    if ! command -v "${reader[0]}" >/dev/null || { [[ $language == python ]] && ! "${reader[0]}" -c 'import numpy' 2>/dev/null; }; then
      echo "skipped: $1, what reads its results in $language: not installed"
      continue
    fi
    for block in "$work"/block-*; do
      [[ $wrote == no ]] && grep -q 'std::ofstream' "$block" && grep -q 'int main' "$block" || continue
      "$compiler" -std=c++20 -O1 -Iinclude -isystem "$eigen" -x c++ "$block" -o "$work/results/program" -pthread &&
        (cd "$work/results" && ./program) && wrote=yes
    done
    (cd "$work/results" && "${reader[@]}" "read.$language") >"$work/results/said" 2>"$work/errors"
    status=$?
    # What is said has numbers, and none is missing. (Octave 7 reports its own end as an error, with status 0.)
    if ((status == 0)) && grep -qE '[0-9]' "$work/results/said" && ! grep -qiE '\bnan\b' "$work/results/said"; then
      passed=$((passed + 1))
    else
      failed=$((failed + 1))
      echo "$1, $language: $(head -n 5 "$work/results/said" "$work/errors")"
    fi
  done
  if [[ $wrote == yes ]] && command -v gnuplot >/dev/null && [[ -s $work/results/run.gp ]]; then
    (cd "$work/results" && gnuplot -d -e "set terminal svg size 900,900; set output 'run.svg'" run.gp) 2>"$work/errors"
    if [[ ! -s $work/errors ]] && (($(grep -c '<path' "$work/results/run.svg") > 4)); then
      passed=$((passed + 1))
    else
      failed=$((failed + 1))
      echo "$1: its figure: $(head -n 5 "$work/errors")"
    fi
  fi
}

for file in "${files[@]}"; do
  rm -f "$work"/block-* "$work/loose.cpp"
  awk -v work="$work" '
    /^[ ]*```cpp[ \t]*$/ { inside = 1; out = sprintf("%s/block-%02d.cpp", work, ++count); next }
    /^[ ]*```/ && inside { inside = 0; close(out) }
    inside { print > out }' "$file"
  loose=()
  read_results "$file"
  for block in "$work"/block-*; do
    [[ -e $block ]] || continue
    if grep -q 'int main' "$block"; then
      try "$block" "$file"
    else
      loose+=("$block")
    fi
  done
  ((${#loose[@]} > 0)) || continue
  {
    echo "#include <cstdio>"
    grep -hE '^ *#include' "${loose[@]}"
    sed -n 's/^<!-- snippets-include: \(.*\) -->$/#include \1/p' "$file"
    echo "void snippets() {"
    sed -n 's/^<!-- snippets: \(.*\) -->$/\1/p' "$file"
    grep -hvE '^ *#include' "${loose[@]}"
    echo "}"
  } >"$work/loose.cpp"
  try "$work/loose.cpp" "$file"
done
if (($# == 0)); then
  headers >"$work/headers.cpp"
  try "$work/headers.cpp" "comments of the headers"
  # The examples of the reference also run: their settings must be accepted.
  if "$compiler" -std=c++20 -Iinclude -isystem "$eigen" cmake/reference_examples.cpp -o "$work/examples" 2>"$work/errors" &&
    "$work/examples" >"$work/said" 2>"$work/errors"; then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    echo "cmake/reference_examples.cpp:"
    head -n 15 "$work/errors"
  fi
fi
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
