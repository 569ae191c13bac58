"""What a finished run says of energy that came from nowhere."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from carom.result.result import Result
    from carom.scene.scene import Scene

MOST_RISE = 1e-3
"""Rise of a step, over the largest kinetic energy, that is no rounding and no error of a usable step any more."""

RISE_PILE = 2e-6
"""Rise of a step of 1 ms over the same energy that piles at rest keep to; it grows with the square of the step."""

JUMPS = "the law jumps by"
"""How the advice on such a wall begins."""


def gained(result: Result) -> str | None:
    """That a step of the run gained energy beyond the work done on it, with a cure; None if none did."""
    energy = result.summary.get("energy") or {}
    share = energy.get("max_rise_relative") or 0.0
    if share <= MOST_RISE:
        return None
    run = result.scene.run
    told = f"energy rose by up to {100 * share:.2g} % in a step"
    if run.impact == "sequence-paper" or run.energy_safeguard is False:
        return (
            told
            + ', of an impact law that can gain (Kane): impact = "sequence" with energy_safeguard = true cannot'
        )
    if jump := _jump(result.scene):
        return f"{told}: {jump}; a shorter step does not cure that"
    return told + ": shorten step" + (" or lower tolerance" if run.method != "penalty" else "")


def unsettled(result: Result) -> str | None:
    """That a pile gained more in a step than piles at rest do, as grains that settle may; None if none did, or `gained` says
    more.
    """
    summary = result.summary
    share = (summary.get("energy") or {}).get("max_rise_relative") or 0.0
    usual = RISE_PILE * (float(summary.get("step") or 0.0) / 1e-3) ** 2
    if summary.get("method") != "nsga" or not usual < share <= MOST_RISE:
        return None
    run = result.scene.run
    contacts = np.asarray(result.steps["contacts"])
    if contacts.max(initial=0) <= run.dense_contacts:
        return None
    return (
        f"energy rose by up to {share:.2g} of what there is in a step, more than the {usual:.2g} of piles at rest; a shorter"
        f" step, or a smaller pile_tolerance (now {run.pile_tolerance:g}), lessens it"
    )


def _jump(scene: Scene) -> str | None:
    """What the check says of walls that jump, which shifts balls and does no work on them."""
    found = (p for p in scene.validate() if JUMPS in p.cause)
    # Of a scene from Python `where` names the wall, of a file's it names the file.
    return next((f"{p.key if p.source else f'{p.where} {p.key}'}: {p.cause}" for p in found), None)
