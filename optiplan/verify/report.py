"""Report of the verifier: `VerifyPolicy` holds its tolerances, `Report` its checks."""

import math
from collections.abc import Mapping
from dataclasses import asdict, field
from html import escape
from typing import Any

import numpy as np

from optiplan.arrays import number_argument
from optiplan.errors import whole_argument
from optiplan.records import dataclass

_LEAST_INTERVAL = 1e-12
"""s: so short are parts of a piece of a million seconds after 60 halvings; they are counted in 64 bits."""


@dataclass(frozen=True)
class VerifyPolicy:
    """Tolerances and limits of the verifier; printed in every report.

    Attributes:
        clearance: required distance of bodies at all times, m.
        limit_tolerance: fraction of a velocity, acceleration, jerk or torque limit by which it may be passed.
        position_tolerance: tolerance of the start and of the position limits, rad or m.
        jump_tolerance: sum of all steps of position at breakpoints, rad or m; the certificate covers such steps.
        rest_tolerance: largest velocity and acceleration at both ends (off what the problem states there), and sum of
            all their steps at breakpoints, as a fraction of their limits.
        torque_rate: intervals a second, Hz, with which the proof of the torques begins.
        min_interval: an interval shorter than this, s, on which clearance or a torque cannot be proved is a refusal;
            1e-12 s at least.
        max_queries: exact distance queries, or torques, after which a proof is given up.

    Raises:
        InputError: a number out of its range.
    """

    clearance: float = 0.0
    limit_tolerance: float = 1e-6
    position_tolerance: float = 1e-6
    jump_tolerance: float = 1e-7
    rest_tolerance: float = 1e-5
    torque_rate: float = 200.0
    min_interval: float = 1e-9
    max_queries: int = 1_000_000

    def __post_init__(self) -> None:
        for name in ("clearance", "limit_tolerance", "position_tolerance", "jump_tolerance", "rest_tolerance"):
            number_argument("VerifyPolicy", name, getattr(self, name), "a number >= 0", 0.0)
        number_argument("VerifyPolicy", "torque_rate", self.torque_rate, "a number of Hz above 0", above=0.0)
        least = _LEAST_INTERVAL
        number_argument("VerifyPolicy", "min_interval", self.min_interval, f"a number of seconds >= {least:g}", least)
        whole_argument("VerifyPolicy", "max_queries", self.max_queries, 1)


@dataclass(frozen=True)
class Check:
    """Result of one check.

    Attributes:
        name: of the check, e.g. `velocity`.
        kind: `exact` (holds at all times, from polynomial extrema or from data), `continuous` (proved for all times by
            halving intervals), `sampled` (holds at the sampled instants) or `unchecked` (there is nothing to hold it
            against; the detail says why).
        passed: whether the trajectory satisfies it.
        worst: the value nearest to or farthest beyond the limit; None when nothing could be measured.
        limit: the limit of the check.
        unit: of `worst` and `limit`.
        time: of the worst value, s.
        place: joint, frame or pair of bodies.
        detail: one sentence for a person.
        witness: JSON-ready evidence: `points`, `pair`, `q`, counts.
        covers: statements of the problem that it is a check of (see `verify.statements`).
    """

    name: str
    kind: str
    passed: bool
    worst: float | None = None
    limit: float | None = None
    unit: str = ""
    time: float | None = None
    place: str = ""
    detail: str = ""
    witness: Mapping[str, Any] = field(default_factory=dict)
    covers: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class Report:
    """Verdict on a trajectory with its evidence.

    Attributes:
        policy: tolerances of the verifier.
        checks: every check, in order.
        link_geometry: geometry used for each link: mesh, hull or convex pieces.
        notes: remarks on the robot, and what was not checked.
        scope: what the verdict is about: pairs, shapes, torques; short statements beside the verdict.
        unchecked_pairs: how many pairs of links went unchecked, by reason (see `robot.self_collision.pairs`).
        links_without_geometry: links without a body, whose contacts are not checked.
        over_cover: how far (m) `link_geometry` reaches beyond a link's meshes at most, measured.
        tracking_error: how far joints may be from the motion, rad or m, in the robot's order; `scope` says what of the
            verdict holds of all these configurations. Empty: the verdict is about the motion alone.
    """

    policy: VerifyPolicy
    checks: tuple[Check, ...]
    link_geometry: Mapping[str, str]
    notes: tuple[str, ...] = ()
    scope: tuple[str, ...] = ()
    unchecked_pairs: Mapping[str, int] = field(default_factory=dict)
    links_without_geometry: tuple[str, ...] = ()
    over_cover: Mapping[str, float] = field(default_factory=dict)
    tracking_error: tuple[float, ...] = ()

    @property
    def verified(self) -> bool:
        """Return whether the trajectory passed every check."""
        return bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def failures(self) -> tuple[Check, ...]:
        """Return the checks that failed."""
        return tuple(check for check in self.checks if not check.passed)

    def __repr__(self) -> str:
        """Return the verdict in one line, with the checks that failed."""
        refused = "; ".join(
            f"{check.name}: {check.detail or check.place or 'beyond its limit'}" for check in self.failures
        )
        verdict = "verified" if self.verified else f"not verified: {refused or 'nothing was checked'}"
        names = ", ".join(check.name for check in self.checks)
        return f"Report: {verdict} ({len(self.checks)} checks{': ' if names else ''}{names})"

    def _repr_html_(self) -> str:
        """The verdict and a row a check, for notebooks."""
        rows = "".join(
            f"<tr><td>{'✓' if check.passed else '✗'}</td><th>{check.name}</th><td>{check.kind}</td>"
            f"<td>{_number(check.worst)}</td><td>{_number(check.limit)}</td><td>{check.unit}</td>"
            f"<td>{escape(check.place)}</td><td>{escape(check.detail)}</td></tr>"
            for check in self.checks
        )
        head = (
            "<tr><th></th><th>check</th><th>kind</th><th>worst</th><th>limit</th><th>unit</th><th></th><th></th></tr>"
        )
        return f"<p><b>{'verified' if self.verified else 'not verified'}</b></p><table>{head}{rows}</table>"

    def to_dict(self) -> dict[str, Any]:
        """Return JSON-ready data; values that are not finite become null."""
        return {
            "verified": self.verified,
            "policy": asdict(self.policy),
            "checks": [jsonable(asdict(check)) for check in self.checks],
            "link_geometry": dict(self.link_geometry),
            "over_cover": dict(self.over_cover),
            "notes": list(self.notes),
            "scope": list(self.scope),
            "unchecked_pairs": dict(self.unchecked_pairs),
            "links_without_geometry": list(self.links_without_geometry),
            "tracking_error": list(self.tracking_error),
        }


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def jsonable(value: Any) -> Any:
    """Plain lists, dicts and finite numbers; NaN and infinities become None."""
    if isinstance(value, Mapping):
        return {str(key): jsonable(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [jsonable(item) for item in value]
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
