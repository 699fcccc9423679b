"""A robot of a URDF as a USD stage, in other units, with another up axis and other frames of its joints."""

import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics

Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], float)
"""From a frame with z up to one with y up."""


def write_stage(urdf, path, metres=0.01, y_up=True, seed=0, nested=False):
    """Write the links, joints and collisions of a URDF without meshes; bodies stand as joints at zero put them.

    Joints have frames of their own in both bodies, drawn at random; every other joint runs from child to parent.
    """
    root = ET.parse(urdf).getroot()
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageMetersPerUnit(stage, metres)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y if y_up else UsdGeom.Tokens.z)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 0.5)
    top = UsdGeom.Xform.Define(stage, "/arm")
    stage.SetDefaultPrim(top.GetPrim())
    UsdPhysics.ArticulationRootAPI.Apply(top.GetPrim())
    rng = np.random.default_rng(seed)
    up = pin.SE3(Y_UP if y_up else np.eye(3), np.zeros(3))
    joints = root.findall("joint")
    places = {_base(joints): pin.SE3.Identity()}
    paths = {}
    waiting = list(joints)
    while waiting:
        joint = next(one for one in waiting if one.find("parent").get("link") in places)
        waiting.remove(joint)
        parent, child = (joint.find(tag).get("link") for tag in ("parent", "child"))
        places[child] = places[parent] * _origin(joint)
    for link in root.findall("link"):
        name = link.get("name")
        carrier = next((j.find("parent").get("link") for j in joints if j.find("child").get("link") == name), None)
        above = paths[carrier] if nested and carrier else "/arm"
        paths[name] = f"{above}/{name}"
        body = UsdGeom.Xform.Define(stage, paths[name])
        X = places[carrier].actInv(places[name]) if nested and carrier else up * places[name]
        _place(body, X, metres)
        UsdPhysics.RigidBodyAPI.Apply(body.GetPrim())
        _mass(body.GetPrim(), link, metres)
        for k, collision in enumerate(link.findall("collision")):
            _shape(stage, f"{paths[name]}/shape_{k}", collision, metres)
    ground = UsdPhysics.FixedJoint.Define(stage, "/arm/ground")
    ground.CreateBody1Rel().SetTargets([paths[_base(joints)]])
    _frame(ground, 0, up, metres)
    for k, joint in enumerate(joints):
        _joint(stage, joint, paths, rng, metres, k % 2 == 1)
    stage.GetRootLayer().Save()
    return path


def _base(joints):
    children = {joint.find("child").get("link") for joint in joints}
    return next(p for joint in joints if (p := joint.find("parent").get("link")) not in children)


def _origin(element):
    origin = element.find("origin")
    attributes = {} if origin is None else origin.attrib
    xyz, rpy = ([float(x) for x in attributes.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))


def _quaternion(R):
    q = pin.Quaternion(R)
    return Gf.Quatd(q.w, q.x, q.y, q.z)


def _place(xform, X, metres):
    xform.AddTranslateOp().Set(Gf.Vec3d(*(X.translation / metres)))
    xform.AddOrientOp(UsdGeom.XformOp.PrecisionDouble).Set(_quaternion(X.rotation))


def _mass(prim, link, metres):
    inertial = link.find("inertial")
    if inertial is None:
        return
    api = UsdPhysics.MassAPI.Apply(prim)
    api.CreateMassAttr(float(inertial.find("mass").get("value")) / 0.5)
    X = _origin(inertial)
    entries = {key: float(inertial.find("inertia").get(key)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    tensor = np.array(
        [
            [entries["ixx"], entries["ixy"], entries["ixz"]],
            [entries["ixy"], entries["iyy"], entries["iyz"]],
            [entries["ixz"], entries["iyz"], entries["izz"]],
        ]
    )
    values, R = np.linalg.eigh(X.rotation @ tensor @ X.rotation.T)
    R = R * np.sign(np.linalg.det(R))
    api.CreateCenterOfMassAttr(Gf.Vec3f(*(X.translation / metres)))
    api.CreateDiagonalInertiaAttr(Gf.Vec3f(*(values / 0.5 / metres**2)))
    api.CreatePrincipalAxesAttr(Gf.Quatf(_quaternion(R)))


def _shape(stage, path, collision, metres):
    shape = collision.find("geometry")[0]
    if shape.tag == "box":
        size = [float(x) for x in shape.get("size").split()]
        prim = UsdGeom.Cube.Define(stage, path)
        prim.CreateSizeAttr(1.0)
    elif shape.tag == "sphere":
        prim = UsdGeom.Sphere.Define(stage, path)
        prim.CreateRadiusAttr(float(shape.get("radius")) / metres)
    else:
        prim = UsdGeom.Cylinder.Define(stage, path)
        prim.CreateRadiusAttr(float(shape.get("radius")) / metres)
        prim.CreateHeightAttr(float(shape.get("length")) / metres)
        prim.CreateAxisAttr("Z")
    _place(prim, _origin(collision), metres)
    if shape.tag == "box":
        prim.AddScaleOp().Set(Gf.Vec3f(*(x / metres for x in size)))
    UsdPhysics.CollisionAPI.Apply(prim.GetPrim())


KINDS = {"revolute": UsdPhysics.RevoluteJoint, "prismatic": UsdPhysics.PrismaticJoint, "fixed": UsdPhysics.FixedJoint}


def _joint(stage, joint, paths, rng, metres, backwards):
    kind = joint.get("type")
    prim = KINDS["revolute" if kind == "continuous" else kind].Define(stage, f"/arm/{joint.get('name')}")
    X_PJ = _origin(joint)
    turn = pin.SE3.Identity()
    if kind != "fixed":
        axis = np.array([float(x) for x in joint.find("axis").get("xyz").split()])
        turn = pin.SE3(pin.Quaternion.FromTwoVectors(np.array([1.0, 0.0, 0.0]), axis).toRotationMatrix(), np.zeros(3))
        prim.CreateAxisAttr("X")
    away = pin.SE3.Identity()
    if kind == "prismatic":  # a frame anywhere with the same axis
        away = pin.SE3(np.eye(3), rng.uniform(-0.1, 0.1, 3))
    elif kind != "fixed":  # anywhere along the axis
        away = pin.SE3(pin.exp3(np.array([rng.uniform(-2, 2), 0, 0])), np.array([rng.uniform(-0.1, 0.1), 0, 0]))
    frames = [X_PJ * turn * away, turn * away]
    ends = [paths[joint.find(tag).get("link")] for tag in ("parent", "child")]
    if backwards and kind != "fixed":
        frames, ends = frames[::-1], ends[::-1]
    prim.CreateBody0Rel().SetTargets([Sdf.Path(ends[0])])
    prim.CreateBody1Rel().SetTargets([Sdf.Path(ends[1])])
    for k, X in enumerate(frames):
        if backwards and kind != "fixed":  # the same motion for the same value: the axis turned round
            X = X * pin.SE3(pin.rpy.rpyToMatrix(0.0, 0.0, np.pi), np.zeros(3))
        _frame(prim, k, X, metres)
    if kind in ("revolute", "prismatic"):
        limit, unit = joint.find("limit"), np.degrees(1.0) if kind == "revolute" else 1.0 / metres
        prim.CreateLowerLimitAttr(float(limit.get("lower")) * unit)
        prim.CreateUpperLimitAttr(float(limit.get("upper")) * unit)
    if kind != "fixed":
        name = "linear" if kind == "prismatic" else "angular"
        drive = UsdPhysics.DriveAPI.Apply(prim.GetPrim(), name)
        force = float(joint.find("limit").get("effort")) / 0.5 / metres ** (1 if kind == "prismatic" else 2)
        drive.CreateMaxForceAttr(force)
        rate = float(joint.find("limit").get("velocity")) * (1.0 / metres if kind == "prismatic" else np.degrees(1.0))
        prim.GetPrim().CreateAttribute("physxJoint:maxJointVelocity", Sdf.ValueTypeNames.Float).Set(rate)


def _frame(prim, k, X, metres):
    q = pin.Quaternion(X.rotation)
    (prim.CreateLocalPos0Attr if k == 0 else prim.CreateLocalPos1Attr)(Gf.Vec3f(*(X.translation / metres)))
    (prim.CreateLocalRot0Attr if k == 0 else prim.CreateLocalRot1Attr)(Gf.Quatf(q.w, q.x, q.y, q.z))
