#!/usr/bin/python3
"""A pile of strands: pile.py <tendril> <source folder>. In every frame all strands are in the box and none is nearer to
another than the law lets it, by distances computed here."""
import os
import subprocess
import sys
import tempfile

import h5py
import numpy as np

program, root = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
RADIUS, WIDTH = 1e-3, 0.2e-3


def distance(p, q, r, s):
    """Of segments p q and r s (n, 3): the least of end against segment, and of the inner points where lines have them."""
    def ends(x, a, b):
        along = b - a
        part = np.clip(np.sum((x - a) * along, 1) / np.sum(along * along, 1), 0, 1)
        return np.linalg.norm(x - a - part[:, None] * along, axis=1)
    least = np.minimum.reduce([ends(p, r, s), ends(q, r, s), ends(r, p, q), ends(s, p, q)])
    u, v, w = q - p, s - r, p - r
    uu, uv, vv, uw, vw = (np.sum(a * b, 1) for a, b in ((u, u), (u, v), (v, v), (u, w), (v, w)))
    size = uu * vv - uv * uv
    safe = np.where(size > 0, size, 1)
    a, b = (uv * vw - vv * uw) / safe, (uu * vw - uv * uw) / safe
    inner = (size > 0) & (a > 0) & (a < 1) & (b > 0) & (b < 1)
    between = np.linalg.norm(w + a[:, None] * u - b[:, None] * v, axis=1)
    return np.where(inner, np.minimum(least, between), least)


def check(strands, edges, arguments):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([f"{root}/scripts/pile", str(strands), "--edges", str(edges), "--out", "pile.yaml", *arguments], cwd=folder,
                       check=True)
        run = subprocess.run([program, "-scene", "pile.yaml"], cwd=folder, capture_output=True, text=True)
        assert run.returncode == 0, run.stdout + run.stderr
        with h5py.File(f"{folder}/out/trajectory.h5") as f:
            position = f["state/position"][:]
            gaps = f["diagnostics/contact_gap_min"][:]
    frames = position.reshape(len(position), strands, edges + 1, 3)
    first, second = np.triu_indices(strands * edges, 1)
    apart = first // edges != second // edges
    first, second = first[apart], second[apart]
    closest, touching = np.inf, 0
    for x in frames:
        a, b = x[:, :-1].reshape(-1, 3), x[:, 1:].reshape(-1, 3)
        d = distance(a[first], b[first], a[second], b[second])
        closest, touching = min(closest, d.min()), touching + np.sum(d < 2 * RADIUS + 0.5 * WIDTH)
    # Between samples edges are nearer than samples by a tenth of the width at most.
    assert closest > 2 * RADIUS - 0.6 * WIDTH, f"strands come as near as {closest}"
    assert touching > 10 * strands, f"only {touching} pairs of edges touch, over all frames"
    assert frames[..., 2].min() > RADIUS - 0.5 * WIDTH and abs(frames[..., :2]).max() < 0.07 - RADIUS + 0.5 * WIDTH
    assert gaps.min() > -0.6 * WIDTH, gaps.min()
    assert frames[-1, ..., 2].max() < 0.02, f"the pile is {frames[-1, ..., 2].max()} m high"
    print(f"{strands} strands of {edges} edges: closest {closest:.6g} m, {touching} pairs in touch over {len(frames)} frames")


check(10, 10, ["--t_end", "0.15"])
check(10, 10, ["--t_end", "0.15", "--friction", "0.3"])
