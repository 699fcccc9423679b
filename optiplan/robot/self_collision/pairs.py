"""Which pairs of links go unchecked: fixed to each other, adjacent and always touching, proved apart, or declared.

Whatever is none of these is checked. A pair is

    fixed       no planned joint moves it, so nothing about it can change;
    adjacent    exactly one planned joint moves it, and it touches over practically all of that joint's range; not where
                a locked joint and a link with a body lie between the two, which may touch for how that joint stands;
    proved      it stays apart over the whole joint box (`pair_proof`);
    declared    the robot file's `allowed_collisions` or its SRDF says so.
"""

from collections.abc import Collection, Mapping
from itertools import takewhile

import numpy as np
import pinocchio as pin

from optiplan.arrays import Array
from optiplan.config.document import Document
from optiplan.config.messages import choices
from optiplan.errors import InputError
from optiplan.robot.frames import link_names
from optiplan.robot.self_collision.pair_survey import ALWAYS, PairSurvey, link_pairs, survey_pairs
from optiplan.robot.spec import RobotSpec
from optiplan.robot.urdf.reader import UrdfSource
from optiplan.robot.urdf.srdf import LinkPair, Srdf, link_pair

FIXED, ADJACENT, PROVED, FILE, SRDF = "fixed", "adjacent", "proved", "robot file", "SRDF"
"""Reasons why a pair goes unchecked; that of an SRDF is followed by the SRDF's own word."""

WORDS = {
    ADJACENT: "adjacent",
    PROVED: "proved never to meet",
    FIXED: "fixed to each other",
    FILE: "allowed by the robot file",
    SRDF: "disabled by the SRDF",
}


def fixed_pairs(model: pin.Model, geometry: pin.GeometryModel) -> dict[LinkPair, str]:
    """Pairs of links with no planned joint between them: they never move against each other."""
    parents = [int(item.parentJoint) for item in geometry.geometryObjects]
    return {
        links: FIXED
        for links, bodies in link_pairs(model, geometry).items()
        if all(parents[i] == parents[j] for i, j in bodies)
    }


def set_pairs(model: pin.Model, geometry: pin.GeometryModel, allowed: Collection[LinkPair]) -> None:
    """Make the collision pairs of `geometry` all those of different links that are not in `allowed`."""
    wanted = np.zeros((geometry.ngeoms, geometry.ngeoms), dtype=bool)
    for links, bodies in link_pairs(model, geometry).items():
        if links not in allowed:
            wanted[tuple(np.transpose(bodies))] = True
    geometry.setCollisionPairs(wanted, True)  # one at a time, each makes room for all of them again


def declared_pairs(
    spec: RobotSpec, document: Document, model: pin.Model, srdf: Srdf | None = None
) -> dict[LinkPair, str]:
    """Pairs that the SRDF disables, with its word for each, and those of the robot.yaml's `allowed_collisions`.

    Raises:
        InputError: a name in `allowed_collisions` that is no link.
    """
    links = link_names(model)
    issues = [
        document.issue(("allowed_collisions", k, i), f"unknown link '{name}'", choices(name, links))
        for k, pair in enumerate(spec.allowed_collisions)
        for i, name in enumerate(pair)
        if name not in links
    ]
    if issues:
        raise InputError(issues)
    disabled = {} if srdf is None else {pair: f"{SRDF}: {word}" for pair, word in srdf.disabled.items()}
    return {**disabled, **{link_pair(a, b): FILE for a, b in spec.allowed_collisions}}


class Locked:
    """Where locked joints lie between links.

    Args:
        urdf: the whole robot, in which all joints move.
        joints: the locked joints.
        bodies: names of the links with a body.
    """

    def __init__(self, urdf: UrdfSource, joints: Collection[str], bodies: Collection[str]) -> None:
        self._joints, self._bodies = set(joints), set(bodies)
        ends = zip(urdf.edges, urdf.joint_types, strict=True)
        self._before = {child: (joint, parent) for (parent, child), joint in ends}

    def part(self, pair: LinkPair) -> bool:
        """Return whether a locked joint and a link with a body, which is none of these two, lie between two links."""
        ways = [self._to_root(link) for link in pair]
        common = {link for _, link in ways[0]} & {link for _, link in ways[1]}
        branches = [list(takewhile(lambda step: step[1] not in common, way)) for way in ways]
        joints = {joint for branch in branches for joint, _ in branch}
        links = {link for branch in branches for _, link in branch}
        links |= {way[len(branch)][1] for way, branch in zip(ways, branches, strict=True)}  # in which they meet
        return not joints.isdisjoint(self._joints) and not (links - set(pair)).isdisjoint(self._bodies)

    def _to_root(self, link: str) -> list[tuple[str, str]]:
        """The joint before each link, and the link, from this one to the root, which has none."""
        way = []
        while link in self._before:
            joint, parent = self._before[link]
            way.append((joint, link))
            link = parent
        return [*way, ("", link)]


def unchecked_pairs(
    model: pin.Model,
    geometry: pin.GeometryModel,
    limits: tuple[Array, Array],
    declared: Mapping[LinkPair, str],
    locked: Locked | None,
) -> tuple[dict[LinkPair, str], list[str]]:
    """Pairs that need no check and why, and a note on checked ones that touch nearly always.

    Args:
        model: reduced to the planned joints.
        geometry: its bodies.
        limits: lower and upper limits of position, (n,).
        declared: pairs that the user allows.
        locked: tells which pairs are no neighbours; None: with an SRDF exactly its pairs go unchecked.
    """
    allowed = {**declared, **fixed_pairs(model, geometry)}
    if locked is None:
        return allowed, []
    survey = survey_pairs(model, geometry, limits)
    adjacent = [pair for pair in survey.adjacent if not locked.part(pair)]
    found = {**dict.fromkeys(adjacent, ADJACENT), **dict.fromkeys(survey.proved, PROVED)}
    allowed |= dict(sorted(found.items()))
    return allowed, _touching_note(survey, allowed)


def srdf_words(allowed: Mapping[LinkPair, str]) -> dict[LinkPair, str]:
    """The reasons in the words of an SRDF."""
    words = {FIXED: "Adjacent", ADJACENT: "Adjacent", PROVED: "Never", FILE: "User"}
    return {pair: words.get(reason) or reason.partition(": ")[2] for pair, reason in allowed.items()}


def count_reasons(allowed: Mapping[LinkPair, str]) -> dict[str, int]:
    """Count the unchecked pairs by reason."""
    reasons = [reason.partition(":")[0] for reason in allowed.values()]
    return {reason: reasons.count(reason) for reason in WORDS if reason in reasons}


def reasons_in_words(counts: Mapping[str, int]) -> str:
    """Such a count as a line of a report."""
    total = sum(counts.values())
    listed = ", ".join(f"{count} {WORDS[reason]}" for reason, count in counts.items())
    return f"{total} {'pair' if total == 1 else 'pairs'} of links not checked" + (f": {listed}" if counts else "")


def _touching_note(survey: PairSurvey, allowed: Collection[LinkPair]) -> list[str]:
    """Say which checked pairs touch in nearly every configuration, so that the robot can hardly move."""
    touching = [f"{a}-{b}" for (a, b), rate in survey.rates.items() if rate >= ALWAYS and (a, b) not in allowed]
    if not touching:
        return []
    cure = "`allowed_collisions` in the robot file excuses pairs that are built so"
    return [f"checked, though they touch in nearly every configuration: {', '.join(touching)}; {cure}"]
