#!/usr/bin/env python3
"""Proves written C with Frama-C's Eva: see prove.sh, which calls it.

    prove.py FOLDER [--few] [--write] [NAME ...]

FOLDER has kinds.tsv (name, title, least and largest u) and the C of each kind in a folder of its name.
From its header a driver is made: it calls every function for ever, in any order, each time with any
numbers, infinite ones and NaN too. Eva looks at all executions of it at once. What has to hold: no alarm
(undefined behaviour), u within its limits, each number of the state finite after every call. Of C in
integers integers.py proves the step of a valid sample, and Eva all else. Then C of it that was broken is
to be refused. The table of README.md is compared, but for the seconds, or written.
"""

import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import hints
import integers

PAGE = Path(__file__).resolve().parents[1] / "README.md"
BEGIN, END = "<!-- proofs: written by prove.sh -->\n", "<!-- end of proofs -->"
SECONDS = 300  # of the processor, for each proof

# Enough for a change of the C: the plain controller, one with all counts, an output, integers.
FEW = ("plain", "gated", "profile", "proportioned", "integers")
# Where Eva cannot follow the C as it is: hints.py.
HINTED = ("cascade", "lag", "predictive")
# What is done to a kind, and what may then hold no longer.
BROKEN = (
    ("plain", "a limit one higher", "7.0f < t1", "8.0f < t1", "u_within"),
    ("plain", "a clip left out", "(7.0f < t1) ? 7.0f : t1", "t1", "u_within"),
    ("plain", "a row too far", "row = elapsed - 1u", "row = elapsed", "alarms"),
    ("plain", "a check left out",
     "  if (!is_finite(u)) {\n    return PLAIN_INPUT_REJECTED;\n  }\n  if (o->", "  if (o->",
     "finite_u_last"),
    ("cascade", "a number left out of a check", "(fabsf(z1_level2_next)) + (fabsf(z1_next)))));\n  const bool t10",
     "(fabsf(z1_next)))));\n  const bool t10", "finite_z1_level2"),
    ("predictive", "a y that is not checked", "(is_finite((x2 * y))) ? t1 : x4", "t1", "u_within"),
)
# And to the step in integers, each of which may then be too large for its line or its state.
BROKEN_STEP = (
    ("twice the u in integers", r"(u \* )(\d+)(;)", lambda m: m[1] + str(2 * int(m[2])) + m[3]),
    ("a shift of one bit less", r"(t2 >> )(\d+)(; /\* 2\^-21)", lambda m: m[1] + str(int(m[2]) - 1) + m[3]),
    ("a range of 3 / 4", r"(predict_slowly[\s\S]*?most\[STATES\] = \{)(\d+)(,)",
     lambda m: m[1] + str(int(m[2]) * 3 // 4) + m[3]),
)

# What to_c writes and Eva does not prove, with the reason. All that it writes has a row.
NOT_PROVEN = {
    "`HealthMonitor`": f"stopped after {SECONDS} s of the processor without an answer",
    "in integers: settings in a struct": "the proof of the step needs gains that are constants",
}
WRITTEN = Path(__file__).resolve().parents[3] / "include/esokit/target/c_code.hpp"

ANY = {"float": "any_float", "double": "any_double", "unsigned": "any_unsigned", "uint8_t": "any_8",
       "uint16_t": "any_16", "uint32_t": "any_32", "int32_t": "any_signed", "bool": "any_bool"}
HEAD = """#include "{name}.h"
#include <stdbool.h>
volatile float any_float;
volatile double any_double;
volatile unsigned any_unsigned;
volatile uint8_t any_8;
volatile uint16_t any_16;
volatile uint32_t any_32;
volatile int32_t any_signed;
volatile bool any_bool;

int32_t any_within(int32_t low, int32_t high)
{{
  const int32_t x = any_signed;
  return (x < low) ? low : ((x > high) ? high : x);
}}

int main(void)
{{
"""


class Header:
    """What a driver needs of a header that to_c wrote."""

    def __init__(self, name, text, source=""):
        self.name = name
        # What keeps numbers that came, unseen: they are looked at where they are used.
        refer = re.search(r"^static bool refer\(.*?^}", source, re.S | re.M)
        self.unseen = {"given", "measurement", *re.findall(r"o->(\w+) =", refer[0] if refer else "")}
        text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
        text = re.sub(r"#ifdef \w+_SELF_TEST.*?#endif", "", text, flags=re.S)
        self.structs = {
            struct: re.findall(r"^ +(\w+) (\w+)(?:\[(\d+)u?\])?;", body, re.M)
            for body, struct in re.findall(r"typedef struct \{(.*?)\} (\w+);", text, re.S)}
        self.settings = re.findall(r"^extern const \w+ (\w+);", text, re.M)
        self.functions = re.findall(r"^(\w+) (\w+)\(([^)]*)\);", text, re.M)

    def has(self, part):
        return f"{self.name}_{part}" in self.structs

    def numbers(self, struct, path):
        """The floating-point numbers of an object, but for those that keep what came, unseen."""
        for kind, member, length in self.structs.get(struct, ()):
            for at in [f"[{i}]" for i in range(int(length))] if length else [""]:
                place = f"{path}.{member}{at}"
                if kind not in ("float", "double"):
                    yield from self.numbers(kind, place)
                elif member not in self.unseen:
                    yield place

    def call(self, result, function, arguments, limits):
        """The lines of one call with any numbers."""
        own, given, lines, checks = function[len(self.name) + 1:], [], [], []
        for argument in arguments.split(","):
            kind = argument.replace("const ", "").split()[0]
            length = re.search(r"\[(\d+)u?\]", argument)
            part = kind[len(self.name) + 1:]
            if part in ("state", "settings", "saved"):
                objects = {"state": "o", "settings": "".join(self.settings), "saved": "saved"}
                given.append("&" + objects[part])
            elif part == "sample":
                lines += [f"{kind} sample;"]
                lines += [f"sample.{member} = {ANY[its]};" for its, member, _ in self.structs[kind]]
                given.append("&sample")
            elif length:
                many = range(int(length.group(1)))
                lines.append(f"{kind} many[{len(many)}];")
                if "const" in argument:
                    lines += [f"many[{i}] = {ANY[kind]};" for i in many]
                given.append("many")
            else:
                given.append(ANY[kind])
        call = f"{function}({', '.join(given)});"
        # `hold` returns the u of what holds the plant, whatever that is.
        if result in ("float", "double", "int32_t") and own not in ("estimate", "hold"):
            low, high = limits[:2]
            lines.append(f"{result} u = {call}")
            if low != "-":
                checks = [f"/*@ assert u_within: {low} <= u <= {high}; */"]
        else:
            lines.append(call if result == "void" else "(void)" + call)
        return lines + checks

    def driver(self, limits, reach):
        text = HEAD.format(name=self.name)
        names = [function[len(self.name) + 1:] for _, function, _ in self.functions]
        first = next((one for one in ("init", "clear", "reset") if one in names), None)
        # Without such a function its header says that it begins with all zeros.
        text += f"  {'' if first else 'static '}{self.name}_state o;\n"
        text += "".join(f"  {self.name}_saved saved;\n" for _ in [0] if self.has("saved"))
        if first:
            alone = dict(zip(names, self.functions))[first][2].count(",") == 0
            text += f"  (void){self.name}_{first}(&o{'' if alone else ', 0'});\n"
        text += "".join(f"  {self.name}_save(&o, &saved);\n" for _ in [0] if self.has("saved"))
        text += "  for (;;) {\n    switch (any_unsigned) {\n"
        for i, function in enumerate(self.functions):
            label = f"case {i}" if i + 1 < len(self.functions) else "default"
            lines = [f"    {label}: {{"] + ["      " + one for one in self.call(*function, limits)]
            text += "\n".join(lines) + "\n      break;\n    }\n"
        text += "    }\n"
        for place in self.numbers(f"{self.name}_state", "o"):
            text += f"    /*@ assert finite_{re.split('[.[]', place)[1]}: \\is_finite({place}); */\n"
        for i, most in enumerate(reach):
            text += f"    /*@ assert finite_x{i}: {-most} <= o.x[{i}] <= {most}; */\n"
        return text + "  }\n}\n"


def limited():
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 5))  # a signal before the end


def used():
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def differs(at, name):
    """Whether what Eva is shown fails the self-test that was written with the C."""
    (at / "test.c").write_text(f'#include "{name}.h"\n'
                               f"int main(void) {{ return {name}_self_test(0) != 0; }}\n")
    run = ["gcc", "-std=c99", f"-D{name.upper()}_SELF_TEST", "-D__FRAMAC__", "test.c", "shown.c", "-lm",
           "-o", "test"]
    return subprocess.run(run, cwd=at, check=False).returncode or \
        subprocess.run("./test", cwd=at, check=False).returncode


def proven(at, name, limits, source=None):
    """{what: text of a cell} of one kind."""
    at.mkdir(exist_ok=True)
    header = (at / f"{name}.h").read_text()
    if source is not None:
        (at / f"{name}.c").write_text(source)
    started, own = used(), time.process_time()
    source = (at / f"{name}.c").read_text()
    failed, reach, text = set(), [], hints.for_eva(source) if name in HINTED else source
    if "static void observe(" in source:  # in integers
        found = integers.Proof(source)
        failed |= {f"finite_{line}" for line, *_ in found.beyond}
        reach, text = found.reach, found.for_eva()
    (at / "shown.c").write_text(text)
    if name in HINTED and differs(at, name):
        failed.add("hints")
    driver = Header(name, header, source).driver(limits, reach)
    (at / "driver.c").write_text(driver)
    command = ["frama-c", "-eva", "-eva-precision", "5", "-warn-special-float", "none",
               "-no-warn-right-shift-negative", "-eva-msg-key=-final-states,-initial-state",
               "driver.c", "shown.c"]
    run = subprocess.run(command, cwd=at, env={**os.environ, "PWD": str(at)}, text=True, check=False,
                         stdout=subprocess.PIPE, stderr=subprocess.STDOUT, preexec_fn=limited)
    (at / "log.txt").write_text(run.stdout)
    alarms = re.search(r"(\d+) alarms? generated", run.stdout)
    if run.returncode == -signal.SIGXCPU:
        return {"alarms": "not proven", "u": "", "states": "", "seconds": f"above {SECONDS}",
                "failed": {"time"}}
    if run.returncode != 0 or not alarms:
        sys.exit(run.stdout[-2000:])
    failed |= set(re.findall(r"assertion '(\w+)' got status", run.stdout))
    reached = re.search(r"Assertions +\d+ valid.* (\d+) total", run.stdout)
    if not reached or int(reached.group(1)) != driver.count("assert") + text.count("assert"):
        failed |= {"u_within", "finite_all"}  # as execution ends before some of them
    unseen = ", ".join(sorted(one[7:] for one in failed if one.startswith("finite_")))
    low, high = limits
    states = "within their ranges" if reach else "finite"
    return {"alarms": alarms.group(1),
            "u": "not proven" if "u_within" in failed else f"{low} .. {high}" if low != "-" else "",
            "states": f"not proven: {unseen}" if unseen else states,
            "seconds": f"{used() - started + time.process_time() - own:.0f}",
            "failed": failed | ({"alarms"} if alarms.group(1) != "0" else set())}


def of_class(name):
    """Whether a word is a class of the library."""
    is_it = re.compile(rf"\b(?:class|using) {name}\b")
    return any(is_it.search(header.read_text()) for header in WRITTEN.parents[1].glob("[oac]*/*.hpp"))


def without_row(rows):
    """The classes that the documentation of to_c names as written, and that no row names."""
    text = WRITTEN.read_text()
    text = text[text.index("/// Written are"):text.index("/// @param object")]
    parts = [part for part in text.split("///\n") if not part.startswith("/// Not ")]
    names = {name for part in parts for name in re.findall(r"\b[A-Z][A-Za-z]+\b", part) if of_class(name)}
    return sorted(name for name in names if not any(re.search(rf"\b{name}\b", row) for row in rows))


def rows_of(page):
    """{title: cells} of the table of the page."""
    table = page[page.index(BEGIN) + len(BEGIN):page.index(END)]
    rows = [[cell.strip() for cell in line.strip("| \n").split(" | ")] for line in table.splitlines()]
    return {row[0]: row for row in rows if len(row) == 5}


def write_table(rows):
    page = PAGE.read_text()
    table = [["kind", "alarms", "u", "states", "seconds"], ["---", "---:", "---", "---", "---:"]] + rows
    text = "".join("| " + " | ".join(row) + " |\n" for row in table)
    PAGE.write_text(page[:page.index(BEGIN) + len(BEGIN)] + "\n" + text + "\n" + page[page.index(END):])


def main():
    arguments = sys.argv[1:]
    few, write = "--few" in arguments, "--write" in arguments
    folder, *names = [one for one in arguments if not one.startswith("--")]
    folder = Path(folder).resolve()
    kinds = [line.split("\t") for line in (folder / "kinds.tsv").read_text().splitlines()]
    page = PAGE.read_text()
    rows, passed, failed = rows_of(page), 0, 0
    limits_of = {name: limits for name, _, *limits in kinds}
    unproven = [[title, "not proven", "", why, "-"] for title, why in NOT_PROVEN.items()]

    def chosen(name):
        return name in names if names else not few or name in FEW

    for name, title, *limits in kinds:
        if not chosen(name):
            continue
        result = proven(folder / name, name, limits)
        row = [title] + [result[cell] for cell in ("alarms", "u", "states", "seconds")]
        print("|", " | ".join(row), "|", *sorted(result["failed"]), flush=True)
        good = "hints" not in result["failed"] and (write or row[:4] == rows.get(title, [])[:4])
        rows[title] = row
        passed, failed = passed + good, failed + (not good)
        if not good:
            print(f"FAILED {title}: not what the page says, or the hints change what the C does")
        if write:
            write_table([rows[title] for _, title, *_ in kinds if title in rows] + unproven)
    if not names:
        missing = without_row(rows_of(PAGE.read_text())) + [
            row[0] for row in unproven if rows_of(PAGE.read_text()).get(row[0]) != row]
        print("\n".join([f"FAILED no row: {one}" for one in missing] or ["ok     all that to_c writes has a row"]))
        passed, failed = passed + (not missing), failed + len(missing)
    for number, (name, title, old, new, what) in enumerate(BROKEN):
        if not chosen(name) or name not in limits_of:
            continue
        at = folder / f"broken{number}"
        at.mkdir(exist_ok=True)
        (at / f"{name}.h").write_text((folder / name / f"{name}.h").read_text())
        source = (folder / name / f"{name}.c").read_text()
        broken = source.replace(old, new)
        refused = source.count(old) == 1 and what in proven(at, name, limits_of[name], broken)["failed"]
        print("ok     refused:" if refused else "FAILED not refused:", f"{name}, {title}", flush=True)
        passed, failed = passed + refused, failed + (not refused)
    source = (folder / "integers" / "integers.c").read_text()
    for title, old, new in BROKEN_STEP if chosen("integers") else ():
        broken = re.sub(old, new, source, count=1)
        refused = broken != source and bool(integers.Proof(broken).beyond)
        print("ok     refused:" if refused else "FAILED not refused:", title, flush=True)
        passed, failed = passed + refused, failed + (not refused)
    print(f"{passed} passed, {failed} failed")
    return failed > 0 or passed == 0


if __name__ == "__main__":
    sys.exit(main())
