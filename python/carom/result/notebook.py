"""What notebooks show of a result."""

from __future__ import annotations

import numpy as np

from carom.errors import counted
from carom.result.data import RunData
from carom.result.remarks import remarks
from carom.text import LISTED, page, vector


def of_result(result: RunData) -> str:
    """Outcome, frames, energies, and the balls with their last state."""
    frames = len(result.time)
    facts = [*(("warning", told) for told in remarks(result)), ("outcome", str(result.outcome))]
    if frames:
        span = f"t = {result.time[0]:g} to {result.time[-1]:g} s"
        facts.append(("frames", f"{frames}, {span}; {counted(len(result.steps), 'step')}"))
    if len(result.steps):
        total = result.energy.total
        facts.append(("energy", f"{total[0]:.6g} J after the first step, {total[-1]:.6g} J at the end"))
    facts += [
        ("tables", f"impacts {len(result.impacts)} rows, contacts {len(result.contacts)} rows"),
        *([("clumps", ", ".join(list(result.clumps)[:LISTED]))] if result.clumps else []),
        ("walls", ", ".join(result.wall_names[:LISTED]) or "none"),
        ("directory", result.origin),
    ]
    head = ["ball", "radius (m)", "mass (kg)"]
    rows = [
        [name, f"{result.bodies['radius'][i]:g}", f"{result.bodies['mass'][i]:g}"]
        for i, name in enumerate(result.names[:LISTED])
    ]
    if frames:
        head += ["last position (m)", "last speed (m/s)"]
        x, v = np.asarray(result.position[-1]), np.asarray(result.velocity[-1])
        there = np.asarray(result.present[-1])
        rows = [
            [*row, vector(x[i]), f"{np.linalg.norm(v[i]):.4g}"] if there[i] else [*row, "absent", "-"]
            for i, row in enumerate(rows)
        ]
    more = len(result.names) - LISTED
    if more > 0:
        rows.append([f"... and {more} more", *[""] * (len(head) - 1)])
    return page(result.label, facts, head, rows)
