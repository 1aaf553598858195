#!/usr/bin/python3
"""Every mistake ends before the first step, with a message that names the place: bad_input.py <tendril> [-v]; -v prints every message."""
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import h5py

program = os.path.abspath(sys.argv[1])
base = """gravity: [0, -9.81, 0]
simulation: {dt: 0.01, t_end: 0.02}
rods:
  - name: a
    line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}
    material: {radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}
supports:
  - {vertex: 0, type: clamp}
"""
shape = "line: {from: [0, 0, 0], to: [1, 0, 0], edges: 4}"

support = "  - {vertex: 0, type: clamp}"

# Beside the scene of every row: files that a scene or an option may name.
files = {
    "file": b"",
    "empty.yaml": b"",
    "comment.yaml": b"# nothing but a comment\n",
    "list.yaml": b"- a\n- b\n",
    "two.yaml": base.encode() + b"---\nrods: []\n",
    "binary.yaml": bytes(range(256)),
    "latin.yaml": "n\u00e4me: 1\n".encode("latin-1"),
    "bad.csv": b"0,0,0\n1,x,0\n",
    "nan.csv": b"0 0 0\n1 nan 0\n",
    "huge.csv": b"0 0 0\n1e400 0 0\n",
    "two.csv": b"0,0,0\n1,0\n",
    "four.csv": b"0,0,0\n1,0,0,5\n",
    "one.csv": b"0 0 0\n1 0 0\n\n2 0 0\n\n3 0 0\n4 0 0\n",
    "empty.csv": b"# x, y, z\n",
    "zero.csv": b"0 0 0\n1\0 0 0\n",
    "far.csv": b"0 0 0\n1e200 0 0\n",
    "rod.stl": b"solid\n",
    "index.obj": b"v 0 0 0\nv 1 0 0\nl 1 3\n",
    "word.obj": b"v 0 0 0\nv 1 0 0\nl 1 2x\n",
    "alone.obj": b"v 0 0 0\nl 1\n",
    "branch.obj": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nv 1 1 0\nl 1 2\nl 2 3\nl 2 4\n",
    "loop.obj": b"v 0 0 0\nv 1 0 0\nl 1 1\n",
    "comma.yaml": b",\n",
    "comma_list.yaml": b"[1],",
    "deep.yaml": b"[" * 5000,
    "alias.yaml": b"rods: &a [*a]\n",
    "open.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "missing.obj": b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n",
    "points.obj": b"v 0 0 0\nv 1 0 0\n",
    "cut.stl": bytes(80) + (12).to_bytes(4, "little") + bytes(150),
    "facet.stl": b"solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n",
    "text.h5": b"no HDF5\n",
    "broken.yaml": b"dt: [1\n",
    "documents.yaml": b"dt: 1e-3\n---\ndt: 2e-3\n",
    "crowded.txt": b"-dt 1e-2 -t_end 0.03\n",
    "twice.yaml": b"dt: 1e-3\nt_end: 1\ndt: 2e-3\n",
    "nested.yaml": b"snes: {rtol: 1e-8}\nsnes_rtol: 1e-9\n",
    "unknown.yaml": b"# one wrong\nt_end: 0.02\nsnes_rtl: 1e-8\n",
    "value.yaml": b"t_end: 0.02\ndt: fast\n",
    "override.yaml": b"rod_young: -1\n",
    "limit.yaml": b"snes_max_it: abc\n",
    "stol.yaml": b"snes_stol: abc\n",
    "solver.yaml": b"t_end: 0.02\npc_type: nosuch\n",
    "solver.txt": b"-ksp_type nosuch\n",
    "lag.yaml": b"snes_lag_jacobian: -5\n",
    "dash.yaml": b"-dt: 1e-3\n",
    "other.yaml": b"options_file: value.yaml\n",
    "case.yaml": b"t_end: 0.02\nscene: data/scenes/helix.yaml\n",
    "mumps.yaml": b"mat_mumps_icntl_24: 1\n",
    "plain.txt": b"# PETSc's older format\n-t_end 0.02\n-dt fast\n",
    "plain": b"dt: 1e-3\n",
}


def writeHdf5(folder):
    for name, datasets in (
        ("no_position.h5", {"points": [[0.0, 0, 0], [1, 0, 0]]}),
        ("flat.h5", {"position": [0.0, 1, 2, 3]}),
        ("nan.h5", {"position": [[0.0, 0, 0], [1, 0, float("nan")]]}),
        ("offsets.h5", {"position": [[0.0, 0, 0], [1, 0, 0]], "rod_vertex_offsets": [0, 5]}),
        ("words.h5", {"position": [["a", "b", "c"]]}),
        ("closed.h5", {"position": [[0.0, 0, 0], [1, 0, 0]], "closed": [0, 1]}),
    ):
        with h5py.File(f"{folder}/{name}", "w") as f:
            for key, values in datasets.items():
                f[key] = values
    for name, rows_declared in (("huge.h5", 10**12), ("hollow.h5", 20_000_000)):
        with h5py.File(f"{folder}/{name}", "w") as f:
            f.create_dataset("position", shape=(rows_declared, 3), dtype="f8", chunks=(1000, 3))
    with open(f"{folder}/large.yaml", "wb") as f:
        f.truncate(65_000_000)


def rod(shape_text):
    return (shape, shape_text)


def motion(text, kind="clamp"):
    return (support, f"  - {{vertex: 0, type: {kind}, motion: {text}}}")


# name, (old, new) edit of the base scene or None, options, parts of the message
rows = [
    ("unknown key", ("gravity:", "gravitty:"), [], ["scene.yaml:1", "gravitty", "did you mean 'gravity'"]),
    ("unknown key in a rod", ("name: a", "nam: a"), [], ["scene.yaml:4", "'nam'", "name"]),
    ("unknown key in a material", ("young", "yuong"), [], ["scene.yaml:6", "needs the key 'young'", "found 'yuong'"]),
    ("unknown key in a support", ("type: clamp", "type: clamp, colour: red"), [], ["scene.yaml:8", "colour"]),
    ("wrong type", ("young: 1e7", "young: stiff"), [], ["scene.yaml:6", "'young' must be a number", "'stiff'"]),
    ("rubbish after a number", ("1e7", "1e7Pa"), [], ["scene.yaml:6", "1e7Pa"]),
    ("list for a number", ("young: 1e7", "young: [1, 2]"), [], ["scene.yaml:6", "a list of 2"]),
    ("number for a list", ("[0, -9.81, 0]", "9.81"), [], ["scene.yaml:1", "list of 3 numbers"]),
    ("not finite", ("-9.81", ".nan"), [], ["scene.yaml:1", "finite"]),
    ("infinite", ("1e7", ".inf"), [], ["scene.yaml:6", "finite"]),
    ("negative stiffness", ("1e7", "-1e7"), [], ["scene.yaml:6", "greater than zero"]),
    ("negative density", ("density: 1000", "density: -1"), [], ["scene.yaml:6", "greater than zero"]),
    ("Poisson's ratio", ("0.3", "0.7"), [], ["scene.yaml:6", "poisson"]),
    ("zero-length edge", (shape, "points: [[0, 0, 0], [1, 0, 0], [1, 0, 0], [2, 0, 0]]"), [], ["scene.yaml:4", "edge 1", "zero length"]),
    ("folded edges", (shape, "points: [[0, 0, 0], [1, 0, 0], [0.2, 0, 0]]"), [], ["scene.yaml:4", "folds back", "vertex 1"]),
    ("director not normal", (shape, shape + "\n    director: [1, 1, 0]"), [], ["scene.yaml:6", "not normal"]),
    ("number of directors", (shape, shape + "\n    directors: [[0, 1, 0]]"), [], ["scene.yaml:6", "one vector per edge"]),
    ("vertex out of range", ("vertex: 0", "vertex: 9"), [], ["scene.yaml:8", "out of range", "0 to 4"]),
    ("negative vertex", ("vertex: 0", "vertex: -1"), [], ["scene.yaml:8", "not be negative"]),
    ("unknown rod", ("{vertex: 0", "{rod: b, vertex: 0"), [], ["scene.yaml:8", "no rod 'b'"]),
    ("held twice", ("  - {vertex: 0, type: clamp}", "  - {vertex: 0, type: clamp}\n  - {vertex: 0, type: pin}"), [], ["scene.yaml:9", "held twice"]),
    ("constraint without a stiffness", (support, support + "\nconstraints: [{type: pin, vertex: 4}]"), [], ["scene.yaml:9", "'stiffness' is missing", "support of 'type: pin'"]),
    ("constraint of no kind", (support, support + "\nconstraints: [{type: weld, vertex: 4, stiffness: 1}]"), [], ["scene.yaml:9", "pin", "rotation"]),
    ("constraint to a body", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: 1, to: cube}]"), [], ["scene.yaml:9", "world"]),
    ("two ends that are held", (support, support + "\n  - {vertex: 4, type: pin}\nconstraints: [{type: pin, vertex: 4, stiffness: 1, to: {vertex: 0}}]"), [], ["scene.yaml:10", "supports hold vertex 4", "vertex 0"]),
    ("constraint on a held vertex", (support, support + "\nconstraints: [{type: pin, vertex: 0, stiffness: 1}]"), [], ["scene.yaml:9", "held by a support"]),
    ("constraint of nothing", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: 0}]"), [], ["scene.yaml:9", "nothing is constrained"]),
    ("negative stiffness", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: -1}]"), [], ["scene.yaml:9", "must not be negative"]),
    ("stiffness not a number", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: .nan}]"), [], ["scene.yaml:9", "finite"]),
    ("negative damping", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: 1, damping: -1}]"), [], ["scene.yaml:9", "must not be negative"]),
    ("saturation of zero", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: 1, saturation: 0}]"), [], ["scene.yaml:9", "'saturation' must be positive"]),
    ("saturation of the sine", (support, support + "\nconstraints: [{type: rotation, edge: 3, stiffness: 1, saturation: 1, measure: sine}]"), [], ["scene.yaml:9", "measure: angle"]),
    ("constraint out of range", (support, support + "\nconstraints: [{type: rotation, edge: 4, stiffness: 1}]"), [], ["scene.yaml:9", "out of range", "0 to 3"]),
    ("pin on an edge", (support, support + "\nconstraints: [{type: pin, edge: 3, vertex: 4, stiffness: 1}]"), [], ["scene.yaml:9", "'edge' is for 'type: rotation'"]),
    ("rotation of a vertex", (support, support + "\nconstraints: [{type: rotation, edge: 3, point: [0, 0, 0], stiffness: 1}]"), [], ["scene.yaml:9", "'point' is for 'type: pin'"]),
    ("closest to nothing", (support, support + "\nconstraints: [{type: pin, closest: true, stiffness: 1}]"), [], ["scene.yaml:9", "'closest' needs the 'point'"]),
    ("closest and a vertex", (support, support + "\nconstraints: [{type: pin, closest: true, point: [1, 0, 0], vertex: 2, stiffness: 1}]"), [], ["scene.yaml:9", "not both"]),
    ("frame turned back", (support, support + "\nconstraints: [{type: rotation, edge: 3, tangent: [-1, 0.01, 0], stiffness: 1}]"), [], ["scene.yaml:9", "half a turn", "measure: sine"]),
    ("frame against its edge", (support, support + "\nconstraints: [{type: rotation, edge: 3, tangent: [-1, 0, 0], stiffness: 1}]"), [], ["scene.yaml:9", "points against edge 3"]),
    ("director of a constraint", (support, support + "\nconstraints: [{type: rotation, edge: 3, director: [1, 1, 0], stiffness: 1}]"), [], ["scene.yaml:9", "not normal"]),
    ("pin that turns", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffness: 1, motion: {angular_velocity: [1, 0, 0]}}]"), [], ["scene.yaml:9", "a pin turns nothing"]),
    ("rotation that moves", (support, support + "\nconstraints: [{type: rotation, edge: 3, stiffness: 1, motion: {velocity: [1, 0, 0]}}]"), [], ["scene.yaml:9", "a rotation moves nothing"]),
    ("constraint named twice", (support, support + "\nconstraints: [{name: a, type: pin, vertex: 4, stiffness: 1}, {name: a, type: pin, vertex: 3, stiffness: 1}]"), [], ["scene.yaml:9", "name 'a' is there already"]),
    ("rotation of a cable", ("density: 1000}\n" + "supports:\n" + support, "density: 1000, flexural_stiffness: 0}\nsupports:\n  - {vertex: 0, type: pin}\nconstraints: [{type: rotation, edge: 3, stiffness: 1}]"), [], ["scene.yaml:9", "no flexural stiffness"]),
    ("constraint that moves along a path", (support, support + "\nconstraints: [{name: a, type: pin, vertex: 4, stiffness: 1, motion: {velocity: [1, 0, 0]}}]"), ["-mode", "static", "-continuation", "arclength"], ["constraint 'a' moves"]),
    ("rotation inside a rod drawn again", (support, support + "\nconstraints: [{type: rotation, edge: 1, stiffness: 1}]"), ["-rod_edges", "8"], ["-rod_edges", "odd multiple of 4"]),
    ("misspelt stiffness of a constraint", (support, support + "\nconstraints: [{type: pin, vertex: 4, stiffnes: 4}]"), [], ["scene.yaml:9", "unknown key 'stiffnes'", "did you mean 'stiffness'"]),
    ("pin nowhere", (support, support + "\nconstraints: [{type: pin, point: [1, 0, 0], stiffness: 4}]"), [], ["scene.yaml:9", "'closest: true'"]),
    ("constraint of no name", (support, support + "\nconstraints: [{name: '', type: pin, vertex: 4, stiffness: 1}]"), [], ["scene.yaml:9", "'name'"]),
    ("pin that holds nothing", (support, "  - {vertex: 0, type: fix_twist}\nconstraints: [{type: pin, vertex: 4, stiffness: 0, damping: 1}]"), ["-mode", "static"], ["free to move as a whole"]),
    ("estimated error of a rotation", (support, support + "\nconstraints: [{name: a, type: rotation, edge: last, stiffness: 1}]"), ["-mode", "static", "-error_estimate"], ["-error_estimate", "constraint 'a'"]),
    ("accuracy of a rotation", (support, support + "\nconstraints: [{name: a, type: rotation, edge: last, stiffness: 1}]"), ["-mode", "static", "-accuracy", "1e-3"], ["-accuracy", "constraint 'a'"]),
    ("collider without a shape", (support, support + "\ncolliders: [{name: floor}]"), [], ["scene.yaml:9", "needs a shape: plane, sphere"]),
    ("collider of two shapes", (support, support + "\ncolliders: [{plane: {}, sphere: {radius: 1}}]"), [], ["scene.yaml:9", "two shapes, 'plane' and 'sphere'"]),
    ("collider of an unknown shape", (support, support + "\ncolliders: [{spere: {radius: 1}}]"), [], ["scene.yaml:9", "unknown key 'spere'", "did you mean 'sphere'"]),
    ("sphere without a radius", (support, support + "\ncolliders: [{sphere: {}}]"), [], ["scene.yaml:9", "'radius'"]),
    ("sphere of no size", (support, support + "\ncolliders: [{sphere: {radius: 0}}]"), [], ["scene.yaml:9", "greater than zero"]),
    ("box of no size", (support, support + "\ncolliders: [{box: {size: [1, 0, 1]}}]"), [], ["scene.yaml:9", "'size' must be positive"]),
    ("tube inside out", (support, support + "\ncolliders: [{tube: {bore: 0.1, outer: 0.05}}]"), [], ["scene.yaml:9", "'outer' must be larger than 'bore'"]),
    ("plane without a normal", (support, support + "\ncolliders: [{plane: {normal: [0, 0, 0]}}]"), [], ["scene.yaml:9", "'normal' must not be zero"]),
    ("mesh of no file", (support, support + "\ncolliders: [{mesh: {file: none.obj}}]"), [], ["none.obj", "cannot be opened"]),
    ("mesh of another kind", (support, support + "\ncolliders: [{mesh: {file: two.csv}}]"), [], ["two.csv", ".obj or .stl"]),
    ("mesh without triangles", (support, support + "\ncolliders: [{mesh: {file: points.obj}}]"), [], ["points.obj", "has no triangles"]),
    ("mesh that is cut off", (support, support + "\ncolliders: [{mesh: {file: cut.stl}}]"), [], ["cut.stl", "12 triangles", "684 bytes", "234", "cut off"]),
    ("mesh that ends in a facet", (support, support + "\ncolliders: [{mesh: {file: facet.stl}}]"), [], ["facet.stl", "within a facet"]),
    ("mesh that is open", (support, support + "\ncolliders: [{mesh: {file: open.obj}}]"), [], ["open.obj", "edge"]),
    ("mesh of missing vertices", (support, support + "\ncolliders: [{mesh: {file: missing.obj}}]"), [], ["missing.obj:4", "there are 3"]),
    ("collider named twice", (support, support + "\ncolliders: [{name: a, plane: {}, position: [0, -1, 0]}, {name: a, plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "name 'a' is there already"]),
    ("rod in an obstacle", (support, support + "\ncolliders: [{name: floor, plane: {}, position: [0, 0.5, 0]}]"), [], ["deep in collider 'floor'", "at arc length", "contact: none"]),
    ("negative friction", (support, support + "\ncontact: {friction: -0.1}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "must not be negative"]),
    ("threshold of a barrier", (support, support + "\ncontact: {threshold: 1e-3}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "'threshold' is for 'law: penalty'"]),
    ("distance of a penalty", (support, support + "\ncontact: {law: penalty, distance: 1e-3}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "'distance' is for 'law: barrier'"]),
    ("barrier wider than the rod", (support, support + "\ncontact: {distance: 1}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["'distance'", "must not exceed its radius"]),
    ("barrier without a radius", (support, support + "\ncontact: {radius: 0}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["contact radius 0", "law: penalty"]),
    ("law of no kind", (support, support + "\ncontact: {law: hard}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "barrier", "penalty"]),
    ("option of contact without colliders", None, ["-contact_friction", "0.1"], ["-contact_friction", "no 'colliders'"]),
    ("option of contact below zero", None, ["-contact_stiffness", "-3"], ["-contact_stiffness", "greater than zero"]),
    ("option of contact as a word", None, ["-contact_distance", "wide"], ["-contact_distance", "number"]),
    ("contact without colliders", (support, support + "\ncontact: {friction: 0.1}"), [], ["scene.yaml:9", "'contact' has nothing to act on", "colliders"]),
    ("stick of no kind", (support, support + "\ncontact: {stick: glue}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "creep", "anchored"]),
    ("ignored rods that are not there", (support, support + "\ncontact: {ignore: [{rods: hair, colliders: all}]}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "no rod has the name or layer 'hair'"]),
    ("ignored colliders that are not there", (support, support + "\ncontact: {ignore: [{rods: all, colliders: wall}]}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "no collider has the name or layer 'wall'"]),
    ("ignored pair without colliders", (support, support + "\ncontact: {ignore: [{rods: all}]}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9", "'colliders'"]),
    ("ignored pair as words", (support, support + "\ncontact: {ignore: [all]}\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), [], ["scene.yaml:9"]),
    ("layer without a name", (support, support + "\ncolliders: [{plane: {}, position: [0, -1, 0], layer: ''}]"), [], ["scene.yaml:9", "neither empty"]),
    ("contact of a rod by a number", ("density: 1000}\n" + "supports:\n" + support, "density: 1000}\n    contact: 3\nsupports:\n" + support), [], ["'contact'", "none"]),
    ("accuracy among obstacles", (support, support + "\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), ["-mode", "static", "-accuracy", "1e-3"], ["-accuracy", "colliders"]),
    ("path among obstacles", (support, support + "\ncolliders: [{plane: {}, position: [0, -1, 0]}]"), ["-mode", "static", "-continuation", "arclength"], ["-continuation arclength", "colliders"]),
    ("pin to a vertex of no rod", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {rod: b, vertex: 0}, stiffness: 1}]"), [], ["scene.yaml:9", "'b'"]),
    ("pin to a vertex that is not there", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: 5}, stiffness: 1}]"), [], ["scene.yaml:9", "out of range", "0 to 4"]),
    ("pin to itself", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: last}, stiffness: 1}]"), [], ["scene.yaml:9", "both ends are vertex 4"]),
    ("pin to no vertex", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {rod: a}, stiffness: 1}]"), [], ["scene.yaml:9", "closest: true"]),
    ("pin to a vertex and to the closest", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: 1, closest: true}, stiffness: 1}]"), [], ["scene.yaml:9", "not both"]),
    ("rotation to a vertex", (support, support + "\nconstraints: [{type: rotation, edge: 3, to: {vertex: 1}, stiffness: 1}]"), [], ["scene.yaml:9", "for 'type: pin'"]),
    ("pin to a vertex and to a point", (support, support + "\nconstraints: [{type: pin, vertex: 4, point: [0, 0, 0], to: {vertex: 1}, stiffness: 1}]"), [], ["scene.yaml:9", "'point' is for a constraint 'to: world'"]),
    ("pin to a vertex that moves by itself", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: 1}, motion: {velocity: [1, 0, 0]}, stiffness: 1}]"), [], ["scene.yaml:9", "'motion' is for"]),
    ("misspelt vertex of the other end", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertx: 1}, stiffness: 1}]"), [], ["scene.yaml:9", "vertx"]),
    ("exact pin to a vertex", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: 1}}]"), [], ["scene.yaml:9", "'stiffness' is missing", "junction of 'type: ball'"]),
    ("pin to a list", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: [0, 1], stiffness: 1}]"), [], ["scene.yaml:9", "'to' must be world, or a map"]),
    ("accuracy of rods that pins join", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: 1}, stiffness: 1}]"), ["-mode", "static", "-accuracy", "1e-3"], ["-accuracy", "join"]),
    ("rods that pins join, one by one", (support, support + "\nconstraints: [{type: pin, vertex: 4, to: {vertex: 1}, stiffness: 1}]"), ["-pc_factor_mat_solver_type", "banded"], ["-pc_factor_mat_solver_type", "woodbury"]),
    ("unknown key of a constraint", (support, support + "\nconstraints: [{type: pin, vertex: 4, stifness: 1}]"), [], ["scene.yaml:9", "stiffness"]),
    ("no shape", (shape, "closed: false"), [], ["scene.yaml:4", "exactly one shape"]),
    ("poisson and shear", ("poisson: 0.3", "poisson: 0.3, shear: 1e6"), [], ["scene.yaml:6", "found both"]),
    ("neither poisson nor shear", ("poisson: 0.3, ", ""), [], ["scene.yaml:6", "found none"]),
    ("missing polyline", (shape, "file: nowhere.csv"), [], ["nowhere.csv", "cannot be opened"]),
    ("bad polyline", (shape, "file: bad.csv"), [], ["bad.csv:2", "'x' is not a number"]),
    ("not YAML", ("rods:", "rods: ]"), [], ["scene.yaml:3", "not valid YAML"]),
    ("missing scene", None, ["-scene", "nowhere.yaml"], ["nowhere.yaml", "cannot be opened"]),
    ("unknown option", None, ["-dtt", "1"], ["-dtt", "unknown"]),
    ("misspelt override", None, ["-rod_yuong", "1e6"], ["-rod_yuong", "did you mean -rod_young"]),
    ("override without rod_", None, ["-young", "1e6"], ["-young", "did you mean -rod_young"]),
    ("override not a number", None, ["-rod_young", "abc"], ["-rod_young", "'abc'"]),
    ("negative override", None, ["-rod_young", "-1"], ["-rod_young", "greater than zero"]),
    ("zero step", None, ["-dt", "0"], ["-dt", "greater than zero"]),
    ("negative end", None, ["-t_end", "-1"], ["-t_end", "greater than zero"]),
    ("load steps in dynamics", None, ["-load_steps", "3"], ["-load_steps", "no meaning"]),
    ("step in statics", None, ["-mode", "static", "-dt", "0.1"], ["-dt", "no meaning"]),
    ("unknown field", None, ["-output_fields", "colour"], ["-output_fields", "colour", "all,position,director", "curvature,twist,strain_energy_density,force,moment"]),
    ("field misspelt in a list", None, ["-output_fields", "all,momnet"], ["-output_fields", "'momnet'", "moment"]),
    ("rotation in dynamics", ("gravity:", "rotation: {angular_velocity: [0, 0, 1]}\ngravity:"), [], ["'rotation'", "-mode static"]),
    ("rotation without speed", ("gravity:", "rotation: {centre: [0, 0, 1]}\ngravity:"), ["-mode", "static"], ["scene.yaml:1", "angular_velocity"]),
    ("gravity of two", None, ["-gravity", "0,1"], ["-gravity", "three numbers"]),
    ("gravity of four", None, ["-gravity", "0,1,2,3"], ["-gravity", "three numbers"]),
    ("step without a value", None, ["-dt", "-t_end", "1"], ["-dt", "needs a value"]),
    ("step that is a word", None, ["-dt", "fast"], ["-dt", "'fast' is not a number"]),
    ("unit behind a number", None, ["-t_end", "1s"], ["-t_end", "'1s' is not a number"]),
    ("mode misspelt", None, ["-mode", "dynamics"], ["-mode", "did you mean 'dynamic'"]),
    ("retraction unknown", None, ["-retraction", "none"], ["-retraction", "additive, length"]),
    ("hessian unknown", None, ["-hessian", "newton"], ["-hessian", "exact, gauss_newton"]),
    ("integrator unknown", None, ["-integrator", "bdf4"], ["-integrator", "euler, bdf2, bdf3, sdirk2, sdirk23, sdirk33, midpoint, symplectic2, energy_momentum, generalized_alpha", "bdf2"]),
    ("adapted steps in statics", None, ["-mode", "static", "-dt_adapt", "error"], ["-dt_adapt", "static"]),
    ("rho_inf too large", None, ["-integrator", "generalized_alpha", "-rho_inf", "2"], ["-rho_inf", "[0, 1]"]),
    ("rho_inf of another method", None, ["-rho_inf", "0.5"], ["-rho_inf", "generalized_alpha"]),
    ("rounding tolerance of nothing", None, ["-rounding_tolerance", "0"], ["-rounding_tolerance", "(0, 1)"]),
    ("rounding tolerance of all", None, ["-rounding_tolerance", "1"], ["-rounding_tolerance", "(0, 1)"]),
    ("rounding tolerance in words", None, ["-rounding_tolerance", "little"], ["-rounding_tolerance", "not a number"]),
    ("tolerance without adapted steps", None, ["-dt_rtol", "1e-3"], ["-dt_rtol", "-dt_adapt error"]),
    ("stray word", None, ["extra"], ["'extra' belongs to no option"]),
    ("option without its dash", None, ["dt", "1e-3"], ["'dt' belongs to no option"]),
    ("empty folder", None, ["-output_dir", ""], ["-output_dir", "needs a value"]),
    ("empty list of fields", None, ["-output_fields", ""], ["-output_fields", "needs a value"]),
    ("steps without end", None, ["-dt", "1e-20"], ["-dt", "never reaches the end"]),
    ("half a load step", None, ["-mode", "static", "-load_steps", "1.5"], ["-load_steps", "whole number"]),
    ("tolerance of nothing", None, ["-snes_rtol", "-1"], ["-snes_rtol", "(0, 1]"]),
    ("no such solver", None, ["-pc_type", "nosuch"], ["option -pc_type: setting up the solvers", "nosuch"]),
    ("another nonlinear solver", None, ["-snes_type", "ksponly"], ["option -snes_type: is always newtonls"]),
    ("no matrix", None, ["-snes_mf"], ["option -snes_mf: is not for rods"]),
    ("a search without its function", None, ["-snes_linesearch_type", "shell"], ["option -snes_linesearch_type: shell needs"]),
    ("no such factorisation", None, ["-pc_factor_mat_solver_type", "nosuch"], ["option -pc_factor_mat_solver_type: setting up the solvers", "nosuch"]),
    ("file of a monitor", None, ["-snes_monitor", "ascii:/nowhere/x"], ["option -snes_monitor: setting up the solvers", "/nowhere/x"]),
    ("word that PETSc has for a switch", None, ["-on_error_abort", "maybe"], ["option -on_error_abort: command line", "maybe"]),
    ("limit that is a word", None, ["-snes_max_it", "abc"], ["-snes_max_it", "'abc' is not a number"]),
    ("tolerance that is a word", None, ["-snes_rtol", "abc"], ["-snes_rtol", "abc"]),
    ("no checkpoint", None, ["-restart", "nowhere.h5"], ["-restart", "there is no checkpoint 'nowhere.h5'"]),
    ("checkpoint of nothing", None, ["-restart", "file"], ["file", "not a readable HDF5 file"]),
    ("half a checkpoint interval", None, ["-checkpoint_interval", "0.5"], ["-checkpoint_interval", "whole number"]),
    ("unwritable folder", None, ["-output_dir", "file/out"], ["-output_dir", "cannot be written"]),
    # the file as a whole
    ("empty scene", None, ["-scene", "empty.yaml"], ["empty.yaml:1", "is empty", "rods"]),
    ("scene of a comment", None, ["-scene", "comment.yaml"], ["comment.yaml:1", "is empty"]),
    ("scene is a list", None, ["-scene", "list.yaml"], ["list.yaml:1", "must be a map", "a list of 2"]),
    ("scene is a folder", None, ["-scene", "."], [".: is a folder", "-scene"]),
    ("two documents", None, ["-scene", "two.yaml"], ["two.yaml:10", "second document"]),
    ("binary scene", None, ["-scene", "binary.yaml"], ["binary.yaml:1", "0x00 is no text", "UTF-8"]),
    ("Latin letters", None, ["-scene", "latin.yaml"], ["latin.yaml:1", "0xE4 is no text", "UTF-8"]),
    ("a comma", None, ["-scene", "comma.yaml"], ["comma.yaml:1", "not valid YAML"]),
    ("a comma behind a list", None, ["-scene", "comma_list.yaml"], ["comma_list.yaml:1", "not valid YAML"]),
    ("lists within lists", None, ["-scene", "deep.yaml"], ["deep.yaml:1", "more than 32"]),
    ("an alias of itself", None, ["-scene", "alias.yaml"], ["alias.yaml:1", "alias"]),
    ("a scene of 65 MB", None, ["-scene", "large.yaml"], ["large.yaml", "64000000", "polyline files"]),
    ("escape sequence in a scene", ("type: clamp", 'type: "\\e[2J"'), [], ["scene.yaml:8", "'\\x1B[2J'"]),
    ("escape sequence in an option", None, ["-rod_edges", "\x1b[2J:3"], ["-rod_edges", "'\\x1B[2J'"]),
    ("key twice", ("gravity:", "gravity: [0, 0, 0]\ngravity:"), [], ["scene.yaml:2", "'gravity'", "second time", "line 1"]),
    ("key twice in a rod", ("name: a", "name: a\n    name: b"), [], ["scene.yaml:5", "'name'", "second time"]),
    ("tab for blanks", ("  - name", "\t- name"), [], ["scene.yaml:4", "not valid YAML"]),
    ("unknown block", ("supports:", "contacts:"), [], ["scene.yaml:7", "contacts", "supports"]),
    ("rods are a map", ("rods:\n  - name: a\n    " + shape, "rods: {}\nother:\n  - name: a"), [], ["scene.yaml:3", "'rods' must be a list", "a map"]),
    ("no rods", ("rods:\n  - name: a", "more:\n  - name: a"), [], ["scene.yaml:1", "needs the key 'rods'"]),
    ("empty list of rods", ("rods:\n  - name: a", "rods: []\nmore:\n  - name: a"), [], ["scene.yaml:3", "at least one rod"]),
    ("rod is a word", ("supports:", "  - b\nsupports:"), [], ["scene.yaml:7", "must be a map", "'b'"]),
    ("number for a block", ("simulation: {dt: 0.01, t_end: 0.02}", "simulation: 3"), [], ["scene.yaml:2", "'simulation' must be a map"]),
    ("value left out", ("young: 1e7", "young:"), [], ["scene.yaml:6", "young", "nothing"]),
    # names
    ("name twice", ("supports:", "  - name: a\n    " + shape + "\nsupports:"), [], ["scene.yaml:7", "a rod 'a' already"]),
    ("name is a number", ("name: a", "name: 1"), [], ["scene.yaml:4", "must not be empty, a number"]),
    ("rod not said", ("supports:", "  - name: b\n    material: default\n    " + shape + "\nsupports:"), [], ["scene.yaml:11", "which 'rod'"]),
    ("support of rod 3", (support, "  - {rod: 3, vertex: 0, type: pin}"), [], ["scene.yaml:8", "no rod '3'", "0 to 0"]),
    # numbers
    ("number too large to read", ("1e7", "1e400"), [], ["scene.yaml:6", "'young' must be a number", "1e400"]),
    ("section beyond numbers", ("radius: 0.01", "radius: 1e100"), [], ["scene.yaml:6", "zero or infinite"]),
    ("section below numbers", ("radius: 0.01", "radius: 1e-90"), [], ["scene.yaml:6", "zero or infinite"]),
    ("point too far", rod("points: [[0, 0, 0], [1e200, 0, 0]]"), [], ["scene.yaml:5", "'points[1]'", "between 1e-100 and 1e100"]),
    ("a helix of too few edges", rod("helix: {origin: [0, 0, 0], axis: [0, 0, 1], length: 0.1, radius: 0.02, turns: 20, edges: 20}"), [], ["scene.yaml:5", "20 turns needs at least 41 edges, found 20"]),
    ("a helix drawn again with too few edges", rod("helix: {origin: [0, 0, 0], axis: [0, 0, 1], length: 0.1, radius: 0.02, turns: 20, edges: 60}"), ["-rod_edges", "40"], ["-rod_edges", "'a'", "at least 41 edges, found 40"]),
    ("half a turn at a vertex", (shape, shape + "\n    turns: 2"), [], ["scene.yaml:", "'turns' twist it by 180 degrees", "measure angle"]),
    ("half a turn at a vertex, by edges", (shape, shape.replace("4}", "8}") + "\n    turns: 2"), ["-rod_edges", "4"], ["-rod_edges", "180 degrees"]),
    ("natural curvature of half a turn", (shape, shape + "\n    natural: {curvature: 13}"), [], ["natural curvature", "263.343 degrees"]),
    ("natural twist of half a turn", (shape, shape + "\n    natural: {twist: 13}"), [], ["natural twist", "186.211 degrees", "measure angle"]),
    ("a number of a size beyond all", (support, "  - {vertex: 0, type: clamp, motion: {velocity: [1e300, 0, 0]}}"), [], ["scene.yaml:8", "1e100"]),
    ("a tangent against its edge", (support, "  - {vertex: 0, type: clamp, tangent: [-1, 0, 0]}"), [], ["scene.yaml:8", "points against edge 0"]),
    ("a name taken by a rod without one", ("name: a\n    " + shape, f"name: rod1\n    {shape}\n    material: default\n  - {shape}"), [],
     ["scene.yaml:7", "give this rod a 'name'"]),
    ("a name of two lines", ("name: a", 'name: "a\\nb"'), [], ["scene.yaml:4", "in one line", "'a?b'"]),
    ("a file of two lines", rod('file: "a\\nb.csv"'), [], ["scene.yaml:5", "in one line"]),
    ("a polyline with a byte of zero", rod("file: zero.csv"), [], ["zero.csv:2", "0x00"]),
    ("shortest steps above the longest", None, ["-dt_adapt", "error", "-dt_min", "5e-3", "-dt_max", "1e-3"], ["-dt_min", "-dt_max 0.001"]),
    ("output without end", None, ["-output_interval", "1e-300"], ["-output_interval", "1e-100"]),
    ("no edges", ("edges: 4", "edges: 0"), [], ["scene.yaml:5", "'edges' must be at least 1", "'0'"]),
    ("half an edge", ("edges: 4", "edges: 4.5"), [], ["scene.yaml:5", "whole number", "4.5"]),
    ("too many edges", ("edges: 4", "edges: 2000000000"), [], ["scene.yaml:5", "too large", "at most 10000000"]),
    ("far too many edges", ("edges: 4", "edges: 1e12"), [], ["scene.yaml:5", "'edges' is too large"]),
    ("negative step in the scene", ("dt: 0.01", "dt: -0.01"), [], ["scene.yaml:2", "'dt'", "greater than zero"]),
    ("unknown mode in the scene", ("dt: 0.01", "mode: quick, dt: 0.01"), [], ["scene.yaml:2", "dynamic, static", "quick"]),
    ("zero radius", ("radius: 0.01", "radius: 0"), [], ["scene.yaml:6", "'radius' must be greater than zero"]),
    ("negative bending stiffness", ("poisson: 0.3", "poisson: 0.3, flexural_stiffness: [1, -1]"), [], ["scene.yaml:6", "flexural_stiffness", "negative"]),
    ("negative damping", ("poisson: 0.3", "poisson: 0.3, mass_damping_coefficient: -1"), [], ["scene.yaml:6", "mass_damping_coefficient", "negative"]),
    ("nothing resists turning", ("radius: 0.01, young: 1e7, poisson: 0.3, density: 1000", "torsional_stiffness: 0, linear_rotational_inertia: 0"), [],
     ["scene.yaml:6", "both zero"]),
    ("zero axial stiffness", ("poisson: 0.3", "poisson: 0.3, axial_stiffness: 0"), [], ["scene.yaml:6", "'axial_stiffness' must be greater than zero"]),
    ("negative torsional stiffness", ("poisson: 0.3", "poisson: 0.3, torsional_stiffness: -1"), [], ["scene.yaml:6", "torsional_stiffness", "negative"]),
    ("zero mass", ("poisson: 0.3", "poisson: 0.3, linear_density: 0"), [], ["scene.yaml:6", "'linear_density' must be greater than zero"]),
    ("negative rotational inertia", ("poisson: 0.3", "poisson: 0.3, linear_rotational_inertia: -1"), [], ["scene.yaml:6", "linear_rotational_inertia", "negative"]),
    ("damping that is not finite", ("poisson: 0.3", "poisson: 0.3, stiffness_damping_coefficient: .inf"), [], ["scene.yaml:6", "finite"]),
    ("three bending stiffnesses", ("poisson: 0.3", "poisson: 0.3, flexural_stiffness: [1, 2, 3]"), [], ["scene.yaml:6", "a list of 2 numbers", "a list of 3"]),
    ("no material", ("    material: {radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}\n", ""), [], ["scene.yaml:4", "needs the key 'material'", "a map, or default"]),
    ("material of a name", ("{radius: 0.01, young: 1e7, poisson: 0.3, density: 1000}", "steel"), [], ["scene.yaml:6", "one of default", "'steel'"]),
    ("material misspelt", ("material:", "matrial:"), [], ["scene.yaml:4", "needs the key 'material'", "found 'matrial'"]),
    # shapes
    ("directors that are no directions", (shape, shape + "\n    directors: [[0, 1, 0], [0, 0, 0], [0, 1, 0], [0, 1, 0]]"), [], ["scene.yaml:6", "must not be zero"]),
    ("director that is not finite", (shape, shape + "\n    director: [0, .nan, 0]"), [], ["scene.yaml:6", "finite"]),
    ("too many directors", (shape, shape + "\n    directors: [[0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0], [0, 1, 0]]"), [], ["scene.yaml:6", "one vector per edge (4), found 5"]),
    ("velocity that is not finite", (shape, shape + "\n    velocity: [0, .inf, 0]"), [], ["scene.yaml:6", "finite"]),
    ("two shapes", rod(shape + "\n    ring: {radius: 1, edges: 8}"), [], ["scene.yaml:4", "exactly one shape", "found 2"]),
    ("one point", rod("points: [[0, 0, 0]]"), [], ["scene.yaml:4", "1 vertices", "at least 2"]),
    ("points in a plane", rod("points: [[0, 0], [1, 0]]"), [], ["scene.yaml:5", "list of 3 numbers", "a list of 2"]),
    ("closed rod of two points", rod("points: [[0, 0, 0], [1, 0, 0]]\n    closed: true"), [], ["scene.yaml:4", "2 vertices", "at least 3"]),
    ("ring repeats its first point", rod("points: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]]\n    closed: true"), [], ["scene.yaml:4", "edge 3", "zero length"]),
    ("open ring", rod("ring: {radius: 1, edges: 8}\n    closed: false"), [], ["scene.yaml:6", "closed: false"]),
    ("half a turn in a ring", rod("ring: {radius: 1, edges: 8}\n    turns: 0.5"), [], ["scene.yaml:6", "whole number"]),
    ("ring without radius", rod("ring: {edges: 8}"), [], ["scene.yaml:5", "needs the key 'radius'"]),
    ("helix start along its axis", rod("helix: {axis: [1, 0, 0], start: [1, 0, 0], length: 1, radius: 1, turns: 1, edges: 9}"), [], ["scene.yaml:5", "normal to 'axis'"]),
    ("taper of both ends", rod("helix: {length: 1, radius: 1, turns: 1, taper: 0.6, edges: 9}"), [], ["scene.yaml:5", "[0, 0.5]"]),
    ("axis of zero", rod("helix: {axis: [0, 0, 0], length: 1, radius: 1, turns: 1, edges: 9}"), [], ["scene.yaml:5", "'axis' must not be zero"]),
    ("too many copies", rod(shape.replace("4", "1000") + "\n    copies: {count: 9999999, offset: [0, 0, 1]}"), [], ["scene.yaml:4", "vertices", "1e8"]),
    ("unknown natural shape", rod(shape + "\n    natural: curly"), [], ["scene.yaml:6", "as_drawn, straight", "curly"]),
    ("unknown energy", rod(shape + "\n    energy: cosserat"), [], ["scene.yaml:6", "seed, classical", "cosserat"]),
    ("energy of an override", None, ["-rod_energy", "2"], ["-rod_energy", "seed, classical"]),
    ("unknown measure", rod(shape + "\n    measure: sine"), [], ["scene.yaml:6", "tan, angle", "sine"]),
    # polyline files
    ("NaN in points", rod("file: nan.csv"), [], ["scene.yaml:5", "nan.csv:2", "not finite"]),
    ("huge point", rod("file: huge.csv"), [], ["huge.csv:2", "1e400"]),
    ("two numbers in a point", rod("file: two.csv"), [], ["two.csv:2", "three numbers", "'1,0'"]),
    ("four numbers in a point", rod("file: four.csv"), [], ["four.csv:2", "three numbers"]),
    ("polyline of one point", rod("file: one.csv"), [], ["one.csv:5", "one point"]),
    ("no points", rod("file: empty.csv"), [], ["empty.csv", "no polyline"]),
    ("points too far apart", rod("file: far.csv"), [], ["scene.yaml:4", "too long"]),
    ("polyline is a folder", rod("file: ."), [], ["scene.yaml:5", "cannot be opened"]),
    ("unknown kind of file", rod("file: rod.stl"), [], ["rod.stl", "'.stl'", ".csv"]),
    ("vertex missing in obj", rod("file: index.obj"), [], ["index.obj:3", "'3'", "2 vertices"]),
    ("rubbish in obj", rod("file: word.obj"), [], ["word.obj:3", "'2x'"]),
    ("line of one vertex in obj", rod("file: alone.obj"), [], ["alone.obj:2", "two vertices"]),
    ("obj without lines", rod("file: points.obj"), [], ["points.obj", "no polyline", "'l 1 2 3'"]),
    ("no HDF5", rod("file: text.h5"), [], ["text.h5", "not a readable HDF5 file"]),
    ("HDF5 without position", rod("file: no_position.h5"), [], ["no_position.h5", "no dataset 'position'"]),
    ("HDF5 of one dimension", rod("file: flat.h5"), [], ["flat.h5", "'position'", "(n, 3)"]),
    ("NaN in HDF5", rod("file: nan.h5"), [], ["nan.h5", "'position'", "not finite"]),
    ("HDF5 offsets", rod("file: offsets.h5"), [], ["offsets.h5", "rise from 0 to 2"]),
    ("HDF5 of 1e12 rows", rod("file: huge.h5"), [], ["scene.yaml:5", "huge.h5", "'position' declares 1000000000000 rows", "50000000"]),
    ("HDF5 of 2e7 rows that are not there", rod("file: hollow.h5"), [], ["hollow.h5", "declares 20000000 rows", "holds only 0 bytes"]),
    ("HDF5 of words", rod("file: words.h5"), [], ["words.h5", "'position'"]),
    ("branch in obj", rod("file: branch.obj"), [], ["scene.yaml:5", "branch.obj:7", "vertex 2 has a third edge", "do not branch"]),
    ("edge of one vertex in obj", rod("file: loop.obj"), [], ["loop.obj:3", "vertex 1 to itself"]),
    ("HDF5 closed", rod("file: closed.h5"), [], ["closed.h5", "'closed'", "one number per rod"]),
    ("placed: nowhere", (shape, shape + "\n    place: {scale: 0}"), [], ["scene.yaml:", "greater than zero"]),
    ("placed: three scales", (shape, shape + "\n    place: {scale: [1, 2, 3]}"), [], ["scene.yaml:", "'scale' must be a number", "a list of 3"]),
    ("placed: an angle", (shape, shape + "\n    place: {rotation: 90}"), [], ["scene.yaml:", "'rotation' must be a list of 3 numbers"]),
    ("placed: translate", (shape, shape + "\n    place: {translate: [0, 0, 1]}"), [], ["scene.yaml:", "did you mean 'translation'"]),
    ("placed: out of sight", (shape, shape + "\n    place: {scale: 1e300}"), [], ["scene.yaml:6", "'scale'", "between 1e-100 and 1e100"]),
    ("placed: a list", (shape, shape + "\n    place: [1, 2]"), [], ["scene.yaml:", "'place' must be a map"]),
    ("placed: nothing", (shape, shape + "\n    place: "), [], ["scene.yaml:", "'place' must be a map"]),
    ("placed: twice", (shape, shape + "\n    place: {scale: 2, scale: 3}"), [], ["scene.yaml:", "a second time"]),
    ("placed: of no size", (shape, shape + "\n    place: {scale: 1e-320}"), [], ["scene.yaml:6", "'scale'", "between 1e-100 and 1e100"]),
    ("placed: with a unit", (shape, shape + "\n    place: {scale: 1mm}"), [], ["scene.yaml:", "must be a number", "'1mm'"]),
    # supports and loads
    ("unknown kind of support", ("type: clamp", "type: glue"), [], ["scene.yaml:8", "clamp, pin, fix_twist", "glue"]),
    ("support of nothing", (support, "  - {vertex: 0}"), [], ["scene.yaml:8", "needs the key 'type'"]),
    ("tangent of a pin", (support, "  - {vertex: 0, type: pin, tangent: [1, 0, 0]}"), [], ["scene.yaml:8", "tangent"]),
    ("director of a clamp", (support, "  - {vertex: 0, type: clamp, director: [1, 1, 0]}"), [], ["scene.yaml:8", "not normal"]),
    ("times fall", motion("{table: [[0, 0, 0, 0], [2, 0, 0, 0], [1, 0, 0, 0]]}"), [], ["scene.yaml:8", "times", "increase"]),
    ("short row in a table", motion("{table: [[0, 0, 0]]}"), [], ["scene.yaml:8", "[time, dx, dy, dz]"]),
    ("empty motion", motion("{}"), [], ["scene.yaml:8", "'motion' needs"]),
    ("table and velocity", motion("{velocity: [1, 0, 0], table: [[0, 0, 0, 0]]}"), [], ["scene.yaml:8", "not both"]),
    ("pin turns", motion("{angular_velocity: [1, 0, 0]}", "pin"), [], ["scene.yaml:8", "no rotation"]),
    ("fix_twist travels", motion("{velocity: [1, 0, 0]}", "fix_twist"), [], ["scene.yaml:8", "no position"]),
    ("twist of a cable", (support, "  - {vertex: 0, type: fix_twist}"), ["-rod_flexural_stiffness", "0"], ["scene.yaml:8", "no twist to fix"]),
    ("load of nothing", (support, support + "\nloads:\n  - {vertex: 0}"), [], ["scene.yaml:10", "'force'"]),
    ("force on no vertex", (support, support + "\nloads:\n  - {vertex: 5, force: [0, 0, 1]}"), [], ["scene.yaml:10", "out of range"]),
    ("torque on no edge", (support, support + "\nloads:\n  - {edge: 4, torque: 1}"), [], ["scene.yaml:10", "out of range", "0 to 3"]),
    ("force that is not finite", (support, support + "\nloads:\n  - {vertex: 4, force: [0, .nan, 1]}"), [], ["scene.yaml:10", "finite"]),
    ("couple on a vertex", (support, support + "\nloads:\n  - {vertex: 4, torque: 1}"), [], ["scene.yaml:10", "'edge'"]),
    ("force of two numbers", (support, support + "\nloads:\n  - {vertex: 4, force: [0, 1]}"), [], ["scene.yaml:10", "a list of 3 numbers"]),
    ("motion that is not finite", motion("{velocity: [.inf, 0, 0]}"), [], ["scene.yaml:8", "finite"]),
    ("table that is not finite", motion("{table: [[0, 0, 0, .nan]]}"), [], ["scene.yaml:8", "finite"]),
    ("force and torque at once", (support, support + "\nloads:\n  - {vertex: 4, force: [0, 0, 1], torque: 1}"), [], ["scene.yaml:10", "torque"]),
    # options
    ("folder is a file", None, ["-output_dir", "file"], ["-output_dir", "'file'", "cannot be written"]),
    ("override out of range", None, ["-rod_poisson", "0.7"], ["-rod_poisson", "(-1, 0.5]", "0.7"]),
    ("override with an open bracket", None, ["-rod_flexural_stiffness", "[1"], ["-rod_flexural_stiffness", "'[1'"]),
    ("three stiffnesses of an override", None, ["-rod_flexural_stiffness", "1,2,3"], ["-rod_flexural_stiffness", "a list of 2 numbers", "a list of 3"]),
    ("tolerance above one", None, ["-snes_rtol", "2"], ["-snes_rtol", "(0, 1]", "'2'"]),
    ("no iteration", None, ["-snes_max_it", "0"], ["-snes_max_it", "at least 1"]),
    ("override of another section", None, ["-rod_width", "1"], ["scene.yaml:6", "'height'"]),
    ("measure of an override", None, ["-rod_measure", "sine"], ["-rod_measure", "tan, angle"]),
    ("no scene", None, ["-scene"], ["-scene"]),
    ("word for a number", None, ["-dt", "fast"], ["fast"]),
    ("unknown mode", None, ["-mode", "quick"], ["-mode", "quick"]),
    ("no load steps", None, ["-mode", "static", "-load_steps", "0"], ["-load_steps", "at least 1"]),
    ("smallest step above the step", None, ["-dt_min", "1"], ["-dt_min", "not be larger"]),
    ("unknown continuation", None, ["-mode", "static", "-continuation", "arc"], ["-continuation", "arc"]),
    ("continuation in dynamics", None, ["-continuation", "arclength"], ["-continuation", "no meaning"]),
    ("bifurcation in dynamics", None, ["-bifurcation", "stop"], ["-bifurcation", "no meaning"]),
    ("no steps along the path", None, ["-mode", "static", "-continuation", "arclength", "-arclength_steps", "0"], ["-arclength_steps", "at least 1"]),
    ("steps along the path for load steps", None, ["-mode", "static", "-arclength_steps", "5"], ["-arclength_steps", "-continuation arclength"]),
    ("path without a load", None, ["-mode", "static", "-continuation", "arclength", "-gravity", "0,0,0"], ["needs a load"]),
    ("path of a moving support", ("type: clamp}", "type: clamp, motion: {velocity: [1, 0, 0]}}"), ["-mode", "static", "-continuation", "arclength"], ["moves", "-continuation load"]),
    ("estimate that is a word", None, ["-error_estimate", "maybe"], ["-error_estimate", "true or false"]),
    ("estimate along a path", None, ["-mode", "static", "-continuation", "arclength", "-error_estimate"], ["-error_estimate", "-continuation load"]),
    ("accuracy out of reach in dynamics", None, ["-accuracy", "1e-15"], ["-accuracy", "larger tolerance"]),
    ("accuracy of a restart in dynamics", None, ["-accuracy", "1e-3", "-restart", "file"], ["-accuracy", "-restart"]),
    ("tip of a ring in dynamics", (shape, "ring: {radius: 0.5, edges: 16}"), ["-accuracy", "1e-3", "-accuracy_of", "tip"], ["-accuracy_of", "'a' is closed", "position"]),
    ("accuracy that is a word", None, ["-mode", "static", "-accuracy", "high"], ["-accuracy", "'high' is not a number"]),
    ("accuracy of nothing", None, ["-mode", "static", "-accuracy", "0"], ["-accuracy", "(0, 1)"]),
    ("accuracy in percent", None, ["-mode", "static", "-accuracy", "5"], ["-accuracy", "(0, 1)", "'5'"]),
    ("accuracy without a value", None, ["-mode", "static", "-accuracy"], ["-accuracy", "needs a value"]),
    ("accuracy out of reach", None, ["-mode", "static", "-accuracy", "1e-15"], ["-accuracy", "larger tolerance"]),
    ("accuracy of what", None, ["-mode", "static", "-accuracy", "1e-3", "-accuracy_of", "tp"], ["-accuracy_of", "position, tip, energy", "did you mean 'tip'"]),
    ("accuracy of a quantity without a tolerance", None, ["-mode", "static", "-accuracy_of", "tip"], ["-accuracy_of", "needs -accuracy"]),
    ("tip of a ring", (shape, "ring: {radius: 0.5, edges: 16}"), ["-mode", "static", "-accuracy", "1e-3", "-accuracy_of", "tip"], ["-accuracy_of", "'a' is closed", "position"]),
    ("accuracy at a critical load", None, ["-mode", "static", "-accuracy", "1e-3", "-bifurcation", "stop"], ["-accuracy", "-bifurcation stop"]),
    ("accuracy along a path", None, ["-mode", "static", "-accuracy", "1e-3", "-continuation", "arclength"], ["-accuracy", "-continuation load"]),
    ("accuracy of a restart", None, ["-mode", "static", "-accuracy", "1e-3", "-restart", "file"], ["-accuracy", "-restart"]),
    ("edges of no rod", None, ["-rod_edges", "b:20"], ["-rod_edges", "no rod 'b'"]),
    ("half an edge by option", None, ["-rod_edges", "4.5"], ["-rod_edges", "whole number", "'4.5'"]),
    ("no edges by option", None, ["-rod_edges", "a:0"], ["-rod_edges", "at least 1"]),
    ("edges between which a load acts", (support, support + "\nloads:\n  - {vertex: 1, force: [0, 0, 1]}"), ["-rod_edges", "6"], ["-rod_edges", "vertex 1 of 4 edges is no vertex of 6"]),
    ("edges that cut a corner", rod("points: [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0]]"), ["-rod_edges", "4"], ["-rod_edges", "corner at its vertex 1"]),
    ("ring of two edges", rod("ring: {radius: 1, edges: 8}"), ["-rod_edges", "2"], ["-rod_edges", "at least 3"]),
    ("edges and accuracy", None, ["-accuracy", "1e-3", "-rod_edges", "8"], ["-rod_edges", "-accuracy"]),
    ("two scenes", None, ["other.yaml"], ["'other.yaml' belongs to no option"]),
    # files of options
    ("options: a comma", None, ["-options_file", "comma.yaml"], ["comma.yaml:1", "not valid YAML"]),
    ("options: Latin letters", None, ["-options_file", "latin.yaml"], ["latin.yaml:1", "0xE4"]),
    ("options: no file", None, ["-options_file"], ["-options_file", "needs a file"]),
    ("options: missing file", None, ["-options_file", "nowhere.yaml"], ["nowhere.yaml", "cannot be opened"]),
    ("options: folder", None, ["-options_file", "."], ["-options_file", "is a folder"]),
    ("options: not YAML", None, ["-options_file", "broken.yaml"], ["broken.yaml:2", "not valid YAML"]),
    ("options: a list", None, ["-options_file", "list.yaml"], ["list.yaml:1", "a map", "a list of 2"]),
    ("options: a scene", None, ["-options_file", "scene.yaml"], ["scene.yaml:3", "'rods'", "-scene"]),
    ("options: twice", None, ["-options_file", "twice.yaml"], ["twice.yaml:3", "'dt'", "line 1"]),
    ("options: twice, in two documents", None, ["-options_file", "documents.yaml"], ["documents.yaml:3", "'dt'", "line 1"]),
    ("options: two in a line", None, ["-options_file", "crowded.txt"], ["crowded.txt:1", "'-t_end' is too much"]),
    ("options: twice, nested", None, ["-options_file", "nested.yaml"], ["nested.yaml:2", "'snes_rtol'", "line 1"]),
    ("options: unknown", None, ["-options_file", "unknown.yaml"], ["unknown.yaml:3", "-snes_rtl", "did you mean -snes_rtol"]),
    ("options: wrong value", None, ["-options_file", "value.yaml"], ["value.yaml:2", "-dt", "'fast' is not a number"]),
    ("options: wrong value of a rod", None, ["-options_file", "override.yaml"], ["override.yaml:1", "-rod_young", "greater than zero"]),
    ("options: wrong limit", None, ["-options_file", "limit.yaml"], ["limit.yaml:1", "-snes_max_it", "'abc' is not a number"]),
    ("options: wrong value of PETSc's", None, ["-options_file", "stol.yaml"], ["option -snes_stol (stol.yaml:1): setting up the solvers", "abc"]),
    ("options: no such solver", None, ["-options_file", "solver.yaml"], ["option -pc_type (solver.yaml:2): setting up the solvers", "nosuch"]),
    ("options: in the older format", None, ["-options_file", "solver.txt"], ["option -ksp_type (solver.txt:1): setting up the solvers", "nosuch"]),
    ("options: wrong value of PETSc's, or of another", None, ["-options_file", "solver.yaml", "-ksp_type", "nosuch"],
     ["option -ksp_type or -pc_type (solver.yaml:2): setting up the solvers", "nosuch"]),
    ("options: a number out of PETSc's bounds", None, ["-options_file", "lag.yaml"], ["setting up the solvers: Lag must be", "(options are also read from lag.yaml)"]),
    ("options: with a dash", None, ["-options_file", "dash.yaml"], ["dash.yaml:1", "'-dt'", "without their dash"]),
    ("options: another file", None, ["-options_file", "other.yaml"], ["other.yaml:1", "-options_file"]),
    ("options: case from another folder", None, ["-scene", "scene.yaml", "-options_file", "case.yaml"], ["case.yaml:2", "cannot be opened", "folder"]),
    ("options: of a solver not chosen", None, ["-options_file", "mumps.yaml"], ["mumps.yaml:1", "mat_mumps_icntl_24", "unused"]),
    ("options: older format", None, ["-options_file", "plain.txt"], ["plain.txt:3", "'fast' is not a number"]),
    ("options: YAML of another name", None, ["-options_file", "plain"], ["plain:1", "'dt:' is no option", "*.yaml"]),
    ("options: the last of two files counts", None, ["-options_file", "value.yaml", "-dt", "slow"], ["tendril: option -dt", "'slow'"]),
    ("free rod in statics", ("supports:\n  - {vertex: 0, type: clamp}\n", ""), ["-mode", "static"], ["free to move"]),
]



def check(row):
    """What is wrong with the answer to one mistake; empty when it was told well."""
    name, edit, options, parts = row
    with tempfile.TemporaryDirectory() as tmp:
        text = base
        if edit:
            assert edit[0] in text, (name, edit[0])
            text = text.replace(edit[0], edit[1], 1)
        open(tmp + "/scene.yaml", "w").write(text)
        for file, content in files.items():
            open(f"{tmp}/{file}", "wb").write(content)
        writeHdf5(tmp)
        command = [program] if "-scene" in options else [program, "-scene", "scene.yaml"]
        run = subprocess.run(command + options, cwd=tmp, capture_output=True, text=True, errors="replace", timeout=60)
        wrong = [p for p in parts if p not in run.stderr]
        if run.returncode != 1:
            wrong.append(f"exit code {run.returncode}")
        if any(ord(c) < 32 and c not in "\n\t" for c in run.stderr):
            wrong.append("only printable characters")
        if any("trajectory.h5" in files for _, _, files in os.walk(tmp)):
            wrong.append("a trajectory was begun")
        if verbose:
            print(f"{name}: {run.stderr.strip()}")
        return f"{name}: missing {wrong}\n    {run.stderr.strip()[:400]}" if wrong else ""


verbose = "-v" in sys.argv
with ThreadPoolExecutor(4) as pool:  # a start takes longer than its work
    complaints = [c for c in pool.map(check, rows) if c]
failures = len(complaints)
for complaint in complaints:
    print(complaint)
variable = subprocess.run([program], capture_output=True, text=True, env={**os.environ, "PETSC_OPTIONS": "-options_file nowhere.yaml"})
if variable.returncode != 1 or "'nowhere.yaml' cannot be opened" not in variable.stderr:
    failures += 1
    print("PETSC_OPTIONS:", variable.stderr)
help_text = subprocess.run([program, "-help"], capture_output=True, text=True)
for option in "scene mode dt dt_min integrator rho_inf dt_adapt dt_rtol dt_atol dt_max t_end load_steps continuation bifurcation arclength_steps gravity output_dir output_interval output_fields error_estimate accuracy accuracy_of rounding_tolerance retraction stretch rod_young rod_measure rod_energy".split():
    if f"-{option}" not in help_text.stdout or help_text.returncode != 0:
        failures += 1
        print("-help does not list", option)
print(len(rows), "mistakes,", failures, "not told well")
sys.exit(failures > 0)
