#!/usr/bin/python3
"""Runs a program and compares its exit code and numbers of its results with what is expected:

  run_scene.py [--exit CODE] --scalar NUMBER... [--matches REGEX]... [--never REGEX]... [--output_dir FOLDER]
               -- PROGRAM...

NUMBER is '<source> = <value> +- <tolerance>'. The source is either /regex/, whose group is a number in the output
(the last match counts; ^ and $ are ends of lines), or a data set of trajectory.h5 with indices of one element:
'state/position -1,-1,1' is y of the last vertex in the last frame.
"""
import argparse
import math
import os
import re
import shutil
import subprocess
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)) + "/../../python")


def parse(text):
    source, wanted = text.rsplit(" = ", 1)
    value, tolerance = (float(x) for x in wanted.split(" +- "))
    if not tolerance >= 0:
        raise ValueError("negative tolerance")
    if source.startswith("/"):
        if not source.endswith("/") or re.compile(source[1:-1]).groups != 1:
            raise ValueError("a regex needs / at both ends and one group")
    elif len(source.split()) != 2:
        raise ValueError("name a data set and indices")
    return source, value, tolerance


def number(source, output, folder):
    """The present value, or words why there is none."""
    if source.startswith("/"):
        found = re.findall(source[1:-1], output, re.MULTILINE)
        return float(found[-1]) if found else "not in the output"
    if folder is None:
        return "no --output_dir"
    from tendril import Trajectory

    name, indices = source.split()
    try:
        with Trajectory(folder) as t:
            group, _, name = name.rpartition("/")
            values = {"state": t.field, "modes": lambda key: getattr(t.modes, key),
                      "diagnostics": t.diagnostics.__getitem__, "critical": lambda _: t.critical,
                      "": lambda _: t.time}
            return float(values[group](name)[tuple(int(i) for i in indices.split(","))])
    except (KeyError, ValueError, IndexError, TypeError, AttributeError) as e:
        return str(e)


def main():
    if "--" not in sys.argv:
        sys.exit("run_scene.py: no -- PROGRAM")
    split = sys.argv.index("--")
    parser = argparse.ArgumentParser(allow_abbrev=False)
    parser.add_argument("--exit", type=int, default=0)
    parser.add_argument("--scalar", action="append", required=True)
    parser.add_argument("--matches", action="append", default=[])
    parser.add_argument("--never", action="append", default=[])
    parser.add_argument("--output_dir")
    expected = parser.parse_args(sys.argv[1:split])
    try:
        scalars = [parse(s) for s in expected.scalar]
    except ValueError as e:
        parser.error(f"--scalar: {e}")
    command = sys.argv[split + 1 :]
    if expected.output_dir:
        shutil.rmtree(expected.output_dir, ignore_errors=True)  # nothing of a run before counts
        os.makedirs(os.path.dirname(os.path.abspath(expected.output_dir)), exist_ok=True)
        command += ["-output_dir", expected.output_dir]
    print(*command)
    sys.stdout.flush()
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, encoding="utf-8", errors="replace")
    print(run.stdout)
    wrong = []
    if run.returncode != expected.exit:
        wrong.append(f"exit code {run.returncode}, expected {expected.exit}")
    for source, value, tolerance in scalars:
        present = number(source, run.stdout, expected.output_dir)
        if isinstance(present, str):
            wrong.append(f"{source}: {present}")
        elif math.isnan(present) or not abs(present - value) <= tolerance:
            wrong.append(f"{source} = {present!r}, expected {value!r} +- {tolerance!r}")
        else:
            print(f"{source} = {present!r}, off by {present - value:.2g} of {tolerance!r}")
    for regex in expected.matches:
        if not re.search(regex, run.stdout, re.MULTILINE):
            wrong.append(f"/{regex}/ is not in the output")
    for regex in expected.never:
        if re.search(regex, run.stdout, re.MULTILINE):
            wrong.append(f"/{regex}/ is in the output")
    print(*("WRONG: " + w for w in wrong), sep="\n")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
