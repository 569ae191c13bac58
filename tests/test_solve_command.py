"""`carom solve`: what it prints and writes, and what it refuses, with a NumPy solver in the place of the core's."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import solve_cases
from carom import ContactProblem
from carom.problem import GlobalProblem, write_fclib
from solve_cases import unlucky
from solver_double import RULE, install, sweeps
from test_cli import Answer, cli

double = solve_cases.double
folder = solve_cases.folder


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("double")
def test_one_file_is_told_in_full(folder: Path) -> None:
    answer = cli("solve", folder / "a.hdf5")
    lines = answer.stdout.splitlines()
    assert lines[0] == "seed 1 (a.hdf5)"
    assert lines[1].startswith("solved: err = ")
    told = {line.split()[0]: line for line in lines[2:]}
    assert told["problem"].split("  ")[-1].strip() == "local form, 4 contacts of 3 rows"
    assert told["W"].endswith("12 rows, 144 entries; rank 12, nullity 0")
    assert told["solver"].split()[1] == "auto,"
    assert "worst" in told
    assert told["sweep"].endswith("few contacts")
    assert answer.stderr == ""
    assert cli("solve", folder / "a.hdf5", "--quiet").stdout == ""


@pytest.mark.usefixtures("double")
def test_several_files_are_a_table(folder: Path) -> None:
    rows = cli("solve", folder).stdout.splitlines()
    assert rows[0] == "3 of 3 solved by auto to err <= 1e-08"
    assert " ".join(rows[2].split()) == "file contacts rows iterations time err finished by verdict"
    assert [row.split()[:3] for row in rows[4:7]] == [
        ["a.hdf5", "4", "12"],
        ["b.h5", "4", "20"],
        ["c.hdf5", "3", "9"],
    ]
    assert all(row.split()[-2:] == ["sweep", "solved"] for row in rows[4:7])
    pairs = cli("solve", folder, "--solver", "all").stdout.splitlines()
    assert pairs[0] == "6 of 6 solved to err <= 1e-08"
    assert pairs[4].split()[:4] == ["a.hdf5", "4", "12", "auto"]
    assert pairs[5].split()[0] == "sweeps"  # of the same file


def test_a_narrow_terminal_keeps_the_names(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)
    monkeypatch.setenv("COLUMNS", "70")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    from carom.cli.solutions import Attempt, _table

    done = [
        Attempt(Path("a_file_with_a_rather_long_name.hdf5"), {"contacts": 4, "rows": 12}, "auto", None, "no")
    ]
    sheet = _table(done, {"tolerance": 1e-8, "solvers": {"auto": {}, "sweeps": {}}})
    assert list(sheet.head) == ["file", "solver", "time", "err", "verdict"]


@pytest.mark.usefixtures("double")
def test_json_is_one_document_with_all_of_it(folder: Path) -> None:
    answer = cli("solve", folder, "--solver", "sweeps", "--solver", "auto,sweeps", "--json")
    document = json.loads(answer.stdout)
    assert answer.stderr == ""
    assert set(document) == {"tolerance", "threads", "interrupted", "results", "solvers", "files"}
    assert [(Path(r["file"]).name, r["solver"]) for r in document["results"]] == [
        (name, solver) for name in ("a.hdf5", "b.h5", "c.hdf5") for solver in ("sweeps", "auto")
    ]
    first = document["results"][0]
    assert first["verdict"] == "solved"
    assert first["err"] <= document["tolerance"] == 1e-8
    assert (first["contacts"], first["dimension"], first["rows"], first["form"]) == (4, 3, 12, "local")
    assert first["residual"]["worst"] in range(4)
    assert first["stages"][0]["why"] == "few contacts"
    assert set(document["solvers"]) == {"sweeps", "auto"}
    assert document["solvers"]["auto"]["solved"] == document["solvers"]["auto"]["problems"] == 3
    assert document["solvers"]["auto"]["within_10"] <= 1.0


def test_what_is_not_solved_gives_3(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(monkeypatch)
    one = cli("solve", folder / "a.hdf5", "--max-iterations", "1", code=3)
    assert "NOT SOLVED: err = " in one.stdout
    assert one.stderr.startswith("carom: a.hdf5: auto ends with err = ")
    several = cli("solve", folder, "--max-iterations", "1", "--json", code=3)
    document = json.loads(several.stdout)
    assert {r["verdict"] for r in document["results"]} == {"not solved"}
    assert document["code"] == 3
    assert document["solvers"]["auto"]["solved"] == 0
    install(monkeypatch, unlucky(r=np.full(12, np.nan)))
    assert json.loads(cli("solve", folder / "a.hdf5", "--json", code=3).stdout)["results"][0]["err"] is None


@pytest.mark.usefixtures("double")
def test_a_file_that_cannot_be_read_does_not_stop_the_others(folder: Path) -> None:
    (folder / "bad.h5").write_bytes(b"no HDF5")
    answer = cli(
        "solve", folder, "--max-iterations", "1", code=2
    )  # 2 before 3: bad input is the greater trouble
    bad = next(line for line in answer.stdout.splitlines() if line.startswith("bad.h5"))
    assert bad.split() == ["bad.h5", *"------", "refused"]
    assert sum("not solved" in line for line in answer.stdout.splitlines()) == 3
    assert f"refused: {folder / 'bad.h5'}: cannot be read" in answer.stdout
    assert answer.stderr.startswith(f"carom: {folder / 'bad.h5'}: cannot be read")
    document = json.loads(cli("solve", folder, "--json", code=2).stdout)
    assert [r["verdict"] for r in document["results"]] == ["solved", "solved", "refused", "solved"]
    assert document["code"] == 2
    assert document["results"][2]["error"] in document["error"]


def test_a_solver_that_refuses_a_problem_is_a_row(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def picky(*arguments: Any) -> dict[str, Any]:
        if arguments[4] == 5 and arguments[9] == "sweeps":
            raise ValueError("no rolling")
        return sweeps(*arguments)

    install(monkeypatch, picky)
    answer = cli("solve", folder, "--solver", "all", code=2)
    assert f"refused: {folder / 'b.h5'}: sweeps: no rolling" in answer.stdout
    last = [line.split() for line in answer.stdout.splitlines()[-2:]]
    assert [line[:4] for line in last] == [["auto", "3", "of", "3"], ["sweeps", "2", "of", "3"]]


def test_of_several_times_the_shortest_counts(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    times = [3.0, 1.0, 2.0]
    install(monkeypatch, lambda *arguments: {**sweeps(*arguments), "wall_s": times.pop(0)})
    document = json.loads(cli("solve", folder / "a.hdf5", "--repeat", "3", "--json").stdout)
    assert document["results"][0]["wall_s"] == 1.0
    assert not times


@pytest.mark.usefixtures("double")
def test_the_rule_of_auto(folder: Path) -> None:
    assert cli("solve", "--explain").stdout == RULE + "\n"
    assert json.loads(cli("solve", "--explain", "--json").stdout) == {"rule": RULE}
    one = cli("solve", folder / "a.hdf5", "--explain").stdout
    assert one.startswith(RULE + "\n\nseed 1")
    several = cli("solve", folder, "--explain").stdout
    assert several.startswith(RULE)
    assert several.count("few contacts") == RULE.count("few contacts") + 3
    assert "c.hdf5, auto\n" in several
    assert "give a file to solve" in cli("solve", code=2).stderr


@pytest.mark.usefixtures("double")
def test_profiles_and_their_numbers_are_written(folder: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib", reason="figures need matplotlib")
    out = tmp_path / "new" / "out"
    answer = cli("solve", folder, "--solver", "all", "-o", out, "--format", "svg,pdf")
    names = {"results.csv"} | {f"{n}.{s}" for n in ("profile", "times") for s in ("csv", "svg", "pdf")}
    assert {path.name for path in out.iterdir()} == names
    assert all(str(out / name) in answer.stdout for name in names)
    with open(out / "results.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6
    times = {(row["file"], row["solver"]): float(row["wall_s"]) for row in rows}
    with open(out / "profile.csv", newline="") as file:
        [*_, last] = csv.DictReader(file)
    worst = max(
        max(times[name, s] for s in ("auto", "sweeps")) / min(times[name, s] for s in ("auto", "sweeps"))
        for name in ("a.hdf5", "b.h5", "c.hdf5")
    )
    assert float(last["factor (1)"]) == pytest.approx(worst, rel=1e-12)
    assert float(last["share of auto (1)"]) == float(last["share of sweeps (1)"]) == 1.0
    assert "share of 3 problems solved" in (out / "profile.svg").read_text()
    alone = tmp_path / "alone"
    cli("solve", folder / "a.hdf5", "-o", alone)
    assert {path.name for path in alone.iterdir()} == {"results.csv"}
    assert "--format: 'gif' is no format" in cli("solve", folder, "-o", out, "--format", "gif", code=2).stderr


@pytest.mark.usefixtures("double")
def test_the_solution_of_one_file_is_written(folder: Path) -> None:
    answer = cli("solve", folder / "c.hdf5", "--solution", folder / "kept" / "s.hdf5")
    assert answer.stdout.splitlines()[-1] == str(folder / "kept" / "s.hdf5")
    with h5py.File(folder / "kept" / "s.hdf5") as file:
        r = file["solution/r"][()]
    assert ContactProblem.from_fclib(folder / "c.hdf5").residual(r).err < 1e-8
    before = (folder / "a.hdf5").read_bytes()
    taken = cli("solve", folder / "c.hdf5", "--solution", folder / "a.hdf5", code=2)
    assert "a.hdf5 exists already; give --force to replace it, or another name" in taken.stderr
    assert (folder / "a.hdf5").read_bytes() == before
    cli("solve", folder / "c.hdf5", "--solution", folder / "kept" / "s.hdf5", "--force")
    assert "nothing is drawn without -o" in cli("solve", folder / "c.hdf5", "--format", "svg", code=2).stderr
    assert "one file and one solver" in cli("solve", folder, "--solution", "s.h5", code=2).stderr
    refused = cli("solve", folder / "a.hdf5", "--solution", folder / "a.hdf5" / "s.h5", code=2)
    assert "cannot write" in refused.stderr


@pytest.mark.usefixtures("double")
def test_directories_of_runs_are_known(folder: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    (run / "problems").mkdir(parents=True)
    (run / "run.json").write_text("{}")
    (run / "results.h5").write_bytes(b"frames")
    (run / "failing_problem.h5").write_bytes((folder / "a.hdf5").read_bytes())
    (run / "problems" / "step_7.hdf5").write_bytes((folder / "b.h5").read_bytes())
    document = json.loads(cli("solve", run, "--json").stdout)
    assert [Path(r["file"]).name for r in document["results"]] == ["failing_problem.h5", "step_7.hdf5"]
    (tmp_path / "empty").mkdir()
    assert "no *.hdf5 or *.h5 in this directory" in cli("solve", tmp_path / "empty", code=2).stderr
    (tmp_path / "empty" / "run.json").write_text("{}")
    said = cli("solve", tmp_path / "empty", code=2).stderr
    assert "this run has no stored problems; carom run ... --save-problems STEPS stores them" in said


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--solver", "sweep"], "--solver: none is called 'sweep'; did you mean sweeps?"),
        (["--tol", "0"], "--tol: must be positive, found 0"),
        (["--tol", "nan"], "--tol: must be positive, found nan"),
        (["--time-limit", "0"], "--time-limit: must be positive, found 0"),
        (["--threads", "0"], "--threads"),
        (["--max-iterations", "-1"], "--max-iterations"),
    ],
)
def test_options_that_cannot_be_meant_are_refused(options: list[str], message: str, folder: Path) -> None:
    one_line(cli("solve", folder / "a.hdf5", *options, code=2), message)


# --- input that is ill posed ------------------------------------------------------------------------------------------


def one_line(answer: Answer, message: str) -> None:
    assert message in answer.stderr
    assert answer.stderr.count("\n") == 1
    assert "Traceback" not in answer.stderr


def changed(path: Path, change: Callable[[h5py.File], None]) -> None:
    with h5py.File(path, "r+") as file:
        change(file["fclib_local"])


def put(name: str, place: int, value: float) -> Callable[[Any], None]:
    def change(group: Any) -> None:
        group[name][place] = value

    return change


def swap(name: str, values: Any) -> Callable[[Any], None]:
    def change(group: Any) -> None:
        del group[name]
        group[name] = np.asarray(values)

    return change


@pytest.mark.usefixtures("double")
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("vectors/q", 3, np.nan), "q: nan as value 3 (from 0); all numbers must be finite"),
        (put("W/x", 5, np.inf), "W: inf as value 5 (from 0); all numbers must be finite"),
        (put("W/x", 1, 3.0), "W: unsymmetric by "),
        (put("W/x", 0, -3.0), "W: -3 on its diagonal, row 0 (from 0); it must be positive semidefinite"),
        (put("vectors/mu", 2, -0.1), "mu: -0.1 at contact 2 (from 0); bounds are 0 or positive"),
        (swap("vectors/q", np.ones(11)), "W (m, n): 12 x 12; with vectors of this length it must be 11 x 11"),
        (
            swap("vectors/mu", np.ones(5)),
            "q: 12 rows for 5 contacts; every contact has the same number of rows",
        ),
        (swap("W/p", np.arange(5)), "W: 5 starts of 12 rows; there must be 13"),
        (swap("spacedim", [7]), "fclib_local/spacedim: 7; 2 or 3 are known"),
    ],
)
def test_ill_posed_files_are_refused_in_one_line(
    change: Callable[[Any], None], message: str, folder: Path
) -> None:
    path = folder / "a.hdf5"
    changed(path, change)
    answer = cli("solve", path, code=2)
    one_line(answer, message)
    assert answer.stderr.startswith(f"carom: {path}: ")
    assert ";" in answer.stderr.removeprefix(f"carom: {path}: ")  # a cure
    assert answer.stdout == ""
    document = json.loads(cli("solve", path, "--json", code=2).stdout)
    assert (document["code"], document["results"][0]["verdict"]) == (2, "refused")


@pytest.mark.usefixtures("double")
def test_files_that_are_none_are_refused_in_one_line(folder: Path) -> None:
    whole = (folder / "a.hdf5").read_bytes()
    (folder / "cut.hdf5").write_bytes(whole[: len(whole) // 2])
    one_line(cli("solve", folder / "cut.hdf5", code=2), "is it an HDF5 file, and whole?")
    one_line(cli("solve", folder / "none.hdf5", code=2), "no such file; name an HDF5 file")
    with h5py.File(folder / "other.hdf5", "w") as file:
        file["frames"] = np.zeros(3)
    one_line(cli("solve", folder / "other.hdf5", code=2), "no contact problem (there is frames)")
    heavy = GlobalProblem(M=np.diag([1.0, 2.0, 1.0]), H=np.eye(3), f=np.ones(3), w=np.ones(3), mu=[0.3])
    write_fclib(heavy, folder / "massless.hdf5")
    with h5py.File(folder / "massless.hdf5", "r+") as file:
        file["fclib_global/M/x"][1] = 0.0
    one_line(cli("solve", folder / "massless.hdf5", code=2), "M: singular in row 1 (from 0)")


@pytest.mark.usefixtures("double")
def test_what_is_doubtful_is_told_and_solved(folder: Path) -> None:
    changed(folder / "a.hdf5", lambda group: put("W/x", 1, group["W/x"][1] + 1e-5)(group))
    answer = cli("solve", folder / "a.hdf5")
    assert answer.stderr.startswith(f"carom: warning: {folder / 'a.hdf5'}: W is unsymmetric by ")
    assert answer.stderr.count("\n") == 1
    for k in range(5):
        (folder / f"a{k}.hdf5").write_bytes((folder / "a.hdf5").read_bytes())
    lines = cli("solve", folder).stderr.splitlines()
    assert len(lines) == 4
    assert lines[-1] == "carom: warning: and 3 more such; --json lists them"
