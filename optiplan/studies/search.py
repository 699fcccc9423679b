"""NSGA-II over the parameters of a study, and the front of all designs that it measured."""

from collections.abc import Callable

import numpy as np

from optiplan.arrays import Array, Index
from optiplan.errors import OptiPlanError
from optiplan.planners.base import Budget, Progress, silent
from optiplan.records import dataclass
from optiplan.studies.measures import DesignMeasures
from optiplan.studies.study import DesignStudy

_BROKEN = 1e6
"""Violation of a design that cannot be measured: more than of any other."""


@dataclass(frozen=True, eq=False)
class Design:
    """A design that was measured.

    Attributes:
        x: the parameters (p,).
        measures: by name; empty where the parameters make no robot.
        violation: sum of how far it is from what the study requires, in shares of that; 0: it meets everything.
    """

    x: Array
    measures: dict[str, float]
    violation: float


@dataclass(frozen=True, eq=False)
class DesignSearch:
    """The designs of a search.

    Attributes:
        designs: all of them, the given one first.
        front: which are feasible, and no other is as good in every objective and better in one.
        generations: that were finished.
        ended: `finished`, `budget` or `interrupted`.
    """

    designs: tuple[Design, ...]
    front: tuple[int, ...]
    generations: int
    ended: str


class DesignJudge:
    """Measures designs of a study, and says how good they are."""

    def __init__(self, study: DesignStudy) -> None:
        self.study, self._measures = study, DesignMeasures(study)
        spec = study.spec
        self.wishes = [*((name, -1.0) for name in spec.maximise), *((name, 1.0) for name in spec.minimise)]

    def design(self, x: Array) -> Design:
        """Measure the design with these parameters (p,)."""
        try:
            measures = self._measures.of(self.study.values(x))
        except OptiPlanError:
            return Design(x, {}, _BROKEN)
        return Design(x, measures, sum(self.missed(measures).values()))

    def missed(self, measures: dict[str, float]) -> dict[str, float]:
        """What measures miss of what the study requires, in words, and by which share of that."""
        found = {f"{name}: a place of a task is missing": 1.0 for name, x in measures.items() if np.isposinf(x)}
        for name, required in self.study.spec.require.items():
            value = measures[name]
            for bound, sign, words in ((required.least, 1.0, "at least"), (required.most, -1.0, "at most")):
                if bound is not None and sign * (bound - value) > 0.0:
                    share = float(np.clip(sign * (bound - value) / max(abs(bound), 1e-3), 0.0, 1e3))
                    found[f"{name} {value:.4g}, required {words} {bound:g}"] = share
        return found

    def objectives(self, design: Design) -> Array:
        """The objectives (w,) in the order of `wishes`, each to be made small."""
        values = {**self.study.values(design.x), **design.measures}
        found = [sign * values.get(name, np.inf) for name, sign in self.wishes]
        return np.where(np.isfinite(found), found, 1e12)


def search_designs(
    study: DesignStudy,
    budget: Budget | None,
    progress: Progress = silent,
    keep: Callable[[Design], None] = lambda design: None,
) -> DesignSearch:
    """Search the parameters of a study with NSGA-II.

    Its generations cross over the best designs so far and change them at random. The given design is one of the first.
    Ctrl-C and the end of the budget end the search; what was measured stays. Before the first design Ctrl-C is passed
    on: there is nothing to keep.
    Source: K. Deb et al., IEEE Trans. Evolutionary Computation 6 (2002).

    Args:
        study: what is searched.
        budget: None: until the last generation.
        progress: called with the stage and its fraction.
        keep: called with every design as it is measured.
    """
    judge, spec = DesignJudge(study), study.spec.search
    designs: list[Design] = []
    generation, ended = 0, "finished"
    total = spec.population * spec.generations
    steps = _nsga2(study, len(judge.wishes))
    try:
        X = steps.first()
        while generation < spec.generations and ended == "finished":
            own: list[Design] = []
            for x in X:
                if designs and budget is not None and budget.over:
                    ended = "budget"
                    break
                own.append(judge.design(x))
                designs.append(own[-1])
                keep(own[-1])
                progress(_stage(generation, spec.generations, designs), min(1.0, len(designs) / total))
            if ended == "finished":
                generation += 1
                F = np.array([judge.objectives(design) for design in own])
                G = np.array([[design.violation] for design in own])
                X = steps.next(F, G)
    except KeyboardInterrupt:
        if not designs:
            raise
        ended = "interrupted"
    return DesignSearch(tuple(designs), front_of(judge, designs), generation, ended)


def front_of(judge: DesignJudge, designs: list[Design]) -> tuple[int, ...]:
    """Which feasible designs no other dominates, each once, in rising order of the first objective."""
    feasible = [k for k, design in enumerate(designs) if design.violation == 0.0]
    if not feasible:
        return ()
    F = np.array([judge.objectives(designs[k]) for k in feasible])
    return tuple(feasible[k] for k in nondominated(F))


def nondominated(F: Array) -> Index:
    """Rows of F (N, w) that no other row equals or beats in every column; the first of equal ones; by column 0."""
    order = np.lexsort(F.T[::-1])
    kept: list[int] = []
    for k in order:  # a row that dominates another one comes before it
        if not kept or not (F[kept] <= F[k]).all(axis=1).any():
            kept.append(int(k))
    return np.array(kept, dtype=np.intp)


def _stage(generation: int, generations: int, designs: list[Design]) -> str:
    feasible = sum(design.violation == 0.0 for design in designs)
    return f"generation {generation + 1} of {generations}, {len(designs)} designs, {feasible} feasible"


class _Steps:
    """The generations of pymoo's NSGA-II: parameters out, values in."""

    def __init__(self, study: DesignStudy, objectives: int) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.core.problem import Problem as PymooProblem
        from pymoo.operators.sampling.lhs import LHS

        spec = study.spec.search
        p = len(study.names)
        self._problem = PymooProblem(n_var=p, n_obj=objectives, n_ieq_constr=1, xl=study.lower, xu=study.upper)
        self._given = study.given
        self._algorithm = NSGA2(pop_size=spec.population, sampling=LHS())
        self._algorithm.setup(self._problem, termination=("n_gen", spec.generations + 1), seed=spec.seed, verbose=False)

    def first(self) -> Array:
        """The parameters (population, p) of the first generation, the given ones first."""
        self._asked = self._algorithm.ask()
        X = np.array(self._asked.get("X"), dtype=np.float64)
        X[0] = self._given
        self._asked.set("X", X)
        return X

    def next(self, F: Array, G: Array) -> Array:
        """The parameters of the next generation, after the objectives (k, w) and violations (k, 1) of the last one."""
        from pymoo.core.evaluator import Evaluator
        from pymoo.problems.static import StaticProblem

        Evaluator().eval(StaticProblem(self._problem, F=F, G=G), self._asked)
        self._algorithm.tell(infills=self._asked)
        self._asked = self._algorithm.ask()
        return np.array(self._asked.get("X"), dtype=np.float64)


def _nsga2(study: DesignStudy, objectives: int) -> _Steps:
    try:
        return _Steps(study, objectives)
    except ImportError:
        raise OptiPlanError("design: pymoo is not installed; expected: pip install 'optiplan[design]'") from None
