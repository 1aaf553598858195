"""PLY, binary: a file a frame, of the surfaces of all rods with the fields of the run."""
import os

import numpy as np
from tendril_render.skins import along
from tendril_render.source import OF_OUR_OWN, fields, value

from .meshes import surface

PLACES = ("position", "position_low")  # fields that are where the points are


def names(t):
    return [n for n in fields(t) if n not in (*OF_OUR_OWN, *PLACES)]


def table(t, rods, surfaces, frame, columns):
    """The points of all surfaces, a row each."""
    kind = np.dtype([(n, "<f4") for n in ("x", "y", "z", "nx", "ny", "nz")] + [("rod", "<i4")]
                    + [(n, "<f4") for n in columns])
    parts = []
    for k, skin in zip(rods, surfaces):
        rows = np.empty(skin.points, kind)
        for n, values in zip(kind.names, [*skin.vertices(frame).T, *skin.normals(frame).T]):
            rows[n] = values
        rows["rod"] = k
        for n in columns:
            rows[n] = along(skin, value(t, n, k, frame))
        parts.append(rows)
    return np.concatenate(parts)


def faces(surfaces):
    starts = np.cumsum([0] + [skin.points for skin in surfaces])
    corners = np.concatenate([skin.triangles + start for skin, start in zip(surfaces, starts)])
    rows = np.empty(len(corners), [("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, corners
    return rows


def header(points, triangles, comment):
    kinds = {"f": "float", "i": "int"}
    lines = ["ply", "format binary_little_endian 1.0", f"comment {comment}", f"element vertex {len(points)}"]
    lines += [f"property {kinds[points.dtype[n].kind]} {n}" for n in points.dtype.names]
    lines += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    return ("\n".join(lines) + "\n").encode()


def write(folder, t, rods, frames):
    """Writes folder/frame_0000.ply and so on, by numbers of frames."""
    os.makedirs(folder, exist_ok=True)
    surfaces, columns = [surface(t.rods[k]) for k in rods], names(t)
    triangles = faces(surfaces)
    for frame in frames:
        points = table(t, rods, surfaces, frame, columns)
        with open(f"{folder}/frame_{frame:04d}.ply", "wb") as f:
            f.write(header(points, triangles, f"tendril, frame {frame}, time {t.time[frame]:.9g}"))
            f.write(points.tobytes() + triangles.tobytes())
