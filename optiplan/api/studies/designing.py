"""`design`: numbers of a robot chosen for what it has to do."""

from collections.abc import Mapping
from pathlib import Path
from time import perf_counter
from typing import Any

from optiplan.api.planning import plan_within, positive_seconds
from optiplan.api.studies.result_folder import ResultFolder
from optiplan.errors import described, progress_argument, wrong_argument
from optiplan.planners.base import Budget, Progress, silent
from optiplan.runs.run_folder import folder_argument
from optiplan.studies.measures import MEASURES, check_measures
from optiplan.studies.proof import DesignProof, chosen_designs, prove_design
from optiplan.studies.result import DesignResult
from optiplan.studies.search import DesignSearch, search_designs
from optiplan.studies.study import DesignStudy, read_study
from optiplan.viewer.plots.design_front import design_page, front_pdf

RESULT = ResultFolder("design.html", "robot.yaml")


def design(
    study: Path | str | Mapping[str, Any],
    *,
    out: Path | str | None = None,
    budget: float | None = None,
    progress: Progress | None = None,
) -> DesignResult:
    """Search numbers of a robot, such as link lengths, masses and limits, for the best compromises.

    NSGA-II proposes parameters; each design is measured over states of the robot and the places of the tasks, without
    bodies. The given design, the compromise and the best one in every objective then get their bodies and are given the
    tasks: planned and verified. Ctrl-C ends the search, and what was found so far is the result.

    Args:
        study: a study file, or its content; docs/how-to/design.md has the keys.
        out: folder for `design.html`, `front.pdf`, `front.csv` and, if there is a front, `robot.yaml`; None: nothing.
        budget: s for the search; None: until its last generation.
        progress: called with the stage and its fraction.

    Returns:
        The result: `front`, `compromise`, `given`, `proofs`, `search`.

    Raises:
        InputError: with every issue of the study, by file and line; an argument that does not fit; `out` has a
            `robot.yaml` that no earlier result left there.
        OptiPlanError: pymoo is not installed.

    Example:
        >>> import optiplan as op
        >>> found = op.design(
        ...     {
        ...         "version": 1,
        ...         "name": "elbow",
        ...         "robot": "two_links",
        ...         "parameters": {"upper": {"range": [0.2, 0.8], "unit": "m"}},
        ...         "changes": {"dh.rows.0.a": "=upper", "dh.rows.1.a": "=1 - upper"},
        ...         "states": {"count": 500},
        ...         "maximise": ["manipulability"],
        ...         "search": {"population": 8, "generations": 8},
        ...     }
        ... )
        >>> 0.45 < found.row(found.front[0])["upper"] < 0.55
        True
    """
    progress_argument("design", progress)
    if not isinstance(study, Path | str | Mapping):
        expected = "the path of a study file, or a mapping of its keys"
        raise wrong_argument("design", "study", described(study), expected)
    allowed = None if budget is None else Budget(positive_seconds("design", budget))
    folder = folder_argument("design", out, RESULT.check)
    began = perf_counter()
    read = read_study(study, MEASURES)
    check_measures(read)
    told = progress or silent
    search = search_designs(read, allowed, told)
    proofs = _proofs(read, search, told)
    result = DesignResult(read, search, proofs, perf_counter() - began)
    if folder is not None:
        save_design(result, folder)
    return result


def save_design(result: DesignResult, folder: Path) -> list[Path]:
    """Write `design.html`, `front.pdf`, `front.csv` and, of a compromise, `robot.yaml`; return the paths.

    Raises:
        InputError: the folder cannot be written, or has a `robot.yaml` that no earlier result left there.
    """
    files = {
        "design.html": design_page(result).encode(),
        "front.pdf": front_pdf(result),
        **{name: text.encode() for name, text in result.files.items()},
    }
    return RESULT.write(folder, files)


def _proofs(study: DesignStudy, search: DesignSearch, progress: Progress) -> tuple[DesignProof, ...]:
    """The chosen designs with the tasks; Ctrl-C leaves out those that are not done."""
    proofs = []
    try:
        for role, k in chosen_designs(study, search):
            proofs.append(prove_design(study, role, search.designs[k], plan_within, progress))
    except KeyboardInterrupt:
        pass
    return tuple(proofs)
