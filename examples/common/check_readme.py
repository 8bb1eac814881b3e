#!/usr/bin/env python3
"""Checks the numbers of READMEs against what the examples wrote: check_readme.py OUT README...

A comment after numbers says where they come from, with one source for each of the last numbers of
the line before it:

    0.097, 0.093 <!--= sim2: Sim2A, p = 1 -> int e dt; sim2: Sim2A, p = 2 -> int e dt -->

A source is one of

    EXAMPLE: CASE -> METRIC         a row of the example's summary.csv
    EXAMPLE#NAME: ROW -> COLUMN     a cell of its table_NAME.csv; the column by its heading or its
                                    number, or `1..4` for four numbers

EXAMPLE is a folder below OUT/FOLDER, where FOLDER is that of the README (for the README of the
project, below OUT). In the other names * and ? match any text; write ? for a bar, because a row of
a Markdown table must not contain one. Several rows may match: then the largest number counts, with
`min` before the source the smallest. `error` before it takes the largest relative error in %
instead, `* FACTOR` after it multiplies. The number in the README must agree in its last printed
digit; with `<=` before the source it must only not be exceeded.
"""

import csv
import functools
import re
import sys
from decimal import Decimal
from fnmatch import fnmatchcase
from pathlib import Path

NUMBER = r"\d+(?:\.\d+)?(?:e-?\d+)?"
SOURCE = re.compile(
    r"(?P<most><=)?\s*(?:(?P<mode>max|min|error) )?(?P<example>[^:#]+)(?:#(?P<table>[^:]+))?:"
    rf"(?P<row>.*) -> (?P<column>.*?)(?: \* (?P<factor>-?{NUMBER}))?", re.DOTALL)


def number(text):
    """The number that a text begins with."""
    found = re.match(r"\s*-?\d+(\.\d*)?(e[+-]?\d+)?", text)
    return float(found[0]) if found else None


@functools.lru_cache(maxsize=None)
def read(file):
    with open(file, newline="", encoding="utf-8") as stream:
        return list(csv.reader(stream))


def value_of(source, folder):
    example, table, mode = source["example"].strip(), source["table"], source["mode"]
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
    return (min if mode == "min" else max)(values) * float(source["factor"] or 1)


def expanded(sources):
    """One source for each number: `-> 1..4` stands for four."""
    for source in (part.strip() for part in sources.split(";")):
        columns = re.fullmatch(r"(.*-> )(\d+)\.\.(\d+)", source, re.DOTALL)
        if columns:
            first, last = int(columns[2]), int(columns[3])
            yield from (columns[1] + str(c) for c in range(first, last + 1))
        else:
            yield source


def mistake(printed, text, folder):
    """What is wrong with a printed number, or None."""
    source = SOURCE.fullmatch(text)
    if not source:
        return f"{text}: is not EXAMPLE: CASE -> METRIC"
    if printed is None:
        return f"{text}: there is no number before it"
    try:
        value = value_of(source, folder)
    except ValueError as error:
        return f"{text}: {error}"
    unit = 10.0 ** Decimal(printed).as_tuple().exponent
    good = (value <= float(printed) if source["most"] else
            abs(value - float(printed)) <= 0.501 * unit)
    return None if good else f"says {printed}, the run {value:.7g}: {text}"


def main():
    if len(sys.argv) < 3:
        sys.exit(__doc__.splitlines()[0])
    passed, failed = 0, 0
    for readme in map(Path, sys.argv[2:]):
        folder = Path(sys.argv[1]) / readme.resolve().parent.name
        if not folder.is_dir():  # the README of the whole: FOLDER/EXAMPLE
            folder = Path(sys.argv[1])
        text = readme.read_text(encoding="utf-8")
        for part, sources in re.findall(r"(.*?)<!--=(.*?)-->", text, re.DOTALL):
            # The line before the comment, from the end of the comment before.
            line = part.rsplit("\n", 1)[-1]
            numbers = re.findall(rf"(?:(?<=^)-|(?<= )-)?{NUMBER}", line)
            wanted = list(expanded(sources))
            numbers = numbers[-len(wanted):]
            numbers += [None] * (len(wanted) - len(numbers))
            for printed, source in zip(numbers, wanted):
                problem = mistake(printed, source, folder)
                passed, failed = passed + (problem is None), failed + (problem is not None)
                if problem:
                    print(f"{readme}: {problem}")
    print(f"{passed} passed, {failed} failed")
    sys.exit(0 if passed and not failed else 1)


if __name__ == "__main__":
    main()
