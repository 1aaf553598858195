"""From a trajectory to shapes: which frames, which values, which colours."""
import numpy as np

from .shapes import bar, body, join, smoothed, tube

try:
    from tendril import Trajectory
except ImportError:
    from .stand_in import Trajectory

OF_OUR_OWN = {"time": "s", "rod": ""}  # values that every trajectory has


class Mistake(Exception):
    """What the user should change, in one line."""


def open_trajectory(path):
    """The trajectory in a folder or file; a Mistake if it cannot be read or has no frame."""
    try:
        t = Trajectory(path)
    except Exception as e:  # h5py tells of broken files by errors of many kinds
        raise Mistake(f"{path}: not a trajectory that can be read ({str(e).splitlines()[0] if str(e) else type(e).__name__})")
    if not len(t.time) or not len(t.rods):
        raise Mistake(f"{path}: no frame yet")
    return t


def frame_at(t, time):
    """The number of the frame nearest to a time [s] of the run."""
    first, last = t.time[0], t.time[-1]
    slack = 0.51 * np.diff(t.time).max(initial=0) + 1e-9 * abs(last)
    if not first - slack <= time <= last + slack:
        raise Mistake(f"time {time:g} s is outside the run, {first:g} to {last:g} s")
    return int(np.abs(t.time - time).argmin())


def fields(t):
    """Names of what may give colours."""
    return list(OF_OUR_OWN) + [n for n in t.field_names if str(t.field(n).place)[:4] in ("vert", "edge")]


def value(t, name, index, frame):
    """Values (nv,) of a field at the vertices of a rod; of vectors the length, of edges the mean of both sides."""
    rod = t.rods[index]
    if name in OF_OUR_OWN:
        return np.full(len(rod.position(frame)), t.time[frame] if name == "time" else index)
    v = np.asarray(rod.field(name, frame), float)
    if v.ndim > 1:
        v = np.sqrt((v * v).sum(-1))
    if str(t.field(name).place).startswith("edge"):
        v = (v + np.roll(v, 1)) / 2 if rod.closed else np.concatenate([v[:1], (v[1:] + v[:-1]) / 2, v[-1:]])
    return v


class Source:
    """Shapes of frames of a trajectory, coloured by a field."""

    def __init__(self, t, field, frames, theme, colours, radius=None, smooth=False):
        if field is not None and field not in fields(t):
            raise Mistake(f"field {field}: this trajectory has {', '.join(fields(t))}")
        self.t, self.field, self.theme, self.radius, self.smooth = t, field, theme, radius, smooth
        self.left_out = 0  # edges that are not finite
        self.colours, self.range = None, None
        if field is not None:
            self.range = self.values_range(frames)
            self.colours = colours(*self.range)

    def values_range(self, frames):
        """Ends of the scale: all values but half a per cent at each end; symmetric for those of both signs."""
        if self.field == "time":
            v = self.t.time[list(frames)]
        else:
            v = np.concatenate([value(self.t, self.field, k, f) for f in frames for k in range(len(self.t.rods))])
        v = v[np.isfinite(v)]
        if not len(v):
            raise Mistake(f"field {self.field}: no finite value in these frames")
        if self.field in OF_OUR_OWN:
            return v.min(), v.max()
        lower, upper = np.percentile(v, [0.5, 99.5])
        if lower < -0.02 * upper and upper > -0.02 * lower:
            return -max(upper, -lower), max(upper, -lower)
        return (min(lower, 0), upper) if lower < 0.3 * upper else (lower, upper)

    def half_axes(self, rod):
        """Half axes (2,) [m]; 0 for a line of fixed width."""
        if self.radius is not None:
            return np.full(2, self.radius)
        if rod.section == "none":
            return np.zeros(2)
        axes = np.asarray(rod.half_axes, float)
        return axes if np.isfinite(axes).all() else np.full(2, np.nan_to_num(rod.radius))

    def rod(self, index, frame, group, pixel):
        """Shapes of one rod; a strip thinner than a pixel is drawn as an ellipse."""
        rod = self.t.rods[index]
        x, d, axes = rod.position(frame), rod.director(frame), self.half_axes(rod)
        if self.colours is None:
            colour = np.tile(np.asarray(self.theme.plain) ** 2.2, (len(x), 1))
        else:
            colour = self.colours.of(np.nan_to_num(value(self.t, self.field, index, frame)))
        bad = ~np.isfinite(x).all(1)
        self.left_out += int((bad | (np.roll(bad, -1)))[: len(d)].sum())
        if self.smooth:
            x, d, colour = smoothed(x, d, colour, rod.closed)
        if rod.section == "rectangle" and self.radius is None and axes.max() > pixel:
            return bar(x, d, axes, colour, rod.closed)
        return tube(x, d, axes, colour, rod.closed, group)

    def shapes(self, frames, pixel=0):
        """All that is seen in some frames at once; `pixel`: the size of one [m]."""
        n = len(self.t.rods)
        parts = [self.rod(k, f, j * n + k, pixel) for j, f in enumerate(frames) for k in range(n)]
        for j, f in enumerate(frames):
            for things, colour in ((self.t.bodies, self.theme.body), (self.t.colliders, self.theme.collider)):
                for thing in things:
                    part = body(thing.shape, thing.parameters, *thing.pose(f), np.asarray(colour) ** 2.2,
                                thing.vertices, thing.triangles)
                    parts.append(part)
        return join(parts)

    def bounds(self, frames):
        """Lower and upper corner [m] of all rods and bodies in some frames."""
        lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
        for f in frames:
            for rod in self.t.rods:
                x = rod.position(f)
                x = x[np.isfinite(x).all(1)]
                if len(x):
                    r = self.half_axes(rod).max()
                    lower, upper = np.minimum(lower, x.min(0) - r), np.maximum(upper, x.max(0) + r)
            for thing in list(self.t.bodies) + list(self.t.colliders):
                part = body(thing.shape, thing.parameters, *thing.pose(f), (0, 0, 0), thing.vertices, thing.triangles)
                p, r = part.points()
                if len(p):
                    lower, upper = np.minimum(lower, (p - r[:, None]).min(0)), np.maximum(upper, (p + r[:, None]).max(0))
        if not np.isfinite(lower).all():
            raise Mistake("no finite position in these frames")
        return lower, upper
