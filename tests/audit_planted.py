"""Faults of every column that a run has: one value in each, changed by a given share, or by one where it counts.

    python tests/audit_planted.py              # all runs, columns and places: which faults the auditor misses
    python tests/audit_planted.py break        # of one run

Nobody chose these faults: a column that is added to the layout is tried as well. `audit_faults` has those that keep
other laws, and `test_audit_claims` those of `run.json`.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import audit_scenes as scenes
import carom
import h5py
import numpy as np
from audit_faults import planted
from carom import audit
from carom.result.record.layout import ATTRIBUTES, MEANINGS

#: Runs with all that the auditor knows: free balls, a pile problem by problem, joints, no step at all.
RUNS = {
    "break": (scenes.break_, 0.25, {"walls": True}),
    "pile": (scenes.pile, 0.25, {"impacts": "every", "walls": True}),
    "joined": (scenes.joined, 0.5, {"walls": True}),
    "events": (scenes.break_, 0.25, {"method": "events"}),
}
SHARE = 0.01
"""By how much a value is off, of itself."""
ANGLE = 1e-4
"""By how much an orientation is off, rad."""
PLACES = {"largest": 1.0, "median": 0.5}
"""The value of a column that is changed, by its rank among those that are not 0."""
SMALL = "median by the largest"
"""The median is off by the same share of the largest: what counts there, where the median itself is one of rounding."""
NAMED = {
    "steps/contacts": 1,
    "steps/impact_problems": 1,
    "impacts/separation": SHARE,
    "impacts/approach": SHARE,
    "contacts/work_normal": SHARE,
    "contacts/work_friction": SHARE,
    "contacts/position_impulse": SHARE,
    "frames/orientation": ANGLE,
}
"""Faults that an auditor once missed, each planted at some places: a count by one, numbers by a share of the largest."""


class Fault(NamedTuple):
    """A value of a column, or of an attribute where `row` is None; by a share of itself, or `by` so much."""

    column: str
    place: str
    row: tuple[int, ...] | None
    by: float = 0.0

    def __str__(self) -> str:
        return f"{self.column}, {self.place}, {self.row}"

    def __call__(self, file: h5py.File) -> None:
        if self.row is None:
            value = np.array(file.attrs[self.column])
            file.attrs[self.column] = value + 1 if value.dtype.kind in "iu" else value * (1.0 + SHARE)
            return
        column = file[self.column]
        values = column[...]
        if self.column == "frames/orientation":
            values[self.row[:-1]] = turned(values[self.row[:-1]])
        elif values.dtype.kind == "b":
            values[self.row] = not values[self.row]
        elif values.dtype.kind in "iu":
            values[self.row] += 1
        elif self.by:
            values[self.row] += self.by
        else:
            values[self.row] *= 1.0 + SHARE
        column[...] = values


def turned(q: np.ndarray) -> np.ndarray:
    """A quaternion after a turn about z."""
    c, s = np.cos(0.5 * ANGLE), np.sin(0.5 * ANGLE)
    w, x, y, z = q
    return np.array([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w])


def faults(run: Path) -> Iterator[Fault]:
    """All faults of a run."""
    with h5py.File(run / "results.h5") as file:
        for name in (name for name in ATTRIBUTES if name in file.attrs):
            if np.any(file.attrs[name]):
                yield Fault(name, "attribute", None)
        for column in (name for name in MEANINGS if name in file):
            values = file[column][...]
            if values.dtype.kind not in "biuf" or not values.size:
                continue
            size = np.abs(values.astype(float))
            order = np.argsort(np.where(np.isfinite(size), size, 0.0), axis=None, kind="stable")
            order = order[size.ravel()[order] > 0.0] if values.dtype.kind == "f" else order
            seen: set[int] = set()
            for place, rank in PLACES.items():
                at = int(order[int(rank * (len(order) - 1))]) if len(order) else -1
                if at >= 0 and at not in seen:
                    seen.add(at)
                    row = tuple(int(i) for i in np.unravel_index(at, values.shape))
                    yield Fault(column, place, row)
                    if place == "median" and values.dtype.kind == "f" and column != "frames/orientation":
                        yield Fault(column, SMALL, row, SHARE * float(size.ravel()[order[-1]]))


def named(run: Path, places: int) -> Iterator[Fault | Callable[[h5py.File], None]]:
    """Those of `NAMED`, each at so many places of its column, the attribute `step`, and frames that are gone."""
    yield Fault("step", "attribute", None)
    yield _slower
    with h5py.File(run / "results.h5") as file:
        yield from (Gone(1 + k * (len(file["frames/step"]) - 3) // places) for k in range(places))
        for column, by in NAMED.items():
            values = file[column][...]
            size = np.nan_to_num(np.abs(values.astype(float))).ravel()
            told = np.flatnonzero(size > 0.0) if column != "frames/orientation" else np.arange(values.size)
            ranks = np.linspace(0, len(told) - 1, places if len(told) else 0)
            for at in dict.fromkeys(told[ranks.astype(int)].tolist()):
                row = tuple(int(i) for i in np.unravel_index(at, values.shape))
                yield Fault(column, f"row {row[0]}", row, SHARE * float(size.max()) if by == SHARE else 0.0)


def _slower(file: h5py.File) -> None:
    """The step is a thousandth longer."""
    file.attrs["step"] *= 1.001


class Gone(NamedTuple):
    """A frame is not there, nor counted."""

    frame: int

    def __call__(self, file: h5py.File) -> None:
        for column in file["frames"].values():
            values = np.delete(column[...], self.frame, axis=0)
            column.resize(len(values), axis=0)
            column[...] = values
        counts = file["commit"][-1]
        counts[0] -= 1
        file["commit"][-1] = counts


def made(name: str, out: Path) -> Path:
    """A run of `RUNS`."""
    scene, until, options = RUNS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        return scenes.run(scene(), out, until, **options)


def missed(run: Path, scratch: Path, which: list[Any]) -> list[Any]:
    """Those of the faults that no law finds."""
    left = []
    for k, fault in enumerate(which):
        copy = planted(run, scratch / str(k), fault)
        if audit.check(copy).ok:
            left.append(fault)
    return left


def main() -> None:
    """Plants all faults of the runs that are named, or of all, and tells which were missed."""
    tried = found = 0
    for name in sys.argv[1:] or RUNS:
        with tempfile.TemporaryDirectory() as scratch:
            run = made(name, Path(scratch) / name)
            for kind, which in (("columns", list(faults(run))), ("named", list(named(run, 6)))):
                left = missed(run, Path(scratch) / kind, which)
                tried, found = tried + len(which), found + len(which) - len(left)
                print(f"{name}, {kind}: {len(which) - len(left)} of {len(which)} found", flush=True)
                print("".join(f"    missed: {fault}\n" for fault in left), end="", flush=True)
    print(f"{found} of {tried} planted faults found")


if __name__ == "__main__":
    main()
