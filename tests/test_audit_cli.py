"""`carom check RUN`: verdict, JSON, exit codes, repetition bit for bit; laws of one variable read by the auditor."""

from __future__ import annotations

import contextlib
import json
from pathlib import Path
from typing import Any

import audit_faults as fault
import audit_scenes as scenes
import carom
import h5py
import numpy as np
import pytest
from carom import audit
from carom.audit.data import Run
from carom.audit.formula import law
from carom.audit.rerun import rerun
from carom.cli.app import app
from carom.run.result import UnfinishedRun
from carom.scene.tables.laws import value_at
from typer.testing import CliRunner


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two balls that hit each other."""
    return scenes.run(scenes.two_balls(), tmp_path_factory.mktemp("runs") / "two", 0.05)


def called(*arguments: str | Path) -> tuple[int, str, str]:
    """Exit code, standard output, standard error of `carom check`."""
    result = CliRunner().invoke(app, ["check", *map(str, arguments)])
    return result.exit_code, result.stdout, result.stderr


def test_a_clean_run_and_its_repetition_on_two_threads(run: Path) -> None:
    code, text, _ = called(run, "--threads", "1,2")
    assert code == 0, text
    assert text.count("no law is violated") == 1
    assert text.splitlines()[-1].endswith("two: no law is violated")
    assert text.count("every bit is the same") == 2


def test_the_verdict_is_said_once_and_counts_what_was_not_judged(tmp_path: Path) -> None:
    carom.simulate(carom.example("three_balls"), out=tmp_path / "run", contacts=False)
    code, text, _ = called(tmp_path / "run")
    assert code == 0
    lines = text.splitlines()
    listed = {line.split(",")[1].split(" (")[0] for line in lines if line.startswith("not judged, ")}
    assert len(listed) > 1
    assert text.count("no law is violated") == 1
    assert lines[-1].endswith(
        f"no law is violated; not judged, or not everywhere: {len(listed)} laws, listed above"
    )


def test_json_is_one_document_with_every_law(run: Path) -> None:
    code, text, _ = called(run / "results.h5", "--json", "--rerun")
    found = json.loads(text)
    assert code == 0
    assert found["ok"]
    assert {k["kind"] for k in found["kinds"]} == set(audit.check(run).verdicts)
    assert found["rerun"][0]["numbers"] > 1000


def test_a_violation_is_named_with_place_and_exit_code_3(run: Path, tmp_path: Path) -> None:
    bad = fault.planted(run, tmp_path / "bad", fault.push_velocity(20, 1, np.array([1e-9, 0, 0])))
    code, text, _ = called(bad)
    assert code == 3
    assert "momentum" in text
    assert "step 20, t = 0.02 s" in text
    report = audit.check(carom.load(bad))
    assert not report.ok
    assert report["momentum"].violations == 2  # into the frame and out of it
    assert "momentum" in repr(report)


def test_a_repetition_finds_the_first_bit_that_differs(run: Path, tmp_path: Path) -> None:
    def last_bit(file: h5py.File) -> None:
        file["frames/velocity"][30, 1, 0] = np.nextafter(file["frames/velocity"][30, 1, 0], np.inf)

    (again,) = rerun(fault.planted(run, tmp_path / "bit", last_bit))
    assert [d.dataset for d in again.differences] == ["frames/velocity"]
    assert again.first is not None
    assert (again.first.frame, again.first.step, again.first.body) == (30, 30, "1")


def at_once(_: object) -> bool:
    raise KeyboardInterrupt


def step_by_step(scene: carom.Scene, path: Path, options: dict[str, Any]) -> None:
    sim = carom.Simulation(scene, **options)
    sim.step(34)
    sim.result().save(path)


def last_frame_lost(file: h5py.File) -> None:
    file["commit"][-1, 0] -= 1


#: How a run may end in its 34th step, which is off the grid of frames.
ENDS: dict[str, Any] = {
    "done": lambda scene, path, more: carom.simulate(scene, out=path, **{**more, "until": 0.034}),
    "stopped": lambda scene, path, more: carom.simulate(
        scene, out=path, stop=lambda _: True, callback_every=34, **more
    ),
    "interrupted": lambda scene, path, more: carom.simulate(
        scene, out=path, callback=at_once, callback_every=34, **more
    ),
    "step by step": step_by_step,
}


@pytest.mark.parametrize("end", ENDS)
def test_a_run_that_ends_off_the_grid_of_frames_is_repeated_to_its_end(end: str, tmp_path: Path) -> None:
    """With walls and contacts, which the bare last state has not; a process that was killed leaves no last state."""
    path = tmp_path / "run"
    with contextlib.suppress(KeyboardInterrupt):
        ENDS[end](scenes.pile(), path, {"step": 1e-3, "every": 10, "until": 0.1, "walls": True})
    (again,) = rerun(path)
    assert not again.differences
    if end == "interrupted":
        killed = fault.planted(path, tmp_path / "killed", last_frame_lost)
        about = json.loads((killed / "run.json").read_text())
        (killed / "run.json").write_text(json.dumps({**about, "status": "running", "outcome": None}))
        with pytest.warns(UnfinishedRun, match="4 frames"):  # of 5
            carom.load(killed).close()
        (again,) = rerun(killed)
        assert not again.differences


def test_a_run_that_records_little_is_not_said_to_keep_what_was_not_judged(tmp_path: Path) -> None:
    path = scenes.run(scenes.pile(), tmp_path / "bare", 0.1, contacts=False, impacts=False, every=10)
    report = audit.check(path)
    assert report.ok, repr(report)
    for kind in ("friction cone", "impact", "energy balance"):
        assert report[kind].word == "not judged"
        assert "[record]" in report[kind].unjudged[0].cure


@pytest.mark.parametrize("what", ["nowhere", "."])
def test_what_is_no_run_is_bad_input(what: str, tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    path = tmp_path / "empty" if what == "." else tmp_path / "no.h5"
    code, text, error = called(path)
    assert (code, text) == (2, "")
    assert error.startswith("carom: ")
    assert error.count("\n") == 1


def test_options_that_do_not_fit_are_refused(run: Path) -> None:
    assert called(run, "--set", "step=1e-4")[0] == 2
    assert called(run, "--threads", "many")[0] == 2
    assert called(run / "scenario.toml", "--rerun")[0] == 2


def test_a_tolerance_that_was_changed_within_the_run_is_taken_at_its_loosest(tmp_path: Path) -> None:
    path = scenes.run(scenes.two_balls(), tmp_path / "two", 0.03)
    carom.resume(path, until=0.05, tolerance=1e-6).close()
    carom.resume(path, until=0.06, tolerance=1e-9).close()
    code, text, _ = called(path)
    assert code == 0, text
    with carom.load(path) as result:
        run = Run(result)
        assert run.claimed["tolerance"] == 1e-6
        # What the run shows is no worse than by the default.
        assert run.loosest["tolerance"] == 1e-8


FORMULAS = [
    "0.01 + 0.1*exp(-v)",
    "-v^2 + 2^3^2",
    "min(v, 0.5, 2*v)/max(1, v)",
    "atan2(v, 1 + v)*sqrt(v + 1)",
    "sin(20*v)**2",
    "abs(v - 0.3)*sign(v - 0.3) + floor(3*v)*0",
    "ln(1 + v) - log10(2 + v)",
    "pi*cos(v)/(1 + tan(v/3))",
    "PI*v + 007 - 01.50*v",
    "v\n + 1e-3*v - .5 + 2.",
]


@pytest.mark.parametrize(
    "form", [("table", [[-1.0, 5.0], [0.3, 5.0], [1.0, 1.5]]), ("expression", "5 - max(0, 5*(x - 0.3))")]
)
def test_at_a_kink_there_are_two_slopes(form: tuple[str, object]) -> None:
    for x in (0.3, 0.1 + 0.2, 1000 * 3e-4):  # as steps reach it
        at = np.array([0.1, x, 0.9])
        assert law(form, at)[1] == pytest.approx([0.0, -5.0, -5.0])
        assert law(form, at, before=True)[1] == pytest.approx([0.0, 0.0, -5.0])
    ends = ("expression", "(1 - x)^1.5")
    assert law(ends, np.array([1.0]))[1] == 0.0
    folded = ("expression", "abs(x - 0.3)")
    assert [law(folded, np.array([0.3]), before=b)[1][0] for b in (True, False)] == [-1.0, 1.0]


@pytest.mark.parametrize("text", FORMULAS)
def test_formulas_are_read_as_the_core_reads_them_and_slopes_are_their_derivatives(text: str) -> None:
    x = np.linspace(0.06, 0.95, 7)  # not at a kink
    value, slope = law(("expression", text), x)
    wanted = [value_at({"expression": text}, float(t)) for t in x]
    np.testing.assert_allclose(value, wanted, rtol=1e-14)
    step = 1e-6
    ahead, behind = (law(("expression", text), x + s)[0] for s in (step, -step))
    np.testing.assert_allclose(slope, (ahead - behind) / (2 * step), rtol=1e-6, atol=1e-8)
