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


@pytest.mark.parametrize("first", [True, False])
def test_what_some_alternative_moves_has_no_grasps_where_it_was(first):
    cube = op.Box("cube", size=(0.04, 0.04, 0.04), position=(0.5, 0.2, 0.2))
    carry = op.Task().attach("cube", "panda_hand").move("ready").detach("cube")
    alternatives = (carry, op.Task().dwell(0.1)) if first else (op.Task().dwell(0.1), carry)
    task = op.Task().either(*alternatives).approach(op.Grasps("cube", opening=0.078), 0.1)
    with pytest.raises(op.InputError, match="'cube', which"):
        op.Problem("panda", "ready", task=task, scene=[cube])
