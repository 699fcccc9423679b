"""Puts `robots/` and `problems/` into the wheel as `optiplan/_data/`; everything else is in pyproject.toml."""

import shutil
from pathlib import Path

from setuptools import setup
from setuptools.command.build_py import build_py


class BuildWithData(build_py):
    """Copies the data folders beside the package, except for an editable install, which reads the checkout."""

    def run(self) -> None:
        """Build the Python files, then lay the data beside them."""
        super().run()
        if self.editable_mode:
            return
        for folder in ("robots", "problems"):
            target = Path(self.build_lib) / "optiplan" / "_data" / folder
            shutil.rmtree(target, ignore_errors=True)  # a stale build folder must not bring back deleted files
            shutil.copytree(folder, target)


setup(cmdclass={"build_py": BuildWithData})
