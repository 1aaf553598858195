#!/usr/bin/python3
"""What the table of keys promises: keys.py <tendril> <source folder>. Defaults are those in force, completion completes."""
import json
import os
import subprocess
import sys
import tempfile

import yaml

program, root = os.path.abspath(sys.argv[1]), sys.argv[2]
keys = {k["path"]: k for k in json.loads(subprocess.run([program, "-keys"], capture_output=True, text=True, check=True).stdout)}


def defaults():
    """options.yaml of a run without options has the fallbacks of the table."""
    compared = 0
    for mode, left_out in (("dynamic", ("load_steps",)), ("static", ("dt", "t_end"))):
        with tempfile.TemporaryDirectory() as folder:
            with open(f"{folder}/s.yaml", "w") as f:
                f.write("rods: [{line: {from: [0, 0, 0], to: [0, -1, 0], edges: 4}}]\nsupports: [{vertex: 0, type: clamp}]\n")
                f.write(f"simulation: {{mode: {mode}}}\n")
            subprocess.run([program, "-scene", "s.yaml"], cwd=folder, check=True, capture_output=True)
            with open(f"{folder}/out/options.yaml") as f:
                found = yaml.safe_load(f)
        for name, value in found.items():
            key = keys.get("-" + name)
            scene = keys.get("simulation." + name, {"fallback": "("})
            text = scene["fallback"] if not scene["fallback"].startswith("(") else key["fallback"] if key else "("
            if name in left_out + ("output_fields", "mode", "gravity") or text.startswith("(") or text == "required":
                continue
            try:
                same = float(value) == float(text) and not isinstance(value, bool)
            except (TypeError, ValueError):
                same = False
            same = same or str(value).lower() == text
            assert same, f"{mode}: options.yaml has {name}: {value}, the table says {text}"
            compared += 1
    assert compared > 15, f"only {compared} defaults were compared"


def complete(*words):
    """What bash completes the last of some words to."""
    quoted = " ".join(f"'{w}'" for w in words)
    script = f"source {root}/scripts/completion.bash; COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _tendril; echo ${{COMPREPLY[@]}}"
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split()


defaults()
assert complete("tendril", "-integ") == ["-integrator"]
assert complete("tendril", "-integrator", "") == keys["-integrator"]["choices"].split("|")
assert complete("tendril", "-rod_you") == ["-rod_young"]
assert "tests" in complete("tendril", "-scene", os.path.join("te")) or not os.path.isdir("tests")
