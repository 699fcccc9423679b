"""Print a line for every figure of a demonstration: the required value and the measured one."""


class Figures:
    """Prints figures and counts those that are missed."""

    def __init__(self) -> None:
        self.missed = 0

    def tell(self, what: str, asked: object, seen: object, holds: bool | None = None) -> None:
        """Print a figure; whether it `holds` is, where None is given, whether `seen` equals `asked`."""
        held = asked == seen if holds is None else holds
        self.missed += not held
        print(f"{'ok    ' if held else 'MISSED'} {what}: asked {asked}, seen {seen}", flush=True)

    @property
    def exit_code(self) -> int:
        """1 where a figure is missed."""
        return int(self.missed > 0)
