"""Scripts draw into a page by meshcat's protocol: its own client, Pinocchio's, what is broken or never read."""

import json
import socket
import threading
import time
import urllib.error
import urllib.request

import numpy as np
import pinocchio as pin
import pytest
from pinocchio.visualize import MeshcatVisualizer

from optiplan.errors import OptiPlanError
from optiplan.viewer.drawing import drawing as drawings
from optiplan.viewer.drawing.drawing import Drawing, DrawingError
from optiplan.viewer.drawing.meshcat_endpoint import MeshcatEndpoint
from optiplan.viewer.drawing.page_server import DrawnPageServer
from optiplan.viewer.scene import build_scene
from tests.viewer.browsing import pixels, until
from tests.waiting import PATIENCE

meshcat = pytest.importorskip("meshcat")
zmq = pytest.importorskip("zmq")
umsgpack = pytest.importorskip("umsgpack")

RED = meshcat.geometry.MeshBasicMaterial(color=0xFF0000)
BOX = meshcat.geometry.Box([0.3, 0.3, 0.3])


def at(*position):
    X = np.eye(4)
    X[:3, 3] = position
    return X


@pytest.fixture
def troubles():
    return []


@pytest.fixture
def served(shelf, motion, troubles):
    """A page of a motion into which scripts draw."""
    scene = build_scene(shelf, [("quintic", motion(shelf), None)])
    with DrawnPageServer(scene, 0, troubles.append, port=0) as server:
        threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True).start()
        yield server
        server.shutdown()


@pytest.fixture
def endpoint(troubles):
    found = MeshcatEndpoint(Drawing(), 0, "http://page/", lambda: "<p>page</p>", troubles.append)
    found.start()
    yield found
    found.close()


@pytest.fixture
def client(endpoint):
    """Sends frames as they are, and returns the answer."""
    context = zmq.Context()
    socket = context.socket(zmq.REQ)
    socket.setsockopt(zmq.RCVTIMEO, int(1000 * PATIENCE))
    socket.setsockopt(zmq.LINGER, 0)
    socket.connect(endpoint.url)

    def ask(*frames):
        socket.send_multipart(frames)
        return socket.recv()

    yield ask
    context.destroy()


def red(page):
    """How much of the scene's picture is red."""
    r, g, b = pixels(page).transpose(2, 0, 1)
    return int(((r > 180) & (g < 60) & (b < 60)).sum())


def position(page, path):
    """Where an object of a script is in the world of the problem, m."""
    found = f"optiplan.app.drawing.object('meshcat/{path}/<object>').getWorldPosition(new MeshCat.THREE.Vector3())"
    return page.evaluate(f"optiplan.scene.root.worldToLocal({found}).toArray()")


def test_scripts_draw_into_the_open_page(served, visit):
    before = meshcat.Visualizer(served.meshcat.url)
    assert before.url() == served.url
    before["early"].set_object(BOX, RED)  # before the page is there
    before["early"].set_transform(at(0.3, 0.4, 0.6))
    page = visit(f"{served.url}#t=0.5&paused")
    assert before.wait() == "ok"
    until(page, "optiplan.app.drawing.messages >= 2")
    there = red(page)
    assert there > 100
    np.testing.assert_allclose(position(page, "early"), [0.3, 0.4, 0.6], atol=1e-6)
    later = meshcat.Visualizer(served.meshcat.url)  # another script, beside the first
    later["late"].set_object(BOX, RED)
    later["late"].set_transform(at(-0.3, -0.4, 0.6))
    until(page, "optiplan.app.drawing.messages >= 4")
    assert red(page) > 1.2 * there
    before.delete()  # all that is drawn
    until(page, "optiplan.app.drawing.messages >= 5")
    assert red(page) == 0
    pinocchio_draws(served, page)
    assert page.evaluate("optiplan.app.drawing.failures") == []


def pinocchio_draws(served, page):
    """Its own visualizer shows its own robot at a configuration."""
    model = pin.buildSampleModelManipulator()
    geometry = pin.buildSampleGeometryModelManipulator(model)
    shown = MeshcatVisualizer(model, geometry, geometry)
    shown.initViewer(viewer=meshcat.Visualizer(served.meshcat.url), open=False)
    shown.loadViewerModel("sample")
    q = pin.neutral(model)
    q[:2] = 0.4, -0.7
    shown.display(q)
    until(page, "optiplan.app.drawing.messages >= 15")
    placed = geometry.createData()
    pin.updateGeometryPlacements(model, model.createData(), geometry, placed, q)
    seen = position(page, f"sample/visuals/{geometry.geometryObjects[1].name}")
    np.testing.assert_allclose(seen, placed.oMg[1].translation, atol=1e-6)


def test_a_picture_a_page_without_a_server_and_what_cannot_be_drawn(served, visit, troubles):
    shown = meshcat.Visualizer(served.meshcat.url)
    shown["box"].set_object(BOX, RED)
    page = visit(f"{served.url}#t=0.5&paused")
    until(page, "optiplan.app.drawing.messages >= 1")
    taken = []
    thread = threading.Thread(target=lambda: taken.append(shown.get_image()))
    thread.start()
    while thread.is_alive():
        page.evaluate("0")
        time.sleep(0.05)
    width, height = page.evaluate(
        "[optiplan.scene.viewer.renderer.domElement.width, optiplan.scene.viewer.renderer.domElement.height]"
    )
    assert taken[0].size == (width, height)
    still = shown.static_html()
    assert '"drawn":{"messages":[["set_object"' in still
    assert "connect-src 'none'" in still
    served.drawing.apply("set_object", "/odd", bytes([0x81]))  # past the endpoint's check
    until(page, "optiplan.app.drawing.failures.length === 1")
    assert "set_object of /odd cannot be drawn" in page.inner_text("#note")
    served.meshcat._tell("meshcat: message refused: for a test")
    until(page, "document.getElementById('note').textContent.includes('refused')")
    assert troubles == ["meshcat: message refused: for a test"]


def test_broken_messages_are_told_and_the_next_is_drawn(client, endpoint, troubles):
    import umsgpack

    good = umsgpack.packb({"type": "set_transform", "path": "/a", "matrix": [1.0] * 16})
    for frames, words in (
        ((b"set_transform", b"/a", b"\xc1"), b"no message"),
        ((b"set_transform", b"/b", good), b"another command or path"),
        ((b"set_transform", b"/a"), b"found 2 frames"),
        ((b"explode", b"/a", good), b"another command or path"),
        ((b"\xff\xfe", b"/a", good), b"another command"),
        ((b"",), b"found 1 frames"),
    ):
        answer = client(*frames)
        assert answer.startswith(b"error: ")
        assert words in answer
        assert troubles[-1].startswith("meshcat: message refused")
    assert len(troubles) == 6
    assert client(b"set_transform", b"/a", good) == b"ok"
    assert client(b"url") == b"http://page/"
    assert client(b"get_scene") == b"<p>page</p>"


def test_a_fault_of_ours_is_told_and_the_thread_goes_on(client, endpoint, troubles, monkeypatch, capsys):
    def broken():
        raise RuntimeError("for a test")

    monkeypatch.setattr(endpoint, "_page", broken)
    assert client(b"get_scene") == b"error: for a test"
    assert troubles == ["meshcat: message refused: for a test"]
    assert "RuntimeError" in capsys.readouterr().err
    assert client(b"url") == b"http://page/"


def test_a_socket_that_fails_ends_the_thread_loudly(endpoint, troubles, monkeypatch, capsys):
    def fails(*_):
        raise zmq.ZMQError(zmq.ETERM)

    monkeypatch.setattr(endpoint, "_take", fails)
    monkeypatch.setattr(endpoint, "_answer_waiting", fails)
    endpoint._thread.join(PATIENCE)
    assert not endpoint._thread.is_alive()
    assert troubles[0].startswith("meshcat can draw no longer: ")
    assert "ZMQError" in capsys.readouterr().err


def test_who_waits_for_a_page_holds_up_nobody(endpoint, client):
    context = zmq.Context()
    waiting = context.socket(zmq.REQ)
    waiting.setsockopt(zmq.LINGER, 0)
    waiting.connect(endpoint.url)
    waiting.send(b"wait")
    assert client(b"url") == b"http://page/"
    assert not waiting.poll(100)
    endpoint._drawing.follow()
    assert waiting.poll(int(1000 * PATIENCE))
    context.destroy()


def test_no_picture_is_an_error_not_silence(client, monkeypatch, troubles):
    monkeypatch.setattr("optiplan.viewer.drawing.meshcat_endpoint.PICTURE_TIME", 0.05)
    assert client(b"capture_image", b"", b"\x80") == b"error: no page has given a picture"
    assert "is one open?" in troubles[0]


def test_a_port_that_is_taken_is_an_error(endpoint):
    port = int(endpoint.url.rsplit(":", 1)[1])
    with pytest.raises(OptiPlanError, match=f"port {port}"):
        MeshcatEndpoint(Drawing(), port, "", str, print)


def test_a_server_whose_ports_are_taken_leaves_nothing_open(shelf, motion, endpoint, monkeypatch):
    """The page's port is taken: the next one is; meshcat's is: an error, and the page's is free again."""
    scene = build_scene(shelf, [("quintic", motion(shelf), None)])
    with socket.socket() as busy:
        busy.bind(("127.0.0.1", 0))
        busy.listen()
        port = busy.getsockname()[1]
        with DrawnPageServer(scene, 0, print, port=port) as server:
            assert server.server_address[1] > port
        closed = []
        monkeypatch.setattr(Drawing, "close", lambda self: closed.append(self))
        taken = int(endpoint.url.rsplit(":", 1)[1])
        with pytest.raises(OptiPlanError, match="cannot listen for meshcat"):
            DrawnPageServer(scene, taken, print, port=port)
        assert len(closed) == 1
    with DrawnPageServer(scene, 0, print, port=port) as server:
        assert server.server_address[1] == port


@pytest.mark.parametrize("matrix", [[np.nan] * 16, [1.0] * 15, [*[0.0] * 15, np.inf], None, "ones"])
def test_a_transform_that_is_none_is_refused(client, endpoint, troubles, matrix):
    message = {"type": "set_transform", "path": "/a", "matrix": matrix}
    answer = client(b"set_transform", b"/a", umsgpack.packb(message))
    assert answer == b"error: found a transform of '/a' that is none; expected 16 finite numbers"
    assert endpoint._drawing.scene() == []
    message["matrix"] = np.eye(4).flatten().tolist()
    assert client(b"set_transform", b"/a", umsgpack.packb(message)) == b"ok"


def test_a_page_that_opens_later_gets_the_newest_of_each_kind():
    drawing = Drawing()
    for command, path, data in (
        ("set_object", "/a/b", b"old"),
        ("set_property", "/a/b", b"of old"),
        ("set_object", "/a/b", b"new"),
        ("set_property", "/a/b", b"one"),
        ("set_property", "/a/b", b"two"),
        ("set_transform", "/a", b"here"),
        ("set_transform", "/a", b"there"),
        ("set_object", "/gone/x", b"gone"),
        ("delete", "/gone", b""),
        ("delete", "/never/there", b""),
    ):
        drawing.apply(command, path, data)
    lines = [json.loads(line) for line in drawing.follow().taken()]
    assert [line[:2] for line in lines] == [
        ["reset"],
        ["set_transform", "/a"],
        *[["set_object", "/a/b"], ["set_property", "/a/b"], ["set_property", "/a/b"]],
    ]
    assert [line[0:2] for line in drawing.scene()] == [line[:2] for line in lines[1:]]
    drawing.apply("delete", "/", b"")
    assert drawing.scene() == []
    assert drawing._bytes == 0
    with pytest.raises(DrawingError, match="set_object"):
        drawing.apply("paint", "/a", b"")


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(drawings, "MOST_BYTES", 100)
    monkeypatch.setattr(drawings, "MOST_WAITING", 300)
    drawing = Drawing()
    drawing.apply("set_object", "/a", bytes(90))
    with pytest.raises(DrawingError, match="delete something"):
        drawing.apply("set_object", "/b", bytes(20))
    drawing.apply("delete", "/a", b"")
    with pytest.raises(DrawingError, match="101 names"):
        drawing.apply("set_object", "/a" * 101, b"")
    slow = drawing.follow()
    for _ in range(6):
        drawing.apply("set_transform", "/b", bytes(20))
    assert slow.lost  # its browser comes back and begins anew
    assert len(drawing._followers) == 1


def test_strangers_get_neither_stream_nor_answer(served):
    for method, query, data in (("GET", "drawing", None), ("POST", "drawing?picture=1", b"x")):
        request = urllib.request.Request(served.url + query, data, {"Origin": "http://evil.example"}, method=method)
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(request)
    for query, data, status in (
        ("drawing?picture=1", b"data:image/png;base64,AAAA", "410"),
        ("drawing", b"x", "404"),
        ("drawing?picture=1", b"!", "400"),
    ):
        with pytest.raises(urllib.error.HTTPError, match=status):
            urllib.request.urlopen(urllib.request.Request(served.url + query, data))
