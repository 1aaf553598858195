#!/usr/bin/python3
"""Files of scripts/export: export.py <tendril> <source folder>. The rules of glTF, what its skins and bodies come to in
every frame, PLY read back, a real run, and what goes wrong."""
import os
import subprocess
import sys
import tempfile

program, root = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, root + "/python")

import h5py
import numpy as np

import skinned
from gltf import Glb
from tendril import Trajectory
from tendril_export import meshes
from tendril_render import source

BODIES = {"ball": ("sphere", [0.3]), "crate": ("box", [0.1, 0.2, 0.3]), "pill": ("capsule", [0.1, 0.2]),
          "drum": ("cylinder", [0.2, 0.1]), "pipe": ("tube", [0.1, 0.15, 0.4]), "wedge": ("mesh", []),
          "frame": ("none", []), "flag": ("mesh", []), "dust": ("mesh", [])}
COLLIDERS = {"floor": ("plane", [0, 1, 0]), "post": ("cylinder", [0.1, np.inf]), "stone": ("box", [1, 1, 0.1])}


def export(*arguments, code=0, says=""):
    """Runs scripts/export; what it says on stderr is one line with the words `says`, or nothing."""
    done = subprocess.run([root + "/scripts/export", *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == code, f"{arguments}: {done.returncode} {done.stderr}"
    lines = done.stderr.splitlines()
    if says:
        assert len(lines) == 1 and lines[0].startswith("export: ") and says in lines[0], f"{arguments}: {lines}"
    else:
        assert not lines and done.stdout.startswith("wrote "), f"{arguments}: {lines}"
    return done.stdout


def add_things(path, frames):
    """Bodies that turn about an axis, by more than once, and colliders."""
    with h5py.File(path, "r+") as f:
        for group, things in (("bodies", BODIES), ("colliders", COLLIDERS)):
            f[group + "/name"], f[group + "/shape"] = list(things), [shape for shape, _ in things.values()]
            f[group + "/parameters"] = np.array([[*p, *[np.nan] * (3 - len(p))] for _, p in things.values()])
        f["colliders/position"] = np.tile([0, -1.0, 0], (len(COLLIDERS), 1))
        f["bodies/meshes/5/vertices"] = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
        f["bodies/meshes/5/triangles"] = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
        f["bodies/meshes/7/vertices"], f["bodies/meshes/7/triangles"] = np.eye(3), np.array([[0, 1, 2]])
        dust = np.random.default_rng(3).random((66000, 3))  # more than 16 bits can count
        f["bodies/meshes/8/vertices"], f["bodies/meshes/8/triangles"] = dust, np.arange(66000).reshape(-1, 3)
        k = np.arange(frames)[:, None, None]
        axis, n = np.array([0.36, 0.48, 0.8]), len(BODIES)
        turn = np.concatenate([np.cos(1.1 * k), np.sin(1.1 * k) * axis], 2) * (-1.0) ** k  # of either sign
        f["state/body_rotation"] = np.tile(turn, (1, n, 1))
        f["state/body_position"] = np.stack([np.arange(n), 0 * np.arange(n), 0 * np.arange(n)], 1) + k * [0, 0.1, 0]
        for name, unit in (("body_rotation", "1"), ("body_position", "m")):
            f["state/" + name].attrs.update({"place": "bodies", "unit": unit})


def close(found, wanted, what, least=1e-5):
    size = np.linalg.norm(np.ptp(wanted.reshape(-1, 3), axis=0))
    assert found.shape == wanted.shape, (what, found.shape, wanted.shape)
    error = np.abs(found - wanted).max() / size
    assert error <= least, f"{what}: {error:.3g} of its size"
    return error


def skins_of_glb_are_the_embedding(glb, t, frames):
    largest = 0
    for rod in t.rods:
        skin = rod.skin or meshes.Tube(rod)
        assert (rod.skin is None) == (rod.name in ("bare", "loop"))
        found, corners = glb.mesh(rod.name)
        at_rest = found["POSITION"][corners]
        close(at_rest, skin.reference()[skin.triangles], rod.name + " as drawn", 1e-6)
        assert len(corners) == len(skin.triangles) and corners.max() + 1 >= skin.points
        outside = np.cross(at_rest[:, 1] - at_rest[:, 0], at_rest[:, 2] - at_rest[:, 0])
        for i in range(3):  # the normals of corners are within the crease of their triangle's
            size = np.linalg.norm(outside, axis=1)
            assert ((outside * found["NORMAL"][corners[:, i]]).sum(1) > 0.7 * size).all(), rod.name
        for key, frame in enumerate(frames):
            wanted = skin.vertices(frame)[skin.triangles]
            largest = max(largest, close(glb.corners(rod.name, key), wanted, f"{rod.name}, frame {frame}"))
    return largest


def bodies_are_where_they_are(glb, t, frames):
    for body in [*t.bodies, *t.colliders]:
        if body.name in ("frame", "floor", "post"):
            assert all(node["name"] != body.name for node in glb.json["nodes"])
            continue
        points, triangles = meshes.thing(body)
        for key, frame in enumerate(frames):
            wanted = points @ body.axes(frame).T + body.position(frame)
            close(glb.corners(body.name, key), wanted[triangles], body.name)
    moving = {c["target"]["node"] for a in glb.list("animations") for c in a["channels"]}
    assert glb.node("ball") in moving and glb.node("stone") not in moving


def volume(points, triangles):
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


def closed(triangles):
    """Each side of a triangle is one of a neighbour, the other way."""
    sides = {(a, b) for t in triangles.tolist() for a, b in zip(t, t[1:] + t[:1])}
    return len(sides) == 3 * len(triangles) and all((b, a) in sides for a, b in sides)


def shapes_have_their_volume(t):
    ring = 16 * np.sin(2 * np.pi / 32)  # area of the 32 sides that stand for a circle
    exact = {"ball": 4 / 3 * np.pi * 0.3**3, "crate": 8 * 0.1 * 0.2 * 0.3, "drum": ring * 0.2**2 * 0.2,
             "pill": np.pi * 0.1**2 * (0.4 + 4 / 3 * 0.1), "pipe": ring * (0.15**2 - 0.1**2) * 0.8, "wedge": 1 / 6}
    for name, wanted in exact.items():
        points, triangles = meshes.thing(t.bodies[name])
        found, slack = volume(points, triangles), 0.02 if name in ("ball", "pill") else 1e-12
        assert closed(triangles) and abs(found / wanted - 1) < slack, f"{name}: {found}, not {wanted}"


def tubes_have_their_section(t):
    for name, corners in (("bare", 4), ("loop", 12)):
        rod, tube = t.rods[name], meshes.Tube(t.rods[name])
        assert closed(tube.triangles) and volume(tube.reference(), tube.triangles) > 0
        assert tube.points == corners * (rod.edges + 2 * (not rod.closed)) + 2 * (not rod.closed)
        x, a = rod.position(2), rod.director(2)
        m, e, frame = skinned.frames(x, a)
        y = tube.vertices(2)
        start = 0 if rod.closed else corners
        for k in range(rod.edges):
            across = (y[start + corners * k : start + corners * (k + 1)] - m[k]) @ frame[k].T
            assert np.abs(across[:, 0]).max() < 1e-15
            if name == "bare":
                assert np.abs(np.abs(across[:, 1:]) - [0.02, 0.01]).max() < 1e-15
            else:
                x0 = rod.reference("position")  # a cable has a thin one, by its length
                radius = 2e-3 * np.linalg.norm(np.diff(x0, axis=0), axis=1).sum()
                assert np.abs(np.hypot(*across[:, 1:].T) - radius).max() < 1e-15
        if not rod.closed:
            assert np.abs(y[-2:] - x[[0, -1]]).max() < 1e-15, "caps are at the ends"


def glb_of_skins(folder):
    path = folder + "/skins.h5"
    skinned.write(path, times=(2.0, 2.25, 2.5, 3.0))
    add_things(path, skinned.FRAMES)
    export(path, "--output", folder + "/all.glb", says="left out, without an end: floor (plane), post (cylinder)")
    export(path, "--output", folder + "/some", "--format", "glb", "--frames", "1:4:2", "--rods", "2:4", says="left out")
    with Trajectory(path) as t:
        glb = Glb(folder + "/all.glb")
        assert glb.times().tolist() == [0, 0.25, 0.5, 1]
        print(f"glb against Skin.vertices: {skins_of_glb_are_the_embedding(glb, t, range(4)):.2g} of the size")
        bodies_are_where_they_are(glb, t, range(4))
        wide = glb.mesh("two")[0]["JOINTS_0"]
        assert len(glb.mesh("dust")[0]["POSITION"]) == 66000
        assert wide.dtype == np.uint16 and glb.mesh("one")[0]["JOINTS_0"].dtype == np.uint8
        some = Glb(folder + "/some")
        assert some.times().tolist() == [0, 0.75] and [s["name"] for s in some.list("skins")] == ["two", "band"]
        for key, frame in enumerate((1, 3)):
            skin = t.rods["band"].skin
            close(some.corners("band", key), skin.vertices(frame)[skin.triangles], "chosen frames")
        shapes_have_their_volume(t)
        tubes_have_their_section(t)


def times_rise(folder):
    """Statics by --fps; a time that is there twice once; a single frame stands still."""
    path = folder + "/times.h5"
    skinned.write(path, times=(0.0, 0.5, 0.25, 1.0), still=True)
    export(path, "--output", folder + "/a.glb", "--fps", 4)
    assert Glb(folder + "/a.glb").times().tolist() == [0, 0.25, 0.5, 0.75]
    skinned.write(path, times=(0.0, 0.5, 0.5, 1.0))
    export(path, "--output", folder + "/a.glb")
    assert Glb(folder + "/a.glb").times().tolist() == [0, 0.5, 1]
    export(path, "--output", folder + "/a.glb", "--frames=-1:")
    glb = Glb(folder + "/a.glb")
    assert "animations" not in glb.json
    with Trajectory(path) as t:
        for rod in t.rods:
            skin = rod.skin or meshes.Tube(rod)
            close(glb.corners(rod.name, 0), skin.vertices()[skin.triangles], "a single frame")


def edges_that_are_there_twice_count_once(folder):
    path = folder + "/twice.h5"
    skinned.write(path)
    with h5py.File(path, "r+") as f:
        edge, weight, local = (f["skins/" + name] for name in ("edge", "weight", "local"))
        edge[:, 2], local[:, 2] = edge[:, 0], local[:, 0]
        weight[:] = [0.5, 0.2, 0.3]
    export(path, "--output", folder + "/twice.glb")
    glb = Glb(folder + "/twice.glb")
    with Trajectory(path) as t:
        skins_of_glb_are_the_embedding(glb, t, range(4))


def ply(path):
    """Points by property, and triangles (m, 3)."""
    with open(path, "rb") as f:
        lines = []
        while not lines or lines[-1] != "end_header":
            lines.append(f.readline().decode().rstrip("\n"))
        content = f.read()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    kinds, lines_of = {"float": "<f4", "int": "<i4"}, [line.split() for line in lines]
    counts = {w[1]: int(w[2]) for w in lines_of if w[0] == "element"}
    words = [w for w in lines_of if w[0] == "property" and "list" not in w]
    points = np.frombuffer(content, [(name, kinds[kind]) for _, kind, name in words], counts["vertex"])
    faces = np.frombuffer(content, [("count", "u1"), ("corners", "<i4", 3)], counts["face"], points.nbytes)
    assert "property list uchar int vertex_indices" in lines and points.nbytes + faces.nbytes == len(content)
    assert (faces["count"] == 3).all()
    return points, faces["corners"]


def ply_is_the_embedding(folder):
    path = folder + "/skins.h5"
    export(path, "--output", folder + "/ply", "--format", "ply", "--frames", "0:4:3")
    assert sorted(os.listdir(folder + "/ply")) == ["frame_0000.ply", "frame_0003.ply"]
    with Trajectory(path) as t:
        surfaces = [rod.skin or meshes.Tube(rod) for rod in t.rods]
        for frame in (0, 3):
            points, triangles = ply(f"{folder}/ply/frame_{frame:04d}.ply")
            assert points.dtype.names == ("x", "y", "z", "nx", "ny", "nz", "rod", "axial_force", "moment", "velocity")
            start = 0
            for k, skin in enumerate(surfaces):
                rows = points[start : start + skin.points]
                x, n = (np.stack([rows[name] for name in names], 1) for names in (("x", "y", "z"), ("nx", "ny", "nz")))
                assert np.array_equal(x, skin.vertices(frame).astype(np.float32)) and (rows["rod"] == k).all()
                assert np.array_equal(n, skin.normals(frame).astype(np.float32))
                values = source.value(t, "moment", k, frame)
                ends = values[skin.edge], values[(skin.edge + 1) % len(values)]
                s = 0.5 + np.clip(skin.local[..., 0] / skin.lengths[skin.edge], -0.5, 0.5)
                wanted = (skin.weight * (ends[0] * (1 - s) + ends[1] * s)).sum(1)
                assert np.allclose(rows["moment"], wanted, 1e-6, 0)
                assert np.array_equal(triangles[: len(skin.triangles)], skin.triangles + start)
                start, triangles = start + skin.points, triangles[len(skin.triangles) :]
            assert start == len(points) and not len(triangles)


def runs(folder):
    """Runs of the program, at the names that the script gives."""
    for scene, options in (("helix", ("-t_end", "0.5")), ("falling_arm", ("-t_end", "0.2")), ("column", ()),
                           ("finger_spatial", ("-t_end", "0.1"))):  # its tendon is left out
        out = f"{folder}/{scene}"
        command = [program, "-scene", f"{root}/data/scenes/{scene}.yaml", "-output_dir", out, *options]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        says = "floor (plane)" if scene == "falling_arm" else ""
        stdout = export(out, "--rods", "0:1", says=says)
        assert stdout == f"wrote {out}/{scene}.glb\n"
        glb = Glb(f"{out}/{scene}.glb")
        with Trajectory(out) as t:
            frames = len(t.time)
            assert len(glb.times()) == frames and (np.diff(glb.times()) > 0).all()
            assert source.is_static(t) == (scene == "column")
            tube = t.rods[0].skin or meshes.Tube(t.rods[0])
            for frame in (0, frames // 2, frames - 1):
                close(glb.corners(t.rods[0].name, frame), tube.vertices(frame)[tube.triangles], scene)
        assert not any("flexor" in node["name"] for node in glb.list("nodes"))
    export(out, "--format", "ply", "--frames=-1:")
    assert len(os.listdir(out + "/ply")) == 1
    export(root + "/tests/data/format_1.h5", "--output", folder + "/old.glb")
    assert len(Glb(folder + "/old.glb").list("skins")) == 2


def wrong_input(folder):
    path, glb = folder + "/skins.h5", folder + "/x.glb"
    for arguments, says in ((["--frames", "4:"], "the run has 4, numbered from 0"), (["--frames", "x"], "0:120:2"),
                            (["--frames", "3"], "0:120:2"), (["--frames", "::-1"], "0:120:2"),
                            (["--rods", "5:9"], "none of the 5 rods is chosen"), (["--rods", "a:"], "0:60"),
                            (["--format", "obj"], "obj"), (["--output", folder + "/x.obj"], "add --format glb or ply"),
                            (["--output", folder + "/x.glb", "--format", "ply"], "is no name for --format ply"),
                            (["--output", folder + "/none/x.glb"], "there is no such folder"),
                            (["--output", "/dev/full", "--format", "glb"], "No space left"),
                            (["--output", path, "--format", "ply"], "skins.h5: File exists"),
                            (["--output", folder, "--format", "glb"], "Is a directory"),
                            (["--fps", "0"], "0.1 to 1000"), (["--nonsense"], "--help lists all options")):
        export(path, "--output", glb, *arguments, code=2, says=says)
    export(code=2, says="trajectory")
    export(folder + "/nowhere", code=2, says="nowhere: not a trajectory that can be read")
    skinned.write(folder + "/nothing.h5", times=())
    export(folder + "/nothing.h5", "--output", glb, code=2, says="no frame yet")
    with open(folder + "/text.h5", "w") as f:
        f.write("no trajectory")
    export(folder + "/text.h5", "--output", glb, code=2, says="is not an HDF5 file")

    def broken(name, value, place=0):
        skinned.write(folder + "/broken.h5")
        with h5py.File(folder + "/broken.h5", "r+") as f:
            f[name][place] = value

    broken("state/position", np.nan, (2, 3))
    export(folder + "/broken.h5", "--output", glb, code=2, says="frame 2 of rod 'one' is not finite")
    export(folder + "/broken.h5", "--output", glb, "--frames", "0:2")
    rows = skinned.RODS[0][2] * skinned.SIDES
    broken("skins/local", 0.5, (rows + 10, 0, 1))
    export(folder + "/broken.h5", "--output", glb, code=2, says="the skin of rod 'two' has points whose edges")
    broken("skins/weight", [1.5, -0.5, 0], rows + 10)
    export(folder + "/broken.h5", "--output", glb, code=2, says="the skin of rod 'two' has weights below 0")
    assert not os.path.exists(folder + "/none")


def many_edges(folder):
    before, skinned.RODS[:] = list(skinned.RODS), [("long", False, 2102, 2)] + skinned.RODS[1:]
    skinned.write(folder + "/long.h5", times=(0.0, 1.0))
    skinned.RODS[:] = before
    export(folder + "/long.h5", "--output", folder + "/long.glb", says="rod 'long' has more than 2000 edges")
    glb = Glb(folder + "/long.glb")
    assert len(glb.list("skins")[0]["joints"]) == 2101


with tempfile.TemporaryDirectory() as folder:
    glb_of_skins(folder)
    ply_is_the_embedding(folder)
    times_rise(folder)
    edges_that_are_there_twice_count_once(folder)
    wrong_input(folder)
    many_edges(folder)
    runs(folder)
