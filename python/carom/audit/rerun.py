"""Whether a run can be repeated: its resolved scenario is run again, by several numbers of threads, and every number
compared.

Compared are the bits of all datasets of all tables, the order of events included; nothing in them depends on the
clock. A run that was resumed with other options, or that has Python load functions, cannot be repeated from its files.
"""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from carom.arrays import Array
from carom.errors import CaromError
from carom.result.record import Record
from carom.result.record.layout import SOMETIMES, STATIC, TABLES
from carom.run.result import Result, UnfinishedRun, load
from carom.run.simulate import RunFailed, simulate
from carom.scene.scene import Scene

#: Bytes that are compared at a time.
CHUNK = 32 * 1024 * 1024


@dataclass(frozen=True)
class Difference:
    """The first number of a dataset that differs."""

    dataset: str
    row: int
    frame: int
    step: int
    body: str
    """Name of the body, wall or pair; empty where the dataset has none."""
    was: str
    became: str

    def __str__(self) -> str:
        where = [f"row {self.row}"]
        where += [f"frame {self.frame}"] if self.frame >= 0 else []
        where += [f"step {self.step}"] if self.step >= 0 else []
        where += [self.body] if self.body else []
        return f"/{self.dataset} differs at {', '.join(where)}: {self.was} was {self.became} when run again"


@dataclass(frozen=True)
class Rerun:
    """One repetition: how many threads, how much was compared, and the first difference of each dataset that differs."""

    threads: int
    datasets: int
    numbers: int
    differences: tuple[Difference, ...]

    @property
    def ok(self) -> bool:
        """Whether every bit is the same."""
        return not self.differences

    @property
    def first(self) -> Difference | None:
        """The difference that comes first in the run."""
        return min(self.differences, key=lambda d: d.step if d.step >= 0 else 1 << 62, default=None)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for `--json`."""
        return {
            "threads": self.threads,
            "ok": self.ok,
            "datasets": self.datasets,
            "numbers": self.numbers,
            "differences": [vars(d) for d in self.differences],
        }


def rerun(run: Result | str | Path, threads: Sequence[int] = (1,)) -> list[Rerun]:
    """Run the scenario of a run again, once for each number of threads, and compare all data bit for bit."""
    path = Path(run if isinstance(run, (str, Path)) else run.path)
    path = path.parent if path.is_file() else path
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnfinishedRun)
        original = load(path)
    return [_once(original, count) for count in threads]


def _once(original: Result, threads: int) -> Rerun:
    scene = Scene.from_toml(original.path / "scenario.toml")
    if any(place.function is None for place in scene.load_functions):
        raise CaromError(
            f"{original.path}: a run with Python load functions cannot be repeated from its files"
        )
    if original._about.get("changes"):
        raise CaromError(
            f"{original.path}: options were changed when the run was resumed, so that it cannot be repeated in one go"
        )
    every = int(original._segments.attributes["every"])
    with tempfile.TemporaryDirectory(prefix="carom-rerun-") as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        out = Path(folder) / "run"
        options: dict[str, Any] = {"every": every, "threads": threads}
        last = int(original.steps["step"][-1]) if len(original.steps) else 0
        if original.status != "failed" and last:
            # What ended before its time ends so again: off the grid of frames with the state alone.
            options |= {"stop": lambda _: True, "callback_every": last}
            if original._about.get("bare_end"):
                options["until"] = (last + 1) * float(original._segments.attributes["step"])
        try:
            again = simulate(scene, out=out, **options)
        except RunFailed as failure:
            again = failure.result
        with again:
            return Rerun(threads, *_compare(original, again))


def _compare(original: Result, again: Result) -> tuple[int, int, tuple[Difference, ...]]:
    found: list[Difference] = []
    datasets = numbers = 0
    for table in STATIC:
        was, became = original._segments.static(table), again._segments.static(table)
        for name in sorted({*was, *became}):
            datasets += 1
            if name not in was or name not in became or not _same(was[name], became[name]):
                found.append(
                    Difference(f"{table}/{name}", 0, -1, -1, "", _show(was, name), _show(became, name))
                )
            numbers += int(np.size(was.get(name, ())))
    for table in (*TABLES, *SOMETIMES):
        mine, others = original._segments.columns(table), again._segments.columns(table)
        for name in dict.fromkeys([*mine, *others]):
            if (table, name) == ("residuals", "end") and not _rows(original._segments, table, name):
                continue
            datasets += 1
            if name not in mine or name not in others:
                there = "there" if name in mine else "not there"
                found.append(Difference(f"{table}/{name}", 0, -1, -1, "", there, "the other"))
                continue
            numbers += original._segments.column(table, name).size
            different = _first(original, again, table, name)
            if different is not None:
                found.append(different)
    return datasets, numbers, tuple(found)


def _rows(segments: Record, table: str, name: str) -> int:
    return len(segments.column(table, name))


def _first(original: Result, again: Result, table: str, name: str) -> Difference | None:
    was, became = (r._segments.column(table, name) for r in (original, again))
    rows = min(len(was), len(became))
    size = max(1, CHUNK // max(1, was.nbytes // max(1, len(was))))
    for start in range(0, rows, size):
        a, b = (np.asarray(c[start : min(rows, start + size)]) for c in (was, became))
        if _same(a, b):
            continue
        differing = a.shape != b.shape or a.dtype != b.dtype
        at = 0 if differing else int(np.flatnonzero(_bits(a) != _bits(b))[0])
        row = start + at // max(1, a[0].size)
        return _difference(original, table, name, row, at % max(1, a[0].size), a[row - start], b[row - start])
    killed = table == "frames" and original.status == "running"  # by then there is no last frame
    if len(was) != len(became) and not killed:
        return Difference(f"{table}/{name}", rows, -1, -1, "", f"{len(was)} rows", f"{len(became)} rows")
    return None


def _bits(values: Array) -> Array:
    """Numbers as integers of their size, flat: no number equals none, and -0 is not 0."""
    flat = np.ascontiguousarray(values).ravel()
    return flat.view(f"u{flat.dtype.itemsize}") if flat.dtype.kind == "f" else flat


def _same(a: Array, b: Array) -> bool:
    if a.shape != b.shape or a.dtype != b.dtype:
        return False
    return bool(np.array_equal(_bits(a), _bits(b)))


def _show(table: dict[str, Array], name: str) -> str:
    return "absent" if name not in table else " ".join(str(table[name]).split())[:60]


def _difference(original: Result, table: str, name: str, row: int, inner: int, a: Any, b: Any) -> Difference:
    frame = step = -1
    body = ""
    names = [*original.names, *original.wall_names]
    if table == "frames":
        frame, step = row, int(original.step[row])
        if np.ndim(a) and name not in ("joint_impulse", "walls"):
            body = names[inner // max(1, int(np.prod(np.shape(a)[1:])))]
    elif table == "contacts":
        ends = np.asarray(original._segments.column("frames", "contact_end")).astype(np.int64)
        frame = int(np.searchsorted(ends, row, side="right"))
        step = int(original.step[frame]) if frame < len(ends) else -1
    elif f"{table}/{name}" != "residuals/value":
        step = int(original._segments.column(table, "step")[row])
    if table in ("contacts", "impacts", "impulses"):
        body = " and ".join(names[int(i)] for i in original._segments.column(table, "body")[row])
    at = np.ravel(a)[inner], np.ravel(b)[inner] if np.size(b) > inner else b
    return Difference(
        f"{table}/{name}", row, frame, step, body, repr(at[0].item()), repr(np.asarray(at[1]).item())
    )
