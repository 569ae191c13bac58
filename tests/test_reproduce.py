"""`carom reproduce`: what becomes of rows, figures and failures; the page as a browser has it; the real examples."""

from __future__ import annotations

import io
import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from carom.cli import main
from carom.reproduce import runner
from carom.reproduce.document import Context, Curve, Example, Figure, Row, to_json
from carom.reproduce.figures import _look, draw
from carom.reproduce.page import MARKS, anchor, number, table
from paper_fakes import good

ROOT = Path(__file__).parent.parent
SHORT, CRASH, BAD_INPUT, NOT_CONVERGED = 1, 1, 2, 3


def cli(*arguments: str | Path, code: int = 0) -> tuple[str, str]:
    """Standard output and standard error of `carom reproduce` in this process; its workers are processes of their own."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as left:
        main(["reproduce", *map(str, arguments)])
    assert (left.value.code or 0) == code, err.getvalue()
    return out.getvalue(), err.getvalue()


@pytest.fixture
def fakes(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Call with names of modules of `paper_fakes` by example: they stand for the paper's."""

    def use(**modules: str) -> None:
        known = {key.replace("_", "."): f"paper_fakes.{name}" for key, name in modules.items()}
        monkeypatch.setattr(runner, "MODULES", known)

    return use


def row(**changed: Any) -> Row:
    given: dict[str, Any] = {
        "quantity": "speed", "unit": "m/s", "paper": 1.0, "analytic": 2.0, "carom": 2.0,
        "tolerance": 0.1, "origin": "rounding", "against": "analytic",
    }  # fmt: skip
    return Row(**(given | changed))


# --- verdicts -------------------------------------------------------------------------------------------------------


def test_a_verdict_is_the_comparison_with_the_value_that_the_row_names() -> None:
    assert row().verdict == "ok"
    assert row(against="paper").verdict == "short"
    assert row(paper_in_error=True, note="why").verdict == "paper in error"
    assert row(paper_in_error=True, note="why", carom=2.2).verdict == "short"
    assert row(carom=1.875, tolerance=0.125).verdict == "ok"  # the tolerance itself is admitted
    assert row(carom=1.875).difference == -0.125


@pytest.mark.parametrize(
    ("changed", "complaint"),
    [
        ({"carom": float("nan")}, "carom is nan"),
        ({"paper": float("inf")}, "paper is inf"),
        ({"tolerance": -1.0}, "must not be negative"),
        ({"tolerance": float("inf")}, "tolerance is inf"),
        ({"against": "paper", "paper": "about 2"}, "not a number"),
        ({"analytic": None}, "not a number"),
        ({"origin": ""}, "where the tolerance comes from"),
        ({"paper_in_error": True}, "and a note"),
        ({"paper_in_error": True, "note": "why", "against": "paper"}, "corrected one"),
    ],
)
def test_a_row_that_cannot_be_judged_is_refused(changed: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValueError, match=complaint):
        row(**changed)


def test_an_example_names_its_rows_and_what_occurs_twice_is_refused() -> None:
    assert [part.example for part in Example("5.1", "", (row(), row(quantity="time"))).rows] == ["5.1"] * 2
    with pytest.raises(ValueError, match="'speed' occurs twice"):
        Example("5.1", "", (row(), row()))
    x = np.array([0.0, 1.0])
    with pytest.raises(ValueError, match="positive on a logarithmic axis"):
        Figure("1", "", "x", "y", (Curve("c", x, x),), "", xscale="log")
    with pytest.raises(ValueError, match="2 values of x, 1 of y"):
        Curve("c", x, x[:1])
    with pytest.raises(ValueError, match="finite numbers"):
        Curve("c", x, np.array([0.0, np.nan]))


def test_numbers_show_the_digits_that_the_tolerance_makes_worth_reading() -> None:
    assert number(10.50509712, 1e-3) == "10.5051"
    assert number(10.50509712, 0.1) == "10.51"
    assert number(-18.730451234, 1e-12) == "-18.73045123"
    assert number(3e-16, 1e-13) == "3e-16"
    assert number(3000.0, 0.0) == "3000"
    assert number(None) == "–"
    assert number("slightly lower") == "slightly lower"


def test_lines_that_coincide_and_closed_forms_on_top_are_both_seen() -> None:
    x = np.linspace(0.0, 1.0, 5)
    left, right, exact = (
        Curve("4", x, x, body=2),
        Curve("5", x, x + 1e-9, body=3),
        Curve("e", x, x, "dashed", 3),
    )
    for curves, dashed, pale in (((left, right), [False, True], [False] * 2), ((left, exact), [False, True], [False] * 2),
                                 ((left, right, exact), [False, False, True], [False, True, False])):  # fmt: skip
        looks = [_look(c, "#0072B2", k, Figure("1", "", "x", "y", curves, "")) for k, c in enumerate(curves)]
        assert [look.get("linestyle", "-") != "-" for look in looks] == dashed
        assert ["alpha" in look for look in looks] == pale


def test_links_are_those_of_github_and_of_the_documentation() -> None:
    assert anchor("5.1 Two spheres, one above the other") == "51-two-spheres-one-above-the-other"
    assert anchor("Appendix C Impact (e = 1)") == "appendix-c-impact-e--1"


def test_a_cell_cannot_break_its_table() -> None:
    assert table(("a",), [("x|y\nz",)]).splitlines()[-1] == "| x\\|y z |"


# --- runs -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("formats", ["svg", pytest.param("png,svg,pdf", marks=pytest.mark.long)])
def test_page_report_and_figures(fakes: Any, tmp_path: Path, formats: str) -> None:
    fakes(**{"5_1": "good"})
    out = tmp_path / "r"
    text, _ = cli("-o", out, "--format", formats, "--json")
    document = json.loads(text)
    assert {"example", "quantity", "paper", "analytic", "carom", "difference", "tolerance", "verdict"} <= set(
        document["rows"][0]
    )
    assert [r["verdict"] for r in document["rows"]] == ["ok", "ok", "paper in error", "ok"]
    assert document["verdicts"] == {"ok": 3, "paper in error": 1, "short": 0}
    assert document["rows"][2]["difference"] == pytest.approx(5e-5)
    assert document["directory"] == str(out)

    present = sorted(f.relative_to(out).as_posix() for f in out.rglob("*") if f.is_file())
    assert present == document["files"] == json.loads((out / "report.json").read_text())["files"]
    for name in ("5.1_figure_3a", "5.1_figure_4"):
        assert {f"figures/{name}.{end}" for end in (*formats.split(","), "csv")} <= set(present)
    markdown = (out / "report.md").read_text(encoding="utf-8").replace("\N{NO-BREAK SPACE}", " ")
    assert (
        "| spin after t_lim (rad/s) ¹ | -0.00691 | **-18.7305** | -18.7304 | 5e-05 | 0.001 (c) | ✎ paper in error |"
        in markdown
    )
    assert f"1. {good.ERRATUM}" in markdown
    assert "6 / 1.04 (paper 7 / 2)" in markdown
    assert "0 / 0 (paper 9 / –)" in markdown
    assert "| 5.1 as printed | `step = 0.001`, `tolerance = 1e-05` |" in markdown
    assert "What a run does not set has its default: " in markdown


def test_the_quick_form_has_the_same_rows_and_no_figures(fakes: Any, tmp_path: Path) -> None:
    fakes(**{"5_1": "good"})
    document = json.loads(cli("--quick", "-o", tmp_path / "r", "--json")[0])
    assert [r["quantity"] for r in document["rows"]] == [
        r.quantity for r in good.reproduce(_alone(quick=True)).rows
    ]
    assert document["rows"][3]["carom"] == 0.25  # the heavy part knew that it was to be quick
    assert document["quick"] is True
    assert not list((tmp_path / "r").rglob("*.png"))
    assert "quick form" in (tmp_path / "r" / "report.md").read_text(encoding="utf-8")


def _alone(*, quick: bool) -> Context:
    return Context(quick=quick, parts={"half": (0.25, -1)})


def test_a_number_that_falls_short_is_told_and_exits_with_1(fakes: Any, tmp_path: Path) -> None:
    fakes(**{"5_1": "good", "5_4": "short"})
    text, _ = cli("-o", tmp_path / "r", "--no-figures", code=SHORT)
    assert "short: 5.4 speed: 1.44434 m/s instead of 1.5 (paper), admitted 0.001" in text
    page = (tmp_path / "r" / "index.html").read_text(encoding="utf-8")
    assert "✗ short" in page
    assert "**1 short**" in (tmp_path / "r" / "report.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("module", "code", "told"),
    [
        ("raises", CRASH, "ZeroDivisionError: no <b>way</b> out (raises.py, line 9)"),
        ("stops", NOT_CONVERGED, "step 7 was not solved; use a smaller step (stops.py, line 9)"),
        ("absent", CRASH, "No module named 'paper_fakes.absent'"),
    ],
)
def test_an_example_that_fails_is_told_with_its_cause_and_the_others_go_on(
    fakes: Any, tmp_path: Path, module: str, code: int, told: str
) -> None:
    fakes(**{"5_1": "good", "5_5": module})
    text, err = cli("-o", tmp_path / "r", "--no-figures", "--json", code=code)
    document = json.loads(text)
    assert len(document["rows"]) == 4
    [failure] = document["failures"]
    assert failure["example"] == "5.5"
    assert told in err
    page = (tmp_path / "r" / "index.html").read_text(encoding="utf-8")
    assert failure["error"].replace("<", "&lt;").replace(">", "&gt;").split("'")[0] in page
    assert "<b>way" not in page


def test_a_process_that_is_killed_is_a_failure_too(fakes: Any, tmp_path: Path) -> None:
    fakes(**{"5_5": "dies"})
    _, err = cli("-o", tmp_path / "r", "--no-figures", code=CRASH)
    assert "5.5 failed: the process that computed it was killed" in err


def test_examples_are_chosen_by_name_in_the_papers_order(fakes: Any, tmp_path: Path) -> None:
    fakes(**{"5_1": "good", "5_4": "short", "C": "raises"})
    document = json.loads(cli("5.4", "5.1", "-o", tmp_path / "r", "--no-figures", "--json", code=SHORT)[0])
    assert [example["id"] for example in document["examples"]] == ["5.1", "5.4"]
    _, err = cli("5.7", "-o", tmp_path / "no", code=BAD_INPUT)
    assert "the paper has no example '5.7'; did you mean 5." in err
    assert cli("c", "-o", tmp_path / "c", code=CRASH)[1].startswith("carom: C failed")
    assert not (tmp_path / "no").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--format", "jpeg"], "'jpeg' is no format of a figure; "),
        (["--jobs", "0"], "greater than or equal to 1"),
        (["--docs", "d", "--quick"], "leave out --quick"),
        (["--docs", "d", "5.1"], "leave out --quick, --no-figures and names"),
    ],
)
def test_wrong_options_are_refused_before_anything_is_computed(
    fakes: Any, tmp_path: Path, arguments: list[str], told: str
) -> None:
    fakes(**{"5_1": "good", "5_4": "short"})
    _, err = cli(*arguments, "-o", tmp_path / "r", code=BAD_INPUT)
    assert told in err
    assert not list(tmp_path.iterdir())


# --- the directory --------------------------------------------------------------------------------------------------


def test_an_earlier_reproduction_is_replaced_and_nothing_else_is_ever_deleted(
    fakes: Any, tmp_path: Path
) -> None:
    fakes(**{"5_1": "good"})
    out = tmp_path / "r"
    cli("-o", out, "-q")
    assert (out / "figures").exists()
    cli("-o", out, "--quick", "-q")
    assert not (out / "figures").exists()

    (out / "notes.txt").write_text("mine")
    _, err = cli("-o", out, "-q", code=BAD_INPUT)
    assert "holds files that carom reproduce did not write (notes.txt)" in err
    cli("-o", out, "--quick", "--force", "-q")
    assert (tmp_path / "r.before-1" / "notes.txt").read_text() == "mine"
    assert not (out / "notes.txt").exists()
    assert sorted(f.name for f in tmp_path.iterdir()) == ["r", "r.before-1"]

    _, err = cli("-o", out / "index.html", "--force", code=BAD_INPUT)
    assert "is a file" in err
    empty = tmp_path / "empty"
    empty.mkdir()
    cli("-o", empty, "--quick", "-q")
    assert (empty / "index.html").exists()


@pytest.mark.parametrize("number_", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.long)])
def test_interrupted_it_leaves_the_old_reproduction_and_no_process(tmp_path: Path, number_: int) -> None:
    out, begun = tmp_path / "r", tmp_path / "begun"
    program = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from carom.reproduce import runner; runner.MODULES = {'5.1': 'paper_fakes.' + sys.argv[2]}\n"
        "from carom.cli import main; main(['reproduce', '--quick', '-o', sys.argv[3]])\n"
    )
    command = [sys.executable, "-c", program, str(ROOT / "tests")]
    subprocess.run([*command, "good", str(out)], check=True, capture_output=True, timeout=120)
    before = (out / "report.json").read_bytes()

    environment = os.environ | {"CAROM_TEST_BEGUN": str(begun)}
    process = subprocess.Popen(
        [*command, "lasts", str(out)], env=environment, stderr=subprocess.PIPE, text=True
    )
    _until(lambda: begun.exists() and begun.read_text())
    process.send_signal(number_)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert err.strip() == "carom: interrupted"
    _until(lambda: not Path(f"/proc/{begun.read_text()}").exists())
    assert (out / "report.json").read_bytes() == before
    assert sorted(f.name for f in tmp_path.iterdir()) == ["begun", "r"]


def test_workers_end_with_a_parent_that_is_killed(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    program = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from carom.reproduce import runner; runner.MODULES = {'5.1': 'paper_fakes.lasts'}\n"
        "from carom.cli import main; main(['reproduce', '--quick', '-o', sys.argv[2]])\n"
    )
    command = [sys.executable, "-c", program, str(ROOT / "tests"), str(tmp_path / "r")]
    process = subprocess.Popen(
        command, env=os.environ | {"CAROM_TEST_BEGUN": str(begun)}, stderr=subprocess.DEVNULL
    )
    _until(lambda: begun.exists() and begun.read_text())
    process.kill()
    process.wait(60)
    _until(lambda: not Path(f"/proc/{begun.read_text()}").exists())
    assert not (tmp_path / "r").exists()


def _until(holds: Any) -> None:
    deadline = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.05)


# --- the page -------------------------------------------------------------------------------------------------------


class _Page(HTMLParser):
    """What a reader of screens needs: headings with anchors, tables with heads, pictures with words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.images: list[dict[str, str | None]] = []
        self.scopes: list[str | None] = []
        self.remote: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        found = dict(attrs)
        self.ids |= {found["id"] or ""} if "id" in found else set()
        self.links += [found["href"] or ""] if tag == "a" else []
        self.images += [found] if tag == "img" else []
        self.scopes += [found.get("scope")] if tag == "th" else []
        self.remote += [v for v in found.values() if v and re.match(r"(https?:)?//", v)]


def test_the_page_is_whole_by_itself_and_says_in_words_what_it_shows(fakes: Any, tmp_path: Path) -> None:
    fakes(**{"5_1": "good", "5_4": "short"})
    out = tmp_path / "r"
    cli("-o", out, "-q", code=SHORT)
    text = (out / "index.html").read_text(encoding="utf-8")
    page = _Page(text)
    assert "{{" not in text
    assert not page.remote
    assert len(page.images) == 2
    assert all(image["alt"] and (out / str(image["src"])).is_file() for image in page.images)
    assert page.images[0]["alt"].startswith(
        "Figure 3a: Angular velocities. angular velocity in rad/s over time in s"
    )
    assert page.scopes
    assert set(page.scopes) == {"col", "row"}
    inside = [link[1:] for link in page.links if link.startswith("#")]
    assert inside
    assert set(inside) <= page.ids
    assert all((out / link).is_file() for link in page.links if not link.startswith("#"))
    assert text.count("<figure>") == text.count("<figcaption>") == 2
    assert '<td data-label="verdict" class="short">✗ short</td>' in text


@pytest.mark.parametrize("times", [1, pytest.param(2, marks=pytest.mark.long)])
def test_the_documentation_has_the_same_page_without_anything_that_changes_by_itself(
    fakes: Any, tmp_path: Path, times: int
) -> None:
    fakes(**{"5_1": "good"})
    docs = tmp_path / "docs"
    (docs / "paper").mkdir(parents=True)
    (docs / "paper" / "5.1_figure_9.svg").write_text("of an earlier time")
    written = []
    for _ in range(times):
        cli("-o", tmp_path / "r", "--docs", docs, "-q")
        written.append({f.name: f.read_bytes() for f in docs.rglob("*") if f.is_file()})
    assert written[0] == written[-1]
    assert sorted(written[0]) == ["5.1_figure_3a.svg", "5.1_figure_4.svg", "paper.md"]
    text = written[0]["paper.md"].decode()
    assert "](paper/5.1_figure_3a.svg)" in text
    assert "date" not in text
    report = (tmp_path / "r" / "report.md").read_text(encoding="utf-8")
    tables = [line for line in text.splitlines() if line.startswith("| ")]
    assert set(tables) <= set(report.splitlines()) | {"| made by | `make reproduce` |", *tables[-2:]}


@pytest.mark.parametrize("formats", [("svg",), pytest.param(("png", "svg", "pdf"), marks=pytest.mark.long)])
def test_the_same_figure_is_the_same_file(tmp_path: Path, formats: tuple[str, ...]) -> None:
    figure = good.reproduce(_alone(quick=False)).figures[0]
    for name in ("a", "b"):
        draw(figure, tmp_path / name, formats)
    for one in (tmp_path / "a").iterdir():
        assert one.read_bytes() == (tmp_path / "b" / one.name).read_bytes()
    head, *lines = (tmp_path / "a" / f"{figure.name}.csv").read_text().splitlines()
    assert head == "curve,time in s,angular velocity in rad/s"
    assert len(lines) == sum(len(curve.x) for curve in figure.curves)
    assert float(lines[1].split(",")[2]) == figure.curves[0].y[1]


def test_json_has_plain_values_only() -> None:
    plain = to_json(good.reproduce(_alone(quick=False)))
    assert json.loads(json.dumps(plain, allow_nan=False))["rows"][0]["verdict"] == "ok"
    assert to_json({"x": float("nan"), "path": Path("a")}) == {"x": None, "path": "a"}


# --- the paper ------------------------------------------------------------------------------------------------------


#: Examples of the quick tier; rows of the others are judged by test_paper_123.py and test_paper_456.py.
SOME = ("5.1", "B")


@pytest.fixture(scope="module", params=[SOME, pytest.param((), marks=pytest.mark.long)], ids=["some", "all"])
def paper(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The report of some or all examples in their quick form."""
    out = tmp_path_factory.mktemp("paper") / "r"
    report = json.loads(cli(*request.param, "--quick", "-o", out, "--json")[0])
    assert [example["id"] for example in report["examples"]] == list(request.param or runner.MODULES)
    return report


def test_every_example_of_the_paper_is_reproduced(paper: Any) -> None:
    assert not [row for row in paper["rows"] if row["verdict"] == "short"]
    assert {row["example"] for row in paper["rows"]} == {example["id"] for example in paper["examples"]}
    assert paper["verdicts"]["paper in error"] > 0


def test_the_documentation_shows_these_rows(paper: Any) -> None:
    """`make reproduce` writes docs/validation/paper.md; a row that came, went or changed its verdict calls for it."""
    text = (ROOT / "docs/validation/paper.md").read_text(encoding="utf-8")
    chapters = {
        re.split(r"[ :]", part.removeprefix("Appendix "))[0]: part for part in text.split("\n## ")[1:]
    }
    text = "".join(chapters[example["id"]] for example in paper["examples"])
    shown = [
        (re.sub(r"\s[⁰¹²³⁴⁵⁶⁷⁸⁹]+$", "", cells[0]).replace("\\|", "|"), cells[-1][2:])
        for line in text.splitlines()
        if len(cells := re.split(r"(?<!\\) \| ", line.strip("| "))) == 7 and cells[-1] in MARKS.values()
    ]
    told = [
        (r["quantity"] + (f" ({r['unit']})" if r["unit"] not in ("", "1") else ""), r["verdict"])
        for r in paper["rows"]
    ]
    assert shown == told


@pytest.mark.long
def test_the_quick_form_has_the_rows_and_tolerances_of_the_whole(paper: Any, tmp_path: Path) -> None:
    whole = json.loads(cli("--no-figures", "-o", tmp_path / "r", "--json")[0])
    keys = ("example", "quantity", "unit", "paper", "analytic", "tolerance", "against", "verdict")
    chosen = {example["id"] for example in paper["examples"]}
    assert [{k: r[k] for k in keys} for r in paper["rows"]] == [
        {k: r[k] for k in keys} for r in whole["rows"] if r["example"] in chosen
    ]
