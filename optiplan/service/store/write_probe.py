"""Whether the database takes changes now, found out by making one, without ever waiting long for it."""

import threading
import time

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.service.store.tables import Clock, about

FRESH = 0.5
"""s that a change counts for."""
PATIENCE = 1.0
"""s within which a change has to be made."""
KEY = "written"


class WriteProbe:
    """Writes one row of the table `about` when it is asked; one that hangs is not asked a second time."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine
        self._lock = threading.Lock()
        self._written = float("-inf")
        self._fault = ""
        self._trial: threading.Thread | None = None

    def fault(self) -> str | None:
        """Why the database takes no changes now; None: it has taken one within `FRESH`, s."""
        with self._lock:
            if time.monotonic() - self._written < FRESH:
                return None
            if self._trial is None or not self._trial.is_alive():
                self._fault = f"the database takes no changes within {PATIENCE:g} s"
                self._trial = threading.Thread(target=self._try, name="probe", daemon=True)
                self._trial.start()
            trial = self._trial
        trial.join(PATIENCE)
        return None if time.monotonic() - self._written < FRESH + PATIENCE else self._fault

    def _try(self) -> None:
        try:
            with self._engine.begin() as connection:
                value = sa.cast(Clock(), sa.Text)
                row = about.c.key == KEY
                if connection.execute(about.update().where(row).values(value=value)).rowcount == 0:
                    connection.execute(about.insert().values(key=KEY, value=value))
        except sa.exc.IntegrityError:  # another process was first, and so it takes changes
            self._written = time.monotonic()
        except Exception as error:
            self._fault = str(error).strip().split("\n")[0]
        else:
            self._written = time.monotonic()
