"""Mesh files, point clouds and octrees as arrays.

STL, OBJ, DAE, PLY and GLB are read by readers of our own, not by trimesh 5.2, although it is installed. A mesh is an
obstacle, so what a reader passes over is never checked. Files cut off at sixty places and files with one byte changed
were given to both:

    cut off     trimesh takes every binary and ASCII STL (whatever is left of it), half of the ASCII PLY and a third of
                the OBJ; ours take what is still a whole surface.
    changed     trimesh takes three times as many PLY and GLB, with indices, types or lengths that the format excludes.
    passed over trimesh leaves out free-form surfaces of an OBJ without a word.
    COLLADA     trimesh reads it with pycollada, one more dependency.
    cost        trimesh takes 0.4 s of processor time to import; the process that reads needs NumPy alone.
"""
