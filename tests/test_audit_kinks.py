"""The auditor on drivers whose laws have kinks: reactions ring on in the filter of the scheme, with alternating sign."""

from __future__ import annotations

from pathlib import Path

import audit_faults as fault
import carom
import h5py
import numpy as np
import pytest
from carom import audit
from carom.audit import reactions
from carom.audit.data import Run
from carom.audit.wrenches import ringing


def less_work(step: int, by: float) -> fault.Fault:
    """The driver is said to have done less in a step."""

    def edit(file: h5py.File) -> None:
        file["steps/energy_work"][step] -= by

    return edit


KINKS = [[0, 0], [0.05, 0], [0.2, 2], [0.3, -1]]


def arm(body: str, gravity: float = 9.8) -> carom.Scene:
    """A clump or a ball that a driver turns about a pin, at rest again after 0.3 s."""
    scene = carom.Scene("arm", gravity=(0, 0, -gravity))
    scene.contact("b", "b", friction=0.3, restitution=0.5)
    if body == "clump":
        balls = [[0.02 * k, 0, 0, 0.01] for k in range(4)]
        scene.clump("r", spheres=balls, material="b", density=3000, position=(0, 0, 0))
    else:
        scene.sphere("r1", radius=0.01, mass=0.04, at=(0.03, 0, 0), material="b")
    scene.joint("fix", body="r1", point=(0, 0, 0))
    scene.joint("motion", body="r1", axis=(0, 1, 0), angle={"table": KINKS})
    scene.joint("lock", body="r1", axes=[[1, 0, 0], [0, 0, 1]])
    return scene


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.95])
@pytest.mark.parametrize(("body", "gravity"), [("clump", 0.0), ("clump", 9.8), ("ball", 9.8)])
def test_what_rings_after_a_kink_is_no_fault(body: str, gravity: float, rho: float) -> None:
    for step in (1e-3, 5e-4):
        result = carom.simulate(arm(body, gravity), step=step, until=0.4, spectral_radius=rho)
        report = audit.check(result)
        for kind in ("energy balance", "energy rise", "joint", "joint speed"):
            assert report[kind].word == "ok", report


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.8, 0.95])
def test_ringing_is_what_the_filter_makes_of_directions_that_turn(rho: float) -> None:
    """Reactions `r` with `W r = 1, 0, 0 ...`, along directions that turned: the same filter of `n r` and `n^2 r`."""
    run = Run(carom.simulate(arm("ball"), step=1e-3, until=0.01, spectral_radius=rho))
    count = 60
    am, af = (2.0 * rho - 1.0) / (rho + 1.0), rho / (rho + 1.0)
    gamma = 0.5 + af - am
    n, unit = np.arange(count), np.eye(1, count)[0]

    def impulse(force: np.ndarray) -> np.ndarray:
        """Eqs. 5b and 6c, from rest."""
        pseudo, found, old = 0.0, np.empty(count), 0.0
        for k, now in enumerate(force):
            new = ((1.0 - af) * now + af * old - am * pseudo) / (1.0 - am)
            found[k], pseudo, old = (1.0 - gamma) * pseudo + gamma * new, new, now
        return found

    inverse = np.linalg.inv(np.stack([impulse(row) for row in np.eye(count)], axis=1))
    reaction = inverse @ unit
    first, second = ringing(run, count)
    assert impulse(n * reaction)[1:] == pytest.approx(first[1:], abs=1e-12)
    assert impulse(n**2 * reaction) == pytest.approx(second, abs=1e-11)


def test_a_kink_is_the_only_change_of_acceleration() -> None:
    run = Run(carom.simulate(arm("ball"), step=1e-3, until=0.4))
    [bends] = reactions.kinked(run)
    at = np.flatnonzero(bends > 0.1 * bends.max())
    assert sorted({int(k) + 1 for k in at}) == [50, 51, 200, 201, 300, 301]


def test_work_that_no_kink_explains_is_found(tmp_path: Path) -> None:
    honest = tmp_path / "honest"
    carom.simulate(arm("ball"), step=1e-3, until=0.4, out=honest)
    fine = audit.check(honest)
    assert fine.ok, fine
    for step, by in ((150, 1e-6), (230, 1e-4), (260, 1e-4), (340, 1e-11)):
        wrong = fault.planted(honest, tmp_path / f"{step}", less_work(step, by))
        assert audit.check(wrong)["energy rise"].word == "violated", step
