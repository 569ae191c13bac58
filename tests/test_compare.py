"""carom.compare and `carom compare`: one scene by several methods, side by side."""

from __future__ import annotations

import json
import re
from pathlib import Path

import carom
import numpy as np
import pytest
from carom.many.compare import default_methods, method_options
from carom.scene.tables.impact_laws import LAWS
from carom.show.plot.comparison import beside
from typer.testing import CliRunner

SCENARIOS = Path(__file__).parent.parent / "scenarios"
THREE = SCENARIOS / "three_balls.toml"


def command(*arguments: str) -> tuple[int, str, str]:
    from carom.cli.app import app

    done = CliRunner().invoke(app, ["compare", *arguments])
    return done.exit_code, done.stdout, done.stderr


def test_after_ctrl_c_it_is_said_what_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from carom.cli.app import app

    def pressed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    out = str(tmp_path / "runs")
    steps = ["converge", str(THREE), "--steps", "1e-3", "--reference", "1e-4"]
    monkeypatch.setattr("carom.many.compare.compare", pressed)
    monkeypatch.setattr("carom.many.converge.converge", pressed)
    for arguments, told in (
        (["compare", str(THREE), "-o", out], f"the runs so far are in {out}"),
        (["compare", str(THREE)], "nothing is kept without -o DIR"),
        (steps, "nothing is kept of the runs so far"),
    ):
        done = CliRunner().invoke(app, arguments)
        assert (done.exit_code, done.stderr) == (130, f"carom: interrupted; {told}\n")


def test_methods_and_their_choices() -> None:
    assert method_options("moreau+projection+one-shot") == {
        "method": "moreau",
        "position_projection": True,
        "impact": "one-shot",
    }
    assert {"nsga", "moreau", "moreau+projection"} <= set(default_methods())
    assert default_methods()[0] == "nsga"
    for wrong, told in (
        ("moro", "moreau"),
        ("nsga+projection", "no choice of nsga"),
        ("nsga+one-sho", "one-shot"),
    ):
        with pytest.raises(carom.CaromError, match=told):
            method_options(wrong)


def test_differences_are_those_of_the_runs() -> None:
    found = carom.compare(THREE, ("nsga", "moreau+one-shot"), at=[0.01])
    nsga = carom.simulate(THREE, method="nsga", every=1)
    moreau = carom.simulate(THREE, method="moreau", impact="one-shot", every=1)
    assert found.times == pytest.approx((0.01, 0.02))
    assert not found["nsga"].differences
    for d in found["moreau+one-shot"].differences:
        frame = round(d.time / found.step)
        a, b = (np.asarray(getattr(r, d.quantity)[frame]) for r in (moreau, nsga))
        assert d.greatest == np.max(np.linalg.norm(a - b, axis=1))
        size = np.max(np.sum(np.abs(np.asarray(getattr(nsga, d.quantity))), axis=(1, 2)))
        # Nothing turns here: the difference is 0, whatever it is held against.
        assert d.relative == (0 if size == 0 else pytest.approx(np.sum(np.abs(a - b)) / size, rel=1e-12))
        if d.greatest > 0:
            assert d.body == found.bodies[int(np.argmax(np.linalg.norm(a - b, axis=1)))]
    assert len(found["moreau+one-shot"].differences) == 2 * 3
    last = next(
        d for d in found["moreau+one-shot"].differences if d.time > 0.015 and d.quantity == "velocity"
    )
    # The sequence hands everything on, (0, 0, 2) m/s; one-shot leaves (-2/3, 4/3, 4/3).
    assert last.greatest == pytest.approx(4 / 3)
    assert last.relative == pytest.approx(4 / 3)
    assert found["nsga"].numbers["impacts"] == len(nsga.impacts)
    assert found.ok


def test_runs_are_kept_where_asked(tmp_path: Path) -> None:
    found = carom.compare(THREE, ("nsga", "moreau"), out=tmp_path)
    for run in found:
        assert run.directory == tmp_path / run.name
        kept = carom.load(run.directory)
        np.testing.assert_array_equal(kept.velocity[-1], run.states["velocity"][-1])
    with pytest.raises(carom.CaromError, match="exists already"):
        carom.compare(THREE, ("nsga",), out=tmp_path)
    carom.compare(THREE, ("nsga",), out=tmp_path, force=True)


def test_a_scene_with_laws_and_joints_is_compared() -> None:
    found = carom.compare(SCENARIOS / "paper" / "5.3_throw.toml", ("nsga", "moreau"), until=0.01)
    assert found.ok
    driven = carom.compare(SCENARIOS / "paper" / "5.1_torque.toml", ("nsga", "moreau"), until=0.1)
    assert all(d.relative < 1e-4 for d in driven["moreau"].differences if d.quantity != "velocity")


def test_a_run_that_stops_is_an_outcome() -> None:
    """A tolerance that no solver reaches: the first method stops at once and nothing can be compared."""
    scene = carom.Scene.from_toml(SCENARIOS / "paper" / "5.6_break.toml")
    found = carom.compare(
        scene,
        ("nsga", "moreau"),
        until=0.13,
        tolerance=1e-15,
        max_iterations=1,
        gauss_seidel_sweeps=0,
        max_halvings=0,
    )
    assert not found.ok
    assert "not converged" in found["nsga"].outcome
    assert not found["moreau"].differences
    assert np.isnan(found["nsga"].states["position"]).all()
    assert json.dumps(found.to_dict())


@pytest.mark.parametrize(
    ("keywords", "told"),
    [
        ({"methods": ()}, "at least one"),
        ({"methods": ("nsga", "nsga")}, "named twice"),
        ({"at": [0.00015]}, "not among the steps"),
        ({"at": [1.0]}, "not among the steps"),
        ({"at": 1.0}, "not among the steps"),
        ({"case": "absent"}, "absent"),
        ({"parameters": {"absent": 1.0}}, "absent"),
        ({"every": 2}, "every is set by the comparison"),
        ({"method": "nsga"}, "method is set by the comparison"),
    ],
)
def test_wrong_calls_are_explained(keywords: dict[str, object], told: str) -> None:
    with pytest.raises(carom.CaromError, match=told):
        carom.compare(THREE, **{"methods": ("nsga", "moreau"), **keywords})  # type: ignore[arg-type]


def test_command_prints_one_document() -> None:
    code, out, _ = command(str(THREE), "--methods", "nsga,moreau", "--at", "0.01,0.015", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["reference"] == "nsga"
    assert document["times"] == pytest.approx([0.01, 0.015, 0.02])
    first, second = document["methods"]
    assert (first["method"], second["method"]) == ("nsga", "moreau")
    for key in (
        "wall_s",
        "core_s",
        "steps",
        "penetration_max",
        "energy",
        "impacts",
        "unconverged",
        "outcome",
    ):
        assert key in second
    assert len(second["differences"]) == 9


def test_command_prints_a_table_with_all_methods() -> None:
    code, out, _ = command(str(THREE), "--set", "step=2e-4", "--until", "10 ms")
    assert code == 0
    for word in (
        *default_methods(),
        "wall time",
        "penetration",
        "velocity (m/s)",
        "h = 0.0002 s to t = 0.01 s",
    ):
        assert word in out


def test_command_refuses_what_it_does_not_know() -> None:
    for arguments, told in (
        (["--methods", "nsga,euler"], "no method is called 'euler'"),
        (["--laws", "sequense"], "no impact law is called 'sequense'; did you mean"),
        (["--at", "soon"], '--at: "soon" is not a number with a unit'),
        (["--set", "stepp=1"], "write step="),
    ):
        code, out, err = command(str(THREE), *arguments)
        assert (code, out) == (2, "")
        assert told in err


def test_command_says_that_a_method_stopped() -> None:
    wrong = ["max_iterations=1", "gauss_seidel_sweeps=0", "max_halvings=0", "tolerance=1e-15", "until=0.13"]
    options = [part for w in wrong for part in ("--set", w)]
    code, out, err = command(
        str(SCENARIOS / "paper" / "5.6_break.toml"), "--methods", "nsga,moreau", "--json", *options
    )
    assert code == 3
    assert json.loads(out)["methods"][0]["outcome"].startswith("not converged")
    assert "nsga: not converged" in err


def test_commands_know_cases_and_parameters() -> None:
    from carom.cli.app import app

    path = SCENARIOS / "paper" / "5.2_free_balls.toml"
    code, out, _ = command(str(path), "--case", "slips", "--methods", "nsga,moreau", "--json")
    assert code == 0
    slips = carom.compare(carom.Scene.from_toml(path, case="slips"), ("nsga", "moreau"))
    sticks = carom.compare(carom.Scene.from_toml(path, case="sticks"), ("nsga", "moreau"))
    told = json.loads(out)["methods"][1]["differences"]
    assert [d["greatest"] for d in told] == [d.greatest for d in slips["moreau"].differences]
    assert [d["greatest"] for d in told] != [d.greatest for d in sticks["moreau"].differences]

    arguments = ["converge", str(path), "--steps", "2e-3,1e-3", "--reference", "1e-4", "--json"]
    found = [
        json.loads(CliRunner().invoke(app, [*arguments, "--set", f"mu_b={mu}"]).stdout)["quantities"]
        for mu in (0.06, 0.2)
    ]
    assert found[0]["angular_velocity"] != found[1]["angular_velocity"]


def test_one_time_and_one_method_need_no_list() -> None:
    found = carom.compare(THREE, "moreau", at=0.01)
    assert [run.name for run in found] == ["moreau"]
    assert found.times == pytest.approx((0.01, 0.02))


def test_a_variant_of_a_file_is_compared_by_its_path() -> None:
    path = SCENARIOS / "paper" / "5.2_free_balls.toml"
    by_path = carom.compare(path, ("nsga", "moreau"), case="slips", parameters={"mu_b": 0.05})
    scene = carom.Scene.from_toml(path, case="slips", parameters={"mu_b": 0.05})
    by_scene = carom.compare(scene, ("nsga", "moreau"))
    assert by_path["moreau"].differences == by_scene["moreau"].differences
    assert by_path.case == "slips"
    assert "[slips]" in str(by_path).splitlines()[0]
    assert carom.simulate(path, case="slips", until=0.01).case == "slips"
    with pytest.raises(carom.CaromError, match="case chooses a variant of a file"):
        carom.compare(scene, case="sticks")


def test_at_rest_the_differences_are_relative_to_the_motion_before() -> None:
    """A ball that slides to rest: both methods end with speeds of rounding, whose ratio would mean nothing."""
    scene = carom.Scene("to rest", run={"until": 0.5, "step": 1e-3})
    scene.contact("ball", "bed", friction=0.5, restitution=0.0, rolling_radius=0.01)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="bed")
    scene.sphere("cue", radius=0.03, mass=0.17, position=(0, 0, 0.03), velocity=(0.2, 0, 0), material="ball")
    found = carom.compare(scene, ("nsga", "moreau"))
    assert np.abs(found["nsga"].states["velocity"][-1]).max() < 1e-6
    assert all(d.relative < 1e-2 for d in found["moreau"].differences)


def test_a_method_that_is_left_out_is_named() -> None:
    path = SCENARIOS / "paper" / "5.1_torque.toml"
    found = carom.compare(path, until=0.01)
    assert "penalty" not in [run.name for run in found]
    assert "penalty is left out" in found.remarks[0]
    assert "penalty is left out" in str(found)
    assert found.remarks[1] == "events is left out: it takes fewer scenes and is named, as nsga,events"
    assert found.to_dict()["remarks"] == list(found.remarks)
    code, out, err = command(str(path), "--until", "0.01")
    assert code == 0
    assert "penalty is left out" in err
    assert out.splitlines()[0] == str(found).splitlines()[0]
    assert not carom.compare(path, ("nsga",), until=0.01).remarks
    assert len(repr(found).splitlines()) == 1


def test_the_example_that_is_no_file_yet_is_hinted_at() -> None:
    code, _, err = command("paper/5.6_break")
    assert code == 2
    assert "carom examples copy paper/5.6_break" in err


def test_a_table_without_a_title_is_headed_by_the_name_of_the_file(tmp_path: Path) -> None:
    """It was headed "comparison: h = ..."."""
    (tmp_path / "row.toml").write_text(re.sub(r"(?m)^title = .*$", 'title = ""', THREE.read_text("utf-8")))
    code, out, _ = command(str(tmp_path / "row.toml"), "--laws", "all")
    assert code == 0
    assert out.startswith("row.toml: h = 0.0001 s to t = 0.02 s")


def test_all_methods_that_cannot_take_a_scene_are_named_at_once() -> None:
    path = SCENARIOS / "paper" / "5.1_torque.toml"
    told = "penalty: method penalty knows no joints; events: method events does not know .*; compare nsga, "
    with pytest.raises(carom.CaromError, match=told):
        carom.compare(path, ("nsga", "penalty", "events"), until=0.01)
    with pytest.raises(carom.CaromError, match=r"^option method penalty knows no joints; choose nsga"):
        carom.compare(path, ("nsga", "penalty"), until=0.01)


def test_methods_that_know_no_clumps_are_left_out() -> None:
    scene = carom.Scene("clump", run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.clump("c", spheres=[[0, 0, 0, 0.02], [0.03, 0, 0, 0.02]], density=1000, material="m", at=(0, 0, 1))
    told = "nothing is left to compare nsga with: moreau: clumps need method nsga, found moreau; moreau+projection: "
    with pytest.raises(carom.CaromError, match=f"^{re.escape(told)}"):
        carom.compare(scene)
    alone = carom.compare(scene, "nsga")
    assert "off nsga" not in str(alone)
    assert not alone.remarks
    laws = carom.compare(scene, laws="all")
    cause = "clumps need another impact law than sequence-paper"
    assert laws.remarks == (f"nsga+sequence-paper is left out: {cause}",)
    assert len(laws) == len(LAWS) - 1
    with pytest.raises(carom.CaromError, match=cause):  # it was named
        carom.compare(scene, laws=list(LAWS))


def test_a_ball_that_left_has_no_number_and_others_have_theirs(tmp_path: Path) -> None:
    """Positions of all balls went without a word, and the velocities of the one that left agreed."""
    scene = carom.Scene("out", run={"until": 0.5, "step": 1e-3}, gravity=(0, 0, -9.8))
    scene.contact("m", "m", friction=0.2, restitution=0.0)
    scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for k, name in enumerate(("stays", "left")):
        scene.sphere(name, radius=0.03, mass=0.1, position=(0, k, 0.03), velocity=(0.1, k, 0), material="m")
    alone = carom.compare(scene.with_options(until=0.3), ("nsga", "moreau"))
    assert not alone.remarks
    scene.outlet(low=(-1, 1.31, -1), high=(1, 9, 1))
    found = carom.compare(scene, ("nsga", "moreau"), at=0.3)
    assert found.remarks == ('differences at 0.5 s leave out "left": not there in all runs',)
    early, late = ([d for d in found["moreau"].differences if d.time == t] for t in found.times)
    assert [d.greatest for d in early] == [d.greatest for d in alone["moreau"].differences]
    assert [(d.quantity, d.body) for d in late if d.body != "stays"] == []
    assert len(late) == 3
    assert all(0 < d.relative < 1e-2 for d in late if d.greatest)
    for run in found:
        assert np.isnan(run.states["velocity"][-1, 1]).all()
    found.plot().savefig(tmp_path / "velocities.png")
    laws = carom.compare(scene.with_options(until=1.0), laws=("sequence", "poisson"))
    assert "left  " not in str(laws)


@pytest.mark.parametrize("velocity", [(0.5, -1.0, 0.0), (0.0, 0.0, 2.0), (0.1, 0.2, 0.3), (0.0, 0.0, 0.0)])
def test_the_figure_shows_all_components_in_which_bodies_move(velocity: tuple[float, float, float]) -> None:
    """Of a ball that flies freely its velocity at the start, in whatever direction; of one that rests v_x alone."""
    pytest.importorskip("matplotlib")
    scene = carom.Scene(run={"until": 0.01, "step": 1e-3}, gravity=(0, 0, 0))
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    scene.sphere("b", radius=0.01, mass=0.1, position=(0, 0, 0), velocity=velocity, material="m")
    chart = beside(carom.compare(scene, ["nsga", "moreau"]))
    shown = {f"v_{x}": v for x, v in zip("xyz", velocity, strict=True) if v} or {"v_x": 0.0}
    assert [axes.get_ylabel() for axes in chart.figure.axes] == [f"${name}$ (m/s)" for name in shown]
    for axes, v in zip(chart.figure.axes, shown.values(), strict=True):
        assert [bar.get_height() for bar in axes.patches] == [v, v]
    expected = {f"{method} {name} (m/s)": [v] for name, v in shown.items() for method in ("nsga", "moreau")}
    assert {name: list(values) for name, values in chart.data.items()} == {"body": ["b"], **expected}


def test_where_all_balls_left_nothing_is_compared() -> None:
    scene = carom.Scene("out", run={"until": 0.1, "step": 1e-3})
    scene.contact("m", "m", friction=0.2, restitution=0.0)
    scene.sphere("a", radius=0.03, mass=0.1, position=(0, 0, 0), velocity=(1, 0, 0), material="m")
    scene.outlet(low=(0.05, -1, -1), high=(1, 1, 1))
    found = carom.compare(scene, laws=("sequence", "poisson"))
    assert not found["nsga+poisson"].differences
    assert str(found).count("no ball is there in all runs") == 1
    assert "nan" not in str(found)
    found.plot()


def test_warnings_are_those_of_the_compared_methods(tmp_path: Path) -> None:
    """What the scene's own method need not mind was said of none: nsga ran at the distance of the frames of events."""
    scene = carom.Scene("fast", run={"until": 0.1, "step": 0.01, "method": "events"})
    scene.contact("m", "m", friction=0.2, restitution=0.9)
    for k in range(2):
        scene.sphere(f"b{k}", radius=0.03, mass=0.1, position=(k, 0, 0), velocity=(k, 0, 0), material="m")
    told = "run.step: a step of 0.01 s moves"
    with pytest.warns(carom.CaromWarning) as found:
        carom.compare(scene, ("events", "nsga", "moreau"))
    [one] = [str(warning.message) for warning in found]
    assert one.startswith("nsga, moreau: ")
    assert told in one
    file = tmp_path / "fast.toml"
    scene.to_toml(file)
    _, _, error = command(str(file), "--methods", "nsga,moreau")
    assert error.count(told) == 1
    assert "nsga, moreau:" not in error  # it holds for all
    assert command(str(file), "--methods", "events,penalty")[2] == ""
    read = [
        command(str(file), "--methods", names, "--set", "impact=poisson")[2]
        for names in ("penalty", "penalty,events")
    ]
    assert ["method penalty does not read it" in error for error in read] == [True, False]


def test_an_option_that_no_method_reads_is_told_once() -> None:
    scene = carom.Scene("two", run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0.2, restitution=0.9)
    scene.sphere("b", radius=0.03, mass=0.1, position=(0, 0, 0), material="m")
    for methods in (["moreau", "penalty"], ["penalty", "moreau+projection", "moreau"]):
        with pytest.warns(carom.CaromWarning) as found:
            carom.compare(scene, methods, spectral_radius=0.5)
        [told] = [str(warning.message) for warning in found]
        names = " or ".join(dict.fromkeys(name.partition("+")[0] for name in methods))
        assert told.startswith(f"compare: spectral_radius: method {names} does not read it; leave it out")


def test_laws_are_no_advice_where_laws_were_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    def validate(scene: carom.Scene) -> list[object]:
        if scene.run.impact != "poisson":
            raise carom.CaromError(f"no {scene.run.impact}")
        return []

    scene = carom.Scene("one", run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0.2, restitution=0.9)
    scene.sphere("b", radius=0.03, mass=0.1, position=(0, 0, 0), material="m")
    monkeypatch.setattr(carom.Scene, "validate", validate)
    told = (
        r"nothing is left to compare nsga\+poisson with: nsga\+sequence: no sequence.*; simulate it by that$"
    )
    with pytest.raises(carom.CaromError, match=told):
        carom.compare(scene, laws="all")


def test_where_no_method_can_take_a_scene_all_are_named() -> None:
    """One named at a time takes as many tries as there are methods."""
    scene = carom.Scene("clump", run={"until": 0.01, "step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.clump("c", spheres=[[0, 0, 0, 0.02], [0.03, 0, 0, 0.02]], density=1000, material="m", at=(0, 0, 1))
    told = r'penalty: .*found penalty; events: .*found events; moreau: .*found moreau; write method = "nsga"'
    with pytest.raises(carom.CaromError, match=told):
        carom.compare(scene, ("penalty", "events", "moreau"))


def test_times_may_have_units() -> None:
    code, out, _ = command(str(THREE), "--methods", "nsga,moreau", "--at", "10 ms,.005", "--json")
    assert code == 0
    assert json.loads(out)["times"] == pytest.approx([0.005, 0.01, 0.02])


@pytest.mark.parametrize(("slow", "shown"), [(0.0, [0]), (2e-8, [0]), (1e-4, [0, 1])])
def test_what_solvers_leave_of_a_component_has_no_panel(slow: float, shown: list[int]) -> None:
    """1e-8 of the speed across the flight was drawn as large as the flight."""
    scene = carom.Scene("flight", gravity=(0, 0, 0), run={"until": 0.01, "step": 1e-3})
    scene.sphere("a", radius=0.03, mass=0.1, at=(0, 0, 0), velocity=(2, 2 * slow, 0), material="m")
    found = carom.compare(scene, methods=["nsga", "moreau"])
    assert found.directions == shown
    assert len(found.plot().axes) == len(shown)
