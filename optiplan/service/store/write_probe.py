"""Whether the database and the folder of contents take changes now, found by making one of each."""

import threading
import time

import sqlalchemy as sa
from sqlalchemy.engine import Engine

from optiplan.errors import OptiPlanError
from optiplan.service.store.contents import ContentFolder
from optiplan.service.store.tables import Clock, DatabaseAwayError, note

FRESH = 0.5
"""s that a change counts for, unless an error of the database comes in between."""
PATIENCE = 1.0
"""s within which a change has to be made."""
KEY = "written"


class WriteProbe:
    """Writes a small file and one row of the table `about` when it is asked; one that hangs is not asked again."""

    def __init__(self, engine: Engine, contents: ContentFolder) -> None:
        self._engine, self._contents = engine, contents
        self._lock = threading.Lock()
        self._written = float("-inf")
        self._fault: OptiPlanError | None = None
        self._trial: threading.Thread | None = None
        sa.event.listen(engine, "handle_error", self._doubt)

    def fault(self) -> OptiPlanError | None:
        """Why the disk or the database takes no changes now; None: both have taken one within `FRESH`, s."""
        with self._lock:
            fresh = time.monotonic() - FRESH
            if self._written > fresh:
                return None
            if self._trial is None or not self._trial.is_alive():
                self._fault = None
                self._trial = threading.Thread(target=self._try, name="probe", daemon=True)
                self._trial.start()
            trial = self._trial
        trial.join(PATIENCE)
        if self._written > fresh:
            return None
        return self._fault or DatabaseAwayError(f"no change was made within {PATIENCE:g} s", False)

    def _try(self) -> None:
        try:
            self._contents.check_writable()
            note(self._engine, KEY, sa.cast(Clock(), sa.Text))
        except OptiPlanError as error:
            self._fault = error
        except Exception as error:
            self._fault = DatabaseAwayError(str(error).strip().split("\n")[0], False)
        else:
            self._written = time.monotonic()

    def _doubt(self, _: object) -> None:
        self._written = float("-inf")
