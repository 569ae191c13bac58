"""The pages of the billiards kit: their code runs in the quick tests, their tables are those of the code."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import carom
import nine_ball_break
import pytest
from carom import billiards
from docs_pages import DOCS, KIT, blocks, run
from prose import long_lines, long_sentences

BILLIARDS = DOCS / "reference" / "billiards.md"


def test_every_page_of_the_billiards_kit_runs_in_the_quick_tier() -> None:
    names = {"aimed_break", "billiards", "breaks", "cushions", "draw", "frozen", "materials"}
    assert {page.stem for page in KIT} == names
    said = [
        page
        for page in DOCS.rglob("*.md")
        if re.search(r"import billiards|carom\.billiards import", page.read_text())
    ]
    assert sorted(said) == KIT  # a page with code of the kit is a notebook, so its code runs


def test_the_first_example_of_the_kit_pockets_balls_without_a_warning(tmp_path: Path) -> None:
    """It once warned of its step and printed an empty list, where the page showed two balls."""
    first = blocks(BILLIARDS, "{code-cell} python")[0]
    said = run(f"import warnings; warnings.simplefilter('error')\n{first}", tmp_path)
    assert re.search(r"^cue hits 1 first\. Gone: \d \((?:head|foot|side) ", said)


def test_the_speeds_of_the_guide_are_those_of_a_pool_ball() -> None:
    guide = (DOCS / "guides" / "choose.md").read_text("utf-8")
    told = re.findall(r"`([\d.]+) r`[^`]*? at ([\d.]+) m/s", guide.partition("For pool 0.1 ms is")[2])[:2]
    exact = [(share, float(share) * billiards.TABLES["9ft"].ball_radius / 1e-4) for share in ("0.02", "0.05")]
    assert [(share, float(speed)) for share, speed in told] == [
        (share, pytest.approx(speed, rel=0.03)) for share, speed in exact
    ]


def test_the_page_of_the_kit_is_plain_english() -> None:
    text = BILLIARDS.read_text("utf-8")
    assert long_lines(text) == []
    assert long_sentences(text) == []


def test_the_tables_of_the_kit_are_those_of_its_page() -> None:
    """Numbers that the page prints stand in `LAWS` and `TABLES` too."""
    text = BILLIARDS.read_text("utf-8")
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:1] == "|"
    ]
    laws = {row[1].strip("`"): row for row in rows if row[1].strip("`") in vars(billiards.LAWS)}
    assert set(laws) == set(vars(billiards.LAWS))
    for name, law in vars(billiards.LAWS).items():
        if isinstance(law, billiards.Value):
            assert laws[name][2] == f"{law.value:g}" + ("" if law.unit == "1" else f" {law.unit}"), name
            assert laws[name][3] == ("" if law.low is None else f"{law.low:g} to {law.high:g}"), name
        else:
            assert laws[name][2] == f"`{law}`"
    tables = {row[0].strip("`"): row for row in rows if row[0].strip("`") in billiards.TABLES}
    assert set(tables) == set(billiards.TABLES)
    for name, spec in billiards.TABLES.items():
        assert tables[name][1] == f"{spec.length:.3f} x {spec.width:.3f}"
        assert tables[name][2] == f"{1000 * spec.ball_radius:g}, {1000 * spec.ball_mass:.0f}"
        assert float(tables[name][3]) == pytest.approx(1000 * spec.nose_height, abs=0.05)


def test_the_law_that_the_materials_page_quotes_is_that_of_the_kit() -> None:
    [quoted] = tomllib.loads(blocks(DOCS / "guides" / "materials.md", "toml")[0])["contact"]
    assert quoted["friction"] == {"expression": billiards.LAWS.ball_friction}
    assert quoted["restitution"] == billiards.LAWS.ball_restitution


def test_the_shipped_break_is_that_of_the_kit() -> None:
    """After a change of the kit: `python tools/nine_ball_break.py`. Sines may differ in the last digit on other machines."""
    kept, made = (
        tomllib.loads(text) for text in (nine_ball_break.FILE.read_text("utf-8"), nine_ball_break.text())
    )
    assert same(kept, made)
    assert nine_ball_break.FILE.read_text("utf-8").startswith(nine_ball_break.HEAD)


def same(a: Any, b: Any) -> bool:
    """Whether two trees of TOML are equal, numbers to 12 digits."""
    if isinstance(a, dict):
        return list(a) == list(b) and all(same(a[key], b[key]) for key in a)
    if isinstance(a, list):
        return len(a) == len(b) and all(map(same, a, b))
    return bool(a == pytest.approx(b, rel=1e-12, abs=1e-15)) if isinstance(a, float) else bool(a == b)


def test_the_shipped_break_pockets_a_ball() -> None:
    scene = carom.example("nine_ball_break")
    result = carom.simulate(scene, until=0.7)
    [first] = billiards.table("9ft").pocketed(result)
    assert (first.ball, first.pocket) == ("6", "foot left")
