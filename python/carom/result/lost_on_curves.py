"""What a finished run says of energy that its step took on curved walls."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carom.scene.assembly.distances import gaps
from carom.scene.checks.curved_walls import CLOSE, CURVED, FEW_BALLS, MOST_CHANGE, below, way_on

if TYPE_CHECKING:
    from carom.result.result import Result

MOST_FRAMES = 2000
"""Frames, evenly spread, from which the loss is estimated."""


def lost_on_curves(result: Result) -> str | None:
    """That the scheme took energy from balls in fixed bowls, tubes and cones, with a cure; None if hardly any.

    The force on the wall is that of gravity and of the curved path in the frames; other balls press besides.
    """
    scene = result.scene
    mass, radius = np.asarray(result.bodies["mass"]), np.asarray(result.bodies["radius"])
    hollow = [w for w in scene._walls() if w.kind in CURVED and w.shape[-1] and w.motion is None]
    if (
        not hollow
        or len(mass) > FEW_BALLS
        or scene.run.method == "penalty"
        or not result.summary
        or len(result.time) < 2
    ):
        return None
    frames = np.unique(np.linspace(0, len(result.time) - 1, MOST_FRAMES).astype(int))
    position = np.concatenate([result.position[k] for k in frames])
    velocity = np.nan_to_num(
        np.concatenate([result.velocity[k] for k in frames])
    )  # of balls that are not there
    masses = np.tile(mass, len(frames))
    largest = float((0.5 * masses * (velocity**2).sum(axis=1)).reshape(len(frames), -1).sum(axis=1).max())
    power = np.zeros(len(masses))
    for wall in hollow:
        on = np.flatnonzero(
            gaps(wall, position, np.tile(radius, len(frames))) <= CLOSE * np.tile(radius, len(frames))
        )
        way = way_on(wall, position[on], velocity[on], np.array(scene.gravity))
        bent = way.curvature * way.speed**2
        power[on] += 0.5 * scene.run.step * masses[on] * np.maximum(0.0, way.load + bent) * bent
    lost = float(np.trapezoid(power.reshape(len(frames), -1).sum(axis=1), np.asarray(result.time)[frames]))
    if lost <= MOST_CHANGE * largest:
        return None
    left = max(largest - lost, 0.01 * largest)  # what is lost at first is not there to be lost later
    step = below(scene.run.step * MOST_CHANGE * left / lost)
    told = f"the step took about {100 * lost / largest:.2g} % of the largest kinetic energy on curved walls"
    return f"{told} (estimate from the frames): step = {step:g} takes less than 1 %"
