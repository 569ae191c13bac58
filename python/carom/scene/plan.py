"""What a run computes and keeps: steps, frames, and the memory that they take."""

from __future__ import annotations

import math
from dataclasses import dataclass

from carom.errors import CaromError

#: Bytes of results in memory above which a run or a batch is refused rather than left to the system's killer.
MOST_BYTES = 8 * 1024**3
#: Steps that a run may have at most: more would take a lifetime, and times are exact far beyond.
MOST_STEPS = 10**12
#: About the bytes of a row of the table of steps.
STEP_BYTES = 250
#: Steps by which `until` may be beyond a whole number of them without one more, for it is rounded as the step is. Of very
#: many steps rounding is larger: this part of their number.
SLACK, SLACK_PART = 1e-9, 1e-15
#: Distances between frames that are tried for one that divides the steps: more take seconds.
MOST_TRIED = 100_000


@dataclass(frozen=True)
class Plan:
    """What to compute and keep: steps in all, steps between frames, step size (s), whether contacts are kept."""

    steps: int
    every: int
    step: float
    contacts: bool

    @property
    def until(self) -> float:
        """Time at the last step, s."""
        return self.steps * self.step

    @property
    def grid_end(self) -> int:
        """Where the last step is no frame of the grid, it is computed by itself and framed: results then end at `until`."""
        return self.steps - bool(self.every and self.steps % self.every)

    @property
    def frames(self) -> int:
        """Frames of the grid after that of the start."""
        return self.steps // self.every

    @property
    def is_crowded(self) -> bool:
        """Whether it keeps more than twice the frames of a plan without `every`."""
        return self.frames > 2 * (self.steps // thinned(self.steps))

    def frame_bytes(self, bodies: int) -> int:
        """About the bytes of a frame: states, and about three contacts a body."""
        return bodies * (104 + (3 * 250 if self.contacts else 0))

    def refuse_to_fill_memory(self, bodies: int) -> None:
        """Raise where frames and the table of steps are more than memory should hold."""
        size = self.frames * self.frame_bytes(bodies) + self.steps * STEP_BYTES
        if size > MOST_BYTES:
            raise CaromError(
                f"a result of about {size / 1024**3:.0f} GiB is not kept in memory (at most {MOST_BYTES >> 30} GiB); write"
                " it to a directory (out=...), or keep fewer frames (every=...)"
            )

    @classmethod
    def of(cls, until: float, step: float, every: int | None, contacts: bool) -> Plan:
        """The plan for `until` seconds; without `every` about 1000 frames are kept."""
        steps = max(1, whole_steps(until, step))
        return cls(steps, every or thinned(steps), step, contacts)


def whole_steps(until: float, step: float) -> int:
    """How many steps a run to `until` takes: up to that time or, where it is no multiple of the step, just beyond it.

    It is 0 only for no time: `carom.scene.checks.rules` refuses what is shorter than a step.
    """
    ratio = min(until / step, 2.0**62)  # of infinitely many steps there is no integer
    return math.ceil(ratio - max(SLACK, SLACK_PART * ratio))


def thinned(steps: int, frames: int = 1000) -> int:
    """Steps between frames for about `frames` of them; if possible a divisor of `steps`, so that the last step is one."""
    least = max(1, math.ceil(steps / frames))
    most = min(2 * least, least + MOST_TRIED)
    return next((n for n in range(least, most) if steps % n == 0), least)
