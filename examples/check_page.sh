#!/usr/bin/env bash
# What a visitor of the results page would stumble over: examples/check_page.sh [OUT]
# Missing files and anchors, and anything loaded from elsewhere. Where Chromium is installed it opens
# each page too: nothing may be said on its console.
set -uo pipefail
cd "${1:-$(dirname "${BASH_SOURCE[0]}")/../out}" || exit 1
passed=0
failed=0

verdict() {  # verdict OK TEXT...
  if (($1)); then
    passed=$((passed + 1))
  else
    failed=$((failed + 1))
    shift
    echo "$*"
  fi
}

shopt -s nullglob
pages=(*.html)
for page in "${pages[@]}"; do
  while IFS= read -r link; do
    [[ $link != https://* ]] || continue
    file=${link%%#*}
    anchor=
    [[ $link != *#* ]] || anchor=${link#*#}
    file=${file//%20/ }
    verdict "$([[ -z $file || -e $file ]] && echo 1 || echo 0)" "$page: there is no $file"
    if [[ -n $anchor ]]; then
      verdict "$(grep -qF "id=\"$anchor\"" "${file:-$page}" && echo 1 || echo 0)" \
        "$page: there is no #$anchor in ${file:-$page}"
    fi
  done < <(grep -oE '(href|src)="[^"]*"' "$page" | sed 's/^[a-z]*="//; s/"$//' | sort -u)

  elsewhere=$(grep -oE '(src="https?:[^"]*|<link [^>]*|<script[^>]*|url\([^)]*|@import[^;]*)' "$page")
  verdict "$([[ -z $elsewhere ]] && echo 1 || echo 0)" "$page loads from elsewhere: $elsewhere"

  if command -v chromium >/dev/null 2>&1; then
    said=$(chromium --headless --no-sandbox --disable-gpu --enable-logging=stderr \
      --window-size=1280,2000 --virtual-time-budget=2000 --dump-dom "file://$PWD/$page" 2>&1 \
      >/dev/null | grep -E 'CONSOLE|ERR_FILE' || true)
    verdict "$([[ -z $said ]] && echo 1 || echo 0)" "$page, Chromium: $said"
  fi
done
((${#pages[@]} > 0)) || echo "there is no page in $PWD"
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
