#!/usr/bin/env python3
"""Whether a page can be read once: check_prose.py PAGE[=WORDS]... [--links PAGE...]

No sentence of its text has more than 35 words, no paragraph more than 90; with =WORDS the whole page has
at most so many, as `wc -w` counts. Code, links and comments are no text; a cell of a table and an item of a list end a
sentence, and so do two spaces, which part the columns of a table in a comment. Of the pages behind
--links only the links are looked at: files and headings exist. `--self-test` instead sees each refused.
The last line is "N passed, N failed".

check_prose.py --glossary PAGE FILE...: no file says a word that the table "| not | but |" of PAGE has in
its first column, and no sentence of a source is too long. Of a source only comments and strings count.
"""

import re
import sys
import tempfile
from pathlib import Path

MOST, MOST_OF_PARAGRAPH = 35, 90
CODE = re.compile(r"^```.*?^```|^    .*?$|<!--.*?-->", re.DOTALL | re.MULTILINE)
HEADING = re.compile(r"^#+ .*$", re.MULTILINE)
END = re.compile(r"(?<![ .(][A-Z])(?<!^[A-Z])(?<!e\.g)(?<!i\.e)(?<!et al)[.!?](?=\s|$)|\n\s*\n|\n\s*(?:[-*]|\d+\.) |\||\n(?=\|)|(?<=\S) {2,}(?=\S)")


PARAGRAPH = re.compile(r"\n\s*\n|\n\s*(?=(?:[-*]|\d+\.) |\|)")


def parts(end, page):
    text = HEADING.sub(lambda one: f"\n\n{one[0]}\n\n", CODE.sub("\n\n", page))
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return [" ".join(part.split()) for part in end.split(text) if part.strip()]


def long_parts(end, page, most, what):
    return [f"{what} of {len(one.split())} words: {one}" for one in parts(end, page) if len(one.split()) > most]


def problems(page, most_words=None):
    found = long_parts(END, page, MOST, "sentence")
    found += [one for one in long_parts(PARAGRAPH, page, MOST_OF_PARAGRAPH, "paragraph") if not one.split(": ", 1)[1].startswith("|")]
    if most_words and len(page.split()) > most_words:
        found.append(f"{len(page.split())} words, more than {most_words}")
    return found


def glossary(page):
    """The words that its table has in the column "not", as one pattern."""
    table = re.search(r"^\| not \| but \|\n\|[-:| ]+\|\n((?:\|.*\n)+)", page, re.MULTILINE)
    words = [word.strip() for row in table[1].splitlines() for word in row.split("|")[1].split(",")]
    return re.compile(r"\b(?:" + "|".join(map(re.escape, words)) + r")\b(?!-up)", re.IGNORECASE), table[0]


def spoken(name, text):
    """What a reader reads of a file: a page without its code, of a source comments and strings."""
    if name.endswith(".md"):
        return re.sub(r"`[^`\n]*`", "", CODE.sub("", text))
    parts = []
    strings = r"|`[^`]*`|'(?:[^'\\\n]|\\.)*'" if name.endswith(".js") else ""
    for run in re.findall(r'(?:[ \t]*//[^\n]*\n)+|//[^\n]*\n(?:[ \t]*//[^\n]*\n)*|/\*.*?\*/|"(?:[^"\\\n]|\\.)*"' + strings, text, re.DOTALL):
        comment = re.sub(r"^[ \t]*(?://+<?|/\*+|\*/?) ?", "", run, flags=re.MULTILINE)
        parts.append(CODE.sub("", re.sub(r"@\w+", "\n\n", comment)))
    return "\n\n".join(parts)


def words_of_makers(page, names):
    pattern, table = glossary(Path(page).read_text(encoding="utf-8"))
    failed = 0
    for name in names:
        text = spoken(name, Path(name).read_text(encoding="utf-8").replace(table, ""))
        found = [f"says {word}: {page} has another word" for word in sorted(set(map(str.lower, pattern.findall(text))))]
        found += problems(text) if name.endswith(".md") else long_parts(END, text, MOST, "sentence")
        for problem in found:
            print(f"{name}: {problem}")
        failed += bool(found)
    print(f"{len(names) - failed} passed, {failed} failed")
    return not failed


def anchors(text):
    """What a #link may name: the headings as GitHub writes them."""
    heads = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.MULTILINE)
    heads = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", head).strip().lower() for head in heads]
    return {re.sub(r"[^\w\- ]", "", head).replace(" ", "-") for head in heads}


def broken_links(file):
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", file.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    found = []
    for link in re.findall(r"\]\(([^)\s]+)\)", text):
        name, _, anchor = link.partition("#")
        to = file.parent / name if name else file
        if re.match(r"https?:|mailto:", link):
            continue
        if not to.exists():
            found.append(f"leads nowhere: {link}")
        elif anchor and to.suffix == ".md" and anchor not in anchors(to.read_text(encoding="utf-8")):
            found.append(f"leads to no heading: {link}")
    return found


def self_test():
    long = "word " * 35
    cases = [(f"{long}end.", None, 1), (f"{long}.", None, 0), (f"{long}\n- {long}\n", None, 0),
             (f"| {long}| {long}|", None, 0), (f"```\n{long}{long}\n```\n", None, 0),
             (f"{long} {long}", None, 0), (f"T {long}", None, 1),
             (f"{long}\nmore.", None, 1), ("a b c", 2, 1), ("a b c", 3, 0),
             (f"[{long}x](y) z", None, 1), (f"{long[:-5]}0.5 x.", None, 1),
             (f"{long[5:]}x. {long[5:]}x. {long[70:]}x.", None, 1), (f"{long[5:]}x. {long[5:]}x.\n- {long[5:]}x.", None, 0),
             (f"| {long[5:]}| {long[5:]}| {long[5:]}|", None, 0)]
    wrong = [case for case in cases if len(problems(case[0], case[1])) != case[2]]
    for case in wrong:
        print(f"self-test: {case}: {problems(case[0], case[1])}")
    pattern, _ = glossary("x\n| not | but |\n|---|---|\n| told, come back | given |\n| rival | baseline |\n\ny")
    for name, text, count in (("a.md", "told `told` Rival\n```\ntold\n```\nretold rival-up come back", 3),
                              ("a.hpp", 'told(); // told\n/* a rival\n told */ f("come back")', 4),
                              ("a.js", "told; f('told', `a ${x} rival`)", 2)):
        cases.append(name)
        if len(pattern.findall(spoken(name, text))) != count:
            wrong.append(name)
            print(f"self-test: {name}: {pattern.findall(spoken(name, text))}")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.md"
        for link, broken in (("page.md", 0), ("#a-head-of-it", 0), ("page.md#a-head-of-it", 0), ("#none", 1),
                             ("none.md", 1), ("page.md#none", 1), ("https://example.org/none", 0)):
            page.write_text(f"# A `head`, of it\n[x]({link})\n", encoding="utf-8")
            cases.append(link)
            if len(broken_links(page)) != broken:
                wrong.append(link)
                print(f"self-test: {link}: {broken_links(page)}")
    print(f"{len(cases) - len(wrong)} passed, {len(wrong)} failed")
    return not wrong


def main():
    if sys.argv[1:] == ["--self-test"]:
        sys.exit(0 if self_test() else 1)
    if len(sys.argv) < 2:
        sys.exit(__doc__.splitlines()[0])
    if sys.argv[1] == "--glossary":
        sys.exit(0 if words_of_makers(sys.argv[2], sys.argv[3:]) else 1)
    failed = looked = 0
    links_alone = False
    for argument in sys.argv[1:]:
        if argument == "--links":
            links_alone = True
            continue
        name, _, words = argument.partition("=")
        found = broken_links(Path(name))
        if not links_alone:
            found += problems(Path(name).read_text(encoding="utf-8"), int(words) if words else None)
        looked += 1
        for problem in found:
            print(f"{name}: {problem}")
        failed += bool(found)
    print(f"{looked - failed} passed, {failed} failed")
    sys.exit(0 if not failed else 1)


if __name__ == "__main__":
    main()
