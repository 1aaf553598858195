#!/usr/bin/python3
"""Pictures of trajectories: render.py <tendril> <source folder>. Areas on the screen, shadows, cost, wrong input."""
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from types import SimpleNamespace

program, root = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
sys.path.insert(0, root + "/python")

import h5py
import numpy as np
from PIL import Image

from tendril_render import picture, shapes, source
from tendril_render.cast import View, cast
from tendril_render.legend import Colours

script = root + "/scripts/render"
environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}


# What shapes cover on the screen, through the eye at a distance of 10 m: areas as they are at that depth.


def looking(scale=2000):
    return View(np.array([0, 0, 10.0]), np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, -1]]), scale, 400, 300, True)


def area(shape, samples=3, view=None):
    """Covered area [m^2]."""
    view = view or looking()
    _, seen, _, _ = cast(view, shape, samples)
    return (seen >= 0).mean(1).sum() / (view.scale / 10 if view.perspective else view.scale) ** 2


def swept(*arguments):
    return shapes.bar(*arguments, outline=shapes.ellipse())


def rod(half_axes, director=(0, 0, 1), direction=(1, 0, 0), edges=7, section=shapes.tube):
    s = np.linspace(-0.5, 0.5, edges + 1)
    return section(s[:, None] * np.array(direction), np.tile(np.array(director, float), (edges, 1)), half_axes,
                   np.zeros((edges + 1, 3)))


def expect(found, wanted, tolerance, what):
    assert abs(found - wanted) <= tolerance * wanted, f"{what}: {found:.6g}, not {wanted:.6g}"


def straight_rods_cover_their_area():
    for r in (0.05, 0.01):  # 20 and 4 pixels wide
        expect(area(rod((r, r))), 2 * r, 0.01, f"radius {r}")
    c, s = np.cos(0.3), np.sin(0.3)  # oblique, so that samples lie everywhere across a thin one
    for r in (0.02, 0.003):
        expect(area(rod((r, r), direction=(c, s, 0))), 2 * r, 0.01, f"oblique, radius {r}")
    for r in (0.001, 0.0003):  # 0.4 and 0.12 of a pixel: a pixel wide, seen by a share of the samples (noise)
        expect(area(rod((r, r), direction=(c, s, 0))), 2 * r, 0.05, f"hair of radius {r}")
    expect(area(rod((0, 0), direction=(c, s, 0))), 1.2 * 10 / 2000, 0.03, "a section of none")


def sections_follow_directors():
    a, b = 0.06, 0.02
    for section in (shapes.tube, shapes.bar, swept):
        expect(area(rod((a, b), director=(0, 1, 0), section=section)), 2 * a, 0.01, "the wide side")
        expect(area(rod((a, b), director=(0, 0, 1), section=section)), 2 * b, 0.015, "the narrow side")


def bodies_cover_their_area():
    at, turn, colour = (0.05, -0.02, 0), (1, 0, 0, 0), (0.5, 0.5, 0.5)
    quarter = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)  # about x: z becomes -y
    expect(area(shapes.body("sphere", [0.3], at, turn, colour)), np.pi * 0.3**2, 0.01, "sphere")
    expect(area(shapes.body("capsule", [0.1, 0.2], at, quarter, colour)), 0.08 + np.pi * 0.01, 0.01, "capsule")
    expect(area(shapes.body("box", [0.3, 0.2, 1e-6], at, turn, colour)), 0.24, 0.01, "box")
    expect(area(shapes.body("box", [0.3, 1e-3, 0.1], (0, 0, 0), quarter, colour)), 0.12, 0.01, "box, turned")
    end_on = shapes.body("capsule", [0.1, 0.2], (0, 0, 0), turn, colour)
    straight_down = View(np.array([0, 0, 9.0]), looking().axes, 200, 400, 300, False)
    expect(area(end_on, view=straight_down), np.pi * 0.01, 0.01, "capsule from its end, by parallel rays")
    tetrahedron = [[0, 0, 0], [0.4, 0, 0], [0, 0.4, 0], [0, 0, 1e-3]]
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]
    mesh = shapes.body("mesh", [], at, turn, colour, tetrahedron, faces)
    expect(area(mesh), 0.08, 0.01, "mesh")
    both = shapes.join([mesh, rod((0.02, 0.02)), shapes.body("plane", [0, 0, 1], (0, 0, -1), turn, colour)])
    assert len(both.capsules) == 7 and len(both.triangles) == 4 and len(both.planes) == 1


def nearer_hides_farther():
    front = shapes.body("sphere", [0.1], (0, 0, 0.5), (1, 0, 0, 0), (1, 0, 0))
    behind = shapes.body("box", [0.3, 0.3, 0.1], (0, 0, -0.5), (1, 0, 0, 0), (0, 1, 0))
    for order in ([front, behind], [behind, front]):
        depth, seen, _, _ = cast(looking(), shapes.join(order), 1)
        seen, depth = seen.reshape(300, 400), depth.reshape(300, 400)
        assert seen[150, 200] == 0 and abs(depth[150, 200] - 9.4) < 1e-3
        assert seen[150, 160] >= 1 and abs(depth[150, 160] - 10.4) < 1e-2


def curves_are_smooth():
    angle = np.linspace(0, np.pi, 9)
    x = np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    y, d, c = shapes.smoothed(x, np.tile([0, 0, 1.0], (8, 1)), np.zeros((9, 3)), False)
    assert len(y) == 33 and len(d) == 32 and np.allclose(y[::4], x)
    assert np.abs(np.hypot(y[4:-4, 0], y[4:-4, 1]) - 1).max() < 2e-3, "a circle stays one"
    ring = x[:-1] * [1, 1, 1]
    y, d, c = shapes.smoothed(ring, np.tile([0, 0, 1.0], (8, 1)), np.zeros((8, 3)), True)
    assert len(y) == 32 and np.allclose(y[::4], ring)


def ring_has_no_gap():
    """From outside nothing gets in."""
    n = 24
    angle = 2 * np.pi * np.arange(n) / n
    x = 0.5 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    for section, axes in ((shapes.tube, (0.03, 0.03)), (swept, (0.01, 0.05)), (shapes.bar, (0.02, 0.04))):
        ring = section(x, np.tile([0, 0, 1.0], (n, 1)), axes, np.zeros((n, 3)), True)
        _, seen, _, _ = cast(looking(), ring, 1)
        free = seen.reshape(300, 400) < 0
        outside = np.zeros_like(free)
        outside[0] = outside[-1] = outside[:, 0] = outside[:, -1] = True
        while True:
            grown = outside.copy()
            grown[1:] |= outside[:-1]
            grown[:-1] |= outside[1:]
            grown[:, 1:] |= outside[:, :-1]
            grown[:, :-1] |= outside[:, 1:]
            grown &= free
            if (grown == outside).all():
                break
            outside = grown
        assert free[150, 200] and not outside[150, 200], "a gap in a ring"


def shadow_row(height):
    """Brightness to the right of a rod along the view that lies `height` above the floor, from its edge on."""
    r = 0.03
    x = np.stack([np.zeros(9), np.full(9, r + height), np.linspace(-0.5, 0.5, 9)], 1)
    part = shapes.tube(x, np.tile([0, 1.0, 0], (8, 1)), (r, r), np.full((9, 3), 0.1))
    up, lower, upper = np.array([0, 1.0, 0]), np.array([-0.6, 0, -0.6]), np.array([0.6, 0.6, 0.6])
    view = picture.camera(*part.points(), up, 0, 45, 320, 240)
    stage = picture.Stage(view, up, lower, upper, 0.0)
    pixels = picture.draw(stage, part)[120].mean(-1)
    _, seen, _, _ = cast(view, part, 1)
    edge = np.flatnonzero(seen.reshape(240, 320)[120] >= 0).max()
    return pixels[edge + 1 :], pixels[5]


def rod_on_the_floor_touches_its_shadow():
    row, open_floor = shadow_row(0)
    assert row[:2].max() < 0.75 * open_floor, f"light between rod and shadow: {row[:8]}, floor {open_floor}"
    row, open_floor = shadow_row(0.25)
    assert row[:2].min() > 0.9 * open_floor and row.min() < 0.93 * open_floor, f"no shadow apart: {row}, {open_floor}"


def trajectories_become_shapes():
    """Rods of every section, a body that falls, a tendon and colliders, in two frames side by side."""
    def fake_rod(section, half_axes, closed=False):
        x = np.stack([np.linspace(0, 1, 5), np.zeros(5), np.zeros(5)], 1)
        return SimpleNamespace(
            name=section, closed=closed, section=section, half_axes=np.array(half_axes, float), radius=0.01,
            position=lambda frame: x, director=lambda frame: np.tile([0, 1.0, 0], (5 if closed else 4, 1)),
            field=lambda name, frame: np.arange(5.0 if closed else 4.0) if name == "force" else x * frame)

    def thing(shape, parameters, y=0.0, vertices=None, triangles=None):
        return SimpleNamespace(shape=shape, parameters=parameters, vertices=vertices, triangles=triangles,
                               pose=lambda frame: (np.array([0, y - frame, 0]), np.array([1.0, 0, 0, 0])))

    nan = np.nan
    t = SimpleNamespace(
        time=np.array([0.0, 0.5]), field_names=["position", "force", "tendon_position"], supports=[],
        unit=lambda name: "N", tendons=[SimpleNamespace(
            segments=np.array([[0, 1], [1, 2], [3, 4]]),
            position=lambda frame: np.array([[0, 0, 0], [0, 1, 0], [1, 1, 0], [2, 0, 0], [2, nan, 0]]))],
        field=lambda name: SimpleNamespace(place="edges" if name == "force" else "vertices"),
        rods=[fake_rod("circle", (0.1, 0.1)), fake_rod("rectangle", (0.1, 0.2)), fake_rod("ellipse", (0.1, 0.2)),
              fake_rod("none", (nan, nan)), fake_rod("circle", (nan, nan), closed=True)],
        bodies=[thing("sphere", [0.2], 3.0)],
        colliders=[thing("plane", [0, 1, 0]), thing("box", [1, 1, 1]), thing("capsule", [0.1, 0.5]),
                   thing("mesh", [], 0.0, np.eye(3), np.array([[0, 1, 2]]))])
    s = source.Source(t, "force", [0, 1], picture.LIGHT, lambda a, b: Colours(a, b, False), offset=(10, 0, 0))
    one, both = s.shapes([0], 0.001), s.shapes([0, 1], 0.001)
    bars = 4 * (8 + 48) + 4 + 44  # of rectangle and ellipse, with their ends
    cords = s.tendon(0, 0).capsules
    assert len(cords) == 2, "one line is not finite"
    assert not cords.flat.any() and (cords.half_axes == s.tendon_radius).all()
    assert 0 < s.tendon_radius < 0.1 and np.array_equal(cords.b[1], [1, 1, 0])
    assert len(one.capsules) == 4 + 4 + 5 + 1 + 1 + 2 and len(one.triangles) == bars + 12 + 1 and len(one.planes) == 1
    assert len(both.capsules) == 2 * len(one.capsules) and both.points()[0][:, 0].max() > 10
    assert (s.half_axes(t.rods[3]) == 0).all() and (s.half_axes(t.rods[4]) == 0.01).all()
    assert np.allclose(source.value(t, "force", 0, 0), [0, 0.5, 1.5, 2.5, 3])
    assert np.allclose(source.value(t, "position", 0, 1), np.linspace(0, 1, 5))
    lower, upper = s.bounds([0, 1])
    assert upper[1] == 3.2 and lower[1] == -2, "the body, and the box below"
    t.colliders.append(thing("box", [1000, 1, 1000]))
    lower, upper = s.bounds([0, 1])
    assert upper[0] < 10 and lower[2] > -10, "a collider as wide as the world leaves the rods in sight"


# The script.


def render(*arguments, fails=None):
    """Runs scripts/render; what it says on failure has to be one line with the words `fails`."""
    done = subprocess.run([script, *map(str, arguments)], env=environment, capture_output=True, text=True)
    if fails is None:
        assert done.returncode == 0, done.stderr
    else:
        lines = done.stderr.splitlines()
        assert done.returncode != 0 and len(lines) == 1, f"{arguments}: {done.returncode} {done.stdout}{done.stderr}"
        assert lines[0].startswith("render: ") and fails in lines[0], f"{arguments}: {lines[0]} lacks '{fails}'"
    return done


def write(path, x, keep_open=False):
    """A file of one rod: x (frames, vertices, 3)."""
    frames, n = x.shape[:2]
    f = h5py.File(path, "w", libver="latest")
    f["topology/rod_vertex_offsets"], f["topology/rod_edge_offsets"] = np.array([0, n]), np.array([0, n - 1])
    f["topology/closed"] = np.array([0])
    f["topology/edges"] = np.stack([np.arange(n - 1), np.arange(1, n)], 1)
    f["material/axial_stiffness"], f["material/flexural_stiffness"] = np.array([1e5]), np.array([[10.0, 10.0]])
    f["reference/position"] = np.zeros((n, 3))
    f.attrs.update({"gravity": [0, -9.81, 0], "format": "tendril-trajectory", "format_version": 1, "options": ""})

    def moving(name, v):
        f.create_dataset(name, data=v, maxshape=(None, *v.shape[1:]), chunks=(1, *v.shape[1:]))

    moving("state/position", x)
    moving("state/director", np.tile([0, 0, 1.0], (frames, n - 1, 1)))
    moving("state/velocity", np.ones_like(x))
    moving("step", np.arange(float(frames)))
    moving("time", np.arange(float(frames)))
    if not keep_open:
        f.close()
    return f


def line(frames=2, n=11):
    x = np.zeros((frames, n, 3))
    x[:, :, 0] = np.linspace(0, 1, n)
    x[:, :, 1] = -0.1 * np.arange(frames)[:, None] * x[:, :, 0]
    return x


def size(path):
    with Image.open(path) as image:
        image.load()
        return image.size


def small(tmp, path, *more, fails=None):
    out = f"{tmp}/x.png"
    render(path, "--size", "160x90", "--out", out, *more, fails=fails)
    if fails is None:
        assert size(out) == (160, 90)


def odd_files(tmp):
    one = f"{tmp}/one.h5"
    write(one, line(1))
    small(tmp, one)
    nothing = f"{tmp}/nothing.h5"
    write(nothing, line(0))
    small(tmp, nothing, fails="no frame yet")
    x = line(2)
    x[1, 4] = np.nan
    write(f"{tmp}/nan.h5", x)
    small(tmp, f"{tmp}/nan.h5")
    x[:] = np.nan
    write(f"{tmp}/nans.h5", x)
    small(tmp, f"{tmp}/nans.h5", fails="no finite position")
    for name, content in (("empty", b""), ("text", b"no trajectory"), ("cut", open(one, "rb").read()[:900])):
        with open(f"{tmp}/{name}.h5", "wb") as f:
            f.write(content)
        small(tmp, f"{tmp}/{name}.h5", fails="not a trajectory")
    small(tmp, f"{tmp}/missing", fails="missing")
    os.mkdir(f"{tmp}/folder")
    small(tmp, f"{tmp}/folder", fails="not a trajectory")


def growing_and_killed(tmp):
    path = f"{tmp}/growing.h5"
    child = os.fork()
    if child == 0:
        f = write(path, line(3), keep_open=True)
        f.swmr_mode = True
        f.flush()
        open(path + ".ready", "w").close()
        time.sleep(300)
        os._exit(0)
    try:
        started = time.monotonic()
        while not os.path.exists(path + ".ready"):
            assert time.monotonic() < started + 60
            time.sleep(0.01)
        small(tmp, path)
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
    small(tmp, path, "--times", 0, 2, "--field", "velocity")


def wrong_input(tmp, helix):
    for arguments, words in ((["--field", "nonsense"], "time, rod, axial_force, position"),
                             (["--field", "moment"], "runs with -output_fields all,moment have it"),
                             (["--times", "5"], "time 5 s is outside the run, 0 to 2 s"),
                             (["--times", "soon"], "soon"), (["--times", "nan"], "nan"),
                             (["--frames", "121"], "the run has 121"), (["--frames", "x"], "--frames"),
                             (["--elevation", "95"], "-90 to 90"),
                             (["--size", "big"], "1280x720"), (["--size", "0x10"], "1280x720"),
                             (["--rods", "3:"], "none of the 1 rods"), (["--rods", "x"], "first:end"),
                             (["--fps", "0", "--animate", "--out", "x.webp"], "--fps"),
                             (["--radius", "-1"], "--radius"), (["--colour"], "--colour"), (["--animate"], ".webp"),
                             (["--out", f"{tmp}/none/x.png"], "none/x.png"), (["--out", f"{tmp}/x.jpeg"], ".png")):
        render(helix, *arguments, fails=words)
    for folder, arguments, words in ((helix, ["--times", "5"], "time 5 s is outside the run, 0 to 2 s"),
                                     (tmp + "/nowhere", [], "nowhere: not a trajectory that can be read")):
        plotted = subprocess.run([root + "/scripts/plot_trajectory", folder, *arguments, "--out", f"{tmp}/x.png"],
                                 stderr=subprocess.PIPE, text=True)
        assert plotted.returncode == 1 and words in plotted.stderr and len(plotted.stderr.splitlines()) == 1, plotted


def unit_of_work():
    """CPU time of the same small work in numpy, in seconds: what this machine can do at the moment."""
    before, values = time.process_time(), np.random.default_rng(0).random(1_000_000)
    for _ in range(10):
        np.sort(values)
        np.sin(values)
    return time.process_time() - before


def helix_is_quick_and_the_same(tmp, helix):
    pictures = []
    for name in ("a.png", "b.png"):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        render(helix, "--times", 0, 0.3, 0.7, 1.15, 1.6, "--out", f"{tmp}/{name}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        units = spent / unit_of_work()
        print(f"helix, five instants, 1280x720: {spent:.1f} s CPU, {units:.1f} units, {after.ru_maxrss / 1024:.0f} MB")
        assert units <= 14 and after.ru_maxrss <= 1.5 * 1024**2  # 8.6 units where this was written
        pictures.append(open(f"{tmp}/{name}", "rb").read())
    assert pictures[0] == pictures[1], "the same file twice gives other bytes"
    render(helix, "--animate", "--seconds", 0.5, "--size", "160x90", "--out", f"{tmp}/x.webp")
    with Image.open(f"{tmp}/x.webp") as moving:
        assert moving.n_frames == 6 and moving.size == (160, 90)
    small(tmp, helix, "--field", "axial_force", "--dark", "--smooth", "--small", "--no-floor")


def tendons_are_seen(tmp):
    """Their red is that of nothing else; without rods that move, times are still times."""
    out = f"{tmp}/finger"
    subprocess.run([program, "-scene", root + "/data/scenes/finger_spatial.yaml", "-output_dir", out, "-t_end", "0.1"],
                   check=True, stdout=subprocess.DEVNULL)
    render(out, "--size", "640x360", "--out", f"{tmp}/x.png")
    with Image.open(f"{tmp}/x.png") as image:
        red, green, blue = np.moveaxis(np.asarray(image.convert("RGB"), float), -1, 0)
    seen = (red > 2 * green) & (red > 2 * blue) & (red > 60)
    columns = np.flatnonzero(seen.any(0))
    assert np.ptp(columns) > 300 and 500 < seen.sum() < 8000, (columns, seen.sum())
    assert not source.is_static(source.open_trajectory(out))


straight_rods_cover_their_area()
sections_follow_directors()
bodies_cover_their_area()
nearer_hides_farther()
curves_are_smooth()
ring_has_no_gap()
rod_on_the_floor_touches_its_shadow()
trajectories_become_shapes()
with tempfile.TemporaryDirectory() as tmp:
    helix = tmp + "/helix"
    subprocess.run([program, "-scene", root + "/data/scenes/helix.yaml", "-output_dir", helix], check=True,
                   stdout=subprocess.DEVNULL)
    helix_is_quick_and_the_same(tmp, helix)
    tendons_are_seen(tmp)
    odd_files(tmp)
    growing_and_killed(tmp)
    wrong_input(tmp, helix)
