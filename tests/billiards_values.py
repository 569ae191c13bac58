"""Laws and balls of the tests of the billiards kit."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from carom import billiards
from carom.billiards import LAWS

G = 9.8


def laws(**values: Any) -> billiards.Laws:
    """The usual laws with other numbers."""
    return replace(LAWS, **values)


IDEAL = laws(ball_restitution=1.0, ball_friction=0.0, rolling_deceleration=0.0, spin_deceleration=0.0)
BALL = {"radius": 0.028575, "mass": 0.17, "inertia": 0.4 * 0.17 * 0.028575**2}
