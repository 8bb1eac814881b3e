#!/usr/bin/env bash
# What the page computes is what a native program computes from the same lines:
#   examples/playground/check.sh PAGE.html TWIN
# Chromium plays settings.txt in the page, TWIN (playground_twin) plays it here. The page must say nothing on
# its console; its policy forbids every request, and a forbidden one would be said there.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
page=$1
twin=$2
if [[ ! -e $page ]] || ! command -v chromium >/dev/null 2>&1; then
  echo "skipped: the playground is not compared, as there is no ${page##*/} or no Chromium"
  echo "0 passed, 0 failed"
  exit 0
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$twin" "$here/settings.txt" "$work/native"
timeout 120 chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run \
  --disable-background-networking --disable-component-update --disable-sync --user-data-dir="$work/profile" \
  --enable-logging=stderr --virtual-time-budget=20000 --dump-dom "file://$(realpath "$page")#selftest" \
  >"$work/dom" 2>"$work/log"
python3 "$here/compare.py" "$here/settings.txt" "$work/native" "$work/dom" "$work/log" "$page"
