"""An editor's language server on the published schema: what it marks, explains and completes in problem files."""

import json
import shutil
import subprocess
import threading
from collections.abc import Iterator
from pathlib import Path
from queue import Queue
from typing import Any

import pytest

from optiplan.cli.main import run as optiplan
from tests.waiting import PATIENCE

SERVER = shutil.which("yaml-language-server")
ABILITIES = {"textDocument": {"publishDiagnostics": {}}, "workspace": {"configuration": True}}
WISHES = {"validate": True, "completion": True, "hover": True, "schemaStore": {"enable": False}}

pytestmark = pytest.mark.skipif(SERVER is None, reason="yaml-language-server is not installed (npm)")


class Editor:
    """A client of the language server, as editors are, in a folder with the schema."""

    def __init__(self, folder: Path) -> None:
        self.root, self.count = folder.as_uri(), 0
        pipe = subprocess.PIPE
        self.process = subprocess.Popen([str(SERVER), "--stdio"], stdin=pipe, stdout=pipe)
        self.heard: Queue[dict[str, Any]] = Queue()
        threading.Thread(target=self._listen, daemon=True).start()
        self.ask("initialize", processId=None, rootUri=self.root, capabilities=ABILITIES)
        self._send({"method": "initialized", "params": {}})

    def _send(self, message: dict[str, Any]) -> None:
        body = json.dumps({"jsonrpc": "2.0", **message}).encode()
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self.process.stdin.flush()

    def _listen(self) -> None:
        stream = self.process.stdout
        while line := stream.readline():
            length = int(line.split(b":")[1]) if line.lower().startswith(b"content-length") else 0
            while stream.readline().strip():
                pass
            self.heard.put(json.loads(stream.read(length)))

    def _until(self, wanted) -> dict[str, Any]:
        while True:
            message = self.heard.get(timeout=PATIENCE)
            if message.get("method") == "workspace/configuration":
                wishes = [WISHES if one.get("section") == "yaml" else None for one in message["params"]["items"]]
                self._send({"id": message["id"], "result": wishes})
            elif "method" in message and "id" in message:
                self._send({"id": message["id"], "result": None})
            elif wanted(message):
                return message

    def ask(self, method: str, **params: Any) -> Any:
        """The answer to a request."""
        self.count += 1
        number = self.count
        self._send({"id": number, "method": method, "params": params})
        return self._until(lambda message: message.get("id") == number)["result"]

    def at(self, name: str, line: int, character: int) -> dict[str, Any]:
        """A place in a file."""
        return {"textDocument": {"uri": f"{self.root}/{name}"}, "position": {"line": line, "character": character}}

    def open(self, name: str, text: str) -> list[tuple[int, str]]:
        """What is marked in a file: lines from 1, and words."""
        uri = f"{self.root}/{name}"
        document = {"uri": uri, "languageId": "yaml", "version": 1, "text": text}
        self._send({"method": "textDocument/didOpen", "params": {"textDocument": document}})
        told = self._until(lambda m: m.get("method") == "textDocument/publishDiagnostics" and m["params"]["uri"] == uri)
        return [(one["range"]["start"]["line"] + 1, one["message"]) for one in told["params"]["diagnostics"]]


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("editor") / "first.yaml"
    assert optiplan(["new", str(path), "--yes"]) == 0
    return path


@pytest.fixture(scope="module")
def editor(first) -> Iterator[Editor]:
    found = Editor(first.parent)
    yield found
    found.process.kill()
    found.process.wait()


def test_nothing_is_marked_in_files_that_are_right(editor, first, problems):
    head = first.read_text().splitlines()[0]
    assert editor.open("first.yaml", first.read_text()) == []
    for path in sorted(problems.glob("*.yaml")):
        assert editor.open(path.name, f"{head}\n{path.read_text()}") == [], path.name


def test_what_is_wrong_is_marked_in_its_line(editor, first):
    text = first.read_text().replace("start:", "strat:") + "clearance: -1\n"
    marked = editor.open("bad.yaml", text)
    (wrong,) = (k for k, line in enumerate(text.splitlines(), 1) if line.startswith("strat"))
    assert {line for line, words in marked if "strat" in words} == {wrong}
    assert {line for line, words in marked if "minimum" in words} == {len(text.splitlines())}


def test_keys_are_explained_and_completed(editor, first):
    text = first.read_text() + "\n"
    editor.open("more.yaml", text)
    line = next(k for k, x in enumerate(text.splitlines()) if x.startswith("start"))
    explained = editor.ask("textDocument/hover", **editor.at("more.yaml", line, 2))
    assert "joints, or a named configuration" in json.dumps(explained)
    offered = editor.ask("textDocument/completion", **editor.at("more.yaml", len(text.splitlines()), 0))["items"]
    assert {"clearance", "tools", "frames", "task"} <= {one["label"] for one in offered}
