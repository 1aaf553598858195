#!/usr/bin/python3
"""Runs docs/tutorial.md as it stands: tutorial.py <tendril> <repository> [--pictures]

One shell, in an empty folder that looks like the root of a built repository, gets every block of the page in order:
`yaml` and `python` are saved under the name in their first line, `sh` is run, every command with exit code 0. Of each
job (a heading "## n. ..."):
- lines of `text` blocks are lines of its output, in this order; `...` stands for anything, numbers are those printed to
  one in the last decimal of the page, which is what rounding may change, and whole numbers are the same;
- `name = value +- tolerance` in its words is the number behind the name, the last one in its output; every job has one;
- its pictures figures/<name> have been made as <name>, in the size of that of docs/figures/.
--pictures puts what was made there.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time

import matplotlib.image

from run_scene import number, parse

program, root = (os.path.abspath(p) for p in sys.argv[1:3])
NUMBER = r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
MARK = "@@ job "
wrong = []


def blocks(text):
    """Pairs of the word behind ``` and the lines between, and what is left of the text."""
    pattern = r"^```(\w*)\n(.*?)^```$"
    return re.findall(pattern, text, re.M | re.S), re.sub(pattern, "", text, flags=re.M | re.S)


def script(jobs):
    """The whole page for bash."""
    lines = ["set -euo pipefail"]
    for job, text in enumerate(jobs):
        lines.append(f"echo '{MARK}{job}'")
        for kind, body in blocks(text)[0]:
            if kind in ("yaml", "python"):
                name = re.match(r"# ([\w.]+)\n", body)
                if not name:
                    sys.exit(f"{kind} block without a name in its first line:\n{body}")
                lines.append(f"cat > {name[1]} <<'@@'\n{body}@@")
            elif kind == "sh":
                lines.append(body)
            elif kind != "text":
                sys.exit(f"what is a block of '{kind}'?")
    return "\n".join(lines) + "\n"


def same(line, printed):
    """Whether a line of the page is this line of the output."""
    words = re.split(rf"(\.\.\.|{NUMBER})", line)
    pattern = "".join(".*" if w == "..." else f"({NUMBER})" if i % 2 else re.escape(w) for i, w in enumerate(words))
    found = re.fullmatch(pattern, printed)
    return bool(found) and all(near(*pair) for pair in zip((w for w in words[1::2] if w != "..."), found.groups()))


def near(written, printed):
    digits, _, power = written.lower().partition("e")
    decimals = len(digits.partition(".")[2])
    last = 10.0 ** (int(power or 0) - decimals) if decimals or power else 0
    return abs(float(written) - float(printed)) <= 1.001 * last


def check(job, output, folder):
    found, words = blocks(job)
    title = words.splitlines()[0]
    lines = iter(output.splitlines())
    for line in (l for kind, body in found if kind == "text" for l in body.splitlines() if l != "..."):
        if not any(same(line, printed) for printed in lines):
            wrong.append(f"{title}: not in the output, or not here: {line}")
            break
    expected = re.findall(r"`([^`]+?) = (\S+) \+- (\S+)`", words.replace("\n", " "))
    if not expected:
        wrong.append(f"{title}: expects no number")
    for name, value, tolerance in expected:
        source, value, tolerance = parse(f"/{re.escape(name)}[ :=]*({NUMBER})/ = {value} +- {tolerance}")
        present = number(source, output, None)
        if isinstance(present, str) or not abs(present - value) <= tolerance:
            wrong.append(f"{title}: {name} is {present}, expected {value} +- {tolerance}")
        else:
            print(f"{title}: {name} = {present}, off by {present - value:.2g} of {tolerance}")
    for picture in re.findall(r"!\[[^\]]*\]\(figures/([^)]+)\)", words):
        made, shown = f"{folder}/{picture}", f"{root}/docs/figures/{picture}"
        if "--pictures" in sys.argv:
            shutil.copyfile(made, shown)
        made, shown = (matplotlib.image.imread(p) for p in (made, shown))
        if made.shape[:2] != shown.shape[:2] or made.std() == 0:
            wrong.append(f"{title}: {picture} is empty, or of another size than in docs/figures")


page = re.split(r"^(?=## \d+\.)", open(root + "/docs/tutorial.md").read(), flags=re.M)
with tempfile.TemporaryDirectory() as folder:
    os.mkdir(folder + "/build")
    for there, here in ((os.path.dirname(program), "build/bin"), (root + "/scripts", "scripts"), (root + "/python", "python")):
        os.symlink(there, f"{folder}/{here}")
    with open(folder + "/page", "w") as f:
        f.write(script(page))
    start = time.time()
    run = subprocess.run(["bash", folder + "/page"], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                         stderr=subprocess.STDOUT, encoding="utf-8", errors="replace")
    outputs = re.split(f"^{MARK}\\d+\n", run.stdout, flags=re.M)[1:]
    if run.returncode:
        sys.exit(f"{run.stdout}exit code {run.returncode} in job {len(outputs) - 1}")
    for job, output in zip(page[1:], outputs[1:]):
        check(job, output, folder + "/out/afternoon")
    print(f"{time.time() - start:.1f} s")
if wrong:
    print(run.stdout, *wrong, sep="\n")
sys.exit(bool(wrong))
