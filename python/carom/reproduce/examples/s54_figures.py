"""Section 5.4: motion and energies of the three balls. Figures 16 to 18."""

from __future__ import annotations

import numpy as np

from carom.arrays import F64
from carom.reproduce.document import Curve, Figure
from carom.reproduce.examples.s54_study import scene
from carom.reproduce.memory import Trace

Limits = tuple[float | None, float | None, float | None, float | None]

BALLS = ("ball1", "ball2", "ball3")
ALL: Limits = (None, None, None, None)


def motion(free: Trace, rough: Trace) -> list[Figure]:
    """Figures 16 and 17."""
    without, with_friction = "without friction", "with friction"
    height = 1e3 * (rough.position[:, :, 2] - rough.position[0, :, 2])
    return [
        _figure(
            "16a", f"Displacement {without}", "x in m", free, free.position[:, :, 0], "Balls 1 and 2 stay."
        ),
        _figure(
            "16b",
            f"Velocity {without}",
            "v_x in m/s",
            free,
            free.velocity[:, :, 0],
            "Ball 3 leaves with the velocity of ball 1, in one step.",
        ),
        _figure(
            "17a",
            f"Displacement {with_friction}",
            "x in m",
            rough,
            rough.position[:, :, 0],
            "The hit comes 52 ms later: friction slows ball 1 until it rolls. Balls 1 and 2 go on together.",
        ),
        _figure(
            "17b",
            f"Velocity {with_friction}",
            "v_x in m/s",
            rough,
            rough.velocity[:, :, 0],
            "Ball 1 slides, rolls from 0.284 s, hits; ball 3 slides until it rolls.",
        ),
        _figure(
            "17b-detail",
            f"Velocity {with_friction}: the re-impacts",
            "v_x in m/s",
            rough,
            rough.velocity[:, :, 0],
            "Ball 1 bounces back (negative), ball 2 slides after it, and they strike each other again and again.",
            (0.32, 0.42, -0.03, 0.06),
        ),
        _figure(
            "17c",
            f"Angular velocity {with_friction}",
            "w_y in rad/s",
            rough,
            rough.angular_velocity[:, :, 1],
            "Here forward roll about +y is positive; the paper draws the opposite sign.",
        ),
        _figure(
            "17d",
            f"Height {with_friction}",
            "rise in mm",
            rough,
            height,
            "Balls 1 and 3 leave the bed after the first impact.",
            (0.32, 0.38, None, None),
        ),
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
    total = Curve("all", run.time, kinetic.sum(axis=1))
    return [
        _figure(
            "18a",
            "Kinetic energy",
            "energy in J",
            run,
            kinetic,
            "Ball 1 loses energy while it slides and keeps it while it rolls; most of it goes to ball 3.",
        ),
        _figure(
            "18b",
            "Potential energy, from that at rest",
            "energy in mJ",
            run,
            lifted,
            "Ball 1 leaves the bed, and so does ball 3.",
            (0.32, 0.38, None, None),
        ),
        Figure(
            "18c",
            "Kinetic energy of all balls",
            "time in s",
            "energy in J",
            (total,),
            "It falls while a ball slides, and stays when all roll.",
        ),
    ]


def _figure(
    number: str, title: str, label: str, run: Trace, values: F64, caption: str, limits: Limits = ALL
) -> Figure:
    """A quantity (T, 3) against time, a curve for each ball."""
    curves = tuple(Curve(f"ball {i + 1}", run.time, values[:, i], body=i) for i in range(3))
    return Figure(number, title, "time in s", label, curves, caption, limits=limits)
