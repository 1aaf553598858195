"""Files of surfaces for other programs. `meshes` makes the surfaces, `glb` writes them as they move, in one file of
glTF 2.0, `ply` as they are in each frame. Lengths are in m.
"""
