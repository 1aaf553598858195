#!/usr/bin/python3
"""Models of rods as runs: models.py <tendril>. Planar rods that buckle go on as full ones, restarts find out, and
-model_check proves what was chosen."""
import os
import subprocess
import sys
import tempfile

import h5py
import numpy as np

program = os.path.abspath(sys.argv[1])

COLUMN = """gravity: {gravity}
simulation: {{mode: static, load_steps: 10}}
rods:
  - line: {{from: [0, 0, 0], to: [0, 1, 0], edges: 32}}
    director: [0, 0, 1]
    material: {{linear_density: 1, axial_stiffness: 1e6, torsional_stiffness: 1, flexural_stiffness: [{out}, {within}]}}
supports: [{{vertex: 0, type: clamp}}]
"""
HEAD = "loads: [{vertex: last, force: [0, -4, 0]}]\n"


def run(folder, text, *options, code=0, output="out"):
    with open(f"{folder}/scene.yaml", "w") as f:
        f.write(text)
    done = subprocess.run([program, "-scene", "scene.yaml", "-output_dir", output, *options], cwd=folder, capture_output=True, text=True)
    assert done.returncode == code, f"{options}: exit code {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout + done.stderr


def read(folder, output="out"):
    with h5py.File(f"{folder}/{output}/trajectory.h5") as f:
        critical = f["critical/load_factor"][:] if "critical" in f else np.zeros(0)
        return f["state/position"][-1], critical


def buckling():
    """Columns buckle where full ones do, and go on as these. Euler's load pi^2/4 and
    Greenhill's 7.837 (Greenhill 1881), each over the load of the scene; the edges' error is 2e-4 at 32 of them."""
    weight = "[0, -10, 0]"
    cases = (
        ("Euler, round", COLUMN.format(gravity="[0, 0, 0]", out=1, within=1) + HEAD, np.pi**2 / 16),
        ("Euler, in the plane", COLUMN.format(gravity="[0, 0, 0]", out=3, within=1) + HEAD, np.pi**2 / 16),
        ("Euler, out of it", COLUMN.format(gravity="[0, 0, 0]", out=1, within=3) + HEAD, np.pi**2 / 16),
        ("Greenhill, round", COLUMN.format(gravity=weight, out=1, within=1), 7.837347 / 10),
        ("Greenhill, out of the plane", COLUMN.format(gravity=weight, out=1, within=3), 7.837347 / 10),
    )
    for name, text, factor in cases:
        with tempfile.TemporaryDirectory() as folder:
            told = run(folder, text, "-model", "auto")
            assert "model auto: planar" in told and "go on as full ones" in told, f"{name}:\n{told}"
            x, critical = read(folder)
            run(folder, text, "-model", "full", output="full")
            full, of_full = read(folder, "full")
            assert len(critical) == len(of_full) and np.allclose(critical, of_full, atol=1e-7), f"{name}: {critical} {of_full}"
            assert abs(critical[0] - factor) < 1e-3 * factor, f"{name}: {critical[0]}, not {factor}"
            aside = np.hypot(full[:, 0], full[:, 2]).max()
            assert aside > 0.1 and np.abs(x - full).max() < 1e-6, f"{name}: {np.abs(x - full).max()}"


def restarts():
    """A state out of its plane goes on in space where the model is chosen, and is refused where it is not."""
    text = COLUMN.format(gravity="[0, -10, 0]", out=1, within=1).replace("mode: static, load_steps: 10", "mode: dynamic, dt: 0.01, t_end: 0.2")
    with tempfile.TemporaryDirectory() as folder:
        run(folder, text.replace("[0, -10, 0]", "[1, -10, 1]"), "-model", "full")
        told = run(folder, text, "-model", "auto", "-restart", "out", "-t_end", "0.3", output="on")
        assert "go on as full ones" in told, told
        x, _ = read(folder, "on")
        assert min(np.abs(x[:, 0]).max(), np.abs(x[:, 2]).max()) > 1e-4, "the rod has come back to a plane"
        told = run(folder, text, "-model", "planar", "-restart", "out", "-t_end", "0.3", code=1, output="no")
        assert "begins out of its plane" in told, told
    # Twisted by a torque, let go and pulled aside: a strip that twists bends aside.
    strip = text.replace("[0, -10, 0]", "[10, 0, 0]").replace("flexural_stiffness: [1, 1]", "flexural_stiffness: [1, 0.02]")
    strip = strip.replace("linear_density: 1,", "linear_density: 1, linear_rotational_inertia: 0.03,")  # so that it takes its time
    held = strip.replace("[10, 0, 0]", "[0, 0, 0]").replace("mode: dynamic, dt: 0.01, t_end: 0.2", "mode: static") + "loads: [{edge: last, torque: 1}]\n"
    with tempfile.TemporaryDirectory() as folder:
        run(folder, held, "-model", "full", output="twisted")
        again = ("-restart", "twisted", "-restart_time", "0")
        run(folder, strip, "-model", "full", *again, output="full")
        full, _ = read(folder, "full")
        told = run(folder, strip, "-model", "auto", *again, output="on")
        assert "turned about its tangent" in told and "go on as full ones" in told, told
        apart = np.abs(read(folder, "on")[0] - full).max()
        assert np.abs(full[:, 2]).max() > 1e-3 and apart < 1e-9, (np.abs(full[:, 2]).max(), apart)
        told = run(folder, strip, "-model", "planar", *again, output="no", code=1)
        assert "turned about its tangent" in told, told
        round_rod = text.replace("[0, -10, 0]", "[1, 0, 1]").replace("linear_density: 1,", "linear_density: 1, linear_rotational_inertia: 0,")
        told = run(folder, round_rod, "-model", "torsion_free", *again, output="no", code=1)
        assert "begins twisted" in told, told


def accuracies():
    """Edges that were chosen for planar rods are not those of rods that buckle: the run says so and ends."""
    text = COLUMN.format(gravity="[0, 0, 0]", out=1, within=0.01) + "loads: [{vertex: last, force: [0.5, -0.01, 0]}]\n"
    text = text.replace("torsional_stiffness: 1", "torsional_stiffness: 0.01")  # the strip lies in the plane z = 0, on edge
    with tempfile.TemporaryDirectory() as folder:
        told = run(folder, text, "-model", "auto", "-accuracy", "1e-3", code=2)
        assert "lose their stability" in told and "take -model full" in told, told


def proofs():
    text = COLUMN.format(gravity="[3, 0, 0]", out=1, within=1)
    with tempfile.TemporaryDirectory() as folder:
        told = run(folder, text, "-model", "auto", "-model_check")
        assert "model check: full rods end" in told, told
        told = run(folder, text, "-model", "cable", "-model_check", code=2)
        assert "take -model full" in told, told
        told = run(folder, text, "-model", "auto", "-model_check", "-continuation", "arclength", code=1)
        assert "-model_check" in told, told


def frequencies():
    """Planar rods have the modes of full ones in their plane: of a strip that sags, the first is out of it."""
    text = COLUMN.format(gravity="[3, 0, 0]", out=1, within=1).replace("mode: static, load_steps: 10", "mode: static")
    text = text.replace("linear_density: 1,", "linear_density: 1, linear_rotational_inertia: 0,")
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for model in ("full", "planar"):
            run(folder, text, "-model", model, "-mode", "modes", "-modes", "4", output=model)
            with h5py.File(f"{folder}/{model}/trajectory.h5") as f:
                found[model] = f["modes/frequency"][:]
    of_plane = found["planar"][:2]
    assert np.allclose(of_plane, [found["full"][np.abs(found["full"] - w).argmin()] for w in of_plane], rtol=1e-7), found
    assert found["full"][0] < of_plane[0] * (1 - 1e-3), found
    # A rod and a body that nothing holds are at rest as drawn: six motions cost nothing.
    free = text.replace("[3, 0, 0]", "[0, 0, 0]").replace("supports: [{vertex: 0, type: clamp}]", "constraints: [{type: weld, body: hub, vertex: 0}]")
    with tempfile.TemporaryDirectory() as folder:
        run(folder, free + "bodies: [{name: hub, sphere: {radius: 0.05}, density: 1000}]\n", "-mode", "modes", "-modes", "8")
        with h5py.File(f"{folder}/out/trajectory.h5") as f:
            frequency = f["modes/frequency"][:]
    assert np.all(frequency[:6] == 0) and np.all(frequency[6:] > 0.1), frequency


buckling()
restarts()
accuracies()
proofs()
frequencies()
print("models hold")
