"""The descent of a curve in the native core: contacts, torques and programs."""

import numpy as np

from optiplan._core import core
from optiplan.arrays import Array
from optiplan.collision.native_model import NativeCollisionModel
from optiplan.planners.trajopt.program.native_step import GAP, native_spline
from optiplan.planners.trajopt.program.sqp import Descended, DescentOptions, descend
from optiplan.planners.trajopt.program.transcription import Transcription
from optiplan.planners.trajopt.terms.contacts import CENTIMETRE, CONTACT_PENALTY, CUTOFF
from optiplan.planners.trajopt.terms.torques import TORQUE_PENALTY
from optiplan.robot.native_tree import native_tree


class NativeSqp:
    """Descends as `sqp.Sqp` does, with rows and steps of the native core.

    Contacts come from the core's world where the collision model has one, else from the model itself.
    """

    def __init__(self, transcription: Transcription) -> None:
        self.transcription = transcription
        spline, model, torques = native_spline(transcription), transcription.model, transcription.torques
        world = model.world if isinstance(model, NativeCollisionModel) else None
        if world is not None:
            margins = transcription.margins
            wishes = (margins.middle, margins.start, margins.end)
            self._sqp = core.Sqp.among_bodies(spline, world, torques.limit, torques.still, CUTOFF, wishes, _settings())
        else:
            tree = native_tree(model.robot.model)
            self._sqp = core.Sqp.among_others(
                spline, tree, torques.limit, torques.still, transcription.contacts.near, _settings()
            )

    def set_samples(self, u: Array) -> None:
        """Set the instants, as shares of the duration, at which contacts and torques are evaluated."""
        self.transcription.set_samples(u)
        samples = self.transcription.samples
        self._sqp.set_samples(samples.u, *samples.at)

    def optimise(self, control: Array, options: DescentOptions) -> Descended:
        """Descend from control points (K, n); see `sqp.descend`."""
        return descend(self._sqp, np.ascontiguousarray(control), options)


def _settings() -> dict[str, float]:
    return {
        "contact_penalty": CONTACT_PENALTY,
        "torque_penalty": TORQUE_PENALTY,
        "centimetre": CENTIMETRE,
        "gap": GAP,
    }
