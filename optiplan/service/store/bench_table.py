"""Benches in the database: which runs belong to which, and what they compare."""

import time
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.service.store.tables import benches


class BenchTable:
    """Benches; their runs are in the table of runs."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def add(self, bench: str, name: str, content: dict[str, Any]) -> None:
        """Record a bench; one of this id stays as it is."""
        row = {"id": bench, "name": name, "created": time.time(), "content": content}
        try:
            with self._engine.begin() as connection:
                connection.execute(benches.insert().values(**row))
        except sa.exc.IntegrityError:
            return

    def get(self, bench: str) -> dict[str, Any] | None:
        """The bench of an id; None if there is none."""
        with self._engine.connect() as connection:
            row = connection.execute(sa.select(benches).where(benches.c.id == bench)).mappings().first()
        return None if row is None else dict(row)

    def newest(self, count: int) -> list[dict[str, Any]]:
        """At most `count` benches, the last first."""
        query = sa.select(benches).order_by(benches.c.created.desc()).limit(count)
        with self._engine.connect() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

    def delete(self, bench: str) -> bool:
        """Forget a bench, not its runs; False if there is none."""
        with self._engine.begin() as connection:
            return connection.execute(benches.delete().where(benches.c.id == bench)).rowcount == 1
