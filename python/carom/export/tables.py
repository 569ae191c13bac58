"""The tables of a run, flat and in pieces, for text and for data frames: names, units, columns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import Array
from carom.export.frames import Selection
from carom.export.glyphs import GLYPHS, contact_glyphs
from carom.result.kinematics import QUANTITIES
from carom.result.record.layout import MEANINGS

Columns = Mapping[str, Array]

#: Rows of a table of events and steps that are read at a time.
ROWS = 100_000
#: Components of the vectors of the tables of a run, by their number.
LETTERS = {3: "xyz", 4: "wxyz"}


@dataclass(frozen=True)
class Sheet:
    """A table: its name, the units of its columns, and its rows in pieces. The columns are those of `units`. One that is
    `empty` is not written.
    """

    name: str
    units: Mapping[str, str]
    pieces: Callable[[], Iterator[Columns]]
    empty: bool = False


def sheets(selection: Selection) -> Iterator[Sheet]:
    """All tables of a run."""
    yield _bodies(selection)
    yield _frames(selection)
    yield _contacts(selection)
    result = selection.result
    for name in ("impacts", "impulses", "events", "transitions", "steps"):
        yield _rows(selection, name, getattr(result, name))


def written(
    selection: Selection,
    directory: Path,
    suffix: str,
    write: Callable[[Sheet, Path], None],
    is_same: Callable[[Sheet, Path], bool],
) -> list[Path]:
    """A file for every table that has rows, that of the frames first. Where one has none a file of an earlier export goes,
    if it `is_same` by its columns and so no file of the user's own.
    """
    files = []
    for sheet in sheets(selection):
        path = directory / f"{sheet.name}.{suffix}"
        if not sheet.empty:
            write(sheet, path)
            files.append(path)
        elif is_same(sheet, path):
            path.unlink()
    return sorted(files, key=lambda path: path.stem != "frames")


def _bodies(selection: Selection) -> Sheet:
    bodies = selection.result.bodies
    units = {
        "body": "1",
        "name": "1",
        **{k: MEANINGS[f"bodies/{k}"].unit for k in ("radius", "mass", "inertia", "material")},
    }

    def pieces() -> Iterator[Columns]:
        yield {"body": np.arange(len(bodies)), **{name: bodies[name] for name in units if name != "body"}}

    return Sheet("bodies", units, pieces)


def _frames(selection: Selection) -> Sheet:
    """One row per frame and ball that is there."""
    units = {"frame": "1", "step": "1", "time": "s", "body": "1", "name": "1"}
    for quantity, (letters, unit) in QUANTITIES.items():
        units |= {f"{quantity}_{letter}": unit for letter in letters}
    names = np.array(selection.result.names, dtype=object)

    def pieces() -> Iterator[Columns]:
        for block in selection.blocks():
            stack = block.stack()
            piece: dict[str, Array] = {
                "frame": np.repeat(stack.frames, stack.count),
                "step": np.repeat(stack.step, stack.count),
                "time": np.repeat(stack.time, stack.count),
                "body": stack.body,
                "name": names[stack.body],
            }
            for quantity, (letters, _) in QUANTITIES.items():
                values = stack.quantities[quantity]
                piece |= {f"{quantity}_{letter}": values[:, i] for i, letter in enumerate(letters)}
            yield piece

    return Sheet("frames", units, pieces)


def _contacts(selection: Selection) -> Sheet:
    """One row per frame and contact: its place and the glyph quantities. Of balls that have left the place is missing, and
    the row is there: sums of impulses are those of the run.
    """
    units = {"frame": "1", "time": "s", "a": "1", "b": "1", **_flat_units({"point": "m", **GLYPHS})}
    names = np.array([*selection.result.names, *selection.result.wall_names], dtype=object)

    def pieces() -> Iterator[Columns]:
        for glyphs in contact_glyphs(selection, everything=True):
            piece = {
                "frame": np.repeat(glyphs.frames, glyphs.count),
                "time": np.repeat(glyphs.time, glyphs.count),
                "a": names[glyphs.data["body_a"]],
                "b": names[glyphs.data["body_b"]],
            }
            for name, values in {"point": glyphs.points, **glyphs.data}.items():
                piece |= _flat(name, values)
            yield piece

    return Sheet("contacts", units, pieces, empty=not selection.with_contacts)


def _flat_units(units: Mapping[str, str]) -> dict[str, str]:
    vectors = ("point", "normal", "branch", "impulse", "moment", "force")
    flat: dict[str, str] = {}
    for name, unit in units.items():
        flat |= {f"{name}_{c}": unit for c in "xyz"} if name in vectors else {name: unit}
    return flat


def _rows(selection: Selection, name: str, table: Any) -> Sheet:
    """A table of the run with its own columns; a pair of bodies has their names too."""
    # Of 100 000 rows each: the rows of a long run with many columns are more than the memory.
    chosen = np.flatnonzero(selection.rows_between(table))
    result = selection.result
    names = np.array([*result.names, *result.wall_names], dtype=object)
    own = [column for column in result._segments.columns(name) if column in table.columns]
    first = _piece({column: np.asarray(table[column][:1]) for column in own}, names)
    units = {}
    for column in first:
        stem = column if column in own else column.rpartition("_")[0]
        units[column] = table.unit(stem) if stem in own else "1"

    def pieces() -> Iterator[Columns]:
        for begin in range(0, len(chosen), ROWS):
            rows = chosen[begin : begin + ROWS]
            span = slice(int(rows[0]), int(rows[-1]) + 1)
            local = rows - rows[0]
            yield _piece({column: np.asarray(table[column][span])[local] for column in own}, names)

    return Sheet(name, units, pieces, empty=not len(table))


def _piece(columns: Columns, names: Array) -> dict[str, Array]:
    found: dict[str, Array] = {}
    for name, values in columns.items():
        if name == "body" and values.ndim == 2:
            body = values.astype(np.int64)
            found |= {
                "a": names[body[:, 0]],
                "b": names[body[:, 1]],
                "body_a": body[:, 0],
                "body_b": body[:, 1],
            }
        elif name == "body":
            found |= {"body": values, "name": names[values.astype(np.int64)]}
        else:
            found |= _flat(name, values)
    return found


def _flat(name: str, values: Array) -> dict[str, Array]:
    if values.ndim == 1:
        return {name: values}
    letters = LETTERS.get(values.shape[1], "".join(map(str, range(values.shape[1]))))
    return {f"{name}_{letter}": values[:, i] for i, letter in enumerate(letters)}
