#!/usr/bin/python3
"""The same bits on any number of ranks: ranks.py <tendril> <source folder> [--short] [<group>...]. Rods that are all different, by
themselves and in islands, run on 1, 2 and 4 ranks; every dataset of trajectories and checkpoints, exit codes and what
is told have to be the same. A run that takes longer than its limit has stood still, and fails."""
import os
import random
import re
import subprocess
import sys
import tempfile

import h5py
import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
LIMIT = 120  # [s] of a run; the longest takes a tenth alone
# What says how a run was made, and by how many.
OF_THE_RUN = {"ranks", "command_line", "options", "created", "wall_seconds", "scene"}
RANKS = (1, 2, 4)
SHORT = "--short" in sys.argv  # for CTest; scripts/nightly runs all
folder = tempfile.mkdtemp(prefix="ranks")


def launch(ranks, *options, code=0):
    """What a run tells on both outputs; it has to end with this exit code."""
    command = [program, *(str(o) for o in options)]
    if ranks > 1:
        command = ["mpiexec", "--oversubscribe", "--bind-to", "none", "-n", str(ranks), *command]
    environment = {**os.environ, "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    done = subprocess.run(command, capture_output=True, text=True, timeout=LIMIT, cwd=folder, env=environment)
    assert done.returncode == code, f"{ranks} ranks: exit code {done.returncode} instead of {code}\n{done.stdout}{done.stderr}"
    assert "PETSC ERROR" not in done.stdout + done.stderr, done.stdout + done.stderr
    return done.stdout, done.stderr


def contents(path):
    """Arrays and attributes of a file by name."""
    found = {}

    def look(name, item):
        short = name.split("/")[-1]
        if short in OF_THE_RUN or name == "options" or "/" in name and name.split("/")[0] == "scene_files":
            return
        for key, value in item.attrs.items():
            found[f"{name}.{key}"] = np.asarray(value)
        if isinstance(item, h5py.Dataset):
            found[name] = item[()] if item.shape == () else item[:]

    with h5py.File(path, "r", swmr=False) as file:
        for key, value in file.attrs.items():
            if key not in OF_THE_RUN:
                found[f".{key}"] = np.asarray(value)
        file.visititems(look)
    return found


def compare(one, other, label):
    a, b = contents(one), contents(other)
    assert a.keys() == b.keys(), f"{label}: {a.keys() ^ b.keys()}"
    assert len(a) > 10, f"{label}: little was compared"
    differ = []
    for name in a:
        x, y = np.asarray(a[name]), np.asarray(b[name])
        same = x.shape == y.shape and x.dtype == y.dtype and x.tobytes() == y.tobytes()
        if not same and x.dtype == object:
            same = list(np.ravel(x)) == list(np.ravel(y))
        if not same:
            apart = np.abs(x - y).max() if x.shape == y.shape and x.dtype.kind == "f" else f"{x.shape} and {y.shape}"
            differ.append(f"{name} ({apart})")
    assert not differ, f"{label}: {', '.join(differ)} differ"


def told(text):
    """Lines of a run that do not say how it was made."""
    lines = []
    for line in text.splitlines():
        if re.match(r"(ranks: |warning: .* of .* ranks have nothing|warning: with -continuation|warning: the island|.*tendril |goes on from|working for|  memory )", line):
            continue
        lines.append(re.sub(r"[0-9.e+-]+ s, results in \S+|[0-9.e+-]+ s left|took [0-9.e+-]+ s", "", line))
    return lines


def same(name, *options, code=0, ranks=RANKS, says=None, checkpoint=True):
    """Runs on all numbers of ranks, compared with that on one."""
    for n in ranks:
        out, err = launch(n, *options, "-output_dir", f"{name}_{n}", code=code)
        err = "\n".join(line for line in err.splitlines() if line.startswith("tendril:"))
        if n == ranks[0]:
            first = told(out), err
            if says:
                assert re.search(says, out + err), f"{name}: does not say '{says}':\n{out}{err}"
            continue
        assert told(out) == first[0], f"{name} on {n} ranks tells\n{out}\ninstead of\n" + "\n".join(first[0])
        assert err == first[1], f"{name} on {n} ranks: {err}\ninstead of\n{first[1]}"
        assert "ranks: " in out or "share one load factor" in out, out
        for file in ("trajectory.h5", "checkpoint.h5") if checkpoint else ("trajectory.h5",):
            compare(f"{folder}/{name}_{ranks[0]}/{file}", f"{folder}/{name}_{n}/{file}", f"{name} on {n} ranks, {file}")
    print(f"{name}: the same on {', '.join(str(n) for n in ranks)} ranks", flush=True)


def material(rng, more=""):
    return (f"{{radius: {rng.uniform(8e-4, 2e-3):.6g}, young: {10 ** rng.uniform(6, 7.5):.6g}, poisson: 0.4, "
            f"density: {rng.uniform(900, 1500):.6g}{more}}}")


def rods(rng, count, edges=(30, 120), more="", dip=0.3):
    """Lines of different lengths, directions, edges and materials, side by side along z."""
    text = ""
    for i in range(count):
        length = rng.uniform(0.1, 0.4)
        text += (f"  - {{name: r{i}, line: {{from: [0, 0, {0.02 * i:.6g}], to: [{length:.6g}, "
                 f"{length * rng.uniform(-dip, dip):.6g}, {0.02 * i:.6g}], edges: {rng.randint(*edges)}}}, "
                 f"material: {material(rng, more if i % 3 == 0 else '')}}}\n")
    return text


def write(name, text):
    path = f"{folder}/{name}.yaml"
    with open(path, "w") as file:
        file.write(text)
    return path


def lone(mode="{mode: dynamic, dt: 0.005, t_end: 0.05}", damping=True):
    """Lone rods of all kinds: clamped, pinned, on springs, pulled, turned, damped; a ring, a cable."""
    rng = random.Random(1)
    count = 48
    text = f"gravity: [0, -9.81, 0]\nsimulation: {mode}\nrods:\n"
    text += rods(rng, count, more=", stiffness_damping_coefficient: 1e-3" if damping else "")
    text += f"  - {{name: hoop, ring: {{radius: 0.1, center: [0, 0, -0.1], edges: 70}}, material: {material(rng)}}}\n"
    text += ("  - {name: rope, line: {from: [0, 0, -0.2], to: [0.3, 0, -0.2], edges: 40}, "
             "material: {linear_density: 0.01, axial_stiffness: 100, flexural_stiffness: 0, torsional_stiffness: 0}}\n")
    text += "supports:\n"
    for i in range(count):
        moving = ", motion: {velocity: [0, 0.1, 0]}" if i % 7 == 0 else ""
        text += f"  - {{rod: r{i}, vertex: 0, type: clamp{moving}}}\n"
    text += "  - {rod: hoop, vertex: 0, type: pin}\n  - {rod: rope, vertex: 0, type: pin}\n  - {rod: rope, vertex: last, type: pin}\n"
    text += "constraints:\n"
    for i in range(1, count, 5):
        text += f"  - {{name: spring{i}, type: pin, rod: r{i}, vertex: last, stiffness: {rng.uniform(0.1, 2):.6g}, damping: {0.01 if damping else 0}}}\n"
    text += "loads:\n"
    for i in range(2, count, 6):
        text += f"  - {{rod: r{i}, vertex: last, force: [0, {rng.uniform(1e-4, 1e-3):.6g}, 0]}}\n"
    return text


def group_lone():
    path = write("lone", lone())
    for method in ("bdf2", "energy_momentum") if SHORT else ("euler", "bdf2", "bdf3", "generalized_alpha", "energy_momentum", "midpoint", "symplectic2", "sdirk2", "sdirk23", "sdirk33"):
        same(f"lone_{method}", "-scene", path, "-integrator", method, "-output_fields", "all,force,moment,reaction,curvature")
    same("lone_metis", "-scene", path, "-partition", "metis", "-integrator", "midpoint", ranks=(1, 4))
    same("lone_adapted", "-scene", path, "-dt_adapt", "error", "-integrator", "bdf2", "-error_estimate", "-output_interval", 0.01)


def islands():
    """Pairs that lie far apart in the scene, so that their rods are not neighbours there, and lone rods between."""
    rng = random.Random(2)
    pairs = 12
    text = "gravity: [0, -9.81, 0]\nsimulation: {mode: dynamic, dt: 0.005, t_end: 0.05}\nrods:\n"
    for half in ("a", "b"):
        for i in range(pairs):
            z, n = 0.05 * i, 20 + 3 * i
            ends = ("[0, 0, {z}]", "[0.2, 0, {z}]") if half == "a" else ("[0.2, 0, {z}]", "[0.2, -0.1, {z}]")
            begin, end = (e.format(z=f"{z:.6g}") for e in ends)
            text += f"  - {{name: {half}{i}, line: {{from: {begin}, to: {end}, edges: {n}}}, material: {material(rng)}}}\n"
    text += rods(rng, 10, (10, 20))
    text += "supports:\n"
    for i in range(pairs):
        text += f"  - {{rod: a{i}, vertex: 0, type: clamp{', motion: {angular_velocity: [0, 0.2, 0]}' if i % 4 == 1 else ''}}}\n"
    for i in range(10):
        text += f"  - {{rod: r{i}, vertex: 0, type: clamp}}\n"
    text += "junctions:\n"
    for i in range(0, pairs, 2):
        kind = "rigid" if i % 4 == 0 else "ball"
        text += f"  - {{name: j{i}, type: {kind}, members: [{{rod: a{i}, vertex: last}}, {{rod: b{i}, vertex: 0}}]}}\n"
    text += "constraints:\n"
    for i in range(1, pairs, 2):
        text += f"  - {{name: tie{i}, type: pin, rod: b{i}, vertex: 0, to: {{rod: a{i}, vertex: last}}, stiffness: 50}}\n"
    # One body on two pairs that are not neighbours, one at the end of a pair, one on a spring, one alone.
    text += "  - {type: weld, rod: b0, vertex: last, body: bar}\n  - {type: pin, rod: b8, vertex: last, body: bar}\n"
    text += "  - {type: weld, rod: b2, vertex: last, body: bob}\n"
    text += "  - {type: pin, rod: b6, vertex: last, body: puck, stiffness: 50, damping: 0.01}\n"
    text += "bodies:\n"
    for k, name in enumerate(("bar", "bob", "puck", "alone")):
        text += f"  - {{name: {name}, box: {{size: [0.02, 0.03, 0.04]}}, density: 500, position: [0.2, -0.12, {0.1 * k}], angular_velocity: [{int(k < 2)}, 0, {k}]}}\n"
    text += "joints:\n  - {type: hinge, child: alone, parent: puck, point: [0.2, -0.12, 0.25], axis: [0, 0, 1], drive: {stiffness: 0.01, damping: 1e-4}}\n"
    text += "  - {type: ball, child: bob, point: [0.2, -0.1, 0.1], stiffness: 100, damping: 0.1}\n"
    return text


def group_islands():
    path = write("islands", islands())
    for method in ("bdf2",) if SHORT else ("euler", "bdf2"):
        same(f"islands_{method}", "-scene", path, "-integrator", method, "-output_fields", "all,reaction,constraint_force,joint_force,joint_moment")
    same("islands_metis", "-scene", path, "-partition", "metis")
    # Only the rank of the ring with an arm, which MUMPS takes, asks for an option of MUMPS.
    ring = re.sub(r"(supports:\n)", r"  - {name: hoop, ring: {radius: 0.1, center: [0, 0, -1], edges: 60}, material: &rubber {radius: 1e-3, young: 1e7, poisson: 0.4, density: 1000}}\n"
                  r"  - {name: arm, line: {from: [0.1, 0, -1], to: [0.3, 0, -1], edges: 20}, material: *rubber}\n\1  - {rod: arm, vertex: last, type: clamp}\n", open(path).read())
    ring = ring.replace("junctions:\n", "junctions:\n  - {name: on_ring, type: rigid, within: 1, members: [{rod: hoop, vertex: 0}, {rod: arm, vertex: 0}]}\n")
    for n in (1, 2):
        launch(n, "-scene", write("ring", ring), "-output_dir", "ring", "-mat_mumps_icntl_14", 50)
    # On a path all rods are one system, in whatever order their islands are.
    still = open(path).read().split("  - {type: weld, rod: b0")[0]  # a body by itself has no equilibrium
    still = re.sub(r", motion: {[^}]*}}", "}", still).replace("mode: dynamic, dt: 0.005, t_end: 0.05", "mode: static, load_steps: 4")
    same("islands_path", "-scene", write("islands_path", still), "-continuation", "arclength", "-arclength_steps", 6, ranks=(1, 2), checkpoint=False, says="6 steps")
    out, _ = launch(4, "-scene", path, "-partition", "metis", "-output_dir", "islands_log")
    line = re.search(r"^ranks: 4, (\d+) blocks of rods by METIS, \d+ to \d+ edges a rank \(a coupling counts as 100\), imbalance ([0-9.]+), no coupling cut$", out, re.M)
    assert line and int(line[1]) >= 12 and float(line[2]) < 1.2, out


def contacts():
    """Rods fall on a floor, and a ram comes up from below."""
    rng = random.Random(4)
    text = "gravity: [0, -9.81, 0]\nsimulation: {mode: dynamic, dt: 0.005, t_end: 0.15}\nrods:\n" + rods(rng, 40, (20, 40))
    text += ("contact: {friction: 0.3}\ncolliders:\n  - {name: floor, plane: {normal: [0, 1, 0]}, position: [0, -0.15, 0]}\n"
             "  - {name: ram, box: {size: [0.1, 0.02, 2]}, position: [0.2, -0.3, 0.4], motion: {velocity: [0, 1, 0]}}\n")
    text += "bodies:\n"
    for k, shape in enumerate(("box: {size: [0.03, 0.02, 0.04]}", "sphere: {radius: 0.02}", "cylinder: {radius: 0.02, length: 0.05}")):
        text += f"  - {{{shape}, density: 800, position: [0.2, {-0.1 - 0.01 * k}, {0.3 + 0.1 * k}], angular_velocity: [3, 0, {k}]}}\n"
    return text


def group_contact():
    path = write("contact", contacts())
    for method in ("bdf2",) if SHORT else ("euler", "bdf2"):
        same(f"contact_{method}", "-scene", path, "-integrator", method, "-output_fields", "all,contact_force,contacts,collider_force")


def crossings(bodies):
    """Four blocks of eight cords: those of the first are drawn down on those of the second, with friction, and a ball falls
    on the last."""
    text = ("gravity: [0, -9.81, 0]\nsimulation: {mode: dynamic, dt: 0.001953125, t_end: 0.046875}\n"
            f"contact: {{rods: others, bodies: {str(bodies).lower()}, distance: 1e-3}}\nrods:\n")
    for block in range(4):
        for i in range(8):
            y, slope = (0.0055 if block == 0 else 0) + (block // 2) * -0.3, 0.2 * (block == 0)
            x = 0.05 * i + 1.0 * (block == 3)
            text += (f"  - {{name: r{block}{i}, line: {{from: [{x:.6g}, {y:.6g}, {-slope - 0.1:.6g}], "
                     f"to: [{x + 0.2 * (block == 0):.6g}, {y:.6g}, {slope + 0.1:.6g}], edges: {100 + i}}}, "
                     f"material: {{radius: 0.002, young: {1e7 * (1 + i)}, poisson: 0.4, density: {1000 + 10 * block}}}"
                     f"{', contact: {friction: 0.3}' if block < 2 else ''}}}\n")
    text += "supports:\n"
    for block, i in ((b, i) for b in range(4) for i in range(8)):
        speed = ", motion: {velocity: [0, -0.5, 0]}" if block == 0 else ""
        text += "".join(f"  - {{rod: r{block}{i}, vertex: {v}, type: pin{speed}}}\n" for v in ("0", "last"))
    if bodies:
        text += ("bodies:\n  - {name: ball, sphere: {radius: 0.02}, density: 500, position: [1.101, -0.275, 0.01], velocity: [0, -0.5, 0]}\n"
                 "  - {name: stone, sphere: {radius: 0.01}, density: 500, position: [3, 0, 0]}\n"
                 "constraints:\n  - {name: thread, type: pin, body: stone, rod: r20, vertex: 50, stiffness: 1e-6}\n")
    return text


def near(one, other, label, tolerance=1e-10):
    """Fields of both files differ by no more than solving leaves."""
    a, b = contents(one), contents(other)
    assert a.keys() == b.keys(), f"{label}: {a.keys() ^ b.keys()}"
    worst = 0
    for name, x in a.items():
        if x.dtype.kind == "f" and x.size and "diagnostics" not in name and "rounding" not in name and not name.endswith("_low"):
            x, y = (np.nan_to_num(v, nan=1e300) for v in (x, b[name]))
            apart = np.abs(x - y).max() / max(np.abs(x).max(), 1e-30)
            worst = max(worst, apart)
            assert apart < tolerance, f"{label}: {name} by {apart:.1e}"
    return worst


def group_touching():
    """Rods of different ranks come to touch: these go on on one. Their Newton iterations end together then, so answers
    are the same to what those leave."""
    for name, bodies, method, ranks_left in (("cords", False, "bdf2", {2: 2, 4: 3}), ("ball", True, "euler", {4: 3})):
        path = write(name, crossings(bodies))
        options = ("-scene", path, "-integrator", method, "-snes_rtol", 1e-12, *(("-t_end", 0.0234375) if bodies else ()))
        launch(1, *options, "-output_dir", f"{name}_1")
        worst = 0
        for n in ranks_left:
            out, _ = launch(n, *options, "-output_dir", f"{name}_{n}")
            lines = re.findall(r"^ranks: rods or bodies of different ones come near each other: (\d+) of", out, re.M)
            assert (int(lines[-1]) if lines else n) == ranks_left[n] and (lines or n == 2), (lines, out)
            with h5py.File(f"{folder}/{name}_{n}/trajectory.h5") as file:
                assert file["diagnostics/contact"][:].max() > 1e-9, "nothing has touched"
            for file in ("trajectory.h5", "checkpoint.h5"):
                worst = max(worst, near(f"{folder}/{name}_1/{file}", f"{folder}/{name}_{n}/{file}", f"{name} on {n} ranks, {file}"))
            if n == 2 or bodies:
                continue
            launch(n, *options, "-t_end", 0.03125, "-output_dir", f"{name}_half")
            launch(2, *options, "-restart", f"{name}_half", "-output_dir", f"{name}_on")
            near(f"{folder}/{name}_1/checkpoint.h5", f"{folder}/{name}_on/checkpoint.h5", f"{name}, gone on with from {n} ranks")
        print(f"{name}: the same on 1, {', '.join(str(n) for n in ranks_left)} ranks to {worst:.1e}", flush=True)


def group_statics():
    path = write("statics", lone("{mode: static, load_steps: 4}", damping=False))
    same("statics", "-scene", path, "-output_fields", "all,force,moment,reaction")
    rng = random.Random(5)
    text = "gravity: [0, 0, 0]\nsimulation: {mode: static, load_steps: 4}\nrods:\n"
    for i in range(50):
        text += (f"  - {{name: c{i}, line: {{from: [{i}, 0, 0], to: [{i}, 1, 0], edges: {rng.randint(30, 40)}}}, "
                 f"material: {{linear_density: 1, axial_stiffness: 1e6, torsional_stiffness: 1, flexural_stiffness: [1, 4]}}}}\n")
    text += "supports:\n  - {rod: all, vertex: 0, type: clamp}\nloads:\n"
    for i in range(50):
        text += f"  - {{rod: c{i}, vertex: last, force: [0, {-1.2 - 0.028 * i:.6g}, 0]}}\n"
    path = write("columns", text)
    for what in ("locate", "switch") if SHORT else ("locate", "stop", "switch"):
        same(f"columns_{what}", "-scene", path, "-bifurcation", what, says="critical load factor")
    text = re.sub(r"loads:.*", "loads:\n  - {rod: all, vertex: last, force: [0, 0, 0.5]}\n", text, flags=re.S)
    path = write("paths", text)
    few = (1, 2) if SHORT else RANKS
    same("path", "-scene", path, "-continuation", "arclength", checkpoint=False, ranks=few)
    same("estimate", "-scene", path, "-error_estimate", says="estimated error: position", ranks=few)
    same("accuracy", "-scene", path, "-accuracy", 1e-3, says="accuracy: rod 'c0' and 49 like it: edges", ranks=few)


def group_failures():
    """One rod cannot follow: all ranks reject the same steps, and end in the same way."""
    path = write("failing", lone() + "  - {rod: r40, vertex: last, force: [0, 3000, 0]}\n")
    same("rejects", "-scene", path, "-dt_min", 1e-9, "-snes_max_it", 6, "-t_end", 0.01)
    same("fails", "-scene", path, "-dt_min", 5e-3, "-snes_max_it", 4, code=2, says="rod 'r40'", checkpoint=True)
    for n in (2,) if SHORT else (2, 4):
        for options, says in ((("-scene", path, "-dt", -1), "-dt"), (("-scene", path, "-nonsense", 1), "nonsense"),
                              (("-scene", "none.yaml"), "none.yaml"), (("-scene", path, "-pc_type", "nothing"), "setting up"),
                              (("-scene", path, "-output_dir", "/proc/none"), "output_dir"), (("-scene", path, "-partition", "even"), "auto, contiguous, metis")):
            out, err = launch(n, *options, code=1)
            mine = [line for line in err.splitlines() if line.startswith("tendril:")]
            assert len(mine) == 1 and says in mine[0], f"{n} ranks, {options}: {out}{err}"
    for option, first in (("--version", r"^tendril "), ("-help", r"-scene"), ("-keys", r"^\[|^\{")):
        out, _ = launch(2, option)
        one, _ = launch(1, option)
        assert out == one and re.search(first, out, re.M), f"{option} on 2 ranks: {out[:200]}"
    two_blocks = write("two_blocks", "gravity: [0, -9.81, 0]\nsimulation: {mode: dynamic, dt: 0.005, t_end: 0.02}\nrods:\n" +
                       rods(random.Random(6), 20, (80, 90)) + "supports:\n  - {rod: all, vertex: 0, type: clamp}\n")
    inside = write("inside", open(two_blocks).read() + "colliders:\n  - {name: ball, sphere: {radius: 0.1}}\n")
    for options, says in (((two_blocks, "-pc_type", "nothing"), "setting up"), ((inside,), "deep in collider 'ball'"), ((two_blocks, "-mat_mumps_icntl_14", 50), "mat_mumps_icntl_14")):
        out, err = launch(4, "-scene", *options, code=1)
        assert len([line for line in err.splitlines() if line.startswith("tendril:")]) == 1 and says in err, out + err
    for path in (two_blocks, source + "/data/scenes/helix.yaml"):  # some ranks have no rods, and still end
        out, err = launch(4, "-scene", path, "-restart", "none.h5", code=1)
        assert len([line for line in err.splitlines() if line.startswith("tendril:")]) == 1 and "none.h5" in err, out + err
    same("few", "-scene", two_blocks)
    out, _ = launch(4, "-scene", source + "/data/scenes/helix.yaml", "-t_end", 0.02, "-output_dir", "idle")
    assert "3 of 4 ranks have nothing to do" in out and "ranks: 1" in out, out
    print("failures: the same, told once", flush=True)


def group_restart():
    path = write("restart", lone())
    contact, islands_ = write("contact", contacts()), write("islands", islands())
    for scene, end in ((contact, 0.15),) if SHORT else ((path, 0.05), (contact, 0.15), (islands_, 0.05)):
        name = os.path.basename(scene)[:-5]
        options = ("-scene", scene, "-integrator", "bdf2")
        for before, after in ((1, 1), (1, 4), (4, 2), (2, 1)):
            to = f"{name}_{before}{after}"
            launch(before, *options, "-t_end", 0.6 * end, "-output_dir", to + "_half")
            launch(after, *options, "-restart", to + "_half", "-output_dir", to)
            compare(f"{folder}/{name}_11/checkpoint.h5", f"{folder}/{to}/checkpoint.h5", f"{name}, {before} then {after} ranks")
        launch(2, *options, "-t_end", 0.6 * end, "-output_dir", name + "_auto")
        out, _ = launch(4, *options, "-restart", "auto", "-output_dir", name + "_auto")
        compare(f"{folder}/{name}_11/checkpoint.h5", f"{folder}/{name}_auto/checkpoint.h5", f"{name}, 2 then 4 ranks by auto")
        out, _ = launch(2, *options, "-restart", "auto", "-output_dir", name + "_auto")
        assert "complete already" in out, out
        print(f"{name}: goes on with other numbers of ranks", flush=True)
    out, _ = launch(2, "-scene", path, "-t_end", 100, "-time_limit", 1, "-output_dir", "limited", code=75)
    assert "stopped by -time_limit" in out, out


def group_cases():
    """Every documented run (scripts/nightly)."""
    for case in sorted(os.listdir(source + "/options/cases")):
        text = open(f"{source}/options/cases/{case}").read()
        path = "arclength" in text
        os.makedirs(folder + "/data", exist_ok=True)
        for name in ("scenes", "polylines", "meshes"):
            if os.path.isdir(f"{source}/data/{name}") and not os.path.exists(f"{folder}/data/{name}"):
                os.symlink(f"{source}/data/{name}", f"{folder}/data/{name}")
        same("case_" + case[:-5], "-options_file", f"{source}/options/cases/{case}", ranks=(1, 2), checkpoint=not path)


groups = {name[6:]: function for name, function in globals().items() if name.startswith("group_")}
for name in [g for g in sys.argv[3:] if g != "--short"] or [g for g in groups if g != "cases"]:
    groups[name]()
