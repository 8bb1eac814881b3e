#!/usr/bin/env bash
# Writes the library as one header to standard output: cmake/amalgamate.sh >esokit.hpp
# With a header's path below include/ as argument, that header and what it needs.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../include"
first=${1:-esokit/esokit.hpp}
if [[ ! -f $first ]]; then
  echo "amalgamate.sh: there is no include/$first" >&2
  exit 1
fi

awk -v first="$first" -v license="../LICENSE" '
  function paste(file,    line, name, status) {
    if (file in seen) return
    seen[file] = 1
    while ((status = (getline line < file)) > 0) {
      if (match(line, /^#include <esokit\/[^>]*>/)) {
        name = substr(line, 11, RLENGTH - 11)
        paste(name)
      } else if (line ~ /^#pragma once/) {
      } else {
        print line
      }
    }
    if (status < 0) { print "amalgamate.sh: cannot read " file > "/dev/stderr"; exit 1 }
    close(file)
  }
  BEGIN {
    while ((getline line < license) > 0) print "// " line
    print "//\n// Written by cmake/amalgamate.sh from " first "; edit the headers, not this file.\n#pragma once\n"
    paste(first)
  }'
