#!/usr/bin/env bash
# What the page computes is what native programs compute from the same lines:
#   examples/playground/check.sh PAGE.html TWIN LOG_TWIN
# Chromium plays settings.txt and studies logs.txt in the page, playground_twin and playground_log_twin do it
# here. The page must say nothing on its console, and ask for nothing.
set -euo pipefail
here=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)
page=$1
if [[ ! -e $page ]] || ! command -v chromium >/dev/null 2>&1; then
  echo "skipped: the playground is not compared, as there is no ${page##*/} or no Chromium"
  echo "0 passed, 0 failed"
  exit 0
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"$2" "$here/settings.txt" "$work/settings"
"$3" "$here/logs.txt" "$here/../data" "$work/logs"
timeout 400 python3 "$here/check.py" "$page" "$work/settings" "$work/logs"
