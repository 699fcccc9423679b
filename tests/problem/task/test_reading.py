"""What the reader of a task refuses of single steps."""

import numpy as np
import pytest

import optiplan as op

DOWN = {"rpy": (np.pi, 0.0, 0.0)}
SEVERAL = {
    "a tour": lambda keep: op.Task().tour([{"position": (0.5, 0.2, 0.3), **DOWN}], path_constraints=keep),
    "an approach": lambda keep: op.Task().approach(op.Pose((0.5, 0.2, 0.3), **DOWN), 0.1, path_constraints=keep),
}


@pytest.mark.parametrize("words", SEVERAL)
def test_a_constraint_on_a_part_of_several_motions_is_refused(words):
    level = {"normal": [0, 0, 1], "offset": 0.4, "within": 0.5}
    assert op.Problem("panda", "ready", task=SEVERAL[words]([{"plane": level}])).task
    with pytest.raises(op.InputError) as caught:
        op.Problem("panda", "ready", task=SEVERAL[words]([{"plane": {**level, "during": [0.4, 0.6]}}]))
    (issue,) = caught.value.issues
    assert issue.field.endswith("task[0].path_constraints[0].plane.during")
    assert issue.found == f"[0.4, 0.6] of {words}, which is several motions"
