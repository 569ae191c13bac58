"""What a release consists of fits together: changelog, citation, paper, stability, tiers of tests."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
VERSION = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["package"]["version"]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text("utf-8")
CITATION = (ROOT / "CITATION.cff").read_text("utf-8")
PAPER = (ROOT / "paper" / "paper.md").read_text("utf-8")
BIB = (ROOT / "paper" / "paper.bib").read_text("utf-8")

#: Keep a Changelog has all but the first; it separates what changes numbers from what changes names.
KINDS = {"Results changed", "Added", "Changed", "Deprecated", "Removed", "Fixed", "Security"}


def test_the_changelog_has_the_version_and_the_date_of_the_citation() -> None:
    first = re.search(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", CHANGELOG, re.M)
    assert first is not None
    assert first[1] == VERSION
    assert re.findall(r"^date-released: (\S+)$", CITATION, re.M) == [first[2]]
    assert CHANGELOG.index("## [Unreleased]") < first.start()


def test_entries_of_the_changelog_are_one_line_each() -> None:
    body = CHANGELOG.partition("## [Unreleased]")[2]
    assert set(re.findall(r"^### (.*)$", body, re.M)) <= KINDS
    entries = re.findall(r"^- .*$", body, re.M)
    assert len(entries) > 20
    assert [entry for entry in entries if len(entry) > 100] == []
    assert re.findall(r"^[ \t]+\S.*$", body, re.M) == []  # no entry goes on in a second line


# --- the paper for the Journal of Open Source Software -------------------------------------------------------------------

REQUIRED = [
    "Summary",
    "Statement of need",
    "State of the field",
    "Software design",
    "Research impact statement",
    "AI usage disclosure",
    "Acknowledgements",
    "References",
]
"""The sections that the journal asks for, in its order."""


def test_the_paper_has_the_sections_and_the_length_that_the_journal_asks_for() -> None:
    assert re.findall(r"^# (.*)$", PAPER, re.M) == REQUIRED
    assert 750 <= len(PAPER.partition("\n---\n")[2].split()) <= 1750


def test_every_work_that_the_paper_cites_is_in_its_list_and_conversely() -> None:
    listed = re.findall(r"^@\w+\{(\w+),$", BIB, re.M)
    assert len(listed) == len(set(listed))
    assert set(re.findall(r"@(\w+)", PAPER.partition("\n---\n")[2])) == set(listed)


def test_the_figures_of_the_paper_exist_with_the_commands_that_make_them() -> None:
    figures = re.findall(r"^!\[(.*)\]\((.*)\)$", PAPER, re.M)
    assert len(figures) == 2
    for caption, path in figures:
        assert (ROOT / "paper" / path).is_file()
        [command] = re.findall(r"Command: `python (\S+)`", caption)
        assert Path(path).name in (ROOT / command).read_text("utf-8")


@pytest.mark.parametrize("figure", [259, 168])
def test_counts_in_the_paper_stand_on_the_pages_of_the_validation(figure: int) -> None:
    assert re.search(rf"\b{figure}\b", PAPER)
    pages = (ROOT / "docs" / "validation" / name for name in ("paper.md", "trust.md"))
    assert any(re.search(rf"\b{figure}\b", page.read_text("utf-8")) for page in pages)


# --- stability -----------------------------------------------------------------------------------------------------------


def test_the_page_on_stability_names_the_formats_and_crates_of_this_version() -> None:
    from carom.result.record.layout import FORMAT as RESULTS
    from carom.scene.tables.model import FORMAT as SCENARIO

    page = (ROOT / "docs" / "reference" / "stability.md").read_text("utf-8")
    assert f"`format = {SCENARIO}`" in page
    assert f", format {RESULTS} |" in page
    crates = {path.parent.name for path in (ROOT / "crates").glob("*/Cargo.toml")}
    assert crates == set(re.findall(r"`(carom-\w+)`", page))


# --- tiers ---------------------------------------------------------------------------------------------------------------


def rust_target(name: str) -> bool:
    return any(ROOT.glob(f"crates/*/tests/{name}.rs")) or any(ROOT.glob(f"crates/*/tests/{name}/main.rs"))


def test_the_smoke_tier_names_tests_that_exist() -> None:
    lines = (ROOT / "tools" / "smoke.txt").read_text("utf-8").splitlines()
    named = [line for line in lines if not line.startswith("#")]
    python = [line for line in named if "/" in line]
    assert len(python) >= 10
    for line in python:
        file, _, test = line.partition("::")
        assert f"def {test}" in (ROOT / file).read_text("utf-8"), line
    assert [name for name in named if "/" not in name and not rust_target(name)] == []


def test_tests_that_the_table_of_extensions_recommends_exist() -> None:
    page = (ROOT / "CONTRIBUTING.md").read_text("utf-8")
    table = page.partition("| you change |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| ([^|`]+) \| (.*)\| (.+) \|$", table, re.M)
    assert len(rows) >= 10
    for what, rust, python in rows:
        files = re.findall(r"`([^`]+)`", python)
        assert files, what
        assert [name for name in files if not (ROOT / name).is_file()] == []
        assert [name for name in re.findall(r"`(\w+)`", rust) if not rust_target(name)] == []
