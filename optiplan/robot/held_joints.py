"""A model with some of its joints standing still."""

from collections.abc import Mapping

import pinocchio as pin

from optiplan.robot.mimic_joints import Mimic, fold, unfold


def held_model(
    model: pin.Model, geometry: pin.GeometryModel, followers: Mapping[str, Mimic], held: Mapping[str, float]
) -> tuple[pin.Model, pin.GeometryModel]:
    """Return model and bodies in which some joints, and those that follow them, are fixed; pairs of bodies stay.

    Args:
        model: with `followers` as joints without a degree of freedom.
        geometry: its bodies.
        followers: by name.
        held: positions, rad or m, of planned joints.
    """
    plain = unfold(model).model
    bodies = geometry.copy()
    for body in bodies.geometryObjects:  # joints may stand in another order in the plain model
        body.parentJoint = plain.getJointId(model.names[body.parentJoint])
        frame = model.frames[body.parentFrame]
        body.parentFrame = plain.getFrameId(frame.name, frame.type)
    fixed = dict(held)
    for name, mimic in followers.items():
        if mimic.source in held:
            fixed[name] = mimic.multiplier * held[mimic.source] + mimic.offset
    q = pin.neutral(plain)
    for name, value in fixed.items():
        q[plain.joints[plain.getJointId(name)].idx_q] = value
    ids = [plain.getJointId(name) for name in fixed]
    reduced, around = pin.buildReducedModel(plain, bodies, ids, q)
    left = {name: mimic for name, mimic in followers.items() if name not in fixed}
    return fold(reduced, left), around
