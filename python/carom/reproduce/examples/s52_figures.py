"""Section 5.2: figures 5b to 9."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from carom.reproduce import study
from carom.reproduce.analytic import single_collision as exact
from carom.reproduce.document import Curve, Figure
from carom.reproduce.examples import s52_study as runs
from carom.reproduce.examples.two_balls import energies as energies_of
from carom.reproduce.examples.two_balls import hit_step
from carom.reproduce.memory import Trace


def rule(found: Mapping[float, Trace]) -> Figure:
    """Figure 5b: the 30 degree rule."""
    fractions = np.linspace(0, 1, 101)
    closed = np.degrees(exact.deflection(exact.cut_angle(fractions)))
    points = np.array([[fraction, runs.deflection_of(run)] for fraction, run in found.items()])
    return Figure(
        "5b",
        "Deflection of the cue ball",
        "hit fraction f",
        "deflection in deg",
        (
            Curve("eq. 48", fractions, closed, "line", 0),
            Curve("Carom", points[:, 0], points[:, 1], "points", 0),
        ),
        "Between a quarter and three quarters of a ball the cue ball is turned by about 30 degrees. The paper reports"
        " agreement with eq. 48.",
    )


def paths(found: Sequence[runs.Path], number: str, *, locked: bool) -> Figure:
    """Figures 6a and 6b: the path of the cue ball after the hit."""
    curves = []
    for body, path in enumerate(p for p in found if p.locked == locked):
        n, label = path.start(path.run), path.label.rsplit(",", 1)[0]
        time = np.linspace(0, path.run.time[-1] - path.after(path.run), 300)
        line, printed = path.exact.position(time), path.printed.position(time)
        places = path.run.position[n::250, 0]
        curves += [
            Curve(f"{label}, exact", line[:, 0], line[:, 1], "line", body),
            Curve(f"{label}, eqs. 63-67", printed[:, 0], printed[:, 1], "dashed", body),
            Curve(f"{label}, Carom", places[:, 0], places[:, 1], "points", body),
        ]
    return Figure(
        number,
        f"Path of the cue ball after the hit, spin {'locked' if locked else 'free'}",
        "x in m",
        "y in m",
        tuple(curves),
        "Half-ball hit. Lines: the impact law with the cloth, then flight, bounces, sliding and rolling; dashed: Appendix C"
        " with the sign of eq. 64 corrected. "
        + (
            "The paper finds good agreement with Appendix C."
            if locked
            else "The paper departs slightly from Appendix C."
        ),
    )


def energies(path: runs.Path) -> tuple[Figure, ...]:
    """Figures 7a to 7c: the whole run, the hit, what follows."""
    run = path.run
    event, end = path.after(run), float(run.time[-1])
    windows = (
        ("7a", "Energies in time", 0.0, end, 30, "The cue ball slides, rolls, hits; both balls slide and roll."),
        ("7b", "Energies around the hit", event - 0.005, event + 0.02, 1,
         "The cue ball, thrown up by friction, separates from the cloth: potential energy."),
        ("7c", "Energies after the hit", event + runs.H, end, 20, "Sliding costs energy, rolling none."),
    )  # fmt: skip
    return tuple(_energies(run, *window) for window in windows)


def _energies(run: Trace, number: str, title: str, start: float, end: float, every: int, said: str) -> Figure:
    time = run.steps["time"]
    inside = np.flatnonzero((time >= start) & (time <= end))
    hit = hit_step(run)
    kept = np.unique([*inside[::every], *(n for n in range(hit - 3, hit + 3) if n in inside)])
    curves = energies_of(run, kept)
    drawn = curves[1:2] if number == "7b" else curves
    caption = f"{said} The paper: no spurious energy throughout."
    return Figure(number, title, "time in s", "energy in J", drawn, caption)


def order(points: Sequence[runs.Point]) -> Figure:
    """Figure 9: errors against the step."""
    return study.convergence(
        "9",
        "Convergence with the step",
        (
            study.errors("displacement", points, "displacement", body=0),
            study.errors("velocity, before the cue ball lands", points, "velocity", body=1),
        ),
        "mu_b = 0.2, e_N = 0.94, f = 0.5, spin locked, against the impact law with the cloth and the exact motion after it."
        " The paper shows a linear rate against Appendix C, whose eq. 63 does not hold here: the slip ends within the hit.",
    )
