"""The prose of the repository is held by `docs/prose.py`, in `make lint`; here is what it finds and what it ignores."""

import importlib.util
from pathlib import Path

ROOT = Path(__file__).parent.parent
_SPEC = importlib.util.spec_from_file_location("optiplan_prose", ROOT / "docs" / "prose.py")
assert _SPEC is not None
assert _SPEC.loader is not None
prose = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(prose)

PAGE = """# A heading that nobody measures

One short sentence. Then `a b c d` is one word!

| a table | whose cells | are looked at | by nobody |

- The first item
  goes on here.
- The second item is another sentence.

```sh
optiplan plan whatever is told here
```

    python benchmarks/any.py is told, too
"""


def test_sentences_of_a_page():
    found = list(prose.sentences(PAGE))
    assert [sentence.words for sentence in found] == [3, 5, 6, 6]
    assert found[2].text == "- The first item goes on here."


def test_sentences_of_a_docstring(tmp_path):
    file = tmp_path / "module.py"
    file.write_text(
        '"""Return the answer.\n\nArgs:\n    q: The configuration of the arm, (n,).\n"""\nx = "What is told."\n'
    )
    (only,) = prose.prose(file)
    assert [sentence.words for sentence in prose.sentences(only.text)] == [3, 6]  # `(n,)` has one


def test_long_sentences_and_avoided_words_are_faults(tmp_path):
    page = tmp_path / "page.md"
    longest = prose.ALLOWED[".md"].words
    page.write_text(f"A short one.\n\n{'word ' * longest}end.\n\nThe answer is Told to all.\n")
    found = list(prose.faults(page))
    assert [(fault.line, fault.is_word) for fault in found] == [(3, False), (5, True)]
    assert f"page.md:3: {longest + 1} words, at most {longest}" in str(found[0])
    assert "'Told' → reported" in str(found[1])


def test_exit_code(tmp_path, capsys):
    page = tmp_path / "page.md"
    page.write_text("A short sentence.\n")
    assert prose.main([str(page)]) == 0
    page.write_text("The answer is told to everybody.\n" * (prose.ALLOWED[".md"].avoided + 1))
    assert prose.main([str(page)]) == 1
    assert "faults of prose" in capsys.readouterr().out
    assert prose.main([str(page), "--totals"]) == 0
    assert "6.0 words a sentence" in capsys.readouterr().out
