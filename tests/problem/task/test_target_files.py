"""Targets in a CSV file: what is read, and where a wrong cell is."""

import pytest

from optiplan.errors import InputError
from optiplan.problem.task.target_files import read_targets

GOOD = """name,x,y,z,nx,ny,nz,after,cluster,from,to
a,0.45,0.25,0.3,0,0,-1,,left,,
b,0.45,-0.25,0.3,0,0,-1,a; c 1,,1,9

c 1,0.5,0,0.3,,,,,,,
"""


def test_rows_are_targets(tmp_path):
    (tmp_path / "t.csv").write_text(GOOD)
    rows = read_targets(tmp_path / "t.csv")
    assert [one.line for one in rows] == [2, 3, 5]
    a, b, c = (one.row for one in rows)
    assert (a.name, a.position, a.axis, a.cluster, a.window) == ("a", (0.45, 0.25, 0.3), (0, 0, -1), "left", None)
    assert (b.after, b.window, b.cluster) == (("a", "c 1"), (1.0, 9.0), None)
    assert c.axis is None


@pytest.mark.parametrize(
    ("text", "line", "found"),
    [
        ("x,y\n1,2\n", 1, "no column z"),
        ("x,y,z,nx\n1,2,3,4\n", 1, "no column ny, nz"),
        ("x,y,z,colour\n1,2,3,red\n", 1, "'colour'"),
        ("x,y,z,x\n1,2,3,4\n", 1, "'x'"),
        ("x,y,z\n", None, "0 rows"),
        ("x,y,z\n\n,,\n", None, "0 rows"),
        ("x,y,z\n1,2,3\n1,2\n", 3, "2 cells"),
        ("x,y,z\n1,two,3\n", 2, "'1', 'two', '3'"),
        ("x,y,z,nx,ny,nz\n1,2,3,1,1,1\n", 2, ""),
        ('x,y,z,name\n1,2,3,"a\n1,2,4,b\n', 2, "a quote that is not closed"),
        ('x,y,z,name\n1,2,3,"a"b\n', 2, "a quote within a cell"),
        ('x,y,z,name\n1,2,"3\n",a\n1,2,x,c\n', 4, "'1', '2', 'x'"),
        ("x,y,z\n1,nan,3\n", 2, "'1', 'nan', '3'"),
        ("x,y,z\n1,2,3\n1,inf,3\n", 3, "'1', 'inf', '3'"),
        ("x,y,z,nx,ny,nz,qx,qy,qz,qw\n1,2,3,0,0,1,0,0,0,1\n", 2, "both an axis and a rotation"),
    ],
)
def test_wrong_files_are_told_by_line(tmp_path, text, line, found):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InputError) as error:
        read_targets(tmp_path / "t.csv")
    issue = error.value.issues[0]
    assert issue.file.endswith("t.csv")
    assert issue.line == line
    assert found in issue.found
    assert "Input should" not in str(issue)


def test_no_file_is_told(tmp_path):
    with pytest.raises(InputError, match="CSV file of targets"):
        read_targets(tmp_path / "none.csv")
