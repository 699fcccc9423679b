import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from optiplan.files import write_text
from optiplan.problem.write import problem_text

number = st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(2**60), 2**60)
words = st.text(st.characters(codec="utf-8", exclude_categories=["Cs"]))
value = st.recursive(
    number | st.booleans() | words | st.sampled_from(["on", "No", "null", "1e3", "a: b", "0x1", "~", "x/y.z"]),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
    max_leaves=8,
)


@given(st.dictionaries(st.sampled_from(["name", "start", "seed", "locked"]), value), st.lists(value, max_size=3))
def test_reading_gives_the_same_data_again(data, bodies):
    data = {**data, "via": bodies, "scene": {"obstacles": bodies, "attached": []}}
    again = YAML(typ="safe", pure=True).load(problem_text(data, "two\nlines"))
    assert again == data
    assert repr(again["scene"]) == repr(data["scene"])  # 1 and 1.0, 0.0 and -0.0 are told apart


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "new" / "a.yaml"
    write_text(path, "one")
    with pytest.raises(UnicodeEncodeError):
        write_text(path, "\ud800")
    assert path.read_text() == "one"
    assert list(path.parent.iterdir()) == [path]
