"""What each ray sees: all pairs of a shape and a pixel of its box on the screen, the nearest hit of each sample.

Rays are those of a `View`: through the eye, or parallel. In the view's frame x points right, y up and z away, and the
ray through (X, Y) is z (X, Y, 1) or (X, Y, z): a depth z says where on it a point is.
"""
from dataclasses import dataclass

import numpy as np

from .shapes import dot, perpendicular, unit

NOTHING = np.uint64(0x7F800000FFFFFFFF)  # infinite depth, no shape
PAIRS = 1 << 18  # samples looked at together: what the second cache and the page tables like


@dataclass
class View:
    """Pixels and their rays."""

    origin: np.ndarray  # the eye, or for parallel rays a point before all that is seen [m]
    axes: np.ndarray  # (3, 3), rows: right, up, away
    scale: float  # pixels for a unit of X
    width: int
    height: int
    perspective: bool

    def local(self, points):
        """Points (..., 3) in the view's frame."""
        return np.einsum("...j,ij->...i", points - self.origin, self.axes)

    def turned(self, vectors):
        return np.einsum("...j,ij->...i", vectors, self.axes)

    def rays(self, px, py):
        """X, Y of the places px, py on the screen."""
        return (px - self.width / 2) / self.scale, (self.height / 2 - py) / self.scale

    def points(self, X, Y, z):
        """The points (n, 3) at the depths z (n,) of the rays X, Y."""
        s = z if self.perspective else 1
        return self.origin + np.stack([X * s, Y * s, z], -1) @ self.axes

    def screen(self, local):
        """Places (n, 2) on the screen of points in the view's frame."""
        s = self.scale / (np.maximum(local[:, 2], 1e-9) if self.perspective else 1)
        return np.stack([self.width / 2 + local[:, 0] * s, self.height / 2 - local[:, 1] * s], 1)

    def pixel(self, local):
        """Size of a pixel at points in the view's frame [m]."""
        return (np.maximum(local[..., 2], 1e-9) if self.perspective else np.ones(local.shape[:-1])) / self.scale


def sample_places(n):
    """n x n places in a pixel, (n^2, 2): a grid sheared so that no two share a row or column."""
    i, j = np.divmod(np.arange(n * n), n)
    return np.stack([(j + (i + 0.5) / n) / n, (i + (j + 0.5) / n) / n], 1)


def noise(a, b):
    """Numbers in [0, 1) from pairs of whole numbers, always the same ones."""
    h = (a.astype(np.uint32) * np.uint32(2654435761)) ^ (b.astype(np.uint32) * np.uint32(2246822519))
    h = (h ^ (h >> np.uint32(15))) * np.uint32(2654435761)
    return ((h ^ (h >> np.uint32(13))) >> np.uint32(8)) / float(1 << 24)


class Tubes:
    """Capsules in the frame of a view: `m` (n, 3, 3) maps each to a unit cylinder from z = 0 to `top`."""

    def __init__(self, view, capsules, line_width):
        c = capsules
        self.a, self.b, self.flat, self.group = view.local(c.a), view.local(c.b), c.flat, c.group
        edge = self.b - self.a
        length = np.sqrt(dot(edge, edge))
        t = np.where(length[:, None] > 0, unit(edge), [1.0, 0, 0])
        d1 = perpendicular(t, view.turned(c.director))
        d2 = np.cross(t, d1)
        # Hair is drawn a pixel wide, and instead lets through what is behind it.
        largest = c.half_axes.max(1, initial=0)
        pixel = view.pixel((self.a + self.b) / 2)
        wanted = np.where(largest > 0, 0.5, line_width / 2) * pixel
        self.opacity = np.where(largest > 0, np.minimum(largest / wanted, 1), 1)
        grow = np.maximum(wanted / np.where(largest > 0, largest, 1), 1)
        axes = np.where(largest[:, None] > 0, c.half_axes * grow[:, None], wanted[:, None])
        axes = np.maximum(axes, 0.25 * pixel[:, None])
        self.radius = axes.max(1, initial=0)
        cap = axes.min(1, initial=np.inf)
        self.m = np.stack([d1 / axes[:, :1], d2 / axes[:, 1:], t / cap[:, None]], 1)
        self.top = length / cap
        self.shift = np.einsum("nij,nj->ni", self.m, self.a)
        self.middle = (self.a[:, 2] + self.b[:, 2]) / 2

    def boxes(self, view):
        """Lower and upper corners (n, 2) on the screen."""
        def extent(p, k):  # of a ball in X (k = 0) or Y: tangents to a circle in the plane of x or y and z
            r, x, z = self.radius, p[:, k], p[:, 2]
            if not view.perspective:
                return x - r, x + r
            z2 = np.maximum(z * z - r * r, 1e-18)
            reach, front = r * np.sqrt(x * x + z2), z > r
            return np.where(front, (x * z - reach) / z2, -1e9), np.where(front, (x * z + reach) / z2, 1e9)

        (xa, Xa), (xb, Xb), (ya, Ya), (yb, Yb) = (extent(p, k) for k in (0, 1) for p in (self.a, self.b))
        half = np.array([view.width, view.height]) / 2
        return (half + view.scale * np.stack([np.minimum(xa, xb), -np.maximum(Ya, Yb)], 1),
                half + view.scale * np.stack([np.maximum(Xa, Xb), -np.minimum(ya, yb)], 1))

    def near(self, view):
        """A test that drops pixels far from the capsules on the screen."""
        a, b = view.screen(self.a), view.screen(self.b)
        d = b - a
        square = np.maximum(dot(d, d), 1e-12)
        pixel = np.minimum(view.pixel(self.a), view.pixel(self.b))
        reach = (1.15 * self.radius / pixel + 1) ** 2

        def test(i, px, py):
            x, y = px + 0.5 - a[i, 0], py + 0.5 - a[i, 1]
            dx, dy = d[i, 0], d[i, 1]
            s = np.clip((x * dx + y * dy) / square[i], 0, 1)
            return (x - s * dx) ** 2 + (y - s * dy) ** 2 < reach[i]

        return test

    def unit_ray(self, view, i, X, Y):
        """Rays in the frames of the capsules i: their points q at the depth `middle`, and directions e (3 each)."""
        m, zm, shift = self.m[i], self.middle[i], self.shift[i]
        if view.perspective:
            e = [m[:, k, 0] * X + m[:, k, 1] * Y + m[:, k, 2] for k in range(3)]
            return [zm * e[k] - shift[:, k] for k in range(3)], e
        return [m[:, k, 0] * X + m[:, k, 1] * Y + m[:, k, 2] * zm - shift[:, k] for k in range(3)], list(m[:, :, 2].T)

    def hits(self, view, i, X, Y):
        """Depths at which rays enter the capsules i; infinite where they miss."""
        depth = np.full(len(i), np.inf)
        (qx, qy, qz), (ex, ey, ez) = self.unit_ray(view, i, X, Y)
        a, b, c = ex * ex + ey * ey, qx * ex + qy * ey, qx * qx + qy * qy - 1
        d = b * b - a * c
        along = a < 1e-12  # rays along the axis come in by an end
        k = np.flatnonzero(np.where(along, c <= 0, d >= 0))  # others miss the endless cylinder, and with it the ends
        i, a, b, c, d, qz, ez, along = i[k], a[k], b[k], c[k], d[k], qz[k], ez[k], along[k]
        t = -(b + np.sqrt(np.maximum(d, 0))) / np.where(along, 1, a)
        z, top = np.where(along, np.where(ez > 0, -np.inf, np.inf), qz + t * ez), self.top[i]
        end = np.flatnonzero((z < 0) | (z > top))
        last = z[end] > top[end]
        e, i2, a, b, c = ez[end], i[end], a[end], b[end], c[end]
        h = qz[end] - np.where(last, top[end], 0)
        flat = self.flat[i2, last.astype(int)]
        tf = -h / np.where(e == 0, 1e-30, e)
        hit_flat = flat & (a * tf * tf + 2 * b * tf + c <= 0)
        A, B, C = a + e * e, b + h * e, c + h * h
        D = B * B - A * C
        tr = -(B + np.sqrt(np.maximum(D, 0))) / np.maximum(A, 1e-30)
        t[end] = np.where(hit_flat, tf, np.where(~flat & (D >= 0), tr, np.inf))
        depth[k] = t + self.middle[i]
        return depth

    def surface(self, view, i, X, Y, z):
        """Unit normals (n, 3) in the view's frame and places along the edges, 0 to 1, of the hits at the depths z."""
        q, e = self.unit_ray(view, i, X, Y)
        u = np.stack([q[k] + (z - self.middle[i]) * e[k] for k in range(3)], 1)
        top = self.top[i]
        beyond = u[:, 2] - np.clip(u[:, 2], 0, top)
        last = 2 * u[:, 2] > top
        near_end = np.where(last, u[:, 2] - top, -u[:, 2])
        cut = self.flat[i, last.astype(int)] & (near_end > -1e-3) & (u[:, 0] ** 2 + u[:, 1] ** 2 < 0.999)
        s = np.clip(u[:, 2] / np.where(top > 0, top, 1), 0, 1)
        side = np.stack([u[:, 0], u[:, 1], beyond], 1)
        side[cut] = 0
        side[cut, 2] = np.where(last[cut], 1, -1)
        return unit(np.einsum("nji,nj->ni", self.m[i], side)), s


class Facets:
    """Triangles in the frame of a view: three numbers linear in X, Y per triangle are in proportion to the weights."""

    def __init__(self, view, triangles):
        v = self.corner = view.local(triangles.corner)
        p = v if view.perspective else np.concatenate([v[:, :, :2], np.ones_like(v[:, :, :1])], 2)
        self.weight = np.stack([np.cross(p[:, 1], p[:, 2]), np.cross(p[:, 2], p[:, 0]), np.cross(p[:, 0], p[:, 1])], 1)

    def strips(self, view):
        """The triangle, lower and upper corners (n, 2) of boxes a pixel high that hold it: of slender ones a box has
        mostly pixels that they are not at."""
        p = view.screen(self.corner.reshape(-1, 3)).reshape(-1, 3, 2)
        behind = (self.corner[:, :, 2] <= 1e-6).any(1) & view.perspective  # of the eye; these may be anywhere
        first = np.where(behind, 0, np.clip(np.floor(p[:, :, 1].min(1)), 0, view.height)).astype(int)
        end = np.where(behind, view.height, np.clip(np.ceil(p[:, :, 1].max(1)), 0, view.height)).astype(int)
        rows = np.maximum(end - first, 0)
        i = np.repeat(np.arange(len(rows)), rows)
        y = np.arange(len(i)) - np.repeat(np.cumsum(rows) - rows - first, rows)
        left, right = np.full(len(i), np.inf), np.full(len(i), -np.inf)
        for k in range(3):
            a, b = p[i, k], p[i, (k + 1) % 3]
            high = b[:, 1] - a[:, 1]
            for row in (y, y + 1):  # where the side enters and leaves the row, or its ends within
                s = np.clip((row - a[:, 1]) / np.where(high == 0, 1, high), 0, 1)  # ends of level ones are others's
                x = a[:, 0] + s * (b[:, 0] - a[:, 0])
                there = (np.minimum(a[:, 1], b[:, 1]) <= y + 1) & (np.maximum(a[:, 1], b[:, 1]) >= y)
                left = np.minimum(left, np.where(there, x, np.inf))
                right = np.maximum(right, np.where(there, x, -np.inf))
        left, right = left - 1e-3, right + 1e-3  # rounding
        left[behind[i]], right[behind[i]] = 0, view.width
        return i, np.stack([left, y], 1), np.stack([right, y + 1], 1)

    def weights(self, i, X, Y):
        w = self.weight[i]
        w = w[:, :, 0] * X[:, None] + w[:, :, 1] * Y[:, None] + w[:, :, 2]
        total = w.sum(1)
        return w / np.where(total == 0, np.inf, total)[:, None]

    def hits(self, view, i, X, Y):
        w = self.weights(i, X, Y)
        z = dot(w, self.corner[i, :, 2])
        return np.where((w >= 0).all(1) & (w.any(1)) & (z > 0), z, np.inf)


def pairs(lower, upper, width, height, near, most):
    """Pieces (shape, px, py) of all pixels that lie in the boxes of shapes."""
    lower = np.clip(np.floor(lower), 0, [width, height]).astype(int)
    upper = np.clip(np.ceil(upper), 0, [width, height]).astype(int)
    wide = upper[:, 0] - lower[:, 0]
    last = np.cumsum(np.maximum(wide, 0) * np.maximum(upper[:, 1] - lower[:, 1], 0))
    for start in range(0, last[-1] if len(last) else 0, most):
        k = np.arange(start, min(start + most, last[-1]))
        i = np.searchsorted(last, k, "right")
        k = k - np.where(i > 0, last[i - 1], 0)
        py, px = np.divmod(k, wide[i])
        px, py = px + lower[i, 0], py + lower[i, 1]
        if near:
            keep = near(i, px, py)
            i, px, py = i[keep], px[keep], py[keep]
        yield i, px, py


def keep_nearest(buffer, key, depth, shape):
    """Writes the hits that are nearer than what the buffer has at their keys."""
    seen = (depth.astype(np.float32).view(np.uint32).astype(np.uint64) << np.uint64(32)) | shape.astype(np.uint64)
    while len(key):
        nearer = seen < buffer[key]
        key, seen = key[nearer], seen[nearer]
        buffer[key] = seen  # of several at one key any may stay; the next round looks again


def cast(view, shapes, samples=1, line_width=1.2):
    """Depth (pixels, samples^2), infinite where nothing is, and the shape seen: capsules first, then triangles.

    Returns depth, shape, and the Tubes and Facets of the view.
    """
    tubes, facets = Tubes(view, shapes.capsules, line_width), Facets(view, shapes.triangles)
    places, count = sample_places(samples), samples * samples
    buffer = np.full(view.width * view.height * count, NOTHING)
    for kind, first in ((tubes, 0), (facets, len(shapes.capsules))):
        near = kind.near(view) if kind is tubes else None
        owner, *boxes = (None, *kind.boxes(view)) if kind is tubes else kind.strips(view)
        for i, px, py in pairs(*boxes, view.width, view.height, near, PAIRS):
            i = i if owner is None else owner[i]
            pixel = py * view.width + px
            start = noise(tubes.group[i], pixel) if kind is tubes else None
            for s, (sx, sy) in enumerate(places):
                z = kind.hits(view, i, *view.rays(px + sx, py + sy))
                hit = np.isfinite(z) & (z > 0)
                if kind is tubes:  # of the samples of a pixel, hair takes a share
                    hit &= (start + (7 * s % count) / count) % 1 < tubes.opacity[i]
                keep_nearest(buffer, pixel[hit] * count + s, z[hit], i[hit] + first)
    depth = (buffer >> np.uint64(32)).astype(np.uint32).view(np.float32).reshape(-1, count)
    shape = (buffer & np.uint64(0xFFFFFFFF)).astype(np.uint32).view(np.int32).reshape(-1, count)
    return depth, shape, tubes, facets
