"""Recordings as files: MCAP with Foxglove's schemas, RRD of Rerun."""

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from optiplan.arrays import Array
from optiplan.errors import OptiPlanError
from optiplan.files import write_bytes
from optiplan.problem.problem import Problem
from optiplan.viewer.recordings.recording import RecordedBody, Recording, recording_of
from optiplan.viewer.runs import ViewedRun

WORLD = "world"
_SECOND = 1_000_000_000  # ns
_NOTHING = 1e-9  # scale of what is nowhere; Rerun has no other word for it over time
_NAMES = str.maketrans({" ": "_", "–": "-"})


def save_recording(problem: Problem, run: ViewedRun, path: Path) -> None:
    """Write a run for Foxglove (`.mcap`) or Rerun (`.rrd`); the file appears whole or not at all.

    Raises:
        OptiPlanError: the run has no motion, or the library of the format is not installed.
    """
    write_bytes(path, FORMATS[path.suffix.lower()](recording_of(problem, run)))


def mcap(recording: Recording) -> bytes:
    """Return an MCAP file.

    Topics: `/tf` (FrameTransforms, a frame a body), `/scene` (SceneUpdate), `/tool_path` (SceneUpdate), `/joints`
    (JointStates), `/curves/…` (JSON: one value a series), `/verdict` (Log).
    """
    try:
        import foxglove
        from foxglove import messages as fm
        from foxglove.channels import FrameTransformsChannel, JointStatesChannel, LogChannel, SceneUpdateChannel
    except ImportError as error:
        raise _missing("foxglove-sdk") from error

    context, file = foxglove.Context(), io.BytesIO()
    writer = foxglove.open_mcap(file, context=context)
    transforms = FrameTransformsChannel("/tf", context=context)
    scene = SceneUpdateChannel("/scene", context=context)
    path = SceneUpdateChannel("/tool_path", context=context)
    log = LogChannel("/verdict", context=context)
    level = fm.LogLevel.Info if recording.verified else fm.LogLevel.Error
    log.log(fm.Log(level=level, message=recording.verdict, name="optiplan"), log_time=0)

    entities = [_entity(fm, body) for body in recording.bodies]
    scene.log(fm.SceneUpdate(entities=entities), log_time=0)
    colour = fm.Color(r=0.14, g=0.45, b=0.78, a=1.0)
    line = fm.LinePrimitive(points=_points(fm, recording.tool), thickness=0.004, color=colour)
    path.log(fm.SceneUpdate(entities=[fm.SceneEntity(id="tool", frame_id=WORLD, lines=[line])]), log_time=0)
    for k, time in enumerate(recording.t):
        moved = [one for one in recording.bodies if one.name != WORLD and (k == 0 or len(one.poses) > 1)]
        poses = [(body.name, body.poses[min(k, len(body.poses) - 1)]) for body in moved]
        frames = [_frame(fm, name, pose) for name, pose in poses if np.isfinite(pose).all()]  # else it is nowhere
        turned = [body for body in moved if k > 0 and _there(body, k) != _there(body, k - 1)]
        if turned:
            now = fm.Timestamp.from_epoch_secs(float(time))  # a deletion is of what was drawn before
            gone = [
                fm.SceneEntityDeletion(timestamp=now, type=fm.SceneEntityDeletionType.MatchingId, id=body.name)
                for body in turned
                if not _there(body, k)
            ]
            back = [_entity(fm, body) for body in turned if _there(body, k)]
            scene.log(fm.SceneUpdate(deletions=gone, entities=back), log_time=int(time * _SECOND))
        transforms.log(fm.FrameTransforms(transforms=frames), log_time=int(time * _SECOND))
    values = {curve.name: curve for curve in recording.curves}
    joints, position, velocity = JointStatesChannel("/joints", context=context), values["position"], values["velocity"]
    for k, time in enumerate(position.t):
        states = [
            fm.JointState(name=name, position=float(position.y[k, j]), velocity=float(velocity.y[k, j]))
            for j, name in enumerate(position.names)
        ]
        joints.log(fm.JointStates(joints=states), log_time=int(time * _SECOND))
    for curve in recording.curves:
        channel = foxglove.Channel(f"/curves/{curve.name.translate(_NAMES)}", message_encoding="json", context=context)
        for time, row in zip(curve.t, curve.y, strict=True):
            channel.log(dict(zip(curve.names, row.tolist(), strict=True)), log_time=int(time * _SECOND))
    writer.close()
    return file.getvalue()


def _there(body: RecordedBody, k: int) -> bool:
    return bool(np.isfinite(body.poses[k]).all())


def _points(fm: Any, rows: Array) -> list[Any]:
    return [fm.Point3(x=float(x), y=float(y), z=float(z)) for x, y, z in rows]


def _entity(fm: Any, body: RecordedBody) -> Any:
    """Return a body as Foxglove draws it, in its own frame."""
    triangles = fm.TriangleListPrimitive(
        points=_points(fm, body.vertices),
        indices=[int(k) for k in body.faces.ravel()],
        colors=[fm.Color(r=r, g=g, b=b, a=a) for r, g, b, a in body.colours.tolist()],
    )
    return fm.SceneEntity(id=body.name, frame_id=body.name, triangles=[triangles])


def _frame(fm: Any, name: str, pose: Array) -> Any:
    x, y, z, qx, qy, qz, qw = map(float, pose)
    return fm.FrameTransform(
        parent_frame_id=WORLD,
        child_frame_id=name,
        translation=fm.Vector3(x=x, y=y, z=z),
        rotation=fm.Quaternion(x=qx, y=qy, z=qz, w=qw),
    )


def rrd(recording: Recording) -> bytes:
    """Return an RRD file.

    Entities: `world/…` (Mesh3D and Transform3D of each body), `world/tool_path` (LineStrips3D), `curves/…` (Scalars),
    `verdict` (TextDocument); the timeline `time` has the time of the motion.
    """
    try:
        import rerun as rr
    except ImportError as error:
        raise _missing("rerun-sdk") from error

    stream = rr.RecordingStream("optiplan", recording_id=recording.name)
    memory = stream.memory_recording()
    stream.log("verdict", rr.TextDocument(recording.verdict), static=True)
    stream.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
    stream.log("world/tool_path", rr.LineStrips3D([recording.tool], colors=[[35, 116, 198]]), static=True)
    for body in recording.bodies:
        place, colours = f"world/{body.name}", np.round(255 * body.colours).astype(np.uint8)
        mesh = rr.Mesh3D(vertex_positions=body.vertices, triangle_indices=body.faces, vertex_colors=colours)
        stream.log(place, mesh, static=True)
        if len(body.poses) == 1:
            stream.log(place, _transform(rr, body.poses[0]), static=True)
    for k, time in enumerate(recording.t):
        stream.set_time("time", duration=float(time))
        for body in recording.bodies:
            if len(body.poses) > 1:
                stream.log(f"world/{body.name}", _transform(rr, body.poses[k]))
    for curve in recording.curves:
        place = f"curves/{curve.name.translate(_NAMES)}"
        stream.log(place, rr.SeriesLines(names=curve.names), static=True)
        for time, row in zip(curve.t, curve.y, strict=True):
            stream.set_time("time", duration=float(time))
            stream.log(place, rr.Scalars(row))
    return bytes(memory.drain_as_bytes())


def _transform(rr: Any, pose: Array) -> Any:
    if not np.isfinite(pose).all():
        return rr.Transform3D(scale=_NOTHING)
    return rr.Transform3D(translation=pose[:3], quaternion=rr.Quaternion(xyzw=pose[3:]))


def _missing(package: str) -> OptiPlanError:
    return OptiPlanError(f"this recording needs the package {package}: pip install 'optiplan[recordings]'")


FORMATS: dict[str, Callable[[Recording], bytes]] = {".mcap": mcap, ".rrd": rrd}
"""Kinds of recordings by the ending of their files."""
