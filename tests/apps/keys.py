#!/usr/bin/python3
"""What the table of keys promises: keys.py <tendril> <source folder>. Defaults are those in force, examples run,
completion completes."""
import json
import os
import subprocess
import sys
import tempfile

import yaml

program, root = os.path.abspath(sys.argv[1]), sys.argv[2]
keys = {k["path"]: k for k in json.loads(subprocess.run([program, "-keys"], capture_output=True, text=True, check=True).stdout)}


def defaults():
    """options.yaml of a run without options has the fallbacks of the table."""
    compared = 0
    for mode, left_out in (("dynamic", ("load_steps",)), ("static", ("dt", "t_end"))):
        with tempfile.TemporaryDirectory() as folder:
            with open(f"{folder}/s.yaml", "w") as f:
                f.write("rods: [{line: {from: [0, 0, 0], to: [0, -1, 0], edges: 4}, material: default}]\nsupports: [{vertex: 0, type: clamp}]\n")
                f.write(f"simulation: {{mode: {mode}}}\n")
            subprocess.run([program, "-scene", "s.yaml"], cwd=folder, check=True, capture_output=True)
            with open(f"{folder}/out/options.yaml") as f:
                found = yaml.safe_load(f)
        for name, value in found.items():
            key = keys.get("-" + name)
            scene = keys.get("simulation." + name, {"fallback": "("})
            text = scene["fallback"] if not scene["fallback"].startswith("(") else key["fallback"] if key else "("
            if name in left_out + ("output_fields", "mode", "gravity") or text.startswith("(") or text == "required":
                continue
            try:
                same = float(value) == float(text) and not isinstance(value, bool)
            except (TypeError, ValueError):
                same = False
            same = same or str(value).lower() == text
            assert same, f"{mode}: options.yaml has {name}: {value}, the table says {text}"
            compared += 1
    assert compared > 15, f"only {compared} defaults were compared"


# A scene for others to include.
PART = "part.yaml"
PART_TEXT = """bodies: [{name: weight, sphere: {radius: 0.05}, density: 1000, position: [3, 0, 0]}]
joints: [{name: hook, type: ball, child: weight, point: [3, 0.2, 0]}]
"""


def put(scene, path, value):
    """Sets a value of a scene by its path, `rods[].line.edges`: the first of each list."""
    *blocks, last = path.split(".")
    for block in blocks:
        scene = scene.setdefault(block.rstrip("[]"), [{}] if block.endswith("[]") else {})
        scene = scene[0] if block.endswith("[]") else scene
    scene.setdefault(last, value)


def exampleScene(path, value):
    """A scene with one key, and the keys that it asks for."""
    scene = {}
    put(scene, path, value)
    blocks = [path.rsplit(".", k)[0] for k in range(1, path.count(".") + 1)]
    for key in keys.values():
        if key["fallback"] == "required" and key["path"].rpartition(".")[0] in blocks and key["example"]:
            put(scene, key["path"], yaml.safe_load(key["example"]))
    material, name = "rods[].material", path.rpartition(".")[2]
    with_it = {"shear": ["young", "density"], "young": ["poisson", "density"], "poisson": ["young", "density"], "density": ["young", "poisson"],
               "width": ["height", "young", "poisson", "density"], "height": ["width", "young", "poisson", "density"],
               "radius": ["young", "poisson", "density"], "radii": ["young", "poisson", "density"]}
    if path.startswith(material):
        for other in with_it.get(name, []):
            put(scene, f"{material}.{other}", yaml.safe_load(keys[f"{material}.{other}"]["example"]))
        if name in ("shear", "young", "poisson", "density"):
            put(scene, f"{material}.radius", 0.01)
    if path.startswith("loads[]") and name in ("vertex", "rod", "axes"):
        put(scene, "loads[].force", [0, 0, 1e-3])
    if path == "loads[].edge":
        put(scene, "loads[].torque", 1e-4)
    if path.startswith("loads[]"):
        put(scene, "loads[].edge" if name in ("torque", "moment", "edge") else "loads[].vertex", "last")
    if path.startswith("joints[]"):
        joint = scene["joints"][0]
        joint.setdefault("type", "hinge")
        joint.setdefault("child", "cube")
        if name in ("stiffness", "rotational_stiffness", "damping", "rotational_damping", "saturation") and "drive" not in joint:
            joint.update({"stiffness": joint.get("stiffness", 1e5), "rotational_stiffness": joint.get("rotational_stiffness", 1e3)})
        if name == "range_stiffness":
            joint["range"] = [-1, 1]
        if path in ("joints[].drive.damping", "joints[].drive.target"):
            joint["drive"]["stiffness"] = 10
    if path.startswith("include[]"):  # a weight on a hook, beside the scene
        scene["include"][0]["file"] = PART
    if path.startswith("tendons[]"):
        tendon = scene["tendons"][0]
        entry = (tendon.get("path") or [{}])[0]
        from_world = {"body": "world", "point": [0, 0, -2]}
        if name in ("axis", "side", "radius"):
            entry.setdefault("cylinder", "cube")
        if "cylinder" in entry or "sphere" in entry:  # between two points, and round the body that it moves
            entry.setdefault("radius", 0.02)
            tendon["path"] = [{"body": "world", "point": [x, 0.01, 0.01]} for x in (-1, 1)]
            tendon["path"].insert(1, entry)
        elif "joint" in entry or name == "coefficient":
            entry.setdefault("joint", "elbow")
            tendon["path"] = [entry]
            scene["joints"] = [{"name": entry["joint"], "type": "hinge", "child": "cube", "point": [0, 0.5, 0]}]
        elif "rod" in entry or name in ("vertex", "edge", "offset"):
            entry.setdefault("rod", 0)
            entry.setdefault("edge" if name in ("edge", "offset") else "vertex", "last")
            tendon["path"] = [from_world, entry]
        else:
            entry.setdefault("body", "cube")
            tendon["path"] = [from_world, entry]
        if name in ("friction", "slip_length"):  # a point between two others, that an actuator draws the tendon over
            tendon["path"] = [from_world, entry, {"body": "world", "point": [0.5, 0, -2]}]
            tendon.setdefault("friction", 0.2)
            put(scene, "tendons[].force.tension", 10)
        if path.startswith("tendons[].displacement.") and name != "rigid":
            put(scene, "tendons[].displacement.stiffness", tendon["displacement"].get("stiffness", 1e4))
        if "table" not in tendon.get("force", {"table": 0}):
            put(scene, "tendons[].force.tension", 10)
        if "table" not in tendon.get("mckibben", {"table": 0}):
            put(scene, "tendons[].mckibben.pressure", 1e5)
    if path.endswith((".motion.amplitude", ".motion.period")):
        put(scene, path.rpartition(".")[0] + ".amplitude", [0.1, 0, 0])
        put(scene, path.rpartition(".")[0] + ".period", 2)
    if path.startswith(("bodies[]", "joints[]", "tendons[]")) or path == "constraints[].body":
        body = scene.setdefault("bodies", [{}])[0]
        body.setdefault("name", "cube")
        if not any(shape in body for shape in ("box", "sphere", "capsule", "cylinder", "mesh")):
            body["sphere"] = {"radius": 0.1}
        if "mesh" in body:
            body["mesh"]["file"] = os.path.abspath(f"{root}/data/meshes/plate.obj")
        if "mass" not in body:
            body.setdefault("density", 1000)
        if "centre" in body:
            body["inertia"] = [0.05, 0.05, 0.06]
    if path.startswith("constraints[]"):
        turns = name in ("edge", "tangent", "director", "measure", "angular_velocity")
        scene["constraints"][0]["type"] = "rotation" if turns else "pin"
        put(scene, "constraints[].edge" if turns else "constraints[].vertex", "last")
        if path != "constraints[].body":
            put(scene, "constraints[].stiffness", 1e3)
    if path.startswith("constraints[].to."):  # a second rod
        put(scene, "constraints[].rod", 0)
        put(scene, "constraints[].to.rod", 1)
        if name != "closest":
            put(scene, "constraints[].to.vertex", 0)
        put(scene, "rods[].line", {"from": [0, 0, 0], "to": [1, 0, 0], "edges": 6})
        scene["rods"].append({"line": {"from": [1, 0, 0], "to": [1, 1, 0], "edges": 6}, "material": "default"})
    if path.startswith(("colliders", "contact", "rods[].contact")):
        obstacle = scene.setdefault("colliders", [{}])[0]
        if not any(shape in obstacle for shape in ("plane", "sphere", "capsule", "cylinder", "box", "tube", "mesh")):
            obstacle["sphere"] = {"radius": 0.1}
        put(scene, "colliders[].position", [-1, -1, -1])
        if "mesh" in obstacle:
            obstacle["mesh"]["file"] = os.path.abspath(f"{root}/data/meshes/plate.obj")
            if name == "cell":
                obstacle["mesh"]["scale"] = 0.1
        if "tube" in obstacle:
            put(scene, "rods[].contact", "none")
        elif path != "rods[].contact":
            put(scene, "contact.radius" if path.startswith("contact") else "rods[].contact.radius", 0.01)
        if path.startswith("contact.ignore"):
            put(scene, "rods[].layer", "strands")
            put(scene, "colliders[].name", "floor")
        if path.startswith("contact.ignore[]."):  # two of a kind or of two
            pair = scene["contact"]["ignore"][0]
            if "bodies" in name:
                scene["bodies"] = [{"name": "bob", "sphere": {"radius": 0.1}, "density": 1000, "position": [5, 5, 5]}]
            other = {"rods": "colliders", "to_bodies": "bodies"}.get(name, "rods")
            pair[other] = {"colliders": "floor", "bodies": "bob", "rods": "strands"}[other]
        if name in ("threshold", "smoothing", "collider", "cloud", "exclusion_ratio") and "contact" in path:
            put(scene, path.rpartition(".")[0] + ".law", "penalty")
        if name in ("cloud", "exclusion_ratio"):
            put(scene, path.rpartition(".")[0] + ".collider", "point_cloud")
    if "skin" in scene.get("rods", [{}])[0]:
        skin = scene["rods"][0]["skin"]
        if "mesh" in skin:
            skin["mesh"]["file"] = os.path.abspath(f"{root}/data/meshes/plate.obj")
        if "tube" in skin and "half_axes" not in skin["tube"]:
            skin["tube"].setdefault("radius", 0.01)
    if path.endswith("contact.on"):
        put(scene, "rods[].skin", {"tube": {"sides": 6, "radius": 0.01}})
    if name == "quadrature" and yaml.safe_load(keys[path]["example"]) == 6:
        put(scene, path.rpartition(".")[0] + ".on", "surface")
    if path.startswith("junctions"):  # a second rod begins where the first one ends
        put(scene, "rods[].line", {"from": [0, 0, 0], "to": [1, 0, 0], "edges": 6})
        put(scene, "supports[].rod", 0)
        scene["rods"].append({"line": {"from": [1, 0, 0], "to": [1, 1, 0], "edges": 6}, "material": "default"})
        junction = scene["junctions"][0]
        given = (junction.get("members") or [{}])[0]
        junction["type"] = "ball" if "group" in given else junction.get("type", "rigid")
        if path.startswith("junctions[].members"):
            junction["members"] = [{"rod": 0, "vertex": "last", **given}, {"rod": 1, "vertex": 0, **{k: v for k, v in given.items() if k == "group"}}]
        else:
            junction.update({"shared": True} if junction.get("shared") is not False
                            else {"members": [{"rod": 0, "vertex": "last"}, {"rod": 1, "vertex": 0}]})
    if path.startswith("supports[].motion"):
        scene["supports"][0]["type"] = "clamp"
    if not any(shape in scene.get("rods", [{}])[0] for shape in ("line", "ring", "helix", "points", "file")):
        put(scene, "rods[].line", {"from": [0, 0, 0], "to": [1, 0, 0], "edges": 6})
    put(scene, "rods[].material", "default")
    put(scene, "supports[].rod", "all")
    put(scene, "supports[].vertex", 0)
    put(scene, "supports[].type", "clamp")
    if path.startswith("rotation"):
        put(scene, "simulation.mode", "static")
    put(scene, "simulation.t_end", 0.02)
    put(scene, "simulation.dt", 0.01)
    return scene


def examples():
    """The example of every key and option runs."""
    count = 0
    for key in keys.values():
        if not key["example"]:
            continue
        path, value = key["path"], yaml.safe_load(key["example"])
        option = path.startswith("-") or path.startswith("rods[].material.") or path == "rods[].measure"
        runs = [(exampleScene(path, value), [])] if not path.startswith("-") else []
        if option:
            name = path if path.startswith("-") else "-rod_" + path.rpartition(".")[2]
            words = [] if path == "-scene" else [name, key["example"].replace("[", "").replace("]", "").replace(", ", ",")]
            words += {"-modes": ["-mode", "modes"], "-buckling_to": ["-mode", "buckling"]}.get(path, [])
            other = ("contact.friction", 0.1) if path.startswith("-contact") else ("rods[].gravity", True)
            runs.append((exampleScene(*(other if path.startswith("-") else (path, value))), words))
        for scene, words in runs:
            with tempfile.TemporaryDirectory() as folder:
                with open(f"{folder}/s.yaml", "w") as f:
                    yaml.safe_dump(scene, f)
                with open(f"{folder}/{PART}", "w") as f:
                    f.write(PART_TEXT)
                run = subprocess.run([program, "-scene", "s.yaml", *words], cwd=folder, capture_output=True, text=True)
                none = path == "-buckling_to" and "0 of 6 modes found" in run.stderr  # the scene does not buckle
                assert run.returncode == 0 or none, f"{path}: {key['example']}: exit code {run.returncode}\n{run.stderr}\n{yaml.safe_dump(scene)} {words}"
                count += 1
    assert count > 90, f"only {count} examples were run"


def complete(*words):
    """What bash completes the last of some words to."""
    quoted = " ".join(f"'{w}'" for w in words)
    script = f"source {root}/scripts/completion.bash; COMP_WORDS=({quoted}); COMP_CWORD={len(words) - 1}; _tendril; echo ${{COMPREPLY[@]}}"
    return subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True).stdout.split()


defaults()
examples()
assert complete("tendril", "-integ") == ["-integrator"]
assert complete("tendril", "-integrator", "") == keys["-integrator"]["choices"].split("|")
assert complete("tendril", "-rod_you") == ["-rod_young"]
assert "tests" in complete("tendril", "-scene", os.path.join("te")) or not os.path.isdir("tests")
