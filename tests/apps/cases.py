#!/usr/bin/python3
"""Every file of options/ is run by a test and says what it is for: cases.py <repository> <test>... Cases are tested as
case.<name>, other files as options.<folder>.<name>."""
import os
import sys

root, tests = sys.argv[1], set(sys.argv[2:])
sample_runs = open(root + "/apps/tendril.cpp").read()
wrong = []
for folder, _, files in os.walk(root + "/options"):
    for file in sorted(files):
        path = os.path.relpath(os.path.join(folder, file), root)
        if file == "README.md":
            continue
        if not file.endswith(".yaml"):
            wrong.append(f"{path}: is no .yaml file, which PETSc knows by its name")
            continue
        parts = path[: -len(".yaml")].split("/")[1:]
        test = "case." + parts[1] if parts[0] == "cases" else "options." + ".".join(parts)
        if test not in tests:
            wrong.append(f"{path}: there is no test {test} in tests/CMakeLists.txt")
        text = open(os.path.join(folder, file)).read()
        if not text.startswith("# "):
            wrong.append(f"{path}: does not begin with a comment that says what it is for")
        if parts[0] == "cases" and f"#   build/bin/tendril -options_file {path}\n" not in text:
            wrong.append(f"{path}: has no line with its command")
for word in sample_runs.split():
    if word.startswith("options/") and not os.path.exists(os.path.join(root, word)):
        wrong.append(f"apps/tendril.cpp: {word} does not exist")
if "options/cases/" not in sample_runs:
    wrong.append("apps/tendril.cpp: shows no case")
print(*wrong, sep="\n")
sys.exit(bool(wrong))
