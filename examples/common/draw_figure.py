#!/usr/bin/env python3
"""Draws a figure that figure.cpp describes on stdin: writes NAME.gp beside its NAME.csv and lets
gnuplot make NAME.svg and NAME.png of it, or those of them that are asked for."""

import csv
import math
import subprocess
import sys
from collections import namedtuple
from pathlib import Path

# In the order of the enums in figure.hpp.
COLORS = "000000 0072B2 D55E00 009E73 CC79A7 E69F00 56B4E9 000000 808080".split()
DASHES = ["1", "(9,4)", "(2,3)", "(10,3,2,3)"]
MARKERS = [7, 7, 6, 5, 9, 2]
PLACES = [None, "left top", "right top", "left bottom", "right bottom", "above"]
WIDTH = 900  # px

BEGIN = """\
# Written by an example of esokit. To change the figure, edit this and run in this folder:
#   gnuplot {name}.gp
W = {width}; H = {height:.0f}
set encoding utf8
do for [format in '{formats}'] {{
if (format eq 'svg') {{
  set terminal svg size W,H dynamic enhanced font 'DejaVu Sans,12' background '#ffffff'
}} else {{
  set terminal pngcairo size 2*W,2*H enhanced font 'DejaVu Sans,12' fontscale 1.5 \\
    linewidth 2 pointscale 2 dashlength 2 background '#ffffff'
}}
set output '{name}.'.format
reset
set datafile separator ','
set multiplot
set minussign
set clip one; set clip two
set border 15 linewidth 0.8 linecolor rgb '#404040'
set grid linetype 1 linecolor rgb '#dedede' linewidth 0.6
set palette defined (0 '#2166AC', 0.25 '#92C5DE', 0.5 '#F7F7F7', 0.75 '#F4A582', 1 '#B2182B')
set cbtics in scale 0.5 autofreq font ',11' textcolor rgb '#202020'; set format cb '%h'
"""

Drawn = namedtuple("Drawn", "kind at name color dash width marker size opacity block")
Inset = namedtuple("Inset", "left bottom width height x_from x_to frame connect")


def quoted(text):
    return "'" + text.replace("'", "''") + "'"


class Panel:
    """One pair of axes: what a description says between two rows `panel`."""

    def __init__(self, row, column, row_span, column_span):
        self.top_row, self.left_column = int(row), int(column)
        self.bottom_row = self.top_row + int(row_span) - 1
        self.right_column = self.left_column + int(column_span) - 1
        self.settings, self.drawn, self.notes, self.insets = {}, [], [], []

    def add(self, key, values, blocks):
        if key == "draw":
            data = values[0] not in ("horizontal", "vertical")
            self.drawn.append(Drawn(*values, next(blocks) if data else None))
        elif key == "note":
            self.notes.append(values)
        elif key == "inset":
            self.insets.append(Inset(*map(float, values[:6]), *values[6:]))
        else:
            self.settings[key] = values

    def get(self, key, default=""):
        return self.settings.get(key, [default])[0]

    def finish(self, width, spare):
        """For axes of about that width: where the legend is, what colours a map ends with, and the
        room that numbers and labels need at the left (and spare px more for long numbers beside a
        label), below, at the right and above, px."""
        names = [one.name for one in self.drawn if one.name]
        self.legend = PLACES[int(self.get("legend", "2"))] if names else None
        # As many columns as gnuplot finds room for: all are as wide as the longest name.
        columns = max(1, int(width / (50 + 7.2 * max(map(len, names), default=0))))
        self.legend_height = 20 * math.ceil(len(names) / columns) if self.legend == "above" else 0
        self.limit = next((one.at for one in self.drawn if one.kind == "map"), None)
        self.room = (74 + spare if self.get("y_label") else 50,
                     8 if self.get("x_hidden") else 48 if self.get("x_label") else 28,
                     76 if self.limit else 18,
                     10 + (20 if self.get("title") else 0) + self.legend_height)


class Figure:
    def __init__(self, rows, spare):
        rows, self.spare = iter(rows), spare
        _, self.folder, self.name, self.title, lines, columns, height, self.formats = next(rows)
        self.panels, self.series = [], []
        blocks = iter(range(1, 10000))  # block 0 is the CSV's heading
        for key, *values in rows:
            if key == "panel":
                self.panels.append(Panel(*values))
            else:
                self.panels[-1].add(key, values, blocks)
        self.layout(int(lines), int(columns), float(height))
        self.text = BEGIN.format(name=self.name, width=WIDTH, height=math.ceil(self.height),
                                 formats=self.formats)
        if self.title:
            self.label(self.title, WIDTH / 2, self.height - 16, 14)
        for panel in self.panels:
            self.add_panel(panel)
        self.put("unset multiplot\nset output\n}")

    def put(self, text):
        self.text += text + "\n"

    def layout(self, lines, columns, height):
        """Axes of one row share their top and bottom, axes of one column their left and right."""
        for panel in self.panels:
            span = panel.right_column - panel.left_column + 1
            panel.finish(span * WIDTH / columns - 92, self.spare)

        def widest(count, cell, side):
            return [max([panel.room[side] for panel in self.panels
                         if getattr(panel, cell) == i] or [0]) for i in range(count)]

        left, right = widest(columns, "left_column", 0), widest(columns, "right_column", 2)
        top, bottom = widest(lines, "top_row", 3), widest(lines, "bottom_row", 1)
        width = (WIDTH - sum(left) - sum(right)) / columns
        inside = sum(top) + sum(bottom) + lines * height
        self.height = inside + (28 if self.title else 0)

        def x(column):
            return sum(left[:column + 1]) + sum(right[:column]) + column * width

        def y(row):
            return inside - sum(top[:row + 1]) - sum(bottom[:row]) - row * height

        for panel in self.panels:
            panel.box = (x(panel.left_column), y(panel.bottom_row) - height,
                         x(panel.right_column) + width, y(panel.top_row))

    def screen(self, x, y):
        return f"screen {x / WIDTH:.6g},{y / self.height:.6g}"

    def label(self, text, x, y, size):
        self.put(f"set label {quoted(text)} at {self.screen(x, y)} center font ',{size}'")

    def place(self, left, bottom, right, top):
        self.put(f"set lmargin at screen {left / WIDTH:.6g}; "
                 f"set rmargin at screen {right / WIDTH:.6g}\n"
                 f"set bmargin at screen {bottom / self.height:.6g}; "
                 f"set tmargin at screen {top / self.height:.6g}")

    def axis(self, which, limits, tick, font, shift, label="", log="", hidden=""):
        # The scale first: a change of scale drops the end of a range that it cannot show.
        # Between ticks more than a decade apart gnuplot would put small ones at 2, 3, .. one by one.
        far = log and tick and float(tick) > 10
        small = f"unset m{which}tics" if far else f"set m{which}tics default"
        form = "''" if hidden else "'10^{%L}'" if log else "'%h'"
        self.put(f"set {which}label {quoted('' if hidden else label)}"
                 f"{' offset 0,0.3' if which == 'x' else ''}\n"
                 f"{'set' if log else 'unset'} logscale {which}; {small}\n"
                 f"set {which}range [{limits[0]}:{limits[1]}]\nset format {which} {form}\n"
                 f"set {which}tics in scale 0.6,0.3 mirror {tick or 'autofreq'} offset {shift} "
                 f"font ',{font}' textcolor rgb '#202020'")

    def add_panel(self, panel):
        left, bottom, right, top = panel.box
        self.put(f"\n# panel: row {panel.top_row + 1}, column {panel.left_column + 1}")
        for one in panel.drawn:
            if one.kind == "contour":  # gnuplot finds the line, and keeps it in a table
                self.put("set contour base; set cntrparam levels discrete 0; unset surface\n"
                         "set xrange [*:*]; set yrange [*:*]\nset table $zero\n"
                         f"splot '{self.name}.csv' index {one.block} using 3:4:5\n"
                         "unset table; unset contour; set surface")
        self.place(*panel.box)
        # No curve runs along the frame, as u at its limit would.
        free = not (panel.get("y_log") or panel.limit or
                    panel.settings.get("y_range", ["*", "*"]) != ["*", "*"])
        self.put("set autoscale xfix; set autoscale " + ("yfix" if free else "y") +
                 ("\nset offsets 0,0,graph 0.04,graph 0.04" if free else "\nunset offsets"))
        for which in "xy":
            self.axis(which, panel.settings.get(which + "_range", "**"),
                      panel.get(which + "_tick"), 11, "0,0", panel.get(which + "_label"),
                      panel.get(which + "_log"), panel.get(which + "_hidden"))
        style = "Left reverse samplen 2.2 spacing 1.15 font ',11'"
        if panel.legend is None:
            self.put("unset key")
        elif panel.legend == "above":
            self.put(f"set key at {self.screen((left + right) / 2, top + 5 + panel.legend_height / 2)} "
                     f"center center horizontal {style}")
        else:
            self.put(f"set key inside {panel.legend} vertical maxrows auto {style} opaque "
                     "fillcolor rgb '#ffffff'")
        if panel.get("title"):
            self.label(panel.get("title"), (left + right) / 2, top + 12 + panel.legend_height, 12)
        for x, y, text in panel.notes:
            self.put(f"set label {quoted(text)} at first {x},{y} front font ',11'")
        if panel.limit:  # the grid would shine through
            self.put(f"unset grid; set autoscale yfix\nset cbrange [-{panel.limit}:{panel.limit}]\n"
                     f"set colorbox vertical user origin {self.screen(right + 12, bottom)} "
                     f"size {self.screen(13, top - bottom)}")
        zooms = [(inset, *self.zoom(panel, inset)) for inset in panel.insets]
        for zoom in zooms:
            self.mark(*zoom)
        self.plot(panel, True)
        if panel.limit:
            self.put("set grid; set autoscale y")
        for _, *zoom in zooms:
            self.add_inset(panel, *zoom)

    def plot(self, panel, titles):
        items = []
        for one in panel.drawn:
            opacity, width = float(one.opacity), float(one.width)
            transparency = f"{round(255 * (1 - opacity)):02X}" if opacity < 1 else ""
            ink = f"linecolor rgb '#{transparency}{COLORS[int(one.color)]}'"
            title = f"title {quoted(one.name)}" if one.name and titles else "notitle"
            data = f"'{self.name}.csv' index {one.block} using "
            thin, dash = f"linewidth {0.75 * width:.6g}", f"dashtype {DASHES[int(one.dash)]}"
            if one.kind == "vertical":
                self.put(f"set arrow from first {one.at},graph 0 to first {one.at},graph 1 nohead "
                         f"{thin} {dash} {ink}")
            elif one.kind == "horizontal":
                items.append(f"{one.at} with lines {thin} {dash} {ink} {title}")
            elif one.kind == "map":
                items.append(data + "3:4:5 with image notitle")
            elif one.kind == "band":
                items.append(f"{data}3:4:5 with filledcurves {ink} fillstyle solid noborder {title}")
            elif one.kind == "points":
                size = float(one.size) * (0.75 if int(one.marker) else 0.45)
                items.append(f"{data}3:4 with points pointtype {MARKERS[int(one.marker)]} "
                             f"pointsize {size:.6g} {thin} {ink} {title}")
            else:
                data += "3:4"
                if one.kind == "contour":  # the table has no commas
                    data = "$zero using (real(word(strcol(1),1))):(real(word(strcol(1),2)))"
                items.append(f"{data} with lines linewidth {width:.6g} {dash} {ink} {title}")
        self.put("plot \\\n  " + ", \\\n  ".join(items) +
                 "\nunset arrow; unset object\nunset label; unset colorbox")

    # ---- insets ----

    def zoom(self, panel, inset):
        """The ends of what an inset shows, and its box."""
        if not self.series:
            file = Path(self.folder) / (self.name + ".csv")
            self.series = file.read_text(encoding="utf-8").split("\n\n\n")
        shown = [float(row[3]) for one in panel.drawn if one.block
                 for row in csv.reader(self.series[one.block].splitlines())
                 if row and inset.x_from <= float(row[2]) <= inset.x_to]
        spare = 0.06 * max(max(shown) - min(shown), 1e-12)
        left, bottom, right, top = panel.box
        left, bottom = left + inset.left * (right - left), bottom + inset.bottom * (top - bottom)
        return ((inset.x_from, inset.x_to), (min(shown) - spare, max(shown) + spare),
                (left, bottom, left + inset.width * (panel.box[2] - panel.box[0]),
                 bottom + inset.height * (panel.box[3] - panel.box[1])))

    def mark(self, inset, x, y, box):
        """The frame around what the inset shows, and two lines that join it with the inset."""
        if not inset.frame:
            return
        self.put(f"set object rectangle from first {x[0]:.12g},{y[0]:.12g} to first "
                 f"{x[1]:.12g},{y[1]:.12g} front clip fillstyle empty border rgb '#606060' "
                 "linewidth 0.8")
        above = inset.bottom + inset.height / 2 > 0.5
        for side in (0, 1) if inset.connect else ():
            end = self.screen(box[2 * side], box[1 if above else 3])
            self.put(f"set arrow from first {x[side]:.12g},{y[above]:.12g} to {end} nohead front "
                     "linecolor rgb '#909090' linewidth 0.8")

    def add_inset(self, panel, x, y, box):
        self.put("\n# zoom\nset autoscale y; unset offsets")
        self.place(*box)
        # White behind the inset's numbers, but not over the panel's border.
        self.put("set object rectangle from " +
                 self.screen(max(box[0] - 41, panel.box[0] + 1), max(box[1] - 17, panel.box[1] + 1)) +
                 " to " +
                 self.screen(min(box[2] + 9, panel.box[2] - 1), min(box[3] + 6, panel.box[3] - 1)) +
                 " behind fillcolor rgb '#ffffff' fillstyle solid noborder")
        for which, limits, shift in (("x", x, "0,0.35"), ("y", y, "0.6,0")):
            # 1, 2 or 5 times a power of ten, about three in a range.
            step = (limits[1] - limits[0]) / 3.5
            power = 10.0 ** math.floor(math.log10(step))
            digit = next(d for d, end in ((1, 1.5), (2, 3.5), (5, 7.5), (10, 10.1))
                         if step / power <= end)
            self.axis(which, [f"{end:.12g}" for end in limits], f"{digit * power:.6g}", 9, shift)
        self.put("unset key")
        self.plot(panel, False)


def draw(rows, spare):
    """Draws the figure; returns whether each label beside an axis is in it."""
    figure = Figure(rows, spare)
    file = Path(figure.folder) / figure.name
    Path(f"{file}.gp").write_text(figure.text, encoding="utf-8")
    for kind in figure.formats.split():
        Path(f"{file}.{kind}").unlink(missing_ok=True)
    # -d: without the user's own start-up file, which could change every figure.
    subprocess.run(["gnuplot", "-d", figure.name + ".gp"], cwd=figure.folder, check=True)
    # An SVG holds text, not shapes: fonts of about the same width for readers without DejaVu.
    svg = Path(f"{file}.svg").read_text(encoding="utf-8").replace(
        'font-family="DejaVu Sans"', 'font-family="DejaVu Sans, Verdana, Arial, sans-serif"')
    Path(f"{file}.svg").write_text(svg, encoding="utf-8")
    # Where numbers take its room, gnuplot leaves a label out and says nothing.
    return svg.count("rotate(270)") >= sum(bool(panel.get("y_label")) for panel in figure.panels)


def main():
    rows = list(csv.reader(sys.stdin))
    try:
        if not any(draw(rows, spare) for spare in range(0, 61, 12)):
            sys.exit(f"figure {rows[0][2]}: no room for the label of an axis; use shorter numbers")
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"figure {rows[0][2]}: gnuplot (Debian package gnuplot-nox): {error}")


if __name__ == "__main__":
    main()
