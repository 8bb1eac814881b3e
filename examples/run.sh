#!/usr/bin/env bash
# Builds and runs the examples, and shows their results on one page. See usage below.
set -euo pipefail

root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
build=$root/build/examples

usage() {
  cat <<'END'
usage: examples/run.sh [--out DIR] [--no-install] [NAME...]

Builds the examples, runs them (or only those named: a program or a folder of examples/, with a
slash behind it where a program has the same name), and writes DIR/index.html with every figure and table beside the paper's numbers. The name playground is
DIR/playground.html alone, a page that runs the headers in a browser.

  --out DIR      where the results go (default: out/ in the repository)
  --no-install   do not install missing Debian packages, only name them
  --help         this text

The exit code is non-zero if an example fails, that is, also if it misses a number that must
reproduce.
END
}

out=$root/out
install_option=()
wanted=()
while (($# > 0)); do
  case $1 in
    --out)
      if (($# < 2)) || [[ -z $2 ]]; then
        echo "run.sh: --out needs a folder" >&2
        exit 2
      fi
      out=$2
      shift
      ;;
    --out=?*) out=${1#--out=} ;;
    --no-install) install_option=(--no-install) ;;
    -h | --help)
      usage
      exit 0
      ;;
    -*)
      echo "run.sh: unknown option $1" >&2
      usage >&2
      exit 2
      ;;
    *) wanted+=("$1") ;;
  esac
  shift
done
[[ $out == /* ]] || out=$PWD/$out

# Which programs: known from the sources, so that a wrong name is refused before anything is built.
names=()
folders=()
for source in "$root"/examples/*/*.cpp; do
  [[ -e $source ]] || continue
  folder=$(basename -- "$(dirname -- "$source")")
  [[ $folder != common && $folder != start ]] || continue
  names+=("$(basename -- "$source" .cpp)")
  folders+=("$folder")
done
if ((${#names[@]} == 0)); then
  echo "run.sh: there are no examples in $root/examples" >&2
  exit 1
fi
selected=()
playground=no  # a page of its own, no program
for want in ${wanted[@]+"${wanted[@]}"}; do
  found=no
  if [[ $want == playground ]]; then
    playground=yes
    continue
  fi
  for i in "${!names[@]}"; do
    if [[ $want == "${names[i]}" ]]; then
      selected+=("$want")
      found=yes
    fi
  done
  [[ $found == no ]] && for i in "${!names[@]}"; do
    if [[ ${want%/} == "${folders[i]}" ]]; then
      selected+=("${names[i]}")
      found=yes
    fi
  done
  if [[ $found == no ]]; then
    echo "run.sh: there is no example $want; there are:" >&2
    printf '  %s\n' playground "${names[@]}" >&2
    exit 2
  fi
done
if ((${#wanted[@]} == 0)); then
  selected=("${names[@]}")
  playground=yes
fi

# shellcheck source=cmake/debian_packages.sh
source "$root/cmake/debian_packages.sh"
require_packages ${install_option[@]+"${install_option[@]}"} \
  "${ESOKIT_BUILD_PACKAGES[@]}" "${ESOKIT_EXAMPLE_PACKAGES[@]}"

if [[ $playground == yes ]]; then
  "$root/examples/playground/build.sh" ${install_option[@]+"${install_option[@]}"} "$out/playground.html"
  if ((${#selected[@]} == 0)); then exit 0; fi
fi

seconds_since() {
  local microseconds=$((${EPOCHREALTIME/[.,]/} - $1))
  printf '%d.%d s' $((microseconds / 1000000)) $((microseconds / 100000 % 10))
}

echo "building the examples in $build"
started=${EPOCHREALTIME/[.,]/}
mkdir -p "$build"
if ! cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
  -DCMAKE_CXX_FLAGS_RELEASE='-O2 -DNDEBUG' -DESOKIT_BUILD_EXAMPLES=ON \
  >"$build/configure.log" 2>&1; then
  cat "$build/configure.log" >&2
  exit 1
fi
# What a step takes, in tenths of a CPU second when it was last measured: for the seconds that are left.
weigh() {
  case $1 in
    Linking* | ': '* | *nothing.cpp* | */from_log.cpp.o*) weight=4 ;;
    *esokit_from_log.dir/Unity/*) weight=160 ;;
    *.gch* | *esokit_examples.dir/Unity/*) weight=38 ;;
    *) weight=60 ;;
  esac
}
total=0 steps=0 weight=0
while IFS= read -r line; do
  [[ $line == ': '* ]] || [[ $line == *' -c '* ]] || continue  # CMake's own
  [[ $line == ': '* ]] || line=${line##* -o }
  weigh "$line"
  total=$((total + weight)) steps=$((steps + 1))
done < <(ninja -C "$build" -t commands "${selected[@]}")
# Each step says how many seconds are left, and every 5 s in which none ends. At first at the measured
# pace, then at that of this machine.
cores=$(nproc)
NINJA_STATUS='%f %t ' cmake --build "$build" --target "${selected[@]}" | {
  spent=0 left=0 finished=0 all=$steps part='' at=$EPOCHSECONDS
  while true; do
    status=0
    IFS= read -t 5 -r line || status=$?
    part+=$line
    if ((status > 128)); then
      since=$((EPOCHSECONDS - at)) rest=$((left + at - EPOCHSECONDS))
      echo "[$finished/$all, about $((rest > since / 3 ? rest : since / 3)) s left]"
      continue
    fi
    line=$part part=
    [[ $line != '0 '* ]] || continue  # looks for new files
    if [[ $line =~ ^([0-9]+)\ ([0-9]+)\ (.*)$ ]]; then
      finished=${BASH_REMATCH[1]} all=${BASH_REMATCH[2]} line=${BASH_REMATCH[3]}
      weigh "$line"
      spent=$((spent + weight)) at=$EPOCHSECONDS
      whole=$((steps > all ? total * all / steps : total))
      known=$((whole / 5)) took=$(((${EPOCHREALTIME/[.,]/} - ${started}) / 100000))
      rest=$((whole > spent ? whole - spent : 0))
      left=$((rest * (took + known / cores) / (spent + known + 1) / 10))
      line="[$finished/$all, about $left s left] $line"
    fi
    [[ -z $line ]] || printf '%s\n' "$line"
    ((status == 0)) || break
  done
}
echo "built in $(seconds_since "$started")"

# As many at a time as there are cores: much of a run is one thread's, and gnuplot's. What one says is
# shown when all before it are done. choosing_cost takes the time of updates, and runs alone.
alone=choosing_cost
said=$(mktemp -d)
(while sleep 5; do
  running=
  for began in "$said"/*.began; do
    [[ -e $began ]] || continue
    name=$(basename "$began" .began)
    took=$((EPOCHSECONDS - $(<"$began")))
    [[ -s $said/$name.status ]] || ((took < 5)) || running+=", $name for $took s"
  done
  [[ -z $running ]] || echo "running${running#,}"
done) &
watcher=$!
disown "$watcher"
trap 'kill "$watcher" 2>/dev/null; rm -rf "$said"' EXIT
run_one() {
  local began=${EPOCHREALTIME/[.,]/} status=0
  echo "$EPOCHSECONDS" >"$said/$1.began"
  "$build/examples/bin/$1" --out "$out" >"$said/$1" 2>&1 </dev/null || status=$?
  echo "$status $(seconds_since "$began")" >"$said/$1.status"
}
failed=()
shown=0
show_finished() {
  local name status took
  while ((shown < ${#selected[@]})) && [[ -s $said/${selected[shown]}.status ]]; do
    name=${selected[shown]}
    shown=$((shown + 1))
    read -r status took <"$said/$name.status"
    echo
    echo "[$shown/${#selected[@]}] $name"
    cat -- "$said/$name"
    if ((status == 0)); then
      echo "[$shown/${#selected[@]}] $name: done in $took"
    else
      echo "[$shown/${#selected[@]}] $name: FAILED with exit code $status after $took" >&2
      failed+=("$name")
    fi
  done
}
for name in "${selected[@]}"; do
  [[ $name != "$alone" ]] || run_one "$name"
done
for name in "${selected[@]}"; do
  [[ $name != "$alone" ]] || continue
  while (($(jobs -rp | wc -l) >= cores)); do
    wait -n || true
    show_finished
  done
  run_one "$name" &
done
while (($(jobs -rp | wc -l) > 0)); do
  wait -n || true
  show_finished
done
show_finished

# The README of each folder beside its page, as text, which every browser shows.
for folder in $(printf '%s\n' "${folders[@]}" | sort -u); do
  [[ ! -d $out/$folder ]] || cp -- "$root/examples/$folder/README.md" "$out/$folder/README.txt"
done

echo
page=0
"$root/examples/common/make_page.py" "$out" >"$build/page.txt" || page=1
echo "all in $(seconds_since "$started")"
if ((${#failed[@]} > 0)); then
  echo "failed: ${failed[*]}" >&2
fi
if ((page != 0)); then
  exit 1
fi
echo "results: $(<"$build/page.txt")"
((${#failed[@]} == 0))
