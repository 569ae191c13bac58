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
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import audit_scenes as scenes
import carom
import h5py
import numpy as np
from audit_faults import planted
from carom import audit
from carom.result.record.layout import ATTRIBUTES, MEANINGS

#: Runs with all that the auditor knows: free balls, a pile problem by problem, joints.
RUNS = {
    "break": (scenes.break_, 0.25, {"walls": True}),
    "pile": (scenes.pile, 0.25, {"impacts": "every", "walls": True}),
    "joined": (scenes.joined, 0.5, {"walls": True}),
}
SHARE = 0.01
"""By how much a value is off, of itself."""
ANGLE = 1e-4
"""By how much an orientation is off, rad."""
PLACES = {"largest": 1.0, "median": 0.5}
"""The value of a column that is changed, by its rank among those that are not 0."""


class Fault(NamedTuple):
    """A value of a column, or of an attribute where `row` is None."""

    column: str
    place: str
    row: tuple[int, ...] | None

    def __str__(self) -> str:
        return f"{self.column}, {self.place}"

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
                    yield Fault(column, place, tuple(int(i) for i in np.unravel_index(at, values.shape)))


def made(name: str, out: Path) -> Path:
    """A run of `RUNS`."""
    scene, until, options = RUNS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", carom.CaromWarning)
        return scenes.run(scene(), out, until, **options)


def missed(run: Path, scratch: Path, which: list[Fault]) -> list[Fault]:
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
            which = list(faults(run))
            left = missed(run, Path(scratch), which)
            tried, found = tried + len(which), found + len(which) - len(left)
            print(f"{name}: {len(which) - len(left)} of {len(which)} found", flush=True)
            print("".join(f"    missed: {fault} {fault.row}\n" for fault in left), end="", flush=True)
    print(f"{found} of {tried} planted faults found")


if __name__ == "__main__":
    main()
