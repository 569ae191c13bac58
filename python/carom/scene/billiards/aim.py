"""The direction of a cue ball that is to send another ball where the player wants it: by the ghost ball.

At the hit the centres are one sum of the radii apart, and as high as they are now. In the plane that of the cue ball is the
rest of this behind the object ball, on the line on which that ball is to leave. Without friction between the balls it leaves
on their line of centres. Friction throws it off that line, by up to 5 degrees; cushions and other balls in the way are not
looked at.
"""

from __future__ import annotations

import math

from carom.errors import CaromError
from carom.scene.billiards.arguments import angle
from carom.scene.billiards.places import overlap
from carom.scene.checks.walls import TOUCHING
from carom.scene.tables.balls import Sphere

Place = tuple[float, float]


def direction_to(cue: Sphere, ball: Sphere, target: Place) -> float:
    """The direction of `cue` (rad, from x towards y) that sends `ball` along the line to `target` (x, y), m."""
    (cue_at, ball_at), reach = _places(cue, ball)
    away = math.dist(ball_at, target)
    if not away > 0:
        raise CaromError(f"aim: {ball.name!r} lies at the place that it is to go to")
    line = [(t - x) / away for t, x in zip(target, ball_at, strict=True)]
    way = [x - reach * n - c for x, n, c in zip(ball_at, line, cue_at, strict=True)]
    if math.hypot(*way) <= TOUCHING * reach:  # the cue ball is the ghost ball
        return math.atan2(line[1], line[0])
    along, across = way[0] * line[0] + way[1] * line[1], way[0] * line[1] - way[1] * line[0]
    if not along > 0:
        cut = abs(math.degrees(math.atan2(across, along)))
        raise CaromError(
            f"aim: {cue.name!r} cannot send {ball.name!r} there: the cut would be {cut:.3g} deg, and must be below 90"
        )
    return math.atan2(way[1], way[0])


def direction_of_cut(cue: Sphere, ball: Sphere, cut: float | str) -> float:
    """The direction of `cue` (rad) in which `ball` leaves at the angle `cut` to it, above 0 to the left."""
    (cue_at, ball_at), reach = _places(cue, ball)
    turn = angle("aim", "cut", cut, lambda a: abs(a) < math.pi / 2, "must be between -90 deg and 90 deg")
    # Across the way of the cue ball the centres are reach * sin(cut) apart, at the start as at the hit.
    straight = math.atan2(ball_at[1] - cue_at[1], ball_at[0] - cue_at[0])
    return straight - math.asin(reach * math.sin(turn) / math.dist(cue_at, ball_at))


def _places(cue: Sphere, ball: Sphere) -> tuple[tuple[Place, Place], float]:
    """Both centres (x, y) and how far apart they are there at the hit, m, or less where balls touch."""
    if overlap(cue.position, cue.radius, ball.position, ball.radius):
        what = (
            f"{cue.name!r} is aimed at itself" if cue is ball else f"{cue.name!r} and {ball.name!r} overlap"
        )
        raise CaromError(f"aim: {what}")
    (*cue_at, cue_z), (*ball_at, ball_z) = (map(float, b.position) for b in (cue, ball))
    whole, rise = cue.radius + ball.radius, cue_z - ball_z
    reach = min(math.sqrt(max(0.0, (whole - rise) * (whole + rise))), math.dist(cue_at, ball_at))
    if not reach > 0:
        raise CaromError(
            f"aim: {cue.name!r} passes {'above' if rise > 0 else 'below'} {ball.name!r};"
            f" they meet where their centres are less than {whole:g} m apart in height, found {abs(rise):g} m"
        )
    return ((cue_at[0], cue_at[1]), (ball_at[0], ball_at[1])), reach
