"""Touching rods in motion, for scripts/verify_dynamics: what must hold of collisions, friction, a dropped rope, coils,
a pile and rods in a closed box. A table of properties, each with what is measured and what is asked.

Forces are those that the momenta tell: with `euler` those on a vertex are m (v - v before)/dt, at its new place.
"""
import csv
import os
import subprocess
import sys
import tempfile

import numpy as np

root = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
sys.path.insert(0, root + "/python")
from tendril import Trajectory

BEGIN, END = "<!-- touching rods, written by scripts/verify_dynamics -->", "<!-- end of touching rods -->"
HEAD = ["| property | measured | asked |", "|---|---|---|"]
G = np.array([0, 0, -9.81])
ENERGIES = ("kinetic", "stretch", "bend", "twist", "gravity", "contact")


class Run:
    """Of a scene: masses of vertices, and what the frames (of every step) and the diagnostics have."""

    def __init__(self, program, scene, *options, change=(), fields="velocity"):
        text = scene
        if "\n" not in scene:  # a name
            path = f"{scene}.yaml" if "/" in scene else f"verify/touch_dyn_{scene}.yaml"
            with open(f"{root}/data/scenes/{path}") as f:
                text = f.read()
        for old, new in change:
            assert old in text, old
            text = text.replace(old, new)
        with tempfile.TemporaryDirectory() as folder:
            with open(folder + "/scene.yaml", "w") as f:
                f.write(text)
            command = [program, "-scene", folder + "/scene.yaml", "-output_dir", folder + "/out", "-snes_rtol", "1e-8"]
            command += ["-output_fields", fields, *options]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            if done.returncode and "the energy rose" not in done.stdout:
                raise RuntimeError(done.stdout.strip().splitlines()[-1].replace(folder, ""))
            with Trajectory(folder + "/out") as t:
                self.t = t.time[:]
                self.field = {name: t.field(name)[:] for name in t.field_names}
                part = lambda first, count: slice(first, first + count)
                self.rods = [(part(r.first_vertex, r.vertices), part(r.first_edge, r.edges)) for r in t.rods]
                self.radius = t.rods[0].radius
                self.joins = [np.arange(v.start, v.stop - 1) for v, _ in self.rods]  # first vertices of edges
                self.mass = np.zeros(self.x.shape[1])
                self.spin_inertia = np.zeros(sum(r.edges for r in t.rods))
                for r, (vertices, edges) in zip(t.rods, self.rods):
                    length = np.linalg.norm(np.diff(r.reference("position"), axis=0), axis=1)
                    self.mass[vertices] += np.convolve(length, [0.5, 0.5]) * r.material["linear_density"]
                    self.spin_inertia[edges] = length * r.material["linear_rotational_inertia"]
            with open(folder + "/out/diagnostics.csv") as f:
                table = list(csv.DictReader(line for line in f if not line.startswith("#")))
            self.rows = {k: np.array([float(r[k]) for r in table]) for k in table[0]}

    x = property(lambda self: self.field["position"])
    v = property(lambda self: self.field["velocity"])
    h = property(lambda self: np.diff(self.t))
    weight = property(lambda self: -G[2] * self.mass.sum())

    def momentum(self):
        return np.einsum("v,tvc->tc", self.mass, self.v)

    def centre_velocity(self, rod):
        m = self.mass[self.rods[rod][0]]
        return np.einsum("v,tvc->tc", m, self.v[:, self.rods[rod][0]]) / m.sum()

    def energy(self):
        return sum(self.rows[k] for k in ENERGIES)

    def largest_rise(self):
        e = self.energy()
        return np.diff(e).max() / e[0]

    def forces(self):
        """(steps, vertices, 3) of all but inertia."""
        return self.mass[:, None] * np.diff(self.v, axis=0) / self.h[:, None, None]

    def convexity(self, names, forces):
        """(steps,) change of these energies less that at their forces at the end: below 0 where they are convex."""
        energy = sum(self.rows[k] for k in names)
        work = np.einsum("tvc,tvc->t", forces, np.diff(self.x, axis=0))
        return (np.diff(energy) + work[1:]) / self.energy()[0]

    def elastic_forces(self):
        """(steps, vertices, 3) of `force`, which edges carry."""
        total = np.zeros_like(self.x[1:])
        for first, (_, edges) in zip(self.joins, self.rods):
            total[:, first] += self.field["force"][1:, edges]
            total[:, first + 1] -= self.field["force"][1:, edges]
        return total

    def couple(self):
        """(steps, 3) of these forces, with what turns sections about their axes."""
        total = np.cross(self.x[1:], self.forces()).sum(axis=1)
        for vertices, edges in self.rods:
            along = np.diff(self.x[1:, vertices], axis=1)
            along /= np.linalg.norm(along, axis=2)[:, :, None]
            spun = self.spin_inertia[edges] * np.diff(self.field["twist_rate"][:, edges], axis=0) / self.h[:, None]
            total += (spun[:, :, None] * along).sum(axis=1)
        return total


# --- two rods ---


def collisions(program):
    lost, rows = 0, []
    for method in ("euler", "bdf2", "sdirk2", "generalized_alpha"):
        ratios, rho = [], ("-rho_inf", "1") if method == "generalized_alpha" else ()
        for dt in (4e-5, 2e-5, 1e-5):
            r = Run(program, "parallel", "-integrator", method, *rho, "-dt", f"{dt}")
            scale = (r.mass * np.linalg.norm(r.v[0], axis=1)).sum()
            lost = max(lost, np.abs(r.momentum() - r.momentum()[0]).max() / scale)
            a, b = r.centre_velocity(0), r.centre_velocity(1)
            ratios.append((b - a)[-1, 2] / (a - b)[0, 2])
        cells = ", ".join(f"1 {q - 1:+.1e}" for q in ratios)
        name = f"`{method}`" + (" with rho_inf 1" if rho else "")
        asked = "at most 1; to 1 at first order" if method == "euler" else "at most 1; to 1"
        rows.append((f"parallel, relative speed after over before, {name}, dt 4e-5, 2e-5, 1e-5 s", cells, asked))
    yield "parallel, change of momentum over sum m abs(v), all methods", f"{lost:.1e}", "1e-12"
    yield from rows
    for young in ("1e7", "1e9"):
        r = Run(program, "crossed", "-integrator", "sdirk2", "-dt", "5e-5", "-t_end", "0.06", "-rod_young", young)
        a, b = r.centre_velocity(0)[-1], r.centre_velocity(1)[-1]
        name = f"crossed at the middles, E {young}, `sdirk2`, velocity of the centres after over before"
        yield name, f"{a[2]:.3f}, {-b[2]:.3f}", "below 0, equal"
        sideways = max(np.abs(a[:2]).max(), np.abs(b[:2]).max())
        yield "the same, sideways over before; sum of both", f"{sideways:.1e}, {np.linalg.norm(a + b):.1e}", "1e-12"
    # Stiff: where rods bend their sections spin, and this account of it leaves 2e-10 of the couple at E 1e7.
    stiff = ("-rod_young", "1e9", "-snes_rtol", "1e-12")
    r = Run(program, "sliding", *stiff, change=[("friction: 0.3, ", "")], fields="velocity,twist_rate")
    f, c = r.forces(), r.couple()
    size = np.linalg.norm(f, axis=2).sum(axis=1)
    k = size > 0.1 * size.max()
    turning = np.linalg.norm(np.cross(r.x[1:], f), axis=2).sum(axis=1)
    worst = lambda q, scale: (np.linalg.norm(q, axis=1) / scale)[k].max()
    yield "crossed aside, sum of all forces over sum abs(f), `euler`", f"{worst(f.sum(axis=1), size):.1e}", "1e-12"
    yield "crossed aside, their couple over sum abs(x x f)", f"{worst(c, turning):.1e}", "1e-12"


def friction_couple(program):
    r = Run(program, "sliding", "-snes_rtol", "1e-12", fields="velocity,twist_rate")
    friction = lambda r: np.linalg.norm(r.forces()[:, r.rods[1][0], :2].sum(axis=1), axis=1)  # across the normal z
    f = friction(r)
    k = np.nonzero(f > 1e-2 * f.max())[0]
    arm = np.linalg.norm(r.couple(), axis=1)[k] / f[k]
    change = np.abs(np.diff(r.rows["contact_gap_min"], prepend=np.nan))[k]
    yield "friction couple over force at a crossing, largest [m]", f"{arm.max():.1e}", "change of the gap + 1e-6"
    yield "the same, over the change of the gap + 1e-6 m, largest", f"{(arm / (change + 1e-6)).max():.1e}", "1"
    cloud = "law: penalty, collider: point_cloud, cloud: 3, stiffness: 1e8, threshold: 1e-3, smoothing: 5e-3"
    change = [("stiffness: 64", cloud), ("0.0212", "0.0112"), ("edges: 20", "edges: 40")]
    r = Run(program, "sliding", change=change, fields="velocity,twist_rate")
    f = friction(r)
    k = f > 1e-2 * f.max()
    arm = np.median(np.linalg.norm(r.couple(), axis=1)[k] / f[k])
    name = "the same with `collider: point_cloud`, where rods touch at one radius, median [m]"
    yield name, f"{arm:.1e}", "0.01, the radius, less the depth"


# --- on a floor ---


def dropped_rope(program):
    """A chain presses with its landed weight, and twice as much by the momentum that it brings."""
    for dt in ("1e-3", "5e-4"):
        r = Run(program, "rope", "-dt", dt, fields="velocity,collider_force")
        force, length = r.field["collider_force"][:, 0], r.x[0, :, 2].max()
        landed = r.weight * np.minimum(0.5 * -G[2] * r.t**2 / length, 1)
        fall = np.sqrt(2 * length / -G[2])
        k = (r.t > 0.25 * fall) & (r.t < 0.75 * fall)
        name = f"rope dropped upright, dt {dt} s, force over landed weight, mean of the middle half of the fall"
        yield name, f"{force[k, 2].sum() / landed[k].sum():.4f}", "3, 2.6 to 3.4"
        left = (force[1:] * r.h[:, None]).sum(axis=0) - (r.momentum()[-1] - r.mass.sum() * G * r.t[-1])
        left = np.linalg.norm(left) / (r.mass.sum() * -G[2] * fall)
        name = "the same, impulse of the floor less the change of momentum and the weight's, over m v"
        yield name, f"{left:.1e}", "1e-6"


def crossings(p):
    """Of the edges of a polyline seen from above."""
    a, b = p[:-1, None, :2], p[1:, None, :2]
    c, d = p[None, :-1, :2], p[None, 1:, :2]
    side = lambda u, v, w: (v - u)[..., 0] * (w - u)[..., 1] - (v - u)[..., 1] * (w - u)[..., 0]
    cross = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
    return int(np.triu(cross, 2).sum())


def coils(program):
    r = Run(program, "coil", "-output_interval", "0.05", fields="velocity,collider_force")
    drop = r.rows["gravity"][0] - r.rows["gravity"][-1]
    left = r.rows["kinetic"][-1] / drop
    yield "rope in coils, kinetic energy after 5 s over that of the drop", f"{left:.1e}", "below 1e-6"
    yield "the same, least height over its radius, all frames", f"{r.x[:, :, 2].min() / r.radius:.3f}", "at least 0.8"
    over = crossings(r.x[-1])
    top = f"{r.x[-1, :, 2].max() / r.radius:.2f}"
    yield "the same, greatest height over its radius, at the end", top, f"at most {2 * (over + 1)}: {over} crossings"
    force = r.field["collider_force"][-1, 0, 2]
    yield "the same, force of the floor over the weight, less 1", f"{force / r.weight - 1:.1e}", "1e-6"


# --- many rods ---


def distances(p, q, a, b):
    """Of the segments from p to q from those from a to b: within both, and of each end from the other."""
    u, v, w = q - p, b - a, p - a
    dot = lambda s, t: np.einsum("ij,ij->i", s, t)
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    with np.errstate(divide="ignore", invalid="ignore"):
        s, t = (uv * vw - vv * uw) / (uu * vv - uv**2), (uu * vw - uv * uw) / (uu * vv - uv**2)
    within = (uu * vv - uv**2 > 1e-14 * uu * vv) & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    least = np.full(len(p), np.inf)
    least[within] = np.linalg.norm((w + s[:, None] * u - t[:, None] * v)[within], axis=1)
    for x, c, d in ((p, a, b), (q, a, b), (a, p, q), (b, p, q)):
        k = np.clip(dot(x - c, d - c) / dot(d - c, d - c), 0, 1)
        least = np.minimum(least, np.linalg.norm(x - c - k[:, None] * (d - c), axis=1))
    return least


def least_distance(x, rods, room):
    """Of the centrelines of different rods, where any are within this of each other."""
    a, b = (np.concatenate([x[vertices][ends] for vertices, _ in rods]) for ends in (slice(-1), slice(1, None)))
    rod = np.concatenate([np.full(edges.stop - edges.start, k) for k, (_, edges) in enumerate(rods)])
    middle, reach = (a + b) / 2, np.linalg.norm(b - a, axis=1).max() + room
    size = (middle**2).sum(axis=1)
    near = size[:, None] + size[None] - 2 * middle @ middle.T < reach**2
    i, j = np.nonzero(np.triu(near, 1) & (rod[:, None] != rod[None]))
    return distances(a[i], b[i], a[j], b[j]).min() if len(i) else np.inf


def pile(program):
    strands, dt, wall = 40, 2e-3, 0.07
    scene = subprocess.run([root + "/scripts/pile", str(strands), "--edges", "20", "--dt", str(dt), "--t_end", "0.3"],
                           stdout=subprocess.PIPE, text=True, check=True).stdout
    r = Run(program, scene, fields="velocity,collider_force")
    least = min(least_distance(x, r.rods, 2 * r.radius) for x in r.x) / (2 * r.radius)
    yield f"pile of {strands} strands, least distance of centrelines over 2 r, all frames", f"{least:.4f}", "above 0.9"
    out = max(np.abs(r.x[:, :, :2]).max() + r.radius - wall, (r.radius - r.x[:, :, 2]).max()) / r.radius
    yield "the same, largest depth in floor or walls over r, all frames", f"{out:.3f}", "at most 0.1"
    given = (r.field["collider_force"][1:].sum(axis=1) + r.mass.sum() * G) * r.h[:, None]
    left = np.linalg.norm(np.diff(r.momentum(), axis=0) - given, axis=1).max()
    name = "the same, momentum less what walls and weight gave, over m g dt, largest of a step"
    yield name, f"{left / (r.weight * dt):.1e}", "1e-8"
    yield "the same, shortest step over dt", f"{r.rows['dt'].min() / dt:.3g}", "at least 1/16"


def particle(x, v, h, steps, r, d, k, line_density):
    """Energies of a particle that a barrier keeps off a cylinder, as a rod on one along it, by backward Euler."""

    def barrier(s):
        t = (s - 2 * r) / d + 0.5
        if not 0 < t < 1:
            return (0.0, 0.0, 0.0) if t > 0 else (np.inf,) * 3
        log, u = np.log(t), t - 1
        return -k * d * u**2 * log, -k * (2 * u * log + u**2 / t), -k / d * (2 * log + 4 * u / t - u**2 / t**2)

    m, g, energies = line_density, -G[2], []
    for _ in range(steps):
        start, aim = x, x + h * v
        potential = lambda x: m / 2 * ((x - aim) ** 2).sum() / h**2 + m * g * x[1] + barrier(np.hypot(*x))[0]
        for _ in range(100):
            s = np.hypot(*x)
            n, (_, slope, curvature) = x / s, barrier(s)
            gradient = m * (x - aim) / h**2 + np.array([0, m * g]) + slope * n
            hessian = m / h**2 * np.eye(2) + curvature * np.outer(n, n) + slope / s * (np.eye(2) - np.outer(n, n))
            step, part = -np.linalg.solve(hessian, gradient), 1.0
            while potential(x + part * step) > potential(x) + 1e-14 * abs(potential(x)) and part > 1e-9:
                part /= 2
            x = x + part * step
            if np.abs(step).max() < 1e-17:
                break
        v = (x - start) / h
        energies.append(m / 2 * v @ v + m * g * x[1] + barrier(np.hypot(*x))[0])
    return np.array(energies)


def listed(numbers):
    return ", ".join(f"{q:.1e}" for q in numbers)


def energies(program):
    r = Run(program, "box")
    name = "ten rods in a closed box for 10 s, largest rise of the energy in a step over that at the start"
    yield name, f"{max(r.largest_rise(), 0):.1e}", "1e-8"
    steps, frictionless = (2e-3, 1e-3, 5e-4), ("-contact_friction", "0", "-contact_stiffness", "16")
    piles = [Run(program, "./pile", *frictionless, "-dt", f"{dt}", fields="velocity,force") for dt in steps]
    rises = [r.largest_rise() for r in piles]
    yield "`pile.yaml` without friction, stiffness 16, largest rise in a step, dt 2, 1, 0.5 ms", listed(rises), "1e-8"
    r = piles[0]
    elastic = r.elastic_forces()
    of_contact = r.forces() - elastic - r.mass[:, None] * G
    parts = r.convexity(("stretch", "bend", "twist"), elastic), r.convexity(("contact",), of_contact)
    inertia = -0.5 * np.einsum("v,tvc->t", r.mass, np.diff(r.v, axis=0) ** 2)[1:] / r.energy()[0]
    rise = np.diff(r.energy()) / r.energy()[0]
    k = rise.argmax()
    names, left = "inertia, elasticity, contact", np.abs(rise - inertia - sum(parts)).max()
    yield f"that rise at 2 ms by {names}", listed((inertia[k], parts[0][k], parts[1][k])), "the first two below 0"
    yield "the same, what they leave of the change, largest of a step", f"{left:.1e}", "1e-10"
    rises, differences = [], []
    for dt in steps:
        r = Run(program, "roll", "-dt", f"{dt}", "-snes_rtol", "1e-10")
        length = 0.01
        density = r.mass.sum() / 2 / length
        x, v = r.x[0, 2, 1:], r.v[0, 2, 1:]
        own = length * particle(x, v, dt, len(r.h), 2e-3, 4e-4, 0.25, density)
        differences.append(np.abs(r.energy() / own - 1).max())
        rises.append(r.largest_rise())
    name = "rod slides off another, energy against that of a particle by backward Euler, largest difference"
    yield name, f"{max(differences):.1e}", "1e-10"
    yield "the same, largest rise in a step, dt 2, 1, 0.5 ms", listed(rises), "a fourth each"
    r = Run(program, "thrown")
    height = -G[2] * np.einsum("v,tv->t", r.mass, r.x[1:, :, 2])
    off = np.abs(r.rows["gravity"] / height - 1).max()
    yield "three rods thrown, energy of the weight in the diagnostics against that of the frames", f"{off:.1e}", "1e-12"


GROUPS = (("collision", collisions), ("friction couple", friction_couple), ("dropped rope", dropped_rope),
          ("coils", coils), ("pile", pile), ("energies", energies))


def table(program, pool, wanted):
    """Lines of the table, printed as they come; groups by the names above, or all by `touching`."""
    chosen = [g for g in GROUPS if wanted("touching: " + g[0])]
    lines = list(HEAD)
    if chosen:
        print("\n".join(lines), flush=True)

    def rows_of(group):
        try:
            return [f"| {' | '.join(row)} |" for row in group[1](program)]
        except RuntimeError as error:
            return [f"| {group[0]} | failed: {error} | |"]

    for found in pool.map(rows_of, chosen):
        print("\n".join(found), flush=True)
        lines += found
    return lines


def placed(text, lines):
    """The page with these lines between the marks."""
    return text[: text.index(BEGIN)] + "\n".join([BEGIN, "", *lines, "", ""]) + text[text.index(END) :]
