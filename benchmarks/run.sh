#!/usr/bin/env bash
# Builds and runs the benchmarks, prints a table of ratios. See usage below.
#
# What is compared with what is written in the label of a benchmark:
#
#   state.SetLabel("vs hand_written/2/double <= 1.10; vs dense_eigen/2/double < 1");
#
# prints the ratio of this benchmark's time to that of each benchmark named (its full name, in the
# same program), and whether it keeps the limit; the limit may be left out ("vs NAME"). How the times are
# taken: below, and benchmarks/table.py.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)

usage() {
  cat <<'END'
usage: benchmarks/run.sh [--no-install] [--strict] [--cxx COMPILER] [--flags FLAGS]
                         [google-benchmark options]

Builds every benchmark program, runs it, and prints the times and the ratios to the baselines, at the
end the limits that are missed. The same as JSON, results/table.json, and Google Benchmark's output
stay in the build folder.

  --no-install   do not install missing Debian packages, only name them
  --strict       non-zero exit code if a ratio misses its limit
  --cxx COMPILER and --flags FLAGS (default: -O2) build with these, in a folder of their own:
                 build/benchmarks-COMPILER-FLAGS
  --help         this text

Options such as --benchmark_filter=REGEX or --benchmark_repetitions=N are passed on.
END
}

install_option=()
strict=no
compiler=
flags=
passed_on=()
while (($# > 0)); do
  argument=$1
  case $argument in
    --cxx | --flags)
      if (($# < 2)) || [[ -z $2 ]]; then
        echo "run.sh: $argument needs a value" >&2
        exit 2
      fi
      if [[ $argument == --cxx ]]; then compiler=$2; else flags=$2; fi
      shift
      ;;
    --no-install) install_option=(--no-install) ;;
    --strict) strict=yes ;;
    -h | --help)
      usage
      exit 0
      ;;
    --benchmark_format=* | --benchmark_out=* | --benchmark_out_format=*)
      echo "run.sh: $argument is set by this script; see results/ in the build folder" >&2
      exit 2
      ;;
    --benchmark_* | --v=*) passed_on+=("$argument") ;;
    *)
      echo "run.sh: unknown option $argument" >&2
      usage >&2
      exit 2
      ;;
  esac
  shift
done

# CMake keeps its compiler, so each choice has a build of its own.
build=$root/build/benchmarks
cmake_options=(-DCMAKE_CXX_FLAGS_RELEASE="${flags:--O2} -DNDEBUG")
if [[ -n $compiler$flags ]]; then
  suffix=-${compiler##*/}$flags
  build+=${suffix//[ \/]/}
fi
if [[ -n $compiler ]]; then
  cmake_options+=(-DCMAKE_CXX_COMPILER="$compiler")
fi

# shellcheck source=cmake/debian_packages.sh
source "$root/cmake/debian_packages.sh"
require_packages ${install_option[@]+"${install_option[@]}"} \
  "${ESOKIT_BUILD_PACKAGES[@]}" "${ESOKIT_BENCHMARK_PACKAGES[@]}"

mkdir -p "$build/results"
if ! cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  "${cmake_options[@]}" -DESOKIT_BUILD_BENCHMARKS=ON \
  >"$build/configure.log" 2>&1; then
  cat "$build/configure.log" >&2
  exit 1
fi
cmake --build "$build"

programs=()
for program in "$build"/benchmarks/bin/*_benchmark; do
  [[ -x $program ]] && programs+=("$program")
done
if ((${#programs[@]} == 0)); then
  echo "run.sh: no benchmark was built" >&2
  exit 1
fi

filtered=0
for argument in ${passed_on[@]+"${passed_on[@]}"}; do
  case $argument in
    --benchmark_filter=*) filtered=1 ;;
    --benchmark_list_tests | --benchmark_list_tests=true)
      for program in "${programs[@]}"; do "$program" "$argument"; done
      exit 0
      ;;
  esac
done

# Short bursts of all benchmarks of a program in random order, in processes of their own: a busy
# machine disturbs some bursts of each, and where a process puts its memory differs.
processes=5
result=0
broken=()
rm -f "$build"/results/*.json
for program in "${programs[@]}"; do
  name=$(basename -- "$program")
  for ((process = 1; process <= processes; ++process)); do
    # Later options win, so the user's come last.
    if ! "$program" --benchmark_repetitions=200 --benchmark_min_time=0.00006 \
      --benchmark_enable_random_interleaving=true ${passed_on[@]+"${passed_on[@]}"} \
      --benchmark_out_format=json --benchmark_out="$build/results/$name.$process.json" \
      >/dev/null 2>"$build/results/$name.log"; then
      cat "$build/results/$name.log" >&2
      broken+=("$name, process $process: $(tail -n 1 "$build/results/$name.log" | cut -c1-200)")
      result=1
    fi
  done
done
compiler_name=$("$(sed -n 's/^CMAKE_CXX_COMPILER:[A-Z]*=//p' "$build/CMakeCache.txt")" --version | head -n 1)
verdict=0
python3 "$root/benchmarks/table.py" "$build/results" "$compiler_name" "${flags:--O2} -DNDEBUG" \
  "$filtered" || verdict=$?
case $verdict in
  0) ;;
  4) [[ $strict == no ]] || result=1 ;;
  *) result=1 ;;
esac
# At the end, where a record of the output that is cut still has it.
((${#broken[@]} == 0)) || printf 'run.sh: %s failed\n' "${broken[@]}" >&2
((verdict == 0 || verdict == 4)) || echo "run.sh: table.py failed with $verdict, see above" >&2
exit "$result"
