#!/usr/bin/env bash
# What a newcomer gets wrong must not compile (or warn), and the first line with an error must say what is
# wrong: tests/first_errors/run.sh [--only NAME] [COMPILER...]. Each file names the text that has to be in this
# line (`expect`, an extended regular expression), and may name one that comes anywhere (`also`), or a longest
# output (`lines`). A message of our own is a sentence that begins with "esokit:". In another language than
# C++20 it is the only error.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.." || exit 1
only='*'
if [[ ${1:-} == --only ]]; then
  only=$2
  shift 2
fi
compilers=("$@")
((${#compilers[@]} > 0)) || compilers=(c++)
most_lines=70
eigen=${EIGEN:-/usr/include/eigen3}
passed=0
failed=0

for compiler in "${compilers[@]}"; do
  for file in tests/first_errors/$only.cpp; do
    said() { sed -n "1,5s|^// $1: ||p" "$file"; }
    expected=$(said expect)
    also=$(said also)
    language=$(said language)
    most=$(said lines)
    output=$("$compiler" -std="${language:-c++20}" -Wall -Werror -Iinclude -isystem "$eigen" -fsyntax-only "$file" 2>&1)
    status=$?
    lines=$(wc -l <<<"$output")
    errors=$(grep -c 'error:' <<<"$output")
    first=$(grep -m 1 'error:' <<<"$output")
    if ((status != 0 && lines <= ${most:-$most_lines})) && [[ -z $language || $errors == 1 ]] && [[ -n $expected ]] &&
      grep -qE "$expected" <<<"$first" && grep -qE "$also" <<<"$output"; then
      passed=$((passed + 1))
    else
      failed=$((failed + 1))
      echo "$compiler $file: status $status, $lines lines (at most ${most:-$most_lines}), expected '$expected' in the first error${also:+, '$also' anywhere}:"
      head -n 20 <<<"$output"
    fi
  done
done
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
