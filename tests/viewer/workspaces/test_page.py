"""The page of workspaces: its data, and in a real browser the scene, the readout and the robot that follows it."""

import json
import re

import numpy as np
import pinocchio as pin
import pytest

from optiplan.kinematics.manipulability import ToolKinematics
from optiplan.robot.robot import load_robot
from optiplan.viewer.workspaces.page import best_samples, render_workspaces
from optiplan.workspace.sampling import WorkspaceOptions, study_workspace
from tests.axe import serious
from tests.viewer.browsing import UNDRAWN

pytestmark = [pytest.mark.timeout(240)]


@pytest.fixture(scope="module")
def found():
    options = WorkspaceOptions(samples=1500, voxels=6)
    return [study_workspace(load_robot(name), options, processes=1) for name in ("ur5", "planar2r")]


def test_the_best_sample_of_a_voxel_lies_in_it(found):
    one = found[0]
    Q = best_samples(one)
    reached = one.voxels.counts > 0
    assert np.isfinite(Q[reached]).all()
    assert np.isnan(Q[~reached]).all()
    X_WT, J = ToolKinematics(one.robot).evaluate(Q[reached])
    assert np.abs(X_WT[:, :3, 3] - one.voxels.centres[reached]).max() <= 0.5 * one.voxels.edge + 1e-9
    J[:, :3] /= one.reach.largest
    np.testing.assert_allclose(
        np.prod(np.linalg.svd(J, compute_uv=False), axis=1), one.voxels.maxima["yoshikawa"][reached], rtol=1e-9
    )


def test_the_page_asks_for_nothing_and_says_so(found):
    text = render_workspaces(found)
    assert "default-src 'none'" in text
    assert not re.search(r'(src|href)="(?!data:)', text.split('<script id="data"')[0])
    data = json.loads(re.search(r'<script id="data" type="application/json">(.*?)</script>', text).group(1))
    ur5, planar = data["robots"]
    assert ur5["offset"] == 0.0
    assert planar["offset"] > ur5["radius"] + planar["radius"]
    assert len(ur5["joints"]) == 6
    assert len(ur5["tree"]["parents"]) == 6
    assert len(text) < 2.5e6


def test_in_a_browser(found, browser, tmp_path):
    """Drawn, cut, pointed at; nothing asked for elsewhere; nothing beyond its place on a screen and on a phone."""
    path = tmp_path / "workspace.html"
    path.write_text(render_workspaces(found), encoding="utf-8")
    complaints = []
    page = browser.new_page(viewport={"width": 1280, "height": 800}, device_scale_factor=0.25)
    page.add_init_script(UNDRAWN)
    page.on(
        "console", lambda m: m.type in ("error", "warning") and "GPU stall" not in m.text and complaints.append(m.text)
    )
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda r: r.url.startswith((path.as_uri(), "data:")) or complaints.append(r.url))
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready='1']", timeout=60_000)
    counts = "OptiPlanWorkspace.robots.map((one) => [one.reached.count, one.missed.count])"
    one = found[0]
    kept = one.voxels.centres[:, 1] - one.reach.shoulder[1] >= 0.15 * one.reach.largest - 1e-6
    reached = one.voxels.counts > 0
    assert page.evaluate(counts)[0] == [int((kept & reached).sum()), int((kept & ~reached).sum())]
    page.select_option("#axis", "")
    assert page.evaluate(counts)[0] == [int(reached.sum()), int((~reached).sum())]

    k = int(np.flatnonzero(reached)[np.argmax(one.voxels.counts[reached])])
    page.evaluate("(k) => OptiPlanWorkspace.select([OptiPlanWorkspace.robots[0], k])", k)
    told = page.locator("#readout").inner_text()
    assert ", ".join(f"{x:.3f}" for x in one.voxels.centres[k]) in told
    assert f"\n{one.voxels.counts[k]}\n" in told
    body = "OptiPlanWorkspace.robots[0].figure.bodies.at(-1)"
    last = page.evaluate(f"[...{body}.position.toArray(), ...{body}.quaternion.toArray()]")
    data = one.robot.model.createData()
    pin.forwardKinematics(one.robot.model, data, best_samples(one)[k])
    X = pin.XYZQUATToSE3(np.array(last))
    np.testing.assert_allclose(X.homogeneous, data.oMi[one.robot.model.njoints - 1].homogeneous, atol=1e-5)

    box = page.locator("#pane").bounding_box()
    page.mouse.move(box["x"] + 0.45 * box["width"], box["y"] + 0.45 * box["height"])
    page.wait_for_timeout(300)
    assert "centre x, y, z, m" in page.locator("#readout").inner_text()
    page.locator("#layers input").first.uncheck()
    assert not page.evaluate("OptiPlanWorkspace.layers.robot.visible")
    assert serious(page) == []
    page.locator("#theme").click()
    assert serious(page) == []
    page.set_viewport_size({"width": 390, "height": 844})
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    head, stage, card = (page.locator(f"#{name}").bounding_box() for name in ("head", "stage", "card"))
    assert head["y"] + head["height"] <= stage["y"] + 1
    assert stage["y"] + stage["height"] <= card["y"] + 1
    assert stage["height"] > 250
    targets = "[...document.querySelectorAll('button, select, #layers label')]"
    assert page.evaluate(f"Math.min(...{targets}.map((e) => e.offsetHeight))") >= 40
    assert [one for one in complaints if "GPU stall due to ReadPixels" not in one] == []
    page.close()
