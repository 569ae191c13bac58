"""`carom.Batch`: what came out of many small scenes, as arrays with the case in front."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64, Array, Bool
from carom.errors import counted, extra
from carom.many.cases import WIDTHS, Overrides
from carom.result.kinematics import QUANTITIES, Body
from carom.text import LISTED, page

if TYPE_CHECKING:
    import pandas

    from carom.scene.scene import Scene


ENDED = ("done", "stopped")
"""Outcomes of cases that ended well."""
NOT_RUN = "not_run"
"""Outcome of cases whose turn did not come before the batch was interrupted."""
KINEMATICS = {name: len(letters) for name, (letters, _) in QUANTITIES.items()}


@dataclass(frozen=True, eq=False)
class Batch:
    """B finished cases of N balls each. Rows of failed ones are NaN."""

    names: list[str]
    """Names of the balls."""
    outcome: Array
    """(B,) "done", "stopped" by the condition, or what went wrong: "not_converged", "overlap", "bad_model", "not_run" ..."""
    message: Array
    """(B,) where and why, with advice; empty where all is well."""
    time: F64
    """(B,) time of the final state, s."""
    position: F64
    """(B, N, 3) centres, m."""
    orientation: F64
    """(B, N, 4) unit quaternions, scalar part first."""
    velocity: F64
    """(B, N, 3), m/s."""
    angular_velocity: F64
    """(B, N, 3) in the world frame, rad/s."""
    present: Bool
    """(B, N) which balls are there at the end; all, unless the scene has inflows or outlets."""
    left_at: F64
    """(B, N, 3) where a ball that left was then, m; NaN for the others."""
    monitors: Mapping[str, F64]
    """Totals (B,): penetration, energies (J), counts of what the solver had to do."""
    parameters: Mapping[str, Array]
    """The overrides, as arrays."""
    impacts: Mapping[str, Array]
    """The tables of impacts end to end, with the column `case`; empty unless they were asked for."""
    events: Mapping[str, Array]
    """Balls that entered (`kind` 1) or left (0), with the column `case`; empty without inflows and outlets."""
    transitions: Mapping[str, Array]
    """The tables of transitions end to end, with the column `case`; with `impacts`, and of method `events` alone."""
    frame_time: F64
    """(T,) times of the frames, s; T is 0 unless they were asked for."""
    frames: Mapping[str, F64]
    """position (B, T, N, 3), velocity, angular_velocity, orientation (B, T, N, 4) of the frames."""
    wall_s: float
    """Seconds that the batch took."""
    threads: int
    _scenes: Sequence[Scene]
    _overrides: Overrides | None

    def __len__(self) -> int:
        return len(self.outcome)

    @property
    def ok(self) -> Bool:
        """(B,) which cases reached their end, or were stopped by the condition."""
        return np.isin(self.outcome, ENDED)

    @property
    def per_second(self) -> float:
        """Cases that were run a second, over the seconds that the batch took."""
        return int((self.outcome != NOT_RUN).sum()) / self.wall_s if self.wall_s > 0 else 0.0

    def __getitem__(self, name: str) -> Body:
        return Body.of(self, name)

    def _of_ball(self, name: str, index: int) -> Any:
        return getattr(self, name)[:, index]

    def scene(self, case: int) -> Scene:
        """The scene of one case, to simulate it again with everything recorded: the same bits.

        `carom.simulate(batch.scene(7)).view()`; -1 is the last case, and one that there is not raises `IndexError`.
        """
        if not -len(self) <= case < len(self):
            raise IndexError(f"no case {case}; there are {len(self)}, numbered from 0")
        case = range(len(self))[case]
        return self._scenes[case] if self._overrides is None else self._overrides.scene(case)

    def to_pandas(self) -> pandas.DataFrame:
        """One row per case: parameters, outcome, monitors, and the final state of each ball."""
        pandas = extra("pandas", "to_pandas needs pandas", "interop")
        rows = pandas.RangeIndex(len(self), name="case")
        return pandas.DataFrame(dict(self.columns()), index=rows)

    def columns(self) -> dict[str, Array]:
        """The same table as arrays (B,), by name: `parameter cue.velocity.x`, `outcome`, `penetration_max` ..., and
        `cue.velocity.x` of the final state.
        """
        found: dict[str, Array] = {}
        for key, values in self.parameters.items():
            ends = [f".{name}" for name in self.names] if values.ndim > 1 and key in WIDTHS else [""]
            width = WIDTHS.get(key.rpartition(".")[2], 3)
            if values.ndim > 1 and width:
                ends = [f"{end}.{x}" for end in ends for x in ("wxyz" if width == 4 else "xyz")]
            flat = values.reshape(len(self), -1)
            found |= {f"parameter {key}{end}": flat[:, i] for i, end in enumerate(ends)}
        found |= {"outcome": self.outcome, "message": self.message, "time": self.time, **self.monitors}
        for quantity, width in KINEMATICS.items():
            letters = "wxyz" if width == 4 else "xyz"
            values = getattr(self, quantity)
            for body, name in enumerate(self.names):
                found |= {f"{name}.{quantity}.{x}": values[:, body, i] for i, x in enumerate(letters)}
        return found

    def __repr__(self) -> str:
        left = int((self.outcome == NOT_RUN).sum())
        failed = len(self) - int(self.ok.sum()) - left
        counts = [f"{n} {what}" for n, what in ((failed, "failed"), (left, "not run")) if n]
        what = ", ".join(counts) or "all done"
        return (
            f"<carom.Batch: {counted(len(self), 'case')} of {counted(len(self.names), 'ball')}, {what};"
            f" {self.wall_s:.3g} s on {counted(self.threads, 'thread')}, {self.per_second:.3g} a second>"
        )

    def _repr_html_(self) -> str:
        """How many cases ended how, and what was varied."""
        kinds, counts = np.unique(self.outcome.astype(str), return_counts=True)
        facts = [
            ("cases", ", ".join(f"{k.replace('_', ' ')}: {n}" for k, n in zip(kinds, counts, strict=True))),
            ("balls", ", ".join(self.names[:LISTED])),
            (
                "time",
                f"{self.wall_s:.3g} s on {counted(self.threads, 'thread')}, {self.per_second:.3g} a second",
            ),
        ]
        rows = [
            [key, str(values.shape), f"{values.min():.4g} to {values.max():.4g}"]
            for key, values in self.parameters.items()
        ]
        return page("carom.Batch", facts, ["parameter", "shape", "range"], rows)
