#!/usr/bin/python3
"""What the command line understands, and what a run tells of its input: command_line.py <tendril>."""
import os
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np

program = os.path.abspath(sys.argv[1])
SECTION = "{radius: 0.002, young: 1e9, poisson: 0.3, density: 1000}"
HANGING = f"""simulation: {{dt: 0.01, t_end: 0.5}}
rods:
  - {{name: strand, file: strand.obj, material: {SECTION}}}
supports:
  - {{rod: 0, vertex: 0, type: clamp}}
"""
VERTICES = "".join(f"v {k / 10} 0 0\n" for k in range(11))
LINE = f"""simulation: {{mode: static}}
rods:
  - {{name: a, line: {{from: [0, 0, 0], to: [1, 0, 0], edges: 8}}, material: {{radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}}}}
  - {{name: b, line: {{from: [0, 1, 0], to: [1, 1, 0], edges: 8}}, material: {{radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}}}}
supports:
  - {{rod: all, vertex: 0, type: clamp}}
loads:
  - {{rod: a, vertex: 4, force: [0, 0, 1e-3]}}
"""
# A shaft of 40 edges under a torque of ten turns, T L/GJ = 20 pi: its twist is 20 pi by the angle itself.
SHAFT = """gravity: [0, 0, 0]
simulation: {mode: static, load_steps: 5}
rods:
- line: {from: [0, 0, 0], to: [1, 0, 0], edges: 40}
  material: {linear_density: 1, linear_rotational_inertia: 1e-4, axial_stiffness: 1e8, torsional_stiffness: 0.3, flexural_stiffness: 1e5}
supports:
- {vertex: 0, type: clamp}
loads:
- {edge: last, torque: 18.84955592153876}
"""
CABLE = """simulation: {mode: dynamic, dt: 0.02, t_end: 0.4}
rods:
  - {line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}, material: {axial_stiffness: 1000, linear_density: 0.1, flexural_stiffness: 0}}
supports:
  - {vertex: 0, type: pin}
"""


def run(folder, scene, *options, files=None, first=("-scene",), code=0):
    """Runs a scene and returns what it said, and the places of its last frame."""
    for name, text in {**(files or {}), "scene.yaml": scene}.items():
        with open(f"{folder}/{name}", "w") as f:
            f.write(text)
    done = subprocess.run([program, *first, "scene.yaml", *options], cwd=folder, capture_output=True, text=True)
    assert done.returncode == code, (options, done.returncode, done.stdout, done.stderr)
    with h5py.File(f"{folder}/out/trajectory.h5") as f:
        return done.stdout, f["state/position"][-1], f["rods/vertex_offsets"][:] if "rods/vertex_offsets" in f else None


def warnings(text):
    return [line for line in text.splitlines() if line.startswith("warning: ")]


def commands(folder):
    for word in ("--help", "-h", "-help"):
        done = subprocess.run([program, word], capture_output=True, text=True)
        assert done.returncode == 0 and "-integrator" in done.stdout and done.stderr == "", word
    done = subprocess.run([program, "--version"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.startswith("tendril ") and "Petsc" in done.stdout and done.stdout.count("\n") == 1, done
    # A scene without its option: at the front, between options, and not where one is given.
    _, x, _ = run(folder, LINE)
    for first, options in (((), ()), (("-snes_rtol", "1e-6"), ()), (("-snes_rtol", "1e-6"), ("-output_dir", "out"))):
        _, y, _ = run(folder, LINE, *options, first=first)
        assert np.array_equal(x, y), first
    done = subprocess.run([program, "nowhere.yaml"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 1 and "nowhere.yaml: cannot be opened" in done.stderr, done.stderr
    # A scene through a pipe; memory that PETSc checks; a disk that is full.
    with open(f"{folder}/scene.yaml", "w") as f:
        f.write(LINE)
    for words in (["/dev/stdin"], ["scene.yaml", "-malloc_debug"]):
        with open(f"{folder}/scene.yaml") as f:
            done = subprocess.run([program, *words, "-output_dir", "piped"], cwd=folder, stdin=f, capture_output=True, text=True)
        assert done.returncode == 0 and not done.stderr and "corrupted" not in done.stdout, done
    for word in ("-schema", "--help", "--version"):
        with open("/dev/full", "w") as full:
            assert subprocess.run([program, word], stdout=full, stderr=subprocess.PIPE).returncode == 3, word
    # Steps are not shorter than asked for.
    done = subprocess.run([program, "scene.yaml", "-mode", "dynamic", "-dt", "0.01", "-snes_max_it", "1", "-dt_min", "0.005"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 2 and "failed with dt 0.005" in done.stderr, done
    # A sweep over integrators may have statics in it.
    _, y, _ = run(folder, LINE, "-integrator", "bdf2")
    assert np.array_equal(x, y)


def redraws(folder):
    _, x, _ = run(folder, LINE)
    assert len(x) == 18
    told, y, _ = run(folder, LINE, "-rod_edges", "16")
    assert len(y) == 34 and "rod 'b': 16 edges" in told
    # The same as a scene that is drawn so, to the bit; the force stays at half of the rod.
    _, written, _ = run(folder, LINE.replace("edges: 8", "edges: 16").replace("vertex: 4", "vertex: 8"))
    assert np.array_equal(y, written)
    told, y, _ = run(folder, LINE, "-rod_edges", "16,b:5")
    assert len(y) == 17 + 6 and "rod 'a': 16 edges" in told and "rod 'b': 5 edges" in told
    # Points are joined by cubics, off the curve by h^4/24 of its fourth derivative where all four lie on one side.
    points = [[float(np.sin(s)), 1 - float(np.cos(s)), 0] for s in np.linspace(0, np.pi / 2, 17)]
    arc = f"gravity: [0, 0, 0]\nsimulation: {{mode: static}}\nrods: [{{points: {points}, material: {SECTION}}}]\nsupports: [{{vertex: 0, type: clamp}}]\n"
    _, y, _ = run(folder, arc, "-rod_edges", "40")
    assert len(y) == 41
    with h5py.File(f"{folder}/out/trajectory.h5") as f:
        drawn = f["state/position"][0]
    off = np.abs(np.hypot(drawn[:, 0], drawn[:, 1] - 1) - 1).max()
    assert off < (np.pi / 32) ** 4 / 24, off
    # An estimate is that of the edges in force.
    told, _, _ = run(folder, LINE, "-rod_edges", "32", "-error_estimate")
    fine = told.split("estimated error: position ")[1].split()[0]
    told, _, _ = run(folder, LINE, "-rod_edges", "16", "-error_estimate")
    coarse = told.split("estimated error: position ")[1].split()[0]
    assert 3 < float(coarse) / float(fine) < 5, (coarse, fine)  # second order


def joins(folder):
    pieces = VERTICES + "".join(f"l {k} {k + 1}\n" for k in range(1, 11))
    told, x, _ = run(folder, HANGING, files={"strand.obj": pieces})
    assert "rod 'strand': 10 edges" in told and len(x) == 11
    _, y, _ = run(folder, HANGING, files={"strand.obj": VERTICES + "l 1 2 3 4 5 6 7 8 9 10 11\n"})
    assert np.array_equal(x, y)
    assert abs(x[-1, 1] + 0.872) < 1e-3  # as told to three digits; ten rods of one edge fall to -1.25


def warns(folder):
    told, _, _ = run(folder, SHAFT)
    lines = warnings(told)
    assert len(lines) == 1 and "rod 'rod0' came to turn or twist by up to" in lines[0] and "-rod_measure angle" in lines[0], told
    degrees = float(lines[0].split("up to ")[1].split()[0])
    # measure tan: 2 tan(angle/2)/l cos^-2(angle/2) = T/GJ, the twist a vertex of its equilibrium
    angle = np.radians(degrees)
    assert abs(2 * np.tan(angle / 2) / np.cos(angle / 2) ** 2 - 20 * np.pi / 40) < 0.02, degrees
    assert warnings(run(folder, SHAFT, "-rod_measure", "angle")[0]) == []
    assert warnings(run(folder, SHAFT, "-rod_edges", "160")[0]) == []
    told, x, _ = run(folder, CABLE)
    edges = np.diff(x, axis=0)
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    assert min((edges[1:] * edges[:-1]).sum(axis=1)) < np.cos(np.radians(30)) and warnings(told) == [], told  # it folds, and may
    told, _, _ = run(folder, LINE + "  - {rod: b, vertex: 0, force: [0, 0, 1]}\n")
    assert len(warnings(told)) == 1 and "scene.yaml:9: the force acts on vertex 0 of rod 'b'" in told, told
    moving = LINE.replace("type: clamp", "type: clamp, motion: {table: [[0, 0, 0, 0.1], [1, 0, 0, 0]]}")
    assert len(warnings(run(folder, moving)[0])) == 1 and "scene.yaml:6: the motion begins 0.1 m" in run(folder, moving)[0]
    told, _, _ = run(folder, LINE.replace("{radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}", "default"))
    assert told.count("default material: ") == 1 and "torsional_stiffness 0.0005 N m^2 (rod 'a' and 1 more)" in told, told
    with open(f"{folder}/out/log.txt") as f:
        assert "default material: " in f.read()


def summarises(folder):
    """The block at the end and /summary: a cantilever under a force at its tip, small enough for F L, beside one that has no load."""
    told, x, _ = run(folder, LINE.replace("simulation", "gravity: [0, 0, 0]\nsimulation"))
    block = told.split("at the end, largest values and where:\n")[1].splitlines()
    assert len(block) < 10 and block[0].split()[:3] == ["displacement", block[0].split()[1], "m"], told
    assert block[0].endswith("vertex 8 of rod 'a'") and [line.split()[0] for line in block[:2]] == ["displacement", "tension"], told
    with open(f"{folder}/out/log.txt") as f:
        assert "\n".join(block[:5]) in f.read()
    with h5py.File(f"{folder}/out/trajectory.h5") as f:
        s = dict(f["summary"].attrs)
    mass = 2 * np.pi * 1e-4 * 1000
    assert abs(s["mass"] / mass - 1) < 1e-12 and s["time"] == 1
    assert s["largest_displacement_rod"] == 0 and s["largest_displacement_vertex"] == 8 and s["largest_angle_rod"] == 0
    assert abs(s["largest_displacement"] - np.linalg.norm(x[8] - [1, 0, 0])) < 1e-15
    assert np.allclose(s["centre_of_mass"], [0.5, 0.5, s["centre_of_mass"][2]], 1e-6)
    force, moment = s["reaction"].reshape(-1, 3), s["reaction_moment"].reshape(-1, 3)
    assert np.allclose(force, [[0, 0, -1e-3], [0, 0, 0]], rtol=0, atol=1e-8)  # -snes_rtol of the load
    assert np.allclose(moment, [[0, 5e-4, 0], [0, 0, 0]], rtol=0, atol=1e-7)  # F L/2, and -F times what the arm loses
    assert np.allclose(s["total_reaction"], force.sum(axis=0)) and np.allclose(s["total_reaction_moment"], moment.sum(axis=0), atol=1e-12)
    # A rod that nothing holds and nothing bends.
    told, _, _ = run(folder, LINE.split("supports")[0].replace("static", "dynamic, dt: 0.1, t_end: 0.2"))
    assert "reactions" not in told and "  displacement" in told, told
    with h5py.File(f"{folder}/out/trajectory.h5") as f:
        s = dict(f["summary"].attrs)
    assert s["largest_tension"] < 1e-12 and s["largest_angle_rod"] == -1 and "reaction" not in s, s  # rounding of 9.81 N


def fails(folder):
    """Why a step failed: once, on the standard error and in the log, with what is out of balance; and nothing of a run that is fast."""
    told, _, _ = run(folder, LINE)
    assert "\nload factor 1 of 1  increment " in told and "time" not in told.split("\nload factor")[1] and "working for" not in told, told
    told, _, _ = run(folder, CABLE)
    assert "\ntime 0.1 of 0.4  dt 0.02  its " in told and "load factor" not in told and "working for" not in told, told
    command = [program, "-scene", "scene.yaml", "-snes_max_it", "1"]
    with open(f"{folder}/scene.yaml", "w") as f:
        f.write(LINE)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 2 and "failed" not in done.stdout and done.stderr.count("\n") == 1, done
    balance = r"; rod 'b' \(8 edges\): forces out of balance by ([0-9.e-]+) of its load of ([0-9.]+) N \(asked: 1e-06, -snes_rtol\), most at vertex \d"
    found = re.match(r"tendril: load step at factor 0 failed with increment [0-9.e-]+: the iteration limit \(-snes_max_it\) was reached" + balance, done.stderr)
    assert found and float(found[1]) > 1e-6, done.stderr
    load = 9.81 * np.pi * 1e-4 * 1000  # the weight of the rod
    assert abs(float(found[2]) - load) < 1e-3, (found[2], load)
    with open(f"{folder}/out/log.txt") as f:
        assert f.read().endswith("failed: " + done.stderr[len("tendril: ") :])
    # All of it on one terminal.
    inside, outside = os.openpty()
    terminal = subprocess.Popen(command, cwd=folder, stdout=outside, stderr=outside)
    os.close(outside)
    told = b""
    try:
        while piece := os.read(inside, 4096):
            told += piece
    except OSError:  # the end of a terminal
        pass
    os.close(inside)
    assert terminal.wait() == 2 and told.count(b"failed") == 1 and told.count(b"out of balance") == 1, told
    # What PETSc only finds out when it solves.
    done = subprocess.run([program, "-scene", "scene.yaml", "-pc_type", "shell"], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 1 and done.stderr.startswith("tendril: option -pc_type: solving: ") and done.stderr.count("\n") == 1, done


for test in (commands, redraws, joins, warns, summarises, fails):
    with tempfile.TemporaryDirectory() as place:
        test(place)
