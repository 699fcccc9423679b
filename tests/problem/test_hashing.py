import shutil

from optiplan.problem.load import load_problem

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


def test_hash_is_of_content_not_of_place(write, arm, tmp_path):
    robot = shutil.copytree(arm.parent, tmp_path / "robot")
    (tmp_path / "a.obj").write_text(MESH)
    path = write("{sphere: 0.1}", "{mesh: {file: a.obj}}")
    path.write_text(path.read_text().replace(str(arm), "robot/robot.yaml"))
    first = load_problem(path).hash
    assert len(first) == 64
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for item in ("robot", "a.obj", "case.yaml"):
        shutil.move(tmp_path / item, elsewhere / item)
    assert load_problem(elsewhere / "case.yaml").hash == first
    (elsewhere / "a.obj").write_text(MESH.replace("v 1 0 0", "v 1.5 0 0"))
    changed_mesh = load_problem(elsewhere / "case.yaml").hash
    urdf = elsewhere / robot.name / "arm.urdf"
    urdf.write_text(urdf.read_text().replace('upper="2.9"', 'upper="2.8"'))
    changed_robot = load_problem(elsewhere / "case.yaml").hash
    assert len({first, changed_mesh, changed_robot}) == 3


def test_comments_and_order_do_not_count(write):
    path = write()
    first = load_problem(path).hash
    lines = path.read_text().splitlines()
    path.write_text("\n".join(["seed: 0  # of everything", *lines[:-1]]) + "\n")
    assert load_problem(path).hash == first
    path.write_text(path.read_text().replace("joints: [1, 0.5]", "joints: [1, 0.5000000001]"))
    assert load_problem(path).hash != first


def test_locked_joints_count(write):
    assert load_problem(write("seed: 0", "locked: {finger: 0.01}")).hash != load_problem(write()).hash
