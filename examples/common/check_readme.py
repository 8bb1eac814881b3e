#!/usr/bin/env python3
"""Checks the numbers of pages against what the examples wrote: check_readme.py OUT [--write] PAGE...
With --pages instead of OUT only those that come from other pages, which needs no run.

A number of a page that comes from a run has a source. It stands in PAGE.numbers beside PAGE.md, as a
piece of the page, which stands there once, and one source for each of the last numbers of the piece:

    each wins 17 and 26 are ties <!--= choosing/pid#counted: ADRC -> 1; choosing/pid#counted: ADRC -> 2 -->

The file has to account for every number of the page's text (outside of code): a line without a source
is for what no run gives, as settings and years, and may stand there more than once. A line `...` leaves
those out, for a page full of settings. A line that begins with # says something to the reader of the file.

A source is one of

    EXAMPLE: CASE -> METRIC         a row of the example's summary.csv
    EXAMPLE#NAME: ROW -> COLUMN     a cell of its table_NAME.csv; the column by its heading or its
                                    number, or `1..4` for four numbers
    PAGE.md#TEXT: ROW -> COLUMN     a cell of the first table below a line with TEXT of another page,
                                    whose own check keeps it true; PAGE.md as seen from the top folder
    lines FILE, files PATTERN       the lines of a file, the number of files, from the top folder

EXAMPLE is a folder below OUT/FOLDER, where FOLDER is that of the page (for pages of the top folder
and of examples/, below OUT). In the other names * and ? match any text; write ? for a bar, because a
row of a Markdown table must not contain one. Several rows may match: then the largest number counts,
with `min` before the source the smallest, with `sum` the sum. `error` before it takes the largest relative
error in % instead; `A over B` is the quotient of two sources, and `* FACTOR` at the end multiplies. The number
in the page must agree in its last printed digit; with `<=` before the source it must only not be
exceeded. A number in words ("five programs") has a source where its piece has no digits.

With --write the numbers that differ are written into the pages. `--self-test` instead of all
arguments sees each mistake found. The last line is "N passed, N failed".
"""

import csv
import functools
import re
import sys
import tempfile
from collections import namedtuple
from decimal import Decimal
from fnmatch import fnmatchcase
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NUMBER = r"\d{1,3}(?:,\d{3})+(?![\d,])|\d+(?:\.\d+)?(?:e-?\d+)?"
# One that a reader takes for a number: not the 4 of M4F, nor the 20 of C++20.
SIGNED = re.compile(rf"(?:(?<=^)-|(?<= )-)?(?<![\w.+#])(?:{NUMBER})")
STANDING = re.compile(rf"(?<![\w.+#])(?:{NUMBER})(?![\w]|\.\d)")
WORDS = {word: n for n, word in enumerate(
    "zero one two three four five six seven eight nine ten eleven twelve".split())}
WORD = re.compile(r"\b(?:" + "|".join(WORDS) + r")\b", re.IGNORECASE)
REST = "..."  # in a file of pieces: other numbers of the page come from no run
COMMENT = re.compile(r"<!--=(.*?)-->", re.DOTALL)
# What a page shows that no reader takes for a statement of it.
NOT_TEXT = re.compile(r"^```.*?^```|^    [^\n]*|<!--.*?-->|`[^`\n]*`|\]\([^)]*\)|https?://\S+|^ *\d+\. ",
                      re.DOTALL | re.MULTILINE)
SOURCE = re.compile(
    r"(?:(?P<mode>max|min|sum|error) )?(?P<example>[^:#]+)(?:#(?P<table>[^:]+))?:"
    r"(?P<row>.*) -> (?P<column>.*)", re.DOTALL)
COUNTED = re.compile(r"(?P<what>lines|files) (?P<path>\S+)")

Sourced = namedtuple("Sourced", "start end printed source")  # in the text of the page


# ---- what a source says ----

def number(text):
    """The number that a text begins with."""
    found = re.match(r"\s*-?\d+(\.\d*)?(e[+-]?\d+)?", text)
    return float(found[0]) if found else None


@functools.lru_cache(maxsize=None)
def read(file):
    with open(file, newline="", encoding="utf-8") as stream:
        return list(csv.reader(stream))


def cells(line):
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def table_of_page(page, text):
    """Heading and rows of the first table below a line that has the text."""
    lines = COMMENT.sub("", page.read_text(encoding="utf-8")).split("\n")
    begin = next((n for n, line in enumerate(lines)
                  if text in line and not line.startswith("|")), None)
    if begin is None:
        raise ValueError(f"no line of {page} has {text}")
    rows = []
    for line in lines[begin + 1:]:
        if line.startswith("|"):
            rows.append(cells(line))
        elif rows:
            break
    return [rows[0]] + rows[2:]


def one_value(text, folder):
    counted = COUNTED.fullmatch(text)
    if counted:
        found = list(ROOT.glob(counted["path"]))
        if not found:
            raise ValueError("names no file")
        return len(found) if counted["what"] == "files" else \
            sum(len(file.read_text(encoding="utf-8").splitlines()) for file in found)
    source = SOURCE.fullmatch(text)
    if not source:
        raise ValueError("is not EXAMPLE: CASE -> METRIC")
    example, table, mode = source["example"].strip(), source["table"], source["mode"]
    if example.endswith(".md"):
        if not table or not (ROOT / example).exists():
            raise ValueError("there is no such page, or no TEXT above its table")
        header, *rows = table_of_page(ROOT / example, table.strip())
    else:
        file = folder / example / (f"table_{table.strip()}.csv" if table else "summary.csv")
        if not file.exists():
            raise ValueError(f"there is no {file}")
        header, *rows = read(file)
    wanted = source["column"].strip()
    values = []
    for row in (row for row in rows if fnmatchcase(row[0], source["row"].strip())):
        if table:
            values += [number(cell) for c, cell in enumerate(row)
                       if c > 0 and (wanted == str(c) or fnmatchcase(header[c], wanted))]
        elif fnmatchcase(row[1], wanted):
            error = number(row[4])
            values.append(number(row[3]) if mode != "error" else error and 100 * error)
    values = [value for value in values if value is not None]
    if not values:
        raise ValueError("names no row")
    return {"min": min, "sum": sum}.get(mode, max)(values)


def value_of(source, folder):
    """Of a whole source, and whether it is only not to be exceeded."""
    text = source.strip()
    most = text.startswith("<=")
    text = text[2:].strip() if most else text
    factor = re.search(rf" \* (-?(?:{NUMBER}))$", text)
    text = text[:factor.start()] if factor else text
    # "over" is a word of metrics, too: what follows it must be a source, or it is one.
    parts = re.fullmatch(r"(.* -> .*?|(?:lines|files) \S+) over ((?:(?!-> ).)*: .* -> .*|(?:lines|files) \S+)",
                         text, re.DOTALL)
    value = one_value(parts[1], folder) / one_value(parts[2], folder) if parts else \
        one_value(text, folder)
    return value * float(factor[1] if factor else 1), most


def expanded(sources):
    """One source for each number: `-> 1..4` stands for four."""
    for source in (part.strip() for part in sources.split(";")):
        columns = re.fullmatch(r"(.*-> )(\d+)\.\.(\d+)", source, re.DOTALL)
        if columns:
            first, last = int(columns[2]), int(columns[3])
            yield from (columns[1] + str(c) for c in range(first, last + 1))
        else:
            yield source


# ---- what a page says ----

def numbers_before(text, begin, end, sources):
    """The last numbers of the text from begin to end, one for each source, None where there is none."""
    wanted = list(expanded(sources))
    found = list(SIGNED.finditer(text[begin:end])) or list(WORD.finditer(text[begin:end]))
    found = found[-len(wanted):]
    spans = [(begin + one.start(), begin + one.end(), one[0]) for one in found]
    spans += [(end, end, None)] * (len(wanted) - len(spans))
    return [Sourced(*span, source) for span, source in zip(spans, wanted)]


def places(piece, text):
    """Where a piece stands, whatever the blanks and line ends in it."""
    pattern = r"\s+".join(re.escape(word) for word in piece.split())
    return list(re.finditer(pattern, text))


def of_file(text, listed):
    """Sourced numbers by a file of pieces, the spans of all pieces, and what is wrong with them."""
    found, spans, problems = [], [], []
    for line in listed.splitlines():
        comment = COMMENT.search(line)
        piece = COMMENT.sub("", line).strip()
        if not piece or piece == REST or piece.startswith("#"):
            continue
        stands = places(piece, text)
        if not stands or comment and len(stands) > 1:
            problems.append(f"stands {len(stands)} times in the page: {piece}")
            continue
        spans += [one.span() for one in stands]
        if comment:
            found += numbers_before(text, *stands[0].span(), comment[1])
    return found, spans, problems


def sourced(page):
    """All numbers of a page that have a source, and what is wrong without looking at a run."""
    text = page.read_text(encoding="utf-8")
    said = NOT_TEXT.sub(lambda part: re.sub(r"[^\n]", " ", part[0]), text)
    shown = re.sub(r"^```.*?^```|`[^`\n]*`", "", text, flags=re.DOTALL | re.MULTILINE)
    problems = [f"a source in the text: {one[0]}" for one in COMMENT.finditer(shown)]
    listed = page.with_suffix(".numbers")
    if not listed.exists():
        return [], problems
    pieces = listed.read_text(encoding="utf-8")
    found, spans, wrong = of_file(text, pieces)
    problems += wrong
    if REST not in pieces.splitlines():
        covered = spans + [(one.start, one.end) for one in found]
        for one in STANDING.finditer(said):
            if not any(start <= one.start() and one.end() <= end for start, end in covered):
                line = text[text.rfind("\n", 0, one.start()) + 1:].split("\n")[0]
                at = one.start() - text.rfind("\n", 0, one.start()) - 1
                problems.append(f"{one[0]} is not in {listed.name}: "
                                f"..{line[max(0, at - 40):at + 40]}..")
    return found, problems


def as_printed(value, printed):
    """A value with the digits of a printed number."""
    if printed.lower() in WORDS:
        word = next((word for word, n in WORDS.items() if n == value), f"{value:g}")
        return word.capitalize() if printed[0].isupper() else word
    exponent = Decimal(printed.replace(",", "")).as_tuple().exponent
    if "e" in printed:
        return f"{value:.{max(0, len(printed.split('e')[0].lstrip('-').replace('.', '')) - 1)}e}"
    return f"{value:{',' if ',' in printed else ''}.{max(0, -exponent)}f}"


def agrees(value, most, printed):
    if printed.lower() in WORDS:
        return value == WORDS[printed.lower()]
    plain = printed.replace(",", "")
    unit = 10.0 ** Decimal(plain).as_tuple().exponent
    return value <= float(plain) if most else abs(value - float(plain)) <= 0.501 * unit


def out_folder(out, page):
    """Where the examples of a page are: OUT/FOLDER, or OUT for a page of all (FOLDER/EXAMPLE)."""
    folder = out and out / page.resolve().parent.name
    return folder if folder and folder.is_dir() else out


def check(out, page, write=False):
    """How many numbers of a page are right and wrong; says what is wrong. Without `out` only those
    of other pages."""
    found, problems = sourced(page)
    if not out:
        found = [one for one in found if ".md#" in one.source]
    text, changes, right = page.read_text(encoding="utf-8"), [], 0
    for one in found:
        try:
            value, most = value_of(one.source, out_folder(out, page))
        except ValueError as error:
            problems.append(f"{one.source}: {error}")
            continue
        if one.printed is None:
            problems.append(f"{one.source}: there is no number before it")
        elif agrees(value, most, one.printed):
            right += 1
        elif write and not most:
            changes.append((one.start, one.end, as_printed(value, one.printed)))
        else:
            problems.append(f"says {one.printed}, the run {value:.7g}: {one.source}")
    for problem in problems:
        print(f"{page}: {problem}")
    if changes:
        rewrite(page, text, changes)
    return right + len(changes), len(problems)


def rewrite(page, text, changes):
    """Puts numbers into the page, and into its file of pieces."""
    listed = page.with_suffix(".numbers")
    if listed.exists():
        lines = []
        for line in listed.read_text(encoding="utf-8").split("\n"):
            comment = COMMENT.search(line)
            piece = COMMENT.sub("", line).strip()
            stands = places(piece, text) if comment and piece else []
            if len(stands) == 1:
                start, end = stands[0].span()
                inside = [(a - start, b - start, new) for a, b, new in changes if start <= a and b <= end]
                line = " ".join(replaced(text[start:end], inside).split()) + " " + line[comment.start():]
            lines.append(line)
        listed.write_text("\n".join(lines), encoding="utf-8")
    page.write_text(replaced(text, changes), encoding="utf-8")
    print(f"{page}: {len(changes)} numbers written")


def replaced(text, changes):
    for start, end, new in sorted(changes, reverse=True):
        text = text[:start] + new + text[end:]
    return text


# ---- the check, checked ----

def self_test():
    passed = failed = 0

    def expect(name, page, listed, wrong, said="", write=None):
        nonlocal passed, failed
        with tempfile.TemporaryDirectory() as folder:
            out = Path(folder) / "out"
            (out / "one").mkdir(parents=True)
            (out / "one" / "summary.csv").write_text(
                "case,metric,paper,ours,relative_error\na,m,,0.0972,\nb,m,,0.4,\n", encoding="utf-8")
            file = Path(folder) / "page.md"
            file.write_text(page, encoding="utf-8")
            if listed is not None:
                file.with_suffix(".numbers").write_text(listed, encoding="utf-8")
            heard = []
            real, globals()["print"] = print, lambda *text: heard.append(" ".join(map(str, text)))
            try:
                _, found = check(out, file, write is not None)
            finally:
                globals()["print"] = real
            read.cache_clear()
            good = found == wrong and (not said or said in "\n".join(heard))
            if write is not None:
                good = good and file.read_text(encoding="utf-8") == write and check(out, file)[1] == 0
        passed, failed = passed + good, failed + (not good)
        if not good:
            print(f"self-test, {name}: {found} problems, not {wrong}: {heard}")

    a, b = "one: a -> m", "one: b -> m"

    def one(name, text, source, wrong, said=""):
        expect(name, text, f"{text} <!--= {source} -->", wrong, said)

    one("two right numbers", "0.097 and 0.4", f"{a}; {b}", 0)
    one("a wrong number", "0.098", a, 1, "says 0.098")
    one("a wrong last digit", "0.0971", a, 1)
    one("a missing run", "0.1", "two: a -> m", 1, "there is no")
    one("a missing row", "0.1", "one: c -> m", 1, "names no row")
    one("no number before it", "text", a, 1, "no number before")
    one("exceeded", "0.09", f"<= {a}", 1)
    one("not exceeded", "0.1", f"<= {a}", 0)
    one("a factor", "97.2", f"{a} * 1000", 0)
    one("a sum", "0.4972, 0.0972", "sum one: * -> m; min one: * -> m", 0)
    one("a quotient", "4.12", f"{b} over {a}", 0)
    one("a wrong quotient", "4.11", f"{b} over {a}", 1)
    expect("a source in the text", f"0.097 <!--= {a} -->", "...", 1, "a source in the text")
    expect("a source in the text of a page without a file", f"0.097 <!--= {a} -->", None, 1, "a source in")
    expect("other numbers", "It is 0.097, or 5.", f"...\nIt is 0.097 <!--= {a} -->", 0)
    expect("a wrong one beside others", "It is 0.098, or 5.", f"...\nIt is 0.098 <!--= {a} -->", 1, "says")
    expect("a file", "It is 0.097, set by 3.", f"It is 0.097 <!--= {a} -->\nset by 3\n", 0)
    expect("a file over line ends", "It\nis 0.097.", f"It is 0.097 <!--= {a} -->", 0)
    expect("a wrong number in both", "It is 0.098.", f"It is 0.098 <!--= {a} -->", 1, "says 0.098")
    expect("a number of no file", "It is 0.097, or 5.", f"It is 0.097 <!--= {a} -->", 1, "5 is not in")
    expect("a stale piece", "It is gone.", f"It is 0.097 <!--= {a} -->", 1, "stands 0 times")
    expect("a stale setting", "It is gone.", "set by 3", 1, "stands 0 times")
    expect("a piece that stands twice", "is 0.4, is 0.4", f"is 0.4 <!--= {b} -->", 3, "stands 2 times")
    expect("a changed page", "It is 0.099.", f"It is 0.097 <!--= {a} -->", 2)
    expect("code, names and links", "`x = 5` M4F C++20 [a](b5.md)\n```\n7\n```\n1. first", "", 0)
    one("the 4 of M4F is a name", "0.4 on an M4F", b, 0)
    expect("a comment as code", "`0.4 <!--= none: a -> m -->`", "", 0)
    expect("a thousand", "1,000 runs", "", 1, "1,000 is not in")
    one("lines of a file", f"{len(Path(__file__).read_text().splitlines())}",
        "lines examples/common/check_readme.py", 0)
    one("a word", "one file", "files examples/common/check_readme.py", 0)
    one("a wrong word", "two files", "files examples/common/check_readme.py", 1)
    one("no file", "1", "files examples/common/none", 1, "names no file")
    one("a table of a page", "33", "README.md#nothing such: a -> b", 1, "no line of")
    expect("written", "It is 0.098, 3.0", f"It is 0.098 <!--= {a} -->\n0.098, 3.0 <!--= {b} -->", 0, "",
           "It is 0.097, 0.4")
    print(f"{passed} passed, {failed} failed")
    return failed == 0


def main():
    if sys.argv[1:] == ["--self-test"]:
        sys.exit(0 if self_test() else 1)
    arguments = [argument for argument in sys.argv[1:] if argument not in ("--write", "--pages")]
    out = None if "--pages" in sys.argv or not arguments else Path(arguments.pop(0))
    if not arguments:
        sys.exit("\n".join(__doc__.splitlines()[:2]))
    passed = failed = 0
    for page in map(Path, arguments):
        right, wrong = check(out, page, "--write" in sys.argv)
        passed, failed = passed + right, failed + wrong
    print(f"{passed} passed, {failed} failed")
    sys.exit(0 if passed and not failed else 1)


if __name__ == "__main__":
    main()
