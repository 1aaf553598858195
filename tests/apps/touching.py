#!/usr/bin/python3
"""What touches, in results: touching.py <tendril> <source folder>. Friction does not depend on the order of rods, though
islands change the one in which they are solved; and in statics forces balance, also those of barriers that bending makes
stiff."""
import os
import subprocess
import sys
import tempfile

import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, source + "/python")
from tendril import Trajectory

folder = tempfile.mkdtemp(prefix="touching")


def run(name, text):
    path = f"{folder}/{name}"
    with open(path + ".yaml", "w") as file:
        file.write(text)
    done = subprocess.run([program, "-scene", path + ".yaml", "-output_dir", path, "-output_fields", "all,touching,reaction",
                           "-snes_rtol", "1e-10"], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return Trajectory(path)


def onRod(touching, rod):
    """Force of all that touches a rod [N]."""
    force = touching["normal_force"] + touching["friction"]
    return force[touching["rod"] == rod].sum(0) - force[touching["to_rod"] == rod].sum(0)


MATERIAL = "material: {radius: 0.004, young: %s, poisson: 0.4, density: 1000}"
RODS = {
    "base": "line: {from: [-0.2, -0.05, 0], to: [-0.1, -0.05, 0], edges: 20}",
    "over": "line: {from: [0, -0.1, 0.0095], to: [0.02, 0.1, 0.0095], edges: 30}, velocity: [0.5, 0, 0]",
    "under": "line: {from: [-0.1, -0.05, 0], to: [0.1, -0.05, 0], edges: 30}",
}


def sliding(order):
    """The rod that slides lies between two that a junction joins, or not."""
    text = ("gravity: [0, 0, -9.81]\nsimulation: {mode: dynamic, dt: 0.002, t_end: 0.06}\n"
            "contact: {rods: others, friction: 0.4, distance: 1e-3}\nrods:\n")
    text += "".join(f"  - {{name: {name}, {RODS[name]}, {MATERIAL % '1e7'}}}\n" for name in order)
    text += ("supports:\n  - {rod: base, vertex: 0, type: clamp}\n  - {rod: under, vertex: last, type: clamp}\n"
             "junctions:\n  - {name: j, type: rigid, members: [{rod: base, vertex: last}, {rod: under, vertex: 0}]}\n")
    with run("_".join(order), text) as t:
        frames = [k for k in range(len(t.time)) if len(t.touching(k)["rod"])]
        assert len(frames) > 3, "little has touched"
        return np.array([onRod(t.touching(k), order.index("over")) for k in frames])


one, other = sliding(("base", "over", "under")), sliding(("base", "under", "over"))
assert one.shape == other.shape and np.abs(one - other).max() < 1e-6 * np.abs(one).max(), (one, other)
assert np.abs(one[:, 0]).max() > 0.1 * np.abs(one[:, 2]).max(), "friction is missing"

for young in ("1e7", "1e10"):
    for friction in (0, 0.4):
        text = (f"gravity: [0, 0, 0]\nsimulation: {{mode: static, load_steps: 4}}\n"
                f"contact: {{bodies: true, friction: {friction}, distance: 5e-4, friction_at: centreline}}\nrods:\n"
                f"  - {{name: top, line: {{from: [0, -0.1, 0.0241], to: [0, 0.1, 0.0241], edges: 40}}, {MATERIAL % young}}}\n"
                "bodies:\n  - {name: crate, box: {size: [0.04, 0.04, 0.04]}, density: 300, position: [0, 0, 0]}\n"
                "joints:\n  - {type: prismatic, child: crate, axis: [0, 0, 1], drive: {stiffness: 2000}}\n"
                "supports:\n  - {rod: top, vertex: 0, type: pin}\n  - {rod: top, vertex: last, type: pin}\n"
                "loads:\n  - {rod: top, vertex: 20, force: [0.02, 0, -0.2]}\n")
        with run(f"body_{young}_{friction}", text) as t:
            rest = onRod(t.touching(-1), 0) + t.field("reaction")[-1].sum(0) + [0.02, 0, -0.2]
            pressed = onRod(t.touching(-1), 0)[2]
            assert pressed > 1e-3, f"E {young}: the rod is pressed by {pressed} N only"
            assert np.abs(rest).max() < 1e-6, f"E {young}, friction {friction}: {rest} N are left of the balance"
            sticks = t.touching(-1)["friction"][:, 0].sum()
            assert (sticks < -1e-4) if friction else sticks == 0, sticks
print("what touches balances, in any order")
