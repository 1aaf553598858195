#!/usr/bin/python3
"""What a run leaves behind: files.py <tendril> <source folder>. A run can be read while it goes on; a killed one
is readable to its last half second; the XDMF file leads to every frame."""
import os
import signal
import subprocess
import sys
import tempfile
import time
from xml.etree import ElementTree

import h5py
import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, source + "/python")
from tendril import TendrilError, Trajectory

scene = source + "/data/scenes/cantilever.yaml"


def read(path):
    with Trajectory(path) as t:
        fields = {name: t.field(name)[:] for name in t.field_names}
        assert all(len(v) == len(t.time) for v in fields.values()), "a field has fewer frames than /time"
        return t.time, fields


def run(out, *options):
    return [program, "-scene", scene, "-output_dir", out, *options]


def complete(out, *options):
    subprocess.run(run(out, *options), check=True, stdout=subprocess.DEVNULL)
    return read(out + "/trajectory.h5")


def frames(out):
    """Frames that can be read now; none until the file has its first."""
    try:
        with Trajectory(out) as t:
            return len(t.time)
    except TendrilError:
        return 0


def until(event, process):
    """Waits for what a run does, however slow the machine; the run must not end before."""
    started = time.monotonic()
    while not event():
        assert process.poll() is None, "the run ended by itself"
        assert time.monotonic() < started + 300, "nothing happened"
        time.sleep(0.001)


def kill(process):
    process.send_signal(signal.SIGKILL)
    process.wait()


def killed(out, event, *options):
    """A run without an end in reach, killed as soon as something has happened."""
    process = subprocess.Popen(run(out, *options, "-t_end", "1000"), stdout=subprocess.DEVNULL)
    until(event, process)
    kill(process)
    return read(out + "/trajectory.h5")


def wholeRows(out):
    return open(out + "/diagnostics.csv").read().split("\n")[:-1]  # the last may have been cut


def assertEqual(some, others, what):
    for name, values in some.items():
        assert np.array_equal(values, others[name]), f"{what}: {name} differs"


def checkpointTime(out):
    with h5py.File(out + "/checkpoint.h5", "r") as f:
        return f.attrs["time"]


with tempfile.TemporaryDirectory() as tmp:
    options = ["-dt", "1e-3", "-checkpoint_interval", "10"]
    runs = {}
    for least in (1, 12, 300):
        out = f"{tmp}/killed{least}"
        runs[out] = killed(out, lambda: frames(out) >= least, *options)
    options += ["-t_end", str(max(t[-1] for t, _ in runs.values()) + 0.1)]
    times, fields = complete(tmp + "/whole", *options)
    restarted = 0
    for out, (t, f) in runs.items():
        assertEqual(f, {name: values[: len(t)] for name, values in fields.items()}, "killed run")
        rows = wholeRows(out)
        assert len(rows) >= len(t) and rows[0].startswith("time,dt")
        print("killed after", len(t), "frames: all readable and equal")
        if not os.path.exists(out + "/checkpoint.h5"):
            continue
        assert checkpointTime(out) <= t[-1], "a checkpoint is ahead of the frames"
        t, f = complete(out + "/on", *options, "-restart", out + "/checkpoint.h5")
        assertEqual(f, {name: values[-len(t) :] for name, values in fields.items()}, "restart")
        restarted += 1
        print("restarted", len(t) - 1, "steps before the end: the same bits")
    assert restarted >= 2, "runs of more than ten frames have checkpoints"

    # A method that remembers steps before goes on to the same bits, too, with adapted steps and dissipation. They end at the times of output, so that
    # runs with other ends have the same ones.
    for method in ("bdf2", "bdf3", "sdirk33", "generalized_alpha", "midpoint", "energy_momentum"):
        out, interval = f"{tmp}/{method}", 0.05
        options = ["-integrator", method, "-dt_adapt", "error", "-dt_rtol", "1e-4", "-output_interval", str(interval)]
        options += ["-rod_stiffness_damping_coefficient", "1e-3"]
        t, f = killed(out, lambda: os.path.exists(out + "/checkpoint.h5"), *options, "-checkpoint_interval", "200")
        end = ["-t_end", str(interval * (max(t[-1], checkpointTime(out)) // interval + 3))]
        times, fields = complete(out + "/whole", *options, *end)
        assertEqual(f, {name: values[: len(t)] for name, values in fields.items()}, method + " killed")
        t, f = complete(out + "/on", *options, *end, "-restart", out + "/checkpoint.h5")
        same = len(t) - 1  # the first frame is that of the checkpoint
        assert same >= 2 and np.array_equal(t[1:], times[-same:]), method
        assertEqual({name: values[1:] for name, values in f.items()}, {name: values[-same:] for name, values in fields.items()}, method + " restarted")
        print("restarted", method, same, "frames before the end: the same bits")

    # Without checkpoints nothing but the clock sends frames to the file, while they are few. Times are those of the run, and of its quickest half second: a
    # busy machine may be late.
    live = tmp + "/live"
    process = subprocess.Popen(run(live, "-dt", "1e-3", "-output_interval", "0.05", "-t_end", "1000"), stdout=subprocess.DEVNULL)
    until(lambda: frames(live) > 0, process)
    with Trajectory(live) as t:
        lengths, sent = [1], [0.0]

        def grown():
            return t.refresh() > lengths[-1]

        while len(sent) < 4 or min(np.diff(sent[1:])) > 0.6:
            until(grown, process)
            lengths.append(len(t.time))
            sent.append(t.diagnostics["wall_seconds"][-1])
            assert np.isfinite(t.field("position")[-1]).all() and t.time[-1] == max(t.time)
            assert len(sent) < 50, sent
    kill(process)
    t, _ = read(live + "/trajectory.h5")
    rows = wholeRows(live)
    assert lengths[-1] <= len(t), (lengths, len(t))
    assert all(r.count(",") == rows[0].count(",") for r in rows) and float(rows[-1].split(",")[0]) >= t[-1]
    print("read live with", lengths, "frames, sent after", sent, "s")

    short, derived = tmp + "/short", ["curvature", "twist", "strain_energy_density", "force", "moment"]
    # Every reference of the XDMF file, resolved by hand: scripts/check_xdmf needs ParaView, which not every machine has.
    t, f = complete(short, "-dt", "0.01", "-t_end", "0.1", "-output_fields", ",".join(["all", *derived]))
    assert set(derived) <= f.keys() and not set(derived) & fields.keys(), "derived fields are written when asked for, and only then"
    f["curvature_1"], f["curvature_2"] = np.moveaxis(f.pop("curvature"), -1, 0)
    of_edges = {"director", "twist_rate", "axial_force", "force"}
    for block in ElementTree.parse(short + "/trajectory.xdmf").findall("Domain/Grid"):
        grids = block.findall("Grid")
        assert [float(g.find("Time").get("Value")) for g in grids] == list(t), "times differ"
        for k, grid in enumerate(grids):
            items = {"position": grid.find("Geometry/DataItem")}
            items.update((a.get("Name"), a.find("DataItem")) for a in grid.findall("Attribute"))
            name, path = items.pop("radius").text.split(":")
            with h5py.File(short + "/" + name, "r", swmr=True) as h5:
                assert h5[path].shape == f["position"].shape[1:2] and np.all(h5[path][:] == 0.005)  # of the section
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
