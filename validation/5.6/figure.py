"""The figure of order.py: errors against h and against the delay of the impact, and the cue ball after it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from measure import AFTER, LAWS

COLOURS = {"sequence": "#1b6ca8", "sequence-paper": "#c8553d"}
WORDS = {"middle": "impact in the middle of a step", "round": "round steps"}
#: Marker and whether it is filled, by family of steps and quantity.
MARKS = {("middle", "v"): "o", ("middle", "w"): "s", ("round", "v"): "x", ("round", "w"): "+"}


def draw(found: dict[str, Any], folder: Path) -> Path:
    """Write 5.6_order.png into `folder` and return its path."""
    figure, ((by_step, by_delay), (back, up)) = plt.subplots(2, 2, figsize=(12, 9), layout="constrained")
    for law in LAWS:
        for (family, short), mark in MARKS.items():
            points = found["laws"][law][family]
            error = [p.after[short] for p in points]
            # The laws differ in colour only: the marks are named once.
            label = f"{short}, {WORDS[family]}" if law == LAWS[0] else None
            line = "-" if family == "middle" else "none"
            style: dict[str, Any] = {"color": COLOURS[law], "marker": mark, "markersize": 5, "linewidth": 1}
            by_step.loglog([p.h for p in points], error, linestyle=line, label=label, **style)
            by_delay.loglog([p.delay for p in points], error, linestyle="none", **style)
    _slope(by_step, 2e-5, 1e-3, 6e-5, "order 1")
    _slope(by_delay, 6e-6, 7e-4, 8e-5, "slope 1")
    by_step.set(xlabel="step h (s)", ylabel=f"error at {AFTER} s, eq. 45", title="Error against the step")
    by_delay.set(
        xlabel="end of the step of the impact - exact contact (s)",
        title="The same against the delay of the impact",
    )
    by_step.legend(fontsize=8, loc="lower right")
    for law in LAWS:
        points = sorted(found["laws"][law]["round"] + found["laws"][law]["middle"], key=lambda p: p.delay)
        delay = np.array([p.delay for p in points])
        # The laws lift the cue ball alike: one line is drawn wide so that both are seen.
        wide = {"linewidth": 5, "alpha": 0.4} if law == LAWS[0] else {"linewidth": 1.2}
        back.plot(1e3 * delay, [p.cue[0] for p in points], "o-", color=COLOURS[law], markersize=4, label=law)
        points.sort(key=lambda p: p.h)
        up.semilogx([p.h for p in points], [p.cue[2] for p in points], color=COLOURS[law], label=law, **wide)
    back.set(
        xlabel="delay of the impact (ms)", ylabel="v_x (m/s)", title="Cue ball just after the impact: back"
    )
    up.set(xlabel="step h (s)", ylabel="v_z (m/s)", title="... and up, with the height of its jump")
    height = up.twinx()
    runs = found["whole"][LAWS[0]]
    heights = [1e3 * r["jump"] for r in runs]
    height.semilogx([r["h"] for r in runs], heights, "ks", markerfacecolor="none", label="height")
    height.set_ylabel("height of the jump (mm, squares)")
    height.set_ylim(0, 1.2 * max(heights))
    back.legend(title="law", fontsize=8)
    up.legend(title="law", fontsize=8)
    for axes in (by_step, by_delay, back, up):
        axes.grid(True, which="major", alpha=0.3)
    figure.suptitle("Billiard break, section 5.6: blue law `sequence`, red `sequence-paper`")
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "5.6_order.png"
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return path


def _slope(axes: Any, left: float, right: float, error: float, words: str) -> None:
    axes.loglog([left, right], [error, error * right / left], color="0.6", linestyle="--", linewidth=1)
    axes.annotate(words, (right, error * right / left), color="0.4", fontsize=8, ha="right", va="top")
