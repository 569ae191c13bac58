"""What the examples of validation/ share: running the core at many steps, bounds, tables.

An example is a folder named after its section of the paper; `validation/README.md` says what it holds. Its
scripts run the compiled core directly: nothing is written to disk, so hundreds of thousands of steps take
seconds.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import carom
import numpy as np
from carom.result.record import Memory
from carom.run.loop import advance, begin
from carom.run.sinks import Instants, Recorder
from carom.scene.plan import Plan
from numpy.typing import NDArray

F64 = NDArray[np.float64]
Model = Mapping[str, Any]

ROOT = Path(__file__).parent.parent
SCENARIOS = ROOT / "scenarios" / "paper"


def model_of(scenario: str, **options: Any) -> dict[str, Any]:
    """A scenario of the paper as the arrays that the core takes; `options` are keys of its `[run]`."""
    return carom.Scene.from_toml(SCENARIOS / f"{scenario}.toml").with_options(**options).to_model()


@dataclass
class Run:
    """One run: states at the demanded times, the core's monitors, and the impact problems of all steps.

    `height` is the greatest height of each centre, m, over all steps up to `heights_until`; NaN without.
    """

    h: float
    frames: list[dict[str, F64]]
    monitors: dict[str, Any]
    impacts: dict[str, NDArray[Any]]
    height: F64
    outcome: dict[str, Any] | None = None
    states: dict[int, dict[str, F64]] = field(default_factory=dict)

    @property
    def converged(self) -> bool:
        """Whether every sub-problem of every step was solved to its tolerance."""
        return self.outcome is None and int(self.monitors["unconverged"]) == 0


def run(
    scenario: str,
    h: float,
    times: Sequence[float],
    *,
    steps: Sequence[int] = (),
    heights_until: float = 0.0,
    **options: Any,
) -> Run:
    """Run a scenario with step `h` to the last of `times`, which must lie on its grid.

    `steps` are further step numbers whose states are kept, in `states`.
    """
    model = model_of(scenario, step=h, **options)
    wanted = [round(t / h) for t in times]
    off = [t for t, n in zip(times, wanted, strict=True) if abs(n * h - t) > 1e-9 * t]
    if off:
        raise ValueError(f"h = {h:g} s does not reach t = {off} s in whole steps")
    simulation, kept, memory = begin(model), Instants([*wanted, *steps]), Memory(keep=("impacts",))
    plan = Plan(int(kept.steps[-1]), kept.every, h, False)
    flight = Instants(range(1, math.floor(heights_until / h * (1 + 1e-12)) + 1))
    sinks = [kept, flight, Recorder(memory, plan, len(model["radius"]))]
    for sink in sinks:
        sink.start(simulation)
    ending = advance(simulation, len(flight.steps), 1, sinks)
    if ending.kind == "done":
        ending = advance(simulation, plan.steps, plan.every, sinks)
    memory.commit()
    height = np.max(flight.frames["position"][:, :, 2], axis=0, initial=-math.inf)
    at = {n: {key: values[row] for key, values in kept.frames.items()} for row, n in enumerate(kept.steps)}
    return Run(
        h,
        [at[n] for n in wanted],
        simulation.monitors(),
        memory.table("impacts"),
        height if heights_until else np.full_like(height, math.nan),
        None if ending.kind == "done" else ending.outcome,
        {n: at[n] for n in steps},
    )


@dataclass(frozen=True)
class Check:
    """A measured value held against a bound of `bounds.toml`."""

    name: str
    value: float
    least: float | None
    most: float | None
    origin: str

    @property
    def ok(self) -> bool:
        """Whether the value lies within its bounds; NaN does not."""
        return (self.least is None or self.value >= self.least) and (
            self.most is None or self.value <= self.most
        )

    def as_json(self) -> dict[str, Any]:
        """The check as plain values."""
        return {**vars(self), "ok": self.ok}


class Bounds:
    """The bounds of an example: `bounds.toml` gives each a `least`, a `most` or both, and says where it comes from."""

    def __init__(self, path: Path) -> None:
        self._table = tomllib.loads(path.read_text(encoding="utf-8"))
        self.checks: list[Check] = []

    def check(self, name: str, value: float) -> None:
        """Note a measured value; a name without bounds is an error."""
        bound = self._table[name]
        self.checks.append(Check(name, float(value), bound.get("least"), bound.get("most"), bound["origin"]))

    def unused(self) -> set[str]:
        """Bounds that nothing was held against."""
        return set(self._table) - {check.name for check in self.checks}

    @property
    def ok(self) -> bool:
        """Whether all values noted so far lie within their bounds."""
        return all(check.ok for check in self.checks)

    def table(self) -> str:
        """The checks for a terminal."""
        rows = []
        for c in self.checks:
            limits = [f"{sign} {x:g}" for sign, x in ((">=", c.least), ("<=", c.most)) if x is not None]
            rows.append([c.name, f"{c.value:.6g}", " and ".join(limits), "ok" if c.ok else "SHORT"])
        return table(["check", "value", "bound", ""], rows)


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Columns for a terminal, the first one flush left, the others flush right."""
    cells = [list(head), *(list(row) for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(head))]

    def line(row: Sequence[str]) -> str:
        first, *rest = row
        return "  ".join(
            [first.ljust(widths[0]), *(c.rjust(w) for c, w in zip(rest, widths[1:], strict=True))]
        ).rstrip()

    return "\n".join([line(cells[0]), "  ".join("-" * w for w in widths), *map(line, cells[1:])])
