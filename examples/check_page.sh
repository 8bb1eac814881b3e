#!/usr/bin/env bash
# What a visitor of the results page would stumble over: examples/check_page.sh [OUT]
# Missing files and anchors, and anything loaded from elsewhere. Where Chromium is installed it opens
# each page too, at the widths of a phone, a laptop and a wide screen: nothing may be cut (a wide table
# scrolls in its own box) and nothing said on its console.
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
frame=.frame.html
probe=.probe.html  # beside the pages, so that their links hold
trap 'rm -f "$frame" "$probe" "$probe.log"' EXIT
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
    for width in 390 1300 1920; do
      cat "$page" - >"$probe" <<'END'
<script>
const wide = innerWidth, cut = [];
if (document.documentElement.scrollWidth > wide) cut.push('the page itself');
for (const e of document.querySelectorAll('body *')) {
  const box = e.closest('.table'), style = getComputedStyle(e);
  if (e.tagName == 'SCRIPT' || !e.getClientRects().length || style.display == 'inline') continue;
  const scrolls = /auto|scroll/.test(style.overflowX);
  if ((e.scrollWidth > e.clientWidth + 1 && e.clientWidth && !scrolls) ||
      ((!box || box == e) && e.getBoundingClientRect().right > wide + 1))
    cut.push(e.tagName + ' ' + e.textContent.trim().slice(0, 60));
}
parent.postMessage('probed ' + wide + ': ' + cut.length + ' cut: ' + cut.slice(0, 5).join(' | '), '*');
</script>
END
      sed -i 's/<details>/<details open>/' "$probe"
      # A window has a least width, a frame in it has not.
      cat >"$frame" <<END
<script>onmessage = (m) => { document.body.textContent = m.data; }</script>
<body><iframe src="$probe" style="width: ${width}px; height: 1000px; border: 0"></iframe></body>
END
      said=$(chromium --headless --no-sandbox --disable-gpu --enable-logging=stderr \
        --window-size=2000,1100 --virtual-time-budget=2000 --dump-dom "file://$PWD/$frame" \
        2>"$probe.log")
      said=$(grep -o 'probed .*' <<<"$said" | sed 's/<.*//')
      verdict "$([[ $said == "probed $width: 0 cut: "* ]] && echo 1 || echo 0)" \
        "$page, $width px: $said"
      console=$(grep -E 'CONSOLE|ERR_FILE' "$probe.log" || true)
      verdict "$([[ -z $console ]] && echo 1 || echo 0)" "$page, Chromium: $console"
    done
  fi
done
((${#pages[@]} > 0)) || echo "there is no page in $PWD"
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
