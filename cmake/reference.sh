#!/usr/bin/env bash
# cmake/reference.sh [--no-install]: writes the reference with Doxygen and prints where it is. Any
# warning is a failure (1), and so are a name of the namespace detail on a page and a class that is made
# from settings and has no example. Installs Doxygen and Python 3 if they are missing; with --no-install
# it only names the Debian packages (3).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
source cmake/debian_packages.sh

has_tools() { command -v doxygen >/dev/null 2>&1 && command -v python3 >/dev/null 2>&1; }
if ! has_tools; then
  require_packages "$@" doxygen python3
  if ! has_tools; then
    echo "doxygen or python3 is not on the PATH" >&2
    exit 3
  fi
fi

log=build/reference/warnings.log
rm -rf build/reference
mkdir -p build/reference
status=0
python3 cmake/reference_pages.py examples cmake/reference_examples.cpp >build/reference/examples.dox
{ cat cmake/Doxyfile && echo 'INPUT += build/reference/examples.dox'; } | doxygen - 2>"$log" || status=$?
if ((status != 0)) || [[ -s $log ]]; then
  cat "$log" >&2
  echo "the reference has $(wc -l <"$log") lines of warnings" >&2
  exit 1
fi
rm "$log"
if pages=$(grep -lE '\bdetail(::|<)' build/reference/html/*.html build/reference/html/search/*.js | grep -v '_source\.html$'); then
  echo "these pages show a name of the namespace detail (cmake/reference_filter.pl): ${pages//$'\n'/ }" >&2
  exit 1
fi
python3 cmake/reference_pages.py settings build/reference/html
echo "$PWD/build/reference/html/index.html"
