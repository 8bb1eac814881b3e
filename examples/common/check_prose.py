#!/usr/bin/env python3
"""Whether a page reads well enough to be read once: check_prose.py PAGE[=WORDS]...

No sentence of its text has more than 35 words; with =WORDS the whole page has at most so many, as
`wc -w` counts. Code, links and comments are no text; a cell of a table and an item of a list end a
sentence. `--self-test` instead sees both refused. The last line is "N passed, N failed".
"""

import re
import sys
from pathlib import Path

MOST = 35
CODE = re.compile(r"^```.*?^```|^    .*?$|<!--.*?-->", re.DOTALL | re.MULTILINE)
END = re.compile(r"(?<![ .]\w)(?<!e\.g)(?<!et al)[.!?](?=\s|$)|\n\s*\n|\n\s*(?:[-*]|\d+\.) |\n#+ |\||\n(?=\|)")


def sentences(page):
    text = CODE.sub("\n\n", page)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return [" ".join(part.split()) for part in END.split(text) if part.strip()]


def problems(page, most_words=None):
    found = [f"{len(one.split())} words: {one}" for one in sentences(page) if len(one.split()) > MOST]
    if most_words and len(page.split()) > most_words:
        found.append(f"{len(page.split())} words, more than {most_words}")
    return found


def self_test():
    long = "word " * 35
    cases = [(f"{long}end.", None, 1), (f"{long}.", None, 0), (f"{long}\n- {long}\n", None, 0),
             (f"| {long}| {long}|", None, 0), (f"```\n{long}{long}\n```\n", None, 0),
             (f"{long}\nmore.", None, 1), ("a b c", 2, 1), ("a b c", 3, 0),
             (f"[{long}x](y) z", None, 1), (f"{long[:-5]}0.5 x.", None, 1)]
    wrong = [case for case in cases if len(problems(case[0], case[1])) != case[2]]
    for case in wrong:
        print(f"self-test: {case}: {problems(case[0], case[1])}")
    print(f"{len(cases) - len(wrong)} passed, {len(wrong)} failed")
    return not wrong


def main():
    if sys.argv[1:] == ["--self-test"]:
        sys.exit(0 if self_test() else 1)
    if len(sys.argv) < 2:
        sys.exit(__doc__.splitlines()[0])
    failed = 0
    for argument in sys.argv[1:]:
        name, _, words = argument.partition("=")
        found = problems(Path(name).read_text(encoding="utf-8"), int(words) if words else None)
        for problem in found:
            print(f"{name}: {problem}")
        failed += bool(found)
    print(f"{len(sys.argv) - 1 - failed} passed, {failed} failed")
    sys.exit(0 if not failed else 1)


if __name__ == "__main__":
    main()
