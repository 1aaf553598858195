"""Trajectories with skins, made here, and what a skin is, in plain Python."""
import math

import h5py
import numpy as np

FRAMES = 4
SIDES = 10


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def directors(x, edges, turn):
    """Unit vectors across the edges of vertices (n, 3), turned by `turn` [rad] from edge to edge."""
    t = unit(np.roll(x, -1, 0)[:edges] - x[:edges])
    wish = np.array([0.3, 0.2, 1.0])
    a = unit(wish - (t @ wish)[:, None] * t)
    angle = turn * np.arange(edges)[:, None]
    return np.cos(angle) * a + np.sin(angle) * np.cross(t, a)


def arc(n, bend):
    s = np.linspace(0, 1, n)
    return np.stack([s, 0.3 * bend * s**2, 0.1 * bend * np.sin(3 * s)], 1)


def ring(n, stretch):
    angle = 2 * np.pi * np.arange(n) / n
    return np.stack([stretch * np.cos(angle), 2 + np.sin(angle) / stretch, 0.1 * stretch * np.cos(2 * angle)], 1)


# Rods: name, closed, vertices, edges a point of the skin moves with; 0 is without one.
RODS = [("one", False, 9, 1), ("bare", False, 5, 0), ("two", False, 300, 2), ("band", True, 12, 3),
        ("loop", True, 7, 0)]


def states(closed, n, frame):
    shape = ring(n, 1 + 0.1 * frame) if closed else arc(n, 1.0 + frame)
    return shape, directors(shape, n if closed else n - 1, 0.2 + 0.3 * frame)


def skin(closed, n, count, rng):
    """A closed surface around a rod as drawn: points, triangles, edge, weight, local. Each point lies in the planes of
    `count` edges side by side."""
    x, a = states(closed, n, 0)
    m, _, frame = frames(x, a)
    edges, rings = len(a), len(a)
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    points = (m[:, None] + 0.03 * np.cos(angle)[:, None] * frame[:, None, 1]
              + 0.02 * np.sin(angle)[:, None] * frame[:, None, 2]).reshape(-1, 3)
    at = np.repeat(np.arange(edges), SIDES)
    i, k = np.meshgrid(np.arange(rings if closed else rings - 1), np.arange(SIDES), indexing="ij")
    p = [(i + di) % rings * SIDES + (k + dk) % SIDES for di, dk in ((0, 0), (0, 1), (1, 0), (1, 1))]
    triangles = np.concatenate([np.stack([p[a], p[b], p[c]], -1).reshape(-1, 3) for a, b, c in ((0, 1, 2), (2, 1, 3))])
    if not closed:
        points = np.concatenate([points, m[[0, -1]]])
        at, k = np.r_[at, 0, edges - 1], np.arange(SIDES)
        first, middle = (rings - 1) * SIDES, np.full(SIDES, rings * SIDES)
        triangles = np.concatenate([triangles, np.stack([middle, (k + 1) % SIDES, k], 1),
                                    np.stack([middle + 1, k + first, (k + 1) % SIDES + first], 1)])
    edge = at[:, None] + np.arange(count)[None]
    edge = edge % edges if closed else np.minimum(edge, edges - 1)
    weight = rng.random(edge.shape) + 0.2
    weight[(edge[:, :1] == edge) & (np.arange(count) > 0)] = 0  # an edge that is repeated
    weight[edge.shape[0] // 2, 1:] = 0
    edge[edge.shape[0] // 2] = edge[edge.shape[0] // 2, 0]
    weight /= weight.sum(1, keepdims=True)
    local = np.einsum("pkij,pkj->pki", frame[edge], points[:, None] - m[edge])
    return points, triangles, edge, weight, local


def frames(x, a):
    """Middles, edges and frames (rows) of edges."""
    e = np.roll(x, -1, 0)[: len(a)] - x[: len(a)]
    t = unit(e)
    return x[: len(a)] + e / 2, e, np.stack([t, a, np.cross(t, a)], 1)


def write(path, times=(0.0, 0.25, 0.5, 1.0), still=False, move=lambda x: x, turn=lambda a: a, skins=True, wide=None):
    """Writes a file of format 2 with RODS. `move` and `turn` change all vertices and directors of the state; `wide`:
    the number of edges a point has in the file, the rest of weight 0. Returns the skins by rod, as made."""
    f = h5py.File(path, "w")
    f.attrs.update({"gravity": [0, -9.81, 0], "format": "tendril-trajectory", "format_version": 2, "options": ""})
    vertices = np.cumsum([0] + [n for _, _, n, _ in RODS])
    edges = np.cumsum([0] + [n - (not closed) for _, closed, n, _ in RODS])
    f["topology/rod_vertex_offsets"], f["topology/rod_edge_offsets"] = vertices, edges
    f["topology/rod_cell_offsets"] = np.zeros(len(RODS) + 1, int)
    f["topology/closed"] = np.array([closed for _, closed, _, _ in RODS]).astype(np.uint8)
    f["rods/name"] = [name for name, _, _, _ in RODS]
    f["rods/section"] = ["circle", "rectangle", "circle", "circle", "none"]
    f["rods/half_axes"] = np.array([[0.01, 0.01], [0.02, 0.01], [0.01, 0.01], [0.01, 0.01], [np.nan, np.nan]])
    f["material/axial_stiffness"] = np.full(len(RODS), 1e5)
    f["material/flexural_stiffness"] = np.array([[10.0, 10.0]] * 4 + [[0.0, 0.0]])

    def state(frame):
        parts = [states(closed, n, frame) for _, closed, n, _ in RODS]
        return [np.concatenate(v) for v in zip(*parts)]

    def field(name, values, place, unit_):
        f["state/" + name] = values
        f["state/" + name].attrs.update({"place": place, "unit": unit_})

    f["reference/position"], f["reference/director"] = state(0)
    x, a = (np.stack(v)[: len(times)] for v in zip(*(state(k) for k in range(max(len(times), 1)))))
    field("position", move(x), "vertices", "m")
    field("director", turn(a), "edges", "1")
    field("velocity", (0 if still else 1) * x + 0.0, "vertices", "m/s")
    field("axial_force", np.arange(x.shape[0] * edges[-1], dtype=float).reshape(-1, edges[-1]), "edges", "N")
    field("moment", x[..., ::-1].copy(), "vertices", "N m")
    f["step"], f["time"] = np.arange(len(times)), np.array(times)
    made = {}
    rng = np.random.default_rng(1)
    for k, (_, closed, n, count) in enumerate(RODS):
        if count:
            made[k] = skin(closed, n, count, rng)
    if skins:
        add_skins(f, made, max(count for _, _, _, count in RODS) if wide is None else wide)
    f.close()
    return made


def add_skins(f, made, wide):
    """Writes /skins: those of rods by number, of points, triangles, edge, weight and local."""
    rows = [made.get(k) for k in range(len(RODS))]
    for name, part in (("point", 0), ("triangle", 1)):
        f[f"skins/{name}_offsets"] = np.cumsum([0] + [len(r[part]) if r else 0 for r in rows])
    rows = [r for r in rows if r]
    f["skins/triangles"] = np.concatenate([r[1] for r in rows]).astype(np.int32)
    fill = [((0, 0), (0, wide - r[2].shape[1])) for r in rows]
    f["skins/edge"] = np.concatenate([np.pad(r[2], p, "edge") for r, p in zip(rows, fill)]).astype(np.int32)
    f["skins/weight"] = np.concatenate([np.pad(r[3], p) for r, p in zip(rows, fill)])
    f["skins/local"] = np.concatenate([np.pad(r[4], (*p, (0, 0)), "edge") for r, p in zip(rows, fill)])


def embedded(x, a, reference, edge, weight, local):
    """The points of a skin, one by one; all arguments are lists."""
    found = []
    for edges, weights, locals_ in zip(edge, weight, local):
        y = [0.0, 0.0, 0.0]
        for k, w, c in zip(edges, weights, locals_):
            x0, x1 = x[k], x[(k + 1) % len(x)]
            e = [q - p for p, q in zip(x0, x1)]
            size = math.sqrt(sum(v * v for v in e))
            t = [v / size for v in e]
            b = [t[1] * a[k][2] - t[2] * a[k][1], t[2] * a[k][0] - t[0] * a[k][2], t[0] * a[k][1] - t[1] * a[k][0]]
            length = math.dist(reference[k], reference[(k + 1) % len(x)])
            for i in range(3):
                y[i] += w * ((x0[i] + x1[i]) / 2 + c[0] / length * e[i] + c[1] * a[k][i] + c[2] * b[i])
        found.append(y)
    return np.array(found)
