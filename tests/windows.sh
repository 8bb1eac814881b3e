#!/usr/bin/env bash
# Builds from_log, examples/start and a quarter of the tests for Windows (MinGW-w64) and runs them with
# wine. The pages of from_log.exe are compared with those of the Linux program.
# usage: tests/windows.sh [--no-install] [--jobs N] [--linux FROM_LOG]
# --linux: the program to compare with (built at need). The last line is "N passed, N failed".
set -uo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
cd "$root" || exit 1
source cmake/debian_packages.sh

install_option=() jobs=$(nproc) linux=
while (($# > 0)); do
  case $1 in
    --no-install) install_option=(--no-install) ;;
    --jobs) jobs=$2 && shift ;;
    --linux) linux=$(realpath "$2") && shift ;;
    *) sed -n 's/^# //; 2,5p' "$0" >&2 && exit 2 ;;
  esac
  shift
done
# libgtest-dev brings GoogleTest as source, the one of Windows is compiled here.
if ! require_packages "${install_option[@]}" "${ESOKIT_BUILD_PACKAGES[@]}" "${ESOKIT_TEST_PACKAGES[@]}" \
  python3 "${ESOKIT_WINDOWS_PACKAGES[@]}"; then
  echo "skipped: the packages for Windows cannot be installed"
  exit 3
fi

out=$root/build/windows
mkdir -p "$out/tests/include"
# A home of its own for wine, and no screen, sound or web engine to set up.
export WINEPREFIX=$out/wine WINEDEBUG=-all WINEDLLOVERRIDES="mscoree,mshtml,winemenubuilder.exe="
unset DISPLAY
run() { /usr/lib/wine/wine64 "$@" </dev/null; }

passed=0 failed=0
verdict() {  # verdict STATUS TEXT
  if (($1 == 0)); then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    echo "FAILED: $2"
  fi
}
configure() {  # configure SOURCE BUILD [cmake arguments...]
  local source=$1 build=$2
  shift 2
  cmake -S "$source" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_TOOLCHAIN_FILE="$root/cmake/toolchains/mingw-w64.cmake" \
    -DCMAKE_CXX_FLAGS_RELEASE='-O1 -DNDEBUG' "$@"
}

# ---- from_log ----

same_numbers() {  # same_numbers WHAT OURS THEIRS: equal but for the figures; says how far numbers differ
  python3 - "$@" <<'END'
import re, sys
what, ours, theirs = sys.argv[1:]
def read(name):
    text = open(name, encoding="utf-8").read().replace("\r\n", "\n")
    text = re.sub(r"<figure>.*?</figure>", "", text, flags=re.S)
    # Where a number of code has another digit, its line may be broken elsewhere.
    text = re.sub(r"\s+", " ", text)
    number = r"\d+(?:\.\d+)?(?:e[-+]?\d+)?"
    return re.split(number, text), re.findall(number, text)
(words, numbers), (their_words, their_numbers) = read(ours), read(theirs)
if words != their_words:
    at = next((i for i, (a, b) in enumerate(zip(words, their_words)) if a != b), -1)
    sys.exit(f"{what}: other words: {words[at][:200]!r} and {their_words[at][:200]!r}")
pairs = [(float(a), float(b), a, b) for a, b in zip(numbers, their_numbers) if a != b]
far = max(pairs, key=lambda p: abs(p[0] - p[1]) / max(abs(p[0]), abs(p[1])), default=None)
print(f"{what}: {len(numbers)} numbers, {len(pairs)} differ in a digit"
      + (f", most {far[2]} and {far[3]}" if far else ""))
# The C libraries differ in the last of 16 digits, see examples/start/WINDOWS.md: a printed digit may
# be rounded the other way, what was computed may not differ.
for a, b, one, other in pairs:
    if abs(a - b) > 2e-3 * max(abs(a), abs(b)):
        sys.exit(f"{what}: {one} is {other} on Linux")
END
}

from_log() {
  configure . "$out/examples" -DESOKIT_BUILD_EXAMPLES=ON >"$out/from_log.log" 2>&1 &&
    cmake --build "$out/examples" --parallel "$jobs" --target from_log >>"$out/from_log.log" 2>&1
  verdict $? "from_log does not build: $(grep -m 3 -E 'error|undefined' "$out/from_log.log")"
  ! grep -q 'warning:' "$out/from_log.log"
  verdict $? "from_log builds with warnings: $(grep -m 3 'warning:' "$out/from_log.log")"
  if [[ -z $linux ]]; then
    linux=$root/build/examples/examples/bin/from_log
    cmake -S . -B build/examples -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS_RELEASE='-O2 -DNDEBUG' \
      -DESOKIT_BUILD_EXAMPLES=ON >"$out/linux.log" 2>&1 &&
      cmake --build build/examples --parallel "$jobs" --target from_log >>"$out/linux.log" 2>&1
    verdict $? "from_log of Linux does not build"
  fi

  local at page log
  rm -rf "$out"/pages
  for at in windows linux; do  # the same names in both, as the page tells them
    mkdir -p "$out/pages/$at/Meßwerte von Jörg"
    cp examples/data/servo_relay_pid/relay.csv "$out/pages/$at/relay.csv"
    cp examples/data/dfki_simple_pendulum/ddp.csv "$out/pages/$at/Meßwerte von Jörg/ein Pendel ö.csv"
    cp examples/data/esp32_motor_step/step.csv "$out/pages/$at/step.csv"
  done
  for log in relay.csv 'Meßwerte von Jörg/ein Pendel ö.csv' step.csv; do
    for at in windows linux; do
      local program=("$linux")
      [[ $at == linux ]] || program=(run "$out/examples/examples/bin/from_log.exe")
      (cd "$out/pages/$at" && "${program[@]}" "$log" --limits 100 --anyway --out 'Seiten für Übung') \
        >"$out/pages/$at.out" 2>"$out/pages/$at.err"
      echo "status $?" >>"$out/pages/$at.err"
    done
    [[ $(tail -n 1 "$out/pages/windows.err") == "$(tail -n 1 "$out/pages/linux.err")" ]]
    verdict $? "$log: other exit codes: $(tail -n 1 "$out"/pages/*.err)"
    page="Seiten für Übung/$(basename "$log" .csv).html"
    if [[ $log == step.csv ]]; then
      # It tells nothing of b0, so that the last digit of a sine decides what is seen in it: the pages
      # have to refuse it for the same reason.
      for at in windows linux; do
        grep -o '<li>In numbers: [a-z_]* = [^:]*: is the smallest relative error' "$out/pages/$at/$page" |
          sed 's/ = .*//' >"$out/pages/$at.reason"
      done
      [[ -s $out/pages/linux.reason ]] && cmp "$out"/pages/{windows,linux}.reason
      verdict $? "$log: other reasons, or there is none: $(cat "$out"/pages/*.reason)"
      continue
    fi
    # Wine has neither Python nor gnuplot.
    [[ $(grep -o 'data:image/svg' "$out/pages/windows/$page" | wc -l) == $(grep -o 'data:image/svg' "$out/pages/linux/$page" | wc -l) ]]
    verdict $? "$log: not as many figures as on Linux"
    same_numbers "$log" "$out/pages/windows/$page" "$out/pages/linux/$page"
    verdict $? "$log: the pages differ, or there is none: $(tail -n 3 "$out/pages/windows.err")"
  done
}

# ---- examples/start ----

start() {
  local program
  configure examples/start "$out/start" -DESOKIT_SOURCE_DIR="$root" >"$out/start.log" 2>&1 &&
    cmake --build "$out/start" --parallel "$jobs" >>"$out/start.log" 2>&1
  verdict $? "examples/start does not build: $(grep -m 3 'error' "$out/start.log")"
  for program in observe control analyse member to_c; do
    run "$out/start/$program.exe" >"$out/start/$program.txt" && [[ -s $out/start/$program.txt ]]
    verdict $? "examples/start: $program"
  done
  g++ -std=c++20 -O1 -Iinclude -isystem /usr/include/eigen3 examples/start/observe.cpp -o "$out/start/linux" &&
    "$out/start/linux" >"$out/start/linux.txt"
  same_numbers "observe" "$out/start/observe.txt" "$out/start/linux.txt"
  verdict $? "examples/start: observe says other numbers than on Linux"
}

# ---- a quarter of the tests ----

# One program a line, of one unit: a namespace is called like its file, and what several files
# instantiate is compiled once.
units=(
  "core/pack core/scalar core/lanes core/expected core/check core/matrix core/snapshot math/combinatorics math/fal math/fine_sum math/positivity analysis/integrator_chain"
  "gain/continuous_gain gain/covariance_factor gain/feedback_gain gain/gain_interval gain/riccati gain/sampled_gain observer/named_observer observer/predictor_corrector observer/cascade_identities adapter/outlier_gate adapter/actuator_map"
  "observer/pack observer/update_on_paper"
  "control/adrc_law control/approach_profile control/at_limits control/nonlinear_feedback tune/pid_conversion control/retune control/tracking_differentiator control/smooth_profile control/time_proportioned"
  "control/experiment"
  "sim/plant sim/noise sim/counted_gaussian sim/signals sim/metrics analysis/dense identify/input_checks"
  "sim/runge_kutta model/linear_plant"
)

launcher=()
[[ -z ${CMAKE_CXX_COMPILER_LAUNCHER:-} ]] || launcher=("$CMAKE_CXX_COMPILER_LAUNCHER")
gtest=/usr/src/googletest/googletest
compile() {  # compile SOURCE OBJECT
  "${launcher[@]}" x86_64-w64-mingw32-g++-posix -std=c++20 -Og -ffp-contract=off -DESOKIT_ONE_TYPE \
    -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Iinclude -Itests -Itests/support \
    -isystem /usr/include/eigen3 -isystem "$out/tests/include" -isystem "$gtest/include" -isystem "$gtest" \
    -c "$1" -o "$2"
}

tests() {
  local i test program counts files=0 wrap
  ln -sfn /usr/include/boost "$out/tests/include/boost"
  ln -sfn /usr/include/Random123 "$out/tests/include/Random123"
  rm -f "$out"/tests/*.{exe,o,log}
  cat >"$out/tests/gtest.cpp" <<'END'
#include <src/gtest-all.cc>
int main(int count, char** arguments) {
  testing::InitGoogleTest(&count, arguments);
  return RUN_ALL_TESTS();
}
END
  for i in "${!units[@]}"; do
    for test in ${units[i]}; do
      [[ -s tests/${test}_test.cpp ]] || verdict 1 "no test $test"
      echo "#include <${test}_test.cpp>"
      files=$((files + 1))
    done >"$out/tests/unit$i.cpp"
  done
  for program in gtest "${!units[@]}"; do
    while (($(jobs -rp | wc -l) >= jobs)); do wait -n; done
    [[ $program == gtest ]] || program=unit$program
    compile "$out/tests/$program.cpp" "$out/tests/$program.o" >"$out/tests/$program.log" 2>&1 &
  done
  wait
  ((4 * files >= $(find tests -name '*_test.cpp' | wc -l)))
  verdict $? "$files files are no quarter of the tests"
  for i in "${!units[@]}"; do
    wrap=()
    ! grep -q support/no_allocation.hpp $(printf 'tests/%s_test.cpp ' ${units[i]}) ||
      wrap=(-Wl,--wrap=malloc,--wrap=realloc)
    if ! x86_64-w64-mingw32-g++-posix -static "${wrap[@]}" "$out/tests"/{unit$i,gtest}.o \
      -o "$out/tests/unit$i.exe" >>"$out/tests/unit$i.log" 2>&1; then
      verdict 1 "${units[i]}: $(grep -m 3 -E 'error|undefined' "$out/tests/unit$i.log")"
      continue
    fi
    run "$out/tests/unit$i.exe" >"$out/tests/unit$i.out" 2>&1
    counts=$(sed -n 's/^\[  PASSED  \] \([0-9]*\) .*/\1/p' "$out/tests/unit$i.out")
    passed=$((passed + ${counts:-0}))
    if grep -q '^\[  FAILED  \]' "$out/tests/unit$i.out" || [[ -z $counts ]]; then
      verdict 1 "${units[i]}: $(grep -E -B 12 '^\[  FAILED  \]' "$out/tests/unit$i.out" | head -n 60)"
    fi
  done
}

for part in from_log start tests; do
  began=$SECONDS
  $part
  echo "$part: $((SECONDS - began)) s"
done
echo "$passed passed, $failed failed"
((failed == 0))
