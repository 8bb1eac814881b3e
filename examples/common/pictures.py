#!/usr/bin/env python3
"""The pictures of the READMEs are figures of the examples, made small: examples/common/pictures.py OUT
[--write] compares each examples/FOLDER/NAME.svg in the sources with OUT/FOLDER/*/NAME.svg as drawn now,
or writes it. The last line is "N passed, N failed"."""

import re
import sys
from pathlib import Path

NEAR = 0.25  # px that a line may move by in being made small
SAME = 1.5   # px that it may be off: another processor, another last digit
LINE = re.compile(r"d='([^']*)'")
POINT = re.compile(r"([ML])(-?[0-9.]+),(-?[0-9.]+)")


def off(point, a, b):
    """Distance of a point to the line from a to b."""
    (x, y), (ax, ay), (bx, by) = point, a, b
    length2 = (bx - ax) ** 2 + (by - ay) ** 2
    share = 0 if length2 == 0 else max(0, min(1, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2))
    return ((x - ax - share * (bx - ax)) ** 2 + (y - ay - share * (by - ay)) ** 2) ** 0.5


def fewer(points):
    """Douglas and Peucker: the points without which the line would move by more than NEAR."""
    keep, open_parts = {0, len(points) - 1}, [(0, len(points) - 1)]
    while open_parts:
        first, last = open_parts.pop()
        if last - first < 2:
            continue
        furthest = max(range(first + 1, last), key=lambda k: off(points[k], points[first], points[last]))
        if off(points[furthest], points[first], points[last]) > NEAR:
            keep.add(furthest)
            open_parts += [(first, furthest), (furthest, last)]
    return [points[k] for k in sorted(keep)]


def parts(path):
    """The unbroken lines of the attribute d; None if there is more in it than lines."""
    lines, rest = [], POINT.sub("", path)
    for move, x, y in POINT.findall(path):
        if move == "M" or not lines:
            lines.append([])
        lines[-1].append((float(x), float(y)))
    return None if rest.strip() else lines


def small(text):
    def shorter(match):
        lines = parts(match.group(1))
        if not lines:
            return match.group(0)
        return "d='" + " ".join(
            "M" + " L".join(f"{x:.1f},{y:.1f}" for x, y in fewer(line)) for line in lines) + "'"

    text = LINE.sub(shorter, text)
    text = re.sub(r"<desc>.*?</desc>\n?", "", text)  # of the release of gnuplot
    text = re.sub(r"<g [^>]*>\s*</g>\n?", "", text)
    return re.sub(r"\n\s*\n+", "\n", text)


def same(was, now):
    """The same words and marks, and lines that are nowhere further apart than SAME."""
    if LINE.sub("", was) != LINE.sub("", now):
        return False
    for a, b in zip(LINE.findall(was), LINE.findall(now)):
        a, b = parts(a), parts(b)
        if (a is None) != (b is None) or (a and len(a) != len(b)):
            return False
        for one, other in zip(a or [], b or []):
            for line, points in ((one, other), (other, one)):
                ends = list(zip(line, line[1:])) or [(line[0], line[0])]
                if any(min(off(p, *e) for e in ends) > SAME for p in points):
                    return False
    return True


def main():
    out, write = Path(sys.argv[1]), "--write" in sys.argv[2:]
    passed = failed = 0
    for picture in sorted(Path(__file__).resolve().parents[1].glob("*/*.svg")):
        name = f"{picture.parent.name}/{picture.name}"
        drawn = list((out / picture.parent.name).glob(f"*/{picture.name}"))
        if len(drawn) != 1:
            print(f"{name}: the examples draw {len(drawn)} of this name")
            failed += 1
            continue
        now = small(drawn[0].read_text())
        if write:
            picture.write_text(now)
        if same(picture.read_text(), now):
            passed += 1
        else:
            print(f"{name} is not what the examples draw now: examples/common/pictures.py OUT --write")
            failed += 1
    print(f"{passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


sys.exit(main())
