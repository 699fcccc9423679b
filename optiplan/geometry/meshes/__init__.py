"""Mesh files, point clouds and octrees as arrays.

OptiPlan reads STL, OBJ, DAE, PLY and GLB itself. trimesh 5.2 is installed, but it passes the tests of none of the five
formats, each read by it in `reading_process`: a mesh is an obstacle, and collision checks miss every part that a reader
drops. The module of each format says what trimesh drops. Importing trimesh also takes 0.4 s of processor time, and the
process that reads needs NumPy alone.
"""
