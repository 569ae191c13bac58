"""What a shot did, in the words of the game: who hit whom and which cushion, what was pocketed, whether it was a scratch."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carom.errors import CaromError, quoted

if TYPE_CHECKING:
    from carom.result.data import RunData
    from carom.scene.billiards.table import Pocketed

#: Closing speed, m/s, below which bodies lean on one another and do not hit.
SLOWEST = 1e-3
#: Gap, and way, in radii: balls that are nearer touch, and those that went less far lay still.
FROZEN = 1e-6


@dataclass(frozen=True)
class Hit:
    """A ball hit another ball, or a cushion, which is named as the wall of the scene: when, s, and how fast, m/s."""

    time: float
    ball: str
    other: str
    speed: float


@dataclass(frozen=True)
class Shot:
    """One shot: the hits of the run and the balls it pocketed, in the order of time.

    Of several balls that are struck at once each has the pocketed balls that a chain of hits leads to from it.
    """

    cue: str
    balls: frozenset[str]
    hits: tuple[Hit, ...]
    pocketed: tuple[Pocketed, ...]
    pushed: tuple[str, ...] = ()
    """The balls that the cue ball touched at the start and moved without a hit."""

    @property
    def first(self) -> str | None:
        """The first ball that the cue ball hit, if it hit one."""
        met = (self._partner(hit, self.cue) for hit in self.hits)
        return next((name for name in met if name in self.balls), None)

    @property
    def scratch(self) -> bool:
        """Whether the cue ball went into a pocket, or off the table."""
        return any(ball.ball == self.cue for ball in self.pocketed)

    def cushions(self, ball: str) -> list[str]:
        """The cushions that a ball hit, one after the other."""
        met = (self._partner(hit, ball) for hit in self.hits)
        return [name for name in met if name is not None and name not in self.balls]

    def __str__(self) -> str:
        """The shot in a sentence or two."""
        pushes = f" pushes {', '.join(self.pushed)} and" if self.pushed else ""
        told = [f"{self.cue}{pushes} hits {f'{self.first} first' if self.first else 'no ball'}."]
        gone = [f"{ball.ball} ({ball.pocket})" for ball in self.pocketed if ball.ball != self.cue]
        if gone:
            told.append(f"Gone: {', '.join(gone)}.")
        if self.scratch:
            told.append("Scratch.")
        return " ".join(told)

    @staticmethod
    def _partner(hit: Hit, ball: str) -> str | None:
        return {hit.ball: hit.other, hit.other: hit.ball}.get(ball)


def struck(result: RunData) -> list[str]:
    """The balls that move at the start."""
    moving = np.concatenate([result.velocity[0], result.angular_velocity[0]], axis=1).any(axis=1)
    return [result.names[k] for k in np.flatnonzero(moving)]


def _pushed(result: RunData, cue: str, hits: tuple[Hit, ...]) -> tuple[str, ...]:
    position, radius = np.asarray(result.position[0]), np.asarray(result.bodies["radius"])
    k = result.names.index(cue)
    gap = np.linalg.norm(position - position[k], axis=1) - radius - radius[k]
    moved = np.linalg.norm(np.asarray(result.position[-1]) - position, axis=1)
    found = (gap < FROZEN * radius) & (moved > FROZEN * radius)
    rest = {cue, *struck(result), *(name for hit in hits for name in (hit.ball, hit.other))}
    return tuple(name for name in np.array(result.names)[found].tolist() if name not in rest)


def _causes(balls: list[str], hits: tuple[Hit, ...]) -> dict[str, set[str]]:
    """Which of the struck balls, by a chain of hits, have moved each ball."""
    causes = {name: {name} for name in balls}
    for hit in hits:
        both = causes.get(hit.ball, set()) | causes.get(hit.other, set())
        causes |= {hit.ball: both, hit.other: both}
    return causes


def shot(result: RunData, cue: str, pocketed: list[Pocketed], bed: str, slowest: float = SLOWEST) -> Shot:
    """The shot of a run; `Table.shot` is the way to call it."""
    if cue not in result.names:
        raise CaromError(f"shot: no ball is called {quoted(cue)}")
    if not result.scene.record.impacts:
        raise CaromError("shot: the run has no impacts; record them, as with impacts=True of carom.simulate")
    rows = result.impacts
    speed = -np.asarray(rows["approach"])
    rows = rows.where((speed > slowest) & (np.asarray(rows["problem"]) > 0) & (rows["pair"][:, 1] != bed))
    found: dict[tuple[float, str, str], float] = {}
    # In one impact a pair may meet several times: that is one hit.
    for time, (a, b), approach in zip(rows["time"], rows["pair"].tolist(), rows["approach"], strict=True):
        key = float(time), str(a), str(b)
        found[key] = max(found.get(key, 0.0), -float(approach))
    hits = tuple(Hit(*key, speed) for key, speed in found.items())
    names = frozenset(result.names)
    causes = _causes([cue, *struck(result)], tuple(hit for hit in hits if hit.other in names))
    mine = tuple(ball for ball in pocketed if cue in causes.get(ball.ball, {cue}))
    return Shot(cue, names, hits, mine, _pushed(result, cue, hits))
