"""Mesh files, point clouds and octrees as arrays.

OptiPlan reads STL, OBJ, DAE, PLY and GLB itself, not by trimesh 5.2, although that is installed. A mesh is an obstacle:
collision checks miss every part that a reader ignores. Both were tested with files truncated at sixty places and with
files with one changed byte:

    truncated   trimesh accepts every binary and ASCII STL, half of the ASCII PLY and a third of the OBJ; our readers
                accept only files that still contain a whole surface.
    changed     trimesh accepts three times as many PLY and GLB, with invalid indices, types or lengths.
    ignored     trimesh omits free-form surfaces of an OBJ without a message.
    COLLADA     trimesh reads it with pycollada, one more dependency.
    cost        trimesh takes 0.4 s of processor time to import; the process that reads needs NumPy alone.
"""
