"""Python load functions in a simulation: Ctrl-C, errors, and what a function must not ask the simulation that calls it."""

from __future__ import annotations

import signal
import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import carom
import numpy as np
import pytest


def pushed(function: Callable[..., Any], **run: Any) -> carom.Scene:
    """A ball in free space with a load function."""
    scene = carom.Scene("pushed", gravity=(0, 0, 0), run={"step": 1e-3} | run)
    scene.contact("m", "m", friction=0.3, restitution=0.6)
    scene.sphere("ball", radius=0.02, mass=1.0, at=(0, 0, 0), material="m")
    scene.load_function(function, name="push")
    return scene


@pytest.mark.parametrize("how", ["step", "simulate"])
def test_ctrl_c_is_heard_soon_where_a_load_function_is_slow(how: str) -> None:
    """One small ball makes 1000 steps between two looks at the clock; slow functions made seconds of these."""
    calls = []

    def slow(t: float, *_: Any) -> Any:
        calls.append(t)
        if len(calls) == 40:
            signal.raise_signal(signal.SIGINT)
        time.sleep(5e-3)
        return np.zeros((1, 6))

    scene = pushed(slow)
    make = carom.Simulation(scene).step if how == "step" else lambda n: carom.simulate(scene, until=1e-3 * n)
    with pytest.raises(KeyboardInterrupt, match="interrupted at"):
        make(1000)
    assert 40 <= len(calls) <= 40 + 30  # 0.1 s, of 5 ms at least, and the rest of a step


class Broken(Exception):
    """Not of Carom."""


def runs(scene: carom.Scene, tmp_path: Path) -> dict[str, Callable[[], Any]]:
    """The ways to run a scene up to 0.1 s."""
    return {
        "step": lambda: carom.Simulation(scene).step(100),
        "simulate": lambda: carom.simulate(scene, until=0.1),
        "directory": lambda: carom.simulate(scene, until=0.1, out=tmp_path / "run"),
    }


@pytest.mark.parametrize("method", ["nsga", "moreau", "penalty"])
@pytest.mark.parametrize("how", ["step", "simulate", "directory"])
def test_what_a_load_function_raises_is_the_cause_with_its_traceback(
    how: str, method: str, tmp_path: Path
) -> None:
    def broken(t: float, *_: Any) -> Any:
        if t > 0.05:
            raise Broken("no wind")
        return np.zeros((1, 6))

    with pytest.raises(carom.RunFailed, match="Broken: no wind") as failed:
        runs(pushed(broken, method=method), tmp_path)[how]()
    cause = failed.value.__cause__
    assert isinstance(cause, Broken)
    assert "broken" in [frame.name for frame in traceback.extract_tb(cause.__traceback__)]
    assert failed.value.result.outcome.kind == "load_failed"
    assert failed.value.result.time[-1] == pytest.approx(0.05, abs=2e-3)


@pytest.mark.parametrize("raised", [KeyboardInterrupt, SystemExit])
@pytest.mark.parametrize("how", ["step", "simulate", "directory"])
def test_what_ends_a_program_goes_on_through_a_load_function(
    how: str, raised: type[BaseException], tmp_path: Path
) -> None:
    def ending(t: float, *_: Any) -> Any:
        if t > 0.05:
            raise raised("enough")
        return np.zeros((1, 6))

    with pytest.raises(raised, match="enough"):
        runs(pushed(ending), tmp_path)[how]()


@pytest.mark.parametrize("method", ["nsga", "moreau", "penalty"])
def test_whichever_call_of_a_step_fails_the_state_is_that_of_the_step_before(method: str) -> None:
    """Also the last call, for the work of the load at the end of the step, whose error was taken for no work."""
    calls, first = [0], [0]

    def failing(t: float, x: Any, v: Any, w: Any) -> Any:
        calls[0] += 1
        if calls[0] == first[0]:
            raise Broken
        return np.hstack([1.0 - v, 0 * v])

    sim = carom.Simulation(pushed(failing, method=method), keep=False)
    sim.step(3)
    before, made = sim.state(), calls[0]
    sim.step(1)
    each = calls[0] - made
    good = sim.state()
    assert each >= 2
    for number in range(each):
        sim.restore(before)
        restored = sim.state()
        first[0] = calls[0] + 1 + number
        with pytest.raises(carom.RunFailed):
            sim.step(1)
        assert all(np.array_equal(restored[key], value) for key, value in sim.state().items())
    sim.step(1)
    again = {
        key: value for key, value in sim.state().items() if "monitor" not in key
    }  # totals begin at `restore`
    assert all(np.array_equal(good[key], value) for key, value in again.items())


ASKS: dict[str, Callable[[carom.Simulation], Any]] = {
    "time": lambda sim: sim.time,
    "position": lambda sim: sim.position,
    "state": lambda sim: sim.state(),
    "step": lambda sim: sim.step(1),
    "restore": lambda sim: sim.restore({}),
    "result": lambda sim: sim.result(),
}
BUSY = "the simulation is being stepped; a load function takes what it needs from its arguments, and another thread"


@pytest.mark.parametrize("asked", ASKS)
def test_a_load_function_cannot_ask_the_simulation_that_calls_it(asked: str) -> None:
    sims: list[carom.Simulation] = []

    def asking(t: float, *_: Any) -> Any:
        if sims and t > 0.0055:
            ASKS[asked](sims[0])
        return np.zeros((1, 6))

    sims.append(carom.Simulation(pushed(asking)))
    with pytest.raises(carom.RunFailed, match=BUSY) as failed:
        sims[0].step(10)
    assert isinstance(failed.value.__cause__, carom.CaromError)
    assert sims[0].steps == 5


def test_another_thread_is_told_that_the_simulation_is_being_stepped() -> None:
    inside, go_on = threading.Event(), threading.Event()

    def waiting(t: float, *_: Any) -> Any:
        inside.set()
        go_on.wait(10)
        return np.zeros((1, 6))

    go_on.set()
    sim = carom.Simulation(pushed(waiting))
    go_on.clear()
    inside.clear()
    stepping = threading.Thread(target=sim.step, args=(3,))
    stepping.start()
    assert inside.wait(10)
    try:
        with pytest.raises(carom.CaromError, match=BUSY):
            sim.step(1)
    finally:
        go_on.set()
        stepping.join()
    assert sim.steps == 3


@pytest.mark.parametrize("loads", [np.zeros((1, 6), complex), [[0j] * 6]])
def test_complex_loads_are_refused(loads: Any) -> None:
    with pytest.raises(
        carom.RunFailed, match=r"returned complex numbers; return an array \(1, 6\) of finite numbers"
    ):
        carom.Simulation(pushed(lambda *_: loads)).step()
