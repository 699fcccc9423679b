"""Planners that grow trees: `rrtconnect`, `kpiece`, `rrtstar`, `informed_rrtstar` and `bitstar`."""

from functools import partial

from optiplan.planners.option_schema import option
from optiplan.planners.sampling.base import SampledOptions, SamplingPlanner, SearchSetup
from optiplan.planners.sampling.constrained.planner import ConstrainedSearch
from optiplan.planners.sampling.ompl_search import search
from optiplan.planners.sampling.search import Kind, SearchOptions
from optiplan.records import dataclass


@dataclass(frozen=True)
class TreeOptions(SampledOptions):
    """Options of every sampling planner, and one more."""

    reach: float = option(0.4, "longest edge of the trees, s at full joint speed.", above=0)


class RrtConnect(SamplingPlanner[TreeOptions]):
    """Two trees that grow towards each other; return the first path found, shortened.

    The native core grows them, else OMPL. The fastest to find a path.
    """

    Options = TreeOptions

    holds_constraints = True

    def setup(self) -> SearchSetup:
        """Return RRT-Connect."""
        return SearchSetup(partial(search, options=SearchOptions("rrtconnect", self.options.reach)))


class Kpiece(SamplingPlanner[TreeOptions]):
    """Two trees that grow from the borders of the work space they have covered: OMPL's LBKPIECE1.

    Coverage is counted in cells of the tool's position; edges are checked lazily.
    """

    Options = TreeOptions

    def setup(self) -> SearchSetup:
        """Return LBKPIECE1."""
        return SearchSetup(partial(search, options=SearchOptions("kpiece", self.options.reach)))


@dataclass(frozen=True)
class RrtStarOptions(SampledOptions):
    """Options of every sampling planner, and those of the tree."""

    reach: float = option(0.8, "longest tree edge, s at full joint speed.", above=0)
    iterations: int = option(
        600,
        "of a round. Rounds follow each other, each where only paths shorter than the best can pass, until three in a "
        "row gain less than 1 % or most of the budget is gone.",
        above=0,
    )


class RrtStar(SamplingPlanner[RrtStarOptions]):
    """One tree whose branches are rewired to shorter ones: OMPL's RRT*.

    It shortens the path of RRT-Connect, by joint-space path time (`shortcutting.path_time`).
    """

    Options = RrtStarOptions

    holds_constraints = True

    kind: Kind = "rrtstar"

    def setup(self) -> SearchSetup:
        """Return RRT-Connect, improved by RRT*."""
        o = self.options
        constrained = ConstrainedSearch(iterations=o.iterations, informed=self.kind == "informed_rrtstar")
        improve = partial(search, options=SearchOptions(self.kind, o.reach, o.iterations))
        return SearchSetup(improve=improve, constrained=constrained)


class InformedRrtStar(RrtStar):
    """RRT* that samples only the ellipsoid that can shorten the best path; length is ||dq / v||.

    For the path time OMPL would need a cost-to-go heuristic. Its Python binding does not accept one (2.0.1:
    `setCostToGoHeuristic` takes no function) and would sample everywhere, as RRT* does.
    """

    kind: Kind = "informed_rrtstar"


@dataclass(frozen=True)
class BitStarOptions(SampledOptions):
    """Options of every sampling planner, and those of the batches."""

    batches: int = option(
        10, "of a hundred samples in a round; rounds follow each other as those of `rrtstar` do.", above=0
    )


class BitStar(SamplingPlanner[BitStarOptions]):
    """Batches of samples, searched in the order of potential path cost: OMPL's BIT*.

    It shortens the path of RRT-Connect in time (`shortcutting.path_time`), and checks few edges.
    """

    Options = BitStarOptions

    def setup(self) -> SearchSetup:
        """Return RRT-Connect, improved by BIT*."""
        return SearchSetup(improve=partial(search, options=SearchOptions("bitstar", effort=self.options.batches)))
