#!/usr/bin/python3
"""Runs that end early and go on: restart.py <tendril> <source folder>. Exit codes and messages of restarts, folders in use, signals, limits of time and full
disks; and that what goes on comes to the same bits, or to what the changed scene has to come to."""
import glob
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, source + "/python")
from tendril import Trajectory

rod = """gravity: [0, 0, 0]
simulation: {mode: MODE, dt: 0.005, t_end: 3.0}
rods:
- name: r
  line: {from: [0, 0, 0], to: [1, 0, 0], edges: 40}
  material: {linear_density: 1, linear_rotational_inertia: 1.0e-6, axial_stiffness: 1000000.0, torsional_stiffness: 1, flexural_stiffness: 1.0}
supports:
- {vertex: 0, type: clamp}
"""
pull = rod.replace("MODE", "static") + "loads:\n- {vertex: last, force: [0, 0.03, 0]}\n"
let_go = rod.replace("MODE", "dynamic")
cantilever = source + "/data/scenes/cantilever.yaml"


def command(*options):
    return [program, *(str(o) for o in options)]


def run(code, *options, says=(), never=(), **more):
    """Output of a run that has to end with this exit code, and say this."""
    done = subprocess.run(command(*options), capture_output=True, text=True, timeout=300, **more)
    text = done.stdout + done.stderr
    assert done.returncode == code, f"exit code {done.returncode} instead of {code}: {options}\n{text}"
    for part in [says] if isinstance(says, str) else says:
        assert part in text, f"does not say '{part}':\n{text}"
    for part in [*never, "PETSC ERROR", "Segmentation"]:
        assert part not in text, f"says '{part}':\n{text}"
    return text


def started(*options, **more):
    return subprocess.Popen(command(*options), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)


def until(event, process):
    begin = time.monotonic()
    while not event():
        assert process is None or process.poll() is None, "the run ended by itself: " + process.stdout.read()
        assert time.monotonic() < begin + 300, "nothing happened"
        time.sleep(0.002)


def rows(out):
    return np.genfromtxt(out + "/diagnostics.csv", delimiter=",", names=True)


def final(out):
    with h5py.File(out + "/checkpoint.h5") as f:
        return {name: f[name][:] for name in f if name != "facts"} | {"time": f.attrs["time"], "step": f.attrs["step"]}


def same(a, b):
    assert a.keys() == b.keys(), (a.keys(), b.keys())
    for name, values in a.items():
        assert np.array_equal(values, b[name]), name + " differs"


def logOf(out):
    """Empty while there is none."""
    return open(out + "/log.txt").read() if os.path.exists(out + "/log.txt") else ""


def write(path, text):
    with open(path, "w") as f:
        f.write(text)
    return path


def letGo(tmp):
    """T1 = 2 pi/3.516 L^2 sqrt(m/EI) = 1.787 s: a half period after it is let go the tip is as far on the other side, but for the higher modes in
    the static shape, 3 % of its tip (Blevins 1979, Table 8-1)."""
    run(0, "-scene", write(tmp + "/pull.yaml", pull), "-output_dir", tmp + "/pull")
    text = run(0, "-scene", write(tmp + "/let_go.yaml", let_go), "-restart", tmp + "/pull/checkpoint.h5", "-output_dir", tmp + "/let_go", "-integrator", "generalized_alpha",
               says=["no longer there: force on vertex 40 of rod 'r': [0, 0.03, 0]", "the start of dynamics", "600 steps"], never=["warning"])
    assert "changed since" not in text, text
    with Trajectory(tmp + "/let_go") as t:
        times, tip = np.array(t.time), t.field("position")[:, -1, 1]
    assert times[0] == 0 and times[-1] == 3 and len(times) == 601
    up = [k for k in range(len(tip) - 1) if tip[k] < 0 <= tip[k + 1]]
    down = [k for k in range(len(tip) - 1) if tip[k] >= 0 > tip[k + 1]]
    cross = [times[k] - tip[k] * (times[k + 1] - times[k]) / (tip[k + 1] - tip[k]) for k in (down[0], up[0], down[1])]
    period = cross[2] - cross[0]
    assert abs(period / 1.787 - 1) < 0.02, period  # the second mode, 6.27 times as fast, shifts a zero by up to 1 %
    assert abs(tip[0] - 0.01) < 1e-4 and abs(tip.min() + 0.01) < 4e-4, (tip[0], tip.min())
    # The same with the clamp gone, too: the rod flies, and its momentum stays that of a rod at rest.
    free = let_go[: let_go.index("supports")]
    run(0, "-scene", write(tmp + "/free.yaml", free), "-restart", tmp + "/pull/checkpoint.h5", "-output_dir", tmp + "/free", "-t_end", 0.2, "-integrator", "bdf2",
        says="no longer there: support at vertex 0 of rod 'r': clamp")
    with Trajectory(tmp + "/free") as t:
        p = t.field("position")
        weight = np.ones(41)
        weight[[0, -1]] = 0.5
        moved = np.abs((weight[:, None] * (p[-1] - p[0])).sum(axis=0)).max() / 40
        assert moved < 1e-7 and np.abs(p[-1] - p[0]).max() > 1e-3, moved  # -snes_rtol leaves 1e-6 of forces of 0.03 N
    # Dynamics ends; statics from there finds the equilibrium that statics from the start finds.
    run(0, "-scene", tmp + "/pull.yaml", "-restart", tmp + "/let_go", "-output_dir", tmp + "/again",
        says=["goes on from " + tmp + "/let_go/checkpoint.h5", "the start of statics", "new since the checkpoint: force"])
    with h5py.File(tmp + "/again/checkpoint.h5") as a, h5py.File(tmp + "/pull/checkpoint.h5") as b:
        assert np.abs(a["position"][:] - b["position"][:]).max() < 1e-6
    # More load on a state of full load.
    run(0, "-scene", write(tmp + "/more.yaml", pull.replace("0.03", "0.05")), "-restart", tmp + "/pull/checkpoint.h5", "-output_dir", tmp + "/more",
        says=["[0, 0.03, 0] -> [0, 0.05, 0]", "load factor begins anew"])
    with h5py.File(tmp + "/more/checkpoint.h5") as f:
        assert abs(f["position"][-1, 1] / (0.05 / 3) - 1) < 1e-3  # F L^3/3 EI, less the shortening by bending and by 40 edges
    run(1, "-scene", tmp + "/pull.yaml", "-restart", tmp + "/pull/checkpoint.h5", "-output_dir", tmp + "/none", says="nothing is left to do")
    print("let go: T1", period)


def changes(tmp):
    one = ["-scene", write(tmp + "/rod.yaml", let_go.replace("[0, 0, 0]\nsim", "[0, -9.81, 0]\nsim")), "-integrator", "bdf2", "-output_interval", 0.05]  # steps end there, whatever the end
    run(0, *one, "-t_end", 0.5, "-output_dir", tmp + "/whole")
    run(0, *one, "-t_end", 0.25, "-output_dir", tmp + "/half")
    start = ["-restart", tmp + "/half/checkpoint.h5"]
    text = run(0, *one, "-t_end", 0.5, "-output_dir", tmp + "/on", *start, says="goes on from", never=["changed since", "warning"])
    same(final(tmp + "/whole"), final(tmp + "/on"))
    w, o = rows(tmp + "/whole"), rows(tmp + "/on")
    for name in w.dtype.names:
        if name != "wall_seconds":
            assert np.array_equal(w[name][-len(o):], o[name]), name + " of the diagnostics differs"
    shutil.copy(tmp + "/half/checkpoint.h5", tmp + "/format_2.h5")
    with h5py.File(tmp + "/format_2.h5", "r+") as f:  # as format 2 was, which knew no actions of supports
        del f["support_actions"], f.attrs["remembered_actions"], f.attrs["checksum"]
        f.attrs["format_version"] = 2.0
    run(0, *one, "-t_end", 0.5, "-output_dir", tmp + "/old", "-restart", tmp + "/format_2.h5", says="has no checksum")
    same(final(tmp + "/whole"), final(tmp + "/old"))
    run(0, *one, "-t_end", 0.3, "-dt", 0.01, "-output_dir", tmp + "/dt", *start, says="changed since the checkpoint: dt: 0.005 -> 0.01")
    assert np.allclose(rows(tmp + "/dt")["dt"], 0.01, rtol=1e-9)
    write(tmp + "/slow.yaml", open(tmp + "/rod.yaml").read().replace("dt: 0.005", "dt: 0.025"))
    run(0, "-scene", tmp + "/slow.yaml", "-integrator", "bdf2", "-t_end", 0.5, "-output_dir", tmp + "/slow", *start, says="dt: 0.005 -> 0.025")
    assert len(rows(tmp + "/slow")) == 10
    run(0, *one, "-t_end", 0.3, "-gravity", "0,0,-9.81", "-rod_linear_density", 2, "-rod_measure", "angle", "-snes_rtol", "1e-7", "-output_dir", tmp + "/other", *start,
        says=["gravity: [0, -9.81, 0] -> [0, 0, -9.81]", "material of rod 'r'", "law of rod 'r': measure tan", "snes_rtol: 1e-6 -> 1e-7"])
    run(0, *one, "-t_end", 0.05, "-restart_time", 0, "-output_dir", tmp + "/zero", *start)
    assert len(rows(tmp + "/zero")) == 10 and rows(tmp + "/zero")["time"][0] == 0.005
    write(tmp + "/finer.yaml", open(tmp + "/rod.yaml").read().replace("edges: 40", "edges: 41"))
    run(1, "-scene", tmp + "/finer.yaml", "-output_dir", tmp + "/finer", *start, says=["another topology", "1 rods with 41 vertices and 40 edges"])
    assert not os.path.exists(tmp + "/finer"), "a folder was made for nothing"
    run(1, *one, "-output_dir", tmp + "/half", *start, says="would replace those beside the checkpoint")
    assert os.path.exists(tmp + "/half/checkpoint.h5")
    damaged = bytearray(open(tmp + "/half/checkpoint.h5", "rb").read())
    with h5py.File(tmp + "/half/checkpoint.h5") as f:
        damaged[f["velocity"].id.get_offset() + 100] ^= 4
    open(tmp + "/damaged.h5", "wb").write(damaged)
    run(1, *one, "-output_dir", tmp + "/bad", "-restart", tmp + "/damaged.h5", says="is damaged: its checksum")
    # A file of before there were names: read, and said so.
    with h5py.File(tmp + "/half/checkpoint.h5") as f, h5py.File(tmp + "/old.h5", "w") as old:
        code = 0
        for letter in b"bdf2":
            code = (31 * code + letter) % (10**9 + 7)
        for name in f:
            if not name.startswith(("facts", "cell")) and (name != "strains" or len(f[name])):
                old[name] = f[name][:]
        a = f.attrs
        names = ["time", "step", "next_dt", "good_steps", "stable", "step_error", "error_sum", "last_dt", code, "rounding_sum", "dt_before"]
        old["loop"] = [float(n if n == code else a[n]) for n in names]
    run(0, *one, "-t_end", 0.5, "-output_dir", tmp + "/from_old", "-restart", tmp + "/old.h5", says="is of an earlier version")
    same(final(tmp + "/whole"), final(tmp + "/from_old"))
    print("changes told")


def balances(tmp):
    """A clamp that turns and travels, and a load: work and dissipation have the same bits, by methods that remember what supports did."""
    driven = let_go.replace("type: clamp}", "type: clamp, motion: {velocity: [0.1, 0, 0], angular_velocity: [2, 0, 0.5]}}")
    scene = ["-scene", write(tmp + "/driven.yaml", driven + "loads:\n- {vertex: last, force: [0, 0.3, 0]}\n"), "-output_interval", 0.05]
    for method in ("bdf2", "bdf3", "generalized_alpha"):
        one = [*scene, "-integrator", method]
        run(0, *one, "-t_end", 0.2, "-output_dir", tmp + "/whole")
        run(0, *one, "-t_end", 0.1, "-output_dir", tmp + "/half")
        run(0, *one, "-t_end", 0.2, "-output_dir", tmp + "/on", "-restart", tmp + "/half/checkpoint.h5")
        w, o = rows(tmp + "/whole"), rows(tmp + "/on")
        assert len(o) == 20 and min(abs(o["work_loads"])) > 0 and min(abs(o["work_supports"])) > 0
        for name in w.dtype.names:
            assert name == "wall_seconds" or np.array_equal(w[name][-len(o):], o[name]), method + ": " + name
        energy = sum(w[name] for name in ("kinetic", "stretch", "bend", "twist", "gravity"))
        off = np.diff(energy) - (w["work_loads"] + w["work_supports"] - w["dissipated"])[1:]
        assert abs(off).max() < 1e-12 * energy.max(), method  # rounding of the sums


def folders(tmp):
    out = tmp + "/out"
    base = ["-scene", cantilever, "-dt", 1e-3, "-output_dir", out]
    run(0, *base, "-t_end", 0.05)
    run(0, *base, "-t_end", 0.02, says=f"removed from {out}, of an earlier run: checkpoint.h5, trajectory.h5, trajectory.xdmf, diagnostics.csv, log.txt, options.yaml")
    first = started(*base, "-t_end", 1000)
    until(lambda: " 1000" in logOf(out), first)
    assert not os.path.exists(out + "/checkpoint.h5"), "the checkpoint of the run before is still there"
    run(1, *base, "-t_end", 0.02, says=["another run (process " + str(first.pid) + ")", "choose another folder"])
    run(1, *base, "-t_end", 0.02, "-restart", "auto", says="another run")
    first.kill()
    first.wait()
    run(0, *base, "-t_end", 0.02, says="removed from")
    assert not os.path.exists(out + "/.lock")
    # What a run reads is not taken for the result of another.
    os.makedirs(tmp + "/own")
    own = tmp + "/own/options.yaml"
    with open(cantilever) as f:
        write(own, f.read())
    run(1, "-scene", own, "-output_dir", tmp + "/own", says=["results would replace", own])
    assert os.path.exists(own)
    print("folders are held and cleared")


def automatic(tmp):
    whole, out = tmp + "/whole", tmp + "/out"
    options = ["-scene", cantilever, "-dt", 1e-3, "-integrator", "bdf2", "-t_end", 4, "-checkpoint_interval", 20]
    run(0, *options, "-output_dir", whole)
    options += ["-output_dir", out, "-restart", "auto"]
    random.seed(3)
    kills = 0
    for k in range(8):
        begun = time.time()
        process = started(*options)

        def wrote():  # a checkpoint of its own: that of before is moved away in a moment
            try:
                return os.path.getmtime(out + "/checkpoint.h5") >= begun and len(glob.glob(out + "/part_*")) == k
            except OSError:
                return False

        # Ended by itself where the machine was slow to look: then there is nothing more to kill.
        until(lambda: process.poll() is not None or wrote(), None)
        time.sleep(random.uniform(0, 0.1))
        process.kill()
        text = process.communicate()[0]
        assert ("from the start" if k == 0 else "goes on from " + out) in text, text
        if process.returncode == 0:
            break
        assert process.returncode == -signal.SIGKILL, text
        kills += 1
    parts = len(glob.glob(out + "/part_*"))
    assert kills >= 2 and parts >= 1, (kills, parts)
    # A damaged one is passed over.
    last = out + "/checkpoint.h5"
    with open(last, "r+b") as f:
        f.truncate(os.path.getsize(last) // 2)
    run(0, *options, says=["passed over: " + last, "goes on from " + out + "/part_"])
    same(final(whole), final(out))
    run(0, *options, says="nothing is left to do")
    run(0, *options, "-t_end", 4.1, says="goes on from")
    run(1, *options, "-scene", source + "/data/scenes/ring.yaml", says="another topology")
    # Without -restart the run begins anew, and none of its parts is left to go on from.
    run(0, *options[:-2], "-t_end", 0.01, says="part_1")
    assert not glob.glob(out + "/part_*")
    # Where no checkpoint is whole, nothing is thrown away.
    with open(last, "r+b") as f:
        f.truncate(3000)
    run(1, *options, says=["no checkpoint in", "is whole", "take '-restart auto' away"])
    assert os.path.exists(out + "/trajectory.h5")
    print("restarted automatically after", kills, "kills")


def orders(tmp):
    """Rods are those of the checkpoint by their order: another one is refused, and what counts at the start only is said to be ignored."""
    rods = {name: f"  - {{name: {name}, line: {{from: [0, 0, {z}], to: [1, 0, {z}], edges: 8}}, material: {{radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}}}}\n"
            for z, name in enumerate("ab")}
    text = "simulation: {dt: 0.01, t_end: 0.1}\nrods:\n%ssupports: [{rod: all, vertex: 0, type: clamp}]\n"
    write(tmp + "/ab.yaml", text % (rods["a"] + rods["b"]))
    write(tmp + "/ba.yaml", text % (rods["b"] + rods["a"]))
    write(tmp + "/fast.yaml", text % (rods["a"].replace("}\n", ", velocity: [0, 5, 0]}\n") + rods["b"]))
    run(0, "-scene", tmp + "/ab.yaml", "-output_dir", tmp + "/first")
    again = ["-restart", tmp + "/first", "-t_end", 0.2, "-output_dir", tmp + "/second"]
    run(1, "-scene", tmp + "/ba.yaml", *again, says="the same rods in another order")
    run(0, "-scene", tmp + "/fast.yaml", *again, says=["it is ignored: start of rod 'a': none -> velocity [0, 5, 0]"])
    print("rods in another order are refused")


def touching(tmp):
    """A rod that sticks and slips behind a spring over a floor, and one that a turning drum takes along: friction,
    anchors and the work of obstacles go on to the same bits."""
    scene = """gravity: [0, 0, -9.81]
simulation: {dt: 2e-3}
rods:
- {name: a, line: {from: [0, 0, 0.0052], to: [0.2, 0, 0.0052], edges: 10}, material: {radius: 0.005, young: 1e6, poisson: 0.4, density: 1000}}
- {name: b, line: {from: [-0.1, 1, 0.1152], to: [0.1, 1, 0.1152], edges: 16}, material: {radius: 0.005, young: 1e6, poisson: 0.4, density: 1000}}
constraints: [{type: pin, rod: a, vertex: last, stiffness: 2, motion: {velocity: [0.1, 0, 0]}}]
contact: {friction: 0.4, STICK}
colliders:
- {name: floor, plane: {normal: [0, 0, 1]}}
- {name: drum, cylinder: {radius: 0.1, length: 1, axis: [0, 1, 0]}, position: [0, 1, 0.01], motion: {angular_velocity: [0, 3, 0]}}
"""
    for stick in ("stick: creep", "stick: anchored"):
        write(tmp + "/touching.yaml", scene.replace("STICK", stick))
        for integrator in ("euler", "bdf2", "sdirk2", "midpoint", "generalized_alpha"):
            base = ["-scene", tmp + "/touching.yaml", "-integrator", integrator, "-output_interval", 0.05]
            run(0, *base, "-t_end", 0.1, "-output_dir", tmp + "/half")
            with h5py.File(tmp + "/half/checkpoint.h5") as f:
                assert f["contact_memory"].shape[0] > 0, (integrator, stick)
            run(0, *base, "-t_end", 0.2, "-restart", tmp + "/half/checkpoint.h5", "-output_dir", tmp + "/on")
            run(0, *base, "-t_end", 0.2, "-output_dir", tmp + "/whole")
            same(final(tmp + "/on"), final(tmp + "/whole"))
            done, all_of_it = rows(tmp + "/on"), rows(tmp + "/whole")
            assert np.array_equal(done["work_supports"], all_of_it["work_supports"][-len(done):]), (integrator, stick)
    print("friction goes on to the same bits")


def amongRods(tmp):
    """Strands in a box that lie upon each other with friction."""
    for integrator in ("euler", "bdf2"):
        base = ["-scene", source + "/data/scenes/pile.yaml", "-integrator", integrator, "-dt", 2**-8]
        run(0, *base, "-t_end", 0.0625, "-output_dir", tmp + "/half")
        with h5py.File(tmp + "/half/checkpoint.h5") as f:
            assert f["rod_contact_stiffness"][:].max() > 0, integrator
        run(0, *base, "-t_end", 0.125, "-restart", tmp + "/half/checkpoint.h5", "-output_dir", tmp + "/on")
        run(0, *base, "-t_end", 0.125, "-output_dir", tmp + "/whole")
        same(final(tmp + "/on"), final(tmp + "/whole"))
    print("rods that touch each other go on to the same bits")


def bodiesTouch(tmp):
    """A rope and a ball on a crate, which lies on the floor, with friction."""
    base = ["-scene", source + "/data/scenes/crate.yaml", "-dt", 2**-8]
    run(0, *base, "-t_end", 0.3125, "-output_dir", tmp + "/half")
    run(0, *base, "-t_end", 0.4375, "-restart", tmp + "/half/checkpoint.h5", "-output_dir", tmp + "/on")
    run(0, *base, "-t_end", 0.4375, "-output_dir", tmp + "/whole")
    with h5py.File(tmp + "/whole/trajectory.h5") as f:
        moved = np.abs(f["state/body_position"][-1] - f["state/body_position"][0]).max(axis=1)
    assert (moved > 1e-5).all(), moved
    same(final(tmp + "/on"), final(tmp + "/whole"))
    print("bodies that touch rods and each other go on to the same bits")


def tendonsRub(tmp):
    """A finger's tendon that rubs, as it is let go."""
    base = ["-scene", source + "/data/scenes/finger_rubs.yaml", "-dt", 2**-6]
    run(0, *base, "-t_end", 3.25, "-output_dir", tmp + "/half")
    run(0, *base, "-t_end", 3.5, "-restart", tmp + "/half/checkpoint.h5", "-output_dir", tmp + "/on")
    run(0, *base, "-t_end", 3.5, "-output_dir", tmp + "/whole")
    same(final(tmp + "/on"), final(tmp + "/whole"))
    assert (np.abs(final(tmp + "/on")["tendon_memory"]) > 1e-6).all()
    print("tendons that rub go on to the same bits")


def joined(tmp):
    """Rods that junctions join, rigidly and by a ball, under a pin that moves, and springs between vertices: frames and
    reactions go on to the same bits."""
    rod = "measure: angle, material: {radius: 0.002, young: 1e7, poisson: 0.4, density: 1000}"
    write(tmp + "/joined.yaml", f"""gravity: [0, 0, -9.81]
simulation: {{dt: 2e-3}}
rods:
- {{name: a, line: {{from: [0, 0, 0], to: [0.3, 0, 0], edges: 12}}, {rod}}}
- {{name: b, line: {{from: [0.3, 0, 0], to: [0.5, 0.2, 0.1], edges: 12}}, {rod}}}
- {{name: c, line: {{from: [0.5, 0.2, 0.1], to: [0.5, 0, 0], edges: 6}}, {rod}}}
supports:
- {{rod: a, vertex: 0, type: clamp}}
- {{rod: b, vertex: 0, type: pin, motion: {{velocity: [0, 0, 0.2]}}}}
junctions:
- {{type: rigid, members: [{{rod: a, vertex: last}}, {{rod: b, vertex: 0}}]}}
- {{type: ball, members: [{{rod: b, vertex: last}}, {{rod: c, vertex: 0}}]}}
""")
    with open(tmp + "/joined.yaml") as scene:
        write(tmp + "/tied.yaml", scene.read() + """constraints:
- {name: soft, type: pin, rod: c, vertex: last, to: {rod: a, closest: true}, stiffness: 2}
- {type: pin, rod: b, vertex: 6, to: {rod: b, vertex: 2}, stiffness: 1, damping: 0.05}
""")
    with open(tmp + "/joined.yaml") as scene:
        write(tmp + "/bodies.yaml", scene.read() + """bodies:
- {name: bob, box: {size: [0.04, 0.02, 0.02]}, density: 1000, position: [0.5, 0, 0.02], angular_velocity: [3, 1, 0]}
- {name: puck, sphere: {radius: 0.02}, density: 500, position: [0.15, 0.05, 0], torque: [0, 0, 1e-5]}
constraints:
- {type: weld, rod: c, vertex: last, body: bob}
- {type: pin, rod: a, vertex: 6, body: puck, stiffness: 5, damping: 0.01}
- {type: rotation, rod: a, edge: 6, body: puck, stiffness: 0.01}
""")
    with open(tmp + "/bodies.yaml") as scene:
        write(tmp + "/jointed.yaml", scene.read() + """- {type: pin, rod: a, vertex: 8, body: arm}
joints:
- {name: exact, type: hinge, child: lower, parent: arm, point: [0.2, 0.13, 0], axis: [1, 0, 1], range: [-0.3, 2], range_stiffness: 0.1}
- {name: motor, type: hinge, child: arm, parent: puck, point: [0.17, 0.06, 0], drive: {table: [[0, 0], [0.1, 0.3], [1, 1]], stiffness: 0.01, damping: 0.001}}
- {name: soft, type: ball, child: bob, point: [0.5, 0, 0.02], stiffness: 5, damping: 0.1}
colliders:
- {name: floor, plane: {normal: [0, 1, 0]}, position: [0, -0.03, 0]}
contact: {friction: 0.3, radius: 0.002}
""")
    with open(tmp + "/jointed.yaml") as scene:
        arms = "bodies:\n" + "".join(f"- {{name: {name}, box: {{size: [0.02, 0.06, 0.02]}}, density: 800, position: [0.2, {y}, 0]}}\n" for name, y in (("arm", 0.1), ("lower", 0.16)))
        write(tmp + "/jointed.yaml", scene.read().replace("bodies:\n", arms))
    for scene, integrator in (("jointed", "euler"), ("jointed", "bdf2"), ("jointed", "generalized_alpha"), ("bodies", "euler"), ("bodies", "bdf2"), ("bodies", "midpoint"), ("bodies", "generalized_alpha"),
                              ("bodies", "energy_momentum"), ("tied", "euler"), ("tied", "bdf2"), ("tied", "midpoint"), ("joined", "euler"), ("joined", "bdf2"),
                              ("joined", "sdirk2"), ("joined", "midpoint"), ("joined", "generalized_alpha")):
        base = ["-scene", f"{tmp}/{scene}.yaml", "-integrator", integrator, "-output_interval", 0.05]
        run(0, *base, "-t_end", 0.1, "-output_dir", tmp + "/half")
        run(0, *base, "-t_end", 0.2, "-restart", tmp + "/half/checkpoint.h5", "-output_dir", tmp + "/on")
        run(0, *base, "-t_end", 0.2, "-output_dir", tmp + "/whole")
        same(final(tmp + "/on"), final(tmp + "/whole"))
        whole = rows(tmp + "/whole")[-1]
        if scene == "joined" and integrator != "euler":  # the work of a pin counts all members of its junction
            assert abs(whole["dissipated"]) < 1e-3 * whole["kinetic"], (integrator, whole["dissipated"], whole["kinetic"])
    print("junctions go on to the same bits")


def signals(tmp):
    out = tmp + "/out"
    base = ["-scene", cantilever, "-dt", 1e-3, "-output_dir", out]
    run(0, *base, "-t_end", 2, "-output_dir", tmp + "/whole")

    def interrupted(number, *options):
        process = started(*base, *options)
        until(lambda: " 1000" in logOf(out) and "time " in logOf(out), process)
        process.send_signal(number)
        return process, process.communicate()[0]

    for number, code, name in ((signal.SIGINT, 130, "SIGINT"), (signal.SIGTERM, 143, "SIGTERM")):
        process, text = interrupted(number, "-t_end", 1000)
        assert process.returncode == code, (process.returncode, text)
        assert f"stopped by {name} at time" in text and "go on with: " in text and "-restart auto" in text, text
        state = final(out)
        with Trajectory(out) as t:
            assert t.time[-1] == state["time"] and np.array_equal(t.field("position")[-1], state["position"]), "the last frame is not where it stopped"
        assert rows(out)["time"][-1] == state["time"]
        end = 2 if state["time"] < 2 else 0
        if end:
            run(0, *base, "-t_end", 2, "-restart", "auto", says="goes on from")
            same(final(tmp + "/whole"), final(out))
    # One request may come as two signals, as `timeout` sends them; half a second later another one ends the run at once, in the middle of a step.
    process = started(*base, "-t_end", 1000)
    until(lambda: " 1000" in logOf(out) and "time " in logOf(out), process)
    for _ in range(3):
        process.send_signal(signal.SIGINT)
        time.sleep(0.001)
    text = process.communicate()[0]
    assert process.returncode == 130 and "stopped by SIGINT" in text, (process.returncode, text)
    write(tmp + "/long.yaml", "simulation: {mode: static}\nrods: [{line: {from: [0, 0, 0], to: [1, 0, 0], edges: 1000000}, material: {radius: 0.01, young: 1e7,"
          " poisson: 0.3, density: 1000}}]\nsupports: [{vertex: 0, type: clamp}]\n")
    process = started("-scene", tmp + "/long.yaml", "-output_dir", tmp + "/long")
    until(lambda: os.path.exists(tmp + "/long/trajectory.h5"), process)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    time.sleep(0.7)
    process.send_signal(signal.SIGINT)
    text = process.communicate()[0]
    assert process.returncode == -signal.SIGINT and "once more ends the run" in text, (process.returncode, text)
    run(75, *base, "-t_end", 1000, "-time_limit", 0.7, says=["stopped by -time_limit at time", "-restart auto"])
    assert os.path.exists(out + "/checkpoint.h5")
    run(75, "-scene", source + "/data/scenes/elastica.yaml", "-mode", "static", "-load_steps", 100000, "-output_dir", tmp + "/static", "-time_limit", 1e-3, says="at load factor")
    run(0, "-scene", source + "/data/scenes/elastica.yaml", "-mode", "static", "-load_steps", 100, "-output_dir", tmp + "/static", "-restart", "auto", says="load_steps: 1")
    run(1, *base, "-time_limit", 0, says="-time_limit")
    # These end the run as they end any program, without a word about PETSc; what was flushed is whole.
    for number in (signal.SIGHUP, signal.SIGQUIT):
        process, text = interrupted(number, "-t_end", 1000)
        assert process.returncode == -number and "PETSC" not in text and "Caught" not in text, text
        with Trajectory(out) as t:
            assert len(t.time) > 0
    pipe = subprocess.Popen(f"{' '.join(command(*base))} -t_end 1000 | head -1; echo ${{PIPESTATUS[0]}}", shell=True, executable="/bin/bash", stdout=subprocess.PIPE,
                            stderr=subprocess.STDOUT, text=True)
    text = pipe.communicate(timeout=300)[0]
    assert text.split("\n")[1] == str(128 + signal.SIGPIPE) and "PETSC" not in text, text
    # What was ignored stays so (nohup).
    process = started(*base, "-t_end", 0.3, preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
    until(lambda: " 0.3" in logOf(out), process)
    process.send_signal(signal.SIGHUP)
    text = process.communicate()[0]
    assert process.returncode == 0, text
    print("signals end runs in order")


def full(tmp):
    """No file may grow beyond a limit, as on a full disk."""
    def limit(size):
        return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    out = tmp + "/out"
    base = ["-scene", cantilever, "-dt", 1e-3, "-output_dir", out]
    run(0, *base, "-t_end", 2, "-output_dir", tmp + "/whole")
    with Trajectory(tmp + "/whole") as t:
        times, positions = np.array(t.time), t.field("position")[:]
    environment = {**os.environ, "PMIX_MCA_gds": "hash"}  # MPI's own large files would be the first to fail
    with_frames = 0
    for size in (5000000, 2000000, 1000000, 300000, 100000, 40000, 20000, 5000, 1):
        text = run(3, *base, "-t_end", 2, "-checkpoint_interval", 20, preexec_fn=limit(size), env=environment, says="cannot be written")
        assert "disk full" in text, text
        assert not glob.glob(out + "/*.part"), glob.glob(out + "/*")
        if os.path.exists(out + "/checkpoint.h5"):
            run(0, *base, "-t_end", 2, "-output_dir", tmp + "/on", "-restart", out + "/checkpoint.h5", says="goes on from")
            same(final(tmp + "/whole"), final(tmp + "/on"))
        try:
            with Trajectory(out) as t:
                n = len(t.time)
                assert np.array_equal(t.time, times[:n]) and np.array_equal(t.field("position")[:n], positions[:n])
                with_frames += n > 1
        except Exception as e:  # too small for its header
            assert size <= 40000, (size, e)
    assert with_frames >= 1
    # The folder is there, but nothing fits: on a real full disk, where one can be mounted.
    disk = tmp + "/disk"
    os.mkdir(disk)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=256k", "none", disk], capture_output=True).returncode == 0:
        try:
            run(3, *base, "-t_end", 2, "-output_dir", disk + "/out", "-checkpoint_interval", 20, says="disk full")
            if os.path.exists(disk + "/out/checkpoint.h5"):
                run(0, *base, "-t_end", 2, "-output_dir", tmp + "/on", "-restart", disk + "/out/checkpoint.h5")
                same(final(tmp + "/whole"), final(tmp + "/on"))
            with Trajectory(disk + "/out") as t:
                assert np.array_equal(t.field("position")[:], positions[: len(t.time)])
            print("on a full disk of its own, too")
        finally:
            subprocess.run(["umount", disk], check=True)
    print("full disks are told,", with_frames, "with frames")


for test in (letGo, changes, balances, folders, automatic, orders, touching, amongRods, bodiesTouch, tendonsRub, joined, signals, full):
    if len(sys.argv) > 3 and test.__name__ not in sys.argv[3:]:
        continue
    with tempfile.TemporaryDirectory() as folder:
        test(folder)
