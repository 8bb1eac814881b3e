#!/usr/bin/env bash
# Builds and runs the benchmarks, prints times and ratios. See usage below.
#
# What is compared with what is written in the label of a benchmark:
#
#   state.SetLabel("vs hand_written/2/double <= 1.10; vs dense_eigen/2/double < 1");
#
# prints the ratio of this benchmark's time to that of each benchmark named (its full name, in the
# same program), and whether it keeps the limit; the limit may be left out ("vs NAME").
#
# Times are CPU times. Each benchmark runs several times, in random order with the others; the ratio
# is of the least times, which a busy machine disturbs least. The median is printed beside.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)

usage() {
  cat <<'END'
usage: benchmarks/run.sh [--no-install] [--strict] [--cxx COMPILER] [--flags FLAGS]
                         [google-benchmark options]

Builds every benchmark program, runs it, and prints the times and the ratios to the baselines.
Google Benchmark's JSON output stays in the build folder, in results/.

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

# Columns of the CSV: name, iterations, real_time, cpu_time, time_unit, bytes_per_second,
# items_per_second, label, ...; the header names them, and only name and label are quoted.
# shellcheck disable=SC2016
table='
function split_csv(line, fields,    count, i, c, text, quoted) {
  count = 0; text = ""; quoted = 0
  for (i = 1; i <= length(line); ++i) {
    c = substr(line, i, 1)
    if (c == "\"") {
      if (quoted && substr(line, i + 1, 1) == "\"") { text = text c; ++i }
      else quoted = !quoted
    } else if (c == "," && !quoted) { fields[++count] = text; text = "" }
    else text = text c
  }
  fields[++count] = text
  return count
}
function trimmed(text) { gsub(/^[ \t]+|[ \t]+$/, "", text); return text }
function median(name,    n, i, j, swap, values) {
  n = runs[name]
  for (i = 1; i <= n; ++i) values[i] = time[name, i]
  for (i = 2; i <= n; ++i)
    for (j = i; j > 1 && values[j - 1] > values[j]; --j) {
      swap = values[j]; values[j] = values[j - 1]; values[j - 1] = swap
    }
  return n % 2 ? values[(n + 1) / 2] : (values[n / 2] + values[n / 2 + 1]) / 2
}
function pad(text, width) { while (length(text) < width) text = text " "; return text }
{ sub(/\r$/, "") }
!started {
  if ($0 ~ /^name,iterations,/) {
    started = 1
    n = split_csv($0, heading)
    for (i = 1; i <= n; ++i) column[heading[i]] = i
  }
  next
}
{
  for (i in field) delete field[i]
  if (split_csv($0, field) < column["time_unit"]) next
  name = field[column["name"]]
  if (name ~ /_(mean|median|stddev|cv|min|max)$/) next
  sub(/\/repeats:[0-9]+/, "", name)
  if (field[column["error_occurred"]] == "true") {
    print "error: " name ": " field[column["error_message"]]
    errors = 1
    next
  }
  unit = field[column["time_unit"]]
  factor = unit == "s" ? 1e9 : unit == "ms" ? 1e6 : unit == "us" ? 1e3 : 1
  nanoseconds = field[column["cpu_time"]] * factor
  if (!(name in runs)) { order[++total] = name; least[name] = nanoseconds }
  time[name, ++runs[name]] = nanoseconds
  if (nanoseconds < least[name]) least[name] = nanoseconds
  rate = field[column["items_per_second"]]
  if (rate != "" && rate + 0 > most_rate[name]) most_rate[name] = rate + 0
  label[name] = field[column["label"]]
}
END {
  if (total == 0) { print "  no benchmark ran"; exit errors ? 3 : 0 }
  width = 9
  for (i = 1; i <= total; ++i) if (length(order[i]) > width) width = length(order[i])
  printf "  %s  %12s  %12s  %14s\n", pad("benchmark", width), "least (ns)", "median (ns)", "items/s"
  for (i = 1; i <= total; ++i) {
    name = order[i]
    rate = most_rate[name] > 0 ? sprintf("%14.4g", most_rate[name]) : ""
    line = sprintf("  %s  %12.2f  %12.2f  %s", pad(name, width), least[name], median(name), rate)
    sub(/ +$/, "", line)
    print line
  }
  for (i = 1; i <= total; ++i) {
    name = order[i]
    parts = split(label[name], part, ";")
    for (k = 1; k <= parts; ++k) {
      text = trimmed(part[k])
      if (text !~ /^vs /) continue
      sub(/^vs +/, "", text)
      limit = ""; sign = ""
      if (match(text, / +<=? *[0-9.]+$/)) {
        limit = substr(text, RSTART)
        text = substr(text, 1, RSTART - 1)
        sign = limit ~ /<=/ ? "<=" : "<"
        gsub(/[ <=]/, "", limit)
      }
      if (!ratios++) printf "\n  ratios of the least times\n"
      if (!(text in least)) {
        # A filter leaves baselines out; without one, the label is wrong.
        printf "  %s  %7s  to %s, which did not run\n", pad(name, width), "-", text
        if (!filtered) errors = 1
        continue
      }
      ratio = least[name] / least[text]
      verdict = ""
      if (limit != "") {
        ok = sign == "<=" ? ratio <= limit + 0 : ratio < limit + 0
        verdict = "  (" (ok ? "ok" : "OVER") ", limit " sign " " limit ")"
        if (!ok) ++over
      }
      printf "  %s  %7.3f  of %s%s\n", pad(name, width), ratio, text, verdict
    }
  }
  exit errors ? 3 : over ? 4 : 0
}'

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

result=0
for program in "${programs[@]}"; do
  name=$(basename -- "$program")
  echo
  echo "$name"
  csv=$build/results/$name.csv
  status=0
  # Later options win, so the user's come last.
  "$program" --benchmark_repetitions=9 --benchmark_min_time=0.05 \
    --benchmark_enable_random_interleaving=true \
    ${passed_on[@]+"${passed_on[@]}"} --benchmark_format=csv --benchmark_out_format=json \
    --benchmark_out="$build/results/$name.json" >"$csv" 2>"$build/results/$name.log" || status=$?
  if ((status != 0)); then
    cat "$build/results/$name.log" >&2
    echo "run.sh: $name failed with exit code $status" >&2
    result=1
    continue
  fi
  verdict=0
  awk -v filtered="$filtered" "$table" "$csv" || verdict=$?
  case $verdict in
    0) ;;
    4) [[ $strict == no ]] || result=1 ;;
    *) result=1 ;;
  esac
done
exit "$result"
