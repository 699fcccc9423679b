"""Whether IPOPT finds shorter motions than the optimiser of `trajopt`, given the same program and the same seed.

    python benchmarks/ipopt_oracle.py --markdown ipopt.md                    # 20 problems

Problems: every k-th of MotionBenchMaker's seven Panda sets, to one goal configuration. The seed is a sampled path,
shortened. The optimiser (SQP) descends from it, with samples added where bodies touch between them, until the curve is
free. With the samples of that curve both begin again at the seed: the SQP, and IPOPT through CasADi. Its program is the
same elastic one: least T plus the prices of violations, over the free control points, T and a slack for each sample and
term; hard rows for velocity, acceleration and jerk control points; contacts from the planner's collision model and
torques from pinocchio enter as a callback with their exact Jacobian, the Hessian is of limited memory. A pair has a
row at a sample where it is near on either of three curves (the seed, the SQP's, IPOPT's last); IPOPT begins again while
its answer violates pairs without rows. A second descent of IPOPT begins at the SQP's answer: does that leave anything?

*T / SQP* compares durations, *merit / SQP* durations and prices of violations (a margin that is given up for time).
Below 0.995 IPOPT found a better motion. The last line printed is JSON.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy is imported: figures are for one core

import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from published import commit, import_sets, percentiles, print_json, print_table, table_parser, write_markdown
from rich.console import Console
from rich.progress import track

import optiplan as op
from optiplan.collision.native_model import planning_model
from optiplan.planners.base import Budget, Failure
from optiplan.planners.common.continuous_collision import contacts_along
from optiplan.planners.common.goal_ranking import goal_sampler
from optiplan.planners.sampling.sample_path import SamplingOptions, path_check, sample_path
from optiplan.planners.trajopt.initial_guess import along_path
from optiplan.planners.trajopt.optimizer import Optimiser, around
from optiplan.planners.trajopt.options import TrajOptOptions
from optiplan.planners.trajopt.program.sqp import DescentOptions, Point, evaluate
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import CENTIMETRE, Margins
from optiplan.planners.trajopt.terms.term import Curve

Array = npt.NDArray[np.float64]

FAR = 0.12
"""m; farther pairs are as good as at this distance."""

NEAR = 0.08
"""m; pairs nearer than this at a sample of a known curve have a row there."""

BEGIN_AGAIN = 3
"""Times that IPOPT begins again with pairs that its answer violated."""

BETTER = 0.995
"""Share of the SQP's duration or merit below which IPOPT's answer counts as better."""

STEPS, SECONDS = 400, 30.0
"""Iterations and s of each of IPOPT's descents."""

SETTINGS: dict[str, Any] = {
    "ipopt.hessian_approximation": "limited-memory",
    "ipopt.limited_memory_max_history": 20,
    "ipopt.max_iter": STEPS,
    "ipopt.max_cpu_time": SECONDS,
    "ipopt.tol": 1e-5,
    "ipopt.acceptable_tol": 1e-4,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "print_time": False,
}
FROM_AFAR = {"ipopt.mu_strategy": "adaptive"}
FROM_NEARBY = {"ipopt.mu_init": 1e-4, "ipopt.bound_push": 1e-6, "ipopt.bound_frac": 1e-6}

HEADINGS = (
    "problem",
    "rows",
    "SQP: T, s",
    "steps",
    "s",
    "IPOPT: T, s",
    "steps",
    "s",
    "T / SQP",
    "merit / SQP",
    "from the SQP's: T / SQP",
    "merit / SQP",
)


@dataclass(frozen=True, eq=False)
class Case:
    """One program: a seed, the span that prices are shares of, and what is seen at the samples."""

    transcription: Transcription
    seed: Array
    span: float

    @property
    def scale(self) -> Array:
        """What a variable of 1 is, for each of the M n: rad or m."""
        return np.tile(self.transcription.limits.velocity * self.span, self.transcription.basis.variables)

    def control(self, z: Array) -> Array:
        """Return the control points (K, n) at variables (M n,)."""
        n = self.seed.shape[1]
        return self.transcription.basis.moved(self.seed, (z * self.scale).reshape(-1, n))

    def variables(self, control: Array) -> Array:
        """Return the variables (M n,) of control points (K, n)."""
        moving = self.transcription.basis.moving
        return (moving(control) - moving(self.seed)).ravel() / self.scale

    def seen(self, control: Array, duration: float) -> Curve:
        """Return the curve at the samples."""
        return self.transcription.curve(control, duration)


@dataclass(eq=False)
class SoftRows:
    """Rows g >= 0 of chosen pairs at samples, cm, and of all torques at all samples, as functions of (z, T / span).

    Attributes:
        pairs: (R, 2) sample and pair of each row of clearance.
    """

    case: Case
    pairs: npt.NDArray[np.intp]
    limited: npt.NDArray[np.intp] = field(init=False)
    sparsity: ca.Sparsity = field(init=False)
    _known: tuple[bytes, Array, Array] | None = None

    def __post_init__(self) -> None:
        transcription = self.case.transcription
        N, M = transcription.samples.moving[0].shape
        self.limited = np.flatnonzero(np.isfinite(transcription.limits.torque))
        self.number = np.full((N, len(transcription.model.pairs)), -1)
        self.number[self.pairs[:, 0], self.pairs[:, 1]] = np.arange(len(self.pairs))
        torques = np.repeat(np.arange(N), 2 * len(self.limited))
        self.sample = np.concatenate([self.pairs[:, 0], torques])
        n = self.case.seed.shape[1]
        reaching = np.any([matrix != 0.0 for matrix in transcription.samples.moving], axis=0)  # (N, M)
        row, point = np.nonzero(reaching[self.sample])
        self._row, self._point = row, point
        rows = np.concatenate([np.repeat(row, n), np.arange(len(self.sample))])
        columns = np.concatenate([(point[:, None] * n + np.arange(n)).ravel(), np.full(len(self.sample), M * n)])
        shape = (len(self.sample), M * n + 1)
        places = sp.csc_matrix((np.arange(1, len(rows) + 1), (rows, columns)), shape=shape)
        self._order = places.data - 1
        self.sparsity = ca.Sparsity(*shape, places.indptr.tolist(), places.indices.tolist())

    @property
    def prices(self) -> tuple[Array, Array]:
        """Slack of each row, and the price of each slack as a share of the span."""
        contacts, torques = self.case.transcription.contacts, self.case.transcription.torques
        kinds = np.repeat([0, 1], [len(self.pairs), len(self.sample) - len(self.pairs)])
        keys, slack = np.unique(np.column_stack([kinds, self.sample]), axis=0, return_inverse=True)
        return slack.ravel(), np.where(keys[:, 0] == 0, contacts.price, torques.price)

    def at(self, x: Array) -> tuple[Array, Array]:
        """Return the rows (R,) and the entries of their Jacobian, in the order of `sparsity`."""
        key = x.tobytes()
        if self._known is None or self._known[0] != key:
            self._known = (key, *self._evaluated(x))
        return self._known[1], self._known[2]

    def _evaluated(self, x: Array) -> tuple[Array, Array]:
        case, transcription = self.case, self.case.transcription
        duration, n = float(x[-1]) * case.span, case.seed.shape[1]
        curve = case.seen(case.control(x[:-1]), duration)
        value, by_q, by_v, by_a = self._clearances(curve)
        shares = self._torques(curve)
        value, by_q, by_v, by_a = (np.concatenate(both) for both in zip((value, by_q, by_v, by_a), shares, strict=True))
        moving, s = transcription.samples.moving, self.sample
        entries = np.zeros((len(self._row), n))
        by_duration = np.zeros(len(value))
        for order, gradient in enumerate((by_q, by_v, by_a)):
            weight = moving[order][s[self._row], self._point] / duration**order
            entries += weight[:, None] * gradient[self._row]
            by_duration -= order * np.einsum("rj,rj->r", gradient, curve.motion[order][s]) / duration
        columns = case.scale.reshape(-1, n)[self._point]
        return value, np.concatenate([(entries * columns).ravel(), by_duration * case.span])[self._order]

    def _clearances(self, curve: Curve) -> tuple[Array, Array, Array, Array]:
        model, margins = self.case.transcription.model, self.case.transcription.margins
        Q, u = curve.motion[0], curve.samples.u
        found = model.near(Q, FAR)
        which = self.number[found.rows, found.pairs]
        gradients = model.gradients(Q, found)
        value, by_q = np.full(len(self.pairs), FAR), np.zeros((len(self.pairs), Q.shape[1]))
        value[which[which >= 0]], by_q[which[which >= 0]] = found.distance[which >= 0], gradients[which >= 0]
        value -= margins.at(u[self.pairs[:, 0]], self.pairs[:, 1])
        none = np.zeros_like(by_q)
        return value / CENTIMETRE, by_q / CENTIMETRE, none, none

    def _torques(self, curve: Curve) -> tuple[Array, Array, Array, Array]:
        term = self.case.transcription.torques
        tau, derivatives = term.residuals(curve)
        limit, n = term.limit[self.limited], curve.control.shape[1]
        share = tau[:, self.limited] / limit
        value = np.stack([1.0 - share, 1.0 + share], axis=1).ravel()
        slopes = [part[:, self.limited] / limit[:, None] for part in derivatives]
        return value, *(np.stack([-part, part], axis=1).reshape(-1, n) for part in slopes)


class Answer(NamedTuple):
    """Of one way: the curve, the steps of the last descent, s of all, and the number of rows."""

    point: Point
    steps: int
    seconds: float
    rows: int


class Rows(ca.Callback):  # type: ignore[misc]  # casadi has no types
    """`SoftRows` as a function of CasADi."""

    def __init__(self, soft: SoftRows) -> None:
        super().__init__()
        self.soft, self.slopes = soft, Slopes(soft)
        self.construct("rows", {})

    def get_sparsity_in(self, _: int) -> ca.Sparsity:
        """Variables and duration."""
        return ca.Sparsity.dense(self.soft.sparsity.size2(), 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        """The rows."""
        return ca.Sparsity.dense(self.soft.sparsity.size1(), 1)

    def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
        """Return the rows."""
        return [ca.DM(self.soft.at(np.array(arguments[0]).ravel())[0])]

    def has_jacobian(self) -> bool:
        """Yes."""
        return True

    def get_jacobian(self, *_: Any) -> ca.Function:
        """The function of the slopes."""
        return self.slopes

    def has_jac_sparsity(self, *_: int) -> bool:
        """Yes."""
        return True

    def get_jac_sparsity(self, *_: Any) -> ca.Sparsity:
        """Control points near a sample, and the duration."""
        return self.soft.sparsity


class Slopes(ca.Callback):  # type: ignore[misc]
    """Its Jacobian; CasADi hands it the value too."""

    def __init__(self, soft: SoftRows) -> None:
        super().__init__()
        self.soft = soft
        self.construct("jac_rows", {})

    def get_n_in(self) -> int:
        """Variables, and the rows."""
        return 2

    def get_sparsity_in(self, which: int) -> ca.Sparsity:
        """Variables, and the rows."""
        shape = self.soft.sparsity.size2() if which == 0 else self.soft.sparsity.size1()
        return ca.Sparsity.dense(shape, 1)

    def get_sparsity_out(self, _: int) -> ca.Sparsity:
        """That of the rows."""
        return self.soft.sparsity

    def eval(self, arguments: list[ca.DM]) -> list[ca.DM]:
        """Return the slopes."""
        return [ca.DM(self.soft.sparsity, self.soft.at(np.array(arguments[0]).ravel())[1])]


def ipopt(case: Case, begin: Array, duration: float, known: list[Array], settings: dict[str, Any]) -> Answer:
    """Descend with IPOPT from control points (K, n), until no pair without a row is violated."""
    began = time.perf_counter()
    pairs = set().union(*(near_rows(case, control, NEAR) for control in known))
    for _ in range(BEGIN_AGAIN):
        soft = SoftRows(case, np.array(sorted(pairs), dtype=np.intp).reshape(-1, 2))
        control, found, steps = descended(soft, begin, duration, settings)
        beyond = near_rows(case, control, 0.0) - pairs
        if not beyond:
            break
        pairs |= near_rows(case, control, NEAR)
    point = evaluate(case.transcription, control, found, case.span)
    return Answer(point, steps, time.perf_counter() - began, len(soft.sample))


def near_rows(case: Case, control: Array, cutoff: float) -> set[tuple[int, int]]:
    """Sample and pair nearer than this beyond the margin, on a curve (K, n)."""
    samples = case.transcription.samples
    found = case.transcription.model.near(samples.at[0] @ control, cutoff + case.transcription.margins.middle)
    wanted = case.transcription.margins.at(samples.u[found.rows], found.pairs)
    near = found.distance < cutoff + wanted
    return set(zip(found.rows[near].tolist(), found.pairs[near].tolist(), strict=True))


def descended(soft: SoftRows, begin: Array, duration: float, settings: dict[str, Any]) -> tuple[Array, float, int]:
    """One descent from control points (K, n) and a duration, s: the last ones, and the iterations."""
    case, transcription = soft.case, soft.case.transcription
    basis, limits, rates = transcription.basis, transcription.limits, transcription.rates
    count, slack = len(case.scale), soft.prices
    x = ca.MX.sym("x", count + 1 + len(slack[1]))
    z, share, loose = x[:count], x[count], x[count + 1 :]
    rows = Rows(soft)
    spread = sp.csc_matrix((np.ones(len(slack[0])), (np.arange(len(slack[0])), slack[0])))
    constraints = [rows(x[: count + 1]) + sparse(spread) @ loose]
    for order, (matrix, bound) in enumerate(zip(basis.bounded, rates, strict=True), start=1):
        unit = np.tile(bound * case.span**order, len(matrix))
        steady = (matrix @ case.seed).ravel() / unit
        moving = sp.csc_matrix(np.kron(basis.by_variables(matrix), np.eye(len(bound))))
        rate = sparse(sp.diags(1.0 / unit) @ moving @ sp.diags(case.scale)) @ z + steady
        constraints += [share**order - rate, share**order + rate]
    g = ca.vertcat(*constraints)
    program = {"x": x, "f": transcription.objective.time * share + ca.dot(slack[1], loose), "g": g}
    solver = ca.nlpsol("ipopt", "ipopt", program, SETTINGS | settings)
    first = np.append(case.variables(begin), 1.01 * duration / case.span)
    value, _ = soft.at(first)
    missing = np.zeros(len(slack[1]))
    np.maximum.at(missing, slack[0], -value)
    moving = basis.moving(case.seed)
    low, high = ((side - moving).ravel() / case.scale for side in (limits.lower, limits.upper))
    found = solver(
        x0=np.concatenate([first, missing + 1e-3]),
        lbx=np.concatenate([low, [0.2], np.zeros(len(missing))]),
        ubx=np.concatenate([high, [10.0], np.full(len(missing), np.inf)]),
        lbg=0.0,
        ubg=np.inf,
    )
    answer = np.array(found["x"]).ravel()
    return case.control(answer[:count]), float(answer[count]) * case.span, int(solver.stats()["iter_count"])


def sparse(matrix: sp.spmatrix) -> ca.DM:
    """Return the matrix as one of CasADi."""
    matrix = sp.csc_matrix(matrix)
    matrix.sort_indices()
    return ca.DM(ca.Sparsity(*matrix.shape, matrix.indptr.tolist(), matrix.indices.tolist()), matrix.data)


def posed(problem: op.Problem, budget: float) -> tuple[Optimiser, Array] | None:
    """Return the optimiser of a problem and control points of the seed; None where no path was found."""
    options, model = TrajOptOptions(), planning_model(problem.robot, problem.scene)
    within = Budget(budget)
    within.start()
    sampler = goal_sampler(problem, model, within)
    if isinstance(sampler, Failure):
        return None
    optimiser = Optimiser(problem, model, options)
    goal, check = sampler.configurations[0], path_check(model, problem.limits)
    path = sample_path(check, problem.start, [goal], SamplingOptions(within, seed=problem.seed))
    if isinstance(path, Failure):
        return None
    return optimiser, along_path(optimiser.basis, path.waypoints, problem.limits.velocity)


def settled(optimiser: Optimiser, seed: Array) -> Array | None:
    """Return the samples at which the SQP's curve from the seed is free between them too; None: it never was."""
    descender, u, control = optimiser.descender(seed), optimiser.instants(seed), seed
    for _ in range(optimiser.options.refinements + 1):
        descender.set_samples(u)
        found = descender.optimise(control, DescentOptions(optimiser.options.iterations, lambda: False))
        control, trajectory = found.control, optimiser.timed(found.control, found.duration)
        if trajectory is None:
            return None
        touches = list(contacts_along(optimiser.model, trajectory, lambda: False))
        if not touches:
            return np.unique(u)
        times = [touch.t / trajectory.duration for touch in touches]
        u = np.concatenate([u, *(around(np.unique(u), share) for share in times)])
    return None


def compared(problem: op.Problem, name: str, budget: float) -> dict[str, Any] | None:
    """Both descents of one problem; None where there is no seed, or the SQP's curve is not free."""
    made = posed(problem, budget)
    if made is None:
        return None
    optimiser, seed = made
    u = settled(optimiser, seed)
    if u is None:
        return None
    margins = Margins.between(optimiser.model, seed[[0, -1]], optimiser.options.margin)
    transcription = Transcription(problem, optimiser.model, optimiser.basis, margins)
    transcription.set_samples(u)
    case = Case(transcription, seed, optimiser.basis.shortest_duration(seed, problem.limits.rates))
    descender = optimiser.descender(seed)
    descender.set_samples(u)
    began = time.perf_counter()
    own = descender.optimise(seed, DescentOptions(optimiser.options.iterations, lambda: False))
    seconds, known = time.perf_counter() - began, [seed, own.control]
    ways = {
        "sqp": Answer(evaluate(transcription, own.control, own.duration, case.span), own.steps, seconds, 0),
        "ipopt": ipopt(case, seed, case.span, known, FROM_AFAR),
        "after": ipopt(case, own.control, own.duration, known, FROM_NEARBY),
    }
    row: dict[str, Any] = {"problem": name, "rows": ways["ipopt"].rows}
    for way, answer in ways.items():
        row |= {f"{way}_T": answer.point.duration, f"{way}_merit": answer.point.merit}
        row |= {f"{way}_feasible": answer.point.feasible, f"{way}_steps": answer.steps, f"{way}_s": answer.seconds}
    return row


def line(row: dict[str, Any]) -> list[str]:
    """One row of the table."""
    return [
        row["problem"],
        f"{row['rows']}",
        f"{row['sqp_T']:.4f}",
        f"{row['sqp_steps']}",
        f"{row['sqp_s']:.2f}",
        f"{row['ipopt_T']:.4f}" + ("" if row["ipopt_feasible"] else " (violates)"),
        f"{row['ipopt_steps']}",
        f"{row['ipopt_s']:.1f}",
        *(f"{row[f'{way}_{key}'] / row[f'sqp_{key}']:.4f}" for way in ("ipopt", "after") for key in ("T", "merit")),
    ]


def main() -> None:
    """Compare all and print the table."""
    parser = table_parser(__doc__)
    parser.add_argument("--problems", type=int, default=20)
    parser.add_argument("--every", type=int, default=14, help="every k-th problem of each set")
    parser.add_argument("--budget", type=float, default=10.0, help="s of the search for a seed")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory() as folder:
        sets = import_sets("panda", Path(folder), options.every)
        files = [file for files in zip(*sets.values(), strict=False) for file in files]
        try:
            for file in track(files, "IPOPT", console=console, transient=True):
                if len(rows) == options.problems:
                    break
                name = f"{file.parent.name}/{file.stem}"
                row = compared(op.load_problem(file), name, options.budget)
                if row is None:
                    console.print(f"{name}: no seed that leads to a free curve")
                    continue
                rows.append(row)
                console.print(", ".join(line(row)))
        except KeyboardInterrupt:
            pass
    table = [line(row) for row in rows]
    print_table(HEADINGS, table)
    remarks = [summary(rows, way, key) for way in ("ipopt", "after") for key in ("T", "merit")]
    write_markdown(options.markdown, HEADINGS, table, remarks)
    print_json({"commit": commit(), "runs": rows})


def summary(rows: list[dict[str, Any]], way: str, key: str) -> str:
    """How IPOPT's durations or merits compare, in a sentence."""
    ratios = [row[f"{way}_{key}"] / row[f"sqp_{key}"] for row in rows]
    least, median, most = percentiles(ratios, 0, 50, 100)
    better = sum(ratio < BETTER for ratio in ratios)
    word = {"T": "Durations", "merit": "Merits"}[key]
    begun = {"ipopt": "from the seed", "after": "from the SQP's answer"}[way]
    return (
        f"{word} of IPOPT {begun}, over the SQP's: least {least:.4f}, median {median:.4f}, most {most:.4f}; "
        f"better by more than {100 * (1 - BETTER):.1f} % on {better} of {len(ratios)}."
    )


if __name__ == "__main__":
    main()
