import optiplan as op
from optiplan.collision import native_model
from optiplan.robot import robot
from optiplan.robot.loaded_robots import LoadedRobots
from optiplan.verify.continuous import bodies


def test_what_is_made_of_a_robot_is_made_when_its_problem_is_loaded(monkeypatch):
    made = []

    def noted(module, name):
        make = getattr(module, name)
        monkeypatch.setattr(module, name, lambda *args: made.append(name) or make(*args))

    monkeypatch.setattr(robot, "_loaded", LoadedRobots())  # nobody has loaded it
    if native_model.core is not None:
        noted(native_model, "_shapes_of")
    noted(bodies, "support_vertices")
    problem = op.load_problem("01_reach")
    loaded = len(made)
    assert loaded >= 2 * len(problem.robot.link_boxes) if native_model.core else True
    assert op.plan(problem, budget=2.0).verified
    assert len(made) == loaded
