import subprocess
import sys

import pytest


@pytest.mark.parametrize(("planner", "module"), [("trajopt", "trajopt.planner"), ("quintic", "point_to_point.quintic")])
def test_the_planner_of_a_problem_is_loaded_with_it(planner, module):
    text = (
        f"import optiplan as op, sys; op.load_problem('01_reach', planner={planner!r});"
        f"print('optiplan.planners.{module}' in sys.modules, 'optiplan.api.planning' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True"]
