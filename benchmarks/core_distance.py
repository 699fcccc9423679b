"""Distances of the native core beside coal's on the same random pairs of shapes: nanoseconds a query, and differences.

    python benchmarks/core_distance.py                  # a million pairs, every combination of shapes
    python benchmarks/core_distance.py --pairs 50000 --markdown distances.md

Nanoseconds a query, of pairs that are apart: the distance, the distance where it is within 5 cm and else a bound, and a
yes or no; then of pairs that overlap. The hull is that of a link of the Panda. coal is called from Python; what a call
costs there, taken as that for two balls, is subtracted. Differences from coal are over all pairs, of cylinders over
those apart; differences from the closed form, where there is one, over all pairs. The last line printed is one JSON
object.
"""

import time
from itertools import combinations_with_replacement
from typing import Any

import coal
import numpy as np
from published import print_json, print_table, table_parser, write_markdown
from scipy.spatial.transform import Rotation

from optiplan._core import core, variant
from optiplan.geometry import coal_queries as _primed  # noqa: F401
from optiplan.robot.robot import load_robot

CUTOFF = 0.05
RADIUS, THIN, HALF_LENGTH = 0.1, 0.08, 0.2
"""m, of ball and cylinder, of the capsule, and of both along their axes."""
SIDES = np.array([0.1, 0.2, 0.3])
"""m, half the sides of the box."""


def shapes() -> dict[str, tuple[Any, Any]]:
    """Names to shapes of the core and of coal."""
    link = next(b.geometry for b in load_robot("panda").geometry.geometryObjects if "link5" in b.name)
    points = np.array([link.point(i) for i in range(link.num_points)])
    return {
        "ball": (core.Shape.sphere(RADIUS), coal.Sphere(RADIUS)),
        "capsule": (core.Shape.capsule(THIN, HALF_LENGTH), coal.Capsule(THIN, 2 * HALF_LENGTH)),
        "box": (core.Shape.box(SIDES), coal.Box(*(2 * SIDES))),
        "cylinder": (core.Shape.cylinder(RADIUS, HALF_LENGTH), coal.Cylinder(RADIUS, 2 * HALF_LENGTH)),
        f"hull of {len(points)}": (core.Shape.convex_hull(points), link),
    }


def poses(rng: np.random.Generator, count: int, reach: float) -> np.ndarray:
    """Random poses (N, 4, 4) within a cube, m."""
    X = np.tile(np.eye(4), (count, 1, 1))
    X[:, :3, :3] = Rotation.random(count, random_state=rng).as_matrix()
    X[:, :3, 3] = rng.uniform(-reach, reach, (count, 3))
    return X


def closed_form(a: str, X_WA: np.ndarray, b: str, X_WB: np.ndarray) -> np.ndarray | None:
    """Signed distances (N,), m, of shapes of these names by formulas written for this; None where there is none."""
    if (a, b) == ("capsule", "capsule"):
        return between_segments(X_WA, X_WB) - 2 * THIN
    if a != "ball" or b not in SIGNED:
        return None
    centre = np.einsum("nji,nj->ni", X_WB[:, :3, :3], X_WA[:, :3, 3] - X_WB[:, :3, 3])
    return SIGNED[b](centre) - RADIUS


def outside(parts: np.ndarray) -> np.ndarray:
    """Signed distance of a point from what is bounded by 0 in each of these coordinates (N, k): box, slab and disc."""
    return np.linalg.norm(np.maximum(parts, 0.0), axis=1) + np.minimum(parts.max(axis=1), 0.0)


SIGNED = {
    "ball": lambda p: np.linalg.norm(p, axis=1) - RADIUS,
    "capsule": lambda p: np.linalg.norm(p - p.clip(*np.outer([-1, 1], [0, 0, HALF_LENGTH])), axis=1) - THIN,
    "box": lambda p: outside(np.abs(p) - SIDES),
    "cylinder": lambda p: outside(
        np.column_stack([np.hypot(p[:, 0], p[:, 1]) - RADIUS, np.abs(p[:, 2]) - HALF_LENGTH])
    ),
}
"""Signed distances (N,), m, of points p (N, 3) in the frame of a shape."""


def between_segments(X_WA: np.ndarray, X_WB: np.ndarray) -> np.ndarray:
    """Distances (N,), m, of the axes of capsules.

    The squared distance is convex in the places s, t on both axes: its minimum is that of the two lines, or lies on an
    edge of the square of places.
    """
    between, c = X_WA[:, :3, 3] - X_WB[:, :3, 3], np.einsum("ni,ni->n", X_WA[:, :3, 2], X_WB[:, :3, 2])
    along_a, along_b = (np.einsum("ni,ni->n", X[:, :3, 2], between) for X in (X_WA, X_WB))

    def apart(s: np.ndarray, t: np.ndarray) -> np.ndarray:
        return np.linalg.norm(between + s[:, None] * X_WA[:, :3, 2] - t[:, None] * X_WB[:, :3, 2], axis=1)

    def clipped(x: np.ndarray) -> np.ndarray:
        return x.clip(-HALF_LENGTH, HALF_LENGTH)

    s = (c * along_b - along_a) / (1.0 - c**2)
    t = along_b + c * s
    inside = (np.abs(s) <= HALF_LENGTH) & (np.abs(t) <= HALF_LENGTH)
    edges = [
        apart(*places)
        for end in (np.full(len(c), HALF_LENGTH), np.full(len(c), -HALF_LENGTH))
        for places in ((end, clipped(along_b + c * end)), (clipped(c * end - along_a), end))
    ]
    return np.where(inside, np.minimum(apart(s, t), np.min(edges, axis=0)), np.min(edges, axis=0))


def timed(call: Any, count: int) -> float:
    """Nanoseconds of a call for each of `count` pairs: the quicker of two."""
    seconds = []
    for _ in range(2):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return 1e9 * min(seconds) / max(count, 1)


def by_coal(a: Any, X_WA: np.ndarray, b: Any, X_WB: np.ndarray) -> tuple[np.ndarray, float]:
    """Distances (N,) and nanoseconds a query; the transforms are made beforehand."""
    request, result = coal.DistanceRequest(True, True), coal.DistanceResult()
    request.gjk_tolerance = request.epa_tolerance = 1e-9
    request.gjk_max_iterations = 500
    placed = [
        (coal.Transform3s(A[:3, :3], A[:3, 3]), coal.Transform3s(B[:3, :3], B[:3, 3]))
        for A, B in zip(X_WA, X_WB, strict=True)
    ]
    found = np.empty(len(placed))
    start = time.perf_counter()
    for k, (A, B) in enumerate(placed):
        result.clear()
        found[k] = coal.distance(a, A, b, B, request, result)
    return found, 1e9 * (time.perf_counter() - start) / max(len(placed), 1)


def compare(known: dict[str, tuple[Any, Any]], a: str, b: str, count: int) -> dict[str, float | None]:
    """A row of the table."""
    one, two, curved = known[a], known[b], "cylinder" in (a, b)
    rng = np.random.default_rng(0)
    X_WA, X_WB = poses(rng, count, 0.2), poses(rng, count, 0.6)
    distance = core.distances(one[0], X_WA, two[0], X_WB)[0]
    theirs = by_coal(one[1], X_WA, two[1], X_WB)[0]
    truth = closed_form(a, X_WA, b, X_WB)
    apart = distance > 1e-6
    compared = apart if curved else np.ones(count, bool)
    difference = (distance - theirs)[compared]
    A, B, over_A, over_B = X_WA[apart], X_WB[apart], X_WA[~apart], X_WB[~apart]
    return {
        "apart": float(apart.mean()),
        "ns_apart": timed(lambda: core.distances(one[0], A, two[0], B), len(A)),
        "ns_cutoff": timed(lambda: core.distances(one[0], A, two[0], B, CUTOFF), len(A)),
        "ns_overlap": timed(lambda: core.overlaps_within(one[0], A, two[0], B), len(A)),
        "ns_depth": timed(lambda: core.distances(one[0], over_A, two[0], over_B), len(over_A)),
        "ns_coal": by_coal(one[1], A, two[1], B)[1],
        "ns_coal_depth": by_coal(one[1], over_A, two[1], over_B)[1],
        "above": float(difference.max()),
        "below": float(-difference.min()),
        "off": None if truth is None else float(np.abs(distance - truth).max()),
    }


def main() -> None:
    """Compare every combination."""
    parser = table_parser(__doc__)
    parser.add_argument("--pairs", type=int, default=1_000_000, help="random pairs, over all combinations")
    options = parser.parse_args()
    if core is None:
        parser.error("the native core is not built: make core")
    known = shapes()
    combinations = list(combinations_with_replacement(known, 2))
    count = max(options.pairs // len(combinations), 1)
    rows: dict[str, dict[str, Any]] = {}
    for a, b in combinations:
        rows[f"{a} – {b}"] = compare(known, a, b, count)
    call = rows["ball – ball"]["ns_coal"]
    headings = [
        "shapes",
        "apart",
        "core, apart",
        "within 5 cm",
        "overlap",
        "depth",
        "coal, apart",
        "coal, depth",
        "most above coal, m",
        "most below, m",
        "off the closed form, m",
    ]
    table = [
        [
            name,
            f"{row['apart']:.0%}",
            *(f"{row[key]:.0f}" for key in ("ns_apart", "ns_cutoff", "ns_overlap", "ns_depth")),
            *(f"{row[key] - call:.0f}" for key in ("ns_coal", "ns_coal_depth")),
            f"{row['above']:.0e}",
            f"{row['below']:.0e}",
            "–" if row["off"] is None else f"{row['off']:.0e}",
        ]
        for name, row in rows.items()
    ]
    print_table(headings, table)
    write_markdown(options.markdown, headings, table, [f"Nanoseconds; build of the core: {variant}."])
    print_json({"core": variant, "pairs": count * len(combinations), "rows": rows})


if __name__ == "__main__":
    main()
