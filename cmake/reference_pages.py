#!/usr/bin/env python3
"""What the reference adds to the pages of classes (cmake/reference.sh).

reference_pages.py examples FILE: what Doxygen reads, an example for each class that a pair of marks
`//! [Name]` of FILE names. reference_pages.py settings HTML: writes the members of the settings of a class
onto its page, and fails for a class of a controller that is made from settings and has no example.
"""

import re
import sys
import textwrap
from pathlib import Path

# Parts of other classes, which nobody makes by hand.
PARTS = {"ConstantGain", "ModelGain", "ScheduledGain", "ControlLoop", "NamedAdapter", "NamedObserver", "AugmentedModel"}
TABLE = re.compile(r'<table class="memberdecls">.*?</table>', re.DOTALL)
ROW = re.compile(r'<tr class="(?:memitem|memdesc):(\w+)">.*?</tr>', re.DOTALL)


def examples(file):
    found = re.findall(r"^ *//! \[(\w+)\]\n(.*?)^ *//! \[\1\]$", file.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    for name, code in found:
        code = textwrap.dedent(code)
        used = [f"// {word}: the settings in the example of {of}\n" for word, of in (("eso", "LinearEso"), ("adrc", "Adrc"))
                if re.search(rf"(?:= |\(){word}\b", code)]
        print(f"/** @class esokit::{name}\n@par Example\n@code{{.cpp}}\n{''.join(used)}{code}@endcode\n*/")


def settings_of(page, text, folder):
    """The page of the settings that the class is made from, if it has some."""
    own = folder / page.name.replace("class", "struct", 1).replace(".html", "_1_1Config.html")
    if own.exists():
        return own
    named = re.search(r'<b>Config</b> = <a class="el" href="(struct\w+\.html)"|make</a> \(const <a class="el" href="(struct\w+Config\.html)"',
                      text)
    return folder / (named[1] or named[2]) if named else None


def members(page):
    """The rows of a struct's members, without anchors."""
    for table in TABLE.findall(page.read_text(encoding="utf-8")):
        if "Public Attributes" in table:
            rows = [row for row in ROW.finditer(table)]
            hidden = {row[1] for row in rows if "<b>by_name</b>" in row[0]}
            return "\n".join(re.sub(r'<a id="[^"]*" name="[^"]*"></a>', "", row[0]) for row in rows if row[1] not in hidden)
    return ""


def settings(folder):
    lacking, shown = [], 0
    for page in sorted(folder.glob("classesokit_1_1*.html")):
        name = page.stem.removeprefix("classesokit_1_1")
        if page.stem.endswith("-members") or "_" in name:
            continue
        text = page.read_text(encoding="utf-8")
        config = settings_of(page, text, folder)
        rows = members(config) if config and config.exists() else ""
        if not rows:
            continue
        heading = f'<tr class="heading"><td colspan="2"><h2 class="groupheader">Settings: <a href="{config.name}">Config</a></h2></td></tr>'
        page.write_text(text.replace('<table class="memberdecls">',
                                     f'<table class="memberdecls">\n{heading}\n{rows}\n</table><table class="memberdecls">', 1),
                        encoding="utf-8")
        shown += 1
        if "Example</dt>" not in text and name not in PARTS and not name.startswith(("Continuous", "NamedContinuous")):
            lacking.append(name)
    for name in lacking:
        print(f"{name} has no example in cmake/reference_examples.cpp", file=sys.stderr)
    if not shown:
        print("no page shows settings", file=sys.stderr)
    return not lacking and shown > 0


if __name__ == "__main__":
    if sys.argv[1] == "examples":
        examples(Path(sys.argv[2]))
    elif not settings(Path(sys.argv[2])):
        sys.exit(1)
