"""What a reader of a finished run should know before its numbers: in Python, the summary, the page and the audit.

Each is a row of `REMARKS`: when it is said, what is wrong and what that means, and what to do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.errors import Problem, counted, quoted
from carom.result.losses import MOST_FRAMES, at_joints, on_walls, spread
from carom.scene.assembly.vectors import dot
from carom.scene.checks.decay import DECAYS, unbalanced
from carom.scene.checks.walls import COARSE
from carom.scene.tables.impact_laws import LAWS
from carom.scene.tables.options import MOST_OVERLAP
from carom.scene.tables.walls import PLANE

if TYPE_CHECKING:
    from carom.result.data import RunData
    from carom.scene.scene import Scene

#: Share of the steps with impacts: where more of them were cut, the rebounds of the run are those of another law.
MOST_CUT = 0.5
#: Factor on `max_problems` in the advice; a smaller one cures fewer runs, a larger one may cost more time than it saves.
MORE = 20
#: Rise of a step, over the largest kinetic energy, that is no rounding and no error of a usable step any more.
MOST_RISE = 1e-3
#: Rise of a step of 1 ms over the same energy that piles at rest keep to; it grows with the square of the step.
RISE_PILE = 2e-6
#: Overlap from which a ball may be on the other side of a wall: its centre is at the surface, less what a step adds.
THROUGH = 0.9
#: Product of two unit normals from which planes count as parallel.
PARALLEL = 1.0 - 1e-9
#: What keeps bodies apart, by method.
APART = {
    "nsga": "shorten step",
    "moreau": 'position_projection = true takes overlaps back after each step, method = "nsga" has none',
    "penalty": "raise the stiffness of the contacts (penalty_young_modulus or penalty_stiffness)",
    "events": "shorten pressing_step",
}
#: How the advice on a wall that jumps begins.
JUMPS = "the law jumps by"


def _cut(result: RunData) -> dict[str, Any] | None:
    if not result.summary.get("truncated_sequences", 1):
        return None
    steps = result.steps
    problems = np.asarray(steps["impact_problems"])
    hit, cut = int(np.count_nonzero(problems)), int(np.count_nonzero(np.asarray(steps["truncated"])))
    if cut <= MOST_CUT * hit:
        return None
    now = result.scene.run.max_problems
    cure = f"raise max_problems in [run] (now {now}), for example to {MORE * now}"
    if (
        not now
    ):  # by size: the longest that came to an end says little, but a multiple of it is longer than that
        longest = int(problems.max())
        cure = f"set max_problems in [run], for example to {MORE * longest} (the longest had {longest})"
    return {"cut": cut, "hit": hit, "cure": f"{cure}; steps that were cut may then take {MORE} times as long"}


def _rise(result: RunData) -> float:
    return (result.summary.get("energy") or {}).get("max_rise_relative") or 0.0


def _gained(result: RunData) -> dict[str, Any] | None:
    # Where nothing moves, the rounding of forces that cancel is large beside the energy.
    if _rise(result) <= MOST_RISE or not result.summary["energy"].get("rises", 1):
        return None
    run = result.scene.run
    if not LAWS[run.impact].energy or run.energy_safeguard is False:
        why = {"printed": ": by friction (Kane), oblique hits, and weight on ceilings"}
        cure = (
            f", of an impact law that can gain{why.get(LAWS[run.impact].restitution, ' by friction (Kane)')}"
        )
        cure += '; impact = "sequence" with energy_safeguard = true does not'
    elif jump := next((p for p in result.scene._advice() if JUMPS in p.cause), None):
        # A wall that jumps shifts balls and does no work on them.
        cure = f": {_called(jump)}: {jump.cause}; a shorter step does not cure that"
    elif stiff := next((p for p in result.scene._advice(unbalanced) if DECAYS in p.cause), None):
        cure = (
            f", since its sum of what drag takes is too coarse: {_called(stiff)}: {stiff.cause}; {stiff.cure}"
        )
    else:
        cure = ": shorten step" + (" or lower tolerance" if run.method != "penalty" else "")
    return {"percent": 100 * _rise(result), "cure": cure}


def _called(problem: Problem) -> str:
    """Of a scene from Python `where` names the table, of a file's it names the file."""
    return problem.key if problem.source else f"{problem.where} {problem.key}"


def _unsettled(result: RunData) -> dict[str, Any] | None:
    summary = result.summary
    usual = RISE_PILE * (float(summary.get("step") or 0.0) / 1e-3) ** 2
    if summary.get("method") != "nsga" or not usual < _rise(result) <= MOST_RISE:
        return None
    if not _is_pile(result):
        return None
    now = result.scene.run.pile_tolerance
    # Finer ones than these are not reached by piles (checks/piles.py).
    smaller = f", or a smaller pile_tolerance (now {now:g})," if now >= COARSE else ""
    return {"share": _rise(result), "usual": usual, "cure": f"a shorter step{smaller} lessens it"}


def _overlapped(result: RunData) -> dict[str, Any] | None:
    deepest = result.summary.get("penetration_max_relative") or 0.0
    if deepest <= MOST_OVERLAP:
        return None
    steps = result.steps
    when = float(steps["time"][int(np.argmax(np.asarray(steps["penetration_relative"])))])
    through = "; a ball whose centre is in a wall can pass through it" if deepest > THROUGH else ""
    return {"radii": deepest, "time": when, "through": through, "cure": apart(result.scene)}


def apart(scene: Scene) -> str:
    """What keeps the bodies of a scene from overlapping."""
    run = scene.run
    return "shorten step" if run.position_projection and run.method == "moreau" else APART[run.method]


def _missed(result: RunData, *, pile: bool) -> dict[str, Any] | None:
    count = result.summary.get("missed_impacts")
    if not count or pile != _is_pile(result):
        return None
    steps = int(np.count_nonzero(np.asarray(result.steps["missed_impacts"])))
    return {"impacts": counted(count, "impact"), "steps": counted(steps, "step")}


def _is_pile(result: RunData) -> bool:
    return bool(np.asarray(result.steps["contacts"]).max(initial=0) > result.scene.run.dense_contacts)


def _shut_out(result: RunData) -> dict[str, Any] | None:
    """Fewer than all is no trouble: an inflow without a rate goes on for as long as there is room."""
    if not result.flows or result.outcome.failed or not result.summary:  # the last: it is still running
        return None
    events = result.events
    entered = {ball for ball, kind in zip(events["ball"], events["kind"], strict=True) if kind}
    none = "; ".join(
        f"none of {counted(flow.size(), 'ball')} of inflow {quoted(flow.name)} entered"
        for flow in result.scene.inflows
        if flow.start <= result.summary["time"] and entered.isdisjoint(flow.ball_names())
    )
    return {"none": none} if none else None


def _passed(result: RunData) -> dict[str, Any] | None:
    """Walls do not meet: of parallel planes without end a free one may change to the other side of another."""
    planes = [w for w in result.scene._walls() if w.kind == PLANE and not (w.motion and w.motion.rotation)]
    frames = spread(len(result.time), MOST_FRAMES)
    for free in (plane for plane in planes if plane.free is not None):
        for other in planes:
            if other is free or abs(dot(other.shape[1], free.shape[1])) < PARALLEL:
                continue
            mine, its = (result.walls[plane.name].chosen(frames) for plane in (free, other))
            apart = (mine.position - its.position) @ np.array(free.shape[1])
            if (beyond := its.present & (apart * apart[0] < 0.0)).any():
                when = float(mine.time[beyond.argmax()])
                return {"free": quoted(free.name), "other": quoted(other.name), "time": when}
    return None


@dataclass(frozen=True)
class Remark:
    """`found` returns what the text names, or None where nothing is wrong; a `warning` is said after each run."""

    found: Callable[[RunData], Mapping[str, Any] | None]
    told: str
    cure: str
    warning: bool = True


REMARKS = {
    "cut_short": Remark(
        _cut,
        "impact sequences were cut short in {cut} of {hit} steps with impacts: what still closed there was one impact of"
        " all contacts, which spreads the energy that restitution leaves over more balls; ",
        "{cure}",
    ),
    "gained": Remark(_gained, "energy rose by up to {percent:.2g} % in a step", "{cure}"),
    "unsettled": Remark(
        _unsettled,
        "energy rose by up to {share:.2g} of what there is in a step, more than the {usual:.2g} of piles at rest; ",
        "{cure}",
        warning=False,  # grains that settle do so, too
    ),
    "overlapped": Remark(
        _overlapped,
        "bodies overlapped by up to {radii:.2g} radii (at t = {time:g} s), which rigid ones cannot{through}: ",
        "{cure}",
    ),
    "missed": Remark(
        partial(_missed, pile=False),
        "{impacts} missed in {steps}, in which bodies overlapped and separated: ",
        "shorten step",
    ),
    "missed_in_pile": Remark(
        partial(_missed, pile=True),
        "{impacts} missed in {steps}, in which bodies overlapped and separated: ",
        "some are normal in a pile",
        warning=False,
    ),
    "lost_on_curves": Remark(
        on_walls,
        "the step took about {percent:.2g} % of the largest kinetic energy on curved walls (estimate from the frames): ",
        "{key} = {step:g} takes less than 1 %",
    ),
    "lost_at_joints": Remark(
        at_joints,
        "the step took about {percent:.2g} % of the largest kinetic energy at joints (estimate from the frames): ",
        'method = "nsga" takes none there, {key} = {step:g} less than 1 %',
    ),
    "passed": Remark(
        _passed,
        "{free} was beyond {other} at t = {time:g} s: walls do not meet one another; ",
        "let balls or its force stop it",
    ),
    "shut_out": Remark(_shut_out, "{none}", ": no place in the region had room for one"),
}


def remarks(result: RunData, *names: str) -> list[str]:
    """The warnings that a run deserves, or those called `names`: what is wrong, what it means and what to do."""
    chosen = [REMARKS[name] for name in names] or [remark for remark in REMARKS.values() if remark.warning]
    return [(r.told + r.cure).format(**facts) for r in chosen if (facts := r.found(result)) is not None]
