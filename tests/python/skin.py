#!/usr/bin/python3
"""Skins of rods as python/tendril.py gives them: skin.py <tendril> <source folder>. The embedding against one
in plain Python, motion as a whole, normals, a run, and what pictures show."""
import os
import subprocess
import sys
import tempfile

program, root = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, root + "/python")

import numpy as np
from PIL import Image

import skinned
from tendril import TendrilError, Trajectory, surface_normals
from tendril_render import picture, shapes, source
from tendril_render.cast import View, cast
from tendril_render.legend import Colours
from tendril_render.skins import along, creased

RUN = """gravity: [0, -9.81, 0]
simulation: {dt: 0.02, t_end: 0.1}
rods:
  - {name: arm, line: {from: [0, 0, 0], to: [1, 0, 0], edges: 12}, measure: angle,
     material: {radius: 0.03, young: 1e5, poisson: 0.25, density: 1000}, skin: {mesh: {file: box.obj, edges: 3}}}
  - {name: bare, line: {from: [0, 1, 0], to: [1, 1, 0], edges: 4}, measure: angle,
     material: {radius: 0.03, young: 1e5, poisson: 0.25, density: 1000}}
  - {name: hoop, ring: {center: [0.5, 0.8, 0], radius: 0.3, edges: 30}, measure: angle, velocity: [1, 0, 0],
     material: {radius: 0.02, young: 1e6, poisson: 0.25, density: 1000}, skin: {tube: {sides: 6}}}
supports:
  - {rod: arm, vertex: 0, type: clamp}
"""


def skins_are_found(t, made):
    assert [rod.skin is not None for rod in t.rods] == [count > 0 for *_, count in skinned.RODS]
    for k, (points, triangles, *_) in made.items():
        skin = t.rods[k].skin
        assert skin.points == len(points) and np.array_equal(skin.triangles, triangles)
        assert np.abs(skin.reference() - points).max() < 1e-15, "not as drawn"
        assert repr(skin) == f"<skin of rod '{t.rods[k].name}', {len(points)} points, {len(triangles)} triangles>"


def embedding_is_that_of_the_format(t, made):
    for k in made:
        rod, skin = t.rods[k], t.rods[k].skin
        whole = skin.vertices(slice(None))
        assert whole.shape == (len(t.time), skin.points, 3)
        for frame in range(len(t.time)):
            arrays = (rod.position(frame), rod.director(frame), rod.reference("position"), skin.edge, skin.weight,
                      skin.local)
            wanted = skinned.embedded(*(a.tolist() for a in arrays))
            error = np.abs(skin.vertices(frame) - wanted).max()
            assert error <= 1e-14, f"rod {rod.name}, frame {frame}: {error}"
            assert np.array_equal(whole[frame], skin.vertices(frame))
        assert np.array_equal(skin.vertices(), whole[-1]) and np.array_equal(skin.vertices(slice(1, 3)), whole[1:3])


def motion_as_a_whole(folder, t):
    rng = np.random.default_rng(2)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    shift = np.array([0.3, -0.2, 0.5])
    skinned.write(folder + "/moved.h5", move=lambda x: x @ turn.T + shift, turn=lambda a: a @ turn.T)
    with Trajectory(folder + "/moved.h5") as moved:
        for rod in (r for r in t.rods if r.skin):
            there = moved.rods[rod.name].skin
            for frame in range(skinned.FRAMES):
                error = np.abs(there.vertices(frame) - (rod.skin.vertices(frame) @ turn.T + shift)).max()
                assert error <= 1e-13, error
                assert np.abs(there.normals(frame) - rod.skin.normals(frame) @ turn.T).max() <= 1e-9


def normals_face_out(t, made):
    for k in made:
        skin = t.rods[k].skin
        x, n = skin.vertices(), skin.normals()
        assert np.abs(np.linalg.norm(n, axis=1) - 1).max() < 1e-14
        assert np.array_equal(skin.normals(slice(None))[-1], n)
        a, b, c = (x[skin.triangles[:, i]] for i in range(3))
        assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0, "volume"
        p = len(x) // 2  # one of them by hand
        around = [np.cross(b[i] - a[i], c[i] - a[i]) for i in range(len(a)) if p in skin.triangles[i]]
        assert len(around) > 3 and np.allclose(n[p], sum(around) / np.linalg.norm(sum(around)), 1e-13)


def between_frames(t):
    rod = t.at(0.125).rods["band"]
    arrays = rod.position(), rod.director(), rod.reference("position"), rod.skin.edge, rod.skin.weight, rod.skin.local
    assert np.abs(rod.skin.vertices() - skinned.embedded(*(a.tolist() for a in arrays))).max() < 1e-14


def runs_have_them(folder):
    corners = [(x, y, z) for x in (0.15, 0.85) for y in (-0.05, 0.05) for z in (-0.05, 0.05)]
    faces = ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    with open(folder + "/box.obj", "w") as f:
        f.writelines("v {} {} {}\n".format(*p) for p in corners)
        f.writelines("f {} {} {}\nf {} {} {}\n".format(a, b, c, a, c, d) for a, b, c, d in faces)
    with open(folder + "/scene.yaml", "w") as f:
        f.write(RUN)
    subprocess.run([program, "-scene", folder + "/scene.yaml", "-output_dir", folder + "/out"], check=True,
                   stdout=subprocess.DEVNULL)
    with Trajectory(folder + "/out") as t:
        arm, bare, hoop = t.rods
        assert bare.skin is None and arm.skin.edge.shape == (8, 3) and hoop.skin.points == 180
        embedding_is_that_of_the_format(t, (0, 2))
        order = np.lexsort(np.round(arm.skin.reference(), 6).T[::-1])  # points are numbered as triangles name them
        assert np.abs(arm.skin.reference()[order] - corners).max() < 1e-15
        assert np.abs(hoop.skin.vertices(0) - hoop.skin.reference()).max() < 1e-15
        assert t.unit("local") == "m" and t.unit("skins/weight") == "1"


def files_without(folder):
    skinned.write(folder + "/bare.h5", skins=False)
    with Trajectory(folder + "/bare.h5") as t:
        assert all(rod.skin is None for rod in t.rods)
    with Trajectory(root + "/tests/data/format_1.h5") as t:
        assert t.rods[0].skin is None
    with Trajectory(folder + "/skins.h5") as t:
        try:
            t.rods[0].skin.vertices(9)
        except TendrilError as e:
            assert str(e) == "there is no frame 9; there are 4, numbered from 0"
        else:
            raise AssertionError("frame 9")


def creases_split_points():
    box, corners = shapes.BOX, shapes.BOX_TRIANGLES
    point, triangles = creased(box, np.array(corners))
    assert len(point) == 24 and np.array_equal(box[point][triangles], box[np.array(corners)])
    normals = surface_normals(box[point], triangles)
    assert np.array_equal(np.sort(np.abs(normals), 1), np.tile([0, 0, 1.0], (24, 1))), "faces of a box are flat"
    for sides, split in ((8, True), (12, False)):  # 45 and 30 degrees
        angle = 2 * np.pi * np.arange(sides) / sides
        ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
        k = np.arange(sides)
        after = (k + 1) % sides
        walls = np.concatenate([np.stack([k, after, k + sides], 1), np.stack([k + sides, after, after + sides], 1)])
        lid = np.stack([0 * k[1:-1], k[1:-1], k[2:]], 1)
        lids = np.concatenate([lid[:, ::-1], sides + lid])
        points = np.concatenate([ring, ring + [0, 0, 1]])
        point, triangles = creased(points, np.concatenate([walls, lids]))
        assert len(point) == 2 * sides * (3 if split else 2), (sides, len(point))
        assert np.array_equal(points[point][triangles], points[np.concatenate([walls, lids])])
    sheet = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0.0], [5, 5, 5]])
    point, triangles = creased(sheet, [[0, 1, 2], [1, 3, 2]])
    assert point.tolist() == [0, 1, 2, 3] and triangles.tolist() == [[0, 1, 2], [1, 3, 2]]
    point, _ = creased(sheet, [[0, 1, 2], [1, 2, 3]])  # the second is turned over
    assert len(point) == 6


def triangles_are_whole_on_the_screen():
    """Slender ones, and those that reach behind the eye, at a distance of 10 m."""
    def covered(points, triangles, scale, perspective):
        view = View(np.array([0, 0, 10.0]), np.diag([1.0, 1, -1]), scale, 400, 300, perspective)
        return (cast(view, shapes.mesh(points, triangles, (0, 0, 0)), 3)[1] >= 0).mean(1).sum()

    for turn in np.arange(0, 6.3, 0.37):
        c, s = np.cos(turn), np.sin(turn)
        points = np.array([[-0.5, -0.03, 0], [0.4, 0, 0], [-0.4, 0.06, 0]]) @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
        found, wanted = covered(points, [[0, 1, 2]], 270, False) / 270**2, (0.9 * 0.09 - 0.03 * 0.1) / 2
        assert abs(found / wanted - 1) < 0.01, (turn, found, wanted)
    behind = covered(np.array([[-2, -1, 5], [2, -1, 5], [0, -1, 15.0]]), [[0, 1, 2]], 200, True)
    before = np.array([[-2, -1, 5], [2, -1, 5], [1.2, -1, 9.0], [-1.2, -1, 9]])  # as far as it is seen
    before = covered(before, [[0, 1, 2], [0, 2, 3]], 200, True)
    assert before > 1000 and abs(behind / before - 1) < 1e-3, (behind, before)


def values_follow_the_weights(t):
    for rod in (r for r in t.rods if r.skin):
        x = rod.reference("position")
        if not rod.closed:
            found = along(rod.skin, 3 * x[:, 0] + 1)  # of what is linear in space, along straight edges
            middle = (x[1:, 0] + x[:-1, 0]) / 2
            share = np.clip(rod.skin.local[..., 0] / rod.skin.lengths[rod.skin.edge], -0.5, 0.5)
            wanted = middle[rod.skin.edge] + share * np.diff(x[:, 0])[rod.skin.edge]
            assert np.abs(found - 3 * (rod.skin.weight * wanted).sum(1) - 1).max() < 1e-14
        assert np.abs(along(rod.skin, np.full(rod.vertices, 2.5)) - 2.5).max() < 1e-14


def pictures_show_skins(folder, t):
    def shown(**more):
        return source.Source(t, "axial_force", [3], picture.LIGHT, lambda a, b: Colours(a, b, False), **more)

    with_skin, without = shown(), shown(skins=False)
    count = sum(len(rod.skin.triangles) for rod in t.rods if rod.skin)
    tubes, surfaces = without.shapes([3]), with_skin.shapes([3])
    assert len(surfaces.triangles) - len(tubes.triangles) == count, "triangles of skins"
    assert len(tubes.capsules) - len(surfaces.capsules) == sum(rod.edges for rod in t.rods if rod.skin)
    lower, upper = shown(rods=slice(0, 1)).bounds([3])
    points = t.rods[0].skin.vertices(3)
    assert np.array_equal([lower, upper], [points.min(0), points.max(0)]), "bounds"
    assert not np.array_equal(upper, shown(rods=slice(0, 1), skins=False).bounds([3])[1])

    def draw(name, *more):
        out = f"{folder}/{name}.png"
        small = ["--rods", "0:1", "--size", "160x90", "--samples", "1"]
        subprocess.run([root + "/scripts/render", folder + "/skins.h5", *small, "--out", out, *more], check=True,
                       stdout=subprocess.DEVNULL)
        with Image.open(out) as image:
            return np.asarray(image.convert("RGB"))

    plain, tube, field = draw("a"), draw("b", "--no-skin"), draw("c", "--field", "axial_force")
    assert (plain != tube).any(2).mean() > 0.01 and (plain != field).any(2).mean() > 0.01


creases_split_points()
triangles_are_whole_on_the_screen()
with tempfile.TemporaryDirectory() as folder:
    made = skinned.write(folder + "/skins.h5")
    with Trajectory(folder + "/skins.h5") as t:
        skins_are_found(t, made)
        embedding_is_that_of_the_format(t, made)
        motion_as_a_whole(folder, t)
        normals_face_out(t, made)
        between_frames(t)
        values_follow_the_weights(t)
        pictures_show_skins(folder, t)
    files_without(folder)
    runs_have_them(folder)
