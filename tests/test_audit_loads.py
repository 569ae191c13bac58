"""The auditor on loads that act through contacts: they work on what contacts give, as the weight does."""

from __future__ import annotations

from collections.abc import Callable

import carom
import numpy as np
import pytest
from carom import audit
from carom.audit import arms, balance, borne
from carom.audit.block import blocks
from carom.audit.data import Run

DOWN = np.array([0, 0, 2.0, 0, 0, 0])
STIFF = {"points": [(0, 0, 0), (0, 0, -0.5)], "stiffness": 1000.0}


def scene(gravity: float = 9.8) -> carom.Scene:
    found = carom.Scene("carried", gravity=(0, 0, -gravity))
    found.contact("b", "b", friction=0.3, restitution=0.5)
    found.sphere("a", radius=0.01, mass=0.1, at=(0, 0, 0), material="b")
    return found


def lid(found: carom.Scene, **how: object) -> None:
    found.plane("lid", point=(0, 0, 0.01), normal=(0, 0, -1), material="b", **how)


def ball(found: carom.Scene) -> None:
    found.spring("a", "ground", **STIFF)
    found.sphere("d", radius=0.01, mass=0.4, at=(0, 0, 0.02), material="b")


def free(found: carom.Scene) -> None:
    found.spring("a", "ground", **STIFF)
    lid(found, free={"mass": 0.4, "force": 2.0})


def driven(found: carom.Scene) -> None:
    found.spring("a", "ground", **STIFF)
    lid(found, motion={"translation": [0, 0, {"expression": "-0.01*(1-cos(20*t))"}]})


def clump(found: carom.Scene) -> None:
    balls = [[0, 0, 0, 0.01], [0.02, 0, 0, 0.01]]
    found.clump("c", spheres=balls, mass=0.1, position=(1, 0, 0), material="b")
    for k, x in enumerate((1.0, 1.02)):
        found.spring(f"c{k + 1}", "ground", points=[(x, 0, 0), (x, 0, -0.5)], stiffness=500.0)
        found.sphere(f"d{k}", radius=0.01, mass=0.4, at=(x + 1e-4 * k, 0, 0.0200001), material="b")


def slanted(found: carom.Scene) -> None:
    ball(found)
    found.joint("line", body="a", direction=(0.3, 0, 1))


def damped(found: carom.Scene) -> None:
    found.spring("a", "ground", **STIFF, damping=3.0)
    found.sphere("d", radius=0.01, mass=0.4, at=(0, 0, 0.02), material="b")


def function(found: carom.Scene) -> None:
    found.load_function(lambda t, x, v, w: np.hstack([0.0 * v, 0.0 * w]) - DOWN)
    found.plane("bed", point=(0, 0, -0.01), normal=(0, 0, 1), material="b")


EACH = [ball, free, driven, slanted, damped, function]


# Clumps need method nsga.
@pytest.mark.parametrize(
    ("load", "method"), [*((load, m) for load in EACH for m in ("nsga", "moreau")), (clump, "nsga")]
)
def test_what_loads_do_through_contacts_is_no_fault(load: Callable[[carom.Scene], None], method: str) -> None:
    found = scene(0.0 if load is function else 9.8)
    load(found)
    for step in (1e-3, 2.5e-4):
        report = audit.check(carom.simulate(found, step=step, until=0.25, method=method))
        assert report["energy balance"].judged >= 0.25 / step
        assert report.ok, report


@pytest.mark.parametrize("load", [ball, free])
def test_nothing_is_left_of_what_springs_do_through_contacts(load: Callable[[carom.Scene], None]) -> None:
    """What is left is what the scheme damps of the swing, and that is of third order in the step."""
    found, left = scene(), []
    load(found)
    for step in (1e-3, 5e-4):
        result = carom.simulate(found, step=step, until=0.25)
        run = Run(result)
        [block] = blocks(run)
        total = np.diff(np.asarray(result.energy.total)) - np.asarray(result.steps.energy_work)[1:]
        each = block.rows.work.sum(axis=1) - balance._lifted(run, block.rows, block.rows.position_impulse)
        works = np.bincount(block.rows.k, each, minlength=block.count)
        through = borne.on_bodies(block).sum(axis=1)
        left.append(np.abs(total - (works - through)[1:]).max())
        assert left[-1] < 0.02 * np.abs(through).max()
    assert left[1] < 0.15 * left[0]


LEASHES: list[tuple[float, tuple[float, float, float], dict[str, object]]] = [
    (0.0, (0.01, 0.0, 0.02), {}),
    (0.0, (0.01, 0.0, 0.02), {"position_friction": "paper"}),
    (0.0, (0.01, 0.0, 0.02), {"spectral_radius": 0.0}),
    (24.0, (0.0, 0.0, 0.03), {}),
    (24.0, (0.0, 0.0, 0.03), {"position_friction": "paper"}),
]


def leash(spin: float, point: tuple[float, float, float]) -> carom.Scene:
    """A ball on the floor, on a rod."""
    found = carom.Scene("leash", gravity=(0, 0, -9.8))
    found.contact("b", "w", friction=0.3, restitution=0.5)
    found.sphere("a", radius=0.02, mass=0.1, at=(0, 0, 0.02), material="b", angular_velocity=(0, 0, spin))
    found.plane("w", point=(0, 0, 0), normal=(0, 0, 1), material="w")
    found.joint("rod", between=["a", "ground"], points=[point, (0.05, 0.1, 0.32)])
    return found


@pytest.mark.parametrize("step", [2e-3, 5e-4])
@pytest.mark.parametrize(("spin", "point", "options"), LEASHES)
def test_reactions_turn_a_ball_by_the_arms_with_which_they_act(
    spin: float, point: tuple[float, float, float], options: dict[str, object], step: float
) -> None:
    """What rests is let fall, and turned by its rod, before the floor takes it back: in each step anew."""
    result = carom.simulate(leash(spin, point), step=step, until=0.03, every=1, **options)
    report = audit.check(result)
    assert report.ok, report
    assert report["spin"].judged == round(0.03 / step)
    if not spin:  # and it is judged by less than it gains
        of_step = [arms.turned(block).off[-1, 0] for block in blocks(Run(result))]
        gained = 0.4 * 0.1 * 0.02**2 * np.abs(result.angular_velocity[-1]).max()
        assert max(of_step) < 1e-2 * gained


@pytest.mark.parametrize(("spin", "point", "options"), LEASHES)
def test_what_a_filter_keeps_goes_on_over_blocks(
    spin: float,
    point: tuple[float, float, float],
    options: dict[str, object],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Each block began as if nothing had been before: how far arms may be off, and the verdict, hung on where it was cut."""
    result = carom.simulate(leash(spin, point), step=2e-3, until=0.03, every=1, **options)
    found = []
    for intervals in (100, 5, 3, 1):
        monkeypatch.setattr("carom.audit.block.BLOCK", 3 * intervals)
        pieces = [arms.turned(block) for block in blocks(Run(result))]
        assert len(pieces) == -(-15 // intervals)
        assert audit.check(result).ok
        found.append(np.concatenate([piece.off for piece in pieces]))
        np.testing.assert_allclose(found[-1], found[0], rtol=1e-9)
    assert found[0].max() > 0.0
