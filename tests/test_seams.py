"""Walls that abut: what attracts or presses a ball at their seam is what one wall would, however they are given."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import carom
import numpy as np
import pytest
from carom import audit

pytestmark = pytest.mark.filterwarnings("ignore::carom.CaromWarning")

R, M, G = 0.01, 0.01, 9.81
TURN = np.array([[2, -2, 1], [1, 2, 2], [-2, -1, 2]]) / 3.0
Walls = Callable[[carom.Scene, np.ndarray], None]


def piece(scene: carom.Scene, name: str, turn: np.ndarray, x: float, **shape: Any) -> None:
    if "size" in shape:
        shape["side"] = (turn @ [1, 0, 0]).tolist()
    scene.plane(
        name, point=(turn @ [x, 0, 0]).tolist(), normal=(turn @ [0, 0, 1]).tolist(), material="wall", **shape
    )


def mesh(scene: carom.Scene, turn: np.ndarray, ends: list[float]) -> None:
    corners = [(turn @ [x, y, 0]).tolist() for x in ends for y in (-0.2, 0.2)]
    triangles = [t for k in range(0, len(corners) - 2, 2) for t in ((k, k + 2, k + 1), (k + 1, k + 2, k + 3))]
    scene.mesh("mesh", vertices=corners, triangles=triangles, material="wall")


def plate(scene: carom.Scene, turn: np.ndarray) -> None:
    piece(scene, "plate", turn, 0.0, size=(0.4, 0.4))


def plates(*names: str) -> Walls:
    def add(scene: carom.Scene, turn: np.ndarray) -> None:
        for name in names:
            piece(scene, name, turn, -0.1 if name == "left" else 0.1, size=(0.2, 0.4))

    return add


def disc_in_ring(scene: carom.Scene, turn: np.ndarray) -> None:
    piece(scene, "disc", turn, -0.1, radius=0.1)
    piece(scene, "ring", turn, -0.1, radius=0.4, hole=0.1)


def mesh_beside_plate(scene: carom.Scene, turn: np.ndarray) -> None:
    mesh(scene, turn, [-0.2, 0.0])
    piece(scene, "right", turn, 0.1, size=(0.2, 0.4))


WALLS: dict[str, Walls] = {
    "two": plates("left", "right"),
    "two, the other way round": plates("right", "left"),
    "disc in ring": disc_in_ring,
    "mesh": lambda scene, turn: mesh(scene, turn, [-0.2, 0.0, 0.2]),
    "mesh beside plate": mesh_beside_plate,
}


def run(walls: Walls, method: str, x: float, side: float, *, turn: np.ndarray | None = None, speed: float = 0.0,
        until: float = 0.1, **law: Any) -> tuple[carom.Result, np.ndarray]:  # fmt: skip
    """A ball beside the seam at x = 0, on top of the walls or below; where it is at the end, in the axes of the walls."""
    turn = np.eye(3) if turn is None else turn
    scene = carom.Scene(gravity=(turn @ [0, 0, -G]).tolist())
    scene.contact("ball", "wall", friction=0.3, restitution=0.1, **law)
    scene.sphere("ball", radius=R, mass=M, material="ball", position=(turn @ [x, 0, side * R]).tolist(),
                 velocity=(turn @ [speed, 0, 0]).tolist())  # fmt: skip
    walls(scene, turn)
    soft = {"penalty_young_modulus": 1e6, "penalty_friction": "spring"} if method == "penalty" else {}
    result = carom.simulate(scene, until=until, step=1e-3, every=1, method=method, walls=True, **soft)
    return result, turn.T @ np.asarray(result.position)[-1, 0]


@pytest.mark.parametrize("turn", [None, TURN], ids=["level", "turned"])
@pytest.mark.parametrize("walls", WALLS.values(), ids=WALLS)
@pytest.mark.parametrize("method", ["nsga", "moreau"])
@pytest.mark.parametrize("x", [0.0, 1e-4, -1e-3])
def test_a_seam_attracts_once(method: str, walls: Walls, x: float, turn: np.ndarray | None) -> None:
    """Of 60 % of its weight a ball falls, straight; twice as much would hold it."""
    law = {"cohesion": 0.6 * M * G, "rupture_distance": 1e-4}
    result, end = run(walls, method, x, -1.0, turn=turn, **law)
    assert end[2] < -2 * R
    assert np.abs(end - run(plate, method, x, -1.0, **law)[1]).max() < 1e-13
    assert audit.check(result).ok


@pytest.mark.parametrize("turn", [None, TURN], ids=["level", "turned"])
@pytest.mark.parametrize("walls", list(WALLS.values())[:3], ids=list(WALLS)[:3])
@pytest.mark.parametrize("x", [0.0, 1e-4, -1e-3])
def test_a_seam_is_one_spring(walls: Walls, x: float, turn: np.ndarray | None) -> None:
    """To the substep, which looks at rims that come near as well."""
    _, end = run(walls, "penalty", x, 1.0, turn=turn)
    assert np.abs(end - run(plate, "penalty", x, 1.0)[1]).max() < 1e-10
    assert abs(end[0] - x) < 1e-13


@pytest.mark.parametrize("speed", [0.3, -0.3])
def test_what_slides_and_rolls_over_a_seam_takes_its_contact_along(speed: float) -> None:
    """No collision is told of, and springs keep what they store but for what the change of the lever in a substep takes."""
    ends = [
        run(walls, "penalty", -0.05 * speed, 1.0, speed=speed) for walls in (plates("left", "right"), plate)
    ]
    assert ends[0][1] == pytest.approx(ends[1][1], abs=1e-9)
    assert len(ends[0][0].impacts["time"]) == len(ends[1][0].impacts["time"])
    energy = [
        np.asarray(result.steps["energy_kinetic"] + result.steps["energy_potential"]) for result, _ in ends
    ]
    assert np.abs(energy[0] - energy[1]).max() < 1e-8 * M * speed**2


def test_a_gate_that_is_gone_covers_nothing() -> None:
    """Below the rim of the one that is left a ball hangs that both would hold; and no wall that is lower covers it."""
    law = {"cohesion": 1.5 * M * G, "rupture_distance": 1e-4}

    def gate(until: float) -> Walls:
        def add(scene: carom.Scene, turn: np.ndarray) -> None:
            piece(scene, "left", turn, -0.1, size=(0.2, 0.4))
            piece(scene, "right", turn, 0.1, size=(0.2, 0.4), motion={"until": until})

        return add

    stays, gone = (run(gate(until), "nsga", 1e-5, -1.0, **law)[0] for until in (1.0, 0.01))
    for result, names in ((stays, ["right"]), (gone, ["left"])):
        pulled = {
            name for name in ("left", "right") if np.abs(np.asarray(result.walls[name].force)[-1]).max() > 0.0
        }
        assert pulled == set(names)


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["groove", "ridge"])
def test_plates_at_an_angle_press_each_in_a_groove_and_once_on_a_ridge(sign: float) -> None:
    """In a groove two springs carry half of the weight each; a ridge is one spring, which gives way as a plate does."""
    half = np.sqrt(0.5)

    def sides(scene: carom.Scene, _: np.ndarray) -> None:
        for name, x in (("left", -1.0), ("right", 1.0)):
            scene.plane(name, point=(0.1 * x * half, 0, z + 0.1 * sign * half), normal=(-x * sign * half, 0, half),
                        side=(x * half, 0, sign * half), size=(0.2, 0.4), material="wall")  # fmt: skip

    z = R - R / half if sign > 0 else 0.0
    result, end = run(sides, "penalty", 0.0, 1.0, until=0.5)
    forces = [np.asarray(result.walls[name].force)[-1] for name in ("left", "right")]
    assert forces[0] + forces[1] == pytest.approx([0, 0, -M * G], abs=1e-4 * M * G)
    if sign > 0:
        assert [f[2] for f in forces] == pytest.approx([-0.5 * M * G] * 2, rel=1e-3)
    else:
        assert R - end[2] == pytest.approx(R - run(plate, "penalty", 0.0, 1.0, until=0.5)[1][2], rel=1e-6)
