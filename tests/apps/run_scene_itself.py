#!/usr/bin/python3
"""That tests can fail: run_scene_itself.py <cmake>. A run with a wrong exit code, a wrong or a missing number or wrong
words is no success; a run of which no number is expected, or a test that goes past the helper, is refused at configure
time."""
import os
import subprocess
import sys
import tempfile

here = os.path.dirname(os.path.abspath(__file__))
good = ["--scalar=/load ([0-9.]+)/ = 2.5 +- 0.01", "--matches=^load", "--never=failed"]


def result(expected, script="echo load 1; echo load 2.501"):
    command = [sys.executable, here + "/run_scene.py", *expected, "--", "/bin/sh", "-c", script]
    return subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode


assert result(good) == 0
assert result(good, "echo load 2.501; exit 3") != 0, "exit code"
assert result(good + ["--exit", "3"], "echo load 2.501; exit 3") == 0
assert result(good + ["--exit", "3"]) != 0, "exit code"
assert result(good, "echo load 2.52") != 0, "wrong number"
assert result(good, "echo load") != 0, "no number"
assert result(good, "echo load 2.5 failed") != 0, "word that must not be"
assert result(good, "echo a load 2.5") != 0, "missing word"
assert result(good[1:]) != 0, "no number expected"
assert result(["--scalar=state/position -1,-1,0 = 0 +- 1"]) != 0, "no file"
for text in ("load = 1", "/load/ = 1 +- 1", "/(a)(b)/ = 1 +- 1", "/(a)/ = 1 +- -1", "state/position = 1 +- 1"):
    assert result(["--scalar=" + text], "echo a") != 0, text

number = 'SCALAR "/(1)/ = 1 +- 0"'
for lines, fine in (
    (f"add_run(a COMMAND echo 1 {number})\nadd_script(b echo)", True),
    ("add_run(a COMMAND echo 1)", False),
    (f"add_run(a {number})", False),
    (f"add_run(a COMMAND echo 1 {number})\nset_tests_properties(a PROPERTIES PASS_REGULAR_EXPRESSION 1)", False),
    (f"add_run(a COMMAND echo 1 {number})\nset_tests_properties(a PROPERTIES WILL_FAIL TRUE)", False),
    ("add_test(NAME a COMMAND echo 1)", False),
):
    with tempfile.TemporaryDirectory() as tmp:
        with open(tmp + "/CMakeLists.txt", "w") as f:
            f.write("cmake_minimum_required(VERSION 3.25)\nproject(p LANGUAGES NONE)\nenable_testing()\n")
            f.write(f"include({here}/../cmake/runs.cmake)\n{lines}\n")
        run = subprocess.run([sys.argv[1], "-S", tmp, "-B", tmp + "/build"], capture_output=True, text=True)
        assert (run.returncode == 0) == fine, lines + "\n" + run.stdout + run.stderr
        if fine:
            tests = subprocess.run(["ctest", "--test-dir", tmp + "/build"], capture_output=True, text=True)
            assert tests.returncode == 0, tests.stdout
