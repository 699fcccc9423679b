"""A ZeroMQ endpoint that speaks meshcat's protocol: `meshcat.Visualizer(zmq_url=…)` draws into our page.

A client (REQ) sends one frame, or command, path and packed message, and waits for one frame. A ROUTER answers each
client by itself, so that one which waits for a page or for a picture holds up no other.
Source: meshcat-python 0.3.2, `servers/zmqserver.py` and `visualizer.py`.
"""

import threading
import time
import traceback
from collections.abc import Callable
from typing import Any

import umsgpack
import zmq

from optiplan.arrays import is_finite
from optiplan.errors import OptiPlanError
from optiplan.records import dataclass
from optiplan.viewer.drawing.drawing import Drawing, DrawingError

MOST_MESSAGE = 256 * 1024**2
"""bytes of one frame."""
PICTURE_TIME = 10.0
"""s that a page has to give a picture."""

_LOOK = 20  # ms between two looks while a client waits for a page
_IDLE = 200  # ms between two looks for the end


@dataclass
class _Waiting:
    """A client that has no answer yet: for a page, or for the picture of a number until a time, s."""

    client: bytes
    picture: int | None = None
    until: float = 0.0


class MeshcatEndpoint:
    """Answers scripts on this machine, from `start` to `close`, in a thread of its own.

    A message that cannot be drawn is answered with `error: …`, told to `on_trouble` and shown on the pages; the next
    one is taken. meshcat's own client reads no answers, so an answer alone would be silence. If the socket itself
    fails, the thread ends and says so in the same way.

    Args:
        drawing: where messages go.
        port: TCP port on 127.0.0.1, 0: any.
        web_url: address of the page, which clients ask for.
        page: the page with the scene inside it, for `static_html`.
        on_trouble: called with what went wrong, in words, from this thread.

    Raises:
        OptiPlanError: the port cannot be had.
    """

    def __init__(
        self,
        drawing: Drawing,
        port: int,
        web_url: str,
        page: Callable[[], str],
        on_trouble: Callable[[str], None],
    ) -> None:
        self._drawing, self._web_url, self._page, self._on_trouble = drawing, web_url, page, on_trouble
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.ROUTER)
        self._socket.setsockopt(zmq.LINGER, 0)
        self._socket.setsockopt(zmq.MAXMSGSIZE, MOST_MESSAGE)
        try:
            self._socket.bind(f"tcp://127.0.0.1:{port or '*'}")
        except zmq.ZMQError as error:
            self._context.destroy()
            raise OptiPlanError(f"cannot listen for meshcat on 127.0.0.1, port {port}: {error.strerror}") from None
        self.url = self._socket.getsockopt_string(zmq.LAST_ENDPOINT).rstrip("\0")
        self._waiting: list[_Waiting] = []
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="meshcat endpoint", daemon=True)

    def start(self) -> None:
        """Answer from now on."""
        self._thread.start()

    def close(self) -> None:
        """Answer no longer; a second time does nothing."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join()
        self._context.destroy()

    def _serve(self) -> None:
        """Answer until `close`; see the class for what goes wrong."""
        try:
            while not self._closing.is_set():
                if self._socket.poll(_LOOK if self._waiting else _IDLE):
                    self._take()
                self._answer_waiting()
        except Exception as error:  # the socket itself: nothing can be answered any more
            if not self._closing.is_set():
                traceback.print_exc()
                self._tell(f"meshcat can draw no longer: {_words(error)}")

    def _take(self) -> None:
        """Take one message and answer it, whatever is in it."""
        client, *rest = self._socket.recv_multipart()
        try:
            if not rest or rest[0] != b"":
                raise DrawingError("found a message without the empty frame of a REQ socket")
            self._handle(client, rest[1:])
        except zmq.ZMQError:
            raise
        except Exception as error:
            if not isinstance(error, DrawingError):
                traceback.print_exc()
            self._tell(f"meshcat: message refused: {_words(error)}")
            self._answer(client, f"error: {_words(error)}".encode())

    def _handle(self, client: bytes, frames: list[bytes]) -> None:
        command = frames[0].decode("utf-8", "replace") if frames else ""
        if command == "url":
            self._answer(client, self._web_url.encode())
        elif command == "wait":
            self._waiting.append(_Waiting(client))
        elif command == "capture_image":
            number = self._drawing.ask_picture()
            self._waiting.append(_Waiting(client, number, time.monotonic() + PICTURE_TIME))
        elif command == "get_scene":
            self._answer(client, self._page().encode())
        else:
            self._drawing.apply(command, *_checked(command, frames))
            self._answer(client, b"ok")

    def _answer_waiting(self) -> None:
        still = []
        for one in self._waiting:
            if one.picture is None:
                if self._drawing.viewers:
                    self._answer(one.client, b"ok")
                else:
                    still.append(one)
                continue
            found = self._drawing.picture(one.picture)
            if found is None and time.monotonic() < one.until:
                still.append(one)
                continue
            self._drawing.forget_picture(one.picture)
            if found is None:
                self._tell(f"meshcat: no page has given a picture within {PICTURE_TIME:g} s; is one open?")
            self._answer(one.client, found or b"error: no page has given a picture")
        self._waiting = still

    def _answer(self, client: bytes, answer: bytes) -> None:
        """Answer; a client that is gone misses it."""
        self._socket.send_multipart([client, b"", answer])

    def _tell(self, words: str) -> None:
        self._drawing.tell(words)
        self._on_trouble(words)


def _checked(command: str, frames: list[bytes]) -> tuple[str, bytes]:
    """Path and packed message of a command, if the message is one and is of this command and path.

    Raises:
        DrawingError: it is not.
    """
    if len(frames) != 3:
        raise DrawingError(f"found {len(frames)} frames; expected command, path and message")
    try:
        path, message = frames[1].decode(), umsgpack.unpackb(frames[2])
    except Exception as error:  # whatever bytes do to a decoder
        raise DrawingError(f"found bytes that are no message ({_words(error)}); expected MessagePack") from None
    said: Any = message if isinstance(message, dict) else {}
    if (said.get("type"), str(said.get("path", "")).strip("/")) != (command, path.strip("/")):
        raise DrawingError(f"found a message of another command or path than '{command[:40]}' of '{path[:80]}'")
    if command == "set_transform" and not _is_matrix(said.get("matrix")):
        raise DrawingError(f"found a transform of '{path[:80]}' that is none; expected 16 finite numbers")
    return path, frames[2]


def _is_matrix(values: Any) -> bool:
    return isinstance(values, list | tuple) and len(values) == 16 and all(map(is_finite, values))


def _words(error: Exception) -> str:
    return str(error) or type(error).__name__
