"""`verify`: check a trajectory against its problem."""

from dataclasses import replace
from typing import Any

from optiplan.collision.kept_models import collision_model
from optiplan.problem.problem import Problem
from optiplan.robot.robot import Robot
from optiplan.robot.self_collision.pair_proof import BEYOND, GAP
from optiplan.robot.self_collision.pairs import count_reasons
from optiplan.trajectory.sample_file import Samples
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import limit_checks
from optiplan.verify.constraint_check import path_constraints
from optiplan.verify.continuous.certificate import Proof, certify
from optiplan.verify.continuous.torque import torque
from optiplan.verify.report import Check, Report, VerifyPolicy
from optiplan.verify.samples_check import samples
from optiplan.verify.scope import scope
from optiplan.verify.via_check import vias

_DEFAULT = VerifyPolicy()


def verify(
    problem: Problem, trajectory: Trajectory, policy: VerifyPolicy = _DEFAULT, given: Samples | None = None
) -> Report:
    """Check a trajectory against every requirement of its problem; a bad trajectory is refused, never an exception.

    Args:
        problem: the problem.
        trajectory: the trajectory, of any origin.
        policy: tolerances.
        given: samples stored with the pieces of the trajectory, to be checked against them.

    Returns:
        Every check with its worst value, limit, time and place; those that need a well-formed trajectory of the right
        joints are left out, and said to be, when it is not one.
    """
    found = [limit_checks.form(trajectory)]
    if found[0].passed:
        found.append(limit_checks.joints(problem, trajectory))
    robot = checked_robot(problem, policy)
    report = Report(
        policy,
        tuple(found),
        dict(robot.link_geometry),
        robot.notes,
        unchecked_pairs=count_reasons(robot.allowed),
        links_without_geometry=robot.bare_links,
        over_cover=dict(robot.over_cover),
    )
    if not all(check.passed for check in found):
        unread = "nothing else was checked: the trajectory cannot be read as a motion of this robot"
        return replace(report, notes=(*robot.notes, unread))
    found += _motion(problem, trajectory, policy)
    if given is not None:
        found.append(samples(problem, trajectory, policy, given))
    found.append(collision(problem, trajectory, policy))
    return replace(report, checks=tuple(found), scope=scope(problem, robot, found))


def checked_robot(problem: Problem, policy: VerifyPolicy) -> Robot:
    """Return the robot with all pairs checked that are not proved for this problem.

    A proof is about the robot's own limits of position and a little beyond, and proved pairs may be nearer than a
    clearance asked for.
    """
    own, wanted = problem.robot.limits, problem.limits
    covered = (wanted.lower >= own.lower).all() and (wanted.upper <= own.upper).all()
    within = policy.clearance < GAP and policy.position_tolerance < BEYOND
    return problem.robot if covered and within else problem.robot.with_proved_checked()


def _motion(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    return [
        limit_checks.start(problem, trajectory, policy),
        limit_checks.goal(problem, trajectory),
        *([vias(problem, trajectory)] if problem.vias else []),
        *path_constraints(problem, trajectory, policy),
        limit_checks.rest(problem, trajectory, policy),
        limit_checks.continuity(problem, trajectory, policy),
        limit_checks.position(problem, trajectory, policy),
        *(limit_checks.rate(problem, trajectory, policy, order) for order in (1, 2, 3)),
        torque(problem, trajectory, policy),
    ]


def collision(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Check that every pair of bodies stays apart at all times, by the certificate.

    `worst` is the clearance proved; where none is proved, the smallest distance met.
    """
    model = collision_model(checked_robot(problem, policy), problem.scene)
    proof = certify(model, trajectory, policy)
    near = proof.nearest
    witness: dict[str, Any] = {
        "pairs": len(model.pairs),
        "intervals": proof.intervals,
        "queries": proof.queries,
        "believed": proof.gjk_only,
        "proved_clearance": proof.clearance if proof.proved and model.pairs else None,
        "met_clearance": None if near is None else near.distance,
        "contact": proof.contact,
    }
    if proof.proved and not model.pairs:
        return Check("collision", "continuous", proof.proved, detail="no two bodies can meet", witness=witness)
    verdict = Check(
        "collision", "continuous", proof.proved, limit=policy.clearance, unit="m", detail=_words(proof), witness=witness
    )
    verdict = replace(verdict, worst=witness["proved_clearance"])
    if near is None:
        return verdict
    witness |= {"pair": list(near.pair), "points": near.points.tolist(), "q": near.q.tolist()}
    worst = proof.clearance if proof.proved else near.distance
    return replace(verdict, worst=worst, time=near.time, place=" – ".join(near.pair), witness=witness)


def _words(proof: Proof) -> str:
    """Describe the proof in one sentence."""
    work = f"{proof.intervals} intervals, {proof.queries} distance queries"
    trust = f", {proof.gjk_only} of them of non-convex meshes, as measured less 1e-6 m" if proof.gjk_only else ""
    if proof.proved:
        met = "" if proof.nearest is None else f" (smallest met: {1e3 * proof.nearest.distance:.3g} mm)"
        return f"proved clear by more than {1e3 * proof.clearance:.3g} mm at all times{met}: {work}{trust}"
    return f"{proof.reason}: {work}{trust}"
