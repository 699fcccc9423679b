"""`optiplan run --view`: a server of one's own, on whose page the motion is started, steered and stopped."""

import tempfile
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from optiplan.runs.run import Run

LOOK = 0.1
"""s between two looks whether to end."""


def run_on_page(
    run: "Run",
    driver: str,
    options: Mapping[str, Any],
    steering: Mapping[str, Any],
    tell: Callable[[str], None],
    ended: threading.Event,
) -> dict[str, Any]:
    """Serve the page of an execution, which begins there, until `ended` is set; then its robot stands still.

    Args:
        run: verified.
        driver: name of the driver.
        options: of the driver.
        steering: `override`, `deviation`, `rate` and `patience`.
        tell: called with the page's address.
        ended: what ends it.

    Returns:
        The last execution and its last state: keys of `GET /api/executions/{id}` and of its `state`.
    """
    from optiplan.service.client import Client
    from optiplan.service.server import serving
    from optiplan.service.settings import DriverSetup, ServiceSettings

    plain = {name: str(value.absolute()) if isinstance(value, Path) else value for name, value in options.items()}
    robots = DriverSetup(driver, driver, plain, steering["patience"])
    with tempfile.TemporaryDirectory() as folder:
        settings = ServiceSettings(
            data=Path(folder), port=0, solvers=0, live=0, drivers=(robots,), folders=(Path.cwd().resolve(),)
        )
        with serving(settings) as (url, service), Client(url) as client:
            robot = client.execute(run, driver, paused=True, **steering)
            tell(f"{url}/execution#{robot.id}")
            while not ended.is_set():
                time.sleep(LOOK)
            for session in service.executions.all():
                if session.ended is None:
                    session.say({"do": "stop", "number": 0, "reason": "asked to end"})
            while service.executions.running:
                time.sleep(LOOK)
            last = service.executions.all()[0]
            return {**last.about, **(last.state or {}), "ended": last.ended, "clean": last.clean}
