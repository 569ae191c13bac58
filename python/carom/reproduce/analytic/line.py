"""Three balls in a line (section 5.4): the impact and what follows of it, in closed form.

Ball 1 rolls with v against ball 2, which touches ball 3; all lie on a bed. e = 1 between balls, 0 on the bed; mu_b
and mu are the friction of the two; s = mu_b mu is small. Per unit of mass, x forward, z up, y to the left:

1st problem  {1-2, bed of 2}: the front of ball 1 moves down, so friction lifts ball 1 and presses ball 2 on the bed, which
             brakes it: v1x = -s v/(2 - s), P = v - v1x, v1z = mu_b P, v2x = v + v1x, r w2 = -(mu_b - s) P/kappa
2nd problem  {2-3}: ball 2 hands over its speed; its back spin lifts ball 3 by the impulse that ends the slip,
             F = |r w2|/(2 (1 + 1/kappa)) where that is below mu_b v2x: v3x = v2x, v3z = F, r w3 = F/kappa
3rd problem  {bed of 2}: F pressed ball 2 on the bed, which slips: v2x = -mu F

Ball 2 then slides back at mu g (its spin still points backwards), catches up with ball 1 in the air after about 2 (v2x -
v1x)/(mu g), and so on. Ball 3 lands, slides and rolls in the end with (v3x + kappa r w3)/(1 + kappa): friction of the
bed does not change that sum. Without friction all this is v1 = v2 = 0, v3 = v.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from carom.errors import CaromError
from carom.reproduce.analytic.impact import Ball, Touch
from carom.reproduce.analytic.sequence import Problem, sequence

UP = np.array([0.0, 0.0, 1.0])
AHEAD = np.array([1.0, 0.0, 0.0])


@dataclass(frozen=True)
class LineHit:
    """The hit of a ball that rolls (or slides without spin where there is no friction) with `speed`, m/s."""

    speed: float
    kappa: float
    mu: float
    mu_b: float
    gravity: float

    def __post_init__(self) -> None:
        """Refuse friction so large that a phase assumed to slip would stick, or the other way round."""
        if self.mu_b and not (
            0 < self.lift_3 < self.mu_b * self.ahead_2 and self.mu_b * self._push < self.speed / 4
        ):
            raise CaromError("the closed form of the line holds for small friction between the balls only")

    @property
    def back_1(self) -> float:
        """v_x of ball 1 after the impact, m/s: negative, it bounces back."""
        s = self.mu * self.mu_b
        return -s * self.speed / (2 - s)

    @property
    def _push(self) -> float:
        return self.speed - self.back_1

    @property
    def up_1(self) -> float:
        """v_z of ball 1, m/s."""
        return self.mu_b * self._push

    @property
    def jump_1(self) -> float:
        """Height of its jump, m."""
        return self.up_1**2 / (2 * self.gravity)

    @property
    def ahead_2(self) -> float:
        """v_x of ball 2 between the first and the second problem, and of ball 3 after it, m/s."""
        return self.speed + self.back_1

    @property
    def lift_3(self) -> float:
        """v_z of ball 3, m/s."""
        back_spin = (self.mu_b - self.mu * self.mu_b) * self._push / self.kappa
        return back_spin / (2 * (1 + 1 / self.kappa))

    @property
    def jump_3(self) -> float:
        """Height of its jump, m."""
        return self.lift_3**2 / (2 * self.gravity)

    @property
    def back_2(self) -> float:
        """v_x of ball 2 after the impact, m/s."""
        return -self.mu * self.lift_3

    @property
    def next_hit(self) -> float:
        """Time until ball 2, sliding back, would strike ball 1 again if that had not left the bed, s."""
        return 2 * (self.back_2 - self.back_1) / (self.mu * self.gravity)

    @property
    def rolling_3(self) -> float:
        """Speed with which ball 3 rolls in the end, m/s."""
        return (self.ahead_2 + self.lift_3) / (1 + self.kappa)


def solved(model: Mapping[str, Any], speed: float) -> list[Problem]:
    """The same impact by solving its problems, from the core's arrays: ball 0 rolls with `speed` (m/s) along x.

    Holds for any friction; the tests hold `LineHit` against it.
    """
    balls = []
    for i in range(3):
        mass, radius, inertia = (float(model[key][i]) for key in ("mass", "radius", "inertia"))
        v, w = (speed, speed / radius) if i == 0 else (0.0, 0.0)
        balls.append(Ball(mass, radius, inertia, v * AHEAD, w * np.array([0.0, 1.0, 0.0])))
    (mu_b, mu), (e_b, e) = model["friction"], model["restitution"]
    touches = [Touch(a, a + 1, -AHEAD, float(mu_b), float(e_b)) for a in (0, 1)]
    touches += [Touch(a, None, UP, float(mu), float(e)) for a in range(3)]
    return sequence(balls, touches, pressed=(2, 3, 4))
