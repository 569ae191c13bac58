"""Extended XYZ: text of all frames, with a line that names the columns; OVITO and ASE read it.

Columns whose names OVITO knows become its own properties: type (the material), id, pos, velo, radius, mass. The column
`species` of ASE takes chemical elements only, so there is none; ASE has balls of the element X and the rest as arrays.
Orientations are quaternions with the scalar part last, as OVITO has them. Numbers are the shortest text that reads
back as the same bits. Contacts are points of a file of their own, with their forces as vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np

from carom.arrays import F64, Array
from carom.export.atomic import whole_file, without
from carom.export.frames import Frame, Selection
from carom.export.glyphs import contact_glyphs
from carom.show.surfaces import box

PROPERTIES = "type:S:1:pos:R:3:id:I:1:radius:R:1:mass:R:1:velo:R:3:angular_velocity:R:3:orientation:R:4"


#: Columns of contacts beside type, place and radius: the quantities of `GLYPHS` that have these names. OVITO draws `force`.
CARRIED = {
    "force": 3,
    "normal_force": 1,
    "friction_force": 1,
    "normal": 3,
    "branch": 3,
    "impulse": 3,
    "moment": 3,
    "gap": 1,
    "closed": 1,
    "body_a": 1,
    "body_b": 1,
}
#: Types of contacts, by their status.
STATES = ("open", "stick", "slip")
#: Radius of the point of a contact over that of ball A: small enough to lie within the balls, and larger than nothing.
POINT = 0.1


def write(selection: Selection, directory: Path) -> list[Path]:
    """`balls.extxyz`, and `contacts.extxyz` if the run has some."""
    files = [directory / "balls.extxyz"]
    cell = _cells(selection)
    with whole_file(files[0]) as temporary, open(temporary, "w", encoding="utf-8") as file:
        for frame in selection:
            file.write(_head(len(frame.body), cell(frame.index), PROPERTIES, frame.time, frame.step))
            file.writelines(_lines(frame))
    if selection.with_contacts:
        files.append(directory / "contacts.extxyz")
        kinds = dict.fromkeys(("closed", "body_a", "body_b"), "I")
        columns = ":".join(f"{name}:{kinds.get(name, 'R')}:{width}" for name, width in CARRIED.items())
        radius, step = np.asarray(selection.result.bodies["radius"]), np.asarray(selection.result.step)
        with whole_file(files[1]) as temporary, open(temporary, "w", encoding="utf-8") as file:
            for part in contact_glyphs(selection):
                for index, time, (points, data) in zip(part.frames, part.time.tolist(), part, strict=True):
                    properties = f"type:S:1:pos:R:3:radius:R:1:{columns}"
                    file.write(_head(len(points), cell(index), properties, time, int(step[index])))
                    file.writelines(_contact_lines(points, POINT * radius[data["body_a"]], data))
    without(directory, {"contacts.extxyz"} - {path.name for path in files})
    return files


def _head(count: int, cell: str, properties: str, time: float, step: int) -> str:
    """The two lines that stand before those of a frame."""
    return f"{count}\n{cell}Properties={properties} Time={time!r} Step={step}\n"


def _contact_lines(points: F64, radius: F64, data: Mapping[str, Array]) -> Iterator[str]:
    columns = [points, radius, *(data[name] for name in CARRIED)]
    parts = [values[:, None].tolist() if values.ndim == 1 else values.tolist() for values in columns]
    for state, *rows in zip(data["status"].tolist(), *parts, strict=True):
        yield f"{STATES[state]} {' '.join(repr(value) for row in rows for value in row)}\n"


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
        lines.append(f"M{material} {centre[0]!r} {centre[1]!r} {centre[2]!r} {body} {values}\n")
    return lines


def _cells(selection: Selection) -> Callable[[int], str]:
    """The periodic box at a frame as text; without one nothing, and readers put a box around the balls themselves."""
    boxes = selection.result.boxes
    if boxes is None:
        return lambda frame: ""
    low, high = box(selection)
    repeats = boxes.first.lengths > 0
    flags = " ".join("T" if axis else "F" for axis in repeats)

    def cell(frame: int) -> str:
        at = boxes[frame].tilted
        corner, edges = np.where(repeats, at.origin, low), np.where(repeats, at.lengths, high - low)
        lattice = np.where(repeats[:, None], at.vectors, np.diag(edges))
        corner[at.flow] -= 0.5 * at.offset  # the box stays about its centre
        values, origin = (" ".join(map(repr, part.tolist())) for part in (lattice.ravel(), corner))
        return f'Lattice="{values}" Origin="{origin}" pbc="{flags}" '

    return cell
