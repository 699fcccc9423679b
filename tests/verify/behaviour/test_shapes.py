"""What the shapes are: false verdicts that got through once, and open things that were refused. See tests/attacks."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from optiplan.collision.model import CollisionModel
from optiplan.errors import InputError
from optiplan.geometry.scene import Mesh, Obstacle, Scene
from optiplan.geometry.shapes import build_geometry
from optiplan.problem.load import check_file, load_problem
from optiplan.robot.robot import load_robot
from optiplan.verify.continuous.certificate import certify
from optiplan.verify.report import VerifyPolicy
from optiplan.verify.verify import verify
from tests.verify.motions import quintic

ATTACKS = Path(__file__).parents[2] / "attacks"
SWALLOWED = ATTACKS / "swallowed"
SOLID = ["closed", "double_sided", "mixed_winding"]


@pytest.mark.parametrize("name", SOLID)
def test_a_tool_inside_a_solid_mesh_is_no_free_start(name):
    with pytest.raises(InputError, match="'tool' is inside 'block'"):
        load_problem(SWALLOWED / f"{name}.yaml")


@pytest.mark.parametrize("name", SOLID)
@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0)], ids=["as it is", "mirrored"])
def test_the_verifier_sees_a_tool_inside_a_solid_mesh(name, scale):
    proof = proof_among(Mesh(SWALLOWED / f"{name}.obj", scale))
    assert not proof.proved
    assert "inside" in proof.reason
    assert proof.contact
    assert set(proof.nearest.pair) == {"tool", "block"}


def proof_among(mesh):
    gantry = load_robot(str(SWALLOWED / "robot.yaml"))
    model = CollisionModel(gantry, Scene((Obstacle("block", mesh, pin.SE3.Identity()),)))
    return certify(model, quintic(gantry.joint_names, [-0.1, 0.0], [0.1, 0.05], 1.0), VerifyPolicy())


def test_a_tool_in_an_open_bin_is_free():
    problem = load_problem(SWALLOWED / "bin.yaml")
    joints = problem.robot.joint_names
    assert verify(problem, quintic(joints, problem.start, problem.goal[0].q, 1.0)).verified
    assert proof_among(Mesh(SWALLOWED / "bin.obj")).proved


def test_a_mesh_is_in_the_unit_and_axes_of_its_file():
    """A cube of edge 1 where 1 is 2 m, and the same cube as a box: refused alike."""
    problems = [load_problem(ATTACKS / "dae_unit" / name) for name in ("p.yaml", "pbox.yaml")]
    for problem in problems:
        report = verify(problem, quintic(problem.robot.joint_names, problem.start, problem.goal[0].q, 4.0))
        assert not report.verified
        assert [check.name for check in report.checks if not check.passed] == ["collision"]
    model, twin = (CollisionModel(problem.robot, problem.scene) for problem in problems)
    for q in np.random.default_rng(0).uniform(model.robot.limits.lower, model.robot.limits.upper, (20, 7)):
        mine, its = ({c.pair.name_a: c.distance for c in m.contacts(q, 9.0)} for m in (model, twin))
        assert {name: mine[name] for name, gap in its.items() if gap > 1e-3} == pytest.approx(
            {name: gap for name, gap in its.items() if gap > 1e-3}, abs=1e-5
        )


@pytest.mark.parametrize("path", sorted((ATTACKS / "segv").glob("*.yaml")), ids=lambda path: path.stem)
def test_files_that_ended_the_program_are_bad_input(path):
    (issue,) = check_file(path)
    assert issue.line == 6
    assert issue.field == "scene.obstacles[0].shape.mesh.file"
    assert "STL, OBJ, DAE, PLY or GLB" in issue.expected


@pytest.mark.parametrize("mesh", sorted((ATTACKS / "memory").glob("*.dae")), ids=lambda path: path.stem)
def test_files_that_took_all_memory_are_bad_input(mesh, tmp_path):
    text = (ATTACKS / "memory" / "p.yaml").read_text()
    (tmp_path / "p.yaml").write_text(text.replace("f2_1_13_hull_rc-14.dae", str(mesh)))
    (issue,) = check_file(tmp_path / "p.yaml")
    assert "cannot read mesh" in issue.found


def test_a_robot_with_such_a_mesh_is_bad_input_too(tmp_path):
    mesh = ATTACKS / "segv" / "expo.dae"
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r"><link name="a"/><link name="b"><collision><geometry><mesh filename="{mesh}"/></geometry>'
        '</collision></link><joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>'
    )
    (tmp_path / "robot.yaml").write_text("version: 1\nname: r\nurdf: r.urdf\n")
    with pytest.raises(InputError, match="more than 100000 nodes"):
        load_robot(str(tmp_path / "robot.yaml"))


CUBE = "".join(f"v {x} {y} {z}\n" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
CUBE += "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
"""A cube of edge 2 in quadrangles."""


def write_problem(folder):
    """`p.yaml`: the gantry and a tenth of m.obj beside it."""
    for name in ("robot.yaml", "arm.urdf"):
        (folder / name).write_bytes((SWALLOWED / name).read_bytes())
    placed = "m.obj, scale: 0.1}}, pose: {position: [0, 0.5, 0]}"
    (folder / "p.yaml").write_text((SWALLOWED / "bin.yaml").read_text().replace("bin.obj}}", placed))


def test_a_mesh_that_changes_between_two_loads_is_another_mesh(tmp_path):
    """Same path, same size in bytes, same moment: what is judged is what the file held, and the hash says so."""
    write_problem(tmp_path)
    (tmp_path / "m.obj").write_text(CUBE)
    near = load_problem(tmp_path / "p.yaml")
    (tmp_path / "m.obj").write_text(CUBE.replace(" 1 ", " 3 "))
    far = load_problem(tmp_path / "p.yaml")
    (tmp_path / "m.obj").write_text(CUBE)
    again = load_problem(tmp_path / "p.yaml")
    gaps = [CollisionModel(p.robot, p.scene).clearance(p.start).distance for p in (near, far, again)]
    assert gaps[0] == gaps[2] != gaps[1]
    assert near.hash == again.hash != far.hash


def test_a_mesh_that_changes_after_loading_does_not_change_the_problem(tmp_path):
    """Neither in this process, nor, unseen, in another one."""
    (tmp_path / "m.obj").write_text(CUBE)
    write_problem(tmp_path)
    problem = load_problem(tmp_path / "p.yaml")
    before = CollisionModel(problem.robot, problem.scene).clearance(problem.start).distance
    (tmp_path / "m.obj").write_text(CUBE.replace(" 1 ", " 3 "))
    assert CollisionModel(problem.robot, problem.scene).clearance(problem.start).distance == before
    code = (
        "import sys, pickle; from optiplan.collision.model import CollisionModel\n"
        "robot, scene = pickle.loads(sys.stdin.buffer.read())\nCollisionModel(robot, scene)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        input=pickle.dumps((problem.robot, problem.scene)),
        env={"PYTHONPATH": ":".join(sys.path), "XDG_CACHE_HOME": str(tmp_path / "none")},
        capture_output=True,
        check=False,
    )
    assert done.returncode == 1
    assert b"is not what it was when it was loaded" in done.stderr


@pytest.mark.parametrize("up", ["Y_UP", "Z_UP"])
def test_the_mesh_of_a_link_is_in_the_unit_of_its_file_and_in_the_axes_of_the_link(tmp_path, up):
    """A box of 1 x 2 x 3 units of half a metre, whose file calls y or z up."""
    text = (ATTACKS / "dae_unit" / "cube.dae").read_text()
    corners = " ".join(f"{x} {y} {z}" for x in (0, 1) for y in (0, 2) for z in (0, 3))
    first, last = text.index('count="24">') + 11, text.index("</float_array>")
    text = (text[:first] + corners + text[last:]).replace('meter="2"', 'meter="0.5"').replace("Z_UP", up)
    (tmp_path / "box.dae").write_text(text)
    shape = '<collision><geometry><mesh filename="box.dae" scale="1 1 2"/></geometry></collision></link>'
    urdf = (SWALLOWED / "arm.urdf").read_text().replace('<link name="c1"/>', f'<link name="c1">{shape}')
    (tmp_path / "arm.urdf").write_text(urdf)
    (tmp_path / "robot.yaml").write_text("version: 1\nname: gantry\nurdf: arm.urdf\ncollision: hull\n")
    robot = load_robot(str(tmp_path / "robot.yaml"))
    (body,) = [item for item in robot.geometry.geometryObjects if item.name.startswith("c1")]
    np.testing.assert_allclose(np.array(body.geometry.points()).max(axis=0), [0.5, 1.0, 3.0], atol=1e-12)
    obstacle = build_geometry(Mesh(tmp_path / "box.dae", (1.0, 1.0, 2.0))).aabb_local
    top = [0.5, 0.0, 2.0] if up == "Y_UP" else [0.5, 1.0, 3.0]
    np.testing.assert_allclose(obstacle.max_, top, atol=1e-12)
