"""Light and shadow: parallel light from many directions, a depth map for each."""
import numpy as np

from .cast import View, cast
from .shapes import unit

GOLDEN = np.pi * (3 - np.sqrt(5))


def frame(away, up):
    """Rows right, up and away of a view in the direction `away`."""
    away = unit(np.asarray(away, float))
    if abs(away @ up) > 0.999:
        up = np.roll(up, 1)
    right = unit(np.cross(away, up))
    return np.stack([right, np.cross(right, away), away])


def disc(n):
    """n places (n, 2) spread evenly over the unit disc."""
    k = np.arange(n)
    return np.sqrt((k + 0.5) / n)[:, None] * np.stack([np.cos(GOLDEN * k), np.sin(GOLDEN * k)], 1)


def box_corners(lower, upper):
    return np.stack(np.meshgrid(*zip(lower, upper), indexing="ij"), -1).reshape(-1, 3)


class DepthMap:
    """What parallel light from the direction `towards` sees of the shapes in the box from `lower` to `upper`."""

    def __init__(self, shapes, towards, up, lower, upper, size):
        axes = frame(-towards, up)
        corners = box_corners(lower, upper) @ axes.T
        first, last = corners.min(0), corners.max(0)
        scale = size / max((last - first)[:2].max(), 1e-9)
        width, height = (int(np.ceil(v * scale)) + 4 for v in (last - first)[:2])
        middle = np.append((first + last)[:2] / 2, first[2] - 0.01 * (last - first).max() - 1e-6)
        view = View(middle @ axes, axes, scale, width, height, False)
        self.texel, self.margin = 1 / scale, 10  # empty texels around, so that points there need no clipping
        self.depth = np.pad(cast(view, shapes)[0].reshape(height, width), self.margin, constant_values=np.inf)
        self.to_map = axes.T * [scale, -scale, 1]
        self.shift = [width / 2 + self.margin, height / 2 + self.margin, 0] - view.origin @ self.to_map

    def open(self, points, blur, taps):
        """Share of the light (n,) that reaches points, averaged over a disc of `blur` texels."""
        lit = np.ones(len(points), np.float32)
        x, y, z = (points @ self.to_map + self.shift).astype(np.float32).T
        (h, w), b = self.depth.shape, blur + 1
        k = np.flatnonzero((x > b) & (x < w - b) & (y > b) & (y < h - b))
        x, y, z = x[k], y[k], z[k] - np.float32(self.texel)
        part, depth = np.zeros(len(k), np.float32), self.depth.ravel()
        for dx, dy in (blur * disc(taps)).astype(np.float32):
            part += depth[(y + dy).astype(np.int32) * np.int32(w) + (x + dx).astype(np.int32)] >= z
        lit[k] = part / np.float32(taps)
        return lit


class Lamp:
    """Light from many directions `towards` (n, 3) at once, so that shadows are soft far from what casts them."""

    def __init__(self, shapes, towards, up, lower, upper, size, blur, taps):
        self.towards, self.blur, self.taps = towards, blur, taps
        self.maps = [DepthMap(shapes, d, up, lower, upper, size) for d in towards]

    def on(self, points, normals):
        """Light (n,) on surfaces; a lamp of one direction gives 1 to those that face it."""
        total = np.zeros(len(points))
        lifted = points + normals * ((0.6 * self.blur + 1) * max(m.texel for m in self.maps))
        for towards, m in zip(self.towards, self.maps):
            facing = normals @ towards
            k = np.flatnonzero(facing > 0)
            total[k] += facing[k] * m.open(lifted[k], self.blur, self.taps)
        return total / len(self.maps)


def sun(shapes, towards, up, lower, upper, angle=0.03, directions=16, size=1536):
    """A disc of half-width `angle` [rad]."""
    right, upward, _ = frame(towards, up)
    d = angle * disc(directions)
    return Lamp(shapes, unit(towards + d[:, :1] * right + d[:, 1:] * upward), up, lower, upper, size, 1.5, 4)


def sky(shapes, up, lower, upper, directions=20, size=256):
    """The half sphere, of even brightness."""
    height = ((np.arange(directions) + 0.5) / directions)[:, None]
    around = GOLDEN * np.arange(directions)[:, None]
    right, _, ahead = frame(np.roll(up, 1), up)
    towards = np.sqrt(1 - height**2) * (np.cos(around) * right + np.sin(around) * ahead) + height * up
    return Lamp(shapes, towards, up, lower, upper, size, 6, 12)
