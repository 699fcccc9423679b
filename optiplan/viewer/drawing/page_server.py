"""The page of runs, served with what scripts draw into it: `/drawing` is a stream of server-sent events."""

import base64
import binascii
from collections.abc import Callable
from contextlib import ExitStack
from urllib.parse import parse_qs, urlsplit

from optiplan.viewer.drawing.drawing import Drawing
from optiplan.viewer.drawing.meshcat_endpoint import MeshcatEndpoint
from optiplan.viewer.page import Drawn, render_page
from optiplan.viewer.safety import DRAWN_POLICY
from optiplan.viewer.scene import SceneData
from optiplan.viewer.server import FIRST_PORT, PageHandler, PageServer

ADDRESS = "drawing"
"""Of the stream, beside the page."""
MOST_PICTURE = 64 * 1024**2
"""bytes of a picture that a page gives."""
_BEAT = 5.0  # s between two signs of life, by which a page that is gone is noticed
_PNG = "data:image/png;base64,"


class DrawnPageServer(PageServer):
    """Serves a scene into which scripts draw by meshcat's protocol, at `meshcat.url`.

    Raises:
        OptiPlanError: no port is free, or that of meshcat is not.
    """

    policy = DRAWN_POLICY

    def __init__(
        self,
        scene: SceneData,
        meshcat_port: int,
        on_trouble: Callable[[str], None],
        host: str = "127.0.0.1",
        port: int = FIRST_PORT,
    ) -> None:
        self.drawing = Drawing()
        self._scene, self._open = scene, ExitStack()
        super().__init__(render_page(scene, drawn=Drawn(address=ADDRESS)), host, port)
        with ExitStack() as made:  # of what is open where the rest cannot be
            made.callback(super().server_close)
            made.callback(self.drawing.close)
            self.meshcat = MeshcatEndpoint(self.drawing, meshcat_port, self.url, self.kept, on_trouble)
            made.callback(self.meshcat.close)
            self.meshcat.start()
            self._open = made.pop_all()

    @property
    def handler(self) -> type[PageHandler]:
        """What answers a request."""
        return _DrawnHandler

    def kept(self) -> str:
        """The page with what is drawn now, which plays without this server."""
        return render_page(self._scene, drawn=Drawn(self.drawing.scene()))

    def server_close(self) -> None:
        """Let go of scripts and pages."""
        self._open.close()
        super().server_close()


class _DrawnHandler(PageHandler):
    server: DrawnPageServer

    def do_GET(self) -> None:
        """Answer with the page, or with the stream of what is drawn."""
        if urlsplit(self.path).path != f"/{ADDRESS}":
            super().do_GET()
        elif self.admitted():
            self._stream()

    def do_POST(self) -> None:
        """Take the picture requested of a page: a `data:` address of a PNG file."""
        if not self.admitted():
            return
        parts = urlsplit(self.path)
        number, length = parse_qs(parts.query).get("picture", [""])[0], self.headers.get("Content-Length") or ""
        if parts.path != f"/{ADDRESS}" or not (number.isdecimal() and length.isdecimal()):
            self.send_error(404)
            return
        if int(length) > MOST_PICTURE:
            self.send_error(413)
            return
        body = self.rfile.read(int(length))
        try:
            picture = base64.b64decode(body.removeprefix(_PNG.encode()), validate=True)
        except binascii.Error:
            self.send_error(400)
            return
        taken = self.server.drawing.give_picture(int(number), picture)
        self.send_response(204 if taken else 410)
        self.end_headers()

    def _stream(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        drawing = self.server.drawing
        follower = drawing.follow()
        try:
            while not follower.lost:
                lines = follower.wait(_BEAT)
                self.wfile.write(event(lines) if lines else b": here\n\n")
                self.wfile.flush()
        except OSError:  # the page is closed
            pass
        finally:
            drawing.leave(follower)


def event(lines: list[str]) -> bytes:
    """Messages as one event: their JSON in a list."""
    return f"data: [{','.join(lines)}]\n\n".encode()
