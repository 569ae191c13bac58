"""Errors go from process to process, as pools of processes, sweeps and test runners send them."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import carom
import numpy as np
import pytest
from carom import _core
from carom.errors import CaromError, Problem, ScenarioError
from carom.problem import ContactProblem, SolveFailed
from carom.problem.errors import refuse
from carom.result.names import UnknownName
from carom.result.record.untrusted import Untrusted
from carom.scene.packing.grow import PackingError
from carom.units import UnitError


def unsolvable() -> None:
    """A contact that no impulse opens."""
    ContactProblem.from_matrices(np.zeros((3, 3)), [-1, 0, 0], [0.1]).solve()


def stopping() -> None:
    """A run that a local load function ends."""
    scene = carom.Scene("stopping", gravity=(0, 0, 0), run={"step": 1e-3})
    scene.contact("m", "m", friction=0.3, restitution=0.6)
    scene.sphere("ball", radius=0.02, mass=1.0, at=(0, 0, 0), velocity=(1, 0, 0), material="m")
    scene.load_function(lambda t, *_: np.full((1, 6), np.nan if t > 0.0055 else 0.0), name="wind")
    carom.simulate(scene, until=0.1)


def raised(by: Callable[[], Any]) -> CaromError:
    with pytest.raises(CaromError) as caught:
        by()
    caught.value.add_note("a note")
    return caught.value


@pytest.mark.parametrize(
    "error",
    [
        CaromError("wrong"),
        ScenarioError([Problem("a.toml", "radius", "is -1", "give one above 0", 3, "radius = -1")]),
        UnitError("unknown unit", "write m"),
        PackingError("no room", "take fewer"),
        Untrusted("file:/steps", "is a link", "copy it"),
        UnknownName("no body is called 'a'"),
        refuse("W", "not square", "give a square one"),
        _core.ModelError("wrong"),
        _core.ExpressionError("wrong"),
        raised(unsolvable),
        raised(stopping),
    ],
    ids=lambda error: type(error).__name__,
)
@pytest.mark.parametrize("sent", [copy.copy, lambda error: pickle.loads(pickle.dumps(error))])
def test_an_error_is_the_same_elsewhere(error: Exception, sent: Callable[[Exception], Exception]) -> None:
    there = sent(error)
    assert type(there) is type(error)
    assert (str(there), there.args) == (str(error), error.args)
    assert vars(there).keys() == vars(error).keys()
    assert str(getattr(there, "problems", 0)) == str(getattr(error, "problems", 0))


def test_errors_come_back_from_a_pool_with_what_was_found() -> None:
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        with pytest.raises(SolveFailed, match="another solver") as unsolved:
            pool.submit(unsolvable).result(timeout=60)
        with pytest.raises(carom.RunFailed, match=r"not finite at t = 0\.006 s") as stopped:
            pool.submit(stopping).result(timeout=60)
    assert not unsolved.value.solution.converged
    result = stopped.value.result
    assert result.time[-1] == pytest.approx(5e-3)
    np.testing.assert_allclose(result["ball"].velocity[-1], (1, 0, 0))
    assert [(place.name, place.function) for place in result.scene.load_functions] == [("wind", None)]
