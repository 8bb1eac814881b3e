#!/usr/bin/env bash
# Writes the library as one header to standard output: cmake/amalgamate.sh >esokit.hpp
# With names of headers or folders as arguments (control/adrc.hpp observer/linear_eso.hpp; or: observer
# adapter control), those and what they need. Several such files go into one program: each part has a
# guard of its own; of two versions, one #error.
# With --split FOLDER before them it writes two files instead, FOLDER/esokit.hpp and FOLDER/esokit.cpp,
# which has what a program compiles once.
set -euo pipefail
split=
if [[ ${1:-} == --split ]]; then
  split=$(realpath "${2:?usage: amalgamate.sh --split FOLDER [NAME...]}")
  shift 2
fi
cd "$(dirname "${BASH_SOURCE[0]}")/../include"
version=$(sed -n 's/^project(esokit VERSION \([0-9.]*\).*/\1/p' ../CMakeLists.txt)
headers=()
for name in "${@:-esokit.hpp}"; do
  name=esokit/${name#esokit/}
  if [[ -d $name ]]; then
    headers+=("$name"/*.hpp)
  elif [[ -f $name ]]; then
    headers+=("$name")
  else
    echo "amalgamate.sh: there is no include/$name" >&2
    exit 1
  fi
done

awk -v headers="${headers[*]}" -v wanted="${*:-esokit.hpp}" -v license="../LICENSE" -v version="$version" \
  -v split_to="$split" '
  function text(file,    line, all, status) {  # C that a header includes as a literal
    while ((status = (getline line < file)) > 0) all = all line "\n"
    if (status < 0) { print "amalgamate.sh: cannot read " file > "/dev/stderr"; exit 1 }
    close(file)
    return all
  }
  # The text of a file between guards; what it includes stands before it, definitions behind all headers.
  function body(file,    line, name, status, guard, all) {
    guard = toupper(file)
    gsub(/[^A-Z0-9]/, "_", guard)
    while ((status = (getline line < file)) > 0) {
      if (match(line, /^#include <esokit\/[^>]*>/)) {
        name = substr(line, 11, RLENGTH - 11)
        if (name ~ /\.[ch]$/) all = all text(name)
        else if (name ~ /\.hpp$/) paste(name)
        else if (file ~ /\.ipp$/) define(name)
        else queue[++definitions] = name
      } else if (line !~ /^#pragma once/) {
        all = all line "\n"
      }
    }
    if (status < 0) { print "amalgamate.sh: cannot read " file > "/dev/stderr"; exit 1 }
    close(file)
    gsub(/#if defined\(ESOKIT_HEADER_ONLY\)\n#endif\n/, "", all)
    return "#ifndef " guard "\n#define " guard "\n" all "#endif  // " guard "\n"
  }
  function paste(file) {
    if (file in seen) return
    seen[file] = 1
    print body(file) > out
  }
  function define(file,    all) {
    if (file in seen) return
    seen[file] = 1
    all = body(file)
    defined = defined all "\n"
  }
  BEGIN {
    while ((getline line < license) > 0) head = head "// " line "\n"
    head = head "//\n// esokit " version ", written by cmake/amalgamate.sh from " wanted "; edit the headers, not this file.\n"
    out = split_to ? split_to "/esokit.hpp" : "/dev/stdout"
    print head > out
    split(version, part, ".")
    number = (part[1] * 1000 + part[2]) * 1000 + part[3]
    print "#ifndef ESOKIT_SINGLE_HEADER\n#define ESOKIT_SINGLE_HEADER " number > out
    print "#elif ESOKIT_SINGLE_HEADER != " number > out
    print "#error \"esokit: two single headers of different versions in one program\"\n#endif\n" > out
    if (split_to) print "#ifndef ESOKIT_COMPILED\n#define ESOKIT_COMPILED\n#endif\n" > out
    count = split(headers, first, " ")
    for (i = 1; i <= count; ++i) paste(first[i])
    for (i = 1; i <= definitions; ++i) define(queue[i])
    if (split_to) print head "\n#include \"esokit.hpp\"\n\n" defined > (split_to "/esokit.cpp")
    else if (definitions) print "#if defined(ESOKIT_HEADER_ONLY)\n" defined "#endif" > out
  }'
