# Bash library: runs ctest and counts.

# run_ctest BUILD_DIR [ctest arguments...]
# Sets CTEST_PASSED and CTEST_FAILED. Fails when a test fails, and when none passed: a run without
# tests counts as one failure, or an empty build would look like success.
run_ctest() {
  local build=$1 report status=0 suite
  shift
  local number='"([0-9]+)"'
  report=$(cd "$build" && pwd)/ctest.xml
  rm -f "$report"
  CTEST_PASSED=0
  CTEST_FAILED=0
  ctest --test-dir "$build" --parallel "$(nproc)" --output-on-failure --no-tests=error \
    --output-junit "$report" "$@" </dev/null || status=$?

  # Of the summary line of ctest the wording differs between versions, this report does not. Skipped
  # and disabled tests are neither passed nor failed.
  if [[ -f $report ]]; then
    suite=$(tr '\n\t' '  ' <"$report" | grep -o '<testsuite [^>]*>' | head -n 1) || suite=
    local tests=0 skipped=0 disabled=0
    [[ $suite =~ [[:space:]]tests=$number ]] && tests=${BASH_REMATCH[1]}
    [[ $suite =~ [[:space:]]failures=$number ]] && CTEST_FAILED=${BASH_REMATCH[1]}
    [[ $suite =~ [[:space:]]skipped=$number ]] && skipped=${BASH_REMATCH[1]}
    [[ $suite =~ [[:space:]]disabled=$number ]] && disabled=${BASH_REMATCH[1]}
    CTEST_PASSED=$((tests - CTEST_FAILED - skipped - disabled))
  fi
  if ((CTEST_FAILED == 0 && (CTEST_PASSED == 0 || status != 0))); then
    CTEST_FAILED=1
  fi
  ((CTEST_FAILED == 0))
}
