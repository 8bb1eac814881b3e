#!/usr/bin/env bash
# What a newcomer gets wrong must not compile (or warn), in a message that is short and says what is
# wrong: tests/first_errors/run.sh [COMPILER...]. Each file names the text that has to come. In another
# language than C++20 it has to be the only error.
set -uo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.." || exit 1
compilers=("$@")
((${#compilers[@]} > 0)) || compilers=(c++)
most_lines=45
eigen=${EIGEN:-/usr/include/eigen3}
passed=0
failed=0

for compiler in "${compilers[@]}"; do
  for file in tests/first_errors/*.cpp; do
    expected=$(sed -n '1s|^// expect: ||p' "$file")
    language=$(sed -n '2s|^// language: ||p' "$file")
    output=$("$compiler" -std="${language:-c++20}" -Wall -Werror -Iinclude -isystem "$eigen" -fsyntax-only "$file" 2>&1)
    status=$?
    lines=$(wc -l <<<"$output")
    errors=$(grep -c 'error:' <<<"$output")
    if ((status != 0 && lines <= most_lines)) && [[ -z $language || $errors == 1 ]] && [[ -n $expected ]] && grep -qE "$expected" <<<"$output"; then
      passed=$((passed + 1))
    else
      failed=$((failed + 1))
      echo "$compiler $file: status $status, $lines lines (at most $most_lines), expected '$expected':"
      head -n 20 <<<"$output"
    fi
  done
done
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
