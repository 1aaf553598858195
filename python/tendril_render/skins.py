"""Surfaces that rods carry: where they are sharp, and values on them."""
import numpy as np

from .shapes import dot, unit

SHARP = 40  # degrees between triangles, from which on an edge is seen as one


def linked(triangles):
    """The half-edge (3 m,) on the other side of each, itself where there is none. That of the triangle t that begins at
    its corner k has the number 3 t + k."""
    a, b = triangles.ravel(), np.roll(triangles, -1, 1).ravel()
    order = np.lexsort((np.maximum(a, b), np.minimum(a, b)))
    lower, upper = np.minimum(a, b)[order], np.maximum(a, b)[order]
    begins = np.ones(len(a), bool)
    begins[1:] = (lower[1:] != lower[:-1]) | (upper[1:] != upper[:-1])
    place = np.arange(len(a)) - np.flatnonzero(begins)[np.cumsum(begins) - 1]
    second = np.flatnonzero(place % 2 == 1)  # of more than two triangles at an edge, pairs go on
    other = np.arange(len(a))
    other[order[second]], other[order[second - 1]] = order[second - 1], order[second]
    return other


def creased(points, triangles, angle=SHARP):
    """Splits points (n, 3) where triangles (m, 3) meet at more than `angle` [degrees]: the point that each new one is a
    copy of (k,), and the triangles by new points (m, 3). Points without a triangle are gone."""
    triangles = np.asarray(triangles, int)
    corner = points[triangles]
    normal = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    other, half = linked(triangles), np.arange(triangles.size)
    here, there = normal[half // 3], normal[other // 3]
    flat = ~here.any(1) | ~there.any(1)  # of no area
    other = np.where(flat | (dot(here, there) > np.cos(np.radians(angle))), other, half)

    def following(c):
        return c - c % 3 + (c + 1) % 3

    start, after = triangles.ravel(), following(half)
    same_way = start[other] == start  # neighbours that are turned over
    at_start = np.where(other == half, half, np.where(same_way, other, following(other)))
    at_end = np.where(other == half, after, np.where(same_way, following(other), other))
    into = np.empty_like(at_end)
    into[after] = at_end  # by the corner where the half-edge ends
    group = half
    while True:  # corners that are joined have the lowest number of them
        lower = np.minimum(group, np.minimum(group[at_start], group[into]))
        lower = lower[lower]
        if (lower == group).all():
            break
        group = lower
    first, split = np.unique(group, return_inverse=True)
    return start[first], split.reshape(-1, 3)


def along(skin, values):
    """Values (points,) on a skin of those at the vertices of its rod: linear along edges, which count by weight."""
    s = np.clip(0.5 + skin.local[..., 0] / skin.lengths[skin.edge], 0, 1)
    end = (skin.edge + 1) % len(values)
    return (skin.weight * ((1 - s) * values[skin.edge] + s * values[end])).sum(1)
