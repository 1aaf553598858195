"""Rows of the stability exam for rods that touch each other and themselves. scripts/stability runs them:

    import stability_rods
    rows = stability_rods.rows(tools)    # tools: what runs the program and writes scenes (run, Row, writeScene, ...)

Short rows are a part of each, without what misses its mark: near-parallel cords at 100 m/s, slanted tips, weak barriers,
and the time of rods apart.
"""
import itertools
import math
import os
import re

import numpy as np

RADIUS, DENSITY, WIDTH = 0.005, 1000, 1e-3  # of the cords: radius, density, width of the barrier between two of them
CORD = "{{radius: 0.005, young: {}, poisson: 0.3, density: 1000}}".format
WEIGHT = np.pi * RADIUS**2 * DENSITY * 9.81  # per length


# Geometry -------------------------------------------------------------------------------------------------------------


def pointSegment(p, a, b):
    """Distances of points from segments."""
    e = b - a
    t = np.clip(((p - a) * e).sum(-1) / (e * e).sum(-1), 0, 1)
    return np.linalg.norm(p - a - t[..., None] * e, axis=-1)


def segmentSegment(a, b, c, d):
    """Distances of segments a-b from segments c-d."""
    u, v, w = b - a, d - c, c - a
    uu, vv, uv, uw, vw = ((p * q).sum(-1) for p, q in ((u, u), (v, v), (u, v), (u, w), (v, w)))
    det = uu * vv - uv * uv
    skew = det > 1e-12 * uu * vv
    safe = np.where(skew, det, 1)
    s, t = (uw * vv - vw * uv) / safe, (uw * uv - vw * uu) / safe
    inside = skew & (s >= 0) & (s <= 1) & (t >= 0) & (t <= 1)
    across = np.where(inside, np.linalg.norm(w - s[..., None] * u + t[..., None] * v, axis=-1), np.inf)
    ends = [pointSegment(a, c, d), pointSegment(b, c, d), pointSegment(c, a, b), pointSegment(d, a, b)]
    return np.minimum(across, np.minimum.reduce(ends))


def between(x, y):
    """From the axis of one polyline to that of another, where they are nearest."""
    distance = segmentSegment(x[:-1, None], x[1:, None], y[None, :-1], y[None, 1:])
    i, j = np.unravel_index(np.argmin(distance), distance.shape)
    a, b, c, d = x[i], x[i + 1], y[j], y[j + 1]
    foot = lambda p, q, r: q + np.clip((p - q) @ (r - q) / ((r - q) @ (r - q)), 0, 1) * (r - q)
    ways = [foot(a, c, d) - a, foot(b, c, d) - b, c - foot(c, a, b), d - foot(d, a, b)]
    way = min(ways, key=np.linalg.norm)
    if distance[i, j] < (1 - 1e-12) * np.linalg.norm(way):  # both amid their edges: along the normal of both
        n = np.cross(b - a, d - c)
        way = n * ((c - a) @ n) / (n @ n)
    return way


def split(positions, counts):
    """Positions of all rods to those of each; counts: vertices of each rod."""
    return np.split(positions, np.cumsum(counts)[:-1], axis=-2)


def leastDistance(positions, counts, between=1):
    """Least distance of the axes of different rods, in the frames and at so many - 1 instants between two of them."""
    rods = split(positions, counts)
    pairs = []
    for i, j in itertools.combinations(range(len(rods)), 2):
        pairs += [(e, f, i, j) for e in range(counts[i] - 1) for f in range(counts[j] - 1)]
    first = np.concatenate([[0], np.cumsum(counts)])
    e = np.array([first[i] + e for e, f, i, j in pairs])
    f = np.array([first[j] + f for e, f, i, j in pairs])
    best = math.inf
    for k in range(len(positions) - 1 if len(positions) > 1 else 1):
        p, q = positions[k], positions[min(k + 1, len(positions) - 1)]
        reach = np.linalg.norm(q - p, axis=1)
        near = np.linalg.norm((p[e] + p[e + 1] - p[f] - p[f + 1]) / 2, axis=1) - (
            np.linalg.norm(p[e + 1] - p[e], axis=1) + np.linalg.norm(p[f + 1] - p[f], axis=1)) / 2
        near -= np.maximum(reach[e], reach[e + 1]) + np.maximum(reach[f], reach[f + 1])
        chosen = near < min(best, 10)
        if not chosen.any():
            continue
        a, b = e[chosen], f[chosen]
        for s in np.linspace(0, 1, between + 1):
            x = (1 - s) * p + s * q
            best = min(best, float(segmentSegment(x[a], x[a + 1], x[b], x[b + 1]).min()))
    return best


def linking(x, y):
    """Linking number of two closed polygons, by the Gauss integral of every pair of edges."""
    a, b = x[:, None], np.roll(x, -1, axis=0)[:, None]
    c, d = y[None], np.roll(y, -1, axis=0)[None]
    ac, ad, bc, bd = c - a, d - a, c - b, d - b
    normals = [np.cross(ac, ad), np.cross(ad, bd), np.cross(bd, bc), np.cross(bc, ac)]
    normals = [n / np.maximum(np.linalg.norm(n, axis=-1), 1e-300)[..., None] for n in normals]
    angle = sum(np.arcsin(np.clip((normals[k] * normals[(k + 1) % 4]).sum(-1), -1, 1)) for k in range(4))
    sign = np.sign((np.cross(d - c, b - a) * ac).sum(-1))
    return float((sign * angle).sum() / (4 * np.pi))


def determinant(x):
    """Determinant of the knot of a closed polygon: 1 of none, 3 of the overhand knot; from the crossings of a view."""
    view = np.linalg.qr(np.array([[0.831, 0.3, 0.1], [0.412, -0.7, 0.5], [0.374, 0.2, 0.9]]))[0]
    p = x @ view
    q = np.roll(p, -1, axis=0)
    n = len(p)
    i, j = np.triu_indices(n, 2)
    keep = ~((i == 0) & (j == n - 1))
    i, j = i[keep], j[keep]
    u, v, w = q[i] - p[i], q[j] - p[j], p[j] - p[i]
    det = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    det = np.where(det == 0, 1e-300, det)
    s = (w[:, 0] * v[:, 1] - w[:, 1] * v[:, 0]) / det
    t = (w[:, 0] * u[:, 1] - w[:, 1] * u[:, 0]) / det
    hit = (s >= 0) & (s < 1) & (t >= 0) & (t < 1)
    i, j, s, t = i[hit], j[hit], s[hit], t[hit]
    above = p[i, 2] + s * (q[i] - p[i])[:, 2] > p[j, 2] + t * (q[j] - p[j])[:, 2]
    over, under = np.where(above, i + s, j + t), np.where(above, j + t, i + s)
    m = len(under)
    if m < 3:
        return 1
    order = np.argsort(under)
    arc = lambda place: np.searchsorted(under[order], place, side="right") % m  # arcs lie between undercrossings
    matrix = np.zeros((m, m))
    for row, k in enumerate(order):
        matrix[row, arc(over[k])] += 2
        matrix[row, row] -= 1
        matrix[row, (row + 1) % m] -= 1
    return round(abs(np.linalg.det(matrix[1:, 1:])))


# Scenes ---------------------------------------------------------------------------------------------------------------


def vector(v):
    return "[" + ", ".join(f"{x:.17g}" for x in v) + "]"


def scene(tools, name, rods, rest="", gravity="[0, 0, 0]", contact="{rods: others}"):
    text = f"gravity: {gravity}\n" + (f"contact: {contact}\n" if contact
                                      else "") + "rods:\n" + "".join(f"- {{{r}}}\n" for r in rods) + rest
    return tools.writeScene("rods_" + re.sub(r"[^A-Za-z0-9.-]", "_", name), text)


def cord(name, begin, end, edges=20, young="1e9", more=""):
    line = f"line: {{from: {vector(begin)}, to: {vector(end)}, edges: {edges}}}"
    return f"name: {name}, {line}, material: {CORD(young)}" + (f", {more}" if more else "")


def pins(*rods, kind="pin"):
    return "supports:\n" + "".join(f"- {{rod: {r}, vertex: {v}, type: {kind}}}\n" for r in rods for v in (0, "last"))


def masses(edges, length=0.3):
    """Of the vertices of a cord."""
    m = np.full(edges + 1, np.pi * RADIUS**2 * DENSITY * length / edges)
    m[[0, -1]] /= 2
    return m


def overAndUnder(below, above):
    """Linking of a lower rod closed far below and an upper one closed far above: 0 while none has gone through."""
    down, up = np.array([0, 0, -30.0]), np.array([0, 0, 30.0])
    return linking(np.concatenate([below, [below[-1] + down, below[0] + down]]),
                   np.concatenate([above, [above[-1] + up, above[0] + up]]))


def most(results, what, limit, row, text, among=None):
    """Judges the most of something among runs."""
    found = {k: what(r) for k, r in results.items() if r.ok and (among is None or among(k))}
    if not found:
        return row.judge(text, "no run ended", False)
    key = max(found, key=found.get)
    over = sum(v > limit for v in found.values())
    also = f"; {over} of {len(found)} above {limit:g}" if over else ""
    row.judge(text, f"{found[key]:.3g} ({', '.join(key)}){also}", not over)


# The rows -------------------------------------------------------------------------------------------------------------


def contactCrossing(tools):
    row = tools.Row(
        "contact_crossing", "rods thrown at each other",
        "every run ends; rods held at their ends keep their order, with at most 15 iterations a step; free ones take"
        " at most 60 with E 1e9, keep their momentum to 1e-10 of the sum of m |v|, and no surfaces overlap by more "
        "than half of the barrier",
        "Two cords of 0.3 m and radius 5 mm, 20 edges each, come at each other at 1 to 100 m/s and cross at their "
        "middles, from square to parallel; their surfaces are 1.2 or 20 mm apart. Held: their ends are pinned; a "
        "lower one closed far below and an upper one closed far above stay without link. Free ones may pass each "
        "other's ends in a long step.")
    speeds, dts, angles, youngs = (1, 10, 100), ("1e-2", "1e-3"), (90, 30, 3, 0), ("1e9", "1e7")
    if tools.args.short:
        speeds, dts, angles, youngs = (10,), ("1e-2",), (90, 3), ("1e9",)
    cases = {}
    for (how, far), v, angle, e, dt in itertools.product(
            (("held", 1.2e-3), ("held", 20e-3), ("free", 20e-3)), speeds, angles, youngs, dts):
        if how == "held" and (e != "1e9" or (far > 2e-3 and v < 100)):
            continue
        a = math.radians(angle)
        half = 0.15 * np.array([math.cos(a), math.sin(a), 0])
        top = np.array([0, 0, 2 * RADIUS + far])
        lower = cord("a", [-0.15, 0, 0], [0.15, 0, 0], 20, e, f"velocity: [0, 0, {v / 2}]")
        upper = cord("b", top - half, top + half, 20, e, f"velocity: [0, 0, {-v / 2}]")
        path = scene(tools, f"crossing {how} {1e3 * far:g} {v} {angle} {e}", [lower, upper],
                     pins("a", "b") if how == "held" else "")
        cases[how, f"{1e3 * far:g} mm", f"{v} m/s", f"{angle} degrees", f"E {e} Pa", f"dt {dt} s"] = (
            path, "-dt", dt, "-t_end", 0.04 / v + 20 * float(dt))
    results = tools.runAll(cases, ["ours"], frames="all", fields=("position", "velocity"))["ours"]
    m = np.tile(masses(20), 2)
    lines, kept, apart, lost = [], {}, {}, {}
    for k, r in results.items():
        gap = r.rows["contact_gap_min"].min() if len(r.its) else math.nan
        note = ""
        if r.ok and k[0] == "held":
            link = max(abs(overAndUnder(x[:21], x[21:])) for x in r.positions)
            order = k[3] != "0 degrees" or (r.positions[:, 21:, 2].mean(1) > r.positions[:, :21, 2].mean(1)).all()
            kept[k] = link < 1e-6 and order
            note = "kept" if kept[k] else "lost"
        elif r.ok:
            momentum = np.einsum("v,fvk->fk", m, r.fields["velocity"])
            lost[k] = np.abs(momentum - momentum[0]).max() / (m @ np.linalg.norm(r.fields["velocity"][0], axis=1))
            note = f"{lost[k]:.1g}"
        apart[k] = r.ok and gap > -WIDTH / 2 and (k[0] == "free" or gap < WIDTH)
        good = apart[k] and kept.get(k, True) and lost.get(k, 0) < 1e-10
        few = r.max <= (15 if k[0] == "held" else 60 if k[4] == "E 1e9 Pa" else math.inf)
        lines.append([*k, r.cell(), f"{1e3 * gap:.3f}", note, "PASS" if good and few else "FAIL"])
    bad = [", ".join(k) for k, r in results.items() if not r.ok]
    row.judge("runs that end", f"{len(results) - len(bad)} of {len(results)}" + "".join(f"; not: {b}" for b in bad[:3]),
              not bad)
    row.judge("least gap between surfaces above half of the barrier", f"{sum(apart.values())} of {len(apart)}",
              all(apart.values()))
    held = sum(k[0] == "held" for k in results)
    row.judge("held: order kept", f"{sum(kept.values())} of {held}", sum(kept.values()) == held)
    most(results, lambda r: r.max, 15, row, "held: most iterations in a step", lambda k: k[0] == "held")
    most(results, lambda r: r.max, 60, row, "free, E 1e9: most iterations in a step",
         lambda k: k[0] == "free" and k[4] == "E 1e9 Pa")
    row.judge("free: momentum lost", f"{max(lost.values(), default=math.nan):.1g}", lost and max(lost.values()) < 1e-10)
    row.table(["ends", "apart", "speed", "crossed at", "", "", "its a step: mean (max)", "least gap [mm]",
               "order, momentum lost", "mark"], lines)
    row.commands += [r.command for r in results.values()]
    return row


def contactPressed(tools):
    row = tools.Row(
        "contact_pressed", "two crossing strings pressed together",
        "every run ends; at most 10 iterations a step; surfaces overlap by less than half of the barrier; the order "
        "is kept",
        "Statics: two pinned cords of 0.3 m with E 1e9, surfaces 2 mm apart, are pressed against each other by loads"
        " on all vertices of 1 to 1e4 times their weight, in one step and in ten.")
    loads, steps, angles = (1, 1e2, 1e3, 1e4), (1, 10), (90, 30)
    if tools.args.short:
        loads, steps, angles = (1e3,), (10,), (30,)
    cases = {}
    for load, angle, n in itertools.product(loads, angles, steps):
        a = math.radians(angle)
        half, top = 0.15 * np.array([math.cos(a), math.sin(a), 0]), np.array([0, 0, 2 * RADIUS + 2e-3])
        rods = [cord("a", [-0.15, 0, 0], [0.15, 0, 0]), cord("b", top - half, top + half)]
        force = load * WEIGHT * 0.3 / 20
        rest = pins("a", "b") + "loads:\n" + "".join(
            f"- {{rod: {rod}, vertex: {v}, force: [0, 0, {s * force:.17g}]}}\n" for rod, s in (("a", 1), ("b", -1))
            for v in range(1, 20))
        path = scene(tools, f"pressed {load:g} {angle}", rods, rest)
        cases[f"{load:g} weights", f"{angle} degrees", f"{n} steps"] = (path, "-mode", "static", "-load_steps", n)
    results = tools.runAll(cases, ["ours"], frames="all", limit=60)["ours"]
    lines, good = [], []
    for k, r in results.items():
        gap = r.rows["contact_gap_min"].min() if len(r.its) else math.nan
        kept = r.ok and max(abs(overAndUnder(x[:21], x[21:])) for x in r.positions) < 1e-6
        rise = 1e3 * (r.positions[-1, :21, 2].max()) if r.ok else math.nan
        good.append(r.ok and gap > -WIDTH / 2 and kept)
        lines.append([*k, r.cell(), f"{1e3 * gap:.4f}", f"{rise:.3f}", "PASS" if good[-1] and r.max <= 10 else "FAIL"])
    row.judge("runs that end, apart and in order", f"{sum(good)} of {len(good)}", all(good))
    most(results, lambda r: r.max, 10, row, "most iterations in a step")
    row.table(["load", "crossed at", "", "its a step: mean (max)", "least gap [mm]", "lower cord rises to [mm]",
               "mark"],
              lines)
    row.commands += [r.command for r in results.values()]
    return row


KNOT = """gravity: [0, 0, 0]
contact: {{rods: all, friction: {mu}}}
rods:
- {{name: rope, file: {file}, natural: straight, material: {{radius: 3e-3, young: 1e7, poisson: 0.4, density: 1100,
   mass_damping_coefficient: 20}}}}
supports:
- {{vertex: 0, type: clamp, motion: {{velocity: [-0.3, 0, 0]}}}}
- {{vertex: last, type: clamp, motion: {{velocity: [0.3, 0, 0]}}}}
"""


def closedFar(x):
    """A rope closed by a wide loop beyond its ends."""
    far = [[5, 0, 0], [5, 0, 20], [-5, 0, 20], [-5, 0, 0]]
    return np.concatenate([x, [x[-1] + far[0], far[1], far[2], x[0] + far[3]]])


def contactKnots(tools):
    row = tools.Row(
        "contact_knots", "an overhand knot drawn tight, friction from 0 to 1000",
        "every run ends, no step rejected with friction up to 0.1 and none below an eighth above; the knot stays "
        "(determinant 3 of the closed curve in every frame), surfaces overlap by less than the width of the barrier;"
        " the force rises all the time, means of 40 ms, from F r^2/B = 1e-3 to 0.1 and more",
        "The rope of `data/scenes/knot.yaml` (160 edges, r = 3 mm, B = EI), its ends drawn apart by 0.6 m/s. Waves "
        "run along it in 8 ms, so the force is taken in means, after the first 80 ms; its largest fall between "
        "frames is told without a mark. To 0.76 s with frictions 0 and 0.1, where the strain is 2.5 %, to 0.32 s "
        "with those above.")
    ends = {"0": 0.76, "0.1": 0.76, "1": 0.32, "10": 0.32, "1e3": 0.32}
    if tools.args.short:
        ends = {"1": 0.06}
    file = os.path.relpath("data/scenes/knot.csv", tools.args.out + "/scenes")
    cases = {mu: (tools.writeScene(f"rods_knot_{mu}", KNOT.format(mu=mu, file=file)), "-dt", "2e-3", "-t_end", end)
             for mu, end in ends.items()}
    results = tools.runAll(cases, ["ours"], frames="all", limit=100, fields=("position", "reaction"))["ours"]
    unit = 1e7 * np.pi / 4 * 3e-3**2  # B/r^2
    lines, tied, apart, rises = [], [], [], {}
    for mu, r in results.items():
        gap = r.rows["contact_gap_min"].min() if len(r.its) else math.nan
        knots = {determinant(closedFar(x)) for x in r.positions} if r.ok else {"none"}
        tied.append(knots == {3})
        apart.append(r.ok and gap > -0.6e-3)
        force, falls, range_ = np.zeros(1), math.nan, ""
        if r.ok:
            force = r.fields["reaction"][1:, 1, 0] / unit
            bins = np.floor(r.times[1:] / 0.04 - 1e-6)
            means = np.array([force[bins == b].mean() for b in np.unique(bins)])
            begin = max(2, 1 + max(np.flatnonzero(means < 1e-3), default=0))
            late = force[bins >= begin]
            falls = (1 - late / np.maximum.accumulate(late)).max() if len(late) else math.nan
            means = means[begin:]
            if not tools.args.short:
                rises[mu] = bool((np.diff(means) > 0).all()) and (ends[mu] < 0.7 or means[-1] > 0.1)
            range_ = f"{means[0]:.2g} to {means[-1]:.2g}" if len(means) else ""
        long = r.ok and (r.clean if float(mu) <= 0.1 else r.rows["dt"][:-1].min() > 0.1249 * 2e-3)
        good = tied[-1] and apart[-1] and long and rises.get(mu, True)
        lines.append([mu, r.cell(), f"{r.seconds:.1f}", f"{1e3 * gap:.3f}", ", ".join(map(str, sorted(knots))), range_,
                      f"{100 * falls:.1f}", "PASS" if good else "FAIL"])
    row.judge("runs that end", f"{sum(r.ok for r in results.values())} of {len(results)}",
              all(r.ok for r in results.values()))
    loose = {mu: r for mu, r in results.items() if float(mu) <= 0.1}
    if loose:
        row.judge("friction up to 0.1: steps rejected", str(sum(r.rejected for r in loose.values())),
                  all(r.clean for r in loose.values()))
    least = {mu: r.rows["dt"][:-1].min() / 2e-3 if len(r.its) else 0 for mu, r in results.items()}
    key = min(least, key=least.get)
    row.judge("shortest step over that asked for", f"1/{1 / max(least[key], 1e-9):.0f} (friction {key})",
              least[key] > 0.1249)
    row.judge("knot kept", f"{sum(tied)} of {len(tied)}", all(tied))
    row.judge("surfaces apart", f"{sum(apart)} of {len(apart)}", all(apart))
    if rises:
        row.judge("force rises", f"{sum(rises.values())} of {len(rises)}", all(rises.values()))
    row.table(["friction", "its a step: mean (max)", "seconds", "least gap [mm]", "determinants", "F r^2/B",
               "largest fall [%]",
               "mark"], lines)
    row.commands += [r.command for r in results.values()]
    return row


def contactSliding(tools):
    row = tools.Row(
        "contact_sliding", "parallel rods that slide along each other, vertices past vertices",
        "every run ends; the force along the rods is below 1e-3 of that across them without friction; at most 8 "
        "iterations a step in the mean",
        "A soft cord of 0.1 m, clamped at ends that move along at 0.1 m/s, is pressed by 100 weights to a stiff one "
        "(E 1e12, 60 edges of 5 mm) that is clamped: with edges of 5 mm, of 7.7 mm and of 2.5 mm, for 20 mm. Forces "
        "are those of the clamps of the stiff one, after the first 20 ms.")
    edges, frictions = {"5 mm": 20, "7.7 mm": 13, "2.5 mm": 40}, ("0", "0.3")
    if tools.args.short:
        edges = {"7.7 mm": 13}
    cases = {}
    for (name, n), mu in itertools.product(edges.items(), frictions):
        z = 2 * RADIUS + 2e-4
        rods = [cord("rail", [-0.15, 0, 0], [0.15, 0, 0], 60, "1e12"),
                cord("slider", [-0.061, 0, z], [0.039, 0, z], n, "1e7", "velocity: [0.1, 0, 0]")]
        motion = "motion: {velocity: [0.1, 0, 0]}"
        rest = pins("rail", kind="clamp") + "".join(
            f"- {{rod: slider, vertex: {v}, type: clamp, {motion}}}\n" for v in (0, "last")) + "loads:\n" + "".join(
            f"- {{rod: slider, vertex: {v}, force: [0, 0, {-100 * WEIGHT * 0.1 / n:.17g}]}}\n" for v in range(1, n))
        path = scene(tools, f"sliding {n} {mu}", rods, rest, contact=f"{{rods: others, friction: {mu}}}")
        cases[name, mu] = (path, "-dt", "1e-3", "-t_end", 0.04 if tools.args.short else 0.2)
    results = tools.runAll(cases, ["ours"], frames="all", limit=60, fields=("position", "reaction"))["ours"]
    lines, along = [], {}
    for k, r in results.items():
        ratio = mean = across = math.nan
        if r.ok:
            force = r.fields["reaction"][r.times > 0.02, :2].sum(axis=1)
            across = force[:, 2].mean()
            ratio, mean = np.abs(force[:, 0]).max() / across, -force[:, 0].mean() / across
        if k[1] == "0":
            along[k] = ratio if r.ok and across > 0 else math.inf
        lines.append([*k, r.cell(), f"{across:.4g}", f"{ratio:.3g}", f"{mean:.4g}",
                      "PASS" if r.ok and r.mean <= 8 and along.get(k, 0) < 1e-3 else "FAIL"])
    row.judge("runs that end", f"{sum(r.ok for r in results.values())} of {len(results)}",
              all(r.ok for r in results.values()))
    row.judge("without friction: largest force along over that across",
              ", ".join(f"{v:.2g} ({k[0]})" for k, v in along.items()),
              max(along.values()) < 1e-3)
    most(results, lambda r: r.mean, 8, row, "mean iterations a step")
    row.table(["edges", "friction", "its a step: mean (max)", "force across [N]", "largest force along over it", "mean",
               "mark"],
              lines)
    row.commands += [r.command for r in results.values()]
    return row


def pile(tools, name, motion="", contact="", order=None, rods=6, rest=""):
    """Strands of 0.1 m crosswise above each other, in a box."""
    rng = np.random.default_rng(3)
    drawn = []
    for k in range(rods):
        angle = (k % 2) * np.pi / 2 + rng.uniform(-0.15, 0.15)
        half = 0.05 * np.array([np.cos(angle), np.sin(angle), 0])
        middle = np.array([*rng.uniform(-0.012, 0.012, 2), 4e-3 + 5e-3 * k])
        line = f"line: {{from: {vector(middle - half)}, to: {vector(middle + half)}, edges: 20}}"
        drawn.append(f"name: s{k}, {line}, material: {{radius: 0.001, young: 1e7, poisson: 0.4, density: 1000}}")
    walls = ["name: floor, plane: {normal: [0, 0, 1]}"] + [
        f"name: wall{k}, plane: {{normal: [{x}, {y}, 0]}}, position: [{-0.07 * x:g}, {-0.07 * y:g}, 0]"
        for k, (x, y) in enumerate([(1, 0), (-1, 0), (0, 1), (0, -1)])]
    box = "colliders:\n" + "".join(f"- {{{w}{motion}}}\n" for w in walls)
    return scene(tools, name, [drawn[k] for k in order or range(rods)], rest + box, "[0, 0, -9.81]",
                 f"{{rods: others{contact}}}")


def contactBundles(tools):
    row = tools.Row(
        "contact_bundles", "strands dropped crosswise into a box, and shaken",
        "every run ends; no rods pass each other: surfaces never overlap by more than the width of the barrier in a "
        "frame, and axes keep a radius apart on the straight way from frame to frame; at most 10 iterations a step "
        "in the mean; the energy never rises, in a box that is shaken by no more than the work of its walls",
        "Six strands (and twenty) of 0.1 m and radius 1 mm, 20 edges, without friction. Dropped: to 0.6 s. Shaken: "
        "the whole box goes up and down by 3 mm and to the sides by 5 mm at 7 to 9 Hz, to 1 s. One drawn out: the "
        "third by an end, at 0.6 m/s.")
    table = ", ".join(f"[{t:.3f}, {5e-3 * np.sin(16 * np.pi * t):.9g}, {5e-3 * np.sin(14 * np.pi * t):.9g}, "
                      f"{3e-3 * np.sin(18 * np.pi * t):.9g}]" for t in 2e-3 * np.arange(0, 501))
    shaken = f", motion: {{table: [{table}]}}"
    drawn = ("supports:\n- {rod: s2, vertex: 0, type: pin, motion: {table: [[0, 0, 0, 0], [0.2, 0, 0, 0], "
             "[0.6, 0, 0, 0.24]]}}\n")
    cases = {("6", "dropped"): (pile(tools, "bundle"), "-dt", "2e-3", "-t_end", 0.6),
             ("6", "shaken"): (pile(tools, "bundle shaken", shaken), "-dt", "2e-3", "-t_end", 1),
             ("6", "dropped, stiffness 0.25"): (pile(tools, "bundle fixed", contact=", stiffness: 0.25"), "-dt", "2e-3",
                                                "-t_end", 0.6),
             ("6", "one drawn out"): (pile(tools, "bundle drawn", rest=drawn), "-dt", "2e-3", "-t_end", 0.6),
             ("20", "dropped"): (pile(tools, "bundle 20", rods=20), "-dt", "2e-3", "-t_end", 0.4)}
    if tools.args.short:
        cases = {("6", "dropped"): (*cases["6", "dropped"][:-1], 0.12)}
    results = tools.runAll(cases, ["ours"], frames="all", limit=60)["ours"]
    lines, apart, made = [], {}, {}
    for k, r in results.items():
        gap = r.rows["contact_gap_min"].min() if len(r.its) else math.nan
        axes = leastDistance(r.positions, [21] * int(k[0]), 8) if r.ok else math.nan
        apart[k] = r.ok and gap > -0.2e-3 and axes > 1e-3
        if len(r.its):
            energy, begin = r.energy, r.rows["gravity"][0] + r.rows["kinetic"][0]
            without = -min(0, np.cumsum(r.rows["dissipated"]).min())  # beyond the work of what moves
            rise = np.diff(energy).max() if k[1].startswith("dropped") else without
            made[k] = rise / begin
        lines.append([*k, r.cell(), f"{r.seconds:.1f}", f"{1e3 * gap:.4f}", f"{1e3 * axes:.4f}",
                      f"{made.get(k, math.nan):.2g}",
                      "PASS" if apart[k] and r.mean <= 10 and made[k] <= 1e-8 else "FAIL"])
    row.judge("runs that end", f"{sum(r.ok for r in results.values())} of {len(results)}",
              all(r.ok for r in results.values()))
    row.judge("none passes another", f"{sum(apart.values())} of {len(apart)}", all(apart.values()))
    most(results, lambda r: r.mean, 10, row, "mean iterations a step")
    row.judge("energy made, over that of the start", ", ".join(f"{v:.1g} ({' '.join(k)})" for k, v in made.items()),
              len(made) == len(results) and max(made.values()) <= 1e-8)
    row.table(["strands", "", "its a step: mean (max)", "seconds", "least gap [mm]",
               "least distance of axes on the way [mm]",
               "energy made", "mark"], lines)
    row.commands += [r.command for r in results.values()]
    return row


def contactEnds(tools):
    row = tools.Row(
        "contact_ends", "tips of rods against tips and sides",
        "every run ends; surfaces overlap by less than half of the barrier, axes keep a radius apart from frame to "
        "frame; the force is along the line of centres, to 1e-5 of it between tips and 1e-2 of it at a side; what "
        "was thrown leaves",
        "A free rod of 0.06 m and E 1e9 is thrown, tip first, at the tip of another, aside by 0, 2 or 6 mm, or at "
        "its side: at a vertex, in the middle of an edge, between both, and slanted by 0.3 rad. The force is the "
        "change of its momentum in a step, the line that between the axes where they are nearest at the end of the "
        "step; steps are solved to 1e-6 of their loads. And a tip is pushed to a tip, held, and drawn back.")
    ways = [("0.1", "1e-2"), ("1", "1e-3"), ("10", "1e-3"), ("10", "1e-5")]
    places = {"tip, in line": (0, 0), "tip, 2 mm aside": (2e-3, 0), "tip, 6 mm aside": (6e-3, 0),
              "side, at a vertex": (0, 0),
              "side, amid an edge": (2.5e-3, 0), "side, 1 mm from a vertex": (1e-3, 0), "side, slanted": (1e-3, 0.3)}
    if tools.args.short:
        ways, places = ways[1:2], {k: places[k] for k in ("tip, in line", "tip, 2 mm aside")}
    cases = {}
    for (name, (aside, angle)), (v, dt) in itertools.product(places.items(), ways):
        along = np.array([math.cos(angle), math.sin(angle), 0])
        velocity = f"velocity: {vector(float(v) * along)}"
        other = [0.012, aside, 0], [0.072, aside, 0]
        if "side, " in name:
            other = [0.012, -0.03 + aside, 0], [0.012, 0.03 + aside, 0]
        rods = [cord("thrown", -0.06 * along, [0, 0, 0], 12, more=velocity), cord("other", *other, 12)]
        cases[name, f"{v} m/s, dt {dt} s"] = (scene(tools, f"ends {name} {v}", rods), "-dt", dt, "-t_end",
                                            4e-3 / float(v) + max(100 * float(dt), 5e-3))
    table = "[[0, 0, 0, 0], [0.1, 3.2e-3, 0, 0], [0.2, 3.2e-3, 0, 0], [0.3, -1e-3, 0, 0]]"
    if not tools.args.short:
        for name, aside in (("tip, in line", 0), ("tip, 2 mm aside", 2e-3)):
            rods = [cord("thrown", [-0.06, 0, 0], [0, 0, 0], 12, "1e7"),
                    cord("other", [0.012, aside, 0], [0.072, aside, 0], 12, "1e7")]
            rest = (f"supports:\n- {{rod: thrown, vertex: 0, type: clamp, motion: {{table: {table}}}}}\n"
                    "- {rod: other, vertex: last, type: clamp}\n")
            cases[name, "pushed by 1.2 mm"] = (scene(tools, f"ends pushed {aside}", rods, rest), "-dt", "5e-3",
                                               "-t_end", 0.4)
    results = tools.runAll(cases, ["ours"], frames="all", fields=("position", "velocity"))["ours"]
    m, lines, good, sideways = masses(12, 0.06), [], [], {"tips": {}, "sides": {}}
    for (name, way), r in results.items():
        gap = r.rows["contact_gap_min"].min() if len(r.its) else math.nan
        if not r.ok:
            good.append(False)
            lines.append([name, way, r.cell(), f"{1e3 * gap:.3f}", "", "", "FAIL"])
            continue
        aside = {"tips": 0, "sides": 0}
        if "pushed" not in way:
            change = np.diff(np.einsum("v,fvk->fk", m, r.fields["velocity"][:, :13]), axis=0)
            size = np.linalg.norm(change, axis=1)
            for k in np.flatnonzero(size > 1e-3 * size.max()):
                x, y = r.positions[k + 1, :13], r.positions[k + 1, 13:]
                n = between(x, y)
                sine = np.linalg.norm(np.cross(change[k], n)) / np.linalg.norm(n) / size[k]
                what = "tips" if np.linalg.norm(n - y[0] + x[-1]) < 1e-9 else "sides"
                aside[what] = max(aside[what], sine)
        leaves = r.rows["contact"][-1] == 0 and (r.rows["contact"] > 0).any()
        axes = leastDistance(r.positions, [13, 13], 8)
        good.append(leaves and gap > -WIDTH / 2 and axes > RADIUS)
        for what, v in aside.items():
            sideways[what][name, way] = v
        along = aside["tips"] < 1e-5 and aside["sides"] < 1e-2
        lines.append([name, way, r.cell(), f"{1e3 * gap:.3f}", ", ".join(f"{v:.1g}" for v in aside.values()),
                      "yes" if leaves else "no", "PASS" if good[-1] and along else "FAIL"])
    row.judge("runs that end, apart, and leave", f"{sum(good)} of {len(good)}", all(good))
    for what, limit in (("tips", 1e-5), ("sides", 1e-2)):
        key = max(sideways[what], key=sideways[what].get)
        over = sum(v >= limit for v in sideways[what].values())
        row.judge(f"{what}: force beside the line of centres, over it", f"{sideways[what][key]:.2g} ({', '.join(key)})"
                  + (f"; {over} of {len(sideways[what])} above {limit:g}" if over else ""), not over)
    row.table(["against", "", "its a step: mean (max)", "least gap [mm]", "sideways over force: tips, sides", "leaves",
               "mark"],
              lines)
    row.commands += [r.command for r in results.values()]
    return row


def fallen(tools, kind, name, s=1.0, shift=(0, 0, 0), rotation=(0, 0, 0)):
    """A cord that falls on a pinned one across it, in units of 1/s m, turned and moved."""
    n, rot = (lambda v: f"{v:.17g}"), tools.turn(rotation)
    at = lambda *p: vector(s * (rot @ np.array(p, float) + shift))
    to = lambda *p: vector(rot @ np.array(p, float))
    material = f"material: {{radius: {n(0.004 * s)}, young: {n(1e6 / s)}, poisson: 0.4, density: {n(1100 / s**3)}}}"
    law = f", law: penalty, stiffness: {n(1e7 / s)}, threshold: {n(1e-3 * s)}, smoothing: {n(5e-3 * s)}"
    rods = [f"name: lower, line: {{from: {at(-0.15, 0, 0)}, to: {at(0.15, 0, 0)}, edges: 30}}, "
            f"director: {to(0, 0, 1)}, {material}",
            f"name: upper, line: {{from: {at(-0.09, -0.12, 0.012)}, to: {at(0.11, 0.13, 0.012)}, edges: 30}}, "
            f"director: {to(0, 0, 1)}, {material}"]
    contact = f"{{rods: others, friction: 0.3, fall_off_velocity: {n(0.01 * s)}{law if kind == 'penalty' else ''}}}"
    return scene(tools, name, rods, pins("lower"), vector(s * rot @ np.array([0, 0, -9.81])), contact)


def contactRodUnits(tools):
    row = tools.Row(
        "contact_rod_units", "rods that touch in other units, moved and turned",
        "the same iteration counts, step by step, in m, mm and um; moved by 1000 m, and turned, the same answer to "
        "1e-6 of the rod's length",
        "A cord falls on a pinned one that crosses it, with friction: barrier and penalty. Length in other units; "
        "time and mass stay.")
    kinds = ("barrier",) if tools.args.short else ("barrier", "penalty")
    far, turned = np.full(3, 1000 / np.sqrt(3)), np.array([0.4, -0.9, 0.7])
    ways = {"m": {}, "mm": {"s": 1e3}, "um": {"s": 1e6}, "moved": {"shift": far}, "turned": {"rotation": turned}}
    if tools.args.short:
        ways = {w: ways[w] for w in ("m", "um", "turned")}
    cases = {(k, w): (fallen(tools, k, f"units {k} {w}", **v), "-dt", "5e-3", "-t_end", 0.2)
             for k in kinds for w, v in ways.items()}
    results = tools.runAll(cases, ["ours"], limit=60)["ours"]
    lines = []
    for k in kinds:
        base = results[k, "m"]
        for w in list(ways)[1:]:
            r = results[k, w]
            if not base.ok or not r.ok:
                row.judge(f"{k}, {w}", f"m: {base.cell()}, {w}: {r.cell()}", False)
                continue
            x = r.positions[-1] / ways[w].get("s", 1) - ways[w].get("shift", 0)
            error = np.abs(x @ tools.turn(ways[w].get("rotation", np.zeros(3))) - base.positions[-1]).max() / 0.3
            differ = int((r.its != base.its).sum()) if len(r.its) == len(base.its) else -1
            counts = "identical counts" if differ == 0 else f"{differ} of {len(base.its)} steps differ"
            row.judge(f"{k}, {w}", f"{counts}, answers differ by {error:.1g}", differ == 0 if w in ("mm", "um")
                      else error < 1e-6)
            lines.append([k, w, r.cell(), counts, f"{error:.1g}", "PASS" if row.verdicts[-1][2] else "FAIL"])
    row.table(["law", "", "its a step: mean (max)", "beside those in m",
               "largest difference of a vertex, over the length",
               "mark"], lines)
    row.commands += [r.command for r in results.values()]
    return row


def contactOrder(tools):
    row = tools.Row(
        "contact_order", "rods that touch run again, and in another order",
        "run again the same bits of all positions and velocities; in another order the same to 1e-10 of the length "
        "of a rod",
        "The six strands of contact_bundles, dropped, with friction 0.2, to 0.2 s; and a rod of 0.06 m thrown at 10 "
        "m/s, tip first, at the side of another, a vertex of it, in steps of 1e-5 s.")
    end, other = 0.06 if tools.args.short else 0.2, [3, 0, 5, 1, 4, 2]
    strands = lambda order: (pile(tools, f"order {order}", contact=", friction: 0.2", order=order), "-dt", "2e-3",
                             "-t_end", end)
    two = [cord("thrown", [-0.06, 0, 0], [0, 0, 0], 12, more="velocity: [10, 0, 0]"),
           cord("other", [0.012, -0.03, 0], [0.012, 0.03, 0], 12)]
    thrown = lambda order: (scene(tools, f"order thrown {order}", [two[k] for k in order]), "-dt", "1e-5", "-t_end",
                            6e-4)
    kinds = {"pile": (strands, [*range(6)], other, 21, 0.1), "tip on a side": (thrown, [0, 1], [1, 0], 13, 0.06)}
    if tools.args.short:
        del kinds["tip on a side"]
    cases = {}
    for kind, (make, plain, mixed, _, _) in kinds.items():
        cases |= {(kind, "as it is"): make(plain), (kind, "again"): make(plain), (kind, "other order"): make(mixed)}
    results = tools.runAll(cases, ["ours"], frames="all", limit=60, fields=("position", "velocity"))["ours"]
    for kind, (_, plain, mixed, vertices, length) in kinds.items():
        base, again, moved = (results[kind, w] for w in ("as it is", "again", "other order"))
        if not (base.ok and again.ok and moved.ok):
            row.judge(f"{kind}: runs that end", f"{base.ok + again.ok + moved.ok} of 3", False)
            continue
        same = lambda r: r.positions.shape == base.positions.shape
        bits = same(again) and all(np.array_equal(again.fields[f], base.fields[f]) for f in ("position", "velocity"))
        row.judge(f"{kind}, again", "same bits" if bits else "other bits", bits)
        error = math.inf
        if same(moved):
            x = moved.positions.reshape(len(base.positions), len(plain), vertices, 3)[:, np.argsort(mixed)]
            error = np.abs(x.reshape(base.positions.shape) - base.positions).max() / length
        row.judge(f"{kind}, other order", "same bits" if error == 0 else f"differs by {error:.1g}", error <= 1e-10)
    row.table(["", "", "its a step: mean (max)"], [[*k, r.cell()] for k, r in results.items()])
    row.commands += [r.command for r in results.values()]
    return row


def contactRodEdges(tools):
    row = tools.Row(
        "contact_rod_edges", "long, short and unequal edges of rods that touch",
        "the same contact force within 2 % on edges of 20 r, r and 0.1 r and on edges of 1 to 100 by turns; a "
        "warning where they are 20 r long",
        "Statics: a clamped cord of 1.2 m and E 1e9 is lifted by 20 mm, 0.85 m from its clamp, by a stiff one of 0.4"
        " m across it, clamped at both ends, on the same edges. The force is that of the clamp of the first.")
    lengths = {"r": ([0.005], 240), "20 r": ([0.1], 12), "0.1 r": ([0.0005], 2400), "1:100": ([0.05, 0.0005], 47)}
    if tools.args.short:
        lengths = {k: lengths[k] for k in ("1:100", "20 r")}
    cases = {}
    for name, (h, n) in lengths.items():
        x = np.concatenate([[0], np.cumsum([h[k % len(h)] for k in range(n)])])
        x, y = (np.append(x[x < length - 1e-9], length) for length in (1.2, 0.4))
        y = y - 0.2
        lower = "points: [" + ", ".join(f"[{v:.6g}, 0, 0.0107]" for v in x) + "]"
        upper = "points: [" + ", ".join(f"[0.85, {v:.6g}, 0]" for v in y) + "]"
        rods = [f"name: beam, {lower}, material: {CORD('1e9')}", f"name: bar, {upper}, material: {CORD('1e12')}"]
        rest = "supports:\n- {rod: beam, vertex: 0, type: clamp}\n" + "".join(
            f"- {{rod: bar, vertex: {v}, type: clamp, motion: {{velocity: [0, 0, 0.02]}}}}\n" for v in (0, "last"))
        cases[name] = (scene(tools, f"edges {name}", rods, rest), "-mode", "static")
    results = tools.runAll(cases, ["ours"], limit=40, fields=("position", "reaction"))["ours"]
    force = {k: -float(r.fields["reaction"][-1, 0, 2]) if r.ok else math.nan for k, r in results.items()}
    base = next(iter(force))
    apart = {k: abs(force[k] / force[base] - 1) for k in results}
    worst = max(apart, key=lambda k: apart[k] if apart[k] == apart[k] else math.inf)
    row.judge(f"force {abs(force[base]):.5g} N on edges of {base}, others apart by",
              f"{100 * apart[worst]:.2f} % ({worst})",
              apart[worst] <= 0.02)
    warned = bool(re.search(r"warning: .*(edge|radi)", results["20 r"].text))
    if not tools.args.short:
        row.judge("edges of 20 r: warned of", "yes" if warned else "no", warned)
    row.table(["edges", "its a step: mean (max)", "seconds", "contact force [N]", "apart [%]", "least gap [mm]",
               "mark"],
              [[k, r.cell(), f"{r.seconds:.1f}", f"{abs(force[k]):.6g}", f"{100 * apart[k]:.3f}",
                f"{1e3 * r.rows['contact_gap_min'][-1]:.3f}" if len(r.its) else "",
                "PASS" if apart[k] <= 0.02 else "FAIL"]
               for k, r in results.items()])
    row.commands += [r.command for r in results.values()]
    return row


def contactRodLaws(tools):
    row = tools.Row(
        "contact_rod_laws", "stiffness, barrier and time step of rods that fall on each other",
        "every run ends, surfaces overlap by less than half of the barrier; mean iterations at most 4 with the "
        "defaults, 8 with other widths and stiffnesses",
        "A cord of 0.3 m falls by 6 mm on a pinned one, without weight, that crosses it at 60 degrees, off their "
        "middles: Young's moduli and time steps; widths of the barrier (of the radius) and its stiffness; the "
        "penalty law.")
    laws = {"width 0.5": "distance: 2.5e-3", "width 0.02": "distance: 1e-4", "width 1e-3": "distance: 5e-6",
            "stiffness 1e-2": "stiffness: 0.01", "stiffness 1": "stiffness: 1", "stiffness 100": "stiffness: 100",
            "stiffness 1e4": "stiffness: 1e4", "penalty 1e7": "law: penalty, stiffness: 1e7",
            "penalty 1e9": "law: penalty, stiffness: 1e9",
            "penalty 1e11": "law: penalty, stiffness: 1e11"}
    frame = "0.016666666666666666"
    youngs, dts = ("1e5", "1e6", "1e9", "1e12"), ("1e-4", "1e-3", frame, "0.1")
    if tools.args.short:
        youngs, dts, laws = ("1e9",), (frame,), {k: laws[k] for k in ("width 0.02", "stiffness 1e4", "penalty 1e9")}
    end = {"1e-4": 0.06, "1e-3": 0.2}

    def fall(name, young, text=""):
        upper = cord("upper", [-0.055, -0.13, 0.015 + 1e-3], [0.095, 0.13, 0.015 + 1e-3], 20, young)
        rods = [cord("lower", [-0.15, 0, 0], [0.15, 0, 0], 20, young, "gravity: false"), upper]
        return scene(tools, f"laws {name} {young}", rods, pins("lower"), "[0, 0, -9.81]", f"{{rods: others{text}}}")

    cases = {("default", f"E {e} Pa, dt {float(dt):.3g} s"): (fall("default", e), "-dt", dt, "-t_end", end.get(dt, 1))
             for e in youngs for dt in dts}
    cases |= {("law", f"{name}, E {e} Pa"): (fall(name, e, ", " + text), "-dt", frame, "-t_end", 1)
              for name, text in laws.items() for e in youngs[1:3] or youngs}
    results = tools.runAll(cases, ["ours"], frames="all", limit=30)["ours"]
    lines, good = [], []
    for k, r in results.items():
        width = next((w for n, w in (("width 0.5", 2.5e-3), ("width 0.02", 1e-4), ("width 1e-3", 5e-6)) if n in k[1]),
                     WIDTH)
        gap = r.rows["contact_gap_min"].min() if len(r.its) else math.nan
        good.append(r.ok and ("penalty" in k[1] and gap > -2 * RADIUS or gap > -width / 2))
        lines.append([k[1], r.cell(), f"{1e3 * gap:.4f}", "PASS" if good[-1] else "FAIL"])
    row.judge("runs that end, apart", f"{sum(good)} of {len(good)}", all(good))
    most(results, lambda r: r.mean, 4, row, "defaults: mean iterations a step", lambda k: k[0] == "default")
    most(results, lambda r: r.mean, 8, row, "other laws: mean iterations a step", lambda k: k[0] == "law")
    row.table(["case", "its a step: mean (max)", "least gap [mm]", "mark"], lines)
    row.commands += [r.command for r in results.values()]
    return row


def contactApart(tools):
    row = tools.Row(
        "contact_apart", "a hundred rods apart from each other, contact on and off",
        "the same bits of all positions; at most 1.05 times the time of a step",
        "A hundred clamped cords of 0.3 m, 50 mm apart and more, sag and swing. Times are the best of three runs by "
        "turns.")
    supports = "supports:\n- {rod: all, vertex: 0, type: clamp}\n"
    rods = [cord(f"c{i}_{j}", [0, 0.05 * i, 0.5 * j], [0.3, 0.05 * i, 0.5 * j], 20, "1e7") for i in range(10)
            for j in range(10)]
    end = 0.02 if tools.args.short else 0.6
    paths = {how: scene(tools, f"apart {how}", rods, supports, "[0, 0, -9.81]", text) for how,
             text in (("off", ""), ("on", "{rods: others}"))}
    found = {how: [] for how in paths}
    for _ in range(1 if tools.args.short else 3):
        for how, path in paths.items():
            found[how].append(tools.run(path, "-dt", "2e-3", "-t_end", end, frames="all", limit=60))
    runs = [r for rs in found.values() for r in rs]
    row.judge("runs that end", f"{sum(r.ok for r in runs)} of {len(runs)}", all(r.ok for r in runs))
    if row.passed():
        off, on = found["off"][0], found["on"][0]
        bits = off.positions.shape == on.positions.shape and np.array_equal(off.positions, on.positions)
        row.judge("positions", "same bits" if bits else f"apart by {np.abs(off.positions - on.positions).max():.1g} m",
                  bits)
        best = {how: min(r.rows["wall_seconds"][-1] for r in rs) for how, rs in found.items()}
        ratio = best["on"] / best["off"]
        row.judge("time of a step, on over off", f"{ratio:.3f}", None if tools.args.short else ratio <= 1.05)
        row.table(["contact", "its a step: mean (max)", "seconds"],
                  [[how, rs[0].cell(), ", ".join(f"{r.rows['wall_seconds'][-1]:.3f}" for r in rs)] for how,
                   rs in found.items()])
    row.commands += [r.command for r in runs[:2]]
    return row


def rows(tools):
    functions = {"contact_crossing": contactCrossing, "contact_pressed": contactPressed,
                 "contact_knots": contactKnots, "contact_sliding": contactSliding, "contact_bundles": contactBundles,
                 "contact_ends": contactEnds, "contact_rod_units": contactRodUnits, "contact_order": contactOrder,
                 "contact_rod_edges": contactRodEdges, "contact_rod_laws": contactRodLaws,
                 "contact_apart": contactApart}
    return {name: (lambda f=f: f(tools)) for name, f in functions.items()}
