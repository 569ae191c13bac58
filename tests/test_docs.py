"""The documentation runs: every notebook page and its figures; examples can be read."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path
from typing import Any

import carom
import pytest
from docs_pages import DOCS, KIT, ROOT, blocks, notebooks, program, run

#: Run in the quick tier beside the pages of the billiards kit; all in the long one.
QUICK = ("incline", "sliding_to_rolling", "torque")
PAGES = [
    pytest.param(page, id=page.stem, marks=[] if page.stem in QUICK or page in KIT else [pytest.mark.long])
    for page in notebooks()
]


@pytest.mark.parametrize("page", PAGES)
def test_a_page_runs(page: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="pages draw figures")
    if "carom.sweep(" in page.read_text("utf-8"):
        pytest.importorskip("pyarrow", reason="tables of studies are Parquet")
        pytest.importorskip("scipy", reason="its points are those of SciPy")
    run(program(page), tmp_path)


@pytest.mark.parametrize("page", notebooks(), ids=lambda page: page.stem)
def test_no_cell_shows_a_whole_scenario_file_by_its_last_line(page: Path) -> None:
    """`scene.to_toml(...)` returns the text, and a notebook prints what stands last."""
    for cell in blocks(page, "{code-cell} python"):
        assert ".to_toml(" not in re.sub(r"^\w+ = ", "", cell.rstrip().splitlines()[-1])[:30], cell


@pytest.mark.parametrize("page", notebooks(), ids=lambda page: page.stem)
def test_figures_have_room_for_their_titles_without_the_settings_of_the_documentation(page: Path) -> None:
    """Whoever downloads a notebook had legends over titles: only a file of the documentation laid figures out."""
    assert "constrained" not in (DOCS / "matplotlibrc").read_text("utf-8")
    for call in re.findall(r"subplots\((.*?)\)\n", program(page), re.S):
        assert 'layout="constrained"' in call


def test_the_order_of_the_tutorial_is_what_its_text_says() -> None:
    """docs/tutorial.md, section 5: order 1.1 from 2 ms to 0.5 ms, no shrinking at the end, and a warning of the scatter."""
    page = DOCS / "tutorial.md"
    cell = next(c for c in blocks(page, "{code-cell} python") if "carom.Scene(" in c)
    names: dict[str, Any] = {"carom": carom}
    exec(cell, names)
    called = re.search(
        r"^!carom converge cut\.toml --steps (\S+) --reference (\S+) --at (\S+)$", page.read_text(), re.M
    )
    assert called
    found = carom.converge(
        names["scene"], [float(h) for h in called[1].split(",")], float(called[2]), at=float(called[3])
    )
    assert found.steps == (2e-3, 1e-3, 5e-4, 2e-4, 1e-4, 5e-5)
    for order in found.orders.values():
        assert order is not None
        assert order.pairwise[:2] == pytest.approx((1.1, 1.1), abs=0.05)
        assert order.pairwise[-1] == pytest.approx(0, abs=0.1)
    assert any("the fit means little" in remark for remark in found.remarks)


def test_the_gallery_is_whole() -> None:
    """Every page of the gallery is on its list, runs code and draws a picture."""
    gallery = DOCS / "gallery"
    pages = {page.stem for page in gallery.glob("*.md")} - {"index"}
    index = (gallery / "index.md").read_text("utf-8")
    listed = set(re.findall(r"\]\((\w+)\.md\)", index))
    assert pages == listed == set(re.findall(r"^(\w+)$", index.split("```{toctree}")[1], re.M))
    assert pages <= {page.stem for page in notebooks()}
    assert not [name for name in pages if "plt.subplots(" not in program(gallery / f"{name}.md")]


def test_the_examples_of_the_paper_are_in_the_gallery() -> None:
    text = (DOCS / "gallery" / "index.md").read_text("utf-8")
    assert [f"5.{k}" for k in range(1, 7) if f"(5.{k})" not in text] == []


@pytest.mark.parametrize("page", sorted(DOCS.glob("*/*.md")), ids=lambda page: page.stem)
def test_examples_in_toml_and_python_can_be_read(page: Path) -> None:
    """TOML parses, Python compiles, and every `carom.NAME` in it is a name of the package."""
    for text in blocks(page, "toml"):
        tomllib.loads(text)
    for text in [*blocks(page, "python"), *blocks(page, "{code-cell} python")]:
        plain = re.sub(r"^!.*$", "pass", text, flags=re.M)
        compile(plain, str(page), "exec")
        for name in set(re.findall(r"\bcarom\.(\w+)", plain)):
            assert getattr(carom, name, None) is not None or (ROOT / "python/carom" / name).exists(), name


def anchors(page: Path) -> set[str]:
    """What a link may name of a page: its headings as GitHub and Sphinx spell them, and explicit targets."""
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.S | re.M)
    plain = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", h) for h in re.findall(r"^#{1,3} (.*)$", text, re.M)]
    named = {re.sub(r"[^\w\- ]", "", h.lower()).strip().replace(" ", "-") for h in plain}
    return named | set(re.findall(r"^\((\S+)\)=", text, re.M))


@pytest.mark.parametrize("page", sorted(DOCS.rglob("[!_]*.md")), ids=lambda page: page.stem)
def test_links_have_a_text_and_lead_somewhere(page: Path) -> None:
    """GitHub shows a link without text as nothing; Sphinx alone would put the title there."""
    text = page.read_text("utf-8")
    assert "[](" not in text
    for file, anchor in re.findall(r"\]\(((?:[^)\s#:]*\.md)?)#([^)\s]+)\)", text):
        assert anchor in anchors(page.parent / file if file else page), (file, anchor)


#: Public names that the reference leaves out: constants, and names for types alone.
UNLISTED = {"TABLES", "TIPS", "__version__", "Region", "Sizes", "MOST_BALLS"}


@pytest.mark.parametrize(
    "module",
    [
        "carom",
        "carom.audit",
        "carom.billiards",
        "carom.packing",
        "carom.problem",
        "carom.many.fit",
        "carom.many.sweep",
    ],
)
def test_the_reference_lists_every_public_name(module: str) -> None:
    page = (DOCS / "reference" / "api.md").read_text("utf-8")
    listed = set(re.findall(r"auto\w+:: (?:[\w.]*\.)?(\w+)$", page, re.M))
    assert set(import_module(module).__all__) - UNLISTED <= listed


def test_every_name_of_the_reference_is_there_as_it_is_written() -> None:
    page = (DOCS / "reference" / "api.md").read_text("utf-8")
    for name in re.findall(r"^\.\. auto\w+:: (\S+)", page, re.M):
        found, path = carom, "carom"
        for part in name.removeprefix("carom.").split("."):
            path = f"{path}.{part}"
            found = getattr(found, part, None) or import_module(path)


def test_what_the_reference_calls_a_module_of_carom_is_one() -> None:
    page = (DOCS / "reference" / "api.md").read_text("utf-8").split("## Simulate")[0]
    for name in re.findall(r"`carom\.([a-z]+)`", page):
        done = subprocess.run([sys.executable, "-c", f"import carom; carom.{name}"], check=False, timeout=60)
        assert done.returncode == 0, name


def test_the_scenario_of_the_reference_runs(tmp_path: Path) -> None:
    """The first example of docs/reference/scenario.md is a whole scenario."""
    first = blocks(DOCS / "reference" / "scenario.md", "toml")[0]
    result = carom.simulate(carom.Scene.from_toml(first), every=1000)
    assert result["cue"].speed[-1] == pytest.approx(5 / 7, abs=1e-8)


@pytest.mark.parametrize("count", [400, 2000])
def test_the_packing_of_the_reference_has_room_for_the_counts_that_it_names(count: int) -> None:
    """docs/reference/granular.md: `fill(count=2000)` alone makes the larger pile."""
    fill = next(text for text in blocks(DOCS / "reference" / "granular.md", "python") if "def fill(" in text)
    names: dict[str, Any] = {"carom": carom}
    exec(fill.split("filled = ")[0], names)
    scene = names["fill"](count=count)
    assert scene.validate() == []
    assert len(scene.names) == count
