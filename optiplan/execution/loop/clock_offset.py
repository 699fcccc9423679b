"""How far two clocks are apart, of time stamps that come with delays."""

FORGET = 0.02
"""Share by which a later stamp counts, since clocks drift."""


class ClockOffset:
    """The distance of the receiver's clock from the sender's, with the smallest delay that was seen.

    A stamp t that is received at t' shows t' - t: the distance of the clocks and a delay that varies.
    """

    def __init__(self) -> None:
        self._least: float | None = None

    def take(self, received: float, stamp: float) -> float:
        """Take a stamp, s, and return the distance, s."""
        shown = received - stamp
        if self._least is None:
            self._least = shown
        self._least = min(shown, self._least + FORGET * (shown - self._least))
        return self._least
