"""What has been drawn: meshcat's messages by path, kept for pages that open later and passed on to those that are open.

A message is a command, a path, and the command packed by MessagePack, as meshcat's browser code takes it.
"""

import base64
import json
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import field

from optiplan.records import dataclass

COMMANDS = ("set_object", "set_transform", "set_property", "set_animation", "delete")
"""Commands of meshcat that change the scene."""
MOST_BYTES = 512 * 1024**2
"""Of all that is drawn at a time."""
MOST_WAITING = 256 * 1024**2
"""Characters that a page may be behind; then it is let go, and its browser comes back and begins anew."""
MOST_NAMES = 100
"""Of a path."""

_PROPERTIES = 200  # of one object that are kept, the newest


class DrawingError(Exception):
    """A message that cannot be drawn, with the reason in words."""


@dataclass
class _PathNode:
    """What one path holds: the newest message of each kind."""

    object: bytes | None = None
    transform: bytes | None = None
    animation: bytes | None = None
    properties: deque[bytes] = field(default_factory=lambda: deque(maxlen=_PROPERTIES))
    children: dict[str, "_PathNode"] = field(default_factory=dict)

    def messages(self, path: str) -> Iterator[tuple[str, str, bytes]]:
        """What draws it and all below it again, objects first."""
        kept = [("set_object", self.object), *(("set_property", one) for one in self.properties)]
        for command, data in (*kept, ("set_transform", self.transform), ("set_animation", self.animation)):
            if data is not None:
                yield command, path, data
        for name, child in self.children.items():
            yield from child.messages(f"{path}/{name}")


class Follower:
    """A page that is open: what is to be sent to it, as lines of JSON."""

    def __init__(self, first: list[str], on_news: Callable[[], None]) -> None:
        self._lines = deque(first)
        self._behind = 0
        self._on_news = on_news
        self.lost = False  # too far behind, or the drawing has ended: to be closed; it may come back and begin anew
        self._news = threading.Event()
        self._news.set()

    def put(self, line: str) -> None:
        """Send a line, unless too much waits."""
        self._behind += len(line)
        self.lost = self.lost or self._behind > MOST_WAITING
        if not self.lost:
            self._lines.append(line)
        self.wake()

    def wake(self) -> None:
        """Let who waits look again."""
        self._news.set()
        self._on_news()

    def taken(self) -> list[str]:
        """All lines that wait, which then wait no longer."""
        self._news.clear()
        self._behind, found = 0, []
        while self._lines:
            found.append(self._lines.popleft())
        return found

    def wait(self, timeout: float) -> list[str]:
        """`taken` once there is news, or after this time, s."""
        self._news.wait(timeout)
        return self.taken()


class Drawing:
    """The scene of all scripts together, safe to be used by several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._root = _PathNode()
        self._bytes = 0
        self._followers: set[Follower] = set()
        self._pictures: dict[int, bytes | None] = {}
        self._asked = 0

    @property
    def viewers(self) -> int:
        """How many pages are open."""
        return len(self._followers)

    def apply(self, command: str, path: str, data: bytes) -> None:
        """Keep a message and send it to all pages.

        Raises:
            DrawingError: no such command, a path too deep, or more than `MOST_BYTES` would be kept.
        """
        if command not in COMMANDS:
            raise DrawingError(f"found the command '{command[:40]}'; expected one of: {', '.join(COMMANDS)}")
        names = [name for name in path.split("/") if name]
        if len(names) > MOST_NAMES:
            raise DrawingError(f"found a path of {len(names)} names; expected at most {MOST_NAMES}")
        with self._lock:
            self._keep(command, names, data)
            line = _line(command, "/" + "/".join(names), data)
            for follower in self._followers:
                follower.put(line)

    def tell(self, words: str) -> None:
        """Show words of trouble on all pages."""
        self._send(json.dumps(["trouble", words]))

    def follow(self, on_news: Callable[[], None] = lambda: None) -> Follower:
        """A page opens: it gets the scene so far, then every message; `on_news` is called from any thread."""
        with self._lock:
            scene = [_line(*message) for message in self._root.messages("")]
            follower = Follower([json.dumps(["reset"]), *scene], on_news)
            self._followers.add(follower)
            return follower

    def leave(self, follower: Follower) -> None:
        """A page has been closed."""
        with self._lock:
            self._followers.discard(follower)

    def close(self) -> None:
        """Let go of all pages."""
        with self._lock:
            for follower in self._followers:
                follower.lost = True
                follower.wake()

    def scene(self) -> list[list[str]]:
        """The messages that draw the scene, as `[command, path, base64 of the packed message]`."""
        with self._lock:
            return [json.loads(_line(*message)) for message in self._root.messages("")]

    def ask_picture(self) -> int:
        """Ask the pages for a picture; its number, for `picture`."""
        with self._lock:
            self._asked += 1
            self._pictures[self._asked] = None
        self._send(json.dumps(["picture", self._asked]))
        return self._asked

    def give_picture(self, number: int, data: bytes) -> bool:
        """A page gives a picture as PNG; False: nobody waits for it."""
        with self._lock:
            if self._pictures.get(number, b"") is not None:
                return False
            self._pictures[number] = data
            return True

    def picture(self, number: int) -> bytes | None:
        """The picture of that number, None while no page has given it."""
        return self._pictures.get(number)

    def forget_picture(self, number: int) -> None:
        """Nobody waits for a picture any more."""
        with self._lock:
            self._pictures.pop(number, None)

    def _send(self, line: str) -> None:
        with self._lock:
            for follower in self._followers:
                follower.put(line)

    def _keep(self, command: str, names: list[str], data: bytes) -> None:
        if command == "delete":
            self._delete(names)
            return
        if self._bytes + len(data) > MOST_BYTES:
            raise DrawingError(f"more than {MOST_BYTES // 1024**2} MB would be drawn; delete something first")
        node = self._root
        for name in names:
            node = node.children.setdefault(name, _PathNode())
        if command == "set_property":
            if len(node.properties) == _PROPERTIES:
                self._bytes -= len(node.properties[0])
            node.properties.append(data)
        else:
            kind = command.removeprefix("set_")
            self._bytes -= len(getattr(node, kind) or b"")
            setattr(node, kind, data)
            if kind == "object":
                self._bytes -= sum(map(len, node.properties))
                node.properties.clear()
        self._bytes += len(data)

    def _delete(self, names: list[str]) -> None:
        parent, node = None, self._root
        for name in names:
            if name not in node.children:
                return
            parent, node = node, node.children[name]
        self._bytes -= sum(len(data) for _, _, data in node.messages(""))
        if parent is None:
            self._root = _PathNode()
        else:
            del parent.children[names[-1]]


def picture_of(address: bytes) -> bytes:
    """Return the PNG file of a `data:` address.

    Raises:
        ValueError: it is none.
    """
    return base64.b64decode(address.removeprefix(b"data:image/png;base64,"), validate=True)


def _line(command: str, path: str, data: bytes) -> str:
    return json.dumps([command, path, base64.b64encode(data).decode()])
