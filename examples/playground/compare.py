#!/usr/bin/env python3
"""compare.py SETTINGS NATIVE DOM LOG PAGE: the numbers of the page beside those of the native program.

Each library of mathematics rounds exp, log and pow in its own way, by a unit in the last place; what
follows differs by as much, times what a loop makes of it. So signals are compared relative to their
range: to 1e-12 where nothing switches. A quantum may be shown a sample earlier or later: a step of it.
Margins are found by bisection and golden section, to their own accuracy: 1e-7.
"""

import array
import base64
import math
import re
import sys

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


def main():
    settings, native, dom, log, page = sys.argv[1:]
    lines = open(settings, encoding="utf-8").read().split()
    dom = open(dom, encoding="utf-8", errors="replace").read()
    found = re.search(r'<pre id="selftest">([^<]*)</pre>', dom)
    passed, failed = 0, []

    def check(good, words):
        nonlocal passed
        passed += bool(good)
        if not good:
            failed.append(words)

    console = [line for line in open(log, encoding="utf-8", errors="replace") if "CONSOLE" in line]
    check(not console, "console: " + "".join(console[:5]))
    check("default-src 'none'" in open(page, encoding="utf-8").read(), "the page forbids no request")
    check(found, "the page gave no numbers")
    problems = re.search(r'data-problems="([^"]*)"', dom)
    check(problems and not problems[1], f"a visit: {problems[1] if problems else 'did not end'}")
    if found:
        theirs = groups(open(native, "rb").read())
        ours = groups(base64.b64decode(found[1]))
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
        frame = re.search(r'data-frame="([^"]*)"', dom)
        print(f"{compared} numbers of {len(lines)} settings; largest differences: signals {worst[0]:.2g} of the "
              f"range, numbers {worst[1]:.2g}, curves {worst[2]:.2g}; an update took {frame[1] if frame else '?'} ms")
    for words in failed:
        print(words)
    print(f"{passed} passed, {len(failed)} failed")
    sys.exit(1 if failed else 0)


main()
