"""Reads trajectories of format 1 until the module `tendril` is here; to be deleted then, with its use in `source`."""
import os
from types import SimpleNamespace

import h5py
import numpy as np

UNITS = {"position": "m", "position_low": "m", "director": "1", "velocity": "m/s", "twist_rate": "rad/s",
         "axial_force": "N", "turns": "rad", "curvature": "1/m", "twist": "rad/m", "strain_energy_density": "J/m",
         "force": "N", "moment": "N m"}
EDGES = ("director", "twist_rate", "axial_force", "force")


class Trajectory:
    supports, bodies, colliders = [], [], []

    def __init__(self, path):
        path = os.path.join(path, "trajectory.h5") if os.path.isdir(path) else path
        f = self.file = h5py.File(path, "r", swmr=True)
        self.time = f["time"][:]
        self.gravity = f.attrs.get("gravity", np.zeros(3))
        self.field_names = sorted(n for n in f["state"] if n != "turns")
        self.vertices, self.edges = f["topology/rod_vertex_offsets"][:], f["topology/rod_edge_offsets"][:]
        m = f["material"]
        radius = 2 * np.sqrt(m["flexural_stiffness"][:, 0] / m["axial_stiffness"][:])
        self.cache = {}
        self.rods = [Rod(self, k, bool(c), radius[k]) for k, c in enumerate(f["topology/closed"][:])]

    def frame(self, name, frame):
        if self.cache.get(name, (None,))[0] != frame:
            self.cache[name] = frame, self.file["state/" + name][frame]
        return self.cache[name][1]

    def unit(self, name):
        return UNITS.get(name, "")

    def field(self, name):
        return SimpleNamespace(place="edges" if name in EDGES else "cells" if name == "turns" else "vertices")


class Rod:
    section, half_axes = "circle", np.full(2, np.nan)

    def __init__(self, owner, k, closed, radius):
        self.owner, self.name, self.closed, self.radius = owner, f"rod{k}", closed, radius
        self.v, self.e = slice(*owner.vertices[k : k + 2]), slice(*owner.edges[k : k + 2])

    def position(self, frame):
        return self.owner.frame("position", frame)[self.v]

    def director(self, frame):
        return self.owner.frame("director", frame)[self.e]

    def field(self, name, frame):
        return self.owner.frame(name, frame)[self.e if name in EDGES else self.v]
