"""Problems that were stored under their hash."""

import time
from typing import Any

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.service.store.tables import problems


class ProblemTable:
    """Stored problems."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def add(self, hash: str, name: str, robot: str, text: str) -> None:
        """Store a problem whose text has this digest; one of the same hash is there already or is now."""
        row = {"hash": hash, "name": name, "robot": robot, "text": text, "created": time.time()}
        with self._engine.begin() as connection:
            connection.execute(problems.delete().where(problems.c.hash == hash))
            connection.execute(problems.insert().values(**row))

    def get(self, hash: str) -> dict[str, Any] | None:
        """The problem of a hash; None if it is not stored."""
        with self._engine.connect() as connection:
            row = connection.execute(sa.select(problems).where(problems.c.hash == hash)).mappings().first()
        return None if row is None else dict(row)

    def newest(self, count: int) -> list[dict[str, Any]]:
        """At most `count` problems, the last stored first."""
        query = sa.select(problems).order_by(problems.c.created.desc()).limit(count)
        with self._engine.connect() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

    def delete(self, hash: str) -> bool:
        """Forget a problem; False if it is not stored."""
        with self._engine.begin() as connection:
            return connection.execute(problems.delete().where(problems.c.hash == hash)).rowcount == 1

    def digests_in_use(self) -> set[str]:
        """Digests of the texts."""
        with self._engine.connect() as connection:
            return set(connection.scalars(sa.select(problems.c.text)))
