"""`optiplan kinematics`: where a robot's tool is at a configuration, and how it moves from there."""

from typing import Annotated

import typer

from optiplan.cli.options import AsJson, Frame, Group, RobotName, numbers
from optiplan.cli.output import print_json, results, stdout_is_ours
from optiplan.config.messages import choices
from optiplan.errors import OptiPlanError

LARGEST = 1e6
"""Of a joint's value or velocity, rad, m, and a second: more is a slip, and sines of it have few digits left."""

At = Annotated[
    str | None,
    typer.Option(
        metavar="Q1,Q2,…|NAME",
        help="joint values, rad (m for sliding joints), or the name of a configuration; without it: ready",
    ),
]
Velocity = Annotated[
    str | None, typer.Option(metavar="V1,V2,…", help="of the joints: what the tool and mecanum wheels do then")
]
Symbolic = Annotated[bool, typer.Option("--symbolic", help="pose and Jacobian as formulas, for up to six joints")]


def kinematics(
    robot: RobotName,
    at: At = None,
    frame: Frame = None,
    group: Group = None,
    velocity: Velocity = None,
    symbolic: Symbolic = False,
    as_json: AsJson = False,
) -> int:
    """Show pose, Jacobians, manipulability and singularities of a robot's tool at a configuration.

    The pose is that of the frame in the robot's base frame: as a 4×4 matrix, as roll, pitch and yaw about the
    [bold]fixed[/] axes x, then y, then z, and as a quaternion x, y, z, w. The geometric Jacobian gives the velocity of
    the frame's origin, m/s, and the angular velocity, rad/s, along the base's axes; the analytic one the rates of
    roll, pitch and yaw. Ellipsoids are for joint speeds (velocity) and joint torques (force) of norm 1.
    Singularities have names for arms with a spherical wrist or three parallel axes; 0 is singular.
    Metres and radians cannot be compared: the measures of the full Jacobian are for a length of 1 m.

    [bold]Examples[/]

      optiplan kinematics ur5 --at 0,-1.2,1.5,-0.3,1.57,0

      optiplan kinematics puma560 --at ready --symbolic

      optiplan kinematics delbot --velocity 0.1,0,0.2,0,0,0,0,0,0 --json

    Exit code: 0 done · 2 bad input.
    """
    import numpy as np

    from optiplan.cli.printing.kinematics_table import describe, describe_formulas, show, show_formulas
    from optiplan.kinematics.ik.solve import wanted_configuration
    from optiplan.robot.robot import load_robot

    with stdout_is_ours():
        loaded = load_robot(robot, group=group)
        loaded = loaded if frame is None else loaded.with_tool(frame)
        if at is None:
            q = wanted_configuration(loaded)
        elif at.strip() in loaded.configurations:
            q = loaded.configurations[at.strip()]
        else:
            q = np.array(_per_joint("at", at, loaded.joint_names, tuple(loaded.configurations)))
        rates = None if velocity is None else np.array(_per_joint("velocity", velocity, loaded.joint_names))
        data = describe(loaded, q, rates)
        formulas = describe_formulas(loaded) if symbolic else {}
    if as_json:
        print_json(data | formulas | {"exit_code": 0})
        return 0
    if at is not None or velocity is not None or not symbolic:
        show(results(), data)
    if symbolic:
        show_formulas(results(), formulas["symbolic"])
    return 0


def _per_joint(option: str, text: str, joints: tuple[str, ...], names: tuple[str, ...] = ()) -> list[float]:
    """Parse one number per joint; `names` are the alternatives, for the error.

    Raises:
        OptiPlanError: anything else.
    """
    values = numbers(text)
    sound = bool(values) and all(abs(value) <= LARGEST for value in values)
    if sound and len(values) == len(joints):
        return values
    found = f"{len(values)} numbers" if sound else f"'{text}'"
    expected = f"{len(joints)} numbers up to {LARGEST:g} with commas between them, for {', '.join(joints)}"
    named = f"; or {choices(text.strip(), names)}" if names else ""
    raise OptiPlanError(f"--{option}: found {found}; expected {expected}{named}")
