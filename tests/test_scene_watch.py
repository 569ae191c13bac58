"""Callbacks and stop conditions of `carom.simulate`: what they see, how they end a run, and that they change nothing."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest
from carom import CaromError
from carom.events import AtRest
from carom.run.watch import View


def falling(until: float = 1.0) -> carom.Scene:
    """A ball that drops 1 m onto a plane and stays there."""
    scene = carom.Scene("falling ball", run={"until": until, "step": 1e-3})
    scene.sphere("ball", radius=0.1, mass=0.5, at=(0, 0, 1.1), velocity=(1.0, 0, 0), material="steel")
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="steel")
    scene.contact("steel", "steel", friction=0.3, restitution=0.0)
    return scene


def test_a_callback_sees_the_states_that_are_recorded_and_changes_nothing() -> None:
    seen: list[tuple[float, Any, float, int]] = []

    def look(view: View) -> None:
        seen.append((view.time, view.position.copy(), view["ball"].speed, view.contacts))

    plain = carom.simulate(falling(), every=50)
    result = carom.simulate(falling(), every=50, callback=look)
    assert [s[0] for s in seen] == np.asarray(result.time)[1:].tolist()
    assert np.array_equal([s[1] for s in seen], np.asarray(result.position)[1:])
    assert np.array_equal(np.asarray(plain.position), np.asarray(result.position))
    assert np.array_equal(plain.energy.total, result.energy.total)
    assert np.array_equal(plain.impacts["impulse"], result.impacts["impulse"])
    assert {s[3] for s in seen} == {0, 1}
    assert seen[0][2] == pytest.approx(np.hypot(1.0, 9.8 * 0.05), rel=1e-12)


def test_a_callback_may_be_called_more_often_than_frames_are_kept() -> None:
    steps: list[int] = []
    result = carom.simulate(falling(0.1), every=50, callback=lambda v: steps.append(v.step), callback_every=7)
    assert steps == list(range(7, 101, 7))
    assert np.asarray(result.step).tolist() == [0, 50, 100]


def test_a_view_ends_with_the_call_and_its_arrays_are_read_only() -> None:
    kept: list[View] = []
    arrays: list[Any] = []

    def keep(view: View) -> None:
        kept.append(view)
        arrays.append(view.velocity)
        with pytest.raises(ValueError, match="read-only"):
            view.velocity[0, 0] = 100.0
        for fixed in (view.radius, view.mass, view.inertia):  # the run has the same arrays
            with pytest.raises(ValueError, match="read-only"):
                fixed[0] = 100.0
        ball = view["ball"]
        assert (ball.radius, ball.mass, ball.present) == (0.1, 0.5, True)
        assert ball.inertia == view.inertia[0]
        assert np.array_equal(ball.orientation, view.orientation[0])
        assert "'ball'" in repr(ball)
        energy = 0.5 * 0.5 * float((view.velocity**2).sum())
        assert view.kinetic_energy == pytest.approx(energy)
        assert view.present.all()

    result = carom.simulate(falling(0.03), every=10, callback=keep)
    assert np.array_equal(arrays[1], np.asarray(result.velocity)[2])
    with pytest.raises(CaromError, match="the view of step 10 is over"):
        _ = kept[0].position
    with pytest.raises(CaromError, match="is over"):
        _ = kept[0].contacts
    assert "closed" in repr(kept[0])
    with pytest.raises(KeyError, match="did you mean ball"):
        carom.simulate(falling(0.03), callback=lambda view: view["bal"])


def test_a_stop_condition_ends_the_run_well() -> None:
    result = carom.simulate(falling(), stop=lambda view: view["ball"].position[2] < 0.6, callback_every=1)
    # z = 1.1 - g t^2 / 2 passes 0.6 m between steps 319 and 320.
    assert result.outcome.step == 320
    assert (result.outcome.kind, result.status, result.outcome.ok) == ("stopped", "stopped", True)
    assert str(result.outcome).startswith("stopped at step 320, t = 0.32 s")
    assert result.outcome.brief == "stopped at t = 0.32 s"
    assert result.time[-1] == pytest.approx(0.32)
    assert result["ball"].position[-1, 2] < 0.6 <= result.position[0, 0, 2]
    assert len(result.steps) == 320
    assert result.summary["failure"] is None
    with_reason = carom.simulate(falling(), stop=lambda view: "low enough" * (view.time > 0.1))
    assert "low enough" in str(with_reason.outcome)


def test_a_stop_after_the_last_step_stops_nothing() -> None:
    result = carom.simulate(falling(0.1), stop=lambda view: view.step == 100)
    assert result.outcome.kind == "done"


def test_a_stopped_run_goes_on_with_the_bits_of_one_that_was_not(tmp_path: Path) -> None:
    whole = carom.simulate(falling(), every=10)
    part = carom.simulate(falling(), every=10, out=tmp_path / "run", stop=lambda view: view.time > 0.455)
    assert part.outcome.step == 460
    seen: list[int] = []
    result = carom.resume(tmp_path / "run", callback=lambda view: seen.append(view.step))
    assert result.outcome.kind == "done"
    assert seen[0] == 470
    assert np.array_equal(np.asarray(result.position), np.asarray(whole.position))
    assert np.array_equal(result.energy.total, whole.energy.total)


@pytest.mark.parametrize("role", ["callback", "stop"])
def test_what_a_function_raises_comes_out_with_the_result(tmp_path: Path, role: str) -> None:
    def fail(view: View) -> None:
        if view.step == 300:
            raise ZeroDivisionError("no such thing")

    options: dict[str, Any] = {role: fail}
    with pytest.raises(ZeroDivisionError, match="no such thing") as caught:
        carom.simulate(falling(), out=tmp_path / "run", callback_every=100, **options)
    result = caught.value.result  # type: ignore[attr-defined]
    assert result.outcome.kind == "interrupted"
    assert f"{role} raised ZeroDivisionError: no such thing" in str(result.outcome)
    assert result.time[-1] == pytest.approx(0.3)
    assert len(result.steps) == 300
    assert any("error.result" in note for note in caught.value.__notes__)
    whole = carom.simulate(falling())
    assert np.array_equal(np.asarray(carom.resume(tmp_path / "run").position), np.asarray(whole.position))


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        (lambda view: AtRest(), "found AtRest"),
        (lambda view: view["ball"].speed, "found float"),
        (lambda view: view.velocity > 0, r"found ndarray; of an array take \.any\(\) or \.all\(\)"),
    ],
)
def test_a_condition_that_answers_neither_yes_nor_no_is_refused(answer: Any, said: str) -> None:
    """Such an answer is true in Python, and would end the run where it is asked first. A batch says the same."""
    for call in (
        carom.simulate,
        lambda scene, stop: carom.simulate_batch(scene, {"ball.mass": [1.0]}, stop=stop),
    ):
        with pytest.raises(CaromError, match=f"stop must return True, False, None or a text, {said}"):
            call(falling(), stop=answer)


@pytest.mark.parametrize("answer", [np.True_, np.array([True]), "low", True])
def test_every_kind_of_yes_ends_a_run(answer: Any) -> None:
    assert carom.simulate(falling(0.01), stop=lambda view: answer, callback_every=1).outcome.step == 1


def test_wrong_arguments_are_told() -> None:
    with pytest.raises(CaromError, match="stop must be a function"):
        carom.simulate(falling(), stop=3)  # type: ignore[arg-type]
    with pytest.raises(
        CaromError, match=r"stop is the class AtRest; write stop=AtRest\(\), with parentheses"
    ):
        carom.simulate(falling(), stop=AtRest)
    with pytest.raises(CaromError, match="simulate: progress must be a function, as lambda"):
        carom.simulate(falling(), progress=True)  # type: ignore[arg-type]
    with pytest.raises(
        CaromError, match="simulate_batch: progress must be a function, as lambda done, cases"
    ):
        carom.simulate_batch([falling()], progress=False)  # type: ignore[arg-type]
    with pytest.raises(CaromError, match="resume: progress must be a function, as lambda"):
        carom.resume("nowhere", progress=3)  # type: ignore[arg-type]
    for call in (carom.sweep, carom.fit):
        with pytest.raises(CaromError, match="progress must be a function, as lambda"):
            call("nowhere.toml", "nowhere", progress=True)  # type: ignore[operator]
    with pytest.raises(CaromError, match="callback_every must be"):
        carom.simulate(falling(), callback=print, callback_every=0)
    with pytest.raises(CaromError, match="without callback"):
        carom.simulate(falling(), callback_every=5)
