"""Section 5.6: iterations, line search, the impact and the times of rest, by law, solver and tolerance.

    python validation/5.6/compare.py

Prints what `docs/validation/5.6_break.md` holds beside the convergence (order.py). `carom demo` shows the same
case with figures; this varies what the paper leaves open.
"""

from __future__ import annotations

import itertools
import sys
import warnings
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parent.parent))

import carom
from carom import CaromWarning, Result
from carom.reproduce import demo
from common import SCENARIOS, model_of, run, table
from measure import BALLS, LAWS, SCENARIO

PAPER_TOLERANCE, DEFAULT_TOLERANCE = 1e-5, 1e-8
LEVELS = ("smooth", "position", "velocity")
ROLLING = "5.6_break_rolling"
#: Until every ball rests with rolling resistance, s; order.py shows that such late times depend on h.
UNTIL = 6.0


def iterations() -> str:
    """Iterations of the frictional case, 3000 steps, beside the paper's."""
    paper = [f"{most} / {mean}" for most, mean in (demo.PAPER_ITERATIONS[level] for level in LEVELS)]
    rows = [["paper", *paper, "35 (9 + 26)", "", "", ""]]
    for solver, law, tolerance in itertools.product(
        ("auto", "newton"), LAWS, (PAPER_TOLERANCE, DEFAULT_TOLERANCE)
    ):
        m = run(SCENARIO, 1e-3, [3.0], impact=law, solver=solver, tolerance=tolerance).monitors
        counts = [f"{m['iterations'][x]['max']:g} / {m['iterations'][x]['mean']:.2f}" for x in LEVELS]
        searched = m["line_search"]["position"] + m["line_search"]["velocity"]
        failed = [str(m[key]) for key in ("fallbacks", "unconverged")]
        rows.append(
            [
                f"{solver}, {law}, {tolerance:g}",
                *counts,
                str(searched),
                str(m["impact_problems"]["max"]),
                *failed,
            ]
        )
    head = ["solver, law, tolerance", *LEVELS, "line search", "problems max", "fallbacks", "unconverged"]
    return table(head, rows)


def impact(h: float) -> str:
    """Velocities just after the impact, and where the sliding of ball 3 ends, by law."""
    rows = []
    for law in LAWS:
        with _simulated(SCENARIO, h, 1.0, law) as result:
            time, speed, step = demo.first_contact(result, demo.CUE, demo.APEX)
            frame = int(np.searchsorted(np.asarray(result.step), step))
            after = [result[name].velocity[frame] for name in BALLS]
            begins, rolling = demo._begins_to_roll(result, demo.APEX, frame)
            numbers = [f"{time:.5f}", f"{speed:.4f}", *(f"{v[0]:+.4f}" for v in after), f"{after[2][1]:+.4f}"]
            rows.append([law, *numbers, f"{after[0][2]:+.4f}", f"{rolling:+.3f} at {begins:.3f}"])
    head = [
        "law",
        "contact (s)",
        "speed",
        *(f"{ball} v_x" for ball in BALLS),
        "ball4 v_y",
        "ball2 v_z",
        "ball3 rolls",
    ]
    return table(head, rows)


def rest() -> str:
    """When the balls come to rest with rolling resistance."""
    rows = []
    for law, h in itertools.product(LAWS, (1e-3, 1e-4)):
        with _simulated(ROLLING, h, UNTIL, law) as result:
            times = demo._rested(result)
            deepest, rise = (
                result.summary["penetration_max_relative"],
                result.summary["energy"]["max_rise_relative"],
            )
            told = [f"{times[name]:.3f}" if name in times else "moves" for name in BALLS]
            lost = str(result.summary["unconverged"])
            rows.append([f"{law}, h = {h:g}", *told, lost, f"{deepest:.0e}", f"{rise:.0e}"])
    return table(["law, step (s)", *BALLS, "unconverged", "penetration (r)", "energy rise"], rows)


def histories() -> str:
    """Residuals of Newton's method at the impact step: fig. 26."""
    lines = []
    for law in LAWS:
        with _simulated(SCENARIO, 1e-3, 0.12, law) as result:
            _, _, step = demo.first_contact(result, demo.CUE, demo.APEX)
            for level in ("position", "velocity"):
                for history in result.residuals.history(step, level):
                    if len(history) > 2:
                        told = "  ".join(f"{x:.1e}" for x in history)
                        lines.append(f"{law}, {level}, {len(history)} residuals: {told}")
    return "\n".join(lines)


def _simulated(scenario: str, h: float, until: float, law: str) -> Result:
    scene = carom.Scene.from_toml(SCENARIOS / f"{scenario}.toml")
    with warnings.catch_warnings():
        # The scenario file says why the paper's step draws advice.
        warnings.simplefilter("ignore", CaromWarning)
        return carom.simulate(scene, step=h, until=until, impact=law, every=1)


def main() -> int:
    """The command."""
    argument = sys.argv[1:]
    if argument:
        print(__doc__, file=sys.stderr)
        return 0 if argument[0] in ("-h", "--help") else 2
    bodies = len(model_of(SCENARIO)["radius"])
    print(
        f"Section 5.6, {bodies} balls, 3000 steps of 1e-3 s: iterations, largest / mean over the steps\n{iterations()}\n"
    )
    for h in (1e-3, 1e-4):
        print(f"Just after the impact, h = {h:g} s (m/s)\n{impact(h)}\n")
    print(f"Residuals at the impact step, h = 1e-3 s, tolerance {DEFAULT_TOLERANCE:g}\n{histories()}\n")
    print(f"With rolling resistance, rho = 0.005 m: at rest (s)\n{rest()}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
