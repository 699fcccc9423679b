"""Scripts draw by meshcat's protocol into the pages of runs."""

import pytest

from tests.service import browsing
from tests.viewer.browsing import until

meshcat = pytest.importorskip("meshcat")
zmq = pytest.importorskip("zmq")


@pytest.mark.parametrize("page", [(900, 600)], indirect=True)
def test_a_script_draws_into_the_page_of_a_run(server, page):
    run = server.submit()["id"]
    assert server.ended(run)["verified"]
    shown = meshcat.Visualizer(server.service.meshcat_url)
    assert shown.url() == f"{server.url}/"
    shown["of service"].set_object(meshcat.geometry.Box([0.1, 0.1, 0.1]))
    page.goto(f"{server.url}/runs/{run}")
    page.wait_for_selector("html[data-ready='1']", timeout=browsing.PATIENCE)
    assert shown.wait() == "ok"
    until(page, "optiplan.app.drawing.messages === 1")
    shown["of service"].set_property("visible", False)
    until(page, "optiplan.app.drawing.object('meshcat/of service').visible === false")
    assert page.evaluate("optiplan.app.drawing.failures") == []
    shown.delete()
    assert server.http.post("/api/drawing?picture=7", content=b"data:image/png;base64,AAAA").status_code == 404
    assert server.http.post("/api/drawing?picture=7", content=b"no picture!").status_code == 422
    assert answer_to(server.service.meshcat_url, b"get_scene").startswith(b"error: no page alone")


def answer_to(url, *frames):
    context = zmq.Context()
    socket = context.socket(zmq.REQ)
    socket.setsockopt(zmq.LINGER, 0)
    socket.connect(url)
    socket.send_multipart(frames)
    answer = socket.recv() if socket.poll(browsing.PATIENCE) else b""
    context.destroy()
    return answer


def test_without_a_port_nobody_draws(server, monkeypatch):
    monkeypatch.setattr(server.service, "drawing", None)
    answer = server.http.get("/api/drawing")
    assert answer.status_code == 404
    assert "--meshcat-port" in answer.text
