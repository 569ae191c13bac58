"""Section 5.6: motion of the balls, the cue ball by two methods, Newton's residuals. Figures 24 to 26."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from carom.arrays import F64
from carom.reproduce.document import Curve, Figure
from carom.reproduce.memory import Trace

Limits = tuple[float | None, float | None, float | None, float | None]

BALLS = ("ball2", "ball3", "ball4", "ball5")
#: Until when figure 25 shows the jump of the cue ball, s.
JUMP: Limits = (0.1, 0.16, None, None)


def velocities(free: Trace, braked: Trace) -> list[Figure]:
    """Figure 24: speeds of all balls without and with rolling resistance."""
    texts = {
        "24a": (free, "without", "A ball that rolls keeps its speed until its next hit."),
        "24b": (braked, "with", "Rolling resistance brings every ball to rest."),
    }
    found = []
    for number, (run, how, caption) in texts.items():
        curves = tuple(Curve(f"ball {i + 2}", run.time, run.velocity[:, i, 0], body=i) for i in range(4))
        title = f"Velocities {how} rolling resistance"
        found.append(Figure(number, title, "time in s", "v_x in m/s", curves, caption))
    return found


def cue_ball(run: Trace, penalty: Trace | None) -> list[Figure]:
    """Figure 25: the cue ball by both methods, its velocities and its jump."""
    runs = [(run, "", True)] + ([(penalty, ", penalty", False)] if penalty else [])
    told = "" if penalty else " The penalty method was left out of this run."
    v = [(r, r.velocity[:, 0, 0], label, own) for r, label, own in runs]
    w = [(r, r.angular_velocity[:, 0, 1], label, own) for r, label, own in runs]
    rise = [(r, 1e3 * (r.position[:, 0, 2] - r.position[0, 0, 2]), label, own) for r, label, own in runs]
    thrown, constant = (
        f"It is thrown back at the break, slides and rolls.{told}",
        "Constant while the ball is in the air.",
    )
    return [
        _pair("25a-v", "Cue ball: velocity", "v_x in m/s", v, thrown),
        _pair("25a-w", "Cue ball: angular velocity", "w_y in rad/s", w, constant + told),
        _pair("25b", "Cue ball: height", "rise in mm", rise, f"The jump after the break.{told}", JUMP),
    ]


def _pair(
    number: str,
    title: str,
    label: str,
    curves: Sequence[tuple[Trace, F64, str, bool]],
    caption: str,
    limits: Limits = (None, None, None, None),
) -> Figure:
    drawn = tuple(
        Curve(f"ball 2{name}", run.time, values, "line" if own else "dashed", body=0 if own else None)
        for run, values, name, own in curves
    )
    return Figure(number, title, "time in s", label, drawn, caption, limits=limits)


def residuals(position: F64, velocity: F64) -> Figure:
    """Figure 26: relative residuals of Newton's iterations in the step of the break."""
    curves = []
    for name, history in (("position level", position), ("velocity level", velocity)):
        kept = history[history > 0]
        curves.append(Curve(name, np.arange(len(kept), dtype=np.float64), kept))
    return Figure(
        "26",
        "Residuals in the step of the break",
        "iteration",
        "relative residual (eq. 44)",
        tuple(curves),
        "The paper reports quadratic convergence. Position level and the velocity problem with most iterations.",
        yscale="log",
    )
