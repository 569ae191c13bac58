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
    """28 rods where 18 hold: the motion is the same, with the least reactions that do what those of 18 do."""
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
    for frame in (5, 20, 40):
        x = np.array([least[f"b{n}"].position[frame] for n in range(8)])
        rows = np.zeros((28, 8, 3))
        for row, (a, b) in zip(rows, every, strict=True):
            row[a] = (x[a] - x[b]) / np.linalg.norm(x[a] - x[b])
            row[b] = -row[a]
        rows = rows.reshape(28, 24)
        shown = np.array(
            [
                impulse[:3] @ row[3 * a : 3 * a + 3]
                for impulse, row, (a, _) in zip(least.joint_impulse[frame], rows, every, strict=True)
            ]
        )
        alone = np.zeros(24)
        for impulse, (a, b) in zip(other.joint_impulse[frame], few, strict=True):
            alone[3 * a : 3 * a + 3] += impulse[:3]
            alone[3 * b : 3 * b + 3] -= impulse[:3]
        exact = np.linalg.lstsq(rows.T, alone, rcond=1e-9)[0]
        # What was solved first is 1e8 times as large, and rounds.
        assert np.abs(shown - exact).max() < 1e-3 * np.abs(exact).max()


@pytest.mark.parametrize("angle", [1e-1, 1e-2, 1e-3, 1e-5])
def test_reactions_that_nearly_repeat_one_another_stay(angle):
    """A ball on two rods that nearly lie in one line: each has `m g/(2 sin angle)`."""
    scene = carom.Scene("taut")
    scene.contact("m", "m", friction=0, restitution=0)
    scene.sphere("ball", radius=R, mass=0.1, at=(0, 0, 0), material="m")
    for side in (-1, 1):
        points = [(0, 0, 0), (side * np.cos(angle), 0, np.sin(angle))]
        scene.joint("rod", between=["ball", "ground"], points=points)
    run = carom.simulate(scene, until=0.01, step=1e-3)
    pull = np.linalg.norm(run.joint_impulse[1:, :, :3], axis=2) / 1e-3
    assert np.allclose(pull, 0.1 * 9.8 / (2 * np.sin(angle)), rtol=1e-4)


def test_a_long_chain_at_rest_stays():
    """200 beads that hang in a straight line: their reactions are unique, and 100 times what they do together."""
    scene = carom.Scene("chain")
    scene.contact("m", "m", friction=0, restitution=0)
    for n in range(200):
        scene.sphere(f"b{n}", radius=R, mass=0.01, at=(0, 0, -0.03 * (n + 1)), material="m")
        if n:
            scene.joint("rod", between=[f"b{n - 1}", f"b{n}"])
    scene.joint("rod", between=["b0", "ground"], points=[(0, 0, -0.03), (0, 0, 0)])
    run = carom.simulate(scene, until=0.003, step=1e-3)
    pull = np.linalg.norm(run.joint_impulse[-1, :, :3], axis=1) / 1e-3
    weights = 0.01 * 9.8 * np.arange(199, 0, -1)
    assert np.allclose(pull, [*weights, 0.01 * 9.8 * 200], rtol=1e-8)


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
