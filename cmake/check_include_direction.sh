#!/usr/bin/env bash
# Refuses every include in include/esokit that goes against
#   core <- math <- model <- gain <- observer <- adapter <- control <- target <- eigen.hpp <- sim <- analysis <- identify <- tune
# and every header from core to control, what runs in a controller, that needs Eigen or another header
# that costs more than a controller; an umbrella header that does not include every other header, and a header that reaches C++20 before
# core/language.hpp, which says that it is needed. The C in target/runtime/ includes nothing of esokit, and
# headers of esokit include it. Definitions (impl/*.ipp) go the same way as the headers of their folder; some
# header includes each, and so does impl/esokit.cpp.
# usage: cmake/check_include_direction.sh [INCLUDE_DIR | --self-test]
set -euo pipefail
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

check() {  # check INCLUDE_DIR
  local include_dir=$1
  local -a headers
  if [[ ! -d $include_dir/esokit ]]; then
    echo "no folder esokit in $include_dir"
    return 1
  fi
  mapfile -t headers < <(cd "$include_dir" && find esokit -type f | LC_ALL=C sort)
  if ((${#headers[@]} == 0)); then
    echo "no headers in $include_dir/esokit"
    return 1
  fi
  (cd "$include_dir" && awk '
    BEGIN {
      count = split("core math model gain observer adapter control target eigen.hpp sim analysis identify tune", order, " ")
      for (i = 1; i <= count; ++i) rank[order[i]] = i
      for (i = 1; i < ARGC; ++i) {
        known[ARGV[i]] = 1
        split(ARGV[i], part, "/")
        if (ARGV[i] ~ /^esokit\/(esokit.hpp|impl\/esokit.cpp)$/ || part[2] in rank) continue
        printf "%s: not in a known folder\n", ARGV[i]
        ++refused
      }
    }
    function refuse(why) {
      printf "%s:%d: %s: %s\n", FILENAME, FNR, why, $0
      ++refused
    }
    FNR == 1 {
      split(FILENAME, part, "/")
      umbrella = (FILENAME ~ /^esokit\/(esokit.hpp|impl\/esokit.cpp)$/)
      mine = (part[2] in rank) ? rank[part[2]] : 0
    }
    umbrella && /^#include <esokit\// { brought[$0] = 1 }
    FNR == 1 { is_c = (FILENAME ~ /^esokit\/target\/runtime\/.*\.[ch]$/) }
    is_c { if (/^[ \t]*#[ \t]*include.*esokit/) refuse("C that includes esokit"); next }
    /^[ \t]*#[ \t]*include/ {
      target = $0
      sub(/^[ \t]*#[ \t]*include(_next)?[ \t]*/, "", target)
      opening = substr(target, 1, 1)
      if (opening != "<" && opening != "\"") { refuse("an include by macro hides its direction"); next }
      target = substr(target, 2)
      sub(/[>"].*/, "", target)
      if (target ~ /(^|\/)\.\.?\//) { refuse("relative include"); next }
      if (target !~ /^esokit\//) {
        if (opening == "\"") refuse("relative include")
        else if (target ~ /^Eigen\// && mine && mine < rank["eigen.hpp"]) refuse("Eigen where a controller runs")
        else if (target ~ /\// && target !~ /^Eigen\//) refuse("dependency other than Eigen")
        next
      }
      split(target, part, "/")
      reaches[FILENAME] = 1
      if (!umbrella) included[target] = 1
      if (!(target in known)) refuse("no such header")
      else if (umbrella) next
      else if (!(part[2] in rank)) refuse("a header may not include the umbrella header")
      else if (mine && rank[part[2]] > mine) refuse("against the include direction")
    }
    END {
      for (i = 1; i < ARGC; ++i) {
        if (ARGV[i] ~ /^esokit\/target\/runtime\/.*\.[ch]$/) {
          if (!(ARGV[i] in included)) { printf "%s: no header includes it\n", ARGV[i]; ++refused }
          continue
        }
        if (!(ARGV[i] in reaches) && ARGV[i] !~ /^esokit\/core\/(language|version).hpp$/) {
          printf "%s: does not include esokit/core/language.hpp\n", ARGV[i]
          ++refused
        }
        if (ARGV[i] ~ /\.ipp$/ && !(ARGV[i] in included)) { printf "%s: no header includes it\n", ARGV[i]; ++refused }
        if (ARGV[i] ~ /^esokit\/(esokit.hpp|impl\/esokit.cpp)$/ || ("#include <" ARGV[i] ">") in brought) continue
        printf "esokit/%s: does not include %s\n", ARGV[i] ~ /\.ipp$/ ? "impl/esokit.cpp" : "esokit.hpp", ARGV[i]
        ++refused
      }
      exit refused > 0
    }' "${headers[@]}")
}

# Included by those who want them alone: pole sets and text for programs with a console.
apart="esokit/gain/pole_set.hpp esokit/core/error_text.hpp esokit/core/snapshot_text.hpp"
heavy="algorithm complex deque fstream functional iomanip ios iostream istream iterator locale map memory"
heavy+=" numeric ostream random ranges regex set span sstream string thread unordered_map vector"

check_weight() {  # check_weight INCLUDE_DIR: by the compiler, which has no Eigen on its path
  local include_dir=$1 header files file status=0
  while IFS= read -r header; do
    [[ " $apart " != *" $header "* ]] || continue
    if ! files=$(echo "#include <$header>" | "${CXX:-g++}" -std=c++20 "-I$include_dir" -x c++ -M - 2>&1); then
      grep -m 1 -E 'error|No such file' <<<"$files"
      status=1
      continue
    fi
    for file in $files; do
      if [[ $file == */Eigen/* || $file == */c++/* && " $heavy " == *" ${file##*/} "* ]]; then
        echo "$header: includes, itself or by another header: $file"
        status=1
      fi
    done
  done < <(cd "$include_dir" && find esokit/{core,math,model,gain,observer,adapter,control} -name '*.hpp' | LC_ALL=C sort)
  return "$status"
}

# Of what GCC and Clang have beyond the language, nothing is left where neither is: the preprocessor
# knows no compiler here. [[gnu::..]] is an attribute that others skip, and packs (core/packed.hpp puts objects into them) are for vector types.
check_extensions() {  # check_extensions INCLUDE_DIR
  local include_dir=$1 header found status=0
  while IFS= read -r header; do
    [[ $header != esokit/core/pack.hpp ]] || continue
    if found=$(sed '/^ *# *include/d' "$include_dir/$header" | "${CXX:-g++}" -x c++ -E -undef -P -w - |
      grep -m 1 -E '__attribute__|__builtin_|__extension__|\b(__)?(asm|typeof)\b|__restrict|__int128'); then
      echo "$header: an extension of GCC without #if: $found"
      status=1
    fi
  done < <(cd "$include_dir" && find esokit/{core,math,model,gain,observer,adapter,control} -name '*.hpp' | LC_ALL=C sort)
  if grep -rlE --exclude=packed.hpp 'include <esokit/core/pack(ed)?.hpp>' "$include_dir"/esokit/{core,math,model,gain,observer,adapter,control}; then
    echo "what runs in a controller may not include core/pack.hpp or core/packed.hpp"
    status=1
  fi
  return "$status"
}

self_test() {  # the check must be able to fail
  local folder case line
  folder=$(mktemp -d)
  trap 'rm -rf "$folder"' RETURN
  mkdir -p "$folder"/esokit/{core,math,model,gain,observer,adapter,control,sim}
  printf '#include <esokit/%s.hpp>\n' core/language core/a model/b sim/c >"$folder/esokit/esokit.hpp"
  touch "$folder/esokit/core/language.hpp"
  printf '#include <cmath>\n#include <esokit/core/language.hpp>\n' >"$folder/esokit/core/a.hpp"
  echo '#include "esokit/core/a.hpp"' >"$folder/esokit/model/b.hpp"
  printf '#include <Eigen/Core>\n#include <esokit/model/b.hpp>\n' >"$folder/esokit/sim/c.hpp"
  check "$folder" && check_weight "$folder" && check_extensions "$folder" || { echo "self-test: a good tree is refused"; return 1; }
  for line in '#include <esokit/sim/c.hpp>' '  # include "esokit/sim/c.hpp"' '#include "b.hpp"' \
    '#include "../core/a.hpp"' '#include <esokit/core/../core/a.hpp>' '#include <esokit/core/x.hpp>' \
    '#include <esokit/esokit.hpp>' '#include <boost/any.hpp>' '#include HEADER' '#include <Eigen/Core>'; do
    echo "$line" >"$folder/esokit/model/bad.hpp"
    if check "$folder" >/dev/null; then
      echo "self-test: not refused: $line"
      return 1
    fi
  done
  for line in '#include <esokit/sim/c.hpp>' '#include <complex>' '#include <sstream>' '#include <iostream>' \
    '#include <string>' '#include <random>'; do
    echo "$line" >"$folder/esokit/core/bad.hpp"
    echo '#include <esokit/core/bad.hpp>' >"$folder/esokit/model/bad.hpp"
    if check_weight "$folder" >/dev/null; then
      echo "self-test: not refused by its weight: $line"
      return 1
    fi
  done
  echo '#include <esokit/core/language.hpp>' >"$folder/esokit/model/bad.hpp"
  for line in 'inline int f(int x) { return __builtin_abs(x); }' 'typedef float V __attribute__((vector_size(16)));' \
    '#include <esokit/core/pack.hpp>' '#include <esokit/core/packed.hpp>'; do
    echo "$line" >"$folder/esokit/core/bad.hpp"
    if check_extensions "$folder" >/dev/null; then
      echo "self-test: not refused as an extension: $line"
      return 1
    fi
    printf '#if defined(__GNUC__)\n%s\n#endif\n' "$line" >"$folder/esokit/core/bad.hpp"
    if [[ $line != *pack*.hpp* ]] && ! check_extensions "$folder"; then
      echo "self-test: refused although it is guarded: $line"
      return 1
    fi
  done
  rm "$folder/esokit/core/bad.hpp"
  echo '#include <cmath>' >"$folder/esokit/model/bad.hpp"
  if check "$folder" >/dev/null; then
    echo "self-test: a header that the umbrella lacks is not refused"
    return 1
  fi
  echo '#include <esokit/model/bad.hpp>' >>"$folder/esokit/esokit.hpp"
  if check "$folder" >/dev/null; then
    echo "self-test: a header without the language is not refused"
    return 1
  fi
  sed -i '$d' "$folder/esokit/esokit.hpp"
  rm "$folder/esokit/model/bad.hpp"
  mkdir -p "$folder/esokit/target/runtime"
  printf '#include DESIGN_HEADER\n#include <math.h>\n' >"$folder/esokit/target/runtime/a.c"
  if check "$folder" >/dev/null; then
    echo "self-test: C that no header includes is not refused"
    return 1
  fi
  echo '#include <esokit/target/runtime/a.c>' >>"$folder/esokit/sim/c.hpp"
  check "$folder" || { echo "self-test: C that a header includes is refused"; return 1; }
  echo '#include <esokit/core/a.hpp>' >>"$folder/esokit/target/runtime/a.c"
  if check "$folder" >/dev/null; then
    echo "self-test: C that includes esokit is not refused"
    return 1
  fi
  sed -i '$d' "$folder/esokit/target/runtime/a.c"
  mkdir -p "$folder/esokit/impl" "$folder/esokit/sim/impl"
  echo '#include <esokit/sim/c.hpp>' >"$folder/esokit/sim/impl/c.ipp"
  echo '#include <esokit/sim/impl/c.ipp>' >"$folder/esokit/impl/esokit.cpp"
  if check "$folder" >/dev/null; then
    echo "self-test: definitions that no header includes are not refused"
    return 1
  fi
  echo '#include <esokit/sim/impl/c.ipp>' >>"$folder/esokit/sim/c.hpp"
  check "$folder" || { echo "self-test: definitions that their header includes are refused"; return 1; }
  : >"$folder/esokit/impl/esokit.cpp"
  if check "$folder" >/dev/null; then
    echo "self-test: definitions that esokit.cpp lacks are not refused"
    return 1
  fi
  echo '#include <esokit/sim/impl/c.ipp>' >"$folder/esokit/impl/esokit.cpp"
  touch "$folder/esokit/loose.hpp"
  if check "$folder" >/dev/null; then
    echo "self-test: a header outside the folders is not refused"
    return 1
  fi
}

case ${1:-} in
  --self-test) self_test ;;
  *)
    check "${1:-$root/include}"
    check_weight "${1:-$root/include}"
    check_extensions "${1:-$root/include}"
    ;;
esac
