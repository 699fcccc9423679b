"""`verify`: hold a trajectory against its problem."""

from dataclasses import replace
from typing import Any

from optiplan.model.collision import CollisionModel
from optiplan.problem.problem import Problem
from optiplan.trajectory.trajectory import Trajectory
from optiplan.verify import checks
from optiplan.verify.certificate import Proof, certify
from optiplan.verify.passing import vias
from optiplan.verify.report import Check, Report, VerifyPolicy

_DEFAULT = VerifyPolicy()


def verify(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy = _DEFAULT) -> Report:
    """Check a trajectory against everything its problem demands; a bad trajectory is a refusal, never an exception.

    Args:
        problem: what was asked.
        trajectory: what was answered, by whomever.
        policy: how strict to be.

    Returns:
        Every check with its worst value, limit, time and place; those that need a well-formed trajectory of the right
        joints are left out, and said to be, when it is not one.
    """
    found = [checks.form(trajectory)]
    if found[0].passed:
        found.append(checks.joints(problem, trajectory))
    notes = [*problem.robot.notes, *_allowed(problem)]
    if all(check.passed for check in found):
        found += _motion(problem, trajectory, policy)
        found.append(collision(problem, trajectory, policy))
    else:
        notes.append("nothing else was checked: the trajectory cannot be read as a motion of this robot")
    robot = problem.robot
    return Report(policy, tuple(found), dict(robot.link_geometry), tuple(notes), dict(robot.over_cover))


def _allowed(problem: Problem) -> list[str]:
    """Which contacts the problem waves through, if any: allowed pairs, and what attached objects may touch."""
    pairs = {" – ".join(sorted(pair)) for pair in problem.scene.allowed}
    pairs |= {" – ".join(sorted((held.name, link))) for held in problem.scene.attached for link in held.touch}
    return [f"contacts allowed by the problem, not checked: {', '.join(sorted(pairs))}"] if pairs else []


def _motion(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> list[Check]:
    return [
        checks.start(problem, trajectory, policy),
        checks.goal(problem, trajectory),
        *([vias(problem, trajectory)] if problem.vias else []),
        checks.rest(problem, trajectory, policy),
        checks.continuity(problem, trajectory, policy),
        checks.position(problem, trajectory, policy),
        *(checks.rate(problem, trajectory, policy, order) for order in (1, 2, 3)),
        checks.torque(problem, trajectory, policy),
    ]


def collision(problem: Problem, trajectory: Trajectory, policy: VerifyPolicy) -> Check:
    """Every pair of bodies stays apart at all times, by the certificate."""
    model = CollisionModel(problem.robot, problem.scene)
    proof = certify(model, trajectory, policy)
    witness: dict[str, Any] = {
        "pairs": len(model.pairs),
        "intervals": proof.intervals,
        "queries": proof.queries,
        "believed": proof.believed,
        "proved_clearance": proof.clearance if proof.proved and model.pairs else None,
        "contact": proof.contact,
    }
    if proof.proved and not model.pairs:
        return Check("collision", "continuous", proof.proved, detail="no two bodies can meet", witness=witness)
    verdict = Check(
        "collision", "continuous", proof.proved, limit=policy.clearance, unit="m", detail=_words(proof), witness=witness
    )
    if proof.nearest is None:
        return verdict
    near = proof.nearest
    witness |= {"pair": list(near.pair), "points": near.points.tolist(), "q": near.q.tolist()}
    return replace(verdict, worst=near.distance, time=near.time, place=" – ".join(near.pair), witness=witness)


def _words(proof: Proof) -> str:
    """The proof in one sentence."""
    work = f"{proof.intervals} intervals, {proof.queries} distance queries"
    trust = f", {proof.believed} of them of non-convex meshes, believed to 1e-6 m" if proof.believed else ""
    if proof.proved:
        return f"proved clear by more than {1e3 * proof.clearance:.3g} mm at all times: {work}{trust}"
    return f"{proof.reason}: {work}{trust}"
