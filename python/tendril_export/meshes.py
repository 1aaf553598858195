"""Surfaces of what has no skin: tubes around rods, bodies and colliders."""
import numpy as np
from tendril import Skin, TendrilError, edge_frames
from tendril_render.shapes import BOX, BOX_TRIANGLES

SIDES = 12  # of tubes
ROUND = 32  # sides of bodies
THIN = 2e-3  # radius of rods that have none, as a share of their length


def circle(sides):
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.stack([np.cos(angle), np.sin(angle)], 1)


def bands(rings, sides, closed=False):
    """Triangles between rings of points, numbered one ring after the other, anticlockwise about the way from ring to
    ring; seen from outside."""
    i, k = np.meshgrid(np.arange(rings if closed else rings - 1), np.arange(sides), indexing="ij")
    here, there, side = i * sides, (i + 1) % rings * sides, (k + 1) % sides
    a, b, c, d = here + k, here + side, there + k, there + side
    return np.stack([np.stack([a, b, c], -1), np.stack([c, b, d], -1)], 2).reshape(-1, 3)


def fan(centre, first, sides, forwards):
    """Triangles from a ring of points to one in its middle; `forwards`: seen from where the rings go to."""
    k = np.arange(sides)
    here, side = first + k, first + (k + 1) % sides
    return np.stack([np.full(sides, centre), *((here, side) if forwards else (side, here))], 1)


class Tube(Skin):
    """What `Skin` is, made from the section of a rod: a ring of points at the middle of each edge and, of an open rod,
    at both ends, which are closed by caps. Each point moves with one edge."""

    def __init__(self, rod):
        n, axes = rod.edges, half_axes(rod)
        self._rod = rod
        corners = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) if rod.section == "rectangle" else circle(SIDES)
        sides, half = len(corners), self.lengths[[0, -1]] / 2
        edge = np.arange(n) if rod.closed else np.r_[0, np.arange(n), n - 1]
        place = np.zeros(n) if rod.closed else np.r_[-half[0], np.zeros(n), half[1]]
        rings = len(edge)
        local = np.concatenate([np.repeat(place, sides)[:, None], np.tile(corners * axes, (rings, 1))], 1)
        edge, triangles = np.repeat(edge, sides), [bands(rings, sides, rod.closed)]
        if not rod.closed:
            local = np.concatenate([local, [[place[0], 0, 0], [place[-1], 0, 0]]])
            edge, last = np.r_[edge, 0, n - 1], rings * sides
            triangles += [fan(last, 0, sides, False), fan(last + 1, last - sides, sides, True)]
        self.edge, self.local, self.weight = edge[:, None], local[:, None], np.ones((len(edge), 1))
        self.triangles, self.points = np.concatenate(triangles), len(edge)

    def reference(self):
        return self._placed(*as_drawn(self._rod))


def half_axes(rod):
    """Half axes (2,) [m], of rods without a section the radius of a round one as stiff; thin ones of cables."""
    if np.isfinite(rod.half_axes).all():
        return rod.half_axes
    if np.isfinite(rod.radius):
        return np.full(2, rod.radius)
    x = rod.reference("position")
    return np.full(2, THIN * np.linalg.norm(np.diff(x, axis=0), axis=1).sum())


def surface(rod):
    """The skin of a rod, or a tube in its place."""
    return rod.skin or Tube(rod)


def as_drawn(rod):
    """Vertices and directors as drawn; files of format 1 may leave these to their first frame."""
    position = rod.reference("position")
    try:
        return position, rod.reference("director")
    except TendrilError:
        tangent, wish = edge_frames(position, rod.director(0))[2], rod.director(0)
        wish = wish - np.sum(wish * tangent, 1, keepdims=True) * tangent
        return position, wish / np.linalg.norm(wish, axis=1, keepdims=True)


def lathe(profile, closed=False):
    """Points and triangles of a surface around z. profile (n, 2) [m]: distances from z and heights, upwards where one
    looks at it from outside; with `closed` it ends where it begins, otherwise on z at both ends."""
    profile = np.asarray(profile, float)
    inner = profile if closed else profile[1:-1]
    flat = inner[:, None, :1] * circle(ROUND)
    points = np.concatenate([flat, np.broadcast_to(inner[:, None, 1:], (*flat.shape[:2], 1))], 2).reshape(-1, 3)
    triangles = [bands(len(inner), ROUND, closed)]
    if not closed:
        last = len(points)
        points = np.concatenate([points, [[0, 0, profile[0, 1]], [0, 0, profile[-1, 1]]]])
        triangles += [fan(last, 0, ROUND, False), fan(last + 1, last - ROUND, ROUND, True)]
    return points, np.concatenate(triangles)


def thing(body):
    """Points (n, 3) and triangles (m, 3) of a body or collider in its own axes; None if it has no end or no shape."""
    p, shape = body.parameters, body.shape
    if shape == "mesh":
        return body.vertices, body.triangles.astype(int)
    if shape in ("none", "plane") or not np.isfinite(p).all():
        return None
    if shape == "box":
        return BOX * p[:3], np.array(BOX_TRIANGLES)
    if shape in ("sphere", "capsule"):
        half = p[1] if shape == "capsule" else 0
        angle = np.linspace(-np.pi / 2, np.pi / 2, ROUND // 2 + 1)
        angle = np.sort(np.append(angle, 0)) if half else angle  # both ends of the straight part
        shift = np.r_[np.full(len(angle) // 2, -half), np.full(len(angle) - len(angle) // 2, half)]
        return lathe(np.stack([p[0] * np.cos(angle), p[0] * np.sin(angle) + shift], 1))
    if shape == "cylinder":
        return lathe([[0, -p[1]], [p[0], -p[1]], [p[0], p[1]], [0, p[1]]])
    if shape == "tube":  # bore, outer radius, half length
        return lathe([[p[0], p[2]], [p[0], -p[2]], [p[1], -p[2]], [p[1], p[2]]], closed=True)
    return None
