"""From a trajectory to shapes: which frames, which values, which colours."""
import numpy as np
from tendril import ON_DEMAND, Trajectory, surface_normals

from .shapes import RECTANGLE, Shapes, Triangles, bar, body, cords, ellipse, join, smoothed, tube
from .skins import along, creased

OF_OUR_OWN = ("time", "rod")  # values that every trajectory has
THIN = 0.003  # radius of tendons, as a share of the size of all


class Mistake(Exception):
    """What the user should change, in one line."""


def open_trajectory(path):
    """The trajectory in a folder or file; a Mistake if it cannot be read or has no frame."""
    try:
        t = Trajectory(path)
    except Exception as e:  # h5py tells of broken files by errors of many kinds
        reason = (str(e).splitlines() or [type(e).__name__])[0]
        raise Mistake(f"{path}: not a trajectory that can be read ({reason})")
    if not len(t.time) or not len(t.rods):
        raise Mistake(f"{path}: no frame yet")
    return t


def frame_at(t, time):
    """The number of the frame nearest to a time [s] of the run, the first of several."""
    first, last = t.time.min(), t.time.max()
    slack = 0.51 * np.abs(np.diff(t.time)).max(initial=0) + 1e-9 * abs(last)
    if not first - slack <= time <= last + slack:
        raise Mistake(f"time {time:g} s is outside the run, {first:g} to {last:g} s")
    return int(np.abs(t.time - time).argmin())


def frame_number(t, k):
    """The number of a frame, negative ones counted from the end."""
    n = len(t.time)
    if not -n <= k < n:
        raise Mistake(f"frame {k}: the run has {n}, numbered from 0")
    return k % n


def moving_frames(t, fps, seconds=None):
    """Frames of a moving picture, evenly spaced in time; in statics all frames."""
    if is_static(t):
        return list(range(len(t.time)))
    span = t.time[-1] - t.time[0]
    n = max(1, round(fps * (seconds or span)))
    return [frame_at(t, v) for v in t.time[0] + span * np.arange(n) / n]


def fields(t):
    """Names of what may give colours."""
    return list(OF_OUR_OWN) + [n for n in t.field_names
                              if n != "director" and str(t.field(n).place)[:4] in ("vert", "edge")]


def value(t, name, index, frame):
    """Values (nv,) of a field at the vertices of a rod; of vectors the length, of edges the mean of both sides."""
    rod = t.rods[index]
    if name in OF_OUR_OWN:
        return np.full(len(rod.position(frame)), t.time[frame] if name == "time" else index, float)
    v = np.asarray(rod.field(name, frame), float)
    if v.ndim > 1:
        v = np.sqrt((v * v).sum(-1))
    if str(t.field(name).place).startswith("edge"):
        v = (v + np.roll(v, 1)) / 2 if rod.closed else np.concatenate([v[:1], (v[1:] + v[:-1]) / 2, v[-1:]])
    return v


def title(t, name):
    """What the scale of a field is called."""
    if name == "time" and hasattr(t, "time_name"):
        return t.time_name
    if name in (None, *OF_OUR_OWN):
        return "load factor" if name == "time" and is_static(t) else name or ""
    words = name.replace("_", " ")
    return f"|{words}|" if np.ndim(t.rods[0].field(name, 0)) > 1 else words


def is_static(t):
    """Whether nothing moves: the times of frames are then load factors, which may fall as well as rise."""
    if hasattr(t, "time_name"):
        return True
    if "velocity" not in t.field_names or len(t.time) < 2:
        return False
    if "body_velocity" in t.field_names and np.any(t.field("body_velocity")[len(t.time) - 1]):
        return False
    return not any(np.any(r.field("velocity", len(t.time) - 1)) for r in t.rods)


class Source:
    """Shapes of frames of a trajectory, coloured by a field."""

    def __init__(self, t, field, frames, theme, colours, radius=None, smooth=False, offset=(0, 0, 0),
                 rods=slice(None), skins=True):
        if field is not None and field not in fields(t):
            hint = f"; runs with -output_fields all,{field} have it" if field in ON_DEMAND else ""
            raise Mistake(f"field {field}: this trajectory has {', '.join(fields(t))}{hint}")
        self.t, self.field, self.theme, self.radius, self.smooth = t, field, theme, radius, smooth
        self.rods = range(len(t.rods))[rods]
        seen = [k for k in self.rods if not t.rods[k].name.startswith("carrier of ")]  # those stand for no thing
        self.rods = seen or self.rods
        if not self.rods:
            raise Mistake(f"none of the {len(t.rods)} rods is chosen")
        # Skins by rod: the skin, the points that are split where it is sharp, and the triangles of these.
        self.skins = {k: (skin, *creased(skin.reference(), skin.triangles)) for k in self.rods if skins
                      if (skin := getattr(t.rods[k], "skin", None)) is not None}
        self.offset = np.asarray(offset, float)  # from one frame of a picture to the next [m]
        self.left_out = 0  # edges that are not finite
        self.clipped = False  # whether there are values above the scale
        self.tendons = t.tendons if "tendon_position" in t.field_names else []
        self.tendon_radius = 0
        self.tendon_radius = THIN * np.linalg.norm(np.ptp(self.points(frames[0])[0], axis=0)) if self.tendons else 0
        self.colours, self.range = None, None
        if field is not None:
            self.range = self.values_range(frames)
            self.colours = colours(*self.range)

    def values_range(self, frames):
        """Ends of the scale: all values but two per cent at each end; symmetric for those of both signs."""
        if self.field == "time":
            v = self.t.time[list(frames)]
        else:
            v = np.concatenate([value(self.t, self.field, k, f) for f in frames for k in self.rods])
        v = v[np.isfinite(v)]
        if not len(v):
            raise Mistake(f"field {self.field}: no finite value in these frames")
        if self.field in OF_OUR_OWN:
            return v.min(), v.max()
        lower, upper = np.percentile(v, [2, 98])
        if lower < -0.1 * upper and upper > -0.1 * lower:
            lower, upper = -max(upper, -lower), max(upper, -lower)
        elif 0 <= lower < 0.3 * upper:
            lower = 0
        self.clipped = v.max() > upper + 0.02 * (upper - lower)
        return lower, upper

    def half_axes(self, rod):
        """Half axes (2,) [m]; 0 for a line of fixed width."""
        if self.radius is not None:
            return np.full(2, self.radius)
        if rod.section == "none":
            return np.zeros(2)
        axes = np.asarray(rod.half_axes, float)
        return axes if np.isfinite(axes).all() else np.full(2, np.nan_to_num(rod.radius))

    def clouds(self, frames):
        """Points (n, 3) along all rods and tendons and on skins [m], an array for each frame of a picture."""
        def between(x, closed):
            x = np.concatenate([x, x[:1]]) if closed else x
            s = np.arange(8)[:, None, None] / 8
            return np.concatenate([(x[:-1] + s * (x[1:] - x[:-1])).reshape(-1, 3), x[-1:]])

        rods = [self.t.rods[k] for k in self.rods]
        return [np.concatenate([between(r.position(f), r.closed) for r in rods]
                               + [skin.vertices(f) for skin, _, _ in self.skins.values()]
                               + [tendon.position(f) for tendon in self.tendons]) + j * self.offset
                for j, f in enumerate(frames)]

    def rod(self, index, frame, place, pixel):
        """Shapes of one rod in the frame at a place of the list: its skin, or its section, swept if wide in pixels."""
        rod = self.t.rods[index]
        x, d, axes = rod.position(frame) + place * self.offset, rod.director(frame), self.half_axes(rod)
        bad = ~np.isfinite(x).all(1)
        self.left_out += int((bad | np.roll(bad, -1))[: len(d)].sum())
        if index in self.skins:
            return self.skin(index, frame, place)
        if self.colours is None:
            colour = np.tile(np.asarray(self.theme.plain) ** 2.2, (len(x), 1))
        else:
            colour = self.colours.of(np.nan_to_num(value(self.t, self.field, index, frame)))
        if self.smooth:
            x, d, colour = smoothed(x, d, colour, rod.closed)
        wide = axes.max() > max(pixel, 1.02 * axes.min()) and len(d)
        if wide or (rod.section == "rectangle" and axes.max() > pixel and self.radius is None):
            outline = RECTANGLE if rod.section == "rectangle" else ellipse()
            return bar(x, d, axes, colour, rod.closed, outline)
        return tube(x, d, axes, colour, rod.closed, place * len(self.t.rods) + index)

    def skin(self, index, frame, place):
        """Shapes of the skin of a rod; triangles that are not finite are left out."""
        skin, point, triangles = self.skins[index]
        x = skin.vertices(frame)[point] + place * self.offset
        if self.colours is None:
            colour = np.tile(np.asarray(self.theme.plain) ** 2.2, (len(x), 1))
        else:
            values = along(skin, np.nan_to_num(value(self.t, self.field, index, frame)))
            colour = self.colours.of(values)[point]
        normal = surface_normals(x, triangles)
        triangles = triangles[np.isfinite(x[triangles]).all((1, 2))]
        return Shapes(triangles=Triangles(x[triangles], normal[triangles], colour[triangles]))

    def shapes(self, frames, pixel=0):
        """All that is seen in some frames at once; `pixel`: the size of one [m]."""
        parts = [self.rod(k, f, j, pixel) for j, f in enumerate(frames) for k in self.rods]
        for j, f in enumerate(frames):
            parts += [self.thing(b, f, self.theme.body, j) for b in self.t.bodies]
            parts += [self.thing(c, f, self.theme.collider, j) for c in self.t.colliders]
            parts += [self.tendon(k, f, j) for k in range(len(self.tendons))]
        return join(parts)

    def thing(self, thing, frame, colour, place=0):
        """Shapes of a body or collider."""
        position, quaternion = thing.pose(frame)
        return body(thing.shape, thing.parameters, position + place * self.offset, quaternion,
                    np.asarray(colour) ** 2.2, thing.vertices, thing.triangles)

    def tendon(self, index, frame, place=0):
        """Shapes of a tendon."""
        tendon = self.tendons[index]
        return cords(tendon.position(frame) + place * self.offset, tendon.segments, self.tendon_radius,
                     np.asarray(self.theme.tendon) ** 2.2, -2 - index)

    def points(self, frame, place=0):
        """Centres (n, 3) and radii (n,) [m] of balls that hold rods, bodies and tendons; colliders may be endless."""
        parts = [self.thing(b, frame, (0, 0, 0), place).points() for b in self.t.bodies]
        parts += [self.tendon(k, frame, place).points() for k in range(len(self.tendons))]
        for k in self.rods:
            rod, skinned = self.t.rods[k], k in self.skins
            x = (self.skins[k][0].vertices(frame) if skinned else rod.position(frame)) + place * self.offset
            x = x[np.isfinite(x).all(1)]
            parts.append((x, np.full(len(x), 0 if skinned else self.half_axes(rod).max())))
        return tuple(np.concatenate(v) for v in zip(*parts))

    def bounds(self, frames, places=None):
        """Lower and upper corner [m] of all that points() holds in some frames, and of colliders close to them."""
        lower, upper = np.full(3, np.inf), np.full(3, -np.inf)
        for f, place in zip(frames, places or [0] * len(frames)):
            x, r = self.points(f, place)
            lower = np.minimum(lower, (x - r[:, None]).min(0, initial=np.inf))
            upper = np.maximum(upper, (x + r[:, None]).max(0, initial=-np.inf))
        if not np.isfinite(lower).all():
            raise Mistake("no finite position in these frames")
        reach = np.linalg.norm(upper - lower) / 2
        for c in self.t.colliders:
            x, r = self.thing(c, frames[-1], (0, 0, 0)).points()
            if len(x):
                first, last = (x - r[:, None]).min(0), (x + r[:, None]).max(0)
                lower, upper = (np.minimum(lower, np.maximum(first, lower - reach)),
                                np.maximum(upper, np.minimum(last, upper + reach)))
        return lower, upper
