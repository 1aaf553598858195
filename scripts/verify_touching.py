"""Cases of scripts/verify for rods that touch each other and themselves, and for a tip that sticks and slips.

    import verify_touching
    for name, function, edges, reference, short in verify_touching.cases(tools):    # tools: scripts/verify itself

Each function is one of (edges, measure) that gives the error and the reference value.
"""
import math
import re

import numpy as np

tools = None  # run, find, relative, distance, Failure and others of scripts/verify
ADAPTED = ["-dt_adapt", "error", "-dt_rtol", "0.1", "-dt_atol", "1e-2"]  # to where it rests, no matter how
FIELDS = ["-output_fields", "all,reaction,reaction_moment"]


def listed(points):
    return "[" + ", ".join("[" + ", ".join(f"{c:.17g}" for c in p) + "]" for p in points) + "]"


# --- the tip of a rod sticks to a plane, and slips ---


def stick_slip(friction):
    """The part of its length by which the rod is shorter when it slips: where the ratio of both forces, a parabola
    through the last three states that stick, becomes that of friction. It has to do so before the first that slips."""

    def error(n, measure):
        exact = tools.find("stick_slip_threshold.csv", mu=friction)["e_c"]
        table = f"{{table: [[0, 0, 0, 0], [0.5, 0, 0, {-0.9 * exact:.16g}], [1, 0, 0, {-1.1 * exact:.16g}]]}}"
        change = [(r"friction: [^,]*", f"friction: {friction}"), (r"\{velocity: .*?\}", table),
                  (r"vertex: 14", f"vertex: {7 * n // 10}")]
        s = tools.run("touch_stick_slip", n, measure, change, FIELDS)
        short = 1 - (s.history[:, 0, 2] - s.history[:, -1, 2])
        slipped = int(np.argmax(np.abs(s.history[:, -1, 0]) > 2e-6))
        if slipped < 4:
            raise tools.Failure("the tip does not slip")
        stuck = slice(slipped - 3, slipped)
        force = s.reactions[stuck, 0]
        found = np.polyval(np.polyfit(force[:, 0] / force[:, 2] - friction, short[stuck], 2), 0)
        if not short[slipped - 1] <= found <= short[slipped] + 1e-6:
            between = f"{short[slipped - 1]:.6g} and {short[slipped]:.6g}"
            raise tools.Failure(f"the tip slips between {between}, the forces say {found:.6g}")
        return tools.relative(found, exact)

    return error


# --- two strings that cross ---


def crossed_exact(r, apart):
    """Tension and force of the contact of contact_crossed_strings.csv, for axes that come to lie `apart`. An edge stays
    level between inclined parts; the table has its length h before they touch, with the stretch lam0."""
    half, level, rise = r["a"] / r["lam0"], r["h"] / r["lam0"], r["c"] + apart / 2
    stretched = level
    law = lambda stretch: r["EA"] * (stretch**2 - 1) / 2 * stretch
    for _ in range(100):
        run = r["a"] - stretched / 2
        length = math.hypot(run, rise)
        tension = law(length / (half - level / 2))
        pull, stretch = tension * run / length, r["lam0"]
        for _ in range(50):  # of the level edge, by Newton's method
            stretch -= (law(stretch) - pull) / (r["EA"] * (3 * stretch**2 - 1) / 2)
        stretched = level * stretch
    return length / (half - level / 2), tension, 2 * tension * rise / length, rise / run


def crossed(stiffness, stretch, quantity):
    """What each string bears, where the vertices in the middle are d apart. Strings of slope m touch not there, as the
    table has it, but on the edges beside, m d/(1 + 2 m^2) away: by the energy the force is larger by this part of a.
    Where level edges cross in the middle the table is exact."""

    def error(n, measure):
        r = tools.find("contact_crossed_strings.csv", EA=stiffness, lam0=stretch)
        exact = crossed_exact(r, 2 * r["r"])
        assert all(math.isclose(a, r[k], rel_tol=1e-9) for a, k in zip(exact, ("lam", "T", "N")))
        half, gap = r["a"] / r["lam0"], 1.001 * r["r"]
        s = np.linspace(0, half, n // 2 + 1) if r["h"] == 0 else np.linspace(r["h"] / r["lam0"] / 2, half, n // 2 + 1)
        s = np.concatenate([-s[::-1], s[1:] if r["h"] == 0 else s])
        o = np.zeros_like(s)
        change = [(r"radius: [^,]*", f"radius: {r['r']}"), (r"distance: [^}]*", f"distance: {1e-3 * r['r']:.16g}"),
                  (r"axial_stiffness: [^,]*", f"axial_stiffness: {r['EA']}")]
        for k, name in enumerate(("below", "above")):
            sign = (-1, 1)[k]
            points = np.stack([s, o, o + sign * gap] if k == 0 else [o, s, o + sign * gap], 1)
            change.append((rf"name: {name}\n    points: .*", f"name: {name}\n    points: {listed(points)}"))
            for vertex, side in (("0", -1), ("last", 1)):
                move = np.roll([side * (r["a"] - half), 0], k).tolist() + [-sign * (r["c"] + gap)]
                change.append((rf"(rod: {name}, vertex: {vertex}.*velocity: )\[.*\]", lambda m, v=move: m[1] + str(v)))
        state = tools.run("touch_crossed", n, measure, change, FIELDS)
        a, b = state.rods["below"], state.rods["above"]
        middle = len(a) // 2
        apart = (b[middle] - a[middle])[2]
        _, tension, force, slope = crossed_exact(r, apart)
        if quantity == "tension":
            return tools.relative(state.axial[0] * state.frames.length[0] / state.reference.length[0], tension)
        arm = 0 if r["h"] else apart * slope / (1 + 2 * slope**2)
        return tools.relative(state.reaction[:2, 2].sum(), force / (1 - arm / r["a"]))

    return error


# --- the distance at which rods cross ---


def segment_distance(a, b, c, d):
    """Of a segment from a to b from segments from c to d, (n, 3) each."""
    u, v, w = b - a, d - c, a - c
    dot = lambda p, q: np.sum(p * q, -1)
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    s = np.clip((uv * vw - vv * uw) / np.maximum(uu * vv - uv**2, 1e-300), 0, 1)
    t = np.clip((uv * s + vw) / vv, 0, 1)
    s = np.clip((uv * t - uw) / uu, 0, 1)
    return np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)


def distance_of(x, y):
    """Between two polylines."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1)))
    return segment_distance(x[i], x[i + 1], y[j], y[j + 1]).min()


def shifted(degrees):
    """Largest less least distance of twenty pairs, over that of rods that touch."""
    shifts, half, radius = 20, 0.12, 0.005

    def error(n, measure):
        slope = math.radians(degrees)
        along = np.array([math.cos(slope), math.sin(slope), 0])
        with open(f"{tools.root}/data/scenes/verify/touch_shifted.yaml") as f:
            lower, upper = re.findall(r"(  - name: \w+\n    line: .*\n    material: .*\n)", f.read())
            f.seek(0)
            supports = re.findall(r"  - \{rod: .*\n", f.read())
        blocks, held = "", ""
        for k in range(shifts):
            away = np.array([0, 0.3 * k, 0])
            s = np.linspace(-half, half, n + 1)
            s[1:-1] += (k / shifts - 0.5) * (s[1] - s[0])
            ends = np.array([[-half, 0, 0], [half, 0, 0]]) + away
            line = f"line: {{from: {listed(ends[:1])[1:-1]}, to: {listed(ends[1:])[1:-1]}, edges: {n}}}"
            blocks += re.sub("line: .*", line, lower.replace("lower", f"lower{k}"))
            points = s[:, None] * along + away + [0, 0, 0.0106]
            blocks += re.sub("line: .*", f"points: {listed(points)}", upper.replace("upper", f"upper{k}"))
            held += "".join(line.replace("lower", f"lower{k}").replace("upper", f"upper{k}") for line in supports)
        change = [(r"rods:\n(?:  .*\n)+", "rods:\n" + blocks), (r"supports:\n(?:  .*\n)+", "supports:\n" + held)]
        rods = tools.run("touch_shifted", n, measure, change).rods
        apart = [distance_of(rods[f"lower{k}"], rods[f"upper{k}"]) for k in range(shifts)]
        return (max(apart) - min(apart)) / (2 * radius), 0.0

    return error


# --- an overhand knot ---


def resampled(curve, edges):
    """With vertices that are equally far apart along the curve."""
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    places = np.linspace(0, along[-1], edges + 1)
    return np.stack([np.interp(places, along, c) for c in curve.T], 1)


def knot_curve(length, edges):
    t = np.linspace(-2.25, 2.25, 4001)
    curve = 13 * np.stack([0.22 * (t**5 - 10 * t), t**3 - 3 * t, t**4 - 4 * t**2], 1)
    ends = (length - np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()) / 2
    first, last = (ends * v / np.linalg.norm(v) for v in (curve[0] - curve[1], curve[-1] - curve[-2]))
    return resampled(np.concatenate([[curve[0] + first], curve, [curve[-1] + last]]), edges)


def knot(thickness):
    """The force on the ends, against that of the loop as large as it is: its radius by the mean curvature of a third."""
    length = 600

    def error(n, measure):
        for r in tools.rows("overhand_knot.csv"):
            assert float(r["mu"]) > 0 or math.isclose(float(r["Fh2B_tighten"]), float(r["eps"]) ** 4 / 2, rel_tol=1e-6)
        x, loop = knot_curve(length, n), 2 * math.pi / thickness**2
        change = [(r"points: .*", f"points: {listed(x)}")]
        for vertex, start, side in (("0", x[0], -1), ("last", x[-1], 1)):
            move = (np.array([side * (length - loop) / 2, 0, 0]) - start).tolist()
            change.append((rf"(vertex: {vertex}, .*)velocity: .*\]", rf"\g<1>table: [[0, 0, 0, 0], {[4e5, *move]}]"))
        s = tools.run("touch_knot", n, measure, change, FIELDS)
        sixth = round(loop / length * n / 6)
        curvature = (np.linalg.norm(s.frames.bend, axis=1) / s.reference.step)[n // 2 - 1 - sixth : n // 2 + sixth]
        return tools.relative(s.reaction[-1, 0], curvature.mean() ** 2 / 2)

    return error


# --- a plectoneme ---


def ply_forces(angle):
    """T r^2/B and M r/B of plectoneme.csv."""
    s, c = math.sin(angle), math.cos(2 * angle)
    return s**4 * (0.5 + 1 / c), 2 * math.cos(angle) * s**3 / c


def plectoneme_curve(angle, radius, turns, straight, edges):
    """A straight end along x, a quarter of a circle, a helix about z whose angle fades in and out, a loop, and the first
    parts again, turned about z by half a turn."""
    pitch = 2 * math.pi * radius / math.tan(angle)
    z = np.linspace(0, turns * pitch, 4000)
    part = np.clip(np.minimum(z, z[-1] - z) / (0.75 * pitch), 0, 1)
    rate = -2 * math.pi / pitch * part**2 * (3 - 2 * part)
    phi = math.pi + np.concatenate([[0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(z))])
    helix = np.stack([radius * np.cos(phi), radius * np.sin(phi), z], 1)
    wide, u = 5 * radius, np.linspace(0, math.pi / 2, 200)
    bend = np.stack([-radius - wide + wide * np.sin(u), 0 * u, -wide * np.cos(u)], 1)
    half = np.concatenate([bend[:1] - [straight, 0, 0], bend[:-1], helix])
    u = np.linspace(0, math.pi, 400)[1:-1]
    across = (radius + (wide - radius) * np.sin(u) ** 2) * np.cos(u)
    outwards = [math.cos(phi[-1]), math.sin(phi[-1]), 0]
    loop = across[:, None] * outwards + np.outer(z[-1] + 2.6 * wide * np.sin(u), [0, 0, 1])
    return resampled(np.concatenate([half, loop, half[::-1] * [-1, -1, 1]]), edges)


def ply(x):
    """Angle and half the distance of the strands in the middle fifth of the ply."""
    n, found = len(x) - 1, []
    j = np.arange(n // 2 + n // 16, n)
    e = x[j + 1] - x[j]
    for i in range(n // 8, n // 2 - n // 16):
        s = np.clip(np.sum((x[i] - x[j]) * e, 1) / np.sum(e * e, 1), 0, 1)
        apart = x[i] - x[j] - s[:, None] * e
        found.append([x[i], apart[np.argmin(np.linalg.norm(apart, axis=1))]])
    found = np.array(found)
    found = found[np.linalg.norm(found[:, 1], axis=1) < 2.2]
    places, apart = found[2 * len(found) // 5 : 3 * len(found) // 5 + 1].transpose(1, 0, 2)
    middles = places - apart / 2
    axes = np.linalg.svd(middles - middles.mean(axis=0))[2]  # the axis first
    axes *= np.linalg.det(axes)
    turned = np.unwrap(np.arctan2(apart @ axes[2], apart @ axes[1]))
    radius = np.linalg.norm(apart, axis=1).mean() / 2
    return abs(math.atan(radius * np.polyfit(middles @ axes[0], turned, 1)[0])), radius


def plectoneme(quantity, extrapolated):
    """Pull T and moment M on the ends, with the angle that the ply has; with the radius that it has, too, or with that
    of the rod and a barrier of no width, from two of different width."""
    k = ("T", "M").index(quantity)

    def measured(n, measure, width):
        start, drawn = math.radians(30), 1.12
        x = plectoneme_curve(start, drawn, 3, 15, n)
        turns = ply_forces(start)[1] * np.linalg.norm(np.diff(x, axis=0), axis=1).sum() / (2 * math.pi)
        change = [(r"points: .*", f"points: {listed(x)}"), (r"turns: \d+", f"turns: {turns:.16g}"),
                  (r"distance: [^}]*", f"distance: {width}")]
        s = tools.run("touch_plectoneme", n, measure, change, [*FIELDS, *ADAPTED])
        angle, radius = ply(s.x)
        force = (s.reaction[-1, 0], s.reaction_moment[-1, 0])[k]
        return force, force * radius ** (2 - k), ply_forces(angle)[k]

    def error(n, measure):
        for r in tools.rows("plectoneme.csv"):
            assert math.isclose(ply_forces(math.radians(float(r["alpha_deg"])))[k], float(r[quantity]), rel_tol=1e-9)
        wide = measured(n, measure, 0.05)
        if not extrapolated:
            return tools.relative(*wide[1:])
        narrow = measured(n, measure, 0.0125)
        ratios = [m[0] / m[2] for m in (wide, narrow)]
        return tools.relative((4 * ratios[1] - ratios[0]) / 3 * narrow[2], narrow[2])

    return error


# --- all of them ---


def cases(of):
    global tools
    tools = of
    of_strings, of_ply = "contact_crossed_strings.csv", "plectoneme.csv"
    for friction in (0.1, 0.2, 0.3):
        name = f"sticking tip, friction {friction}, shortening at which it slips"
        yield f"touching: {name}", stick_slip(friction), (20, 40, 80), "stick_slip_threshold.csv", friction == 0.2
    for stiffness, stretch, where in ((1000, 1, ""), (1000, 1.05, ""), (1e4, 1.01, ", in mid-edge"), (1e5, 1.001, "")):
        name = f"touching: crossed strings, EA {stiffness:g}, stretch {stretch}{where}"
        force = of_strings + ("" if where else ", pressed beside the vertices")
        yield f"{name}, force", crossed(stiffness, stretch, "force"), (8, 16, 32), force, False
        yield f"{name}, tension", crossed(stiffness, stretch, "tension"), (8, 16, 32), of_strings, False
    for degrees in (90, 30, 10):
        name = f"touching: rods crossing at {degrees}°, spread of their distance over 20 shifts"
        yield name, shifted(degrees), (12, 24, 48), "none", False
    for thickness in (0.15, 0.2):
        name = f"touching: overhand knot, sqrt(h/R) about {thickness}, force, to leading order"
        yield name, knot(thickness), (75, 150, 300), "overhand_knot.csv", False
    for quantity, meant in (("T", "tension"), ("M", "moment")):
        yield f"touching: plectoneme, at its radius, {meant}", plectoneme(quantity, False), (100, 200, 400), of_ply, False
        name = f"touching: plectoneme, width of the barrier extrapolated, {meant}"
        yield name, plectoneme(quantity, True), (100, 200, 400), of_ply, False
