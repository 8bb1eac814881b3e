# Bash library: runs ctest and counts.

# attribute NAME: of the line on standard input, as a number; 0 where it is not
attribute() {
  local line
  IFS= read -r line || true
  [[ $line =~ [[:space:]]$1=\"([0-9]+)\" ]] && echo "${BASH_REMATCH[1]}" || echo 0
}

# run_ctest BUILD_DIR [ctest arguments...]
# Sets CTEST_PASSED and CTEST_FAILED: cases of GoogleTest, and one for each program that has none. Fails
# when a test fails, and when none passed: a run without tests counts as one failure, or an empty build
# would look like success.
run_ctest() {
  local build=$1 status=0 suite report cases
  shift
  build=$(cd "$build" && pwd)
  report=$build/ctest.xml
  cases=$build/cases
  rm -rf "$report" "$cases"
  mkdir "$cases"
  CTEST_PASSED=0
  CTEST_FAILED=0
  GTEST_OUTPUT="xml:$cases/" ctest --test-dir "$build" --parallel "$(nproc)" --output-on-failure \
    --no-tests=error --output-junit "$report" "$@" </dev/null || status=$?

  # Of the summary line of ctest the wording differs between versions, this report does not. Skipped
  # and disabled tests are neither passed nor failed.
  if [[ -f $report ]]; then
    suite=$(tr '\n\t' '  ' <"$report" | grep -o '<testsuite [^>]*>' | head -n 1) || suite=
    local programs failed skipped file head tests bad
    programs=$(attribute tests <<<"$suite")
    failed=$(attribute failures <<<"$suite")
    skipped=$(($(attribute skipped <<<"$suite") + $(attribute disabled <<<"$suite")))
    CTEST_PASSED=$((programs - failed - skipped))
    CTEST_FAILED=$failed
    # A program that ends itself before its report is one failure.
    for file in "$cases"/*.xml; do
      [[ -f $file ]] || continue
      head=$(grep -m 1 -o '<testsuites [^>]*>' "$file") || continue
      tests=$(attribute tests <<<"$head")
      bad=$(($(attribute failures <<<"$head") + $(attribute errors <<<"$head")))
      skipped=$(($(grep -c 'result="skipped"' "$file") + $(attribute disabled <<<"$head")))
      CTEST_PASSED=$((CTEST_PASSED + tests - bad - skipped - (bad == 0)))
      CTEST_FAILED=$((CTEST_FAILED + bad - (bad > 0)))
    done
  fi
  if ((CTEST_FAILED == 0 && (CTEST_PASSED == 0 || status != 0))); then
    CTEST_FAILED=1
  fi
  ((CTEST_FAILED == 0))
}
