"""What README.md shows works as it is printed there; it and the first pages of the documentation are short."""

from __future__ import annotations

import contextlib
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from browser import Browser, find_browser
from carom.cli import main
from docs_pages import DOCS, ROOT
from prose import LINE, first_screen, long_lines, long_sentences, sentences, words

README = (ROOT / "README.md").read_text(encoding="utf-8")
MOST_LINES = 120
CODE_LINES = 10

#: What the program of the README leaves in `result` and `table`: the shot is the one that its comments promise.
SHOT = """
[pot] = table.pocketed(result)
assert (pot.ball, pot.pocket) == ("1", "foot left"), pot
assert result.outcome.ok, result.outcome
along = (result["cue"].position - result["cue"].position[0])[:, :2].sum(axis=1)
assert along.max() > 0.5, "the cue ball ran to the ball"
assert along[-1] < along.max() - 0.3, "the cue ball came back"
print(result.time[-1])
"""


def program() -> str:
    [found] = re.findall(r"```python\n(.*?)```", README, re.S)
    return found.replace(", open_browser=True", "")


def test_the_ten_lines_of_python(tmp_path: Path) -> None:
    """A draw shot: the object ball drops, and the cue ball comes back."""
    assert len([line for line in program().splitlines() if line.strip()]) <= CODE_LINES
    done = subprocess.run(
        [sys.executable, "-W", "error::UserWarning", "-c", program() + SHOT],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    if find_browser() is not None:
        with Browser(size=(640, 480)) as browser:
            browser.open(tmp_path / "shot.html")
            shown = browser.evaluate("carom.state()")
        assert not [said for said in browser.console if said.startswith("error")]
        assert shown["end"] == pytest.approx(float(done.stdout.split()[-1]))


def commands(text: str) -> list[str]:
    """The indented commands of a page, without what is said of them."""
    return [
        found.strip() for found in re.findall(r"^    ((?:make|carom|\.venv/bin/\w+) [^#\n]+)", text, re.M)
    ]


def call(command: str, folder: Path) -> None:
    """Run a `carom` command in this process, but open no browser."""
    arguments = [argument for argument in shlex.split(command)[1:] if argument != "--open"]
    with contextlib.chdir(folder), pytest.raises(SystemExit) as left:
        main(arguments)
    assert not left.value.code, command


def test_the_commands(tmp_path: Path) -> None:
    """`make demo`, whose parts tests/test_cli.py runs; the program above, by the environment that it makes; the help."""
    first, second, *others = commands(README)
    assert [first, second] == ["make demo", ".venv/bin/python shot.py"]
    assert "`shot.py`" in README
    assert others
    for command in others:
        assert command.startswith(".venv/bin/carom ")
        call(command, tmp_path)


def test_targets_that_are_named_are_targets() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text("utf-8"), re.M))
    for page in (README, (DOCS / "install.md").read_text("utf-8")):
        named = re.findall(r"(?:^    |`)make ([a-z-]+)", page, re.M)
        assert set(named) <= targets
        assert "demo" in named


def test_the_walk_through_the_command_line(tmp_path: Path) -> None:
    """docs/reference/cli.md, which the README names: from a scenario to figures."""
    pytest.importorskip("matplotlib", reason="carom plot needs matplotlib")
    page = (DOCS / "reference" / "cli.md").read_text("utf-8")
    walk = commands(page.partition("## From a scenario to figures")[2].partition("\n## ")[0])
    assert len(walk) >= 11
    for command in walk:
        call(command, tmp_path)
    made = {path.name for path in (tmp_path / "runs" / "three_balls-1").iterdir()}
    assert {"run.json", "scenario.toml", "results.h5", "view.html", "plots"} <= made


# --- length -----------------------------------------------------------------------------------------------------------


def test_the_readme_is_short() -> None:
    assert len(README.splitlines()) <= MOST_LINES
    assert [line for line in README.splitlines() if len(line) > LINE] == []  # rows of tables and code, too
    assert long_sentences(README) == []


@pytest.mark.parametrize("name", ["index", "tutorial", "install"])
def test_the_first_screen_of_a_page_is_short(name: str) -> None:
    screen = first_screen((DOCS / f"{name}.md").read_text("utf-8"))
    assert len(sentences(screen)) >= 5
    assert long_lines(screen) == []
    assert long_sentences(screen) == []


def test_the_scanner_sees_what_is_too_long() -> None:
    many = "word " * 26
    page = f"---\nx: y\n---\n# A\n\nShort. [{many}](to.md).\n\n    {many * 9}\n\n| {many} | b |\n\n```python\n{many}\n```\n"
    assert [words(s) for s in long_sentences(page)] == [26, 26]
    assert len(long_lines("x" * 101 + "\n" + "x" * 100 + "\n    " + "x" * 101)) == 1
    assert long_sentences("One two. " * 40) == []


def test_every_link_of_the_readme_leads_somewhere() -> None:
    """Relative links and pictures; tests/test_architecture.py looks at paths between back quotes."""
    links = re.findall(r"\]\(([^)#\s]+)\)", README) + re.findall(r"^\[[^\]]+\]: (\S+)$", README, re.M)
    assert len(links) > 8
    for link in links:
        assert link.startswith("https://") or (ROOT / link).exists(), link


def test_every_measured_figure_of_the_table_stands_on_the_page_that_it_names() -> None:
    targets = dict(re.findall(r"^\[([^\]]+)\]: (\S+)$", README, re.M))
    table = README.partition("| task | measured | details |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| (.+) \| (.+) \| \[(.+)\] \|$", table, re.M)
    assert len(rows) >= 6
    for task, measured, page in rows:
        text = (ROOT / targets[page]).read_text("utf-8")
        figures = re.findall(r"\d+(?:\.\d+)?(?:\^\d+)?(?:e-?\d+)?", measured)
        assert figures, task
        for figure in figures:
            assert re.search(rf"(?<![\d.]){re.escape(figure)}(?!\d)", text), (task, figure, page)


def test_the_times_of_lammps_stand_on_the_page_of_large_piles() -> None:
    table = README.partition("LAMMPS, a twentieth |\n")[2].partition("\n\n")[0]
    page = (DOCS / "validation" / "scale.md").read_text("utf-8").partition("\n## ")[0]
    rows = re.findall(r"^\| .+?, [\d.]+ s \| (.+) \|$", table, re.M)
    assert len(rows) == 3
    for row in rows:
        for seconds in re.findall(r"[\d.]+ s", row):
            assert re.search(rf"(?<![\d.]){re.escape(seconds)}", page), (row, seconds)
