"""Make the pictures of the README and the documentation, from real runs: `python docs/pictures/make.py [NAME…]`.

Every picture begins with a plan that the verifier judges. The viewer's page of it is drawn by a headless Chromium.
Nothing in them is drawn by hand.

* `shelf.webp`: the motion of `problems/02_shelf.yaml`, at a quarter of its speed.
* `curves.png`: the same run with its curves, clearance and verdict; `dark.png` in the dark, `phone.png` on a phone.
* `failure.png`: the straight motion to the same goal, refused, where it touches.
* `comparison.png`: six planners on the same problem.
* `two-arms.png`: both arms of `problems/18_baxter_dual.yaml`.
* `task-*.png` and `cell-*.png`: tasks of `problems/`.

Needs chromium and the extra `pictures` (playwright, pillow).
"""

import sys
from functools import cache, partial
from pathlib import Path

import optiplan as op
from optiplan.viewer.page import render_page
from optiplan.viewer.pictures import save_film, save_picture
from optiplan.viewer.runs import ViewedRun
from optiplan.viewer.scene import build_scene

HERE = Path(__file__).parent
PROBLEM = "02_shelf"
PLANNERS = ("trajopt", "bitstar", "prm", "rrtstar", "rrtconnect", "quintic")
BUDGET, TASK_BUDGET = 6.0, 60.0  # s for each planner
WIDE, PHONE = (1280, 800), (390, 844)  # px
CAMERA = "cam=-0.92,-2.18,1.55,0.31,0.04,0.45"
"""Where the camera is and what it looks at, m, in the world of the problem."""


@cache
def plan(planner: str, problem: str = PROBLEM) -> op.Run:
    """The problem planned by this planner, and what came judged by the verifier."""
    task = op.load_problem(problem)
    run = op.plan(task, planner, budget=TASK_BUDGET if task.task else BUDGET)
    print(planner, run.failure.detail if run.failure else f"{run.duration:.3f} s, verified: {run.verified}")
    return run


def page(*runs: op.Run) -> str:
    """The viewer's page of these runs of one problem."""
    return render_page(build_scene(runs[0].problem, [ViewedRun.of(run) for run in runs]))


def least(run: op.Run) -> float:
    """The instant, s, at which a verified run is nearest to a contact."""
    checks = [] if run.report is None else run.report.checks
    return next(check.time or 0.0 for check in checks if check.name == "collision")


def shelf() -> None:
    """Write the moving picture."""
    wish = f"speed=0.25&layers=obstacles,path,floor,rod&{CAMERA}"
    save_film(page(plan("trajopt")), HERE / "shelf.webp", wish, (800, 500))


def curves() -> None:
    """Write the picture of a proof: the curves against their limits, and where it is closest."""
    run = plan("trajopt")
    save_picture(page(run), HERE / "curves.png", f"t={least(run)}&paused", WIDE)


def dark() -> None:
    """Write the same in the dark, with the jerk."""
    run = plan("trajopt")
    save_picture(page(run), HERE / "dark.png", f"t={least(run)}&paused&theme=dark&tab=jerk", WIDE)


def phone() -> None:
    """Write the same on a phone."""
    run = plan("trajopt")
    save_picture(page(run), HERE / "phone.png", f"t={least(run)}&paused", PHONE)


def failure() -> None:
    """Write the picture of a motion that is refused: where, and which two bodies meet."""
    run = plan("quintic")
    time = run.failure.witness["t"] if run.failure else 0.0
    save_picture(page(run), HERE / "failure.png", f"t={time}&paused", WIDE)


def comparison() -> None:
    """Write the picture of six planners' motions."""
    save_picture(page(*map(plan, PLANNERS)), HERE / "comparison.png", "t=0.45&paused&tab=velocity", WIDE)


def two_arms() -> None:
    """Write the picture of two arms that are planned together."""
    run = plan("trajopt", "18_baxter_dual")
    save_picture(page(run), HERE / "two-arms.png", "t=0.55&paused&tab=torque", WIDE)


TASKS = {
    "task-cubes": ("40_panda_sorts_cubes", 4.5),
    "task-delbot": ("41_delbot_fetches", 1.9),
    "task-srra": ("42_srra_tends_and_drills", 2.9),
    "task-tray": ("43_baxter_carries_a_tray", 4.7),
    "task-conveyor": ("56_conveyor_pick", 2.2),
    "cell-bin-picking": ("57_bin_picking", 1.5),
    "cell-tour": ("45_spot_tour", 2.0),
    "cell-glue": ("53_glue_line", 4.0),
    "cell-tending": ("58_machine_tending", 3.0),
    "cell-two-arms": ("50_arms_sort", 5.0),
    "cell-polishing": ("54_polishing", 4.0),
}
"""Pictures of tasks: the problem, and the instant, s."""


def goal_region() -> None:
    """Write the picture of a goal region: any side of a can."""
    save_picture(page(plan("trajopt", "44_can_from_any_side")), HERE / "goal-region.png", "t=0.7&paused", WIDE)


def task(name: str) -> None:
    """Write the picture of a task."""
    problem, time = TASKS[name]
    save_picture(page(plan("trajopt", problem)), HERE / f"{name}.png", f"t={time}&paused", WIDE)


PICTURES = {
    "shelf": shelf,
    "curves": curves,
    "dark": dark,
    "phone": phone,
    "failure": failure,
    "comparison": comparison,
    "two-arms": two_arms,
    "goal-region": goal_region,
    **{name: partial(task, name) for name in TASKS},
}

if __name__ == "__main__":
    for name in sys.argv[1:] or PICTURES:
        PICTURES[name]()
