from pathlib import Path

import pytest
from pydantic import Field
from ruamel.yaml import YAML

from optiplan.config.document import Number, Strict, Whole, _lines, _read_any, parse_yaml, read_yaml, validate
from optiplan.config.simple_yaml import libyaml_parser, read_simple
from optiplan.errors import InputError

ROOT = Path(__file__).parents[2]


class Inner(Strict):
    velocity: Number | list[Number]
    jerk: Number | None = None


class Item(Strict):
    size: Number


class Outer(Strict):
    version: Whole
    name: str
    limits: Inner | None = None
    items: list[Item] = Field(default_factory=list)


def write(folder: Path, text: str | bytes) -> Path:
    path = folder / "file.yaml"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def messages(path: Path) -> list[str]:
    with pytest.raises(InputError) as caught:
        validate(Outer, read_yaml(path))
    return [str(issue) for issue in caught.value.issues]


def test_a_good_file_becomes_the_model(tmp_path):
    path = write(tmp_path, "version: 1\nname: a\nlimits:\n  velocity: [1, 2.5e-1]\nitems:\n- size: 3\n")
    model = validate(Outer, read_yaml(path))
    assert model.limits.velocity == [1, 0.25]
    assert model.items[0].size == 3


def test_what_would_break_a_line_or_rule_the_terminal_is_escaped(tmp_path):
    path = write(tmp_path, 'version: "a\\nb"\nname: a\n"k\\e[31m": 1\n')
    found = messages(path)
    assert all(message.isprintable() for message in found), found
    assert any(r"version: 'a\nb'; expected a whole number" in message for message in found)
    assert any(r"k\x1b[31m: unknown key 'k\x1b[31m'" in message for message in found)


def test_lines_of_values_and_of_what_is_not_there(tmp_path):
    document = read_yaml(write(tmp_path, "version: 1\n\nitems:\n  - {size: 1}\n  -\n    size: 2\n"))
    assert [document.line(place) for place in [("version",), ("items", 0, "size"), ("items", 1, "size")]] == [1, 4, 6]
    assert document.line(("items", 1, "colour", "red")) == 6
    assert document.line(("nothing",)) == 1


def test_all_issues_at_once_in_file_order(tmp_path):
    text = "version: true\nnmae: x\nlimits: {velocity: [1, .nan, '3'], jerkk: .inf}\nitems: [{size: 2}, {size: big}]\n"
    found = messages(write(tmp_path, text))
    expected = ["name", "version", "nmae", "limits.velocity[1]", "limits.jerkk", "limits.velocity[2]", "items[1].size"]
    assert sorted(message.split(": ")[1] for message in found) == sorted(expected)
    lines = [int(message.split(":")[1]) for message in found]
    assert lines == sorted(lines)
    text = "\n".join(found)
    assert "unknown key 'nmae'; expected one of: version, name, limits, items (did you mean 'name'?)" in text
    assert "limits.velocity[1]: NaN; expected a finite number" in text
    assert "limits.velocity[2]: '3'; expected a number" in text
    assert "items[1].size: 'big'; expected a number" in text
    assert "version: true; expected a whole number" in text


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", None, "an empty file"),
        ("# only a comment\n", None, "an empty file"),
        ("a: 1\nb: 2\na: 3\n", 3, "duplicate key"),
        ("b:\n  a: 1\n\n  c: 2\n  a: 3\n", 5, "a duplicate key: 'a' is on line 2 too"),
        ("a: " + "9" * 3000, 1, "a value of 3000 characters"),
        ("a: " + "9" * 30_000, 1, "a value of 30000 characters"),
        ("b: 1\na: " + "x" * 5000, 2, "a value of 5000 characters"),
        ("a: " + "[" * 600 + "]" * 600, None, "nested too deeply"),
        ("\n".join(" " * i + "a:" for i in range(1200)), None, "nested too deeply"),
        ("a0: &a0 [1]\n" + "".join(f"a{i + 1}: &a{i + 1} [{f'*a{i}, ' * 10}]\n" for i in range(7)), None, "too large"),
        ("a: [1\nb: 2\n", 2, "','"),
        ("a: 1\n---\nb: 2\n", 2, "document"),
        ("a: &x [*x]\n", 1, "too large"),
        (b"\xff\xfe\x00", None, "not UTF-8"),
        (b"a: \x00", None, "binary"),
        ("\n<!-- my arm -->\n<robot name='arm'>\n\t<link/></robot>", None, "XML"),
        ("a: " + "[" * 400 + "]" * 400, 1, "too large"),
    ],
)
def test_unusable_files(tmp_path, text, line, words):
    with pytest.raises(InputError) as caught:
        read_yaml(write(tmp_path, text))
    (issue,) = caught.value.issues
    assert words in issue.found
    assert line is None or issue.line == line


def test_missing_file_and_folder(tmp_path):
    for path in (tmp_path / "none.yaml", tmp_path):
        with pytest.raises(InputError, match="expected a readable YAML file"):
            read_yaml(path)


def test_a_list_instead_of_keys(tmp_path):
    expected = "expected a mapping of keys to values: version, name, limits, items"
    assert messages(write(tmp_path, "[1, 2]")) == [f"{tmp_path / 'file.yaml'}:1: file: a list of 2 values; {expected}"]
    (found,) = messages(write(tmp_path, "version: 1\nname: x\nitems: [3]"))
    assert found.endswith("items[0]: 3; expected a mapping of keys to values: size")


def test_yaml_1_2_numbers(tmp_path):
    data = read_yaml(write(tmp_path, "a: 1e3\nb: 012\nc: on\n")).data
    assert data == {"a": 1000.0, "b": 12, "c": "on"}


def test_a_file_that_is_too_long_is_not_parsed(tmp_path):
    with pytest.raises(InputError, match="more than 16 MiB"):
        read_yaml(write(tmp_path, "a: 1\n" + "#" * (16 * 2**20)))


@pytest.mark.parametrize("value", ["1.0e+300", "-1.0e+20", "[0, 1.0e+200]", "99999999999999999999999"])
def test_numbers_that_nothing_has_are_refused(tmp_path, value):
    class Any_(Strict):
        a: object

    with pytest.raises(InputError, match=r"a.*expected a number in \[-1.84e\+19, 1.84e\+19\]"):
        validate(Any_, read_yaml(write(tmp_path, f"a: {value}\n")))


SIMPLE = [
    "a: 1\nb: [1, -2.5, +3., 1.0e5, 1.5E-3, 0, -0, -0.0]\nc: {d: true, e: False, f: null, g: ~, h: }\n",
    "- 'one''s'\n- \"3\"\n- three words\n"
    "- 01_reach\n- ./here.yaml\n- ../there\n- /etc/x\n- two\n  lines\n- 1.2.3\n- y\n- No\n",
    "a: |\n  kept\n  lines\nb: >-\n  folded\n  text\n\n# a comment\nc: x # another\n",
    "---\na:\n  b:\n  - c: 1\n    d:\n    - [[2.0, x], {}]\n...\n",
    "é: naïve\n",
    "true\n",
]

NOT_SIMPLE = [
    "a: &x [1]\nb: *x\n",
    "a: &x {c: 1}\nb:\n  <<: *x\n  d: 2\n",
    "a: !!str 1\n",
    "a: !!float 1\n",
    "- .5\n- 1e5\n- .inf\n- .nan\n- 0x1F\n- 0o17\n- 012\n- 1_000\n- 2026-11-23\n- =\n",
    "a: 1\n---\nb: 2\n",
    "1: a\n",
    "a: 1\na: 2\n",
    "a: " + "9" * 41 + "\n",
    "a: " + "x" * 5000 + "\n",
    "%YAML 1.1\n---\na: yes\n",
    'a: "\\x41"\n',
    "[" * 200 + "]" * 200,
    "a: [1\n",
    "? [a]\n: 1\n",
    "",
]


def same(a, b) -> bool:
    """Whether two documents are equal, types and the sign of zero included."""
    if isinstance(a, dict):
        return isinstance(b, dict) and list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list):
        return isinstance(b, list) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and repr(a) == repr(b)


@pytest.mark.parametrize("text", SIMPLE)
def test_simple_documents_are_read_as_the_parser_in_python_does(text):
    assert libyaml_parser(text) is None or read_simple(text) is not None
    document = parse_yaml(text, Path("file.yaml"))
    reader = YAML(typ="safe", pure=True)
    root = reader.compose(text)
    assert same(document.data, reader.constructor.construct_document(root))
    assert document.lines == _lines(root, Path("file.yaml"))


def test_files_of_the_repository_are_read_as_the_parser_in_python_does():
    files = [path for folder in ("problems", "robots") for path in sorted((ROOT / folder).rglob("*.yaml"))]
    assert len(files) > 30
    for path in files:
        text = path.read_text(encoding="utf-8")
        data, lines = read_simple(text) or (None, None)
        assert libyaml_parser(text) is None or data is not None, path
        if data is not None:
            known, places = _read_any(text, path)
            assert same(data, known), path
            assert lines == places, path


@pytest.mark.parametrize("text", NOT_SIMPLE)
def test_what_is_not_simple_is_left_to_the_parser_that_knows_all_of_yaml(text):
    assert read_simple(text) is None
