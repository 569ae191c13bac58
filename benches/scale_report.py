"""What scale.py found: rows, the table, floors and aims, growth with N, CSV, and a page of the documentation."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

#: Young's modulus of glass, Pa. The peers' time step is as 1 over the root of it.
REAL_STIFFNESS = 7e10
#: Time (s) for a simulated second, deepest overlap (radii) and residual that must be reached, and the time aimed at.
GOALS = {
    (1000, 1): (6.0, 1e-4, 1e-4, 1.5),
    (8000, 1): (60.0, 5e-4, 1e-4, 15.0),
    (64_000, 2): (500.0, 2e-3, 1e-3, 120.0),
}
#: Law and start of the scene made of copies; bounds of its memory (bytes) and residual, and the time of a step aimed at (s).
COPIES, MEMORY, COPIES_RESIDUAL, COPIES_AIM = "sequence, copies", 3e9, 1e-3, 3.0
#: Where the tables stand in a page of the documentation.
BEGIN, END = "<!-- printed by benches/scale.py -->", "<!-- end of what is printed -->"
HEAD = (
    "program", "grains", "threads", "wall s", "CPU s", "fall", "settle", "rest", "deepest/r", "mean/r", "residual",
    "E_kin", "unconv.", "cut", "halved", "E rise", "MB", "hash",
)  # fmt: skip
NOT_GIVEN = "-"


@dataclass(frozen=True)
class Row:
    """One run: what was asked, and the answer of the program; `why` where there is none."""

    program: str
    law: str
    grains: int
    threads: int
    seed: int
    until: float
    young: float = math.nan
    told: dict[str, Any] = field(default_factory=dict)
    why: str = ""
    #: CPU times (s) of all runs of this row, where there were several.
    cpu_of_runs: tuple[float, ...] = ()

    @property
    def label(self) -> str:
        return f"{self.program} {self.law}"

    @property
    def complete(self) -> bool:
        """Whether the run came to its end."""
        return bool(self.told) and self.told["time"] > self.until - 1e-9 and not self.told.get("failure")

    @property
    def wall(self) -> float:
        """Wall time of all steps, s."""
        return float(sum(self.told["phases"]))

    @property
    def clock(self) -> str:
        """What programs are compared by: CPU time, which others disturb less; of several threads it says too little."""
        return "CPU" if self.threads == 1 else "wall"

    @property
    def seconds(self) -> float:
        """Time of all steps by `clock`, s."""
        return float(self.told["cpu"]) if self.threads == 1 else self.wall

    def per_step(self, phase: int | None = None) -> float:
        """Wall time of a step, s: of the whole run or of one phase."""
        from scale_carom import PHASES

        ends = [0.0, *PHASES]
        low, high = (0.0, self.until) if phase is None else (ends[phase], min(ends[phase + 1], self.until))
        steps = round((high - low) / self.told["step"])
        spent = self.wall if phase is None else self.told["phases"][phase]
        return spent / steps if steps > 0 else math.nan

    def cells(self) -> list[str]:
        """The row of the table."""
        start = [self.label, str(self.grains), str(self.threads)]
        if not self.told:
            return [*start, self.why]
        told = self.told
        counts = told.get("counts", {})
        numbers = [f"{x:.3g}" for x in (self.wall, told["cpu"], *told["phases"])]
        depths = [f"{told[k]:.1e}" for k in ("deepest", "mean_end")]
        residual = [f"{told[k]:.1e}" if k in told else NOT_GIVEN for k in ("residual",)]
        kinetic = [f"{told['kinetic']:.1e}"]
        events = [
            str(counts[k]) if k in counts else NOT_GIVEN
            for k in ("unconverged", "truncated_sequences", "halvings")
        ]
        rise = [f"{told['energy_rise']:.1e}" if "energy_rise" in told else NOT_GIVEN]
        end = [f"{told['memory'] / 1e6:.0f}", told.get("hash", NOT_GIVEN)[:16]]
        return [*start, *numbers, *depths, *residual, *kinetic, *events, *rise, *end]

    def remark(self) -> str:
        """What the row cannot hold."""
        if not self.told:
            return ""
        if self.told.get("failure"):
            return (
                f"{self.label}, {self.grains}: stopped at {self.told['time']:.3f} s: {self.told['failure']}"
            )
        if not self.complete:
            return (
                f"{self.label}, {self.grains}: out of time at {self.told['time']:.2f} s of {self.until:g} s"
            )
        return ""

    def flat(self) -> dict[str, Any]:
        """The row of the CSV file."""
        found = {k: v for k, v in asdict(self).items() if k != "told"}
        for key, value in self.told.items():
            if isinstance(value, dict):
                found |= {f"{key}_{k}": json.dumps(v) if isinstance(v, dict) else v for k, v in value.items()}
            elif isinstance(value, list):
                found |= {f"{key}_{k}": v for k, v in enumerate(value)}
            else:
                found[key] = value
        return found


def medians(rows: Sequence[Row]) -> list[Row]:
    """One row of each kind: the run of median CPU time (the lower one of an even number), with the times of all."""
    kinds: dict[tuple[str, int, int], list[Row]] = {}
    for row in rows:
        kinds.setdefault((row.label, row.grains, row.threads), []).append(row)
    found = []
    for runs in kinds.values():
        done = sorted((row for row in runs if row.complete), key=lambda row: row.told["cpu"])
        if len(runs) == 1 or len(done) < len(runs):
            found.append(next((row for row in runs if not row.complete), runs[0]))
        else:
            found.append(
                replace(done[(len(done) - 1) // 2], cpu_of_runs=tuple(row.told["cpu"] for row in done))
            )
    return found


def spread(rows: Sequence[Row]) -> list[str]:
    """How far the CPU times of repeated runs lie apart."""
    return [
        f"{row.label}, N = {row.grains}, {row.threads} thread(s): {len(row.cpu_of_runs)} runs, "
        f"CPU {row.cpu_of_runs[0]:.3g} to {row.cpu_of_runs[-1]:.3g} s; the row of the median"
        for row in rows
        if row.cpu_of_runs
    ]


def aligned(lines: Sequence[Sequence[str]]) -> list[str]:
    """Rows as text with columns below each other; short rows end with a remark, which may be as long as it likes."""
    full = [row for row in lines if len(row) == len(lines[0])]
    widths = [max(len(row[k]) for row in full) for k in range(len(lines[0]))]
    widths[0] = max(len(row[0]) for row in lines)
    return ["  ".join(c.ljust(w) for c, w in zip(row, widths)).rstrip() for row in lines]


def goals(rows: Sequence[Row]) -> list[str]:
    """Floors and aims, for the default law."""
    found = []
    for row in rows:
        goal = GOALS.get((row.grains, row.threads))
        if goal is None or row.label != "Carom sequence" or not row.complete or row.until != 1.0:
            continue
        floor, overlap, residual, aim = goal
        counts = row.told["counts"]
        parts = {
            f"{floor:g} s": row.seconds <= floor,
            f"overlap {overlap:g} r": row.told["deepest"] <= overlap,
            f"residual {residual:g}": row.told["residual"] <= residual,
            "no unconverged step": counts["unconverged"] == 0,
        }
        said = ", ".join(f"{name} {'met' if held else 'SHORT'}" for name, held in parts.items())
        verdict = f"aim of {aim:g} s {'met' if row.seconds <= aim else 'SHORT'}"
        found.append(f"N = {row.grains}, {row.threads} thread(s): floors: {said}; {verdict}")
    return found


def copies(rows: Sequence[Row]) -> list[str]:
    """Steps of the scene made of copies of a heap."""
    found = []
    for row in rows:
        if row.law != COPIES or not row.told:
            continue
        told = row.told
        steps = round(told["time"] / told["step"])
        each = row.wall / steps if steps else math.nan
        parts = {
            f"below {MEMORY / 1e9:g} GB": told["memory"] < MEMORY,
            f"residual {COPIES_RESIDUAL:g}": told["residual"] <= COPIES_RESIDUAL,
            "all steps": row.complete,
        }
        said = ", ".join(f"{name} {'met' if held else 'SHORT'}" for name, held in parts.items())
        found.append(
            f"N = {row.grains}, {row.threads} thread(s): {steps} steps of {each:.3g} s, "
            f"the slowest {told['slowest']:.3g} s, {told['memory'] / 1e9:.2g} GB; floors: {said}; "
            f"aim of {COPIES_AIM:g} s a step {'met' if each <= COPIES_AIM else 'SHORT'}"
        )
    return found


def ratios(rows: Sequence[Row]) -> list[str]:
    """Carom over each peer, same size and threads, and the soft peers with real stiffness."""
    found = []
    for peer in rows:
        if peer.program == "Carom" or not peer.complete:
            continue
        line = (
            f"{peer.label}, N = {peer.grains}, {peer.threads} thread(s): {peer.clock} {peer.seconds:.3g} s at "
            f"{peer.told['deepest']:.1%} overlap"
        )
        if not math.isnan(peer.young):
            scale = math.sqrt(REAL_STIFFNESS / peer.young)
            line += (
                f"; with the stiffness of glass ({REAL_STIFFNESS:g} Pa) up to {scale * peer.seconds:.3g} s, "
                "extrapolated by the number of steps"
            )
        for mine in rows:
            same = (mine.grains, mine.threads, mine.until) == (peer.grains, peer.threads, peer.until)
            if mine.program == "Carom" and mine.complete and same:
                line += f"; {mine.law} / {peer.program} {mine.seconds / peer.seconds:.2g}"
        found.append(line)
    return found


def heights(rows: Sequence[Row]) -> list[str]:
    """Mean heights of the grains at the end: programs that made the same pile have the same."""
    found = []
    for grains, threads in dict.fromkeys((r.grains, r.threads) for r in rows):
        mine = [r for r in rows if (r.grains, r.threads) == (grains, threads) and "height" in r.told]
        each = ", ".join(f"{r.label} {1e3 * r.told['height']:.1f}" for r in mine if r.complete)
        if each:
            found.append(f"N = {grains}, {threads} thread(s): mean height of the grains, mm: {each}")
    return found


def growth(rows: Sequence[Row]) -> list[str]:
    """Exponents of the time of a step in N, by law and threads: least squares in logarithms."""
    found = []
    for label, threads in dict.fromkeys((r.label, r.threads) for r in rows if r.complete):
        mine = [r for r in rows if r.complete and (r.label, r.threads) == (label, threads)]
        sizes = sorted({r.grains for r in mine})
        if len(sizes) < 2:
            continue
        logs = np.log([r.grains for r in mine])
        exponents = []
        for name, phase in (("whole run", None), ("fall", 0), ("settle", 1), ("rest", 2)):
            times = np.array([r.per_step(phase) for r in mine])
            if np.isfinite(times).all() and (times > 0).all():
                exponents.append(f"{name} {np.polyfit(logs, np.log(times), 1)[0]:.2f}")
        points = ", ".join(map(str, sizes))
        found.append(
            f"{label}, {threads} thread(s): time of a step grows as N^k, k: {', '.join(exponents)} (N = {points})"
        )
    return found


def same_bits(rows: Sequence[Row]) -> list[str]:
    """Whether runs that differ in threads alone end in the same bits."""
    found = []
    mine = [r for r in rows if r.program == "Carom" and r.told]
    for law, grains in dict.fromkeys((r.law, r.grains) for r in mine):
        these = [r for r in mine if (r.law, r.grains) == (law, grains)]
        ends = {(r.told["time"], r.told["hash"]) for r in these}
        if len(these) > 1 and len({time for time, _ in ends}) == 1:
            threads = " and ".join(str(r.threads) for r in these)
            found.append(
                f"{law}, N = {grains}: {threads} threads, {'same bits' if len(ends) == 1 else 'BITS DIFFER'}"
            )
    return found


def lines(rows: Sequence[Row]) -> list[str]:
    """All there is to say."""
    table = aligned([HEAD, *(row.cells() for row in rows)])
    remarks = [text for row in rows if (text := row.remark())]
    makers = (spread, heights, goals, copies, ratios, growth, same_bits)
    parts = [table, remarks, *(make(rows) for make in makers)]
    return [line for part in parts if part for line in (*part, "")][:-1]


def write_csv(rows: Sequence[Row], header: str, path: Path) -> None:
    """All figures; the machine in each row, so that rows of several files can be put together."""
    flat = [{"machine": header, **row.flat()} for row in rows]
    names = list(dict.fromkeys(key for row in flat for key in row))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(flat)


def write_page(text: str, path: Path, first: str = BEGIN, last: str = END) -> None:
    """Put what was printed between the marks of a page."""
    page = path.read_text(encoding="utf-8")
    before, mark, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not mark or not end:
        raise SystemExit(f"{path} has no place for the table: write {first} and {last} into it")
    path.write_text(f"{before}{first}\n\n```text\n{text}\n```\n\n{last}{after}", encoding="utf-8")
