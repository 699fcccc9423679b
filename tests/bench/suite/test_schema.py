import pytest

from optiplan.bench.suite.schema import expand_environment, read_suite
from optiplan.errors import InputError

HEAD = "version: 1\nname: mine\n"
REST = "planners: [quintic]\nbudget: 1\n"


@pytest.fixture
def issues(tmp_path):
    def issues(text):
        path = tmp_path / "suite.yaml"
        path.write_text(text)
        with pytest.raises(InputError) as caught:
            read_suite(path)
        return [(issue.line, issue.field, issue.found, issue.expected) for issue in caught.value.issues]

    return issues


def test_what_is_not_given_has_defaults(tmp_path):
    path = tmp_path / "suite.yaml"
    path.write_text(HEAD + "problems: [{glob: '*.yaml'}]\n" + REST)
    spec, _ = read_suite(path)
    assert (spec.seeds, spec.repetitions, spec.wall, spec.limits.memory) == ((0,), 1, 61.0, 4000.0)
    assert (spec.planners[0].shown, spec.planners[0].options) == ("quintic", {})
    assert (spec.problems[0].kind, spec.problems[0].every, spec.problems[0].first) == ("glob", 1, None)


@pytest.mark.parametrize(
    ("source", "found", "expected"),
    [
        ("{glob: a, mbm: b}", "a mapping with the keys glob, mbm", "exactly one of: glob, mbm, robometrics, generate"),
        ("{set: a}", "a mapping with the key", "exactly one of: glob, mbm, robometrics, generate"),
        (
            "{glob: a, count: 3}",
            "'count' beside 'glob'",
            "difficulty, every, first, limits, objective, set",
        ),
        ("{glob: a, frist: 3}", "unknown key 'frist'", "did you mean 'first'?"),
        ("{glob: a, first: 0}", "0", "a number ≥ 1"),
        ("{glob: a, every: 1.5}", "1.5", "a whole number"),
    ],
)
def test_sources_take_what_they_take(issues, source, found, expected):
    ((line, field, what, valid),) = issues(f"{HEAD}problems:\n  - {source}\n{REST}")
    assert line == 4
    assert field.startswith("problems[0]")
    assert found in what
    assert expected in valid


@pytest.mark.parametrize(
    ("text", "line", "field", "found"),
    [
        (
            "planners: [quintic, {name: quintic, goals: 2}]\nbudget: 1\n",
            4,
            "planners",
            "the planner 'quintic' (give one",
        ),
        (REST + "seeds: [1, 2, 1]\n", 6, "seeds", "the seed 1 twice"),
        (REST + "seeds: [-1]\n", 6, "seeds[0]", "-1"),
        (REST + "limits: {wall: 0}\n", 6, "limits.wall", "0"),
        (REST + "limits: {memory: 10}\n", 6, "limits.memory", "10"),
        (REST + "repetitions: 0\n", 6, "repetitions", "0"),
        ("planners: []\nbudget: 1\n", 4, "planners", "0"),
        ("planners: [quintic]\n", None, "budget", "nothing"),
    ],
)
def test_mistakes_are_told_with_their_line(issues, text, line, field, found):
    ((where, name, what, _),) = issues(f"{HEAD}problems: [{{glob: a}}]\n{text}")
    assert name == field
    assert found in what
    assert line is None or where == line


def test_a_name_is_one_that_a_folder_can_have(issues):
    ((line, field, _, _),) = issues(f"version: 1\nname: ../up\nproblems: [{{glob: a}}]\n{REST}")
    assert (line, field) == (2, "name")


def test_variables(monkeypatch):
    monkeypatch.setenv("HERE", "/somewhere")
    monkeypatch.delenv("THERE", raising=False)
    assert expand_environment("${HERE}/a") == "/somewhere/a"
    assert expand_environment("${THERE:-../b}/${HERE:-c}") == "../b//somewhere"
    with pytest.raises(KeyError, match="THERE"):
        expand_environment("${THERE}/a")
