"""Section 5.4: three balls in a line, without friction and with it. Figures 16 to 19."""

from __future__ import annotations

import numpy as np

from carom.many.order import Order
from carom.measure.events import hits, meeting
from carom.reproduce import study
from carom.reproduce.document import Context, Example, Row
from carom.reproduce.examples import s54_impact
from carom.reproduce.examples import s54_study as order
from carom.reproduce.examples.s54_figures import BALLS, energies, motion
from carom.reproduce.examples.s54_study import AFTER, LATE, SCENARIO, hit_of, scene
from carom.reproduce.memory import Trace, trace
from carom.reproduce.study import row

ID = "5.4"
CASES = ("frictionless", "frictional")
H = 1e-3  # s, the paper's

# What section 5.4 prints: times of events (text and figs. 16, 17), iterations and line searches.
PAPER_CONTACT = {"frictionless": 0.277, "frictional": 0.328}  # s
PAPER_ROLLS = 0.284  # s
PAPER_SPEED = 2.0  # m/s, of ball 3 after the frictionless impact: that of ball 1 before it
PAPER_COUNTS: dict[str, study.Printed] = {
    "frictionless": {"smooth": (1, 1), "position": (3, 1), "velocity": (1, 1)},
    "frictional": {"smooth": (1, 1), "position": (4, 1), "velocity": (2, 1), "line_search": (0, 0)},
}

ROLLING = 1e-9  # m/s: a ball with less slip rolls

PARTS = {"points": order.points, "round": order.round_points, "reference": order.reference}


def reproduce(context: Context) -> Example:
    """The example with all its rows, figures and counts."""
    default = study.default_tolerance(context)
    both = study.distinct(default)
    runs = {(case, tol): trace(scene(case), tolerance=tol) for case in CASES for tol in both}
    free, rough = runs["frictionless", default], runs["frictional", default]
    found = context.part("points", order.points)
    coarse = context.part("round", order.round_points)
    fine = context.part("reference", order.reference)
    orders, errors = order.orders_of(found, fine)
    rows = [
        *_frictionless(free),
        *_frictional(rough),
        *s54_impact.rows(),
        *_end(rough),
        *_orders(orders),
        *(study.unconverged(tol, [runs[case, tol] for case in CASES]) for tol in both),
        study.energy_rise("greatest rise of energy in a step", [free, rough]),
        study.penetration(runs.values()),
    ]
    return Example(
        id=ID,
        title="Multiple impacts of three balls",
        rows=tuple(rows),
        figures=(*motion(free, rough), *energies(rough), order.figure(found, coarse, errors)),
        counts=study.iterations({case: scene(case) for case in CASES}, both, PAPER_COUNTS, CASES),
        texts=_texts(rough),
        options={
            "figures": {"step": H, "tolerance": default, "impact": "sequence", "spectral_radius": 0.8},
            "convergence": {
                "steps": [p.h for p in found],
                "reference": fine.h,
                "round steps": list(order.ROUND),
            },
        },
        scenarios=(SCENARIO,),
    )


def _frictionless(run: Trace) -> list[Row]:
    way = hit_of(scene("frictionless").to_model())[0]
    contact = meeting(run, *BALLS[:2])
    after = run.velocity[contact.step, :, 0]
    why = "rounding: the balls meet centrally, at any h"
    name = "frictionless: balls 1 and 2 meet"
    return [
        _event(name, PAPER_CONTACT["frictionless"], way.contact_time, contact.time),
        row(f"{name}, closed form", "s", contact.time, 1e-12, "rounding", exact=way.contact_time),
        *(
            row(
                f"frictionless: v_x of ball {i + 1} after the impact",
                "m/s",
                after[i],
                1e-12,
                why,
                exact=v,
                paper=told,
            )
            for i, v, told in ((0, 0.0, "at rest"), (1, 0.0, "at rest"), (2, way.speed, PAPER_SPEED))
        ),
    ]


def _frictional(run: Trace) -> list[Row]:
    way, hit = hit_of(scene("frictional").to_model())
    slip = np.abs(run.velocity[:, 0, 0] - way.radius * run.angular_velocity[:, 0, 1])
    rolls = int(np.flatnonzero(slip < ROLLING)[0])
    contact = meeting(run, *BALLS[:2])
    speed, why = run.velocity[rolls, 0, 0], "rounding: friction is constant"
    within, late = way.slowing * run.h**2 / hit.speed, "second order, mu g h^2/v: sliding ends inside a step"
    return [
        _event("ball 1 begins to roll", PAPER_ROLLS, way.rolling_time, float(run.time[rolls])),
        row("its speed then", "m/s", speed, 1e-12, why, exact=way.velocity(way.rolling_time)),
        _event(
            "balls 1 and 2 meet",
            PAPER_CONTACT["frictional"],
            way.contact_time,
            contact.time,
            f"the paper gives the end of the step before; here the impact is that of step {contact.step}",
        ),
        row("balls 1 and 2 meet, closed form", "s", contact.time, within, late, exact=way.contact_time),
    ]


def _end(run: Trace) -> list[Row]:
    """The last state: balls 1 and 2 roll together, ball 3 alone."""
    way, _ = hit_of(scene("frictional").to_model())
    v, spin = run.velocity[-1, :, 0], run.angular_velocity[-1, :, 1]
    slip = float(np.max(np.abs(v - way.radius * spin)))
    name, note = "speed of ball 2 over that of ball 1 at the end", f"both at {v[0]:.4f} m/s"
    rolling = "greatest slip on the bed at the end"
    return [
        row(name, "m/s", v[1] - v[0], ROLLING, "solver", exact=0.0, paper="together", note=note),
        row(rolling, "m/s", slip, ROLLING, "solver", exact=0.0, paper="rolling"),
    ]


def _event(name: str, printed: float, exact: float, carom: float, note: str = "") -> Row:
    why = "the paper gives times on its grid: h"
    return row(name, "s", carom, H, why, exact=exact, paper=printed, against="paper", note=note)


def _orders(orders: dict[str, Order]) -> list[Row]:
    just_after, whole = (f"v, {AFTER} s", f"w, {AFTER} s"), (f"x, 0 to {LATE} s", f"v, {LATE} s")
    return [
        *(study.first_order(name, orders[name]) for name in just_after),
        # Compared with a fine run, not with an exact one, and after a dozen hits more.
        *(study.first_order(name, orders[name], 0.1) for name in whole),
    ]


TEXT = """
Figure 15 gives 0.5534 m without saying from where to where. It is the free gap of balls 1 and 2: only then is the
frictionless contact at 0.277 s. The inertia of 5.7e-5 kg m^2 is 0.385 m r^2. With 0.4 m r^2 ball 1 would roll from
0.2916 s on, not from the 0.284 s of the paper.

**The impact in closed form.** Ball 1 rolls, so its front moves down: friction lifts it and presses ball 2 on the bed.
The bed brakes ball 2, so a little less than the whole speed goes on. Ball 1 comes out with v_x = -s v/(2 - s),
s = mu mu_b. Ball 2, spun backwards, lifts ball 3. All of this follows from three impact problems one after the other:
{1-2, bed}, {2-3}, {2-bed}. The rows give it at the paper's h and for h -> 0.

**Re-impacts.** Ball 2 slides back into ball 1, which is in the air. Then ball 1 lands, slides forward and strikes
ball 2 with decreasing strength. Hits at $times s. The intervals shrink below any step and merge into one contact, ball
1 sliding, until both roll.

**Order.** Just after the impact the state has a closed form, and the order is read from it. Times of later hits move
by O(h), and a velocity near a hit may be that before or after it. Over the whole run only displacements and the last
state have a clean order; the sum over all velocities is drawn too. All steps of the study put the impact in the middle
of its step; round steps stand beside them.

**The law as printed** (`impact = "sequence-paper"`) gives the same impact to O(h). At the end its balls 1 and 2 still
strike each other in every step, at $v1 and $v2 m/s. The default law lets them roll on with one velocity.

**Iterations.** As in 5.2: run as printed the means are the paper's 1. The largest numbers are its 4 and 2 (without friction
1 at position level, where the paper has 3). Of the differences in the other rows, the fifth iteration at the impact is the
gap tolerance of 1e-10 r. The mean of 2 at position level and the third iteration at velocity level are the shift of the
multipliers (`proximal_shift`). The mean below 1 at velocity level is the default law's, which starts from the impulses of
the step before. `auto` solves a contact that is alone in closed form and counts one iteration.
"""


def _texts(run: Trace) -> tuple[str, ...]:
    times = ", ".join(f"{float(n) * run.h:.3f}" for n in hits(run, *BALLS[:2])["step"])
    v1, v2 = trace(scene("frictional"), impact="sequence-paper").velocity[-1, :2, 0]
    return study.paragraphs(TEXT, times=times, v1=f"{v1:.5f}", v2=f"{v2:.5f}")
