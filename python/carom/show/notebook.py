"""What notebooks show of a scene, a result, a batch: small tables, with every text escaped."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import counted
from carom.result.remarks import remarks

if TYPE_CHECKING:
    from carom.many.batch import Batch
    from carom.result.result import Result
    from carom.scene.scene import Scene

#: Balls listed one by one.
LISTED = 20


def page(
    title: str, facts: Sequence[tuple[str, str]], head: Sequence[str], rows: Sequence[Sequence[str]]
) -> str:
    """A title, facts as a table of two columns, and a table below them."""
    told = "".join(
        f"<tr><th style='text-align:left'>{escape(a)}</th><td>{escape(b)}</td></tr>" for a, b in facts
    )
    text = f"<div class='carom'><strong>{escape(title)}</strong><table>{told}</table>"
    if rows:
        columns = "".join(f"<th>{escape(name)}</th>" for name in head)
        cells = "".join("<tr>" + "".join(f"<td>{escape(c)}</td>" for c in row) + "</tr>" for row in rows)
        text += f"<table><thead><tr>{columns}</tr></thead><tbody>{cells}</tbody></table>"
    return text + "</div>"


def of_result(result: Result) -> str:
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
            [*row, _vector(x[i]), f"{np.linalg.norm(v[i]):.4g}"] if there[i] else [*row, "absent", "-"]
            for i, row in enumerate(rows)
        ]
    more = len(result.names) - LISTED
    if more > 0:
        rows.append([f"... and {more} more", *[""] * (len(head) - 1)])
    return page(result.label, facts, head, rows)


def of_scene(scene: Scene) -> str:
    """What `repr` says, and the contact laws."""
    run, names = scene.run, scene.names
    facts = [
        (
            "balls",
            (f"{len(names)}: " if names else "none")
            + ", ".join(names[:LISTED])
            + (" ..." if len(names) > LISTED else ""),
        ),
        ("walls", ", ".join(scene.wall_names[:LISTED]) or "none"),
        ("gravity", f"{_vector(np.array(scene.gravity))} m/s^2"),
        (
            "run",
            f"method {run.method}, step {run.step:g} s, until {'not given' if run.until is None else f'{run.until:g} s'}",
        ),
    ]
    head = ["contact law", "friction", "restitution", "rolling radius (m)"]
    rows = [
        [" / ".join(law.between), _law(law.friction), f"{law.restitution:g}", f"{law.rolling_radius:g}"]
        for law in scene._tree.contact
    ]
    return page(scene.title or "carom.Scene", facts, head, rows)


def of_batch(batch: Batch) -> str:
    """How many cases ended how, and what was varied."""
    kinds, counts = np.unique(batch.outcome.astype(str), return_counts=True)
    facts = [
        ("cases", ", ".join(f"{k.replace('_', ' ')}: {n}" for k, n in zip(kinds, counts, strict=True))),
        ("balls", ", ".join(batch.names[:LISTED])),
        (
            "time",
            f"{batch.wall_s:.3g} s on {counted(batch.threads, 'thread')}, {batch.per_second:.3g} a second",
        ),
    ]
    rows = [
        [key, str(values.shape), f"{values.min():.4g} to {values.max():.4g}"]
        for key, values in batch.parameters.items()
    ]
    return page("carom.Batch", facts, ["parameter", "shape", "range"], rows)


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in values) + ")"


def _law(value: object) -> str:
    return f"{value:g}" if isinstance(value, float | int) else "law of the slip speed"
