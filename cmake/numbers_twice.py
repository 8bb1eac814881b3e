#!/usr/bin/env python3
"""Lists what two pages say of one thing with different numbers: cmake/numbers_twice.py [PAGE...]

The pages are all Markdown files but the changelog, and the comments of the headers. Two sentences (or
cells of tables, with their row, heading and section) are about one thing, if they give numbers of one
unit and
  - name the same type, function or file, for units that count something (instructions, bytes, lines); or
  - share many of their rare words.
If both name a processor or a compiler it must be the same.
They differ if no number of that unit is in both, in the digits that both have. What differs for a
reason is a line `PIECE <> PIECE` of numbers_twice.txt beside this file, with a piece of each of the
two; a line that excuses nothing is a failure. `--self-test` sees contradictions of earlier pages found.
The last line is "N passed, N failed": pairs that agree or are excused, and pairs that differ.
"""

import math
import re
import sys
from collections import Counter, defaultdict, namedtuple
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
EXCUSED = Path(__file__).with_suffix(".txt")
LEAST_SHARE, LEAST_WEIGHT = 0.4, 14  # of the rare words of two sentences; of those that count
COUNT_SHARE, COUNT_WEIGHT = 0.25, 9
WORDS = {word: n for n, word in enumerate(
    "zero one two three four five six seven eight nine ten eleven twelve".split()) if n > 1}
NUMBER = r"(?:\d[\d,]*(?:\.\d+)?|\b(?:" + "|".join(WORDS) + r")\b)"
# A number or several ("2 to 3.5", "39, 40"), what is counted, and what it stands for.
COUNTED = re.compile(rf"(?<![\w.+#<,/=^-])({NUMBER}(?:(?: to | and | or |, ?){NUMBER})*)[ -]?"
                     r"(?:of the |of |more |different |complete )?(%|[A-Za-z]+)?"
                     rf"(?:[^.;|]*? instead of ({NUMBER}))?", re.IGNORECASE)
# What is counted, of which a thing named has one number.
COUNTS = set("instruction byte kb mb line program file row column cell page header test check cycle times "
             "code state stack core target compiler paper example observer machine case word microsecond".split())
STOP = set("to or and of a an the per at in is are from with for by than as less about up on be it that "
           "this was were between most so its his has have not no can which what".split())
PLACES = re.compile(r"Cortex-M\d\w*\+?|M0\+|M4F|M7|RISC-V|RV32\w*|ATmega\w*|AVR|GCC \d+|Clang \d+|integers|fixed")
NAMES = re.compile(r"\b(?:[A-Z][a-z]+(?:[A-Z][a-z]+)+(?:<\d)?|[a-z0-9]+(?:_[a-z0-9]+)+\b|\w+\.(?:hpp|cpp|sh|py)\b)")
Said = namedtuple("Said", "page text words names places values")


def text_of(file):
    """What a reader reads: a page without code and sources, or the comments of a header."""
    text = file.read_text(encoding="utf-8")
    if file.suffix != ".md":
        lines = [line.strip() for line in text.split("\n")]
        text = "\n".join(line.lstrip("/!< ") if line.startswith("//") else "" for line in lines)
        text = re.sub(r"(?<=\S)\n(?=\S)", " ", text)
    text = re.sub(r"^```.*?^```|<!--.*?-->|^    [^\n]*", "", text, flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)


def stem(word):
    word = word.lower()
    return word[:-1] if word.endswith("s") and len(word) > 3 and word != "times" else word


def values_of(text, heading=""):
    """{unit: numbers} of a sentence or of a cell."""
    found = defaultdict(set)
    for one in COUNTED.finditer(text):
        if re.search(r"(?:Figs?|Tables?|Sections?|Eqs?|GCC|Clang|Debian|C\+\+)\.? $", text[:one.start()]):
            continue
        unit = one[2] and stem(one[2])
        units = [unit] if unit and unit not in STOP else \
            [stem(word) for word in re.findall(r"[A-Za-z]+", heading)]
        if re.search(r"at (?:most|least) $|(?:up to|least) $", text[:one.start()]):
            continue  # a limit says no number
        spans = re.findall(rf"({NUMBER})(?: to ({NUMBER}))?", f"{one[1]} {one[3] or ''}", re.IGNORECASE)
        for unit in units:
            found[unit] |= {tuple(plain(end) for end in span if end) for span in spans}
    return found


def plain(written):
    """A number without words and marks of thousands, as text."""
    written = written.rstrip(",").replace(",", "").lower()
    return str(WORDS.get(written, written))


def same_name(some, others):
    """Whether both name one type, function or file: True, False, or None if they name no like ones.
    A type with another first number is another one."""
    like = [(a, b) for a in some for b in others if a.split("<")[0] == b.split("<")[0]]
    return any(a == b or ("<" in a) != ("<" in b) for a, b in like) if like else None


def said_in(file, root=ROOT):
    page, section, before, table = str(file.relative_to(root)), "", "", []
    for line in text_of(file).split("\n"):
        if line.startswith("|"):
            table.append([cell.strip() for cell in line.strip().strip("|").split("|")])
            if len(table) > 2:
                for heading, cell in list(zip(table[0], table[-1]))[1:]:
                    text = f"{section} {before} | {table[-1][0]} | {heading} | {cell}"
                    yield said(page, text, values_of(cell, heading), f"{table[-1][0]} {cell}")
            continue
        table = []
        if line.startswith("#"):
            section, before = line.strip("# "), ""
        elif line.strip():
            before = re.split(r"(?<=[.!?;]) ", line.strip())[-1]
        for sentence in re.split(r"(?<=[.!?;]) ", line):
            yield said(page, sentence, values_of(sentence), sentence)


def said(page, text, values, named):
    words = {stem(word) for word in re.findall(r"[A-Za-z_]\w+", text)} - STOP
    places = {re.sub(r"^Cortex-|AFC$|IMAC?$", "", place) for place in PLACES.findall(text)}
    return Said(page, " ".join(text.split()), words, set(NAMES.findall(named)), places, values)


def agree(some, others):
    """Whether a number is in both, in the digits that both have; in a range, if one has a range."""
    def near(a, b):
        if len(a) + len(b) == 3:
            (low, high), (value,) = (a, b) if len(a) == 2 else (b, a)
            return float(low) <= float(value) <= float(high)
        digits = min(len(x.partition(".")[2]) for x in a + b)
        return all(abs(float(x) - float(y)) <= 0.501 * 10 ** -digits for x, y in zip(a, b))
    return any(near(a, b) for a in some for b in others)


def differences(all_said):
    """Pairs about one thing; yields (agrees, unit, one, other)."""
    all_said = [one for one in all_said if one.values]
    seen = Counter(word for one in all_said for word in one.words)
    rare = {word: math.log(len(all_said) / count) for word, count in seen.items()}
    weight = [sum(rare[word] for word in one.words) for one in all_said]
    by_unit = defaultdict(list)
    for i, one in enumerate(all_said):
        for unit in one.values:
            by_unit[unit].append(i)
    for unit, those in sorted(by_unit.items()):
        for k, i in enumerate(those):
            one = all_said[i]
            for j in those[k + 1:]:
                other = all_said[j]
                if one.page == other.page or one.places and other.places and not one.places & other.places:
                    continue
                same = same_name(one.names, other.names)
                if same is False:
                    continue
                if not (unit in COUNTS and same):
                    counts = unit in COUNTS and one.page.endswith(".md") and other.page.endswith(".md")
                    shared = sum(rare[word] for word in one.words & other.words)
                    if shared < (COUNT_WEIGHT if counts else LEAST_WEIGHT) or \
                            shared < (COUNT_SHARE if counts else LEAST_SHARE) * max(weight[i], weight[j]):
                        continue
                yield agree(one.values[unit], other.values[unit]), unit, one, other


def shown(values):
    return ", ".join(sorted(" to ".join(value) for value in values))


def judged(all_said, excuses):
    """Numbers of pairs that are good and bad; says which are bad."""
    good, bad, used = 0, [], set()
    agreed = set()
    pairs = list(differences(all_said))
    # A page that says a number as another page does, too, may say more of the same.
    for fine, unit, one, other in pairs:
        if fine:
            agreed |= {(unit, one, other.page)[:1] + (one.text, other.page), (unit, other.text, one.page)}
    for fine, unit, one, other in pairs:
        if fine or (unit, one.text, other.page) in agreed or (unit, other.text, one.page) in agreed:
            good += 1
            continue
        excuse = next((e for e in excuses if e[0] in one.text and e[1] in other.text or
                       e[1] in one.text and e[0] in other.text), None)
        if excuse:
            used.add(excuse)
            good += 1
        else:
            bad.append(f"{unit}: {shown(one.values[unit])} and {shown(other.values[unit])}\n"
                       f"    {one.page}: {one.text[:300]}\n    {other.page}: {other.text[:300]}")
    bad += [f"excuses nothing: {' <> '.join(e)}" for e in excuses if e not in used]
    return good, bad


def excuses_of(text):
    return [tuple(part.strip() for part in line.split("<>")) for line in text.splitlines()
            if "<>" in line and not line.startswith("#")]


def self_test():
    import tempfile
    cases = [  # (one page, another, excuses, how many bad)
        ("Four programs of less than 50 lines to copy are in examples/start: an observer on a signal.",
         "Start with one of these five programs of less than 50 lines; copy the nearest: an observer on a signal.", "", 1),
        ("On a Cortex-M4F:\n\n| | instructions per update |\n|---|---|\n| `LinearEso<2>` | 39 |",
         "**Cortex-M4F**\n\n| float | instructions |\n|---|---|\n| LinearEso<2> | 33 |", "", 1),
        ("On a Cortex-M7:\n\n| | instructions per update |\n|---|---|\n| `LinearEso<2>` | 39 |",
         "**Cortex-M4F**\n\n| float | instructions |\n|---|---|\n| LinearEso<2> | 33 |", "", 0),
        ("`drive.cpp` takes 16.1 KB of flash.", "The image of `drive.cpp` is 16.2 KB.", "", 1),
        ("`drive.cpp` takes 16.2 KB of flash.", "The image of `drive.cpp` is 16 KB.", "", 0),
        ("`ExtendedStateFilter` costs 4 to 7 times as much.", "`ExtendedStateFilter` costs 7.3 times as much.", "", 1),
        ("`drive.cpp` takes 16.1 KB.", "The `drive.cpp` of 8 KB.", "takes 16.1 <> of 8", 0),
        ("`drive.cpp` takes 16.1 KB.", "The `drive.cpp` of 16.1 KB.", "takes 16.1 <> of 8", 1),
        ("`joint.hpp` has under 100 lines.", "`joint.hpp` has 118 lines.", "", 1),
        ("`LinearEso<3>` takes 93 instructions.", "`LinearEso<2>` takes 33 instructions.", "", 0),
        ("`LinearEso` takes 93 instructions.", "`LinearEso<2>` takes 33 instructions.", "", 1),
        ("`to_fixed_c`: 64 instructions instead of 1556.", "`to_fixed_c` saves 1557 instructions.", "", 1),
        ("`to_fixed_c`: 64 instructions instead of 1556.", "`to_fixed_c` saves 1556 instructions.", "", 0),
        ("`to_fixed_c`: at most 64 instructions.", "`to_fixed_c`: 60 instructions.", "", 0),
    ]
    wrong = 0
    for one, other, excuses, expected in cases:
        with tempfile.TemporaryDirectory() as folder:
            pages = [Path(folder) / "one.md", Path(folder) / "other.md"]
            for page, text in zip(pages, (one, other)):
                # Other sentences, among which words are rare.
                page.write_text(text + "\n\n" + "".join(f"w{n} has {n} stones.\n\n" for n in range(99)),
                                encoding="utf-8")
            _, bad = judged([s for page in pages for s in said_in(page, Path(folder))], excuses_of(excuses))
        bad = [line for line in bad if not line.startswith("stone:")]
        if len(bad) != expected:
            wrong += 1
            print(f"self-test: {one} / {other}: {bad}")
    print(f"{len(cases) - wrong} passed, {wrong} failed")
    return not wrong


def main():
    if sys.argv[1:] == ["--self-test"]:
        sys.exit(0 if self_test() else 1)
    files = [Path(name).resolve() for name in sys.argv[1:]] or [
        file for pattern in ("*.md", "cmake/packaging/*.md", "benchmarks/*.md", "examples/**/*.md", "include/**/*.[hi]pp")
        for file in sorted(ROOT.glob(pattern)) if file.name != "CHANGELOG.md"]
    good, bad = judged([one for file in files for one in said_in(file)],
                       excuses_of(EXCUSED.read_text(encoding="utf-8")) if EXCUSED.exists() else [])
    for line in bad:
        print(line)
    print(f"{good} passed, {len(bad)} failed")
    sys.exit(0 if good and not bad else 1)


if __name__ == "__main__":
    main()
