"""What a shot did, in the words of the game: who hit whom and which cushion, what was pocketed, whether it was a scratch."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.errors import CaromError, among, quoted

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
    """The balls that the cue ball touched at the start, or that touched one of them, and that moved without a hit.

    Frames show who moved. With few frames only a first hit on a ball that lay still and touched none shows it, too.
    """

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
        _known("cushions", ball, self.balls)
        met = (self._partner(hit, ball) for hit in self.hits)
        return [name for name in met if name is not None and name not in self.balls]

    def __str__(self) -> str:
        """The shot in a sentence or two."""
        pushes = f" pushes {', '.join(self.pushed)} and" if self.pushed else ""
        told = [f"{self.cue}{pushes} hits {f'{self.first} first' if self.first else 'no ball'}."]
        gone = [f"{ball.ball} ({ball.pocket})" for ball in self.pocketed if ball.ball != self.cue]
        if gone:
            told.append(f"Gone: {', '.join(gone)}.")
        told += [f"Scratch ({ball.pocket})." for ball in self.pocketed if ball.ball == self.cue]
        return " ".join(told)

    @staticmethod
    def _partner(hit: Hit, ball: str) -> str | None:
        return {hit.ball: hit.other, hit.other: hit.ball}.get(ball)


def _known(call: str, ball: str, balls: Collection[str]) -> None:
    if ball not in balls:
        raise CaromError(f"{call}: no ball is called {quoted(ball)}; {among(str(ball), sorted(balls))}")


def struck(result: RunData) -> list[str]:
    """The balls that move at the start."""
    moving = np.concatenate([result.velocity[0], result.angular_velocity[0]], axis=1).any(axis=1)
    return [result.names[k] for k in np.flatnonzero(moving)]


def _pushed(result: RunData, cue: str, others: list[str], hits: list[Hit]) -> list[str]:
    """The balls that touched the cue ball at the start, or one that did, and moved before another ball hit them: a frame
    shows it, or that their first hit is of a ball which lay still and by itself.

    They move with the balls that touch them, so no hit says who moved them. `others` are struck themselves.
    """
    start, radius, time = np.asarray(result.position[0]), np.asarray(result.bodies["radius"]), result.time
    gap = np.linalg.norm(start[:, None] - start, axis=2) - radius[:, None] - radius
    touch = gap < FROZEN * radius
    still = set(np.array(result.names)[touch.sum(axis=1) == 1].tolist()) - {cue, *others}  # itself alone
    moved = (
        np.linalg.norm(np.asarray(result.position) - start, axis=2) > FROZEN * radius
    )  # not where it is gone: NaN
    met: dict[str, Hit] = {}
    for hit in hits:
        met = {hit.ball: hit, hit.other: hit} | met
    free = []
    for name, ways in zip(result.names, moved.T, strict=True):
        first = met.get(name)
        seen = ways if first is None else ways[np.asarray(time) < first.time]
        came = first is not None and any(
            ball in still and met[ball] is first for ball in {first.ball, first.other} - {name}
        )
        free.append(name not in others and (came or bool(seen.any())))
    reached = np.array(result.names) == cue
    while True:
        more = reached | (touch[reached].any(axis=0) & free)
        if (more == reached).all():
            return [name for name in np.array(result.names)[reached].tolist() if name != cue]
        reached = more


def _causes(pushed: dict[str, list[str]], hits: list[Hit]) -> dict[str, set[str]]:
    """Which of the struck balls, by what they pushed and a chain of hits, have moved each ball; missing where unknown."""
    causes = {name: {name} for name in pushed}
    for name, balls in pushed.items():
        for ball in balls:
            causes.setdefault(ball, set()).add(name)
    for hit in hits:
        if both := causes.get(hit.ball, set()) | causes.get(hit.other, set()):
            causes |= {hit.ball: both, hit.other: both}
    return causes


def shot(result: RunData, cue: str, pocketed: list[Pocketed], bed: str, slowest: float = SLOWEST) -> Shot:
    """The shot of a run; `Table.shot` is the way to call it."""
    _known("shot", cue, result.names)
    moving = struck(result)
    if cue not in moving:
        known = f"struck: {', '.join(map(quoted, moving))}" if moving else "no ball was"
        raise CaromError(f"shot: {quoted(cue)} was not struck, for it rests at the start; {known}")
    if not result.scene.record.impacts:
        raise CaromError("shot: the run has no impacts; record them, as with impacts=True of carom.simulate")
    rows = result.impacts
    speed = -np.asarray(rows["approach"])
    rows = rows.where((speed > slowest) & (np.asarray(rows["problem"]) > 0) & (rows["pair"][:, 1] != bed))
    found: dict[Any, Hit] = {}
    # In one impact a pair may meet several times, and the point of a pocket is the end of two walls: what meets a ball at
    # one point is one hit, of the first wall by name: of the cushion, not its facing.
    for time, (a, b), normal, approach in zip(
        rows["time"],
        rows["pair"].tolist(),
        np.round(rows["normal"], 6).tolist(),
        rows["approach"],
        strict=True,
    ):
        hit = Hit(float(time), a, b, -float(approach))
        old = found.setdefault((hit.time, a, *normal), hit)
        found[hit.time, a, *normal] = replace(old, other=min(old.other, b), speed=max(old.speed, hit.speed))
    hits, names = list(found.values()), frozenset(result.names)
    between = [hit for hit in hits if hit.other in names]
    pushed = {
        name: _pushed(result, name, [other for other in moving if other != name], between) for name in moving
    }
    causes = _causes(pushed, between)
    mine = tuple(ball for ball in pocketed if cue in causes.get(ball.ball, {cue}))
    return Shot(cue, names, tuple(hits), mine, tuple(pushed[cue]))
