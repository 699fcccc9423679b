"""Problems of a planar arm that are planned in a blink, as texts of files."""

QUICK = """\
version: 1
name: free
robot: planar2r
start: {joints: [0.5, 1.0]}
goal: {joints: [-0.5, 1.2]}
scene: {obstacles: [{name: far, shape: {sphere: 0.1}, pose: {position: [-1, 0.18, 1]}}]}
planner: quintic
"""
"""With nothing in the way of the straight motion."""

NO_WAY = """\
version: 1
name: shut-in
robot: planar2r
start: {joints: [0.9, 0.5]}
goal: {joints: [-1.5708, 0]}
scene:
  obstacles:
    - {name: ceiling, shape: {box: [3.0, 0.1, 0.04]}, pose: {position: [0, 0.2, 0.75]}}
planner: rrtconnect
"""
"""Without a solution; its search does not end by itself."""
