"""The line of aim: the way of the cue ball to the first ball that it hits, and what both do then.

It is asked for at every move of the pointer. So it talks to the core: a `carom.Result` would cost more than the motion.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import Array
from carom.result.tables import Transitions
from carom.run.launch import Run

if TYPE_CHECKING:
    from carom.scene.billiards import Strike
    from carom.scene.scene import Scene

LOOK_S = 0.2
"""It looks ahead by this much at a time, and past the first hit by one to two times as much."""
POINT_S = 0.04
"""Between two points of a way."""
IMPACT, OUTLET = Transitions.EVENTS.index("impact"), Transitions.EVENTS.index("outlet")


class Sight:
    """Balls at rest in the core, and strikes of one of them; it looks until that one hits a ball, rests or leaves, at most
    for the time `longest`, s.
    """

    def __init__(self, scene: Scene, cue: str, longest: float) -> None:
        self._names = scene.names
        self._cue = self._names.index(cue)
        self._longest = longest
        options = {"step": LOOK_S, "until": longest}
        self._core = Run(scene.overridden(options, dict.fromkeys(options, "carom.play"))).simulation
        self._rest = self._core.state()

    def along(self, struck: Strike) -> dict[str, Any]:
        """Of a strike: `path` (P, 2), m; `hit` the ball or None; `ghost` (2,) where the cue ball is then; `after` the ways
        of both from there, by name.
        """
        cue, names = self._cue, self._names
        state = dict(self._rest)
        for name, value in (("velocity", struck.velocity), ("angular_velocity", struck.angular_velocity)):
            state[name] = state[name].copy()
            state[name][cue] = value
        self._core.restore(state)
        start = {name: state[name][np.newaxis] for name in ("position", "velocity")}
        frames, changes = [{"time": np.zeros(1), **start}], []
        met = None
        while self._core.time < self._longest:
            block = self._core.advance(1, 1, False, 1.0)
            frames.append(block["frames"])
            changes.append(block["transitions"])
            if met is not None or block["outcome"] is not None:
                break  # once more after the hit, for what follows it
            met = self._hit(changes[-1])
            if met is None and self._ends(frames[-1]):
                break
        way = partial(self._way, _joined(frames), _joined(changes))
        if met is None:
            return {"path": way(cue, 0.0, np.inf), "hit": None, "ghost": None, "after": {}}
        at, other = float(met["time"]), int(met["body"][1])
        ghost = _points([met["position"][:2]])
        after = {names[k]: way(k, at, at + LOOK_S) for k in (cue, other)}
        return {"path": way(cue, 0.0, at) + ghost, "hit": names[other], "ghost": ghost[0], "after": after}

    def _hit(self, changes: dict[str, Array]) -> dict[str, Any] | None:
        """The first impact of the cue ball with another ball."""
        body = changes["body"]
        ball = (body[:, 1] >= 0) & (body[:, 1] < len(self._names))
        rows = np.flatnonzero((changes["kind"] == IMPACT) & (body[:, 0] == self._cue) & ball)
        return {name: column[rows[0]] for name, column in changes.items()} if len(rows) else None

    def _ends(self, frames: dict[str, Array]) -> bool:
        """Whether the cue ball has come to rest, or is gone."""
        moves = any(frames[name][-1, self._cue].any() for name in ("velocity", "angular_velocity"))
        return not moves or not frames["present"][-1, self._cue]

    def _way(
        self, frames: dict[str, Array], changes: dict[str, Array], ball: int, start: float, end: float
    ) -> list[list[float]]:
        """Where a ball was from `start` to before `end`: parabolas between frames and changes of its motion, as it moves."""
        mine = changes["body"][:, 0] == ball
        gone = changes["time"][mine & (changes["kind"] == OUTLET)]
        time = np.concatenate([frames["time"], changes["time"][mine]])
        place, speed = (
            np.concatenate([frames[name][:, ball], changes[name][mine]])[:, :2]
            for name in ("position", "velocity")
        )
        order = np.argsort(time, kind="stable")
        order = order[time[order] <= min(gone, default=np.inf)]
        time, place, speed = time[order], place[order], speed[order]
        way = []
        for i in range(len(time) - 1):
            length = time[i + 1] - time[i]
            if length > 0 and start <= time[i] < end:
                bend = (place[i + 1] - place[i] - length * speed[i]) / length**2
                s = np.arange(0.0, min(length, end - time[i]), POINT_S)[:, np.newaxis]
                way.append(place[i] + s * speed[i] + s * s * bend)
        return _points([at for part in way for at in part])


def _joined(blocks: list[dict[str, Array]]) -> dict[str, Array]:
    """The rows of several blocks."""
    common = blocks[0].keys()
    return {name: np.concatenate([block[name] for block in blocks]) for name in common}


def _points(places: Any) -> list[list[float]]:
    return [[round(float(x), 6) for x in at] for at in places]
