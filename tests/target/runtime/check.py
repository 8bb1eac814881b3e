#!/usr/bin/env python3
"""The files of target/runtime/ as C by themselves, in sets of features that a design can have: GCC and
Clang take them without a warning, and cppcheck finds no violation of MISRA C:2012 but the deviations
that head.c names.

usage: check.py [--count N | --all] [--misra N] [--seed S]
Without --all a sample: each pair of features that can be together is in it. --misra: of how many sets
cppcheck is asked. The last line is how many sets were checked; the status is 1 at the first fault."""
import argparse
import itertools
import os
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

HERE = Path(__file__).resolve().parent
INCLUDE = HERE.parents[2] / "include"
KINDS = [{"CONTROLLER"}, {"CONTROLLER", "ERROR_BASED"}, {"CONTROLLER", "COMPENSATOR"}, {"PREDICTIVE"},
         {"PREDICTIVE", "WAITS"}, set()]
LAWS = [{"TABLE", "GAIN_IS_KEPT"}, {"TABLE"}, {"SCHEDULE"}, {"FILTER"}, {"FILTER", "RETURNS"},
        {"FILTER", "WATCHED"}, {"FILTER", "RETURNS", "WATCHED"}]
OF_LOOPS = ["DIVIDED", "RESTS", "STAYS_SAFE", "HOLDS_SAFE", "SOFTENS", "MONITORED"]
GUARDS = [set(), {"GUARDED"}, {"GUARDED", "BOUNDED"}, {"GUARDED", "LEAKS"}, {"GUARDED", "BOUND_OF_U"},
          {"GUARDED", "BOUNDED", "BOUND_OF_U", "LEAKS"}]
W = [set(), {"MEASURED", "ONE_W"}, {"MEASURED"}]
FLAGS = OF_LOOPS + ["HOLDS_AT_START", "SETTINGS", "DELAYED", "GATED", "WRAPPED", "KNOWN", "MAPPED", "SINGLE",
                    "RECOVERS", "MOVES", "SAVED"]
DEVIATIONS = ("2.5", "15.5", "21.15")
ALL = sorted({*FLAGS, "GATED_ANGLE", "LAW_OF_ANGLE"}.union(*KINDS, *LAWS, *GUARDS, *W))


def valid(has):
    """Whether to_c writes such a design."""
    loop = "CONTROLLER" in has
    kept = "GAIN_IS_KEPT" in has
    return not (
        (not loop and has & set(OF_LOOPS) - {"MONITORED"} -
         ({"STAYS_SAFE", "HOLDS_SAFE"} if "PREDICTIVE" in has else set()))
        or ("HOLDS_AT_START" in has and not loop and "PREDICTIVE" not in has)
        or ("PREDICTIVE" in has and (has & {"DELAYED", "GATED", "WRAPPED", "KNOWN", "MEASURED", "GUARDED",
                                            "MAPPED", "SETTINGS", "SAVED"} or ("TABLE" in has and not kept)))
        or ("GUARDED" in has and (not kept or "MEASURED" in has))
        or ("SETTINGS" in has and (not kept or "SOFTENS" in has))
        or ("RECOVERS" in has and "TABLE" not in has)
        or ("SOFTENS" in has and "COMPENSATOR" in has)
        or ("RESTS" in has and has & {"COMPENSATOR", "DIVIDED"})
        or ("KNOWN" in has and "SCHEDULE" in has)
        or ("MOVES" in has and ("ERROR_BASED" in has or "COMPENSATOR" in has or
                                not (loop or "PREDICTIVE" in has)))
        or ("WATCHED" in has and "GATED" in has))


def completed(has):
    """With the features that follow from others."""
    has = set(has)
    if "WRAPPED" in has and has & {"GATED", "WATCHED"}:
        has.add("GATED_ANGLE")
    if {"WRAPPED", "CONTROLLER"} <= has and not has & {"ERROR_BASED", "COMPENSATOR", "SCHEDULE", "KNOWN", "MOVES"}:
        has.add("LAW_OF_ANGLE")
    return frozenset(has)


def every_set():
    for parts in itertools.product(KINDS, LAWS, GUARDS, W):
        fixed = set().union(*parts)
        if not valid(fixed):
            continue
        for chosen in itertools.product((False, True), repeat=len(FLAGS)):
            has = fixed | {flag for flag, on in zip(FLAGS, chosen) if on}
            if valid(has):
                yield completed(has)


def sample(sets, count, seed):
    """So many, in which each two features are together, or one without the other, where they can be."""
    generator = random.Random(seed)
    pool = generator.sample(sets, min(len(sets), 4000))

    def pairs(has):
        on = [(one, one in has) for one in ALL]
        return set(itertools.combinations(on, 2))

    found, seen = [], set()
    while pool and len(found) < count:
        best = max(generator.sample(pool, min(len(pool), 40)), key=lambda has: len(pairs(has) - seen))
        pool.remove(best)
        found.append(best)
        seen |= pairs(best)
    return found


def bare(folder):
    """The files without their wrapping for C++, whose raw string cppcheck reads in C, too."""
    to = Path(folder, "esokit/target/runtime")
    to.mkdir(parents=True)
    for file in (INCLUDE / "esokit/target/runtime").iterdir():
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        (to / file.name).write_text("".join(lines[3:-3]), encoding="utf-8")


def fault(has, files):
    """What is said of a set, or None. files: those without wrapping, if cppcheck is asked."""
    flags = [f"-DESOKIT_{one}={int(one in has)}" for one in ALL] + [f"-I{HERE}"]
    strict = ["-std=c99", "-fsyntax-only", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wshadow",
              "-Werror", "-DESOKIT_SELF_TEST", f"-I{INCLUDE}", str(HERE / "all.c")]
    commands = [["gcc", *flags, *strict]]
    if "SINGLE" in has:
        commands = [["gcc", "-fsingle-precision-constant", *flags, *strict]]
    else:
        commands.append(["clang", *flags, *strict])
    with tempfile.TemporaryDirectory() as folder:
        if files:  # it writes beside what it reads
            source = Path(folder, "all.c")
            source.write_text((HERE / "all.c").read_text(encoding="utf-8"), encoding="utf-8")
            commands.append(["cppcheck", "--addon=misra", "--std=c99", "-q", "--error-exitcode=1",
                             "--suppress=missingIncludeSystem", "--max-configs=1",
                             *(f"--suppress=misra-c2012-{rule}" for rule in DEVIATIONS), *flags,
                             f"-I{files}", source])
        for command in commands:
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            said = (done.stdout + done.stderr).strip()
            if done.returncode != 0 or said:
                return f"{' '.join(sorted(has))}\n{command[0]}: {said[:3000]}"
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--misra", type=int, default=6)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    given = parser.parse_args()
    sets = sorted(set(every_set()), key=sorted)
    chosen = sets if given.all else sample(sets, given.count, given.seed)
    doubles = [has for has in chosen if "SINGLE" not in has]
    asked = set(doubles[:given.misra])
    with tempfile.TemporaryDirectory() as files, ThreadPoolExecutor(given.jobs) as pool:
        bare(files)
        for said in pool.map(lambda has: fault(has, files if has in asked else None), chosen):
            if said:
                print(said)
                sys.exit(1)
    print(f"{len(chosen)} of {len(sets)} sets of features, {len(asked)} of them by MISRA C:2012")


if __name__ == "__main__":
    main()
