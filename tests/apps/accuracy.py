#!/usr/bin/python3
"""Estimated errors as the program tells and writes them: accuracy.py <tendril> <source folder>."""
import os
import re
import subprocess
import sys
import tempfile

import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, source + "/python")
from tendril import Trajectory

exact = np.array([0.61237163927557, -0.713791523611913, 0])  # data/reference/elastica_tip_load.csv, load 5; of the scene elastica.yaml


def tendril(scene, out, *options, check=True):
    path = scene if os.path.isabs(scene) else f"{source}/data/scenes/{scene}.yaml"
    return subprocess.run([program, "-scene", path, "-output_dir", out, *options], check=check, capture_output=True, text=True)


def run(scene, *options):
    with tempfile.TemporaryDirectory() as out:
        text = tendril(scene, out, *options).stdout
        with Trajectory(out) as t:
            estimate, position = t.estimate, t.field("position")[-1]
        log, effective = open(out + "/log.txt").read(), open(out + "/options.yaml").read()
    assert all(line in log for line in text.splitlines() if "estimate" in line and "command" not in line), "the log misses a line"
    return text, effective, position, estimate


text, effective, x, estimate = run("elastica", "-error_estimate")
assert "estimated error: position" in text and "bend energy" in text, text
assert estimate["position"].shape == x.shape and estimate["error"].shape == x.shape[:1]
error = np.linalg.norm(x[-1] - exact)
# The scene stretches by EI/(EA L^2) = 1e-8.
assert abs(estimate["error"][-1] / error - 1) < 0.01 and np.linalg.norm(estimate["position"][-1] - exact) < error / 40, estimate["error"][-1] / error
assert estimate["valid"] == 1 and estimate["position_error"] == estimate["error"].max()
assert "error_estimate: true" in effective
print("elastica: error", error, "estimated", estimate["error"][-1], "extrapolated", np.linalg.norm(estimate["position"][-1] - exact))

text, effective, x, estimate = run("elastica", "-accuracy", "1e-3", "-accuracy_of", "tip", "-error_estimate")
edges = len(x) - 1
assert f"edges {edges} for 0.001: estimated error of the tip" in text, text
assert re.search(rf"edges: {edges}\n", effective) and "accuracy: 0.001" in effective and "accuracy_of: tip" in effective, effective
error = np.linalg.norm(x[-1] - exact)
assert 0.5e-3 < error < 1e-3 and abs(estimate["error"][-1] / error - 1) < 0.02, (error, estimate["error"][-1])
print("elastica to 1e-3:", edges, "edges, error", error)

text, _, x, estimate = run("deep_arch", "-mode", "static", "-accuracy", "1e-2")  # points need not stay, but for the one in the middle that a force names
assert (len(x) - 1) % 2 == 0 and len(x) - 1 < 64 and estimate is None, len(x)

text, _, x, estimate = run("verify/hook", "-accuracy", "1e-3", "-error_estimate")  # graded edges, cut in two where their map says
assert len(x) - 1 < 20 and 0.5e-3 < estimate["error"].max() / 1.464 < 1e-3, (len(x), estimate["error"].max())
print("hook to 1e-3:", len(x) - 1, "edges, estimated", estimate["error"].max() / 1.464)

# Dynamics. The tip of the released cantilever against another method with the same energy, off by 1e-6.
rows = [line.split(",") for line in open(f"{source}/data/reference/dyn_stretch_law.csv") if line.startswith("dyn_cantilever_A,")]
times, exact = np.array([float(r[1]) for r in rows]), np.array([[float(r[2]), float(r[3]), 0] for r in rows])
for integrator, tolerance in ("generalized_alpha", 1e-2), ("generalized_alpha", 2e-3), ("bdf2", 1e-2):
    with tempfile.TemporaryDirectory() as out:
        options = ["-integrator", integrator, "-t_end", "1", "-output_interval", "0.05", "-accuracy", str(tolerance), "-accuracy_of", "tip"]
        text = tendril("cantilever", out, *options).stdout
        log, effective = open(out + "/log.txt").read(), open(out + "/options.yaml").read()
        with Trajectory(out) as trajectory:
            t, tip, steps = trajectory.time[1:], trajectory.field("position")[1:, -1], trajectory.diagnostics["dt"]
            edges = trajectory.rods[0].edges
    dt = float(re.search(r"\ndt: (\S+)", effective)[1])
    assert np.allclose(steps, dt) and f"accuracy: dt {dt:.3g} ({len(steps)} steps)" in text and f"edges: {edges}\n" in effective, text
    assert all(line in log for line in text.splitlines() if line.startswith("accuracy:")) and "by the edges" in text, log
    assert np.allclose(t, times), t  # steps divide the output interval
    error = np.sqrt(np.mean(np.sum((tip - exact) ** 2, axis=1)))
    assert tolerance / 4 < error < tolerance, (error, tolerance)  # 0.4 to 0.6 of it
    print(f"{integrator} to {tolerance}:", edges, "edges,", len(steps), "steps, error", error)

# What does not converge ends before anything is written.
with tempfile.TemporaryDirectory() as folder:
    failed = tendril("cantilever", folder + "/out", "-rod_young", "1e5", "-t_end", "5", "-accuracy", "1e-4", check=False)
    assert failed.returncode == 1 and "smaller -t_end" in failed.stderr and not os.listdir(folder), (failed.stderr, os.listdir(folder))

# Copies, a ring, tables of motion and dissipation, with adapted steps.
scene = """
simulation: {dt: 0.01, t_end: 0.4}
rods:
  - {name: hair, line: {from: [0, 0, 0], to: [0.3, 0, 0], edges: 7}, copies: {count: 3, offset: [0, 0, 0.1]},
     material: {radius: 0.003, young: 1e6, poisson: 0.4, density: 1000, stiffness_damping_coefficient: 1e-3}}
  - {name: ring, ring: {center: [0, 1, 0], normal: [0, 0, 1], radius: 0.1, edges: 20}, material: {radius: 0.003, young: 1e6, poisson: 0.4, density: 1000}}
supports:
  - {rod: hair, vertex: 0, type: clamp, motion: {table: [[0, 0, 0, 0, 0, 0, 0], [0.2, 0, 0.05, 0, 0, 0, 0.5]]}}
  - {rod: ring, vertex: 5, type: pin, motion: {velocity: [0.2, 0, 0]}}
"""
with tempfile.TemporaryDirectory() as out:
    open(out + "/scene.yaml", "w").write(scene)
    text = tendril(out + "/scene.yaml", out, "-integrator", "bdf2", "-dt_adapt", "error", "-accuracy", "1e-2").stdout
    rtol = float(re.search(r"\ndt_rtol: (\S+)", open(out + "/options.yaml").read())[1])
    assert f"dt_rtol {rtol:.3g}, dt_atol {1e-3 * rtol:.3g}" in text and "'hair#0' and 2 like it" in text, text
    with Trajectory(out) as t:
        assert t.time[-1] == 0.4

text, _, _, estimate = run("cantilever", "-t_end", "0.05", "-error_estimate")
assert ("time_error" in (estimate or {})) == ("added up" in text) and ("added up" in text) != ("no estimate" in text), text
print("dynamics:", [line for line in text.splitlines() if "estimate" in line][-1])
