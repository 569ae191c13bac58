"""Section 5.6: a billiard break, without and with rolling resistance, beside a penalty method. Figures 24 to 26."""

from __future__ import annotations

import math

from carom import _core
from carom.reproduce import demo, study
from carom.reproduce.document import Context, Example
from carom.reproduce.examples import s56_rows as rows
from carom.reproduce.examples import s56_study as order
from carom.reproduce.examples.s56_figures import cue_ball, residuals, velocities
from carom.reproduce.examples.s56_rows import ID, H
from carom.reproduce.examples.s56_study import BRAKED, CASES, FREE, NAMES, scene
from carom.reproduce.memory import Trace, timed, trace

# What section 5.6 prints (times of the impact and of computation: carom.reproduce.demo).
PAPER_COUNTS: dict[str, study.Printed] = {
    NAMES[FREE]: {**demo.PAPER_ITERATIONS, "line_search": (sum(rows.PAPER_LINE_SEARCHES), 0)},
    NAMES[BRAKED]: {},
}
#: Runs of which the fastest is timed; the quick form has one.
TIMED = 3


def has_penalty() -> bool:
    """Whether the core knows continuous contact forces."""
    return "penalty" in _core.choices()["method"]


def penalty(context: Context) -> Trace | None:
    """The whole break by continuous contact forces, where the core has that method."""
    return trace(scene(FREE), method="penalty") if has_penalty() else None


PARTS = {"points": order.points, "penalty": penalty}


def reproduce(context: Context) -> Example:
    """The example with all its rows, figures and counts."""
    default = study.default_tolerance(context)
    both = study.distinct(default)
    runs = {(case, tol): trace(scene(case), tolerance=tol) for case in CASES for tol in both}
    free, braked = runs[FREE, default], runs[BRAKED, default]
    found = context.part("points", order.points)
    other = context.part("penalty", penalty)
    contact = rows.contact_of(free, FREE)
    history = rows.longest(free, contact.step, "position")
    orders = order.orders(found)
    table = [
        *rows.until_contact(free, FREE),
        *rows.after(),
        *rows.cue_ball(free, contact.step),
        rows.at_the_end(free),
        *(study.first_order(f"{short} after the impact, {law}", o) for (law, short), o in orders.items()),
        rows.newton(history),
        *rows.line_searches(free, contact.step),
        *rows.until_contact(braked, BRAKED),
        *rows.rest(braked),
        *(study.unconverged(tol, [runs[case, tol] for case in CASES]) for tol in both),
        study.energy_rise("greatest rise of energy in a step", [free, braked]),
        study.penetration(runs.values()),
        rows.mirror(free),
    ]
    coarse = order.round_points(context)
    return Example(
        id=ID,
        title="Billiard break",
        rows=tuple(table),
        figures=(
            *velocities(free, braked),
            *cue_ball(free, other),
            residuals(history, rows.longest(free, contact.step, "velocity")),
            order.figure(found, coarse),
        ),
        counts=study.iterations(
            {NAMES[case]: scene(case) for case in CASES}, both, PAPER_COUNTS, [NAMES[FREE]]
        ),
        texts=_texts(free, braked, contact.step, other, 1 if context.quick else TIMED),
        options={
            "figures": {"step": H, "tolerance": default, "impact": "sequence", "spectral_radius": 0.8},
            "convergence": {
                "steps": [p.h for p in order.of(order.LAWS[0], found)],
                "impact": list(order.LAWS),
            },
        },
        scenarios=tuple(f"{case}.toml" for case in CASES),
    )


TEXT = """
The paper gives neither the positions of the balls nor g. Cue ball on the head spot and apex ball on the foot spot are
1.27 m apart. With m = 0.17 kg and g = 9.8 m/s^2 this gives its 0.114 s. The words "ball 3 moves forward with low
velocity" fix the orientation of the rack. Which of balls 4 and 5 lies on which side is not said.

**The break.** Three impact problems in one step: {2-3 and the bed}, {3-4, 3-5}, {2-3 again and the bed}. The rows hold
the velocities against the same sequence solved at the exact instant by a program of its own. At 10.5 m/s the cue ball
travels 0.37 r in a step of 1 ms. Predicted too deep, it is pushed back along turned normals, and all components are off
by O(h). With rolling resistance the moments of the bed take part in the impact. For that case only the motion before the
impact and the way to rest have closed forms.

**Later states** depend on O(h) like chaos. Every ball and cushion met multiplies the differences. Curves after the second
hit cannot be compared point by point, neither with the paper nor with another step. Orders are therefore read at the
impact.

**Computing time.**

$times

**Penalty method.** The paper's curves differ a little from those of the penalty method, and it does not say why. It is a
property of the law: the sequence handles one contact after the other, springs act at once. $penalty

**Rest.** With rho = 0.005 m, about ten times that of real cloth, every ball comes to rest. The bed has no spinning
friction, so balls 4 and 5 spin on about the vertical. The rows hold the last 20 ms of each ball against the closed form
of a rolling ball, no more. When it rests depends on the break and on all hits before, and so on the step. Balls 2 to 5
rest at $coarse s with h = 1e-3 s, at $fine s with h = 1e-4 s.

**Iterations.** The mean of 2 at position level with `newton` is the paper's number, but not for a reason that can be
named. Run as printed it is 1.005. The sixth iteration at the break is the gap tolerance of 1e-10 r. The second one in all
other steps is the shift of the multipliers (`proximal_shift`, see 5.2). The mean of 0.03 at velocity level is the default
law's, which starts from the impulses of the step before. The paper's 9 and 26 line searches in the third and fourth
iteration of the break do not occur under any of these options. Carom scales the multipliers row by row instead of by one
characteristic mass. The paper does not show whether that is the whole difference.
"""


def _texts(run: Trace, braked: Trace, step: int, other: Trace | None, timings: int) -> tuple[str, ...]:
    core_s = timed(scene(FREE), timings)
    penalty_s = timed(scene(FREE), timings, method="penalty") if other else math.nan
    table = (
        "| | penalty method | nonsmooth generalized-alpha |",
        "|---|---|---|",
        f"| paper | {demo.PENALTY_COMPUTING_S:g} s | {demo.PAPER_COMPUTING_S:g} s |",
        f"| Carom, this machine, core only | {f'{penalty_s:.3g} s' if other else 'not run'} | {core_s:.3g} s |",
    )
    told = (
        _told(run, step, other, penalty_s / core_s)
        if other
        else "It is left out: this core has no such method."
    )
    fine = trace(scene(BRAKED), step=H / 10)
    coarse_s, fine_s = (", ".join(f"{t:.3f}" for t in rows.rest_times(r)) for r in (braked, fine))
    return study.paragraphs(TEXT, times="\n".join(table), penalty=told, coarse=coarse_s, fine=fine_s)


def _told(run: Trace, step: int, other: Trace, ratio: float) -> str:
    # The hit takes 0.3 ms and the balls touch at 0.11424 s: two steps later it is over.
    later = step + 2
    told = [
        f"{name} has {', '.join(f'{r.velocity[later, ball, 0]:+.3f}' for ball in (0, 1))} m/s"
        for name, r in (("the sequence", run), ("the penalty method", other))
    ]
    deepest = 100 * float(other.monitors["penetration_max_relative"])
    printed = demo.PENALTY_COMPUTING_S / demo.PAPER_COMPUTING_S
    return (
        f"In v_x of balls 2 and 3 at {run.time[later]:.3f} s, {told[0]} and {told[1]}. Carom's own penalty method takes"
        " Hertz contacts with the damping that gives a single hit the restitution of the scenario. The paper does not"
        f" give its parameters. Its balls overlap by up to {deepest:.1f} % of a radius. It needs {ratio:.0f} times the"
        f" computing time, not the paper's {printed:.0f}: its substeps are shortest only while balls hit each other."
    )
