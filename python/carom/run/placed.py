"""Where the bodies of a state have been placed: balls follow their clumps, and joints must hold where their ends are, and
as fast as these are.

A state may be changed before it is restored. The core takes it as it is, and a step would move what does not fit
together by a jump without physical meaning, or by an impulse.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from carom.arrays import F64
from carom.errors import CaromError, quoted
from carom.scene.assembly.arrays import bodies as all_balls
from carom.scene.assembly.bodies import Bodies
from carom.scene.assembly.mechanics import GROUND_INDEX, Row, arm, joint_rows, numbers
from carom.scene.assembly.rotations import inverse, product, rotated, rotated_back
from carom.scene.checks.joint_start import REFUSED, UNNOTICED
from carom.scene.tables.joints import default_name
from carom.scene.tables.laws import slope_at, value_at

if TYPE_CHECKING:
    from carom.scene.scene import Scene

#: Distance (in radii) or angle (rad) by which a ball may be off its clump: rounding is some 1e-15 of where it is.
APART = 1e-6

State = Mapping[str, Any]


class Placement:
    """The clumps and joints of a scene, which say where balls may be."""

    def __init__(self, scene: Scene, model: Mapping[str, Any]) -> None:
        self._radius: F64 = np.asarray(model["radius"])
        self._names = scene.names
        count = len(self._names)
        self._clumps = []
        self._carrier = list(range(count))  # what moves a ball: itself, or its clump
        for k, clump in enumerate(model.get("clumps", ())):
            balls = slice(*clump["balls"])
            axes = np.array(clump["orientation"])
            offsets = rotated_back(axes, model["position"][balls] - np.array(clump["position"]))
            turns = product(inverse(axes), model["orientation"][balls])
            self._clumps.append((count + k, balls, offsets, turns))
            self._carrier[balls] = [count + k] * len(offsets)
        tree = scene._tree
        # Moreau-Jean holds joints by their velocities alone: places drift, and no step takes them back.
        self._drifts = scene.run.method == "moreau"
        self._joints: list[tuple[str, int, int, Row, F64, F64]] = []
        self._turns: list[tuple[str, int, int, list[Row], F64]] = []
        if tree.joint:
            start = all_balls(tree)
            number = numbers(start)
            for k, joint in enumerate(tree.joint):
                a, b, rows = joint_rows(joint, start, number)
                name = joint.name or default_name(k)
                self._joints += [(name, a, b, row, *_arms(row, (a, b), start)) for row in rows]
                if rows[0].kind == "rotation":
                    self._turns.append((name, a, b, rows, _relative(start.orientation, a, b)))

    def __bool__(self) -> bool:
        return bool(self._clumps or self._joints)

    def follow(self, state: State, here: State) -> dict[str, Any]:
        """The state with the balls of clumps where these have been placed; `here` is the state as it stands now.

        Raises where balls have been placed, and their clump has not. What is no state at all is left to the core.
        """
        found = dict(state)
        places = _places(state, here)
        if places is None:
            return found
        x, q, present = places
        moved = False
        for body, balls, offsets, turns in self._clumps:
            if not present[body]:
                continue
            centres, faces = x[body] + rotated(q[body], offsets), product(q[body], turns)
            if self._fit(balls, x[balls] - centres, q[balls], faces):
                continue
            stays = all(np.array_equal(now[body], here[key][body]) for key, now in _named(x, q))
            if stays or not self._rigid(balls, x[balls], offsets):
                raise CaromError(
                    f"restore: balls of a clump are not where it is: place the clump, row {body} of position and"
                    " orientation, and its balls follow"
                )
            x[balls], q[balls], moved = centres, faces, True
        return found | dict(_named(x, q)) if moved else found

    def _fit(self, balls: slice, off: F64, q: F64, wanted: F64) -> bool:
        turned = 2.0 * np.linalg.norm(product(inverse(wanted), q)[:, 1:], axis=1)
        return bool(
            (np.linalg.norm(off, axis=1) <= APART * self._radius[balls]).all() and turned.max() <= APART
        )

    def _rigid(self, balls: slice, x: F64, offsets: F64) -> bool:
        """Whether balls are as far from one another as in their clump."""
        apart, wanted = (np.linalg.norm(p[:, None] - p[None], axis=2) for p in (x, offsets))
        return bool(np.abs(apart - wanted).max() <= APART * self._radius[balls].min())

    def refuse_off_joints(self, state: State, here: State, step: float) -> None:
        """Raise where a joint does not hold at the places, the velocities and the time of a state."""
        places, motion = _places(state, here), _motion(state, here)
        if not self._joints or places is None:
            return
        x, q, _ = places
        time = float(np.ravel(state["step"])[0]) * step
        for name, a, b, row, arm_a, arm_b in self._joints:
            ends = x[a] + rotated(q[a], arm_a), arm_b if b == GROUND_INDEX else x[b] + rotated(q[b], arm_b)
            law = value_at(row.law, time)
            is_rod, span = row.kind == "distance", ends[0] - ends[1]
            found = float(np.linalg.norm(span) if is_rod else span @ np.array(row.direction))
            most = REFUSED * (max(abs(law), math.ulp(0.0)) if is_rod else self._radius[a])
            told = None
            if abs(found - law) > most and row.kind != "rotation" and not self._drifts:
                what = "distance of its ends" if is_rod else "displacement of its points"
                told = f"the {what} is {found:.6g} m, it holds {law:.6g} m; place"
            elif motion is not None:
                told = self._off_rate((a, b), row, ends, (x, *motion), (time, step))
            if told:
                self._refuse(name, a, b, told)
        for name, a, b, rows, first in [] if self._drifts else self._turns:
            if told := _off_turn(rows, b, product(_relative(q, a, b), inverse(first)), time):
                self._refuse(name, a, b, told)

    def _refuse(self, name: str, a: int, b: int, told: str) -> None:
        both = " and ".join(quoted(self._names[k]) for k in (a, b) if k != GROUND_INDEX)
        raise CaromError(f"restore: joint {quoted(name)} of {both}: {told} all that it joins together")

    def _off_rate(
        self,
        bodies: tuple[int, int],
        row: Row,
        ends: tuple[F64, F64],
        at: tuple[F64, F64, F64],
        now: tuple[float, float],
    ) -> str | None:
        """What is wrong with the velocities of the bodies of a joint, as at the start of a scene; `at` are places,
        velocities and angular velocities of all, `now` time and step. Its directions turn in a step, and its rate has two
        values where its law has a kink.
        """
        time, step = now
        points, turns, sizes = [], [], []
        for body, point in zip(bodies, ends, strict=True):
            place, v, w = (np.zeros(3) if body == GROUND_INDEX else of[self._carrier[body]] for of in at)
            points.append(v + np.cross(w, point - place))
            turns.append(w)
            sizes.append(
                (np.linalg.norm(w), np.linalg.norm(v) + np.linalg.norm(w) * np.linalg.norm(point - place))
            )
        (spin, fast), along = np.sum(sizes, axis=0), np.array(row.direction)
        apart, what, unit, size = points[0] - points[1], "speed of its points", "m/s", self._radius[bodies[0]]
        turning = spin
        if row.kind == "rotation":
            apart, what, unit, size, fast = (
                turns[0] - turns[1],
                "angular speed about its axis",
                "rad/s",
                1.0,
                spin,
            )
        elif row.kind == "distance":
            length = np.linalg.norm(ends[0] - ends[1])
            along, what = (ends[0] - ends[1]) / length, "speed at which its ends part"
            turning = spin + np.linalg.norm(apart) / length
        rate, held = float(apart @ along), []
        for h in (-0.01 * step, 0.01 * step):
            slope, doubt = slope_at(row.law, time, h)
            slope = slope if abs(slope) > doubt else 0.0
            allowed = (REFUSED + step * turning) * (fast + abs(slope)) + 10.0 * doubt
            held.append(abs(rate - slope) <= max(allowed, UNNOTICED * size / step))
        return None if any(held) else f"the {what} is {rate:.6g} {unit}, it holds {slope:.6g} {unit}; strike"


def _relative(q: F64, a: int, b: int) -> F64:
    """Orientation of body a in the axes of body b or of the ground."""
    return q[a] if b == GROUND_INDEX else product(inverse(q[b]), q[a])


def _off_turn(rows: list[Row], b: int, turn: F64, time: float) -> str | None:
    """What is wrong with the turn of a joint's bodies against one another since the start.

    Rows hold rates about axes fixed in space, of which an angle is what they leave if nothing else turns: three leave no
    turn, two to the ground one about the axis across both, and one holds the angle of a body that turned about it alone.
    """
    axes = np.array([row.direction for row in rows])
    turn = turn / max(math.hypot(*turn), math.ulp(0.0))  # what is no rotation is left to the core
    law = value_at(rows[0].law, time)
    if len(axes) == 3:
        found = 2.0 * math.atan2(float(np.linalg.norm(turn[1:])), abs(float(turn[0])))
        what = "its turn since the start"
    elif b != GROUND_INDEX:
        return None
    elif len(axes) == 2:
        free = np.cross(*axes)
        found, what = _tilt(turn, free / np.linalg.norm(free)), "the tilt of the axis that it leaves free"
    elif _tilt(turn, axes[0]) > APART:
        return None
    else:
        angle = 2.0 * math.atan2(float(turn[1:] @ axes[0]), float(turn[0]))
        found, what = law + math.remainder(angle - law, 2.0 * math.pi), "its angle, but for whole turns,"
    return f"{what} is {found:.6g} rad, it holds {law:.6g} rad; place" if abs(found - law) > REFUSED else None


def _tilt(turn: F64, axis: F64) -> float:
    """Angle by which an axis has turned, rad."""
    moved = rotated(turn, axis)
    return math.atan2(float(np.linalg.norm(np.cross(axis, moved))), float(axis @ moved))


def _arms(row: Row, ends: tuple[int, int], start: Bodies) -> tuple[F64, F64]:
    a, b = (np.array(arm(k, point, start)) for k, point in zip(ends, (row.point_a, row.point_b), strict=True))
    return a, b


def _named(x: F64, q: F64) -> tuple[tuple[str, F64], tuple[str, F64]]:
    return ("position", x), ("orientation", q)


def _places(state: State, here: State) -> tuple[F64, F64, F64] | None:
    """Places and orientations of a state, and who is there; None of what is no state of these bodies."""
    try:
        x, q = (np.array(state[key], dtype=np.float64) for key in ("position", "orientation"))
        present = np.asarray(state.get("present", np.ones(len(x), dtype=bool)))
    except (KeyError, TypeError, ValueError):
        return None
    if (
        x.shape != here["position"].shape
        or q.shape != here["orientation"].shape
        or present.shape != x.shape[:1]
    ):
        return None
    return (x, q, present) if np.isfinite(x).all() and np.isfinite(q).all() else None


def _motion(state: State, here: State) -> tuple[F64, F64] | None:
    """Velocities and angular velocities of a state; None of what is no state of these bodies."""
    try:
        v, w = (np.array(state[key], dtype=np.float64) for key in ("velocity", "angular_velocity"))
    except (KeyError, TypeError, ValueError):
        return None
    fit = v.shape == here["velocity"].shape and w.shape == here["angular_velocity"].shape
    return (v, w) if fit and np.isfinite(v).all() and np.isfinite(w).all() else None
