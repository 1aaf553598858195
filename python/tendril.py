"""Reads trajectories of tendril, also while a run writes them and after a kill. Needs numpy and h5py.

    from tendril import Trajectory
    t = Trajectory("out/helix")              # a folder, or its trajectory.h5
    x = t.rods["spring"].position(-1)        # (vertices, 3) [m] in the last frame
    v = t.field("velocity")[:, -1]           # (frames, 3) of the last vertex of all
    y = t.at(0.3).rods[0].position()         # between frames

docs/reading_results.md describes all of it, and the file. Mistakes raise TendrilError, with one line that tells what
there is. The order of values is that of the scene: rods one after the other, each from its first vertex to its last.
"""
import os
import re
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import h5py
import numpy as np

FORMATS = (1, 2)
PLACES = ("vertices", "edges", "cells")
ROWS = ("supports", "constraints", "colliders", "bodies", "attachments", "joints", "tendons",
        "tendon_points")  # of fields that are not of rods
ON_DEMAND = ("curvature", "twist", "strain_energy_density", "force", "moment", "reaction", "reaction_moment",
             "constraint_deviation", "constraint_force", "contact_force", "collider_force", "collider_moment",
             "attachment_force", "attachment_moment", "joint_coordinate", "joint_distance", "joint_force",
             "joint_moment", "position_low")

# Place and unit of what is in files of format 1; later ones tell by themselves.
FORMAT_1_FIELDS = {
    "position": ("vertices", "m"), "director": ("edges", "1"), "velocity": ("vertices", "m/s"),
    "twist_rate": ("edges", "rad/s"), "axial_force": ("edges", "N"), "turns": ("cells", "rad"),
    "position_low": ("vertices", "m"), "curvature": ("vertices", "1/m"), "twist": ("vertices", "rad/m"),
    "strain_energy_density": ("vertices", "J/m"), "force": ("edges", "N"), "moment": ("vertices", "N m"),
}
FORMAT_1_UNITS = {
    "time": "s", "diagnostics/time": "s", "diagnostics/dt": "s", "diagnostics/wall_seconds": "s",
    **{f"diagnostics/{name}": "J" for name in ("kinetic", "stretch", "bend", "twist", "gravity", "dissipated")},
    "material/linear_density": "kg/m", "material/linear_rotational_inertia": "kg m", "material/axial_stiffness": "N",
    "material/torsional_stiffness": "N m^2", "material/flexural_stiffness": "N m^2",
    "material/mass_damping_coefficient": "1/s", "material/stiffness_damping_coefficient": "s",
    "reference/position": "m", "estimate/position": "m", "estimate/error": "m",
}


def parts(folder):
    """Folders of a run that `-restart auto` went on with, in order of time; the last is `folder` itself. The first frame
    of each is the state in which the one before was left off, whose later frames it replaces."""
    found = [d.name for d in os.scandir(folder) if d.is_dir() and re.fullmatch(r"part_[1-9][0-9]*", d.name)]
    return [os.path.join(folder, name) for name in sorted(found, key=lambda name: int(name[5:]))] + [folder]


class TendrilError(ValueError):
    """What is wrong with a file, or with what was asked of it, in one line."""


def _listed(names):
    names = [str(n) for n in names]
    return ", ".join(names[:20]) + (f" and {len(names) - 20} more" if len(names) > 20 else "") if names else "none"


def _text(value):
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _texts(dataset):
    return [_text(v) for v in dataset[:].tolist()]


def _attributes(of):
    """Numbers, texts and arrays by name."""
    return {k: _text(v.item() if np.ndim(v) == 0 and hasattr(v, "item") else v) for k, v in of.attrs.items()}


def _unlocked(path, shared):
    """Opened so that no run is kept from writing. Older h5py or HDF5 cannot but lock, and what a process has open with
    locks it cannot open without."""
    try:
        return h5py.File(path, "r", swmr=shared, locking=False)
    except (TypeError, ValueError, OSError):
        return h5py.File(path, "r", swmr=shared)


def _open(path):
    """The open file. A run that starts, or adds its estimate at the end, has it to itself for a moment."""
    try:
        with open(path, "rb") as f:
            head = f.read(9)
    except OSError as e:
        raise TendrilError(f"{path}: {'there is no such file' if e.errno == 2 else e.strerror}") from None
    if head[:8] != b"\x89HDF\r\n\x1a\n":
        raise TendrilError(f"{path}: is " + ("not an HDF5 file" if head else "empty; has its run begun?"))
    # Files that a run has open, or had when it was killed, are marked: those are read while they grow. Others are not:
    # HDF5 reads what is damaged again and again then, in hope of a writer that mends it.
    for wait in [0.025] * 20 + [0]:
        for shared in (False, True)[: 2 if head[8:] >= b"\x03" else 1]:
            try:
                return _unlocked(path, shared)
            except (OSError, ValueError, RuntimeError) as e:
                reason = str(e).split("\n")[0]
        clock.sleep(wait)
    raise TendrilError(f"{path}: cannot be opened; is it whole, or does a run just start? ({reason})")


class Field:
    """A field of all rods, at `place`: vertices, edges, cells, supports, constraints, colliders, bodies, attachments,
    joints, tendons or tendon_points; indices read from the file what they ask for.

    field[frame], field[first:last, vertex], numpy.asarray(field). Shape: (frames, n), or (frames, n, components).
    """

    def __init__(self, trajectory, name):
        self._t, self.name = trajectory, name
        self.place, self.unit = trajectory._fields[name]

    @property
    def shape(self):
        return (len(self._t.time), *self._data.shape[1:])

    dtype = property(lambda self: self._data.dtype)
    ndim = property(lambda self: self._data.ndim)
    _data = property(lambda self: self._t._dataset("state/" + self.name))

    def __getitem__(self, index):
        index = index if isinstance(index, tuple) else (index,)
        if index and all(_is_integer(i) or (isinstance(i, slice) and (i.step or 1) > 0) for i in index):
            return self._data[(self._t._frame(index[0]), *index[1:])]
        return self._data[: len(self)][index]

    def __len__(self):
        return len(self._t.time)

    def __iter__(self):
        return (self[k] for k in range(len(self)))

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self[:], dtype)

    def __repr__(self):
        return f"<field {self.name} [{self.unit}] of {self.place}, {self.shape}>"


def _is_integer(i):
    return isinstance(i, (int, np.integer))


class Rod:
    """One rod: what does not change, and its part of the fields. Frames are numbers (-1 is the last) or slices.

    name, closed; vertices, edges: how many; first_vertex, first_edge: their numbers in fields of all rods;
    energy: seed or classical, the law of stretch and bending; seed in files that do not tell;
    section: circle, ellipse, rectangle, none (only stiffness was given), or unknown (format 1);
    half_axes (2,) [m] along the first and second director, nan without a section;
    radius [m]: mean of the half axes; without them that of a homogeneous round rod of this stiffness, 2 sqrt(EI/EA),
    or nan for cables;
    material: its parameters by name, units by Trajectory.unit;
    skin: the Skin that is embedded in it, or None.
    """

    def __init__(self, trajectory, index):
        s = trajectory._static
        self._t, self.index = trajectory, index
        self.name, self.closed = s["name"][index], bool(s["closed"][index])
        self._slices = {place: slice(*s[place][index : index + 2]) for place in PLACES if s[place] is not None}
        self.first_vertex, self.first_edge = self._slices["vertices"].start, self._slices["edges"].start
        self.vertices = self._slices["vertices"].stop - self.first_vertex
        self.edges = self._slices["edges"].stop - self.first_edge
        self.energy = s["energy"][index]
        self.section, self.half_axes = s["section"][index], s["half_axes"][index]
        self.material = {name: values[index] for name, values in s["material"].items()}
        self.radius = float(self.half_axes.mean())
        bending = np.mean(self.material["flexural_stiffness"])
        if np.isnan(self.radius) and bending > 0:
            self.radius = float(2 * np.sqrt(bending / self.material["axial_stiffness"]))

    def field(self, name, frame=-1):
        """Values (n,) or (n, components) of a field; with a slice of frames, these come first."""
        field = self._t.field(name)
        return field[frame, self._slice(field.place)]

    def position(self, frame=-1):
        """(vertices, 3) [m]."""
        return self.field("position", frame)

    def director(self, frame=-1):
        """First directors (edges, 3)."""
        return self.field("director", frame)

    def reference(self, name):
        """`position` (vertices, 3) [m] or `director` (edges, 3) as drawn; `radius` (vertices,) [m], 0 for a cable."""
        names = list(self._t._file["reference"])
        if name not in names:
            raise TendrilError(f"there is no reference '{name}'; there are: {_listed(names)}")
        return self._t._dataset("reference/" + name)[self._slices["edges" if name == "director" else "vertices"]]

    @property
    def skin(self):
        """The Skin that is embedded in the rod; None without one."""
        if "skins" not in self._t._file:
            return None
        rows = [slice(*self._t._dataset(f"skins/{kind}_offsets")[self.index : self.index + 2].tolist())
                for kind in ("point", "triangle")]
        return Skin(self, *rows) if rows[0].stop > rows[0].start else None

    def _slice(self, place):
        if place in ROWS:
            owners = "point of trajectory.tendons" if place == "tendon_points" else f"of trajectory.{place}"
            raise TendrilError(f"a field of {place} is not one of rods: trajectory.field(name)[frame] has a row for "
                               f"each {owners}")
        if place not in self._slices:
            raise TendrilError(f"files of format 1 do not tell which {place} are those of rod '{self.name}'")
        return self._slices[place]

    def __repr__(self):
        return f"<rod '{self.name}', {self.vertices} vertices>"


def edge_frames(position, director):
    """Middles [m], edges [m], unit tangents and second directors, each (..., edges, 3), of vertices (..., n, 3) [m] and
    first directors (..., edges, 3); with as many edges as vertices the last one ends in the first vertex."""
    before = position[..., : director.shape[-2], :]
    after = np.roll(position, -1, -2)[..., : director.shape[-2], :]
    tangent = _unit_vectors(after - before, 0.0)
    return (before + after) / 2, after - before, tangent, np.cross(tangent, director)


def surface_normals(points, triangles):
    """Unit normals (..., n, 3) at points (..., n, 3), means of those of their triangles (m, 3) weighted by area; 0 where
    there is none."""
    corner, sums = points[..., triangles, :], np.zeros(points.shape)
    across = np.cross(corner[..., 1, :] - corner[..., 0, :], corner[..., 2, :] - corner[..., 0, :])
    for frame in np.ndindex(points.shape[:-2]):
        for i in range(3):
            sums[frame][:, i] = np.bincount(triangles.ravel(), np.repeat(across[frame][:, i], 3), points.shape[-2])
    return _unit_vectors(sums, 0.0)


class Skin:
    """A surface of triangles that a rod carries with it. Frames are numbers (-1 is the last) or slices.

    points: how many; triangles (m, 3): numbers of points, anticlockwise seen from outside;
    edge, weight (points, K) and local (points, K, 3) [m]: a point is the sum over its K edges of the rod of weight times
    middle + local[0]/L edge + local[1] director + local[2] second director; L is in `lengths` (edges,) [m], of the edges
    as drawn.
    """

    def __init__(self, rod, points, triangles):
        self._rod, self._points, self._triangles = rod, points, triangles
        self.points = points.stop - points.start

    triangles = cached_property(lambda self: self._rod._t._dataset("skins/triangles")[self._triangles])
    edge = cached_property(lambda self: self._rod._t._dataset("skins/edge")[self._points])
    weight = cached_property(lambda self: self._rod._t._dataset("skins/weight")[self._points])
    local = cached_property(lambda self: self._rod._t._dataset("skins/local")[self._points])

    @cached_property
    def lengths(self):
        x = self._rod.reference("position")
        return np.linalg.norm(np.roll(x, -1, 0) - x, axis=1)[: self._rod.edges]

    def vertices(self, frame=-1):
        """The points (points, 3) [m]; with a slice of frames (frames, points, 3)."""
        return self._placed(self._rod.position(frame), self._rod.director(frame))

    def normals(self, frame=-1):
        """Unit normals at the points, (points, 3) or (frames, points, 3): means of the triangles around, by area."""
        return surface_normals(self.vertices(frame), self.triangles)

    def reference(self):
        """The points as drawn, (points, 3) [m]."""
        return self._placed(self._rod.reference("position"), self._rod.reference("director"))

    def _placed(self, position, director):
        middle, edge, _, second = edge_frames(position, director)
        along, parts = self.local.copy(), (edge, director, second)
        along[..., 0] /= self.lengths[self.edge]
        return sum(self.weight[:, k, None] * (middle[..., e, :] + sum(along[:, k, i, None] * parts[i][..., e, :]
                                                                      for i in range(3)))
                   for k, e in enumerate(self.edge.T))

    def __repr__(self):
        return f"<skin of rod '{self._rod.name}', {self.points} points, {len(self.triangles)} triangles>"


class Rods(Sequence):
    """The rods by number or name."""

    def __init__(self, trajectory, kind=Rod):
        self._t, self._kind = trajectory, kind

    def __len__(self):
        return len(self._t._static["name"])

    def __iter__(self):
        return (self._kind(self._t, k) for k in range(len(self)))

    def __getitem__(self, key):
        if isinstance(key, slice):
            return [self[k] for k in range(len(self))[key]]
        names, numbers = self._t._static["name"], self._t._static["number"]
        if isinstance(key, str):
            if key not in numbers:
                raise TendrilError(f"there is no rod '{key}'; there are: {_listed(names)}")
            return self._kind(self._t, numbers[key])
        if not -len(self) <= key < len(self):
            raise TendrilError(f"there is no rod {key}; there are {len(self)}: {_listed(names)}")
        return self._kind(self._t, int(key) % len(self))


@dataclass(frozen=True)
class Support:
    """What holds a vertex: clamp, pin or fix_twist. `vertex` counts over all rods, `rod_vertex` on its own."""

    vertex: int
    type: str
    rod: str
    rod_vertex: int


@dataclass(frozen=True)
class Constraint:
    """A spring and damper: a pin, which draws a vertex, or a rotation, which turns an edge; `place` is its number on the
    rod."""

    name: str
    type: str
    rod: str
    place: int


@dataclass(frozen=True)
class Attachment:
    """A vertex of a rod that is a point of a body. type: weld, which holds the rod's direction, too, or pin. `vertex`
    counts over all rods, `rod_vertex` on its own."""

    name: str
    type: str
    body: str
    rod: str
    rod_vertex: int
    vertex: int


@dataclass(frozen=True)
class Joint:
    """Between a body, `child`, and another, `parent`: None for the world, or a body that goes as it is told. point (3,)
    [m] and axis (3,) as drawn."""

    name: str
    type: str
    child: str
    parent: str | None
    point: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True)
class Modes:
    """Modes, n from the lowest on. Of a run with -mode modes small motions about the last frame: it moves by shape times
    cos(frequency t), or in one that grows by shape times exp(growth_rate t). Their kinetic energy is that of 1 kg m^2:
    the shapes are orthonormal by the masses, where all forces have a potential. Flutter is two modes that follow each
    other, with a frequency and a growth_rate g: exp(g t) (shape cos(frequency t) + next shape sin(frequency t)).

    frequency (n,) [rad/s], 0 of motions that cost nothing and of those that grow without flutter; growth_rate (n,)
    [1/s], 0 where the equilibrium is stable; eigenvalue (n,) [1/s^2], the real part of (frequency + i growth_rate)^2;
    shape (n, vertices, 3) [m]; twist (n, edges) [rad], of edges about their tangents, parallel transport taken off;
    body_shape (n, bodies, 3) [m] of the origins of bodies, body_rotation (n, bodies, 3) [rad], rotation vectors.

    Of a run with -mode buckling the motions that lose their stiffness at load_factor (n,), about the frame nearest to
    it in time: their largest displacement is 1 m, or where nothing is displaced their largest twist 1 rad. What belongs
    to the other kind of run is None.
    """

    frequency: np.ndarray
    growth_rate: np.ndarray
    eigenvalue: np.ndarray
    shape: np.ndarray
    twist: np.ndarray
    body_shape: np.ndarray
    body_rotation: np.ndarray
    load_factor: np.ndarray


class Things(list):
    """Bodies, colliders or tendons by number or name."""

    names = property(lambda self: [thing.name for thing in self])

    def __getitem__(self, key):
        if not isinstance(key, str):
            return super().__getitem__(key)
        for thing in self:
            if thing.name == key:
                return thing
        raise TendrilError(f"nothing is called '{key}'; there are: {_listed(self.names)}")


class Thing:
    """A body or a collider. shape: plane, sphere, box, capsule, cylinder, tube, mesh or none, with its parameters (k,)
    [m]: of a box three half edges, of others radii, then the half length; of a mesh `vertices` (n, 3) [m] and
    `triangles` (m, 3), otherwise None.

    Of bodies, with the masses of the rods that are tied to them: mass [kg]; centre (3,) [m], that of mass, as drawn;
    inertia (3, 3) [kg m^2] about it as drawn, in axes of the world. None in files without, and of colliders.

    Frames are numbers (-1 is the last) or slices."""

    def __init__(self, trajectory, group, index):
        self._t, self._kind, self.index = trajectory, {"bodies": "body", "colliders": "collider"}[group], index
        self._group = group
        data = trajectory._file[group]
        self.shape = _texts(data["shape"])[index]
        self.name = _texts(data["name"])[index] if "name" in data else f"{self._kind}{index}"
        parameters = data["parameters"][index] if "parameters" in data else np.zeros(0)
        self.parameters = parameters[~np.isnan(parameters)]
        self.mass, self.inertia, self.centre = (data[key][index] if key in data else None
                                                for key in ("mass", "inertia", "centre"))
        mesh = data.get(f"meshes/{index}")
        self.vertices, self.triangles = (mesh[key][:] if mesh else None for key in ("vertices", "triangles"))

    def pose(self, frame=-1):
        """Position (3,) [m] of the origin and rotation (4,) from its own axes to the world's, a unit quaternion whose
        first component is the real one; with a slice of frames, these come first."""
        return self._moving("position", np.zeros(3), frame), self._moving("rotation", np.array([1.0, 0, 0, 0]), frame)

    def position(self, frame=-1):
        """Of the origin, (3,) [m]."""
        return self.pose(frame)[0]

    def rotation(self, frame=-1):
        """A unit quaternion (4,), w x y z."""
        return self.pose(frame)[1]

    def axes(self, frame=-1):
        """The rotation as a matrix (3, 3): its columns are the own axes in the world, so that position + axes @ x is
        where the point x of a body or collider is."""
        w, x, y, z = np.moveaxis(self.rotation(frame), -1, 0)
        rows = [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]
        return np.stack([np.stack(row, -1) for row in rows], -2)

    def _moving(self, key, rest, frame):
        state, at_rest = f"state/{self._kind}_{key}", f"{self._group}/{key}"
        frames = self._t._frame(frame)
        if state in self._t._file:
            return self._t._dataset(state)[frames, self.index]
        if self._kind == "body":  # it moves, and -output_fields has left out where
            self._t.field(f"body_{key}")
        value = self._t._dataset(at_rest)[self.index] if at_rest in self._t._file else rest
        return np.tile(value, (len(self._t.time[frames]), 1)) if isinstance(frames, slice) else value

    def __repr__(self):
        return f"<{self._kind} '{self.name}', {self.shape}>"


class Tendon:
    """A cord through points, or a sum of joints' coordinates, or both. Frames are numbers (-1 is the last) or slices.

    name; actuator: displacement, force, mckibben or none; points: how many, with those of the arcs where it winds round
    something, 0 of a sum of joints alone; segments (m, 2): numbers of points with straight lines between.
    """

    def __init__(self, trajectory, index):
        self._t, self.index = trajectory, index
        data = trajectory._file["tendons"]
        self.name, self.actuator = (_text(data[key][index]) for key in ("name", "actuator"))
        first, end = data["first_point"][index : index + 2].tolist()
        self._points, self.points = slice(first, end), end - first
        pairs = data["segments"][:] if "segments" in data else np.zeros((0, 2), int)
        self.segments = pairs[(pairs[:, 0] >= first) & (pairs[:, 0] < end)] - first

    def field(self, name, frame=-1):
        """Value of a field of tendons, or values (points, 3) of one of their points; with a slice of frames, these come
        first."""
        field = self._t.field(name)
        return field[frame, self._points if field.place == "tendon_points" else self.index]

    def displacement(self, frame=-1):
        """Change of its length since it was drawn, with the sum of joints [m]."""
        return self.field("tendon_displacement", frame)

    def length(self, frame=-1):
        """Of its straight parts and arcs, 0 of a sum of joints alone [m]."""
        return self.field("tendon_length", frame)

    def rate(self, frame=-1):
        """Of the displacement [m/s]."""
        return self.field("tendon_rate", frame)

    def tension(self, frame=-1):
        """[N]."""
        return self.field("tendon_tension", frame)

    def point_tension(self, frame=-1):
        """Behind each of its points, (points); of the last before it [N]."""
        if not self.points:
            return np.zeros((*np.shape(self._t.time[frame]), 0))
        return self.field("tendon_point_tension", frame)

    def position(self, frame=-1):
        """Of its points, (points, 3) [m]."""
        if not self.points:  # a file may have none at all
            return np.zeros((*np.shape(self._t.time[frame]), 0, 3))
        return self.field("tendon_position", frame)

    def __repr__(self):
        return f"<tendon '{self.name}', {self.actuator}, {self.points} points>"


def _unit_vectors(v, instead):
    size = np.linalg.norm(v, axis=-1, keepdims=True)
    return np.where(size > 0, v / np.where(size > 0, size, 1), instead)


class Moment:
    """The state at a time between frames: `time`, `rods`, `bodies`, `colliders`, `tendons`, `field(name)` of all rods.

    Linear between the two frames; directors and rotations are normalised, whole turns are those of the frame before.
    """

    def __init__(self, trajectory, time):
        times = trajectory.time
        if not len(times):
            raise TendrilError(f"{trajectory.path}: has no frame yet")
        if np.any(np.diff(times) < 0):
            raise TendrilError("load factors of this run fall and rise: choose frames by number")
        slack = 1e-9 * max(abs(times[0]), abs(times[-1]))  # of sums of steps
        if not times[0] - slack <= time <= times[-1] + slack:
            raise TendrilError(f"there is nothing at time {time:g}; frames go from {times[0]:g} to {times[-1]:g}")
        self._t, self.time = trajectory, float(np.clip(time, times[0], times[-1]))
        self._before = int(np.searchsorted(times, self.time, side="right")) - 1
        self._after = min(self._before + 1, len(times) - 1)
        step = times[self._after] - times[self._before]
        self._weight = (self.time - times[self._before]) / step if step > 0 else 0.0

        def of_rod(_, index):
            rod = Rod(trajectory, index)
            rod.field = lambda name, frame=None: self._between(lambda k: Rod.field(rod, name, k), name)
            return rod

        self.rods = Rods(trajectory, of_rod)

    bodies = property(lambda self: self._things(self._t.bodies))
    colliders = property(lambda self: self._things(self._t.colliders))

    @property
    def tendons(self):
        tendons = self._t.tendons
        for tendon in tendons:
            tendon.field = lambda name, frame=None, tendon=tendon: self._between(
                lambda k: Tendon.field(tendon, name, k), name)
        return tendons

    def field(self, name):
        """(n,) or (n, components)."""
        field = self._t.field(name)
        return self._between(lambda k: field[k], name)

    def _between(self, at, name):
        before = at(self._before)
        if self._weight == 0 or name == "turns":
            return before
        if name in ("body_rotation", "collider_rotation"):
            return self._between_turns(before, at(self._after))
        value = (1 - self._weight) * before + self._weight * at(self._after)
        return _unit_vectors(value, before) if name == "director" else value

    def _between_turns(self, before, after):
        same = np.sum(before * after, axis=-1, keepdims=True) >= 0  # a rotation is two quaternions
        after = np.where(same, after, -after)
        return _unit_vectors((1 - self._weight) * before + self._weight * after, before)

    def _things(self, things):
        for thing in things:
            thing.pose = lambda frame=None, thing=thing: self._pose(thing)
        return things

    def _pose(self, thing):
        (x0, q0), (x1, q1) = Thing.pose(thing, self._before), Thing.pose(thing, self._after)
        return (1 - self._weight) * x0 + self._weight * x1, self._between_turns(q0, q1)


class Options(dict):
    """Effective options as texts by name, without those of single rods; `text` is all of options.yaml."""

    def __init__(self, text):
        lines = re.findall(r"^(\w+): (.+)$", text, re.MULTILINE)
        super().__init__((key, value.strip('"')) for key, value in lines)
        self.text = text

    def __str__(self):
        return self.text


class Trajectory:
    """A trajectory.h5, given by its path or that of its folder.

    path, format_version, attributes (those of the file: command line, version, ...), gravity (3,) [m/s^2];
    rods, supports, constraints, bodies, attachments, joints, tendons, colliders; scene: its text, or None; scene_files:
    texts that it names, by path as written; options: Options. A frame counts once it is complete. What a run has added
    since is seen after refresh().
    """

    def __init__(self, path):
        self.path = os.path.join(path, "trajectory.h5") if os.path.isdir(path) else os.fspath(path)
        self._read()

    def _read(self):
        self._file = _open(self.path)
        try:
            self._check()
            self._load()
            self._look()
        except TendrilError:
            self.close()
            raise
        except Exception as e:  # of any kind where a new run begins over the file
            self.close()
            reason = str(e).split("\n")[0].strip('"')
            raise TendrilError(f"{self.path}: is damaged or incomplete ({reason})") from None

    def _check(self):
        if _text(self._file.attrs.get("format", "")) != "tendril-trajectory":
            raise TendrilError(f"{self.path}: is an HDF5 file, but not a trajectory of tendril")
        self.format_version = int(self._file.attrs["format_version"])
        if self.format_version not in FORMATS:
            raise TendrilError(f"{self.path}: has format {self.format_version}, newer than {FORMATS[-1]}, which this "
                               "tendril.py knows; use the one that came with the program")

    def _load(self):
        """What does not change."""
        f = self._file
        self.attributes = _attributes(f)
        self.gravity = np.array(self.attributes["gravity"])
        count = len(f["topology/closed"])
        cells = f.get("topology/rod_cell_offsets")
        turns = f.get("state/turns")
        if cells is None and count == 1 and turns is not None:
            cells = np.array([0, turns.shape[1]])
        self._static = {
            "closed": f["topology/closed"][:],
            "vertices": f["topology/rod_vertex_offsets"][:].tolist(),
            "edges": f["topology/rod_edge_offsets"][:].tolist(),
            "cells": None if cells is None else cells[:].tolist(),
            "name": _texts(f["rods/name"]) if "rods" in f else [f"rod{k}" for k in range(count)],
            "section": _texts(f["rods/section"]) if "rods" in f else ["unknown"] * count,
            "energy": _texts(f["rods/energy"]) if "rods/energy" in f else ["seed"] * count,
            "half_axes": f["rods/half_axes"][:] if "rods" in f else np.full((count, 2), np.nan),
            "material": {name: data[:] for name, data in f["material"].items()},
        }
        self._static["number"] = {name: k for k, name in enumerate(self._static["name"])}
        self.supports = []
        if "supports" in f:
            starts = self._static["vertices"]
            for vertex, kind in zip(f["supports/vertex"][:].tolist(), _texts(f["supports/type"])):
                rod = int(np.searchsorted(starts, vertex, side="right")) - 1
                self.supports.append(Support(vertex, kind, self._static["name"][rod], vertex - starts[rod]))
        self.constraints = []
        if "constraints" in f:
            columns = [f["constraints/" + name][:].tolist() for name in ("rod", "place")]
            for name, kind, rod, place in zip(*(_texts(f["constraints/" + n]) for n in ("name", "type")), *columns):
                start = self._static["vertices" if kind == "pin" else "edges"][rod]
                self.constraints.append(Constraint(name, kind, self._static["name"][rod], place - start))
        self.attachments = []
        if "bodies/attachment_body" in f:
            starts, bodies = self._static["vertices"], _texts(f["bodies/name"])
            texts = (_texts(f["bodies/attachment_" + n]) for n in ("name", "type"))
            numbers = (f["bodies/attachment_" + n][:].tolist() for n in ("body", "vertex"))
            for name, kind, body, vertex in zip(*texts, *numbers):
                rod = int(np.searchsorted(starts, vertex, side="right")) - 1
                self.attachments.append(Attachment(name, kind, bodies[body], self._static["name"][rod],
                                                   vertex - starts[rod], vertex))
        self.joints = []
        if "joints" in f:
            bodies = _texts(f["bodies/name"])
            columns = (f["joints/" + n][:] for n in ("child", "parent", "point", "axis"))
            for name, kind, child, parent, *place in zip(*(_texts(f["joints/" + n]) for n in ("name", "type")), *columns):
                self.joints.append(Joint(name, kind, bodies[child], bodies[parent] if parent >= 0 else None, *place))
        self.scene = _text(f["scene"][()]) if "scene" in f else None
        files = f["scene_files"].values() if "scene_files" in f else ()
        self.scene_files = {_text(data.attrs["path"]): _text(data[()]) for data in files}
        self.options = Options(_text(f["options"][()]) if "options" in f else self.attributes["options"])

    def _look(self):
        """What grows. The times go first: a frame is complete once its time is there."""
        self._table = None
        self.time = self._dataset("time")[:]
        self.step = self._dataset("step")[: len(self.time)]
        self._fields = {}
        for name, data in self._file["state"].items():
            place, unit = FORMAT_1_FIELDS.get(name, (None, None)) if self.format_version == 1 else (
                _text(data.attrs.get(key)) for key in ("place", "unit"))
            if place in (*PLACES, *ROWS):
                self._fields[name] = place, unit

    # Made when asked for: without circular references a file is closed as soon as its Trajectory is let go.
    rods = property(lambda self: Rods(self))
    bodies = property(lambda self: self._things("bodies"))
    colliders = property(lambda self: self._things("colliders"))

    @property
    def tendons(self):
        count = len(self._file["tendons/name"]) if "tendons" in self._file else 0
        return Things(Tendon(self, k) for k in range(count))

    def _things(self, group):
        count = len(self._file[group]["shape"]) if group in self._file else 0
        return Things(Thing(self, group, k) for k in range(count))

    def _dataset(self, name):
        """A dataset as it is now, to be let go at once: HDF5 keeps one view of a file for all readers of a process,
        and refreshes only what none of them holds."""
        data = self._file[name]
        if self._file.swmr_mode:
            data.refresh()
        return data

    def _frame(self, index):
        """A frame or a slice of frames as one that counts from 0 and ends with the last complete one."""
        n = len(self.time)
        if isinstance(index, slice):
            return slice(*index.indices(n))
        if not -n <= index < n:
            raise TendrilError(f"there is no frame {index}; there are {n}, numbered from 0")
        return int(index) % n

    def refresh(self):
        """Sees what the run has added. Returns the number of complete frames."""
        self.close()
        self._read()
        return len(self.time)

    def close(self):
        self._file.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def field_names(self):
        return list(self._fields)

    def field(self, name):
        """The Field of this name."""
        if name not in self._fields:
            hint = f"; runs with -output_fields all,{name} have it" if name in ON_DEMAND else ""
            raise TendrilError(f"there is no field '{name}'; there are: {_listed(self._fields)}{hint}")
        return Field(self, name)

    def contacts(self, frame=-1):
        """Samples in contact in a frame: arrays of one row each by name, `rod`, `collider`, `edge`, `at` (part of the
        edge), `gap` [m], `position` (n, 3) [m], `normal` (n, 3), `normal_force` and `friction` (n, 3) on the rod [N]."""
        if "contacts" not in self._file:
            raise TendrilError("there are no contacts; runs with colliders and -output_fields all,contacts have them")
        return self._rows("contacts", frame)

    def touching(self, frame=-1):
        """Samples of rods and bodies that touch others in a frame: arrays of one row each by name, as `contacts`. `rod`,
        `edge` and `body` have the sample (-1 is none), `at` in its edge, and touch `to_rod`, `to_edge`, `to_body` at
        `to_at`; `normal_force` and `friction` (n, 3) act on what has the sample, their opposite on the other [N]."""
        if "touching" not in self._file:
            raise TendrilError("there is no /touching; runs with 'contact: {rods: ...}' or '{bodies: true}' and "
                               "-output_fields all,touching have it")
        return self._rows("touching", frame)

    def _rows(self, group, frame):
        """Those of a frame, by name."""
        k = self._frame(frame)
        end = self._dataset(group + "/end")
        rows = slice(int(end[k - 1]) if k else 0, int(end[k]))
        return {name: self._dataset(f"{group}/{name}")[rows] for name in self._file[group] if name != "end"}

    def at(self, time):
        """The Moment at a time [s] within the run."""
        return Moment(self, time)

    @property
    def diagnostics(self):
        """A row per step with a value per column: diagnostics["kinetic"] (steps,); names in diagnostics.dtype.names."""
        if self._table is None:
            columns = {name: self._dataset("diagnostics/" + name)[:] for name in self._file["diagnostics"]}
            rows = min(len(values) for values in columns.values())  # a run may write at this moment
            self._table = np.empty(rows, [(name, values.dtype) for name, values in columns.items()])
            for name, values in columns.items():
                self._table[name] = values[:rows]
        return self._table

    @property
    def critical(self):
        """Critical load factors found in statics (n,); often none."""
        return self._dataset("critical/load_factor")[:]

    @property
    def modes(self):
        """The Modes of a run with -mode modes or buckling; None until it has ended, and of others."""
        if "modes" not in self._file:
            return None
        group = self._file["modes"]
        none = np.zeros((len(group["shape"]), 0, 3))
        return Modes(*(group[name][:] if name in group else none if name.startswith("body") else None
                       for name in Modes.__dataclass_fields__))

    @property
    def estimate(self):
        """Estimated errors: datasets and attributes of /estimate by name; None until the run has ended with some."""
        if "estimate" not in self._file:
            return None
        group = self._file["estimate"]
        return {**{name: data[:] for name, data in group.items()}, **_attributes(group)}

    @property
    def summary(self):
        """What the last state comes to: attributes of /summary by name, reactions as (supports, 3); None until the run has
        ended."""
        if "summary" not in self._file:
            return None
        found = _attributes(self._file["summary"])
        for name in {"reaction", "reaction_moment"} & set(found):
            found[name] = found[name].reshape(-1, 3)
        return None if np.isnan(found["time"]) else found

    def unit(self, name):
        """Unit of a dataset: a field, column of the diagnostics, parameter of the material; 1 of pure numbers.
        Of equal names a field goes first: `diagnostics/twist` is the energy [J]."""
        groups = ("", "state/", "diagnostics/", "material/", "rods/", "reference/", "critical/", "estimate/",
                  "modes/", "bodies/", "skins/")
        for path in (group + name for group in groups):
            if isinstance(self._file.get(path), h5py.Dataset):
                if self.format_version > 1:
                    return _text(self._file[path].attrs.get("unit", "1"))
                field = FORMAT_1_FIELDS.get(path[6:]) if path.startswith("state/") else None
                return field[1] if field else FORMAT_1_UNITS.get(path, "1")
        names = [*self._fields, *self.diagnostics.dtype.names]
        raise TendrilError(f"nothing is called '{name}'; there are: {_listed(names)}")

    def to_xarray(self):
        """An xarray.Dataset of all fields, in memory: dimensions time, vertex, edge, cell, body ...; xyz, or axis of
        pairs, wxyz of quaternions."""
        try:
            import xarray
        except ImportError:
            raise TendrilError("to_xarray needs xarray: apt-get install python3-xarray") from None
        dimension = {"vertices": "vertex", "edges": "edge", "cells": "cell", "supports": "support",
                     "constraints": "constraint", "colliders": "collider", "bodies": "body",
                     "attachments": "attachment", "joints": "joint", "tendons": "tendon",
                     "tendon_points": "tendon_point"}
        variables = {}
        for name in self._fields:
            field = self.field(name)
            components = {1: (), 3: ("xyz",), 2: ("axis",), 4: ("wxyz",),
                          6: ("motion",)}[field.shape[2] if field.ndim == 3 else 1]
            variables[name] = ("time", dimension[field.place], *components), field[:], {"units": field.unit}
        coordinates = {"time": ("time", self.time, {"units": self.unit("time")}), "xyz": ["x", "y", "z"]}
        for place in ("vertices", "edges"):
            rods = np.repeat(self._static["name"], np.diff(self._static[place]))
            coordinates[dimension[place] + "_rod"] = dimension[place], rods
        if len(self.bodies):
            coordinates["body"] = self.bodies.names
        if len(self.tendons):
            coordinates["tendon"] = self.tendons.names
        return xarray.Dataset(variables, coordinates, self.attributes)

    def __repr__(self):
        return f"<trajectory {self.path}, {len(self.rods)} rods, {len(self.time)} frames>"
