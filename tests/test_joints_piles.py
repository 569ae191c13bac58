"""Joints among many contacts, and joints that repeat one another."""

import itertools

import carom
import numpy as np
import pytest

R = 0.01


def rigid(rods: list[tuple[int, int]]) -> carom.Result:
    """Eight balls joined by rods, tumbling freely: they turn by 2 rad in 40 steps."""
    scene = carom.Scene("body", gravity=(0, 0, 0))
    scene.contact("steel", "steel", friction=0, restitution=0)
    rng = np.random.default_rng(1)
    spin = np.array([30.0, -20.0, 35.0])
    for n, corner in enumerate(itertools.product((0, 1), repeat=3)):
        at = np.array(corner) * 2.1 * R + rng.uniform(-1, 1, 3) * 3e-4
        moves = {"velocity": np.cross(spin, at), "angular_velocity": spin}
        scene.sphere(f"b{n}", radius=R, mass=0.01, at=at, material="steel", **moves)
    for a, b in rods:
        scene.joint("rod", between=[f"b{a}", f"b{b}"])
    return carom.simulate(scene, until=0.04, step=1e-3)


@pytest.mark.filterwarnings("ignore:.*hold the same motion:carom.CaromWarning")
def test_reactions_that_repeat_one_another_are_the_least():
    """28 rods where 18 hold: the motion is the same, and 18 have no smaller reactions. They were 1e4 times as large."""
    every = list(itertools.combinations(range(8), 2))
    few, rank = [], 0
    corners = np.array(list(itertools.product((0, 1), repeat=3)), dtype=float)
    corners += np.random.default_rng(2).normal(size=(8, 3)) * 0.1
    rows = np.zeros((0, 24))
    for a, b in every:
        row = np.zeros(24)
        row[3 * a : 3 * a + 3] = corners[a] - corners[b]
        row[3 * b : 3 * b + 3] = corners[b] - corners[a]
        if np.linalg.matrix_rank(np.vstack([rows, row])) > rank:
            rows, rank = np.vstack([rows, row]), rank + 1
            few.append((a, b))
    assert rank == 18
    least, other = rigid(every), rigid(few)
    for name in (f"b{n}" for n in range(8)):
        assert np.allclose(least[name].position, other[name].position, rtol=0, atol=2e-8)
    sizes = [np.linalg.norm(run.joint_impulse[5:, :, :3], axis=(1, 2)) for run in (least, other)]
    assert np.all(sizes[0] <= 1.001 * sizes[1])
    assert np.all(sizes[0] > 0.03 * sizes[1])


def test_joints_hold_whatever_the_tolerance_of_a_pile():
    """A rod, a held ball and a string under grains: lengths to `gap_tolerance`, at a `pile_tolerance` of 1e-4."""
    scene = carom.Scene("pile")
    scene.contact("g", "g", friction=0.4, restitution=0.2)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    for name, point, normal in (
        ("left", (-1.1 * R, 0, 0), (1, 0, 0)),
        ("right", (7.7 * R, 0, 0), (-1, 0, 0)),
        ("front", (0, -1.1 * R, 0), (0, 1, 0)),
        ("back", (0, 7.7 * R, 0), (0, -1, 0)),
    ):
        scene.plane(name, point=point, normal=normal, material="g")
    rng = np.random.default_rng(3)
    for z, x, y in itertools.product(range(3), range(4), range(4)):
        at = np.array([2.2 * x, 2.2 * y, 1.1 + 2.15 * z]) * R + rng.normal(size=3) * 1e-4
        scene.sphere(f"b{x}{y}{z}", radius=R, mass=0.01, at=at, material="g")
    scene.joint("fix", body="b001")
    pairs = [("b101", "b201"), ("b201", "b301"), ("b020", "b121")]
    for a, b in pairs:
        scene.joint("rod", between=[a, b])
    run = carom.simulate(scene, until=0.15, step=1e-3, pile_tolerance=1e-4)
    assert np.abs(run["b001"].position - run["b001"].position[0]).max() < 1e-10 * R
    for a, b in pairs:
        length = np.linalg.norm(run[a].position - run[b].position, axis=1)
        assert np.ptp(length) < 4e-10 * R
    assert run.summary["fallbacks"] == 0
    assert carom.audit.check(run).ok
