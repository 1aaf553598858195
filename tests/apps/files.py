#!/usr/bin/python3
"""What a run leaves behind: files.py <tendril> <source folder>. A run can be read while it goes on; a killed one
is readable to its last half second; the XDMF file leads to every frame."""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from xml.etree import ElementTree

import h5py
import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
scene = source + "/data/scenes/cantilever.yaml"


def read(path):
    with h5py.File(path, "r", swmr=True) as f:
        n = len(f["time"])
        fields = {k: f["state/" + k][:n] for k in f["state"]}
        assert all(len(v) == n for v in fields.values()), "a field has fewer frames than /time"
        return f["time"][:], fields


def run(out, *options):
    return [program, "-scene", scene, "-output_dir", out, *options]


with tempfile.TemporaryDirectory() as tmp:
    whole, options = tmp + "/whole", ["-dt", "1e-3", "-t_end", "1", "-checkpoint_interval", "10"]
    subprocess.run(run(whole, *options), check=True, stdout=subprocess.DEVNULL)
    times, fields = read(whole + "/trajectory.h5")
    assert len(times) == 1001
    restarted = 0
    for wait in (0.05, 0.1, 0.17):
        out = f"{tmp}/killed{wait}"
        process = subprocess.Popen(run(out, *options), stdout=subprocess.DEVNULL)
        while not os.path.exists(out + "/diagnostics.csv"):
            time.sleep(0.005)
        time.sleep(wait)
        process.send_signal(signal.SIGKILL)
        process.wait()
        t, f = read(out + "/trajectory.h5")
        assert 0 < len(t) <= 1001, len(t)
        for name, values in f.items():
            assert np.array_equal(values, fields[name][: len(t)]), f"{name}: a frame of the killed run differs"
        rows = open(out + "/diagnostics.csv").read().splitlines()
        assert len(rows) >= len(t) - 1 and rows[0].startswith("time,dt")
        print("killed after", len(t), "frames: all readable and equal")
        if not os.path.exists(out + "/checkpoint.h5"):
            continue
        subprocess.run(run(out + "/on", *options, "-restart", out + "/checkpoint.h5"), check=True, stdout=subprocess.DEVNULL)
        t, f = read(out + "/on/trajectory.h5")
        for name, values in f.items():
            assert np.array_equal(values, fields[name][-len(t) :]), f"{name}: differs after a restart"
        restarted += 1
        print("restarted", len(t) - 1, "steps before the end: the same bits")

    assert restarted > 0, "no run lived long enough to write a checkpoint"

    # A method that remembers steps before goes on to the same bits, too, with adapted steps and dissipation.
    for method in ("bdf2", "generalized_alpha", "midpoint"):
        out = f"{tmp}/{method}"
        options = ["-t_end", "1", "-integrator", method, "-dt_adapt", "error", "-dt_rtol", "1e-4", "-rod_stiffness_damping_coefficient", "1e-3"]
        process = subprocess.Popen(run(out, *options, "-checkpoint_interval", "200"), stdout=subprocess.DEVNULL)
        while not os.path.exists(out + "/checkpoint.h5"):
            time.sleep(0.001)
        shutil.copy(out + "/checkpoint.h5", tmp + "/early.h5")  # replaced as a whole, by another file
        assert process.wait() == 0
        _, fields = read(out + "/trajectory.h5")
        subprocess.run(run(out + "/on", *options, "-restart", tmp + "/early.h5"), check=True, stdout=subprocess.DEVNULL)
        t, f = read(out + "/on/trajectory.h5")
        for name, values in f.items():
            assert np.array_equal(values, fields[name][-len(t) :]), f"{method}: {name} differs after a restart"
        print("restarted", method, len(t) - 1, "steps before the end: the same bits")

    # Without checkpoints nothing but the clock sends frames to the file.
    live = tmp + "/live"
    process = subprocess.Popen(run(live, "-dt", "1e-3", "-t_end", "1000"), stdout=subprocess.DEVNULL)
    while not os.path.exists(live + "/trajectory.h5") or os.path.getsize(live + "/diagnostics.csv") == 0:
        time.sleep(0.005)
    time.sleep(1)
    with h5py.File(live + "/trajectory.h5", "r", swmr=True) as f:
        lengths = []
        for _ in range(2):
            f["time"].refresh()
            f["state/position"].refresh()
            lengths.append(len(f["time"]))
            assert np.isfinite(f["state/position"][lengths[-1] - 1]).all() and f["time"][lengths[-1] - 1] == max(f["time"][: lengths[-1]])
            time.sleep(1.2)
    process.send_signal(signal.SIGKILL)
    process.wait()
    t, _ = read(live + "/trajectory.h5")
    rows = open(live + "/diagnostics.csv").read().splitlines()
    wall = float(rows[len(t) - 1].split(",")[rows[0].split(",").index("wall_seconds")])  # of the last frame
    assert 1 < lengths[0] < lengths[1] <= len(t), (lengths, len(t))
    assert all(r.count(",") == rows[0].count(",") for r in rows) and len(rows) >= len(t), (len(rows), len(t))
    assert wall > 2.2 - 0.5 - 0.5, wall  # killed after 2.2 s: the last half second may be lost, and a busy machine may be late by as much
    print("read live with", lengths, "frames; killed after 2.2 s with all up to", wall, "s")

    short, derived = tmp + "/short", ["curvature", "twist", "strain_energy_density", "force", "moment"]
    subprocess.run(run(short, "-dt", "0.01", "-t_end", "0.1", "-output_fields", ",".join(["all", *derived])), check=True, stdout=subprocess.DEVNULL)
    # Every reference of the XDMF file, resolved by hand: scripts/check_xdmf needs ParaView, which not every machine has.
    t, f = read(short + "/trajectory.h5")
    assert set(derived) <= f.keys() and not set(derived) & fields.keys(), "derived fields are written when asked for, and only then"
    f["curvature_1"], f["curvature_2"] = np.moveaxis(f.pop("curvature"), -1, 0)
    of_edges = {"director", "twist_rate", "axial_force", "force"}
    for block in ElementTree.parse(short + "/trajectory.xdmf").findall("Domain/Grid"):
        grids = block.findall("Grid")
        assert [float(g.find("Time").get("Value")) for g in grids] == list(t), "times differ"
        for k, grid in enumerate(grids):
            items = {"position": grid.find("Geometry/DataItem")}
            items.update((a.get("Name"), a.find("DataItem")) for a in grid.findall("Attribute"))
            assert items.keys() == (f.keys() if block.get("Name") == "edges" else f.keys() - of_edges), items.keys()
            assert {a.get("Name") for a in grid.findall("Attribute") if a.get("Center") == "Cell"} == items.keys() & of_edges
            for field, item in items.items():
                selection, data = item.findall("DataItem")
                start, stride, count = np.array(selection.text.split(), int).reshape(3, -1)
                name, path = data.text.split(":")
                with h5py.File(short + "/" + name, "r", swmr=True) as h5:
                    shape = tuple(int(n) for n in data.get("Dimensions").split())
                    assert h5[path].shape == shape, (h5[path].shape, shape)
                    slab = h5[path][tuple(slice(s, s + n) for s, n in zip(start, count))]
                assert np.array_equal(slab.reshape(f[field][k].shape), f[field][k]), f"{field} of frame {k}"
    print("XDMF leads to", len(t), "frames")

    # Cables have no cells, and so no whole turns to write.
    with open(tmp + "/cable.yaml", "w") as f:
        f.write("""simulation: {dt: 0.01, t_end: 0.02}
rods:
  - {line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}, measure: angle, material: {axial_stiffness: 100, flexural_stiffness: 0}}
supports:
  - {vertex: 0, type: pin}
""")
    fields = ",".join(["all", *derived])
    subprocess.run([program, "-scene", tmp + "/cable.yaml", "-output_dir", tmp + "/cable", "-output_fields", fields], check=True, stdout=subprocess.DEVNULL)
    _, f = read(tmp + "/cable/trajectory.h5")
    assert "turns" not in f and not f["moment"].any() and f["force"][-1].any()
