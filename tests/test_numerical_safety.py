"""Numbers that run away stop the run where they do, with names; what is not solved is told; no step is endless."""

from __future__ import annotations

import json
import time
import warnings
from pathlib import Path
from typing import Any

import carom
import joint_scenes
import numpy as np
import pytest
from carom import CaromWarning, Scene, _core
from carom.cli import main

H = 1e-3


def two_balls(**run: Any) -> Scene:
    """Ball a rests on the floor, b beside it touches it."""
    scene = Scene("two balls", run={"until": 0.03, "step": H, **run})
    scene.contact("m", "m", friction=0.3, restitution=0.5)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 0.1), material="m")
    scene.sphere("b", radius=0.1, mass=1, at=(0.2, 0, 0.1), material="m")
    return scene


def failed(scene: Scene, out: Path) -> carom.Result:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", CaromWarning)
        with pytest.raises(carom.RunFailed) as caught:
            carom.simulate(scene, out=out)
    return caught.value.result


def kept(result: carom.Result, step: int) -> None:
    """The run says that it failed in a step, and all before it is there and finite."""
    assert result.outcome.step == step
    assert result.status == "failed"
    again = carom.load(result.path)  # from the files alone
    assert len(again.steps) == step - 1
    assert again.step[-1] == step - 1
    assert np.isfinite(np.asarray(again.position)).all()
    assert json.loads((result.path / "run.json").read_text())["status"] == "failed"
    assert list(result.path.glob("checkpoint-*.npz"))


class TestNoNumbers:
    """A load, a law or a function that gives no number."""

    @pytest.mark.parametrize(
        ("law", "step"), [("sqrt(0.0105 - t)", 11), ("1/max(0, 0.0095 - t)", 10), ("ln(0.0095 - t)", 10)]
    )
    def test_of_a_law_of_time(self, law: str, step: int, tmp_path: Path) -> None:
        scene = two_balls()
        scene.load("a", force=(0, {"expression": f"1e-6*{law}"}, 0))
        result = failed(scene, tmp_path / "run")
        kept(result, step)
        assert result.outcome.kind == "load_failed"
        assert result.outcome.bodies == ("a",)

    @pytest.mark.parametrize("value", [np.nan, np.inf])
    def test_of_a_function(self, value: float, tmp_path: Path) -> None:
        def wild(t: float, x: np.ndarray, v: np.ndarray, w: np.ndarray) -> np.ndarray:
            out = np.zeros((2, 6))
            out[1, 4] = value if t > 0.0095 else 0.0
            return out

        scene = two_balls()
        scene.load_function(wild)
        result = failed(scene, tmp_path / "run")
        kept(result, 10)
        assert result.outcome.kind == "load_failed"
        assert 'load function "wild"' in result.outcome.message
        assert "sphere number 2" in result.outcome.message

    def test_of_the_motion_of_a_wall(self, tmp_path: Path) -> None:
        scene = two_balls()
        scene.plane(
            "lid",
            point=(0, 0, 9),
            normal=(0, 0, -1),
            material="m",
            motion={"rotation": {"axis": (0, 0, 1), "angle": {"expression": "exp(1e5*t) - 1"}}},
        )
        result = failed(scene, tmp_path / "run")
        assert result.outcome.kind == "load_failed"
        assert result.outcome.bodies == ("lid",)


class TestBlowUp:
    """Numbers that are finite and mean nothing any more."""

    @pytest.mark.parametrize("torque", [1e100, 1e200, 1e300])
    def test_by_a_load(self, torque: float, tmp_path: Path) -> None:
        scene = two_balls()
        scene.load("b", torque=(0, {"table": [[0, 0], [0.0095, 0], [0.0096, torque]]}, 0))
        result = failed(scene, tmp_path / "run")
        kept(result, 10)
        assert result.outcome.kind in ("blow_up", "not_finite")
        assert result.outcome.level == "smooth"
        assert result.outcome.bodies[0] == "b"
        assert "load" in result.outcome.advice

    def test_at_a_contact_keeps_its_problem(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        # A floor without limit of friction turns under the ball, faster than anything.
        scene = Scene("turntable", run={"until": 0.03, "step": H, "position_friction": "paper"})
        scene.contact("m", "m", friction=1e200, restitution=0)
        angle = {"table": [[0, 0], [0.0095, 0], [0.5, 4e11]]}
        scene.plane(
            "table",
            point=(0, 0, 0),
            normal=(0, 0, 1),
            material="m",
            motion={"rotation": {"axis": (0, 0, 1), "point": (9, 0, 0), "angle": angle}},
        )
        scene.sphere("a", radius=0.1, mass=1, at=(0, 0, 0.1), material="m")
        result = failed(scene, tmp_path / "run")
        kept(result, 10)
        outcome = result.outcome
        assert outcome.kind == "blow_up"
        assert outcome.bodies == ("a", "table")
        assert outcome.level in ("position", "velocity")
        assert outcome.problem_file == "failing_problem.h5"
        problem = carom.ContactProblem.from_run(result.path)
        assert problem.contacts == 1
        with pytest.raises(SystemExit) as left:
            main(["solve", str(result.path / "failing_problem.h5"), "--json"])
        assert left.value.code in (None, 0, 3), "solved or not, it is a problem"
        (solved,) = json.loads(capsys.readouterr().out)["results"]
        assert Path(solved["file"]).name == "failing_problem.h5"

    def test_is_never_taken_for_a_solution(self, tmp_path: Path) -> None:
        scene = two_balls(on_nonconvergence="warn")
        scene.load("b", torque=(0, {"table": [[0, 0], [0.0095, 0], [0.0096, 1e200]]}, 0))
        kept(failed(scene, tmp_path / "run"), 10)


def corner() -> Path:
    return carom_scenarios() / "corner.toml"


def carom_scenarios() -> Path:
    return Path(carom.__file__).parent / "scenarios"


#: No solver can reach this.
HOPELESS = {"max_iterations": 2, "gauss_seidel_sweeps": 0, "tolerance": 1e-13, "max_halvings": 1}


class TestNotConverged:
    def command(self, out: Path, *more: str) -> int | str | None:
        settings = [f"--set={key}={value}" for key, value in HOPELESS.items()]
        with pytest.raises(SystemExit) as left:
            main(["run", str(corner()), "-o", str(out), "--quiet", "--until", "0.055", *settings, *more])
        return left.value.code

    def test_stops_by_default(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert self.command(tmp_path / "run") == 3
        assert "not converged at step" in capsys.readouterr().err
        result = carom.load(tmp_path / "run")
        assert result.outcome.kind == "not_converged"
        assert (tmp_path / "run" / "failing_problem.h5").is_file()
        assert not np.asarray(result.steps["unconverged"]).any()

    def test_where_a_driven_wall_wedges_a_rough_ball_the_message_says_so(self) -> None:
        tilt = np.radians(10)
        scene = Scene("wedged", gravity=(0, 0, 0), run={"until": 0.02, "step": H})
        scene.contact("m", "m", friction=1.0, restitution=0.0)
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
        scene.plane(
            "press",
            point=(0, 0, 0.0212),
            normal=(np.sin(tilt), 0, -np.cos(tilt)),
            material="m",
            motion={"translation": [0, 0, {"expression": "-0.1*t"}]},
        )
        scene.sphere("ball", radius=0.01, mass=0.01, at=(0, 0, 0.01), material="m")
        with pytest.raises(carom.RunFailed, match="driven wall wedges bodies no motion is a solution"):
            carom.simulate(scene)
        with pytest.warns(CaromWarning):
            result = carom.simulate(scene, on_nonconvergence="warn")
        assert result.summary["unconverged"] > 0

    def test_goes_on_if_told_and_marks_the_steps(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert self.command(tmp_path / "run", "--on-nonconvergence", "warn") in (None, 0)
        assert "accepted unconverged" in capsys.readouterr().err  # --quiet is no reason to pass over it
        result = carom.load(tmp_path / "run")
        assert result.outcome.ok
        marked = np.asarray(result.steps["unconverged"])
        assert marked.any()
        assert result.summary["unconverged"] == marked.sum()

    def test_takes_no_other_word(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert self.command(tmp_path / "run", "--on-nonconvergence", "ignore") == 2
        assert "known: stop, warn" in capsys.readouterr().err
        assert not (tmp_path / "run").exists()


class TestBoundedWork:
    """The bounds that docs/reference/errors.md states, in scenes made to reach them."""

    SOLVED_PER_CONTACT, HALVINGS, RESCUE, ITERATIONS = 200, 4, 8, 50

    def wedged(self, balls: int, ratio: float, h: float) -> Scene:
        """A column between two walls that leaves it no room, hit from above by a ball of `ratio` times its mass."""
        scene = Scene("wedged", run={"until": 5 * h, "step": h})
        scene.contact("m", "m", friction=1.0, restitution=1.0)
        scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
        scene.plane("left", point=(-0.1, 0, 0), normal=(1, 0, 0.05), material="m")
        scene.plane("right", point=(0.1, 0, 0), normal=(-1, 0, 0.05), material="m")
        for k in range(balls):
            last = k == balls - 1
            scene.sphere(
                f"b{k}",
                radius=0.1,
                mass=ratio if last else 1.0,
                at=(0, 0, 0.2 + 0.2 * k),
                velocity=(0.1, 0, -3) if last else (0, 0, 0),
                material="m",
            )
        return scene

    @pytest.mark.parametrize(("balls", "h"), [(4, 1e-3), (8, 2e-2), (20, 1e-2)])
    def test_of_a_wedged_column(self, balls: int, h: float) -> None:
        begin = time.monotonic()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)
            try:
                result = carom.simulate(self.wedged(balls, 1e6, h))
            except carom.RunFailed as stopped:
                result = stopped.result
        # A step that is given up in words is an end, too. Half a minute is a thousand times what it takes.
        assert time.monotonic() - begin < 30.0
        steps = result.steps
        assert len(steps) or result.outcome.failed
        if len(steps):
            # Each problem solves one contact at least. Pairs of neighbours, and each ball with three walls, may touch.
            bound = self.SOLVED_PER_CONTACT * (4 * balls - 1) + 2
            assert np.asarray(steps["impact_problems"]).max() <= bound
            assert np.asarray(steps["halvings"]).max() < 2 ** (self.RESCUE + 1)
            assert np.asarray(steps["relisted"]).max() <= 20 * (2 ** (self.RESCUE + 1) - 1)
            most = max(np.asarray(steps[f"iterations_{level}"]).max() for level in ("position", "velocity"))
            # Rungs of the chain, linearisations, sweeps and their polish: all of one solve.
            assert most <= 20 * self.ITERATIONS

    def test_of_a_step_without_a_solution(self) -> None:
        """A ball between planes that leave it no room, accepted all the same: where a smallest part was not solved, no
        larger one is tried again. All 31 parts were, and each swept on in vain: absurd joints took 5 s a step."""
        room = [((0, 0, 0), (0, 0, 1)), ((0, 0, 0.15), (0, 0, -1))]
        law = {"friction": 0.3}
        model = joint_scenes.scene([[0, 0, 0.075]], planes=room, law=law, on_nonconvergence="warn")
        simulation = _core.Simulation(model)
        simulation.keep_problems([(1, 1, 1)], 0)
        steps = simulation.advance(1, 1, True, 1e9)["steps"]
        smallest = 2**self.HALVINGS
        assert steps["unconverged"].tolist() == [smallest]
        assert steps["halvings"].tolist() == [smallest - 1]
        # Counted from 0: larger parts down to the first of the smallest, then these alone.
        assert max(kept["part"] for kept in simulation.take_problems(False)) == self.HALVINGS + smallest - 1

    def test_of_a_step_far_too_long(self) -> None:
        begin = time.monotonic()
        scene = two_balls(step=1e6, until=1e7)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", CaromWarning)
            try:
                result = carom.simulate(scene)
            except carom.RunFailed as stopped:
                result = stopped.result
        assert result.outcome.ok or result.outcome.advice
        assert np.isfinite(np.asarray(result.position)).all()
        assert time.monotonic() - begin < 30.0


class TestNonsense:
    """Physical nonsense is told before anything is computed."""

    def test_a_mass_ratio_without_measure(self) -> None:
        scene = two_balls()
        scene.sphere("dust", radius=0.1, mass=0.9e-4, at=(1, 0, 0.1), material="m")
        words = '"a" has 1.1e+04 times the mass of "dust", more than 10000'
        assert sum(words in str(advice) for advice in scene.validate()) == 1
        scene.spheres[2].mass = 1.1e-4
        assert not any("times the mass" in str(advice) for advice in scene.validate())

    @pytest.mark.parametrize("finite", [False, True])
    def test_a_ball_outside_a_closed_box(self, finite: bool) -> None:
        scene = two_balls()
        scene.box("room", low=(-0.5, -0.5, 0), high=(0.5, 0.5, 1), material="m", finite=finite)
        assert scene.validate() == []
        scene.sphere("stray", radius=0.1, mass=1, at=(3, 0, 0.5), material="m")
        with pytest.raises(carom.ScenarioError) as caught:
            scene.validate()
        (problem,) = caught.value.problems
        assert 'sphere "stray" is outside box "room", which is closed' in str(problem)

    def test_a_ball_outside_six_planes(self) -> None:
        scene = two_balls()
        for name, point, normal in [
            ("ceiling", (0, 0, 1), (0, 0, -1)),
            *((f"x{s}", (-s, 0, 0), (s, 0, 0)) for s in (-1, 1)),
            *((f"y{s}", (0, -s, 0), (0, s, 0)) for s in (-1, 1)),
        ]:
            scene.plane(name, point=point, normal=normal, material="m")
        scene.sphere("stray", radius=0.1, mass=1, at=(3, 0, 0.5), material="m")
        with pytest.raises(carom.ScenarioError, match=r'sphere "stray" reaches 2.1 m behind plane "x-1"'):
            scene.validate()


def test_what_is_at_rest_with_drag_and_without_weight_is_solved() -> None:
    """All terms of eq. 44 were 0 there, and a residual of 0 over them was none: the first step had not converged."""
    scene = Scene(gravity=(0, 0, 0), run={"until": 5 * H, "step": H})
    scene.contact("m", "m", friction=0.1, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.sphere("a", radius=0.02, mass=0.04, at=(0, 0, 0.02), material="m")
    scene.drag("a", translation=0.02)
    result = carom.simulate(scene)
    assert result.outcome.ok
    assert not np.any(result.velocity[:])
