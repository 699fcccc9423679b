"""For the pages of classes: `optiplan.records.dataclass` gives the constructors that `dataclasses.dataclass` gives."""

from typing import Any

from griffe import Alias, Extension


class Dataclasses(Extension):
    """Reads an import of the one as one of the other, whose classes are known."""

    def on_alias_instance(self, *, alias: Alias, **_said: Any) -> None:
        """Called for each imported name."""
        if alias.target_path == "optiplan.records.dataclass":
            alias.target_path = "dataclasses.dataclass"
