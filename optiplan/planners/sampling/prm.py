"""`prm`: a roadmap of the scene, reused by later queries of the same planner object."""

from collections import OrderedDict
from math import inf

from optiplan.collision.model import CollisionModel
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.planners.base import Budget
from optiplan.planners.option_schema import option
from optiplan.planners.sampling.base import SampledOptions, SamplingPlanner, SearchSetup
from optiplan.planners.sampling.constrained.planner import ConstrainedSearch
from optiplan.planners.sampling.edge_checker import MotionCheck
from optiplan.planners.sampling.ompl_space import Ends, search_bounds
from optiplan.planners.sampling.roadmap import Roadmap
from optiplan.planners.sampling.search import Search
from optiplan.records import dataclass

_KEPT = 4  # roadmaps kept: those of the latest scenes


@dataclass(frozen=True)
class PrmOptions(SampledOptions):
    """Options of every sampling planner, and those of the roadmap."""

    vertices: int = option(
        400,
        "of the roadmap before its first query; a query that finds no path adds half as many again and again.",
        above=0,
    )
    most_vertices: int = option(4000, "where that ends; bounds the memory, some 50 MB.", above=0)


class Prm(SamplingPlanner[PrmOptions]):
    """Planner by probabilistic roadmaps; use one object for many queries, in one thread: roadmaps grow with each.

    The first query of a scene answers as every other planner does: the same for the same problem and seed. The answer
    to a later one depends on the queries before it.

    Attributes:
        roadmaps: by the inputs they are valid for: the bodies, the pairs, what these keep, the limits and the seed.
    """

    Options = PrmOptions

    holds_constraints = True  # with a roadmap of its own for each query

    def __init__(self, options: PrmOptions | None = None) -> None:
        super().__init__(options)
        self.roadmaps: OrderedDict[tuple[object, ...], Roadmap] = OrderedDict()

    def setup(self) -> SearchSetup:
        """Return the search on the roadmap of the scene."""
        constrained = ConstrainedSearch(roadmap=True, vertices=max(1, self.options.vertices // 4))
        return SearchSetup(self.search, detour=inf, constrained=constrained)

    def search(self, check: MotionCheck, ends: Ends, budget: Budget, seed: int, *, patience: float = inf) -> Search:
        """Query the roadmap of this scene and grow it until it connects the ends; a `search.Searcher`.

        The roadmap is kept, so its patience does not end before its vertices.
        """
        roadmap = self._roadmap(check, ends, seed)
        count = max(self.options.vertices, len(roadmap.vertices))
        while True:
            roadmap.grow(check, count, ends, budget)
            found = roadmap.query(check, ends, budget)
            if found.path is not None or budget.over or count >= self.options.most_vertices:
                return found
            count = min(count + max(1, self.options.vertices // 2), self.options.most_vertices)

    def _roadmap(self, check: MotionCheck, ends: Ends, seed: int) -> Roadmap:
        box = search_bounds(check.limits, ends)
        bounds = (check.limits.torque, check.limits.velocity, *box)
        key = (*world_key(check.model), *(bound.tobytes() for bound in bounds), seed)
        if key in self.roadmaps and len(self.roadmaps[key].vertices) > 2 * self.options.most_vertices:
            del self.roadmaps[key]  # mostly ends of queries
        roadmap = self.roadmaps.setdefault(key, Roadmap(box, check.limits.velocity, seed))
        self.roadmaps.move_to_end(key)
        while len(self.roadmaps) > _KEPT:
            self.roadmaps.popitem(last=False)
        return roadmap


def world_key(model: CollisionModel) -> tuple[object, ...]:
    """Return the inputs of free space.

    The robot's files, group and locked joints, shapes and poses, the pairs, their floors, and the tracking error.
    """
    robot, scene = model.robot, model.scene
    held = [(item.name, item.link, item.shape, item.X_LO.homogeneous.tobytes()) for item in scene.attached]
    around = [(item.name, item.shape, item.X_WO.homogeneous.tobytes()) for item in scene.obstacles]
    pairs = [(pair.name_a, pair.name_b) for pair in model.pairs]
    which = (robot.fingerprint, robot.group, robot.mounting.key, *sorted(robot.locked.items()), *robot.joint_names)
    error = None if model.error is None else model.error.tobytes()
    return (which, *held, *around, *pairs, error, *_floors_key(model))


def _floors_key(model: CollisionModel) -> tuple[object, ...]:
    if not isinstance(model, NativeCollisionModel) or model.floors is None:
        return ()
    floors = model.floors
    ends = [(one.pair, one.base, floors.ends[one.end].tobytes()) for one in floors.at_ends]
    return (floors.asked.tobytes(), floors.within, *ends)
