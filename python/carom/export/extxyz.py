"""Extended XYZ: text of all frames, with a line that names the columns; OVITO and ASE read it.

Columns whose names OVITO knows become its own properties: type (the material), id, pos, velo, radius, mass. The column
`species` of ASE takes chemical elements only, so there is none; ASE has balls of the element X and the rest as arrays.
Orientations are quaternions with the scalar part last, as OVITO has them. Numbers are the shortest text that reads
back as the same bits.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carom.export.frames import Frame, Selection
from carom.export.whole import whole_file

PROPERTIES = "type:S:1:pos:R:3:id:I:1:radius:R:1:mass:R:1:velo:R:3:angular_velocity:R:3:orientation:R:4"


def write(selection: Selection, directory: Path) -> list[Path]:
    """`balls.extxyz`."""
    path = directory / "balls.extxyz"
    cell = _cell(selection)
    with whole_file(path) as temporary, open(temporary, "w", encoding="utf-8") as file:
        for frame in selection:
            file.write(
                f"{len(frame.body)}\n{cell}Properties={PROPERTIES} Time={frame.time!r} Step={frame.step}\n"
            )
            file.writelines(_lines(frame))
    return [path]


def _lines(frame: Frame) -> list[str]:
    found = frame.quantities
    numbers = np.column_stack(
        [
            found["radius"],
            found["mass"],
            found["velocity"],
            found["angular_velocity"],
            np.roll(found["orientation"], -1, axis=1),
        ]
    ).tolist()
    lines = []
    for material, centre, body, rest in zip(
        found["material"].tolist(), frame.position.tolist(), frame.body.tolist(), numbers, strict=True
    ):
        values = " ".join(map(repr, rest))
        lines.append(f"M{material} {centre[0]!r} {centre[1]!r} {centre[2]!r} {body + 1} {values}\n")
    return lines


def _cell(selection: Selection) -> str:
    """The periodic box; without one nothing, and readers put a box around the balls themselves."""
    periods = selection.result.periodic
    if periods is None:
        return ""
    low, high = box(selection)
    lattice = np.diag(np.where(periods > 0, periods, high - low)).ravel()
    flags = " ".join("T" if period > 0 else "F" for period in periods)
    corner = np.where(periods > 0, selection.result.periodic_origin, low)
    values, origin = (" ".join(map(repr, part.tolist())) for part in (lattice, corner))
    return f'Lattice="{values}" Origin="{origin}" pbc="{flags}" '


def box(selection: Selection) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Lowest and highest corner, (3,) each, m, of what the balls take up in all frames."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for frame in selection:
        if len(frame.body):
            radius = frame.quantities["radius"][:, None]
            low = np.minimum(low, (frame.position - radius).min(axis=0))
            high = np.maximum(high, (frame.position + radius).max(axis=0))
    if not np.isfinite(low).all():
        return np.zeros(3), np.ones(3)
    return low, high
