#!/usr/bin/env bash
# Builds and runs the tests; installs what a fresh Debian 12 lacks.
# usage: tests/run.sh [--no-install] [ctest arguments...]     e.g. tests/run.sh -R linear_eso
# The last line is "N passed, N failed"; the status is 0 only if tests ran and all passed.
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
source "$root/cmake/debian_packages.sh"
source "$root/cmake/ctest_count.sh"

no_install=()
if [[ "${1:-}" == --no-install ]]; then
  no_install=(--no-install)
  shift
fi
require_packages "${no_install[@]}" "${ESOKIT_BUILD_PACKAGES[@]}" "${ESOKIT_TEST_PACKAGES[@]}"

cd "$root"
started=$SECONDS
if ! cmake --preset tests || ! cmake --build --preset tests --parallel "$(nproc)"; then
  echo "the tests do not build"
  echo "0 passed, 1 failed"
  exit 1
fi
echo "built in $((SECONDS - started)) s"

started=$SECONDS
status=0
run_ctest build/tests "$@" || status=$?
echo "ran in $((SECONDS - started)) s"
echo "$CTEST_PASSED passed, $CTEST_FAILED failed"
exit "$status"
