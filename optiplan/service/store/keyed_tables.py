"""Tables of stored problems and benches, whose rows have a key."""

import time
from collections.abc import Callable, Sequence
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.service.store.run_table import Record
from optiplan.service.store.tables import benches, problems

UNDER_WAY, ALL_QUEUED, BROKEN_OFF = "under way", "ended", "broken off"
"""`queueing` of a bench: how far its runs are queued. Older benches have none."""


class KeyedTable:
    """Access to the rows of a table by its key."""

    def __init__(self, engine: Engine, table: sa.Table) -> None:
        self._engine, self._table = engine, table
        (self._key,) = table.primary_key.columns

    def get(self, key: str) -> Record | None:
        """Return the row of a key; None if there is none."""
        found = self._all(sa.select(self._table).where(self._key == key))
        return found[0] if found else None

    def delete(self, key: str) -> bool:
        """Delete a row; return False if there is none."""
        with self._engine.begin() as connection:
            return connection.execute(self._table.delete().where(self._key == key)).rowcount == 1

    def newest(self, count: int) -> list[Record]:
        """Return at most `count` rows, the newest first."""
        return self._all(sa.select(self._table).order_by(self._table.c.created.desc()).limit(count))

    def _put(self, row: Record, kept: Sequence[str] = ()) -> None:
        """Add a row; one of its key is replaced, but for the columns kept."""
        try:
            with self._engine.begin() as connection:
                connection.execute(self._table.insert().values(**row))
        except sa.exc.IntegrityError:  # also where another process was first
            new = {name: value for name, value in row.items() if name not in kept}
            with self._engine.begin() as connection:
                connection.execute(self._table.update().where(self._key == row[self._key.name]).values(**new))

    def _all(self, query: sa.Select[Any]) -> list[Record]:
        with self._engine.connect() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]


class ProblemTable(KeyedTable):
    """Problems that were stored under their hash."""

    def __init__(self, engine: Engine) -> None:
        super().__init__(engine, problems)

    def add(self, hash: str, name: str, robot: str, text: str) -> None:
        """Store a problem under its hash; `text` is the digest of its text."""
        self._put({"hash": hash, "name": name, "robot": robot, "text": text, "created": time.time()})

    def digests_in_use(self) -> set[str]:
        """Return the digests of the texts."""
        with self._engine.connect() as connection:
            return set(connection.scalars(sa.select(problems.c.text)))


class BenchTable(KeyedTable):
    """Benches: which runs belong to which, and what they compare; the runs are in the table of runs."""

    def __init__(self, engine: Engine) -> None:
        super().__init__(engine, benches)

    def add(self, bench: str, name: str, content: Record, holder: str) -> None:
        """Record a bench whose runs `holder` queues from now on; a known id keeps its time."""
        content = content | {"queueing": UNDER_WAY, "holder": holder, "cancelled": False}
        self._put({"id": bench, "name": name, "created": time.time(), "content": content}, ("created",))

    def cancelled(self, bench: str) -> bool | None:
        """Return whether a bench was cancelled since it was last added; None if there is none of this id."""
        query = sa.select(benches.c.content["cancelled"].as_boolean()).where(self._key == bench)
        with self._engine.connect() as connection:
            return connection.scalar(query)

    def end_queueing(self, bench: str) -> None:
        """Record that all runs of a bench were queued."""
        self._change(bench, lambda found: {"queueing": ALL_QUEUED})

    def break_off(self, bench: str, cancelled: bool = False) -> None:
        """Record that no more runs of a bench are queued, where they were being queued, and if it was cancelled."""
        told = {"cancelled": True} if cancelled else {}
        how = {"queueing": BROKEN_OFF}
        self._change(bench, lambda found: told | (how if found.get("queueing") == UNDER_WAY else {}))

    def _change(self, bench: str, change: Callable[[Record], Record]) -> None:
        which = self._key == bench
        with self._engine.begin() as connection:
            found = connection.scalar(sa.select(benches.c.content).where(which).with_for_update())
            if found is not None:
                connection.execute(benches.update().where(which).values(content=found | change(found)))
