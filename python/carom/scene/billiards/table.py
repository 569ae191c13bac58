"""A table: scenes on it, balls, racks and aims, and what a result says of its pockets. Its walls are in `walls`."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from carom.errors import CaromError, did_you_mean
from carom.scene.billiards.aim import direction_of_cut, direction_to
from carom.scene.billiards.arguments import place, sphere, vector
from carom.scene.billiards.data import LAWS, TABLES, Laws, Spec
from carom.scene.billiards.measures import checked, mark, same_table
from carom.scene.billiards.places import check_place, spots_of
from carom.scene.billiards.racks import numbers_of, rack_places, rows_of
from carom.scene.billiards.shots import Shot, shot
from carom.scene.billiards.walls import noses, outlets, rail
from carom.scene.scene import Scene
from carom.units import number

if TYPE_CHECKING:
    from carom.many.batch_result import Batch
    from carom.result.data import RunData
    from carom.scene.scene import Scene
    from carom.scene.tables.balls import Sphere

GRAVITY = 9.8
FRAME_S = 0.01
"""Between two frames of method `events`, s, unless the caller says more; runs beyond 10 s keep about 1000 frames."""
OFF = "off the table"


@dataclass(frozen=True)
class Pocketed:
    """A ball that left: into which pocket, or `OFF`, and when, s."""

    ball: str
    pocket: str
    time: float


def table(kind: str | None = None, /, **changes: Any) -> Table:
    """A table by name, `7ft`, `8ft`, `9ft`, `snooker` or `carom`, the third without one; `changes` are fields of `Spec`:
    `nose_height="37 mm"`.

    Lengths, angles and the mass are numbers in SI or texts with a unit: `corner_angle="142 deg"`.
    `table("9ft", corner_mouth=0.0)` has no pockets.
    """
    if kind is not None and "name" in changes:
        raise CaromError(
            f"table: name={changes['name']!r} cannot be changed; a table is called as its kind, {kind!r}"
        )
    name = changes.pop("name", "9ft") if kind is None else kind
    if name not in TABLES:
        raise CaromError(f"no table is called {name!r}; {did_you_mean(str(name), list(TABLES))}")
    known = list(Spec.__dataclass_fields__)
    for key in changes:
        if key not in known:
            raise CaromError(f"table: {key} is nothing that a table has; {did_you_mean(key, known)}")
    return Table(replace(TABLES[name], **changes))


class Table:
    """Builds scenes on a table and reads results of them."""

    def __init__(self, spec: Spec) -> None:
        self.spec = checked(spec)

    @property
    def has_pockets(self) -> bool:
        return self.spec.corner_mouth > 0

    @property
    def nose_angle(self) -> float:
        """theta, rad: by how much the normal at the nose points down for a ball on the bed."""
        return math.asin((self.spec.nose_height - self.spec.ball_radius) / self.spec.ball_radius)

    @property
    def reach(self) -> float:
        """Distance of the centre of a ball on the bed from the line of the nose that it touches, m: r cos theta."""
        return self.spec.ball_radius * math.cos(self.nose_angle)

    @property
    def spots(self) -> dict[str, tuple[float, float]]:
        """Places on the table (x, y), m; `ball`, `cue_ball` and `rack` take their names."""
        return spots_of(self.spec)

    @property
    def pockets(self) -> dict[str, tuple[float, float]]:
        """Pockets by name, as corners and middles of the playing area (x, y), m."""
        if not self.has_pockets:
            return {}
        length, width = self.spec.length, self.spec.width
        ends, sides = (("head", 0.0), ("foot", length)), (("right", 0.0), ("left", width))
        corners = {f"{end} {side}": (x, y) for end, x in ends for side, y in sides}
        return corners | {f"side {side}": (0.5 * length, y) for side, y in sides}

    # --- building ---------------------------------------------------------------------------------------------

    def scene(
        self, title: str = "", *, laws: Laws = LAWS, gravity: float = GRAVITY, record: Any = None, **run: Any
    ) -> Scene:
        """An empty table: bed, cushions, pockets and contact laws. `run` are keys of `[run]`, as `until=3.0`.

        Without `method` and `step` the motion is exact: method `events`, with a frame every `FRAME_S`, beyond 1000 frames
        fewer (`record={"every": 1}` keeps all). Balls that lean on one another for long are stepped then too; for many of
        them choose a method and a step.
        """
        if not run.keys() & {"method", "step"}:
            run = {"method": "events", "step": FRAME_S, **run}
        if number("scene", "gravity", gravity, unit="in m/s^2") < 0:
            raise CaromError(
                f"scene: gravity is a magnitude, which acts down; it must not be negative, found {gravity!r}"
            )
        if not isinstance(laws, Laws):
            raise CaromError(f"scene: laws must be of billiards.Laws, as billiards.LAWS is, found {laws!r}")
        scene = Scene(
            title or f"{self.spec.name} table", gravity=(0.0, 0.0, -gravity), run=run, record=record
        )
        scene.billiard_table = mark(self.spec)
        self._laws(scene, laws, gravity)
        scene.plane("bed", point=(0, 0, 0), normal=(0, 0, 1), material="cloth")
        for name, start, end in noses(self.spec):
            rail(scene, name, start, end, self.spec)
        for low, high in outlets(self.spec):
            scene.outlet(low=low, high=high)
        return scene

    def ball(self, scene: Scene, name: str, at: str | Sequence[float | str], **keys: Any) -> Sphere:
        """Add a ball of this table at a spot or at (x, y), on the bed; `keys` are those of `Scene.sphere`. With another
        `radius` it keeps the mass and the contact laws of the table's ball.

        Coordinates are numbers in m or texts with a unit. A ball in the air is at (x, y, z), z the height of its centre.
        """
        same_table("ball", f"the scene of {name!r}", self.spec, scene)
        if "position" in keys:
            raise CaromError(f"ball: {name!r}: both position and at are given; give at, they mean the same")
        if isinstance(at, str):
            if at not in self.spots:
                raise CaromError(f"ball: no spot is called {at!r}; {did_you_mean(at, list(self.spots))}")
            at = self.spots[at]
        r = number("ball", "radius", keys.get("radius", self.spec.ball_radius), "length")
        x, y, z = [*vector("ball", "at", at, "length"), r][:3]
        check_place(self, name, (x, y, z), r)
        given = {"radius": r, "material": "ball", "position": (x, y, z), **keys}
        if keys.get("density") is None:
            given.setdefault("mass", self.spec.ball_mass)
        return scene.sphere(name, **given)

    def cue_ball(self, scene: Scene, at: str | Sequence[float | str] = "head spot", **keys: Any) -> Sphere:
        """Add the ball "cue"."""
        return self.ball(scene, "cue", at, **keys)

    def rack(
        self,
        scene: Scene,
        balls: int | None = None,
        *,
        order: str | None = None,
        apex: str | Sequence[float | str] = "foot spot",
        prefix: str = "",
        gap: float | str = 0.0,
        jitter: float | str = 0.0,
        seed: int | None = None,
    ) -> list[Sphere]:
        """Add 3 to 15 balls, the apex towards the head of the table, named `prefix` and 1, 2, ...; 15 without a number.

        `order`, "8-ball", "9-ball" or "10-ball", places them by the WPA's rules and draws the rest by `seed`; without it
        they are numbered row by row. `gap`, `jitter` and `seed` are those of `rack_places`. Balls are returned by number.
        """
        if not isinstance(prefix, str):
            raise CaromError(f"rack: prefix must be a text, found {prefix!r}")
        if order is None:
            numbers = list(range(1, 1 + sum(rows_of(15 if balls is None else balls))))
        else:
            numbers = numbers_of(order, seed)
            if balls not in (None, len(numbers)):
                raise CaromError(f"rack: {order} has {len(numbers)} balls, found {balls!r}; leave balls out")
        x, y = self.spots[apex] if isinstance(apex, str) and apex in self.spots else (None, None)
        if x is None or y is None:
            if isinstance(apex, str):
                raise CaromError(f"rack: no spot is called {apex!r}; {did_you_mean(apex, list(self.spots))}")
            x, y = place("rack", "apex", apex, "length")
        places = rack_places(len(numbers), self.spec.ball_radius, gap=gap, jitter=jitter, seed=seed)
        balls_at = {
            f"{prefix}{number}": (x + along, y + left)
            for number, (along, left) in sorted(zip(numbers, places.tolist(), strict=True))
        }
        trial = copy.copy(scene)  # a rack that does not fit leaves no half of itself
        for name, at in balls_at.items():
            self.ball(trial, name, at)
        return [self.ball(scene, name, at) for name, at in balls_at.items()]

    def aim(
        self,
        cue: Sphere,
        ball: Sphere,
        pocket: str | Sequence[float | str] | None = None,
        *,
        cut: float | str | None = None,
    ) -> float:
        """The direction (rad) in which to strike `cue` so that it sends `ball` to a pocket, or leave at the angle `cut`.

        `pocket` is a name of `pockets` or a place (x, y), m. `cut` is the angle between the ways of the two balls, in rad
        or with a unit, above 0 where `ball` leaves to the left. Both by the line of centres: throw is left out
        (`carom.scene.billiards.aim`).
        """
        cue, ball = sphere("aim", "cue", cue), sphere("aim", "ball", ball)
        if (pocket is None) == (cut is None):
            raise CaromError("aim: give a pocket or cut=, one of them")
        if cut is not None:
            return direction_of_cut(cue, ball, cut)
        if isinstance(pocket, str):
            if pocket not in self.pockets:
                known = did_you_mean(pocket, list(self.pockets)) if self.has_pockets else "the table has none"
                raise CaromError(f"aim: no pocket is called {pocket!r}; {known}")
            return direction_to(cue, ball, self.pockets[pocket])
        x, y, *_ = vector(
            "aim", "pocket", pocket, "length"
        )  # the place of a ball has a height, which does not matter
        return direction_to(cue, ball, (x, y))

    def _laws(self, scene: Scene, laws: Laws, gravity: float) -> None:
        r = self.spec.ball_radius
        scene.contact("ball", "ball", friction=laws.ball_friction, restitution=laws.ball_restitution)
        scene.contact(
            "ball",
            "cloth",
            friction=laws.cloth_friction,
            restitution=laws.cloth_restitution,
            rolling_radius=laws.rolling_radius(r),
            spinning_radius=laws.spinning_radius(r, gravity) if gravity > 0 else 0.0,
        )
        scene.contact(
            "ball",
            "cushion",
            friction=laws.cushion_friction,
            restitution=laws.cushion_restitution,
        )

    # --- reading ------------------------------------------------------------------------------------------------

    @overload
    def pocketed(self, result: RunData) -> list[Pocketed]: ...
    @overload
    def pocketed(self, result: Batch) -> list[list[Pocketed]]: ...
    def pocketed(self, result: RunData | Batch) -> list[Pocketed] | list[list[Pocketed]]:
        """The balls that left in a result of this table, and where: in the order of time. Of a batch, a list for each case.

        In a result the place is that of the last frame before, carried on at its velocity; in a batch, and with method
        `events`, the place itself.
        """
        if not hasattr(result, "left_at"):
            return self._pocketed(result, "pocketed")
        batch: Any = result
        for case in range(len(batch)):
            same_table("pocketed", "the batch", self.spec, batch.scene(case))
        found: list[list[Pocketed]] = [[] for _ in range(len(result))]
        table = result.events
        for case, ball, kind, at in zip(
            *(table.get(name, ()) for name in ("case", "body", "kind", "time")), strict=True
        ):
            if kind == 0:
                where = self._where(result.left_at[case, ball])
                found[case].append(Pocketed(result.names[ball], where, float(at)))
        return found

    def shot(self, result: RunData, cue: str = "cue") -> Shot:
        """Who hit whom and which cushion, what was pocketed, whether it was a scratch. Times are those of the impacts: exact
        with method `events`, ends of steps with others.
        """
        return shot(result, cue, self._pocketed(result, "shot"), bed="bed")

    def _pocketed(self, result: RunData, call: str) -> list[Pocketed]:
        try:
            scene = result.scene
        except CaromError:  # a lost copy of the scenario does not keep the motion from being read
            pass
        else:
            same_table(call, "the run", self.spec, scene)
        time = np.asarray(result.time)
        found = []
        gone = result.transitions.where(result.transitions["event"] == "outlet")
        exact = dict(zip(gone["pair"][:, 0], gone["position"], strict=True)) if len(gone) else {}
        for ball, at in result.events.left():
            if ball in exact:
                found.append(Pocketed(ball, self._where(exact[ball]), at))
                continue
            index = result.names.index(ball)
            last = int(np.searchsorted(time, at, side="left")) - 1
            while last > 0 and not result.present[last, index]:
                last -= 1
            ahead = at - float(time[last])
            x = np.asarray(result.position[last, index]) + ahead * np.asarray(result.velocity[last, index])
            found.append(Pocketed(ball, self._where(x), at))
        return found

    def _where(self, x: Any) -> str:
        if not self.has_pockets:
            return OFF
        s = self.spec
        name = min(self.pockets, key=lambda name: math.dist(self.pockets[name], x[:2]))
        if name.startswith("side"):
            within = abs(x[0] - 0.5 * s.length) < 0.5 * s.side_mouth
        else:
            along = (min(at, size - at) for at, size in zip(x[:2], (s.length, s.width), strict=True))
            within = max(along) < s.corner_mouth / math.sqrt(2)
        # Between the points of its noses a ball may hop into a pocket, but not from higher than itself.
        return name if within and x[2] < 3 * s.ball_radius else OFF

    def __repr__(self) -> str:
        s = self.spec
        pockets = f"{len(self.pockets)} pockets" if self.has_pockets else "no pockets"
        return f"<billiard table {s.name}: {s.length:g} m x {s.width:g} m, {pockets}, nose at {s.nose_height:g} m>"
