#!/usr/bin/python3
"""scripts/sweep: its table, orders, resumption after kills, failures, ranks, parts and mistakes:
sweep.py <tendril> <source folder> [<kills>]."""
import csv
import glob
import os
import random
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

program, root = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
kills = int(sys.argv[3]) if len(sys.argv) > 3 else 6
elastica, cantilever = root + "/data/scenes/elastica.yaml", root + "/data/scenes/cantilever.yaml"


def command(*words):
    return [root + "/scripts/sweep", *map(str, words), "--program", program]


def run(code, *words):
    done = subprocess.run(command(*words), capture_output=True, text=True, timeout=120)
    assert done.returncode == code, (words, done.returncode, done.stdout[-800:], done.stderr[-800:])
    return done.stdout + done.stderr


def table(out):
    with open(out + "/table.csv") as file:
        return list(csv.DictReader(file))


def refines(tmp):
    """Edges and a key of the scene in all combinations; second order is observed; nothing runs twice."""
    words = (elastica, "-rod_edges", "8,16,32", "rods[0].measure=tan,angle", "--observe", "tip=position[-1,-1]", "--observe",
             "its=sum(newton_iterations)", "--out", tmp + "/a", "-j", 2)
    text = run(0, *words)
    rows = table(tmp + "/a")
    assert [(r["rod_edges"], r["rods[0].measure"]) for r in rows] == [(e, m) for e in ("8", "16", "32") for m in ("tan", "angle")]
    assert all(r["exit_code"] == "0" and float(r["its"]) == float(r["newton_iterations"]) >= 3 for r in rows), rows
    with open(tmp + "/a/orders.csv") as file:
        orders = {(r["others"], r["observable"]): float(r["order"]) for r in csv.DictReader(file)}
    assert abs(orders["angle", "tip_0"] - 2) < 0.1 and abs(orders["angle", "tip_1"] - 2) < 0.1, orders
    with h5py.File(tmp + "/a/sweep.h5") as file:
        assert np.allclose(file["tip_1"][:], [float(r["tip_1"]) for r in rows]) and list(file["rod_edges"]) == [8, 8, 16, 16, 32, 32]
    assert os.path.getsize(tmp + "/a/sweep.png") > 5000
    before = open(tmp + "/a/table.csv").read()
    again = run(0, *words)
    assert "6 runs, 6 of them there already" in again and open(tmp + "/a/table.csv").read() == before, again
    # Another value needs its own runs only.
    more = run(0, *[w if w != "8,16,32" else "8,16,32,64" for w in words])
    assert "8 runs, 6 of them there already" in more, more


def zips(tmp):
    """Values that vary together; ranges; vectors; aliases of the scene that become two."""
    run(0, elastica, "-rod_edges", "8,16", "-gravity", "0,0,0;0,-1,0", "--zip", "rod_edges,gravity", "--out", tmp + "/b")
    assert [(r["rod_edges"], r["gravity"]) for r in table(tmp + "/b")] == [("8", "0,0,0"), ("16", "0,-1,0")]
    run(0, cantilever, "-dt", "1e-2:2.5e-3:3log", "-t_end", "0.05", "--observe", "x=position[-1,-1,0]", "--out", tmp + "/c")
    assert [float(r["dt"]) for r in table(tmp + "/c")] == [0.01, 0.005, 0.0025] and [float(r["steps"]) for r in table(tmp + "/c")] == [5, 10, 20]


def fails(tmp):
    """A run that fails is told with the program's words, and is not run again unless asked for."""
    words = (elastica, "-rod_edges", "16,-3", "--out", tmp + "/d")
    text = run(1, *words)
    bad = table(tmp + "/d")[1]
    assert bad["exit_code"] == "1" and "-rod_edges" in bad["reason"] and "failed: " + bad["run"] in text, (bad, text)
    assert "2 of them there already" in run(1, *words) and "1 of them there already" in run(1, *words, "--retry")


def resumes(tmp):
    """Killed at random and started again: the table of a sweep that nothing disturbed."""
    words = (cantilever, "-t_end", "0.2", "-rod_young", "1e6:1e8:5log", "-dt", "2e-3,1e-3", "--observe", "tip=position[-1,-1]", "-j", 2)
    run(0, *words, "--out", tmp + "/whole")
    rng = random.Random(5)
    for kill in range(kills):
        process = subprocess.Popen(command(*words, "--out", tmp + "/killed"), stdout=subprocess.DEVNULL, start_new_session=True)
        time.sleep(rng.uniform(0.3, 1.5))
        process.send_signal(signal.SIGKILL)
        process.wait()
        for _ in range(20):
            left = subprocess.run(["pgrep", "-af", tmp + "/killed"], capture_output=True, text=True).stdout
            if left == "":
                break
            time.sleep(0.1)
        assert left == "", f"runs go on without their sweep: {left}"
    there = len(glob.glob(tmp + "/killed/*/result.json"))
    text = run(0, *words, "--out", tmp + "/killed")
    assert f"10 runs, {there} of them there already" in text, text
    assert open(tmp + "/killed/table.csv").read() == open(tmp + "/whole/table.csv").read()


def exact(tmp):
    """Errors against what is known, and their orders: the elastica of 128 edges for the truth, to 1/16 of the error of 32."""
    run(0, elastica, "-rod_edges", "128", "--observe", "tip=position[-1,-1]", "--out", tmp + "/fine")
    tip = ",".join(table(tmp + "/fine")[0][f"tip_{k}"] for k in range(3))
    run(0, elastica, "-rod_edges", "8,16,32", "--observe", "tip=position[-1,-1]", "--exact", "tip=" + tip, "--out", tmp + "/coarse")
    errors = [float(r["tip_error"]) for r in table(tmp + "/coarse")]
    assert errors[0] > errors[1] > errors[2] > 1e-5, errors
    with open(tmp + "/coarse/orders.csv") as file:
        order = next(float(r["order"]) for r in csv.DictReader(file) if r["observable"] == "tip_error")
    assert abs(order - 2) < 0.2, order


def ranks(tmp):
    """The same numbers from runs of two ranks."""
    words = (root + "/data/scenes/many_rods.yaml", "-rod_edges", "10,20", "-t_end", "0.02", "--observe", "tip=position[-1,-1]")
    run(0, *words, "--out", tmp + "/one")
    run(0, *words, "--mpi", 2, "--out", tmp + "/two")
    one, two = table(tmp + "/one"), table(tmp + "/two")
    assert [{**r, "run": ""} for r in one] == [{**r, "run": ""} for r in two], (one, two)
    with open(glob.glob(tmp + "/two/*/run/log.txt")[0]) as file:
        assert "ranks: 2, " in file.read()


def parts(tmp):
    """Jobs of Slurm that do a part each; the script is run as Slurm would, by hand."""
    words = (elastica, "-rod_edges", "8,16,24,32,40", "--observe", "tip=position[-1,-1]", "--out", tmp + "/jobs")
    text = run(0, *words, "--slurm", 2)
    assert "sbatch " + tmp + "/jobs/sweep.sbatch" in text and not glob.glob(tmp + "/jobs/*/result.json"), text
    for job, there in ((1, 3), (2, 5)):
        done = subprocess.run(["bash", tmp + "/jobs/sweep.sbatch"], env={**os.environ, "SLURM_ARRAY_TASK_ID": str(job)}, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, done.stdout + done.stderr
        assert len(glob.glob(tmp + "/jobs/*/result.json")) == there and not os.path.exists(tmp + "/jobs/table.csv")
    assert "5 runs, 5 of them there already" in run(0, *words) and len(table(tmp + "/jobs")) == 5


def mistakes(tmp):
    for words, told in (
            ([], "which scene"), ([tmp + "/none.yaml"], "cannot be read"), ([elastica, "-rod_edgs", "1,2"], "-rod_edgs"),
            ([elastica, "-dtt", "1"], "no such option"), ([elastica, "-dt", "1,,2"], "empty value"), ([elastica, "-dt", "1,1"], "twice"),
            ([elastica, "-dt", "0:1:3log"], "one sign"), ([elastica, "-dt", "1:2:1"], "2 values"), ([elastica, "-dt", "a:2:3"], "no range"),
            ([elastica, "rods[3].measure=tan"], "no entry 3"), ([elastica, "rods..measure=tan"], "no path"),
            ([elastica, "--observe", "tip"], "NAME=WHAT"), ([elastica, "--observe", "tip=position[-1,-1"], "is a field with its indices"),
            ([elastica, "--observe", "tip=positon[-1,-1]"], "position"), ([elastica, "--observe", "tip=position[-1,99999]"], "tip=position[-1,99999]"),
            ([elastica, "--zip", "dt,t_end", "-dt", "1,2"], "t_end does not vary"),
            ([elastica, "--zip", "dt,t_end", "-dt", "1,2", "-t_end", "1,2,3"], "-t_end has 3"), ([elastica, "-j", "0"], "whole number"),
            ([elastica, "--mpi", "two"], "--mpi two"), ([elastica, "--part", "3/2"], "K from 1 to N"), ([elastica, "--slurm", "-1"], "number of jobs"), ([elastica, "--slurm", "2", "--part", "1/2"], "take --part away"),
            ([elastica, "--observe", "tip=position[-1,-1]", "--exact", "tip=nan,0,0"], "NAME=NUMBERS"), ([elastica, "-rod_edgess", "3"], "-rod_edgess"),
            ([elastica, "--part", "1/2", "-rod_edges", "8,9", "--observe", "tip=positon[-1,-1]"], "positon"),
            ([elastica, "--exact", "tip=1"], "that of an --observe"), ([elastica, "--observe", "tip=position[-1,-1]", "--exact", "tip=1"], "3 numbers"),
            ([elastica, "--outt", "x"], "--outt"), ([elastica, "-output_dir", "x"], "not for a sweep"), ([elastica, "other.yaml"], "other.yaml")):
        text = run(1, *words, "--out", tmp + "/e")
        assert told in text and "Traceback" not in text, (words, text)


for test in (mistakes, refines, zips, fails, exact, ranks, parts, resumes):
    with tempfile.TemporaryDirectory() as folder:
        test(folder)
print("sweeps come to their tables")
