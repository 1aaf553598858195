"""Reads glTF 2.0 in binary files, and holds them against the rules of its specification."""
import json
import struct

import numpy as np

TYPES = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
SHAPES = {"SCALAR": (), "VEC2": (2,), "VEC3": (3,), "VEC4": (4,), "MAT4": (4, 4)}
MEMBERS = {  # of each kind: what has to be there, and what else may be
    "scenes": ("nodes", "name"), "buffers": ("byteLength", ""),
    "bufferViews": ("buffer byteLength", "byteOffset target"),
    "materials": ("pbrMetallicRoughness", "name doubleSided"), "meshes": ("primitives", "name"),
    "accessors": ("bufferView componentType count type", "byteOffset min max"),
    "nodes": ("", "name children mesh skin translation rotation scale"),
    "skins": ("joints inverseBindMatrices", "name skeleton"), "animations": ("channels samplers", "name"),
}


class Glb:
    """The JSON of a file as `json`, its buffer as `data`; a broken rule is an AssertionError."""

    def __init__(self, path):
        with open(path, "rb") as f:
            content = f.read()
        magic, version, length = struct.unpack("<4sII", content[:12])
        assert magic == b"glTF" and version == 2 and length == len(content), "header"
        chunks, at = [], 12
        while at < length:
            size, kind = struct.unpack("<I4s", content[at : at + 8])
            assert size % 4 == 0 and at + 8 + size <= length, "a chunk is not aligned or ends behind the file"
            chunks.append((kind, content[at + 8 : at + 8 + size]))
            at += 8 + size
        assert [kind for kind, _ in chunks] == [b"JSON", b"BIN\0"]
        text, self.data = (chunk for _, chunk in chunks)
        assert text.rstrip(b" ").endswith(b"}"), "JSON is filled up with spaces"
        self.json = json.loads(text, parse_constant=lambda name: 1 / 0)
        self.used = set()
        self.check()

    def list(self, kind):
        return self.json.get(kind, [])

    def get(self, kind, index):
        """What has this number, which has to be in range."""
        assert type(index) is int and 0 <= index < len(self.list(kind)), f"{kind} {index}"
        self.used.add((kind, index))
        return self.json[kind][index]

    def values(self, index):
        """The rows of an accessor."""
        a = self.get("accessors", index)
        kind, shape = np.dtype(TYPES[a["componentType"]]), SHAPES[a["type"]]
        view = self.get("bufferViews", a["bufferView"])
        start = view.get("byteOffset", 0) + a.get("byteOffset", 0)
        count = a["count"] * int(np.prod(shape))
        assert a["count"] > 0 and start % kind.itemsize == view.get("byteOffset", 0) % kind.itemsize == 0, "not aligned"
        assert a.get("byteOffset", 0) + count * kind.itemsize <= view["byteLength"], "an accessor ends behind its view"
        found = np.frombuffer(self.data, kind, count, start).reshape(a["count"], *shape)
        assert np.isfinite(found).all(), f"accessor {index} is not finite"
        if "min" in a:
            assert np.array_equal(np.atleast_1d(found.min(0)), np.array(a["min"], kind)), "min"
            assert np.array_equal(np.atleast_1d(found.max(0)), np.array(a["max"], kind)), "max"
            assert a["min"] == np.atleast_1d(found.min(0)).tolist() and a["max"] == np.atleast_1d(found.max(0)).tolist()
        return found

    def check(self):
        assert self.json["asset"]["version"] == "2.0"
        assert set(self.json) <= {*MEMBERS, "asset", "scene"}, set(self.json)
        for kind, (needed, more) in MEMBERS.items():
            assert kind not in self.json or self.json[kind], f"{kind} is empty"
            for part in self.list(kind):
                assert set(needed.split()) <= set(part) <= set((needed + " " + more).split()), (kind, part.keys())
        self.check_buffers()
        self.check_nodes()
        for mesh in self.list("meshes"):
            for primitive in mesh["primitives"]:
                self.check_primitive(primitive)
        for skin in self.list("skins"):
            self.check_skin(skin)
        for animation in self.list("animations"):
            self.check_animation(animation)
        for kind in ("nodes", "meshes", "skins", "accessors", "bufferViews", "materials"):
            assert all((kind, k) in self.used for k in range(len(self.list(kind)))), f"some of {kind} are not used"

    def check_buffers(self):
        size = self.json["buffers"][0]["byteLength"]
        assert len(self.json["buffers"]) == 1 and size <= len(self.data) < size + 4
        for view in self.list("bufferViews"):
            assert view["buffer"] == 0 and view["byteLength"] > 0 and view.get("byteOffset", 0) >= 0
            assert view.get("byteOffset", 0) + view["byteLength"] <= size, "a view ends behind the buffer"
            assert view.get("target") in (None, 34962, 34963)

    def check_nodes(self):
        parents = {}
        for k, node in enumerate(self.list("nodes")):
            for child in node.get("children", []):
                self.get("nodes", child)
                assert child not in parents, f"node {child} has two parents"
                parents[child] = k
            assert "children" not in node or node["children"]
            for path, size in (("translation", 3), ("rotation", 4), ("scale", 3)):
                assert path not in node or (len(node[path]) == size and np.isfinite(node[path]).all())
            assert abs(np.linalg.norm(node.get("rotation", [1])) - 1) < 1e-6, "a rotation that is none"
            assert "skin" not in node or ("mesh" in node and k not in parents), "a skinned mesh stands alone"
            for kind, key in (("meshes", "mesh"), ("skins", "skin")):
                if key in node:
                    self.get(kind, node[key])
        for k in range(len(self.list("nodes"))):  # no cycles
            steps = 0
            while k in parents:
                k, steps = parents[k], steps + 1
                assert steps <= len(parents), "a cycle of nodes"
        self.parents = parents
        scene = self.list("scenes")[self.json["scene"]]
        assert len(set(scene["nodes"])) == len(scene["nodes"]) and not set(scene["nodes"]) & set(parents)
        for k in scene["nodes"]:
            self.get("nodes", k)

    def check_primitive(self, p):
        assert set(p) <= {"attributes", "indices", "material", "mode"} and p.get("mode", 4) == 4
        found = {key: self.values(k) for key, k in p["attributes"].items()}
        assert {"POSITION", "NORMAL"} <= set(found) <= {"POSITION", "NORMAL", "JOINTS_0", "WEIGHTS_0"}
        assert "min" in self.json["accessors"][p["attributes"]["POSITION"]], "POSITION needs bounds"
        n = len(found["POSITION"])
        kinds = {"POSITION": ["<f4"], "NORMAL": ["<f4"], "WEIGHTS_0": ["<f4"], "JOINTS_0": ["u1", "<u2"]}
        for key, v in found.items():
            assert len(v) == n and v.dtype in [np.dtype(k) for k in kinds[key]] and v[0].nbytes % 4 == 0, key
            view = self.json["accessors"][p["attributes"][key]]["bufferView"]
            assert self.json["bufferViews"][view].get("target") == 34962
        assert np.abs(np.linalg.norm(found["NORMAL"].astype(float), axis=1) - 1).max() < 1e-6
        indices = self.values(p["indices"])
        assert indices.dtype in (np.dtype("<u2"), np.dtype("<u4")) and indices.ndim == 1 and len(indices) % 3 == 0
        assert indices.max() < n and indices.max() < np.iinfo(indices.dtype).max, "a corner out of range"
        view = self.json["accessors"][p["indices"]]["bufferView"]
        assert self.json["bufferViews"][view].get("target") == 34963
        material = self.get("materials", p["material"])["pbrMetallicRoughness"]
        assert len(material["baseColorFactor"]) == 4 and all(0 <= v <= 1 for v in material["baseColorFactor"])
        assert 0 <= material["metallicFactor"] <= 1 and 0 <= material["roughnessFactor"] <= 1
        assert ("JOINTS_0" in found) == ("WEIGHTS_0" in found)
        if "JOINTS_0" in found:
            self.check_influences(found["JOINTS_0"], found["WEIGHTS_0"].astype(float))

    @staticmethod
    def check_influences(joints, weights):
        assert (weights >= 0).all() and np.abs(weights.sum(1) - 1).max() < 1e-6
        assert (joints[weights == 0] == 0).all(), "joints without weight are 0"
        for a in range(4):
            for b in range(a):
                assert not ((joints[:, a] == joints[:, b]) & (weights[:, a] > 0) & (weights[:, b] > 0)).any(), "twice"

    def check_skin(self, skin):
        joints = skin["joints"]
        assert len(set(joints)) == len(joints) > 0
        for k in joints:
            self.get("nodes", k)
            assert self.parents[k] == skin["skeleton"], "joints have one root"
        inverse = self.values(skin["inverseBindMatrices"])
        assert inverse.shape == (len(joints), 4, 4)
        assert (inverse[:, :, 3] == [0, 0, 0, 1]).all(), "the last row of a matrix, which is there by columns"
        for node in self.list("nodes"):
            if "skin" in node and self.json["skins"][node["skin"]] is skin:
                for p in self.json["meshes"][node["mesh"]]["primitives"]:
                    assert self.values(p["attributes"]["JOINTS_0"]).max() < len(joints), "a joint out of range"

    def check_animation(self, animation):
        targets = set()
        for sampler in animation["samplers"]:
            assert set(sampler) == {"input", "output", "interpolation"} and sampler["interpolation"] == "LINEAR"
            times = self.values(sampler["input"])
            assert times.dtype == np.float32 and times[0] >= 0 and (np.diff(times) > 0).all(), "times"
            assert "min" in self.json["accessors"][sampler["input"]]
            assert len(self.values(sampler["output"])) == len(times)
        for channel in animation["channels"]:
            assert set(channel) == {"sampler", "target"} and 0 <= channel["sampler"] < len(animation["samplers"])
            node, path = channel["target"]["node"], channel["target"]["path"]
            self.get("nodes", node)
            assert path in ("translation", "rotation", "scale") and (node, path) not in targets
            targets.add((node, path))
            output = self.values(animation["samplers"][channel["sampler"]]["output"]).astype(float)
            assert output.shape[1:] == ((4,) if path == "rotation" else (3,)) and output.dtype == float
            if path == "rotation":
                assert np.abs(np.linalg.norm(output, axis=1) - 1).max() < 1e-6, "a quaternion that is no rotation"
                assert ((output[1:] * output[:-1]).sum(1) >= 0).all(), "a turn the long way round"
        assert {c["sampler"] for c in animation["channels"]} == set(range(len(animation["samplers"])))

    # What moves.

    def times(self):
        animations = self.list("animations")
        return self.values(animations[0]["samplers"][0]["input"]) if animations else np.zeros(1)

    def node(self, name):
        return next(k for k, node in enumerate(self.json["nodes"]) if node.get("name") == name)

    def matrix(self, k, frame):
        """The transform (4, 4) of a node at a key frame, without those above it."""
        pose = {"translation": [0, 0, 0], "rotation": [0, 0, 0, 1], "scale": [1, 1, 1],
                **{key: v for key, v in self.json["nodes"][k].items() if key in ("translation", "rotation", "scale")}}
        for path, sampler in self.channels().get(k, {}).items():
            pose[path] = self.values(sampler["output"])[frame].astype(float)
        x, y, z, w = pose["rotation"]
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = turn * pose["scale"], pose["translation"]
        return m

    def channels(self):
        if not hasattr(self, "_channels"):
            self._channels = {}
            for animation in self.list("animations"):
                for c in animation["channels"]:
                    target = self._channels.setdefault(c["target"]["node"], {})
                    target[c["target"]["path"]] = animation["samplers"][c["sampler"]]
        return self._channels

    def mesh(self, name):
        """The one primitive of a node's mesh: attributes by name, and corners of triangles (m, 3)."""
        p, = self.json["meshes"][self.json["nodes"][self.node(name)]["mesh"]]["primitives"]
        return ({key: self.values(a) for key, a in p["attributes"].items()},
                self.values(p["indices"]).astype(int).reshape(-1, 3))

    def corners(self, name, frame):
        """Corners (m, 3, 3) of the triangles of a node at a key frame: by its joints, or as a whole."""
        found, corners = self.mesh(name)
        x = np.concatenate([found["POSITION"].astype(float), np.ones((len(found["POSITION"]), 1))], 1)
        node = self.json["nodes"][self.node(name)]
        if "skin" not in node:
            return (x @ self.matrix(self.node(name), frame).T)[corners, :3]
        skin = self.json["skins"][node["skin"]]
        inverse = self.values(skin["inverseBindMatrices"]).astype(float).swapaxes(1, 2)
        joint = np.stack([self.matrix(k, frame) for k in skin["joints"]]) @ inverse
        blend = np.einsum("pk,pkij->pij", found["WEIGHTS_0"].astype(float), joint[found["JOINTS_0"]])
        return np.einsum("pij,pj->pi", blend, x)[corners, :3]
