"""URDF and SRDF files, read, checked and written."""
