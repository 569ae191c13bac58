"""Results made by hand for the tests of the viewer: motion as smooth as a real run's, no solver needed."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
from carom import Scene
from carom.result.outcome import Outcome
from carom.result.record.walls import tables
from carom.result.walls import Walls

RADIUS = 0.028575
STEP = 2e-3


class Table(dict[str, Any]):
    """A table of a result, as far as the viewer asks for it; `ends` as that of contacts has it."""

    ends: Any


class Shown(SimpleNamespace):
    """A result, as far as the viewer asks for it; what is not given is as in a run that has none of it."""

    title = ""
    gravity = np.zeros(3)
    periodic = boxes = None
    periodic_origin = np.zeros(3)
    clumps: ClassVar[dict[str, Any]] = {}
    flows: tuple[Any, ...] = ()
    summary: ClassVar[dict[str, int]] = {"truncated_sequences": 0}
    scene = Scene()
    outcome = Outcome("done")
    impacts = Table(time=np.zeros(0))
    contacts = Table(status=np.zeros(0))
    energy = SimpleNamespace(**dict.fromkeys(("time", "kinetic", "potential"), np.zeros(0)))

    def __getattr__(self, name: str) -> Any:
        if name == "present":
            return np.ones(self.position.shape[:2], dtype=bool)
        if name == "wall_names":
            return list(self.walls)
        if name != "walls":
            raise AttributeError(name)
        rows = [dict(zip(self.planes, row, strict=True)) for row in zip(*self.planes.values(), strict=True)]
        still = SimpleNamespace(moves=False)
        return {
            row["name"]: SimpleNamespace(name=row["name"], shape="plane", facts=row, motion=still)
            for row in rows
        }


def turn(rate: Any, time: float) -> Any:
    """Attitude, scalar first, after turning at the constant `rate` for `time`."""
    angle = np.linalg.norm(rate, axis=-1, keepdims=True) * time
    axis = rate / np.maximum(np.linalg.norm(rate, axis=-1, keepdims=True), 1e-12)
    return np.concatenate([np.cos(angle / 2), np.sin(angle / 2) * axis], -1)


def billiard(frames: int) -> Any:
    """Four balls that roll apart on a table, ever slower; the first also spins about the vertical.

    Attitudes are those of a constant axis: exact for the other three, and all that is asked of the first.
    """
    time = STEP * np.arange(frames)
    r = RADIUS
    start = np.array(
        [
            [0.635, 0.635, r],
            [1.905, 0.635, r],
            [1.905 + 3**0.5 * r, 0.635 - r, r],
            [1.905 + 3**0.5 * r, 0.635 + r, r],
        ]
    )
    direction = np.array([[0.30, 0.02, 0.0], [0.15, 0.01, 0.0], [0.2, -0.2, 0.0], [0.2, 0.2, 0.0]])
    travelled = 1.0 - np.exp(-time)
    position = start + direction * travelled[:, None, None]
    velocity = direction * np.exp(-time)[:, None, None]
    axis = np.stack([-direction[:, 1] / r, direction[:, 0] / r, np.array([5.0, 0.0, 0.0, 0.0])], -1)
    return Shown(
        time=time,
        position=position,
        orientation=np.stack([turn(axis, float(s)) for s in travelled]),
        velocity=velocity,
        angular_velocity=axis * np.exp(-time)[:, None, None],
        names=["ball2", "ball3", "ball4", "ball5"],
        bodies={"radius": np.full(4, r)},
        planes={
            "name": ["bed", "foot cushion", "head cushion", "left cushion", "right cushion"],
            "point": [[0, 0, 0], [2.54, 0, 0], [0, 0, 0], [0, 1.27, 0], [0, 0, 0]],
            "normal": [[0, 0, 1], [-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0]],
        },
        gravity=np.array([0.0, 0.0, -9.8]),
    )


def drum(frames: int) -> Any:
    """Balls carried by a turning drum with an open front, and walls of every other shape around it.

    The first ball enters at a third of the run, the last leaves at two thirds.
    """
    time = 5 * STEP * np.arange(frames)
    radius, ball = 0.1, 0.006
    scene = Scene("drum")
    turn_about = {"rotation": {"axis": (0, 1, 0), "point": (0, 0, 0), "rate": 3.0}}
    scene.cylinder(
        "drum", point=(0, 0, 0), axis=(0, 1, 0), radius=radius, length=0.06, material="s", motion=turn_about
    )
    scene.plane("back", point=(0, 0.03, 0), normal=(0, -1, 0), radius=radius, material="s", motion=turn_about)
    scene.plane(
        "front", point=(0, -0.03, 0), normal=(0, 1, 0), radius=radius, material="s", motion=turn_about
    )
    scene.cone(
        "funnel",
        point=(0.2, 0, -0.05),
        axis=(0, 0, 1),
        radius=0.01,
        radius_end=0.06,
        length=0.1,
        material="s",
    )
    scene.ball_wall("stone", point=(0.2, 0.1, -0.08), radius=0.03, inside=False, material="s")
    scene.cylinder(
        "pipe", point=(0.32, 0, 0.03), axis=(0, 1, 0.3), radius=0.02, length=0.15, inside=False, material="s"
    )
    scene.ball_wall("bowl", point=(0.42, 0, 0), radius=0.05, material="s")
    shaken = {"translation": [0, 0, {"expression": "0.02*sin(10*t)"}]}
    scene.plane(
        "table", point=(0.1, 0, -0.15), normal=(0, 0, 1), size=(0.7, 0.3), material="s", motion=shaken
    )
    names = [f"grain{k}" for k in range(120)]
    rng = np.random.default_rng(1)
    depth, angle = rng.uniform(0.05, 0.09, 120), rng.uniform(-2.4, -0.7, 120)
    angles = angle + 0.2 * np.sin(3.0 * time)[:, None]
    position = np.stack(
        [
            depth * np.cos(angles),
            np.broadcast_to(rng.uniform(-0.02, 0.02, 120), angles.shape),
            depth * np.sin(angles),
        ],
        axis=-1,
    )
    present = np.ones((frames, 120), dtype=bool)
    present[: frames // 3, 0] = False
    present[2 * frames // 3 :, -1] = False
    position[~present] = np.nan
    result = Shown(
        time=time,
        position=position,
        orientation=np.broadcast_to([1.0, 0.0, 0.0, 0.0], (frames, 120, 4)),
        velocity=np.zeros((frames, 120, 3)),
        angular_velocity=np.zeros((frames, 120, 3)),
        present=present,
        names=names,
        bodies={"radius": np.full(120, ball)},
        gravity=np.array([0.0, 0.0, -9.8]),
    )
    static = tables(scene.wall_names, scene.to_model())
    result.planes = static["planes"]
    result.walls = Walls(result, [static["planes"], static["walls"]])
    return result


def struck(frames: int) -> Any:
    """The four balls of `billiard` with impacts, contacts with the bed, energies, a rod and a spring, all made up.

    At 0.1 s ball2 hits ball3, which hits ball4 and ball5, and then ball2 once more; at 0.3 s ball5 hits a cushion.
    """
    run = billiard(frames)
    time, normal = run.time, np.array([-1.0, 0.0, 0.0])
    run.title = "Struck"
    run.impacts = Table(
        time=np.array([0.1] * 5 + [0.3]),
        problem=np.array([0, 1, 2, 2, 3, 1]),
        body=np.array([[1, 4], [0, 1], [1, 2], [1, 3], [0, 1], [3, 5]]),
        status=np.array([1, 1, 2, 1, 2, 2]),
        normal=np.array([[0, 0, 1.0]] + [normal] * 5),
        impulse=np.array(
            [[0, 0, 0.002], [-0.5, 0, 0], [-0.25, 0, 0], [-0.25, 0, 0], [-0.125, 0, 0], [-0.3, 0, 0]]
        ),
        approach=np.array([-0.01, -3.0, -1.5, -1.5, -0.7, -1.2]),
        separation=np.array([0.0, 2.9, 1.4, 1.4, 0.6, 1.1]),
    )
    # Every ball on the bed in every frame after the first; the impulses are of the interval before.
    weight, step = 0.17 * 9.8, time[1] - time[0]
    rows = 4 * (frames - 1)
    run.contacts = Table(
        body=np.stack([np.tile(np.arange(4), frames - 1), np.full(rows, 4)], 1),
        status=np.tile([1, 1, 2, 2], frames - 1),
        normal=np.tile([0.0, 0.0, 1.0], (rows, 1)),
        impulse=np.tile([[0, 0, weight * step * (1 + k)] for k in range(4)], (frames - 1, 1)),
    )
    run.contacts.ends = 4 * np.arange(frames)
    run.energy = SimpleNamespace(time=time, kinetic=2.0 * np.exp(-time), potential=np.full(frames, 7.0))
    run.scene = Scene()
    run.scene.joint("rod", name="tie", between=["ball4", "ball5"])
    run.scene.spring("ball2", "ground", points=[[0.635, 0.635, 0.05715], [0.3, 0.635, 0.3]], stiffness=1.0)
    return run
