"""The command line: what it prints, where, and with which exit code."""

from __future__ import annotations

import io
import json
import os
import pty
import re
import signal
import subprocess
import sys
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple

import carom
import numpy as np
import pytest
from carom.cli import main
from carom.cli.options import settings
from carom.cli.output import seconds
from carom.cli.progress import facts
from carom.reproduce.demo import Row, as_table
from carom.run.sinks import Progress

COMMANDS = ["demo", "run", "resume", "check", "plot", "view", "info", "schema", "doctor", "cite"]
COMMANDS += ["play", "compare", "converge", "reproduce", "solve", "examples list", "examples copy"]


class Answer(NamedTuple):
    stdout: str
    stderr: str


def cli(*arguments: str | Path, cwd: Path | None = None, code: int = 0) -> Answer:
    """Call `carom` in this process, as its entry point does."""
    out, err = io.StringIO(), io.StringIO()
    with chdir(cwd or Path()), redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as left:
        main([str(a) for a in arguments])
    answer = Answer(out.getvalue(), err.getvalue())
    assert (left.value.code or 0) == code, answer.stderr
    return answer


def process(
    *arguments: str | Path, cwd: Path | None = None, code: int = 0
) -> subprocess.CompletedProcess[str]:
    """Call `carom` in a process of its own; no answer may be a traceback."""
    command = [sys.executable, "-m", "carom", *map(str, arguments)]
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    return done


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a scenario, and its run in `runs/three_balls-1`."""
    root = tmp_path_factory.mktemp("cli")
    cli("examples", "copy", "three_balls", cwd=root)
    cli("run", "three_balls.toml", cwd=root)
    return root


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(command: str) -> None:
    text = cli(*command.split(), "--help").stdout
    assert f"Example: carom {command}" in text


def test_help_and_version() -> None:
    listed = cli("--help").stdout
    for command in COMMANDS:
        assert f"\n  {command.split()[0]} " in listed
    assert cli("--version").stdout == f"carom {carom.__version__}\n"
    assert "No such command 'rnu'" in cli("rnu", code=2).stderr


# --- run ------------------------------------------------------------------------------------------------------------


def test_run_sums_up_on_standard_output_and_is_quiet_on_standard_error(runs: Path) -> None:
    done = process("run", "three_balls.toml", cwd=runs)
    assert done.stderr == ""
    lines = done.stdout.splitlines()
    assert lines[0] == "Three touching balls, frictionless"
    assert lines[1].startswith("done: ")
    for word in (
        "events",
        "iterations",
        "impact problems",
        "energy",
        "penetration",
        "time by phase",
        "files",
        "next",
    ):
        assert any(line.startswith(word) for line in lines), word
    assert max(map(len, lines)) <= 110
    directory = runs / lines[-2].split()[1]
    assert directory.name.startswith("three_balls-")
    assert {p.name for p in directory.iterdir()} >= {"scenario.toml", "run.json", "results.h5", "log.jsonl"}
    assert cli("run", "three_balls.toml", "--quiet", cwd=runs).stdout == ""


KEYS = [
    "scenario",
    "method",
    "step",
    "steps",
    "outcome",
    "wall_s",
    "core_s",
    "phases",
    "iterations",
    "line_search",
]
KEYS += [
    "impact_problems",
    "unconverged",
    "fallbacks",
    "truncated_sequences",
    "energy",
    "penetration_max",
    "bodies",
]


def test_run_json_holds_what_the_contract_lists(runs: Path) -> None:
    done = cli("run", "three_balls.toml", "--json", "-o", "j", "--set", "tolerance=1e-7", cwd=runs)
    document = json.loads(done.stdout)
    assert set(KEYS) <= set(document)
    assert document["scenario"] == "three_balls.toml"
    assert document["outcome"] == "done"
    assert document["failure"] is None
    assert document["directory"] == "j"
    assert set(document["iterations"]) == {"smooth", "position", "velocity"}
    for counts in (*document["iterations"].values(), document["impact_problems"]):
        assert {"max", "mean"} <= set(counts)
    assert {"position", "velocity"} <= set(document["line_search"])
    assert {"initial", "final", "max_rise"} <= set(document["energy"])
    result = carom.load(runs / "j")
    assert document["steps"] == len(result.steps)
    assert set(document["bodies"]) == set(result.names)
    for name, body in document["bodies"].items():
        for quantity in ("position", "orientation", "velocity", "angular_velocity"):
            assert np.array_equal(body[quantity], getattr(result[name], quantity)[-1])
    assert result.summary["energy"] == document["energy"]
    assert "tolerance = 1e-07" in result.scenario


def test_three_balls_give_what_the_sequence_says(runs: Path) -> None:
    """The example that comes with Carom: one in, one out."""
    velocity = carom.load(runs / "runs" / "three_balls-1").velocity[-1]
    assert velocity[:, 0] == pytest.approx([0.0, 0.0, 2.0], abs=1e-8)


def test_settings_are_toml_or_text() -> None:
    assert settings(
        ["run.step=1e-4", "record.every = 3", "impact=one-shot", 'until="2 s"', "line_search=false"]
    ) == {
        "step": 1e-4,
        "every": 3,
        "impact": "one-shot",
        "until": "2 s",
        "line_search": False,
    }


def test_an_existing_run_is_refused(runs: Path) -> None:
    cli("run", "three_balls.toml", "-o", "here", "--quiet", cwd=runs)
    told = cli("run", "three_balls.toml", "-o", "here", cwd=runs, code=2)
    assert (
        told.stderr
        == "carom: here exists already; give --force (force=True in Python) to replace it, or another directory\n"
    )
    assert told.stdout == ""
    cli("run", "three_balls.toml", "-o", "here", "--force", "--until", "10 ms", "--quiet", cwd=runs)
    assert carom.load(runs / "here").time[-1] == pytest.approx(0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "absent.toml"], "absent.toml: no such file"),
        (["run", "three_balls.toml", "--set", "step"], "not KEY=VALUE"),
        (["run", "three_balls.toml", "--set", "stpe=1"], "write step="),
        (
            ["run", "three_balls.toml", "--set", "run.step=1e-3", "--set", "step=2e-3"],
            "--set step: --set run.step sets step, too; leave out one of the two",
        ),
        (
            ["run", "three_balls.toml", "--set", "until=0.2", "--until", "0.3"],
            "--until: --set until sets until, too",
        ),
        (["run", "three_balls.toml", "--set", "step=1", "--set", "step=1"], "--set step: is given twice"),
        (["run", "three_balls.toml", "--case", "a", "--case", "b"], "--case is given twice; leave out one"),
        (["plot", "absent", "-o", "x", "--step", "1", "--out", "y"], "--out is given twice"),
        (["run", "three_balls.toml", "--until", "2 kg"], "--until: expected a time"),
        (["run", "three_balls.toml", "--set", "step=-1"], "--set step: must be positive"),
        (["run", "three_balls.toml", "--set", "dt=1"], "--set dt: unknown option; write step="),
        (
            ["run", "three_balls.toml", "--set", "step=10", "--until", "0.1"],
            "--until: until = 0.1 s is shorter",
        ),
        (["run", "three_balls.toml", "-o", "three_balls.toml"], "is a file"),
        (["run", "three_balls.toml", "-o", "three_balls.toml/x"], "cannot create the run directory"),
        (["run", "."], "."),
        (["check", "absent.toml"], "absent.toml: no such file"),
        (["check", "runs"], "runs is not a run directory"),
        (["resume", "absent"], "absent: no such run directory"),
        (["info", "."], "not a run directory"),
        (["check", ""], "SCENARIO|RUN: the path is empty; name a file or a directory"),
        (["info", ""], "RUN: the path is empty"),
        (["solve", ""], "FILE...: the path is empty"),
        (["export", "runs/three_balls-1", "-o", ""], "--out: the path is empty"),
        (["examples", "copy", "three_balls", ""], "the path is empty"),
        (["plot", "absent"], "absent: no such run directory"),
        (["plot", "runs/three_balls-1", "--what", "velocity"], "did you mean velocities?"),
        (["plot", "runs/three_balls-1", "--format", "jpg"], "no format is called 'jpg'"),
        (
            ["plot", "runs/three_balls-1", "--what", "velocities", "--bodies", "nobody"],
            "no body is called 'nobody'",
        ),
        (
            ["plot", "runs/three_balls-1", "--what", "residuals", "--step", "99999"],
            "no residuals were recorded",
        ),
        (["plot", "runs/three_balls-1", "--what", ","], "--what: ',' names nothing; name one or more"),
        (["plot", "runs/three_balls-1", "--what", "impacts", "--what", ""], "--what: '' names nothing"),
        (["plot", "runs/three_balls-1", "--format", ","], "--format: ',' names nothing"),
        (["plot", "runs/three_balls-1", "--bodies", " , "], "--bodies: ' , ' names nothing"),
        (["export", "runs/three_balls-1", "--format", ","], "--format: ',' names nothing"),
        (["check", "runs/three_balls-1", "--threads", ","], "--threads: ',' names nothing"),
        (["solve", ".", "--solver", ","], "--solver: ',' names nothing"),
        (["compare", "three_balls.toml", "--methods", ","], "--methods: ',' names nothing"),
        (["converge", "three_balls.toml", "--reference", "1e-5", "--steps", ","], "--steps: ',' names"),
        (["view", "absent"], "absent: no such run directory"),
        (["view", "runs/three_balls-1", "-o", "three_balls.toml/x.html"], "three_balls.toml"),
        (
            ["view", "runs/three_balls-1", "-o", "three_balls.toml"],
            "three_balls.toml exists already; give --force",
        ),
        (["view", "runs/three_balls-1", "-o", "runs"], "runs is a directory; name a file, as runs/view.html"),
        (["view", "runs/three_balls-1", "--max-mb", "0.65"], "give --max-mb (max_mb in Python) at least 0."),
        (["view", "runs/three_balls-1", "-o", "three_balls.toml/x"], "a part of the path is a file"),
        (["plot", "runs/three_balls-1", "-o", "three_balls.toml/x"], "a part of the path is a file"),
        (["examples", "copy", "corner", "/proc/x.toml"], "cannot write /proc/x.toml: "),
        (["run", "three_balls.toml", "-o", "/dev/full/x"], "cannot create the run directory /dev/full/x: "),
        (["examples", "copy", "three_bals"], "did you mean three_balls?"),
        (["examples", "copy", "throw"], "did you mean paper/5.3_throw or paper/A_thrown?"),
        (["examples", "copy", "three_balls"], "exists already"),
    ],
)
def test_bad_input_is_one_line_and_code_2(arguments: list[str], words: str, runs: Path) -> None:
    before = sorted(p.name for p in (runs / "runs").iterdir())
    done = cli(*arguments, cwd=runs, code=2)
    assert words in done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    assert sorted(p.name for p in (runs / "runs").iterdir()) == before  # and nothing is left behind


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["runn"], "No such command 'runn'"),
        (["run", "--bad"], "No such option: --bad; carom run --help explains it"),
        (["run"], "Missing argument"),
        (["run", "x.toml", "--set", "step"], "'step' is not KEY=VALUE"),
        (["view", "x", "--max-mb", "many"], "Invalid value for '--max-mb'"),
        (["view", "x", "--port", "5"], "--port: a page has no port; add --live"),
        (["view", "x", "--live", "--open"], ": --live writes no page; leave one of them out"),
        (["examples", "copi"], "No such command 'copi'"),
    ],
)
def test_a_misused_command_line_is_one_line_and_a_document(arguments: list[str], words: str) -> None:
    told = cli(*arguments, code=2)
    assert words in told.stderr
    assert told.stderr.startswith("carom: ")
    assert told.stderr.count("\n") == 1
    assert told.stdout == ""
    told = cli(*arguments, "--json", code=2)
    assert told.stderr.count("\n") == 1
    document = json.loads(told.stdout)
    assert document["code"] == 2
    assert words in document["error"]


@pytest.mark.parametrize("arguments", [["run", "absent.toml"], ["info", "absent"], ["check", "absent.toml"]])
def test_with_json_an_error_is_a_document_too(arguments: list[str], runs: Path) -> None:
    document = json.loads(cli(*arguments, "--json", cwd=runs, code=2).stdout)
    assert document["code"] == 2
    assert "absent" in document["error"]


def test_a_step_that_is_not_solved_has_code_3(runs: Path) -> None:
    # One iteration is not enough for three balls at once, and the chain of rescues is switched off.
    limits = ["max_iterations=1", "gauss_seidel_sweeps=0", "max_halvings=0", "tolerance=1e-15"]
    options = [part for limit in limits for part in ("--set", limit)]
    cli("examples", "copy", "5.6_break", "--force", cwd=runs)
    done = cli("run", "5.6_break.toml", "-o", "hard", "--json", *options, cwd=runs, code=3)
    document = json.loads(done.stdout)
    assert document["outcome"] == "not_converged"
    assert document["failure"]["step"] == document["steps"] + 1
    assert document["failure"]["advice"]
    told = done.stderr.splitlines()[-1]
    assert told.startswith("carom: not converged at step ")
    result = carom.load(runs / "hard")
    assert result.status == "failed"
    assert len(result.steps) == document["steps"]
    assert all(name in (*result.names, *result.plane_names) for name in result.outcome.bodies)
    assert "problem is in failing_problem.h5" in told
    assert "was kept" not in told


def test_a_run_that_failed_goes_on_with_other_numerical_options(runs: Path) -> None:
    cli("examples", "copy", "5.6_break", "--force", cwd=runs)
    # The impact after 0.114 s needs 6 iterations, all before it one.
    hard = ["max_iterations=3", "gauss_seidel_sweeps=0", "max_halvings=0", "record.every=50"]
    options = [part for limit in hard for part in ("--set", limit)]
    cli("run", "5.6_break.toml", "-o", "stuck", "--until", "0.2", "--quiet", *options, cwd=runs, code=3)
    failed = carom.load(runs / "stuck")
    last = failed.outcome.step
    assert last is not None
    assert last > 100
    assert failed.step[-1] == last - 1
    assert (runs / "stuck" / f"checkpoint-{last - 1:012d}.npz").exists()
    assert (
        "would fail there again; change how it is solved" in cli("resume", "stuck", cwd=runs, code=2).stderr
    )
    for wrong, words in (
        ("step=1e-4", "cannot change within a run, only until, tolerance, "),
        ("tol=1", "did you mean tolerance?"),
        ("contacts=false", "start a new run for it"),  # not "did you mean dense_contacts?"
        ("pile_tolerance=0", "carom: --set pile_tolerance: must be"),
    ):
        assert words in cli("resume", "stuck", "--set", wrong, cwd=runs, code=2).stderr
    cli("resume", "stuck", "--quiet", "--set", "max_iterations=50", cwd=runs)
    result = carom.load(runs / "stuck")
    assert result.outcome.ok
    assert result.step[:].tolist() == [0, 50, 100, 150, 200]
    assert json.loads((runs / "stuck" / "run.json").read_text())["changes"] == [
        {"after_step": last - 1, "options": {"max_iterations": [3, 50]}}
    ]
    assert "options changed" in (runs / "stuck" / "log.jsonl").read_text()
    cli("run", "5.6_break.toml", "-o", "easy", "--until", "0.2", "--quiet", "--set", "every=50", cwd=runs)
    assert np.array_equal(carom.load(runs / "easy").position[-1], result.position[-1])
    assert (
        cli("resume", "stuck", "--until", "0.21", "--quiet", cwd=runs).stderr == ""
    )  # the new scenario counts


def test_a_terminal_sees_a_progress_bar_that_goes_away(runs: Path) -> None:
    cli("examples", "copy", "5.6_break", "--force", cwd=runs)
    command = [sys.executable, "-m", "carom", "run", "5.6_break.toml", "-o", "bar", "--force"]
    command += ["--until", "0.1", "--set", "step=1e-6", "--set", "every=1000"]
    control, terminal = pty.openpty()
    environment = {**os.environ, "TERM": "xterm", "COLUMNS": "120"}
    bar = subprocess.Popen(
        command, cwd=runs, stdout=subprocess.PIPE, stderr=terminal, env=environment, text=True
    )
    os.close(terminal)
    seen = b""
    while True:
        try:
            part = os.read(control, 65536)
        except OSError:  # the other end is closed
            break
        if not part:
            break
        seen += part
    output, _ = bar.communicate(timeout=60)
    os.close(control)
    assert bar.returncode == 0
    text = seen.decode()
    assert "ETA 0:00:0" in text
    assert "contacts" in text
    assert "ETA" not in output


def test_the_facts_beside_the_bar_fit() -> None:
    now = Progress(123456789, 987654321, 12.3456789, 98.7, 123456, 12, 34, 5.0, 123456.0, 4e5)
    assert facts(now) == "t 12.35/98.7 s  step 123456789  123456 contacts  12+34 it  123k/s  ETA 111:06:40"
    assert facts(now, 80) == "t 12.35/98.7 s  123k steps/s  ETA 111:06:40"
    assert "ETA 0:00:00" in facts(Progress(1, 2, 0.0, 1.0, 0, 0, 0, 1.0, 0.0, float("inf")))


def test_balls_that_outrun_the_step_are_among_the_troubles(runs: Path) -> None:
    cli("examples", "copy", "slide_to_roll", "--force", cwd=runs)
    done = cli("run", "slide_to_roll.toml", "-o", "fast", "--set", "step=0.05", "--until", "0.5", cwd=runs)
    assert "troubles    balls moved up to 3" in done.stdout
    assert "radii in a step, impacts may be missed" in done.stdout
    calm = cli("run", "slide_to_roll.toml", "-o", "calm", cwd=runs).stdout
    assert "troubles    none" in calm
    assert "up to 1 contact closed at once" in calm


# --- the other commands ---------------------------------------------------------------------------------------------


def test_resume_extends_and_says_so(runs: Path) -> None:
    cli("run", "three_balls.toml", "-o", "ext", "--until", "0.05", "--quiet", cwd=runs)
    document = json.loads(cli("resume", "ext", "--until", "100 ms", "--json", cwd=runs).stdout)
    assert document["outcome"] == "done"
    assert document["time"] == pytest.approx(0.1)
    assert carom.load(runs / "ext").segment_names == ["results.h5", "results-0002.h5"]
    assert json.loads(cli("resume", "ext", "--json", cwd=runs).stdout)["steps"] == document["steps"]


def test_info_names_the_shapes_of_walls_that_are_no_planes_without_end(tmp_path: Path) -> None:
    scene = carom.Scene("t", run={"until": 1e-3, "step": 1e-3})
    scene.plane("bed", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    scene.plane("disc", material="m", point=(0, 0, 0), normal=(0, 0, 1), radius=0.1)
    scene.box("box", material="m", low=(-1, -1, -1), high=(1, 1, 1), finite=True)
    scene.sphere("a", radius=0.01, mass=1.0, at=(0, 0, 0.1), material="m")
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    carom.simulate(scene, out=tmp_path / "run")
    text = cli("info", "run", cwd=tmp_path).stdout
    assert re.search(r"^planes +1\nother walls +7 \(disc 1, rectangle 6\)$", text, re.M)
    facts_ = json.loads(cli("info", "run", "--json", cwd=tmp_path).stdout)
    assert (facts_["planes"], facts_["other_walls"]) == (1, 7)


def test_info(runs: Path) -> None:
    text = cli("info", "runs/three_balls-1", cwd=runs).stdout
    assert re.search(r"^status +done$", text, re.M)
    assert re.search(r"^unconverged steps +0$", text, re.M)
    facts_ = json.loads(cli("info", "runs/three_balls-1", "--json", cwd=runs).stdout)
    assert facts_["bodies"] == 3
    assert facts_["segments"] == ["results.h5"]
    assert facts_["being_written"] is False
    assert "stored_problems" not in facts_
    assert "inertia (kg m^2)" in text


def test_missed_impacts_are_told_with_their_steps(tmp_path: Path) -> None:
    """The summary said "20 impacts missed" and the auditor "16 steps"."""
    cli("examples", "copy", "pile", cwd=tmp_path)
    said = cli("run", "pile.toml", "-o", "pile", "--set", "N=100", "--set", "step=2e-3", cwd=tmp_path).stdout
    missed = np.asarray(carom.load(tmp_path / "pile").steps["missed_impacts"])
    assert missed.max() > 0
    assert f"{missed.sum()} impacts missed in {(missed > 0).sum()} steps" in said


def test_stored_problems_are_counted_and_weighed(runs: Path) -> None:
    said = cli("run", "three_balls.toml", "-o", "stored", "--save-problems", "all", cwd=runs).stderr
    kept = sorted((runs / "stored" / "problems").iterdir())
    megabytes = sum(path.stat().st_size for path in kept) / 1e6
    assert kept
    assert f"{len(kept)} contact problem" in said
    assert f"{megabytes:.3g} MB" in said
    assert "warning: --save-problems" not in said
    assert json.loads(cli("info", "stored", "--json", cwd=runs).stdout)["stored_problems"] == len(kept)
    late = cli("run", "three_balls.toml", "-o", "late", "--save-problems", "9999999", cwd=runs).stderr
    assert "--save-problems: the run ended at step 200, before 9999999; choose steps up to 200" in late


def test_check(runs: Path) -> None:
    assert "three_balls.toml: ok" in cli("check", "three_balls.toml", cwd=runs).stdout
    document = json.loads(cli("check", "three_balls.toml", "--json", cwd=runs).stdout)
    assert document["ok"] is True
    assert document["bodies"] == 3
    (runs / "bad.toml").write_text((runs / "three_balls.toml").read_text().replace("mass", "mas"))
    told = cli("check", "bad.toml", cwd=runs, code=2).stderr
    assert "did you mean mass?" in told
    problems = json.loads(cli("check", "bad.toml", "--json", cwd=runs, code=2).stdout)["problems"]
    assert all(p["line"] for p in problems)


def test_examples_run_as_they_come(tmp_path: Path) -> None:
    listed = json.loads(cli("examples", "list", "--json").stdout)
    names = [entry["name"] for entry in listed]
    assert {"paper/5.6_break", "paper/5.6_break_rolling", "three_balls"} <= set(names)
    assert all(entry["title"] for entry in listed)
    assert "three_balls" in cli("examples", "list").stdout
    copied = cli("examples", "copy", "paper/5.6_break", "mine.toml", cwd=tmp_path).stdout
    assert copied == "mine.toml  (carom run mine.toml)\n"
    assert (tmp_path / "mine.toml").exists()


def test_schema_is_json() -> None:
    assert "properties" in json.loads(cli("schema").stdout)


def test_doctor_finds_nothing_wrong() -> None:
    document = json.loads(cli("doctor", "--json").stdout)
    assert document["ok"] is True
    assert {f["name"] for f in document["findings"] if f["ok"]} >= {
        "compiled core",
        "results file",
        "a short run",
    }


def test_cite() -> None:
    assert f"version = {{{carom.__version__}}}" in cli("cite").stdout
    assert json.loads(cli("cite", "--json").stdout)["version"] == carom.__version__


def test_what_is_cited_is_what_a_scene_uses() -> None:
    from carom._core import choices
    from carom.reproduce.citations import FORCE_LAWS, SOURCES, sources

    assert set(FORCE_LAWS) == set(choices()["penalty_law"])
    spring = carom.example("three_balls").with_options(method="penalty", penalty_law="flores")
    assert sources(spring) == {"method": SOURCES["method"], "penalty": FORCE_LAWS["flores"]}
    assert "piles" in sources(carom.example("pile"))
    assert "piles" not in sources(carom.example("5.6_break"))


def test_view_writes_a_page(runs: Path) -> None:
    document = json.loads(cli("view", "runs/three_balls-1", "--json", cwd=runs).stdout)
    page = runs / document["file"]
    assert page == runs / "runs" / "three_balls-1" / "view.html"
    assert page.stat().st_size == document["bytes"]
    assert page.read_text(encoding="utf-8").lstrip().lower().startswith("<!doctype html>")


def test_a_reader_that_leaves_is_no_error(runs: Path) -> None:
    line = f"{sys.executable} -m carom schema | head -n 1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", line], capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr, done.returncode) == ("{\n", "", 0)


def test_the_demo_computes_what_it_shows(tmp_path: Path) -> None:
    document = json.loads(cli("demo", "--no-plots", "--json", "-o", "d", cwd=tmp_path).stdout)
    assert set(document["cases"]) == {"5.6_break", "5.6_break_rolling"}
    for case, found in document["cases"].items():
        rows = {row["quantity"]: row for row in found["rows"]}
        contact = rows["contact of balls 2 and 3 (s)"]
        assert contact["value"] == pytest.approx(0.1142, abs=5e-5)
        assert rows["speed of ball 2 there (m/s)"]["value"] == pytest.approx(10.505, abs=5e-4)
        for quantity in ("ball 2 after the impact", "ball 3 after the impact", "balls 4 and 5 mirror images"):
            assert rows[quantity]["difference"] == "agrees", (case, quantity)
        assert all((tmp_path / f).exists() for f in found["files"])
        assert contact["exact"] == contact["carom"]
        speeds = [float(rows["ball 2 after the impact"][name].split()[0]) for name in ("carom", "exact")]
        assert 0.0 < abs(speeds[0] - speeds[1]) < 0.1, case  # the error of the step
        assert not rows["iterations, velocity: max / mean"]["exact"]
    rest = [r for r in document["cases"]["5.6_break_rolling"]["rows"] if r["quantity"].endswith("at rest")]
    assert len(rest) == 4
    assert all(row["carom"].startswith("t = ") for row in rest)
    orders = [
        next(r for r in found["rows"] if r["quantity"].startswith("convergence"))
        for found in document["cases"].values()
    ]
    assert orders[0]["difference"] == "agrees"
    assert orders[0]["value"] > 2.0
    # With rolling resistance discs are full at a tiny slip, and the quadratic phase is short: its end may be rounding.
    assert orders[1]["difference"] in ("agrees", "superlinear, next is rounding")
    assert 1.2 < orders[1]["value"] < 2.5
    text = cli("demo", "--no-plots", "-o", "d", cwd=tmp_path).stdout  # a second one replaces the first
    assert text.count("pure rolling at t = 3 s") == 1
    assert "3D page     d/5.6_break/view.html" in text


def test_the_table_of_the_demo_fits_a_narrow_terminal() -> None:
    """Its cells wrap between words; none is cut."""
    cells = (
        "contact of balls 2 and 3 (s)",
        "below 10.729 (exact 10.5051)",
        "slip at most 3e-33 m/s, 4 of 4",
        "agrees",
    )
    narrow, wide = (as_table([Row(*cells)] * 3, width) for width in (80, 160))
    assert max(map(len, narrow.splitlines())) <= 80
    for text in (narrow, wide):
        for cell in cells:
            for word in cell.split():
                assert text.count(word) >= 3, word
    assert len(wide.splitlines()) == 5  # head, rule, one line for each row


# --- costs and formats ----------------------------------------------------------------------------------------------


def test_a_whole_run_of_the_break_is_small(runs: Path) -> None:
    """150 MB are promised (its time is a matter of `make bench`)."""
    cli("examples", "copy", "5.6_break", "--force", cwd=runs)
    # The high-water mark of this program alone: ru_maxrss would hold that of the test runner it was forked from.
    measure = (
        "import sys; from carom.cli import main\ntry: main(['run', '5.6_break.toml', '--quiet'])\n"
        "finally: print(next(x for x in open('/proc/self/status') if x.startswith('VmHWM')), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", measure], cwd=runs, capture_output=True, text=True, check=False
    )
    assert int(done.stderr.split("VmHWM:")[-1].split()[0]) < 150_000, done.stderr  # kB


@pytest.mark.skipif(os.name != "posix", reason="processes end by signals elsewhere in other ways")
@pytest.mark.parametrize(
    ("at_the_end", "code"),
    [
        ("atexit.register(os.kill, os.getpid(), signal.SIGINT)", 0),  # while Python ends
        (
            "threading.Thread(target=lambda: (time.sleep(0.5), os.kill(os.getpid(), signal.SIGINT))).start()",
            0,
        ),
        # In what makes a dataclass, as at the import of a command: Python remembers that after -m, and ended itself.
        ("app.app = interrupted", 130),
    ],
)
def test_a_signal_at_the_very_end_leaves_the_exit_code(at_the_end: str, code: int, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(f"""import atexit, os, signal, sys, threading, time
import carom.cli.app as app
def interrupted(**_):
    exec("raise KeyboardInterrupt")
sys.argv = ["carom", "--version"]
{at_the_end}
from carom.cli import program
program()
""")
    command = [sys.executable, "-m", "program"]
    paths = os.pathsep.join(filter(None, [str(tmp_path), os.environ.get("PYTHONPATH")]))
    environment = {**os.environ, "PYTHONPATH": paths}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == code, done.stderr
    assert done.stderr == ""


@pytest.mark.parametrize("arguments", [None, ["--version"]])
def test_a_program_that_calls_the_command_keeps_its_signals(
    arguments: list[str] | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Ctrl-C was ignored for good in one that goes on after it."""
    monkeypatch.setattr("sys.argv", ["carom", "--version"])
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    with pytest.raises(SystemExit):
        main(arguments)
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers


def test_durations() -> None:
    assert [seconds(s) for s in (2e-6, 0.0123, 1.5, 119.0, 200.0, 7300.0)] == [
        "2 us",
        "12.3 ms",
        "1.5 s",
        "119 s",
        "3 min 20 s",
        "2 h 01 min",
    ]


def test_the_page_on_the_command_line_names_every_option() -> None:
    page = (Path(__file__).parent.parent / "docs" / "reference" / "cli.md").read_text(encoding="utf-8")
    told = {command: cli(*command.split(), "--help").stdout for command in COMMANDS}
    for command, text in told.items():
        options = re.findall(r"(--[a-z-]+)", text.partition("Options:")[2])
        for option in {*options} - {"--help"}:
            section = page.partition(f"### `carom {command}`")[2].partition("\n### ")[0]
            section = section or page.partition("### The others")[2]
            assert f"`{option}" in section, (command, option)
    for key in KEYS:
        assert f"`{key}`" in page
    for option in set(re.findall(r"`(--[a-z-]+)", page)):
        assert any(option in text for text in told.values()), option
