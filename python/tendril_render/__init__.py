"""Pictures of rods and bodies by ray casting in numpy: shaded tubes, soft shadows, light from the sky; no display.

`shapes` turns a trajectory into capsules and triangles, `skins` is about the surfaces that rods carry, `cast` finds what
each ray sees, `light` casts shadows, `picture` shades, `legend` writes on it. Points are arrays (n, 3) [m]; colours are
linear RGB, 0 to 1.
"""
