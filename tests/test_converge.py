"""Order of convergence: the error measure of eq. 45, the fit, carom.converge and `carom converge`."""

from __future__ import annotations

import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import carom
import numpy as np
import pytest
from carom import Scene
from carom.many.order import ROUNDING, clear_order, error_of, order_of
from carom.many.quantity import Quantity
from typer.testing import CliRunner

SCENARIOS = Path(__file__).parent.parent / "scenarios"
GRAVITY, HEIGHT, RESTITUTION, RADIUS = 9.8, 0.1, 0.5, 0.02
FALL = math.sqrt(2 * HEIGHT / GRAVITY)
#: Steps that have the impact at the same place of their step: the error is a smooth function of h.
STEPS = [FALL / (n + 0.3) for n in (100, 200, 400, 800)]


def bouncing() -> Scene:
    scene = Scene("bouncing ball", gravity=(0, 0, -GRAVITY), run={"until": 0.2})
    scene.contact("ball", "floor", friction=0.0, restitution=RESTITUTION)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="floor")
    scene.sphere("ball", radius=RADIUS, mass=0.1, material="ball", position=(0, 0, RADIUS + HEIGHT))
    return scene


def parabola(t: float) -> dict[str, Any]:
    """Position and velocity of the ball up to its second impact."""
    up = RESTITUTION * GRAVITY * FALL
    late = t - FALL
    z = HEIGHT - GRAVITY * t**2 / 2 if late < 0 else up * late - GRAVITY * late**2 / 2
    v = -GRAVITY * t if late < 0 else up - GRAVITY * late
    return {"position:ball": [0, 0, RADIUS + z], "velocity:ball": [0, 0, v]}


FORMULAS = f"""
[parameters]
g = {GRAVITY}
e = {RESTITUTION}
h = {HEIGHT}
fall = "= sqrt(2*h/g)"
[sphere.ball]
velocity = [0, 0, "= -g*t + max(sign(t - fall), 0)*(1 + e)*g*fall"]
"""


def command(*arguments: str) -> tuple[int, str, str]:
    from carom.cli.app import app

    done = CliRunner().invoke(app, ["converge", *arguments])
    return done.exit_code, done.stdout, done.stderr


# --- eq. 45 and the fit -----------------------------------------------------------------------------------------


def test_the_error_is_that_of_equation_45() -> None:
    found, reference = [[1.0, 2.0], [3.0, -4.0]], [[1.0, 1.0], [3.0, -1.0]]
    assert error_of(found, reference) == pytest.approx((1 + 3) / (2 + 4))
    assert error_of(found, reference, norm=2) == pytest.approx((1 + 3) / (math.sqrt(2) + math.sqrt(10)))
    assert error_of([[1.0]], [[0.0]]) == 1.0  # nothing to divide by: the difference itself
    assert math.isnan(error_of([[math.nan]], [[1.0]]))


@pytest.mark.parametrize("power", [0.5, 1.0, 2.0])
def test_a_power_of_h_has_that_order(power: float) -> None:
    steps = [1e-4, 1e-2, 1e-3]
    order = order_of(steps, [3 * h**power for h in steps])
    assert order.value == pytest.approx(power, abs=1e-13)
    assert float(order) == order.value
    assert order.factor == pytest.approx(3)
    assert order.uncertainty < 1e-12
    assert order.pairwise == pytest.approx((power, power))
    assert order.at(5e-3) == pytest.approx(3 * 5e-3**power)


def test_the_uncertainty_is_the_standard_error_of_the_slope() -> None:
    rng = np.random.default_rng(3)
    h = np.geomspace(1e-1, 1e-4, 12)
    noise = rng.normal(0, 0.2, len(h))
    order = order_of(list(h), list(h * np.exp(noise)))
    # The covariance of numpy's fit, scaled by the residuals, is an independent way to it.
    (slope, _), covariance = np.polyfit(np.log(h), np.log(h) + noise, 1, cov=True)
    assert order.value == pytest.approx(slope, rel=1e-12)
    assert order.uncertainty == pytest.approx(math.sqrt(covariance[0, 0]), rel=1e-9)
    assert math.isnan(order_of([1e-2, 1e-3], [1.0, 0.1]).uncertainty)


@pytest.mark.parametrize(
    ("steps", "errors", "told"),
    [
        ([1e-2], [1.0], "at least two"),
        ([1e-2, 1e-3], [1.0], "one error per step"),
        ([1e-2, 1e-2], [1.0, 1.0], "all different"),
        ([1e-2, -1e-3], [1.0, 1.0], "positive"),
        ([1e-2, 1e-3], [1.0, 0.0], "above 0"),
        ([1e-2, 1e-3], [1.0, math.nan], "above 0"),
    ],
)
def test_what_has_no_order_is_refused(steps: list[float], errors: list[float], told: str) -> None:
    with pytest.raises(carom.CaromError, match=told):
        order_of(steps, errors)


def test_errors_are_those_of_spheres() -> None:
    """Clumps and walls were names that nothing has."""
    scene = carom.Scene(gravity=(0, 0, -9.8), run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0.1, restitution=0.5)
    scene.clump(
        "c", spheres=[(0, 0, 0, 0.1), (0.1, 0, 0, 0.1)], density=1000, material="m", position=(0, 0, 1)
    )
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.plane("lid", point=(0, 0, 2), normal=(0, 0, -1), material="m", free={"mass": 1.0})
    for name, told in (
        ("c", "it is a clump of the balls c1, c2"),
        ("floor", "it is a wall, and errors are those of spheres"),
        ("lid", "it is a free wall, and"),
        ("c3", "did you mean c1|known: c1, c2"),
    ):
        with pytest.raises(
            carom.CaromError, match=f"position:{name}: no sphere is called '{name}'; ({told})"
        ):
            carom.converge(scene, (1e-3, 5e-4), reference=1e-4, quantities=[f"position:{name}"])


def test_quantities_are_read() -> None:
    bodies = ["cue", "a:x", "x"]
    assert Quantity.of("velocity", bodies) == Quantity("velocity", "velocity")
    assert Quantity.of("velocity:cue:z", bodies) == Quantity("velocity:cue:z", "velocity", "cue", "z")
    assert Quantity.of("position:x", bodies).body == "x"
    assert Quantity.of("orientation:cue:w", bodies).axis == "w"
    for wrong, told in (("speed", "no quantity"), ("velocity:qeu", "cue"), ("velocity:cue:w", "no sphere")):
        with pytest.raises(carom.CaromError, match=told):
            Quantity.of(wrong, bodies)


# --- studies ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", ["nsga", "moreau"])
def test_order_one_through_an_impact_against_a_function(method: str) -> None:
    found = carom.converge(bouncing(), STEPS, parabola, method=method)
    assert list(found.errors) == ["position:ball", "velocity:ball"]
    for name in found.errors:
        order = found.orders[name]
        assert order is not None
        assert order.value == pytest.approx(1, abs=0.1), name
        assert all(p == pytest.approx(1, abs=0.2) for p in order.pairwise)
    assert found.ok
    assert found.reference == "function"


def test_the_errors_are_those_of_the_runs_themselves() -> None:
    found = carom.converge(bouncing(), STEPS[:2], parabola, ["velocity:ball:z"])
    for h, error in zip(found.steps, found.errors["velocity:ball:z"], strict=True):
        result = carom.simulate(bouncing(), step=h, until=math.floor(0.2 / h) * h, every=1)
        velocity = np.asarray(result["ball"].velocity[:, 2:])
        exact = np.array([parabola(float(t))["velocity:ball"][2:] for t in result.time])
        assert error == pytest.approx(error_of(velocity, exact), rel=1e-12)


def test_formulas_in_a_file_equal_the_function(tmp_path: Path) -> None:
    file = tmp_path / "exact.toml"
    file.write_text(FORMULAS)
    by_file = carom.converge(bouncing(), STEPS[:2], file)
    by_function = carom.converge(bouncing(), STEPS[:2], parabola, ["velocity:ball"])
    assert by_file.errors["velocity:ball"] == pytest.approx(by_function.errors["velocity:ball"], rel=1e-12)
    assert "exact.toml" in by_file.reference


def test_a_fine_run_and_a_run_directory_are_one_reference(tmp_path: Path) -> None:
    steps, fine = [4e-3, 2e-3, 1e-3], 1e-4
    by_step = carom.converge(bouncing(), steps, fine)
    carom.simulate(bouncing(), step=fine, every=1, out=tmp_path / "fine")
    by_run = carom.converge(bouncing(), steps, tmp_path / "fine")
    assert by_step.errors == by_run.errors
    assert list(by_step.errors) == ["position", "velocity", "angular_velocity"]
    assert set(by_step.errors["angular_velocity"]) == {0.0}
    assert by_step.orders["angular_velocity"] is None
    assert len(by_step.runs) == len(by_run.runs) + 1
    carom.simulate(bouncing(), step=fine, every=3, out=tmp_path / "thin")
    with pytest.raises(carom.CaromError, match="holds no state at t ="):
        carom.converge(bouncing(), steps, tmp_path / "thin")


def test_the_exact_method_is_a_reference() -> None:
    scene = SCENARIOS / "paper" / "5.6_break.toml"
    found = carom.converge(scene, [2e-4, 1e-4, 5e-5], "events", ["velocity:ball2"], at=0.2)
    assert found.reference == "method events"
    coarse, _, fine = found.errors["velocity:ball2"]
    assert (
        0.0 < fine < 0.5 * coarse
    )  # the order, over random shots: crates/carom-events/tests/events/limits.rs
    exact = carom.simulate(scene, method="events", step=0.2, until=0.2)["ball2"].velocity[-1]
    stepped = carom.simulate(scene, step=1e-4, until=0.2, every=2000)["ball2"].velocity[-1]
    assert found.errors["velocity:ball2"][1] == pytest.approx(error_of(stepped, exact), rel=1e-9)
    with pytest.raises(carom.CaromError, match='method = "nsga"'):
        carom.converge(scene, [2e-4, 1e-4], "events", method="events")


def test_at_takes_the_error_at_these_times_alone() -> None:
    scene = SCENARIOS / "paper" / "5.6_break.toml"
    found = carom.converge(scene, [1e-3, 5e-4], 1e-4, ["velocity"], at=[0.13])
    coarse, fine = (
        carom.simulate(scene, step=h, until=0.13, every=round(0.13 / h)).velocity[-1] for h in (1e-3, 1e-4)
    )
    assert found.errors["velocity"][0] == pytest.approx(error_of(coarse, fine), rel=1e-12)
    assert found.until == 0.13


def test_steps_and_times_may_have_units() -> None:
    plain = carom.converge(bouncing(), [2e-3, 1e-3], 1e-4, ["velocity"], at=[0.1, 0.2])
    told = carom.converge(bouncing(), ["2 ms", 1e-3], "0.1 ms", ["velocity"], at=["100 ms", 0.2])
    assert told.to_dict()["quantities"] == plain.to_dict()["quantities"]
    assert carom.converge(bouncing(), ["2 ms", "1 ms"], 1e-4, until="0.1 s").until == 0.1


def test_the_step_of_the_scene_is_none_of_the_study() -> None:
    scene = bouncing().with_options(step=0.1)
    assert carom.converge(scene, [2e-3, 1e-3], 1e-4, ["velocity"], until=0.02).until == 0.02


def test_the_number_of_threads_changes_nothing() -> None:
    scene = SCENARIOS / "corner.toml"
    one, four = (
        carom.converge(scene, [2e-3, 1e-3], 5e-4, ["position", "orientation"], until=0.04, threads=n)
        for n in (1, 4)
    )
    assert one.errors == four.errors
    assert one.orders == four.orders


def test_the_sign_of_a_quaternion_is_no_error() -> None:
    q = np.array([[[0.6, 0.8, 0.0, 0.0]]])
    quantity = Quantity.of("orientation", ["a"])
    assert error_of(quantity.aligned(-q, q), q) == 0


def test_a_run_that_stops_leaves_its_error_open() -> None:
    scene = SCENARIOS / "paper" / "5.6_break.toml"
    hard: dict[str, Any] = {
        "max_iterations": 1,
        "gauss_seidel_sweeps": 0,
        "max_halvings": 0,
        "tolerance": 1e-15,
    }
    found = carom.converge(scene, [1e-3, 5e-4], 1e-4, ["velocity"], until=0.13, **hard)
    assert not found.ok
    assert all(math.isnan(e) for e in found.errors["velocity"])
    assert found.orders["velocity"] is None
    assert {run.outcome for run in found.runs} == {"not_converged"}
    assert json.dumps(found.to_dict())


@pytest.mark.parametrize(
    ("keywords", "told"),
    [
        ({"steps": [1e-3]}, "two different steps"),
        ({"steps": [1e-3, 0.0]}, "above 0"),
        ({"steps": [1e-3, 1.0]}, "longer than the whole"),
        ({"reference": 3e-4}, "must divide every step"),
        ({"reference": 1e-3}, "must be finer than all steps, the finest of which is"),
        ({"reference": object()}, "reference must be"),
        ({"reference": "absent"}, "no such run"),
        ({"reference": "absent.toml"}, "absent.toml: No such file"),
        (
            {"reference": parabola, "quantities": ["angular_velocity:ball"]},
            "does not give angular_velocity:ball",
        ),
        ({"quantities": ["speed"]}, "no quantity"),
        ({"at": [0.1234567]}, "in whole steps"),
        (
            {"at": 1e-300},
            "at: the runs would end at 1e-300 s, before the first step of 0.002 s; give a later",
        ),
        ({"at": [-1.0]}, "at: the runs would end at -1 s, before the first step"),
        ({"at": "2 mm"}, "converge: at: expected a time"),
        ({"steps": None}, "converge: steps must be .*, found nothing"),
        ({"steps": ["1 ms", "2 m"]}, "converge: steps: expected a time"),
        ({"reference": "1 mm"}, "converge: reference: expected a time"),
        ({"until": "1 kg"}, "converge: until: expected a time"),
        ({"at": [0.3], "until": 0.2}, "from 0 to the end"),
        ({"stepp": 1}, "stepp"),
        ({"reference": lambda t: 3.0}, "gives float at t = 0 s; return values by quantity"),
        ({"reference": lambda t: {"velocity:ball": (1, 2)}}, r"shape \(2,\); return 3 numbers"),
        ({"reference": lambda t: {"velocity:ball:x": (1, 2, 3)}}, "return one number"),
        ({"reference": lambda t: {"velocity": np.zeros((2, 3))}}, r"return 3 numbers"),
        ({"reference": lambda t: {"velocity:ball": "fast"}}, "no array of numbers"),
        ({"case": "fast"}, "chooses a variant of a file"),
    ],
)
def test_wrong_studies_are_explained(keywords: dict[str, Any], told: str) -> None:
    given = {"steps": [2e-3, 1e-3], "reference": 1e-4, **keywords}
    with pytest.raises(carom.CaromError, match=told):
        carom.converge(bouncing(), **given)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("x = ", "not TOML"),
        ("", "no formulas"),
        ("[sphere.ball]\nspeed = [0, 0, 0]", "no such quantity"),
        ("[sphere.ball]\nvelocity = [0, 0]", "list of 3"),
        ("[sphere.ball]\nvelocity = [0, 0, true]", "a formula such as"),
        ('[sphere.ball]\nvelocity = [0, 0, "= 2*s"]', "'s' is unknown"),
        ('[sphere.ball]\nvelocity = [0, 0, "= 2*("]', "sphere.ball.velocity"),
        ('[parameters]\na = "= t"\n[sphere.ball]\nvelocity = [0, 0, 0]', "'t' is unknown"),
        ("sphere = 3", "must be a table"),
    ],
)
def test_wrong_formulas_are_explained(tmp_path: Path, text: str, told: str) -> None:
    file = tmp_path / "wrong.toml"
    file.write_text(text)
    with pytest.raises(carom.CaromError, match=told) as caught:
        carom.converge(bouncing(), [2e-3, 1e-3], file)
    assert "wrong.toml" in str(caught.value)


def test_formulas_of_a_reference_are_written_as_parameters_or_as_laws(tmp_path: Path) -> None:
    """Either spelling was refused in one of the places where a formula of t stands."""
    file, orders = tmp_path / "exact.toml", []
    for text in (FORMULAS, FORMULAS.replace('"= ', '"')):
        file.write_text(text)
        told = carom.converge(bouncing(), [2e-3, 1e-3], file).to_dict()
        told.pop("runs")  # it has times of the clock
        orders.append(told)
    assert orders[0] == orders[1]


# --- the command ------------------------------------------------------------------------------------------------


@pytest.fixture
def scenario(tmp_path: Path) -> str:
    path = tmp_path / "bounce.toml"
    bouncing().to_toml(path)
    return str(path)


def test_command_prints_one_document(scenario: str, tmp_path: Path) -> None:
    (tmp_path / "exact.toml").write_text(FORMULAS)
    steps = ",".join(map(repr, STEPS))
    code, out, _ = command(scenario, "--steps", steps, "--reference", str(tmp_path / "exact.toml"), "--json")
    assert code == 0
    document = json.loads(out)
    assert document["steps"] == STEPS
    found = document["quantities"]["velocity:ball"]
    assert found["order"]["value"] == pytest.approx(1, abs=0.1)
    assert len(found["order"]["pairwise"]) == len(found["errors"]) - 1 == 3
    assert [run["outcome"] for run in document["runs"]] == ["done"] * 4


def test_command_prints_a_table_and_draws(scenario: str, tmp_path: Path) -> None:
    figure = tmp_path / "order.svg"
    code, out, _ = command(
        scenario, "--steps", "4e-3,2e-3,1e-3", "--reference", "1e-4", "--quantities", "velocity", "--plot", str(figure)
    )  # fmt: skip
    assert code == 0
    assert "least squares" in out
    assert "against h = 0.0001 s" in out
    assert "velocity: order" in figure.read_text(encoding="utf-8")
    head, *rows = (tmp_path / "order.csv").read_text(encoding="utf-8").splitlines()
    assert head == "h (s),error of velocity (1)"
    assert len(rows) == 3
    again = [scenario, "--steps", "4e-3,2e-3", "--reference", "1e-4", "--plot"]
    for taken in ("order.svg", "order.csv"):
        code, _, err = command(*again, str((tmp_path / taken).with_suffix(".svg")))
        assert (code, f"{taken} exists already; give --force" in err) == (2, True)
        (tmp_path / "order.svg").unlink(missing_ok=True)  # its numbers alone are left


@pytest.mark.parametrize(
    ("rows", "starts", "drawn", "told"),
    [
        # Of "a" and "c" the errors that show an order, of "b" none: it would stretch the axis over 16 decades.
        (
            {"a": [4e-3, 2e-3, 1e-3], "b": [1e-15, 0.0, 7e-20], "c": [4e-9, 1e-9, 1e-13]},
            [9e-10, 9e-10],
            [1e-9, 4e-3],
            [
                "a: order 1.00 ± 0.00",
                "c: order 2.00, 1 error below 1e-12",
            ],
        ),
        ({"b": [2e-15, 0.0, 1e-15]}, [], [1e-15, 2e-15], ["b: no order, 3 errors below 1e-12"]),
        ({"a": [1.2, 1.0, 1.1]}, [0.457, 0.457], [1.0, 1.2], ["a: order 0.06 ± 0.12"]),
    ],
)
def test_errors_that_are_rounding_are_counted_and_left_out_of_the_figure(
    rows: dict[str, list[float]], starts: list[float], drawn: list[float], told: list[str]
) -> None:
    """Lines of order 1 and 2 lie below the curves with an order, and their labels apart from each other."""
    from carom.show.plot.convergence import convergence

    steps = [4e-3, 2e-3, 1e-3]
    orders = {name: clear_order(steps, row) for name, row in rows.items()}
    study = SimpleNamespace(
        title="t",
        where="at t = 1 s",
        reference="r",
        steps=steps,
        errors=rows,
        orders=orders,
        rounding=ROUNDING,
    )
    chart = convergence(study)
    [axes], [legend] = chart.figure.axes, chart.figure.legends
    assert [text.get_text() for text in legend.get_texts()] == told
    dashed = [line for line in axes.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in dashed] == pytest.approx(starts, rel=0.02)
    assert axes.get_title(loc="left") == "t: error at t = 1 s against r"
    if dashed:  # below each fit, and the fits have most of the figure
        fits = [line for line in axes.lines if line.get_linestyle() == "-" and line.get_marker() == "None"]
        assert max(line.get_ydata()[-1] for line in dashed) < min(line.get_ydata()[0] for line in fits)
    points = np.concatenate([line.get_ydata() for line in axes.lines if line.get_marker() != "None"])
    assert [points.min(), points.max()] == drawn
    assert [chart.data[f"error of {name} (1)"].tolist() for name in rows] == list(rows.values())
    chart.figure.draw_without_rendering()
    labels = [text.get_window_extent() for text in axes.texts]
    assert not labels or labels[1].y0 >= labels[0].y1


def test_command_refuses_what_it_cannot_do(scenario: str) -> None:
    for arguments, told in (
        (["--steps", "1e-3,x", "--reference", "1e-4"], "not a number"),
        (["--steps", "1e-3,5e-4", "--reference", "1e-4", "--plot", "a.gif"], "ends in .png"),
        (["--steps", "1e-3,5e-4", "--reference", "3e-4"], "must divide"),
        (
            ["--steps", "1e-3,5e-4", "--reference", "5e-4"],
            "must be finer than all steps, the finest of which is 0.0005 s",
        ),
        (["--steps", "1e-3,5e-4", "--reference", "0.1 m"], 'expected a time, found "0.1 m", a length'),
        (["--steps", "1e-3,5e-4", "--reference", "1e-4", "--set", "run.step=1e-3"], "those of --steps"),
        (["--steps", "1e-3,5e-4"], "--reference"),
    ):
        code, out, err = command(scenario, *arguments)
        assert code == 2, err
        assert out == ""
        if told != "--reference":  # typer's own words
            assert told in err


def test_command_says_which_run_stopped() -> None:
    hard = ["max_iterations=1", "gauss_seidel_sweeps=0", "max_halvings=0", "tolerance=1e-15"]
    options = [part for h in hard for part in ("--set", h)]
    scene = str(SCENARIOS / "paper" / "5.6_break.toml")
    code, out, err = command(
        scene, "--steps", "1e-3,5e-4", "--reference", "1e-4", "--until", "0.13", "--json", *options
    )
    assert code == 3
    assert "h = 0.001 s: not converged" in err
    assert json.loads(out)["quantities"]["velocity"]["errors"] == [None, None]


# --- what should not be believed --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("errors", "told"),
    [
        ([4e-3, 2e-3, 1e-3], None),
        ([4e-3, 3e-3, 1e-3], "scatters from 0.42 to 1.58"),
        ([4e-13, 2e-13, 1e-13], "rounding"),
        ([4e-3, 2e-3, 1e-13], "rounding"),
        ([40.0, 2e-3, 1e-3], "as large as the quantity"),
        ([2.1e-7, 2.05e-7, 2e-7], "hardly depends on the step: it comes from elsewhere (tolerance"),
        ([3.44e-2, 3.14e-2, 2.65e-2], "hardly depends on the step: an event (impact, end of sliding) falls"),
        ([0.0, 0.0, 0.0], None),
        ([math.nan, 2e-3, 1e-3], None),
    ],
)
def test_doubtful_orders_are_said_to_be(errors: list[float], told: str | None) -> None:
    from carom.many.order import doubts

    found = doubts("velocity", [4e-3, 2e-3, 1e-3], errors)
    assert len(found) == (0 if told is None else 1)
    assert told is None or told in found[0]


def test_the_example_of_the_help_shows_order_one_without_a_doubt() -> None:
    path = SCENARIOS / "paper" / "5.5_bernoulli.toml"
    found = carom.converge(path, [2e-3, 1e-3, 5e-4], 1e-5)
    for name in ("position", "velocity"):
        order = found.orders[name]
        assert order is not None
        assert order.value == pytest.approx(1, abs=0.02)
    assert not found.remarks
    assert "least squares" in str(found)
    assert repr(found).startswith("<Convergence ")
    assert "velocity 1.0" in repr(found)


def test_scatter_is_said_on_the_command_line() -> None:
    path = str(SCENARIOS / "paper" / "5.6_break.toml")
    arguments = ["--steps", "1e-3,5e-4,2.5e-4", "--reference", "1e-5", "--at", "0.13"]
    code, _, err = command(path, *arguments)
    assert code == 0
    assert "scatters" in err
    code, out, _ = command(path, *arguments, "--json")
    assert any("scatters" in remark for remark in json.loads(out)["remarks"])


def test_a_run_of_another_scene_is_no_reference(tmp_path: Path) -> None:
    path = SCENARIOS / "paper" / "5.2_free_balls.toml"
    carom.simulate(path, case="slips", step=1e-4, every=1, until=0.1, out=tmp_path / "slips")
    steps = [2e-3, 1e-3]
    assert carom.converge(path, steps, tmp_path / "slips", case="slips", until=0.1, at=0.1).ok
    # How it was solved is no part of the scene.
    carom.converge(path, steps, tmp_path / "slips", case="slips", until=0.1, at=[0.1], method="moreau")
    with pytest.raises(carom.CaromError, match="no reference for this scene: it has other friction"):
        carom.converge(path, steps, tmp_path / "slips", case="sticks", until=0.1)


def test_a_reference_that_is_hardly_finer_is_said_to_be(tmp_path: Path) -> None:
    steps = [4e-3, 2e-3, 1e-3]
    assert not any("reference" in told for told in carom.converge(bouncing(), steps, 2.5e-4).remarks)
    assert "not 4 times finer" in carom.converge(bouncing(), steps, 5e-4).remarks[0]
    carom.simulate(bouncing(), step=5e-4, every=1, out=tmp_path / "run")
    assert "not 4 times finer" in carom.converge(bouncing(), steps, tmp_path / "run").remarks[0]


def test_balls_that_left_are_left_out_and_said() -> None:
    scene = carom.Scene("leaves", gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.2, restitution=0.8)
    for name, y, v in (("leaves", 0.0, 1.0), ("stays", 0.5, 0.1)):
        scene.sphere(name, material="m", radius=0.02, mass=0.1, at=(0, y, 0), velocity=(v, 0, 0))
    scene.outlet(low=(0.2, -1, -1), high=(1, 1, 1))
    scene.spring("stays", "ground", points=[(0, 0.5, 0), (0.1, 0.5, 0)], stiffness=10.0)
    found = carom.converge(scene, [2e-3, 1e-3, 5e-4], 1e-4, ["position"], until=0.4)
    assert all(math.isfinite(error) and error > 0 for error in found.errors["position"])
    order = found.orders["position"]
    assert order is not None
    assert order.value == pytest.approx(2.0, abs=0.1)
    assert any("not there in both runs" in remark for remark in found.remarks)
