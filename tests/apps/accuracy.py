#!/usr/bin/python3
"""Estimated errors as the program tells and writes them: accuracy.py <tendril> <source folder>."""
import os
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
exact = np.array([0.61237163927557, -0.713791523611913, 0])  # data/reference/elastica_tip_load.csv, load 5; of the scene elastica.yaml


def run(scene, *options):
    with tempfile.TemporaryDirectory() as out:
        text = subprocess.run([program, "-scene", f"{source}/data/scenes/{scene}.yaml", "-output_dir", out, *options], check=True, capture_output=True, text=True).stdout
        with h5py.File(out + "/trajectory.h5") as f:
            estimate = {k: v[:] for k, v in f["estimate"].items()} if "estimate" in f else None
            attributes = dict(f["estimate"].attrs) if "estimate" in f else {}
            position = f["state/position"][-1]
        log, effective = open(out + "/log.txt").read(), open(out + "/options.yaml").read()
    assert all(line in log for line in text.splitlines() if "estimate" in line and "command" not in line), "the log misses a line"
    return text, effective, position, estimate, attributes


text, effective, x, estimate, attributes = run("elastica", "-error_estimate")
assert "estimated error: position" in text and "bend energy" in text, text
assert estimate["position"].shape == x.shape and estimate["error"].shape == x.shape[:1]
error = np.linalg.norm(x[-1] - exact)
# The scene stretches by EI/(EA L^2) = 1e-8.
assert abs(estimate["error"][-1] / error - 1) < 0.01 and np.linalg.norm(estimate["position"][-1] - exact) < error / 40, estimate["error"][-1] / error
assert attributes["valid"] == 1 and attributes["position_error"] == estimate["error"].max()
assert "error_estimate: true" in effective
print("elastica: error", error, "estimated", estimate["error"][-1], "extrapolated", np.linalg.norm(estimate["position"][-1] - exact))

text, effective, x, estimate, _ = run("elastica", "-accuracy", "1e-3", "-accuracy_of", "tip", "-error_estimate")
edges = len(x) - 1
assert f"edges {edges} for 0.001: estimated error of the tip" in text, text
assert re.search(rf"edges: {edges}\n", effective) and "accuracy: 0.001" in effective and "accuracy_of: tip" in effective, effective
error = np.linalg.norm(x[-1] - exact)
assert 0.5e-3 < error < 1e-3 and abs(estimate["error"][-1] / error - 1) < 0.02, (error, estimate["error"][-1])
print("elastica to 1e-3:", edges, "edges, error", error)

text, _, x, estimate, _ = run("deep_arch", "-mode", "static", "-accuracy", "1e-2")  # points need not stay, but for the one in the middle that a force names
assert (len(x) - 1) % 2 == 0 and len(x) - 1 < 64 and estimate is None, len(x)

text, _, x, estimate, _ = run("verify/hook", "-accuracy", "1e-3", "-error_estimate")  # graded edges, cut in two where their map says
assert len(x) - 1 < 20 and 0.5e-3 < estimate["error"].max() / 1.464 < 1e-3, (len(x), estimate["error"].max())
print("hook to 1e-3:", len(x) - 1, "edges, estimated", estimate["error"].max() / 1.464)

text, _, _, _, attributes = run("cantilever", "-t_end", "0.05", "-error_estimate")
assert ("time_error" in attributes) == ("added up" in text) and ("added up" in text) != ("no estimate" in text), text
print("dynamics:", [line for line in text.splitlines() if "estimate" in line][-1])
