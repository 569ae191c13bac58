"""Racks and lattices: where the balls are, that they touch or not, and that a seed means the same balls for ever."""

from __future__ import annotations

import numpy as np
import pytest
from carom import ScenarioError, Scene
from carom.scene.assembly.bodies import lattice_centres, rack_centres, uniform
from carom.scene.checks.overlap import overlaps
from carom.scene.tables.balls import Lattice, Rack
from hypothesis import given
from hypothesis import strategies as st

R = 0.028575
BALL = {"name": "b", "material": "m", "radius": R, "mass": 0.17}


def rack(**keys: object) -> Rack:
    return Rack.model_validate({**BALL, "apex": [0, 0, R], "direction": [1, 0, 0], **keys})


def lattice(**keys: object) -> Lattice:
    return Lattice.model_validate({**BALL, "counts": [2, 2, 2], "origin": [0, 0, 0], **keys})


def touching(centres: np.ndarray, diameter: float) -> int:
    distance = np.linalg.norm(centres[:, None] - centres[None], axis=2)
    assert (distance[~np.eye(len(centres), dtype=bool)] > diameter * (1 - 1e-12)).all()
    return int((distance < diameter * (1 + 1e-12)).sum() - len(centres)) // 2


@pytest.mark.parametrize(
    ("keys", "balls", "contacts"),
    [
        ({"balls": 3}, 3, 3),
        ({"balls": 15}, 15, 30),
        ({"rows": 5}, 15, 30),
        ({"shape": "diamond", "balls": 9}, 9, 16),
        ({"shape": "diamond", "rows": 5}, 9, 16),
        ({"rows": 1}, 1, 0),
    ],
)
def test_rack_of_touching_balls(keys: dict[str, object], balls: int, contacts: int) -> None:
    table = rack(**keys)
    centres = rack_centres(table)
    assert len(centres) == table.size() == balls
    assert touching(centres, 2 * R) == contacts
    assert (centres[:, 2] == R).all()
    np.testing.assert_array_equal(centres[0], [0, 0, R])


def test_rack_of_the_paper() -> None:
    """Balls 3 to 5 of section 5.6: apex first, then the left and the right ball as seen along the direction."""
    centres = rack_centres(rack(balls=3, apex=[1.905, 0.635, R]))
    x = 1.905 + np.sqrt(3) * R
    expected = [[1.905, 0.635, R], [x, 0.635 + R, R], [x, 0.635 - R, R]]
    np.testing.assert_allclose(centres, expected, atol=1e-16)


def test_rack_with_gap_turned_and_tilted() -> None:
    centres = rack_centres(rack(balls=10, gap="1 mm", direction=[0, -3, 0.5], up=[0, 0, 2]))
    assert touching(centres, 2 * R + 1e-3) == 18
    assert (np.diff(centres[:, 1]) <= 1e-15).all()
    np.testing.assert_allclose(centres[:, 2], R)
    tilted = rack_centres(rack(balls=10, direction=[1, 0, 1], up=[-1, 0, 1]))
    assert touching(tilted, 2 * R) == 18


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"balls": 4}, "4 balls do not fill a triangle; give 3 or 6 balls"),
        ({"shape": "diamond", "balls": 8}, "give 4 or 9 balls"),
        ({"shape": "diamond", "rows": 4}, "odd number of rows"),
        ({"balls": 3, "rows": 2}, "both balls and rows"),
        ({}, "neither balls nor rows"),
        ({"balls": 3, "direction": [0, 0, -1]}, "direction and up are parallel"),
        ({"balls": 3, "direction": [0, 0, 0]}, "must not be zero; write for example [1.0, 0.0, 0.0]"),
        ({"balls": 3, "jitter": 1e-4}, "add seed = 1"),
    ],
)
def test_impossible_racks(keys: dict[str, object], message: str) -> None:
    scene = Scene()
    arguments = {
        "radius": R,
        "mass": 0.17,
        "material": "m",
        "apex": (0, 0, R),
        "direction": (1, 0, 0),
        **keys,
    }
    with pytest.raises(ScenarioError) as caught:
        scene.rack("b", **arguments)  # type: ignore[arg-type]
    assert message in str(caught.value)
    assert str(caught.value).startswith('Scene.rack("b"): ')


def test_cubic_lattice_is_numbered_along_x_first() -> None:
    centres = lattice_centres(lattice(counts=[3, 2, 2], origin=[1, 2, 3], spacing=0.5))
    np.testing.assert_array_equal(centres[:4], [[1, 2, 3], [1.5, 2, 3], [2, 2, 3], [1, 2.5, 3]])
    np.testing.assert_array_equal(centres[6], [1, 2, 3.5])


def test_hexagonal_lattice_has_twelve_neighbours() -> None:
    centres = lattice_centres(lattice(kind="hcp", counts=[5, 5, 5]))
    distance = np.linalg.norm(centres - centres[62], axis=1)
    assert (distance < 2 * R * (1 + 1e-9)).sum() == 13
    assert touching(centres, 2 * R) > 0


@pytest.mark.parametrize(("kind", "neighbours"), [("cubic", 6), ("bcc", 8), ("fcc", 12), ("hcp", 12)])
def test_lattices_have_their_neighbours(kind: str, neighbours: int) -> None:
    centres = lattice_centres(lattice(kind=kind, counts=[5, 5, 5]))
    assert touching(centres, 2 * R) > 0
    distance = np.linalg.norm(centres - centres[62], axis=1)
    assert (distance < 2 * R * (1 + 1e-9)).sum() == neighbours + 1


def test_lattice_that_is_too_large() -> None:
    with pytest.raises(ScenarioError, match="makes 1000000000 balls"):
        Scene().lattice("b", counts=(1000, 1000, 1000), origin=(0, 0, 0), radius=1, mass=1, material="m")


def test_a_seed_means_the_same_numbers_for_ever() -> None:
    """Raw PCG64 output; if this fails, stored scenarios would change their meaning."""
    np.testing.assert_array_equal(
        uniform(1, (2, 2)),
        [[0.023643249400513433, 0.9009273926518706], [-0.7116807745607325, 0.8972988942744877]],
    )
    assert not np.array_equal(uniform(2, (4,)), uniform(1, (4,)))


@given(st.integers(0, 2**63 - 1), st.floats(0, 1e-3))
def test_jitter_stays_within_its_bound(seed: int, jitter: float) -> None:
    quiet, moved = (
        lattice_centres(lattice(counts=[4, 3, 2])),
        lattice_centres(lattice(counts=[4, 3, 2], jitter=jitter, seed=seed)),
    )
    assert (np.abs(moved - quiet) <= jitter * (1 + 1e-9) + 1e-17).all()
    table = rack_centres(rack(balls=10, jitter=jitter, seed=seed, gap=3e-3))
    np.testing.assert_array_equal(table[:, 2], R)
    assert overlaps(table, np.full(10, R)) == []


def test_names_and_order_of_the_arrays() -> None:
    scene = Scene()
    scene.lattice(
        "l",
        counts=(2, 1, 1),
        origin=(0, 0, 1),
        radius=0.1,
        mass=1,
        material="m",
        first_number=0,
        velocity=(0, 0, 1),
    )
    scene.rack("r", balls=3, apex=(0, 0, 2), direction=(1, 0, 0), radius=0.1, density=1000, material="n")
    scene.sphere("s", radius=0.1, mass=1, at=(0, 0, 3), material="m", velocity=(1, 0, 0))
    assert scene.names == ["s", "r1", "r2", "r3", "l0", "l1"]
    model = scene.to_model()
    np.testing.assert_array_equal(model["velocity"], [[1, 0, 0]] + 3 * [[0, 0, 0]] + 2 * [[0, 0, 1]])
    np.testing.assert_array_equal(model["material"], [0, 1, 1, 1, 0, 0])
    np.testing.assert_allclose(model["mass"], [1] + 3 * [4 / 3 * np.pi] + [1, 1])
    np.testing.assert_allclose(model["inertia"], 0.4 * model["mass"] * 0.01)


def test_generated_names_that_collide() -> None:
    scene = Scene(run={"until": 1})
    scene.contact("m", "m", friction=0, restitution=0)
    scene.sphere("b2", radius=0.1, mass=1, at=(0, 0, 3), material="m")
    scene.rack("b", balls=3, apex=(0, 0, 0), direction=(1, 0, 0), radius=0.1, mass=1, material="m")
    with pytest.raises(ScenarioError) as caught:
        scene.validate()
    assert 'there are two spheres "b2"; change name (the prefix) or first_number' in str(caught.value)


def test_a_large_generator_stays_one_in_the_resolved_copy() -> None:
    scene = Scene(run={"until": 1})
    scene.lattice(
        "b", counts=(30, 30, 30), origin=(0, 0, 0), radius=0.1, mass=1, material="m", jitter=1e-3, seed=3
    )
    text = scene.to_toml(resolved=True)
    assert "[[lattice]]" in text
    assert len(text) < 3000


@pytest.mark.parametrize(
    ("shape", "rows", "balls"), [("triangle", 1414, 1000405), ("diamond", 2001, 1002001)]
)
def test_racks_that_are_too_large_are_refused_before_they_are_built(
    shape: str, rows: int, balls: int
) -> None:
    with pytest.raises(ScenarioError, match=f"makes {balls} balls, more than 1000000; reduce rows"):
        Scene().rack(
            "b", shape=shape, rows=rows, apex=(0, 0, 0), direction=(1, 0, 0), radius=1, mass=1, material="m"
        )
    with pytest.raises(ScenarioError, match="more than 1000000"):
        Scene().rack(
            "b",
            shape=shape,
            rows=999_999,
            apex=(0, 0, 0),
            direction=(1, 0, 0),
            radius=1,
            mass=1,
            material="m",
        )
