"""The auditor on closed loops of joints: near a dead point reactions are large, and the error of a step of third order."""

from __future__ import annotations

import carom
import numpy as np
import pytest
from carom.audit import held
from carom.audit.block import blocks
from carom.audit.data import Run

A, B, PIVOT = np.array([0, 0, 0.2]), np.array([0.3, 0, 0.25]), np.array([0.35, 0, 0])
STEP = 1e-3


def linkage(**options: float) -> carom.Result:
    """Two balls and three rods, which reach a dead point at about 0.2 s."""
    scene = carom.Scene("four bars", gravity=(0, 0, 0), run={"until": 0.25, "step": STEP})
    scene.contact("m", "m", friction=0, restitution=1)
    arm = B - PIVOT
    across = np.array([arm[2], 0, -arm[0]])
    speed = (B - A)[0] / (across @ (B - A)) * across
    scene.sphere("a", radius=0.02, mass=0.1, material="m", position=A.tolist(), velocity=(1, 0, 0))
    scene.sphere("b", radius=0.03, mass=0.2, material="m", position=B.tolist(), velocity=speed.tolist())
    scene.joint("rod", between=["a", "ground"], points=[A.tolist(), [0, 0, 0]])
    scene.joint("rod", between=["b", "ground"], points=[B.tolist(), PIVOT.tolist()])
    scene.joint("rod", between=["a", "b"])
    return carom.simulate(scene, **options)


@pytest.mark.parametrize("options", [{}, {"every": 3}, {"step": 1e-4}, {"spectral_radius": 0.0}])
def test_a_dead_point_is_no_fault(options: dict[str, float]) -> None:
    report = carom.audit.check(linkage(**options))
    assert report.ok, report


def test_the_energy_of_a_step_is_that_of_theory() -> None:
    run = Run(linkage())
    [block] = blocks(run)
    first, last = held.accelerations(block, [0, 1], run.joints)
    power = np.einsum("bk,bk->b", 0.5 * (first + last), last - first) * STEP**2
    change = np.diff(run.steps["energy_kinetic"], prepend=run.steps["energy_kinetic"][0])
    near = slice(150, 240)
    rho = 0.8
    alpha_m, alpha_f = (2 * rho - 1) / (rho + 1), rho / (rho + 1)
    gamma = 0.5 - alpha_m + alpha_f
    variance = gamma * (1 - gamma) + alpha_f * (1 - alpha_f) - alpha_m * (1 - alpha_m)
    expected = 0.5 * (0.25 - 3 * variance) * power
    assert np.abs(change - expected)[near].max() < 0.02 * np.abs(change).max()


def test_what_joints_add_is_what_bodies_do() -> None:
    run = Run(linkage())
    [block] = blocks(run)
    first, last = held.accelerations(block, [0, 1], run.joints)
    moved = np.sqrt(run.mass)[:, None] * (block.v1 - block.v0) / STEP
    mean = 0.5 * (first + last).reshape(-1, 2, 6)[..., :3]
    assert np.abs(moved - mean)[5:].max() < 0.01 * np.abs(mean).max()


@pytest.mark.parametrize("every", [1, 5, 10])
def test_a_ball_that_rests_below_its_arm_is_right_in_any_frames(every: int) -> None:
    """In each step it falls a little before the floor has it: the smooth reaction acts where the arm is then."""
    scene = carom.Scene("arm", gravity=(0, 0, -9.8), run={"step": 1e-3, "until": 0.05})
    scene.contact("m", "m", friction=0, restitution=0.9)
    scene.sphere("a", radius=0.05, mass=3, material="m", at=(0, 0, 0.05))
    scene.plane("floor", material="m", point=(0, 0, 0), normal=(0, 0, 1))
    scene.joint("fix", body="a", point=(0.01, 0.28, 0.3))
    report = carom.audit.check(carom.simulate(scene, every=every, contacts=True))
    assert report.ok, report.findings
    assert report["spin"].judged == 50 // every
    inertia = 0.4 * 3 * 0.05**2
    assert report["spin"].worst is not None
    assert report["spin"].worst.bound < 0.1 * inertia  # a tenth of a rad/s would be seen
