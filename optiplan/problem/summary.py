"""A problem in one line, and as a small table for notebooks."""

import html
from collections.abc import Mapping

from optiplan.problem.goals_and_vias import Goal, JointGoal, PoseGoal


def as_table(name: str, rows: Mapping[str, object]) -> str:
    """Return what is said of a problem as HTML, without what there is none of."""
    cells = "".join(f"<tr><th>{key}</th><td>{html.escape(str(v))}</td></tr>" for key, v in rows.items() if v)
    return f"<table><caption>Problem: {html.escape(name)}</caption>{cells}</table>"


def goals_in_words(goals: Goal) -> str:
    """Return where motions to any of these goals end."""
    if len(goals) != 1:
        return f"any of {len(goals)} ends"
    if isinstance(goals[0], JointGoal):
        return "a configuration"
    return f"a {'pose' if isinstance(goals[0], PoseGoal) else 'region'} of {goals[0].frame}"
