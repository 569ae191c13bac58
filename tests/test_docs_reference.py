"""Pages of the reference run as a reader runs them: their blocks in files, with the numbers that the pages state."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from docs_pages import DOCS, blocks, interpret

REFERENCE = DOCS / "reference"
NUMBER = r"-?\d+(?:\.\d+)?"


def python(folder: Path, name: str, text: str) -> str:
    """Write a file and run it there; what it prints. Run from a file, as workers of a study read it again."""
    (folder / name).write_text(text, "utf-8")
    return interpret([name], folder)


def stated(page: Path, pattern: str) -> tuple[float, float]:
    """The range that a page states, where `pattern` has it as RANGE."""
    found = re.search(pattern.replace("RANGE", f"({NUMBER}) to ({NUMBER})"), page.read_text("utf-8"))
    assert found, pattern
    return float(found[1]), float(found[2])


#: What docs/reference/granular.md prints of its runs, and where it says what to expect.
PRINTED = {
    rf"the tube carries ({NUMBER}) %": r"the tube carries RANGE %",
    rf"the grains bear ({NUMBER}) N": r'"the grains bear".*# RANGE\n',
    rf"the lid sank by ({NUMBER}) mm": r'"the lid sank by".*# RANGE\n',
    rf"its speed is ({NUMBER}) mm/s": r'"its speed is".*# RANGE:',
    rf"friction ({NUMBER}) at": r"effective friction of the flow: RANGE\n",
    rf"inertial number ({NUMBER})": r"rate d sqrt\(density/p\): RANGE\n",
}


def test_a_packing_from_start_to_end(tmp_path: Path) -> None:
    """docs/reference/granular.md: `packing.py` as the page says gives its numbers; then `friction.py`."""
    page = REFERENCE / "granular.md"
    measures, *packing, study = blocks(page, "python")
    python(tmp_path, "measures.py", measures)
    assert "carom.sweep(" in study
    assert "carom.sweep(" not in "".join(packing)
    printed = python(tmp_path, "packing.py", "\n".join(packing))
    for shown, said in PRINTED.items():
        found = re.search(shown, printed)
        assert found, (shown, printed)
        low, high = stated(page, said)
        assert low <= float(found[1]) <= high, (shown, found[1])
    pytest.importorskip("dask", reason="the study has two workers")
    # Two cases of a tenth of the time: as printed, the study takes 20 s.
    fewer = study.replace("[0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8]", "[0.0, 0.4]")
    scenario = tmp_path / "packing.toml"
    text = scenario.read_text("utf-8")
    assert "until = 0.5\n" in text
    scenario.write_text(text.replace("until = 0.5\n", "until = 0.05\n"), "utf-8")
    assert "[0.  0.4] [0." in python(tmp_path, "friction.py", fewer)


def test_stepping(tmp_path: Path) -> None:
    """docs/reference/stepping.md: its blocks in one file, to the last comment."""
    pytest.importorskip("matplotlib", reason="the first block draws a figure")
    page = "\n".join(blocks(REFERENCE / "stepping.md", "python"))
    printed = python(tmp_path, "stepping.py", page + "\nprint(sim.time, sim.position[:, 0])\n")
    first, _, last = printed.splitlines()
    assert float(first) == pytest.approx(0.02)
    assert float(last.split()[0]) == pytest.approx(2.0, abs=0.02)


def test_studies(tmp_path: Path) -> None:
    """docs/reference/sweeps.md: the file and the script, with 8 cases each; one does not take the other's folder."""
    for name in ("pyarrow", "scipy", "dask", "matplotlib"):
        pytest.importorskip(name, reason="studies and their figures")
    page = REFERENCE / "sweeps.md"
    [study] = blocks(page, "toml")
    [script] = blocks(page, "python")
    assert "count = 1000\n" in study
    (tmp_path / "breaks.toml").write_text(study.replace("count = 1000\n", "count = 8\n"), "utf-8")
    call = "carom sweep breaks.toml -o breaks --workers 2"
    assert f"    {call}\n" in page.read_text("utf-8")
    arguments = call.replace("--workers 2", "--workers 0").split()[1:]  # those of the script are two
    shown = python(tmp_path, "call.py", f"from carom.cli.app import app\napp({arguments!r})\n")
    assert "8 cases done, 0 failed" in shown
    for old, new in (("count=100", "count=8"), ("scene(17)", "scene(7)")):
        assert old in script
        script = script.replace(old, new)
    spread, failures = python(tmp_path, "spreads.py", script).rsplit(" ", 1)
    assert failures == "[]\n"
    assert "nan" not in spread
    assert (tmp_path / "table.csv").read_text("utf-8").startswith("v,mu,spread\n")
    assert (tmp_path / "spreads" / "plots" / "histograms.png").exists()
