"""Python load functions in a simulation: Ctrl-C, errors, and what a function must not ask the simulation that calls it."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable
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

    with pytest.raises(KeyboardInterrupt, match="interrupted at"):
        if how == "step":
            carom.Simulation(pushed(slow)).step(1000)
        else:
            carom.simulate(pushed(slow, until=1.0))
    assert 40 <= len(calls) <= 40 + 30  # 0.1 s, of 5 ms at least, and the rest of a step
