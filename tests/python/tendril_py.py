#!/usr/bin/python3
"""python/tendril.py against runs: tendril_py.py <tendril> <source folder>. Every field with its unit, growing and
killed files, interpolation, format 1, bodies, colliders and tendons, and what goes wrong."""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, source + "/python")

import h5py
import numpy as np

from tendril import TendrilError, Trajectory

# Three rods in free fall, as drawn: they move as a whole, linearly within a step of backward Euler.
FALL = """gravity: [0, -10, 0]
simulation: {dt: 0.125, t_end: 0.5}
rods:
  - {name: strip, line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}, measure: angle, velocity: [1, 0, 0],
     material: {width: 0.02, height: 0.004, young: 1e6, poisson: 0.25, density: 1000}}
  - {name: ring, ring: {center: [0, 0, 2], radius: 0.5, edges: 6}, measure: angle, energy: classical, velocity: [1, 0, 0],
     material: {radii: [0.01, 0.02], young: 1e6, poisson: 0.25, density: 1000}}
  - {name: cable, file: cable.csv, velocity: [1, 0, 0],
     material: {linear_density: 0.1, axial_stiffness: 100, flexural_stiffness: 0}}
"""
HELD = """simulation: {dt: 0.001, t_end: 1000}
rods:
  - {line: {from: [0, 0, 0], to: [1, 0, 0], edges: 8},
     material: {radius: 0.01, young: 1e6, poisson: 0.25, density: 1000}}
  - {line: {from: [0, 1, 0], to: [1, 1, 0], edges: 8}, material: {axial_stiffness: 100, flexural_stiffness: 1e-2}}
supports:
  - {rod: 1, vertex: last, type: clamp}
  - {rod: 0, vertex: 0, type: pin}
"""
# Two blocks and a post between them, round which one of their tendons winds; another misses it.
TENDONS = """gravity: [0, 0, 0]
simulation: {dt: 0.01, t_end: 0.1}
bodies:
  - {name: post, cylinder: {radius: 0.1, length: 0.4}, mass: 1, fixed: true}
  - {name: left, box: {size: [0.1, 0.1, 0.1]}, mass: 1, position: [-0.5, 0.05, 0]}
  - {name: right, box: {size: [0.1, 0.1, 0.1]}, mass: 1, position: [0.5, 0.05, 0]}
joints: [{name: rail, type: prismatic, child: left, axis: [1, 0, 0]}]
tendons:
  - {name: over, path: [{body: left}, {cylinder: post}, {body: right}], displacement: {stiffness: 10, target: -0.05}}
  - {name: bent, path: [{body: left}, {body: world, point: [-0.5, 0.5, 0]}, {body: right, point: [0.5, 0.1, 0]}],
     displacement: {stiffness: 50, damping: 2, table: [[0, 0], [0.1, -0.05]]}}
  - {name: sum, path: [{joint: rail, coefficient: -2}], force: {tension: 1}}
  - {name: clear, path: [{body: left, point: [-0.5, 0.2, 0]}, {cylinder: post}, {body: right, point: [0.5, 0.2, 0]}]}
"""
ALL = "all,position_low,curvature,twist,strain_energy_density,force,moment"
PLACES = {
    "position": ("vertices", 3, "m"), "director": ("edges", 3, "1"), "velocity": ("vertices", 3, "m/s"),
    "twist_rate": ("edges", 1, "rad/s"), "axial_force": ("edges", 1, "N"), "turns": ("cells", 1, "rad"),
    "position_low": ("vertices", 3, "m"), "curvature": ("vertices", 2, "1/m"), "twist": ("vertices", 1, "rad/m"),
    "strain_energy_density": ("vertices", 1, "J/m"), "force": ("edges", 3, "N"), "moment": ("vertices", 3, "N m"),
}


def run(folder, scene, *options, background=False):
    with open(folder + "/cable.csv", "w") as f:
        f.write("0 0 4\n1 0 4\n2 0 4\n")
    with open(folder + "/scene.yaml", "w") as f:
        f.write(scene)
    command = [program, "-scene", folder + "/scene.yaml", "-output_dir", folder + "/out", *options]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    assert background or process.wait() == 0, "the run failed"
    return process


def message(action, *parts):
    """The one line of a TendrilError, which has to hold these parts."""
    try:
        action()
    except TendrilError as e:
        assert "\n" not in str(e) and all(part in str(e) for part in parts), e
        return str(e)
    raise AssertionError(f"no error with {parts}")


def until(event):
    started = time.monotonic()
    while not event():
        assert time.monotonic() < started + 120, "nothing happened"
        time.sleep(0.002)


def frames(folder):
    """Frames that can be read now; none until a run has begun its file."""
    try:
        with Trajectory(folder) as t:
            return len(t.time)
    except TendrilError:
        return 0


def every_field_with_its_unit(folder):
    run(folder, FALL, "-output_fields", ALL)
    t = Trajectory(folder + "/out")
    counts = {"vertices": 5 + 6 + 3, "edges": 4 + 6 + 2, "cells": 3 + 6}
    assert t.format_version == 2 and sorted(t.field_names) == sorted(PLACES), t.field_names
    with h5py.File(folder + "/out/trajectory.h5", "r", locking=False) as f:
        for name, (place, components, unit) in PLACES.items():
            field, stored = t.field(name), f["state/" + name][:]
            assert (field.place, field.unit, t.unit(name)) == (place, unit, unit), field
            assert field.shape == stored.shape and field.shape[1:] == (counts[place], components)[: field.ndim - 1]
            assert np.array_equal(field, stored) and np.array_equal(field[-1], stored[-1])
            assert np.array_equal(field[1:, 2], stored[1:, 2]) and np.array_equal(field[::-1], stored[::-1])
            assert np.array_equal(field[[0, 2]], stored[[0, 2]]) and np.array_equal(field[..., -1], stored[..., -1])
            assert np.array_equal(np.concatenate([r.field(name, 3) for r in t.rods]), stored[3])
            assert np.array_equal(np.concatenate([r.field(name, slice(2)) for r in t.rods], axis=1), stored[:2])
            assert len(list(field)) == len(t.time)
        assert set(f["diagnostics"]) == set(t.diagnostics.dtype.names) and len(t.diagnostics) == 4
        assert all(np.array_equal(t.diagnostics[name], f["diagnostics/" + name]) for name in f["diagnostics"])
    units = {name: t.unit("diagnostics/" + name) for name in t.diagnostics.dtype.names}
    assert units["kinetic"] == units["twist"] == "J" and units["dt"] == "s" and units["newton_iterations"] == "1"
    assert t.unit("kinetic") == "J" and t.unit("time") == "s" and t.unit("axial_stiffness") == "N"
    assert t.unit("half_axes") == "m" and t.unit("flexural_stiffness") == "N m^2" and t.unit("load_factor") == "1"
    assert np.array_equal(t.time, [0, 0.125, 0.25, 0.375, 0.5]) and t.step.tolist() == [0, 1, 2, 3, 4]
    assert len(t.critical) == 0 and t.estimate is None
    assert t.bodies == t.colliders == t.tendons == t.supports == []
    assert t.summary["time"] == 0.5 and t.summary["largest_displacement"] > 1 and t.summary["centre_of_mass"].shape == (3,)


def rods_and_origin(folder):
    t = Trajectory(folder + "/out/trajectory.h5")
    strip, ring, cable = t.rods
    assert [r.name for r in t.rods] == ["strip", "ring", "cable"] and t.rods["ring"].closed and not strip.closed
    assert [(r.vertices, r.edges, r.first_vertex) for r in t.rods] == [(5, 4, 0), (6, 6, 5), (3, 2, 11)]
    assert [r.section for r in t.rods] == ["rectangle", "ellipse", "none"] and len(t.rods[1:]) == 2
    assert [r.energy for r in t.rods] == ["seed", "classical", "seed"]
    assert np.allclose([strip.half_axes, ring.half_axes], [[0.01, 0.002], [0.01, 0.02]], 1e-15)
    assert np.isnan(cable.half_axes).all() and np.isnan(cable.radius) and cable.reference("radius").tolist() == [0] * 3
    assert abs(strip.radius - 0.006) < 1e-15 and np.allclose(strip.reference("radius"), 0.006, 1e-15)
    assert np.array_equal(ring.reference("position"), ring.position(0)) and t.rods[-1].name == "cable"
    assert strip.material["axial_stiffness"] == 1e6 * 0.02 * 0.004
    assert cable.material["flexural_stiffness"].tolist() == [0, 0]
    assert t.scene == FALL and t.scene_files == {"cable.csv": "0 0 4\n1 0 4\n2 0 4\n"}
    assert t.options["dt"] == "0.125" and t.options["mode"] == "dynamic" and t.gravity.tolist() == [0, -10, 0]
    assert str(t.options) == open(folder + "/out/options.yaml").read() and "tendril" in t.attributes["command_line"]


def between_frames(folder):
    with Trajectory(folder + "/out") as t:
        for k, share in ((0, 0.25), (2, 0.5), (3, 1)):
            moment = t.at(t.time[k] + share * 0.125)
            for rod, still in zip(moment.rods, t.rods):
                exact = (1 - share) * still.position(k) + share * still.position(k + 1)
                assert np.array_equal(rod.position(), exact) and rod.name == still.name
                # A fall as a whole moves all vertices alike; a step's velocity is that of its end.
                moved = rod.position() - still.position(0)
                assert np.abs(moved - moved[0]).max() < 1e-9 and abs(moved[0, 0] - moment.time) < 1e-9
                assert np.allclose(np.linalg.norm(rod.director(), axis=1), 1, 1e-15)
                assert np.abs(rod.director() - still.director(0)).max() < 1e-9
            velocity = moment.field("velocity")
            assert np.abs(velocity - [1, -10 * moment.time, 0]).max() < 1e-8
            assert np.array_equal(moment.rods["ring"].field("velocity"), velocity[5:11])
        assert np.array_equal(t.at(0.5).rods[0].position(), t.rods[0].position(-1))
        assert t.at(0.5 * (1 + 1e-12)).time == 0.5
        message(lambda: t.at(0.6), "time 0.6", "0 to 0.5")


def directors_turn_between_frames(folder):
    clamp = "supports: [{vertex: 0, type: clamp, motion: {angular_velocity: [3, 0, 0]}}]\n"
    run(folder, FALL[: FALL.index("  - {name: ring")] + clamp)
    t = Trajectory(folder + "/out")
    d0, d1, half = t.rods[0].director(1)[0], t.rods[0].director(2)[0], t.at(0.1875).rods[0].director()[0]
    assert 0.1 < np.arccos(d0 @ d1) and abs(np.linalg.norm(half) - 1) < 1e-15 and abs(half @ d0 - half @ d1) < 1e-15


def growing(folder):
    process = run(folder, HELD, background=True)
    out, t = folder + "/out", None
    try:
        until(lambda: frames(out) > 0)
        t = Trajectory(out)
        other = Trajectory(out)
        lengths = [len(t.time)]
        while len(lengths) < 4:
            until(lambda: t.refresh() > lengths[-1])
            lengths.append(len(t.time))
            assert len(other.time) <= lengths[0] or other.refresh() >= lengths[-1]
            for name in t.field_names:
                field = t.field(name)
                assert field.shape[0] == len(t.time) == len(field[:]) and np.isfinite(field[-1]).all()
            assert t.rods[1].position().shape == (9, 3) and len(t.diagnostics) >= len(t.time) - 1
            assert np.allclose(np.diff(t.time), 1e-3) and t.step[-1] == len(t.time) - 1
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    other.close()
    subprocess.run([program, "-scene", folder + "/scene.yaml", "-output_dir", out, "-t_end", "0.01"], check=True,
                   stdout=subprocess.DEVNULL)  # readers keep nobody from writing
    assert t.refresh() == 11 and t.rods[0].position().shape == (9, 3)


def killed(folder):
    process, out = run(folder, HELD, background=True), folder + "/out"
    until(lambda: frames(out) > 100)
    t = Trajectory(out)
    process.send_signal(signal.SIGKILL)
    process.wait()
    seen = t.field("position")[:]
    whole = Trajectory(out)
    assert t.refresh() == len(whole.time) >= len(seen) > 100
    assert np.array_equal(whole.field("position")[: len(seen)], seen)
    assert all(len(whole.field(name)[:]) == len(whole.time) for name in whole.field_names)
    supports = [(s.vertex, s.type, s.rod, s.rod_vertex) for s in whole.supports]
    assert supports == [(17, "clamp", "rod1", 8), (0, "pin", "rod0", 0)], supports
    assert abs(t.rods[1].radius - 2 * np.sqrt(1e-2 / 100)) < 1e-15 and t.rods[1].section == "none"


def statics(folder):
    options = ["-bifurcation", "locate", "-error_estimate"]
    command = [program, "-scene", source + "/data/scenes/column.yaml", "-output_dir", folder + "/out", *options]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    t = Trajectory(folder + "/out")
    assert len(t.critical) == 1 and t.critical[0] in t.time and t.unit("time") == t.unit("diagnostics/dt") == "1"
    assert t.estimate["valid"] in (0, 1) and t.estimate["critical_load_factor"].shape == (1,)
    assert t.options["mode"] == "static" and t.unit("critical_error") == "1"


def modes(folder):
    command = [program, "-options_file", "options/cases/hung_spring_modes.yaml", "-output_dir", folder + "/out"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=source)
    t = Trajectory(folder + "/out")
    m, body = t.modes, t.bodies["cube"]
    assert m.frequency.shape == m.growth_rate.shape == (7,) and np.all(np.diff(m.eigenvalue) > 0)
    assert m.frequency[0] == 0 and np.allclose(m.frequency[1:] ** 2, m.eigenvalue[1:], rtol=1e-14)
    assert t.unit("modes/shape") == "m" and t.unit("modes/frequency") == "rad/s"
    # Orthonormal by the masses: of vertices, edges about their tangents, and the body about its centre of mass.
    x, rod = t.rods[0].reference("position"), t.rods[0]
    length = np.linalg.norm(np.diff(x, axis=0), axis=1)
    mass = rod.material["linear_density"] * (np.append(length, 0) + np.append(0, length)) / 2
    mass[-1] = 0  # it is the body's
    spin = rod.material["linear_rotational_inertia"] * length
    now = body.axes()
    centre = m.body_shape[:, 0] + np.cross(m.body_rotation[:, 0], now @ (body.centre - [1.35, 0, 0]))
    product = np.einsum("kvi,v,lvi->kl", m.shape, mass, m.shape) + np.einsum("ke,e,le->kl", m.twist, spin, m.twist)
    inertia = now @ body.inertia @ now.T
    product += body.mass * centre @ centre.T + m.body_rotation[:, 0] @ inertia @ m.body_rotation[:, 0].T
    assert np.allclose(product, np.eye(7), atol=1e-8), product
    # The end of the rod is a point of the body. Modes are about the frame balanced once more, which moves it by 5e-8
    # lengths: what rounding leaves of the equilibrium of so soft a spring.
    arm = rod.position()[-1] - body.position()
    assert np.allclose(m.shape[:, -1], m.body_shape[:, 0] + np.cross(m.body_rotation[:, 0], arm), atol=1e-6)
    with Trajectory(source + "/tests/data/format_1.h5") as old:
        assert old.modes is None


def buckling(folder):
    command = [program, "-options_file", "options/cases/column_buckling.yaml", "-output_dir", folder + "/buckling"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, cwd=source)
    t = Trajectory(folder + "/buckling")
    m = t.modes
    assert m.load_factor.shape == (4,) and m.frequency is None and m.body_shape.shape == (4, 0, 3)
    assert t.unit("modes/load_factor") == "1" and np.allclose(m.load_factor[::2], m.load_factor[1::2], rtol=1e-8)
    assert np.allclose(np.linalg.norm(m.shape, axis=2).max(1), 1) and np.all(np.diff(t.time) > 0)
    assert np.allclose(t.critical, m.load_factor[::2])
    assert all(np.abs(t.time / factor - 1).min() < 1e-4 for factor in m.load_factor)


def format_1():
    t = Trajectory(source + "/tests/data/format_1.h5")
    assert t.format_version == 1 and sorted(t.field_names) == sorted(PLACES) and len(t.time) == 3
    assert all((t.field(n).place, t.unit(n)) == (place, unit) for n, (place, _, unit) in PLACES.items())
    assert [t.unit(n) for n in ("diagnostics/twist", "axial_stiffness", "newton_iterations")] == ["J", "N", "1"]
    bar = t.rods[0]
    assert [(r.name, r.section, r.edges, r.closed) for r in t.rods] == [
        ("rod0", "unknown", 3, False), ("rod1", "unknown", 3, True)], t.rods[:]
    assert np.isnan(bar.half_axes).all() and abs(bar.radius - 0.01) < 1e-16, "that of its round section"
    assert np.abs(t.at(0.075).rods[0].position()[0] - [0.075, -0.05, 0]).max() < 1e-9  # the frames: -0.025, -0.075
    assert t.scene is None and t.scene_files == {} and t.supports == t.bodies == t.colliders == []
    assert t.options == {} and "-output_fields" in t.options.text and t.estimate is None
    message(lambda: bar.field("turns"), "format 1", "cells")


def bodies_and_colliders(folder):
    """As they will be in files: static data in groups of their own, poses of bodies with the fields."""
    path = folder + "/bodies.h5"
    with h5py.File(folder + "/out/trajectory.h5", "r", swmr=True) as a, h5py.File(path, "w", libver="latest") as f:
        for key, value in a.attrs.items():
            f.attrs[key] = value.decode() if isinstance(value, bytes) else value
        for key in a:
            a.copy(key, f)
        n = len(a["time"])
        f["bodies/name"], f["bodies/shape"] = np.array([b"ball", b"wedge"]), np.array([b"sphere", b"mesh"])
        f["bodies/mass"], f["bodies/inertia"] = [2.0, 3.0], np.tile(np.eye(3), (2, 1, 1))
        f["bodies/parameters"] = [[0.5, np.nan], [np.nan, np.nan]]
        f["bodies/meshes/1/vertices"], f["bodies/meshes/1/triangles"] = np.eye(3), [[0, 1, 2]]
        turn = np.zeros((n, 2, 4))
        turn[::2, :, 0] = 1  # a quarter turn about x from frame to frame, there and back, by quaternions of either sign
        turn[1::2] = [[-np.sqrt(0.5), -np.sqrt(0.5), 0, 0]] * 2
        f["state/body_position"], f["state/body_rotation"] = np.arange(n * 6.0).reshape(n, 2, 3), turn
        f["colliders/shape"], f["colliders/parameters"] = np.array([b"plane"]), [[0.0, 1, 0]]
    t = Trajectory(path)
    ball, wedge = t.bodies
    assert (ball.name, ball.shape, ball.mass, ball.vertices) == ("ball", "sphere", 2, None)
    assert wedge.triangles.tolist() == [[0, 1, 2]] and np.array_equal(wedge.vertices, np.eye(3))
    assert ball.parameters.tolist() == [0.5] and len(wedge.parameters) == 0 and np.array_equal(wedge.inertia, np.eye(3))
    assert wedge.pose(1)[0].tolist() == [9, 10, 11] and ball.pose()[1].shape == (4,)
    floor = t.colliders[0]
    assert floor.shape == "plane" and floor.parameters.tolist() == [0, 1, 0]
    assert [v.tolist() for v in floor.pose(2)] == [[0, 0, 0], [1, 0, 0, 0]]
    position, rotation = t.at(0.0625).bodies[1].pose()
    assert t.bodies[1].pose(0)[0].tolist() == [3, 4, 5]
    assert position.tolist() == [6, 7, 8] and np.allclose(rotation, [np.cos(np.pi / 8), np.sin(np.pi / 8), 0, 0], 1e-15)
    assert "body_position" not in t.field_names and len(t.at(0.1).colliders) == 1


def contacts_of_a_rod_at_rest(folder):
    """Rows frame by frame, which add up to what the fields of vertices and of colliders say; and the weight."""
    with open(folder + "/rest.yaml", "w") as f:
        f.write("""gravity: [0, 0, -10]
simulation: {dt: 0.02, t_end: 2}
rods:
  - {name: above, line: {from: [0, 0, 0.02], to: [0.3, 0, 0.02], edges: 6}, layer: high,
     material: {radius: 0.005, young: 1e7, poisson: 0.4, density: 1000}}
  - {name: below, line: {from: [0, 1, 0.0052], to: [0.3, 1, 0.0052], edges: 3},
     material: {radius: 0.005, young: 1e7, poisson: 0.4, density: 1000}}
contact: {friction: 0.3, ignore: [{rods: below, colliders: shelf}]}
colliders:
  - {name: shelf, box: {size: [1, 4, 0.004]}, position: [0, 0, 0.012]}
  - {name: floor, plane: {normal: [0, 0, 1]}}
""")
    subprocess.run([program, "-scene", folder + "/rest.yaml", "-output_dir", folder + "/rest", "-output_fields",
                    "all,contacts,contact_force,collider_force,collider_moment"], check=True, stdout=subprocess.DEVNULL)
    t = Trajectory(folder + "/rest")
    rows = [t.contacts(k) for k in range(len(t.time))]
    assert sum(len(r["gap"]) for r in rows) == len(t._dataset("contacts/gap")) and len(rows[0]["gap"]) < len(rows[-1]["gap"])
    last = rows[-1]
    assert set(last["rod"]) == {0, 1} and np.array_equal(last["rod"], last["collider"]) and (np.diff(last["rod"]) >= 0).all()
    weight = np.pi * 0.005**2 * 1000 * 0.3 * 10
    force = last["normal_force"] + last["friction"]
    for k in (0, 1):
        of_collider = force[last["collider"] == k]
        assert np.allclose(of_collider.sum(0), [0, 0, weight], atol=1e-4 * weight), of_collider.sum(0)
        assert np.allclose(of_collider.sum(0), t.field("collider_force")[-1, k], rtol=0, atol=1e-12)
    arms = last["position"] - np.array([[0, 0, 0.012], [0, 0, 0]])[last["collider"]]
    assert np.allclose(np.cross(arms, last["normal_force"])[last["rod"] == 0].sum(0), t.field("collider_moment")[-1, 0], atol=1e-5)
    assert np.allclose(force.sum(0), t.field("contact_force")[-1].sum(0), rtol=0, atol=1e-12)
    assert np.abs(last["gap"]).max() < 0.0005 and np.allclose(last["normal"], [0, 0, 1])
    message(lambda: t.contacts(10**6), "no frame")
    message(lambda: Trajectory(folder + "/out").contacts(), "-output_fields all,contacts")


def tendons(folder):
    run(folder, TENDONS)
    t = Trajectory(folder + "/out")
    over, bent, total, clear = t.tendons
    assert t.tendons.names == ["over", "bent", "sum", "clear"] and t.tendons["bent"].index == 1
    assert [c.actuator for c in t.tendons] == ["displacement", "displacement", "force", "none"]
    assert [c.points for c in t.tendons] == [19, 3, 0, 19] and bent.segments.tolist() == [[0, 1], [1, 2]]
    places = {"tendons": (4,), "tendon_points": (41, 3)}
    for name, unit in (("displacement", "m"), ("length", "m"), ("rate", "m/s"), ("tension", "N"), ("position", "m")):
        field = t.field("tendon_" + name)
        assert field.unit == unit and field.shape == (len(t.time), *places[field.place]), field
        assert (field.place == "tendon_points") == (name == "position")
    assert (bent.point_tension(slice(None)) == bent.tension(slice(None))[:, None]).all(), "nothing rubs"
    frames = slice(None)

    def drawn(tendon):
        x = tendon.position(frames)
        return np.linalg.norm(x[:, tendon.segments[:, 1]] - x[:, tendon.segments[:, 0]], axis=2).sum(1)

    assert np.allclose(drawn(bent), bent.length(frames), rtol=1e-14)
    assert np.allclose(drawn(clear), clear.length(frames), rtol=1e-14), "it meets nothing"
    short = over.length(frames) - drawn(over)  # chords in place of arcs
    assert (short > 0).all() and short.max() < 1e-5 and len(over.segments) == 18
    touching = np.linalg.norm(over.position(-1)[1:-1, :2], axis=1)
    assert np.allclose(touching, 0.1, rtol=1e-14), "on the post"
    assert np.allclose(bent.position(frames)[:, 0], t.bodies["left"].position(frames), atol=1e-14)
    assert np.allclose(bent.position(frames)[:, 1], [-0.5, 0.5, 0], atol=1e-14) and bent.position().shape == (3, 3)
    for tendon in (over, bent, clear):
        assert np.allclose(tendon.displacement(frames), tendon.length(frames) - tendon.length(0), atol=1e-14)
    moved = t.bodies["left"].position(frames)[:, 0] + 0.5
    assert np.allclose(total.displacement(frames), -2 * moved, atol=1e-14) and np.ptp(moved) > 1e-3
    assert (total.tension(frames) == 1).all() and (total.length(frames) == 0).all()
    assert (clear.tension(frames) == 0).all() and total.position(frames).shape == (len(t.time), 0, 3)
    assert np.allclose(over.tension(frames), 10 * (over.displacement(frames) + 0.05), rtol=1e-12)
    pull = 50 * (bent.displacement(frames) + 0.5 * t.time) + 2 * bent.rate(frames)
    assert np.allclose(bent.tension(frames), np.maximum(pull, 0), rtol=1e-12, atol=1e-12) and bent.tension() > 0
    between = t.at(0.035).tendons["over"]
    assert abs(between.length() - over.length(slice(3, 5)).mean()) < 1e-15
    assert np.allclose(between.position(), over.position(slice(3, 5)).mean(0), atol=1e-15)
    message(lambda: t.tendons["flexor"], "'flexor'", "over, bent, sum, clear")
    message(lambda: t.rods[0].field("tendon_tension"), "tendons", "not one of rods")
    message(lambda: t.rods[0].field("tendon_position"), "tendon_points", "trajectory.tendons")
    message(lambda: over.tension(100), "no frame 100")
    run(folder, TENDONS[: TENDONS.index("  - {name: over")] + "  - {path: [{joint: rail}]}\n")
    alone = Trajectory(folder + "/out").tendons[0]
    assert (alone.name, alone.points, alone.position().shape, alone.segments.shape) == ("tendon0", 0, (0, 3), (0, 2))


def wrong_input(folder):
    good, path = folder + "/out/trajectory.h5", folder + "/wrong.h5"
    t = Trajectory(good)
    with h5py.File(source + "/tests/data/format_1.h5", "r", swmr=True) as f:  # beside others in this process
        assert len(Trajectory(source + "/tests/data/format_1.h5").time) == len(f["time"])
    message(lambda: t.rods["sprint"], "'sprint'", "strip, ring, cable")
    message(lambda: t.rods[3], "no rod 3", "there are 3")
    message(lambda: t.field("speed"), "'speed'", "velocity")
    message(lambda: t.field("reaction"), "'reaction'", "-output_fields all,reaction")
    message(lambda: t.rods[0].field("speed"), "'speed'", "velocity")
    message(lambda: t.rods[0].position(5), "no frame 5", "there are 5")
    message(lambda: t.field("position")[-6], "no frame -6")
    message(lambda: t.unit("speed"), "'speed'", "velocity", "bend")
    message(lambda: t.rods[0].reference("speed"), "'speed'", "position")
    message(lambda: Trajectory(folder + "/nowhere"), "nowhere", "no such file")
    message(lambda: Trajectory(folder), folder + "/trajectory.h5", "no such file")
    cut = open(good, "rb").read()[:3000]
    for content, part in ((b"", "empty"), (b"time,dt\n" * 10, "not an HDF5 file"), (cut, "cannot be opened")):
        with open(path, "wb") as f:
            f.write(content)
        message(lambda: Trajectory(path), path, part)
    with h5py.File(path, "w") as f:
        f["position"] = np.zeros((3, 3))
    message(lambda: Trajectory(path), "not a trajectory")
    for version, part in ((3, "format 3, newer than 2"), (2, "incomplete")):
        with h5py.File(path, "w") as f:
            f.attrs["format"], f.attrs["format_version"] = "tendril-trajectory", version
        message(lambda: Trajectory(path), part)
    try:
        import xarray  # noqa: F401
    except ImportError:
        message(t.to_xarray, "python3-xarray")
    else:
        data = t.to_xarray()
        assert np.array_equal(data["velocity"], t.field("velocity")) and data["moment"].attrs["units"] == "N m"
        assert data["position"].dims == ("time", "vertex", "xyz") and data["vertex_rod"].values[-1] == "cable"
        assert sorted(data.data_vars) == sorted(PLACES) and data["curvature"].dims == ("time", "vertex", "axis")


with tempfile.TemporaryDirectory() as main, tempfile.TemporaryDirectory() as other:
    every_field_with_its_unit(main)
    rods_and_origin(main)
    between_frames(main)
    bodies_and_colliders(main)
    contacts_of_a_rod_at_rest(main)
    wrong_input(main)
    directors_turn_between_frames(other)
    shutil.rmtree(other + "/out")
    growing(other)
    shutil.rmtree(other + "/out")
    killed(other)
    shutil.rmtree(other + "/out")
    statics(other)
    shutil.rmtree(other + "/out")
    modes(other)
    buckling(other)
    shutil.rmtree(other + "/out")
    tendons(other)
    format_1()
print("fields, units, growing and killed files, times between frames, format 1, bodies, tendons, mistakes: "
      "all as documented")
