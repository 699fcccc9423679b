"""Check that bodies stay apart, by the certificate."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from optiplan.arrays import Array, finite_or_none
from optiplan.collision.bodies_and_pairs import with_asked_checked
from optiplan.collision.floors import Floors, floors_of
from optiplan.collision.kept_models import collision_model
from optiplan.collision.model import CollisionModel
from optiplan.collision.moving_obstacles import joint_count
from optiplan.problem.problem import Problem
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_proof import BEYOND, GAP
from optiplan.trajectory.joining import with_obstacles
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.continuous.clearance_record import ClearanceRecord
from optiplan.verify.continuous.proof import SCENE, SELF, Moment, Proof
from optiplan.verify.report import Check, VerifyPolicy
from optiplan.verify.safety_words import asked_words
from optiplan.verify.statements import body, motion, safety, tube


def checked_robot(problem: Problem, policy: VerifyPolicy) -> Robot:
    """Return the robot with all pairs checked that are not proved for this problem.

    A proof is about the robot's own limits of position and a little beyond, and proved pairs may be nearer than a
    clearance asked for by the policy or by the problem.
    """
    own, wanted = problem.robot.limits, problem.limits
    covered = (wanted.lower >= own.lower).all() and (wanted.upper <= own.upper).all()
    within = policy.clearance < GAP and policy.position_tolerance < BEYOND
    robot = problem.robot if covered and within else problem.robot.with_proved_checked()
    return with_asked_checked(problem.scene.safety, robot)


class Certified(NamedTuple):
    """A proof with its work space, the motion of joints and obstacles, floors, and how far these joints may be off."""

    model: CollisionModel
    motion: Trajectory
    floors: Floors | None
    error: Array
    proof: Proof


def certified(
    problem: Problem, trajectory: Trajectory, policy: VerifyPolicy, record: ClearanceRecord | None = None
) -> Certified:
    """Ask the certificate for a motion of a problem without a task; `record` is filled with what it proves."""
    model = collision_model(checked_robot(problem, policy), problem.scene)
    error = np.append(problem.tracking_error, np.zeros(joint_count(model.motions)))
    floors = floors_of(model, problem.scene.safety, problem.tracking_error)
    moved = with_obstacles(trajectory, model.motions)
    proof = certify(model, moved, policy, record, error=error, floors=floors)
    return Certified(model, moved, floors, error, proof)


def collision(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Check that every pair of bodies stays apart at all times, by the certificate.

    The scene knows the ends about which pairs may be nearer than its `Safety` asks, as that of a `ScenePart` does.

    `worst` is the clearance proved; where none is proved, the smallest distance met, or the deepest contact at the time
    at which bodies touch. The witness has it of the robot with what it holds (`self_clearance`) and from obstacles
    (`scene_clearance`), too.
    """
    model, _, floors, error, proof = certified(problem, trajectory, policy)
    near = _deepest(model, proof.nearest) if proof.nearest is not None and proof.contact else proof.nearest
    witness: dict[str, Any] = {
        "pairs": len(model.pairs),
        "intervals": proof.intervals,
        "queries": proof.queries,
        "believed": proof.gjk_only,
        "proved_clearance": proof.clearance if proof.proved and model.pairs else None,
        "self_clearance": finite_or_none(proof.least[SELF]) if proof.proved else None,
        "scene_clearance": finite_or_none(proof.least[SCENE]) if proof.proved else None,
        "proved_by_robot": len(proof.kept),
        "met_clearance": None if near is None else near.distance,
        "contact": proof.contact,
        **asked_words(model, problem.scene.safety, floors),
    }
    covers = (*_covered(model), *tube(problem, "clearance"), *safety(problem.scene))
    verdict = Check("collision", "continuous", proof.proved, covers=covers, witness=witness)
    if proof.proved and not model.pairs:
        return replace(verdict, detail="no two bodies can meet")
    proved = witness["proved_clearance"]
    verdict = replace(verdict, worst=proved, limit=_limit(policy, floors), unit="m", detail=_words(proof, error))
    if near is None:
        return verdict
    witness |= near.witness(trajectory.n)
    worst = proof.clearance if proof.proved else near.distance
    return replace(verdict, worst=worst, time=near.time, place=" – ".join(near.pair), witness=witness)


def _limit(policy: VerifyPolicy, floors: Floors | None) -> float:
    """The least clearance that is asked of any pair, m."""
    if floors is None or not len(floors.asked):
        return policy.clearance
    bases = [one.base for one in floors.at_ends]
    return max(policy.clearance, min(float(floors.asked.min()), *bases, np.inf))


def _covered(model: CollisionModel) -> tuple[str, ...]:
    """Return the statements of a problem that a proof with these bodies and motions is a check of."""
    bodies = model.names[len(model.robot.link_boxes) :]
    moving = [motion(one.name) for one, _ in zip(model.scene.dynamic_obstacles, model.motions, strict=True)]
    return "robot.links", *map(body, bodies), *moving


def _deepest(model: CollisionModel, met: Moment) -> Moment:
    """Return the deepest contact at the time of one that was met: the proof ends at the first, of whatever depth."""
    found = model.clearance(met.q)
    names = met.pair if found is None else (found.pair.name_a, found.pair.name_b)
    if found is None or names == met.pair or found.distance >= met.distance:
        return met
    return met._replace(distance=found.distance, pair=names, points=np.array([found.point_a, found.point_b]))


def _words(proof: Proof, error: Array) -> str:
    work = f"{proof.intervals} intervals, {proof.queries} distance queries"
    trust = f", {proof.gjk_only} of them of non-convex meshes, as measured less 1e-6 m" if proof.gjk_only else ""
    count = len(proof.kept)
    kept = f", {count} {'pair' if count == 1 else 'pairs'} of links proved once for this robot" if count else ""
    if proof.proved:
        met = "" if proof.nearest is None else f" (smallest met: {1e3 * proof.nearest.distance:.3g} mm)"
        where = ", wherever the joints are within the tracking error" if error.any() else ""
        return f"proved clear by more than {_clearances(proof)} at all times{where}{met}: {work}{trust}{kept}"
    return f"{proof.reason}: {work}{trust}{kept}"


def _clearances(proof: Proof) -> str:
    """The clearance proved; where there are pairs of both kinds, of each."""
    own, scene = (float(least) for least in proof.least)
    if not (np.isfinite(own) and np.isfinite(scene)):
        return f"{1e3 * proof.clearance:.3g} mm"
    return f"{1e3 * scene:.3g} mm from the scene and {1e3 * own:.3g} mm of the robot from itself"
