#!/usr/bin/env python3
"""check.py PAGE NATIVE_SETTINGS NATIVE_LOGS: what the page gives beside what the native programs do.

Each library of mathematics rounds exp, log and pow in its own way, by a unit in the last place; what
follows differs by as much, times what a loop makes of it. So signals are compared relative to their
range: to 1e-12 where nothing switches. A quantum may be shown a sample earlier or later: a step of it.
Margins are found by bisection and golden section, to their own accuracy: 1e-7.
"""

import array
import base64
import json
import math
import re
import sys
import tempfile
import time
from pathlib import Path

from browser import Browser

SIGNALS, BLOCKS, CURVES = 9, 2, 9


def groups(data):
    """The arrays of each setting: a length, then as many numbers."""
    numbers = array.array("d")
    numbers.frombytes(data)
    at, arrays = 0, []
    while at < len(numbers):
        count = int(numbers[at])
        arrays.append(numbers[at + 1:at + 1 + count])
        at += 1 + count
    per = SIGNALS + BLOCKS + CURVES
    assert len(arrays) % per == 0
    return [arrays[i:i + per] for i in range(0, len(arrays), per)]


def distance(ours, native, each):
    """Largest difference; relative to the range, or `each` to itself."""
    if len(ours) != len(native):
        return math.inf
    span = max((abs(x) for x in native if math.isfinite(x)), default=0.0)
    worst = 0.0
    for a, b in zip(ours, native):
        if a == b or math.isnan(a) and math.isnan(b):
            continue
        if not (math.isfinite(a) and math.isfinite(b)):
            return math.inf
        worst = max(worst, abs(a - b) / (abs(b) if each else span or 1.0))
    return worst


def visit(page, check):
    """What may go wrong with a file: each time a sentence, and the page lives on."""
    with tempfile.TemporaryDirectory() as folder:
        def file(name, size, content=b""):
            path = Path(folder) / name
            with open(path, "wb") as out:
                out.write(content)
                out.truncate(size)
            return path

        bad = [(file("empty.csv", 0), "no line with numbers"), (file("zeros.csv", 5000), "zero byte"),
               (file("words.csv", 9, b"some text"), "no line with numbers"),
               (file("large.csv", 200_000_000), "200 MB"),
               (file("binary.csv", 4000, bytes(range(255, 0, -1)) * 16), ".")]
        for path, words in bad:
            study(page, path, "")
            says = page.value("$('logsays').textContent")
            check(words in says and len(says) < 400, f"{path.name}: the page says '{says}'")
    code = page.value("read('observer=2'), c_of_state()")
    check(code and "controller_update" in code["source"], "there is no C of a cascade")
    check(not page.value("read('observer=1'), c_of_state()"), "there is C of what cannot be written")
    page.value("read(''), update(true)")
    page.value("study(), cancel()")
    check("ancel" in page.value("$('logsays').textContent"), "it cannot be cancelled")
    for width in (390, 1300, 1920):
        page.size(width, 900)
        for part in ("log", "play"):
            page.value(f"view('{part}')")
            wide = page.value("document.documentElement.scrollWidth")
            check(wide <= width, f"{part}: {wide} px wide in a window of {width} px")


def taken_over(page, found, name, check):
    """The design in the playground is that of the page: noise moves u by as much."""
    page.value("$('toplay').click()")
    check(page.value("$('refusal').textContent") == "", f"{name}: the playground refuses {found['address']}")
    ours = page.value("100 * result.numbers[0].noise / ((1 + state.down) * state.limit)")
    row = next(row for row in re.findall(r"<tr>.*?</tr>", found["main"], re.S)
               if re.search(r"scope=.row.>\d+ " + re.escape(found["design"]) + "<", row))
    says = float(re.findall(r"<td>([^<]*)</td>", row)[4])
    check(abs(ours - says) < 0.006 * says, f"{name}: noise moves u by {ours:.4g} %, the page says {says:g} %")
    page.value("view('log')")


def by_keyboard(page, check):
    """From the first tab to a log of the page, without a mouse."""
    page.value("view('play'), $('tab-play').focus()")
    page.key("ArrowRight")
    check(page.value("!$('log').hidden && document.activeElement.id") == "tab-log", "no arrow leads to the other part")
    for _ in range(20):
        page.key("Tab")
        if page.value("document.activeElement.dataset.log"):
            break
    page.value("window.before = show_log; window.answer = new Promise((done) => { show_log = (said) => "
               "{ before(said); show_log = before; done(said.status); }; }); null")
    page.key("Enter")
    check(page.value("answer") == 0, "Enter on the first log gives no controller")


def study(page, path, options):
    """The answer of the worker to a file and options, None if it was not asked."""
    page.value(f"$('more').value = {json.dumps(options)}; file = null; null")
    page.value("window.answer = new Promise((done) => { $('file').onchange = async () => "
               "done(await take($('file').files[0])); }); null")
    page.choose("#file", path)
    told = page.value("answer.then((said) => JSON.stringify(said, (key, value) => key === 'drawn' ? undefined : value))")
    return json.loads(told) if told else None


def main():
    place, native, logs = sys.argv[1:]
    here = Path(__file__).parent
    lines = (here / "settings.txt").read_text(encoding="utf-8").split()
    passed, failed = 0, []

    def check(good, words):
        nonlocal passed
        passed += bool(good)
        if not good:
            failed.append(words)

    check("default-src 'none'" in open(place, encoding="utf-8").read(), "the page forbids no request")
    with Browser() as page:
        page.open(Path(place).resolve().as_uri())
        played = page.value(f"selftest({json.dumps(lines)})")
        for words in played["problems"]:
            check(False, words)
        theirs = groups(open(native, "rb").read())
        ours = groups(base64.b64decode(played["numbers"]))
        check(len(ours) == len(theirs) == len(lines), f"{len(ours)} settings, not {len(lines)}")
        worst = [0.0, 0.0, 0.0]
        compared = 0
        for line, a, b in zip(lines, ours, theirs):
            state = dict(part.split("=") for part in line.split("&"))
            check(len(b[0]) == int(state["samples"]), f"{line}: the native program refused it")
            quantum = float(state.get("quantum", 0))
            for i, (x, y) in enumerate(zip(a, b)):
                kind = 0 if i < SIGNALS else 1 if i < SIGNALS + BLOCKS else 2
                far = distance(x, y, kind > 0)
                allowed = (1e-12, 1e-7, 1e-9)[kind]
                if quantum and kind < 2:  # what a step of the sensor does, to any signal
                    allowed = 1e-6
                worst[kind] = max(worst[kind], far)
                compared += len(y)
                check(far <= allowed, f"{line}: array {i} differs by {far:.3g}, not {allowed:g}")
        print(f"{compared} numbers of {len(lines)} settings; largest differences: signals {worst[0]:.2g} of the "
              f"range, numbers {worst[1]:.2g}, curves {worst[2]:.2g}; an update took {played['frame']:.2f} ms")

        page.value("view('log')")
        with open(logs, encoding="utf-8") as native_logs:
            for line, wanted in zip((here / "logs.txt").read_text(encoding="utf-8").splitlines(), native_logs):
                name, _, options = line.partition(" ")
                began = time.monotonic()
                found, wanted = study(page, here.parent / "data" / name, options), json.loads(wanted)
                print(f"{name}: {time.monotonic() - began:.1f} s")
                if "error" in found:
                    found = {**dict.fromkeys(wanted, ""), **found}
                for key, native_one in wanted.items():
                    ours = found.get(key, "" if key == "error" else None)
                    first = next((f"'{a[:200]}' natively '{b[:200]}'" for a, b in
                                  zip(str(ours).split("\n"), str(native_one).split("\n")) if a != b), "")
                    check(ours == native_one, f"{name}: {key} differs: {first}")
                if found.get("address"):
                    taken_over(page, found, name, check)
        by_keyboard(page, check)
        visit(page, check)
        check(not page.said, "console: " + "; ".join(page.said[:5]))
        asked = [one for one in page.requests if not one.startswith(("file:", "blob:", "about:"))]
        check(not asked, f"the page asked for {asked}")
    for words in failed:
        print(words)
    print(f"{passed} passed, {len(failed)} failed")
    sys.exit(1 if failed else 0)


main()
