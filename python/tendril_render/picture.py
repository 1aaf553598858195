"""Camera, materials and shading: from shapes to pixels."""
from dataclasses import dataclass

import numpy as np

from .cast import View, cast, sample_places
from .light import box_corners, frame, sky, sun
from .shapes import dot, unit


@dataclass(frozen=True)
class Theme:
    """Colours as sRGB, 0 to 1."""

    paper: tuple  # behind all
    floor: tuple  # where it is lit
    ink: tuple  # of words
    plain: tuple  # of rods without a field
    body: tuple
    collider: tuple
    tendon: tuple


LIGHT = Theme((1, 1, 1), (1, 1, 1), (0.2, 0.22, 0.26), (0.0, 0.45, 0.70), (0.87, 0.52, 0.2), (0.75, 0.76, 0.78),
              (0.58, 0.06, 0.12))
DARK = Theme((0.051, 0.067, 0.09), (0.16, 0.18, 0.22), (0.86, 0.88, 0.9), (0.34, 0.71, 0.91), (0.9, 0.62, 0.0),
             (0.5, 0.52, 0.55), (0.86, 0.24, 0.28))


def linear(srgb):
    return np.asarray(srgb, float) ** 2.2


@dataclass
class Stage:
    """What is the same in all pictures of a run: the camera, and the box that all of it stays in."""

    view: View
    up: np.ndarray
    lower: np.ndarray  # of the box [m]
    upper: np.ndarray
    floor: float = None  # height of the floor along `up` [m]; none without one
    samples: int = 3  # per pixel and direction
    theme: Theme = LIGHT


def camera(points, radii, up, azimuth, elevation, width, height, margin=(0.05, 0.06, 0.05, 0.14)):
    """A perspective view that holds balls, with margins (left, top, right, bottom) as shares of the picture.

    azimuth [degrees] is counted about `up` from the z axis (from the y axis where up is z, from x to the right).
    """
    side = np.array([1.0, 0, 0]) if abs(up[0]) < 0.9 else np.array([0, 1.0, 0])
    side = unit(side - (side @ up) * up)
    front = np.cross(side, up)
    az, el = np.radians([azimuth, elevation])
    towards = np.cos(el) * (np.cos(az) * front + np.sin(az) * side) + np.sin(el) * up
    if elevation > 89.9:
        axes = np.stack([np.cos(az) * side - np.sin(az) * front, -(np.cos(az) * front + np.sin(az) * side), -up])
    else:
        axes = frame(-towards, up)
    local = points @ axes.T
    scale = 2.2 * max(width, height)
    left, top, right, bottom = margin
    half = np.array([width * (1 - left - right), height * (1 - top - bottom)]) / 2 / scale  # tangents
    centre, distance = (local.min(0) + local.max(0))[:2] / 2, 0
    size = max(np.ptp(local, axis=0).max() + 2 * radii.max(initial=0), 1e-9)
    for _ in range(20):  # distance and centre depend on each other
        reach = (np.abs(local[:, :2] - centre) + radii[:, None]) / half - local[:, 2:]
        distance = reach.max() + 1e-3 * size
        z = (local[:, 2] + distance)[:, None]
        q = (local[:, :2] - centre) / z
        lo, hi = (q - radii[:, None] / z).min(0), (q + radii[:, None] / z).max(0)
        centre = centre + (lo + hi) / 2 * (distance + local[:, 2].mean()) * 0.8
    shift = np.array([(left - right) * width, (bottom - top) * height]) / 2 / scale  # the middle of what margins leave
    centre = centre - shift * (distance + local[:, 2].mean())
    return View(np.append(centre, -distance) @ axes, axes, scale, width, height, True)


class Light:
    """Sun and sky over the shapes of one picture."""

    def __init__(self, stage, shapes):
        right, upward, away = stage.view.axes
        level = unit(away - (away @ stage.up) * stage.up + 1e-3 * upward)
        self.towards, self.up = unit(stage.up - 0.5 * level - 0.3 * right), stage.up
        box = stage.up, stage.lower, stage.upper
        self.sun, self.sky = sun(shapes, self.towards, *box), sky(shapes, *box)

    def on(self, points, normals):
        """Light (n,) of the sky, 1 on open ground, and of the sun, 1 on what faces it. The ground gives some back."""
        back = 0.15 * (1 - normals @ self.up)
        return 2 * self.sky.on(points, normals) + back, self.sun.on(points, normals)


def background(stage, shapes, light):
    """Colour (pixels, 3) behind rods and bodies, and its depth (pixels,): planes, the floor, paper."""
    view, theme = stage.view, stage.theme
    n = view.width * view.height
    depth, colour = np.full(n, np.inf), np.tile(linear(theme.paper), (n, 1))
    planes = list(shapes.planes)
    if stage.floor is not None:
        planes.append((stage.floor * stage.up, stage.up))
    py, px = np.divmod(np.arange(n), view.width)
    X, Y = view.rays(px + 0.5, py + 0.5)
    middle, size = (stage.lower + stage.upper) / 2, np.linalg.norm(stage.upper - stage.lower)
    nearest = np.full(n, -1)
    for index, (point, normal) in enumerate(planes):
        d = view.turned(normal)
        slope = X * d[0] + Y * d[1] + d[2]
        with np.errstate(divide="ignore"):
            z = np.where(slope < 0, ((point - view.origin) @ normal) / slope, np.inf)
        nearer = (z > 0) & (z < depth)
        depth[nearer], nearest[nearer] = z[nearer], index
    for index, (_, normal) in enumerate(planes):
        k = np.flatnonzero(nearest == index)
        p = view.points(X[k], Y[k], depth[k])
        far = p - middle
        far = np.sqrt(np.maximum(dot(far, far) - (far @ normal) ** 2, 0)) / size
        k, p, far = k[far < 1.6], p[far < 1.6], far[far < 1.6]
        fade = np.clip((1.6 - far) / 1.2, 0, 1)
        fade = (fade * fade * (3 - 2 * fade))[:, None]
        from_sky, from_sun = light.on(p, np.broadcast_to(normal, p.shape))
        full = max(normal @ light.towards, 0.2)
        bright = np.clip(0.45 * from_sky + 0.55 * from_sun / full, 0, 1)[:, None]
        colour[k] += fade * (linear(theme.floor) * bright - colour[k])
    return colour, depth


def surfaces(stage, shapes, tubes, facets, shape, X, Y, z):
    """Points, normals and colours (n, 3) of what is seen."""
    view, c = stage.view, shapes.capsules
    normal, colour = np.empty((len(shape), 3)), np.empty((len(shape), 3))
    k = np.flatnonzero(shape < len(c))
    i = shape[k]
    normal[k], s = tubes.surface(view, i, X[k], Y[k], z[k])
    colour[k] = c.colour[i, 0] + s[:, None] * (c.colour[i, 1] - c.colour[i, 0])
    normal[k] = normal[k] @ view.axes
    k = np.flatnonzero(shape >= len(c))
    i = shape[k] - len(c)
    w = facets.weights(i, X[k], Y[k])
    colour[k] = np.einsum("nk,nki->ni", w, shapes.triangles.colour[i])
    normal[k] = unit(np.einsum("nk,nki->ni", w, shapes.triangles.normal[i]))
    points = view.points(X, Y, z)
    away = dot(normal, unit(points - view.origin)) > 0
    normal[away & (shape >= len(c))] *= -1
    return points, normal, colour


def shade(stage, light, points, normal, colour):
    """Colours (n, 3) of lit surfaces: soft light, sun, and a highlight."""
    from_sky, from_sun = light.on(points, normal)
    to_eye = unit(stage.view.origin - points)
    half = unit(to_eye + light.towards)
    shine = np.clip(dot(normal, half), 0, 1) ** 50 * np.minimum(from_sun, 1)
    return colour * (0.68 * from_sky + 0.74 * from_sun)[:, None] + 0.18 * shine[:, None]


def runs(shape):
    """Samples (n, count) of pixels that see the same shape: the pixel and shape of each run, and the run of each."""
    order = np.argsort(shape, axis=1, kind="stable")
    ordered = np.take_along_axis(shape, order, 1)
    first = np.ones(shape.shape, bool)
    first[:, 1:] = ordered[:, 1:] != ordered[:, :-1]
    run = np.empty(shape.shape, int)
    np.put_along_axis(run, order, (np.cumsum(first) - 1).reshape(shape.shape), 1)
    return np.nonzero(first)[0], ordered[first], run


def draw(stage, shapes):
    """The picture (height, width, 3) as bytes. Samples of a pixel that see the same shape are shaded together."""
    view, light = stage.view, Light(stage, shapes)
    behind, far = background(stage, shapes, light)
    depth, shape, tubes, facets = cast(view, shapes, stage.samples)
    shape = np.where(depth < far[:, None], shape, -1)
    seen = np.flatnonzero((shape >= 0).any(1))
    depth, shape = depth[seen], shape[seen]
    pixel, what, run = runs(shape)
    share = np.bincount(run.ravel())

    def mean(v):
        return np.bincount(run.ravel(), np.broadcast_to(v, run.shape).ravel()) / share

    places = sample_places(stage.samples)
    py, px = np.divmod(seen[pixel], view.width)
    X, Y = view.rays(px + mean(places[:, 0]), py + mean(places[:, 1]))
    z = mean(np.where(shape >= 0, depth, 0).astype(float))
    colour = behind[seen[pixel]]
    hit = np.flatnonzero(what >= 0)
    for start in range(0, len(hit), 1 << 17):
        k = hit[start : start + (1 << 17)]
        surface = surfaces(stage, shapes, tubes, facets, what[k], X[k], Y[k], z[k])
        colour[k] = np.clip(shade(stage, light, *surface), 0, 1)
    weight = (share / shape.shape[1])[:, None] if len(seen) else 0
    behind[seen] = 0
    for c in range(3):
        behind[seen, c] = np.bincount(pixel, (colour * weight)[:, c], len(seen)) if len(seen) else 0
    srgb = np.clip(behind, 0, 1) ** (1 / 2.2)
    return (255 * srgb + 0.5).astype(np.uint8).reshape(view.height, view.width, 3)
