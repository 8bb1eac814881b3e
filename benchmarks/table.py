#!/usr/bin/env python3
"""The table of benchmarks/run.sh. usage: table.py RESULTS_FOLDER COMPILER FLAGS FILTERED(0|1)

Reads RESULTS_FOLDER/PROGRAM.K.json, the K-th process of a program, each with many short bursts of every
benchmark in random order. The time of a benchmark in a process is its least burst: what else runs on
the machine can only add. A ratio is taken within a process, printed is the median over the processes;
the spread is between the largest and the smallest, of five or more without these two. Writes RESULTS_FOLDER/table.json.
The exit code is 0, 3 for an error, 4 if a limit is missed.
"""
import json
import pathlib
import platform
import re
import statistics
import sys

COMPARISON = re.compile(r"vs (\S+?)(?: +(<=?) *([0-9.]+))?$")


def least_times(report):
    """Name to (least ns, label), in the order of registration."""
    rows = {}
    for run in report["benchmarks"]:
        if run.get("run_type") == "aggregate":
            continue
        if run.get("error_occurred"):
            raise SystemExit(f"error: {run['name']}: {run.get('error_message')}")
        name = run["run_name"].split("/repeats:")[0]
        time = run["cpu_time"] * {"ns": 1, "us": 1e3, "ms": 1e6, "s": 1e9}[run["time_unit"]]
        if not time > 0:
            continue  # a virtual machine's clock stood still: no measurement, and no divisor
        key = run["family_index"]
        if name not in rows or time < rows[name][1]:
            rows[name] = (key, time, run.get("label", ""))
    return {name: row[1:] for name, row in sorted(rows.items(), key=lambda item: item[1][0])}


def comparisons(label):
    for part in filter(None, map(str.strip, label.split(";"))):
        found = COMPARISON.match(part)
        if found:
            yield found[1], found[2], float(found[3]) if found[3] else None


def program_rows(processes, filtered):
    for name, (_, label) in processes[0].items():
        times = [process[name][0] for process in processes if name in process]
        row = {"benchmark": name, "ns": min(times), "ratios": []}
        for base, sign, limit in comparisons(label):
            if base not in processes[0]:
                if filtered:
                    continue  # a filter leaves baselines out; without one the label is wrong
                raise SystemExit(f"error: {name} is compared with {base}, which did not run")
            ratios = [process[name][0] / process[base][0] for process in processes
                      if name in process and base in process]
            ratio = statistics.median(ratios)
            if len(ratios) >= 5:
                ratios = sorted(ratios)[1:-1]
            kept = limit is None or (ratio <= limit if sign == "<=" else ratio < limit)
            row["ratios"].append({"of": base, "ratio": ratio, "spread": max(ratios) - min(ratios),
                                  "sign": sign, "limit": limit, "kept": kept})
        yield row


def main():
    folder, compiler, flags, filtered = sys.argv[1:]
    folder = pathlib.Path(folder)
    programs = {}
    for path in sorted(folder.glob("*_benchmark.*.json")):
        report = json.loads(path.read_text())
        programs.setdefault(path.name.split(".")[0], []).append(least_times(report))
        context = report["context"]
    cpu = next((line.split(":")[1].strip() for line in open("/proc/cpuinfo")
                if line.startswith("model name")), platform.machine())
    machine = f"{cpu}, {context['num_cpus']} cores at {context['mhz_per_cpu']} MHz"
    result = {"machine": machine, "compiler": compiler, "flags": flags, "programs": {}}
    over = []
    limits = 0
    count = 0
    for program, processes in programs.items():
        rows = list(program_rows(processes, filtered == "1"))
        result["programs"][program] = rows
        count += len(rows)
        width = max([len(row["benchmark"]) for row in rows], default=0)
        print(f"\n{program}\n  {'':{width}}       ns   ratio  spread  of")
        for row in rows:
            line = f"  {row['benchmark']:{width}} {row['ns']:8.2f}"
            if not row["ratios"]:
                print(line)
            for ratio in row["ratios"]:
                text = f"{line}  {ratio['ratio']:6.3f}  {ratio['spread']:6.3f}  {ratio['of']}"
                if ratio["limit"] is not None:
                    limits += 1
                    text += f" {ratio['sign']} {ratio['limit']:g}"
                    if not ratio["kept"]:
                        text += "  OVER"
                        over.append(f"{program}: {row['benchmark']}: {ratio['ratio']:.3f} of "
                                    f"{ratio['of']}, limit {ratio['limit']:g}, "
                                    f"spread {ratio['spread']:.3f}")
                print(text)
                line = " " * len(line)
    (folder / "table.json").write_text(json.dumps(result, indent=1))
    print(f"\n{machine}; {compiler}, {flags}; {count} benchmarks, least of all bursts")
    print(f"{limits - len(over)} of {limits} limits kept" + "".join(f"\n  OVER  {text}" for text in over))
    if count == 0:
        return 0 if filtered == "1" else 3
    return 4 if over else 0


if __name__ == "__main__":
    sys.exit(main())
