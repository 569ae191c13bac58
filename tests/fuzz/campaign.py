"""Endless cases of each target, the same for the same seed."""

from __future__ import annotations

import random
from collections.abc import Iterator
from pathlib import Path

import carom
from carom import _core

from fuzz import material, mutate

#: Kinds of inputs that there are cases of.
TARGETS = ("scenario", "problem", "result", "resume", "checkpoint", "state", "expression")


def cases(target: str, base: Path, seed: int) -> Iterator[bytes]:
    """Mutations of the material in the folder `base`."""
    r = random.Random(f"{target} {seed}")
    if target == "scenario":
        good = material.scenarios()
        while True:
            yield mutate.scenario(r, good)
    if target == "problem":
        good = material.problems(base)
        while True:
            yield mutate.problem(r, good)
    run = base / material.RUN
    if target == "result":
        while True:
            yield mutate.result(r, run)
    if target == "resume":
        while True:
            yield mutate.result(r, run, (2, 5, 2, 3))
    if target == "checkpoint":
        whole = sorted(run.glob("checkpoint-*.npz"))[-1].read_bytes()
        while True:
            yield mutate.checkpoint(r, whole)
    if target == "state":
        simulation = _core.Simulation(carom.Scene.from_toml(material.SCENE).to_model())
        simulation.advance(5, 1, True, 1.0)
        arrays = dict(simulation.state())
        while True:
            yield mutate.state(r, arrays)
    if target != "expression":
        raise ValueError(f"no kind of input is called {target!r}; there are {', '.join(TARGETS)}")
    functions = _core.Expression.functions()
    while True:
        text = mutate.expression(r, functions)
        yield mutate.damaged(r, text.encode()) if r.random() < 0.2 else text.encode()
