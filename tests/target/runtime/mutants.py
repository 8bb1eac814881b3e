#!/usr/bin/env python3
"""Would the tests of written C notice? Draws changes of the files in include/esokit/target/runtime (a
comparison, a whole number, a decimal constant by one ulp of float), makes one at a time in what the tests
write (ESOKIT_MUTANT) and runs the tests near to its file.

usage: mutants.py --seed N [--count 40] [--each N of every file] [--bin FOLDER of the tests' programs]
                  [--only FILE ..] [--line TEXT that is in the line]

A line that is the same in two places is not drawn. Killed: a test fails, or the C does not compile.
Not reached: no test has the line in what it writes. Each test takes 30,000 samples of a kind: with
fewer it misses what it has to meet and fails without a change, which ends the run. Whether a survivor
is equivalent only a reader can tell."""
import argparse
import os
import random
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FILES = ROOT / "include/esokit/target/runtime"
# The tests near to each file: program, filter. The lightest first.
NEAR = {
    "approach.c": [("profile_code", "*Approach*")],
    "angle.c": [("c_running", "*OfAnglesByTurns"), ("c_running", "*OfAnglesByTurnsAroundAGate"),
                ("c_state", "*OfObservers")],
    "controller.c": [("c_code", "*OfALinearObserverInFloat:*OfAnObserverAlone:*OfWhatIsSafe:*OfNoneMissing"),
                     ("c_kinds", "*OfDelaysAndOtherForms"), ("c_guarded", "*OfPinHoldAndGain"),
                     ("c_saved", "*")],
    "core.c": [("c_kinds", "*OfDelaysAndOtherForms"), ("c_running", "*OfASchedule"),
               ("c_running", "*OfLongGaps")],
    "design.c": [("c_running", "*OfASchedule"), ("c_predictive", "*EqualsTheController:*OfASchedule")],
    "follow.c": [("profile_code", "*Follower*")],
    "guard.c": [("c_guarded", "*Pin*:*Frozen*")],
    "health.c": [("health_code", "*Equals*:*Alike*")],
    "layers.c": [("c_running", "*OfAnglesByTurns"), ("c_running", "*OfAnglesByTurnsAroundAGate")],
    "law.c": [("c_running", "*OfASchedule:*OfAFilter")],
    "map.c": [("c_mapped", "*OfAnyCurve")],
    "measured.c": [("c_guarded", "*OfAMeasured*:*OfSeveral*")],
    "observer.c": [("c_kinds", "*OfDelaysAndOtherForms"), ("c_running", "*OfLongGaps")],
    "predictive.c": [("c_predictive", "*EqualsTheController:*OfASchedule")],
    "profile.c": [("profile_code", "*Equals*")],
    "sum.c": [("profile_code", "*Follower*")],
    "proportioned.c": [("time_proportioned_code", "*Equals*")],
}
MARK = "/* mutant */"
SIGNS = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
PLACE = re.compile(r" (?P<sign><=|>=|==|!=|<|>) |\b(?P<count>\d+)u\b|\b(?P<real>\d+\.\d+)\b")
# Stands behind the name `gcc`: notes that a mutant was there.
COMPILER = """#!/bin/sh
for one in "$@"; do
  case "$one" in *.c) grep -qF '{mark}' "$one" && touch '{note}' ;; esac
done
exec {gcc} "$@"
"""


def mutants(only):
    """(file, line as written, the changed line) of each place."""
    lines, found = {}, []
    for path in sorted(FILES.glob("*.c")):
        text = re.sub(r"/\*.*?\*/", lambda it: "\n" * it[0].count("\n"), path.read_text("utf-8"), flags=re.S)
        for line in text.splitlines():
            lines.setdefault(line.strip(), []).append(path.name)
    for line, files in lines.items():
        if len(files) > 1 or re.match("#(?!define [A-Z])", line) or files[0] in ("fixed.c", "head.c") or (
                only and files[0] not in only):
            continue
        for match in PLACE.finditer(line):
            if match["sign"]:
                new = f" {SIGNS[match['sign']]} "
            elif match["count"]:
                new = f"{int(match['count']) + 1}u"
            elif float(match["real"]) > 0:
                new = f"{float(match['real']) * (1 + 2 ** -23):.12f}"
            else:
                continue
            # Around the place, as far as it is the same in float and in double.
            same = re.compile(r"\breal\b|\d+\.\d+")
            before = same.split(line[:match.start()])[-1]
            after = "" if match["real"] else same.split(line[match.end():])[0]
            old, new = (before + one + after for one in (match[0], new))
            if sum(old in other for other in lines) > 1:
                continue
            name = "health" if files[0] == "health.c" else "loop"
            old, new = (one.replace("esokit_", name + "_").replace("ESOKIT_", name.upper() + "_")
                        for one in (old, new))
            found.append((files[0], line, old, new))
    return found


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--each", type=int, default=0, help="so many of every file")
    parser.add_argument("--bin", type=Path, default=ROOT / "build/t/tests/bin")
    parser.add_argument("--only", nargs="*", default=[])
    parser.add_argument("--line", default="")
    given = parser.parse_args()
    drawn = [one for one in mutants(given.only) if given.line in one[1]]
    random.Random(given.seed).shuffle(drawn)
    if given.each:
        files = sorted({one[0] for one in drawn})
        drawn = [one for file in files for one in [it for it in drawn if it[0] == file][:given.each]]
        given.count = len(drawn)
    counts = {"killed": 0, "survived": 0, "not reached": 0}
    with tempfile.TemporaryDirectory() as folder:
        note = Path(folder) / "note"
        gcc = subprocess.run(["which", "gcc"], capture_output=True, text=True, check=True).stdout.strip()
        compiler = Path(folder) / "gcc"
        compiler.write_text(COMPILER.format(mark=MARK, note=note, gcc=gcc), "utf-8")
        compiler.chmod(0o755)

        def passes(program, tests, more):
            environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}",
                           "ESOKIT_WRITTEN_SAMPLES": "30000", **more}
            ran = subprocess.run([given.bin / f"target_{program}_test", f"--gtest_filter={tests}",
                                  "--gtest_brief=1", "--gtest_fail_fast"], env=environment, capture_output=True, check=False)
            return ran.returncode == 0

        alone = set()
        for file, line, old, new in drawn[:given.count]:
            verdict = "not reached"
            for one in NEAR[file]:
                if one not in alone and not passes(*one, {}):
                    print(f"{one[0]} {one[1]} fails without a change")
                    return 1
                alone.add(one)
                note.unlink(missing_ok=True)
                passed = passes(*one, {"ESOKIT_MUTANT": f"{old}@@{new}{MARK}"})
                if note.exists():
                    verdict = "survived" if passed else "killed"
                if verdict == "killed":
                    break
            counts[verdict] += 1
            print(f"{verdict}: {file}: {line}: {old} -> {new}", flush=True)
    print(", ".join(f"{number} {verdict}" for verdict, number in counts.items()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
