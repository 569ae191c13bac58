"""The bench of large piles: its scene, its judge of overlaps, copies of a heap, and what is said of the runs."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core

sys.path.insert(0, str(Path(__file__).parent.parent / "benches"))

import scale as bench
import scale_report as report
from _lammps_pile import time_step
from scale_carom import model, tiled, with_start
from scale_overlap import depth, kinetic, near_pairs
from scale_report import Row

PILE = Path(__file__).parent.parent / "scenarios" / "pile.toml"
R = 0.005


def told(seconds: float = 1.0, **more: Any) -> dict[str, Any]:
    """An answer of Carom whose three phases share `seconds` by their lengths."""
    counts = {"unconverged": 0, "truncated_sequences": 0, "fallbacks": 0, "halvings": 0}
    phases = [0.3 * seconds, 0.3 * seconds, 0.4 * seconds]
    found = {"version": "Carom 0", "time": 1.0, "step": 1e-3, "phases": phases, "cpu": seconds, "memory": 1e8}
    found |= {"deepest": 1e-5, "mean_end": 1e-6, "residual": 1e-4, "kinetic": 0.0, "counts": counts}
    return found | {"failure": None, "hash": "0123456789abcdef", "energy_rise": 0.0} | more


def row(grains: int = 1000, threads: int = 1, law: str = "sequence", **more: Any) -> Row:
    return Row("Carom", law, grains, threads, 1, 1.0, told=told(**more))


# --- the scene ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("grains", [3, 4, 15, 16, 100, 1000, 8000])
def test_the_scene_has_the_grains_that_were_ordered_and_none_overlap(grains: int) -> None:
    scene = carom.Scene.from_toml(PILE, parameters={"N": grains})
    assert scene.validate() == []
    assert len(set(scene.names)) == len(scene.names) == grains
    assert scene.names[-1] == f"grain{grains}"
    position = scene.to_model()["position"]
    assert depth(position, R, scene.parameters["side"]).contacts == 0


@pytest.mark.parametrize(("grains", "side"), [(1000, 0.0956), (8000, 0.191), (64_000, 0.382)])
def test_the_side_of_the_box(grains: int, side: float) -> None:
    scene = carom.Scene.from_toml(PILE, parameters={"N": grains})
    assert scene.parameters["side"] == pytest.approx(side, rel=2e-3)
    far = [plane.point for plane in scene.planes if max(plane.point) > 0]
    assert far == [(scene.parameters["side"], 0.0, 0.0), (0.0, scene.parameters["side"], 0.0)]


def test_seeds_are_other_jitters_of_the_same_lattice() -> None:
    one, two = (carom.Scene.from_toml(PILE, parameters={"seed": seed}) for seed in (1, 2))
    difference = one.to_model()["position"] - two.to_model()["position"]
    assert (np.abs(difference) < 2 * one.parameters["jitter"]).all()
    assert (difference != 0).all()


def test_a_broken_number_of_grains_is_refused() -> None:
    with pytest.raises(carom.ScenarioError, match="whole number"):
        carom.Scene.from_toml(PILE, parameters={"N": 1000.5})


# --- the judge ------------------------------------------------------------------------------------------------


def test_near_pairs_are_those_of_all_pairs() -> None:
    points = np.random.default_rng(3).uniform(-1, 1, (300, 3)) * [1.0, 0.3, 2.0]
    a, b = near_pairs(points, 0.2)
    found = {tuple(sorted(pair)) for pair in zip(a.tolist(), b.tolist())}
    distance = np.linalg.norm(points[:, None] - points[None], axis=2)
    assert len(found) == len(a)  # each once
    assert found == {(i, j) for i in range(300) for j in range(i + 1, 300) if distance[i, j] < 0.2}
    assert found


def test_depth_of_spheres_and_walls() -> None:
    inside = np.array([[5.0, 5.0, 1.0], [6.9, 5.0, 1.0], [5.0, 6.99, 1.0]])
    found = depth(inside, 1.0, 20.0)
    assert found.contacts == 2
    assert found.deepest == pytest.approx(0.1)
    assert found.mean == pytest.approx(0.055)
    for place, deep in (([5, 5, 0.7], 0.3), ([0.8, 5, 1], 0.2), ([5, 19.5, 1], 0.5)):
        assert depth(np.array([place], dtype=float), 1.0, 20.0).deepest == pytest.approx(deep)
    assert depth(np.array([[5.0, 5.0, 5.0]]), 1.0, 20.0).contacts == 0


def test_kinetic_energy_counts_in_lifts_by_a_radius() -> None:
    up, spin = np.array([[0.0, 0.0, 2.0]]), np.zeros((1, 3))
    assert kinetic(3.0, 0.1, up, spin) == pytest.approx(0.5 * 4 / (9.8 * 0.1))
    assert kinetic(3.0, 0.1, spin, up) == pytest.approx(0.5 * 0.4 * 0.01 * 4 / (9.8 * 0.1))


# --- copies of a heap -----------------------------------------------------------------------------------------


def test_copies_of_a_heap_do_not_overlap_and_are_a_scene() -> None:
    found, side = model(60, 1, {"step": 1e-3})
    simulation = _core.Simulation(found)
    simulation.advance(100, 0, False, 60.0)
    frame = simulation.frame()
    pressed = dict(frame) | {"position": frame["position"] - [0, 0, 1e-7]}  # an overlap to get rid of
    assert depth(pressed["position"], R, side).contacts > 0
    start, larger = tiled(pressed, (2, 2, 3), R, side)
    assert start["position"].shape == (720, 3)
    assert depth(start["position"], R, larger).deepest < 1e-12
    assert larger == pytest.approx(2 * side, rel=1e-4)
    np.testing.assert_array_equal(start["velocity"][60:120], frame["velocity"])
    whole, _ = model(720, 1, {"step": 1e-3})
    copies = _core.Simulation(with_start(whole, start, larger))
    assert copies.advance(3, 0, False, 60.0)["outcome"] is None
    assert depth(copies.frame()["position"], R, larger).deepest < 1e-4


def test_the_box_around_copies_is_square() -> None:
    with pytest.raises(ValueError, match="square"):
        tiled({"position": np.zeros((1, 3))}, (2, 3, 1), R, 1.0)


# --- runs -----------------------------------------------------------------------------------------------------


def parsed(monkeypatch: pytest.MonkeyPatch, *given: str) -> Any:
    monkeypatch.setattr(sys, "argv", ["scale.py", *given])
    return bench.arguments()


def height(grains: int, until: float) -> float:
    """Mean height in mm."""
    simulation = _core.Simulation(model(grains, 1, {"pile_tolerance": 1e-4})[0])
    simulation.advance(round(until / 1e-3), 0, False, 60.0)
    return 1e3 * float(simulation.frame()["position"][:, 2].mean())


def test_a_run_of_carom_and_peers_that_are_not_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("CAROM_LAMMPS_PYTHON", raising=False)
    monkeypatch.delenv("CAROM_YADE", raising=False)
    monkeypatch.delenv("CAROM_PECLET_PYTHON", raising=False)
    monkeypatch.setattr(bench, "PEERS", tmp_path / "bin" / "none")
    monkeypatch.setattr(bench.shutil, "which", lambda _: None)
    given = ("--sizes", "30", "--until", "0.02", "--threads", "1", "2", "--impact", "sequence")
    rows = list(bench.Bench(parsed(monkeypatch, *given), tmp_path).rows())
    peers = [
        "LAMMPS",
        "LAMMPS",
        "YADE",
        "YADE",
        "peclet-dem",
        "peclet-dem",
    ]  # two steps each, asleep and awake
    assert [r.program for r in rows] == ["Carom", *peers] * 2
    assert rows[0].complete
    assert rows[0].told["phases"][0] > 0
    assert rows[0].told["phases"][1:] == [0, 0]
    assert len(rows[0].cells()) == len(report.HEAD)
    (first, _) = report.heights(rows)
    assert (
        first == f"N = 30, 1 thread(s): mean height of the grains, mm: Carom sequence {height(30, 0.02):.1f}"
    )
    assert all("not installed" in r.why and not r.complete for r in rows if r.program != "Carom")
    assert any(line.endswith("same bits") for line in report.lines(rows))
    report.write_csv(rows, "here", tmp_path / "x.csv")
    with open(tmp_path / "x.csv", encoding="utf-8") as file:
        written = list(csv.DictReader(file))
    assert [line["program"] for line in written] == [r.program for r in rows]
    assert written[0]["hash"] == rows[0].told["hash"]


@pytest.mark.parametrize("name", ["LAMMPS", "peclet-dem"])
def test_a_small_pile_in_a_peer(name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The lowest grains reach the floor; those above them fall freely."""
    if isinstance(bench.peers()[name], str):
        pytest.skip(f"{name} is not installed (make .venv/peers/made)")
    given = ("--sizes", "30", "--until", "0.02", "--only", name.lower(), "--rayleigh", "0.2")
    start = model(30, 1, {})[0]["position"][:, 2]
    for found in bench.Bench(parsed(monkeypatch, *given), tmp_path).rows():
        assert found.complete, found.why
        fallen = start - np.load(tmp_path / "end.npz")["position"][:, 2]
        assert np.quantile(fallen, 0.9) == pytest.approx(0.5 * 9.8 * 0.02**2, rel=1e-4)


def test_steps_of_copies_of_a_heap(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(bench, "HEAP", 30)
    monkeypatch.setattr(bench, "COPIES", (2, 2, 1))
    monkeypatch.setattr(bench, "MILLION_STEPS", 3)
    given = ("--sizes", "--million", "--until", "0.02")
    heap, copies = bench.Bench(parsed(monkeypatch, *given), tmp_path).rows()
    assert heap.complete
    assert copies.complete
    assert (heap.grains, copies.grains) == (30, 120)
    (line,) = report.copies([heap, copies])
    assert line.startswith("N = 120, 1 thread(s): 3 steps of ")
    assert "below 3 GB met" in line
    assert "all steps met" in line
    # Another start than the others: no size among those that show how time grows.
    assert not any("120" in line for line in report.growth([heap, copies]))


def test_a_program_that_fails_is_told_with_its_last_words(tmp_path: Path) -> None:
    ask = {"told": str(tmp_path / "told.json"), "limit": 5.0, "threads": 1}
    line = [sys.executable, "-c", "raise SystemExit('no such grain')"]
    assert bench.answered(line, ask, tmp_path) == ({}, "ended with code 1: no such grain")


def test_the_memory_of_a_program_is_its_own(tmp_path: Path) -> None:
    """`ru_maxrss` of a program forked from this one held the memory of this one as well."""
    ballast = np.ones(40_000_000)  # 320 MB
    ask = {"told": str(tmp_path / "told.json"), "limit": 20.0, "threads": 1}
    program = (
        f"import sys, pathlib; sys.path.insert(0, {str(bench.HERE)!r}); from _memory import peak_memory; "
        f"pathlib.Path({ask['told']!r}).write_text('{{\"memory\": %d}}' % peak_memory())"
    )
    answer, why = bench.answered([sys.executable, "-c", program], ask, tmp_path)
    assert not why
    assert 1e6 < answer["memory"] < 100e6 < ballast.nbytes


def test_a_program_that_hangs_is_ended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(bench, "GRACE", 0.1)
    ask = {"told": str(tmp_path / "told.json"), "limit": 0.1, "threads": 1}
    line = [sys.executable, "-c", "import time; time.sleep(60)"]
    assert bench.answered(line, ask, tmp_path) == ({}, "ended after 0.2 s")


@pytest.mark.parametrize(
    ("program", "threads", "expected"),
    [
        ("LAMMPS", 1, ["/p/python"]),
        ("LAMMPS", 2, ["/p/mpiexec", "-n", "2", "/p/python"]),
        ("YADE", 2, ["/p/python", "-x", "-n", "-j2"]),
        ("peclet-dem", 2, ["/p/python", str(bench.HERE / "_peclet_pile.py")]),
    ],
)
def test_threads_of_the_peers(program: str, threads: int, expected: list[str]) -> None:
    line = bench.command(program, ["/p/python"], threads, "request.json")
    assert line[: len(expected)] == expected
    assert line[-1] == "request.json"


# --- what is said ---------------------------------------------------------------------------------------------


def test_growth_is_the_exponent_of_the_time_of_a_step() -> None:
    rows = [row(grains=n, seconds=2e-6 * n**1.1) for n in (1000, 8000, 64_000)]
    (line,) = report.growth(rows)
    assert "whole run 1.10, fall 1.10, settle 1.10, rest 1.10" in line
    assert report.growth(rows[:1]) == []


def test_floors_and_aims() -> None:
    (line,) = report.goals([row(seconds=2.0)])
    assert "6 s met, overlap 0.0001 r met, residual 0.0001 met, no unconverged step met" in line
    assert "aim of 1.5 s SHORT" in line
    counts = {"unconverged": 1, "truncated_sequences": 0, "halvings": 0}
    (line,) = report.goals([row(seconds=7.0, deepest=2e-4, residual=1e-3, counts=counts)])
    assert line.count("SHORT") == 5
    assert report.goals([row(law="one-shot"), row(grains=500), row(time=0.5)]) == []


def test_bits_that_differ_are_said_aloud() -> None:
    assert report.same_bits([row(), row(threads=2)]) == ["sequence, N = 1000: 1 and 2 threads, same bits"]
    (line,) = report.same_bits([row(), row(threads=2, hash="f" * 16)])
    assert line.endswith("BITS DIFFER")


def test_a_peer_stands_beside_carom_with_its_overlap() -> None:
    peer = Row("LAMMPS", "soft", 1000, 1, 1, 1.0, 7e8, told=told(8.0, deepest=0.03))
    (line,) = report.ratios([row(seconds=2.0), peer])
    assert "CPU 8 s at 3.0% overlap" in line
    assert "up to 80 s, extrapolated" in line
    assert "sequence / LAMMPS 0.25" in line


def test_of_repeated_runs_the_median_stands_in_the_table() -> None:
    runs = [row(seconds=s) for s in (3.0, 9.0, 2.0)] + [row(grains=8000)]
    found = report.medians(runs)
    assert [(r.grains, r.told["cpu"]) for r in found] == [(1000, 3.0), (8000, 1.0)]
    (line,) = report.spread(found)
    assert "3 runs, CPU 2 to 9 s" in line
    # One run of three that did not come to its end is shown, not hidden behind the other two.
    (shown,) = report.medians([row(), row(failure="not_converged"), row()])
    assert not shown.complete


def test_steps_of_the_peers_are_parts_of_rayleighs_time() -> None:
    """Rayleigh's time of these grains is 4.33e-4 s (Li, Xu and Thornton, Powder Technol. 160, 219, 2005)."""
    long, short = (time_step(1e7, R, 2500.0, 0.01, part) for part in (0.2, 0.05))
    assert long == pytest.approx(0.2 * 4.33e-4, rel=0.02)
    assert long / short == pytest.approx(4.0, rel=0.02)
    assert 0.01 / long == pytest.approx(round(0.01 / long))


def test_a_run_that_was_cut_short_is_no_result() -> None:
    late = row(time=0.4)
    assert not late.complete
    assert "out of time at 0.40 s of 1 s" in late.remark()
    assert "stopped at 1.000 s: not_converged" in row(failure="not_converged").remark()
    assert math.isnan(Row("Carom", "sequence", 10, 1, 1, 0.1, told=told()).per_step(1))


def test_the_page_keeps_what_stands_around(tmp_path: Path) -> None:
    page = tmp_path / "scale.md"
    page.write_text(f"before\n{report.BEGIN}\nold\n{report.END}\nafter\n")
    report.write_page("new", page)
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "\nnew\n" in text
    assert "old" not in text
    page.write_text("no marks")
    with pytest.raises(SystemExit, match="no place"):
        report.write_page("new", page)
