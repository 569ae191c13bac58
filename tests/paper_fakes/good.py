"""All agrees; one number of the paper is wrong; a heavy part and a figure of each kind."""

from __future__ import annotations

import os

import numpy as np
from carom.reproduce.document import Context, Counts, Curve, Example, Figure, Row

ERRATUM = "eq. (46) has 4I/k where k/(4I) belongs, the *reciprocal* | as the limit from the left shows"


def _half(context: Context) -> tuple[float, int]:
    return (0.25 if context.quick else 0.5), os.getpid()


PARTS = {"half": _half}


def reproduce(context: Context) -> Example:
    half, process = context.part("half", _half)
    assert process != os.getppid()
    x = np.geomspace(1e-4, 1e-2, 200)
    rows = (
        Row("number of balls", "", 2.0, None, 2.0, 0.0, "a count", "paper"),
        Row("speed at 1 s", "m/s", "0.50", 0.5, 0.5 + 1e-13, 1e-12, "rounding", "analytic"),
        Row(
            "spin after t_lim",
            "rad/s",
            -0.00691,
            -18.73045,
            -18.7304,
            1e-3,
            "first order, c h",
            "analytic",
            ERRATUM,
            True,
        ),
        Row("half", "", None, half, half, 1e-12, "rounding", "analytic", "computed beforehand"),
    )
    time = np.linspace(0.0, 1.0, 50)
    figures = (
        Figure(
            "3a", "Angular velocities", "time in s", "angular velocity in rad/s",
            (Curve("ball A", time, np.sin(9 * time), body=0), Curve("ball A, exact", time, np.sin(9 * time), "dashed", 0),
             Curve("ball B", time, np.cos(9 * time), body=1)),
            "Both spheres turn. The paper: good agreement.",
        ),
        Figure(
            "4", "Convergence", "step in s", "error, eq. (45)",
            (Curve("velocity", x, 3 * x, "points"), Curve("position", x, x**2, "points")),
            "The paper: linear.", "log", "log", (1.0, 2.0),
        ),
    )  # fmt: skip
    counts = (
        Counts("default", (1, 1), (6, 1.04), (4, 1.01), (0, 0),
               {"smooth": (1, 1), "position": (7, 2), "line_search": (9, None)}, 0, 0, 1e-8, 1e-3),
    )  # fmt: skip
    options = {"default": {"step": 1e-3, "tolerance": 1e-8}, "as printed": {"step": 1e-3, "tolerance": 1e-5}}
    texts = ("Two spheres, *one* above the other; see [5.4](#54-falls-short).",)
    return Example("5.1", "Two spheres", rows, figures, counts, texts, options, ("5.6_break.toml",))
