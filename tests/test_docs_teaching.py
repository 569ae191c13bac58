"""The lessons of docs/teaching: a plan of 45 minutes, exercises with hidden solutions, an index that is right about them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from docs_pages import DOCS

FOLDER = DOCS / "teaching"
LESSONS = sorted(set(FOLDER.glob("*.md")) - {FOLDER / "index.md"})
CELL = re.compile(r"^```\{code-cell\} python\n((?::[^\n]*\n)*)(.*?)^```", re.S | re.M)


def test_there_are_three_lessons() -> None:
    assert len(LESSONS) == 3


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_a_lesson_has_a_plan_of_45_minutes(lesson: Path) -> None:
    """The parts of the plan follow one another from 0 to 45."""
    text = lesson.read_text("utf-8")
    times = [(int(a), int(b)) for a, b in re.findall(r"^\| (\d+) to (\d+) \|", text, re.M)]
    assert times[0][0] == 0
    assert times[-1][1] == 45
    assert [begin for begin, _ in times[1:]] == [end for _, end in times[:-1]]
    assert "**Students learn**" in text
    assert f"{{nb-download}}`{lesson.stem}.ipynb`" in text


@pytest.mark.parametrize("lesson", LESSONS, ids=lambda lesson: lesson.stem)
def test_each_exercise_has_one_hidden_solution_that_computes(lesson: Path) -> None:
    text = lesson.read_text("utf-8")
    before, _, exercises = text.partition("\n## Exercises\n")
    numbers = [int(number) for number in re.findall(r"^\*\*(\d+)\.\*\*", exercises, re.M)]
    assert 4 <= len(numbers) <= 6
    assert numbers == list(range(1, len(numbers) + 1))
    assert "hide-cell" not in before
    cells = CELL.findall(exercises)
    assert [re.findall(r'show: "Solution (\d+)"', options) for options, _ in cells] == [
        [str(n)] for n in numbers
    ]
    for options, code in cells:
        assert ":tags: [hide-cell]" in options
        assert code.startswith("# "), "a solution begins with the reasoning"
        assert "print(" in code


def test_the_index_lists_the_lessons_with_the_number_of_their_exercises() -> None:
    index = (FOLDER / "index.md").read_text("utf-8")
    rows = re.findall(r"^\| \[\d\. [^\]]*\]\((\w+)\.md\) \|.*\| (\d) \|$", index, re.M)
    counted = {p.stem: len(re.findall(r"^\*\*\d+\.\*\*", p.read_text("utf-8"), re.M)) for p in LESSONS}
    assert {name: int(number) for name, number in rows} == counted
