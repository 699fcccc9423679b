"""Runs in the database: every change of state is one statement that only one of several processes can win."""

import time
from collections.abc import Iterable, Sequence
from dataclasses import field
from typing import Any, Literal

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.records import dataclass
from optiplan.service.store.tables import Clock, events, runs, submissions

RunState = Literal["queued", "running", "done", "failed", "cancelled"]
ENDED: tuple[RunState, ...] = ("done", "failed", "cancelled")
"""States that a run does not leave, but for being submitted again after `failed` or `cancelled`."""

Record = dict[str, Any]
"""A row of the table of runs."""

RETRIED = ("timeout", "out-of-memory", "crashed", "deadline", "storage", "bug")
"""Failures that are not the planner's answer: the same submission tries again, as where a run has no record."""

AT_ONCE = 500
"""Ids in one query."""

_OUTCOME = (*("verified", "duration", "ratio", "failure", "timings", "contents"), *("started", "finished", "holder"))


@dataclass(frozen=True)
class NewRun:
    """What is asked for, in so many `bytes`.

    `id` is the digest of all that decides the answer, or of one attempt that is waited for.
    """

    id: str
    name: str
    problem: str
    robot: str
    request: str
    planner: str
    seed: int
    budget: float
    deadline: float | None
    bytes: int = 0


@dataclass(frozen=True)
class RunEnd:
    """How a run ended."""

    status: RunState
    verified: bool | None = None
    duration: float | None = None
    ratio: float | None = None
    failure: Record | None = None
    timings: Record | None = None
    contents: dict[str, str] = field(default_factory=dict)
    bytes: int = 0


class RunTable:
    """Runs and their events."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    def submit(self, new: NewRun, submission: str) -> tuple[Record, bool]:
        """Return the run of a submission and whether it is to be queued now: it is new, or to be tried again.

        Args:
            new: the run.
            submission: names who wants it, for `cancel`.
        """
        values = {**vars(new), "status": "queued", "submitted": Clock()}
        with self._engine.begin() as connection:
            mine = (submissions.c.run == new.id) & (submissions.c.submission == submission)
            connection.execute(submissions.delete().where(mine))
            connection.execute(submissions.insert().values(run=new.id, submission=submission))
            query = sa.select(runs).where(runs.c.id == new.id).with_for_update()  # none cancels it meanwhile
            known = connection.execute(query).mappings().first()
            if known is None:
                try:
                    with connection.begin_nested():
                        connection.execute(runs.insert().values(cancel=False, tries=0, **values))
                except sa.exc.IntegrityError:  # another process was first
                    return self._found(connection, new.id), False
                return self._found(connection, new.id), True
            if not tried_again(dict(known)):
                return dict(known), False
            connection.execute(submissions.delete().where((submissions.c.run == new.id) & ~mine))  # of the former try
            # Without a holder: what one that is still at work makes of the former try is nobody's.
            fresh: Record = {"cancel": False, "tries": 0, **dict.fromkeys(_OUTCOME)}
            same = (runs.c.id == new.id) & (runs.c.status == known["status"])
            won = connection.execute(runs.update().where(same).values(**fresh, **values)).rowcount
            if won == 1:  # what happened in the former try is over
                connection.execute(events.delete().where(events.c.run == new.id))
            return self._found(connection, new.id), won == 1

    def get(self, run: str) -> Record | None:
        """A run; None if there is none of that id."""
        with self._engine.connect() as connection:
            row = connection.execute(sa.select(runs).where(runs.c.id == run)).mappings().first()
        return None if row is None else dict(row)

    def of_ids(self, ids: Sequence[str]) -> dict[str, Record]:
        """The runs of some ids, by id; without those that there are not."""
        found: dict[str, Record] = {}
        for begin in range(0, len(ids), AT_ONCE):
            part = ids[begin : begin + AT_ONCE]
            found |= {record["id"]: record for record in self._all(sa.select(runs).where(runs.c.id.in_(part)))}
        return found

    def newest(self, count: int, before: float | None = None) -> list[Record]:
        """At most `count` runs, the last submitted first; only those submitted before a time."""
        query = sa.select(runs).order_by(runs.c.submitted.desc(), runs.c.id).limit(count)
        if before is not None:
            query = query.where(runs.c.submitted < before)
        return self._all(query)

    def of_states(self, states: Sequence[RunState]) -> list[Record]:
        """The runs of some states, the first submitted first."""
        return self._all(sa.select(runs).where(runs.c.status.in_(states)).order_by(runs.c.submitted))

    def first_queued(self, without: Sequence[str]) -> str | None:
        """The queued run that was submitted first, of those that are not named; None if there is none."""
        which = (runs.c.status == "queued") & runs.c.id.not_in(without)
        with self._engine.connect() as connection:
            return connection.scalar(sa.select(runs.c.id).where(which).order_by(runs.c.submitted).limit(1))

    def counts(self) -> dict[str, int]:
        """How many runs there are of each state."""
        with self._engine.connect() as connection:
            rows = connection.execute(sa.select(runs.c.status, sa.func.count()).group_by(runs.c.status))
            return {str(status): int(count) for status, count in rows}

    def waiting(self) -> int:
        """How many runs are queued."""
        with self._engine.connect() as connection:
            query = sa.select(sa.func.count()).where(runs.c.status == "queued")
            return int(connection.scalar(query) or 0)

    def now(self) -> float:
        """The time by the database's clock, s since 1970."""
        with self._engine.connect() as connection:
            return float(connection.scalar(sa.select(Clock())) or 0.0)

    def begin(self, run: str, holder: str) -> Record | None:
        """Take a queued run, or one that `holder` took before without an answer; None if there is nothing to take."""
        values = {"status": "running", "holder": holder, "started": Clock(), "tries": runs.c.tries + 1}
        event = {"type": "status", "status": "running", "by": holder}
        self._change(run, ("queued",), values, event=event)
        record = self.get(run)
        return record if record is not None and (record["status"], record["holder"]) == ("running", holder) else None

    def end(self, run: str, holder: str, end: RunEnd) -> bool:
        """Record how a run ended that `holder` holds; False if it holds it no longer, and nothing is changed."""
        values = {**vars(end), "bytes": runs.c.bytes + end.bytes, "finished": Clock(), "holder": None}
        return self._change(run, ("running",), values, runs.c.holder == holder, event=_end_event(end))

    def add_ended(self, new: NewRun, end: RunEnd, started: float) -> None:
        """Record a run that was never queued, whose id is its own.

        Args:
            new: what was asked for.
            end: what came of it just now.
            started: when, by `time.time` of this process.
        """
        began = Clock() - (time.time() - started)
        values = {**vars(new), **vars(end), "bytes": new.bytes + end.bytes}
        values |= {"submitted": began, "started": began, "finished": Clock()}
        with self._engine.begin() as connection:
            connection.execute(runs.insert().values(cancel=False, tries=1, **values))

    def cancel(self, run: str, submission: str | None = None, everyone: bool = False) -> int:
        """Take a submission back, and cancel its run if no other is left: at once where it waits, else by its holder.

        Args:
            run: its id.
            submission: the one to take back; None: the only one.
            everyone: whether to cancel the run whoever wants it.

        Returns:
            How many submissions are left for which the run goes on; 0 if it is cancelled or has ended.
        """
        of_run = submissions.c.run == run
        mine = of_run if everyone else of_run & (submissions.c.submission == (submission or ""))
        with self._engine.begin() as connection:
            connection.execute(submissions.delete().where(mine))
            connection.execute(sa.select(runs.c.id).where(runs.c.id == run).with_for_update())  # none submits meanwhile
            left = int(connection.scalar(sa.select(sa.func.count()).where(of_run)) or 0)
            if left > (1 if submission is None else 0):
                return left
            connection.execute(submissions.delete().where(of_run))
            now = {"status": "cancelled", "finished": Clock()}
            change = runs.update().where(runs.c.id == run)
            if connection.execute(change.where(runs.c.status == "queued").values(**now)).rowcount:
                connection.execute(events.insert().values(run=run, data=_end_event(RunEnd("cancelled"))))
            else:
                connection.execute(change.where(runs.c.status == "running").values(cancel=True))
        return 0

    def wanted(self, holder: str) -> set[str]:
        """The runs of a holder that are to go on: it holds them still, and nobody wants them cancelled."""
        query = sa.select(runs.c.id).where(runs.c.holder == holder, ~runs.c.cancel, runs.c.status == "running")
        with self._engine.connect() as connection:
            return set(connection.scalars(query))

    def release(self, run: str, holder: str) -> bool:
        """Put a run back whose holder is gone; False if somebody else did."""
        back = {"status": "queued", "holder": None}
        return self._change(run, ("running",), back, runs.c.holder == holder)

    def delete(self, run: str) -> Record | None:
        """Forget a run that has ended; None if there is none of that id that has."""
        with self._engine.begin() as connection:
            which = (runs.c.id == run) & runs.c.status.in_(ENDED)
            row = connection.execute(sa.select(runs).where(which)).mappings().first()
            if row is not None:
                connection.execute(runs.delete().where(which))
                connection.execute(events.delete().where(events.c.run == run))
                connection.execute(submissions.delete().where(submissions.c.run == run))
        return None if row is None else dict(row)

    def digests_in_use(self) -> set[str]:
        """Digests of all contents that runs refer to."""
        with self._engine.connect() as connection:
            rows = connection.execute(sa.select(runs.c.request, runs.c.contents)).all()
        return {request for request, _ in rows} | {digest for _, held in rows for digest in (held or {}).values()}

    def tell(self, told: Sequence[tuple[str, Record]]) -> None:
        """Add events to runs, in their order: all of them, or none."""
        with self._engine.begin() as connection:
            connection.execute(events.insert(), [{"run": run, "data": data} for run, data in told])

    def events_after(self, number: int, watched: Iterable[str]) -> list[tuple[int, str, Record]]:
        """Events of some runs after the one of a number: number, run, data."""
        query = sa.select(events.c.number, events.c.run, events.c.data).where(
            events.c.number > number, events.c.run.in_(list(watched))
        )
        with self._engine.connect() as connection:
            return [(row[0], row[1], row[2]) for row in connection.execute(query.order_by(events.c.number))]

    def _change(
        self,
        run: str,
        states: Sequence[str],
        values: Record,
        *further: sa.ColumnElement[bool],
        event: Record | None = None,
    ) -> bool:
        """Change a run that is in one of these states, with the event that says so; False if it is not."""
        which = sa.and_(runs.c.id == run, runs.c.status.in_(states), *further)
        with self._engine.begin() as connection:
            won = connection.execute(runs.update().where(which).values(**values)).rowcount == 1
            if won and event is not None:
                connection.execute(events.insert().values(run=run, data=event))
            return won

    def _all(self, query: sa.Select[Any]) -> list[Record]:
        with self._engine.connect() as connection:
            return [dict(row) for row in connection.execute(query).mappings()]

    def _found(self, connection: sa.Connection, run: str) -> Record:
        return dict(connection.execute(sa.select(runs).where(runs.c.id == run)).mappings().one())


def _end_event(end: RunEnd) -> Record:
    return {"type": "end", "status": end.status, "verified": end.verified}


def tried_again(known: Record) -> bool:
    """Return whether the same submission is tried again: what stopped the run, or is about to, was not its planner."""
    if known["status"] == "failed":
        return (known["failure"] or {}).get("kind") in RETRIED or not known["contents"]
    return known["status"] == "cancelled" or (known["status"] == "running" and bool(known["cancel"]))
