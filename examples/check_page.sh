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
probe=.probe-  # beside the pages, so that their links hold
trap 'rm -f "$frame" "$probe"*' EXIT
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

  elsewhere=$(grep -oE '(src="https?:[^"]*|<link [^>]*|<script[^>]* src=[^>]*|url\([^#)][^)]*|@import[^;]*)' "$page")
  verdict "$([[ -z $elsewhere ]] && echo 1 || echo 0)" "$page loads from elsewhere: $elsewhere"
done

# One start of the browser for all pages at all widths: a start takes longer than a page.
widths=(390 1300 1920)
if ((${#pages[@]} > 0)) && command -v chromium >/dev/null 2>&1; then
  # A window has a least width, a frame in it has not.
  cat >"$frame" <<'END'
<script>onmessage = (m) => { document.body.append('\n' + m.data + '\n'); }</script>
<body>
END
  for page in "${pages[@]}"; do
    {
      sed 's/<details>/<details open>/' "$page"
      cat <<'END'
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
parent.postMessage('probed ' + name + ' ' + cut.length + ' cut: ' + cut.slice(0, 5).join(' | '), '*');
</script>
END
    } >"$probe$page"
    for width in "${widths[@]}"; do
      echo "<iframe src=\"$probe$page\" name=\"$page, $width px:\"" \
        "style=\"width: ${width}px; height: 1000px; border: 0\"></iframe>"
    done >>"$frame"
  done
  said=$(timeout 120 chromium --headless --no-sandbox --disable-gpu --enable-logging=stderr \
    --window-size=2000,1100 --virtual-time-budget=2000 --dump-dom "file://$PWD/$frame" \
    2>"${probe}log")
  for page in "${pages[@]}"; do
    for width in "${widths[@]}"; do
      probed=$(grep -F "probed $page, $width px: " <<<"$said")
      verdict "$([[ $probed == "probed $page, $width px: 0 cut: "* ]] && echo 1 || echo 0)" \
        "$page, $width px: ${probed:-Chromium said nothing}"
    done
    # What a page says names its file; what is missing in it names itself, and is found above.
    console=$(grep -E 'CONSOLE|ERR_FILE' "${probe}log" | grep -F "$probe$page" || true)
    verdict "$([[ -z $console ]] && echo 1 || echo 0)" "$page, Chromium: $console"
  done
  console=$(grep -E 'CONSOLE|ERR_FILE' "${probe}log" | grep -vF "$probe" || true)
  verdict "$([[ -z $console ]] && echo 1 || echo 0)" "Chromium: $console"
fi
((${#pages[@]} > 0)) || echo "there is no page in $PWD"
echo "$passed passed, $failed failed"
((passed > 0 && failed == 0))
