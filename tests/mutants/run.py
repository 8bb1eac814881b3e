#!/usr/bin/env python3
"""Would the tests notice? Draws changes of include/, switches on one at a time and runs the tests.

usage: tests/mutants/run.py [--seed 1] [--count 100] [--only PATH ...] [--jobs 1] [--until HH:MM]
       tests/mutants/run.py --self-test

The mutants are drawn from the seed: a header by its lines and the weight of its folder, a kind of change,
a place for it. All of them are written into one private copy of include/, each behind a switch
(`if (active(7)) ..`), so that a test program is compiled once (-O0) and then run once for each mutant that
it reaches. Tests are taken in the order of how many mutants they are near to: the mirror of a header, then
the tests that name most of what it declares, --tests of them for each mutant.

A mutant is `killed` when a test fails that passes without it. When all tests near to it were tried, it has
`survived` if some of them ran it and passed, and is `not reached` if none ran it; before, it is `open`.
Whether a survivor is equivalent only a reader can tell: where you can show it, write "equivalent" for its
verdict in the results (--results, JSON); it then leaves the count. A second call goes on where the first
ended. What has no switch is not drawn: a statement of several lines (except for its constants), types,
`if constexpr`, and what is computed when it is compiled.

Needs a build folder (--build) in which each test is a program of its own, and builds the tests' libraries
there: `cmake --preset tests -B build/mutants -DESOKIT_TESTS_TOGETHER=OFF`.
"""

import argparse
import datetime
import json
import math
import os
import random
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock

ROOT = Path(__file__).resolve().parents[2]
# Assertions of Eigen and of the library stand for the sanitizers of the CI.
FLAGS = ["-O0", "-w", "-Wno-narrowing", "-UNDEBUG", "-D_GLIBCXX_ASSERTIONS"]
WEIGHT = dict.fromkeys(("control", "adapter", "gain", "observer", "tune", "identify"), 2)
SKIPPED = re.compile(r"\s*(#|template\b|static_assert|using\b|namespace\b|concept\b|requires\b|friend\b|"
                     r"case\b|public:|private:|struct\b|class\b|.*\bif constexpr\b|.*\bconstexpr (auto|"
                     r"[A-Z]\w*|int|double|bool|char|std::)[\w:<>, ]* \w+( =|\{))")

SWITCH = """#pragma once
namespace esokit_mutants {
bool on(int) noexcept;
constexpr bool active(int n) noexcept { return __builtin_is_constant_evaluated() ? false : on(n); }
}
"""
SWITCHBOARD = """#include <cstdio>
#include <cstdlib>
namespace esokit_mutants {
static bool reached[100000];
static const int chosen = std::getenv("MUTANT") ? std::atoi(std::getenv("MUTANT")) : -1;
bool on(int n) noexcept { reached[n] = true; return n == chosen; }
static struct Report {
  ~Report() {
    const char* name = std::getenv("MUTANTS_REACHED");
    if (std::FILE* file = name ? std::fopen(name, "w") : nullptr) {
      for (int n = 0; n < 100000; ++n) if (reached[n]) std::fprintf(file, "%d\\n", n);
      std::fclose(file);
    }
  }
} report;
}
"""


# ---- drawing ----

def code_lines(text):
    """The lines without comments and texts, as long as before."""
    def blank(match):
        return re.sub(r"[^\n]", " ", match[0])
    return re.sub(r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"", blank, text, flags=re.DOTALL).split("\n")


def swaps(pairs, kind):
    table = {one: other for pair in pairs for one, other in (pair, pair[::-1])}
    pattern = re.compile("|".join(re.escape(one) for one in sorted(table, key=len, reverse=True)))
    return lambda line: [(kind, m.start(), m.end(), table[m[0]]) for m in pattern.finditer(line)]


def constants(line):
    for m in re.finditer(r"(?<![\w.])(\d+\.\d+|\d+)(?![\w.\"'])", line):
        if "." in m[0]:
            yield "constant", m.start(), m.end(), "1.0" if float(m[0]) == 0 else f"(2.0 * {m[0]})"
        else:
            yield "constant", m.start(), m.end(), str(int(m[0]) + 1)
            if int(m[0]) > 0:
                yield "constant", m.start(), m.end(), str(int(m[0]) - 1)


def deletions(line):
    for m in re.finditer(r"(?:(?<=[{;)] )|(?<=^)\s+)((?:\+\+|--|\(void\))?[a-z_][\w.:\[\]>()-]*"
                         r"(?: [-+*/|&]?= [^;]*|\([^;]*\)|\+\+|--)?);", line):
        if not re.match(r"(return|break|continue|default|if|for|while|else|do)\b", m[1]):
            yield "delete the statement", m.start(1), m.end(1), ""


def conditions(line):
    for m in re.finditer(r"\bif \(", line):
        end = closing(line, m.end())
        begin = line.rfind(";", m.end(), end) + 1 or m.end()
        if end:
            yield "negate the condition", begin, end, f" !({line[begin:end].strip()})"


KINDS = (deletions, conditions, constants,
         swaps(((" < ", " <= "), (" > ", " >= "), (" == ", " != ")), "comparison"),
         swaps(((" + ", " - "), (" += ", " -= "), (" * ", " / ")), "operator"),
         swaps(((" && ", " || "),), "and/or"),
         swaps((("true", "false"), ("min(", "max("), ("larger(", "smaller(")), "opposite"))


def closing(line, begin):
    """Where the parenthesis ends that was opened before `begin`; None if not in this line."""
    depth = 1
    for n in range(begin, len(line)):
        depth += {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(line[n], 0)
        if depth == 0:
            return n
    return None


def statement(line, begin, end):
    """The bounds of the statement of a line around a change, its semicolon not included."""
    depth, first = 0, 0
    for n in range(begin - 1, -1, -1):
        depth = max(0, depth + {")": 1, "]": 1, "}": 1, "(": -1, "[": -1}.get(line[n], 0))
        if line[n] == "{":
            if depth == 0 and re.search(r"(\)|noexcept|const|else)\s*$", line[:n]):
                first = n + 1
                break
            depth = max(0, depth - 1)
        elif depth == 0 and line[n] == ";":
            first = n + 1
            break
    depth, last = 0, None
    for n in range(end, len(line)):
        depth = max(0, depth + {"(": 1, "[": 1, "{": 1, ")": -1, "]": -1, "}": -1}.get(line[n], 0))
        if depth == 0 and line[n] == ";":
            last = n
            break
    return (first, last) if last is not None else None


def switched(line, before, change, number):
    """The line with the change behind a switch, or None if this form has none. `before`: whether the
    line before ended a statement."""
    kind, begin, end, new = change
    on = f"::esokit_mutants::active({number})"

    def of(first, last):
        return line[first:begin] + new + line[end:last], line[first:last]

    if kind == "constant" or new in ("true", "false"):
        return f"{line[:begin]}({on} ? {new} : {line[begin:end]}){line[end:]}"
    for m in re.finditer(r"\b(if|while) \(", line):
        stop = closing(line, m.end())
        start = (line.rfind(";", m.end(), stop) + 1 or m.end()) if stop else 0
        if stop and start <= begin and end <= stop:
            if re.match(r"\s*(const )?[\w:<>]+[&*]* \w+ = ", line[start:stop]):
                return None
            changed, old = of(start, stop)
            return f"{line[:start]} {on} ? bool({changed}) : bool({old}){line[stop:]}"
    loop = re.search(r"\bfor \(", line)
    if loop and (stop := closing(line, loop.end())) and begin < stop:
        first = line.find(";", loop.end())
        second = line.find(";", first + 1)
        if not first + 1 <= begin < end <= second:
            return None
        changed, old = of(first + 1, second)
        return f"{line[:first + 1]} {on} ? bool({changed}) : bool({old}){line[second:]}"
    # Behind `if (..) `, the rest of the line is a statement of its own.
    lead = re.match(r"\s*(?:\} )?(?:else )?(?:if|for|while) \(", line)
    offset = (closing(line, lead.end()) or len(line)) + 1 if lead else 0
    offset += len(re.match(r"(?: \[\[\w+\]\])?", line[offset:])[0]) if lead else 0
    other = re.match(r"\s*else ", line) if not lead else None
    offset = other.end() if other else offset
    bounds = statement(line[offset:], begin - offset, end - offset) if begin >= offset else None
    if not bounds or (bounds[0] == 0 and not offset and not before):
        return None
    first, last = bounds[0] + offset, bounds[1] + offset
    changed, old = of(first, last)
    if kind == "delete the statement":
        text = f"if (!{on}) {{ {old}; }}" if changed.strip() == "" else None
    elif m := re.match(r"\s*return\b", old):
        text = f"{{ if ({on}) {changed}; {old}; }}"
    elif m := re.match(r"(\s*(?:const |static )*(?!return\b)[\w:<>, ]+[&*]? [\w]+ = )(.*)", old):
        value = len(m[1])
        if "{" in m[2][:1] or begin - first < value or "constexpr" in m[1]:
            return None
        text = f"{m[1]}{on} ? ({changed[value:]}) : ({old[value:]})"
        return line[:first] + text + line[last:]
    elif re.match(r"\s*(\+\+|--|\(void\)|\*)?[a-z_][\w.:\[\]()>-]*\s*([-+*/|&]?=[^=]|\(|$)", old):
        text = f"if ({on}) {{ {changed}; }} else {{ {old}; }}"
    else:
        return None
    if text is None:
        return None
    return line[:first] + (f" {{ {text} }}" if not text.startswith("{") else " " + text) + line[last + 1:]


def mutants_of(text):
    """All of a header that can be switched: {kind: [(line, begin, end, new)]}."""
    lines, found, before = code_lines(text), {}, True
    for n, line in enumerate(lines):
        if line.strip():
            if not SKIPPED.match(line):
                for kind in KINDS:
                    for change in kind(line.rstrip()):
                        if switched(line.rstrip(), before, change, 0):
                            found.setdefault(change[0], []).append((n, *change[1:]))
            before = line.rstrip()[-1] in ";{}:"
    return found


def draw(headers, seed, count):
    """The mutants of a seed, no place twice."""
    choice, drawn, places = random.Random(seed), [], set()
    found = {path: mutants_of(text) for path, text in headers.items()}
    found = {path: kinds for path, kinds in found.items() if kinds}
    weights = [WEIGHT.get(path.split("/")[2], 1) * sum(bool(line.strip()) for line in
                                                       code_lines(headers[path])) for path in found]
    for _ in range(100 * count):
        if len(drawn) == count or not found:
            break
        path = choice.choices(list(found), weights)[0]
        kind = choice.choice(sorted(found[path]))
        line, begin, end, new = choice.choice(found[path][kind])
        if (path, line) in places:  # one switch a line
            continue
        places.add((path, line))
        old = headers[path].split("\n")[line]
        drawn.append({"number": len(drawn), "path": path, "line": line + 1, "kind": kind,
                      "old": old.strip(), "new": (old[:begin] + new + old[end:]).strip(),
                      "change": [kind, begin, end, new], "verdict": "", "by": ""})
    return drawn


# ---- which tests ----

class Tests:
    """The test programs, and which headers each includes, by their #include lines."""

    def __init__(self):
        self.includes, self.words = {}, {}
        self.all = sorted(file.relative_to(ROOT).as_posix() for file in ROOT.glob("tests/*/*_test.cpp"))

    def closure(self, path):
        if path not in self.includes:
            self.includes[path] = set()  # ends a circle
            text = (ROOT / path).read_text(encoding="utf-8")
            found = set()
            for name in re.findall(r'#include [<"]([\w./]+)[>"]', text):
                for place in ("include", "tests", "tests/support", str(Path(path).parent)):
                    if (ROOT / place / name).is_file():
                        found |= {f"{place}/{name}"} | self.closure(f"{place}/{name}")
                        break
            self.includes[path] = found
            self.words[path] = set(re.findall(r"[A-Za-z_]\w{3,}", "\n".join(code_lines(text))))
        return self.includes[path]

    def nearest(self, header, count):
        room, stem = Path(header).parts[2], Path(header).stem
        text = (ROOT / header).read_text(encoding="utf-8")
        declared = {a or b for a, b in
                    re.findall(r"\b(?:struct|class|concept)\s+(\w+)|\b([a-z_]\w{3,})\(", text)}
        ranked = []
        for test in self.all:
            if header in self.closure(test) and not test.endswith("_static_test.cpp"):
                name, area = Path(test).stem, Path(test).parts[1]
                hits = len(declared & self.words[test]) * (2 if area == room else 1)
                ranked.append((name != stem + "_test" or area != room, stem not in name, -hits,
                               (ROOT / test).stat().st_size, test))
        return [one[-1] for one in sorted(ranked)[:count]]


# ---- compiling and running ----

def run(command, cwd, seconds, **environment):
    """Status (None: out of time) and what was said."""
    with tempfile.TemporaryFile() as said:
        try:
            status = subprocess.run(["nice", "-n", "10", *command], cwd=cwd, stdout=said,
                                    stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL, timeout=seconds,
                                    env={**os.environ, **environment}, check=False).returncode
        except subprocess.TimeoutExpired:
            status = None
        said.seek(0)
        return status, said.read().decode("utf-8", "replace")


class Place:
    """The private copy with its switches."""

    def __init__(self, folder, build, mutants):
        self.folder, self.build, self.mutants, self.lock = folder, build, mutants, Lock()
        for name in ("include", "tests"):
            shutil.copytree(ROOT / name, folder / name)
        commands = json.loads((build / "compile_commands.json").read_text(encoding="utf-8"))
        self.commands = {Path(one["file"]).relative_to(ROOT).as_posix(): one["command"] for one in commands
                         if Path(one["file"]).is_relative_to(ROOT / "tests")}
        (folder / "switch.hpp").write_text(SWITCH)
        (folder / "switchboard.cpp").write_text(SWITCHBOARD)
        self.must(["c++", "-c", "switchboard.cpp"], folder)
        self.write()

    @staticmethod
    def must(command, folder):
        status, said = run(command, folder, 900)
        if status != 0:
            sys.exit(f"{shlex.join(command)}:\n{said[-2000:]}")

    def write(self):
        """The headers with the switches of all mutants that compile."""
        for path in {one["path"] for one in self.mutants}:
            lines = (ROOT / path).read_text(encoding="utf-8").split("\n")
            code = code_lines("\n".join(lines))
            for one in self.mutants:
                if one["path"] == path and one["verdict"] != "does not compile":
                    n = one["line"] - 1
                    width = len(code[n].rstrip())
                    lines[n] = switched(lines[n][:width], True, one["change"], one["number"])
            (self.folder / path).write_text("\n".join(lines), encoding="utf-8")

    def compile_command(self, test, output):
        words = shlex.split(self.commands[test])
        words = words[next(i for i, word in enumerate(words) if word.endswith("++")):]
        command, skip = [], False
        for word in words:
            if skip or word in ("-o", "-MF", "-MT"):
                skip = not skip
            elif word.endswith(".hxx"):
                command += [str(self.precompiled(word)), "-include", f"{self.folder}/switch.hpp"]
            elif not re.match(r"-O|-g|-W|-MD|-DESOKIT_COMPILED", word):  # with the definitions, to switch them
                command.append(word.replace(f"{ROOT}/include", f"{self.folder}/include")
                               .replace(f"{ROOT}/tests", f"{self.folder}/tests"))
        if f"{self.folder}/switch.hpp" not in command:
            command += ["-include", f"{self.folder}/switch.hpp"]
        return command + [*FLAGS, "-o", str(output)]

    def precompiled(self, header):
        mine = self.folder / "precompiled.hxx"
        if not mine.exists():
            shutil.copy(header, mine)
            words = self.compile_command("tests/core/check_test.cpp", f"{mine}.gch")
            for option in ("-include", "-include", "-c"):
                del words[words.index(option):words.index(option) + 2]
            self.must(words + ["-x", "c++-header", str(mine)], self.build)
        return mine

    def link_command(self, test, file, output):
        target = "_".join(Path(test).parts[1:])[:-4]
        said = subprocess.run(["ninja", "-C", str(self.build), "-t", "commands", "-s",
                               f"tests/bin/{target}"], capture_output=True, text=True, check=True).stdout
        words = [word for word in shlex.split(said.splitlines()[-1]) if word not in (":", "&&")]
        libraries = [word for word in words if word.startswith("tests/") and word.endswith(".a")]
        if libraries:
            self.must(["ninja", "-C", str(self.build), "-j1", *libraries], self.build)
        at = next(i for i, word in enumerate(words) if word.endswith(".o"))
        words[at:at + 1] = [str(file), str(self.folder / "switchboard.o")]
        words[words.index("-o") + 1] = str(output)
        return words

    def program(self, test, seconds):
        """The test with all switches; mutants on whose line an error is are dropped. None: no."""
        name = test.replace("/", "_")
        for _ in range(20):
            status, said = run(self.compile_command(test, self.folder / f"{name}.o"), self.build, seconds)
            if status == 0:
                break
            wrong = {(path, int(line)) for path, line in
                     re.findall(rf"{re.escape(str(self.folder))}/(include/[\w./]+):(\d+):\d+: (?:fatal )?error",
                                said)}
            wrong |= {(path, int(line)) for path, line in
                      re.findall(rf"{re.escape(str(self.folder))}/(include/[\w./]+):(\d+):\d+:\s+required from",
                                 said)} if not wrong else set()
            with self.lock:
                hit = [one for one in self.mutants if (one["path"], one["line"]) in wrong
                       and one["verdict"] != "does not compile"]
                for one in hit:
                    one["verdict"] = "does not compile"
                self.write()
            if not hit:
                print(f"{test} does not compile: {said[:1500]}")
                return None
        if run(self.link_command(test, self.folder / f"{name}.o", self.folder / name), self.build,
               seconds)[0] != 0:
            return None
        return self.folder / name

    def play(self, test, seconds, longest, save, in_time):
        """Runs all living mutants that the test reaches; False if not all."""
        program = self.program(test, seconds)
        if not program:
            return False
        reached, command = f"{program}.reached", [str(program)]
        for _ in range(2):
            began = datetime.datetime.now()
            status, said = run(command, self.folder, seconds, MUTANTS_REACHED=reached)
            took = (datetime.datetime.now() - began).total_seconds()
            failed = sorted(set(re.findall(r"\[  FAILED  \] ([\w/]+\.[\w/]+)", said)))
            if status == 0 or not failed:
                break
            print(f"{test}: without {', '.join(failed)}, which fail at -O0 without a mutant")
            command = [str(program), "--gtest_filter=-" + ":".join(failed)]
        if status != 0 or not Path(reached).exists():
            print(f"{test} fails without a mutant: {said[-600:]}")
            return False
        if took > longest:
            print(f"{test}: left out, as a run takes {took:.0f} s")
            return False
        numbers = set(map(int, Path(reached).read_text().split()))
        for one in self.mutants:
            if one["number"] not in numbers or one["verdict"] not in ("", "survived") or not in_time():
                continue
            status, said = run(command, self.folder, 10 + 8 * took, MUTANT=str(one["number"]),
                               GTEST_FAIL_FAST="1")
            if status == 0:
                one["verdict"] = "survived"
                one["by"] += (", " if one["by"] else "") + test
            else:
                case = re.search(r"\[  FAILED  \] ([\w/.]+)", said)
                one["verdict"] = "killed"
                one["by"] = test + (" (out of time)" if status is None else
                                    f" ({case[1]})" if case else f" (status {status})")
            save()
        program.unlink()
        Path(f"{program}.o").unlink()
        return in_time()


# ---- the whole ----

def wilson(killed, count):
    if count == 0:
        return 0.0, 1.0
    z, share = 1.96, killed / count
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count)) / (1 + z * z / count)
    return middle - half, middle + half


def summary(state, near):
    def verdict(one):
        if one["verdict"] in ("", "survived"):
            tried = set(state["tests"]) - set(state.get("left out", ()))
            return ("open" if set(near[one["path"]]) - tried else
                    one["verdict"] or "not reached")
        return one["verdict"]

    told = [(verdict(one), one) for one in state["mutants"]]
    for name, one in sorted(told, key=lambda pair: (pair[0], pair[1]["path"], pair[1]["line"])):
        if name in ("survived", "not reached"):
            print(f"{name} ({one['number']}): {one['path']}:{one['line']}: {one['kind']}\n"
                  f"    - {one['old']}\n    + {one['new']}\n    {one['by']}")
    verdicts = [name for name, _ in told]
    count = {name: verdicts.count(name) for name in
             ("killed", "survived", "not reached", "open", "equivalent", "does not compile")}
    low, high = wilson(count["killed"], count["killed"] + count["survived"])
    print(", ".join(f"{number} {name}" for name, number in count.items()) +
          f": {100 * count['killed'] / max(1, count['killed'] + count['survived']):.0f} % killed of those "
          f"that the tests ran, 95 % interval {100 * low:.0f} to {100 * high:.0f} %")


def self_test(build):
    """A change that must be seen, and one that nothing can see."""
    header, test = "include/esokit/math/fal.hpp", "tests/math/fal_test.cpp"
    lines = (ROOT / header).read_text(encoding="utf-8").split("\n")
    n = next(n for n, line in enumerate(lines) if "return error * gain(" in line)
    begin = lines[n].index(" * ")
    mutants = [{"number": 0, "path": header, "line": n + 1, "change": ["operator", begin, begin + 3, " / "],
                "verdict": "", "by": ""}]
    m = next(n for n, line in enumerate(lines) if "return power_(select(" in line)
    begin = lines[m].index(" < ")
    mutants.append({"number": 1, "path": header, "line": m + 1,  # equal either way
                    "change": ["comparison", begin, begin + 3, " <= "], "verdict": "", "by": ""})
    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        Place(Path(folder), build, mutants).play(test, 600, 600, lambda: None, lambda: True)
    print([one["verdict"] for one in mutants])
    if [one["verdict"] for one in mutants] != ["killed", "survived"]:
        sys.exit(1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--only", action="append", default=[], help="part of a header's path")
    parser.add_argument("--skip", action="append", default=[], help="part of a header's path")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--tests", type=int, default=3, help="test programs near a mutant")
    parser.add_argument("--seconds", type=int, default=600, help="for a compile")
    parser.add_argument("--longest", type=int, default=60, help="seconds of a run; a longer test is left out")
    parser.add_argument("--until", help="HH:MM: begin nothing after it")
    parser.add_argument("--build", type=Path, default=ROOT / "build/mutants")
    parser.add_argument("--results", type=Path, help="default: BUILD/mutants_SEED.json")
    parser.add_argument("--list", action="store_true", help="only show what is drawn, or was found")
    parser.add_argument("--self-test", action="store_true")
    options = parser.parse_args()
    build = options.build.resolve()
    if options.self_test:
        return self_test(build)

    headers = {path: (ROOT / path).read_text(encoding="utf-8")
               for path in sorted(file.relative_to(ROOT).as_posix() for file in
                                  ROOT.glob("include/esokit/**/*.[hi]pp"))
               if (not options.only or any(part in path for part in options.only))
               and not any(part in path for part in options.skip)}
    results = options.results or build / f"mutants_{options.seed}.json"
    state = (json.loads(results.read_text(encoding="utf-8")) if results.exists() else
             {"mutants": draw(headers, options.seed, options.count), "tests": [], "left out": []})
    mutants = state["mutants"]
    tests, lock = Tests(), Lock()
    near = {path: tests.nearest(path, options.tests) for path in {one["path"] for one in mutants}}
    if options.list:
        for one in mutants:
            print(f"{one['path']}:{one['line']}: {one['new']}")
        return summary(state, near)

    def save():
        with lock:
            results.write_text(json.dumps(state, indent=1), encoding="utf-8")

    def in_time():
        return not options.until or datetime.datetime.now().strftime("%H:%M") < options.until

    def next_test():
        """That which the most living mutants are near to, the first of a mutant's tests before others."""
        worth = {}
        for one in mutants:
            if one["verdict"] in ("", "survived"):
                for rank, test in enumerate(near[one["path"]]):
                    if test not in state["tests"]:
                        worth[test] = worth.get(test, 0) + (1.0 if one["verdict"] == "" else 0.3) / (1 + rank)
        # A long test takes long to compile.
        return max(worth, key=lambda test: (worth[test] / (2e4 + (ROOT / test).stat().st_size), test),
                   default=None)

    def work(_):
        while in_time():
            with lock:
                test = next_test()
                if test is None:
                    return
                state["tests"].append(test)
            if not place.play(test, options.seconds, options.longest, save, in_time):
                state["left out"].append(test)
            verdicts = [one["verdict"] for one in mutants]
            print(f"{datetime.datetime.now():%H:%M} {test}: {verdicts.count('killed')} killed, "
                  f"{verdicts.count('survived')} alive so far, {verdicts.count('')} not run so far", flush=True)
            save()

    with tempfile.TemporaryDirectory(prefix="mutants_") as folder:
        place = Place(Path(folder), build, mutants)
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(work, range(options.jobs)))
    summary(state, near)


if __name__ == "__main__":
    main()
