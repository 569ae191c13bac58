"""The catalogue of errors: every message that the source states is on the page, is provoked, and says place, cause, cure."""

from __future__ import annotations

import os
import re
from pathlib import Path

import carom
import error_catalogue
import pytest
from carom import ScenarioError, Scene
from carom.errors import Problem, among, did_you_mean
from carom.problem import ContactProblemError
from carom.scene.toml import load
from error_cases import CALLED, PIECES
from error_catalogue import Message, messages
from problem_error_cases import PROBLEMS
from test_bad_input import GOOD, MISTAKES

MESSAGES = messages()
#: Those about a file as a whole: what is done to provoke them.
FILES = {
    "no such file": lambda folder: Scene.from_toml(folder / "nowhere.toml"),
    "is a directory, not a scenario file": lambda folder: Scene.from_toml(folder),
    "cannot be read (...)": lambda folder: Scene.from_toml(Path("a\0.toml")),
    "is empty": lambda folder: Scene.from_toml(written(folder, b"\n")),
    "its lines end in carriage returns alone (CR)": lambda folder: Scene.from_toml(
        written(folder, GOOD.replace("\n", "\r").encode())
    ),
    "is not UTF-8 text (byte ...)": lambda folder: Scene.from_toml(written(folder, b"\xff")),
    "is larger than ... MiB": lambda folder: Scene.from_toml(written(folder, b"#" * 101)),
    "may not be read": lambda folder: Scene.from_toml(written(folder, b"x = 1", mode=0)),
    "is no parameter of this file": lambda folder: Scene.from_toml(GOOD, parameters={"x": 1.0}),
    "there is no case ...": lambda folder: Scene.from_toml(GOOD, case="x"),
    "the scene has no spheres": lambda folder: Scene.from_toml(GOOD[: GOOD.index("[[sphere]]")]).validate(),
}


def written(folder: Path, data: bytes, mode: int = 0o600) -> Path:
    path = folder / "x.toml"
    path.write_bytes(data)
    path.chmod(mode)
    return path


def changed(piece: str) -> str:
    """GOOD with a piece added, or put in the place of another."""
    old, arrow, new = piece.partition(" -> ")
    if not arrow:
        return GOOD + piece
    assert GOOD.count(old) == 1, old
    return GOOD.replace(old, new)


def said(text: str) -> list[Problem]:
    """All errors of a scenario, or where there are none its advice."""
    try:
        return Scene.from_toml(text).validate()
    except ScenarioError as error:
        return error.problems


def meant(cause: str) -> list[Message]:
    found = [message for message in MESSAGES if message.cause == cause]
    assert found, f"no message says {cause!r} any more"
    return found


@pytest.mark.parametrize(
    ("cause", "key", "piece"), [(cause, *case) for cause, cases in PIECES.items() for case in cases]
)
def test_a_message_names_place_cause_and_cure(cause: str, key: str, piece: str) -> None:
    text = changed(piece)
    found = [p for p in said(text) if any(m.matches(f"{p.cause}; {p.cure}") for m in meant(cause))]
    assert found, [str(p) for p in said(text)]
    (problem, *_) = found
    assert key in problem.key, problem
    assert problem.line is not None
    # The line is that of the key, or of the table where the key is not written or the table as a whole is meant.
    row = text.splitlines()[problem.line - 1]
    words = {*re.split(r"[ .]", problem.key), "position", "origin"}
    assert any(word and word in row for word in words), (row, problem.key)
    assert len(str(problem).splitlines()) == 1


@pytest.mark.parametrize("cause", CALLED)
def test_a_call_names_place_cause_and_cure(cause: str) -> None:
    place, call = CALLED[cause]
    with pytest.raises(ScenarioError) as caught:
        call()
    (problem,) = caught.value.problems
    assert any(m.matches(f"{problem.cause}; {problem.cure}") for m in meant(cause)), problem
    assert place in f"{problem.where} {problem.key}"


@pytest.mark.parametrize("cause", FILES)
def test_a_file_that_cannot_be_read(cause: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if cause == "may not be read" and os.geteuid() == 0:
        pytest.skip("root reads every file")
    monkeypatch.setattr(load, "MOST_BYTES", 100 if "larger" in cause else 10**6)
    with pytest.raises(ScenarioError) as caught:
        FILES[cause](tmp_path)
    (problem,) = caught.value.problems
    assert any(m.matches(f"{problem.cause}; {problem.cure}") for m in meant(cause)), problem
    assert problem.where


def test_every_message_of_the_source_is_provoked() -> None:
    others = [p for old, new, *_ in MISTAKES.values() for p in said(GOOD.replace(old, new))]
    told = [p for cases in PIECES.values() for _, piece in cases for p in said(changed(piece))]
    texts = [f"{p.cause}; {p.cure}" for p in (*others, *told)]
    silent = [
        message
        for message in MESSAGES
        if message.cause not in {*CALLED, *FILES} and not any(map(message.matches, texts))
    ]
    assert silent == [], "a message without a case: add one to tests/error_cases.py"


@pytest.mark.parametrize("words", PROBLEMS)
def test_a_message_about_a_contact_problem_names_place_cause_and_cure(
    words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place, call = PROBLEMS[words]
    meant = [m for m in error_catalogue.problem_messages() if f"{m.cause}; {m.cure}" == words]
    assert meant, f"no message says {words!r} any more"
    with pytest.raises(ContactProblemError) as caught:
        call(tmp_path, monkeypatch)
    told = str(caught.value)
    assert place in told
    assert len(told.splitlines()) == 1
    assert any(m.matches(told) for m in meant), told


def test_every_message_about_contact_problems_is_provoked() -> None:
    found = {f"{m.cause}; {m.cure}" for m in error_catalogue.problem_messages()}
    assert found == {*PROBLEMS}, "a message without a case: add one to tests/problem_error_cases.py"


@pytest.mark.parametrize("name", error_catalogue.LISTS)
def test_the_page_lists_every_message(name: str) -> None:
    assert error_catalogue.written(name) == error_catalogue.table(name), (
        "the page is not up to date: run `python tests/error_catalogue.py`"
    )


def test_the_outcomes_of_a_run_are_on_the_page() -> None:
    page = error_catalogue.PAGE.read_text(encoding="utf-8")
    source = (error_catalogue.ROOT / "crates" / "carom-core" / "src" / "report.rs").read_text()
    kinds = re.findall(r'Failure::\w+[^"\n]*=> "(\w+)"', source)
    assert len(kinds) >= 8
    missing = [kind for kind in kinds if f"`{kind}`" not in page]
    assert missing == []


def test_errors_are_of_one_family() -> None:
    assert issubclass(ScenarioError, carom.CaromError)
    assert issubclass(carom.CaromError, ValueError)


def test_names_that_may_be_taken_for_several_are_quoted_in_lists() -> None:
    assert did_you_mean("xyz", ["cue, left", "all"]) == 'known: "cue, left", all'
    assert (
        did_you_mean("cue, lef", ["cue, left", "all"])
        == 'did you mean "cue, left"? (known: "cue, left", all)'
    )
    assert among("xyz", ["thin cut"], ["all"]) == "known: thin cut, all"
