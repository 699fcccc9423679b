"""The result of a design study: the front, the designs that were proved, a table, files."""

from typing import Any

from optiplan.files import csv_text
from optiplan.problem.write import problem_text
from optiplan.records import dataclass
from optiplan.studies.measures import MEASURES
from optiplan.studies.proof import DesignProof, chosen_designs
from optiplan.studies.search import Design, DesignJudge, DesignSearch
from optiplan.studies.study import DesignStudy


@dataclass(frozen=True, eq=False, repr=False)
class DesignResult:
    """Designs of a robot.

    Attributes:
        study: what was requested.
        search: all designs that were measured, and which are the front.
        proofs: designs that were planned with, with their bodies: the given one, the compromise, the best ones.
        seconds: of the whole study.
    """

    study: DesignStudy
    search: DesignSearch
    proofs: tuple[DesignProof, ...]
    seconds: float

    @property
    def given(self) -> Design:
        """The design with the given parameters."""
        return self.search.designs[0]

    @property
    def front(self) -> tuple[Design, ...]:
        """The best compromises, by the first objective."""
        return tuple(self.search.designs[k] for k in self.search.front)

    @property
    def compromise(self) -> Design | None:
        """The design of the front that is nearest to the best values of all objectives; None without a front."""
        chosen = chosen_designs(self.study, self.search)
        return next((self.search.designs[k] for role, k in chosen if "compromise" in role), None)

    @property
    def ended(self) -> str:
        """As the search ended; `interrupted`, too, where not every chosen design was planned with."""
        return self.search.ended if len(self.proofs) == self._chosen else "interrupted"

    @property
    def _chosen(self) -> int:
        return len(chosen_designs(self.study, self.search))

    @property
    def columns(self) -> list[tuple[str, str]]:
        """Names and units: of the parameters, then of the measures."""
        spec = self.study.spec
        parameters = [(name, spec.parameters[name].unit) for name in self.study.names]
        return parameters + [(name, MEASURES[name].unit) for name in self.given.measures]

    def row(self, design: Design) -> dict[str, float]:
        """Parameters and measures of a design by name."""
        return {**self.study.values(design.x), **design.measures}

    @property
    def wishes(self) -> list[tuple[str, float]]:
        """The objectives: names, with -1 for more and 1 for less."""
        return DesignJudge(self.study).wishes

    @property
    def words(self) -> str:
        """The result in a sentence."""
        ended = "" if self.ended == "finished" else f" ({self.ended})"
        counts = f"{len(self.search.designs)} designs measured in {self.search.generations} generations{ended}"
        if not self.front:
            nearest = min(self.search.designs, key=lambda design: design.violation)
            missed = "; ".join(DesignJudge(self.study).missed(nearest.measures)) if nearest.measures else "no robot"
            return f"{counts}: none meets what the study requires; of the nearest one: {missed}"
        verified = sum(proof.verified for proof in self.proofs)
        proved = f", {verified} of {self._chosen} chosen designs verified in all tasks" if self.study.tasks else ""
        return f"{counts}: {len(self.front)} on the front{proved}"

    @property
    def csv(self) -> str:
        """The front as CSV: a column for each parameter and measure with its unit, and the role of a chosen design."""
        names, rows = self.columns, list[list[str]]()
        roles = {id(proof.design): proof for proof in self.proofs}
        for design in ([] if self.given in self.front else [self.given]) + list(self.front):
            proof, row = roles.get(id(design)), self.row(design)
            words = [] if proof is None else [proof.role, _verified(proof)]
            rows.append([f"{row[name]:.9g}" if name in row else "" for name, _ in names] + (words or ["", ""]))
        return csv_text([f"{name} [{unit}]" if unit else name for name, unit in names] + ["role", "verified"], rows)

    @property
    def data(self) -> dict[str, Any]:
        """The result for `--json`; what a design cannot do is infinite."""
        return {
            "study": self.study.spec.name,
            "designs": len(self.search.designs),
            "generations": self.search.generations,
            "ended": self.ended,
            "front": [self.row(design) for design in self.front],
            "proofs": [
                {
                    "role": proof.role,
                    **self.row(proof.design),
                    "verified": proof.verified,
                    "durations": [run.duration for run in proof.runs],
                    "along": proof.along,
                    "trouble": proof.trouble,
                }
                for proof in self.proofs
            ],
        }

    @property
    def files(self) -> dict[str, str]:
        """Files of text by name: the front, and the robot of the compromise where there is one."""
        robot = {} if self.compromise is None else {"robot.yaml": self._robot_text(self.compromise)}
        return {"front.csv": self.csv, **robot}

    def _robot_text(self, design: Design) -> str:
        name = f"{self.study.description.get('name', 'robot')}_{self.study.spec.name}"
        data = self.study.robot_data(self.study.values(design.x)) | {"name": name}
        return problem_text({"version": 1, **data})

    def __repr__(self) -> str:
        """Return the result in a line."""
        return f"DesignResult: {self.words}"


def _verified(proof: DesignProof) -> str:
    return "yes" if proof.verified else "no"
