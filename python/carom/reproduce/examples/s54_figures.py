"""Section 5.4: motion and energies of the three balls. Figures 16 to 18."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.reproduce.document import Curve, Figure
from carom.reproduce.examples.s54_study import scene
from carom.reproduce.memory import Trace

Limits = tuple[float | None, float | None, float | None, float | None]

BALLS = ("ball1", "ball2", "ball3")


CAPTIONS = {
    "16a": "Balls 1 and 2 stay.",
    "16b": "Ball 3 leaves with the velocity of ball 1, in one step.",
    "17a": "The hit comes 52 ms later: friction slows ball 1 until it rolls. Balls 1 and 2 go on together.",
    "17b": "Ball 1 slides, rolls from 0.284 s, hits; ball 3 slides until it rolls.",
    "17b-detail": "Ball 1 bounces back (negative), ball 2 slides after it, and they strike each other again and again.",
    "17c": "Here forward roll about +y is positive; the paper draws the opposite sign.",
    "17d": "Balls 1 and 3 leave the bed after the first impact.",
    "18a": "Ball 1 loses energy while it slides and keeps it while it rolls; most of it goes to ball 3.",
    "18b": "Ball 1 leaves the bed, and so does ball 3.",
    "18c": "It falls while a ball slides, and stays when all roll.",
}
#: What a figure shows of the run, where it is not all: x from, x to, y from, y to.
WINDOWS: dict[str, Limits] = {
    "17b-detail": (0.32, 0.42, -0.03, 0.06),
    "17d": (0.32, 0.38, None, None),
    "18b": (0.32, 0.38, None, None),
}


def motion(free: Trace, rough: Trace) -> list[Figure]:
    """Figures 16 and 17."""
    x, v, w = rough.position, rough.velocity[:, :, 0], rough.angular_velocity[:, :, 1]
    along = "v_x in m/s"
    return [
        _figure("16a", "Displacement without friction", "x in m", free, free.position[:, :, 0]),
        _figure("16b", "Velocity without friction", along, free, free.velocity[:, :, 0]),
        _figure("17a", "Displacement with friction", "x in m", rough, x[:, :, 0]),
        _figure("17b", "Velocity with friction", along, rough, v),
        _figure("17b-detail", "Velocity with friction: the re-impacts", along, rough, v),
        _figure("17c", "Angular velocity with friction", "w_y in rad/s", rough, w),
        _figure("17d", "Height with friction", "rise in mm", rough, 1e3 * (x[:, :, 2] - x[0, :, 2])),
    ]


def energies(run: Trace) -> list[Figure]:
    """Figure 18, frictional case: kinetic energies of the balls, potential energy, and the sum."""
    model = scene("frictional").to_model()
    mass, inertia = (np.asarray(model[key]) for key in ("mass", "inertia"))
    g = -float(model["gravity"][2])
    kinetic = 0.5 * (
        mass * np.sum(run.velocity**2, axis=2) + inertia * np.sum(run.angular_velocity**2, axis=2)
    )
    lifted = 1e3 * mass * g * (run.position[:, :, 2] - run.position[0, :, 2])
    total = (Curve("all", run.time, kinetic.sum(axis=1)),)
    title = "Kinetic energy of all balls"
    return [
        _figure("18a", "Kinetic energy", "energy in J", run, kinetic),
        _figure("18b", "Potential energy, from that at rest", "energy in mJ", run, lifted),
        Figure("18c", title, "time in s", "energy in J", total, CAPTIONS["18c"]),
    ]


def _figure(number: str, title: str, label: str, run: Trace, values: F64) -> Figure:
    """A quantity (T, 3) against time, a curve for each ball."""
    curves = tuple(Curve(f"ball {i + 1}", run.time, values[:, i], body=i) for i in range(3))
    shown = WINDOWS.get(number, (None, None, None, None))
    return Figure(number, title, "time in s", label, curves, CAPTIONS[number], limits=shown)
