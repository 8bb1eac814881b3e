#!/usr/bin/env python3
"""Shows what the examples wrote below OUT: index.html, the front page, and one page a paper.

usage: make_page.py OUT

Reads the summary.csv, contents.csv and table_*.csv that Report writes (report.hpp); the look of the
pages is page.html beside this file. Loads nothing from elsewhere.
"""

import csv
import html
import itertools
import math
import re
import string
import sys
from collections import namedtuple
from pathlib import Path
from urllib.parse import quote

sys.dont_write_bytecode = True  # nothing is left beside the sources
from check_readme import as_printed, replaced, sourced, value_of

SUMMARY = ["case", "metric", "paper", "ours", "relative_error", "tolerance", "pass", "note"]
CONTENTS = ["kind", "name", "text", "alt", "more", "figure"]
MISSES = ("printed number missed", "the text does not describe what was simulated",
          "settings or data not published",  # miss_texts in report.cpp
          "doubtful", "does not reproduce")  # column_texts there
COLUMN = "chi-square of the column"  # column_metric there
WIDEST = 10  # columns of a table, then it is split
Row = namedtuple("Row", "case metric paper ours error tolerance passed note outcome miss")
Item = namedtuple("Item", CONTENTS + ["addition"])


# ---- what was written ----

def read_csv(file, header=None):
    with open(file, newline="", encoding="utf-8") as stream:
        rows = [row for row in csv.reader(stream, strict=True) if row]
    if not rows or header and rows[0] != header or any(len(row) != len(rows[0]) for row in rows):
        raise ValueError(f"{file} is not as Report writes it")
    return rows


def judged(fields):
    """A row of a summary.csv; its outcome is one of the classes of page.html."""
    miss = next((miss for miss in MISSES if fields[7].startswith(miss)), None)
    return Row(*fields, {"yes": "pass", "": "reported"}.get(
        fields[6], "known_miss" if miss else "fail"), miss)


class Example:
    def __init__(self, out, folder):
        self.name, self.folder = folder.name, folder.relative_to(out)
        self.rows = [judged(row) for row in read_csv(folder / "summary.csv", SUMMARY)[1:]]
        self.about, self.items, additions = {}, [], False
        for row in read_csv(folder / "contents.csv", CONTENTS)[1:]:
            if row[0] == "additions":
                additions = row[2] == "on"
            elif row[0] in ("paper_title", "citation", "link", "title", "description", "order",
                            "addition"):
                self.about[row[0]] = row[2]
            else:
                self.items.append(Item(*row, additions))
        self.addition = "addition" in self.about
        self.has_additions = self.addition or any(item.addition for item in self.items)
        self.title = self.about["title"] or self.name
        self.anchor = re.sub("[^A-Za-z0-9_-]", "-", self.folder.as_posix())


class Paper:
    def __init__(self, folder, examples):
        self.folder, self.page = folder, quote(folder + ".html")
        self.examples = sorted(examples, key=lambda one: (one.addition, int(one.about["order"])))
        title, self.citation, self.link = (
            next((one.about[key] for one in examples if one.about[key]), "")
            for key in ("paper_title", "citation", "link"))
        self.title = title or folder

    def items(self, kind):
        return [(one, item) for one in self.examples for item in one.items if item.kind == kind]


def read_results(out):
    """All that was run, a folder each."""
    folders = sorted(file.parent for file in out.rglob("summary.csv"))
    if not folders:
        raise ValueError(f"no summary.csv below {out}: run an example first")
    papers = []
    for folder, group in itertools.groupby(folders, lambda one: one.parent):
        examples = [Example(out, one) for one in group]
        # What could not run, as its data are not here, has nothing to show.
        examples = [one for one in examples
                    if one.rows or any(item.kind != "remark" for item in one.items)]
        if examples:
            papers.append(Paper(folder.relative_to(out).as_posix(), examples))
    return papers


# ---- pieces of a page ----

esc = html.escape


def shown(text):
    """A number for a reader, as shown_text (report.cpp) writes it."""
    try:
        value = float(text)
    except ValueError:
        return text
    size = abs(value)
    if not math.isfinite(value) or value == 0:
        return f"{value:.9g}"
    if size < 1e-30:
        return "-0 (above -1e-30)" if value < 0 else "0 (below 1e-30)"
    if size < 1e-4 or size >= 1e8:
        return plain(f"{value:.3g}")
    return f"{value:.{max(0, 3 - math.floor(math.log10(size)))}f}"


def percent(share):
    if not share:
        return ""
    value = 100 * float(share)
    return f"{value:.0f} %" if 1000 <= abs(value) < 1e6 else f"{value:.3g} %"


def plain(text):
    """Powers of ten between 1e-6 and 1e8 written out: 1.1e+03 is 1100, 4.4e-05 is 0.000044."""
    def written(found):
        digits = len(found[1].lstrip("-").replace(".", ""))
        power = int(found[2])
        return f"{float(found[0]):.{max(0, digits - 1 - power)}f}"
    return re.sub(r"(?<![\w.])(-?\d+(?:\.\d+)?)e(\+0[1-7]|-0[56])(?!\d)", written, text)


def png_size(file):
    """Width and height, so that the page does not jump while it loads."""
    head = file.read_bytes()[16:24]
    return int.from_bytes(head[:4], "big"), int.from_bytes(head[4:], "big")


def counts(paper):
    """Printed numbers and own checks, never added up."""
    rows = [row for one in paper.examples for row in one.rows]
    printed = [{"fail": "known_miss"}.get(row.outcome, row.outcome) for row in rows if row.paper]
    columns = [row.miss or row.outcome for row in rows if row.metric == COLUMN]
    own = [row.outcome for row in rows if not row.paper and row.metric != COLUMN]

    text, classes = "", dict.fromkeys(("doubtful", "does not reproduce"), "known_miss")
    for words, outcomes, kinds in (
            ("Printed numbers", printed, {"pass": "met,", "known_miss": "missed,",
                                          "reported": "not judged"}),
            ("Their noisy columns", columns, {"pass": "reproduced,", "doubtful": "doubtful,",
                                              "does not reproduce": "not reproduced,",
                                              "reported": "not judged"}),
            ("Own checks", own, {"pass": "passed,", "fail": "failed"})):
        numbers = [(outcomes.count(kind), name, kind) for kind, name in kinds.items()]
        if any(number for number, _, _ in numbers):
            text += f"<span>{words}:" + "".join(
                f' <span class="{classes.get(kind, kind) if number else "reported"}">'
                f"{number} {name}</span>" for number, name, kind in numbers) + "</span>\n"
    return ('<p class="counts">' +
            (text or '<span class="reported">These programs compare no numbers.</span>') + "</p>\n")


def of_words(column):
    """Whether a column is read from the left: it has no cell that begins with a number."""
    return not any(re.match(r"-?\d|-$", text) for text in column)


def table(caption, headings, rows, text=()):
    """`rows` hold finished cells, with their td or th; no table without them. `text`: which columns
    are read from the left."""
    if not rows:
        return ""
    head = "".join(f'<th class="text" scope="col">{esc(heading)}</th>' if c < len(text) and text[c]
                   else f'<th scope="col">{esc(heading)}</th>' for c, heading in enumerate(headings))
    body = "".join(f"<tr>{''.join(row)}</tr>\n" for row in rows)
    return (f'<figure class="tab"><figcaption>{esc(caption)}</figcaption>'
            f'<div class="table" tabindex="0"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n'
            f"{body}</tbody></table></div></figure>\n")


def cell(text, kind=""):
    return f'<td class="{kind}">{esc(text)}</td>' if kind else f"<td>{esc(text)}</td>"


def boxed(heading, items, kind=""):
    if not items:
        return ""
    return (f'<section class="plainly{kind}">\n{heading}\n<ul>\n' +
            "".join(f"<li>{item}</li>\n" for item in items) + "</ul>\n</section>\n")


# ---- parts of a paper's page ----

def failures(paper, page=""):
    return boxed("<h2>Failed</h2>", [
        f'<a href="{page}#{one.anchor}">{esc(one.name)}</a>: {esc(row.case)}, {esc(row.metric)}: '
        f'ours {esc(shown(row.ours))}. <span class="quiet">{esc(row.note)}</span>'
        for one in paper.examples for row in one.rows if row.outcome == "fail"], " failed")


def misses(paper):
    items = []
    for one in paper.examples:
        said = [(item.name or MISSES[0], esc(item.text)) for item in one.items
                if item.kind == "not_reproduced"]
        # Where the example says it in words, its rows need not be listed one by one up here.
        said = said or [(row.miss, f"{esc(row.case)}, {esc(row.metric)}: paper {esc(row.paper)}, "
                         f"ours {esc(shown(row.ours))}.")
                        for row in one.rows if row.outcome == "known_miss" and row.paper]
        items += [f'<b>{kind}:</b> {text} <a href="#{one.anchor}">{esc(one.name)}</a>'
                  for kind, text in said]
    return boxed('<h2 id="misses">What does not reproduce</h2>', items)


def claims(paper):
    kinds = {"holds": ("pass", "hold"), "holds in part": ("known_miss", "hold in part"),
             "does not hold": ("known_miss", "do not hold"), "not tested": ("reported", "not tested")}
    found = paper.items("claim")
    if len({(item.text, item.name) for _, item in found if item.name}) < len(found):
        raise ValueError(f"{paper.folder}: a claim without its place, or judged twice")
    verdicts = [item.alt for _, item in found]
    how_many = ", ".join(f"{verdicts.count(one)} {one if verdicts.count(one) == 1 else many}"
                         for one, (_, many) in kinds.items() if one in verdicts)
    return table(f"What the paper claims, and whether it holds here: {how_many}",
                 ["claim", "in the paper", "here", "shown in"], [
        (cell(item.text, "text"), cell(item.name, "text narrow"),
         f'<td class="text"><b class="{kinds[item.alt][0]}">{esc(item.alt)}.</b> '
         f"{esc(item.more)}</td>",
         f'<td class="text narrow"><a href="#{one.anchor}">{esc(item.figure or one.name)}</a></td>')
        for one, item in found], [True] * 4)


def corrections(paper):
    return table("Corrections of printed formulas",
                 ["where", "printed", "correct", "reason"], [
        (cell(item.name, "text narrow"), cell(item.text, "text"), cell(item.alt, "text"),
         cell(item.more, "text")) for _, item in paper.items("correction")], [True] * 4)


def figure(out, example, item):
    width, height = png_size(out / example.folder / (item.name + ".png"))
    stem = quote((example.folder / item.name).as_posix())
    return (f'<figure>\n<label class="zoom"><input type="checkbox" aria-label="larger">'
            f'<img loading="lazy" src="{stem}.png" '
            f'width="{width // 2}" height="{height // 2}" alt="{esc(item.alt)}"></label>\n'
            f'<figcaption>{esc(item.text)}<br>\n<a href="{stem}.svg">SVG</a> · '
            f'<a href="{stem}.gp">gnuplot script</a> · <a href="{stem}.csv">data</a>'
            "</figcaption>\n</figure>\n")


def shown_table(out, example, item):
    """A comparison's verdicts become marks behind our numbers; one that is too wide for a window is
    split between metrics, and each part says which it has."""
    rows = read_csv(out / example.folder / item.name)
    compared = item.kind == "comparison"
    marks = {"ok": ' <span class="pass" title="met">✓</span>',
             "FAILED": ' <span class="fail">✗ failed</span>',
             "missed": ' <span class="known_miss">≠ missed</span>'}
    count = len(rows[0])
    verdicts = [compared and heading.endswith(", result") for heading in rows[0]] + [False]
    ends = [c + 1 for c in range(1, count) if not compared or verdicts[c]]
    parts, start = [], 1
    while start < count:
        ahead = [end for end in ends if end > start]
        stop = max([end for end in ahead if end - start <= WIDEST] or ahead[:1])
        shown_columns = [c for c in range(start, stop) if not verdicts[c]]
        # Of a metric that this table does not have, and of a row without a number, nothing is shown.
        shown_columns = [c for c in shown_columns if any(row[c] for row in rows[1:])]
        rows_here = [row for row in rows[1:] if any(row[c] for c in shown_columns)]
        # Of which how wide: a long text in a narrow column is tall on a phone.
        words = {c: "text" if max(len(row[c]) for row in rows_here) > 16 else "text narrow"
                 for c in shown_columns if of_words(row[c] for row in rows_here)}
        body = [[f'<th scope="row">{esc(row[0])}</th>'] +
                [cell(plain(row[c]), words[c]) if c in words else
                 f"<td>{esc(plain(row[c]))}{marks.get(row[c + 1], '') if verdicts[c + 1] else ''}</td>"
                 for c in shown_columns] for row in rows_here]
        parts += [(shown_columns, words, body)] if shown_columns else []
        start = stop
    text = ""
    for columns, words, body in parts:
        headings = [rows[0][c] for c in columns]
        outer = [one.rsplit(", ", 1)[0] if compared else one for one in (headings[0], headings[-1])]
        part = f" ({' to '.join(dict.fromkeys(outer))})" if len(parts) > 1 else ""
        text += table(item.text + part, [rows[0][0]] + headings, body,
                      [c in words for c in [0, *columns]])
    return text


def article(out, example, items, later=False):
    text = (f'<article id="{example.anchor}{"-additions" if later else ""}">\n'
            f'<h3>{esc(example.title)}{": additions" if later else ""} '
            f'<span class="quiet">{esc(example.name)}</span></h3>\n')
    if not later and example.about["description"]:
        text += f"<p>{esc(example.about['description'])}</p>\n"
    for item in items:
        if item.kind == "figure":
            text += figure(out, example, item)
        elif item.kind in ("table", "comparison"):
            text += shown_table(out, example, item)
        elif item.kind == "diagram":
            text += (f'<figure><img src="{quote((example.folder / item.name).as_posix())}.svg" '
                     f'alt="{esc(item.text)}"><figcaption>{esc(item.text)}</figcaption></figure>\n')
        elif item.kind == "page":
            text += (f'<p><a href="{quote((example.folder / item.name).as_posix())}">'
                     f"{esc(item.text)}</a></p>\n")
        elif item.kind == "remark":
            text += f"<p>{esc(item.text)}</p>\n"
    return text + "</article>\n"


def all_checks(example):
    marks = {"pass": ("✓ met", "✓ passed"), "fail": ("✗ failed",) * 2,
             "known_miss": ("≠ missed",) * 2, "reported": ("not judged", "shown")}
    # Without a relative error the tolerance is absolute.
    rows = [(cell(row.case, "text"), cell(row.metric, "text"), cell(row.paper),
             cell(row.note.split(" ")[1] if row.note.startswith("reference ") else ""),
             cell(shown(row.ours)), cell(percent(row.error)),
             cell(percent(row.tolerance) if row.error else row.tolerance),
             cell("≠ " + row.miss if row.metric == COLUMN and row.miss else
                  marks[row.outcome][not row.paper], row.outcome), cell(row.note, "text"))
            for row in example.rows]
    headings = ["case", "metric", "paper", "reference", "ours", "error", "tolerance", "result", "note"]
    said = [c for c in range(len(headings)) if any(not row[c].endswith("></td>") for row in rows)]
    file = quote((example.folder / "summary.csv").as_posix())
    return (f"<details>\n<summary>{esc(example.title)}: {len(rows)} rows "
            f'(<a href="{file}">summary.csv</a>)</summary>\n' +
            table("", [headings[c] for c in said], [[row[c] for c in said] for row in rows],
                  [headings[c] in ("case", "metric", "note") for c in said]) + "</details>\n")


# ---- pages ----

Card = namedtuple("Card", "section folder title question number")


def cards(out, page):
    """The rows of examples/README.md, which say what the pages answer; its numbers as they were run."""
    changes = []
    text = page.read_text(encoding="utf-8")
    for one in sourced(page)[0]:
        try:
            value, most = value_of(one.source, out)
        except ValueError:
            continue  # was not run: as it is printed
        if one.printed and not most:
            changes.append((one.start, one.end, as_printed(value, one.printed)))
    section, found = "", []
    for line in replaced(text, changes).split("\n"):
        if line.startswith("## "):
            section = line[3:]
        row = re.match(r"\| \[(.*)\]\(([\w/]+)/README\.md\) \|(.*)", line)
        if row:
            question, number = (row[3].split("|") + [""])[:2]
            found.append(Card(section, row[2], row[1], question.strip(), number.strip()))
    return found


def overview(out, papers):
    """Cards that lead to what is here, in the order of examples/README.md."""
    header = """<h1>esokit: what it does, and how well</h1>
<p>Each card leads to a page with figures, tables and all numbers, made by the programs in \
examples/.</p>
"""
    here = {paper.folder: paper.page for paper in papers}
    if (out / "playground.html").exists():
        here["playground"] = "playground.html"
    told = cards(out, Path(__file__).resolve().parents[1] / "README.md")
    told += [Card("More", paper.folder, paper.title, "", "") for paper in papers
             if paper.folder not in [card.folder for card in told]]
    main = "".join(failures(paper, paper.page) for paper in papers)
    for section, group in itertools.groupby((card for card in told if card.folder in here),
                                            lambda card: card.section):
        main += f'<h2>{esc(section)}</h2>\n<ul class="cards">\n' + "".join(
            f'<li><a href="{here[card.folder]}"><b>{esc(card.title)}</b></a>\n'
            f"<p>{esc(card.question)}</p>\n" +
            (f'<p class="number">{esc(card.number)}</p>\n' if card.number else "") + "</li>\n"
            for card in group) + "</ul>\n"
    return header, main


JUDGING = """<p class="quiet">Two kinds of comparison are counted separately. A <b>printed number</b> \
is a number in the paper: it is met, missed, or not judged (if no tolerance can be given, or if noise \
is too large for a verdict). Numbers of single noisy runs are judged together, too, a column at a \
time: it is reproduced, doubtful or not reproduced. An <b>own check</b> compares one of our numbers \
with a formula, with an independent program, or with a limit that it has to keep: it passes or \
fails.</p>
"""


def one_paper(out, paper):
    header = f'<p><a href="index.html">All results</a></p>\n<h1>{esc(paper.title)}</h1>\n'
    header += f'<p class="quiet">{esc(paper.citation)}'
    if paper.link.startswith("https://"):
        header += f' <a href="{esc(paper.link)}">{esc(paper.link)}</a>'
    readme = f"examples/{esc(paper.folder)}/README.md"
    if (out / paper.folder / "README.txt").exists():
        readme = f'<a href="{quote(paper.folder)}/README.txt">{readme}</a>'
    header += ('</p>\n<p class="quiet">What this is, when it helps and how to use it: '
               f"{readme}. A tap on a figure enlarges it.</p>\n{counts(paper)}")
    if paper.link:
        header += JUDGING
        header += ('<p class="quiet">A <b>continuous simulation</b>, as in the papers, integrates '
                   "plant and observer as one differential equation. A <b>sampled observer</b> is "
                   "updated once per sample, as in a controller.</p>\n")

    main = failures(paper) + claims(paper) + misses(paper) + corrections(paper)
    main += '<nav aria-label="Contents">\n<ul>\n'
    for one in paper.examples:
        own = ' <span class="quiet">(our addition)</span>' if one.addition and paper.link else ""
        main += f'<li><a href="#{one.anchor}">{esc(one.title)}</a>{own}</li>\n'
    main += "</ul>\n</nav>\n"
    for one in paper.examples:
        if not one.addition:
            main += article(out, one, [item for item in one.items if not item.addition])
    later = [one for one in paper.examples if one.has_additions]
    if later and paper.link:
        main += '<h2 id="additions">Our additions</h2>\n'
    for one in later:
        main += article(out, one, [item for item in one.items if one.addition or item.addition],
                        not one.addition)
    main += '<h2 id="numbers">All numbers, with tolerances</h2>\n'
    return header, main + "".join(
        all_checks(one) for one in paper.examples if one.rows)


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: make_page.py OUT")
    out = Path(sys.argv[1])
    page = string.Template((Path(__file__).parent / "page.html").read_text(encoding="utf-8"))
    try:
        papers = read_results(out)
        files = {paper.folder: (paper.title + " - esokit", *one_paper(out, paper))
                 for paper in papers}
        files["index"] = ("esokit: results of the examples", *overview(out, papers))
        for name, (title, header, content) in files.items():
            text = page.substitute(title=esc(title), header=header, main=content)
            (out / (name + ".html")).write_text(text, encoding="utf-8")
    except (OSError, ValueError, KeyError, csv.Error) as error:
        sys.exit(f"make_page.py: {error}")
    print((out / "index.html").resolve())


if __name__ == "__main__":
    main()
