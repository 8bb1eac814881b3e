#!/usr/bin/env python3
"""The pictures of the READMEs are figures of the examples, made small: examples/common/pictures.py OUT
[--write] compares each examples/FOLDER/NAME.svg in the sources with OUT/FOLDER/*/NAME.svg as drawn now,
or writes it. The last line is "N passed, N failed"."""

import re
import sys
import xml.etree.ElementTree as xml
from itertools import groupby
from pathlib import Path
from xml.sax.saxutils import escape

UNIT = 10      # a picture counts in tenths of a px: whole numbers are short
NEAR = 2.5     # units that a line may move by in being made small
SAME = 15      # units that it may be off: another processor, another last digit
MOST = 25600   # bytes
LINE = re.compile(r' d="([^"]*)"')
POINT = re.compile(r"([ML])(-?[0-9.]+),(-?[0-9.]+)|Z")
INHERITED = ("color", "fill", "stroke", "stroke-width", "font-size", "text-anchor", "transform")
AXES = ("#dedede", "#404040")  # lines of the grid, and of the frame and its marks
HREF = "{http://www.w3.org/1999/xlink}href"


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


def units(number):
    return round(UNIT * float(number))


def short(number):
    return f"{number:.2f}".rstrip("0").rstrip(".")


def color(text):
    rgb = re.findall(r"\d+", text) if text.startswith("rgb") else []
    return "#%02x%02x%02x" % tuple(map(int, rgb)) if rgb else {"black": "#000000"}.get(text, text.lower())


def lines(path):
    """The unbroken lines of an attribute d of gnuplot, in units."""
    found = []
    for move, x, y in POINT.findall(path):
        if move == "M":
            found.append([])
        found[-1].append((UNIT * float(x), UNIT * float(y)) if move else found[-1][0])
    if POINT.sub("", path).strip():
        sys.exit(f"more than lines in a path: {path[:60]}")
    return found


def written(line):
    """The first point, then the steps."""
    points = [(round(x), round(y)) for x, y in fewer(line)]
    steps = [(x - a, y - b) for (a, b), (x, y) in zip(points, points[1:])]
    steps = [step for step in steps if step != (0, 0)] or [(0, 0)]
    return "M%d %dl" % points[0] + " ".join("%d %d" % step for step in steps).replace(" -", "-")


def read(path):
    """What `written` wrote, of all its lines."""
    found = []
    for part in path.split("M")[1:]:
        numbers = list(map(int, re.findall(r"-?\d+", part)))
        points = [(numbers[0], numbers[1])]
        for dx, dy in zip(numbers[2::2], numbers[3::2]):
            points.append((points[-1][0] + dx, points[-1][1] + dy))
        found.append(points)
    return found


def words(element):
    """The text of a label: plain, or with marks that are raised or lowered."""
    out, size = "", None
    for part in element.iter():
        if part.tag.endswith("tspan") and (part.text or part.get("dy")):
            dy, size = part.get("dy"), part.get("font-size", size)
            mark = f' dy="{units(dy.replace("px", ""))}" font-size="{units(size)}"' if dy and size else ""
            text = escape(part.text or "")
            out += f"<tspan{mark}>{text}</tspan>" if dy else text
    return out


def elements(node, style, out, used):
    """The drawing as a list of (kind, attributes, content): the groups of gnuplot are resolved."""
    tag = node.tag.split("}")[1]
    style = {**style, **{key: node.get(key) for key in INHERITED if key in node.attrib}}
    opacity = node.get("opacity") or node.get("fill-opacity")
    faint = f' opacity="{short(float(opacity))}"' if opacity else ""
    if tag == "path":
        dashes = [str(units(x)) for x in node.get("stroke-dasharray", "").split(",") if x]
        drawn = color(style["stroke"] if style["stroke"] != "currentColor" else style["color"])
        out.append(("axes" if drawn in AXES and not dashes else "line",
                    f'stroke="{drawn}" stroke-width="{units(style["stroke-width"])}"' +
                    (f' stroke-dasharray="{",".join(dashes)}"' if dashes else "") + faint,
                    "".join(written(line) for line in lines(node.get("d")))))
    elif tag == "polygon":
        corners = [tuple(UNIT * float(x) for x in pair.split(",")) for pair in node.get("points").split()]
        out.append(("area", f'fill="{color(node.get("fill"))}"' + faint, written(corners)))
    elif tag == "text":
        x, y = re.search(r"translate\(([^,]*),([^)]*)\)", style["transform"]).groups()
        turn = re.search(r"rotate\(([^)]*)\)", style["transform"])
        place = f'x="{units(x)}" y="{units(y)}"' if not turn or float(turn[1]) == 0 else \
            f'transform="translate({units(x)} {units(y)})rotate({short(float(turn[1]))})"'
        out.append(("text", f'font-size="{units(style["font-size"])}" text-anchor="{style["text-anchor"]}" '
                    f'fill="{color(style["fill"])}"', f"<text {place}>{words(node)}</text>"))
    elif tag == "use":
        x, y, scale = re.search(r"translate\(([^,]*),([^)]*)\) scale\(([^)]*)\)", style["transform"]).groups()
        name, ink = node.get(HREF)[1:], color(style["color"])
        if name == "gpPt6":  # a dot is a line without length that has round ends
            out.append(("dots", f'stroke="{ink}" stroke-width="{round(2.22 * UNIT * float(scale))}" '
                        'stroke-linecap="round"' + faint, f"M{units(x)} {units(y)}l0 0"))
        else:
            used.add(name)
            out.append(("mark", f'color="{ink}"' + faint, f'<use href="#{name}" transform="translate('
                        f'{units(x)} {units(y)})scale({short(UNIT * float(scale))})"/>'))
    elif tag == "image":
        sys.exit("a picture cannot have a colour map: it would not be small")
    elif tag != "defs":
        for child in node:
            elements(child, style, out, used)


def symbols(root, used):
    """The marks of gnuplot that are drawn, with those that they consist of."""
    by_name = {node.get("id"): node for node in root.iter() if node.get("id")}
    out = []
    for name in sorted(used):
        while name:
            node = by_name[name]
            attributes = "".join(f' {"href" if key == HREF else key}="{value}"'
                                 for key, value in sorted(node.attrib.items()))
            out.append(f"<{node.tag.split('}')[1]}{attributes}/>")
            name = node.get(HREF, "#")[1:]
    return "<defs>" + "".join(sorted(set(out))) + "</defs>\n" if out else ""


def small(text):
    root = xml.fromstring(text)
    width, height = root.get("viewBox").split()[2:]
    drawn, used = [], set()
    elements(root, {}, drawn, used)
    out = [f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
           f'viewBox="0 0 {units(width)} {units(height)}" fill="none" '
           'font-family="DejaVu Sans,Verdana,Arial,sans-serif">\n' + symbols(root, used) +
           '<path fill="#fff" d="M0 0h{0}v{1}h-{0}"/>'.format(units(width), units(height))]
    # Axes and words hide nothing of one another, so that equal ones come together; curves stay in order.
    for flat, run in groupby(drawn, key=lambda one: one[0] in ("axes", "text")):
        run = sorted(run, key=lambda one: (AXES[0] not in one[1], *one[:2])) if flat else run
        for (kind, style), same_style in groupby(run, key=lambda one: one[:2]):
            content = [one[2] for one in same_style]
            if kind in ("text", "mark"):
                out.append(f"<g {style}>" + "".join(content) + "</g>")
            else:
                out += [f'<path {style} d="{d}"/>' for d in
                        (["".join(content)] if kind in ("axes", "dots") else content) if d]
    return "\n".join(out) + "\n</svg>\n"


def same(was, now):
    """The same words and marks, and lines that are nowhere further apart than SAME."""
    if LINE.sub("", was) != LINE.sub("", now):
        return False
    for a, b in zip(LINE.findall(was), LINE.findall(now)):
        a, b = read(a), read(b)
        if len(a) != len(b):
            return False
        for one, other in zip(a, b):
            for line, points in ((one, other), (other, one)):
                ends = list(zip(line, line[1:])) or [(line[0], line[0])]
                if any(min(off(p, *e) for e in ends) > SAME for p in points):
                    return False
    return True


def main():
    out, write = Path(sys.argv[1]), "--write" in sys.argv[2:]
    passed = failed = 0
    front = (Path(__file__).resolve().parents[2] / "README.md").read_text()
    for picture in sorted(Path(__file__).resolve().parents[1].glob("*/*.svg")):
        name = f"{picture.parent.name}/{picture.name}"
        drawn = list((out / picture.parent.name).glob(f"*/{picture.name}"))
        wrong = ""
        if len(drawn) != 1:
            wrong = f"the examples draw {len(drawn)} of this name"
        else:
            now = small(drawn[0].read_text())
            if write:
                picture.write_text(now)
            if not same(picture.read_text(), now):
                wrong = "not what the examples draw now: examples/common/pictures.py OUT --write"
            elif picture.stat().st_size > MOST:
                wrong = f"{picture.stat().st_size} bytes, more than {MOST}: draw less"
        if not wrong and not ((picture.parent / "README.md").read_text().count(f"]({picture.name})") or
                              front.count(f"](examples/{name})")):
            wrong = "shown neither in the README of its folder nor in that of the project"
        if wrong:
            print(f"{name}: {wrong}")
        passed, failed = passed + (not wrong), failed + bool(wrong)
    print(f"{passed} passed, {failed} failed")
    return 0 if passed and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
