"""Measures of runs that the core computed: weights, contacts, and what cannot be known."""

from __future__ import annotations

from pathlib import Path

import carom
import numpy as np
import pytest
from carom import CaromError, granular
from carom.granular import Box, layers

R, G, N = 0.01, 9.8, 4


def column(**record: bool) -> carom.Scene:
    scene = carom.Scene(run={"until": 0.1, "step": 1e-3}, record={"every": 20, **record})
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    for k in range(N):
        scene.sphere(f"b{k}", radius=R, density=2500, material="m", at=(0, 0, R + 2 * R * k))
    return scene


@pytest.fixture(scope="module")
def rest() -> carom.Result:
    return carom.simulate(column())


def test_a_column_weighs_on_every_layer(rest: carom.Result) -> None:
    weight = float(rest.bodies["mass"][0]) * G
    box = Box((-R, -R, 0), (R, R, 2 * R * N))
    sliced = granular.over_regions(rest, granular.stress, layers(box, "z", 16 * N))
    middle = (np.arange(16 * N) + 0.5) * 2 * R / 16
    centres = R + 2 * R * np.arange(N)
    above = weight * (centres[None] > middle[:, None]).sum(axis=1)
    np.testing.assert_allclose(
        [s.tensor[2, 2] * 4 * R * R for s in sliced], above, rtol=1e-9, atol=1e-12 * weight
    )
    assert all(s.asymmetry < 1e-9 for s in sliced if s.pressure > 0)


def test_mean_over_frames(rest: carom.Result) -> None:
    box = Box((-R, -R, 0), (R, R, 2 * R * N))
    series = granular.over_frames(rest, granular.stress, box, start="30 ms")
    assert len(series) == 4
    assert series["tensor"].shape == (4, 3, 3)
    np.testing.assert_allclose(series.interval, 0.02)
    one = granular.stress(rest, box)
    np.testing.assert_allclose(series.mean("tensor"), one.tensor, rtol=1e-6, atol=1e-9 * one.pressure)
    fractions = granular.over_frames(rest, granular.packing_fraction, region=box)
    assert fractions.mean() == pytest.approx(np.pi / 6, rel=1e-8)
    with pytest.raises(CaromError, match="no frames from 5 s"):
        granular.over_frames(rest, granular.coordination, start=5.0)


def test_contacts_of_a_column(rest: carom.Result) -> None:
    z = granular.coordination(rest)
    np.testing.assert_array_equal(z.per_ball, [2, 2, 2, 1])
    np.testing.assert_array_equal(granular.coordination(rest, gap=1e-6).per_ball, [2, 2, 2, 1])
    assert z.rattlers == 1.0  # one after the other: only in the plane above does a column not fall apart
    assert granular.coordination(rest, least=1).rattlers == 0.0
    chains = granular.force_chains(rest, above=0.0)
    np.testing.assert_array_equal(chains.sizes, [N])
    np.testing.assert_allclose(np.sort(chains.push) / chains.push.min(), [1, 2, 3, 4], rtol=1e-9)
    assert granular.granular_temperature(rest).translational < 1e-12
    assert granular.fabric(rest).tensor[2, 2] == pytest.approx(1.0)


def test_near_surfaces_are_those_of_all_walls_where_they_are() -> None:
    # Planes counted where they began, and tubes not at all.
    scene = column()
    scene.plane(
        "ceiling", point=(0, 0, 0.1), normal=(0, 0, -1), material="m",
        motion={"translation": [0, 0, {"expression": "-0.15*t"}]},
    )  # fmt: skip
    scene.cylinder("tube", point=(0, 0, 0), axis=(0, 0, 1), radius=R + 1e-4, inside=True, material="m")
    result = carom.simulate(scene)
    np.testing.assert_array_equal(granular.coordination(result, gap=1e-6).per_ball, [2, 2, 2, 1])
    np.testing.assert_array_equal(granular.coordination(result, gap=2e-4).per_ball, [3, 3, 3, 2])
    np.testing.assert_array_equal(granular.coordination(result, gap=2e-4, walls=False).per_ball, [1, 2, 2, 1])
    np.testing.assert_array_equal(
        granular.coordination(result, gap=6e-3).per_ball, [3, 3, 3, 3]
    )  # ceiling at 85 mm
    np.testing.assert_array_equal(granular.coordination(result, -2, gap=6e-3).per_ball, [3, 3, 3, 2])


def test_frames_by_number_and_time(rest: carom.Result) -> None:
    assert granular.snapshot(rest).time == pytest.approx(0.1)
    assert granular.snapshot(rest, time=0.043).time == pytest.approx(0.04)
    assert granular.snapshot(rest, time="43 ms").time == pytest.approx(0.04)
    with pytest.raises(CaromError, match="snapshot: time: "):
        granular.snapshot(rest, time="43 mm")
    with pytest.raises(CaromError, match="snapshot: time must be a finite number"):
        granular.snapshot(rest, time=[0.043])  # type: ignore[arg-type]
    assert granular.snapshot(rest, 1).time == granular.snapshot(rest, -5).time
    np.testing.assert_allclose(granular.snapshot(rest).up, [0, 0, 1])
    with pytest.raises(CaromError, match=r"there is no frame 6; give one of -6 to 5"):
        granular.snapshot(rest, 6)
    with pytest.raises(CaromError, match="take frame 1 or a later one"):
        granular.coordination(rest, 0)
    assert granular.coordination(rest, 0, gap=1e-6).mean == 7 / 4


def test_a_run_without_contacts_says_what_to_do(tmp_path: Path) -> None:
    result = carom.simulate(column(contacts=False), out=tmp_path / "run")
    with pytest.raises(CaromError, match=r"not known here; run it again with contacts = true in \[record\]"):
        _ = granular.stress(result, Box((-R, -R, 0), (R, R, 1))).tensor
    assert granular.coordination(result, gap=1e-6).mean == 7 / 4
    assert granular.packing_fraction(result, Box((-R, -R, 0), (R, R, 2 * R * N))) == pytest.approx(np.pi / 6)


def test_a_packing_falls_and_rests_on_the_floor() -> None:
    """Momentum of 60 balls from a random packing: what the floor gave them is what gravity and they have taken."""
    scene = carom.Scene(run={"until": 0.1, "step": 5e-4}, record={"every": 200})
    scene.contact("g", "g", friction=0.4, restitution=0.2)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="g")
    scene.packing(
        "g", material="g", density=2500, seed=4, count=60, sizes="uniform", smallest=0.008, largest=0.012,
        low=(0, 0, 0), high=(0.05, 0.05, 0.05),
    )  # fmt: skip
    result = carom.simulate(scene)
    assert result.outcome.ok
    s = granular.snapshot(result)
    floor = s.touching.second >= 60
    momentum = s.known("mass") @ s.known("velocity")
    given = s.touching.force[floor].sum(axis=0) * 0.1 + np.array([0, 0, -G]) * s.known("mass").sum() * 0.1
    np.testing.assert_allclose(momentum, given, atol=1e-9 * s.known("mass").sum())


def test_balls_that_left_take_their_contacts_with_them() -> None:
    """A ball slides into an outlet: the stress of all regions had been not a number at the frame after, far away as well."""
    scene = carom.Scene(run={"until": 0.1, "step": 1e-3}, record={"every": 10})
    scene.contact("m", "m", friction=0.0, restitution=0.0)
    scene.plane("floor", point=(0, 0, 0), normal=(0, 0, 1), material="m")
    scene.outlet(low=(0.0225, -1, -1), high=(1, 1, 1))
    scene.sphere("slides", radius=R, mass=1.0, material="m", at=(0, 0, R), velocity=(0.5, 0, 0))
    scene.sphere("rests", radius=R, mass=1.0, material="m", at=(-0.5, 0, R))
    result = carom.simulate(scene)
    there = np.asarray(result.present)
    left = int(np.flatnonzero(~there[:, 0])[0])
    assert 0 in np.asarray(result.contacts.at(left)["body"])[:, 0]  # it pushed since the frame before
    far, whole = Box((-0.6, -0.1, 0), (-0.4, 0.1, 0.1)), Box((-1, -1, 0), (1, 1, 0.1))
    for frame in range(1, len(there)):
        s = granular.snapshot(result, frame)
        number = there[frame].sum()
        assert granular.stress(s, far).contact[2, 2] == pytest.approx(G * R / (0.2 * 0.2 * 0.1))
        assert granular.stress(s, whole).contact[2, 2] == pytest.approx(number * G * R / (2 * 2 * 0.1))
        chains = granular.force_chains(s, above=0.0, least=1)
        assert len(chains.push) == granular.normal_forces(s, walls=True).ratio.size == number
        assert np.isfinite(chains.end).all()
        np.testing.assert_array_equal(granular.coordination(s).per_ball, there[frame])
        assert (granular.ball_stress(s)[~there[frame]] == 0).all()
    assert np.isfinite(granular.over_frames(result, granular.stress, whole).mean("tensor")).all()


def test_of_two_balls_that_touched_the_one_that_stays_has_no_contact_left() -> None:
    x = np.array([[0.0, 0, 0], [np.nan] * 3, [2.0, 0, 0]])
    up = np.array([[-1.0, 0, 0], [0, 0, 1], [0, 0, 1]])
    c = granular.Contacts(
        np.array([0, 1, 2]), np.array([1, 3, 3]), up, up, np.zeros(3), np.ones(3, dtype=bool)
    )
    s = granular.Snapshot(x, np.ones(3), contacts=c)
    np.testing.assert_array_equal(s.touching.first, [2])
    assert s.branch.shape == (1, 3)
    np.testing.assert_array_equal(granular.coordination(s, least=1).per_ball, [0, 0, 1])


def test_measures_of_nothing_are_no_numbers_and_no_warnings() -> None:
    """Before an inflow begins no ball is there. NumPy's warnings are errors in these tests."""
    scene = carom.Scene(run={"until": 0.01, "step": 1e-3})
    scene.inflow(
        "g", material="m", count=3, radius=R, density=2500, seed=1, start=0.05,
        region={"low": (0, 0, 0), "high": (0.1, 0.1, 0.1)},
    )  # fmt: skip
    scene.contact("m", "m", friction=0.5, restitution=0.0)
    scene.plane("floor", point=(0, 0, -1), normal=(0, 0, 1), material="m")
    result = carom.simulate(scene)
    box = Box((0, 0, 0), (1, 1, 1))
    z = granular.coordination(result), granular.coordination(result, gap=1e-3)
    assert np.isnan([[k.mean, k.mean_without_rattlers, k.rattlers] for k in z]).all()
    assert np.isnan(granular.fabric(result).tensor).all()
    assert np.isnan(granular.granular_temperature(result, mean="none").translational)
    assert np.isnan(granular.granular_temperature(result, region=box).rotational)
    assert float(granular.packing_fraction(result, box)) == 0.0
    assert (granular.stress(result, box).tensor == 0).all()
    assert (granular.ball_stress(result) == 0).all()
    for refused, told in (
        (lambda: granular.force_chains(result), "no contact pushes"),
        (lambda: granular.normal_forces(result), "no contact pushes"),
        (lambda: granular.heap_angle(result), "at least three balls"),
        (lambda: granular.run_out(result), "no ball is there at the frame of `start`"),
        (lambda: granular.radial_distribution(result, box, reach=0.1), "no ball is"),
    ):
        with pytest.raises(CaromError, match=told):
            refused()


def test_a_part_of_a_result_is_its_balls_without_contacts(rest: carom.Result) -> None:
    box = Box((-R, -R, 0), (R, R, 2 * R * N))
    whole = granular.packing_fraction(rest, box)
    shares = [granular.packing_fraction(rest.sel(body=part), box) for part in (["b0"], ["b1", "b2", "b3"])]
    assert shares == pytest.approx([whole / N, whole * (N - 1) / N])
    assert granular.coordination(rest.sel(body=["b0", "b1"]), gap=1e-6).per_ball.tolist() == [2, 1]
    assert granular.snapshot(rest.sel(slice("20 ms", "60 ms"))).time == pytest.approx(0.06)
    with pytest.raises(CaromError, match="a part of a result leaves them out: measure the whole one"):
        granular.coordination(rest.sel(body=["b0"]))
