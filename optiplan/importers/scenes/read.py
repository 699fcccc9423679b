"""The scene of a file, whatever program it is of."""

from pathlib import Path

from optiplan.errors import InputError, Issue
from optiplan.files import is_file
from optiplan.importers.robots.describe import USD_ENDINGS, root_tag
from optiplan.importers.scenes.imported import ImportedScene

KNOWN = "a .scene of MoveIt, an SDF world or model, MJCF of MuJoCo, or a USD stage"


def read_scene(path: Path) -> ImportedScene:
    """Read a `.scene` of MoveIt, an SDF file, an MJCF file or a USD stage.

    Raises:
        InputError: none of these, or one that cannot be used.
        OptiPlanError: MJCF without the package `mujoco`, USD without `usd-core`.
    """
    if path.suffix == ".scene":
        from optiplan.importers.scenes.moveit_text import read_moveit_scene

        return read_moveit_scene(path)
    if path.suffix in USD_ENDINGS:
        from optiplan.importers.scenes.usd import read_usd_scene

        return read_usd_scene(path)
    tag = root_tag(path)
    if tag == "mujoco":
        from optiplan.importers.scenes.mjcf import read_mjcf_scene

        return read_mjcf_scene(path)
    if tag == "sdf":
        from optiplan.importers.scenes.sdf import read_sdf_scene

        return read_sdf_scene(path)
    found = "no such file" if not is_file(path) else f"XML of <{tag}>" if tag else "a file of another kind"
    raise InputError([Issue(str(path), None, "import scene", found, KNOWN)])
