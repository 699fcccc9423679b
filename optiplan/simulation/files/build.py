"""Build the closed loop that a control file states."""

import numpy as np

from optiplan.planners.base import Failure
from optiplan.simulation.closed_loop import Loop, Push
from optiplan.simulation.controllers.base import LoopController
from optiplan.simulation.controllers.joints import ComputedTorque, DriveLoops, PidController, VelocityTracking
from optiplan.simulation.execution import torque_plant
from optiplan.simulation.files.read import ControlFile
from optiplan.simulation.files.references import reference_of
from optiplan.simulation.files.schema import ComputedTorqueSpec, DriveSpec, PidSpec, TaskSpaceSpec, VelocitySpec
from optiplan.simulation.plants.base import Friction, Payload, Plant, PlantOptions, assumed_dynamics
from optiplan.simulation.plants.dynamics import RigidBodyDynamics
from optiplan.simulation.plants.ideal import IdealPlant
from optiplan.simulation.plants.imperfections import Imperfections
from optiplan.simulation.references.base import Reference, ToolReference


def build_loop(control: ControlFile) -> Loop | Failure:
    """The loop, ready to run; a `Failure` where its reference was to be planned and no motion was found.

    Raises:
        InputError: a file that it needs cannot be used.
    """
    reference = reference_of(control)
    if isinstance(reference, Failure):
        return reference
    spec = control.spec
    pushes = [Push(push.at, push.lasting, np.array(push.force), np.array(push.torque)) for push in spec.disturbances]
    return Loop(
        robot=control.robot,
        limits=control.problem.limits,
        reference=reference,
        controller=_controller(control, reference),
        plant=_plant(control),
        dt=1.0 / spec.rate,
        settle=spec.settle,
        imperfections=_imperfections(control),
        pushes=pushes,
        scene=control.problem.scene,
    )


def _assumed(control: ControlFile) -> RigidBodyDynamics:
    return assumed_dynamics(control.robot, _payload(control))


def _controller(control: ControlFile, reference: Reference) -> LoopController:
    match control.spec.controller.value:
        case PidSpec() | DriveSpec() as spec:
            of, period = control.per_joint, 1.0 / control.spec.rate
            most = None if spec.integral_limit is None else of(spec.integral_limit)
            gravity = _assumed(control) if spec.gravity_compensation else None
            if isinstance(spec, PidSpec):
                return PidController((of(spec.p), of(spec.i), of(spec.d)), period, most, gravity)
            gains = (of(spec.position), of(spec.velocity), of(spec.integral))
            return DriveLoops(gains, period, spec.takes, most, gravity)
        case ComputedTorqueSpec() as spec:
            return ComputedTorque(_assumed(control), spec.frequency, spec.damping)
        case VelocitySpec() as spec:
            return VelocityTracking(spec.gain)
        case TaskSpaceSpec() as spec:
            from optiplan.simulation.controllers.task_space import TaskSpaceLoop

            frame = reference.frame if isinstance(reference, ToolReference) else None
            torque = control.spec.plant.engine != "ideal"
            inner = ComputedTorque(_assumed(control), spec.frequency, spec.damping) if torque else None
            return TaskSpaceLoop(control.problem, spec, 1.0 / control.spec.rate, frame, inner)
        case other:
            raise TypeError(f"no controller for {other!r}")


def _plant(control: ControlFile) -> Plant:
    spec, start = control.spec.plant, control.problem.start
    if spec.engine == "ideal":
        return IdealPlant(start, spec.step)
    friction = Friction(control.per_joint(spec.friction.viscous), control.per_joint(spec.friction.coulomb))
    rotor, limit = control.per_joint(spec.rotor_inertia), control.problem.limits.torque
    options = PlantOptions(limit, friction, _payload(control), rotor)
    return torque_plant(control.problem, spec.engine, start, spec.step, options)


def _payload(control: ControlFile) -> Payload | None:
    spec = control.spec.plant.payload
    if spec is None:
        return None
    return Payload(spec.mass, spec.mass if spec.assumed is None else spec.assumed, np.array(spec.centre))


def _imperfections(control: ControlFile) -> Imperfections:
    spec = control.spec.plant
    return Imperfections(
        delay=spec.delay,
        encoder=spec.encoder,
        position_noise=spec.noise.position,
        velocity_noise=spec.noise.velocity,
        velocity_filter=spec.velocity_filter,
        seed=control.spec.seed,
    )
