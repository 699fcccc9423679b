"""Drake's KinematicTrajectoryOptimization with SNOPT: a cubic B-spline of least duration and length, timed by itself.

Needs: pip install drake==1.51.1. As in Drake's examples, first without obstacles, from the straight line, then with
them: distances are kept above `clearance` (0.005 m by default) at `samples` instants (50 by default). When that fails
it starts again from random control points, until the budget is over. It takes one goal, the first.

Position, velocity and acceleration are bounded at the control points of the spline and its derivatives, hence
everywhere; torque, by the URDF's `effort`, at `torque` instants (0 by default: with 50, box/0011 takes 51 s, not 6 s).
"""

import itertools
import tempfile
import time
import xml.etree.ElementTree as ET

import numpy as np
from common import answer, locked_urdf, question, refuse
from pydrake.geometry import Box, CollisionFilterDeclaration, Cylinder, GeometrySet, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.inverse_kinematics import MinimumDistanceLowerBoundConstraint
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
from pydrake.planning import KinematicTrajectoryOptimization
from pydrake.solvers import SnoptSolver, SolverOptions
from pydrake.systems.framework import DiagramBuilder
from pydrake.trajectories import BsplineTrajectory

CONTROL_POINTS, ORDER = 10, 4
LONGEST = 20.0
"""s that a motion may take."""
SHARE = 0.8
"""Of the budget: the rest is for starting Python and loading."""


def scene_of(asked):
    """The diagram and the plant in it, root welded to the world, with actuators; pairs that may touch are filtered."""
    urdf = locked_urdf(asked)
    tree, builder = ET.fromstring(urdf), DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, 0.0)
    with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
        file.write(urdf)
        file.flush()
        Parser(plant).AddModels(file.name)
    children = {child.get("link") for child in tree.iterfind("joint/child")}
    (root,) = (link.get("name") for link in tree.findall("link") if link.get("name") not in children)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root))
    for name in asked["joints"]:
        effort = float(tree.find(f"joint[@name='{name}']/limit").get("effort", "inf"))
        plant.AddJointActuator(name, plant.GetJointByName(name), effort)
    for body in asked["obstacles"]:
        pose, friction = RigidTransform(np.array(body["pose"])), CoulombFriction(0.0, 0.0)
        plant.RegisterCollisionGeometry(plant.world_body(), pose, obstacle(body), body["name"], friction)
    plant.Finalize()
    for pair in asked["allowed"]:
        if all(plant.HasBodyNamed(name) for name in pair):
            a, b = (GeometrySet(plant.GetCollisionGeometriesForBody(plant.GetBodyByName(name))) for name in pair)
            graph.collision_filter_manager().Apply(CollisionFilterDeclaration().ExcludeBetween(a, b))
    return builder.Build(), plant


def obstacle(body):
    """A body of the scene."""
    ((kind, value),) = body["shape"].items()
    if kind == "box":
        return Box(*value)
    if kind == "sphere":
        return Sphere(value)
    if kind == "cylinder":
        return Cylinder(value["radius"], value["length"])
    return refuse(f"a body of kind {kind}")


def task(asked, plant, order):
    """The optimisation without obstacles; positions in the plant's order, which `order` makes of ours."""
    lower, upper, velocity, acceleration, start, goal = (
        np.array(values)[order]
        for values in [asked[k] for k in ("lower", "upper", "velocity", "acceleration", "start")] + asked["goals"][:1]
    )
    trial = KinematicTrajectoryOptimization(len(order), CONTROL_POINTS, ORDER)
    trial.AddDurationCost(1.0)
    trial.AddPathLengthCost(1.0)
    trial.AddDurationConstraint(0.05, LONGEST)
    trial.AddPositionBounds(lower, upper)
    trial.AddVelocityBounds(-velocity, velocity)
    trial.AddAccelerationBounds(-acceleration, acceleration)
    heavy = int(asked["settings"].get("torque", 0))
    if heavy:
        trial.AddEffortBoundsAtNormalizedTimes(plant, np.linspace(0, 1, heavy))
    for s, q in ((0.0, start), (1.0, goal)):
        trial.AddPathPositionConstraint(q, q, s)
        trial.AddPathVelocityConstraint(0 * q, 0 * q, s)
    line = np.linspace(start, goal, CONTROL_POINTS)[:, :, None]
    trial.SetInitialGuess(BsplineTrajectory(trial.basis(), list(line)))
    return trial


def solve(trial, seconds):
    """The spline that SNOPT ends with, and whether it keeps the constraints."""
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Time limit", max(seconds, 0.1))
    result = SnoptSolver().Solve(trial.prog(), None, options)
    return trial.ReconstructTrajectory(result), result.is_success()


def plan(asked, plant, context, order):
    """The spline, or None when no start led to one within the budget."""
    settings, rng = asked["settings"], np.random.default_rng(asked["seed"])
    end = time.perf_counter() + SHARE * asked["budget"]
    instants = np.linspace(0, 1, int(settings.get("samples", 50)))
    clear = MinimumDistanceLowerBoundConstraint(plant, float(settings.get("clearance", 0.005)), context, None, 0.01)
    trial = task(asked, plant, order)
    guess, _ = solve(trial, end - time.perf_counter())
    for s in instants[1:-1]:
        trial.AddPathPositionConstraint(clear, s)
    lower, upper = (np.array(asked[name])[order] for name in ("lower", "upper"))
    while time.perf_counter() < end:
        trial.SetInitialGuess(guess)
        spline, found = solve(trial, end - time.perf_counter())
        if found:
            return spline
        points = [np.array(point) for point in guess.control_points()]
        points[2:-2] = list(rng.uniform(lower, upper, (len(points) - 4, len(lower)))[:, :, None])
        guess = BsplineTrajectory(guess.basis(), points)
    return None


def pieces(spline, order):
    """The spline's polynomials between its knots, joints in our order."""
    knots, u = np.unique(spline.basis().knots()), np.linspace(0, 1, ORDER)
    back, coefficients = np.argsort(order), []
    for begin, end in itertools.pairwise(knots):
        values = spline.vector_values(begin + u * (end - begin)).T[:, back]
        powers = (end - begin) ** np.arange(ORDER)[:, None]
        coefficients.append((np.linalg.solve(np.vander(u, increasing=True), values) / powers).tolist())
    return {"breakpoints": (knots - knots[0]).tolist(), "coefficients": coefficients}


def main():
    """Answer one question."""
    asked = question()
    diagram, plant = scene_of(asked)
    context = plant.GetMyMutableContextFromRoot(diagram.CreateDefaultContext())
    order = np.argsort([plant.GetJointByName(name).position_start() for name in asked["joints"]])
    began = time.perf_counter()
    spline = plan(asked, plant, context, order)
    if spline is None:
        refuse("no start leads to a motion within the budget")
    answer(pieces=pieces(spline, order), seconds=time.perf_counter() - began)


main()
