#!/usr/bin/python3
"""What a run leaves behind: files.py <tendril> <source folder>. A killed run is readable to its last frame; ParaView's reader (VTK) sees every frame."""
import os
import signal
import subprocess
import sys
import tempfile
import time

import h5py
import numpy as np

program, source = os.path.abspath(sys.argv[1]), os.path.abspath(sys.argv[2])
scene = source + "/data/scenes/cantilever.yaml"


def read(path):
    with h5py.File(path, "r", swmr=True) as f:
        n = len(f["time"])
        fields = {k: f["state/" + k][:n] for k in f["state"]}
        assert all(len(v) == n for v in fields.values()), "a field has fewer frames than /time"
        return f["time"][:], fields


def run(out, *options):
    return [program, "-scene", scene, "-output_dir", out, *options]


with tempfile.TemporaryDirectory() as tmp:
    whole, options = tmp + "/whole", ["-dt", "1e-3", "-t_end", "1"]
    subprocess.run(run(whole, *options), check=True, stdout=subprocess.DEVNULL)
    times, fields = read(whole + "/trajectory.h5")
    assert len(times) == 1001
    for wait in (0.05, 0.1, 0.17):
        out = f"{tmp}/killed{wait}"
        process = subprocess.Popen(run(out, *options), stdout=subprocess.DEVNULL)
        while not os.path.exists(out + "/diagnostics.csv"):
            time.sleep(0.005)
        time.sleep(wait)
        process.send_signal(signal.SIGKILL)
        process.wait()
        t, f = read(out + "/trajectory.h5")
        assert 0 < len(t) <= 1001, len(t)
        for name, values in f.items():
            assert np.array_equal(values, fields[name][: len(t)]), f"{name}: a frame of the killed run differs"
        rows = open(out + "/diagnostics.csv").read().splitlines()
        assert len(rows) >= len(t) - 1 and rows[0].startswith("time,dt")
        print("killed after", len(t), "frames: all readable and equal")

    short = tmp + "/short"
    subprocess.run(run(short, "-dt", "0.01", "-t_end", "0.1"), check=True, stdout=subprocess.DEVNULL)
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
    from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as pipeline

    t, f = read(short + "/trajectory.h5")
    reader = vtkXdmfReader()
    reader.SetFileName(short + "/trajectory.xdmf")
    reader.UpdateInformation()
    found = reader.GetOutputInformation(0).Get(pipeline.TIME_STEPS())
    assert found is not None and np.allclose(found, t), "the reader sees other times"
    for k, now in enumerate(t):
        reader.UpdateTimeStep(now)
        data = reader.GetOutputDataObject(0)
        while data.IsA("vtkMultiBlockDataSet"):
            data = data.GetBlock(0)
        assert data.GetNumberOfCells() == 1, data.GetNumberOfCells()
        assert np.allclose(vtk_to_numpy(data.GetPoints().GetData()), f["position"][k], rtol=1e-6, atol=1e-6), "points differ"
        assert data.GetPointData().GetArray("velocity") is not None, "no velocity"
    print("VTK reads", len(t), "frames")
