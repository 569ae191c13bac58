"""The linter of prose sees what is wrong with a page, where, and says the cure; the pages pass it."""

from __future__ import annotations

from pathlib import Path

import prose
import pytest

PAGE = """# A page

Short. `a code span. with stops` counts as one word here.
A little
island is solved from nothing; Whoever likes `whoever`
reads on.

| {many} | short |

```text
{many}{many}
```

    {many}
- An item that is long: {many}
  and goes on here.
"""


def test_what_is_wrong_is_named_with_place_and_cure() -> None:
    of_sentences, of_lines, of_words = prose.complaints(PAGE.format(many="word " * 26))
    assert [said.partition(":")[0] for said in of_sentences] == ["8", "15"]
    assert "26 words in a sentence, at most 25; split it: word word" in of_sentences[0]
    assert of_lines == ["15: 154 characters, wrap at 100"]
    assert [said.partition(":")[0] for said in of_words] == ["4", "5", "5"]
    assert of_words[0] == "4: 'little island': say cluster"


def test_code_is_one_word_and_ends_no_sentence() -> None:
    page = f"Where {'`x + y. z` ' * 23}is 0.\n"
    assert [prose.words(said) for said in prose.sentences(page)] == [26]
    assert prose.sentences("One. Two (`a. b`). Three!\n") == ["One.", "Two (`a__b`).", "Three!"]


def test_no_page_gets_worse(capsys: pytest.CaptureFixture[str]) -> None:
    assert prose.main([]) == 0, capsys.readouterr().out


def test_a_page_may_not_exceed_its_exception(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    listed = tmp_path / "prose.toml"
    listed.write_text('# Head.\n[pages]\n"page.md" = [2, 0, 1]\n')
    page = tmp_path / "page.md"
    page.write_text("It is solved from nothing.\n")
    monkeypatch.setattr(prose, "ROOT", tmp_path)
    monkeypatch.setattr(prose, "EXCEPTIONS", listed)
    monkeypatch.setattr(prose, "pages", lambda: [page])
    assert prose.main([]) == 0
    assert prose.main(["shrink"]) == 0
    assert listed.read_text() == '# Head.\n[pages]\n"page.md" = [0, 0, 1]\n'
    page.write_text("It is solved from nothing, and from nothing again.\n")
    assert prose.main([]) == 1
    assert "page.md:1: 'from nothing': say from zero, a cold start" in capsys.readouterr().out
    assert prose.main(["shrink"]) == 0
    assert prose.allowed() == {"page.md": [0, 0, 1]}  # never raised
