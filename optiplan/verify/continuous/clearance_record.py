"""Record of a certificate: which clearance was proved of which pair of bodies, and when."""

from typing import NamedTuple

import numpy as np

from optiplan.arrays import Array, Index, distinct


class ClearanceBound(NamedTuple):
    """The clearance proved of all pairs together, constant on K intervals of time that follow each other.

    Attributes:
        edges: (K + 1,) s, from 0 to the duration.
        clearance: (K,) m: within interval k no pair comes nearer than that. -inf where nothing is proved.
        pair: (K,) index of the pair of which the least was proved.
    """

    edges: Array
    clearance: Array
    pair: Index


class ClearanceRecord:
    """Collects proved clearances of single pairs on intervals, in the order in which they are found."""

    def __init__(self) -> None:
        self._found: list[tuple[Array, Array, Index, Array]] = []

    def __len__(self) -> int:
        """How many times something was added."""
        return len(self._found)

    def add(self, begin: Array, end: Array, pair: Index, clearance: Array) -> None:
        """From `begin` to `end`, s, a pair stays farther apart than `clearance`, m; all arrays (K,)."""
        self._found.append((begin, end, pair, clearance))

    def cut(self, count: int | None) -> None:
        """Forget what was added after the first `count` times."""
        del self._found[count:]

    def agree(self, least: Array, kinds: Index) -> None:
        """Bring in line with what another proof found: (2,) m, the least of each kind of pairs; `kinds` (P,) of pairs.

        Nothing of a kind is less than its least, and where it is smallest it is that: a smaller claim holds as well.
        """
        begin, end, pair, clearance = self.proved()
        clearance = np.maximum(clearance, least[kinds[pair]])
        for kind, known in enumerate(least.tolist()):
            own = np.flatnonzero(kinds[pair] == kind)
            if len(own):
                clearance[own[clearance[own].argmin()]] = known
        self._found = [(begin, end, pair, clearance)]

    def proved(self) -> tuple[Array, Array, Index, Array]:
        """All that was added: begin, end, pair, clearance."""
        if not self._found:
            return np.empty(0), np.empty(0), np.empty(0, dtype=np.intp), np.empty(0)
        begin, end, pair, clearance = (np.concatenate(column) for column in zip(*self._found, strict=True))
        return begin, end, pair, clearance

    def bound(self, duration: float, pairs: int) -> ClearanceBound:
        """The least of what was proved at each time; only where something was proved of every pair, (0, …, pairs - 1).

        Edges nearer than 1e-12 s are one. Its least is that of all that was added.
        """
        begin, end, pair, clearance = self.proved()
        edges = distinct(np.concatenate([[0.0, duration], begin, end]))
        edges = edges[np.append(np.diff(edges) > 1e-12, True)]
        edges[0] = 0.0
        first, last = (np.searchsorted(edges, times - 1e-12) for times in (begin, end))
        least, which = np.full(len(edges) - 1, np.inf), np.full(len(edges) - 1, -1, dtype=np.intp)
        known = np.zeros(len(edges), dtype=np.intp)
        order = np.argsort(-clearance, kind="stable")  # the smallest is written last
        for k in order.tolist():
            least[first[k] : last[k]], which[first[k] : last[k]] = clearance[k], pair[k]
        np.add.at(known, first, 1)
        np.add.at(known, last, -1)
        least[np.cumsum(known)[:-1] < pairs] = -np.inf
        return ClearanceBound(edges, least, which)
