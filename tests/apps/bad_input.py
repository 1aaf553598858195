#!/usr/bin/python3
"""Every mistake ends before the first step, with a message that names the place: bad_input.py <tendril>."""
import os
import subprocess
import sys
import tempfile

program = os.path.abspath(sys.argv[1])
base = """gravity: [0, -9.81, 0]
simulation: {dt: 0.01, t_end: 0.02}
rods:
  - name: a
    line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}
    material: {radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}
supports:
  - {vertex: 0, type: clamp}
"""
shape = "line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}"

# name, (old, new) edit of the base scene or None, options, parts of the message
rows = [
    ("unknown key", ("gravity:", "gravitty:"), [], ["scene.yaml:1", "gravitty", "did you mean 'gravity'"]),
    ("unknown key in a rod", ("name: a", "nam: a"), [], ["scene.yaml:4", "'nam'", "name"]),
    ("unknown key in a material", ("young", "yuong"), [], ["scene.yaml:6", "young"]),
    ("unknown key in a support", ("type: clamp", "type: clamp, colour: red"), [], ["scene.yaml:8", "colour"]),
    ("wrong type", ("young: 1e7", "young: stiff"), [], ["scene.yaml:6", "'young' must be a number", "'stiff'"]),
    ("rubbish after a number", ("1e7", "1e7Pa"), [], ["scene.yaml:6", "1e7Pa"]),
    ("list for a number", ("young: 1e7", "young: [1, 2]"), [], ["scene.yaml:6", "a list of 2"]),
    ("number for a list", ("[0, -9.81, 0]", "9.81"), [], ["scene.yaml:1", "list of 3 numbers"]),
    ("not finite", ("-9.81", ".nan"), [], ["scene.yaml:1", "finite"]),
    ("infinite", ("1e7", ".inf"), [], ["scene.yaml:6", "finite"]),
    ("negative stiffness", ("1e7", "-1e7"), [], ["scene.yaml:6", "greater than zero"]),
    ("negative density", ("density: 1000", "density: -1"), [], ["scene.yaml:6", "greater than zero"]),
    ("Poisson's ratio", ("0.3", "0.7"), [], ["scene.yaml:6", "poisson"]),
    ("zero-length edge", (shape, "points: [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]]"), [], ["scene.yaml:4", "edge 1", "zero length"]),
    ("folded edges", (shape, "points: [[0, 0, 0], [1, 0, 0], [0.2, 0, 0]]"), [], ["scene.yaml:4", "folds back", "vertex 1"]),
    ("director not normal", (shape, shape + "\n    director: [1, 1, 0]"), [], ["scene.yaml:6", "not normal"]),
    ("number of directors", (shape, shape + "\n    directors: [[0, 1, 0]]"), [], ["scene.yaml:6", "one vector per edge"]),
    ("vertex out of range", ("vertex: 0", "vertex: 9"), [], ["scene.yaml:8", "out of range", "0 to 4"]),
    ("negative vertex", ("vertex: 0", "vertex: -1"), [], ["scene.yaml:8", "at least 0"]),
    ("unknown rod", ("{vertex: 0", "{rod: b, vertex: 0"), [], ["scene.yaml:8", "no rod 'b'"]),
    ("held twice", ("  - {vertex: 0, type: clamp}", "  - {vertex: 0, type: clamp}\n  - {vertex: 0, type: pin}"), [], ["scene.yaml:9", "held twice"]),
    ("no shape", (shape, "closed: false"), [], ["scene.yaml:4", "exactly one shape"]),
    ("poisson and shear", ("poisson: 0.3", "poisson: 0.3, shear: 1e6"), [], ["scene.yaml:6", "not both"]),
    ("missing polyline", (shape, "file: nowhere.csv"), [], ["nowhere.csv", "cannot be opened"]),
    ("bad polyline", (shape, "file: bad.csv"), [], ["bad.csv:2", "'x' is not a number"]),
    ("not YAML", ("rods:", "rods: ]"), [], ["scene.yaml:3", "not valid YAML"]),
    ("missing scene", None, ["-scene", "nowhere.yaml"], ["nowhere.yaml", "cannot be opened"]),
    ("unknown option", None, ["-dtt", "1"], ["-dtt", "unknown"]),
    ("misspelt override", None, ["-rod_yuong", "1e6"], ["-rod_yuong", "did you mean -rod_young"]),
    ("override not a number", None, ["-rod_young", "abc"], ["-rod_young", "'abc'"]),
    ("negative override", None, ["-rod_young", "-1"], ["-rod_young", "greater than zero"]),
    ("zero step", None, ["-dt", "0"], ["-dt", "greater than zero"]),
    ("negative end", None, ["-t_end", "-1"], ["-t_end", "greater than zero"]),
    ("load steps in dynamics", None, ["-load_steps", "3"], ["-load_steps", "no meaning"]),
    ("step in statics", None, ["-mode", "static", "-dt", "0.1"], ["-dt", "no meaning"]),
    ("unknown field", None, ["-output_fields", "colour"], ["-output_fields", "colour"]),
    ("gravity of two", None, ["-gravity", "0,1"], ["-gravity", "three numbers"]),
    ("unwritable folder", None, ["-output_dir", "file/out"], ["-output_dir", "cannot be written"]),
    ("free rod in statics", ("supports:\n  - {vertex: 0, type: clamp}\n", ""), ["-mode", "static"], ["free to move"]),
]

failures = 0
for name, edit, options, parts in rows:
    with tempfile.TemporaryDirectory() as tmp:
        text = base
        if edit:
            assert edit[0] in text, (name, edit[0])
            text = text.replace(edit[0], edit[1], 1)
        open(tmp + "/scene.yaml", "w").write(text)
        open(tmp + "/bad.csv", "w").write("0,0,0\n1,x,0\n")
        open(tmp + "/file", "w").write("")
        command = [program]
        if "-scene" not in options:
            command += ["-scene", "scene.yaml"]
        run = subprocess.run(command + options, cwd=tmp, capture_output=True, text=True)
        wrong = [p for p in parts if p not in run.stderr]
        if run.returncode != 1:
            wrong.append(f"exit code {run.returncode}")
        if any("trajectory.h5" in files for _, _, files in os.walk(tmp)):
            wrong.append("a trajectory was begun")
        if wrong:
            failures += 1
            print(f"{name}: missing {wrong}\n    {run.stderr.strip()[:400]}")
help_text = subprocess.run([program, "-help"], capture_output=True, text=True)
for option in "scene mode dt dt_min t_end load_steps gravity output_dir output_interval output_fields retraction stretch rod_young rod_measure".split():
    if f"-{option}" not in help_text.stdout or help_text.returncode != 0:
        failures += 1
        print("-help does not list", option)
print(len(rows), "mistakes,", failures, "not told well")
sys.exit(failures > 0)
