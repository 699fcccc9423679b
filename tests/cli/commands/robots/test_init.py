"""`optiplan robots init`: from a URDF to a robot that plans."""

import json
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import pytest
import trimesh
from click.testing import CliRunner
from typer.main import get_command

from optiplan.cli.commands.robots import mesh_covers
from optiplan.cli.commands.robots.app import app
from optiplan.robot.robot import load_robot
from tests.robot.robots import LINK, chain, joint

FINGER = '<limit lower="0" upper="0.1" velocity="1" effort="1"/>'
PARTS = [
    *chain(joint("j1", "a", "b"), joint("j2", "b", "c"), joint("j3", "c", "d")),
    '<link name="tool0"/><link name="f"/>',
    joint("mount", "d", "tool0", "fixed", ""),
    joint("finger", "d", "f", "prismatic", FINGER, x=0.01),
]


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="my arm">{"".join(PARTS)}</robot>')
    return path


def test_without_flags_the_choices_are_made_and_said(optiplan, urdf):
    code, out, _ = optiplan("robots", "init", urdf)
    assert code == 0
    folder = urdf.parent
    assert (folder / "robot.yaml").read_text() == (
        '# Made by `optiplan robots init arm.urdf`.\nversion: 1\nname: "my arm"\nurdf: arm.urdf\n'
        "group: [j1, j2, j3]\ntool_frame: tool0\n"
    )
    for words in (
        "planned is the longest chain of joints, j1, j2, j3",
        f"written: {folder / 'robot.yaml'} and",
        "next:",
    ):
        assert words in out
    robot = load_robot(str(folder / "robot.yaml"))
    assert (robot.joint_names, robot.tool_frame) == (("j1", "j2", "j3"), "tool0")
    pairs = ElementTree.parse(folder / "robot.srdf").getroot().findall("disable_collisions")
    assert {(pair.get("link1"), pair.get("link2")) for pair in pairs} <= set(robot.allowed)
    assert not [reason for reason in robot.allowed.values() if reason.startswith("SRDF")]


@pytest.fixture
def meshed(tmp_path, monkeypatch) -> Path:
    """An arm of three meshes, two of them of the same file, and a cache that is empty."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(mesh_covers, "cores", lambda: 2)
    trimesh.creation.torus(0.1, 0.03, major_sections=12, minor_sections=6).export(tmp_path / "ring.stl")
    trimesh.creation.box((0.1, 0.02, 0.02)).export(tmp_path / "bar.stl")
    mesh = '<link name="{0}"><collision><geometry><mesh filename="{1}"/></geometry></collision></link>'
    links = [mesh.format(name, tmp_path / file) for name, file in zip("abc", MESHES, strict=True)]
    path = tmp_path / "meshed.urdf"
    path.write_text(f'<robot name="meshed">{"".join(links)}{joint("j1", "a", "b")}{joint("j2", "b", "c")}</robot>')
    return path


MESHES = ("bar.stl", "ring.stl", "ring.stl")


def test_meshes_are_cut_in_other_processes_before_the_load(optiplan, meshed, tmp_path, monkeypatch):
    """This process cuts none, since it finds what it would have made, with the same bits."""
    with monkeypatch.context() as only_here:
        only_here.setattr("optiplan.geometry.convex._cover", lambda *_: pytest.fail("cut by the load"))
        code, _, err = optiplan("robots", "init", meshed, "--no-ask", "--allow-pairs", "touching")
        assert code == 0, err
    assert "cutting meshes into convex pieces, once: 2 of 2" in err
    made = covers(tmp_path / "cache")
    assert len(made) == 2
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "other"))
    load_robot(str(tmp_path / "robot.yaml"))
    assert covers(tmp_path / "other") == made


def covers(folder):
    return {path.name: path.read_bytes() for path in (folder / "optiplan/covers").iterdir()}


@pytest.mark.parametrize("why", ["they are kept", "nothing can be kept"])
def test_no_process_is_started_where_that_would_be_in_vain(optiplan, meshed, tmp_path, monkeypatch, why):
    if why == "they are kept":
        monkeypatch.setattr(mesh_covers, "cores", lambda: 1)  # cut in this process, which is quicker
        assert optiplan("robots", "init", meshed, "--no-ask", "--out", tmp_path / "first")[0] == 0
        monkeypatch.setattr(mesh_covers, "cores", lambda: 2)
    else:
        (tmp_path / "cache").touch()
    monkeypatch.setattr(mesh_covers, "run_chunks", lambda *_: pytest.fail("started"))
    assert optiplan("robots", "init", meshed, "--no-ask", "--out", tmp_path / "second")[0] == 0


def test_a_mesh_that_cannot_be_cut_is_left_to_the_load(optiplan, meshed, tmp_path):
    (tmp_path / "bar.stl").write_text("solid nothing\nendsolid nothing\n")
    code, _, err = optiplan("robots", "init", meshed, "--no-ask")
    assert code == 2
    assert "bar.stl" in err
    assert "Traceback" not in err


def test_it_plans_what_it_made(optiplan, urdf, tmp_path):
    assert optiplan("robots", "init", urdf, "--out", tmp_path / "made")[0] == 0
    problem = tmp_path / "problem.yaml"
    problem.write_text(
        "version: 1\nrobot: made/robot.yaml\nplanner: quintic\n"
        "start: {joints: [0, 0, 0]}\ngoal: {joints: [0.5, 0, 0.2]}\n"
    )
    code, out, err = optiplan("plan", problem, "--out", tmp_path / "run")
    assert code == 0, out + err


def test_flags_choose(optiplan, urdf, tmp_path):
    flags = ("--group", "j2, j3", "--tool", "d", "--lock", "j1=0.5", "--lock", "finger=0.02", "--name", "half")
    limits = ("--limit", "acceleration=5", "--limit", "jerk=50")
    code, out, _ = optiplan("robots", "init", urdf, "--out", tmp_path / "made", *flags, *limits, "--json")
    assert code == 0
    data = json.loads(out)
    assert data["written"] == [str(tmp_path / "made/robot.yaml"), str(tmp_path / "made/robot.srdf")]
    robot = load_robot(str(tmp_path / "made"))
    assert (robot.name, robot.joint_names, robot.tool_frame) == ("half", ("j2", "j3"), "d")
    assert robot.locked == {"j1": 0.5, "finger": 0.02}
    assert (robot.limits.acceleration.tolist(), robot.limits.jerk.tolist()) == ([5, 5], [50, 50])


def test_a_terminal_is_asked(urdf):
    answers = "j1,j9\nj1,j2\nd\n0.3\n\n\n7\n"  # j9 is not there; the tool, j3 and the finger, two limits
    result = CliRunner().invoke(get_command(app), ["init", str(urdf), "--ask"], input=answers, standalone_mode=False)
    assert result.exception is None, result.output
    assert "unknown joints to plan 'j9'; choose from: finger, j1, j2, j3" in result.output
    robot = load_robot(str(urdf.parent))
    assert (robot.joint_names, robot.tool_frame) == (("j1", "j2"), "d")
    assert robot.locked == {"j3": 0.3, "finger": 0}
    assert robot.limits.acceleration.tolist() == [10, 10]
    assert robot.limits.jerk.tolist() == [7, 7]


def test_limits_that_differ_by_joint_are_kept_by_a_plain_enter(urdf):
    limit = '<limit lower="-1" upper="2" velocity="3" effort="4" acceleration="{}" jerk="{}"/>'
    parts = chain(*(joint(f"j{k}", *ends, inside=limit.format(k, 10 * k)) for k, ends in ((1, "ab"), (2, "bc"))))
    urdf.write_text(f'<robot name="arm" version="1.2">{"".join(parts)}</robot>')
    command, answers = ["init", str(urdf), "--ask"], "j1,j2\nc\n\nx\n7\n"  # all own accelerations, a jerk for all
    result = CliRunner().invoke(get_command(app), command, input=answers, standalone_mode=False)
    assert result.exception is None, result.output
    assert "acceleration limit of all joints, rad/s² [each its own, 1 to 2]" in result.output
    assert "jerk: found 'x'; expected a number" in result.output
    limits = load_robot(str(urdf.parent)).limits
    assert (limits.acceleration.tolist(), limits.jerk.tolist()) == ([1, 2], [7, 7])


def test_the_srdf_has_the_names_of_the_urdf_and_the_words_of_an_srdf(optiplan, urdf):
    text = urdf.read_text().replace('link name="c"', 'link name="j2"').replace('link="c"', 'link="j2"')
    urdf.write_text(text)
    assert optiplan("robots", "init", urdf, "--no-ask", "--group", "j1,j2")[0] == 0
    pairs = ElementTree.parse(urdf.parent / "robot.srdf").getroot().findall("disable_collisions")
    assert {name for pair in pairs for name in (pair.get("link1"), pair.get("link2"))} >= {"d", "j2"}
    assert "j2_link" in dict.fromkeys(name for pair in load_robot(str(urdf.parent)).allowed for name in pair)
    assert {pair.get("reason") for pair in pairs} <= {"Adjacent", "Never", "User"}
    assert "j2_link" not in (urdf.parent / "robot.srdf").read_text()


def test_what_is_there_is_kept_unless_forced(optiplan, urdf):
    (urdf.parent / "robot.yaml").write_text("mine")
    code, out, err = optiplan("robots", "init", urdf)
    assert (code, out) == (2, "")
    assert "robot.yaml: robots init: a file that is there already; expected --force to replace it" in err
    assert (urdf.parent / "robot.yaml").read_text() == "mine"
    assert not (urdf.parent / "robot.srdf").exists()
    assert optiplan("robots", "init", urdf, "--force")[0] == 0
    assert load_robot(str(urdf.parent)).n == 3


@pytest.mark.parametrize(
    ("flags", "words"),
    [
        (("--group", "j1,j9"), "group[1]: unknown joint 'j9'; expected one of: j1, j2, j3, finger"),
        (("--tool", "nose"), "tool_frame: unknown frame 'nose'; expected one of"),
        (("--lock", "j1"), "--lock: found 'j1'; expected a name and a number, such as finger=0.02"),
        (("--lock", "j9=1"), "locked.j9: unknown joint 'j9'"),
        (("--limit", "speed=1"), "unknown limit 'speed'; choose from: acceleration, jerk, torque, velocity"),
        (("--limit", "jerk=-1"), "limit jerk: found -1; expected a number > 0, in rad/s³"),
    ],
)
def test_what_is_wrong_is_said_and_nothing_written(optiplan, urdf, flags, words):
    code, out, err = optiplan("robots", "init", urdf, *flags)
    assert (code, out) == (2, "")
    assert words in err
    assert "/tmp" not in err.replace(str(urdf.parent), "")
    assert [path.name for path in urdf.parent.iterdir()] == ["arm.urdf"]


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.xacro", "arm.urdf"])
def test_xacro_is_named_with_the_command_that_expands_it(optiplan, tmp_path, name):
    macros = '<robot name="x" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="a" value="1"/></robot>'
    (tmp_path / name).write_text(macros)
    (tmp_path / "robot.yaml").write_text(f"version: 1\nname: x\nurdf: {name}\n")
    code, out, err = optiplan("robots", "show", tmp_path / "robot.yaml")
    assert (code, out) == (2, "")
    assert f"{tmp_path / name}: urdf: this is xacro; expected a URDF; `optiplan robots init {name}` expands it" in err


def test_xacro_without_its_package_names_it(optiplan, tmp_path, monkeypatch):
    monkeypatch.setattr("optiplan.importers.robots.xacro_files.find_spec", lambda name: None)
    (tmp_path / "arm.xacro").write_text('<robot name="x"/>')
    code, out, err = optiplan("robots", "init", tmp_path / "arm.xacro")
    assert (code, out) == (2, "")
    assert "pip install 'optiplan[xacro]'" in err


def test_a_urdf_that_only_declares_the_namespace_is_a_urdf(optiplan, urdf, monkeypatch):
    monkeypatch.setattr("optiplan.importers.robots.describe._expanded", lambda path: pytest.fail("taken for xacro"))
    head = '<!-- made of <xacro:arm/> --><robot xmlns:xacro="http://www.ros.org/wiki/xacro" '
    urdf.write_text(urdf.read_text().replace("<robot ", head))
    assert optiplan("robots", "init", urdf)[0] == 0


SHORT = '<limit lower="-0.2" upper="0.3" velocity="3" effort="4"/>'
OVERLAP = chain(joint("j1", "a", "b"), joint("j2", "b", "c", inside=SHORT), joint("j3", "c", "d", x=-0.45))
"""Link d stands in link b wherever j2 is near 0: they touch in more than a fifth of the configurations."""


def test_pairs_that_touch_often_come_first_with_what_allows_them(optiplan, tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(OVERLAP)}</robot>')
    code, out, err = optiplan("robots", "init", path)
    assert code == 0
    lines = out.splitlines()
    assert "touch in more than 20% of configurations" in lines[1]
    assert "b – d" in lines[2]
    assert "--allow-pairs touching" in lines[3]
    assert "allowed_collisions" not in (tmp_path / "robot.yaml").read_text()
    code, out, err = optiplan("robots", "init", path, "--force", "--allow-pairs", "touching")
    assert code == 0
    assert "touch in more than" not in out
    assert "reading meshes and pairs of links" in err  # in a pipe, too
    robot = load_robot(str(tmp_path))
    assert robot.allowed["b", "d"] == "robot file"


def test_named_pairs_are_allowed_and_others_refused(optiplan, urdf):
    assert optiplan("robots", "init", urdf, "--allow-pairs", "a:c, d:a")[0] == 0
    robot = load_robot(str(urdf.parent))
    assert "allowed_collisions: [[a, c], [a, d]]" in (urdf.parent / "robot.yaml").read_text()
    assert robot.allowed["a", "d"] == "robot file"
    code, _, err = optiplan("robots", "init", urdf, "--force", "--allow-pairs", "a-c")
    assert code == 2
    assert "found 'a-c'" in err
    assert "link_4:link_6" in err
    code, _, err = optiplan("robots", "init", urdf, "--force", "--allow-pairs", "a:z")
    assert code == 2
    assert "unknown link 'z'" in err


def test_a_page_is_printed_of_a_large_robot_and_all_of_it_with_full(optiplan, tmp_path):
    names = [f"l{k}" for k in range(17)]
    parts = [LINK.format(name) for name in names]
    parts += [joint(f"j{k}", one, other) for k, (one, other) in enumerate(pairwise(names))]
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    out = optiplan("robots", "init", path)[1]
    assert len(out.splitlines()) <= 60
    assert "more pairs (--full)" in out
    everything = optiplan("robots", "init", path, "--force", "--full")[1]
    assert "more pairs" not in everything
    assert len(everything.splitlines()) > 100
