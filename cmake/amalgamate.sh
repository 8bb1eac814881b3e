#!/usr/bin/env bash
# Writes the library as one header to standard output: cmake/amalgamate.sh >esokit.hpp
# With names of headers or folders as arguments (control/adrc.hpp observer/linear_eso.hpp; or: observer
# adapter control), those and what they need. Several such files go into one program: each part has a
# guard of its own; of two versions, one #error.
set -euo pipefail
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

awk -v headers="${headers[*]}" -v wanted="${*:-esokit.hpp}" -v license="../LICENSE" -v version="$version" '
  function text(file,    line, all, status) {  # C that a header includes as a literal
    while ((status = (getline line < file)) > 0) all = all line "\n"
    if (status < 0) { print "amalgamate.sh: cannot read " file > "/dev/stderr"; exit 1 }
    close(file)
    return all
  }
  function paste(file,    line, name, status, guard) {
    if (file in seen) return
    seen[file] = 1
    guard = toupper(file)
    gsub(/[^A-Z0-9]/, "_", guard)
    body[file] = "#ifndef " guard "\n#define " guard "\n"
    while ((status = (getline line < file)) > 0) {
      if (match(line, /^#include <esokit\/[^>]*>/)) {
        name = substr(line, 11, RLENGTH - 11)
        if (name ~ /\.[ch]$/) body[file] = body[file] text(name)
        else paste(name)
      } else if (line !~ /^#pragma once/) {
        body[file] = body[file] line "\n"
      }
    }
    if (status < 0) { print "amalgamate.sh: cannot read " file > "/dev/stderr"; exit 1 }
    close(file)
    print body[file] "#endif  // " guard "\n"
  }
  BEGIN {
    while ((getline line < license) > 0) print "// " line
    print "//\n// esokit " version ", written by cmake/amalgamate.sh from " wanted "; edit the headers, not this file.\n"
    split(version, part, ".")
    number = (part[1] * 1000 + part[2]) * 1000 + part[3]
    print "#ifndef ESOKIT_SINGLE_HEADER\n#define ESOKIT_SINGLE_HEADER " number
    print "#elif ESOKIT_SINGLE_HEADER != " number
    print "#error \"esokit: two single headers of different versions in one program\"\n#endif\n"
    count = split(headers, first, " ")
    for (i = 1; i <= count; ++i) paste(first[i])
  }'
