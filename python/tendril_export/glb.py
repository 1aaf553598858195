"""glTF 2.0 in one binary file: rods as meshes that joints carry, one joint an edge, and how these move.

A joint is the middle of its edge, turned as its frame (tangent, director, second director) and stretched along it as
the edge is: what a skin of glTF does with these and the points as drawn is what a skin of the trajectory is.
"""
import json
import struct

import numpy as np
from tendril import edge_frames, surface_normals
from tendril_render.picture import LIGHT, linear
from tendril_render.skins import creased
from tendril_render.source import Mistake

from .meshes import as_drawn, surface, thing

NUMBERS = {"f": 5126, "B": 5121, "H": 5123, "I": 5125}  # of glTF, by the types of numpy
KINDS = {(): "SCALAR", (3,): "VEC3", (4,): "VEC4", (4, 4): "MAT4"}
CORNERS, ATTRIBUTES = 34963, 34962  # what a view is for
SAME = 1e-6  # of the size: how far the places of a point in the frames of its edges may be apart
MATERIALS = {"rod": LIGHT.plain, "body": LIGHT.body, "collider": LIGHT.collider}


class Document:
    """The parts of a file while it is made. What is added has a number, by which others refer to it."""

    def __init__(self):
        self.data, self.parts = bytearray(), {}

    def add(self, kind, part):
        self.parts.setdefault(kind, []).append(part)
        return len(self.parts[kind]) - 1

    def view(self, array, target=None):
        self.data += bytes(-len(self.data) % 4)
        start = len(self.data)
        self.data += array.tobytes()
        return self.add("bufferViews", {"buffer": 0, "byteOffset": start, "byteLength": array.nbytes,
                                        **({"target": target} if target else {})})

    def numbers(self, array, target=None, bounds=False):
        """The accessor of an array: a value a row."""
        return self.series(array[None], target, bounds)[0]

    def series(self, arrays, target=None, bounds=False):
        """An accessor for each of some arrays of one shape."""
        arrays = np.ascontiguousarray(arrays)
        view, rows = self.view(arrays, target), []
        for k, rows_of_one in enumerate(arrays):
            part = {"bufferView": view, "byteOffset": k * rows_of_one.nbytes, "count": len(rows_of_one),
                    "componentType": NUMBERS[arrays.dtype.char], "type": KINDS[arrays.shape[2:]]}
            if bounds:
                part["min"], part["max"] = (np.atleast_1d(f(rows_of_one, 0)).tolist() for f in (np.min, np.max))
            rows.append(self.add("accessors", part))
        return rows

    def bytes(self):
        head = {"asset": {"version": "2.0", "generator": "tendril scripts/export"}, "scene": 0,
                **self.parts, "buffers": [{"byteLength": len(self.data)}]}
        text = json.dumps(head, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode()
        text += b" " * (-len(text) % 4)
        data = bytes(self.data) + bytes(-len(self.data) % 4)
        return (struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data))
                + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data)


def single(array):
    return np.asarray(array, np.float32)


def quaternions(axes):
    """Unit quaternions (..., 4), x y z w, of rotations (..., 3, 3) whose rows are the turned axes."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (np.moveaxis(row, -1, 0) for row in np.moveaxis(axes, -2, 0))
    squares = [[1 + xx - yy - zz, xy + yx, zx + xz, yz - zy], [xy + yx, 1 - xx + yy - zz, yz + zy, zx - xz],
               [zx + xz, yz + zy, 1 - xx - yy + zz, xy - yx], [yz - zy, zx - xz, xy - yx, 1 + xx + yy + zz]]
    squares = np.stack([np.stack(row, -1) for row in squares], -2)  # 4 q q^T
    largest = np.diagonal(squares, axis1=-2, axis2=-1).argmax(-1)
    row = np.take_along_axis(squares, largest[..., None, None], -2)[..., 0, :]
    return row / np.linalg.norm(row, axis=-1, keepdims=True)


def continuous(q):
    """Quaternions (frames, ..., 4) with the signs that are nearest to those of the frame before."""
    sign = np.where(np.sum(q[1:] * q[:-1], -1, keepdims=True) < 0, -1, 1)
    return np.concatenate([q[:1], q[1:] * np.cumprod(sign, 0)])


def influences(skin, name):
    """Joints and weights (points, 4): each edge of a point once, 0 where there are fewer."""
    if (skin.weight < 0).any():
        raise Mistake(f"the skin of rod '{name}' has weights below 0, which glTF does not know")
    edge, weight = skin.edge.copy(), single(skin.weight)
    for k in range(edge.shape[1]):
        for before in range(k):
            again = edge[:, k] == edge[:, before]
            weight[again, before] += weight[again, k]
            weight[again, k] = 0
    weight = single(weight / weight.astype(float).sum(1, keepdims=True))
    fill = ((0, 0), (0, 4 - edge.shape[1]))
    return np.pad(np.where(weight > 0, edge, 0), fill), np.pad(weight, fill)


class Scene(Document):
    """A run: `frames` are numbers of frames, `times` [s] those of the file, which start with 0."""

    def __init__(self, frames, times):
        super().__init__()
        self.frames, self.roots, self.channels, self.samplers = list(frames), [], [], []
        self.times = self.numbers(single(times), bounds=True) if len(times) > 1 else None
        self.materials = {}

    def material(self, kind):
        if kind not in self.materials:
            colour = [*linear(MATERIALS[kind]).tolist(), 1.0]
            self.materials[kind] = self.add("materials", {
                "name": kind, "doubleSided": True,
                "pbrMetallicRoughness": {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.6}})
        return self.materials[kind]

    def mesh(self, name, points, triangles, kind, more=lambda point: {}):
        """The mesh of a surface, split where it is sharp; `more`: further attributes of the points (k,) it has."""
        point, triangles = creased(points, triangles)
        normals = surface_normals(points[point], triangles)
        normals[~normals.any(1)] = 0, 0, 1  # of triangles without area
        attributes = {"POSITION": self.numbers(single(points[point]), ATTRIBUTES, bounds=True),
                      "NORMAL": self.numbers(single(normals), ATTRIBUTES)}
        attributes.update((key, self.numbers(array, ATTRIBUTES)) for key, array in more(point).items())
        corners = triangles.ravel().astype(np.uint16 if len(point) <= 65535 else np.uint32)
        return self.add("meshes", {"name": name, "primitives": [{
            "attributes": attributes, "indices": self.numbers(corners, CORNERS), "material": self.material(kind)}]})

    def animate(self, node, path, output):
        self.samplers.append({"input": self.times, "output": output, "interpolation": "LINEAR"})
        self.channels.append({"sampler": len(self.samplers) - 1, "target": {"node": node, "path": path}})

    def poses(self, rod):
        """Translations, rotations and scales of the joints, (edges, frames, 3 or 4)."""
        position, director = (np.stack([get(k) for k in self.frames]) for get in (rod.position, rod.director))
        for k, x, d in zip(self.frames, position, director):
            if not np.isfinite(x).all() or not np.isfinite(d).all():
                raise Mistake(f"frame {k} of rod '{rod.name}' is not finite: choose others by --frames")
        middle, edge, tangent, second = edge_frames(position, director)
        scale = np.ones_like(edge)
        scale[..., 0] = np.linalg.norm(edge, axis=-1) / np.linalg.norm(edge_frames(*as_drawn(rod))[1], axis=-1)
        turn = continuous(quaternions(np.stack([tangent, director, second], -2)))
        return {"translation": middle.swapaxes(0, 1), "rotation": turn.swapaxes(0, 1), "scale": scale.swapaxes(0, 1)}

    def joints(self, rod):
        """Numbers of the nodes of the edges."""
        poses = {path: single(values) for path, values in self.poses(rod).items()}
        nodes = [self.add("nodes", {"name": f"{rod.name} edge {k}",
                                    **{path: values[k, 0].tolist() for path, values in poses.items()}})
                 for k in range(rod.edges)]
        for path, values in poses.items() if self.times is not None else ():
            for node, output in zip(nodes, self.series(values)):
                self.animate(node, path, output)
        return nodes

    def rod(self, rod):
        skin, joints = surface(rod), self.joints(rod)
        skeleton = self.add("nodes", {"name": f"{rod.name} edges", "children": joints})
        middle, _, tangent, second = edge_frames(*as_drawn(rod))
        frame = np.stack([tangent, as_drawn(rod)[1], second], -2)
        points = skin.reference()
        check_places(skin, middle, frame, points, rod.name)
        edge, weight = influences(skin, rod.name)
        edge = edge.astype(np.uint8 if rod.edges <= 256 else np.uint16)
        inverse = np.zeros((rod.edges, 4, 4))  # columns one after the other, as glTF has them
        inverse[:, :3, :3], inverse[:, 3, 3] = frame.swapaxes(1, 2), 1
        inverse[:, 3, :3] = -np.einsum("eij,ej->ei", frame, middle)
        mesh = self.mesh(rod.name, points, skin.triangles, "rod",
                         lambda point: {"JOINTS_0": edge[point], "WEIGHTS_0": weight[point]})
        skinned = self.add("skins", {"name": rod.name, "joints": joints, "skeleton": skeleton,
                                     "inverseBindMatrices": self.numbers(single(inverse))})
        self.roots += [skeleton, self.add("nodes", {"name": rod.name, "mesh": mesh, "skin": skinned})]

    def thing(self, body, kind):
        """A body or collider; False for those that cannot be shown."""
        found = thing(body)
        if found is None:
            return body.shape == "none"
        at, turn = zip(*(body.pose(k) for k in self.frames))
        turn = np.roll(turn, -1, -1)
        turn = continuous(turn / np.linalg.norm(turn, axis=-1, keepdims=True))
        poses = {"translation": single(at), "rotation": single(turn)}
        node = self.add("nodes", {"name": body.name, "mesh": self.mesh(body.name, *found, kind),
                                  **{path: values[0].tolist() for path, values in poses.items()}})
        for path, values in poses.items():
            if self.times is not None and (values != values[0]).any():
                self.animate(node, path, self.numbers(values))
        self.roots.append(node)
        return True

    def bytes(self):
        self.add("scenes", {"nodes": self.roots})
        if self.channels:
            self.add("animations", {"name": "run", "channels": self.channels, "samplers": self.samplers})
        return super().bytes()


def check_places(skin, middle, frame, points, name):
    """A point of a skin of glTF has one place as drawn, whichever edges it moves with."""
    by_edge = middle[skin.edge] + np.einsum("pki,pkij->pkj", skin.local, frame[skin.edge])
    apart = np.abs(by_edge - points[:, None]).max(2)[skin.weight > 0].max()
    if not apart <= SAME * np.linalg.norm(np.ptp(points, axis=0)):
        raise Mistake(f"the skin of rod '{name}' has points whose edges place them {apart:.3g} m apart as drawn, which "
                      "glTF does not know")


def write(path, t, rods, frames, times):
    """Writes rods, bodies and colliders; returns names and shapes of those that are left out."""
    scene, left_out = Scene(frames, times), []
    for k in rods:
        scene.rod(t.rods[k])
    for things, kind in ((t.bodies, "body"), (t.colliders, "collider")):
        left_out += [f"{b.name} ({b.shape})" for b in things if not scene.thing(b, kind)]
    data = scene.bytes()
    with open(path, "wb") as f:
        f.write(data)
    return left_out
