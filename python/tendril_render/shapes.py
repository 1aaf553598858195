"""What is drawn: capsules, triangles and planes, and how rods and bodies become these."""
from dataclasses import dataclass, field

import numpy as np


def dot(a, b):
    return np.einsum("...i,...i->...", a, b)


def unit(v):
    """Vectors (..., 3) scaled to length one; zero stays zero."""
    length = np.sqrt(dot(v, v))[..., None]
    return v / np.where(length > 0, length, 1)


def perpendicular(t, wish):
    """Unit vectors across the unit vectors t (n, 3), as close to `wish` (n, 3) as possible."""
    axis = np.zeros_like(t)
    axis[np.arange(len(t)), np.abs(t).argmin(1)] = 1
    good = np.isfinite(wish).all(1) & (np.abs(dot(np.nan_to_num(wish), t)) < 0.99)
    d = np.where(good[:, None], np.nan_to_num(wish), axis)
    return unit(d - dot(d, t)[:, None] * t)


@dataclass
class Capsules:
    """Elliptic cylinders from `a` to `b` with round or flat ends; a sphere has a = b."""

    a: np.ndarray  # (n, 3) [m]
    b: np.ndarray  # (n, 3) [m]
    director: np.ndarray  # (n, 3), along the first half axis
    half_axes: np.ndarray  # (n, 2) [m]; 0 draws a line of fixed width in pixels
    flat: np.ndarray  # (n, 2) bool: the ends that are cut off
    colour: np.ndarray  # (n, 2, 3) at both ends
    group: np.ndarray  # (n,) what belongs together, such as the edges of a rod

    def __len__(self):
        return len(self.a)

    @staticmethod
    def none():
        return Capsules(*(np.zeros(s) for s in ((0, 3), (0, 3), (0, 3), (0, 2))), np.zeros((0, 2), bool),
                        np.zeros((0, 2, 3)), np.zeros(0, int))


@dataclass
class Triangles:
    """Seen from both sides."""

    corner: np.ndarray  # (n, 3, 3) [m]
    normal: np.ndarray  # (n, 3, 3) at the corners
    colour: np.ndarray  # (n, 3, 3) at the corners

    def __len__(self):
        return len(self.corner)

    @staticmethod
    def none():
        return Triangles(*(np.zeros((0, 3, 3)) for _ in range(3)))


@dataclass
class Shapes:
    """All that is in a picture. Planes are pairs (point, unit normal), seen from the side of their normal."""

    capsules: Capsules = field(default_factory=Capsules.none)
    triangles: Triangles = field(default_factory=Triangles.none)
    planes: list = field(default_factory=list)

    def points(self):
        """Points (n, 3) and radii (n,) of balls that hold all shapes but planes [m]."""
        c, t = self.capsules, self.triangles.corner.reshape(-1, 3)
        r = c.half_axes.max(1, initial=0)
        return np.concatenate([c.a, c.b, t]), np.concatenate([r, r, np.zeros(len(t))])


def join(parts):
    """One Shapes of many."""
    def stack(items, kind):
        items = [i for i in items if len(i)] or [kind.none()]
        return kind(*(np.concatenate([vars(i)[name] for i in items]) for name in vars(items[0])))

    return Shapes(stack([p.capsules for p in parts], Capsules), stack([p.triangles for p in parts], Triangles),
                  [plane for p in parts for plane in p.planes])


def smoothed(x, director, colour, closed, pieces=4):
    """Catmull-Rom spline through the vertices x (nv, 3), each edge cut into `pieces`; colours (nv, 3) are linear."""
    def at(v, k):  # the vertices k before or after; beyond an end the line goes on
        if closed:
            return np.roll(v, -k, 0)
        first, last = 2 * v[:1] - v[1:2], 2 * v[-1:] - v[-2:-1]
        return np.concatenate([first, v, last, last])[1 + k : 1 + k + len(v)]

    n = len(director)
    s = (np.arange(pieces) / pieces)[None, :, None]
    before, here, after, beyond = (at(x, k)[:n, None] for k in (-1, 0, 1, 2))
    y = here + 0.5 * s * (after - before + s * (2 * before - 5 * here + 4 * after - beyond
                                                + s * (3 * (here - after) + beyond - before)))
    c = colour[:n, None] * (1 - s) + at(colour, 1)[:n, None] * s
    y, c = y.reshape(-1, 3), c.reshape(-1, 3)
    if not closed:
        y, c = np.concatenate([y, x[-1:]]), np.concatenate([c, colour[-1:]])
    return y, np.repeat(director, pieces, 0), c


def tube(x, director, half_axes, colour, closed=False, group=0):
    """A rod of round section, or of one too thin for more: a capsule per edge, cut off at free ends.

    Edges that are not finite are left out.

    x (nv, 3) [m], director (ne, 3), half_axes (2,) [m], colour (nv, 3); ne = nv if closed, else nv - 1.
    """
    n = len(director)
    following = (np.arange(n) + 1) % len(x)
    flat = np.zeros((n, 2), bool)
    if not closed and n:
        flat[0, 0] = flat[-1, 1] = True
    c = Capsules(x[:n], x[following], director, np.broadcast_to(np.asarray(half_axes, float), (n, 2)), flat,
                 np.stack([colour[:n], colour[following]], 1), np.full(n, group))
    keep = np.isfinite(c.a).all(1) & np.isfinite(c.b).all(1)
    return Shapes(capsules=Capsules(*(v[keep] for v in vars(c).values())))


def cords(x, segments, radius, colour, group=0):
    """A tendon: straight lines with round ends between pairs (m, 2) of the points x (n, 3) [m], colour (3,).

    Lines that are not finite are left out.
    """
    a, b = x[segments[:, 0]], x[segments[:, 1]]
    keep = np.isfinite(a).all(1) & np.isfinite(b).all(1)
    a, b = a[keep], b[keep]
    n = len(a)
    return Shapes(Capsules(a, b, perpendicular(unit(b - a), np.full((n, 3), np.nan)), np.full((n, 2), float(radius)),
                           np.zeros((n, 2), bool), np.broadcast_to(colour, (n, 2, 3)), np.full(n, group)))


RECTANGLE = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]), np.array([[0, 1], [-1, 0], [0, -1], [1, 0]])


def ellipse(sides=24):
    """Corners (n, 2) of a unit circle, as an outline for `bar`; its normals are those at the corners."""
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.stack([np.cos(angle), np.sin(angle)], 1), None


def bar(x, director, half_axes, colour, closed=False, outline=RECTANGLE):
    """A rod of any convex section: rings of corners at the vertices, in the planes that halve the angles of the edges,
    joined by triangles; arguments as for `tube`.

    outline: corners (n, 2) in units of the half axes, counterclockwise about the tangent, and the normals (n, 2) of the
    sides that begin at them; None for a smooth one.
    """
    corners, normals = outline
    a, b = half_axes
    n, nv, count = len(director), len(x), len(corners)
    following = (np.arange(n) + 1) % nv
    t = unit(x[following] - x[:n])
    before, after = np.arange(nv) - 1, np.arange(nv)  # the edges that meet at a vertex
    if not closed:
        before, after = np.clip(before, 0, n - 1), np.clip(after, 0, n - 1)
    tangent = unit(t[before] + t[after])
    d1 = perpendicular(tangent, unit(director[before] + director[after]))
    frame = np.stack([d1, np.cross(tangent, d1)], 1)
    ring = x[:, None] + np.einsum("ck,vki->vci", corners * [a, b], frame)  # (nv, corners, 3)
    if normals is None:
        first = np.einsum("ck,vki->vci", unit(np.pad(corners * [b, a], ((0, 0), (0, 1))))[:, :2], frame)
        last = np.roll(first, -1, 1)
    else:
        first = last = np.einsum("ck,vki->vci", normals, frame)
    parts = []  # corners, normals, colours of triangles

    def quad(places, outward, shade):  # two corners at one ring, the same two at the other
        for k in ((0, 1, 2), (2, 1, 3)):
            parts.append([np.stack([v[j] for j in k], 1) for v in (places, outward, shade)])

    here, there = colour[:n], colour[following]
    for k in range(count):
        m = (k + 1) % count
        quad((ring[:n, k], ring[:n, m], ring[following, k], ring[following, m]),
             (first[:n, k], last[:n, k], first[following, k], last[following, k]), (here, here, there, there))
    if not closed:
        for end, sign in ((0, -1), (-1, 1)):
            for k in range(1, count - 1):
                fan = np.stack([ring[[end], 0], ring[[end], k], ring[[end], k + 1]], 1)
                parts.append([fan, *(np.repeat(v[[end]][:, None], 3, 1) for v in (sign * tangent, colour))])
    corner, normal, shade = (np.concatenate(v) for v in zip(*parts))
    keep = np.isfinite(corner).all((1, 2))
    return Shapes(triangles=Triangles(corner[keep], normal[keep], shade[keep]))


def mesh(vertices, triangles, colour):
    """A surface of flat triangles: vertices (nv, 3) [m], triangles (nt, 3), colour (3,)."""
    corner = np.asarray(vertices, float)[np.asarray(triangles, int)]
    normal = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    return Shapes(triangles=Triangles(corner, np.repeat(normal[:, None], 3, 1),
                                      np.broadcast_to(np.asarray(colour, float), corner.shape)))


ENDLESS = 20  # how many radii of an endless cylinder or tube are drawn, to each side
BOX = np.array([[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]])
BOX_TRIANGLES = [[0, 2, 1], [0, 3, 2], [4, 5, 6], [4, 6, 7], [0, 1, 5], [0, 5, 4],
                 [2, 3, 7], [2, 7, 6], [1, 2, 6], [1, 6, 5], [3, 0, 4], [3, 4, 7]]


def rotation(q):
    """Matrix (3, 3) of the quaternion q = (w, x, y, z)."""
    w, x, y, z = np.asarray(q, float) / np.linalg.norm(q)
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                     [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                     [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]])


def body(shape, parameters, position, quaternion, colour, vertices=None, triangles=None, group=-1):
    """A body or collider at its pose: position (3,) [m], quaternion (w, x, y, z).

    parameters [m]: sphere (radius); box (three half lengths); capsule (radius, half length between the centres of its
    ends, along z); cylinder (radius, half length); tube (bore, outer radius, half length), drawn as rings and lines
    so that one sees what is in it; plane (normal, three numbers; default z), through the position; mesh: vertices and
    triangles; none: nothing.
    """
    p, R, at = np.atleast_1d(np.asarray(parameters, float)), rotation(quaternion), np.asarray(position, float)
    if shape == "none":
        return Shapes()
    if shape == "plane":
        normal = p[:3] if len(p) >= 3 else np.array([0, 0, 1.0])
        return Shapes(planes=[(at, unit(R @ normal))])
    if shape in ("sphere", "capsule"):
        along = R[:, 2] * (p[1] if shape == "capsule" else 0)
        ends = np.stack([at - along, at + along])
        ball = tube(ends, R[:, :1].T, (p[0], p[0]), np.tile(colour, (2, 1)), group=group)
        ball.capsules.flat[:] = False
        return ball
    if shape == "cylinder":
        along = R[:, 2] * (p[1] if np.isfinite(p[1]) else ENDLESS * p[0])
        return tube(np.stack([at - along, at + along]), R[:, :1].T, (p[0], p[0]), np.tile(colour, (2, 1)), group=group)
    if shape == "tube":
        half = p[2] if np.isfinite(p[2]) else ENDLESS * p[0]
        angles = np.linspace(0, 2 * np.pi, 49)
        circle = p[0] * np.stack([np.cos(angles), np.sin(angles), 0 * angles], 1)
        lines = [circle + [0, 0, z] for z in np.linspace(-half, half, 2 + int(half / p[0]))]
        lines += [np.array([c - [0, 0, half], c + [0, 0, half]]) for c in circle[:-1:8]]
        return join([tube(x @ R.T + at, np.tile(R[:, 0], (len(x) - 1, 1)), (0, 0), np.tile(colour, (len(x), 1)),
                          group=group) for x in lines])
    if shape == "box":
        return mesh(BOX * p[:3] @ R.T + at, BOX_TRIANGLES, colour)
    if shape == "mesh":
        return mesh(np.asarray(vertices, float) @ R.T + at, triangles, colour)
    raise ValueError(f"shape {shape}: known are plane, sphere, box, capsule, cylinder, tube, mesh and none")
