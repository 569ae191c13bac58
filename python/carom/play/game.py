"""A game: where the balls lie, the aim, the shots so far. It knows no rules of a game, and nothing of pages."""

from __future__ import annotations

import math
import warnings
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.errors import CaromError, ScenarioError, did_you_mean, quoted
from carom.measure.events import AtRest
from carom.numeric import is_finite
from carom.play.sight import Sight
from carom.run.simulate import simulate
from carom.scene import billiards
from carom.scene.billiards import Shot, Strike, cue_impulse
from carom.scene.billiards.cue import CUE_MASS
from carom.scene.billiards.marked import table_in
from carom.scene.billiards.places import check_place, overlap
from carom.scene.billiards.racks import GAMES
from carom.scene.scene import Scene

if TYPE_CHECKING:
    from carom.run.result import Result
    from carom.scene.tables.balls import Sphere

CUE = "cue"
FRAME_S = 1 / 60
LONGEST_S = 60.0
"""A shot ends here, if its balls still move then."""
FASTEST = 20.0
"""Of a cue, m/s: no player reaches it."""
GAP = 1e-4
"""Between neighbours of a rack, m: no rack of a player is tight."""
SHAFT = 1 / 20
"""Mass of a cue's front end over that of the ball: 2.3 deg of squirt at 0.4 radii."""


@dataclass(frozen=True)
class Aim:
    """A stroke: direction and elevation, rad, speed of the cue, m/s, offsets of the tip in radii of the ball."""

    direction: float = 0.0
    speed: float = 2.0
    side: float = 0.0
    height: float = 0.0
    elevation: float = 0.0
    squirt: bool = False

    @classmethod
    def of(cls, given: Any) -> Aim:
        """The stroke that a page sent."""
        if not isinstance(given, dict):
            raise CaromError(f"play: a stroke is a JSON object, found {quoted(given)}")
        usual = asdict(cls())
        for name, value in given.items():
            if name not in usual:
                raise CaromError(f"play: a stroke has no {quoted(str(name))}; it has {', '.join(usual)}")
            truth = isinstance(usual[name], bool)
            if not (isinstance(value, bool) if truth else is_finite(value)):
                told = "true or false" if truth else "a finite number"
                raise CaromError(f"play: {name} must be {told}, found {quoted(value)}")
        aim = cls(**given)
        if not 0 < aim.speed <= FASTEST:
            raise CaromError(f"play: speed must be above 0 and at most {FASTEST:g} m/s, found {aim.speed:g}")
        if not 0 <= aim.elevation < math.pi / 2:
            raise CaromError(f"play: elevation must be from 0 to below pi/2 rad, found {aim.elevation:g}")
        return aim

    def strike(self, ball: Sphere) -> Strike:
        """What it does to the cue ball."""
        mass = ball.mass_kg()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a miscue: the page draws its limit
            return cue_impulse(
                radius=ball.radius,
                mass=mass,
                inertia=ball.inertia_kg_m2(),
                direction=math.remainder(self.direction, math.tau),
                speed=self.speed,
                side=self.side,
                height=self.height,
                elevation=self.elevation,
                cue_mass=CUE_MASS,
                end_mass=SHAFT * mass if self.squirt else None,
            )


@dataclass(frozen=True)
class Played:
    """A shot: its scene, its run and what that says."""

    scene: Scene
    result: Result
    shot: Shot

    @property
    def words(self) -> str:
        """The shot in a sentence or two, and what was done to its balls afterwards."""
        told = [str(self.shot)]
        if self.result.outcome.kind != "stopped":
            told.append(
                f"Balls still moved after {LONGEST_S:g} s: the shot was ended there, and they were stopped."
            )
        if self.shot.scratch:
            told.append("The cue ball is back on the table.")
        return " ".join(told)


class Game:
    """A table with its balls at rest, on which shots are played one after the other.

    `scene` is a scene on a table of the billiards kit, with a ball named "cue". Its laws are those of all shots.
    """

    def __init__(self, scene: Scene) -> None:
        table = table_in(scene)
        if table is None:
            raise CaromError(
                "play: the scene has no [billiard_table]; make it with carom.billiards.table(...).scene()"
            )
        if CUE not in scene.names:
            raise CaromError(f"play: no ball of the scene is called {quoted(CUE)}; name the cue ball so")
        self.table = table
        scene = scene.with_options(
            method="events", step=FRAME_S, until=LONGEST_S, every=1, impacts=True
        ).resolved()
        still = {"velocity": (0.0, 0.0, 0.0), "angular_velocity": (0.0, 0.0, 0.0)}
        self.scene = _with_balls(scene, [ball.model_copy(update=still) for ball in scene.spheres])
        """The balls as they lie."""
        self.last: Played | None = None
        """The shot that led here; None at the start, and after balls were moved by hand."""
        self.shots = 0
        self.changes = 0
        """How often the table was changed: by shots, by hand, and back."""
        self._past: list[tuple[Scene, Aim | None]] = []
        self._rest: tuple[Scene, Result] | None = None
        try:
            self._sight = self.scene, self._looking()
        except ScenarioError:
            raise
        except CaromError as error:
            cause = str(error).partition("; ")[0]
            cure = "shots are computed by it alone, so leave them out of the scene"
            raise CaromError(f"play: {cause}; {cure}") from None

    @property
    def can_undo(self) -> bool:
        return bool(self._past)

    def ball(self, name: str) -> Sphere:
        """A ball that lies on the table."""
        for ball in self.scene.spheres:
            if ball.name == name:
                return ball
        raise CaromError(f"play: no ball called {quoted(name)} is on the table")

    def shown(self) -> Result:
        """What there is to see: the last shot, or the balls at rest."""
        if self.last is not None:
            return self.last.result
        if self._rest is None or self._rest[0] is not self.scene:
            self._rest = self.scene, simulate(self.scene, until=FRAME_S)
        return self._rest[1]

    def sight(self, aim: Aim) -> dict[str, Any]:
        """The line of aim (`Sight.along`)."""
        if self._sight[0] is not self.scene:
            self._sight = self.scene, self._looking()
        return self._sight[1].along(aim.strike(self.ball(CUE)))

    def _looking(self) -> Sight:
        return Sight(self.scene, CUE, LONGEST_S)

    # --- playing --------------------------------------------------------------------------------------------------

    def aimed(self, aim: Aim) -> Scene:
        """The scene of a shot: the balls as they lie, and the cue ball struck."""
        struck = aim.strike(self.ball(CUE))
        moved = {
            "velocity": tuple(struck.velocity.tolist()),
            "angular_velocity": tuple(struck.angular_velocity.tolist()),
        }
        balls = [b.model_copy(update=moved) if b.name == CUE else b for b in self.scene.spheres]
        found = _with_balls(self.scene, balls)
        found.title = f"{self.scene.title}, shot {self.shots + 1}"
        return found

    def shoot(self, aim: Aim) -> Played:
        """Play a shot to rest. Balls that left are gone; the cue ball comes back."""
        scene = self.aimed(aim)
        result = simulate(scene, stop=AtRest(ignore_spin=True))
        played = Played(scene, result, self.table.shot(result, CUE))
        position, turned = np.asarray(result.position[-1]), np.asarray(result.orientation[-1])
        lie = []
        for ball in self.scene.spheres:
            k = result.names.index(ball.name)
            if result.present[-1][k]:
                found = {"position": tuple(position[k].tolist()), "orientation": tuple(turned[k].tolist())}
                lie.append(ball.model_copy(update=found))
            elif ball.name == CUE:
                lie.append(ball)
        self._past.append((self.scene, aim))
        self.scene, self.last, self.shots = _with_balls(self.scene, lie), played, self.shots + 1
        self.changes += 1
        if played.shot.scratch:
            self._lay(CUE, self._free())
        return played

    def place(self, name: str, at: tuple[float, float]) -> None:
        """Move a ball by hand; refused where it would overlap something."""
        ball = self.ball(name)
        if not all(map(is_finite, at)):
            raise CaromError(f"play: a place is two finite numbers, found {quoted(list(at))}")
        place = (*at, ball.radius)
        check_place(self.table, name, place, ball.radius)
        for other in self.scene.spheres:
            if other is not ball and overlap(place, ball.radius, other.position, other.radius):
                raise CaromError(f"{name} would overlap {other.name} there")
        self._past.append((self.scene, None))
        self.last = None
        self.changes += 1
        self._lay(name, at)

    def undo(self) -> Aim | None:
        """Back to before the last shot or the last ball that was moved; returns the aim of the shot."""
        if not self._past:
            raise CaromError("there is nothing to undo")
        self.scene, aim = self._past.pop()
        self.last = None
        self.shots -= aim is not None
        self.changes += 1
        return aim

    def saved(self, aim: Aim) -> str:
        """The last shot as a scenario; without one, the shot as it is aimed."""
        scene = self.aimed(aim) if self.last is None else self.last.scene
        return scene.to_toml()

    def _lay(self, name: str, at: tuple[float, float]) -> None:
        ball = self.ball(name)
        moved = ball.model_copy(update={"position": (*at, ball.radius)})
        self.scene = _with_balls(self.scene, [moved if b is ball else b for b in self.scene.spheres])

    def _free(self) -> tuple[float, float]:
        """The place nearest to the head spot, on the line across the table, that no ball covers."""
        cue = self.ball(CUE)
        x, middle = self.table.spots["head spot"]
        others = [b for b in self.scene.spheres if b is not cue]
        half = int(0.5 * self.table.spec.width / cue.radius) - 2
        for k in sorted(range(-half, half + 1), key=abs):
            at = (x, middle + k * cue.radius, cue.radius)
            if not any(overlap(at, cue.radius, b.position, b.radius) for b in others):
                return at[:2]
        raise CaromError("play: the balls leave no place for the cue ball; undo, or move one of them")


def set_up(table: str, rack: str, seed: int) -> Scene:
    """A table with a cue ball and the balls of a game, or "three" on a line."""
    kit = billiards.table(table)
    scene = kit.scene(f"{rack} on a {table} table")
    kit.cue_ball(scene)
    if rack == "three":
        for name, spot in (("1", "centre spot"), ("2", "foot spot")):
            kit.ball(scene, name, at=spot)
    elif rack not in GAMES:
        raise CaromError(f"rack: no game is called {rack!r}; {did_you_mean(rack, ['three', *GAMES])}")
    else:
        kit.rack(scene, order=rack, gap=GAP, jitter=GAP / 5, seed=seed)
    return scene


def _with_balls(scene: Scene, balls: list[Sphere]) -> Scene:
    """The scene with these balls in place of its own; all else is shared."""
    return Scene._of(scene._tree.model_copy(update={"sphere": balls}))
