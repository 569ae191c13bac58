"""What is read off a run, and off the published curves: counts of grains in time, the rate, peaks and troughs."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from carom import Result
from numpy.typing import NDArray
from scenes import SETTLING, Drum, Silo

F64 = NDArray[np.float64]
PUBLISHED = Path(__file__).parent / "published"
#: The rate is that from this time on, s, until fewer grains than this share of all are above the orifice.
FIRST, LAST = 0.15, 0.25
#: A turn of a curve counts where the curve goes back by this share of its range at least.
PROMINENCE = 0.15
ZONES = ("zone1_M1", "zone1_M2", "zone2_M1", "zone2_M2")


@dataclass(frozen=True)
class Curves:
    """Counts in time."""

    time: F64
    """s, since the orifice opened or the drum began to turn."""
    counts: Mapping[str, F64]

    def to_csv(self, path: Path) -> None:
        """Write one row for each time."""
        with path.open("w", newline="", encoding="utf-8") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(["time_s", *self.counts])
            for k, t in enumerate(self.time):
                rows.writerow([f"{t:.4f}", *(f"{values[k]:.0f}" for values in self.counts.values())])

    @classmethod
    def of_csv(cls, path: Path) -> Curves:
        """The curves that `to_csv` wrote, or published ones."""
        with path.open(encoding="utf-8") as file:
            head, *rows = csv.reader(file)
        values = np.array(rows, dtype=float).T
        return cls(values[0], dict(zip(head[1:], values[1:], strict=True)))


def published(case: str) -> dict[str, Curves]:
    """By program."""
    name = case.replace("-", "_")
    programs = {"LIGGGHTS": "liggghts", "MUSEN": "musen"}
    paths = {program: PUBLISHED / f"{name}_{file}.csv" for program, file in programs.items()}
    return {program: Curves.of_csv(path) for program, path in paths.items() if path.is_file()}


def silo(case: Silo, result: Result) -> Curves:
    """Grains above the orifice in every frame since it opened."""
    time, above = [], []
    for k in range(len(result.time)):
        since = float(result.time[k]) - SETTLING
        if since > -1e-9:
            time.append(since)
            # A grain that has left has no place, and is above nothing.
            above.append(np.count_nonzero(result.position[k, :, 2] > case.lip))
    return Curves(np.array(time), {"grains_above_orifice": np.array(above, dtype=float)})


def drum(case: Drum, result: Result) -> Curves:
    """Grains of each kind in zone 1 (x > 0, z > 0) and zone 2 (x < 0, z < 0) in every frame since the drum turns."""
    # Packings stand in the scene's order: the large grains first.
    kinds = {"M1": slice(case.large, None), "M2": slice(0, case.large)}
    time: list[float] = []
    counts: dict[str, list[int]] = {name: [] for name in ZONES}
    for k in range(len(result.time)):
        since = float(result.time[k]) - SETTLING
        if since <= -1e-9:
            continue
        time.append(since)
        x, z = result.position[k, :, 0], result.position[k, :, 2]
        zones = {"zone1": (x > 0) & (z > 0), "zone2": (x < 0) & (z < 0)}
        for name, found in counts.items():
            zone, kind = name.split("_")
            found.append(np.count_nonzero(zones[zone][kinds[kind]]))
    return Curves(np.array(time), {name: np.array(n, dtype=float) for name, n in counts.items()})


@dataclass(frozen=True)
class Rate:
    """A straight line through the grains above the orifice."""

    rate: float
    """Grains a second."""
    off: float
    """Largest distance of the curve from the line, over all grains."""
    first: float
    last: float
    """Times between which the line is fitted, s."""


def rate(curves: Curves, grains: int) -> Rate | None:
    """By least squares in the time of steady flow; None where there are fewer than four points."""
    above = curves.counts["grains_above_orifice"]
    steady = (curves.time >= FIRST - 1e-9) & (above >= LAST * grains)
    if np.count_nonzero(steady) < 4:
        return None
    t, n = curves.time[steady], above[steady]
    line = np.polyfit(t, n, 1)
    return Rate(
        -float(line[0]), float(np.abs(n - np.polyval(line, t)).max()) / grains, float(t[0]), float(t[-1])
    )


def at(curves: Curves, time: F64) -> Curves:
    """The curves at other times, as far as they reach."""
    time = time[(time >= curves.time[0]) & (time <= curves.time[-1])]
    return Curves(time, {name: np.interp(time, curves.time, n) for name, n in curves.counts.items()})


@dataclass(frozen=True)
class Turn:
    """A peak or a trough."""

    time: float
    """s."""
    count: float
    peak: bool


def turns(time: F64, counts: F64, least: float) -> list[Turn]:
    """Peaks and troughs after which the curve goes back by at least `least`, in the order of time.

    Neither the start nor what comes last counts, since nobody sees whether the curve turned there.
    """
    found: list[Turn] = []
    if not len(counts):
        return []
    best, rising = 0, bool(counts[np.argmax(np.abs(counts - counts[0]) >= least)] > counts[0])
    for k in range(len(counts)):
        sign = 1.0 if rising else -1.0
        if sign * (counts[k] - counts[best]) > 0:
            best = k
        elif sign * (counts[best] - counts[k]) >= least:
            if best > 0:
                found.append(Turn(float(time[best]), float(counts[best]), rising))
            best, rising = k, not rising
    return found


@dataclass(frozen=True)
class Pair:
    """A turn of the mean of the published curves, and that of ours."""

    curve: str
    expected: Turn
    found: Turn | None

    @property
    def late(self) -> float:
        """s; not a number where there is no such turn."""
        return self.found.time - self.expected.time if self.found else float("nan")

    @property
    def off(self) -> float:
        """Difference of the counts."""
        return self.found.count - self.expected.count if self.found else float("nan")


def mean(curves: list[Curves]) -> Curves:
    """Their mean at the times of the first, as far as all reach."""
    first, last = max(c.time[0] for c in curves), min(c.time[-1] for c in curves)
    time = curves[0].time[(curves[0].time >= first - 1e-9) & (curves[0].time <= last + 1e-9)]
    return Curves(
        time,
        {
            name: np.mean([np.interp(time, c.time, c.counts[name]) for c in curves], axis=0)
            for name in curves[0].counts
        },
    )


def pairs(ours: Curves, expected: Curves) -> list[Pair]:
    """Each turn of the expected curves, as far as ours reach, with the nearest one of ours of its kind."""
    made = []
    reached = expected.time <= ours.time[-1] + 1e-9
    for name, counts in expected.counts.items():
        least = PROMINENCE * float(np.ptp(counts))
        mine = turns(ours.time, ours.counts[name], least)
        for turn in turns(expected.time[reached], counts[reached], least):
            same = [t for t in mine if t.peak == turn.peak]
            made.append(Pair(name, turn, min(same, key=lambda t: abs(t.time - turn.time), default=None)))
    return made
