"""The documents name real things: paths, equations, names."""

import re
from pathlib import Path

import carom
import pytest

ROOT = Path(__file__).parent.parent
DOCUMENTS = [
    *(ROOT / name for name in ("README.md", "ARCHITECTURE.md", "CONTRIBUTING.md", "CHANGELOG.md")),
    *sorted((ROOT / "docs").glob("[!_]*/**/*.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    ROOT / "benches" / "README.md",
]
TOP = {"crates", "python", "docs", "tests", "tools", "benches", "scenarios", "viewer", "fuzz", ".ci"}
EQUATIONS = range(1, 68)  # the paper's
PARTS = {1: "abcdefgh", 5: "ab", 6: "abc", 8: "abcd", 27: "ab"}


def code_spans(text: str) -> list[str]:
    """What stands between single back quotes, fenced blocks left out."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    return re.findall(r"`([^`\n]+)`", text)


def named_paths(text: str) -> list[str]:
    """Code spans that are paths from the root: their first part is a folder of it, or they look like a file at it."""
    spans = (span.rstrip("/") for span in code_spans(text))
    at_root = re.compile(r"[\w.-]+\.(md|toml|txt|cff|lock)|Makefile|LICENSE")
    return [
        span
        for span in spans
        if (re.fullmatch(r"[\w.*/-]+", span) and "/" in span and span.split("/")[0] in TOP)
        or (at_root.fullmatch(span) and span not in RUN_FILES)
    ]


RUN_FILES = {"scenario.toml", "my.toml"}  # of a run directory, of the reader


def cited_equations(text: str) -> list[tuple[int, str, str]]:
    """(number, part, context) of every `eq. 8a`, `eqs. 1c-e, 24-29`, `equations (15) and (18)`."""
    found = []
    one = r"\(?\d+\)?[a-h]?(?:-[a-h]\b)?"
    joint = rf"(?:{one})(?:(?:\s*(?:,|-|–|to|and|or)\s*)+(?:{one}))*"
    for citation in re.finditer(rf"\b(?:[Ee]qs?\.|[Ee]quations?)\s+({joint})", text):
        for number, part in re.findall(r"(\d+)\)?([a-h]?)", citation[1]):
            found.append((int(number), part, citation[0]))
    return found


def wrong_equations(text: str) -> list[str]:
    return [
        f"{context!r}: {number}{part}"
        for number, part, context in cited_equations(text)
        if number not in EQUATIONS or (part and part not in PARTS.get(number, ""))
    ]


def test_the_scanners_see_what_they_should() -> None:
    text = "Eqs. 1c-e, 24-29 and equation (42), eq. 8a; not section 99. `crates/x` `README.md` `a/b`\n```\n`docs/no`\n```"
    assert [(n, p) for n, p, _ in cited_equations(text)] == [(1, "c"), (24, ""), (29, ""), (42, ""), (8, "a")]
    assert named_paths(text) == ["crates/x", "README.md"]
    assert wrong_equations("eq. 68 and eqs. 2a, 3") == ["'eq. 68': 68", "'eqs. 2a, 3': 2a"]


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_path_that_a_document_names_exists(document: Path) -> None:
    named = named_paths(document.read_text(encoding="utf-8"))
    missing = [path for path in named if not any(ROOT.glob(path)) and not (document.parent / path).exists()]
    assert not missing


def test_the_map_leaves_nothing_out() -> None:
    """Every crate, Python module and top-level folder is on the map or below something that is."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    known = set(named_paths(text))
    parts = [
        *(ROOT / "crates").iterdir(),
        *(path.parent for path in (ROOT / "python/carom").glob("*/__init__.py")),
    ]
    assert not [part for part in parts if str(part.relative_to(ROOT)) not in known]


def test_what_the_map_says_is_in_a_file_is_there() -> None:
    """`solve_pile` in `crates/.../position.rs`: the name is one of that file."""
    said = re.findall(
        r"`(\w+)` in\s+`([\w./-]+\.rs)`", (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    )
    assert len(said) >= 12
    wrong = [
        (name, path)
        for name, path in said
        if not re.search(rf"\b{name}\b", (ROOT / path).read_text(encoding="utf-8"))
    ]
    assert not wrong


def test_the_map_says_where_each_step_of_a_contact_is() -> None:
    """`meet` (`candidates.rs`) in the walk of a contact: the file below the core's sources has that name."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    walk = text.partition("The same in words.")[2].partition("| question")[0]
    said = re.findall(r"`(?:\w+::)?(\w+)`\s+\(`([\w/]+\.rs)`\)", walk)
    assert len(said) >= 7
    core = ROOT / "crates" / "carom-core" / "src"
    assert not [(n, f) for n, f in said if not re.search(rf"\b{n}\b", (core / f).read_text(encoding="utf-8"))]


def test_the_map_uses_the_phase_names_of_the_step() -> None:
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    block = text.split("```")[1]
    phases = [line.split()[0] for line in block.strip().splitlines() if not line.startswith(" ")]
    scene = carom.Scene(run={"until": 2e-3, "step": 1e-3})
    scene.sphere("a", radius=0.1, mass=1.0, material="m", at=(0, 0, 0))
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    summary = carom.simulate(scene).summary
    timed = summary["phases"]
    assert sum(timed.values()) == pytest.approx(
        summary["core_s"]
    )  # the whole is known, by samples its shares
    # The smooth accelerations are timed with the prediction that begins with them, and "record" is not part of the step.
    assert [p for p in phases if p not in ("smooth", "report")] == [p for p in timed if p != "record"]
    assert {"smooth", "report"} <= set(phases)


def sources() -> list[Path]:
    return [
        *sorted((ROOT / "crates").rglob("*.rs")),
        *sorted((ROOT / "python" / "carom").rglob("*.py")),
        *sorted((ROOT / "tests" / "oracle").rglob("*.py")),
        *sorted((ROOT / "docs").glob("[!_]*/**/*.md")),
    ]


def test_every_equation_cited_is_one_of_the_paper() -> None:
    wrong = {
        str(path.relative_to(ROOT)): bad
        for path in sources()
        if (bad := wrong_equations(path.read_text(encoding="utf-8")))
    }
    assert not wrong


def notation_rows() -> list[list[str]]:
    text = (ROOT / "docs/theory/notation.md").read_text(encoding="utf-8")
    tables = text.split("## Where the code departs")[0]
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in tables.splitlines()
        if line.startswith("| ")
    ]
    return [row for row in rows if row[0] != "symbol"]


def test_every_row_of_the_notation_cites_where_it_is_defined() -> None:
    rows = notation_rows()
    assert len(rows) > 30
    assert all(len(row) == 5 for row in rows)
    assert not [row for row in rows if not re.match(r"(eqs?\.|spec) \d", row[3])]


def test_every_name_of_the_notation_occurs_in_the_code() -> None:
    code = "\n".join(path.read_text(encoding="utf-8") for path in sources() if path.suffix != ".md")
    words = set(re.findall(r"\w+", code))
    names = {name for row in notation_rows() for name in re.findall(r"`(\w+)`", row[1])}
    assert not names - words


def test_every_decision_has_its_three_parts_and_its_number() -> None:
    pages = sorted((ROOT / "docs/decisions").glob("*.md"))
    assert [page.name[:3] for page in pages] == [f"{k:03}" for k in range(1, len(pages) + 1)]
    for page in pages:
        text = page.read_text(encoding="utf-8")
        assert text.startswith(f"# {page.name[:3]} ")
        assert "**Decided.**" in text
        assert "**Price.**" in text
        assert len(text.split()) < 700, f"{page.name} is longer than a page"
        assert len(text.splitlines()) <= 60, f"{page.name} has more than 60 lines"
