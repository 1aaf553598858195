#!/usr/bin/python3
"""The JSON Schema of scenes and the reader agree: schema.py <tendril> <source folder>.

All scenes that are shipped are valid by both; 200 mutations of them (a key taken away, misspelt, repeated elsewhere, of
another type, out of its bounds, a second shape) are taken or refused by both alike. What a schema cannot know is left
alone: contents of files, names of rods, numbers of vertices, what is normal to what, larger than what, and within what.
"""
import copy
import json
import os
import random
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import yaml

try:
    import jsonschema
except ImportError:
    sys.exit("schema.py needs python3-jsonschema: scripts/setup tests")

program, root = os.path.abspath(sys.argv[1]), Path(sys.argv[2])
sys.path.insert(0, str(root / "python"))
from scene_yaml import Loader

MUTATIONS = 200


def spots(value, path=()):
    """Every key of a scene: the path to its map, and its name."""
    if isinstance(value, dict):
        for key, item in value.items():
            yield path, key
            yield from spots(item, path + (key,))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        yield from spots(value[0], path + (0,))


def mutate(scene, rng):
    """A copy of a scene with one thing wrong, or not wrong at all, and what was done."""
    scene = copy.deepcopy(scene)
    path, key = rng.choice(list(spots(scene)))
    block = scene
    for step in path:
        block = block[step]
    how = rng.choice(["remove", "misspell", "word", "list", "negative", "zero", "shape", "fraction", "tangent"])
    if how == "remove":
        del block[key]
    elif how == "misspell":
        block[key + "x"] = block.pop(key)
    elif how == "word":
        block[key] = "wrong word"
    elif how == "list":
        block[key] = [1, 2]
    elif how == "negative":
        block[key] = -1
    elif how == "zero":
        block[key] = 0
    elif how == "fraction":
        block[key] = 1.5
    elif how == "shape":
        scene["rods"][0]["ring"] = {"radius": 1, "edges": 8}
    elif how == "tangent" and scene.get("supports"):
        scene["supports"][0]["tangent"] = [1, 0, 0]
    return scene, f"{how} {'.'.join(map(str, path))}.{key}"


# What only the reader can know, by its words.
READER_ONLY = ("cannot be opened", "must not be zero", "normal to", "not normal", "out of range", "there is no rod", "which 'rod'", "held twice",
               "zero length", "folds back", "too short", "never reaches", "parallel", "must not be empty, a number", "there is a rod", "whole number, or its ends",
               "has no twist", "cannot carry", "no twist to fix", "must increase", "contradicts", "free to move as a whole", "pin holds",
               "holds no position", "comes out as", "is for -mode static", "deep in collider", "deep in body", "points against edge", "names two that pass", "is for 'collider", "only 'law: penalty'", "must not exceed its radius", "must be larger than 'bore'",
               "both zero", "natural curvature", "a junction needs", "is in junction", "no two vertices", "two supports hold", "in a rigid group",
               "a junction joins what", "'group' is for", "is for 'shared: true'", "no body", "take one of the two away", "degrees off", "the same 'gravity'", "no flexural stiffness that a weld",
               "is for the ends of a rod", "comes out as", "'size' must be positive", "the inertia of the shape", "with the name", "must not be a number")


def reads(scene, folder, name):
    """Whether the reader takes a scene, and its words."""
    path = Path(folder) / name
    path.write_text(json.dumps(scene))
    run = subprocess.run([program, "-scene", str(path), "-help"], capture_output=True, text=True, check=False)
    return run.returncode == 0, run.stderr.strip()


def main():
    schema = json.loads(subprocess.run([program, "-schema"], capture_output=True, text=True, check=True).stdout)
    validator = jsonschema.Draft7Validator(schema)
    validator.check_schema(schema)
    scenes = {p: yaml.load(p.read_text(), Loader) for p in sorted((root / "data/scenes").rglob("*.yaml"))}
    wrong = []
    for path, scene in scenes.items():
        for error in validator.iter_errors(scene):
            wrong.append(f"{path.name}: the schema says: {error.message[:200]}")
        first = path.read_text().split("\n", 1)[0]
        schema_path = first.partition("$schema=")[2]
        if not schema_path or not (path.parent / schema_path).resolve().exists():
            wrong.append(f"{path.name}: its first line does not name the schema")
    rng = random.Random(1)
    small = [s for p, s in scenes.items() if "file" not in json.dumps(s) and p.stat().st_size < 3000]
    cases = [mutate(rng.choice(small), rng) for _ in range(MUTATIONS)]
    refused = 0
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
        answers = list(pool.map(lambda c: reads(c[1][0], folder, f"{c[0]}.yaml"), enumerate(cases)))
    for (scene, what), (taken, words) in zip(cases, answers):
        valid = validator.is_valid(scene)
        refused += not taken
        if valid != taken and not (valid and any(w in words for w in READER_ONLY)):
            wrong.append(f"{what}: the schema {'takes' if valid else 'refuses'} it, the reader {'takes it' if taken else 'says: ' + words}")
    print(f"{len(scenes)} scenes, {MUTATIONS} mutations, {refused} refused, {len(wrong)} disagreements")
    if wrong:
        sys.exit("\n".join(wrong))


main()
