"""What happens to the balls of a page: impacts and their sequence, contact forces, energies.

Tables are handed to the page as columns of integers (`codec.py`): 32-bit floats by their bits, which loses nothing of
them and costs few bytes where neighbouring rows are alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from carom.arrays import F64, I64, Array
from carom.result.data import RunData
from carom.show.energies import energies
from carom.show.viewer import codec

MAX_IMPACTS = 100_000
MAX_CONTACTS = 600_000
MAX_ENERGIES = 4000
BYTES_PER_ROW = 24
"""Of an impact or a contact, in the page; measured on breaks and piles, which take 12 to 22."""
UNIT = 32767.0
"""What a component of a unit vector is multiplied by."""


@dataclass
class Happenings:
    """Columns for the page, raw 64-bit columns, facts that say how to read them, and what was left out, in words."""

    columns: dict[str, codec.Integers] = field(default_factory=dict)
    """(row, 1, component) each."""
    doubles: dict[str, F64] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def happenings(result: RunData, frames: I64, every: int, budget: float) -> Happenings:
    """What happened between the first and the last of the recorded `frames` shown, to one body in `every`.

    Impacts and contacts take at most a tenth and three tenths of `budget` bytes.
    """
    found = Happenings()
    bodies = int(result.position.shape[1])
    _impacts(result, bodies, every, int(min(MAX_IMPACTS, 0.1 * budget / BYTES_PER_ROW)), found)
    _contacts(result, frames, bodies, every, int(min(MAX_CONTACTS, 0.3 * budget / BYTES_PER_ROW)), found)
    _energies(result, found)
    if "impact_body" in found.columns or "contact_body" in found.columns:
        found.facts["wall_names"] = list(result.wall_names)
    return found


def _impacts(result: RunData, bodies: int, every: int, most: int, found: Happenings) -> None:
    """One row per contact and impact problem, in the order of time and of the sequence."""
    table = result.impacts
    if len(table["time"]) == 0:
        return
    pair, shown = _pairs(np.asarray(table["body"]), bodies, every)
    impulse = np.asarray(table["impulse"], dtype=np.float64)[shown]
    time = np.asarray(table["time"], dtype=np.float64)[shown]
    problem = np.asarray(table["problem"]).astype(np.int64)[shown]
    kept = np.arange(len(time))
    if len(time) > most:
        strongest = np.argsort(-np.linalg.norm(impulse, axis=1), kind="stable")[:most]
        kept = np.sort(strongest)
        found.notes.append(f"Impacts: the {most} strongest of {len(time)}.")
    kept = kept[np.lexsort((problem[kept], time[kept]))]
    rows = shown[kept]
    if len(rows) == 0:
        return
    speeds = np.stack(
        [np.asarray(table[name], dtype=np.float64)[rows] for name in ("approach", "separation")], 1
    )
    found.doubles["impact_time"] = time[kept]
    found.columns |= {
        "impact_body": _rows(pair[kept]),
        "impact_problem": _rows(problem[kept]),
        "impact_status": _rows(np.asarray(table["status"])[rows]),
        "impact_normal": _unit_rows(np.asarray(table["normal"])[rows]),
        "impact_impulse": _float_rows(impulse[kept]),
        "impact_speed": _float_rows(speeds),
    }


def _contacts(result: RunData, frames: I64, bodies: int, every: int, most: int, found: Happenings) -> None:
    """Contacts of the frames shown, or of one in several; the force is the mean since the frame recorded before."""
    table = result.contacts
    if len(table["status"]) == 0:
        return
    ends = np.asarray(table.ends).astype(np.int64)
    starts = np.concatenate([[0], ends[:-1]])
    counts = (ends - starts)[frames]
    stride = max(1, -(-int(counts.sum()) // max(most, 1)))
    chosen = frames[::stride]
    if int(counts.max()) > most:
        found.notes.append("Contact forces are left out: there are too many.")
        return
    if stride > 1:
        found.notes.append(f"Contact forces of one frame in {stride}.")
    parts = list(_frames_of(table, result, chosen, starts, ends, bodies, every))
    if not any(len(part["body"]) for part in parts):
        return
    gathered = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    found.facts["contact_every"] = stride
    found.columns |= {
        "contact_end": _rows(np.cumsum([len(part["body"]) for part in parts])),
        "contact_body": _rows(gathered["body"]),
        "contact_status": _rows(gathered["status"]),
        "contact_normal": _unit_rows(gathered["normal"]),
        "contact_force": _float_rows(gathered["force"]),
    }


def _frames_of(
    table: Any, result: RunData, chosen: I64, starts: I64, ends: I64, bodies: int, every: int
) -> Iterator[dict[str, Array]]:
    """Frame by frame pairs, status, normals and forces (N) of the contacts that carry something."""
    time = np.asarray(result.time, dtype=np.float64)
    body, status, normal, impulse = (table[name] for name in ("body", "status", "normal", "impulse"))
    for frame in chosen:
        rows = slice(int(starts[frame]), int(ends[frame]))
        span = time[frame] - time[frame - 1] if frame else np.inf
        pair, shown = _pairs(np.asarray(body[rows]), bodies, every)
        force = np.asarray(impulse[rows], dtype=np.float64)[shown] / span
        carries = force.any(axis=1)
        yield {
            "body": pair[carries],
            "status": np.asarray(status[rows])[shown][carries],
            "normal": np.asarray(normal[rows])[shown][carries],
            "force": force[carries],
        }


def _energies(result: RunData, found: Happenings) -> None:
    """Time, kinetic and potential energy at the start and after the steps, thinned for a plot; the last step is in."""
    every = energies(result)
    count = len(every[0])
    if count < 2:
        return
    stride = -(-count // MAX_ENERGIES)
    rows = np.unique(np.append(np.arange(0, count, stride), count - 1))
    series = [values[rows] for values in every]
    if all(np.isfinite(values).all() for values in series):
        found.doubles["energy"] = np.concatenate(series)


def _pairs(body: Array, bodies: int, every: int) -> tuple[I64, I64]:
    """Pairs as the page numbers them, (row, 2), and the rows they come from: those whose balls are shown.

    A ball's number is that among the shown; wall w is -1 - w.
    """
    pair = body.astype(np.int64).reshape(-1, 2)
    wall = pair >= bodies
    shown = np.flatnonzero((wall | (pair % every == 0)).all(axis=1))
    return np.where(wall, bodies - 1 - pair, pair // every)[shown], shown


def _rows(values: Array) -> codec.Integers:
    rows: codec.Integers = np.asarray(values).astype(np.int32).reshape(len(values), 1, -1)
    return rows


def _unit_rows(vectors: Array) -> codec.Integers:
    return _rows(np.rint(np.nan_to_num(np.asarray(vectors, dtype=np.float64)) * UNIT))


def _float_rows(values: F64) -> codec.Integers:
    """32-bit floats as the integers of the same bits."""
    return np.ascontiguousarray(values, dtype="<f4").view("<i4").reshape(len(values), 1, -1)
