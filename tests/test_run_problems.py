"""Contact problems of a run: what is kept, that it is the problem of the step, and how it is found again."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import carom
import h5py
import numpy as np
import pytest
from carom import CaromError, CaromWarning, ContactProblem, _core
from carom.cli.examples import find
from carom.problem import ContactProblemError, GlobalProblem
from carom.problem.kept import ROWS, frames, multipliers, state
from carom.problem.run_files import file_name, kept_files, write_kept
from carom.run.problems import Choice
from joint_scenes import AXES, held, scene, spring
from test_run_core import simulate

TOLERANCE = 1e-8
PILE_TOLERANCE = 1e-7


def kept(model: dict[str, Any], steps: int, **options: Any) -> list[dict[str, Any]]:
    """All problems of a run of the core."""
    model["options"] |= options
    simulation = _core.Simulation(model)
    simulation.keep_problems([(1, steps, 1)], 0)
    assert simulation.advance(steps, 0, False, 0.0)["outcome"] is None
    return simulation.take_problems(False)


def err(problem: ContactProblem, r: np.ndarray, length: float, floor: float) -> float:
    """`|F|` of the natural map over the terms it is made of, or over `floor` (a measure), with the units taken out.

    Moments and turns are measured by `length`, impulses by the mean of W over the normal rows, as the core does (rule R1:
    rows are compared by `p z`); this leaves cones cones.
    """
    d, local = problem.dimension, problem.local
    units = np.tile(np.array([1.0, 1.0, 1.0, length, length, length])[:d], problem.contacts)
    w = local.W.to_dense() * units[:, None] * units
    mean = float(np.mean(np.diag(w)[::d]))
    scaled = ContactProblem.from_matrices(
        w / mean,
        local.q * units / mean,
        local.mu,
        local.mu_r if local.mu_r is None else local.mu_r / length,
        local.mu_s if local.mu_s is None else local.mu_s / length,
    )
    found = scaled.residual(r / units)
    return found.natural_map / max(found.scale, floor / mean)


def worst_err(problems: list[dict[str, Any]], length: float) -> float:
    """Largest err of the multipliers of the core, floored as there (eq. 44): at rest measures are rounding."""
    worst = 0.0
    for p in problems:
        if not len(p["bounds"]):
            continue
        problem = ContactProblem(state(p))
        speed = np.abs(p["motion"].reshape(-1, 6)[:, :3]).max()
        floor = (length if p["level"] == "position" else speed) * 1e-4
        worst = max(worst, err(problem, multipliers(p), length, floor))
    return worst


def example(name: str, until: float) -> dict[str, Any]:
    model = carom.Scene.from_toml(find(name)).with_options(until=until).to_model()
    return dict(model)


@pytest.mark.parametrize("friction", ["once", "paper"])
@pytest.mark.parametrize(
    ("name", "steps", "length", "tolerance"),
    [
        ("slide_to_roll", 20, 0.03, 1e-14),  # the closed form of one contact on a plane
        ("incline", 20, 0.03, 1e-14),
        ("newtons_cradle", 30, 0.02, 10 * TOLERANCE),
        ("three_balls", 2000, 0.03, 10 * TOLERANCE),
        ("column", 10, 0.02, 10 * TOLERANCE),
        ("grid_3x3x3", 30, 0.02, 10 * PILE_TOLERANCE),
        (
            "corner",
            130,
            0.02,
            10 * PILE_TOLERANCE,
        ),  # with spinning friction: six rows, the rolling ones with bound 0
    ],
)
def test_the_multipliers_of_a_step_solve_its_problems(
    name: str, steps: int, length: float, tolerance: float, friction: str
) -> None:
    found = kept(example(name, 10.0), steps, position_friction=friction)
    # Where the loads alone leave no gap and no overlap, positions have no problem.
    assert {p["level"] for p in found} - {"position"} == {"velocity"}
    assert friction == "once" or {p["level"] for p in found} == {"position", "velocity"}
    assert all(p["converged"] for p in found)
    assert worst_err(found, length) < tolerance
    # Not because r = 0 would do: multipliers act.
    assert any(np.abs(multipliers(p)).max(initial=0.0) > 0.0 for p in found)


@pytest.mark.parametrize("impact", ["sequence", "sequence-paper", "one-shot"])
@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_every_law_and_method_keeps_its_problems(impact: str, method: str) -> None:
    law = {"friction": 0.3, "restitution": 0.6, "rolling_radius": 0.002, "spinning_radius": 0.001}
    position = [[0.0, 0.0, 0.1], [0.201, 0.0, 0.1], [0.1, 0.17, 0.101], [0.1, 0.06, 0.28]]
    model = scene(
        position,
        [[1.0, 0.2, 0.0], [-0.5, 0.1, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]],
        law=law,
        planes=FLOOR,
    )
    projection = {"position_projection": True} if method == "moreau" else {}
    found = kept(model, 60, impact=impact, method=method, **projection)
    assert {(p["level"], len(p["bounds"]) > 1) for p in found} >= {("position", True), ("velocity", True)}
    first = 1 if impact == "sequence-paper" else 0
    assert min(p["index"] for p in found if p["level"] == "velocity") >= first
    assert worst_err(found, 0.1) < 10 * TOLERANCE


FLOOR = [((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))]


def a_rod_and_a_ball(loads: bool = False, twice: bool = False) -> dict[str, Any]:
    """Two joined spheres and a third one on a floor, the joined ones falling."""
    x = np.array([[0.0, 0.0, 0.12], [0.25, 0.0, 0.2], [0.1, 0.3, 0.11]])
    middle = x[:2].mean(axis=0)
    joints = [held(x, 0, 1, middle)] + [held(x, 0, 1, middle, AXES[:2])] * twice
    forces = [spring(x, 1, 2, k=4000.0, c=3.0, rest=0.3)] if loads else []
    law = {"friction": 0.3, "restitution": 0.4, "rolling_radius": 0.005}
    return scene(x, 0.5 * AXES - [0.0, 0.0, 1.0], law=law, planes=FLOOR, joints=joints, loads=forces)


@pytest.mark.parametrize("loads", [False, True])
@pytest.mark.parametrize("twice", [False, True])
def test_joints_and_loads_are_eliminated(loads: bool, twice: bool) -> None:
    found = [p for p in kept(a_rod_and_a_ball(loads, twice), 80) if len(p["bounds"])]
    with_joints = [p for p in found if p["joints"]]
    assert with_joints
    assert any(np.abs(p["load"]).max() > 0.0 for p in found) == loads
    for level in ("position", "velocity"):
        some = [p for p in with_joints if p["level"] == level and multipliers(p).any()]
        assert some
        assert worst_err(some, 0.1) < 10 * TOLERANCE
    # Without the joint rows the same multipliers would be no solution.
    p = next(
        p
        for p in with_joints
        if multipliers(p).any() and np.abs(p["r"][ROWS * len(p["bounds"]) :]).max() > 1e-6
    )
    contacts = ROWS * len(p["bounds"])
    loose = p | {key: p[key][:contacts] for key in ("node", "gradient", "q", "r")}
    assert worst_err([loose], 0.1) > 1e-4


def test_what_the_core_left_out_has_its_place_and_takes_no_force() -> None:
    """Contacts of a problem differ in their laws; here one slides without friction, one rolls."""
    law = {"friction": 0.0, "restitution": 0.0}
    model = scene(
        [[0.0, 0.0, 0.1], [0.2, 0.0, 0.1]], [[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], law=law, planes=FLOOR
    )
    model["material"] = np.array([0, 1])
    model["plane_material"] = np.array([2])
    model |= {"law_a": np.array([0, 0, 1]), "law_b": np.array([1, 2, 2]), "friction_law": [None] * 3}
    model |= {
        "friction": np.array([0.0, 0.3, 0.2]),
        "restitution": np.zeros(3),
        "tangential_restitution": np.zeros(3),
    }
    model |= {"rolling_radius": np.array([0.0, 0.0, 0.01]), "spinning_radius": np.zeros(3)}
    p = next(p for p in kept(model, 3) if len(p["bounds"]) == 3 and p["level"] == "velocity")
    problem = ContactProblem(state(p))
    assert problem.dimension == 5
    r = multipliers(p).reshape(3, 5)
    bounds = problem.local.bounds
    assert (bounds == 0.0).sum() == 3
    assert not r[:, 1:].reshape(3, 2, 2)[bounds == 0.0].any()
    # All rows are those of the geometry: W is G M^-1 G^T of all five, not of those that act.
    axes = frames(p)
    np.testing.assert_allclose(axes @ axes.transpose(0, 2, 1), np.tile(np.eye(3), (3, 1, 1)), atol=1e-15)
    diagonal = problem.local.W.diagonal().reshape(3, 5)
    np.testing.assert_allclose(diagonal[0], np.array([2.0, 2 + 2 / 0.4, 2 + 2 / 0.4, 2 / 0.004, 2 / 0.004]))
    np.testing.assert_allclose(diagonal[1], diagonal[0] / 2)


def test_both_forms_say_the_same(tmp_path: Path) -> None:
    for p in kept(example("grid_3x3x3", 1.0), 12):
        one, other = ContactProblem(state(p)), ContactProblem(state(p, "global"))
        assert isinstance(other.source, GlobalProblem)
        assert len(other.source.f) == 6 * len(p["spheres"])
        np.testing.assert_allclose(other.local.W.to_dense(), one.local.W.to_dense(), rtol=1e-14, atol=1e-13)
        np.testing.assert_allclose(other.local.q, one.local.q, atol=1e-14)
        again = ContactProblem.from_fclib(write_kept(tmp_path / file_name(p), p, "global"))
        assert np.array_equal(again.local.q, other.local.q)


def three_balls(load: str) -> carom.Scene:
    """Balls that are thrown along a floor, one beside the other; `load` is what acts on them besides."""
    made = carom.Scene("three", run={"until": 0.06, "step": 1e-3, "tolerance": 1e-11})
    for other in ("m", "w"):
        made.contact("m", other, friction=0.3, restitution=0.3)
    if load == "a bowl":  # its normals turn with the balls
        made.ball_wall("bowl", point=(0, 0, 0.1), radius=0.1, material="w", inside=True)
    else:
        made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    if load == "a lid":
        made.plane("lid", point=(0, 0, 0.024), normal=(0, 0, -1), material="w", free={"mass": 0.05})
    for i in range(3):
        x = (0.0201 * (i - 1), 0.001 * i, (0.0101 if load != "a bowl" else 0.0155) + 0.0005 * i)
        spun = {"angular_velocity": (0, 5, 3 * i), "material": "m"}
        made.sphere(f"b{i}", radius=0.01, mass=0.03, position=x, velocity=(0.5 - 0.4 * i, 0.1, -0.2), **spun)
        if load == "drag":
            made.drag(f"b{i}", translation=2.0, rotation=1e-4)
    if load == "a spring":
        made.spring("b0", "b2", stiffness=100.0, rest_length=0.035)
    if load == "a function":
        made.load_function(lambda t, x, v, w: np.hstack([-3 * v, -1e-4 * w]))
    return made


@pytest.mark.parametrize("load", ["none", "a bowl", "a lid", "drag", "a function", "a spring"])
def test_positions_of_the_global_form_are_those_of_the_step(load: str, tmp_path: Path) -> None:
    """`v` is how far bodies moved in the step, and `w` of what meets the floor the gap at its start."""
    made, n = three_balls(load), 3
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)
        run = carom.simulate(made, out=tmp_path / "run", save_problems="all", problem_form="global")
    last = {}
    for file in kept_files(tmp_path / "run"):
        with h5py.File(file.path) as opened:
            of_v, contacts = opened["carom/v_bodies"][:], opened["carom/bodies"][:]
        if file.level == "position":
            last[file.step, *of_v] = (file.path, of_v, contacts)  # what is solved once more counts
    x = run.position
    worst, met = 0.0, 0
    for (step, *_), (path, of_v, contacts) in last.items():
        problem = ContactProblem.from_fclib(path)
        assert isinstance(problem.source, GlobalProblem)
        v = problem.solve(tol=1e-12).v
        assert v is not None
        mass = problem.source.M.diagonal().reshape(-1, 6)
        for body, own, way in zip(of_v, mass, v.reshape(-1, 6), strict=True):
            if body >= n:  # the lid: its guide lets it neither turn nor slide
                assert (load, body) == ("a lid", n)
                assert (own[:3] == 0.05).all()
                assert not np.delete(way, 2).any()
            else:
                worst = max(worst, np.abs(way[:3] - (x[step] - x[step - 1])[body]).max())
        if load != "a bowl":
            for gap, (a, b) in zip(problem.source.w[:: problem.dimension], contacts, strict=True):
                if b == n + (load == "a lid"):
                    worst, met = max(worst, abs(gap - (x[step - 1][a][2] - 0.01))), met + 1
    assert len(last) > 5
    assert (met > 5) == (load != "a bowl")
    assert worst < 1e-13


def test_joints_alone_are_no_contact_problem(tmp_path: Path) -> None:
    """A chain that swings, and a ball that falls beside it: only the ball has contact problems."""
    made = carom.Scene("chain", run={"until": 0.12, "step": 1e-3})
    made.contact("m", "m", friction=0.4, restitution=0.3)
    made.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for i in range(3):
        made.sphere(f"b{i}", radius=0.01, mass=0.03, position=(0.1 + 0.03 * i, 0, 0.15), material="m")
    made.sphere("c", radius=0.01, mass=0.03, position=(0.5, 0, 0.03), material="m")
    made.joint("rod", between=("b0", "ground"), points=[(0.1, 0, 0.15), (0, 0, 0.2)])
    made.joint("rod", between=("b0", "b1"))
    made.joint("rod", between=("b1", "b2"))
    for choice in ("worst:10", "all"):
        carom.simulate(made, out=tmp_path / "run", save_problems=choice, force=True)
        found = kept_files(tmp_path / "run")
        assert (len(found) == 10) == (choice == "worst:10")
        assert all(ContactProblem.from_fclib(file.path).contacts == 1 for file in found)


def test_rows_of_a_problem_are_sparse() -> None:
    """W has the entries of contacts that share a sphere, and no dense matrix is made on the way."""
    n = 3000
    x = np.zeros((n, 3))
    x[:, 0] = 0.2 * np.arange(n)
    x[:, 2] = 0.1
    model = scene(x, law={"friction": 0.3}, planes=FLOOR)
    p = next(p for p in kept(model, 1) if p["level"] == "velocity" and len(p["bounds"]) > 1)
    contacts = len(p["bounds"])
    assert contacts == 2 * n - 1
    assert ContactProblem(state(p)).local.W.entries < 9 * 5 * contacts


@pytest.mark.parametrize(("until", "last"), [(0.11, 104), pytest.param(0.15, 120, marks=pytest.mark.long)])
def test_nothing_changes_in_a_run_whose_problems_are_kept(tmp_path: Path, until: float, last: int) -> None:
    scene_ = carom.Scene.from_toml(find("corner")).with_options(until=until)
    plain = simulate(scene_, out=tmp_path / "plain")
    both = simulate(scene_, out=tmp_path / "kept", save_problems=f"100:{last},worst:3")
    assert np.asarray(plain.position[-1]).tobytes() == np.asarray(both.position[-1]).tobytes()
    assert np.array_equal(plain.steps.iterations_velocity, both.steps.iterations_velocity)
    assert not kept_files(plain.path)
    files = kept_files(both.path)
    outside = [file for file in files if not 100 <= file.step <= last]
    assert {file.step for file in files} >= set(range(100, last + 1))
    assert len(outside) <= 3
    # The hardest of all is there: as many iterations as the report of the run tells.
    most = max(np.asarray(plain.steps[f"iterations_{level}"]).max() for level in ("position", "velocity"))
    iterations = []
    for file in files:
        with h5py.File(file.path) as opened:
            about = dict(opened["carom"].attrs)
            assert opened["carom/bodies"].shape == (len(opened["carom/normal"]), 2)
            assert len(opened["carom/r"]) == ContactProblem.from_fclib(file.path).local.rows
        iterations.append(about["iterations"])
        assert (about["step"], about["level"]) == (file.step, file.level)
        assert about["time"] == pytest.approx(1e-3 * file.step)
    assert max(iterations) == most


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stored") / "run"
    simulate(carom.Scene.from_toml(find("corner")), until=0.12, out=path, save_problems=[64, 110])
    return path


def test_a_problem_of_a_run_is_found_again(stored: Path) -> None:
    files = kept_files(stored)
    assert {file.step for file in files} == {64, 110}
    for file in files:
        keys = {key: getattr(file, key) for key in ("step", "level", "island", "index", "again", "part")}
        assert ContactProblem.from_run(stored, **keys).title.startswith(file.level)
    with pytest.raises(
        ContactProblemError, match=r"\d+ contact problems with step=64; say which: step=64, level='"
    ):
        ContactProblem.from_run(stored, step=64)
    with pytest.raises(
        ContactProblemError, match="no contact problem with step=3; there are those of steps 64, 110"
    ):
        ContactProblem.from_run(stored, step=3)
    told = "no contact problem with step=64, island=99; of this step there are: step=64, level='position', island=0; "
    with pytest.raises(ContactProblemError, match=told):
        ContactProblem.from_run(stored, step=64, island=99)
    with pytest.raises(ContactProblemError, match="level: 'foo'; there are 'position' and 'velocity'"):
        ContactProblem.from_run(stored, step=64, level="foo")


def contents(run: Path) -> set[tuple[int, bytes, bytes]]:
    """Step, q and r of each file."""
    found = []
    for file in kept_files(run):
        with h5py.File(file.path) as opened:
            q = np.asarray(ContactProblem.from_fclib(file.path).local.q)
            assert opened["carom"].attrs["again"] == file.again
            found.append((file.step, q.tobytes(), opened["carom/r"][:].tobytes()))
    assert len(set(found)) == len(found)
    return set(found)


def test_two_problems_of_a_step_with_the_same_index_have_two_files(tmp_path: Path) -> None:
    """Loads are solved before the positions and once more after them; the second took the file of the first."""
    tower = carom.Scene(gravity=(0, 0, -9.8))
    tower.material("m")
    tower.contact("m", "m", friction=0.3, restitution=0.5)
    tower.plane("bed", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    for name, place in {"a": (0, 0, 0.02), "b": (0.0401, 0, 0.02), "c": (0, 0.001, 0.0601)}.items():
        push = (0, 0.3, 0) if name == "a" else (0, 0, 0)
        tower.sphere(name, material="m", radius=0.02, mass=0.1, position=place, velocity=push)
    scene_ = tower.with_options(until=0.02, step=1e-3)
    runs = {}
    for number, choice in enumerate(("all", "worst:1000", "worst:20", "1:10,worst:1000")):
        simulate(scene_, out=tmp_path / str(number), save_problems=choice)
        runs[choice] = contents(tmp_path / str(number))
    assert runs["all"] == runs["worst:1000"] == runs["1:10,worst:1000"]
    assert len(runs["worst:20"]) == 20
    assert runs["worst:20"] < runs["all"]
    again = next(file for file in kept_files(tmp_path / "0") if file.again)
    keys = {"step": again.step, "level": again.level, "island": again.island, "index": again.index}
    with pytest.raises(ContactProblemError, match=r"again=1 \(again=0 is the first"):
        ContactProblem.from_run(tmp_path / "0", **keys)
    first, second = (ContactProblem.from_run(tmp_path / "0", **keys, again=k).local.q for k in (0, 1))
    assert not np.array_equal(first, second)


def test_a_run_that_goes_on_keeps_on_keeping(tmp_path: Path) -> None:
    run = tmp_path / "run"
    simulate(carom.Scene.from_toml(find("corner")), until=0.11, out=run, save_problems="105:115:5")
    assert {file.step for file in kept_files(run)} == {105, 110}
    carom.resume(run, until=0.12)
    assert {file.step for file in kept_files(run)} == {105, 110, 115}


def test_steps_beyond_the_run_are_told_of(tmp_path: Path) -> None:
    scene_ = carom.Scene.from_toml(find("column")).with_options(until=0.01)
    steps = round(0.01 / scene_.run.step)
    with pytest.warns(
        CaromWarning, match=f"save_problems: the run ended at step {steps}, before 5000, 7000; choose"
    ):
        carom.simulate(scene_, save_problems=[steps, 5000, 7000])
    for given, end in ((f"{steps - 1}:1000", 1000), (f"{steps - 1}:{steps + 4}:2", steps + 3)):
        with pytest.warns(CaromWarning, match=f"the run ended at step {steps}, before {end}; choose"):
            carom.simulate(scene_, save_problems=given)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        carom.simulate(scene_, save_problems=f"{steps - 2}:{steps + 1}:2")  # the last one of it is the end
    alone = carom.Scene(run={"until": 0.01, "step": 1e-3})
    alone.sphere("a", radius=0.1, mass=1.0, material="m", position=(0, 0, 1))
    with pytest.warns(CaromWarning, match="save_problems: none of the steps that were chosen had contacts"):
        carom.simulate(alone, save_problems="all")


def test_a_run_replaced_leaves_no_problem_of_the_old_one(tmp_path: Path) -> None:
    scene_ = carom.Scene.from_toml(find("column")).with_options(until=0.01)
    simulate(scene_, out=tmp_path / "run", save_problems="all")
    assert kept_files(tmp_path / "run")
    simulate(scene_, out=tmp_path / "run", force=True)
    assert not kept_files(tmp_path / "run")
    with pytest.raises(ContactProblemError, match=r"no contact problem was kept; save_problems=\.\.\."):
        ContactProblem.from_run(tmp_path / "run")


def test_the_problem_that_stops_a_run_opens_as_every_other(tmp_path: Path) -> None:
    hopeless = {
        "max_iterations": 1,
        "gauss_seidel_sweeps": 0,
        "max_halvings": 1,
        "tolerance": 1e-15,
        "pile_tolerance": 1e-15,
    }
    run = tmp_path / "run"
    with pytest.raises(carom.RunFailed, match=r"the contact problem is in failing_problem\.h5"):
        simulate(carom.Scene.from_toml(find("corner")), until=0.5, out=run, save_problems="all", **hopeless)
    failing = ContactProblem.from_fclib(run / "failing_problem.h5")
    assert failing.dimension == 6  # the scene has spinning friction
    step = carom.load(run).outcome.step
    for found in (ContactProblem.from_run(run), ContactProblem.from_run(run, step=step)):
        assert np.array_equal(found.local.q, failing.local.q)
    with h5py.File(run / "failing_problem.h5") as file:
        assert not file["carom"].attrs["converged"]
        assert file["carom"].attrs["step"] == step
        # Every attempt by the name of its rung.
        tried = file["carom"].attrs["attempts"]
        assert all(text in tried for text in ("newton", "residual")), tried
    # Attempts that failed are kept under the number of the attempt.
    parts = [file for file in kept_files(run) if file.step == step]
    assert 0 in {file.part for file in parts}
    assert len({file.part for file in parts}) > 1


def test_problems_of_halved_steps_have_the_number_of_their_part(tmp_path: Path) -> None:
    hopeless = {"max_iterations": 2, "gauss_seidel_sweeps": 0, "tolerance": 1e-13, "max_halvings": 3}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = simulate(
                carom.Scene.from_toml(find("corner")),
                until=0.2,
                out=tmp_path / "r",
                save_problems="all",
                **hopeless,
            )
        except carom.RunFailed as failed:
            result = failed.result
    halved = np.asarray(result.steps.step)[np.asarray(result.steps.halvings) > 0]
    assert len(halved)
    files = [file for file in kept_files(tmp_path / "r") if file.step == halved[0]]
    assert len({file.part for file in files}) >= 2
    for file in files:
        with h5py.File(file.path) as opened:
            assert opened["carom"].attrs["converged"] or file.part < max(f.part for f in files)


@pytest.mark.parametrize(
    ("given", "steps", "hardest"),
    [
        ("100,200:300:50", ((100, 100, 1), (200, 300, 50)), 0),
        ("all", ((1, 2**64 - 1, 1),), 0),
        ("worst:3, 7", ((7, 7, 1),), 3),
        (12, ((12, 12, 1),), 0),
        (range(2, 6, 2), ((2, 2, 1), (4, 4, 1)), 0),
    ],
)
def test_a_choice_is_read(given: Any, steps: Any, hardest: int) -> None:
    choice = Choice.of(given)
    assert (choice.steps, choice.hardest) == (steps, hardest)
    assert Choice.of(choice.text) == choice


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("", "nothing is chosen"),
        ("0", "steps count from 1"),
        ("5:2", "no step is in '5:2'"),
        ("5:9:0", "no step is in '5:9:0'"),
        ("worst", "'worst' cannot be read; give steps as"),
        ("worst:0", "cannot be read"),
        ("1.5", "cannot be read"),
        ("99999999999999999999", "no step is in"),
        ([1.5], "steps are whole numbers"),
    ],
)
def test_a_choice_that_is_none_says_what_to_write(given: Any, message: str) -> None:
    with pytest.raises(CaromError, match=message):
        Choice.of(given)


def test_what_cannot_be_kept_is_refused_before_the_run(tmp_path: Path) -> None:
    scene_ = carom.Scene.from_toml(find("column"))
    with pytest.raises(CaromError, match="method penalty solves no contact problems"):
        simulate(scene_, out=tmp_path / "run", method="penalty", save_problems="1")
    with pytest.raises(CaromError, match="the form of problems is 'dense'; it must be local or global"):
        simulate(scene_, out=tmp_path / "run", save_problems="1", problem_form="dense")
    assert not (tmp_path / "run").exists()
